//! Material extensions: `KHR_materials_*`.

use super::context::{Context, plain};
use super::materials::{POSITIVE, UNIT, texture};
use super::schema::{Object, TextureInfo};
use super::textures::{Conversion, Wanted};
use crate::Result;
use crate::scene::TextureRef;
use crate::scene::material::{
    Anisotropy, Clearcoat, DiffuseTransmission, Iridescence, Material, Sheen, Specular, Transmission, Volume,
};
use glam::{Vec3, Vec4};
use serde::de::DeserializeOwned;

/// One extension object with what is needed to read it.
struct Reader<'r, 'c> {
    ctx: &'r Context<'c>,
    textures: &'r Wanted,
    members: &'r Object,
    name: &'static str,
    object: &'r str,
}

impl Reader<'_, '_> {
    fn member<T: DeserializeOwned>(&self, key: &str) -> Result<Option<T>> {
        match self.members.get(key) {
            None => Ok(None),
            Some(value) => serde_json::from_value(value.clone())
                .map(Some)
                .map_err(|e| self.ctx.error(self.object, format!("{}.{key} is malformed: {}", self.name, plain(&e)))),
        }
    }

    /// A number in `range`, `default` where the file says nothing.
    fn number(&self, key: &str, default: f64, range: (f32, f32)) -> Result<f32> {
        let value = self.member(key)?.unwrap_or(default);
        self.ctx.clamped(value, range, &format!("{}.{key}", self.name), self.object)
    }

    /// A non-negative linear colour.
    fn color(&self, key: &str, default: [f64; 3]) -> Result<Vec3> {
        let value: [f64; 3] = self.member(key)?.unwrap_or(default);
        let what = format!("{}.{key}", self.name);
        let channel = |v| self.ctx.clamped(v, POSITIVE, &what, self.object);
        Ok(Vec3::new(channel(value[0])?, channel(value[1])?, channel(value[2])?))
    }

    fn info(&self, key: &str) -> Result<Option<TextureInfo>> {
        self.member(key)
    }

    fn texture(&self, key: &str) -> Result<Option<TextureRef>> {
        texture(self.ctx, self.textures, self.info(key)?.as_ref(), self.object)
    }
}

/// A material's extensions, to be opened by name.
struct Extensions<'r, 'c> {
    ctx: &'r Context<'c>,
    textures: &'r Wanted,
    members: &'r Object,
    object: &'r str,
}

impl<'r, 'c> Extensions<'r, 'c> {
    fn open(&self, name: &'static str) -> Result<Option<Reader<'r, 'c>>> {
        let Some(value) = self.members.get(name) else { return Ok(None) };
        let members =
            value.as_object().ok_or_else(|| self.ctx.error(self.object, format!("{name} is not a JSON object")))?;
        Ok(Some(Reader { ctx: self.ctx, textures: self.textures, members, name, object: self.object }))
    }
}

/// Reads every extension that `material` has.
pub(super) fn apply(
    ctx: &Context<'_>,
    textures: &Wanted,
    members: &Object,
    material: &mut Material,
    object: &str,
) -> Result<()> {
    let extensions = Extensions { ctx, textures, members, object };
    base(&extensions, material)?;
    layers(&extensions, material)
}

/// What changes the core model.
fn base(extensions: &Extensions<'_, '_>, material: &mut Material) -> Result<()> {
    let (ctx, object) = (extensions.ctx, extensions.object);
    // First, since it sets what the others may then change.
    if let Some(r) = extensions.open("KHR_materials_pbrSpecularGlossiness")? {
        specular_glossiness(&r, material)?;
    }
    material.unlit = extensions.open("KHR_materials_unlit")?.is_some();
    if let Some(r) = extensions.open("KHR_materials_emissive_strength")? {
        material.emissive *= r.number("emissiveStrength", 1.0, POSITIVE)?;
        if !material.emissive.is_finite() {
            return Err(ctx.error(object, "its emission is not finite"));
        }
    }
    if let Some(r) = extensions.open("KHR_materials_ior")? {
        let ior = r.number("ior", 1.5, POSITIVE)?;
        if ior > 0.0 && ior < 1.0 {
            ctx.warn(object, format!("has an index of refraction of {ior}; it is taken as 1"));
        }
        material.ior = if ior > 0.0 { ior.max(1.0) } else { 0.0 };
    }
    Ok(())
}

