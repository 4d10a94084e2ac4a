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

/// Planes of eight boxes: of each axis the lower and the upper. A ray finds its own by [`Offset`].
pub(super) type Sides = [[Planes; 2]; 3];

/// Where a plane of [`Sides`] stands there: an offset in bytes, of a whole [`Planes`] by construction.
#[derive(Debug, Clone, Copy)]
pub(super) struct Offset(usize);

impl Offset {
    /// Of the lower (`side` 0) or upper (1) plane of `axis`.
    pub(super) const fn of(axis: usize, side: usize) -> Self {
        assert!(axis < 3 && side < 2, "three axes, two sides");
        Self((2 * axis + side) * size_of::<Planes>())
    }

    /// In bytes, below the size of [`Sides`].
    #[cfg(target_arch = "x86_64")]
    #[inline(always)]
    pub(super) fn bytes(self) -> usize {
        self.0
    }

    /// The plane of `sides` that stands there.
    #[inline(always)]
    pub(super) fn plane(self, sides: &Sides) -> &Planes {
        &sides.as_flattened()[self.0 / size_of::<Planes>()]
    }
}

/// Eight boxes that do not move. Four lines of the cache.
#[derive(Debug, Clone)]
#[repr(C, align(64))]
pub(super) struct StillNode {
    pub(super) bounds: Sides,
    children: [u32; WIDTH],
}

/// Eight boxes whose planes move linearly: at the segment's begin, and how far they go until its end.
#[derive(Debug, Clone)]
#[repr(C, align(64))]
pub(super) struct MovingNode {
    pub(super) bounds: Sides,
    pub(super) deltas: Sides,
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
        let at = |side: usize| Vec3A::from_array([0, 1, 2].map(|axis| self.bounds[axis][side].0[child]));
        Aabb { lo: at(0), hi: at(1) }
    }
}

fn planes(boxes: &[LinearBox; WIDTH], at_end: bool) -> Sides {
    std::array::from_fn(|axis| {
        std::array::from_fn(|side| {
            Planes(std::array::from_fn(|child| {
                let bounds = if at_end { &boxes[child].end } else { &boxes[child].begin };
                if side == 0 { bounds.lo[axis] } else { bounds.hi[axis] }
            }))
        })
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
        let deltas = std::array::from_fn(|axis| {
            std::array::from_fn(|side| {
                Planes(std::array::from_fn(|child| {
                    let delta: f32 = ends[axis][side].0[child] - bounds[axis][side].0[child];
                    // Empty boxes: ∞ − ∞.
                    if delta.is_nan() { 0.0 } else { delta }
                }))
            })
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
