//! Files written and read back: EXR, PNG, YUV4MPEG2, sequences, resuming, checking.

#![allow(
    clippy::unwrap_used,
    clippy::print_stderr,
    clippy::cast_possible_truncation,
    reason = "a test: what fails should panic, what is skipped is said, values are small"
)]

use graeco::film::Window;
use graeco::output::check::{self, Problem};
use graeco::output::manifest::{FrameLine, Line, SequenceLine};
use graeco::output::video::{BitDepth, Pulldown, Sampling, Y4mWriter, YuvOptions, separate, weave};
use graeco::output::{
    Cadence, Destination, Dither, ExrDepth, FieldFiles, FieldOrder, FrameFormat, FrameStats, Manifest, Metadata,
    OutputTarget, Picture, PixelAspect, Plane, PngDepth, PngOptions, Record, exr, png, read,
};
use graeco::time::{Exposure, FrameRate, Parity};
use std::io::Write;
use std::path::{Path, PathBuf};
use std::sync::Arc;

fn record(seed: u64) -> Arc<Record> {
    Arc::new(Record::new(serde_json::json!({ "runs": 64, "camera": "Größe" }), &[7; 32], seed))
}

fn metadata(frame: i64, order: FieldOrder) -> Metadata {
    Metadata {
        frame,
        rate: FrameRate::new(30_000, 1001).unwrap(),
        exposure: Exposure { open: 1.5, close: 1.5 + 1.0 / 120.0 },
        pixel_aspect: PixelAspect { width: 10, height: 11 },
        order,
        passes: None,
        record: record(1),
    }
}

/// A picture whose pixel (x, y) is `colour(x, y)`.
fn picture(size: (u32, u32), frame: i64, order: FieldOrder, colour: impl Fn(u32, u32) -> [f32; 3]) -> Picture {
    let rgb = (0..size.1).flat_map(|y| (0..size.0).map(move |x| (x, y))).map(|(x, y)| colour(x, y)).collect();
    let metadata = metadata(frame, order);
    Picture { size, window: Window::whole(size.0, size.1), rgb, alpha: None, planes: Vec::new(), metadata }
}

fn bits(rgb: &[[f32; 3]]) -> Vec<[u32; 3]> {
    rgb.iter().map(|c| c.map(f32::to_bits)).collect()
}

const ODD: [f32; 8] = [0.0, -0.0, 1e-42, -3e-39, f32::MAX, 1.0e-7, 65_504.0, -12.625];

#[test]
fn float_exr_keeps_every_bit_and_the_window() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.exr");
    let mut original = picture((8, 1), -3, FieldOrder::Progressive, |x, _| [ODD[x as usize], 1.0, -0.0]);
    original.alpha = Some(vec![0.5; 8]);
    original.planes = vec![
        Plane { name: "depth.Z".to_owned(), samples: vec![f32::INFINITY; 8] },
        Plane { name: "motion.forward.X".to_owned(), samples: ODD.to_vec() },
    ];
    original.size = (20, 10);
    original.window = Window { x: 5, y: 7, width: 8, height: 1 };
    std::fs::write(&path, exr::encode(&original, ExrDepth::Float, &path).unwrap()).unwrap();
    let loaded = read::read(&path).unwrap();
    assert_eq!((loaded.size, loaded.window), (original.size, original.window));
    assert_eq!(bits(&loaded.rgb), bits(&original.rgb));
    assert_eq!(loaded.alpha, original.alpha);
    assert_eq!(loaded.planes, original.planes);
    assert_eq!(loaded.stored.frame, Some(-3));
    assert_eq!(loaded.stored.order, Some(FieldOrder::Progressive));
    assert_eq!(loaded.stored.settings_hash.as_deref(), Some(original.metadata.record.settings_hash.as_str()));
    let settings: serde_json::Value = serde_json::from_str(&loaded.stored.settings.unwrap()).unwrap();
    assert_eq!(settings, original.metadata.record.settings);
}

