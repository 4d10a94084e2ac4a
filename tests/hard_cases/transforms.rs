//! Zero, negative, huge and tiny scales, shears, objects squashed to nothing and back, quaternions that are none, turns
//! by half a circle and by a thousand.

use super::support::{ray, single};
use crate::moving::{Builder, exposure, linear, stage, track, worst_error};
use glam::{DMat3, DVec3, DVec4, Quat, Vec3, Vec3A};
use graeco::scene::rig::{Playback, Rig, spectral_norm};
use graeco::scene::{Interpolation, LocalTransform, Mesh, Property, Scene, Stage};
use graeco::trace::accel::Accel;
use graeco::trace::{Backs, Ray};
use proptest::prelude::*;

const PIXELS: f64 = 1.0 / 16.0;
const TRIANGLE: [Vec3; 3] = [Vec3::new(1.0, 0.0, 0.0), Vec3::new(-0.5, 0.8, 0.1), Vec3::new(-0.4, -0.7, 0.3)];

fn scaled(scales: &[Vec3]) -> Scene {
    let mut b = Builder::new(10.0);
    let mut parent = None;
    for &scale in scales {
        let n = b.node(parent, Vec3::ZERO);
        b.scene.nodes[n].local = LocalTransform::Parts { translation: Vec3::ZERO, rotation: Quat::IDENTITY, scale };
        parent = Some(n);
    }
    b.mesh(parent.unwrap(), &TRIANGLE);
    b.finish()
}

/// Every entry of every key is a number, and rays from the camera over the whole exposure meet nothing that is none.
fn check_finite(scene: &Scene, stage: &Stage) -> usize {
    for instance in &stage.instances {
        assert!(instance.motion.keys().iter().all(|k| k.is_finite()), "a key is not finite");
    }
    let accel = Accel::build(scene, stage, None);
    let mut hits = 0;
    for i in 0..4096_u16 {
        let (x, y) = (f32::from(i % 64) / 32.0 - 1.0, f32::from(i / 64) / 32.0 - 1.0);
        let u_time = f32::from(i % 17) / 16.0;
        let ray = Ray {
            origin: Vec3A::new(0.0, 0.0, 10.0),
            direction: Vec3A::new(0.2 * x, 0.2 * y, -1.0),
            t_max: f32::INFINITY,
            u_time,
            backs: Backs::Stop,
        };
        if let Some(hit) = accel.closest(&ray, |_| true) {
            let p = accel.surface(scene, stage, &ray, &hit);
            assert!(
                hit.t.is_finite() && p.position.is_finite() && p.error.is_finite(),
                "{hit:?} {p:?} {:?}",
                stage.instances[0].motion
            );
            assert!(p.geometric_normal.is_finite() && p.normal.is_finite(), "{p:?}");
            hits += 1;
        }
    }
    hits
}

/// Could blow up: the inverse of a singular matrix. Bound: no ray meets what has no extent; all is finite. Twin: the
/// inverse transpose for normals, which is not finite.
#[test]
fn a_zero_scale_shows_nothing_and_breaks_nothing() {
    for scale in [Vec3::ZERO, Vec3::new(1.0, 0.0, 0.0)] {
        let scene = scaled(&[scale]);
        assert_eq!(check_finite(&scene, &stage(&scene, exposure(0.0, 1.0), PIXELS)), 0);
    }
    // Squashed to a plane it is still seen.
    let scene = scaled(&[Vec3::new(1.0, 1.0, 0.0)]);
    assert!(check_finite(&scene, &stage(&scene, exposure(0.0, 1.0), PIXELS)) > 100);
    let flat = DMat3::from_diagonal(DVec3::new(1.0, 1.0, 0.0));
    assert!(!flat.inverse().transpose().is_finite(), "the twin went unnoticed");
    assert_eq!(graeco::scene::deform::cofactor(flat) * DVec3::Z, DVec3::Z);
}

