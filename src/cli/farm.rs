//! `graeco farm`: jobs for render managers.

use super::Cli;
use super::adaptive_args::AdaptiveArgs;
use super::shot_args::{OUTPUT, ShotArgs, TIME, not_negative, positive};
use super::view_args::ViewArgs;
use clap::{Args, CommandFactory, Subcommand, ValueHint};
use graeco::farm::{Cost, Division, Job, Needs, Slicing, Wish, openjd, slurm};
use graeco::output::{Destination, Pattern, View, file};
use graeco::render::{Forecast, FrameList, Shot};
use graeco::{Error, Result};
use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::Instant;

const TASKS: &str = "Tasks";

/// Write a job for a render manager: frames, or parts of frames, and a merge
#[derive(Debug, Clone, Subcommand)]
pub(crate) enum FarmCommand {
    /// An Open Job Description template, for AWS Deadline Cloud and `openjd run`
    Openjd(Box<FarmArgs>),
    /// A script for Slurm: an array job, and a merge after it
    Slurm(Box<SlurmArgs>),
}

/// How finished frames are written: as `graeco render` has them.
#[derive(Debug, Clone, Args)]
pub(crate) struct FinishArgs {
    #[command(flatten)]
    pub(crate) shown: ViewArgs,

    /// Bits a channel: 8 or 16 for PNG, half or float for EXR [default: 8, half]
    #[arg(long, value_name = "DEPTH", value_parser = ["8", "16", "half", "float"], help_heading = OUTPUT)]
    pub(crate) depth: Option<String>,

    /// Write the two fields woven into one frame, or each for itself at half the height
    #[arg(long, value_name = "woven|separate", default_value = "woven", value_parser = ["woven", "separate"], help_heading = OUTPUT)]
    pub(crate) fields: String,
}

/// What every manager's job needs.
#[derive(Debug, Clone, Args)]
pub(crate) struct FarmArgs {
    #[command(flatten)]
    pub(crate) shot: ShotArgs,

    #[command(flatten)]
    pub(crate) adaptive: AdaptiveArgs,

    #[command(flatten)]
    pub(crate) finish: FinishArgs,

    /// The job file to write
    #[arg(short, long, value_name = "FILE", value_hint = ValueHint::FilePath, help_heading = OUTPUT)]
    pub(crate) output: PathBuf,

    /// Where finished frames go, .exr or .png [default: the scene's name, SCENE.####.exr]
    #[arg(long, value_name = "PATTERN", value_hint = ValueHint::AnyPath, help_heading = OUTPUT)]
    pub(crate) pictures: Option<PathBuf>,

    /// Folder for parts of frames [default: parts, beside the frames]
    #[arg(long, value_name = "DIR", value_hint = ValueHint::DirPath, help_heading = OUTPUT)]
    pub(crate) parts_in: Option<PathBuf>,

    /// Frames: 7, 1-48, 1-48:2 or 3,7,9 [default: first to last key]
    #[arg(long, value_name = "LIST", allow_hyphen_values = true, help_heading = TIME)]
    pub(crate) frames: Option<FrameList>,

    /// How long a task should take, on machines like this one
    #[arg(long, value_name = "MINUTES", default_value_t = 10.0, value_parser = positive, help_heading = TASKS)]
    pub(crate) task_minutes: f64,

    /// What a frame that takes longer is cut into: tiles of the picture, or ranges of its runs
    #[arg(long, value_name = "tiles|runs", default_value = "tiles", value_parser = parse_slicing, help_heading = TASKS)]
    pub(crate) split: Slicing,

    /// Parts of a frame [default: as many as --task-minutes needs]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..), help_heading = TASKS)]
    pub(crate) parts: Option<u32>,

    /// Frames of a task [default: as many as --task-minutes holds]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..), help_heading = TASKS)]
    pub(crate) frames_per_task: Option<u32>,

    /// Memory of a task [default: what this machine needed, and a third more]
    #[arg(long, value_name = "MIB", value_parser = clap::value_parser!(u32).range(1..), help_heading = TASKS)]
    pub(crate) memory: Option<u32>,