#[test]
fn half_exr_rounds_to_nearest_with_denormals_and_signs() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.exr");
    let values = [0.0, -0.0, 5.96e-8, -6.0e-8, 1.0 / 3.0, 6.0e-5, 65_504.0, 1e9];
    let original = picture((8, 1), 0, FieldOrder::Progressive, |x, _| [values[x as usize]; 3]);
    std::fs::write(&path, exr::encode(&original, ExrDepth::Half, &path).unwrap()).unwrap();
    let loaded = read::read(&path).unwrap();
    for (got, want) in loaded.rgb.iter().zip(values) {
        assert_eq!(got[0].to_bits(), half::f16::from_f32(want).to_f32().to_bits(), "{want}");
    }
}

#[test]
fn equal_pictures_are_equal_exr_bytes() {
    let encode = || {
        let original =
            picture((16, 9), 12, FieldOrder::Interlaced { first: Parity::Top }, |x, y| [x as f32, y as f32, 1.0]);
        exr::encode(&original, ExrDepth::Half, Path::new("a.exr")).unwrap()
    };
    let first = encode();
    // The encoder's hash maps order their keys anew each time.
    assert!((0..8).all(|_| encode() == first));
}

#[test]
fn exr_headers_carry_time_and_colour() {
    use ::exr::prelude::ReadChannels;
    use ::exr::prelude::ReadLayers;
    let mut original =
        picture((4, 4), 47, FieldOrder::Separate { parity: Parity::Bottom, first: Parity::Top }, |_, _| [0.5; 3]);
    original.metadata.exposure = Exposure { open: 2.0, close: 2.0078125 };
    let bytes = exr::encode(&original, ExrDepth::Half, Path::new("a.exr")).unwrap();
    let image = ::exr::prelude::read()
        .no_deep_data()
        .largest_resolution_level()
        .all_channels()
        .first_valid_layer()
        .all_attributes()
        .from_buffered(std::io::Cursor::new(bytes))
        .unwrap();
    assert!((image.attributes.pixel_aspect - 10.0 / 11.0).abs() < 1e-7);
    let code = image.attributes.time_code.unwrap();
    assert_eq!((code.seconds, code.frame, code.field_phase), (1, 17, true));
    assert!(image.attributes.chromaticities.is_some());
    assert_eq!(image.layer_data.attributes.frames_per_second, Some((30_000, 1001)));
    assert_eq!(image.layer_data.attributes.exposure, Some(0.0078125));
    assert!(image.layer_data.attributes.software_name.unwrap().to_string().starts_with("graeco "));
}

#[test]
fn png_keeps_what_is_shown_to_half_a_code() {
    let folder = tempfile::tempdir().unwrap();
    for (depth, codes) in [(PngDepth::Eight, 255.0_f32), (PngDepth::Sixteen, 65_535.0)] {
        let path = folder.path().join("a.png");
        let original = picture((64, 4), 5, FieldOrder::Progressive, |x, y| [x as f32 / 63.0, y as f32 / 3.0, 0.18]);
        let options = PngOptions { depth, ..PngOptions::default() };
        std::fs::write(&path, png::encode(&original, options, &path).unwrap()).unwrap();
        let loaded = read::read(&path).unwrap();
        for (got, want) in loaded.rgb.iter().zip(&original.rgb) {
            for (g, w) in got.iter().zip(want) {
                // The curve's inverse is steepest at 1, where it is 2.28.
                assert!((g - w).abs() <= 0.5 / codes * 2.3 + 1e-6, "{g} {w}");
            }
        }
        assert_eq!(loaded.stored.frame, Some(5));
        assert_eq!(loaded.stored.settings_hash.as_deref(), Some(original.metadata.record.settings_hash.as_str()));
    }
    let bytes = std::fs::read(folder.path().join("a.png")).unwrap();
    let info = ::png::Decoder::new(std::io::Cursor::new(bytes)).read_info().unwrap().info().clone();
    let dims = info.pixel_dims.unwrap();
    // Pixels 10 wide and 11 high: 11 of them across span what 10 do down.
    assert_eq!((dims.xppu, dims.yppu), (11, 10));
    assert!(info.srgb.is_some());
}

