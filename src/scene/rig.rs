//! The node tree in motion: which curves drive which node, and where a node is at a given time.

use super::animation::{Property, Track};
use super::curve::{Jet, unit};
use super::{LocalTransform, NodeId, Scene};
use crate::{Error, Result};
use glam::{DAffine3, DMat3, DVec4, Quat, Vec3};

/// Which animations play, and how they go on.
#[derive(Debug, Clone, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
pub struct Playback {
    /// The one animation to play, by name or index; `None`: all together, the first that drives a property wins.
    pub animation: Option<String>,
    /// Whether the animation repeats from its last key on, instead of holding its end.
    pub looped: bool,
}

/// Curves of one node.
#[derive(Debug, Clone, Copy, Default)]
struct Drives<'a> {
    translation: Option<&'a Track<Vec3>>,
    rotation: Option<&'a Track<Quat>>,
    scale: Option<&'a Track<Vec3>>,
    weights: Option<&'a Track<f32>>,
    visibility: Option<&'a Track<f32>>,
}

impl Drives<'_> {
    /// Whether anything places the node.
    fn moves(&self) -> bool {
        self.translation.is_some() || self.rotation.is_some() || self.scale.is_some()
    }
}

/// What a curve may drive.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Driven {
    /// Translation, rotation and scale.
    Place,
    /// Morph weights.
    Weights,
}

/// A smooth stretch of an object's own time: no curve that moves it has a key inside.
pub type Piece = (f64, f64);

/// Bounds of the path of an affine transform: the norm of its matrix, the length of its translation.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PlaceJet {
    /// The matrix, in the spectral norm.
    pub linear: Jet,
    /// The translation.
    pub offset: Jet,
}

impl PlaceJet {
    /// Something that stands still.
    #[must_use]
    pub fn constant(place: &DAffine3) -> Self {
        Self { linear: Jet::constant(spectral_norm(place.matrix3)), offset: Jet::constant(place.translation.length()) }
    }

    /// Bounds of the product of this path with `inner`, which acts first.
    #[must_use]
    pub fn after(self, inner: Self) -> Self {
        Self { linear: self.linear.product(inner.linear), offset: self.linear.product(inner.offset).sum(self.offset) }
    }

    /// Bounds of the path of a point whose own path is bounded by `point`.
    #[must_use]
    pub fn point(self, point: Jet) -> Jet {
        self.linear.product(point).sum(self.offset)
    }

    /// The same on a clock that runs `factor` times as fast.
    #[must_use]
    pub fn rescaled(self, factor: f64) -> Self {
        Self { linear: self.linear.rescaled(factor), offset: self.offset.rescaled(factor) }
    }
}

/// A scene with the animations that play on it.
#[derive(Debug)]
pub struct Rig<'a> {
    scene: &'a Scene,
    drives: Vec<Drives<'a>>,
    /// Whether the node or an ancestor is driven in translation, rotation or scale.
    carried: Vec<bool>,
    /// World from node of what no animation ever moves.
    rest: Vec<DAffine3>,
    /// Motion-blur amounts set on the node itself, and inherited.
    own_blur: Vec<Option<f64>>,
    blur: Vec<f64>,
    span: Option<(f64, f64)>,
    looped: bool,
}

impl<'a> Rig<'a> {
    /// Attaches the chosen animations to `scene`'s nodes.
    ///
    /// # Errors
    /// If `playback` names an animation that the scene does not have.
    pub fn new(scene: &'a Scene, playback: &Playback) -> Result<Self> {
        let mut drives = vec![Drives::default(); scene.nodes.len()];
        let mut span: Option<(f64, f64)> = None;
        let mut widen = |times: &[f64]| {
            let (a, b) = (times[0], times[times.len() - 1]);
            span = Some(span.map_or((a, b), |(x, y)| (x.min(a), y.max(b))));
        };
        for animation in chosen(scene, playback)? {
            for channel in &scene.animations[animation].channels {
                let drive = &mut drives[channel.node];
                match &channel.property {
                    Property::Translation(t) => {
                        drive.translation.get_or_insert(t);
                        widen(&t.times);
                    }
                    Property::Rotation(t) => {
                        drive.rotation.get_or_insert(t);
                        widen(&t.times);
                    }
                    Property::Scale(t) => {
                        drive.scale.get_or_insert(t);
                        widen(&t.times);
                    }
                    Property::Weights(t) => {
                        drive.weights.get_or_insert(t);
                        widen(&t.times);
                    }
                    Property::Visibility(t) => {
                        drive.visibility.get_or_insert(t);
                        widen(&t.times);
                    }
                }
            }
        }
        let n = scene.nodes.len();
        let own_blur = scene.nodes.iter().map(|node| node.blur_scale.map(f64::from)).collect();
        let (carried, rest, blur) = (vec![false; n], vec![DAffine3::IDENTITY; n], vec![1.0; n]);
        let mut rig = Self { scene, drives, carried, rest, own_blur, blur, span, looped: playback.looped };
        for &node in &scene.order {
            let parent = scene.nodes[node].parent;
            rig.carried[node] = rig.drives[node].moves() || parent.is_some_and(|p| rig.carried[p]);
            if !rig.carried[node] {
                let local = rig.local(node, (0.0, 0.0), 0.0);
                rig.rest[node] = parent.map_or(local, |p| rig.rest[p] * local);
            }
        }
        rig.inherit_blur();
        Ok(rig)
    }

