//! Every file that a document refers to, whether or not the chosen view of it needs it.

use super::context::{Context, label};
use super::uri;
use crate::scene::sources::{SourceFile, Sources, hash_of};
use crate::{Error, Result};
use std::collections::BTreeMap;

/// Lists and hashes the scene file, whose bytes have the hash `scene`, and what it refers to. Files that the import has
/// read are not read again, so the hash is that of what was loaded.
pub(super) fn list(ctx: &Context<'_>, scene: (u64, [u8; 32])) -> Result<Sources> {
    let root = uri::folder_of(&ctx.path);
    let file = ctx.scene_file();
    let own_name = file.file_name().unwrap_or_default().to_string_lossy().into_owned();
    let own = SourceFile { name: own_name, path: file, bytes: scene.0, hash: scene.1 };
    let (mut files, mut missing) = (vec![own], Vec::new());
    let mut known: BTreeMap<&str, Option<[u8; 32]>> = BTreeMap::new();
    let buffers = ctx.doc.buffers.iter().enumerate().map(|(i, b)| ("buffer", i, &b.uri));
    let images = ctx.doc.images.iter().enumerate().map(|(i, b)| ("image", i, &b.uri));
    let mut hashes = Vec::new();
    for (kind, index, reference) in buffers.chain(images) {
        let Some(reference) = reference.as_deref().filter(|u| !uri::is_data(u)) else { continue };
        let hash = match known.get(reference) {
            Some(hash) => *hash,
            None => {
                let found = open(ctx, reference, &label(kind, index, ""));
                let hash = found.as_ref().ok().map(|file| file.hash);
                match found {
                    Ok(file) if files.iter().any(|f| f.name == file.name) => {}
                    Ok(file) => files.push(file),
                    Err(Error::Scene { problem, .. }) => missing.push((reference.to_owned(), problem)),
                    Err(error) => missing.push((reference.to_owned(), error.to_string())),
                }
                known.insert(reference, hash);
                hash
            }
        };
        hashes.push(hash);
    }
    let hash = hash_of(scene.1, hashes.into_iter());
    if let Some(pack) = &ctx.pack {
        let (found, packed) = (blake3::Hash::from_bytes(hash).to_hex(), &pack.manifest().scene_hash);
        if found.as_str() != packed {
            return Err(ctx.error("archive", format!("holds a scene with the hash {found}, but lists {packed}")));
        }
    }
    Ok(Sources { root, files, missing, hash })
}

fn open(ctx: &Context<'_>, reference: &str, object: &str) -> Result<SourceFile> {
    let (path, name) = uri::resolve(ctx, reference, object)?;
    if let Some((bytes, hash)) = ctx.counted(&path) {
        return Ok(SourceFile { name, path, bytes, hash });
    }
    let content = uri::read_bounded(ctx, &path, object)?;
    Ok(SourceFile { name, path, bytes: content.len() as u64, hash: *blake3::hash(&content).as_bytes() })
}

#[cfg(test)]
mod tests {
    use crate::scene::{gltf, sources};
    use std::fs;
    use std::path::{Path, PathBuf};

    /// A scene that shows nothing, with an image that nothing uses and one that is missing.
    fn scene(folder: &Path, name: &str, texel: &[u8]) -> PathBuf {
        let json = r#"{"asset": {"version": "2.0"}, "images": [{"uri": "maps/./a%20b.png"}, {"uri": "gone.png"},
            {"uri": "data:,x"}, {"uri": "maps/a b.png"}, {"uri": "../out.png"}]}"#;
        fs::create_dir_all(folder.join("maps")).unwrap();
        fs::write(folder.join("maps/a b.png"), texel).unwrap();
        fs::write(folder.join(name), json).unwrap();
        folder.join(name)
    }

    #[test]
    fn the_hash_is_that_of_the_content_wherever_it_lies() {
        let (one, other) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
        let path = scene(one.path(), "a.gltf", b"texel");
        let listed = sources(&path).unwrap();
        let names: Vec<&str> = listed.files.iter().map(|f| f.name.as_str()).collect();
        assert_eq!(names, ["a.gltf", "maps/a b.png"]);
        assert_eq!((listed.files[1].bytes, listed.root.as_path()), (5, one.path()));
        let missing: Vec<&str> = listed.missing.iter().map(|m| m.0.as_str()).collect();
        assert_eq!(missing, ["gone.png", "../out.png"]);
        assert_eq!(gltf::load(&path, &gltf::LoadOptions::default()).unwrap().hash, listed.hash);
        let copy = scene(other.path(), "copy.gltf", b"texel");
        assert_eq!(sources(&copy).unwrap().hash, listed.hash);
        scene(other.path(), "copy.gltf", b"other");
        assert_ne!(sources(&copy).unwrap().hash, listed.hash);
        fs::remove_file(other.path().join("maps/a b.png")).unwrap();
        assert_ne!(sources(&copy).unwrap().hash, listed.hash);
    }
}
