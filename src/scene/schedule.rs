//! When a motion gets its keys: as few as keep linear interpolation within a bound.
//!
//! Everything here is a function of u in [0, 1], the exposure from its opening to its closing. A [`Clock`] says which
//! instant of an object's own time that is.

use super::rig::{Piece, Rig};
use crate::time::{Exposure, snap_within};

/// An object's own time over the exposure: the motion-blur amount scales it about mid-exposure.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Clock {
    /// The object's time when the exposure opens, seconds.
    pub open: f64,
    /// The object's time when it closes, seconds; not before `open`.
    pub close: f64,
}

impl Clock {
    /// The clock of an object of motion-blur amount `amount`; 0 stands at mid-exposure.
    ///
    /// Every difference is rounded to a grid before it meets an instant, so the same animation an hour later has the
    /// same clock an hour later, bit for bit.
    #[must_use]
    pub fn new(interval: Exposure, amount: f64) -> Self {
        let middle = interval.middle();
        if amount <= 0.0 || amount.is_nan() || interval.is_instant() {
            return Self { open: middle, close: middle };
        }
        if amount.to_bits() == 1.0_f64.to_bits() {
            return Self { open: interval.open, close: interval.close };
        }
        let at = |t: f64| middle + snap_within(amount * (t - middle));
        Self { open: at(interval.open), close: at(interval.close) }
    }

    /// Length, seconds.
    #[must_use]
    pub fn duration(self) -> f64 {
        self.close - self.open
    }

    /// Whether it stands.
    #[must_use]
    pub fn stands(self) -> bool {
        self.open >= self.close
    }

    /// The instant at `u`; exact at both ends.
    #[must_use]
    pub fn time(self, u: f64) -> f64 {
        if u >= 1.0 { self.close } else { self.open + snap_within(self.duration() * u) }
    }

    /// Where in the exposure the instant `time` is.
    #[must_use]
    pub fn u(self, time: f64) -> f64 {
        ((time - self.open) / self.duration()).clamp(0.0, 1.0)
    }

    /// A stretch of the exposure and an instant in it, on the file's clock.
    #[must_use]
    pub fn on_file(self, rig: &Rig<'_>, (from, to): (f64, f64), at: f64) -> (Piece, f64) {
        let piece = (self.time(from), self.time(to));
        let shift = rig.shift(piece);
        ((piece.0 - shift, piece.1 - shift), self.time(at) - shift)
    }
}

/// An instant at which a motion gets a key.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct KeyInstant {
    /// Its place in the exposure, as stored.
    pub u: f32,
    /// The same, unrounded where it is a piece's end.
    pub at: f64,
    /// The piece whose limit is meant: at a jump there is one from each side.
    pub piece: (f64, f64),
}

/// A piece is not cut finer than into this many halves of halves.
const MOST_HALVINGS: u32 = 14;

/// Key instants for a motion that is smooth between `breaks` (place in the exposure, whether it may jump), in order
/// and each once, so that every linear segment keeps to its bound: `needed` says how many equal segments a smooth
/// stretch calls for (any number; infinite asks for it to be cut). At most `most` (at least 4) keys.
///
/// A stretch is halved where that saves a tenth of its segments: curves that bend at one end only get their keys
/// there.
#[must_use]
pub fn key_instants(breaks: &[(f64, bool)], most: usize, needed: impl Fn(f64, f64) -> f64) -> Vec<KeyInstant> {
    if 2 * breaks.len() + 2 > most {
        return evenly(most);
    }
    let mut stretches = Vec::new();
    let (mut from, mut jump) = (0.0, false);
    for &(to, jumps) in breaks.iter().chain(&[(1.0, false)]) {
        let first = stretches.len();
        let room = most / 2;
        divide((from, to), (MOST_HALVINGS, room), needed(from, to), &needed, &mut stretches);
        if let Some(s) = stretches.get_mut(first) {
            s.jump = jump;
        }
        for s in &mut stretches[first..] {
            s.piece = (from, to);
        }
        (from, jump) = (to, jumps);
    }
    limit(&mut stretches, most - breaks.len() - 1);
    let mut keys: Vec<KeyInstant> = Vec::new();
    for s in &stretches {
        // Where nothing jumps one key ends a stretch and begins the next.
        if s.jump || keys.is_empty() {
            keys.push(end_key(s.from, s.piece));
        }
        push_segments(s, &mut keys);
    }
    keys
}

/// A part of a piece that is cut into equal segments.
#[derive(Debug, Clone, Copy)]
struct Stretch {
    from: f64,
    to: f64,
    segments: usize,
    piece: (f64, f64),
    jump: bool,
}

#[allow(clippy::cast_possible_truncation, reason = "places in the exposure are stored as f32")]
fn end_key(at: f64, piece: (f64, f64)) -> KeyInstant {
    KeyInstant { u: at as f32, at, piece }
}

/// The key instants after a stretch's first. Within a piece the instant is that of the rounded place, so that
/// rounding moves a key along the curve and not off it.
#[allow(clippy::cast_possible_truncation, clippy::cast_precision_loss, reason = "stored as f32; bounded counts")]
fn push_segments(s: &Stretch, keys: &mut Vec<KeyInstant>) {
    for i in 1..s.segments {
        let u = (s.from + (s.to - s.from) * (i as f64 / s.segments as f64)) as f32;
        keys.push(KeyInstant { u, at: f64::from(u).clamp(s.piece.0, s.piece.1), piece: s.piece });
    }
    keys.push(end_key(s.to, s.piece));
}

