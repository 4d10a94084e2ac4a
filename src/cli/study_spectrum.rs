//! `graeco study spectrum`: the (t, y) spectrum of interlaced fields.

use graeco::study::canvas::Canvas;
use graeco::study::interlace::{Grating, SIDE, power_at, spectrum};
use graeco::{Error, Result};
use std::path::PathBuf;

/// Show the (time, height) spectrum of a moving grating in interlaced fields, with the sideband of survey figure 20
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
    /// Picture to write: one square a line height, time across, height up
    #[arg(short, long, value_name = "FILE.png")]
    output: Option<PathBuf>,
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
        Some(path) => canvas.save(path),
        None => Ok(()),
    }
}
