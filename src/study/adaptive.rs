//! What adaptive sampling gains over a fixed number of runs, and whether its intervals hold what they promise.
//!
//! - Seconds, rays and samples that a fixed number of runs takes to the same relMSE, FLIP or RMSE, read off its measured curve (straight
//!   between measurements in both logarithms, continued beyond them), over those that adaptive sampling took.
//! - Coverage: the share of values (pixels times channels) whose 95 % interval, equation 12 of Mitchell (1990, §5.1)
//!   over the pixel's quarters, holds the reference. Values that have no spread and equal the reference to the
//!   precision of `f32` are constant there; they are counted apart, since an interval of no width is right trivially.
//!   The reference's own error widens the interval: by √(1 + n/m) where the pixel has n runs and the reference m.

use super::cost::Subject;
use super::cost::reference::{Errors, Reference};
use crate::film::{Film, STUDENT_T};
use crate::render::{Adaptive, Goal, Progress, Shot};
use crate::{Error, Result};
use serde::Serialize;

/// One picture.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Picture {
    /// The half-width asked for; `None` for a fixed number of runs.
    pub asked: Option<f64>,
    /// Mean runs a pixel.
    pub runs: f64,
    /// Processor seconds over threads.
    pub seconds: f64,
    /// Rays.
    pub rays: u64,
    /// How far it is from the reference.
    pub errors: Errors,
    /// Of adaptive pictures, whether intervals held.
    pub coverage: Option<Coverage>,
}

/// Whether intervals held the reference.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize)]
pub struct Coverage {
    /// Values that vary.
    pub varying: u64,
    /// Of these, those whose interval holds the reference.
    pub held: u64,
    /// Values that are constant.
    pub constant: u64,
    /// Mean over varying values of (value − reference)/standard error of the picture's mean error: a bias shows here.
    pub bias: f64,
}

impl Coverage {
    /// Share of the varying values whose interval held.
    #[must_use]
    #[allow(clippy::cast_precision_loss, reason = "counts of values")]
    pub fn share(&self) -> f64 {
        self.held as f64 / self.varying.max(1) as f64
    }
}

/// Whether the intervals of `film`'s pixels hold `reference`, which has `reference_runs` runs a pixel.
#[must_use]
pub fn coverage(film: &Film, reference: &Reference, reference_runs: u64) -> Coverage {
    let mut counted = Coverage::default();
    let (mut difference, mut spread) = (0.0, 0.0);
    for (pixel, truth) in film.pixels().iter().zip(&reference.rgb) {
        #[allow(clippy::cast_precision_loss, reason = "counts of runs")]
        let wider = 1.0 + f64::from(pixel.runs) / reference_runs as f64;
        for (c, &true_value) in truth.iter().enumerate() {
            let (value, variance) = (f64::from(pixel.radiance[c]), f64::from(pixel.variance[c]));
            let off = value - true_value;
            // The reference is a mean of two values rounded to f32.
            let rounding = f64::from(f32::EPSILON) * value.abs().max(true_value.abs());
            if variance <= 0.0 && off.abs() <= rounding {
                counted.constant += 1;
                continue;
            }
            counted.varying += 1;
            counted.held += u64::from(off.abs() <= STUDENT_T * (variance * wider).sqrt() + rounding);
            difference += off;
            spread += variance * wider;
        }
    }
    counted.bias = if spread > 0.0 { difference / spread.sqrt() } else { 0.0 };
    counted
}

/// What was measured of a frame.
#[derive(Debug, Clone, Serialize)]
pub struct Study {
    /// Fixed numbers of runs, ascending; means over seeds.
    pub fixed: Vec<Picture>,
    /// Adaptive pictures, in the order asked; means over seeds.
    pub adaptive: Vec<Picture>,
}

/// A fixed number's cost at an adaptive picture's error, over that picture's.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Gain {
    /// Of seconds.
    pub seconds: f64,
    /// Of rays.
    pub rays: f64,
    /// Of samples.
    pub samples: f64,
}

impl Study {
    /// What `picture` gains at equal error as `measure` reads it; `None` where the curve does not fall.
    #[must_use]
    pub fn gain(&self, picture: &Picture, measure: impl Fn(&Errors) -> f64) -> Option<Gain> {
        let at = measure(&picture.errors).max(f64::MIN_POSITIVE).ln();
        let points: Vec<(f64, &Picture)> =
            self.fixed.iter().map(|p| (measure(&p.errors).max(f64::MIN_POSITIVE).ln(), p)).collect();
        let last = points.len().checked_sub(2)?;
        let from = (0..last).find(|&i| points[i + 1].0 <= at).unwrap_or(last);
        let ((a, p), (b, q)) = (points[from], points[from + 1]);
        if b >= a {
            return None;
        }
        let part = (at - a) / (b - a);
        let there = |cost: &dyn Fn(&Picture) -> f64| {
            let (low, high) = (cost(p).ln(), cost(q).ln());
            (low + part * (high - low)).exp() / cost(picture)
        };
        #[allow(clippy::cast_precision_loss, reason = "a count of rays")]
        let rays = there(&|p| p.rays as f64);
        Some(Gain { seconds: there(&|p| p.seconds), rays, samples: there(&|p| p.runs) })
    }
}

