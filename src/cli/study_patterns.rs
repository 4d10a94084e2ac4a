//! `graeco study patterns`, and the patterns' part of `graeco study spectrum`: designs as dots and as power spectra.

use graeco::design::{Design, DesignOptions, Dither, Factor, Kind, Mask};
use graeco::study::canvas::Canvas;
use graeco::study::patterns::{HIGHEST, Projection, SIDE, radial};
use graeco::study::plots;
use graeco::{Error, Result};
use std::fmt::Write as _;
use std::path::{Path, PathBuf};

/// Draw the two-dimensional projections and power spectra of each design as a page
#[derive(Debug, clap::Args)]
pub(crate) struct StudyPatternsArgs {
    #[command(flatten)]
    patterns: PatternArgs,
    /// Runs a pixel
    #[arg(long, default_value_t = 64, value_parser = clap::value_parser!(u32).range(1..=4096))]
    runs: u32,
    /// Folder for the page, the pictures and the radial averages
    #[arg(short, long, default_value = "study/patterns")]
    output: PathBuf,
}

/// Which patterns, and how closely they are looked at.
#[derive(Debug, Clone, clap::Args)]
pub(crate) struct PatternArgs {
    /// Designs, by name, separated by commas
    #[arg(
        long,
        value_delimiter = ',',
        default_value = "random,jittered,poisson-disk,point-diffusion,latin-hypercube,latin-square,\
        orthogonal,orthogonal-correlated,orthogonal-3,sobol,nested,strong"
    )]
    designs: Vec<Kind>,
    /// Pixels along each film axis of a window
    #[arg(long, default_value_t = 1, value_parser = clap::value_parser!(u32).range(1..=64))]
    pixels: u32,
    /// Windows averaged for a spectrum
    #[arg(long, default_value_t = 100, value_parser = clap::value_parser!(u32).range(1..=10_000))]
    windows: u32,
    /// Structure between pixels
    #[arg(long, default_value = "none")]
    dither: Dither,
}

/// The projections of a sheet: film, film and time, lens, lens and light.
const PAIRS: [(&str, Factor, Factor); 5] = [
    ("x-y", Factor::FILM_X, Factor::FILM_Y),
    ("x-t", Factor::FILM_X, Factor::SHUTTER),
    ("t-y", Factor::SHUTTER, Factor::FILM_Y),
    ("lens u-v", Factor::LENS_U, Factor::LENS_V),
    ("lens u-light v", Factor::LENS_U, Factor::light_v(0)),
];

const HEAD: &str = "<!doctype html><meta charset=utf-8><title>Sampling patterns</title><style>body{font:15px \
    system-ui,sans-serif;max-width:1360px;margin:2em auto;padding:0 1em}img{width:100%;image-rendering:pixelated}\
    th{width:20%}table{width:100%}.plots{display:grid;grid-template-columns:repeat(auto-fill,minmax(560px,1fr));gap:8px}.plots svg{width:100%;height:auto}\
    </style><h1>Sampling patterns</h1>";

pub(crate) fn run(args: &StudyPatternsArgs) -> Result<()> {
    page(&args.patterns, args.runs, &args.output, "")?;
    println!("The page is {}", args.output.join("index.html").display());
    Ok(())
}

/// Draws dots above spectra, one picture a design, the radial averages as plots and CSV, and a page that shows all and
/// ends with `more`.
pub(crate) fn page(args: &PatternArgs, runs: u32, folder: &Path, more: &str) -> Result<()> {
    std::fs::create_dir_all(folder).map_err(|e| Error::io(folder, "create", e))?;
    let mut sheets = String::new();
    let mut csv = String::from("design,projection,frequency,power\n");
    let mut curves: [Vec<(Kind, Vec<f64>)>; PAIRS.len()] = Default::default();
    for &kind in &args.designs {
        let runs = runs_of(kind, runs);
        let options = DesignOptions { kind, dither: args.dither, runs, seed: 1, ..Default::default() };
        let design = Design::new(&options, &graeco::trace::analytic::FACTORS);
        if design.kind() != kind && kind != Kind::Auto && args.dither.mask != Mask::ZOrder {
            println!("{kind}: left out, {}", design.reason());
            continue;
        }
        let averages = sheet(args, &design, &folder.join(format!("{kind}.png")))?;
        for (((name, ..), average), curve) in PAIRS.iter().zip(averages).zip(&mut curves) {
            for (frequency, power) in average.iter().enumerate() {
                let _ = writeln!(csv, "{kind},{name},{},{power:.5}", frequency + 1);
            }
            curve.push((kind, average));
        }
        let heads: Vec<String> = PAIRS.iter().map(|(name, ..)| format!("<th>{name}")).collect();
        let runs = design.runs();
        let _ = write!(
            sheets,
            "<h2>{kind}, {runs} runs a pixel</h2><table><tr>{}</table><img src={kind}.png alt=\"{kind}\">",
            heads.concat()
        );
        println!("{kind}: {}", design.reason());
    }
    let mut text = String::from(HEAD);
    let _ = write!(
        text,
        "<p>Windows of {} pixels along film axes, frequencies to {HIGHEST} cycles a window. Radial averages of the power \
         spectra over {} windows:</p><div class=plots>",
        args.pixels, args.windows
    );
    for ((name, ..), curves) in PAIRS.iter().zip(&curves) {
        let svg = plots::radial(&format!("({})", name.replace('-', ", ")), curves)?;
        save(folder, &format!("radial-{}.svg", name.replace(' ', "-")), &svg)?;
        text.push_str(&svg);
    }
    text.push_str(
        "</div><p>For each design, above: the points of one window. Below: the power spectrum; black is none, dark grey \
         (a quarter of white) that of independent points.</p>",
    );
    save(folder, "index.html", &(text + &sheets + more))?;
    save(folder, "radial.csv", &csv)
}

/// As many runs as were asked for; for arrays of strength 3, which have q³ runs, the cube at or below that.
fn runs_of(kind: Kind, asked: u32) -> u32 {
    if kind != Kind::OrthogonalStrength3 {
        return asked;
    }
    [2_u32, 3, 4, 5, 7, 8, 9, 11, 13, 16].map(|q| q.pow(3)).into_iter().rfind(|&n| n <= asked).unwrap_or(asked)
}

/// One design's dots above spectra; the radial averages of each projection.
fn sheet(args: &PatternArgs, design: &Design, path: &Path) -> Result<Vec<Vec<f64>>> {
    const GAP: usize = 8;
    const ZOOM: usize = 2;
    let cell = SIDE * ZOOM;
    let mut canvas = Canvas::new(PAIRS.len() * (cell + GAP) - GAP, 2 * cell + GAP);
    let mut averages = Vec::new();
    for (column, (_, across, down)) in PAIRS.into_iter().enumerate() {
        let projection = Projection { across, down, pixels: args.pixels };
        let left = column * (cell + GAP);
        canvas.frame([left, 0], cell);
        for [x, y] in projection.points(design, 0) {
            canvas.dot(left as f64 + x * cell as f64, y * cell as f64, 2.0);
        }
        let spectrum = projection.spectrum(design, args.windows);
        let shown: Vec<f64> = spectrum.iter().map(|p| 0.25 * p).collect();
        canvas.paste(&shown, SIDE, [left, cell + GAP], ZOOM);
        averages.push(radial(&spectrum));
    }
    canvas.save(path)?;
    Ok(averages)
}

fn save(folder: &Path, name: &str, text: &str) -> Result<()> {
    let path = folder.join(name);
    std::fs::write(&path, text).map_err(|e| Error::io(&path, "write", e))
}
