//! Poisson-disk sets of the pixel's square by dart throwing (Mitchell 1990, §4.2; Cook 1986) and by point diffusion
//! (Mitchell 1987), for study.

use super::hash::{subkey, subseed};

/// Sets kept by a design; each pixel takes one, shifted around the torus.
const TILES: u64 = 32;

/// Darts per point before the radius shrinks.
const PATIENCE: u64 = 200;

/// How a set comes about.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Process {
    /// Points at random, none too near to an earlier one.
    Darts,
    /// Error diffusion over a grid of sixteen places a point.
    Diffusion,
}

/// Point sets on the unit torus in which no two points are near.
#[derive(Debug, Clone)]
pub(crate) struct DiskTiles {
    runs: usize,
    /// `[tile][run]`, coordinates in 2⁻³².
    points: Vec<[u32; 2]>,
}

impl DiskTiles {
    /// Sets of `runs` points. The time to throw darts is about quadratic in `runs`.
    pub(crate) fn new(runs: u32, seed: u64, process: Process) -> Self {
        let runs = runs as usize;
        let set = |tile| {
            let key = subkey(crate::numeric::mix64(seed), tile);
            match process {
                Process::Darts => throw(runs, key),
                Process::Diffusion => diffuse(runs, key),
            }
        };
        Self { runs, points: (0..TILES).flat_map(set).collect() }
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

/// `n` points by point diffusion (Mitchell 1987, §3): over a grid of about 16 n places, line by line, each place takes a
/// share of the errors of its neighbours to the left and above and a little noise about its own share of a point; above
/// one half it becomes a point, and what is left over is its error. The point is jittered within its place.
///
/// The number of points comes out near `n`; patterns are drawn until one has exactly `n`. Where none has after many, the
/// nearest is thinned or filled at random.
fn diffuse(n: usize, key: u64) -> Vec<[u32; 2]> {
    const ATTEMPTS: u64 = 12;
    let mut nearest: Option<Vec<[u32; 2]>> = None;
    for attempt in 0..ATTEMPTS {
        let points = diffused(n, subkey(key, attempt));
        if points.len() == n {
            return points;
        }
        if nearest.as_ref().is_none_or(|best| points.len().abs_diff(n) < best.len().abs_diff(n)) {
            nearest = Some(points);
        }
    }
    let mut points = nearest.unwrap_or_default();
    let random = |i: usize| subkey(key, ATTEMPTS + i as u64);
    while points.len() > n {
        let at = usize::try_from(random(points.len()) % points.len() as u64).unwrap_or(0);
        points.swap_remove(at);
    }
    for i in points.len()..n {
        #[allow(clippy::cast_possible_truncation, reason = "halves of a hash")]
        points.push([random(i) as u32, (random(i) >> 32) as u32]);
    }
    points
}

/// One pattern of about `n` points. A period above it and one to its left let the errors settle.
#[allow(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    clippy::cast_precision_loss,
    reason = "a grid of at most 2^14 places a side"
)]
fn diffused(n: usize, key: u64) -> Vec<[u32; 2]> {
    let width = libm::round(4.0 * libm::sqrt(n as f64)).max(1.0) as usize;
    let height = (16 * n).div_ceil(width);
    let share = n as f64 / (width * height) as f64;
    let unit = |word: u64| (word >> 32) as f64 / 4_294_967_296.0;
    let mut above = vec![0.0; 2 * width + 2];
    let mut points = Vec::new();
    for row in 0..2 * height {
        let mut line = vec![0.0; 2 * width + 2];
        for column in 0..2 * width {
            let word = subkey(key, (row * 2 * width + column) as u64);
            // The noise is a quarter of a place's share to each side.
            let own = share * (1.0 + 0.5 * (unit(word) - 0.5));
            // Entry c + 1 is place c's.
            let brought = 4.0 * line[column] + above[column] + 2.0 * above[column + 1] + above[column + 2];
            let sum = brought / 8.0 + own;
            let chosen = sum > 0.5;
            line[column + 1] = sum - f64::from(u8::from(chosen));
            if chosen && row >= height && column >= width {
                let place =
                    |at: usize, side: usize, u: f64| (((at - side) as f64 + u) / side as f64 * 4_294_967_296.0) as u32;
                let jitter = subkey(word, 1);
                points.push([place(column, width, unit(jitter)), place(row, height, unit(jitter << 32))]);
            }
        }
        above = line;
    }
    points
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Distance to the nearest neighbour, mean over points, in units of that of independent points (1/(2√n)):
    /// Mitchell's patterns keep points apart.
    #[test]
    fn diffused_points_are_as_many_as_asked_and_keep_apart() {
        for n in [1, 5, 16, 64, 200] {
            let points = diffuse(n, 7);
            assert_eq!(points.len(), n);
        }
        let n = 256;
        let points = diffuse(n, 3);
        let nearest = |i: usize| {
            let others = (0..n).filter(|&j| j != i).map(|j| squared_distance(points[i], points[j]));
            others.fold(f64::INFINITY, f64::min).sqrt()
        };
        let mean = (0..n).map(nearest).sum::<f64>() / n as f64;
        assert!(mean * 2.0 * (n as f64).sqrt() > 1.3, "{mean}");
    }
}
