//! A tree over many lights: choosing one costs O(log n) and follows what each light can do at the receiving point.
//!
//! Nodes bound their lights in space, orientation and time: boxes at the exposure's opening and close whose linear
//! blend encloses every light at every instant between. The importance of a node is that of Conty and Kulla (2018,
//! "Importance Sampling of Many Lights with Adaptive Tree Splitting", §4), and so is the build: splits minimise their
//! surface area orientation heuristic over binned centres. Two levels of the binary tree make one of ours, so that the
//! four children of a node are weighed at once, in the four lanes of a vector.
//!
//! A node is given importance 0 only where none of its lights can reach the point.

mod build;

use crate::numeric::ONE_MINUS;
use crate::trace::environment::Sides;
use build::{cost, partition, union_of};
use glam::{Vec2, Vec3, Vec3A, Vec4};

/// What a light, or a group of them, looks like from afar.
#[derive(Debug, Clone, Copy)]
pub(super) struct Extent {
    /// Boxes at `u_time` 0 and 1: corners low, high.
    pub(super) boxes: [[Vec3; 2]; 2],
    /// Middle of all directions of emission.
    pub(super) axis: Vec3,
    /// Cosine of the greatest angle between `axis` and a light's own normal; −1 is all directions.
    pub(super) cos_normals: f32,
    /// Cosine of how far from its normal a light shines.
    pub(super) cos_emission: f32,
    /// Greatest luminous intensity of all together.
    pub(super) strength: f32,
}

/// Where light is received.
#[derive(Debug, Clone, Copy)]
pub(super) struct Receiver {
    pub(super) position: Vec3A,
    pub(super) normal: Vec3A,
    pub(super) sides: Sides,
    pub(super) u_time: f32,
}

/// Children of a node.
const LANES: usize = 4;

/// Three coordinates of each of the four children.
type Triple = [Vec4; 3];

/// The [`Extent`]s of four children as they are evaluated, lane by lane.
#[derive(Debug, Clone, Copy)]
struct Node {
    /// Centres of the boxes when the exposure opens, and half their diagonals squared.
    centre: Triple,
    radius2: Vec4,
    axis: Triple,
    sin_normals: Vec4,
    cos_normals: Vec4,
    cos_emission: Vec4,
    /// 0 for lanes without a child.
    strength: Vec4,
    /// Nodes, or lights with [`LEAF`] set.
    children: [u32; LANES],
    /// The parent's index times [`LANES`] plus the lane there.
    place: u32,
    /// Index into [`Tree::motions`], or [`STILL`].
    motion: u32,
}

/// How the boxes of four children move.
#[derive(Debug, Clone, Copy)]
struct Sway {
    /// By how much the centres move until the exposure closes.
    travel: Triple,
    /// Half diagonals when the exposure opens, and by how much they change.
    half: Triple,
    growth: Triple,
}

const LEAF: u32 = 1 << 31;
const STILL: u32 = u32::MAX;

/// The tree as one receiving point sees it: what the root's children weigh there, for every choice.
#[derive(Debug, Clone, Copy)]
pub(super) struct Root {
    receiver: Receiver,
    weights: Vec4,
}

/// The tree. Node 0 is the root.
#[derive(Debug, Default)]
pub(super) struct Tree {
    nodes: Vec<Node>,
    motions: Vec<Sway>,
    /// By light: its node's index times [`LANES`] plus its lane.
    leaves: Vec<u32>,
    /// The strongest light's strength, which is 1 in the nodes.
    unit: f32,
}

/// A node of the binary tree that the build makes.
struct Branch {
    extent: Extent,
    /// First of two neighbouring children, or the light with [`LEAF`] set.
    child: u32,
}

