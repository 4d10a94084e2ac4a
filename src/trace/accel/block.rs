//! Blocks of four triangles and the watertight test of a ray against them.
//!
//! Woop, Benthin and Wald 2013: in the ray's sheared space a triangle is hit if its three edge functions agree in sign.
//! An edge function is a difference of two products, each rounded: no fused multiply-add, so that the triangles on both
//! sides of an edge get exactly opposite values. Rounding is monotonic, so the rounded difference never has the wrong
//! sign, it may only be zero; zero counts as inside. A ray through a closed surface therefore meets at least one
//! triangle. Where all three are zero or nearly so, products of small or nearly equal numbers have lost the triangle, and
//! the functions are computed once more in `f64`, whose products of `f32` are exact.

use super::collapse::{BLOCK, NO_TRIANGLE};
use super::frame::RayFrame;
use glam::{DVec3, Vec3A, Vec4};

/// Corners of four triangles: `[corner][axis]`, a lane a triangle.
pub(super) type Corners = [[Vec4; 3]; 3];

/// Bits of [`Block::ids`]: the triangle's index, and what to do when it is met.
pub(super) mod tag {
    /// The triangle's index in its structure.
    pub(in crate::trace::accel) const INDEX: u32 = (1 << 29) - 1;
    /// Rays that see the counter-clockwise side pass through.
    pub(in crate::trace::accel) const SKIP_FRONT: u32 = 1 << 29;
    /// Rays that see the clockwise side pass through.
    pub(in crate::trace::accel) const SKIP_BACK: u32 = 1 << 30;
    /// The caller's `accept` decides.
    pub(in crate::trace::accel) const ASK: u32 = 1 << 31;
}

/// Four triangles that do not move.
#[derive(Debug, Clone)]
#[repr(C, align(32))]
pub(super) struct StillBlock {
    corners: Corners,
    ids: [u32; BLOCK],
}

/// Four triangles whose corners move linearly.
#[derive(Debug, Clone)]
#[repr(C, align(32))]
pub(super) struct MovingBlock {
    corners: Corners,
    deltas: Corners,
    ids: [u32; BLOCK],
}

/// A triangle to store: its corners at the segment's begin and end (equal if still), and its tagged index.
#[derive(Debug, Clone, Copy)]
pub(super) struct StoredTriangle {
    pub(super) begin: [Vec3A; 3],
    pub(super) end: [Vec3A; 3],
    pub(super) id: u32,
}

/// A leaf of a structure.
pub(super) trait Block: Sync + Send + Sized {
    /// A block of up to four triangles.
    fn new(triangles: &[Option<StoredTriangle>; BLOCK]) -> Self;

    /// Coordinate `axis` of corner `corner` of the four at fraction `time` of the segment.
    fn plane(&self, corner: usize, axis: usize, time: f32) -> Vec4;

    /// The corners of lane `lane` at fraction `time`.
    fn triangle(&self, lane: usize, time: f32) -> [Vec3A; 3];

    /// Tagged indices; [`NO_TRIANGLE`] for empty lanes.
    fn ids(&self) -> &[u32; BLOCK];
}

fn gather(triangles: &[Option<StoredTriangle>; BLOCK], value: impl Fn(&StoredTriangle, usize) -> Vec3A) -> Corners {
    std::array::from_fn(|corner| {
        std::array::from_fn(|axis| {
            // Empty lanes are not numbers: no comparison with them holds.
            Vec4::from_array(triangles.each_ref().map(|t| t.as_ref().map_or(f32::NAN, |t| value(t, corner)[axis])))
        })
    })
}

fn ids(triangles: &[Option<StoredTriangle>; BLOCK]) -> [u32; BLOCK] {
    triangles.each_ref().map(|t| t.as_ref().map_or(NO_TRIANGLE, |t| t.id))
}

impl Block for StillBlock {
    fn new(triangles: &[Option<StoredTriangle>; BLOCK]) -> Self {
        Self { corners: gather(triangles, |t, corner| t.begin[corner]), ids: ids(triangles) }
    }

    #[inline(always)]
    fn plane(&self, corner: usize, axis: usize, _time: f32) -> Vec4 {
        self.corners[corner][axis]
    }

