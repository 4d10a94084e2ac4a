//! The manifest beside a sequence, and what `--stats` writes: JSON, one object a line.
//!
//! `pool.manifest.jsonl` stands beside `pool.####.exr`. A line of kind `sequence` says what a run set out to make, a line
//! of kind `frame` what it finished. Runs append, so several machines may share one; the last line of a frame counts. A
//! line cut short by a crash is ignored.

use super::file::append_line;
use super::pattern::Pattern;
use super::picture::Record;
use crate::{Error, Result};
use std::path::{Path, PathBuf};

/// One line.
#[derive(Debug, Clone, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(tag = "kind", rename_all = "lowercase")]
pub enum Line {
    /// What a run set out to make.
    Sequence(SequenceLine),
    /// A finished frame.
    Frame(FrameLine),
}

/// What a run set out to make.
#[derive(Debug, Clone, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct SequenceLine {
    /// File name pattern, without folders.
    pub pattern: String,
    /// The frames.
    pub frames: Vec<i64>,
    /// Columns and rows of every file.
    pub size: (u32, u32),
    /// What made it.
    pub record: Record,
}

/// A finished frame.
#[derive(Debug, Clone, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct FrameLine {
    /// Frame number.
    pub frame: i64,
    /// Its files' names, without folders: two for separate fields.
    pub files: Vec<String>,
    /// [`Record::settings_hash`].
    pub settings_hash: String,
    /// What it took.
    pub stats: FrameStats,
}

/// What a frame took: a line of `--stats`.
#[derive(Debug, Clone, PartialEq, Default, serde::Serialize, serde::Deserialize)]
pub struct FrameStats {
    /// Frame number.
    pub frame: i64,
    /// Seconds to load the scene, as part of this frame: zero but for a run's first.
    pub load_s: f64,
    /// Seconds to pose the scene and build what rays traverse.
    pub build_s: f64,
    /// Seconds to render.
    pub render_s: f64,
    /// Seconds to encode and write.
    pub write_s: f64,
    /// Processor seconds over all threads.
    pub cpu_s: f64,
    /// Runs.
    pub samples: u64,
    /// Rays of all kinds.
    pub rays: u64,
    /// Most memory that the process has held, bytes.
    pub peak_memory: u64,
    /// Runs left out because they were not finite.
    pub rejected: u64,
    /// Passes over the picture, where sampling stopped by itself: `--passes` with this number repeats it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub passes: Option<u32>,
    /// Expected root mean squared error of the picture, from the estimated variance; infinite, in JSON `null`, where
    /// pixels have a single run.
    #[serde(with = "null_if_infinite")]
    pub standard_error: f64,
}

/// JSON has no infinity.
mod null_if_infinite {
    use serde::{Deserialize, Deserializer, Serializer};

    pub(super) fn serialize<S: Serializer>(value: &f64, serializer: S) -> Result<S::Ok, S::Error> {
        if value.is_finite() { serializer.serialize_f64(*value) } else { serializer.serialize_none() }
    }

    pub(super) fn deserialize<'de, D: Deserializer<'de>>(deserializer: D) -> Result<f64, D::Error> {
        Option::<f64>::deserialize(deserializer).map(|value| value.unwrap_or(f64::INFINITY))
    }
}

/// A sequence's manifest.
#[derive(Debug, Clone)]
pub struct Manifest {
    path: PathBuf,
}

impl Manifest {
    /// The manifest of the sequence `pattern`: `out/pool.####.exr` has `out/pool.manifest.jsonl`.
    #[must_use]
    pub fn beside(pattern: &Pattern) -> Self {
        let path = pattern.path(0);
        let stem = pattern.stem();
        Self { path: path.with_file_name(format!("{stem}.manifest.jsonl")) }
    }

    /// Its file.
    #[must_use]
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Appends a line.
    ///
    /// # Errors
    /// [`Error::Io`].
    pub fn append(&self, line: &Line) -> Result<()> {
        append_json(&self.path, line)
    }
}

/// Appends `value` as a line of JSON to the file `path`: a manifest's or a statistics' line.
///
/// # Errors
/// [`Error::Io`].
pub fn append_json(path: &Path, value: &impl serde::Serialize) -> Result<()> {
    let text = serde_json::to_string(value)
        .map_err(|error| Error::invalid(path.display().to_string(), format!("cannot hold this line: {error}")))?;
    append_line(path, &text)
}

/// The lines of a manifest that can be read, in order.
///
/// # Errors
/// [`Error::Io`] if the file cannot be read.
pub fn read(path: &Path) -> Result<Vec<Line>> {
    let bytes = std::fs::read(path).map_err(|source| Error::io(path, "read", source))?;
    Ok(String::from_utf8_lossy(&bytes).lines().filter_map(|line| serde_json::from_str(line).ok()).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_read_back_even_where_the_error_is_unknown() {
        let folder = tempfile::tempdir().unwrap();
        let pattern: Pattern = folder.path().join("a_%d.exr").to_str().unwrap().parse().unwrap();
        let manifest = Manifest::beside(&pattern);
        assert_eq!(manifest.path(), folder.path().join("a.manifest.jsonl"));
        let lines: Vec<Line> = [f64::INFINITY, 0.125]
            .into_iter()
            .map(|standard_error| {
                let stats = FrameStats { frame: 3, rays: 1 << 60, standard_error, ..FrameStats::default() };
                Line::Frame(FrameLine { frame: 3, files: vec!["a_3.exr".into()], settings_hash: "x".into(), stats })
            })
            .collect();
        for line in &lines {
            manifest.append(line).unwrap();
        }
        assert_eq!(read(manifest.path()).unwrap(), lines);
    }
}
