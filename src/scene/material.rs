//! Surface descriptions: glTF's metallic-roughness model with its ratified extensions, as plain numbers.

use super::TextureId;
use glam::{Affine2, Vec3, Vec4};

/// A texture as a material uses it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TextureRef {
    /// The texture.
    pub texture: TextureId,
    /// Which of the mesh's texture coordinate sets it reads (after `KHR_texture_transform`'s override).
    pub uv_set: usize,
    /// From mesh coordinates to texture coordinates (`KHR_texture_transform`); identity where there is none.
    pub transform: Affine2,
}

/// What alpha means.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum AlphaMode {
    /// Alpha is ignored.
    Opaque,
    /// Fully there from this alpha on, fully absent below.
    Mask {
        /// The cutoff.
        cutoff: f32,
    },
    /// There with probability alpha.
    Blend,
}

/// Coat of `KHR_materials_clearcoat`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Clearcoat {
    /// Strength, [0, 1].
    pub factor: f32,
    /// Red channel multiplies `factor`.
    pub texture: Option<TextureRef>,
    /// Roughness, [0, 1].
    pub roughness: f32,
    /// Green channel multiplies `roughness`.
    pub roughness_texture: Option<TextureRef>,
    /// Tangent-space normals of the coat, with their scale.
    pub normal_texture: Option<(TextureRef, f32)>,
}

/// Sheen of `KHR_materials_sheen`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sheen {
    /// Linear colour.
    pub color: Vec3,
    /// sRGB texture that multiplies `color`.
    pub color_texture: Option<TextureRef>,
    /// Roughness, [0, 1].
    pub roughness: f32,
    /// Alpha channel multiplies `roughness`.
    pub roughness_texture: Option<TextureRef>,
}

/// Dielectric reflectance of `KHR_materials_specular`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Specular {
    /// Strength, [0, 1].
    pub factor: f32,
    /// Alpha channel multiplies `factor`.
    pub texture: Option<TextureRef>,
    /// Linear colour of reflectance at normal incidence; may exceed 1.
    pub color: Vec3,
    /// sRGB texture that multiplies `color`.
    pub color_texture: Option<TextureRef>,
}

/// Transmission of `KHR_materials_transmission`, with `KHR_materials_volume` and `KHR_materials_dispersion`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Transmission {
    /// Share of the dielectric base that lets light through, [0, 1].
    pub factor: f32,
    /// Red channel multiplies `factor`.
    pub texture: Option<TextureRef>,
    /// Volume below the surface; `None` is a thin wall, which does not bend light.
    pub volume: Option<Volume>,
    /// Dispersion: 20 / Abbe number; 0 is none.
    pub dispersion: f32,
}

/// Homogeneous medium of `KHR_materials_volume`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Volume {
    /// Thickness that the author baked, metres of mesh space; > 0 (0 is a thin wall and becomes `None`). A ray
    /// tracer follows the real geometry and needs it only to know that there is a volume.
    pub thickness: f32,
    /// Distance after which `attenuation_color` is left; infinite is a clear medium.
    pub attenuation_distance: f32,
    /// Linear colour of white light after `attenuation_distance`.
    pub attenuation_color: Vec3,
}

/// Thin film of `KHR_materials_iridescence`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Iridescence {
    /// Strength, [0, 1].
    pub factor: f32,
    /// Red channel multiplies `factor`.
    pub texture: Option<TextureRef>,
    /// Index of refraction of the film, ≥ 1.
    pub ior: f32,
    /// Thickness in nanometres where the texture reads 0 and 1 (maximum alone where there is no texture).
    pub thickness_nm: (f32, f32),
    /// Green channel blends the two.
    pub thickness_texture: Option<TextureRef>,
}

/// `KHR_materials_anisotropy`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Anisotropy {
    /// Strength, [0, 1].
    pub strength: f32,
    /// Rotation from the tangent, radians, counter-clockwise.
    pub rotation: f32,
    /// Red and green: direction; blue: multiplies `strength`.
    pub texture: Option<TextureRef>,
}

/// `KHR_materials_diffuse_transmission`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DiffuseTransmission {
    /// Share of the diffuse part that goes through, [0, 1].
    pub factor: f32,
    /// Alpha channel multiplies `factor`.
    pub texture: Option<TextureRef>,
    /// Linear colour of what goes through.
    pub color: Vec3,
    /// sRGB texture that multiplies `color`.
    pub color_texture: Option<TextureRef>,
}

