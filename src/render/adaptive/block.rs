//! The pixels that decide together when to stop: those of one block of the picture's 16 × 16 grid.

use super::LEAST_RUNS;
use super::sampler::{QUARTERS, Sampler};
use super::visibility::{DARK, Visibility, relative_square};
use crate::film::blocks::Blocks;
use crate::film::{Film, Lines, PixelAccumulator, PixelEstimate, Replicates, STUDENT_T, Window};
use crate::render::Progress;
use crate::trace::ImageFunction;
use std::time::Instant;

/// The blocks of a picture that share a pixel with `window`: whole ones, which decide alike whatever the window is.
pub(in crate::render) fn grid(window: Window, picture: Window) -> Vec<Window> {
    Blocks::new(picture).windows().filter(|block| block.overlaps(window)).collect()
}

/// What is asked of pixels.
#[derive(Debug)]
pub(super) enum Rule {
    /// So many runs each.
    Runs(u32),
    /// What is seen of each pixel's error.
    Visible(Visible),
    /// A bound of the squared relative error over the runs.
    Relative(f64),
}

/// What is asked of a pixel whose own interval counts.
#[derive(Debug)]
pub(super) struct Visible {
    /// The interval's half-width, as it is seen.
    tolerance: f64,
    visibility: Visibility,
    /// Of the squared relative error over the runs.
    bound: f64,
}

/// Runs with which a middle grey reaches both bounds of [`Rule::visible`].
const FULL_RUNS: f64 = 1024.0;

/// Middle grey.
const GREY: f64 = 0.18;

impl Rule {
    /// Half-widths of at most `tolerance`; and for pixels of few runs less than that, in proportion to √runs.
    ///
    /// That serves two ends. The fewer the runs, the less is known of what they may have missed. And the sum over all
    /// pixels of σ²ᵢ/nᵢ is smallest, for a given number of runs in all, where nᵢ is proportional to σᵢ, thus where the
    /// squared error is proportional to nᵢ: were all pixels stopped at one error, easy ones would spoil what hard ones
    /// paid for.
    pub(super) fn visible(tolerance: f64, visibility: Visibility) -> Self {
        let relative = tolerance / STUDENT_T / (visibility.slope(GREY) * (GREY * GREY + DARK).sqrt());
        Self::Visible(Visible { tolerance, visibility, bound: relative * relative / FULL_RUNS })
    }

    /// Runs that every pixel has before anything is made of its spread.
    fn least(&self) -> u32 {
        if let Self::Runs(asked) = self { *asked } else { LEAST_RUNS }
    }
}

impl Visible {
    /// Runs that a pixel like this needs, as far as `runs` of them tell: its squared error falls as 1/runs.
    fn needed(&self, estimate: &PixelEstimate, runs: f64) -> f64 {
        if estimate.runs == 0 {
            // None yet, or none that is finite: more would not help.
            return 0.0;
        }
        let seen = STUDENT_T * STUDENT_T * self.visibility.square(estimate) / (self.tolerance * self.tolerance);
        (seen * runs).max((relative_square(estimate) * runs / self.bound).sqrt())
    }
}

/// Whether a pixel counts among its neighbours.
#[derive(Debug, Clone, Copy)]
enum Own {
    Counted,
    Apart,
}

#[derive(Debug, Clone, Copy, Default)]
struct Pixel {
    sums: Replicates,
    /// Those of another sequence, in pixels that have one.
    twin: Option<Replicates>,
    /// Both together; the variance as the quarters' spread tells it.
    estimate: PixelEstimate,
    /// Runs of each quarter so far.
    runs: u32,
}

impl Pixel {
    fn sequences(&self) -> u32 {
        1 + u32::from(self.twin.is_some())
    }

    fn all_runs(&self) -> u32 {
        self.runs * QUARTERS * self.sequences()
    }

    /// Runs that its quarters come to next: all that `rule` has before anything else, then twice as many each time.
    fn next_runs(&self, rule: &Rule) -> u32 {
        if self.runs == 0 { rule.least() / (QUARTERS * self.sequences()) } else { 2 * self.runs }
    }

