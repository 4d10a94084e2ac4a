//! A brass fan that is switched on before a checkered wall.

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
use std::f64::consts::{FRAC_PI_2, PI, TAU};

/// Length, seconds.
const END: f64 = 2.0;
/// Turns a second that it reaches.
const FULL_SPEED: f64 = 7.0;
/// Height of the axle above the table, metres.
const AXLE: f64 = 0.34;

pub(crate) fn make() -> Vec<u8> {
    let mut b = Builder::default();
    set(&mut b);
    let enamel = b.material(Paint::new("enamel", srgb(0x1d5a5c)).rough(0.4).lacquer(0.03));
    let brass = b.material(Paint::new("brass", DVec3::new(0.887, 0.672, 0.312)).metal(1.0).rough(0.22));
    let foot = smooth(&[[0.0, 0.055], [0.022, 0.05], [0.03, 0.04], [0.085, 0.026], [0.112, 0.018], [0.116, 0.006]], 6);
    let mut foot_profile = foot;
    foot_profile.extend([[0.114, 0.0], [0.0, 0.0]]);
    b.put(Place::new("foot"), &Shape::lathe(&foot_profile, 64).plain(), enamel);
    let stem = Shape::lathe(&[[0.0, 0.31], [0.012, 0.31], [0.012, 0.05]], 32).plain();
    b.put(Place::new("stem"), &stem, brass);

    let head = b.add(Place::new("head").at(0.0, AXLE, 0.0));
    let turn = |t: f64| DQuat::from_rotation_y((26.0 * libm::sin(TAU * t / END)).to_radians());
    let swing: Vec<_> = beats(END, 8).into_iter().map(|t| (t, turn(t))).collect();
    b.animate(head, &Track::rotation(Run::Cubic, &swing));
    // Turned on a lathe about y, laid down so that y becomes z, the axle.
    let lay = DAffine3::from_quat(DQuat::from_rotation_x(FRAC_PI_2));
    let motor =
        smooth(&[[0.0, -0.02], [0.035, -0.022], [0.05, -0.04], [0.052, -0.075], [0.04, -0.105], [0.0, -0.115]], 6);
    b.put(Place::new("motor").under(head), &Shape::lathe(&motor, 48).plain().moved(lay), enamel);
    b.put(Place::new("cage").under(head), &cage().plain(), brass);
    spinner(&mut b, head, brass);

    let eye = Eye::new([0.36, 0.43, 1.12], [0.0, 0.266, -0.02], 29.0)
        .lens(Aperture::FStop(4.0), [0.0, 0.34, 0.05])
        .shutter(180.0);
    b.camera("camera", &eye);
    b.finish("fan")
}

/// Table, checkered wall, lights.
fn set(b: &mut Builder) {
    let squares = checker(b, srgb(0xe9e2d2), srgb(0x2b2f36));
    let wall = b.material(Paint::new("wall", DVec3::ONE).texture(squares).rough(0.7));
    let quad = Shape::quad(DVec3::new(0.0, 1.0, -0.55), DVec3::X * 2.0, DVec3::Y, DVec2::new(10.0, 5.0));
    b.put(Place::new("checker wall"), &quad, wall);
    let grain = Canvas::paint(256, 256, 2, |p| {
        let rings = 14.0 * p.y + 0.6 * libm::sin(TAU * (p.x + 0.3 * libm::sin(TAU * 2.0 * p.y)));
        srgb(0x8a4f2a).lerp(srgb(0x5d3018), 0.5 + 0.5 * libm::sin(TAU * rings))
    });
    let grain = b.texture("wood", &grain, Sampling::Smooth);
    let wood = b.material(Paint::new("table", DVec3::ONE).texture(grain).rough(0.5).lacquer(0.06));
    floor(b, 0.0, 2.0, 0.8, wood);
    area_light(b, "key", [-0.9, 1.25, 1.1], [0.0, 0.3, 0.0], (0.8, 0.8), lamp(4200.0) * 11.0);
    area_light(b, "fill", [1.6, 0.9, 0.9], [0.0, 0.3, 0.0], (0.7, 1.4), lamp(8000.0) * 4.0);
    area_light(b, "room", [0.0, 1.0, 3.2], [0.0, 0.4, 0.0], (5.0, 2.6), lamp(4500.0) * 0.35);
    area_light(b, "top", [0.2, 1.7, -0.1], [0.0, 0.0, -0.1], (1.2, 0.5), lamp(5500.0) * 5.0);
}

