//! The shutter's weight over the exposure, sampled by warping time.
//!
//! A shutter that opens and closes gradually weights light by w(t). Drawing times from the density w / ∫w, by the
//! inverse of its integral (Pharr, Jakob and Humphreys 2023, §2.3), leaves every sample the weight one: no variance is
//! added where nothing moves, and strata of `u_shutter` stay strata, since the warp never decreases.

use crate::{Error, Result};
use std::fmt;
use std::str::FromStr;

/// The most points that a polyline may have.
pub const MOST_KNOTS: usize = 16;

/// How much the light of each instant counts, over the exposure as [0, 1]; piecewise linear, any positive scale.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ShutterCurve {
    form: Form,
    /// Corners of the weight, ascending in time, `count` of them; none for the box.
    knots: [Knot; MOST_KNOTS],
    count: usize,
}

/// How it was written, so that it prints as it was read.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Form {
    Box,
    Trapezoid { opening: f64, closing: f64 },
    Polyline,
}

#[derive(Debug, Clone, Copy, PartialEq)]
struct Knot {
    /// Time, [0, 1].
    t: f64,
    /// Weight, not negative.
    weight: f64,
    /// Area under the curve before it.
    area: f64,
}

impl Knot {
    const NONE: Self = Self { t: 0.0, weight: 0.0, area: 0.0 };
}

impl Default for ShutterCurve {
    fn default() -> Self {
        Self::BOX
    }
}

impl ShutterCurve {
    /// Open at once, closed at once: every instant counts alike, and the warp is the identity bit for bit.
    pub const BOX: Self = Self { form: Form::Box, knots: [Knot::NONE; MOST_KNOTS], count: 0 };

    /// Opens linearly over the first `opening` of the exposure and closes linearly over the last `closing`.
    ///
    /// # Errors
    /// If one is negative or not finite, or their sum exceeds 1.
    pub fn trapezoid(opening: f64, closing: f64) -> Result<Self> {
        if !(opening >= 0.0 && closing >= 0.0 && opening + closing <= 1.0) {
            return Err(Error::invalid(
                format!("shutter curve trapezoid:{opening},{closing}"),
                "the parts in which it opens and closes must be 0 or more and together at most 1",
            ));
        }
        let corners = [(0.0, 0.0), (opening, 1.0), (1.0 - closing, 1.0), (1.0, 0.0)];
        Ok(Self { form: Form::Trapezoid { opening, closing }, ..Self::polyline(&corners)? })
    }

    /// Straight lines through `points` (time in [0, 1], weight), 2 to [`MOST_KNOTS`] in order of time; two at one time
    /// are a jump. Before the first and after the last the weight is zero.
    ///
    /// # Errors
    /// If there are too few or too many, times descend or leave [0, 1], a weight is negative or above 10⁹, or the area
    /// is zero.
    pub fn polyline(points: &[(f64, f64)]) -> Result<Self> {
        /// Squares of weights from its inverse to itself neither overflow nor vanish.
        const LARGEST: f64 = 1e9;
        let bad = |problem: String| Error::invalid("shutter curve", problem);
        if points.len() < 2 || points.len() > MOST_KNOTS {
            return Err(bad(format!("{} points; expected from 2 to {MOST_KNOTS}", points.len())));
        }
        let largest = points.iter().map(|p| p.1).fold(0.0, f64::max);
        let mut curve = Self { form: Form::Polyline, count: points.len(), ..Self::BOX };
        for (i, &(t, weight)) in points.iter().enumerate() {
            if !(0.0..=1.0).contains(&t) || i > 0 && t < points[i - 1].0 {
                return Err(bad(format!("time {t} of point {i}: expected ascending times from 0 to 1")));
            }
            if !(0.0..=LARGEST).contains(&weight) {
                return Err(bad(format!("weight {weight} of point {i}: expected a number from 0 to {LARGEST}")));
            }
            let area = match i.checked_sub(1).map(|before| curve.knots[before]) {
                Some(k) => k.area + 0.5 * (t - k.t) * (k.weight + weight),
                None => 0.0,
            };
            curve.knots[i] = Knot { t, weight, area };
        }
        let area = curve.area();
        // Below this part of the tallest weight rounding, not the curve, would decide where samples go.
        if area <= largest * f64::from(f32::EPSILON) || largest < 1.0 / LARGEST {
            return Err(bad("its area is zero or all but zero: no light would count".to_owned()));
        }
        Ok(curve)
    }

    /// Whether every instant counts alike, so that there is nothing to warp.
    #[must_use]
    pub fn is_box(&self) -> bool {
        self.count == 0
    }

