//! Tiny pictures of moving things seen by a parallel camera whose pixels are one metre, and the statistics by which
//! two such pictures are compared. The file that uses it has `moving` at its root.
#![allow(dead_code, unreachable_pub, missing_docs, reason = "each test binary uses its own part")]
#![allow(clippy::unwrap_used, reason = "a test that cannot begin has failed")]

use crate::moving::{Builder, linear};
use glam::{Quat, Vec3};
use graeco::design::{DesignOptions, Kind};
use graeco::film::{Film, FilterSpec};
use graeco::output::PixelAspect;
use graeco::render::{Progress, Scanning, Settings, Shot, Surroundings};
use graeco::scene::rig::Playback;
use graeco::scene::view::ViewRequest;
use graeco::scene::{Light, LightShape, Material, Projection, Property, Scene};
use graeco::time::{FrameRate, ShutterPhase};
use graeco::trace::environment::Background;
use graeco::trace::texture::TextureFilter;

/// One exposure of a second from instant 0: independent sampling, no bounce.
pub fn settings(size: (u32, u32), runs: u32) -> Settings {
    Settings {
        size,
        crop: None,
        pixel_aspect: PixelAspect::SQUARE,
        rate: FrameRate::new(1, 1).unwrap(),
        shutter: Some(1.0),
        shutter_phase: ShutterPhase::Start,
        shutter_curve: "box".into(),
        scanning: Scanning::Progressive,
        line_height: 1.0,
        view: ViewRequest { motion_error: 1e-3, size, pixel_aspect: 1.0, ..ViewRequest::default() },
        playback: Playback::default(),
        blur_scale: Vec::new(),
        sampling: DesignOptions { kind: Kind::Random, runs, seed: 11, ..DesignOptions::default() },
        adaptive: None,
        filter: FilterSpec::BOX,
        texture_filter: TextureFilter::Point,
        bounces: 0,
        sure_bounces: 1,
        caustics: graeco::trace::path::Caustics::default(),
        aovs: Default::default(),
    }
}

pub fn film(scene: &Scene, settings: &Settings, frame: i64) -> Film {
    let surroundings = Surroundings { background: Background::Black, name: "black".into() };
    let mut shot = Shot::new(scene, settings, &surroundings, "test").unwrap();
    let film = shot.render(frame, &Progress::default()).unwrap().unwrap().film;
    assert_eq!(film.rejected(), 0, "no sample is rejected");
    film
}

/// A scene seen by a parallel camera `height` metres high, with a white material that shows as it is.
pub fn flat_scene(height: u16) -> Builder {
    let mut b = Builder::new(20.0);
    let ymag = f32::from(height) / 2.0;
    b.scene.cameras[0].projection = Projection::Orthographic { xmag: ymag, ymag };
    b.scene.materials[0] = white();
    b
}

pub fn white() -> Material {
    Material { unlit: true, double_sided: true, ..Material::default() }
}

/// A rectangle in the plane z = 0.
pub fn rectangle(x: [f32; 2], y: [f32; 2]) -> Vec<Vec3> {
    let p = |i: usize, j: usize| Vec3::new(x[i], y[j], 0.0);
    vec![p(0, 0), p(1, 0), p(1, 1), p(0, 0), p(1, 1), p(0, 1)]
}

/// A disc as a polygon of `n` sides.
pub fn disc(radius: f32, n: u16) -> Vec<Vec3> {
    let at = |i: u16| {
        let a = std::f32::consts::TAU * f32::from(i) / f32::from(n);
        Vec3::new(radius * libm::cosf(a), radius * libm::sinf(a), 0.0)
    };
    (0..n).flat_map(|i| [Vec3::ZERO, at(i), at(i + 1)]).collect()
}

/// A ball (of `rings` × 2 `rings` facets).
pub fn ball(radius: f32, rings: u16) -> Vec<Vec3> {
    let at = |i: u16, j: u16| {
        let (a, e) = (
            std::f32::consts::PI * f32::from(j) / f32::from(rings),
            std::f32::consts::PI * (f32::from(i) / f32::from(rings) - 0.5),
        );
        radius * Vec3::new(libm::cosf(e) * libm::cosf(a), libm::sinf(e), libm::cosf(e) * libm::sinf(a))
    };
    let quads = (0..rings).flat_map(|i| (0..2 * rings).map(move |j| (i, j)));
    quads
        .flat_map(|(i, j)| [at(i, j), at(i + 1, j + 1), at(i, j + 1), at(i, j), at(i + 1, j), at(i + 1, j + 1)])
        .collect()
}