/// Could blow up: the same, at one instant inside the exposure. Bound: piecewise linear scales are met exactly, so two
/// segments, singular in their middle key. Twin: keys at the ends alone, which never shrink.
#[test]
fn squashed_to_nothing_and_back_within_the_exposure() {
    for low in [Vec3::ZERO, Vec3::new(1.0, 0.0, 1.0), -Vec3::ONE] {
        let mut b = Builder::new(10.0);
        let n = b.node(None, Vec3::ZERO);
        b.mesh(n, &TRIANGLE);
        b.drive(n, Property::Scale(linear(&[(0.0, Vec3::ONE), (0.5, low), (1.0, Vec3::ONE)])));
        let scene = b.finish();
        let baked = stage(&scene, exposure(0.0, 1.0), PIXELS);
        assert_eq!(baked.instances[0].motion.times(), [0.0, 0.5, 1.0]);
        assert!(check_finite(&scene, &baked) > 100);
        let rig = Rig::new(&scene, &Playback::default()).unwrap();
        assert!(worst_error(&rig, &baked, 1000).0 < 0.004);
        let mut twin = baked.clone();
        twin.instances[0].motion =
            graeco::scene::Motion::through(vec![0.0, 1.0], vec![baked.instances[0].motion.keys()[0]; 2]);
        assert!(worst_error(&rig, &twin, 1000).0 > 10.0, "the twin went unnoticed");
    }
}

/// Could blow up: products of scales from 10⁻³⁰ to 10³⁰ overflow single precision, or vanish in it. Bound: chains are
/// multiplied in double precision, so what multiplies to one is one to 4 roundings of f32. Twin: the chain in f32.
#[test]
fn scales_by_a_trillion_cancel_in_the_chain() {
    let up = |x: f32| Vec3::splat(x);
    for chain in [[1e-20, 1e-20, 1e20, 1e20], [1e12, 1e-12, -1e12, -1e-12], [1e30, 1e30, 1e-30, 1e-30]] {
        let scene = scaled(&chain.map(up));
        let baked = stage(&scene, exposure(0.0, 1.0), PIXELS);
        let m = baked.instances[0].motion.keys()[0].matrix3;
        let off = [m.x_axis.x, m.y_axis.y, m.z_axis.z].iter().map(|d| (d - 1.0).abs()).fold(0.0, f32::max);
        println!("scales {chain:?}: off by {off:e}");
        assert!(off <= 4.0 * f32::EPSILON, "{off}");
        assert!(check_finite(&scene, &baked) > 100);
    }
    let twin = [1e-20_f32, 1e-20, 1e20, 1e20].iter().product::<f32>();
    assert!((twin - 1.0).abs() > 1e-6, "the twin went unnoticed");
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::default() })]

    /// Could blow up: how much a bound overestimates a stretch, through a chain of matrices. Bound: 0.2 % a matrix.
    /// Twin: the Frobenius norm, √3 for the identity.
    #[test]
    fn stretches_are_bounded_tightly(m in prop::array::uniform9(-3.0_f64..3.0), scale in -12_i32..12) {
        let m = DMat3::from_cols_array(&m) * 10.0_f64.powi(scale);
        let bound = spectral_norm(m);
        // The largest stretch over a fine covering of directions, refined by the power method.
        let mut v = DVec3::ONE.normalize();
        for _ in 0..2000 {
            let w = m.transpose() * (m * v);
            if w.length() > 0.0 { v = w.normalize(); }
        }
        let stretch = (m * v).length();
        prop_assert!(bound >= stretch * (1.0 - 1e-12) && bound <= stretch * 1.0022, "{bound} {stretch}");
        let frobenius = DMat3::IDENTITY.to_cols_array().iter().map(|x| x * x).sum::<f64>().sqrt();
        prop_assert!(frobenius > 1.0022, "the twin went unnoticed");
    }
}

fn turn(p: Quat, q: Quat) -> graeco::scene::Track<Quat> {
    linear(&[(0.0, p), (1.0, q)])
}

fn angle(q: glam::DQuat) -> f64 {
    let v = DVec4::from(q);
    2.0 * libm::atan2(v.truncate().length(), v.w.abs())
}

