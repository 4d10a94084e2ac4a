//! Baked skins, morph targets and lights against dense evaluation of the curves, in pixels.

#![allow(clippy::unwrap_used, clippy::print_stdout, reason = "a test fails by panicking and prints what it measured")]

#[path = "support/moving.rs"]
mod moving;

use glam::{DAffine3, DVec3, Quat, Vec3};

use graeco::scene::rig::{Playback, Rig};
use graeco::scene::{
    Interpolation, Light, LightShape, MorphTarget, NodeId, Property, Scene, Skin, SkinBinding, Stage, Track,
};
use moving::{Builder, exposure, own_time, project, stage, true_world, wide};
use proptest::prelude::*;

const PIXELS: f64 = 1.0 / 16.0;
/// What single precision may add to the bound: see `motion.rs`; positions of deformed vertices are rounded once more.
const ROUNDING: f64 = 0.006;

const INFLUENCES: usize = 8;
const JOINTS: usize = 4;
const VERTICES: usize = 12;
const TARGETS: usize = 2;

/// Everything that is drawn at random: keys of four curves and the mesh.
#[derive(Debug, Clone)]
struct Draw {
    spline: bool,
    times: Vec<f64>,
    values: Vec<[f32; 4]>,
    points: Vec<[f32; 3]>,
    weights: Vec<f32>,
    amount: f32,
}

fn draws() -> impl Strategy<Value = Draw> {
    let gaps = prop::collection::vec(0.05_f64..0.5, 2..4);
    let amount = prop_oneof![Just(1.0_f32), Just(0.5), Just(2.0)];
    (any::<bool>(), -0.2_f64..0.3, gaps, amount).prop_flat_map(|(spline, start, gaps, amount)| {
        let mut times = vec![start];
        times.extend(gaps.iter().scan(start, |t, g| {
            *t += g;
            Some(*t)
        }));
        let n = times.len() * 3 * (JOINTS + 1);
        (
            prop::collection::vec(prop::array::uniform4(-1.0_f32..1.0), n),
            prop::collection::vec(prop::array::uniform3(-0.5_f32..0.5), VERTICES * (1 + TARGETS)),
            prop::collection::vec(0.0_f32..1.0, VERTICES * INFLUENCES),
        )
            .prop_map(move |(values, points, weights)| Draw {
                spline,
                times: times.clone(),
                values,
                points,
                weights,
                amount,
            })
    })
}

impl Draw {
    fn track<T>(&self, which: usize, width: usize, value: impl Fn([f32; 4], usize) -> T) -> Track<T> {
        let per_key = if self.spline { 3 } else { 1 };
        let from = &self.values[which * self.times.len() * 3..][..self.times.len() * per_key];
        let values = from.iter().flat_map(|v| (0..width).map(|k| value(*v, k))).collect();
        let interpolation = if self.spline { Interpolation::CubicSpline } else { Interpolation::Linear };
        Track { times: self.times.clone(), values, width, interpolation }
    }

    fn rotation(&self, which: usize) -> Property {
        // Values of a spline stay clear of zero where it passes between them: all lie on one side.
        let spline = self.spline;
        Property::Rotation(self.track(which, 1, |v, _| {
            let q = Quat::from_xyzw(v[0], v[1], v[2], 1.5 + v[3]);
            if spline { q } else { q.normalize() }
        }))
    }

    fn point(&self, i: usize) -> Vec3 {
        Vec3::from_array(self.points[i])
    }
}

/// An arm of four joints with a skin of eight influences a vertex, two morph targets, all driven.
fn arm(draw: &Draw, skinned: bool) -> (Scene, NodeId) {
    let mut b = Builder::new(12.0);
    let holder = b.node(None, Vec3::ZERO);
    let positions: Vec<Vec3> = (0..VERTICES).map(|i| draw.point(i)).collect();
    let mesh = b.mesh(holder, &positions);
    let target = |k: usize| MorphTarget {
        positions: (0..VERTICES).map(|i| draw.point(VERTICES * (k + 1) + i)).collect(),
        ..MorphTarget::default()
    };
    b.scene.meshes[mesh].targets = (0..TARGETS).map(target).collect();
    b.scene.nodes[holder].weights = vec![0.0; TARGETS];
    b.scene.nodes[holder].blur_scale = Some(draw.amount);
    b.drive(holder, Property::Weights(draw.track(JOINTS, TARGETS, |v, k| v[k])));
    if skinned {
        let mut joints = Vec::new();
        for j in 0..JOINTS {
            let parent = joints.last().copied();
            joints.push(b.node(parent, Vec3::X * if j == 0 { 0.0 } else { 0.8 }));
            b.drive(joints[j], draw.rotation(j));
        }
        #[allow(clippy::cast_possible_truncation, reason = "few joints")]
        let of = |v: usize, i: usize| ((v + i) % JOINTS) as u16;
        let share = |v: usize, i: usize| {
            let own = &draw.weights[v * INFLUENCES..][..INFLUENCES];
            own[i] / own.iter().sum::<f32>().max(1e-3)
        };
        let pairs = || (0..VERTICES).flat_map(|v| (0..INFLUENCES).map(move |i| (v, i)));
        b.scene.meshes[mesh].skin = Some(SkinBinding {
            influences: INFLUENCES,
            joints: pairs().map(|(v, i)| of(v, i)).collect(),
            weights: pairs().map(|(v, i)| share(v, i)).collect(),
        });
        let bind = |j: u8| DAffine3::from_translation(DVec3::X * (-0.8 * f64::from(j)));
        b.scene.skins.push(Skin { name: String::new(), joints, inverse_bind: (0..4).map(bind).collect() });
        b.scene.nodes[holder].skin = Some(0);
    } else {
        b.drive(holder, draw.rotation(0));
    }
    (b.finish(), holder)
}

