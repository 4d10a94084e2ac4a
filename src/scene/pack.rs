//! A scene in one file: a ZIP archive of stored entries with a manifest of their hashes, as `graeco pack` writes it.
//!
//! The archive holds the scene file and every file that it refers to, under the names by which it refers to them, and
//! [`MANIFEST`], which lists them with lengths and BLAKE3 hashes. What is read from it is compared with the manifest
//! first, so a machine at the other end renders what was packed or says which file differs.
//!
//! An archive is untrusted. Nothing is compressed, so it holds no more than its own length; names that lead out of a
//! folder, and entries that the manifest does not list, are refused before anything is read.

use crate::{Error, Result};
use serde::{Deserialize, Serialize};
use std::collections::{BTreeMap, BTreeSet};
use std::fs::File;
use std::io::{BufReader, Read};
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};
use zip::ZipArchive;

/// Name of the list of files inside an archive.
pub const MANIFEST: &str = "graeco-pack.json";
/// What [`PackManifest::format`] says.
pub const FORMAT: &str = "graeco-pack-1";
/// The longest manifest that is read, bytes: some 100 000 files.
const LONGEST_MANIFEST: u64 = 16 << 20;

/// One packed file.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct PackedFile {
    /// Its name as the scene refers to it, with `/` between folders.
    pub name: String,
    /// Its length.
    pub bytes: u64,
    /// BLAKE3 of its content, hexadecimal.
    pub blake3: String,
}

/// What an archive holds.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct PackManifest {
    /// [`FORMAT`].
    pub format: String,
    /// The program that packed it, and its version.
    pub program: String,
    /// Name of the scene file among `files`.
    pub scene: String,
    /// Hash of the whole scene, [`super::Sources::hash`], hexadecimal.
    pub scene_hash: String,
    /// Every file.
    pub files: Vec<PackedFile>,
}

/// An archive that is open for reading.
#[derive(Debug)]
pub struct Pack {
    path: PathBuf,
    manifest: PackManifest,
    files: BTreeMap<String, PackedFile>,
    archive: Mutex<ZipArchive<BufReader<File>>>,
}

/// Whether the file `path` is a ZIP archive, by its first bytes. What cannot be read is none.
#[must_use]
pub fn is_archive(path: &Path) -> bool {
    let mut magic = [0; 4];
    // Only regular files: opening a pipe would wait for its writer.
    path.is_file()
        && File::open(path).and_then(|mut file| file.read_exact(&mut magic)).is_ok()
        && matches!(&magic, b"PK\x03\x04" | b"PK\x05\x06")
}

/// Whether a name stays inside the folder that it is relative to, on every system.
fn stays_inside(name: &str) -> bool {
    !name.contains(['\\', ':', '\0']) && name.split('/').all(|part| !matches!(part, "" | "." | ".."))
}

impl Pack {
    /// Opens the archive `path` and checks its list against what it holds; contents are checked as they are read.
    ///
    /// # Errors
    /// One sentence if it cannot be read, is no archive that `graeco pack` writes, or is not safe to read.
    pub fn open(path: &Path) -> Result<Self> {
        let bad =
            |object: &str, problem: String| Error::Scene { path: path.to_path_buf(), object: object.into(), problem };
        let file = File::open(path).map_err(|e| Error::io(path, "read", e))?;
        let length = file.metadata().map_err(|e| Error::io(path, "read", e))?.len();
        let mut archive =
            ZipArchive::new(BufReader::new(file)).map_err(|e| bad("archive", format!("cannot be read as ZIP: {e}")))?;
        let manifest = read_manifest(&mut archive).map_err(|problem| bad("archive", problem))?;
        check(&manifest, &archive, length).map_err(|(object, problem)| bad(&object, problem))?;
        let files = manifest.files.iter().map(|f| (f.name.clone(), f.clone())).collect();
        Ok(Self { path: path.to_path_buf(), manifest, files, archive: Mutex::new(archive) })
    }

    /// The list of what it holds.
    #[must_use]
    pub fn manifest(&self) -> &PackManifest {
        &self.manifest
    }

    /// The length of the file `name`, if it is there.
    #[must_use]
    pub fn length(&self, name: &str) -> Option<u64> {
        self.files.get(name).map(|f| f.bytes)
    }

