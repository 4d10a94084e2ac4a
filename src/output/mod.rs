//! Image → files: frames, fields, sequences and video streams.
//!
//! In: finished [`Picture`]s in order. Out: EXR, PNG, YUV4MPEG2, or whatever an installed ffmpeg encodes. A file is
//! complete or not there; what was finished when something fails is kept.

pub mod check;
pub mod compare;
pub mod exr;
pub mod file;
pub mod flip;
pub mod manifest;
pub mod part;
pub mod pattern;
pub mod picture;
pub mod png;
pub mod quantise;
pub mod read;
pub mod sink;
pub mod video;
pub mod view;

pub use exr::ExrDepth;
pub use manifest::{FrameStats, Manifest};
pub use pattern::Pattern;
pub use picture::{FieldOrder, Metadata, Picture, PixelAspect, Plane, Record};
pub use png::{PngDepth, PngOptions};
pub use quantise::Dither;
pub use sink::{Cadence, Destination, FieldFiles, FrameFormat, OutputTarget};
pub use view::{View, ViewTransform};
