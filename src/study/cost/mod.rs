//! What accuracy costs: the error of a frame against a reference, by design, samples and seconds, over independent
//! seeds; and what each effect of the scene costs.
//!
//! - The reference is the mean of two halves rendered with seeds of their own. A quarter of their squared difference
//!   estimates the reference's own squared error, which is subtracted from that of every picture.
//! - Seconds are processor seconds of sampling over the number of threads: what the clock on the wall shows on a machine
//!   that does nothing else. The wall's own seconds are kept beside them.
//! - Designs take turns, seed by seed, so that a machine that slows down slows all of them.
//! - Intervals are Student's at 95 % over the seeds; of seconds and slopes, over the seeds' own curves.

pub mod pictures;
pub mod plots;
pub mod reference;
pub mod report;
pub mod statistics;
pub mod without;

use crate::design::{Dither, Kind, Mask};
use crate::render::{Progress, Settings, Shot, Surroundings};
use crate::scene::Scene;
use crate::{Error, Result};
use reference::{Errors, Reference};
use serde::Serialize;
use statistics::{Curve, curves};

/// A frame to study.
#[derive(Debug, Clone, Copy)]
pub struct Subject<'a> {
    /// The scene.
    pub scene: &'a Scene,
    /// How it is rendered; design, dither, runs and seed are replaced.
    pub settings: &'a Settings,
    /// Light from all around.
    pub surroundings: &'a Surroundings<'a>,
    /// The frame.
    pub frame: i64,
}

/// A picture that a design gave.
#[derive(Debug, Clone)]
pub struct Rendered {
    /// Scene-linear pixels in row order.
    pub rgb: Vec<[f32; 3]>,
    /// Pixels across.
    pub width: usize,
    /// The design that was drawn: another than was asked for where the runs do not allow it.
    pub kind: Kind,
    /// Samples taken.
    pub samples: u64,
    /// Rays traced.
    pub rays: u64,
    /// Processor seconds of sampling over threads.
    pub seconds: f64,
    /// Seconds of sampling on the wall's clock.
    pub wall_s: f64,
    /// Seconds to build acceleration structures and light choice.
    pub build_s: f64,
}

/// A design with a structure between pixels.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
pub struct Contender {
    /// The design.
    pub design: Kind,
    /// The structure.
    pub dither: Dither,
}

impl Contender {
    /// Its name in tables and plots; a dither is named where there is one that was asked for.
    #[must_use]
    pub fn name(&self) -> String {
        match self.dither.mask {
            Mask::Auto | Mask::None => self.design.to_string(),
            _ => format!("{} + {}", self.design, self.dither),
        }
    }
}

/// How much to measure.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Effort {
    /// Designs and dithers.
    pub contenders: Vec<Contender>,
    /// Runs a pixel, ascending.
    pub runs: Vec<u32>,
    /// Independent seeds, at least 2.
    pub seeds: u32,
    /// Runs a pixel of each half of the reference.
    pub reference_runs: u32,
    /// Errors (relMSE) to which the seconds are asked.
    pub reach: Vec<f64>,
}

/// One picture's cost and error.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Measurement {
    /// Name of the contender, or of the effect left out.
    pub name: String,
    /// Runs a pixel.
    pub runs: u32,
    /// Seed.
    pub seed: u64,
    /// Samples taken.
    pub samples: u64,
    /// Rays traced.
    pub rays: u64,
    /// Processor seconds of sampling over threads.
    pub seconds: f64,
    /// Seconds of sampling on the wall's clock.
    pub wall_s: f64,
    /// Seconds to build acceleration structures.
    pub build_s: f64,
    /// How far it is from the reference.
    #[serde(flatten)]
    pub errors: Errors,
}

/// All of a frame's measurements.
#[derive(Debug, Clone, Serialize)]
pub struct Study {
    /// The reference's own relMSE, which was subtracted; `None` where it is not known.
    pub reference_rel_mse: Option<f64>,
    /// Mean ꟻLIP between the reference's halves, below which no picture can be told from it; `None` as before.
    pub reference_flip: Option<f64>,
    /// Every picture.
    pub measurements: Vec<Measurement>,
    /// Error against cost, by contender.
    pub curves: Vec<Curve>,
    /// The reference, for pictures.
    #[serde(skip)]
    pub reference: Reference,
    /// One picture of every contender, at the same runs.
    #[serde(skip)]
    pub shown: Vec<(String, u32, Rendered)>,
}