/// The binary tree over `lights`, root first.
fn branches(lights: &[Extent]) -> Vec<Branch> {
    let mut order: Vec<u32> = (0..index(lights.len())).collect();
    let mut all = Vec::with_capacity(lights.len() * 2);
    all.push(Branch { extent: lights[0], child: LEAF });
    // An explicit stack: a chain of nested lights must not exhaust the thread's.
    let mut pending = vec![(0_usize, 0_usize, order.len(), 0_u32)];
    while let Some((branch, low, high, depth)) = pending.pop() {
        let items = &mut order[low..high];
        if let [light] = *items {
            all[branch] = Branch { extent: lights[light as usize], child: LEAF | light };
            continue;
        }
        let child = all.len();
        all[branch] = Branch { extent: union_of(lights, items), child: index(child) };
        let middle = low + partition(lights, items, depth);
        all.extend((0..2).map(|_| Branch { extent: lights[0], child: LEAF }));
        pending.push((child, low, middle, depth + 1));
        pending.push((child + 1, middle, high, depth + 1));
    }
    all
}

/// The up to four branches below `branch`: the costliest is opened until there are four.
fn opened(all: &[Branch], branch: usize) -> Vec<usize> {
    let child = all[branch].child;
    if child & LEAF != 0 {
        return vec![branch];
    }
    let mut lanes = vec![child as usize, child as usize + 1];
    while lanes.len() < LANES {
        let inner = (0..lanes.len()).filter(|&i| all[lanes[i]].child & LEAF == 0);
        let Some(widest) = inner.max_by(|&a, &b| cost(&all[lanes[a]].extent).total_cmp(&cost(&all[lanes[b]].extent)))
        else {
            break;
        };
        let child = all[lanes[widest]].child as usize;
        lanes[widest] = child;
        lanes.push(child + 1);
    }
    lanes
}

impl Tree {
    /// Builds over `lights`; strengths are finite, those of 0 keep a leaf that is never chosen.
    pub(super) fn new(lights: &[Extent]) -> Self {
        let mut tree = Self { leaves: vec![0; lights.len()], unit: 1.0, ..Self::default() };
        if lights.is_empty() {
            return tree;
        }
        assert!(lights.len() < LEAF as usize / (2 * LANES), "places have 31 bits");
        // Only ratios matter; scaled so, no sum overflows.
        let most = lights.iter().fold(0.0_f32, |m, l| m.max(l.strength)).max(f32::MIN_POSITIVE);
        tree.unit = most;
        let scaled: Vec<Extent> = lights
            .iter()
            .map(|l| Extent {
                strength: if l.strength > 0.0 { (l.strength / most).max(f32::MIN_POSITIVE) } else { 0.0 },
                ..*l
            })
            .collect();
        let all = branches(&scaled);
        // Breadth first, so that nodes near the root are neighbours.
        let mut pending = std::collections::VecDeque::from([(0_usize, 0_u32)]);
        while let Some((branch, place)) = pending.pop_front() {
            let number = tree.nodes.len();
            if number > 0 {
                let parent = &mut tree.nodes[place as usize / LANES];
                parent.children[place as usize % LANES] = index(number);
            }
            let lanes = opened(&all, branch);
            let extents: Vec<&Extent> = lanes.iter().map(|&b| &all[b].extent).collect();
            let mut node = tree.node(&extents, place);
            for (lane, &b) in lanes.iter().enumerate() {
                let at = index(number * LANES + lane);
                if all[b].child & LEAF == 0 {
                    pending.push_back((b, at));
                } else {
                    node.children[lane] = all[b].child;
                    tree.leaves[(all[b].child & !LEAF) as usize] = at;
                }
            }
            tree.nodes.push(node);
        }
        tree
    }

