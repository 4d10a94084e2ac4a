//! Interlaced video as an installed ffmpeg sees it: flags, content, weaving, deinterlacing, flicker.
//!
//! Pictures are analytic functions of (x, y, t), sampled through the renderer's own footprint at each field's instant.
//! Without ffmpeg the tests say that they are skipped; with GRAECO_REQUIRE_ALL=1 that is a failure.

#![allow(
    clippy::unwrap_used,
    clippy::print_stderr,
    clippy::cast_possible_truncation,
    reason = "a test: what fails should panic, what is skipped is said, values are small"
)]

use glam::{Vec2, Vec3};
use graeco::film::{Film, Filter, FilterSpec, Footprint, Lines, PixelAccumulator};
use graeco::output::video::{BitDepth, Container, Pulldown, Sampling, Standard, YuvOptions};
use graeco::output::{Cadence, Dither, FieldOrder, Metadata, OutputTarget, Picture, PixelAspect, Record, View};
use graeco::time::{FrameRate, Parity, Shutter};
use rayon::prelude::*;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use std::sync::Arc;

/// Radiance at (x, y) pixels and `time` seconds.
type Scene<'a> = &'a (dyn Fn(f64, f64, f64) -> f64 + Sync);

/// Height of a pixel's footprint in lines, and how many places of it are looked at.
#[derive(Clone, Copy)]
struct Box1d {
    lines: f64,
    runs: u16,
}

const TWO_LINES: Box1d = Box1d { lines: 2.0, runs: 2 };

fn footprint(lines: f64) -> Footprint {
    Footprint { height: lines, ..Footprint::PROGRESSIVE }
}

/// The lines of `film` in `lines`, at one instant, through the footprint.
fn expose(film: &mut Film, lines: Lines, time: f64, scene: Scene<'_>, pixel: Box1d) {
    let filter = Filter::new(FilterSpec::BOX);
    let footprint = footprint(pixel.lines);
    let width = film.size().0 as usize;
    film.pixels_mut().par_chunks_mut(width).enumerate().for_each(|(line, row)| {
        let line = i32::try_from(line).unwrap();
        let held = match lines {
            Lines::All => true,
            Lines::Field(Parity::Top) => line % 2 == 0,
            Lines::Field(Parity::Bottom) => line % 2 == 1,
        };
        if !held {
            return;
        }
        let mut sum = PixelAccumulator::new(0);
        for (x, out) in row.iter_mut().enumerate() {
            sum.reset(0);
            for run in 0..pixel.runs {
                let v = (f32::from(run) + 0.5) / f32::from(pixel.runs);
                let (point, weight) =
                    footprint.sample(&filter, i32::try_from(x).unwrap(), line, Vec2::new(0.5, v), 0.5);
                let value = scene(point.position.x, point.position.y, time);
                sum.add(Vec3::splat(value as f32), weight);
            }
            *out = sum.estimate();
        }
    });
}

#[derive(Clone, Copy)]
struct Video {
    size: (u32, u32),
    rate: FrameRate,
    aspect: PixelAspect,
    order: FieldOrder,
}

impl Video {
    fn of(standard: Standard) -> Self {
        Self {
            size: standard.size(),
            rate: standard.rate(),
            aspect: standard.pixel_aspect(graeco::output::video::Shape::Normal),
            order: FieldOrder::Interlaced { first: standard.first() },
        }
    }

    /// Frame `frame`, its fields exposed in the order `exposed`, whatever the metadata say.
    fn frame_exposed(&self, frame: i64, scene: Scene<'_>, pixel: Box1d, exposed: FieldOrder) -> Picture {
        let mut film = Film::new(self.size.0, self.size.1, None).unwrap();
        let open = self.rate.instant(frame);
        match exposed {
            FieldOrder::Interlaced { first } => {
                for parity in [Parity::Top, Parity::Bottom] {
                    let time = self.rate.instant_of_part(frame, u32::from(parity != first), 2);
                    expose(&mut film, Lines::Field(parity), time, scene, pixel);
                }
            }
            _ => expose(&mut film, Lines::All, open, scene, pixel),
        }
        let metadata = Metadata {
            frame,
            rate: self.rate,
            exposure: Shutter { fraction: 0.0, ..Shutter::default() }.exposure(open, self.rate.period()),
            pixel_aspect: self.aspect,
            order: self.order,
            passes: None,
            record: Arc::new(Record::default()),
        };
        Picture::from_film(&film, metadata)
    }

