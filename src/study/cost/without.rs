//! The same scene with effects switched off: what is left tells what they cost.

use crate::Result;
use crate::effects::EffectsPlan;
use crate::render::{Settings, Shot, Surroundings};
use crate::scene::{Light, MeshId};
use crate::scene::{LightShape, LocalTransform, Material, Node, NodeId, Scene, Specular};
use crate::trace::environment::Background;
use glam::{DAffine3, DMat3, DQuat, DVec3, Vec3};

/// An effect that can be left out.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Effect {
    /// Motion blur: without it the exposure is an instant.
    Time,
    /// Depth of field: without it the lens is a pinhole.
    Lens,
    /// Soft shadows: without them lights have no extent. Emissive objects become points of the same power at their
    /// middles and are no longer seen themselves; light from all around becomes a sun straight above.
    /// Bounced light has no bound close to a point: with bounces such a scene may be noisier than with its lamps, and
    /// the price negative or not to be given.
    Light,
    /// Blurred reflection: without it surfaces that are neither mirrors nor glass are matte, and glass is clear.
    Gloss,
}

impl Effect {
    /// All of them.
    pub const ALL: [Self; 4] = [Self::Time, Self::Lens, Self::Light, Self::Gloss];

    /// Its name.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Time => "time",
            Self::Lens => "lens",
            Self::Light => "light",
            Self::Gloss => "gloss",
        }
    }

    /// Those that frame `frame` samples.
    ///
    /// # Errors
    /// If the settings do not fit the scene.
    pub fn of_frame(
        scene: &Scene,
        settings: &Settings,
        surroundings: &Surroundings<'_>,
        frame: i64,
    ) -> Result<Vec<Self>> {
        let plans = Shot::new(scene, settings, surroundings, "")?.plan(frame)?;
        Ok(Self::ALL.into_iter().filter(|effect| plans.iter().any(|(plan, _)| effect.shows(plan))).collect())
    }

    fn shows(self, plan: &EffectsPlan) -> bool {
        match self {
            Self::Time => plan.samples_time(),
            Self::Lens => plan.samples_lens(),
            Self::Light => plan.has_extended_light(),
            Self::Gloss => plan.samples_gloss(),
        }
    }

    /// Switches it off.
    pub fn leave_out(self, scene: &mut Scene, settings: &mut Settings) {
        match self {
            Self::Time => settings.shutter = Some(0.0),
            Self::Lens => settings.view.aperture_radius = Some(0.0),
            Self::Light => shrink_lights(scene),
            Self::Gloss => scene.materials.iter_mut().for_each(matte),
        }
    }
}

/// A frame without some of its effects.
#[derive(Debug, Clone)]
pub struct Without<'a> {
    /// What is left of the scene.
    pub scene: Scene,
    /// What is left of the settings.
    pub settings: Settings,
    /// Light from all around: none where light has no extent; a sun replaces it.
    pub surroundings: Surroundings<'a>,
}

impl<'a> Without<'a> {
    /// The frame without `effects`.
    #[must_use]
    pub fn new(scene: &Scene, settings: &Settings, surroundings: &Surroundings<'a>, effects: &[Effect]) -> Self {
        let (mut scene, mut settings, mut surroundings) = (scene.clone(), settings.clone(), surroundings.clone());
        for effect in effects {
            effect.leave_out(&mut scene, &mut settings);
        }
        if effects.contains(&Effect::Light) {
            let radiance = match surroundings.background {
                Background::Black => None,
                Background::Constant(c) => Some(c),
                Background::Gradient { horizon, .. } => Some(horizon),
                // A sun as bright as a white sky: of a picture only the order of magnitude matters here.
                Background::Picture(picture) => Some(Vec3::splat(picture.strength)),
            };
            if let Some(radiance) = radiance {
                add_sun(&mut scene, radiance * std::f32::consts::PI);
            }
            surroundings = Surroundings { background: Background::Black, name: String::new() };
        }
        Self { scene, settings, surroundings }
    }
}

