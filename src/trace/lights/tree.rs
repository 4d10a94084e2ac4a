//! A tree over many lights: choosing one costs O(log n) and follows what each light can do at the receiving point.
//!
//! Nodes bound their lights in space, orientation and time: boxes at the exposure's opening and close whose linear
//! blend encloses every light at every instant between. The importance of a node is that of Conty and Kulla (2018,
//! "Importance Sampling of Many Lights with Adaptive Tree Splitting", §4), and so is the build: splits minimise their
//! surface area orientation heuristic over binned centres.
//!
//! A node is given importance 0 only where none of its lights can reach the point.

use crate::trace::environment::Sides;
use crate::trace::warp::{Side, split};
use glam::{Vec2, Vec3, Vec3A};
use std::f32::consts::PI;

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

/// An [`Extent`] as it is evaluated: what does not depend on the receiver is worked out once.
#[derive(Debug, Clone, Copy)]
struct Outlook {
    /// Centre of the box when the exposure opens, and by how much it moves until it closes.
    centre: Vec3A,
    travel: Vec3A,
    /// Half diagonal of the box when the exposure opens, and by how much it changes.
    half: Vec3A,
    growth: Vec3A,
    axis: Vec3A,
    sin_normals: f32,
    cos_normals: f32,
    cos_emission: f32,
    strength: f32,
    /// Squared length of `half` where nothing moves; negative where it must be worked out.
    radius2: f32,
}

impl Outlook {
    fn new(e: &Extent) -> Self {
        let centre = |t: usize| Vec3A::from(0.5 * (e.boxes[t][0] + e.boxes[t][1]));
        let half = |t: usize| Vec3A::from(0.5 * (e.boxes[t][1] - e.boxes[t][0]));
        let still = e.boxes[0] == e.boxes[1];
        Self {
            centre: centre(0),
            travel: centre(1) - centre(0),
            half: half(0),
            growth: half(1) - half(0),
            axis: Vec3A::from(e.axis),
            sin_normals: sine(e.cos_normals),
            cos_normals: e.cos_normals,
            cos_emission: e.cos_emission,
            strength: e.strength,
            radius2: if still { half(0).length_squared() } else { -1.0 },
        }
    }

    /// Centre and squared radius at `u_time`.
    #[inline]
    fn ball(&self, u_time: f32) -> (Vec3A, f32) {
        if self.radius2 >= 0.0 {
            (self.centre, self.radius2)
        } else {
            (self.centre + self.travel * u_time, (self.half + self.growth * u_time).length_squared())
        }
    }
}

#[derive(Debug, Clone, Copy)]
struct Node {
    outlook: Outlook,
    parent: u32,
    /// First of two neighbouring children, or the light's index with [`LEAF`] set.
    child: u32,
}

const LEAF: u32 = 1 << 31;

/// The tree. Node 0 is the root; siblings are neighbours.
#[derive(Debug, Default)]
pub(super) struct Tree {
    nodes: Vec<Node>,
    /// By light: its leaf.
    leaves: Vec<u32>,
    /// The strongest light's strength, which is 1 in the nodes.
    unit: f32,
}

impl Tree {
    /// Builds over `lights`; strengths are finite, those of 0 keep a leaf that is never chosen.
    pub(super) fn new(lights: &[Extent]) -> Self {
        let mut tree = Self { nodes: Vec::with_capacity(lights.len() * 2), leaves: vec![0; lights.len()], unit: 1.0 };
        if lights.is_empty() {
            return tree;
        }
        assert!(lights.len() < LEAF as usize / 2, "node indices have 31 bits");
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
        let mut order: Vec<u32> = (0..index(lights.len())).collect();
        let blank = Outlook::new(&scaled[0]);
        tree.nodes.push(Node { outlook: blank, parent: 0, child: 0 });
        // An explicit stack: a chain of nested lights must not exhaust the thread's.
        let mut pending = vec![(0_usize, 0_usize, order.len(), 0_u32)];
        while let Some((node, low, high, depth)) = pending.pop() {
            let items = &mut order[low..high];
            if let [light] = *items {
                tree.nodes[node].outlook = Outlook::new(&scaled[light as usize]);
                tree.nodes[node].child = LEAF | light;
                tree.leaves[light as usize] = index(node);
                continue;
            }
            tree.nodes[node].outlook = Outlook::new(&union_of(&scaled, items));
            let middle = low + partition(&scaled, items, depth);
            let child = tree.nodes.len();
            tree.nodes[node].child = index(child);
            let child_node = Node { outlook: blank, parent: index(node), child: 0 };
            tree.nodes.extend([child_node, child_node]);
            pending.push((child, low, middle, depth + 1));
            pending.push((child + 1, middle, high, depth + 1));
        }
        tree
    }

