//! Things that appear and vanish within an exposure are seen, and shine, for the part of it that they are there.
//!
//! Independent sampling, fixed seeds: a pixel that a thing covers while it is there is a mean of n draws of 0 or 1.

#![allow(clippy::unwrap_used, clippy::float_cmp, clippy::print_stdout, reason = "a test fails by panicking")]

#[path = "support/flat.rs"]
mod flat;
#[path = "support/moving.rs"]
mod moving;

use flat::{film, flat_scene, rectangle, settings};
use glam::{Quat, Vec3};
use graeco::film::Film;
use graeco::render::Settings;
use graeco::scene::{Interpolation, Light, LightShape, LocalTransform, Material, NodeId, Presence, Property, Scene};
use moving::{Builder, linear, track};

const SIZE: (u32, u32) = (8, 8);
const RUNS: u32 = 4096;

/// Visible from the first of `times` to the second, from the third to the fourth, and so on.
fn visible(b: &mut Builder, node: NodeId, times: &[f64]) {
    let values = (0..times.len()).map(|i| if i % 2 == 0 { 1.0 } else { 0.0 }).collect::<Vec<_>>();
    // Before the first key it is what the first key says: hidden from long ago.
    let (times, values) = ([&[-9.0], times].concat(), [&[0.0], &values[..]].concat());
    b.drive(node, Property::Visibility(track(Interpolation::Step, &times, values)));
}

fn bar(b: &mut Builder, node: NodeId) -> usize {
    b.mesh(node, &rectangle([-9.0, 9.0], [-2.0, 2.0]))
}

fn middle(film: &Film) -> f64 {
    f64::from(film.pixels()[4 * 8 + 4].radiance.x)
}

/// H₀: the middle pixel's mean is `part`. n = 4096, seed 11, within 4 standard errors (α = 6e-5 a case).
fn shown_for(name: &str, scene: &Scene, part: f64) {
    let found = middle(&film(scene, &settings(SIZE, RUNS), 0));
    let error = (part * (1.0 - part) / f64::from(RUNS)).sqrt();
    println!("{name}: there for {found:.4} of the exposure, want {part}");
    assert!((found - part).abs() <= 4.0 * error, "{name}: {found} {part}");
    // Planted twin: judged at mid-exposure, as a thing of blur amount 0 is.
    let nodes = ["1", "2"].into_iter().take(scene.nodes.len() - 1);
    let twin = Settings { blur_scale: nodes.map(|n| (n.into(), 0.0)).collect(), ..settings(SIZE, 64) };
    let frozen = middle(&film(scene, &twin, 0));
    assert!(frozen == 0.0 || frozen == 1.0, "{name}: {frozen}");
}

#[test]
fn a_still_thing_is_seen_for_as_long_as_it_is_visible() {
    let mut b = flat_scene(8);
    let n = b.node(None, Vec3::ZERO);
    bar(&mut b, n);
    visible(&mut b, n, &[0.25, 0.7]);
    shown_for("appears and vanishes", &b.finish(), 0.45);

    let mut b = flat_scene(8);
    let n = b.node(None, Vec3::ZERO);
    bar(&mut b, n);
    visible(&mut b, n, &[0.1, 0.2, 0.5, 0.6, 0.95]);
    shown_for("three times", &b.finish(), 0.25);
}

#[test]
fn a_parents_visibility_is_its_childrens_and_a_moving_thing_vanishes_too() {
    let mut b = flat_scene(8);
    let parent = b.node(None, Vec3::ZERO);
    let n = b.node(Some(parent), Vec3::ZERO);
    bar(&mut b, n);
    b.drive(n, Property::Translation(linear(&[(0.0, Vec3::ZERO), (1.0, Vec3::X)])));
    visible(&mut b, parent, &[-5.0, 0.3]);
    shown_for("moving child", &b.finish(), 0.3);
}

#[test]
fn spans_follow_the_keys_and_a_switch_outside_the_exposure_leaves_none() {
    let scene = |times: &[f64]| {
        let mut b = flat_scene(8);
        let n = b.node(None, Vec3::ZERO);
        bar(&mut b, n);
        visible(&mut b, n, times);
        b.finish()
    };
    let baked = |times: &[f64]| moving::stage(&scene(times), moving::exposure(1.0, 2.0), 0.1).instances;
    assert_eq!(baked(&[1.25, 1.5])[0].motion.presence(), &Presence::within(vec![[0.25, 0.5]]));
    assert!(baked(&[1.25, 1.5])[0].motion.is_still() && !baked(&[1.25, 1.5])[0].motion.is_constant());
    assert!(baked(&[0.0, 0.5, 1.0, 2.0])[0].motion.is_constant(), "there from opening to closing");
    assert!(baked(&[0.0, 1.0]).is_empty() && baked(&[2.0]).is_empty(), "gone when it opens, come when it has closed");
    let late = &baked(&[1.75])[0].motion;
    assert!(!late.presence().holds(0.749_999) && late.presence().holds(0.75) && late.presence().holds(1.0));
}

/// A white wall in the light of a lamp of each kind, switched off at two fifths of the exposure: every sample sees the
/// same light or none, so 0.4 of what it is with the lamp on is the truth, and the error the binomial one.
#[test]
fn lamps_shine_for_as_long_as_they_are_visible() {
    let lit = |lamp: usize, times: &[f64]| {
        let mut b = flat_scene(8);
        let wall = b.node(None, Vec3::ZERO);
        let mesh = bar(&mut b, wall);
        b.scene.materials.push(Material { double_sided: true, metallic: 0.0, ..Material::default() });
        b.scene.meshes[mesh].material = 1;
        let n = b.node(None, Vec3::new(0.0, 9.0, 9.0));
        let shape = [LightShape::Point { radius: 0.0 }, LightShape::Directional { angular_radius: 0.0 }];
        if let Some(shape) = shape.get(lamp) {
            b.scene.lights.push(Light { name: String::new(), shape: *shape, intensity: Vec3::splat(9.0), range: None });
            b.scene.nodes[n].light = Some(0);
            let rotation = Quat::from_rotation_x(-std::f32::consts::FRAC_PI_4);
            b.scene.nodes[n].local =
                LocalTransform::Parts { translation: Vec3::new(0.0, 9.0, 9.0), rotation, scale: Vec3::ONE };
        } else {
            // So small and far that its light is the same wherever on it a sample lies.
            let mesh = b.mesh(n, &rectangle([-0.01, 0.01], [-0.01, 0.01]));
            let emissive = Vec3::splat(1e6);
            b.scene.materials.push(Material { emissive, double_sided: true, ..Material::default() });
            b.scene.meshes[mesh].material = 2;
        }
        visible(&mut b, n, times);
        middle(&film(&b.finish(), &settings(SIZE, RUNS), 0))
    };
    for lamp in 0..3 {
        let (on, part) = (lit(lamp, &[-1.0]), lit(lamp, &[-1.0, 0.4]));
        println!("lamp {lamp}: {part} of {on}");
        assert!(on > 0.0 && (part / on - 0.4).abs() < 4.0 * (0.24 / f64::from(RUNS)).sqrt() + 0.005, "{part} {on}");
        assert_eq!(lit(lamp, &[2.0]), 0.0, "a lamp that is never there");
    }
}
