//! From arguments to pictures on disk.

use super::progress::Reporter;
use super::render::RenderArgs;
use graeco::output::manifest::{self, FrameLine, FrameStats, Line, Manifest, SequenceLine};
use graeco::output::video::{ChromaNotch, YuvOptions};
use graeco::output::{
    Cadence, Destination, Dither, ExrDepth, FieldFiles, FieldOrder, FrameFormat, OutputTarget, PngDepth, PngOptions,
    View, file,
};
use graeco::render::clock::cpu_seconds;
use graeco::render::{Frame, FrameList, Progress, Settings, Shot};
use graeco::time::Parity;
use graeco::{Error, Result};
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Instant;

impl RenderArgs {
    /// What of the output changes the pixels of finished frame files.
    fn finish(&self, destination: &Destination) -> String {
        match destination {
            Destination::Frames(pattern) if pattern.extension() == "png" => {
                format!("{} {} {:?} {:?}", self.view, self.exposure, self.depth, self.fields)
            }
            _ => format!("{:?} {:?}", self.depth, self.fields),
        }
    }

    /// The manifest of a sequence of files, with a line on what this run sets out to make. A single picture has none.
    fn begin_manifest(
        &self,
        destination: &Destination,
        frames: &[i64],
        settings: &Settings,
        shot: &Shot<'_>,
    ) -> Result<Option<Manifest>> {
        let Destination::Frames(pattern) = destination else { return Ok(None) };
        if !pattern.is_sequence() {
            return Ok(None);
        }
        file::make_folder_of(&pattern.path(0))?;
        let manifest = Manifest::beside(pattern);
        let (width, lines) = settings.size;
        let separate = self.fields == FieldFiles::Separate && settings.field_order() != FieldOrder::Progressive;
        let size = (width, if separate { lines / 2 } else { lines });
        let name = std::path::Path::new(&pattern.to_string()).file_name().map(|n| n.to_string_lossy().into_owned());
        manifest.append(&Line::Sequence(SequenceLine {
            pattern: name.unwrap_or_default(),
            frames: frames.to_vec(),
            size,
            record: shot.record().as_ref().clone(),
        }))?;
        Ok(Some(manifest))
    }

    fn view(&self) -> View {
        View { transform: self.view, exposure_ev: self.exposure }
    }

    /// Where finished pictures go; nothing is written yet.
    fn target(&self, destination: Destination, settings: &Settings, frames: usize) -> Result<OutputTarget> {
        let cadence = if self.shot.pulldown { Cadence::Pulldown(Parity::Top) } else { Cadence::Native };
        let lines = settings.size.1;
        match destination {
            Destination::Frames(_) if self.chroma_notch || self.chroma.is_some() || self.bits.is_some() => Err(
                Error::invalid("--chroma-notch, --chroma, --bits", "these are for video streams; frame files hold RGB"),
            ),
            Destination::Frames(pattern) => {
                let format = self.frame_format(&pattern.extension())?;
                OutputTarget::frames(pattern, format, self.fields, frames)
            }
            Destination::Stdout => {
                OutputTarget::pipe(Box::new(std::io::stdout()), self.yuv(YuvOptions::for_lines(lines)), cadence)
            }
            Destination::Y4m(path) => OutputTarget::y4m(&path, self.yuv(YuvOptions::for_lines(lines)), cadence),
            Destination::Video(path, container) => {
                let options = self.yuv(container.yuv_options(self.view(), lines));
                OutputTarget::video(&path, container, options, cadence, "ffmpeg")
            }
        }
    }

    fn yuv(&self, fit: YuvOptions) -> YuvOptions {
        YuvOptions {
            view: self.view(),
            sampling: self.chroma.unwrap_or(fit.sampling),
            depth: self.bits.unwrap_or(fit.depth),
            notch: if self.chroma_notch { ChromaNotch::On } else { ChromaNotch::Off },
            ..fit
        }
    }

    fn frame_format(&self, extension: &str) -> Result<FrameFormat> {
        match (extension, self.depth.as_deref()) {
            ("exr", None | Some("half")) => Ok(FrameFormat::Exr(ExrDepth::Half)),
            ("exr", Some("float")) => Ok(FrameFormat::Exr(ExrDepth::Float)),
            ("png", depth @ (None | Some("8" | "16"))) => Ok(FrameFormat::Png(PngOptions {
                depth: if depth == Some("16") { PngDepth::Sixteen } else { PngDepth::Eight },
                view: self.view(),
                dither: Dither::default(),
            })),
            (_, depth) => Err(Error::invalid(
                format!("--depth {}", depth.unwrap_or_default()),
                format!("not a depth of .{extension} files"),
            )),
        }
    }
}

