//! Sampling designs: runs of a statistical design over the factors that a pixel's integral really has.
//!
//! A design assigns a level of every factor to every run (one sample of one pixel), then jitters inside the stratum
//! (Mitchell 1990, §5.2). Draws are addressed, not consumed: a coordinate depends on (seed, frame, field, pixel, run,
//! factor) alone, so any thread or machine can compute any of them.

use crate::numeric;

pub use crate::factor::Factor;

/// Which pixel of which picture: all of a draw's address but run and factor.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct PixelAddress {
    /// Column; may be negative for pixels outside the picture that a filter reaches.
    pub x: i32,
    /// Row, in lines of the whole frame.
    pub y: i32,
    /// Frame number.
    pub frame: i64,
    /// 0 for a progressive frame or a frame's first field, 1 for its second field.
    pub field: u32,
}

/// How runs are placed inside a pixel.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Kind {
    /// Independent uniform draws: the yardstick.
    #[default]
    Random,
}

/// A design over the factors of one picture.
#[derive(Debug, Clone)]
pub struct Design {
    seed: u64,
    runs: u32,
    factors: Vec<Factor>,
}

impl Design {
    /// A design of `runs` runs (at least 1) a pixel over `factors` (in their fixed order).
    #[must_use]
    pub fn new(_kind: Kind, runs: u32, factors: &[Factor], seed: u64) -> Self {
        Self { seed, runs, factors: factors.to_vec() }
    }

    /// Runs a pixel.
    #[must_use]
    pub fn runs(&self) -> u32 {
        self.runs
    }

    /// The factors it covers.
    #[must_use]
    pub fn factors(&self) -> &[Factor] {
        &self.factors
    }

    /// The design's runs in one pixel.
    #[must_use]
    pub fn pixel(&self, address: PixelAddress) -> PixelDesign<'_> {
        #[allow(clippy::cast_sign_loss, reason = "bits of an address, not a quantity")]
        let key = numeric::mix64(
            self.seed
                ^ numeric::mix64(u64::from(address.x as u32) << 32 | u64::from(address.y as u32))
                    .wrapping_add(numeric::mix64((address.frame as u64) << 1 | u64::from(address.field))),
        );
        PixelDesign { design: self, key }
    }
}

/// A design's runs in one pixel.
#[derive(Debug, Clone, Copy)]
pub struct PixelDesign<'a> {
    design: &'a Design,
    key: u64,
}

impl<'a> PixelDesign<'a> {
    /// Run `run`, from 0 to the design's runs − 1.
    #[must_use]
    #[inline]
    pub fn point(&self, run: u32) -> Point<'a> {
        let _ = self.design;
        Point { pixel: *self, run }
    }
}

/// One run in one pixel: a point of [0, 1)^d, evaluated a factor at a time.
#[derive(Debug, Clone, Copy)]
pub struct Point<'a> {
    pixel: PixelDesign<'a>,
    run: u32,
}

impl Point<'_> {
    /// The coordinate of `factor`, in [0, 1). Factors that the design was not built over answer too, stratified as
    /// well as padding can.
    #[must_use]
    #[inline]
    #[allow(clippy::cast_possible_truncation, reason = "the upper half of the hash is what is wanted")]
    pub fn get(&self, factor: Factor) -> f32 {
        let bits = numeric::mix64(self.pixel.key ^ u64::from(factor.0) << 32 ^ u64::from(self.run));
        numeric::unit_from_bits((bits >> 32) as u32)
    }
}
