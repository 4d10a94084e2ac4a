//! `graeco study motion`: one frame under many shutter angles and phases.

use super::shot_args::{ShotArgs, parse_phase};
use clap::Args;
use graeco::render::FrameList;
use graeco::scene::rig::Rig;
use graeco::study::motion::{Row, check, csv, fastest, measure, page, phase_name};
use graeco::time::ShutterPhase;
use graeco::{Error, Result};
use std::path::PathBuf;

/// Render one frame under many shutters: streak, judder and noise of each, as a table and a page
#[derive(Debug, Clone, Args)]
pub(crate) struct StudyMotionArgs {
    #[command(flatten)]
    pub(crate) shot: ShotArgs,

    /// Frame to look at [default: the animation's middle]
    #[arg(long, value_name = "N", allow_hyphen_values = true)]
    pub(crate) frame: Option<i64>,

    /// Shutter angles in degrees
    #[arg(long, value_name = "LIST", value_delimiter = ',', default_value = "0,45,90,180,270,360")]
    pub(crate) angles: Vec<f64>,

    /// Where the exposure lies: start, centre, end
    #[arg(long, value_name = "LIST", value_delimiter = ',', default_value = "start,centre,end",
          value_parser = parse_phase)]
    pub(crate) phases: Vec<ShutterPhase>,

    /// Folder for motion.csv and motion.html; without it the table is only printed
    #[arg(short, long, value_name = "FOLDER")]
    pub(crate) output: Option<PathBuf>,
}

fn line(r: &Row) -> String {
    format!(
        "| {} | {} | {:.2} | {:.2} | {:.2} | {:.5} | {:.2} % | {} |",
        phase_name(r.phase),
        r.angle,
        r.streak_px,
        r.displacement_px,
        r.gap_px,
        r.noise,
        100.0 * r.relative_noise,
        r.object
    )
}

/// Measures, prints the table as it grows, writes the files. Pictures are 320 by 180 pixels unless `--size` says else.
pub(crate) fn run(args: &StudyMotionArgs) -> Result<()> {
    if let Some(bad) = args.angles.iter().find(|a| !(0.0..=3600.0).contains(*a)) {
        return Err(Error::invalid(format!("--angles {bad}"), "expected degrees from 0 to 3600"));
    }
    let mut shot = args.shot.clone();
    if shot.size.is_none() && shot.video.is_none() {
        shot.size = Some((320, 180));
    }
    shot.set_threads()?;
    let settings = shot.settings();
    check(&settings)?;
    let scene = shot.load()?;
    let environment = shot.environment()?;
    let surroundings = shot.surroundings(&scene, environment.as_ref());
    let span = Rig::new(&scene, &settings.playback)?.span();
    let frames = FrameList::of_animation(span, settings.rate);
    let frame = args.frame.unwrap_or(frames.frames()[frames.frames().len() / 2]);
    println!("Frame {frame} of {}, {} runs a pixel.\n", shot.scene.display(), settings.sampling.runs);
    println!("| phase | angle | streak px | displacement px | gap px | noise | noise / mean | fastest |");
    println!("|-|-|-|-|-|-|-|-|");
    let point = fastest(&scene, &settings, frame)?;
    let mut trials = Vec::new();
    for &phase in &args.phases {
        for &angle in &args.angles {
            let trial = measure(&scene, &settings, &surroundings, frame, point.as_ref(), (angle, phase))?;
            println!("{}", line(&trial.0));
            trials.push(trial);
        }
    }
    let Some(folder) = &args.output else { return Ok(()) };
    std::fs::create_dir_all(folder).map_err(|e| Error::io(folder, "create", e))?;
    let save = |name: &str, text: &str| {
        let path = folder.join(name);
        std::fs::write(&path, text).map_err(|e| Error::io(&path, "write", e))
    };
    let rows: Vec<Row> = trials.iter().map(|t| t.0.clone()).collect();
    let name = shot.scene.file_name().map_or_else(String::new, |n| n.to_string_lossy().into_owned());
    save("motion.csv", &csv(&rows))?;
    save("motion.html", &page(&format!("Motion blur of {name}, frame {frame}"), &trials)?)
}
