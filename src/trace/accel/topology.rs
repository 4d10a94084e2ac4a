//! The tree's shape: binned surface-area-heuristic splits over boxes (Wald 2007).
//!
//! Input is a list of boxes, output a binary tree in depth-first order: a node's left child follows it, its right child
//! follows the left subtree. References are permuted so that every subtree owns a contiguous range of them. Counts and
//! bounds do not depend on the order of reduction, so any number of threads builds the same tree.

use glam::{UVec3, Vec3A, Vec4};

/// A box with the primitive it bounds.
///
/// `lo.w` holds the primitive's index as bits, so that a reference is 32 bytes.
#[derive(Debug, Clone, Copy)]
pub(super) struct Reference {
    lo: Vec4,
    hi: Vec4,
}

impl Reference {
    pub(super) fn new(lo: Vec3A, hi: Vec3A, id: u32) -> Self {
        Self { lo: lo.extend(f32::from_bits(id)), hi: hi.extend(0.0) }
    }

    #[inline]
    pub(super) fn id(&self) -> u32 {
        self.lo.w.to_bits()
    }

    #[inline]
    fn lo(&self) -> Vec3A {
        Vec3A::from_vec4(self.lo)
    }

    #[inline]
    fn hi(&self) -> Vec3A {
        Vec3A::from_vec4(self.hi)
    }
}

/// A node of the binary tree.
#[derive(Debug, Clone, Copy)]
pub(super) struct Node2 {
    pub(super) lo: Vec3A,
    pub(super) hi: Vec3A,
    /// Index of the right child; 0 marks a leaf of one reference. The left child is the next node.
    pub(super) right: u32,
    /// First reference of the subtree.
    pub(super) first: u32,
    /// References in the subtree.
    pub(super) count: u32,
}

impl Node2 {
    const NONE: Self = Self { lo: Vec3A::ZERO, hi: Vec3A::ZERO, right: 0, first: 0, count: 0 };

