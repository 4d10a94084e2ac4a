//! Instants far from zero, keys that coincide, exposures of no length or beside the animation, clocks without drift.

use crate::moving::{Builder, exposure, linear, stage, track};
use glam::{Quat, Vec3};
use graeco::scene::gltf::{LoadOptions, load};
use graeco::scene::{Interpolation, Property, Scene};
use graeco::time::{Exposure, FrameRate, Shutter};

const PIXELS: f64 = 1.0 / 16.0;
const TRIANGLE: [Vec3; 3] = [Vec3::X, Vec3::Y, Vec3::NEG_X];

type Bits = (Vec<f32>, Vec<[u32; 12]>);

fn bits(scene: &Scene, interval: Exposure) -> [Bits; 2] {
    let baked = stage(scene, interval, PIXELS);
    [&baked.instances[0].motion, &baked.camera.motion]
        .map(|m| (m.times().to_vec(), m.keys().iter().map(|k| k.to_cols_array().map(f32::to_bits)).collect()))
}

/// Could blow up: the resolution of instants far from zero. Bound: none lost, bit for bit, since every difference is
/// taken on a grid of 2⁻³⁶ s before it meets an instant. Twin: instants in f32, steps of 2⁻⁸ s at hour ten.
#[test]
fn hour_ten_is_hour_zero_bit_for_bit() {
    const HOURS: f64 = 36_000.0;
    let build = |shift: f64| {
        let mut b = Builder::new(10.0);
        let n = b.node(None, Vec3::ZERO);
        b.mesh(n, &TRIANGLE);
        let times: Vec<f64> = (0..9_u8).map(|i| f64::from(0.1_f32 * f32::from(i)) + shift).collect();
        let values = (0..27_u8).map(|i| Quat::from_rotation_z(0.3 * f32::from(i) % 2.0)).collect();
        b.drive(n, Property::Rotation(track(Interpolation::CubicSpline, &times, values)));
        b.drive(Builder::EYE, Property::Translation(linear(&[(shift, Vec3::Z * 10.0), (shift + 1.0, Vec3::Z * 8.0)])));
        b.scene.nodes[n].blur_scale = Some(0.7);
        b.finish()
    };
    let rate: FrameRate = "30000/1001".parse().unwrap();
    for frame in 0..24 {
        let at =
            |shift: f64| bits(&build(shift), Shutter::default().exposure(rate.instant(frame) + shift, rate.period()));
        assert_eq!(at(0.0), at(HOURS), "frame {frame}");
    }
    #[allow(clippy::cast_possible_truncation, reason = "the twin's fault")]
    let naive = |t: f64| f64::from((t + HOURS) as f32) - HOURS;
    assert!((naive(7.0 / 24.0) - 7.0 / 24.0).abs() > 1e-4, "the twin went unnoticed");
}

/// Could blow up: a running sum of periods. Bound: half an ulp of the instant over 10⁷ frames (4 days): every one is
/// one rounding of an exact fraction. Twin: the running sum.
#[test]
fn ntsc_does_not_drift_over_ten_million_frames() {
    let rate: FrameRate = "30000/1001".parse().unwrap();
    let (mut sum, mut worst) = (0.0_f64, 0.0_f64);
    for frame in 0..=10_000_000_i64 {
        // 1001 · frame / 30000: quotient and remainder are exact.
        let (whole, rest) = (1001 * frame / 30_000, 1001 * frame % 30_000);
        let off = (rate.instant(frame) - whole as f64) - rest as f64 / 30_000.0;
        worst = worst.max(off.abs() / f64::EPSILON / (whole as f64).max(1.0));
        if frame < 10_000_000 {
            sum += rate.period();
        }
    }
    let drift = (sum - rate.instant(10_000_000)).abs();
    println!("10^7 NTSC frames: worst {worst:.2} ulp of the instant; the running sum drifts by {drift:e} s");
    assert!(worst <= 1.0, "{worst}");
    assert!(drift > 1e-6, "the twin went unnoticed");
}

/// Could blow up: gaps or overlaps between exposures of a 360-degree shutter, which double or lose light. Bound: one
/// step of the grid, 2⁻³² s. Twin: instants in f32.
#[test]
fn full_exposures_follow_one_another() {
    let shutter = Shutter { fraction: 1.0, ..Shutter::default() };
    for rate in ["24", "30000/1001", "59.94"] {
        let rate: FrameRate = rate.parse().unwrap();
        for frame in [0, 1, 1000, 8_640_000] {
            let [a, b] = [frame, frame + 1].map(|f| shutter.exposure(rate.instant(f), rate.period()));
            assert!((b.open - a.close).abs() <= 1.0 / 4_294_967_296.0, "{rate} {frame}");
        }
    }
    let rate: FrameRate = "30000/1001".parse().unwrap();
    #[allow(clippy::cast_possible_truncation, reason = "the twin's fault")]
    let [a, b] = [8_640_000, 8_640_001].map(|f| rate.instant(f) as f32);
    assert!((f64::from(b - a) - rate.period()).abs() > 1.0 / 4_294_967_296.0, "the twin went unnoticed");
}

