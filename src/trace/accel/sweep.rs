//! Linear bounds of what moves by a matrix, by its vertices, or by both.
//!
//! Where neither jumps nor bends, a vertex goes from v₀ to v₁ and the matrix from M₀ to M₁ linearly, so the point
//! p(f) = M(f) v(f) is quadratic in f. Expanded,
//!
//! p(f) = (1 − f) M₀v₀ + f M₁v₁ − f (1 − f) (M₁ − M₀)(v₁ − v₀).
//!
//! The first two terms are bounded by the line between the boxes of M₀v₀ and M₁v₁ (for any vertex, so for the least of
//! all), and f (1 − f) ≤ ¼: widening that line by ¼ |M₁ − M₀| max|v₁ − v₀| encloses the motion at every time. A still
//! mesh (v₁ = v₀) or a still matrix needs no widening: its motion is linear.
//!
//! A span of time with knots inside is bounded piece by piece, and one line is laid below (above) all of them: the
//! chord of the ends, shifted by the most that any knot lies beyond it. Between knots both are lines.

use super::linear::{Aabb, LinearBox, absolute};
use crate::numeric::UNIT_ROUNDOFF;
use crate::scene::Motion;
use crate::scene::motion::{lerp, segment_at};
use glam::{Affine3A, Vec3A};

/// How a mesh's own shape changes: boxes at its key times, and how far any vertex goes in each segment.
#[derive(Debug, Clone)]
pub(super) struct ShapeMotion {
    /// Key times; one where it stands still.
    pub(super) times: Vec<f32>,
    /// Box of all vertices at each key.
    pub(super) boxes: Vec<Aabb>,
    /// Most that any vertex moves along each axis, by segment.
    pub(super) reach: Vec<Vec3A>,
}

impl ShapeMotion {
    /// Box at fraction `f` of segment `segment`.
    fn at(&self, segment: usize, f: f32) -> Aabb {
        if self.boxes.len() == 1 {
            return self.boxes[0];
        }
        let (a, b) = (&self.boxes[segment], &self.boxes[segment + 1]);
        let blended = Aabb { lo: a.lo * (1.0 - f) + b.lo * f, hi: a.hi * (1.0 - f) + b.hi * f };
        let most = a.magnitude().max(b.magnitude());
        blended.widened(Vec3A::splat(4.0 * UNIT_ROUNDOFF * most))
    }
}

/// Fraction of segment `segment` of `times` at which `time` lies.
fn fraction(times: &[f32], segment: usize, time: f32) -> f32 {
    let (a, b) = (times[segment], times[segment + 1]);
    if b > a { ((time - a) / (b - a)).clamp(0.0, 1.0) } else { 1.0 }
}

/// Bounds at the ends of a piece in which nothing bends.
struct Piece {
    times: [f32; 2],
    boxes: [Aabb; 2],
}

/// The piece of `motion` and `shape` between the neighbouring knots `begin` < `end`.
fn piece(motion: &Motion, shape: &ShapeMotion, begin: f32, end: f32) -> Piece {
    let middle = 0.5 * (begin + end);
    let matrix_segment = if motion.is_still() { 0 } else { segment_at(motion.times(), middle).0 };
    let shape_segment = if shape.boxes.len() == 1 { 0 } else { segment_at(&shape.times, middle).0 };
    let matrix = |time: f32| {
        if motion.is_still() {
            return motion.keys()[0];
        }
        let f = fraction(motion.times(), matrix_segment, time);
        lerp(&motion.keys()[matrix_segment], &motion.keys()[matrix_segment + 1], f)
    };
    let form = |time: f32| {
        if shape.boxes.len() == 1 {
            return shape.boxes[0];
        }
        shape.at(shape_segment, fraction(&shape.times, shape_segment, time))
    };
    let matrices = [matrix(begin), matrix(end)];
    let forms = [form(begin), form(end)];
    let mut bulge = Vec3A::ZERO;
    if !motion.is_still() && shape.boxes.len() > 1 {
        let change = difference(&matrices[1], &matrices[0]);
        // The whole segment's reach bounds that of a part of it; 8u for the roundings of the bound itself.
        let widest = absolute(&change).transform_vector3a(shape.reach[shape_segment]);
        bulge = widest * (0.25 * (1.0 + 8.0 * UNIT_ROUNDOFF));
    }
    let boxes = [0, 1].map(|i| {
        let b = forms[i].transformed(&matrices[i]);
        // The matrix at a ray's time is itself rounded (3u an entry), and so is its inverse.
        let slack = absolute(&matrices[i]).transform_point3a(forms[i].lo.abs().max(forms[i].hi.abs()));
        b.widened(bulge + slack * (16.0 * UNIT_ROUNDOFF))
    });
    Piece { times: [begin, end], boxes }
}

