//! A plump fellow strides past: skinned legs and arms, a body that squashes by a morph target, splines throughout.

use super::builder::{Builder, Node};
use super::colour::{lamp, srgb};
use super::node::{Aperture, Eye, Place};
use super::paint::Paint;
use super::set::{area_light, sweep};
use super::shape::Shape;
use super::sweep::{Ends, smooth};
use super::track::{Run, Track, beats};
use glam::{DAffine3, DQuat, DVec2, DVec3};
use std::f64::consts::TAU;

/// Length, seconds: three double steps.
const END: f64 = 2.0;
/// Seconds of a double step, and metres a second.
const CYCLE: f64 = 2.0 / 3.0;
const SPEED: f64 = 1.05;
/// Length of thigh and of shin; heights of ankle and hip when standing straight, metres.
const BONE: f64 = 0.17;
const ANKLE: f64 = 0.07;
const HIP: f64 = ANKLE + 2.0 * BONE;
/// Half the distance between the legs.
const STANCE: f64 = 0.085;

/// The skeleton's nodes, in the order of the skin's joints.
struct Skeleton {
    hips: Node,
    chest: Node,
    legs: [[Node; 3]; 2],
    arms: [[Node; 2]; 2],
}

/// Places of the joints in the pose in which the mesh was modelled.
const REST: [[f64; 3]; 12] = [
    [0.0, HIP, 0.0],
    [0.0, HIP + 0.12, 0.0],
    [0.0, HIP, -STANCE],
    [0.0, ANKLE + BONE, -STANCE],
    [0.0, ANKLE, -STANCE],
    [0.0, HIP, STANCE],
    [0.0, ANKLE + BONE, STANCE],
    [0.0, ANKLE, STANCE],
    [0.0, SHOULDER, -0.175],
    [0.0, SHOULDER - 0.13, -0.225],
    [0.0, SHOULDER, 0.175],
    [0.0, SHOULDER - 0.13, 0.225],
];
const SHOULDER: f64 = HIP + 0.24;

pub(crate) fn make() -> Vec<u8> {
    let mut b = Builder::default();
    stage(&mut b);
    // He walks a little towards the camera, so that his eyes show.
    let course = b.add(Place::new("course").turned(DQuat::from_rotation_y(-0.52)));
    let walker = b.add(Place::new("walker").under(course).at(-0.5 * SPEED * END, 0.0, 0.0));
    let skeleton = skeleton(&mut b, walker);
    let order = joints(&skeleton);
    let bound: Vec<(Node, DAffine3)> = order
        .iter()
        .zip(REST)
        .map(|(&node, place)| (node, DAffine3::from_translation(DVec3::from_array(place))))
        .collect();
    let skin = b.skin("walker", &bound);
    let mesh = figure(&mut b);
    let body = b.add(Place::new("figure").with(mesh).set("skin", skin));
    animate(&mut b, walker, body, &skeleton);
    let eye =
        Eye::new([0.45, 0.62, 3.0], [0.0, 0.46, 0.0], 23.0).lens(Aperture::FStop(2.8), [0.0, 0.5, 0.1]).shutter(180.0);
    b.camera("camera", &eye);
    b.finish("walker")
}

fn skeleton(b: &mut Builder, walker: Node) -> Skeleton {
    let mut joint = |name: &str, parent: Node, at: [f64; 3], from: [f64; 3]| {
        let offset = DVec3::from_array(at) - DVec3::from_array(from);
        b.add(Place::new(name).under(parent).at(offset.x, offset.y, offset.z))
    };
    let hips = joint("hips", walker, REST[0], [0.0; 3]);
    let chest = joint("chest", hips, REST[1], REST[0]);
    let legs = [2, 5].map(|i| {
        let thigh = joint("thigh", hips, REST[i], REST[0]);
        let shin = joint("shin", thigh, REST[i + 1], REST[i]);
        [thigh, shin, joint("foot", shin, REST[i + 2], REST[i + 1])]
    });
    let arms = [8, 10].map(|i| {
        let upper = joint("upper arm", chest, REST[i], REST[1]);
        [upper, joint("forearm", upper, REST[i + 1], REST[i])]
    });
    Skeleton { hips, chest, legs, arms }
}

/// The joints in the order of [`REST`].
fn joints(s: &Skeleton) -> Vec<Node> {
    let mut list = vec![s.hips, s.chest];
    list.extend(s.legs.concat());
    list.extend(s.arms.concat());
    list
}

