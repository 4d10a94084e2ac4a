//! The plan against sampling everything always: error and seconds.

use crate::scenes::{Effect, balls};
use crate::shots;
use glam::Vec3;
use graeco::design::{Design, DesignOptions, Factor, Point};
use graeco::film::Film;
use graeco::render::clock::cpu_seconds;
use graeco::render::integrate::integrate;
use graeco::render::{Progress, Settings, Shot, Surroundings};
use graeco::scene::Scene;
use graeco::study::cost::Subject;
use graeco::study::cost::reference::Reference;
use graeco::study::cost::statistics::Interval;
use graeco::trace::{FilmPoint, ImageFunction};
use std::hint::black_box;

const SIZE: (u32, u32) = (96, 54);
const SEEDS: u64 = 6;
const REFERENCE_RUNS: u32 = 2048;

/// Time, lens, and light and lobe at every vertex.
fn every_factor(bounces: u16) -> Vec<Factor> {
    let camera = [Factor::FILM_X, Factor::FILM_Y, Factor::SHUTTER, Factor::LENS_U, Factor::LENS_V];
    let vertex = |v: u16| [Factor::light_u(v), Factor::light_v(v), Factor::lobe_u(v), Factor::lobe_v(v)];
    camera.into_iter().chain((0..=bounces).flat_map(vertex)).collect()
}

/// An image function that also draws what it has no use for, as a program without a plan does.
struct DrawsAll<'a, F> {
    function: &'a F,
    unused: Vec<Factor>,
}

impl<F: ImageFunction> ImageFunction for DrawsAll<'_, F> {
    fn radiance(&self, film: FilmPoint, point: &Point<'_>) -> Vec3 {
        for &factor in &self.unused {
            black_box(point.get(factor));
        }
        self.function.radiance(film, point)
    }
}

/// Pictures by the plan and pictures with more factors: mean relMSE and seconds of each, seed by seed in turns.
struct Compared {
    planned: Vec<(f64, f64)>,
    more: Vec<(f64, f64)>,
}

fn rendered(film: &Film) -> Vec<[f32; 3]> {
    film.pixels().iter().map(|p| p.radiance.to_array()).collect()
}

/// `more` of what the plan has, on frame `frame`.
fn compare(
    subject: &Subject<'_>,
    reference: &Reference,
    runs: u32,
    more: &dyn Fn(&[Factor]) -> Vec<Factor>,
) -> Compared {
    let settings =
        Settings { sampling: DesignOptions { runs, ..subject.settings.sampling }, ..subject.settings.clone() };
    let shot = Shot::new(subject.scene, &settings, subject.surroundings, "").unwrap();
    let mut compared = Compared { planned: Vec::new(), more: Vec::new() };
    shot.explore(subject.frame, |tracer, plan, pass| {
        let planned = plan.factors();
        let wider = more(&planned);
        let unused = wider.iter().copied().filter(|f| !planned.contains(f)).collect();
        let wasteful = DrawsAll { function: tracer, unused };
        let measure = |function: &dyn Fn(&Design, &mut Film), factors: &[Factor], seed: u64| {
            let design = Design::new(&DesignOptions { seed, ..settings.sampling }, factors);
            let mut film = Film::new(SIZE.0, SIZE.1, None).unwrap();
            let started = cpu_seconds();
            function(&design, &mut film);
            let seconds = cpu_seconds() - started;
            (reference.errors_of(&rendered(&film), SIZE.0 as usize).unwrap().rel_mse, seconds)
        };
        let progress = Progress::default();
        for seed in 100..100 + SEEDS {
            let own = |d: &Design, f: &mut Film| assert!(integrate(tracer, d, pass, f, &progress));
            let all = |d: &Design, f: &mut Film| assert!(integrate(&wasteful, d, pass, f, &progress));
            compared.planned.push(measure(&own, &planned, seed));
            compared.more.push(measure(&all, &wider, seed));
        }
    })
    .unwrap();
    compared
}

fn mean(values: &[(f64, f64)], of: fn(&(f64, f64)) -> f64) -> f64 {
    values.iter().map(of).sum::<f64>() / values.len() as f64
}

impl Compared {
    /// Error of the wider sampling over the plan's, with its 95 % interval over seeds (of pairs of logarithms).
    fn error_ratio(&self) -> Interval {
        let ratios: Vec<f64> = self.more.iter().zip(&self.planned).map(|(m, p)| m.0 / p.0).collect();
        Interval::of_logarithms(&ratios).unwrap()
    }

    /// Seconds of the wider sampling over the plan's, at equal runs.
    fn seconds_ratio(&self) -> f64 {
        mean(&self.more, |m| m.1) / mean(&self.planned, |m| m.1)
    }

    fn print(&self, name: &str, runs: u32) {
        let error = self.error_ratio();
        println!(
            "  {name:24} {runs:4} runs: relMSE {:.2e}, x {:.2} [{:.2}, {:.2}]; seconds x {:.2}; to equal error x {:.2}",
            mean(&self.planned, |p| p.0),
            error.mean,
            error.low,
            error.high,
            self.seconds_ratio(),
            self.seconds_ratio() * error.mean
        );
    }
}

fn reference_of(subject: &Subject<'_>) -> Reference {
    subject.reference(REFERENCE_RUNS).unwrap()
}

/// Scenes of one effect, bounces 0: the plan has that effect's factors, the other side all of them.
pub fn plan_against_everything() {
    println!("everything sampled always over the plan, scenes of one effect (above 1: the plan is better):");
    let surroundings = shots::dark();
    for effect in Effect::ALL {
        let scene = balls(effect);
        let mut settings = shots::settings(SIZE, 16, 0);
        settings.shutter = Some(1.0);
        // A second long, so that the ball moves.
        settings.rate = graeco::time::FrameRate::new(1, 1).unwrap();
        let subject = Subject { scene: &scene, settings: &settings, surroundings: &surroundings, frame: 0 };
        let reference = reference_of(&subject);
        for runs in [16, 64] {
            compare(&subject, &reference, runs, &|_| every_factor(0)).print(effect.name(), runs);
        }
    }
}

/// A part of the picture that shows neither motion nor blur, at its best: a whole picture of that kind.
fn within(scene: &str, frame: i64, bounces: u16) {
    let scene_file: Scene = shots::load(scene);
    let mut settings = shots::settings(SIZE, 16, bounces);
    settings.shutter = Some(0.0);
    settings.view.aperture_radius = Some(0.0);
    let surroundings: Surroundings<'_> = shots::dark();
    let subject = Subject { scene: &scene_file, settings: &settings, surroundings: &surroundings, frame };
    let reference = reference_of(&subject);
    for without in [&[Factor::SHUTTER][..], &[Factor::LENS_U, Factor::LENS_V]] {
        let names: Vec<String> = without.iter().map(ToString::to_string).collect();
        let name = format!("{} b{bounces} -{}", scene.rsplit('/').next().unwrap(), names.join("-"));
        for runs in [16, 64] {
            compare(&subject, &reference, runs, &|planned| [planned, without].concat()).print(&name, runs);
        }
    }
}

/// What a tile gains at most when its design has no factor for time, or none for the lens, if nothing there depends on
/// it: the project's scenes, frozen and through a pinhole, by designs with and without those factors.
pub fn what_regions_could_gain() {
    println!("designs with a factor that nothing depends on over designs without (above 1: dropping it gains):");
    for (scene, frame) in [("animations/fan.glb", 16), ("animations/field.glb", 8), ("animations/walker.glb", 9)] {
        for bounces in [0, 2] {
            within(scene, frame, bounces);
        }
    }
}