    #[inline(always)]
    fn triangle(&self, lane: usize, _time: f32) -> [Vec3A; 3] {
        lane_of(&self.corners, lane)
    }

    #[inline(always)]
    fn ids(&self) -> &[u32; BLOCK] {
        &self.ids
    }
}

impl Block for MovingBlock {
    fn new(triangles: &[Option<StoredTriangle>; BLOCK]) -> Self {
        Self {
            corners: gather(triangles, |t, corner| t.begin[corner]),
            deltas: gather(triangles, |t, corner| t.end[corner] - t.begin[corner]),
            ids: ids(triangles),
        }
    }

    #[inline(always)]
    fn plane(&self, corner: usize, axis: usize, time: f32) -> Vec4 {
        self.corners[corner][axis] + Vec4::splat(time) * self.deltas[corner][axis]
    }

    #[inline(always)]
    fn triangle(&self, lane: usize, time: f32) -> [Vec3A; 3] {
        let (begin, deltas) = (lane_of(&self.corners, lane), lane_of(&self.deltas, lane));
        [0, 1, 2].map(|c| begin[c] + time * deltas[c])
    }

    #[inline(always)]
    fn ids(&self) -> &[u32; BLOCK] {
        &self.ids
    }
}

/// The corner at fraction `time` of the way from `begin` to `end`: what traversal intersects, operation by operation.
#[inline]
pub(in crate::trace) fn moved(begin: Vec3A, end: Vec3A, time: f32) -> Vec3A {
    begin + time * (end - begin)
}

/// A triangle that a ray meets.
#[derive(Debug, Clone, Copy)]
pub(super) struct Candidate {
    /// Distance in lengths of the direction, > 0.
    pub(super) t: f32,
    /// Weight of the second corner.
    pub(super) u: f32,
    /// Weight of the third corner.
    pub(super) v: f32,
    /// Whether the ray sees the counter-clockwise side.
    pub(super) front: bool,
}

/// Distances and weights of the lanes that are hit.
pub(super) struct LaneHits {
    /// Bit i: lane i is hit at 0 < t ≤ limit; or its fate needs [`decide`].
    pub(super) mask: u32,
    edges: [Vec4; 3],
    t: Vec4,
}

/// Edge functions whose sum is below this are computed once more in `f64`: where they vanish they have lost the
/// triangle, and t is a quotient of their products with a depth, which from here on could leave `f32`'s normal numbers.
const LOST: f32 = 1.0 / (1_u64 << 60) as f32;

/// Tests the four triangles of `block` at fraction `time`; `mask` 0 nearly always.
#[inline(always)]
pub(super) fn test<B: Block>(block: &B, time: f32, ray: &RayFrame, limit: f32) -> LaneHits {
    let [kx, ky, kz] = ray.k.map(|axis| axis as usize);
    let [sx, sy, sz] = ray.shear.map(Vec4::splat);
    let [ox, oy, oz] = ray.start.map(Vec4::splat);
    let sheared = |corner: usize| {
        let at = |axis: usize| block.plane(corner, axis, time);
        let z = at(kz) - oz;
        (at(kx) - ox - sx * z, at(ky) - oy - sy * z, z)
    };
    let (ax, ay, az) = sheared(0);
    let (bx, by, bz) = sheared(1);
    let (cx, cy, cz) = sheared(2);
    let u = cx * by - cy * bx;
    let v = ax * cy - ay * cx;
    let w = bx * ay - by * ax;
    let inside = u.min(v).min(w).cmpge(Vec4::ZERO) | u.max(v).max(w).cmple(Vec4::ZERO);
    let mut mask = inside.bitmask();
    let mut t = Vec4::ZERO;
    if mask != 0 {
        let det = u + v + w;
        t = (u * az + v * bz + w * cz) * sz / det;
        let lost = det.abs().cmplt(Vec4::splat(LOST));
        mask &= ((t.cmpgt(Vec4::ZERO) & t.cmple(Vec4::splat(limit))) | lost).bitmask();
    }
    LaneHits { mask, edges: [u, v, w], t }
}

/// The origin counts as near a triangle where t is below this share of its largest extent along the ray: then the sign
/// of t is decided in `f64`. 2⁻¹⁰ leaves 2¹³ roundings of room for triangles down to 1 : 1000 slivers.
const NEAR: f32 = 1.0 / 1024.0;

