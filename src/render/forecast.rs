//! What a frame will take, from a small part of it rendered for the purpose.
//!
//! Blocks of 8 × 8 pixels, spread evenly over the picture, are rendered as the frame would be, until a budget is spent.
//! Their seconds, scaled by samples, are the estimate; the spread between blocks gives its standard error.

use super::integrate::{Pass, render_tile};
use crate::design::Design;
use crate::film::Window;
use crate::trace::ImageFunction;
use rayon::prelude::*;
use serde::Serialize;
use std::time::Instant;

/// What a frame is expected to take on this machine as it is loaded now.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize)]
pub struct Forecast {
    /// Seconds to evaluate the animation and build acceleration structures and light choice: measured.
    pub build_s: f64,
    /// Seconds to sample: estimated.
    pub render_s: f64,
    /// Standard error of `render_s` from the spread between blocks of pixels; infinite with one block.
    pub standard_error_s: f64,
    /// Samples that were taken for the estimate.
    pub samples_tried: u64,
    /// Samples that the frame takes.
    pub samples: u64,
}

impl Forecast {
    /// Seconds in all.
    #[must_use]
    pub fn seconds(&self) -> f64 {
        self.build_s + self.render_s
    }

    /// The mean of two forecasts of one frame, each for what it tried. Both tried the same blocks first, so the spread
    /// between blocks is no smaller for it.
    #[must_use]
    #[allow(clippy::cast_precision_loss, reason = "counts far below 2^52")]
    pub fn mean(self, other: Self) -> Self {
        let tried = (self.samples_tried + other.samples_tried).max(1) as f64;
        let (a, b) = (self.samples_tried as f64 / tried, other.samples_tried as f64 / tried);
        Self {
            build_s: 0.5 * (self.build_s + other.build_s),
            render_s: a * self.render_s + b * other.render_s,
            standard_error_s: a * self.standard_error_s + b * other.standard_error_s,
            samples_tried: self.samples_tried.max(other.samples_tried),
            samples: self.samples,
        }
    }

    /// One exposure after another.
    #[must_use]
    pub(super) fn then(self, next: Self) -> Self {
        Self {
            build_s: self.build_s + next.build_s,
            render_s: self.render_s + next.render_s,
            standard_error_s: self.standard_error_s.hypot(next.standard_error_s),
            samples_tried: self.samples_tried + next.samples_tried,
            samples: self.samples + next.samples,
        }
    }
}

/// Side of a block: small, so that many places are seen; not so small that nothing is in the cache.
const BLOCK: u32 = 8;
/// Blocks at least, whatever the budget.
pub(super) const LEAST_BLOCKS: usize = 8;

/// Renders blocks for at least `budget_s` seconds (nothing at 0); `trial` is the frame's design, or one of fewer runs that stands for
/// the frame's `runs`.
#[allow(clippy::cast_precision_loss, reason = "counts far below 2^52")]
pub(super) fn forecast(
    function: &impl ImageFunction,
    trial: &Design,
    runs: u32,
    pass: &Pass<'_>,
    window: Window,
    budget_s: f64,
) -> Forecast {
    if budget_s <= 0.0 {
        return Forecast::default();
    }
    let blocks = spread_blocks(window);
    let batch = rayon::current_num_threads() * 4;
    let started = Instant::now();
    // The blocks' own seconds over threads: a batch's end, at which threads wait, is no part of a frame.
    let threads = rayon::current_num_threads() as f64;
    let (mut seconds, mut costs) = (0.0, Vec::new());
    // The first blocks load what later ones find in the cache: they are rendered twice and timed once.
    for &block in blocks.iter().take(2) {
        render_tile(function, trial, pass, block);
    }
    let _ = crate::trace::tally::take_rays();
    let (mut pixels, mut samples) = (0_u64, 0_u64);
    for chunk in blocks.chunks(batch) {
        let done: Vec<(f64, u64, u64)> = chunk
            .par_iter()
            .map(|&block| {
                let own = Instant::now();
                let (estimates, runs) = render_tile(function, trial, pass, block);
                // A forecast's rays are no part of the next frame's.
                let _ = crate::trace::tally::take_rays();
                (own.elapsed().as_secs_f64(), estimates.len() as u64, runs)
            })
            .collect();
        for (own, count, runs) in done.into_iter().filter(|d| d.1 > 0) {
            seconds += own / threads;
            costs.push(own / runs as f64);
            pixels += count;
            samples += runs;
        }
        if started.elapsed().as_secs_f64() >= budget_s && costs.len() >= LEAST_BLOCKS {
            break;
        }
    }
    scaled(seconds, &costs, samples, super::integrate::pixels_of(window, pass.lines) * u64::from(runs), pixels)
}