/// Could blow up: a value between two steps, which a file with STEP never has. Bound: the jump is at its key's instant
/// to an ulp of the exposure, with the held values, exactly, on both sides; a key that changes nothing is none. Twin:
/// the straight line.
#[test]
fn steps_within_the_exposure_are_jumps() {
    let scene = slide(Interpolation::Step, &[0.0, 0.3, 0.6, 0.8, 5.0], &[1.0, 7.0, 7.0, -2.0, 9.0]);
    let baked = stage(&scene, exposure(0.2, 1.2), PIXELS);
    let motion = &baked.instances[0].motion;
    let x: Vec<f32> = motion.keys().iter().map(|k| k.translation.x).collect();
    assert_eq!(x, [1.0, 1.0, 7.0, 7.0, -2.0, -2.0]);
    for (key, at) in [(1, 0.1_f64), (2, 0.1), (3, 0.6), (4, 0.6)] {
        assert!((f64::from(motion.times()[key]) - at).abs() <= f64::from(f32::EPSILON), "{:?}", motion.times());
    }
    for (u, x) in [(0.0, 1.0), (0.099, 1.0), (0.101, 7.0), (0.3, 7.0), (0.599, 7.0), (0.601, -2.0), (1.0, -2.0)] {
        assert_eq!(motion.at(u).translation.x, x, "{u}");
    }
    let line = slide(Interpolation::Linear, &[0.0, 0.3, 0.6, 0.8, 5.0], &[1.0, 7.0, 7.0, -2.0, 9.0]);
    let twin = stage(&line, exposure(0.2, 1.2), PIXELS).instances[0].motion.at(0.05).translation.x;
    assert!(twin != 1.0 && twin != 7.0, "the twin went unnoticed: {twin}");
}

/// A file whose animation has these key times: loaded, or why not.
fn loaded(times: [f32; 3]) -> Result<Scene, String> {
    let folder = tempfile::tempdir().unwrap();
    let values = [0.0_f32, 0.0, 0.0, 1.0, 0.0, 0.0, 2.0, 0.0, 0.0];
    let bytes: Vec<u8> = times.iter().chain(&values).flat_map(|v| v.to_le_bytes()).collect();
    std::fs::write(folder.path().join("keys.bin"), bytes).unwrap();
    let file = serde_json::json!({
        "asset": {"version": "2.0"},
        "buffers": [{"uri": "keys.bin", "byteLength": 48}],
        "bufferViews": [{"buffer": 0, "byteLength": 12}, {"buffer": 0, "byteOffset": 12, "byteLength": 36}],
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "type": "SCALAR", "count": 3},
            {"bufferView": 1, "componentType": 5126, "type": "VEC3", "count": 3}],
        "animations": [{"name": "Walk", "samplers": [{"input": 0, "output": 1}],
            "channels": [{"sampler": 0, "target": {"node": 0, "path": "translation"}}]}],
        "nodes": [{"name": "Body"}],
    });
    let path = folder.path().join("keys.gltf");
    std::fs::write(&path, file.to_string()).unwrap();
    load(&path, &LoadOptions::default()).map_err(|e| e.to_string())
}

/// Could blow up: a search by halves among keys that do not ascend, which finds any. Bound: refused, by name. Twin: the
/// interpolation between such keys, which runs backwards.
#[test]
fn keys_that_do_not_ascend_are_refused() {
    assert!(loaded([0.0, 1.0, 1.0]).is_ok());
    for times in [[0.0, 2.0, 1.0], [1.0, 0.0, 2.0], [0.0, f32::NAN, 1.0], [0.0, 1.0, f32::INFINITY]] {
        let message = loaded(times).unwrap_err();
        assert!(message.contains("keys.gltf") && message.contains("Walk") && message.contains("key"), "{message}");
    }
    // The way from a key at 2 s back to one at 1 s, taken at 3 s: before its beginning.
    let naive = |t: f64| (t - 2.0) / (1.0 - 2.0);
    assert!(!(0.0..=1.0).contains(&naive(3.0)), "the twin went unnoticed");
}

fn slide(interpolation: Interpolation, times: &[f64], xs: &[f32]) -> Scene {
    let mut b = Builder::new(10.0);
    let n = b.node(None, Vec3::ZERO);
    b.mesh(n, &TRIANGLE);
    b.drive(n, Property::Translation(track(interpolation, times, xs.iter().map(|&x| Vec3::X * x).collect())));
    b.finish()
}

