//! Case 1. Closed meshes let no ray out or in, also rays aimed exactly at vertices and edges.
//!
//! What could fail: three edge functions rounded so that no triangle around a vertex claims the ray; a box that ends
//! just short of the vertex. Bound: 0 leaks, by the argument in `trace::accel`'s triangle test. The twin is the test of
//! Möller and Trumbore, whose barycentric coordinates of neighbours are rounded apart.

use super::support::{Dice, build, count, deforming, moller_trumbore, ray, rest, scene, sphere, stage, torus};
use glam::{Affine3A, Quat, Vec3, Vec3A};
use graeco::scene::{Mesh, Motion, Stage};
use graeco::trace::Ray;
use rayon::prelude::*;
use std::collections::HashMap;
use std::sync::atomic::{AtomicUsize, Ordering};

/// A closed random triangulation of a star around the origin: an octahedron whose edges are split at random places
/// `splits` times, each new vertex at a random distance, so that no vertex lies on an edge (T-free) and slivers abound.
fn splinters(splits: usize) -> Mesh {
    let mut dice = Dice::new(77);
    let Mesh { mut positions, mut triangles, .. } = sphere(0);
    let mut beside: HashMap<(u32, u32), u32> = HashMap::new();
    for _ in 0..splits {
        beside.clear();
        let third = triangles.iter().flat_map(|&[a, b, c]| [((a, b), c), ((b, c), a), ((c, a), b)]);
        beside.extend(third);
        let t = triangles[dice.below(triangles.len())];
        let corner = dice.below(3);
        let (a, b) = (t[corner], t[(corner + 1) % 3]);
        let (c, d) = (beside[&(a, b)], beside[&(b, a)]);
        let w = 0.02 + 0.96 * dice.unit();
        let way = positions[a as usize].normalize() * w + positions[b as usize].normalize() * (1.0 - w);
        let new = u32::try_from(positions.len()).unwrap();
        positions.push(way.normalize() * (0.9 + 0.2 * dice.unit()));
        let gone = |t: &[u32; 3], x: u32, y: u32| (0..3).any(|i| t[i] == x && t[(i + 1) % 3] == y);
        triangles.retain(|t| !gone(t, a, b) && !gone(t, b, a));
        triangles.extend([[a, new, c], [new, b, c], [b, new, d], [new, a, d]]);
    }
    Mesh { positions, triangles, ..Mesh::default() }
}

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

/// Rays that were aimed, over all tests.
static AIMED: AtomicUsize = AtomicUsize::new(0);

/// Aims `pairs` of rays at vertices and edges of `mesh`, where `position` puts a vertex at a time: one from `inside`,
/// one from far outside through the same place to the inside. How many of them `misses`.
fn missed(
    mesh: &Mesh,
    position: &(dyn Fn(u32, f32) -> Vec3A + Sync),
    inside: Vec3A,
    pairs: usize,
    misses: &(dyn Fn(&Ray) -> bool + Sync),
) -> usize {
    const PARTS: usize = 32;
    AIMED.fetch_add(2 * pairs, Ordering::Relaxed);
    let part = |part: usize| -> usize {
        let mut dice = Dice::new(11 + part as u64);
        let mut missed = 0;
        for k in (part..pairs).step_by(PARTS) {
            let u_time = dice.unit();
            let way = aim(mesh, &|v| position(v, u_time), k, &mut dice) - inside;
            if way != Vec3A::ZERO {
                let outside = inside + way * 3.0;
                missed += usize::from(misses(&ray(inside, way, u_time)));
                missed += usize::from(misses(&ray(outside, inside + way - outside, u_time)));
            }
        }
        missed
    };
    (0..PARTS).into_par_iter().map(part).sum()
}

/// The rays of [`missed`] against the structures of `stage`.
fn leaks(mesh: &Mesh, stage: &Stage, inside: Vec3A, pairs: usize) -> usize {
    let scene = scene(vec![mesh.clone()]);
    let accel = build(&scene, stage);
    // Any triangle with a vertex gives its place at a time.
    let mut owner = vec![(0, 0); mesh.positions.len()];
    for (t, triangle) in (0_u32..).zip(&mesh.triangles) {
        (0..3).for_each(|corner| owner[triangle[corner] as usize] = (t, corner));
    }
    let position = |v: u32, u_time: f32| {
        let (t, corner) = owner[v as usize];
        accel.triangle(&scene, stage, 0, t, u_time)[corner]
    };
    let misses = |ray: &Ray| accel.closest(ray, |_| true).is_none() || !accel.occluded(ray, |_| true);
    missed(mesh, &position, inside, pairs, &misses)
}

