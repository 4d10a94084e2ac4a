//! Case 3. Degenerate, duplicate, extreme and absent geometry.
//!
//! What could fail: an infinite loop or a deep recursion over identical boxes; a zero or infinite determinant; a hit
//! that depends on the order of building. Bound: degenerate triangles are never hit, coincident ones give the first, and
//! everything else is found.

use super::support::{Dice, build, ray, rest, scene, single, stage};
use glam::{Affine3A, Vec3, Vec3A};
use graeco::scene::{Mesh, Motion};
use graeco::trace::Ray;

fn triangle() -> Mesh {
    Mesh {
        positions: vec![Vec3::new(-1.0, -1.0, 0.0), Vec3::new(1.0, -1.0, 0.0), Vec3::new(0.0, 1.0, 0.0)],
        triangles: vec![[0, 1, 2]],
        ..Mesh::default()
    }
}

fn ahead() -> Ray {
    ray(Vec3A::new(0.1, 0.0, 3.0), Vec3A::NEG_Z, 0.5)
}

#[test]
fn an_empty_stage_is_met_by_nothing() {
    let accel = build(&scene(Vec::new()), &stage(Vec::new()));
    assert!(accel.closest(&ahead(), |_| true).is_none() && !accel.occluded(&ahead(), |_| true));
    assert!(accel.bounds().is_empty());
    let (scene, stage) = single(Mesh::default(), Affine3A::IDENTITY);
    let accel = build(&scene, &stage);
    assert!(accel.closest(&ahead(), |_| true).is_none() && accel.bounds().is_empty());
}

#[test]
fn one_triangle_is_met_along_axes_of_any_length() {
    let (scene, stage) = single(triangle(), Affine3A::IDENTITY);
    let accel = build(&scene, &stage);
    for length in [1e-20, 1e-6, 1.0, 1e6, 1e20_f32] {
        let ray = ray(Vec3A::new(0.1, 0.0, 3.0), Vec3A::NEG_Z * length, 0.0);
        let hit = accel.closest(&ray, |_| true).unwrap_or_else(|| panic!("length {length}"));
        assert!((hit.t * length - 3.0).abs() < 1e-5, "{hit:?}");
        let behind = Ray { direction: -ray.direction, ..ray };
        assert!(accel.closest(&behind, |_| true).is_none());
        assert!(accel.closest(&Ray { t_max: 2.9 / length, ..ray }, |_| true).is_none());
        // In its plane it is a line.
        let in_plane = Ray { origin: Vec3A::new(-5.0, 0.0, 0.0), direction: Vec3A::X * length, ..ray };
        assert!(accel.closest(&in_plane, |_| true).is_none());
    }
    let nowhere = ray(Vec3A::Z, Vec3A::ZERO, 0.0);
    assert!(accel.closest(&nowhere, |_| true).is_none());
}

#[test]
fn a_million_copies_of_one_point_are_no_trouble() {
    let mut mesh = triangle();
    mesh.positions.extend(vec![Vec3::new(0.1, 0.0, 1.0); 3]);
    mesh.triangles.extend(vec![[3, 4, 5]; 1_000_000]);
    let (scene, stage) = single(mesh, Affine3A::IDENTITY);
    let accel = build(&scene, &stage);
    assert_eq!(accel.stats().still_triangles, 1, "points cannot be met and are not kept");
    assert_eq!(accel.closest(&ahead(), |_| true).map(|h| h.triangle), Some(0));
}

#[test]
fn coincident_triangles_give_the_first() {
    let mut mesh = triangle();
    mesh.triangles = vec![[0, 1, 2]; 20_000];
    let (scene, mut stage) = single(mesh, Affine3A::IDENTITY);
    let again = stage.instances[0].clone();
    stage.instances.push(again);
    let accel = build(&scene, &stage);
    let hit = accel.closest(&ahead(), |_| true).unwrap();
    assert_eq!((hit.instance, hit.triangle), (0, 0));
    // Refusing some gives the first of the rest, whatever the order of traversal.
    let hit = accel.closest(&ahead(), |h| h.triangle != 0 || h.instance != 0);
    assert!(hit.is_some(), "an opaque surface is not asked about");
}

