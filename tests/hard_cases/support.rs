//! Meshes, stages and rays that the cases share.

use glam::{Affine3A, Vec3, Vec3A};
use graeco::numeric::{mix64, unit_from_bits};
use graeco::scene::stage::VertexKey;
use graeco::scene::{Geometry, Instance, Material, Mesh, Motion, Projection, Scene, Stage, StageCamera};
use graeco::time::Exposure;
use graeco::trace::accel::Accel;
use graeco::trace::{Backs, Ray};

/// Numbers from a counter.
pub(crate) struct Dice(u64);

impl Dice {
    pub(crate) fn new(seed: u64) -> Self {
        Self(mix64(seed ^ 0x5851_f42d_4c95_7f2d))
    }

    #[allow(clippy::cast_possible_truncation, reason = "takes the upper half")]
    pub(crate) fn unit(&mut self) -> f32 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        unit_from_bits((mix64(self.0) >> 32) as u32)
    }

    pub(crate) fn signed(&mut self) -> f32 {
        2.0 * self.unit() - 1.0
    }

    pub(crate) fn vec(&mut self) -> Vec3 {
        Vec3::new(self.signed(), self.signed(), self.signed())
    }

    pub(crate) fn below(&mut self, n: usize) -> usize {
        #[allow(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            clippy::cast_precision_loss,
            reason = "small"
        )]
        let i = (self.unit() * n as f32) as usize;
        i.min(n - 1)
    }
}

/// A closed torus of `2 · n²` triangles, bumpy by `bumps`, around the origin; radii 1 and ½, so the origin is outside and
/// (1, 0, 0) inside. `n` = 24 gives 1152.
#[allow(clippy::cast_precision_loss, clippy::cast_possible_truncation, reason = "a small grid")]
pub(crate) fn torus(n: usize, bumps: f32) -> Mesh {
    let angle = |i: usize| std::f32::consts::TAU * i as f32 / n as f32;
    let mut dice = Dice::new(3);
    let mut mesh = Mesh::default();
    for i in 0..n {
        for j in 0..n {
            let (a, b) = (angle(i), angle(j));
            let r = 0.5 * (1.0 + bumps * dice.signed());
            let ring = 1.0 + r * libm::cosf(b);
            mesh.positions.push(Vec3::new(ring * libm::cosf(a), r * libm::sinf(b), ring * libm::sinf(a)));
            let at = |i: usize, j: usize| ((i % n) * n + j % n) as u32;
            let (p, q, r, s) = (at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1));
            mesh.triangles.extend([[p, r, q], [p, s, r]]);
        }
    }
    mesh
}

/// A closed, convex unit sphere of `8 · 4ⁿ` triangles, from an octahedron, seen from outside counter-clockwise.
pub(crate) fn sphere(subdivisions: u32) -> Mesh {
    let mut positions = vec![Vec3::X, Vec3::NEG_X, Vec3::Y, Vec3::NEG_Y, Vec3::Z, Vec3::NEG_Z];
    let mut triangles: Vec<[u32; 3]> =
        vec![[0, 2, 4], [2, 1, 4], [1, 3, 4], [3, 0, 4], [2, 0, 5], [1, 2, 5], [3, 1, 5], [0, 3, 5]];
    for _ in 0..subdivisions {
        let mut middles = std::collections::HashMap::new();
        let mut finer = Vec::new();
        for [a, b, c] in triangles {
            let mut middle = |i: u32, j: u32| {
                *middles.entry((i.min(j), i.max(j))).or_insert_with(|| {
                    positions.push((positions[i as usize] + positions[j as usize]).normalize());
                    u32::try_from(positions.len() - 1).unwrap()
                })
            };
            let (ab, bc, ca) = (middle(a, b), middle(b, c), middle(c, a));
            finer.extend([[a, ab, ca], [b, bc, ab], [c, ca, bc], [ab, bc, ca]]);
        }
        triangles = finer;
    }
    Mesh { positions, triangles, ..Mesh::default() }
}

/// A scene of double-sided `meshes`.
pub(crate) fn scene(meshes: Vec<Mesh>) -> Scene {
    let material = Material { double_sided: true, ..Material::default() };
    Scene { meshes, materials: vec![material], ..Scene::default() }
}

/// A mesh at rest.
pub(crate) fn rest(mesh: usize) -> Geometry {
    Geometry { mesh, keys: Vec::new(), times: Vec::new() }
}

/// A mesh that goes through `keys` at `times`.
pub(crate) fn deforming(mesh: usize, keys: Vec<Vec<Vec3>>, times: Vec<f32>) -> Geometry {
    let keys = keys.into_iter().map(|positions| VertexKey { positions, ..VertexKey::default() }).collect();
    Geometry { mesh, keys, times }
}

/// A stage of geometries, each placed once.
pub(crate) fn stage(placed: Vec<(Geometry, Motion, bool)>) -> Stage {
    let instances = placed
        .iter()
        .enumerate()
        .map(|(i, (_, motion, permanent))| Instance {
            geometry: i,
            motion: motion.clone(),
            node: i,
            permanent: *permanent,
        })
        .collect();
    Stage {
        interval: Exposure { open: 0.0, close: 1.0 },
        camera: StageCamera {
            motion: Motion::still(Affine3A::IDENTITY),
            projection: Projection::Perspective { yfov: 1.0, aspect: None },
            aperture_radius: 0.0,
            focus_distance: [1.0, 1.0],
        },
        geometries: placed.into_iter().map(|p| p.0).collect(),
        instances,
        lights: Vec::new(),
    }
}

/// One mesh that stands where it is.
pub(crate) fn single(mesh: Mesh, transform: Affine3A) -> (Scene, Stage) {
    (scene(vec![mesh]), stage(vec![(rest(0), Motion::still(transform), true)]))
}

/// A ray without end.
pub(crate) fn ray(origin: Vec3A, direction: Vec3A, u_time: f32) -> Ray {
    Ray { origin, direction, t_max: f32::INFINITY, u_time, backs: Backs::Stop }
}

/// `full` in an optimised build, `part` of it in one with debug assertions, which is some thirty times slower. The full
/// counts are those of docs/numerics.md; `cargo test --profile quick --test hard_cases` takes them.
pub(crate) fn count(full: usize, part: usize) -> usize {
    if cfg!(debug_assertions) { part } else { full }
}

/// The twin of the triangle test: Möller and Trumbore 1997, in `f32`, by early returns as it is usually written.
#[allow(
    clippy::manual_range_contains,
    reason = "what is not a number passes, as it does where this is usually written"
)]
pub(crate) fn moller_trumbore(corners: [Vec3A; 3], ray: &Ray) -> Option<f32> {
    let (e1, e2) = (corners[1] - corners[0], corners[2] - corners[0]);
    let p = ray.direction.cross(e2);
    let inverse = 1.0 / e1.dot(p);
    let s = ray.origin - corners[0];
    let u = s.dot(p) * inverse;
    if u < 0.0 || u > 1.0 {
        return None;
    }
    let q = s.cross(e1);
    let v = ray.direction.dot(q) * inverse;
    if v < 0.0 || u + v > 1.0 {
        return None;
    }
    let t = e2.dot(q) * inverse;
    if t <= 0.0 || t > ray.t_max { None } else { Some(t) }
}

/// The structures of `stage`.
pub(crate) fn build(scene: &Scene, stage: &Stage) -> Accel {
    Accel::build(scene, stage, None)
}
