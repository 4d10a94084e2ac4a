//! Sampling that stops when a picture is accurate enough, or when its time is up (Mitchell 1990, §5.1; Lee, Redner and
//! Uselton 1985).
//!
//! A pixel has one sequence ([`Kind::Growing`]), which grows to twice its runs, and twice again; its quarters, each a design
//! of its own, stand for replicates. Their spread says where runs help, and no convergence is lost to replicates that know
//! nothing of each other. But quarters stratify each other, so that their spread overstates the error of the whole (§5.1).
//!
//! Where a pixel is held to its own interval, the overstatement is measured: one pixel of every four has two independent
//! sequences, and the square of their difference, over a block's twins, says what the spread of quarters stands for
//! there. So intervals rest on independent replicates, whose convergence is kept. A pixel gets the runs that its
//! standard error asks for, or as many as it and its neighbours need on average: one that looks flat beside ones that
//! vary goes on, and thin moving objects that the first runs missed are found.
//!
//! Where the picture as a whole is given its time, its runs or its error, the overstatement stays: fit for deciding, and
//! for a bound. A pixel's runs follow its neighbours' spreads, not its own, so that what it happened to meet biases its
//! mean little.
//!
//! Decisions are made within the blocks of the picture's 16 × 16 grid and see nothing outside, so that a picture is the
//! same bit for bit however it is divided along that grid, and a crop is what the whole picture shows there.

mod block;
pub(super) mod outlook;
mod proportional;
mod sampler;
#[cfg(test)]
mod tests;
mod visibility;

pub use visibility::Visibility;

use super::Progress;
use super::integrate::Pass;
use crate::design::{DesignOptions, Dither, Factor, Kind, Mask};
use crate::film::{Film, Lines, REPLICATES, Window};
use crate::output::View;
use crate::trace::ImageFunction;
use crate::{Error, Result};
pub(super) use block::grid;
use block::{Block, Rule};
use rayon::prelude::*;
use sampler::{QUARTERS, Sampler};
use serde::{Deserialize, Serialize};
use std::time::Instant;

/// When to stop.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Goal {
    /// A pixel stops when the half-width of its 95 % interval, as a part of what a screen shows between black and white,
    /// is at most this.
    Error(f64),
    /// The picture stops when this many seconds are used up, or nearly.
    Within(f64),
    /// The picture stops when its relative error, [`relative_error`], is estimated to be at most this.
    Until(f64),
    /// The picture stops after so many passes: those that another goal of the picture came to.
    Passes(u32),
    /// The picture stops before it has more than so many runs a pixel on average.
    Mean(u32),
}

/// Adaptive sampling.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Adaptive {
    /// When to stop.
    pub goal: Goal,
    /// The most runs a pixel: rounded down to a power of two.
    pub most_runs: u32,
    /// How the picture will be shown, which decides what of an error is seen.
    pub view: View,
}

/// Fewest runs a pixel, unless time is up: never fewer on the strength of no variance.
pub const LEAST_RUNS: u32 = 16;

impl Adaptive {
    /// The design of a pixel's whole sequence, which it may draw a part of: `options`, but for what they leave open.
    #[must_use]
    pub fn drawn(&self, options: &DesignOptions) -> DesignOptions {
        let kind = if options.kind == Kind::Auto { Kind::Growing } else { options.kind };
        let most = 1 << (self.most_runs / QUARTERS).max(1).ilog2();
        DesignOptions { kind, dither: Dither::NONE, runs: QUARTERS * most, ..*options }
    }

    /// What one of `exposures` exposures is asked for, of whose time `build_s` seconds are gone.
    #[allow(clippy::cast_precision_loss, reason = "one or two exposures")]
    pub(super) fn of_exposure(&self, exposures: usize, build_s: f64) -> Self {
        match self.goal {
            Goal::Within(seconds) => {
                Self { goal: Goal::Within((seconds / exposures as f64 - build_s).max(0.0)), ..*self }
            }
            _ => *self,
        }
    }

    /// Whether each block of the picture reaches the goal by itself, so that blocks may be sampled apart.
    #[must_use]
    pub fn is_by_block(&self) -> bool {
        matches!(self.goal, Goal::Error(_) | Goal::Passes(_))
    }

    /// Checks that parts of a frame can be sampled so.
    ///
    /// # Errors
    /// If the goal is one of the whole picture.
    pub fn check_parts(&self) -> Result<()> {
        if self.is_by_block() {
            return Ok(());
        }
        Err(Error::invalid(
            format!("{} with a part of a frame", self.flag().0),
            "only the whole picture tells when to stop; expected --runs, --error, or --passes with the number that a \
             whole frame came to",
        ))
    }

