//! `graeco study dither`: what of the error stays visible under each structure between pixels, in numbers and pictures.

use graeco::design::{Design, DesignOptions, Dither, Factor, Kind, Mask, Over};
use graeco::study::canvas::Canvas;
use graeco::study::designs::DITHERS;
use graeco::study::dither::{Picture, Trial, blur, visible_error};
use graeco::{Error, Result};
use std::path::{Path, PathBuf};

/// Reproduce the survey's experiment: one run a pixel, moving objects, structure between pixels
#[derive(Debug, clap::Args)]
pub(crate) struct StudyDitherArgs {
    /// Pixels across the picture
    #[arg(long, default_value_t = 64, value_parser = clap::value_parser!(u32).range(32..=1024))]
    side: u32,
    /// Runs a pixel, separated by commas
    #[arg(long, value_delimiter = ',', default_value = "1,4,16")]
    runs: Vec<u32>,
    /// Standard deviation of the blur, pixels
    #[arg(long, default_value_t = 2.0)]
    sigma: f64,
    /// Seeds averaged
    #[arg(long, default_value_t = 4)]
    seeds: u64,
    /// Folder for the pictures; without it only the table is printed
    #[arg(short, long)]
    output: Option<PathBuf>,
}

/// Prints the table, writes the pictures.
pub(crate) fn run(args: &StudyDitherArgs) -> Result<()> {
    if !(0.3..=8.0).contains(&args.sigma) || args.seeds == 0 || args.runs.is_empty() || args.runs.contains(&0) {
        return Err(Error::Invalid {
            what: "--sigma, --seeds, --runs".into(),
            problem: "expected a blur of 0.3 to 8 pixels, and at least one seed and run".into(),
        });
    }
    let side = args.side as usize;
    let time: Vec<Picture> = (0..4).map(|heading| Picture::of_time(side, heading)).collect();
    let all: Vec<Picture> = (0..4).map(|heading| Picture::of_all(side, heading)).collect();
    println!(
        "RMSE x 1000 of four {side} x {side} pictures, {} seeds each: per pixel, and after a blur of {} pixels",
        args.seeds, args.sigma
    );
    println!("(in brackets: relative to random at the same runs).\n");
    println!("| picture | runs | frames | dither | per pixel | blurred |\n|-|-|-|-|-|-|");
    for &runs in &args.runs {
        table(&time, "time alone", Over::Time, runs, 1, args);
        table(&all, "all factors", Over::All, runs, 1, args);
    }
    table(&all, "all factors, still", Over::All, 1, 16, args);
    table(&all, "all factors, still", Over::All, 4, 16, args);
    match &args.output {
        Some(folder) => pictures(folder, args),
        None => Ok(()),
    }
}

/// Rows for one kind of picture: independent draws first, then each structure that governs the pictures' factors.
fn table(pictures: &[Picture], name: &str, over: Over, runs: u32, frames: u32, args: &StudyDitherArgs) {
    let random = Trial { kind: Kind::Random, dither: Dither::NONE, runs, frames };
    let base = visible_error(pictures, random, args.sigma, args.seeds);
    let mut trials = vec![("random".to_owned(), random)];
    for dither in DITHERS {
        if dither.mask == Mask::None || over == Over::All || dither.over == Over::Time {
            trials.push((dither.to_string(), Trial { kind: Kind::Auto, dither, ..random }));
        }
    }
    let auto = Dither { mask: Mask::Auto, over: Over::All };
    trials.push(("auto".to_owned(), Trial { kind: Kind::Auto, dither: auto, ..random }));
    for (label, trial) in trials {
        let [raw, blurred] = visible_error(pictures, trial, args.sigma, args.seeds);
        println!(
            "| {name} | {runs} | {frames} | {label} | {:.1} ({:.2}) | {:.2} ({:.2}) |",
            1e3 * raw,
            raw / base[0],
            1e3 * blurred,
            blurred / base[1]
        );
    }
}

/// One run a pixel: the exact picture and each structure's, above their blurred selves.
fn pictures(folder: &Path, args: &StudyDitherArgs) -> Result<()> {
    const GAP: usize = 4;
    const ZOOM: usize = 3;
    std::fs::create_dir_all(folder).map_err(|source| Error::Io { path: folder.into(), action: "create", source })?;
    let side = args.side as usize;
    let shown = [
        Some(Dither::NONE),
        Some(Dither { mask: Mask::Ordered, over: Over::Time }),
        Some(Dither { mask: Mask::BlueNoise, over: Over::Time }),
        Some(Dither { mask: Mask::R2, over: Over::Time }),
        Some(Dither { mask: Mask::ZOrder, over: Over::All }),
        None,
    ];
    for (name, picture, factors) in [
        ("time.png", Picture::of_time(side, 0), vec![Factor::SHUTTER]),
        ("all.png", Picture::of_all(side, 0), graeco::trace::analytic::FACTORS.to_vec()),
    ] {
        let step = side * ZOOM + GAP;
        let mut canvas = Canvas::new(shown.len() * step - GAP, 2 * step - GAP);
        for (column, dither) in shown.into_iter().enumerate() {
            let values = match dither {
                Some(dither) => {
                    let kind = if dither == Dither::NONE { Kind::Random } else { Kind::Auto };
                    let options = DesignOptions { kind, dither, runs: 1, seed: 1, ..Default::default() };
                    picture.render(&Design::new(&options, &factors), 0)
                }
                None => picture.means().to_vec(),
            };
            canvas.paste(&values, side, [column * step, 0], ZOOM);
            canvas.paste(&blur(&values, side, args.sigma), side, [column * step, step], ZOOM);
        }
        canvas.save(&folder.join(name))?;
    }
    println!(
        "\nPictures, from left to right: random; time by the matrix of eq. 15, by blue noise, by R2; all by z-order; exact."
    );
    println!("Above as drawn with one run a pixel, below blurred: {0}/time.png, {0}/all.png", folder.display());
    Ok(())
}
