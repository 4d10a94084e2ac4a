//! Cameras and punctual lights, as nodes ask for them.

use super::context::{Context, label};
use super::extras;
use super::schema::CameraDef;
use crate::Result;
use crate::scene::{Camera, Lens, Light, LightShape, Projection};
use glam::Vec3;
use serde::Deserialize;
use serde_json::Value;

/// Camera `index`, with the lens that its node's `extras` add.
pub(super) fn camera(ctx: &Context<'_>, index: usize, node: (&Value, &str)) -> Result<Camera> {
    let def = ctx.get(&ctx.doc.cameras, index, "camera", node.1)?;
    let object = label("camera", index, &def.name);
    let (projection, near_far) = projection(ctx, def, &object)?;
    let lens = extras::merge(extras::lens(ctx, &def.extras, &object)?, extras::lens(ctx, node.0, node.1)?);
    Ok(Camera { name: def.name.clone(), projection, near_far, lens })
}

/// Whether `extras` say anything of a lens, so that a camera shared by nodes must be told apart.
pub(super) fn has_lens(ctx: &Context<'_>, extras: &Value, object: &str) -> Result<bool> {
    Ok(extras::lens(ctx, extras, object)? != Lens::default())
}

type NearFar = (f32, Option<f32>);

fn projection(ctx: &Context<'_>, def: &CameraDef, object: &str) -> Result<(Projection, NearFar)> {
    let missing = |what: &str| ctx.error(object, format!("has no {what}"));
    let depth = |near: Option<f64>, far: Option<f64>| -> Result<NearFar> {
        let near = ctx.clamped(near.unwrap_or(0.0), (0.0, f32::MAX), "znear", object)?;
        match far {
            None => Ok((near, None)),
            Some(far) => {
                let far = ctx.finite(far, "zfar", object)?;
                if far <= near {
                    ctx.warn(object, format!("has zfar {far}, which is not beyond znear {near}; it is ignored"));
                    return Ok((near, None));
                }
                Ok((near, Some(far)))
            }
        }
    };
    match def.kind.as_str() {
        "perspective" => {
            let p = def.perspective.as_ref().ok_or_else(|| missing("perspective object"))?;
            let yfov = ctx.finite(p.yfov.ok_or_else(|| missing("yfov"))?, "yfov", object)?;
            if yfov <= 0.0 || yfov >= std::f32::consts::PI {
                return Err(ctx.error(object, format!("has a yfov of {yfov}, expected more than 0 and less than π")));
            }
            let aspect = match p.aspect_ratio {
                Some(a) if a > 0.0 => Some(ctx.finite(a, "aspectRatio", object)?),
                Some(a) => {
                    ctx.warn(object, format!("has an aspect ratio of {a}, which is ignored"));
                    None
                }
                None => None,
            };
            Ok((Projection::Perspective { yfov, aspect }, depth(p.znear, p.zfar)?))
        }
        "orthographic" => {
            let o = def.orthographic.as_ref().ok_or_else(|| missing("orthographic object"))?;
            let half = |value: Option<f64>, what: &str| -> Result<f32> {
                let v = ctx.finite(value.ok_or_else(|| missing(what))?, what, object)?;
                if v.abs() < f32::MIN_POSITIVE {
                    return Err(ctx.error(object, format!("has {what} 0, expected another number")));
                }
                Ok(v)
            };
            let projection = Projection::Orthographic { xmag: half(o.xmag, "xmag")?, ymag: half(o.ymag, "ymag")? };
            Ok((projection, depth(o.znear, o.zfar)?))
        }
        other => {
            let problem = format!("has the type \"{}\", expected perspective or orthographic", other.escape_debug());
            Err(ctx.error(object, problem))
        }
    }
}

#[derive(Debug, Default, Deserialize)]
#[serde(default)]
struct Lights {
    lights: Vec<LightDef>,
}

#[derive(Debug, Default, Clone, Deserialize)]
#[serde(default)]
struct LightDef {
    name: String,
    color: Option<[f64; 3]>,
    intensity: Option<f64>,
    range: Option<f64>,
    #[serde(rename = "type")]
    kind: String,
    spot: Option<SpotDef>,
    extras: Value,
}

#[derive(Debug, Default, Clone, Deserialize)]
#[serde(rename_all = "camelCase", default)]
struct SpotDef {
    inner_cone_angle: Option<f64>,
    outer_cone_angle: Option<f64>,
}

/// Light `index` of `KHR_lights_punctual`; `None`, with a warning, if its type is unknown. The node's `extras` may
/// give it a size too.
pub(super) fn light(ctx: &Context<'_>, index: usize, node: (&Value, &str)) -> Result<Option<Light>> {
    let all: Lights = ctx.extension(&ctx.doc.extensions, "KHR_lights_punctual", "file")?.unwrap_or_default();
    let def = ctx.get(&all.lights, index, "light", node.1)?;
    let object = label("light", index, &def.name);
    let [r, g, b] = def.color.unwrap_or([1.0; 3]);
    let strength = def.intensity.unwrap_or(1.0);
    let channel = |c: f64| ctx.clamped(c * strength, (0.0, f32::MAX), "color × intensity", &object);
    let intensity = Vec3::new(channel(r)?, channel(g)?, channel(b)?);
    let range = match def.range {
        Some(r) if r > 0.0 => Some(ctx.finite(r, "range", &object)?),
        Some(r) => {
            ctx.warn(&object, format!("has a range of {r}, which is ignored"));
            None
        }
        None => None,
    };
    let size = |read: fn(&Context<'_>, &Value, &str) -> Result<Option<f32>>| -> Result<f32> {
        Ok(read(ctx, node.0, node.1)?.or(read(ctx, &def.extras, &object)?).unwrap_or(0.0))
    };
    let shape = match def.kind.as_str() {
        "directional" => LightShape::Directional { angular_radius: size(extras::light_angle)? },
        "point" => LightShape::Point { radius: size(extras::light_radius)? },
        "spot" => {
            let (inner_cone, outer_cone) = cone(ctx, def.spot.as_ref(), &object)?;
            LightShape::Spot { radius: size(extras::light_radius)?, inner_cone, outer_cone }
        }
        other => {
            ctx.warn(&object, format!("has the unknown type \"{}\" and does not shine", other.escape_debug()));
            return Ok(None);
        }
    };
    Ok(Some(Light { name: def.name.clone(), shape, intensity, range }))
}

/// Inner and outer angle of a spot: 0 ≤ inner ≤ outer ≤ π / 2.
fn cone(ctx: &Context<'_>, spot: Option<&SpotDef>, object: &str) -> Result<(f32, f32)> {
    use std::f32::consts::{FRAC_PI_2, FRAC_PI_4};
    let angle = |value: Option<f64>, default: f32, most: f32, what: &str| -> Result<f32> {
        match value {
            None => Ok(default.min(most)),
            Some(v) => ctx.clamped(v, (0.0, most), what, object),
        }
    };
    let outer = angle(spot.and_then(|s| s.outer_cone_angle), FRAC_PI_4, FRAC_PI_2, "outerConeAngle")?;
    let inner = angle(spot.and_then(|s| s.inner_cone_angle), 0.0, outer, "innerConeAngle")?;
    Ok((inner, outer))
}