    /// The goal's flag and its value.
    fn flag(&self) -> (&'static str, f64) {
        match self.goal {
            Goal::Error(e) => ("--error", e),
            Goal::Within(s) => ("--within", s),
            Goal::Until(e) => ("--until", e),
            Goal::Passes(p) => ("--passes", f64::from(p)),
            Goal::Mean(runs) => ("--mean-runs", f64::from(runs)),
        }
    }

    /// Checks it together with the design that was asked for.
    ///
    /// # Errors
    /// If a number is out of range, or the design cannot grow run by run.
    pub fn check(&self, kind: Kind, dither: Dither) -> Result<()> {
        let (flag, value) = self.flag();
        if !(value.is_finite() && value > 0.0) {
            return Err(Error::invalid(format!("{flag} {value}"), "expected a number above 0"));
        }
        if !(LEAST_RUNS..=MOST_RUNS).contains(&self.most_runs) {
            return Err(Error::invalid(
                format!("--most-runs {}", self.most_runs),
                format!("expected {LEAST_RUNS} to {MOST_RUNS}"),
            ));
        }
        if !matches!(kind, Kind::Auto | Kind::Growing | Kind::Nested | Kind::Sobol | Kind::Random) {
            return Err(Error::invalid(
                format!("--design {kind} with {flag}"),
                "it cannot grow run by run; expected auto, growing, nested, sobol or random",
            ));
        }
        if !matches!(dither.mask, Mask::Auto | Mask::None) {
            return Err(Error::invalid(
                format!("--dither {dither} with {flag}"),
                "pixels that stop one by one have no structure between them; expected auto or none",
            ));
        }
        Ok(())
    }
}

/// The most that [`Adaptive::most_runs`] may be.
pub const MOST_RUNS: u32 = 1 << 20;

/// Root of the mean over pixels and channels of the estimated squared error over (value² + 0.01): the root of the relMSE
/// that `graeco compare` measures against a perfect picture.
#[must_use]
#[allow(clippy::cast_precision_loss, reason = "a count of pixels")]
pub fn relative_error(film: &Film) -> f64 {
    let sum: f64 = film.pixels().iter().map(visibility::relative_square).sum();
    (sum / film.pixels().len() as f64).sqrt()
}

/// The pass's lines of `film` sampled as `adaptive` asks, of [`Goal::Within`] until `deadline`. Gives the passes that were
/// made over the picture, none where every pixel stops for itself; `None` if `progress` was cancelled.
pub(super) fn integrate(
    function: &impl ImageFunction,
    (options, factors): (&DesignOptions, &[Factor]),
    adaptive: &Adaptive,
    pass: &Pass<'_>,
    film: &mut Film,
    deadline: Option<Instant>,
    progress: &Progress,
) -> Option<u32> {
    let (width, height) = film.size();
    let grid = grid(film.window(), Window::whole(width, height));
    let settler = Settler::new(function, (options, factors), adaptive, pass);
    if adaptive.is_by_block() {
        let settled = |&window: &Window| {
            let block = settler.settle(window, progress)?;
            progress.advance(block.pixels_in(film.window()), block.samples());
            Some(block)
        };
        let done: Option<Vec<Block>> = grid.par_iter().map(settled).collect();
        done?.iter().for_each(|block| block.store(film));
        return Some(settler.passes());
    }
    let blocks = grid.iter().map(|&window| Block::new(window, pass.lines)).collect();
    let mut passes = Passes { blocks, sampler: &settler.sampler, goal: adaptive.goal, deadline, progress };
    let made = passes.run(film.window())?;
    progress.advance(passes.blocks.iter().map(|b| b.pixels_in(film.window())).sum(), 0);
    passes.blocks.iter().for_each(|block| block.store(film));
    Some(made)
}

/// What the `number`-th pass (from 0) asks for: 4, 8, 16 runs everywhere, then runs where they lower the picture's relative
/// error most. A run more lowers a squared error V by V/n; passes ask V/n below a bound that falls by 2^¼ each time, so
/// that a pass adds about a tenth of the samples so far.
fn pass_rule(number: u32) -> Rule {
    match number {
        0..=2 => Rule::Runs(4 << number),
        _ => Rule::Relative(libm::exp2(-4.0 - 0.25 * f64::from(number - 2))),
    }
}

/// The pass that nothing can stop before: those before it ask for fewer runs, and need not be made one by one.
fn first_pass(goal: Goal) -> u32 {
    match goal {
        Goal::Within(_) => 0,
        Goal::Until(_) | Goal::Error(_) => 2,
        Goal::Mean(runs) => (runs / 4).clamp(1, 4).ilog2(),
        Goal::Passes(passes) => passes.clamp(1, 3) - 1,
    }
}

