//! Which effects an exposure shows, hence which factors need sampling.
//!
//! The plan is computed from scene, stage and the bounces asked for, and is the only thing that decides which factors
//! exist. What does not show is not sampled: the design is built over the factors that remain, so dropping one buys
//! accuracy, not only time.

use crate::factor::Factor;
use crate::scene::{Instance, LightShape, MaterialId, Scene, Stage};
use serde::Serialize;
use std::collections::HashSet;
use std::fmt;

/// What an exposure calls for, with the counts that say why.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct EffectsPlan {
    /// Exposure length, seconds; 0 is an instant.
    pub exposure_s: f64,
    /// Visible objects.
    pub objects: usize,
    /// Of these, how many move or deform within the exposure.
    pub moving_objects: usize,
    /// Whether the camera moves within the exposure, or its focus does.
    pub camera_moves: bool,
    /// Punctual lights that move within the exposure.
    pub moving_lights: usize,
    /// Whether lines are exposed one after another.
    pub rolling: bool,
    /// Aperture radius, metres.
    pub aperture_radius: f64,
    /// Objects whose material emits light.
    pub emissive_objects: usize,
    /// Punctual lights with an extent: spheres, and directional lights with an angle.
    pub sized_lights: usize,
    /// Punctual lights without extent.
    pub point_lights: usize,
    /// Whether light comes from all around.
    pub surrounding_light: bool,
    /// Visible objects whose material reflects or transmits neither diffusely alone nor as a mirror.
    pub glossy_objects: usize,
    /// How many materials these have.
    pub glossy_materials: usize,
    /// Diffuse and rough bounces after the first hit.
    pub bounces: u16,
}

/// Up to as many lights without extent are all visited; more are chosen from, which takes a number.
pub const MOST_LIGHTS_VISITED: usize = 4;

impl EffectsPlan {
    /// The plan for one exposure. `surrounding_light`: whether the background lights the scene.
    #[must_use]
    pub fn new(scene: &Scene, stage: &Stage, surrounding_light: bool, rolling: bool, bounces: u16) -> Self {
        let has_extent = |shape: &LightShape| match *shape {
            LightShape::Directional { angular_radius } => angular_radius > 0.0,
            LightShape::Point { radius } | LightShape::Spot { radius, .. } => radius > 0.0,
        };
        let sized = stage.lights.iter().filter(|l| has_extent(&l.light.shape)).count();
        let material_of = |i: &Instance| scene.meshes[stage.geometries[i.geometry].mesh].material;
        let material = |i: &Instance| &scene.materials[material_of(i)];
        let is_glossy = |i: &Instance| {
            let m = material(i);
            let mirror = m.metallic >= 1.0 && m.roughness <= 0.0 && m.metallic_roughness_texture.is_none();
            !m.unlit && !mirror
        };
        let glossy: HashSet<MaterialId> = stage.instances.iter().filter(|i| is_glossy(i)).map(material_of).collect();
        let count = |test: &dyn Fn(&Instance) -> bool| stage.instances.iter().filter(|i| test(i)).count();
        let [open, close] = stage.camera.focus_distance;
        Self {
            exposure_s: stage.interval.duration(),
            objects: stage.instances.len(),
            moving_objects: count(&|i| !i.motion.is_constant() || stage.geometries[i.geometry].keys.len() > 1),
            camera_moves: !stage.camera.motion.is_still()
                || (stage.camera.aperture_radius > 0.0 && open.to_bits() != close.to_bits()),
            moving_lights: stage.lights.iter().filter(|l| !l.motion.is_constant()).count(),
            rolling,
            aperture_radius: f64::from(stage.camera.aperture_radius),
            emissive_objects: count(&|i| {
                let m = material(i);
                m.emissive.max_element() > 0.0 && !m.unlit
            }),
            sized_lights: sized,
            point_lights: stage.lights.len() - sized,
            surrounding_light,
            glossy_objects: count(&is_glossy),
            glossy_materials: glossy.len(),
            bounces,
        }
    }

    /// Whether time needs sampling.
    #[must_use]
    pub fn samples_time(&self) -> bool {
        self.exposure_s > 0.0 && (self.moving_objects > 0 || self.camera_moves || self.moving_lights > 0)
    }

    /// Whether the lens needs sampling.
    #[must_use]
    pub fn samples_lens(&self) -> bool {
        self.aperture_radius > 0.0
    }

