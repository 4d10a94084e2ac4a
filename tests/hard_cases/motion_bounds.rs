//! Case 6. Bounds of what moves enclose it at every time.
//!
//! What could fail: a box interpolated between its ends is left by a point whose path is quadratic (a moving vertex under
//! a moving matrix), that jumps, or that turns within the exposure. Bound: none of the points lies outside, and a ray
//! aimed at any triangle at any time meets it or something nearer. Twins: the plain interpolation of end boxes; the box
//! of the picture's two ends, projected.

use super::support::{Dice, build, count, deforming, ray, rest, scene, sphere, stage, torus};
use crate::flat::{film, flat_scene, rectangle, settings, white};
use crate::moving::{Builder, linear};
use glam::{Affine3A, Quat, Vec3, Vec3A};
use graeco::design::Kind;
use graeco::scene::{Mesh, Motion, Property, Scene, Stage};
use rayon::prelude::*;

fn pose(dice: &mut Dice, reach: f32) -> Affine3A {
    let axis = dice.vec().normalize_or(Vec3::Y);
    let scale = Vec3::splat(0.3) + dice.vec().abs() * 2.0;
    let mirror = if dice.unit() < 0.3 { Vec3::new(1.0, -1.0, 1.0) } else { Vec3::ONE };
    let mut m = Affine3A::from_scale_rotation_translation(
        scale * mirror,
        Quat::from_axis_angle(axis, 6.0 * dice.unit()),
        dice.vec() * reach,
    );
    // Shear.
    m.matrix3.x_axis += m.matrix3.y_axis * dice.signed();
    m
}

fn path(dice: &mut Dice, keys: usize, reach: f32) -> Motion {
    if keys == 1 {
        return Motion::still(pose(dice, reach));
    }
    let mut times: Vec<f32> = (0..keys).map(|_| dice.unit()).collect();
    times.sort_by(f32::total_cmp);
    times[0] = 0.0;
    times[keys - 1] = 1.0;
    if keys > 3 {
        // A jump.
        times[1] = times[2];
    }
    Motion::through(times, (0..keys).map(|_| pose(dice, reach)).collect())
}

/// A turn of `turns` in `keys` segments, as the stage bakes it.
#[allow(clippy::cast_precision_loss, reason = "few keys")]
fn turning(turns: f32, keys: usize) -> Motion {
    let f = |i: usize| i as f32 / keys as f32;
    let at = |i| Affine3A::from_rotation_y(f(i) * turns * std::f32::consts::TAU);
    Motion::through((0..=keys).map(f).collect(), (0..=keys).map(at).collect())
}

fn random_stage(seed: u64, reach: f32) -> (Scene, Stage) {
    let mut dice = Dice::new(seed);
    let mesh: Mesh = torus(4, 0.3);
    let mut placed = Vec::new();
    for i in 0..6 {
        let keys = [0, 2, 3, 5][dice.below(4)];
        let geometry = if keys == 0 {
            rest(0)
        } else {
            let key = |dice: &mut Dice| mesh.positions.iter().map(|&p| p + dice.vec()).collect::<Vec<_>>();
            let shapes = (0..keys).map(|_| key(&mut dice)).collect();
            #[allow(clippy::cast_precision_loss, reason = "few keys")]
            let times = (0..keys).map(|k| k as f32 / (keys - 1) as f32).collect();
            deforming(0, shapes, times)
        };
        let motion = if i == 5 { turning(1.0 + 30.0 * dice.unit(), 90) } else { path(&mut dice, 1 + i, reach) };
        placed.push((geometry, motion, false));
    }
    (scene(vec![mesh]), stage(placed))
}

/// How much more `m` stretches one direction than another, at least 1: by how much its inverse magnifies roundings.
fn stretch(m: &Affine3A) -> f32 {
    let norm =
        |m: &glam::Mat3A| (m.x_axis.length_squared() + m.y_axis.length_squared() + m.z_axis.length_squared()).sqrt();
    (norm(&m.matrix3) * norm(&m.matrix3.inverse()) / 3.0).max(1.0)
}

