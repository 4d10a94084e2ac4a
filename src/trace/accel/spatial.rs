//! Splits in space: a triangle that reaches into both children is cut, and each child holds the piece on its side
//! (Stich, Friedrich and Dietrich 2009, *Spatial Splits in Bounding Volume Hierarchies*).
//!
//! A ray that the triangle test hits meets the piece's box: the piece is an image of part of the triangle under the same
//! roundings that the box test allows for (`frame`), and the cut itself is rounded outward.

use super::topology::{Bin, Border, Extent, Parts, Reference, half_area};
use crate::numeric::UNIT_ROUNDOFF;
use glam::Vec3A;

/// How many pieces `count` references may grow by: a tenth keeps large structures below 80 bytes a triangle and brings
/// most of the gain (measured); in small ones half costs at most 3 MB.
pub(super) fn spare(count: usize) -> usize {
    (count / 10).max(count.min(1 << 16) / 2)
}

/// Fewest references that are split in space.
pub(super) const FEWEST: usize = 16;

/// Bins along each axis.
const BINS: usize = 16;

/// Cutting is considered where the children's boxes overlap in more than this share of everything's surface: below it
/// too few rays pass to repay the search (Stich et al. 2009, §4.2; their 1e-5 builds three times slower for no gain).
const WORTH: f32 = 1e-3;

/// And in more than this share of the node's own surface. A mesh of small triangles stays below it and is built as fast
/// as without cuts; a hall that stands askew is traced half as fast again.
const OVERLAP: f32 = 0.3;

/// A plane to cut at, and what it costs.
struct Cut {
    axis: usize,
    plane: f32,
    cost: f32,
    /// Bounds of both sides, and how many references reach into each.
    sides: [Bin; 2],
}

/// Splits the first `count` of `references` at a plane if that is cheaper than `whole_references` and there is room.
pub(super) fn split(
    references: &mut [Reference],
    count: usize,
    extent: &Extent,
    whole_references: &Border,
    corners: &(dyn Fn(u32) -> [Vec3A; 3] + Sync),
    whole: f32,
) -> Option<Parts> {
    let [a, b] = &whole_references.parts;
    let overlap = half_area(a.lo.max(b.lo), a.hi.min(b.hi));
    let disjoint = !a.lo.max(b.lo).cmple(a.hi.min(b.hi)).all();
    let own = half_area(extent.lo, extent.hi);
    let pays = !disjoint && overlap > WORTH * whole && overlap > OVERLAP * own;
    // Not finite: where areas overflow nothing can be compared.
    if count < FEWEST || references.len() <= count || !pays || !whole.is_finite() {
        return None;
    }
    let cut = cheapest(&references[..count], extent, corners)?;
    let room = references.len() - count;
    let pieces = (cut.sides[0].count + cut.sides[1].count) as usize - count;
    let fits = cut.cost < whole_references.cost && pieces <= room;
    if fits { perform(references, count, &cut, corners) } else { None }
}

/// The cheapest plane between bins over the box of `extent`.
#[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, clippy::cast_precision_loss, reason = "16 bins")]
fn cheapest(references: &[Reference], extent: &Extent, corners: &(dyn Fn(u32) -> [Vec3A; 3] + Sync)) -> Option<Cut> {
    let mut best: Option<Cut> = None;
    for axis in 0..3 {
        let (origin, size) = (extent.lo[axis], extent.hi[axis] - extent.lo[axis]);
        let (scale, step) = (BINS as f32 / size, size / BINS as f32);
        if !(scale.is_finite() && step > 0.0) {
            continue;
        }
        let bin_of = |x: f32| (((x - origin) * scale) as usize).min(BINS - 1);
        let plane = |i: usize| origin + step * i as f32;
        let mut bins = [Bin::EMPTY; BINS];
        let (mut enter, mut leave) = ([0_u32; BINS], [0_u32; BINS]);
        for r in references {
            let (first, last) = (bin_of(r.lo()[axis]), bin_of(r.hi()[axis]));
            enter[first] += 1;
            leave[last] += 1;
            let mut rest = *r;
            if first < last {
                let triangle = corners(r.id());
                for (i, bin) in bins.iter_mut().enumerate().take(last).skip(first) {
                    let [below, above] = rest.cut(&triangle, axis, plane(i + 1));
                    bin.join(&Bin { lo: below.lo(), hi: below.hi(), count: 0 });
                    rest = above;
                }
            }
            bins[last].join(&Bin { lo: rest.lo(), hi: rest.hi(), count: 0 });
        }
        let mut right = [Bin::EMPTY; BINS];
        for i in (1..BINS).rev() {
            right[i - 1] = bins[i];
            right[i - 1].count = leave[i];
            if i < BINS - 1 {
                let beyond = right[i];
                right[i - 1].join(&beyond);
            }
        }
        let mut left = Bin::EMPTY;
        for i in 0..BINS - 1 {
            left.join(&Bin { count: enter[i], ..bins[i] });
            let cost = left.cost() + right[i].cost();
            if cost < best.as_ref().map_or(f32::INFINITY, |b| b.cost) {
                best = Some(Cut { axis, plane: plane(i + 1), cost, sides: [left, right[i]] });
            }
        }
    }
    best
}

