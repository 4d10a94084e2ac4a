//! `graeco compare`.

use clap::{Args, ValueHint};
use graeco::output::compare::{self, Comparison, Metric};
use graeco::output::{file, read};
use std::path::PathBuf;

/// Arguments of `graeco compare`.
#[derive(Debug, Clone, Args)]
pub(crate) struct CompareArgs {
    /// Picture to judge (.exr or .png)
    #[arg(value_hint = ValueHint::FilePath)]
    pub(crate) test: PathBuf,

    /// Picture to judge it by
    #[arg(value_hint = ValueHint::FilePath)]
    pub(crate) reference: PathBuf,

    /// Compute FLIP too: the visible difference, from 0 to 1
    #[arg(long)]
    pub(crate) flip: bool,

    /// Write a map of errors: with --flip of its errors from 0 to 1, else of RGB differences up to the largest
    #[arg(short, long, value_name = "MAP.png", value_hint = ValueHint::FilePath)]
    pub(crate) output: Option<PathBuf>,

    /// Print JSON
    #[arg(long)]
    pub(crate) json: bool,
}

/// Compares; gives the text to print.
pub(crate) fn run(args: &CompareArgs) -> graeco::Result<String> {
    let (test, reference) = (read::read(&args.test)?, read::read(&args.reference)?);
    let metric = if args.flip { Metric::Flip } else { Metric::Difference };
    let result = compare::compare(&test, &reference, metric)?;
    if let Some(path) = &args.output {
        let largest = if args.flip { 1.0 } else { result.map.iter().copied().fold(0.0, f64::max) };
        file::write_whole(path, &compare::map_png(&result.map, (test.window.width, test.window.height), largest)?)?;
    }
    Ok(if args.json { serde_json::json!(result).to_string() } else { text(&result) })
}

fn text(result: &Comparison) -> String {
    let (x, y) = result.max_at;
    let mut lines = vec![
        format!("RMSE            {:.6e}", result.rmse),
        format!("relMSE          {:.6e}  (squared error / (reference² + 0.01))", result.rel_mse),
        format!("max difference  {:.6e}  at pixel {x},{y}", result.max_difference),
        format!("pixels differ   {} of {}", result.different_pixels, result.map.len()),
    ];
    if result.not_finite > 0 {
        lines.push(format!("not finite      {} pixels, left out", result.not_finite));
    }
    if let Some(flip) = result.flip {
        lines.push(format!("FLIP (mean)     {flip:.6}"));
    }
    lines.join("\n")
}
