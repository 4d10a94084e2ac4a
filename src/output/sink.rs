//! Where finished pictures go.

use super::file;
use super::pattern::Pattern;
use super::picture::{FieldOrder, Picture};
use super::video::ffmpeg::Encoder;
use super::video::{Container, Pulldown, Y4mWriter, YuvOptions, separate, weave};
use super::{ExrDepth, PngOptions, exr, png, read};
use crate::time::Parity;
use crate::{Error, Result};
use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::{Path, PathBuf};

/// What an output's name asks for.
#[derive(Debug, Clone, PartialEq)]
pub enum Destination {
    /// A file for each frame: `.exr` or `.png`.
    Frames(Pattern),
    /// A part of a frame for each frame: `.part`. See [`super::part`].
    Parts(Pattern),
    /// A YUV4MPEG2 file.
    Y4m(PathBuf),
    /// YUV4MPEG2 on standard output: `-`.
    Stdout,
    /// A video file through ffmpeg.
    Video(PathBuf, Container),
}

impl Destination {
    /// Reads an output's name.
    ///
    /// # Errors
    /// If its extension is none that can be written, or a pattern cannot work.
    pub fn parse(text: &str) -> Result<Self> {
        if text == "-" {
            return Ok(Self::Stdout);
        }
        let path = PathBuf::from(text);
        if let Some(container) = Container::of(&path) {
            return Ok(Self::Video(path, container));
        }
        let pattern: Pattern = text.parse()?;
        match pattern.extension().as_str() {
            "exr" | "png" => Ok(Self::Frames(pattern)),
            "part" => Ok(Self::Parts(pattern)),
            "y4m" => Ok(Self::Y4m(path)),
            _ => Err(Error::invalid(
                format!("output \"{text}\""),
                "expected a name ending in .exr or .png (frames), .part (parts of frames), .y4m, .mp4, .mkv, .mov, .mpg, .dv or .avi (video), \
                 or - (YUV4MPEG2 to standard output)",
            )),
        }
    }

    /// Whether it is one stream of all frames, which must come in order and cannot be resumed.
    #[must_use]
    pub const fn is_stream(&self) -> bool {
        !matches!(self, Self::Frames(_) | Self::Parts(_))
    }
}

/// How a frame's file is written.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum FrameFormat {
    /// OpenEXR.
    Exr(ExrDepth),
    /// PNG.
    Png(PngOptions),
}

/// What becomes of the two fields of an interlaced frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum FieldFiles {
    /// One picture of all lines.
    #[default]
    Woven,
    /// Two pictures of half the height: `name.0001.top.exr` and `name.0001.bottom.exr`.
    Separate,
}

/// Film rate or video rate.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Cadence {
    /// A picture is a frame.
    #[default]
    Native,
    /// 2:3 pulldown, beginning with this field.
    Pulldown(Parity),
}

/// Takes finished pictures and writes them.
///
/// Pictures come in order of frames, the two fields of a frame in order of time. What was accepted stays whatever happens
/// later: frame files are whole, a stream can be finished at any frame.
#[derive(Debug)]
pub enum OutputTarget {
    /// A file a frame.
    Frames(Box<FrameFiles>),
    /// One stream, for a pipe, a file or ffmpeg.
    Stream(Box<Stream>),
}

/// Frame files in a folder.
#[derive(Debug)]
pub struct FrameFiles {
    pattern: Pattern,
    format: FrameFormat,
    fields: FieldFiles,
    earlier: Option<Picture>,
}

/// A stream of frames.
pub struct Stream {
    kind: StreamKind,
    options: YuvOptions,
    earlier: Option<Picture>,
    pulldown: Option<Pulldown>,
}

enum StreamKind {
    Pipe(Y4mWriter<Box<dyn Write + Send>>),
    File {
        writer: Y4mWriter<BufWriter<File>>,
        part: PathBuf,
        path: PathBuf,
    },
    /// ffmpeg starts with the first picture, which tells what to encode.
    Waiting {
        program: String,
        path: PathBuf,
        container: Container,
    },
    Encoder(Y4mWriter<Encoder>),
    Ended,
}

impl std::fmt::Debug for Stream {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Stream").field("options", &self.options).finish_non_exhaustive()
    }
}

