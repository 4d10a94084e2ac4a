//! Sampling designs: runs of a statistical design over the factors that a pixel's integral really has.
//!
//! A design assigns a level of every factor to every run (one sample of one pixel), then jitters inside the stratum
//! (Mitchell 1990, §5.2). Draws are addressed, not consumed: a coordinate depends on (seed, frame, field, pixel, run,
//! factor) alone, so any thread or machine can compute any of them.
//!
//! ```
//! use graeco::design::{Design, DesignOptions, Factor, PixelAddress};
//! let factors = [Factor::FILM_X, Factor::FILM_Y, Factor::SHUTTER];
//! let design = Design::new(&DesignOptions { runs: 64, ..Default::default() }, &factors);
//! let pixel = design.pixel(PixelAddress { x: 3, y: 5, frame: 0, field: 0 });
//! for run in 0..design.runs() {
//!     let point = pixel.point(run);
//!     assert!((0.0..1.0).contains(&point.get(Factor::SHUTTER)));
//! }
//! ```

mod address;
pub mod array;
mod choose;
mod disk;
pub mod dither;
pub mod export;
pub mod galois;
pub(crate) mod hash;
mod kind;
pub mod nets;
mod nets_data;
mod pads;
mod placed;
mod point;
mod refine;
mod strata;
mod void_and_cluster;

pub use crate::factor::Factor;
pub use address::PixelAddress;
pub use choose::{Choice, choose};
pub use kind::{Dither, Kind, Mask, Over, UnknownName};
#[cfg(test)]
pub(crate) use point::drawn;
pub use point::{Design, DesignOptions, PixelDesign, Point};
