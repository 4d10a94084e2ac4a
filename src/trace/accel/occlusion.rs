//! In which order a ray that asks for any hit visits children: what ends the walk soonest comes first.
//!
//! A ray that meets a convex box meets a patch of area A inside it with probability A / (S / 2), S the surface of the box
//! (Cauchy's formula; both sides count). From the leaves up this gives the probability P that a subtree stops a ray that
//! meets its box, and the expected cost C of finding out; visiting children by falling P / C costs least (Ize and Hansen
//! 2011, *RTSAH Traversal Order for Occlusion Rays*). The walls of a room come before the statues in it.

use super::collapse::{LEAF, NO_CHILD, NODE_COST, WIDTH};

/// Of a ray that meets a box.
#[derive(Debug, Clone, Copy)]
struct Odds {
    /// Half the surface of the box.
    half_area: f32,
    /// Probability that what is inside stops the ray.
    stops: f32,
    /// Expected cost of finding out.
    cost: f32,
}

/// What is known of the nodes and leaves of a tree, in their order.
#[derive(Debug, Default)]
pub(super) struct Occlusion {
    nodes: Vec<Odds>,
    leaves: Vec<Odds>,
}

impl Occlusion {
    /// The next leaf: half the surface of its box, areas of its primitives, cost of a visit.
    pub(super) fn leaf(&mut self, half_area: f32, areas: impl Iterator<Item = f32>, cost: f32) {
        let passes: f32 = areas.map(|a| 1.0 - share(a, half_area)).product();
        self.leaves.push(Odds { half_area, stops: 1.0 - passes, cost });
    }

    /// The next node; what is below it follows.
    pub(super) fn node(&mut self, half_area: f32) {
        self.nodes.push(Odds { half_area, stops: 0.0, cost: NODE_COST });
    }

    /// Sorts the children of each of `nodes`, of which parents stand before their children.
    pub(super) fn order(mut self, nodes: &mut [[u32; WIDTH]]) {
        for (i, children) in nodes.iter_mut().enumerate().rev() {
            let odds = |child: u32| match child {
                NO_CHILD => None,
                leaf if leaf & LEAF != 0 => Some(self.leaves[(leaf & !LEAF) as usize]),
                node => Some(self.nodes[node as usize]),
            };
            let worth = |child: u32| odds(child).map_or(f32::NEG_INFINITY, |o| o.stops / o.cost);
            // Stable: equal ones keep the order that the tree gives.
            children.sort_by(|&a, &b| worth(b).total_cmp(&worth(a)));
            let mut all = self.nodes[i];
            let mut passes = 1.0;
            for below in children.iter().filter_map(|&c| odds(c)) {
                let met = share(below.half_area, all.half_area);
                all.cost += passes * met * below.cost;
                passes *= 1.0 - met * below.stops;
            }
            all.stops = 1.0 - passes;
            self.nodes[i] = all;
        }
    }
}

/// `part / whole`, in [0, 1]; 1 where there is no whole to speak of.
fn share(part: f32, whole: f32) -> f32 {
    let share = part / whole;
    if share < 1.0 { share } else { 1.0 }
}
