//! Finds the generator matrices of the tuned nets and writes them as `src/design/nets_data.rs`.
//!
//! ```text
//! cargo run --profile quick --example search_nets -- [--seed S] [--sweeps K] [--from BITS] [--to BITS] [--starts N] \
//!     [--symmetric P (percent)] [--pairs P (percent)] [--balance 0|1] [--only strong|nested] > nets_data.rs
//! ```
//!
//! Each committed set's comment has the options that give it.
//!
//! A net of N = 2ᵐ points has one m × m matrix over GF(2) per factor. After Owen's scrambling its variance, averaged
//! over a family of functions (see `family.rs`), is a sum over its points of products over the factors, of numbers
//! that depend on nothing but how many leading zeros each coordinate has. With all matrices but one held fixed the
//! other factors' products are constants: so matrices are annealed in turn, thousands of proposals at the price of a
//! sum each. The objective is the mean logarithm of variance over families.
//!
//! *Strong* nets are free but for being non-singular (each factor alone is a full stratification). *Nested* ones have
//! upper unitriangular matrices (so is each prefix of 2ᵏ points), and their objective is averaged over prefixes, the
//! long ones weighted most.

#![allow(
    clippy::cast_possible_truncation,
    clippy::cast_possible_wrap,
    clippy::cast_sign_loss,
    clippy::print_stdout,
    clippy::print_stderr,
    unreachable_pub,
    reason = "a tool run by hand on small numbers, whose output is its product"
)]

mod family;

use family::{Kernel, Nature, Random};

/// What each group's terms without a factor add up to, by prefix; and those with it: number and places.
type Split = (Vec<Vec<f64>>, Vec<(usize, (Vec<u32>, u32))>);

/// Factors covered: film x y, shutter, lens u v, then light, lobe, light, lobe pairs.
const FACTORS: usize = 13;

/// Factors that every picture with all effects has; the light's pair is the last.
const FIRST: usize = 7;

/// Factors annealed together: those and the first lobe's pair; the others join pair by pair, those before them staying
/// as they are.
const TOGETHER: usize = 9;

/// Proposals for one matrix before the next one's turn.
const PROPOSALS: usize = 300;

#[derive(Clone, Copy, PartialEq)]
enum Mode {
    Strong,
    Nested,
}

/// A kernel over some of the factors.
struct Term {
    kernel: usize,
    factors: Vec<usize>,
    /// Terms of one group are averaged before the logarithm is taken.
    group: usize,
}

/// What is asked of a net.
struct Goal {
    kernels: Vec<Kernel>,
    terms: Vec<Term>,
    /// How much each group's logarithm counts.
    weights: Vec<f64>,
}

/// Every set of `count` of the first factors, each in random order.
fn every(count: usize, random: &mut Random) -> Vec<Vec<usize>> {
    let sets = (0_u32..1 << FIRST).filter(|set| set.count_ones() as usize == count);
    sets.map(|set| {
        let mut members: Vec<usize> = (0..FIRST).filter(|f| set >> f & 1 == 1).collect();
        for i in 0..count {
            members.swap(i, i + random.below((count - i) as u32) as usize);
        }
        members
    })
    .collect()
}

impl Goal {
    /// What a camera makes of edges: film and time; the same with lens; with light. For a share of `symmetric` the same
    /// with factors exchanged at random. Factors beyond the seventh meet the camera's and their vertex's own. Each natural
    /// pair by itself counts `pairs`: inside an object that stands still and is in focus nothing else varies.
    fn new(bits: usize, seed: u64, symmetric: f64, pairs: f64) -> Self {
        let mut random = Random(seed ^ 0x66_616d);
        let natures =
            [(Nature::Edge, 3), (Nature::Edge, 5), (Nature::Rough, 3), (Nature::Smooth, 5), (Nature::Edge, 2)];
        let kernels = natures.map(|(nature, d)| Kernel::new(nature, d, bits, &mut random)).into();
        let mut goal = Self { kernels, terms: Vec::new(), weights: Vec::new() };
        let named = 1.0 - symmetric;
        goal.add(0, vec![vec![0, 1, 2]], 1.2 * named);
        goal.add(1, vec![vec![0, 1, 2, 3, 4]], 1.5 * named);
        goal.add(1, vec![vec![0, 1, 2, 5, 6]], 1.2 * named);
        goal.add(2, vec![vec![0, 1, 2]], 0.5);
        goal.add(0, every(3, &mut random), symmetric);
        goal.add(1, [every(5, &mut random), every(5, &mut random)].concat(), 2.0 * symmetric);
        goal.add(3, every(5, &mut random), 0.5);
        for pair in [7, 9, 11] {
            goal.add(1, vec![vec![0, 1, 2, pair, pair + 1]], 1.0);
            goal.add(1, vec![vec![pair - 2, pair - 1, 2, pair, pair + 1]], 1.0);
            goal.add(1, vec![vec![3, 4, 2, pair, pair + 1]], 0.5);
        }
        for pair in [3, 5, 7, 9, 11].into_iter().filter(|_| pairs > 0.0) {
            goal.add(4, vec![vec![pair, pair + 1]], pairs);
        }
        goal
    }

