//! A scene with its settings, rendered frame by frame.

use super::adaptive::{self, Adaptive, Goal};
use super::aovs::{self, Aov};
use super::extent::{self, BlurExtent};
use super::forecast::{Forecast, forecast};
use super::integrate::{Pass, integrate};
use super::settings::{PassPlan, Scanning, Settings};
use super::{Progress, clock};
use crate::design::{Design, DesignOptions};
use crate::effects::EffectsPlan;
use crate::film::{Film, Filter, Window};
use crate::output::video::separate;
use crate::output::{FieldFiles, FieldOrder, Metadata, Picture, Plane, Record};
use crate::scene::rig::Rig;
use crate::scene::view::{View, node_named};
use crate::scene::{Scene, Stage};
use crate::time::Exposure;
use crate::trace::accel::Accel;
use crate::trace::aov::{Neighbour, Observer};
use crate::trace::bsdf::Materials;
use crate::trace::camera::CameraRays;
use crate::trace::environment::{Background, Environment};
use crate::trace::lights::Lights;
use crate::trace::path::{Parts, PathTracer};
use crate::{Error, Result};
use std::sync::Arc;
use std::time::{Duration, Instant};

/// What a frame took.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct FrameCost {
    /// Seconds to evaluate the animation and build acceleration structures and light choice.
    pub build_s: f64,
    /// Seconds to sample.
    pub render_s: f64,
    /// Processor seconds of the process meanwhile, all threads.
    pub render_cpu_s: f64,
    /// Samples taken.
    pub samples: u64,
    /// Rays traced.
    pub rays: u64,
    /// Samples that were not finite and left out.
    pub rejected: u64,
    /// Passes over the picture where sampling stops by itself for the picture as a whole: repeats it exactly
    /// ([`Goal::Passes`]).
    pub passes: Option<u32>,
}

/// A finished frame.
#[derive(Debug, Clone)]
pub struct Frame {
    /// Estimates of every pixel.
    pub film: Film,
    /// Planes beside them, as the settings ask.
    pub planes: Vec<Plane>,
    /// The span of time that it covers: the earlier field's where it is interlaced.
    pub exposure: Exposure,
    /// What it took.
    pub cost: FrameCost,
    /// Whether runs or pixels are missing, which only a merge of some of its parts leaves out: its pictures then get a
    /// coverage that is 0 where there is nothing.
    pub is_partial: bool,
}

/// Light from all around, with a name that tells it from any other.
#[derive(Debug, Clone)]
pub struct Surroundings<'a> {
    /// The light.
    pub background: Background<'a>,
    /// Its settings; for a picture from a file, the file's hash.
    pub name: String,
}

/// A scene that is ready to be rendered.
#[derive(Debug)]
pub struct Shot<'a> {
    scene: &'a Scene,
    settings: &'a Settings,
    rig: Rig<'a>,
    view: View,
    filter: Filter,
    materials: Materials,
    environment: Environment,
    record: Arc<Record>,
    file_shutter_angle: Option<f64>,
    accel: Option<Accel>,
}

impl<'a> Shot<'a> {
    /// Checks the settings against the scene and chooses the camera. `finish` is what else changes the files' pixels,
    /// such as a view transform: it goes into their record and its hash.
    ///
    /// # Errors
    /// If a camera, node or animation that the settings name does not exist, or a setting is out of range.
    pub fn new(
        scene: &'a Scene,
        settings: &'a Settings,
        surroundings: &'a Surroundings<'a>,
        finish: &str,
    ) -> Result<Self> {
        let mut rig = Rig::new(scene, &settings.playback)?;
        for (node, amount) in &settings.blur_scale {
            rig.set_blur(node_named(scene, node)?, *amount);
        }
        let view = View::new(&rig, &settings.view)?;
        settings.window()?;
        settings.passes(0, None)?;
        if let Some(adaptive) = &settings.adaptive {
            adaptive.check(settings.sampling.kind, settings.sampling.dither)?;
        }
        let file_shutter_angle = view
            .node()
            .and_then(|n| scene.nodes[n].camera)
            .and_then(|c| scene.cameras[c].lens.shutter_angle)
            .map(f64::from);
        let json = serde_json::to_value(settings)
            .map_err(|e| Error::invalid("settings", format!("cannot be written as JSON: {e}")))?;
        let mut record = serde_json::Map::new();
        record.insert("render".into(), json);
        record.insert("surroundings".into(), serde_json::Value::String(surroundings.name.clone()));
        if !finish.is_empty() {
            record.insert("finish".into(), serde_json::Value::String(finish.to_owned()));
        }
        let record = Arc::new(Record::new(record.into(), &scene.hash, settings.sampling.seed));
        let filter = Filter::new(settings.filter);
        let materials = Materials::new(scene, settings.texture_filter);
        let environment = Environment::new(surroundings.background);
        Ok(Self { scene, settings, rig, view, filter, materials, environment, record, file_shutter_angle, accel: None })
    }

