//! Case 1. Closed meshes let no ray out or in, also rays aimed exactly at vertices and edges.
//!
//! What could fail: three edge functions rounded so that no triangle around a vertex claims the ray; a box that ends
//! just short of the vertex. Bound: 0 leaks, by the argument in `trace::accel`'s triangle test. The twin is the test of
//! Möller and Trumbore, whose barycentric coordinates of neighbours are rounded apart.

use super::support::{Dice, build, deforming, ray, rest, scene, sphere, stage, torus};
use glam::{Affine3A, Quat, Vec3, Vec3A};
use graeco::scene::{Mesh, Motion};
use graeco::trace::Ray;

/// Where the k-th ray through `mesh` is aimed: at a vertex, at an edge's middle, or anywhere on an edge.
fn aim(mesh: &Mesh, position: &dyn Fn(u32) -> Vec3A, k: usize, dice: &mut Dice) -> Vec3A {
    let triangle = mesh.triangles[k / 9 % mesh.triangles.len()];
    let (a, b) = (position(triangle[k % 3]), position(triangle[(k + 1) % 3]));
    match k / 3 % 3 {
        0 => a,
        1 => (a + b) * 0.5,
        _ => {
            let w = dice.unit();
            a * w + b * (1.0 - w)
        }
    }
}

fn scaled(mesh: &Mesh, scale: f32, offset: f32) -> Vec<Vec3> {
    mesh.positions.iter().map(|&p| p * scale + Vec3::splat(offset)).collect()
}

/// Rays from `inside` at vertices and edges, and from far outside through them to `inside`: how many miss.
fn leaks(mesh: &Mesh, stage: &graeco::scene::Stage, inside: Vec3A, rays: usize) -> usize {
    let scene = scene(vec![mesh.clone()]);
    let accel = build(&scene, stage);
    let mut dice = Dice::new(11);
    let mut missed = 0;
    for k in 0..rays {
        let u_time = dice.unit();
        let position = |v: u32| {
            // Any triangle with the vertex gives its place at this time.
            let t = mesh.triangles.iter().position(|t| t.contains(&v)).unwrap();
            let corner = mesh.triangles[t].iter().position(|&i| i == v).unwrap();
            accel.triangle(&scene, stage, 0, u32::try_from(t).unwrap(), u_time)[corner]
        };
        let target = aim(mesh, &position, k, &mut dice);
        let way = target - inside;
        if way == Vec3A::ZERO {
            continue;
        }
        let outward = ray(inside, way, u_time);
        let inward = Ray { t_max: 1.0, ..ray(inside + way * 3.0, way * -3.0, u_time) };
        missed += usize::from(accel.closest(&outward, |_| true).is_none());
        missed += usize::from(!accel.occluded(&outward, |_| true));
        missed += usize::from(accel.closest(&inward, |_| true).is_none());
    }
    missed
}

fn still(mesh: &Mesh, scale: f32, offset: f32, inside: Vec3, rays: usize) {
    let moved = Mesh { positions: scaled(mesh, scale, offset), ..mesh.clone() };
    let inside = Vec3A::from(inside * scale + Vec3::splat(offset));
    let baked = stage(vec![(rest(0), Motion::still(Affine3A::IDENTITY), true)]);
    assert_eq!(leaks(&moved, &baked, inside, rays), 0, "scale {scale}, offset {offset}");
    let placed = Affine3A::from_scale_rotation_translation(Vec3::splat(scale), Quat::IDENTITY, Vec3::splat(offset));
    let placed = stage(vec![(rest(0), Motion::still(placed), false)]);
    assert_eq!(leaks(mesh, &placed, inside, rays), 0, "placed: scale {scale}, offset {offset}");
}

fn moving(mesh: &Mesh, scale: f32, offset: f32, inside: Vec3, rays: usize) {
    let mut dice = Dice::new(8);
    let begin = scaled(mesh, scale, offset);
    let end = begin.iter().map(|&p| p + dice.vec() * 0.05 * scale).collect();
    let moved = Mesh { positions: begin.clone(), ..mesh.clone() };
    let inside = Vec3A::from(inside * scale + Vec3::splat(offset));
    let geometry = deforming(0, vec![begin, end], vec![0.0, 1.0]);
    let stage = stage(vec![(geometry, Motion::still(Affine3A::IDENTITY), false)]);
    assert_eq!(leaks(&moved, &stage, inside, rays), 0, "moving: scale {scale}, offset {offset}");
}

fn all(rays: usize) {
    let (torus, sphere) = (torus(12, 0.1), sphere(2));
    for (mesh, inside) in [(&torus, Vec3::X), (&sphere, Vec3::new(0.1, 0.2, 0.05))] {
        for scale in [1e-6, 1.0, 1e6] {
            still(mesh, scale, 0.0, inside, rays);
            moving(mesh, scale, 0.0, inside, rays);
        }
        still(mesh, 1.0, 1e4, inside, rays);
        moving(mesh, 1.0, 1e4, inside, rays);
    }
    // A million sizes away one step of f32 is a sixteenth of the sphere: what is left of it is still closed.
    still(&sphere, 1.0, 1e6, Vec3::ZERO, rays);
    moving(&sphere, 1.0, 1e6, Vec3::ZERO, rays);
}

#[test]
fn no_ray_leaks_at_vertices_or_edges() {
    all(6_000);
}

#[test]
#[ignore = "ten million rays: minutes"]
fn none_of_ten_million_rays_leaks() {
    all(220_000);
}

#[test]
fn a_turning_body_is_closed_at_every_time() {
    let mesh = sphere(2);
    let pose = |angle: f32, at: f32| {
        Affine3A::from_scale_rotation_translation(
            Vec3::new(1.0, 2.0, 0.7),
            Quat::from_rotation_y(angle),
            Vec3::new(at, 0.0, 0.0),
        )
    };
    let motion = Motion::through(vec![0.0, 0.5, 1.0], vec![pose(0.0, -0.2), pose(0.7, 0.0), pose(1.4, 0.2)]);
    let stage = stage(vec![(rest(0), motion, false)]);
    assert_eq!(leaks(&mesh, &stage, Vec3A::ZERO, 20_000), 0);
}

/// Möller and Trumbore 1997, in `f32`.
fn naive(corners: [Vec3A; 3], ray: &Ray) -> bool {
    let (e1, e2) = (corners[1] - corners[0], corners[2] - corners[0]);
    let p = ray.direction.cross(e2);
    let inverse = 1.0 / e1.dot(p);
    let s = ray.origin - corners[0];
    let u = s.dot(p) * inverse;
    let q = s.cross(e1);
    let v = ray.direction.dot(q) * inverse;
    u >= 0.0 && v >= 0.0 && u + v <= 1.0 && e2.dot(q) * inverse > 0.0
}

#[test]
fn the_naive_test_leaks() {
    let mesh = sphere(2);
    let at = |v: u32| Vec3A::from(mesh.positions[v as usize]);
    let mut dice = Dice::new(1);
    let inside = Vec3A::new(0.1, 0.2, 0.05);
    let missed = (0..9_000)
        .filter(|&k| {
            let ray = ray(inside, aim(&mesh, &at, k, &mut dice) - inside, 0.0);
            !mesh.triangles.iter().any(|t| naive(t.map(at), &ray))
        })
        .count();
    assert!(missed > 20, "the rays are hard enough: {missed}");
}
