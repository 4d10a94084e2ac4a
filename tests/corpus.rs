//! The corpus of real and of broken files: what loads, loads whole; what does not, ends in one sentence.
#![allow(
    clippy::unwrap_used,
    clippy::print_stderr,
    clippy::print_stdout,
    clippy::cast_possible_truncation,
    clippy::cast_precision_loss,
    reason = "helpers of tests: a failure is a panic, numbers are small, and skipped tests say so"
)]

#[path = "support/corpus.rs"]
mod files;

use files::{corpus, files};
use graeco::scene::gltf::{LoadOptions, load};
use graeco::scene::{Interpolation, Mesh, Pixels, Property, Scene, Track};
use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::fs;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::Path;

/// Cells of the table rows in `SOURCES.md`, by file.
fn rows(root: &Path) -> Vec<Vec<String>> {
    let text = fs::read_to_string(root.join("SOURCES.md")).unwrap();
    text.lines()
        .filter(|line| line.starts_with("| ") && (line.contains(".gltf |") || line.contains(".glb |")))
        .map(|line| line.trim_matches('|').split(" | ").map(|cell| cell.trim().to_owned()).collect())
        .collect()
}

/// Loads without letting a panic through.
fn outcome(path: &Path) -> Result<Scene, String> {
    match catch_unwind(AssertUnwindSafe(|| load(path, &LoadOptions::default()))) {
        Ok(Ok(scene)) => Ok(scene),
        Ok(Err(e)) => Err(e.to_string()),
        Err(_) => Err("PANIC".to_owned()),
    }
}

/// Triangles in all scenes of a file, each mesh of a scene counted once.
fn triangles(path: &Path) -> Result<usize, String> {
    let mut total = 0;
    // The validator counts the file, we load a scene: files whose scenes differ are loaded scene by scene.
    let scenes: &[Option<usize>] =
        if path.ends_with("SubMesh-Draco/SubMesh-Draco.gltf") { &[Some(0), Some(1)] } else { &[None] };
    for &scene in scenes {
        let options = LoadOptions { scene, ..LoadOptions::default() };
        total +=
            load(path, &options).map_err(|e| e.to_string())?.meshes.iter().map(|m| m.triangles.len()).sum::<usize>();
    }
    Ok(total)
}

/// Every real file loads, with as many triangles as Khronos's validator counted.
#[test]
fn real_files_load_with_the_triangles_that_the_validator_counts() {
    let Some(root) = corpus() else { return };
    let mut report = String::new();
    let mut count = 0;
    for row in rows(&root).iter().filter(|row| row.len() >= 8 && !row[0].starts_with("invalid/")) {
        count += 1;
        let mut expected: usize = row[4].parse().unwrap();
        // Its only primitive has texture coordinates alone, which the validator counts and nobody can draw.
        if row[0].ends_with("texcoord-flip-short-material.glb") {
            expected = 0;
        }
        match triangles(&root.join(&row[0])) {
            Err(e) => writeln!(report, "{e}").unwrap(),
            Ok(triangles) if triangles != expected => {
                writeln!(report, "{}: {triangles} triangles, expected {expected}", row[0]).unwrap();
            }
            Ok(_) => {}
        }
    }
    assert_eq!(count, 129, "SOURCES.md lists 129 real files");
    assert!(report.is_empty(), "\n{report}");
}

/// What every loaded scene promises to the stages after it.
fn check_invariants(scene: &Scene, name: &str) {
    let mut seen = vec![false; scene.nodes.len()];
    for &n in &scene.order {
        assert!(!std::mem::replace(&mut seen[n], true), "{name}: node {n} stands twice in the order");
        assert!(scene.nodes[n].parent.is_none_or(|p| seen[p]), "{name}: node {n} stands before its parent");
    }
    assert!(seen.iter().all(|&s| s), "{name}: the order lacks a node");
    for node in &scene.nodes {
        assert!(node.meshes.iter().all(|&m| m < scene.meshes.len()));
        assert!(
            node.camera.is_none_or(|c| c < scene.cameras.len()) && node.light.is_none_or(|l| l < scene.lights.len())
        );
        let skin = node.skin.map(|s| &scene.skins[s]);
        for &m in &node.meshes {
            assert_eq!(node.weights.len(), scene.meshes[m].targets.len(), "{name}");
            if let (Some(skin), Some(binding)) = (skin, &scene.meshes[m].skin) {
                assert!(binding.joints.iter().all(|&j| usize::from(j) < skin.joints.len()), "{name}");
            }
        }
    }
    for skin in &scene.skins {
        assert_eq!(skin.joints.len(), skin.inverse_bind.len());
        assert!(skin.joints.iter().all(|&j| j < scene.nodes.len()));
    }
    scene.meshes.iter().for_each(|mesh| check_mesh(mesh, scene, name));
    for texture in &scene.textures {
        assert!(texture.image < scene.images.len());
    }
    for material in &scene.materials {
        material.clone().retain_textures(&mut |t| {
            assert!(t.texture < scene.textures.len() && t.transform.is_finite(), "{name}");
            true
        });
    }
    for image in &scene.images {
        let pixels = match &image.pixels {
            Pixels::Rgba8(p) => p.len(),
            Pixels::Rgba16(p) => p.len(),
            Pixels::RgbF32(p) => p.len(),
        };
        assert_eq!(pixels, image.width as usize * image.height as usize);
    }
    for channel in scene.animations.iter().flat_map(|a| &a.channels) {
        assert!(channel.node < scene.nodes.len());
        match &channel.property {
            Property::Translation(t) | Property::Scale(t) => check_track(t, name),
            Property::Rotation(t) => check_track(t, name),
            Property::Weights(t) | Property::Visibility(t) => check_track(t, name),
        }
    }
}

