//! From the binary tree to one of eight children a node (Wald, Benthin and Boulos 2008), as `choice` decided.

use super::choice::LeafRule;
use super::linear::Aabb;
use super::occlusion::Odds;
use super::topology::{Node2, Reference};
use rayon::prelude::*;

/// Children of a wide node.
pub(super) const WIDTH: usize = 8;
/// Triangles of a block: a leaf is one block.
pub(super) const BLOCK: usize = 4;
/// Marks a child that is a leaf; the rest is the leaf's index.
pub(super) const LEAF: u32 = 1 << 31;
/// Marks an absent child.
pub(super) const NO_CHILD: u32 = u32::MAX;
/// Marks an absent triangle of a block.
pub(super) const NO_TRIANGLE: u32 = u32::MAX;

/// The shape of a wide tree: which node or leaf is whose child. Parents stand before their children.
#[derive(Debug, Clone)]
pub(super) struct Shape {
    /// The root: a node (0), a leaf, or [`NO_CHILD`] for an empty tree.
    pub(super) root: u32,
    /// Children of each node, in the order in which a ray that asks for any hit visits them.
    pub(super) nodes: Vec<[u32; WIDTH]>,
    /// References of each leaf.
    pub(super) leaves: Vec<[u32; BLOCK]>,
    /// Box of each leaf, smaller than that of its triangles where they were cut; empty for what moves.
    pub(super) boxes: Vec<Aabb>,
    /// Entries that a traversal's stack needs: what waits, and room for all children of the node that it is at.
    pub(super) stack: usize,
}

/// Collapses `tree` (not empty unless `references` is).
pub(super) fn collapse(tree: &[Node2], references: &[Reference], rule: LeafRule) -> Shape {
    let mut shape = Shape::empty();
    if tree.is_empty() {
        return shape;
    }
    shape.nodes.reserve(references.len() / 8);
    shape.leaves.reserve(references.len() / 2);
    shape.boxes.reserve(references.len() / 2);
    let root = Collapse { tree, references, rule }.emit(0, &mut shape);
    (shape.root, shape.stack) = (root.id, root.stack + WIDTH);
    shape
}

/// What a shape is made from.
struct Collapse<'a> {
    tree: &'a [Node2],
    references: &'a [Reference],
    rule: LeafRule,
}

/// A child that was made.
#[derive(Clone, Copy)]
struct Made {
    /// Its index; a leaf's is marked.
    id: u32,
    odds: Odds,
    /// The most entries that a depth-first walk of it leaves waiting.
    stack: usize,
}

impl Collapse<'_> {
    /// Appends the subtree at `at` as a node or a leaf.
    fn emit(&self, at: u32, shape: &mut Shape) -> Made {
        let node = &self.tree[at as usize];
        if node.shares.is_leaf() {
            return self.emit_leaf(node, shape);
        }
        let me = shape.nodes.len();
        shape.nodes.push([NO_CHILD; WIDTH]);
        let mut children = Children { found: [0; WIDTH], count: 0 };
        let [left, right] = node.shares.of_node();
        children.gather(self.tree, at + 1, left);
        children.gather(self.tree, node.right(), right);
        let roots = &children.found[..children.count];
        let mut made = [Made { id: NO_CHILD, odds: Odds::NONE, stack: 0 }; WIDTH];
        if node.count > PARALLEL {
            let parts: Vec<(Made, Shape)> = roots.par_iter().map(|&root| self.part(root)).collect();
            for (slot, (child, part)) in made.iter_mut().zip(parts) {
                *slot = Made { id: shape.append(child.id, &part), ..child };
            }
        } else {
            for (slot, &root) in made.iter_mut().zip(roots) {
                *slot = self.emit(root, shape);
            }
        }
        let made = &mut made[..children.count];
        let odds = Odds::node(node.half_area(), made, |child| child.odds);
        for (slot, child) in shape.nodes[me].iter_mut().zip(made.iter()) {
            *slot = child.id;
        }
        // All children are pushed before the nearest is popped.
        let deepest = made.iter().map(|child| child.stack).max().unwrap_or(0);
        Made { id: index(me), odds, stack: made.len() + deepest }
    }

    fn part(&self, at: u32) -> (Made, Shape) {
        let mut shape = Shape::empty();
        (self.emit(at, &mut shape), shape)
    }

    fn emit_leaf(&self, node: &Node2, shape: &mut Shape) -> Made {
        let mut leaf = [NO_TRIANGLE; BLOCK];
        let members = &self.references[node.first() as usize..][..node.count as usize];
        for (slot, r) in leaf.iter_mut().zip(members) {
            *slot = r.id();
        }
        shape.leaves.push(leaf);
        shape.boxes.push(Aabb { lo: node.lo(), hi: node.hi() });
        let odds = Odds::leaf(node.half_area(), members.iter().map(Reference::area), self.rule.cost);
        Made { id: LEAF | index(shape.leaves.len() - 1), odds, stack: 0 }
    }
}

impl Shape {
    fn empty() -> Self {
        Self { root: NO_CHILD, nodes: Vec::new(), leaves: Vec::new(), boxes: Vec::new(), stack: 0 }
    }

    /// Appends what was made apart, and returns the new index of its `root`.
    fn append(&mut self, root: u32, part: &Self) -> u32 {
        let (nodes, leaves) = (index(self.nodes.len()), index(self.leaves.len()));
        let moved = |child: u32| match child {
            NO_CHILD => NO_CHILD,
            leaf if leaf & LEAF != 0 => leaf + leaves,
            node => node + nodes,
        };
        self.nodes.extend(part.nodes.iter().map(|children| children.map(moved)));
        self.leaves.extend_from_slice(&part.leaves);
        self.boxes.extend_from_slice(&part.boxes);
        moved(root)
    }
}

#[allow(clippy::cast_possible_truncation, reason = "triangle counts are checked against 2^29 before building")]
fn index(i: usize) -> u32 {
    i as u32
}

struct Children {
    found: [u32; WIDTH],
    count: usize,
}

impl Children {
    /// Appends the roots of the at most `share` siblings that the subtree at `at` becomes.
    fn gather(&mut self, tree: &[Node2], at: u32, share: usize) {
        let node = &tree[at as usize];
        let Some([left, right]) = node.shares.of_siblings(share) else {
            self.found[self.count] = at;
            self.count += 1;
            return;
        };
        self.gather(tree, at + 1, left);
        self.gather(tree, node.right(), right);
    }
}

/// Subtrees smaller than this are made by one thread.
const PARALLEL: u32 = 4096;
