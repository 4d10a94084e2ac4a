//! What each binary subtree becomes in the wide tree, by dynamic programming over the surface-area cost from the leaves up
//! (Ylitie, Karras and Laine 2017, §3).

use super::collapse::WIDTH;
use bytemuck::Zeroable;

/// Cost of visiting a node of eight boxes; the unit.
pub(super) const NODE_COST: f32 = 1.0;

/// What a leaf may hold and costs.
#[derive(Debug, Clone, Copy)]
pub(super) struct LeafRule {
    /// Most references in a leaf, at most [`BLOCK`](super::collapse::BLOCK).
    pub(super) most: u32,
    /// Cost of visiting one, in visits of a node.
    pub(super) cost: f32,
}

/// Costs of a subtree as at most `m` siblings, m in 1..8, by m.
pub(super) type Costs = [f32; WIDTH];

/// How what a binary node becomes is shared between its children.
///
/// By m in 1..8: how many of m siblings the left child gets; 0 the same as with m − 1. At 1: 1 for a leaf. At 0: how many
/// children of the wide node that the node itself may become.
#[derive(Debug, Clone, Copy, Zeroable)]
pub(super) struct Shares([u8; WIDTH]);

impl Shares {
    /// Whether the node is a leaf of the wide tree.
    pub(super) fn is_leaf(self) -> bool {
        self.0[1] == 1
    }

    /// How many of a wide node's children come from the left and from the right.
    pub(super) fn of_node(self) -> [usize; 2] {
        let left = usize::from(self.0[0]);
        [left, WIDTH - left]
    }

    /// How many of at most `share` siblings come from the left and from the right; `None` where the node is one by itself.
    pub(super) fn of_siblings(self, share: usize) -> Option<[usize; 2]> {
        let share = (2..=share).rev().find(|&m| self.0[m] != 0)?;
        let left = usize::from(self.0[share]);
        Some([left, share - left])
    }
}

/// One reference, within a box of `half_area`.
pub(super) fn alone(half_area: f32, rule: LeafRule) -> (Costs, Shares) {
    let mut shares = [0; WIDTH];
    shares[1] = 1;
    ([half_area * rule.cost; WIDTH], Shares(shares))
}

/// A node over `count` references, whose children cost `left` and `right`.
#[allow(clippy::cast_possible_truncation, reason = "shares of eight")]
pub(super) fn combined(half_area: f32, count: u32, left: &Costs, right: &Costs, rule: LeafRule) -> (Costs, Shares) {
    let (mut costs, mut shares) = ([0.0; WIDTH], [0_u8; WIDTH]);
    let mut inner = f32::INFINITY;
    for k in 1..WIDTH {
        let cost = left[k] + right[WIDTH - k];
        if cost < inner || k == 1 {
            inner = cost;
            shares[0] = k as u8;
        }
    }
    inner += half_area * NODE_COST;
    let leaf = if count <= rule.most { half_area * rule.cost } else { f32::INFINITY };
    // Where areas overflow or vanish every cost is alike: small enough is then a leaf.
    shares[1] = u8::from(count <= rule.most && (leaf <= inner || !leaf.is_finite()));
    costs[1] = leaf.min(inner);
    for m in 2..WIDTH {
        costs[m] = costs[m - 1];
        for k in 1..m {
            let cost = left[k] + right[m - k];
            if cost < costs[m] {
                costs[m] = cost;
                shares[m] = k as u8;
            }
        }
    }
    (costs, Shares(shares))
}
