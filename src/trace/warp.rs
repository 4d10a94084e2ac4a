//! Warps of the unit square: sample points to directions and surface points, each with its inverse and its density.
//!
//! A warp comes as three: `x_from_square`, its inverse `square_from_x` and its density `x_pdf` (after Mitsuba 3's
//! `warp.h`), tested against each other. Warps keep neighbouring points together, so a stratified square gives a
//! stratified disk, cone or triangle.

use crate::numeric::{ONE_MINUS, sin_cos};
use glam::{Vec2, Vec3A};
use std::f32::consts::{FRAC_1_PI, FRAC_PI_2, FRAC_PI_4, PI, TAU};

/// A point of the unit disk, uniform by area (Shirley and Chiu 1997: concentric, low distortion).
#[must_use]
#[inline]
pub fn disk_from_square(u: Vec2) -> Vec2 {
    let (a, b) = (2.0 * u.x - 1.0, 2.0 * u.y - 1.0);
    let (r, phi) = if a.abs() > b.abs() {
        (a, FRAC_PI_4 * (b / a))
    } else if b.abs() > 0.0 {
        (b, FRAC_PI_2 - FRAC_PI_4 * (a / b))
    } else {
        return Vec2::ZERO;
    };
    let (sin, cos) = sin_cos(phi);
    Vec2::new(r * cos, r * sin)
}

/// Inverse of [`disk_from_square`].
#[must_use]
pub fn square_from_disk(p: Vec2) -> Vec2 {
    let r = p.length();
    let mut phi = libm::atan2f(p.y, p.x);
    if phi < -FRAC_PI_4 {
        phi += TAU;
    }
    let (a, b) = if phi < FRAC_PI_4 {
        (r, phi * r / FRAC_PI_4)
    } else if phi < 3.0 * FRAC_PI_4 {
        (-(phi - FRAC_PI_2) * r / FRAC_PI_4, r)
    } else if phi < 5.0 * FRAC_PI_4 {
        (-r, (phi - PI) * -r / FRAC_PI_4)
    } else {
        ((phi - 1.5 * PI) * r / FRAC_PI_4, -r)
    };
    Vec2::new(0.5 * (a + 1.0), 0.5 * (b + 1.0))
}

/// Density of [`disk_from_square`] by area.
#[must_use]
pub const fn disk_pdf() -> f32 {
    FRAC_1_PI
}

/// A direction of the hemisphere about +z, in proportion to its cosine (Malley's method).
#[must_use]
#[inline]
pub fn cosine_hemisphere_from_square(u: Vec2) -> Vec3A {
    let d = disk_from_square(u);
    Vec3A::new(d.x, d.y, (1.0 - d.length_squared()).max(0.0).sqrt())
}

/// Inverse of [`cosine_hemisphere_from_square`].
#[must_use]
pub fn square_from_cosine_hemisphere(w: Vec3A) -> Vec2 {
    square_from_disk(Vec2::new(w.x, w.y))
}

/// Density of [`cosine_hemisphere_from_square`] by solid angle, for a unit direction with cosine `cos`.
#[must_use]
#[inline]
pub fn cosine_hemisphere_pdf(cos: f32) -> f32 {
    cos.max(0.0) * FRAC_1_PI
}

/// A direction of the hemisphere about +z, uniform by solid angle.
#[must_use]
#[inline]
pub fn uniform_hemisphere_from_square(u: Vec2) -> Vec3A {
    let d = disk_from_square(u);
    let r2 = d.length_squared().min(1.0);
    // z = 1 − r² has the right density; x² + y² = 1 − z² = r² (2 − r²).
    let stretch = (2.0 - r2).max(0.0).sqrt();
    Vec3A::new(d.x * stretch, d.y * stretch, 1.0 - r2)
}

/// Inverse of [`uniform_hemisphere_from_square`].
#[must_use]
pub fn square_from_uniform_hemisphere(w: Vec3A) -> Vec2 {
    let shrink = 1.0 / (1.0 + w.z).sqrt();
    square_from_disk(Vec2::new(w.x * shrink, w.y * shrink))
}

/// Density of [`uniform_hemisphere_from_square`] by solid angle.
#[must_use]
pub const fn uniform_hemisphere_pdf() -> f32 {
    1.0 / TAU
}

/// A direction, uniform over the sphere.
#[must_use]
#[inline]
pub fn sphere_from_square(u: Vec2) -> Vec3A {
    let z = 1.0 - 2.0 * u.y;
    // 1 − z² = 4 v (1 − v), without cancellation at the poles.
    let r = 2.0 * (u.y * (1.0 - u.y)).max(0.0).sqrt();
    let (sin, cos) = sin_cos(TAU * u.x);
    Vec3A::new(r * cos, r * sin, z)
}

/// Inverse of [`sphere_from_square`].
#[must_use]
pub fn square_from_sphere(w: Vec3A) -> Vec2 {
    let phi = libm::atan2f(w.y, w.x);
    let u = if phi < 0.0 { phi + TAU } else { phi } / TAU;
    Vec2::new(u.min(ONE_MINUS), 0.5 * (1.0 - w.z))
}

/// Density of [`sphere_from_square`] by solid angle.
#[must_use]
pub const fn sphere_pdf() -> f32 {
    1.0 / (2.0 * TAU)
}