    /// First and last key time of what plays, seconds.
    #[must_use]
    pub fn span(&self) -> Option<(f64, f64)> {
        self.rig.span()
    }

    /// The shutter angle that the camera asks for in the file, degrees.
    #[must_use]
    pub fn file_shutter_angle(&self) -> Option<f64> {
        self.file_shutter_angle
    }

    /// What made the pictures, for their files.
    #[must_use]
    pub fn record(&self) -> &Arc<Record> {
        &self.record
    }

    /// Pixels that one frame has.
    #[must_use]
    pub fn pixels(&self) -> u64 {
        self.window().area() as u64
    }

    pub(super) fn window(&self) -> Window {
        let (width, height) = self.settings.size;
        // The crop was checked when the shot was made.
        self.settings.window().ok().flatten().unwrap_or(Window::whole(width, height))
    }

    /// The stage and the effects plan of one exposure.
    fn prepare(&self, pass: &PassPlan) -> (Stage, EffectsPlan) {
        let stage = self.view.stage(&self.rig, pass.interval);
        let plan = EffectsPlan::new(
            self.scene,
            &stage,
            !self.environment.is_black(),
            pass.is_rolling(),
            self.settings.bounces,
        );
        (stage, plan)
    }

    /// What frame `frame` calls for, one plan for each exposure, with the design that it would get.
    ///
    /// # Errors
    /// As [`Shot::render`].
    pub fn plan(&self, frame: i64) -> Result<Vec<(EffectsPlan, Design)>> {
        let passes = self.settings.passes(frame, self.file_shutter_angle)?;
        Ok(passes
            .iter()
            .map(|pass| {
                let (_, plan) = self.prepare(pass);
                let sampling = &self.settings.sampling;
                let drawn = self.settings.adaptive.map_or(*sampling, |adaptive| adaptive.drawn(sampling));
                let design = Design::new(&drawn, &plan.factors());
                (plan, design)
            })
            .collect())
    }

    fn camera(&self, stage: &Stage) -> CameraRays {
        CameraRays::new(&stage.camera, self.settings.size, self.settings.pixel_aspect.ratio())
            .shared_by(self.settings.sampling.runs)
    }

    /// How large blur is on frame `frame`, for each exposure, and what the frame is expected to take, from rendering a
    /// part of it for `budget_s` seconds or a little more.
    ///
    /// # Errors
    /// As [`Shot::render`].
    pub fn forecast(&mut self, frame: i64, budget_s: f64) -> Result<(Vec<BlurExtent>, Forecast)> {
        /// More runs than these are stood for by as many: seconds are proportional to runs.
        const MOST_RUNS: u32 = 64;
        let passes = self.settings.passes(frame, self.file_shutter_angle)?;
        let (mut total, mut extents) = (Forecast::default(), Vec::new());
        for pass in &passes {
            let started = Instant::now();
            let (stage, plan) = self.prepare(pass);
            let accel = Accel::build(self.scene, &stage, self.accel.take().as_ref());
            let runs = self.settings.sampling.runs;
            let options = DesignOptions { runs: runs.min(MOST_RUNS), ..self.settings.sampling };
            let design = Design::new(&options, &plan.factors());
            let camera = self.camera(&stage);
            let lights = Lights::build(self.scene, &stage, &self.materials, &self.environment);
            let parts =
                Parts { scene: self.scene, stage: &stage, accel: &accel, materials: &self.materials, lights: &lights };
            let tracer = PathTracer::new(parts, camera.clone(), self.settings.path_lengths(), self.settings.caustics);
            let build_s = started.elapsed().as_secs_f64();
            extents.push(extent::measure(self.scene, &stage, &accel, &camera, self.settings.size));
            let job = Pass { footprint: pass.footprint, filter: &self.filter, lines: pass.lines, number: pass.number };
            #[allow(clippy::cast_precision_loss, reason = "one or two exposures")]
            let budget_s = budget_s / passes.len() as f64;
            let sampled = match &self.settings.adaptive {
                None => forecast(&tracer, &design, runs, &job, self.window(), budget_s),
                Some(adaptive) => {
                    let drawn = (&self.settings.sampling, design.factors());
                    let shown = (self.window(), self.settings.size);
                    let asked = adaptive.of_exposure(passes.len(), build_s);
                    adaptive::outlook::forecast(&tracer, drawn, &asked, &job, shown, budget_s)
                }
            };
            total = total.then(Forecast { build_s, ..sampled });
            self.accel = Some(accel);
        }
        Ok((extents, total))
    }

