//! The scenes and rays that both sides trace: procedural, the same in every run.

use glam::{Affine3A, Mat3A, Quat, Vec3, Vec3A};
use graeco::numeric::{mix64, unit_from_bits};
use graeco::scene::stage::VertexKey;
use graeco::scene::{Geometry, Instance, Material, Mesh, Motion, Projection, Scene, Stage, StageCamera};
use graeco::time::Exposure;
use graeco::trace::Ray;
use graeco::trace::accel::Accel;
use graeco::trace::ray::Backs;

/// Numbers from a counter: no state that another part could disturb.
#[derive(Debug, Clone)]
pub struct Dice(u64);

impl Dice {
    pub fn new(seed: u64) -> Self {
        Self(mix64(seed.wrapping_add(0x9e37_79b9_7f4a_7c15)))
    }

    #[allow(clippy::cast_possible_truncation, reason = "takes the upper half")]
    pub fn unit(&mut self) -> f32 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        unit_from_bits((mix64(self.0) >> 32) as u32)
    }

    pub fn between(&mut self, a: f32, b: f32) -> f32 {
        a + (b - a) * self.unit()
    }

    pub fn direction(&mut self) -> Vec3 {
        let (z, phi) = (1.0 - 2.0 * self.unit(), std::f32::consts::TAU * self.unit());
        let r = (1.0 - z * z).max(0.0).sqrt();
        Vec3::new(r * libm::cosf(phi), r * libm::sinf(phi), z)
    }
}

/// A mesh at one or two times.
#[derive(Debug, Clone, Default)]
pub struct Shape {
    pub triangles: Vec<[u32; 3]>,
    /// Positions at the begin and, if it deforms, at the end.
    pub keys: Vec<Vec<Vec3>>,
}

/// A shape placed by a path of matrices: one key is still; two are lerped; more approximate a rotation.
#[derive(Debug, Clone)]
pub struct Placed {
    pub shape: usize,
    pub keys: Vec<Affine3A>,
}

/// What one case traces.
#[derive(Debug, Clone)]
pub struct Case {
    pub name: &'static str,
    pub shapes: Vec<Shape>,
    pub placed: Vec<Placed>,
    /// The Embree side turns by quaternions from the first key to the last.
    pub turns: bool,
    pub eye: Vec3,
    pub target: Vec3,
    /// Tangent of half the angle of view, across and upright.
    pub reach: f32,
}

/// How far the procedural scenes look aside.
const REACH: f32 = 0.53;

impl Shape {
    pub fn append(&mut self, other: &Self) {
        #[allow(clippy::cast_possible_truncation, reason = "a million vertices")]
        let base = self.keys[0].len() as u32;
        self.triangles.extend(other.triangles.iter().map(|t| t.map(|i| i + base)));
        for (mine, theirs) in self.keys.iter_mut().zip(&other.keys) {
            mine.extend_from_slice(theirs);
        }
    }
}

/// A unit sphere of 20 · 4ⁿ triangles.
pub fn icosphere(subdivisions: u32) -> (Vec<Vec3>, Vec<[u32; 3]>) {
    let g = 0.5 * (1.0 + 5.0_f32.sqrt());
    let corners = [(-1.0, g, 0.0), (1.0, g, 0.0), (-1.0, -g, 0.0), (1.0, -g, 0.0)];
    let mut points: Vec<Vec3> = (0..3)
        .flat_map(|turn| {
            corners.map(|(x, y, z)| match turn {
                0 => Vec3::new(x, y, z),
                1 => Vec3::new(z, x, y),
                _ => Vec3::new(y, z, x),
            })
        })
        .map(Vec3::normalize)
        .collect();
    // Faces of the hull: triples at the least distance, wound outward.
    let near = |a: usize, b: usize| points[a].distance_squared(points[b]) < 1.2;
    let mut faces = Vec::new();
    for a in 0..12 {
        for b in a + 1..12 {
            for c in b + 1..12 {
                if near(a, b) && near(b, c) && near(c, a) {
                    let outward = (points[b] - points[a]).cross(points[c] - points[a]).dot(points[a]) > 0.0;
                    #[allow(clippy::cast_possible_truncation, reason = "twelve corners")]
                    let face = if outward { [a as u32, b as u32, c as u32] } else { [a as u32, c as u32, b as u32] };
                    faces.push(face);
                }
            }
        }
    }
    for _ in 0..subdivisions {
        let mut middles = std::collections::HashMap::new();
        let mut middle = |a: u32, b: u32, points: &mut Vec<Vec3>| {
            *middles.entry((a.min(b), a.max(b))).or_insert_with(|| {
                points.push((points[a as usize] + points[b as usize]).normalize());
                #[allow(clippy::cast_possible_truncation, reason = "a million vertices")]
                let index = points.len() as u32 - 1;
                index
            })
        };
        let mut finer = Vec::with_capacity(4 * faces.len());
        for [a, b, c] in faces {
            let (ab, bc, ca) = (middle(a, b, &mut points), middle(b, c, &mut points), middle(c, a, &mut points));
            finer.extend([[a, ab, ca], [b, bc, ab], [c, ca, bc], [ab, bc, ca]]);
        }
        faces = finer;
    }
    (points, faces)
}

