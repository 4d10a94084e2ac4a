//! Exact volumes and quadrature for the analytic image functions.

/// Nodes and weights of the eight-point Gauss–Legendre rule on [−1, 1], positive half (Abramowitz and Stegun 1964,
/// table 25.4): exact for polynomials of degree 15.
const GAUSS: [(f64, f64); 4] = [
    (0.183_434_642_495_649_8, 0.362_683_783_378_362),
    (0.525_532_409_916_329, 0.313_706_645_877_887_3),
    (0.796_666_477_413_626_7, 0.222_381_034_453_374_5),
    (0.960_289_856_497_536_3, 0.101_228_536_290_376_3),
];

/// Nodes and weights of `panels` equal Gauss panels over [a, b].
pub(crate) fn panels(a: f64, b: f64, panels: usize) -> impl Iterator<Item = (f64, f64)> {
    #[allow(clippy::cast_precision_loss, reason = "a count of panels")]
    let half = (b - a) / (2.0 * panels as f64);
    (0..panels).flat_map(move |panel| {
        #[allow(clippy::cast_precision_loss, reason = "a count of panels")]
        let middle = a + half * (2 * panel + 1) as f64;
        GAUSS.into_iter().flat_map(move |(node, weight)| {
            [(middle - half * node, weight * half), (middle + half * node, weight * half)]
        })
    })
}

/// ∫ f over [a, b] in `count` Gauss panels.
pub(crate) fn integrate(a: f64, b: f64, count: usize, mut f: impl FnMut(f64) -> f64) -> f64 {
    panels(a, b, count).map(|(x, weight)| weight * f(x)).sum()
}

/// ∫ f over [a, b] in Gauss panels between the `breaks`, `count` to each piece.
pub(crate) fn integrate_pieces(
    a: f64,
    b: f64,
    breaks: &mut Vec<f64>,
    count: usize,
    mut f: impl FnMut(f64) -> f64,
) -> f64 {
    breaks.retain(|&x| x > a && x < b);
    breaks.extend([a, b]);
    breaks.sort_unstable_by(f64::total_cmp);
    breaks.windows(2).map(|w| integrate(w[0], w[1], count, &mut f)).sum()
}

/// Volume of {p ∈ [0, 1)ᵈ : w·p < c}: an alternating sum over the cube's corners of (c − w·corner)₊ᵈ (Lasserre 1983).
/// Weights must not vanish; rounding grows as the inverse of their product.
pub(crate) fn half_space_volume(weights: &[f64], c: f64) -> f64 {
    let d = weights.len();
    let mut sum = 0.0;
    for corner in 0..1_u32 << d {
        let at: f64 = (0..d).filter(|&k| corner >> k & 1 == 1).map(|k| weights[k]).sum();
        let height = (c - at).max(0.0);
        let term = (0..d).fold(1.0, |power, _| power * height);
        sum += if corner.count_ones() % 2 == 0 { term } else { -term };
    }
    let scale = weights.iter().zip(1_u32..).fold(1.0, |product, (w, k)| product * w * f64::from(k));
    sum / scale
}

/// Share of [−½, ½] × width + centre that lies in (−h, h) for the sum of two independent uniform variables of widths
/// `a` and `b`: the difference of a trapezoid's distribution function.
pub(crate) fn two_uniforms_between(a: f64, b: f64, low: f64, high: f64) -> f64 {
    let below = |z: f64| half_space_volume(&[a, b], z + 0.5 * (a + b));
    below(high) - below(low)
}

/// Area that circles of radii `r` and `s` at distance `d` have in common.
pub(crate) fn circles_overlap(r: f64, s: f64, d: f64) -> f64 {
    use std::f64::consts::PI;
    if d >= r + s {
        return 0.0;
    }
    if d <= (r - s).abs() {
        return PI * r.min(s).powi(2);
    }
    let a = (d * d + r * r - s * s) / (2.0 * d);
    let b = d - a;
    let segment = |radius: f64, x: f64| {
        radius * radius * libm::acos((x / radius).clamp(-1.0, 1.0)) - x * (radius * radius - x * x).max(0.0).sqrt()
    };
    segment(r, a) + segment(s, b)
}

/// Area of the rectangle [x₀, x₁] × [y₀, y₁] inside the circle of radius `r` about the origin.
pub(crate) fn circle_rectangle_overlap(r: f64, x: [f64; 2], y: [f64; 2]) -> f64 {
    let (low, high) = (x[0].max(-r), x[1].min(r));
    if low >= high {
        return 0.0;
    }
    let root = |v: f64| (r * r - v * v).max(0.0).sqrt();
    let area = |v: f64| 0.5 * (v * root(v) + r * r * libm::asin((v / r).clamp(-1.0, 1.0)));
    let mut cuts = [low, high, -root(y[0]), root(y[0]), -root(y[1]), root(y[1])].map(|c| c.clamp(low, high));
    cuts.sort_unstable_by(f64::total_cmp);
    cuts.windows(2)
        .map(|w| {
            let (a, b) = (w[0], w[1]);
            if a >= b {
                return 0.0;
            }
            let h = root(0.5 * (a + b));
            if h <= y[0] || -h >= y[1] {
                return 0.0;
            }
            let arc = area(b) - area(a);
            let top = if h < y[1] { arc } else { y[1] * (b - a) };
            let bottom = if -h > y[0] { -arc } else { y[0] * (b - a) };
            top - bottom
        })
        .sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The share of a fine grid of the unit square (or cube) where `inside` holds.
    fn counted(dimensions: u32, inside: impl Fn(&[f64]) -> bool) -> f64 {
        let side = if dimensions == 2 { 1000_u32 } else { 100 };
        let all = side.pow(dimensions);
        let hits = (0..all)
            .filter(|i| {
                let p: Vec<f64> =
                    (0..dimensions).map(|k| (f64::from(i / side.pow(k) % side) + 0.5) / f64::from(side)).collect();
                inside(&p)
            })
            .count();
        hits as f64 / f64::from(all)
    }

    #[test]
    fn half_space_volumes_agree_with_counting() {
        for (w, c) in [([0.3, -0.8, 1.7], 0.5), ([1.0, 1.0, 1.0], 1.5), ([-2.0, 0.1, 0.4], -0.6)] {
            let counted = counted(3, |p| p.iter().zip(w).map(|(p, w)| p * w).sum::<f64>() < c);
            assert!((half_space_volume(&w, c) - counted).abs() < 5e-3, "{w:?}");
        }
    }

    #[test]
    fn overlaps_agree_with_counting() {
        for (r, s, d) in [(0.3, 0.2, 0.25), (0.4, 0.1, 0.2), (0.2, 0.3, 0.6), (0.25, 0.4, 0.3)] {
            let counted = counted(2, |p| {
                let (x, y) = (p[0] - 0.5, p[1] - 0.5);
                x.hypot(y) < r && (x - d).hypot(y) < s
            });
            assert!((circles_overlap(r, s, d) - counted).abs() < 2e-3, "{r} {s} {d}");
        }
        for (r, x, y) in
            [(0.4, [0.1, 0.3], [-0.2, 0.5]), (0.3, [-0.5, 0.5], [0.1, 0.2]), (0.2, [-0.4, 0.0], [-0.4, 0.1])]
        {
            let counted = counted(2, |p| {
                let (px, py) = (p[0] - 0.5, p[1] - 0.5);
                px.hypot(py) < r && px >= x[0] && px < x[1] && py >= y[0] && py < y[1]
            });
            assert!((circle_rectangle_overlap(r, x, y) - counted).abs() < 2e-3, "{r} {x:?} {y:?}");
        }
    }
}
