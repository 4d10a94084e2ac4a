//! A homage to the pool balls of 1984 (Cook, Porter and Carpenter, figure 8).
//!
//! In frame 10 the shutter is open while the cue ball strikes the 9, which strikes the 8, which strikes the 4: the 9
//! changes direction twice, the 8 moves only in the middle of the exposure, the 4 starts near its end, the 1 lies
//! still. Collisions are elastic between equal masses; balls roll without slipping.

use super::builder::{Builder, Sampling};
use super::canvas::Canvas;
use super::colour::{lamp, srgb};
use super::digits::distance;
use super::node::{Aperture, Eye, Place};
use super::paint::Paint;
use super::set::{area_light, mottle};
use super::shape::{Shape, direction};
use super::track::{Run, Track};
use glam::{DQuat, DVec2, DVec3};
use serde_json::json;

/// Radius of a ball, metres.
const RADIUS: f64 = 0.0286;
/// The frame of the collisions, in seconds, and how long its shutter is open: a whole frame at 24 a second.
const HERO: f64 = 10.0 / 24.0;
const EXPOSURE: f64 = 1.0 / 24.0;
/// Length of the animation, seconds.
const END: f64 = 1.25;
/// Nose of the back cushion, metres from the middle of the picture.
const RAIL: f64 = -0.40;

/// A ball's design: number (0 is the cue ball), colour, whether it wears a stripe.
struct Skin(u32, u32, bool);

/// A rolling ball.
struct Ball {
    skin: Skin,
    place: DVec2,
    velocity: DVec2,
    rotation: DQuat,
    /// Yaw, pitch and roll, degrees, of its number towards the camera; and when, in quarters of the hero frame.
    pose: [f64; 4],
    places: Vec<(f64, DVec3)>,
    rotations: Vec<(f64, DQuat)>,
}

pub(crate) fn make() -> Vec<u8> {
    let mut b = Builder::default();
    table(&mut b);
    room(&mut b);
    let geometry = b.geometry(&Shape::ball(RADIUS, 80, 40));
    let mut balls = layout();
    roll(&mut balls);
    for ball in &balls {
        let name = if ball.skin.0 == 0 { "cue ball".to_owned() } else { format!("ball {}", ball.skin.0) };
        let texture = b.texture(&name, &skin(&ball.skin), Sampling::Ball);
        let paint = Paint::new(&name, DVec3::ONE).texture(texture).rough(0.04);
        let paint = paint.extension("KHR_materials_ior", json!({ "ior": 1.6 }));
        let material = b.material(paint);
        let mesh = b.mesh(&name, &[(&geometry, material)]);
        let start = ball.places[0].1;
        let node = b.add(Place::new(&name).at(start.x, start.y, start.z).turned(ball.rotations[0].1).with(mesh));
        if ball.places.len() > 1 {
            b.animate(node, &Track::translation(Run::Linear, &ball.places));
            b.animate(node, &Track::rotation(Run::Linear, &ball.rotations));
        }
    }
    let eye = Eye::new([0.015, 0.36, 0.47], [-0.004, 0.012, -0.028], 25.0)
        .lens(Aperture::FStop(2.8), [0.0, 0.03, 0.0])
        .shutter(360.0);
    b.camera("camera", &eye);
    b.finish("pool")
}

