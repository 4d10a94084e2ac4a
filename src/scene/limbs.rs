//! The part of the node tree that one object's motion hangs on, evaluated together.
//!
//! A rigid object hangs on its chain of moving ancestors, a skinned one on the chains of all its joints. Joints share
//! most of their chains, so every node is evaluated once a key, parents first, and named by its slot.

use super::curve::Jet;
use super::rig::{Driven, PlaceJet, Rig};
use super::schedule::{Clock, KeyInstant};
use super::{LocalTransform, NodeId};
use glam::{DAffine3, DVec3};
use std::collections::HashMap;

/// Nodes with their clocks, parents first.
#[derive(Debug, Clone)]
pub struct Limbs<'r, 'a> {
    rig: &'r Rig<'a>,
    limbs: Vec<Limb>,
    /// Morph weights that run along, with their clock.
    weights: Option<(NodeId, Clock)>,
}

#[derive(Debug, Clone, Copy)]
enum Limb {
    /// What no animation ever moves: its place.
    Fixed(DAffine3),
    /// What may move: its node, its parent's slot (`None`: the world), its clock.
    Moving { node: NodeId, parent: Option<usize>, clock: Clock },
}

impl<'r, 'a> Limbs<'r, 'a> {
    /// The limbs of `nodes`, each on its clock, and the slot of each.
    #[must_use]
    pub fn new(rig: &'r Rig<'a>, nodes: impl IntoIterator<Item = (NodeId, Clock)>) -> (Self, Vec<usize>) {
        let mut limbs = Self { rig, limbs: Vec::new(), weights: None };
        let mut slots = HashMap::new();
        let of_nodes = nodes.into_iter().map(|(node, clock)| limbs.add(node, clock, &mut slots)).collect();
        (limbs, of_nodes)
    }

    /// The same with the morph weights of `node` running along.
    #[must_use]
    pub fn with_weights(self, node: NodeId, clock: Clock) -> Self {
        Self { weights: Some((node, clock)), ..self }
    }

    fn add(&mut self, node: NodeId, clock: Clock, slots: &mut HashMap<(NodeId, u64, u64), usize>) -> usize {
        let key = |n: NodeId| (n, clock.open.to_bits(), clock.close.to_bits());
        let (mut missing, mut parent) = (Vec::new(), None);
        let mut at = Some(node);
        while let Some(n) = at {
            if let Some(&slot) = slots.get(&key(n)) {
                parent = Some(slot);
                break;
            }
            missing.push(n);
            at = if self.rig.is_carried(n) { self.rig.scene().nodes[n].parent } else { None };
        }
        for &n in missing.iter().rev() {
            let limb = if self.rig.is_carried(n) {
                Limb::Moving { node: n, parent, clock }
            } else {
                Limb::Fixed(self.rig.rest(n))
            };
            self.limbs.push(limb);
            parent = Some(self.limbs.len() - 1);
            slots.insert(key(n), self.limbs.len() - 1);
        }
        parent.unwrap_or_default()
    }

    /// World from every slot at a key instant.
    #[must_use]
    pub fn worlds(&self, key: &KeyInstant) -> Vec<DAffine3> {
        let mut worlds: Vec<DAffine3> = Vec::with_capacity(self.limbs.len());
        for limb in &self.limbs {
            worlds.push(match *limb {
                Limb::Fixed(place) => place,
                Limb::Moving { node, parent, clock } => {
                    let (piece, t) = clock.on_file(self.rig, key.piece, key.at);
                    let local = self.rig.local(node, piece, t);
                    parent.map_or(local, |p| worlds[p] * local)
                }
            });
        }
        worlds
    }

    /// Bounds of every slot's path over the stretch (`from`, `to`) of the exposure, which contains no break; per unit
    /// of u.
    #[must_use]
    pub fn jets(&self, from: f64, to: f64) -> Vec<PlaceJet> {
        let mut jets: Vec<PlaceJet> = Vec::with_capacity(self.limbs.len());
        for limb in &self.limbs {
            jets.push(match *limb {
                Limb::Fixed(place) => PlaceJet::constant(&place),
                Limb::Moving { node, parent, clock } => {
                    let (piece, _) = clock.on_file(self.rig, (from, to), from);
                    let local = self.rig.local_jet(node, piece).rescaled(clock.duration());
                    parent.map_or(local, |p| jets[p].after(local))
                }
            });
        }
        jets
    }

    /// Bounds of the weight of morph target `target` over a stretch, per unit of u; `rest` where nothing drives it.
    #[must_use]
    pub fn weight_jet(&self, target: usize, rest: f64, (from, to): (f64, f64)) -> Jet {
        match self.weights.and_then(|(node, clock)| Some((self.rig.weights(node)?, clock))) {
            Some((track, clock)) if target < track.width => {
                let (piece, _) = clock.on_file(self.rig, (from, to), from);
                track.jet(target, piece, f64::abs).rescaled(clock.duration())
            }
            _ => Jet::constant(rest.abs()),
        }
    }

    /// The weight of morph target `target` at a key instant; `rest` where nothing drives it.
    #[must_use]
    pub fn weight(&self, target: usize, rest: f64, key: &KeyInstant) -> f64 {
        match self.weights.and_then(|(node, clock)| Some((self.rig.weights(node)?, clock))) {
            Some((track, clock)) if target < track.width => {
                let (piece, t) = clock.on_file(self.rig, key.piece, key.at);
                track.value(target, piece, t)
            }
            _ => rest,
        }
    }

