//! Sampling a triangle seen from a point: by solid angle where it is large, by area where it is tiny.

use crate::trace::warp::{tangents_of, triangle_from_square, uniform_hemisphere_from_square, uniform_hemisphere_pdf};
use glam::{DVec3, Vec2, Vec3A};

/// Least solid angle, sr, that is sampled as a spherical triangle. Below, the triangle is 2.5 degrees wide or seen
/// edge-on, the density hardly varies over it, and area sampling costs a tenth. (In f64 the spherical formulas would
/// hold to 1e-9 sr: the limit is one of cost, where that of f32 would be one of accuracy, 1000 γ₁₆.)
pub(super) const LEAST_SOLID_ANGLE: f32 = 1e-3;

/// Greatest solid angle that is sampled as a spherical triangle: beyond, the point all but touches the triangle and
/// its edges run through opposite directions, which leaves arcs undefined. Then the whole half space before the
/// triangle's plane is sampled instead; the 1 % of directions that pass beside the triangle give nothing.
const MOST_SOLID_ANGLE: f32 = std::f32::consts::TAU - 0.06;

/// How a triangle is sampled.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Way {
    Area,
    SolidAngle,
    HalfSpace,
}

/// A triangle relative to the receiving point.
#[derive(Debug, Clone, Copy)]
pub(super) struct SeenTriangle {
    /// Corners minus the point.
    corners: [Vec3A; 3],
    /// Twice the area times the unit normal.
    normal2: Vec3A,
    solid_angle: f32,
}

/// A point on a seen triangle or rectangle.
#[derive(Debug, Clone, Copy)]
pub(super) struct ShapeSample {
    /// Unit direction from the point.
    pub(super) wi: Vec3A,
    pub(super) distance: f32,
    /// Barycentric weights of the second and third corner; of a rectangle, the parts of its two edges.
    pub(super) place: Vec2,
    pub(super) pdf_solid_angle: f32,
}

impl SeenTriangle {
    /// `corners` as seen from `from`; `None` for triangles without area.
    #[inline]
    pub(super) fn new(corners: [Vec3A; 3], from: Vec3A) -> Option<Self> {
        let [a, b, c] = corners.map(|v| v - from);
        let normal2 = (corners[1] - corners[0]).cross(corners[2] - corners[0]);
        // Its square may leave f32 where itself does not: the largest component decides.
        if normal2.abs().max_element() < f32::MIN_POSITIVE || !normal2.is_finite() {
            return None;
        }
        // Van Oosterom and Strackee (1983), in f64: seen from near a large triangle its corners lie in almost opposite
        // directions and the sum below cancels to (distance / size)² of its terms. The triple product is that of edge
        // differences, which keeps its relative accuracy however small the triangle looks.
        let [da, db, dc] = [a, b, c].map(|v| v.as_dvec3());
        let (la, lb, lc) = (da.length(), db.length(), dc.length());
        let volume = da.dot((db - da).cross(dc - da)).abs();
        let below = la * lb * lc + da.dot(db) * lc + db.dot(dc) * la + dc.dot(da) * lb;
        let solid_angle = 2.0 * angle_of(volume, below);
        Some(Self { corners: [a, b, c], normal2, solid_angle })
    }

    /// On which side of the triangle the point is: positive in front (counter-clockwise corners).
    #[inline]
    pub(super) fn facing(&self) -> f32 {
        -self.normal2.dot(self.corners[0])
    }

    #[inline]
    fn way(&self) -> Way {
        if self.solid_angle >= MOST_SOLID_ANGLE {
            Way::HalfSpace
        } else if self.solid_angle >= LEAST_SOLID_ANGLE {
            Way::SolidAngle
        } else {
            Way::Area
        }
    }

    /// Density by solid angle of the direction `wi` (unit), which meets the triangle at `distance`.
    #[inline]
    pub(super) fn pdf(&self, wi: Vec3A, distance: f32) -> f32 {
        match self.way() {
            Way::HalfSpace => uniform_hemisphere_pdf(),
            Way::SolidAngle => 1.0 / self.solid_angle,
            Way::Area => {
                // Area is half of |normal2|: pdf = d² / (A |cos|).
                let flux = 0.5 * self.normal2.dot(wi).abs();
                if flux > 0.0 { (distance / flux * distance).min(f32::MAX) } else { 0.0 }
            }
        }
    }

    /// A direction towards the triangle.
    #[inline]
    pub(super) fn sample(&self, u: Vec2) -> Option<ShapeSample> {
        let wi = match self.way() {
            Way::Area => return self.by_area(u),
            Way::SolidAngle => self.spherical(u)?,
            Way::HalfSpace => self.before_plane(u)?,
        };
        let distance = self.normal2.dot(self.corners[0]) / self.normal2.dot(wi);
        if !(distance.is_finite() && distance > 0.0) {
            return None;
        }
        let barycentric = self.barycentric(wi * distance);
        Some(ShapeSample { wi, distance, place: barycentric, pdf_solid_angle: self.pdf(wi, distance) })
    }

