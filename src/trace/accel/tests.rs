//! Whole structures against brute force over every triangle.
#![allow(clippy::cast_possible_truncation, reason = "test meshes are small")]

use super::*;
use crate::scene::stage::VertexKey;
use crate::scene::{Material, Mesh, Projection, StageCamera, TextureRef};
use crate::time::Exposure;
use glam::{Affine2, DVec3, Quat, Vec2, Vec3, Vec3A};
use proptest::prelude::*;
use rand_pcg::rand_core::{Rng, SeedableRng};

pub(super) struct Dice(rand_pcg::Pcg64);

impl Dice {
    pub(super) fn new(seed: u64) -> Self {
        Self(rand_pcg::Pcg64::seed_from_u64(seed))
    }

    pub(super) fn unit(&mut self) -> f32 {
        crate::numeric::unit_from_bits(self.0.next_u32())
    }

    pub(super) fn vec(&mut self) -> Vec3 {
        Vec3::new(self.unit(), self.unit(), self.unit()) * 2.0 - 1.0
    }
}

pub(super) fn stage(geometries: Vec<Geometry>, instances: Vec<Instance>) -> Stage {
    Stage {
        interval: Exposure { open: 0.0, close: 1.0 },
        camera: StageCamera {
            motion: Motion::still(Affine3A::IDENTITY),
            projection: Projection::Perspective { yfov: 1.0, aspect: None },
            aperture_radius: 0.0,
            focus_distance: [1.0, 1.0],
        },
        geometries,
        instances,
        lights: Vec::new(),
    }
}

fn soup(dice: &mut Dice, triangles: usize, size: f32) -> Mesh {
    let mut mesh = Mesh::default();
    for i in 0..triangles as u32 {
        let centre = dice.vec();
        mesh.positions.extend((0..3).map(|_| centre + dice.vec() * size));
        mesh.triangles.push([3 * i, 3 * i + 1, 3 * i + 2]);
    }
    mesh
}

fn deformed(dice: &mut Dice, mesh: &Mesh, keys: usize) -> Geometry {
    let key = |dice: &mut Dice| VertexKey {
        positions: mesh.positions.iter().map(|&p| p + dice.vec() * 0.2).collect(),
        ..VertexKey::default()
    };
    let last = (keys - 1) as f32;
    let times = (0..keys).map(|i| if keys == 4 { [0.0, 0.3, 0.3, 1.0][i] } else { i as f32 / last }).collect();
    Geometry { mesh: 0, keys: (0..keys).map(|_| key(dice)).collect(), times }
}

fn pose(dice: &mut Dice) -> Affine3A {
    let q = Quat::from_rotation_y(dice.unit() * 6.0) * Quat::from_rotation_x(dice.unit() * 6.0);
    let scale = Vec3::splat(0.5) + dice.vec().abs();
    let scale = if dice.unit() < 0.3 { scale * Vec3::new(-1.0, 1.0, 1.0) } else { scale };
    Affine3A::from_scale_rotation_translation(scale, q, dice.vec())
}

fn moving(dice: &mut Dice, keys: usize) -> Motion {
    match keys {
        0 => Motion::still(Affine3A::IDENTITY),
        1 => Motion::still(pose(dice)),
        n => Motion::through((0..n).map(|i| i as f32 / (n - 1) as f32).collect(), (0..n).map(|_| pose(dice)).collect()),
    }
}

fn scene(meshes: Vec<Mesh>, double_sided: bool) -> Scene {
    Scene { meshes, materials: vec![Material { double_sided, ..Material::default() }], ..Scene::default() }
}

/// Distance, in f64, at which a ray meets a triangle's plane, and how far within the triangle that is, as a part of it.
fn met(corners: [Vec3A; 3], ray: &Ray) -> Option<(f64, f64)> {
    let [a, b, c] = corners.map(|p| p.as_dvec3());
    let (o, d) = (ray.origin.as_dvec3(), ray.direction.as_dvec3());
    let n = (b - a).cross(c - a);
    let t = n.dot(a - o) / n.dot(d);
    let p = o + d * t;
    let part = |x: DVec3, y: DVec3| (y - x).cross(p - x).dot(n) / n.length_squared();
    let margin = part(a, b).min(part(b, c)).min(part(c, a));
    (t > 0.0).then_some((t, margin))
}

/// What rounding may move a plane by, metres: some twenty times half a unit in the last place of 8 m.
const PLANE: f64 = 2e-5;

/// How far rounding may move a hit along a ray, in lengths of its direction: what it moves the plane by, over the cosine
/// between the two.
fn slack([a, b, c]: [Vec3A; 3], ray: &Ray) -> f64 {
    let n = (b - a).as_dvec3().cross((c - a).as_dvec3());
    PLANE / n.normalize_or_zero().dot(ray.direction.as_dvec3()).abs()
}