    /// The content of the file `name`.
    ///
    /// # Errors
    /// If there is no such file, or its content is not what was packed.
    pub fn read(&self, name: &str) -> Result<Vec<u8>> {
        let bad = |problem: String| Error::Scene { path: self.path.clone(), object: name.to_owned(), problem };
        let Some(expected) = self.files.get(name) else { return Err(bad("is not in the archive".into())) };
        let mut archive = self.archive.lock().unwrap_or_else(PoisonError::into_inner);
        let mut bytes = Vec::new();
        archive
            .by_name(name)
            .map_err(std::io::Error::from)
            .and_then(|entry| entry.take(expected.bytes.saturating_add(1)).read_to_end(&mut bytes))
            .map_err(|e| bad(format!("is damaged, its content is not what was packed ({e})")))?;
        let found = blake3::hash(&bytes).to_hex();
        if bytes.len() as u64 != expected.bytes || found.as_str() != expected.blake3 {
            return Err(bad(format!(
                "is damaged, its content is not what was packed ({} bytes with BLAKE3 {found}, expected {} with {})",
                bytes.len(),
                expected.bytes,
                expected.blake3
            )));
        }
        Ok(bytes)
    }
}

fn read_manifest(archive: &mut ZipArchive<BufReader<File>>) -> Result<PackManifest, String> {
    let entry = archive
        .by_name(MANIFEST)
        .map_err(|_| format!("has no readable {MANIFEST}, expected an archive that `graeco pack` wrote"))?;
    let mut text = String::new();
    let read = entry.take(LONGEST_MANIFEST + 1).read_to_string(&mut text);
    read.map_err(|e| format!("its {MANIFEST} cannot be read: {e}"))?;
    if text.len() as u64 > LONGEST_MANIFEST {
        return Err(format!("its {MANIFEST} is longer than {} MiB", LONGEST_MANIFEST >> 20));
    }
    serde_json::from_str(&text).map_err(|e| format!("its {MANIFEST} is not what `graeco pack` writes: {e}"))
}

