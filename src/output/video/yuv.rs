//! R'G'B' pictures as Y'CbCr planes.

use super::notch;
use crate::output::quantise::{Dither, Place};
use crate::output::{FieldOrder, Picture, View};
use crate::time::Parity;
use crate::{Error, Result};
use rayon::prelude::*;

/// Weights of red and blue in luma.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, serde::Serialize, serde::Deserialize)]
pub enum Matrix {
    /// BT.601-7 §2.5.1.
    Bt601,
    /// BT.709-6 §3.2.
    Bt709,
}

impl Matrix {
    /// The one that pictures of `lines` lines use: BT.601 up to 576.
    #[must_use]
    pub const fn of_lines(lines: u32) -> Self {
        if lines <= 576 { Self::Bt601 } else { Self::Bt709 }
    }

    const fn red_blue(self) -> (f64, f64) {
        match self {
            Self::Bt601 => (0.299, 0.114),
            Self::Bt709 => (0.2126, 0.0722),
        }
    }

    /// Y' in [0, 1], Cb and Cr in [−½, ½] of R'G'B' in [0, 1].
    #[must_use]
    pub fn ycbcr(self, rgb: [f64; 3]) -> [f64; 3] {
        let (kr, kb) = self.red_blue();
        let [r, g, b] = rgb;
        let y = kr * r + (1.0 - kr - kb) * g + kb * b;
        [y, (b - y) / (2.0 * (1.0 - kb)), (r - y) / (2.0 * (1.0 - kr))]
    }

    /// The inverse of [`Matrix::ycbcr`].
    #[must_use]
    pub fn rgb(self, ycbcr: [f64; 3]) -> [f64; 3] {
        let (kr, kb) = self.red_blue();
        let [y, cb, cr] = ycbcr;
        let (r, b) = (y + cr * 2.0 * (1.0 - kr), y + cb * 2.0 * (1.0 - kb));
        [r, (y - kr * r - kb * b) / (1.0 - kr - kb), b]
    }
}

/// Chroma samples per luma sample.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default, serde::Serialize, serde::Deserialize)]
pub enum Sampling {
    /// 4:4:4.
    #[serde(rename = "444")]
    S444,
    /// 4:2:2: half as many columns, on the even ones.
    #[default]
    #[serde(rename = "422")]
    S422,
    /// 4:2:0: half as many columns, on the even ones, and half as many lines; of interlaced pictures within each field,
    /// a quarter of the field's line distance from the nearer line (MPEG-2, ISO/IEC 13818-2 §6.1.1.8).
    #[serde(rename = "420")]
    S420,
    /// 4:1:1: a quarter of the columns; NTSC's DV.
    #[serde(rename = "411")]
    S411,
}

impl Sampling {
    /// Columns and lines of luma for one of chroma.
    #[must_use]
    pub const fn steps(self) -> (u32, u32) {
        match self {
            Self::S444 => (1, 1),
            Self::S422 => (2, 1),
            Self::S420 => (2, 2),
            Self::S411 => (4, 1),
        }
    }
}

/// Bits of a sample.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum BitDepth {
    /// 8: black 16, white 235.
    #[default]
    Eight,
    /// 10: black 64, white 940.
    Ten,
}

/// Whether luminance detail is kept out of the NTSC colour subcarrier's band.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum ChromaNotch {
    /// Luma as it is.
    #[default]
    Off,
    /// Luma through [`notch::COEFFICIENTS`].
    On,
}

/// How pictures become Y'CbCr.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct YuvOptions {
    /// Display transform.
    pub view: View,
    /// Luma's weights.
    pub matrix: Matrix,
    /// Chroma resolution.
    pub sampling: Sampling,
    /// Bits.
    pub depth: BitDepth,
    /// How codes are chosen.
    pub dither: Dither,
    /// Filter on luma.
    pub notch: ChromaNotch,
}

impl YuvOptions {
    /// 8 bits, 4:2:2, dithered, the matrix of `lines` lines.
    #[must_use]
    pub fn for_lines(lines: u32) -> Self {
        Self {
            view: View::default(),
            matrix: Matrix::of_lines(lines),
            sampling: Sampling::default(),
            depth: BitDepth::default(),
            dither: Dither::On,
            notch: ChromaNotch::Off,
        }
    }
}

/// Codes of one frame: luma, Cb, Cr.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Frame {
    /// Columns and lines of luma.
    pub size: (u32, u32),
    /// Columns and lines of chroma.
    pub chroma_size: (u32, u32),
    /// Luma, Cb, Cr in row order.
    pub planes: [Vec<u16>; 3],
    /// Bits of the codes.
    pub depth: BitDepth,
}

