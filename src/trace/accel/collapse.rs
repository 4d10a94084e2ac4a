//! From the binary tree to one of eight children a node, by dynamic programming over the surface-area cost
//! (Ylitie, Karras and Laine 2017, §3; Wald, Benthin and Boulos 2008).

use super::linear::Aabb;
use super::occlusion::Occlusion;
use super::topology::{Node2, Reference};

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

/// Cost of visiting a node of eight boxes; the unit.
pub(super) const NODE_COST: f32 = 1.0;

/// What a leaf may hold and costs.
#[derive(Debug, Clone, Copy)]
pub(super) struct LeafRule {
    /// Most references in a leaf, at most [`BLOCK`].
    pub(super) most: u32,
    /// Cost of visiting one, in visits of a node.
    pub(super) cost: f32,
}

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
    /// Most entries that a traversal's stack can hold.
    pub(super) stack: usize,
}

/// What the subtree below a binary node becomes.
#[derive(Clone, Copy)]
struct Choice {
    /// `cost[m]`: of the subtree as at most `m` siblings, m in 1..8.
    cost: [f32; WIDTH],
    /// `left[m]`: how many of `m` siblings the left child gets; 0: the same as with m − 1. `left[1]` is 1 for a leaf;
    /// `left[0]` is the left share when the node itself becomes a wide node.
    left: [u8; WIDTH],
}

/// Collapses `tree` (not empty unless `references` is).
pub(super) fn collapse(tree: &[Node2], references: &[Reference], rule: LeafRule) -> Shape {
    let mut shape = Shape { root: NO_CHILD, nodes: Vec::new(), leaves: Vec::new(), boxes: Vec::new(), stack: 0 };
    if tree.is_empty() {
        return shape;
    }
    let mut choices = vec![Choice { cost: [0.0; WIDTH], left: [0; WIDTH] }; tree.len()];
    choose(tree, &mut choices, rule);
    shape.nodes.reserve(references.len() / 8);
    shape.leaves.reserve(references.len() / 2);
    let mut occlusion = Occlusion::default();
    let mut pending = vec![(0_u32, None::<(usize, usize)>)];
    while let Some((at, parent)) = pending.pop() {
        let node = &tree[at as usize];
        let id = if choices[at as usize].left[1] == 1 {
            let mut leaf = [NO_TRIANGLE; BLOCK];
            let members = &references[node.first as usize..][..node.count as usize];
            for (slot, r) in leaf.iter_mut().zip(members) {
                *slot = r.id();
            }
            shape.leaves.push(leaf);
            shape.boxes.push(Aabb { lo: node.lo, hi: node.hi });
            occlusion.leaf(node.half_area(), members.iter().map(Reference::area), rule.cost);
            LEAF | index(shape.leaves.len() - 1)
        } else {
            shape.nodes.push([NO_CHILD; WIDTH]);
            occlusion.node(node.half_area());
            let mut children = Children { found: [0; WIDTH], count: 0 };
            let share = choices[at as usize].left[0];
            children.gather(tree, &choices, at + 1, share);
            children.gather(tree, &choices, node.right, 8 - share);
            let children = &children.found[..children.count];
            let me = shape.nodes.len() - 1;
            pending.extend(children.iter().enumerate().rev().map(|(slot, &child)| (child, Some((me, slot)))));
            index(me)
        };
        match parent {
            Some((node, slot)) => shape.nodes[node][slot] = id,
            None => shape.root = id,
        }
    }
    occlusion.order(&mut shape.nodes);
    shape.stack = stack_need(&shape.nodes);
    shape
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
    fn gather(&mut self, tree: &[Node2], choices: &[Choice], at: u32, mut share: u8) {
        let node = &tree[at as usize];
        let choice = &choices[at as usize];
        while share > 1 && choice.left[share as usize] == 0 {
            share -= 1;
        }
        if share == 1 || node.right == 0 {
            self.found[self.count] = at;
            self.count += 1;
            return;
        }
        let left = choice.left[share as usize];
        self.gather(tree, choices, at + 1, left);
        self.gather(tree, choices, node.right, share - left);
    }
}

/// Subtrees smaller than this are solved by one thread.
const PARALLEL: u32 = 4096;

/// Fills `choices` for the subtree in `tree` (depth-first; indices of right children are relative to the whole).
fn choose(tree: &[Node2], choices: &mut [Choice], rule: LeafRule) {
    fn solve(tree: &[Node2], at: usize, choices: &mut [Choice], rule: LeafRule) {
        let node = &tree[at];
        if node.right == 0 || node.count <= PARALLEL {
            for i in (0..choices.len()).rev() {
                let node = &tree[at + i];
                let right = (node.right as usize).wrapping_sub(at);
                choices[i] = if node.right == 0 {
                    alone(node, rule)
                } else {
                    combine(node, &choices[i + 1], &choices[right], rule)
                };
            }
            return;
        }
        let right = node.right as usize;
        let (own, below) = choices.split_at_mut(1);
        let (left_choices, right_choices) = below.split_at_mut(right - at - 1);
        rayon::join(|| solve(tree, at + 1, left_choices, rule), || solve(tree, right, right_choices, rule));
        own[0] = combine(node, &left_choices[0], &right_choices[0], rule);
    }
    solve(tree, 0, choices, rule);
}

fn alone(node: &Node2, rule: LeafRule) -> Choice {
    Choice { cost: [node.half_area() * rule.cost; WIDTH], left: [1; WIDTH] }
}

#[allow(clippy::cast_possible_truncation, reason = "shares of eight")]
fn combine(node: &Node2, left: &Choice, right: &Choice, rule: LeafRule) -> Choice {
    let area = node.half_area();
    let mut choice = Choice { cost: [0.0; WIDTH], left: [0; WIDTH] };
    let mut inner = f32::INFINITY;
    for k in 1..WIDTH {
        let cost = left.cost[k] + right.cost[WIDTH - k];
        if cost < inner || k == 1 {
            inner = cost;
            choice.left[0] = k as u8;
        }
    }
    inner += area * NODE_COST;
    let leaf = if node.count <= rule.most { area * rule.cost } else { f32::INFINITY };
    // Where areas overflow or vanish every cost is alike: small enough is then a leaf.
    choice.left[1] = u8::from(node.count <= rule.most && (leaf <= inner || !leaf.is_finite()));
    choice.cost[1] = leaf.min(inner);
    for m in 2..WIDTH {
        choice.cost[m] = choice.cost[m - 1];
        for k in 1..m {
            let cost = left.cost[k] + right.cost[m - k];
            if cost < choice.cost[m] {
                choice.cost[m] = cost;
                choice.left[m] = k as u8;
            }
        }
    }
    choice
}

/// The most entries that a depth-first walk leaves waiting: at each node all children but the one it enters.
fn stack_need(nodes: &[[u32; WIDTH]]) -> usize {
    let mut need = vec![0_usize; nodes.len()];
    for (i, children) in nodes.iter().enumerate().rev() {
        let present = children.iter().filter(|&&c| c != NO_CHILD);
        let deepest = present.clone().map(|&c| if c & LEAF == 0 { need[c as usize] } else { 0 }).max().unwrap_or(0);
        // All children are pushed before the nearest is popped.
        need[i] = present.count() + deepest;
    }
    need.first().copied().unwrap_or(0) + 1
}
