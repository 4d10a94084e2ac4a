//! Interlaced fields of rendered scenes: they are what a progressive render at twice the rate would weave to, they do
//! not flicker, and video tools take them for what they are.
#![allow(
    clippy::unwrap_used,
    clippy::print_stderr,
    clippy::print_stdout,
    clippy::cast_possible_truncation,
    clippy::cast_precision_loss,
    reason = "helpers of tests: a failure is a panic, numbers are small, and skipped tests say so"
)]

#[path = "support/flat.rs"]
mod flat;
#[path = "support/moving.rs"]
mod moving;
#[path = "support/shots.rs"]
mod shots;

use flat::{flat_scene, rectangle};
use glam::Vec3;
use graeco::film::Film;
use graeco::render::{Scanning, Settings};
use graeco::scene::Scene;
use graeco::time::{FrameRate, Parity};
use graeco::trace::environment::Background;
use shots::{load, render};
use std::path::Path;
use std::process::Command;

fn ntsc() -> FrameRate {
    FrameRate::new(30_000, 1001).unwrap()
}

fn interlaced(size: (u32, u32), runs: u32, first: Parity) -> Settings {
    Settings {
        scanning: Scanning::Interlaced { first },
        line_height: 2.0,
        rate: ntsc(),
        shutter: Some(0.5),
        ..shots::settings(size, runs, 0)
    }
}

#[test]
fn fields_are_the_lines_of_a_progressive_render_at_twice_the_rate() {
    let scene = load("animations/field.glb");
    let size = (64, 36);
    let woven = render(&scene, &interlaced(size, 8, Parity::Bottom), Background::Black, 5);
    let progressive =
        Settings { scanning: Scanning::Progressive, rate: ntsc().fields(), ..interlaced(size, 8, Parity::Bottom) };
    let fields = [10, 11].map(|frame| render(&scene, &progressive, Background::Black, frame));
    let mut differ = 0;
    for (i, pixel) in woven.pixels().iter().enumerate() {
        // The bottom lines, which are odd, come first.
        let field = if i / 64 % 2 == 1 { 0 } else { 1 };
        assert_eq!(pixel.radiance, fields[field].pixels()[i].radiance, "pixel {i}");
        differ += usize::from(pixel.radiance != fields[1 - field].pixels()[i].radiance);
    }
    assert!(differ > 100, "the other parity differs in {differ} pixels only: nothing moved");
}

/// Still white triangles on black under a parallel camera `lines` pixels of 1 × 1 high.
fn seen(points: &[Vec3], lines: u32) -> Scene {
    let mut b = flat_scene(lines.try_into().unwrap());
    let node = b.node(None, Vec3::ZERO);
    b.mesh(node, points);
    b.finish()
}

/// A still grating of `cycles` per line, black and white stripes.
fn grating(cycles: f64, lines: u32) -> Scene {
    let half = f64::from(lines) / 2.0;
    let period = 1.0 / cycles;
    let count = (f64::from(lines) / period).ceil() as i32 + 2;
    let stripe = |k: i32| {
        let top = half - f64::from(k) * period;
        rectangle([-100.0, 100.0], [(top - 0.5 * period) as f32, top as f32])
    };
    seen(&(-2..count).flat_map(stripe).collect::<Vec<_>>(), lines)
}

/// Difference between the two fields' mean luminance over a window of eight lines in the middle of the picture.
fn flicker(film: &Film, lines: u32) -> f64 {
    let width = film.size().0 as usize;
    let first = (lines / 2 - 4) as usize;
    let mean = |parity: usize| {
        let rows = (first..first + 8).filter(|y| y % 2 == parity);
        let values: Vec<f64> = rows
            .flat_map(|y| (0..width).map(move |x| y * width + x))
            .map(|i| f64::from(film.pixels()[i].radiance.x))
            .collect();
        values.iter().sum::<f64>() / values.len() as f64
    };
    (mean(0) - mean(1)).abs()
}

