//! From curves to linear segments: a [`Rig`] and an exposure become a [`Stage`].
//!
//! A motion is cut at every key time of everything that moves the object (so that each piece is smooth, and jumps stay
//! jumps), and each piece into linear segments. Linear interpolation of a curve x over a step h is off by at most
//! h²/8 · max |x″|; the steps are the fewest equal ones for which that is below the asked part of a pixel, with |x″|
//! bounded by [`Rig::local_jet`] along the chain of parents, and the pixel taken at the nearest that the object comes
//! to the camera.
//!
//! What errs together shares the bound: camera and object half each where the camera moves, and of the object's part
//! shape and place half each where both change (true M·v against baked M̃·ṽ: |Mv − M̃ṽ| ≤ |(M − M̃)v| + ‖M̃‖ |v − ṽ|).
//! Reflections and shadows may magnify what the camera sees directly; the bound does not speak of them. Nor does it of
//! what is nearer than [`MotionError::nearest`], or than a twentieth of the radius of the object's bounding ball.

use super::deform::{Deformer, Reach, deforms};
use super::limbs::{Eye, Limbs};
use super::rig::{PlaceJet, Rig};
use super::schedule::{Clock, KeyInstant, key_instants};
use super::stage::{Geometry, Instance, StageCamera, StageLight, VertexKey};
use super::{LightShape, MeshId, Motion, NodeId, Presence, Stage};
use crate::time::Exposure;
use glam::{Affine3A, DAffine3, DVec3, Mat3A, Vec3, Vec3A};
use rayon::prelude::*;
use std::collections::HashMap;
use std::sync::OnceLock;

/// How finely motion is followed, and how the camera measures it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MotionError {
    /// Largest distance from the true curve, in pixels.
    pub pixels: f64,
    /// The least that a pixel measures at unit distance from a perspective camera (metres per metre), or at any
    /// distance from an orthographic one (metres).
    pub pixel_size: f64,
    /// Whether `pixel_size` grows with distance.
    pub perspective: bool,
    /// Distance from the camera, metres, below which nothing is held to the bound.
    pub nearest: f64,
    /// Distance from the camera, metres, up to which an orthographic camera's turning is held to the bound.
    pub farthest: f64,
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
    eye: Eye<'r, 'a>,
    /// Whether each node is exactly still in this exposure, and if so where it stands.
    stands: Vec<Option<DAffine3>>,
    reaches: Vec<OnceLock<Reach>>,
}

/// A path in double precision, before it is stored.
struct Path {
    times: Vec<f32>,
    keys: Vec<DAffine3>,
}

