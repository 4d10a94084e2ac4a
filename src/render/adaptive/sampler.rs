//! Runs of a pixel's sequence, in quarters.

use super::super::integrate::Pass;
use super::{Adaptive, Goal};
use crate::design::{Design, DesignOptions, Factor, PixelAddress, PixelDesign};
use crate::film::{PixelAccumulator, REPLICATES, Replicates};
use crate::numeric::mix64;
use crate::trace::ImageFunction;
use glam::Vec2;
use std::ops::Range;

/// Quarters, as a number of runs is counted.
#[allow(clippy::cast_possible_truncation, reason = "four")]
pub(super) const QUARTERS: u32 = REPLICATES as u32;

/// Draws runs of a sequence's quarters.
pub(super) struct Sampler<'a, F: ImageFunction> {
    function: &'a F,
    /// A sequence for every pixel, and another for [twins](super::block::Block::new) where pixels are held to intervals.
    designs: Vec<Design>,
    pass: &'a Pass<'a>,
    shutter: bool,
    /// The most runs of a quarter: a power of two.
    most: u32,
}

impl<'a, F: ImageFunction> Sampler<'a, F> {
    pub(super) fn new(
        function: &'a F,
        options: &DesignOptions,
        factors: &[Factor],
        adaptive: &Adaptive,
        pass: &'a Pass<'a>,
    ) -> Self {
        let drawn = adaptive.drawn(options);
        // Seeds far from each other, and from that of a picture with a fixed number of runs.
        let design = |sequence: u64| {
            let seed = mix64(mix64(options.seed) ^ sequence);
            Design::new(&DesignOptions { seed, ..drawn }, factors)
        };
        let sequences = if let Goal::Error(_) = adaptive.goal { 2 } else { 1 };
        let designs = (0..sequences).map(design).collect();
        Self { function, designs, pass, shutter: factors.contains(&Factor::SHUTTER), most: drawn.runs / QUARTERS }
    }

    /// The most runs of a quarter.
    pub(super) fn most(&self) -> u32 {
        self.most
    }

    /// Grows the quarters of a pixel's `sequence` from `from` to `to` runs each, `to` being twice `from`, or any power of two
    /// where `from` is 0. `scratch` is any accumulator.
    #[allow(clippy::cast_possible_wrap, reason = "sides are at most 65 536")]
    pub(super) fn add(
        &self,
        sequence: usize,
        (x, y): (u32, u32),
        (from, to): (u32, u32),
        sums: &mut Replicates,
        scratch: &mut PixelAccumulator,
    ) {
        if from > 0 {
            sums.halve();
        }
        let (x, y) = (x as i32, y as i32);
        let pixel = self.designs[sequence].pixel(PixelAddress { x, y, frame: self.pass.number, field: 0 });
        for (index, quarter) in (0..).zip(0..QUARTERS) {
            // The first half of a design that has grown to twice its runs is there.
            if from == 0 || quarter >= QUARTERS / 2 {
                self.sample(&pixel, (x, y), quarter * to..(quarter + 1) * to, scratch);
                sums.absorb(index, scratch);
            }
        }
    }

    /// `runs` of the design in pixel (x, y), gathered in `scratch`.
    fn sample(&self, pixel: &PixelDesign<'_>, (x, y): (i32, i32), runs: Range<u32>, scratch: &mut PixelAccumulator) {
        scratch.reset(runs.start);
        for run in runs {
            let point = pixel.point(run);
            let u_film = Vec2::new(point.get(Factor::FILM_X), point.get(Factor::FILM_Y));
            let u_shutter = if self.shutter { point.get(Factor::SHUTTER) } else { 0.5 };
            let (film_point, weight) = self.pass.footprint.sample(self.pass.filter, x, y, u_film, u_shutter);
            scratch.add(self.function.radiance(film_point, &point), weight);
        }
    }
}
