//! The designs themselves: from an address to a coordinate.

use super::address::PixelAddress;
use super::array::OrthogonalArray;
use super::choose::{Choice, choose, cube_root, square_root};
use super::disk::DiskTiles;
use super::dither::{self, Place, ZOrder};
use super::hash::{fill_permutation, permute, point_in_stratum, scramble_reversed, shuffle_index, subkey, subseed};
use super::kind::{Dither, Kind, Mask, Over};
use super::nets::{self, NetTables};
use crate::factor::Factor;
use crate::numeric;

/// Most levels, and most columns, of an array whose permutations are kept per pixel.
const MAX_LEVELS: usize = 32;
const MAX_COLUMNS: usize = MAX_LEVELS + 1;

/// Marks a factor that the design has no column for.
const PAD: u8 = u8::MAX;

/// Uses of a pixel's key, kept apart.
mod tag {
    pub(super) const SCRAMBLE: u64 = 0;
    pub(super) const SHUFFLE: u64 = 1 << 56;
    pub(super) const JITTER: u64 = 2 << 56;
    pub(super) const LEVELS: u64 = 3 << 56;
    pub(super) const REFINE: u64 = 4 << 56;
    pub(super) const MASK: u64 = 5 << 56;
}

/// What a design is made for.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct DesignOptions {
    /// How runs are placed inside a pixel.
    pub kind: Kind,
    /// What structures neighbouring pixels against each other.
    pub dither: Dither,
    /// Runs a pixel; 0 counts as 1, and more than 2²⁴ as 2²⁴.
    pub runs: u32,
    /// Chooses among all equally good designs.
    pub seed: u64,
    /// Frames over which draws are structured together by `z-order` (a power of two, at most 256): a still scene
    /// then converges from frame to frame.
    pub frames: u32,
    /// Lines of the frame from one rendered line to the next: 1, or 2 for fields.
    pub line_step: u32,
}

impl Default for DesignOptions {
    /// 16 runs of the automatic choice, progressive, seed 0.
    fn default() -> Self {
        Self { kind: Kind::Auto, dither: Dither::default(), runs: 16, seed: 0, frames: 16, line_step: 1 }
    }
}

/// How coordinates come about.
#[derive(Debug, Clone)]
enum Method {
    Random,
    Jittered,
    LatinHypercube,
    Array(ArrayMethod),
    Net(NetTables),
    /// One net over the whole picture.
    Picture(NetTables, ZOrder),
    Disk(DiskTiles),
}

/// An orthogonal array, refined.
#[derive(Debug, Clone)]
struct ArrayMethod {
    array: OrthogonalArray,
    /// Columns in use.
    columns: usize,
    /// Whether one permutation refines all levels of a factor, by the level of its partner.
    correlated: bool,
    /// `[run][column]`: which of the runs on its level this is.
    ranks: Vec<u16>,
    /// Runs on each level.
    per_level: u32,
    /// Permutations of a level's runs, one after the other; none where there are more than 32 runs on a level.
    shuffles: Vec<u8>,
    /// Where each stratum of 1/N starts, in 2⁻²⁴, and the end of the last.
    bounds: Vec<u32>,
}

/// Permutations that refinement chooses from; a turn of its own makes each place equally likely.
const SHUFFLES: u64 = 256;

impl ArrayMethod {
    fn new(array: OrthogonalArray, factors: usize, correlated: bool) -> Self {
        let columns = factors.min(array.columns());
        let per_level = array.runs() / array.levels();
        let mut ranks = Vec::with_capacity(array.runs() as usize * columns);
        let mut seen = vec![0_u16; columns * array.levels() as usize];
        for run in 0..array.runs() {
            for column in 0..columns {
                let count = &mut seen[column * array.levels() as usize + usize::from(array.level(run, column))];
                // In an array of strength 2 and index unity a level meets each level of any other column once.
                let partner = match column {
                    0 | 1 => 1 - column,
                    2 => 0,
                    _ => ((column - 3) ^ 1) + 3,
                };
                let rank =
                    if array.strength() == 2 && partner < array.columns() { array.level(run, partner) } else { *count };
                ranks.push(rank);
                *count += 1;
            }
        }
        let mut shuffles = Vec::new();
        if per_level as usize <= MAX_LEVELS {
            for i in 0..SHUFFLES {
                let mut shuffle = vec![0; per_level as usize];
                fill_permutation(&mut shuffle, subkey(numeric::mix64(u64::from(per_level)), i));
                shuffles.extend(shuffle);
            }
        }
        let runs = array.runs();
        let bounds = (0..runs).map(|stratum| point_in_stratum(stratum, runs, 0)).chain([1 << 24]).collect();
        Self { array, columns, correlated, ranks, per_level, shuffles, bounds }
    }

