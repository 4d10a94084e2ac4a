//! Reconstruction filters, sampled by importance.
//!
//! A run's position is drawn from the density |k(x)| / ∫|k| on each axis by inverting its distribution, which is
//! monotone, so strata of the design stay strata on the film. The run's weight is then sign(k) · ∫|k| / ∫k: constant
//! but for its sign, and 1 for every filter without negative lobes (Ernst, Stamminger and Greiner 2006).

use super::kernel::{FilterSpec, Kernel};
use glam::{DVec2, Vec2};

/// A separable reconstruction filter that is ready to be sampled.
///
/// The box and the tent are exact. Other kernels are taken as linear between 2048 nodes, of which some lie on their
/// sign changes: within 2·10⁻⁶ of the peak for the widths in use.
#[derive(Debug, Clone)]
pub struct Filter {
    spec: FilterSpec,
    axis: Axis,
}

#[derive(Debug, Clone)]
enum Axis {
    Box { width: f64 },
    Tent { radius: f64 },
    Table(Table),
}

/// The inverse of the distribution of |k|.
#[derive(Debug, Clone)]
struct Table {
    /// Node positions, ascending.
    nodes: Vec<f64>,
    /// |k| at the nodes.
    values: Vec<f64>,
    /// Share of ∫|k| below each node: from 0 to exactly 1.
    below: Vec<f64>,
    /// Weight in each cell between nodes.
    weights: Vec<f64>,
    /// For each of as many equal steps of u, a cell not after the one in which u falls.
    guide: Vec<u32>,
}

impl Filter {
    /// Prepares `spec`.
    #[must_use]
    pub fn new(spec: FilterSpec) -> Self {
        let axis = match spec.kernel {
            Kernel::Box => Axis::Box { width: spec.width },
            Kernel::Tent => Axis::Tent { radius: 0.5 * spec.width },
            _ => Axis::Table(Table::new(&spec)),
        };
        Self { spec, axis }
    }

    /// What it was made from.
    #[must_use]
    pub fn spec(&self) -> FilterSpec {
        self.spec
    }

    /// Whether every weight is exactly 1.
    #[must_use]
    pub fn is_positive(&self) -> bool {
        match &self.axis {
            Axis::Box { .. } | Axis::Tent { .. } => true,
            Axis::Table(table) => table.weights.iter().all(|&w| w.to_bits() == 1.0_f64.to_bits()),
        }
    }

    /// Offset from the pixel's centre, in pixels, and filter weight for `u` in [0, 1)².
    #[must_use]
    #[inline]
    #[allow(clippy::cast_possible_truncation, reason = "weights are f32 by contract")]
    pub fn sample(&self, u: Vec2) -> (DVec2, f32) {
        let (x, weight_x) = self.axis.sample(f64::from(u.x));
        let (y, weight_y) = self.axis.sample(f64::from(u.y));
        (DVec2::new(x, y), (weight_x * weight_y) as f32)
    }
}

impl Axis {
    #[inline]
    fn sample(&self, u: f64) -> (f64, f64) {
        match self {
            Self::Box { width } => ((u - 0.5) * width, 1.0),
            Self::Tent { radius } if u < 0.5 => (radius * ((2.0 * u).sqrt() - 1.0), 1.0),
            Self::Tent { radius } => (radius * (1.0 - (2.0 * (1.0 - u)).sqrt()), 1.0),
            Self::Table(table) => table.sample(u),
        }
    }
}

impl Table {
    const CELLS: u32 = 2048;

    fn new(spec: &FilterSpec) -> Self {
        let (nodes, signs) = nodes_and_signs(spec);
        let ends: Vec<_> = nodes.iter().map(|&x| spec.value(x).abs()).collect();
        let masses: Vec<_> =
            (0..signs.len()).map(|i| 0.5 * (ends[i] + ends[i + 1]) * (nodes[i + 1] - nodes[i])).collect();
        let absolute: f64 = masses.iter().sum();
        let signed: f64 = masses.iter().zip(&signs).map(|(m, s)| m * s).sum();
        let gain = if signs.iter().all(|&s| s > 0.0) { 1.0 } else { absolute / signed };
        let mut below = Vec::with_capacity(nodes.len());
        let mut sum = 0.0;
        for mass in &masses {
            below.push(sum / absolute);
            sum += mass;
        }
        below.push(1.0);
        let mut guide = Vec::with_capacity(Self::CELLS as usize);
        let mut cell = 0;
        for step in 0..Self::CELLS {
            while below[cell as usize + 1] <= f64::from(step) / f64::from(Self::CELLS) {
                cell += 1;
            }
            guide.push(cell);
        }
        Self { nodes, values: ends, below, weights: signs.iter().map(|s| s * gain).collect(), guide }
    }

    #[inline]
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "u is in [0, 1)")]
    fn sample(&self, u: f64) -> (f64, f64) {
        let step = (u * f64::from(Self::CELLS)) as usize;
        let mut cell = self.guide[step.min(self.guide.len() - 1)] as usize;
        let last = self.weights.len() - 1;
        while cell < last && self.below[cell + 1] <= u {
            cell += 1;
        }
        // The kernel is linear in the cell, so its mass is quadratic: solved in the form that cancels nothing.
        let (a, b) = (self.values[cell], self.values[cell + 1]);
        let mass = self.below[cell + 1] - self.below[cell];
        let share = if mass > 0.0 { ((u - self.below[cell]) / mass).clamp(0.0, 1.0) } else { 0.5 };
        let denominator = a + (a * a + share * (b * b - a * a)).max(0.0).sqrt();
        let t = if denominator > 0.0 { (share * (a + b) / denominator).min(1.0) } else { 0.5 };
        let x = self.nodes[cell] + t * (self.nodes[cell + 1] - self.nodes[cell]);
        (x, self.weights[cell])
    }
}

