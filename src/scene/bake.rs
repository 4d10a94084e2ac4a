//! From curves to linear segments: a [`Rig`] and an exposure become a [`Stage`].
//!
//! A motion is cut at every key time of everything that moves the object (so that each piece is smooth, and jumps stay
//! jumps), and each piece into n equal linear segments. Linear interpolation of a curve x over a step h is off by at
//! most h²/8 · max |x″|; n is the least number for which that is below the asked part of a pixel, with |x″| bounded
//! by [`Rig::path_jet`] and the pixel taken at the nearest that the object comes to the camera. Reflections and
//! shadows may magnify what the camera sees directly; the bound does not speak of them.

use super::curve::Jet;
use super::deform::Deformer;
use super::rig::{Rig, frobenius};
use super::stage::{Geometry, Instance, StageCamera, StageLight, VertexKey};
use super::{MeshId, Motion, NodeId, Stage};
use crate::time::{Exposure, snap};
use glam::{Affine3A, DAffine3, DVec3, Mat3A, Vec3, Vec3A};
use std::collections::HashMap;

/// How finely motion is followed.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MotionError {
    /// Largest distance from the true curve, in pixels.
    pub pixels: f64,
    /// Width of a pixel at unit distance from a perspective camera (metres per metre), or at any distance from an
    /// orthographic one (metres).
    pub pixel_size: f64,
    /// Whether `pixel_size` grows with distance.
    pub perspective: bool,
}

/// The most segments a rigid motion may have in one exposure (8 MiB of matrices).
const MOST_SEGMENTS: usize = 1 << 17;
/// The most vertex keys a deforming mesh may have in one exposure, and the most bytes they may take together.
const MOST_VERTEX_KEYS: usize = 1024;
const MOST_VERTEX_BYTES: usize = 1 << 30;
/// No object counts as nearer than this part of its own radius: an object around the camera would ask for
/// infinitely many segments.
const NEAREST_PART_OF_RADIUS: f64 = 0.05;

/// Bakes a scene for one exposure.
#[derive(Debug)]
pub struct Baker<'r, 'a> {
    rig: &'r Rig<'a>,
    interval: Exposure,
    error: MotionError,
    /// Camera positions at evenly spaced instants, and by how much it may stray between them.
    eye: (Vec<DVec3>, f64),
}

/// Instants at which distances are probed.
const PROBES: usize = 9;

impl<'r, 'a> Baker<'r, 'a> {
    /// A baker for `interval`, seen from `camera_node` (`None`: from a camera that stands at `camera`).
    #[must_use]
    pub fn new(
        rig: &'r Rig<'a>,
        interval: Exposure,
        error: MotionError,
        camera_node: Option<NodeId>,
        camera: DVec3,
    ) -> Self {
        let mut baker = Self { rig, interval, error, eye: (vec![camera; PROBES], 0.0) };
        if let Some(node) = camera_node {
            baker.eye = baker.positions(node);
        }
        baker
    }

    /// The object's own time at `u` of the exposure: the motion-blur amount scales time about mid-exposure.
    fn own_time(&self, amount: f64, u: f64) -> f64 {
        let middle = self.interval.middle();
        let time = middle + snap(amount * (self.interval.at(u) - middle));
        if amount <= 0.0 { middle } else { time }
    }

    fn own_span(&self, node: NodeId) -> (f64, f64) {
        let amount = self.rig.blur(node);
        (self.own_time(amount, 0.0), self.own_time(amount, 1.0))
    }

    /// World positions of a node's origin at the probe instants, and how far it may be from them between.
    #[allow(clippy::cast_precision_loss, reason = "small counts")]
    fn positions(&self, node: NodeId) -> (Vec<DVec3>, f64) {
        let (a, b) = self.own_span(node);
        let at = |t: f64| {
            let (p, _) = self.rig.local_piece((t, t));
            self.rig.world(node, (p, p), p).translation
        };
        let probes = (0..PROBES).map(|i| at(a + (b - a) * i as f64 / (PROBES - 1) as f64)).collect();
        let speed = self
            .rig
            .pieces(&[node], None, a, b)
            .iter()
            .map(|&(from, to, _)| self.rig.path_jet(node, self.rig.local_piece((from, to)), Jet::constant(0.0)).first)
            .fold(0.0, f64::max);
        (probes, speed * (b - a) / (2.0 * (PROBES - 1) as f64))
    }