    /// The node of `extents`, whose motions it stores.
    fn node(&mut self, extents: &[&Extent], place: u32) -> Node {
        let lanes = |value: &dyn Fn(&Extent) -> f32| {
            Vec4::from_array(std::array::from_fn(|i| extents.get(i).map_or(0.0, |e| value(e))))
        };
        let triple =
            |value: &dyn Fn(&Extent) -> Vec3| -> Triple { std::array::from_fn(|axis| lanes(&|e| value(e)[axis])) };
        let centre = |e: &Extent, t: usize| 0.5 * (e.boxes[t][0] + e.boxes[t][1]);
        let half = |e: &Extent, t: usize| 0.5 * (e.boxes[t][1] - e.boxes[t][0]);
        let still = extents.iter().all(|e| e.boxes[0] == e.boxes[1]);
        if !still {
            self.motions.push(Sway {
                travel: triple(&|e| centre(e, 1) - centre(e, 0)),
                half: triple(&|e| half(e, 0)),
                growth: triple(&|e| half(e, 1) - half(e, 0)),
            });
        }
        Node {
            centre: triple(&|e| centre(e, 0)),
            radius2: lanes(&|e| half(e, 0).length_squared()),
            axis: triple(&|e| e.axis),
            sin_normals: lanes(&|e| (1.0 - e.cos_normals * e.cos_normals).max(0.0).sqrt()),
            cos_normals: lanes(&|e| e.cos_normals),
            cos_emission: lanes(&|e| e.cos_emission),
            strength: lanes(&|e| e.strength),
            children: [LEAF; LANES],
            place,
            motion: if still { STILL } else { index(self.motions.len() - 1) },
        }
    }

    /// The tree as `r` sees it.
    pub(super) fn root(&self, r: Receiver) -> Root {
        Root { receiver: r, weights: self.nodes.first().map_or(Vec4::ZERO, |n| self.weights(n, &r)) }
    }

    /// Irradiance that the whole tree may give.
    pub(super) fn importance(&self, root: &Root) -> f32 {
        self.unit * sum(root.weights)
    }

    /// Chooses a light: its index, the probability, and `u` rescaled so that it can place a point on the light.
    ///
    /// Levels take turns with the two coordinates, so that neither runs out of digits first.
    pub(super) fn choose(&self, root: &Root, u: Vec2) -> Option<(usize, f32, Vec2)> {
        let (mut node, mut weights) = (self.nodes.first()?, root.weights);
        let (mut chance, mut u) = (1.0_f32, u);
        loop {
            let total = sum(weights);
            if total <= 0.0 {
                return None;
            }
            let (lane, weight, rest) = picked(weights.to_array(), u.x * total);
            chance *= weight / total;
            u = Vec2::new(u.y, rest);
            let child = node.children[lane];
            if child & LEAF != 0 {
                return Some(((child & !LEAF) as usize, chance, u));
            }
            node = &self.nodes[child as usize];
            weights = self.weights(node, &root.receiver);
        }
    }

    /// Probability with which [`Tree::choose`] finds `light`.
    pub(super) fn chance(&self, light: usize, r: &Receiver) -> f32 {
        let (mut place, mut chance) = (self.leaves[light] as usize, 1.0_f32);
        loop {
            let node = &self.nodes[place / LANES];
            let weights = self.weights(node, r);
            let total = sum(weights);
            if total <= 0.0 {
                return 0.0;
            }
            chance *= weights.to_array()[place % LANES] / total;
            if place < LANES {
                return chance;
            }
            place = node.place as usize;
        }
    }