    fn add(&mut self, kernel: usize, members: Vec<Vec<usize>>, weight: f64) {
        let group = self.weights.len();
        self.terms.extend(members.into_iter().map(|factors| Term { kernel, factors, group }));
        self.weights.push(weight);
    }
}

/// A net under construction.
struct Search<'a> {
    mode: Mode,
    bits: usize,
    goal: &'a Goal,
    /// How much prefixes count, from the longest.
    balance: [f64; 5],
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

fn leading_zeros(matrix: &[u16]) -> Vec<u8> {
    let spare = 16 - matrix.len() as u32;
    coordinates(matrix).iter().map(|x| (x.leading_zeros() - spare) as u8).collect()
}

/// How much the prefix of 2^`bits` points counts, then those of a half, a quarter, an eighth, and all shorter ones; three
/// quarters depend on their quarter. The second balance serves numbers of runs that are no power of two better.
const BALANCES: [[f64; 5]; 2] = [[1.0, 0.2, 0.3, 0.1, 0.03], [1.0, 0.35, 0.45, 0.15, 0.05]];

impl<'a> Search<'a> {
    fn new(mode: Mode, bits: usize, goal: &'a Goal, balance: [f64; 5], seed: u64) -> Self {
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
        let zeros = matrices.iter().map(|m| leading_zeros(m)).collect();
        Self { mode, bits, goal, balance, matrices, zeros, random }
    }

    /// Terms over factors below `active` alone.
    fn terms(&self, active: usize) -> impl Iterator<Item = (usize, &Term)> {
        self.goal.terms.iter().enumerate().filter(move |(_, t)| t.factors.iter().all(|&f| f < active))
    }

    /// For each point, where a term's entry lies in its kernel's table but for `factor`'s digits.
    fn places(&self, term: &Term, factor: Option<usize>) -> (Vec<u32>, u32) {
        let levels = self.goal.kernels[term.kernel].levels as u32;
        let mut places = vec![0; 1 << self.bits];
        let (mut stride, mut own) = (1, 0);
        for &f in &term.factors {
            if Some(f) == factor {
                own = stride;
            } else {
                places.iter_mut().zip(&self.zeros[f]).for_each(|(p, &l)| *p += stride * u32::from(l));
            }
            stride *= levels;
        }
        (places, own)
    }

    /// Sums of a term's entries over the points of each prefix of 2^k, from k = 0: variance over that of one point.
    fn sums(&self, term: &Term, (places, own): &(Vec<u32>, u32), zeros: &[u8]) -> Vec<f64> {
        let kernel = &self.goal.kernels[term.kernel];
        let mut sum = 1.0;
        let mut sums = vec![sum];
        for k in 0..self.bits {
            let block = 1 << k..2 << k;
            let entries = places[block.clone()].iter().zip(&zeros[block]);
            let part: f32 = entries.map(|(p, &l)| kernel.table[(p + own * u32::from(l)) as usize]).sum();
            sum += f64::from(part);
            sums.push(sum);
        }
        sums
    }

    /// What each group's terms without `factor` add up to, by prefix; and those with it, with their places.
    fn split(&self, factor: usize, active: usize) -> Split {
        let mut without = vec![vec![0.0; self.bits + 1]; self.goal.weights.len()];
        let mut with = Vec::new();
        for (number, term) in self.terms(active) {
            if term.factors.contains(&factor) {
                with.push((number, self.places(term, Some(factor))));
            } else {
                let sums = self.sums(term, &self.places(term, None), &self.zeros[0]);
                without[term.group].iter_mut().zip(sums).for_each(|(a, b)| *a += b);
            }
        }
        (without, with)
    }