    /// The scene it moves.
    #[must_use]
    pub fn scene(&self) -> &'a Scene {
        self.scene
    }

    /// First and last key time of what plays, seconds; `None` where nothing is animated.
    #[must_use]
    pub fn span(&self) -> Option<(f64, f64)> {
        self.span
    }

    /// Motion-blur amount of a node, inherited.
    #[must_use]
    pub fn blur(&self, node: NodeId) -> f64 {
        self.blur[node]
    }

    /// Sets a node's motion-blur amount, and so that of its descendants that have none of their own.
    pub fn set_blur(&mut self, node: NodeId, amount: f64) {
        self.own_blur[node] = Some(amount);
        self.inherit_blur();
    }

    fn inherit_blur(&mut self) {
        for &n in &self.scene.order {
            let inherited = self.scene.nodes[n].parent.map_or(1.0, |p| self.blur[p]);
            self.blur[n] = self.own_blur[n].unwrap_or(inherited);
        }
    }

    /// The amounts by which joints move a skinned mesh held by `holder`.
    ///
    /// The mesh is what one sees, so its holder's amount rules; only an amount set on the joint itself, or above it
    /// but not above the holder, goes before.
    #[must_use]
    pub fn joint_blurs(&self, joints: &[NodeId], holder: NodeId) -> Vec<f64> {
        let above: std::collections::HashSet<NodeId> = self.chain(holder).collect();
        let own = |&j: &NodeId| self.chain(j).take_while(|n| !above.contains(n)).find_map(|n| self.own_blur[n]);
        joints.iter().map(|j| own(j).unwrap_or(self.blur[holder])).collect()
    }

    /// Whether any animation ever moves this node.
    #[must_use]
    pub fn is_carried(&self, node: NodeId) -> bool {
        self.carried[node]
    }

    /// The curve of a node's morph weights, if animated.
    #[must_use]
    pub fn weights(&self, node: NodeId) -> Option<&'a Track<f32>> {
        self.drives[node].weights
    }

    /// Whether the node and all its ancestors are visible at `time`.
    #[must_use]
    pub fn is_visible(&self, node: NodeId, time: f64) -> bool {
        let time = self.clip(time);
        self.chain(node).all(|n| match self.drives[n].visibility {
            Some(track) => track.value(0, (time, time), time) > 0.5,
            None => self.scene.nodes[n].visible,
        })
    }

    /// Appends the instants strictly inside (`a`, `b`) at which the node may appear or vanish, on the shot's clock.
    pub fn blink_breaks(&self, node: NodeId, (a, b): (f64, f64), breaks: &mut Vec<(f64, bool)>) {
        for (shift, from, to) in self.laps(a, b) {
            for n in self.chain(node) {
                collect(breaks, self.drives[n].visibility, shift, from, to);
            }
        }
        self.seams(a, b, breaks);
    }

    /// Whether the node's visibility is ever animated.
    #[must_use]
    pub fn blinks(&self, node: NodeId) -> bool {
        self.chain(node).any(|n| self.drives[n].visibility.is_some())
    }

    /// The node and its ancestors, upwards.
    fn chain(&self, node: NodeId) -> impl Iterator<Item = NodeId> + '_ {
        std::iter::successors(Some(node), |&n| self.scene.nodes[n].parent)
    }

    /// The time within the animation's span that a looped playback shows at `time`; `time` itself otherwise.
    #[must_use]
    pub fn clip(&self, time: f64) -> f64 {
        match self.span {
            Some((a, b)) if self.looped && b > a => a + (time - a).rem_euclid(b - a),
            _ => time,
        }
    }

    /// Appends the instants strictly inside (`a`, `b`) at which the node's own place (or, of `weights_of`, its morph
    /// weights) may bend or jump: (time on the shot's clock, whether it may jump).
    pub fn own_breaks(&self, node: NodeId, drive: Driven, (a, b): (f64, f64), breaks: &mut Vec<(f64, bool)>) {
        let d = &self.drives[node];
        for (shift, from, to) in self.laps(a, b) {
            match drive {
                Driven::Place => {
                    collect(breaks, d.translation, shift, from, to);
                    collect(breaks, d.rotation, shift, from, to);
                    collect(breaks, d.scale, shift, from, to);
                }
                Driven::Weights => collect(breaks, d.weights, shift, from, to),
            }
        }
    }

    /// Appends the seams of a looped playback strictly inside (`a`, `b`): everything may jump there.
    pub fn seams(&self, a: f64, b: f64, breaks: &mut Vec<(f64, bool)>) {
        breaks.extend(self.laps(a, b).iter().skip(1).map(|&(_, from, _)| (from, true)));
    }

    /// The stretches of [`a`, `b`] that one pass of a looped animation covers: (shift to the file's clock, from, to).
    fn laps(&self, a: f64, b: f64) -> Vec<(f64, f64, f64)> {
        const MOST: usize = 100_000;
        let Some((first, last)) = self.span.filter(|s| self.looped && s.1 > s.0) else {
            return vec![(0.0, a, b)];
        };
        let period = last - first;
        let mut lap = ((a - first) / period).floor();
        let mut laps = Vec::new();
        let mut from = a;
        while laps.len() < MOST {
            let end = first + (lap + 1.0) * period;
            laps.push((-lap * period, from, end.min(b)));
            if end >= b {
                break;
            }
            (from, lap) = (end, lap + 1.0);
        }
        laps
    }

    /// What to take from the shot's clock to be on the file's clock, for the instants of `piece`: a whole number of
    /// laps of a looped playback.
    #[must_use]
    pub fn shift(&self, (a, b): Piece) -> f64 {
        match self.span {
            Some((first, last)) if self.looped && last > first => {
                ((0.5 * (a + b) - first) / (last - first)).floor() * (last - first)
            }
            _ => 0.0,
        }
    }

    /// Whether the node is exactly still on [`a`, `b`): no curve on its chain changes there.
    #[must_use]
    pub fn is_still(&self, node: NodeId, a: f64, b: f64) -> bool {
        self.chain(node).take_while(|&n| self.carried[n]).all(|n| self.is_still_itself(n, a, b))
    }

    /// Whether the node is exactly still in its parent's space on [`a`, `b`).
    #[must_use]
    pub fn is_still_itself(&self, node: NodeId, a: f64, b: f64) -> bool {
        let d = &self.drives[node];
        !d.moves()
            || self.constant(d.translation, a, b) && self.constant(d.rotation, a, b) && self.constant(d.scale, a, b)
    }

    /// Whether the node's morph weights are exactly constant on [`a`, `b`).
    #[must_use]
    pub fn weights_still(&self, node: NodeId, a: f64, b: f64) -> bool {
        self.constant(self.drives[node].weights, a, b)
    }

    fn constant<T: super::curve::Value>(&self, track: Option<&Track<T>>, a: f64, b: f64) -> bool {
        let Some(track) = track else { return true };
        if a >= b {
            return true;
        }
        match self.laps(a, b)[..] {
            [(shift, from, to)] => track.is_constant(from + shift, to + shift),
            // Over a seam: only what never changes.
            _ => track.is_constant(f64::NEG_INFINITY, f64::INFINITY),
        }
    }

    /// World from node at time `t` of `piece` (file's clock).
    #[must_use]
    pub fn world(&self, node: NodeId, piece: Piece, t: f64) -> DAffine3 {
        // From the root down, so that products that are kept and products made afresh round alike.
        const SHALLOW: usize = 32;
        let (mut few, mut many) = ([0; SHALLOW], Vec::new());
        let mut depth = 0;
        let mut root = DAffine3::IDENTITY;
        for n in self.chain(node) {
            if !self.carried[n] {
                root = self.rest[n];
                break;
            }
            if depth < SHALLOW {
                few[depth] = n
            } else {
                many.push(n)
            }
            depth += 1;
        }
        let shallow = few[..depth.min(SHALLOW)].iter().rev();
        many.iter().rev().chain(shallow).fold(root, |world, &n| world * self.local(n, piece, t))
    }

    /// Parent from node at time `t` of `piece` (file's clock).
    #[must_use]
    pub fn local(&self, node: NodeId, piece: Piece, t: f64) -> DAffine3 {
        let drive = &self.drives[node];
        match self.scene.nodes[node].local {
            LocalTransform::Matrix(m) => m,
            LocalTransform::Parts { translation, rotation, scale } => {
                let s = drive.scale.map_or(scale.as_dvec3(), |d| d.value(0, piece, t));
                let r = drive.rotation.map_or_else(|| unit(DVec4::from(rotation.as_dquat())), |d| d.rotation(piece, t));
                let x = drive.translation.map_or(translation.as_dvec3(), |d| d.value(0, piece, t));
                DAffine3 { matrix3: DMat3::from_quat(r) * DMat3::from_diagonal(s), translation: x }
            }
        }
    }

    /// Bounds of the node's path in its parent's space over `piece` (file's clock, per second).
    #[must_use]
    pub fn local_jet(&self, node: NodeId, piece: Piece) -> PlaceJet {
        let drive = &self.drives[node];
        match self.scene.nodes[node].local {
            LocalTransform::Matrix(m) => PlaceJet::constant(&m),
            LocalTransform::Parts { translation, rotation: _, scale } => {
                // The norm of a diagonal matrix is its largest entry.
                let s = drive.scale.map_or_else(
                    || Jet::constant(f64::from(scale.abs().max_element())),
                    |d| d.jet(0, piece, |s| s.abs().max_element()),
                );
                let r = drive.rotation.map_or(Jet::constant(1.0), |d| d.rotation_jet(piece));
                let x = drive.translation.map_or_else(
                    || Jet::constant(translation.as_dvec3().length()),
                    |d| d.jet(0, piece, |x| x.length()),
                );
                PlaceJet { linear: r.product(s), offset: x }
            }
        }
    }

    /// World from a node that no animation ever moves.
    #[must_use]
    pub fn rest(&self, node: NodeId) -> DAffine3 {
        self.rest[node]
    }
}

