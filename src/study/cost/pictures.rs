//! Thumbnails and difference pictures as data for a page without a network.

use super::Rendered;
use super::reference::Reference;
use crate::output::compare::map_png;
use crate::output::view::View;
use crate::{Error, Result};

/// Stops of exposure that bring the reference's 95th percentile of luminance to 0.8, so that thumbnails of dark scenes
/// can be seen.
#[must_use]
pub fn exposure(reference: &Reference) -> f64 {
    let mut luminances: Vec<f64> =
        reference.rgb.iter().map(|p| 0.2126 * p[0] + 0.7152 * p[1] + 0.0722 * p[2]).collect();
    luminances.sort_by(f64::total_cmp);
    match luminances.get(luminances.len() * 95 / 100) {
        Some(&bright) if bright > 0.0 => libm::log2(0.8 / bright),
        _ => 0.0,
    }
}

/// A scene-linear picture as an 8-bit sRGB PNG.
///
/// # Errors
/// If the encoder refuses.
#[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "codes from 0 to 255; pictures' sides")]
pub fn shown(rgb: &[[f32; 3]], width: usize, exposure_ev: f64) -> Result<Vec<u8>> {
    let bad = |error: png::EncodingError| Error::invalid("thumbnail", format!("cannot be encoded: {error}"));
    let view = View { exposure_ev, ..View::default() };
    let codes: Vec<u8> = rgb.iter().flat_map(|&p| view.encode(p).to_array().map(|c| (c * 255.0 + 0.5) as u8)).collect();
    let mut bytes = Vec::new();
    let mut encoder = png::Encoder::new(&mut bytes, width as u32, (rgb.len() / width.max(1)) as u32);
    encoder.set_color(png::ColorType::Rgb);
    encoder.set_depth(png::BitDepth::Eight);
    let mut writer = encoder.write_header().map_err(bad)?;
    writer.write_image_data(&codes).map_err(bad)?;
    writer.finish().map_err(bad)?;
    Ok(bytes)
}

/// The reference as pixels.
#[must_use]
#[allow(clippy::cast_possible_truncation, reason = "shown in 8 bits")]
pub fn narrow(reference: &Reference) -> Vec<[f32; 3]> {
    reference.rgb.iter().map(|p| p.map(|c| c as f32)).collect()
}

/// Error of each pixel relative to the reference, in magma up to `largest`: the root of the summands of relMSE.
///
/// # Errors
/// If the encoder refuses.
#[allow(clippy::cast_possible_truncation, reason = "pictures' sides")]
pub fn difference(picture: &Rendered, reference: &Reference, largest: f64) -> Result<Vec<u8>> {
    let map: Vec<f64> = picture
        .rgb
        .iter()
        .zip(&reference.rgb)
        .map(|(x, r)| {
            let sum: f64 = (0..3).map(|c| (f64::from(x[c]) - r[c]).powi(2) / (r[c] * r[c] + 0.01)).sum();
            (sum / 3.0).sqrt()
        })
        .collect();
    map_png(&map, (picture.width as u32, (map.len() / picture.width.max(1)) as u32), largest)
}

/// RFC 4648, section 4.
#[must_use]
pub fn base64(bytes: &[u8]) -> String {
    const LETTERS: &[u8; 64] = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    let mut out = String::with_capacity(bytes.len().div_ceil(3) * 4);
    for chunk in bytes.chunks(3) {
        let word = chunk.iter().fold(0_u32, |w, &b| w << 8 | u32::from(b)) << (8 * (3 - chunk.len()));
        for digit in 0..4 {
            let letter = LETTERS[(word >> (18 - 6 * digit) & 63) as usize];
            out.push(if digit <= chunk.len() { char::from(letter) } else { '=' });
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The vectors of RFC 4648, section 10.
    #[test]
    fn base64_is_the_standards() {
        let vectors =
            [("", ""), ("f", "Zg=="), ("fo", "Zm8="), ("foo", "Zm9v"), ("foob", "Zm9vYg=="), ("foobar", "Zm9vYmFy")];
        for (plain, coded) in vectors {
            assert_eq!(base64(plain.as_bytes()), coded);
        }
    }
}
