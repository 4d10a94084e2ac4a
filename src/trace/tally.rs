//! Rays counted per thread: a counter that all threads shared would cost more than some rays.

use std::cell::Cell;

thread_local! {
    static RAYS: Cell<u64> = const { Cell::new(0) };
}

/// Counts one ray of this thread.
#[inline]
pub fn count_ray() {
    RAYS.with(|rays| rays.set(rays.get() + 1));
}

/// Rays that this thread counted since it was last asked.
#[must_use]
pub fn take_rays() -> u64 {
    RAYS.with(|rays| rays.replace(0))
}
