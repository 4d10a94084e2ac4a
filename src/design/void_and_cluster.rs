//! Blue-noise masks by void and cluster (Ulichney 1993), in integers.

/// Standard deviation of the Gaussian that measures crowding, in pixels (Ulichney 1993, §3, takes 1.5).
const SIGMA: f64 = 1.5;

/// Half-width of the Gaussian's window: beyond it the weight is below 10⁻⁶ of the centre's.
const REACH: isize = 8;

/// Crowding at each pixel of a torus: the sum of Gaussians around the pixels that are set.
struct Energy {
    side: usize,
    /// Weights in 2⁻⁴⁰, `[dy + REACH][dx + REACH]`: integers, so that no order of sums shows.
    kernel: Vec<i64>,
    at: Vec<i64>,
    set: Vec<bool>,
}

impl Energy {
    fn new(side: usize) -> Self {
        let mut kernel = Vec::new();
        for dy in -REACH..=REACH {
            for dx in -REACH..=REACH {
                #[allow(clippy::cast_precision_loss, reason = "at most 128")]
                let weight = libm::exp(-((dx * dx + dy * dy) as f64) / (2.0 * SIGMA * SIGMA));
                #[allow(clippy::cast_possible_truncation, reason = "at most 2⁴⁰")]
                kernel.push(libm::round(weight * (1_i64 << 40) as f64) as i64);
            }
        }
        Self { side, kernel, at: vec![0; side * side], set: vec![false; side * side] }
    }

    fn toggle(&mut self, pixel: usize) {
        let sign = if self.set[pixel] { -1 } else { 1 };
        self.set[pixel] = !self.set[pixel];
        let (x, y) = (pixel % self.side, pixel / self.side);
        let mut weights = self.kernel.iter();
        for dy in -REACH..=REACH {
            let row = wrapped(y, dy, self.side) * self.side;
            for dx in -REACH..=REACH {
                let weight = weights.next().copied().unwrap_or(0);
                self.at[row + wrapped(x, dx, self.side)] += sign * weight;
            }
        }
    }

    /// The most crowded pixel that is set, the first of equals.
    fn tightest_cluster(&self) -> usize {
        (0..self.at.len()).filter(|&p| self.set[p]).max_by_key(|&p| (self.at[p], usize::MAX - p)).unwrap_or(0)
    }

    /// The least crowded pixel that is not set, the first of equals.
    fn largest_void(&self) -> usize {
        (0..self.at.len()).filter(|&p| !self.set[p]).min_by_key(|&p| (self.at[p], p)).unwrap_or(0)
    }
}

fn wrapped(x: usize, dx: isize, side: usize) -> usize {
    (x + side).wrapping_add_signed(dx) % side
}

/// Ranks 0 to side² − 1 of a mask of `side` × `side` pixels, row by row; `side` from 16 to 256.
pub(crate) fn ranks(side: usize) -> Vec<u16> {
    let area = side * side;
    let mut energy = Energy::new(side);
    for i in 0..area as u64 {
        if super::hash::subkey(0xb1e0_0153, i).is_multiple_of(10) {
            energy.toggle(usize::try_from(i).unwrap_or(0));
        }
    }
    // Move the tightest cluster's pixel to the largest void until it stays where it is.
    loop {
        let cluster = energy.tightest_cluster();
        energy.toggle(cluster);
        let void = energy.largest_void();
        energy.toggle(void);
        if void == cluster {
            break;
        }
    }
    let mut ranks = vec![0_u16; area];
    let start: Vec<bool> = energy.set.clone();
    let ones = start.iter().filter(|&&s| s).count();
    let rank = |r: usize| u16::try_from(r).unwrap_or(u16::MAX);
    for r in (0..ones).rev() {
        let cluster = energy.tightest_cluster();
        energy.toggle(cluster);
        ranks[cluster] = rank(r);
    }
    for (pixel, _) in start.iter().enumerate().filter(|&(_, &set)| set) {
        energy.toggle(pixel);
    }
    // From half on, voids among the unset are clusters of the unset: the same pixel, so one loop serves both phases.
    for r in ones..area {
        let void = energy.largest_void();
        energy.toggle(void);
        ranks[void] = rank(r);
    }
    ranks
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_rank_occurs_once() {
        let mut ranks = ranks(32);
        ranks.sort_unstable();
        assert!(ranks.iter().enumerate().all(|(i, &r)| i == usize::from(r)));
    }

    /// The mean of the mask over any 8 × 8 block strays less than a third of what independent values would (whose
    /// standard deviation is side²/√12/8).
    #[test]
    fn neighbouring_ranks_balance() {
        let side = 32;
        let ranks = ranks(side);
        let white = (side * side) as f64 / 12.0_f64.sqrt() / 8.0;
        let mut variance = 0.0;
        for by in 0..4 {
            for bx in 0..4 {
                let sum: f64 =
                    (0..64).map(|i| f64::from(ranks[(by * 8 + i / 8) * side + bx * 8 + i % 8])).sum::<f64>() / 64.0;
                variance += (sum - 511.5).powi(2) / 16.0;
            }
        }
        assert!(variance.sqrt() < white / 3.0, "{} of {white}", variance.sqrt());
    }
}
