//! Chooses how the parameters of function 4 (the disk) are distributed, so that designs known for decades have the
//! variance that was published for them; tells how well the committed bounds of all seven functions do.
//!
//! ```text
//! cargo run --profile quick --example calibrate_functions -- [--seed S] [--candidates N (0: fit nothing)]
//! ```
//!
//! The published table (see `published.rs`) gives the variance of designs relative to independent sampling on seven
//! functions known by name only. Bounds of the disk's parameters are drawn at random and those kept that fit the figures
//! of function 4 best. No figure of the nets found by `search_nets` enters.

#![allow(
    clippy::cast_possible_truncation,
    clippy::cast_possible_wrap,
    clippy::cast_precision_loss,
    clippy::print_stdout,
    clippy::print_stderr,
    missing_docs,
    unreachable_pub,
    reason = "a tool run by hand on small numbers, whose output is its product"
)]

mod drawn;
mod published;

use drawn::{Design, KEPT, Points, points};
use graeco::design::Factor;
use graeco::trace::analytic::{Analytic, AnalyticKind, Lighting, Ranges};
use published::{DISK, LOG_MEANS, RUNS};
use rayon::prelude::*;

/// Placements of each candidate.
const PLACEMENTS: u32 = 96;

/// Draws of each design at each placement.
const DRAWS: u32 = 8;

/// Flatter pixels are left out, as in the study.
const LEAST_VARIANCE: f64 = 0.01;

/// Independent numbers (SplitMix64, Steele, Lea and Flood 2014).
struct Random(u64);

