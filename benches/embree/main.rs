//! Our traversal against Embree's on the same triangles and rays, in turns in one run. See the README next to it.

#![allow(clippy::print_stdout, reason = "a program that prints a table")]
#![allow(clippy::unwrap_used, clippy::missing_panics_doc, reason = "a measuring program stops at the first surprise")]
#![allow(missing_docs, unreachable_pub, reason = "not a library")]

mod files;
mod scenes;

use graeco::trace::Ray;
use graeco::trace::accel::Accel;
use nix::sys::resource::{UsageWho, getrusage};
use nix::sys::time::TimeValLike;
use scenes::Case;
use std::io::{BufRead, BufReader, Write};
use std::path::{Path, PathBuf};
use std::process::{Child, ChildStdin, ChildStdout, Command, Stdio};
use std::time::Instant;

/// What a set of rays is traced for.
const KINDS: [(&str, &str, usize); 4] =
    [("primary", "closest", 0), ("bounce", "closest", 1), ("bounce any", "any", 1), ("shadow any", "any", 2)];

struct Embree {
    child: Child,
    to: ChildStdin,
    from: BufReader<ChildStdout>,
    built: f64,
}

#[derive(Debug, Clone, Copy)]
struct Run {
    seconds: f64,
    hits: usize,
    sum: f64,
}

impl Embree {
    fn start(program: &Path, scene: &Path, config: &str, rays: &[PathBuf]) -> Self {
        let mut child = Command::new(program)
            .arg(scene)
            .args(["1", config])
            .args(rays)
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .spawn()
            .unwrap();
        let to = child.stdin.take().unwrap();
        let mut from = BufReader::new(child.stdout.take().unwrap());
        let mut line = String::new();
        from.read_line(&mut line).unwrap();
        let built = line.trim().trim_start_matches("built ").parse().unwrap();
        Self { child, to, from, built }
    }

    fn run(&mut self, goal: &str, set: usize, threads: usize) -> Run {
        writeln!(self.to, "{goal} {set} {threads}").unwrap();
        let mut line = String::new();
        self.from.read_line(&mut line).unwrap();
        let mut words = line.split_whitespace();
        let mut word = || words.next().unwrap();
        Run { seconds: word().parse().unwrap(), hits: word().parse().unwrap(), sum: word().parse().unwrap() }
    }
}

impl Drop for Embree {
    fn drop(&mut self) {
        self.child.kill().and_then(|()| self.child.wait()).ok();
    }
}

fn write_scene(path: &Path, case: &Case) {
    let mut out = Vec::new();
    let count = |n: usize| u32::try_from(n).unwrap().to_le_bytes();
    out.extend(count(usize::from(case.turns)));
    out.extend(count(case.shapes.len()));
    for shape in &case.shapes {
        out.extend(count(shape.keys[0].len()));
        out.extend(count(shape.triangles.len()));
        out.extend(count(shape.keys.len()));
        out.extend(shape.triangles.iter().flatten().flat_map(|i| i.to_le_bytes()));
        for key in &shape.keys {
            out.extend(key.iter().flat_map(|p| p.to_array()).flat_map(f32::to_le_bytes));
        }
    }
    out.extend(count(case.placed.len()));
    for placed in &case.placed {
        out.extend(count(placed.shape));
        out.extend(count(placed.keys.len()));
        for m in &placed.keys {
            let [x, y, z, t] = [m.matrix3.x_axis, m.matrix3.y_axis, m.matrix3.z_axis, m.translation];
            for row in 0..3 {
                out.extend([x[row], y[row], z[row], t[row]].into_iter().flat_map(f32::to_le_bytes));
            }
        }
    }
    std::fs::write(path, out).unwrap();
}

fn write_rays(path: &Path, rays: &[Ray]) {
    let mut out = u32::try_from(rays.len()).unwrap().to_le_bytes().to_vec();
    for r in rays {
        let numbers = [&r.origin.to_array()[..], &r.direction.to_array(), &[r.t_max, r.u_time]].concat();
        out.extend(numbers.into_iter().flat_map(f32::to_le_bytes));
    }
    std::fs::write(path, out).unwrap();
}

/// Seconds of processor time.
#[allow(clippy::cast_precision_loss, reason = "microseconds")]
fn seconds(who: UsageWho) -> f64 {
    let usage = getrusage(who).unwrap();
    (usage.user_time().num_microseconds() + usage.system_time().num_microseconds()) as f64 * 1e-6
}

fn trace(accel: &Accel, rays: &[Ray], goal: &str) -> (usize, f64) {
    if goal == "any" {
        return (rays.iter().filter(|r| accel.occluded(r, |_| true)).count(), 0.0);
    }
    rays.iter().filter_map(|r| accel.closest(r, |_| true)).fold((0, 0.0), |(n, sum), h| (n + 1, sum + f64::from(h.t)))
}

fn ours(accel: &Accel, rays: &[Ray], goal: &str, threads: usize) -> Run {
    if threads == 1 {
        let from = seconds(UsageWho::RUSAGE_THREAD);
        let (hits, sum) = trace(accel, rays, goal);
        return Run { seconds: seconds(UsageWho::RUSAGE_THREAD) - from, hits, sum };
    }
    let from = Instant::now();
    let next = std::sync::atomic::AtomicUsize::new(0);
    let chunks: Vec<&[Ray]> = rays.chunks(4096).collect();
    let work = || {
        let mut total = (0, 0.0);
        while let Some(chunk) = chunks.get(next.fetch_add(1, std::sync::atomic::Ordering::Relaxed)) {
            let (n, sum) = trace(accel, chunk, goal);
            total = (total.0 + n, total.1 + sum);
        }
        total
    };
    let (hits, sum) = std::thread::scope(|s| {
        let crew: Vec<_> = (0..threads).map(|_| s.spawn(work)).collect();
        crew.into_iter().map(|t| t.join().unwrap()).fold((0, 0.0), |a, b| (a.0 + b.0, a.1 + b.1))
    });
    Run { seconds: from.elapsed().as_secs_f64(), hits, sum }
}

