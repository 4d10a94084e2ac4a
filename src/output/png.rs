//! PNG files: what a screen shows, 8 or 16 bits, with the record of what made them.

use super::picture::Picture;
use super::quantise::{Dither, Place, ascii_json};
use super::view::{View, ViewTransform};
use crate::{Error, Result};
use rayon::prelude::*;
use std::path::Path;

/// Bits of each channel.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum PngDepth {
    /// 8 bits.
    #[default]
    Eight,
    /// 16 bits.
    Sixteen,
}

/// How a picture becomes a PNG.
#[derive(Debug, Clone, Copy, PartialEq, Default, serde::Serialize, serde::Deserialize)]
pub struct PngOptions {
    /// Bits of each channel.
    pub depth: PngDepth,
    /// Display transform.
    pub view: View,
    /// How codes are chosen.
    pub dither: Dither,
}

/// Keywords of our text chunks.
pub(super) mod names {
    pub(crate) const SETTINGS: &str = "graeco:settings";
    pub(crate) const SETTINGS_HASH: &str = "graeco:settings-hash";
    pub(crate) const SCENE_HASH: &str = "graeco:scene-hash";
    pub(crate) const SEED: &str = "graeco:seed";
    pub(crate) const FRAME: &str = "graeco:frame";
    pub(crate) const PASSES: &str = "graeco:passes";
    pub(crate) const VIEW: &str = "graeco:view";
}

/// The file's bytes. A crop is written as a picture of its own size: PNG has no window.
///
/// # Errors
/// If the picture is inconsistent.
pub fn encode(picture: &Picture, options: PngOptions, path: &Path) -> Result<Vec<u8>> {
    picture.validate()?;
    let bad = |error: png::EncodingError| Error::Picture {
        path: path.to_path_buf(),
        problem: format!("cannot encode: {error}"),
    };
    let mut bytes = Vec::new();
    let mut encoder = png::Encoder::new(&mut bytes, picture.window.width, picture.window.height);
    encoder.set_color(if picture.alpha.is_some() { png::ColorType::Rgba } else { png::ColorType::Rgb });
    encoder.set_depth(match options.depth {
        PngDepth::Eight => png::BitDepth::Eight,
        PngDepth::Sixteen => png::BitDepth::Sixteen,
    });
    if options.view.transform != ViewTransform::Bt709 {
        encoder.set_source_srgb(png::SrgbRenderingIntent::Perceptual);
    }
    let aspect = picture.metadata.pixel_aspect;
    if aspect.width != aspect.height {
        // Narrow pixels stand denser along x.
        let dimensions = png::PixelDimensions { xppu: aspect.height, yppu: aspect.width, unit: png::Unit::Unspecified };
        encoder.set_pixel_dims(Some(dimensions));
    }
    let record = &picture.metadata.record;
    for (keyword, text) in [
        ("Software", record.program.clone()),
        (names::SETTINGS, ascii_json(&record.settings)),
        (names::SETTINGS_HASH, record.settings_hash.clone()),
        (names::SCENE_HASH, record.scene_hash.clone()),
        (names::SEED, record.seed.to_string()),
        (names::FRAME, picture.metadata.frame.to_string()),
        (names::VIEW, format!("{} {} EV", options.view.transform, options.view.exposure_ev)),
    ]
    .into_iter()
    .chain(picture.metadata.passes.map(|passes| (names::PASSES, passes.to_string())))
    {
        encoder.add_text_chunk(keyword.to_owned(), text).map_err(bad)?;
    }
    let mut writer = encoder.write_header().map_err(bad)?;
    if options.view.transform == ViewTransform::Bt709 {
        // PNG 3rd edition §11.3.2.6: BT.709 primaries and transfer, R'G'B', full range.
        writer.write_chunk(png::chunk::ChunkType(*b"cICP"), &[1, 1, 0, 1]).map_err(bad)?;
    }
    writer.write_image_data(&codes(picture, options)).map_err(bad)?;
    writer.finish().map_err(bad)?;
    Ok(bytes)
}

/// A file of 8-bit sRGB codes in row order, without a record: maps, thumbnails, sheets.
///
/// # Errors
/// If there are not as many codes as `size` has pixels.
pub fn encode_codes(codes: &[[u8; 3]], size: (u32, u32)) -> Result<Vec<u8>> {
    let bad = |error: png::EncodingError| Error::invalid("picture", format!("cannot be encoded: {error}"));
    let mut bytes = Vec::new();
    let mut encoder = png::Encoder::new(&mut bytes, size.0, size.1);
    encoder.set_color(png::ColorType::Rgb);
    encoder.set_depth(png::BitDepth::Eight);
    let mut writer = encoder.write_header().map_err(bad)?;
    writer.write_image_data(codes.as_flattened()).map_err(bad)?;
    writer.finish().map_err(bad)?;
    Ok(bytes)
}

#[allow(clippy::cast_possible_truncation, reason = "window columns and codes are within their types")]
fn codes(picture: &Picture, options: PngOptions) -> Vec<u8> {
    let (highest, bytes_each) = match options.depth {
        PngDepth::Eight => (255_u16, 1),
        PngDepth::Sixteen => (u16::MAX, 2),
    };
    let channels = if picture.alpha.is_some() { 4 } else { 3 };
    let width = picture.window.width as usize;
    let mut bytes = vec![0; picture.rgb.len() * channels * bytes_each];
    bytes.par_chunks_mut(width * channels * bytes_each).enumerate().for_each(|(row, line)| {
        for (x, pixel) in line.chunks_exact_mut(channels * bytes_each).enumerate() {
            let index = row * width + x;
            let shown = options.view.encode(picture.rgb[index]).to_array();
            let alpha = picture.alpha.as_ref().map(|alpha| f64::from(alpha[index].clamp(0.0, 1.0)));
            let values = (0..).zip(shown.into_iter().chain(alpha));
            for ((channel, value), out) in values.zip(pixel.chunks_exact_mut(bytes_each)) {
                let place = Place {
                    x: x as u32 + picture.window.x,
                    line: row as u32 + picture.window.y,
                    channel,
                    instant: picture.metadata.frame,
                };
                let code = options.dither.code(value * f64::from(highest), 0, highest, place);
                match options.depth {
                    PngDepth::Eight => out[0] = code as u8,
                    PngDepth::Sixteen => out.copy_from_slice(&code.to_be_bytes()),
                }
            }
        }
    });
    bytes
}
