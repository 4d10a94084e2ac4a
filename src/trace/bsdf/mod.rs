//! Scattering at a surface: glTF's metallic-roughness model with its ratified extensions, as weighted lobes.
//!
//! [`Shading`] evaluates a material once at a path vertex; its [`Bsdf`] then samples and evaluates directions. The
//! equations are those of the glTF 2.0 specification, appendix B, with what energy conservation adds to them;
//! `docs/materials.md` lists them all. All directions are unit vectors in world space that point away from the
//! surface.
//!
//! Light carried across a refracting boundary is not scaled by the square of the relative index: paths carry basic
//! radiance L/n² (Nicodemus 1963), which is the same on both sides, so a closed body of glass looks as it must and a
//! furnace reads 1 at every step.

mod albedo;
mod fresnel;
mod ggx;
mod lobes;
mod material;
mod shading;
mod sheen;
mod spectrum;
mod tangent;

pub use lobes::{Bsdf, Evaluation};
pub use material::{Materials, Medium};
pub use shading::{Shading, ShadingQuery, Surroundings, dispersed_ior};
pub use spectrum::{Wavelength, wavelength};

use crate::numeric;
use glam::{Vec3, Vec3A};

/// The GGX width below which a lobe is a mirror.
///
/// A half vector's components err by up to γ₈; that moves the density D ∝ (1 + s²/α²)⁻² by at most 4 γ₈ / α relative,
/// and 1 % is the most that we allow. Perceptual roughness 0.014; such a lobe is 0.02 degrees wide.
pub const ALPHA_SPECULAR: f32 = 400.0 * numeric::gamma(8);

/// Whether a sampled direction came from a lobe with a density.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Scatter {
    /// From a mirror-like lobe: no light sampling can find it, no density exists.
    Specular,
    /// From a lobe with a density.
    Rough,
}

/// A sampled direction.
#[derive(Debug, Clone, Copy)]
pub struct BsdfSample {
    /// Where the path goes on, unit.
    pub wi: Vec3A,
    /// f · |cosᵢ| / pdf; for specular lobes the reflectance over the probability of the choice.
    pub throughput: Vec3,
    /// Density of `wi` by solid angle, over all lobes; 0 for specular ones.
    pub pdf_solid_angle: f32,
    /// Which kind of lobe it came from.
    pub scatter: Scatter,
    /// Whether the path crosses the surface.
    pub transmitted: bool,
    /// Whether it crosses by refraction into or out of a volume: then the medium changes.
    pub refracted: bool,
    /// GGX width of the lobe (1 for diffuse ones): how much the ray's cone widens.
    pub alpha: f32,
}

#[cfg(test)]
mod tests;
