//! A wide tree over triangles: nodes, blocks and the boxes they are filled with.

use super::block::{Block, MovingBlock, StillBlock, StoredTriangle};
use super::collapse::{LEAF, NO_CHILD, NO_TRIANGLE, Shape, WIDTH};
use super::linear::{Aabb, LinearBox};
use super::memory;
use super::node::{MovingNode, StillNode, WideNode};
use super::topology::half_area;
use rayon::prelude::*;

/// Nodes over leaves, with the bounds of the whole.
#[derive(Debug, Clone)]
pub(super) struct Nodes<N> {
    /// The root: a node, a leaf, or [`NO_CHILD`].
    pub(super) root: u32,
    pub(super) nodes: Vec<N>,
    /// Bounds of everything, over the whole segment.
    pub(super) bounds: Aabb,
    /// Most entries a traversal needs on its stack.
    pub(super) stack: usize,
    /// Expected visits of a ray that meets the bounds: areas of all nodes at mid-time over that of the whole.
    pub(super) relative_cost: f32,
}

/// A tree over triangles.
#[derive(Debug, Clone)]
pub(super) struct Tree<N, B> {
    pub(super) nodes: Nodes<N>,
    pub(super) blocks: Vec<B>,
}

/// A tree over triangles that stand still.
pub(super) type StillTree = Tree<StillNode, StillBlock>;
/// A tree over triangles whose corners move linearly.
pub(super) type MovingTree = Tree<MovingNode, MovingBlock>;

impl<N: WideNode> Nodes<N> {
    /// Nodes of the given shape around leaves with the given boxes.
    pub(super) fn around(shape: &Shape, leaves: &[LinearBox]) -> Self {
        let boxes = node_boxes(shape, leaves);
        let child_box = |child: u32| match child {
            NO_CHILD => LinearBox::EMPTY,
            leaf if leaf & LEAF != 0 => leaves[(leaf & !LEAF) as usize],
            node => boxes[node as usize],
        };
        let mut nodes = memory::large(shape.nodes.len());
        shape
            .nodes
            .par_iter()
            .with_min_len(512)
            .map(|children| {
                let boxes: [LinearBox; WIDTH] = std::array::from_fn(|i| child_box(children[i]).padded());
                N::new(&boxes, *children)
            })
            .collect_into_vec(&mut nodes);
        let whole = child_box(shape.root);
        let area = |b: &LinearBox| half_area(b.middle().lo, b.middle().hi);
        let relative_cost = boxes.iter().map(area).sum::<f32>() / area(&whole).max(f32::MIN_POSITIVE);
        Self { root: shape.root, nodes, bounds: whole.padded().swept(), stack: shape.stack, relative_cost }
    }

    /// Bytes that it occupies.
    pub(super) fn bytes(&self) -> usize {
        self.nodes.len() * size_of::<N>()
    }
}

impl Nodes<StillNode> {
    /// The tree as at most `most` subtrees (one at least) that together hold all of it: the largest is opened as long as
    /// its children have room.
    pub(super) fn opened(&self, most: usize) -> Vec<(u32, Aabb)> {
        if self.bounds.is_empty() {
            return Vec::new();
        }
        let mut parts = vec![(self.root, self.bounds)];
        loop {
            let area = |p: &(u32, Aabb)| if p.0 & LEAF == 0 { half_area(p.1.lo, p.1.hi) } else { -1.0 };
            let Some(at) = (0..parts.len()).max_by(|&a, &b| area(&parts[a]).total_cmp(&area(&parts[b]))) else {
                return parts;
            };
            if parts[at].0 & LEAF != 0 || parts.len() + WIDTH > most + 1 {
                return parts;
            }
            let node = &self.nodes[parts.swap_remove(at).0 as usize];
            let children = node.children().iter().enumerate().filter(|(_, c)| **c != NO_CHILD);
            parts.extend(children.map(|(i, &c)| (c, node.child_box(i))));
        }
    }
}

/// Boxes of the nodes, from the leaves up; parents stand before their children.
pub(super) fn node_boxes(shape: &Shape, leaves: &[LinearBox]) -> Vec<LinearBox> {
    let mut boxes = vec![LinearBox::EMPTY; shape.nodes.len()];
    for (i, children) in shape.nodes.iter().enumerate().rev() {
        boxes[i] = children.iter().fold(LinearBox::EMPTY, |all, &child| match child {
            NO_CHILD => all,
            leaf if leaf & LEAF != 0 => all.join(&leaves[(leaf & !LEAF) as usize]),
            node => all.join(&boxes[node as usize]),
        });
    }
    boxes
}

impl<N: WideNode, B: Block> Tree<N, B> {
    /// Fills `shape` with the triangles that `triangle` gives for its indices.
    pub(super) fn fill(shape: &Shape, triangle: impl Fn(u32) -> StoredTriangle + Sync) -> Self {
        let mut blocks = memory::large(shape.leaves.len());
        let mut leaves: Vec<LinearBox> = Vec::new();
        shape
            .leaves
            .par_iter()
            .with_min_len(1024)
            .enumerate()
            .map(|(i, leaf)| {
                let triangles = leaf.map(|id| (id != NO_TRIANGLE).then(|| triangle(id)));
                let around = shape.boxes.get(i).map_or_else(
                    || {
                        triangles.iter().flatten().fold(LinearBox::EMPTY, |all, t| {
                            all.join(&LinearBox { begin: Aabb::around(t.begin), end: Aabb::around(t.end) })
                        })
                    },
                    |&b| LinearBox::still(b),
                );
                (B::new(&triangles), around)
            })
            .unzip_into_vecs(&mut blocks, &mut leaves);
        Self { nodes: Nodes::around(shape, &leaves), blocks }
    }

    /// Bytes that it occupies.
    pub(super) fn bytes(&self) -> usize {
        self.nodes.bytes() + self.blocks.len() * size_of::<B>()
    }
}
