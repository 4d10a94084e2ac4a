//! From single measurements to curves with intervals.

use super::Measurement;
use serde::Serialize;
use statrs::distribution::{ContinuousCDF, StudentsT};

/// A mean with its 95 % interval over independent seeds.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Interval {
    /// The mean.
    pub mean: f64,
    /// Lower end; the mean itself where there is one seed alone.
    pub low: f64,
    /// Upper end.
    pub high: f64,
}

impl Interval {
    /// Student's interval of the mean; `None` of nothing.
    #[must_use]
    #[allow(clippy::cast_precision_loss, reason = "a count of seeds")]
    pub fn of(values: &[f64]) -> Option<Self> {
        if values.is_empty() {
            return None;
        }
        let n = values.len() as f64;
        let mean = values.iter().sum::<f64>() / n;
        let squares: f64 = values.iter().map(|v| (v - mean).powi(2)).sum();
        let half = match StudentsT::new(0.0, 1.0, n - 1.0) {
            Ok(t) if values.len() > 1 => t.inverse_cdf(0.975) * (squares / (n - 1.0) / n).sqrt(),
            _ => 0.0,
        };
        Some(Self { mean, low: mean - half, high: mean + half })
    }

    /// The interval of positive values on a logarithmic scale: the mean is geometric.
    #[must_use]
    pub fn of_logarithms(values: &[f64]) -> Option<Self> {
        let logs: Vec<f64> = values.iter().filter(|v| **v > 0.0).map(|v| libm::log(*v)).collect();
        let i = Self::of(&logs)?;
        Some(Self { mean: libm::exp(i.mean), low: libm::exp(i.low), high: libm::exp(i.high) })
    }
}

/// One number of runs on a curve.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct CurvePoint {
    /// Runs a pixel.
    pub runs: u32,
    /// Samples of the whole frame.
    pub samples: f64,
    /// Processor seconds over threads.
    pub seconds: Interval,
    /// Root of the mean squared error.
    pub rmse: Interval,
    /// relMSE, the reference's subtracted.
    pub rel_mse: Interval,
    /// Mean ꟻLIP.
    pub flip: Interval,
}

/// The seconds that an error costs.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Reach {
    /// relMSE asked for.
    pub rel_mse: f64,
    /// Seconds to reach it.
    pub seconds: Interval,
    /// Samples a pixel to reach it.
    pub runs: Interval,
    /// Whether it lies outside what was measured, continued along the fitted slope.
    pub extrapolated: bool,
}

/// Error against cost of one contender.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Curve {
    /// Its name.
    pub name: String,
    /// By ascending runs.
    pub points: Vec<CurvePoint>,
    /// Exponent of relMSE in samples: −1 is independent sampling.
    pub slope_samples: Option<Interval>,
    /// Exponent of relMSE in seconds.
    pub slope_seconds: Option<Interval>,
    /// Seconds to errors asked for.
    pub reach: Vec<Reach>,
}

/// A curve for each name, in order of first appearance.
#[must_use]
pub fn curves(measurements: &[Measurement], reach: &[f64]) -> Vec<Curve> {
    let mut names: Vec<&str> = Vec::new();
    for m in measurements {
        if !names.contains(&m.name.as_str()) {
            names.push(&m.name);
        }
    }
    names
        .iter()
        .map(|&name| curve(name, &measurements.iter().filter(|m| m.name == name).collect::<Vec<_>>(), reach))
        .collect()
}

fn curve(name: &str, all: &[&Measurement], reach: &[f64]) -> Curve {
    let mut runs: Vec<u32> = all.iter().map(|m| m.runs).collect();
    runs.sort_unstable();
    runs.dedup();
    let points: Vec<CurvePoint> = runs
        .iter()
        .filter_map(|&runs| {
            let here: Vec<&&Measurement> = all.iter().filter(|m| m.runs == runs).collect();
            let over =
                |value: &dyn Fn(&Measurement) -> f64| Interval::of(&here.iter().map(|m| value(m)).collect::<Vec<_>>());
            #[allow(clippy::cast_precision_loss, reason = "samples far below 2^52")]
            Some(CurvePoint {
                runs,
                samples: here.first()?.samples as f64,
                seconds: over(&|m| m.seconds)?,
                rmse: over(&|m| m.errors.rmse)?,
                rel_mse: over(&|m| m.errors.rel_mse)?,
                flip: over(&|m| m.errors.flip)?,
            })
        })
        .collect();
    let mut seeds: Vec<u64> = all.iter().map(|m| m.seed).collect();
    seeds.sort_unstable();
    seeds.dedup();
    // Each seed's own errors over the seconds that the point takes on average: clocks are noisier than errors.
    let own: Vec<Vec<[f64; 3]>> = seeds
        .iter()
        .map(|&seed| {
            let at = |p: &CurvePoint| {
                let m = all.iter().find(|m| m.seed == seed && m.runs == p.runs)?;
                (m.errors.rel_mse > 0.0 && p.seconds.mean > 0.0)
                    .then(|| [f64::from(p.runs), p.seconds.mean, m.errors.rel_mse].map(libm::log))
            };
            points.iter().filter_map(at).collect()
        })
        .collect();
    let slopes = |axis: usize| {
        let each: Vec<f64> = own.iter().filter_map(|line| fit(line, axis).map(|f| f.1)).collect();
        Interval::of(&each)
    };
    Curve {
        name: name.to_owned(),
        slope_samples: slopes(0),
        slope_seconds: slopes(1),
        reach: reach.iter().filter_map(|&x| reached(&own, x)).collect(),
        points,
    }
}

