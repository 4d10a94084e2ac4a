//! Error of each design on a frame of a real scene, relative to independent sampling and to Sobol's sequence.
//!
//! Some pixels, spread evenly over the frame, are each drawn many times with fresh seeds. Designs are unbiased
//! (`tests/unbiased.rs`), so the mean squared error of a pixel is the variance between its draws, and no reference is
//! needed: the work that one would take goes into more draws. (With filters that have negative lobes the pixel's
//! estimator has a bias of order 1/runs, which no design changes and this leaves out.) A reference can still be asked
//! for.
//!
//! Three measures: squared error; relative squared error; and the latter with every run's radiance capped at 1, the
//! display's white, which a few runs that happen to meet a lamp cannot decide. All designs are measured in the same
//! pixels: a ratio's interval comes from the spread, over the pixels, of the difference that it leaves.

use crate::design::{Design, DesignOptions, Dither, Factor, Kind, Mask, PixelAddress};
use crate::film::PixelAccumulator;
use crate::render::integrate::Pass;
use crate::render::{Progress, Shot};
use crate::trace::ImageFunction;
use crate::{Error, Result};
use glam::{DVec3, Vec2, Vec3};
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
    /// Independent draws of each design in each pixel, at least 2.
    pub draws: u32,
    /// Runs of each pixel's reference, two halves together; 0 for none.
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
    /// Mean over pixels and channels of each measure.
    pub errors: [f64; MEASURES],
    /// Those over independent sampling's.
    pub to_random: [Ratio; MEASURES],
    /// Those over that of Sobol's sequence.
    pub to_sobol: [Ratio; MEASURES],
    /// Those over the least of all designs' that were asked for by name.
    pub to_best: [Ratio; MEASURES],
}

/// Squared error; the same over (mean² + 0.01); the latter with each run capped.
pub const MEASURES: usize = 3;

/// A run's radiance is capped at this for the third measure: the display's white at exposure 0.
const CAP: f32 = 1.0;

/// A pixel's value with plain and with capped runs.
type Both = [DVec3; 2];

/// A pixel with what it should be.
struct Known {
    at: [i32; 2],
    /// Nothing where there is no reference: value, and its estimated squared error.
    reference: Option<[Both; 2]>,
}

/// What one design makes of a pixel, over its draws.
struct Spread {
    mean: Both,
    /// Mean squared error of one draw.
    squared: Both,
}

/// What the square of dark pixels is raised by (Rousselle, Knaus and Zwicker 2011).
const DARK: f64 = 0.01;

