//! `graeco study mirror`: a moving mirror, time sampled beside filtered.

use super::shot_args::ShotArgs;
use clap::Args;
use graeco::Result;
use graeco::render::FrameList;
use graeco::scene::rig::Rig;
use graeco::study::mirror::{Effort, study};
use std::path::PathBuf;

/// Make one frame by sampling time and by filtering a frozen picture (Potmesil 1983), and judge both by many frozen ones
#[derive(Debug, Clone, Args)]
pub(crate) struct StudyMirrorArgs {
    #[command(flatten)]
    pub(crate) shot: ShotArgs,

    /// Frame to look at [default: the animation's middle]
    #[arg(long, value_name = "N", allow_hyphen_values = true)]
    pub(crate) frame: Option<i64>,

    /// Frozen pictures that the reference averages
    #[arg(long, value_name = "N", default_value_t = 64, value_parser = clap::value_parser!(u32).range(1..=65536))]
    pub(crate) instants: u32,

    /// Runs a pixel of each of them; the reference is made twice
    #[arg(long, value_name = "N", default_value_t = 16, value_parser = clap::value_parser!(u32).range(1..=65536))]
    pub(crate) instant_runs: u32,

    /// Folder for mirror.png, mirror.csv, mirror.json and mirror.html; without it the table is only printed
    #[arg(short, long, value_name = "FOLDER")]
    pub(crate) output: Option<PathBuf>,
}

/// Measures, prints the table, writes the files. Pictures are 320 by 180 pixels unless `--size` says else.
pub(crate) fn run(args: &StudyMirrorArgs) -> Result<()> {
    let mut shot = args.shot.clone();
    if shot.size.is_none() && shot.video.is_none() {
        shot.size = Some((320, 180));
    }
    shot.set_threads()?;
    let (settings, scene, environment) = (shot.settings(), shot.load()?, shot.environment()?);
    let surroundings = shot.surroundings(&scene, environment.as_ref());
    let frames = FrameList::of_animation(Rig::new(&scene, &settings.playback)?.span(), settings.rate);
    let frame = args.frame.unwrap_or(frames.frames()[frames.frames().len() / 2]);
    let effort = Effort { runs: settings.sampling.runs, instants: args.instants, instant_runs: args.instant_runs };
    let result = study(&scene, &settings, &surroundings, frame, effort, &mut |what| eprintln!("{what}"))?;
    println!(
        "Frame {frame} of {}; reference: {} instants, its own RMSE {:.5}.\n",
        result.scene, args.instants, result.reference_rmse
    );
    print!("{}", result.table());
    args.output.as_ref().map_or(Ok(()), |folder| result.save(folder))
}