    /// Where within its level a run of rank `rank` falls.
    #[inline]
    fn refined(&self, rank: u32, key: u64) -> u32 {
        if self.shuffles.is_empty() {
            return permute(rank, self.per_level, key);
        }
        let start = usize::try_from(key % SHUFFLES).unwrap_or(0) * self.per_level as usize;
        #[allow(clippy::cast_possible_truncation, reason = "the upper half of a product with 32 bits")]
        let turn = (((key >> 32) * u64::from(self.per_level)) >> 32) as u32;
        let place = u32::from(self.shuffles[start + rank as usize]) + turn;
        if place < self.per_level { place } else { place - self.per_level }
    }
}

/// A design over the factors of one picture.
#[derive(Debug, Clone)]
pub struct Design {
    choice: Choice,
    seed_key: u64,
    runs: u32,
    frames: u32,
    line_step: u32,
    factors: Vec<Factor>,
    /// Column by factor index, [`PAD`] where there is none.
    columns: Vec<u8>,
    method: Method,
    /// Four factors of any further vertex.
    pad: NetTables,
}

impl Design {
    /// The design that `options` describes, over `factors` (in their fixed order; extras need not be named).
    ///
    /// The earlier a factor, the better its column. A factor that is left out leaves its column to the next.
    #[must_use]
    pub fn new(options: &DesignOptions, factors: &[Factor]) -> Self {
        let runs = options.runs.clamp(1, 1 << 24);
        let mut factors: Vec<Factor> = factors.to_vec();
        factors.sort_unstable();
        factors.dedup();
        let active: Vec<Factor> = factors.iter().copied().filter(|f| !f.is_extra()).collect();
        let choice = choose(options.kind, options.dither, runs, active.len());
        let bits = runs.next_power_of_two().trailing_zeros();
        let method = method(&choice, runs, active.len(), options.frames, options.seed);
        let room = match &method {
            Method::Array(array) => array.columns,
            Method::Net(net) | Method::Picture(net, _) => net.columns(),
            _ => active.len().min(usize::from(PAD)),
        };
        let mut columns = vec![PAD; active.last().map_or(0, |f| usize::from(f.index()) + 1)];
        for (factor, column) in active.iter().zip(0..u8::try_from(room).unwrap_or(PAD)) {
            columns[usize::from(factor.index())] = column;
        }
        let pad = nets::nested(bits)
            .map_or_else(|| nets::sobol(4, bits.max(1)), |set| set.into_iter().take(4).collect::<Vec<_>>());
        let pad = NetTables::new(&pad, bits);
        let seed_key = numeric::mix64(options.seed ^ 0x6772_6165_636f);
        let line_step = options.line_step.max(1);
        Self { choice, seed_key, runs, frames: options.frames, line_step, factors, columns, method, pad }
    }

    /// Runs a pixel.
    #[must_use]
    pub fn runs(&self) -> u32 {
        self.runs
    }

    /// The factors it covers.
    #[must_use]
    pub fn factors(&self) -> &[Factor] {
        &self.factors
    }

    /// How runs are really placed: never [`Kind::Auto`], and not what was asked for where the runs do not allow it.
    #[must_use]
    pub fn kind(&self) -> Kind {
        self.choice.kind
    }

    /// The structure between pixels: never automatic.
    #[must_use]
    pub fn dither(&self) -> Dither {
        self.choice.dither
    }

    /// Why it is this kind and this dither, in words.
    #[must_use]
    pub fn reason(&self) -> &str {
        &self.choice.reason
    }

