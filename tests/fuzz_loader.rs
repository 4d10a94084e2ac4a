//! Mutated corpus files: whatever the bytes, the loader returns; it never panics, hangs or takes the machine's memory.
//!
//! The mutations are drawn from a fixed seed, so a failure names an iteration that repeats. `GRAECO_FUZZ_SECONDS`
//! goes on for longer than the default number of iterations.
#![allow(
    clippy::unwrap_used,
    clippy::print_stderr,
    clippy::print_stdout,
    clippy::cast_possible_truncation,
    clippy::cast_precision_loss,
    reason = "helpers of tests: a failure is a panic, numbers are small, and skipped tests say so"
)]

use graeco::numeric::mix64;
use graeco::scene::gltf::{LoadOptions, load};
use std::collections::BTreeMap;
use std::fs;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};
use tempfile::TempDir;

/// Files larger than this are left out: mutations would rarely hit what matters.
const LARGEST: u64 = 64 << 10;

/// Iterations of a plain test run.
const ITERATIONS: u64 = 3000;

fn corpus() -> Option<PathBuf> {
    let root = std::env::var_os("GRAECO_CORPUS")
        .map_or_else(|| Path::new(env!("CARGO_MANIFEST_DIR")).join("../shared/gltf"), PathBuf::from);
    if root.join("SOURCES.md").is_file() {
        return Some(root);
    }
    assert!(std::env::var_os("GRAECO_REQUIRE_ALL").is_none(), "there is no corpus at {}", root.display());
    eprintln!("skipped: there is no corpus at {}", root.display());
    None
}

/// Scene files that stand alone or bring small neighbours, in a fixed order.
fn seeds(root: &Path) -> Vec<PathBuf> {
    let (mut found, mut pending) = (Vec::new(), vec![root.to_path_buf()]);
    while let Some(folder) = pending.pop() {
        for entry in fs::read_dir(&folder).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() {
                pending.push(path);
            } else if path.extension().is_some_and(|e| e == "gltf" || e == "glb")
                && fs::metadata(&path).unwrap().len() <= LARGEST
            {
                found.push(path);
            }
        }
    }
    found.sort();
    found
}

/// A stream of numbers from one seed.
struct Random(u64);

impl Random {
    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        mix64(self.0)
    }

    fn below(&mut self, n: usize) -> usize {
        (self.next() % n.max(1) as u64) as usize
    }
}

/// Numbers that break bounds.
const NUMBERS: [&str; 16] = [
    "-1",
    "0",
    "1",
    "2",
    "3",
    "7",
    "255",
    "65535",
    "65536",
    "4294967295",
    "4294967296",
    "9007199254740993",
    "1e30",
    "-1e-30",
    "0.5",
    "18446744073709551615",
];

/// Changes some bytes of `data`, by one of several kinds of harm.
fn mutate(data: &mut Vec<u8>, random: &mut Random) {
    for _ in 0..=random.below(3) {
        if data.is_empty() {
            return;
        }
        let at = random.below(data.len());
        match random.below(10) {
            0 => data[at] ^= 1 << random.below(8),
            1 => data[at] = random.next() as u8,
            2 => data.truncate(at),
            3 => {
                let end = (at + random.below(64)).min(data.len());
                let copy = data[at..end].to_vec();
                data.splice(at..at, copy);
            }
            4 => {
                let end = (at + random.below(16)).min(data.len());
                data.drain(at..end);
            }
            // Another number in place of one of the JSON text's.
            _ => {
                let Some(start) = data[at..].iter().position(u8::is_ascii_digit).map(|i| at + i) else { continue };
                let end = data[start..].iter().position(|b| !b.is_ascii_digit()).map_or(data.len(), |i| start + i);
                let number = NUMBERS[random.below(NUMBERS.len())];
                data.splice(start..end, number.bytes());
            }
        }
    }
}

/// A GLB whose chunk lengths are right again, so that mutations reach what lies behind the container.
fn repair(data: &mut [u8]) {
    if data.len() < 20 || &data[..4] != b"glTF" {
        return;
    }
    let length = u32::try_from(data.len()).unwrap();
    data[8..12].copy_from_slice(&length.to_le_bytes());
}

/// A folder with copies of the buffers and images of another.
fn twin(folder: &Path) -> TempDir {
    let twin = tempfile::tempdir().unwrap();
    for file in fs::read_dir(folder).unwrap() {
        let file = file.unwrap().path();
        let scene = file.extension().is_some_and(|e| e == "json" || e == "gltf" || e == "glb");
        if file.is_file() && !scene {
            fs::copy(&file, twin.path().join(file.file_name().unwrap())).unwrap();
        }
    }
    twin
}

#[test]
fn mutated_files_never_panic() {
    let Some(root) = corpus() else { return };
    let seeds = seeds(&root);
    assert!(seeds.len() > 200, "the corpus has small files to mutate");
    let longer = std::env::var("GRAECO_FUZZ_SECONDS").ok().map(|s| Duration::from_secs(s.parse().unwrap()));
    let start = Instant::now();
    let (mut loaded, mut refused) = (0_u64, 0_u64);
    let mut folders = BTreeMap::new();
    for iteration in 0.. {
        if iteration >= ITERATIONS && longer.is_none_or(|limit| start.elapsed() > limit) {
            break;
        }
        let mut random = Random(mix64(iteration));
        let seed = &seeds[random.below(seeds.len())];
        let mut data = fs::read(seed).unwrap();
        mutate(&mut data, &mut random);
        if random.below(2) == 0 {
            repair(&mut data);
        }
        let parent = seed.parent().unwrap();
        let folder = folders.entry(parent).or_insert_with(|| twin(parent));
        let path = folder.path().join("mutated").with_extension(seed.extension().unwrap());
        fs::write(&path, &data).unwrap();
        let options = LoadOptions { memory_limit: Some(256 << 20), ..LoadOptions::default() };
        match catch_unwind(AssertUnwindSafe(|| load(&path, &options))) {
            Ok(Ok(_)) => loaded += 1,
            Ok(Err(e)) => {
                refused += 1;
                assert!(!e.to_string().contains('\n'), "iteration {iteration}: {e}");
            }
            Err(_) => {
                let kept = std::env::temp_dir().join(format!("graeco-fuzz-{iteration}")).with_extension("bin");
                fs::write(&kept, &data).unwrap();
                panic!("iteration {iteration}, from {}: panic; see {}", seed.display(), kept.display());
            }
        }
    }
    eprintln!("{loaded} mutated files loaded, {refused} were refused");
}
