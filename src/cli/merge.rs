//! `graeco merge`: parts of frames to pictures.

use super::output_args::{OutputArgs, finish};
use super::progress::{ProgressArgs, Reporter};
use super::run_render::{Signals, begin_manifest, note_frame, peak_memory};
use super::shot_args::{OUTPUT, TIME};
use clap::{Args, ValueHint};
use graeco::output::manifest::{self, FrameStats, Manifest};
use graeco::output::part::OutputChoice;
use graeco::output::{Destination, OutputTarget, Pattern, Record};
use graeco::render::clock::cpu_seconds;
use graeco::render::merge::{Merged, Missing};
use graeco::render::{Collection, FrameList, pictures};
use graeco::{Error, Result};
use std::collections::HashSet;
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Instant;

/// Arguments of `graeco merge`.
#[derive(Debug, Clone, Args)]
#[command(after_help = "Examples:
  graeco merge parts/ -o out/shot.####.exr
  graeco merge parts/shot.0007.*.part -o shot.png
  graeco merge @list.txt -o clip.mp4 --frames 1-48

The pictures are, bit for bit, those that one machine renders, in whatever order the parts come and were made.
Output flags that are not given here are those that the parts were rendered with.

Exit codes: 0 done, 1 permanent failure, 2 wrong usage, 75 worth retrying, 130 interrupted.")]
pub(crate) struct MergeArgs {
    /// Part files, folders of them, patterns such as parts/shot.####.*.part (in quotes), or @FILE with one of these a line
    #[arg(required = true, value_name = "PART", value_hint = ValueHint::AnyPath)]
    parts: Vec<PathBuf>,

    #[command(flatten)]
    output: OutputArgs,

    /// Merge these frames, and refuse if one of them lacks anything [default: every frame that has a part]
    #[arg(long, value_name = "LIST", allow_hyphen_values = true, help_heading = TIME)]
    frames: Option<FrameList>,

    /// Merge what is there and say what is not: pixels without runs are black with a coverage of 0
    #[arg(long, help_heading = OUTPUT)]
    partial: bool,

    /// Append a JSON line a frame: seconds, bytes read, peak memory
    #[arg(long, value_name = "FILE", value_hint = ValueHint::FilePath, help_heading = OUTPUT)]
    stats: Option<PathBuf>,

    /// Threads [default: one a processor]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024), help_heading = OUTPUT)]
    threads: Option<u16>,

    #[command(flatten)]
    progress: ProgressArgs,
}

/// A line of `--stats`.
#[derive(serde::Serialize)]
struct MergeStats {
    frame: i64,
    /// Bytes of sums that were read.
    bytes: u64,
    /// Seconds to read and sum them, of the clock and of the processor.
    merge_s: f64,
    merge_cpu_s: f64,
    /// Seconds to encode and write pictures.
    write_s: f64,
    /// Most memory that the process has held, bytes.
    peak_memory: u64,
}

/// `graeco merge`.
pub(crate) fn run(args: &MergeArgs) -> Result<()> {
    let signals = Signals::listen();
    super::shot::set_threads(args.threads)?;
    let destination = args.output.destination()?;
    if matches!(destination, Destination::Parts(_)) {
        return Err(Error::invalid(
            "--output",
            "merged parts are pictures: expected a name ending in .exr or .png, or a video's",
        ));
    }
    let mut paths = Vec::new();
    for argument in &args.parts {
        expand(argument, args.frames.as_ref(), &mut paths)?;
    }
    let missing = if args.partial { Missing::LeftOut } else { Missing::Refused };
    let collection = Collection::gather(paths, missing)?;
    let frames = collection.check(args.frames.as_ref())?;
    let reporter = Reporter::new(&args.progress, frames.len(), destination == Destination::Stdout);
    for note in collection.notes() {
        reporter.say(&format!("warning: {note}"));
    }
    if let Some(wanted) = &args.frames {
        for frame in wanted.frames().iter().filter(|frame| !frames.contains(frame)) {
            reporter.say(&format!("warning: frame {frame} has no parts"));
        }
    }
    let settings = collection.settings();
    let choice = args.output.over(&collection.header().output);
    let finish = finish(&destination, &choice);
    let record = collection.header().record.clone();
    let record = Arc::new(if finish.is_empty() { record } else { record.with("finish", finish) });
    let manifest = begin_manifest(&destination, choice.fields, &frames, settings, &record)?;
    let mut target = args.output.target(destination, &choice, settings.size.1, frames.len())?;
    signals.begin();
    let mut work = Work { args, collection: &collection, choice, record, reporter, signals, manifest };
    let result = work.merge_all(&frames, &mut target);
    let finished = target.finish();
    result?;
    for path in finished? {
        work.reporter.say(&format!("{}: finished", path.display()));
    }
    Ok(())
}

