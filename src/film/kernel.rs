//! One-dimensional reconstruction kernels, and their names.

use crate::{Error, Result};
use std::f64::consts::PI;
use std::fmt;
use std::str::FromStr;

/// The shape of a reconstruction kernel; the pixel's filter is k(x) k(y) (Mitchell 1990, §7).
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Kernel {
    /// Constant.
    Box,
    /// Linear to zero at the edge.
    Tent,
    /// exp(−x²/2σ²) less its value at the edge, σ a sixth of the width.
    Gaussian,
    /// The Gaussian times (3 − x²/σ²)/2, σ an eighth of the width: its second moment vanishes, so the frequency response
    /// is flat about zero, as Schreiber and Troxel (1985) sharpen theirs; narrow negative lobes.
    SharpenedGaussian,
    /// The cubic family of Mitchell and Netravali (1988; survey eq. 17).
    Mitchell {
        /// Blur: 1 with C = 0 is the cubic B-spline.
        b: f64,
        /// Ringing: ½ with B = 0 is the Catmull-Rom spline.
        c: f64,
    },
    /// sinc(x) sinc(x/a), a half the width (Duchon 1979).
    Lanczos,
    /// The four-term window of Harris (1978).
    BlackmanHarris,
}

/// A kernel and its width.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FilterSpec {
    /// Its shape.
    pub kernel: Kernel,
    /// Whole extent in pixels: 1 for the common box, 4 for the cubics.
    pub width: f64,
}

impl FilterSpec {
    /// The box of one pixel.
    pub const BOX: Self = Self { kernel: Kernel::Box, width: 1.0 };

    /// The width at which the kernel is commonly used.
    #[must_use]
    pub const fn default_width(kernel: Kernel) -> f64 {
        match kernel {
            Kernel::Box => 1.0,
            Kernel::Tent => 2.0,
            Kernel::Gaussian => 3.0,
            Kernel::SharpenedGaussian | Kernel::Mitchell { .. } | Kernel::BlackmanHarris => 4.0,
            Kernel::Lanczos => 6.0,
        }
    }

    /// The kernel, not normalised, at `x` pixels from the centre; zero outside the width.
    #[must_use]
    pub fn value(&self, x: f64) -> f64 {
        let radius = 0.5 * self.width;
        let x = x.abs();
        if x > radius {
            return 0.0;
        }
        match self.kernel {
            Kernel::Box => 1.0,
            Kernel::Tent => 1.0 - x / radius,
            Kernel::Gaussian => {
                let s = x / (self.width / 6.0);
                libm::exp(-0.5 * s * s) - libm::exp(-4.5)
            }
            Kernel::SharpenedGaussian => {
                let s = x / (self.width / 8.0);
                0.5 * (3.0 - s * s) * libm::exp(-0.5 * s * s)
            }
            Kernel::Mitchell { b, c } => cubic(b, c, x * 2.0 / radius),
            Kernel::Lanczos => sinc(x) * sinc(x / radius),
            Kernel::BlackmanHarris => {
                let phase = PI * x / radius;
                0.35875
                    + 0.48829 * libm::cos(phase)
                    + 0.14128 * libm::cos(2.0 * phase)
                    + 0.01168 * libm::cos(3.0 * phase)
            }
        }
    }
}

/// Survey eq. 17 at |x|.
fn cubic(b: f64, c: f64, x: f64) -> f64 {
    let k = if x < 1.0 {
        ((12.0 - 9.0 * b - 6.0 * c) * x + (-18.0 + 12.0 * b + 6.0 * c)) * x * x + (6.0 - 2.0 * b)
    } else if x < 2.0 {
        (((-b - 6.0 * c) * x + (6.0 * b + 30.0 * c)) * x + (-12.0 * b - 48.0 * c)) * x + (8.0 * b + 24.0 * c)
    } else {
        0.0
    };
    k / 6.0
}

/// sin(πx)/(πx).
fn sinc(x: f64) -> f64 {
    // Below this the next term of the series, (πx)²/6, is under half an ulp of 1.
    const SMALL: f64 = 4.6e-9;
    if x.abs() < SMALL { 1.0 } else { libm::sin(PI * x) / (PI * x) }
}

impl Default for FilterSpec {
    fn default() -> Self {
        Self::BOX
    }
}

impl fmt::Display for FilterSpec {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let name = match self.kernel {
            Kernel::Box => "box",
            Kernel::Tent => "tent",
            Kernel::Gaussian => "gaussian",
            Kernel::SharpenedGaussian => "sharpened-gaussian",
            Kernel::Lanczos => "lanczos",
            Kernel::BlackmanHarris => "blackman-harris",
            Kernel::Mitchell { b, c } => return write!(f, "mitchell:{b},{c},{}", self.width),
        };
        write!(f, "{name}:{}", self.width)
    }
}

impl FromStr for FilterSpec {
    type Err = Error;

