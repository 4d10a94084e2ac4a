//! The designs themselves: from an address to a coordinate.

use super::address::PixelAddress;
use super::array::OrthogonalArray;
use super::choose::{Choice, choose, cube_root, square_root};
use super::disk::{DiskTiles, Process};
use super::dither::{self, Place, ZOrder};
use super::hash::{draw, permute, scramble_reversed, shuffle_index, subkey, subseed};
use super::kind::{Dither, Kind, Mask, Over};
use super::nets::{self, NetTables};
use super::pads::{self, Pad, Pads};
use super::placed::Placed;
use super::refine::ArrayMethod;
use super::strata::Strata;
use crate::factor::Factor;
use crate::numeric;

/// Marks a factor that the design has no column for.
const PAD: u8 = u8::MAX;

/// Most columns of a net that are used; factors beyond are padded.
const MOST_COLUMNS: usize = 24;

/// Uses of a pixel's key, kept apart.
mod tag {
    pub(super) const SCRAMBLE: u64 = 0;
    pub(super) const SHUFFLE: u64 = 1 << 56;
    pub(super) const JITTER: u64 = 2 << 56;
    pub(super) const ARRAY: u64 = 3 << 56;
    pub(super) const MASK: u64 = 4 << 56;
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

/// A design over the factors of one picture.
#[derive(Debug, Clone)]
pub struct Design {
    choice: Choice,
    seed_key: u64,
    mask_key: u64,
    runs: u32,
    strata: Strata,
    frames: u32,
    line_step: u32,
    factors: Vec<Factor>,
    /// Column by factor index, [`PAD`] where there is none.
    columns: Vec<u8>,
    method: Method,
    /// Columns that the method has.
    room: usize,
    /// Permutations of the runs that are written down for each pixel.
    placed: usize,
    /// For factors without a column.
    pads: Pads,
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
        let method = method(&choice, runs, active.len(), options.frames, options.seed);
        let room = match &method {
            Method::Array(array) => array.columns,
            Method::Net(net) | Method::Picture(net, _) => net.columns().min(MOST_COLUMNS),
            _ => active.len().min(usize::from(PAD)),
        };
        let mut columns = vec![PAD; active.last().map_or(0, |f| usize::from(f.index()) + 1)];
        for (factor, column) in active.iter().zip(0..u8::try_from(room).unwrap_or(PAD)) {
            columns[usize::from(factor.index())] = column;
        }
        let rows = match &method {
            Method::Array(_) | Method::LatinHypercube => room.min(active.len()),
            Method::Jittered => active.last().map_or(0, |f| jittered_row(*f) + 1),
            _ => 0,
        };
        let seed_key = numeric::mix64(options.seed ^ 0x6772_6165_636f);
        let line_step = options.line_step.max(1);
        Self {
            choice,
            seed_key,
            mask_key: subkey(seed_key, tag::MASK),
            runs,
            strata: Strata::new(runs),
            frames: options.frames,
            line_step,
            factors,
            columns,
            method,
            room,
            placed: Placed::rows(runs, rows),
            pads: Pads::new(runs),
        }
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
        if let Method::Picture(_, order) = &self.method {
            let (net_key, first) = order.locate(place, self.seed_key);
            let key = subkey(net_key, tag::JITTER | u64::from(first) << 16);
            let shuffle = subseed(net_key, tag::SHUFFLE);
            let seeds = self.scrambles(net_key);
            return PixelDesign { design: self, key, place, first, shuffle, seeds, placed: None };
        }
        let key = subkey(subkey(self.seed_key, xy), time);
        let seeds = match &self.method {
            Method::Net(_) => self.scrambles(key),
            Method::Array(_) => first_pads(key),
            _ => [0; MOST_COLUMNS],
        };
        PixelDesign { design: self, key, place, first: 0, shuffle: 0, seeds, placed: self.placed(key) }
    }

    /// The pixel's permutations, written down.
    #[inline]
    fn placed(&self, pixel_key: u64) -> Option<Placed> {
        if self.placed == 0 {
            return None;
        }
        Some(match &self.method {
            Method::Array(method) => Placed::array(method, self.placed, |column| array_key(pixel_key, column)),
            _ => Placed::independent(self.runs, self.placed, |row| subkey(pixel_key, tag::SHUFFLE | row as u64)),
        })
    }

    /// Seeds of the net's scrambles by column.
    #[inline]
    fn scrambles(&self, net_key: u64) -> [u32; MOST_COLUMNS] {
        let mut seeds = [0; MOST_COLUMNS];
        for (seed, column) in seeds[..self.room].iter_mut().zip(0_u64..) {
            *seed = subseed(net_key, tag::SCRAMBLE | column);
        }
        seeds
    }
}

/// The upper 32 bits, which are mixed best.
#[inline]
const fn upper_half(bits: u64) -> u32 {
    (bits >> 32) as u32
}

