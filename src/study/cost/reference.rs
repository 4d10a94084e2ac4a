//! The picture that others are judged by, and how far they are from it.

use super::Rendered;
use crate::output::flip;
use crate::output::read::Loaded;
use crate::{Error, Result};
use serde::Serialize;

/// A reference with what is known of its own error.
#[derive(Debug, Clone, Default)]
pub struct Reference {
    /// Scene-linear pixels in row order.
    pub rgb: Vec<[f64; 3]>,
    /// Pixels across.
    pub width: usize,
    /// Estimated squared error of each value; `None` where nobody knows.
    pub variance: Option<Vec<[f64; 3]>>,
    /// Mean ꟻLIP between its halves.
    pub own_flip: Option<f64>,
}

/// Distances from a reference, the reference's own squared error subtracted (not from ꟻLIP, which is no square).
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize)]
pub struct Errors {
    /// Mean squared difference; below zero by chance where the reference is no better than the picture.
    pub mse: f64,
    /// Root of `mse`; 0 where that is below zero.
    pub rmse: f64,
    /// Mean squared difference over (reference² + 0.01); may be below zero as `mse`.
    pub rel_mse: f64,
    /// The same before subtraction.
    pub rel_mse_raw: f64,
    /// Mean ꟻLIP, of scene-linear pictures.
    pub flip: f64,
}

/// What the square of dark pixels is raised by in relMSE (Rousselle, Knaus and Zwicker 2011).
const DARK: f64 = 0.01;

fn wide(rgb: &[[f32; 3]]) -> Vec<[f64; 3]> {
    rgb.iter().map(|p| p.map(f64::from)).collect()
}

impl Reference {
    /// The mean of two independent halves.
    #[must_use]
    pub fn of_halves(a: &Rendered, b: &Rendered) -> Self {
        let (p, q) = (wide(&a.rgb), wide(&b.rgb));
        let pairs = || p.iter().zip(&q);
        let rgb = pairs().map(|(x, y)| [0, 1, 2].map(|c| 0.5 * (x[c] + y[c]))).collect();
        let variance = pairs().map(|(x, y)| [0, 1, 2].map(|c| 0.25 * (x[c] - y[c]).powi(2))).collect();
        Self { rgb, width: a.width, variance: Some(variance), own_flip: Some(mean(&flip::hdr(&p, &q, a.width))) }
    }

    /// A picture from a file; its planes `variance.R`, `.G`, `.B` say its error, if it has them.
    #[must_use]
    pub fn of_file(picture: &Loaded) -> Self {
        let plane = |name: &str| picture.planes.iter().find(|p| p.name == name);
        let planes = ["variance.R", "variance.G", "variance.B"].map(plane);
        let variance = match planes {
            [Some(r), Some(g), Some(b)] => {
                Some((0..picture.rgb.len()).map(|i| [r, g, b].map(|p| f64::from(p.samples[i]))).collect())
            }
            _ => None,
        };
        Self { rgb: wide(&picture.rgb), width: picture.window.width as usize, variance, own_flip: None }
    }

    /// Its own relMSE, if known.
    #[must_use]
    pub fn own_rel_mse(&self) -> Option<f64> {
        let variance = self.variance.as_ref()?;
        Some(self.mean_over(|i, c| variance[i][c] / (self.rgb[i][c] * self.rgb[i][c] + DARK)))
    }

    #[allow(clippy::cast_precision_loss, reason = "a count of values")]
    fn mean_over(&self, value: impl Fn(usize, usize) -> f64) -> f64 {
        let sum: f64 = (0..self.rgb.len()).map(|i| (0..3).map(|c| value(i, c)).sum::<f64>()).sum();
        sum / (3.0 * self.rgb.len().max(1) as f64)
    }

    /// How far `picture` is from it.
    ///
    /// # Errors
    /// If the sizes differ.
    pub fn errors(&self, picture: &Rendered) -> Result<Errors> {
        self.errors_of(&picture.rgb, picture.width)
    }

    /// How far the pixels `rgb` of a picture `width` across are from it.
    ///
    /// # Errors
    /// If the sizes differ.
    pub fn errors_of(&self, rgb: &[[f32; 3]], width: usize) -> Result<Errors> {
        if (width, rgb.len()) != (self.width, self.rgb.len()) {
            let lines = |pixels: usize, width: usize| pixels / width.max(1);
            return Err(Error::invalid(
                "reference",
                format!(
                    "it has {}x{} pixels, the frame {}x{}; expected equal sizes (--size)",
                    self.width,
                    lines(self.rgb.len(), self.width),
                    width,
                    lines(rgb.len(), width)
                ),
            ));
        }
        let test = wide(rgb);
        let square = |i: usize, c: usize| (test[i][c] - self.rgb[i][c]).powi(2);
        let own = |i: usize, c: usize| self.variance.as_ref().map_or(0.0, |v| v[i][c]);
        let weight = |i: usize, c: usize| 1.0 / (self.rgb[i][c] * self.rgb[i][c] + DARK);
        let mse = self.mean_over(|i, c| square(i, c) - own(i, c));
        Ok(Errors {
            mse,
            rmse: mse.max(0.0).sqrt(),
            rel_mse: self.mean_over(|i, c| (square(i, c) - own(i, c)) * weight(i, c)),
            rel_mse_raw: self.mean_over(|i, c| square(i, c) * weight(i, c)),
            flip: mean(&flip::hdr(&test, &self.rgb, self.width)),
        })
    }
}

#[allow(clippy::cast_precision_loss, reason = "a count of pixels")]
fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len().max(1) as f64
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::numeric::{mix64, unit_from_bits};

    /// A grey picture of 0.5 with independent uniform noise of the variance given.
    fn noisy(seed: u64, variance: f64) -> Rendered {
        let half_width = (3.0 * variance).sqrt();
        let value = |i: u64| {
            #[allow(clippy::cast_possible_truncation, reason = "the upper half is wanted")]
            let u = f64::from(unit_from_bits((mix64(seed << 32 | i) >> 32) as u32));
            #[allow(clippy::cast_possible_truncation, reason = "pixels are f32")]
            let v = (0.5 + half_width * (2.0 * u - 1.0)) as f32;
            v
        };
        let rgb = (0..64 * 64_u64).map(|i| [value(3 * i), value(3 * i + 1), value(3 * i + 2)]).collect();
        Rendered {
            rgb,
            width: 64,
            kind: crate::design::Kind::Random,
            samples: 0,
            rays: 0,
            seconds: 0.0,
            wall_s: 0.0,
            build_s: 0.0,
        }
    }

    /// A reference whose own error is half of the picture's: without subtraction the error would read a half too much.
    /// 12 288 values: the standard deviation of the mean square is below 2 %.
    #[test]
    fn the_references_own_error_is_subtracted() {
        let reference = Reference::of_halves(&noisy(1, 1e-3), &noisy(2, 1e-3));
        let errors = reference.errors(&noisy(3, 1e-3)).unwrap();
        assert!((errors.mse / 1e-3 - 1.0).abs() < 0.08, "{errors:?}");
        assert!((errors.rel_mse_raw / errors.rel_mse - 1.5).abs() < 0.12, "{errors:?}");
    }

    #[test]
    fn another_size_is_an_error() {
        let reference = Reference::of_halves(&noisy(1, 1e-3), &noisy(2, 1e-3));
        assert!(reference.errors(&Rendered { width: 32, ..noisy(3, 1e-3) }).is_err());
    }
}
