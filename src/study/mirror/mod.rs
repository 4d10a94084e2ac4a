//! Moving mirrors: sampling time beside filtering the finished picture.
//!
//! A frame is made three ways: by sampling time with everything else (Cook, Porter and Carpenter 1984), by blurring one
//! frozen picture along its motion vectors (Potmesil and Chakravarty 1983: see [`postfilter`]), and, to judge both, as
//! the mean of many frozen pictures, which knows nothing of motion blur. Mitchell 1990, §6: the filter "does not always
//! produce correct results (e.g., a moving mirror)".

pub mod postfilter;
pub mod report;

use super::cost::reference::{Errors, Reference};
use super::cost::{Contender, Rendered, Subject};
use crate::design::{Dither, Kind};
use crate::render::aovs::Aov;
use crate::render::{Progress, Settings, Shot, Surroundings};
use crate::scene::Scene;
use crate::time::FrameRate;
use crate::{Error, Result};
use glam::{DVec2, Vec3};
use postfilter::{Sample, post_filter};
use serde::Serialize;

/// How much to compute.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
pub struct Effort {
    /// Runs a pixel of the pictures that are compared.
    pub runs: u32,
    /// Frozen pictures that the reference averages.
    pub instants: u32,
    /// Runs a pixel of each of them, in each of the reference's two halves.
    pub instant_runs: u32,
}

/// One way to make the frame.
#[derive(Debug, Clone, Serialize)]
pub struct Method {
    /// What was done.
    pub name: String,
    /// Runs a pixel.
    pub runs: u32,
    /// Processor seconds of sampling over threads; the filter's own are not counted.
    pub seconds: f64,
    /// How far the whole picture is from the reference.
    pub errors: Errors,
    /// Root of the mean squared error over each object's pixels, as [`Study::objects`] lists them.
    pub by_object: Vec<f64>,
    /// Scene-linear pixels.
    #[serde(skip)]
    pub rgb: Vec<[f32; 3]>,
}

/// The comparison of one frame.
#[derive(Debug, Clone, Serialize)]
pub struct Study {
    /// The scene's file name.
    pub scene: String,
    /// The frame.
    pub frame: i64,
    /// Columns and lines.
    pub size: (u32, u32),
    /// How much was computed.
    pub effort: Effort,
    /// RMSE of the reference by its halves' difference; its square is subtracted from the others'.
    pub reference_rmse: f64,
    /// Mean ꟻLIP between its halves.
    pub reference_flip: f64,
    /// Names of the objects in the frame's middle, the largest first, with their shares of the pixels.
    pub objects: Vec<(String, f64)>,
    /// The ways.
    pub methods: Vec<Method>,
    /// The reference's pixels.
    #[serde(skip)]
    pub reference: Vec<[f32; 3]>,
}

/// Sample points of the filtered picture along each side of a pixel.
const SUPER: u32 = 3;
/// The most objects that get numbers of their own.
const MOST_OBJECTS: usize = 6;
/// Far from the seeds that the compared pictures take.
const APART: u64 = 1 << 40;

/// Makes frame `frame` every way and measures it. `say` is told what is being done.
///
/// # Errors
/// If the settings do not fit the scene, or are not those of whole frames.
pub fn study(
    scene: &Scene,
    settings: &Settings,
    surroundings: &Surroundings<'_>,
    frame: i64,
    effort: Effort,
    say: &mut dyn FnMut(&str),
) -> Result<Study> {
    super::motion::check(settings)?;
    let exposure = settings.passes(frame, file_angle(scene, settings, surroundings)?)?[0].interval;
    let moving = Subject { scene, settings, surroundings, frame };
    let frozen = Frozen { subject: moving, open: exposure.open, close: exposure.close };
    say(&format!("reference: {} frozen pictures, twice", effort.instants));
    let halves = [1, 2].map(|half| frozen.mean(effort, APART * half));
    let [a, b] = halves;
    let (a, b) = (a?, b?);
    let reference = Reference::of_halves(&a, &b);
    let shutter = (exposure.close - exposure.open) / settings.rate.period();
    say("objects and their motion");
    let seen = Seen::new(&moving, 1)?;
    let objects = seen.largest(scene);
    let mut methods = Vec::new();
    for runs in [effort.runs.div_ceil(4), effort.runs, 4 * effort.runs] {
        say(&format!("time sampled, {runs} runs"));
        let picture = moving.render(AUTO, runs, settings.sampling.seed)?;
        methods.push(measured(format!("time sampled, {runs} runs"), runs, picture, &reference, (&seen, &objects))?);
        say(&format!("post-filter, {runs} runs"));
        let picture = frozen.filtered(runs, shutter)?;
        methods.push(measured(format!("post-filter, {runs} runs"), runs, picture, &reference, (&seen, &objects))?);
    }
    let picture = frozen.at(0.5, effort.runs, settings.sampling.seed, 1)?;
    methods.push(measured("frozen".to_owned(), effort.runs, picture, &reference, (&seen, &objects))?);
    Ok(Study {
        scene: scene.path.file_name().map_or_else(String::new, |n| n.to_string_lossy().into_owned()),
        frame,
        size: settings.size,
        effort,
        reference_rmse: own_rmse(&reference),
        reference_flip: reference.own_flip.unwrap_or(0.0),
        objects: objects.into_iter().map(|(_, name, share)| (name, share)).collect(),
        methods,
        reference: super::cost::pictures::narrow(&reference),
    })
}

