//! Evaluating keyframed curves, and bounding how fast they bend.
//!
//! Curves are evaluated in `f64` and by *piece*: between two neighbouring key times every curve is smooth, so a piece
//! names the segment it lies in and has a limit at each end, even where the curve jumps. Bounds of the first and
//! second derivative over a piece are what [`super::bake`] turns into a number of linear segments.

use super::animation::{Interpolation, Track};
use glam::{DQuat, DVec3, DVec4, Quat, Vec3};
use std::ops::{Add, Mul, Sub};

/// A key value with its wide form, in which curves are evaluated.
pub trait Value: Copy + PartialEq {
    /// The same in `f64`.
    type Wide: Copy + Add<Output = Self::Wide> + Sub<Output = Self::Wide> + Mul<f64, Output = Self::Wide>;
    /// Widening: exact.
    fn wide(self) -> Self::Wide;
    /// Euclidean length.
    fn length(wide: Self::Wide) -> f64;
    /// Whether both stand for the same: equal, or opposite quaternions of one rotation.
    fn same(self, other: Self) -> bool {
        self == other
    }
}

impl Value for Vec3 {
    type Wide = DVec3;
    fn wide(self) -> DVec3 {
        self.as_dvec3()
    }
    fn length(wide: DVec3) -> f64 {
        wide.length()
    }
}

impl Value for f32 {
    type Wide = f64;
    fn wide(self) -> f64 {
        f64::from(self)
    }
    fn length(wide: f64) -> f64 {
        wide.abs()
    }
}

impl Value for Quat {
    type Wide = DVec4;
    fn wide(self) -> DVec4 {
        DVec4::new(f64::from(self.x), f64::from(self.y), f64::from(self.z), f64::from(self.w))
    }
    fn length(wide: DVec4) -> f64 {
        wide.length()
    }
    fn same(self, other: Self) -> bool {
        self == other || self == -other
    }
}

/// Bounds of a curve over a piece: |value|, |first derivative|, |second derivative| (per second).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Jet {
    /// Bound of the value's length.
    pub value: f64,
    /// Bound of the first derivative's length.
    pub first: f64,
    /// Bound of the second derivative's length.
    pub second: f64,
}

impl Jet {
    /// Something that does not change.
    #[must_use]
    pub fn constant(value: f64) -> Self {
        Self { value, first: 0.0, second: 0.0 }
    }

    /// The product of two curves (Leibniz's rule with the triangle inequality).
    #[must_use]
    pub fn product(self, other: Self) -> Self {
        // Nothing times an unknown rate is nothing.
        let times = |x: f64, y: f64| if x > 0.0 && y > 0.0 { x * y } else { 0.0 };
        Self {
            value: times(self.value, other.value),
            first: times(self.first, other.value) + times(self.value, other.first),
            second: times(self.second, other.value)
                + 2.0 * times(self.first, other.first)
                + times(self.value, other.second),
        }
    }

    /// The same curve on a clock that runs `factor` times as fast: derivatives per unit of that clock.
    #[must_use]
    pub fn rescaled(self, factor: f64) -> Self {
        let rate = |d: f64, by: f64| if d > 0.0 { d * by } else { 0.0 };
        Self { value: self.value, first: rate(self.first, factor), second: rate(self.second, factor * factor) }
    }

    /// The sum of two curves.
    #[must_use]
    pub fn sum(self, other: Self) -> Self {
        Self { value: self.value + other.value, first: self.first + other.first, second: self.second + other.second }
    }
}

/// Between which keys a time lies.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Segment {
    /// Before the first key, after the last, or in a step: one key's value holds.
    Hold(usize),
    /// From this key to the next.
    Between(usize),
}

impl<T: Value> Track<T> {
    /// The segment that holds the open interval (`a`, `b`), which contains no key time, or the instant `a = b`.
    fn segment(&self, a: f64, b: f64) -> Segment {
        let middle = 0.5 * (a + b);
        let after = self.times.partition_point(|&t| t <= middle);
        if after == 0 {
            Segment::Hold(0)
        } else if after == self.times.len() || self.interpolation == Interpolation::Step {
            Segment::Hold(after - 1)
        } else {
            Segment::Between(after - 1)
        }
    }

    /// Value `component` of key `key`; `part` is 0 in-tangent, 1 value, 2 out-tangent (1 unless cubic).
    fn key(&self, key: usize, part: usize, component: usize) -> T {
        match self.interpolation {
            Interpolation::CubicSpline => self.values[(key * 3 + part) * self.width + component],
            _ => self.values[key * self.width + component],
        }
    }

