//! Orthogonal arrays refined to Latin hypercubes, with fresh permutations of their levels in each pixel.

use super::array::OrthogonalArray;
use super::hash::{Digits, fill_permutation, permute, subkey};

/// An orthogonal array, refined.
#[derive(Debug, Clone)]
pub(crate) struct ArrayMethod {
    pub(crate) array: OrthogonalArray,
    /// Columns in use.
    pub(crate) columns: usize,
    /// Whether one permutation refines all levels of a factor, by the level of its partner.
    pub(crate) correlated: bool,
    /// `[run][column]`: which of the runs on its level this is.
    ranks: Vec<u16>,
    /// Runs on each level.
    per_level: u32,
}

impl ArrayMethod {
    pub(crate) fn new(array: OrthogonalArray, factors: usize, correlated: bool) -> Self {
        let columns = factors.min(array.columns());
        let per_level = array.runs() / array.levels();
        let mut ranks = Vec::with_capacity(array.runs() as usize * columns);
        let mut seen = vec![0_u16; columns * array.levels() as usize];
        for run in 0..array.runs() {
            for column in 0..columns {
                let count = &mut seen[column * array.levels() as usize + usize::from(array.level(run, column))];
                // In an array of strength 2 and index unity a level meets each level of any other column once.
                let partner = match column {
                    0 | 1 => 1 - column,
                    2 => 0,
                    _ => ((column - 3) ^ 1) + 3,
                };
                let rank =
                    if array.strength() == 2 && partner < array.columns() { array.level(run, partner) } else { *count };
                ranks.push(rank);
                *count += 1;
            }
        }
        Self { array, columns, correlated, ranks, per_level }
    }

    /// Which of the runs on its level `run` is in `column`.
    #[inline]
    fn rank(&self, run: u32, column: usize) -> u32 {
        u32::from(self.ranks[run as usize * self.columns + column])
    }

    /// Which permutation refines `level`.
    #[inline]
    fn group(&self, level: u32) -> u64 {
        if self.correlated { 1 } else { u64::from(level) + 2 }
    }

    /// The stratum of one run in `column`: its level under a permutation of all, refined by one of the level's runs.
    /// Kept out of line: strata that are written down are read without its registers.
    #[inline(never)]
    pub(crate) fn stratum(&self, run: u32, column: usize, key: u64) -> u32 {
        let level = permute(u32::from(self.array.level(run, column)), self.array.levels(), key);
        level * self.per_level + permute(self.rank(run, column), self.per_level, subkey(key, self.group(level) << 32))
    }

    /// The strata of all runs, at most 256, in `column`.
    pub(crate) fn fill_strata(&self, column: usize, key: u64, out: &mut [u8]) {
        let (levels, per_level) = (self.array.levels() as usize, self.per_level as usize);
        let (mut images, mut inner) = ([0_u8; 256], [0_u8; 256]);
        let mut digits = Digits::new(key);
        fill_permutation(&mut images[..levels], &mut digits);
        for (level, places) in inner[..out.len()].chunks_exact_mut(per_level).enumerate() {
            if level == 0 || !self.correlated {
                fill_permutation(places, &mut digits);
            }
        }
        for (run, stratum) in (0..).zip(out) {
            let first = usize::from(images[usize::from(self.array.level(run, column))]) * per_level;
            let inner_first = if self.correlated { 0 } else { first };
            #[allow(clippy::cast_possible_truncation, reason = "below the number of runs, at most 256")]
            let first_stratum = first as u8;
            *stratum = first_stratum + inner[inner_first + self.rank(run, column) as usize];
        }
    }
}