/// Length over width of a triangle: how much further rounding may move a hit along a splinter than across a round one.
fn slenderness([a, b, c]: [Vec3A; 3]) -> f64 {
    let [a, b, c] = [a, b, c].map(|p| p.as_dvec3());
    let long = (b - a).length_squared().max((c - b).length_squared()).max((a - c).length_squared());
    long / (b - a).cross(c - a).length()
}

/// Frobenius condition number: poses on either side of a mirroring flatten what is blended between them, and how far along
/// a ray lies in what is nearly flat is known that much less.
fn condition(m: &Affine3A) -> f64 {
    let m = glam::DMat3::from_cols(m.x_axis.as_dvec3(), m.y_axis.as_dvec3(), m.z_axis.as_dvec3());
    let size = |m: glam::DMat3| m.to_cols_array().iter().map(|x| x * x).sum::<f64>().sqrt();
    size(m) * size(m.inverse())
}

/// How far from a triangle's edges, as a part of it, rounding may move a hit.
fn unsure(condition: f64) -> f64 {
    1e-4_f64.max(1e-6 * condition)
}

fn random_ray(dice: &mut Dice) -> Ray {
    let origin = Vec3A::from(dice.vec()) * 3.0;
    let direction = (Vec3A::from(dice.vec()) - origin) * (0.1 + dice.unit());
    Ray { origin, direction, t_max: f32::INFINITY, u_time: dice.unit(), backs: Backs::Pass }
}

/// How many rays hit; compares `closest` and `occluded` with all triangles, and both kernels with each other.
fn compare(scene: &Scene, stage: &Stage, rays: usize, dice: &mut Dice) -> usize {
    let accel = Accel::build(scene, stage, None);
    let mut portable = Accel::build(scene, stage, Some(&accel));
    portable.kernel = Kernel::Portable;
    // And as a structure walks that is too deep for a thread's room.
    portable.waiting = ROOM + 1;
    // Nor does a walk need more than was counted.
    let room = vec![Cell::new(0); accel.waiting];
    let mut hits = 0;
    for _ in 0..rays {
        let ray = random_ray(dice);
        let hit = accel.closest(&ray, |_| true);
        assert_eq!(hit.map(|h| h.t.to_bits()), portable.closest(&ray, |_| true).map(|h| h.t.to_bits()));
        assert_eq!(hit, portable.closest(&ray, |_| true));
        assert_eq!(hit.is_some(), accel.occluded(&ray, |_| true));
        assert_eq!(hit, accel.run_on::<false>(&ray, &|_| true, &room).map(|found| accel.hit(&found)));
        assert_eq!(hit.is_some(), accel.run_on::<true>(&ray, &|_| true, &room).is_some());
        let (mut nearest, mut by) = (f64::INFINITY, String::new());
        for (i, instance) in stage.instances.iter().enumerate() {
            let mesh = &scene.meshes[stage.geometries[instance.geometry].mesh];
            for t in 0..mesh.triangles.len() {
                let corners = accel.triangle(scene, stage, i as u32, t as u32, ray.u_time);
                let flattened = condition(&instance.motion.at(ray.u_time));
                if let Some((d, margin)) = met(corners, &ray)
                    && margin > unsure(flattened)
                {
                    let d = d + slack(corners, &ray) * flattened;
                    if d < nearest {
                        nearest = d;
                        by = format!("triangle {t} of instance {i}, {margin} within, condition {flattened}");
                    }
                }
            }
        }
        if let Some(h) = hit {
            hits += 1;
            let corners = accel.triangle(scene, stage, h.instance, h.triangle, ray.u_time);
            let flattened = condition(&stage.instances[h.instance as usize].motion.at(ray.u_time));
            let (d, margin) = met(corners, &ray).unwrap_or_else(|| panic!("{h:?} is no hit of {ray:?}"));
            assert!(margin > -unsure(flattened), "{h:?} is no hit of {ray:?}: {margin}");
            let slack = slack(corners, &ray);
            assert!((d - f64::from(h.t)).abs() <= slack, "{h:?} lies at {d}");
            assert!(f64::from(h.t) <= nearest + slack, "{h:?} is hidden at {nearest} by {by}");
            let surface = accel.surface(scene, stage, &ray, &h);
            let off = f64::from((ray.origin + ray.direction * h.t).distance(surface.position));
            let bound = slack * f64::from(ray.direction.length()) * slenderness(corners) * flattened;
            assert!(off <= bound, "{off} of {bound}: {h:?} of {ray:?} in {corners:?}");
            assert!(surface.normal.is_normalized() && surface.geometric_normal.is_normalized());
        } else {
            assert!(nearest.is_infinite(), "missed {nearest}: {by}");
        }
    }
    hits
}