/// One draw of `design` in a pixel.
fn estimate(function: &impl ImageFunction, design: &Design, pass: &Pass<'_>, [x, y]: [i32; 2]) -> Both {
    let pixel = design.pixel(PixelAddress { x, y, frame: pass.number, field: 0 });
    let moves = design.factors().contains(&Factor::SHUTTER);
    let mut sums = [PixelAccumulator::new(0), PixelAccumulator::new(0)];
    for run in 0..design.runs() {
        let point = pixel.point(run);
        let u_film = Vec2::new(point.get(Factor::FILM_X), point.get(Factor::FILM_Y));
        let u_shutter = if moves { point.get(Factor::SHUTTER) } else { 0.5 };
        let (film, weight) = pass.footprint.sample(pass.filter, x, y, u_film, u_shutter);
        let radiance = function.radiance(film, &point);
        sums[0].add(radiance, weight);
        sums[1].add(radiance.min(Vec3::splat(CAP)), weight);
    }
    sums.map(|sum| sum.estimate().radiance.as_dvec3())
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
    // `[runs][kind]`: each pixel's errors.
    let mut sums = vec![vec![(Kind::Auto, Vec::<[f64; MEASURES]>::new()); kinds.len()]; effort.runs.len()];
    shot.explore(frame, |function, plan, pass| {
        let factors = plan.factors();
        let known = known(function, &factors, pass, &pixels, effort);
        for (row, &runs) in sums.iter_mut().zip(&effort.runs) {
            let mut spreads: Vec<(Kind, Vec<Spread>)> = Vec::new();
            for &kind in &kinds {
                if progress.is_cancelled() {
                    return;
                }
                spreads.push(spreads_of(function, &factors, pass, (kind, runs), &known, effort));
            }
            for (sum, errors) in row.iter_mut().zip(errors(&spreads, &known)) {
                sum.0 = errors.0;
                sum.1.extend(errors.1);
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

/// The pixels that `pass` exposes, with long estimates of them if asked for.
fn known(
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
            let reference = (effort.reference_runs > 0).then(|| {
                let [a, b] = [0, 1].map(|k: usize| estimate(function, &halves[k], pass, at));
                let own = [0, 1].map(|k: usize| 0.25 * (a[k] - b[k]) * (a[k] - b[k]));
                [[0, 1].map(|k: usize| 0.5 * (a[k] + b[k])), own]
            });
            Known { at, reference }
        })
        .collect()
}

/// The design drawn, and what it makes of each pixel.
fn spreads_of(
    function: &impl ImageFunction,
    factors: &[Factor],
    pass: &Pass<'_>,
    (kind, runs): (Kind, u32),
    known: &[Known],
    effort: &Effort,
) -> (Kind, Vec<Spread>) {
    let dither = if kind == Kind::Auto { Dither { mask: Mask::Auto, ..Dither::default() } } else { Dither::NONE };
    let designs: Vec<Design> = (0..u64::from(effort.draws.max(2)))
        .map(|draw| {
            let seed = effort.seed.wrapping_add(draw);
            Design::new(&DesignOptions { kind, dither, runs, seed, ..Default::default() }, factors)
        })
        .collect();
    let all = known
        .par_iter()
        .map(|pixel| {
            let draws: Vec<Both> = designs.iter().map(|d| estimate(function, d, pass, pixel.at)).collect();
            spread_between(&draws, pixel.reference)
        })
        .collect();
    (designs.first().map_or(kind, Design::kind), all)
}

/// Mean of `draws` and the mean squared error of one: against the reference, or else as the variance between them.
fn spread_between(draws: &[Both], reference: Option<[Both; 2]>) -> Spread {
    #[allow(clippy::cast_precision_loss, reason = "a count of draws")]
    let count = draws.len() as f64;
    let mean = [0, 1].map(|k: usize| draws.iter().map(|d| d[k]).sum::<DVec3>() / count);
    let squared = [0, 1].map(|k: usize| {
        let (from, own, divisor) = match reference {
            Some([value, own]) => (value[k], own[k], count),
            None => (mean[k], DVec3::ZERO, count - 1.0),
        };
        draws.iter().map(|d| (d[k] - from) * (d[k] - from)).sum::<DVec3>() / divisor - own
    });
    Spread { mean, squared }
}

/// Each kind's errors in each pixel; relative to the reference, or else to the mean of all that was drawn there.
fn errors(spreads: &[(Kind, Vec<Spread>)], known: &[Known]) -> Vec<(Kind, Vec<[f64; MEASURES]>)> {
    #[allow(clippy::cast_precision_loss, reason = "a count of designs")]
    let count = spreads.len() as f64;
    let values: Vec<Both> = known
        .iter()
        .enumerate()
        .map(|(i, pixel)| match pixel.reference {
            Some([value, _]) => value,
            None => [0, 1].map(|k: usize| spreads.iter().map(|(_, s)| s[i].mean[k]).sum::<DVec3>() / count),
        })
        .collect();
    let measured = |spread: &Spread, value: &Both| {
        let relative = |k: usize| (spread.squared[k] / (value[k] * value[k] + DARK)).element_sum() / 3.0;
        [spread.squared[0].element_sum() / 3.0, relative(0), relative(1)]
    };
    spreads.iter().map(|(kind, s)| (*kind, s.iter().zip(&values).map(|(s, v)| measured(s, v)).collect())).collect()
}

/// Rows of one number of runs; the first two kinds are what the others are held against.
fn compare(kinds: &[Kind], sums: &[(Kind, Vec<[f64; MEASURES]>)], runs: u32) -> Result<Vec<Row>> {
    let column = |i: usize, k: usize| -> Vec<f64> { sums[i].1.iter().map(|e| e[k]).collect() };
    let total = |i: usize, k: usize| column(i, k).iter().sum::<f64>();
    if (0..MEASURES).any(|k| total(0, k) <= 0.0) {
        return Err(Error::invalid("the frame", "has no error to compare: every pixel measured is exact"));
    }
    // What the runs do not allow is another design, which has a row of its own.
    let shown: Vec<usize> = (0..kinds.len()).filter(|&i| kinds[i] == Kind::Auto || sums[i].0 == kinds[i]).collect();
    let best = |k: usize| {
        let named = shown.iter().copied().filter(|&i| kinds[i] != Kind::Auto);
        named.min_by(|&a, &b| total(a, k).total_cmp(&total(b, k))).unwrap_or(0)
    };
    let best: [usize; MEASURES] = std::array::from_fn(best);
    let against =
        |i: usize, other: [usize; MEASURES]| std::array::from_fn(|k| Ratio::of(&column(i, k), &column(other[k], k)));
    #[allow(clippy::cast_precision_loss, reason = "a count of pixels")]
    let row = |&i: &usize| Row {
        kind: kinds[i],
        drawn: sums[i].0,
        runs,
        errors: std::array::from_fn(|k| total(i, k) / sums[i].1.len() as f64),
        to_random: against(i, [0; MEASURES]),
        to_sobol: against(i, [1; MEASURES]),
        to_best: against(i, best),
    };
    Ok(shown.iter().map(row).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Draws of values 1, 2, 3 (mean 2, variance 1) without a reference; with one at 1 whose own squared error is 0.25.
    #[test]
    fn errors_are_the_spread_or_the_distance_from_the_reference() {
        let draws: Vec<Both> = [1.0, 2.0, 3.0].map(|v| [DVec3::splat(v), DVec3::splat(0.5 * v)]).into();
        let spread = spread_between(&draws, None);
        assert_eq!(spread.mean, [DVec3::splat(2.0), DVec3::splat(1.0)]);
        assert_eq!(spread.squared, [DVec3::splat(1.0), DVec3::splat(0.25)]);
        let reference = [[DVec3::splat(1.0); 2], [DVec3::splat(0.25); 2]];
        let squared = spread_between(&draws, Some(reference)).squared[0].x;
        assert!((squared - (5.0 / 3.0 - 0.25)).abs() < 1e-12, "{squared}");
    }

    #[test]
    fn a_ratios_interval_has_no_width_where_the_pixels_agree() {
        let (one, other) = ([1.0, 2.0, 4.0], [2.0, 4.0, 8.0]);
        assert_eq!(Ratio::of(&one, &other), Ratio { value: 0.5, half: 0.0 });
        assert!(Ratio::of(&[1.0, 2.0, 5.0], &other).half > 0.0);
    }
}
