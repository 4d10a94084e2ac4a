//! Nodes of eight boxes, still or moving linearly, and the test of a ray against all eight.
//!
//! The portable and the AVX2 test compute the same IEEE operations in the same order, without fused multiply-add: they
//! answer alike bit for bit, so the picture does not depend on the processor.

use super::collapse::{NO_CHILD, WIDTH};
use super::frame::RayFrame;
use super::linear::LinearBox;

/// One plane of each of the eight children.
#[derive(Debug, Clone, Copy)]
#[repr(C, align(32))]
pub(super) struct Planes(pub(super) [f32; WIDTH]);

/// Eight boxes that do not move: lower x, y, z, then upper x, y, z.
#[derive(Debug, Clone)]
pub(super) struct StillNode {
    bounds: [Planes; 6],
    children: [u32; WIDTH],
}

/// Eight boxes whose planes move linearly: at the segment's begin, and how far they go until its end.
#[derive(Debug, Clone)]
pub(super) struct MovingNode {
    bounds: [Planes; 6],
    deltas: [Planes; 6],
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
    fn open(&self, ray: &RayFrame, time: f32, limit: f32) -> Opened;
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
    fn open(&self, ray: &RayFrame, _time: f32, limit: f32) -> Opened {
        let plane = |i: usize| self.bounds[i].0;
        slabs(plane, ray, limit)
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
    fn open(&self, ray: &RayFrame, time: f32, limit: f32) -> Opened {
        let plane = |i: usize| -> [f32; WIDTH] {
            let (bounds, deltas) = (&self.bounds[i].0, &self.deltas[i].0);
            std::array::from_fn(|c| bounds[c] + time * deltas[c])
        };
        slabs(plane, ray, limit)
    }
}

/// `a` if it is the greater, else `b`: `b` where either is not a number, as the processor's own instruction does.
#[inline(always)]
fn greater(a: f32, b: f32) -> f32 {
    if a > b { a } else { b }
}

/// `a` if it is the lesser, else `b`.
#[inline(always)]
fn lesser(a: f32, b: f32) -> f32 {
    if a < b { a } else { b }
}

/// The slab test (Kay and Kajiya 1986), made conservative as [`RayFrame`] says. A ray in a slab's plane gives 0 · ∞,
/// which never decides: the comparison falls to the value found so far.
#[inline(always)]
fn slabs(plane: impl Fn(usize) -> [f32; WIDTH], ray: &RayFrame, limit: f32) -> Opened {
    let mut near = [0.0_f32; WIDTH];
    let mut far = [limit; WIDTH];
    for axis in [2, 1, 0] {
        let (entry, exit) = (plane(ray.near_plane[axis]), plane(ray.far_plane[axis]));
        let (near_origin, far_origin) = (ray.near_origin[axis], ray.far_origin[axis]);
        let (near_inverse, far_inverse) = (ray.near_inverse[axis], ray.far_inverse[axis]);
        for c in 0..WIDTH {
            near[c] = greater((entry[c] - near_origin) * near_inverse, near[c]);
            far[c] = lesser((exit[c] - far_origin) * far_inverse, far[c]);
        }
    }
    let mut mask = 0;
    for c in 0..WIDTH {
        mask |= u32::from(near[c] <= far[c]) << c;
    }
    Opened { mask, near: Planes(near) }
}
