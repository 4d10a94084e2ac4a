//! Wavelengths for dispersive media: drawn once a path, weighed so that the mean over wavelengths is white.

use glam::{Mat3, Vec3};
use std::sync::LazyLock;

/// First wavelength, nanometres, and the number of cells of a nanometre: beyond, the eye's response is below 1e-3 of
/// its peak.
const FIRST_NM: f32 = 390.0;
const CELLS: usize = 330;

/// A wavelength and what it contributes.
#[derive(Debug, Clone, Copy)]
pub struct Wavelength {
    /// In vacuum, nanometres.
    pub nm: f32,
    /// Multiplies the path's throughput: linear Rec. 709, each channel of mean 1 over all draws, at most 3.
    pub weight: Vec3,
}

struct Table {
    /// Cumulative probability, `CELLS + 1` from 0 to 1.
    sums: Vec<f32>,
    weights: Vec<Vec3>,
}

/// Responses of the three channels: the CIE 1931 observer (fits of Wyman, Sloan and Shirley 2013, "Simple Analytic
/// Approximations to the CIE XYZ Color Matching Functions", multi-lobe) in Rec. 709 primaries, without the negative parts
/// that no light has, each scaled to the same sum.
#[allow(clippy::cast_possible_truncation, reason = "summed in f64, rounded once")]
static TABLE: LazyLock<Table> = LazyLock::new(|| {
    let lobe = |nm: f64, middle: f64, below: f64, above: f64| {
        let x = (nm - middle) / if nm < middle { below } else { above };
        libm::exp(-0.5 * x * x)
    };
    let response = |cell: usize| {
        let nm = f64::from(FIRST_NM) + cell as f64 + 0.5;
        let x = 1.056 * lobe(nm, 599.8, 37.9, 31.0) + 0.362 * lobe(nm, 442.0, 16.0, 26.7)
            - 0.065 * lobe(nm, 501.1, 20.4, 26.2);
        let y = 0.821 * lobe(nm, 568.8, 46.9, 40.5) + 0.286 * lobe(nm, 530.9, 16.3, 31.1);
        let z = 1.217 * lobe(nm, 437.0, 11.8, 36.0) + 0.681 * lobe(nm, 459.0, 26.0, 13.8);
        let rgb: Mat3 = super::fresnel::RGB_FROM_XYZ;
        (rgb.as_dmat3() * glam::DVec3::new(x, y, z)).max(glam::DVec3::ZERO)
    };
    let responses: Vec<_> = (0..CELLS).map(response).collect();
    let total: glam::DVec3 = responses.iter().copied().sum();
    let (mut sums, mut weights, mut sum) = (vec![0.0_f32], Vec::with_capacity(CELLS), 0.0);
    for r in responses {
        let parts = r / total;
        let chance = parts.element_sum() / 3.0;
        sum += chance;
        sums.push(sum.min(1.0) as f32);
        weights.push((parts / chance).as_vec3());
    }
    Table { sums, weights }
});

/// The wavelength at `u` in [0, 1): drawn in proportion to the mean response of the three channels.
#[must_use]
pub fn wavelength(u: f32) -> Wavelength {
    let table = &*TABLE;
    let cell = table.sums.partition_point(|&s| s <= u).clamp(1, CELLS) - 1;
    let (low, high) = (table.sums[cell], table.sums[cell + 1]);
    let part = if high > low { ((u - low) / (high - low)).clamp(0.0, 1.0) } else { 0.5 };
    Wavelength { nm: FIRST_NM + cell as f32 + part, weight: table.weights[cell] }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_mean_of_all_wavelengths_is_white() {
        let n = 1_u32 << 16;
        let mut sum = glam::DVec3::ZERO;
        for i in 0..n {
            let w = wavelength((i as f32 + 0.5) / n as f32);
            assert!(w.weight.min_element() >= 0.0 && w.weight.max_element() <= 3.0 + 1e-5 && w.weight.is_finite());
            assert!((390.0..=720.0).contains(&w.nm));
            sum += w.weight.as_dvec3() / f64::from(n);
        }
        // A cell's edge is missed by at most half a point: 330 edges of weight at most 3 in 65 536 points, signs mixed.
        assert!((sum - 1.0).abs().max_element() < 2e-3, "{sum}");
    }

    #[test]
    fn long_waves_are_red_and_short_ones_blue() {
        assert!(wavelength(0.02).weight.z > 2.0 && wavelength(0.98).weight.x > 2.5);
        assert!(wavelength(0.02).nm < 450.0 && wavelength(0.98).nm > 620.0);
    }
}