/// The value of one morph weight, by the interpolation's own formula (glTF 2.0, appendix C).
fn weight(track: &Track<f32>, k: usize, time: f64) -> f64 {
    let times = &track.times;
    let last = times.len() - 1;
    let value = |key: usize, part: usize| {
        let parts = if track.interpolation == Interpolation::CubicSpline { 3 } else { 1 };
        f64::from(track.values[(key * parts + part) * track.width + k])
    };
    let middle = usize::from(track.interpolation == Interpolation::CubicSpline);
    if time <= times[0] {
        return value(0, middle);
    }
    if time >= times[last] {
        return value(last, middle);
    }
    let key = times.partition_point(|&t| t <= time) - 1;
    let length = times[key + 1] - times[key];
    let s = (time - times[key]) / length;
    if middle == 0 {
        return value(key, 0) * (1.0 - s) + value(key + 1, 0) * s;
    }
    let (s2, s3) = (s * s, s * s * s);
    (2.0 * s3 - 3.0 * s2 + 1.0) * value(key, 1)
        + length * (s3 - 2.0 * s2 + s) * value(key, 2)
        + (3.0 * s2 - 2.0 * s3) * value(key + 1, 1)
        + length * (s3 - s2) * value(key + 1, 0)
}

/// Where the vertices truly are at `u`.
fn true_vertices(rig: &Rig<'_>, holder: NodeId, time: f64) -> Vec<DVec3> {
    let scene = rig.scene();
    let mesh = &scene.meshes[0];
    let weights = scene.animations[0].channels.iter().find_map(|c| match &c.property {
        Property::Weights(track) => Some(track),
        _ => None,
    });
    let morphed = (0..VERTICES).map(|v| {
        mesh.positions[v].as_dvec3()
            + (0..TARGETS)
                .map(|k| mesh.targets[k].positions[v].as_dvec3() * weight(weights.unwrap(), k, time))
                .sum::<DVec3>()
    });
    let place = true_world(rig, holder, time);
    let Some(binding) = &mesh.skin else { return morphed.map(|p| place.transform_point3(p)).collect() };
    let skin = &scene.skins[0];
    let joint = |j: u16| true_world(rig, skin.joints[usize::from(j)], time) * skin.inverse_bind[usize::from(j)];
    let palette: Vec<DAffine3> = (0..).take(JOINTS).map(joint).collect();
    let skinned = |(v, p): (usize, DVec3)| {
        (0..INFLUENCES)
            .map(|i| v * INFLUENCES + i)
            .map(|i| palette[usize::from(binding.joints[i])].transform_point3(p) * f64::from(binding.weights[i]))
            .sum::<DVec3>()
    };
    morphed.enumerate().map(skinned).collect()
}

/// Where traversal has them.
fn baked_vertices(stage: &Stage, u: f32) -> Vec<DVec3> {
    let instance = &stage.instances[0];
    let geometry = &stage.geometries[instance.geometry];
    let positions = |key: usize, v: usize| geometry.keys[key].positions[v].as_dvec3();
    let last = geometry.keys.len() - 1;
    let key = geometry.times.partition_point(|&t| t <= u).saturating_sub(1).min(last.saturating_sub(1));
    let place = wide(instance.motion.at(u));
    (0..VERTICES)
        .map(|v| {
            if last == 0 {
                return place.transform_point3(positions(0, v));
            }
            let (a, b) = (f64::from(geometry.times[key]), f64::from(geometry.times[key + 1]));
            let s = (f64::from(u) - a) / (b - a);
            place.transform_point3(positions(key, v) * (1.0 - s) + positions(key + 1, v) * s)
        })
        .collect()
}

