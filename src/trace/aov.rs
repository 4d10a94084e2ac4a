//! What a pixel sees besides light: distance, orientation, colour of the surface, motion, identity.
//!
//! Evaluated at the first surface that a sample meets, by the very film point, time and lens point of the sample's
//! radiance. Motion needs the neighbouring instants too: see [`Observer`].

use super::accel::Accel;
use super::bsdf::Materials;
use super::camera::CameraRays;
use super::texture::{ColorSpace, Footprint};
use super::{FilmPoint, Hit, Ray};
use crate::design::Point;
use crate::scene::{MeshId, NodeId, Scene, Stage};
use glam::{DVec2, Vec3, Vec3A};
use std::collections::HashMap;

/// The first surface that one sample meets.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FirstHit {
    /// Distance along the camera's axis, metres.
    pub depth: f32,
    /// Unit shading normal towards the viewer, world space.
    pub normal: Vec3,
    /// Linear base colour.
    pub albedo: Vec3,
    /// The sample's instant, seconds after the exposure opened.
    pub time_s: f32,
    /// From where the surface point's picture is at this exposure's middle to where it is at the neighbouring
    /// instants' (earlier, later), pixels, x to the right, y down; `None` where it is not in both.
    pub motion: Option<[DVec2; 2]>,
    /// Number of the surface's node, from 1.
    pub object: u32,
}

/// The scene at a neighbouring instant, for motion.
#[derive(Debug)]
pub struct Neighbour<'a> {
    stage: &'a Stage,
    camera: CameraRays,
    /// By node, mesh and copy: the instance there.
    instances: HashMap<(NodeId, MeshId, u32), usize>,
}

impl<'a> Neighbour<'a> {
    /// `stage` must be that of an instant: nothing in it moves.
    #[must_use]
    pub fn new(stage: &'a Stage, camera: CameraRays) -> Self {
        let keys = instance_keys(stage);
        let instances = keys.into_iter().enumerate().map(|(i, key)| (key, i)).collect();
        Self { stage, camera, instances }
    }

    /// Where the point of barycentric weights `(u, v)` on a triangle is seen, pixels.
    fn picture_of(&self, scene: &Scene, key: (NodeId, MeshId, u32), hit: &Hit) -> Option<DVec2> {
        let instance = &self.stage.instances[*self.instances.get(&key)?];
        let geometry = &self.stage.geometries[instance.geometry];
        let mesh = &scene.meshes[geometry.mesh];
        let positions = geometry.keys.first().map_or(&mesh.positions, |k| &k.positions);
        let [a, b, c] = mesh.triangles[hit.triangle as usize].map(|i| positions[i as usize]);
        let local = a * (1.0 - hit.u - hit.v) + b * hit.u + c * hit.v;
        self.camera.project(instance.motion.at(0.0).transform_point3a(Vec3A::from(local)), 0.0)
    }
}

/// Node, mesh and number of the copy of every instance.
fn instance_keys(stage: &Stage) -> Vec<(NodeId, MeshId, u32)> {
    let mut copies: HashMap<(NodeId, MeshId), u32> = HashMap::new();
    stage
        .instances
        .iter()
        .map(|i| {
            let mesh = stage.geometries[i.geometry].mesh;
            let copy = copies.entry((i.node, mesh)).or_insert(0);
            *copy += 1;
            (i.node, mesh, *copy)
        })
        .collect()
}

/// Observes first hits.
#[derive(Debug)]
pub struct Observer<'a> {
    scene: &'a Scene,
    stage: &'a Stage,
    accel: &'a Accel,
    materials: &'a Materials,
    camera: CameraRays,
    keys: Vec<(NodeId, MeshId, u32)>,
    /// This exposure's middle, the instant before, the instant after.
    neighbours: Option<[Neighbour<'a>; 3]>,
}

impl<'a> Observer<'a> {
    /// An observer of `stage`. `neighbours`, for motion: the scene at this exposure's middle, and at the middles of the
    /// exposures before and after (frames, or fields of an interlaced picture).
    #[must_use]
    pub fn new(
        scene: &'a Scene,
        stage: &'a Stage,
        accel: &'a Accel,
        materials: &'a Materials,
        camera: CameraRays,
        neighbours: Option<[Neighbour<'a>; 3]>,
    ) -> Self {
        Self { scene, stage, accel, materials, camera, keys: instance_keys(stage), neighbours }
    }

    /// The first surface at `film`; `None` for the sky. Surfaces with alpha below a half are looked through.
    #[must_use]
    pub fn first_hit(&self, film: FilmPoint, point: &Point<'_>) -> Option<FirstHit> {
        self.hit(film, self.camera.ray(film, point).ray)
    }

    /// The first surface at `film`, through the middle of the lens.
    #[must_use]
    pub fn first_hit_in_focus(&self, film: FilmPoint) -> Option<FirstHit> {
        self.hit(film, self.camera.middle_ray(film).ray)
    }

    fn hit(&self, film: FilmPoint, ray: Ray) -> Option<FirstHit> {
        let footprint = Footprint::point(0.5);
        let hit = self.accel.closest(&ray, |hit| {
            let s = self.accel.surface(self.scene, self.stage, &ray, hit);
            self.materials.alpha(self.scene, s.material, &s.uvs, s.color.w, footprint) >= 0.5
        })?;
        let surface = self.accel.surface(self.scene, self.stage, &ray, &hit);
        let material = &self.scene.materials[surface.material];
        let textured = material.base_color_texture.as_ref().map_or(glam::Vec4::ONE, |t| {
            self.materials.textures().fetch(self.scene, t, ColorSpace::Srgb, &surface.uvs, footprint)
        });
        let towards = if surface.normal.dot(ray.direction) > 0.0 { -surface.normal } else { surface.normal };
        let axis = -self.camera.camera().motion.at(film.u_time).matrix3.z_axis;
        #[allow(clippy::cast_possible_truncation, reason = "a fraction of a second")]
        let time_s = (self.stage.interval.duration() * f64::from(film.u_time)) as f32;
        Some(FirstHit {
            depth: hit.t * ray.direction.dot(axis),
            normal: Vec3::from(towards),
            albedo: (material.base_color * surface.color * textured).truncate(),
            time_s,
            motion: self.motion(&hit),
            object: u32::try_from(self.stage.instances[hit.instance as usize].node + 1).unwrap_or(u32::MAX),
        })
    }

    fn motion(&self, hit: &Hit) -> Option<[DVec2; 2]> {
        let [now, before, after] = self.neighbours.as_ref()?;
        let key = self.keys[hit.instance as usize];
        let here = now.picture_of(self.scene, key, hit)?;
        Some([before.picture_of(self.scene, key, hit)? - here, after.picture_of(self.scene, key, hit)? - here])
    }
}
