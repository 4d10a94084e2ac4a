//! Pads: what stratifies factors for which a design has no column of its own.

use super::hash::{draw, scramble_reversed, shuffle_reversed};
use super::nets::{self, NetTables};
use crate::factor::Factor;

/// The first of four columns of a net of which the first two and the last two were searched as pairs (up to 128 runs): the
/// lens and the light. A vertex has two such pairs.
const PAIRED: usize = 3;

/// Seeds of a group: one shuffles its runs, the others scramble its four columns.
pub(super) const SEEDS: usize = 5;

/// Four columns of one net for every further vertex, the runs of each shuffled against all others'.
#[derive(Debug, Clone)]
pub(super) struct Pads(NetTables);

/// The column that a factor has among the pads.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Pad {
    /// Four factors that share a shuffle.
    pub(super) group: u16,
    /// 0 to 3.
    pub(super) column: u16,
}

impl Pad {
    /// That of `factor`: a vertex is a group.
    #[inline]
    pub(super) fn of(factor: Factor) -> Self {
        let index = factor.index();
        match index.checked_sub(Factor::FIRST_VERTEX) {
            None => Self { group: 0xf000 + index / Factor::PER_VERTEX, column: index % Factor::PER_VERTEX },
            Some(further) => Self { group: further / Factor::PER_VERTEX, column: further % Factor::PER_VERTEX },
        }
    }

    /// The number of the seed that scrambles the column.
    #[inline]
    pub(super) fn scramble(self) -> u16 {
        1 + self.column
    }
}

/// What a seed is drawn by: odd, and below 2⁴⁸.
#[inline]
fn tag(group: u16, number: u16) -> u64 {
    (u64::from(group) << 16 | u64::from(number)) << 1 | 1
}

/// Seed `number` of the group `group` in the pixel of key `pixel_key`.
#[inline]
pub(super) fn seed(pixel_key: u64, group: u16, number: u16) -> u32 {
    (draw(pixel_key, tag(group, number)) >> 32) as u32
}

impl Pads {
    /// For `runs` runs.
    pub(super) fn new(runs: u32) -> Self {
        let bits = runs.next_power_of_two().trailing_zeros();
        let matrices = nets::nested(bits).map_or_else(
            || nets::sobol(4, bits.max(1)),
            |set| set.into_iter().skip(PAIRED).take(4).collect::<Vec<_>>(),
        );
        Self(NetTables::of_reversed_index(&matrices, bits))
    }

    /// The place of `run` in a group that `seed` shuffles.
    #[inline]
    pub(super) fn place(&self, run: u32, seed: u32) -> u32 {
        let bits = self.0.bits();
        shuffle_reversed(run.reverse_bits() >> (32 - bits.max(1)), bits, seed)
    }

    /// The coordinate's bits in a column that `seed` scrambles, at a place in its group.
    #[inline]
    pub(super) fn coordinate(&self, column: u16, place: u32, seed: u32) -> u32 {
        scramble_reversed(self.0.reversed(usize::from(column), place), seed).reverse_bits()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::design::point::jitter_tag;
    use std::collections::HashSet;

    /// Every number that a pixel draws by has one use: those of all groups, and those that jitter the first and the last
    /// runs of all factors.
    #[test]
    fn no_two_uses_share_a_number() {
        let mut seen = HashSet::new();
        for group in 0..=u16::MAX {
            for number in 0..u16::try_from(SEEDS).unwrap() {
                assert!(tag(group, number) < 1 << 48 && seen.insert(tag(group, number)), "{group}, {number}");
            }
        }
        for run in (0..8).chain((1 << 24) - 8..1 << 24) {
            for factor in 0..=u16::MAX {
                assert!(jitter_tag(run, factor) < 1 << 48 && seen.insert(jitter_tag(run, factor)), "{run}, {factor}");
            }
        }
    }

    #[test]
    fn a_vertex_is_a_group() {
        for vertex in 0..100_u16 {
            let factors = [Factor::light_u, Factor::light_v, Factor::lobe_u, Factor::lobe_v].map(|f| f(vertex));
            for (column, factor) in (0..).zip(factors) {
                assert_eq!(Pad::of(factor), Pad { group: vertex, column });
            }
        }
    }
}