    /// Its corners as (time, weight); none for the box.
    pub fn points(&self) -> impl Iterator<Item = (f64, f64)> + '_ {
        self.knots[..self.count].iter().map(|k| (k.t, k.weight))
    }

    fn area(&self) -> f64 {
        self.knots[self.count - 1].area
    }

    /// The time in [0, 1] at which the part `u_shutter` in [0, 1) of all light has been gathered.
    #[must_use]
    #[inline]
    #[allow(clippy::cast_possible_truncation, reason = "a coordinate is f32 by contract")]
    pub fn time_from_unit(&self, u_shutter: f32) -> f32 {
        if self.is_box() {
            return u_shutter;
        }
        let wanted = f64::from(u_shutter) * self.area();
        let knots = &self.knots[..self.count];
        let next = knots.partition_point(|k| k.area <= wanted).clamp(1, self.count - 1);
        let (from, to) = (knots[next - 1], knots[next]);
        let rest = wanted - from.area;
        // The root of w₀x + s x²/2 = rest, written so that nothing cancels whatever the sign of s.
        let slope = if to.t > from.t { (to.weight - from.weight) / (to.t - from.t) } else { 0.0 };
        let root = (from.weight * from.weight + 2.0 * slope * rest).max(0.0).sqrt();
        let denominator = from.weight + root;
        let x = if denominator > 0.0 { 2.0 * rest / denominator } else { 0.0 };
        ((from.t + x).clamp(from.t, to.t)) as f32
    }

    /// The part of all light gathered before `time`: the inverse of [`Self::time_from_unit`].
    #[must_use]
    pub fn unit_from_time(&self, time: f64) -> f64 {
        let time = time.clamp(0.0, 1.0);
        if self.is_box() {
            return time;
        }
        let knots = &self.knots[..self.count];
        let next = knots.partition_point(|k| k.t <= time);
        if next == 0 {
            return 0.0;
        }
        if next == self.count {
            return 1.0;
        }
        let from = knots[next - 1];
        (from.area + 0.5 * (time - from.t) * (from.weight + self.weight(time))) / self.area()
    }

    /// Density of sampled times: the weight at `time`, scaled to unit area. At a jump, the later side's.
    #[must_use]
    pub fn pdf(&self, time: f64) -> f64 {
        if self.is_box() { f64::from((0.0..=1.0).contains(&time)) } else { self.weight(time) / self.area() }
    }

    fn weight(&self, time: f64) -> f64 {
        let knots = &self.knots[..self.count];
        let next = knots.partition_point(|k| k.t <= time);
        match (next.checked_sub(1).map(|i| knots[i]), knots.get(next)) {
            (Some(a), Some(b)) => a.weight + (b.weight - a.weight) * ((time - a.t) / (b.t - a.t)),
            (Some(a), None) if time <= a.t => a.weight,
            _ => 0.0,
        }
    }
}

impl fmt::Display for ShutterCurve {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.form {
            Form::Box => f.write_str("box"),
            Form::Trapezoid { opening, closing } => write!(f, "trapezoid:{opening},{closing}"),
            Form::Polyline => {
                f.write_str("polyline:")?;
                self.points()
                    .enumerate()
                    .try_for_each(|(i, (t, w))| write!(f, "{}{t},{w}", if i == 0 { "" } else { ";" }))
            }
        }
    }
}

impl FromStr for ShutterCurve {
    type Err = Error;