    /// What its sequences show together.
    fn estimated(&self) -> PixelEstimate {
        let one = self.sums.estimate();
        let Some(two) = self.twin.map(|twin| twin.estimate()) else { return one };
        let rejected = one.rejected + two.rejected;
        match (one.runs, two.runs) {
            (_, 0) => PixelEstimate { rejected, ..one },
            (0, _) => PixelEstimate { rejected, ..two },
            _ => PixelEstimate {
                radiance: 0.5 * (one.radiance + two.radiance),
                variance: 0.25 * (one.variance + two.variance),
                runs: one.runs + two.runs,
                rejected,
            },
        }
    }

    /// Squared relative error of one sequence: by the difference of two, and by the spread of their quarters.
    fn both_ways(&self) -> Option<(f64, f64)> {
        let two = self.twin?.estimate();
        let one = self.sums.estimate();
        let difference = one.radiance - two.radiance;
        let together = |variance| relative_square(&PixelEstimate { variance, ..self.estimate });
        let ways = (together(0.5 * difference * difference), together(0.5 * (one.variance + two.variance)));
        (one.runs > 0 && two.runs > 0 && ways.0.is_finite() && ways.1.is_finite()).then_some(ways)
    }
}

/// A sequence's variance over what the spread of its quarters tells is asked of twins. So many more are taken to have shown
/// this, the middle of what animations show (0.5 to 0.9), lest a few lucky twins stop a block.
const USUAL: f64 = 0.7;
const USUAL_TWINS: f64 = 8.0;

/// One block, as far as it is.
#[derive(Debug)]
pub(in crate::render) struct Block {
    window: Window,
    rows: Vec<u32>,
    pixels: Vec<Pixel>,
    /// Variance over the spread of quarters.
    calibration: f64,
    /// Squared relative error of a single run, on average over each pixel's neighbours.
    around: Vec<f64>,
    /// Seconds that a thread has sampled it.
    seconds: f64,
}

impl Block {
    /// The lines of `window` that are exposed, without runs.
    pub(super) fn new(window: Window, lines: Lines) -> Self {
        let rows: Vec<u32> = (window.y..window.y + window.height).filter(|&y| lines.holds(y)).collect();
        let pixels = vec![Pixel::default(); rows.len() * window.width as usize];
        let around = vec![0.0; pixels.len()];
        Self { window, rows, pixels, calibration: 1.0, around, seconds: 0.0 }
    }

    /// The same, but one pixel of every four has two independent sequences of half as many runs.
    pub(super) fn with_twins(mut self) -> Self {
        let width = self.window.width as usize;
        for (index, pixel) in self.pixels.iter_mut().enumerate() {
            if (index % width).is_multiple_of(2) && (index / width).is_multiple_of(2) {
                pixel.twin = Some(Replicates::default());
            }
        }
        self
    }

    /// Takes in what new runs tell of all pixels, as far as `rule` or one after it asks.
    fn weigh(&mut self, rule: &Rule) {
        if let Rule::Visible(_) = rule {
            return self.calibrate();
        }
        let of_a_run = |p: &Pixel| relative_square(&self.estimate(p)) * f64::from(p.all_runs());
        let own: Vec<f64> = self.pixels.iter().map(|p| if p.estimate.runs == 0 { 0.0 } else { of_a_run(p) }).collect();
        self.around = (0..own.len()).map(|index| self.around(index, Own::Apart, |i| own[i])).collect();
    }

    /// Sets the calibration by what twins tell: the ratio of both ways' sums, every twin weighing about alike.
    fn calibrate(&mut self) {
        if !self.pixels.iter().any(|pixel| pixel.twin.is_some()) {
            return;
        }
        let twins: Vec<(f64, f64)> = self.pixels.iter().filter_map(Pixel::both_ways).collect();
        let usual = twins.iter().map(|twin| twin.1).sum::<f64>() / twins.len().max(1) as f64;
        let (mut differences, mut spreads) = (USUAL * USUAL_TWINS, USUAL_TWINS);
        for (difference, spread) in twins {
            let weight = 2.0 / (spread + usual).max(f64::MIN_POSITIVE);
            differences += difference * weight;
            spreads += spread * weight;
        }
        self.calibration = differences / spreads;
    }

