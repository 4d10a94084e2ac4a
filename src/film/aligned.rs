//! Pairwise sums over ranges of runs.
//!
//! The sum over an aligned block of 2ᵏ runs is that of its two halves, so it is one number whoever computed it, and any
//! ranges of runs merge to exactly what a single pass gives. Rounding grows with log₂ of the runs instead of their
//! number (Higham 2002, §4.2).

use std::ops::Range;

/// What can be summed: the join of the sums over two neighbouring ranges is that over both.
pub trait Join: Copy {
    /// Takes in the sums over `next`, the range that follows this one. In place: sums are large.
    fn absorb(&mut self, next: &Self);
}

/// Sums over the aligned block of 2^level runs from `start`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Block<T> {
    /// First run, a multiple of 2^level.
    pub start: u64,
    /// Logarithm of the number of runs.
    pub level: u32,
    /// The sums.
    pub sums: T,
}

impl<T: Join> Block<T> {
    /// The run after the last.
    #[must_use]
    pub fn end(&self) -> u64 {
        self.start + (1 << self.level)
    }

    /// Whether `next` is the other half of the aligned block that this one begins.
    #[inline]
    fn is_sibling_before(&self, next: &Self) -> bool {
        self.level == next.level && next.start == self.end() && self.start.trailing_zeros() > self.level
    }

    #[inline]
    fn absorb(&mut self, next: &Self) {
        self.level += 1;
        self.sums.absorb(&next.sums);
    }
}

/// Sums over any set of runs, as maximal aligned blocks, ascending and disjoint.
#[derive(Debug, Clone, PartialEq)]
pub struct AlignedSums<T> {
    blocks: Vec<Block<T>>,
}

impl<T> Default for AlignedSums<T> {
    fn default() -> Self {
        Self { blocks: Vec::new() }
    }
}

impl<T: Join> AlignedSums<T> {
    /// The blocks.
    #[must_use]
    pub fn blocks(&self) -> &[Block<T>] {
        &self.blocks
    }

    /// Forgets everything, keeping the memory.
    pub fn clear(&mut self) {
        self.blocks.clear();
    }

    /// Appends a block that starts after all others, and joins whatever it completes.
    #[inline]
    pub fn push(&mut self, block: Block<T>) {
        match self.blocks.last_mut() {
            Some(last) if last.is_sibling_before(&block) => last.absorb(&block),
            _ => return self.blocks.push(block),
        }
        while let [.., before, last] = self.blocks.as_mut_slice()
            && before.is_sibling_before(last)
        {
            before.absorb(last);
            self.blocks.truncate(self.blocks.len() - 1);
        }
    }

    /// Adds the runs of `other`. The result does not depend on the order in which ranges are merged.
    ///
    /// # Errors
    /// If a run is in both.
    pub fn merge(&mut self, other: &Self) -> crate::Result<()> {
        let mut all: Vec<Block<T>> = self.blocks.iter().chain(&other.blocks).copied().collect();
        all.sort_by_key(|block| block.start);
        for pair in all.windows(2) {
            if pair[0].end() > pair[1].start {
                return Err(crate::Error::invalid(
                    "merge",
                    format!("run {} of a pixel is in both parts, expected each run once", pair[1].start),
                ));
            }
        }
        self.blocks.clear();
        for block in all {
            self.push(block);
        }
        Ok(())
    }

    /// Runs summed.
    #[must_use]
    pub fn runs(&self) -> u64 {
        self.blocks.iter().map(|block| block.end() - block.start).sum()
    }

    /// The sums over all runs; none without runs. From the smallest block up: the order is that of run numbers
    /// reversed, fixed by the runs alone.
    #[must_use]
    pub fn whole(&self) -> Option<T> {
        self.blocks.iter().rev().map(|block| block.sums).reduce(|later, mut earlier| {
            earlier.absorb(&later);
            earlier
        })
    }
}

/// Starts and levels of the maximal aligned blocks that `runs` consists of: those that summing it leaves.
pub fn aligned_blocks(runs: Range<u64>) -> impl Iterator<Item = (u64, u32)> {
    let mut at = runs.start;
    std::iter::from_fn(move || {
        let left = runs.end.checked_sub(at).filter(|&left| left > 0)?;
        let (start, level) = (at, at.trailing_zeros().min(left.ilog2()));
        at += 1 << level;
        Some((start, level))
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// A sum that remembers which runs it holds.
    #[derive(Debug, Clone, Copy, PartialEq)]
    struct Span(u64, u64);

    impl Join for Span {
        fn absorb(&mut self, next: &Self) {
            *self = Self(self.0.min(next.0), self.1 + next.1);
        }
    }

    proptest! {
        #[test]
        fn summing_a_range_leaves_its_aligned_blocks(a in 0_u64..500, n in 0_u64..500) {
            let mut sums = AlignedSums::default();
            for run in a..a + n {
                sums.push(Block { start: run, level: 0, sums: Span(run, 1) });
            }
            let left: Vec<(u64, u32)> = sums.blocks().iter().map(|b| (b.start, b.level)).collect();
            prop_assert_eq!(left, aligned_blocks(a..a + n).collect::<Vec<_>>());
            for block in sums.blocks() {
                prop_assert_eq!(block.sums, Span(block.start, 1 << block.level));
            }
        }
    }
}
