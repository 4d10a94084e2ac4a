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

/// The most pixels of an environment picture: 16 384 × 8192, 1.6 GB as floats, is refused below that.
const MOST_ENVIRONMENT_PIXELS: u64 = 1 << 26;

/// Reads an equirectangular picture: `.hdr` and `.exr` as scene-linear radiance, other formats as sRGB.
///
/// # Errors
/// If the file cannot be read or decoded, or holds more than 67 million pixels.
pub fn load_environment(path: &std::path::Path) -> crate::Result<Image> {
    use crate::Error;
    let unreadable = |problem: String| Error::Picture { path: path.to_path_buf(), problem };
    let reader = image::ImageReader::open(path).map_err(|e| Error::io(path, "read", e))?;
    let reader = reader.with_guessed_format().map_err(|e| Error::io(path, "read", e))?;
    let linear = matches!(reader.format(), Some(image::ImageFormat::Hdr | image::ImageFormat::OpenExr));
    let (width, height) = reader.into_dimensions().map_err(|e| unreadable(format!("is no readable picture: {e}")))?;
    if u64::from(width) * u64::from(height) > MOST_ENVIRONMENT_PIXELS || width == 0 || height == 0 {
        return Err(unreadable(format!("is {width}x{height} pixels; expected 1 to {MOST_ENVIRONMENT_PIXELS} in all")));
    }
    let decoded = std::panic::catch_unwind(|| {
        let reader = image::ImageReader::open(path)?.with_guessed_format()?;
        reader.decode().map(|d| d.into_rgb32f())
    });
    let picture = match decoded {
        Ok(Ok(picture)) => picture,
        Ok(Err(e)) => return Err(unreadable(format!("cannot be decoded: {e}"))),
        Err(_) => return Err(unreadable("cannot be decoded: its decoder failed".into())),
    };
    let pixels = picture.pixels().map(|p| if linear { p.0 } else { p.0.map(linear_from_srgb) }).collect();
    let name = path.file_name().map_or(String::new(), |n| n.to_string_lossy().into_owned());
    Ok(Image { name, width, height, pixels: Pixels::RgbF32(pixels) })
}

/// IEC 61966-2-1.
fn linear_from_srgb(encoded: f32) -> f32 {
    if encoded <= 0.040_45 { encoded / 12.92 } else { libm::powf((encoded + 0.055) / 1.055, 2.4) }
}
