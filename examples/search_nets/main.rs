//! Finds the generator matrices of the tuned nets and writes them as `src/design/nets_data.rs`.
//!
//! ```text
//! cargo run --profile quick --example search_nets -- [--seed S] [--sweeps K] [--from BITS] [--to BITS] \
//!     [--pairs P --triples P --quadruples P --sevens P (percent)] [--camera W (percent)] > nets_data.rs
//! ```
//!
//! The committed sets are the best of a few such runs, judged by `graeco study designs --seed 1000`; each set's
//! comment has the options that give it.
//!
//! A net of N = 2ᵐ points has one m × m matrix over GF(2) per factor. After Owen's scrambling its variance on a
//! function is a sum over resolutions of the function's Haar energies times the net's gain there (Owen 1997). Averaged
//! over a family of functions (see `energy.rs`) it becomes a sum over the points of a table that depends on nothing
//! but the number of leading zeros of each coordinate, for every set of up to four factors. With all matrices but one
//! held fixed it is a sum over the points of one table entry each: so matrices are annealed in turn, thousands of
//! proposals at the price of one evaluation.
//!
//! *Strong* nets are free but for being non-singular (each factor alone is a full stratification). *Nested* ones have
//! upper unitriangular matrices (so is each prefix of 2ᵏ points), and their objective is the mean logarithm of the
//! variance over prefixes, the long ones weighted most.

#![allow(
    clippy::cast_possible_truncation,
    clippy::cast_possible_wrap,
    clippy::cast_sign_loss,
    clippy::print_stdout,
    clippy::print_stderr,
    unreachable_pub,
    reason = "a tool run by hand on small numbers, whose output is its product"
)]

mod energy;

use energy::{Energies, MOST, Random};

/// Factors covered: film x y, shutter, lens u v, then light, lobe, light, lobe pairs.
const FACTORS: usize = 13;

/// How much each factor counts: a term's weight is the product over its factors. The camera's first three take
/// `camera` instead of 1.
fn weights(camera: f64) -> [f64; FACTORS] {
    [camera, camera, camera, 1.0, 1.0, 1.0, 1.0, 0.7, 0.7, 0.5, 0.5, 0.5, 0.5]
}

/// Factors annealed together; the others join one by one, those before them staying as they are.
const TOGETHER: usize = 7;

/// Proposals for one matrix before the next one's turn.
const PROPOSALS: usize = 400;

#[derive(Clone, Copy, PartialEq)]
enum Mode {
    Strong,
    Nested,
}

/// Φ of a set of factors by leading zeros: `[s][l₁ + 16 l₂ + …]`, for resolutions up to `bits`.
struct Terms {
    tables: Vec<Vec<f32>>,
}

impl Terms {
    /// Φ(l) = Σ over κ of the energy at κ times Π σ(κᵢ, lᵢ), where σ is 1 up to l, −1 at l + 1 and 0 beyond: the sum
    /// of Walsh functions of length κ at a number with l leading zeros, over how many they are.
    fn new(energies: &Energies, bits: usize) -> Self {
        let tables = (0..=MOST)
            .map(|s| {
                let mut table = vec![0.0_f32; 1 << (4 * s)];
                if s >= 2 {
                    for (index, entry) in table.iter_mut().enumerate() {
                        let zeros: Vec<usize> = (0..s).map(|k| index >> (4 * k) & 15).collect();
                        if zeros.iter().all(|&l| l <= bits) {
                            *entry = phi(energies, bits, &zeros, &mut Vec::new(), 1.0) as f32;
                        }
                    }
                }
                table
            })
            .collect();
        Self { tables }
    }
}

fn phi(energies: &Energies, bits: usize, zeros: &[usize], kappa: &mut Vec<usize>, sign: f64) -> f64 {
    let Some((&first, rest)) = zeros.split_first() else { return sign * energies.at(kappa) };
    (1..=bits.min(first + 1))
        .map(|k| {
            kappa.push(k);
            let sum = phi(energies, bits, rest, kappa, if k == first + 1 { -sign } else { sign });
            kappa.pop();
            sum
        })
        .sum()
}

