//! Import of glTF 2.0 (`.gltf`, `.glb`) with its ratified extensions.
//!
//! A file is untrusted. References stay inside its folder, every index, count and range is checked, and memory is
//! bounded before it is allocated. What is broken but usable is loaded with a warning; what is not ends in one
//! sentence that names the object. glTF's words stop here: the rest of the program knows [`Scene`] alone.
//!
//! Only what the chosen scene shows is loaded: nodes lead to meshes, meshes to materials, materials to textures,
//! textures to images.

mod accessors;
mod animations;
mod attributes;
mod audit;
mod buffers;
mod cameras;
mod container;
mod context;
mod draco;
mod extras;
mod lights_image_based;
mod material_extensions;
mod materials;
mod meshes;
mod meshopt;
mod nodes;
mod references;
mod schema;
mod tangents;
#[cfg(test)]
mod tests;
mod textures;
mod uri;
mod variants;

use super::sources::Sources;
use super::{ExtensionUse, Scene};
use crate::Result;
use buffers::Buffers;
use context::Context;
use std::path::Path;

/// How to import.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct LoadOptions {
    /// Whether buffers and images may lie outside the file's folder: lifts the refusal of absolute paths, of ways out
    /// by `..` and of links; network references are refused all the same.
    pub allow_outside: bool,
    /// The scene to show, by index; `None` is the file's default, else its first.
    pub scene: Option<usize>,
    /// The material variant to wear (`KHR_materials_variants`); `None` is what the file shows without one.
    pub variant: Option<String>,
    /// Bytes that everything decoded may take together; `None` allows 512 MiB and 64 times what was read.
    pub memory_limit: Option<u64>,
}

/// Loads the scene that `path` shows: a glTF file, or one that is [packed](super::pack) with what it refers to.
///
/// # Errors
/// One sentence if the file cannot be read, breaks the format beyond use, refers to files it may not, asks for more
/// memory than its size warrants, or requires an extension that is not supported.
pub fn load(path: &Path, options: &LoadOptions) -> Result<Scene> {
    let mut ctx = Context::open(path, options)?;
    let file = ctx.scene_file();
    let bytes = uri::read_bounded(&ctx, &file, "file")?;
    let identity = ctx.count_file(&file, &bytes);
    let (doc, binary) = container::open(&ctx, &bytes)?;
    drop(bytes);
    ctx.doc = doc;
    container::check(&ctx)?;
    variants::check(&ctx)?;
    let buffers = Buffers::read(&ctx, binary)?;
    let tree = nodes::tree(&ctx)?;
    let mut stock = nodes::load(&ctx, &buffers, &tree)?;
    let targets = |node: &super::Node| node.weights.len();
    let animations = animations::load(&ctx, &buffers, &tree, &mut stock.nodes, targets)?;
    let environment = lights_image_based::load(&ctx, &buffers)?;
    let (mut materials, wanted) = stock.materials.into_parts();
    let (textures, images) = wanted.decode(&ctx, &buffers, &mut materials)?;
    audit::check(&ctx, &buffers);
    Ok(Scene {
        path: path.to_path_buf(),
        order: (0..stock.nodes.len()).collect(),
        nodes: stock.nodes,
        meshes: stock.meshes.into_list(),
        materials,
        textures,
        images,
        lights: stock.lights,
        cameras: stock.cameras,
        skins: stock.skins,
        animations,
        environment,
        extensions: extensions(&ctx),
        warnings: ctx.take_warnings(),
        hash: references::list(&ctx, identity)?.hash,
    })
}

/// The files that the scene `path` is made of, as [`load`] would find them: those that any view of it may need.
///
/// # Errors
/// If the scene file cannot be read or is no glTF.
pub fn sources(path: &Path, options: &LoadOptions) -> Result<Sources> {
    let mut ctx = Context::open(path, options)?;
    let file = ctx.scene_file();
    let bytes = uri::read_bounded(&ctx, &file, "file")?;
    let identity = ctx.count_file(&file, &bytes);
    ctx.doc = container::open(&ctx, &bytes)?.0;
    references::list(&ctx, identity)
}

/// Every extension that the file names.
fn extensions(ctx: &Context<'_>) -> Vec<ExtensionUse> {
    let mut names: Vec<&String> = ctx.doc.extensions_used.iter().chain(&ctx.doc.extensions_required).collect();
    names.sort();
    names.dedup();
    names
        .into_iter()
        .map(|name| ExtensionUse {
            name: name.clone(),
            required: ctx.doc.extensions_required.contains(name),
            supported: container::SUPPORTED.contains(&name.as_str()),
        })
        .collect()
}
