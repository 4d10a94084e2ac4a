//! Arbitrary output variables: planes beside the picture.
//!
//! Depth, normal, albedo and time are means over a pixel's samples that meet a surface, drawn by the pixel's own design,
//! so they blur as the picture does. Motion and object are those of the pixel's middle at mid-exposure through the
//! middle of the lens: a mean of identities would be none.

use super::Progress;
use super::integrate::Pass;
use crate::design::{Design, Factor, PixelAddress};
use crate::film::blocks::pixels;
use crate::film::{AlignedSums, Block, Join, Layout, Window};
use crate::output::Plane;
use crate::trace::FilmPoint;
use crate::trace::aov::Observer;
use crate::{Error, Result};
use glam::{DVec2, DVec3, Vec2};
use rayon::prelude::*;
use std::ops::Range;
use std::str::FromStr;

/// One output variable.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Aov {
    /// `depth.Z`: distance along the camera's axis, metres; infinite where nothing is met.
    Depth,
    /// `normal.X`, `.Y`, `.Z`: shading normal in world space towards the viewer.
    Normal,
    /// `albedo.R`, `.G`, `.B`: linear base colour.
    Albedo,
    /// `motion.prevX`, `.prevY`, `.nextX`, `.nextY`: pixels to the previous and next exposure.
    Motion,
    /// `time.T`: mean instant of the samples that met a surface, seconds after the exposure opened.
    Time,
    /// `samples.Y`: runs of the pixel.
    Samples,
    /// `variance.R`, `.G`, `.B`: estimated variance of the pixel's radiance.
    Variance,
    /// `object.id`: number of the node, from 1; 0 is none.
    ObjectId,
}

impl Aov {
    /// All of them with their names.
    pub const ALL: [(&'static str, Self); 8] = [
        ("depth", Self::Depth),
        ("normal", Self::Normal),
        ("albedo", Self::Albedo),
        ("motion", Self::Motion),
        ("time", Self::Time),
        ("samples", Self::Samples),
        ("variance", Self::Variance),
        ("object-id", Self::ObjectId),
    ];

    /// Those that are means over runs, in the order in which they are stored.
    const MEANS: [Self; 4] = [Self::Depth, Self::Normal, Self::Albedo, Self::Time];

    /// Whether it takes a look at first hits.
    #[must_use]
    pub fn is_observed(self) -> bool {
        !matches!(self, Self::Samples | Self::Variance)
    }
}

impl FromStr for Aov {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self> {
        Self::ALL.iter().find(|(name, _)| *name == text).map(|(_, aov)| *aov).ok_or_else(|| {
            let names: Vec<&str> = Self::ALL.iter().map(|(name, _)| *name).collect();
            Error::invalid(format!("--aov {text}"), format!("expected one of {}", names.join(", ")))
        })
    }
}

/// Sums over the runs of a pixel that met a surface.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
struct Seen {
    met: u32,
    depth: f64,
    time: f64,
    normal: DVec3,
    albedo: DVec3,
}

impl Join for Seen {
    fn absorb(&mut self, next: &Self) {
        self.met += next.met;
        self.depth += next.depth;
        self.time += next.time;
        self.normal += next.normal;
        self.albedo += next.albedo;
    }
}

/// What is observed in one pixel over some of its runs.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct ObservedSums {
    runs: AlignedSums<Seen>,
    motion: [f32; 4],
    object: f32,
}

/// What was observed in one pixel.
#[derive(Debug, Clone, Copy)]
pub struct Observed {
    depth: f32,
    normal: [f32; 3],
    albedo: [f32; 3],
    motion: [f32; 4],
    time: f32,
    object: f32,
}

impl Observed {
    const NOTHING: Self =
        Self { depth: f32::INFINITY, normal: [0.0; 3], albedo: [0.0; 3], motion: [0.0; 4], time: 0.0, object: 0.0 };
}