impl Path {
    /// The motion of something that stands at `place` in the space that moves.
    fn motion(&self, place: &DAffine3) -> Motion {
        Motion::through(self.times.clone(), self.keys.iter().map(|k| affine(*k * *place)).collect())
    }
}

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
        let stands = standing(rig, interval);
        let eye = match camera_node {
            Some(node) => match stands[node] {
                Some(place) => Eye { limbs: None, place: place.translation },
                None => Eye { limbs: Some(limbs_of(rig, interval, node)), place: camera },
            },
            None => Eye { limbs: None, place: camera },
        };
        let reaches = rig.scene().meshes.iter().map(|_| OnceLock::new()).collect();
        Self { rig, interval, error, eye, stands, reaches }
    }

    /// Part of a pixel that an object may stray: half where the camera strays as well.
    fn share(&self) -> f64 {
        self.error.pixels * if self.eye.limbs.is_some() { 0.5 } else { 1.0 }
    }

    /// The distance in metres that the object's part of a pixel is at the nearest that any of `balls` (slot of
    /// `limbs`, centre, radius) comes to the camera.
    fn tolerance(&self, limbs: &Limbs<'r, 'a>, balls: &[(usize, DVec3, f64)]) -> f64 {
        let pixel = self.share() * self.error.pixel_size;
        if !self.error.perspective {
            return pixel;
        }
        let radius = balls.iter().map(|b| b.2).fold(0.0, f64::max);
        let stretch = balls.first().map_or(1.0, |b| limbs.jets(0.0, 0.0)[b.0].linear.value);
        let floor = (radius * stretch * NEAREST_PART_OF_RADIUS).max(self.error.nearest);
        pixel * limbs.nearest(&self.eye, balls, floor)
    }

    /// The path of `slot` whose bending, as `bend` measures it, stays within `tolerance`.
    fn follow(limbs: &Limbs<'r, 'a>, slot: usize, tolerance: f64, bend: impl Fn(&PlaceJet) -> f64) -> Path {
        let needed = |from: f64, to: f64| steps(to - from, bend(&limbs.jets(from, to)[slot]), tolerance);
        let schedule = key_instants(&limbs.breaks(), MOST_SEGMENTS, needed);
        let keys = schedule.iter().map(|k| limbs.worlds(k)[slot]).collect();
        Path { times: times(&schedule), keys }
    }

    /// The motion of `node` as segments, right to the asked error for points within `reach` of the node.
    #[must_use]
    pub fn motion(&self, node: NodeId, reach: Reach) -> Motion {
        self.place(node, reach, 1.0)
            .map_or_else(|path| path.motion(&DAffine3::IDENTITY), |stands| Motion::still(affine(stands)))
    }

    /// Where `node` stands, or the path on which it moves to `part` of the asked error.
    fn place(&self, node: NodeId, reach: Reach, part: f64) -> Result<DAffine3, Path> {
        if let Some(place) = self.stands[node] {
            return Ok(place);
        }
        let (limbs, slot) = limbs_of(self.rig, self.interval, node);
        let tolerance = part * self.tolerance(&limbs, &[(slot, reach.centre, reach.radius)]);
        let arm = reach.from_origin.max(0.0);
        Err(Self::follow(&limbs, slot, tolerance, |jet| jet.linear.second * arm + jet.offset.second))
    }

    /// The motion of the camera itself.
    ///
    /// A perspective camera that is off by δ and turned by ε shows a point at distance d by δ/d + ε wrong, d at least
    /// [`MotionError::nearest`]; a parallel one by δ and ε times the point's distance from it.
    #[must_use]
    pub fn camera_motion(&self, node: NodeId) -> Motion {
        if let Some(place) = self.stands[node] {
            return Motion::still(affine(place));
        }
        let (limbs, slot) = limbs_of(self.rig, self.interval, node);
        let start = limbs.worlds(&KeyInstant { u: 0.0, at: 0.0, piece: (0.0, 0.0) })[slot].matrix3;
        // The axes become unit vectors; what shortens them magnifies their error.
        let shortest =
            [start.x_axis, start.y_axis, start.z_axis].iter().map(|a| a.length()).fold(f64::INFINITY, f64::min);
        let axes = 1.0 / shortest.max(f64::MIN_POSITIVE);
        let (offset, turn) = if self.error.perspective {
            (1.0 / self.error.nearest.max(f64::MIN_POSITIVE), axes)
        } else {
            (1.0, axes * self.error.farthest)
        };
        let tolerance = self.share() * self.error.pixel_size;
        let bend = |jet: &PlaceJet| jet.offset.second * offset + jet.linear.second * turn;
        Self::follow(&limbs, slot, tolerance, bend).motion(&DAffine3::IDENTITY)
    }

    /// A light's motion: its place as the camera would see it, its direction as far as it is from the camera.
    fn light_motion(&self, node: NodeId, shape: &LightShape) -> Motion {
        if let Some(place) = self.stands[node] {
            return Motion::still(affine(place));
        }
        let (limbs, slot) = limbs_of(self.rig, self.interval, node);
        let mut tolerance = self.tolerance(&limbs, &[(slot, DVec3::ZERO, 0.0)]);
        let pixel = self.share() * self.error.pixel_size;
        let (offset, arm) = match shape {
            // Its shadows turn about their casters: as far off as they are long, seen from about as far.
            LightShape::Directional { .. } => {
                tolerance = pixel;
                (0.0, if self.error.perspective { 1.0 } else { self.error.farthest })
            }
            LightShape::Point { .. } => (1.0, 0.0),
            LightShape::Spot { .. } => {
                (1.0, if self.error.perspective { tolerance / pixel } else { self.error.farthest })
            }
        };
        let bend = |jet: &PlaceJet| jet.offset.second * offset + jet.linear.second * arm;
        Self::follow(&limbs, slot, tolerance, bend).motion(&DAffine3::IDENTITY)
    }

    /// The shape of a deforming mesh over the exposure, held to the asked error.
    fn shape(&self, mesh: MeshId, node: NodeId, deformer: &Deformer<'r, 'a>) -> Geometry {
        let limbs = deformer.limbs();
        if limbs.is_still() {
            let start = KeyInstant { u: 0.0, at: 0.0, piece: (0.0, 0.0) };
            return Geometry { mesh, keys: vec![deformer.vertices(&start)], times: Vec::new() };
        }
        let reaches = deformer.reaches();
        let mut balls = deformer.balls(&reaches);
        let tolerance = if deformer.lands_in_world() {
            self.tolerance(limbs, &balls)
        } else {
            let (holder, slot) = limbs_of(self.rig, self.interval, node);
            balls.iter_mut().for_each(|b| b.0 = slot);
            let part = if self.stands[node].is_some() { 1.0 } else { 0.5 };
            part * self.tolerance(&holder, &balls) / holder.stretch(slot).max(f64::MIN_POSITIVE)
        };
        let bytes = self.rig.scene().meshes[mesh].positions.len() * size_of::<(Vec3, Vec3, glam::Vec4)>();
        let most = (MOST_VERTEX_BYTES / bytes.max(1)).clamp(4, MOST_VERTEX_KEYS);
        let needed = |from: f64, to: f64| steps(to - from, deformer.acceleration(&reaches, (from, to)), tolerance);
        let schedule = key_instants(&limbs.breaks(), most, needed);
        let keys: Vec<VertexKey> = schedule.par_iter().map(|k| deformer.vertices(k)).collect();
        Geometry { mesh, keys, times: times(&schedule) }
    }

    /// How far a mesh's vertices lie from its origin at rest.
    fn reach(&self, mesh: MeshId) -> Reach {
        *self.reaches[mesh]
            .get_or_init(|| Reach::of(self.rig.scene().meshes[mesh].positions.iter().map(|p| p.as_dvec3())))
    }

    /// When `node` is visible, by its own clock: a change within the exposure is a jump. `None`: at no time.
    #[allow(clippy::cast_possible_truncation, reason = "places in the exposure are stored as f32")]
    fn presence(&self, node: NodeId) -> Option<Presence> {
        let clock = Clock::new(self.interval, self.rig.blur(node));
        if clock.stands() || !self.rig.blinks(node) {
            return self.rig.is_visible(node, self.interval.middle()).then_some(Presence::ALWAYS);
        }
        let mut breaks = Vec::new();
        self.rig.blink_breaks(node, (clock.open, clock.close), &mut breaks);
        let mut ends: Vec<f64> = breaks.iter().map(|b| b.0).chain([clock.open, clock.close]).collect();
        ends.sort_by(f64::total_cmp);
        let mut spans: Vec<[f32; 2]> = Vec::new();
        for piece in ends.windows(2).filter(|p| self.rig.is_visible(node, 0.5 * (p[0] + p[1]))) {
            let [from, to] = [piece[0], piece[1]].map(|t| clock.u(t) as f32);
            match spans.last_mut() {
                Some(last) if last[1] >= from => last[1] = to,
                _ => spans.push([from, to]),
            }
        }
        match spans[..] {
            [] => None,
            [[from, to]] if from <= 0.0 && to >= 1.0 => Some(Presence::ALWAYS),
            _ => Some(Presence::within(spans)),
        }
    }

    /// Everything visible, placed.
    fn instances(&self) -> (Vec<Geometry>, Vec<Instance>) {
        let scene = self.rig.scene();
        // Which geometry each visible mesh shows: one for all that keep the rest pose, else one each.
        let mut shared: HashMap<MeshId, usize> = HashMap::new();
        let (mut sources, mut jobs) = (Vec::new(), Vec::new());
        for (node, holder) in scene.nodes.iter().enumerate() {
            if holder.meshes.is_empty() {
                continue;
            }
            let Some(presence) = self.presence(node) else { continue };
            for &mesh in holder.meshes.iter().filter(|&&m| !scene.meshes[m].triangles.is_empty()) {
                let bent = deforms(self.rig, mesh, node);
                let known = if bent { None } else { shared.get(&mesh).copied() };
                let geometry = known.unwrap_or_else(|| {
                    sources.push((mesh, node, bent));
                    sources.len() - 1
                });
                if !bent {
                    shared.insert(mesh, geometry);
                }
                jobs.push(((node, mesh, geometry, bent), presence.clone()));
            }
        }
        let geometries = sources
            .par_iter()
            .map(|&(mesh, node, bent)| {
                let deformer = if bent { Deformer::new(self.rig, mesh, node, self.interval) } else { None };
                deformer.map_or(Geometry { mesh, keys: Vec::new(), times: Vec::new() }, |d| self.shape(mesh, node, &d))
            })
            .collect();
        let place = |(job, presence): ((NodeId, MeshId, usize, bool), Presence)| -> Vec<Instance> {
            let present = |i: Instance| Instance { motion: i.motion.present(presence.clone()), ..i };
            self.placed(job).into_iter().map(present).collect()
        };
        let placed: Vec<Vec<Instance>> = jobs.into_par_iter().map(place).collect();
        (geometries, placed.into_iter().flatten().collect())
    }

    /// The instances of one mesh at one node: one, or as many as the node has copies.
    fn placed(&self, (node, mesh, geometry, bent): (NodeId, MeshId, usize, bool)) -> Vec<Instance> {
        let scene = self.rig.scene();
        let holder = &scene.nodes[node];
        let steady = !self.rig.blinks(node);
        let skin = if bent && scene.meshes[mesh].skin.is_some() { holder.skin } else { None };
        if let Some(skin) = skin {
            let permanent = steady
                && self.rig.weights(node).is_none()
                && scene.skins[skin].joints.iter().all(|&j| !self.rig.is_carried(j));
            return vec![Instance { geometry, motion: Motion::still(Affine3A::IDENTITY), node, permanent }];
        }
        let permanent = steady && !self.rig.is_carried(node) && !(bent && self.rig.weights(node).is_some());
        let place = |motion| Instance { geometry, motion, node, permanent };
        let single = [DAffine3::IDENTITY];
        let copies = holder.copies.as_deref().unwrap_or(&single);
        if let Some(pose) = self.stands[node] {
            return copies.iter().map(|c| place(Motion::still(affine(pose * *c)))).collect();
        }
        let mut body = self.reach(mesh);
        let mut part = 1.0;
        if bent && let Some(deformer) = Deformer::new(self.rig, mesh, node, self.interval) {
            let grown = deformer.balls(&deformer.reaches()).iter().map(|b| b.2).fold(body.radius, f64::max);
            body = Reach { from_origin: body.from_origin.max(0.0) + grown - body.radius, radius: grown, ..body };
            part = if deformer.limbs().is_still() { 1.0 } else { 0.5 };
        }
        match self.place(node, reach_of_copies(body, copies), part) {
            Ok(pose) => copies.iter().map(|c| place(Motion::still(affine(pose * *c)))).collect(),
            Err(path) => copies.iter().map(|c| place(path.motion(c))).collect(),
        }
    }

    /// The whole stage, given its camera.
    #[must_use]
    pub fn stage(&self, camera: StageCamera) -> Stage {
        let scene = self.rig.scene();
        let (geometries, instances) = self.instances();
        let lights = scene
            .nodes
            .iter()
            .enumerate()
            .filter_map(|(node, holder)| Some((node, &scene.lights[holder.light?], self.presence(node)?)))
            .map(|(node, light, presence)| StageLight {
                light: light.clone(),
                motion: self.light_motion(node, &light.shape).present(presence),
                node,
            })
            .collect();
        Stage { interval: self.interval, camera, geometries, instances, lights }
    }
}

