//! `graeco study designs --scene`: the error of every design on a frame of a real scene.

use super::shot_args::ShotArgs;
use super::study_designs::StudyDesignsArgs;
use clap::Parser;
use graeco::design::Kind;
use graeco::render::{Progress, Shot};
use graeco::study::designs_rendered::{Effort, Ratio, Row, study};
use graeco::{Error, Result};
use std::ffi::OsString;
use std::fmt::Write as _;
use std::path::Path;

/// What follows `--`.
#[derive(Debug, Parser)]
#[command(name = "graeco study designs --scene", disable_version_flag = true)]
struct Options {
    #[command(flatten)]
    shot: ShotArgs,
}

const HEADER: &str = "| design | runs | MSE: to random | relMSE | to random | to sobol | to the best | capped: to random | to the best |\n\
                      |-|-|-|-|-|-|-|-|-|";

fn shown(ratio: Ratio) -> String {
    format!("{:.3} ± {:.3}", ratio.value, ratio.half)
}

fn line(row: &Row) -> String {
    let name = if row.kind == Kind::Auto { format!("auto ({})", row.drawn) } else { row.kind.to_string() };
    format!(
        "| {name} | {} | {} | {:.3e} | {} | {} | {} | {} | {} |",
        row.runs,
        shown(row.to_random[0]),
        row.errors[1],
        shown(row.to_random[1]),
        shown(row.to_sobol[1]),
        shown(row.to_best[1]),
        shown(row.to_random[2]),
        shown(row.to_best[2])
    )
}

fn csv(rows: &[Row]) -> String {
    let mut out = String::from(
        "design,drawn,runs,measure,error,to_random,to_random_half,to_sobol,to_sobol_half,to_best,to_best_half\n",
    );
    for r in rows {
        for (k, name) in ["mse", "rel_mse", "rel_mse_capped"].into_iter().enumerate() {
            let [random, sobol, best] = [r.to_random[k], r.to_sobol[k], r.to_best[k]];
            let _ = writeln!(
                out,
                "{},{},{},{name},{:e},{:.5},{:.5},{:.5},{:.5},{:.5},{:.5}",
                r.kind,
                r.drawn,
                r.runs,
                r.errors[k],
                random.value,
                random.half,
                sobol.value,
                sobol.half,
                best.value,
                best.half
            );
        }
    }
    out
}

/// Measures, prints the table, writes the file.
pub(crate) fn run(args: &StudyDesignsArgs, scene: &Path) -> Result<()> {
    let words = [OsString::from("graeco study designs --scene"), scene.as_os_str().to_owned()];
    let options = Options::try_parse_from(words.into_iter().chain(args.shot.iter().map(OsString::from)));
    let shot_args = options.unwrap_or_else(|e| e.exit()).shot;
    let mut settings = shot_args.settings();
    if shot_args.size.is_none() && shot_args.video.is_none() {
        settings.size = (480, 270);
        settings.view.size = settings.size;
    }
    settings.aovs.clear();
    shot_args.set_threads()?;
    let environment = shot_args.environment()?;
    let scene = shot_args.load()?;
    let surroundings = shot_args.surroundings(&scene, environment.as_ref());
    let shot = Shot::new(&scene, &settings, &surroundings, "")?;
    let (width, height) = settings.size;
    let all = width * height;
    let effort = Effort {
        kinds: args.designs.clone(),
        runs: args.runs.clone(),
        pixels: args.pixels,
        draws: args.draws,
        reference_runs: args.reference_runs,
        seed: args.seed,
    };
    let against = match args.reference_runs {
        0 => "squared error taken as the variance between draws, which are unbiased".to_owned(),
        runs => format!("against {runs} runs of sobol, whose own error is subtracted"),
    };
    println!(
        "{}, frame {}: {} of {width}x{height} pixels, {} draws of each design, {against}.\nRatios with 95 % intervals \
         over the pixels; the best is the best of those named; capped: each run's radiance at most 1.\n",
        shot_args.scene.display(),
        args.frame,
        if args.pixels == 0 { all } else { args.pixels.min(all) },
        args.draws,
    );
    println!("{HEADER}");
    let rows =
        study(&shot, settings.size, args.frame, &effort, &Progress::default(), &mut |r| println!("{}", line(r)))?;
    let Some(folder) = &args.output else { return Ok(()) };
    let path = folder.join("rendered.csv");
    std::fs::create_dir_all(folder).map_err(|source| Error::Io { path: folder.clone(), action: "create", source })?;
    std::fs::write(&path, csv(&rows)).map_err(|source| Error::Io { path, action: "write", source })
}