/// A ball that rushes by at y = 6, its shadow on a wall behind at y = 0, its reflection in a slanted mirror at y = −7.
pub fn rushing_ball(amount: Option<f32>) -> Scene {
    let mut b = flat_scene(20);
    let n = b.node(None, Vec3::ZERO);
    b.mesh(n, &ball(1.0, 12));
    // Six metres in the exposure, and on beyond it: amounts above 1 reach there.
    let keys = [(-1.0, Vec3::new(-9.0, 6.0, 0.0)), (2.0, Vec3::new(9.0, 6.0, 0.0))];
    b.drive(n, Property::Translation(linear(&keys)));
    b.scene.nodes[n].blur_scale = amount;
    let wall = b.node(None, Vec3::new(0.0, 0.0, -6.0));
    let mesh = b.mesh(wall, &rectangle([-12.0, 12.0], [-3.0, 3.0]));
    b.scene.materials.push(Material { metallic: 0.0, double_sided: true, ..Material::default() });
    b.scene.meshes[mesh].material = 1;
    let mirror = b.node(None, Vec3::new(0.0, -7.0, 0.0));
    let slanted: Vec<Vec3> = rectangle([-12.0, 12.0], [-2.0, 2.0]).iter().map(|p| Vec3::new(p.x, p.y, -p.y)).collect();
    let mesh = b.mesh(mirror, &slanted);
    b.scene.materials.push(Material { roughness: 0.0, double_sided: true, ..Material::default() });
    b.scene.meshes[mesh].material = 2;
    let sun = b.node(None, Vec3::ZERO);
    b.scene.nodes[sun].local = graeco::scene::LocalTransform::Parts {
        translation: Vec3::ZERO,
        rotation: Quat::from_rotation_x(-std::f32::consts::FRAC_PI_4),
        scale: Vec3::ONE,
    };
    b.scene.nodes[sun].light = Some(0);
    let shape = LightShape::Directional { angular_radius: 0.0 };
    b.scene.lights.push(Light { name: String::new(), shape, intensity: Vec3::splat(3.0), range: None });
    b.finish()
}

/// Means of `runs` independent runs, red, and their variances.
///
/// Not the film's own estimate of the variance: that comes from the runs' four quarters and is so right only on
/// average, with three degrees of freedom, that dividing by it gives errors with the long tails of Student's t, where
/// 5 of 120 is no surprise. Values in [0, 1] with mean p have a variance of p (1 − p) at most, and exactly that where
/// only 0 and 1 occur (Bhatia and Davis 2000).
pub fn reds(film: &Film, runs: u32) -> Vec<(f64, f64)> {
    let mean = |p: &graeco::film::PixelEstimate| f64::from(p.radiance.x);
    film.pixels().iter().map(|p| (mean(p), mean(p) * (1.0 - mean(p)) / f64::from(runs - 1))).collect()
}

/// Largest difference of two films of `n` runs or more in standard errors, and how many standard deviations the sum of
/// all their squares (χ² of as many degrees as pixels) lies above its mean. Pixels of which fewer than nine runs decide
/// know their variance too badly for that: they may differ by thirty runs.
pub fn difference(a: &[(f64, f64)], b: &[(f64, f64)], n: f64) -> (f64, f64) {
    let (mut worst, mut squares, mut noisy) = (0.0_f64, 0.0, 0.0);
    for (&(x, vx), &(y, vy)) in a.iter().zip(b) {
        if vx.min(vy) >= 9.0 / (n * n) {
            let z = (x - y).abs() / (vx + vy).sqrt();
            worst = worst.max(z);
            noisy += 1.0;
            squares += z * z;
        } else if (x - y).abs() > 30.0 / n {
            worst = f64::INFINITY;
        }
    }
    assert!(noisy > 10.0, "the test sees motion");
    (worst, (squares - noisy) / (2.0_f64 * noisy).sqrt())
}
