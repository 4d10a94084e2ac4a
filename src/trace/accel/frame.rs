//! A ray made ready for one structure: sheared axes for triangles, padded slabs for boxes.

use super::linear::Aabb;
use super::node::Offset;
use crate::numeric::UNIT_ROUNDOFF;
use Axis::{X, Y, Z};
use glam::Vec3A;

/// What the tests of one ray against boxes and triangles of one space share.
///
/// Triangles are tested after Woop, Benthin and Wald (2013, *Watertight Ray/Triangle Intersection*): coordinates relative
/// to the origin, sheared so that the ray becomes the axis of its largest component, `k[2]`.
///
/// # Why no box hides a triangle that the triangle test would hit
/// With u the unit roundoff, a vertex A (relative to the origin) gets sheared coordinates x' = x − S·z with errors of
/// u|x| (subtraction of the origin), 4u|S z| (one in z, two in S, one in the product; |S| ≤ 1) and u(|x| + |z|) (the last
/// subtraction): at most 2u|x| + 5u|z| + O(u²), so the triangle test sees vertices moved by less than
/// 6u(max|x| + max|z|), maxima over the structure's bounds. Boxes widened by as much enclose the moved triangles; the
/// widening is put on the origin, with 2u|origin| more for rounding the sum (5u are taken): `entry_origin`.
///
/// A plane p is met at T = (p − O) / d, computed as p·r − c with r = 1/d and c = O·r rounded: in one rounding where the
/// processor fuses both, in two elsewhere. The roundings of c and of the product are as if O were moved by u|O| and by
/// u|p| ≤ u(|origin| + reach): 2u(max|x| + max|z|) and 5u|origin| pay for them and for rounding both; O lies as far beyond
/// `entry_origin` as that beyond the origin, which is more. What is left is relative, one rounding of r and one of the
/// difference: near ≤ near*(1 + γ₂) and far ≥ far*(1 − γ₂) for exact near* ≤ far*. Scaling far by 1 + 2γ₂ makes near ≤ far
/// certain (Ize 2013, *Robust BVH Ray Traversal*); `far_inverse` holds that factor, with 10u ≥ 2γ₂ + the factor's own
/// roundings.
///
/// Where d vanishes r would be infinite and the difference no number: a component is at least 2⁻⁶⁰ of the largest, which
/// moves the ray by less than 2⁻⁶⁰ of its way, far below u.
#[derive(Debug, Clone)]
pub(super) struct RayFrame {
    /// The ray's origin.
    pub(super) origin: Vec3A,
    /// The ray's direction.
    pub(super) direction: Vec3A,
    /// Axes in the order x', y', z' of the sheared space; winding is kept.
    pub(super) k: [Axis; 3],
    /// The direction's largest component, > 0.
    pub(super) speed: f32,
    /// The origin along x', y', z'.
    pub(super) start: [f32; 3],
    /// Shear of x', of y', and scale of z'.
    pub(super) shear: [f32; 3],
    /// Origin moved outward, against the direction, by what the triangle test may be wrong.
    pub(super) entry_origin: Vec3A,
    /// Minus the origin, moved farther outward for the planes of entry, times `near_inverse`, by axis.
    pub(super) near_shift: Vec3A,
    /// Minus the origin, moved outward for the planes of exit, times `far_inverse`.
    pub(super) far_shift: Vec3A,
    /// Reciprocal of the direction.
    pub(super) near_inverse: Vec3A,
    /// The same, a little larger.
    pub(super) far_inverse: Vec3A,
    /// Which plane of each axis is entered first, and which is left last.
    pub(super) planes: &'static PlaneOrder,
    /// Bit of each axis: set where the upper plane of a box is entered first.
    backward: usize,
}

/// Where the planes that a ray enters and leaves stand among those of eight boxes, by axis.
#[derive(Debug, Clone, Copy)]
pub(super) struct PlaneOrder {
    pub(super) near: [Offset; 3],
    pub(super) far: [Offset; 3],
}

impl PlaneOrder {
    /// By [`RayFrame::backward`]: a node need not work it out.
    const ALL: &[Self; 8] = &{
        let mut all = [Self { near: [Offset::of(0, 0); 3], far: [Offset::of(0, 0); 3] }; 8];
        let mut i = 0;
        while i < 24 {
            let (backward, axis) = (i / 3, i % 3);
            let near = backward >> axis & 1;
            all[backward].near[axis] = Offset::of(axis, near);
            all[backward].far[axis] = Offset::of(axis, near ^ 1);
            i += 1;
        }
        all
    };
}

