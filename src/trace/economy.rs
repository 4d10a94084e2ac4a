//! Tests that rays do no work for effects which are not there: what stands still is never interpolated though other
//! things move, opaque surfaces are never asked whether they are there, lights without extent draw no numbers.
#![allow(clippy::cast_precision_loss, clippy::cast_possible_truncation, reason = "test scenes are small")]

use super::accel::Accel;
use super::bsdf::Materials;
use super::camera::CameraRays;
use super::environment::{Background, Environment};
use super::lights::Lights;
use super::path::{Caustics, Parts, PathLengths, PathTracer};
use super::texture::TextureFilter;
use super::{Backs, FilmPoint, ImageFunction, Ray};
use crate::design::{Design, DesignOptions, PixelAddress, drawn};
use crate::factor::Factor;
use crate::scene::motion::lerped;
use crate::scene::texture::TexelFilter;
use crate::scene::{
    AlphaMode, Geometry, Image, Instance, Light, LightShape, Material, Mesh, Motion, Pixels, Projection, Scene, Stage,
    StageCamera, StageLight, Texture, TextureRef, Wrap,
};
use crate::time::Exposure;
use glam::{Affine2, Affine3A, DVec2, Vec3, Vec3A, Vec4};

/// A square of two metres around the origin, facing +z, of `material`; `instances` of it at the motions given.
fn squares(material: Material, motions: Vec<Motion>) -> (Scene, Stage) {
    let corner = |x: f32, y: f32| Vec3::new(x, y, 0.0);
    let positions = vec![corner(-1., -1.), corner(1., -1.), corner(1., 1.), corner(-1., 1.)];
    let triangles = vec![[0, 1, 2], [0, 2, 3]];
    let mesh = Mesh { positions, triangles, ..Mesh::default() };
    let scene = Scene { meshes: vec![mesh], materials: vec![material], ..Scene::default() };
    let camera = StageCamera {
        motion: Motion::still(Affine3A::from_translation(Vec3::Z * 5.0)),
        projection: Projection::Perspective { yfov: 0.3, aspect: None },
        aperture_radius: 0.0,
        focus_distance: [1.0; 2],
    };
    let instances = motions.into_iter().map(|motion| Instance { geometry: 0, motion, node: 0, permanent: false });
    let stage = Stage {
        interval: Exposure { open: 0.0, close: 1.0 },
        camera,
        geometries: vec![Geometry { mesh: 0, keys: Vec::new(), times: Vec::new() }],
        instances: instances.collect(),
        lights: Vec::new(),
    };
    (scene, stage)
}

fn at(place: Vec3) -> Motion {
    Motion::still(Affine3A::from_translation(place))
}

fn passing(from: Vec3, to: Vec3) -> Motion {
    Motion::through(vec![0.0, 1.0], [from, to].map(Affine3A::from_translation).to_vec())
}

fn down(x: f32, u_time: f32) -> Ray {
    let origin = Vec3A::new(x, 0.1, 5.0);
    Ray { origin, direction: Vec3A::NEG_Z, t_max: f32::INFINITY, u_time, backs: Backs::Pass }
}

/// A hundred squares that stand (instances, as none is permanent) and one far away that moves: rays to the former
/// interpolate nothing, neither on their way nor at the surface. A ray to the latter does: the count works.
#[test]
fn what_stands_is_never_interpolated_though_something_moves() {
    let mut motions: Vec<Motion> = (0..100).map(|i| at(Vec3::X * 3.0 * i as f32)).collect();
    motions.push(passing(Vec3::X * -50.0, Vec3::X * -60.0));
    let (scene, stage) = squares(Material::default(), motions);
    let accel = Accel::build(&scene, &stage, None);
    lerped::take();
    for i in 0..100 {
        let ray = down(3.0 * i as f32, i as f32 / 100.0);
        let hit = accel.closest(&ray, |_| true).expect("a square is there");
        let _ = accel.surface(&scene, &stage, &ray, &hit);
        assert!(accel.occluded(&ray, |_| true));
    }
    assert_eq!(lerped::take(), 0);
    let ray = down(-55.0, 0.5);
    let hit = accel.closest(&ray, |_| true).expect("it passes there at that instant");
    let _ = accel.surface(&scene, &stage, &ray, &hit);
    assert!(lerped::take() >= 2);
}

