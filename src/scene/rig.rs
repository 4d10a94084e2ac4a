//! The node tree in motion: which curves drive which node, and where a node is at a given time.

use super::animation::{Property, Track};
use super::curve::Jet;
use super::{LocalTransform, NodeId, Scene};
use crate::{Error, Result};
use glam::{DAffine3, DMat3, Quat, Vec3};

/// Which animations play, and how they go on.
#[derive(Debug, Clone, Default)]
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

/// A smooth stretch of an object's own time: no curve that moves it has a key inside.
pub type Piece = (f64, f64);

/// A scene with the animations that play on it.
#[derive(Debug)]
pub struct Rig<'a> {
    scene: &'a Scene,
    drives: Vec<Drives<'a>>,
    /// Whether the node or an ancestor is driven in translation, rotation or scale.
    carried: Vec<bool>,
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
        let mut carried = vec![false; scene.nodes.len()];
        let mut blur = vec![1.0; scene.nodes.len()];
        for &node in &scene.order {
            let parent = scene.nodes[node].parent;
            let own =
                drives[node].translation.is_some() || drives[node].rotation.is_some() || drives[node].scale.is_some();
            carried[node] = own || parent.is_some_and(|p| carried[p]);
            blur[node] = scene.nodes[node].blur_scale.map_or_else(|| parent.map_or(1.0, |p| blur[p]), f64::from);
        }
        Ok(Self { scene, drives, carried, blur, span, looped: playback.looped })
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

    /// Sets a node's motion-blur amount and that of its descendants that have none of their own.
    pub fn set_blur(&mut self, node: NodeId, amount: f64) {
        let mut touched = vec![false; self.blur.len()];
        touched[node] = true;
        self.blur[node] = amount;
        for &n in &self.scene.order {
            if n != node
                && self.scene.nodes[n].blur_scale.is_none()
                && self.scene.nodes[n].parent.is_some_and(|p| touched[p])
            {
                touched[n] = true;
                self.blur[n] = amount;
            }
        }
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

    /// The stretches of [`a`, `b`] between the key times of everything that moves `node` (its morph weights included
    /// where `with_weights`), as (start, end, whether the object may jump at the start).
    ///
    /// In a looped playback the seam is a jump. Times are those of the unlooped clock: pass them through
    /// [`Rig::local_piece`].
    #[must_use]
    pub fn pieces(&self, nodes: &[NodeId], weights_of: Option<NodeId>, a: f64, b: f64) -> Vec<(f64, f64, bool)> {
        let mut breaks: Vec<(f64, bool)> = Vec::new();
        for (shift, from, to) in self.laps(a, b) {
            if from > a {
                breaks.push((from, true));
            }
            for &node in nodes {
                for n in self.chain(node) {
                    let d = &self.drives[n];
                    collect(&mut breaks, d.translation, shift, from, to);
                    collect(&mut breaks, d.rotation, shift, from, to);
                    collect(&mut breaks, d.scale, shift, from, to);
                }
            }
            if let Some(n) = weights_of {
                collect(&mut breaks, self.drives[n].weights, shift, from, to);
            }
        }
        breaks.sort_by(|x, y| x.0.total_cmp(&y.0));
        breaks.dedup_by(|later, earlier| {
            let same = later.0 <= earlier.0;
            earlier.1 |= same && later.1;
            same
        });
        let mut pieces = Vec::with_capacity(breaks.len() + 1);
        let (mut start, mut jump) = (a, false);
        for (t, jumps) in breaks {
            pieces.push((start, t, jump));
            (start, jump) = (t, jumps);
        }
        pieces.push((start, b, jump));
        pieces
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

    /// A piece of the shot's clock on the file's clock.
    #[must_use]
    pub fn local_piece(&self, (a, b): Piece) -> Piece {
        match self.span {
            Some((first, last)) if self.looped && last > first => {
                let shift = ((0.5 * (a + b) - first) / (last - first)).floor() * (last - first);
                (a - shift, b - shift)
            }
            _ => (a, b),
        }
    }

    /// Whether the node is exactly still on [`a`, `b`): no curve on its chain changes there.
    #[must_use]
    pub fn is_still(&self, node: NodeId, a: f64, b: f64) -> bool {
        if !self.carried[node] || a >= b {
            return true;
        }
        let laps = self.laps(a, b);
        laps.len() == 1
            && laps.iter().all(|&(shift, from, to)| {
                let (from, to) = (from + shift, to + shift);
                self.chain(node).all(|n| {
                    let d = &self.drives[n];
                    d.translation.is_none_or(|t| t.is_constant(from, to))
                        && d.rotation.is_none_or(|t| t.is_constant(from, to))
                        && d.scale.is_none_or(|t| t.is_constant(from, to))
                })
            })
    }

    /// Whether the node's morph weights are exactly constant on [`a`, `b`).
    #[must_use]
    pub fn weights_still(&self, node: NodeId, a: f64, b: f64) -> bool {
        let laps = self.laps(a, b);
        self.drives[node].weights.is_none_or(|t| {
            a >= b || (laps.len() == 1 && laps.iter().all(|&(s, from, to)| t.is_constant(from + s, to + s)))
        })
    }

    /// World from node at time `t` of `piece` (file's clock).
    #[must_use]
    pub fn world(&self, node: NodeId, piece: Piece, t: f64) -> DAffine3 {
        let mut world = self.local(node, piece, t);
        let mut up = self.scene.nodes[node].parent;
        while let Some(n) = up {
            world = self.local(n, piece, t) * world;
            up = self.scene.nodes[n].parent;
        }
        world
    }

    fn local(&self, node: NodeId, piece: Piece, t: f64) -> DAffine3 {
        let drive = &self.drives[node];
        match self.scene.nodes[node].local {
            LocalTransform::Matrix(m) => m,
            LocalTransform::Parts { translation, rotation, scale } => {
                let s = drive.scale.map_or(scale.as_dvec3(), |d| d.value(0, piece, t));
                let r = drive.rotation.map_or_else(|| rotation.as_dquat().normalize(), |d| d.rotation(piece, t));
                let x = drive.translation.map_or(translation.as_dvec3(), |d| d.value(0, piece, t));
                DAffine3 { matrix3: DMat3::from_quat(r) * DMat3::from_diagonal(s), translation: x }
            }
        }
    }

    /// Bounds of the world path of a point of the node whose own path in node space is bounded by `point`.
    #[must_use]
    pub fn path_jet(&self, node: NodeId, piece: Piece, point: Jet) -> Jet {
        let (a, b) = piece;
        self.chain(node).fold(point, |jet, n| {
            let drive = &self.drives[n];
            match self.scene.nodes[n].local {
                LocalTransform::Matrix(m) => {
                    let norm = frobenius(m.matrix3);
                    let moved = Jet { value: jet.value * norm, first: jet.first * norm, second: jet.second * norm };
                    moved.sum(Jet::constant(m.translation.length()))
                }
                LocalTransform::Parts { translation, rotation: _, scale } => {
                    let s = drive
                        .scale
                        .map_or_else(|| Jet::constant(f64::from(scale.abs().max_element())), |d| d.jet(0, a, b));
                    let r = drive.rotation.map_or(Jet::constant(1.0), |d| d.rotation_jet(a, b));
                    let x = drive
                        .translation
                        .map_or_else(|| Jet::constant(translation.as_dvec3().length()), |d| d.jet(0, a, b));
                    jet.product(s).product(r).sum(x)
                }
            }
        })
    }
}

/// An upper bound of the spectral norm.
pub(super) fn frobenius(m: DMat3) -> f64 {
    (m.x_axis.length_squared() + m.y_axis.length_squared() + m.z_axis.length_squared()).sqrt()
}

fn collect<T: super::curve::Value>(
    breaks: &mut Vec<(f64, bool)>,
    track: Option<&Track<T>>,
    shift: f64,
    from: f64,
    to: f64,
) {
    if let Some(track) = track {
        breaks.extend(track.breaks(from + shift, to + shift).map(|t| (t - shift, track.jumps_at(t))));
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