impl ObservedSums {
    /// The pixel as observed.
    #[must_use]
    #[allow(clippy::cast_possible_truncation, reason = "means that are stored as f32")]
    pub fn observed(&self) -> Observed {
        let mut observed = Observed { motion: self.motion, object: self.object, ..Observed::NOTHING };
        if let Some(seen) = self.runs.whole().filter(|seen| seen.met > 0) {
            let n = f64::from(seen.met);
            observed.depth = (seen.depth / n) as f32;
            observed.normal = (seen.normal / n).as_vec3().to_array();
            observed.albedo = (seen.albedo / n).as_vec3().to_array();
            observed.time = (seen.time / n) as f32;
        }
        observed
    }
}

/// Appends what `wanted` needs of `pixels`, each over the runs of `layout`, to `out`.
pub fn pack(pixels: &[ObservedSums], wanted: &[Aov], out: &mut Vec<u8>) {
    let means = Aov::MEANS.iter().any(|mean| wanted.contains(mean));
    let mut put = |values: &[f64]| values.iter().for_each(|v| out.extend_from_slice(&v.to_le_bytes()));
    for pixel in pixels {
        for block in pixel.runs.blocks() {
            let seen = &block.sums;
            if means {
                put(&[f64::from(seen.met)]);
            }
            for aov in Aov::MEANS.iter().filter(|aov| wanted.contains(aov)) {
                match aov {
                    Aov::Depth => put(&[seen.depth]),
                    Aov::Normal => put(&seen.normal.to_array()),
                    Aov::Albedo => put(&seen.albedo.to_array()),
                    _ => put(&[seen.time]),
                }
            }
        }
        if wanted.contains(&Aov::Motion) {
            put(&pixel.motion.map(f64::from));
        }
        if wanted.contains(&Aov::ObjectId) {
            put(&[f64::from(pixel.object)]);
        }
    }
}

/// Appends the sums at the start of `bytes` to `pixels`, whose runs must all be earlier ones; gives what follows them, or
/// nothing if there are too few bytes.
#[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "these were widened to be stored")]
pub fn unpack<'b>(bytes: &'b [u8], layout: &Layout, wanted: &[Aov], pixels: &mut [ObservedSums]) -> Option<&'b [u8]> {
    let means = Aov::MEANS.iter().any(|mean| wanted.contains(mean));
    let mut rest = bytes;
    let mut next = || {
        let (taken, left) = rest.split_first_chunk()?;
        rest = left;
        Some(f64::from_le_bytes(*taken))
    };
    for pixel in pixels {
        for (start, level) in layout.blocks() {
            let mut sums = Seen::default();
            if means {
                sums.met = next()? as u32;
            }
            for aov in Aov::MEANS.iter().filter(|aov| wanted.contains(aov)) {
                match aov {
                    Aov::Depth => sums.depth = next()?,
                    Aov::Normal => sums.normal = DVec3::new(next()?, next()?, next()?),
                    Aov::Albedo => sums.albedo = DVec3::new(next()?, next()?, next()?),
                    _ => sums.time = next()?,
                }
            }
            pixel.runs.push(Block { start, level, sums });
        }
        if wanted.contains(&Aov::Motion) {
            pixel.motion = [next()? as f32, next()? as f32, next()? as f32, next()? as f32];
        }
        if wanted.contains(&Aov::ObjectId) {
            pixel.object = next()? as f32;
        }
    }
    Some(rest)
}

/// Observes the pass's pixels of `window` into `pixels` (row order); `false` if cancelled.
#[allow(clippy::cast_possible_wrap, clippy::cast_possible_truncation, reason = "sides are at most 65 536")]
pub fn observe(
    observer: &Observer<'_>,
    design: &Design,
    pass: &Pass<'_>,
    window: Window,
    pixels: &mut [Observed],
    progress: &Progress,
) -> bool {
    pixels.par_chunks_mut(window.width as usize).enumerate().for_each(|(row, line)| {
        let y = window.y + row as u32;
        if !pass.lines.holds(y) || progress.is_cancelled() {
            return;
        }
        for (x, pixel) in line.iter_mut().enumerate() {
            let at = ((window.x + x as u32) as i32, y as i32);
            *pixel = observe_pixel(observer, design, pass, at, 0..design.runs()).observed();
        }
    });
    !progress.is_cancelled()
}