/// Could blow up: division by the sine of a tiny angle. Bound: the turn at f is f times the whole, relatively to
/// 10⁻⁹, for turns down to 10⁻⁸. Twin: the angle by the arc cosine of the dot product, which is 0 or wrong.
#[test]
fn nearly_equal_keys_turn_evenly() {
    let mut worst = 0.0_f64;
    for whole in [1e-8_f32, 1e-6, 1e-4, 1e-2, 1.0] {
        let (p, q) = (Quat::IDENTITY, Quat::from_xyzw(0.0, 0.0, libm::sinf(whole / 2.0), libm::cosf(whole / 2.0)));
        let track = turn(p, q);
        let exact = angle(track.rotation((0.0, 1.0), 1.0));
        for f in [0.1, 0.5, 0.9] {
            worst = worst.max((angle(track.rotation((0.0, 1.0), f)) / (exact * f) - 1.0).abs());
        }
    }
    println!("nearly equal keys: relative error {worst:e}");
    assert!(worst < 1e-9, "{worst}");
    let (s, c) = (libm::sinf(0.5e-4), libm::cosf(0.5e-4));
    let twin = f64::from(2.0 * libm::acosf(Quat::IDENTITY.dot(Quat::from_xyzw(0.0, 0.0, s, c))));
    assert!((twin / 1e-4 - 1.0).abs() > 1e-3, "the twin went unnoticed: {twin}");
}

/// Could blow up: speed near half a turn. Bound: constant to 10⁻⁷ (the keys are f32). Twin: normalised linear
/// interpolation, 9 degrees wrong.
#[test]
fn half_turns_run_at_constant_speed() {
    let track = turn(Quat::IDENTITY, Quat::from_xyzw(0.0, 0.0, 1.0, 0.0));
    let (mut worst, mut twin) = (0.0_f64, 0.0_f64);
    for i in 0..=100 {
        let f = f64::from(i) / 100.0;
        let truth = std::f64::consts::PI * f;
        worst = worst.max((angle(track.rotation((0.0, 1.0), f)) - truth).abs());
        let lerped = glam::DQuat::from_vec4(DVec4::new(0.0, 0.0, f, 1.0 - f).normalize());
        twin = twin.max((angle(lerped) - truth).abs());
    }
    println!("half turn: {worst:e} rad");
    assert!(worst < 1e-12 && twin > 0.1, "{worst} {twin}");
}

/// Could blow up: opposite quaternions are one rotation, between which the linear path runs through zero. Bound: exact
/// stillness. Twin: interpolation without regard to the sign.
#[test]
fn antipodal_keys_stand() {
    let q = Quat::from_xyzw(0.1, 0.7, -0.1, 0.7).normalize();
    let mut b = Builder::new(10.0);
    let n = b.node(None, Vec3::ZERO);
    b.mesh(n, &TRIANGLE);
    b.drive(n, Property::Rotation(turn(q, -q)));
    let scene = b.finish();
    assert!(stage(&scene, exposure(0.0, 1.0), PIXELS).instances[0].motion.is_still());
    assert!((q * 0.5 + -q * 0.5).length() < 0.1, "the twin went unnoticed");
}

