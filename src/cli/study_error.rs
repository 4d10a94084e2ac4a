//! `graeco study error`: what `--error` gains, and whether its intervals hold.

use super::shot_args::ShotArgs;
use graeco::Result;
use graeco::output::View;
use graeco::render::{Adaptive, Goal};
use graeco::study::adaptive::{self, Effort, Picture, Study};
use graeco::study::cost::Subject;

/// Compare --error with fixed numbers of runs: time to equal error, and whether 95 % intervals hold the truth
#[derive(Debug, clap::Args)]
pub(crate) struct StudyErrorArgs {
    #[command(flatten)]
    pub(crate) shot: ShotArgs,
    /// Frame to study, 240x135 pixels unless --size says otherwise
    #[arg(long, value_name = "N", default_value_t = 0, allow_hyphen_values = true)]
    pub(crate) frame: i64,
    /// Half-widths to ask for, separated by commas, as parts: 0.04 is 4 %
    #[arg(long, value_name = "LIST", value_delimiter = ',', default_value = "0.04,0.02", value_parser = super::shot_args::positive)]
    pub(crate) errors: Vec<f64>,
    /// Fixed numbers of runs to compare with, ascending
    #[arg(long = "runs", short = 'n', value_name = "LIST", value_delimiter = ',', default_value = "16,64,256",
          value_parser = clap::value_parser!(u32).range(1..=1 << 20))]
    pub(crate) runs_list: Vec<u32>,
    /// Independent seeds
    #[arg(long, default_value_t = 3, value_parser = clap::value_parser!(u32).range(1..=1024))]
    pub(crate) seeds: u32,
    /// Runs a pixel of each half of the reference
    #[arg(long, value_name = "N", default_value_t = 2048, value_parser = clap::value_parser!(u32).range(1..=1 << 22))]
    pub(crate) reference_runs: u32,
    /// The most samples a pixel of the adaptive pictures
    #[arg(long, value_name = "N", default_value_t = 4096, value_parser = clap::value_parser!(u32).range(16..=1 << 20))]
    pub(crate) most_runs: u32,
    /// Print JSON
    #[arg(long)]
    pub(crate) json: bool,
}

/// Measures; gives the text to print.
pub(crate) fn run(args: &StudyErrorArgs) -> Result<String> {
    let mut settings = args.shot.settings();
    if args.shot.size.is_none() && args.shot.video.is_none() {
        settings.size = (240, 135);
        settings.view.size = settings.size;
    }
    settings.aovs.clear();
    let goal = Goal::Error(args.errors.first().copied().unwrap_or(0.01));
    settings.adaptive = Some(Adaptive { goal, most_runs: args.most_runs, view: View::default() });
    args.shot.set_threads()?;
    let environment = args.shot.environment()?;
    let scene = args.shot.load()?;
    let surroundings = args.shot.surroundings(&scene, environment.as_ref());
    let subject = Subject { scene: &scene, settings: &settings, surroundings: &surroundings, frame: args.frame };
    let mut runs = args.runs_list.clone();
    runs.sort_unstable();
    runs.dedup();
    let effort = Effort {
        asked: args.errors.clone(),
        runs,
        seeds: args.seeds,
        reference_runs: args.reference_runs,
        most_runs: args.most_runs,
    };
    let study = adaptive::study(&subject, &effort)?;
    Ok(if args.json { as_json(&effort, &study).to_string() } else { as_text(&study) })
}

fn as_json(effort: &Effort, study: &Study) -> serde_json::Value {
    let gains: Vec<_> = study
        .adaptive
        .iter()
        .map(|p| {
            serde_json::json!({
                "rel_mse": study.gain(p, |e| e.rel_mse),
                "flip": study.gain(p, |e| e.flip),
                "rmse": study.gain(p, |e| e.rmse),
            })
        })
        .collect();
    serde_json::json!({ "effort": effort, "study": study, "gains": gains })
}

fn as_text(study: &Study) -> String {
    let mut lines =
        vec![format!("{:14} {:>8} {:>9} {:>10} {:>10} {:>8}", "", "runs", "seconds", "RMSE", "relMSE", "FLIP")];
    lines.extend(study.fixed.iter().map(|p| row("fixed", p)));
    lines.extend(study.adaptive.iter().map(|p| row(&format!("error {:.2} %", 100.0 * p.asked.unwrap_or(0.0)), p)));
    lines.push(String::new());
    lines.push(format!(
        "{:14} {:>10} {:>9} {:>7}   a fixed number takes at equal relMSE (FLIP)",
        "", "coverage", "constant", "bias"
    ));
    lines.extend(study.adaptive.iter().map(|p| verdict(study, p)));
    lines.join("\n")
}

fn row(name: &str, p: &Picture) -> String {
    let e = &p.errors;
    format!("{name:14} {:>8.1} {:>9.3} {:>10.3e} {:>10.3e} {:>8.4}", p.runs, p.seconds, e.rmse, e.rel_mse, e.flip)
}

fn verdict(study: &Study, p: &Picture) -> String {
    let c = p.coverage.unwrap_or_default();
    #[allow(clippy::cast_precision_loss, reason = "counts of values")]
    let constant = 100.0 * c.constant as f64 / (c.constant + c.varying).max(1) as f64;
    let times = |gain: Option<f64>| gain.map_or("-".to_owned(), |g| format!("{g:.2}"));
    let (equal, seen) = (study.gain(p, |e| e.rel_mse), study.gain(p, |e| e.flip));
    format!(
        "error {:.2} %{:>13.1} % {:>7.1} % {:>7.2}   {} times the seconds ({}), {} the rays, {} the samples",
        100.0 * p.asked.unwrap_or(0.0),
        100.0 * c.share(),
        constant,
        c.bias,
        times(equal.map(|g| g.seconds)),
        times(seen.map(|g| g.seconds)),
        times(equal.map(|g| g.rays)),
        times(equal.map(|g| g.samples)),
    )
}
