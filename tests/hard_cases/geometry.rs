//! Case 3. Degenerate, duplicate, extreme and absent geometry.
//!
//! What could fail: an infinite loop or a deep recursion over identical boxes; a zero or infinite determinant; a hit
//! that depends on the order of building; an index past the end. Bound: degenerate triangles are never hit, coincident
//! ones give the first, everything else is found, and what is no number never gets past the loader. Twins: the test of
//! Möller and Trumbore, bins by centroids, the nearest by `<=`, normals in `f32`.

use super::support::{Dice, build, count, moller_trumbore, ray, rest, scene, single, stage};
use glam::{Affine3A, Vec3, Vec3A};
use graeco::scene::gltf::{LoadOptions, load};
use graeco::scene::{Mesh, Motion, Scene};
use graeco::trace::{Hit, Ray};

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

/// Bound: a triangle without area is met by no ray, aimed at it as exactly as can be. Twin: the usual test, whose
/// quotients by zero fail every comparison that would refuse them.
#[test]
fn triangles_without_area_are_met_by_nothing() {
    let mut mesh = triangle();
    // A point, a segment with its corners in every order, and one whose corners are collinear but for a rounding.
    let p = Vec3::new(0.1, 0.0, 1.0);
    for corners in [[p, p, p], [p, p, p + Vec3::X], [p - Vec3::X, p + Vec3::X, p], [p, p - Vec3::Y, p + Vec3::Y * 3.0]]
    {
        let n = u32::try_from(mesh.positions.len()).unwrap();
        mesh.positions.extend(corners);
        mesh.triangles.push([n, n + 1, n + 2]);
    }
    let (scene, stage) = single(mesh.clone(), Affine3A::IDENTITY);
    let accel = build(&scene, &stage);
    let hit = accel.closest(&ahead(), |_| true).unwrap();
    assert_eq!((hit.triangle, hit.t), (0, 3.0));
    let corners = |t: usize| mesh.triangles[t].map(|i| Vec3A::from(mesh.positions[i as usize]));
    let fooled =
        (1..5).filter(|&t| moller_trumbore(corners(t), &ahead()).is_some_and(|t| t.is_nan() || t <= 0.0)).count();
    assert!(fooled > 0, "the twin went unnoticed");
}

/// Bound: time and memory grow with the number alone, and depth stays below 40 + log₂ n (`trace::accel::topology`).
/// Twin: bins of centroids, which all coincide.
#[test]
fn ten_million_copies_of_one_point_are_no_trouble() {
    let copies = count(10_000_000, 300_000);
    let at = Vec3::new(0.1, 0.0, 1.0);
    let mut mesh = triangle();
    mesh.positions.extend(std::iter::repeat_n(at, copies));
    let n = u32::try_from(copies / 3).unwrap();
    mesh.triangles.extend((0..n).map(|i| [3 + 3 * i, 4 + 3 * i, 5 + 3 * i]));
    let (scene, stage) = single(mesh, Affine3A::IDENTITY);
    let accel = build(&scene, &stage);
    assert_eq!(accel.stats().still_triangles, 1, "points cannot be met and are not kept");
    assert_eq!(accel.closest(&ahead(), |_| true).map(|h| h.triangle), Some(0));
    drop((accel, scene));
    // As many of a triangle as small as can be, which is met.
    let mut mesh = triangle();
    mesh.positions.extend([at, at + Vec3::X * 1e-7, at + Vec3::Y * 1e-7]);
    mesh.triangles.extend(std::iter::repeat_n([3, 4, 5], copies / 10));
    let (scene, stage) = single(mesh, Affine3A::IDENTITY);
    let accel = build(&scene, &stage);
    assert!(accel.stats().still_triangles > copies / 10);
    assert_eq!(accel.closest(&ahead(), |_| true).map(|h| h.triangle), Some(1), "the first of the equal ones");
    let bin = |centroid: f32, low: f32, high: f32| 16.0 * (centroid - low) / (high - low);
    assert!(bin(0.1, 0.1, 0.1).is_nan(), "the twin went unnoticed");
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
    // The twin keeps the last that is no farther: its answer is the order's.
    let nearest = |order: &mut dyn Iterator<Item = usize>| {
        order.fold((9.0, 0), |best, i| if 3.0 <= best.0 { (3.0, i) } else { best })
    };
    assert_ne!(nearest(&mut (0..3)), nearest(&mut (0..3).rev()), "the twin went unnoticed");
}

