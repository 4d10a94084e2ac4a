//! Parts of frames: merged they are what one machine makes, bit for bit; what is wrong with them is said in a sentence;
//! a task that was killed goes on from where it was.
#![allow(
    clippy::unwrap_used,
    clippy::print_stderr,
    reason = "a test that cannot go on has failed; skipped ones say so"
)]

#[path = "support/shots.rs"]
mod shots;

use graeco::output::part::{Opened, OutputChoice, PartWriter};
use graeco::output::{FieldFiles, Picture, View, read};
use graeco::render::aovs::Aov;
use graeco::render::merge::Missing;
use graeco::render::{Adaptive, Collection, Goal, Progress, Scanning, Settings, Shot, Slice, pictures};
use graeco::scene::Scene;
use graeco::time::Parity;
use proptest::prelude::*;
use proptest::test_runner::{Config, TestRunner};
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};
use std::sync::Arc;
use std::time::Duration;

const SIZE: (u32, u32) = (50, 36);
const FRAME: i64 = 12;

/// Everything at once: two fields, a filter with weights of both signs, all planes.
fn fields(runs: u32) -> Settings {
    Settings {
        scanning: Scanning::Interlaced { first: Parity::Top },
        line_height: 2.0,
        filter: "mitchell:1/3,1/3".parse().unwrap(),
        aovs: Aov::ALL.map(|(_, aov)| aov).to_vec(),
        ..shots::settings(SIZE, runs, 1)
    }
}

fn cropped(runs: u32) -> Settings {
    Settings { crop: Some([5, 3, 40, 30]), aovs: vec![Aov::Variance, Aov::Depth], ..shots::settings(SIZE, runs, 1) }
}

/// Renders the part of `slice` into `path`.
fn render_part(shot: &mut Shot<'_>, frame: i64, slice: &Slice, path: &Path) {
    let header = shot.part_header(frame, slice, &OutputChoice::default()).unwrap();
    let Opened::Unfinished(writer) = PartWriter::open(path, &header).unwrap() else { panic!("it is new") };
    shot.render_part(*writer, 0.0, || 0, &Progress::default()).unwrap().unwrap();
}

fn slice(tile: &str, runs: Option<String>) -> Slice {
    Slice { tile: tile.parse().unwrap(), runs: runs.map(|runs| runs.parse().unwrap()) }
}

fn single(shot: &mut Shot<'_>) -> Picture {
    let frame = shot.render(FRAME, &Progress::default()).unwrap().unwrap();
    shot.pictures(FRAME, &frame, FieldFiles::Woven).unwrap().remove(0)
}

fn merged(paths: Vec<PathBuf>) -> Picture {
    let collection = Collection::gather(paths, Missing::Refused).unwrap();
    assert_eq!(collection.check(None).unwrap(), [FRAME]);
    let merged = collection.merge(FRAME, &Progress::default()).unwrap().unwrap();
    assert!(merged.notes.is_empty());
    let record = Arc::new(collection.header().record.clone());
    pictures(collection.settings(), &record, FRAME, &merged.frame, FieldFiles::Woven).unwrap().remove(0)
}

type Planes = Vec<(String, Vec<u32>)>;

/// All that a picture says, floats as they are written: a difference of one bit shows.
fn bits(picture: &Picture) -> (Vec<u32>, Planes, String) {
    let planes = picture.planes.iter().map(|p| (p.name.clone(), p.samples.iter().map(|v| v.to_bits()).collect()));
    let colour = picture.rgb.iter().flatten().map(|v| v.to_bits()).collect();
    (colour, planes.collect(), format!("{:?} {:?} {:?}", picture.metadata, picture.window, picture.alpha))
}