fn exr_target(folder: &Path, frames: usize) -> OutputTarget {
    let pattern = format!("{}/a.##.exr", folder.display()).parse().unwrap();
    OutputTarget::frames(pattern, FrameFormat::Exr(ExrDepth::Half), FieldFiles::Woven, frames).unwrap()
}

#[test]
fn resuming_skips_only_whole_frames_of_the_same_settings() {
    let folder = tempfile::tempdir().unwrap();
    let mut target = exr_target(folder.path(), 3);
    let hash = record(1).settings_hash.clone();
    for frame in 0..2 {
        let files =
            target.accept(picture((32, 16), frame, FieldOrder::Progressive, |x, y| [(x * y) as f32; 3])).unwrap();
        assert_eq!(files, [folder.path().join(format!("a.{frame:02}.exr"))]);
    }
    let done = |frame, hash: &str| target.is_finished(frame, FieldOrder::Progressive, hash);
    assert!(done(0, &hash) && done(1, &hash));
    assert!(!done(2, &hash), "missing");
    assert!(!done(0, &record(2).settings_hash), "another seed");
    let path = folder.path().join("a.01.exr");
    let bytes = std::fs::read(&path).unwrap();
    for length in [0, 4, 100, bytes.len() / 2, bytes.len() - 1] {
        std::fs::write(&path, &bytes[..length]).unwrap();
        assert!(!done(1, &hash), "truncated to {length}");
    }
}

#[test]
fn separate_fields_are_two_files_of_half_the_height() {
    let folder = tempfile::tempdir().unwrap();
    let pattern = format!("{}/a.##.png", folder.path().display()).parse().unwrap();
    let format = FrameFormat::Png(PngOptions::default());
    let mut target = OutputTarget::frames(pattern, format, FieldFiles::Separate, 2).unwrap();
    let order = FieldOrder::Interlaced { first: Parity::Bottom };
    let files = target.accept(picture((4, 8), 1, order, |_, y| [(y % 2) as f32; 3])).unwrap();
    // In order of time.
    assert_eq!(files, ["a.01.bottom.png", "a.01.top.png"].map(|name| folder.path().join(name)));
    for (path, value) in files.iter().zip([1.0, 0.0]) {
        let field = read::read(path).unwrap();
        assert_eq!(field.size, (4, 4));
        assert!(field.rgb.iter().flatten().all(|c| c.to_bits() == f32::to_bits(value)));
    }
    assert!(target.is_finished(1, order, &record(1).settings_hash));
}