    fn frame(&self, frame: i64, scene: Scene<'_>) -> Picture {
        self.frame_exposed(frame, scene, TWO_LINES, self.order)
    }
}

/// Bars that move by 3 pixels a field at 60 fields a second, over a slow vertical change: dependable for idet.
fn bars(x: f64, y: f64, time: f64) -> f64 {
    0.35 + 0.25 * libm::sin((x - 180.0 * time) * 0.15) + 0.05 * libm::sin(y * 0.02)
}

/// One soft bar, 40 pixels wide, that moves by 4 pixels a field at 60 fields a second.
fn bar(x: f64, _y: f64, time: f64) -> f64 {
    let d = (x - 100.0 - 240.0 * time) / 20.0;
    0.1 + 0.7 * libm::exp(-d * d)
}

fn run(program: &str, arguments: &[&str]) -> Output {
    Command::new(program).args(arguments).output().unwrap()
}

/// Whether ffmpeg and ffprobe are installed.
fn ffmpeg_is_here(test: &str) -> bool {
    let here = ["ffmpeg", "ffprobe"].iter().all(|program| Command::new(program).arg("-version").output().is_ok());
    if !here {
        assert!(std::env::var_os("GRAECO_REQUIRE_ALL").is_none_or(|v| v != "1"), "{test} needs ffmpeg and ffprobe");
        eprintln!("{test}: skipped, ffmpeg is not installed");
    }
    here
}

/// Demands the right flags on every frame, and idet's verdict on at least nine tenths of them.
fn accept(file: &Path, want: FieldOrder) -> Result<(), String> {
    let name = file.to_str().unwrap();
    let probe = run(
        "ffprobe",
        &[
            "-v",
            "error",
            "-select_streams",
            "v:0",
            "-show_entries",
            "frame=interlaced_frame,top_field_first",
            "-of",
            "csv=p=0:nk=1",
            name,
        ],
    );
    let text = String::from_utf8_lossy(&probe.stdout).into_owned();
    let flags: Vec<&str> =
        text.lines().map(|line| line.trim_end_matches(',')).filter(|line| !line.is_empty()).collect();
    let wanted = match want {
        FieldOrder::Interlaced { first: Parity::Top } => "1,1",
        FieldOrder::Interlaced { first: Parity::Bottom } => "1,0",
        _ => "0,0",
    };
    if flags.is_empty() || flags.iter().any(|&flag| flag != wanted) {
        return Err(format!("{name}: flags {flags:?}, want {wanted}"));
    }
    let idet = run("ffmpeg", &["-hide_banner", "-nostats", "-i", name, "-vf", "idet", "-an", "-f", "null", "-"]);
    let text = String::from_utf8_lossy(&idet.stderr).into_owned();
    let line = text.lines().find(|line| line.contains("Multi frame")).ok_or_else(|| format!("{name}: {text}"))?;
    let counts: Vec<usize> =
        line.split([':', ' ']).filter(|word| !word.is_empty()).filter_map(|word| word.parse().ok()).collect();
    let got = match want {
        FieldOrder::Interlaced { first: Parity::Top } => counts[0],
        FieldOrder::Interlaced { first: Parity::Bottom } => counts[1],
        _ => counts[2],
    };
    if got * 10 < flags.len() * 9 {
        return Err(format!("{name}: idet T/B/P/U {counts:?} of {}, want {want:?}", flags.len()));
    }
    eprintln!("{name}: {} frames {wanted}, idet T/B/P/U {counts:?}", flags.len());
    Ok(())
}

fn write_y4m(path: &Path, options: YuvOptions, pictures: impl IntoIterator<Item = Picture>) {
    let mut target = OutputTarget::y4m(path, options, Cadence::Native).unwrap();
    for picture in pictures {
        target.accept(picture).unwrap();
    }
    target.finish().unwrap();
}

fn write_video(path: &Path, pictures: &[Picture]) {
    let container = Container::of(path).unwrap();
    let options = container.yuv_options(View::default(), pictures[0].size.1);
    let mut target = OutputTarget::video(path, container, options, Cadence::Native, "ffmpeg").unwrap();
    for picture in pictures {
        target.accept(picture.clone()).unwrap();
    }
    assert_eq!(target.finish().unwrap(), [path]);
}

