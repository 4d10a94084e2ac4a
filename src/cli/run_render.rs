//! From arguments to pictures on disk.

use super::output_args::finish;
use super::progress::Reporter;
use super::render::RenderArgs;
use super::run_parts::PartWork;
use graeco::output::manifest::{self, FrameLine, FrameStats, Line, Manifest, SequenceLine};
use graeco::output::part::OutputChoice;
use graeco::output::{Destination, FieldFiles, FieldOrder, OutputTarget, Record, file};
use graeco::render::clock::cpu_seconds;
use graeco::render::{Frame, FrameList, Progress, Settings, Shot};
use graeco::{Error, Result};
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Instant;

/// The manifest of a sequence of files, with a line on what this run sets out to make. A single picture has none.
pub(crate) fn begin_manifest(
    destination: &Destination,
    fields: FieldFiles,
    frames: &[i64],
    settings: &Settings,
    record: &Record,
) -> Result<Option<Manifest>> {
    let Destination::Frames(pattern) = destination else { return Ok(None) };
    if !pattern.is_sequence() {
        return Ok(None);
    }
    file::make_folder_of(&pattern.path(0))?;
    let manifest = Manifest::beside(pattern);
    let (width, lines) = settings.size;
    let separate = fields == FieldFiles::Separate && settings.field_order() != FieldOrder::Progressive;
    let size = (width, if separate { lines / 2 } else { lines });
    let name = std::path::Path::new(&pattern.to_string()).file_name().map(|n| n.to_string_lossy().into_owned());
    manifest.append(&Line::Sequence(SequenceLine {
        pattern: name.unwrap_or_default(),
        frames: frames.to_vec(),
        size,
        record: record.clone(),
    }))?;
    Ok(Some(manifest))
}

/// Notes a finished frame in its sequence's manifest.
pub(crate) fn note_frame(
    manifest: &Manifest,
    number: i64,
    written: &[PathBuf],
    record: &Record,
    stats: FrameStats,
) -> Result<()> {
    let name = |p: &PathBuf| p.file_name().map_or(String::new(), |n| n.to_string_lossy().into_owned());
    let settings_hash = record.settings_hash.clone();
    let files = written.iter().map(name).collect();
    manifest.append(&Line::Frame(FrameLine { frame: number, files, settings_hash, stats }))
}

/// Signals that end the work.
#[derive(Debug, Clone, Default)]
pub(crate) struct Signals {
    stopped: Arc<AtomicBool>,
    terminated: Arc<AtomicBool>,
    /// Nothing is begun that could be finished or kept: signals end the program at once.
    idle: Arc<AtomicBool>,
}

impl Signals {
    /// Takes interrupts and requests to end from here on.
    pub(crate) fn listen() -> Self {
        use signal_hook::consts::{SIGHUP, SIGINT, SIGTERM, SIGXFSZ};
        let signals = Self { idle: Arc::new(AtomicBool::new(true)), ..Self::default() };
        // Without the handlers a signal ends the program at once, which loses nothing that is finished either.
        let _ = signal_hook::flag::register(SIGTERM, Arc::clone(&signals.terminated));
        for (signal, code) in [(SIGINT, crate::EXIT_INTERRUPTED), (SIGTERM, crate::EXIT_RETRY), (SIGHUP, 129)] {
            let idle = Arc::clone(&signals.idle);
            let _ = signal_hook::flag::register_conditional_shutdown(signal, i32::from(code), idle);
            let _ = signal_hook::flag::register(signal, Arc::clone(&signals.stopped));
        }
        // A file that outgrows the limit on files is an error like a full disk, not an end without a word.
        let _ = signal_hook::flag::register(SIGXFSZ, Arc::default());
        signals
    }

    /// From here on there is work that a signal must leave in good order.
    pub(crate) fn begin(&self) {
        self.idle.store(false, Ordering::Relaxed);
    }

    /// Whether the work is to end.
    pub(crate) fn is_stopped(&self) -> bool {
        self.stopped.load(Ordering::Relaxed)
    }

    /// Progress that ends with these signals.
    pub(crate) fn progress(&self) -> Progress {
        Progress::stopped_by(Arc::clone(&self.stopped))
    }

    /// What to say of an end that a signal asked for.
    pub(crate) fn ended(&self, frames_kept: usize) -> Error {
        if self.terminated.load(Ordering::Relaxed) { Error::Terminated } else { Error::Interrupted { frames_kept } }
    }
}