/// A net under construction.
struct Search<'a> {
    mode: Mode,
    bits: usize,
    terms: &'a Terms,
    weights: [f64; FACTORS],
    /// `[factor][bit of the index]`, the first digit in bit `bits − 1`.
    matrices: Vec<Vec<u16>>,
    /// Leading zeros `[factor][point]`.
    zeros: Vec<Vec<u8>>,
    random: Random,
}

/// The coordinate of every point, in order.
fn coordinates(matrix: &[u16]) -> Vec<u16> {
    let mut out = vec![0_u16];
    for &column in matrix {
        out.extend_from_within(..);
        let half = out.len() / 2;
        out[half..].iter_mut().for_each(|x| *x ^= column);
    }
    out
}

fn leading_zeros(x: u16, bits: usize) -> u8 {
    (x.leading_zeros() as usize - (16 - bits)) as u8
}

/// How much the prefix of 2^`k` points counts in a nested set of `bits` bits: 2^bits itself, 3/4 of it (which depends
/// on its quarter), the half; shorter ones little.
fn prefix_weight(mode: Mode, bits: usize, k: usize) -> f64 {
    match (mode, bits - k) {
        (_, 0) => 1.0,
        (Mode::Strong, _) => 0.0,
        (Mode::Nested, 1) => 0.35,
        (Mode::Nested, 2) => 0.45,
        (Mode::Nested, 3) => 0.15,
        (Mode::Nested, _) => 0.05,
    }
}

impl<'a> Search<'a> {
    fn new(mode: Mode, bits: usize, terms: &'a Terms, weights: [f64; FACTORS], seed: u64) -> Self {
        let mut random = Random(seed);
        let matrices: Vec<Vec<u16>> = (0..FACTORS)
            .map(|factor| {
                (0..bits)
                    .map(|b| {
                        let diagonal = 1 << (bits - 1 - b);
                        let above = random.bits() as u16 & !(2 * diagonal - 1) & ((1 << bits) - 1);
                        if factor == 0 { diagonal } else { diagonal | above }
                    })
                    .collect()
            })
            .collect();
        let zeros = matrices
            .iter()
            .map(|m: &Vec<u16>| coordinates(m).iter().map(|&x| leading_zeros(x, bits)).collect())
            .collect();
        Self { mode, bits, terms, weights, matrices, zeros, random }
    }

    /// For each point, what it adds to the criterion by the leading zeros of `factor`'s coordinate, over all sets of
    /// `factor` with others below `active`; and by prefix the sum over the sets without it.
    fn conditional(&self, factor: usize, active: usize) -> Vec<f32> {
        let points = 1 << self.bits;
        let mut out = vec![0.0_f32; points * 16];
        let others: Vec<usize> = (0..active).filter(|&k| k != factor).collect();
        let mut set = Vec::new();
        self.add_sets(&others, &mut set, self.weights[factor], &mut out);
        out
    }

    fn add_sets(&self, others: &[usize], set: &mut Vec<usize>, weight: f64, out: &mut [f32]) {
        for (i, &next) in others.iter().enumerate() {
            set.push(next);
            let weight = weight * self.weights[next];
            let table = &self.terms.tables[set.len() + 1];
            for (point, row) in out.chunks_exact_mut(16).enumerate() {
                let at = set.iter().rev().fold(0, |at, &k| at << 4 | usize::from(self.zeros[k][point])) << 4;
                for (entry, &phi) in row.iter_mut().zip(&table[at..at + 16]).take(self.bits + 1) {
                    *entry += weight as f32 * phi;
                }
            }
            if set.len() + 1 < MOST {
                self.add_sets(&others[i + 1..], set, weight, out);
            }
            set.pop();
        }
    }

    /// Σ Φ of each prefix over sets without `factor`.
    fn without(&self, factor: usize, active: usize) -> Vec<f64> {
        let mut sums = vec![0.0; self.bits + 1];
        let mut seen = Vec::new();
        for first in (0..active).filter(|&k| k != factor) {
            // Sets whose highest member is `first`: conditional on it, below it.
            let others: Vec<usize> = (0..first).filter(|&k| k != factor).collect();
            let mut out = vec![0.0_f32; (1 << self.bits) * 16];
            self.add_sets(&others, &mut seen, self.weights[first], &mut out);
            for (sum, part) in sums.iter_mut().zip(self.prefixes(&out, &self.zeros[first])) {
                *sum += part;
            }
        }
        sums
    }