    /// Importance of a node's four children.
    ///
    /// After Conty and Kulla (2018), eq. 3: strength × cosines at both ends / distance², with means where they take
    /// bounds. Over a box of half diagonal r the squared distance averages to d² + r²/3. Their bounds on the cosines
    /// decide whether anything can arrive at all; the estimate is the mean of the bound and the cosine at the centre,
    /// which does not take every wide node for one that faces the point.
    #[inline]
    fn weights(&self, node: &Node, r: &Receiver) -> Vec4 {
        let (mut centre, mut radius2) = (node.centre, node.radius2);
        if node.motion != STILL {
            let sway = &self.motions[node.motion as usize];
            let at = |from: &Triple, by: &Triple, axis: usize| from[axis] + by[axis] * r.u_time;
            centre = std::array::from_fn(|axis| at(&centre, &sway.travel, axis));
            let half: Triple = std::array::from_fn(|axis| at(&sway.half, &sway.growth, axis));
            radius2 = dot(&half, &half);
        }
        let to: Triple = std::array::from_fn(|axis| centre[axis] - Vec4::splat(r.position[axis]));
        let distance2 = dot(&to, &to);
        let least = Vec4::splat(f32::MIN_POSITIVE);
        let mean2 = (distance2 + radius2 * (1.0 / 3.0)).max(least);
        let inverse = Vec4::ONE / distance2.max(least).sqrt();
        let facing = cos_difference(-dot(&node.axis, &to) * inverse, node.sin_normals, node.cos_normals);
        let normal: Triple = std::array::from_fn(|axis| Vec4::splat(r.normal[axis]));
        let cos_receiver = dot(&normal, &to) * inverse;
        let cos_receiver = if r.sides == Sides::Both { cos_receiver.abs() } else { cos_receiver };
        // From inside the bounding sphere lights lie in every direction.
        let outside = distance2.cmpgt(radius2);
        let sin2 = Vec4::select(outside, radius2 * inverse * inverse, Vec4::ZERO);
        let (sin_bounds, cos_bounds) = (sin2.sqrt(), (Vec4::ONE - sin2).max(Vec4::ZERO).sqrt());
        let bound = |cos: Vec4| Vec4::select(outside, cos_difference(cos, sin_bounds, cos_bounds), Vec4::ONE);
        let (leaving, arriving) = (bound(facing), bound(cos_receiver));
        // Where emission goes beyond a right angle from the normal, the cosine is no measure of it.
        let mean = |at_centre: Vec4, bound: Vec4| 0.5 * (at_centre.max(Vec4::ZERO) + bound.max(Vec4::ZERO));
        let weight = node.strength * mean(facing, leaving) * mean(cos_receiver, arriving) / mean2;
        let reaches = leaving.cmpgt(node.cos_emission) & arriving.cmpgt(Vec4::ZERO);
        let weight = Vec4::select(reaches, weight, Vec4::ZERO);
        let weight = Vec4::select(distance2.cmple(least), node.strength / mean2, weight);
        // Four of them must have a finite sum.
        weight.min(Vec4::splat(MOST_WEIGHT))
    }
}

const MOST_WEIGHT: f32 = 1e37;

#[allow(clippy::cast_possible_truncation, reason = "Tree::new bounds the number of lights below 2²⁸")]
const fn index(i: usize) -> u32 {
    i as u32
}

/// The lane that `target`, from 0 to the sum of `weights`, falls on, its weight, and where in it, [0, 1).
#[inline]
fn picked(weights: [f32; LANES], target: f32) -> (usize, f32, f32) {
    let mut below = 0.0;
    let mut last = (0, weights[0], ONE_MINUS);
    for (lane, &weight) in weights.iter().enumerate() {
        if weight <= 0.0 {
            continue;
        }
        if target < below + weight {
            return (lane, weight, ((target - below) / weight).clamp(0.0, ONE_MINUS));
        }
        below += weight;
        last = (lane, weight, ONE_MINUS);
    }
    // The running sum may round to just below the target.
    last
}

/// The sum of the lanes, in one order on every machine.
#[inline]
fn sum(lanes: Vec4) -> f32 {
    let [a, b, c, d] = lanes.to_array();
    (a + b) + (c + d)
}

#[inline]
fn dot(a: &Triple, b: &Triple) -> Vec4 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// cos(max(0, a − b)) of two angles, a given by its cosine, b by sine and cosine.
#[inline]
fn cos_difference(cos_a: Vec4, sin_b: Vec4, cos_b: Vec4) -> Vec4 {
    let sin_a = (Vec4::ONE - cos_a * cos_a).max(Vec4::ZERO).sqrt();
    Vec4::select(cos_a.cmpge(cos_b), Vec4::ONE, cos_a * cos_b + sin_a * sin_b)
}