    /// The distance in metres that `error.pixels` are at the nearest that a ball of `radius` about `node` comes to
    /// the camera.
    fn tolerance(&self, node: NodeId, radius: f64) -> f64 {
        if !self.error.perspective {
            return self.error.pixels * self.error.pixel_size;
        }
        let (centres, stray) = self.positions(node);
        let (a, _) = self.own_span(node);
        let (a, _) = self.rig.local_piece((a, a));
        let radius = radius * frobenius(self.rig.world(node, (a, a), a).matrix3);
        let near = centres.iter().zip(&self.eye.0).map(|(c, e)| c.distance(*e)).fold(f64::INFINITY, f64::min);
        let near = (near - radius - stray - self.eye.1).max(radius * NEAREST_PART_OF_RADIUS).max(1e-6);
        self.error.pixels * self.error.pixel_size * near
    }

    /// The motion of `node` as segments, right to the tolerance for points up to `radius` from its origin (node
    /// space).
    #[must_use]
    pub fn motion(&self, node: NodeId, radius: f64) -> Motion {
        let (a, b) = self.own_span(node);
        if self.rig.is_still(node, a, b) {
            return Motion::still(affine(self.pose(node)));
        }
        let tolerance = self.tolerance(node, radius);
        let point = Jet::constant(radius);
        let bend = |piece| self.rig.path_jet(node, piece, point).second;
        let schedule = self.schedule(&[node], None, (a, b), tolerance, MOST_SEGMENTS, bend);
        let keys = schedule.iter().map(|k| affine(self.rig.world(node, k.piece, k.time))).collect();
        Motion::through(schedule.iter().map(|k| k.u).collect(), keys)
    }

    /// World from node at mid-exposure.
    fn pose(&self, node: NodeId) -> DAffine3 {
        // Any instant of the exposure would do where the node is still; its opening lies inside the half-open span
        // for which that holds.
        let (t, _) = self.own_span(node);
        let (t, _) = self.rig.local_piece((t, t));
        self.rig.world(node, (t, t), t)
    }

