//! 10 000 small emissive triangles: the light tree against choosing in proportion to power alone, at equal time.
//!
//! Both light the same points of a plane by single samples, each with its shadow ray. What decides is the mean squared
//! error of a sample relative to the squared truth, times its seconds; the ratio of that is how many times lower the
//! tree's error is at equal time. Printed: medians over rounds that take turns, least and greatest in brackets; once for
//! triangles that stand still and once for a hundred swarms of them that fly up to 2 m within the exposure.

#![allow(missing_docs, clippy::print_stdout, reason = "not a library")]
#![allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "bounded indices")]

use glam::{Affine3A, Vec2, Vec3, Vec3A};
use graeco::numeric::{mix64, unit_from_bits};
use graeco::scene::{Geometry, Instance, Material, Mesh, Motion, Projection, Scene, Stage, StageCamera};
use graeco::time::Exposure;
use graeco::trace::accel::Accel;
use graeco::trace::bsdf::Materials;
use graeco::trace::environment::{Background, Environment, Sides};
use graeco::trace::lights::{LightQuery, Lights};
use graeco::trace::texture::TextureFilter;
use graeco::trace::warp::triangle_from_square;
use graeco::trace::{Backs, Ray};
use std::time::Instant;

const TRIANGLES: u32 = 10_000;
const POINTS: u32 = 64;
const SAMPLES: u32 = 1024;
const ROUNDS: usize = 9;

/// Independent numbers in [0, 1).
struct Draws(u64);

impl Draws {
    fn unit(&mut self) -> f32 {
        self.0 += 1;
        unit_from_bits((mix64(mix64(self.0)) >> 32) as u32)
    }
    fn pair(&mut self) -> Vec2 {
        Vec2::new(self.unit(), self.unit())
    }
    fn triple(&mut self) -> Vec3 {
        Vec3::new(self.unit(), self.unit(), self.unit())
    }
}

/// Swarms into which the triangles are divided, each an instance.
const SWARMS: u32 = 100;

/// Small triangles in a slab 20 m wide over the plane y = 0; each swarm moves by up to `flight` metres along each axis.
fn scene(flight: f32) -> (Scene, Stage) {
    let mut draws = Draws(23);
    let mut scene = Scene::default();
    scene.materials.push(Material { emissive: Vec3::ONE, double_sided: true, ..Material::default() });
    let camera = StageCamera {
        motion: Motion::still(Affine3A::IDENTITY),
        projection: Projection::Perspective { yfov: 1.0, aspect: None },
        aperture_radius: 0.0,
        focus_distance: [1.0; 2],
    };
    let interval = Exposure { open: 0.0, close: 1.0 };
    let mut stage = Stage { interval, camera, geometries: Vec::new(), instances: Vec::new(), lights: Vec::new() };
    for swarm in 0..SWARMS as usize {
        let mut positions = Vec::new();
        for _ in 0..TRIANGLES / SWARMS {
            let p = (draws.triple() - Vec3::new(0.5, 0.0, 0.5)) * Vec3::new(20.0, 2.0, 20.0) + 0.3 * Vec3::Y;
            positions.extend((0..3).map(|_| p + 0.05 * draws.triple()));
        }
        let triangles = (0..TRIANGLES / SWARMS).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
        scene.meshes.push(Mesh { material: 0, triangles, positions, ..Mesh::default() });
        stage.geometries.push(Geometry { mesh: swarm, keys: Vec::new(), times: Vec::new() });
        // Never downwards: the plane would cut swarms off.
        let way = flight * (draws.triple() - Vec3::new(0.5, 0.0, 0.5)) * Vec3::new(2.0, 1.0, 2.0);
        let motion = if flight > 0.0 {
            Motion::through(vec![0.0, 1.0], vec![Affine3A::IDENTITY, Affine3A::from_translation(way)])
        } else {
            Motion::still(Affine3A::IDENTITY)
        };
        stage.instances.push(Instance { geometry: swarm, motion, node: 0, permanent: flight <= 0.0 });
    }
    (scene, stage)
}

/// Choice in proportion to power: running sums, searched by halving; points uniform by area.
struct ByPower<'a> {
    scene: &'a Scene,
    stage: &'a Stage,
    sums: Vec<f32>,
}

impl<'a> ByPower<'a> {
    fn new(scene: &'a Scene, stage: &'a Stage) -> Self {
        let mut total = 0.0_f64;
        let mut all = Self { scene, stage, sums: Vec::new() };
        let areas: Vec<f64> = (0..TRIANGLES as usize).map(|i| f64::from(all.area(i))).collect();
        let whole: f64 = areas.iter().sum();
        all.sums.extend(areas.iter().map(|a| {
            total += a / whole;
            total as f32
        }));
        all
    }

    fn corners(&self, i: usize, u_time: f32) -> [Vec3A; 3] {
        let each = (TRIANGLES / SWARMS) as usize;
        let (mesh, matrix) = (&self.scene.meshes[i / each], self.stage.instances[i / each].motion.at(u_time));
        mesh.triangles[i % each].map(|v| matrix.transform_point3a(mesh.positions[v as usize].into()))
    }

