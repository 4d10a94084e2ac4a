//! File names of sequences: `pool.####.exr`, `pool.%04d.exr`, `pool.{frame}.exr`.

use crate::{Error, Result};
use std::fmt;
use std::path::{Path, PathBuf};
use std::str::FromStr;

/// A file name with a place for the frame number, or without one for a single frame.
///
/// `####` stands for the number padded with zeros to as many digits, `%04d` for the same, `%d` and `{frame}` for the
/// number without padding, `{frame:04}` for padding. A minus sign stands before the zeros and is not counted. Numbers
/// wider than their padding are written in full.
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
pub struct Pattern {
    before: String,
    /// Zeros are added up to this many digits; none: no place for a number.
    digits: Option<usize>,
    after: String,
}

impl Pattern {
    /// Whether it has a place for the frame number.
    #[must_use]
    pub fn is_sequence(&self) -> bool {
        self.digits.is_some()
    }

    /// Checks that it can hold `frames` frames.
    ///
    /// # Errors
    /// If there are several and the name has no place for the number.
    pub fn validate_for(&self, frames: usize) -> Result<()> {
        if frames > 1 && self.digits.is_none() {
            let path = Path::new(&self.before);
            let stem = path.file_stem().map_or_else(String::new, |s| s.to_string_lossy().into_owned());
            let extension = path.extension().map_or_else(String::new, |e| format!(".{}", e.to_string_lossy()));
            return Err(Error::invalid(
                format!("output \"{self}\""),
                format!("{frames} frames need a place for the frame number, such as {stem}.####{extension}"),
            ));
        }
        Ok(())
    }

    /// The file of frame `frame`.
    #[must_use]
    pub fn path(&self, frame: i64) -> PathBuf {
        self.path_with_suffix(frame, "")
    }

    /// The file of frame `frame` with `suffix` put before its extension: `pool.0007.top.exr`.
    #[must_use]
    pub fn path_with_suffix(&self, frame: i64, suffix: &str) -> PathBuf {
        let name = match self.digits {
            None => self.before.clone(),
            Some(digits) => {
                let sign = if frame < 0 { "-" } else { "" };
                format!("{}{sign}{:0digits$}{}", self.before, frame.unsigned_abs(), self.after)
            }
        };
        if suffix.is_empty() {
            return PathBuf::from(name);
        }
        let path = PathBuf::from(name);
        let stem = path.file_stem().map_or_else(String::new, |s| s.to_string_lossy().into_owned());
        let extension = path.extension().map_or_else(String::new, |e| format!(".{}", e.to_string_lossy()));
        path.with_file_name(format!("{stem}.{suffix}{extension}"))
    }

    /// The frame whose file this is, if it is one: the inverse of [`Pattern::path`].
    #[must_use]
    pub fn frame_of(&self, path: &Path) -> Option<i64> {
        self.digits?;
        let text = path.to_str()?;
        let number = text.strip_prefix(&self.before)?.strip_suffix(&self.after)?;
        let frame = number.parse().ok()?;
        (self.path(frame) == path).then_some(frame)
    }

    /// As [`Pattern::frame_of`], with `*` after the number for any text: `shot.####.*.part` has frame 7 for
    /// `shot.0007.2.part`. More digits than the padding asks for are no matter, nor are fewer.
    #[must_use]
    pub fn frame_of_any(&self, path: &Path) -> Option<i64> {
        self.digits?;
        let text = path.to_str()?.strip_prefix(&self.before)?;
        let end = text.find(|c: char| !c.is_ascii_digit() && c != '-').unwrap_or(text.len());
        let (number, rest) = text.split_at(end);
        let fits = match self.after.split_once('*') {
            Some((head, tail)) => rest.strip_prefix(head).is_some_and(|rest| rest.ends_with(tail)),
            None => rest == self.after,
        };
        if fits { number.parse().ok() } else { None }
    }

    /// The name without number, separators about it, extension and folder: `pool` of `out/pool.####.exr`.
    #[must_use]
    pub fn stem(&self) -> String {
        let name = self.before.rsplit('/').next().unwrap_or_default();
        let name = if self.digits.is_some() {
            name.trim_end_matches(['.', '_', '-', ' '])
        } else {
            name.rsplit_once('.').map_or(name, |(stem, _)| stem)
        };
        if name.is_empty() { "sequence".to_owned() } else { name.to_owned() }
    }

    /// The pattern without its folder.
    #[must_use]
    pub fn without_folder(&self) -> Self {
        let before = self.before.rsplit('/').next().unwrap_or_default().to_owned();
        Self { before, ..self.clone() }
    }

    /// The extension in lower case.
    #[must_use]
    pub fn extension(&self) -> String {
        let name = if self.digits.is_some() { format!("0{}", self.after) } else { self.before.clone() };
        Path::new(&name).extension().map_or_else(String::new, |e| e.to_string_lossy().to_lowercase())
    }
}

impl fmt::Display for Pattern {
    /// In the form with `#` where the padding allows, else `{frame}`.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.digits {
            None => f.write_str(&self.before),
            Some(0 | 1) => write!(f, "{}{{frame}}{}", self.before, self.after),
            Some(digits) => write!(f, "{}{}{}", self.before, "#".repeat(digits), self.after),
        }
    }
}