/// Ascending nodes over the whole support with a node at every sign change, and the sign between each two.
fn nodes_and_signs(spec: &FilterSpec) -> (Vec<f64>, Vec<f64>) {
    let radius = 0.5 * spec.width;
    let half = Table::CELLS / 2;
    let mut positive: Vec<f64> = (0..=half).map(|i| radius * f64::from(i) / f64::from(half)).collect();
    // Move the nearest inner node onto each sign change, found by bisection to the last bit.
    for i in 0..half as usize {
        let (mut low, mut high) = (positive[i], positive[i + 1]);
        let (start, end) = (spec.value(low), spec.value(high));
        if start * end >= 0.0 {
            continue;
        }
        loop {
            let middle = 0.5 * (low + high);
            if middle <= low || middle >= high {
                break;
            }
            if spec.value(middle) * start > 0.0 { low = middle } else { high = middle }
        }
        let near_low = low - positive[i] < positive[i + 1] - low;
        let place = if (near_low && i > 0) || i + 1 == half as usize { i } else { i + 1 };
        positive[place] = low;
    }
    let nodes: Vec<f64> = positive.iter().skip(1).rev().map(|x| -x).chain(positive.iter().copied()).collect();
    let signs =
        nodes.windows(2).map(|pair| if spec.value(0.5 * (pair[0] + pair[1])) < 0.0 { -1.0 } else { 1.0 }).collect();
    (nodes, signs)
}

#[cfg(test)]
mod tests {
    use super::*;

    const ALL: [&str; 10] = [
        "box",
        "box:2",
        "tent",
        "gaussian",
        "sharpened-gaussian",
        "mitchell:1/3,1/3",
        "mitchell:0,1/2",
        "mitchell:1,0",
        "lanczos",
        "blackman-harris",
    ];

    fn filter(text: &str) -> Filter {
        Filter::new(text.parse().unwrap())
    }

    /// ∫ g(x) k(x) dx / ∫ k by the midpoint rule over 10⁵ cells, of which the box's edges are cell edges.
    fn quadrature(spec: &FilterSpec, g: impl Fn(f64) -> f64) -> f64 {
        let n = 100_000;
        let (mut sum, mut total) = (0.0, 0.0);
        for i in 0..n {
            let x = spec.width * ((f64::from(i) + 0.5) / f64::from(n) - 0.5);
            sum += spec.value(x) * g(x);
            total += spec.value(x);
        }
        sum / total
    }

    /// The same by `n` equal strata of u.
    fn sampled(filter: &Filter, g: impl Fn(f64) -> f64) -> f64 {
        let n = 100_000;
        let mut sum = 0.0;
        for i in 0..n {
            let (x, weight) = filter.axis.sample((f64::from(i) + 0.5) / f64::from(n));
            sum += g(x) * weight;
        }
        sum / f64::from(n)
    }

    #[test]
    fn moments_of_samples_are_moments_of_the_kernel() {
        for text in ALL {
            let filter = filter(text);
            for (name, g) in [
                ("1", (|_| 1.0) as fn(f64) -> f64),
                ("x", |x| x),
                ("x²", |x| x * x),
                ("cos 3x", |x| libm::cos(3.0 * x)),
            ] {
                let (a, b) = (sampled(&filter, g), quadrature(&filter.spec(), g));
                // Each sign change may misplace one stratum: Lanczos has four within x² ≤ 4, so 4 · 4 · 1e-5.
                assert!((a - b).abs() < 1.7e-4, "{text} {name}: {a} {b}");
            }
        }
    }

    #[test]
    fn the_distribution_of_samples_is_that_of_the_kernel() {
        for text in ALL {
            let filter = filter(text);
            for edge in [-1.3, -0.6, -0.2, 0.0, 0.45, 1.1, 1.7] {
                let step = |x: f64| if x < edge { 1.0 } else { 0.0 };
                let (a, b) = (sampled(&filter, step), quadrature(&filter.spec(), step));
                assert!((a - b).abs() < 1e-4, "{text} below {edge}: {a} {b}");
            }
        }
    }

    #[test]
    fn the_box_is_the_identity_and_positive_filters_have_unit_weight() {
        let unit = filter("box");
        for u in [Vec2::ZERO, Vec2::new(0.25, 0.999), Vec2::splat(crate::numeric::ONE_MINUS)] {
            let (offset, weight) = unit.sample(u);
            assert_eq!(offset, DVec2::new(f64::from(u.x) - 0.5, f64::from(u.y) - 0.5));
            assert_eq!(weight.to_bits(), 1.0_f32.to_bits());
        }
        for text in ALL {
            let lobes = ["sharpened-gaussian", "mitchell:1/3,1/3", "mitchell:0,1/2", "lanczos"].contains(&text);
            assert_eq!(filter(text).is_positive(), !lobes, "{text}");
        }
    }

    #[test]
    fn samples_ascend_with_u_and_stay_in_the_support() {
        for text in ALL {
            let filter = filter(text);
            let radius = 0.5 * filter.spec().width;
            let mut last = -radius;
            for i in 0..=10_000 {
                let u = (f64::from(i) / 10_000.0).min(f64::from(crate::numeric::ONE_MINUS));
                let (x, _) = filter.axis.sample(u);
                assert!(x >= last && x <= radius, "{text} {u}: {last} {x}");
                last = x;
            }
        }
    }
}