/// A picture's worth of nothing observed.
#[must_use]
pub fn blank(window: Window) -> Vec<Observed> {
    vec![Observed::NOTHING; window.area()]
}

/// Observes `runs` of a tile's exposed pixels, row by row.
#[allow(clippy::cast_possible_wrap, reason = "sides are at most 65 536")]
pub(super) fn observe_tile(
    observer: &Observer<'_>,
    design: &Design,
    pass: &Pass<'_>,
    tile: Window,
    runs: &Range<u32>,
) -> Vec<ObservedSums> {
    pixels(tile, pass.lines)
        .map(|(x, y)| observe_pixel(observer, design, pass, (x as i32, y as i32), runs.clone()))
        .collect()
}

#[allow(clippy::cast_possible_truncation, clippy::cast_precision_loss, reason = "numbers that are stored as f32")]
fn observe_pixel(
    observer: &Observer<'_>,
    design: &Design,
    pass: &Pass<'_>,
    (x, y): (i32, i32),
    runs: Range<u32>,
) -> ObservedSums {
    let shutter = design.factors().contains(&Factor::SHUTTER);
    let pixel = design.pixel(PixelAddress { x, y, frame: pass.number, field: 0 });
    let mut observed = ObservedSums::default();
    for run in runs {
        let point = pixel.point(run);
        let u_film = Vec2::new(point.get(Factor::FILM_X), point.get(Factor::FILM_Y));
        let u_shutter = if shutter { point.get(Factor::SHUTTER) } else { 0.5 };
        let (film, _) = pass.footprint.sample(pass.filter, x, y, u_film, u_shutter);
        let mut sums = Seen::default();
        if let Some(hit) = observer.first_hit(film, &point) {
            sums = Seen {
                met: 1,
                depth: f64::from(hit.depth),
                time: f64::from(hit.time_s),
                normal: hit.normal.as_dvec3(),
                albedo: hit.albedo.as_dvec3(),
            };
        }
        observed.runs.push(Block { start: u64::from(run), level: 0, sums });
    }
    let middle = FilmPoint {
        position: DVec2::new(f64::from(x) + 0.5, f64::from(y) + 0.5),
        u_time: pass.footprint.u_time(y, 0.5),
    };
    if let Some(hit) = observer.first_hit_in_focus(middle) {
        observed.object = hit.object as f32;
        if let Some([before, after]) = hit.motion {
            observed.motion = [before.x, before.y, after.x, after.y].map(|v| v as f32);
        }
    }
    observed
}

/// The planes that `wanted` names.
#[must_use]
pub fn planes(pixels: &[Observed], wanted: &[Aov]) -> Vec<Plane> {
    let mut planes = Vec::new();
    let mut add = |names: &[&str], get: &dyn Fn(&Observed, usize) -> f32| {
        for (channel, name) in names.iter().enumerate() {
            let samples = pixels.iter().map(|p| get(p, channel)).collect();
            planes.push(Plane { name: (*name).to_owned(), samples });
        }
    };
    for aov in wanted {
        match aov {
            Aov::Depth => add(&["depth.Z"], &|p, _| p.depth),
            Aov::Normal => add(&["normal.X", "normal.Y", "normal.Z"], &|p, c| p.normal[c]),
            Aov::Albedo => add(&["albedo.R", "albedo.G", "albedo.B"], &|p, c| p.albedo[c]),
            Aov::Motion => {
                add(&["motion.prevX", "motion.prevY", "motion.nextX", "motion.nextY"], &|p, c| p.motion[c]);
            }
            Aov::Time => add(&["time.T"], &|p, _| p.time),
            Aov::ObjectId => add(&["object.id"], &|p, _| p.object),
            Aov::Samples | Aov::Variance => {}
        }
    }
    planes
}
