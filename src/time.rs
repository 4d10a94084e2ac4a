//! Exact instants of frames and fields, and the span of time that an exposure integrates.
//!
//! The shot's clock runs in seconds. Instants are products, `index × period`, never running sums, so frame 100 000 is
//! as accurate as frame 1.

use crate::{Error, Result};
use std::fmt;
use std::str::FromStr;

/// Frames per second as an exact ratio of non-zero parts: NTSC is `30000/1001`, which no float is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, serde::Serialize, serde::Deserialize)]
pub struct FrameRate {
    frames: u32,
    seconds: u32,
}

impl FrameRate {
    /// 24 frames a second: cinema.
    pub const CINEMA: Self = Self { frames: 24, seconds: 1 };

    /// 24000/1001: cinema slowed down for NTSC.
    pub const NTSC_FILM: Self = Self { frames: 24_000, seconds: 1001 };

    /// `frames` in `seconds`.
    ///
    /// # Errors
    /// If either is zero or above 10 000 000, where instants would no longer be exact.
    pub fn new(frames: u32, seconds: u32) -> Result<Self> {
        const MOST: u32 = 10_000_000;
        if frames == 0 || seconds == 0 || frames > MOST || seconds > MOST {
            return Err(Error::invalid(
                format!("frame rate {frames}/{seconds}"),
                format!("both parts must be from 1 to {MOST}"),
            ));
        }
        Ok(Self { frames, seconds })
    }

    /// Numerator and denominator: frames, seconds.
    #[must_use]
    pub const fn parts(self) -> (u32, u32) {
        (self.frames, self.seconds)
    }

    /// Frames per second, rounded to `f64`.
    #[must_use]
    pub fn per_second(self) -> f64 {
        f64::from(self.frames) / f64::from(self.seconds)
    }

    /// Seconds between frames, rounded to `f64`.
    #[must_use]
    pub fn period(self) -> f64 {
        f64::from(self.seconds) / f64::from(self.frames)
    }

    /// Twice the rate: the rate of fields.
    #[must_use]
    pub const fn fields(self) -> Self {
        Self { frames: self.frames * 2, seconds: self.seconds }
    }

    /// The instant of frame `frame`, in seconds: one rounding.
    #[must_use]
    pub fn instant(self, frame: i64) -> f64 {
        self.instant_of_part(frame, 0, 1)
    }

    /// The instant `part / parts` of a frame after frame `frame` begins, in seconds.
    ///
    /// The numerator is exact in `i128`, so the only rounding is that of the quotient.
    #[must_use]
    #[allow(clippy::cast_precision_loss, reason = "the single rounding that is documented")]
    pub fn instant_of_part(self, frame: i64, part: u32, parts: u32) -> f64 {
        let numerator = (i128::from(frame) * i128::from(parts) + i128::from(part)) * i128::from(self.seconds);
        let denominator = i128::from(self.frames) * i128::from(parts);
        let whole = numerator.div_euclid(denominator);
        let rest = numerator.rem_euclid(denominator);
        whole as f64 + rest as f64 / denominator as f64
    }
}

impl fmt::Display for FrameRate {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if self.seconds == 1 { write!(f, "{}", self.frames) } else { write!(f, "{}/{}", self.frames, self.seconds) }
    }
}

impl FromStr for FrameRate {
    type Err = Error;

    /// Reads `24`, `30000/1001`, and the customary decimals `23.976`, `29.97`, `59.94` as their exact NTSC ratios;
    /// other decimals are taken to six places.
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "range checked just before")]
    fn from_str(text: &str) -> Result<Self> {
        let bad = || {
            Error::invalid(
                format!("frame rate \"{text}\""),
                "expected frames per second such as 24, 29.97 or 30000/1001",
            )
        };
        let text_trimmed = text.trim();
        if let Some((a, b)) = text_trimmed.split_once(['/', ':']) {
            return Self::new(a.trim().parse().map_err(|_| bad())?, b.trim().parse().map_err(|_| bad())?);
        }
        if let Ok(whole) = text_trimmed.parse::<u32>() {
            return Self::new(whole, 1);
        }
        let value: f64 = text_trimmed.parse().map_err(|_| bad())?;
        if !(value > 0.0 && value < 10_000.0) {
            return Err(bad());
        }
        for nominal in [24_u32, 30, 48, 60, 120] {
            let ntsc = f64::from(nominal) * 1000.0 / 1001.0;
            if (value - ntsc).abs() < 0.005 {
                return Self::new(nominal * 1000, 1001);
            }
        }
        let (mut frames, mut seconds) = ((value * 1000.0).round() as u32, 1000_u32);
        let mut divisor = gcd(frames, seconds);
        if divisor == 0 {
            divisor = 1;
        }
        frames /= divisor;
        seconds /= divisor;
        Self::new(frames, seconds)
    }
}