/// What adds layers to it.
fn layers(extensions: &Extensions<'_, '_>, material: &mut Material) -> Result<()> {
    let open = |name| extensions.open(name);
    if let Some(r) = open("KHR_materials_specular")? {
        material.specular = Some(Specular {
            factor: r.number("specularFactor", 1.0, UNIT)?,
            texture: r.texture("specularTexture")?,
            color: r.color("specularColorFactor", [1.0; 3])?,
            color_texture: r.texture("specularColorTexture")?,
        });
    }
    if let Some(r) = open("KHR_materials_clearcoat")? {
        material.clearcoat = Some(clearcoat(&r)?);
    }
    if let Some(r) = open("KHR_materials_sheen")? {
        material.sheen = Some(Sheen {
            color: r.color("sheenColorFactor", [0.0; 3])?,
            color_texture: r.texture("sheenColorTexture")?,
            roughness: r.number("sheenRoughnessFactor", 0.0, UNIT)?,
            roughness_texture: r.texture("sheenRoughnessTexture")?,
        });
    }
    if let Some(r) = open("KHR_materials_iridescence")? {
        material.iridescence = Some(iridescence(&r)?);
    }
    if let Some(r) = open("KHR_materials_anisotropy")? {
        material.anisotropy = Some(Anisotropy {
            strength: r.number("anisotropyStrength", 0.0, UNIT)?,
            rotation: r.number("anisotropyRotation", 0.0, (f32::MIN, f32::MAX))?,
            texture: r.texture("anisotropyTexture")?,
        });
    }
    if let Some(r) = open("KHR_materials_diffuse_transmission")? {
        material.diffuse_transmission = Some(DiffuseTransmission {
            factor: r.number("diffuseTransmissionFactor", 0.0, UNIT)?,
            texture: r.texture("diffuseTransmissionTexture")?,
            color: r.color("diffuseTransmissionColorFactor", [1.0; 3])?,
            color_texture: r.texture("diffuseTransmissionColorTexture")?,
        });
    }
    if let Some(r) = open("KHR_materials_transmission")? {
        let volume = open("KHR_materials_volume")?.map(|v| volume(&v)).transpose()?.flatten();
        let dispersion = match open("KHR_materials_dispersion")? {
            Some(d) => d.number("dispersion", 0.0, POSITIVE)?,
            None => 0.0,
        };
        material.transmission = Some(Transmission {
            factor: r.number("transmissionFactor", 0.0, UNIT)?,
            texture: r.texture("transmissionTexture")?,
            volume,
            dispersion,
        });
    }
    Ok(())
}

fn clearcoat(r: &Reader<'_, '_>) -> Result<Clearcoat> {
    let info = r.info("clearcoatNormalTexture")?;
    let scale = info.as_ref().and_then(|i| i.scale).unwrap_or(1.0);
    let scale = r.ctx.finite(scale, "the clearcoat normal texture's scale", r.object)?;
    Ok(Clearcoat {
        factor: r.number("clearcoatFactor", 0.0, UNIT)?,
        texture: r.texture("clearcoatTexture")?,
        roughness: r.number("clearcoatRoughnessFactor", 0.0, UNIT)?,
        roughness_texture: r.texture("clearcoatRoughnessTexture")?,
        normal_texture: texture(r.ctx, r.textures, info.as_ref(), r.object)?.map(|t| (t, scale)),
    })
}

fn iridescence(r: &Reader<'_, '_>) -> Result<Iridescence> {
    let thickness_texture = r.texture("iridescenceThicknessTexture")?;
    let most = r.number("iridescenceThicknessMaximum", 400.0, POSITIVE)?;
    let least = r.number("iridescenceThicknessMinimum", 100.0, POSITIVE)?;
    Ok(Iridescence {
        factor: r.number("iridescenceFactor", 0.0, UNIT)?,
        texture: r.texture("iridescenceTexture")?,
        ior: r.number("iridescenceIor", 1.3, (1.0, f32::MAX))?,
        // Without a texture the extension takes the maximum alone.
        thickness_nm: (if thickness_texture.is_some() { least } else { most }, most),
        thickness_texture,
    })
}

/// `None` where the thickness is zero: a thin wall.
fn volume(r: &Reader<'_, '_>) -> Result<Option<Volume>> {
    let thickness = r.number("thicknessFactor", 0.0, POSITIVE)?;
    if thickness <= 0.0 {
        return Ok(None);
    }
    let distance = match r.member::<f64>("attenuationDistance")? {
        None => f32::INFINITY,
        Some(d) if d > 0.0 => r.number("attenuationDistance", d, (f32::MIN_POSITIVE, f32::MAX))?,
        Some(d) => {
            let problem = format!("KHR_materials_volume.attenuationDistance is {d}, expected more than 0");
            return Err(r.ctx.error(r.object, problem));
        }
    };
    Ok(Some(Volume {
        thickness,
        attenuation_distance: distance,
        attenuation_color: r.color("attenuationColor", [1.0; 3])?.min(Vec3::ONE),
    }))
}

/// The archived specular-glossiness model in terms of ours: a dielectric of index 0 (full Fresnel reflectance, which
/// `KHR_materials_ior` keeps for this purpose) whose specular colour is the model's.
fn specular_glossiness(r: &Reader<'_, '_>, material: &mut Material) -> Result<()> {
    let diffuse: [f64; 4] = r.member("diffuseFactor")?.unwrap_or([1.0; 4]);
    let channel = |v, range| r.ctx.clamped(v, range, "diffuseFactor", r.object);
    material.base_color = Vec4::new(
        channel(diffuse[0], POSITIVE)?,
        channel(diffuse[1], POSITIVE)?,
        channel(diffuse[2], POSITIVE)?,
        channel(diffuse[3], UNIT)?,
    );
    material.base_color_texture = r.texture("diffuseTexture")?;
    material.metallic = 0.0;
    material.ior = 0.0;
    let glossiness = r.number("glossinessFactor", 1.0, UNIT)?;
    material.roughness = 1.0 - glossiness;
    let info = r.info("specularGlossinessTexture")?;
    let mut color_texture = None;
    if let Some(info) = &info {
        color_texture = r.textures.reference(r.ctx, info, Conversion::Plain, r.object)?;
        let conversion = Conversion::RoughnessFromGlossiness(glossiness.to_bits());
        material.metallic_roughness_texture = r.textures.reference(r.ctx, info, conversion, r.object)?;
        if material.metallic_roughness_texture.is_some() {
            material.roughness = 1.0;
        }
    }
    material.specular =
        Some(Specular { factor: 1.0, texture: None, color: r.color("specularFactor", [1.0; 3])?, color_texture });
    Ok(())
}