/// The largest stretch of a vector by `m`, rounded up by at most 0.2 %.
///
/// λ, the largest eigenvalue of A = mᵀm, is at most the Frobenius norm of A, so λ^(2ᵏ) at most that of A^(2ᵏ), which
/// exceeds it by a factor of at most √3: after k squarings the stretch √λ is overestimated by 3^(1/2^(k+2)) at most.
#[must_use]
pub fn spectral_norm(m: DMat3) -> f64 {
    const SQUARINGS: i32 = 7;
    let frobenius =
        |m: &DMat3| (m.x_axis.length_squared() + m.y_axis.length_squared() + m.z_axis.length_squared()).sqrt();
    let scale = [m.x_axis, m.y_axis, m.z_axis].iter().map(|c| c.abs().max_element()).fold(0.0, f64::max);
    if scale <= 0.0 || !scale.is_finite() {
        return scale;
    }
    let m = m * (1.0 / scale);
    let mut a = m.transpose() * m;
    // λ = exp(log), of which each squaring halves the share.
    let (mut log, mut share) = (0.0, 1.0);
    for _ in 0..SQUARINGS {
        let norm = frobenius(&a);
        log += share * libm::log(norm);
        a *= 1.0 / norm;
        a = a * a;
        share *= 0.5;
    }
    log += share * libm::log(frobenius(&a));
    scale * libm::exp(0.5 * log) * (1.0 + 1e-12)
}