fn difference(a: &Affine3A, b: &Affine3A) -> Affine3A {
    Affine3A { matrix3: a.matrix3 - b.matrix3, translation: a.translation - b.translation }
}

/// Linear bounds of `shape` moved by `motion` over times from `begin` to `end`; encloses at every time in between.
pub(super) fn swept(motion: &Motion, shape: &ShapeMotion, begin: f32, end: f32) -> LinearBox {
    if shape.boxes.iter().all(Aabb::is_empty) {
        return LinearBox::EMPTY;
    }
    if motion.is_still() && shape.boxes.len() == 1 {
        return LinearBox::still(shape.boxes[0].transformed(&motion.keys()[0]));
    }
    let knots = knots(motion, shape, begin, end);
    let mut pieces: Vec<Piece> = knots.windows(2).map(|w| piece(motion, shape, w[0], w[1])).collect();
    for (times, is_motion) in [(motion.times(), true), (&shape.times[..], false)] {
        // A jump seen at exactly its own time: the keys on both sides, as they are.
        for (i, w) in times.windows(2).enumerate().filter(|(_, w)| w[0] >= w[1] && w[0] >= begin && w[0] <= end) {
            for key in [i, i + 1] {
                let matrix = if is_motion { motion.keys()[key] } else { motion.at(w[0]) };
                let form = if is_motion { around_time(shape, w[0]) } else { shape.boxes[key] };
                let b = form.transformed(&matrix);
                pieces.push(Piece { times: [w[0], w[0]], boxes: [b, b] });
            }
        }
    }
    line_around(&pieces, begin, end)
}

/// Box of the shape at `time`, on both sides of a jump.
fn around_time(shape: &ShapeMotion, time: f32) -> Aabb {
    if shape.boxes.len() == 1 {
        return shape.boxes[0];
    }
    let (segment, f) = segment_at(&shape.times, time);
    let here = shape.at(segment, f);
    let jumps = shape.times.iter().zip(&shape.boxes).filter(|(t, _)| (**t - time).abs() <= 0.0);
    jumps.fold(here, |all, (_, b)| all.join(b))
}

/// Times from `begin` to `end` between which nothing bends.
fn knots(motion: &Motion, shape: &ShapeMotion, begin: f32, end: f32) -> Vec<f32> {
    let inside = motion.times().iter().chain(&shape.times).copied().filter(|&t| t > begin && t < end);
    let mut knots: Vec<f32> = std::iter::once(begin).chain(inside).chain(std::iter::once(end)).collect();
    knots.sort_by(f32::total_cmp);
    knots.dedup_by(|a, b| a.total_cmp(b).is_eq());
    knots
}

/// The chord over all pieces, shifted outward until it encloses them.
fn line_around(pieces: &[Piece], begin: f32, end: f32) -> LinearBox {
    let ends = |time: f32| {
        pieces
            .iter()
            .flat_map(|p| [0, 1].map(|i| (p.times[i], p.boxes[i])))
            .fold(Aabb::EMPTY, |all, (t, b)| if (t - time).abs() <= 0.0 { all.join(&b) } else { all })
    };
    let (mut first, mut last) = (ends(begin), ends(end));
    if last.is_empty() {
        last = first;
    }
    let (mut below, mut above) = (Vec3A::ZERO, Vec3A::ZERO);
    for piece in pieces {
        for (time, b) in piece.times.iter().zip(&piece.boxes) {
            let f = if end > begin { (time - begin) / (end - begin) } else { 0.0 };
            below = below.max(first.lo * (1.0 - f) + last.lo * f - b.lo);
            above = above.max(b.hi - (first.hi * (1.0 - f) + last.hi * f));
        }
    }
    // The chord and the shift carry four roundings of numbers up to the greatest coordinate, f three.
    let most = first.magnitude().max(last.magnitude()).max(below.max_element()).max(above.max_element());
    let pad = Vec3A::splat(16.0 * UNIT_ROUNDOFF * most);
    for b in [&mut first, &mut last] {
        b.lo = b.lo - below - pad;
        b.hi = b.hi + above + pad;
    }
    LinearBox { begin: first, end: last }
}
