//! Structure between pixels: masks that place each pixel's draws within their strata (Mitchell 1990, §5.2, eq. 15).
//!
//! A mask gives every pixel, frame and factor a position in [0, 1), so that neighbours differ as much as they can:
//! what error remains is of high frequency, where an eye or a filter averages it. Each factor has a mask of its own
//! (another lattice, or the same matrix moved and mirrored): factors that share one are confounded.

use super::hash::{scramble_reversed, subkey, subseed};
use std::sync::OnceLock;

/// The survey's matrix (Mitchell 1990, eq. 15), the ordered-dither matrix of Limb (1969).
pub const ORDERED_4X4: [[u8; 4]; 4] = [[0, 12, 3, 15], [8, 4, 11, 7], [2, 14, 1, 13], [10, 6, 9, 5]];

/// Side of the blue-noise mask.
pub const BLUE_NOISE_SIDE: usize = 64;

/// Fraction of a turn by which a mask's values move from frame to frame: the golden ratio's, in 2⁻³² (Roberts 2018).
const GOLDEN: u32 = 0x9e37_79b9;

/// Where a pixel stands among all that a mask covers.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Place {
    /// Column, as the bits of a signed number.
    pub(crate) x: u32,
    /// Row among the lines that are rendered together.
    pub(crate) y: u32,
    /// Frames and fields counted together.
    pub(crate) t: u32,
}

/// The 8 × 8 ordered-dither matrix by Bayer's recursion (1973) from [`ORDERED_4X4`]'s own pattern.
#[must_use]
pub fn ordered_8x8() -> [[u8; 8]; 8] {
    let quadrant = [[0_u8, 3], [2, 1]];
    let mut matrix = [[0; 8]; 8];
    for (y, row) in matrix.iter_mut().enumerate() {
        for (x, value) in row.iter_mut().enumerate() {
            *value = 4 * ORDERED_4X4[y % 4][x % 4] + quadrant[y / 4][x / 4];
        }
    }
    matrix
}

/// How far a column's mask is turned in a frame, in 2⁻³²: the shutter's by the golden ratio from frame to frame, which
/// spreads few frames evenly; the others' afresh, for factors that turn in step would be tied over the frames.
fn turn(key: u64, column: u32, t: u32) -> u32 {
    let start = subseed(key, u64::from(column));
    if column == SHUTTER_COLUMN {
        start.wrapping_add(t.wrapping_mul(GOLDEN))
    } else {
        subseed(key, u64::from(t) << 32 | u64::from(column) << 8 | 1)
    }
}

/// Position of the ordered mask at `place`: the matrix's level, turned by frame and seed, and `jitter` inside it.
/// Masks of different `column` are shifted and mirrored against each other; the shutter's is the matrix as printed.
pub(crate) fn ordered(side: u32, place: Place, column: u32, key: u64, jitter: u32) -> u32 {
    static EIGHT: OnceLock<[[u8; 8]; 8]> = OnceLock::new();
    let moved = subkey(0x0dd_b175 ^ u64::from(side), u64::from(column));
    #[allow(clippy::cast_possible_truncation, reason = "bits of a hash")]
    let (shift_x, shift_y) = if column == SHUTTER_COLUMN { (0, 0) } else { (moved as u32, (moved >> 32) as u32) };
    let (mut x, mut y) = (place.x.wrapping_add(shift_x) % side, place.y.wrapping_add(shift_y) % side);
    if column % 2 == 1 {
        x = side - 1 - x;
    }
    if column % 4 > 2 {
        std::mem::swap(&mut x, &mut y);
    }
    let (x, y) = (x as usize, y as usize);
    let level = if side == 4 { ORDERED_4X4[y][x] } else { EIGHT.get_or_init(ordered_8x8)[y][x] };
    let bits = 2 * side.trailing_zeros();
    let turn = turn(key, column, place.t) >> (32 - bits);
    (u32::from(level).wrapping_add(turn) << (32 - bits)) | (jitter >> bits)
}

/// The column whose mask is the printed one: the shutter's.
pub(crate) const SHUTTER_COLUMN: u32 = 2;

/// Position of the blue-noise mask at `place`.
pub(crate) fn blue_noise(place: Place, column: u32, key: u64, jitter: u32) -> u32 {
    static RANKS: OnceLock<Vec<u16>> = OnceLock::new();
    let ranks = RANKS.get_or_init(|| super::void_and_cluster::ranks(BLUE_NOISE_SIDE));
    let moved = subkey(key, u64::from(column));
    let side = BLUE_NOISE_SIDE as u64;
    let x = (u64::from(place.x) + (moved & 63)) % side;
    let y = (u64::from(place.y) + (moved >> 6 & 63)) % side;
    #[allow(clippy::cast_possible_truncation, reason = "below 64²")]
    let rank = u32::from(ranks[(y * side + x) as usize]);
    (rank << 20 | jitter >> 12).wrapping_add(turn(key, column, place.t))
}