fn all_kinds(seed: u64, permanent: bool) {
    let mut dice = Dice::new(seed);
    let mesh = soup(&mut dice, 40, 0.3);
    let scene = scene(vec![mesh], true);
    let geometries = [0, 1, 2, 3, 4].map(|keys| match keys {
        0 => Geometry { mesh: 0, keys: Vec::new(), times: Vec::new() },
        1 => Geometry { keys: deformed(&mut dice, &scene.meshes[0], 2).keys[..1].to_vec(), times: Vec::new(), mesh: 0 },
        n => deformed(&mut dice, &scene.meshes[0], n),
    });
    let instances = (0..10)
        .map(|i| Instance {
            geometry: i % 5,
            motion: moving(&mut dice, i % 4),
            node: i,
            permanent: permanent && i % 5 < 2 && i % 4 < 2,
        })
        .collect();
    let hits = compare(&scene, &stage(geometries.into(), instances), 200, &mut dice);
    assert!(hits > 10, "rays meet something: {hits}");
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(40))]
    #[test]
    fn every_kind_of_motion_agrees_with_brute_force(seed: u64, permanent: bool) {
        all_kinds(seed, permanent);
    }

    /// Small things in a large world, still or moving: most rays are spared the top level.
    #[test]
    fn what_a_guard_spares_agrees_with_brute_force(seed: u64, keys in 1_usize..5) {
        let mut dice = Dice::new(seed);
        let scene = scene(vec![soup(&mut dice, 40, 0.3)], true);
        let rest = || Geometry { mesh: 0, keys: Vec::new(), times: Vec::new() };
        let world = Motion::still(Affine3A::from_scale(Vec3::splat(3.0)));
        let mut instances = vec![Instance { geometry: 0, motion: world, node: 0, permanent: true }];
        for node in 1..3 {
            let small = |m: &Affine3A| *m * Affine3A::from_scale(Vec3::splat(0.2));
            let motion = moving(&mut dice, keys);
            let motion = match keys {
                1 => Motion::still(small(&motion.keys()[0])),
                _ => Motion::through(motion.times().to_vec(), motion.keys().iter().map(small).collect()),
            };
            instances.push(Instance { geometry: 1, motion, node, permanent: false });
        }
        let stage = stage(vec![rest(), rest()], instances);
        prop_assert!(Accel::build(&scene, &stage, None).structures.guard.is_some());
        compare(&scene, &stage, 200, &mut dice);
    }

    #[test]
    fn still_triangles_agree_with_brute_force(seed: u64, count in 1_usize..300) {
        let mut dice = Dice::new(seed);
        let scene = scene(vec![soup(&mut dice, count, 0.8)], true);
        let geometry = Geometry { mesh: 0, keys: Vec::new(), times: Vec::new() };
        let motion = moving(&mut dice, 1);
        let stage = stage(vec![geometry], vec![Instance { geometry: 0, motion, node: 0, permanent: true }]);
        compare(&scene, &stage, 100, &mut dice);
    }
}

/// Two triangles alike in all but their material: texture coordinates have gradients where a texture is read, along the
/// edges that they run along, and none where nothing would read them.
#[test]
fn texture_gradients_are_found_where_textures_are_read() {
    let triangle = |material: usize| Mesh {
        positions: vec![Vec3::ZERO, Vec3::X * 2.0, Vec3::Y * 4.0],
        triangles: vec![[0, 1, 2]],
        uvs: vec![vec![Vec2::ZERO, Vec2::X, Vec2::Y]],
        material,
        ..Mesh::default()
    };
    let reference = TextureRef { texture: 0, uv_set: 0, transform: Affine2::IDENTITY };
    let mut scene = scene(vec![triangle(0), triangle(1)], true);
    scene.materials.push(Material { base_color_texture: Some(reference), ..scene.materials[0].clone() });
    let gradients = |mesh: usize| {
        let geometry = Geometry { mesh, keys: Vec::new(), times: Vec::new() };
        let motion = Motion::still(Affine3A::IDENTITY);
        let stage = stage(vec![geometry], vec![Instance { geometry: 0, motion, node: 0, permanent: true }]);
        let accel = Accel::build(&scene, &stage, None);
        let (origin, direction) = (Vec3A::new(0.3, 0.4, 1.0), Vec3A::NEG_Z);
        let ray = Ray { origin, direction, t_max: f32::INFINITY, u_time: 0.0, backs: Backs::Pass };
        let hit = accel.closest(&ray, |_| true).unwrap();
        accel.surface(&scene, &stage, &ray, &hit).uv_gradients
    };
    assert_eq!(gradients(0), None);
    assert_eq!(gradients(1), Some([Vec3A::X * 0.5, Vec3A::Y * 0.25]));
}
