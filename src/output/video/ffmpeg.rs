//! Encoding by an installed ffmpeg: our YUV4MPEG2 into its standard input.
//!
//! ffmpeg takes size, rate, field order, pixel aspect and chroma sampling from the stream; the flags here make the
//! encoder keep the fields apart and mark every frame. ffmpeg runs in a process group of its own, so that Ctrl-C at the
//! terminal does not end it: what it was given becomes a whole file.

use super::yuv::{BitDepth, ChromaNotch, Matrix, Sampling, YuvOptions};
use crate::output::{Dither, FieldOrder, Metadata, View, ViewTransform};
use crate::time::Parity;
use crate::{Error, Result};
use std::io::{self, Read, Write};
use std::os::unix::process::CommandExt;
use std::path::{Path, PathBuf};
use std::process::{Child, ChildStdin, Command, Stdio};
use std::thread::JoinHandle;

/// A kind of video file, by the extension that asks for it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Container {
    /// `.mp4`: H.264.
    Mp4,
    /// `.mkv`: H.264.
    Mkv,
    /// `.mov`: ProRes 422 HQ, 10 bits.
    Mov,
    /// `.mpg`: MPEG-2 program stream, of 720 × 480 and 720 × 576 as a DVD has it.
    Mpg,
    /// `.dv`: raw DV.
    Dv,
    /// `.avi`: DV.
    Avi,
}

impl Container {
    /// The container that a file's extension asks for, if any.
    #[must_use]
    pub fn of(path: &Path) -> Option<Self> {
        match path.extension()?.to_string_lossy().to_lowercase().as_str() {
            "mp4" | "m4v" => Some(Self::Mp4),
            "mkv" => Some(Self::Mkv),
            "mov" => Some(Self::Mov),
            "mpg" | "mpeg" | "vob" => Some(Self::Mpg),
            "dv" => Some(Self::Dv),
            "avi" => Some(Self::Avi),
            _ => None,
        }
    }

    /// How pictures of `lines` lines go into it: the sampling and depth that its codec keeps, subsampled by us, so that
    /// nothing is resampled across fields.
    #[must_use]
    pub fn yuv_options(self, view: View, lines: u32) -> YuvOptions {
        let (sampling, depth) = match self {
            Self::Mp4 | Self::Mkv | Self::Mpg => (Sampling::S420, BitDepth::Eight),
            Self::Mov => (Sampling::S422, BitDepth::Ten),
            Self::Dv | Self::Avi => (if lines == 480 { Sampling::S411 } else { Sampling::S420 }, BitDepth::Eight),
        };
        let matrix = Matrix::of_lines(lines);
        YuvOptions { view, matrix, sampling, depth, dither: Dither::On, notch: ChromaNotch::Off }
    }

    /// Refuses what the codec cannot hold.
    ///
    /// # Errors
    /// For DV of any size, rate or field order but its own two.
    pub fn check(self, size: (u32, u32), metadata: &Metadata) -> Result<()> {
        if !matches!(self, Self::Dv | Self::Avi) {
            return Ok(());
        }
        let rate = metadata.rate.parts();
        let fits = matches!((size, rate), ((720, 480), (30_000, 1001)) | ((720, 576), (25, 1)));
        let order = matches!(metadata.order, FieldOrder::Interlaced { first: Parity::Bottom });
        if fits && order {
            return Ok(());
        }
        Err(Error::invalid(
            format!("DV of {}x{} pixels at {} frames a second", size.0, size.1, metadata.rate),
            "DV is 720x480 at 30000/1001 or 720x576 at 25, bottom field first: use --video 480i-dv or 576i-dv",
        ))
    }

    /// ffmpeg's arguments for the encoder and the container.
    fn arguments(self, size: (u32, u32), metadata: &Metadata, view: View) -> Vec<String> {
        let interlaced = match metadata.order {
            FieldOrder::Interlaced { first } => Some(first),
            FieldOrder::Progressive | FieldOrder::Separate { .. } => None,
        };
        let mut arguments: Vec<String> = Vec::new();
        let mut add = |text: &str| arguments.extend(text.split_whitespace().map(str::to_owned));
        match self {
            Self::Mp4 | Self::Mkv => {
                add("-c:v libx264 -preset medium -crf 16 -pix_fmt yuv420p");
                match interlaced {
                    Some(Parity::Top) => add("-flags +ildct+ilme -x264-params tff=1"),
                    Some(Parity::Bottom) => add("-flags +ildct+ilme -x264-params bff=1"),
                    None => {}
                }
                add(if self == Self::Mp4 { "-movflags +faststart -f mp4" } else { "-f matroska" });
            }
            Self::Mov => {
                add("-c:v prores_ks -profile:v hq -vendor apl0 -pix_fmt yuv422p10le");
                if interlaced.is_some() {
                    add("-flags +ildct");
                }
                add("-f mov");
            }
            Self::Mpg => {
                add("-c:v mpeg2video -pix_fmt yuv420p");
                if interlaced.is_some() {
                    add("-flags +ildct+ilme -alternate_scan 1");
                }
                if size.0 == 720 && matches!(size.1, 480 | 576) {
                    let wide = metadata.pixel_aspect.ratio() * 720.0 / f64::from(size.1) > 1.5;
                    add("-b:v 8M -maxrate 9M -bufsize 1835k");
                    add(if wide { "-aspect 16:9 -f dvd" } else { "-aspect 4:3 -f dvd" });
                } else {
                    add("-b:v 40M -maxrate 60M -bufsize 9781k -f vob");
                }
            }
            Self::Dv => add("-c:v dvvideo -f dv"),
            Self::Avi => add("-c:v dvvideo -f avi"),
        }
        if !matches!(self, Self::Dv | Self::Avi) {
            let matrix = match Matrix::of_lines(size.1) {
                Matrix::Bt601 => "smpte170m",
                Matrix::Bt709 => "bt709",
            };
            // ProRes and MPEG-2 have no code for the sRGB curve, nor has broadcast; players take all for BT.1886 there.
            let srgb = view.transform != ViewTransform::Bt709 && matches!(self, Self::Mp4 | Self::Mkv);
            let curve = if srgb { "iec61966-2-1" } else { "bt709" };
            add(&format!("-color_range tv -color_primaries bt709 -color_trc {curve} -colorspace {matrix}"));
        }
        arguments
    }
}

