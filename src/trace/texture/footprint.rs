//! What of a texture one lookup covers.

use crate::numeric::ONE_MINUS;
use glam::{Mat2, Vec2};

/// Extent and random choice of one lookup.
#[derive(Debug, Clone, Copy, Default)]
pub struct Footprint {
    /// The ellipse in texture coordinates of set 0, before the reference's own transform: uu, uv and vv of the matrix
    /// J Jᵀ, where J takes the unit disk's diameter to the footprint's.
    ellipse: [f32; 3],
    /// Coordinate in [0, 1) by which filters that draw choose a texel.
    pub u: f32,
}

impl Footprint {
    /// A point.
    #[must_use]
    pub const fn point(u: f32) -> Self {
        Self { ellipse: [0.0; 3], u }
    }

    /// A disk of diameter `width` ≥ 0 in texture coordinates.
    #[must_use]
    pub fn round(width: f32, u: f32) -> Self {
        Self::ellipse([width * width, 0.0, width * width], u)
    }

    /// An ellipse: squares and product of how far the two texture coordinates go along the footprint's diameters. What
    /// is not finite covers everything.
    #[must_use]
    pub fn ellipse(ellipse: [f32; 3], u: f32) -> Self {
        /// Its square root, and its product with the square of any texture's side, are numbers.
        const EVERYTHING: f32 = 1e24;
        let known = ellipse.iter().all(|x| x.abs() <= EVERYTHING);
        Self { ellipse: if known { ellipse } else { [EVERYTHING, 0.0, EVERYTHING] }, u }
    }

    /// The ellipse in texels of a texture of `size` that is read through `transform`.
    pub(super) fn in_texels(&self, transform: &Mat2, size: Vec2) -> Ellipse {
        let [uu, uv, vv] = self.ellipse;
        let rows = [transform.row(0) * size.x, transform.row(1) * size.y];
        let product = |a: Vec2, b: Vec2| a.x * (uu * b.x + uv * b.y) + a.y * (uv * b.x + vv * b.y);
        Ellipse { xx: product(rows[0], rows[0]), xy: product(rows[0], rows[1]), yy: product(rows[1], rows[1]) }
    }
}

/// A footprint in texels of the full resolution.
#[derive(Debug, Clone, Copy)]
pub(super) struct Ellipse {
    xx: f32,
    xy: f32,
    yy: f32,
}

/// Its axes.
#[derive(Debug, Clone, Copy)]
pub(super) struct Axes {
    /// Long diameter, texels.
    pub(super) major: f32,
    /// Short diameter, texels; at least a part of the long one: see [`MOST_ANISOTROPY`].
    pub(super) minor: f32,
    /// Unit vector along the long one.
    pub(super) along: Vec2,
}

/// The longest ellipse for its width: a longer one is widened, which blurs what is nearly edge-on and bounds the texels
/// that a lookup reads.
const MOST_ANISOTROPY: f32 = 16.0;

#[allow(clippy::cast_possible_truncation, reason = "widths are computed in double precision and kept in single")]
impl Ellipse {
    /// Diameter of the disk of equal area.
    pub(super) fn round_width(&self) -> f32 {
        // The roots one by one: the product of large squares overflows.
        let area2 = f64::from(self.xx) * f64::from(self.yy) - f64::from(self.xy) * f64::from(self.xy);
        area2.max(0.0).sqrt().sqrt() as f32
    }

    pub(super) fn axes(&self) -> Axes {
        let (xx, xy, yy) = (f64::from(self.xx), f64::from(self.xy), f64::from(self.yy));
        // Eigenvalues of the symmetric matrix; the smaller one from the determinant, which does not cancel as their
        // difference does.
        let (mean, half) = (0.5 * (xx + yy), 0.5 * (xx - yy));
        let root = (half * half + xy * xy).sqrt();
        let large = mean + root;
        let small = if large > 0.0 { ((xx * yy - xy * xy) / large).max(0.0) } else { 0.0 };
        let along = if half >= 0.0 {
            Vec2::new((half + root) as f32, xy as f32)
        } else {
            Vec2::new(xy as f32, (root - half) as f32)
        };
        let major = large.max(0.0).sqrt() as f32;
        let minor = (small.sqrt() as f32).max(major / MOST_ANISOTROPY);
        Axes { major, minor, along: along.try_normalize().unwrap_or(Vec2::X) }
    }
}

impl Axes {
    /// Of lookups side by side along the long axis, as wide as the short one or a texel, the place of one relative to the
    /// middle, texels; and `u` rescaled within the choice.
    pub(super) fn choose(&self, u: f32) -> (Vec2, f32) {
        let count = (self.major / self.minor.max(1.0)).ceil().clamp(1.0, MOST_ANISOTROPY);
        let (which, u) = ((u * count).floor(), u * count);
        let part = (which + 0.5) / count - 0.5;
        (self.along * (part * self.major), (u - which).min(ONE_MINUS))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn axes_are_those_of_a_turned_ellipse() {
        for degrees in [0.0_f32, 30.0, 90.0, 135.0, 179.0] {
            let (sin, cos) = crate::numeric::sin_cos(degrees.to_radians());
            let (long, short) = (Vec2::new(cos, sin) * 8.0, Vec2::new(-sin, cos) * 2.0);
            let sum = |f: &dyn Fn(Vec2) -> f32| f(long) + f(short);
            let footprint = Footprint::ellipse([sum(&|d| d.x * d.x), sum(&|d| d.x * d.y), sum(&|d| d.y * d.y)], 0.0);
            let ellipse = footprint.in_texels(&Mat2::IDENTITY, Vec2::ONE);
            let axes = ellipse.axes();
            assert!((axes.major - 8.0).abs() < 1e-4 && (axes.minor - 2.0).abs() < 1e-4, "{axes:?}");
            assert!(axes.along.perp_dot(long.normalize()).abs() < 1e-5, "{axes:?}");
            assert!((ellipse.round_width() - 4.0).abs() < 1e-4);
        }
    }

    #[test]
    fn a_transform_and_the_textures_shape_stretch_the_ellipse() {
        let ellipse =
            Footprint::round(0.5, 0.0).in_texels(&Mat2::from_diagonal(Vec2::new(2.0, 1.0)), Vec2::new(8.0, 4.0));
        let axes = ellipse.axes();
        assert_eq!((axes.major, axes.minor), (8.0, 2.0));
    }

    #[test]
    fn lookups_lie_evenly_along_the_long_axis() {
        let axes = Axes { major: 8.0, minor: 2.0, along: Vec2::X };
        let places: Vec<f32> = (0..4).map(|k| axes.choose((k as f32 + 0.5) / 4.0).0.x).collect();
        assert_eq!(places, [-3.0, -1.0, 1.0, 3.0]);
        assert!((axes.choose(0.375).1 - 0.5).abs() < 1e-6);
    }

    #[test]
    fn what_is_no_number_covers_everything() {
        for odd in [f32::NAN, f32::INFINITY, f32::MAX] {
            let axes =
                Footprint::ellipse([odd, 0.0, 1.0], 0.0).in_texels(&Mat2::IDENTITY, Vec2::splat(65_536.0)).axes();
            assert!(axes.major.is_finite() && axes.minor.is_finite() && axes.minor > 1e9);
        }
    }
}
