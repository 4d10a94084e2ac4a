//! A toy train crosses a smooth backdrop at a steady speed: a subject for interlaced fields.

use super::builder::{Builder, Material, Node, Sampling};
use super::canvas::Canvas;
use super::colour::{lamp, srgb};
use super::node::{Eye, Place};
use super::paint::Paint;
use super::set::{area_light, sweep};
use super::shape::Shape;
use super::sweep::{Ends, smooth};
use super::track::{Run, Track, beats};
use glam::{DAffine3, DQuat, DVec2, DVec3};
use std::f64::consts::{FRAC_PI_2, TAU};

/// Metres a second: at 720 × 480, 59.94 fields a second, about 6 pixels a field.
const SPEED: f64 = 0.8;
/// Length, seconds.
const END: f64 = 2.0;
/// Radius of a driving wheel, metres.
const WHEEL: f64 = 0.10;

pub(crate) fn make() -> Vec<u8> {
    let mut b = Builder::default();
    let backdrop = b.material(Paint::new("backdrop", srgb(0x7fa0b5)).rough(1.0));
    b.put(Place::new("backdrop"), &sweep(6.0, 3.0, -1.6, 1.0, 4.0).plain(), backdrop);
    let steel = b.material(Paint::new("rail", srgb(0x8c8f94)).metal(1.0).rough(0.3));
    for z in [-0.09, 0.09] {
        let rail = Shape::block(DVec3::new(5.0, 0.01, 0.008), 0.003, 2).plain();
        b.put(Place::new("rail").at(0.0, 0.01, z), &rail, steel);
    }
    let train = b.add(Place::new("train").at(-0.5 * SPEED * END, 0.02, 0.0));
    let path = |t: f64| DVec3::new(SPEED * (t - 0.5 * END), 0.02, 0.0);
    b.animate(train, &Track::translation(Run::Linear, &[(0.0, path(0.0)), (END, path(END))]));
    engine(&mut b, train, steel);
    wagon(&mut b, train);
    area_light(&mut b, "key", [-1.6, 2.4, 2.2], [0.0, 0.2, 0.0], (1.2, 1.2), lamp(5200.0) * 15.0);
    area_light(&mut b, "fill", [2.6, 1.6, 2.2], [0.0, 0.2, 0.0], (1.0, 1.8), lamp(7500.0) * 7.0);
    area_light(&mut b, "top", [0.0, 2.8, -0.3], [0.0, 0.0, -0.3], (3.0, 1.0), lamp(6500.0) * 5.0);
    let eye = Eye::new([0.0, 0.40, 3.6], [0.0, 0.265, 0.0], 15.0).shutter(90.0);
    b.camera("camera", &eye);
    b.finish("field")
}

/// Boiler, cab, chimney, wheels with their rod.
fn engine(b: &mut Builder, train: Node, steel: Material) {
    let black = b.material(Paint::new("black", srgb(0x101114)).rough(0.35).lacquer(0.05));
    let white = b.material(Paint::new("white", srgb(0xf4f2ec)).rough(0.4));
    let red = b.material(Paint::new("red", srgb(0xc4231a)).rough(0.4).lacquer(0.05));
    let brass = b.material(Paint::new("brass", DVec3::new(0.887, 0.672, 0.312)).metal(1.0).rough(0.2));
    let engine = b.add(Place::new("engine").under(train).at(0.34, 0.0, 0.0));
    let on = |name: &str| Place::new(name).under(engine);
    // Turned about y, laid down so that the top of the profile points forward, +x.
    let forward = DAffine3::from_quat(DQuat::from_rotation_z(-FRAC_PI_2));
    let mut boiler = smooth(&[[0.0, 0.29], [0.05, 0.285], [0.078, 0.27], [0.085, 0.25]], 5);
    boiler.extend([[0.085, -0.10], [0.0, -0.10]]);
    let boiler = Shape::lathe(&boiler, 64).plain().moved(forward);
    b.put(on("boiler").at(0.0, 0.24, 0.0), &boiler, black);
    for x in [0.02, 0.14, 0.25] {
        let band = Shape::torus(0.086, 0.0045, 64, 10).plain().moved(forward);
        b.put(on("band").at(x, 0.24, 0.0), &band, brass);
    }
    b.put(on("cab").at(-0.17, 0.28, 0.0), &Shape::block(DVec3::new(0.09, 0.14, 0.10), 0.012, 3).plain(), red);
    b.put(on("roof").at(-0.17, 0.43, 0.0), &Shape::block(DVec3::new(0.115, 0.012, 0.12), 0.01, 3).plain(), white);
    for z in [-1.0, 1.0] {
        let window = Shape::block(DVec3::new(0.045, 0.045, 0.004), 0.003, 2).plain();
        b.put(on("window").at(-0.17, 0.33, 0.1 * z), &window, white);
    }
    let chimney = Shape::lathe(
        &[[0.0, 0.13], [0.03, 0.14], [0.036, 0.17], [0.046, 0.17], [0.042, 0.14], [0.024, 0.10], [0.03, 0.0]],
        40,
    );
    b.put(on("chimney").at(0.2, 0.31, 0.0), &chimney.plain(), black);
    let dome = smooth(&[[0.0, 0.05], [0.025, 0.042], [0.034, 0.02], [0.034, 0.0]], 6);
    b.put(on("dome").at(0.08, 0.315, 0.0), &Shape::lathe(&dome, 40).plain(), brass);
    b.put(on("frame").at(0.02, 0.13, 0.0), &Shape::block(DVec3::new(0.29, 0.022, 0.075), 0.008, 3).plain(), red);

    let wheel = wheel();
    let geometry = b.geometry(&wheel.plain());
    for x in [-0.18, 0.035, 0.25] {
        for z in [-1.0, 1.0] {
            let mesh = b.mesh("wheel", &[(&geometry, white)]);
            let node = b.add(on("wheel").at(x, WHEEL, 0.09 * z).with(mesh));
            roll(b, node);
        }
    }
    // The rod goes round with the wheels and stays level.
    for z in [-1.0, 1.0] {
        let rod = Shape::wire(&[DVec3::new(-0.18, 0.0, 0.0), DVec3::new(0.25, 0.0, 0.0)], 0.011, 16, Ends::Round);
        let at = |t: f64| {
            let angle = -SPEED * t / WHEEL;
            DVec3::new(0.05 * libm::cos(angle), WHEEL + 0.05 * libm::sin(angle), 0.118 * z)
        };
        let start = at(0.0);
        let node = b.put(on("rod").at(start.x, start.y, start.z), &rod.plain(), steel);
        let keys: Vec<_> = beats(END, 96).into_iter().map(|t| (t, at(t))).collect();
        b.animate(node, &Track::translation(Run::Linear, &keys));
    }
}