fn scaled(mesh: &Mesh, scale: f32, offset: f32) -> Vec<Vec3> {
    mesh.positions.iter().map(|&p| p * scale + Vec3::splat(offset)).collect()
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

/// A body that turns, grows and passes through its place while the exposure lasts.
fn turning(mesh: &Mesh, scale: f32, offset: f32, pairs: usize) {
    let pose = |angle: f32, at: f32| {
        Affine3A::from_scale_rotation_translation(
            Vec3::new(1.0, 2.0, 0.7) * scale,
            Quat::from_rotation_y(angle),
            Vec3::new(at, 0.0, 0.0) * scale + Vec3::splat(offset),
        )
    };
    let motion = Motion::through(vec![0.0, 0.5, 1.0], vec![pose(0.0, -0.2), pose(0.7, 0.0), pose(1.4, 0.2)]);
    let stage = stage(vec![(rest(0), motion, false)]);
    assert_eq!(leaks(mesh, &stage, Vec3A::splat(offset), pairs), 0, "turning: scale {scale}, offset {offset}");
}

/// Ten million rays in an optimised build, 10⁵ in one with debug assertions.
#[test]
fn no_ray_leaks_at_vertices_or_edges() {
    let pairs = count(56_000, 600);
    let begun = AIMED.load(Ordering::Relaxed);
    let (torus, sphere, splinters) = (torus(12, 0.1), sphere(2), splinters(300));
    let within = Vec3::new(0.1, 0.2, 0.05);
    for (mesh, inside) in [(&torus, Vec3::X), (&sphere, within), (&splinters, within)] {
        for (scale, offset) in [(1e-6, 0.0), (1.0, 0.0), (1e6, 0.0), (1.0, 1e4), (1e-6, 1e-2), (1e6, 1e10)] {
            still(mesh, scale, offset, inside, pairs);
            moving(mesh, scale, offset, inside, pairs);
        }
        // A million sizes away one step of f32 is a sixteenth of the body: what is left of it is still closed.
        let inside = if inside == Vec3::X { inside } else { Vec3::ZERO };
        for scale in [1e-6, 1.0, 1e6] {
            still(mesh, scale, 1e6 * scale, inside, pairs);
            moving(mesh, scale, 1e6 * scale, inside, pairs);
        }
    }
    for scale in [1e-6, 1.0, 1e6] {
        for offset in [0.0, 1e4, 1e6] {
            turning(&sphere, scale, offset * scale, pairs);
        }
        // Far away the narrowest splinters would no longer hold the rays' origin.
        turning(&splinters, scale, 1e3 * scale, pairs);
    }
    let aimed = AIMED.load(Ordering::Relaxed) - begun;
    println!("rays at vertices and edges: {aimed} aimed, 0 leaked");
    assert!(aimed >= count(10_000_000, 100_000), "{aimed}");
}

#[test]
fn the_random_triangulation_is_closed_and_full_of_slivers() {
    let mesh = splinters(300);
    let mut edges = HashMap::new();
    for &[a, b, c] in &mesh.triangles {
        for edge in [(a, b), (b, c), (c, a)] {
            assert!(edges.insert(edge, ()).is_none(), "an edge runs once in each direction");
        }
    }
    assert!(edges.keys().all(|&(a, b)| edges.contains_key(&(b, a))), "every edge has two sides");
    let thin = |t: &&[u32; 3]| {
        let [a, b, c] = t.map(|i| mesh.positions[i as usize]);
        let longest = a.distance(b).max(b.distance(c)).max(c.distance(a));
        (b - a).cross(c - a).length() < 0.05 * longest * longest
    };
    assert!(mesh.triangles.iter().filter(thin).count() > 10);
}

#[test]
fn the_naive_test_leaks() {
    for mesh in [sphere(2), splinters(300)] {
        let position = |v: u32, _: f32| Vec3A::from(mesh.positions[v as usize]);
        let misses =
            |ray: &Ray| !mesh.triangles.iter().any(|t| moller_trumbore(t.map(|v| position(v, 0.0)), ray).is_some());
        let lost = missed(&mesh, &position, Vec3A::new(0.1, 0.2, 0.05), 4_500, &misses);
        println!("the naive test loses {lost} of 9000 rays");
        assert!(lost > 20, "the rays are hard enough: {lost}");
    }
}