#[test]
fn a_folder_is_checked_against_its_manifest() {
    let folder = tempfile::tempdir().unwrap();
    let mut target = exr_target(folder.path(), 6);
    let pattern: graeco::output::Pattern = format!("{}/a.##.exr", folder.path().display()).parse().unwrap();
    let manifest = Manifest::beside(&pattern);
    assert_eq!(manifest.path(), folder.path().join("a.manifest.jsonl"));
    let run = SequenceLine {
        pattern: pattern.without_folder().to_string(),
        frames: (0..6).collect(),
        size: (32, 16),
        record: (*record(1)).clone(),
    };
    manifest.append(&Line::Sequence(run)).unwrap();
    for frame in 0..5 {
        let size = if frame == 3 { (32, 8) } else { (32, 16) };
        let mut made = picture(size, frame, FieldOrder::Progressive, |x, y| [(x + y) as f32; 3]);
        if frame == 2 {
            let settings = serde_json::json!({ "runs": 16, "camera": "Größe" });
            made.metadata.record = Arc::new(Record::new(settings, &[7; 32], 1));
        }
        let settings_hash = made.metadata.record.settings_hash.clone();
        let files = target.accept(made).unwrap();
        let files = files.iter().map(|path| path.file_name().unwrap().to_string_lossy().into_owned()).collect();
        let stats = FrameStats { frame, samples: 1, ..FrameStats::default() };
        manifest.append(&Line::Frame(FrameLine { frame, files, settings_hash, stats })).unwrap();
    }
    let broken = folder.path().join("a.04.exr");
    let bytes = std::fs::read(&broken).unwrap();
    std::fs::write(&broken, &bytes[..bytes.len() - 10]).unwrap();
    // A crash while appending leaves half a line; the next append must not be lost to it.
    let mut file = std::fs::OpenOptions::new().append(true).open(manifest.path()).unwrap();
    file.write_all(b"{\"kind\":\"fra").unwrap();
    drop(file);
    manifest
        .append(&Line::Frame(FrameLine {
            frame: 0,
            files: vec!["a.00.exr".to_owned()],
            settings_hash: record(1).settings_hash.clone(),
            stats: FrameStats::default(),
        }))
        .unwrap();
    assert_eq!(graeco::output::manifest::read(manifest.path()).unwrap().len(), 7);

    for with_manifest in [true, false] {
        if !with_manifest {
            // Without it only the hole's end is unknown: frame 5 is beyond the last file.
            std::fs::remove_file(manifest.path()).unwrap();
        }
        let report = check::check(folder.path()).unwrap();
        assert_eq!(report.len(), 1);
        let found: Vec<(i64, &Problem)> = report[0].findings.iter().map(|f| (f.frame, &f.problem)).collect();
        assert_eq!(found[0].0, 2);
        assert_eq!(*found[0].1, Problem::OtherSettings { differing: vec!["runs".to_owned()] });
        assert_eq!(found[1], (3, &Problem::WrongSize { found: (32, 8), expected: (32, 16) }));
        assert!(matches!(found[2], (4, Problem::Corrupt { .. })), "{found:?}");
        assert_eq!(found.get(3), if with_manifest { Some(&(5, &Problem::Missing)) } else { None });
    }
    std::fs::remove_file(folder.path().join("a.01.exr")).unwrap();
    let report = check::check(folder.path()).unwrap();
    assert_eq!((report[0].findings[0].frame, &report[0].findings[0].problem), (1, &Problem::Missing));
    // What only the caller knows of: the frame after the last.
    let report = check::check_frames(folder.path(), &[0, 6]).unwrap();
    let found: Vec<(i64, &Problem)> = report[0].findings.iter().map(|f| (f.frame, &f.problem)).collect();
    assert_eq!((report[0].expected, found), (2, vec![(6, &Problem::Missing)]));
}

#[test]
fn destinations_are_known_by_their_names() {
    assert_eq!(Destination::parse("-").unwrap(), Destination::Stdout);
    assert_eq!(Destination::parse("a.y4m").unwrap(), Destination::Y4m(PathBuf::from("a.y4m")));
    assert!(matches!(Destination::parse("out/a.####.PNG").unwrap(), Destination::Frames(_)));
    assert!(matches!(Destination::parse("a.mov").unwrap(), Destination::Video(_, _)));
    for bad in ["a.jpg", "a", "out/", "a.####.tga"] {
        assert!(Destination::parse(bad).is_err(), "{bad}");
    }
}

fn y4m(pictures: &[Picture], sampling: Sampling, depth: BitDepth) -> Vec<u8> {
    let options = YuvOptions { sampling, depth, dither: Dither::Off, ..YuvOptions::for_lines(480) };
    let mut writer = Y4mWriter::new(Vec::new(), "test", options).unwrap();
    for picture in pictures {
        writer.write(picture).unwrap();
    }
    writer.finish().unwrap()
}

