//! Variance of each design relative to independent sampling, on image functions whose integrals are known.
//!
//! A *problem* is one image function at one pixel with its exact mean and variance. For each problem a design is drawn
//! many times with fresh randomizations. Reported, over all problems of one function:
//!
//! - VR, the mean squared error over that of independent sampling at the same number of runs (lower is better);
//! - the systematic part: how much of the error every randomization repeats (bias² over mean squared error);
//! - the worst problem's own ratio.

use crate::design::{Design, DesignOptions, Dither, Factor, Kind, Mask, Over, PixelAddress};
use crate::trace::analytic::{Analytic, AnalyticKind};
use crate::trace::{FilmPoint, ImageFunction};
use glam::DVec2;
use rayon::prelude::*;

/// One image function at one pixel.
pub struct Problem<'a> {
    /// The function.
    pub function: &'a dyn ImageFunction,
    /// The pixel whose mean is sought.
    pub pixel: [i32; 2],
    /// Its exact mean (of the first channel).
    pub mean: f64,
    /// Variance of one independent sample.
    pub variance: f64,
}

/// How much to measure, and with which seed.
#[derive(Debug, Clone, Copy)]
pub struct Effort {
    /// Problems a function.
    pub placements: u32,
    /// Independent draws of the design a problem.
    pub randomizations: u32,
    /// Chooses placements and draws.
    pub seed: u64,
}

/// What a design achieves at one number of runs on one function.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize)]
pub struct Measured {
    /// Mean squared error over that of independent sampling.
    pub ratio: f64,
    /// Standard error of `ratio`, from the spread between placements' shares.
    pub standard_error: f64,
    /// Share of the mean squared error that all randomizations have in common.
    pub systematic: f64,
    /// The largest ratio of one problem.
    pub worst: f64,
}

/// The estimate of the pixel's mean by one draw of `design`, addressed by `place` and `draw`.
#[must_use]
pub fn estimate(design: &Design, problem: &Problem<'_>, place: u32, draw: u32) -> f64 {
    let address = PixelAddress { x: i32::try_from(place).unwrap_or(i32::MAX), y: 0, frame: i64::from(draw), field: 0 };
    let pixel = design.pixel(address);
    let corner = DVec2::new(problem.pixel[0].into(), problem.pixel[1].into());
    let mut sum = 0.0;
    for run in 0..design.runs() {
        let point = pixel.point(run);
        let film = FilmPoint {
            position: corner + DVec2::new(point.get(Factor::FILM_X).into(), point.get(Factor::FILM_Y).into()),
            u_time: point.get(Factor::SHUTTER),
        };
        sum += f64::from(problem.function.radiance(film, &point).x);
    }
    sum / f64::from(design.runs())
}

/// Measures `design` over `problems`.
#[must_use]
pub fn measure(design: &Design, problems: &[Problem<'_>], randomizations: u32) -> Measured {
    let draws = f64::from(randomizations);
    // Per problem: mean squared error, bias² corrected for its own noise, and what independent runs would have.
    let each: Vec<[f64; 3]> = problems
        .par_iter()
        .enumerate()
        .map(|(place, problem)| {
            let place = u32::try_from(place).unwrap_or(u32::MAX);
            let errors: Vec<f64> =
                (0..randomizations).map(|draw| estimate(design, problem, place, draw) - problem.mean).collect();
            let bias = errors.iter().sum::<f64>() / draws;
            let squared = errors.iter().map(|e| e * e).sum::<f64>() / draws;
            let spread = (squared - bias * bias) / (draws - 1.0).max(1.0);
            [squared, bias * bias - spread, problem.variance / f64::from(design.runs())]
        })
        .collect();
    let total = |k: usize| each.iter().map(|e| e[k]).sum::<f64>();
    let (squared, independent) = (total(0), total(2));
    let ratio = squared / independent;
    let spread: f64 = each.iter().map(|e| (e[0] - ratio * e[2]).powi(2)).sum();
    Measured {
        ratio,
        standard_error: spread.sqrt() / independent,
        systematic: total(1) / squared,
        worst: each.iter().filter(|e| e[2] > 0.0).map(|e| e[0] / e[2]).fold(0.0, f64::max),
    }
}

/// The placements of one analytic function, with their exact means and variances.
#[derive(Debug)]
pub struct Placements {
    kind: AnalyticKind,
    functions: Vec<(Analytic, f64, f64)>,
}

impl Placements {
    /// Draws placements; variances of functions that are not indicators come from 8192 runs of Sobol's sequence.
    #[must_use]
    pub fn new(kind: AnalyticKind, effort: Effort) -> Self {
        let options = DesignOptions { kind: Kind::Sobol, dither: Dither::NONE, runs: 8192, ..Default::default() };
        let design = Design::new(&options, &kind.factors());
        let mut functions: Vec<(Analytic, f64, f64)> = Vec::new();
        let mut drawn = 0..u32::MAX;
        // Pixels that hardly vary are drawn again: they say nothing of a design but what chance does to rare events.
        while functions.len() < effort.placements as usize {
            let missing = effort.placements as usize - functions.len();
            let numbers: Vec<u32> = drawn.by_ref().take(missing).collect();
            let more: Vec<_> = numbers.into_par_iter().map(|n| placed(kind, n, effort.seed, &design)).collect();
            functions.extend(more.into_iter().filter(|(.., variance)| *variance > LEAST_VARIANCE));
        }
        Self { kind, functions }
    }

    /// Which function.
    #[must_use]
    pub fn kind(&self) -> AnalyticKind {
        self.kind
    }

    /// As problems.
    #[must_use]
    pub fn problems(&self) -> Vec<Problem<'_>> {
        self.functions
            .iter()
            .map(|(function, mean, variance)| Problem { function, pixel: [0, 0], mean: *mean, variance: *variance })
            .collect()
    }
}