    /// Irradiance that the whole tree may give at `r`.
    pub(super) fn importance(&self, r: &Receiver) -> f32 {
        self.nodes.first().map_or(0.0, |n| self.unit * importance(&n.outlook, r))
    }

    /// Chooses a light: its index, the probability, and `u` rescaled so that it can place a point on the light.
    ///
    /// Levels take turns with the two coordinates, so that neither runs out of digits first.
    pub(super) fn choose(&self, r: &Receiver, u: Vec2) -> Option<(usize, f32, Vec2)> {
        let (mut node, mut chance, mut u) = (self.nodes.first()?, 1.0_f32, u);
        if importance(&node.outlook, r) <= 0.0 {
            return None;
        }
        while node.child & LEAF == 0 {
            let pair = &self.nodes[node.child as usize..node.child as usize + 2];
            let share = first_share(&pair[0].outlook, &pair[1].outlook, r)?;
            let (side, rest) = split(u.x, share);
            u = Vec2::new(u.y, rest);
            (node, chance) = match side {
                Side::First => (&pair[0], chance * share),
                Side::Second => (&pair[1], chance * (1.0 - share)),
            };
        }
        Some(((node.child & !LEAF) as usize, chance, u))
    }

    /// Probability with which [`Tree::choose`] finds `light`.
    pub(super) fn chance(&self, light: usize, r: &Receiver) -> f32 {
        if importance(&self.nodes[0].outlook, r) <= 0.0 {
            return 0.0;
        }
        let (mut node, mut chance) = (self.leaves[light], 1.0_f32);
        while node != 0 {
            let parent = self.nodes[node as usize].parent;
            let first = self.nodes[parent as usize].child;
            let pair = &self.nodes[first as usize..first as usize + 2];
            let Some(share) = first_share(&pair[0].outlook, &pair[1].outlook, r) else { return 0.0 };
            chance *= if node == first { share } else { 1.0 - share };
            node = parent;
        }
        chance
    }
}

#[allow(clippy::cast_possible_truncation, reason = "Tree::new bounds the number of lights below 2³⁰")]
const fn index(i: usize) -> u32 {
    i as u32
}

/// Share of the first of two siblings; `None` where neither can reach the receiver.
#[inline]
fn first_share(a: &Outlook, b: &Outlook, r: &Receiver) -> Option<f32> {
    let (ia, ib) = (importance(a, r), importance(b, r));
    let sum = ia + ib;
    // Both may be tiny; only their ratio matters.
    if sum > 0.0 { Some(if sum.is_finite() { ia / sum } else { 0.5 }) } else { None }
}

/// cos(max(0, a − b)) of two angles, a given by its cosine, b by sine and cosine.
#[inline]
fn cos_difference(cos_a: f32, sin_b: f32, cos_b: f32) -> f32 {
    if cos_a >= cos_b { 1.0 } else { cos_a * cos_b + sine(cos_a) * sin_b }
}

#[inline]
fn sine(cos: f32) -> f32 {
    (1.0 - cos * cos).max(0.0).sqrt()
}