/// Random divisions into tiles and, of each tile, into its own slices of runs.
fn divisions_equal_one_machine(scene: &Scene, settings: &Settings, cases: u32) {
    let surroundings = shots::dark();
    let whole = bits(&single(&mut Shot::new(scene, settings, &surroundings, "").unwrap()));
    let runs = settings.sampling.runs;
    let division = (1_u32..5, proptest::collection::vec(proptest::collection::vec(1..runs, 0..3), 5), any::<u64>());
    let mut runner = TestRunner::new(Config { cases, failure_persistence: None, ..Config::default() });
    runner
        .run(&division, |(tiles, cuts, order)| {
            let folder = tempfile::tempdir().unwrap();
            let mut paths = Vec::new();
            for (tile, cuts) in (1..=tiles).zip(&cuts) {
                let mut cuts: Vec<u32> = cuts.iter().copied().chain([0, runs]).collect();
                cuts.sort_unstable();
                cuts.dedup();
                for pair in cuts.windows(2) {
                    // A machine of its own: nothing is carried over from another part.
                    let mut shot = Shot::new(scene, settings, &surroundings, "").unwrap();
                    let n = paths.len() as u64;
                    let name = format!("{:x}.{n}.part", order.wrapping_mul(2 * n + 1));
                    let path = folder.path().join(name);
                    let range = format!("{}-{}", pair[0], pair[1] - 1);
                    render_part(&mut shot, FRAME, &slice(&format!("{tile}/{tiles}"), Some(range)), &path);
                    paths.push(path);
                }
            }
            prop_assert_eq!(&bits(&merged(paths)), &whole);
            Ok(())
        })
        .unwrap();
}

#[test]
fn any_division_gives_the_bits_of_one_machine_with_fields_filters_and_planes() {
    divisions_equal_one_machine(&shots::load("animations/field.glb"), &fields(21), 4);
}

#[test]
fn any_division_of_a_crop_gives_the_bits_of_one_machine() {
    divisions_equal_one_machine(&shots::load("animations/fan.glb"), &cropped(12), 4);
}

/// Pixels that stop by themselves, in tiles: of two fields, the last row of whose blocks has no line of the second, and of a
/// crop that cuts blocks, which decide whole.
#[test]
fn tiles_whose_pixels_stop_by_themselves_give_the_bits_of_one_machine() {
    let last_line_alone = Settings { crop: Some([0, 0, 50, 33]), ..fields(16) };
    for (file, settings) in [("field", last_line_alone), ("fan", cropped(16))] {
        let scene = shots::load(&format!("animations/{file}.glb"));
        for goal in [Goal::Error(0.1), Goal::Passes(2), Goal::Passes(9)] {
            let adaptive = Some(Adaptive { goal, most_runs: 256, view: View::default() });
            let settings = Settings { adaptive, ..settings.clone() };
            let surroundings = shots::dark();
            let whole = single(&mut Shot::new(&scene, &settings, &surroundings, "").unwrap());
            for tiles in [1, 3] {
                let folder = tempfile::tempdir().unwrap();
                let parts = (1..=tiles).map(|tile| {
                    let mut shot = Shot::new(&scene, &settings, &surroundings, "").unwrap();
                    let path = folder.path().join(format!("{tile}.part"));
                    render_part(&mut shot, FRAME, &slice(&format!("{tile}/{tiles}"), None), &path);
                    path
                });
                assert_eq!(bits(&merged(parts.collect())), bits(&whole), "{file}, {goal:?}, {tiles} tiles");
            }
        }
    }
}

