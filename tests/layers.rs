//! Data flows one way: a module uses only modules above it. This reads the `use` lines and fails on an upward one.
#![allow(
    clippy::unwrap_used,
    clippy::print_stderr,
    clippy::print_stdout,
    clippy::cast_possible_truncation,
    clippy::cast_precision_loss,
    reason = "helpers of tests: a failure is a panic, numbers are small, and skipped tests say so"
)]

use std::fs;
use std::path::{Path, PathBuf};

/// From first to last; a module may use those before it and itself.
const LAYERS: [&str; 13] = [
    "error", "numeric", "time", "factor", "scene", "effects", "design", "trace", "film", "output", "render", "farm",
    "study",
];

fn sources(folder: &Path, out: &mut Vec<PathBuf>) {
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            sources(&path, out);
        } else if path.extension().is_some_and(|e| e == "rs") {
            out.push(path);
        }
    }
}

/// The modules that a source names after `crate::`, test code at its end left out.
fn named(source: &str) -> Vec<&str> {
    let code = source.split("#[cfg(test)]\nmod tests {").next().unwrap_or(source);
    code.lines()
        .filter(|line| !line.trim_start().starts_with("//"))
        .flat_map(|line| line.match_indices("crate::").map(move |(i, m)| &line[i + m.len()..]))
        .map(|rest| rest.split(|c: char| !c.is_ascii_alphanumeric() && c != '_').next().unwrap_or(""))
        .collect()
}

#[test]
fn no_module_uses_one_below_it() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    let mut files = Vec::new();
    sources(&root, &mut files);
    assert!(files.len() > 20, "the sources were not found");
    let mut upward = Vec::new();
    for file in files {
        let inside = file.strip_prefix(&root).unwrap();
        let module = inside.iter().next().unwrap().to_str().unwrap().trim_end_matches(".rs");
        let Some(own) = LAYERS.iter().position(|l| *l == module) else { continue };
        // Tests in files of their own may look anywhere.
        if inside.file_stem().is_some_and(|s| s == "tests") {
            continue;
        }
        let source = fs::read_to_string(&file).unwrap();
        for used in named(&source) {
            if LAYERS.iter().position(|l| *l == used).is_some_and(|layer| layer > own) {
                upward.push(format!("{} uses {used}", inside.display()));
            }
        }
    }
    assert!(upward.is_empty(), "arrows against the data's way: {upward:#?}");
}

#[test]
fn an_upward_arrow_would_be_seen() {
    assert_eq!(named("use crate::render::Progress;\nlet x = crate::film::Film::new();"), ["render", "film"]);
    assert!(named("// crate::render\n").is_empty());
}
