//! What each effect of a frame will cost, before the frame is rendered: the same few blocks of the picture with the effect
//! and without it, their seconds and their errors.

use super::cost::without::{Effect, Without};
use crate::Result;
use crate::render::{Forecast, Settings, Shot, Surroundings};
use crate::scene::Scene;
use serde::Serialize;

/// What the frame would take without some effects.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Saving {
    /// Effects left out.
    pub without: Vec<Effect>,
    /// Seconds that the frame takes without them, at the same runs.
    pub frame_s: f64,
    /// Seconds that are saved: what the effects cost at the same runs.
    pub saves_s: f64,
    /// Seconds that the frame takes without them to the relMSE that it has with them, where errors fall as 1 / samples;
    /// none where there is no error to compare.
    pub frame_s_at_same_error: Option<f64>,
    /// Seconds that are saved then.
    pub saves_s_at_same_error: Option<f64>,
}

/// Blocks at least and at most.
const BLOCKS: (f64, f64) = (12.0, 96.0);

/// Each effect that the frame samples left out alone, then all of them together. `forecast` is what the frame is expected
/// to take; trying takes about `budget_s` seconds, and building the scene twice for each.
///
/// The whole frame is tried between every two: a machine's speed wanders, and seconds are compared with those just
/// before and after.
///
/// # Errors
/// If the settings do not fit the scene.
pub fn savings(
    scene: &Scene,
    settings: &Settings,
    surroundings: &Surroundings<'_>,
    frame: i64,
    forecast: &Forecast,
    budget_s: f64,
) -> Result<Vec<Saving>> {
    let there = Effect::of_frame(scene, settings, surroundings, frame)?;
    if there.is_empty() {
        return Ok(Vec::new());
    }
    let mut variants: Vec<Vec<Effect>> = there.iter().map(|&e| vec![e]).collect();
    if there.len() > 1 {
        variants.push(there);
    }
    #[allow(clippy::cast_precision_loss, reason = "a few variants; samples far below 2^52")]
    let (tries, block_s) = (
        (2 * variants.len() + 1) as f64,
        forecast.render_s / forecast.samples.max(1) as f64 * f64::from(64 * settings.sampling.runs.min(64)),
    );
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "from 12 to 96")]
    let blocks = (budget_s / tries / (2.0 * block_s).max(1e-9)).clamp(BLOCKS.0, BLOCKS.1) as usize;
    let mut shot = Shot::new(scene, settings, surroundings, "")?;
    let mut before = shot.trial(frame, blocks)?;
    let one = |left_out: Vec<Effect>| {
        let rest = Without::new(scene, settings, surroundings, &left_out);
        let trial = Shot::new(&rest.scene, &rest.settings, &rest.surroundings, "")?.trial(frame, blocks)?;
        let after = shot.trial(frame, blocks)?;
        let whole_s = 0.5 * (before.render_s + after.render_s);
        before = after;
        let error = (after.rel_mse > 0.0).then(|| trial.rel_mse / after.rel_mse);
        Ok(saving(left_out, forecast, trial.render_s / whole_s.max(1e-12), error))
    };
    variants.into_iter().map(one).collect()
}

/// What leaving out `without` saves where it takes `share` of the whole's seconds and leaves `error` of its relMSE: blocks
/// are few, but the same, and ratios are better known than what they are of.
fn saving(without: Vec<Effect>, forecast: &Forecast, share: f64, error: Option<f64>) -> Saving {
    let frame_s = |factor: f64| forecast.build_s + forecast.render_s * share * factor;
    let at_same_error = error.map(frame_s);
    Saving {
        without,
        frame_s: frame_s(1.0),
        saves_s: forecast.seconds() - frame_s(1.0),
        frame_s_at_same_error: at_same_error,
        saves_s_at_same_error: at_same_error.map(|s| forecast.seconds() - s),
    }
}