/// What only the whole picture knows, and runs of pixels that have no fixed number of them, are refused in a sentence.
#[test]
fn parts_of_what_the_whole_picture_decides_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let part = folder.path().join("a.part");
    let refused = |flags: &str, reason: &str| {
        let scene = Path::new(env!("CARGO_MANIFEST_DIR")).join("animations/field.glb");
        let (scene, part) = (scene.to_str().unwrap().to_owned(), part.to_str().unwrap().to_owned());
        let fixed = ["render".to_owned(), scene, "-o".into(), part, "--frames".into(), "3".into()];
        let run = graeco(&fixed, &format!("--size 50x36 {flags}"));
        let said = String::from_utf8_lossy(&run.stderr).into_owned();
        assert!(run.status.code() == Some(2) && said.lines().count() == 1 && said.contains(reason), "{flags}: {said}");
    };
    for flags in ["--within 1s", "--until 5%", "--mean-runs 32"] {
        refused(flags, &format!("{} with a part of a frame", flags.split(' ').next().unwrap()));
    }
    refused("--error 10% --run-range 0-3", "--run-range 0-3: pixels that stop by themselves");
    assert!(!part.exists());
    let stops = |name: &str, tile: &str| {
        let scene = shots::load("animations/field.glb");
        let adaptive = Some(Adaptive { goal: Goal::Passes(1), most_runs: 64, view: View::default() });
        let settings = Settings { adaptive, ..shots::settings(SIZE, 16, 1) };
        let surroundings = shots::dark();
        let mut shot = Shot::new(&scene, &settings, &surroundings, "").unwrap();
        let path = folder.path().join(name);
        render_part(&mut shot, 3, &slice(tile, None), &path);
        path
    };
    let [first, again] = [stops("first.part", "1/2"), stops("again.part", "1/2")];
    for (parts, problem) in [(vec![&first], "lacks tile 2/2"), (vec![&first, &again], "both hold the same pixels")] {
        let parts: Vec<&Path> = parts.into_iter().map(PathBuf::as_path).collect();
        let (code, said) = merge(&parts, &folder.path().join("out.exr"), "-q");
        assert!(code == Some(1) && said.contains(problem), "{said}");
    }
}

/// What the program is called with to render the small scene.
fn arguments(output: &Path) -> Vec<String> {
    let scene = Path::new(env!("CARGO_MANIFEST_DIR")).join("animations/field.glb");
    let text = |path: &Path| path.to_str().unwrap().to_owned();
    let fixed = "--frames 3 --size 50x36 --runs 16 --aov depth,variance,samples --threads 2";
    [vec!["render".to_owned(), text(&scene), "-o".into(), text(output)], fixed.split(' ').map(str::to_owned).collect()]
        .concat()
}

fn graeco(arguments: &[String], more: &str) -> Output {
    let more = more.split(' ').filter(|word| !word.is_empty());
    Command::new(env!("CARGO_BIN_EXE_graeco")).args(arguments).args(more).output().unwrap()
}

/// Renders the small scene with `more` flags; asserts success.
fn render(output: &Path, more: &str) -> PathBuf {
    let run = graeco(&arguments(output), more);
    assert!(run.status.success(), "{}", String::from_utf8_lossy(&run.stderr));
    output.to_path_buf()
}

/// Merges; the exit code and what was said.
fn merge(parts: &[&Path], output: &Path, more: &str) -> (Option<i32>, String) {
    let mut arguments = vec!["merge".to_owned()];
    arguments.extend(parts.iter().map(|p| p.to_str().unwrap().to_owned()));
    arguments.extend(["-o".to_owned(), output.to_str().unwrap().to_owned()]);
    let run = graeco(&arguments, more);
    (run.status.code(), String::from_utf8_lossy(&run.stderr).into_owned())
}

#[test]
fn the_programs_merged_files_are_those_that_it_renders() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    fs::create_dir(at("parts")).unwrap();
    for (tile, runs) in [("1/2", "0-7"), ("1/2", "8-15"), ("2/2", "0-15")] {
        let name = format!("parts/{}_{runs}.part", &tile[..1]);
        render(&at(&name), &format!("--tile {tile} --run-range {runs} --view agx -q"));
    }
    fs::write(at("list"), format!("{}\n", at("parts").display())).unwrap();
    for (name, flags) in [("a.exr", ""), ("a.png", "--view agx")] {
        render(&at(name), flags);
        let list = PathBuf::from(format!("@{}", at("list").display()));
        let (code, said) = merge(&[&list, &at("parts/2_0-15.part")], &at(&format!("merged_{name}")), "");
        assert_eq!(code, Some(0), "{said}");
        assert_eq!(fs::read(at(name)).unwrap(), fs::read(at(&format!("merged_{name}"))).unwrap(), "{name}");
    }
    for (name, frame) in [("1_0-7", 3), ("1_8-15", 3), ("2_0-15", 3), ("2_0-15", 4)] {
        fs::copy(at(&format!("parts/{name}.part")), at(&format!("shot.{frame:04}.{name}.part"))).unwrap();
    }
    for pattern in ["shot.####.*.part", "shot.0003.*.part", "parts/*"] {
        let (code, said) = merge(&[&at(pattern)], &at("b.exr"), "--frames 3");
        assert_eq!(code, Some(0), "{pattern}: {said}");
        assert_eq!(fs::read(at("a.exr")).unwrap(), fs::read(at("b.exr")).unwrap(), "{pattern}");
        fs::remove_file(at("b.exr")).unwrap();
    }
}