/// Every file kind that can hold the standard passes; so do the Y4M samplings.
fn standard_is_accepted(standard: Standard, kinds: &[&str]) {
    if !ffmpeg_is_here(&standard.to_string()) {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let video = Video::of(standard);
    let pictures: Vec<Picture> = (0..10).map(|frame| video.frame(frame, &bars)).collect();
    for sampling in [Sampling::S422, Sampling::S420] {
        let path = folder.path().join(format!("{sampling:?}.y4m"));
        write_y4m(&path, YuvOptions { sampling, ..YuvOptions::for_lines(video.size.1) }, pictures.iter().cloned());
        accept(&path, video.order).unwrap();
    }
    for kind in kinds {
        let path = folder.path().join(format!("clip.{kind}"));
        write_video(&path, &pictures);
        accept(&path, video.order).unwrap();
        let names = run(
            "ffprobe",
            &[
                "-v",
                "error",
                "-select_streams",
                "v:0",
                "-show_entries",
                "stream=width,height,r_frame_rate,sample_aspect_ratio",
                "-of",
                "csv=p=0",
                path.to_str().unwrap(),
            ],
        );
        let (frames, seconds) = video.rate.parts();
        let text = String::from_utf8_lossy(&names.stdout).into_owned();
        let words: Vec<&str> = text.trim().split(',').collect();
        assert_eq!(words[..2], [video.size.0.to_string(), video.size.1.to_string()], "{kind}");
        assert_eq!(words[2], video.aspect.to_string(), "{kind}");
        assert_eq!(words[3], format!("{frames}/{seconds}"), "{kind}");
    }
}

#[test]
fn ntsc_dvd_is_accepted() {
    standard_is_accepted(Standard::I480, &["mov", "mp4", "mkv", "mpg"]);
}

#[test]
fn ntsc_dv_is_accepted() {
    standard_is_accepted(Standard::I480Dv, &["mov", "mp4", "mpg", "dv", "avi"]);
}

#[test]
fn pal_dvd_is_accepted() {
    standard_is_accepted(Standard::I576, &["mov", "mp4", "mpg"]);
}

#[test]
fn pal_dv_is_accepted() {
    standard_is_accepted(Standard::I576Dv, &["mov", "mp4", "mpg", "dv", "avi"]);
}

#[test]
fn high_definition_at_50_is_accepted() {
    standard_is_accepted(Standard::I1080At50, &["mov", "mp4", "mpg"]);
}

#[test]
fn high_definition_at_5994_is_accepted() {
    standard_is_accepted(Standard::I1080At5994, &["mov", "mp4", "mpg"]);
}

#[test]
fn progressive_video_is_accepted() {
    if !ffmpeg_is_here("progressive") {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let video = Video {
        size: (640, 360),
        rate: FrameRate::CINEMA,
        aspect: PixelAspect::SQUARE,
        order: FieldOrder::Progressive,
    };
    let pictures: Vec<Picture> = (0..10).map(|frame| video.frame(frame, &bars)).collect();
    for kind in ["mp4", "mov", "mkv", "mpg"] {
        let path = folder.path().join(format!("clip.{kind}"));
        write_video(&path, &pictures);
        accept(&path, FieldOrder::Progressive).unwrap();
    }
}

/// Fields whose instants are swapped, fields without flags, flags without fields: each must fail.
#[test]
fn wrong_parity_is_found_out() {
    if !ffmpeg_is_here("wrong parity") {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let top = FieldOrder::Interlaced { first: Parity::Top };
    let bottom = FieldOrder::Interlaced { first: Parity::Bottom };
    for (flagged, exposed) in
        [(top, bottom), (bottom, top), (FieldOrder::Progressive, top), (top, FieldOrder::Progressive)]
    {
        let video = Video { order: flagged, ..Video::of(Standard::I480) };
        let path = folder.path().join("wrong.y4m");
        let pictures = (0..10).map(|frame| video.frame_exposed(frame, &bars, TWO_LINES, exposed));
        write_y4m(&path, YuvOptions::for_lines(480), pictures);
        assert!(accept(&path, flagged).is_err(), "{flagged:?} exposed as {exposed:?}");
        assert!(accept(&path, exposed).is_err(), "{exposed:?} flagged as {flagged:?}");
    }
}

/// The raw frames of a file, as ffmpeg decodes them after `filter`.
fn decoded(file: &Path, filter: &str, pixels: &str) -> Vec<u8> {
    let output = run(
        "ffmpeg",
        &["-v", "error", "-i", file.to_str().unwrap(), "-vf", filter, "-f", "rawvideo", "-pix_fmt", pixels, "-"],
    );
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    output.stdout
}

/// Progressive pictures at the field rate with the same footprint, woven by ffmpeg, are our interlaced frames bit for bit,
/// dither included.
#[test]
fn weaving_by_ffmpeg_gives_our_frames_bit_for_bit() {
    if !ffmpeg_is_here("weave oracle") {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    for (standard, filter) in
        [(Standard::I480, "tinterlace=interleave_top"), (Standard::I576Dv, "tinterlace=interleave_bottom")]
    {
        let interlaced = Video::of(standard);
        let progressive = Video { rate: interlaced.rate.fields(), order: FieldOrder::Progressive, ..interlaced };
        let options = YuvOptions { dither: Dither::On, ..YuvOptions::for_lines(interlaced.size.1) };
        let (fields, frames) = (folder.path().join("p.y4m"), folder.path().join("i.y4m"));
        write_y4m(&fields, options, (0..10).map(|frame| progressive.frame(frame, &bars)));
        write_y4m(&frames, options, (0..5).map(|frame| interlaced.frame(frame, &bars)));
        let woven = decoded(&fields, filter, "yuv422p");
        let ours = decoded(&frames, "null", "yuv422p");
        assert_eq!(ours.len(), 5 * 2 * 720 * interlaced.size.1 as usize);
        assert!(woven == ours, "{standard}: woven frames differ");
    }
}

/// Horizontal centre of the bar in each grey frame.
fn centres(grey: &[u8], size: (u32, u32)) -> Vec<f64> {
    let (width, height) = (size.0 as usize, size.1 as usize);
    grey.chunks_exact(width * height)
        .map(|frame| {
            let (mut sum, mut moment) = (0.0, 0.0);
            for line in frame.chunks_exact(width) {
                let base = f64::from(*line.iter().min().unwrap()) + 20.0;
                for (x, &code) in line.iter().enumerate() {
                    let value = (f64::from(code) - base).max(0.0);
                    sum += value;
                    moment += value * x as f64;
                }
            }
            moment / sum
        })
        .collect()
}

/// bwdif gives a frame a field, and the bar moves on by 4 pixels in each; with the wrong parity it runs backwards.
#[test]
fn deinterlacing_doubles_the_rate_with_steady_motion() {
    if !ffmpeg_is_here("bwdif") {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("bar.y4m");
    for standard in [Standard::I480, Standard::I480Dv] {
        let video = Video::of(standard);
        let swapped = match standard.first() {
            Parity::Top => FieldOrder::Interlaced { first: Parity::Bottom },
            Parity::Bottom => FieldOrder::Interlaced { first: Parity::Top },
        };
        for (exposed, steady) in [(video.order, true), (swapped, false)] {
            write_y4m(
                &path,
                YuvOptions::for_lines(480),
                (0..10).map(|n| video.frame_exposed(n, &bar, TWO_LINES, exposed)),
            );
            let centres = centres(&decoded(&path, "bwdif=1", "gray"), video.size);
            assert_eq!(centres.len(), 20);
            let steps: Vec<f64> = centres[2..18].windows(2).map(|pair| pair[1] - pair[0]).collect();
            assert_eq!(steps.iter().all(|&step| step > 0.0), steady, "{standard}: {steps:?}");
            if steady {
                // 240 pixels a second over 60000/1001 fields: 4.004 each; half a pixel for bwdif's guesses.
                assert!(steps.iter().all(|step| (step - 4.004).abs() < 0.5), "{standard}: {steps:?}");
            } else {
                assert!(steps.iter().any(|&step| step < -2.0), "{standard}: {steps:?}");
            }
        }
    }
}

/// Largest difference of the fields' mean radiance over windows of `window` lines.
fn flicker(scene: Scene<'_>, pixel: Box1d, window: usize) -> f64 {
    let lines = 480;
    let mut film = Film::new(1, lines, None).unwrap();
    expose(&mut film, Lines::All, 0.0, scene, pixel);
    let values: Vec<f64> = film.pixels().iter().map(|p| f64::from(p.radiance.x)).collect();
    let mean = |part: &[f64], parity: usize| part.iter().skip(parity).step_by(2).sum::<f64>() / (part.len() / 2) as f64;
    values.windows(window).map(|part| (mean(part, 0) - mean(part, 1)).abs()).fold(0.0, f64::max)
}

/// The table of field-to-field differences of a still grating of contrast 1: lines sampled at a point, one line high,
/// two lines high.
#[test]
fn gratings_flicker_as_the_box_predicts() {
    // The phase puts the crest of 0.45's beat, which is ten lines long, at the middle of some window of eight.
    let sine = |frequency: f64| {
        let phase = (0.5 - frequency) * std::f64::consts::PI;
        move |_: f64, y: f64, _: f64| 0.5 + 0.5 * libm::cos(2.0 * std::f64::consts::PI * frequency * (y - 0.5) + phase)
    };
    // Bright lines of one line's height, as a square wave of half a cycle a line.
    let square = |_: f64, y: f64, _: f64| if y.rem_euclid(2.0) < 1.0 { 1.0 } else { 0.0 };
    let half = sine(0.5);
    let near = sine(0.45);
    let cases: [(&str, Scene<'_>, usize, [f64; 3]); 3] = [
        ("sine, 0.5 cycles a line", &half, 480, [1.000, 0.637, 0.000]),
        ("square, 0.5 cycles a line", &square, 480, [1.000, 1.000, 0.000]),
        ("sine, 0.45 cycles a line, 8 lines", &near, 8, [0.760, 0.531, 0.083]),
    ];
    for (name, scene, window, wanted) in cases {
        let boxes = [Box1d { lines: 1.0, runs: 1 }, Box1d { lines: 1.0, runs: 64 }, Box1d { lines: 2.0, runs: 64 }];
        let got = boxes.map(|pixel| flicker(scene, pixel, window));
        eprintln!("{name}: point {:.3}, 1 line {:.3}, 2 lines {:.3}", got[0], got[1], got[2]);
        for (g, w) in got.into_iter().zip(wanted) {
            assert!((g - w).abs() < 0.005, "{name}: {got:?}, want {wanted:?}");
        }
    }
}

/// The same as ffmpeg measures it: mean luma of separate fields of a still grating.
#[test]
fn ffmpeg_sees_no_flicker_of_two_line_fields() {
    if !ffmpeg_is_here("flicker") {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("grating.y4m");
    let grating = |_: f64, y: f64, _: f64| 0.5 + 0.5 * libm::cos(std::f64::consts::PI * (y - 0.5));
    let video = Video::of(Standard::I480);
    let differences = [TWO_LINES, Box1d { lines: 1.0, runs: 1 }].map(|pixel| {
        write_y4m(
            &path,
            YuvOptions::for_lines(480),
            (0..3).map(|n| video.frame_exposed(n, &grating, pixel, video.order)),
        );
        let output = run(
            "ffmpeg",
            &[
                "-v",
                "error",
                "-i",
                path.to_str().unwrap(),
                "-vf",
                "separatefields,signalstats,metadata=print:key=lavfi.signalstats.YAVG:file=-",
                "-an",
                "-f",
                "null",
                "-",
            ],
        );
        let text = String::from_utf8_lossy(&output.stdout).into_owned();
        let means: Vec<f64> =
            text.lines().filter_map(|line| line.strip_prefix("lavfi.signalstats.YAVG=")?.parse().ok()).collect();
        assert_eq!(means.len(), 6);
        means.windows(2).map(|pair| (pair[1] - pair[0]).abs()).fold(0.0, f64::max) / 219.0
    });
    assert!(differences[0] < 0.01, "{differences:?}");
    assert!(differences[1] > 0.99, "the check itself: {differences:?}");
}

/// A pixel of the first or last line looks half outside the picture, where the scene goes on: nothing darkens.
#[test]
fn top_and_bottom_lines_are_as_bright_as_the_rest() {
    let grey = |_: f64, _: f64, _: f64| 0.5;
    let ramp = |_: f64, y: f64, _: f64| (y + 10.0) / 100.0;
    for lines in [1.0, 1.5, 2.0] {
        for parity in [Parity::Top, Parity::Bottom] {
            let mut film = Film::new(2, 8, None).unwrap();
            expose(&mut film, Lines::Field(parity), 0.0, &grey, Box1d { lines, runs: 16 });
            for (index, pixel) in film.pixels().iter().enumerate() {
                let held = (index / 2) % 2 == usize::from(parity == Parity::Bottom);
                assert_eq!(pixel.radiance, if held { Vec3::splat(0.5) } else { Vec3::ZERO });
            }
        }
        let mut film = Film::new(1, 8, None).unwrap();
        expose(&mut film, Lines::All, 0.0, &ramp, Box1d { lines, runs: 16 });
        for (line, pixel) in (0_u8..).zip(film.pixels()) {
            assert!((f64::from(pixel.radiance.x) - (f64::from(line) + 10.5) / 100.0).abs() < 1e-6);
        }
    }
}

/// ffmpeg's inverse telecine finds the film frames again, bit for bit.
#[test]
fn pulldown_is_undone_exactly() {
    if !ffmpeg_is_here("pulldown") {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let (video_path, film_path) = (folder.path().join("v.y4m"), folder.path().join("f.y4m"));
    let film = Video {
        rate: FrameRate::new(24_000, 1001).unwrap(),
        order: FieldOrder::Progressive,
        ..Video::of(Standard::I480)
    };
    let options = YuvOptions { dither: Dither::Off, ..YuvOptions::for_lines(480) };
    write_y4m(&film_path, options, (0..16).map(|frame| film.frame(frame, &bars)));
    for (first, order) in [(Parity::Top, "tff"), (Parity::Bottom, "bff")] {
        let mut target = OutputTarget::y4m(&video_path, options, Cadence::Pulldown(first)).unwrap();
        for frame in 0..16 {
            target.accept(film.frame(frame, &bars)).unwrap();
        }
        target.finish().unwrap();
        let size = 2 * 720 * 480;
        assert_eq!(decoded(&video_path, "null", "yuv422p").len(), 20 * size);
        let found = decoded(&video_path, &format!("fieldmatch=order={order}:combmatch=full,decimate"), "yuv422p");
        let wanted = decoded(&film_path, "null", "yuv422p");
        assert_eq!(found.len(), 16 * size, "{order}");
        assert!(found == wanted, "{order}");
    }
    assert_eq!(Pulldown::rate(film.rate).unwrap(), FrameRate::new(30_000, 1001).unwrap());
}

/// A program that stands for ffmpeg.
fn program(folder: &Path, script: &str) -> PathBuf {
    use std::os::unix::fs::PermissionsExt;
    let path = folder.join("ffmpeg-like");
    std::fs::write(&path, format!("#!/bin/sh\n[ \"$1\" = -version ] && exit 0\n{script}\n")).unwrap();
    std::fs::set_permissions(&path, std::fs::Permissions::from_mode(0o755)).unwrap();
    path
}

#[test]
fn a_missing_or_dying_ffmpeg_is_one_clear_sentence() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("clip.mp4");
    let options = Container::Mp4.yuv_options(View::default(), 64);
    let start = |program: &str| OutputTarget::video(&path, Container::Mp4, options, Cadence::Native, program);
    let message = start("no-such-ffmpeg").unwrap_err().to_string();
    assert!(message.contains("not found") && message.contains("apt install ffmpeg"), "{message}");

    let dying = program(folder.path(), "head -c 5000 > /dev/null; echo 'first' >&2; echo 'No space left' >&2; exit 3");
    let mut target = start(dying.to_str().unwrap()).unwrap();
    let video =
        Video { size: (64, 64), rate: FrameRate::CINEMA, aspect: PixelAspect::SQUARE, order: FieldOrder::Progressive };
    // A pipe holds some frames; the death shows when it is full, or at the end.
    let failed = (0..100).map(|n| target.accept(video.frame(n, &bars))).find_map(Result::err);
    let message = failed.expect("the death must show").to_string();
    assert!(
        message.starts_with("ffmpeg: ended with exit status: 3") && message.ends_with("No space left"),
        "{message}"
    );
    assert!(!message.contains('\n'));
}

/// DV holds two pictures only; anything else is refused before ffmpeg is asked.
#[test]
fn dv_of_other_sizes_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let idle = program(folder.path(), "cat > /dev/null");
    let video = Video::of(Standard::I480);
    let path = folder.path().join("a.dv");
    let options = Container::Dv.yuv_options(View::default(), 480);
    let mut target =
        OutputTarget::video(&path, Container::Dv, options, Cadence::Native, idle.to_str().unwrap()).unwrap();
    let message = target.accept(video.frame(0, &bar)).unwrap_err().to_string();
    assert!(message.contains("bottom field first"), "{message}");
    assert_eq!((options.sampling, options.depth), (Sampling::S411, BitDepth::Eight));
}