    /// Calls `visit` with the image function of each exposure of frame `frame`, its plan and its pass, for studies that
    /// draw it by designs of their own.
    ///
    /// # Errors
    /// As [`Shot::render`].
    pub fn explore(&self, frame: i64, mut visit: impl FnMut(&PathTracer<'_>, &EffectsPlan, &Pass<'_>)) -> Result<()> {
        for pass in &self.settings.passes(frame, self.file_shutter_angle)? {
            let (stage, plan) = self.prepare(pass);
            let accel = Accel::build(self.scene, &stage, None);
            let lights = Lights::build(self.scene, &stage, &self.materials, &self.environment);
            let parts =
                Parts { scene: self.scene, stage: &stage, accel: &accel, materials: &self.materials, lights: &lights };
            let tracer =
                PathTracer::new(parts, self.camera(&stage), self.settings.path_lengths(), self.settings.caustics);
            let job = Pass { footprint: pass.footprint, filter: &self.filter, lines: pass.lines, number: pass.number };
            visit(&tracer, &plan, &job);
        }
        Ok(())
    }

    /// Renders frame `frame`; `None` if `progress` was cancelled.
    ///
    /// # Errors
    /// If the scanning's values are out of range.
    pub fn render(&mut self, frame: i64, progress: &Progress) -> Result<Option<Frame>> {
        let passes = self.settings.passes(frame, self.file_shutter_angle)?;
        let (width, height) = self.settings.size;
        let mut film = Film::new(width, height, self.settings.window()?)?;
        let mut cost = FrameCost::default();
        let observes = self.settings.aovs.iter().any(|a| a.is_observed());
        let mut observed = if observes { aovs::blank(film.window()) } else { Vec::new() };
        let (samples, rays) = (progress.samples(), progress.rays());
        let (deadline, mut passes_made) = (self.deadline(passes.len()), None);
        for pass in &passes {
            let asked = self.adaptive_after(passes_made);
            let complete = self.expose(pass, &mut cost, |exposed| {
                let mut complete = match asked {
                    None => integrate(exposed.tracer, exposed.design, &exposed.job, &mut film, progress),
                    Some(asked) => {
                        let drawn = (&exposed.shot.settings.sampling, exposed.design.factors());
                        let film = &mut film;
                        let made =
                            adaptive::integrate(exposed.tracer, drawn, &asked, &exposed.job, film, deadline, progress);
                        passes_made = made.filter(|&passes| passes > 0);
                        made.is_some()
                    }
                };
                if observes && complete {
                    let window = film.window();
                    complete = exposed.observe(|observer| {
                        aovs::observe(observer, exposed.design, &exposed.job, window, &mut observed, progress)
                    });
                }
                complete
            });
            if !complete {
                return Ok(None);
            }
        }
        cost.samples = progress.samples() - samples;
        cost.rays = progress.rays() - rays;
        cost.rejected = film.rejected();
        cost.passes = passes_made;
        let planes = aovs::planes(&observed, &self.settings.aovs);
        Ok(Some(Frame { film, planes, exposure: passes[0].interval, cost, is_partial: false }))
    }

    /// When the first of `exposures` must be finished, where the settings ask for a time.
    fn deadline(&self, exposures: usize) -> Option<Instant> {
        let Some(Adaptive { goal: Goal::Within(seconds), .. }) = self.settings.adaptive else { return None };
        #[allow(clippy::cast_precision_loss, reason = "one or two exposures")]
        let share = Duration::try_from_secs_f64(seconds / exposures as f64).ok()?;
        Instant::now().checked_add(share)
    }

    /// What an exposure is asked for. The second of a frame is sampled in as many passes as the first.
    fn adaptive_after(&self, passes: Option<u32>) -> Option<Adaptive> {
        let adaptive = self.settings.adaptive?;
        Some(passes.map_or(adaptive, |p| Adaptive { goal: Goal::Passes(p), ..adaptive }))
    }