fn collect<T: super::curve::Value>(
    breaks: &mut Vec<(f64, bool)>,
    track: Option<&Track<T>>,
    shift: f64,
    from: f64,
    to: f64,
) {
    if let Some(track) = track {
        // What is flat there neither bends nor jumps, however many keys say so.
        if !track.is_constant(from + shift, to + shift) {
            breaks.extend(track.breaks(from + shift, to + shift).map(|t| (t - shift, track.jumps_at(t))));
        }
    }
}

/// Indices of the animations that play.
fn chosen(scene: &Scene, playback: &Playback) -> Result<Vec<usize>> {
    let Some(wanted) = &playback.animation else {
        return Ok((0..scene.animations.len()).collect());
    };
    let by_name = scene.animations.iter().position(|a| a.name == *wanted);
    let by_index = wanted.parse::<usize>().ok().filter(|&i| i < scene.animations.len());
    by_name.or(by_index).map(|i| vec![i]).ok_or_else(|| Error::NoSuchObject {
        path: scene.path.clone(),
        kind: "animation",
        wanted: format!("\"{wanted}\""),
        available: list_names(scene.animations.iter().map(|a| a.name.as_str())),
    })
}

/// `it has 0 "Walk" and 1 "Run"`, for messages.
#[must_use]
pub fn list_names<'n>(names: impl Iterator<Item = &'n str>) -> String {
    const MOST: usize = 12;
    let all: Vec<String> = names.enumerate().map(|(i, n)| format!("{i} \"{n}\"")).collect();
    match all.len() {
        0 => "it has none".to_owned(),
        1 => format!("it has {}", all[0]),
        n if n <= MOST => format!("it has {} and {}", all[..n - 1].join(", "), all[n - 1]),
        n => format!("it has {} and {} more", all[..MOST].join(", "), n - MOST),
    }
}