    fn by_area(&self, u: Vec2) -> Option<ShapeSample> {
        let barycentric = triangle_from_square(u);
        let [a, b, c] = self.corners;
        let to = a * (1.0 - barycentric.x - barycentric.y) + b * barycentric.x + c * barycentric.y;
        let distance = to.length();
        if distance <= 0.0 || !distance.is_finite() {
            return None;
        }
        let wi = to / distance;
        let pdf_solid_angle = self.pdf(wi, distance);
        (pdf_solid_angle > 0.0).then_some(ShapeSample { wi, distance, place: barycentric, pdf_solid_angle })
    }

    /// A direction uniform over the half space before the plane; `None` beside the triangle.
    fn before_plane(&self, u: Vec2) -> Option<Vec3A> {
        let towards = (self.normal2 / self.normal2.abs().max_element()).normalize();
        let towards = if self.facing() > 0.0 { -towards } else { towards };
        let (t, b) = tangents_of(towards);
        let w = uniform_hemisphere_from_square(u);
        let wi = (t * w.x + b * w.y + towards * w.z).normalize();
        // Inside, if it lies on the same side of all three planes through the point and an edge.
        let [a, b, c] = self.corners.map(Vec3A::normalize);
        let sides = [a.cross(b), b.cross(c), c.cross(a)].map(|n| n.dot(wi));
        let inside = sides.iter().all(|&s| s >= 0.0) || sides.iter().all(|&s| s <= 0.0);
        inside.then_some(wi)
    }

    /// Barycentric weights of a point of the plane, clamped to the triangle.
    fn barycentric(&self, p: Vec3A) -> Vec2 {
        let [a, b, c] = self.corners;
        // Scaled, so that no square leaves f32.
        let n = self.normal2 / self.normal2.abs().max_element();
        let whole = self.normal2.dot(n);
        let v = (p - a).cross(c - a).dot(n) / whole;
        let w = (b - a).cross(p - a).dot(n) / whole;
        let (v, w) = (v.clamp(0.0, 1.0), w.clamp(0.0, 1.0));
        let over = (v + w).max(1.0);
        Vec2::new(v / over, w / over)
    }

    /// A direction uniform over the spherical triangle (Arvo 1995, "Stratified Sampling of Spherical Triangles"), in
    /// f64: arcs between almost opposite corners are otherwise lost.
    fn spherical(&self, u: Vec2) -> Option<Vec3A> {
        let [a, b, c] = self.corners.map(|v| v.as_dvec3().normalize());
        // Arcs run from b to the side ac. That must be the longest: from a corner almost opposite to another, all
        // arcs would start out through that one.
        let (ab, bc, ca) = (a.dot(b), b.dot(c), c.dot(a));
        let (a, b, c) = if ca <= ab && ca <= bc {
            (a, b, c)
        } else if ab <= bc {
            (b, c, a)
        } else {
            (c, a, b)
        };
        let normal_of = |x: DVec3, y: DVec3| x.cross(y).try_normalize();
        let (ab, ca) = (normal_of(a, b)?, normal_of(c, a)?);
        let (sin_alpha, cos_alpha) = (ab.cross(ca).length(), -ab.dot(ca));
        // The part of the area that lies before the sampled arc through b; the angle φ − α of Arvo's formulas is that
        // and π.
        let (sin_area, cos_area) = libm::sincos(f64::from(u.x) * f64::from(self.solid_angle));
        let sin_phi = cos_area * sin_alpha - sin_area * cos_alpha;
        let cos_phi = -cos_area * cos_alpha - sin_area * sin_alpha;
        let k1 = cos_phi + cos_alpha;
        let k2 = sin_phi - sin_alpha * a.dot(b);
        let below = (k2 * sin_phi + k1 * cos_phi) * sin_alpha;
        let cos_bp = ((k2 + (k2 * cos_phi - k1 * sin_phi) * cos_alpha) / below).clamp(-1.0, 1.0);
        if !cos_bp.is_finite() {
            return None;
        }
        let sin_bp = (1.0 - cos_bp * cos_bp).max(0.0).sqrt();
        let across = |v: DVec3, n: DVec3| (v - n * v.dot(n)).try_normalize();
        let cp = (a * cos_bp + across(c, a)? * sin_bp).normalize();
        // 1 − cos of the arc from b to cp, from their distance: no cancellation for short arcs.
        let z = f64::from(u.y) * 0.5 * (cp - b).length_squared();
        let sin = (z * (2.0 - z)).max(0.0).sqrt();
        let wi = b * (1.0 - z) + across(cp, b).unwrap_or(DVec3::ZERO) * sin;
        wi.as_vec3a().try_normalize()
    }
}

/// The angle of the vector (`x`, `y`), radians, from −π to π: of numbers of any size, in the precision of the result.
#[allow(clippy::cast_possible_truncation, reason = "their ratio is what counts, and f32 keeps it")]
pub(super) fn angle_of(y: f64, x: f64) -> f32 {
    let size = x.abs().max(y.abs());
    if size > 0.0 { libm::atan2f((y / size) as f32, (x / size) as f32) } else { 0.0 }
}
