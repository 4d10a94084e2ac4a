//! Part files: a part of one frame as exact sums, to be merged with its other parts.
//!
//! All numbers are little-endian:
//!
//! ```text
//! "GRAECOPT"  version u32  length u32  header (CBOR)  BLAKE3 of all before, 32 bytes: the file's key
//! record ×n:  block u32  pass u32  length u32  0 u32  samples u64  rays u64  nanoseconds u64
//!             payload  BLAKE3 of key and record, its first 16 bytes
//! index:      offset u64 of each record, by block, then by pass
//! totals:     CBOR
//! end:        offset of the index u64  entries u32  length of the totals u32
//!             BLAKE3 of key, index and totals, its first 16 bytes  "GRAECOND"
//! ```
//!
//! Records stand in the order in which they were finished. While it is being rendered the file is called
//! `NAME.part.partial` and has no index yet: it is the journal from which a killed task goes on.

mod reader;
mod writer;

pub use reader::PartFile;
pub use writer::{Opened, PartWriter};

use super::picture::Record;
use super::sink::FieldFiles;
use super::view::ViewTransform;
use crate::film::Window;
use crate::time::Exposure;
use serde::{Deserialize, Serialize};

const MAGIC: &[u8; 8] = b"GRAECOPT";
const END: &[u8; 8] = b"GRAECOND";
/// Changes whenever older programs would misread a file.
const VERSION: u32 = 1;
const RECORD_HEAD: usize = 40;
const CHECK: usize = 16;
const TRAILER: usize = 40;
/// No header or record is longer, bytes.
const LONGEST: u32 = 1 << 26;

/// What becomes of merged pixels unless the merge is told otherwise: the output options that `render` was given.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct OutputChoice {
    /// View transform of PNG and video.
    pub view: ViewTransform,
    /// Brightening of PNG and video, stops.
    pub exposure_ev: f64,
    /// Bits a channel, if not the format's own default.
    pub depth: Option<String>,
    /// Woven or separate fields.
    pub fields: FieldFiles,
    /// Whether film frames are spread over video fields.
    pub pulldown: bool,
}

/// What a part file says of itself.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Header {
    /// What made it: settings, scene hash, seed, program. Equal hashes in here make parts mergeable.
    pub record: Record,
    /// How the merged picture is to be written.
    pub output: OutputChoice,
    /// Frame number.
    pub frame: i64,
    /// What the frame (of two fields: the earlier) integrates.
    pub exposure: Exposure,
    /// Columns and lines of the whole picture.
    pub size: (u32, u32),
    /// The pixels of it that the merged picture holds.
    pub window: Window,
    /// Which of the window's blocks ([`crate::film::Blocks`]) this part holds: first, and the one after the last.
    pub blocks: (u32, u32),
    /// The tile that was asked for: i of n.
    pub tile: (u32, u32),
    /// Which runs: first, and the one after the last.
    pub runs: (u32, u32),
    /// Runs of the whole design.
    pub total_runs: u32,
    /// Exposures: one, or two fields.
    pub passes: u32,
}

impl Header {
    /// Records of a complete part.
    #[must_use]
    pub fn records(&self) -> usize {
        self.blocks.1.saturating_sub(self.blocks.0) as usize * self.passes as usize
    }

    /// Where the record of `block` in `pass` stands in the index, if the part has it.
    fn place(&self, block: u32, pass: u32) -> Option<usize> {
        let inside = (self.blocks.0..self.blocks.1).contains(&block) && pass < self.passes;
        inside.then(|| (block - self.blocks.0) as usize * self.passes as usize + pass as usize)
    }
}

/// What a part, or a block of it, took.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct PartCost {
    /// Samples taken.
    pub samples: u64,
    /// Rays traced.
    pub rays: u64,
    /// Nanoseconds of one thread.
    pub nanoseconds: u64,
}

impl PartCost {
    /// Both together.
    #[must_use]
    pub fn plus(self, other: Self) -> Self {
        Self {
            samples: self.samples.saturating_add(other.samples),
            rays: self.rays.saturating_add(other.rays),
            nanoseconds: self.nanoseconds.saturating_add(other.nanoseconds),
        }
    }
}

/// What a whole part took.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct Totals {
    /// All records.
    pub cost: PartCost,
    /// Seconds to load the scene, in the task that finished the part.
    pub load_s: f64,
    /// Seconds to pose the scene and build what rays traverse, in the same.
    pub build_s: f64,
    /// Most memory that this task held, bytes.
    pub peak_memory: u64,
}

/// The first bytes of a BLAKE3 over `parts`.
fn check(parts: &[&[u8]]) -> [u8; CHECK] {
    let mut hasher = blake3::Hasher::new();
    for part in parts {
        hasher.update(part);
    }
    let mut out = [0; CHECK];
    out.copy_from_slice(&hasher.finalize().as_bytes()[..CHECK]);
    out
}

fn word(bytes: &[u8], at: usize) -> u32 {
    bytes.get(at..at + 4).and_then(|b| b.try_into().ok()).map_or(0, u32::from_le_bytes)
}

fn long(bytes: &[u8], at: usize) -> u64 {
    bytes.get(at..at + 8).and_then(|b| b.try_into().ok()).map_or(0, u64::from_le_bytes)
}

/// A record's fixed part.
#[derive(Debug, Clone, Copy)]
struct RecordHead {
    block: u32,
    pass: u32,
    length: u32,
    cost: PartCost,
}

impl RecordHead {
    fn to_bytes(self) -> [u8; RECORD_HEAD] {
        let mut out = [0; RECORD_HEAD];
        for (slot, value) in out[..12].chunks_exact_mut(4).zip([self.block, self.pass, self.length]) {
            slot.copy_from_slice(&value.to_le_bytes());
        }
        let PartCost { samples, rays, nanoseconds } = self.cost;
        for (slot, value) in out[16..].chunks_exact_mut(8).zip([samples, rays, nanoseconds]) {
            slot.copy_from_slice(&value.to_le_bytes());
        }
        out
    }

    fn from_bytes(bytes: &[u8; RECORD_HEAD]) -> Self {
        let cost = PartCost { samples: long(bytes, 16), rays: long(bytes, 24), nanoseconds: long(bytes, 32) };
        Self { block: word(bytes, 0), pass: word(bytes, 4), length: word(bytes, 8), cost }
    }
}
