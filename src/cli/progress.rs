//! What the user sees while frames render: a bar on a terminal, plain lines elsewhere.

use graeco::render::Progress;
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use std::io::IsTerminal;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

/// How often a bar is drawn anew, and how often a plain line is printed within a long frame.
const BAR_EVERY: Duration = Duration::from_millis(200);
const LINE_EVERY: Duration = Duration::from_secs(10);

/// Reports on a sequence of frames.
#[derive(Debug)]
pub(crate) struct Reporter {
    quiet: bool,
    frames: usize,
    started: Instant,
    rendered: usize,
}

impl Reporter {
    /// For `frames` frames.
    pub(crate) fn new(quiet: bool, frames: usize) -> Self {
        Self { quiet, frames, started: Instant::now(), rendered: 0 }
    }

    /// Prints a line, unless quiet.
    pub(crate) fn say(&self, line: &str) {
        if !self.quiet {
            eprintln!("{line}");
        }
    }

    /// Runs `work`, which renders the `index`-th frame (from 0) of `pixels` pixels, showing how far `progress` is.
    pub(crate) fn watch<T>(
        &mut self,
        index: usize,
        frame: i64,
        pixels: u64,
        progress: &Progress,
        work: impl FnOnce() -> T,
    ) -> T {
        if self.quiet {
            return work();
        }
        let done = Arc::new(AtomicBool::new(false));
        let label = format!("frame {frame} ({} of {})", index + 1, self.frames);
        let remaining = self.remaining(index);
        let result = std::thread::scope(|scope| {
            let watcher = scope.spawn({
                let (done, label) = (Arc::clone(&done), label.clone());
                move || {
                    if std::io::stderr().is_terminal() {
                        draw_bar(&label, remaining, pixels, progress, &done);
                    } else {
                        print_lines(&label, pixels, progress, &done);
                    }
                }
            });
            let result = work();
            done.store(true, Ordering::Relaxed);
            watcher.thread().unpark();
            let _ = watcher.join();
            result
        });
        self.rendered += 1;
        result
    }

    /// Estimated time for the frames after this one.
    #[allow(clippy::cast_possible_truncation, reason = "frame counts fit")]
    fn remaining(&self, index: usize) -> Option<Duration> {
        let left = self.frames.saturating_sub(index + 1) as u32;
        let rendered = self.rendered as u32;
        (rendered > 0 && left > 0).then(|| self.started.elapsed() / rendered * left)
    }
}

fn draw_bar(label: &str, remaining: Option<Duration>, pixels: u64, progress: &Progress, done: &AtomicBool) {
    let bar = ProgressBar::with_draw_target(Some(pixels), ProgressDrawTarget::stderr());
    let template = "{prefix} {bar:32} {percent:>3} %  {msg}  {eta} left";
    if let Ok(style) = ProgressStyle::with_template(template) {
        bar.set_style(style.progress_chars("=> "));
    }
    bar.set_prefix(label.to_owned());
    let started = Instant::now();
    while !done.load(Ordering::Relaxed) {
        bar.set_position(progress.pixels());
        let then = remaining.map_or(String::new(), |r| format!("  then {}", clock(r)));
        bar.set_message(format!("{} samples/s{then}", rate(progress.samples(), started)));
        std::thread::park_timeout(BAR_EVERY);
    }
    bar.finish_and_clear();
}

fn print_lines(label: &str, pixels: u64, progress: &Progress, done: &AtomicBool) {
    let started = Instant::now();
    let mut last = started;
    while !done.load(Ordering::Relaxed) {
        std::thread::park_timeout(BAR_EVERY);
        if last.elapsed() >= LINE_EVERY && !done.load(Ordering::Relaxed) {
            last = Instant::now();
            let percent = 100 * progress.pixels() / pixels.max(1);
            eprintln!("{label}: {percent} %, {} samples/s", rate(progress.samples(), started));
        }
    }
}

/// Samples a second, with a prefix a person can read.
#[allow(clippy::cast_precision_loss, reason = "shown to three digits")]
pub(crate) fn rate(samples: u64, started: Instant) -> String {
    let per_second = samples as f64 / started.elapsed().as_secs_f64().max(1e-9);
    match per_second {
        r if r >= 1e6 => format!("{:.2} M", r / 1e6),
        r if r >= 1e3 => format!("{:.0} k", r / 1e3),
        r => format!("{r:.0}"),
    }
}

/// `1:02:03` or `4:05`.
fn clock(duration: Duration) -> String {
    let s = duration.as_secs();
    if s >= 3600 {
        format!("{}:{:02}:{:02}", s / 3600, s / 60 % 60, s % 60)
    } else {
        format!("{}:{:02}", s / 60, s % 60)
    }
}