/// After Conty and Kulla (2018), eq. 3: strength × cosines at both ends / distance², with means where they take
/// bounds.
///
/// Over a box of half diagonal r the squared distance averages to d² + r²/3. Their bounds on the cosines decide
/// whether anything can arrive at all; the estimate is the mean of the bound and the cosine at the centre, which does
/// not take every wide node for one that faces the point.
#[inline]
fn importance(e: &Outlook, r: &Receiver) -> f32 {
    let (centre, radius2) = e.ball(r.u_time);
    let to = centre - r.position;
    let distance2 = to.length_squared();
    let mean2 = (distance2 + radius2 * (1.0 / 3.0)).max(f32::MIN_POSITIVE);
    if distance2 <= f32::MIN_POSITIVE {
        return e.strength / mean2;
    }
    let inverse = 1.0 / distance2.sqrt();
    let cos_light = -e.axis.dot(to) * inverse;
    let facing = cos_difference(cos_light, e.sin_normals, e.cos_normals);
    let cos_receiver = r.normal.dot(to) * inverse;
    let cos_receiver = if r.sides == Sides::Both { cos_receiver.abs() } else { cos_receiver };
    // From inside the bounding sphere lights lie in every direction.
    let (leaving, arriving) = if distance2 > radius2 {
        let sin2 = radius2 * inverse * inverse;
        let (sin_bounds, cos_bounds) = (sin2.sqrt(), (1.0 - sin2).max(0.0).sqrt());
        (cos_difference(facing, sin_bounds, cos_bounds), cos_difference(cos_receiver, sin_bounds, cos_bounds))
    } else {
        (1.0, 1.0)
    };
    if leaving <= e.cos_emission || arriving <= 0.0 {
        return 0.0;
    }
    // Where emission goes beyond a right angle from the normal, the cosine is no measure of it.
    let mean = |at_centre: f32, bound: f32| 0.5 * (at_centre.max(0.0) + bound.max(0.0));
    e.strength * mean(facing, leaving) * mean(cos_receiver, arriving) / mean2
}

fn union_of(lights: &[Extent], items: &[u32]) -> Extent {
    let mut all = lights[items[0] as usize];
    for &i in &items[1..] {
        all = union(&all, &lights[i as usize]);
    }
    all
}

fn union(a: &Extent, b: &Extent) -> Extent {
    let boxes = std::array::from_fn(|t| [a.boxes[t][0].min(b.boxes[t][0]), a.boxes[t][1].max(b.boxes[t][1])]);
    let strength = a.strength + b.strength;
    let (axis, cos_normals) = cone_union(a, b);
    Extent { boxes, axis, cos_normals, cos_emission: a.cos_emission.min(b.cos_emission), strength }
}

/// The least cone that holds two, rounded outwards.
fn cone_union(a: &Extent, b: &Extent) -> (Vec3, f32) {
    let (a, b) = if a.cos_normals <= b.cos_normals { (a, b) } else { (b, a) };
    if a.cos_normals <= -1.0 {
        return (a.axis, -1.0);
    }
    let between = libm::acosf(a.axis.dot(b.axis).clamp(-1.0, 1.0));
    let (theta_a, theta_b) = (libm::acosf(a.cos_normals.min(1.0)), libm::acosf(b.cos_normals.min(1.0)));
    if between + theta_b <= theta_a {
        return (a.axis, a.cos_normals);
    }
    // acos near 1 errs by up to √(2 u) = 3.5e-4; widening by that keeps every normal inside.
    let theta = 0.5 * (theta_a + between + theta_b) + 3.5e-4;
    let side = a.axis.cross(b.axis);
    if theta >= PI || side.length_squared() <= 0.0 {
        return (a.axis, if theta >= PI || between > 1.0 { -1.0 } else { libm::cosf(theta) });
    }
    let turn = theta - theta_a;
    let (sin, cos) = crate::numeric::sin_cos(turn);
    let across = side.cross(a.axis).normalize();
    ((a.axis * cos + across * sin).normalize(), libm::cosf(theta + 3.5e-4).max(-1.0))
}

const BINS: usize = 12;

