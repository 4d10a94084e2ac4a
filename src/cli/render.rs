//! `graeco render`: its arguments.

use super::shot_args::{OUTPUT, ShotArgs, TIME, VIDEO, number};
use clap::{Args, ValueHint};
use graeco::output::video::{BitDepth, Sampling};
use graeco::output::{FieldFiles, ViewTransform};
use std::path::PathBuf;

/// Arguments of `graeco render`.
#[derive(Debug, Clone, Args)]
#[command(after_help = "Examples:
  graeco render animations/pool.glb -o out/pool.####.exr
  graeco render shot.glb -o shot.png --frames 12 --size 1280x720 --runs 256
  graeco render shot.glb -o out/shot.####.png --shutter 90deg --f-stop 2.8 --focus-on Hero

Exit codes: 0 done, 1 permanent failure, 2 wrong usage, 75 worth retrying, 130 interrupted.")]
pub(crate) struct RenderArgs {
    #[command(flatten)]
    pub(crate) shot: ShotArgs,

    /// Where pictures go: out/shot.####.exr, %04d.png, clip.y4m, clip.mp4, .mov, .mkv, .mpg, .dv, or - for
    /// YUV4MPEG2 to standard output
    #[arg(short, long, value_name = "PATTERN", value_hint = ValueHint::AnyPath, help_heading = OUTPUT)]
    pub(crate) output: PathBuf,

    /// Frames: 7, 1-48, 1-48x2, 1-48:2 or 3,7,9; frame n stands at n / fps seconds [default: first to last key]
    #[arg(long, value_name = "LIST", allow_hyphen_values = true, help_heading = TIME)]
    pub(crate) frames: Option<graeco::render::FrameList>,

    /// Write the two fields woven into one frame, or each for itself at half the height
    #[arg(long, value_name = "woven|separate", default_value = "woven", value_parser = parse_fields, help_heading = VIDEO)]
    pub(crate) fields: FieldFiles,

    /// Chroma of a video stream: 444, 422, 420 or 411 [default: what the container keeps, 422 for .y4m]
    #[arg(long, value_name = "SAMPLING", value_parser = parse_chroma, help_heading = VIDEO)]
    pub(crate) chroma: Option<Sampling>,

    /// Bits of a video stream's samples: 8 or 10
    #[arg(long, value_name = "BITS", value_parser = parse_bits, help_heading = VIDEO)]
    pub(crate) bits: Option<BitDepth>,

    /// Keep luminance detail out of the NTSC colour subcarrier's band, by a horizontal filter on output
    #[arg(long, help_heading = VIDEO)]
    pub(crate) chroma_notch: bool,

    /// Brightens a PNG by this many stops
    #[arg(long, value_name = "EV", default_value_t = 0.0, allow_hyphen_values = true, value_parser = number, help_heading = OUTPUT)]
    pub(crate) exposure: f64,

    /// How a PNG shows scene light: standard (sRGB, clipped), agx, khronos-neutral
    #[arg(long, value_name = "NAME", default_value = "standard", help_heading = OUTPUT)]
    pub(crate) view: ViewTransform,

    /// Bits a channel: 8 or 16 for PNG, half or float for EXR [default: 8, half]
    #[arg(long, value_name = "DEPTH", value_parser = ["8", "16", "half", "float"], help_heading = OUTPUT)]
    pub(crate) depth: Option<String>,

    /// Skip frames that are already finished with these very settings
    #[arg(long, help_heading = OUTPUT)]
    pub(crate) resume: bool,

    /// Append a JSON line a frame: seconds, samples, rays, peak memory
    #[arg(long, value_name = "FILE", value_hint = ValueHint::FilePath, help_heading = OUTPUT)]
    pub(crate) stats: Option<PathBuf>,

    /// Print nothing but errors
    #[arg(short, long, help_heading = OUTPUT)]
    pub(crate) quiet: bool,
}

fn parse_fields(text: &str) -> Result<FieldFiles, String> {
    match text {
        "woven" => Ok(FieldFiles::Woven),
        "separate" => Ok(FieldFiles::Separate),
        _ => Err("expected woven or separate".into()),
    }
}

fn parse_chroma(text: &str) -> Result<Sampling, String> {
    match text.replace(':', "").as_str() {
        "444" => Ok(Sampling::S444),
        "422" => Ok(Sampling::S422),
        "420" => Ok(Sampling::S420),
        "411" => Ok(Sampling::S411),
        _ => Err("expected 444, 422, 420 or 411".into()),
    }
}

fn parse_bits(text: &str) -> Result<BitDepth, String> {
    match text {
        "8" => Ok(BitDepth::Eight),
        "10" => Ok(BitDepth::Ten),
        _ => Err("expected 8 or 10".into()),
    }
}
