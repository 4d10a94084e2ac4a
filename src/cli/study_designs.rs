//! `graeco study designs`: the variance of every design on the analytic image functions.

use graeco::design::{Dither, Kind};
use graeco::study::designs::{Effort, Placements, Row, row};
use graeco::study::plots;
use graeco::trace::analytic::AnalyticKind;
use graeco::{Error, Result};
use std::fmt::Write as _;
use std::path::PathBuf;

/// Measure the variance of designs relative to independent sampling
#[derive(Debug, clap::Args)]
pub(crate) struct StudyDesignsArgs {
    /// Designs, by name, separated by commas
    #[arg(
        long,
        value_delimiter = ',',
        default_value = "random,jittered,latin-hypercube,latin-square,orthogonal,\
        orthogonal-correlated,orthogonal-3,sobol,nested,strong,auto"
    )]
    pub(crate) designs: Vec<Kind>,
    /// Runs a pixel, separated by commas
    #[arg(long, value_delimiter = ',', default_value = "4,9,12,16,25,48,49,64,100,128,200,256,1024")]
    pub(crate) runs: Vec<u32>,
    /// Placements of each function
    #[arg(long, default_value_t = 128)]
    pub(crate) placements: u32,
    /// Independent draws at each placement
    #[arg(long, default_value_t = 32)]
    pub(crate) randomizations: u32,
    /// Chooses placements and draws
    #[arg(long, default_value_t = 1)]
    pub(crate) seed: u64,
    /// Measure on a frame of this glTF file instead; what `render` takes may follow after `--`
    #[arg(long, value_name = "FILE")]
    pub(crate) scene: Option<PathBuf>,
    /// With --scene: the frame
    #[arg(long, value_name = "N", default_value_t = 0, allow_hyphen_values = true, requires = "scene")]
    pub(crate) frame: i64,
    /// With --scene: pixels measured, spread over the frame (0: all of them)
    #[arg(long, value_name = "N", default_value_t = 1024, requires = "scene")]
    pub(crate) pixels: u32,
    /// With --scene: independent draws of each design in each pixel
    #[arg(long, value_name = "N", default_value_t = 16, requires = "scene", value_parser = clap::value_parser!(u32).range(2..))]
    pub(crate) draws: u32,
    /// With --scene: runs of each pixel's reference; 0 takes the variance between draws for the error
    #[arg(long, value_name = "N", default_value_t = 0, requires = "scene", value_parser = clap::value_parser!(u32).range(..=1 << 24))]
    pub(crate) reference_runs: u32,
    /// Options of `render` for --scene (480x270 pixels unless --size is among them)
    #[arg(last = true, value_name = "OPTIONS", requires = "scene")]
    pub(crate) shot: Vec<String>,
    /// Folder for designs.csv, designs.md and designs.svg; without it the table is only printed
    #[arg(short, long)]
    pub(crate) output: Option<PathBuf>,
}

/// The CSV's header and rows.
fn csv(rows: &[Row]) -> String {
    let mut out = String::from("design,runs,function,vr,standard_error,systematic,worst\n");
    for row in rows {
        for (function, m) in AnalyticKind::ALL.iter().zip(&row.functions) {
            let (kind, runs, function) = (row.kind, row.runs, function.name());
            let _ = writeln!(
                out,
                "{kind},{runs},{function},{:.5},{:.5},{:.5},{:.4}",
                m.ratio, m.standard_error, m.systematic, m.worst
            );
        }
    }
    out
}

fn header() -> String {
    let names: Vec<&str> = AnalyticKind::ALL.iter().map(|k| k.name()).collect();
    format!(
        "| design | runs | log-mean | {} | systematic | worst |\n|-|-|-|{}-|-|",
        names.join(" | "),
        "-|".repeat(names.len())
    )
}

fn line(row: &Row) -> String {
    let ratios: Vec<String> = row.functions.iter().map(|m| format!("{:.3}", m.ratio)).collect();
    let most = |f: fn(&graeco::study::designs::Measured) -> f64| row.functions.iter().map(f).fold(0.0, f64::max);
    format!(
        "| {} | {} | {:.3} | {} | {:.3} | {:.2} |",
        row.kind,
        row.runs,
        row.log_mean(),
        ratios.join(" | "),
        most(|m| m.systematic),
        most(|m| m.worst)
    )
}

/// Measures, prints the table as it grows, writes the files.
pub(crate) fn run(args: &StudyDesignsArgs) -> Result<()> {
    if let Some(scene) = &args.scene {
        return super::study_designs_scene::run(args, scene);
    }
    if args.placements == 0 || args.randomizations < 2 {
        return Err(Error::Invalid {
            what: "--placements, --randomizations".into(),
            problem: "need at least 1 placement and 2 randomizations".into(),
        });
    }
    let effort = Effort { placements: args.placements, randomizations: args.randomizations, seed: args.seed };
    let placements: Vec<Placements> = AnalyticKind::ALL.iter().map(|&kind| Placements::new(kind, effort)).collect();
    println!(
        "Mean squared error relative to independent sampling: {} placements x {} randomizations, seed {}.\n",
        args.placements, args.randomizations, args.seed
    );
    println!("{}", header());
    let mut rows = Vec::new();
    for &runs in &args.runs {
        for &kind in &args.designs {
            // Where the runs do not allow a design another is drawn, which has a row of its own.
            if kind != Kind::Auto && graeco::design::choose(kind, Dither::NONE, runs, 7).kind != kind {
                continue;
            }
            let row = row(kind, runs, &placements, effort);
            println!("{}", line(&row));
            rows.push(row);
        }
    }
    let Some(folder) = &args.output else { return Ok(()) };
    let save = |name: &str, text: &str| {
        let path = folder.join(name);
        std::fs::write(&path, text).map_err(|source| Error::Io { path, action: "write", source })
    };
    std::fs::create_dir_all(folder).map_err(|source| Error::Io { path: folder.clone(), action: "create", source })?;
    save("designs.csv", &csv(&rows))?;
    save("designs.md", &format!("{}\n{}\n", header(), rows.iter().map(line).collect::<Vec<_>>().join("\n")))?;
    save("designs.svg", &plots::ratios(&rows)?)
}