#[test]
fn what_cannot_be_merged_is_refused_in_one_sentence_that_names_it() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    let first = render(&at("first.part"), "--tile 1/2 -q");
    let second = render(&at("second.part"), "--tile 2/2 --run-range 0-7 -q");
    let seed = render(&at("seed.part"), "--tile 2/2 --seed 5 -q");
    let runs = render(&at("runs.part"), "--tile 2/2 --bounces 0 -q");
    let whole = render(&at("whole.part"), "-q");
    let mut bytes = fs::read(&whole).unwrap();
    let cut = at("cut.part");
    fs::write(&cut, &bytes[..bytes.len() / 2]).unwrap();
    let middle = bytes.len() / 2;
    bytes[middle] ^= 1;
    let damaged = at("damaged.part");
    fs::write(&damaged, &bytes).unwrap();
    let alien = at("alien.part");
    fs::write(&alien, b"no part of anything, though long enough to have a header").unwrap();
    for (parts, names, why) in [
        (vec![&first], "frame 3", "lacks runs 0-15 of tile 2/2"),
        (vec![&first, &second], "frame 3", "lacks runs 8-15 of tile 2/2"),
        (vec![&first, &whole], "first.part and", "both hold runs 0-15"),
        (vec![&first, &seed], "seed.part", "seeds are 0 and 5"),
        (vec![&first, &runs], "runs.part", "render.bounces"),
        (vec![&cut], "cut.part", "unfinished, cut short or damaged"),
        (vec![&damaged], "damaged.part", "checksum of block"),
        (vec![&alien], "alien.part", "no part file"),
        (vec![&at("gone.part")], "gone.part", "cannot open"),
        (vec![&at("gone.*.part")], "gone.*.part", "no file's name fits"),
    ] {
        let parts: Vec<&Path> = parts.into_iter().map(PathBuf::as_path).collect();
        let (code, said) = merge(&parts, &at("out.exr"), "-q");
        assert_eq!((code, said.lines().count()), (Some(1), 1), "{said}");
        assert!(said.contains(names) && said.contains(why), "{said}");
        assert!(!at("out.exr").exists());
    }
    let (code, said) = merge(&[&whole], &at("out.####.exr"), "--frames 3-4 -q");
    assert!(code == Some(1) && said.contains("frame 4 has no parts"), "{said}");
    let (code, said) = merge(&[&whole], &at("out.part"), "-q");
    assert!(code == Some(2) && said.contains(".exr or .png"), "{said}");
    for flags in ["--tile 1/2", "--run-range 0-7"] {
        let run = graeco(&arguments(&at("a.exr")), flags);
        let said = String::from_utf8_lossy(&run.stderr).into_owned();
        assert!(run.status.code() == Some(2) && said.contains("ends in .part"), "{said}");
    }
    let run = graeco(&arguments(&at("a.part")), "--run-range 8-16");
    assert!(String::from_utf8_lossy(&run.stderr).contains("has those from 0 to 15"));
}

