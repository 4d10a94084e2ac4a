//! Poisson-disk sets of the pixel's square by dart throwing (Mitchell 1990, §4.2; Cook 1986), for study.

use super::hash::{subkey, subseed};

/// Sets kept by a design; each pixel takes one, shifted around the torus.
const TILES: u64 = 32;

/// Darts per point before the radius shrinks.
const PATIENCE: u64 = 200;

/// Point sets on the unit torus in which no two points are near.
#[derive(Debug, Clone)]
pub(crate) struct DiskTiles {
    runs: usize,
    /// `[tile][run]`, coordinates in 2⁻³².
    points: Vec<[u32; 2]>,
}

impl DiskTiles {
    /// Sets of `runs` points. The time to throw them is about quadratic in `runs`.
    pub(crate) fn new(runs: u32, seed: u64) -> Self {
        let runs = runs as usize;
        let points = (0..TILES).flat_map(|tile| throw(runs, subkey(crate::numeric::mix64(seed), tile))).collect();
        Self { runs, points }
    }

    /// Film x, or y if `second`, of `run` in the pixel of `key`.
    pub(crate) fn coordinate(&self, run: u32, second: bool, key: u64) -> u32 {
        let tile = usize::try_from(key % TILES).unwrap_or(0);
        let shift = subseed(key, 7 + u64::from(second));
        self.points[tile * self.runs + run as usize][usize::from(second)].wrapping_add(shift)
    }
}

/// Squared distance on the torus, in units of its side.
fn squared_distance(a: [u32; 2], b: [u32; 2]) -> f64 {
    (0..2)
        .map(|k| {
            let along = a[k].wrapping_sub(b[k]);
            (f64::from(along.min(along.wrapping_neg())) / 4_294_967_296.0).powi(2)
        })
        .sum()
}

/// `n` points thrown one by one; a dart that falls too near to an earlier one is thrown again, and the radius shrinks
/// by a fiftieth when none has fitted for long.
fn throw(n: usize, key: u64) -> Vec<[u32; 2]> {
    #[allow(clippy::cast_precision_loss, reason = "a count of runs")]
    let mut squared_radius = 0.8_f64.powi(2) / n as f64;
    let mut points: Vec<[u32; 2]> = Vec::with_capacity(n);
    let mut darts = 0;
    let mut misses = 0;
    while points.len() < n {
        let word = subkey(key, darts);
        darts += 1;
        #[allow(clippy::cast_possible_truncation, reason = "halves of a hash")]
        let dart = [word as u32, (word >> 32) as u32];
        if points.iter().all(|&p| squared_distance(p, dart) >= squared_radius) {
            points.push(dart);
            misses = 0;
        } else {
            misses += 1;
            if misses == PATIENCE {
                squared_radius *= 0.96;
                misses = 0;
            }
        }
    }
    points
}