fn check_track<T>(track: &Track<T>, name: &str) {
    let per_key = track.width * if track.interpolation == Interpolation::CubicSpline { 3 } else { 1 };
    assert!(!track.times.is_empty() && track.values.len() == track.times.len() * per_key, "{name}");
    assert!(track.times.windows(2).all(|w| w[0] <= w[1]), "{name}");
}

fn check_mesh(mesh: &Mesh, scene: &Scene, name: &str) {
    let vertices = mesh.positions.len();
    assert!(mesh.material < scene.materials.len());
    assert!(mesh.triangles.iter().flatten().all(|&i| (i as usize) < vertices), "{name}: index out of range");
    assert!(mesh.positions.iter().all(|p| p.is_finite()), "{name}");
    for (what, count) in
        [("normals", mesh.normals.len()), ("tangents", mesh.tangents.len()), ("colours", mesh.colors.len())]
    {
        assert!(count == 0 || count == vertices, "{name}: {count} {what} for {vertices} vertices");
    }
    assert!(mesh.uvs.iter().all(|u| u.len() == vertices && u.iter().all(|c| c.is_finite())), "{name}");
    assert!(mesh.normals.iter().all(|n| (n.length() - 1.0).abs() < 1e-6), "{name}: normals have unit length");
    assert!(
        mesh.tangents
            .iter()
            .all(|t| (t.truncate().length() - 1.0).abs() < 1e-6 && t.w.abs().to_bits() == 1.0_f32.to_bits()),
        "{name}"
    );
    if let Some(skin) = &mesh.skin {
        assert_eq!((skin.joints.len(), skin.weights.len()), (vertices * skin.influences, vertices * skin.influences));
        for weights in skin.weights.chunks(skin.influences) {
            assert!((weights.iter().sum::<f32>() - 1.0).abs() < 1e-5 && weights.iter().all(|&w| w >= 0.0), "{name}");
        }
    }
    for target in &mesh.targets {
        for list in [&target.positions, &target.normals, &target.tangents] {
            assert!(list.is_empty() || list.len() == vertices, "{name}");
        }
    }
}

/// Whatever loads keeps what the later stages rely on.
#[test]
fn loaded_scenes_keep_their_invariants() {
    let Some(root) = corpus() else { return };
    for path in files(&root) {
        if let Ok(scene) = outcome(&path) {
            check_invariants(&scene, &path.display().to_string());
        }
    }
}

/// Broken files load with a warning or end in one sentence that names the file.
#[test]
fn broken_files_end_in_one_sentence() {
    let Some(root) = corpus() else { return };
    let mut counts: BTreeMap<&str, (usize, usize)> = BTreeMap::new();
    for category in ["errors", "accepted", "assimp"] {
        for path in files(&root.join("invalid").join(category)) {
            let (loaded, refused) = counts.entry(category).or_default();
            match outcome(&path) {
                Ok(scene) => {
                    *loaded += 1;
                    if std::env::var_os("GRAECO_SHOW").is_some() {
                        eprintln!("loaded  {}", path.strip_prefix(&root).unwrap().display());
                        scene.warnings.iter().for_each(|w| eprintln!("    {w}"));
                    }
                }
                Err(sentence) => {
                    *refused += 1;
                    if std::env::var_os("GRAECO_SHOW").is_some() {
                        eprintln!("refused {sentence}");
                    }
                    assert_ne!(sentence, "PANIC", "{}", path.display());
                    assert!(sentence.contains(path.file_name().unwrap().to_str().unwrap()), "{sentence}");
                    assert!(!sentence.contains('\n'), "{sentence}");
                }
            }
        }
    }
    for (category, (loaded, refused)) in counts {
        eprintln!("invalid/{category}: {loaded} loaded, {refused} refused with a sentence");
    }
}