/// A bumpy version of a unit sphere's point.
fn bumpy(p: Vec3, frequency: f32, amplitude: f32, phase: f32) -> Vec3 {
    let s = libm::sinf;
    let coarse = s(p.x * frequency + phase) * s(p.y * frequency * 1.3 + 2.0 * phase) * s(p.z * frequency * 0.9 - phase);
    let fine = s(p.x * frequency * 3.1 - p.y * frequency * 2.7 + phase) * libm::cosf(p.z * frequency * 2.3);
    p * (1.0 + amplitude * (coarse + 0.5 * fine))
}

fn terrain(phases: [f32; 2]) -> Shape {
    const N: u32 = 360;
    let (s, c) = (libm::sinf, libm::cosf);
    let height = |x: f32, z: f32, p: f32| {
        0.6 * s(x * 0.5 + p) * c(z * 0.43)
            + 0.25 * s(x * 1.7 - z * 1.3 + 2.0 * p)
            + 0.08 * s(x * 5.0 + z * 4.1 + p) * c(z * 6.3)
    };
    #[allow(clippy::cast_precision_loss, reason = "a grid index")]
    let at = |i: u32| -20.0 + 40.0 * i as f32 / N as f32;
    let key = |p: f32| -> Vec<Vec3> {
        (0..=N).flat_map(|i| (0..=N).map(move |j| Vec3::new(at(i), height(at(i), at(j), p), at(j)))).collect()
    };
    let index = |i: u32, j: u32| i * (N + 1) + j;
    let triangles = (0..N)
        .flat_map(|i| {
            (0..N).flat_map(move |j| {
                let (a, b, c, d) = (index(i, j), index(i + 1, j), index(i + 1, j + 1), index(i, j + 1));
                [[a, c, b], [a, d, c]]
            })
        })
        .collect();
    Shape { triangles, keys: phases.map(key).into() }
}

struct Ball {
    scale: f32,
    at: Vec3,
    goes: Vec3,
    phase: f32,
    turned: Quat,
    axis: Vec3,
    turns: f32,
}

fn balls(count: usize) -> Vec<Ball> {
    (0..count as u64)
        .map(|i| {
            let mut dice = Dice::new(i);
            let scale = dice.between(0.15, 0.5);
            Ball {
                scale,
                at: Vec3::new(dice.between(-18.0, 18.0), dice.between(0.8, 12.0), dice.between(-18.0, 18.0)),
                phase: dice.between(0.0, 6.0),
                goes: dice.direction() * scale * dice.between(0.0, 2.0),
                turned: Quat::from_axis_angle(dice.direction(), dice.between(0.0, 3.0)),
                axis: dice.direction(),
                turns: dice.between(0.0, 0.6),
            }
        })
        .collect()
}

/// The ground and the big ball: 341 120 triangles.
fn ground(keys: usize) -> Shape {
    let mut ground = terrain([0.0, 0.4]);
    let (points, faces) = icosphere(6);
    let centre = Vec3::new(0.0, 5.0, 0.0);
    let begin = points.iter().map(|&p| bumpy(p, 5.0, 0.12, 0.3) * 4.0 + centre).collect();
    let end = points.iter().map(|&p| bumpy(p, 5.0, 0.12, 0.7) * 4.1 + centre + Vec3::new(0.3, 0.2, 0.0)).collect();
    ground.append(&Shape { triangles: faces, keys: vec![begin, end] });
    ground.keys.truncate(keys);
    ground
}