    /// The pixel's estimate, its variance calibrated.
    fn estimate(&self, pixel: &Pixel) -> PixelEstimate {
        #[allow(clippy::cast_possible_truncation, reason = "a variance is f32")]
        let calibration = self.calibration as f32;
        PixelEstimate { variance: pixel.estimate.variance * calibration, ..pixel.estimate }
    }

    /// Samples until nothing is wanted any more; samples taken, or `None` if cancelled.
    pub(super) fn settle<F: ImageFunction>(
        &mut self,
        sampler: &Sampler<'_, F>,
        rule: &Rule,
        progress: &Progress,
    ) -> Option<u64> {
        let started = Instant::now();
        let mut scratch = PixelAccumulator::new(0);
        let mut samples = 0;
        loop {
            if progress.is_cancelled() {
                return None;
            }
            let wanted = self.wanted(sampler.most(), rule);
            if wanted.is_empty() {
                self.seconds += started.elapsed().as_secs_f64();
                return Some(samples);
            }
            for index in wanted {
                samples += self.grow(index, sampler, rule, &mut scratch);
            }
            self.weigh(rule);
        }
    }

    /// As [`Block::settle`], and tells `progress` of the samples.
    pub(super) fn settle_and_count<F: ImageFunction>(
        &mut self,
        sampler: &Sampler<'_, F>,
        rule: &Rule,
        progress: &Progress,
    ) -> Option<u64> {
        let samples = self.settle(sampler, rule, progress)?;
        progress.advance(0, samples);
        Some(samples)
    }

    /// Samples that `rule` asks for at once.
    pub(super) fn samples_wanted<F: ImageFunction>(&self, sampler: &Sampler<'_, F>, rule: &Rule) -> u64 {
        let wanted = self.wanted(sampler.most(), rule);
        let growth = |pixel: &Pixel| u64::from(QUARTERS * (pixel.next_runs(rule) - pixel.runs));
        wanted.iter().map(|&index| growth(&self.pixels[index])).sum()
    }

    /// Samples that each pixel will take until `rule` asks for no more, as its fewest runs tell of the one in the middle.
    pub(super) fn outlook<F: ImageFunction>(&mut self, sampler: &Sampler<'_, F>, rule: Option<&Rule>) -> f64 {
        let middle = self.pixels.len() / 2;
        self.grow(middle, sampler, &Rule::Runs(LEAST_RUNS), &mut PixelAccumulator::new(0));
        let (least, most) = (f64::from(LEAST_RUNS), f64::from(sampler.most() * QUARTERS));
        let runs = f64::from(self.pixels[middle].all_runs());
        let estimate = self.pixels[middle].estimate;
        let asked = match rule {
            Some(Rule::Visible(seen)) => seen.needed(&estimate, runs),
            Some(Rule::Relative(bound)) if estimate.runs > 0 => (relative_square(&estimate) * runs / bound).sqrt(),
            Some(Rule::Relative(_) | Rule::Runs(_)) | None => least,
        };
        asked.max(least).min(most)
    }

    /// Whether no pixel may have more runs.
    pub(super) fn is_exhausted<F: ImageFunction>(&self, sampler: &Sampler<'_, F>) -> bool {
        self.pixels.iter().all(|pixel| pixel.all_runs() >= QUARTERS * sampler.most())
    }

    /// More runs for a pixel; samples taken.
    fn grow<F: ImageFunction>(
        &mut self,
        index: usize,
        sampler: &Sampler<'_, F>,
        rule: &Rule,
        scratch: &mut PixelAccumulator,
    ) -> u64 {
        let width = self.window.width as usize;
        #[allow(clippy::cast_possible_truncation, reason = "below 16")]
        let place = (self.window.x + (index % width) as u32, self.rows[index / width]);
        let pixel = &mut self.pixels[index];
        let to = pixel.next_runs(rule);
        sampler.add(0, place, (pixel.runs, to), &mut pixel.sums, scratch);
        if let Some(twin) = &mut pixel.twin {
            sampler.add(1, place, (pixel.runs, to), twin, scratch);
        }
        let before = pixel.all_runs();
        pixel.runs = to;
        pixel.estimate = pixel.estimated();
        u64::from(pixel.all_runs() - before)
    }

