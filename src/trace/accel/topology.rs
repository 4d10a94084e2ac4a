//! The tree's shape: binned surface-area-heuristic splits over boxes (Wald 2007), and on the way back up what each subtree
//! becomes in the wide tree (`choice`).
//!
//! Input is a list of boxes, output a binary tree in depth-first order: a node's left child follows it, its right child
//! follows the left subtree. References are permuted so that every small subtree owns a contiguous range of them. Counts
//! and bounds do not depend on the order of reduction, so any number of threads builds the same tree.

use super::choice::{Costs, LeafRule, Shares, alone, combined};
use super::{memory, spatial};
use bytemuck::Zeroable;
use glam::{Vec3A, Vec4};

/// A box with the primitive it bounds.
///
/// `lo.w` holds the primitive's index as bits and `hi.w` its own area, so that a reference is 32 bytes.
#[derive(Debug, Clone, Copy)]
pub(super) struct Reference {
    lo: Vec4,
    hi: Vec4,
}

impl Reference {
    /// An empty place.
    pub(super) const NONE: Self = Self { lo: Vec4::INFINITY, hi: Vec4::NEG_INFINITY };

    /// Primitive `id`, of `area`, within a box.
    pub(super) fn new(lo: Vec3A, hi: Vec3A, id: u32, area: f32) -> Self {
        Self { lo: lo.extend(f32::from_bits(id)), hi: hi.extend(area) }
    }

    #[inline]
    pub(super) fn id(&self) -> u32 {
        self.lo.w.to_bits()
    }

    /// Area of the primitive, which says how likely a ray through its box meets it.
    #[inline]
    pub(super) fn area(&self) -> f32 {
        self.hi.w
    }

    #[inline]
    pub(super) fn lo(&self) -> Vec3A {
        Vec3A::from_vec4(self.lo)
    }

    #[inline]
    pub(super) fn hi(&self) -> Vec3A {
        Vec3A::from_vec4(self.hi)
    }
}

/// A node of the binary tree; zeros where there is none.
///
/// `lo.w` holds the index of the right child as bits and `hi.w` that of the first reference.
#[derive(Debug, Clone, Copy, Zeroable)]
pub(super) struct Node2 {
    lo: Vec4,
    hi: Vec4,
    /// References in the subtree.
    pub(super) count: u32,
    /// What it becomes in the wide tree.
    pub(super) shares: Shares,
}

impl Node2 {
    #[inline]
    pub(super) fn lo(&self) -> Vec3A {
        Vec3A::from_vec4(self.lo)
    }

    #[inline]
    pub(super) fn hi(&self) -> Vec3A {
        Vec3A::from_vec4(self.hi)
    }

    /// Index of the right child; 0 marks a leaf of one reference. The left child is the next node.
    #[inline]
    pub(super) fn right(&self) -> u32 {
        self.lo.w.to_bits()
    }

    /// First reference of the subtree.
    #[inline]
    pub(super) fn first(&self) -> u32 {
        self.hi.w.to_bits()
    }

    /// Half the surface of its box.
    #[inline]
    pub(super) fn half_area(&self) -> f32 {
        half_area(self.lo(), self.hi())
    }
}

/// Half the surface of a box; 0 for an empty one.
#[inline]
pub(super) fn half_area(lo: Vec3A, hi: Vec3A) -> f32 {
    let d = (hi - lo).max(Vec3A::ZERO);
    d.x * d.y + d.y * d.z + d.z * d.x
}

/// Below this depth splits follow the heuristic; deeper ones halve by count, so that a tree of n references is at most
/// `DEEPEST + ⌈log₂ n⌉` deep whatever its geometry (coordinates from 1e-30 to 1e30 would otherwise peel one by one).
const DEEPEST: u32 = 40;

/// Subtrees smaller than this are built by one thread.
const PARALLEL: usize = 4096;

/// Corners of a triangle by its index, for splits that cut triangles; `None` where only whole references are sorted.
pub(super) type Corners<'a> = Option<&'a (dyn Fn(u32) -> [Vec3A; 3] + Sync)>;

/// Builds the tree over `references`, permuting them, with leaves of the wide tree by `rule`. Empty for no references.
///
/// With `corners`, large triangles in each other's way are cut between children where that pays ([`spatial`]), and the
/// references grow by the pieces. Places of nodes and references that were kept for pieces and not needed stay empty.
pub(super) fn build(references: &mut Vec<Reference>, corners: Corners<'_>, rule: LeafRule) -> Vec<Node2> {
    if references.is_empty() {
        return Vec::new();
    }
    let count = references.len();
    let extent = Extent::of(references);
    if corners.is_some() {
        references.resize(count + spatial::spare(count), Reference::NONE);
    }
    let mut nodes = memory::zeroed(2 * references.len() - 1);
    let all = Builder { corners, whole: half_area(extent.lo, extent.hi), rule };
    all.subtree(references, count, extent, &mut nodes, Place { at: 0, first: 0, depth: 0 });
    nodes
}

