//! The functions that nets are tuned for: how much of their variance lies at each resolution.
//!
//! The family is half-spaces, w·x > c, in S of the factors with random weights and offsets: what an edge is that
//! moves, defocuses or shades. A function's projection onto s of its factors is the average over the others. The
//! variance of a scrambled net is a sum over resolutions κ ∈ ℕˢ of the projections' Haar energies (Owen 1997), so
//! those energies, averaged over the family, are all that a search needs to know of it.

/// Most factors that a term of the criterion joins.
pub const MOST: usize = 4;

/// log₂ of the grid's side for projections on 1, 2, 3, 4 factors.
const GRID_BITS: [u32; MOST + 1] = [0, 8, 7, 5, 4];

/// Random functions averaged for each (S, s).
const FUNCTIONS: usize = 60;

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

    fn normal(&mut self) -> f64 {
        (0..12).map(|_| self.unit()).sum::<f64>() - 6.0
    }
}

/// The numbers of factors S that the family has.
pub const SUPPORTS: [usize; 4] = [2, 3, 4, 7];

/// Factors among which the S are drawn.
const FACTORS: usize = 7;

/// Mean energies of one subset of factors by resolution: `[s][index of κ − 1 in base 16]`, κ from 1 to 12 each.
pub struct Energies {
    tables: Vec<Vec<f64>>,
}

impl Energies {
    /// `shares` is how much of the family has each of the [`SUPPORTS`].
    pub fn of_half_spaces(seed: u64, shares: [f64; 4]) -> Self {
        let mut random = Random(seed);
        let mut tables = vec![Vec::new()];
        for (s, &bits) in GRID_BITS.iter().enumerate().skip(1).take(MOST) {
            let mut sum = vec![0.0; (bits as usize).pow(s as u32)];
            for (support, share) in SUPPORTS.into_iter().zip(shares).filter(|&(support, _)| support >= s) {
                // The chance that a given subset of s factors is among the S.
                let inside: f64 = (0..s).map(|i| (support - i) as f64 / (FACTORS - i) as f64).product();
                for _ in 0..FUNCTIONS {
                    let energies = projection(&mut random, support, s, bits);
                    for (sum, e) in sum.iter_mut().zip(energies) {
                        *sum += share * inside * e / FUNCTIONS as f64;
                    }
                }
            }
            symmetrise(&mut sum, s, bits as usize);
            tables.push(extend(&sum, s, bits));
        }
        Self { tables }
    }

    /// Mean energy at resolution κ (each from 1 to 12).
    pub fn at(&self, kappa: &[usize]) -> f64 {
        self.tables[kappa.len()][kappa.iter().fold(0, |index, k| index << 4 | (k - 1))]
    }
}

/// Smooth step for sums of a few uniform numbers of total standard deviation one.
fn step(z: f64) -> f64 {
    1.0 / (1.0 + libm::exp(-1.702 * z))
}

/// Haar energies by resolution of one random half-space in `support` factors, projected onto the first `s`.
fn projection(random: &mut Random, support: usize, s: usize, bits: u32) -> Vec<f64> {
    let weights: Vec<f64> = (0..support).map(|_| random.normal()).collect();
    // An offset at which the half-space's boundary passes through the cube.
    let offset: f64 = weights.iter().map(|w| w * random.unit()).sum();
    let side = 1_usize << bits;
    let cell = 1.0 / side as f64;
    let samples = if support == s { 1 } else { 24 };
    let rest: Vec<f64> = (0..samples)
        .map(|i| {
            let mut rest = 0.0;
            for (k, w) in weights[s..].iter().enumerate() {
                let u = if k == 0 { (f64::from(i) + 0.5) / f64::from(samples) } else { random.unit() };
                rest += w * u;
            }
            rest
        })
        .collect();
    // A cell, and the stratum of a sample, blur the step by their extent.
    let mut variance: f64 = weights[..s].iter().map(|w| (w * cell).powi(2) / 12.0).sum();
    if support > s {
        variance += (weights[s] / f64::from(samples)).powi(2) / 12.0;
    }
    let sharp = 1.0 / variance.sqrt();
    let mut values = vec![0.0; side.pow(s as u32)];
    for (index, value) in values.iter_mut().enumerate() {
        let mut along = -offset;
        for (k, w) in weights[..s].iter().enumerate() {
            let coordinate = index >> (bits as usize * k) & (side - 1);
            along += w * (coordinate as f64 + 0.5) * cell;
        }
        *value = rest.iter().map(|r| step((along + r) * sharp)).sum::<f64>() / f64::from(samples);
    }
    haar_energies(&mut values, s, bits as usize)
}

