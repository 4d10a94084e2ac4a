//! Sums of one pixel's runs, in an order that does not depend on how the work was divided ([`AlignedSums`]).

use super::aligned::{AlignedSums, Block, Join};
use glam::{DVec3, Vec3};

/// A pixel's estimate.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct PixelEstimate {
    /// The pixel: scene-linear Rec. 709 radiance.
    pub radiance: Vec3,
    /// Estimated variance of [`PixelEstimate::radiance`], per channel; infinite for a single run, whose error nobody
    /// knows.
    pub variance: Vec3,
    /// Runs that it is the mean of.
    pub runs: u32,
    /// Runs that were left out because their radiance was not finite.
    pub rejected: u32,
}

/// Plain sums over some runs.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(super) struct Part {
    pub(super) runs: u32,
    /// Σ w.
    pub(super) weight: f64,
    /// Σ L.
    pub(super) plain: DVec3,
    /// Σ w L.
    pub(super) weighted: DVec3,
}

/// Centred second moments over some runs (Chan, Golub and LeVeque 1979).
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(super) struct Moments {
    /// Σ (w L − mean)².
    pub(super) weighted: DVec3,
    /// Σ (w L − mean)(w − mean).
    pub(super) cross: DVec3,
    /// Σ (w − mean)².
    pub(super) weight: f64,
}

/// Below this many runs variance comes from [`Moments`], from here on from the parts of [`Sums::parts`].
pub(super) const ENOUGH: u32 = 16;

/// What is summed over an aligned block of runs.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Sums {
    pub(super) rejected: u32,
    pub(super) total: Part,
    pub(super) moments: Moments,
    pub(super) halves: [Part; 2],
    pub(super) quarters: [Part; 4],
    /// How many parts of equal size it can be told apart into: 1, 2 or 4.
    pub(super) known: u8,
}

/// Adds the runs of one pixel.
///
/// With filter weights w the pixel is mean(w L) − mean(L)·(mean(w) − 1): the regression estimator, whose control
/// variate is the weight with its known mean 1. It is exact for a constant image, equals L for one run, and divides by
/// nothing that can be small, as the usual Σ w L / Σ w does under filters with negative lobes. Its bias, −cov(w, L)/n,
/// falls faster than its standard error.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct PixelAccumulator {
    pub(super) sums: AlignedSums<Sums>,
    next: u64,
}

impl PixelAccumulator {
    /// An empty sum whose first run will be `first_run`.
    #[must_use]
    pub fn new(first_run: u32) -> Self {
        Self { sums: AlignedSums::default(), next: u64::from(first_run) }
    }

    /// Empties it for another pixel, keeping its memory.
    pub fn reset(&mut self, first_run: u32) {
        self.sums.clear();
        self.next = u64::from(first_run);
    }

    /// Adds the next run. One whose radiance is not finite is counted as rejected and left out.
    #[inline]
    pub fn add(&mut self, radiance: Vec3, filter_weight: f32) {
        let mut sums = Sums::EMPTY;
        if radiance.is_finite() {
            let (weight, plain) = (f64::from(filter_weight), radiance.as_dvec3());
            sums.total = Part { runs: 1, weight, plain, weighted: weight * plain };
        } else {
            sums.rejected = 1;
        }
        self.sums.push(Block { start: self.next, level: 0, sums });
        self.next += 1;
    }

    /// Adds the runs of `other`, which must be other runs of the same pixel. The result does not depend on the order in
    /// which ranges are merged.
    ///
    /// # Errors
    /// If a run is in both.
    pub fn merge(&mut self, other: &Self) -> crate::Result<()> {
        self.sums.merge(&other.sums)?;
        self.next = self.next.max(other.next);
        Ok(())
    }

    /// Runs added so far, rejected ones included.
    #[must_use]
    pub fn runs(&self) -> u64 {
        self.sums.runs()
    }

    /// Plain sums over all runs, and how many were rejected.
    pub(super) fn total(&self) -> (Part, u32) {
        self.sums.whole().map_or_else(Default::default, |whole| (whole.total, whole.rejected))
    }

