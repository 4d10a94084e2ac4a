//! Runs of a pixel's replicates.

use super::super::integrate::Pass;
use crate::design::{Design, DesignOptions, Dither, Factor, Kind, PixelAddress};
use crate::film::{PixelAccumulator, REPLICATES, Replicates};
use crate::numeric::mix64;
use crate::trace::ImageFunction;
use glam::Vec2;

/// Draws runs of replicates.
pub(super) struct Sampler<'a, F: ImageFunction> {
    function: &'a F,
    designs: [Design; REPLICATES],
    pass: &'a Pass<'a>,
    shutter: bool,
    /// The most runs of a replicate: a power of two.
    most: u32,
}

impl<'a, F: ImageFunction> Sampler<'a, F> {
    pub(super) fn new(
        function: &'a F,
        options: &DesignOptions,
        factors: &[Factor],
        most_runs: u32,
        pass: &'a Pass<'a>,
    ) -> Self {
        #[allow(clippy::cast_possible_truncation, reason = "four")]
        let most = 1 << (most_runs / REPLICATES as u32).max(1).ilog2();
        let kind = if options.kind == Kind::Auto { Kind::Nested } else { options.kind };
        let designs = std::array::from_fn(|replicate| {
            // Seeds far from each other, and from that of a picture with a fixed number of runs.
            let seed = mix64(mix64(options.seed) ^ (replicate as u64 + 1));
            Design::new(&DesignOptions { kind, dither: Dither::NONE, runs: most, seed, ..*options }, factors)
        });
        Self { function, designs, pass, shutter: factors.contains(&Factor::SHUTTER), most }
    }

    /// The most runs of a replicate.
    pub(super) fn most(&self) -> u32 {
        self.most
    }

    /// Adds to `sums` the runs `from` to `to` of each of the pixel's replicates. `scratch` is any accumulator.
    #[allow(clippy::cast_possible_wrap, reason = "sides are at most 65 536")]
    pub(super) fn add(
        &self,
        (x, y): (u32, u32),
        (from, to): (u32, u32),
        sums: &mut Replicates,
        scratch: &mut PixelAccumulator,
    ) {
        let (x, y) = (x as i32, y as i32);
        for (index, design) in self.designs.iter().enumerate() {
            let pixel = design.pixel(PixelAddress { x, y, frame: self.pass.number, field: 0 });
            scratch.reset(from);
            for run in from..to {
                let point = pixel.point(run);
                let u_film = Vec2::new(point.get(Factor::FILM_X), point.get(Factor::FILM_Y));
                let u_shutter = if self.shutter { point.get(Factor::SHUTTER) } else { 0.5 };
                let (film_point, weight) = self.pass.footprint.sample(self.pass.filter, x, y, u_film, u_shutter);
                scratch.add(self.function.radiance(film_point, &point), weight);
            }
            sums.absorb(index, scratch);
        }
    }
}
