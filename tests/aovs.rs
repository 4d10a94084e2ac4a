//! Planes beside the picture against what a simple scene must give.
#![allow(
    clippy::unwrap_used,
    clippy::print_stderr,
    clippy::print_stdout,
    clippy::cast_possible_truncation,
    clippy::cast_precision_loss,
    reason = "helpers of tests: a failure is a panic, numbers are small, and skipped tests say so"
)]

#[path = "support/flat.rs"]
mod flat;
#[path = "support/moving.rs"]
mod moving;
#[path = "support/shots.rs"]
mod shots;

use flat::rectangle;
use glam::{Vec3, Vec4};
use graeco::output::Plane;
use graeco::render::aovs::Aov;
use graeco::render::{Progress, Scanning, Settings, Shot, Surroundings};
use graeco::scene::{Material, Projection, Property, Scene};
use graeco::time::Parity;
use graeco::trace::environment::Background;
use moving::{Builder, linear};

const SIZE: (u32, u32) = (40, 30);
/// Metres a second.
const SPEED: f32 = 1.2;

/// A square of side 2 at z = −4, facing the camera at the origin and moving to the right.
fn scene() -> Scene {
    let mut b = Builder::new(0.0);
    b.scene.cameras[0].projection = Projection::Perspective { yfov: std::f32::consts::FRAC_PI_2, aspect: None };
    b.scene.materials[0] = Material { base_color: Vec4::new(0.2, 0.4, 0.6, 1.0), metallic: 0.0, ..Material::default() };
    let square = b.node(None, Vec3::ZERO);
    b.mesh(square, &rectangle([-1.0, 1.0], [-1.0, 1.0]));
    let at = |seconds: f32| Vec3::new(seconds * SPEED, 0.0, -4.0);
    b.drive(square, Property::Translation(linear(&[(-10.0, at(-10.0)), (10.0, at(10.0))])));
    b.finish()
}

fn planes(settings: &Settings) -> Vec<Plane> {
    let (scene, surroundings) =
        (scene(), Surroundings { background: Background::Constant(Vec3::ONE), name: String::new() });
    let mut shot = Shot::new(&scene, settings, &surroundings, "").unwrap();
    shot.render(3, &Progress::default()).unwrap().unwrap().planes
}

fn plane<'a>(planes: &'a [Plane], name: &str) -> &'a [f32] {
    &planes.iter().find(|p| p.name == name).unwrap().samples
}

fn all() -> Settings {
    let aovs = Aov::ALL.iter().map(|(_, aov)| *aov).collect();
    Settings { aovs, ..shots::settings(SIZE, 16, 0) }
}

const MIDDLE: usize = 15 * 40 + 20;

#[test]
fn depth_normal_albedo_and_object_are_the_surface_s() {
    let planes = planes(&all());
    assert!((plane(&planes, "depth.Z")[MIDDLE] - 4.0).abs() < 1e-5);
    assert!((plane(&planes, "normal.Z")[MIDDLE] - 1.0).abs() < 1e-6);
    assert!((plane(&planes, "albedo.G")[MIDDLE] - 0.4).abs() < 1e-6);
    // The camera's node is the first.
    assert!((plane(&planes, "object.id")[MIDDLE] - 2.0).abs() < f32::EPSILON);
    // Above the square there is only sky.
    assert!(plane(&planes, "depth.Z")[20].is_infinite());
    assert!(plane(&planes, "object.id")[20].abs() < f32::EPSILON);
    // Half a frame's exposure, of which the mean sample is the middle; 16 strata of it, each jittered.
    let exposure = 0.5 / 24.0;
    assert!((plane(&planes, "time.T")[MIDDLE] - 0.5 * exposure).abs() < exposure / 16.0);
}

#[test]
fn motion_counts_pixels_to_the_previous_and_next_frame() {
    let planes = planes(&all());
    // At distance 4 a pixel is 2 · 4 · tan(45°) / 30 m high and wide.
    let per_frame = SPEED / 24.0 / (8.0 / 30.0);
    assert!((plane(&planes, "motion.nextX")[MIDDLE] - per_frame).abs() < 1e-4);
    assert!((plane(&planes, "motion.prevX")[MIDDLE] + per_frame).abs() < 1e-4);
    assert!(plane(&planes, "motion.nextY")[MIDDLE].abs() < 1e-4);
}

#[test]
fn motion_of_fields_counts_to_the_neighbouring_field() {
    let scanning = Scanning::Interlaced { first: Parity::Top };
    let planes = planes(&Settings { scanning, ..all() });
    let per_field = SPEED / 48.0 / (8.0 / 30.0);
    for line in [14, 15] {
        assert!((plane(&planes, "motion.nextX")[line * 40 + 20] - per_field).abs() < 1e-4);
    }
}
