//! The corpus of real and of broken files: what loads, loads whole; what does not, ends in one sentence.

use graeco::scene::gltf::{LoadOptions, load};
use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::fs;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};

/// The corpus, from `GRAECO_CORPUS` or beside the crate; `None`, said aloud, where it is absent.
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

/// Cells of the table rows in `SOURCES.md`, by file.
fn rows(root: &Path) -> Vec<Vec<String>> {
    let text = fs::read_to_string(root.join("SOURCES.md")).unwrap();
    text.lines()
        .filter(|line| line.starts_with("| ") && (line.contains(".gltf |") || line.contains(".glb |")))
        .map(|line| line.trim_matches('|').split(" | ").map(|cell| cell.trim().to_owned()).collect())
        .collect()
}

/// Every glTF file below `folder`.
fn files(folder: &Path) -> Vec<PathBuf> {
    let mut found = Vec::new();
    let mut pending = vec![folder.to_path_buf()];
    while let Some(folder) = pending.pop() {
        for entry in fs::read_dir(&folder).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() {
                pending.push(path);
            } else if path.extension().is_some_and(|e| e == "gltf" || e == "glb") {
                found.push(path);
            }
        }
    }
    found.sort();
    found
}

/// Loads without letting a panic through.
fn outcome(path: &Path) -> Result<graeco::scene::Scene, String> {
    match catch_unwind(AssertUnwindSafe(|| load(path, &LoadOptions::default()))) {
        Ok(Ok(scene)) => Ok(scene),
        Ok(Err(e)) => Err(e.to_string()),
        Err(_) => Err("PANIC".to_owned()),
    }
}

/// Every real file loads, with as many triangles as Khronos's validator counted.
#[test]
fn real_files_load_with_the_triangles_that_the_validator_counts() {
    let Some(root) = corpus() else { return };
    let mut report = String::new();
    let mut count = 0;
    for row in rows(&root).iter().filter(|row| row.len() >= 8 && !row[0].starts_with("invalid/")) {
        count += 1;
        let expected: usize = row[4].parse().unwrap();
        match outcome(&root.join(&row[0])) {
            Err(e) => writeln!(report, "{e}").unwrap(),
            Ok(scene) => {
                let triangles: usize = scene.meshes.iter().map(|m| m.triangles.len()).sum();
                if triangles != expected {
                    writeln!(report, "{}: {triangles} triangles, expected {expected}", row[0]).unwrap();
                }
                if std::env::var_os("GRAECO_SHOW").is_some() {
                    eprintln!("{}", row[0]);
                    scene.warnings.iter().for_each(|w| eprintln!("    {w}"));
                }
            }
        }
    }
    assert_eq!(count, 129, "SOURCES.md lists 129 real files");
    assert!(report.is_empty(), "\n{report}");
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
