//! Curves and what is baked from them against a second evaluation, written from the specification's formulas (glTF 2.0,
//! appendix C) and sharing no code with the library.

use crate::moving::{Builder, exposure, request, stage, worst_error};
use crate::{Random, fuzz};
use glam::{DAffine3, DMat3, DQuat, DVec3, DVec4, Quat, Vec3};
use graeco::scene::rig::{Playback, Rig};
use graeco::scene::{Interpolation, NodeId, Property, Track};

/// A track in `f64`, one value (or three) a key, padded with zeros.
#[derive(Debug)]
struct Curve {
    interpolation: Interpolation,
    times: Vec<f64>,
    values: Vec<DVec4>,
}

impl Curve {
    fn key(&self, key: usize, part: usize) -> DVec4 {
        if self.interpolation == Interpolation::CubicSpline { self.values[3 * key + part] } else { self.values[key] }
    }

    /// The key that holds, or the one that begins the segment and how far on.
    fn place(&self, t: f64) -> (usize, Option<f64>) {
        match (0..self.times.len()).rev().find(|&k| self.times[k] <= t) {
            None => (0, None),
            Some(k) if k + 1 == self.times.len() || self.interpolation == Interpolation::Step => (k, None),
            Some(k) => (k, Some((t - self.times[k]) / (self.times[k + 1] - self.times[k]))),
        }
    }

    /// The value at `t`, and a bound on the terms that it is a sum of.
    fn at(&self, t: f64) -> (DVec4, f64) {
        let (k, Some(s)) = self.place(t) else {
            return (self.key(self.place(t).0, 1), self.key(self.place(t).0, 1).length());
        };
        let (v, w) = (self.key(k, 1), self.key(k + 1, 1));
        if self.interpolation == Interpolation::Linear {
            return ((1.0 - s) * v + s * w, v.length() + w.length());
        }
        let span = self.times[k + 1] - self.times[k];
        let (b, a) = (self.key(k, 2), self.key(k + 1, 0));
        let value = (2.0 * s.powi(3) - 3.0 * s.powi(2) + 1.0) * v
            + span * (s.powi(3) - 2.0 * s.powi(2) + s) * b
            + (-2.0 * s.powi(3) + 3.0 * s.powi(2)) * w
            + span * (s.powi(3) - s.powi(2)) * a;
        (value, v.length() + w.length() + span * (a.length() + b.length()))
    }

    /// The rotation at `t`; `None` where it is undefined or wildly conditioned: between opposite keys, near zero.
    fn turn(&self, t: f64) -> Option<DQuat> {
        let unit = |q: DVec4| if q.length() > 0.0 { DQuat::from_vec4(q / q.length()) } else { DQuat::IDENTITY };
        let (k, Some(s)) = self.place(t) else { return Some(unit(self.key(self.place(t).0, 1))) };
        if self.interpolation == Interpolation::CubicSpline {
            let (value, size) = self.at(t);
            return (value.length() > 1e-3 * size).then(|| unit(value));
        }
        // By the rotation vector of the way from one to the other.
        let (p, q) = (unit(self.key(k, 1)), unit(self.key(k + 1, 1)));
        let way = DVec4::from(p.conjugate() * q);
        let way = if way.w < 0.0 { -way } else { way };
        let (sine, cosine) = (way.truncate().length(), way.w);
        if cosine < 1e-6 {
            return None;
        }
        let angle = sine.atan2(cosine) * s;
        let axis = if sine > 0.0 { way.truncate() / sine } else { DVec3::ZERO };
        Some(p * DQuat::from_vec4((axis * angle.sin()).extend(angle.cos())))
    }
}

const KINDS: [Interpolation; 3] = [Interpolation::Step, Interpolation::Linear, Interpolation::CubicSpline];

/// Ascending key times as a file holds them, often equal.
fn times(random: &mut Random, count: usize) -> Vec<f64> {
    let start = random.pick(&[0.0_f32, -1.0, 36_000.0, 1e6, 1e-30]);
    let step = random.pick(&[0.04_f32, 1.0, 1e-6, 1e5]);
    let mut times: Vec<f32> =
        (0..count).map(|_| start + step * (random.below(40) as f32) * random.pick(&[1.0, 0.3])).collect();
    times.sort_by(f32::total_cmp);
    times.into_iter().map(f64::from).collect()
}

fn number(random: &mut Random) -> f32 {
    let small = (2.0 * random.unit() - 1.0) as f32;
    small * random.pick(&[1.0, 1.0, 1.0, 0.0, 1e-38, 1e-6, 1e6, 1e18])
}

/// Instants at, beside, between and beyond the keys.
fn instant(random: &mut Random, times: &[f64]) -> f64 {
    let key = random.pick(times);
    match random.below(5) {
        0 => key,
        1 => key.next_up(),
        2 => key.next_down(),
        3 => key + random.pick(&[-1e9, 1e9]),
        _ => key + (random.pick(times) - key) * random.unit(),
    }
}