    /// The objective if `factor`'s coordinates have the leading zeros `zeros`.
    fn value(&self, (without, with): &Split, counts: &[f64], zeros: &[u8]) -> f64 {
        let mut groups = without.clone();
        for (number, places) in with {
            let term = &self.goal.terms[*number];
            let sums = self.sums(term, places, zeros);
            groups[term.group].iter_mut().zip(sums).for_each(|(a, b)| *a += b);
        }
        let (mut sum, mut weights) = (0.0, 0.0);
        for ((group, weight), count) in groups.iter().zip(&self.goal.weights).zip(counts).filter(|(_, c)| **c > 0.0) {
            for (k, ratio) in group.iter().enumerate().skip(1) {
                let weight = weight * self.balance[(self.bits - k).min(4)];
                // Rounding must not pass for a perfect net.
                sum += weight * libm::log((ratio / count).max(1e-4));
                weights += weight;
            }
        }
        sum / weights
    }

    /// Terms of each group over factors below `active`.
    fn counts(&self, active: usize) -> Vec<f64> {
        let mut counts = vec![0.0; self.goal.weights.len()];
        self.terms(active).for_each(|(_, t)| counts[t.group] += 1.0);
        counts
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
        let (parts, counts) = (self.split(factor, active), self.counts(active));
        let mut now = self.value(&parts, &counts, &self.zeros[factor]);
        let proposals = PROPOSALS.min(20 * self.bits * self.bits);
        for _ in 0..proposals {
            let old = self.matrices[factor].clone();
            let matrix = self.propose(&old);
            let zeros = leading_zeros(&matrix);
            // A second zero coordinate: singular.
            if zeros[1..].iter().any(|&l| usize::from(l) == self.bits) {
                continue;
            }
            let then = self.value(&parts, &counts, &zeros);
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
            let heat = 0.02 * libm::pow(0.003, cold);
            for factor in 1..TOGETHER {
                value = self.turn(factor, TOGETHER, heat);
                if value < best.0 {
                    best = (value, self.matrices.clone());
                }
            }
        }
        self.matrices = best.1;
        self.zeros = self.matrices.iter().map(|m| leading_zeros(m)).collect();
        for pair in (TOGETHER..FACTORS).step_by(2) {
            let few = (sweeps / 3).max(2);
            for sweep in 0..few {
                let heat = 0.01 * libm::pow(0.005, sweep as f64 / few as f64);
                for factor in [pair, pair + 1] {
                    value = self.turn(factor, pair + 2, heat);
                }
            }
        }
        eprintln!("  {TOGETHER} factors {:.4}, all {:.4}", best.0.exp(), value.exp());
        // The first factors are what most pixels have; the others count a little.
        0.8 * best.0 + 0.2 * value
    }
}

/// The value after `--name`.
fn word(name: &str) -> Option<String> {
    std::env::args().skip_while(|a| a != name).nth(1)
}

/// The number after `--name`, or `default`.
fn option(name: &str, default: u64) -> u64 {
    word(name).and_then(|v| v.parse().ok()).unwrap_or(default)
}

fn main() {
    let (seed, sweeps) = (option("--seed", 1), option("--sweeps", 40) as usize);
    let (from, to) = (option("--from", 2) as usize, option("--to", 12) as usize);
    let (starts, symmetric, pairs) = (option("--starts", 2), option("--symmetric", 35), option("--pairs", 70));
    let only = word("--only");
    let balance = option("--balance", 0) as usize % BALANCES.len();
    let settings = format!(
        "--seed {seed} --sweeps {sweeps} --starts {starts} --symmetric {symmetric} --pairs {pairs} --balance {balance}"
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
        for bits in (from..=to).filter(|_| only.as_ref().is_none_or(|o| o.eq_ignore_ascii_case(name))) {
            let goal = Goal::new(bits, seed, symmetric as f64 / 100.0, pairs as f64 / 100.0);
            let prefixes = if mode == Mode::Strong { [1.0, 0.0, 0.0, 0.0, 0.0] } else { BALANCES[balance] };
            let mut best: Option<(f64, Vec<Vec<u16>>)> = None;
            for start in 0..starts {
                eprintln!("{name} {bits} bits, start {start}");
                let mut search =
                    Search::new(mode, bits, &goal, prefixes, seed ^ (start << 32 | (bits as u64) << 8 | 0x51));
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