    /// Builds what rays traverse during one exposure and hands it to `work`.
    pub(super) fn expose<R>(
        &mut self,
        pass: &PassPlan,
        cost: &mut FrameCost,
        work: impl FnOnce(&Exposed<'_, 'a>) -> R,
    ) -> R {
        let started = Instant::now();
        let earlier = self.accel.take();
        let (stage, plan) = self.prepare(pass);
        let accel = Accel::build(self.scene, &stage, earlier.as_ref());
        let design = Design::new(&self.settings.sampling, &plan.factors());
        let camera = self.camera(&stage);
        let lights = Lights::build(self.scene, &stage, &self.materials, &self.environment);
        let parts =
            Parts { scene: self.scene, stage: &stage, accel: &accel, materials: &self.materials, lights: &lights };
        let tracer = PathTracer::new(parts, camera, self.settings.path_lengths(), self.settings.caustics);
        cost.build_s += started.elapsed().as_secs_f64();
        let (started, cpu) = (Instant::now(), clock::cpu_seconds());
        let job = Pass { footprint: pass.footprint, filter: &self.filter, lines: pass.lines, number: pass.number };
        let result =
            work(&Exposed { shot: self, pass, stage: &stage, accel: &accel, tracer: &tracer, design: &design, job });
        cost.render_s += started.elapsed().as_secs_f64();
        cost.render_cpu_s += clock::cpu_seconds() - cpu;
        self.accel = Some(accel);
        result
    }

    /// Settings as they are.
    pub(super) fn settings(&self) -> &'a Settings {
        self.settings
    }

    /// The exposures of frame `frame`.
    pub(super) fn passes(&self, frame: i64) -> Result<Vec<PassPlan>> {
        self.settings.passes(frame, self.file_shutter_angle)
    }

    /// What is stored as the pictures' field order.
    #[must_use]
    pub fn field_order(&self) -> FieldOrder {
        self.settings.field_order()
    }

    /// A finished frame as pictures, with everything that their files should say: one, or the two fields of an
    /// interlaced frame if they are to be separate.
    ///
    /// # Errors
    /// If a crop should be separated into fields.
    pub fn pictures(&self, number: i64, frame: &Frame, fields: FieldFiles) -> Result<Vec<Picture>> {
        pictures(self.settings, &self.record, number, frame, fields)
    }
}

/// One exposure, ready to be sampled.
pub(super) struct Exposed<'e, 'a> {
    shot: &'e Shot<'a>,
    pass: &'e PassPlan,
    stage: &'e Stage,
    accel: &'e Accel,
    /// Light along rays.
    pub(super) tracer: &'e PathTracer<'e>,
    /// Where it is sampled.
    pub(super) design: &'e Design,
    /// Over what.
    pub(super) job: Pass<'e>,
}

impl Exposed<'_, '_> {
    /// Hands what observes first hits to `work`.
    pub(super) fn observe<R>(&self, work: impl FnOnce(&Observer<'_>) -> R) -> R {
        let shot = self.shot;
        let stages: Vec<Stage> = if shot.settings.aovs.contains(&Aov::Motion) {
            let at = |t: f64| shot.view.stage(&shot.rig, Exposure { open: t, close: t });
            self.pass.neighbours(shot.settings.rate).map(at).to_vec()
        } else {
            Vec::new()
        };
        let neighbours = match &stages[..] {
            [now, before, after] => Some([now, before, after].map(|s| Neighbour::new(s, shot.camera(s)))),
            _ => None,
        };
        let camera = shot.camera(self.stage);
        work(&Observer::new(shot.scene, self.stage, self.accel, &shot.materials, camera, neighbours))
    }
}

/// A finished frame as pictures, with everything that their files should say: one, or the two fields of an interlaced
/// frame if they are to be separate.
///
/// # Errors
/// If a crop should be separated into fields.
pub fn pictures(
    settings: &Settings,
    record: &Arc<Record>,
    number: i64,
    frame: &Frame,
    fields: FieldFiles,
) -> Result<Vec<Picture>> {
    let metadata = Metadata {
        frame: number,
        rate: settings.rate,
        exposure: frame.exposure,
        pixel_aspect: settings.pixel_aspect,
        order: settings.field_order(),
        passes: frame.cost.passes,
        record: Arc::clone(record),
    };
    let mut picture = Picture::from_film(&frame.film, metadata);
    if settings.aovs.contains(&Aov::Samples) {
        picture = picture.with_samples(&frame.film);
    }
    if settings.aovs.contains(&Aov::Variance) {
        picture = picture.with_variance(&frame.film);
    }
    picture.planes.extend(frame.planes.iter().cloned());
    if frame.is_partial {
        picture = picture.with_coverage(&frame.film);
    }
    match (settings.scanning, fields) {
        (Scanning::Interlaced { .. }, FieldFiles::Separate) => Ok(separate(&picture)?.to_vec()),
        _ => Ok(vec![picture]),
    }
}