/// Could blow up: a quaternion that is zero or not of unit length. Bound: rotations are orthonormal to 10⁻⁶, zero is
/// none. Twin: division by the length; and use without it, which scales by its square.
#[test]
fn quaternions_that_are_none_turn_nothing_and_scale_nothing() {
    let long = Quat::from_xyzw(0.0, 0.0, 3.0, 4.0);
    let zero = Quat::from_xyzw(0.0, 0.0, 0.0, 0.0);
    let check = |scene: &Scene| {
        let baked = stage(scene, exposure(0.0, 1.0), PIXELS);
        for key in baked.instances[0].motion.keys() {
            let m = key.matrix3;
            assert!(key.is_finite() && (m.determinant() - 1.0).abs() < 1e-5 && (m.x_axis.length() - 1.0).abs() < 1e-6);
        }
        assert!(check_finite(scene, &baked) > 100);
    };
    for rotation in [long, zero, Quat::from_xyzw(1e-30, 0.0, 0.0, 0.0)] {
        let mut b = Builder::new(10.0);
        let n = b.node(None, Vec3::ZERO);
        b.scene.nodes[n].local = LocalTransform::Parts { translation: Vec3::ZERO, rotation, scale: Vec3::ONE };
        b.mesh(n, &TRIANGLE);
        check(&b.finish());
        for interpolation in [Interpolation::Step, Interpolation::Linear] {
            let mut b = Builder::new(10.0);
            let n = b.node(None, Vec3::ZERO);
            b.mesh(n, &TRIANGLE);
            b.drive(n, Property::Rotation(track(interpolation, &[0.0, 0.5, 1.0], vec![rotation, long, rotation])));
            let scene = b.finish();
            let baked = stage(&scene, exposure(0.0, 1.0), PIXELS);
            assert!(baked.instances[0].motion.keys().iter().all(|k| k.is_finite()));
            check_finite(&scene, &baked);
        }
    }
    assert!(!(zero * (1.0 / zero.length())).is_finite(), "the twin went unnoticed");
    // The formula of a unit quaternion's matrix, used on one of length 5: 1 − 2z² in the first corner.
    assert!((1.0 - 2.0 * long.z * long.z).abs() > 1.0, "the twin went unnoticed");
}

/// Could blow up: a cubic spline of quaternions through zero, where its direction is undefined and its bend unbounded.
/// Bound: finite everywhere, and no more keys than there may be. Twin: the normalised value there, which is no number.
#[test]
fn a_spline_of_quaternions_through_zero_stays_finite() {
    let q = Quat::from_xyzw(0.3, 0.1, 0.2, 0.9);
    let none = Quat::from_xyzw(0.0, 0.0, 0.0, 0.0);
    for (end, tangent) in [(-q, none), (-q, Quat::from_xyzw(1.0, 0.0, 0.0, 0.0)), (none, none), (q, q * -8.0)] {
        let mut b = Builder::new(10.0);
        let n = b.node(None, Vec3::ZERO);
        b.mesh(n, &TRIANGLE);
        let values = vec![tangent, q, tangent, tangent, end, tangent];
        b.drive(n, Property::Rotation(track(Interpolation::CubicSpline, &[0.0, 1.0], values)));
        let scene = b.finish();
        let baked = stage(&scene, exposure(0.0, 1.0), PIXELS);
        let keys = baked.instances[0].motion.keys().len();
        println!("spline through zero: {keys} keys");
        assert!(keys < 1 << 17);
        check_finite(&scene, &baked);
    }
    let middle = q * 0.5 + -q * 0.5;
    assert!(!(middle * (1.0 / middle.length())).is_finite(), "the twin went unnoticed");
}

/// Could blow up: the place within the exposure, kept in f32, where a thousand turns make each of its steps count; and
/// what moves between keys that are too few. Bound: 1/16 pixel. Twins: keys that stand one ulp of 1 beside their true
/// places for every quarter of the exposure that has passed, as a running sum of steps would put them; 4096 even keys.
#[test]
fn a_thousand_turns_in_an_exposure_keep_the_bound() {
    const TURNS: u32 = 1000;
    let mut b = Builder::new(10.0);
    let n = b.node(None, Vec3::ZERO);
    b.mesh(n, &TRIANGLE.map(|p| p * 0.5));
    let keys: Vec<_> = (0..=3 * TURNS)
        .map(|i| {
            let half = std::f32::consts::FRAC_PI_3 * (i % 6) as f32;
            (f64::from(i) / f64::from(3 * TURNS), Quat::from_xyzw(0.0, 0.0, libm::sinf(half), libm::cosf(half)))
        })
        .collect();
    b.drive(n, Property::Rotation(linear(&keys)));
    let scene = b.finish();
    let rig = Rig::new(&scene, &Playback::default()).unwrap();
    let baked = stage(&scene, exposure(0.0, 1.0), PIXELS);
    let (worst, seen) = worst_error(&rig, &baked, 300_007);
    let keep = baked.instances[0].motion.keys().len();
    println!("1000 turns: {keep} keys, worst {worst:.4} pixels");
    // Rounding of matrices: 0.004 pixels, as in tests/motion.rs. Rounding of u: half an ulp of 1 in 1000 turns of a rim
    // of 0.5 m at 74 pixels a metre.
    let bound = PIXELS + 0.004 + 0.5 * 74.0 * 6283.2 * 6e-8;
    assert!(seen > 500_000 && worst <= bound, "{worst}");
    let with = |times: Vec<f32>, keys: Vec<glam::Affine3A>| {
        let mut twin = baked.clone();
        twin.instances[0].motion = graeco::scene::Motion::through(times, keys);
        worst_error(&rig, &twin, 10_007).0
    };
    let step = 1.0 / (keep - 1) as f32;
    let mut summed = vec![0.0_f32; keep];
    (1..keep).for_each(|i| summed[i] = (summed[i - 1] + step).min(1.0));
    summed[keep - 1] = 1.0;
    let drifted = with(summed, baked.instances[0].motion.keys().to_vec());
    let even: Vec<f32> = (0..=4096_u16).map(|i| f32::from(i) / 4096.0).collect();
    let poses = even.iter().map(|&u| baked.instances[0].motion.at(u)).collect();
    let coarse = with(even, poses);
    println!("1000 turns: a running sum of places {drifted:.3} pixels, 4096 even keys {coarse:.3}");
    assert!(drifted > bound && coarse > bound, "a twin went unnoticed");
}

