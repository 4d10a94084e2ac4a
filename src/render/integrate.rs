//! Samples of an image function, gathered into a film: tiles in parallel, every pixel alone.

use super::Progress;
use crate::design::{Design, Factor, PixelAddress};
use crate::factor::compiled;
use crate::film::blocks::{Blocks, pixels};
use crate::film::{Film, Filter, Footprint, Lines, PixelAccumulator, PixelEstimate, Window};
use crate::trace::ImageFunction;
use glam::Vec2;
use rayon::prelude::*;
use std::ops::Range;

/// One exposure over the lines that it covers.
#[derive(Debug, Clone, Copy)]
pub struct Pass<'a> {
    /// What a pixel integrates over.
    pub footprint: Footprint,
    /// How its position is weighted.
    pub filter: &'a Filter,
    /// Which lines of the frame are exposed.
    pub lines: Lines,
    /// The exposure's number, which its draws depend on.
    pub number: i64,
}

/// Fills the pass's lines of `film` with estimates of `function`; `false` if `progress` was cancelled before the end
/// (the film is then incomplete).
pub fn integrate(
    function: &impl ImageFunction,
    design: &Design,
    pass: &Pass<'_>,
    film: &mut Film,
    progress: &Progress,
) -> bool {
    let window = film.window();
    let tiles: Vec<Window> = Blocks::new(window).windows().collect();
    let done: Option<Vec<Vec<PixelEstimate>>> = tiles
        .par_iter()
        .map(|tile| {
            if progress.is_cancelled() {
                return None;
            }
            let (estimates, runs) = render_tile(function, design, pass, *tile);
            progress.advance(estimates.len() as u64, runs);
            Some(estimates)
        })
        .collect();
    let Some(done) = done else { return false };
    let stored = film.pixels_mut();
    for (tile, estimates) in tiles.iter().zip(done) {
        for ((x, y), pixel) in pixels(*tile, pass.lines).zip(estimates) {
            if let Some(index) = window.index(x, y) {
                stored[index] = pixel;
            }
        }
    }
    true
}

/// Pixels that a pass over `lines` renders in `window`.
#[must_use]
pub fn pixels_of(window: Window, lines: Lines) -> u64 {
    Blocks::new(window).windows().map(|block| pixels(block, lines).count() as u64).sum()
}

/// Estimates of a tile's exposed pixels, row by row, from all runs, and how many runs that were.
pub(super) fn render_tile(
    function: &impl ImageFunction,
    design: &Design,
    pass: &Pass<'_>,
    tile: Window,
) -> (Vec<PixelEstimate>, u64) {
    let mut estimates = Vec::with_capacity(tile.area());
    let runs = sum_tile(function, design, pass, tile, 0..design.runs(), |sums| estimates.push(sums.estimate()));
    (estimates, runs)
}

/// Gives `each` the sums over `runs` of a tile's exposed pixels, row by row; how many runs that were.
#[allow(clippy::cast_possible_wrap, reason = "sides are at most 65 536")]
pub(super) fn sum_tile(
    function: &impl ImageFunction,
    design: &Design,
    pass: &Pass<'_>,
    tile: Window,
    runs: Range<u32>,
    mut each: impl FnMut(&PixelAccumulator),
) -> u64 {
    let mut accumulator = PixelAccumulator::new(runs.start);
    let shutter = compiled::TIME && design.factors().contains(&Factor::SHUTTER);
    let mut taken = 0;
    for (x, y) in pixels(tile, pass.lines) {
        let (x, y) = (x as i32, y as i32);
        let pixel = design.pixel(PixelAddress { x, y, frame: pass.number, field: 0 });
        accumulator.reset(runs.start);
        for run in runs.clone() {
            let point = pixel.point(run);
            let u_film = Vec2::new(point.get(Factor::FILM_X), point.get(Factor::FILM_Y));
            // Where nothing moves the shutter is no factor: any instant shows the same, and none is drawn.
            let u_shutter = if shutter { point.get(Factor::SHUTTER) } else { 0.5 };
            let (film_point, filter_weight) = pass.footprint.sample(pass.filter, x, y, u_film, u_shutter);
            accumulator.add(function.radiance(film_point, &point), filter_weight);
        }
        taken += u64::from(runs.end - runs.start);
        each(&accumulator);
    }
    taken
}