    fn area(&self, i: usize) -> f32 {
        let [a, b, c] = self.corners(i, 0.0);
        0.5 * (b - a).cross(c - a).length()
    }

    /// Unit direction, distance and 1 / density by solid angle of a sample.
    fn sample(&self, q: &LightQuery, u: Vec2) -> (Vec3A, f32, f32) {
        let i = self.sums.partition_point(|&s| s <= u.x).min(self.sums.len() - 1);
        let below = if i > 0 { self.sums[i - 1] } else { 0.0 };
        let chance = self.sums[i] - below;
        let b = triangle_from_square(Vec2::new(((u.x - below) / chance).clamp(0.0, 0.999_999), u.y));
        let [c0, c1, c2] = self.corners(i, q.u_time);
        let to = c0 + (c1 - c0) * b.x + (c2 - c0) * b.y - q.position;
        let normal2 = (c1 - c0).cross(c2 - c0);
        let distance = to.length();
        let wi = to / distance;
        (wi, distance, 0.5 * normal2.dot(wi).abs() / (distance * distance * chance))
    }
}

/// Mean and variance of one sample's irradiance at each point, at instants drawn for it, and seconds a sample.
fn measured(queries: &[LightQuery], samples: u32, mut value: impl FnMut(&LightQuery) -> f32) -> (Vec<[f64; 2]>, f64) {
    let mut times = Draws(4 << 40);
    let started = Instant::now();
    let moments = queries
        .iter()
        .map(|q| {
            let (mut sum, mut squares) = (0.0_f64, 0.0_f64);
            for _ in 0..samples {
                let v = f64::from(value(&LightQuery { u_time: times.unit(), ..*q }));
                sum += v;
                squares += v * v;
            }
            let n = f64::from(samples);
            [sum / n, squares / n - (sum / n) * (sum / n)]
        })
        .collect();
    (moments, started.elapsed().as_secs_f64() / f64::from(samples) / queries.len() as f64)
}

fn main() {
    compare("still", 0.0);
    compare("moving", 2.0);
}

/// Measures both ways and prints their figures under `title`.
fn compare(title: &str, flight: f32) {
    let (scene, stage) = scene(flight);
    let materials = Materials::new(&scene, TextureFilter::Mip);
    let environment = Environment::new(Background::Black);
    let lights = Lights::build(&scene, &stage, &materials, &environment);
    let accel = Accel::build(&scene, &stage, None);
    let by_power = ByPower::new(&scene, &stage);
    let mut draws = Draws(1 << 40);
    let queries: Vec<LightQuery> = (0..POINTS)
        .map(|_| {
            let place = draws.pair() * 16.0 - 8.0;
            LightQuery {
                position: Vec3A::new(place.x, 0.0, place.y),
                normal: Vec3A::Y,
                sides: Sides::Above,
                u_time: 0.0,
            }
        })
        .collect();
    let seen = |q: &LightQuery, wi: Vec3A, distance: f32| {
        let ray = Ray { origin: q.position, direction: wi, t_max: distance, u_time: q.u_time, backs: Backs::Stop };
        if accel.occluded(&ray, |_| true) { 0.0 } else { wi.y.max(0.0) }
    };
    let mut tree_draws = Draws(2 << 40);
    let mut tree = |q: &LightQuery| {
        lights
            .choice(q)
            .and_then(|mut choice| lights.sample(&mut choice, tree_draws.pair()))
            .map_or(0.0, |s| s.radiance.x * seen(q, s.wi, s.distance) / s.pdf_solid_angle)
    };
    let mut power_draws = Draws(3 << 40);
    let mut power = |q: &LightQuery| {
        let (wi, distance, inverse) = by_power.sample(q, power_draws.pair());
        seen(q, wi, distance * 0.9999) * inverse
    };
    let truth = measured(&queries, 16 * SAMPLES, &mut tree).0;
    let relative = |moments: &[[f64; 2]]| {
        moments.iter().zip(&truth).map(|(m, t)| m[1] / (t[0] * t[0])).sum::<f64>() / moments.len() as f64
    };
    let mut rows: [Vec<f64>; 6] = Default::default();
    for _ in 0..ROUNDS {
        let (t, t_s) = measured(&queries, SAMPLES, &mut tree);
        let (p, p_s) = measured(&queries, SAMPLES, &mut power);
        let (t, p) = (relative(&t), relative(&p));
        for (row, v) in rows.iter_mut().zip([t, p, t_s * 1e9, p_s * 1e9, p / t, (p * p_s) / (t * t_s)]) {
            row.push(v);
        }
    }
    let names = [
        "tree: relMSE of one sample",
        "power: relMSE of one sample",
        "tree: ns a sample, shadow ray included",
        "power: ns a sample, shadow ray included",
        "power's error over the tree's at equal samples",
        "power's error over the tree's at equal time",
    ];
    for (name, mut row) in names.into_iter().zip(rows) {
        row.sort_by(f64::total_cmp);
        println!("{title}: {name}: {:.3} [{:.3}, {:.3}]", row[ROUNDS / 2], row[0], row[ROUNDS - 1]);
    }
}
