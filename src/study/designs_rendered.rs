//! Error of each design on a frame of a real scene, relative to independent sampling and to Sobol's sequence.
//!
//! Some pixels, spread evenly over the frame, are each drawn many times with fresh seeds and compared with a long
//! reference of their own. That resolves differences of a few per cent at a small part of the cost of whole pictures:
//! what one seed leaves to chance is averaged over draws, and what depends on the pixel shows in the intervals.

use crate::design::{Design, DesignOptions, Dither, Factor, Kind, Mask, PixelAddress};
use crate::film::PixelAccumulator;
use crate::render::integrate::Pass;
use crate::render::{Progress, Shot};
use crate::trace::ImageFunction;
use crate::{Error, Result};
use glam::{DVec3, Vec2};
use rayon::prelude::*;

/// How much to measure.
#[derive(Debug, Clone)]
pub struct Effort {
    /// Designs; each is drawn without structure between pixels, [`Kind::Auto`] as the program would.
    pub kinds: Vec<Kind>,
    /// Runs a pixel.
    pub runs: Vec<u32>,
    /// Pixels; 0 is every one.
    pub pixels: u32,
    /// Independent draws of each design in each pixel.
    pub draws: u32,
    /// Runs of each pixel's reference, two halves together.
    pub reference_runs: u32,
    /// Chooses draws.
    pub seed: u64,
}

/// A ratio with the half width of its 95 % interval over the pixels measured.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize)]
pub struct Ratio {
    /// Sum of one's squared errors over the other's.
    pub value: f64,
    /// 1.96 standard errors.
    pub half: f64,
}

impl Ratio {
    /// Of sums over pixels; the pixels are the sample.
    fn of(one: &[f64], other: &[f64]) -> Self {
        let total: f64 = other.iter().sum();
        let value = one.iter().sum::<f64>() / total;
        let squares: f64 = one.iter().zip(other).map(|(a, b)| (a - value * b).powi(2)).sum();
        Self { value, half: 1.96 * squares.sqrt() / total }
    }
}

/// What a design achieves at one number of runs.
#[derive(Debug, Clone, serde::Serialize)]
pub struct Row {
    /// The design asked for.
    pub kind: Kind,
    /// What was drawn.
    pub drawn: Kind,
    /// Runs a pixel.
    pub runs: u32,
    /// Mean squared error over pixels and channels, the reference's own subtracted.
    pub mse: f64,
    /// The same over (reference² + 0.01).
    pub rel_mse: f64,
    /// `mse` over that of independent sampling.
    pub to_random: Ratio,
    /// `mse` over that of Sobol's sequence.
    pub to_sobol: Ratio,
    /// `rel_mse` over that of independent sampling.
    pub rel_to_random: Ratio,
    /// `rel_mse` over the least of all designs' that were asked for by name.
    pub rel_to_best: Ratio,
    /// `mse` over the least of all designs' that were asked for by name.
    pub to_best: Ratio,
}

/// A pixel with what it should be.
struct Known {
    at: [i32; 2],
    mean: DVec3,
    /// Estimated squared error of `mean`.
    own: DVec3,
}

/// What the square of dark pixels is raised by (Rousselle, Knaus and Zwicker 2011).
const DARK: f64 = 0.01;

/// One draw of `design` in a pixel.
fn estimate(function: &impl ImageFunction, design: &Design, pass: &Pass<'_>, [x, y]: [i32; 2]) -> DVec3 {
    let pixel = design.pixel(PixelAddress { x, y, frame: pass.number, field: 0 });
    let moves = design.factors().contains(&Factor::SHUTTER);
    let mut sum = PixelAccumulator::new(0);
    for run in 0..design.runs() {
        let point = pixel.point(run);
        let u_film = Vec2::new(point.get(Factor::FILM_X), point.get(Factor::FILM_Y));
        let u_shutter = if moves { point.get(Factor::SHUTTER) } else { 0.5 };
        let (film, weight) = pass.footprint.sample(pass.filter, x, y, u_film, u_shutter);
        sum.add(function.radiance(film, &point), weight);
    }
    sum.estimate().radiance.as_dvec3()
}

/// The first `count` pixels of a lattice over the picture (Roberts 2018), or all of them.
#[allow(clippy::cast_possible_truncation, clippy::cast_possible_wrap, reason = "sides are at most 65 536")]
fn spread(count: u32, (width, height): (u32, u32)) -> Vec<[i32; 2]> {
    if count == 0 || u64::from(count) >= u64::from(width) * u64::from(height) {
        return (0..height).flat_map(|y| (0..width).map(move |x| [x as i32, y as i32])).collect();
    }
    let along = |i: u32, step: u32, side: u32| ((u64::from(i.wrapping_mul(step)) * u64::from(side)) >> 32) as i32;
    let mut all: Vec<[i32; 2]> =
        (0..count).map(|i| [along(i, 0xc13f_a9a9, width), along(i, 0x91e1_0da5, height)]).collect();
    all.sort_unstable();
    all.dedup();
    all
}

