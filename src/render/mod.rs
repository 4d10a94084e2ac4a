//! The pipeline itself: the only module that names every stage.
//!
//! scene → effects → design → image function → film → output, one exposure at a time. A frame is one exposure, or two
//! where it is interlaced; every pixel is computed alone, so tiles, threads and machines never show.

pub mod adaptive;
pub mod aovs;
pub mod clock;
mod coverage;
pub mod extent;
pub mod forecast;
pub mod frames;
pub mod integrate;
pub mod merge;
pub mod parts;
pub mod progress;
pub mod settings;
pub mod shot;
pub mod trial;

pub use adaptive::{Adaptive, Goal};
pub use extent::BlurExtent;
pub use forecast::Forecast;
pub use frames::FrameList;
pub use merge::Collection;
pub use parts::{RunRange, Slice, Tile};
pub use progress::Progress;
pub use settings::{Scanning, Settings};
pub use shot::{Frame, FrameCost, Shot, Surroundings, pictures};