/// A surface.
#[derive(Debug, Clone, PartialEq)]
pub struct Material {
    /// The file's name for it; may be empty.
    pub name: String,
    /// Linear base colour and alpha.
    pub base_color: Vec4,
    /// sRGB (alpha linear) texture that multiplies `base_color`.
    pub base_color_texture: Option<TextureRef>,
    /// Metalness, [0, 1].
    pub metallic: f32,
    /// Perceptual roughness, [0, 1]; GGX α is its square.
    pub roughness: f32,
    /// Blue multiplies `metallic`, green multiplies `roughness`.
    pub metallic_roughness_texture: Option<TextureRef>,
    /// Tangent-space normals with the scale of their x and y.
    pub normal_texture: Option<(TextureRef, f32)>,
    /// Baked occlusion (red) with its strength: kept for the record; a ray tracer computes the real one.
    pub occlusion_texture: Option<(TextureRef, f32)>,
    /// Linear emitted radiance, strength included (`KHR_materials_emissive_strength`), nits.
    pub emissive: Vec3,
    /// sRGB texture that multiplies `emissive`.
    pub emissive_texture: Option<TextureRef>,
    /// What alpha means.
    pub alpha_mode: AlphaMode,
    /// Whether the back is seen too; a single-sided surface lets rays through from behind.
    pub double_sided: bool,
    /// `KHR_materials_unlit`: base colour is the picture's colour, no light acts.
    pub unlit: bool,
    /// Index of refraction of the dielectric base (`KHR_materials_ior`); 1.5 by default, ≥ 1; 0 is the extension's
    /// special value for full Fresnel reflectance.
    pub ior: f32,
    /// Extensions; `None` where the material does not use them.
    pub specular: Option<Specular>,
    /// See [`Transmission`].
    pub transmission: Option<Transmission>,
    /// See [`Clearcoat`].
    pub clearcoat: Option<Clearcoat>,
    /// See [`Sheen`].
    pub sheen: Option<Sheen>,
    /// See [`Iridescence`].
    pub iridescence: Option<Iridescence>,
    /// See [`Anisotropy`].
    pub anisotropy: Option<Anisotropy>,
    /// See [`DiffuseTransmission`].
    pub diffuse_transmission: Option<DiffuseTransmission>,
}

impl Default for Material {
    /// glTF's default material: white, fully metallic and rough, opaque, single-sided.
    fn default() -> Self {
        Self {
            name: String::new(),
            base_color: Vec4::ONE,
            base_color_texture: None,
            metallic: 1.0,
            roughness: 1.0,
            metallic_roughness_texture: None,
            normal_texture: None,
            occlusion_texture: None,
            emissive: Vec3::ZERO,
            emissive_texture: None,
            alpha_mode: AlphaMode::Opaque,
            double_sided: false,
            unlit: false,
            ior: 1.5,
            specular: None,
            transmission: None,
            clearcoat: None,
            sheen: None,
            iridescence: None,
            anisotropy: None,
            diffuse_transmission: None,
        }
    }
}

impl Material {
    /// Whether it reads any texture.
    #[must_use]
    pub fn is_textured(&self) -> bool {
        let mut textured = false;
        // The one place that knows every reference; this only looks.
        self.clone().retain_textures(&mut |_| {
            textured = true;
            true
        });
        textured
    }

    /// Calls `f` on every texture that the material reads; those for which it says `false` are taken out.
    pub fn retain_textures(&mut self, f: &mut dyn FnMut(&mut TextureRef) -> bool) {
        let mut plain = |slot: &mut Option<TextureRef>| *slot = slot.take().and_then(|mut t| f(&mut t).then_some(t));
        plain(&mut self.base_color_texture);
        plain(&mut self.metallic_roughness_texture);
        plain(&mut self.emissive_texture);
        if let Some(s) = &mut self.specular {
            plain(&mut s.texture);
            plain(&mut s.color_texture);
        }
        if let Some(t) = &mut self.transmission {
            plain(&mut t.texture);
        }
        if let Some(c) = &mut self.clearcoat {
            plain(&mut c.texture);
            plain(&mut c.roughness_texture);
        }
        if let Some(s) = &mut self.sheen {
            plain(&mut s.color_texture);
            plain(&mut s.roughness_texture);
        }
        if let Some(i) = &mut self.iridescence {
            plain(&mut i.texture);
            plain(&mut i.thickness_texture);
        }
        if let Some(a) = &mut self.anisotropy {
            plain(&mut a.texture);
        }
        if let Some(d) = &mut self.diffuse_transmission {
            plain(&mut d.texture);
            plain(&mut d.color_texture);
        }
        let mut scaled = |slot: &mut Option<(TextureRef, f32)>| {
            *slot = slot.take().and_then(|(mut t, scale)| f(&mut t).then_some((t, scale)));
        };
        scaled(&mut self.normal_texture);
        scaled(&mut self.occlusion_texture);
        if let Some(c) = &mut self.clearcoat {
            scaled(&mut c.normal_texture);
        }
    }

    /// The texture coordinate set along which the material needs tangents; `None` where it needs none.
    #[must_use]
    pub fn tangent_uv_set(&self) -> Option<usize> {
        let normal = self.normal_texture.or(self.clearcoat.and_then(|c| c.normal_texture)).map(|(t, _)| t.uv_set);
        normal.or(self.anisotropy.map(|a| a.texture.map_or(0, |t| t.uv_set)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_texture_anywhere_makes_a_material_textured() {
        let reference = TextureRef { texture: 0, uv_set: 0, transform: Affine2::IDENTITY };
        let coat = |normal_texture| Clearcoat {
            factor: 1.0,
            texture: None,
            roughness: 0.0,
            roughness_texture: None,
            normal_texture,
        };
        let plain = Material { clearcoat: Some(coat(None)), ..Material::default() };
        assert!(!plain.is_textured());
        let on_base = Material { base_color_texture: Some(reference), ..plain.clone() };
        let on_coat = Material { clearcoat: Some(coat(Some((reference, 1.0)))), ..plain };
        assert!(on_base.is_textured() && on_coat.is_textured());
    }
}
