//! Grey pictures of the studies: pixels, dots, text-free sheets, written as PNG.

use crate::{Error, Result};
use std::path::Path;

/// An 8-bit grey picture, white at first.
#[derive(Debug, Clone)]
pub struct Canvas {
    width: usize,
    height: usize,
    pixels: Vec<u8>,
}

impl Canvas {
    /// A white picture of `width` × `height` pixels.
    #[must_use]
    pub fn new(width: usize, height: usize) -> Self {
        Self { width, height, pixels: vec![255; width * height] }
    }

    /// Paints pixel (x, y); outside nothing happens.
    pub fn set(&mut self, x: usize, y: usize, grey: u8) {
        if x < self.width && y < self.height {
            self.pixels[y * self.width + x] = grey;
        }
    }

    /// Copies a picture of linear values in [0, 1], `width` across, to (x, y), each value `zoom` pixels wide; encoded
    /// as sRGB.
    pub fn paste(&mut self, values: &[f64], width: usize, at: [usize; 2], zoom: usize) {
        for (i, &value) in values.iter().enumerate() {
            let grey = srgb(value);
            for dy in 0..zoom {
                for dx in 0..zoom {
                    self.set(at[0] + i % width * zoom + dx, at[1] + i / width * zoom + dy, grey);
                }
            }
        }
    }

    /// A grey outline of a square of `side` pixels at (x, y).
    pub fn frame(&mut self, at: [usize; 2], side: usize) {
        for i in 0..side {
            for (x, y) in [(i, 0), (i, side - 1), (0, i), (side - 1, i)] {
                self.set(at[0] + x, at[1] + y, 200);
            }
        }
    }

    /// A black dot of `radius` pixels around (x, y).
    pub fn dot(&mut self, x: f64, y: f64, radius: f64) {
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "clipped to the picture")]
        for py in (y - radius).max(0.0) as usize..=(y + radius).max(0.0) as usize {
            for px in (x - radius).max(0.0) as usize..=(x + radius).max(0.0) as usize {
                #[allow(clippy::cast_precision_loss, reason = "pixels")]
                if (px as f64 + 0.5 - x).hypot(py as f64 + 0.5 - y) <= radius {
                    self.set(px, py, 0);
                }
            }
        }
    }

    /// The picture as a PNG file's bytes.
    ///
    /// # Errors
    /// If the encoder refuses.
    pub fn png(&self) -> Result<Vec<u8>> {
        let failed =
            |e: png::EncodingError| Error::Invalid { what: "a study's picture".into(), problem: e.to_string() };
        let mut bytes = Vec::new();
        let (width, height) = (u32::try_from(self.width).unwrap_or(0), u32::try_from(self.height).unwrap_or(0));
        let mut encoder = png::Encoder::new(&mut bytes, width, height);
        encoder.set_color(png::ColorType::Grayscale);
        encoder.set_depth(png::BitDepth::Eight);
        let mut writer = encoder.write_header().map_err(failed)?;
        writer.write_image_data(&self.pixels).map_err(failed)?;
        writer.finish().map_err(failed)?;
        Ok(bytes)
    }

    /// Writes the picture.
    ///
    /// # Errors
    /// If the file cannot be written.
    pub fn save(&self, path: &Path) -> Result<()> {
        let bytes = self.png()?;
        std::fs::write(path, bytes).map_err(|source| Error::Io { path: path.into(), action: "write", source })
    }
}

/// A linear value as an 8-bit sRGB code (IEC 61966-2-1), clipped to [0, 1].
fn srgb(linear: f64) -> u8 {
    let v = linear.clamp(0.0, 1.0);
    let encoded = if v <= 0.003_130_8 { 12.92 * v } else { 1.055 * libm::pow(v, 1.0 / 2.4) - 0.055 };
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "in 0..=255")]
    let code = (encoded * 255.0 + 0.5) as u8;
    code
}
