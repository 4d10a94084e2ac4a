//! A standing mirror turns on its foot: what it shows turns twice as fast.

use super::builder::{Builder, Sampling};
use super::canvas::Canvas;
use super::colour::{lamp, srgb};
use super::node::{Aperture, Eye, Place};
use super::paint::Paint;
use super::set::{area_light, checker, floor};
use super::shape::Shape;
use super::sweep::{Ends, smooth};
use super::track::{Run, Track, beats};
use glam::{DAffine3, DQuat, DVec2, DVec3};
use std::f64::consts::{FRAC_PI_2, TAU};

/// Length, seconds: one swing to and fro.
const END: f64 = 2.0;
/// Height of the glass's middle, metres.
const MIDDLE: f64 = 0.80;
/// Half width and half height of the oval glass, metres.
const OVAL: DVec2 = DVec2::new(0.40, 0.58);

pub(crate) fn make() -> Vec<u8> {
    let mut b = Builder::default();
    room(&mut b);
    objects(&mut b);
    let gold = b.material(Paint::new("gold", DVec3::new(1.0, 0.766, 0.336)).metal(1.0).rough(0.25));
    let walnut = b.material(Paint::new("walnut", srgb(0x4a2a1a)).rough(0.4).lacquer(0.05));
    let silver = b.material(Paint::new("silver", DVec3::splat(0.94)).metal(1.0).rough(0.0));

    let mut foot = smooth(&[[0.0, 0.07], [0.03, 0.065], [0.06, 0.04], [0.2, 0.03], [0.24, 0.015]], 6);
    foot.extend([[0.24, 0.0], [0.0, 0.0]]);
    b.put(Place::new("foot"), &Shape::lathe(&foot, 64).plain(), walnut);

    let swivel = b.add(Place::new("swivel"));
    let keys: Vec<_> = beats(END, 12)
        .into_iter()
        .map(|t| (t, DQuat::from_rotation_y((17.0 * libm::sin(TAU * t / END)).to_radians())))
        .collect();
    b.animate(swivel, &Track::rotation(Run::Cubic, &keys));
    // A fork of bent wood holds the frame on both sides.
    let mut fork = Shape::wire(&[DVec3::new(0.0, 0.04, 0.0), DVec3::new(0.0, 0.16, 0.0)], 0.028, 24, Ends::Open);
    let arc: Vec<DVec3> = (0..=32)
        .map(|i| {
            let angle = std::f64::consts::PI * (1.0 + f64::from(i) / 32.0);
            DVec3::new(0.475 * libm::cos(angle), MIDDLE + 0.655 * libm::sin(angle), 0.0)
        })
        .collect();
    fork.join(&Shape::wire(&arc, 0.02, 20, Ends::Round));
    b.put(Place::new("fork").under(swivel), &fork.plain(), walnut);

    let stretch = |shape: Shape| {
        let lay = DAffine3::from_quat(DQuat::from_rotation_x(FRAC_PI_2));
        let oval = DAffine3::from_scale(DVec3::new(OVAL.x, OVAL.y, 1.0));
        shape.plain().moved(oval * lay)
    };
    let hang = |name: &str| Place::new(name).under(swivel).at(0.0, MIDDLE, 0.0).turned(DQuat::from_rotation_x(0.03));
    let glass = stretch(Shape::lathe(&[[0.0, 0.006], [1.0, 0.006], [1.0, -0.006], [0.0, -0.006]], 96));
    b.put(hang("mirror"), &glass, silver);
    let back = stretch(Shape::lathe(&[[0.0, -0.008], [1.01, -0.008], [1.01, -0.022], [0.0, -0.022]], 96));
    b.put(hang("back"), &back, walnut);
    // The ring is wound about the oval itself: a stretched torus would be thin at its sides.
    let ring = Shape::surface(128, 20, |u, v| {
        let (s, c) = (libm::sin(TAU * u), libm::cos(TAU * u));
        let rim = DVec3::new(OVAL.x * s, OVAL.y * c, 0.0);
        let out = DVec3::new(s / OVAL.x, c / OVAL.y, 0.0).normalize();
        rim + 0.024 * (out * libm::cos(TAU * v) + DVec3::Z * libm::sin(TAU * v))
    });
    b.put(hang("frame"), &ring.plain(), gold);
    for x in [-1.0, 1.0] {
        let knob = Shape::ball(0.03, 32, 16).plain();
        b.put(Place::new("knob").under(swivel).at(0.452 * x, MIDDLE, 0.0), &knob, gold);
    }
    let eye = Eye::new([0.75, 1.05, 2.85], [-0.17, 0.61, 0.0], 36.5)
        .lens(Aperture::FStop(8.0), [0.0, 0.8, 0.2])
        .shutter(180.0);
    b.camera("camera", &eye);
    b.finish("mirror")
}

