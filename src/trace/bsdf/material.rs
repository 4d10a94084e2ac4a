//! What is prepared once for each material of a scene.

use super::albedo::{self, Glass};
use super::shading::Surroundings;
use crate::scene::{AlphaMode, Material, MaterialId, Scene};
use crate::trace::texture::{ColorSpace, Footprint, TextureFilter, Textures};
use glam::{Vec2, Vec3};
use std::collections::{BTreeSet, HashMap};
use std::sync::{Arc, OnceLock};

/// A homogeneous medium behind a refracting boundary.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Medium {
    /// Index of refraction.
    pub ior: f32,
    /// Absorption σ in 1/m by channel: light over a distance d keeps exp(−σ d).
    pub absorption: Vec3,
}

impl Medium {
    /// What is left of light after `distance` metres (Beer and Lambert).
    #[must_use]
    pub fn transmittance(&self, distance: f32) -> Vec3 {
        (self.absorption * distance.min(f32::MAX)).map(|x| if x > 0.0 { libm::expf(-x) } else { 1.0 })
    }
}

/// Textures and tables of a scene's materials.
#[derive(Debug)]
pub struct Materials {
    pub(super) textures: Textures,
    /// By material: albedos of its refracting boundary from outside and from inside.
    glass: Vec<Option<Arc<[Glass; 2]>>>,
    /// The same for boundaries between two media of the scene, by the bits of the inner and the outer index.
    nested: HashMap<(u32, u32), OnceLock<[Glass; 2]>>,
    media: Vec<Option<Medium>>,
    /// Whether reading them draws texels at random.
    draws: bool,
}

impl Materials {
    /// Prepares the scene's materials for lookups under `filter`.
    #[must_use]
    pub fn new(scene: &Scene, filter: TextureFilter) -> Self {
        let any = |used: fn(&Material) -> bool| scene.materials.iter().any(used);
        albedo::prepare(albedo::Wanted {
            sheen: any(|m| m.sheen.is_some()),
            coat: any(|m| m.clearcoat.is_some_and(|c| c.roughness > 0.0)),
        });
        let media: Vec<_> = scene.materials.iter().map(medium_of).collect();
        let mut by_ior: HashMap<u32, Arc<[Glass; 2]>> = HashMap::new();
        let mut tables = |m: &Medium| {
            by_ior
                .entry(m.ior.to_bits())
                .or_insert_with(|| Arc::new([Glass::new(m.ior), Glass::new(1.0 / m.ior)]))
                .clone()
        };
        let rough = |m: &Material| m.roughness > 0.0;
        let glass = scene
            .materials
            .iter()
            .zip(&media)
            .map(|(m, medium)| medium.as_ref().filter(|_| rough(m)).map(&mut tables))
            .collect();
        let nested = nested(scene, &media);
        Self { textures: Textures::new(scene, filter), glass, nested, media, draws: filter.draws() }
    }

    /// The albedos of the boundary of `material`, from outside (0) or inside (1); `None` where it is perfectly smooth,
    /// or the same on both sides.
    pub(super) fn glass(&self, material: MaterialId, surroundings: Surroundings, side: usize) -> Option<&Glass> {
        let own = self.glass[material].as_deref()?;
        match surroundings {
            Surroundings::Air => Some(&own[side]),
            Surroundings::Same => None,
            Surroundings::Body(around, _) => {
                let (inner, outer) = (self.media[material]?.ior, self.media[around]?.ior);
                let tables = self.nested.get(&(inner.to_bits(), outer.to_bits()))?;
                // Made when the first path needs it: which bodies are in which is not known before.
                Some(&tables.get_or_init(|| [Glass::new(inner / outer), Glass::new(outer / inner)])[side])
            }
        }
    }

    /// The prepared textures.
    #[must_use]
    pub fn textures(&self) -> &Textures {
        &self.textures
    }

    /// Whether reading textures takes a number: a filter that draws texels.
    #[must_use]
    pub fn draws_texels(&self) -> bool {
        self.draws
    }

