//! N equal strata of [0, 1), and N cells of equal area that tile the square: bounds computed once, not for each point.

use super::hash::point_in_stratum;

/// Bounds of up to so many runs are kept (32 bytes a run); beyond, they are computed for each point.
const MOST_KEPT: u32 = 1 << 12;

/// N equal strata, and the cells of Cook, Porter and Carpenter (1984): rows of ⌊c⌋ or ⌈c⌉ cells, each row as high as it
/// has cells, so that every cell has area 1/N whatever N is.
#[derive(Debug, Clone)]
pub(crate) struct Strata {
    runs: u32,
    /// Where each stratum starts, in 2⁻²⁴, and the end of the last.
    bounds: Vec<u32>,
    /// Sides of each cell in 2⁻²⁴: left and right, top and bottom.
    cells: Vec<[[u32; 2]; 2]>,
}

impl Strata {
    /// For 1 to 2²⁴ `runs`.
    pub(crate) fn new(runs: u32) -> Self {
        let kept = if runs <= MOST_KEPT { runs } else { 0 };
        let ends = if kept > 0 { Some(1 << 24) } else { None };
        Self {
            runs,
            bounds: (0..kept).map(|stratum| point_in_stratum(stratum, runs, 0)).chain(ends).collect(),
            cells: (0..kept).map(|index| cell(index, runs)).collect(),
        }
    }

    /// A point of `stratum`, as a coordinate's bits: `position` (32 bits of [0, 1)) runs across the stratum.
    #[inline]
    pub(crate) fn point(&self, stratum: u32, position: u32) -> u32 {
        let at = stratum as usize;
        match self.bounds.get(at..at + 2) {
            Some(&[low, high]) => between(low, high, position),
            _ => self.divided(stratum, position),
        }
    }

    /// [`Self::point`] where no bounds are kept.
    #[cold]
    fn divided(&self, stratum: u32, position: u32) -> u32 {
        point_in_stratum(stratum, self.runs, position) << 8
    }

    /// One coordinate of a point of cell `index`: across, or down if `second`.
    #[inline]
    pub(crate) fn cell_point(&self, index: u32, second: bool, position: u32) -> u32 {
        let [low, high] = match self.cells.get(index as usize) {
            Some(sides) => sides[usize::from(second)],
            None => cell(index, self.runs)[usize::from(second)],
        };
        between(low, high, position)
    }
}

/// The coordinate bits at `position` of the way from `low` to `high`, both in 2⁻²⁴.
#[inline]
fn between(low: u32, high: u32, position: u32) -> u32 {
    #[allow(clippy::cast_possible_truncation, reason = "below the width, which is at most 2^24")]
    let offset = ((u64::from(high - low) * u64::from(position)) >> 32) as u32;
    (low + offset) << 8
}

/// Sides of cell `index` of `runs`.
fn cell(index: u32, runs: u32) -> [[u32; 2]; 2] {
    let rows = round_root(runs);
    let (short, longer) = (runs / rows, runs % rows);
    // The first `longer` rows have one cell more.
    let split = longer * (short + 1);
    let (start, width) = if index < split {
        (index / (short + 1) * (short + 1), short + 1)
    } else {
        (split + (index - split) / short * short, short)
    };
    let end = |stratum: u32, n: u32| if stratum == n { 1 << 24 } else { point_in_stratum(stratum, n, 0) };
    let column = index - start;
    [[end(column, width), end(column + 1, width)], [end(start, runs), end(start + width, runs)]]
}

/// The whole number nearest to √n.
fn round_root(n: u32) -> u32 {
    let root = n.isqrt();
    if n - root * root > root { root + 1 } else { root }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn kept_bounds_give_what_division_gives() {
        for runs in [1, 2, 3, 7, 16, 48, 100, 1000] {
            let strata = Strata::new(runs);
            for stratum in 0..runs {
                for position in [0, 1 << 31, u32::MAX] {
                    let divided = point_in_stratum(stratum, runs, position) << 8;
                    assert_eq!(strata.point(stratum, position), divided, "{stratum} of {runs}");
                }
            }
        }
    }

    /// Areas are 1/N up to the rounding of sides to 2⁻²⁴.
    #[test]
    fn cells_have_equal_areas_and_cover_the_square() {
        for runs in [1, 2, 3, 5, 11, 16, 37, 64, 4096] {
            let strata = Strata::new(runs);
            let mut sum = 0.0;
            for &[[left, right], [top, bottom]] in &strata.cells {
                let area = f64::from(right - left) * f64::from(bottom - top) / 2.0_f64.powi(48);
                assert!((area * f64::from(runs) - 1.0).abs() < 1e-3, "{runs} runs: {area}");
                sum += area;
            }
            assert!((sum - 1.0).abs() < 1e-9, "{runs} runs cover {sum}");
        }
    }
}