/// Smooth step from 0 to 1 while `x` runs from `low` to `high`.
fn ease(low: f64, high: f64, x: f64) -> f64 {
    let s = ((x - low) / (high - low)).clamp(0.0, 1.0);
    s * s * (3.0 - 2.0 * s)
}

/// The mesh, with every part bound to its joints and the squashed shape as a morph target.
fn figure(b: &mut Builder) -> super::builder::Mesh {
    let coral = b.material(Paint::new("coral", srgb(0xe8603c)).rough(0.45).lacquer(0.12));
    let cream = b.material(Paint::new("cream", srgb(0xf6ead2)).rough(0.3).lacquer(0.05));
    let ink = b.material(Paint::new("ink", srgb(0x14161c)).rough(0.15));
    let navy = b.material(Paint::new("navy", srgb(0x1d2f55)).rough(0.35).lacquer(0.08));
    let torso = |p: DVec3| {
        let up = ease(HIP - 0.02, HIP + 0.22, p.y);
        ([0, 1, 0, 0], [1.0 - up, up, 0.0, 0.0])
    };
    let egg = smooth(
        &[
            [0.0, HIP + 0.45],
            [0.07, HIP + 0.437],
            [0.135, HIP + 0.38],
            [0.18, HIP + 0.27],
            [0.205, HIP + 0.13],
            [0.20, HIP + 0.02],
            [0.155, HIP - 0.07],
            [0.08, HIP - 0.112],
            [0.0, HIP - 0.122],
        ],
        5,
    );
    let mut skin = Shape::lathe(&egg, 48).plain().bound(torso);
    let mut boots = Shape::default();
    for (side, first) in [(-1.0, 2_u8), (1.0, 5)] {
        skin.join(&leg(side, first));
        boots.join(&boot(side, first));
        skin.join(&arm(side, if first == 2 { 8 } else { 10 }));
    }
    // Eyes look forward, +x.
    let (mut whites, mut pupils) = (Shape::default(), Shape::default());
    for z in [-1.0, 1.0] {
        whites.join(&Shape::ball(0.062, 28, 14).plain().at(0.118, HIP + 0.29, 0.07 * z).bound(torso));
        pupils.join(&Shape::ball(0.034, 24, 12).plain().at(0.153, HIP + 0.295, 0.076 * z).bound(torso));
    }
    let stalk: Vec<DVec3> = (0..=8)
        .map(|i| {
            let s = f64::from(i) / 8.0;
            DVec3::new(-0.05 * s * s, HIP + 0.43 + 0.12 * s, 0.0)
        })
        .collect();
    pupils.join(&Shape::wire(&stalk, 0.008, 12, Ends::Open).plain().bound(torso));
    whites.join(&Shape::ball(0.026, 20, 10).plain().at(-0.05, HIP + 0.57, 0.0).bound(torso));
    let parts: Vec<_> = [(skin, coral), (whites, cream), (pupils, ink), (boots, navy)]
        .into_iter()
        .map(|(shape, material)| (b.geometry(&squashed(shape)), material))
        .collect();
    let parts: Vec<_> = parts.iter().map(|(geometry, material)| (geometry, *material)).collect();
    b.mesh("figure", &parts)
}

/// Adds the squashed shape: lower and wider above the hips, at constant volume; legs stay.
fn squashed(mut shape: Shape) -> Shape {
    let (low, wide) = (0.76, 1.0 / libm::sqrt(0.76));
    let share = |y: f64| ease(HIP - 0.16, HIP + 0.05, y);
    let body = |joints: [u8; 4]| joints[0] < 2;
    let (mut positions, mut normals) = (Vec::new(), Vec::new());
    for ((p, n), j) in shape.positions.iter().zip(&shape.normals).zip(&shape.joints) {
        if !body(*j) {
            positions.push(*p);
            normals.push(*n);
            continue;
        }
        let s = share(p.y);
        let (w, l) = (1.0 + (wide - 1.0) * s, 1.0 + (low - 1.0) * s);
        let base = HIP - 0.12;
        positions.push(DVec3::new(p.x * w, base + (p.y - base) * l, p.z * w));
        normals.push((*n / DVec3::new(w, l, w)).normalize());
    }
    shape.targets = vec![(positions, normals)];
    shape
}

