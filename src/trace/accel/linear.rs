//! Boxes, boxes that move linearly, and bounds of what moves otherwise.

use crate::numeric::UNIT_ROUNDOFF;
use glam::{Affine3A, Vec3A};

/// An axis-aligned box.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Aabb {
    /// Least coordinates.
    pub lo: Vec3A,
    /// Greatest coordinates.
    pub hi: Vec3A,
}

impl Aabb {
    /// The box that holds nothing: lower end +∞, upper −∞.
    pub const EMPTY: Self = Self { lo: Vec3A::INFINITY, hi: Vec3A::NEG_INFINITY };

    /// The smallest box around `points`.
    pub fn around(points: impl IntoIterator<Item = Vec3A>) -> Self {
        points.into_iter().fold(Self::EMPTY, |b, p| Self { lo: b.lo.min(p), hi: b.hi.max(p) })
    }

    /// Whether it holds nothing.
    #[must_use]
    #[inline(always)]
    pub fn is_empty(&self) -> bool {
        !self.lo.cmple(self.hi).all()
    }

    /// The smallest box around both.
    #[must_use]
    pub fn join(&self, other: &Self) -> Self {
        Self { lo: self.lo.min(other.lo), hi: self.hi.max(other.hi) }
    }

    /// The middle.
    #[must_use]
    pub fn centre(&self) -> Vec3A {
        self.lo * 0.5 + self.hi * 0.5
    }

    /// Length of the diagonal; 0 for an empty box.
    #[must_use]
    pub fn diagonal(&self) -> f32 {
        if self.is_empty() { 0.0 } else { (self.hi - self.lo).length() }
    }

    /// The greatest absolute coordinate; 0 for an empty box.
    #[must_use]
    pub fn magnitude(&self) -> f32 {
        if self.is_empty() { 0.0 } else { self.lo.abs().max(self.hi.abs()).max_element() }
    }

    /// Widened by `pad` on every side.
    #[must_use]
    pub fn widened(&self, pad: Vec3A) -> Self {
        Self { lo: self.lo - pad, hi: self.hi + pad }
    }

    /// The box around its image under `transform`, roundings included.
    ///
    /// Centre and half size are transformed (Arvo 1990). Each coordinate is a sum of four products of numbers that
    /// themselves carry a rounding: less than 8u of the sum of absolute values bounds both ends' errors.
    #[must_use]
    pub fn transformed(&self, transform: &Affine3A) -> Self {
        if self.is_empty() {
            return Self::EMPTY;
        }
        let (centre, half) = (self.centre(), (self.hi * 0.5 - self.lo * 0.5));
        let m = absolute(transform);
        let (middle, reach) = (transform.transform_point3a(centre), m.transform_vector3a(half));
        let pad = m.transform_point3a(centre.abs() + half) * (8.0 * UNIT_ROUNDOFF) + Vec3A::splat(f32::MIN_POSITIVE);
        Self { lo: middle - reach - pad, hi: middle + reach + pad }
    }
}

/// The transform with absolute entries.
pub(in crate::trace) fn absolute(t: &Affine3A) -> Affine3A {
    let mut m = *t;
    m.matrix3.x_axis = m.matrix3.x_axis.abs();
    m.matrix3.y_axis = m.matrix3.y_axis.abs();
    m.matrix3.z_axis = m.matrix3.z_axis.abs();
    m.translation = m.translation.abs();
    m
}

/// A box whose planes move linearly from `begin` to `end`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct LinearBox {
    pub(super) begin: Aabb,
    pub(super) end: Aabb,
}

impl LinearBox {
    pub(super) const EMPTY: Self = Self { begin: Aabb::EMPTY, end: Aabb::EMPTY };

    /// A box that stands still.
    pub(super) fn still(bounds: Aabb) -> Self {
        Self { begin: bounds, end: bounds }
    }

    /// Around both at every time: the ends of a linear motion bound it between them.
    pub(super) fn join(&self, other: &Self) -> Self {
        Self { begin: self.begin.join(&other.begin), end: self.end.join(&other.end) }
    }

    /// The box at mid-time, on which the tree's shape is decided.
    pub(super) fn middle(&self) -> Aabb {
        Aabb { lo: self.begin.lo * 0.5 + self.end.lo * 0.5, hi: self.begin.hi * 0.5 + self.end.hi * 0.5 }
    }

    /// Around its whole motion.
    pub(super) fn swept(&self) -> Aabb {
        self.begin.join(&self.end)
    }

    /// Widened so that planes computed in `f32` as `begin + f · (end − begin)` enclose vertices computed as
    /// `a + f · (b − a)`.
    ///
    /// With M the greatest absolute coordinate, each difference is at most 2M and carries u·2M; times f another u·2M;
    /// the sum u·(1 + 4u)·M: each side errs by at most 5uM + O(u²), together less than 12uM. Denormal products lose
    /// less than the least normal number.
    pub(super) fn padded(&self) -> Self {
        if self.begin == self.end || self.begin.is_empty() {
            return *self;
        }
        let most = self.begin.magnitude().max(self.end.magnitude());
        let pad = Vec3A::splat(12.0 * UNIT_ROUNDOFF * most + f32::MIN_POSITIVE);
        Self { begin: self.begin.widened(pad), end: self.end.widened(pad) }
    }
}
