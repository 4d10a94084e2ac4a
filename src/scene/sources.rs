//! The files that a scene is made of, and one hash over their content.
//!
//! Two machines hold the same scene exactly if the hashes are equal: it covers the scene file and every file that it
//! refers to, in the order of reference, by content alone. Where the files lie, what the scene file is called and when
//! anything was written play no role; a file that is missing counts as missing.

use super::gltf::{self, LoadOptions};
use crate::Result;
use std::path::{Path, PathBuf};

/// One file of a scene.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct SourceFile {
    /// Its name relative to [`Sources::root`], as the scene refers to it, with `/` between folders.
    pub name: String,
    /// Where it was read, links resolved.
    pub path: PathBuf,
    /// Its length.
    pub bytes: u64,
    /// BLAKE3 of its content.
    pub hash: [u8; 32],
}

/// Everything that a scene is made of.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Sources {
    /// The folder that the scene file stands in.
    pub root: PathBuf,
    /// The scene file, then each file that it refers to, once.
    pub files: Vec<SourceFile>,
    /// References that lead to no file that may be read, each with the reason; the scene is shown without them.
    pub missing: Vec<(String, String)>,
    /// BLAKE3 over the content of all: [`super::Scene::hash`] of the loaded scene.
    pub hash: [u8; 32],
}

/// The files that the scene `path` is made of: those that any view or variant of it may need.
///
/// # Errors
/// If the scene file cannot be read or is no glTF.
pub fn sources(path: &Path) -> Result<Sources> {
    gltf::sources(path, &LoadOptions::default())
}

/// One hash over the scene file's and its references' (`None` where missing), in order.
pub(super) fn hash_of(scene: [u8; 32], references: impl Iterator<Item = Option<[u8; 32]>>) -> [u8; 32] {
    let mut hasher = blake3::Hasher::new();
    hasher.update(&scene);
    for reference in references {
        hasher.update(&[u8::from(reference.is_some())]);
        hasher.update(&reference.unwrap_or_default());
    }
    *hasher.finalize().as_bytes()
}