const EYE: Vec3 = Vec3::new(2.0, 8.5, -24.0);
const TARGET: Vec3 = Vec3::new(0.0, 4.0, 0.0);

/// 981 120 triangles in one mesh: ground, a big ball, 2000 small ones; `keys` 2: all of it deforms.
pub fn one_mesh(name: &'static str, keys: usize) -> Case {
    let mut all = ground(keys);
    let (points, faces) = icosphere(2);
    for ball in balls(2000) {
        let end_turn = Quat::from_axis_angle(ball.axis, ball.turns) * ball.turned;
        let point = |p: Vec3| bumpy(p, 3.0, 0.2, ball.phase) * ball.scale;
        let begin = points.iter().map(|&p| ball.turned * point(p) + ball.at).collect();
        let end = points.iter().map(|&p| end_turn * point(p) + ball.at + ball.goes).collect();
        let mut keys_of_ball = vec![begin, end];
        keys_of_ball.truncate(keys);
        all.append(&Shape { triangles: faces.clone(), keys: keys_of_ball });
    }
    let placed = vec![Placed { shape: 0, keys: vec![Affine3A::IDENTITY] }];
    Case { name, shapes: vec![all], placed, turns: false, eye: EYE, target: TARGET, reach: REACH }
}

/// The ground, and 2000 instances of 8 balls of 5120 triangles: `keys` 1 still, 2 lerped, more turning.
pub fn instanced(name: &'static str, keys: usize) -> Case {
    let mut shapes = vec![ground(1)];
    let (points, faces) = icosphere(4);
    for k in 0..8_u8 {
        let key = points.iter().map(|&p| bumpy(p, 3.0, 0.2, 0.7 * f32::from(k))).collect();
        shapes.push(Shape { triangles: faces.clone(), keys: vec![key] });
    }
    let mut placed = vec![Placed { shape: 0, keys: vec![Affine3A::IDENTITY] }];
    placed.extend(balls(2000).iter().enumerate().map(|(i, ball)| {
        #[allow(clippy::cast_precision_loss, reason = "few keys")]
        let at = |k: usize| {
            let f = if keys == 1 { 0.0 } else { k as f32 / (keys - 1) as f32 };
            let turned = Quat::from_axis_angle(ball.axis, ball.turns * f) * ball.turned;
            let linear = Mat3A::from_quat(turned) * ball.scale;
            Affine3A { matrix3: linear, translation: Vec3A::from(ball.at + ball.goes * f) }
        };
        Placed { shape: 1 + i % 8, keys: (0..keys).map(at).collect() }
    }));
    Case { name, shapes, placed, turns: keys > 2, eye: EYE, target: TARGET, reach: REACH }
}

/// The hall as a building that stands askew to all axes: its large triangles reach through each other's boxes.
pub fn tilted(name: &'static str) -> Case {
    let mut case = hall(name);
    let turn = Quat::from_euler(glam::EulerRot::YXZ, 0.6, 0.5, 0.4);
    case.shapes[0].keys[0].iter_mut().for_each(|p| *p = turn * *p);
    (case.eye, case.target) = (turn * case.eye, turn * case.target);
    case
}

