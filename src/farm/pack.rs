//! Writes a scene with everything that it refers to into one file, and takes it apart again; [`crate::scene::pack`] reads
//! it.

use crate::output::file;
use crate::scene::pack::{self, FORMAT, MANIFEST, Pack, PackManifest, PackedFile};
use crate::scene::sources;
use crate::{Error, Result};
use std::fs::{self, File};
use std::io::{self, BufWriter, Read, Write};
use std::path::Path;
use zip::write::SimpleFileOptions;
use zip::{CompressionMethod, ZipWriter};

/// What was packed.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Packed {
    /// How many files.
    pub files: usize,
    /// Their bytes.
    pub bytes: u64,
    /// Hash of the whole scene, hexadecimal.
    pub scene_hash: String,
    /// References that lead to no file that may be read, each with the reason: the scene is shown without them, packed
    /// or not.
    pub missing: Vec<(String, String)>,
}

/// Packs the glTF file `scene` and what it refers to into the archive `out`.
///
/// Equal content gives equal archives, byte for byte.
///
/// # Errors
/// If the scene cannot be read, is packed already, changes meanwhile, or `out` cannot be written.
pub fn write(scene: &Path, out: &Path) -> Result<Packed> {
    if pack::is_archive(scene) {
        return Err(Error::invalid(scene.display().to_string(), "is packed already"));
    }
    let sources = sources(scene)?;
    let name_of_scene = sources.files.first().map(|f| f.name.clone()).unwrap_or_default();
    let manifest = PackManifest {
        format: FORMAT.to_owned(),
        program: format!("graeco {}", env!("CARGO_PKG_VERSION")),
        scene: name_of_scene,
        scene_hash: hex(sources.hash),
        files: sources
            .files
            .iter()
            .map(|f| PackedFile { name: f.name.clone(), bytes: f.bytes, blake3: hex(f.hash) })
            .collect(),
    };
    if let Some(file) = manifest.files.iter().find(|f| f.name == MANIFEST) {
        return Err(Error::invalid(file.name.clone(), "is a name that a packed scene needs for itself"));
    }
    file::make_folder_of(out)?;
    file::write_whole_with(out, |file| {
        let mut zip = ZipWriter::new(BufWriter::new(file));
        let failed = |e: zip::result::ZipError| Error::io(out, "write", io::Error::from(e));
        // The list comes first, so that an archive that was cut short names what it lacks.
        zip.start_file(MANIFEST, options(0)).map_err(failed)?;
        let json = serde_json::to_string_pretty(&manifest).map_err(|e| Error::invalid(MANIFEST, e.to_string()))?;
        zip.write_all(json.as_bytes()).map_err(|e| Error::io(out, "write", e))?;
        for source in &sources.files {
            zip.start_file(source.name.as_str(), options(source.bytes)).map_err(failed)?;
            copy(&source.path, source.hash, &mut zip, out)?;
        }
        let mut file = zip.finish().map_err(failed)?;
        file.flush().map_err(|e| Error::io(out, "write", e))
    })?;
    Ok(Packed {
        files: manifest.files.len(),
        bytes: manifest.files.iter().map(|f| f.bytes).sum(),
        scene_hash: manifest.scene_hash,
        missing: sources.missing,
    })
}

/// Stored as they are: pictures and most buffers are compressed already, a reader can trust lengths, and archives do
/// not depend on a compressor's version. Without dates, equal content gives equal archives.
fn options(bytes: u64) -> SimpleFileOptions {
    SimpleFileOptions::default().compression_method(CompressionMethod::Stored).large_file(bytes > u64::from(u32::MAX))
}

fn hex(hash: [u8; 32]) -> String {
    blake3::Hash::from_bytes(hash).to_hex().to_string()
}

/// Copies the file `path`, which had `hash` when it was listed.
fn copy(path: &Path, hash: [u8; 32], to: &mut impl Write, out: &Path) -> Result<()> {
    const BLOCK: usize = 1 << 20;
    let mut file = File::open(path).map_err(|e| Error::io(path, "read", e))?;
    let (mut hasher, mut block) = (blake3::Hasher::new(), vec![0; BLOCK]);
    loop {
        let n = file.read(&mut block).map_err(|e| Error::io(path, "read", e))?;
        if n == 0 {
            break;
        }
        hasher.update(&block[..n]);
        to.write_all(&block[..n]).map_err(|e| Error::io(out, "write", e))?;
    }
    if *hasher.finalize().as_bytes() == hash {
        Ok(())
    } else {
        Err(Error::invalid(path.display().to_string(), "changed while it was packed; try again"))
    }
}

/// Takes the archive `pack` apart into `folder`, which must be new or empty, and compares every file with its hash.
/// Gives the scene file's name.
///
/// # Errors
/// If the archive is not what `graeco pack` wrote, a file in it is damaged, or `folder` cannot be written.
pub fn unpack(pack: &Path, folder: &Path) -> Result<String> {
    let pack = Pack::open(pack)?;
    if fs::read_dir(folder).is_ok_and(|mut entries| entries.next().is_some()) {
        return Err(Error::invalid(folder.display().to_string(), "is not empty, expected a new or empty folder"));
    }
    for file in &pack.manifest().files {
        let content = pack.read(&file.name)?;
        let path = folder.join(&file.name);
        file::make_folder_of(&path)?;
        file::write_whole(&path, &content)?;
    }
    Ok(pack.manifest().scene.clone())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::gltf::{LoadOptions, load};

    fn scene(folder: &Path) -> std::path::PathBuf {
        let json = r#"{"asset": {"version": "2.0"}, "images": [{"uri": "maps/./a%20b.png"}, {"uri": "gone.png"}]}"#;
        fs::create_dir_all(folder.join("maps")).unwrap();
        fs::write(folder.join("maps/a b.png"), b"texel").unwrap();
        fs::write(folder.join("shot.gltf"), json).unwrap();
        folder.join("shot.gltf")
    }

    #[test]
    fn a_packed_scene_has_the_hash_of_the_folder_and_comes_apart_into_it() {
        let folder = tempfile::tempdir().unwrap();
        let path = scene(folder.path());
        let zip = folder.path().join("out/shot.zip");
        let packed = write(&path, &zip).unwrap();
        assert_eq!((packed.files, packed.missing.len()), (2, 1));
        let options = LoadOptions::default();
        let (plain, other) = (load(&path, &options).unwrap(), load(&zip, &options).unwrap());
        assert_eq!(plain.hash, other.hash);
        assert_eq!(packed.scene_hash, hex(plain.hash));
        let apart = folder.path().join("apart");
        assert_eq!(unpack(&zip, &apart).unwrap(), "shot.gltf");
        assert_eq!(load(&apart.join("shot.gltf"), &options).unwrap().hash, plain.hash);
        assert!(unpack(&zip, &apart).unwrap_err().to_string().contains("is not empty"));
        assert!(write(&zip, &path).unwrap_err().to_string().contains("packed already"));
    }

    #[test]
    fn equal_scenes_give_equal_archives() {
        let folder = tempfile::tempdir().unwrap();
        let path = scene(folder.path());
        let (a, b) = (folder.path().join("a.zip"), folder.path().join("b.zip"));
        write(&path, &a).unwrap();
        write(&path, &b).unwrap();
        assert_eq!(fs::read(a).unwrap(), fs::read(b).unwrap());
    }
}
