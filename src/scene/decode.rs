//! Encoded pictures to pixels, with every size bounded before it is allocated and decoders' panics caught.

use super::Pixels;
use image::{ColorType, DynamicImage, ImageDecoder, ImageFormat, ImageReader, Limits};
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

/// What a header says.
struct Header {
    width: u32,
    height: u32,
    /// Bytes a pixel, as the decoder or as we hold it, whichever is more.
    pixel: u8,
}

impl Header {
    fn of(bytes: &[u8]) -> Result<Self, String> {
        let (width, height, pixel) = if is_ktx2(bytes) {
            (word(bytes, 20)?, word(bytes, 24)?, 4)
        } else {
            guarded("image", || {
                let decoder = reader(bytes)?.into_decoder().map_err(|e| e.to_string())?;
                let ((width, height), stored) = (decoder.dimensions(), decoder.color_type());
                let held = match stored {
                    ColorType::Rgb32F | ColorType::Rgba32F => 12,
                    _ if is_deep(stored) => 8,
                    _ => 4,
                };
                Ok((width, height, stored.bytes_per_pixel().max(held)))
            })?
        };
        if width == 0 || height == 0 || width > LONGEST || height > LONGEST {
            return Err(format!("it has {width} x {height} pixels, expected 1 to {LONGEST} each way"));
        }
        Ok(Self { width, height, pixel })
    }

    /// An upper bound of what the decoded pixels take, bytes.
    fn size(&self) -> u64 {
        u64::from(self.width) * u64::from(self.height) * u64::from(self.pixel)
    }
}

/// An upper bound of what the decoded pixels take, bytes: from the header alone.
pub(crate) fn size(bytes: &[u8]) -> Result<u64, String> {
    Header::of(bytes).map(|h| h.size())
}

/// Whether samples have 16 bits.
fn is_deep(color: ColorType) -> bool {
    matches!(color, ColorType::L16 | ColorType::La16 | ColorType::Rgb16 | ColorType::Rgba16)
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
    let header = Header::of(bytes)?;
    if header.size() > most {
        return Err(format!("its {} x {} pixels take more than {} MiB", header.width, header.height, most >> 20));
    }
    if is_ktx2(bytes) {
        return guarded("KTX2", || ktx2(bytes, &header));
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
        color if is_deep(color) => Pixels::Rgba16(image.into_rgba16().pixels().map(|p| p.0).collect()),
        ColorType::Rgb32F | ColorType::Rgba32F => Pixels::RgbF32(image.into_rgb32f().pixels().map(|p| p.0).collect()),
        _ => Pixels::Rgba8(image.into_rgba8().pixels().map(|p| p.0).collect()),
    }
}

/// Decodes the largest level of a Basis Universal texture (`KHR_texture_basisu`).
fn ktx2(bytes: &[u8], header: &Header) -> Result<Decoded, String> {
    const LEVELS: usize = 80;
    let (width, height) = (header.width, header.height);
    // Blocks of 4 x 4 texels take a byte a texel; a picture of one texel still takes a block.
    let most = header.size().max(64);
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

#[cfg(test)]
mod tests {
    use super::*;

    /// A PNG of `depth` with the given samples, by the crate `png`, not `image`, which reads it.
    fn png(width: u32, height: u32, depth: png::BitDepth, data: &[u8]) -> Vec<u8> {
        let mut bytes = Vec::new();
        let mut encoder = png::Encoder::new(&mut bytes, width, height);
        encoder.set_color(png::ColorType::Rgba);
        encoder.set_depth(depth);
        encoder.write_header().unwrap().write_image_data(data).unwrap();
        bytes
    }

    /// The file with another size in its header, which is otherwise in order.
    fn claiming(mut bytes: Vec<u8>, width: u32, height: u32) -> Vec<u8> {
        bytes[16..20].copy_from_slice(&width.to_be_bytes());
        bytes[20..24].copy_from_slice(&height.to_be_bytes());
        let sum = crc32fast::hash(&bytes[12..29]);
        bytes[29..33].copy_from_slice(&sum.to_be_bytes());
        bytes
    }

    #[test]
    fn sixteen_bits_a_channel_arrive_as_they_were_stored() {
        let values = [[0_u16, 1, 255, 256], [65_535, 40_000, 32_768, 257]];
        let data: Vec<u8> = values.iter().flatten().flat_map(|v| v.to_be_bytes()).collect();
        let decoded = picture(&png(2, 1, png::BitDepth::Sixteen, &data), 1 << 20).unwrap();
        let Pixels::Rgba16(pixels) = decoded.pixels else { panic!("not 16 bits: {:?}", decoded.pixels) };
        assert_eq!(pixels, values);
    }

    #[test]
    fn lossless_webp_arrives_as_it_was_stored() {
        let values: Vec<u8> = (0..4 * 6).map(|i: u8| i.wrapping_mul(41) | 1).collect();
        let mut bytes = Vec::new();
        let encoder = image::codecs::webp::WebPEncoder::new_lossless(&mut bytes);
        encoder.encode(&values, 3, 2, image::ExtendedColorType::Rgba8).unwrap();
        let decoded = picture(&bytes, 1 << 20).unwrap();
        let Pixels::Rgba8(pixels) = decoded.pixels else { panic!("not 8 bits") };
        assert_eq!((decoded.width, decoded.height, pixels.as_flattened()), (3, 2, values.as_slice()));
    }

    #[test]
    fn a_small_file_that_claims_a_huge_picture_is_refused_by_its_header() {
        let small = png(1, 1, png::BitDepth::Eight, &[1, 2, 3, 4]);
        let bomb = claiming(small.clone(), 60_000, 60_000);
        assert_eq!(size(&bomb).unwrap(), 60_000 * 60_000 * 4);
        let problem = picture(&bomb, 1 << 30).unwrap_err();
        assert!(problem.contains("take more than 1024 MiB"), "{problem}");
        let problem = picture(&claiming(small.clone(), 65_537, 1), 1 << 30).unwrap_err();
        assert!(problem.contains("expected 1 to 65536 each way"), "{problem}");
        // Within the bound the header is believed and the missing rows are an error.
        assert!(picture(&claiming(small.clone(), 300, 300), 1 << 30).is_err());
        // The limit itself is allowed.
        assert!(picture(&small, 4).is_ok() && picture(&small, 3).is_err());
    }

    #[test]
    fn a_ktx2_file_cannot_make_the_transcoder_allocate_at_will() {
        let mut bytes = vec![0; 256];
        bytes[..12].copy_from_slice(b"\xabKTX 20\xbb\r\n\x1a\n");
        bytes[20..24].copy_from_slice(&4_u32.to_le_bytes());
        bytes[24..28].copy_from_slice(&4_u32.to_le_bytes());
        bytes[40..44].copy_from_slice(&1_u32.to_le_bytes());
        bytes[96..104].copy_from_slice(&(1_u64 << 50).to_le_bytes());
        let problem = picture(&bytes, 1 << 30).unwrap_err();
        assert!(problem.contains("level 0 takes"), "{problem}");
        bytes[40..44].copy_from_slice(&4_000_000_000_u32.to_le_bytes());
        assert!(picture(&bytes, 1 << 30).unwrap_err().contains("at most 32"));
        for length in 0..bytes.len() {
            assert!(picture(&bytes[..length], 1 << 30).is_err(), "{length}");
        }
    }
}