#[test]
fn a_partial_merge_leaves_out_what_is_missing_and_says_so() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    let first = render(&at("first.part"), "--tile 1/2 -q");
    let mut bytes = fs::read(render(&at("half.part"), "--tile 2/2 --run-range 0-7 -q")).unwrap();
    let (code, said) = merge(&[&first], &at("first.exr"), "--partial");
    assert!(code == Some(0) && said.contains("lacks runs 0-15 of tile 2/2"), "{said}");
    let whole = read::read(&render(&at("whole.exr"), "")).unwrap();
    let some = read::read(&at("first.exr")).unwrap();
    assert_ne!(some.stored.settings_hash, whole.stored.settings_hash);
    let there = some.alpha.as_ref().unwrap();
    assert!(there.contains(&0.0) && there.contains(&1.0));
    for (i, &alpha) in there.iter().enumerate() {
        let expected = if alpha > 0.0 { whole.rgb[i] } else { [0.0; 3] };
        assert_eq!(some.rgb[i].map(f32::to_bits), expected.map(f32::to_bits));
    }
    // A damaged record costs its block, no more.
    let middle = bytes.len() / 2;
    bytes[middle] ^= 1;
    fs::write(at("half.part"), bytes).unwrap();
    let (code, said) = merge(&[&first, &at("half.part")], &at("both.exr"), "--partial");
    assert!(code == Some(0) && said.contains("checksum of block") && said.contains("runs 8-15"), "{said}");
    let both = read::read(&at("both.exr")).unwrap();
    let samples = &both.planes.iter().find(|plane| plane.name == "samples.Y").unwrap().samples;
    for runs in [0.0, 8.0, 16.0] {
        assert!(samples.contains(&runs), "no pixel has {runs} runs");
    }
}

/// Starts the program and waits until `ready`, or until it ends by itself.
fn start(arguments: &[String], more: &str, ready: impl Fn() -> bool) -> std::process::Child {
    let mut child = Command::new(env!("CARGO_BIN_EXE_graeco"))
        .args(arguments)
        .args(more.split(' '))
        .stderr(Stdio::null())
        .spawn()
        .unwrap();
    while !ready() && child.try_wait().unwrap().is_none() {
        std::thread::sleep(Duration::from_millis(2));
    }
    child
}

fn length(path: &Path) -> u64 {
    fs::metadata(path).map_or(0, |about| about.len())
}

/// So many runs that it is stopped in the middle.
const LONG: &str = "--runs 1024 --threads 1";

#[test]
fn a_killed_part_goes_on_from_its_last_whole_block() {
    let folder = tempfile::tempdir().unwrap();
    let (part, journal) = (folder.path().join("a.part"), folder.path().join("a.part.partial"));
    let mut arguments = arguments(&part);
    arguments.retain(|word| word != "--threads" && word != "2" && word != "--runs" && word != "16");
    let mut child = start(&arguments, LONG, || length(&journal) > 20_000);
    // A second writer is turned away while the first is at work.
    let run = graeco(&arguments, LONG);
    let said = String::from_utf8_lossy(&run.stderr).into_owned();
    assert!(run.status.code() == Some(75) && said.contains("another task is writing"), "{said}");
    child.kill().unwrap();
    child.wait().unwrap();
    assert!(!part.exists());
    // Its last words are cut short, as by a crash of the machine.
    let kept = length(&journal);
    fs::OpenOptions::new().write(true).open(&journal).unwrap().set_len(kept - 5).unwrap();
    let held = length(&journal);
    // TERM ends the next task in good order.
    let child = start(&arguments, LONG, || length(&journal) > held + 10_000);
    let id = nix::unistd::Pid::from_raw(i32::try_from(child.id()).unwrap());
    nix::sys::signal::kill(id, nix::sys::signal::Signal::SIGTERM).unwrap();
    assert_eq!(child.wait_with_output().unwrap().status.code(), Some(75));
    assert!(length(&journal) > held && !part.exists());
    let run = graeco(&arguments, LONG);
    let said = String::from_utf8_lossy(&run.stderr).into_owned();
    assert!(run.status.success() && said.contains("blocks were done before"), "{said}");
    assert!(!journal.exists());
    let run = graeco(&arguments, LONG);
    assert!(String::from_utf8_lossy(&run.stderr).contains("finished before, kept"));
    let (code, said) = merge(&[&part], &folder.path().join("merged.exr"), "");
    assert_eq!(code, Some(0), "{said}");
    let mut whole = arguments.clone();
    whole[3] = folder.path().join("whole.exr").to_str().unwrap().to_owned();
    assert!(graeco(&whole, LONG).status.success());
    let bytes = |name: &str| fs::read(folder.path().join(name)).unwrap();
    assert_eq!(bytes("merged.exr"), bytes("whole.exr"));
}