/// Signals that end the work.
#[derive(Debug, Clone, Default)]
struct Signals {
    interrupted: Arc<AtomicBool>,
}

impl Signals {
    fn listen() -> Self {
        let signals = Self::default();
        for signal in [signal_hook::consts::SIGINT, signal_hook::consts::SIGTERM, signal_hook::consts::SIGHUP] {
            // Without the handler an interrupt ends the program at once, which loses nothing either.
            let _ = signal_hook::flag::register(signal, Arc::clone(&signals.interrupted));
        }
        signals
    }
}

/// `graeco render`.
pub(crate) fn run(args: &RenderArgs) -> Result<()> {
    let destination = Destination::parse(&args.output.to_string_lossy())?;
    let settings = args.shot.settings();
    args.shot.set_threads()?;
    let started = Instant::now();
    let scene = args.shot.load()?;
    let load_s = started.elapsed().as_secs_f64();
    let environment = args.shot.environment()?;
    let surroundings = args.shot.surroundings(&scene, environment.as_ref());
    let mut shot = Shot::new(&scene, &settings, &surroundings, &args.finish(&destination))?;
    let frames = args.frames.clone().unwrap_or_else(|| FrameList::of_animation(shot.span(), settings.rate));
    let reporter = Reporter::new(args.quiet, frames.frames().len());
    for warning in &scene.warnings {
        reporter.say(&format!("warning: {warning}"));
    }
    let manifest = args.begin_manifest(&destination, frames.frames(), &settings, &shot)?;
    let mut target = args.target(destination, &settings, frames.frames().len())?;
    let mut work = Work { args, reporter, signals: Signals::listen(), load_s, manifest, kept: 0 };
    let result = work.render_all(&mut shot, frames.frames(), &mut target);
    // A stream's frames so far become a whole file whatever happened.
    let finished = target.finish();
    result?;
    for path in finished? {
        work.reporter.say(&format!("{}: finished", path.display()));
    }
    Ok(())
}

/// One run over a list of frames.
struct Work<'a> {
    args: &'a RenderArgs,
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
            if self.signals.interrupted.load(Ordering::Relaxed) && index + 1 < frames.len() {
                return Err(Error::Interrupted { frames_kept: self.kept });
            }
        }
        Ok(())
    }

    fn render_one(&mut self, shot: &mut Shot<'_>, index: usize, number: i64, target: &mut OutputTarget) -> Result<()> {
        let (began, cpu) = (Instant::now(), cpu_seconds());
        let progress = Progress::stopped_by(Arc::clone(&self.signals.interrupted));
        let pixels = shot.pixels();
        let frame = self.reporter.watch(index, number, pixels, &progress, || shot.render(number, &progress))?;
        let Some(frame) = frame else { return Err(Error::Interrupted { frames_kept: self.kept }) };
        let writing = Instant::now();
        let mut written = Vec::new();
        for picture in shot.pictures(number, &frame, self.args.fields)? {
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
            standard_error: frame.film.standard_error(),
        };
        let files: Vec<String> = written.iter().map(|p| p.display().to_string()).collect();
        self.report(&files.join(", "), number, &frame, began);
        if let Some(path) = &self.args.stats {
            manifest::append_json(path, &stats)?;
        }
        if let Some(manifest) = &self.manifest {
            let name = |p: &PathBuf| p.file_name().map_or(String::new(), |n| n.to_string_lossy().into_owned());
            let settings_hash = shot.record().settings_hash.clone();
            let files = written.iter().map(name).collect();
            manifest.append(&Line::Frame(FrameLine { frame: number, files, settings_hash, stats }))?;
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
pub(super) fn peak_memory() -> u64 {
    use nix::sys::resource::{UsageWho, getrusage};
    // Linux counts kibibytes.
    getrusage(UsageWho::RUSAGE_SELF).map_or(0, |u| u64::try_from(u.max_rss()).unwrap_or(0) * 1024)
}