/// Least squares line of the logarithm of error over that of runs (axis 0) or seconds (1): value at zero, slope.
#[allow(clippy::cast_precision_loss, reason = "a few points")]
fn fit(line: &[[f64; 3]], axis: usize) -> Option<(f64, f64)> {
    if line.len() < 2 {
        return None;
    }
    let n = line.len() as f64;
    let mean = |k: usize| line.iter().map(|p| p[k]).sum::<f64>() / n;
    let (x, y) = (mean(axis), mean(2));
    let spread: f64 = line.iter().map(|p| (p[axis] - x).powi(2)).sum();
    let slope = line.iter().map(|p| (p[axis] - x) * (p[2] - y)).sum::<f64>() / spread;
    slope.is_finite().then_some((y - slope * x, slope))
}

fn reached(own: &[Vec<[f64; 3]>], target: f64) -> Option<Reach> {
    let wanted = libm::log(target);
    let crossings: Vec<([f64; 2], bool)> = own.iter().filter_map(|line| crossing(line, wanted)).collect();
    let over = |k: usize| Interval::of_logarithms(&crossings.iter().map(|c| libm::exp(c.0[k])).collect::<Vec<_>>());
    Some(Reach { rel_mse: target, runs: over(0)?, seconds: over(1)?, extrapolated: crossings.iter().any(|c| c.1) })
}

/// Logarithms of runs and seconds at which a curve comes down to `wanted`, and whether that is outside it.
fn crossing(line: &[[f64; 3]], wanted: f64) -> Option<([f64; 2], bool)> {
    for pair in line.windows(2) {
        let (a, b) = (pair[0], pair[1]);
        if a[2] >= wanted && b[2] < wanted {
            let part = (a[2] - wanted) / (a[2] - b[2]);
            return Some(([0, 1].map(|k| a[k] + part * (b[k] - a[k])), false));
        }
    }
    let continued = |axis: usize| {
        let (start, slope) = fit(line, axis)?;
        (slope < 0.0).then(|| (wanted - start) / slope)
    };
    Some(([continued(0)?, continued(1)?], true))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::study::cost::reference::Errors;

    /// relMSE = c / runs^1.5 with a little between seeds; seconds = runs / 100.
    fn made(seed: u64, runs: u32) -> Measurement {
        let factor = [0.9, 1.0, 1.1][usize::try_from(seed).unwrap()];
        let rel_mse = factor * f64::from(runs).powf(-1.5);
        let errors = Errors { mse: rel_mse, rmse: rel_mse.sqrt(), rel_mse, rel_mse_raw: rel_mse, flip: 0.1 };
        Measurement {
            name: "made".into(),
            runs,
            seed,
            samples: u64::from(runs),
            rays: 0,
            seconds: f64::from(runs) / 100.0,
            wall_s: 0.0,
            build_s: 0.0,
            errors,
        }
    }

    #[test]
    fn a_power_law_gives_its_exponent_and_its_seconds() {
        let all: Vec<Measurement> = (0..3).flat_map(|s| [4, 16, 64].map(|r| made(s, r))).collect();
        let curve = &curves(&all, &[8_f64.powf(-1.5), 1e-6])[0];
        assert!((curve.slope_samples.unwrap().mean + 1.5).abs() < 1e-9);
        let [inside, outside] = [curve.reach[0], curve.reach[1]];
        assert!((inside.runs.mean / 8.0 - 1.0).abs() < 0.01 && !inside.extrapolated, "{inside:?}");
        assert!(inside.seconds.low < 0.08 && inside.seconds.high > 0.08);
        assert!((outside.runs.mean / 1e4 - 1.0).abs() < 0.01 && outside.extrapolated, "{outside:?}");
    }

    /// Of four values the 95 % interval is 3.182 standard errors to each side (tables of Student's t).
    #[test]
    fn intervals_are_students() {
        let i = Interval::of(&[1.0, 2.0, 3.0, 4.0]).unwrap();
        let error = (5.0_f64 / 3.0 / 4.0).sqrt();
        assert!((i.high - i.mean - 3.182_446 * error).abs() < 1e-5, "{i:?}");
    }
}
