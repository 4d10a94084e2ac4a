//! Decoded images and how they are looked up.

pub use super::environment::load_environment;

/// The most texture coordinate sets that a material may read.
pub const MAX_UV_SETS: usize = 4;

/// Pixel storage, rows from the top, `width × height` entries.
#[derive(Debug, Clone)]
pub enum Pixels {
    /// 8 bits a channel as stored in the file: sRGB or linear is decided by the use, not the image.
    Rgba8(Vec<[u8; 4]>),
    /// 16 bits a channel as stored in the file.
    Rgba16(Vec<[u16; 4]>),
    /// Scene-linear radiance.
    RgbF32(Vec<[f32; 3]>),
}

/// A decoded image.
#[derive(Debug, Clone)]
pub struct Image {
    /// The file's name for it; may be empty.
    pub name: String,
    /// Columns, ≥ 1.
    pub width: u32,
    /// Rows, ≥ 1.
    pub height: u32,
    /// The pixels.
    pub pixels: Pixels,
}

/// What happens outside [0, 1).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Wrap {
    /// The edge texel continues.
    Clamp,
    /// The image is tiled, every second tile mirrored.
    Mirror,
    /// The image is tiled.
    #[default]
    Repeat,
}

/// Whether texels are blended.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum TexelFilter {
    /// The nearest texel alone.
    Nearest,
    /// Bilinear.
    #[default]
    Linear,
}

/// An image with its sampler.
#[derive(Debug, Clone)]
pub struct Texture {
    /// Index into [`super::Scene::images`].
    pub image: usize,
    /// Wrapping of u and v.
    pub wrap: [Wrap; 2],
    /// Filter when a texel is larger than a sample's footprint.
    pub magnify: TexelFilter,
    /// Filter within a level when texels are smaller than the footprint.
    pub minify: TexelFilter,
    /// Whether the author's minification filter asks for mip levels.
    pub mipmapped: bool,
}