    /// Whether lights need sampling: some have an extent, or there are too many to visit all.
    #[must_use]
    pub fn samples_light(&self) -> bool {
        self.has_extended_light() || self.point_lights > MOST_LIGHTS_VISITED
    }

    /// Whether the direction of rough reflection needs sampling even at a path's last vertex.
    #[must_use]
    pub fn samples_gloss(&self) -> bool {
        self.glossy_objects > 0 && self.has_extended_light()
    }

    /// Whether a scattered ray can meet a light.
    #[must_use]
    pub fn has_extended_light(&self) -> bool {
        self.emissive_objects + self.sized_lights > 0 || self.surrounding_light
    }

    /// The factors to sample, in their fixed order.
    #[must_use]
    pub fn factors(&self) -> Vec<Factor> {
        let mut factors = vec![Factor::FILM_X, Factor::FILM_Y];
        if self.samples_time() {
            factors.push(Factor::SHUTTER);
        }
        if self.samples_lens() {
            factors.extend([Factor::LENS_U, Factor::LENS_V]);
        }
        for vertex in 0..=self.bounces {
            if self.samples_light() {
                factors.extend([Factor::light_u(vertex), Factor::light_v(vertex)]);
            }
            if vertex < self.bounces || self.samples_gloss() {
                factors.extend([Factor::lobe_u(vertex), Factor::lobe_v(vertex)]);
            }
        }
        factors
    }
}

/// One line for each effect: whether it is sampled, and why.
impl fmt::Display for EffectsPlan {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let lines = [self.time_line(), self.lens_line(), self.light_line(), self.gloss_line()];
        f.write_str(&lines.join("\n"))
    }
}

impl EffectsPlan {
    /// Why time is sampled or not.
    #[must_use]
    pub fn time_line(&self) -> String {
        let why = if self.exposure_s <= 0.0 {
            "the exposure is an instant".to_owned()
        } else {
            let mut parts = vec![format!("{} of {} objects move in this exposure", self.moving_objects, self.objects)];
            if self.moving_lights > 0 {
                parts.push(counted(self.moving_lights, "light moves", "lights move"));
            }
            parts.push(if self.camera_moves { "the camera moves" } else { "the camera stands" }.to_owned());
            if self.rolling {
                parts.push("lines are exposed one after another".to_owned());
            }
            parts.join(", ")
        };
        format!("time:    {}; {why}", yes(self.samples_time()))
    }

    /// Why the lens is sampled or not.
    #[must_use]
    pub fn lens_line(&self) -> String {
        let why = if self.samples_lens() {
            format!("aperture radius {:.4} m", self.aperture_radius)
        } else {
            "f-stop not set".to_owned()
        };
        format!("lens:    {}; {why}", yes(self.samples_lens()))
    }

    /// Why lights are sampled or not.
    #[must_use]
    pub fn light_line(&self) -> String {
        let areas = self.emissive_objects + self.sized_lights;
        let mut parts = vec![counted(areas, "area light", "area lights")];
        if self.emissive_objects > 0 && self.sized_lights > 0 {
            let lamps = counted(self.sized_lights, "lamp", "lamps");
            let objects = counted(self.emissive_objects, "emissive object", "emissive objects");
            parts[0] += &format!(" ({objects} and {lamps} with an extent)");
        }
        parts.push(counted(self.point_lights, "point light", "point lights"));
        if self.point_lights > MOST_LIGHTS_VISITED {
            parts.push(format!("chosen from, being more than {MOST_LIGHTS_VISITED}"));
        }
        if self.surrounding_light {
            parts.push("light from all around".to_owned());
        }
        format!("light:   {}; {}", yes(self.samples_light()), parts.join(", "))
    }

    /// Why rough reflection is sampled or not.
    #[must_use]
    pub fn gloss_line(&self) -> String {
        let materials = counted(self.glossy_materials, "material", "materials");
        let objects = counted(self.glossy_objects, "object", "objects");
        let why = if self.glossy_objects > 0 && !self.has_extended_light() {
            ", but nothing that a scattered ray could find at a path's end"
        } else {
            ""
        };
        format!("gloss:   {}; {materials} on {objects}{why}; bounces: {}", yes(self.samples_gloss()), self.bounces)
    }
}

fn yes(sampled: bool) -> &'static str {
    if sampled { "sampled" } else { "not sampled" }
}

fn counted(count: usize, one: &str, more: &str) -> String {
    format!("{count} {}", if count == 1 { one } else { more })
}