    /// Whether the curve is exactly constant on [`a`, `b`), by its keys alone.
    #[must_use]
    pub fn is_constant(&self, a: f64, b: f64) -> bool {
        let begun = self.times.partition_point(|&t| t <= a);
        let reached = self.times.partition_point(|&t| t < b);
        let first = begun.saturating_sub(1);
        let last = match self.interpolation {
            Interpolation::Step => reached.saturating_sub(1),
            _ if reached == 0 || begun == self.times.len() => first,
            _ => reached.min(self.times.len() - 1),
        };
        (first..last).all(|k| (0..self.width).all(|c| self.flat(k, c)))
    }

    /// Whether component `c` does not change from key `k` to the next.
    fn flat(&self, k: usize, c: usize) -> bool {
        let (p, q) = (self.key(k, 1, c), self.key(k + 1, 1, c));
        if self.interpolation == Interpolation::CubicSpline {
            p == q && T::length(self.key(k, 2, c).wide()) <= 0.0 && T::length(self.key(k + 1, 0, c).wide()) <= 0.0
        } else {
            p.same(q)
        }
    }

    /// Key times strictly inside (`a`, `b`) at which the curve may bend or jump: of a step curve, only those at which
    /// its value changes.
    pub fn breaks(&self, a: f64, b: f64) -> impl Iterator<Item = f64> + '_ {
        let from = self.times.partition_point(|&t| t <= a);
        let to = self.times.partition_point(|&t| t < b).max(from);
        let matters = move |k: usize| {
            self.interpolation != Interpolation::Step || k == 0 || !(0..self.width).all(|c| self.flat(k - 1, c))
        };
        (from..to).filter(move |&k| matters(k)).map(|k| self.times[k])
    }

    /// Whether the curve may jump at time `t`.
    #[must_use]
    pub fn jumps_at(&self, t: f64) -> bool {
        let from = self.times.partition_point(|&k| k < t);
        let to = self.times.partition_point(|&k| k <= t);
        to > from && (self.interpolation == Interpolation::Step || to - from > 1)
    }

    /// Polynomial value of `component` at time `t` of the piece (`a`, `b`): not for rotations.
    #[must_use]
    pub fn value(&self, component: usize, (a, b): (f64, f64), t: f64) -> T::Wide {
        match self.segment(a, b) {
            Segment::Hold(k) => self.key(k, 1, component).wide(),
            Segment::Between(k) => self.expand(k, component, t)[0],
        }
    }

    /// Value, first and second derivative (per second) at time `t` of the smooth segment that key `k` begins.
    fn expand(&self, k: usize, component: usize, t: f64) -> [T::Wide; 3] {
        let span = self.times[k + 1] - self.times[k];
        let f = ((t - self.times[k]) / span).clamp(0.0, 1.0);
        let (p, q) = (self.key(k, 1, component).wide(), self.key(k + 1, 1, component).wide());
        if self.interpolation != Interpolation::CubicSpline {
            return [p * (1.0 - f) + q * f, (q - p) * (1.0 / span), p * 0.0];
        }
        let (m, n) = (self.key(k, 2, component).wide() * span, self.key(k + 1, 0, component).wide() * span);
        let (f2, f3) = (f * f, f * f * f);
        let at = |wp: f64, wm: f64, wq: f64, wn: f64| p * wp + m * wm + q * wq + n * wn;
        let (slower, slow) = (1.0 / (span * span), 1.0 / span);
        [
            at(2.0 * f3 - 3.0 * f2 + 1.0, f3 - 2.0 * f2 + f, 3.0 * f2 - 2.0 * f3, f3 - f2),
            at(6.0 * (f2 - f), 3.0 * f2 - 4.0 * f + 1.0, 6.0 * (f - f2), 3.0 * f2 - 2.0 * f) * slow,
            at(12.0 * f - 6.0, 6.0 * f - 4.0, 6.0 - 12.0 * f, 6.0 * f - 2.0) * slower,
        ]
    }

    /// Bounds of `component` over the piece (`a`, `b`), as a polynomial, in the norm `norm`.
    ///
    /// The part of a cubic over the piece, in Bézier form, lies in the hull of its control points, its derivative in
    /// the hull of three, its second derivative between two: each bound is the largest of them. All follow from value
    /// and derivatives at the piece's ends.
    #[must_use]
    pub fn jet(&self, component: usize, (a, b): (f64, f64), norm: impl Fn(T::Wide) -> f64) -> Jet {
        let k = match self.segment(a, b) {
            Segment::Hold(k) => return Jet::constant(norm(self.key(k, 1, component).wide())),
            Segment::Between(k) => k,
        };
        let [from, to] = [self.expand(k, component, a), self.expand(k, component, b)];
        if self.interpolation != Interpolation::CubicSpline {
            return Jet { value: norm(from[0]).max(norm(to[0])), first: norm(from[1]), second: 0.0 };
        }
        let third = (b - a) / 3.0;
        let largest = |values: &[T::Wide]| values.iter().map(|&v| norm(v)).fold(0.0, f64::max);
        Jet {
            value: largest(&[from[0], from[0] + from[1] * third, to[0] - to[1] * third, to[0]]),
            first: largest(&[from[1], from[1] + from[2] * (0.5 * (b - a)), to[1]]),
            second: largest(&[from[2], to[2]]),
        }
    }
}

