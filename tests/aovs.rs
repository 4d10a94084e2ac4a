//! Planes beside the picture against what a simple scene must give.
#![allow(
    clippy::unwrap_used,
    clippy::print_stderr,
    clippy::print_stdout,
    clippy::cast_possible_truncation,
    clippy::cast_precision_loss,
    reason = "helpers of tests: a failure is a panic, numbers are small, and skipped tests say so"
)]

#[path = "support/shots.rs"]
mod shots;

use glam::{DAffine3, DVec3, Vec3, Vec4};
use graeco::output::Plane;
use graeco::render::aovs::Aov;
use graeco::render::{Progress, Scanning, Settings, Shot, Surroundings};
use graeco::scene::{
    Animation, Camera, Channel, Interpolation, Lens, LocalTransform, Material, Mesh, Node, Projection, Property, Scene,
    Track,
};
use graeco::time::Parity;
use graeco::trace::environment::Background;

const SIZE: (u32, u32) = (40, 30);
/// Metres a second.
const SPEED: f32 = 1.2;

/// A square of side 2 at z = −4, facing the camera at the origin and moving to the right.
fn scene() -> Scene {
    let mesh = Mesh {
        positions: vec![
            Vec3::new(-1.0, -1.0, 0.0),
            Vec3::new(1.0, -1.0, 0.0),
            Vec3::new(1.0, 1.0, 0.0),
            Vec3::new(-1.0, 1.0, 0.0),
        ],
        triangles: vec![[0, 1, 2], [0, 2, 3]],
        ..Mesh::default()
    };
    let material = Material { base_color: Vec4::new(0.2, 0.4, 0.6, 1.0), metallic: 0.0, ..Material::default() };
    let camera = Camera {
        name: String::new(),
        projection: Projection::Perspective { yfov: std::f32::consts::FRAC_PI_2, aspect: None },
        near_far: (0.1, None),
        lens: Lens::default(),
    };
    let track = Track {
        times: vec![-10.0, 10.0],
        values: vec![Vec3::new(-10.0 * SPEED, 0.0, -4.0), Vec3::new(10.0 * SPEED, 0.0, -4.0)],
        width: 1,
        interpolation: Interpolation::Linear,
    };
    Scene {
        nodes: vec![
            Node { local: LocalTransform::default(), meshes: vec![0], visible: true, ..Node::default() },
            Node {
                local: LocalTransform::Matrix(DAffine3::from_translation(DVec3::ZERO)),
                camera: Some(0),
                visible: true,
                ..Node::default()
            },
        ],
        order: vec![0, 1],
        meshes: vec![mesh],
        materials: vec![material],
        cameras: vec![camera],
        animations: vec![Animation {
            name: String::new(),
            channels: vec![Channel { node: 0, property: Property::Translation(track) }],
        }],
        ..Scene::default()
    }
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
    assert!((plane(&planes, "object.id")[MIDDLE] - 1.0).abs() < f32::EPSILON);
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
