//! A finished picture with everything that its file should say about it.

use crate::film::{Film, Lines, Window};
use crate::time::{Exposure, FrameRate, Parity};
use crate::{Error, Result};
use std::fmt;
use std::str::FromStr;
use std::sync::Arc;

/// Width of a pixel over its height, as displayed: `8:9` for NTSC's 720 samples a line.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, serde::Serialize, serde::Deserialize)]
pub struct PixelAspect {
    /// Width part, from 1 to 65 535.
    pub width: u32,
    /// Height part, from 1 to 65 535.
    pub height: u32,
}

impl PixelAspect {
    /// Square pixels.
    pub const SQUARE: Self = Self { width: 1, height: 1 };

    /// `width` over `height`.
    ///
    /// # Errors
    /// If either is zero or above 65 535, or the ratio is beyond 16 either way.
    pub fn new(width: u32, height: u32) -> Result<Self> {
        let sane = (1..=65_535).contains(&width)
            && (1..=65_535).contains(&height)
            && width <= 16 * height
            && height <= 16 * width;
        if !sane {
            return Err(Error::invalid(
                format!("pixel aspect {width}:{height}"),
                "expected width:height such as 10:11, at most 16 to 1 either way",
            ));
        }
        Ok(Self { width, height })
    }

    /// The ratio.
    #[must_use]
    pub fn ratio(self) -> f64 {
        f64::from(self.width) / f64::from(self.height)
    }
}

impl fmt::Display for PixelAspect {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}:{}", self.width, self.height)
    }
}

impl FromStr for PixelAspect {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self> {
        let parts =
            text.split_once([':', '/']).and_then(|(a, b)| Some((a.trim().parse().ok()?, b.trim().parse().ok()?)));
        let (width, height) = parts
            .ok_or_else(|| Error::invalid(format!("pixel aspect \"{text}\""), "expected width:height such as 10:11"))?;
        Self::new(width, height)
    }
}

/// Which instants the lines of a picture belong to.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum FieldOrder {
    /// All lines belong to one exposure.
    #[default]
    Progressive,
    /// Two fields woven, of which this one is the earlier.
    Interlaced {
        /// The earlier field.
        first: Parity,
    },
    /// One field alone, half as high as its frame.
    Separate {
        /// The lines that it holds.
        parity: Parity,
        /// The earlier field of the frame.
        first: Parity,
    },
}

impl FieldOrder {
    /// The lines of the frame that the picture holds.
    #[must_use]
    pub const fn lines(self) -> Lines {
        match self {
            Self::Separate { parity, .. } => Lines::Field(parity),
            Self::Progressive | Self::Interlaced { .. } => Lines::All,
        }
    }

    /// Whether it is the second field of its frame, alone.
    #[must_use]
    pub fn is_second_field(self) -> bool {
        matches!(self, Self::Separate { parity, first } if parity != first)
    }
}

/// What made a picture, apart from its frame number: the same for all frames of a sequence.
#[derive(Debug, Clone, PartialEq, Default, serde::Serialize, serde::Deserialize)]
pub struct Record {
    /// Every setting that can change a pixel.
    pub settings: serde_json::Value,
    /// Hex BLAKE3 over the scene file and all it refers to.
    pub scene_hash: String,
    /// Seed of the designs.
    pub seed: u64,
    /// The program and its version.
    pub program: String,
    /// Hex BLAKE3 over all of the above: frames with equal hashes and numbers are equal.
    pub settings_hash: String,
}

impl Record {
    /// A record by this version of the program. `settings` holds what can change a pixel and nothing else.
    #[must_use]
    pub fn new(settings: serde_json::Value, scene_hash: &[u8; 32], seed: u64) -> Self {
        let program = concat!("graeco ", env!("CARGO_PKG_VERSION")).to_owned();
        let scene_hash = blake3::Hash::from_bytes(*scene_hash).to_hex().to_string();
        Self::hashed(settings, scene_hash, seed, program)
    }

    /// The same with one more setting.
    #[must_use]
    pub fn with(&self, name: &str, value: String) -> Self {
        let mut settings = self.settings.clone();
        if let Some(map) = settings.as_object_mut() {
            map.insert(name.to_owned(), serde_json::Value::String(value));
        }
        Self::hashed(settings, self.scene_hash.clone(), self.seed, self.program.clone())
    }

    fn hashed(settings: serde_json::Value, scene_hash: String, seed: u64, program: String) -> Self {
        let mut hasher = blake3::Hasher::new();
        // serde_json's maps are sorted, so equal settings are equal text; lengths keep the parts apart.
        for part in [&settings.to_string(), &scene_hash, &seed.to_string(), &program] {
            hasher.update(&(part.len() as u64).to_le_bytes());
            hasher.update(part.as_bytes());
        }
        let settings_hash = hasher.finalize().to_hex().to_string();
        Self { settings, scene_hash, seed, program, settings_hash }
    }
}

