//! The plan never drops an effect that shows: pictures by plan against pictures with every factor sampled, over random
//! scenes.
#![allow(
    clippy::unwrap_used,
    clippy::print_stdout,
    clippy::cast_possible_truncation,
    clippy::cast_precision_loss,
    reason = "helpers of tests: a failure is a panic, and numbers are small"
)]

#[path = "support/random_scene.rs"]
mod random_scene;
#[path = "support/shots.rs"]
mod shots;

use glam::Vec3;
use graeco::design::{Design, DesignOptions, Factor};
use graeco::effects::EffectsPlan;
use graeco::film::Film;
use graeco::render::integrate::integrate;
use graeco::render::{Progress, Settings, Shot, Surroundings};
use graeco::scene::Scene;
use graeco::scene::gltf::{self, LoadOptions};
use graeco::trace::environment::Background;
use random_scene::random_scene;
use statrs::distribution::{ContinuousCDF, StudentsT};

const SIZE: (u32, u32) = (16, 12);
/// Pixels along each side of the blocks whose means are compared.
const BLOCK: u32 = 2;
const RUNS: u32 = 16;
/// Independent pictures of each kind.
const SEEDS: u64 = 14;
/// Random scenes.
const SCENES: u64 = 40;
/// Of all comparisons together.
const ALPHA: f64 = 1e-3;

/// A scene that is ready to be drawn both ways.
struct Case {
    scene: Scene,
    background: Vec3,
    bounces: u16,
}

impl Case {
    fn new(seed: u64) -> Self {
        let made = random_scene(seed);
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("random.gltf");
        std::fs::write(&path, &made.gltf).unwrap();
        let scene = gltf::load(&path, &LoadOptions::default()).unwrap_or_else(|e| panic!("seed {seed}: {e}"));
        Self { scene, background: Vec3::splat(made.background), bounces: made.bounces }
    }

    fn settings(&self, seed: u64) -> Settings {
        let mut settings = shots::settings(SIZE, RUNS, self.bounces);
        settings.sampling.seed = seed;
        settings
    }

    fn surroundings(&self) -> Surroundings<'static> {
        Surroundings { background: Background::Constant(self.background), name: String::new() }
    }

    fn plan(&self) -> EffectsPlan {
        let (settings, surroundings) = (self.settings(0), self.surroundings());
        Shot::new(&self.scene, &settings, &surroundings, "").unwrap().plan(0).unwrap().remove(0).0
    }

    /// Means of blocks of the frame as the program renders it.
    fn planned(&self) -> Vec<Vec<f64>> {
        let surroundings = self.surroundings();
        let one = |seed| {
            let settings = self.settings(seed);
            let mut shot = Shot::new(&self.scene, &settings, &surroundings, "").unwrap();
            block_means(&shot.render(0, &Progress::default()).unwrap().unwrap().film)
        };
        (0..SEEDS).map(one).collect()
    }

    /// The same with the factors that `choose` gives, whatever the plan says.
    fn drawn_over(&self, first_seed: u64, choose: &dyn Fn(u16) -> Vec<Factor>) -> Vec<Vec<f64>> {
        let (settings, surroundings) = (self.settings(0), self.surroundings());
        let shot = Shot::new(&self.scene, &settings, &surroundings, "").unwrap();
        let mut all = Vec::new();
        shot.explore(0, |tracer, _, pass| {
            for seed in first_seed..first_seed + SEEDS {
                let options = DesignOptions { seed, ..settings.sampling };
                let design = Design::new(&options, &choose(self.bounces));
                let mut film = Film::new(SIZE.0, SIZE.1, None).unwrap();
                assert!(integrate(tracer, &design, pass, &mut film, &Progress::default()));
                all.push(block_means(&film));
            }
        })
        .unwrap();
        all
    }
}

fn every_factor(bounces: u16) -> Vec<Factor> {
    let camera = [Factor::FILM_X, Factor::FILM_Y, Factor::SHUTTER, Factor::LENS_U, Factor::LENS_V];
    let vertex = |v: u16| [Factor::light_u(v), Factor::light_v(v), Factor::lobe_u(v), Factor::lobe_v(v)];
    camera.into_iter().chain((0..=bounces).flat_map(vertex)).collect()
}

fn all_but_time(bounces: u16) -> Vec<Factor> {
    every_factor(bounces).into_iter().filter(|f| *f != Factor::SHUTTER).collect()
}