/// Rolls a wheel without slipping.
fn roll(b: &mut Builder, node: Node) {
    let keys: Vec<_> = beats(END, 24).into_iter().map(|t| (t, DQuat::from_rotation_z(-SPEED * t / WHEEL))).collect();
    b.animate(node, &Track::rotation(Run::Linear, &keys));
}

/// A spoked wheel about z with a crank pin at +x.
fn wheel() -> Shape {
    let lay = DAffine3::from_quat(DQuat::from_rotation_x(FRAC_PI_2));
    let mut shape =
        Shape::lathe(&[[0.078, 0.012], [WHEEL, 0.012], [WHEEL, -0.012], [0.078, -0.012], [0.078, 0.012]], 64);
    shape.join(&Shape::lathe(&[[0.0, 0.016], [0.024, 0.014], [0.024, -0.014], [0.0, -0.016]], 32));
    let mut shape = shape.moved(lay);
    for i in 0..8 {
        let angle = TAU * f64::from(i) / 8.0;
        let out = DVec3::new(libm::cos(angle), libm::sin(angle), 0.0);
        shape.join(&Shape::wire(&[out * 0.02, out * 0.082], 0.006, 10, Ends::Open));
    }
    let pin = Shape::lathe(&[[0.0, 0.02], [0.014, 0.02], [0.014, -0.02], [0.0, -0.02]], 24).moved(lay);
    shape.join(&pin.at(0.05, 0.0, 0.0));
    shape
}

/// A wagon with black and white bars, 20 mm each: the hardest thing for a field to carry.
fn wagon(b: &mut Builder, train: Node) {
    let bars = Canvas::paint(2, 1, 1, |p| if p.x < 0.5 { srgb(0x0b0b0d) } else { srgb(0xf6f4ee) });
    let bars = b.texture("bars", &bars, Sampling::Hard);
    let bars = b.material(Paint::new("bars", DVec3::ONE).texture(bars).rough(0.6));
    let wood = b.material(Paint::new("wagon", srgb(0x1f4f3a)).rough(0.5));
    let white = b.material(Paint::new("wagon wheel", srgb(0xf4f2ec)).rough(0.4));
    let wagon = b.add(Place::new("wagon").under(train).at(-0.40, 0.0, 0.0));
    let on = |name: &str| Place::new(name).under(wagon);
    b.put(on("body").at(0.0, 0.27, 0.0), &Shape::block(DVec3::new(0.26, 0.13, 0.10), 0.01, 3).plain(), wood);
    b.put(on("sill").at(0.0, 0.125, 0.0), &Shape::block(DVec3::new(0.29, 0.018, 0.08), 0.008, 3).plain(), wood);
    let panel = Shape::quad(DVec3::new(0.0, 0.27, 0.1006), DVec3::X * 0.24, DVec3::Y * 0.11, DVec2::new(12.0, 1.0));
    b.put(on("bars"), &panel, bars);
    let lay = DAffine3::from_scale(DVec3::new(0.7, 0.7, 1.0));
    let geometry = b.geometry(&wheel().plain().moved(lay));
    for x in [-0.17, 0.17] {
        for z in [-1.0, 1.0] {
            let mesh = b.mesh("wagon wheel", &[(&geometry, white)]);
            let node = b.add(on("wheel").at(x, 0.7 * WHEEL, 0.09 * z).with(mesh));
            let keys: Vec<_> =
                beats(END, 24).into_iter().map(|t| (t, DQuat::from_rotation_z(-SPEED * t / (0.7 * WHEEL)))).collect();
            b.animate(node, &Track::rotation(Run::Linear, &keys));
        }
    }
    let coupling = Shape::wire(&[DVec3::new(0.27, 0.12, 0.0), DVec3::new(0.46, 0.12, 0.0)], 0.008, 12, Ends::Round);
    b.put(on("coupling"), &coupling.plain(), wood);
}
