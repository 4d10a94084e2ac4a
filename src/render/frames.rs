//! Which frames: lists such as `1-48`, `1-48x2`, `1-48:2`, `3,7,9`.

use crate::time::FrameRate;
use crate::{Error, Result};
use std::fmt;
use std::str::FromStr;

/// Frame numbers in the order in which they are to be made, each once.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct FrameList {
    text: String,
    frames: Vec<i64>,
}

/// No list may name more frames than this: three days at 60 a second.
const MOST_FRAMES: usize = 16_000_000;

impl FrameList {
    /// The frames themselves.
    #[must_use]
    pub fn frames(&self) -> &[i64] {
        &self.frames
    }

    /// One frame.
    #[must_use]
    pub fn single(frame: i64) -> Self {
        Self { text: frame.to_string(), frames: vec![frame] }
    }

    /// The frames whose instants lie between an animation's first and last key (seconds), ends included; a key that
    /// misses a frame's instant by less than a millionth of a frame counts as on it, since files store key times in
    /// single precision. A file without animation has the one frame 0.
    #[must_use]
    #[allow(clippy::cast_possible_truncation, reason = "bounded just before")]
    pub fn of_animation(span: Option<(f64, f64)>, rate: FrameRate) -> Self {
        let Some((first, last)) = span else { return Self::single(0) };
        const SLACK: f64 = 1e-4;
        let bound = |x: f64| x.clamp(-1e12, 1e12) as i64;
        let from = bound((first * rate.per_second() - SLACK).ceil());
        let to = bound((last * rate.per_second() + SLACK).floor()).max(from);
        let to = to.min(from + i64::try_from(MOST_FRAMES).unwrap_or(i64::MAX) - 1);
        Self { text: format!("{from}-{to}"), frames: (from..=to).collect() }
    }
}

impl fmt::Display for FrameList {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.text)
    }
}

impl FromStr for FrameList {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self> {
        let wrong = |problem: &str| {
            Error::invalid(
                format!("frames \"{text}\""),
                format!("{problem}; expected a list such as 7, 1-48, 1-48x2, 1-48:2 or 3,7,9"),
            )
        };
        let mut frames = Vec::new();
        // A single range names no frame twice.
        let many = text.contains(',');
        let mut seen = std::collections::HashSet::new();
        for item in text.split(',') {
            let (range, step) = match item.trim().split_once(['x', ':']) {
                Some((range, step)) => {
                    (range.trim(), step.trim().parse::<u32>().map_err(|_| wrong("a step is no number"))?)
                }
                None => (item.trim(), 1),
            };
            if step == 0 {
                return Err(wrong("a step of 0 goes nowhere"));
            }
            let (from, to) = parse_range(range).ok_or_else(|| wrong(&format!("\"{range}\" is no frame or range")))?;
            if to < from {
                return Err(wrong(&format!("the range {from}-{to} runs backwards")));
            }
            let count = (to.abs_diff(from) / u64::from(step)).saturating_add(1);
            if count.saturating_add(frames.len() as u64) > MOST_FRAMES as u64 {
                return Err(wrong(&format!("more than {MOST_FRAMES} frames")));
            }
            let step = i64::from(step);
            for i in 0.. {
                let frame = from + i * step;
                if frame > to {
                    break;
                }
                if !many || seen.insert(frame) {
                    frames.push(frame);
                }
            }
        }
        Ok(Self { text: text.trim().to_owned(), frames })
    }
}

/// `7`, `-3`, `1-48`, `-5--2`.
fn parse_range(text: &str) -> Option<(i64, i64)> {
    const LARGEST: i64 = 1_000_000_000_000;
    let number = |t: &str| t.trim().parse::<i64>().ok().filter(|n| n.abs() <= LARGEST);
    if let Some(single) = number(text) {
        return Some((single, single));
    }
    // The hyphen of the range is the first one that follows a digit.
    let hyphen =
        text.char_indices().skip(1).find(|&(i, c)| c == '-' && text[..i].ends_with(|d: char| d.is_ascii_digit()))?.0;
    Some((number(&text[..hyphen])?, number(&text[hyphen + 1..])?))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn list(text: &str) -> Vec<i64> {
        text.parse::<FrameList>().unwrap().frames().to_vec()
    }

    #[test]
    fn lists_are_read_as_render_managers_write_them() {
        assert_eq!(list("7"), [7]);
        assert_eq!(list("1-4"), [1, 2, 3, 4]);
        assert_eq!(list("1-5x2"), [1, 3, 5]);
        assert_eq!(list("1-5:2,7-11:2,13"), [1, 3, 5, 7, 9, 11, 13]);
        assert_eq!(list("3, 7,3"), [3, 7]);
        assert_eq!(list("-5--3"), [-5, -4, -3]);
        assert_eq!(list("-2-1"), [-2, -1, 0, 1]);
    }

    #[test]
    fn nonsense_is_refused_in_a_sentence() {
        for bad in
            ["", "a", "9-3", "1-9x0", "1-", "-", "1-5x", "1-99999999999", "1,,2", "1-2-3", "99999999999999999999"]
        {
            assert!(bad.parse::<FrameList>().is_err(), "{bad}");
        }
    }

    #[test]
    fn an_animation_gives_its_frames_from_first_to_last_key() {
        let rate = FrameRate::CINEMA;
        assert_eq!(FrameList::of_animation(Some((0.0, 1.0)), rate).frames().len(), 25);
        // A key at 1/24 s stored as f32 is still frame 1.
        let key = f64::from(1.0_f32 / 24.0);
        assert_eq!(FrameList::of_animation(Some((key, key)), rate).frames(), [1]);
        assert_eq!(FrameList::of_animation(None, rate).frames(), [0]);
    }

    proptest! {
        #[test]
        fn no_text_panics(text in "[0-9x:,\\- a]{0,24}") {
            let _ = text.parse::<FrameList>();
        }
    }
}
