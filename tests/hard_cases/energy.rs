//! Case 13. What an exposure does to light: it is spread, never made or lost.
//!
//! What could fail: a streak that is normalised by its length, parts of an exposure that weigh alike whatever their
//! length, an amount that shifts the clock by a rounding. Twins: those.

use crate::flat::{difference, disc, film, flat_scene, rectangle, reds, rushing_ball, settings};
use crate::moving::linear;
use glam::{Vec3, Vec4};
use graeco::design::Kind;
use graeco::render::Settings;
use graeco::scene::{Material, Property, Scene};
use graeco::time::{FrameRate, ShutterPhase};

/// Could blow up: rounding of an object's own instants. Bound: none; amount 0 is the frozen picture, amount 1 the
/// picture without the attribute, bit for bit. Twin: an amount of 2⁻²³, and one short of 1 by as much.
#[test]
fn amount_zero_is_the_frozen_picture_and_amount_one_is_none_bit_for_bit() {
    const SIZE: (u32, u32) = (24, 20);
    // Centred on instant 0, so that the frozen picture is the same frame.
    let centred = |shutter| {
        let mut s = settings(SIZE, 32);
        (s.shutter, s.shutter_phase) = (Some(shutter), ShutterPhase::Centre);
        s
    };
    let bits = |scene: &Scene, s: &Settings| -> Vec<[u32; 3]> {
        film(scene, s, 0).pixels().iter().map(|p| p.radiance.to_array().map(f32::to_bits)).collect()
    };
    let frozen = bits(&rushing_ball(None), &centred(0.0));
    assert_eq!(bits(&rushing_ball(Some(0.0)), &centred(1.0)), frozen);
    let plain = bits(&rushing_ball(None), &centred(1.0));
    assert_eq!(bits(&rushing_ball(Some(1.0)), &centred(1.0)), plain);
    assert_ne!(plain, frozen);
    let overridden = Settings { blur_scale: vec![("1".into(), 0.0)], ..centred(1.0) };
    assert_eq!(bits(&rushing_ball(None), &overridden), frozen);
    assert_ne!(bits(&rushing_ball(Some(0.01)), &centred(1.0)), frozen, "the twin went unnoticed");
    assert_ne!(bits(&rushing_ball(Some(0.99)), &centred(1.0)), plain, "the twin went unnoticed");
}

/// H₀: the exposure [0, 1) is 0.3 [0, 0.3) + 0.7 [0.3, 1). n = 2048 independent samples a pixel each, seeds 11 to 13;
/// 480 pixels, all within 4.8 standard errors (α = 0.001, Šidák). Planted twin: equal weights.
#[test]
fn an_exposure_is_the_mean_of_its_parts_by_length() {
    const SIZE: (u32, u32) = (24, 20);
    const RUNS: u32 = 2048;
    let scene = rushing_ball(None);
    let part = |frame: i64, length: f64, seed: u64| {
        let mut s = settings(SIZE, RUNS);
        (s.rate, s.shutter) = (FrameRate::new(10, 1).unwrap(), Some(length));
        s.sampling.seed = seed;
        reds(&film(&scene, &s, frame), RUNS)
    };
    let (whole, first, second) = (part(0, 10.0, 11), part(0, 3.0, 12), part(3, 7.0, 13));
    let join = |a: f64, b: f64| -> Vec<(f64, f64)> {
        let parts = first.iter().zip(&second);
        parts.map(|(x, y)| (a * x.0 + b * y.0, a * a * x.1 + b * b * y.1)).collect()
    };
    let (worst, chi) = difference(&whole, &join(0.3, 0.7), f64::from(RUNS));
    println!("sum of exposures: worst {worst:.2} standard errors, sum of squares {chi:.2} deviations up");
    assert!(worst < 4.8 && chi < 4.0, "{worst} {chi}");
    assert!(difference(&whole, &join(0.5, 0.5), f64::from(RUNS)).0 > 10.0, "the planted twin passed");
}

