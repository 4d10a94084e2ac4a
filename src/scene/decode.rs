//! Encoded pictures to pixels, with every size bounded before it is allocated and decoders' panics caught.

use super::Pixels;
use image::{ColorType, DynamicImage, ImageFormat, ImageReader, Limits};
use std::cell::Cell;
use std::io::Cursor;
use std::panic::{AssertUnwindSafe, catch_unwind};

/// Most columns or rows of a picture.
const LONGEST: u32 = 1 << 16;

/// A decoded picture.
#[derive(Debug)]
pub(crate) struct Decoded {
    pub(crate) width: u32,
    pub(crate) height: u32,
    pub(crate) pixels: Pixels,
}

/// Runs third-party code that may panic on hostile input; a panic becomes a sentence.
///
/// What the closure captures is dropped or discarded after a panic, never looked at again.
pub(crate) fn guarded<T>(what: &str, f: impl FnOnce() -> Result<T, String>) -> Result<T, String> {
    let before = GUARDED.replace(true);
    let result = catch_unwind(AssertUnwindSafe(f));
    GUARDED.set(before);
    result.unwrap_or_else(|_| Err(format!("the {what} decoder failed on it")))
}

thread_local! {
    static GUARDED: Cell<bool> = const { Cell::new(false) };
}

/// Whether this thread is inside a decoder whose panic will become a sentence: a program's panic hook need not report
/// it.
#[must_use]
pub fn in_guarded_decoder() -> bool {
    GUARDED.get()
}

/// Whether `bytes` are a KTX2 container.
fn is_ktx2(bytes: &[u8]) -> bool {
    bytes.starts_with(b"\xabKTX 20\xbb\r\n\x1a\n")
}

fn word(bytes: &[u8], at: usize) -> Result<u32, String> {
    bytes
        .get(at..at + 4)
        .and_then(|b| b.try_into().ok())
        .map(u32::from_le_bytes)
        .ok_or_else(|| "it ends within its header".into())
}

/// Columns and rows, from the header alone.
fn dimensions(bytes: &[u8]) -> Result<(u32, u32), String> {
    let (width, height) = if is_ktx2(bytes) {
        (word(bytes, 20)?, word(bytes, 24)?)
    } else {
        guarded("image", || reader(bytes)?.into_dimensions().map_err(|e| e.to_string()))?
    };
    if width == 0 || height == 0 || width > LONGEST || height > LONGEST {
        return Err(format!("it has {width} x {height} pixels, expected 1 to {LONGEST} each way"));
    }
    Ok((width, height))
}

/// An upper bound of what the decoded pixels take, bytes.
pub(crate) fn size(bytes: &[u8]) -> Result<u64, String> {
    let (width, height) = dimensions(bytes)?;
    let deep = bytes.starts_with(b"\x89PNG") && bytes.get(24) == Some(&16);
    let bytes_a_pixel = if deep { 8 } else { 4 };
    Ok(u64::from(width) * u64::from(height) * bytes_a_pixel)
}

fn reader(bytes: &[u8]) -> Result<ImageReader<Cursor<&[u8]>>, String> {
    let reader = ImageReader::new(Cursor::new(bytes)).with_guessed_format().map_err(|e| e.to_string())?;
    match reader.format() {
        Some(
            ImageFormat::Png
            | ImageFormat::Jpeg
            | ImageFormat::WebP
            | ImageFormat::Hdr
            | ImageFormat::Bmp
            | ImageFormat::Gif
            | ImageFormat::Tiff,
        ) => Ok(reader),
        _ => Err("it is in no known picture format".into()),
    }
}

/// Decodes a picture of at most `most` bytes of pixels. Channels are as stored: nothing is made linear.
pub(crate) fn picture(bytes: &[u8], most: u64) -> Result<Decoded, String> {
    let (width, height) = dimensions(bytes)?;
    if size(bytes)? > most {
        return Err(format!("its {width} x {height} pixels take more than {} MiB", most >> 20));
    }
    if is_ktx2(bytes) {
        return guarded("KTX2", || ktx2(bytes, (width, height), most));
    }
    guarded("image", || {
        let mut reader = reader(bytes)?;
        let mut limits = Limits::default();
        limits.max_image_width = Some(LONGEST);
        limits.max_image_height = Some(LONGEST);
        limits.max_alloc = Some(most);
        reader.limits(limits);
        let image = reader.decode().map_err(|e| e.to_string())?;
        Ok(Decoded { width: image.width(), height: image.height(), pixels: pixels(image) })
    })
}

fn pixels(image: DynamicImage) -> Pixels {
    match image.color() {
        ColorType::L16 | ColorType::La16 | ColorType::Rgb16 | ColorType::Rgba16 => {
            Pixels::Rgba16(image.into_rgba16().pixels().map(|p| p.0).collect())
        }
        ColorType::Rgb32F | ColorType::Rgba32F => Pixels::RgbF32(image.into_rgb32f().pixels().map(|p| p.0).collect()),
        _ => Pixels::Rgba8(image.into_rgba8().pixels().map(|p| p.0).collect()),
    }
}

/// Decodes the largest level of a Basis Universal texture (`KHR_texture_basisu`).
fn ktx2(bytes: &[u8], (width, height): (u32, u32), most: u64) -> Result<Decoded, String> {
    const LEVELS: usize = 80;
    let count = word(bytes, 40)?.max(1);
    if count > 32 {
        return Err(format!("it has {count} mip levels, expected at most 32"));
    }
    for level in 0..count as usize {
        // The transcoder allocates what the level index says.
        let at = LEVELS + level * 24 + 16;
        let size = u64::from(word(bytes, at)?) | (u64::from(word(bytes, at + 4)?) << 32);
        if size > most {
            return Err(format!("its level {level} takes {size} bytes, more than {most}"));
        }
    }
    let problem = |e: basisu::Error| format!("{e:?}");
    let texture = basisu::Transcoder::new(bytes).map_err(problem)?;
    if texture.base_dimensions() != (width, height) {
        return Err("its header contradicts itself".into());
    }
    let rgba = texture.transcode(0, basisu::TargetFormat::Rgba32, basisu::DecodeFlags::NONE).map_err(problem)?;
    let pixels: Vec<[u8; 4]> = rgba.chunks_exact(4).map(|p| [p[0], p[1], p[2], p[3]]).collect();
    if pixels.len() as u64 != u64::from(width) * u64::from(height) {
        return Err(format!("it decodes to {} pixels, expected {width} x {height}", pixels.len()));
    }
    Ok(Decoded { width, height, pixels: Pixels::Rgba8(pixels) })
}
