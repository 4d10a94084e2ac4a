//! What pixels that stop one by one will take, where a few places hold most of the work: cells of 4 × 4 pixels drawn with
//! probabilities proportional to what a first look says of them (Hansen and Hurwitz 1943, "On the Theory of Sampling from
//! Finite Populations").
//!
//! Where x is what was said of a cell and y what it took, the mean of y/x times the sum of all x estimates the sum of all y
//! without a bias, whatever was said. The better that was, the less it varies.

use super::Settler;
use crate::film::Window;
use crate::film::blocks::pixels;
use crate::render::{Forecast, Progress};
use crate::trace::ImageFunction;
use rayon::prelude::*;
use std::time::Instant;

/// Side of a cell. Its pixels decide without those around it.
const SIDE: u32 = 4;
/// The part of the time that first looks may take: chosen so that a small picture is looked at whole, not measured.
const LOOKING: f64 = 0.25;
/// Blocks that are looked at together, and the fewest.
const CHUNK: usize = 32;
/// Fewest cells that are sampled, whatever the time: chosen so that their spread means something, not measured.
const LEAST_CELLS: usize = 24;
/// The golden ratio's fraction.
const GOLDEN: f64 = 0.618_033_988_749_895;

/// A cell and the samples it is said to take.
struct Cell {
    window: Window,
    said: f64,
}

/// Forecast of all `blocks`, in an order whose every beginning is spread over the picture, from about `budget_s` seconds;
/// `None` if these are enough for all.
#[allow(clippy::cast_precision_loss, reason = "counts far below 2^52")]
pub(super) fn forecast<F: ImageFunction>(
    blocks: &[Window],
    settler: &Settler<'_, F>,
    budget_s: f64,
) -> Option<Forecast> {
    let started = Instant::now();
    let is_over = |part: f64| started.elapsed().as_secs_f64() >= part * budget_s;
    let mut looked: Vec<Vec<Cell>> = Vec::new();
    for chunk in blocks.chunks(CHUNK) {
        looked.par_extend(chunk.par_iter().map(|&block| look(block, settler)));
        if is_over(LOOKING) {
            break;
        }
    }
    let count = |block: &Window| pixels(*block, settler.lines).count() as f64;
    let scale = blocks.iter().map(count).sum::<f64>() / blocks[..looked.len()].iter().map(count).sum::<f64>().max(1.0);
    let of_block: Vec<f64> = looked.iter().map(|cells| cells.iter().map(|cell| cell.said).sum()).collect();
    let unseen = 1.0 - looked.len() as f64 / blocks.len() as f64;
    let missed = if unseen > 0.0 { relative_error(&of_block) * unseen.sqrt() } else { 0.0 };
    let cells: Vec<Cell> = looked.into_iter().flatten().collect();
    if cells.is_empty() {
        return None;
    }
    let mut all = 0.0;
    let up_to = |cell: &Cell| {
        all += cell.said;
        all
    };
    let ends: Vec<f64> = cells.iter().map(up_to).collect();
    let mut drawn: Vec<Drawn> = Vec::new();
    while drawn.len() < LEAST_CELLS || !is_over(1.0) {
        if drawn.len() >= LEAST_CELLS && extrapolated(&drawn, all * scale, missed).render_s <= budget_s {
            return None;
        }
        let batch = drawn.len()..drawn.len() + 4 * rayon::current_num_threads();
        drawn.par_extend(batch.into_par_iter().map(|i| {
            let place = (i as f64 * GOLDEN + 0.5).fract() * all;
            settle(&cells[ends.partition_point(|&end| end <= place).min(cells.len() - 1)], settler)
        }));
    }
    Some(extrapolated(&drawn, all * scale, missed))
}

/// What a cell that was drawn took.
#[derive(Debug, Clone, Copy)]
struct Drawn {
    samples: u64,
    samples_over_said: f64,
    seconds_over_said: f64,
}

/// What the cells of a block are said to take, each by one of its pixels and half by all the others'.
#[allow(clippy::cast_precision_loss, reason = "counts of pixels")]
fn look<F: ImageFunction>(block: Window, settler: &Settler<'_, F>) -> Vec<Cell> {
    let corners = (block.y..block.y + block.height)
        .step_by(SIDE as usize)
        .flat_map(|y| (block.x..block.x + block.width).step_by(SIDE as usize).map(move |x| (x, y)));
    let cells = corners.map(|(x, y)| Window {
        x,
        y,
        width: SIDE.min(block.x + block.width - x),
        height: SIDE.min(block.y + block.height - y),
    });
    let exposed = cells.map(|cell| (cell, pixels(cell, settler.lines).count())).filter(|&(_, count)| count > 0);
    let said: Vec<(Window, f64, f64)> =
        exposed.map(|(cell, count)| (cell, count as f64, settler.outlook(cell))).collect();
    let mean = said.iter().map(|cell| cell.2).sum::<f64>() / said.len().max(1) as f64;
    said.into_iter().map(|(window, count, own)| Cell { window, said: count * 0.5 * (own + mean) }).collect()
}

/// Samples a cell as if it were a block.
#[allow(clippy::cast_precision_loss, reason = "counts far below 2^52")]
fn settle<F: ImageFunction>(cell: &Cell, settler: &Settler<'_, F>) -> Drawn {
    let Some(block) = settler.settle(cell.window, &Progress::default()) else { unreachable!("nobody cancels it") };
    Drawn {
        samples: block.samples(),
        samples_over_said: block.samples() as f64 / cell.said,
        seconds_over_said: block.seconds() / cell.said,
    }
}

/// What all cells take, of which `all` is said; `missed` is the relative error of that.
#[allow(clippy::cast_precision_loss, reason = "counts far below 2^52")]
fn extrapolated(drawn: &[Drawn], all: f64, missed: f64) -> Forecast {
    let mean = |of: fn(&Drawn) -> f64| drawn.iter().map(of).sum::<f64>() / drawn.len() as f64;
    let render_s = all * mean(|cell| cell.seconds_over_said) / rayon::current_num_threads() as f64;
    let seconds: Vec<f64> = drawn.iter().map(|cell| cell.seconds_over_said).collect();
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a count of samples")]
    let samples = (all * mean(|cell| cell.samples_over_said)).round() as u64;
    Forecast {
        build_s: 0.0,
        render_s,
        standard_error_s: render_s * relative_error(&seconds).hypot(missed),
        samples_tried: drawn.iter().map(|cell| cell.samples).sum(),
        samples,
    }
}

/// Standard error of the mean of `values` over that mean.
#[allow(clippy::cast_precision_loss, reason = "counts far below 2^52")]
fn relative_error(values: &[f64]) -> f64 {
    let n = values.len() as f64;
    let mean = values.iter().sum::<f64>() / n;
    let squares = values.iter().map(|value| (value - mean).powi(2)).sum::<f64>();
    if values.len() > 1 { (squares / (n * (n - 1.0))).sqrt() / mean } else { f64::INFINITY }
}