const AUTO: Contender = Contender { design: Kind::Auto, dither: Dither::NONE };

/// The shutter angle that the camera's file asks for, which a frozen copy of the settings must know.
fn file_angle(scene: &Scene, settings: &Settings, surroundings: &Surroundings<'_>) -> Result<Option<f64>> {
    Ok(Shot::new(scene, settings, surroundings, "")?.file_shutter_angle())
}

fn own_rmse(reference: &Reference) -> f64 {
    let variance = reference.variance.as_deref().unwrap_or_default();
    let count = 3 * variance.len().max(1);
    #[allow(clippy::cast_precision_loss, reason = "a count of values")]
    let mean = variance.iter().flatten().sum::<f64>() / count as f64;
    mean.sqrt()
}

/// An object's number, name, and share of the pixels.
type Object = (u32, String, f64);

fn measured(
    name: String,
    runs: u32,
    picture: Rendered,
    reference: &Reference,
    (seen, objects): (&Seen, &[Object]),
) -> Result<Method> {
    let errors = reference.errors(&picture)?;
    let by_object = objects.iter().map(|o| seen.rmse(o.0, &picture.rgb, reference)).collect();
    Ok(Method { name, runs, seconds: picture.seconds, errors, by_object, rgb: picture.rgb })
}

/// A subject at single instants of its exposure.
struct Frozen<'a> {
    subject: Subject<'a>,
    open: f64,
    close: f64,
}

impl Frozen<'_> {
    /// The picture at `part` of the exposure, `zoom` times as many columns and lines.
    #[allow(clippy::cast_possible_truncation, reason = "the number of a frame")]
    fn at(&self, part: f64, runs: u32, seed: u64, zoom: u32) -> Result<Rendered> {
        /// Parts of a frame to which instants are set: as many as the frame rate's numbers allow, so that an instant is
        /// off by less than a thousandth of a frame.
        const FINE: u32 = 10_000_000;
        let (frames, seconds) = self.subject.settings.rate.parts();
        let rate = FrameRate::new(frames * (FINE / frames), seconds)?;
        let instant = self.open + part * (self.close - self.open);
        let mut settings = zoomed(self.subject.settings, zoom);
        (settings.rate, settings.shutter) = (rate, Some(0.0));
        settings.shutter_phase = crate::time::ShutterPhase::Start;
        let frame = (instant * rate.per_second()).round() as i64;
        Subject { settings: &settings, frame, ..self.subject }.render(AUTO, runs, seed)
    }

    /// The mean over instants that divide the exposure evenly, each with a seed of its own.
    fn mean(&self, effort: Effort, apart: u64) -> Result<Rendered> {
        let mut sum: Option<(Rendered, Vec<[f64; 3]>)> = None;
        for i in 0..effort.instants {
            let part = (f64::from(i) + 0.5) / f64::from(effort.instants);
            let seed = self.subject.settings.sampling.seed.wrapping_add(apart + u64::from(i));
            let picture = self.at(part, effort.instant_runs, seed, 1)?;
            let wide = picture.rgb.iter().map(|p| p.map(f64::from));
            match &mut sum {
                None => sum = Some((picture.clone(), wide.collect())),
                Some((_, total)) => total.iter_mut().zip(wide).for_each(|(t, p)| (0..3).for_each(|c| t[c] += p[c])),
            }
        }
        let (picture, total) = sum.ok_or_else(|| Error::invalid("--instants", "expected at least 1"))?;
        let share = 1.0 / f64::from(effort.instants);
        #[allow(clippy::cast_possible_truncation, reason = "pixels are stored as f32")]
        let rgb = total.iter().map(|p| p.map(|c| (c * share) as f32)).collect();
        Ok(Rendered { rgb, ..picture })
    }

    /// The frozen picture of the exposure's middle, blurred along its motion vectors. Sample points are [`SUPER`]² a
    /// pixel, each rendered with its part of `runs`.
    #[allow(clippy::cast_possible_truncation, reason = "pixels are stored as f32")]
    fn filtered(&self, runs: u32, shutter: f64) -> Result<Rendered> {
        let picture = self.at(0.5, runs.div_ceil(SUPER * SUPER), self.subject.settings.sampling.seed, SUPER)?;
        let seen = Seen::new(&self.subject, SUPER)?;
        let samples: Vec<Sample> =
            seen.samples.iter().zip(&picture.rgb).map(|(s, &rgb)| Sample { radiance: Vec3::from(rgb), ..*s }).collect();
        let fine = post_filter(&samples, picture.width, shutter);
        let (zoom, width) = (SUPER as usize, picture.width / SUPER as usize);
        let rgb = (0..fine.len() / (zoom * zoom))
            .map(|i| {
                let corner = i / width * zoom * picture.width + i % width * zoom;
                let lines = (0..zoom).map(|dy| &fine[corner + dy * picture.width..][..zoom]);
                let sum: Vec3 = lines.flatten().copied().sum();
                (sum / (SUPER * SUPER) as f32).to_array()
            })
            .collect();
        Ok(Rendered { rgb, width, ..picture })
    }
}