    /// The pixel as estimated from the runs so far; black with no runs.
    ///
    /// The variance comes from the means of the four quarters of each block, which stratified runs make smaller than
    /// that of single runs, where there are at least 16 runs; below that from single runs, which overstates it for
    /// stratified designs.
    #[must_use]
    pub fn estimate(&self) -> PixelEstimate {
        let Some(whole) = self.sums.whole() else { return PixelEstimate::default() };
        let (total, rejected) = (whole.total, whole.rejected);
        if total.runs == 0 {
            return PixelEstimate { variance: Vec3::INFINITY, rejected, ..PixelEstimate::default() };
        }
        let runs = f64::from(total.runs);
        let mean = total.plain / runs;
        // A block of fewer than four runs has quarters of unequal numbers of runs, some of them none.
        let parts = || self.sums.blocks().iter().flat_map(|block| block.sums.parts()).filter(|part| part.runs > 0);
        let squares = if total.runs < ENOUGH {
            let m = whole.moments;
            m.weighted - 2.0 * mean * m.cross + mean * mean * m.weight
        } else {
            let centre = total.residual(mean) / runs;
            parts().fold(DVec3::ZERO, |sum, part| {
                let n = f64::from(part.runs);
                let deviation = part.residual(mean) / n - centre;
                sum + n * deviation * deviation
            })
        };
        let freedom = if total.runs < ENOUGH { runs - 1.0 } else { f64::from(parts().map(|_| 1_u32).sum::<u32>() - 1) };
        let variance =
            if freedom > 0.0 { (squares.max(DVec3::ZERO) / (freedom * runs)).as_vec3() } else { Vec3::INFINITY };
        PixelEstimate { radiance: total.estimate().as_vec3(), variance, runs: total.runs, rejected }
    }
}

impl Part {
    pub(super) fn plus(&self, other: &Self) -> Self {
        Self {
            runs: self.runs + other.runs,
            weight: self.weight + other.weight,
            plain: self.plain + other.plain,
            weighted: self.weighted + other.weighted,
        }
    }

    /// Σ (w L − mean·(w − 1)): the estimator's sum, linearised about the pixel's mean.
    pub(super) fn residual(&self, mean: DVec3) -> DVec3 {
        self.weighted - mean * (self.weight - f64::from(self.runs))
    }

    pub(super) fn estimate(&self) -> DVec3 {
        let runs = f64::from(self.runs);
        // Exactly the plain mean where all weights are 1: the difference is then exactly zero.
        (self.weighted - self.plain * ((self.weight - runs) / runs)) / runs
    }
}

impl Sums {
    const NONE: Part = Part { runs: 0, weight: 0.0, plain: DVec3::ZERO, weighted: DVec3::ZERO };

    /// Over no runs.
    pub(super) const EMPTY: Self = Self {
        rejected: 0,
        total: Self::NONE,
        moments: Moments { weighted: DVec3::ZERO, cross: DVec3::ZERO, weight: 0.0 },
        halves: [Self::NONE; 2],
        quarters: [Self::NONE; 4],
        known: 1,
    };

    /// Sums of as many parts of equal size as are known, at most four.
    pub(super) fn parts(&self) -> [Part; 4] {
        match self.known {
            1 => [self.total, Self::NONE, Self::NONE, Self::NONE],
            2 => [self.halves[0], self.halves[1], Self::NONE, Self::NONE],
            _ => self.quarters,
        }
    }
}