/// Position of the lattice mask at `place`: a multiple of one vector per axis, modulo one.
pub(crate) fn r2(place: Place, column: u32, key: u64) -> u32 {
    // Roberts's own lattice serves the shutter, the factor that most often is masked alone.
    let lattice = match column {
        SHUTTER_COLUMN => 0,
        0 => SHUTTER_COLUMN,
        other => other,
    };
    let [across, down] = LATTICES[lattice as usize % LATTICES.len()];
    turn(key, column, place.t).wrapping_add(place.x.wrapping_mul(across)).wrapping_add(place.y.wrapping_mul(down))
}

/// Steps across and down of each factor's lattice, in 2⁻³².
///
/// The first is Roberts's (powers of the plastic number). The others were taken greedily from random candidates so
/// that no harmonic of one, nor a sum of low harmonics of two or three, is of low spatial frequency: the criterion is
/// the sum over harmonics h of Π h⁻² · exp(−(2π · 1.5 px · f)²), f being the harmonic's frequency on the pixels.
const LATTICES: [[u32; 2]; 13] = [
    [0xc13f_a9a9, 0x91e1_0da5],
    [0xf30b_d5bc, 0x6320_e25d],
    [0x8a8c_2712, 0x6871_6d45],
    [0x3d27_d399, 0x9f00_7ecf],
    [0x62ca_6461, 0x5e25_c9f6],
    [0x1a5d_19c4, 0x6994_643e],
    [0xa2a4_9790, 0x7c43_b394],
    [0xdba0_40d1, 0x70c6_cd65],
    [0x2feb_47a4, 0x59b5_f1ec],
    [0x8730_96d4, 0x9198_3312],
    [0xfc60_56ed, 0x8d89_a9ef],
    [0xace0_5fd0, 0x6901_01d2],
    [0x4d1d_eeb2, 0x6bdb_9a93],
];

/// Interleaves the lower 16 bits of `x` (even places) and `y` (odd places): the Z-order of Morton (1966).
pub(crate) const fn morton(x: u32, y: u32) -> u32 {
    const fn spread(mut v: u32) -> u32 {
        v &= 0xffff;
        v = (v | v << 8) & 0x00ff_00ff;
        v = (v | v << 4) & 0x0f0f_0f0f;
        v = (v | v << 2) & 0x3333_3333;
        (v | v << 1) & 0x5555_5555
    }
    spread(x) | spread(y) << 1
}

/// Indices of a net over a whole picture.
#[derive(Debug, Clone, Copy)]
pub(crate) struct ZOrder {
    /// Side of a tile of pixels with a net of its own, as a power of two.
    tile_bits: u32,
    /// Frames that share a net, as a power of two.
    frame_bits: u32,
    runs: u32,
}

impl ZOrder {
    /// For `runs` a pixel, structure over `frames` frames (rounded up to a power of two, at most 256).
    pub(crate) fn new(runs: u32, frames: u32) -> Self {
        let run_bits = runs.max(1).next_power_of_two().trailing_zeros();
        let frame_bits = frames.clamp(1, 256).next_power_of_two().trailing_zeros();
        let tile_bits = 32_u32.saturating_sub(run_bits + frame_bits) / 2;
        Self { tile_bits: tile_bits.min(12), frame_bits, runs }
    }

    /// The key of the net that covers `place`, and the index of the pixel's first run in it.
    pub(crate) fn locate(self, place: Place, seed_key: u64) -> (u64, u32) {
        let tile = subkey(seed_key, u64::from(place.x >> self.tile_bits) << 32 | u64::from(place.y >> self.tile_bits));
        let key = subkey(tile, u64::from(place.t >> self.frame_bits));
        let mask = (1 << self.tile_bits) - 1;
        let z = morton(place.x & mask, place.y & mask);
        let frame = place.t & ((1 << self.frame_bits) - 1);
        (key, (z << self.frame_bits | frame).wrapping_mul(self.runs))
    }

    /// Position in [0, 1) of the one-dimensional net, for a mask: 2⁻³² units.
    pub(crate) fn position(place: Place, column: u32, seed_key: u64, frames: u32) -> u32 {
        let (key, index) = Self::new(1, frames).locate(place, seed_key);
        scramble_reversed(index, subseed(key, u64::from(column))).reverse_bits()
    }
}