/// A leg: one tube from inside the body to the ankle, bent smoothly at the knee.
fn leg(side: f64, first: u8) -> Shape {
    let path: Vec<DVec3> = (0..=24)
        .map(|i| DVec3::new(0.0, HIP + 0.02 - (HIP - ANKLE + 0.02) * f64::from(i) / 24.0, STANCE * side))
        .collect();
    let knee = ANKLE + BONE;
    Shape::wire(&path, 0.048, 22, Ends::Round).plain().bound(|p| {
        let (shin, foot) = (ease(knee + 0.06, knee - 0.06, p.y), ease(ANKLE + 0.03, ANKLE - 0.03, p.y));
        let shin_only = shin * (1.0 - foot);
        ([first, first + 1, first + 2, 0], [1.0 - shin, shin_only, shin * foot, 0.0])
    })
}

/// A boot: an egg with a flat sole.
fn boot(side: f64, first: u8) -> Shape {
    let mut shape = Shape::ball(1.0, 32, 18).plain();
    for (p, n) in shape.positions.iter_mut().zip(&mut shape.normals) {
        let size = DVec3::new(0.115, if p.y > 0.0 { 0.085 } else { 0.045 }, 0.068);
        *n = (*n / size).normalize();
        *p *= size;
        if p.y < -0.035 {
            p.y = -0.035;
            *n = DVec3::NEG_Y;
        }
    }
    shape.at(0.035, 0.036, STANCE * side).bound(|_| ([first + 2, 0, 0, 0], [1.0, 0.0, 0.0, 0.0]))
}

/// An arm: a tube from the shoulder past the elbow, with a round hand.
fn arm(side: f64, first: u8) -> Shape {
    let [_, top, z0] = REST[8];
    let path: Vec<DVec3> = (0..=16)
        .map(|i| {
            let s = f64::from(i) / 16.0;
            DVec3::new(0.0, top - 0.25 * s, side * (z0.abs() - 0.03 + 0.09 * libm::sqrt(s)))
        })
        .collect();
    let mut shape = Shape::wire(&path, 0.032, 18, Ends::Round);
    shape.join(&Shape::ball(0.047, 22, 11).at(0.0, top - 0.27, side * (z0.abs() + 0.062)));
    shape.plain().bound(|p| {
        let fore = ease(top - 0.08, top - 0.18, p.y);
        ([first, first + 1, 0, 0], [1.0 - fore, fore, 0.0, 0.0])
    })
}

/// A leg at an instant: seconds; angles of thigh, shin and foot.
type Pose = (f64, f64, f64, f64);

/// Where an ankle is relative to the point below the hips: on the ground it runs back at the walking speed, then it
/// swings forward. Also the foot's pitch.
fn step(phase: f64) -> (DVec2, f64) {
    let phase = phase.rem_euclid(1.0);
    let reach = SPEED * CYCLE / 4.0;
    if phase < 0.5 {
        let s = phase / 0.5;
        (DVec2::new(reach * (1.0 - 2.0 * s), ANKLE), 0.35 * (1.0 - ease(0.0, 0.18, s)) - 0.55 * ease(0.7, 1.0, s))
    } else {
        let s = (phase - 0.5) / 0.5;
        let lift = libm::sin(std::f64::consts::PI * s);
        let x = -reach * libm::cos(std::f64::consts::PI * s);
        (DVec2::new(x, ANKLE + 0.10 * lift), -0.55 + 0.9 * ease(0.0, 0.9, s))
    }
}

/// Angles of thigh and shin from straight down, forward positive, that bring the ankle to `target` relative to the
/// hip: the law of cosines, knee forward.
fn bend(target: DVec2) -> (f64, f64) {
    let reach = target.length().min(1.999 * BONE);
    let lean = libm::atan2(target.x, -target.y);
    let half = libm::acos(reach / (2.0 * BONE));
    (lean + half, lean - half)
}

