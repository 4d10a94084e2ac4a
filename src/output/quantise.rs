//! From real numbers to codes: rounding, and a dither that is the same wherever it is computed.

use crate::numeric;

/// How a value between two codes is decided.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Dither {
    /// To the nearest code.
    #[default]
    Off,
    /// Upwards with the probability of the remainder, so that the mean over pixels and frames is exact; a pixel's draw
    /// depends on its place, channel and instant alone. Values that are codes stay as they are.
    On,
}

/// Where a code stands: what its dither depends on.
#[derive(Debug, Clone, Copy)]
pub(super) struct Place {
    pub(super) x: u32,
    /// Line of the whole frame.
    pub(super) line: u32,
    pub(super) channel: u32,
    /// Number of the instant: of the frame, or of the field if the picture is interlaced.
    pub(super) instant: i64,
}

impl Dither {
    /// `value` as a whole number from `low` to `high`.
    #[inline]
    #[allow(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "clamped to the range of u16; the instant is hashed"
    )]
    pub(super) fn code(self, value: f64, low: u16, high: u16, place: Place) -> u16 {
        let rounding = match self {
            Self::Off => 0.5,
            Self::On => {
                let position = u64::from(place.x) << 32 | u64::from(place.line);
                let key = numeric::mix64(place.instant as u64 ^ u64::from(place.channel) << 60);
                // 53 bits: exact in f64 and below 1.
                (numeric::mix64(position ^ key) >> 11) as f64 / 9_007_199_254_740_992.0
            }
        };
        (value + rounding).floor().clamp(f64::from(low), f64::from(high)) as u16
    }
}

/// `value` as JSON in ASCII, as PNG's and EXR's text needs it.
pub(super) fn ascii_json(value: &serde_json::Value) -> String {
    let mut text = String::new();
    for c in value.to_string().chars() {
        if c.is_ascii() {
            text.push(c);
        } else {
            for unit in c.encode_utf16(&mut [0; 2]) {
                text.push_str(&format!("\\u{unit:04x}"));
            }
        }
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn dither_keeps_the_mean_and_leaves_codes_alone() {
        let mut sum = 0.0;
        for x in 0..100 {
            for line in 0..100 {
                let place = Place { x, line, channel: 0, instant: 3 };
                sum += f64::from(Dither::On.code(100.3, 16, 235, place));
                assert_eq!(Dither::On.code(77.0, 16, 235, place), 77);
                assert_eq!(Dither::On.code(-5.0, 16, 235, place), 16);
                assert_eq!(Dither::Off.code(300.0, 16, 235, place), 235);
            }
        }
        // 10⁴ Bernoulli draws of p = 0.3: standard error 0.0046.
        assert!((sum / 1e4 - 100.3).abs() < 0.02, "{}", sum / 1e4);
    }

    #[test]
    fn json_in_ascii_reads_back() {
        let value = serde_json::json!({ "file": "ä𝄞.glb", "n": 1 });
        let text = ascii_json(&value);
        assert!(text.is_ascii());
        assert_eq!(serde_json::from_str::<serde_json::Value>(&text).unwrap(), value);
    }
}
