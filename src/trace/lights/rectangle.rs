//! Sampling a rectangle seen from a point: by solid angle where it is large, by area where it is tiny.
//!
//! After Ureña, Fajardo and King (2013, "An Area-Preserving Parametrization for Spherical Rectangles"), in f64, with the
//! angles of the spherical rectangle replaced by their sines and cosines: one arc tangent and one sine remain.

use super::tree::Extent;
use super::triangle::{LEAST_SOLID_ANGLE, ShapeSample, angle_of};
use crate::numeric::gamma;
use glam::{DVec3, Vec2, Vec3A};
use std::f32::consts::TAU;

/// A rectangle in the world: a corner and the two edges from it, whose cross product points to its front.
#[derive(Debug, Clone, Copy)]
pub(super) struct Rectangle {
    corner: Vec3A,
    edges: [Vec3A; 2],
    /// Unit vectors along the edges, and the normal.
    axes: [DVec3; 3],
    /// The edges' lengths.
    size: [f64; 2],
}

impl Rectangle {
    /// The rectangle that two triangles make which share their longest edge; `None` if they do not. `winding` is 1
    /// where their corners run counter-clockwise seen from the front, −1 where clockwise.
    pub(super) fn of_triangles(first: &[Vec3A; 3], second: &[Vec3A; 3], winding: f32) -> Option<Self> {
        for i in 0..3 {
            let [a, b, corner] = [0, 1, 2].map(|k| first[(i + k) % 3]);
            let Some(j) = (0..3).find(|&j| second[j] == b && second[(j + 1) % 3] == a) else { continue };
            let opposite = second[(j + 2) % 3];
            let (ex, ey) = (a - corner, b - corner);
            let size = ex.length().min(ey.length());
            // Corners come out of a transform in f32; what is rectangular but for its rounding is sampled as such.
            let rounding = gamma(16) * first.iter().chain(second).fold(0.0_f32, |m, p| m.max(p.abs().max_element()));
            let closes = (opposite - (corner + ex + ey)).abs().max_element() <= rounding;
            let square = ex.dot(ey).abs() <= 2.0 * rounding * (ex.length() + ey.length());
            let large = size > 1024.0 * rounding;
            let edges = if winding > 0.0 { [ex, ey] } else { [ey, ex] };
            return if closes && square && large { Self::new(corner, edges) } else { None };
        }
        None
    }

    /// `None` for one without area.
    fn new(corner: Vec3A, edges: [Vec3A; 2]) -> Option<Self> {
        let [ex, ey] = edges.map(|e| e.as_dvec3());
        let size = [ex.length(), ey.length()];
        let (ax, ay) = (ex / size[0], ey / size[1]);
        let n = ax.cross(ay);
        n.is_finite().then_some(Self { corner, edges, axes: [ax, ay, n], size })
    }

    /// How it looks in the tree, with radiance of luminance `emission`.
    pub(super) fn extent(&self, emission: f32, double_sided: bool) -> Extent {
        let [ex, ey] = self.edges;
        let normal2 = ex.cross(ey);
        let corners = [self.corner, self.corner + ex, self.corner + ey, self.corner + ex + ey];
        let low = corners.iter().fold(Vec3A::INFINITY, |m, &c| m.min(c));
        let high = corners.iter().fold(Vec3A::NEG_INFINITY, |m, &c| m.max(c));
        let strength = normal2.length() * emission;
        Extent {
            boxes: [[low.into(), high.into()]; 2],
            axis: normal2.normalize().into(),
            cos_normals: if double_sided { -1.0 } else { 1.0 },
            cos_emission: 0.0,
            strength: if strength.is_finite() { strength } else { f32::MAX },
        }
    }
}

/// A rectangle relative to the receiving point.
#[derive(Debug, Clone, Copy)]
pub(super) struct SeenRectangle<'a> {
    rectangle: &'a Rectangle,
    /// The edges' ends along the axes, with the receiving point at 0.
    x: [f64; 2],
    y: [f64; 2],
    /// The plane along its normal: negative where the point is before the front.
    along: f64,
    solid_angle: f32,
}

/// A complex number whose argument is an angle; its length means nothing.
type Turn = [f64; 2];

fn turned(a: Turn, b: Turn) -> Turn {
    [a[0] * b[0] - a[1] * b[1], a[0] * b[1] + a[1] * b[0]]
}

impl<'a> SeenRectangle<'a> {
    /// `rectangle` as seen from `from`; `None` where numbers leave f64.
    #[inline]
    pub(super) fn new(rectangle: &'a Rectangle, from: Vec3A) -> Option<Self> {
        let to = (rectangle.corner - from).as_dvec3();
        let [ax, ay, n] = rectangle.axes;
        let (x0, y0) = (to.dot(ax), to.dot(ay));
        let mut seen = Self {
            rectangle,
            x: [x0, x0 + rectangle.size[0]],
            y: [y0, y0 + rectangle.size[1]],
            along: to.dot(n),
            solid_angle: 0.0,
        };
        // The four angles exceed a flat rectangle's, 2π, by the solid angle.
        let low = turned(seen.inner_angle(0, 0), seen.inner_angle(0, 1));
        let high = turned(seen.inner_angle(1, 0), seen.inner_angle(1, 1));
        let [cos, sin] = turned(low, high);
        let excess = angle_of(sin, cos);
        seen.solid_angle = if excess < 0.0 { excess + TAU } else { excess };
        (cos.is_finite() && sin.is_finite()).then_some(seen)
    }