/// Compares the list with the archive's own; an error names the object.
fn check(manifest: &PackManifest, archive: &ZipArchive<BufReader<File>>, length: u64) -> Result<(), (String, String)> {
    let whole = |problem: String| ("archive".to_owned(), problem);
    if manifest.format != FORMAT {
        return Err(whole(format!("has the format \"{}\", expected \"{FORMAT}\"", manifest.format)));
    }
    let mut names: BTreeSet<&str> = BTreeSet::from([MANIFEST]);
    let mut total = 0_u64;
    for file in &manifest.files {
        if !stays_inside(&file.name) {
            return Err((
                format!("\"{}\"", file.name.escape_debug()),
                "is a name that leads out of the archive".into(),
            ));
        }
        if !names.insert(&file.name) {
            return Err((file.name.clone(), "is listed twice".into()));
        }
        if archive.index_for_name(&file.name).is_none() {
            return Err((file.name.clone(), "is listed but missing from the archive".into()));
        }
        total = total.saturating_add(file.bytes);
    }
    if total > length {
        return Err(whole(format!("lists {total} bytes of files, but has only {length}; entries must be stored")));
    }
    if !manifest.files.iter().any(|f| f.name == manifest.scene) {
        return Err((manifest.scene.clone(), "is the scene, but is not among the files".into()));
    }
    for name in archive.file_names_raw() {
        let name = String::from_utf8_lossy(name);
        if !names.contains(name.as_ref()) {
            return Err((format!("\"{}\"", name.escape_debug()), format!("is not listed in {MANIFEST}")));
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io::Write;
    use zip::ZipWriter;
    use zip::write::SimpleFileOptions;

    fn packed(name: &str, content: &[u8]) -> PackedFile {
        let blake3 = blake3::hash(content).to_hex().to_string();
        PackedFile { name: name.into(), bytes: content.len() as u64, blake3 }
    }

    /// An archive of `entries` whose manifest lists `files`.
    fn archive(files: &[PackedFile], entries: &[(&str, &[u8])]) -> tempfile::NamedTempFile {
        let manifest = PackManifest {
            format: FORMAT.into(),
            program: "test".into(),
            scene: "a.gltf".into(),
            scene_hash: String::new(),
            files: files.to_vec(),
        };
        let json = serde_json::to_vec(&manifest).unwrap();
        let file = tempfile::NamedTempFile::new().unwrap();
        let mut zip = ZipWriter::new(file.reopen().unwrap());
        let options = SimpleFileOptions::default().compression_method(zip::CompressionMethod::Stored);
        for (name, content) in entries.iter().chain([&(MANIFEST, &json[..])]) {
            zip.start_file(*name, options).unwrap();
            zip.write_all(content).unwrap();
        }
        zip.finish().unwrap();
        file
    }

    fn refusal(files: &[PackedFile], entries: &[(&str, &[u8])]) -> String {
        let file = archive(files, entries);
        Pack::open(file.path()).map(|_| ()).unwrap_err().to_string()
    }

    #[test]
    fn what_was_packed_is_read_back() {
        let file =
            archive(&[packed("a.gltf", b"scene"), packed("t/b.png", b"")], &[("a.gltf", b"scene"), ("t/b.png", b"")]);
        assert!(is_archive(file.path()));
        let pack = Pack::open(file.path()).unwrap();
        assert_eq!(pack.read("a.gltf").unwrap(), b"scene");
        assert_eq!(pack.read("t/b.png").unwrap(), b"");
        assert!(pack.read("c").unwrap_err().to_string().contains("c: is not in the archive"));
    }

    #[test]
    fn a_changed_byte_is_named_with_its_file() {
        let file = archive(
            &[packed("a.gltf", b"scene"), packed("b.bin", b"0123456789")],
            &[("a.gltf", b"scene"), ("b.bin", b"0123456789")],
        );
        let mut bytes = std::fs::read(file.path()).unwrap();
        let at = bytes.windows(10).position(|w| w == b"0123456789").unwrap();
        bytes[at + 3] ^= 1;
        std::fs::write(file.path(), bytes).unwrap();
        let pack = Pack::open(file.path()).unwrap();
        assert_eq!(pack.read("a.gltf").unwrap(), b"scene");
        assert!(pack.read("b.bin").unwrap_err().to_string().contains("b.bin: is damaged"));
    }

    /// A content whose checksum in the archive is right, but which is not what the manifest lists.
    #[test]
    fn another_content_is_named_by_its_hash() {
        let file = archive(&[packed("a.gltf", b"scene")], &[("a.gltf", b"SCENE")]);
        let message = Pack::open(file.path()).unwrap().read("a.gltf").unwrap_err().to_string();
        assert!(message.contains("a.gltf: is damaged") && message.contains("BLAKE3"), "{message}");
    }

    #[test]
    fn names_that_lead_out_are_refused() {
        for name in ["../evil", "/etc/passwd", "a/../../b", "C:evil", "a\\b", ""] {
            let files = [packed("a.gltf", b""), packed(name, b"x")];
            let message = refusal(&files, &[("a.gltf", b""), (name, b"x")]);
            assert!(message.contains("leads out"), "{name}: {message}");
        }
        let unlisted = refusal(&[packed("a.gltf", b"")], &[("a.gltf", b""), ("../evil", b"x")]);
        assert!(unlisted.contains("\"../evil\": is not listed"), "{unlisted}");
    }

    #[test]
    fn a_list_that_promises_more_than_the_archive_holds_is_refused() {
        let bomb = PackedFile { bytes: 1 << 40, ..packed("a.gltf", b"") };
        assert!(refusal(&[bomb], &[("a.gltf", b"")]).contains("entries must be stored"));
        let missing = refusal(&[packed("a.gltf", b""), packed("b", b"")], &[("a.gltf", b"")]);
        assert!(missing.contains("b: is listed but missing"), "{missing}");
    }

    #[test]
    fn what_is_no_pack_is_said_to_be_none() {
        let file = tempfile::NamedTempFile::new().unwrap();
        std::fs::write(file.path(), b"PK\x03\x04 not really").unwrap();
        let message = Pack::open(file.path()).unwrap_err().to_string();
        assert!(message.contains("archive: cannot be read as ZIP"), "{message}");
        assert!(!is_archive(Path::new("/")) && !is_archive(Path::new("/nowhere")));
    }
}