/// `graeco render`.
pub(crate) fn run(args: &RenderArgs) -> Result<()> {
    let signals = Signals::listen();
    let destination = args.output.destination()?;
    let before = OutputChoice { pulldown: args.shot.pulldown, ..OutputChoice::default() };
    let choice = args.output.over(&before);
    refuse_slices_of_pictures(args, &destination)?;
    let mut settings = args.shot.settings();
    settings.adaptive = args.adaptive.adaptive(super::output_args::view(&choice));
    if let (Some(adaptive), Destination::Parts(_)) = (&settings.adaptive, &destination) {
        adaptive.check_parts()?;
    }
    args.shot.set_threads()?;
    let started = Instant::now();
    let scene = args.shot.load()?;
    let load_s = started.elapsed().as_secs_f64();
    let environment = args.shot.environment()?;
    let surroundings = args.shot.surroundings(&scene, environment.as_ref());
    let mut shot = Shot::new(&scene, &settings, &surroundings, &finish(&destination, &choice))?;
    let frames = args.frames.clone().unwrap_or_else(|| FrameList::of_animation(shot.span(), settings.rate));
    let reporter = Reporter::new(&args.progress, frames.frames().len(), destination == Destination::Stdout);
    for warning in &scene.warnings {
        reporter.say(&format!("warning: {warning}"));
    }
    signals.begin();
    if let Destination::Parts(pattern) = &destination {
        pattern.validate_for(frames.frames().len())?;
        let work = PartWork { args, pattern, choice: &choice, load_s, reporter, signals };
        return work.render_all(&mut shot, frames.frames());
    }
    let manifest = begin_manifest(&destination, choice.fields, frames.frames(), &settings, shot.record())?;
    let mut target = args.output.target(destination, &choice, settings.size.1, frames.frames().len())?;
    let fields = choice.fields;
    let mut work = Work { args, fields, reporter, signals, load_s, manifest, kept: 0 };
    let result = work.render_all(&mut shot, frames.frames(), &mut target);
    // A stream's frames so far become a whole file whatever happened.
    let finished = target.finish();
    result?;
    for path in finished? {
        work.reporter.say(&format!("{}: finished", path.display()));
    }
    Ok(())
}

/// Parts of frames are files of their own kind: a picture cannot hold them.
fn refuse_slices_of_pictures(args: &RenderArgs, destination: &Destination) -> Result<()> {
    let flag = if args.tile.is_some() { "--tile" } else { "--run-range" };
    if (args.tile.is_some() || args.run_range.is_some()) && !matches!(destination, Destination::Parts(_)) {
        return Err(Error::invalid(
            flag,
            "renders a part of a frame: it needs an output that ends in .part, such as out/shot.####.part, \
             which `graeco merge` joins with the other parts",
        ));
    }
    Ok(())
}

/// One run over a list of frames.
struct Work<'a> {
    args: &'a RenderArgs,
    fields: FieldFiles,
    reporter: Reporter,
    signals: Signals,
    /// Seconds to load the scene, until a frame has accounted for them.
    load_s: f64,
    manifest: Option<Manifest>,
    kept: usize,
}

impl Work<'_> {
    fn render_all(&mut self, shot: &mut Shot<'_>, frames: &[i64], target: &mut OutputTarget) -> Result<()> {
        for (index, &number) in frames.iter().enumerate() {
            if self.args.resume && target.is_finished(number, shot.field_order(), &shot.record().settings_hash) {
                self.reporter.say(&format!("frame {number}: finished before, kept"));
                self.kept += 1;
                continue;
            }
            self.render_one(shot, index, number, target)?;
            self.kept += 1;
            if self.signals.is_stopped() && index + 1 < frames.len() {
                return Err(self.signals.ended(self.kept));
            }
        }
        Ok(())
    }

    fn render_one(&mut self, shot: &mut Shot<'_>, index: usize, number: i64, target: &mut OutputTarget) -> Result<()> {
        let (began, cpu) = (Instant::now(), cpu_seconds());
        let progress = self.signals.progress();
        let pixels = shot.pixels();
        let frame = self.reporter.watch(index, number, pixels, &progress, || shot.render(number, &progress))?;
        let Some(frame) = frame else { return Err(self.signals.ended(self.kept)) };
        let writing = Instant::now();
        let mut written = Vec::new();
        for picture in shot.pictures(number, &frame, self.fields)? {
            written.extend(target.accept(picture)?);
        }
        let stats = FrameStats {
            frame: number,
            load_s: std::mem::take(&mut self.load_s),
            build_s: frame.cost.build_s,
            render_s: frame.cost.render_s,
            write_s: writing.elapsed().as_secs_f64(),
            cpu_s: cpu_seconds() - cpu,
            samples: frame.cost.samples,
            rays: frame.cost.rays,
            peak_memory: peak_memory(),
            rejected: frame.cost.rejected,
            passes: frame.cost.passes,
            standard_error: frame.film.standard_error(),
        };
        let files: Vec<String> = written.iter().map(|p| p.display().to_string()).collect();
        self.report(&files.join(", "), number, &frame, began);
        if let Some(path) = &self.args.stats {
            manifest::append_json(path, &stats)?;
        }
        if let Some(manifest) = &self.manifest {
            note_frame(manifest, number, &written, shot.record(), stats)?;
        }
        Ok(())
    }

    fn report(&self, files: &str, number: i64, frame: &Frame, began: Instant) {
        let name = if files.is_empty() { format!("frame {number}") } else { files.to_owned() };
        let rate = super::progress::rate(frame.cost.samples, began);
        self.reporter.say(&format!("{name}: {:.1} s, {rate} samples/s", began.elapsed().as_secs_f64()));
        if frame.cost.rejected > 0 {
            self.reporter.say(&format!("warning: {} samples were not finite and left out", frame.cost.rejected));
        }
    }
}

/// The most memory that this process has held, bytes.
pub(crate) fn peak_memory() -> u64 {
    use nix::sys::resource::{UsageWho, getrusage};
    // Linux counts kibibytes.
    getrusage(UsageWho::RUSAGE_SELF).map_or(0, |u| u64::try_from(u.max_rss()).unwrap_or(0) * 1024)
}
