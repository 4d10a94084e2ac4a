//! In which order a ray that asks for any hit visits children: what ends the walk soonest comes first.
//!
//! A ray that meets a convex box meets a patch of area A inside it with probability A / (S / 2), S the surface of the box
//! (Cauchy's formula; both sides count). From the leaves up this gives the probability P that a subtree stops a ray that
//! meets its box, and the expected cost C of finding out; visiting children by falling P / C costs least (Ize and Hansen
//! 2011, *RTSAH Traversal Order for Occlusion Rays*). The walls of a room come before the statues in it.

use super::choice::NODE_COST;

/// Of a ray that meets the box of a subtree.
#[derive(Debug, Clone, Copy)]
pub(super) struct Odds {
    /// Half the surface of the box.
    half_area: f32,
    /// Probability that what is inside stops the ray.
    stops: f32,
    /// Expected cost of finding out.
    cost: f32,
}

impl Odds {
    /// Of nothing.
    pub(super) const NONE: Self = Self { half_area: 0.0, stops: 0.0, cost: 0.0 };

    /// A leaf: half the surface of its box, areas of its primitives, cost of a visit.
    pub(super) fn leaf(half_area: f32, areas: impl Iterator<Item = f32>, cost: f32) -> Self {
        let passes: f32 = areas.map(|a| 1.0 - share(a, half_area)).product();
        Self { half_area, stops: 1.0 - passes, cost }
    }

    /// A node, whose children are brought into the order of visits.
    pub(super) fn node<C>(half_area: f32, children: &mut [C], odds: impl Fn(&C) -> Self) -> Self {
        let worth = |child: &C| odds(child).stops / odds(child).cost;
        // Stable: equal ones keep the order that the tree gives.
        children.sort_by(|a, b| worth(b).total_cmp(&worth(a)));
        let (mut cost, mut passes) = (NODE_COST, 1.0);
        for below in children.iter().map(odds) {
            let met = share(below.half_area, half_area);
            cost += passes * met * below.cost;
            passes *= 1.0 - met * below.stops;
        }
        Self { half_area, stops: 1.0 - passes, cost }
    }
}

/// `part / whole`, in [0, 1]; 1 where there is no whole to speak of.
fn share(part: f32, whole: f32) -> f32 {
    let share = part / whole;
    if share < 1.0 { share } else { 1.0 }
}