/// Cuts (`from`, `to`), which calls for `wanted` segments as a whole, where that saves segments, while there are at
/// most `room` stretches.
#[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "clamped to a count")]
fn divide(
    (from, to): (f64, f64),
    (halvings, room): (u32, usize),
    wanted: f64,
    needed: &impl Fn(f64, f64) -> f64,
    out: &mut Vec<Stretch>,
) {
    // Far above any bound on keys, and exact in f64.
    const MANY: f64 = 1e9;
    let count = |n: f64| if n.is_nan() { MANY } else { n.ceil().clamp(1.0, MANY) };
    let whole = count(wanted);
    if whole > 2.0 && halvings > 0 && out.len() < room {
        let middle = 0.5 * (from + to);
        let halves = (needed(from, middle), needed(middle, to));
        if count(halves.0) + count(halves.1) <= 0.9 * whole || !wanted.is_finite() {
            divide((from, middle), (halvings - 1, room), halves.0, needed, out);
            divide((middle, to), (halvings - 1, room), halves.1, needed, out);
            return;
        }
    }
    let segments = if wanted.is_finite() { whole as usize } else { 1 };
    out.push(Stretch { from, to, segments, piece: (from, to), jump: false });
}

/// Scales segment counts down to at most `most` in all, or one each.
#[allow(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    clippy::cast_precision_loss,
    reason = "bounded counts"
)]
fn limit(stretches: &mut [Stretch], most: usize) {
    let total: usize = stretches.iter().map(|s| s.segments).sum();
    if total > most {
        let share = most as f64 / total as f64;
        for s in stretches {
            s.segments = ((s.segments as f64 * share) as usize).max(1);
        }
    }
}

/// `most` keys at equal distances, each an instant of its own: for more pieces than keys.
#[allow(clippy::cast_possible_truncation, clippy::cast_precision_loss, reason = "stored as f32; bounded counts")]
fn evenly(most: usize) -> Vec<KeyInstant> {
    let at = |i: usize| i as f64 / (most - 1) as f64;
    (0..most).map(|i| KeyInstant { u: at(i) as f32, at: at(i), piece: (at(i), at(i)) }).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn places(keys: &[KeyInstant]) -> Vec<f32> {
        keys.iter().map(|k| k.u).collect()
    }

    #[test]
    fn a_jump_has_a_key_from_each_side_and_a_kink_one() {
        let keys = key_instants(&[(0.25, true), (0.5, false)], 64, |_, _| 1.0);
        assert_eq!(places(&keys), [0.0, 0.25, 0.25, 0.5, 1.0]);
        assert_eq!(keys[1].piece, (0.0, 0.25));
        assert_eq!(keys[2].piece, (0.25, 0.5));
    }

    #[test]
    fn even_bending_is_cut_evenly_and_no_finer_than_asked() {
        let keys = key_instants(&[], 1000, |a, b| 100.0 * (b - a));
        assert_eq!(keys.len(), 101);
    }

    #[test]
    fn bending_at_one_end_gets_its_keys_there() {
        // √|x″| ∝ (1 − u)³: a whole stretch must assume its largest, 400; the integral is 100.
        let keys = key_instants(&[], 1000, |a, b| 400.0 * (b - a) * (1.0 - a).powi(3));
        assert!(keys.len() < 160, "{}", keys.len());
        assert!(keys.windows(2).all(|w| w[0].u < w[1].u));
    }

    #[test]
    fn an_unknown_bound_is_cut_until_it_is_known() {
        // Unknown across the middle.
        let keys = key_instants(&[], 1000, |a, b| if a < 0.501 && b > 0.501 { f64::INFINITY } else { 1.0 });
        assert!(keys.len() > 10 && keys.len() < 40);
    }

    #[test]
    fn no_more_keys_than_allowed() {
        for n in [1.0, 1e3, 1e7, f64::INFINITY, f64::NAN] {
            assert!(key_instants(&[(0.3, true)], 100, |_, _| n).len() <= 100, "{n}");
        }
        let breaks: Vec<_> = (1..1000).map(|i| (f64::from(i) / 1000.0, i % 2 == 0)).collect();
        let keys = key_instants(&breaks, 100, |_, _| 1.0);
        assert_eq!((keys.len(), keys[0].u, keys[99].u), (100, 0.0, 1.0));
    }

    #[test]
    fn a_clock_of_amount_one_is_the_exposure_and_of_zero_its_middle() {
        // An odd number of grid steps: the middle is not on the grid.
        let interval = Exposure { open: 36_000.0, close: 36_000.0 + 3.0 / 4_294_967_296.0 };
        let clock = Clock::new(interval, 1.0);
        assert_eq!((clock.open.to_bits(), clock.close.to_bits()), (interval.open.to_bits(), interval.close.to_bits()));
        let frozen = Clock::new(interval, 0.0);
        assert!(frozen.stands() && frozen.open.to_bits() == interval.middle().to_bits());
    }
}