/// Aims `rays` at random points of random triangles at random times.
fn aimed(seed: u64, reach: f32, rays: usize) {
    let (scene, stage) = random_stage(seed, reach);
    let accel = build(&scene, &stage);
    let bounds = accel.bounds();
    let mut dice = Dice::new(seed + 1);
    for _ in 0..rays {
        let i = dice.below(stage.instances.len());
        let t = dice.below(scene.meshes[0].triangles.len());
        // Bounds are tight at key times, and change hands there and at the borders of slabs.
        let times = stage.instances[i].motion.times();
        let u_time = match dice.below(10) {
            0 => times[dice.below(times.len())],
            1 => times[dice.below(times.len())].next_down().max(0.0),
            2 => dice.below(65) as f32 / 64.0,
            3 => (dice.below(65) as f32 / 64.0).next_down().max(0.0),
            _ => dice.unit(),
        };
        let [a, b, c] = accel.triangle(&scene, &stage, i.try_into().unwrap(), t.try_into().unwrap(), u_time);
        for p in [a, b, c] {
            assert!(p.cmpge(bounds.lo).all() && p.cmple(bounds.hi).all(), "{p} outside {bounds:?}");
        }
        let (target, normal) = ((a + b + c) / 3.0, (b - a).cross(c - a));
        let area = 0.5 * normal.length();
        let from = target + Vec3A::from(dice.vec()).normalize_or(Vec3A::X) * (2.0 + reach);
        let way = target - from;
        let edge = (b - a).length().max((c - a).length()).max((c - b).length());
        // Slivers and triangles seen edge-on may be missed by the rounding of the aim itself.
        // A point `reach` away is rounded by several steps of its place: so is what is narrower than 80 of them.
        // And a nearly flat matrix moves the ray by what its inverse does not undo.
        let place = stage.instances[i].motion.at(u_time);
        let undone = |p: Vec3A| (place.transform_point3a(place.inverse().transform_point3a(p)) - p).length();
        let astray = undone(target).max(undone(from)).max(1e-7 * (2.0 + reach) * stretch(&place));
        let narrow = 2.0 * area < edge * (1e-5 * (2.0 + reach)).max(16.0 * astray) || !astray.is_finite();
        if narrow || area < 1e-3 * edge * edge || way.dot(normal).abs() < 1e-2 * way.length() * normal.length() {
            continue;
        }
        let hit = accel.closest(&ray(from, way, u_time), |_| true);
        let t = hit.unwrap_or_else(|| panic!("instance {i}, triangle {t} is lost at {u_time}")).t;
        assert!(t <= 1.0 + 1e-4, "instance {i} is met behind itself: {t}");
    }
}

/// A million random times in an optimised build, over as many stages of random matrices and deforming vertices as fit.
#[test]
fn nothing_that_moves_is_lost() {
    let stages = count(1000, 60) as u64;
    (0..stages).into_par_iter().for_each(|seed| aimed(seed, [0.5, 5.0, 100.0][(seed % 3) as usize], 1_000));
}

/// How far points under a moving matrix leave the interpolated boxes of the ends, without the quadratic term.
#[test]
fn interpolated_end_boxes_lose_points() {
    let mut dice = Dice::new(5);
    let mut outside = 0;
    for _ in 0..200 {
        let (m0, m1) = (pose(&mut dice, 1.0), pose(&mut dice, 1.0));
        let points: Vec<(Vec3A, Vec3A)> = (0..12).map(|_| (dice.vec().into(), dice.vec().into())).collect();
        let least = |m: &Affine3A, end: usize| {
            let place = |p: &(Vec3A, Vec3A)| m.transform_point3a(if end == 0 { p.0 } else { p.1 });
            points.iter().map(place).fold(Vec3A::INFINITY, Vec3A::min)
        };
        let (lo0, lo1) = (least(&m0, 0), least(&m1, 1));
        let f = dice.unit();
        let m = Affine3A {
            matrix3: m0.matrix3 * (1.0 - f) + m1.matrix3 * f,
            translation: m0.translation * (1.0 - f) + m1.translation * f,
        };
        let lo = lo0 * (1.0 - f) + lo1 * f;
        outside +=
            points.iter().filter(|p| m.transform_point3a(p.0 * (1.0 - f) + p.1 * f).cmplt(lo - 1e-3).any()).count();
    }
    assert!(outside > 20, "the motions are hard enough: {outside}");
}

#[test]
fn a_body_crossing_the_whole_view_and_a_million_units_is_found_everywhere() {
    let at = |x: f32| Affine3A::from_translation(Vec3::new(x, 0.0, 0.0));
    for reach in [10.0, 1e6] {
        let motion = Motion::through(vec![0.0, 1.0], vec![at(-reach), at(reach)]);
        let stage = stage(vec![(rest(0), motion.clone(), false)]);
        let scene = scene(vec![sphere(3)]);
        let accel = build(&scene, &stage);
        let mut dice = Dice::new(2);
        for _ in 0..2000 {
            let u_time = dice.unit();
            let centre = motion.at(u_time).translation;
            let from = centre + Vec3A::new(dice.signed(), 5.0, dice.signed());
            assert!(accel.occluded(&ray(from, centre - from, u_time), |_| true), "at {u_time} of {reach}");
            // And through the camera: from inside it is all around.
            assert!(accel.occluded(&ray(centre, Vec3A::from(dice.vec()), u_time), |_| true));
        }
    }
}