/// Places and velocities at 0 s, wound back from the first impact.
fn layout() -> Vec<Ball> {
    let impact = HERO + 0.32 * EXPOSURE;
    // The cue ball runs away from the camera, the 9 to the left; the line of centres decides where they go on.
    let line = DVec2::new(0.42, -0.907_5).normalize();
    let nine = DVec2::new(0.085, -0.035);
    let cue = nine - line * (2.0 * RADIUS);
    let (cue_velocity, nine_velocity) = (DVec2::new(-0.38, -1.35), DVec2::new(-1.75, -0.14));
    // After the impact the 9 goes on to the 8, 0.10 of the exposure later, and the 8 to the 4, 0.38 later still.
    let jump = (nine_velocity - cue_velocity).dot(line);
    let nine_after = nine_velocity - jump * line;
    let meeting = nine + nine_after * (0.16 * EXPOSURE);
    let push = DVec2::new(-0.79, -0.613).normalize();
    let eight = meeting + push * (2.0 * RADIUS);
    let four = eight + push * (2.0 * RADIUS + nine_after.dot(push) * 0.34 * EXPOSURE);
    let at = |skin, place, velocity, pose| Ball {
        skin,
        place,
        velocity,
        rotation: DQuat::IDENTITY,
        pose,
        places: Vec::new(),
        rotations: Vec::new(),
    };
    vec![
        at(Skin(1, 0xf0b514, false), DVec2::new(-0.118, 0.072), DVec2::ZERO, [8.0, -38.0, 8.0, 0.0]),
        at(Skin(9, 0xf0b514, true), nine - nine_velocity * impact, nine_velocity, [5.0, -38.0, -8.0, 3.0]),
        at(Skin(8, 0x0d0d10, false), eight, DVec2::ZERO, [10.0, -30.0, -12.0, 0.0]),
        at(Skin(4, 0x4a2583, false), four, DVec2::ZERO, [-5.0, -35.0, 20.0, 0.0]),
        at(Skin(2, 0x17409c, false), DVec2::new(0.165, -0.175), DVec2::ZERO, [-20.0, -35.0, -15.0, 0.0]),
        at(Skin(0, 0xf1e9d2, false), cue - cue_velocity * impact, cue_velocity, [0.0, -30.0, 0.0, 0.0]),
    ]
}

/// Rolls the balls to the end of the shot: velocities are constant between impacts and ticks of 1/96 s.
fn roll(balls: &mut [Ball]) {
    const TICK: f64 = 1.0 / 96.0;
    // A slow cloth, so that the balls come to rest near the picture; it acts after the hero frame only.
    const DECELERATION: f64 = 1.6;
    let mut time = 0.0;
    let mut tick = 0.0_f64;
    record(balls, time);
    while time < END {
        let next_tick = ((tick + 1.0) * TICK).min(END);
        let (step, hit) = first_impact(balls, next_tick - time);
        for ball in balls.iter_mut() {
            ball.place += ball.velocity * step;
            let speed = ball.velocity.length();
            if speed > 0.0 {
                // ω = up × v / r.
                let axis = DVec3::new(ball.velocity.y, 0.0, -ball.velocity.x) / speed;
                ball.rotation = DQuat::from_axis_angle(axis, speed * step / RADIUS) * ball.rotation;
            }
        }
        time = if hit == Impact::None { next_tick } else { time + step };
        record(balls, time);
        match hit {
            Impact::None => {
                tick += 1.0;
                if time > HERO + EXPOSURE {
                    for ball in balls.iter_mut() {
                        let speed = ball.velocity.length();
                        let slower = (speed - DECELERATION * TICK).max(0.0);
                        ball.velocity = ball.velocity.normalize_or_zero() * slower;
                    }
                }
            }
            Impact::Pair(i, j) => {
                let line = (balls[j].place - balls[i].place).normalize();
                let jump = (balls[j].velocity - balls[i].velocity).dot(line) * line;
                balls[i].velocity += jump;
                balls[j].velocity -= jump;
                // The 8 meets the 4 head-on and keeps nothing: what rounding leaves is no motion.
                for k in [i, j] {
                    if balls[k].velocity.length() < 1e-9 {
                        balls[k].velocity = DVec2::ZERO;
                    }
                }
            }
            Impact::Cushion(i) => balls[i].velocity.y *= -0.8,
        }
    }
    pose(balls);
}

#[derive(Debug, Clone, Copy, PartialEq)]
enum Impact {
    None,
    Pair(usize, usize),
    Cushion(usize),
}