#[test]
fn curves_are_what_the_specification_says() {
    fuzz("curves", 30_000, |iteration, random| {
        let interpolation = random.pick(&KINDS);
        let count = 1 + random.below(6);
        let times = times(random, count);
        let per_key = if interpolation == Interpolation::CubicSpline { 3 } else { 1 };
        let values: Vec<[f32; 4]> = (0..count * per_key).map(|_| std::array::from_fn(|_| number(random))).collect();
        let vectors = values.iter().map(|v| Vec3::new(v[0], v[1], v[2])).collect();
        let rotations = values.iter().map(|v| Quat::from_array(*v)).collect();
        let wide = |v: &[f32; 4], n: usize| {
            DVec4::from_array(std::array::from_fn(|i| if i < n { f64::from(v[i]) } else { 0.0 }))
        };
        let curve = |n: usize| Curve {
            interpolation,
            times: times.clone(),
            values: values.iter().map(|v| wide(v, n)).collect(),
        };
        let place = Track { times: times.clone(), values: vectors, width: 1, interpolation };
        let turning = Track { times: times.clone(), values: rotations, width: 1, interpolation };
        let (curve, turns) = (curve(3), curve(4));
        for _ in 0..8 {
            let t = instant(random, &times);
            let about = || format!("iteration {iteration} at {t}: {curve:?}");
            let (want, size) = curve.at(t);
            let got: DVec3 = place.value(0, (t, t), t);
            assert!((got - want.truncate()).length() <= 1e-13 * size, "{got} for {want}; {}", about());
            let jet = place.jet(0, (t, t), |v| v.length());
            assert!(got.length() <= jet.value * (1.0 + 1e-12) + 1e-13 * size, "{jet:?}; {}", about());
            let turned = turning.rotation((t, t), t);
            assert!((turned.length() - 1.0).abs() < 1e-12, "{turned}; {}", about());
            if let Some(want) = turns.turn(t) {
                let off = DMat3::from_quat(turned) - DMat3::from_quat(want);
                let off = off.to_cols_array().iter().fold(0.0_f64, |a, x| a.max(x.abs()));
                assert!(off < 1e-8, "off by {off}; iteration {iteration} at {t}: {turns:?}");
            }
            // Constant on [a, b), which t is inside.
            let (a, b) = (t.min(times[0]), t.max(times[count - 1]).next_up());
            if place.is_constant(a, b) {
                assert!((got - curve.at(a).0.truncate()).length() <= 1e-13 * size, "not constant; {}", about());
            }
        }
    });
}

/// A chain of nodes with a triangle at its end, seen from 10 m, and its curves: translation, rotation, scale a node.
fn chain(random: &mut Random) -> (Builder, Vec<[Curve; 3]>) {
    let mut b = Builder::new(10.0);
    let (mut parent, mut curves): (Option<NodeId>, Vec<[Curve; 3]>) = (None, Vec::new());
    for _ in 0..=random.below(3) {
        let node = b.node(parent, Vec3::ZERO);
        let made: [Curve; 3] = std::array::from_fn(|what| {
            let interpolation = random.pick(&KINDS);
            let count = 1 + random.below(4);
            let mut at = random.unit() * 0.3;
            let times: Vec<f64> = (0..count)
                .map(|_| {
                    at += 0.05 + 0.4 * random.unit();
                    at
                })
                .collect();
            let parts = if interpolation == Interpolation::CubicSpline { 3 } else { 1 };
            let mut entry = || {
                let [x, y, z, w] = std::array::from_fn(|_| (2.0 * random.unit() - 1.0) as f32);
                match what {
                    0 => [x, y, z, 0.0],
                    1 => [x, y, z, w],
                    _ => [1.0 + 0.5 * x, 1.0 + 0.5 * y, 1.0 + 0.5 * z, 0.0],
                }
            };
            let values: Vec<[f32; 4]> = (0..count * parts).map(|_| entry()).collect();
            let vec3s = || values.iter().map(|v| Vec3::new(v[0], v[1], v[2])).collect();
            let track = |values| Track { times: times.clone(), values, width: 1, interpolation };
            let property = match what {
                0 => Property::Translation(track(vec3s())),
                1 => Property::Rotation(Track {
                    times: times.clone(),
                    values: values.iter().map(|v| Quat::from_array(*v)).collect(),
                    width: 1,
                    interpolation,
                }),
                _ => Property::Scale(track(vec3s())),
            };
            b.drive(node, property);
            Curve { interpolation, values: values.iter().map(|v| DVec4::from_array(v.map(f64::from))).collect(), times }
        });
        curves.push(made);
        parent = Some(node);
    }
    let last = parent.unwrap();
    b.mesh(last, &[Vec3::new(1.0, 0.0, 0.0), Vec3::new(-0.5, 0.8, 0.1), Vec3::new(-0.4, -0.7, 0.3)]);
    (b, curves)
}

#[test]
fn chains_of_nodes_are_products_of_their_curves_and_bakes_keep_their_bound() {
    // Coordinates stay below 10 m and 2 m off: as in tests/motion.rs.
    const ROUNDING: f64 = 0.004;
    fuzz("chains", 2000, |iteration, random| {
        let (b, curves) = chain(random);
        let scene = b.finish();
        let rig = Rig::new(&scene, &Playback::default()).unwrap();
        let node = scene.nodes.len() - 1;
        for _ in 0..16 {
            let t = 1.6 * random.unit() - 0.1;
            let truth = curves.iter().try_fold(DAffine3::IDENTITY, |all, [place, turn, scale]| {
                let matrix3 = DMat3::from_quat(turn.turn(t)?) * DMat3::from_diagonal(scale.at(t).0.truncate());
                Some(all * DAffine3 { matrix3, translation: place.at(t).0.truncate() })
            });
            if let Some(truth) = truth {
                let off = rig
                    .world(node, (t, t), t)
                    .to_cols_array()
                    .iter()
                    .zip(truth.to_cols_array())
                    .fold(0.0_f64, |a, (x, y)| a.max((x - y).abs()));
                assert!(off < 1e-7, "off by {off}; iteration {iteration} at {t}: {curves:?}");
            }
        }
        let open = 1.4 * random.unit();
        let interval = exposure(open, open + random.pick(&[0.0, 0.02, 0.3, 1.0]));
        let bound = request(0.25).motion_error;
        let (worst, _) = worst_error(&rig, &stage(&scene, interval, bound), 300);
        assert!(worst <= bound + ROUNDING, "{worst} pixels; iteration {iteration}, {interval:?}: {curves:?}");
    });
}