impl RayFrame {
    /// The frame for a ray among things within `bounds`.
    #[inline]
    pub(super) fn new(origin: Vec3A, direction: Vec3A, bounds: &Aabb) -> Self {
        let size = direction.abs();
        // Which of two components is the greater: x and y, x and z, y and z; and the signs of all. No branch: rays of all
        // directions follow each other.
        let greater = Vec3A::new(size.x, size.x, size.y).cmpgt(Vec3A::new(size.y, size.z, size.z)).bitmask() as usize;
        let z = LARGEST[greater & 7];
        let [x, y, _] = ORDERS[z as usize][direction.is_negative_bitmask() as usize >> z as usize & 1];
        // As arrays: a vector's component of a number known late is found by branches.
        let (o, d) = (origin.to_array(), direction.to_array());
        let along = |axis: Axis, v: &[f32; 3]| v[axis as usize];
        let reach = (bounds.lo - origin).abs().max((bounds.hi - origin).abs());
        let (size_z, reach_z) = (along(z, &d).abs(), Vec3A::splat(along(z, &reach.to_array())));
        let pad = (reach + reach_z) * (6.0 * UNIT_ROUNDOFF) + origin.abs() * (5.0 * UNIT_ROUNDOFF);
        let inverse = size.max(Vec3A::splat(size_z * LEAST_COMPONENT)).copysign(direction).recip();
        let far_inverse = inverse * (1.0 + 10.0 * UNIT_ROUNDOFF);
        // The largest component is never replaced.
        let inverse_z = along(z, &inverse.to_array());
        let backward = inverse.is_negative_bitmask() as usize & 7;
        let outward = pad.copysign(inverse);
        let farther = outward + outward;
        Self {
            origin,
            direction,
            k: [x, y, z],
            speed: size_z,
            start: [x, y, z].map(|axis| along(axis, &o)),
            shear: [along(x, &d) * inverse_z, along(y, &d) * inverse_z, inverse_z],
            entry_origin: origin + outward,
            near_shift: (-origin - farther) * inverse,
            far_shift: (farther - origin) * far_inverse,
            near_inverse: inverse,
            far_inverse,
            planes: &PlaneOrder::ALL[backward],
            backward,
        }
    }

    /// Whether the box is met no farther than `limit`: tested as the boxes of nodes are.
    #[inline(always)]
    pub(super) fn meets(&self, bounds: &Aabb, limit: f32) -> bool {
        let near = (bounds.lo * self.near_inverse).min(bounds.hi * self.near_inverse) + self.near_shift;
        let far = (bounds.lo * self.far_inverse).max(bounds.hi * self.far_inverse) + self.far_shift;
        // In this order what is no number never decides.
        near.max(Vec3A::ZERO).max_element() <= far.min(Vec3A::splat(limit)).min_element()
    }

    /// Where the box spanned by `lo` and `hi` is entered: no box that encloses it is entered later, however its test was
    /// rounded. That test saw an origin farther outward by more than all its roundings but two, and those, with the three
    /// here, are less than [`ENTRY_MARGIN`].
    #[inline]
    pub(super) fn entry(&self, lo: Vec3A, hi: Vec3A) -> f32 {
        let mut near = 0.0_f32;
        for axis in [2, 1, 0] {
            let plane = if self.backward >> axis & 1 == 0 { lo[axis] } else { hi[axis] };
            let t = (plane - self.entry_origin[axis]) * self.near_inverse[axis];
            if t > near {
                near = t;
            }
        }
        near * ENTRY_MARGIN
    }
}

/// A coordinate axis. An index into three numbers that needs no check.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(u8)]
pub(super) enum Axis {
    X,
    Y,
    Z,
}

/// The largest component, by which of two is the greater: bit 0 of x and y, bit 1 of x and z, bit 2 of y and z.
const LARGEST: [Axis; 8] = [Z, Z, Z, X, Y, Z, Y, X];

/// The axes x', y', z' by the largest component and whether it is negative.
const ORDERS: [[[Axis; 3]; 2]; 3] = [[[Y, Z, X], [Z, Y, X]], [[Z, X, Y], [X, Z, Y]], [[X, Y, Z], [Y, X, Z]]];

/// The least component of a direction that boxes see, relative to its largest.
const LEAST_COMPONENT: f32 = 1.0 / (1_u64 << 60) as f32;

/// Six roundings: two of a box's test, three of [`RayFrame::entry`], one of this product.
const ENTRY_MARGIN: f32 = 1.0 + 8.0 * UNIT_ROUNDOFF;
