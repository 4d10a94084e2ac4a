//! Video: standards, fields, Y'CbCr, YUV4MPEG2, and an installed ffmpeg.
//!
//! Conventions: say *top* and *bottom*; line 0 is the top line and belongs to the top field. A woven frame holds both
//! fields, its metadata says which is earlier. R'G'B' is what the view transform gives, the same numbers as in a PNG;
//! Y'CbCr follows BT.601-7 up to 576 lines and BT.709-6 above, in limited range.

pub mod ffmpeg;
pub mod fields;
pub mod notch;
pub mod y4m;
pub mod yuv;

pub use ffmpeg::Container;
pub use fields::{Pulldown, separate, weave};
pub use y4m::{Y4mHeader, Y4mWriter};
pub use yuv::{BitDepth, ChromaNotch, Matrix, Sampling, YuvOptions};

use super::PixelAspect;
use crate::time::{FrameRate, Parity};
use crate::{Error, Result};
use std::fmt;
use std::str::FromStr;

/// An interlaced television standard.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, serde::Serialize, serde::Deserialize)]
pub enum Standard {
    /// 720 × 480 at 30000/1001 frames a second, top field first: DVD.
    #[serde(rename = "480i")]
    I480,
    /// The same, bottom field first: DV.
    #[serde(rename = "480i-dv")]
    I480Dv,
    /// 720 × 576 at 25, top field first: DVD, broadcast.
    #[serde(rename = "576i")]
    I576,
    /// The same, bottom field first: DV.
    #[serde(rename = "576i-dv")]
    I576Dv,
    /// 1920 × 1080 at 25, top field first.
    #[serde(rename = "1080i50")]
    I1080At50,
    /// 1920 × 1080 at 30000/1001, top field first.
    #[serde(rename = "1080i59.94")]
    I1080At5994,
}

/// Shape of the picture on the screen, for the standards that have both.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Shape {
    /// 4:3.
    #[default]
    Normal,
    /// 16:9, by wider pixels.
    Wide,
}

impl Standard {
    /// All of them with their names.
    pub const ALL: [(&'static str, Self); 6] = [
        ("480i", Self::I480),
        ("480i-dv", Self::I480Dv),
        ("576i", Self::I576),
        ("576i-dv", Self::I576Dv),
        ("1080i50", Self::I1080At50),
        ("1080i59.94", Self::I1080At5994),
    ];

    /// Columns and lines of a frame.
    #[must_use]
    pub const fn size(self) -> (u32, u32) {
        match self {
            Self::I480 | Self::I480Dv => (720, 480),
            Self::I576 | Self::I576Dv => (720, 576),
            Self::I1080At50 | Self::I1080At5994 => (1920, 1080),
        }
    }

    /// Frames a second: half the fields.
    #[must_use]
    pub fn rate(self) -> FrameRate {
        let (frames, seconds) = match self {
            Self::I480 | Self::I480Dv | Self::I1080At5994 => (30_000, 1001),
            Self::I576 | Self::I576Dv | Self::I1080At50 => (25, 1),
        };
        FrameRate::new(frames, seconds).unwrap_or(FrameRate::CINEMA)
    }

    /// The earlier field of a frame.
    #[must_use]
    pub const fn first(self) -> Parity {
        match self {
            Self::I480Dv | Self::I576Dv => Parity::Bottom,
            Self::I480 | Self::I576 | Self::I1080At50 | Self::I1080At5994 => Parity::Top,
        }
    }

    /// Shape of a pixel such that all 720 samples of a line fill the 4:3 or 16:9 picture, as DVD and DV players take it.
    #[must_use]
    pub const fn pixel_aspect(self, shape: Shape) -> PixelAspect {
        let (width, height) = match (self, shape) {
            (Self::I480 | Self::I480Dv, Shape::Normal) => (8, 9),
            (Self::I480 | Self::I480Dv, Shape::Wide) => (32, 27),
            (Self::I576 | Self::I576Dv, Shape::Normal) => (16, 15),
            (Self::I576 | Self::I576Dv, Shape::Wide) => (64, 45),
            (Self::I1080At50 | Self::I1080At5994, _) => (1, 1),
        };
        PixelAspect { width, height }
    }
}

impl fmt::Display for Standard {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(Self::ALL.iter().find(|(_, standard)| standard == self).map_or("", |(name, _)| name))
    }
}

impl FromStr for Standard {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self> {
        Self::ALL.iter().find(|(name, _)| *name == text).map(|&(_, standard)| standard).ok_or_else(|| {
            Error::invalid(
                format!("video standard \"{text}\""),
                "expected 480i, 480i-dv, 576i, 576i-dv, 1080i50 or 1080i59.94",
            )
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn standards_read_back_and_fill_their_screens() {
        for (name, standard) in Standard::ALL {
            assert_eq!(name.parse::<Standard>().unwrap(), standard);
            assert_eq!(standard.to_string(), name);
            let (width, height) = standard.size();
            for (shape, wanted) in [(Shape::Normal, 4.0 / 3.0), (Shape::Wide, 16.0 / 9.0)] {
                let screen = f64::from(width) * standard.pixel_aspect(shape).ratio() / f64::from(height);
                let wanted = if height == 1080 { 16.0 / 9.0 } else { wanted };
                assert!((screen - wanted).abs() < 1e-12, "{name}");
            }
        }
    }
}