/// Sorts references to the sides of `cut`; those that reach into both are cut unless keeping them whole is cheaper.
#[allow(clippy::cast_precision_loss, reason = "costs, not counts")]
fn perform(
    references: &mut [Reference],
    count: usize,
    cut: &Cut,
    corners: &(dyn Fn(u32) -> [Vec3A; 3] + Sync),
) -> Option<Parts> {
    let mut sides = cut.sides;
    let (mut lefts, mut rights) = (Vec::with_capacity(count), Vec::with_capacity(count));
    for r in &references[..count] {
        if r.hi()[cut.axis] <= cut.plane {
            lefts.push(*r);
        } else if r.lo()[cut.axis] >= cut.plane {
            rights.push(*r);
        } else {
            let area = |bin: &Bin| half_area(bin.lo, bin.hi);
            let with = |bin: &Bin| half_area(bin.lo.min(r.lo()), bin.hi.max(r.hi()));
            let n = sides.map(|s| s.count as f32);
            let both = area(&sides[0]) * n[0] + area(&sides[1]) * n[1];
            let left = with(&sides[0]) * n[0] + area(&sides[1]) * (n[1] - 1.0);
            let right = area(&sides[0]) * (n[0] - 1.0) + with(&sides[1]) * n[1];
            if both <= left && both <= right {
                let [below, above] = r.cut(&corners(r.id()), cut.axis, cut.plane);
                lefts.push(below);
                rights.push(above);
            } else {
                let (to, from, list) = if left < right { (0, 1, &mut lefts) } else { (1, 0, &mut rights) };
                sides[to].join(&Bin { lo: r.lo(), hi: r.hi(), count: 0 });
                sides[from].count -= 1;
                list.push(*r);
            }
        }
    }
    let counts = [lefts.len(), rights.len()];
    // A split that leaves all on one side is none.
    if counts.contains(&0) || counts.contains(&count) || counts[0] + counts[1] > references.len() {
        return None;
    }
    let mut extents = [Extent::EMPTY; 2];
    lefts.iter().for_each(|r| extents[0].add(r));
    rights.iter().for_each(|r| extents[1].add(r));
    references[..counts[0]].copy_from_slice(&lefts);
    references[counts[0]..counts[0] + counts[1]].copy_from_slice(&rights);
    Some(Parts { counts, extents })
}

impl Reference {
    /// The parts of this reference to `triangle` below and above a plane of `axis` that goes through its box.
    fn cut(&self, triangle: &[Vec3A; 3], axis: usize, plane: f32) -> [Self; 2] {
        let (mut below, mut above) = ((Vec3A::INFINITY, Vec3A::NEG_INFINITY), (Vec3A::INFINITY, Vec3A::NEG_INFINITY));
        let add = |to: &mut (Vec3A, Vec3A), p: Vec3A| *to = (to.0.min(p), to.1.max(p));
        for i in 0..3 {
            let (a, b) = (triangle[i], triangle[(i + 1) % 3]);
            if a[axis] <= plane {
                add(&mut below, a);
            }
            if a[axis] >= plane {
                add(&mut above, a);
            }
            if (a[axis] < plane && b[axis] > plane) || (a[axis] > plane && b[axis] < plane) {
                let crossing = a + (b - a) * ((plane - a[axis]) / (b[axis] - a[axis]));
                add(&mut below, crossing);
                add(&mut above, crossing);
            }
        }
        // The crossing carries five roundings of numbers up to twice the largest coordinate, the share among them.
        let reach =
            self.lo().abs().max(self.hi().abs()).max(triangle[0].abs()).max(triangle[1].abs()).max(triangle[2].abs());
        let pad = reach * (16.0 * UNIT_ROUNDOFF) + Vec3A::splat(f32::MIN_POSITIVE);
        let piece = |(lo, hi): (Vec3A, Vec3A), most: Vec3A, least: Vec3A| {
            let (lo, hi) = ((lo - pad).max(self.lo()).max(least), (hi + pad).min(self.hi()).min(most));
            // A corner of the box outside the triangle may leave nothing: any point of the box then does.
            let (lo, hi) = (lo.min(hi), hi.max(lo));
            let share = half_area(lo, hi) / half_area(self.lo(), self.hi());
            Self::new(lo, hi, self.id(), if share <= 1.0 { self.area() * share } else { self.area() })
        };
        let at = |value: f32, other: f32| {
            let mut p = Vec3A::splat(other);
            p[axis] = value;
            p
        };
        [
            piece(below, at(plane, f32::INFINITY), Vec3A::NEG_INFINITY),
            piece(above, Vec3A::INFINITY, at(plane, f32::NEG_INFINITY)),
        ]
    }
}

