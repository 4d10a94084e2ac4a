//! Processor time: what a machine that also does other work has spent on this.

use nix::sys::resource::{UsageWho, getrusage};

/// Processor seconds of this process so far, all threads.
#[must_use]
#[allow(clippy::cast_precision_loss, reason = "seconds and microseconds are small")]
pub fn cpu_seconds() -> f64 {
    let seconds = |t: nix::sys::time::TimeVal| t.tv_sec() as f64 + t.tv_usec() as f64 * 1e-6;
    getrusage(UsageWho::RUSAGE_SELF).map_or(0.0, |u| seconds(u.user_time()) + seconds(u.system_time()))
}
