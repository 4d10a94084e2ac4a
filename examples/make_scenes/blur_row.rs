//! Five identical balls in identical motion, each with another amount of motion blur.

use super::builder::{Builder, Sampling};
use super::canvas::Canvas;
use super::colour::{lamp, srgb};
use super::digits::distance;
use super::node::{Eye, Place};
use super::paint::Paint;
use super::set::{area_light, sweep};
use super::shape::{Shape, direction};
use super::track::{Run, Track, beats};
use glam::{DQuat, DVec2, DVec3};
use std::f64::consts::TAU;

/// Radius of a ball, metres.
const RADIUS: f64 = 0.16;
/// Length, seconds: two bounces.
const END: f64 = 1.0;
const BOUNCE: f64 = 0.5;
/// How high the balls leap, metres.
const LEAP: f64 = 0.6;

pub(crate) fn make() -> Vec<u8> {
    let mut b = Builder::default();
    let backdrop = b.material(Paint::new("backdrop", srgb(0x9fb4c4)).rough(0.9));
    b.put(Place::new("backdrop"), &sweep(6.0, 4.0, -1.8, 1.0, 4.0).plain(), backdrop);
    let mirror = b.material(Paint::new("mirror", DVec3::splat(0.86)).metal(1.0).rough(0.0));
    b.put(
        Place::new("mirror floor"),
        &Shape::block(DVec3::new(2.6, 0.02, 1.7), 0.012, 4).plain().at(0.0, 0.0, 0.8),
        mirror,
    );

    let petals = Canvas::paint(512, 256, 3, |uv| {
        let p = direction(uv.x, uv.y);
        let sector = libm::floor(6.0 * uv.x).rem_euclid(3.0);
        if p.y.abs() > 0.96 {
            srgb(0xf6f1e6)
        } else if sector < 0.5 {
            srgb(0xe8442a)
        } else if sector < 1.5 {
            srgb(0xf7f2e8)
        } else {
            srgb(0x1f5fa8)
        }
    });
    let petals = b.texture("petals", &petals, Sampling::Ball);
    let skin = b.material(Paint::new("ball", DVec3::ONE).texture(petals).rough(0.25).lacquer(0.02));
    let geometry = b.geometry(&Shape::ball(RADIUS, 64, 32));
    let mesh = b.mesh("ball", &[(&geometry, skin)]);
    // A parabola from the floor and back; the velocity jumps where the ball strikes the floor.
    let height = |t: f64| {
        let s = (t / BOUNCE).fract();
        0.02 + RADIUS + LEAP * 4.0 * s * (1.0 - s)
    };
    let tilt = DQuat::from_rotation_z(0.35);
    for (i, (text, amount)) in [("0", 0.0), ("0.5", 0.5), ("1", 1.0), ("1.5", 1.5), ("2", 2.0)].iter().enumerate() {
        let x = 0.56 * (i as f64 - 2.0);
        let place = Place::new(&format!("blur {text}")).at(x, height(0.0), 0.0).turned(tilt).with(mesh);
        let node = b.add(place.blur_scale(*amount));
        let places: Vec<_> = beats(END, 48).into_iter().map(|t| (t, DVec3::new(x, height(t), 0.0))).collect();
        b.animate(node, &Track::translation(Run::Linear, &places));
        let spin: Vec<_> =
            beats(END, 24).into_iter().map(|t| (t, DQuat::from_rotation_x(2.0 * TAU * t) * tilt)).collect();
        b.animate(node, &Track::rotation(Run::Linear, &spin));
        label(&mut b, text, x);
    }
    area_light(&mut b, "key", [-1.7, 2.6, 1.9], [0.0, 0.3, 0.0], (2.4, 2.4), lamp(4800.0) * 3.6);
    area_light(&mut b, "fill", [3.0, 1.4, 2.2], [0.0, 0.3, 0.0], (1.8, 2.6), lamp(8000.0) * 1.9);
    area_light(&mut b, "top", [0.0, 3.2, -0.4], [0.0, 0.0, -0.2], (5.0, 2.0), lamp(6000.0) * 1.4);
    let eye = Eye::new([0.0, 0.95, 3.9], [0.0, 0.19, 0.0], 24.5).shutter(180.0);
    b.camera("camera", &eye);
    b.finish("blur row")
}

/// A plate with the amount on it, before its ball.
fn label(b: &mut Builder, text: &str, x: f64) {
    let canvas = Canvas::paint(128, 64, 4, |uv| {
        let p = DVec2::new((uv.x - 0.5) * 2.0, 0.5 - uv.y) / 0.62;
        if distance(text, p) < 0.09 { srgb(0x22262c) } else { srgb(0xf4efe4) }
    });
    let texture = b.texture(&format!("label {text}"), &canvas, Sampling::Ball);
    let material = b.material(Paint::new("label", DVec3::ONE).texture(texture).rough(0.6));
    let up = DVec3::new(0.0, 0.055, -0.03);
    let quad = Shape::quad(DVec3::new(x, 0.075, 0.40), DVec3::X * 0.11, up, DVec2::ONE);
    b.put(Place::new(&format!("label {text}")), &quad, material);
}