/// Means of red, green and blue over each block.
fn block_means(film: &Film) -> Vec<f64> {
    assert_eq!(film.rejected(), 0, "no sample is rejected");
    let mut means = Vec::new();
    for (top, left) in
        (0..SIZE.1).step_by(BLOCK as usize).flat_map(|y| (0..SIZE.0).step_by(BLOCK as usize).map(move |x| (y, x)))
    {
        let places = (0..BLOCK * BLOCK).map(|i| (left + i % BLOCK, top + i / BLOCK));
        let sum: f64 =
            places.map(|(x, y)| f64::from(film.pixels()[(y * SIZE.0 + x) as usize].radiance.element_sum())).sum();
        means.push(sum / f64::from(3 * BLOCK * BLOCK));
    }
    means
}

/// Mean and squared standard error of the mean.
fn mean_of(values: impl Iterator<Item = f64> + Clone) -> (f64, f64) {
    let n = SEEDS as f64;
    let mean = values.clone().sum::<f64>() / n;
    (mean, values.map(|v| (v - mean).powi(2)).sum::<f64>() / (n - 1.0) / n)
}

/// The least p of Welch's tests over the blocks. Means that rounding alone tells apart are equal.
fn least_p(a: &[Vec<f64>], b: &[Vec<f64>]) -> f64 {
    let blocks = a[0].len();
    (0..blocks)
        .map(|block| {
            let of = |pictures: &[Vec<f64>]| mean_of(pictures.iter().map(|p| p[block]).collect::<Vec<_>>().into_iter());
            let ((ma, va), (mb, vb)) = (of(a), of(b));
            let rounding = 1e-6 * (ma.abs() + mb.abs());
            let variance = va + vb + rounding * rounding;
            if (ma - mb).abs() <= rounding {
                return 1.0;
            }
            let freedom = (variance * variance * (SEEDS - 1) as f64 / (va * va + vb * vb).max(1e-300)).min(1e3);
            let t = (ma - mb).abs() / variance.sqrt();
            2.0 * StudentsT::new(0.0, 1.0, freedom).unwrap().sf(t)
        })
        .fold(1.0, f64::min)
}

/// One test's level: Šidák over all blocks of all scenes.
fn level() -> f64 {
    let tests = SCENES * u64::from(SIZE.0 / BLOCK * (SIZE.1 / BLOCK));
    1.0 - (1.0 - ALPHA).powf(1.0 / tests as f64)
}

/// H₀: what the plan drops does not show, so pictures by plan and pictures with every factor sampled (time, lens, and
/// light and lobe at all vertices) have the same means. Scenes of seeds 0 to 39; 48 blocks each of 2 × 2 pixels at 16
/// runs; n = 14 independent pictures of each kind; Welch's t; α = 0.001 over all 1920 tests (Šidák), so a block that is
/// 3 of one picture's standard deviations off is found with power 0.7.
///
/// The scenes are such that the plan drops time from a third of them, the lens from two thirds, lights from a quarter.
/// The planted fault draws all factors but time, and is found in nearly half of the scenes that need it (13 of 27; two
/// fifths are asked, which leaves room for draws); in the others what moves is out of sight, small, or turns into itself.
#[test]
fn the_plan_never_drops_an_effect_that_shows() {
    let (mut dropped, mut moving, mut caught) = ([0; 3], 0, 0);
    for seed in 0..SCENES {
        let case = Case::new(seed);
        let plan = case.plan();
        for (count, kept) in dropped.iter_mut().zip([plan.samples_time(), plan.samples_lens(), plan.samples_light()]) {
            *count += usize::from(!kept);
        }
        let everything = case.drawn_over(1000, &every_factor);
        let p = least_p(&case.planned(), &everything);
        assert!(p > level(), "scene {seed}: p = {p:e}\n{plan}");
        if plan.samples_time() {
            moving += 1;
            caught += usize::from(least_p(&case.drawn_over(0, &all_but_time), &everything) <= level());
        }
    }
    println!("dropped time, lens, light: {dropped:?}; time planted away and found in {caught} of {moving}");
    assert!(dropped.iter().all(|&n| n >= 6), "the plan drops effects here: {dropped:?}");
    assert!(moving >= 10 && 5 * caught >= 2 * moving, "{caught} of {moving} scenes show that time is missing");
}
