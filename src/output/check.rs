//! Is a folder of frames whole? Which are missing, damaged, or made with other settings.

use super::manifest::{self, Line};
use super::pattern::Pattern;
use super::read::{self, Loaded};
use crate::{Error, Result};
use rayon::prelude::*;
use std::collections::{BTreeMap, BTreeSet};
use std::fmt;
use std::path::{Path, PathBuf};

/// What is wrong with a frame.
#[derive(Debug, Clone, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "kebab-case", tag = "problem")]
pub enum Problem {
    /// There is no such file.
    Missing,
    /// It cannot be read whole.
    Corrupt {
        /// What the reader said.
        reason: String,
    },
    /// It has another size than the sequence.
    WrongSize {
        /// What it has.
        found: (u32, u32),
        /// What the sequence has.
        expected: (u32, u32),
    },
    /// Other settings, another scene, seed or version made it.
    OtherSettings {
        /// Names of the settings that differ; empty where no settings are stored, or only scene, seed or version differ.
        differing: Vec<String>,
    },
}

impl fmt::Display for Problem {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Missing => write!(f, "missing"),
            Self::Corrupt { reason } => write!(f, "corrupt: {reason}"),
            Self::WrongSize { found, expected } => {
                write!(f, "has {}x{} pixels, expected {}x{}", found.0, found.1, expected.0, expected.1)
            }
            Self::OtherSettings { differing } if differing.is_empty() => {
                write!(f, "made with another scene, seed, version or unknown settings")
            }
            Self::OtherSettings { differing } => write!(f, "made with other settings: {}", differing.join(", ")),
        }
    }
}

/// A frame's file and what is wrong with it.
#[derive(Debug, Clone, PartialEq, Eq, serde::Serialize)]
pub struct Finding {
    /// Frame number.
    pub frame: i64,
    /// Its file.
    pub path: PathBuf,
    /// What is wrong.
    #[serde(flatten)]
    pub problem: Problem,
}

/// One sequence of a folder.
#[derive(Debug, Clone, PartialEq, Eq, serde::Serialize)]
pub struct Sequence {
    /// Its pattern, as [`Pattern`] displays it.
    pub pattern: String,
    /// How many files it should have.
    pub expected: usize,
    /// What is wrong, in order of frames.
    pub findings: Vec<Finding>,
}

/// What a sequence's files should be.
#[derive(Debug)]
struct Expectation {
    pattern: String,
    files: BTreeMap<PathBuf, i64>,
    size: Option<(u32, u32)>,
    settings_hash: Option<String>,
    settings: Option<serde_json::Value>,
}

/// Checks every sequence in `folder`: those that manifests name and, where a file belongs to none, those that file names
/// and numbers suggest (from their first to their last number, with the commonest size and settings as the right ones).
///
/// # Errors
/// [`Error::Io`] if the folder cannot be listed, [`Error::Invalid`] if it holds no frames.
pub fn check(folder: &Path) -> Result<Vec<Sequence>> {
    check_frames(folder, &[])
}

/// As [`check`], but of each sequence looks at the frames `wanted` alone and expects every one of them, even if nothing
/// in the folder says so: many machines may each know of its own frames alone, and one may never have begun. With none
/// wanted it is [`check`].
///
/// # Errors
/// As [`check`].
pub fn check_frames(folder: &Path, wanted: &[i64]) -> Result<Vec<Sequence>> {
    let entries = std::fs::read_dir(folder).map_err(|source| Error::io(folder, "list", source))?;
    let mut manifests = Vec::new();
    let mut pictures = BTreeSet::new();
    for entry in entries {
        let path = entry.map_err(|source| Error::io(folder, "list", source))?.path();
        let name = path.file_name().map_or_else(String::new, |name| name.to_string_lossy().into_owned());
        if name.ends_with(".manifest.jsonl") {
            manifests.push(path);
        } else if !name.starts_with('.') && (name.ends_with(".exr") || name.ends_with(".png")) {
            pictures.insert(path);
        }
    }
    manifests.sort();
    let mut expectations = Vec::new();
    for path in &manifests {
        expectations.extend(from_manifest(folder, &manifest::read(path)?)?);
    }
    for expectation in &expectations {
        pictures.retain(|path| !expectation.files.contains_key(path));
    }
    expectations.extend(from_names(folder, &pictures));
    if expectations.is_empty() {
        return Err(Error::invalid(
            folder.display().to_string(),
            "holds no manifest and no numbered .exr or .png files",
        ));
    }
    let wanted: BTreeSet<i64> = wanted.iter().copied().collect();
    for expectation in expectations.iter_mut().filter(|_| !wanted.is_empty()) {
        expectation.files.retain(|_, frame| wanted.contains(frame));
        let pattern: Pattern = expectation.pattern.parse()?;
        let known: BTreeSet<i64> = expectation.files.values().copied().collect();
        let more = wanted.difference(&known);
        expectation.files.extend(more.map(|&frame| (folder.join(pattern.path(frame)), frame)));
    }
    Ok(expectations.into_iter().map(check_sequence).collect())
}

