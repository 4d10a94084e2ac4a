//! `graeco study texture`: texture filters at equal time.

use super::shot_args::ShotArgs;
use clap::Args;
use graeco::Result;
use graeco::render::Settings;
use graeco::scene::Scene;
use graeco::study::cost::{Measurement, Subject};
use graeco::study::texture::{Checker, Effort, checker, study};
use std::path::{Path, PathBuf};

/// Measure texture filters at equal time, on a tilted checker and its reflection or on a scene of yours
#[derive(Debug, Clone, Args)]
pub(crate) struct StudyTextureArgs {
    #[command(flatten)]
    pub(crate) shot: ShotArgs,

    /// Frame to look at
    #[arg(long, value_name = "N", default_value_t = 0, allow_hyphen_values = true)]
    pub(crate) frame: i64,

    /// Runs a pixel to measure at, separated by commas
    #[arg(long = "runs", short = 'n', value_name = "LIST", value_delimiter = ',', default_value = "1,4,16,64",
          value_parser = clap::value_parser!(u32).range(1..=1 << 20))]
    pub(crate) runs_list: Vec<u32>,

    /// Independent seeds
    #[arg(long, default_value_t = 3, value_parser = clap::value_parser!(u32).range(2..=1024))]
    pub(crate) seeds: u32,

    /// Runs a pixel of each half of the reference, which reads textures at full resolution
    #[arg(long, value_name = "N", default_value_t = 1024, value_parser = clap::value_parser!(u32).range(1..=1 << 22))]
    pub(crate) reference_runs: u32,

    /// Folder for a table, a plot and pictures of each scene; without it the tables are only printed
    #[arg(short, long, value_name = "FOLDER")]
    pub(crate) output: Option<PathBuf>,
}

/// The name of the built-in scenes.
const BUILT_IN: &str = "checker";

/// Measures, prints the tables, writes the files. Pictures are 240 by 135 pixels unless `--size` says else.
pub(crate) fn run(args: &StudyTextureArgs) -> Result<()> {
    let mut shot = args.shot.clone();
    if shot.size.is_none() && shot.video.is_none() {
        shot.size = Some((240, 135));
    }
    shot.set_threads()?;
    let settings = Settings { aovs: Vec::new(), ..shot.settings() };
    let environment = shot.environment()?;
    let scenes: Vec<(String, Scene)> = if shot.scene == Path::new(BUILT_IN) {
        vec![("checker".to_owned(), checker(Checker::Tilted)), ("reflection".to_owned(), checker(Checker::Mirrored))]
    } else {
        let name = shot.scene.file_stem().map_or_else(String::new, |n| n.to_string_lossy().into_owned());
        vec![(name, shot.load()?)]
    };
    let effort = Effort { runs: args.runs_list.clone(), seeds: args.seeds, reference_runs: args.reference_runs };
    for (name, scene) in &scenes {
        let surroundings = shot.surroundings(scene, environment.as_ref());
        let subject = Subject { scene, settings: &settings, surroundings: &surroundings, frame: args.frame };
        let mut say = |m: &Measurement| eprintln!("{name}: {}, {} runs, seed {}", m.name, m.runs, m.seed);
        let result = study(name, &subject, &effort, &mut say)?;
        println!("{}", result.table());
        if let Some(folder) = &args.output {
            result.save(folder)?;
        }
    }
    Ok(())
}