    /// The medium behind `material`'s surface, if it has a volume.
    #[must_use]
    pub fn medium(&self, material: MaterialId) -> Option<Medium> {
        self.media[material]
    }

    /// Whether `material` bends light by its wavelength: a path that enters it needs one (see
    /// [`wavelength`](super::wavelength)).
    #[must_use]
    pub fn disperses(&self, scene: &Scene, material: MaterialId) -> bool {
        self.media[material].is_some() && scene.materials[material].transmission.is_some_and(|t| t.dispersion > 0.0)
    }

    /// How much of the surface is there, [0, 1], before its facing is considered: masks give 0 or 1.
    #[must_use]
    pub fn alpha(
        &self,
        scene: &Scene,
        material: MaterialId,
        uvs: &[Vec2],
        vertex_alpha: f32,
        footprint: Footprint,
    ) -> f32 {
        let material = &scene.materials[material];
        if material.alpha_mode == AlphaMode::Opaque {
            return 1.0;
        }
        let mut alpha = material.base_color.w * vertex_alpha;
        if let Some(reference) = &material.base_color_texture {
            alpha *= self.textures.fetch(scene, reference, ColorSpace::Srgb, uvs, footprint).w;
        }
        resolved_alpha(material.alpha_mode, alpha)
    }

    /// Radiance that `material` emits at `uvs`, before its facing is considered.
    #[must_use]
    pub fn emission(&self, scene: &Scene, material: MaterialId, uvs: &[Vec2], footprint: Footprint) -> Vec3 {
        let material = &scene.materials[material];
        if material.unlit || material.emissive == Vec3::ZERO {
            return Vec3::ZERO;
        }
        match &material.emissive_texture {
            None => material.emissive,
            Some(reference) => {
                material.emissive * self.textures.fetch(scene, reference, ColorSpace::Srgb, uvs, footprint).truncate()
            }
        }
    }
}

/// Alpha as its mode means it.
pub(super) fn resolved_alpha(mode: AlphaMode, alpha: f32) -> f32 {
    match mode {
        AlphaMode::Opaque => 1.0,
        AlphaMode::Mask { cutoff } => f32::from(u8::from(alpha >= cutoff)),
        AlphaMode::Blend => alpha.clamp(0.0, 1.0),
    }
}

/// Places for the tables of every boundary that rough bodies of the scene can have with others.
fn nested(scene: &Scene, media: &[Option<Medium>]) -> HashMap<(u32, u32), OnceLock<[Glass; 2]>> {
    /// Scenes with more kinds of boundaries than this do without what scattering between facets gives back there.
    const MOST: usize = 1024;
    let bits = |wanted: fn(&Material) -> bool| -> BTreeSet<u32> {
        let bodies = scene.materials.iter().zip(media).filter(|(m, _)| wanted(m));
        bodies.filter_map(|(_, medium)| medium.map(|m| m.ior.to_bits())).collect()
    };
    let (rough, all) = (bits(|m| m.roughness > 0.0), bits(|_| true));
    if rough.len() * all.len() > MOST {
        return HashMap::new();
    }
    let pairs = rough.iter().flat_map(|&inner| all.iter().map(move |&outer| (inner, outer)));
    pairs.filter(|(inner, outer)| inner != outer).map(|pair| (pair, OnceLock::new())).collect()
}

fn medium_of(material: &Material) -> Option<Medium> {
    let volume = material.transmission.as_ref()?.volume?;
    // ln 0 is infinite and infinity times a distance of 0 is NaN: black is taken as the least normal number, which
    // leaves e⁻⁸⁷ after the attenuation distance.
    let absorption = if volume.attenuation_distance.is_finite() {
        let distance = volume.attenuation_distance.max(f32::MIN_POSITIVE);
        volume.attenuation_color.map(|c| (-libm::logf(c.clamp(f32::MIN_POSITIVE, 1.0)) / distance).clamp(0.0, f32::MAX))
    } else {
        Vec3::ZERO
    };
    // The special index 0 has no refraction: its surface reflects all.
    let ior = if material.ior > 0.0 { material.ior.max(1.0) } else { 1.5 };
    Some(Medium { ior, absorption })
}