    /// Seconds to spend on estimating how long a frame takes
    #[arg(long, value_name = "SECONDS", default_value_t = 4.0, value_parser = not_negative, help_heading = TASKS)]
    pub(crate) measure: f64,
}

/// What Slurm's job needs besides.
#[derive(Debug, Clone, Args)]
pub(crate) struct SlurmArgs {
    #[command(flatten)]
    pub(crate) farm: FarmArgs,

    /// Tasks that may run at once
    #[arg(long, value_name = "N", default_value_t = 256, value_parser = clap::value_parser!(u32).range(1..), help_heading = TASKS)]
    pub(crate) throttle: u32,

    /// Most tasks of one array job: less than the cluster's MaxArraySize
    #[arg(long, value_name = "N", default_value_t = 1000, value_parser = clap::value_parser!(u32).range(1..), help_heading = TASKS)]
    pub(crate) array_size: u32,

    /// A further option of sbatch, such as --sbatch=--partition=long; may be repeated
    #[arg(long, value_name = "OPTION", allow_hyphen_values = true, help_heading = TASKS)]
    pub(crate) sbatch: Vec<String>,

    /// Hand the job over to Slurm
    #[arg(long, help_heading = OUTPUT)]
    pub(crate) submit: bool,
}

fn parse_slicing(text: &str) -> std::result::Result<Slicing, String> {
    match text {
        "tiles" => Ok(Slicing::Tiles),
        "runs" => Ok(Slicing::Runs),
        _ => Err("expected tiles or runs".into()),
    }
}

/// Writes the job; gives the text to print.
pub(crate) fn run(command: &FarmCommand) -> Result<String> {
    match command {
        FarmCommand::Openjd(args) => openjd(args),
        FarmCommand::Slurm(args) => slurm(args),
    }
}

fn openjd(args: &FarmArgs) -> Result<String> {
    let (job, report) = args.job()?;
    let folder = args.output.parent().unwrap_or(Path::new(""));
    let template = openjd::template(&job, folder)?;
    file::write_whole(&args.output, template.text.as_bytes())?;
    let last = if job.division.parts > 1 { "Merge" } else { "Check" };
    let needed: String = template.needed.iter().map(|(name, path)| format!(" -p {name}={path}")).collect();
    let file = args.output.display();
    Ok(format!("{report}\nTo run it here: openjd run {file} --step {last} --run-dependencies{needed}"))
}

fn slurm(args: &SlurmArgs) -> Result<String> {
    if args.submit {
        // Before anything that takes time.
        let missing = |problem: String| Error::Program {
            program: "sbatch".into(),
            problem: format!("{problem}; leave --submit out, and run the script where Slurm's commands are installed"),
        };
        let found =
            Command::new("sbatch").arg("--version").output().map_err(|e| missing(format!("cannot be run: {e}")))?;
        if !found.status.success() {
            return Err(missing(last_line(&found.stderr)));
        }
    }
    let (job, report) = args.farm.job()?;
    let array = args.array_size as usize;
    let options = slurm::Options { throttle: args.throttle, array, sbatch: args.sbatch.clone() };
    let path = &args.farm.output;
    file::write_whole(path, slurm::script(&job, &options)?.as_bytes())?;
    if !args.submit {
        return Ok(format!("{report}\nTo submit it: bash {}", path.display()));
    }
    let failed = |problem: String| Error::Program { program: format!("bash {}", path.display()), problem };
    let done = Command::new("bash").arg(path).output().map_err(|e| failed(format!("cannot be run: {e}")))?;
    if !done.status.success() {
        return Err(failed(format!("the job was not taken: {}", last_line(&done.stderr))));
    }
    Ok(format!("{report}\n{}", String::from_utf8_lossy(&done.stdout).trim_end()))
}

/// What a program said last.
fn last_line(said: &[u8]) -> String {
    String::from_utf8_lossy(said).trim().lines().next_back().unwrap_or("it does not say why").to_owned()
}

/// What was found out about the shot.
struct Probe {
    frames: Vec<i64>,
    cost: Cost,
    /// Most memory held, bytes.
    memory: u64,
    pixels: u64,
    planes: u64,
}

