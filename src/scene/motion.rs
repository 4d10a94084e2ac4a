//! A rigid or affine motion over one exposure, as linear segments, and when there is anything that moves.

use crate::factor::compiled;
use glam::Affine3A;

/// A piecewise linear path of affine transforms over `u_time` in [0, 1].
///
/// One key is something that does not move in this exposure: exactly, by construction. Two keys at the same time are a
/// jump. Between keys the twelve matrix entries are interpolated linearly, which moves every point on a straight line.
#[derive(Debug, Clone, PartialEq)]
pub struct Motion {
    times: Vec<f32>,
    keys: Vec<Affine3A>,
    presence: Presence,
}

/// When something is there in an exposure: always, or only within some spans of it.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Presence {
    /// Spans [from, to) of `u_time`, ascending; empty: always.
    spans: Vec<[f32; 2]>,
}

impl Presence {
    /// There throughout.
    pub const ALWAYS: Self = Self { spans: Vec::new() };

    /// There within `spans`, [from, to) in `u_time`, one at least, ascending; one that ends at 1 includes it.
    ///
    /// # Panics
    /// If there is no span: what is never there is nothing.
    #[must_use]
    pub fn within(mut spans: Vec<[f32; 2]>) -> Self {
        assert!(!spans.is_empty(), "something is there at some time");
        debug_assert!(spans.is_sorted_by(|a, b| a[0] <= a[1] && a[1] <= b[0]), "spans ascend");
        spans.iter_mut().filter(|s| s[1] >= 1.0).for_each(|s| s[1] = f32::INFINITY);
        Self { spans }
    }

    /// Whether it is there throughout.
    #[must_use]
    #[inline(always)]
    pub fn is_always(&self) -> bool {
        self.spans.is_empty()
    }

    /// Whether it is there at `u_time` in [0, 1].
    #[must_use]
    #[inline(always)]
    pub fn holds(&self, u_time: f32) -> bool {
        self.is_always() || self.spans.iter().any(|&[from, to]| from <= u_time && u_time < to)
    }
}

impl Motion {
    /// Something that stands still.
    #[must_use]
    pub fn still(transform: Affine3A) -> Self {
        Self { times: vec![0.0], keys: vec![transform], presence: Presence::ALWAYS }
    }

    /// A path through `keys` at ascending `times`, the first 0 and the last 1.
    ///
    /// # Panics
    /// If the lengths differ or there are fewer than two keys; use [`Motion::still`] for one.
    #[must_use]
    pub fn through(times: Vec<f32>, keys: Vec<Affine3A>) -> Self {
        assert!(times.len() == keys.len() && keys.len() >= 2, "a path needs a time for each of two or more keys");
        debug_assert!(times.windows(2).all(|w| w[0] <= w[1]), "times ascend");
        debug_assert!(times[0] <= 0.0 && times[times.len() - 1] >= 1.0, "the keys span the exposure");
        Self { times, keys, presence: Presence::ALWAYS }
    }

    /// The same motion of something that is there only at times.
    #[must_use]
    pub fn present(mut self, presence: Presence) -> Self {
        self.presence = presence;
        self
    }

    /// When what moves is there.
    #[must_use]
    #[inline(always)]
    pub fn presence(&self) -> &Presence {
        &self.presence
    }

    /// Whether it looks the same throughout: it stands still and is always there.
    #[must_use]
    pub fn is_constant(&self) -> bool {
        self.is_still() && self.presence.is_always()
    }

    /// Whether it stands still.
    #[must_use]
    #[inline]
    pub fn is_still(&self) -> bool {
        !compiled::TIME || self.keys.len() == 1
    }

    /// Key times in [0, 1], ascending.
    #[must_use]
    pub fn times(&self) -> &[f32] {
        &self.times
    }

    /// The transforms at [`Motion::times`].
    #[must_use]
    pub fn keys(&self) -> &[Affine3A] {
        &self.keys
    }

    /// The transform at `u_time` in [0, 1].
    #[must_use]
    #[inline(always)]
    pub fn at(&self, u_time: f32) -> Affine3A {
        if !compiled::TIME || self.keys.len() == 1 {
            return self.keys[0];
        }
        let (segment, f) = segment_at(&self.times, u_time);
        lerp(&self.keys[segment], &self.keys[segment + 1], f)
    }
}

/// The segment of `times` (at least two, ascending) that holds `u_time`, and where in it, in [0, 1].
#[must_use]
#[inline(always)]
pub fn segment_at(times: &[f32], u_time: f32) -> (usize, f32) {
    /// Up to this many times are counted instead of halved: no branch depends on the ray's time.
    const FEW: usize = 9;
    let inner = &times[1..times.len() - 1];
    let segment = match times.len() {
        2 => 0,
        3..=FEW => inner.iter().map(|&t| usize::from(t <= u_time)).sum(),
        _ => inner.partition_point(|&t| t <= u_time),
    };
    let (a, b) = (times[segment], times[segment + 1]);
    let f = if b > a { ((u_time - a) / (b - a)).clamp(0.0, 1.0) } else { 1.0 };
    (segment, f)
}

/// Entrywise interpolation: `a` exactly at 0, `b` exactly at 1.
#[must_use]
#[inline(always)]
pub fn lerp(a: &Affine3A, b: &Affine3A, f: f32) -> Affine3A {
    #[cfg(test)]
    lerped::count();
    let g = 1.0 - f;
    Affine3A { matrix3: a.matrix3 * g + b.matrix3 * f, translation: a.translation * g + b.translation * f }
}

/// How often this thread interpolated: tests see to it that what stands still is not.
#[cfg(test)]
pub(crate) mod lerped {
    use std::cell::Cell;

    thread_local!(static TIMES: Cell<u64> = const { Cell::new(0) });

    pub(super) fn count() {
        TIMES.with(|times| times.set(times.get() + 1));
    }

    /// How often since this was last asked.
    pub(crate) fn take() -> u64 {
        TIMES.with(|times| times.replace(0))
    }
}