    /// Sums over the points of each prefix of their entries; point 0 has as many zeros as the prefix has digits.
    fn prefixes(&self, conditional: &[f32], zeros: &[u8]) -> Vec<f64> {
        let mut sums = Vec::with_capacity(self.bits + 1);
        let mut sum = 0.0;
        let mut point = 1;
        for k in 0..=self.bits {
            while point < 1 << k {
                sum += f64::from(conditional[point * 16 + usize::from(zeros[point])]);
                point += 1;
            }
            sums.push(sum);
        }
        sums
    }

    /// Total energy over sets below `active` at resolutions up to `k` digits: the variance of independent points.
    fn total(&self, k: usize, active: usize) -> f64 {
        // e[s] of the weights: the elementary symmetric sums.
        let mut symmetric = [1.0, 0.0, 0.0, 0.0, 0.0];
        for w in &self.weights[..active] {
            for s in (1..=MOST).rev() {
                symmetric[s] += symmetric[s - 1] * w;
            }
        }
        (2..=MOST).map(|s| symmetric[s] * f64::from(self.terms.tables[s][(0..s).fold(0, |at, _| at << 4 | k)])).sum()
    }

    /// The objective from the sums of all sets, by prefix: the weighted mean logarithm of variance over independent
    /// points' variance.
    fn objective(&self, sums: impl Iterator<Item = f64>, active: usize) -> f64 {
        let full = self.total(self.bits, active);
        let mut weighted = 0.0;
        let mut weights = 0.0;
        for (k, sum) in sums.enumerate().skip(1) {
            let weight = prefix_weight(self.mode, self.bits, k);
            // Finer resolutions than a prefix has digits are as independent points have them.
            let ratio = (self.total(k, active) + sum + (full - self.total(k, active))) / full;
            weighted += weight * ratio.max(1e-6).ln();
            weights += weight;
        }
        weighted / weights
    }

    /// A neighbour of `matrix`.
    fn propose(&mut self, matrix: &[u16]) -> Vec<u16> {
        let bits = self.bits as u32;
        let mut out = matrix.to_vec();
        let a = self.random.below(bits) as usize;
        match self.mode {
            Mode::Nested => {
                // Flip a digit above the diagonal.
                let b = 1 + self.random.below(bits - 1) as usize;
                let digit = self.random.below(b as u32);
                out[b] ^= 1 << (bits - 1 - digit);
            }
            Mode::Strong => {
                let b = (a + 1 + self.random.below(bits - 1) as usize) % bits as usize;
                match self.random.below(4) {
                    0 => out.swap(a, b),
                    1 => out[a] ^= out[b],
                    2 => out[a] ^= 1 << b,
                    _ => {
                        let (deep, shallow) = (a.min(b), a.max(b));
                        out.iter_mut().for_each(|x| *x ^= (*x >> deep & 1) << shallow);
                    }
                }
            }
        }
        out
    }

    /// One turn of `factor` at temperature `heat`; the objective afterwards.
    fn turn(&mut self, factor: usize, active: usize, heat: f64) -> f64 {
        let conditional = self.conditional(factor, active);
        let rest = self.without(factor, active);
        let value = |search: &Self, zeros: &[u8]| {
            let with = search.prefixes(&conditional, zeros);
            search.objective(rest.iter().zip(with).map(|(a, b)| a + b), active)
        };
        let mut now = value(self, &self.zeros[factor]);
        for _ in 0..PROPOSALS {
            let old = self.matrices[factor].clone();
            let matrix = self.propose(&old);
            let zeros: Vec<u8> = coordinates(&matrix).iter().map(|&x| leading_zeros(x, self.bits)).collect();
            // A second zero coordinate: singular.
            if zeros[1..].iter().any(|&l| usize::from(l) == self.bits) {
                continue;
            }
            let then = value(self, &zeros);
            if then <= now || self.random.unit() < libm::exp((now - then) / heat) {
                now = then;
                self.matrices[factor] = matrix;
                self.zeros[factor] = zeros;
            }
        }
        now
    }

