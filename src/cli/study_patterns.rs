//! `graeco study patterns` and `graeco study spectrum`: designs seen as dots and as power spectra.

use graeco::design::{Design, DesignOptions, Dither, Factor, Kind, Mask};
use graeco::study::canvas::Canvas;
use graeco::study::patterns::{HIGHEST, Projection, SIDE, radial};
use graeco::{Error, Result};
use std::fmt::Write as _;
use std::path::PathBuf;

/// Draw the two-dimensional projections and power spectra of each design as a page
#[derive(Debug, clap::Args)]
pub(crate) struct StudyPatternsArgs {
    /// Designs, by name, separated by commas
    #[arg(
        long,
        value_delimiter = ',',
        default_value = "random,jittered,poisson-disk,point-diffusion,latin-hypercube,latin-square,\
        orthogonal,orthogonal-correlated,sobol,nested,strong"
    )]
    designs: Vec<Kind>,
    /// Runs a pixel
    #[arg(long, default_value_t = 64, value_parser = clap::value_parser!(u32).range(1..=4096))]
    runs: u32,
    /// Pixels along each film axis of a window
    #[arg(long, default_value_t = 1, value_parser = clap::value_parser!(u32).range(1..=64))]
    pixels: u32,
    /// Windows averaged for a spectrum
    #[arg(long, default_value_t = 100, value_parser = clap::value_parser!(u32).range(1..=10_000))]
    windows: u32,
    /// Structure between pixels
    #[arg(long, default_value = "none")]
    dither: Dither,
    /// Folder for the page, the pictures and the radial averages
    #[arg(short, long, default_value = "study/patterns")]
    output: PathBuf,
}

/// The projections of a sheet: film, film and time, lens, lens and light.
const PAIRS: [(&str, Factor, Factor); 5] = [
    ("x-y", Factor::FILM_X, Factor::FILM_Y),
    ("x-t", Factor::FILM_X, Factor::SHUTTER),
    ("t-y", Factor::SHUTTER, Factor::FILM_Y),
    ("lens u-v", Factor::LENS_U, Factor::LENS_V),
    ("lens u-light v", Factor::LENS_U, Factor::light_v(0)),
];

/// Draws dots above spectra, one picture a design, a page that shows all, and the radial averages as CSV.
pub(crate) fn run(args: &StudyPatternsArgs) -> Result<()> {
    const GAP: usize = 8;
    const ZOOM: usize = 2;
    let cell = SIDE * ZOOM;
    let folder = &args.output;
    std::fs::create_dir_all(folder).map_err(|source| Error::Io { path: folder.clone(), action: "create", source })?;
    let mut page = String::from(
        "<!doctype html><meta charset=utf-8><title>Sampling patterns</title><style>body{font:15px sans-serif;\
         max-width:1360px;margin:2em auto}img{width:100%;image-rendering:pixelated}th{width:20%}table{width:100%}\
         </style><h1>Sampling patterns</h1>",
    );
    let _ = write!(
        page,
        "<p>{} runs a pixel, windows of {} pixels along film axes. Above: the points of one window. Below: the power \
         spectrum over {} windows, frequencies to {HIGHEST} cycles a window; black is none, mid grey is that of \
         independent points.",
        args.runs, args.pixels, args.windows
    );
    let mut csv = String::from("design,projection,frequency,power\n");
    for &kind in &args.designs {
        let options = DesignOptions { kind, dither: args.dither, runs: args.runs, seed: 1, ..Default::default() };
        let design = Design::new(&options, &graeco::trace::analytic::FACTORS);
        if design.kind() != kind && kind != Kind::Auto && args.dither.mask != Mask::ZOrder {
            println!("{kind}: left out, {}", design.reason());
            continue;
        }
        let mut canvas = Canvas::new(PAIRS.len() * (cell + GAP) - GAP, 2 * cell + GAP);
        for (column, (name, across, down)) in PAIRS.into_iter().enumerate() {
            let projection = Projection { across, down, pixels: args.pixels };
            let left = column * (cell + GAP);
            canvas.frame([left, 0], cell);
            for [x, y] in projection.points(&design, 0) {
                canvas.dot(left as f64 + x * cell as f64, y * cell as f64, 2.0);
            }
            let spectrum = projection.spectrum(&design, args.windows);
            let shown: Vec<f64> = spectrum.iter().map(|p| 0.25 * p).collect();
            canvas.paste(&shown, SIDE, [left, cell + GAP], ZOOM);
            for (frequency, power) in radial(&spectrum).iter().enumerate() {
                let _ = writeln!(csv, "{kind},{name},{},{power:.5}", frequency + 1);
            }
        }
        canvas.save(&folder.join(format!("{kind}.png")))?;
        let heads: Vec<String> = PAIRS.iter().map(|(name, ..)| format!("<th>{name}")).collect();
        let _ = write!(page, "<h2>{kind}</h2><table><tr>{}</table><img src={kind}.png alt=\"{kind}\">", heads.concat());
        println!("{kind}: {}", design.reason());
    }
    for (name, text) in [("index.html", page), ("radial.csv", csv)] {
        let path = folder.join(name);
        std::fs::write(&path, text).map_err(|source| Error::Io { path, action: "write", source })?;
    }
    println!("The page is {}", folder.join("index.html").display());
    Ok(())
}
