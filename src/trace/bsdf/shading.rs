//! A material evaluated at one point: textures read, normals mapped, lobes weighed.

use super::fresnel::{f0_of, schlick_weight, thin_film};
use super::lobes::{Boundary, Bsdf, CoatParameters, Parameters};
use super::material::{Materials, Medium, resolved_alpha};
use super::tangent::{Basis, mapped_normal, visible_normal};
use crate::scene::{Material, MaterialId, Scene, TextureRef};
use crate::trace::surface::SurfacePoint;
use crate::trace::texture::{ColorSpace, Footprint};
use glam::{Vec2, Vec3, Vec3A, Vec4};

/// What else decides how a point is shaded.
#[derive(Debug, Clone, Copy, Default)]
pub struct ShadingQuery {
    /// Diameter of the ray's cone at the point, metres; 0 is a point.
    pub cone_width: f32,
    /// Coordinate in [0, 1) that stochastic texture filtering draws its texels by.
    pub u_texture: f32,
    /// Vacuum wavelength in nanometres, where the path has one: dispersive media then bend by it.
    pub wavelength_nm: Option<f32>,
    /// The least GGX width that facets are shown with, 0 to 1: narrower ones are widened to it, except on what lets
    /// light through, where those below half of it become a perfectly smooth surface. 0 shows the material as it is.
    pub least_alpha: f32,
    /// Whether only diffuse lobes and sheen are wanted.
    pub diffuse_only: bool,
    /// What lies around the body, if the surface is the boundary of one.
    pub surroundings: Surroundings,
}

/// What is on the other side of a body's boundary from the body.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub enum Surroundings {
    /// Nothing that bends light.
    #[default]
    Air,
    /// Another body: its material, and its index of refraction for this path.
    Body(MaterialId, f32),
    /// The same on both sides: the boundary bends nothing and reflects nothing.
    Same,
}

impl Surroundings {
    /// Their index of refraction around a body of index `ior`.
    fn ior(self, ior: f32) -> f32 {
        match self {
            Self::Air => 1.0,
            Self::Body(_, around) => around,
            Self::Same => ior,
        }
    }
}

/// A material at one point, seen from one direction.
#[derive(Debug, Clone, Copy)]
pub struct Shading {
    /// Radiance emitted towards the viewer, not yet multiplied by [`Shading::opacity`].
    pub emitted: Vec3,
    /// How much of the surface is there, [0, 1]: 0 for the back of a single-sided one. The rest passes straight.
    pub opacity: f32,
    /// What `KHR_materials_unlit` shows instead of scattering.
    pub unlit: Option<Vec3>,
    /// How light scatters; black for unlit materials.
    pub bsdf: Bsdf,
    /// The medium behind the surface (behind its front), if it has a volume.
    pub medium: Option<Medium>,
}

/// Index of refraction at `wavelength_nm` of a medium of index `ior` at 587.6 nm (`KHR_materials_dispersion`: Cauchy's
/// formula with `dispersion` = 20 / Abbe number).
#[must_use]
pub fn dispersed_ior(ior: f32, dispersion: f32, wavelength_nm: f32) -> f32 {
    let per_square = 523_655.0 / (wavelength_nm * wavelength_nm) - 1.516_8;
    (ior + (ior - 1.0) * (dispersion / 20.0) * per_square).max(1.0)
}

/// Reads a material's textures at one point.
struct Reader<'a> {
    scene: &'a Scene,
    materials: &'a Materials,
    uvs: &'a [Vec2],
    footprint: Footprint,
    least_alpha: f32,
}

impl Reader<'_> {
    fn get(&self, reference: &Option<TextureRef>, space: ColorSpace) -> Vec4 {
        reference
            .as_ref()
            .map_or(Vec4::ONE, |r| self.materials.textures.fetch(self.scene, r, space, self.uvs, self.footprint))
    }
    fn linear(&self, reference: &Option<TextureRef>) -> Vec4 {
        self.get(reference, ColorSpace::Linear)
    }
    fn color(&self, reference: &Option<TextureRef>) -> Vec3 {
        self.get(reference, ColorSpace::Srgb).truncate()
    }
}