/// White, black, red and blue by hand: BT.601 of red is Y' 0.299, Cb −0.299/1.772, Cr ½.
#[test]
fn y4m_bytes_are_those_worked_out_by_hand() {
    let colours = [[1.0, 1.0, 1.0], [0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]];
    let original = picture((4, 2), 0, FieldOrder::Interlaced { first: Parity::Top }, |x, _| colours[x as usize]);
    let bytes = y4m(&[original.clone(), original.clone()], Sampling::S444, BitDepth::Eight);
    let header = b"YUV4MPEG2 W4 H2 F30000:1001 It A10:11 C444 XCOLORRANGE=LIMITED\n";
    let luma = [235, 16, 81, 41].repeat(2);
    let blue = [128, 128, 90, 240].repeat(2);
    let red = [128, 128, 240, 110].repeat(2);
    let frame = [b"FRAME\n".to_vec(), luma, blue, red].concat();
    assert_eq!(bytes, [header.to_vec(), frame.clone(), frame].concat());

    let ten = y4m(&[original], Sampling::S422, BitDepth::Ten);
    let header = b"YUV4MPEG2 W4 H2 F30000:1001 It A10:11 C422p10 XCOLORRANGE=LIMITED\nFRAME\n";
    assert_eq!(&ten[..header.len()], header);
    assert_eq!(ten.len(), header.len() + 2 * (8 + 4 + 4));
    // 940 and 64, low byte first.
    assert_eq!(ten[header.len()..header.len() + 4], [0xac, 3, 64, 0]);
    // The chroma sample on column 2 is red's twice and its neighbours' black and blue once, in quarters.
    let cb: f64 = 512.0 + 896.0 * (-0.299 / 1.772 * 2.0 + 0.0 + 0.5) / 4.0;
    let start = header.len() + 16 + 2;
    assert!((f64::from(u16::from_le_bytes([ten[start], ten[start + 1]])) - cb).abs() <= 0.5);
}

/// The fields differ in colour only: no chroma sample of either may hold any of the other.
#[test]
fn interlaced_420_is_subsampled_in_each_field() {
    let order = FieldOrder::Interlaced { first: Parity::Bottom };
    let colour = |y: u32| if y.is_multiple_of(2) { [1.0, 0.0, 0.0] } else { [0.0, 0.0, 1.0] };
    let bytes = y4m(&[picture((4, 8), 0, order, |_, y| colour(y))], Sampling::S420, BitDepth::Eight);
    let planes = &bytes[bytes.windows(6).position(|w| w == b"FRAME\n").unwrap() + 6..];
    let (blue, red) = (&planes[32..40], &planes[40..48]);
    assert_eq!(blue, [90, 90, 240, 240, 90, 90, 240, 240]);
    assert_eq!(red, [240, 240, 110, 110, 240, 240, 110, 110]);
    let progressive =
        y4m(&[picture((4, 8), 0, FieldOrder::Progressive, |_, y| colour(y))], Sampling::S420, BitDepth::Eight);
    let planes = &progressive[progressive.windows(6).position(|w| w == b"FRAME\n").unwrap() + 6..];
    assert!(planes[32..40].iter().all(|&code| code == 165), "{:?}", &planes[32..40]);
}

#[test]
fn sizes_that_cannot_be_sampled_are_refused() {
    let interlaced = FieldOrder::Interlaced { first: Parity::Top };
    for (size, order, sampling) in [
        ((4, 5), interlaced, Sampling::S444),
        ((4, 6), interlaced, Sampling::S420),
        ((5, 4), interlaced, Sampling::S422),
        ((6, 4), FieldOrder::Progressive, Sampling::S411),
        ((4, 3), FieldOrder::Progressive, Sampling::S420),
    ] {
        let mut writer =
            Y4mWriter::new(Vec::new(), "t", YuvOptions { sampling, ..YuvOptions::for_lines(480) }).unwrap();
        let message = writer.write(&picture(size, 0, order, |_, _| [0.0; 3])).unwrap_err().to_string();
        assert!(message.contains("multiple"), "{message}");
    }
}

#[test]
fn separated_fields_weave_back() {
    for first in [Parity::Top, Parity::Bottom] {
        let mut frame = picture((3, 6), 9, FieldOrder::Interlaced { first }, |x, y| [x as f32, y as f32, 0.0]);
        frame.planes.push(Plane { name: "depth.Z".to_owned(), samples: (0..18_u8).map(f32::from).collect() });
        let [earlier, later] = separate(&frame).unwrap();
        assert_eq!(weave(&earlier, &later).unwrap(), frame);
        assert!(weave(&later, &earlier).is_err(), "the wrong order");
        let gap = later.metadata.exposure.open - earlier.metadata.exposure.open;
        assert!((gap - 1001.0 / 60_000.0).abs() < 1e-12);
    }
}

