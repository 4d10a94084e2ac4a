//! Flags for sampling that stops by itself.

use super::shot_args::{SAMPLING, positive};
use clap::Args;
use graeco::output::View;
use graeco::render::{Adaptive, Goal};

/// When to stop sampling.
#[derive(Debug, Clone, Args)]
pub(crate) struct AdaptiveArgs {
    /// Sample each pixel until the half-width of its 95 % interval, as it is seen, is at most this part of what lies
    /// between black and white: 1% or 0.01
    #[arg(long, value_name = "PART", value_parser = parse_part, conflicts_with_all = ["runs", "mean_runs", "within", "until", "passes"], help_heading = SAMPLING)]
    pub(crate) error: Option<f64>,

    /// Take this many samples a pixel on average, where they lower the picture's relative error most
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(16..=1 << 20), conflicts_with_all = ["runs", "within", "until", "passes"], help_heading = SAMPLING)]
    pub(crate) mean_runs: Option<u32>,

    /// Spend this much time on each frame, 10s or 2min, where it lowers the picture's relative error most
    #[arg(long, value_name = "TIME", value_parser = parse_time, conflicts_with_all = ["runs", "until", "passes"], help_heading = SAMPLING)]
    pub(crate) within: Option<f64>,

    /// Sample each frame until its relative error, the root of relMSE, is estimated to be at most this: 0.5% or 0.005
    #[arg(long, value_name = "PART", value_parser = parse_part, conflicts_with_all = ["runs", "passes"], help_heading = SAMPLING)]
    pub(crate) until: Option<f64>,

    /// Sample each frame in so many passes: repeats what --within, --until or --mean-runs came to, as the picture's
    /// attribute graeco.passes and the manifest tell
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=256), conflicts_with = "runs", help_heading = SAMPLING)]
    pub(crate) passes: Option<u32>,

    /// With --error, --mean-runs, --within, --until or --passes: the most samples a pixel, rounded down to a power of two
    #[arg(long, value_name = "N", default_value_t = 4096, value_parser = clap::value_parser!(u32).range(16..=1 << 20), help_heading = SAMPLING)]
    pub(crate) most_runs: u32,
}

impl AdaptiveArgs {
    /// What is asked for, if anything; `view` is how the picture will be shown.
    pub(crate) fn adaptive(&self, view: View) -> Option<Adaptive> {
        let goal = self
            .error
            .map(Goal::Error)
            .or(self.mean_runs.map(Goal::Mean))
            .or(self.within.map(Goal::Within))
            .or(self.until.map(Goal::Until))
            .or(self.passes.map(Goal::Passes))?;
        Some(Adaptive { goal, most_runs: self.most_runs, view })
    }
}

/// `1%`, `0.01`.
fn parse_part(text: &str) -> Result<f64, String> {
    let value = match text.trim().strip_suffix('%') {
        Some(percent) => positive(percent)? / 100.0,
        None => positive(text)?,
    };
    match value {
        ..1.0 => Ok(value),
        _ if text.contains('%') => Err("expected less than 100%".to_owned()),
        _ => Err(format!("expected a part below 1; a percentage is written {text}%")),
    }
}

/// `10s`, `2min`, `1.5h`, `500ms`; without a unit, seconds.
fn parse_time(text: &str) -> Result<f64, String> {
    let text = text.trim();
    let units = [("ms", 1e-3), ("min", 60.0), ("h", 3600.0), ("s", 1.0)];
    let (number, unit) =
        units.iter().find_map(|(name, unit)| Some((text.strip_suffix(name)?, *unit))).unwrap_or((text, 1.0));
    positive(number).map(|n| n * unit).map_err(|_| "expected a time such as 10s, 500ms or 2min".to_owned())
}