impl Random {
    fn unit(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut x = self.0;
        x = (x ^ (x >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        x = (x ^ (x >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((x ^ (x >> 31)) >> 11) as f64 / (1_u64 << 53) as f64
    }

    fn scale(&mut self, low: f64, high: f64) -> f64 {
        low * libm::pow(high / low, self.unit())
    }

    /// Bounds within `low` to `high`, a factor of 1.5 to 12 apart.
    fn bounds(&mut self, low: f64, high: f64) -> [f64; 2] {
        let width = self.scale(1.5, 12.0).min(high / low);
        let start = self.scale(low, high / width);
        [start, start * width]
    }
}

/// Every design of the table at all its numbers of runs.
type Table = Vec<(Design, u32, Points)>;

/// A table for each set of factors that a function may vary with, and independent points.
struct Drawn {
    tables: Vec<(Vec<Factor>, Table)>,
    independent: Vec<[f64; 7]>,
}

impl Drawn {
    fn new(seed: u64) -> Self {
        let mut tables: Vec<(Vec<Factor>, Table)> = Vec::new();
        for factors in AnalyticKind::ALL.map(AnalyticKind::factors) {
            if tables.iter().all(|(known, _)| *known != factors) {
                let rows = LOG_MEANS.iter().flat_map(|(design, _)| RUNS.iter().map(|&runs| (*design, runs)));
                let table = rows.map(|(design, runs)| (design, runs, points(design, runs, &factors, seed))).collect();
                tables.push((factors, table));
            }
        }
        let mut random = Random(seed);
        let independent = (0..1024).map(|_| std::array::from_fn(|_| random.unit())).collect();
        Self { tables, independent }
    }

    fn table(&self, kind: AnalyticKind) -> &Table {
        let factors = kind.factors();
        let own = self.tables.iter().find(|(known, _)| *known == factors);
        own.map_or(&self.tables[0].1, |(_, table)| table)
    }

    /// Variance relative to independent sampling in every row and column of the table.
    fn ratios(&self, kind: AnalyticKind, bounds: &Ranges, seed: u64) -> Vec<f64> {
        let functions: Vec<(Analytic, f64)> = (0..4 * PLACEMENTS)
            .map(|n| Analytic::placement_between(kind, bounds, n, seed))
            .map(|f| {
                let values: Vec<f64> = self.independent.iter().map(|p| f.value(p)).collect();
                (f, variance(&values))
            })
            .filter(|(_, v)| *v > LEAST_VARIANCE)
            .take(PLACEMENTS as usize)
            .collect();
        let independent: f64 = functions.iter().map(|(_, v)| v).sum();
        self.table(kind)
            .iter()
            .map(|(_, runs, points)| {
                let spread = |(place, (f, _)): (u32, &(Analytic, f64))| {
                    let estimates: Vec<f64> = (0..DRAWS)
                        .map(|draw| {
                            let draw = &points[((place * 17 + draw) % KEPT) as usize];
                            draw.iter().map(|p| f.value(p)).sum::<f64>() / f64::from(*runs)
                        })
                        .collect();
                    variance(&estimates)
                };
                (0..).zip(&functions).map(spread).sum::<f64>() * f64::from(*runs) / independent
            })
            .collect()
    }
}

/// Where the table has `design` at `runs`.
fn place(design: Design, runs: u32) -> usize {
    let rows = LOG_MEANS.iter().flat_map(|(d, _)| RUNS.iter().map(move |&r| (*d, r)));
    rows.into_iter().position(|row| row == (design, runs)).unwrap_or(0)
}

fn variance(values: &[f64]) -> f64 {
    let n = values.len() as f64;
    let mean = values.iter().sum::<f64>() / n;
    values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / (n - 1.0)
}

/// Bounds drawn for the disk.
fn candidate(random: &mut Random) -> Ranges {
    Ranges {
        motion: random.bounds(0.1, 4.0),
        lens: random.bounds(0.1, 4.0),
        size: random.bounds(0.5, 10.0),
        light: random.bounds(0.3, 6.0),
        height: random.bounds(0.5, 6.0),
        offset: random.bounds(0.1, 4.0),
        emitted: if random.unit() < 0.5 { [1e-6; 2] } else { random.bounds(0.1, 1.5) },
        lighting: if random.unit() < 0.5 { Lighting::Near } else { Lighting::Shadow },
    }
}

/// Bounds near others.
fn neighbour(bounds: &Ranges, random: &mut Random) -> Ranges {
    let mut moved = *bounds;
    for range in [
        &mut moved.motion,
        &mut moved.lens,
        &mut moved.size,
        &mut moved.light,
        &mut moved.height,
        &mut moved.offset,
        &mut moved.emitted,
    ] {
        if range[1] > 1e-3 {
            let around = range.map(|b| b * random.scale(0.7, 1.0 / 0.7));
            *range = [around[0].min(around[1]), around[0].max(around[1])];
        }
    }
    moved
}

/// Mean squared logarithm of ours over the published figures of function 4.
fn disk_misfit(ratios: &[f64]) -> f64 {
    let square =
        |&(design, runs, published): &(Design, u32, f64)| libm::log(ratios[place(design, runs)] / published).powi(2);
    DISK.iter().map(square).sum::<f64>() / DISK.len() as f64
}

/// Mean squared logarithm of our geometric means over the published ones.
fn misfit(sums: &[f64], published: &[f64]) -> f64 {
    sums.iter().zip(published).map(|(s, p)| (s / 7.0 - p).powi(2)).sum::<f64>() / published.len() as f64
}

/// The best of many bounds for function 4, and then of neighbours of the best.
fn fit_disk(drawn: &Drawn, candidates: u32, seed: u64) -> Ranges {
    let mut random = Random(seed ^ 4);
    let judge = |bounds: Ranges| (disk_misfit(&drawn.ratios(AnalyticKind::Disk, &bounds, seed)), bounds);
    let least = |all: Vec<Ranges>| all.into_par_iter().map(judge).min_by(|a, b| a.0.total_cmp(&b.0));
    let first: Vec<Ranges> = (0..3 * candidates).map(|_| candidate(&mut random)).collect();
    for lighting in [Lighting::Near, Lighting::Shadow] {
        let own: Vec<Ranges> = first.iter().filter(|b| b.lighting == lighting).copied().collect();
        if let Some((misfit, _)) = least(own) {
            eprintln!("disk, {lighting:?}: {:.3}", misfit.sqrt());
        }
    }
    let mut best = least(first).unwrap_or((f64::INFINITY, Ranges::of(AnalyticKind::Disk)));
    for round in 0..8 {
        let near: Vec<Ranges> = (0..candidates / 8).map(|_| neighbour(&best.1, &mut random)).collect();
        if let Some(better) = least(near).filter(|b| b.0 < best.0) {
            best = better;
        }
        eprintln!("disk, round {round}: root mean squared logarithm {:.3}", best.0.sqrt());
    }
    best.1
}

/// The number after `--name`, or `default`.
fn option(name: &str, default: u64) -> u64 {
    std::env::args().skip_while(|a| a != name).nth(1).and_then(|v| v.parse().ok()).unwrap_or(default)
}

fn main() {
    let (seed, candidates) = (option("--seed", 1), option("--candidates", 50) as u32);
    if candidates > 0 {
        let fitted = fit_disk(&Drawn::new(seed), candidates, seed);
        println!("fitted: {fitted:.3?}\n");
    }
    // The committed bounds, on placements and draws that no choice has seen.
    let fresh = Drawn::new(seed + 1000);
    let published: Vec<f64> = LOG_MEANS.iter().flat_map(|(_, row)| row.map(libm::log)).collect();
    let mut sums = vec![0.0; published.len()];
    for kind in AnalyticKind::ALL {
        let ratios = fresh.ratios(kind, &Ranges::of(kind), seed + 1000);
        sums.iter_mut().zip(&ratios).for_each(|(s, r)| *s += libm::log(r.max(1e-6)));
        if kind == AnalyticKind::Disk {
            println!("Function 4: ours (published); root mean squared logarithm {:.3}", disk_misfit(&ratios).sqrt());
            for (design, runs, published) in DISK {
                println!("{design:?} {runs}: {:.3} ({published})", ratios[place(design, runs)]);
            }
        }
    }
    let off = misfit(&sums, &published).sqrt();
    println!("\nGeometric means at {RUNS:?} runs: ours (published); root mean squared logarithm {off:.3}");
    for ((design, row), ours) in LOG_MEANS.iter().zip(sums.chunks_exact(RUNS.len())) {
        let cells: Vec<String> =
            ours.iter().zip(row).map(|(o, p)| format!("{:.3} ({p})", libm::exp(o / 7.0))).collect();
        println!("{design:?}: {}", cells.join("  "));
    }
}