    fn run(&mut self, sweeps: usize) -> f64 {
        let mut value = 0.0;
        let mut best = (f64::INFINITY, self.matrices.clone());
        for sweep in 0..sweeps {
            let cold = sweep as f64 / sweeps as f64;
            let heat = 0.03 * libm::pow(0.003, cold);
            for factor in 1..TOGETHER {
                value = self.turn(factor, TOGETHER, heat);
                if value < best.0 {
                    best = (value, self.matrices.clone());
                }
            }
        }
        self.matrices = best.1;
        for factor in 0..FACTORS {
            let zeros = coordinates(&self.matrices[factor]).iter().map(|&x| leading_zeros(x, self.bits)).collect();
            self.zeros[factor] = zeros;
        }
        for factor in TOGETHER..FACTORS {
            for sweep in 0..sweeps / 4 {
                let heat = 0.02 * libm::pow(0.005, sweep as f64 / (sweeps / 4) as f64);
                value = self.turn(factor, factor + 1, heat);
            }
        }
        eprintln!("  {} factors {:.4}, all {:.4}", TOGETHER, best.0.exp(), value.exp());
        best.0
    }
}

/// The value of `--name`, or `default`.
fn option(name: &str, default: u64) -> u64 {
    let mut arguments = std::env::args().skip_while(|a| a != name).skip(1);
    arguments.next().and_then(|v| v.parse().ok()).unwrap_or(default)
}

fn main() {
    let (seed, sweeps) = (option("--seed", 1), option("--sweeps", 60) as usize);
    let (from, to) = (option("--from", 2) as usize, option("--to", 12) as usize);
    let shares = [("--pairs", 30), ("--triples", 40), ("--quadruples", 15), ("--sevens", 15)]
        .map(|(name, default)| option(name, default) as f64 / 100.0);
    let camera = option("--camera", 120);
    let energies = Energies::of_half_spaces(seed, shares);
    let settings = format!(
        "--seed {seed} --sweeps {sweeps} --pairs {} --triples {} --quadruples {} --sevens {} --camera {camera}",
        100.0 * shares[0],
        100.0 * shares[1],
        100.0 * shares[2],
        100.0 * shares[3]
    );
    println!("//! Generator matrices found by `examples/search_nets`, {FACTORS} factors a set.");
    println!();
    println!("/// Matrices of one set, one after the other.");
    println!("pub(crate) struct Set {{");
    println!("    /// Bits of the run's index, columns of each matrix.");
    println!("    pub(crate) bits: u32,");
    println!("    /// Columns of all matrices, the first digit in bit 15.");
    println!("    pub(crate) columns: &'static [u16],");
    println!("}}");
    for (mode, name, doc) in [
        (Mode::Strong, "STRONG", "Sets tuned each for 2^bits runs alone."),
        (Mode::Nested, "NESTED", "Sets tuned each for the prefixes of 2^bits runs."),
    ] {
        println!("\n/// {doc}\npub(crate) static {name}: &[Set] = &[");
        for bits in from..=to {
            let terms = Terms::new(&energies, bits);
            // Small nets are cheap: the best of several starts.
            let starts = if bits <= 8 { 4 } else { 1 };
            let mut best: Option<(f64, Vec<Vec<u16>>)> = None;
            for start in 0..starts {
                eprintln!("{name} {bits} bits, start {start}");
                let mut search = Search::new(
                    mode,
                    bits,
                    &terms,
                    weights(camera as f64 / 100.0),
                    seed ^ (start << 32 | (bits as u64) << 8 | 0x51),
                );
                let value = search.run(sweeps);
                if best.as_ref().is_none_or(|(b, _)| value < *b) {
                    best = Some((value, search.matrices));
                }
            }
            let Some((value, matrices)) = best else { continue };
            println!("    // {settings}: {:.4}", value.exp());
            let columns: Vec<String> =
                matrices.iter().flatten().map(|c| format!("{:#06x}", c << (16 - bits))).collect();
            println!("    Set {{ bits: {bits}, columns: &[{}] }},", columns.join(", "));
        }
        println!("];");
    }
}