impl FarmArgs {
    /// The job, and sentences about it.
    fn job(&self) -> Result<(Job, String)> {
        let pictures = self.pattern()?;
        let stays_whole = self.check_split()?;
        let probe = self.probe()?;
        pictures.validate_for(probe.frames.len())?;
        let wish = Wish {
            task_s: self.task_minutes * 60.0,
            slicing: self.split,
            parts: if stays_whole { Some(1) } else { self.parts },
            frames_per_task: self.frames_per_task.map(|n| n as usize),
            most_parts: match self.split {
                Slicing::Tiles => MOST_TILES,
                Slicing::Runs => self.shot.runs,
            },
        };
        let division = Division::new(probe.cost, probe.frames.len(), &wish)?;
        let needs = Needs { threads: self.threads(), memory_mib: self.memory_mib(&probe) };
        let copies = if self.split == Slicing::Runs { f64::from(division.parts) } else { 1.0 };
        #[allow(clippy::cast_precision_loss, reason = "an estimate")]
        let merge_s = 0.1 + copies * (probe.pixels * (PART_PIXEL + 8 * probe.planes)) as f64 / MERGE_RATE;
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "clamped to a count of frames")]
        let merged_per_task = (wish.task_s / merge_s).clamp(1.0, probe.frames.len() as f64) as usize;
        let folder = pictures.path(0).parent().map_or_else(PathBuf::new, Path::to_path_buf);
        let job = Job {
            name: self.shot.scene.file_stem().map_or_else(String::new, |s| s.to_string_lossy().into_owned()),
            scene: self.shot.scene.clone(),
            environment: self.shot.environment.clone(),
            settings: settings_given(),
            runs: self.shot.runs,
            division,
            merged_per_task,
            parts: self.parts_in.clone().unwrap_or_else(|| folder.join("parts")),
            pictures,
            needs,
            frames: probe.frames.clone(),
        };
        let report = self.report(&job, &probe);
        Ok((job, report))
    }

    /// Whether frames must stay whole, since only all of a picture tells when to stop.
    fn check_split(&self) -> Result<bool> {
        let Some(adaptive) = self.adaptive.adaptive(View::default()) else { return Ok(false) };
        if self.split == Slicing::Runs {
            return Err(Error::invalid(
                "--split runs",
                "pixels that stop by themselves have no runs to be shared out; expected --split tiles",
            ));
        }
        if self.parts.is_some_and(|parts| parts > 1) {
            adaptive.check_parts()?;
        }
        Ok(!adaptive.is_by_block())
    }

    /// Whether sampling ends when it is accurate enough, or its time is up.
    fn stops_by_itself(&self) -> bool {
        self.adaptive.adaptive(View::default()).is_some()
    }

    fn pattern(&self) -> Result<Pattern> {
        let text = match &self.pictures {
            Some(path) => path.display().to_string(),
            None => {
                let stem = self.shot.scene.file_stem().map_or_else(String::new, |s| s.to_string_lossy().into_owned());
                format!("{stem}.####.exr")
            }
        };
        match Destination::parse(&text)? {
            Destination::Frames(pattern) => Ok(pattern),
            _ => Err(Error::invalid(
                format!("--pictures {text}"),
                "machines that render parts of a shot write frames; expected a pattern such as out/shot.####.exr",
            )),
        }
    }

    fn threads(&self) -> u16 {
        let here = std::thread::available_parallelism().map_or(1, usize::from);
        self.shot.threads.unwrap_or_else(|| u16::try_from(here).unwrap_or(1024))
    }

    /// Loads the scene and renders small parts of a few frames.
    fn probe(&self) -> Result<Probe> {
        /// More do not sharpen the mean of what changes smoothly.
        const LOOKED_AT: usize = 5;
        self.shot.set_threads()?;
        let mut settings = self.shot.settings();
        settings.adaptive = self.adaptive.adaptive(self.finish.shown.over(View::default()));
        let started = Instant::now();
        let scene = self.shot.load()?;
        let environment = self.shot.environment()?;
        let surroundings = self.shot.surroundings(&scene, environment.as_ref());
        let mut shot = Shot::new(&scene, &settings, &surroundings, "")?;
        let load_s = started.elapsed().as_secs_f64();
        let frames = self.frames.clone().unwrap_or_else(|| FrameList::of_animation(shot.span(), settings.rate));
        let frames = frames.frames().to_vec();
        let looked_at = frames.len().min(LOOKED_AT);
        let (mut build_s, mut render_s) = (0.0, 0.0);
        for i in 0..looked_at {
            // The middles of equal parts.
            let number = frames[(2 * i + 1) * frames.len() / (2 * looked_at)];
            let (_, Forecast { build_s: b, render_s: r, .. }) =
                shot.forecast(number, self.measure / looked_at as f64)?;
            build_s += b / looked_at as f64;
            render_s += r / looked_at as f64;
        }
        let planes = settings.aovs.len() as u64 * 3;
        let cost = Cost { load_s, build_s, render_s };
        Ok(Probe { frames, cost, memory: super::run_render::peak_memory(), pixels: shot.pixels(), planes })
    }

    /// What was held while parts were rendered, what a whole frame takes besides, and a third more.
    fn memory_mib(&self, probe: &Probe) -> u64 {
        let pixel = if self.stops_by_itself() { SETTLED_PIXEL } else { FRAME_PIXEL };
        let frame = probe.pixels * (pixel + 8 * probe.planes);
        self.memory.map_or(LEAST_MIB.max(((probe.memory + frame) * 4 / 3).div_ceil(64 << 20) * 64), u64::from)
    }

    fn report(&self, job: &Job, probe: &Probe) -> String {
        let (division, cost, frames) = (&job.division, &probe.cost, probe.frames.len());
        let what = match (division.parts, division.slicing) {
            (1, _) => format!("{} at a time", division.frames_per_task),
            (n, Slicing::Tiles) => format!("in {n} tiles each"),
            (n, Slicing::Runs) => format!("in {n} ranges of runs each"),
        };
        format!(
            "{}: {frames} frames, {what}: {} tasks of about {:.0} s, with {} processors and {} MiB\n\
             Expected here: {:.2} s to load, and {:.2} s a frame, of which {:.2} s to build",
            self.output.display(),
            division.tasks(frames),
            division.task_s,
            job.needs.threads,
            job.needs.memory_mib,
            cost.load_s,
            cost.build_s + cost.render_s,
            cost.build_s,
        )
    }
}