/// How many equal segments a stretch of length `h` calls for where the second derivative is at most `bend`.
fn steps(h: f64, bend: f64, tolerance: f64) -> f64 {
    if bend > 0.0 { h * (bend / (8.0 * tolerance)).sqrt() } else { 0.0 }
}

fn times(schedule: &[KeyInstant]) -> Vec<f32> {
    schedule.iter().map(|k| k.u).collect()
}

fn limbs_of<'r, 'a>(rig: &'r Rig<'a>, interval: Exposure, node: NodeId) -> (Limbs<'r, 'a>, usize) {
    let (limbs, slots) = Limbs::new(rig, [(node, Clock::new(interval, rig.blur(node)))]);
    (limbs, slots[0])
}

/// Where every node stands that is exactly still in `interval`: in one pass, parents first.
fn standing(rig: &Rig<'_>, interval: Exposure) -> Vec<Option<DAffine3>> {
    let scene = rig.scene();
    let mut stands: Vec<Option<DAffine3>> = vec![None; scene.nodes.len()];
    let mut clocks: Vec<Option<Clock>> = vec![None; scene.nodes.len()];
    for &node in &scene.order {
        if !rig.is_carried(node) {
            stands[node] = Some(rig.rest(node));
            continue;
        }
        let clock = Clock::new(interval, rig.blur(node));
        clocks[node] = Some(clock);
        // The exposure is half open, and its opening lies inside it.
        let at = clock.open - rig.shift((clock.open, clock.open));
        let local = || rig.local(node, (at, at), at);
        let parent = scene.nodes[node].parent.filter(|&p| rig.is_carried(p));
        stands[node] = match parent {
            Some(p) if clocks[p] != clocks[node] => {
                rig.is_still(node, clock.open, clock.close).then(|| rig.world(node, (at, at), at))
            }
            Some(p) if stands[p].is_none() => None,
            _ if !rig.is_still_itself(node, clock.open, clock.close) => None,
            Some(p) => stands[p].map(|world| world * local()),
            None => Some(scene.nodes[node].parent.map_or_else(local, |p| rig.rest(p) * local())),
        };
    }
    stands
}

/// A ball and a reach that hold every copy of `body`.
fn reach_of_copies(body: Reach, copies: &[DAffine3]) -> Reach {
    if let [only] = copies
        && *only == DAffine3::IDENTITY
    {
        return body;
    }
    let centres = Reach::of(copies.iter().map(|c| c.transform_point3(body.centre)));
    let stretch = copies.iter().map(|c| super::rig::spectral_norm(c.matrix3)).fold(0.0, f64::max);
    let radius = centres.radius + stretch * body.radius;
    Reach { centre: centres.centre, radius, from_origin: centres.centre.length() + radius }
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