/// Energies of the tensor Haar transform by resolution κ − 1 of each axis, mixed digits of base `bits`.
fn haar_energies(values: &mut [f64], s: usize, bits: usize) -> Vec<f64> {
    let side = 1_usize << bits;
    for axis in 0..s {
        let stride = side.pow(axis as u32);
        for level in (0..bits).rev() {
            // Sums stay at the multiples of 2^(bits − level), differences behind them; orthonormal in the mean.
            let step = stride << (bits - 1 - level);
            for index in 0..values.len() {
                if (index / stride % side).is_multiple_of(2 << (bits - 1 - level)) {
                    let (a, b) = (values[index], values[index + step]);
                    values[index] = (a + b) * 0.5;
                    // A difference over a pair of halves has energy (a − b)²/4 over the pair's extent.
                    values[index + step] = (a - b) * 0.5;
                }
            }
        }
    }
    let mut energies = vec![0.0; bits.pow(s as u32)];
    for (index, value) in values.iter().enumerate() {
        let mut cell = 0;
        let mut share = 1.0;
        let mut constant = false;
        for axis in (0..s).rev() {
            let coordinate = index / side.pow(axis as u32) % side;
            if coordinate == 0 {
                constant = true;
                break;
            }
            let level = bits - 1 - coordinate.trailing_zeros() as usize;
            cell = cell * bits + level;
            share /= (1_u64 << level) as f64;
        }
        if !constant {
            energies[cell] += value * value * share;
        }
    }
    energies
}

/// Averages over all orders of the axes.
fn symmetrise(table: &mut [f64], s: usize, bits: usize) {
    let digits = |mut index: usize| -> Vec<usize> {
        let mut d: Vec<usize> = (0..s)
            .map(|_| {
                let digit = index % bits;
                index /= bits;
                digit
            })
            .collect();
        d.sort_unstable();
        d
    };
    let mut groups = std::collections::BTreeMap::<Vec<usize>, (f64, f64)>::new();
    for (index, &e) in table.iter().enumerate() {
        let group = groups.entry(digits(index)).or_default();
        *group = (group.0 + e, group.1 + 1.0);
    }
    for (index, e) in table.iter_mut().enumerate() {
        let (sum, count) = groups[&digits(index)];
        *e = sum / count;
    }
}

/// To resolutions 1..16 a factor: beyond the grid, energy falls as that of a sharp half-space does, by four for each
/// step of the finest axis, and rises by two for each step of the coarsest.
fn extend(table: &[f64], s: usize, bits: u32) -> Vec<f64> {
    let bits = bits as usize;
    (0..1_usize << (4 * s))
        .map(|index| {
            let kappa: Vec<usize> = (0..s).map(|axis| index >> (4 * axis) & 15).collect();
            let held: Vec<usize> = kappa.iter().map(|&k| k.min(bits - 1)).collect();
            let cell = held.iter().rev().fold(0, |cell, &k| cell * bits + k);
            let finest = kappa.iter().max().unwrap_or(&0) - held.iter().max().unwrap_or(&0);
            let coarsest = kappa.iter().min().unwrap_or(&0) - held.iter().min().unwrap_or(&0);
            let up = if s > 1 { coarsest as i32 } else { 0 };
            table[cell] * 2.0_f64.powi(up - 2 * finest as i32)
        })
        .collect()
}
