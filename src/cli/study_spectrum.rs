//! `graeco study spectrum`: the spectra of every sampling pattern, and the (t, y) spectrum of interlaced fields.

use super::study_patterns::{self, PatternArgs};
use graeco::study::canvas::Canvas;
use graeco::study::interlace::{Grating, SIDE, power_at, spectrum};
use graeco::{Error, Result};
use std::path::{Path, PathBuf};

/// Show power spectra and radial averages of every sampling pattern in (x, y), (x, t) and (t, y), as survey figures 10 to
/// 12 do, and the (t, y) spectrum of a moving grating in interlaced fields, with the sideband of figure 20
#[derive(Debug, clap::Args)]
pub(crate) struct StudySpectrumArgs {
    /// Cycles a line of the grating, up to 0.5
    #[arg(long, default_value_t = 0.15625)]
    cycles: f64,
    /// Upwards motion, lines a field
    #[arg(long, default_value_t = 0.6, allow_hyphen_values = true)]
    speed: f64,
    /// Lines of the frame that a pixel averages over, separated by commas
    #[arg(long, value_delimiter = ',', default_value = "1,2")]
    line_height: Vec<f64>,
    /// Exposure as a part of the field's period
    #[arg(long, default_value_t = 0.5)]
    shutter: f64,
    /// Runs a pixel
    #[arg(long, default_value_t = 64, value_parser = clap::value_parser!(u32).range(1..=4096))]
    runs: u32,
    /// Folder for a page with all spectra; or, ending in .png, a picture of the grating's alone: one square a line height,
    /// time across, height up. Without it the grating's power is printed
    #[arg(short, long, value_name = "FOLDER|FILE.png")]
    output: Option<PathBuf>,
    #[command(flatten)]
    patterns: PatternArgs,
}

/// Prints the power in baseband and sideband, draws the spectra.
pub(crate) fn run(args: &StudySpectrumArgs) -> Result<()> {
    if args.line_height.is_empty() {
        return Err(Error::invalid("--line-height", "expected at least one"));
    }
    const ZOOM: usize = 6;
    const GAP: usize = 12;
    let side = SIDE * ZOOM;
    let mut canvas = Canvas::new(args.line_height.len() * (side + GAP) + GAP, side + 2 * GAP);
    println!("grating of {} cycles a line, {} lines a field upwards", args.cycles, args.speed);
    println!("| line height | baseband power | sideband power | flicker at half the field rate |\n|-|-|-|-|");
    for (i, &line_height) in args.line_height.iter().enumerate() {
        let grating = Grating { cycles: args.cycles, speed: args.speed, line_height, shutter: args.shutter };
        let power = spectrum(grating, args.runs, 0)?;
        let (t, y) = (args.cycles * args.speed, args.cycles);
        let (base, sideband) = (power_at(&power, t, y), power_at(&power, t + 0.5, y + 0.5));
        println!("| {line_height} | {base:.3} | {sideband:.3} | {:.4} |", power_at(&power, 0.5, 0.0));
        // Decades below the strongest: four of them span black to white.
        let most = power.iter().copied().fold(f64::MIN_POSITIVE, f64::max);
        let shown: Vec<f64> = power.iter().map(|p| (1.0 + (p / most).max(1e-9).log10() / 4.0).max(0.0)).collect();
        // Rows run from −0.5 cycles at the top; height is drawn upwards.
        let flipped: Vec<f64> = shown.chunks(SIDE).rev().flatten().copied().collect();
        let at = [GAP + i * (side + GAP), GAP];
        canvas.paste(&flipped, SIDE, at, ZOOM);
        canvas.frame(at, side);
    }
    match &args.output {
        Some(path) if is_picture(path) => canvas.save(path),
        Some(folder) => {
            study_patterns::page(&args.patterns, args.runs, folder, GRATING)?;
            canvas.save(&folder.join("interlaced.png"))?;
            println!("The page is {}", folder.join("index.html").display());
            Ok(())
        }
        None => Ok(()),
    }
}

/// What stands below the patterns on their page.
const GRATING: &str = "<h2>A moving grating in interlaced fields</h2><p>Its (time, height) spectrum, a square a line \
    height: time across from -1/2 to 1/2 cycle a field, height up from -1/2 to 1/2 cycle a line. Interlacing repeats the \
    grating half a cycle away in both; lines two high weaken that sideband (figures 20 and 21).</p>\
    <img src=interlaced.png style=\"width:auto\" alt=\"spectra of interlaced fields\">";

fn is_picture(path: &Path) -> bool {
    path.extension().is_some_and(|e| e.eq_ignore_ascii_case("png"))
}
