//! Local bases: interpolated and mapped normals, kept consistent with the true surface.

use crate::trace::warp::tangents_of;
use glam::{Vec2, Vec3A, Vec4};

/// An orthonormal basis with z along the shading normal.
#[derive(Debug, Clone, Copy)]
pub(super) struct Basis {
    pub(super) t: Vec3A,
    pub(super) b: Vec3A,
    pub(super) n: Vec3A,
}

impl Basis {
    /// About `n`, with t as near to `tangent` as it can be (any, where the tangent is missing or parallel to `n`).
    pub(super) fn new(n: Vec3A, tangent: Vec3A) -> Self {
        let t = tangent - n * n.dot(tangent);
        let length2 = t.length_squared();
        // Below, what is left of the tangent is its own rounding.
        if length2 <= crate::numeric::gamma(16) * tangent.length_squared() {
            let (t, b) = tangents_of(n);
            return Self { t, b, n };
        }
        let t = t / length2.sqrt();
        Self { t, b: n.cross(t), n }
    }

    /// This basis with its tangents turned counter-clockwise by the angle with the given cosine and sine.
    pub(super) fn turned(self, cos: f32, sin: f32) -> Self {
        Self { t: self.t * cos + self.b * sin, b: self.b * cos - self.t * sin, n: self.n }
    }

    #[inline]
    pub(super) fn local(&self, w: Vec3A) -> Vec3A {
        Vec3A::new(self.t.dot(w), self.b.dot(w), self.n.dot(w))
    }

    #[inline]
    pub(super) fn world(&self, w: Vec3A) -> Vec3A {
        self.t * w.x + self.b * w.y + self.n * w.z
    }
}

/// The normal that a tangent-space normal map gives: `value` is the texel in [0, 1], `scale` multiplies x and y; the
/// tangent space is MikkTSpace's, bitangent = handedness · n × t, unorthogonalised as it prescribes.
pub(super) fn mapped_normal(n: Vec3A, tangent: Vec4, value: Vec4, scale: f32) -> Vec3A {
    let t = Vec3A::from_vec4(tangent);
    if t.length_squared() <= 0.0 {
        return n;
    }
    let xy = (Vec2::new(value.x, value.y) * 2.0 - 1.0) * scale;
    let bitangent = n.cross(t) * tangent.w;
    (t * xy.x + bitangent * xy.y + n * (value.z * 2.0 - 1.0)).try_normalize().unwrap_or(n)
}

/// `n` turned just so far that the mirror image of `wo` leaves above the true surface `ng` (which `wo` sees from its
/// front): the remedy for black spots of mapped and interpolated normals (Keller et al. 2017, "The Iray Light
/// Transport Simulation and Rendering System", appendix A.3).
pub(super) fn visible_normal(n: Vec3A, ng: Vec3A, wo: Vec3A) -> Vec3A {
    // A mapped normal may point into the surface; its mirror image has the same slopes and points out.
    let n = if n.dot(ng) < 0.0 { -n } else { n };
    let cos = ng.dot(wo);
    // The reflected direction is lifted to a quarter of the view's own height: continuous, and never more than the
    // unperturbed surface would give.
    let least = 0.25 * cos;
    let reflected = 2.0 * n.dot(wo) * n - wo;
    let height = reflected.dot(ng);
    if height >= least {
        return n;
    }
    let lifted = (reflected + ng * (least - height)).normalize();
    (wo + lifted).try_normalize().unwrap_or(ng)
}