    /// Reads `box`, `gaussian:2` (its width in pixels), `mitchell`, `mitchell:1/3,1/3`, `mitchell:0,0.5,4`.
    fn from_str(text: &str) -> Result<Self> {
        let bad = |problem: &str| Error::invalid(format!("filter \"{text}\""), problem);
        let (name, rest) = text.trim().split_once(':').map_or((text.trim(), None), |(n, r)| (n, Some(r)));
        let numbers = rest
            .map(|r| r.split(',').map(fraction).collect::<Option<Vec<f64>>>())
            .unwrap_or(Some(Vec::new()))
            .ok_or_else(|| bad("expected numbers such as 2, 0.5 or 1/3 after the colon"))?;
        let kernel = match name {
            "box" => Kernel::Box,
            "tent" => Kernel::Tent,
            "gaussian" => Kernel::Gaussian,
            "sharpened-gaussian" => Kernel::SharpenedGaussian,
            "lanczos" => Kernel::Lanczos,
            "blackman-harris" => Kernel::BlackmanHarris,
            "mitchell" => match numbers[..] {
                [] => Kernel::Mitchell { b: 1.0 / 3.0, c: 1.0 / 3.0 },
                [b, c] | [b, c, _] => Kernel::Mitchell { b, c },
                _ => return Err(bad("expected mitchell:B,C or mitchell:B,C,WIDTH")),
            },
            _ => {
                return Err(bad("expected box, tent, gaussian, sharpened-gaussian, mitchell:B,C, lanczos \
                                or blackman-harris, each with its width after a colon if it is to be another"));
            }
        };
        let width = match (kernel, &numbers[..]) {
            (Kernel::Mitchell { .. }, [_, _, width]) => *width,
            (Kernel::Mitchell { .. }, _) | (_, []) => Self::default_width(kernel),
            (_, [width]) => *width,
            _ => return Err(bad("expected one number, the width in pixels")),
        };
        // 0 would be a point sample, which is no filter; 64 is beyond any use and bounds the tables.
        if !(width > 0.0 && width <= 64.0) {
            return Err(bad("the width must be above 0 and at most 64 pixels"));
        }
        if let Kernel::Mitchell { b, c } = kernel {
            // Within this square the kernel's integral is 1 and its negative lobes stay below its main lobe.
            if !((0.0..=1.0).contains(&b) && (0.0..=1.0).contains(&c)) {
                return Err(bad("B and C must be from 0 to 1"));
            }
        }
        if kernel == Kernel::Lanczos && width < 2.0 {
            return Err(bad("a Lanczos filter is at least 2 pixels wide"));
        }
        Ok(Self { kernel, width })
    }
}

/// A decimal, or a fraction of two.
fn fraction(text: &str) -> Option<f64> {
    let value = match text.split_once('/') {
        Some((a, b)) => a.trim().parse::<f64>().ok()? / b.trim().parse::<f64>().ok()?,
        None => text.trim().parse().ok()?,
    };
    value.is_finite().then_some(value)
}

impl serde::Serialize for FilterSpec {
    fn serialize<S: serde::Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_str(self)
    }
}

impl<'de> serde::Deserialize<'de> for FilterSpec {
    fn deserialize<D: serde::Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let text = String::deserialize(deserializer)?;
        text.parse().map_err(serde::de::Error::custom)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_read_back() {
        for text in ["box:1", "tent:2", "gaussian:2.5", "sharpened-gaussian:4", "lanczos:6", "blackman-harris:3"] {
            let spec: FilterSpec = text.parse().unwrap();
            assert_eq!(spec.to_string(), text);
            assert_eq!(spec.to_string().parse::<FilterSpec>().unwrap(), spec);
        }
        let third: FilterSpec = "mitchell:1/3,1/3".parse().unwrap();
        assert_eq!(third.kernel, Kernel::Mitchell { b: 1.0 / 3.0, c: 1.0 / 3.0 });
        assert_eq!(third.to_string().parse::<FilterSpec>().unwrap(), third);
        assert_eq!("mitchell".parse::<FilterSpec>().unwrap(), third);
    }

    #[test]
    fn nonsense_is_refused() {
        for bad in [
            "",
            "bix",
            "box:0",
            "box:-1",
            "box:1,2",
            "box:nan",
            "mitchell:1",
            "mitchell:1,2",
            "mitchell:1/0,0",
            "gaussian:",
            "lanczos:1",
            "tent:1e9",
            "mitchell:0,0,4,4",
        ] {
            assert!(bad.parse::<FilterSpec>().is_err(), "{bad}");
        }
    }

    #[test]
    fn the_cubics_are_smooth_and_a_partition_of_unity() {
        for (b, c) in [(1.0 / 3.0, 1.0 / 3.0), (1.0, 0.0), (0.0, 0.5)] {
            let spec = FilterSpec { kernel: Kernel::Mitchell { b, c }, width: 4.0 };
            for i in 0..50 {
                let x = f64::from(i) / 50.0;
                let sum: f64 = (-3..=3).map(|k| spec.value(x + f64::from(k))).sum();
                assert!((sum - 1.0).abs() < 1e-14, "{b} {c} {x}: {sum}");
            }
            for knot in [1.0, 2.0] {
                assert!((spec.value(knot - 1e-9) - spec.value(knot + 1e-9)).abs() < 1e-8);
            }
        }
    }
}