/// Reorders `items` about the best split; how many come first, at least 1 and not all.
fn partition(lights: &[Extent], items: &mut [u32], depth: u32) -> usize {
    let half = items.len() / 2;
    let centre = |i: u32| {
        let b = &lights[i as usize].boxes;
        b[0][0] + b[0][1] + b[1][0] + b[1][1]
    };
    let (mut low, mut high) = (Vec3::INFINITY, Vec3::NEG_INFINITY);
    for &i in items.iter() {
        (low, high) = (low.min(centre(i)), high.max(centre(i)));
    }
    let size = high - low;
    // Very deep trees come from strengths that grow geometrically; halving bounds the depth by that plus log₂ n.
    const DEEPEST: u32 = 40;
    if size.max_element() <= 0.0 || !size.max_element().is_finite() || depth > DEEPEST {
        let axis = size.max_position();
        items.select_nth_unstable_by(half, |&a, &b| centre(a)[axis].total_cmp(&centre(b)[axis]).then(a.cmp(&b)));
        return half;
    }
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a bin index")]
    let bin = |i: u32, axis: usize| (((centre(i)[axis] - low[axis]) / size[axis] * BINS as f32) as usize).min(BINS - 1);
    let mut best: Option<(f32, usize, usize)> = None;
    // All three axes where it is cheap; the longest alone for the few large nodes at the top.
    let longest = size.max_position();
    for axis in 0..3 {
        if size[axis] <= 0.0 || (items.len() > 4096 && axis != longest) {
            continue;
        }
        let mut bins: [Option<Extent>; BINS] = [None; BINS];
        for &i in items.iter() {
            let slot = &mut bins[bin(i, axis)];
            let light = &lights[i as usize];
            *slot = Some(slot.map_or(*light, |e| union(&e, light)));
        }
        let stretch = size.max_element() / size[axis];
        for (cut, cost) in cut_costs(&bins) {
            let cost = cost * stretch;
            if best.is_none_or(|(least, ..)| cost < least) {
                best = Some((cost, axis, cut));
            }
        }
    }
    if let Some((_, axis, cut)) = best {
        let mut first = 0;
        for i in 0..items.len() {
            if bin(items[i], axis) < cut {
                items.swap(first, i);
                first += 1;
            }
        }
        if first > 0 && first < items.len() {
            return first;
        }
    }
    items.select_nth_unstable_by(half, |&a, &b| centre(a)[longest].total_cmp(&centre(b)[longest]).then(a.cmp(&b)));
    half
}

/// The orientation heuristic's cost of cutting before each bin that leaves something on both sides.
fn cut_costs(bins: &[Option<Extent>; BINS]) -> impl Iterator<Item = (usize, f32)> {
    let join = |a: Option<Extent>, b: Option<Extent>| match (a, b) {
        (Some(a), Some(b)) => Some(union(&a, &b)),
        (a, b) => a.or(b),
    };
    let mut costs = [None; BINS];
    let mut left = None;
    for cut in 1..BINS {
        left = join(left, bins[cut - 1]);
        costs[cut] = left.as_ref().map(cost);
    }
    let mut right = None;
    for cut in (1..BINS).rev() {
        right = join(bins[cut], right);
        costs[cut] = costs[cut].zip(right.as_ref().map(cost)).map(|(a, b)| a + b);
    }
    costs.into_iter().enumerate().filter_map(|(cut, c)| c.map(|c| (cut, c)))
}

/// Conty and Kulla (2018), eq. 1: strength × surface area × measure of the emission's directions.
fn cost(e: &Extent) -> f32 {
    let area = |b: &[Vec3; 2]| {
        let s = b[1] - b[0];
        2.0 * (s.x * s.y + s.y * s.z + s.z * s.x)
    };
    let o = libm::acosf(e.cos_normals.clamp(-1.0, 1.0));
    let w = (o + libm::acosf(e.cos_emission.clamp(-1.0, 1.0))).min(PI);
    let sin_o = libm::sinf(o);
    let measure = 2.0 * PI * (1.0 - e.cos_normals)
        + 0.5 * PI * (2.0 * w * sin_o - libm::cosf(o - 2.0 * w) - 2.0 * o * sin_o + e.cos_normals);
    e.strength * measure * 0.5 * (area(&e.boxes[0]) + area(&e.boxes[1]))
}
