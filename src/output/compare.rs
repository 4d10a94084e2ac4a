//! How far two pictures are apart.

use super::flip;
use super::read::Loaded;
use crate::{Error, Result};

/// Differences of a test picture from a reference.
#[derive(Debug, Clone, PartialEq, serde::Serialize)]
pub struct Comparison {
    /// √ mean (a − b)² over pixels and channels of scene-linear values.
    pub rmse: f64,
    /// Mean (a − b)²/(b² + 0.01) over pixels and channels: squared error relative to the reference (Rousselle, Knaus and
    /// Zwicker 2011).
    pub rel_mse: f64,
    /// Largest |a − b|.
    pub max_difference: f64,
    /// Column and row of the largest difference.
    pub max_at: (u32, u32),
    /// Pixels that differ in any bit.
    pub different_pixels: usize,
    /// Pixels left out because a value in either picture is not finite.
    pub not_finite: usize,
    /// Mean ꟻLIP error, if asked for.
    pub flip: Option<f64>,
    /// Error of each pixel for a map: ꟻLIP if asked for, else the root of the pixel's mean squared difference.
    #[serde(skip)]
    pub map: Vec<f64>,
}

/// Whether ꟻLIP is computed too.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Metric {
    /// Numbers only.
    #[default]
    Difference,
    /// ꟻLIP too: of display-referred pictures the one of 2020, of scene-linear ones the one of 2021.
    Flip,
}

/// Compares `test` with `reference`, pixel by pixel of their windows.
///
/// # Errors
/// If their windows differ in size.
#[allow(clippy::cast_precision_loss, clippy::cast_possible_truncation, reason = "counts and places of pixels")]
pub fn compare(test: &Loaded, reference: &Loaded, metric: Metric) -> Result<Comparison> {
    let (a, b) = (test.window, reference.window);
    if (a.width, a.height) != (b.width, b.height) {
        return Err(Error::invalid(
            "comparison",
            format!(
                "the pictures have {}x{} and {}x{} pixels, expected equal sizes",
                a.width, a.height, b.width, b.height
            ),
        ));
    }
    let mut result = Comparison {
        rmse: 0.0,
        rel_mse: 0.0,
        max_difference: 0.0,
        max_at: (0, 0),
        different_pixels: 0,
        not_finite: 0,
        flip: None,
        map: Vec::with_capacity(test.rgb.len()),
    };
    for (index, (x, y)) in test.rgb.iter().zip(&reference.rgb).enumerate() {
        if x.map(f32::to_bits) != y.map(f32::to_bits) {
            result.different_pixels += 1;
        }
        if !x.iter().chain(y).all(|c| c.is_finite()) {
            result.not_finite += 1;
            result.map.push(0.0);
            continue;
        }
        let mut squares = 0.0;
        for (&p, &q) in x.iter().zip(y) {
            let difference = f64::from(p) - f64::from(q);
            squares += difference * difference;
            result.rel_mse += difference * difference / (f64::from(q) * f64::from(q) + 0.01);
            if difference.abs() > result.max_difference {
                result.max_difference = difference.abs();
                result.max_at = (index as u32 % a.width, index as u32 / a.width);
            }
        }
        result.rmse += squares;
        result.map.push((squares / 3.0).sqrt());
    }
    let values = 3.0 * (test.rgb.len() - result.not_finite).max(1) as f64;
    result.rmse = (result.rmse / values).sqrt();
    result.rel_mse /= values;
    if metric == Metric::Flip {
        let wide = |picture: &Loaded| -> Vec<[f64; 3]> {
            picture.rgb.iter().map(|rgb| rgb.map(|c| if c.is_finite() { f64::from(c) } else { 0.0 })).collect()
        };
        let width = a.width as usize;
        let both = test.display_referred || reference.display_referred;
        let (x, y) = (wide(test), wide(reference));
        result.map = if both { flip::ldr(&x, &y, width) } else { flip::hdr(&x, &y, width) };
        result.flip = Some(result.map.iter().sum::<f64>() / result.map.len().max(1) as f64);
    }
    Ok(result)
}

/// An error map as PNG: see [`map_codes`].
///
/// # Errors
/// If it cannot be encoded.
pub fn map_png(map: &[f64], size: (u32, u32), largest: f64) -> Result<Vec<u8>> {
    super::png::encode_codes(&map_codes(map, largest), size)
}

/// An error map as sRGB codes: dark violet for 0 to pale yellow for `largest` (1 for ꟻLIP), as in matplotlib's "magma".
#[must_use]
#[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "clamped to 0 to 255")]
pub fn map_codes(map: &[f64], largest: f64) -> Vec<[u8; 3]> {
    const MAGMA: [[f64; 3]; 9] = [
        [0.0, 0.0, 4.0],
        [28.0, 16.0, 68.0],
        [79.0, 18.0, 123.0],
        [129.0, 37.0, 129.0],
        [181.0, 54.0, 122.0],
        [229.0, 80.0, 100.0],
        [251.0, 135.0, 97.0],
        [254.0, 194.0, 135.0],
        [252.0, 253.0, 191.0],
    ];
    map.iter()
        .map(|&error| {
            let place = if largest > 0.0 { (error / largest).clamp(0.0, 1.0) * 8.0 } else { 0.0 };
            let low = (place as usize).min(7);
            let share = place - low as f64;
            [0, 1, 2].map(|c| (MAGMA[low][c] * (1.0 - share) + MAGMA[low + 1][c] * share).round() as u8)
        })
        .collect()
}