    /// The inner angle of the spherical rectangle at the corner of end `i` in x and end `j` in y: between the planes
    /// through the point and the two edges there. The length is that of their normals together, √(x² + z²) √(y² + z²).
    #[inline]
    fn inner_angle(&self, i: usize, j: usize) -> Turn {
        let (x, y, z) = (self.x[i], self.y[j], self.along);
        // Towards the outside of both edges x and y have the same sign at equal ends.
        let cos = if i == j { -x * y } else { x * y };
        [cos, z.abs() * (x * x + y * y + z * z).sqrt()]
    }

    /// Positive where the receiving point is before the front, negative behind, 0 in the plane.
    pub(super) fn facing(&self) -> f32 {
        f32::from(i8::from(self.along < 0.0) - i8::from(self.along > 0.0))
    }

    /// Density by solid angle of the unit direction `wi`, which meets the rectangle at `distance`.
    #[inline]
    #[allow(clippy::cast_possible_truncation, reason = "a density, rounded once")]
    pub(super) fn pdf(&self, wi: Vec3A, distance: f32) -> f32 {
        if self.solid_angle >= LEAST_SOLID_ANGLE {
            return 1.0 / self.solid_angle;
        }
        // pdf = d² / (A |cos|).
        let Rectangle { axes, size, .. } = self.rectangle;
        let flux = (size[0] * size[1] * axes[2].dot(wi.as_dvec3()).abs()) as f32;
        if flux > 0.0 { (distance / flux * distance).min(f32::MAX) } else { 0.0 }
    }

    /// A direction towards the rectangle.
    #[inline]
    #[allow(clippy::cast_possible_truncation, reason = "computed in f64, rounded once")]
    pub(super) fn sample(&self, u: Vec2) -> Option<ShapeSample> {
        let Rectangle { axes: [ax, ay, n], size: [width, height], .. } = *self.rectangle;
        let (x, y) = if self.solid_angle < LEAST_SOLID_ANGLE {
            (self.x[0] + width * f64::from(u.x), self.y[0] + height * f64::from(u.y))
        } else {
            self.spherical(u)
        };
        let to = ax * x + ay * y + n * self.along;
        let distance = to.length();
        let wi = (to / distance).as_vec3a();
        let place = Vec2::new(((x - self.x[0]) / width) as f32, ((y - self.y[0]) / height) as f32);
        let pdf_solid_angle = self.pdf(wi, distance as f32);
        let sound = wi.is_finite() && pdf_solid_angle > 0.0;
        sound.then_some(ShapeSample { wi, distance: distance as f32, place, pdf_solid_angle })
    }

    /// Where in the plane a direction uniform by solid angle goes.
    #[inline]
    fn spherical(&self, u: Vec2) -> (f64, f64) {
        let [x0, x1] = self.x;
        let [y0, y1] = self.y;
        let z2 = self.along * self.along;
        // The angle u S + 2π − γ₂ − γ₃, with γ₂ and γ₃ at the corners of x₀.
        let (sin, cos) = libm::sincos(f64::from(u.x) * f64::from(self.solid_angle));
        let rest = turned(self.inner_angle(0, 1), self.inner_angle(0, 0));
        let (h0, h1) = (1.0 / (y0 * y0 + z2).sqrt(), 1.0 / (y1 * y1 + z2).sqrt());
        let unit = h0 * h1 / (x0 * x0 + z2);
        let [cos, sin] = turned([cos, sin], [rest[0] * unit, -rest[1] * unit]);
        let (b0, b1) = (-y0 * h0, y1 * h1);
        // cu = ±1 / √(f² + b₀²) with f = (cos b₀ − b₁) / sin, and x = cu z / √(1 − cu²): in one root, without the quotient,
        // and with 1 − b₀² as the square that it is.
        let f = cos * b0 - b1;
        let below = (f * f - z2 * h0 * h0 * (sin * sin)).max(0.0).sqrt();
        let x = ((self.along * sin).abs() / below).copysign(f * sin).clamp(x0, x1);
        let x = if x.is_nan() { x0 } else { x };
        let d2 = x * x + z2;
        let (h0, h1) = (y0 / (d2 + y0 * y0).sqrt(), y1 / (d2 + y1 * y1).sqrt());
        let h = h0 + f64::from(u.y) * (h1 - h0);
        let y = (h * (d2 / (1.0 - h * h)).sqrt()).clamp(y0, y1);
        (x, if y.is_nan() { y1 } else { y })
    }
}