impl FromStr for Pattern {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self> {
        let bad = |problem: &str| Error::invalid(format!("output \"{text}\""), problem);
        if text.is_empty() {
            return Err(bad("expected a file name"));
        }
        let mut places = Vec::new();
        let bytes = text.as_bytes();
        let mut at = 0;
        while at < bytes.len() {
            let rest = &text[at..];
            let found = if rest.starts_with('#') {
                let digits = rest.bytes().take_while(|&b| b == b'#').count();
                Some((digits, digits))
            } else if rest.starts_with('%') {
                Some(printf_place(rest).ok_or_else(|| bad("the only place after % is %d or %04d"))?)
            } else if rest.starts_with('{') {
                Some(brace_place(rest).ok_or_else(|| bad("the only place in braces is {frame} or {frame:04}"))?)
            } else {
                None
            };
            match found {
                Some((length, digits)) => {
                    places.push((at, length, digits));
                    at += length;
                }
                None => at += rest.chars().next().map_or(1, char::len_utf8),
            }
        }
        let pattern = match places[..] {
            [] => Self { before: text.to_owned(), digits: None, after: String::new() },
            [(start, length, digits)] => Self {
                before: text[..start].to_owned(),
                digits: Some(digits),
                after: text[start + length..].to_owned(),
            },
            _ => return Err(bad("the frame number has more than one place")),
        };
        // i64 has 19 digits.
        if pattern.digits.is_some_and(|digits| digits > 19) {
            return Err(bad("a frame number has at most 19 digits"));
        }
        if pattern.digits.is_some() && pattern.after.contains('/') {
            return Err(bad("the place for the frame number must be in the file's name, not in a folder's"));
        }
        if text.ends_with('/') || Path::new(text).file_name().is_none() {
            return Err(bad("expected the name of a file, not of a folder"));
        }
        Ok(pattern)
    }
}

/// Length of `%d` or `%0Nd` at the start of `text`, and digits.
fn printf_place(text: &str) -> Option<(usize, usize)> {
    let end = text.find('d')?;
    let digits = width(&text[1..end])?;
    Some((end + 1, digits))
}

/// Length of `{frame}` or `{frame:0N}` at the start of `text`, and digits.
fn brace_place(text: &str) -> Option<(usize, usize)> {
    let end = text.find('}')?;
    let inside = text[1..end].strip_prefix("frame")?;
    let digits = if inside.is_empty() { 1 } else { width(inside.strip_prefix(':')?)? };
    Some((end + 1, digits))
}

/// The number in `04`; 1 for nothing.
fn width(text: &str) -> Option<usize> {
    if text.is_empty() {
        return Some(1);
    }
    let digits = text.strip_prefix('0')?;
    (digits.len() <= 2 && digits.bytes().all(|b| b.is_ascii_digit())).then(|| digits.parse().ok())?
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_star_stands_for_what_tells_parts_apart() {
        let frame = |name: &str| "p/a.####.*.part".parse::<Pattern>().unwrap().frame_of_any(Path::new(name));
        assert_eq!(frame("p/a.0007.2.part"), Some(7));
        assert_eq!(frame("p/a.-12.0-31.part"), Some(-12));
        for other in ["p/a.0007.2.part.partial", "p/b.0007.2.part", "p/a.0007.part", "q/a.0007.2.part", "p/a.x.2.part"]
        {
            assert_eq!(frame(other), None, "{other}");
        }
    }

    fn path(pattern: &str, frame: i64) -> String {
        pattern.parse::<Pattern>().unwrap().path(frame).to_str().unwrap().to_owned()
    }

    #[test]
    fn every_form_pads_as_it_says() {
        for pattern in ["out/a.####.exr", "out/a.%04d.exr", "out/a.{frame:04}.exr"] {
            assert_eq!(path(pattern, 7), "out/a.0007.exr");
            assert_eq!(path(pattern, -7), "out/a.-0007.exr");
            assert_eq!(path(pattern, 123_456), "out/a.123456.exr");
        }
        for pattern in ["a{frame}.png", "a%d.png", "a#.png"] {
            assert_eq!(path(pattern, 12), "a12.png");
        }
        assert_eq!(path("still.png", 3), "still.png");
        let pattern: Pattern = "a.##.exr".parse().unwrap();
        assert_eq!(pattern.path_with_suffix(3, "top"), PathBuf::from("a.03.top.exr"));
    }

    #[test]
    fn names_read_back_as_frames() {
        for text in ["out/a.####.exr", "a{frame}.png", "%03d"] {
            let pattern: Pattern = text.parse().unwrap();
            for frame in [-12_345, -1, 0, 1, 99, 100_000] {
                assert_eq!(pattern.frame_of(&pattern.path(frame)), Some(frame), "{text}");
            }
            assert_eq!(pattern.frame_of(Path::new("other.exr")), None);
        }
        // A name padded otherwise is another file.
        assert_eq!("a.####.exr".parse::<Pattern>().unwrap().frame_of(Path::new("a.7.exr")), None);
    }

    #[test]
    fn patterns_that_cannot_work_are_refused() {
        for bad in ["", "a/", "a.##.##.exr", "a.%s.exr", "a.{time}.exr", "####/a.exr", "a.%4d.exr", "a{frame", "a%"] {
            assert!(bad.parse::<Pattern>().is_err(), "{bad}");
        }
        let single: Pattern = "a.exr".parse().unwrap();
        assert!(single.validate_for(1).is_ok());
        let message = single.validate_for(2).unwrap_err().to_string();
        assert!(message.contains("a.####.exr"), "{message}");
    }
}