/// A direction of the cone about +z with 1 − cos(half angle) = `one_minus_cos`, uniform by solid angle.
///
/// The cone is given by 1 − cos so that narrow ones keep their precision: the sun's is 1.1e-5.
#[must_use]
#[inline]
pub fn cone_from_square(u: Vec2, one_minus_cos: f32) -> Vec3A {
    let d = disk_from_square(u);
    // r² uniform in [0, 1): 1 − z = r² · one_minus_cos, sin² = (1 − z)(2 − (1 − z)).
    let r2 = d.length_squared();
    let h = r2 * one_minus_cos;
    let stretch = (one_minus_cos * (2.0 - h)).max(0.0).sqrt();
    Vec3A::new(d.x * stretch, d.y * stretch, 1.0 - h)
}

/// Inverse of [`cone_from_square`] for a direction inside the cone.
#[must_use]
pub fn square_from_cone(w: Vec3A, one_minus_cos: f32) -> Vec2 {
    let sin2 = w.x * w.x + w.y * w.y;
    let h = sin2 / (1.0 + w.z);
    let stretch = (one_minus_cos * (2.0 - h)).max(0.0).sqrt();
    square_from_disk(Vec2::new(w.x / stretch, w.y / stretch))
}

/// Density of [`cone_from_square`] by solid angle.
#[must_use]
#[inline]
pub fn cone_pdf(one_minus_cos: f32) -> f32 {
    1.0 / (TAU * one_minus_cos)
}

/// Barycentric weights (of the second and third vertex), uniform over a triangle's area (Heitz 2019, "A low-distortion
/// map between triangle and square").
#[must_use]
#[inline]
pub fn triangle_from_square(u: Vec2) -> Vec2 {
    if u.y > u.x {
        let x = 0.5 * u.x;
        Vec2::new(x, u.y - x)
    } else {
        let y = 0.5 * u.y;
        Vec2::new(u.x - y, y)
    }
}

/// Inverse of [`triangle_from_square`].
#[must_use]
pub fn square_from_triangle(b: Vec2) -> Vec2 {
    if b.y > b.x { Vec2::new(2.0 * b.x, b.y + b.x) } else { Vec2::new(b.x + b.y, 2.0 * b.y) }
}

/// Splits [0, 1) at `share`: whether `u` falls in the first part, and where in its part, again in [0, 1).
///
/// One coordinate then both chooses and places; strata of `u` stay strata of each part.
#[must_use]
#[inline]
pub fn split(u: f32, share: f32) -> (Side, f32) {
    if u < share {
        (Side::First, (u / share).min(ONE_MINUS))
    } else {
        (Side::Second, ((u - share) / (1.0 - share)).clamp(0.0, ONE_MINUS))
    }
}

/// Which part [`split`] chose.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Side {
    /// Below the share.
    First,
    /// At or above it.
    Second,
}

/// Two unit vectors that complete the unit vector `n` to a right-handed basis (t, b, n) (Duff et al. 2017).
#[must_use]
#[inline]
pub fn tangents_of(n: Vec3A) -> (Vec3A, Vec3A) {
    let sign = 1.0_f32.copysign(n.z);
    let a = -1.0 / (sign + n.z);
    let b = n.x * n.y * a;
    (Vec3A::new(1.0 + sign * n.x * n.x * a, sign * b, -sign * n.x), Vec3A::new(b, sign + n.y * n.y * a, -n.y))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn unit_square() -> impl Strategy<Value = Vec2> {
        (0.001_f32..0.999, 0.001_f32..0.999).prop_map(|(x, y)| Vec2::new(x, y))
    }

    proptest! {
        #[test]
        fn warps_invert(u in unit_square(), one_minus_cos in 1e-6_f32..1.9) {
            let close = |a: Vec2| (a - u).abs().max_element() < 2e-4;
            prop_assert!(close(square_from_disk(disk_from_square(u))));
            prop_assert!(close(square_from_cosine_hemisphere(cosine_hemisphere_from_square(u))));
            prop_assert!(close(square_from_uniform_hemisphere(uniform_hemisphere_from_square(u))));
            prop_assert!(close(square_from_sphere(sphere_from_square(u))));
            prop_assert!(close(square_from_cone(cone_from_square(u, one_minus_cos), one_minus_cos)));
            prop_assert!(close(square_from_triangle(triangle_from_square(u))));
        }

        #[test]
        fn directions_are_unit(u in unit_square(), one_minus_cos in 1e-6_f32..1.9) {
            for w in [
                cosine_hemisphere_from_square(u),
                uniform_hemisphere_from_square(u),
                sphere_from_square(u),
                cone_from_square(u, one_minus_cos),
            ] {
                prop_assert!((w.length() - 1.0).abs() < 4.0 * f32::EPSILON, "{w} {}", w.length());
            }
        }

        #[test]
        fn splits_stay_in_the_unit_interval(u in 0.0_f32..1.0, share in 0.0_f32..=1.0) {
            let (_, rest) = split(u, share);
            prop_assert!((0.0..1.0).contains(&rest));
        }

        #[test]
        fn tangents_are_orthonormal(u in unit_square()) {
            let n = sphere_from_square(u);
            let (t, b) = tangents_of(n);
            prop_assert!((t.cross(b) - n).length() < 1e-6);
        }
    }
}