/// The first impact within `limit` seconds, or none and `limit`.
fn first_impact(balls: &[Ball], limit: f64) -> (f64, Impact) {
    let mut first = (limit, Impact::None);
    for (i, a) in balls.iter().enumerate() {
        if a.velocity.y < 0.0 {
            let t = (RAIL + RADIUS - a.place.y) / a.velocity.y;
            if t > 0.0 && t < first.0 {
                first = (t, Impact::Cushion(i));
            }
        }
        for (j, b) in balls.iter().enumerate().skip(i + 1) {
            let (p, v) = (b.place - a.place, b.velocity - a.velocity);
            let (along, speed) = (p.dot(v), v.length_squared());
            let gap = p.length_squared() - 4.0 * RADIUS * RADIUS;
            let root = along * along - speed * gap;
            if along < 0.0 && root > 0.0 {
                let t = (-along - libm::sqrt(root)) / speed;
                if t > -1e-9 && t < first.0 {
                    first = (t.max(0.0), Impact::Pair(i, j));
                }
            }
        }
    }
    first
}

/// Notes where the balls are; a ball at rest gets no more keys than it needs.
fn record(balls: &mut [Ball], time: f64) {
    for ball in balls {
        let place = DVec3::new(ball.place.x, RADIUS, ball.place.y);
        let n = ball.places.len();
        let still = |i: usize| ball.places[i].1 == place;
        if n >= 2 && still(n - 1) && still(n - 2) {
            ball.places[n - 1].0 = time;
            ball.rotations[n - 1].0 = time;
        } else {
            ball.places.push((time, place));
            ball.rotations.push((time, ball.rotation));
        }
    }
}

/// Turns every ball's whole path so that its number shows at its instant; balls that never move keep one key.
fn pose(balls: &mut [Ball]) {
    for ball in balls {
        let [yaw, pitch, roll, quarter] = ball.pose;
        let [yaw, pitch, roll] = [yaw, pitch, roll].map(f64::to_radians);
        // A quarter of the frame is a tick: there is a key at that very instant.
        let instant = HERO + 0.25 * quarter * EXPOSURE;
        let wanted = DQuat::from_rotation_y(yaw) * DQuat::from_rotation_x(pitch) * DQuat::from_rotation_z(roll);
        let shown = ball.rotations.iter().rev().find(|(t, _)| *t <= instant + 1e-9).map_or(DQuat::IDENTITY, |r| r.1);
        for (_, rotation) in &mut ball.rotations {
            *rotation = (*rotation * shown.inverse() * wanted).normalize();
        }
        let first = ball.places[0].1;
        if ball.places.iter().all(|(_, p)| *p == first) {
            ball.places.truncate(1);
            ball.rotations.truncate(1);
        }
    }
}

/// A ball's picture: number in a white disc on both sides, a stripe, or the cue ball's six red dots.
fn skin(&Skin(number, code, striped): &Skin) -> Canvas {
    let (colour, ivory, ink) = (srgb(code), srgb(0xf3ecd8), srgb(0x0c0c0e));
    let text = number.to_string();
    Canvas::paint(768, 384, 3, |uv| {
        let p = direction(uv.x, uv.y);
        if number == 0 {
            return if p.abs().max_element() > 0.989 { srgb(0xb8161c) } else { colour };
        }
        let facing = p.z.abs();
        let flat = DVec2::new(p.x * p.z.signum(), p.y);
        if facing > 0.86 {
            if distance(&text, flat / 0.52) < 0.085 { ink } else { ivory }
        } else if striped && p.y.abs() > 0.66 {
            ivory
        } else {
            colour
        }
    })
}

