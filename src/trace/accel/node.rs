//! Nodes of eight boxes, still or moving linearly.

use super::collapse::{NO_CHILD, WIDTH};
use super::frame::RayFrame;
use super::isa::Isa;
use super::linear::{Aabb, LinearBox};
use glam::Vec3A;

/// One plane of each of the eight children.
#[derive(Debug, Clone, Copy)]
#[repr(C, align(32))]
pub(super) struct Planes(pub(super) [f32; WIDTH]);

/// Eight boxes that do not move: lower x, y, z, then upper x, y, z. Four lines of the cache.
#[derive(Debug, Clone)]
#[repr(C, align(64))]
pub(super) struct StillNode {
    pub(super) bounds: [Planes; 6],
    children: [u32; WIDTH],
}

/// Eight boxes whose planes move linearly: at the segment's begin, and how far they go until its end.
#[derive(Debug, Clone)]
#[repr(C, align(64))]
pub(super) struct MovingNode {
    pub(super) bounds: [Planes; 6],
    pub(super) deltas: [Planes; 6],
    children: [u32; WIDTH],
}

/// What a ray finds at a node.
#[derive(Clone, Copy)]
pub(super) struct Opened {
    /// Bit i: child i's box is met no farther than the limit.
    pub(super) mask: u32,
    /// Where each box is entered, ≥ 0.
    pub(super) near: Planes,
}

/// A node of the wide tree.
pub(super) trait WideNode: Sync + Send + Sized {
    /// A node with the given children in their boxes; absent ones have empty boxes.
    fn new(boxes: &[LinearBox; WIDTH], children: [u32; WIDTH]) -> Self;

    /// Its children.
    fn children(&self) -> &[u32; WIDTH];

    /// Tests all eight boxes at fraction `time` of the segment.
    fn open<I: Isa>(&self, ray: &RayFrame, time: f32, limit: f32) -> Opened;
}

impl StillNode {
    /// The box of child `child`.
    pub(super) fn child_box(&self, child: usize) -> Aabb {
        let at = |plane: usize| self.bounds[plane].0[child];
        Aabb { lo: Vec3A::new(at(0), at(1), at(2)), hi: Vec3A::new(at(3), at(4), at(5)) }
    }
}

fn planes(boxes: &[LinearBox; WIDTH], at_end: bool) -> [Planes; 6] {
    std::array::from_fn(|plane| {
        Planes(std::array::from_fn(|child| {
            let bounds = if at_end { &boxes[child].end } else { &boxes[child].begin };
            if plane < 3 { bounds.lo[plane] } else { bounds.hi[plane - 3] }
        }))
    })
}

impl WideNode for StillNode {
    fn new(boxes: &[LinearBox; WIDTH], children: [u32; WIDTH]) -> Self {
        debug_assert!(children.iter().zip(boxes).all(|(&c, b)| c != NO_CHILD || b.begin.is_empty()));
        Self { bounds: planes(boxes, false), children }
    }

    #[inline(always)]
    fn children(&self) -> &[u32; WIDTH] {
        &self.children
    }

    #[inline(always)]
    fn open<I: Isa>(&self, ray: &RayFrame, _time: f32, limit: f32) -> Opened {
        I::open_still(self, ray, limit)
    }
}

impl WideNode for MovingNode {
    fn new(boxes: &[LinearBox; WIDTH], children: [u32; WIDTH]) -> Self {
        let bounds = planes(boxes, false);
        let ends = planes(boxes, true);
        let deltas = std::array::from_fn(|plane| {
            Planes(std::array::from_fn(|child| {
                let delta = ends[plane].0[child] - bounds[plane].0[child];
                // Empty boxes: ∞ − ∞.
                if delta.is_nan() { 0.0 } else { delta }
            }))
        });
        Self { bounds, deltas, children }
    }

    #[inline(always)]
    fn children(&self) -> &[u32; WIDTH] {
        &self.children
    }

    #[inline(always)]
    fn open<I: Isa>(&self, ray: &RayFrame, time: f32, limit: f32) -> Opened {
        I::open_moving(self, ray, time, limit)
    }
}