/// H₀: the light of a moving thing, over the picture, is that of the still one (its area) at any speed. n = 4096
/// independent samples a pixel, seed 11, 160 pixels; within 3.3 standard errors (α = 0.004 over 4 speeds, Šidák).
/// Planted twin: normalisation by the streak's area.
#[test]
fn a_thing_gives_the_same_light_however_fast_it_moves() {
    const SIZE: (u32, u32) = (20, 8);
    for speed in [0.0_f32, 0.7, 5.0, 12.0] {
        let mut b = flat_scene(8);
        let n = b.node(None, Vec3::ZERO);
        b.mesh(n, &disc(2.0, 64));
        let keys = [(0.0, Vec3::NEG_X * speed / 2.0), (1.0, Vec3::X * speed / 2.0)];
        b.drive(n, Property::Translation(linear(&keys)));
        let estimates = reds(&film(&b.finish(), &settings(SIZE, 4096), 0), 4096);
        let (light, variance) = estimates.iter().fold((0.0, 0.0), |(s, v), e| (s + e.0, v + e.1));
        let truth = 64.0 * 0.5 * 4.0 * (std::f64::consts::TAU / 64.0).sin();
        let z = (light - truth) / variance.sqrt();
        println!("light at speed {speed}: {light:.4} of {truth:.4}, {z:.2} standard errors");
        assert!(z.abs() < 3.3, "{speed}: {light} {truth} {z}");
        let twin = light * 2.0 / (2.0 + f64::from(speed));
        assert!(speed < 0.5 || ((twin - truth) / variance.sqrt()).abs() > 10.0, "the planted twin passed");
    }
}

/// What a glowing square that flies over a floor throws on it, over the whole floor, is what the still one does: its
/// power, but for what passes beyond the floor's edge. Bound: 5 %, mostly noise. Twin: the picture of mid-exposure alone
/// has the same sum, so the twin is again a streak that is thinned by its length.
#[test]
fn an_emitter_throws_the_same_light_however_fast_it_moves() {
    const SIZE: (u32, u32) = (48, 32);
    let thrown = |speed: f32| -> f64 {
        let mut b = flat_scene(32);
        let floor = b.node(None, Vec3::ZERO);
        let mesh = b.mesh(floor, &rectangle([-24.0, 24.0], [-16.0, 16.0]));
        b.scene.materials.push(Material { metallic: 0.0, ..Material::default() });
        b.scene.meshes[mesh].material = 1;
        let lamp = b.node(None, Vec3::ZERO);
        // It shines down only, and its back is not seen by the camera above.
        let down: Vec<Vec3> = rectangle([-0.5, 0.5], [-0.5, 0.5]).chunks(3).flat_map(|t| [t[0], t[2], t[1]]).collect();
        let mesh = b.mesh(lamp, &down);
        let glow =
            Material { emissive: Vec3::splat(40.0), base_color: Vec4::new(0.0, 0.0, 0.0, 1.0), ..Material::default() };
        b.scene.materials.push(glow);
        b.scene.meshes[mesh].material = 2;
        let at = |x: f32| Vec3::new(x, 0.0, 1.0);
        b.drive(lamp, Property::Translation(linear(&[(0.0, at(-speed / 2.0)), (1.0, at(speed / 2.0))])));
        let mut s = settings(SIZE, 64);
        s.sampling.kind = Kind::Auto;
        film(&b.finish(), &s, 0).pixels().iter().map(|p| f64::from(p.radiance.x)).sum()
    };
    let still = thrown(0.0);
    assert!(still > 1.0, "the floor is lit: {still}");
    for speed in [1.0_f32, 5.0, 12.0] {
        let moved = thrown(speed);
        println!("light on the floor at {speed} m an exposure: {:+.2e}", moved / still - 1.0);
        assert!((moved / still - 1.0).abs() < 0.05, "{speed}: {moved} {still}");
        let twin = moved / (1.0 + f64::from(speed));
        assert!((twin / still - 1.0).abs() > 0.05, "the twin went unnoticed");
    }
}