/// Could blow up: the side of a mirrored triangle, and normals under shears, which are not carried by the matrix itself.
/// Bound: the front is what glTF says (§3.7.4: a negative determinant turns the winding), normals are across the surface
/// to 10⁻⁵, at scales of 10⁻¹² to 10¹². Twins: winding regardless of the determinant; normals carried like vectors.
#[test]
fn mirrors_and_shears_carry_normals() {
    let corners = TRIANGLE.map(Vec3A::from);
    let own = (corners[1] - corners[0]).cross(corners[2] - corners[0]).normalize();
    let (mut turned, mut bent) = (0, 0);
    for size in [1e-12_f32, 1e-6, 1.0, 1e6, 1e12] {
        for signs in [Vec3::ONE, Vec3::new(-1.0, 1.0, 1.0), Vec3::new(-1.0, -1.0, 1.0), Vec3::NEG_ONE] {
            for shear in [0.0, 0.8, 30.0] {
                for permanent in [true, false] {
                    let mut m = glam::Affine3A::from_scale_rotation_translation(
                        signs * size * Vec3::new(1.0, 2.0, 0.5),
                        Quat::from_rotation_y(0.3),
                        Vec3::ZERO,
                    );
                    m.matrix3.z_axis += m.matrix3.x_axis * shear;
                    let mesh = Mesh { positions: TRIANGLE.to_vec(), triangles: vec![[0, 1, 2]], ..Mesh::default() };
                    let (scene, mut stage) = single(mesh, m);
                    stage.instances[0].permanent = permanent;
                    let accel = Accel::build(&scene, &stage, None);
                    let [a, b, c] = corners.map(|p| m.transform_point3a(p));
                    let across = (b - a).as_dvec3().cross((c - a).as_dvec3());
                    let across = across.normalize().as_vec3a();
                    let front = if m.matrix3.determinant() < 0.0 { -across } else { across };
                    let ray = ray((a + b + c) / 3.0 + across * size, -across, 0.0);
                    let about = format!("size {size}, {signs}, shear {shear}, permanent {permanent}");
                    let hit = accel.closest(&ray, |_| true).unwrap_or_else(|| panic!("{about}: lost"));
                    let surface = accel.surface(&scene, &stage, &ray, &hit);
                    assert!(surface.geometric_normal.abs_diff_eq(front, 1e-5), "{about}: {surface:?} {front}");
                    turned += usize::from(!surface.geometric_normal.abs_diff_eq(across, 1e-5));
                    let carried = (m.matrix3 * own).normalize();
                    bent += usize::from(carried.dot(front).abs() < 0.999);
                }
            }
        }
    }
    assert!(turned > 20 && bent > 20, "a twin went unnoticed: {turned} {bent}");
}