/// The last run of each pattern rules its settings; frames are those of all runs with these settings.
fn from_manifest(folder: &Path, lines: &[Line]) -> Result<Vec<Expectation>> {
    let mut sequences: BTreeMap<&str, Expectation> = BTreeMap::new();
    for line in lines {
        let Line::Sequence(run) = line else { continue };
        let pattern: Pattern = run.pattern.parse()?;
        let entry = sequences.entry(&run.pattern).or_insert_with(|| Expectation {
            pattern: run.pattern.clone(),
            files: BTreeMap::new(),
            size: None,
            settings_hash: None,
            settings: None,
        });
        entry.size = Some(run.size);
        entry.settings_hash = Some(run.record.settings_hash.clone());
        entry.settings = Some(run.record.settings.clone());
        for &frame in &run.frames {
            entry.files.insert(folder.join(pattern.path(frame)), frame);
        }
    }
    // Frames of separate fields have two files, which only their own lines name.
    for line in lines {
        let Line::Frame(done) = line else { continue };
        for sequence in sequences.values_mut() {
            let pattern: Pattern = sequence.pattern.parse()?;
            let single = folder.join(pattern.path(done.frame));
            let names = [pattern.path_with_suffix(done.frame, "top"), pattern.path_with_suffix(done.frame, "bottom")];
            if done.files.len() == 2 && names.iter().all(|name| done.files.iter().any(|file| Path::new(file) == name)) {
                sequence.files.remove(&single);
                sequence.files.extend(names.map(|name| (folder.join(name), done.frame)));
            }
        }
    }
    Ok(sequences.into_values().collect())
}

/// Sequences that numbered names suggest.
fn from_names(folder: &Path, pictures: &BTreeSet<PathBuf>) -> Vec<Expectation> {
    let mut groups: BTreeMap<(String, String, usize), BTreeMap<PathBuf, i64>> = BTreeMap::new();
    for path in pictures {
        let Some(name) = path.file_name().and_then(|name| name.to_str()) else { continue };
        let Some((before, digits, after)) = last_number(name) else { continue };
        // Numbers that begin with a zero are padded; others may be of any length.
        let padding = if digits.starts_with('0') || digits.len() >= 4 { digits.len() } else { 1 };
        let (before, negative) = match before.strip_suffix("-") {
            Some(shorter) if shorter.is_empty() || shorter.ends_with(['.', '_']) => (shorter, true),
            _ => (before, false),
        };
        let Ok(number) = digits.parse::<i64>() else { continue };
        let frame = if negative { -number } else { number };
        let key = (before.to_owned(), after.to_owned(), padding);
        groups.entry(key).or_default().insert(path.clone(), frame);
    }
    let mut all = Vec::new();
    for ((before, after, padding), mut files) in groups {
        let (Some(&first), Some(&last)) = (files.values().min(), files.values().max()) else { continue };
        let Ok(pattern) = format!("{before}{{frame:0{padding}}}{after}").parse::<Pattern>() else { continue };
        // A hole of millions is two sequences under one name rather than a missing middle.
        if last.abs_diff(first) < 1_000_000 {
            for frame in first..=last {
                if !files.values().any(|&known| known == frame) {
                    files.insert(folder.join(pattern.path(frame)), frame);
                }
            }
        }
        all.push(Expectation { pattern: pattern.to_string(), files, size: None, settings_hash: None, settings: None });
    }
    all
}

/// `name` split about its last run of digits before the extension.
fn last_number(name: &str) -> Option<(&str, &str, &str)> {
    let stem = name.rfind('.')?;
    let end = name[..stem].rfind(|c: char| c.is_ascii_digit())? + 1;
    let start = name[..end]
        .rfind(|c: char| !c.is_ascii_digit())
        .map_or(0, |at| at + name[at..].chars().next().map_or(1, char::len_utf8));
    Some((&name[..start], &name[start..end], &name[end..]))
}

