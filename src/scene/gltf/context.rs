//! What every part of the import needs: where the file is, what it may cost, how to complain.

use super::LoadOptions;
use super::schema::{Document, Object};
use crate::scene::pack::{self, Pack};
use crate::{Error, Result};
use serde::de::DeserializeOwned;
use std::cell::{Cell, RefCell};
use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

/// No single thing decoded from a file may be larger, bytes.
pub(super) const LARGEST: u64 = 1 << 30;

/// What a file of any size may decode to, bytes: half of [`LARGEST`], so that a small hostile file stays under 1 GiB
/// with everything it makes us hold twice for a moment.
const ALLOWANCE: u64 = LARGEST / 2;

/// Bytes of decoded data allowed per byte read. Sound photographs reach about 40 (JPEG at ½ bit a pixel gives 64);
/// a deflate bomb reaches 1032.
const GROWTH: u64 = 64;

/// Shared state of one import. Methods take `&self`, so that the document can be walked while warnings gather.
pub(super) struct Context<'a> {
    pub(super) path: PathBuf,
    /// Where files come from instead of the file's folder.
    pub(super) pack: Option<Pack>,
    pub(super) options: &'a LoadOptions,
    pub(super) doc: Document,
    warnings: RefCell<Vec<String>>,
    said: RefCell<BTreeSet<String>>,
    read: Cell<u64>,
    spent: Cell<u64>,
    files: RefCell<BTreeMap<PathBuf, (u64, [u8; 32])>>,
}

impl<'a> Context<'a> {
    pub(super) fn new(path: PathBuf, options: &'a LoadOptions) -> Self {
        Self {
            path,
            pack: None,
            options,
            doc: Document::default(),
            warnings: RefCell::default(),
            said: RefCell::default(),
            read: Cell::new(0),
            spent: Cell::new(0),
            files: RefCell::default(),
        }
    }

    /// For the file `path`, which may be a packed scene.
    pub(super) fn open(path: &Path, options: &'a LoadOptions) -> Result<Self> {
        let pack = if pack::is_archive(path) { Some(Pack::open(path)?) } else { None };
        Ok(Self { pack, ..Self::new(path.to_path_buf(), options) })
    }

    /// The scene file: inside the pack if there is one.
    pub(super) fn scene_file(&self) -> PathBuf {
        self.pack.as_ref().map_or_else(|| self.path.clone(), |pack| PathBuf::from(&pack.manifest().scene))
    }

    /// An error about `object`.
    pub(super) fn error(&self, object: impl Into<String>, problem: impl Into<String>) -> Error {
        Error::Scene { path: self.path.clone(), object: object.into(), problem: problem.into() }
    }

    /// Notes something odd but not fatal.
    pub(super) fn warn(&self, object: impl AsRef<str>, problem: impl AsRef<str>) {
        let sentence = format!("{}: {}", object.as_ref(), problem.as_ref());
        if self.said.borrow_mut().insert(sentence.clone()) {
            self.warnings.borrow_mut().push(sentence);
        }
    }

    /// The warnings so far, in order.
    pub(super) fn take_warnings(&self) -> Vec<String> {
        self.warnings.take()
    }

    /// Adds the file `path` that was read to what decoding may cost, and notes its length and BLAKE3, which it gives.
    pub(super) fn count_file(&self, path: &Path, bytes: &[u8]) -> (u64, [u8; 32]) {
        let length = bytes.len() as u64;
        let identity = (length, *blake3::hash(bytes).as_bytes());
        self.files.borrow_mut().insert(path.to_path_buf(), identity);
        self.read.set(self.read.get().saturating_add(length));
        identity
    }

    /// Length and BLAKE3 of a file that was counted.
    pub(super) fn counted(&self, path: &Path) -> Option<(u64, [u8; 32])> {
        self.files.borrow().get(path).copied()
    }

    /// What may still be decoded, bytes.
    pub(super) fn allowance_left(&self) -> u64 {
        let most = self
            .options
            .memory_limit
            .unwrap_or_else(|| ALLOWANCE.saturating_add(GROWTH.saturating_mul(self.read.get())));
        most.saturating_sub(self.spent.get())
    }

