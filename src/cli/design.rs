//! `graeco design`: a design's points as a table, or its square as letters.

use graeco::design::array::OrthogonalArray;
use graeco::design::export::{self, Extent, Format};
use graeco::design::{Design, DesignOptions, Dither, Kind};
use graeco::{Error, Result};
use std::fs::File;
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};

/// Write the points of a sampling design, or show it
#[derive(Debug, clap::Args)]
pub(crate) struct DesignArgs {
    /// The design: random, jittered, latin-hypercube, latin-square, orthogonal, orthogonal-correlated, orthogonal-3,
    /// sobol, poisson-disk, point-diffusion, strong, nested, growing or auto
    pub(crate) design: Kind,
    /// Runs a pixel
    #[arg(long, default_value_t = 16, value_parser = clap::value_parser!(u32).range(1..=1 << 24))]
    pub(crate) runs: u32,
    /// How many factors, in the order film x, film y, shutter, lens u v, light u v, lobe u v, light u v, …
    #[arg(long, default_value_t = 7, value_parser = clap::value_parser!(u16).range(1..=4096))]
    pub(crate) factors: u16,
    /// Columns x rows of pixels
    #[arg(long, default_value = "1x1", value_parser = parse_pixels)]
    pub(crate) pixels: [u32; 2],
    /// The first pixel
    #[arg(long, default_value = "0,0", value_parser = parse_origin, allow_hyphen_values = true)]
    pub(crate) origin: [i32; 2],
    /// Frames
    #[arg(long, default_value_t = 1)]
    pub(crate) frames: u32,
    /// Chooses among all equally good designs
    #[arg(long, default_value_t = 0)]
    pub(crate) seed: u64,
    /// Structure between pixels: none, ordered, ordered-8x8, blue-noise, r2, z-order (each with :time or :all) or auto
    #[arg(long, default_value = "none")]
    pub(crate) dither: Dither,
    /// csv or npy
    #[arg(long, default_value = "csv", value_parser = parse_format)]
    pub(crate) format: Format,
    /// The file; without it, standard output
    #[arg(short, long)]
    pub(crate) output: Option<PathBuf>,
    /// Print the square with its Latin and Greek letters and numerals instead of points
    #[arg(long)]
    pub(crate) show: bool,
}

fn parse_pixels(text: &str) -> std::result::Result<[u32; 2], String> {
    let parsed = text.split_once('x').and_then(|(w, h)| Some([w.parse().ok()?, h.parse().ok()?]));
    parsed.filter(|p: &[u32; 2]| p[0] > 0 && p[1] > 0).ok_or_else(|| "expected columns x rows, as 64x64".to_owned())
}

fn parse_origin(text: &str) -> std::result::Result<[i32; 2], String> {
    let parsed = text.split_once(',').and_then(|(x, y)| Some([x.parse().ok()?, y.parse().ok()?]));
    parsed.ok_or_else(|| "expected column,row, as -4,0".to_owned())
}

fn parse_format(text: &str) -> std::result::Result<Format, String> {
    match text {
        "csv" => Ok(Format::Csv),
        "npy" => Ok(Format::Npy),
        _ => Err("expected csv or npy".to_owned()),
    }
}

/// Writes the points, or shows the square.
pub(crate) fn run(args: &DesignArgs) -> Result<()> {
    let options = DesignOptions {
        kind: args.design,
        dither: args.dither,
        runs: args.runs,
        seed: args.seed,
        ..Default::default()
    };
    let design = Design::new(&options, &export::first_factors(args.factors));
    if design.kind() != args.design || args.show {
        eprintln!("{}", design.reason());
    }
    if args.show {
        return show(&design);
    }
    let extent = Extent { pixels: args.pixels, origin: args.origin, frames: args.frames };
    match &args.output {
        Some(path) => {
            let failed = |source| Error::Io { path: path.clone(), action: "write", source };
            let mut out = BufWriter::new(File::create(path).map_err(failed)?);
            export::write(&design, extent, args.format, &mut out).and_then(|()| out.flush()).map_err(failed)
        }
        None => {
            let mut out = BufWriter::new(io::stdout().lock());
            match export::write(&design, extent, args.format, &mut out).and_then(|()| out.flush()) {
                // A reader that has seen enough, such as head, is no failure.
                Err(error) if error.kind() != io::ErrorKind::BrokenPipe => {
                    Err(Error::Io { path: Path::new("standard output").into(), action: "write", source: error })
                }
                _ => Ok(()),
            }
        }
    }
}

/// Labels of a square's third and further columns, as the survey has them (Mitchell 1990, eq. 14).
fn label(column: usize, level: usize) -> String {
    let alphabet: &str = match column {
        0 => "ABCDEFGHIJKLMNOPQRSTUVWXYZ",
        1 => "αβγδεζηθικλμνξοπρστυφχψω",
        2 if level < 9 => return (level + 1).to_string(),
        3 => "abcdefghijklmnopqrstuvwxyz",
        _ => return format!(" {}", level + 1),
    };
    alphabet.chars().nth(level).map_or_else(|| format!(" {}", level + 1), String::from)
}

/// Prints the orthogonal squares of the design's runs over the pixel's cells: no permutation, no refinement.
fn show(design: &Design) -> Result<()> {
    let n = design.runs().isqrt();
    let array = match design.kind() {
        Kind::Orthogonal | Kind::OrthogonalCorrelated => OrthogonalArray::bose(n),
        Kind::LatinSquare => Some(OrthogonalArray::latin_square(n)),
        _ => None,
    };
    let Some(array) = array else {
        return Err(Error::Invalid {
            what: "--show".into(),
            problem: format!(
                "{} with {} runs is no square; expected orthogonal with the square of a prime power up to 32, or \
                 latin-square with any square",
                design.kind(),
                design.runs()
            ),
        });
    };
    let columns = array.columns().min(5);
    for i in 0..n {
        let cells: Vec<String> = (0..n)
            .map(|j| (2..columns).map(|c| label(c - 2, array.level(i * n + j, c).into())).collect::<String>())
            .collect();
        println!("{}", cells.join("  "));
    }
    Ok(())
}