    /// Reads `box`, `trapezoid:OPEN,CLOSE` (parts of the exposure) and `polyline:T,W;T,W;…`.
    fn from_str(text: &str) -> Result<Self> {
        let bad = || {
            Error::invalid(
                format!("shutter curve \"{text}\""),
                "expected box, trapezoid:OPEN,CLOSE or polyline:TIME,WEIGHT;TIME,WEIGHT;…",
            )
        };
        let pair = |t: &str| -> Result<(f64, f64)> {
            let (a, b) = t.split_once(',').ok_or_else(bad)?;
            Ok((a.trim().parse().map_err(|_| bad())?, b.trim().parse().map_err(|_| bad())?))
        };
        match text.trim().split_once(':') {
            None if text.trim() == "box" => Ok(Self::BOX),
            Some(("trapezoid", rest)) => pair(rest).and_then(|(opening, closing)| Self::trapezoid(opening, closing)),
            Some(("polyline", rest)) => Self::polyline(&rest.split(';').map(pair).collect::<Result<Vec<_>>>()?),
            _ => Err(bad()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn curve(text: &str) -> ShutterCurve {
        text.parse().unwrap()
    }

    #[test]
    fn the_box_passes_time_through_bit_for_bit() {
        for u in [0.0_f32, f32::MIN_POSITIVE, 0.1, 0.5, 0.999_999_94] {
            assert_eq!(ShutterCurve::BOX.time_from_unit(u).to_bits(), u.to_bits());
        }
    }

    #[test]
    fn curves_print_as_they_are_read() {
        for text in ["box", "trapezoid:0.25,0.25", "polyline:0,0;0.2,1;0.8,1;1,0"] {
            assert_eq!(curve(text).to_string(), text);
        }
        // A trapezoid that neither ramps up nor down weights as the box does.
        assert!((curve("trapezoid:0,0").time_from_unit(0.3) - 0.3).abs() < 1e-7);
    }

    #[test]
    fn nonsense_is_refused() {
        for bad in [
            "",
            "boxes",
            "trapezoid:0.7,0.7",
            "trapezoid:-0.1,0",
            "trapezoid:nan,0",
            "trapezoid:1",
            "polyline:0,1",
            "polyline:0,0;1,0",
            "polyline:0,1;1,-1",
            "polyline:0.5,1;0.2,1",
            "polyline:0,1;2,1",
            "polyline:0,1;1,inf",
            "polyline:0,1e308;1,1e308",
            "polyline:0,1e-308;1,1e-308",
            "polyline:0.5,1;0.5,1",
        ] {
            assert!(bad.parse::<ShutterCurve>().is_err(), "{bad}");
        }
    }

    #[test]
    fn a_gap_of_weight_zero_is_never_sampled() {
        let c = curve("polyline:0,1;0.3,1;0.3,0;0.7,0;0.7,2;1,2");
        for i in 0..10_000_u16 {
            let t = c.time_from_unit(f32::from(i) / 10_000.0);
            assert!(t <= 0.300_000_1 || t >= 0.699_999_9, "{t}");
        }
    }

    /// H₀: times are distributed with the curve's density. The warp of a stratified u (n = 4096 midpoints) puts
    /// within each of 64 cells a number of times that differs from n × the cell's integral by at most the two that
    /// its borders cut. Exact, no α. The planted twin, `u` itself, must be rejected.
    #[test]
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a cell of 64")]
    fn times_follow_the_density() {
        const N: u16 = 4096;
        for text in
            ["trapezoid:0.25,0.25", "trapezoid:1,0", "polyline:0,0;0.2,1;0.8,1;1,0", "polyline:0.1,3;0.4,0;0.9,1"]
        {
            let c = curve(text);
            let worst = |warp: &dyn Fn(f32) -> f32| {
                let mut cells = [0.0_f64; 64];
                for i in 0..N {
                    let t = warp((f32::from(i) + 0.5) / f32::from(N));
                    cells[((t * 64.0) as usize).min(63)] += 1.0;
                }
                (0_u8..64)
                    .map(|i| {
                        // Simpson's rule on 200 parts: the density is piecewise linear, jumps none of these.
                        let (a, h) = (f64::from(i) / 64.0, 1.0 / 64.0 / 200.0);
                        let mass: f64 = (0..200_u16)
                            .map(|k| {
                                let t = a + h * f64::from(k);
                                (c.pdf(t) + 4.0 * c.pdf(t + 0.5 * h) + c.pdf(t + h)) * h / 6.0
                            })
                            .sum();
                        (cells[usize::from(i)] - mass * f64::from(N)).abs()
                    })
                    .fold(0.0, f64::max)
            };
            let found = worst(&|u| c.time_from_unit(u));
            assert!(found < 2.5, "{text}: a cell is off by {found} of {N}");
            assert!(worst(&|u| u) > 20.0, "{text}: the planted twin passed");
        }
    }

    proptest! {
        #[test]
        fn warp_and_integral_are_inverse_and_monotone(
            weights in prop::collection::vec(0.0_f64..10.0, 2..10), u in 0.0_f32..1.0, v in 0.0_f32..1.0,
        ) {
            let last = weights.len() - 1;
            let points: Vec<_> = weights.iter().enumerate().map(|(i, &w)| (i as f64 / last as f64, w)).collect();
            prop_assume!(weights.iter().sum::<f64>() > 0.1);
            let c = ShutterCurve::polyline(&points).unwrap();
            let t = c.time_from_unit(u);
            prop_assert!((0.0..=1.0).contains(&t));
            // t is f32: half an ulp of 1 times the density.
            let slack = 1.2e-7 * (1.0 + weights.iter().fold(0.0, |a: f64, &w| a.max(w)) / c.area());
            prop_assert!((c.unit_from_time(f64::from(t)) - f64::from(u)).abs() <= slack);
            let (low, high) = (u.min(v), u.max(v));
            prop_assert!(c.time_from_unit(low) <= c.time_from_unit(high));
        }

        #[test]
        fn no_text_panics(text in "(box|trapezoid|polyline)?[:;,0-9.eE+-]{0,30}") {
            if let Ok(c) = text.parse::<ShutterCurve>() {
                prop_assert!(c.time_from_unit(0.5).is_finite());
            }
        }
    }
}