/// What all subtrees share.
pub(super) struct Builder<'a> {
    pub(super) corners: Corners<'a>,
    /// Half the surface of everything.
    pub(super) whole: f32,
    pub(super) rule: LeafRule,
}

/// Where a subtree begins.
#[derive(Clone, Copy)]
struct Place {
    /// Its root's index.
    at: u32,
    /// Its first reference.
    first: u32,
    depth: u32,
}

/// Two parts of a subtree's references.
pub(super) struct Parts {
    /// References of each.
    pub(super) counts: [usize; 2],
    pub(super) extents: [Extent; 2],
}

impl Builder<'_> {
    /// Fills `nodes` with the subtree over the first `count` of `references`, the rest of which is room for pieces; returns
    /// what it costs.
    #[allow(clippy::cast_possible_truncation, reason = "triangle counts are checked against 2^29 before building")]
    fn subtree(
        &self,
        references: &mut [Reference],
        count: usize,
        extent: Extent,
        nodes: &mut [Node2],
        place: Place,
    ) -> Costs {
        // A small subtree keeps its references together: they may become one leaf.
        let references = if count < spatial::FEWEST { &mut references[..count] } else { references };
        let (node, below) = nodes.split_first_mut().expect("a subtree has at least one node");
        let area = half_area(extent.lo, extent.hi);
        let filled = |right: u32, shares: Shares| {
            let (lo, hi) = (extent.lo.extend(f32::from_bits(right)), extent.hi.extend(f32::from_bits(place.first)));
            Node2 { lo, hi, count: count as u32, shares }
        };
        if count == 1 {
            let (costs, shares) = alone(area, self.rule);
            *node = filled(0, shares);
            return costs;
        }
        let Parts { counts, extents: [left, right] } = self.split(references, count, &extent, place.depth);
        // Room that is left is shared by need.
        let spare = references.len() - counts[0] - counts[1];
        let room = counts[0] + (spare as u64 * counts[0] as u64 / (counts[0] + counts[1]) as u64) as usize;
        if room > counts[0] {
            // The right part stands behind the left one: its own places may overlap the new ones.
            references.copy_within(counts[0]..counts[0] + counts[1], room);
        }
        let next = Place { depth: place.depth + 1, ..place };
        let right_place = Place { at: place.at + 2 * room as u32, first: place.first + room as u32, ..next };
        let (left_references, right_references) = references.split_at_mut(room);
        let (left_nodes, right_nodes) = below.split_at_mut(2 * room - 1);
        let mut go_left =
            || self.subtree(left_references, counts[0], left, left_nodes, Place { at: place.at + 1, ..next });
        let mut go_right = || self.subtree(right_references, counts[1], right, right_nodes, right_place);
        let (left, right) = if count > PARALLEL { rayon::join(go_left, go_right) } else { (go_left(), go_right()) };
        let (costs, shares) = combined(area, count as u32, &left, &right, self.rule);
        *node = filled(right_place.at, shares);
        costs
    }

    /// Splits the first `count` of `references` in two parts, neither empty: the second follows the first.
    fn split(&self, references: &mut [Reference], count: usize, extent: &Extent, depth: u32) -> Parts {
        let members = &mut references[..count];
        match count {
            _ if depth >= DEEPEST => halves(members, count / 2),
            2 => halves(members, 1),
            3..=4 => split_few(members, extent),
            5..=32 => self.split_binned::<8>(references, count, extent),
            _ => self.split_binned::<16>(references, count, extent),
        }
    }

    /// Splits between the bins, of `N` along each axis, where the surface-area cost is least; in halves where none
    /// differ.
    fn split_binned<const N: usize>(&self, references: &mut [Reference], count: usize, extent: &Extent) -> Parts {
        let members = &mut references[..count];
        let (binning, bins) = Binning::fill::<N>(members, extent);
        let Some(best) = cheapest(&bins) else { return halves(members, count / 2) };
        if let Some(corners) = self.corners
            && let Some(parts) = spatial::split(references, count, extent, &best, corners, self.whole)
        {
            return parts;
        }
        let members = &mut references[..count];
        let parts = partition(members, |r| binning.bin(r, best.axis) <= best.border);
        if parts.counts.contains(&0) { halves(members, count / 2) } else { parts }
    }
}

