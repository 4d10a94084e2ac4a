//! How lights are grouped: splits by the surface area orientation heuristic over binned centres (Conty and Kulla 2018,
//! §4.4).

use super::Extent;
use glam::Vec3;
use std::f32::consts::PI;

/// The extent of all `items` together.
pub(super) fn union_of(lights: &[Extent], items: &[u32]) -> Extent {
    let mut all = lights[items[0] as usize];
    for &i in &items[1..] {
        all = union(&all, &lights[i as usize]);
    }
    all
}

fn union(a: &Extent, b: &Extent) -> Extent {
    let boxes = std::array::from_fn(|t| [a.boxes[t][0].min(b.boxes[t][0]), a.boxes[t][1].max(b.boxes[t][1])]);
    let strength = a.strength + b.strength;
    let (axis, cos_normals) = cone_union(a, b);
    Extent { boxes, axis, cos_normals, cos_emission: a.cos_emission.min(b.cos_emission), strength }
}

/// The least cone that holds two, rounded outwards.
fn cone_union(a: &Extent, b: &Extent) -> (Vec3, f32) {
    let (a, b) = if a.cos_normals <= b.cos_normals { (a, b) } else { (b, a) };
    if a.cos_normals <= -1.0 {
        return (a.axis, -1.0);
    }
    let between = libm::acosf(a.axis.dot(b.axis).clamp(-1.0, 1.0));
    let (theta_a, theta_b) = (libm::acosf(a.cos_normals.min(1.0)), libm::acosf(b.cos_normals.min(1.0)));
    if between + theta_b <= theta_a {
        return (a.axis, a.cos_normals);
    }
    // acos near 1 errs by up to √(2 u) = 3.5e-4; widening by that keeps every normal inside.
    let theta = 0.5 * (theta_a + between + theta_b) + 3.5e-4;
    let side = a.axis.cross(b.axis);
    if theta >= PI || side.length_squared() <= 0.0 {
        return (a.axis, if theta >= PI || between > 1.0 { -1.0 } else { libm::cosf(theta) });
    }
    let turn = theta - theta_a;
    let (sin, cos) = crate::numeric::sin_cos(turn);
    let across = side.cross(a.axis).normalize();
    ((a.axis * cos + across * sin).normalize(), libm::cosf(theta + 3.5e-4).max(-1.0))
}

const BINS: usize = 12;

/// Reorders `items` about the best split; how many come first, at least 1 and not all.
pub(super) fn partition(lights: &[Extent], items: &mut [u32], depth: u32) -> usize {
    let half = items.len() / 2;
    let centre = |i: u32| {
        let b = &lights[i as usize].boxes;
        b[0][0] + b[0][1] + b[1][0] + b[1][1]
    };
    let (mut low, mut high) = (Vec3::INFINITY, Vec3::NEG_INFINITY);
    for &i in items.iter() {
        (low, high) = (low.min(centre(i)), high.max(centre(i)));
    }
    let size = high - low;
    // Very deep trees come from strengths that grow geometrically; halving bounds the depth by that plus log₂ n.
    const DEEPEST: u32 = 40;
    if size.max_element() <= 0.0 || !size.max_element().is_finite() || depth > DEEPEST {
        let axis = size.max_position();
        items.select_nth_unstable_by(half, |&a, &b| centre(a)[axis].total_cmp(&centre(b)[axis]).then(a.cmp(&b)));
        return half;
    }
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a bin index")]
    let bin = |i: u32, axis: usize| (((centre(i)[axis] - low[axis]) / size[axis] * BINS as f32) as usize).min(BINS - 1);
    let mut best: Option<(f32, usize, usize)> = None;
    // All three axes where it is cheap; the longest alone for the few large nodes at the top.
    let longest = size.max_position();
    for axis in 0..3 {
        if size[axis] <= 0.0 || (items.len() > 4096 && axis != longest) {
            continue;
        }
        let mut bins: [Option<Extent>; BINS] = [None; BINS];
        for &i in items.iter() {
            let slot = &mut bins[bin(i, axis)];
            let light = &lights[i as usize];
            *slot = Some(slot.map_or(*light, |e| union(&e, light)));
        }
        let stretch = size.max_element() / size[axis];
        for (cut, cost) in cut_costs(&bins) {
            let cost = cost * stretch;
            if best.is_none_or(|(least, ..)| cost < least) {
                best = Some((cost, axis, cut));
            }
        }
    }
    if let Some((_, axis, cut)) = best {
        let mut first = 0;
        for i in 0..items.len() {
            if bin(items[i], axis) < cut {
                items.swap(first, i);
                first += 1;
            }
        }
        if first > 0 && first < items.len() {
            return first;
        }
    }
    items.select_nth_unstable_by(half, |&a, &b| centre(a)[longest].total_cmp(&centre(b)[longest]).then(a.cmp(&b)));
    half
}

/// The orientation heuristic's cost of cutting before each bin that leaves something on both sides.
fn cut_costs(bins: &[Option<Extent>; BINS]) -> impl Iterator<Item = (usize, f32)> {
    let join = |a: Option<Extent>, b: Option<Extent>| match (a, b) {
        (Some(a), Some(b)) => Some(union(&a, &b)),
        (a, b) => a.or(b),
    };
    let mut costs = [None; BINS];
    let mut left = None;
    for cut in 1..BINS {
        left = join(left, bins[cut - 1]);
        costs[cut] = left.as_ref().map(cost);
    }
    let mut right = None;
    for cut in (1..BINS).rev() {
        right = join(bins[cut], right);
        costs[cut] = costs[cut].zip(right.as_ref().map(cost)).map(|(a, b)| a + b);
    }
    costs.into_iter().enumerate().filter_map(|(cut, c)| c.map(|c| (cut, c)))
}

/// Conty and Kulla (2018), eq. 1: strength × surface area × measure of the emission's directions.
pub(super) fn cost(e: &Extent) -> f32 {
    let area = |b: &[Vec3; 2]| {
        let s = b[1] - b[0];
        2.0 * (s.x * s.y + s.y * s.z + s.z * s.x)
    };
    let o = libm::acosf(e.cos_normals.clamp(-1.0, 1.0));
    let w = (o + libm::acosf(e.cos_emission.clamp(-1.0, 1.0))).min(PI);
    let sin_o = libm::sinf(o);
    let measure = 2.0 * PI * (1.0 - e.cos_normals)
        + 0.5 * PI * (2.0 * w * sin_o - libm::cosf(o - 2.0 * w) - 2.0 * o * sin_o + e.cos_normals);
    e.strength * measure * 0.5 * (area(&e.boxes[0]) + area(&e.boxes[1]))
}
