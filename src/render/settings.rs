//! Everything that decides what a picture shows, in one value: its hash tells whether a finished frame still holds.

use super::adaptive::Adaptive;
use super::aovs::Aov;
use crate::design::DesignOptions;
use crate::film::{FilterSpec, Footprint, Lines, Scan, ShutterCurve, Window};
use crate::output::{FieldOrder, PixelAspect};
use crate::scene::rig::Playback;
use crate::scene::view::ViewRequest;
use crate::time::{Exposure, FrameRate, Parity, Shutter, ShutterPhase};
use crate::trace::path::{Caustics, PathLengths};
use crate::trace::texture::TextureFilter;
use crate::{Error, Result};
use serde::{Deserialize, Serialize};

/// How lines and time go together.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Scanning {
    /// All lines at once.
    #[default]
    Progressive,
    /// Two fields a frame, each at its own instant.
    Interlaced {
        /// The earlier field.
        first: Parity,
    },
    /// Line after line, from top to bottom.
    Rolling {
        /// Time from the first line's opening to the last's, as a part of the frame's period.
        readout: f64,
    },
}

/// Settings of a render: equal settings, scene and program give equal pictures.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Settings {
    /// Columns and lines of the whole picture.
    pub size: (u32, u32),
    /// The part of it to render: x, y, width, height.
    pub crop: Option<[u32; 4]>,
    /// Shape of a pixel.
    pub pixel_aspect: PixelAspect,
    /// Frames a second.
    pub rate: FrameRate,
    /// Exposure as a part of the frame's (or field's) period; `None`: the file's angle, else 180 degrees.
    pub shutter: Option<f64>,
    /// Where the exposure lies.
    pub shutter_phase: ShutterPhase,
    /// How much each instant of the exposure counts, as it is written.
    pub shutter_curve: String,
    /// How lines and time go together.
    pub scanning: Scanning,
    /// Lines of the frame that a pixel averages over, 1 to 2.
    pub line_height: f64,
    /// Camera and lens.
    pub view: ViewRequest,
    /// Animation.
    pub playback: Playback,
    /// Motion-blur amounts that override the file's, by node name.
    pub blur_scale: Vec<(String, f64)>,
    /// Samples a pixel and how they are placed.
    pub sampling: DesignOptions,
    /// Sampling that stops by itself, instead of a fixed number of runs.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub adaptive: Option<Adaptive>,
    /// Reconstruction filter.
    pub filter: FilterSpec,
    /// How textures are read.
    pub texture_filter: TextureFilter,
    /// Diffuse and rough bounces after the first hit.
    pub bounces: u16,
    /// Bounces that every path makes before chance may end it.
    pub sure_bounces: u16,
    /// Whether lamps light surfaces by way of mirrors and glass.
    pub caustics: Caustics,
    /// Planes beside the picture.
    pub aovs: Vec<Aov>,
}

/// One exposure of a frame: which lines, when, over what.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PassPlan {
    /// The lines that it exposes.
    pub lines: Lines,
    /// The pixel's extent.
    pub footprint: Footprint,
    /// The span of time that it covers.
    pub interval: Exposure,
    /// The exposure's number: the frame's, or the field's. Fields are numbered through, as the frames of a progressive
    /// sequence of twice the rate are, and draw what those would draw.
    pub number: i64,
}

impl Settings {
    /// What is stored as the picture's field order.
    #[must_use]
    pub fn field_order(&self) -> FieldOrder {
        match self.scanning {
            Scanning::Interlaced { first } => FieldOrder::Interlaced { first },
            Scanning::Progressive | Scanning::Rolling { .. } => FieldOrder::Progressive,
        }
    }

    /// How long paths are.
    #[must_use]
    pub fn path_lengths(&self) -> PathLengths {
        PathLengths { bounces: self.bounces, sure: self.sure_bounces }
    }

    /// The part of the picture to render.
    ///
    /// # Errors
    /// If the crop does not lie inside the picture.
    pub fn window(&self) -> Result<Option<Window>> {
        let Some([x, y, width, height]) = self.crop else { return Ok(None) };
        let window = Window { x, y, width, height };
        if width > 0 && height > 0 && window.fits(self.size.0, self.size.1) {
            Ok(Some(window))
        } else {
            Err(Error::invalid(
                format!("crop {x},{y},{width},{height}"),
                format!("it does not lie inside the picture of {}x{} pixels", self.size.0, self.size.1),
            ))
        }
    }

    /// The exposures that make up frame `frame`, given the shutter that the camera's file asks for, if any.
    ///
    /// # Errors
    /// If the scanning's values are out of range.
    pub fn passes(&self, frame: i64, file_angle: Option<f64>) -> Result<Vec<PassPlan>> {
        let fraction = self.shutter.or(file_angle.map(|angle| angle / 360.0)).unwrap_or(Shutter::default().fraction);
        let shutter = Shutter { fraction, phase: self.shutter_phase };
        let curve: ShutterCurve = self.shutter_curve.parse()?;
        let whole = Footprint::field(self.line_height)?.with_shutter(curve);
        let exposure = shutter.exposure(self.rate.instant(frame), self.rate.period());
        Ok(match self.scanning {
            Scanning::Progressive => {
                vec![PassPlan { lines: Lines::All, footprint: whole, interval: exposure, number: frame }]
            }
            Scanning::Rolling { readout } => {
                let readout_s = readout * self.rate.period();
                let (footprint, interval) = whole.rolling(exposure, readout_s, self.size.1)?;
                vec![PassPlan { lines: Lines::All, footprint, interval, number: frame }]
            }
            Scanning::Interlaced { first } => {
                if self.size.1 % 2 == 1 {
                    return Err(Error::invalid(
                        format!("a picture of {} lines", self.size.1),
                        "interlaced frames need an even number of lines",
                    ));
                }
                [0, 1]
                    .map(|field| {
                        let instant = self.rate.instant_of_part(frame, field, 2);
                        let interval = shutter.exposure(instant, self.rate.fields().period());
                        let parity = if field == 0 { first } else { first.other() };
                        let number = 2 * frame + i64::from(field);
                        PassPlan { lines: Lines::Field(parity), footprint: whole, interval, number }
                    })
                    .to_vec()
            }
        })
    }
}

impl PassPlan {
    /// The instants (seconds) of this exposure's middle, and of the previous and next exposure's: frames, or fields.
    #[must_use]
    pub fn neighbours(&self, rate: FrameRate) -> [f64; 3] {
        let middle = self.interval.middle();
        let period = match self.lines {
            Lines::All => rate.period(),
            Lines::Field(_) => rate.fields().period(),
        };
        [middle, middle - period, middle + period]
    }

    /// Whether lines are exposed one after another.
    #[must_use]
    pub fn is_rolling(&self) -> bool {
        matches!(self.footprint.scan, Scan::Rolling { .. })
    }
}