/// Film frames of constant grey 1, 2, 3, …: which of them each field shows.
#[test]
fn pulldown_shows_film_frames_for_two_and_three_fields() {
    for first in [Parity::Top, Parity::Bottom] {
        for (count, wanted) in [
            (4, vec![(1, 1), (2, 2), (2, 3), (3, 4), (4, 4)]),
            (7, vec![(1, 1), (2, 2), (2, 3), (3, 4), (4, 4), (5, 5), (6, 6), (6, 7), (7, 7)]),
        ] {
            let mut pulldown = Pulldown::new(first);
            let mut frames = Vec::new();
            for n in 0..count {
                let mut film = picture((2, 4), n, FieldOrder::Progressive, |_, _| [(n + 1) as f32; 3]);
                film.metadata.rate = FrameRate::new(24_000, 1001).unwrap();
                frames.extend(pulldown.push(film).unwrap());
            }
            frames.extend(pulldown.finish().unwrap());
            let shown: Vec<(i32, i32)> = frames
                .iter()
                .map(|frame| {
                    assert_eq!(frame.metadata.rate, FrameRate::new(30_000, 1001).unwrap());
                    let (top, bottom) = (frame.rgb[0][0] as i32, frame.rgb[2][0] as i32);
                    if first == Parity::Top { (top, bottom) } else { (bottom, top) }
                })
                .collect();
            assert_eq!(shown, wanted, "{first:?}");
            assert!(frames.iter().map(|frame| frame.metadata.frame).eq((0..).take(wanted.len())));
        }
    }
}

/// A pipe that closes after the first frame.
struct Closing(usize);

impl Write for Closing {
    fn write(&mut self, bytes: &[u8]) -> std::io::Result<usize> {
        self.0 = self.0.checked_sub(bytes.len()).ok_or(std::io::ErrorKind::BrokenPipe)?;
        Ok(bytes.len())
    }
    fn flush(&mut self) -> std::io::Result<()> {
        Ok(())
    }
}

#[test]
fn a_closed_pipe_is_one_clear_sentence() {
    let options = YuvOptions::for_lines(480);
    let mut target = OutputTarget::pipe(Box::new(Closing(500)), options, Cadence::Native).unwrap();
    let frame = |n| picture((16, 8), n, FieldOrder::Progressive, |_, _| [0.5; 3]);
    target.accept(frame(0)).unwrap();
    let message = target.accept(frame(1)).unwrap_err().to_string();
    assert_eq!(message, "standard output: cannot write: broken pipe");
}

#[test]
fn a_full_disk_is_worth_retrying() {
    let Ok(full) = std::fs::OpenOptions::new().write(true).open("/dev/full") else {
        eprintln!("full disk: skipped, there is no /dev/full");
        return;
    };
    let mut target = OutputTarget::pipe(Box::new(full), YuvOptions::for_lines(480), Cadence::Native).unwrap();
    let error = target.accept(picture((16, 8), 0, FieldOrder::Progressive, |_, _| [0.5; 3])).unwrap_err();
    assert!(error.worth_retrying(), "{error}");
}

#[test]
fn a_y4m_file_appears_when_it_is_finished() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.y4m");
    let mut target = OutputTarget::y4m(&path, YuvOptions::for_lines(480), Cadence::Native).unwrap();
    target.accept(picture((16, 8), 0, FieldOrder::Progressive, |_, _| [0.5; 3])).unwrap();
    assert!(!path.exists());
    assert_eq!(target.finish().unwrap(), std::slice::from_ref(&path));
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1);
    assert!(std::fs::read(&path).unwrap().starts_with(b"YUV4MPEG2 W16 H8 "));
}