#[test]
fn a_full_disk_is_worth_retrying_and_loses_nothing() {
    if !Path::new("/dev/full").exists() {
        eprintln!("skipped: there is no /dev/full");
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let part = folder.path().join("a.part");
    std::os::unix::fs::symlink("/dev/full", folder.path().join("a.part.partial")).unwrap();
    let run = graeco(&arguments(&part), "-q");
    let said = String::from_utf8_lossy(&run.stderr).into_owned();
    assert_eq!((run.status.code(), said.lines().count()), (Some(75), 1), "{said}");
    assert!(said.contains("a.part.partial: cannot write"), "{said}");
    // A limit on the length of files, met in the middle: what was written before it stays and is gone on from.
    fs::remove_file(folder.path().join("a.part.partial")).unwrap();
    let limited = Command::new("sh")
        .args(["-c", "ulimit -f 150; exec \"$0\" \"$@\"", env!("CARGO_BIN_EXE_graeco")])
        .args(arguments(&part))
        .output()
        .unwrap();
    let said = String::from_utf8_lossy(&limited.stderr).into_owned();
    assert!(limited.status.code() == Some(1) && said.contains("cannot write"), "{said}");
    let run = graeco(&arguments(&part), "");
    let said = String::from_utf8_lossy(&run.stderr).into_owned();
    assert!(run.status.success() && said.contains("blocks were done before"), "{said}");
}

#[test]
fn a_killed_sequence_leaves_whole_frames_only() {
    let folder = tempfile::tempdir().unwrap();
    let pattern = folder.path().join("a.####.exr");
    let mut arguments = arguments(&pattern);
    let frames = arguments.iter().position(|word| word == "3").unwrap();
    arguments[frames] = "0-200".into();
    let third = folder.path().join("a.0002.exr");
    let mut child = start(&arguments, "-q", || third.exists());
    child.kill().unwrap();
    child.wait().unwrap();
    let mut whole = 0;
    for entry in fs::read_dir(folder.path()).unwrap() {
        let path = entry.unwrap().path();
        let hidden = path.file_name().unwrap().to_str().unwrap().starts_with('.');
        if !hidden && path.extension().is_some_and(|e| e == "exr") {
            read::read(&path).unwrap();
            whole += 1;
        }
    }
    assert!((3..199).contains(&whole), "{whole} frames");
    // TERM: frames so far are kept, and a scheduler is asked to try again.
    let next = folder.path().join(format!("a.{:04}.exr", whole + 1));
    let child = start(&arguments, "-q --resume", || next.exists());
    let id = nix::unistd::Pid::from_raw(i32::try_from(child.id()).unwrap());
    nix::sys::signal::kill(id, nix::sys::signal::Signal::SIGTERM).unwrap();
    assert_eq!(child.wait_with_output().unwrap().status.code(), Some(75));
}

#[test]
fn programs_are_told_how_far_the_work_is() {
    let folder = tempfile::tempdir().unwrap();
    for (form, end) in [
        ("openjd", "openjd_progress: 100.0"),
        ("alf", "ALF_PROGRESS 100%"),
        ("afanasy", "PROGRESS: 100%"),
        ("json", r#""progress":1.0}"#),
    ] {
        let run = graeco(&arguments(&folder.path().join("a.part")), &format!("--progress {form}"));
        let said = String::from_utf8_lossy(&run.stdout).into_owned();
        assert!(said.lines().last().is_some_and(|line| line.ends_with(end)), "{form}: {said}");
    }
    let run = graeco(&arguments(&folder.path().join("a.exr")), "--progress none -q");
    assert!(run.stdout.is_empty() && run.stderr.is_empty());
}