    /// Key instants for what `nodes` (and the weights of `weights_of`) move, over own times `a` to `b`.
    #[allow(
        clippy::cast_precision_loss,
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "bounded counts"
    )]
    fn schedule(
        &self,
        nodes: &[NodeId],
        weights_of: Option<NodeId>,
        (a, b): (f64, f64),
        tolerance: f64,
        most: usize,
        acceleration: impl Fn((f64, f64)) -> f64,
    ) -> Vec<KeyInstant> {
        let pieces = self.rig.pieces(nodes, weights_of, a, b);
        let u = |t: f64| (((t - a) / (b - a)) as f32).clamp(0.0, 1.0);
        let mut keys: Vec<KeyInstant> = Vec::new();
        let last_piece = pieces.len() - 1;
        for (index, &(from, to, jump)) in pieces.iter().enumerate() {
            let piece = self.rig.local_piece((from, to));
            let steps = ((to - from) * (acceleration(piece) / (8.0 * tolerance)).sqrt()).ceil();
            let room = most.saturating_sub(keys.len() + last_piece - index).max(1);
            let steps = if steps.is_finite() { (steps as usize).clamp(1, room) } else { 1 };
            if !jump {
                keys.pop();
            }
            for i in 0..=steps {
                let f = i as f64 / steps as f64;
                let end = |x: f64, y: f64| if i == steps { y } else { x + (y - x) * f };
                keys.push(KeyInstant { u: u(end(from, to)), piece, time: end(piece.0, piece.1) });
            }
        }
        let end = keys.len() - 1;
        (keys[0].u, keys[end].u) = (0.0, 1.0);
        keys
    }

    /// The shape of a mesh at a node over the exposure.
    fn geometry(&self, mesh: MeshId, node: NodeId) -> Geometry {
        let Some(deformer) = Deformer::new(self.rig, mesh, node) else {
            return Geometry { mesh, keys: Vec::new(), times: Vec::new() };
        };
        let (a, b) = self.own_span(node);
        if deformer.is_still(a, b) {
            let (t, _) = self.rig.local_piece((a, a));
            return Geometry { mesh, keys: vec![deformer.vertices((t, t), t)], times: Vec::new() };
        }
        let anchor = deformer.joints().first().copied().filter(|_| deformer.lands_in_world()).unwrap_or(node);
        let tolerance = self.tolerance(anchor, self.reach(mesh));
        let bytes = self.rig.scene().meshes[mesh].positions.len() * size_of::<(Vec3, Vec3, glam::Vec4)>();
        let most = (MOST_VERTEX_BYTES / bytes.max(1)).clamp(2, MOST_VERTEX_KEYS);
        let schedule =
            self.schedule(deformer.joints(), Some(node), (a, b), tolerance, most, |p| deformer.acceleration(p));
        let keys: Vec<VertexKey> = schedule.iter().map(|k| deformer.vertices(k.piece, k.time)).collect();
        Geometry { mesh, keys, times: schedule.iter().map(|k| k.u).collect() }
    }

    /// Largest distance of a mesh's vertices from its origin, morph targets included.
    fn reach(&self, mesh: MeshId) -> f64 {
        let mesh = &self.rig.scene().meshes[mesh];
        let furthest = |list: &[Vec3]| list.iter().map(|p| f64::from(p.length())).fold(0.0, f64::max);
        furthest(&mesh.positions) + mesh.targets.iter().map(|t| furthest(&t.positions)).sum::<f64>()
    }

    /// Everything visible, placed.
    fn instances(&self) -> (Vec<Geometry>, Vec<Instance>) {
        let scene = self.rig.scene();
        let mut geometries: Vec<Geometry> = Vec::new();
        let mut shared: HashMap<MeshId, usize> = HashMap::new();
        let mut instances = Vec::new();
        for (node, holder) in scene.nodes.iter().enumerate() {
            if holder.meshes.is_empty() || !self.rig.is_visible(node, self.interval.middle()) {
                continue;
            }
            for &mesh in &holder.meshes {
                if scene.meshes[mesh].triangles.is_empty() {
                    continue;
                }
                let deformer = Deformer::new(self.rig, mesh, node);
                let geometry = match deformer {
                    None => *shared.entry(mesh).or_insert_with(|| {
                        geometries.push(self.geometry(mesh, node));
                        geometries.len() - 1
                    }),
                    Some(_) => {
                        geometries.push(self.geometry(mesh, node));
                        geometries.len() - 1
                    }
                };
                let in_world = deformer.is_some_and(|d| d.lands_in_world());
                let permanent = deformer.is_none_or(|d| d.is_permanent())
                    && (in_world || !self.rig.is_carried(node))
                    && !self.rig.blinks(node);
                let place = |motion| Instance { geometry, motion, node, permanent };
                if in_world {
                    instances.push(place(Motion::still(Affine3A::IDENTITY)));
                } else {
                    let reach = self.reach(mesh);
                    match &holder.copies {
                        None => instances.push(place(self.motion(node, reach))),
                        Some(copies) => instances.extend(self.copies(node, copies, reach).into_iter().map(place)),
                    }
                }
            }
        }
        (geometries, instances)
    }

    /// Motions of a node's instanced copies: the node's own segments times each copy's place.
    fn copies(&self, node: NodeId, copies: &[DAffine3], reach: f64) -> Vec<Motion> {
        let furthest =
            copies.iter().map(|c| c.translation.length() + frobenius(c.matrix3) * reach).fold(reach, f64::max);
        let (a, b) = self.own_span(node);
        if self.rig.is_still(node, a, b) {
            let pose = self.pose(node);
            return copies.iter().map(|c| Motion::still(affine(pose * *c))).collect();
        }
        let path = self.motion(node, furthest);
        copies
            .iter()
            .map(|c| {
                let place = affine(*c);
                Motion::through(path.times().to_vec(), path.keys().iter().map(|k| *k * place).collect())
            })
            .collect()
    }

    /// The whole stage, given its camera.
    #[must_use]
    pub fn stage(&self, camera: StageCamera) -> Stage {
        let scene = self.rig.scene();
        let (geometries, instances) = self.instances();
        let mut lights = Vec::new();
        for (node, holder) in scene.nodes.iter().enumerate() {
            if let Some(light) = holder.light
                && self.rig.is_visible(node, self.interval.middle())
            {
                // A light's direction matters as far as it shines: over a good part of the way to the camera.
                let reach =
                    self.positions(node).0.iter().zip(&self.eye.0).map(|(p, e)| p.distance(*e)).fold(0.0, f64::max);
                lights.push(StageLight {
                    light: scene.lights[light].clone(),
                    motion: self.motion(node, 0.5 * reach),
                    node,
                });
            }
        }
        Stage { interval: self.interval, camera, geometries, instances, lights }
    }
}

/// An instant at which a motion gets a key.
#[derive(Debug, Clone, Copy)]
struct KeyInstant {
    u: f32,
    piece: (f64, f64),
    time: f64,
}

/// The same transform in single precision.
#[must_use]
pub fn affine(m: DAffine3) -> Affine3A {
    Affine3A {
        matrix3: Mat3A::from_cols(
            m.matrix3.x_axis.as_vec3a(),
            m.matrix3.y_axis.as_vec3a(),
            m.matrix3.z_axis.as_vec3a(),
        ),
        translation: Vec3A::from(m.translation.as_vec3()),
    }
}