impl Join for Sums {
    #[inline]
    fn absorb(&mut self, next: &Self) {
        let (a, b) = (self.total, &next.total);
        self.moments.weighted += next.moments.weighted;
        self.moments.cross += next.moments.cross;
        self.moments.weight += next.moments.weight;
        if a.runs > 0 && b.runs > 0 {
            let (na, nb) = (f64::from(a.runs), f64::from(b.runs));
            let scale = na * nb / (na + nb);
            let weighted = b.weighted / nb - a.weighted / na;
            let weight = b.weight / nb - a.weight / na;
            self.moments.weighted += weighted * weighted * scale;
            self.moments.cross += weighted * (weight * scale);
            self.moments.weight += weight * weight * scale;
        }
        self.rejected += next.rejected;
        self.quarters = [self.halves[0], self.halves[1], next.halves[0], next.halves[1]];
        self.halves = [a, *b];
        self.total = a.plus(b);
        self.known = (2 * self.known.min(next.known)).min(4);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::film::Filter;
    use crate::numeric;
    use glam::Vec2;
    use proptest::prelude::*;

    fn uniform(key: u64) -> f32 {
        #[allow(clippy::cast_possible_truncation, reason = "the upper half is wanted")]
        numeric::unit_from_bits((numeric::mix64(key.wrapping_add(1)) >> 32) as u32)
    }

    fn filled(first: u32, last: u32) -> PixelAccumulator {
        let mut sum = PixelAccumulator::new(first);
        for run in first..last {
            let key = u64::from(run);
            let radiance = Vec3::new(uniform(3 * key), uniform(3 * key + 1) * 1e3, uniform(3 * key + 2) * 1e-3);
            sum.add(radiance, if uniform(key + 77_777) < 0.2 { -1.4 } else { 1.4 });
        }
        sum
    }

    proptest! {
        #[test]
        fn any_division_into_ranges_gives_the_same_bits(runs in 1_u32..300, a in 0_u32..300, b in 0_u32..300) {
            let (a, b) = (a.min(b).min(runs), a.max(b).min(runs));
            let whole = filled(0, runs);
            let mut parts = [filled(0, a), filled(a, b), filled(b, runs)];
            parts.rotate_left((runs % 3) as usize);
            let mut merged = PixelAccumulator::default();
            for part in &parts {
                merged.merge(part).unwrap();
            }
            prop_assert_eq!(&merged.sums, &whole.sums);
            prop_assert_eq!(merged.estimate(), whole.estimate());
        }

        #[test]
        fn a_constant_image_is_exact_under_every_filter(
            value in 1e-3_f32..1e3, runs in 1_u32..200, which in 0_usize..6, key in any::<u64>(),
        ) {
            let names = ["box", "gaussian", "sharpened-gaussian", "mitchell:1/3,1/3", "lanczos", "mitchell:0,1"];
            let filter = Filter::new(names[which].parse().unwrap());
            let mut sum = PixelAccumulator::new(0);
            for run in 0..u64::from(runs) {
                let u = Vec2::new(uniform(key.wrapping_add(2 * run)), uniform(key.wrapping_add(2 * run + 1)));
                sum.add(Vec3::splat(value), filter.sample(u).1);
            }
            let estimate = sum.estimate();
            prop_assert_eq!(estimate.radiance, Vec3::splat(value));
            if runs > 1 {
                // A difference of f64 numbers near value², each rounded a few times: far below what f32 resolves.
                prop_assert!(estimate.variance.max_element() <= value * value * 1e-14);
            }
        }
    }

    #[test]
    fn a_run_that_is_in_both_parts_is_an_error() {
        assert!(filled(0, 10).merge(&filled(9, 12)).is_err());
    }

    #[test]
    fn one_run_is_returned_as_it_is() {
        let mut sum = PixelAccumulator::new(0);
        sum.add(Vec3::new(0.1, 0.7, 3.0), -1.7);
        assert_eq!(sum.estimate().radiance, Vec3::new(0.1, 0.7, 3.0));
        assert_eq!(sum.estimate().variance, Vec3::INFINITY);
    }

    #[test]
    fn what_is_not_finite_is_counted_and_left_out() {
        let mut sum = PixelAccumulator::new(0);
        for run in 0..32_u8 {
            let value = match run {
                5 => f32::NAN,
                9 => f32::INFINITY,
                _ => 2.0,
            };
            sum.add(Vec3::splat(value), 1.0);
        }
        let estimate = sum.estimate();
        assert_eq!((estimate.rejected, estimate.runs, sum.runs()), (2, 30, 32));
        assert_eq!(estimate.radiance, Vec3::splat(2.0));
    }

    /// Independent uniform runs: the true variance of the mean is known; its estimate is averaged over 4000 pixels.
    /// 3 degrees of freedom give each a relative standard deviation of √(2/3), so their mean has 1.3 %.
    #[test]
    fn variance_estimates_are_right_on_average_for_independent_runs() {
        for runs in [2_u32, 3, 8, 15, 16, 24, 50, 64] {
            let mut mean = 0.0;
            for pixel in 0..4000_u64 {
                let mut sum = PixelAccumulator::new(0);
                for run in 0..u64::from(runs) {
                    sum.add(Vec3::splat(uniform(pixel << 20 | run)), 1.0);
                }
                mean += f64::from(sum.estimate().variance.x) / 4000.0;
            }
            let truth = 1.0 / 12.0 / f64::from(runs);
            assert!((mean / truth - 1.0).abs() < 0.06, "{runs} runs: {mean} {truth}");
        }
    }

    /// A step edge through the pixel: the estimate tends to the kernel's integral on the lit side.
    #[test]
    fn a_step_edge_gives_the_kernels_integral() {
        for text in ["box", "tent", "gaussian", "mitchell:1/3,1/3", "lanczos"] {
            let filter = Filter::new(text.parse().unwrap());
            let spec = filter.spec();
            let edge = 0.3;
            let cells = 100_000;
            let (mut lit, mut total) = (0.0, 0.0);
            for i in 0..cells {
                let x = spec.width * ((f64::from(i) + 0.5) / f64::from(cells) - 0.5);
                total += spec.value(x);
                lit += if x < edge { spec.value(x) } else { 0.0 };
            }
            let mut sum = PixelAccumulator::new(0);
            let n: u16 = 256;
            for i in 0..n {
                for j in 0..n {
                    let u = Vec2::new(f32::from(i) + 0.5, f32::from(j) + 0.5) / f32::from(n);
                    let (offset, weight) = filter.sample(u);
                    sum.add(if offset.x < edge { Vec3::ONE } else { Vec3::ZERO }, weight);
                }
            }
            let got = f64::from(sum.estimate().radiance.x);
            // One of 256 columns of samples may fall on the wrong side of the edge, or of a sign change.
            assert!((got - lit / total).abs() < 3.0 * 2.0 / 256.0, "{text}: {got} {}", lit / total);
        }
    }
}
