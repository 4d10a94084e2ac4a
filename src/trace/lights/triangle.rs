//! Sampling a triangle seen from a point: by solid angle where it is large, by area where it is tiny.

use crate::numeric::{gamma, sin_cos};
use crate::trace::warp::triangle_from_square;
use glam::{Vec2, Vec3A};
use std::f32::consts::PI;

/// Least solid angle, sr, that is sampled as a spherical triangle.
///
/// The angles of the sampled sub-triangle err by γ₁₆ while they carry the solid angle as their excess over π: at this
/// limit the area placed is wrong by a thousandth at most. A smaller triangle is 2.5 degrees wide or seen edge-on.
const LEAST_SOLID_ANGLE: f32 = 1000.0 * gamma(16);

/// Greatest solid angle that is sampled as a spherical triangle: beyond, the point all but touches the triangle and
/// its edges run through opposite directions, which leaves arcs undefined. The same margin from 2π as above from 0.
const MOST_SOLID_ANGLE: f32 = 2.0 * PI - 0.06;

/// A triangle relative to the receiving point.
#[derive(Debug, Clone, Copy)]
pub(super) struct SeenTriangle {
    /// Corners minus the point.
    corners: [Vec3A; 3],
    /// Twice the area times the unit normal.
    normal2: Vec3A,
    solid_angle: f32,
}

/// A point on a seen triangle.
#[derive(Debug, Clone, Copy)]
pub(super) struct TriangleSample {
    /// Unit direction from the point.
    pub(super) wi: Vec3A,
    pub(super) distance: f32,
    /// Barycentric weights of the second and third corner.
    pub(super) barycentric: Vec2,
    pub(super) pdf_solid_angle: f32,
}

impl SeenTriangle {
    /// `corners` as seen from `from`; `None` for triangles without area.
    #[inline]
    pub(super) fn new(corners: [Vec3A; 3], from: Vec3A) -> Option<Self> {
        let [a, b, c] = corners.map(|v| v - from);
        let normal2 = (corners[1] - corners[0]).cross(corners[2] - corners[0]);
        if normal2.length_squared() < f32::MIN_POSITIVE || !normal2.is_finite() {
            return None;
        }
        // Van Oosterom and Strackee (1983), with the triple product from edge differences: it keeps its relative
        // accuracy however small the triangle looks, where that of unit vectors cancels.
        let (la, lb, lc) = (a.length(), b.length(), c.length());
        let volume = a.dot(normal2).abs();
        let below = la * lb * lc + a.dot(b) * lc + b.dot(c) * la + c.dot(a) * lb;
        let solid_angle = 2.0 * libm::atan2f(volume, below);
        Some(Self { corners: [a, b, c], normal2, solid_angle })
    }

    /// On which side of the triangle the point is: positive in front (counter-clockwise corners).
    #[inline]
    pub(super) fn facing(&self) -> f32 {
        -self.normal2.dot(self.corners[0])
    }

    #[inline]
    fn by_solid_angle(&self) -> bool {
        (LEAST_SOLID_ANGLE..MOST_SOLID_ANGLE).contains(&self.solid_angle)
    }

    /// Density by solid angle of the direction `wi` (unit), which meets the triangle at `distance`.
    #[inline]
    pub(super) fn pdf(&self, wi: Vec3A, distance: f32) -> f32 {
        if self.by_solid_angle() {
            return 1.0 / self.solid_angle;
        }
        // Area is half of |normal2|: pdf = d² / (A |cos|).
        let flux = 0.5 * self.normal2.dot(wi).abs();
        if flux > 0.0 { (distance * distance / flux).min(f32::MAX) } else { 0.0 }
    }

    /// A direction towards the triangle.
    #[inline]
    pub(super) fn sample(&self, u: Vec2) -> Option<TriangleSample> {
        if self.by_solid_angle()
            && let Some(wi) = self.spherical(u)
        {
            let along = self.normal2.dot(wi);
            let distance = self.normal2.dot(self.corners[0]) / along;
            if !(distance.is_finite() && distance > 0.0) {
                return None;
            }
            let barycentric = self.barycentric(wi * distance);
            return Some(TriangleSample { wi, distance, barycentric, pdf_solid_angle: 1.0 / self.solid_angle });
        }
        let barycentric = triangle_from_square(u);
        let [a, b, c] = self.corners;
        let to = a * (1.0 - barycentric.x - barycentric.y) + b * barycentric.x + c * barycentric.y;
        let distance = to.length();
        if distance <= 0.0 || !distance.is_finite() {
            return None;
        }
        let wi = to / distance;
        let pdf_solid_angle = if self.by_solid_angle() { 1.0 / self.solid_angle } else { self.pdf(wi, distance) };
        (pdf_solid_angle > 0.0).then_some(TriangleSample { wi, distance, barycentric, pdf_solid_angle })
    }

    /// Barycentric weights of a point of the plane, clamped to the triangle.
    fn barycentric(&self, p: Vec3A) -> Vec2 {
        let [a, b, c] = self.corners;
        let scale = 1.0 / self.normal2.length_squared();
        let v = (p - a).cross(c - a).dot(self.normal2) * scale;
        let w = (b - a).cross(p - a).dot(self.normal2) * scale;
        let (v, w) = (v.clamp(0.0, 1.0), w.clamp(0.0, 1.0));
        let over = (v + w).max(1.0);
        Vec2::new(v / over, w / over)
    }

    /// A direction uniform over the spherical triangle (Arvo 1995, "Stratified Sampling of Spherical Triangles").
    fn spherical(&self, u: Vec2) -> Option<Vec3A> {
        let [a, b, c] = self.corners.map(Vec3A::normalize);
        let normal_of = |x: Vec3A, y: Vec3A| x.cross(y).try_normalize();
        let (ab, bc, ca) = (normal_of(a, b)?, normal_of(b, c)?, normal_of(c, a)?);
        let alpha = angle_between(ab, -ca);
        let beta = angle_between(bc, -ab);
        let gamma = angle_between(ca, -bc);
        // The part of the area that lies before the sampled arc through b.
        let area = PI * (1.0 - u.x) + (alpha + beta + gamma) * u.x;
        let (sin_alpha, cos_alpha) = sin_cos(alpha);
        let (sin_area, cos_area) = sin_cos(area);
        let sin_phi = sin_area * cos_alpha - cos_area * sin_alpha;
        let cos_phi = cos_area * cos_alpha + sin_area * sin_alpha;
        let k1 = cos_phi + cos_alpha;
        let k2 = sin_phi - sin_alpha * a.dot(b);
        let below = (k2 * sin_phi + k1 * cos_phi) * sin_alpha;
        let cos_bp = ((k2 + (k2 * cos_phi - k1 * sin_phi) * cos_alpha) / below).clamp(-1.0, 1.0);
        if !cos_bp.is_finite() {
            return None;
        }
        let sin_bp = (1.0 - cos_bp * cos_bp).max(0.0).sqrt();
        let across = |v: Vec3A, n: Vec3A| (v - n * v.dot(n)).try_normalize();
        let cp = (a * cos_bp + across(c, a)? * sin_bp).normalize();
        // 1 − cos of the arc from b to cp, from their distance: no cancellation for short arcs.
        let z = u.y * 0.5 * (cp - b).length_squared();
        let sin = (z * (2.0 - z)).max(0.0).sqrt();
        let wi = b * (1.0 - z) + across(cp, b).unwrap_or(Vec3A::ZERO) * sin;
        wi.try_normalize()
    }
}

fn angle_between(a: Vec3A, b: Vec3A) -> f32 {
    libm::atan2f(a.cross(b).length(), a.dot(b))
}
