//! What spares most rays the top level where few things stand apart from the world's structure.

use super::frame::RayFrame;
use super::linear::Aabb;
use super::topology::half_area;

/// Around all places of a top level throughout the exposure: a ray that misses it walks the world's structure alone.
#[derive(Debug)]
pub(super) struct Guard(Aabb);

/// A guard that covers more than this share of the whole is met too often to spare much.
const MOST_AREA: f32 = 0.5;

impl Guard {
    /// The guard around `places` beside the world's structure with the bounds `world`, if there is one and it is worth
    /// testing.
    pub(super) fn around(places: &Aabb, world: &Aabb) -> Option<Self> {
        let area = |b: &Aabb| half_area(b.lo, b.hi);
        let worth = !places.is_empty() && !world.is_empty() && area(places) <= MOST_AREA * area(&places.join(world));
        worth.then_some(Self(*places))
    }

    /// Whether the ray meets it no farther than `limit`.
    #[inline(always)]
    pub(super) fn is_met(&self, ray: &RayFrame, limit: f32) -> bool {
        ray.meets(&self.0, limit)
    }
}
