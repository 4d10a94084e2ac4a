//! The corpus of glTF files that some tests read.
#![allow(clippy::unwrap_used, clippy::print_stderr, reason = "a test that cannot begin has failed or says so")]

use std::fs;
use std::path::{Path, PathBuf};

/// The corpus, from `GRAECO_CORPUS` or beside the crate; `None`, said aloud, where it is absent.
pub(crate) fn corpus() -> Option<PathBuf> {
    let root = std::env::var_os("GRAECO_CORPUS")
        .map_or_else(|| Path::new(env!("CARGO_MANIFEST_DIR")).join("../shared/gltf"), PathBuf::from);
    if root.join("SOURCES.md").is_file() {
        return Some(root);
    }
    assert!(std::env::var_os("GRAECO_REQUIRE_ALL").is_none(), "there is no corpus at {}", root.display());
    eprintln!("skipped: there is no corpus at {}", root.display());
    None
}

/// Every glTF file below `folder`, in a fixed order.
pub(crate) fn files(folder: &Path) -> Vec<PathBuf> {
    let (mut found, mut pending) = (Vec::new(), vec![folder.to_path_buf()]);
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