/// Checks that pictures of this size and field order can be sampled so.
///
/// # Errors
/// If the size is not a multiple of what one chroma sample (of each field) covers.
pub fn check_size(size: (u32, u32), order: FieldOrder, sampling: Sampling) -> Result<()> {
    let (across, down) = sampling.steps();
    let down = if matches!(order, FieldOrder::Interlaced { .. }) { 2 * down } else { down };
    let (width, height) = size;
    if width == 0 || height == 0 || width % across != 0 || height % down != 0 {
        let kind = if down > sampling.steps().1 { "interlaced " } else { "" };
        return Err(Error::invalid(
            format!("{kind}video of {width}x{height} pixels"),
            format!("the width must be a multiple of {across} and the height of {down} with this chroma sampling"),
        ));
    }
    Ok(())
}

impl Frame {
    /// `picture` as Y'CbCr. A crop stands on black.
    ///
    /// # Errors
    /// If its size does not fit the chroma sampling.
    pub fn new(picture: &Picture, options: &YuvOptions) -> Result<Self> {
        check_size(picture.size, picture.metadata.order, options.sampling)?;
        let (width, height) = (picture.size.0 as usize, picture.size.1 as usize);
        let mut ycbcr = vec![[0.0; 3]; width * height];
        let lines = ycbcr.par_chunks_mut(width).zip(picture.whole_rgb().into_par_iter().chunks(width));
        lines.for_each(|(out, line)| {
            for (value, rgb) in out.iter_mut().zip(line) {
                *value = options.matrix.ycbcr(options.view.encode(rgb).to_array());
            }
        });
        let mut planes = [0, 1, 2].map(|channel| ycbcr.iter().map(|value| value[channel]).collect::<Vec<f64>>());
        if options.notch == ChromaNotch::On {
            planes[0].par_chunks_exact_mut(width).for_each(notch::filter_line);
        }
        let (across, down) = options.sampling.steps();
        let chroma_size = (picture.size.0 / across, picture.size.1 / down);
        let [luma, blue, red] = planes;
        let narrow = |plane: Vec<f64>| {
            let plane = if across > 1 { decimate_columns(&plane, width, across as usize) } else { plane };
            if down > 1 {
                decimate_lines(&plane, chroma_size.0 as usize, height, picture.metadata.order)
            } else {
                plane
            }
        };
        let instants = Instants::of(picture);
        let quantise = |plane: &[f64], channel: u32, columns: u32| codes(plane, channel, columns, &instants, options);
        Ok(Self {
            size: picture.size,
            chroma_size,
            planes: [
                quantise(&luma, 0, picture.size.0),
                quantise(&narrow(blue), 1, chroma_size.0),
                quantise(&narrow(red), 2, chroma_size.0),
            ],
            depth: options.depth,
        })
    }

    /// The bytes that YUV4MPEG2 holds: planes one after the other, 10-bit codes in two bytes, low byte first.
    #[must_use]
    #[allow(clippy::cast_possible_truncation, reason = "8-bit codes")]
    pub fn bytes(&self) -> Vec<u8> {
        let codes = self.planes.iter().flatten();
        match self.depth {
            BitDepth::Eight => codes.map(|&code| code as u8).collect(),
            BitDepth::Ten => codes.flat_map(|code| code.to_le_bytes()).collect(),
        }
    }
}

/// Which instant each line belongs to, numbered so that a picture of fields at rate r and a progressive one at 2r agree.
struct Instants {
    first: i64,
    /// Parity of the earlier field, if there are two.
    order: Option<Parity>,
}

impl Instants {
    fn of(picture: &Picture) -> Self {
        let frame = picture.metadata.frame;
        match picture.metadata.order {
            FieldOrder::Progressive => Self { first: frame, order: None },
            FieldOrder::Interlaced { first } => Self { first: frame.wrapping_mul(2), order: Some(first) },
            FieldOrder::Separate { .. } => {
                let second = i64::from(picture.metadata.order.is_second_field());
                Self { first: frame.wrapping_mul(2).wrapping_add(second), order: None }
            }
        }
    }

    fn at(&self, line: u32) -> i64 {
        let parity = if line.is_multiple_of(2) { Parity::Top } else { Parity::Bottom };
        self.first.wrapping_add(i64::from(self.order.is_some_and(|first| first != parity)))
    }
}