/// The largest distance in pixels at `instants` even instants.
fn worst_error(rig: &Rig<'_>, stage: &Stage, holder: NodeId, instants: u16) -> f64 {
    let eye = true_world(rig, Builder::EYE, 0.0);
    let mut worst = 0.0_f64;
    for i in 0..=instants {
        let u = f32::from(i) / f32::from(instants);
        let time = own_time(stage.interval, rig.blur(holder), f64::from(u));
        for (truth, baked) in true_vertices(rig, holder, time).into_iter().zip(baked_vertices(stage, u)) {
            if let (Some(a), Some(b)) = (project(eye, truth), project(eye, baked)) {
                worst = worst.max(a.distance(b));
            }
        }
    }
    worst
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 48, failure_persistence: None, ..ProptestConfig::default() })]

    /// Bound: PIXELS as the camera sees it; vertices of up to eight influences under turning joints and morph targets.
    #[test]
    fn any_deformation_stays_within_the_asked_part_of_a_pixel(draw in draws(), skinned in any::<bool>()) {
        let (scene, holder) = arm(&draw, skinned);
        let rig = Rig::new(&scene, &Playback::default()).unwrap();
        let baked = stage(&scene, exposure(0.1, 0.7), PIXELS);
        let keys = baked.geometries[0].keys.len();
        // Curves that end before the exposure move nothing in it.
        prop_assume!(keys > 1);
        let worst = worst_error(&rig, &baked, holder, 500);
        prop_assert!(worst <= PIXELS + ROUNDING, "{worst} pixels off with {keys} keys");
    }

    /// A lamp on a turning arm, with its direction: its place within PIXELS, its beam within PIXELS at its own distance.
    #[test]
    fn a_moving_lamp_keeps_the_bound(draw in draws()) {
        let mut b = Builder::new(12.0);
        let shoulder = b.node(None, Vec3::ZERO);
        let lamp = b.node(Some(shoulder), Vec3::new(1.0, 0.5, 0.0));
        b.drive(shoulder, draw.rotation(0));
        b.drive(lamp, draw.rotation(1));
        let shape = LightShape::Spot { inner_cone: 0.2, outer_cone: 0.4, radius: 0.0 };
        b.scene.lights.push(Light { name: String::new(), shape, intensity: Vec3::ONE, range: None });
        b.scene.nodes[lamp].light = Some(0);
        let scene = b.finish();
        let rig = Rig::new(&scene, &Playback::default()).unwrap();
        let baked = stage(&scene, exposure(0.1, 0.7), PIXELS);
        let eye = true_world(&rig, Builder::EYE, 0.0);
        for i in 0..=500_u16 {
            let u = f32::from(i) / 500.0;
            let truth = true_world(&rig, lamp, own_time(baked.interval, 1.0, f64::from(u)));
            let kept = wide(baked.lights[0].motion.at(u));
            // A metre along the beam is far less than what the bound allows for: the distance from the camera.
            for p in [DVec3::ZERO, DVec3::NEG_Z] {
                if let (Some(a), Some(b)) =
                    (project(eye, truth.transform_point3(p)), project(eye, kept.transform_point3(p)))
                {
                    prop_assert!(a.distance(b) <= 2.0 * PIXELS + ROUNDING, "{}", a.distance(b));
                    prop_assert!(p != DVec3::ZERO || a.distance(b) <= PIXELS + ROUNDING, "{}", a.distance(b));
                }
            }
        }
    }
}

/// The planted twin: vertices at the ends of the exposure alone, as two-key deformation blur has them.
#[test]
fn the_measure_catches_two_vertex_keys() {
    let draw = Draw {
        spline: false,
        times: vec![0.0, 0.4, 0.8],
        values: (0..45_u8).map(|i| [0.9, -0.8, 0.7, -0.9].map(|x: f32| if i % 2 == 0 { x } else { -x })).collect(),
        points: (0..36_u8).map(|i| [f32::from(i % 5) * 0.2 - 0.4, f32::from(i % 7) * 0.1, 0.3]).collect(),
        weights: vec![0.5; VERTICES * INFLUENCES],
        amount: 1.0,
    };
    let (scene, holder) = arm(&draw, true);
    let rig = Rig::new(&scene, &Playback::default()).unwrap();
    let mut baked = stage(&scene, exposure(0.1, 0.7), PIXELS);
    let whole = worst_error(&rig, &baked, holder, 500);
    let shape = &mut baked.geometries[0];
    shape.keys = vec![shape.keys[0].clone(), shape.keys[shape.keys.len() - 1].clone()];
    shape.times = vec![0.0, 1.0];
    let naive = worst_error(&rig, &baked, holder, 500);
    println!("deforming arm: {whole:.4} pixels off, with two keys {naive:.1}");
    assert!(whole <= PIXELS + ROUNDING && naive > 10.0, "{whole} {naive}");
}
