//! What strangers write is read without harm: scene files, curves, `extras`, frame lists.
//!
//! Structured mutation from a seed, on stable Rust: a failure names its iteration, which repeats. Where the right
//! answer can be computed another way, it is, and answers are compared. A plain run takes a fixed number of iterations;
//! `GRAECO_FUZZ_SECONDS` goes on for that long, a quarter for each of the four readers, and `GRAECO_FUZZ_SEED` begins
//! elsewhere.
#![allow(
    clippy::unwrap_used,
    clippy::print_stderr,
    clippy::print_stdout,
    clippy::cast_possible_truncation,
    clippy::cast_possible_wrap,
    clippy::cast_precision_loss,
    clippy::float_cmp,
    reason = "helpers of tests: a failure is a panic, numbers are small, and skipped tests say so"
)]

#[path = "../support/corpus.rs"]
mod corpus;
mod extras;
mod frames;
mod loader;
#[path = "../support/moving.rs"]
mod moving;
mod sampler;

use graeco::numeric::mix64;
use std::time::{Duration, Instant};

/// A stream of numbers from one seed.
struct Random(u64);

impl Random {
    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        mix64(self.0)
    }

    fn below(&mut self, n: usize) -> usize {
        (self.next() % n.max(1) as u64) as usize
    }

    /// In [0, 1).
    fn unit(&mut self) -> f64 {
        (self.next() >> 11) as f64 / (1_u64 << 53) as f64
    }

    fn pick<T: Copy>(&mut self, of: &[T]) -> T {
        of[self.below(of.len())]
    }
}

/// Runs `case` `count` times, or for its share of `GRAECO_FUZZ_SECONDS` if that is longer.
fn fuzz(name: &str, count: u64, mut case: impl FnMut(u64, &mut Random)) {
    let number = |key: &str| std::env::var(key).ok().map(|s| s.parse::<u64>().unwrap());
    let limit = number("GRAECO_FUZZ_SECONDS").map(|s| Duration::from_secs(s) / 4);
    let first = number("GRAECO_FUZZ_SEED").unwrap_or(0);
    let start = Instant::now();
    let mut done = 0;
    while done < count || limit.is_some_and(|limit| start.elapsed() < limit) {
        let iteration = first.wrapping_add(done);
        case(iteration, &mut Random(mix64(iteration)));
        done += 1;
    }
    eprintln!("{name}: {done} cases in {:.1} s", start.elapsed().as_secs_f64());
}
