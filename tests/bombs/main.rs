//! Small files that promise gigabytes: refused by one sentence, or read without what they promise, in bounded memory.
//!
//! The bound is the operating system's: while a bomb is read, the process may grow by [`ROOM`] of address space. An
//! allocation beyond that aborts the test.
#![cfg(target_os = "linux")]
#![allow(
    clippy::unwrap_used,
    clippy::print_stdout,
    clippy::cast_possible_truncation,
    reason = "helpers of tests: a failure is a panic, numbers are small, and what was refused is listed on demand"
)]

mod geometry;
mod packs;
mod pictures;

use base64_text::base64;
use graeco::scene::Scene;
use graeco::scene::gltf::{LoadOptions, load};
use nix::sys::resource::{Resource, getrlimit, setrlimit};
use std::path::Path;
use std::sync::{Mutex, PoisonError};

/// What may be allocated for a file of some kilobytes: the loader's allowance of 512 MiB, held twice for a moment, and
/// what threads reserve for their heaps.
const ROOM: u64 = 1_280 << 20;

/// One bomb at a time: the limit is the process's.
static TURN: Mutex<()> = Mutex::new(());

/// Address space in use, bytes.
fn in_use() -> u64 {
    let pages = std::fs::read_to_string("/proc/self/statm").unwrap();
    pages.split(' ').next().unwrap().parse::<u64>().unwrap() * 4096
}

/// Runs `f` with [`ROOM`] to grow.
fn bounded<T>(f: impl FnOnce() -> T) -> T {
    let _turn = TURN.lock().unwrap_or_else(PoisonError::into_inner);
    // Threads that read pictures are made before, so that their stacks do not count.
    rayon::join(|| (), || ());
    let (soft, hard) = getrlimit(Resource::RLIMIT_AS).unwrap();
    setrlimit(Resource::RLIMIT_AS, (in_use() + ROOM).min(hard), hard).unwrap();
    let result = f();
    setrlimit(Resource::RLIMIT_AS, soft, hard).unwrap();
    result
}

/// What the loader says about a file, in bounded memory.
fn read(path: &Path) -> Result<Scene, String> {
    let result = bounded(|| load(path, &LoadOptions::default())).map_err(|e| e.to_string());
    let said = match &result {
        Ok(scene) => scene.warnings.clone(),
        Err(sentence) => vec![sentence.clone()],
    };
    for sentence in said {
        assert!(!sentence.contains('\n') && sentence.len() < 600, "not one sentence: {sentence}");
    }
    result
}

/// The same of a document.
fn read_json(document: &serde_json::Value) -> Result<Scene, String> {
    let file = tempfile::Builder::new().suffix(".gltf").tempfile().unwrap();
    std::fs::write(file.path(), document.to_string()).unwrap();
    read(file.path())
}

/// `bytes` as a URI.
fn data_uri(bytes: &[u8]) -> String {
    format!("data:application/octet-stream;base64,{}", base64(bytes))
}

mod base64_text {
    /// RFC 4648, section 4.
    pub(crate) fn base64(bytes: &[u8]) -> String {
        const LETTERS: &[u8; 64] = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
        let mut out = String::new();
        for chunk in bytes.chunks(3) {
            let word = (0..3).fold(0_u32, |w, i| w << 8 | u32::from(chunk.get(i).copied().unwrap_or(0)));
            for i in 0..4 {
                let letter = LETTERS[(word >> (18 - 6 * i) & 63) as usize];
                out.push(if i <= chunk.len() { letter as char } else { '=' });
            }
        }
        out
    }
}

/// The limit is one: what a bomb would take if it were believed does not fit.
#[test]
fn the_planted_bomb_does_not_fit() {
    let taken = bounded(|| Vec::<u8>::new().try_reserve_exact(2 << 30).is_ok());
    assert!(!taken, "the limit bounds nothing");
}