/// More parts of a frame than these would be small against what every part repeats.
const MOST_TILES: u32 = 1024;
/// Bytes that a pixel takes in memory while a frame is rendered.
const FRAME_PIXEL: u64 = 512;
/// The same where pixels keep their quarters' sums until the last of them stops: 650 by `--stats`, of 1600 x 900 pixels.
const SETTLED_PIXEL: u64 = 768;
/// MiB of memory to ask for at least: what threads and the system's caches for them take is not counted.
const LEAST_MIB: u64 = 256;
/// Bytes that a pixel takes in parts.
const PART_PIXEL: u64 = 96;
/// Bytes of parts a second that a merge gets through.
const MERGE_RATE: f64 = 200e6;

/// The flags that describe the shot and its pictures, as they were given, each one word.
fn settings_given() -> Vec<String> {
    let matches = Cli::command().get_matches_from(std::env::args_os());
    let mut given = &matches;
    while let Some((_, deeper)) = given.subcommand() {
        given = deeper;
    }
    let mut words = Vec::new();
    let described = AdaptiveArgs::augment_args(ShotArgs::augment_args(clap::Command::new("shot")));
    for argument in FinishArgs::augment_args(described).get_arguments() {
        let id = argument.get_id().as_str();
        // Paths and threads have places of their own in a job.
        let Some(long) = argument.get_long().filter(|_| !matches!(id, "environment" | "threads")) else { continue };
        if given.value_source(id) != Some(clap::parser::ValueSource::CommandLine) {
            continue;
        }
        if argument.get_action().takes_values() {
            let raw = given.get_raw(id).into_iter().flatten();
            words.extend(raw.map(|value| format!("--{long}={}", value.to_string_lossy())));
        } else {
            words.push(format!("--{long}"));
        }
    }
    words
}
