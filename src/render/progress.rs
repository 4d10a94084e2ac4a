//! How far the work is, and whether it should stop.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};

/// Shared between the threads that render and whoever watches.
#[derive(Debug, Default)]
pub struct Progress {
    pixels: AtomicU64,
    samples: AtomicU64,
    rays: AtomicU64,
    cancelled: Arc<AtomicBool>,
}

impl Progress {
    /// Progress that stops when `flag` is raised.
    #[must_use]
    pub fn stopped_by(flag: Arc<AtomicBool>) -> Self {
        Self { cancelled: flag, ..Self::default() }
    }

    /// Counts finished pixels and the samples they took; gives the rays that this thread traced for them.
    pub fn advance(&self, pixels: u64, samples: u64) -> u64 {
        let rays = crate::trace::tally::take_rays();
        self.pixels.fetch_add(pixels, Ordering::Relaxed);
        self.samples.fetch_add(samples, Ordering::Relaxed);
        self.rays.fetch_add(rays, Ordering::Relaxed);
        rays
    }

    /// Asks the work to stop at the next tile.
    pub fn cancel(&self) {
        self.cancelled.store(true, Ordering::Relaxed);
    }

    /// Whether the work was asked to stop.
    #[must_use]
    pub fn is_cancelled(&self) -> bool {
        self.cancelled.load(Ordering::Relaxed)
    }

    /// Finished pixels.
    #[must_use]
    pub fn pixels(&self) -> u64 {
        self.pixels.load(Ordering::Relaxed)
    }

    /// Samples taken.
    #[must_use]
    pub fn samples(&self) -> u64 {
        self.samples.load(Ordering::Relaxed)
    }

    /// Rays traced.
    #[must_use]
    pub fn rays(&self) -> u64 {
        self.rays.load(Ordering::Relaxed)
    }
}
