//! The albedo of white sheen.

use super::super::sheen::{Sheen, alpha, log_sin2};
use super::{Axis, POINTS, Table, azimuth_from_unit, entry_roughness, half_turn, view};
use glam::{Vec2, Vec3A};

/// Columns of cosine and rows of roughness.
const SIDES: (usize, usize) = (64, 64);

pub(super) type Cloth = Table<false, { SIDES.0 }, { SIDES.1 }>;

/// Tabulates it. The facets' slopes depend on the view alone and the masking of light on the roughness alone, so an entry
/// is left with one exponential a direction.
pub(super) fn table() -> Cloth {
    let directions: Vec<Vec3A> = half_turn().map(direction).collect();
    let slopes: Vec<Vec<f32>> = (0..SIDES.0)
        .map(|column| {
            let wo = view(Axis::Root.entry_cosine(column, SIDES.0, 0.0));
            directions.iter().map(|&wi| log_sin2(wo, wi)).collect()
        })
        .collect();
    let masked: Vec<Vec<f32>> = (0..SIDES.1)
        .map(|row| {
            let sheen = Sheen::new(alpha(entry_roughness(row, SIDES.1)), 1.0);
            directions.iter().map(|wi| sheen.masked(wi.z)).collect()
        })
        .collect();
    Cloth::of_entries(|column, row| {
        let cos = Axis::Root.entry_cosine(column, SIDES.0, 0.0);
        let sheen = Sheen::new(alpha(entry_roughness(row, SIDES.1)), cos);
        let all = slopes[column].iter().zip(&masked[row]);
        let sum: f64 = all.map(|(&slope, &masked)| f64::from(sheen.of(slope, cos, masked))).sum();
        (sum / f64::from(POINTS) / f64::from(crate::trace::warp::uniform_hemisphere_pdf())) as f32
    })
}

/// A direction, uniform by solid angle over the hemisphere; with u.x up to a half, over half of it, as the rest looks alike.
fn direction(u: Vec2) -> Vec3A {
    let (azimuth, z) = (azimuth_from_unit(u.x), u.y);
    let side = (1.0 - z * z).max(0.0).sqrt();
    Vec3A::new(side * azimuth.x, side * azimuth.y, z)
}