/// Cloth, cushion and wooden rail.
fn table(b: &mut Builder) {
    let cloth = mottle(b, "cloth", 128, 0.55, 1984);
    let felt = Paint::new("felt", srgb(0x1f7a45)).texture(cloth).rough(0.95).extension(
        "KHR_materials_sheen",
        json!({ "sheenColorFactor": [0.05, 0.12, 0.07], "sheenRoughnessFactor": 0.5 }),
    );
    let felt = b.material(felt);
    let bed = Shape::quad(DVec3::new(0.0, 0.0, 0.3), DVec3::X * 1.3, DVec3::NEG_Z * 0.75, DVec2::new(52.0, 30.0));
    b.put(Place::new("bed"), &bed, felt);
    let cushion = Shape::block(DVec3::new(1.3, 0.018, 0.03), 0.012, 4).at(0.0, 0.019, RAIL - 0.03);
    b.put(Place::new("cushion"), &cushion, felt);
    let wood = b.material(Paint::new("rail", srgb(0x5a2a14)).rough(0.35).lacquer(0.05));
    let rail = Shape::block(DVec3::new(1.3, 0.03, 0.08), 0.012, 4).plain().at(0.0, 0.012, RAIL - 0.14);
    b.put(Place::new("rail"), &rail, wood);
    let pearl = b.material(Paint::new("pearl", srgb(0xefe6d0)).rough(0.15));
    let mut inlays = Shape::default();
    for i in -4..=4 {
        let x = 0.18 * f64::from(i);
        let (right, up) = (DVec3::new(0.006, 0.0, 0.011), DVec3::new(0.006, 0.0, -0.011));
        inlays.join(&Shape::quad(DVec3::new(x, 0.0423, RAIL - 0.14), right, up, DVec2::ONE).plain());
    }
    b.put(Place::new("diamonds"), &inlays, pearl);
}

/// A dark panelled room with two windows of six panes and a lamp over the table.
fn room(b: &mut Builder) {
    let wall = b.material(Paint::new("wall", srgb(0x6b4a34)).rough(0.8));
    let ceiling = b.material(Paint::new("ceiling", srgb(0xb9a88c)).rough(0.9));
    let one = DVec2::ONE;
    let walls = [
        Shape::quad(DVec3::new(0.0, 0.5, -3.0), DVec3::X * 3.0, DVec3::Y * 1.5, one),
        Shape::quad(DVec3::new(0.0, 0.5, 3.0), DVec3::NEG_X * 3.0, DVec3::Y * 1.5, one),
        Shape::quad(DVec3::new(-3.0, 0.5, 0.0), DVec3::NEG_Z * 3.0, DVec3::Y * 1.5, one),
        Shape::quad(DVec3::new(3.0, 0.5, 0.0), DVec3::Z * 3.0, DVec3::Y * 1.5, one),
        Shape::quad(DVec3::new(0.0, -1.0, 0.0), DVec3::X * 3.0, DVec3::NEG_Z * 3.0, one),
    ];
    let mut shell = Shape::default();
    walls.iter().for_each(|w| shell.join(w));
    b.put(Place::new("walls"), &shell.plain(), wall);
    let top = Shape::quad(DVec3::new(0.0, 2.0, 0.0), DVec3::X * 3.0, DVec3::Z * 3.0, one).plain();
    b.put(Place::new("ceiling"), &top, ceiling);
    let daylight = b.material(Paint::light("daylight", lamp(7500.0), 16.0));
    let mut panes = Shape::default();
    for window in [-0.75, 0.75] {
        for (column, row) in (0..2).flat_map(|c| (0..3).map(move |r| (c, r))) {
            let centre =
                DVec3::new(-2.95, 0.72 + 0.44 * f64::from(row), -0.2 + window + 0.42 * (f64::from(column) - 0.5));
            panes.join(&Shape::quad(centre, DVec3::NEG_Z * 0.19, DVec3::Y * 0.20, one));
        }
    }
    b.put(Place::new("windows"), &panes.plain(), daylight);
    area_light(b, "table lamp", [0.25, 0.95, -0.25], [0.1, 0.0, -0.05], (0.9, 0.34), lamp(3400.0) * 11.0);
    area_light(b, "door", [2.6, 1.1, 1.6], [0.0, 0.0, 0.0], (0.8, 1.6), lamp(4500.0) * 5.0);
}