fn matte(material: &mut Material) {
    if material.unlit || (material.metallic >= 1.0 && material.roughness <= 0.0) {
        return;
    }
    material.metallic_roughness_texture = None;
    (material.clearcoat, material.sheen, material.iridescence, material.anisotropy) = (None, None, None, None);
    if material.transmission.is_some() {
        material.roughness = 0.0;
        return;
    }
    (material.metallic, material.roughness) = (0.0, 1.0);
    material.specular = Some(Specular { factor: 0.0, texture: None, color: Vec3::ZERO, color_texture: None });
}

fn shrink_lights(scene: &mut Scene) {
    for light in &mut scene.lights {
        match &mut light.shape {
            LightShape::Directional { angular_radius } => *angular_radius = 0.0,
            LightShape::Point { radius } | LightShape::Spot { radius, .. } => *radius = 0.0,
        }
    }
    for n in 0..scene.nodes.len() {
        let world = world(scene, n).matrix3;
        let emits = |m: &MeshId| {
            let material = &scene.materials[scene.meshes[*m].material];
            material.emissive.max_element() > 0.0 && !material.unlit
        };
        let (lamps, others): (Vec<MeshId>, Vec<MeshId>) = scene.nodes[n].meshes.iter().partition(|m| emits(m));
        if lamps.is_empty() {
            continue;
        }
        let copies = scene.nodes[n].copies.as_ref().map_or(1, Vec::len);
        let mut points = Vec::new();
        for m in lamps {
            let mesh = &scene.meshes[m];
            let (mut area, mut moment) = (0.0, DVec3::ZERO);
            for triangle in &mesh.triangles {
                let [a, b, c] = triangle.map(|i| mesh.positions[i as usize].as_dvec3());
                let part = (world * (b - a)).cross(world * (c - a)).length() * 0.5;
                area += part;
                moment += (a + b + c) / 3.0 * part;
            }
            if area > 0.0 {
                // π L A through a side of area A, the same all around a point: L A / 4 (candela).
                #[allow(clippy::cast_possible_truncation, clippy::cast_precision_loss, reason = "as precise as a lamp")]
                let power = (area * 0.25 * copies as f64) as f32;
                points.push((moment / area, scene.materials[mesh.material].emissive * power));
            }
        }
        scene.nodes[n].meshes = others;
        for (place, intensity) in points {
            let local = LocalTransform::Parts {
                translation: place.as_vec3(),
                rotation: glam::Quat::IDENTITY,
                scale: Vec3::ONE,
            };
            hang(scene, Some(n), local, LightShape::Point { radius: 0.0 }, intensity);
        }
    }
}

/// Puts a sun straight above, without extent: `irradiance` on the ground, in lux.
pub fn add_sun(scene: &mut Scene, irradiance: Vec3) {
    let local = LocalTransform::Parts {
        translation: Vec3::ZERO,
        rotation: glam::Quat::from_rotation_x(-std::f32::consts::FRAC_PI_2),
        scale: Vec3::ONE,
    };
    hang(scene, None, local, LightShape::Directional { angular_radius: 0.0 }, irradiance);
}

fn hang(scene: &mut Scene, parent: Option<NodeId>, local: LocalTransform, shape: LightShape, intensity: Vec3) {
    scene.lights.push(Light { name: String::new(), shape, intensity, range: None });
    let light = Some(scene.lights.len() - 1);
    scene.nodes.push(Node { parent, local, light, visible: true, ..Node::default() });
    scene.order.push(scene.nodes.len() - 1);
}

/// Where a node stands in the file's own pose.
fn world(scene: &Scene, node: NodeId) -> DAffine3 {
    let local = match scene.nodes[node].local {
        LocalTransform::Parts { translation, rotation, scale } => DAffine3 {
            matrix3: DMat3::from_quat(DQuat::from_xyzw(
                rotation.x.into(),
                rotation.y.into(),
                rotation.z.into(),
                rotation.w.into(),
            )) * DMat3::from_diagonal(scale.as_dvec3()),
            translation: translation.as_dvec3(),
        },
        LocalTransform::Matrix(matrix) => matrix,
    };
    scene.nodes[node].parent.map_or(local, |parent| world(scene, parent) * local)
}
