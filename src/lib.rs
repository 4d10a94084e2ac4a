//! Graeco: a distributed ray tracer for moving pictures, in the sense of Cook, Porter and Carpenter (1984).
//!
//! A pixel is an integral of the image function I(x, y, t, lens u v, light u v, …) over everything that an
//! exposure blurs together (Mitchell 1990, §5.2). Data flows one way:
//!
//! ```text
//! scene → effects → design → image function → film → output
//! ```
//!
//! A module uses only modules above it in this list; `tests/layers.rs` holds the code to that.

pub mod error;
pub mod numeric;
pub mod time;

pub mod factor;

pub mod scene;

pub mod effects;

pub mod design;

pub mod trace;

pub mod film;

pub mod output;

pub mod render;

pub mod farm;

pub mod study;

pub use error::{Error, Result};
