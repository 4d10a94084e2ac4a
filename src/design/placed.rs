//! The strata of all of a pixel's runs, written down once: cheaper than a permutation for each draw.

use super::hash::{Digits, fill_permutation};
use super::refine::ArrayMethod;

/// Bytes for one pixel.
const ROOM: usize = 2048;
/// Most runs: a stratum's number is one byte.
const MOST_RUNS: u32 = 256;

/// Permutations of the runs, by row and run.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Placed([u8; ROOM]);

impl Placed {
    /// How many of `rows` permutations of `runs` there is room for.
    pub(crate) fn rows(runs: u32, rows: usize) -> usize {
        if runs <= MOST_RUNS { rows.min(ROOM / runs.max(1) as usize) } else { 0 }
    }

    /// Independent uniform permutations, row `i` by `key(i)`.
    pub(crate) fn independent(runs: u32, rows: usize, key: impl Fn(usize) -> u64) -> Self {
        Self::new(runs, rows, |row, out| fill_permutation(out, &mut Digits::new(key(row))))
    }

    /// Those of an orthogonal array's columns, column `i` by `key(i)`.
    pub(crate) fn array(method: &ArrayMethod, rows: usize, key: impl Fn(usize) -> u64) -> Self {
        Self::new(method.array.runs(), rows, |column, out| method.fill_strata(column, key(column), out))
    }

    fn new(runs: u32, rows: usize, fill: impl Fn(usize, &mut [u8])) -> Self {
        let mut placed = Self([0; ROOM]);
        for (row, out) in placed.0.chunks_exact_mut(runs as usize).take(rows).enumerate() {
            fill(row, out);
        }
        placed
    }

    /// The stratum of `run` in `row`.
    #[inline]
    pub(crate) fn stratum(&self, runs: u32, row: usize, run: u32) -> u32 {
        u32::from(self.0[row * runs as usize + run as usize])
    }
}

#[cfg(test)]
mod tests {
    use super::super::array::OrthogonalArray;
    use super::super::hash::subkey;
    use super::*;
    use crate::numeric;

    fn assert_permutation(strata: impl Iterator<Item = u32>, what: &str) {
        let mut sorted: Vec<u32> = strata.collect();
        sorted.sort_unstable();
        assert!((0..).zip(&sorted).all(|(i, &s)| i == s), "{what}: {sorted:?}");
    }

    /// χ² of `counts` that should be even, `total` together, and its limit for α = 0.001 (Wilson and Hilferty 1931).
    fn chi_squared(counts: &[u32], total: u64) -> (f64, f64) {
        let expected = total as f64 / counts.len() as f64;
        let chi = counts.iter().map(|&c| (f64::from(c) - expected).powi(2) / expected).sum();
        let d = counts.len() as f64 - 1.0;
        (chi, d * (1.0 - 2.0 / (9.0 * d) + 3.09 * (2.0 / (9.0 * d)).sqrt()).powi(3))
    }

    fn assert_uniform(counts: &[u32], total: u64, what: &str) {
        let (chi, limit) = chi_squared(counts, total);
        assert!(chi < limit, "{what}: {chi} of {limit}");
    }

    /// Every row is a permutation, levels included, and what is written down is an array's own refinement: runs of one
    /// level keep to its strata.
    #[test]
    fn every_row_is_a_permutation_that_keeps_levels_together() {
        for q in [2_u32, 3, 4, 5, 7, 8, 9, 11, 13, 16] {
            for correlated in [false, true] {
                let method = ArrayMethod::new(OrthogonalArray::bose(q).unwrap(), 5, correlated);
                let runs = q * q;
                let rows = Placed::rows(runs, method.columns);
                let placed = Placed::array(&method, rows, |c| subkey(numeric::mix64(3), c as u64));
                for row in 0..rows {
                    assert_permutation((0..runs).map(|run| placed.stratum(runs, row, run)), "written");
                    assert_permutation((0..runs).map(|run| method.stratum(run, row, 77)), "hashed");
                    let written = |run: u32| placed.stratum(runs, row, run);
                    let hashed = |run: u32| method.stratum(run, row, 77);
                    for strata in [(0..runs).map(written).collect::<Vec<_>>(), (0..runs).map(hashed).collect()] {
                        for a in 0..runs {
                            for b in 0..a {
                                let level = |run: u32| method.array.level(run, row);
                                let place = |run: u32| strata[run as usize] / q;
                                assert_eq!(level(a) == level(b), place(a) == place(b), "{q}: {a} {b} in {row}");
                            }
                        }
                    }
                }
            }
        }
    }

    /// H₀: any two runs fall into any two different strata equally often. n = 40 000 keys, seed 6; α = 0.001 a case
    /// (χ²). Finds pairs that are 10 % too frequent in a tenth of the cells with power 0.9.
    #[test]
    fn pairs_of_runs_are_uniform() {
        const KEYS: u64 = 40_000;
        for runs in [5_u32, 8, 12, 16] {
            let mut counts = vec![0_u32; (runs * runs) as usize];
            for i in 0..KEYS {
                let placed = Placed::independent(runs, 2, |row| subkey(subkey(numeric::mix64(6), i), row as u64));
                counts[(placed.stratum(runs, 1, 1) * runs + placed.stratum(runs, 1, runs - 1)) as usize] += 1;
            }
            let possible: Vec<u32> =
                (0..runs * runs).filter(|c| c / runs != c % runs).map(|c| counts[c as usize]).collect();
            assert_uniform(&possible, KEYS, &format!("{runs} runs"));
            assert!((0..runs).all(|r| counts[(r * runs + r) as usize] == 0));
        }
    }
    /// The same of a refined array, q = 4: any two runs on one level fall into any two of its places, the level anywhere;
    /// any two on different levels into any places of any two levels. n = 100 000 keys, seed 7, α = 0.001 a case. A
    /// correlated refinement, which ties the places of different levels to each other, must fail the latter.
    #[test]
    fn pairs_of_refined_runs_are_uniform() {
        const KEYS: u64 = 100_000;
        const Q: u32 = 4;
        let counts = |correlated: bool, row: usize, together: bool| {
            let method = ArrayMethod::new(OrthogonalArray::bose(Q).unwrap(), 5, correlated);
            let level = |run: u32| method.array.level(run, row);
            let b = (1..Q * Q).find(|&b| (level(b) == level(0)) == together).unwrap();
            let mut met = vec![0_u32; (Q * Q * Q * Q) as usize];
            for i in 0..KEYS {
                let placed = Placed::array(&method, row + 1, |c| subkey(subkey(numeric::mix64(7), i), c as u64));
                met[(placed.stratum(Q * Q, row, 0) * Q * Q + placed.stratum(Q * Q, row, b)) as usize] += 1;
            }
            let possible = |c: u32| {
                let (a, b) = (c / (Q * Q), c % (Q * Q));
                a != b && (a / Q == b / Q) == together
            };
            (0..Q * Q * Q * Q).filter(|&c| possible(c)).map(|c| met[c as usize]).collect::<Vec<_>>()
        };
        for row in 0..5 {
            for (correlated, together) in [(false, true), (false, false), (true, true)] {
                let what = format!("row {row}, correlated {correlated}, on one level {together}");
                assert_uniform(&counts(correlated, row, together), KEYS, &what);
            }
        }
        let (tied, limit) = chi_squared(&counts(true, 0, false), KEYS);
        assert!(tied > limit, "the twin went unnoticed: {tied} of {limit}");
    }
}