/// `settings` with `zoom` times as many columns and lines.
fn zoomed(settings: &Settings, zoom: u32) -> Settings {
    let mut settings = settings.clone();
    settings.size = (settings.size.0 * zoom, settings.size.1 * zoom);
    settings.view.size = settings.size;
    settings.crop = None;
    settings.aovs.clear();
    settings
}

/// What every sample point shows in the exposure's middle.
struct Seen {
    samples: Vec<Sample>,
}

impl Seen {
    /// Looks at the middles of pixels, `zoom` times as many across and down as the subject has.
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "numbers of objects")]
    fn new(subject: &Subject<'_>, zoom: u32) -> Result<Self> {
        let mut settings = zoomed(subject.settings, zoom);
        settings.aovs = vec![Aov::Depth, Aov::Motion, Aov::ObjectId];
        (settings.sampling.runs, settings.bounces) = (1, 0);
        let mut shot = Shot::new(subject.scene, &settings, subject.surroundings, "")?;
        let stopped = || Error::Interrupted { frames_kept: 0 };
        let frame = shot.render(subject.frame, &Progress::default())?.ok_or_else(stopped)?;
        let plane = |name: &str| {
            let found = frame.planes.iter().find(|p| p.name == name).map(|p| p.samples.as_slice());
            found.ok_or_else(|| Error::invalid("study mirror", format!("the plane {name} was not made")))
        };
        let motion = ["motion.prevX", "motion.prevY", "motion.nextX", "motion.nextY"].map(plane);
        let [px, py, nx, ny] = motion;
        let (px, py, nx, ny) = (px?, py?, nx?, ny?);
        let (depth, object) = (plane("depth.Z")?, plane("object.id")?);
        let place = |x: &[f32], y: &[f32], i: usize| DVec2::new(f64::from(x[i]), f64::from(y[i]));
        let samples = (0..object.len())
            .map(|i| Sample {
                radiance: Vec3::ZERO,
                object: object[i] as u32,
                depth: depth[i],
                motion: [place(px, py, i), place(nx, ny, i)],
            })
            .collect();
        Ok(Self { samples })
    }

    /// The objects with the most pixels.
    #[allow(clippy::cast_precision_loss, reason = "counts of pixels")]
    fn largest(&self, scene: &Scene) -> Vec<Object> {
        let mut counts = std::collections::BTreeMap::<u32, usize>::new();
        for s in &self.samples {
            *counts.entry(s.object).or_default() += 1;
        }
        let mut list: Vec<(u32, usize)> = counts.into_iter().collect();
        list.sort_by_key(|&(_, count)| std::cmp::Reverse(count));
        let name = |object: u32| match (object as usize).checked_sub(1).map(|n| (n, scene.nodes[n].name.as_str())) {
            None => "background".to_owned(),
            Some((n, "")) => format!("node {n}"),
            Some((_, name)) => name.to_owned(),
        };
        let share = |count: usize| count as f64 / self.samples.len().max(1) as f64;
        list.into_iter().take(MOST_OBJECTS).map(|(object, count)| (object, name(object), share(count))).collect()
    }

    /// RMSE over the pixels that show `object` in the exposure's middle, the reference's own error subtracted.
    #[allow(clippy::cast_precision_loss, reason = "counts of pixels")]
    fn rmse(&self, object: u32, rgb: &[[f32; 3]], reference: &Reference) -> f64 {
        let own = reference.variance.as_deref();
        let (mut sum, mut count) = (0.0, 0_usize);
        for (i, _) in self.samples.iter().enumerate().filter(|(_, s)| s.object == object) {
            for c in 0..3 {
                sum += (f64::from(rgb[i][c]) - reference.rgb[i][c]).powi(2) - own.map_or(0.0, |v| v[i][c]);
                count += 1;
            }
        }
        (sum / count.max(1) as f64).max(0.0).sqrt()
    }
}
