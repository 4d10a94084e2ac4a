//! Mutated corpus files: whatever the bytes, the loader returns; it never panics, hangs or takes the machine's memory.
//! What it lets through can be looked at: the scene is baked at an instant and over an exposure.

use crate::corpus::{corpus, files};
use crate::{Random, fuzz};
use graeco::scene::Scene;
use graeco::scene::gltf::{LoadOptions, load};
use graeco::scene::rig::{Playback, Rig};
use graeco::scene::view::{View, ViewRequest};
use graeco::time::Exposure;
use std::collections::BTreeMap;
use std::fs;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::Path;
use tempfile::TempDir;

/// Files larger than this are left out: mutations would rarely hit what matters.
const LARGEST: u64 = 64 << 10;

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
                data.splice(start..end, random.pick(&NUMBERS).bytes());
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

/// Looks at `scene` at an instant and over an exposure; what the stage says must be numbers.
fn look(scene: &Scene, random: &mut Random) {
    let Ok(rig) = Rig::new(scene, &Playback { animation: None, looped: random.below(2) == 0 }) else { return };
    let request = ViewRequest { motion_error: 0.5, size: (64, 48), pixel_aspect: 1.0, ..ViewRequest::default() };
    let Ok(view) = View::new(&rig, &request) else { return };
    let open = random.pick(&[-1.0, 0.0, 0.3, 1e6]);
    for length in [0.0, 1.0 / 48.0] {
        let stage = view.stage(&rig, Exposure { open, close: open + length });
        for instance in &stage.instances {
            let times = instance.motion.times();
            assert!(times.windows(2).all(|w| w[0] <= w[1]), "key times ascend: {times:?}");
            assert!(instance.geometry < stage.geometries.len() && instance.node < scene.nodes.len());
        }
        for geometry in &stage.geometries {
            let mesh = &scene.meshes[geometry.mesh];
            assert!(geometry.keys.iter().all(|k| k.positions.len() == mesh.positions.len()));
            assert!(mesh.triangles.iter().flatten().all(|&i| (i as usize) < mesh.positions.len()));
        }
    }
}

#[test]
fn mutated_files_never_panic() {
    let Some(root) = corpus() else { return };
    let small = |path: &std::path::PathBuf| fs::metadata(path).unwrap().len() <= LARGEST;
    let seeds: Vec<_> = files(&root).into_iter().filter(small).collect();
    assert!(seeds.len() > 200, "the corpus has small files to mutate");
    let (mut loaded, mut refused) = (0_u64, 0_u64);
    let mut folders = BTreeMap::new();
    fuzz("loader", 3000, |iteration, random| {
        let seed = &seeds[random.below(seeds.len())];
        let mut data = fs::read(seed).unwrap();
        mutate(&mut data, random);
        if random.below(2) == 0 {
            repair(&mut data);
        }
        let parent = seed.parent().unwrap();
        let folder = folders.entry(parent).or_insert_with(|| twin(parent));
        let path = folder.path().join("mutated").with_extension(seed.extension().unwrap());
        fs::write(&path, &data).unwrap();
        let options = LoadOptions { memory_limit: Some(256 << 20), ..LoadOptions::default() };
        let attempt = AssertUnwindSafe(|| load(&path, &options).inspect(|scene| look(scene, random)));
        match catch_unwind(attempt) {
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
    });
    eprintln!("{loaded} mutated files loaded, {refused} were refused");
    assert!(loaded > 100 && refused > 100, "mutations are neither harmless nor all fatal");
}