#[test]
fn needles_are_found() {
    let mut dice = Dice::new(6);
    let mut mesh = Mesh::default();
    for i in 0..2000_u32 {
        let (p, along) = (dice.vec() * 10.0, dice.vec() * 5.0);
        mesh.positions.extend([p, p + along, p + along * 0.5 + dice.vec() * 1e-4]);
        mesh.triangles.push([3 * i, 3 * i + 1, 3 * i + 2]);
    }
    let (scene, stage) = single(mesh, Affine3A::IDENTITY);
    let accel = build(&scene, &stage);
    for i in 0..2000 {
        let [a, b, c] = accel.triangle(&scene, &stage, 0, i, 0.0);
        let target = (a + b + c) / 3.0;
        let normal = (b - a).cross(c - a);
        // The aim itself is rounded to some 1e-6.
        if normal.length() < 2e-5 * (b - a).length() {
            continue;
        }
        let normal = normal.normalize();
        let hit = accel.closest(&ray(target + normal, -normal, 0.0), |_| true);
        assert!(hit.is_some_and(|h| h.t <= 1.0001), "needle {i}");
    }
}

#[test]
fn huge_ranges_and_wild_numbers_are_survived() {
    let mut mesh = triangle();
    for i in 0..400_u16 {
        let x = libm::powf(10.0, -30.0 + 0.15 * f32::from(i));
        let n = u32::try_from(mesh.positions.len()).unwrap();
        mesh.positions.extend([
            Vec3::new(x, 9.0, 0.0),
            Vec3::new(x * 1.01, 9.0, 0.0),
            Vec3::new(x, 9.0 + x * 0.01, 0.0),
        ]);
        mesh.triangles.push([n, n + 1, n + 2]);
    }
    for bad in [f32::NAN, f32::INFINITY, f32::MAX] {
        let n = u32::try_from(mesh.positions.len()).unwrap();
        mesh.positions.extend([Vec3::splat(bad), Vec3::ONE, Vec3::Y]);
        mesh.triangles.push([n, n + 1, n + 2]);
    }
    let (scene, stage) = single(mesh, Affine3A::IDENTITY);
    let accel = build(&scene, &stage);
    assert_eq!(accel.closest(&ahead(), |_| true).map(|h| h.triangle), Some(0));
}

#[test]
fn extreme_and_singular_scales_keep_what_can_be_seen() {
    for scale in [1e-12, 1e-6, 1.0, 1e6, 1e12_f32] {
        let (scene, stage) = single(triangle(), Affine3A::from_scale(Vec3::splat(scale)));
        let accel = build(&scene, &stage);
        let ray = ray(Vec3A::new(0.1, 0.0, 3.0) * scale, Vec3A::NEG_Z, 0.0);
        let hit = accel.closest(&ray, |_| true).unwrap_or_else(|| panic!("scale {scale}"));
        assert!((hit.t / scale - 3.0).abs() < 1e-5);
    }
    // Squashed flat along its own normal and moving: still a triangle.
    let flat = |x: f32| {
        Affine3A::from_scale_rotation_translation(
            Vec3::new(1.0, 1.0, 0.0),
            glam::Quat::IDENTITY,
            Vec3::new(x, 0.0, 0.0),
        )
    };
    let motion = Motion::through(vec![0.0, 1.0], vec![flat(-1.0), flat(1.0)]);
    let (scene, stage) = (scene(vec![triangle()]), stage(vec![(rest(0), motion, false)]));
    let accel = build(&scene, &stage);
    let ray = ahead();
    let hit = accel.closest(&ray, |_| true).expect("a flat thing is seen");
    let surface = accel.surface(&scene, &stage, &ray, &hit);
    assert!(
        surface.geometric_normal.abs_diff_eq(Vec3A::Z, 1e-6) || surface.geometric_normal.abs_diff_eq(-Vec3A::Z, 1e-6)
    );
}

#[test]
fn structures_kept_between_frames_give_the_same_hits() {
    let (scene, stage) = single(super::support::torus(16, 0.2), Affine3A::IDENTITY);
    let first = build(&scene, &stage);
    let second = graeco::trace::accel::Accel::build(&scene, &stage, Some(&first));
    assert_eq!((second.stats().reused, second.stats().built), (1, 0));
    let mut dice = Dice::new(1);
    for _ in 0..500 {
        let ray = ray(Vec3A::from(dice.vec()) * 4.0, Vec3A::from(dice.vec()), 0.0);
        assert_eq!(first.closest(&ray, |_| true), second.closest(&ray, |_| true));
    }
}