/// What the jitter of `run` in factor `index` is drawn by: even (odd numbers are the pads'), and below 2⁴⁸.
#[inline]
pub(super) fn jitter_tag(run: u32, index: u16) -> u64 {
    (u64::from(run) << 16 | u64::from(index)) << 1
}

/// Key of an array's column in one pixel.
#[inline]
fn array_key(pixel_key: u64, column: usize) -> u64 {
    subkey(pixel_key, tag::ARRAY | column as u64)
}

/// The seeds of the first group of pads, in order.
#[inline]
fn first_pads(pixel_key: u64) -> [u32; MOST_COLUMNS] {
    let mut seeds = [0; MOST_COLUMNS];
    for (seed, number) in seeds[..pads::SEEDS].iter_mut().zip(0..) {
        *seed = pads::seed(pixel_key, 0, number);
    }
    seeds
}

/// Which permutation of the runs places `factor` in a jittered design: one a pair, and one for the shutter.
#[inline]
fn jittered_row(factor: Factor) -> usize {
    match usize::from(factor.index()) {
        0 | 1 => 0,
        2 => 1,
        index => 2 + (index - 3) / 2,
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
        Kind::PoissonDisk => Method::Disk(DiskTiles::new(runs, seed, Process::Darts)),
        Kind::PointDiffusion => Method::Disk(DiskTiles::new(runs, seed, Process::Diffusion)),
        Kind::Strong => net(nets::strong(bits)),
        Kind::Nested => net(nets::nested(bits)),
        Kind::Growing => net(Some(nets::growing(bits))),
        Kind::Sobol | Kind::Auto => net(None),
    }
}

/// A design's runs in one pixel.
#[derive(Debug, Clone, Copy)]
pub struct PixelDesign<'a> {
    design: &'a Design,
    key: u64,
    place: Place,
    /// Index of run 0 in the net.
    first: u32,
    /// Seed of the net's shuffle, where pixels share it.
    shuffle: u32,
    /// Seeds of the net's scrambles by column: the pixel's own, or those of all pixels which share a net. Of an array, which
    /// has few columns, the seeds of the first group of pads.
    seeds: [u32; MOST_COLUMNS],
    placed: Option<Placed>,
}

impl PixelDesign<'_> {
    /// Run `run`, from 0 to the design's runs − 1; a run beyond wraps around in the design.
    #[must_use]
    #[inline]
    pub fn point(&self, run: u32) -> Point<'_> {
        let run = if run < self.design.runs { run } else { run % self.design.runs };
        let index = match &self.design.method {
            Method::Picture(..) => shuffle_index(self.first.wrapping_add(run), 32, self.shuffle),
            Method::Array(_) => self.design.pads.place(run, self.seeds[0]),
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
    /// The run's index in the net; of an array, in the first group of pads.
    index: u32,
}