impl Shading {
    /// Evaluates the material of `point` as seen along `wo` (unit, away from the surface).
    #[must_use]
    pub fn new(scene: &Scene, materials: &Materials, point: &SurfacePoint, wo: Vec3A, query: ShadingQuery) -> Self {
        let material = &scene.materials[point.material];
        let front = wo.dot(point.geometric_normal) >= 0.0;
        let side = if front { 1.0 } else { -1.0 };
        let footprint = point.uv_gradients.map_or(Footprint::point(query.u_texture), |gradients| {
            footprint_of(gradients, point.geometric_normal, wo, query)
        });
        let reader = Reader { scene, materials, uvs: &point.uvs, footprint, least_alpha: query.least_alpha };
        let base = material.base_color * point.color * reader.get(&material.base_color_texture, ColorSpace::Srgb);
        let base_color = base.truncate().max(Vec3::ZERO);
        let medium = materials.medium(point.material).map(|m| dispersed(m, material, query.wavelength_nm));
        let seen = front || material.double_sided || medium.is_some();
        let opacity = if seen { resolved_alpha(material.alpha_mode, base.w) } else { 0.0 };
        let emitted = if (front || material.double_sided) && !material.unlit {
            material.emissive * reader.color(&material.emissive_texture)
        } else {
            Vec3::ZERO
        };
        let ng = point.geometric_normal * side;
        let n = point.normal * side;
        let facing = Facing { wo, ng, n, side, medium, surroundings: query.surroundings };
        let mut parameters = parameters(&reader, material, point, base_color.min(Vec3::ONE), facing);
        parameters.diffuse_only = query.diffuse_only;
        let bsdf = if material.unlit { Bsdf::new(&black(&parameters)) } else { Bsdf::new(&parameters) };
        Self { emitted, opacity, unlit: material.unlit.then_some(base_color), bsdf, medium }
    }
}

fn dispersed(medium: Medium, material: &Material, wavelength_nm: Option<f32>) -> Medium {
    let dispersion = material.transmission.map_or(0.0, |t| t.dispersion);
    match wavelength_nm {
        Some(w) if dispersion > 0.0 => Medium { ior: dispersed_ior(medium.ior, dispersion, w), ..medium },
        _ => medium,
    }
}

/// The cone's round cross-section, laid on the surface along the view: an ellipse in texture coordinates.
///
/// A displacement c across the ray meets the plane at c − wo (c·n)/(wo·n); along that the coordinate u with gradient g
/// changes by c · (g − n (g·wo)/(wo·n)). The vectors in brackets are perpendicular to wo, so their products times the
/// width squared are the ellipse.
fn footprint_of(gradients: [Vec3A; 2], n: Vec3A, wo: Vec3A, query: ShadingQuery) -> Footprint {
    /// Nearer to the horizon than this the ellipse is as long as it is here: half a metre for a pixel of a millimetre.
    const LEAST_COSINE: f32 = 1.0 / 512.0;
    let cos = wo.dot(n);
    let cos = if cos.abs() < LEAST_COSINE { LEAST_COSINE.copysign(cos) } else { cos };
    let [u, v] = gradients.map(|g| (g - n * (g.dot(wo) / cos)) * query.cone_width);
    Footprint::ellipse([u.dot(u), u.dot(v), v.dot(v)], query.u_texture)
}

/// How the point is seen.
#[derive(Clone, Copy)]
struct Facing {
    wo: Vec3A,
    ng: Vec3A,
    n: Vec3A,
    /// 1 in front, −1 behind.
    side: f32,
    medium: Option<Medium>,
    surroundings: Surroundings,
}

