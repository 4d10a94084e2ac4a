//! Contact sheets: every glTF file of a folder as one small labelled picture.
//!
//! A sheet is made to be looked at, so that a file which loads but looks wrong is found among hundreds. Files may be
//! lit in physical units (a sun of 100 000 lux beside a lamp of 10 candela), so each picture is exposed for itself: see
//! [`exposure`].

use super::poster::{LETTER, LINE, Poster, wrapped};
use crate::output::{Picture, View, ViewTransform};
use crate::{Error, Result};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};

/// One file.
#[derive(Debug, Clone)]
pub struct Cell {
    /// Its path below the folder, with slashes.
    pub name: String,
    /// Its picture, or why there is none.
    pub content: std::result::Result<Shown, String>,
}

/// A picture as it is shown.
#[derive(Debug, Clone)]
pub struct Shown {
    /// sRGB codes, row by row.
    codes: Vec<[u8; 3]>,
    /// Number of the frame.
    pub frame: i64,
    /// Stops that it was brightened by.
    pub exposure_ev: f64,
}

/// How a sheet is laid out.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Layout {
    /// Cells in a row, at least 1.
    pub columns: usize,
    /// Rows of a page, at least 1.
    pub rows: usize,
    /// Columns and lines of each picture.
    pub cell: (u32, u32),
}

const GAP: usize = 6;
const PAPER: [u8; 3] = [255; 3];
const INK: [u8; 3] = [20; 3];
const PALE: [u8; 3] = [120; 3];
const ALARM: [u8; 3] = [176, 0, 32];
/// Lines of text under a picture: file, folder, frame and exposure.
const LABEL_LINES: usize = 3;

/// Every `.gltf` and `.glb` file in `folder` and below, in the order of their paths; `folder` may also be one such file.
/// Linked folders are not entered: they may lead in circles.
///
/// # Errors
/// If a folder cannot be listed.
pub fn files(folder: &Path) -> Result<Vec<PathBuf>> {
    if folder.is_file() {
        return Ok(vec![folder.to_path_buf()]);
    }
    let is_gltf =
        |path: &Path| path.extension().is_some_and(|e| e.eq_ignore_ascii_case("gltf") || e.eq_ignore_ascii_case("glb"));
    let (mut found, mut pending) = (Vec::new(), vec![folder.to_path_buf()]);
    while let Some(folder) = pending.pop() {
        for entry in std::fs::read_dir(&folder).map_err(|e| Error::io(&folder, "list", e))? {
            let entry = entry.map_err(|e| Error::io(&folder, "list", e))?;
            let path = entry.path();
            if entry.file_type().is_ok_and(|t| t.is_dir()) {
                pending.push(path);
            } else if is_gltf(&path) && path.is_file() {
                found.push(path);
            }
        }
    }
    found.sort();
    Ok(found)
}

/// The cell of `file` below `folder`, with the picture that `render` makes of it. An error becomes its sentence, and so
/// does a panic: one file must not cost the sheet.
pub fn cell(folder: &Path, file: &Path, view: Option<f64>, render: impl FnOnce() -> Result<Picture>) -> Cell {
    let below = file.strip_prefix(folder).ok().filter(|p| !p.as_os_str().is_empty());
    let name = below.unwrap_or(file).to_string_lossy().replace('\\', "/");
    let content = match catch_unwind(AssertUnwindSafe(render)) {
        Ok(Ok(picture)) => Ok(shown(&picture, view)),
        // The label names the file already.
        Ok(Err(e)) => Err(e.to_string().replace(&format!("{}: ", file.display()), "")),
        Err(_) => Err("the program failed on this file: this is a defect of the program".to_owned()),
    };
    Cell { name, content }
}

/// Exposed by `ev` stops, or automatically, through a view that keeps base colours and compresses highlights.
#[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "codes from 0 to 255")]
fn shown(picture: &Picture, ev: Option<f64>) -> Shown {
    let rgb = picture.whole_rgb();
    let exposure_ev = ev.unwrap_or_else(|| exposure(&rgb));
    let view = View { transform: ViewTransform::KhronosNeutral, exposure_ev };
    let codes = rgb.iter().map(|&p| view.encode(p).to_array().map(|c| (c * 255.0 + 0.5) as u8)).collect();
    Shown { codes, frame: picture.metadata.frame, exposure_ev }
}

/// The stops that bring the 95th percentile of the luminance of a picture's lit pixels to 0.8, rounded to a tenth; 0
/// where nothing is lit. Pixels that are exactly black are left out: they are the night around a lit scene.
#[must_use]
#[allow(clippy::float_cmp, reason = "black is exactly zero")]
pub fn exposure(rgb: &[[f32; 3]]) -> f64 {
    let luminance = |p: &[f32; 3]| {
        let [r, g, b] = p.map(f64::from);
        0.2126 * r + 0.7152 * g + 0.0722 * b
    };
    let mut lit: Vec<f64> = rgb.iter().map(luminance).filter(|l| l.is_finite() && *l > 0.0).collect();
    lit.sort_by(f64::total_cmp);
    let Some(&bright) = lit.get(lit.len() * 95 / 100) else { return 0.0 };
    let stops = (10.0 * libm::log2(0.8 / bright)).round() / 10.0;
    // No minus before a zero.
    if stops == 0.0 { 0.0 } else { stops }
}

impl Layout {
    fn pixels(self) -> [usize; 2] {
        [self.cell.0 as usize, self.cell.1 as usize]
    }