/// Variance of one run below which a pixel counts as flat: that of an indicator which holds on 1 % of it.
const LEAST_VARIANCE: f64 = 0.01;

/// One placement with its mean and variance.
fn placed(kind: AnalyticKind, number: u32, seed: u64, design: &Design) -> (Analytic, f64, f64) {
    let function = Analytic::placement(kind, number, seed);
    let mean = function.mean(0.0, 0.0, 4);
    let squares = Squared(&function, mean);
    let problem = Problem { function: &squares, pixel: [0, 0], mean: 0.0, variance: 0.0 };
    let variance = estimate(design, &problem, number, 0);
    (function, mean, variance)
}

/// The square of a function's distance from its mean.
struct Squared<'a>(&'a Analytic, f64);

impl ImageFunction for Squared<'_> {
    fn radiance(&self, film: FilmPoint, point: &crate::design::Point<'_>) -> glam::Vec3 {
        let value = f64::from(self.0.radiance(film, point).x) - self.1;
        #[allow(clippy::cast_possible_truncation, reason = "radiance is f32")]
        let square = (value * value) as f32;
        glam::Vec3::splat(square)
    }
}

/// One row of the table: a design at a number of runs, on every function.
#[derive(Debug, Clone, serde::Serialize)]
pub struct Row {
    /// The design asked for.
    pub kind: Kind,
    /// Runs a pixel.
    pub runs: u32,
    /// In the order of the functions measured.
    pub functions: Vec<Measured>,
}

impl Row {
    /// The geometric mean of the ratios.
    #[must_use]
    #[allow(clippy::cast_precision_loss, reason = "seven functions")]
    pub fn log_mean(&self) -> f64 {
        let sum: f64 = self.functions.iter().map(|m| libm::log(m.ratio)).sum();
        libm::exp(sum / self.functions.len() as f64)
    }
}

/// Measures one kind at one number of runs on every function. Each design is built over the factors that the function
/// varies with, as the effects plan would have it.
#[must_use]
pub fn row(kind: Kind, runs: u32, placements: &[Placements], effort: Effort) -> Row {
    let functions = placements
        .iter()
        .map(|p| {
            let options = DesignOptions { kind, dither: Dither::NONE, runs, seed: effort.seed, ..Default::default() };
            let design = Design::new(&options, &p.kind().factors());
            measure(&design, &p.problems(), effort.randomizations)
        })
        .collect();
    Row { kind, runs, functions }
}

/// Every dither that the tables compare.
pub const DITHERS: [Dither; 10] = [
    Dither::NONE,
    Dither { mask: Mask::Ordered, over: Over::Time },
    Dither { mask: Mask::Ordered8, over: Over::Time },
    Dither { mask: Mask::BlueNoise, over: Over::Time },
    Dither { mask: Mask::R2, over: Over::Time },
    Dither { mask: Mask::ZOrder, over: Over::Time },
    Dither { mask: Mask::Ordered, over: Over::All },
    Dither { mask: Mask::BlueNoise, over: Over::All },
    Dither { mask: Mask::R2, over: Over::All },
    Dither { mask: Mask::ZOrder, over: Over::All },
];