/// Measures every design on frame `frame` of `shot`, whose picture has `size` pixels.
///
/// # Errors
/// If `progress` was cancelled, nothing was asked for, or every pixel's error is zero.
pub fn study(
    shot: &Shot<'_>,
    size: (u32, u32),
    frame: i64,
    effort: &Effort,
    progress: &Progress,
    each: &mut dyn FnMut(&Row),
) -> Result<Vec<Row>> {
    let mut kinds = vec![Kind::Random, Kind::Sobol];
    kinds.extend(effort.kinds.iter().filter(|k| ![Kind::Random, Kind::Sobol].contains(k)));
    let pixels = spread(effort.pixels, size);
    // `[runs][kind]`: each pixel's squared errors, plain and relative.
    let mut sums = vec![vec![(Kind::Auto, Vec::<[f64; 2]>::new()); kinds.len()]; effort.runs.len()];
    shot.explore(frame, |function, plan, pass| {
        let factors = plan.factors();
        let known = references(function, &factors, pass, &pixels, effort);
        for (row, &runs) in sums.iter_mut().zip(&effort.runs) {
            for (sum, &kind) in row.iter_mut().zip(&kinds) {
                if progress.is_cancelled() {
                    return;
                }
                let (drawn, errors) = errors(function, &factors, pass, kind, runs, &known, effort);
                sum.0 = drawn;
                sum.1.extend(errors);
            }
        }
    })?;
    if progress.is_cancelled() {
        return Err(Error::invalid("study", "was cancelled"));
    }
    let mut rows = Vec::new();
    for (row, &runs) in sums.iter().zip(&effort.runs) {
        for made in compare(&kinds, row, runs)? {
            each(&made);
            rows.push(made);
        }
    }
    Ok(rows)
}

/// Long estimates of the pixels that `pass` exposes.
fn references(
    function: &impl ImageFunction,
    factors: &[Factor],
    pass: &Pass<'_>,
    pixels: &[[i32; 2]],
    effort: &Effort,
) -> Vec<Known> {
    let half = |salt: u64| {
        let runs = (effort.reference_runs / 2).max(1);
        let seed = !effort.seed ^ salt;
        Design::new(
            &DesignOptions { kind: Kind::Sobol, dither: Dither::NONE, runs, seed, ..Default::default() },
            factors,
        )
    };
    let halves = [half(0), half(1)];
    pixels
        .par_iter()
        .filter(|[_, y]| pass.lines.holds(y.unsigned_abs()))
        .map(|&at| {
            let [a, b] = [0, 1].map(|k: usize| estimate(function, &halves[k], pass, at));
            Known { at, mean: 0.5 * (a + b), own: 0.25 * (a - b) * (a - b) }
        })
        .collect()
}

/// The design drawn, and each pixel's mean squared error over draws and channels: plain, relative.
fn errors(
    function: &impl ImageFunction,
    factors: &[Factor],
    pass: &Pass<'_>,
    kind: Kind,
    runs: u32,
    known: &[Known],
    effort: &Effort,
) -> (Kind, Vec<[f64; 2]>) {
    let dither = if kind == Kind::Auto { Dither { mask: Mask::Auto, ..Dither::default() } } else { Dither::NONE };
    let designs: Vec<Design> = (0..u64::from(effort.draws))
        .map(|draw| {
            let seed = effort.seed.wrapping_add(draw);
            Design::new(&DesignOptions { kind, dither, runs, seed, ..Default::default() }, factors)
        })
        .collect();
    let all = known
        .par_iter()
        .map(|pixel| {
            let mut squares = DVec3::ZERO;
            for design in &designs {
                let error = estimate(function, design, pass, pixel.at) - pixel.mean;
                squares += error * error - pixel.own;
            }
            squares /= 3.0 * f64::from(effort.draws);
            [squares.element_sum(), (squares / (pixel.mean * pixel.mean + DARK)).element_sum()]
        })
        .collect();
    (designs.first().map_or(kind, Design::kind), all)
}

/// Rows of one number of runs; the first two kinds are what the others are held against.
fn compare(kinds: &[Kind], sums: &[(Kind, Vec<[f64; 2]>)], runs: u32) -> Result<Vec<Row>> {
    let column = |i: usize, k: usize| -> Vec<f64> { sums[i].1.iter().map(|e| e[k]).collect() };
    let total = |i: usize, k: usize| column(i, k).iter().sum::<f64>();
    if (0..2).any(|k| total(0, k) <= 0.0) {
        return Err(Error::invalid("the frame", "has no error to compare: every pixel measured is exact"));
    }
    // What the runs do not allow is another design, which has a row of its own.
    let shown: Vec<usize> = (0..kinds.len()).filter(|&i| kinds[i] == Kind::Auto || sums[i].0 == kinds[i]).collect();
    let best = |k: usize| {
        let named = shown.iter().copied().filter(|&i| kinds[i] != Kind::Auto);
        named.min_by(|&a, &b| total(a, k).total_cmp(&total(b, k))).unwrap_or(0)
    };
    let best = [best(0), best(1)];
    #[allow(clippy::cast_precision_loss, reason = "a count of pixels")]
    let row = |&i: &usize| Row {
        kind: kinds[i],
        drawn: sums[i].0,
        runs,
        mse: total(i, 0) / sums[i].1.len() as f64,
        rel_mse: total(i, 1) / sums[i].1.len() as f64,
        to_random: Ratio::of(&column(i, 0), &column(0, 0)),
        to_sobol: Ratio::of(&column(i, 0), &column(1, 0)),
        rel_to_random: Ratio::of(&column(i, 1), &column(0, 1)),
        to_best: Ratio::of(&column(i, 0), &column(best[0], 0)),
        rel_to_best: Ratio::of(&column(i, 1), &column(best[1], 1)),
    };
    Ok(shown.iter().map(row).collect())
}
