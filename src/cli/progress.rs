//! What the user sees while frames render: a bar on a terminal, plain lines elsewhere.

use super::shot_args::OUTPUT;
use graeco::render::Progress;
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use std::io::{IsTerminal, Write};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

/// How often a bar is drawn anew, and how often a plain line is printed within a long frame.
const BAR_EVERY: Duration = Duration::from_millis(200);
const LINE_EVERY: Duration = Duration::from_secs(10);
/// How often a program is told.
const TELL_EVERY: Duration = Duration::from_secs(1);

/// How progress is told.
#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
pub(crate) enum ProgressMode {
    /// `openjd_progress: 42.5` (Open Job Description, Deadline Cloud).
    Openjd,
    /// `ALF_PROGRESS 42%` (Tractor).
    Alf,
    /// `PROGRESS: 42%` (Afanasy).
    Afanasy,
    /// Lines for people.
    Plain,
    /// A JSON object a line.
    Json,
    /// Nothing.
    None,
}

/// Arguments on what is told while the work goes on.
#[derive(Debug, Clone, clap::Args)]
pub(crate) struct ProgressArgs {
    /// How progress is told: openjd, alf, afanasy or json on standard output, plain lines on standard error, or none
    /// [default: a bar on a terminal, else plain]
    #[arg(long, value_name = "FORM", hide_possible_values = true, help_heading = OUTPUT)]
    progress: Option<ProgressMode>,

    /// Print nothing but errors
    #[arg(short, long, help_heading = OUTPUT)]
    quiet: bool,
}

/// Reports on a sequence of frames.
#[derive(Debug)]
pub(crate) struct Reporter {
    quiet: bool,
    mode: Option<ProgressMode>,
    frames: usize,
    started: Instant,
    rendered: usize,
    /// Whether standard output carries pictures, so that progress must go elsewhere.
    pictures_on_stdout: bool,
}

impl Reporter {
    /// For `frames` frames.
    pub(crate) fn new(args: &ProgressArgs, frames: usize, pictures_on_stdout: bool) -> Self {
        // Who asks for a form of progress gets it though all else is quiet.
        let mode = args.progress.or(args.quiet.then_some(ProgressMode::None));
        Self { quiet: args.quiet, mode, frames, started: Instant::now(), rendered: 0, pictures_on_stdout }
    }

    /// Prints a line, unless quiet.
    pub(crate) fn say(&self, line: &str) {
        if !self.quiet {
            eprintln!("{line}");
        }
    }

    /// Tells that the `index`-th frame took no work.
    pub(crate) fn skip(&self, index: usize, frame: i64) {
        self.tell(index, frame, 1.0);
    }

    /// Tells a program that `part` of the `index`-th frame is done.
    #[allow(clippy::cast_precision_loss, reason = "frame counts are small")]
    fn tell(&self, index: usize, frame: i64, part: f64) {
        let done = (index as f64 + part.clamp(0.0, 1.0)) / self.frames.max(1) as f64;
        let Some(line) = self.mode.and_then(|mode| line_of(mode, done, frame)) else { return };
        // A reader that has gone away is no failure of the render.
        let _ = if self.pictures_on_stdout {
            writeln!(std::io::stderr(), "{line}")
        } else {
            let mut out = std::io::stdout().lock();
            writeln!(out, "{line}").and_then(|()| out.flush())
        };
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
        if self.mode == Some(ProgressMode::None) {
            return work();
        }
        let done = AtomicBool::new(false);
        let label = format!("frame {frame} ({} of {})", index + 1, self.frames);
        let remaining = self.remaining(index);
        let this = &*self;
        let result = std::thread::scope(|scope| {
            let watcher = scope.spawn(|| match this.mode {
                Some(ProgressMode::Plain) => print_lines(&label, pixels, progress, &done),
                Some(_) => this.tell_all(index, frame, pixels, progress, &done),
                None if std::io::stderr().is_terminal() => draw_bar(&label, remaining, pixels, progress, &done),
                None => print_lines(&label, pixels, progress, &done),
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

    /// Tells a program how far the frame is until it is done.
    #[allow(clippy::cast_precision_loss, reason = "pixel counts are below 2^53")]
    fn tell_all(&self, index: usize, frame: i64, pixels: u64, progress: &Progress, done: &AtomicBool) {
        let mut last = 0;
        let mut then = Instant::now();
        self.tell(index, frame, 0.0);
        loop {
            let ended = done.load(Ordering::Relaxed);
            let now = progress.pixels();
            if now > last && (ended || then.elapsed() >= TELL_EVERY) {
                (last, then) = (now, Instant::now());
                self.tell(index, frame, now as f64 / pixels.max(1) as f64);
            }
            if ended {
                return;
            }
            std::thread::park_timeout(BAR_EVERY);
        }
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

/// The line that tells a program that `done` of the work, 0 to 1, is done. Whole numbers are rounded down: 100 is the end.
#[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "from 0 to 100")]
fn line_of(mode: ProgressMode, done: f64, frame: i64) -> Option<String> {
    let percent = 100.0 * done;
    let whole = percent as u32;
    match mode {
        ProgressMode::Openjd => Some(format!("openjd_progress: {:.1}", (10.0 * percent).floor() / 10.0)),
        ProgressMode::Alf => Some(format!("ALF_PROGRESS {whole}%")),
        ProgressMode::Afanasy => Some(format!("PROGRESS: {whole}%")),
        ProgressMode::Json => {
            Some(serde_json::json!({"progress": (10.0 * percent).floor() / 1000.0, "frame": frame}).to_string())
        }
        ProgressMode::Plain | ProgressMode::None => None,
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn programs_are_told_in_their_own_words() {
        let line = |mode, done| line_of(mode, done, 7).unwrap();
        assert_eq!(line(ProgressMode::Openjd, 0.425), "openjd_progress: 42.5");
        assert_eq!(line(ProgressMode::Alf, 0.429), "ALF_PROGRESS 42%");
        assert_eq!(line(ProgressMode::Afanasy, 1.0), "PROGRESS: 100%");
        assert_eq!(line(ProgressMode::Json, 0.5), r#"{"frame":7,"progress":0.5}"#);
        assert_eq!(line_of(ProgressMode::None, 0.5, 7), None);
    }
}
