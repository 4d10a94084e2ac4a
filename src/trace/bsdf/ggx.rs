//! The GGX microfacet distribution (Walter et al. 2007), anisotropic, with Smith's height-correlated masking (Heitz
//! 2014) and sampling of visible normals.
//!
//! All directions are unit vectors of a local basis whose z axis is the surface normal. Formulas are arranged so that
//! grazing directions divide nothing by a vanishing cosine.

use glam::{Vec2, Vec3A};
use std::f32::consts::{PI, TAU};

/// A distribution of facet slopes.
#[derive(Debug, Clone, Copy)]
pub(super) struct Ggx {
    /// Root-mean-square-like widths along x and y, > 0.
    pub(super) alpha: Vec2,
}

impl Ggx {
    /// Density of facet normals `h`, by solid angle and projected area.
    #[inline]
    pub(super) fn density(self, h: Vec3A) -> f32 {
        let (x, y) = (h.x / self.alpha.x, h.y / self.alpha.y);
        let s = x * x + y * y + h.z * h.z;
        1.0 / (PI * self.alpha.x * self.alpha.y * s * s)
    }

    /// |w| after stretching by the roughness: √(z² + αx² x² + αy² y²) = z (1 + 2Λ(w)).
    #[inline]
    pub(super) fn stretched(self, w: Vec3A) -> f32 {
        let (x, y) = (self.alpha.x * w.x, self.alpha.y * w.y);
        (w.z * w.z + x * x + y * y).sqrt()
    }

    /// G₂ / G₁(wo): what remains of a reflected sample's throughput beside Fresnel's factor. In [0, 1].
    #[inline]
    pub(super) fn shadowing(self, wo: Vec3A, wi: Vec3A) -> f32 {
        let (co, ci) = (wo.z.abs(), wi.z.abs());
        let (so, si) = (self.stretched(wo), self.stretched(wi));
        let below = ci * so + co * si;
        if below > 0.0 { ci * (co + so) / below } else { 0.0 }
    }

    /// Density of the visible normals `h` from `wo`, divided by |wo · h|: G₁ D / cosₒ = 2 D / (cosₒ + sₒ).
    #[inline]
    pub(super) fn visible_density(self, wo: Vec3A, h: Vec3A) -> f32 {
        2.0 * self.density(h) / (wo.z.abs() + self.stretched(wo))
    }

    /// Density of reflected directions for facet normal `h`, by solid angle.
    #[inline]
    pub(super) fn reflection_pdf(self, wo: Vec3A, h: Vec3A) -> f32 {
        0.25 * self.visible_density(wo, h)
    }

    /// A facet normal visible from `wo` (z > 0): sampled as a spherical cap (Dupuy and Benyoub 2023).
    #[inline]
    pub(super) fn visible_normal(self, wo: Vec3A, u: Vec2) -> Vec3A {
        self.visible_normal_around(wo, azimuth_from_unit(u.x), u.y)
    }

    /// The same by a point of the circle of azimuths and `u` in [0, 1).
    #[inline]
    pub(super) fn visible_normal_around(self, wo: Vec3A, azimuth: Vec2, u: f32) -> Vec3A {
        let v = Vec3A::new(self.alpha.x * wo.x, self.alpha.y * wo.y, wo.z).normalize();
        // The cap z > −v.z, in the area-preserving form of a cone of 1 − cos = 1 + v.z.
        let c = cap_from_square(azimuth, u, v.z);
        let h = c + v;
        let n = Vec3A::new(self.alpha.x * h.x, self.alpha.y * h.y, h.z.max(0.0));
        let length2 = n.length_squared();
        // c = −v (both at the horizon) has no half vector; the limit is the surface normal.
        if length2 > f32::MIN_POSITIVE { n / length2.sqrt() } else { Vec3A::Z }
    }
}

/// A direction with z in (−`vz`, 1], uniform by solid angle.
#[inline]
fn cap_from_square(azimuth: Vec2, u: f32, vz: f32) -> Vec3A {
    let z = (1.0 - u) * (1.0 + vz) - vz;
    let r = (1.0 - z * z).max(0.0).sqrt();
    Vec3A::new(r * azimuth.x, r * azimuth.y, z)
}

/// The point of the unit circle at `u` of a turn.
#[inline]
pub(super) fn azimuth_from_unit(u: f32) -> Vec2 {
    let (sin, cos) = crate::numeric::sin_cos(TAU * u);
    Vec2::new(cos, sin)
}

/// `wo` mirrored about `h`.
#[inline]
pub(super) fn reflect(wo: Vec3A, h: Vec3A) -> Vec3A {
    2.0 * wo.dot(h) * h - wo
}

/// `wo` bent through a facet `h` (on wo's side), where the far side is `eta` times as dense; `None` is total
/// internal reflection.
#[inline]
pub(super) fn refract(wo: Vec3A, h: Vec3A, eta: f32) -> Option<Vec3A> {
    let cos = wo.dot(h);
    let sin2 = (1.0 - cos * cos).max(0.0) / (eta * eta);
    if sin2 >= 1.0 {
        return None;
    }
    let cos_t = (1.0 - sin2).sqrt();
    Some((cos / eta - cos_t) * h - wo / eta)
}
