//! Pixels' sums as bytes: exactly what a merged picture will ask of them, and no more.
//!
//! The estimate of a design of N runs needs the quarters of N's maximal aligned blocks. A smaller block, of a machine
//! that had a slice of the runs, is a quarter or half of such a block, or a part of a quarter: it is stored as so many
//! parts, often as one. Halves and totals follow from quarters by the very additions that made them. Filter weights are
//! left out where all are 1, counts where no run was rejected, second moments where enough runs make them unused. Pixels
//! that stopped by themselves have all their runs in one part: of them the estimates are kept.

use super::accumulate::{ENOUGH, Moments, Part, PixelAccumulator, PixelEstimate, Sums};
use super::aligned::{Block, aligned_blocks};
use glam::{DVec3, Vec3};
use std::ops::Range;

/// All filter weights are 1: sums of weights are counts, weighted sums are plain ones.
const UNIT: u8 = 1;
/// No run was rejected: counts are the blocks' sizes.
const FULL: u8 = 2;

/// Which blocks the sums over a slice of a design's runs consist of, and how finely each must be kept.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Layout {
    blocks: Vec<(u64, u32, u8)>,
}

impl Layout {
    /// Of the runs `slice` of a design of `total` runs, which holds them.
    #[must_use]
    pub fn new(slice: Range<u32>, total: u32) -> Self {
        let (slice, total) = (u64::from(slice.start)..u64::from(slice.end), u64::from(total));
        let blocks = aligned_blocks(slice)
            .map(|(start, level)| {
                let holds = |&(s, l): &(u64, u32)| s <= start && start < s + (1 << l);
                let whole = aligned_blocks(0..total).find(holds).map_or(level, |(_, whole)| whole);
                let wanted = 4_u8 >> whole.saturating_sub(level).min(2);
                let there = 1_u8 << level.min(2);
                (start, level, wanted.min(there))
            })
            .collect();
        Self { blocks }
    }

    /// Starts and levels of the blocks.
    pub fn blocks(&self) -> impl Iterator<Item = (u64, u32)> {
        self.blocks.iter().map(|&(start, level, _)| (start, level))
    }

    /// Appends the sums of `pixels`, each over this layout's runs, to `out`.
    pub fn pack(&self, pixels: &[PixelAccumulator], out: &mut Vec<u8>) {
        let flags = self.flags(pixels);
        out.push(flags);
        for pixel in pixels {
            for (block, &(_, _, parts)) in pixel.sums.blocks().iter().zip(&self.blocks) {
                put_sums(&block.sums, parts, flags, out);
            }
        }
    }

    fn flags(&self, pixels: &[PixelAccumulator]) -> u8 {
        let mut flags = UNIT | FULL;
        for (block, &(_, level, parts)) in pixels.iter().flat_map(|p| p.sums.blocks().iter().zip(&self.blocks)) {
            let Sums { moments, rejected, .. } = &block.sums;
            let used = &finest(&block.sums, parts)[..usize::from(parts)];
            if *rejected > 0 || used.iter().any(|part| u64::from(part.runs) != (1 << level) / u64::from(parts)) {
                flags &= !FULL;
            }
            let zero = |v: f64| v.to_bits() == 0;
            let unit = |part: &Part| {
                f64::from(part.runs).to_bits() == part.weight.to_bits() && same_bits(part.plain, part.weighted)
            };
            if !(used.iter().all(unit) && zero(moments.weight) && moments.cross.to_array().into_iter().all(zero)) {
                flags &= !UNIT;
            }
        }
        flags
    }

    /// Appends the sums at the start of `bytes` to `pixels`, whose runs must all be earlier ones; gives what follows
    /// them, or nothing if there are too few bytes.
    pub fn unpack<'b>(&self, bytes: &'b [u8], pixels: &mut [PixelAccumulator]) -> Option<&'b [u8]> {
        let (&flags, mut rest) = bytes.split_first()?;
        for pixel in pixels {
            for &(start, level, parts) in &self.blocks {
                let sums = take_sums(&mut rest, level, parts, flags)?;
                pixel.sums.push(Block { start, level, sums });
            }
        }
        Some(rest)
    }
}

/// Appends estimates as they are: for pixels whose runs were not a fixed number, and which no other part adds to.
pub(crate) fn pack_estimates(pixels: &[PixelEstimate], out: &mut Vec<u8>) {
    for pixel in pixels {
        for value in [pixel.radiance, pixel.variance].iter().flat_map(|v| v.to_array()) {
            out.extend_from_slice(&value.to_le_bytes());
        }
        out.extend_from_slice(&pixel.runs.to_le_bytes());
        out.extend_from_slice(&pixel.rejected.to_le_bytes());
    }
}

/// A block's pixels as parts are read one after another.
#[derive(Debug)]
pub(crate) enum Unpacked {
    /// Of a fixed number of runs: their sums.
    Sums(Vec<PixelAccumulator>),
    /// Those that stopped by themselves: what they came to.
    Settled(Vec<PixelEstimate>),
}

