//! Materials: glTF's core model; extensions are in `material_extensions`.

use super::context::{Context, label};
use super::material_extensions;
use super::schema::{MaterialDef, TextureInfo};
use super::textures::{Conversion, Wanted};
use crate::Result;
use crate::scene::{AlphaMode, Material, MaterialId, TextureRef};
use glam::{Vec3, Vec4};
use std::cell::RefCell;
use std::collections::HashMap;

/// [0, 1].
pub(super) const UNIT: (f32, f32) = (0.0, 1.0);
/// [0, ∞).
pub(super) const POSITIVE: (f32, f32) = (0.0, f32::MAX);

/// The materials that meshes asked for so far.
#[derive(Default)]
pub(super) struct Materials {
    pub(super) textures: Wanted,
    list: RefCell<Vec<Material>>,
    known: RefCell<HashMap<Option<usize>, MaterialId>>,
}

impl Materials {
    /// Our index for the file's material `index`; `None` is glTF's default material.
    pub(super) fn get(&self, ctx: &Context<'_>, index: Option<usize>, object: &str) -> Result<MaterialId> {
        if let Some(&id) = self.known.borrow().get(&index) {
            return Ok(id);
        }
        let material = match index {
            None => Material::default(),
            Some(i) => {
                let def = ctx.get(&ctx.doc.materials, i, "material", object)?;
                convert(ctx, &self.textures, def, &label("material", i, &def.name))?
            }
        };
        let mut list = self.list.borrow_mut();
        list.push(material);
        self.known.borrow_mut().insert(index, list.len() - 1);
        Ok(list.len() - 1)
    }

    /// Looks at material `id`.
    pub(super) fn with<T>(&self, id: MaterialId, f: impl FnOnce(&Material) -> T) -> T {
        f(&self.list.borrow()[id])
    }

    /// All materials, and what they want of textures.
    pub(super) fn into_parts(self) -> (Vec<Material>, Wanted) {
        (self.list.into_inner(), self.textures)
    }
}

/// A texture as it is, if there is one.
pub(super) fn texture(
    ctx: &Context<'_>,
    textures: &Wanted,
    info: Option<&TextureInfo>,
    object: &str,
) -> Result<Option<TextureRef>> {
    match info {
        Some(info) => textures.reference(ctx, info, Conversion::Plain, object),
        None => Ok(None),
    }
}

fn convert(ctx: &Context<'_>, textures: &Wanted, def: &MaterialDef, object: &str) -> Result<Material> {
    let pbr = &def.pbr_metallic_roughness;
    let [r, g, b, a] = pbr.base_color_factor.unwrap_or([1.0; 4]);
    let (wide, unit) = (
        |v: f64, what: &str| ctx.clamped(v, POSITIVE, what, object),
        |v: f64, what: &str| ctx.clamped(v, UNIT, what, object),
    );
    let base_color = Vec4::new(
        wide(r, "baseColorFactor")?,
        wide(g, "baseColorFactor")?,
        wide(b, "baseColorFactor")?,
        unit(a, "baseColorFactor")?,
    );
    let [er, eg, eb] = def.emissive_factor.unwrap_or_default();
    let emissive = Vec3::new(wide(er, "emissiveFactor")?, wide(eg, "emissiveFactor")?, wide(eb, "emissiveFactor")?);
    let normal = texture(ctx, textures, def.normal_texture.as_ref(), object)?;
    let occlusion = texture(ctx, textures, def.occlusion_texture.as_ref(), object)?;
    let scale = def.normal_texture.as_ref().and_then(|t| t.scale).unwrap_or(1.0);
    let strength = def.occlusion_texture.as_ref().and_then(|t| t.strength).unwrap_or(1.0);
    let scale = ctx.finite(scale, "the normal texture's scale", object)?;
    let strength = unit(strength, "the occlusion strength")?;
    let mut material = Material {
        name: def.name.clone(),
        base_color,
        base_color_texture: texture(ctx, textures, pbr.base_color_texture.as_ref(), object)?,
        metallic: unit(pbr.metallic_factor.unwrap_or(1.0), "metallicFactor")?,
        roughness: unit(pbr.roughness_factor.unwrap_or(1.0), "roughnessFactor")?,
        metallic_roughness_texture: texture(ctx, textures, pbr.metallic_roughness_texture.as_ref(), object)?,
        normal_texture: normal.map(|t| (t, scale)),
        occlusion_texture: occlusion.map(|t| (t, strength)),
        emissive,
        emissive_texture: texture(ctx, textures, def.emissive_texture.as_ref(), object)?,
        alpha_mode: alpha(ctx, def, object)?,
        double_sided: def.double_sided,
        ..Material::default()
    };
    material_extensions::apply(ctx, textures, &def.extensions, &mut material, object)?;
    Ok(material)
}

fn alpha(ctx: &Context<'_>, def: &MaterialDef, object: &str) -> Result<AlphaMode> {
    let cutoff = ctx.clamped(def.alpha_cutoff.unwrap_or(0.5), POSITIVE, "alphaCutoff", object)?;
    Ok(match def.alpha_mode.as_deref() {
        None | Some("OPAQUE") => AlphaMode::Opaque,
        Some("MASK") => AlphaMode::Mask { cutoff },
        Some("BLEND") => AlphaMode::Blend,
        Some(other) => {
            ctx.warn(object, format!("has the unknown alpha mode \"{}\"; it is opaque", other.escape_debug()));
            AlphaMode::Opaque
        }
    })
}
