//! What accuracy costs, from scene to report; and what the plan says beforehand.

#[path = "support/shots.rs"]
mod shots;

use graeco::design::{Dither, Kind};
use graeco::output::View;
use graeco::render::{Adaptive, Goal, Progress, Settings, Shot, Surroundings};
use graeco::study::cost::report::{Price, Report};
use graeco::study::cost::without::{Effect, Without};
use graeco::study::cost::{Contender, Effort, Subject, study};
use graeco::study::savings::savings;
use graeco::trace::environment::Background;
use shots::{load, settings};
use std::process::Command;

const DARK: Surroundings<'_> = Surroundings { background: Background::Black, name: String::new() };

fn contender(design: Kind) -> Contender {
    Contender { design, dither: Dither::NONE }
}

fn effort(designs: &[Kind]) -> Effort {
    Effort {
        contenders: designs.iter().map(|&d| contender(d)).collect(),
        runs: vec![2, 8],
        seeds: 2,
        reference_runs: 64,
        reach: vec![1e-2],
    }
}

#[test]
fn a_study_measures_every_design_that_can_be_drawn_and_reports_without_a_network() {
    let scene = load("animations/pool.glb");
    let settings = settings((24, 14), 8, 0);
    let subject = Subject { scene: &scene, settings: &settings, surroundings: &DARK, frame: 12 };
    // Eight runs are no square: the squares are left out there.
    let effort = effort(&[Kind::Random, Kind::Orthogonal, Kind::Sobol]);
    let reference = subject.reference(effort.reference_runs).unwrap();
    let designs = study(&subject, &effort, &|c| c.name(), reference, &mut |_| {}).unwrap();
    assert_eq!(designs.measurements.len(), 2 * 2 * 2);
    assert!(
        designs.measurements.iter().all(|m| m.errors.rel_mse_raw > 0.0 && m.samples == 24 * 14 * u64::from(m.runs))
    );
    for curve in &designs.curves {
        assert!(curve.points[1].rel_mse.mean < curve.points[0].rel_mse.mean, "{curve:?}");
    }
    let own = designs.reference_rel_mse.unwrap();
    assert!(own > 0.0 && own < designs.curves[1].points[1].rel_mse.mean, "{own}");

    let report = Report {
        scene: "pool.glb <b>".into(),
        frame: 12,
        size: settings.size,
        threads: 1,
        reference: "made here".into(),
        effort,
        prices: vec![Price { without: vec![Effect::Time], study: designs.clone() }],
        designs,
    };
    let folder = tempfile::tempdir().unwrap();
    report.save(folder.path()).unwrap();
    let text = |name: &str| std::fs::read_to_string(folder.path().join(name)).unwrap();
    assert_eq!(text("cost.csv").lines().count(), 1 + 8 + 8);
    serde_json::from_str::<serde_json::Value>(&text("cost.json")).unwrap();
    let page = text("report.html");
    assert!(page.contains("pool.glb &lt;b&gt;") && page.contains("data:image/png;base64,") && page.contains("<svg"));
    for foreign in ["src=\"http", "href=", "<link", "@import", "fetch("] {
        assert!(!page.contains(foreign), "{foreign}");
    }
}

#[test]
fn effects_left_out_are_gone_from_the_plan() {
    let plan = |effects: &[Effect]| {
        let (mut scene, mut settings) = (load("animations/pool.glb"), settings((24, 14), 8, 0));
        effects.iter().for_each(|e| e.leave_out(&mut scene, &mut settings));
        Shot::new(&scene, &settings, &DARK, "").unwrap().plan(12).unwrap().remove(0).0
    };
    let whole = plan(&[]);
    assert!(whole.samples_time() && whole.samples_lens() && whole.has_extended_light());
    assert!(!plan(&[Effect::Time]).samples_time());
    assert!(!plan(&[Effect::Lens]).samples_lens());
    let points = plan(&[Effect::Light]);
    assert!(!points.has_extended_light() && points.point_lights >= whole.emissive_objects);
}

/// The forecast counts the frame's samples exactly and takes no more than all of them; what blurs is told from what
/// does not.
#[test]
fn a_forecast_counts_samples_and_measures_blur() {
    let look = |name: &str, settings: &Settings| {
        let scene = load(name);
        let dark = DARK;
        let mut shot = Shot::new(&scene, settings, &dark, "").unwrap();
        let (extents, forecast) = shot.forecast(12, 0.01).unwrap();
        (extents[0].clone(), forecast)
    };
    let (extent, forecast) = look("animations/pool.glb", &settings((40, 24), 8, 0));
    assert_eq!(forecast.samples, 40 * 24 * 8);
    assert!(forecast.samples_tried > 0 && forecast.samples_tried <= forecast.samples);
    assert!(forecast.render_s > 0.0);
    assert!(extent.motion_px > 1.0 && extent.motion_px < 47.0 && !extent.motion_node.is_empty(), "{extent:?}");
    // Twice the picture, twice the blur.
    let (double, _) = look("animations/pool.glb", &settings((80, 48), 8, 0));
    assert!((double.motion_px / extent.motion_px - 2.0).abs() < 0.05, "{double:?} {extent:?}");

    let frozen = Settings { shutter: Some(0.0), ..settings((40, 24), 8, 0) };
    assert!(look("animations/pool.glb", &frozen).0.motion_px <= 0.0);
    let mut pinhole = settings((40, 24), 8, 0);
    assert!(look("animations/pool.glb", &pinhole).0.defocus_px > 0.0);
    pinhole.view.aperture_radius = Some(0.0);
    assert!(look("animations/pool.glb", &pinhole).0.defocus_px <= 0.0);
}