impl Point<'_> {
    /// The coordinate of `factor`, in [0, 1). Factors that the design was not built over answer too, stratified as
    /// well as padding can.
    #[must_use]
    #[inline]
    pub fn get(&self, factor: Factor) -> f32 {
        #[cfg(test)]
        drawn::note(factor);
        let design = self.pixel.design;
        let column = design.columns.get(usize::from(factor.index())).copied().unwrap_or(PAD);
        let masked = design.choice.dither.mask != Mask::None && self.is_masked(factor, column);
        numeric::unit_from_bits(if masked { self.masked(factor, column) } else { self.drawn(factor, column) })
    }

    /// The coordinate's bits as the design itself has them.
    #[inline]
    fn drawn(&self, factor: Factor, column: u8) -> u32 {
        match &self.pixel.design.method {
            Method::Net(net) | Method::Picture(net, _) if column != PAD => {
                let seed = self.pixel.seeds[usize::from(column)];
                scramble_reversed(net.reversed(usize::from(column), self.index), seed).reverse_bits()
            }
            Method::Array(method) if column != PAD => self.array_level(method, factor, usize::from(column)),
            Method::Jittered if !factor.is_extra() && factor != Factor::SHUTTER => self.jittered_pair(factor),
            Method::Disk(tiles) if factor == Factor::FILM_X || factor == Factor::FILM_Y => {
                tiles.coordinate(self.run, factor == Factor::FILM_Y, self.pixel.key)
            }
            Method::Random | Method::Disk(_) => self.jitter(factor),
            Method::Jittered if factor == Factor::SHUTTER => self.stratum_of_its_own(factor, jittered_row(factor)),
            Method::LatinHypercube => self.stratum_of_its_own(factor, usize::from(column)),
            // Of runs that are no power of two a part of a net has no stratum each.
            Method::Array(_) if !self.pixel.design.runs.is_power_of_two() => {
                self.stratum_of_its_own(factor, usize::MAX)
            }
            _ if factor.is_extra() => self.stratum_of_its_own(factor, usize::MAX),
            _ => self.pad(factor),
        }
    }

    /// 32 independent bits for `factor`.
    #[inline]
    fn jitter(&self, factor: Factor) -> u32 {
        upper_half(draw(self.pixel.key, jitter_tag(self.run, factor.index())))
    }

    /// One of N strata of [0, 1), by the factor's own permutation, which is written down in `row` where there is room.
    #[inline]
    fn stratum_of_its_own(&self, factor: Factor, row: usize) -> u32 {
        self.pixel.design.strata.point(self.permuted(row, factor.index()), self.jitter(factor))
    }

    /// One coordinate of a cell of N that tile the square of the factor's pair.
    #[inline]
    fn jittered_pair(&self, factor: Factor) -> u32 {
        let second = if factor.index() < 2 { factor.index() == 1 } else { (factor.index() - 3) % 2 == 1 };
        let row = jittered_row(factor);
        // Both factors of a pair name its permutation alike: by the second.
        let number = factor.index() + u16::from(!second);
        self.pixel.design.strata.cell_point(self.permuted(row, number), second, self.jitter(factor))
    }

    /// This run's image under the permutation in `row`, or under one that is hashed by `number`.
    #[inline]
    fn permuted(&self, row: usize, number: u16) -> u32 {
        let design = self.pixel.design;
        match &self.pixel.placed {
            Some(placed) if row < design.placed => placed.stratum(design.runs, row, self.run),
            _ => self.hashed(number),
        }
    }

    /// This run's image under a permutation that is hashed by `number`. Kept out of line: what is written down is read
    /// without its registers.
    #[inline(never)]
    fn hashed(&self, number: u16) -> u32 {
        let key = subkey(self.pixel.key, tag::SHUFFLE | 1 << 16 | u64::from(number));
        permute(self.run, self.pixel.design.runs, key)
    }

    /// The stratum that the array and its refinement give.
    #[inline]
    fn array_level(&self, method: &ArrayMethod, factor: Factor, column: usize) -> u32 {
        let design = self.pixel.design;
        let stratum = match &self.pixel.placed {
            Some(placed) if column < design.placed => placed.stratum(design.runs, column, self.run),
            _ => method.stratum(self.run, column, array_key(self.pixel.key, column)),
        };
        design.strata.point(stratum, self.jitter(factor))
    }

    /// A factor of a further vertex: four factors share a net of their own, its runs shuffled against all others.
    fn pad(&self, factor: Factor) -> u32 {
        let (design, pad) = (self.pixel.design, Pad::of(factor));
        let (place, seed) = if pad.group == 0 && matches!(design.method, Method::Array(_)) {
            (self.index, self.pixel.seeds[usize::from(pad.scramble())])
        } else {
            let seed = |number: u16| pads::seed(self.pixel.key, pad.group, number);
            (design.pads.place(self.run, seed(0)), seed(pad.scramble()))
        };
        design.pads.coordinate(pad.column, place, seed)
    }

    /// Whether the mask governs `factor`.
    #[inline]
    fn is_masked(&self, factor: Factor, column: u8) -> bool {
        let Dither { mask, over } = self.pixel.design.choice.dither;
        let governed = over == Over::All || factor == Factor::SHUTTER;
        governed && column != PAD && (mask != Mask::ZOrder || over == Over::Time)
    }

    /// The drawn coordinate with its place inside its stratum of 1/N decided by the mask.
    fn masked(&self, factor: Factor, column: u8) -> u32 {
        let (design, place, key) = (self.pixel.design, self.pixel.place, self.pixel.design.mask_key);
        let stratum = if design.runs == 1 {
            0
        } else {
            (u64::from(self.drawn(factor, column) >> 8) * u64::from(design.runs)) >> 24
        };
        let column = u32::from(factor.index());
        let position = match design.choice.dither.mask {
            Mask::Ordered => dither::ordered(4, place, column, key, self.jitter(factor)),
            Mask::Ordered8 => dither::ordered(8, place, column, key, self.jitter(factor)),
            Mask::BlueNoise => dither::blue_noise(place, column, key, self.jitter(factor)),
            Mask::R2 => dither::r2(place, column, key),
            Mask::ZOrder | Mask::None | Mask::Auto => ZOrder::position(place, column, design.seed_key, design.frames),
        };
        #[allow(clippy::cast_possible_truncation, reason = "below the number of runs")]
        let stratum = stratum as u32;
        design.strata.point(stratum, position)
    }
}

/// Which factors this thread drew: tests see to it that what needs no number draws none.
#[cfg(test)]
pub(crate) mod drawn {
    use crate::factor::Factor;
    use std::cell::RefCell;

    thread_local!(static FACTORS: RefCell<Vec<Factor>> = const { RefCell::new(Vec::new()) });

    pub(super) fn note(factor: Factor) {
        FACTORS.with_borrow_mut(|factors| factors.push(factor));
    }

    /// Those since this was last asked, in order.
    pub(crate) fn take() -> Vec<Factor> {
        FACTORS.take()
    }
}
