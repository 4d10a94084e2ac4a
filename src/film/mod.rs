//! Samples → image: the footprint and filter of a pixel, its sums, its variance.
//!
//! In: radiance samples of single pixels, in run order. Out: a [`Film`] of estimates with their variance. A pixel is
//! estimated from its own samples only, drawn from the filter's own density ([`Filter::sample`]), so that pixels are
//! independent of one another: a crop is the same pixels of the full frame bit for bit, however the work was divided.

mod accumulate;
mod aligned;
pub mod blocks;
mod estimates;
mod filter;
mod footprint;
mod kernel;
mod packed;
mod replicates;
mod shutter;

pub use accumulate::{PixelAccumulator, PixelEstimate};
pub use aligned::{AlignedSums, Block, Join, aligned_blocks};
pub use blocks::Blocks;
pub use estimates::{Film, Window};
pub use filter::Filter;
pub use footprint::{Footprint, Lines, Scan};
pub use kernel::{FilterSpec, Kernel};
pub use packed::Layout;
pub(crate) use packed::{Unpacked, pack_estimates};
pub use replicates::{REPLICATES, Replicates, STUDENT_T};
pub use shutter::{MOST_KNOTS, ShutterCurve};