/// Could blow up: division by the span between equal key times. Bound: a jump, each side exact. Twin: that division.
#[test]
fn equal_key_times_are_a_jump() {
    let scene = slide(Interpolation::Linear, &[0.0, 0.5, 0.5, 0.5, 1.0], &[0.0, 1.0, 7.0, 2.0, 3.0]);
    let baked = stage(&scene, exposure(0.0, 1.0), PIXELS);
    let motion = &baked.instances[0].motion;
    let x: Vec<f32> = motion.keys().iter().map(|k| k.translation.x).collect();
    assert_eq!((motion.times(), &x[..]), (&[0.0, 0.5, 0.5, 1.0][..], &[0.0, 1.0, 2.0, 3.0][..]));
    // An exposure that opens or closes on the jump sees one side of it.
    let ends = |a, b| {
        let motion = stage(&scene, exposure(a, b), PIXELS).instances[0].motion.clone();
        [motion.at(0.0).translation.x, motion.at(1.0).translation.x]
    };
    assert_eq!((ends(0.5, 1.0), ends(0.0, 0.5), ends(0.5, 0.5)), ([2.0, 3.0], [0.0, 1.0], [2.0, 2.0]));
    let span = motion.times()[2] - motion.times()[1];
    assert!(!((0.5 - motion.times()[1]) / span).is_finite(), "the twin went unnoticed");
}

/// Could blow up: extrapolation. Bound: the end values hold, and stand exactly. Twin: the straight line continued.
#[test]
fn before_the_first_and_after_the_last_key_the_end_values_stand() {
    for interpolation in [Interpolation::Step, Interpolation::Linear] {
        let scene = slide(interpolation, &[1.0, 2.0], &[5.0, 6.0]);
        for (open, close, x) in
            [(0.0, 0.5, 5.0), (0.9, 1.0, 5.0), (2.0, 2.5, 6.0), (1e6, 1e6 + 1.0, 6.0), (-1e6, 0.0, 5.0)]
        {
            let motion = stage(&scene, exposure(open, close), PIXELS).instances[0].motion.clone();
            assert!(motion.is_still() && (motion.at(0.5).translation.x - x).abs() <= 0.0, "{open}");
        }
        let partly = stage(&scene, exposure(1.5, 2.5), PIXELS).instances[0].motion.at(1.0).translation.x;
        assert!((partly - 6.0).abs() <= 0.0);
    }
    let twin = 5.0 + (2.5 - 1.0) * (6.0 - 5.0);
    assert!(twin > 6.0, "the twin went unnoticed");
}

/// Could blow up: a span from the only key to itself. Bound: it stands, exactly, at every time. Twin: that division.
#[test]
fn one_key_stands() {
    for interpolation in [Interpolation::Step, Interpolation::Linear] {
        let scene = slide(interpolation, &[1.0], &[5.0]);
        for open in [0.0, 0.5, 1.0, 2.0] {
            let motion = stage(&scene, exposure(open, open + 1.0), PIXELS).instances[0].motion.clone();
            assert!(motion.is_still() && (motion.at(0.0).translation.x - 5.0).abs() <= 0.0);
        }
    }
    let (first, last) = (1.0_f64, 1.0_f64);
    assert!(!(5.0 + 0.0 * (1.0 - first) / (last - first)).is_finite(), "the twin went unnoticed");
}

/// Could blow up: division by an exposure of no length. Bound: everything stands where it is at that instant. Twin:
/// that division.
#[test]
fn an_exposure_of_no_length_freezes_everything() {
    let scene = slide(Interpolation::Linear, &[0.0, 1.0], &[0.0, 1.0]);
    for amount in [0.0, 0.5, 2.0] {
        let rig_amount = amount;
        let mut scene_amount = slide(Interpolation::Linear, &[0.0, 1.0], &[0.0, 1.0]);
        scene_amount.nodes[1].blur_scale = Some(rig_amount);
        let motion = stage(&scene_amount, exposure(0.25, 0.25), PIXELS).instances[0].motion.clone();
        assert!(motion.is_still() && (motion.at(0.3).translation.x - 0.25).abs() <= 0.0);
    }
    let shortest = exposure(0.25, 0.25 + 1.0 / 4_294_967_296.0);
    assert!(stage(&scene, shortest, PIXELS).instances[0].motion.keys().iter().all(|k| k.is_finite()));
    assert!(!((0.25_f64 - 0.25) / shortest.duration().min(0.0)).is_finite(), "the twin went unnoticed");
}

/// Could blow up: the number of pieces. Bound: 2¹⁷ segments and a place of the curve at each key, however many keys lie
/// in the exposure. Twin: a segment for each of the file's.
#[test]
fn a_million_keys_in_an_exposure_are_followed_as_far_as_memory_allows() {
    let times: Vec<f64> = (0..1_000_000).map(|i| f64::from(i) * 1e-6).collect();
    let xs: Vec<f32> = (0..1_000_000_u32).map(|i| (i % 2) as f32).collect();
    let scene = slide(Interpolation::Linear, &times, &xs);
    let motion = stage(&scene, exposure(0.0, 1.0), PIXELS).instances[0].motion.clone();
    assert!(motion.keys().len() <= 1 << 17 && motion.keys().iter().all(|k| (0.0..=1.0).contains(&k.translation.x)));
    assert!(times.len() > 1 << 17, "the twin went unnoticed");
}
