//! Points of a design written out, so that anyone can test them against an integrand of their own.
//!
//! Columns are `pixel_x, pixel_y, frame, run`, then the factors in their fixed order. CSV prints coordinates with nine
//! digits, which give an `f32` back exactly; NPY is a C-ordered table of little-endian `f64`, without the names.

use super::{Design, Factor, PixelAddress};
use std::io::{self, Write};

/// Which points.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Extent {
    /// Columns and rows of pixels.
    pub pixels: [u32; 2],
    /// The first pixel.
    pub origin: [i32; 2],
    /// Frames from 0.
    pub frames: u32,
}

/// How points are written.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Format {
    /// Comma-separated values with a header.
    Csv,
    /// NumPy's array file, version 1.0.
    Npy,
}

/// A factor's name in the header.
#[must_use]
pub fn factor_name(factor: Factor) -> String {
    match factor.index() {
        0 => "film_x".into(),
        1 => "film_y".into(),
        2 => "shutter".into(),
        3 => "lens_u".into(),
        4 => "lens_v".into(),
        _ if factor.is_extra() => format!("extra_{}", factor.index() & 0x7fff),
        index => {
            let (vertex, place) = ((index - 5) / Factor::PER_VERTEX, (index - 5) % Factor::PER_VERTEX);
            let name = ["light_u", "light_v", "lobe_u", "lobe_v"][usize::from(place)];
            if vertex == 0 { name.into() } else { format!("{name}_{vertex}") }
        }
    }
}

/// The first `count` factors in the fixed order, extras left out.
#[must_use]
pub fn first_factors(count: u16) -> Vec<Factor> {
    let camera = [Factor::FILM_X, Factor::FILM_Y, Factor::SHUTTER, Factor::LENS_U, Factor::LENS_V];
    let vertices = (0..count.div_ceil(Factor::PER_VERTEX)).flat_map(|vertex| {
        [Factor::light_u(vertex), Factor::light_v(vertex), Factor::lobe_u(vertex), Factor::lobe_v(vertex)]
    });
    camera.into_iter().chain(vertices).take(count.into()).collect()
}

/// Writes every point of `design` in `extent` to `out`, frame by frame, row by row, run by run.
///
/// # Errors
/// What `out` answers.
pub fn write(design: &Design, extent: Extent, format: Format, out: &mut impl Write) -> io::Result<()> {
    let factors = design.factors();
    match format {
        Format::Csv => {
            let names: Vec<String> = factors.iter().map(|f| factor_name(*f)).collect();
            writeln!(out, "pixel_x,pixel_y,frame,run,{}", names.join(","))?;
        }
        Format::Npy => {
            let rows = u64::from(extent.pixels[0])
                * u64::from(extent.pixels[1])
                * u64::from(extent.frames)
                * u64::from(design.runs());
            out.write_all(&npy_header(rows, 4 + factors.len()))?;
        }
    }
    for frame in 0..i64::from(extent.frames) {
        for row in 0..extent.pixels[1] {
            for column in 0..extent.pixels[0] {
                let [x, y] =
                    [(0, column), (1, row)].map(|(axis, offset)| extent.origin[axis].wrapping_add_unsigned(offset));
                let pixel = design.pixel(PixelAddress { x, y, frame, field: 0 });
                for run in 0..design.runs() {
                    let point = pixel.point(run);
                    let mut coordinates = factors.iter().map(|f| point.get(*f));
                    match format {
                        Format::Csv => {
                            write!(out, "{x},{y},{frame},{run}")?;
                            coordinates.try_for_each(|c| write!(out, ",{c:.9}"))?;
                            writeln!(out)?;
                        }
                        Format::Npy => {
                            #[allow(clippy::cast_precision_loss, reason = "frames are at most 2³²")]
                            let address = [f64::from(x), f64::from(y), frame as f64, f64::from(run)];
                            for value in address.into_iter().chain(coordinates.map(f64::from)) {
                                out.write_all(&value.to_le_bytes())?;
                            }
                        }
                    }
                }
            }
        }
    }
    Ok(())
}

/// Magic, version, length and dictionary of a NumPy file, padded to 64 bytes (NumPy enhancement proposal 1).
fn npy_header(rows: u64, columns: usize) -> Vec<u8> {
    let mut text = format!("{{'descr': '<f8', 'fortran_order': False, 'shape': ({rows}, {columns}), }}");
    while !(10 + text.len() + 1).is_multiple_of(64) {
        text.push(' ');
    }
    text.push('\n');
    let length = u16::try_from(text.len()).unwrap_or(u16::MAX);
    [b"\x93NUMPY\x01\x00".as_slice(), &length.to_le_bytes(), text.as_bytes()].concat()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::design::{DesignOptions, Dither, Kind};

    #[test]
    fn csv_has_the_stated_header_and_a_row_a_run() {
        let options = DesignOptions { kind: Kind::Nested, dither: Dither::NONE, runs: 4, ..Default::default() };
        let design = Design::new(&options, &first_factors(9));
        let mut out = Vec::new();
        write(&design, Extent { pixels: [2, 3], origin: [-1, 0], frames: 2 }, Format::Csv, &mut out).unwrap();
        let text = String::from_utf8(out).unwrap();
        let mut lines = text.lines();
        assert_eq!(
            lines.next(),
            Some("pixel_x,pixel_y,frame,run,film_x,film_y,shutter,lens_u,lens_v,light_u,light_v,lobe_u,lobe_v")
        );
        assert_eq!(lines.clone().count(), 2 * 3 * 2 * 4);
        let row: Vec<&str> = lines.nth(5).unwrap().split(',').collect();
        assert_eq!(row[..4], ["0", "0", "0", "1"]);
        let pixel = design.pixel(PixelAddress { x: 0, y: 0, frame: 0, field: 0 });
        assert_eq!(row[6].parse::<f32>().unwrap().to_bits(), pixel.point(1).get(Factor::SHUTTER).to_bits());
    }

    #[test]
    fn npy_is_as_long_as_its_header_says() {
        let design = Design::new(&DesignOptions { runs: 4, ..Default::default() }, &first_factors(7));
        let mut out = Vec::new();
        write(&design, Extent { pixels: [2, 2], origin: [0, 0], frames: 1 }, Format::Npy, &mut out).unwrap();
        assert_eq!(&out[..6], b"\x93NUMPY");
        let header = 10 + usize::from(u16::from_le_bytes([out[8], out[9]]));
        assert_eq!((header % 64, out.len() - header), (0, 16 * 11 * 8));
    }

    #[test]
    fn factors_are_named_in_their_fixed_order() {
        let names: Vec<String> = first_factors(11).iter().map(|f| factor_name(*f)).collect();
        assert_eq!(names[7..], ["lobe_u", "lobe_v", "light_u_1", "light_v_1"]);
    }
}