impl Track<Quat> {
    /// Unit rotation at time `t` of the piece (`a`, `b`).
    #[must_use]
    pub fn rotation(&self, piece: (f64, f64), t: f64) -> DQuat {
        if self.interpolation == Interpolation::Linear
            && let Segment::Between(k) = self.segment(piece.0, piece.1)
        {
            let f = ((t - self.times[k]) / (self.times[k + 1] - self.times[k])).clamp(0.0, 1.0);
            return slerp(self.key(k, 1, 0).wide(), self.key(k + 1, 1, 0).wide(), f);
        }
        unit(self.value(0, piece, t))
    }

    /// Bounds of the rotation matrix over the piece (`a`, `b`): its norm is 1, its derivatives follow from the
    /// angular velocity ω, R′ = \[ω\]R and R″ = ([ω′] + \[ω\]²)R, so |R′| ≤ |ω| and |R″| ≤ |ω′| + |ω|².
    ///
    /// A slerp turns at a constant ω. A normalised cubic n = q/ρ, ρ = |q|, has ω = 2n′n* and ω′ = 2 Im(n″n*), hence
    /// |ω| = 2|n′| and |ω′| = 2|n″⊥|, the part of n″ across n. From q = ρn: n′ = q′⊥/ρ and n″⊥ = (q″⊥ − 2ρ′n′)/ρ; with
    /// |ρ′||q′⊥| ≤ |q′|²/2, ρ ≥ m, |q′| ≤ d and |q″| ≤ e: |ω| ≤ 2d/m and |ω′| ≤ 2e/m + 2d²/m². Where the spline comes
    /// so near zero that no m is known the second bound is infinite, which asks the caller to cut the piece.
    #[must_use]
    #[allow(clippy::cast_precision_loss, reason = "small counts")]
    pub fn rotation_jet(&self, (a, b): (f64, f64)) -> Jet {
        let Segment::Between(k) = self.segment(a, b) else {
            return Jet::constant(1.0);
        };
        if self.interpolation == Interpolation::Linear {
            let span = self.times[k + 1] - self.times[k];
            let (p, q) = (unit(self.key(k, 1, 0).wide()), unit(self.key(k + 1, 1, 0).wide()));
            let omega = 2.0 * half_angle(p, q) / span;
            return Jet { value: 1.0, first: omega, second: omega * omega };
        }
        const PROBES: usize = 8;
        let raw = self.jet(0, (a, b), |q| q.length());
        let nearest = (0..=PROBES)
            .map(|i| self.expand(k, 0, a + (b - a) * i as f64 / PROBES as f64)[0].length())
            .fold(f64::INFINITY, f64::min);
        // Between probes the length changes by at most |q′| times half their distance.
        let least = nearest - raw.first * (b - a) / (2.0 * PROBES as f64);
        if raw.first <= 0.0 {
            return Jet::constant(1.0);
        }
        if least <= 0.0 {
            return Jet { value: 1.0, first: f64::INFINITY, second: f64::INFINITY };
        }
        let (d, e) = (raw.first / least, raw.second / least);
        Jet { value: 1.0, first: 2.0 * d, second: 6.0 * d * d + 2.0 * e }
    }
}

/// The unit quaternion along `q`; the identity where `q` is zero or not finite.
pub(super) fn unit(q: DVec4) -> DQuat {
    let length = q.length();
    if length > 0.0 && length.is_finite() { DQuat::from_vec4(q / length) } else { DQuat::IDENTITY }
}

/// Half the rotation angle between two unit quaternions, in [0, π/2]: accurate at both ends, where an arc cosine of
/// the dot product is not.
fn half_angle(p: DQuat, q: DQuat) -> f64 {
    let (p, q) = (DVec4::from(p), DVec4::from(q));
    let q = if p.dot(q) < 0.0 { -q } else { q };
    2.0 * libm::atan2((p - q).length(), (p + q).length())
}