    /// The most that `slot` stretches a vector in this exposure.
    #[must_use]
    pub fn stretch(&self, slot: usize) -> f64 {
        let (mut from, mut most) = (0.0, 0.0_f64);
        for (to, _) in self.breaks().into_iter().chain([(1.0, false)]) {
            most = most.max(self.jets(from, to)[slot].linear.value);
            from = to;
        }
        most
    }

    /// Whether nothing changes in this exposure, by the keys alone.
    #[must_use]
    pub fn is_still(&self) -> bool {
        self.limbs.iter().all(|limb| match *limb {
            Limb::Fixed(_) => true,
            Limb::Moving { node, clock, .. } => self.rig.is_still_itself(node, clock.open, clock.close),
        }) && self.weights.is_none_or(|(node, clock)| self.rig.weights_still(node, clock.open, clock.close))
    }

    /// Where in the exposure something may bend or jump: ascending, each once, strictly between 0 and 1.
    #[must_use]
    pub fn breaks(&self) -> Vec<(f64, bool)> {
        let mut breaks = Vec::new();
        let mut times = Vec::new();
        let mut seamed: Vec<Clock> = Vec::new();
        let moving = self.limbs.iter().filter_map(|l| match *l {
            Limb::Moving { node, clock, .. }
                if !matches!(self.rig.scene().nodes[node].local, LocalTransform::Matrix(_)) =>
            {
                Some((node, Driven::Place, clock))
            }
            _ => None,
        });
        for (node, drive, clock) in moving.chain(self.weights.map(|(n, c)| (n, Driven::Weights, c))) {
            if clock.stands() {
                continue;
            }
            let span = (clock.open, clock.close);
            self.rig.own_breaks(node, drive, span, &mut times);
            if !seamed.contains(&clock) {
                seamed.push(clock);
                self.rig.seams(span.0, span.1, &mut times);
            }
            breaks.extend(times.drain(..).map(|(t, jump)| (clock.u(t), jump)));
        }
        breaks.retain(|b| b.0 > 0.0 && b.0 < 1.0);
        breaks.sort_by(|x, y| x.0.total_cmp(&y.0));
        breaks.dedup_by(|later, earlier| {
            let same = later.0 <= earlier.0;
            earlier.1 |= same && later.1;
            same
        });
        breaks
    }

    /// The least distance between `eye`'s origin and any of `balls` (slot, centre and radius in its space) over the
    /// exposure, or `floor` where it is less; a lower bound, low by at most a quarter.
    ///
    /// Over a stretch of length h both centres are within h/2 · |x′| of where they are at one of its ends; a stretch
    /// is halved while that is too coarse.
    #[must_use]
    pub fn nearest(&self, eye: &Eye<'r, 'a>, balls: &[(usize, DVec3, f64)], floor: f64) -> f64 {
        let mut breaks = self.breaks();
        breaks.extend(eye.limbs.iter().flat_map(|(limbs, _)| limbs.breaks()));
        breaks.sort_by(|x, y| x.0.total_cmp(&y.0));
        breaks.push((1.0, false));
        let mut from = 0.0;
        let mut least = f64::INFINITY;
        for (to, _) in breaks {
            if to > from {
                least = least.min(self.nearest_over((from, to), eye, balls, floor, 6));
                from = to;
            }
            if least <= floor {
                return floor;
            }
        }
        least
    }

    fn nearest_over(
        &self,
        (from, to): (f64, f64),
        eye: &Eye<'r, 'a>,
        balls: &[(usize, DVec3, f64)],
        floor: f64,
        halvings: u32,
    ) -> f64 {
        let key = |at| KeyInstant { u: 0.0, at, piece: (from, to) };
        let ends = [from, to].map(|u| (self.worlds(&key(u)), eye.at(&key(u))));
        let (jets, eye_speed) = (self.jets(from, to), eye.speed(from, to));
        let (mut least, mut fine) = (f64::INFINITY, true);
        for &(slot, centre, radius) in balls {
            let jet = jets[slot];
            let speed = jet.point(Jet::constant(centre.length())).first + eye_speed;
            let stray = 0.5 * (to - from) * speed;
            let clear = ends
                .iter()
                .map(|(worlds, eye)| worlds[slot].transform_point3(centre).distance(*eye))
                .fold(f64::INFINITY, f64::min)
                - radius * jet.linear.value;
            if clear <= floor {
                return floor;
            }
            fine &= stray <= 0.25 * clear;
            least = least.min((clear - stray).max(floor));
        }
        if fine || halvings == 0 {
            return least;
        }
        let middle = 0.5 * (from + to);
        let half = |piece| self.nearest_over(piece, eye, balls, floor, halvings - 1);
        half((from, middle)).min(half((middle, to)))
    }
}

/// Where the camera is over the exposure.
#[derive(Debug, Clone)]
pub struct Eye<'r, 'a> {
    /// Its limbs and its slot; `None`: it stands at `place`.
    pub limbs: Option<(Limbs<'r, 'a>, usize)>,
    /// Where it stands.
    pub place: DVec3,
}

impl Eye<'_, '_> {
    fn at(&self, key: &KeyInstant) -> DVec3 {
        self.limbs.as_ref().map_or(self.place, |(limbs, slot)| limbs.worlds(key)[*slot].translation)
    }

    fn speed(&self, from: f64, to: f64) -> f64 {
        self.limbs.as_ref().map_or(0.0, |(limbs, slot)| limbs.jets(from, to)[*slot].offset.first)
    }
}