fn check_sequence(expectation: Expectation) -> Sequence {
    let files: Vec<(&PathBuf, &i64)> = expectation.files.iter().collect();
    let loaded: Vec<Option<Result<Loaded>>> =
        files.par_iter().map(|(path, _)| path.exists().then(|| read::read(path).map(without_pixels))).collect();
    let good = || loaded.iter().flatten().flatten();
    let size = expectation.size.or_else(|| commonest(good().map(|picture| picture.size)));
    let hash = expectation
        .settings_hash
        .clone()
        .or_else(|| commonest(good().map(|picture| picture.stored.settings_hash.clone())).flatten());
    let settings = expectation.settings.clone().or_else(|| {
        let like = good().find(|picture| picture.stored.settings_hash == hash)?;
        serde_json::from_str(like.stored.settings.as_ref()?).ok()
    });
    let mut findings: Vec<Finding> = Vec::new();
    for ((path, frame), picture) in files.iter().zip(&loaded) {
        let problem = match picture {
            None => Some(Problem::Missing),
            Some(Err(error)) => Some(Problem::Corrupt { reason: reason(error) }),
            Some(Ok(picture)) => problem_of(picture, size, hash.as_deref(), settings.as_ref()),
        };
        if let Some(problem) = problem {
            findings.push(Finding { frame: **frame, path: (*path).clone(), problem });
        }
    }
    findings.sort_by(|a, b| (a.frame, &a.path).cmp(&(b.frame, &b.path)));
    Sequence { pattern: expectation.pattern, expected: files.len(), findings }
}

/// A thousand frames need not all be held.
fn without_pixels(mut picture: Loaded) -> Loaded {
    picture.rgb = Vec::new();
    picture.alpha = None;
    picture.planes = Vec::new();
    picture
}

fn reason(error: &Error) -> String {
    match error {
        Error::Picture { problem, .. } => problem.clone(),
        other => other.to_string(),
    }
}

fn problem_of(
    picture: &Loaded,
    size: Option<(u32, u32)>,
    hash: Option<&str>,
    settings: Option<&serde_json::Value>,
) -> Option<Problem> {
    let stored = &picture.stored;
    // A separate field is half as high as its frame.
    let half = |expected: (u32, u32)| match stored.order {
        Some(order @ super::FieldOrder::Separate { .. }) => (expected.0, order.lines().rows(expected.1)),
        _ => expected,
    };
    if let Some(expected) = size.map(half).filter(|&expected| expected != picture.size) {
        // Of a sequence without a manifest the commonest size may be a field's own.
        if size != Some(picture.size) {
            return Some(Problem::WrongSize { found: picture.size, expected });
        }
    }
    if hash.is_none() || stored.settings_hash.as_deref() == hash {
        return None;
    }
    let own = stored.settings.as_ref().and_then(|text| serde_json::from_str::<serde_json::Value>(text).ok());
    Some(Problem::OtherSettings { differing: differing(own.as_ref(), settings) })
}

/// Names of the settings that differ, parts of a setting behind a point: `render.runs`.
fn differing(a: Option<&serde_json::Value>, b: Option<&serde_json::Value>) -> Vec<String> {
    let (Some(serde_json::Value::Object(a)), Some(serde_json::Value::Object(b))) = (a, b) else { return Vec::new() };
    let names: BTreeSet<&String> = a.keys().chain(b.keys()).collect();
    let mut found = Vec::new();
    for name in names.into_iter().filter(|name| a.get(*name) != b.get(*name)) {
        let inner = differing(a.get(name), b.get(name));
        if inner.is_empty() {
            found.push(name.clone());
        }
        found.extend(inner.iter().map(|part| format!("{name}.{part}")));
    }
    found
}

/// The value that occurs most often; of several the first that does.
fn commonest<T: PartialEq>(values: impl Iterator<Item = T>) -> Option<T> {
    let mut counts: Vec<(T, usize)> = Vec::new();
    for value in values {
        match counts.iter_mut().find(|(known, _)| *known == value) {
            Some((_, count)) => *count += 1,
            None => counts.push((value, 1)),
        }
    }
    counts.into_iter().rev().max_by_key(|(_, count)| *count).map(|(value, _)| value)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_found_before_the_extension() {
        assert_eq!(last_number("pool.0007.exr"), Some(("pool.", "0007", ".exr")));
        assert_eq!(last_number("0007.exr"), Some(("", "0007", ".exr")));
        assert_eq!(last_number("a1b.0002.top.png"), Some(("a1b.", "0002", ".top.png")));
        assert_eq!(last_number("ä7.png"), Some(("ä", "7", ".png")));
        assert_eq!(last_number("still.png"), None);
    }

    #[test]
    fn settings_that_differ_are_named_to_the_depth_where_they_do() {
        let a = serde_json::json!({ "render": { "runs": 4, "size": [64, 36] }, "finish": "Half" });
        let b = serde_json::json!({ "render": { "runs": 8, "size": [64, 36] }, "lens": null });
        assert_eq!(differing(Some(&a), Some(&b)), ["finish", "lens", "render.runs"]);
        assert!(differing(Some(&a), Some(&a)).is_empty() && differing(None, Some(&b)).is_empty());
    }

    #[test]
    fn the_commonest_value_rules() {
        assert_eq!(commonest([1, 2, 2, 3].into_iter()), Some(2));
        assert_eq!(commonest([5, 6].into_iter()), Some(5));
        assert_eq!(commonest(std::iter::empty::<u8>()), None);
    }
}