impl Default for Unpacked {
    fn default() -> Self {
        Self::Sums(Vec::new())
    }
}

impl Unpacked {
    /// Begins anew with `count` pixels without runs.
    pub(crate) fn begin(&mut self, count: usize, is_settled: bool) {
        match self {
            Self::Sums(pixels) if !is_settled => {
                pixels.iter_mut().for_each(|sums| sums.reset(0));
                pixels.resize_with(count, PixelAccumulator::default);
            }
            _ if is_settled => *self = Self::Settled(vec![PixelEstimate::default(); count]),
            _ => *self = Self::Sums(vec![PixelAccumulator::default(); count]),
        }
    }

    /// Adds what a part of `layout` says of the pixels, and gives what follows it; `None` if `bytes` are too short.
    pub(crate) fn unpack<'b>(&mut self, bytes: &'b [u8], layout: &Layout) -> Option<&'b [u8]> {
        match self {
            Self::Sums(pixels) => layout.unpack(bytes, pixels),
            Self::Settled(pixels) => unpack_estimates(bytes, pixels),
        }
    }

    /// What the pixels come to.
    pub(crate) fn estimates(&self) -> Vec<PixelEstimate> {
        match self {
            Self::Sums(pixels) => pixels.iter().map(PixelAccumulator::estimate).collect(),
            Self::Settled(pixels) => pixels.clone(),
        }
    }
}

/// Reads what [`pack_estimates`] wrote into as many `pixels`, and gives what follows it; `None` if `bytes` are too short.
fn unpack_estimates<'b>(bytes: &'b [u8], pixels: &mut [PixelEstimate]) -> Option<&'b [u8]> {
    let mut rest = bytes;
    for pixel in pixels {
        let mut value = || take(&mut rest).map(f32::from_le_bytes);
        let radiance = Vec3::new(value()?, value()?, value()?);
        let variance = Vec3::new(value()?, value()?, value()?);
        *pixel = PixelEstimate { radiance, variance, runs: take_u32(&mut rest)?, rejected: take_u32(&mut rest)? };
    }
    Some(rest)
}

fn same_bits(a: DVec3, b: DVec3) -> bool {
    a.to_array().map(f64::to_bits) == b.to_array().map(f64::to_bits)
}

/// The sums of the block's `parts` parts.
fn finest(sums: &Sums, parts: u8) -> [Part; 4] {
    Sums { known: parts, ..*sums }.parts()
}

fn put_sums(sums: &Sums, parts: u8, flags: u8, out: &mut Vec<u8>) {
    let put = |values: &[f64], out: &mut Vec<u8>| values.iter().for_each(|v| out.extend_from_slice(&v.to_le_bytes()));
    if flags & FULL == 0 {
        out.extend_from_slice(&sums.rejected.to_le_bytes());
    }
    for part in &finest(sums, parts)[..usize::from(parts)] {
        if flags & FULL == 0 {
            out.extend_from_slice(&part.runs.to_le_bytes());
        }
        put(&part.plain.to_array(), out);
        if flags & UNIT == 0 {
            put(&part.weighted.to_array(), out);
            put(&[part.weight], out);
        }
    }
    if sums.total.runs < ENOUGH {
        put(&sums.moments.weighted.to_array(), out);
        if flags & UNIT == 0 {
            put(&sums.moments.cross.to_array(), out);
            put(&[sums.moments.weight], out);
        }
    }
}

fn take<const N: usize>(bytes: &mut &[u8]) -> Option<[u8; N]> {
    let (taken, rest) = bytes.split_first_chunk::<N>()?;
    *bytes = rest;
    Some(*taken)
}

/// Takes a little-endian `u32` off the front.
pub(crate) fn take_u32(bytes: &mut &[u8]) -> Option<u32> {
    take(bytes).map(u32::from_le_bytes)
}

/// Takes a little-endian `f64` off the front.
pub(crate) fn take_f64(bytes: &mut &[u8]) -> Option<f64> {
    take(bytes).map(f64::from_le_bytes)
}

fn take_vector(bytes: &mut &[u8]) -> Option<DVec3> {
    Some(DVec3::new(take_f64(bytes)?, take_f64(bytes)?, take_f64(bytes)?))
}