/// Bounds of boxes and of their centres (doubled).
#[derive(Debug, Clone, Copy)]
pub(super) struct Extent {
    pub(super) lo: Vec3A,
    pub(super) hi: Vec3A,
    centre_lo: Vec3A,
    centre_hi: Vec3A,
}

impl Extent {
    pub(super) const EMPTY: Self = Self {
        lo: Vec3A::INFINITY,
        hi: Vec3A::NEG_INFINITY,
        centre_lo: Vec3A::INFINITY,
        centre_hi: Vec3A::NEG_INFINITY,
    };

    #[inline]
    pub(super) fn add(&mut self, r: &Reference) {
        let (lo, hi) = (r.lo(), r.hi());
        self.lo = self.lo.min(lo);
        self.hi = self.hi.max(hi);
        let centre = lo + hi;
        self.centre_lo = self.centre_lo.min(centre);
        self.centre_hi = self.centre_hi.max(centre);
    }

    fn of(references: &[Reference]) -> Self {
        let mut all = Self::EMPTY;
        references.iter().for_each(|r| all.add(r));
        all
    }
}

/// Boxes that fall into one bin.
#[derive(Debug, Clone, Copy)]
pub(super) struct Bin {
    pub(super) lo: Vec3A,
    pub(super) hi: Vec3A,
    pub(super) count: u32,
}

impl Bin {
    pub(super) const EMPTY: Self = Self { lo: Vec3A::INFINITY, hi: Vec3A::NEG_INFINITY, count: 0 };

    #[inline]
    pub(super) fn join(&mut self, other: &Self) {
        self.lo = self.lo.min(other.lo);
        self.hi = self.hi.max(other.hi);
        self.count += other.count;
    }

    #[allow(clippy::cast_precision_loss, reason = "a cost, not a count")]
    pub(super) fn cost(&self) -> f32 {
        if self.count == 0 { f32::INFINITY } else { half_area(self.lo, self.hi) * self.count as f32 }
    }
}

/// Maps centres to bins.
struct Binning {
    origin: Vec3A,
    scale: Vec3A,
    last: f32,
}

/// A number added to this is rounded to a whole one, which is then the sum's lowest bits.
const WHOLE: f32 = (1 << 23) as f32;

impl Binning {
    /// `N` bins along each axis, a power of two, filled with the boxes of `references`.
    #[allow(clippy::cast_precision_loss, reason = "at most 16 bins")]
    fn fill<const N: usize>(references: &[Reference], extent: &Extent) -> (Self, [[Bin; N]; 3]) {
        let size = extent.centre_hi - extent.centre_lo;
        // An axis without extent gets scale 0: all in bin 0, never the cheapest.
        let scale = Vec3A::select(size.cmpgt(Vec3A::ZERO), Vec3A::splat(N as f32 * 0.9999) / size, Vec3A::ZERO);
        let scale = Vec3A::select(scale.is_finite_mask(), scale, Vec3A::ZERO);
        let binning = Self { origin: extent.centre_lo, scale, last: (N - 1) as f32 };
        let mut bins = [[Bin::EMPTY; N]; 3];
        for r in references {
            let one = Bin { lo: r.lo(), hi: r.hi(), count: 1 };
            let at = binning.places(r);
            for axis in 0..3 {
                bins[axis][at[axis].to_bits() as usize & (N - 1)].join(&one);
            }
        }
        (binning, bins)
    }

    /// The bin of each axis, as the lowest bits of a number: each half open, as their middles are rounded to.
    #[inline]
    fn places(&self, r: &Reference) -> [f32; 3] {
        let place = ((r.lo() + r.hi()) - self.origin) * self.scale - Vec3A::splat(0.5);
        // What overflows lands in the first or last bin.
        (place.max(Vec3A::ZERO).min(Vec3A::splat(self.last)) + Vec3A::splat(WHOLE)).to_array()
    }

    /// The bin along `axis`.
    #[inline]
    fn bin(&self, r: &Reference, axis: usize) -> u32 {
        self.places(r)[axis].to_bits() - WHOLE.to_bits()
    }
}

/// The first `left` references, and the others.
fn halves(references: &[Reference], left: usize) -> Parts {
    let (a, b) = references.split_at(left);
    Parts { counts: [a.len(), b.len()], extents: [Extent::of(a), Extent::of(b)] }
}

