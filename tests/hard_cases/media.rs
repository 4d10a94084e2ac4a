//! Bodies in bodies: what could fail is every boundary taken for one with air. Slabs are seen aslant by a parallel
//! camera over a background that is white beyond x = 0, so that the share of white says how far they shift the view; over
//! an all-white one the mean says what they let through. Twin: each boundary against air.

use super::flat::{film, flat_scene, rectangle, settings, white};
use glam::{Quat, Vec3, Vec4};
use graeco::render::Settings;
use graeco::scene::material::{Transmission, Volume};
use graeco::scene::{Material, Scene};

/// How far the slabs are turned about y.
const TILT: f64 = 0.7;
const AIR: f64 = 1.0;
const WATER: f64 = 1.33;
const GLASS: f64 = 1.5;

/// A box of half width `half`, from depth `from` to `to` below the origin, turned by [`TILT`].
fn slab(half: f32, from: f32, to: f32) -> Vec<Vec3> {
    let corner = |i: u8| {
        let pick = |bit: u8, low: f32, high: f32| if i >> bit & 1 == 0 { low } else { high };
        let p = Vec3::new(pick(0, -half, half), pick(1, -half, half), pick(2, -to, -from));
        Quat::from_rotation_y(TILT as f32) * p
    };
    let quads = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
    quads.iter().flat_map(|q| [q[0], q[1], q[2], q[0], q[2], q[3]]).map(corner).collect()
}

/// Slabs of (index, half width, from, to); equal indices share a material. The background is white from x = `white_from`.
fn scene(slabs: &[(f64, f32, f32, f32)], white_from: f32) -> Scene {
    let mut b = flat_scene(8);
    let back = b.node(None, Vec3::new(0.0, 0.0, -20.0));
    b.mesh(back, &rectangle([white_from, 40.0], [-40.0, 40.0]));
    let black = b.node(None, Vec3::new(0.0, 0.0, -20.1));
    let mesh = b.mesh(black, &rectangle([-40.0, 40.0], [-40.0, 40.0]));
    b.scene.materials.push(Material { base_color: Vec4::W, ..white() });
    b.scene.meshes[mesh].material = 1;
    for &(ior, half, from, to) in slabs {
        let node = b.node(None, Vec3::ZERO);
        let mesh = b.mesh(node, &slab(half, from, to));
        let known = b
            .scene
            .materials
            .iter()
            .position(|m| m.transmission.is_some() && f64::from(m.ior) == f64::from(ior as f32));
        b.scene.meshes[mesh].material = known.unwrap_or_else(|| {
            let volume =
                Some(Volume { thickness: 1.0, attenuation_distance: f32::INFINITY, attenuation_color: Vec3::ONE });
            let transmission = Some(Transmission { factor: 1.0, texture: None, volume, dispersion: 0.0 });
            b.scene.materials.push(Material {
                metallic: 0.0,
                roughness: 0.0,
                ior: ior as f32,
                transmission,
                ..Material::default()
            });
            b.scene.materials.len() - 1
        });
    }
    b.finish()
}

/// Mean over a picture of 8 × 8 m and its standard error.
fn mean(scene: &Scene) -> (f64, f64) {
    mean_after(scene, 0)
}

/// The same with paths of some `bounces`.
fn mean_after(scene: &Scene, bounces: u16) -> (f64, f64) {
    const RUNS: u32 = 2048;
    let film = film(scene, &Settings { bounces, ..settings((8, 8), RUNS) }, 0);
    let n = film.pixels().len() as f64;
    let mean = film.pixels().iter().map(|p| f64::from(p.radiance.x)).sum::<f64>() / n;
    (mean, (mean * (1.0 - mean) / (n * f64::from(RUNS))).sqrt())
}

/// What the slabs let through, and how far they move the view along x, metres.
fn measured(slabs: &[(f64, f32, f32, f32)]) -> [(f64, f64); 2] {
    let (through, error) = mean(&scene(slabs, -40.0));
    let (half, half_error) = mean(&scene(slabs, 0.0));
    let share = half / through;
    [(through, error), ((share - 0.5) * 8.0, 8.0 * (half_error / through).hypot(error * share / through))]
}

/// Sine within index `n` of a ray that enters from air at [`TILT`].
fn sine(n: f64) -> f64 {
    TILT.sin() / n
}

/// Fresnel's reflectance between indices `a` and `b`, both polarisations alike.
fn reflectance(a: f64, b: f64) -> f64 {
    let (ca, cb) = ((1.0 - sine(a).powi(2)).sqrt(), (1.0 - sine(b).powi(2)).sqrt());
    let s = (a * ca - b * cb) / (a * ca + b * cb);
    let p = (b * ca - a * cb) / (b * ca + a * cb);
    0.5 * (s * s + p * p)
}