/// Floor, walls (a striped one behind the camera, to be seen in the glass), lights.
fn room(b: &mut Builder) {
    let squares = checker(b, srgb(0xd9d3c4), srgb(0x6e7f86));
    let tiles = b.material(Paint::new("tiles", DVec3::ONE).texture(squares).rough(0.25));
    floor(b, 0.0, 4.0, 1.0, tiles);
    let plaster = b.material(Paint::new("plaster", srgb(0x8fa39a)).rough(0.9));
    let one = DVec2::ONE;
    let mut walls = Shape::quad(DVec3::new(0.0, 1.5, -1.3), DVec3::X * 4.0, DVec3::Y * 1.5, one);
    walls.join(&Shape::quad(DVec3::new(4.0, 1.5, 1.35), DVec3::Z * 2.65, DVec3::Y * 1.5, one));
    walls.join(&Shape::quad(DVec3::new(0.0, 3.0, 1.35), DVec3::X * 4.0, DVec3::Z * 2.65, one));
    b.put(Place::new("walls"), &walls.plain(), plaster);
    let colours = [0xe4572e, 0xf6efe0, 0x17324d, 0xf3a712, 0xf6efe0, 0x2a7f62].map(srgb);
    let stripes = Canvas::paint(96, 2, 1, |p| {
        let i = colours.iter().enumerate().rev().find(|(i, _)| p.x * 6.0 >= *i as f64).map_or(0, |(i, _)| i);
        colours[i]
    });
    let stripes = b.texture("stripes", &stripes, Sampling::Hard);
    let stripes = b.material(Paint::new("stripes", DVec3::ONE).texture(stripes).rough(0.9));
    let mut striped = Shape::quad(DVec3::new(0.0, 1.5, 4.0), DVec3::NEG_X * 4.0, DVec3::Y * 1.5, DVec2::new(6.0, 1.0));
    striped.join(&Shape::quad(DVec3::new(-4.0, 1.5, 1.35), DVec3::NEG_Z * 2.65, DVec3::Y * 1.5, DVec2::new(4.0, 1.0)));
    b.put(Place::new("striped walls"), &striped, stripes);
    area_light(b, "skylight", [-0.6, 2.9, 1.6], [-0.6, 0.0, 1.5], (2.4, 1.6), lamp(6000.0) * 7.5);
    area_light(b, "window", [3.9, 1.7, 0.6], [0.0, 0.6, 0.6], (1.4, 1.6), lamp(8500.0) * 6.5);
    area_light(b, "lamp", [-1.9, 2.6, -0.4], [0.0, 0.6, 0.2], (0.5, 0.5), lamp(3200.0) * 24.0);
}

/// Solids on the floor before the mirror, seen directly and in the glass.
fn objects(b: &mut Builder) {
    let red = b.material(Paint::new("red", srgb(0xc4301f)).rough(0.3).lacquer(0.03));
    let yellow = b.material(Paint::new("yellow", srgb(0xf0b323)).rough(0.5));
    let blue = b.material(Paint::new("blue", srgb(0x1e4f9c)).rough(0.4).lacquer(0.05));
    let white = b.material(Paint::new("white", srgb(0xeeeae0)).rough(0.6));
    let ball = Shape::ball(0.2, 64, 32).plain();
    b.put(Place::new("ball").at(-0.40, 0.2, 1.10), &ball, red);
    let cone = Shape::lathe(&[[0.0, 0.66], [0.17, 0.0], [0.0, 0.0]], 64).plain();
    b.put(Place::new("cone").at(-0.74, 0.0, 0.52), &cone, yellow);
    let cube = Shape::block(DVec3::splat(0.13), 0.012, 3).plain();
    let turn = DQuat::from_rotation_y(0.5);
    b.put(Place::new("cube").at(-0.92, 0.13, 1.02).turned(turn), &cube, blue);
    let mut vase = smooth(
        &[[0.045, 0.50], [0.05, 0.47], [0.035, 0.40], [0.05, 0.33], [0.11, 0.22], [0.115, 0.12], [0.07, 0.02]],
        6,
    );
    vase.push([0.065, 0.0]);
    vase.push([0.0, 0.0]);
    vase.insert(0, [0.036, 0.49]);
    vase.insert(0, [0.025, 0.40]);
    vase.insert(0, [0.0, 0.39]);
    b.put(Place::new("vase").at(0.66, 0.0, 0.62), &Shape::lathe(&vase, 64).plain(), white);
}