/// Splits at most four: sorted along the longest axis of their centres, at the cheapest place.
fn split_few(references: &mut [Reference], extent: &Extent) -> Parts {
    let size = extent.centre_hi - extent.centre_lo;
    let axis = if size.x >= size.y.max(size.z) { 0 } else { usize::from(size.z > size.y) + 1 };
    let centre = |r: &Reference| r.lo[axis] + r.hi[axis];
    references.sort_by(|a, b| centre(a).total_cmp(&centre(b)).then(a.id().cmp(&b.id())));
    let cost = |part: &[Reference]| {
        let mut bin = Bin::EMPTY;
        part.iter().for_each(|r| bin.join(&Bin { lo: r.lo(), hi: r.hi(), count: 1 }));
        bin.cost()
    };
    let at = |k: usize| cost(&references[..k]) + cost(&references[k..]);
    let left = (1..references.len()).min_by(|&a, &b| at(a).total_cmp(&at(b))).unwrap_or(1);
    halves(references, left)
}

/// A way to split between bins.
pub(super) struct Border {
    pub(super) axis: usize,
    /// The last bin of the left part.
    pub(super) border: u32,
    pub(super) cost: f32,
    /// Bounds of both parts.
    pub(super) parts: [Bin; 2],
}

/// The cheapest border between bins; `None` where nothing can be told apart.
#[allow(clippy::cast_possible_truncation, reason = "at most 16 bins")]
fn cheapest<const N: usize>(bins: &[[Bin; N]; 3]) -> Option<Border> {
    let mut best: Option<Border> = None;
    for (axis, bins) in bins.iter().enumerate() {
        let mut rest = [Bin::EMPTY; N];
        let mut costs = [f32::INFINITY; N];
        let mut right = Bin::EMPTY;
        for i in (1..N).rev() {
            right.join(&bins[i]);
            rest[i] = right;
            costs[i] = right.cost();
        }
        let mut left = Bin::EMPTY;
        for i in 0..N - 1 {
            left.join(&bins[i]);
            let cost = left.cost() + costs[i + 1];
            if cost < best.as_ref().map_or(f32::INFINITY, |b| b.cost) {
                best = Some(Border { axis, border: i as u32, cost, parts: [left, rest[i + 1]] });
            }
        }
    }
    best
}

fn partition(references: &mut [Reference], is_left: impl Fn(&Reference) -> bool) -> Parts {
    let (mut i, mut j) = (0, references.len());
    let (mut left, mut right) = (Extent::EMPTY, Extent::EMPTY);
    while i < j {
        let r = references[i];
        if is_left(&r) {
            left.add(&r);
            i += 1;
        } else {
            right.add(&r);
            j -= 1;
            references.swap(i, j);
        }
    }
    Parts { counts: [i, references.len() - i], extents: [left, right] }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn depth(nodes: &[Node2], at: usize) -> u32 {
        let node = &nodes[at];
        if node.right() == 0 { 1 } else { 1 + depth(nodes, at + 1).max(depth(nodes, node.right() as usize)) }
    }

    fn check(mut references: Vec<Reference>) -> u32 {
        let n = references.len();
        let nodes = build(&mut references, None, LeafRule { most: 4, cost: 0.6 });
        assert_eq!(nodes.len(), 2 * n - 1);
        let mut ids: Vec<u32> = references.iter().map(Reference::id).collect();
        ids.sort_unstable();
        assert!(ids.iter().enumerate().all(|(i, &id)| id as usize == i), "every reference once");
        for node in &nodes {
            for r in &references[node.first() as usize..][..node.count as usize] {
                assert!(r.lo().cmpge(node.lo()).all() && r.hi().cmple(node.hi()).all(), "boxes enclose");
            }
        }
        depth(&nodes, 0)
    }

    #[test]
    fn identical_boxes_are_halved_by_count() {
        let deep = check(vec![Reference::new(Vec3A::ONE, Vec3A::splat(2.0), 0, 0.0)]);
        assert_eq!(deep, 1);
        let deep = check((0..5000).map(|i| Reference::new(Vec3A::ONE, Vec3A::ONE, i, 0.0)).collect());
        assert!(deep <= 14, "{deep}");
    }

    #[test]
    fn geometric_spacing_stays_shallow() {
        let references = (0..2000_u16)
            .map(|i| {
                let x = libm::powf(10.0, -37.0 + f32::from(i) * 0.037);
                Reference::new(Vec3A::new(x, 0.0, 0.0), Vec3A::new(x, x, x), u32::from(i), 0.0)
            })
            .collect();
        assert!(check(references) <= DEEPEST + 12);
    }

    #[test]
    fn ranges_that_overflow_are_split() {
        let huge = f32::MAX * 0.9;
        let references = (0..100)
            .map(|i| {
                let p = if i % 2 == 0 { Vec3A::splat(huge) } else { Vec3A::splat(-huge) };
                Reference::new(p, p, i, 0.0)
            })
            .collect();
        assert!(check(references) <= 50);
    }
}
