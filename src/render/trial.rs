//! A few blocks of a frame, rendered twice: what they take, and how far two independent pictures of them differ.

use super::forecast::spread_blocks;
use super::integrate::{pixels_of, render_tile};
use super::shot::{FrameCost, Shot};
use crate::Result;
use crate::design::{Design, DesignOptions};
use crate::film::PixelEstimate;
use rayon::prelude::*;
use std::time::Instant;

/// What a frame takes and how accurate it is, from a part of it.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Trial {
    /// Seconds to evaluate the animation and build acceleration structures and light choice.
    pub build_s: f64,
    /// Seconds to sample the whole frame, at as many runs as the settings say.
    pub render_s: f64,
    /// relMSE of the part at [`Trial::runs`] runs, from the difference of two independent pictures.
    pub rel_mse: f64,
    /// Runs that were tried: those of the settings, or fewer that stand for them.
    pub runs: u32,
}

/// More runs than these are stood for by as many: seconds are proportional to runs.
pub(super) const MOST_RUNS: u32 = 64;
/// Far from the seed that the frame itself takes.
const APART: u64 = 1 << 41;
/// What the square of dark pixels is raised by in relMSE (Rousselle, Knaus and Zwicker 2011).
const DARK: f64 = 0.01;

impl Shot<'_> {
    /// Tries `blocks` blocks of each exposure of frame `frame`, spread over the picture: the same ones for any scene.
    ///
    /// # Errors
    /// As [`Shot::render`].
    pub fn trial(&mut self, frame: i64, blocks: usize) -> Result<Trial> {
        let window = self.window();
        let sampling = self.settings().sampling;
        let runs = sampling.runs.min(MOST_RUNS);
        let (mut cost, mut render_s, mut squares, mut values) = (FrameCost::default(), 0.0, 0.0, 0_u64);
        for pass in &self.passes(frame)? {
            self.expose(pass, &mut cost, |exposed| {
                let designs = [1, 2].map(|half| {
                    let seed = sampling.seed.wrapping_add(half * APART);
                    Design::new(&DesignOptions { runs, seed, ..sampling }, exposed.design.factors())
                });
                let tried: Vec<_> = spread_blocks(window).into_iter().take(blocks.max(1)).collect();
                // Loads what later blocks find in the cache.
                render_tile(exposed.tracer, &designs[0], &exposed.job, tried[0]);
                let done: Vec<(f64, [Vec<PixelEstimate>; 2])> = tried
                    .par_iter()
                    .map(|&block| {
                        let started = Instant::now();
                        let pair = designs.each_ref().map(|d| render_tile(exposed.tracer, d, &exposed.job, block).0);
                        let _ = crate::trace::tally::take_rays();
                        (started.elapsed().as_secs_f64(), pair)
                    })
                    .collect();
                let pixels: usize = done.iter().map(|d| d.1[0].len()).sum();
                let seconds: f64 = done.iter().map(|d| d.0).sum();
                #[allow(clippy::cast_precision_loss, reason = "counts far below 2^52")]
                let (all, tried, threads) = (
                    pixels_of(window, exposed.job.lines) as f64 * f64::from(sampling.runs),
                    2.0 * pixels as f64 * f64::from(runs),
                    rayon::current_num_threads() as f64,
                );
                render_s += seconds / threads * all / tried.max(1.0);
                squares += done.iter().map(|d| relative_squares(&d.1)).sum::<f64>();
                values += 3 * pixels as u64;
            });
        }
        #[allow(clippy::cast_precision_loss, reason = "counts far below 2^52")]
        let rel_mse = squares / values.max(1) as f64;
        Ok(Trial { build_s: cost.build_s, render_s, rel_mse, runs })
    }
}

/// Sum over values of ½ (a − b)², which on average is one picture's squared error, relative to the mean of both.
fn relative_squares([a, b]: &[Vec<PixelEstimate>; 2]) -> f64 {
    let value = |a: f32, b: f32| {
        let (a, b) = (f64::from(a), f64::from(b));
        0.5 * (a - b).powi(2) / (0.25 * (a + b).powi(2) + DARK)
    };
    let pixel = |(a, b): (&PixelEstimate, &PixelEstimate)| -> f64 {
        let (a, b) = (a.radiance.to_array(), b.radiance.to_array());
        (0..3).map(|c| value(a[c], b[c])).sum()
    };
    a.iter().zip(b).map(pixel).sum()
}
