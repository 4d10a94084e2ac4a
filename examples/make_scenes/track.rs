//! Keyframed curves.

use glam::{DQuat, DVec3};

/// What a curve drives.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Target {
    /// Metres.
    Translation,
    /// Unit quaternions.
    Rotation,
    /// Morph weights.
    Weights,
}

/// How a curve runs between its keys.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Run {
    /// Straight.
    Linear,
    /// Hermite, tangents from the neighbours.
    Cubic,
}

/// A curve: a row of numbers for each key.
#[derive(Debug, Clone)]
pub(crate) struct Track {
    pub(crate) target: Target,
    pub(crate) run: Run,
    /// Seconds, ascending.
    pub(crate) times: Vec<f64>,
    /// One row for each key.
    pub(crate) rows: Vec<Vec<f64>>,
}

impl Track {
    /// Places at the given times.
    pub(crate) fn translation(run: Run, keys: &[(f64, DVec3)]) -> Self {
        Self::from_rows(Target::Translation, run, keys.iter().map(|&(t, p)| (t, p.to_array().to_vec())))
    }

    /// Morph weights at the given times.
    pub(crate) fn weights(run: Run, keys: &[(f64, Vec<f64>)]) -> Self {
        Self::from_rows(Target::Weights, run, keys.iter().cloned())
    }

    /// Rotations at the given times, less than half a turn apart; signs are made to agree, so that a spline between
    /// neighbours takes the shorter way too.
    pub(crate) fn rotation(run: Run, keys: &[(f64, DQuat)]) -> Self {
        let mut last = DQuat::IDENTITY;
        let rows: Vec<_> = keys
            .iter()
            .map(|&(t, q)| {
                last = if last.dot(q) < 0.0 { -q } else { q };
                (t, last.to_array().to_vec())
            })
            .collect();
        Self::from_rows(Target::Rotation, run, rows.into_iter())
    }

    fn from_rows(target: Target, run: Run, keys: impl Iterator<Item = (f64, Vec<f64>)>) -> Self {
        let (times, rows) = keys.unzip();
        Self { target, run, times, rows }
    }

    /// The rows as glTF stores them: for a spline, each key as in-tangent, value, out-tangent, with the tangents of
    /// Catmull and Rom (1974) for uneven keys; the ends stand still unless the curve closes on itself.
    pub(crate) fn stored(&self) -> Vec<f64> {
        if self.run == Run::Linear {
            return self.rows.concat();
        }
        let last = self.rows.len() - 1;
        let span = self.times[last] - self.times[0];
        let gap: f64 = self.rows[0].iter().zip(&self.rows[last]).map(|(a, b)| (a - b).abs()).sum();
        let closed = gap < 1e-9;
        let mut out = Vec::new();
        for i in 0..=last {
            let before = if i > 0 { Some((i - 1, 0.0)) } else { closed.then(|| (last - 1, -span)) };
            let after = if i < last { Some((i + 1, 0.0)) } else { closed.then_some((1, span)) };
            let tangent: Vec<f64> = match (before, after) {
                (Some((a, shift_a)), Some((b, shift_b))) => {
                    let dt = self.times[b] + shift_b - self.times[a] - shift_a;
                    self.rows[a].iter().zip(&self.rows[b]).map(|(p, q)| (q - p) / dt).collect()
                }
                _ => vec![0.0; self.rows[i].len()],
            };
            out.extend(&tangent);
            out.extend(&self.rows[i]);
            out.extend(&tangent);
        }
        out
    }
}

/// Times `0, step, 2 step, …` up to and including `end`, each a product.
pub(crate) fn beats(end: f64, per_second: u32) -> Vec<f64> {
    let rate = f64::from(per_second);
    (0..).map(|i| f64::from(i) / rate).take_while(|&t| t <= end + 1e-9).collect()
}
