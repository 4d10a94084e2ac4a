//! Experiments on the side: variance of designs, structure between pixels, patterns and spectra.
//!
//! Reads all other modules, is read by none.

pub mod adaptive;
pub mod canvas;
pub mod cost;
pub mod designs;
pub mod designs_rendered;
pub mod dither;
pub mod farm;
pub mod farm_plot;
pub mod interlace;
pub mod mirror;
pub mod motion;
pub mod patterns;
pub mod plots;
pub mod poster;
pub mod savings;
pub mod sheet;
pub mod texture;
