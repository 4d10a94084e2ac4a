//! `graeco render`: its arguments.

use super::output_args::OutputArgs;
use super::progress::ProgressArgs;
use super::shot_args::{OUTPUT, ShotArgs, TIME};
use clap::{Args, ValueHint};
use graeco::render::{RunRange, Tile};
use std::path::PathBuf;

/// Arguments of `graeco render`.
#[derive(Debug, Clone, Args)]
#[command(after_help = "Examples:
  graeco render animations/pool.glb -o out/pool.####.exr
  graeco render shot.glb -o shot.png --frames 12 --size 1280x720 --runs 256
  graeco render shot.glb -o out/shot.####.png --shutter 90deg --f-stop 2.8 --focus-on Hero
  graeco render shot.glb -o parts/shot.####.2.part --frames 1-48 --runs 256 --tile 2/4

Exit codes: 0 done, 1 permanent failure, 2 wrong usage, 75 worth retrying, 130 interrupted.")]
pub(crate) struct RenderArgs {
    #[command(flatten)]
    pub(crate) shot: ShotArgs,

    #[command(flatten)]
    pub(crate) adaptive: super::adaptive_args::AdaptiveArgs,

    #[command(flatten)]
    pub(crate) output: OutputArgs,

    /// Frames: 7, 1-48, 1-48x2, 1-48:2 or 3,7,9; frame n stands at n / fps seconds [default: first to last key]
    #[arg(long, value_name = "LIST", allow_hyphen_values = true, help_heading = TIME)]
    pub(crate) frames: Option<graeco::render::FrameList>,

    /// With an output ending in .part: render the i-th of n sets of whole blocks of every frame, for `graeco merge`
    #[arg(long, value_name = "I/N", help_heading = OUTPUT)]
    pub(crate) tile: Option<Tile>,

    /// With an output ending in .part: render these runs of the design of --runs, counted from 0: 0-63
    #[arg(long, value_name = "A-B", help_heading = OUTPUT)]
    pub(crate) run_range: Option<RunRange>,

    /// Skip frames that are already finished with these very settings
    #[arg(long, help_heading = OUTPUT)]
    pub(crate) resume: bool,

    /// Append a JSON line a frame: seconds, samples, rays, peak memory
    #[arg(long, value_name = "FILE", value_hint = ValueHint::FilePath, help_heading = OUTPUT)]
    pub(crate) stats: Option<PathBuf>,

    #[command(flatten)]
    pub(crate) progress: ProgressArgs,
}
