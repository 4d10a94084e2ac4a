//! Samples of an image function, gathered into a film: tiles in parallel, every pixel alone.

use super::Progress;
use crate::design::{Design, Factor, PixelAddress};
use crate::film::{Film, Filter, Footprint, Lines, PixelAccumulator, PixelEstimate, Window};
use crate::trace::ImageFunction;
use glam::Vec2;
use rayon::prelude::*;

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

/// Tiles are squares of this many pixels: small enough to balance two to many threads, large enough that neighbours
/// share the part of the scene that they see.
const TILE: u32 = 16;

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
    let tiles = tiles(window);
    let done: Option<Vec<Vec<PixelEstimate>>> = tiles
        .par_iter()
        .map(|tile| {
            if progress.is_cancelled() {
                return None;
            }
            let (pixels, runs) = render_tile(function, design, pass, *tile);
            progress.advance(pixels.len() as u64, runs);
            Some(pixels)
        })
        .collect();
    let Some(done) = done else { return false };
    let stored = film.pixels_mut();
    for (tile, pixels) in tiles.iter().zip(done) {
        for ((x, y), pixel) in addresses(*tile, pass.lines).zip(pixels) {
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
    tiles(window).iter().map(|&t| addresses(t, lines).count() as u64).sum()
}

fn tiles(window: Window) -> Vec<Window> {
    let starts = |from: u32, length: u32| (from..from + length).step_by(TILE as usize);
    starts(window.y, window.height)
        .flat_map(|y| starts(window.x, window.width).map(move |x| (x, y)))
        .map(|(x, y)| Window {
            x,
            y,
            width: TILE.min(window.x + window.width - x),
            height: TILE.min(window.y + window.height - y),
        })
        .collect()
}

/// Pixels of a tile whose lines are exposed, row by row.
fn addresses(tile: Window, lines: Lines) -> impl Iterator<Item = (u32, u32)> {
    (tile.y..tile.y + tile.height)
        .filter(move |&y| lines.holds(y))
        .flat_map(move |y| (tile.x..tile.x + tile.width).map(move |x| (x, y)))
}

#[allow(clippy::cast_possible_wrap, reason = "sides are at most 65 536")]
pub(super) fn render_tile(
    function: &impl ImageFunction,
    design: &Design,
    pass: &Pass<'_>,
    tile: Window,
) -> (Vec<PixelEstimate>, u64) {
    let mut accumulator = PixelAccumulator::new(0);
    let shutter = design.factors().contains(&Factor::SHUTTER);
    let mut runs = 0;
    let pixels = addresses(tile, pass.lines)
        .map(|(x, y)| {
            let (x, y) = (x as i32, y as i32);
            let pixel = design.pixel(PixelAddress { x, y, frame: pass.number, field: 0 });
            accumulator.reset(0);
            for run in 0..design.runs() {
                let point = pixel.point(run);
                let u_film = Vec2::new(point.get(Factor::FILM_X), point.get(Factor::FILM_Y));
                // Where nothing moves the shutter is no factor: any instant shows the same, and none is drawn.
                let u_shutter = if shutter { point.get(Factor::SHUTTER) } else { 0.5 };
                let (film_point, filter_weight) = pass.footprint.sample(pass.filter, x, y, u_film, u_shutter);
                accumulator.add(function.radiance(film_point, &point), filter_weight);
            }
            runs += u64::from(design.runs());
            accumulator.estimate()
        })
        .collect();
    (pixels, runs)
}