/// A hall of pillars seen from inside: long thin triangles, axis-aligned and turned, next to 20 detailed statues.
pub fn hall(name: &'static str) -> Case {
    let mut all = Shape { triangles: Vec::new(), keys: vec![Vec::new()] };
    let mut dice = Dice::new(77);
    let slab = |lo: Vec3, hi: Vec3, turn: f32, all: &mut Shape| {
        let q = Quat::from_rotation_y(turn);
        let (centre, half) = ((lo + hi) * 0.5, (hi - lo) * 0.5);
        let points = (0..8_u8).map(|i| {
            let sign = |bit: u8| if i >> bit & 1 == 1 { 1.0 } else { -1.0 };
            centre + q * (half * Vec3::new(sign(0), sign(1), sign(2)))
        });
        let quads = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
        let triangles = quads.iter().flat_map(|q| [[q[0], q[1], q[2]], [q[0], q[2], q[3]]]).collect();
        all.append(&Shape { triangles, keys: vec![points.collect()] });
    };
    slab(Vec3::new(-22.0, -1.0, -42.0), Vec3::new(22.0, 0.0, 42.0), 0.0, &mut all);
    slab(Vec3::new(-22.0, 14.0, -42.0), Vec3::new(22.0, 15.0, 42.0), 0.0, &mut all);
    slab(Vec3::new(-23.0, -1.0, -42.0), Vec3::new(-22.0, 15.0, 42.0), 0.0, &mut all);
    slab(Vec3::new(22.0, -1.0, -42.0), Vec3::new(23.0, 15.0, 42.0), 0.0, &mut all);
    for i in -10..=10_i8 {
        for side in [-14.0, 14.0] {
            let at = Vec3::new(side, 0.0, f32::from(i) * 4.0);
            let half = Vec3::new(0.5, 0.0, 0.5);
            slab(at - half, at + half + Vec3::Y * 14.0, dice.between(0.0, 1.5), &mut all);
            // Beams across, and fluting along the pillars.
            slab(at + Vec3::new(-8.0, 13.0, -0.2), at + Vec3::new(8.0, 13.6, 0.2), dice.between(-0.3, 0.3), &mut all);
            for _ in 0..60 {
                let p = at + Vec3::new(dice.between(-0.7, 0.7), 0.0, dice.between(-0.7, 0.7));
                slab(p, p + Vec3::new(0.05, 14.0, 0.05), dice.between(0.0, 1.5), &mut all);
            }
        }
    }
    let (points, faces) = icosphere(5);
    for i in 0..20_u8 {
        let place = Vec3::new(dice.between(-10.0, 10.0), 1.6, -36.0 + 3.8 * f32::from(i));
        let key = points.iter().map(|&p| bumpy(p, 4.0, 0.2, f32::from(i)) * 1.5 + place).collect();
        all.append(&Shape { triangles: faces.clone(), keys: vec![key] });
    }
    let placed = vec![Placed { shape: 0, keys: vec![Affine3A::IDENTITY] }];
    Case {
        name,
        shapes: vec![all],
        placed,
        turns: false,
        eye: Vec3::new(3.0, 5.0, -40.0),
        target: Vec3::new(0.0, 4.0, 0.0),
        reach: REACH,
    }
}

/// Grass: 400 000 slender blades of two triangles over the terrain.
pub fn meadow(name: &'static str) -> Case {
    let mut all = terrain([0.0, 0.0]);
    all.keys.truncate(1);
    let ground = all.keys[0].clone();
    let mut dice = Dice::new(5);
    for _ in 0..400_000 {
        #[allow(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            clippy::cast_precision_loss,
            reason = "an index"
        )]
        let foot = ground[(dice.unit() * ground.len() as f32) as usize]
            + Vec3::new(dice.between(-0.06, 0.06), 0.0, dice.between(-0.06, 0.06));
        let lean = dice.direction() * 0.15;
        let across = dice.direction().cross(Vec3::Y) * 0.01;
        let tip = foot + Vec3::Y * dice.between(0.15, 0.5) + lean;
        let points = vec![foot - across, foot + across, tip + across * 0.3, tip - across * 0.3];
        all.append(&Shape { triangles: vec![[0, 1, 2], [0, 2, 3]], keys: vec![points] });
    }
    let placed = vec![Placed { shape: 0, keys: vec![Affine3A::IDENTITY] }];
    Case {
        name,
        shapes: vec![all],
        placed,
        turns: false,
        eye: Vec3::new(2.0, 3.0, -19.0),
        target: Vec3::new(0.0, 0.0, 0.0),
        reach: REACH,
    }
}