/// ffmpeg at work; writing to it gives it YUV4MPEG2.
///
/// Dropping it finishes the file as [`Encoder::finish`] does, errors unseen.
#[derive(Debug)]
pub struct Encoder {
    child: Child,
    input: Option<ChildStdin>,
    /// Reads what ffmpeg says, so that it never waits for us.
    messages: Option<JoinHandle<String>>,
    part: PathBuf,
    path: PathBuf,
    done: bool,
}

impl Encoder {
    /// Starts `program` (commonly `ffmpeg`) for the file `path`, which appears when it is finished; until then there is
    /// a file `name.part` beside it.
    ///
    /// # Errors
    /// If the codec cannot hold such pictures, or [`Error::Program`] if ffmpeg is not installed.
    pub fn start(
        program: &str,
        container: Container,
        path: &Path,
        size: (u32, u32),
        metadata: &Metadata,
        view: View,
    ) -> Result<Self> {
        container.check(size, metadata)?;
        let name = path.file_name().ok_or_else(|| {
            Error::invalid(format!("output \"{}\"", path.display()), "expected the name of a file, not of a folder")
        })?;
        let mut part_name = name.to_os_string();
        part_name.push(".part");
        let part = path.with_file_name(part_name);
        let mut command = Command::new(program);
        command
            .args(["-hide_banner", "-nostdin", "-loglevel", "error", "-y", "-f", "yuv4mpegpipe", "-i", "pipe:0"])
            .args(container.arguments(size, metadata, view))
            // file: keeps a name with a colon from being taken for a protocol.
            .arg(format!("file:{}", part.display()))
            .stdin(Stdio::piped())
            .stdout(Stdio::null())
            .stderr(Stdio::piped())
            .process_group(0);
        let mut child = command.spawn().map_err(|source| missing(program, &source))?;
        let input = child.stdin.take();
        let messages = child.stderr.take().map(|mut pipe| {
            std::thread::spawn(move || {
                let mut bytes = Vec::new();
                // What cannot be read is not reported; the exit status still is.
                let _ = pipe.read_to_end(&mut bytes);
                String::from_utf8_lossy(&bytes).into_owned()
            })
        });
        Ok(Self { child, input, messages, part, path: path.to_path_buf(), done: false })
    }

    /// The file that it makes.
    #[must_use]
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Ends the input, waits, and gives the file its name. Call it also after an interruption: the frames given so far
    /// are then kept as a whole file.
    ///
    /// # Errors
    /// [`Error::Program`] with ffmpeg's last words if it failed.
    pub fn finish(mut self) -> Result<()> {
        self.end()
    }

    fn end(&mut self) -> Result<()> {
        if self.done {
            return Ok(());
        }
        self.done = true;
        drop(self.input.take());
        let status = self.child.wait().map_err(|source| Error::io("ffmpeg", "wait for", source))?;
        let words = self.messages.take().and_then(|thread| thread.join().ok()).unwrap_or_default();
        if !status.success() {
            let last = words.lines().rev().find(|line| !line.trim().is_empty()).unwrap_or("it gave no reason").trim();
            // What is there of the file may not play, but it is the user's.
            return Err(Error::Program {
                program: "ffmpeg".to_owned(),
                problem: format!(
                    "ended with {status} while encoding {}, of which {} is left: {last}",
                    self.path.display(),
                    self.part.display()
                ),
            });
        }
        std::fs::rename(&self.part, &self.path).map_err(|source| Error::io(&self.path, "rename into place", source))
    }
}

impl Write for Encoder {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.input.as_mut().map_or_else(|| Err(io::ErrorKind::BrokenPipe.into()), |input| input.write(bytes))
    }

    fn flush(&mut self) -> io::Result<()> {
        self.input.as_mut().map_or(Ok(()), Write::flush)
    }
}

impl Drop for Encoder {
    fn drop(&mut self) {
        let _ = self.end();
    }
}

/// Checks that `program` can be started, at the cost of starting it once.
///
/// # Errors
/// [`Error::Program`] that says how to install it.
pub fn find(program: &str) -> Result<()> {
    let mut command = Command::new(program);
    command.arg("-version").stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::null());
    match command.status() {
        Ok(status) if status.success() => Ok(()),
        Ok(status) => Err(Error::Program {
            program: program.to_owned(),
            problem: format!("\"{program} -version\" ended with {status}; expected a working ffmpeg"),
        }),
        Err(source) => Err(missing(program, &source)),
    }
}

fn missing(program: &str, source: &io::Error) -> Error {
    let problem = if source.kind() == io::ErrorKind::NotFound {
        "not found; install it (Debian, Ubuntu: apt install ffmpeg; Fedora: dnf install ffmpeg-free; macOS: brew install \
         ffmpeg), or write a .y4m file, which needs no other program"
            .to_owned()
    } else {
        format!("cannot be started: {source}")
    };
    Error::Program { program: program.to_owned(), problem }
}
