//! What the presence of effects costs a scene without them, as ratios of interleaved runs. See the README next to it.

#![allow(clippy::print_stdout, reason = "a program that prints a table")]
#![allow(clippy::unwrap_used, clippy::missing_panics_doc, reason = "a measuring program stops at the first surprise")]
#![allow(clippy::cast_precision_loss, reason = "counts are small")]
#![allow(missing_docs, unreachable_pub, reason = "not a library")]

mod everything;
#[path = "../../tests/support/flat.rs"]
mod flat;
#[path = "../../tests/support/moving.rs"]
mod moving;
mod scenes;
#[path = "../../tests/support/shots.rs"]
mod shots;

use graeco::film::Film;
use graeco::render::{Progress, Settings, Shot};
use graeco::scene::Scene;
use std::io::{BufRead, BufReader, Write};
use std::process::{Command, Stdio};

/// Pairs of runs.
const PAIRS: usize = 45;

fn main() {
    let arguments: Vec<String> = std::env::args().collect();
    let value = |name: &str| arguments.iter().find_map(|a| a.strip_prefix(name));
    // One thread: what two do to each other's clock is not the subject.
    rayon::ThreadPoolBuilder::new().num_threads(1).build_global().unwrap();
    if arguments.iter().any(|a| a == "--serve") {
        return serve();
    }
    let wanted = |part: &str| value("--only=").is_none_or(|list| list.split(',').any(|name| name == part));
    if wanted("program") {
        match value("--bare=") {
            Some(bare) => program(bare),
            None => println!("program: left out, no --bare=PROGRAM (use benches/presence/run)"),
        }
    }
    if wanted("crowd") {
        crowd();
    }
    if wanted("plan") {
        everything::plan_against_everything();
    }
    if wanted("regions") {
        everything::what_regions_could_gain();
    }
}

/// Processor seconds of sampling a frame, and the frame.
pub fn render(scene: &Scene, settings: &Settings) -> (f64, Film) {
    let surroundings = shots::dark();
    let mut shot = Shot::new(scene, settings, &surroundings, "").unwrap();
    let frame = shot.render(0, &Progress::default()).unwrap().unwrap();
    (frame.cost.render_cpu_s, frame.film)
}

fn hash(film: &Film) -> String {
    let mut hasher = blake3::Hasher::new();
    for pixel in film.pixels() {
        hasher.update(bytemuck::bytes_of(&pixel.radiance));
    }
    hasher.finalize().to_hex()[..16].to_owned()
}

/// A still through a pinhole with matt surfaces, one sun, one point lamp and one spot.
fn still(bounces: u16) -> (Scene, Settings) {
    let mut settings = shots::settings((320, 180), 16, bounces);
    settings.shutter = Some(0.0);
    (shots::load("scenes/hard_lights.glb"), settings)
}

/// Renders the still for every line that comes in, with so many bounces; answers with seconds and hash.
fn serve() {
    let stills = [0, 2].map(still);
    for line in std::io::stdin().lines() {
        let bounces: usize = line.unwrap().trim().parse().unwrap();
        let (scene, settings) = &stills[bounces / 2];
        let (seconds, film) = render(scene, settings);
        println!("{seconds} {}", hash(&film));
    }
}

/// The whole program against one without motion, lens and area lights.
fn program(bare: &str) {
    let mut child = Command::new(bare).arg("--serve").stdin(Stdio::piped()).stdout(Stdio::piped()).spawn().unwrap();
    let mut to = child.stdin.take().unwrap();
    let mut from = BufReader::new(child.stdout.take().unwrap());
    println!("the whole program over one without motion, lens and area lights, hard_lights.glb (at most 1.02):");
    for bounces in [0, 2] {
        let (scene, settings) = still(bounces);
        let mut ratios = Vec::new();
        // The first pair warms up.
        for pair in 0..=PAIRS {
            let ask = |to: &mut dyn Write, from: &mut dyn BufRead| {
                writeln!(to, "{bounces}").unwrap();
                let mut line = String::new();
                from.read_line(&mut line).unwrap();
                let (seconds, picture) = line.trim().split_once(' ').unwrap();
                (seconds.parse::<f64>().unwrap(), picture.to_owned())
            };
            // Turns change places, so that neither is always the one that finds a warm processor.
            let before = (pair % 2 == 0).then(|| ask(&mut to, &mut from));
            let (own, film) = render(&scene, &settings);
            let (theirs, picture) = before.unwrap_or_else(|| ask(&mut to, &mut from));
            assert_eq!(picture, hash(&film), "both programs render the same picture");
            if pair > 0 {
                ratios.push(own / theirs);
            }
        }
        println!("  {bounces} bounces: {}", spread(&mut ratios));
    }
    drop(to);
    child.wait().unwrap();
}

/// One thing that moves among 10 000 that stand.
fn crowd() {
    println!("one moving object among 10 000 static ones over nothing moving (at most 1.05):");
    for bounces in [0, 2] {
        let mut settings = shots::settings((320, 180), 16, bounces);
        settings.shutter = Some(1.0);
        let [moving, nothing] = [true, false].map(scenes::crowd);
        let mut ratios = Vec::new();
        for pair in 0..=PAIRS {
            let first = render(if pair % 2 == 0 { &moving } else { &nothing }, &settings).0;
            let second = render(if pair % 2 == 0 { &nothing } else { &moving }, &settings).0;
            let ratio = if pair % 2 == 0 { first / second } else { second / first };
            if pair > 0 {
                ratios.push(ratio);
            }
        }
        println!("  {bounces} bounces: {}", spread(&mut ratios));
    }
}

/// Median and quartiles.
pub fn spread(ratios: &mut [f64]) -> String {
    ratios.sort_by(f64::total_cmp);
    let at = |part: usize| ratios[part * (ratios.len() - 1) / 4];
    format!("{:.3} (quartiles {:.3} to {:.3}, n = {})", at(2), at(1), at(3), ratios.len())
}