/// How much to measure.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Effort {
    /// Half-widths asked for.
    pub asked: Vec<f64>,
    /// Fixed numbers of runs, ascending.
    pub runs: Vec<u32>,
    /// Seeds.
    pub seeds: u32,
    /// Runs a pixel of each half of the reference.
    pub reference_runs: u32,
    /// The most runs a pixel of adaptive pictures.
    pub most_runs: u32,
}

/// Measures a frame: pictures take turns, seed by seed.
///
/// # Errors
/// If the settings do not fit the scene.
pub fn study(subject: &Subject<'_>, effort: &Effort) -> Result<Study> {
    let reference = subject.reference(effort.reference_runs)?;
    let fixed = effort.runs.iter().map(|&runs| (None, runs));
    let asked = effort.asked.iter().map(|&error| (Some(error), 0));
    let wanted: Vec<(Option<f64>, u32)> = fixed.chain(asked).collect();
    let mut taken: Vec<Vec<Picture>> = vec![Vec::new(); wanted.len()];
    for seed in 0..u64::from(effort.seeds) {
        for (&(error, runs), pictures) in wanted.iter().zip(&mut taken) {
            pictures.push(one(subject, &reference, effort, (error, runs), seed)?);
        }
    }
    let mut means = taken.iter().map(|pictures| mean(pictures));
    let fixed = means.by_ref().take(effort.runs.len()).collect();
    Ok(Study { fixed, adaptive: means.collect() })
}

fn one(
    subject: &Subject<'_>,
    reference: &Reference,
    effort: &Effort,
    (asked, runs): (Option<f64>, u32),
    seed: u64,
) -> Result<Picture> {
    let mut settings = subject.settings.clone();
    settings.sampling.seed = settings.sampling.seed.wrapping_add(seed);
    if let Some(error) = asked {
        let view = settings.adaptive.map(|a| a.view).unwrap_or_default();
        settings.adaptive = Some(Adaptive { goal: Goal::Error(error), most_runs: effort.most_runs, view });
    } else {
        settings.adaptive = None;
        settings.sampling.runs = runs;
    }
    let mut shot = Shot::new(subject.scene, &settings, subject.surroundings, "")?;
    let frame = shot.render(subject.frame, &Progress::default())?.ok_or(Error::Interrupted { frames_kept: 0 })?;
    let rgb: Vec<[f32; 3]> = frame.film.pixels().iter().map(|p| p.radiance.to_array()).collect();
    let reference_runs = 2 * u64::from(effort.reference_runs);
    #[allow(clippy::cast_precision_loss, reason = "counts of samples and threads")]
    let (pixels, threads) = (rgb.len() as f64, rayon::current_num_threads() as f64);
    #[allow(clippy::cast_precision_loss, reason = "a count of samples")]
    let runs = frame.cost.samples as f64 / pixels;
    Ok(Picture {
        asked,
        runs,
        seconds: frame.cost.render_cpu_s / threads,
        rays: frame.cost.rays,
        errors: reference.errors_of(&rgb, frame.film.window().width as usize)?,
        coverage: asked.map(|_| coverage(&frame.film, reference, reference_runs)),
    })
}

/// Means over seeds; seconds as the median, which a busy machine disturbs least.
#[allow(clippy::cast_precision_loss, reason = "counts of seeds and rays")]
fn mean(pictures: &[Picture]) -> Picture {
    let n = pictures.len().max(1) as f64;
    let of = |value: &dyn Fn(&Picture) -> f64| pictures.iter().map(value).sum::<f64>() / n;
    let mut seconds: Vec<f64> = pictures.iter().map(|p| p.seconds).collect();
    seconds.sort_by(f64::total_cmp);
    let middle = seconds.len() / 2;
    let seconds = if seconds.len() % 2 == 1 { seconds[middle] } else { 0.5 * (seconds[middle - 1] + seconds[middle]) };
    let coverages: Vec<Coverage> = pictures.iter().filter_map(|p| p.coverage).collect();
    let together = coverages.into_iter().reduce(|a, b| Coverage {
        varying: a.varying + b.varying,
        held: a.held + b.held,
        constant: a.constant + b.constant,
        bias: a.bias + b.bias,
    });
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a mean of counts")]
    let rays = of(&|p| p.rays as f64) as u64;
    let mse = of(&|p| p.errors.mse);
    Picture {
        asked: pictures[0].asked,
        runs: of(&|p| p.runs),
        seconds,
        rays,
        errors: Errors {
            mse,
            rmse: mse.max(0.0).sqrt(),
            rel_mse: of(&|p| p.errors.rel_mse),
            rel_mse_raw: of(&|p| p.errors.rel_mse_raw),
            flip: of(&|p| p.errors.flip),
        },
        coverage: together.map(|c| Coverage { bias: c.bias / n.sqrt(), ..c }),
    }
}