fn painted(alpha_mode: AlphaMode) -> Material {
    let texture = TextureRef { texture: 0, uv_set: 0, transform: Affine2::IDENTITY };
    Material {
        alpha_mode,
        base_color: Vec4::new(1.0, 1.0, 1.0, 0.5),
        base_color_texture: Some(texture),
        ..Material::default()
    }
}

/// How often surfaces of `material` are asked whether they are there, by a hundred rays of either kind.
fn asked(material: Material) -> usize {
    let (mut scene, stage) = squares(material, vec![at(Vec3::ZERO), passing(Vec3::NEG_Z, Vec3::Z * -2.0)]);
    let clear = Pixels::Rgba8(vec![[255, 255, 255, 0]]);
    scene.images = vec![Image { name: String::new(), width: 1, height: 1, pixels: clear }];
    let (wrap, texel) = ([Wrap::Repeat; 2], TexelFilter::Nearest);
    scene.textures = vec![Texture { image: 0, wrap, magnify: texel, minify: texel, mipmapped: false }];
    let accel = Accel::build(&scene, &stage, None);
    let count = std::cell::Cell::new(0);
    for i in 0..100 {
        let ray = down(0.9 * i as f32 / 100.0, i as f32 / 100.0);
        let ask = |_: &super::Hit| {
            count.set(count.get() + 1);
            true
        };
        assert!(accel.closest(&ray, ask).is_some() && accel.occluded(&ray, ask));
    }
    count.get()
}

/// Opaque materials do not ask, whatever alpha their colour and texture have; the same with `BLEND` or `MASK` do.
#[test]
fn opaque_surfaces_are_never_asked_for_their_alpha() {
    assert_eq!(asked(painted(AlphaMode::Opaque)), 0);
    assert!(asked(painted(AlphaMode::Blend)) >= 200);
    assert!(asked(painted(AlphaMode::Mask { cutoff: 0.5 })) >= 200);
}

/// The factors that one sample of a matt square under a lamp draws, without bounces.
fn drawn_under(shape: LightShape) -> Vec<Factor> {
    let matt = Material { metallic: 0.0, double_sided: true, ..Material::default() };
    let (scene, mut stage) = squares(matt, vec![at(Vec3::ZERO)]);
    let light = Light { name: String::new(), shape, intensity: Vec3::splat(9.0), range: None };
    stage.lights.push(StageLight { light, motion: at(Vec3::new(0.5, 0.5, 3.0)), node: 0 });
    let accel = Accel::build(&scene, &stage, None);
    let materials = Materials::new(&scene, TextureFilter::Point);
    let environment = Environment::new(Background::Black);
    let lights = Lights::build(&scene, &stage, &materials, &environment);
    let parts = Parts { scene: &scene, stage: &stage, accel: &accel, materials: &materials, lights: &lights };
    let lengths = PathLengths { bounces: 0, sure: 2 };
    let tracer = PathTracer::new(parts, CameraRays::new(&stage.camera, (8, 8), 1.0), lengths, Caustics::Blurred);
    let design = Design::new(&DesignOptions::default(), &[Factor::FILM_X, Factor::FILM_Y]);
    let pixel = design.pixel(PixelAddress { x: 4, y: 4, frame: 0, field: 0 });
    let point = pixel.point(0);
    drawn::take();
    let light = tracer.radiance(FilmPoint { position: DVec2::splat(4.5), u_time: 0.5 }, &point);
    assert!(light.min_element() > 0.0, "the square is lit: {light}");
    drawn::take()
}

/// Film position apart, which the film draws. The same lamps with an extent draw the light's pair: the count works.
#[test]
fn lights_without_extent_draw_no_numbers() {
    let spot = |radius| LightShape::Spot { inner_cone: 0.5, outer_cone: 1.0, radius };
    let point = |radius| LightShape::Point { radius };
    let sun = |angular_radius| LightShape::Directional { angular_radius };
    for shape in [point(0.0), sun(0.0), spot(0.0)] {
        assert_eq!(drawn_under(shape), [], "{shape:?}");
    }
    for shape in [point(0.2), sun(0.1), spot(0.2)] {
        let drawn = drawn_under(shape);
        assert!(drawn.contains(&Factor::light_u(0)) && drawn.contains(&Factor::light_v(0)), "{shape:?}: {drawn:?}");
    }
}