fn animate(b: &mut Builder, walker: Node, figure: Node, s: &Skeleton) {
    let times = beats(END, 24);
    let path = |t: f64| DVec3::new(SPEED * (t - 0.5 * END), 0.0, 0.0);
    b.animate(walker, &Track::translation(Run::Linear, &[(0.0, path(0.0)), (END, path(END))]));
    // Lowest when both feet are on the ground, highest on one leg.
    let bob = |t: f64| HIP - 0.035 - 0.022 * libm::cos(2.0 * TAU * t / CYCLE - 0.3);
    let hips: Vec<_> = times.iter().map(|&t| (t, DVec3::new(0.0, bob(t), 0.0))).collect();
    b.animate(s.hips, &Track::translation(Run::Cubic, &hips));
    let spin = |angle: f64| DQuat::from_rotation_z(angle);
    let sway: Vec<_> = times
        .iter()
        .map(|&t| {
            let w = TAU * t / CYCLE;
            let lean = DQuat::from_rotation_x(0.07 * libm::sin(w)) * spin(-0.10 + 0.05 * libm::sin(2.0 * w));
            (t, DQuat::from_rotation_y(0.16 * libm::cos(w)) * lean)
        })
        .collect();
    b.animate(s.chest, &Track::rotation(Run::Cubic, &sway));
    for (leg, offset) in s.legs.iter().zip([0.0, 0.5]) {
        let poses: Vec<_> = times
            .iter()
            .map(|&t| {
                let (ankle, pitch) = step(t / CYCLE + offset);
                let (thigh, shin) = bend(ankle - DVec2::new(0.0, bob(t)));
                (t, thigh, shin, pitch)
            })
            .collect();
        let track = |angle: fn(&Pose) -> f64| {
            let keys: Vec<_> = poses.iter().map(|p| (p.0, spin(angle(p)))).collect();
            Track::rotation(Run::Cubic, &keys)
        };
        b.animate(leg[0], &track(|p| p.1));
        b.animate(leg[1], &track(|p| p.2 - p.1));
        b.animate(leg[2], &track(|p| p.3 - p.2));
    }
    for (arm, sign) in s.arms.iter().zip([-1.0, 1.0]) {
        let swing = |t: f64, lag: f64| sign * libm::cos(TAU * t / CYCLE - lag);
        let upper: Vec<_> = times.iter().map(|&t| (t, spin(0.75 * swing(t, 0.0)))).collect();
        b.animate(arm[0], &Track::rotation(Run::Cubic, &upper));
        let fore: Vec<_> = times.iter().map(|&t| (t, spin(0.55 + 0.35 * swing(t, 0.5)))).collect();
        b.animate(arm[1], &Track::rotation(Run::Cubic, &fore));
    }
    let squash: Vec<_> =
        times.iter().map(|&t| (t, vec![0.45 + 0.45 * libm::cos(2.0 * TAU * t / CYCLE - 0.9)])).collect();
    b.animate(figure, &Track::weights(Run::Cubic, &squash));
}

/// A pale sweep, a few solids for scale and parallax, soft lights.
fn stage(b: &mut Builder) {
    let backdrop = b.material(Paint::new("backdrop", srgb(0x9ec4bd)).rough(0.9));
    b.put(Place::new("backdrop"), &sweep(6.0, 4.0, -2.0, 1.0, 4.0).plain(), backdrop);
    let mustard = b.material(Paint::new("mustard", srgb(0xe5ae3a)).rough(0.6));
    let plum = b.material(Paint::new("plum", srgb(0x7c3f58)).rough(0.6));
    let white = b.material(Paint::new("white", srgb(0xf2eee4)).rough(0.6));
    let arch: Vec<DVec3> = (0..=40)
        .map(|i| {
            let angle = std::f64::consts::PI * f64::from(i) / 40.0;
            DVec3::new(0.42 * libm::cos(angle), 0.25 + 0.52 * libm::sin(angle), 0.0)
        })
        .collect();
    let mut arch_path = vec![DVec3::new(0.42, 0.0, 0.0)];
    arch_path.extend(arch);
    arch_path.push(DVec3::new(-0.42, 0.0, 0.0));
    b.put(Place::new("arch").at(-0.30, 0.0, -1.1), &Shape::wire(&arch_path, 0.085, 32, Ends::Open).plain(), white);
    let steps: [(f64, f64); 3] = [(0.78, 0.16), (0.98, 0.30), (1.18, 0.44)];
    for (x, h) in steps {
        let block = Shape::block(DVec3::new(0.1, 0.5 * h, 0.16), 0.012, 3).plain();
        b.put(Place::new("block").at(x, 0.5 * h, -0.62), &block, plum);
    }
    b.put(Place::new("ball").at(-1.28, 0.15, -0.85), &Shape::ball(0.15, 64, 32).plain(), mustard);
    area_light(b, "key", [-1.3, 2.2, 1.9], [0.0, 0.4, 0.0], (1.2, 1.2), lamp(4800.0) * 12.5);
    area_light(b, "fill", [2.6, 1.3, 2.0], [0.0, 0.4, 0.0], (0.9, 1.8), lamp(8000.0) * 5.5);
    area_light(b, "top", [0.0, 2.9, -0.8], [0.0, 0.0, -0.5], (3.0, 1.0), lamp(6200.0) * 4.0);
}