    /// Pays for `bytes` before they are allocated.
    pub(super) fn charge(&self, bytes: u64, object: impl AsRef<str>) -> Result<()> {
        if bytes > LARGEST {
            return Err(self.too_large(bytes, LARGEST, object.as_ref()));
        }
        self.check_transient(bytes, object)?;
        self.spent.set(self.spent.get() + bytes);
        Ok(())
    }

    /// Refuses work that holds more than is left of the allowance, but gives it back.
    pub(super) fn check_transient(&self, bytes: u64, object: impl AsRef<str>) -> Result<()> {
        let left = self.allowance_left();
        if bytes > left { Err(self.too_large(bytes, left, object.as_ref())) } else { Ok(()) }
    }

    fn too_large(&self, bytes: u64, allowed: u64, object: &str) -> Error {
        let problem = format!(
            "would take {} MiB of memory, more than the {} MiB left to a file of this size",
            bytes.div_ceil(1 << 20),
            allowed >> 20
        );
        self.error(object, problem)
    }

    /// The entry `index` of an array of the document.
    pub(super) fn get<'t, T>(&self, list: &'t [T], index: usize, kind: &str, object: &str) -> Result<&'t T> {
        list.get(index)
            .ok_or_else(|| self.error(object, format!("refers to {kind} {index}, but there are only {}", list.len())))
    }

    /// The extension `name` of an object, read as `T`.
    pub(super) fn extension<T: DeserializeOwned>(
        &self,
        extensions: &Object,
        name: &str,
        object: &str,
    ) -> Result<Option<T>> {
        match extensions.get(name) {
            None => Ok(None),
            Some(value) => serde_json::from_value(value.clone())
                .map(Some)
                .map_err(|e| self.error(object, format!("the extension {name} is malformed: {}", plain(&e)))),
        }
    }

    /// `value` as `f32`, refused if that is not finite.
    #[allow(clippy::cast_possible_truncation, reason = "rounding to f32 is meant; overflow is refused here")]
    pub(super) fn finite(&self, value: f64, what: &str, object: &str) -> Result<f32> {
        let narrow = value as f32;
        if narrow.is_finite() {
            Ok(narrow)
        } else {
            Err(self.error(object, format!("{what} is {value}, which is not a finite 32-bit number")))
        }
    }

    /// All of `values` as finite `f32`.
    pub(super) fn finite_array<const N: usize>(&self, values: [f64; N], what: &str, object: &str) -> Result<[f32; N]> {
        let mut out = [0.0; N];
        for (o, v) in out.iter_mut().zip(values) {
            *o = self.finite(v, what, object)?;
        }
        Ok(out)
    }

    /// `value` in [low, high]; what lies outside is clamped with a warning.
    pub(super) fn clamped(&self, value: f64, range: (f32, f32), what: &str, object: &str) -> Result<f32> {
        let v = self.finite(value, what, object)?;
        if v < range.0 || v > range.1 {
            self.warn(object, format!("{what} is {v}, outside {} to {}; it is clamped", range.0, range.1));
        }
        Ok(v.clamp(range.0, range.1))
    }
}

/// How an object is called in messages: `mesh 3 "Body"`.
pub(super) fn label(kind: &str, index: usize, name: &str) -> String {
    if name.is_empty() { format!("{kind} {index}") } else { format!("{kind} {index} \"{}\"", name.escape_debug()) }
}

/// A JSON error without Rust's names for types.
pub(super) fn plain(error: &serde_json::Error) -> String {
    let mut text = error.to_string();
    for (rust, words) in [
        ("expected usize", "expected a whole number from 0 up"),
        ("expected u64", "expected a whole number from 0 up"),
        ("expected u32", "expected a whole number from 0 up"),
        ("expected f64", "expected a number"),
        ("a sequence", "an array"),
        ("a map", "an object"),
        ("type: map", "type: object"),
        ("type: sequence", "type: array"),
    ] {
        text = text.replace(rust, words);
    }
    if let Some(start) = text.find("expected struct ") {
        let name = start + "expected struct ".len();
        let end = text[name..].find(' ').map_or(text.len(), |n| name + n);
        text.replace_range(start..end, "expected an object");
    }
    text
}