/// Rings about the blades and wires from the middle to the outer ring, before and behind.
fn cage() -> Shape {
    let mut shape = Shape::default();
    let lay = DAffine3::from_quat(DQuat::from_rotation_x(FRAC_PI_2));
    for (ring, wire, z) in [(0.2, 0.0035, 0.005), (0.036, 0.002, 0.062), (0.125, 0.0013, 0.053)] {
        shape.join(&Shape::torus(ring, wire, 96, 10).moved(lay).at(0.0, 0.0, z));
    }
    shape.join(
        &Shape::lathe(&[[0.0, 0.006], [0.02, 0.005], [0.033, 0.0], [0.0, -0.002]], 40).moved(lay).at(0.0, 0.0, 0.062),
    );
    for side in [1.0, -1.0] {
        for i in 0..28 {
            let angle = TAU * f64::from(i) / 28.0;
            let out = DVec3::new(libm::cos(angle), libm::sin(angle), 0.0);
            let path: Vec<DVec3> = (0..=8)
                .map(|k| {
                    let s = f64::from(k) / 8.0;
                    let bulge = libm::sqrt(1.0 - libm::pow(s, 3.0));
                    out * (0.036 + 0.164 * s) + DVec3::Z * (0.005 + side * 0.057 * bulge)
                })
                .collect();
            shape.join(&Shape::wire(&path, 0.0011, 6, Ends::Open));
        }
    }
    shape
}

/// Hub and four blades, one of them red, spinning up from rest.
fn spinner(b: &mut Builder, head: super::builder::Node, brass: super::builder::Material) {
    // Constant acceleration for the first second: ½ α t², then on at full speed.
    let angle = |t: f64| -TAU * FULL_SPEED * if t < 1.0 { 0.5 * t * t } else { t - 0.5 };
    let spin: Vec<_> = beats(END, 96).into_iter().map(|t| (t, DQuat::from_rotation_z(angle(t)))).collect();
    let spinner = b.add(Place::new("spinner").under(head).at(0.0, 0.0, 0.01));
    b.animate(spinner, &Track::rotation(Run::Linear, &spin));
    let lay = DAffine3::from_quat(DQuat::from_rotation_x(FRAC_PI_2));
    let hub = smooth(&[[0.0, 0.026], [0.016, 0.022], [0.026, 0.008], [0.027, -0.012], [0.02, -0.02], [0.0, -0.022]], 5);
    b.put(Place::new("hub").under(spinner), &Shape::lathe(&hub, 40).plain().moved(lay), brass);
    let red = b.material(Paint::new("red blade", srgb(0xc2281d)).rough(0.35).lacquer(0.05));
    let teal = b.material(Paint::new("teal blade", srgb(0x1f8a86)).rough(0.35).lacquer(0.05));
    let geometry = b.geometry(&blade().plain());
    for i in 0..4 {
        let mesh = b.mesh("blade", &[(&geometry, if i == 0 { red } else { teal })]);
        let rotation = DQuat::from_rotation_z(FRAC_PI_2 * f64::from(i));
        b.add(Place::new(&format!("blade {i}")).under(spinner).turned(rotation).with(mesh));
    }
}

/// A closed blade along −y: a thin ellipse as cross-section, wide beyond the middle, pitched more at the root.
fn blade() -> Shape {
    Shape::surface(32, 28, |u, v| {
        let radius = 0.018 + 0.164 * v;
        let chord = 0.112 * libm::pow(libm::sin(PI * libm::pow(0.06 + 0.94 * v, 0.85)), 0.6).max(0.0);
        let thickness = 0.0035;
        let (s, c) = (libm::sin(TAU * u), libm::cos(TAU * u));
        let (across, depth) = (0.5 * chord * s + 0.02 * v, 0.5 * thickness * c * libm::sqrt(1.0 - v).max(0.05));
        let pitch = (38.0 - 20.0 * v).to_radians();
        let (sp, cp) = (libm::sin(pitch), libm::cos(pitch));
        DVec3::new(across * cp + depth * sp, -radius, depth * cp - across * sp)
    })
}
