//! YUV4MPEG2 streams (mjpegtools, yuv4mpeg(5)), which ffmpeg and all that is built on it read.

use super::yuv::{BitDepth, Frame, Sampling, YuvOptions, check_size};
use crate::output::{FieldOrder, Picture, PixelAspect};
use crate::time::{FrameRate, Parity};
use crate::{Error, Result};
use std::fmt;
use std::io::Write;
use std::path::{Path, PathBuf};

/// What the stream says of itself.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Y4mHeader {
    /// Columns and lines.
    pub size: (u32, u32),
    /// Frames a second.
    pub rate: FrameRate,
    /// Progressive or interlaced; single fields are no frames of a stream.
    pub order: FieldOrder,
    /// Shape of pixels.
    pub pixel_aspect: PixelAspect,
    /// Chroma resolution.
    pub sampling: Sampling,
    /// Bits.
    pub depth: BitDepth,
}

impl fmt::Display for Y4mHeader {
    /// `YUV4MPEG2 W720 H480 F30000:1001 It A10:11 C422 XCOLORRANGE=LIMITED`.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (frames, seconds) = self.rate.parts();
        let order = match self.order {
            FieldOrder::Interlaced { first: Parity::Top } => "It",
            FieldOrder::Interlaced { first: Parity::Bottom } => "Ib",
            FieldOrder::Progressive | FieldOrder::Separate { .. } => "Ip",
        };
        let chroma = match (self.sampling, self.depth) {
            (Sampling::S444, BitDepth::Eight) => "444",
            (Sampling::S422, BitDepth::Eight) => "422",
            // Columns sited on the even luma columns, as our samples are.
            (Sampling::S420, BitDepth::Eight) => "420mpeg2",
            (Sampling::S411, BitDepth::Eight) => "411",
            (Sampling::S444, BitDepth::Ten) => "444p10",
            (Sampling::S422, BitDepth::Ten) => "422p10",
            (Sampling::S420, BitDepth::Ten) => "420p10",
            (Sampling::S411, BitDepth::Ten) => "411p10",
        };
        let (width, height) = self.size;
        write!(
            f,
            "YUV4MPEG2 W{width} H{height} F{frames}:{seconds} {order} A{} C{chroma} XCOLORRANGE=LIMITED",
            self.pixel_aspect
        )
    }
}

/// Writes pictures as a stream; the header goes out with the first of them.
#[derive(Debug)]
pub struct Y4mWriter<W: Write> {
    out: W,
    /// For messages.
    name: PathBuf,
    options: YuvOptions,
    header: Option<Y4mHeader>,
    frames: u64,
}

impl<W: Write> Y4mWriter<W> {
    /// A stream to `out`, called `name` in messages.
    ///
    /// # Errors
    /// For 4:1:1 with 10 bits, which no tag names.
    pub fn new(out: W, name: impl AsRef<Path>, options: YuvOptions) -> Result<Self> {
        if options.sampling == Sampling::S411 && options.depth == BitDepth::Ten {
            return Err(Error::invalid("4:1:1 with 10 bits", "YUV4MPEG2 has it with 8 bits only"));
        }
        Ok(Self { out, name: name.as_ref().to_path_buf(), options, header: None, frames: 0 })
    }

    /// Frames written.
    #[must_use]
    pub fn frames(&self) -> u64 {
        self.frames
    }

    /// Appends a picture.
    ///
    /// # Errors
    /// If it differs from the first in size, rate, field order or pixel aspect, is a single field, does not fit the
    /// chroma sampling, or [`Error::Io`] if the stream cannot be written: a closed pipe.
    pub fn write(&mut self, picture: &Picture) -> Result<()> {
        picture.validate()?;
        let header = self.header_of(picture)?;
        match self.header {
            None => {
                self.send(format!("{header}\n").as_bytes())?;
                self.header = Some(header);
            }
            Some(begun) if begun != header => {
                return Err(Error::Picture {
                    path: self.name.clone(),
                    problem: format!("frame {} is \"{header}\" in a stream of \"{begun}\"", picture.metadata.frame),
                });
            }
            Some(_) => {}
        }
        let bytes = Frame::new(picture, &self.options)?.bytes();
        self.send(b"FRAME\n")?;
        self.send(&bytes)?;
        self.frames += 1;
        Ok(())
    }

    fn header_of(&self, picture: &Picture) -> Result<Y4mHeader> {
        let meta = &picture.metadata;
        if matches!(meta.order, FieldOrder::Separate { .. }) {
            return Err(Error::invalid("video stream", "a single field cannot be a frame; expected woven frames"));
        }
        check_size(picture.size, meta.order, self.options.sampling)?;
        Ok(Y4mHeader {
            size: picture.size,
            rate: meta.rate,
            order: meta.order,
            pixel_aspect: meta.pixel_aspect,
            sampling: self.options.sampling,
            depth: self.options.depth,
        })
    }

    fn send(&mut self, bytes: &[u8]) -> Result<()> {
        self.out.write_all(bytes).map_err(|source| Error::io(&self.name, "write", source))
    }

    /// Gives back what it wrote to, as it is.
    pub fn into_inner(self) -> W {
        self.out
    }

    /// Flushes and gives back what it wrote to.
    ///
    /// # Errors
    /// [`Error::Io`].
    pub fn finish(mut self) -> Result<W> {
        self.out.flush().map_err(|source| Error::io(&self.name, "write", source))?;
        Ok(self.out)
    }
}