/// What a picture's file says about it.
#[derive(Debug, Clone, PartialEq)]
pub struct Metadata {
    /// Frame number.
    pub frame: i64,
    /// Frames a second.
    pub rate: FrameRate,
    /// What the picture (of two fields: the earlier) integrates, seconds of the shot's clock.
    pub exposure: Exposure,
    /// Shape of its pixels.
    pub pixel_aspect: PixelAspect,
    /// Which instants its lines belong to.
    pub order: FieldOrder,
    /// Passes over the picture, where sampling stopped by itself.
    pub passes: Option<u32>,
    /// What made it.
    pub record: Arc<Record>,
}

/// One channel beside the colour: `depth.Z`, `normal.X`, `variance.R`.
#[derive(Debug, Clone, PartialEq)]
pub struct Plane {
    /// `layer.CHANNEL`, as EXR names channels of a layer.
    pub name: String,
    /// Values in row order over the picture's window.
    pub samples: Vec<f32>,
}

/// A finished picture: scene-linear Rec. 709 radiance, planes beside it, and metadata.
#[derive(Debug, Clone, PartialEq)]
pub struct Picture {
    /// Columns and rows of the whole picture.
    pub size: (u32, u32),
    /// The pixels that it holds.
    pub window: Window,
    /// Row order over the window.
    pub rgb: Vec<[f32; 3]>,
    /// Coverage, if there is any; as many as pixels.
    pub alpha: Option<Vec<f32>>,
    /// Further channels.
    pub planes: Vec<Plane>,
    /// What its file says.
    pub metadata: Metadata,
}

impl Picture {
    /// The picture on `film`.
    #[must_use]
    pub fn from_film(film: &Film, metadata: Metadata) -> Self {
        Self {
            size: film.size(),
            window: film.window(),
            rgb: film.pixels().iter().map(|pixel| pixel.radiance.to_array()).collect(),
            alpha: None,
            planes: Vec::new(),
            metadata,
        }
    }

    /// Adds `variance.R/G/B`: the estimated variance of each pixel's radiance.
    #[must_use]
    pub fn with_variance(mut self, film: &Film) -> Self {
        for (channel, name) in ["variance.R", "variance.G", "variance.B"].into_iter().enumerate() {
            let samples = film.pixels().iter().map(|pixel| pixel.variance[channel]).collect();
            self.planes.push(Plane { name: name.to_owned(), samples });
        }
        self
    }

    /// Adds `samples.Y`: the runs that each pixel is the mean of.
    #[must_use]
    #[allow(clippy::cast_precision_loss, reason = "runs are far below 2^24")]
    pub fn with_samples(mut self, film: &Film) -> Self {
        let samples = film.pixels().iter().map(|pixel| pixel.runs as f32).collect();
        self.planes.push(Plane { name: "samples.Y".to_owned(), samples });
        self
    }

    /// Adds a coverage of 1 where the film has runs and 0 where it has none.
    #[must_use]
    pub fn with_coverage(mut self, film: &Film) -> Self {
        let there = |runs: u32| if runs > 0 { 1.0 } else { 0.0 };
        self.alpha = Some(film.pixels().iter().map(|pixel| there(pixel.runs + pixel.rejected)).collect());
        self
    }

    /// Whether it holds every pixel of its size.
    #[must_use]
    pub fn is_whole(&self) -> bool {
        self.window == Window::whole(self.size.0, self.size.1)
    }

    /// The pixels as a whole picture, black outside the window.
    #[must_use]
    pub fn whole_rgb(&self) -> Vec<[f32; 3]> {
        if self.is_whole() {
            return self.rgb.clone();
        }
        let (width, height) = self.size;
        let mut all = vec![[0.0; 3]; width as usize * height as usize];
        for (row, line) in self.rgb.chunks_exact(self.window.width as usize).enumerate() {
            let to = (row + self.window.y as usize) * width as usize + self.window.x as usize;
            all[to..to + line.len()].copy_from_slice(line);
        }
        all
    }

    /// Checks that every plane has one value per pixel, as writers rely on.
    ///
    /// # Errors
    /// If one has not.
    pub fn validate(&self) -> Result<()> {
        let area = self.window.area();
        let odd = if self.rgb.len() != area {
            Some(("colour", self.rgb.len()))
        } else if let Some(alpha) = self.alpha.as_ref().filter(|alpha| alpha.len() != area) {
            Some(("alpha", alpha.len()))
        } else {
            self.planes.iter().find(|plane| plane.samples.len() != area).map(|p| (p.name.as_str(), p.samples.len()))
        };
        if let Some((name, found)) = odd {
            return Err(Error::invalid(
                format!("picture of frame {}", self.metadata.frame),
                format!("the plane {name} has {found} values, expected one for each of {area} pixels"),
            ));
        }
        if !self.window.fits(self.size.0, self.size.1) || area == 0 {
            return Err(Error::invalid(
                format!("picture of frame {}", self.metadata.frame),
                "its window is empty or not inside the picture",
            ));
        }
        Ok(())
    }
}
