//! Albedos of facets that are wider one way than the other.

use super::super::ALPHA_SPECULAR;
use super::super::ggx::Ggx;
use super::{Axis, LEAST_COSINE, cell, in_parallel};
use glam::{Vec2, Vec3A};

/// A function of the view on stretched facets of widths α + (1 − α) s² and α, tabulated by cosine, azimuth, roughness and
/// strength s of anisotropy.
#[derive(Debug)]
pub(super) struct Stretched(Vec<f32>);

impl Stretched {
    const SIDES: [usize; 4] = [20, 14, 16, 9];

    /// Where cosine `cos` lies for facets whose width the view meets as `met`: shadowing of what comes sets in below that
    /// width, of what leaves, which the other width spreads, at any cosine; so the mean of both axes.
    fn cosine_place(cos: f32, met: f32) -> f32 {
        0.5 * (Axis::Shadowing.place(cos, met.sqrt()) + Axis::Root.place(cos, 0.0))
    }

    /// The inverse of [`Stretched::cosine_place`], by bisection.
    fn cosine(place: f32, met: f32) -> f32 {
        let (mut low, mut high) = (0.0_f32, 1.0_f32);
        for _ in 0..40 {
            let middle = 0.5 * (low + high);
            if Self::cosine_place(middle, met) < place { low = middle } else { high = middle }
        }
        high
    }

    /// Azimuths are spaced half-way between the direction itself and the facets' own view of it.
    fn azimuth_scale(wide: f32, narrow: f32) -> f32 {
        (narrow / wide).sqrt()
    }

    pub(super) fn build(value: impl Fn(Ggx, Vec3A) -> f32 + Sync) -> Self {
        let [cosines, azimuths, roughnesses, strengths] = Self::SIDES;
        let along = |i: usize, count: usize| i as f32 / (count - 1) as f32;
        Self(in_parallel(cosines * azimuths * roughnesses * strengths, |i| {
            let (cosine, i) = (i % cosines, i / cosines);
            let (azimuth, i) = (i % azimuths, i / azimuths);
            let (roughness, strength) = (i % roughnesses, i / roughnesses);
            let (r, s) = (along(roughness, roughnesses).max(ALPHA_SPECULAR.sqrt()), along(strength, strengths));
            let narrow = r * r;
            let wide = narrow + (1.0 - narrow) * s * s;
            let ggx = Ggx { alpha: Vec2::new(wide, narrow) };
            let (sin, cos) = crate::numeric::sin_cos(along(azimuth, azimuths) * std::f32::consts::FRAC_PI_2);
            let direction = Vec2::new(cos * Self::azimuth_scale(wide, narrow), sin).normalize();
            let cos = Self::cosine(along(cosine, cosines), (direction * ggx.alpha).length()).clamp(LEAST_COSINE, 1.0);
            let side = (1.0 - cos * cos).max(0.0).sqrt();
            value(ggx, Vec3A::new(direction.x * side, direction.y * side, cos))
        }))
    }

    /// The sixteen entries around facets of widths `alpha` as seen from `o` in their own basis, with their weights.
    fn around(&self, alpha: Vec2, o: Vec3A) -> impl Iterator<Item = (f32, f32)> {
        let (alpha, side) = if alpha.x >= alpha.y {
            (alpha, Vec2::new(o.x, o.y))
        } else {
            (Vec2::new(alpha.y, alpha.x), Vec2::new(o.y, o.x))
        };
        let direction = side.abs().try_normalize().unwrap_or(Vec2::X);
        let met = (direction * alpha).length();
        let azimuth = libm::atan2f(direction.y, direction.x / Self::azimuth_scale(alpha.x, alpha.y));
        let places = [
            Self::cosine_place(o.z.clamp(0.0, 1.0), met),
            azimuth / std::f32::consts::FRAC_PI_2,
            alpha.y.sqrt(),
            if alpha.y < 1.0 { ((alpha.x - alpha.y) / (1.0 - alpha.y)).sqrt() } else { 0.0 },
        ];
        let cells: [(usize, f32); 4] = std::array::from_fn(|i| cell(places[i].clamp(0.0, 1.0), Self::SIDES[i]));
        (0..16_usize).map(move |corner| {
            let (mut index, mut weight) = (0, 1.0);
            for axis in (0..4).rev() {
                let upper = corner >> axis & 1;
                let (below, x) = cells[axis];
                index = index * Self::SIDES[axis] + below + upper;
                weight *= if upper == 1 { x } else { 1.0 - x };
            }
            (self.0[index], weight)
        })
    }

    /// Interpolated in all four.
    pub(super) fn at(&self, alpha: Vec2, o: Vec3A) -> f32 {
        self.around(alpha, o).map(|(value, weight)| value * weight).sum()
    }

    /// The greatest entry around.
    pub(super) fn most_at(&self, alpha: Vec2, o: Vec3A) -> f32 {
        self.around(alpha, o).fold(0.0, |most, (value, weight)| if weight > 0.0 { value.max(most) } else { most })
    }
}