#[allow(clippy::cast_precision_loss, reason = "counts far below 2^52")]
fn scaled(seconds: f64, costs: &[f64], tried: u64, samples: u64, pixels: u64) -> Forecast {
    if pixels == 0 {
        return Forecast { samples, ..Forecast::default() };
    }
    let render_s = seconds * samples as f64 / tried as f64;
    let n = costs.len() as f64;
    let mean = costs.iter().sum::<f64>() / n;
    let variance = costs.iter().map(|c| (c - mean).powi(2)).sum::<f64>() / (n - 1.0);
    let relative = if costs.len() > 1 { (variance / n).sqrt() / mean } else { f64::INFINITY };
    Forecast { build_s: 0.0, render_s, standard_error_s: relative * render_s, samples_tried: tried, samples }
}

/// The blocks of a window in an order whose every beginning is spread over it.
pub(super) fn spread_blocks(window: Window) -> Vec<Window> {
    let side = |length: u32| length.div_ceil(BLOCK);
    let block = |(column, row): (u32, u32)| {
        let (left, top) = (column * BLOCK, row * BLOCK);
        Window {
            x: window.x + left,
            y: window.y + top,
            width: BLOCK.min(window.width - left),
            height: BLOCK.min(window.height - top),
        }
    };
    spread_cells(side(window.width), side(window.height)).into_iter().map(block).collect()
}

/// Column and row of all cells of a grid in an order whose every beginning is spread over it: along a Z-order curve by
/// steps of the golden section (an additive recurrence, so gaps stay even).
pub(super) fn spread_cells(columns: u32, rows: u32) -> Vec<(u32, u32)> {
    let mut cells: Vec<(u64, u32, u32)> =
        (0..rows).flat_map(|y| (0..columns).map(move |x| (interleave(x) | interleave(y) << 1, x, y))).collect();
    cells.sort_unstable();
    let n = cells.len();
    #[allow(
        clippy::cast_precision_loss,
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "a part of a count of blocks"
    )]
    let mut step = ((n as f64 * 0.618_033_988_749_895) as usize).max(1);
    while gcd(step, n) != 1 {
        step += 1;
    }
    (0..n).map(|i| cells[i * step % n]).map(|(_, column, row)| (column, row)).collect()
}

fn gcd(a: usize, b: usize) -> usize {
    if b == 0 { a } else { gcd(b, a % b) }
}

/// A bit of zero between every two of `v`.
fn interleave(v: u32) -> u64 {
    (0..32).fold(0, |all, bit| all | (u64::from(v) >> bit & 1) << (2 * bit))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// 100 samples at a rate of 2 s a frame and 300 at 4 s: 3.5 s, as 400 samples of which each took its own time.
    #[test]
    fn the_mean_of_two_looks_counts_each_by_what_it_tried() {
        let look = |render_s: f64, samples_tried: u64| Forecast {
            build_s: render_s,
            render_s,
            standard_error_s: 0.5,
            samples_tried,
            samples: 1000,
        };
        let mean = look(2.0, 100).mean(look(4.0, 300));
        let expected = Forecast { build_s: 3.0, ..look(3.5, 300) };
        assert_eq!(mean, expected);
    }

    #[test]
    fn the_blocks_cover_the_window_once() {
        let window = Window { x: 3, y: 5, width: 121, height: 66 };
        let mut covered = vec![0_u8; window.area()];
        for block in spread_blocks(window) {
            for y in block.y..block.y + block.height {
                for x in block.x..block.x + block.width {
                    covered[window.index(x, y).unwrap()] += 1;
                }
            }
        }
        assert!(covered.iter().all(|&c| c == 1));
    }

    /// Of the first 16 of 32 × 32 blocks each sixteenth of the picture, a quarter high and wide, holds one or two.
    #[test]
    fn the_first_blocks_are_spread_over_the_window() {
        let mut held = [0_u8; 16];
        for block in spread_blocks(Window::whole(256, 256)).iter().take(24) {
            held[(block.y / 64 * 4 + block.x / 64) as usize] += 1;
        }
        assert!(held.iter().all(|&h| (1..=3).contains(&h)), "{held:?}");
    }
}