    /// The design's runs in one pixel.
    #[must_use]
    #[inline]
    pub fn pixel(&self, address: PixelAddress) -> PixelDesign<'_> {
        #[allow(
            clippy::cast_sign_loss,
            clippy::cast_possible_truncation,
            reason = "bits of an address, not a quantity"
        )]
        let place = Place {
            x: address.x as u32,
            y: address.y.div_euclid(i32::try_from(self.line_step).unwrap_or(1)) as u32,
            t: ((address.frame as u64) * u64::from(self.line_step) + u64::from(address.field)) as u32,
        };
        #[allow(clippy::cast_sign_loss, reason = "bits of an address, not a quantity")]
        let (xy, time) = (
            u64::from(address.x as u32) << 32 | u64::from(address.y as u32),
            (address.frame as u64) << 1 | u64::from(address.field),
        );
        let key = subkey(subkey(self.seed_key, xy), time);
        let mut pixel = PixelDesign { design: self, key, place, net_key: key, first: 0, levels: None };
        match &self.method {
            Method::Array(method) => pixel.levels = Levels::new(method, key),
            Method::Picture(_, order) => (pixel.net_key, pixel.first) = order.locate(place, self.seed_key),
            _ => {}
        }
        pixel
    }
}

/// Builds the method that was chosen.
fn method(choice: &Choice, runs: u32, factors: usize, frames: u32, seed: u64) -> Method {
    let bits = runs.next_power_of_two().trailing_zeros();
    if choice.dither == (Dither { mask: Mask::ZOrder, over: Over::All }) {
        let net = nets::sobol(factors.min(nets::SOBOL_DIMENSIONS), 32);
        return Method::Picture(NetTables::new(&net, 32), ZOrder::new(runs, frames));
    }
    let array = |array: Option<OrthogonalArray>, correlated| {
        array.map_or(Method::LatinHypercube, |a| Method::Array(ArrayMethod::new(a, factors, correlated)))
    };
    let net = |set: Option<Vec<nets::Matrix>>| {
        let set = set.unwrap_or_else(|| nets::sobol(factors.min(nets::SOBOL_DIMENSIONS), bits));
        let width = set.first().map_or(0, |m| m.len().try_into().unwrap_or(0));
        Method::Net(NetTables::new(&set[..factors.min(set.len())], width))
    };
    match choice.kind {
        Kind::Random => Method::Random,
        Kind::Jittered => Method::Jittered,
        Kind::LatinHypercube => Method::LatinHypercube,
        Kind::LatinSquare => array(square_root(runs).map(OrthogonalArray::latin_square), false),
        Kind::Orthogonal => array(square_root(runs).and_then(OrthogonalArray::bose), false),
        Kind::OrthogonalCorrelated => array(square_root(runs).and_then(OrthogonalArray::bose), true),
        Kind::OrthogonalStrength3 => array(cube_root(runs).and_then(OrthogonalArray::bush), false),
        Kind::PoissonDisk => Method::Disk(DiskTiles::new(runs, seed)),
        Kind::Strong => net(nets::strong(bits)),
        Kind::Nested => net(nets::nested(bits)),
        Kind::Sobol | Kind::Auto => net(None),
    }
}

/// Fresh permutations of every factor's levels in one pixel.
#[derive(Debug, Clone, Copy)]
struct Levels([[u8; MAX_LEVELS]; MAX_COLUMNS]);

impl Levels {
    /// None where an array has too many levels for a table: then they are permuted by hash.
    fn new(method: &ArrayMethod, key: u64) -> Option<Self> {
        let q = method.array.levels() as usize;
        if q > MAX_LEVELS {
            return None;
        }
        let mut levels = Self([[0; MAX_LEVELS]; MAX_COLUMNS]);
        for (permutation, column) in levels.0[..method.columns].iter_mut().zip(0_u64..) {
            fill_permutation(&mut permutation[..q], subkey(key, tag::LEVELS | column));
        }
        Some(levels)
    }
}