/// Samples blocks one by one, for goals that each block [reaches by itself](Adaptive::is_by_block).
pub(super) struct Settler<'a, F: ImageFunction> {
    sampler: Sampler<'a, F>,
    goal: Goal,
    /// What is asked of a block, one after another.
    rules: Vec<Rule>,
    lines: Lines,
}

impl<'a, F: ImageFunction> Settler<'a, F> {
    /// For the pass's lines.
    pub(super) fn new(
        function: &'a F,
        (options, factors): (&DesignOptions, &[Factor]),
        adaptive: &Adaptive,
        pass: &'a Pass<'a>,
    ) -> Self {
        let sampler = Sampler::new(function, options, factors, adaptive, pass);
        let rules = match adaptive.goal {
            Goal::Error(tolerance) => vec![Rule::visible(tolerance, Visibility::new(adaptive.view))],
            Goal::Passes(passes) => (first_pass(adaptive.goal)..passes).map(pass_rule).collect(),
            Goal::Within(_) | Goal::Until(_) | Goal::Mean(_) => Vec::new(),
        };
        Self { sampler, goal: adaptive.goal, rules, lines: pass.lines }
    }

    /// The block of the picture at `window` as the whole picture shows it; `None` if `progress` was cancelled.
    pub(super) fn settle(&self, window: Window, progress: &Progress) -> Option<Block> {
        let mut block = Block::new(window, self.lines);
        if let Goal::Error(_) = self.goal {
            block = block.with_twins();
        }
        for rule in &self.rules {
            block.settle(&self.sampler, rule, progress)?;
        }
        Some(block)
    }

    /// Samples that each pixel of the block at `window` will take, by a first look at one of them.
    fn outlook(&self, window: Window) -> f64 {
        Block::new(window, self.lines).outlook(&self.sampler, self.rules.last())
    }

    /// Passes that the goal asks for; none where every pixel stops for itself.
    fn passes(&self) -> u32 {
        if let Goal::Passes(passes) = self.goal { passes } else { 0 }
    }
}

/// Passes over the whole picture, each asking for a little more than the one before.
struct Passes<'a, F: ImageFunction> {
    blocks: Vec<Block>,
    sampler: &'a Sampler<'a, F>,
    goal: Goal,
    deadline: Option<Instant>,
    progress: &'a Progress,
}

impl<F: ImageFunction> Passes<'_, F> {
    /// Later passes ask for a relative error of 2⁻⁴⁸ a run: nothing can.
    const LAST: u32 = 256;

    /// Passes until the goal is reached for what `shown` shows of the blocks: how many, or `None` if cancelled.
    fn run(&mut self, shown: Window) -> Option<u32> {
        let (started, mut samples) = (Instant::now(), 0_u64);
        let first = first_pass(self.goal);
        let mut passes = first;
        while passes < Self::LAST {
            let rule = pass_rule(passes);
            if passes > first && self.exceeds(&rule, samples, started) {
                break;
            }
            let done: Option<Vec<u64>> =
                self.blocks.par_iter_mut().map(|b| b.settle_and_count(self.sampler, &rule, self.progress)).collect();
            let taken: u64 = done?.iter().sum();
            samples += taken;
            passes += 1;
            let is_enough =
                matches!(self.goal, Goal::Until(error) if passes > 2 && self.relative_error(shown) <= error);
            if is_enough || passes > 2 && self.blocks.iter().all(|b| b.is_exhausted(self.sampler)) {
                break;
            }
        }
        Some(passes)
    }

    /// Whether `rule` asks for more than is left of the time or the runs, `samples` having been taken since `started`.
    #[allow(clippy::cast_precision_loss, reason = "counts of samples")]
    fn exceeds(&self, rule: &Rule, samples: u64, started: Instant) -> bool {
        let next = || -> u64 { self.blocks.par_iter().map(|b| b.samples_wanted(self.sampler, rule)).sum() };
        match (self.deadline, self.goal) {
            (Some(deadline), _) => {
                let expected_s = started.elapsed().as_secs_f64() * next() as f64 / samples.max(1) as f64;
                deadline.saturating_duration_since(Instant::now()).as_secs_f64() <= expected_s
            }
            (None, Goal::Mean(runs)) => {
                let pixels: u64 = self.blocks.iter().map(Block::pixels).sum();
                samples + next() > u64::from(runs) * pixels
            }
            _ => false,
        }
    }

    /// As [`relative_error`], of the blocks.
    #[allow(clippy::cast_precision_loss, reason = "a count of pixels")]
    fn relative_error(&self, window: Window) -> f64 {
        let sums = self.blocks.iter().map(|block| block.relative_squares(window));
        let (sum, count) = sums.fold((0.0, 0), |(s, n), (t, m)| (s + t, n + m));
        (sum / count.max(1) as f64).sqrt()
    }
}

const _: () = assert!(LEAST_RUNS as usize == 4 * REPLICATES);