#[test]
fn two_lines_do_not_flicker() {
    let lines = 48;
    let at = |cycles: f64, line_height: f64| {
        let settings = Settings { line_height, ..interlaced((8, lines), 256, Parity::Top) };
        flicker(&render(&grating(cycles, lines), &settings, Background::Black, 0), lines)
    };
    // A grating of one cycle in two lines: white lines on one field, black on the other, unless a pixel sees both.
    let (one, two) = (at(0.5, 1.0), at(0.5, 2.0));
    assert!(one > 0.99, "one line: {one}");
    assert!(two < 0.01, "two lines: {two}");
    // Near it, the beat of 0.45 cycles a line over eight lines; a square wave's fundamental is 4/pi of a sine's.
    let (one, two) = (at(0.45, 1.0), at(0.45, 2.0));
    assert!(two < 0.25 * one, "one line: {one}, two lines: {two}");
}

#[test]
fn the_edges_of_the_picture_are_no_darker() {
    let lines = 24;
    let scene = seen(&rectangle([-100.0, 100.0], [-100.0, 100.0]), lines);
    let film = render(&scene, &interlaced((8, lines), 4, Parity::Top), Background::Black, 0);
    for pixel in film.pixels() {
        assert_eq!(pixel.radiance, Vec3::ONE);
    }
}

fn has(program: &str) -> bool {
    let found = Command::new(program).arg("-version").output().is_ok_and(|o| o.status.success());
    assert!(
        found || std::env::var_os("GRAECO_REQUIRE_ALL").is_none(),
        "{program} is missing, and every test is to be run"
    );
    found
}

/// Frames whose flags say `flags` ("interlaced,top first"), and frames that the detector took for top first, bottom
/// first, progressive.
fn judged(file: &Path, flags: &str) -> (usize, usize, [usize; 3]) {
    let out = Command::new("ffprobe")
        .args(["-v", "error", "-select_streams", "v:0", "-show_entries", "frame=interlaced_frame,top_field_first"])
        .args(["-of", "csv=p=0:nk=1"])
        .arg(file)
        .output()
        .unwrap();
    let text = String::from_utf8_lossy(&out.stdout).into_owned();
    let frames: Vec<&str> = text.lines().map(|l| l.trim_end_matches(',')).filter(|l| !l.is_empty()).collect();
    let right = frames.iter().filter(|f| **f == flags).count();
    let out = Command::new("ffmpeg")
        .args(["-hide_banner", "-nostats", "-i"])
        .arg(file)
        .args(["-vf", "idet", "-an", "-f", "null", "-"])
        .output()
        .unwrap();
    let log = String::from_utf8_lossy(&out.stderr).into_owned();
    let line = log.lines().find(|l| l.contains("Multi frame")).unwrap_or_default();
    let number = |key: &str| {
        line.split(key).nth(1).and_then(|r| r.split_whitespace().next()).and_then(|n| n.parse().ok()).unwrap_or(0)
    };
    (frames.len(), right, [number("TFF:"), number("BFF:"), number("Progressive:")])
}

#[test]
fn video_tools_take_the_rendered_train_for_what_it_is() {
    if !has("ffmpeg") || !has("ffprobe") {
        eprintln!("skipped: ffmpeg is not installed");
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let render_to = |name: &str, standard: &str| {
        let path = folder.path().join(name);
        let status = Command::new(env!("CARGO_BIN_EXE_graeco"))
            .args(["render", "animations/field.glb", "--frames", "4-13", "--runs", "1", "--bounces", "0", "--quiet"])
            .args(["--video", standard, "-o"])
            .arg(&path)
            .current_dir(env!("CARGO_MANIFEST_DIR"))
            .status()
            .unwrap();
        assert!(status.success(), "{name}");
        path
    };
    let cases = [
        ("clip.y4m", "480i", true),
        ("clip.mov", "480i", true),
        ("clip.mpg", "576i", true),
        ("clip.mp4", "480i-dv", false),
        ("clip.dv", "480i-dv", false),
    ];
    for (name, standard, top_first) in cases {
        let file = render_to(name, standard);
        let flags = if top_first { "1,1" } else { "1,0" };
        let (frames, right, verdict) = judged(&file, flags);
        assert_eq!(frames, 10, "{name}");
        assert_eq!(right, frames, "{name}: flags");
        let found = verdict[usize::from(!top_first)];
        assert!(10 * found >= 9 * frames, "{name}: judged top, bottom, progressive as {verdict:?}");
        let (_, wrong, _) = judged(&file, if top_first { "1,0" } else { "1,1" });
        assert_eq!(wrong, 0, "{name}: the other parity must not pass");
    }
}
