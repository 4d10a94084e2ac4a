//! Albedos of mirror facets, many points of the quadrature at a time.

use super::super::ggx::{Ggx, azimuth_from_unit};
use glam::{Vec2, Vec3A};

/// Points that are taken together: the loops over so many are compiled to vector instructions.
const LANES: usize = 64;

/// Points of a lattice as azimuths on the unit circle and heights in [0, 1), by column; their count is a multiple of
/// [`LANES`].
#[derive(Debug)]
pub(super) struct Circle {
    blocks: Vec<[[f32; LANES]; 3]>,
}

impl Circle {
    /// `points` of the unit square: turns of azimuth and heights. Half a turn serves views of round facets, which look alike
    /// to the left and to the right.
    pub(super) fn new(points: impl Iterator<Item = Vec2>) -> Self {
        let columns = |u: Vec2| {
            let azimuth = azimuth_from_unit(u.x);
            [azimuth.x, azimuth.y, u.y]
        };
        let points: Vec<[f32; 3]> = points.map(columns).collect();
        let (chunks, rest) = points.as_chunks::<LANES>();
        debug_assert!(rest.is_empty(), "whole blocks");
        let column = |chunk: &[[f32; 3]; LANES], axis: usize| chunk.map(|p| p[axis]);
        Self { blocks: chunks.iter().map(|c| [column(c, 0), column(c, 1), column(c, 2)]).collect() }
    }
}

/// Albedos of facets that reflect everything, and that reflect `weight` of the cosine with the view, as means over
/// visible normals at `points`.
///
/// The formulas of [`Ggx::visible_normal`] and [`Ggx::shadowing`], written out so that they work on columns.
pub(super) fn mirror_means(ggx: Ggx, wo: Vec3A, points: &Circle, weight: impl Fn(f32) -> f32) -> (f32, f32) {
    let Vec2 { x: ax, y: ay } = ggx.alpha;
    let [wx, wy, co] = wo.to_array();
    let [vx, vy, vz] = Vec3A::new(ax * wx, ay * wy, co).normalize().to_array();
    let so = ggx.stretched(wo);
    let (mut mirror, mut weighted) = (0.0_f64, 0.0_f64);
    for [cosines, sines, heights] in &points.blocks {
        let (mut kept, mut cos) = ([0.0_f32; LANES], [0.0_f32; LANES]);
        for i in 0..LANES {
            let z = (1.0 - heights[i]) * (1.0 + vz) - vz;
            let r = greater(1.0 - z * z, 0.0).sqrt();
            let (x, y, z) = (ax * (r * cosines[i] + vx), ay * (r * sines[i] + vy), greater(z + vz, 0.0));
            let scale = 1.0 / greater(x * x + y * y + z * z, f32::MIN_POSITIVE).sqrt();
            let (x, y, z) = (x * scale, y * scale, z * scale);
            let d = wx * x + wy * y + co * z;
            let (ix, iy, ci) = (2.0 * d * x - wx, 2.0 * d * y - wy, greater(2.0 * d * z - co, 0.0));
            let si = (ci * ci + ax * ax * (ix * ix) + ay * ay * (iy * iy)).sqrt();
            // Where the reflection goes downwards ci is 0, and nothing is kept.
            kept[i] = ci * (co + so) / greater(ci * so + co * si, f32::MIN_POSITIVE);
            cos[i] = d;
        }
        for i in 0..LANES {
            cos[i] = kept[i] * weight(cos[i]);
        }
        mirror += sum(&kept);
        weighted += sum(&cos);
    }
    let count = (points.blocks.len() * LANES) as f64;
    ((mirror / count) as f32, (weighted / count) as f32)
}

/// The greater of two numbers, as the processor's own instruction has it.
#[inline(always)]
fn greater(a: f32, b: f32) -> f32 {
    if a > b { a } else { b }
}

/// Summed in pairs of halves: what the order of a sum costs a float stays far below a table's own error.
fn sum(values: &[f32; LANES]) -> f64 {
    let mut values = *values;
    let mut half = LANES / 2;
    while half > 0 {
        for i in 0..half {
            values[i] += values[i + half];
        }
        half /= 2;
    }
    f64::from(values[0])
}

#[cfg(test)]
mod tests {
    use super::super::super::fresnel::schlick_weight;
    use super::super::super::ggx::reflect;
    use super::super::lattice;
    use super::*;

    /// Against the functions that shading samples by, from all around and at all widths.
    #[test]
    fn means_over_columns_are_those_of_the_lobe() {
        let points = Circle::new((0..1024).map(|i| lattice(i, 1024)));
        for i in 0..200_u32 {
            let u = lattice(i, 200);
            let cos = u.x.max(1e-5);
            let side = (1.0 - cos * cos).sqrt();
            let azimuth = azimuth_from_unit(u.y);
            let wo = Vec3A::new(side * azimuth.x, side * azimuth.y, cos);
            let ggx = Ggx { alpha: Vec2::new(u.y * u.y, u.x).max(Vec2::splat(1e-4)) };
            let (mut mirror, mut schlick) = (0.0_f64, 0.0_f64);
            for i in 0..1024 {
                let h = ggx.visible_normal(wo, lattice(i, 1024));
                let wi = reflect(wo, h);
                if wi.z > 0.0 {
                    let kept = f64::from(ggx.shadowing(wo, wi)) / 1024.0;
                    mirror += kept;
                    schlick += kept * f64::from(schlick_weight(wo.dot(h)));
                }
            }
            let means = mirror_means(ggx, wo, &points, schlick_weight);
            let error = (f64::from(means.0) - mirror).abs().max((f64::from(means.1) - schlick).abs());
            assert!(error < 2e-5, "{ggx:?} {wo}: {means:?}, {mirror} and {schlick}");
        }
    }
}