#[cfg(test)]
mod tests {
    use super::super::choice::LeafRule;
    use super::super::topology;
    use super::*;
    use proptest::prelude::*;

    fn point() -> impl Strategy<Value = Vec3A> {
        prop::array::uniform3(-1.0_f32..1.0).prop_map(Vec3A::from_array)
    }

    proptest! {
        /// Points of the triangle, computed in `f64`, lie in the piece on their side.
        #[test]
        fn pieces_enclose_the_triangle_on_their_side(
            corners in prop::array::uniform3(point()), axis in 0_usize..3, at in 0.01_f32..0.99,
            weights in prop::collection::vec((0.0_f64..1.0, 0.0_f64..1.0), 64), shift in -1e6_f32..1e6,
        ) {
            let corners = corners.map(|c| c + Vec3A::splat(shift));
            let [a, b, c] = corners;
            let whole = Reference::new(a.min(b).min(c), a.max(b).max(c), 7, 1.0);
            let plane = whole.lo()[axis] + at * (whole.hi()[axis] - whole.lo()[axis]);
            prop_assume!(whole.lo()[axis] < plane && plane < whole.hi()[axis]);
            let [below, above] = whole.cut(&corners, axis, plane);
            prop_assert!(below.hi()[axis] <= plane && above.lo()[axis] >= plane);
            for (u, v) in weights {
                let (u, v) = if u + v > 1.0 { (1.0 - u, 1.0 - v) } else { (u, v) };
                let [a, b, c] = corners.map(|p| p.as_dvec3());
                let p = a + (b - a) * u + (c - a) * v;
                let piece = if p[axis] <= f64::from(plane) { &below } else { &above };
                prop_assert!(piece.lo().as_dvec3().cmple(p).all() && piece.hi().as_dvec3().cmpge(p).all());
            }
        }
    }

    /// Beams askew among pebbles: what spatial splits are for.
    fn beams() -> Vec<[Vec3A; 3]> {
        let at = |i: u16, k: u32| f32::from(i.wrapping_mul(40_503).rotate_left(k)) / 65_536.0;
        (0..400_u16)
            .map(|i| {
                let p = Vec3A::new(at(i, 0), at(i, 5), at(i, 11));
                let q = if i % 4 == 0 { Vec3A::new(at(i, 3), at(i, 7), at(i, 13)) } else { p + Vec3A::splat(0.01) };
                [p, q, p + Vec3A::new(0.01, 0.0, 0.005)]
            })
            .collect()
    }

    #[test]
    fn cuts_lower_the_cost_and_lose_no_triangle() {
        let triangles = beams();
        let build = |cut: bool| {
            let mut references: Vec<Reference> = (0_u32..)
                .zip(&triangles)
                .map(|(i, [a, b, c])| Reference::new(a.min(*b).min(*c), a.max(*b).max(*c), i, 1.0))
                .collect();
            let corners = |id: u32| triangles[id as usize];
            let rule = LeafRule { most: 4, cost: 0.6 };
            let nodes = topology::build(&mut references, if cut { Some(&corners) } else { None }, rule);
            (nodes, references)
        };
        let ((plain, _), (cut, references)) = (build(false), build(true));
        let cost = |nodes: &[topology::Node2]| nodes.iter().map(topology::Node2::half_area).sum::<f32>();
        assert!(cost(&cut) < 0.9 * cost(&plain), "{} {}", cost(&cut), cost(&plain));
        let mut seen = vec![0; triangles.len()];
        let mut pending = vec![0_usize];
        while let Some(at) = pending.pop() {
            let node = &cut[at];
            if node.right() == 0 {
                seen[references[node.first() as usize].id() as usize] += 1;
            } else {
                pending.extend([at + 1, node.right() as usize]);
            }
        }
        assert!(seen.iter().all(|&n| n >= 1) && seen.iter().any(|&n| n > 1), "every triangle, some in pieces");
    }
}