    /// From one cell's corner to the next one's.
    fn pitch(self) -> [usize; 2] {
        let [width, height] = self.pixels();
        [width + GAP, height + LABEL_LINES * LINE + GAP]
    }

    /// How many cells fit on a page.
    #[must_use]
    pub fn page(self) -> usize {
        self.columns * self.rows
    }

    /// One page with `cells` under `title`, as a PNG file's bytes. It is as high as its rows, at most [`Layout::rows`].
    ///
    /// # Errors
    /// If the encoder refuses.
    pub fn draw(self, cells: &[Cell], title: &str) -> Result<Vec<u8>> {
        let pitch = self.pitch();
        let rows = cells.len().div_ceil(self.columns).clamp(1, self.rows);
        let top = LINE + 2 * GAP;
        let (width, height) = (self.columns.min(cells.len().max(1)) * pitch[0] + GAP, rows * pitch[1] + top);
        let mut poster = Poster::new(width.max(title.chars().count() * LETTER + 2 * GAP), height, PAPER);
        poster.write(title, [GAP, GAP], INK);
        for (i, cell) in cells.iter().take(self.page()).enumerate() {
            let at = [GAP + i % self.columns * pitch[0], top + i / self.columns * pitch[1]];
            self.draw_cell(&mut poster, cell, at);
        }
        poster.png()
    }

    fn draw_cell(self, poster: &mut Poster, cell: &Cell, [x, y]: [usize; 2]) {
        let [width, height] = self.pixels();
        let letters = width / LETTER;
        let write = |poster: &mut Poster, lines: Vec<String>, from: usize, ink| {
            for (i, line) in lines.iter().enumerate() {
                poster.write(line, [x, from + i * LINE], ink);
            }
        };
        match &cell.content {
            Ok(shown) => {
                poster.paste(&shown.codes, width, [x, y], 1);
                let note = format!("frame {}, {:+.1} EV", shown.frame, shown.exposure_ev);
                write(poster, wrapped(&note, letters, 1), y + height + 2 * LINE, PALE);
            }
            Err(sentence) => {
                poster.fill([x, y], [width, height], [245, 236, 236]);
                write(poster, wrapped(sentence, letters, height / LINE), y, ALARM);
            }
        }
        let (folder, file) = cell.name.rsplit_once('/').unwrap_or(("", &cell.name));
        write(poster, wrapped(file, letters, 1), y + height, INK);
        poster.write(&end_of(folder, letters), [x, y + height + LINE], PALE);
    }
}

/// The last `letters` letters of a folder's path, with two dots where its beginning is lost.
fn end_of(folder: &str, letters: usize) -> String {
    let count = folder.chars().count();
    if count <= letters {
        return folder.to_owned();
    }
    "..".chars().chain(folder.chars().skip(count + 2 - letters.max(2))).collect()
}

/// The file of page `page` (from 0) of `pages`: `path` itself where it is the only one, else with a number before the
/// extension, `sheet-01.png`.
#[must_use]
pub fn page_path(path: &Path, page: usize, pages: usize) -> PathBuf {
    if pages <= 1 {
        return path.to_path_buf();
    }
    let stem = path.file_stem().map(|s| s.to_string_lossy().into_owned()).unwrap_or_default();
    let digits = pages.to_string().len().max(2);
    path.with_file_name(format!("{stem}-{:0digits$}.png", page + 1))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exposure_looks_at_what_is_lit() {
        let mut rgb = vec![[0.0; 3]; 900];
        rgb.extend([[3.2; 3]; 100]);
        assert!((exposure(&rgb) - -2.0).abs() < 1e-9);
        assert!(exposure(&[[0.0; 3]; 4]).abs() < 1e-9);
        assert!(exposure(&[[f32::NAN; 3]; 4]).abs() < 1e-9);
        assert!(exposure(&[]).abs() < 1e-9);
    }

    #[test]
    fn a_failure_is_a_sentence_in_its_cell() {
        let folder = Path::new("/there");
        let file = folder.join("in/bad.glb");
        let load = || Err(Error::Scene { path: file.clone(), object: "mesh 0".into(), problem: "is odd".into() });
        let bad = cell(folder, &file, None, load);
        assert_eq!((bad.name.as_str(), bad.content.as_ref().unwrap_err().as_str()), ("in/bad.glb", "mesh 0: is odd"));
        let layout = Layout { columns: 3, rows: 2, cell: (70, 40) };
        let png = layout.draw(&[bad], "title").unwrap();
        assert_eq!(&png[1..4], b"PNG");
    }

    #[test]
    fn pages_are_numbered_where_there_are_several() {
        assert_eq!(page_path(Path::new("a/s.png"), 0, 1), Path::new("a/s.png"));
        assert_eq!(page_path(Path::new("a/s.png"), 2, 12), Path::new("a/s-03.png"));
    }

    #[test]
    fn files_are_found_at_any_depth_and_in_order() {
        let folder = tempfile::tempdir().unwrap();
        std::fs::create_dir_all(folder.path().join("b/c")).unwrap();
        for name in ["z.glb", "b/c/a.GLTF", "b/n.bin", "b/a.gltf"] {
            std::fs::write(folder.path().join(name), "x").unwrap();
        }
        let found = files(folder.path()).unwrap();
        let names: Vec<_> = found.iter().map(|p| p.strip_prefix(folder.path()).unwrap().to_str().unwrap()).collect();
        assert_eq!(names, ["b/a.gltf", "b/c/a.GLTF", "z.glb"]);
        assert!(files(&folder.path().join("none")).is_err());
    }
}