impl Subject<'_> {
    /// The frame as `contender` renders it.
    ///
    /// # Errors
    /// If the settings do not fit the scene.
    pub fn render(&self, contender: Contender, runs: u32, seed: u64) -> Result<Rendered> {
        let mut settings = self.settings.clone();
        settings.adaptive = None;
        let sampling = &mut settings.sampling;
        (sampling.kind, sampling.dither, sampling.runs, sampling.seed) =
            (contender.design, contender.dither, runs, seed);
        let mut shot = Shot::new(self.scene, &settings, self.surroundings, "")?;
        let kind = shot.plan(self.frame)?.first().map_or(contender.design, |(_, design)| design.kind());
        let frame = shot.render(self.frame, &Progress::default())?.ok_or(Error::Interrupted { frames_kept: 0 })?;
        #[allow(clippy::cast_precision_loss, reason = "threads")]
        let threads = rayon::current_num_threads() as f64;
        Ok(Rendered {
            rgb: frame.film.pixels().iter().map(|p| p.radiance.to_array()).collect(),
            width: frame.film.window().width as usize,
            kind,
            samples: frame.cost.samples,
            rays: frame.cost.rays,
            seconds: frame.cost.render_cpu_s / threads,
            wall_s: frame.cost.render_s,
            build_s: frame.cost.build_s,
        })
    }

    /// Whether `design` can be drawn with `runs` runs.
    fn can_draw(&self, design: Kind, runs: u32) -> Result<bool> {
        let mut settings = self.settings.clone();
        (settings.sampling.kind, settings.sampling.runs) = (design, runs);
        let shot = Shot::new(self.scene, &settings, self.surroundings, "")?;
        let drawn = shot.plan(self.frame)?;
        Ok(design == Kind::Auto || drawn.iter().all(|(_, d)| d.kind() == design))
    }

    /// A reference of two halves with seeds that no measurement has.
    ///
    /// # Errors
    /// As [`Subject::render`].
    pub fn reference(&self, runs: u32) -> Result<Reference> {
        /// Far from the seeds of measurements.
        const APART: u64 = 1 << 40;
        let auto = Contender { design: Kind::Auto, dither: Dither::NONE };
        let seed = self.settings.sampling.seed;
        let [a, b] = [1, 2].map(|half| self.render(auto, runs, seed.wrapping_add(APART * half)));
        Ok(Reference::of_halves(&a?, &b?))
    }
}

/// Measures every contender against `reference`. `say` is told of each row as it is finished.
///
/// # Errors
/// As [`Subject::render`]; if the reference has another size.
pub fn study(
    subject: &Subject<'_>,
    effort: &Effort,
    name_of: &dyn Fn(Contender) -> String,
    reference: Reference,
    say: &mut dyn FnMut(&Measurement),
) -> Result<Study> {
    let shown_runs = *effort.runs.get(1).or(effort.runs.first()).unwrap_or(&16);
    let (mut measurements, mut shown) = (Vec::new(), Vec::new());
    for index in 0..effort.seeds {
        for &runs in &effort.runs {
            for &contender in &effort.contenders {
                if !subject.can_draw(contender.design, runs)? {
                    continue;
                }
                let seed = subject.settings.sampling.seed.wrapping_add(u64::from(index));
                let picture = subject.render(contender, runs, seed)?;
                let measurement = Measurement {
                    name: name_of(contender),
                    runs,
                    seed,
                    samples: picture.samples,
                    rays: picture.rays,
                    seconds: picture.seconds,
                    wall_s: picture.wall_s,
                    build_s: picture.build_s,
                    errors: reference.errors(&picture)?,
                };
                say(&measurement);
                if index == 0 && runs == shown_runs {
                    shown.push((measurement.name.clone(), runs, picture));
                }
                measurements.push(measurement);
            }
        }
    }
    Ok(Study {
        reference_rel_mse: reference.own_rel_mse(),
        reference_flip: reference.own_flip,
        curves: curves(&measurements, &effort.reach),
        measurements,
        reference,
        shown,
    })
}