    /// Half the surface of its box.
    #[inline]
    pub(super) fn half_area(&self) -> f32 {
        half_area(self.lo, self.hi)
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

/// Builds the tree over `references`, permuting them. Empty for no references.
pub(super) fn build(references: &mut [Reference]) -> Vec<Node2> {
    if references.is_empty() {
        return Vec::new();
    }
    let mut nodes = vec![Node2::NONE; 2 * references.len() - 1];
    subtree(references, &mut nodes, 0, 0, 0);
    nodes
}

#[allow(clippy::cast_possible_truncation, reason = "triangle counts are checked against 2^29 before building")]
fn subtree(references: &mut [Reference], nodes: &mut [Node2], at: u32, first: u32, depth: u32) {
    let count = references.len() as u32;
    let extent = Extent::of(references);
    let (node, below) = nodes.split_first_mut().expect("a subtree has at least one node");
    *node = Node2 { lo: extent.lo, hi: extent.hi, right: 0, first, count };
    if count == 1 {
        return;
    }
    let left = split(references, &extent, depth);
    let right = at + 2 * left as u32;
    node.right = right;
    let (left_references, right_references) = references.split_at_mut(left);
    let (left_nodes, right_nodes) = below.split_at_mut(2 * left - 1);
    let mut go_left = || subtree(left_references, left_nodes, at + 1, first, depth + 1);
    let mut go_right = || subtree(right_references, right_nodes, right, first + left as u32, depth + 1);
    if count as usize > PARALLEL {
        rayon::join(go_left, go_right);
    } else {
        go_left();
        go_right();
    }
}

/// Bounds of boxes and of their centres (doubled).
struct Extent {
    lo: Vec3A,
    hi: Vec3A,
    centre_lo: Vec3A,
    centre_hi: Vec3A,
}

impl Extent {
    fn of(references: &[Reference]) -> Self {
        let mut all = Self {
            lo: Vec3A::INFINITY,
            hi: Vec3A::NEG_INFINITY,
            centre_lo: Vec3A::INFINITY,
            centre_hi: Vec3A::NEG_INFINITY,
        };
        for r in references {
            let (lo, hi) = (r.lo(), r.hi());
            all.lo = all.lo.min(lo);
            all.hi = all.hi.max(hi);
            let centre = lo + hi;
            all.centre_lo = all.centre_lo.min(centre);
            all.centre_hi = all.centre_hi.max(centre);
        }
        all
    }
}

#[derive(Clone, Copy)]
struct Bin {
    lo: Vec3A,
    hi: Vec3A,
    count: u32,
}

impl Bin {
    const EMPTY: Self = Self { lo: Vec3A::INFINITY, hi: Vec3A::NEG_INFINITY, count: 0 };

    #[inline]
    fn join(&mut self, other: &Self) {
        self.lo = self.lo.min(other.lo);
        self.hi = self.hi.max(other.hi);
        self.count += other.count;
    }

    #[allow(clippy::cast_precision_loss, reason = "a cost, not a count")]
    fn cost(&self) -> f32 {
        if self.count == 0 { f32::INFINITY } else { half_area(self.lo, self.hi) * self.count as f32 }
    }
}

/// Maps centres to bins.
struct Binning {
    origin: Vec3A,
    scale: Vec3A,
    last: UVec3,
}

impl Binning {
    #[inline]
    fn bins(&self, r: &Reference) -> UVec3 {
        // Saturating conversion: a range that overflows f32 lands in the first or last bin.
        (((r.lo() + r.hi()) - self.origin) * self.scale).as_uvec3().min(self.last)
    }
}

/// Splits `references` in two parts, neither empty, and returns the size of the first.
fn split(references: &mut [Reference], extent: &Extent, depth: u32) -> usize {
    match references.len() {
        _ if depth >= DEEPEST => references.len() / 2,
        2 => 1,
        3..=4 => split_few(references, extent),
        5..=32 => split_binned::<8>(references, extent),
        33..=1024 => split_binned::<16>(references, extent),
        _ => split_binned::<32>(references, extent),
    }
}

/// Splits at most four: sorted along the longest axis of their centres, at the cheapest place.
fn split_few(references: &mut [Reference], extent: &Extent) -> usize {
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
    (1..references.len()).min_by(|&a, &b| at(a).total_cmp(&at(b))).unwrap_or(1)
}

/// Splits between the bins, of `N` along each axis, where the surface-area cost is least; in halves where none differ.
#[allow(clippy::cast_possible_truncation, clippy::cast_precision_loss, reason = "at most 32 bins")]
fn split_binned<const N: usize>(references: &mut [Reference], extent: &Extent) -> usize {
    let half = references.len() / 2;
    let size = extent.centre_hi - extent.centre_lo;
    // An axis without extent gets scale 0: all in bin 0, never the cheapest.
    let scale = Vec3A::select(size.cmpgt(Vec3A::ZERO), Vec3A::splat(N as f32 * 0.9999) / size, Vec3A::ZERO);
    let scale = Vec3A::select(scale.is_finite_mask(), scale, Vec3A::ZERO);
    let binning = Binning { origin: extent.centre_lo, scale, last: UVec3::splat(N as u32 - 1) };
    let mut bins = [[Bin::EMPTY; N]; 3];
    for r in references.iter() {
        let one = Bin { lo: r.lo(), hi: r.hi(), count: 1 };
        let at = binning.bins(r);
        bins[0][at.x as usize & (N - 1)].join(&one);
        bins[1][at.y as usize & (N - 1)].join(&one);
        bins[2][at.z as usize & (N - 1)].join(&one);
    }
    let Some((axis, border)) = cheapest(&bins) else { return half };
    let left = partition(references, |r| binning.bins(r)[axis] <= border);
    if left == 0 || left == references.len() { half } else { left }
}

/// The axis and the last bin of the left part of the cheapest split; `None` where nothing can be told apart.
#[allow(clippy::cast_possible_truncation, reason = "at most 32 bins")]
fn cheapest<const N: usize>(bins: &[[Bin; N]; 3]) -> Option<(usize, u32)> {
    let mut best = (f32::INFINITY, None);
    for (axis, bins) in bins.iter().enumerate() {
        let mut costs = [f32::INFINITY; N];
        let mut right = Bin::EMPTY;
        for i in (1..N).rev() {
            right.join(&bins[i]);
            costs[i] = right.cost();
        }
        let mut left = Bin::EMPTY;
        for i in 0..N - 1 {
            left.join(&bins[i]);
            let cost = left.cost() + costs[i + 1];
            if cost < best.0 {
                best = (cost, Some((axis, i as u32)));
            }
        }
    }
    best.1
}

fn partition(references: &mut [Reference], is_left: impl Fn(&Reference) -> bool) -> usize {
    let (mut i, mut j) = (0, references.len());
    while i < j {
        if is_left(&references[i]) {
            i += 1;
        } else {
            j -= 1;
            references.swap(i, j);
        }
    }
    i
}

#[cfg(test)]
mod tests {
    use super::*;

    fn depth(nodes: &[Node2], at: usize) -> u32 {
        let node = &nodes[at];
        if node.right == 0 { 1 } else { 1 + depth(nodes, at + 1).max(depth(nodes, node.right as usize)) }
    }

    fn check(mut references: Vec<Reference>) -> u32 {
        let n = references.len();
        let nodes = build(&mut references);
        assert_eq!(nodes.len(), 2 * n - 1);
        let mut ids: Vec<u32> = references.iter().map(Reference::id).collect();
        ids.sort_unstable();
        assert!(ids.iter().enumerate().all(|(i, &id)| id as usize == i), "every reference once");
        for node in &nodes {
            for r in &references[node.first as usize..(node.first + node.count) as usize] {
                assert!(r.lo().cmpge(node.lo).all() && r.hi().cmple(node.hi).all(), "boxes enclose");
            }
        }
        depth(&nodes, 0)
    }

    #[test]
    fn identical_boxes_are_halved_by_count() {
        let deep = check(vec![Reference::new(Vec3A::ONE, Vec3A::splat(2.0), 0)]);
        assert_eq!(deep, 1);
        let deep = check((0..5000).map(|i| Reference::new(Vec3A::ONE, Vec3A::ONE, i)).collect());
        assert!(deep <= 14, "{deep}");
    }

    #[test]
    fn geometric_spacing_stays_shallow() {
        let references = (0..2000_u16)
            .map(|i| {
                let x = libm::powf(10.0, -37.0 + f32::from(i) * 0.037);
                Reference::new(Vec3A::new(x, 0.0, 0.0), Vec3A::new(x, x, x), u32::from(i))
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
                Reference::new(p, p, i)
            })
            .collect();
        assert!(check(references) <= 50);
    }
}