/// A lane by its number; an index into memory, where [`Vec4`]'s own would compare the number with each.
#[inline(always)]
fn of_lane(values: &Vec4, lane: usize) -> f32 {
    let values: &[f32; BLOCK] = values.as_ref();
    values[lane & (BLOCK - 1)]
}

/// The triangle of one lane.
#[inline(always)]
fn lane_of(corners: &Corners, lane: usize) -> [Vec3A; 3] {
    corners.each_ref().map(|[x, y, z]| Vec3A::new(of_lane(x, lane), of_lane(y, lane), of_lane(z, lane)))
}

/// Decides a lane of `hits`, which holds `triangle`, and refines it.
///
/// t is raised to where the ray enters the triangle's own box, so that no enclosing box can be entered later than t: the
/// nearest hit does not depend on the tree or on the order of traversal.
#[inline(always)]
pub(super) fn decide(
    triangle: &[Vec3A; 3],
    hits: &LaneHits,
    lane: usize,
    ray: &RayFrame,
    limit: f32,
) -> Option<Candidate> {
    let [u, v, w] = hits.edges.each_ref().map(|e| of_lane(e, lane));
    let det = u + v + w;
    let mut candidate = if det.abs() < LOST {
        exact(triangle, ray)?
    } else {
        Candidate { t: of_lane(&hits.t, lane), u: v / det, v: w / det, front: det > 0.0 }
    };
    let (lo, hi) = (triangle[0].min(triangle[1]).min(triangle[2]), triangle[0].max(triangle[1]).max(triangle[2]));
    let reach = (lo - ray.origin).abs().max((hi - ray.origin).abs()).max_element();
    if candidate.t * ray.speed <= reach * NEAR && !ahead(triangle, ray) {
        return None;
    }
    candidate.t = candidate.t.max(ray.entry(lo, hi));
    (candidate.t > 0.0 && candidate.t <= limit).then_some(candidate)
}

/// Whether the triangle's plane lies ahead of the origin.
///
/// Differences of `f32` and their products are exact or nearly so in `f64`: the side on which an origin lies is right
/// unless it is within 2⁻⁵⁰ of the triangle's extent of the plane, a millionth of an `f32`'s own step.
#[cold]
fn ahead(triangle: &[Vec3A; 3], ray: &RayFrame) -> bool {
    let [a, b, c] = triangle.map(|p| p.as_dvec3());
    let normal = (b - a).cross(c - a);
    let height = normal.dot(ray.origin.as_dvec3() - a);
    let approach = normal.dot(ray.direction.as_dvec3());
    height != 0.0 && approach != 0.0 && (height < 0.0) != (approach < 0.0)
}

/// The whole test of one triangle in `f64`, for edge functions that `f32` lost.
#[cold]
#[allow(clippy::cast_possible_truncation, reason = "results are stored as f32")]
fn exact(triangle: &[Vec3A; 3], ray: &RayFrame) -> Option<Candidate> {
    let [kx, ky, kz] = ray.k.map(|axis| axis as usize);
    let [sx, sy, sz] = ray.shear;
    // Sheared in f32 as in `test`: both sides of an edge must see the same corners.
    let sheared = |p: Vec3A| {
        let z = p[kz] - ray.origin[kz];
        let (x, y) = (p[kx] - ray.origin[kx] - sx * z, p[ky] - ray.origin[ky] - sy * z);
        DVec3::new(f64::from(x), f64::from(y), f64::from(z))
    };
    let [a, b, c] = triangle.map(sheared);
    let u = c.x * b.y - c.y * b.x;
    let v = a.x * c.y - a.y * c.x;
    let w = b.x * a.y - b.y * a.x;
    let det = u + v + w;
    if u.min(v).min(w) < 0.0 && u.max(v).max(w) > 0.0 || det == 0.0 {
        return None;
    }
    let t = (u * a.z + v * b.z + w * c.z) * f64::from(sz) / det;
    let candidate = Candidate { t: t as f32, u: (v / det) as f32, v: (w / det) as f32, front: det > 0.0 };
    (candidate.t > 0.0).then_some(candidate)
}