impl OutputTarget {
    /// Frame files named by `pattern`. The folder is made if it is missing.
    ///
    /// # Errors
    /// If `frames` frames need a place for the number, the extension is not the format's, or the folder cannot be made.
    pub fn frames(pattern: Pattern, format: FrameFormat, fields: FieldFiles, frames: usize) -> Result<Self> {
        pattern.validate_for(frames)?;
        let wanted = match format {
            FrameFormat::Exr(_) => "exr",
            FrameFormat::Png(_) => "png",
        };
        if pattern.extension() != wanted {
            return Err(Error::invalid(format!("output \"{pattern}\""), format!("expected the extension .{wanted}")));
        }
        file::make_folder_of(&pattern.path(0))?;
        Ok(Self::Frames(Box::new(FrameFiles { pattern, format, fields, earlier: None })))
    }

    /// YUV4MPEG2 into `pipe`, such as standard output.
    ///
    /// # Errors
    /// If YUV4MPEG2 does not have such samples.
    pub fn pipe(pipe: Box<dyn Write + Send>, options: YuvOptions, cadence: Cadence) -> Result<Self> {
        Ok(Self::stream(StreamKind::Pipe(Y4mWriter::new(pipe, "standard output", options)?), options, cadence))
    }

    /// YUV4MPEG2 into the file `path`, which is called `name.part` until it is finished.
    ///
    /// # Errors
    /// If the file cannot be made, or YUV4MPEG2 does not have such samples.
    pub fn y4m(path: &Path, options: YuvOptions, cadence: Cadence) -> Result<Self> {
        file::make_folder_of(path)?;
        let mut part = path.as_os_str().to_os_string();
        part.push(".part");
        let part = PathBuf::from(part);
        let made = File::create(&part).map_err(|source| Error::io(&part, "create", source))?;
        let writer = Y4mWriter::new(BufWriter::new(made), path, options)?;
        Ok(Self::stream(StreamKind::File { writer, part, path: path.to_path_buf() }, options, cadence))
    }

    /// A video file through the program `ffmpeg` found on the path, or another of its kind.
    ///
    /// # Errors
    /// [`Error::Program`] at once if there is no such program, before anything is rendered.
    pub fn video(
        path: &Path,
        container: Container,
        options: YuvOptions,
        cadence: Cadence,
        program: &str,
    ) -> Result<Self> {
        super::video::ffmpeg::find(program)?;
        file::make_folder_of(path)?;
        let kind = StreamKind::Waiting { program: program.to_owned(), path: path.to_path_buf(), container };
        Ok(Self::stream(kind, options, cadence))
    }

    fn stream(kind: StreamKind, options: YuvOptions, cadence: Cadence) -> Self {
        let pulldown = match cadence {
            Cadence::Native => None,
            Cadence::Pulldown(first) => Some(Pulldown::new(first)),
        };
        Self::Stream(Box::new(Stream { kind, options, earlier: None, pulldown }))
    }

    /// Whether frame `frame` stands finished on disk, made with the settings of this hash: a resumed render skips it.
    /// Streams are never finished. `order` is what the render would make.
    #[must_use]
    pub fn is_finished(&self, frame: i64, order: FieldOrder, settings_hash: &str) -> bool {
        match self {
            Self::Frames(files) => files.paths(frame, order).iter().all(|path| read::is_finished(path, settings_hash)),
            Self::Stream(_) => false,
        }
    }

    /// Writes `picture`: a whole frame, or one of its fields. Of two fields to be woven the earlier is kept until the
    /// later comes. Gives the files that are now complete.
    ///
    /// # Errors
    /// If it cannot be encoded or written; frames accepted before are kept.
    pub fn accept(&mut self, picture: Picture) -> Result<Vec<PathBuf>> {
        match self {
            Self::Frames(files) => files.accept(picture),
            Self::Stream(stream) => stream.accept(picture).map(|()| Vec::new()),
        }
    }

    /// Completes what is left. To be called also after an interruption or an error, so that a stream's frames so far
    /// become a whole file. Gives the files completed.
    ///
    /// # Errors
    /// If it cannot be written, or ffmpeg failed.
    pub fn finish(self) -> Result<Vec<PathBuf>> {
        match self {
            Self::Frames(_) => Ok(Vec::new()),
            Self::Stream(mut stream) => stream.finish(),
        }
    }
}

impl FrameFiles {
    fn paths(&self, frame: i64, order: FieldOrder) -> Vec<PathBuf> {
        match (order, self.fields) {
            (FieldOrder::Progressive, _) | (_, FieldFiles::Woven) => vec![self.pattern.path(frame)],
            _ => ["top", "bottom"].map(|suffix| self.pattern.path_with_suffix(frame, suffix)).to_vec(),
        }
    }