const fn gcd(a: u32, b: u32) -> u32 {
    if b == 0 { a } else { gcd(b, a % b) }
}

/// An interval of the shot's clock: seconds, `open ≤ close`. Equal ends are an instant: no blur.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Exposure {
    /// When the shutter opens, seconds.
    pub open: f64,
    /// When it closes, seconds.
    pub close: f64,
}

impl Exposure {
    /// Length in seconds.
    #[must_use]
    pub fn duration(self) -> f64 {
        self.close - self.open
    }

    /// Its middle, seconds.
    #[must_use]
    pub fn middle(self) -> f64 {
        self.open + 0.5 * (self.close - self.open)
    }

    /// The instant at `u` in [0, 1] of the interval; exactly `open` at 0 and `close` at 1.
    #[must_use]
    pub fn at(self, u: f64) -> f64 {
        self.open * (1.0 - u) + self.close * u
    }

    /// Whether it is an instant.
    #[must_use]
    pub fn is_instant(self) -> bool {
        self.open >= self.close
    }
}

/// Where the exposure lies relative to the frame's instant.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum ShutterPhase {
    /// The exposure opens at the frame's instant.
    #[default]
    Start,
    /// The frame's instant is the exposure's middle.
    Centre,
    /// The exposure closes at the frame's instant.
    End,
}

/// Which lines a field holds. Say top and bottom: odd and even are ambiguous.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Parity {
    /// Lines 0, 2, 4, … counted from 0 at the top.
    Top,
    /// Lines 1, 3, 5, …
    Bottom,
}

impl Parity {
    /// The other field's lines.
    #[must_use]
    pub const fn other(self) -> Self {
        match self {
            Self::Top => Self::Bottom,
            Self::Bottom => Self::Top,
        }
    }
}

/// How long and when light is gathered, relative to a frame (or field) of given period.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Shutter {
    /// Exposure as a fraction of the period: 0.5 is 180 degrees; may exceed 1.
    pub fraction: f64,
    /// Where the exposure lies relative to the frame's instant.
    pub phase: ShutterPhase,
}

impl Default for Shutter {
    /// 180 degrees, opening at the frame's instant.
    fn default() -> Self {
        Self { fraction: 0.5, phase: ShutterPhase::Start }
    }
}

impl Shutter {
    /// The exposure about `instant` (seconds) where frames (or fields) are `period` seconds apart.
    #[must_use]
    pub fn exposure(self, instant: f64, period: f64) -> Exposure {
        let duration = self.fraction * period;
        let open = match self.phase {
            ShutterPhase::Start => instant,
            ShutterPhase::Centre => instant - 0.5 * duration,
            ShutterPhase::End => instant - duration,
        };
        let open = snap(open);
        Exposure { open, close: if duration > 0.0 { open + snap(duration) } else { open } }
    }
}

/// The multiple of 2⁻³² s (0.23 ns) nearest to `seconds`.
///
/// Differences between instants on this grid are exact for twelve days of animation, so hour 10 of a shot is bit for
/// bit hour 0 of the same shot moved.
#[must_use]
pub fn snap(seconds: f64) -> f64 {
    const GRID: f64 = 4_294_967_296.0;
    (seconds * GRID).round() / GRID
}

/// The multiple of 2⁻³⁶ s (15 ps) nearest to `seconds`: for instants within an exposure.
///
/// Sums with instants up to 36 hours of animation are exact. An object that crosses 4000 pixels in a thousandth of a
/// second is put wrong by 3·10⁻⁵ pixels.
#[must_use]
pub fn snap_within(seconds: f64) -> f64 {
    const GRID: f64 = 68_719_476_736.0;
    (seconds * GRID).round() / GRID
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ntsc_is_exact_after_ten_million_frames() {
        let rate: FrameRate = "30000/1001".parse().unwrap();
        // Frame 30 000 k lies at exactly 1001 k seconds.
        assert_eq!(rate.instant(30_000 * 333).to_bits(), (1001.0_f64 * 333.0).to_bits());
        assert_eq!("29.97".parse::<FrameRate>().unwrap(), rate);
    }

    #[test]
    fn fields_open_half_a_frame_apart() {
        let rate = FrameRate::new(25, 1).unwrap();
        assert_eq!(rate.instant_of_part(3, 1, 2).to_bits(), (7.0_f64 / 50.0).to_bits());
        assert_eq!(rate.fields().instant(7).to_bits(), rate.instant_of_part(3, 1, 2).to_bits());
    }

    #[test]
    fn nonsense_rates_are_refused() {
        for bad in ["0", "-1", "24/0", "abc", "", "1e9", "nan"] {
            assert!(bad.parse::<FrameRate>().is_err(), "{bad}");
        }
    }
}