/// Spherical interpolation along the shorter arc; ends exact, equal keys give that key.
fn slerp(p: DVec4, q: DVec4, f: f64) -> DQuat {
    let (p, q) = (unit(p), unit(q));
    let angle = half_angle(p, q);
    let (p, mut q) = (DVec4::from(p), DVec4::from(q));
    if p.dot(q) < 0.0 {
        q = -q;
    }
    let sine = libm::sin(angle);
    // Below this angle sin(x)/x differs from 1 by less than half an ulp of f64.
    const SMALL: f64 = 1e-8;
    let (wp, wq) =
        if angle < SMALL { (1.0 - f, f) } else { (libm::sin((1.0 - f) * angle) / sine, libm::sin(f * angle) / sine) };
    unit(p * wp + q * wq)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn track(interpolation: Interpolation, times: &[f64], values: &[f32]) -> Track<f32> {
        Track { times: times.to_vec(), values: values.to_vec(), width: 1, interpolation }
    }

    #[test]
    fn a_step_is_constant_until_its_next_key() {
        let t = track(Interpolation::Step, &[0.0, 1.0, 2.0], &[1.0, 2.0, 2.0]);
        assert!(t.is_constant(0.5, 1.0) && !t.is_constant(0.5, 1.01) && t.is_constant(1.0, 5.0));
        assert!(t.is_constant(-3.0, 0.0) && t.jumps_at(1.0) && !t.jumps_at(0.5));
    }

    #[test]
    fn a_line_is_constant_only_outside_its_keys_or_between_equal_ones() {
        let t = track(Interpolation::Linear, &[1.0, 2.0, 3.0], &[0.0, 5.0, 5.0]);
        assert!(t.is_constant(0.0, 1.0) && t.is_constant(2.0, 9.0) && t.is_constant(3.0, 4.0));
        assert!(!t.is_constant(0.0, 1.5) && !t.is_constant(1.5, 2.5));
    }

    #[test]
    fn a_cubic_passes_through_its_keys_with_their_tangents() {
        // p(f) on [0, 2]: value 1 → 3, slopes 0.5 and −1.
        let t = track(Interpolation::CubicSpline, &[0.0, 2.0], &[9.0, 1.0, 0.5, -1.0, 3.0, 9.0]);
        let at = |x: f64| t.value(0, (0.0, 2.0), x);
        assert!((at(0.0) - 1.0).abs() < 1e-12 && (at(2.0) - 3.0).abs() < 1e-12);
        let slope = |x: f64| (at(x + 1e-6) - at(x - 1e-6)) / 2e-6;
        assert!((slope(1e-5) - 0.5).abs() < 1e-4 && (slope(2.0 - 1e-5) + 1.0).abs() < 1e-4);
    }

    #[test]
    fn antipodal_and_equal_keys_stand_still() {
        let q = DVec4::new(0.1, 0.2, 0.3, 0.9).normalize();
        for f in [0.0, 0.3, 1.0] {
            assert!(slerp(q, -q, f).angle_between(unit(q)) < 1e-12);
            assert!(slerp(q, q, f).angle_between(unit(q)) < 1e-12);
        }
    }

    proptest! {
        #[test]
        fn jets_bound_the_curve(values in prop::collection::vec(-10.0_f32..10.0, 6), span in 0.01_f64..20.0) {
            let t = track(Interpolation::CubicSpline, &[0.0, span], &values);
            let jet = t.jet(0, (0.0, span), f64::abs);
            let at = |x: f64| t.value(0, (0.0, span), x);
            let h = span / 400.0;
            for i in 1..400 {
                let x = h * f64::from(i);
                let first = (at(x + h) - at(x - h)) / (2.0 * h);
                let second = (at(x + h) - 2.0 * at(x) + at(x - h)) / (h * h);
                prop_assert!(at(x).abs() <= jet.value * (1.0 + 1e-9) + 1e-9);
                prop_assert!(first.abs() <= jet.first * 1.000_1 + 1e-6);
                prop_assert!(second.abs() <= jet.second * 1.000_1 + 1e-4);
            }
        }

        #[test]
        fn rotation_jets_bound_the_turning(q in prop::collection::vec(-1.0_f32..1.0, 24), cubic in any::<bool>()) {
            let quat = |i: usize| Quat::from_xyzw(q[i], q[i + 1], q[i + 2], q[i + 3] + 1.5);
            let track = if cubic {
                Track { times: vec![0.0, 1.0], values: (0..6).map(|k| quat(k * 4)).collect(), width: 1,
                        interpolation: Interpolation::CubicSpline }
            } else {
                Track { times: vec![0.0, 1.0], values: vec![quat(0), quat(4)], width: 1,
                        interpolation: Interpolation::Linear }
            };
            let jet = track.rotation_jet((0.0, 1.0));
            let n = 500;
            for i in 0..n {
                let at = |k: i32| track.rotation((0.0, 1.0), f64::from(k) / f64::from(n));
                let angle = at(i).angle_between(at(i + 1));
                prop_assert!(angle * f64::from(n) <= jet.first * 1.000_1 + 1e-5);
            }
        }
    }
}
