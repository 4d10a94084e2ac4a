//! Arbitrary output variables: planes beside the picture.
//!
//! Depth, normal, albedo and time are means over a pixel's samples that meet a surface, drawn by the pixel's own design,
//! so they blur as the picture does. Motion and object are those of the pixel's middle at mid-exposure through the
//! middle of the lens: a mean of identities would be none.

use super::Progress;
use super::integrate::Pass;
use crate::design::{Design, Factor, PixelAddress};
use crate::film::Window;
use crate::output::Plane;
use crate::trace::FilmPoint;
use crate::trace::aov::Observer;
use crate::{Error, Result};
use glam::{DVec2, Vec2};
use rayon::prelude::*;
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
            *pixel = observe_pixel(observer, design, pass, (window.x + x as u32) as i32, y as i32);
        }
    });
    !progress.is_cancelled()
}

/// A picture's worth of nothing observed.
#[must_use]
pub fn blank(window: Window) -> Vec<Observed> {
    vec![Observed::NOTHING; window.area()]
}

#[allow(clippy::cast_possible_truncation, clippy::cast_precision_loss, reason = "means that are stored as f32")]
fn observe_pixel(observer: &Observer<'_>, design: &Design, pass: &Pass<'_>, x: i32, y: i32) -> Observed {
    let shutter = design.factors().contains(&Factor::SHUTTER);
    let pixel = design.pixel(PixelAddress { x, y, frame: pass.number, field: 0 });
    let (mut depth, mut normal, mut albedo, mut time, mut met) = (0.0_f64, [0.0_f64; 3], [0.0_f64; 3], 0.0_f64, 0_u32);
    for run in 0..design.runs() {
        let point = pixel.point(run);
        let u_film = Vec2::new(point.get(Factor::FILM_X), point.get(Factor::FILM_Y));
        let u_shutter = if shutter { point.get(Factor::SHUTTER) } else { 0.5 };
        let (film, _) = pass.footprint.sample(pass.filter, x, y, u_film, u_shutter);
        let Some(hit) = observer.first_hit(film, &point) else { continue };
        depth += f64::from(hit.depth);
        time += f64::from(hit.time_s);
        for c in 0..3 {
            normal[c] += f64::from(hit.normal[c]);
            albedo[c] += f64::from(hit.albedo[c]);
        }
        met += 1;
    }
    let mut observed = Observed::NOTHING;
    if met > 0 {
        let n = f64::from(met);
        observed.depth = (depth / n) as f32;
        observed.normal = normal.map(|v| (v / n) as f32);
        observed.albedo = albedo.map(|v| (v / n) as f32);
        observed.time = (time / n) as f32;
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
