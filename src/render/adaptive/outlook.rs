//! What sampling that stops by itself will take: some of a picture's blocks, which decide for themselves, are sampled as
//! the whole will be; smaller cells where each block reaches the goal alone, and the time is not enough for all.

use super::block::{Block, grid};
use super::{Adaptive, Goal, Passes, Settler, proportional};
use crate::design::{DesignOptions, Factor};
use crate::film::Window;
use crate::film::blocks::pixels;
use crate::render::forecast::{LEAST_BLOCKS, spread_cells};
use crate::render::integrate::Pass;
use crate::render::{Forecast, Progress};
use crate::trace::ImageFunction;
use rayon::prelude::*;
use std::time::Instant;

/// Samples blocks for about `budget_s` seconds (nothing at 0) and scales what they took to all that `window` shows of a
/// picture of `size`. Of [`Goal::Within`] only the samples are found out: a frame takes the time that it is given.
pub(in crate::render) fn forecast<F: ImageFunction>(
    function: &F,
    (options, factors): (&DesignOptions, &[Factor]),
    adaptive: &Adaptive,
    pass: &Pass<'_>,
    (window, size): (Window, (u32, u32)),
    budget_s: f64,
) -> Forecast {
    if budget_s <= 0.0 {
        return Forecast::default();
    }
    // Pixels' first runs, for the speed.
    let goal = if let Goal::Within(_) = adaptive.goal { Goal::Passes(3) } else { adaptive.goal };
    let tried_for = Adaptive { goal, ..*adaptive };
    let settler = Settler::new(function, (options, factors), &tried_for, pass);
    let all = spread(window, size);
    let look = |count: usize| settle(&all[..count], &settler, &tried_for, window);
    if adaptive.is_by_block()
        && let Some(forecast) = proportional::forecast(&all, &settler, budget_s)
    {
        return forecast;
    }
    let started = Instant::now();
    let mut count = LEAST_BLOCKS.min(all.len());
    let mut tried = look(count);
    // The first look loads what a second finds in the cache, and tells how many blocks the budget holds.
    let spent_s = started.elapsed().as_secs_f64();
    #[allow(clippy::cast_precision_loss, clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "clamped")]
    let fitting = (count as f64 * (budget_s - spent_s) / spent_s).clamp(0.0, all.len() as f64) as usize;
    if fitting >= count {
        count = fitting;
        tried = look(count);
    }
    let pixels = all.iter().map(|&block| pixels(block, pass.lines).count() as u64).sum();
    let scaled = scaled(&tried, all.len(), pixels);
    match adaptive.goal {
        Goal::Within(seconds) => in_time(&scaled, seconds),
        _ => scaled,
    }
}

/// The blocks of the picture that `window` shows, in an order whose every beginning is spread over it.
fn spread(window: Window, (width, height): (u32, u32)) -> Vec<Window> {
    let blocks = grid(window, Window::whole(width, height));
    let columns = blocks.iter().take_while(|block| block.y == blocks[0].y).count().max(1);
    #[allow(clippy::cast_possible_truncation, reason = "a picture has at most 4096 blocks on a side")]
    let cells = spread_cells(columns as u32, (blocks.len() / columns) as u32);
    cells.into_iter().map(|(column, row)| blocks[row as usize * columns + column as usize]).collect()
}

/// Samples `blocks` until they, as far as `window` shows them, are what is asked for.
fn settle<F: ImageFunction>(
    blocks: &[Window],
    settler: &Settler<'_, F>,
    adaptive: &Adaptive,
    window: Window,
) -> Vec<Block> {
    let progress = Progress::default();
    if adaptive.is_by_block() {
        return blocks.par_iter().filter_map(|&block| settler.settle(block, &progress)).collect();
    }
    let blocks = blocks.iter().map(|&block| Block::new(block, settler.lines)).collect();
    let mut passes =
        Passes { blocks, sampler: &settler.sampler, goal: adaptive.goal, deadline: None, progress: &progress };
    passes.run(window);
    passes.blocks
}

/// What all blocks, `count` with `pixels` pixels together, take if they are like those tried: by pixels, since blocks at
/// a picture's border are smaller.
#[allow(clippy::cast_precision_loss, reason = "counts far below 2^52")]
fn scaled(tried: &[Block], count: usize, pixels: u64) -> Forecast {
    let threads = rayon::current_num_threads() as f64;
    let of_tried: u64 = tried.iter().map(Block::pixels).sum();
    let samples_tried: u64 = tried.iter().map(Block::samples).sum();
    if of_tried == 0 {
        return Forecast::default();
    }
    let scale = pixels as f64 / of_tried as f64;
    let rate = tried.iter().map(Block::seconds).sum::<f64>() / of_tried as f64;
    let off = |block: &Block| block.seconds() - rate * block.pixels() as f64;
    let n = tried.len() as f64;
    let variance = tried.iter().map(|block| off(block).powi(2)).sum::<f64>() / (n - 1.0);
    // Of blocks drawn without putting them back: all of them leave nothing unknown.
    let left = 1.0 - n / count as f64;
    let error_s = match tried.len() {
        all if all == count => 0.0,
        1 => f64::INFINITY,
        _ => scale * (n * variance * left).sqrt() / threads,
    };
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a count of samples")]
    let samples = (samples_tried as f64 * scale).round() as u64;
    Forecast {
        build_s: 0.0,
        render_s: rate * pixels as f64 / threads,
        standard_error_s: error_s,
        samples_tried,
        samples,
    }
}

/// What `seconds` are enough for, at the speed of `tried`.
#[allow(clippy::cast_precision_loss, reason = "counts far below 2^52")]
fn in_time(tried: &Forecast, seconds: f64) -> Forecast {
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a count of samples")]
    let samples = (tried.samples as f64 * seconds / tried.render_s.max(f64::MIN_POSITIVE)) as u64;
    Forecast { render_s: seconds, standard_error_s: 0.0, samples, ..*tried }
}
