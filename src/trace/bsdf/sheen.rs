//! Sheen of `KHR_materials_sheen`: the "Charlie" distribution of Estevez and Kulla (2017), "Production Friendly
//! Microfacet Sheen BRDF".

use glam::Vec3A;
use std::f32::consts::TAU;

/// The least α: at 0.001 the lobe's exponent 1/α is 1000 and sin^1000 spans all of `f32` within 24 degrees of
/// grazing facets; rougher than that is roughness 0.032.
const LEAST_ALPHA: f32 = 1e-3;

/// α from perceptual roughness.
#[inline]
pub(super) fn alpha(roughness: f32) -> f32 {
    (roughness * roughness).max(LEAST_ALPHA)
}

/// The least cosine of view that the lobe is divided by: below it the lobe is held constant. A grazing view of 0.006
/// degrees; the albedo that scales the lobe is tabulated from the same value.
const LEAST_COSINE: f32 = 1e-4;

/// White sheen of one width, seen from one direction: what does not depend on the light's direction is worked out once.
#[derive(Debug, Clone, Copy)]
pub(super) struct Sheen {
    inverse: f32,
    lambda: Lambda,
    /// 1 + Λ of the viewer's direction.
    shadowed: f32,
}

impl Sheen {
    /// Of width `alpha`, seen at cosine `cos`.
    pub(super) fn new(alpha: f32, cos: f32) -> Self {
        let lambda = Lambda::new(alpha);
        Self { inverse: 1.0 / alpha, shadowed: 1.0 + lambda.at(cos.max(0.0)), lambda }
    }

    /// f · cosᵢ for directions on the normal's side; `wo` is the direction of [`Sheen::new`].
    #[inline]
    pub(super) fn value(&self, wo: Vec3A, wi: Vec3A) -> f32 {
        if wo.z <= 0.0 || wi.z <= 0.0 {
            return 0.0;
        }
        self.of(log_sin2(wo, wi), wo.z, self.masked(wi.z))
    }

    /// The same by its parts: [`log_sin2`] of both directions, the viewer's cosine, and [`Sheen::masked`] of the light's.
    #[inline]
    pub(super) fn of(&self, log_sin2: f32, cos: f32, masked: f32) -> f32 {
        let density = (2.0 + self.inverse) * libm::expf(0.5 * self.inverse * log_sin2) / TAU;
        // V = 1 / ((1 + Λₒ + Λᵢ) 4 cosₒ cosᵢ), times cosᵢ.
        density / ((self.shadowed + masked) * 4.0 * cos.max(LEAST_COSINE))
    }

    /// Λ of a direction at cosine `cos`.
    #[inline]
    pub(super) fn masked(&self, cos: f32) -> f32 {
        self.lambda.at(cos)
    }
}

/// Logarithm of the squared sine of the facet that reflects `wo` to `wi`; −∞ where it is level.
#[inline]
pub(super) fn log_sin2(wo: Vec3A, wi: Vec3A) -> f32 {
    let h = wo + wi;
    let length2 = h.length_squared();
    if length2 <= 0.0 {
        return f32::NEG_INFINITY;
    }
    libm::logf(((h.x * h.x + h.y * h.y) / length2).min(1.0))
}

/// Smith's Λ fitted by Estevez and Kulla (2017, §3, table 1 and eq. 3).
#[derive(Debug, Clone, Copy)]
struct Lambda {
    fit: [f32; 5],
    /// Twice the fit's value in the middle, about which it is mirrored.
    middle2: f32,
}

impl Lambda {
    fn new(alpha: f32) -> Self {
        let t = (1.0 - alpha) * (1.0 - alpha);
        let mix = |a: f32, b: f32| t * a + (1.0 - t) * b;
        let fit = [
            mix(25.3245, 21.5473),
            mix(3.324_35, 3.829_87),
            mix(0.168_01, 0.198_23),
            mix(-1.273_93, -1.977_6),
            mix(-4.859_67, -4.320_54),
        ];
        let mut lambda = Self { fit, middle2: 0.0 };
        lambda.middle2 = 2.0 * lambda.exponent(0.5);
        lambda
    }

    fn exponent(&self, x: f32) -> f32 {
        let [a, b, c, d, e] = self.fit;
        a / (1.0 + b * libm::expf(c * libm::logf(x))) + d * x + e
    }

    #[inline]
    fn at(&self, cos: f32) -> f32 {
        libm::expf(if cos < 0.5 { self.exponent(cos) } else { self.middle2 - self.exponent(1.0 - cos) })
    }
}
