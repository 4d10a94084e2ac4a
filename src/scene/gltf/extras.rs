//! What authors may say beside glTF's own words: lens, shutter, blur amount, sizes of lights.
//!
//! Known keys must be numbers in range; unknown keys are left alone.

use super::context::Context;
use crate::Result;
use crate::scene::Lens;
use serde_json::Value;

/// What a number must be.
#[derive(Debug, Clone, Copy)]
enum Range {
    Positive,
    NotNegative,
    UpTo(f64),
}

/// The number at `key`, if there is one.
fn number(ctx: &Context<'_>, extras: &Value, key: &str, range: Range, object: &str) -> Result<Option<f32>> {
    let Some(value) = extras.get(key) else { return Ok(None) };
    let (fits, wanted) = match (value.as_f64(), range) {
        // What is 0 as `f32` is 0.
        (Some(v), Range::Positive) => (v >= f64::from(f32::MIN_POSITIVE), "a number above 0".to_owned()),
        (Some(v), Range::NotNegative) => (v >= 0.0, "a number of at least 0".to_owned()),
        (Some(v), Range::UpTo(most)) => ((0.0..=most).contains(&v), format!("a number from 0 to {most}")),
        (None, _) => (false, "a number".to_owned()),
    };
    match value.as_f64() {
        Some(v) if fits => ctx.finite(v, &format!("extras.{key}"), object).map(Some),
        _ => Err(ctx.error(object, format!("extras.{key} is {value}, expected {wanted}"))),
    }
}

/// Lens and shutter of a camera.
pub(super) fn lens(ctx: &Context<'_>, extras: &Value, object: &str) -> Result<Lens> {
    Ok(Lens {
        f_stop: number(ctx, extras, "f_stop", Range::Positive, object)?,
        aperture_radius: number(ctx, extras, "aperture_radius", Range::NotNegative, object)?,
        focus_distance: number(ctx, extras, "focus_distance", Range::Positive, object)?,
        shutter_angle: number(ctx, extras, "shutter_angle", Range::NotNegative, object)?,
    })
}

/// `over` where it says something, `base` elsewhere.
pub(super) fn merge(base: Lens, over: Lens) -> Lens {
    Lens {
        f_stop: over.f_stop.or(base.f_stop),
        aperture_radius: over.aperture_radius.or(base.aperture_radius),
        focus_distance: over.focus_distance.or(base.focus_distance),
        shutter_angle: over.shutter_angle.or(base.shutter_angle),
    }
}

/// A node's motion-blur amount (`motion:blurScale`, USD's name and meaning).
pub(super) fn blur_scale(ctx: &Context<'_>, extras: &Value, object: &str) -> Result<Option<f32>> {
    number(ctx, extras, "motion:blurScale", Range::NotNegative, object)
}

/// Radius of a punctual light, metres.
pub(super) fn light_radius(ctx: &Context<'_>, extras: &Value, object: &str) -> Result<Option<f32>> {
    number(ctx, extras, "radius", Range::NotNegative, object)
}

/// Angular radius of a directional light, radians, from its full angle in degrees.
pub(super) fn light_angle(ctx: &Context<'_>, extras: &Value, object: &str) -> Result<Option<f32>> {
    Ok(number(ctx, extras, "angle", Range::UpTo(180.0), object)?.map(|degrees| degrees.to_radians() * 0.5))
}