/// Bound: coplanar surfaces that share no vertex are told apart the same way by every tree: the hits, bit for bit, are
/// those of a structure that holds 2000 triangles more. Twin: a pick by the order of a tree's leaves.
#[test]
fn coplanar_surfaces_are_told_apart_alike_by_every_tree() {
    let patches = |turn: f32| {
        let mut mesh = Mesh::default();
        for i in 0..60_u32 {
            let (angle, n) = (turn + 0.7 * i as f32, 3 * i);
            let corner =
                |k: f32| Vec3::new(libm::cosf(angle + k), libm::sinf(angle + k), 0.0) * (0.5 + 0.01 * i as f32);
            mesh.positions.extend([corner(0.0), corner(2.1), corner(4.2)]);
            mesh.triangles.push([n, n + 1, n + 2]);
        }
        mesh
    };
    let mut far = Mesh::default();
    let mut dice = Dice::new(8);
    for i in 0..2000_u32 {
        let p = dice.vec() * 5.0 - Vec3::Z * 20.0;
        far.positions.extend([p, p + dice.vec(), p + dice.vec()]);
        far.triangles.push([3 * i, 3 * i + 1, 3 * i + 2]);
    }
    let still = || Motion::still(Affine3A::IDENTITY);
    let scene = scene(vec![patches(0.0), patches(0.4), far]);
    let hits = |permanent: bool, meshes: usize| -> Vec<(Option<Hit>, u32)> {
        let stage = stage((0..meshes).map(|m| (rest(m), still(), permanent)).collect());
        let accel = build(&scene, &stage);
        let mut dice = Dice::new(9);
        (0..4000)
            .map(|_| {
                let origin = Vec3A::from(dice.vec()) + Vec3A::Z * 3.0;
                let ray = ray(origin, Vec3A::from(dice.vec() * Vec3::new(1.0, 1.0, 0.0)) * 0.6 - origin, 0.0);
                let hit = accel.closest(&ray, |_| true).filter(|h| h.instance < 2);
                (hit, hit.map_or(0, |h| h.t.to_bits()))
            })
            .collect()
    };
    let plain = hits(true, 2);
    assert!(plain.iter().filter(|h| h.0.is_some()).count() > 2000);
    for (permanent, meshes) in [(true, 3), (false, 2), (false, 3)] {
        assert_eq!(hits(permanent, meshes), plain, "permanent {permanent}, {meshes} meshes");
    }
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

/// Bound: a triangle of 10⁻²⁵ m has a normal, also under a matrix whose cofactors leave `f32`. Twin: the cross product
/// of its edges, which is zero.
#[test]
fn the_smallest_triangles_have_normals() {
    let small = |s: f32| Mesh { positions: triangle().positions.iter().map(|&p| p * s).collect(), ..triangle() };
    for (size, scale) in [(1e-25_f32, 1.0_f32), (1e-6, 1e-20), (1.0, -1e-20), (1.0, 1e12), (1e-12, -1e12)] {
        for permanent in [true, false] {
            let place = Motion::still(Affine3A::from_scale(Vec3::splat(scale)));
            let (scene, stage) = (scene(vec![small(size)]), stage(vec![(rest(0), place, permanent)]));
            let accel = build(&scene, &stage);
            let at = size * scale;
            let ray = ray(Vec3A::new(0.1 * at, 0.0, 3.0 * at.abs()), Vec3A::NEG_Z, 0.0);
            let about = format!("size {size}, scale {scale}, permanent {permanent}");
            let hit = accel.closest(&ray, |_| true).unwrap_or_else(|| panic!("{about}"));
            let surface = accel.surface(&scene, &stage, &ray, &hit);
            // A mirror in all three axes turns the triangle's front away.
            let front = Vec3A::Z * scale.signum();
            assert!(surface.geometric_normal.abs_diff_eq(front, 1e-5), "{about}: {surface:?}");
            assert!(surface.position.is_finite() && surface.error.is_finite(), "{about}");
        }
    }
    let edges = Vec3::X * 1e-25;
    assert!(edges.cross(Vec3::Y * 1e-25).length() <= 0.0, "the twin went unnoticed");
}

/// The refusal of a file with one triangle of these positions and indices.
fn refusal(positions: [f32; 9], indices: [u32; 3]) -> Result<Scene, String> {
    let folder = tempfile::tempdir().unwrap();
    let bytes: Vec<u8> =
        positions.iter().flat_map(|p| p.to_le_bytes()).chain(indices.iter().flat_map(|i| i.to_le_bytes())).collect();
    std::fs::write(folder.path().join("body.bin"), bytes).unwrap();
    let file = serde_json::json!({
        "asset": {"version": "2.0"},
        "buffers": [{"uri": "body.bin", "byteLength": 48}],
        "bufferViews": [{"buffer": 0, "byteLength": 36}, {"buffer": 0, "byteOffset": 36, "byteLength": 12}],
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "type": "VEC3", "count": 3},
            {"bufferView": 1, "componentType": 5125, "type": "SCALAR", "count": 3}],
        "meshes": [{"name": "Body", "primitives": [{"attributes": {"POSITION": 0}, "indices": 1}]}],
        "nodes": [{"mesh": 0}],
    });
    let path = folder.path().join("body.gltf");
    std::fs::write(&path, file.to_string()).unwrap();
    load(&path, &LoadOptions::default()).map_err(|e| e.to_string())
}

/// Bound: none gets in; the sentence names file, mesh and vertex. Twin: a box that is grown by `min` and `max`, which
/// passes over what is no number and calls the mesh sound.
#[test]
fn positions_that_are_no_numbers_and_indices_past_the_end_are_refused_by_name() {
    let sound = [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0];
    assert!(refusal(sound, [0, 1, 2]).is_ok());
    for bad in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
        let mut positions = sound;
        positions[4] = bad;
        let message = refusal(positions, [0, 1, 2]).unwrap_err();
        assert!(message.contains("body.gltf") && message.contains("Body") && message.contains("vertex 1"), "{message}");
    }
    for bad in [3, 0x7fff_ffff, u32::MAX] {
        let message = refusal(sound, [0, bad, 2]).unwrap_err();
        assert!(
            message.contains("body.gltf") && message.contains("Body") && message.contains(&bad.to_string()),
            "{message}"
        );
    }
    let grown = [0.0, f32::NAN, 1.0].iter().fold((9.0_f32, -9.0_f32), |(a, b), &x| (a.min(x), b.max(x)));
    assert_eq!(grown, (0.0, 1.0), "the twin went unnoticed");
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
