//! Newton's cradle: the outer balls swing in turn, and stop and start at once when they strike.

use super::builder::{Builder, Material};
use super::colour::{lamp, srgb};
use super::node::{Aperture, Eye, Place};
use super::paint::Paint;
use super::set::{area_light, sweep};
use super::shape::Shape;
use super::sweep::Ends;
use super::track::{Run, Track};
use glam::{DQuat, DVec3};
use std::f64::consts::{FRAC_PI_2, PI};

/// Radius of a ball and length of its suspension, metres.
const RADIUS: f64 = 0.025;
const LENGTH: f64 = 0.15;
/// Height of the rails that the balls hang from.
const RAIL: f64 = 0.215;
/// Half the distance between the rails.
const SPREAD: f64 = 0.065;
/// The greatest deflection, radians.
const SWING: f64 = 0.62;
/// Seconds of a full period: 19 frames at 24 a second, so that two periods loop and the impacts of frames 14 and 33 fall
/// into the middle of a 180-degree exposure. A real pendulum of this length and swing takes 0.796 s, 0.5 % more.
const PERIOD: f64 = 19.0 / 24.0;

pub(crate) fn make() -> Vec<u8> {
    let mut b = Builder::default();
    let backdrop = b.material(Paint::new("backdrop", srgb(0x35506b)).rough(0.85));
    b.put(Place::new("backdrop"), &sweep(2.5, 1.2, -0.7, 0.35, 1.6).plain(), backdrop);
    let ebony = b.material(Paint::new("ebony", srgb(0x17120f)).rough(0.3).lacquer(0.02));
    let base = Shape::block(DVec3::new(0.17, 0.014, 0.10), 0.006, 4).plain();
    b.put(Place::new("base").at(0.0, 0.014, 0.0), &base, ebony);
    let chrome = b.material(Paint::new("chrome", DVec3::new(0.72, 0.73, 0.75)).metal(1.0).rough(0.06));
    b.put(Place::new("stand"), &stand().plain(), chrome);

    let gold = b.material(Paint::new("gold", DVec3::new(1.0, 0.766, 0.336)).metal(1.0).rough(0.1));
    let copper = b.material(Paint::new("copper", DVec3::new(0.955, 0.538, 0.438)).metal(1.0).rough(0.1));
    let glass = b.material(Paint::new("glass", DVec3::ONE).glass(1.52, DVec3::new(0.72, 0.93, 0.90), 0.05));
    let thread = b.material(Paint::new("thread", srgb(0xd8d8d8)).metal(1.0).rough(0.3));
    let ball = b.geometry(&Shape::ball(RADIUS, 96, 48).plain());
    let threads = b.geometry(&suspension().plain());
    let paints: [Material; 5] = [chrome, gold, glass, copper, chrome];
    for (i, paint) in paints.into_iter().enumerate() {
        let x = 2.0 * RADIUS * (i as f64 - 2.0);
        // Balls touch at rest: a hair apart, so that no two surfaces share a point.
        let mesh = b.mesh("bob", &[(&ball, paint)]);
        let hanger = b.mesh("threads", &[(&threads, thread)]);
        let pivot = b.add(Place::new(&format!("pendulum {i}")).at(x * 1.002, RAIL, 0.0).with(hanger));
        b.add(Place::new(&format!("bob {i}")).under(pivot).at(0.0, -LENGTH, 0.0).with(mesh));
        if i == 0 || i == 4 {
            b.animate(pivot, &Track::rotation(Run::Linear, &swing(i == 0)));
        }
    }
    area_light(&mut b, "key", [-0.7, 0.75, 0.55], [0.0, 0.1, 0.0], (0.9, 0.9), lamp(5000.0) * 7.5);
    area_light(&mut b, "strip", [0.9, 0.45, 0.5], [0.0, 0.1, 0.0], (0.26, 0.9), lamp(8000.0) * 8.0);
    area_light(&mut b, "top", [0.0, 1.1, -0.1], [0.0, 0.0, -0.1], (1.3, 0.7), lamp(6000.0) * 4.5);
    area_light(&mut b, "behind", [0.0, 0.6, 2.0], [0.0, 0.1, 0.0], (2.6, 1.0), lamp(6500.0) * 1.0);
    let eye = Eye::new([0.20, 0.20, 0.74], [0.0, 0.112, 0.0], 25.0)
        .lens(Aperture::FStop(2.0), [0.0, 0.07, 0.02])
        .shutter(180.0);
    b.camera("camera", &eye);
    b.finish("newton")
}

/// Rotations of an outer ball. The left one starts at the top of its swing and hangs still for every second half
/// period; the right one takes over. Harmonic, with keys a 96th of a second apart and at every impact.
fn swing(left: bool) -> Vec<(f64, DQuat)> {
    let end = 2.0 * PERIOD;
    let mut times: Vec<f64> = super::track::beats(end, 96);
    times.extend((0..4).map(|k| PERIOD * (0.25 + 0.5 * f64::from(k))));
    times.push(end);
    times.sort_by(f64::total_cmp);
    times.dedup_by(|a, b| (*a - *b).abs() < 1e-6);
    times
        .into_iter()
        .map(|t| {
            let phase = libm::cos(2.0 * PI * t / PERIOD);
            let angle = if left { -SWING * phase.max(0.0) } else { SWING * (-phase).max(0.0) };
            // What rounding leaves of cos π/2 is no motion.
            (t, DQuat::from_rotation_z(if angle.abs() < 1e-9 { 0.0 } else { angle }))
        })
        .collect()
}

/// Two rails on four posts, bent from one rod each.
fn stand() -> Shape {
    let mut shape = Shape::default();
    let (half, bend) = (0.155, 0.025);
    for z in [-SPREAD - 0.012, SPREAD + 0.012] {
        let mut path = vec![DVec3::new(-half, 0.01, z)];
        for (cx, from) in [(-half + bend, PI), (half - bend, FRAC_PI_2)] {
            path.extend((0..=8).map(|i| {
                let angle = from - FRAC_PI_2 * f64::from(i) / 8.0;
                DVec3::new(cx + bend * libm::cos(angle), RAIL - bend + bend * libm::sin(angle), z)
            }));
        }
        path.push(DVec3::new(half, 0.01, z));
        shape.join(&Shape::wire(&path, 0.0045, 20, Ends::Open));
    }
    shape
}

/// Two threads from the rails to the top of the ball.
fn suspension() -> Shape {
    let mut shape = Shape::default();
    for z in [-SPREAD - 0.012, SPREAD + 0.012] {
        let path = [DVec3::new(0.0, 0.0, z), DVec3::new(0.0, RADIUS * 0.98 - LENGTH, 0.0)];
        shape.join(&Shape::wire(&path, 0.0006, 8, Ends::Open));
    }
    shape
}
