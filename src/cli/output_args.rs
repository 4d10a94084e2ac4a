//! Arguments that say how finished pictures are written: shared by `render` and `merge`.

use super::shot_args::{OUTPUT, VIDEO};
use super::view_args::ViewArgs;
use clap::{Args, ValueHint};
use graeco::output::part::OutputChoice;
use graeco::output::video::{BitDepth, ChromaNotch, Sampling, YuvOptions};
use graeco::output::{
    Cadence, Destination, Dither, ExrDepth, FieldFiles, FrameFormat, OutputTarget, PngDepth, PngOptions, View,
};
use graeco::time::Parity;
use graeco::{Error, Result};
use std::path::PathBuf;

/// Where pictures go, and in which form.
#[derive(Debug, Clone, Args)]
pub(crate) struct OutputArgs {
    /// Where pictures go: out/shot.####.exr, %04d.png, clip.y4m, clip.mp4, .mov, .mkv, .mpg, .dv, or - for
    /// YUV4MPEG2 to standard output; from `render` also out/shot.####.part
    #[arg(short, long, value_name = "PATTERN", value_hint = ValueHint::AnyPath, help_heading = OUTPUT)]
    pub(crate) output: PathBuf,

    /// Write the two fields woven into one frame, or each for itself at half the height [default: woven]
    #[arg(long, value_name = "woven|separate", value_parser = parse_fields, help_heading = VIDEO)]
    fields: Option<FieldFiles>,

    /// Chroma of a video stream: 444, 422, 420 or 411 [default: what the container keeps, 422 for .y4m]
    #[arg(long, value_name = "SAMPLING", value_parser = parse_chroma, help_heading = VIDEO)]
    chroma: Option<Sampling>,

    /// Bits of a video stream's samples: 8 or 10
    #[arg(long, value_name = "BITS", value_parser = parse_bits, help_heading = VIDEO)]
    bits: Option<BitDepth>,

    /// Keep luminance detail out of the NTSC colour subcarrier's band, by a horizontal filter on output
    #[arg(long, help_heading = VIDEO)]
    chroma_notch: bool,

    #[command(flatten)]
    shown: ViewArgs,

    /// Bits a channel: 8 or 16 for PNG, half or float for EXR [default: 8, half]
    #[arg(long, value_name = "DEPTH", value_parser = ["8", "16", "half", "float"], help_heading = OUTPUT)]
    depth: Option<String>,
}

impl OutputArgs {
    /// Where pictures go.
    pub(crate) fn destination(&self) -> Result<Destination> {
        Destination::parse(&self.output.to_string_lossy())
    }

    /// The flags, over what was chosen before them.
    pub(crate) fn over(&self, before: &OutputChoice) -> OutputChoice {
        let View { transform, exposure_ev } = self.shown.over(view(before));
        OutputChoice {
            view: transform,
            exposure_ev,
            depth: self.depth.clone().or_else(|| before.depth.clone()),
            fields: self.fields.unwrap_or(before.fields),
            pulldown: before.pulldown,
        }
    }

    /// Where finished pictures of `lines` lines go; nothing is written yet.
    pub(crate) fn target(
        &self,
        destination: Destination,
        choice: &OutputChoice,
        lines: u32,
        frames: usize,
    ) -> Result<OutputTarget> {
        let cadence = if choice.pulldown { Cadence::Pulldown(Parity::Top) } else { Cadence::Native };
        match destination {
            Destination::Frames(_) if self.chroma_notch || self.chroma.is_some() || self.bits.is_some() => Err(
                Error::invalid("--chroma-notch, --chroma, --bits", "these are for video streams; frame files hold RGB"),
            ),
            Destination::Frames(pattern) => {
                let format = frame_format(&pattern.extension(), choice)?;
                OutputTarget::frames(pattern, format, choice.fields, frames)
            }
            Destination::Stdout => {
                let options = self.yuv(YuvOptions::for_lines(lines), choice);
                OutputTarget::pipe(Box::new(std::io::stdout()), options, cadence)
            }
            Destination::Y4m(path) => OutputTarget::y4m(&path, self.yuv(YuvOptions::for_lines(lines), choice), cadence),
            Destination::Video(path, container) => {
                let options = self.yuv(container.yuv_options(view(choice), lines), choice);
                OutputTarget::video(&path, container, options, cadence, "ffmpeg")
            }
            Destination::Parts(pattern) => Err(Error::invalid(
                format!("output \"{pattern}\""),
                "parts are what `graeco render` writes; expected pictures or a video",
            )),
        }
    }

    fn yuv(&self, fit: YuvOptions, choice: &OutputChoice) -> YuvOptions {
        YuvOptions {
            view: view(choice),
            sampling: self.chroma.unwrap_or(fit.sampling),
            depth: self.bits.unwrap_or(fit.depth),
            notch: if self.chroma_notch { ChromaNotch::On } else { ChromaNotch::Off },
            ..fit
        }
    }
}

/// What of the output changes the pixels of finished frame files.
pub(crate) fn finish(destination: &Destination, choice: &OutputChoice) -> String {
    let OutputChoice { view, exposure_ev, depth, fields, .. } = choice;
    match destination {
        Destination::Parts(_) => String::new(),
        Destination::Frames(pattern) if pattern.extension() == "png" => {
            format!("{view} {exposure_ev} {depth:?} {fields:?}")
        }
        _ => format!("{depth:?} {fields:?}"),
    }
}

pub(crate) fn view(choice: &OutputChoice) -> View {
    View { transform: choice.view, exposure_ev: choice.exposure_ev }
}

fn frame_format(extension: &str, choice: &OutputChoice) -> Result<FrameFormat> {
    match (extension, choice.depth.as_deref()) {
        ("exr", None | Some("half")) => Ok(FrameFormat::Exr(ExrDepth::Half)),
        ("exr", Some("float")) => Ok(FrameFormat::Exr(ExrDepth::Float)),
        ("png", depth @ (None | Some("8" | "16"))) => Ok(FrameFormat::Png(PngOptions {
            depth: if depth == Some("16") { PngDepth::Sixteen } else { PngDepth::Eight },
            view: view(choice),
            dither: Dither::default(),
        })),
        (_, depth) => Err(Error::invalid(
            format!("--depth {}", depth.unwrap_or_default()),
            format!("not a depth of .{extension} files"),
        )),
    }
}

fn parse_fields(text: &str) -> Result<FieldFiles, String> {
    match text {
        "woven" => Ok(FieldFiles::Woven),
        "separate" => Ok(FieldFiles::Separate),
        _ => Err("expected woven or separate".into()),
    }
}

fn parse_chroma(text: &str) -> Result<Sampling, String> {
    match text.replace(':', "").as_str() {
        "444" => Ok(Sampling::S444),
        "422" => Ok(Sampling::S422),
        "420" => Ok(Sampling::S420),
        "411" => Ok(Sampling::S411),
        _ => Err("expected 444, 422, 420 or 411".into()),
    }
}

fn parse_bits(text: &str) -> Result<BitDepth, String> {
    match text {
        "8" => Ok(BitDepth::Eight),
        "10" => Ok(BitDepth::Ten),
        _ => Err("expected 8 or 10".into()),
    }
}
