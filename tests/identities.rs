//! What must hold bit for bit, or in closed form, whatever the scene.
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

use glam::Vec3;
use graeco::film::Film;
use graeco::render::{Scanning, Settings};
use graeco::scene::{AlphaMode, Material, Mesh, Node, Scene, Specular};
use graeco::time::Parity;
use graeco::trace::environment::Background;
use shots::{load, render};

const SIZE: (u32, u32) = (48, 32);

fn settings(runs: u32, bounces: u16) -> Settings {
    shots::settings(SIZE, runs, bounces)
}

fn bits(film: &Film) -> Vec<[u32; 3]> {
    film.pixels().iter().map(|p| p.radiance.to_array().map(f32::to_bits)).collect()
}

/// A cube of side 2 around the origin; `inside`: its faces look inwards.
fn cube(inside: bool) -> Mesh {
    let mut mesh = Mesh { name: "cube".into(), ..Mesh::default() };
    for axis in 0..3 {
        for sign in [-1.0_f32, 1.0] {
            let (mut n, mut u) = (Vec3::ZERO, Vec3::ZERO);
            n[axis] = sign;
            u[(axis + 1) % 3] = 1.0;
            let v = n.cross(u);
            let first = u32::try_from(mesh.positions.len()).unwrap();
            mesh.positions.extend([n - u - v, n + u - v, n + u + v, n - u + v]);
            for t in [[0, 1, 2], [0, 2, 3]] {
                let t = t.map(|i| first + i);
                mesh.triangles.push(if inside { [t[0], t[2], t[1]] } else { t });
            }
        }
    }
    mesh
}

fn one_object(mesh: Mesh, material: Material) -> Scene {
    Scene {
        nodes: vec![Node { meshes: vec![0], visible: true, ..Node::default() }],
        order: vec![0],
        meshes: vec![mesh],
        materials: vec![material],
        ..Scene::default()
    }
}

#[test]
fn one_thread_and_many_give_the_same_bits() {
    let scene = load("animations/pool.glb");
    let with = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| bits(&render(&scene, &settings(4, 1), Background::Black, 12)))
    };
    let one = with(1);
    assert_eq!(one, with(2));
    assert_eq!(one, with(5));
}

#[test]
fn a_crop_is_the_same_pixels_of_the_whole() {
    let scene = load("animations/pool.glb");
    let whole = render(&scene, &settings(4, 1), Background::Black, 12);
    let cropped = Settings { crop: Some([11, 5, 19, 21]), ..settings(4, 1) };
    let crop = render(&scene, &cropped, Background::Black, 12);
    let (whole_bits, crop_bits) = (bits(&whole), bits(&crop));
    for y in 0..21 {
        for x in 0..19 {
            assert_eq!(crop_bits[y * 19 + x], whole_bits[(y + 5) * SIZE.0 as usize + x + 11]);
        }
    }
}

#[test]
fn fields_of_a_still_scene_weave_into_its_frame() {
    let scene = load("scenes/cornell.glb");
    let field = Scanning::Interlaced { first: Parity::Bottom };
    // Draws differ between fields and frame; without anything to draw but the film position, means agree. A single
    // colour per pixel would hide a shift of lines, so the crop holds edges.
    let woven = render(&scene, &Settings { scanning: field, ..settings(256, 0) }, Background::Black, 0);
    let frame = render(&scene, &settings(256, 0), Background::Black, 0);
    // H0: equal means. 1536 pixels x 3 channels, n = 256, seed 7; 6 standard errors of the difference: alpha < 1e-5
    // over all, and a shift by one line moves edge pixels by tens of standard errors.
    let mut worst = 0.0_f32;
    for (a, b) in woven.pixels().iter().zip(frame.pixels()) {
        let tolerance = (a.variance + b.variance).map(f32::sqrt) * 6.0 + 2e-3;
        worst = worst.max(((a.radiance - b.radiance).abs() / tolerance).max_element());
    }
    assert!(worst < 1.0, "a pixel is {worst} times the tolerance off");
}

/// Albedo a, emission 1 − a, seen from inside: each bounce adds a of what the one before did, and after d bounces the
/// picture reads (1 − a)(1 + a + a² + …) = 1 − a^(d+2): emission, direct light, and d bounces of it.
#[test]
fn a_furnace_returns_its_closed_form() {
    for albedo in [0.5, 0.1] {
        assert_closed_form(albedo);
    }
}

fn assert_closed_form(albedo: f32) {
    let material = Material {
        base_color: glam::Vec3::splat(albedo).extend(1.0),
        metallic: 0.0,
        roughness: 1.0,
        // Schlick's reflectance rises to 1 at grazing angles whatever the index; without it the surface is Lambert's.
        specular: Some(Specular { factor: 0.0, texture: None, color: Vec3::ONE, color_texture: None }),
        emissive: Vec3::splat(1.0 - albedo),
        alpha_mode: AlphaMode::Opaque,
        double_sided: true,
        ..Material::default()
    };
    let mut scene = one_object(cube(true), material);
    scene.cameras.push(graeco::scene::Camera {
        name: String::new(),
        projection: graeco::scene::Projection::Perspective { yfov: 1.2, aspect: None },
        near_far: (0.01, None),
        lens: graeco::scene::Lens::default(),
    });
    scene.nodes.push(Node { camera: Some(0), visible: true, ..Node::default() });
    scene.order.push(1);
    // Of the dark furnace's long paths most end by chance: after the first bounce, the second or the third; of the grey one's
    // after the fourth.
    for (bounces, sure_bounces) in [(0, 2), (1, 2), (3, 3), (6, 0), (6, 1), (6, 2)] {
        let settings = Settings { sure_bounces, ..settings(256, bounces) };
        let film = render(&scene, &settings, Background::Black, 0);
        let n = film.pixels().len();
        let mean = film.pixels().iter().map(|p| f64::from(p.radiance.x)).sum::<f64>() / n as f64;
        let variance = film.pixels().iter().map(|p| f64::from(p.variance.x)).sum::<f64>() / (n * n) as f64;
        let expected = 1.0 - f64::from(albedo).powi(i32::from(bounces) + 2);
        // H0: the mean is the closed form; 1536 pixels of 256 runs, seed 7, 4 standard errors (alpha 6e-5), and 1e-4
        // for the rounding of the sums.
        let tolerance = 4.0 * variance.sqrt() + 1e-4;
        assert!(
            (mean - expected).abs() < tolerance,
            "albedo {albedo}, {bounces} bounces, {sure_bounces} sure: {mean} for {expected} ± {tolerance}"
        );
    }
}

#[test]
fn a_closed_white_box_under_a_white_sky_never_exceeds_one() {
    let white = Material { metallic: 0.0, roughness: 1.0, base_color: glam::Vec4::ONE, ..Material::default() };
    let scene = one_object(cube(false), white);
    let film = render(&scene, &settings(64, 4), Background::Constant(Vec3::ONE), 0);
    let n = film.pixels().len() as f64;
    let mean = film.pixels().iter().map(|p| f64::from(p.radiance.max_element())).sum::<f64>() / n;
    let variance = film.pixels().iter().map(|p| f64::from(p.variance.max_element())).sum::<f64>() / (n * n);
    // H0: the mean is at most 1; 1536 pixels of 64 runs, seed 7, 4 standard errors, and 1e-3 as the model allows itself.
    assert!(mean <= 1.0 + 4.0 * variance.sqrt() + 1e-3, "{mean}");
    assert!(mean > 0.99, "{mean}");
    assert!(film.pixels().iter().all(|p| p.rejected == 0));
}