/// A design's runs in one pixel.
#[derive(Debug, Clone, Copy)]
pub struct PixelDesign<'a> {
    design: &'a Design,
    key: u64,
    place: Place,
    /// The key of the net's scrambles: the pixel's own, or that of all pixels which share a net.
    net_key: u64,
    /// Index of run 0 in the net.
    first: u32,
    levels: Option<Levels>,
}

impl PixelDesign<'_> {
    /// Run `run`, from 0 to the design's runs − 1; a run beyond wraps around in the design.
    #[must_use]
    #[inline]
    pub fn point(&self, run: u32) -> Point<'_> {
        let run = if run < self.design.runs { run } else { run % self.design.runs };
        let index = match &self.design.method {
            Method::Picture(..) => shuffle_index(self.first.wrapping_add(run), 32, subseed(self.net_key, tag::SHUFFLE)),
            _ => run,
        };
        Point { pixel: self, run, index }
    }
}

/// One run in one pixel: a point of [0, 1)^d, evaluated a factor at a time.
#[derive(Debug, Clone, Copy)]
pub struct Point<'a> {
    pixel: &'a PixelDesign<'a>,
    run: u32,
    /// The run's index in the net.
    index: u32,
}

impl Point<'_> {
    /// The coordinate of `factor`, in [0, 1). Factors that the design was not built over answer too, stratified as
    /// well as padding can.
    #[must_use]
    #[inline]
    pub fn get(&self, factor: Factor) -> f32 {
        let design = self.pixel.design;
        let column = design.columns.get(usize::from(factor.index())).copied().unwrap_or(PAD);
        let bits = match &design.method {
            Method::Net(net) | Method::Picture(net, _) if column != PAD => {
                let seed = subseed(self.pixel.net_key, tag::SCRAMBLE | u64::from(column));
                scramble_reversed(net.reversed(usize::from(column), self.index), seed).reverse_bits()
            }
            Method::Array(method) if column != PAD => self.array_level(method, usize::from(column)),
            Method::Jittered if !factor.is_extra() && factor != Factor::SHUTTER => self.jittered_pair(factor),
            Method::Disk(tiles) if factor == Factor::FILM_X || factor == Factor::FILM_Y => {
                tiles.coordinate(self.run, factor == Factor::FILM_Y, self.pixel.key)
            }
            Method::Random | Method::Disk(_) => self.jitter(factor),
            Method::LatinHypercube | Method::Jittered => self.stratum_of_its_own(factor),
            _ if factor.is_extra() => self.stratum_of_its_own(factor),
            _ => self.pad(factor),
        };
        let bits = if design.choice.dither.mask == Mask::None { bits } else { self.dithered(factor, column, bits) };
        numeric::unit_from_bits(bits)
    }

    /// 32 independent bits for `factor`.
    #[inline]
    fn jitter(&self, factor: Factor) -> u32 {
        let key = subkey(self.pixel.key, tag::JITTER | u64::from(factor.index()));
        subseed(key, u64::from(self.run))
    }

    /// One of N strata of [0, 1), by a permutation of the factor's own.
    fn stratum_of_its_own(&self, factor: Factor) -> u32 {
        let runs = self.pixel.design.runs;
        let key = subkey(self.pixel.key, tag::SHUFFLE | u64::from(factor.index()));
        point_in_stratum(permute(self.run, runs, key), runs, self.jitter(factor)) << 8
    }

    /// One coordinate of a cell of N that tile the square of the factor's pair: rows of ⌊c⌋ or ⌈c⌉ cells, each row as
    /// high as it has cells, so that every cell has area 1/N whatever N is.
    fn jittered_pair(&self, factor: Factor) -> u32 {
        let runs = self.pixel.design.runs;
        let place = if factor.index() < 2 { factor.index() } else { factor.index() - 3 };
        let (pair, second) = (place / 2 + u16::from(factor.index() > 2), place % 2 == 1);
        let cell = permute(self.run, runs, subkey(self.pixel.key, tag::SHUFFLE | 1 << 16 | u64::from(pair)));
        let rows = round_root(runs);
        let (short, longer) = (runs / rows, runs % rows);
        // The first `longer` rows have one cell more.
        let split = longer * (short + 1);
        let (start, width) = if cell < split {
            (cell / (short + 1) * (short + 1), short + 1)
        } else {
            (split + (cell - split) / short * short, short)
        };
        let jitter = self.jitter(factor);
        if second {
            // The row's strip [start, start + width) of runs: its height in units of 1/N.
            let position = u64::from(jitter) * u64::from(width);
            #[allow(clippy::cast_possible_truncation, reason = "whole and fractional parts of 32 bits each")]
            let (whole, fraction) = ((position >> 32) as u32, position as u32);
            point_in_stratum(start + whole, runs, fraction) << 8
        } else {
            point_in_stratum(cell - start, width, jitter) << 8
        }
    }

    /// The stratum that the array and its refinement give.
    fn array_level(&self, method: &ArrayMethod, column: usize) -> u32 {
        let q = method.array.levels();
        let raw = method.array.level(self.run, column);
        let level = match &self.pixel.levels {
            Some(levels) => u32::from(levels.0[column][usize::from(raw)]),
            None => permute(u32::from(raw), q, subkey(self.pixel.key, tag::LEVELS | column as u64)),
        };
        let rank = u32::from(method.ranks[self.run as usize * method.columns + column]);
        let group = if method.correlated { 0 } else { u64::from(level) + 1 };
        let key = subkey(self.pixel.key, tag::REFINE | group << 16 | column as u64);
        let stratum = (level * method.per_level + method.refined(rank, key)) as usize;
        let (low, high) = (method.bounds[stratum], method.bounds[stratum + 1]);
        let position = u64::from(subseed(key, (1 << 32) | u64::from(self.run)));
        #[allow(clippy::cast_possible_truncation, reason = "below the stratum's width")]
        let offset = ((u64::from(high - low) * position) >> 32) as u32;
        (low + offset) << 8
    }

    /// A factor of a further vertex: four factors share a net of their own, its runs shuffled against all others.
    fn pad(&self, factor: Factor) -> u32 {
        let design = self.pixel.design;
        let index = factor.index();
        let (group, column) = if index < 5 {
            (0xf000 + index / 4, index % 4)
        } else {
            ((index - 5) / Factor::PER_VERTEX, (index - 5) % Factor::PER_VERTEX)
        };
        let key = subkey(self.pixel.key, tag::SHUFFLE | 2 << 16 | u64::from(group) << 32);
        let run = shuffle_index(self.run, design.pad.bits(), subseed(key, 4));
        scramble_reversed(design.pad.reversed(usize::from(column), run), subseed(key, u64::from(column))).reverse_bits()
    }

    /// `bits` with the place inside its stratum of 1/N decided by the mask, if it governs `factor`.
    fn dithered(&self, factor: Factor, column: u8, bits: u32) -> u32 {
        let (design, place) = (self.pixel.design, self.pixel.place);
        let Dither { mask, over } = design.choice.dither;
        if (over == Over::Time && factor != Factor::SHUTTER) || factor.is_extra() || column == PAD {
            return bits;
        }
        let column = u32::from(factor.index());
        let key = subkey(design.seed_key, tag::MASK);
        let jitter = self.jitter(factor);
        let position = match mask {
            Mask::Ordered => dither::ordered(4, place, column, key, jitter),
            Mask::Ordered8 => dither::ordered(8, place, column, key, jitter),
            Mask::BlueNoise => dither::blue_noise(place, column, key, jitter),
            Mask::R2 => dither::r2(place, column, key),
            Mask::ZOrder if over == Over::Time => ZOrder::position(place, column, design.seed_key, design.frames),
            Mask::ZOrder | Mask::None | Mask::Auto => return bits,
        };
        let stratum = (u64::from(bits >> 8) * u64::from(design.runs)) >> 24;
        #[allow(clippy::cast_possible_truncation, reason = "below the number of runs")]
        let stratum = stratum as u32;
        point_in_stratum(stratum, design.runs, position) << 8
    }
}

/// The whole number nearest to √n.
fn round_root(n: u32) -> u32 {
    let root = n.isqrt();
    if n - root * root > root { root + 1 } else { root }
}