fn median(values: &mut [f64]) -> f64 {
    values.sort_by(f64::total_cmp);
    values[values.len() / 2]
}

#[allow(clippy::cast_precision_loss, reason = "counts of rays and bytes")]
fn compare(case: &Case, program: Option<&Path>, config: &str, folder: &Path, repeats: usize, most_threads: usize) {
    let (scene, stage) = case.stage();
    drop(Accel::build(&scene, &stage, None));
    let from = seconds(UsageWho::RUSAGE_SELF);
    let accel = Accel::build(&scene, &stage, None);
    let spent = seconds(UsageWho::RUSAGE_SELF) - from;
    let stats = accel.stats();
    let primary = case.primary();
    let [bounces, shadows] = case.secondary(&accel, &scene, &stage, &primary);
    let sets = [primary, bounces, shadows];
    let mut embree = program.map(|program| {
        let path = folder.join("scene.bin");
        write_scene(&path, case);
        let files: Vec<_> = (0..3).map(|i| folder.join(format!("rays{i}.bin"))).collect();
        for (file, rays) in files.iter().zip(&sets) {
            write_rays(file, rays);
        }
        Embree::start(program, &path, config, &files)
    });
    let triangles = (stats.still_triangles + stats.moving_triangles) as f64;
    println!(
        "\n{} ({:.0} triangles, {} places, {} slabs): built in {:.3} s ({:.3} s of processor time), {:.2} M triangles/s, {:.1} MB per million; Embree {:.3} s",
        case.name,
        triangles,
        stats.places,
        stats.slabs,
        stats.seconds,
        spent,
        triangles / stats.seconds * 1e-6,
        stats.bytes as f64 / triangles,
        embree.as_ref().map_or(f64::NAN, |e| e.built),
    );
    println!("| rays | threads | ours Mrays/s | Embree Mrays/s | ratio | hits differ | distances differ |");
    println!("|---|---|---|---|---|---|---|");
    for threads in 1..=most_threads {
        for (name, goal, set) in KINDS {
            let rays = &sets[set];
            let (mut mine, mut theirs, mut ratios) = (Vec::new(), Vec::new(), Vec::new());
            let (mut a, mut b) = (None, None);
            for _ in 0..repeats {
                let run = ours(&accel, rays, goal, threads);
                mine.push(rays.len() as f64 / run.seconds * 1e-6);
                a = Some(run);
                if let Some(e) = &mut embree {
                    let other = e.run(goal, set, threads);
                    theirs.push(rays.len() as f64 / other.seconds * 1e-6);
                    ratios.push(other.seconds / run.seconds);
                    b = Some(other);
                }
            }
            let mine = median(&mut mine);
            if let (Some(a), Some(b)) = (a, b) {
                let (theirs, ratio) = (median(&mut theirs), median(&mut ratios));
                let (hits, sum) = (a.hits.abs_diff(b.hits), (a.sum - b.sum).abs() / b.sum.max(1.0));
                println!("| {name} | {threads} | {mine:.2} | {theirs:.2} | {ratio:.2} | {hits} | {sum:.1e} |");
            } else {
                println!("| {name} | {threads} | {mine:.2} | | | | |");
            }
        }
    }
}

fn main() {
    let arguments: Vec<String> = std::env::args().skip(1).filter(|a| a != "--bench").collect();
    let value = |key: &str| arguments.iter().find_map(|a| a.strip_prefix(&format!("--{key}=")).map(str::to_owned));
    let program = value("embree").map(PathBuf::from);
    let repeats = value("repeats").and_then(|r| r.parse().ok()).unwrap_or(7);
    let threads = value("threads").and_then(|r| r.parse().ok()).unwrap_or(2);
    let only = value("only").unwrap_or_default();
    let more = value("config").unwrap_or_default();
    let folder = tempfile::tempdir().unwrap();
    type Maker = fn() -> Case;
    let cases: [(&str, &str, Maker); 12] = [
        ("static", "", || scenes::one_mesh("still", 1)),
        ("hall", "", || scenes::hall("hall, still")),
        ("tilted", "", || scenes::tilted("hall, askew")),
        ("meadow", "", || scenes::meadow("meadow, still")),
        ("forest", "", || files::frozen("forest.glb, frozen", "animations/forest.glb")),
        ("still_life", "", || files::frozen("still_life.glb", "scenes/still_life.glb")),
        ("pool", "", || files::frozen("pool.glb, frozen", "animations/pool.glb")),
        ("deforming", "", || scenes::one_mesh("deforming, Embree's default", 2)),
        ("deforming4vmb", "tri_accel_mb=bvh8.triangle4vmb", || scenes::one_mesh("deforming, bvh8.triangle4vmb", 2)),
        ("instances", "", || scenes::instanced("instances, still", 1)),
        ("moving", "", || scenes::instanced("instances, moving in a line", 2)),
        ("turning", "", || scenes::instanced("instances, turning", 5)),
    ];
    for (key, config, make) in cases {
        if only.is_empty() || only.split(',').any(|o| o == key) {
            let config = [config, &more].join(",");
            compare(&make(), program.as_deref(), &config, folder.path(), repeats, threads);
        }
    }
}