/// What boundaries that do not absorb let through with all light that goes to and fro between them:
/// (1 − T) / T = Σ R / (1 − R) (Stokes 1862).
fn through(boundaries: &[f64]) -> f64 {
    1.0 / (1.0 + boundaries.iter().map(|r| r / (1.0 - r)).sum::<f64>())
}

/// How far layers of (index, thickness) move the view.
fn shift(layers: &[(f64, f64)]) -> f64 {
    layers
        .iter()
        .map(|&(n, thickness)| {
            let inner = sine(n).asin();
            thickness * (TILT - inner).sin() / inner.cos()
        })
        .sum()
}

/// Light that goes to and fro once more comes out a few metres aside: R² of it, two thousandths at most.
const ASIDE: f64 = 0.01;

fn check(name: &str, slabs: &[(f64, f32, f32, f32)], indices: &[f64], layers: &[(f64, f64)], twin: (f64, f64)) {
    let boundaries: Vec<f64> = indices.windows(2).map(|w| reflectance(w[0], w[1])).collect();
    let want = [through(&boundaries), shift(layers)];
    let got = measured(slabs);
    println!("{name}: lets through {:.4?} of {:.4}, shifts by {:.3?} m of {:.3}", got[0], want[0], got[1], want[1]);
    assert!((got[0].0 - want[0]).abs() < 4.0 * got[0].1, "{name}: {got:?} {want:?}");
    let shifted = got[1].0.abs();
    assert!((shifted - want[1]).abs() < 4.0 * got[1].1 + ASIDE, "{name}: {got:?} {want:?}");
    let (passes, moves) = twin;
    let noticed = (passes - want[0]).abs() > 4.0 * got[0].1 || (moves - want[1]).abs() > 4.0 * got[1].1 + ASIDE;
    assert!(noticed, "{name}: the twin went unnoticed");
}

/// H₀: both figures are those of Snell's and Fresnel's laws at every boundary. n = 131 072 independent paths each, seed 11;
/// six figures within four standard errors.
#[test]
fn bodies_in_bodies_bend_light_by_the_ratio_of_their_indices() {
    let against_air = WATER * GLASS;
    let air_water = reflectance(AIR, WATER);
    // Glass met in water as if in air.
    let wrong = reflectance(WATER, against_air);
    check(
        "glass in water",
        &[(WATER, 10.0, 0.0, 4.0), (GLASS, 9.0, 1.0, 2.5)],
        &[AIR, WATER, GLASS, WATER, AIR],
        &[(WATER, 2.5), (GLASS, 1.5)],
        (through(&[air_water, wrong, wrong, air_water]), shift(&[(WATER, 2.5), (against_air, 1.5)])),
    );
    check(
        "a drink that reaches into its glass",
        &[(GLASS, 10.0, 0.0, 1.0), (WATER, 10.0, 0.9, 3.0), (GLASS, 10.0, 2.9, 3.9)],
        &[AIR, GLASS, WATER, GLASS, AIR],
        &[(GLASS, 1.9), (WATER, 2.0)],
        (through(&[reflectance(AIR, GLASS); 4]), shift(&[(GLASS, 2.0), (WATER, 2.1)])),
    );
    check(
        "two of one glass",
        &[(GLASS, 10.0, 0.0, 2.0), (GLASS, 9.0, 1.0, 3.0)],
        &[AIR, GLASS, AIR],
        &[(GLASS, 3.0)],
        (through(&[reflectance(AIR, GLASS); 4]), shift(&[(GLASS, 4.0)])),
    );
}

/// What is seen through frosted glass is no bounce: direct light alone shows it, but for what facets reflect to and fro,
/// at most a twentieth. n = 131 072 paths each, seed 11. Were passing through a bounce, nothing would be seen.
#[test]
fn frosted_glass_shows_what_lies_behind_it_without_bounces() {
    for roughness in [0.0_f32, 0.1, 0.3] {
        let mut scene = scene(&[(GLASS, 10.0, 0.0, 1.0)], -40.0);
        for material in scene.materials.iter_mut().filter(|m| m.transmission.is_some()) {
            material.roughness = roughness;
        }
        let ((direct, error), (whole, _)) = (mean_after(&scene, 0), mean_after(&scene, 8));
        println!("roughness {roughness}: {direct:.4} without bounces, {whole:.4} with eight");
        assert!(direct <= whole + 6.0 * error && direct > 0.95 * whole, "{roughness}: {direct} of {whole}");
        assert!(whole > 0.8, "{roughness}: {whole}");
    }
}
