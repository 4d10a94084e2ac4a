//! Pictures made by formula, stored as PNG.

use super::colour::encode;
use glam::{DVec2, DVec3};

/// A picture of linear colours, rows from the top.
pub(crate) struct Canvas {
    width: u32,
    height: u32,
    pixels: Vec<DVec3>,
}

impl Canvas {
    /// A picture whose colour at texture coordinates (u right, v down, both in [0, 1]) is `colour`: the mean of
    /// `side × side` points of each pixel.
    pub(crate) fn paint(width: u32, height: u32, side: u32, colour: impl Fn(DVec2) -> DVec3) -> Self {
        let size = DVec2::new(f64::from(width), f64::from(height));
        let step = 1.0 / f64::from(side);
        let pixels = (0..height)
            .flat_map(|y| (0..width).map(move |x| (x, y)))
            .map(|(x, y)| {
                let mut sum = DVec3::ZERO;
                for i in 0..side * side {
                    let offset = DVec2::new(f64::from(i % side) + 0.5, f64::from(i / side) + 0.5) * step;
                    sum += colour((DVec2::new(f64::from(x), f64::from(y)) + offset) / size);
                }
                sum * (step * step)
            })
            .collect();
        Self { width, height, pixels }
    }

    /// As an sRGB PNG file; grey pictures take one channel.
    pub(crate) fn png(&self) -> Vec<u8> {
        #[allow(clippy::float_cmp, reason = "grey means the very same number in every channel")]
        let grey = self.pixels.iter().all(|p| p.x == p.y && p.y == p.z);
        let mut bytes = Vec::new();
        let mut encoder = png::Encoder::new(&mut bytes, self.width, self.height);
        encoder.set_color(if grey { png::ColorType::Grayscale } else { png::ColorType::Rgb });
        encoder.set_depth(png::BitDepth::Eight);
        encoder.set_compression(png::Compression::High);
        let data: Vec<u8> = self
            .pixels
            .iter()
            .flat_map(|p| p.to_array().into_iter().take(if grey { 1 } else { 3 }))
            .map(quantise)
            .collect();
        let mut writer = encoder.write_header().expect("a header written to memory");
        writer.write_image_data(&data).expect("as many bytes as the header says");
        writer.finish().expect("an end written to memory");
        bytes
    }
}

/// Linear [0, 1] to an 8-bit sRGB code.
#[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "clamped to the range of u8 before")]
fn quantise(v: f64) -> u8 {
    (encode(v.clamp(0.0, 1.0)) * 255.0 + 0.5) as u8
}