/// The parts that an argument names: itself, those of a folder, of a pattern, or of a list.
fn expand(argument: &Path, frames: Option<&FrameList>, paths: &mut Vec<PathBuf>) -> Result<()> {
    let text = argument.to_string_lossy();
    if let Some(list) = text.strip_prefix('@') {
        let lines = fs::read_to_string(list).map_err(|source| Error::io(list, "read", source))?;
        for line in lines.lines().map(str::trim).filter(|line| !line.is_empty()) {
            if line.starts_with('@') {
                return Err(Error::invalid(format!("@{list}"), "a list cannot name another list"));
            }
            expand(Path::new(line), frames, paths)?;
        }
        return Ok(());
    }
    if argument.is_dir() {
        let is_part = |path: &Path| path.extension().is_some_and(|e| e == "part");
        return list(argument, is_part, paths);
    }
    // What is there under this very name is a file whatever its name looks like.
    let pattern = if argument.exists() { None } else { text.parse::<Pattern>().ok().filter(Pattern::is_sequence) };
    let folder = argument.parent().unwrap_or(Path::new(""));
    let Some(pattern) = pattern else {
        let name = argument.file_name().unwrap_or_default().to_string_lossy();
        let Some((head, tail)) = name.split_once('*').filter(|_| !argument.exists()) else {
            paths.push(argument.to_path_buf());
            return Ok(());
        };
        let fits = |path: &Path| {
            let name = path.file_name().unwrap_or_default().to_string_lossy();
            name.strip_prefix(head).is_some_and(|rest| rest.ends_with(tail))
        };
        let before = paths.len();
        list(folder, fits, paths)?;
        if paths.len() == before {
            return Err(Error::Merge { problem: format!("no file's name fits {}", argument.display()) });
        }
        return Ok(());
    };
    let wanted: Option<HashSet<i64>> = frames.map(|list| list.frames().iter().copied().collect());
    let is_wanted = |path: &Path| {
        pattern.frame_of_any(path).is_some_and(|frame| wanted.as_ref().is_none_or(|w| w.contains(&frame)))
    };
    list(folder, is_wanted, paths)
}

/// Adds the files of `folder` that are `wanted` and not hidden.
fn list(folder: &Path, wanted: impl Fn(&Path) -> bool, paths: &mut Vec<PathBuf>) -> Result<()> {
    let fail = |source| Error::io(folder, "list", source);
    let here = if folder.as_os_str().is_empty() { Path::new(".") } else { folder };
    for entry in fs::read_dir(here).map_err(fail)? {
        let name = entry.map_err(fail)?.file_name();
        let path = folder.join(&name);
        if !name.to_string_lossy().starts_with('.') && wanted(&path) {
            paths.push(path);
        }
    }
    Ok(())
}

/// One run over the frames.
struct Work<'a> {
    args: &'a MergeArgs,
    collection: &'a Collection,
    choice: OutputChoice,
    record: Arc<Record>,
    reporter: Reporter,
    signals: Signals,
    manifest: Option<Manifest>,
}

impl Work<'_> {
    fn merge_all(&mut self, frames: &[i64], target: &mut OutputTarget) -> Result<()> {
        for (index, &number) in frames.iter().enumerate() {
            let (began, cpu) = (Instant::now(), cpu_seconds());
            let progress = self.signals.progress();
            let (collection, pixels) = (self.collection, self.collection.pixels());
            let merge = || collection.merge(number, &progress);
            let merged = self.reporter.watch(index, number, pixels, &progress, merge)?;
            let Some(merged) = merged else { return Err(self.signals.ended(index)) };
            let (merge_s, merge_cpu_s) = (began.elapsed().as_secs_f64(), cpu_seconds() - cpu);
            for note in &merged.notes {
                self.reporter.say(&format!("warning: {note}"));
            }
            self.write(number, &merged, (merge_s, merge_cpu_s), target)?;
            if self.signals.is_stopped() && index + 1 < frames.len() {
                return Err(self.signals.ended(index + 1));
            }
        }
        Ok(())
    }

    fn write(
        &self,
        number: i64,
        merged: &Merged,
        (merge_s, merge_cpu_s): (f64, f64),
        target: &mut OutputTarget,
    ) -> Result<()> {
        let writing = Instant::now();
        // A picture that lacks something must not pass for the finished one.
        let record = match &merged.notes[..] {
            [] => Arc::clone(&self.record),
            notes => Arc::new(self.record.with("missing", notes.join("; "))),
        };
        let mut written = Vec::new();
        for picture in pictures(self.collection.settings(), &record, number, &merged.frame, self.choice.fields)? {
            written.extend(target.accept(picture)?);
        }
        let write_s = writing.elapsed().as_secs_f64();
        let files: Vec<String> = written.iter().map(|p| p.display().to_string()).collect();
        let name = if files.is_empty() { format!("frame {number}") } else { files.join(", ") };
        self.reporter.say(&format!("{name}: merged in {merge_s:.2} s"));
        let bytes = merged.bytes;
        if let Some(path) = &self.args.stats {
            let peak_memory = peak_memory();
            let line = MergeStats { frame: number, bytes, merge_s, merge_cpu_s, write_s, peak_memory };
            manifest::append_json(path, &line)?;
        }
        let Some(manifest) = &self.manifest else { return Ok(()) };
        let cost = &merged.frame.cost;
        let stats = FrameStats {
            frame: number,
            load_s: 0.0,
            build_s: cost.build_s,
            render_s: cost.render_s,
            write_s,
            cpu_s: cost.render_cpu_s,
            samples: cost.samples,
            rays: cost.rays,
            peak_memory: peak_memory(),
            rejected: cost.rejected,
            passes: None,
            standard_error: merged.frame.film.standard_error(),
        };
        note_frame(manifest, number, &written, &record, stats)
    }
}