/// Frames that stop by themselves are planned and foretold as they are sampled: with time for all of it, exactly.
#[test]
fn a_forecast_of_a_frame_that_stops_by_itself_counts_its_samples() {
    let scene = load("animations/pool.glb");
    let asked = |goal, exposure_ev| Settings {
        adaptive: Some(Adaptive { goal, most_runs: 256, view: View { exposure_ev, ..View::default() } }),
        ..settings((40, 24), 8, 0)
    };
    let mut counts = Vec::new();
    for (goal, exposure_ev) in [(Goal::Error(0.1), 0.0), (Goal::Error(0.1), -3.0), (Goal::Passes(6), 0.0)] {
        let settings = asked(goal, exposure_ev);
        let dark = DARK;
        let mut shot = Shot::new(&scene, &settings, &dark, "").unwrap();
        let design = shot.plan(12).unwrap().remove(0).1;
        assert_eq!((design.kind(), design.runs()), (Kind::Growing, 256));
        let (_, forecast) = shot.forecast(12, 1e4).unwrap();
        let frame = shot.render(12, &Progress::default()).unwrap().unwrap();
        assert_eq!(forecast.samples, frame.cost.samples, "{goal:?}");
        counts.push(forecast.samples);
    }
    assert!(counts[1] < counts[0], "a darker picture shows less noise: {counts:?}");
    let dark = DARK;
    let settings = asked(Goal::Within(50.0), 0.0);
    let (_, forecast) = Shot::new(&scene, &settings, &dark, "").unwrap().forecast(12, 0.01).unwrap();
    assert!((forecast.seconds() - 50.0).abs() < 1e-6, "{forecast:?}");
}

/// `graeco plan` takes the flags that say how the picture will be shown: `--error` is an error as it is seen.
#[test]
fn a_plan_knows_how_the_picture_will_be_shown() {
    let plan = |more: &[&str]| {
        let mut command = Command::new(env!("CARGO_BIN_EXE_graeco"));
        command.args(["plan", "scenes/hard_lights.glb", "--json", "--measure", "0", "--error", "2%"]);
        let output = command.args(more).output().unwrap();
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        let plan: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
        plan["adaptive"]["view"].clone()
    };
    let view =
        |transform: &str, exposure_ev: f64| serde_json::json!({ "transform": transform, "exposure_ev": exposure_ev });
    assert_eq!(plan(&[]), view("standard", 0.0));
    assert_eq!(plan(&["--view", "agx", "--exposure", "-1.5"]), view("agx", -1.5));
}

/// What effects cost is told from trials of the same blocks: errors that repeat exactly, and fall when effects go.
#[test]
fn the_price_of_each_effect_is_told_beforehand() {
    let scene = load("animations/pool.glb");
    let settings = settings((40, 24), 8, 0);
    let trial = |effects: &[Effect]| {
        let rest = Without::new(&scene, &settings, &DARK, effects);
        let mut shot = Shot::new(&rest.scene, &rest.settings, &rest.surroundings, "").unwrap();
        shot.trial(12, 6).unwrap()
    };
    let whole = trial(&[]);
    assert_eq!(whole.rel_mse.to_bits(), trial(&[]).rel_mse.to_bits());
    let nothing = trial(&Effect::ALL);
    assert!(nothing.rel_mse < 0.7 * whole.rel_mse, "{nothing:?} {whole:?}");

    let dark = DARK;
    let mut shot = Shot::new(&scene, &settings, &dark, "").unwrap();
    let (_, forecast) = shot.forecast(12, 0.01).unwrap();
    let all = savings(&scene, &settings, &DARK, 12, &forecast, 0.01).unwrap();
    let names: Vec<Vec<&str>> = all.iter().map(|s| s.without.iter().map(|e| e.name()).collect()).collect();
    assert_eq!(
        names,
        [vec!["time"], vec!["lens"], vec!["light"], vec!["gloss"], vec!["time", "lens", "light", "gloss"]]
    );
    for saving in &all {
        let whole = saving.frame_s_at_same_error.unwrap() + saving.saves_s_at_same_error.unwrap();
        assert!((whole / forecast.seconds() - 1.0).abs() < 1e-9, "{saving:?}");
    }
    // A still, matt and pinhole scene under point lights has no effects to price.
    let still = load("scenes/hard_lights.glb");
    assert!(savings(&still, &settings, &DARK, 0, &forecast, 0.01).unwrap().is_empty());
}