    /// Pixels with fewer runs than they are to have.
    fn wanted(&self, most: u32, rule: &Rule) -> Vec<usize> {
        let least = f64::from(rule.least());
        let most_runs = f64::from(most * QUARTERS);
        let bounded = |runs: f64| runs.max(least).min(most_runs);
        let has_fewer = |index: &usize, asked: f64| f64::from(self.pixels[*index].all_runs()) < asked;
        let all = 0..self.pixels.len();
        match rule {
            Rule::Runs(_) => all.filter(|i| has_fewer(i, bounded(least))).collect(),
            // By its neighbours' variances alone: were its own counted, pixels that missed what is rare at first would be left
            // as they are.
            Rule::Relative(bound) => all.filter(|i| has_fewer(i, bounded((self.around[*i] / bound).sqrt()))).collect(),
            Rule::Visible(seen) => {
                let needed: Vec<f64> =
                    self.pixels.iter().map(|p| seen.needed(&self.estimate(p), f64::from(p.all_runs()))).collect();
                let asked = |i: usize| bounded(needed[i]).max(self.around(i, Own::Counted, |n| bounded(needed[n])));
                all.filter(|i| has_fewer(i, asked(*i))).collect()
            }
        }
    }

    /// Mean of `value` over a pixel's neighbours in the block, and the pixel itself if it is counted or has none.
    fn around(&self, index: usize, own: Own, value: impl Fn(usize) -> f64) -> f64 {
        let (width, height) = (self.window.width as usize, self.rows.len());
        let (column, row) = (index % width, index / width);
        let (mut sum, mut count) = (0.0, 0.0);
        for y in row.saturating_sub(1)..(row + 2).min(height) {
            for x in column.saturating_sub(1)..(column + 2).min(width) {
                let i = y * width + x;
                if i != index || matches!(own, Own::Counted) || self.pixels.len() == 1 {
                    sum += value(i);
                    count += 1.0;
                }
            }
        }
        sum / count
    }

    /// Seconds that a thread has sampled it.
    pub(super) fn seconds(&self) -> f64 {
        self.seconds
    }

    /// Runs of all its pixels.
    pub(in crate::render) fn samples(&self) -> u64 {
        self.pixels.iter().map(|pixel| u64::from(pixel.all_runs())).sum()
    }

    /// Pixels, whether the picture's window shows them or not.
    pub(super) fn pixels(&self) -> u64 {
        self.pixels.len() as u64
    }

    /// Pixels that `window` shows.
    pub(super) fn pixels_in(&self, window: Window) -> u64 {
        self.shown(window).count() as u64
    }

    fn places(&self) -> impl Iterator<Item = (u32, u32)> {
        let columns = self.window.x..self.window.x + self.window.width;
        self.rows.iter().flat_map(move |&y| columns.clone().map(move |x| (x, y)))
    }

    /// The pixels that `window` shows, row by row, and where they stand in it.
    fn shown(&self, window: Window) -> impl Iterator<Item = (usize, &Pixel)> {
        self.places().zip(&self.pixels).filter_map(move |((x, y), pixel)| Some((window.index(x, y)?, pixel)))
    }

    /// Estimates of the pixels that `window` shows, row by row.
    pub(in crate::render) fn estimates(&self, window: Window) -> Vec<PixelEstimate> {
        self.shown(window).map(|(_, pixel)| self.estimate(pixel)).collect()
    }

    /// Puts the estimates into `film` where it shows them.
    pub(super) fn store(&self, film: &mut Film) {
        let window = film.window();
        let stored = film.pixels_mut();
        for (index, pixel) in self.shown(window) {
            stored[index] = self.estimate(pixel);
        }
    }

    /// Sum of squared relative errors over the pixels that `window` shows, and how many these are.
    pub(super) fn relative_squares(&self, window: Window) -> (f64, usize) {
        let error = |pixel: &Pixel| relative_square(&self.estimate(pixel));
        self.shown(window).fold((0.0, 0), |(sum, n), (_, pixel)| (sum + error(pixel), n + 1))
    }
}
