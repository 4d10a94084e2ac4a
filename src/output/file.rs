//! Files that are either complete or not there.

use crate::{Error, Result};
use std::fs::{self, File, OpenOptions};
use std::io::{Read, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};

/// Writes `bytes` as the file `path` so that whoever looks sees the old file, or none, or the new one whole.
///
/// A temporary file in the same folder is written, flushed to the disk, and renamed; a killed process leaves at most
/// the temporary file, whose name begins with a dot and ends in `.part`.
///
/// # Errors
/// [`Error::Io`] with the operating system's reason: a full disk is [worth retrying](Error::worth_retrying).
pub fn write_whole(path: &Path, bytes: &[u8]) -> Result<()> {
    write_whole_with(path, |file| file.write_all(bytes).map_err(|source| Error::io(path, "write", source)))
}

/// As [`write_whole`], with the content that `fill` writes.
///
/// # Errors
/// Those of `fill`, and [`Error::Io`].
pub fn write_whole_with(path: &Path, fill: impl FnOnce(&mut File) -> Result<()>) -> Result<()> {
    let temporary = temporary_name(path)?;
    let written = fill_and_sync(path, &temporary, fill)
        .and_then(|()| fs::rename(&temporary, path).map_err(|source| Error::io(path, "rename into place", source)));
    if written.is_err() {
        // The first error is the one to report; a leftover would only waste the space that may be short.
        let _ = fs::remove_file(&temporary);
    }
    written
}

fn fill_and_sync(path: &Path, temporary: &Path, fill: impl FnOnce(&mut File) -> Result<()>) -> Result<()> {
    let failed = |source| Error::io(path, "write", source);
    let mut file = OpenOptions::new().write(true).create_new(true).open(temporary).map_err(failed)?;
    fill(&mut file)?;
    // Without this a power cut may leave the renamed file empty: the rename can reach the disk before the data.
    file.sync_all().map_err(failed)
}

/// A name in the same folder that no other writer uses.
fn temporary_name(path: &Path) -> Result<PathBuf> {
    static COUNT: AtomicU64 = AtomicU64::new(0);
    let name = path.file_name().ok_or_else(|| {
        Error::invalid(format!("output \"{}\"", path.display()), "expected the name of a file, not of a folder")
    })?;
    let count = COUNT.fetch_add(1, Ordering::Relaxed);
    let mut hidden = std::ffi::OsString::from(".");
    hidden.push(name);
    hidden.push(format!(".{}-{count}.part", std::process::id()));
    Ok(path.with_file_name(hidden))
}

/// Makes the folder that `path` is to stand in, if it is missing.
///
/// # Errors
/// [`Error::Io`] if it cannot be made.
pub fn make_folder_of(path: &Path) -> Result<()> {
    match path.parent() {
        Some(folder) if !folder.as_os_str().is_empty() => {
            fs::create_dir_all(folder).map_err(|source| Error::io(folder, "create", source))
        }
        _ => Ok(()),
    }
}

/// Appends one line to the file `path`, making it if need be. A line that a crash cut short is ended first. The line goes out in one write, so that lines of several
/// processes do not mix on local file systems.
///
/// # Errors
/// [`Error::Io`].
pub fn append_line(path: &Path, line: &str) -> Result<()> {
    let mut file: File = OpenOptions::new()
        .append(true)
        .read(true)
        .create(true)
        .open(path)
        .map_err(|source| Error::io(path, "open for appending", source))?;
    let mut text = String::with_capacity(line.len() + 2);
    let mut last = [b'\n'];
    // An empty file has no last byte to seek to, and needs no line ended.
    if file.seek(SeekFrom::End(-1)).is_ok() {
        file.read_exact(&mut last).map_err(|source| Error::io(path, "read", source))?;
    }
    if last != [b'\n'] {
        text.push('\n');
    }
    text.push_str(line);
    text.push('\n');
    file.write_all(text.as_bytes()).map_err(|source| Error::io(path, "append to", source))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_is_replaced_whole_and_nothing_else_is_left() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.exr");
        write_whole(&path, b"one").unwrap();
        write_whole(&path, b"two").unwrap();
        assert_eq!(fs::read(&path).unwrap(), b"two");
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1);
    }

    #[test]
    fn a_failed_write_keeps_the_old_file_and_leaves_no_other() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a");
        fs::create_dir(&path).unwrap();
        fs::write(path.join("inside"), b"x").unwrap();
        assert!(write_whole(&path, b"one").is_err());
        assert!(path.is_dir());
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1);
    }

    #[test]
    fn a_full_disk_is_worth_retrying() {
        let full = Path::new("/dev/full");
        if !full.exists() {
            return;
        }
        let mut file = OpenOptions::new().write(true).open(full).unwrap();
        let source = file.write_all(&[0; 4096]).unwrap_err();
        assert!(Error::io("out.exr", "write", source).worth_retrying());
    }
}
