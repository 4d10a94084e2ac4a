//! The functions that nets are tuned for, as what they make of two points' common digits.
//!
//! A function is a half-space w·x > c whose boundary may lie anywhere: what an edge is that moves, defocuses or shades.
//! Two points are then on different sides as often as |w·(x − y)| is long, and
//!
//!     |z| = (2/π) ∫ (1 − cos(s z)) s⁻² ds.
//!
//! Signs of x − y being as likely as not, the mean of the cosine is a product over the factors of means of
//! cos(s wⱼ dⱼ). The variance of a scrambled net depends on nothing else than such means over pairs of points that
//! agree in given numbers of leading digits (Owen 1997): no interaction of the function's factors is left out. Averaged
//! over hundreds of functions and waves they make a table by numbers of digits, a *kernel*; the variance is a sum of
//! its entries over the net's points.

/// A small generator of independent numbers (SplitMix64, Steele, Lea and Flood 2014).
pub struct Random(pub u64);

impl Random {
    pub fn bits(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut x = self.0;
        x = (x ^ (x >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        x = (x ^ (x >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        x ^ (x >> 31)
    }

    pub fn below(&mut self, n: u32) -> u32 {
        (((self.bits() >> 32) * u64::from(n)) >> 32) as u32
    }

    pub fn unit(&mut self) -> f64 {
        (self.bits() >> 11) as f64 / (1_u64 << 53) as f64
    }

    /// Log-uniform.
    pub fn scale(&mut self, low: f64, high: f64) -> f64 {
        low * libm::pow(high / low, self.unit())
    }

    /// A unit vector.
    pub fn direction(&mut self) -> [f64; 2] {
        let (s, c) = libm::sincos(std::f64::consts::TAU * self.unit());
        [c, s]
    }
}

/// How a kernel's functions are drawn.
#[derive(Clone, Copy, PartialEq)]
pub enum Nature {
    /// Edges that move over film and time, and that further pairs displace.
    Edge,
    /// The same with short waves counted more: wheels, gratings.
    Rough,
    /// Long waves alone, all factors alike.
    Smooth,
}

/// Functions averaged.
const FUNCTIONS: u32 = 400;

/// Waves of each function.
const WAVES: u32 = 10;

/// What a family of functions makes of common digits.
pub struct Kernel {
    /// Digits told apart: 0 to `levels` − 1 in each dimension.
    pub levels: usize,
    /// By common digits in base `levels`, the first dimension's lowest: above (or below) the mean over independent
    /// points, in units of the variance of one point. A point and itself have 1.
    pub table: Vec<f32>,
}

fn sinc(x: f64) -> f64 {
    if x == 0.0 { 1.0 } else { libm::sin(x) / x }
}

/// The mean of cos(ω d) over pairs of numbers in [0, 1) that agree in exactly `digits` leading binary digits: d is then
/// 2^(−digits) (½ + (u − v)/2), u and v uniform.
fn agreement(omega: f64, digits: usize) -> f64 {
    let scaled = omega / libm::exp2(digits as f64);
    libm::cos(0.5 * scaled) * sinc(0.25 * scaled).powi(2)
}

impl Kernel {
    /// For nets of 2^`bits` points; `dimensions` is 2 (a pair), 3 (film, time) or 5 (and a pair).
    pub fn new(nature: Nature, dimensions: usize, bits: usize, random: &mut Random) -> Self {
        let levels = bits + 1;
        let mut sums = vec![0.0_f64; levels.pow(dimensions as u32)];
        let (mut mean, mut total) = (0.0, 0.0);
        for _ in 0..FUNCTIONS {
            let (n, v, speed) = (random.direction(), random.direction(), random.scale(0.2, 4.0));
            let blur = random.scale(0.3, 4.0);
            let mut w = [n[0], n[1], speed * (n[0] * v[0] + n[1] * v[1]), blur * n[0], blur * n[1]];
            if nature == Nature::Smooth {
                w = std::array::from_fn(|_| random.scale(0.3, 2.0));
            }
            // Boundaries are as many as the function's range is wide.
            let range: f64 = w[..dimensions].iter().map(|w| w.abs()).sum();
            let octaves = if nature == Nature::Smooth { 2.0 } else { bits as f64 + 2.0 };
            for wave in 0..WAVES {
                let s = 0.5 * libm::exp2(octaves * (f64::from(wave) + random.unit()) / f64::from(WAVES));
                let weight = libm::pow(s, if nature == Nature::Rough { -0.5 } else { -1.0 }) / range;
                let by_level: Vec<Vec<f64>> =
                    w[..dimensions].iter().map(|w| (0..levels).map(|l| agreement(s * w, l)).collect()).collect();
                add_products(&mut sums, &by_level, weight);
                mean += weight * w[..dimensions].iter().map(|w| sinc(0.5 * s * w).powi(2)).product::<f64>();
                total += weight;
            }
        }
        let independent = total - mean;
        let table = sums.iter().map(|s| ((s - mean) / independent) as f32).collect();
        Self { levels, table }
    }
}

/// Adds `weight` times the product of one entry of each of `factors` to each entry of their outer product.
fn add_products(sums: &mut [f64], factors: &[Vec<f64>], weight: f64) {
    let Some((last, rest)) = factors.split_last() else {
        sums[0] += weight;
        return;
    };
    let part = sums.len() / last.len();
    for (block, value) in sums.chunks_exact_mut(part).zip(last) {
        add_products(block, rest, weight * value);
    }
}