/// Codes of a plane of `columns` columns.
#[allow(clippy::cast_possible_truncation, reason = "picture positions are u32")]
fn codes(plane: &[f64], channel: u32, columns: u32, instants: &Instants, options: &YuvOptions) -> Vec<u16> {
    let scale = match options.depth {
        BitDepth::Eight => 1_u16,
        BitDepth::Ten => 4,
    };
    // Luma from black 16 to white 235; chroma 112 either way of 128. Codes beyond stay for filters' overshoot, but for
    // those that carry synchronisation.
    let (offset, range) = if channel == 0 { (16.0, 219.0) } else { (128.0, 224.0) };
    let (low, high) = (scale, 255 * scale - 1);
    let codes = plane.par_iter().enumerate().map(|(index, value)| {
        let (x, row) = (index as u32 % columns, index as u32 / columns);
        // A chroma line of an interlaced picture belongs to the field of its own parity, as its luma lines do.
        let place = Place { x, line: row, channel, instant: instants.at(row) };
        options.dither.code((offset + range * value) * f64::from(scale), low, high, place)
    });
    codes.collect()
}

/// One of `step` columns, sited on the first of them: a tent of half-width `step` about it.
fn decimate_columns(plane: &[f64], width: usize, step: usize) -> Vec<f64> {
    let mut out = Vec::with_capacity(plane.len() / step);
    for line in plane.chunks_exact(width) {
        for x in (0..width).step_by(step) {
            let mut sum = line[x] * step as f64;
            for k in 1..step {
                // Beyond the edge the edge is repeated.
                let (left, right) = (x.saturating_sub(k), (x + k).min(width - 1));
                sum += (line[left] + line[right]) * (step - k) as f64;
            }
            out.push(sum / (step * step) as f64);
        }
    }
    out
}

/// One of two lines: of progressive pictures midway between them; of interlaced ones within each field, where midway
/// between *frame* lines of a pair is a quarter from the nearer line of the field.
fn decimate_lines(plane: &[f64], width: usize, height: usize, order: FieldOrder) -> Vec<f64> {
    let line = |y: usize| &plane[y * width..(y + 1) * width];
    let mut out = Vec::with_capacity(plane.len() / 2);
    for row in 0..height / 2 {
        let (upper, lower, upper_share) = if matches!(order, FieldOrder::Interlaced { .. }) {
            let (pair, parity) = (row / 2, row % 2);
            let top = 4 * pair + parity;
            (top, top + 2, if parity == 0 { 0.75 } else { 0.25 })
        } else {
            (2 * row, 2 * row + 1, 0.5)
        };
        out.extend(line(upper).iter().zip(line(lower)).map(|(a, b)| a * upper_share + b * (1.0 - upper_share)));
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn matrices_invert(r in 0.0..1.0, g in 0.0..1.0, b in 0.0..1.0) {
            for matrix in [Matrix::Bt601, Matrix::Bt709] {
                let ycbcr = matrix.ycbcr([r, g, b]);
                prop_assert!((0.0..=1.0).contains(&ycbcr[0]) && ycbcr[1].abs() <= 0.5 + 1e-12 && ycbcr[2].abs() <= 0.5 + 1e-12);
                let back = matrix.rgb(ycbcr);
                for (x, y) in back.into_iter().zip([r, g, b]) {
                    prop_assert!((x - y).abs() < 1e-12);
                }
            }
        }
    }

    /// A ramp in y: chroma must come out at the positions that the standard gives its samples, frame lines 0.5 + 2 k.
    #[test]
    fn interlaced_chroma_lies_where_mpeg_2_says() {
        let plane: Vec<f64> = (0..16).map(f64::from).collect();
        for order in [FieldOrder::Progressive, FieldOrder::Interlaced { first: Parity::Top }] {
            let rows = decimate_lines(&plane, 1, 16, order);
            for (k, value) in rows.iter().enumerate() {
                assert!((value - (2.0 * k as f64 + 0.5)).abs() < 1e-12, "{order:?} {k} {value}");
            }
        }
    }

    /// Fields of different colour must not mix.
    #[test]
    fn interlaced_chroma_keeps_fields_apart() {
        let plane: Vec<f64> = (0..16).map(|y| f64::from(y % 2)).collect();
        let rows = decimate_lines(&plane, 1, 16, FieldOrder::Interlaced { first: Parity::Bottom });
        for (k, value) in rows.iter().enumerate() {
            assert!((value - (k % 2) as f64).abs() < 1e-12);
        }
    }

    #[test]
    fn cosited_columns_keep_ramps() {
        let line: Vec<f64> = (0..16).map(f64::from).collect();
        for step in [2, 4] {
            let out = decimate_columns(&line, 16, step);
            for (k, value) in out.iter().enumerate().skip(1) {
                assert!((value - (k * step) as f64).abs() < 1e-12, "{step} {k} {value}");
            }
        }
    }
}