#[test]
fn squashed_to_nothing_and_back_is_no_fault() {
    let flat = |s: f32| Affine3A::from_scale(Vec3::new(1.0, s, 1.0));
    let motion = Motion::through(vec![0.0, 0.5, 1.0], vec![flat(1.0), flat(0.0), flat(1.0)]);
    let stage = stage(vec![(rest(0), motion, false)]);
    let scene = scene(vec![sphere(3)]);
    let accel = build(&scene, &stage);
    let mut dice = Dice::new(2);
    for k in 0..2000_u16 {
        let u_time = if k < 100 { 0.5 } else { dice.unit() };
        let from = Vec3A::new(0.3 * dice.signed(), 3.0, 0.3 * dice.signed());
        let ray = ray(from, Vec3A::NEG_Y, u_time);
        let hit = accel.closest(&ray, |_| true).expect("it is below");
        let surface = accel.surface(&scene, &stage, &ray, &hit);
        assert!(surface.position.is_finite() && surface.error.is_finite());
        assert!(surface.normal.is_normalized() && surface.geometric_normal.is_normalized());
        assert!(surface.spawn_origin(Vec3A::Y).is_finite());
    }
}

#[test]
fn a_fan_of_ten_turns_is_split_in_time() {
    let mut blade = Mesh { triangles: vec![[0, 1, 2]], ..Mesh::default() };
    blade.positions = vec![Vec3::new(0.0, 0.0, -0.1), Vec3::new(0.0, 0.0, 0.1), Vec3::new(5.0, 0.0, 0.0)];
    let slabs = |turns: f32, keys: usize| {
        let stage = stage(vec![(rest(0), turning(turns, keys), false)]);
        build(&scene(vec![blade.clone()]), &stage).stats().slabs
    };
    assert!(slabs(10.0, 400) >= 32, "{}", slabs(10.0, 400));
    assert!(slabs(0.25, 10) <= 8, "{}", slabs(0.25, 10));
}

/// A white wall wider than the picture that comes from 10 m ahead to 10 m behind the camera while the exposure lasts:
/// it is seen until it passes, half of the time. Could blow up: its projection, which has no bounds then. Bound: every
/// pixel is ½ within the stratum of time in which it passes. Twin: the projected ends, of which one is behind.
#[test]
fn a_wall_through_the_camera_is_seen_until_it_passes() {
    let mut b = Builder::new(0.0);
    b.scene.materials[0] = white();
    let wall = b.node(None, Vec3::ZERO);
    b.mesh(wall, &rectangle([-100.0, 100.0], [-100.0, 100.0]));
    b.drive(wall, Property::Translation(linear(&[(0.0, Vec3::NEG_Z * 10.0), (1.0, Vec3::Z * 10.0)])));
    let mut s = settings((12, 8), 64);
    s.sampling.kind = Kind::Auto;
    let picture = film(&b.finish(), &s, 0);
    for pixel in picture.pixels() {
        assert!((pixel.radiance.x - 0.5).abs() <= 1.0 / 64.0, "{}", pixel.radiance);
    }
    let naive = |z: f32| 100.0 / -z;
    assert!(naive(10.0) < 0.0, "the twin went unnoticed: the wall's right edge is left of the picture");
}

/// A bar that crosses the whole picture, and a thousand pictures' widths beside it, in one exposure. Bound: each pixel
/// is covered for width ÷ distance of the time, the picture together for as long as closed form says; none is left out
/// at borders of tiles or segments. Twin: the bar at mid-exposure only.
#[test]
fn a_bar_crossing_the_whole_picture_leaves_no_pixel_out() {
    // 70 × 40 pixels: several tiles each way.
    const SIZE: (u32, u32) = (70, 40);
    for reach in [60.0_f32, 1000.0] {
        let mut b = flat_scene(40);
        let bar = b.node(None, Vec3::ZERO);
        let width = reach / 4.0;
        b.mesh(bar, &rectangle([-width / 2.0, width / 2.0], [-30.0, 30.0]));
        b.drive(bar, Property::Translation(linear(&[(0.0, Vec3::NEG_X * reach), (1.0, Vec3::X * reach)])));
        let mut s = settings(SIZE, 64);
        s.sampling.kind = Kind::Auto;
        let scene = b.finish();
        let picture = film(&scene, &s, 0);
        let share = width / (2.0 * reach);
        for pixel in picture.pixels() {
            // The bar's two edges fall into strata of time: each is off by one run at most, and the filter by another.
            assert!((pixel.radiance.x - share).abs() <= 3.0 / 64.0, "{} of {share}", pixel.radiance.x);
        }
        s.blur_scale = vec![("1".into(), 0.0)];
        let frozen = film(&scene, &s, 0);
        let off = frozen.pixels().iter().filter(|p| (p.radiance.x - share).abs() > 3.0 / 64.0).count();
        assert!(off > 1000, "the twin went unnoticed: {off}");
    }
}
