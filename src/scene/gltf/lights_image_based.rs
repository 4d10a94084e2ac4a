//! `EXT_lights_image_based`: the sharpest cube map of the scene's light, as an environment.
//!
//! The blurred levels and the irradiance coefficients serve rasterisers; a ray tracer integrates the picture itself.

use super::buffers::Buffers;
use super::context::{Context, label};
use super::textures;
use crate::Result;
use crate::scene::Environment;
use crate::scene::decode;
use crate::scene::environment::{Face, Packing, from_cube};
use glam::Vec4;
use serde::Deserialize;

const NAME: &str = "EXT_lights_image_based";

#[derive(Debug, Default, Deserialize)]
#[serde(default)]
struct Lights {
    lights: Vec<LightDef>,
}

#[derive(Debug, Default, Deserialize)]
#[serde(rename_all = "camelCase", default)]
struct LightDef {
    name: String,
    rotation: Option<[f64; 4]>,
    intensity: Option<f64>,
    specular_images: Vec<Vec<usize>>,
}

#[derive(Debug, Default, Deserialize)]
#[serde(default)]
struct Reference {
    light: usize,
}

/// The environment of the chosen scene, if it has one that can be read.
pub(super) fn load(ctx: &Context<'_>, buffers: &Buffers) -> Result<Option<Environment>> {
    let scene = ctx.options.scene.or(ctx.doc.scene).unwrap_or(0);
    let Some(scene) = ctx.doc.scenes.get(scene) else { return Ok(None) };
    let Some(Reference { light }) = ctx.extension(&scene.extensions, NAME, "scene")? else { return Ok(None) };
    let all: Lights = ctx.extension(&ctx.doc.extensions, NAME, "file")?.unwrap_or_default();
    let def = ctx.get(&all.lights, light, "image-based light", "scene")?;
    let object = label("image-based light", light, &def.name);
    let Some(&[px, nx, py, ny, pz, nz]) = def.specular_images.first().map(Vec::as_slice) else {
        return Err(ctx.error(object, "has no six images for the faces of its cube"));
    };
    let mut faces = Vec::new();
    for image in [px, nx, py, ny, pz, nz] {
        ctx.get(&ctx.doc.images, image, "image", &object)?;
        let Some(source) = textures::fetch(ctx, buffers, image)? else { return Ok(None) };
        let bytes = source.bytes();
        // Four-channel PNGs hold colours to be divided by alpha (the extension, "HDR Images").
        let alpha = bytes.starts_with(b"\x89PNG") && bytes.get(25) == Some(&6);
        let packing = if alpha { Packing::DividedByAlpha } else { Packing::Plain };
        let decoded = decode::picture(bytes, ctx.allowance_left());
        match decoded.map(|d| Face::unpack(d, packing)) {
            Ok(Some(face)) => faces.push(face),
            Ok(None) => return Err(ctx.error(label("image", image, ""), "is not square, as a cube's face must be")),
            Err(problem) => {
                ctx.warn(label("image", image, ""), format!("cannot be decoded ({problem}); its light is left out"));
                return Ok(None);
            }
        }
    }
    let side = u64::from(u32::try_from(faces[0].side()).unwrap_or(u32::MAX));
    ctx.charge(side * side * 8 * 12, &object)?;
    let turn = ctx.finite_array(def.rotation.unwrap_or([0.0, 0.0, 0.0, 1.0]), "the rotation", &object)?;
    let rotation = super::nodes::rotation(ctx, Vec4::from(turn), &object);
    let strength = ctx.clamped(def.intensity.unwrap_or(1.0), (0.0, f32::MAX), "the intensity", &object)?;
    let Ok(faces) = <[Face; 6]>::try_from(faces) else { return Ok(None) };
    Ok(Some(Environment { image: from_cube(def.name.clone(), &faces, rotation), rotation: 0.0, strength }))
}