impl Case {
    /// Our scene and stage of the case.
    pub fn stage(&self) -> (Scene, Stage) {
        let material = Material { double_sided: true, ..Material::default() };
        let mut scene = Scene { materials: vec![material], ..Scene::default() };
        let mut geometries = Vec::new();
        for (mesh, shape) in self.shapes.iter().enumerate() {
            let (triangles, positions) = (shape.triangles.clone(), shape.keys[0].clone());
            scene.meshes.push(Mesh { triangles, positions, ..Mesh::default() });
            let key = |p: &Vec<Vec3>| VertexKey { positions: p.clone(), ..VertexKey::default() };
            let deforms = shape.keys.len() > 1;
            let keys = if deforms { shape.keys.iter().map(key).collect() } else { Vec::new() };
            geometries.push(Geometry { mesh, keys, times: if deforms { vec![0.0, 1.0] } else { Vec::new() } });
        }
        let instances = self.placed.iter().enumerate().map(|(node, p)| {
            #[allow(clippy::cast_precision_loss, reason = "few keys")]
            let times = (0..p.keys.len()).map(|i| i as f32 / (p.keys.len() - 1).max(1) as f32).collect();
            let still = p.keys.len() == 1;
            let motion = if still { Motion::still(p.keys[0]) } else { Motion::through(times, p.keys.clone()) };
            let permanent = still && self.shapes[p.shape].keys.len() == 1;
            Instance { geometry: p.shape, motion, node, permanent }
        });
        let camera = StageCamera {
            motion: Motion::still(Affine3A::IDENTITY),
            projection: Projection::Perspective { yfov: 1.0, aspect: None },
            aperture_radius: 0.0,
            focus_distance: [1.0, 1.0],
        };
        let interval = Exposure { open: 0.0, close: 1.0 };
        let instances = instances.collect();
        (scene, Stage { interval, camera, geometries, instances, lights: Vec::new() })
    }

    /// A million primary rays, in tiles of 16 × 16.
    pub fn primary(&self) -> Vec<Ray> {
        let forward = (self.target - self.eye).normalize();
        let right = forward.cross(Vec3::Y).normalize();
        let (up, reach) = (right.cross(forward), self.reach);
        let mut dice = Dice::new(1);
        (0..1_u32 << 20)
            .map(|i| {
                let (tile, inner) = (i >> 8, i & 255);
                #[allow(clippy::cast_precision_loss, reason = "at most 1024")]
                let pixel = |tile: u32, inner: u32| (tile * 16 + inner) as f32;
                let x = pixel(tile % 64, inner % 16) + dice.unit();
                let y = pixel(tile / 64, inner / 16) + dice.unit();
                let (x, y) = ((x / 512.0 - 1.0) * reach, (1.0 - y / 512.0) * reach);
                let direction = Vec3A::from((forward + right * x + up * y).normalize());
                Ray {
                    origin: Vec3A::from(self.eye),
                    direction,
                    t_max: f32::INFINITY,
                    u_time: dice.unit(),
                    backs: Backs::Pass,
                }
            })
            .collect()
    }

    /// A diffuse bounce and a ray towards an area light from wherever a primary ray hits.
    pub fn secondary(&self, accel: &Accel, scene: &Scene, stage: &Stage, primary: &[Ray]) -> [Vec<Ray>; 2] {
        let mut dice = Dice::new(2);
        let (mut bounces, mut shadows) = (Vec::new(), Vec::new());
        for ray in primary {
            let Some(hit) = accel.closest(ray, |_| true) else { continue };
            let surface = accel.surface(scene, stage, ray, &hit);
            let n = surface.geometric_normal;
            let n = if n.dot(ray.direction) > 0.0 { -n } else { n };
            let direction = (n + Vec3A::from(dice.direction())).normalize_or(n);
            // Embree has no defence against meeting the same surface again. Where it turns by quaternions and we by
            // segments, the surfaces differ by up to 2e-3.
            let apart = n * if self.turns { 5e-3 } else { 1e-3 };
            let origin = surface.spawn_origin(n) + apart;
            bounces.push(Ray { origin, direction, t_max: f32::INFINITY, u_time: ray.u_time, backs: Backs::Pass });
            let light = Vec3A::new(dice.between(-8.0, -2.0), 13.0, dice.between(-10.0, -4.0));
            let way = light - origin;
            shadows.push(Ray { origin, direction: way, t_max: 0.999, u_time: ray.u_time, backs: Backs::Pass });
        }
        [bounces, shadows]
    }
}