    fn accept(&mut self, picture: Picture) -> Result<Vec<PathBuf>> {
        let frame = picture.metadata.frame;
        if self.fields == FieldFiles::Separate && matches!(picture.metadata.order, FieldOrder::Interlaced { .. }) {
            let mut files = Vec::new();
            for field in separate(&picture)? {
                files.extend(self.accept(field)?);
            }
            return Ok(files);
        }
        let FieldOrder::Separate { parity, .. } = picture.metadata.order else {
            let path = self.pattern.path(frame);
            return self.write(&picture, path);
        };
        if self.fields == FieldFiles::Separate {
            let suffix = if parity == Parity::Top { "top" } else { "bottom" };
            let path = self.pattern.path_with_suffix(frame, suffix);
            return self.write(&picture, path);
        }
        match self.earlier.take() {
            None => {
                self.earlier = Some(picture);
                Ok(Vec::new())
            }
            Some(earlier) => {
                let woven = weave(&earlier, &picture)?;
                let path = self.pattern.path(frame);
                self.write(&woven, path)
            }
        }
    }

    fn write(&mut self, picture: &Picture, path: PathBuf) -> Result<Vec<PathBuf>> {
        let bytes = match self.format {
            FrameFormat::Exr(depth) => exr::encode(picture, depth, &path)?,
            FrameFormat::Png(options) => png::encode(picture, options, &path)?,
        };
        file::write_whole(&path, &bytes)?;
        Ok(vec![path])
    }
}

impl Stream {
    fn accept(&mut self, picture: Picture) -> Result<()> {
        let whole = if matches!(picture.metadata.order, FieldOrder::Separate { .. }) {
            match self.earlier.take() {
                None => {
                    self.earlier = Some(picture);
                    return Ok(());
                }
                Some(earlier) => weave(&earlier, &picture)?,
            }
        } else {
            picture
        };
        match self.pulldown.as_mut() {
            None => self.write(&whole),
            Some(pulldown) => pulldown.push(whole)?.iter().try_for_each(|frame| self.write(frame)),
        }
    }

    fn write(&mut self, picture: &Picture) -> Result<()> {
        if let StreamKind::Waiting { program, path, container } = &self.kind {
            let encoder =
                Encoder::start(program, *container, path, picture.size, &picture.metadata, self.options.view)?;
            self.kind = StreamKind::Encoder(Y4mWriter::new(encoder, "ffmpeg", self.options)?);
        }
        let written = match &mut self.kind {
            StreamKind::Pipe(writer) => writer.write(picture),
            StreamKind::File { writer, .. } => writer.write(picture),
            StreamKind::Encoder(writer) => writer.write(picture),
            StreamKind::Waiting { .. } | StreamKind::Ended => Ok(()),
        };
        let Err(error) = written else { return Ok(()) };
        // A write to ffmpeg fails when it has ended: its own last words say why.
        if matches!(error, Error::Io { .. })
            && let StreamKind::Encoder(writer) = std::mem::replace(&mut self.kind, StreamKind::Ended)
        {
            writer.into_inner().finish()?;
        }
        Err(error)
    }

    fn finish(&mut self) -> Result<Vec<PathBuf>> {
        if let Some(last) = self.pulldown.as_mut().map(Pulldown::finish).transpose()?.flatten() {
            self.write(&last)?;
        }
        match std::mem::replace(&mut self.kind, StreamKind::Ended) {
            StreamKind::Pipe(writer) => {
                writer.finish()?;
                Ok(Vec::new())
            }
            StreamKind::File { writer, part, path } => {
                let file = writer
                    .finish()?
                    .into_inner()
                    .map_err(|error| Error::io(&path, "write", std::io::Error::other(error.to_string())))?;
                file.sync_all().map_err(|source| Error::io(&path, "write", source))?;
                std::fs::rename(&part, &path).map_err(|source| Error::io(&path, "rename into place", source))?;
                Ok(vec![path])
            }
            StreamKind::Encoder(writer) => {
                let encoder = writer.into_inner();
                let path = encoder.path().to_path_buf();
                encoder.finish()?;
                Ok(vec![path])
            }
            StreamKind::Waiting { .. } | StreamKind::Ended => Ok(Vec::new()),
        }
    }
}
