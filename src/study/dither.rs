//! Error that structure between pixels leaves visible: pictures of moving things at few runs a pixel, blurred as an eye
//! at a distance blurs (Mitchell 1990, §5.2, the experiment under eq. 15).
//!
//! The *time* picture varies with time alone: every pixel looks through its centre, so that all error is motion blur's.
//! The *full* picture varies with all seven factors. Both have exact means per pixel.

use crate::design::{Design, DesignOptions, Dither, Factor, Kind, PixelAddress};
use crate::trace::analytic::{Analytic, FACTORS};
use crate::trace::{FilmPoint, ImageFunction};
use glam::DVec2;
use rayon::prelude::*;

/// A square picture with known pixel means.
#[derive(Debug)]
pub struct Picture {
    side: usize,
    function: Analytic,
    /// Whether positions and lens stay at their centres.
    time_alone: bool,
    means: Vec<f64>,
}

impl Picture {
    /// A disk that crosses `side`² pixels, all but time held at the centres; `heading` (0 to 3) chooses its motion.
    #[must_use]
    pub fn of_time(side: usize, heading: usize) -> Self {
        let function = Analytic::picture_disk(side as f64, heading, true);
        let means = (0..side * side).into_par_iter().map(|i| function.time_mean(centre(i, side), 4096)).collect();
        Self { side, function, time_alone: true, means }
    }

    /// A disk that crosses `side`² pixels between a lens and a lit plane: all seven factors; `heading` (0 to 3)
    /// chooses its motion.
    #[must_use]
    pub fn of_all(side: usize, heading: usize) -> Self {
        let function = Analytic::picture_disk(side as f64, heading, false);
        let means =
            (0..side * side).into_par_iter().map(|i| function.mean((i % side) as f64, (i / side) as f64, 2)).collect();
        Self { side, function, time_alone: false, means }
    }

    /// Pixels across.
    #[must_use]
    pub fn side(&self) -> usize {
        self.side
    }

    /// The exact pixel means, row by row.
    #[must_use]
    pub fn means(&self) -> &[f64] {
        &self.means
    }

    /// The picture that `design` gives in `frame`, row by row.
    #[must_use]
    pub fn render(&self, design: &Design, frame: i64) -> Vec<f64> {
        (0..self.side * self.side)
            .into_par_iter()
            .map(|i| {
                let [x, y] = [i % self.side, i / self.side].map(|c| i32::try_from(c).unwrap_or(i32::MAX));
                let pixel = design.pixel(PixelAddress { x, y, frame, field: 0 });
                let mut sum = 0.0;
                for run in 0..design.runs() {
                    let point = pixel.point(run);
                    let u_time = point.get(Factor::SHUTTER);
                    sum += if self.time_alone {
                        self.function.value(&Analytic::at_centre(centre(i, self.side), u_time.into()))
                    } else {
                        let offset = DVec2::new(point.get(Factor::FILM_X).into(), point.get(Factor::FILM_Y).into());
                        let position = DVec2::new(x.into(), y.into()) + offset;
                        f64::from(self.function.radiance(FilmPoint { position, u_time }, &point).x)
                    };
                }
                sum / f64::from(design.runs())
            })
            .collect()
    }
}

/// Centre of pixel `i` of a picture `side` across.
#[allow(clippy::cast_precision_loss, reason = "pixels")]
fn centre(i: usize, side: usize) -> [f64; 2] {
    [(i % side) as f64 + 0.5, (i / side) as f64 + 0.5]
}

/// What is measured: a kind, its dither, runs and frames averaged.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Trial {
    /// How runs are placed inside a pixel.
    pub kind: Kind,
    /// Structure between pixels.
    pub dither: Dither,
    /// Runs a pixel.
    pub runs: u32,
    /// Frames of the still picture that are averaged.
    pub frames: u32,
}

/// Root mean squared error of `pictures` under `trial`: before and after a Gaussian blur of `sigma` pixels, over
/// `seeds` seeds each. A margin of three σ is left out.
#[must_use]
pub fn visible_error(pictures: &[Picture], trial: Trial, sigma: f64, seeds: u64) -> [f64; 2] {
    let mut sums = [0.0; 2];
    let mut count = 0.0;
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a few pixels")]
    let margin = (3.0 * sigma) as usize;
    for (picture, seed) in pictures.iter().flat_map(|picture| (0..seeds).map(move |seed| (picture, seed))) {
        let options = DesignOptions {
            kind: trial.kind,
            dither: trial.dither,
            runs: trial.runs,
            seed,
            frames: trial.frames.max(1),
            ..Default::default()
        };
        let design = Design::new(&options, if picture.time_alone { &FACTORS[2..3] } else { &FACTORS });
        let mut error: Vec<f64> = picture.means.iter().map(|m| -m).collect();
        for frame in 0..i64::from(trial.frames) {
            for (e, value) in error.iter_mut().zip(picture.render(&design, frame)) {
                *e += value / f64::from(trial.frames);
            }
        }
        let blurred = blur(&error, picture.side, sigma);
        for y in margin..picture.side - margin {
            for x in margin..picture.side - margin {
                let i = y * picture.side + x;
                sums[0] += error[i] * error[i];
                sums[1] += blurred[i] * blurred[i];
                count += 1.0;
            }
        }
    }
    sums.map(|s| (s / count).sqrt())
}

/// `values`, `side` across, under a Gaussian of standard deviation `sigma` cut at four σ; the edge is continued.
#[must_use]
pub fn blur(values: &[f64], side: usize, sigma: f64) -> Vec<f64> {
    #[allow(clippy::cast_possible_truncation, reason = "a few pixels")]
    let reach = libm::ceil(4.0 * sigma) as isize;
    #[allow(clippy::cast_precision_loss, reason = "a few pixels")]
    let kernel: Vec<f64> = (-reach..=reach).map(|d| libm::exp(-0.5 * (d as f64 / sigma).powi(2))).collect();
    let total: f64 = kernel.iter().sum();
    let clamped = |i: usize, d: isize| i.saturating_add_signed(d).min(side - 1);
    let mut rows = vec![0.0; values.len()];
    for (i, out) in rows.iter_mut().enumerate() {
        let (x, y) = (i % side, i / side);
        *out = kernel.iter().zip(-reach..).map(|(k, d)| k * values[y * side + clamped(x, d)]).sum::<f64>() / total;
    }
    let mut out = vec![0.0; values.len()];
    for (i, out) in out.iter_mut().enumerate() {
        let (x, y) = (i % side, i / side);
        *out = kernel.iter().zip(-reach..).map(|(k, d)| k * rows[clamped(y, d) * side + x]).sum::<f64>() / total;
    }
    out
}
