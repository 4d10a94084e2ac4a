//! Sampling patterns seen: two-dimensional projections, power spectra and their radial averages (Mitchell 1990, §4.2,
//! figures 10 to 12).

use crate::design::{Design, Factor, PixelAddress};
use rayon::prelude::*;

/// Highest frequency of a spectrum along each axis, in cycles over the window.
pub const HIGHEST: usize = 64;

/// Side of a spectrum: frequencies −[`HIGHEST`] to [`HIGHEST`].
pub const SIDE: usize = 2 * HIGHEST + 1;

/// A window of pixels seen along two factors. Film axes span the window, others [0, 1) once.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Projection {
    /// The horizontal axis.
    pub across: Factor,
    /// The vertical axis.
    pub down: Factor,
    /// Pixels along each film axis.
    pub pixels: u32,
}

impl Projection {
    /// The points of `design` in the `window`-th window, in [0, 1)². With one film axis the window is a row or column
    /// of pixels, with none a single pixel.
    #[must_use]
    pub fn points(self, design: &Design, window: u32) -> Vec<[f64; 2]> {
        let along = |film| if self.across == film || self.down == film { self.pixels } else { 1 };
        let (columns, rows) = (along(Factor::FILM_X), along(Factor::FILM_Y));
        let mut points = Vec::with_capacity((columns * rows * design.runs()) as usize);
        for row in 0..rows {
            for column in 0..columns {
                // Windows stand side by side, with room between them.
                let x = i32::try_from(window * 2 * self.pixels + column).unwrap_or(i32::MAX);
                let y = i32::try_from(row).unwrap_or(i32::MAX);
                let pixel = design.pixel(PixelAddress { x, y, frame: 0, field: 0 });
                for run in 0..design.runs() {
                    let point = pixel.point(run);
                    let place = |factor: Factor| {
                        let coordinate = f64::from(point.get(factor));
                        if factor == Factor::FILM_X {
                            (f64::from(column) + coordinate) / f64::from(columns)
                        } else if factor == Factor::FILM_Y {
                            (f64::from(row) + coordinate) / f64::from(rows)
                        } else {
                            coordinate
                        }
                    };
                    points.push([place(self.across), place(self.down)]);
                }
            }
        }
        points
    }

    /// The mean power spectrum over `windows` windows: |Σ exp(−2πi f·p)|² / n, row by row from −[`HIGHEST`], 1 for
    /// independent points. The zero frequency is left 0.
    #[must_use]
    pub fn spectrum(self, design: &Design, windows: u32) -> Vec<f64> {
        let sum = (0..windows)
            .into_par_iter()
            .map(|window| power(&self.points(design, window)))
            .reduce(|| vec![0.0; SIDE * SIDE], |a, b| a.iter().zip(&b).map(|(a, b)| a + b).collect());
        sum.iter().map(|s| s / f64::from(windows)).collect()
    }
}

/// The power spectrum of points in [0, 1)², exactly at whole frequencies; half the plane is computed, the other is its
/// mirror.
fn power(points: &[[f64; 2]]) -> Vec<f64> {
    let mut sums = vec![[0.0_f64; 2]; SIDE * (HIGHEST + 1)];
    let mut along = vec![[0.0; 2]; SIDE];
    for [x, y] in points {
        for (f, phase) in along.iter_mut().enumerate() {
            #[allow(clippy::cast_precision_loss, reason = "a frequency")]
            let turn = (f as f64 - HIGHEST as f64) * x;
            let (s, c) = libm::sincos(-2.0 * std::f64::consts::PI * turn);
            *phase = [c, s];
        }
        for (fy, row) in sums.chunks_exact_mut(SIDE).enumerate() {
            #[allow(clippy::cast_precision_loss, reason = "a frequency")]
            let (s, c) = libm::sincos(-2.0 * std::f64::consts::PI * fy as f64 * y);
            for (sum, [a, b]) in row.iter_mut().zip(&along) {
                sum[0] += a * c - b * s;
                sum[1] += a * s + b * c;
            }
        }
    }
    #[allow(clippy::cast_precision_loss, reason = "a count of points")]
    let n = points.len().max(1) as f64;
    (0..SIDE * SIDE)
        .map(|i| {
            let (fx, fy) = (i % SIDE, i / SIDE);
            let at = if fy >= HIGHEST { (fy - HIGHEST) * SIDE + fx } else { (HIGHEST - fy) * SIDE + (SIDE - 1 - fx) };
            if i == HIGHEST * SIDE + HIGHEST { 0.0 } else { (sums[at][0].powi(2) + sums[at][1].powi(2)) / n }
        })
        .collect()
}

/// Mean power by whole distance from the zero frequency, 1 to [`HIGHEST`].
#[must_use]
pub fn radial(spectrum: &[f64]) -> Vec<f64> {
    let mut sums = vec![[0.0; 2]; HIGHEST + 1];
    for (i, power) in spectrum.iter().enumerate() {
        #[allow(clippy::cast_precision_loss, reason = "a frequency")]
        let [fx, fy] = [i % SIDE, i / SIDE].map(|f| f as f64 - HIGHEST as f64);
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a distance of at most 91")]
        let ring = libm::round(fx.hypot(fy)) as usize;
        if ring <= HIGHEST {
            sums[ring][0] += power;
            sums[ring][1] += 1.0;
        }
    }
    sums[1..].iter().map(|s| s[0] / s[1]).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::design::{DesignOptions, Dither, Kind};

    fn film(kind: Kind, runs: u32, pixels: u32) -> Vec<f64> {
        let options = DesignOptions { kind, dither: Dither::NONE, runs, ..Default::default() };
        let design = Design::new(&options, &[Factor::FILM_X, Factor::FILM_Y, Factor::SHUTTER]);
        radial(&Projection { across: Factor::FILM_X, down: Factor::FILM_Y, pixels }.spectrum(&design, 64))
    }

    /// Independent points have power 1 at every frequency. Each ring's mean over 64 windows and at least 4 distinct
    /// frequencies has a standard deviation below 1/16; five of them bound all 64 rings (α < 10⁻⁴).
    #[test]
    fn independent_points_have_a_white_spectrum() {
        for (ring, power) in film(Kind::Random, 64, 1).iter().enumerate() {
            assert!((power - 1.0).abs() < 5.0 / 16.0, "ring {}: {power}", ring + 1);
        }
    }

    #[test]
    fn jitter_has_less_power_at_low_frequencies() {
        let power = film(Kind::Jittered, 1, 16);
        assert!(power[..4].iter().all(|p| *p < 0.3), "{:?}", &power[..4]);
        assert!(power[40] > 0.7);
    }
}