fn parameters<'a>(
    reader: &Reader<'a>,
    material: &Material,
    point: &SurfacePoint,
    base: Vec3,
    f: Facing,
) -> Parameters<'a> {
    let tangent = Vec4::new(point.tangent.x, point.tangent.y, point.tangent.z, point.tangent.w * f.side);
    let normal = |map: &Option<(TextureRef, f32)>| {
        let n = match map {
            Some((reference, scale)) => {
                let value = reader.linear(&Some(*reference));
                // A back face mirrors the map's x and y with the normal.
                mapped_normal(f.n * f.side, point.tangent, value, *scale) * f.side
            }
            None => f.n,
        };
        Basis::new(visible_normal(n, f.ng, f.wo), Vec3A::from_vec4(tangent))
    };
    let mr = reader.linear(&material.metallic_roughness_texture);
    let roughness = (material.roughness * mr.y).clamp(0.0, 1.0);
    let metallic = (material.metallic * mr.z).clamp(0.0, 1.0);
    let mut basis = normal(&material.normal_texture);
    let mut alpha = Vec2::splat(roughness * roughness);
    if let Some(a) = &material.anisotropy {
        let texel = a.texture.as_ref().map_or(Vec4::new(1.0, 0.5, 1.0, 1.0), |_| reader.linear(&a.texture));
        let (sin, cos) = crate::numeric::sin_cos(a.rotation);
        let map = (Vec2::new(texel.x, texel.y) * 2.0 - 1.0).try_normalize().unwrap_or(Vec2::X);
        // Rotation turns counter-clockwise in the tangent space of the front.
        basis = basis.turned(map.x * cos - map.y * sin, (map.x * sin + map.y * cos) * tangent.w.signum());
        let strength = (a.strength * texel.z).clamp(0.0, 1.0);
        alpha.x += (1.0 - alpha.x) * strength * strength;
    }
    let inside = f.side < 0.0;
    // Of the body relative to what is around it.
    let index = f.medium.map(|m| m.ior / f.surroundings.ior(m.ior));
    let boundary = index.map(|eta| Boundary {
        eta: if inside { 1.0 / eta } else { eta },
        glass: reader.materials.glass(point.material, f.surroundings, usize::from(inside)),
    });
    // The special index 0 reflects all, in any medium.
    let index = index.filter(|_| material.ior > 0.0).unwrap_or(material.ior);
    let (mut f0, f90) = dielectric_reflectance(reader, material, index);
    let mut metal_f0 = base;
    if let Some(i) = &material.iridescence {
        let factor = (i.factor * reader.linear(&i.texture).x).clamp(0.0, 1.0);
        let (low, high) = i.thickness_nm;
        let thickness =
            i.thickness_texture.as_ref().map_or(high, |_| low + (high - low) * reader.linear(&i.thickness_texture).y);
        let cos = basis.n.dot(f.wo).clamp(0.0, 1.0);
        let film = |f0: Vec3| f0.lerp(f0_from_schlick(thin_film(cos, i.ior, thickness, f0), cos), factor);
        (f0, metal_f0) = (film(f0), film(metal_f0));
    }
    let transmission =
        material.transmission.as_ref().map_or(0.0, |t| (t.factor * reader.linear(&t.texture).x).clamp(0.0, 1.0));
    let through = material.diffuse_transmission.as_ref().map_or((0.0, Vec3::ZERO), |d| {
        let factor = (d.factor * reader.linear(&d.texture).w).clamp(0.0, 1.0);
        (factor, (d.color * reader.color(&d.color_texture)).clamp(Vec3::ZERO, Vec3::ONE))
    });
    let clear = f.medium.is_some() || transmission > 0.0;
    let alpha = regularised(alpha, reader.least_alpha, clear);
    let outside = f.side > 0.0 || f.medium.is_none();
    let coat = material.clearcoat.as_ref().filter(|_| outside).map(|c| CoatParameters {
        factor: (c.factor * reader.linear(&c.texture).x).clamp(0.0, 1.0),
        alpha: {
            let roughness = (c.roughness * reader.linear(&c.roughness_texture).y).clamp(0.0, 1.0);
            regularised(Vec2::splat(roughness * roughness), reader.least_alpha, clear).x
        },
        basis: normal(&c.normal_texture),
    });
    let sheen = material.sheen.as_ref().filter(|s| outside && s.color != Vec3::ZERO).map(|s| {
        let color = (s.color * reader.color(&s.color_texture)).clamp(Vec3::ZERO, Vec3::ONE);
        (color, (s.roughness * reader.linear(&s.roughness_texture).w).clamp(0.0, 1.0))
    });
    Parameters {
        wo: f.wo,
        ng: f.ng,
        basis,
        base,
        metallic,
        alpha,
        f0,
        f90,
        metal_f0,
        transmission,
        boundary,
        diffuse_transmission: through.0,
        diffuse_transmission_color: through.1,
        coat,
        sheen,
        diffuse_only: false,
    }
}

/// GGX widths as [`ShadingQuery::least_alpha`] says.
fn regularised(alpha: Vec2, least: f32, clear: bool) -> Vec2 {
    match clear {
        // Widened surfaces would let lamps through as a glow; only what is far narrower is taken for a smooth one.
        true if alpha.max_element() < 0.5 * least => Vec2::ZERO,
        true => alpha,
        false => alpha.max(Vec2::splat(least)),
    }
}

/// F₀ and F₉₀ of the dielectric of relative index `ior` (`KHR_materials_specular` over `KHR_materials_ior`).
fn dielectric_reflectance(reader: &Reader<'_>, material: &Material, ior: f32) -> (Vec3, f32) {
    let f0 = f0_of(ior);
    match &material.specular {
        None => (Vec3::splat(f0), 1.0),
        Some(s) => {
            let factor = (s.factor * reader.linear(&s.texture).w).clamp(0.0, 1.0);
            let color = (s.color * reader.color(&s.color_texture)).max(Vec3::ZERO);
            ((f0 * color).min(Vec3::ONE) * factor, factor)
        }
    }
}

/// The F₀ whose Schlick curve passes through `f` at `cos`.
fn f0_from_schlick(f: Vec3, cos: f32) -> Vec3 {
    // At grazing views every curve ends at 1 and the question has no answer; the weight is held below it.
    let weight = schlick_weight(cos).min(0.999);
    ((f - weight) / (1.0 - weight)).clamp(Vec3::ZERO, Vec3::ONE)
}

/// The same point with nothing to scatter.
fn black<'a>(p: &Parameters<'a>) -> Parameters<'a> {
    let none = Parameters { metallic: 0.0, transmission: 0.0, diffuse_transmission: 0.0, boundary: None, ..*p };
    Parameters { base: Vec3::ZERO, f0: Vec3::ZERO, f90: 0.0, coat: None, sheen: None, ..none }
}