fn take_sums(bytes: &mut &[u8], level: u32, parts: u8, flags: u8) -> Option<Sums> {
    let mut sums = Sums { known: parts, ..Sums::EMPTY };
    if flags & FULL == 0 {
        sums.rejected = take_u32(bytes)?;
    }
    let mut finest = [Part::default(); 4];
    for part in &mut finest[..usize::from(parts)] {
        part.runs = if flags & FULL == 0 { take_u32(bytes)? } else { (1 << level) / u32::from(parts) };
        part.plain = take_vector(bytes)?;
        (part.weighted, part.weight) = if flags & UNIT == 0 {
            (take_vector(bytes)?, take_f64(bytes)?)
        } else {
            (part.plain, f64::from(part.runs))
        };
    }
    match parts {
        1 => sums.total = finest[0],
        2 => {
            sums.halves = [finest[0], finest[1]];
            sums.total = finest[0].plus(&finest[1]);
        }
        _ => {
            sums.quarters = finest;
            sums.halves = [finest[0].plus(&finest[1]), finest[2].plus(&finest[3])];
            sums.total = sums.halves[0].plus(&sums.halves[1]);
        }
    }
    if sums.total.runs < ENOUGH {
        sums.moments = Moments { weighted: take_vector(bytes)?, ..Moments::default() };
        if flags & UNIT == 0 {
            sums.moments.cross = take_vector(bytes)?;
            sums.moments.weight = take_f64(bytes)?;
        }
    }
    Some(sums)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::numeric;
    use proptest::prelude::*;

    fn pixel(runs: Range<u32>, key: u64, weights: &[f32], rejects: bool) -> PixelAccumulator {
        let mut sum = PixelAccumulator::new(runs.start);
        for run in runs {
            let bits = numeric::mix64((key << 32) + u64::from(run) + 1);
            #[allow(clippy::cast_possible_truncation, reason = "any bits will do")]
            let value = numeric::unit_from_bits(bits as u32);
            let lost = rejects && bits >> 61 == 0;
            let radiance = Vec3::new(value, value * 1e4, if lost { f32::NAN } else { value * 1e-3 });
            sum.add(radiance, weights[(bits >> 40) as usize % weights.len()]);
        }
        sum
    }

    #[test]
    fn estimates_come_back_as_they_were() {
        let some = pixel(0..40, 3, &[1.4, 0.6], true).estimate();
        let pixels = [some, PixelEstimate::default(), PixelEstimate { variance: Vec3::INFINITY, runs: 1, ..some }];
        let mut bytes = Vec::new();
        pack_estimates(&pixels, &mut bytes);
        let end = bytes.len();
        bytes.push(7);
        let mut back = [PixelEstimate::default(); 3];
        assert_eq!(unpack_estimates(&bytes, &mut back), Some(&[7_u8][..]));
        assert_eq!(back, pixels);
        assert_eq!(unpack_estimates(&bytes[..end - 1], &mut back), None);
    }

    proptest! {
        /// Estimates have the bits of one pass, whatever the division, the weights and the rejected runs.
        #[test]
        fn slices_packed_and_unpacked_give_the_bits_of_one_pass(
            total in 1_u32..300, cuts in proptest::collection::vec(0_u32..300, 0..5),
            weighted in any::<bool>(), rejects in any::<bool>(), key in 0_u64..1000,
        ) {
            let weights: &[f32] = if weighted { &[1.4, -1.4, 1.4, 0.7] } else { &[1.0] };
            let mut cuts: Vec<u32> = cuts.into_iter().map(|c| c.min(total)).chain([0, total]).collect();
            cuts.sort_unstable();
            let mut merged = vec![PixelAccumulator::new(0); 3];
            for pair in cuts.windows(2) {
                let layout = Layout::new(pair[0]..pair[1], total);
                let part: Vec<_> = (0..3).map(|i| pixel(pair[0]..pair[1], key + i, weights, rejects)).collect();
                let mut bytes = Vec::new();
                layout.pack(&part, &mut bytes);
                let end = bytes.len();
                bytes.push(7);
                prop_assert_eq!(layout.unpack(&bytes, &mut merged), Some(&[7_u8][..]));
                prop_assert!(end == 1 || layout.unpack(&bytes[..end - 1], &mut merged.clone()).is_none());
            }
            for (i, pixel_of_parts) in (0..).zip(&merged) {
                let whole = pixel(0..total, key + i, weights, rejects).estimate();
                prop_assert_eq!(format!("{:?}", pixel_of_parts.estimate()), format!("{whole:?}"));
            }
        }

        #[test]
        fn what_is_there_of_a_design_has_an_estimate(first in 0_u32..200, last in 0_u32..200) {
            let slice = first.min(last)..first.max(last) + 1;
            let layout = Layout::new(slice.clone(), 256);
            let mut bytes = Vec::new();
            layout.pack(&[pixel(slice.clone(), 1, &[1.0], false)], &mut bytes);
            let mut merged = [PixelAccumulator::new(0)];
            layout.unpack(&bytes, &mut merged).unwrap();
            let estimate = merged[0].estimate();
            prop_assert_eq!(estimate.runs, slice.end - slice.start);
            prop_assert!(estimate.radiance.is_finite() && !estimate.variance.is_nan());
        }
    }

    #[test]
    fn a_quarter_of_the_runs_takes_24_bytes_and_all_of_them_96() {
        for (slice, bytes) in [(0..64, 24), (64..128, 24), (0..256, 96), (0..128, 48), (0..192, 72), (3..4, 48)] {
            let mut out = Vec::new();
            Layout::new(slice.clone(), 256).pack(&[pixel(slice, 5, &[1.0], false)], &mut out);
            assert_eq!(out.len(), 1 + bytes);
        }
    }
}
