//! The spectrum of interlaced video in (time, height): survey §6, figures 19 and 20.
//!
//! A grating moves up or down; its fields are integrated over their footprints as any scene's are. On the lattice of
//! lines and fields, with the lines that a field does not hold as zeros, the spectrum shows the grating's own frequency
//! and the sideband that interlacing puts (30 Hz, 0.5 cycles a line) away from it, for 60 fields a second.

use crate::design::{Design, DesignOptions, Factor, Point};
use crate::film::{Film, Filter, FilterSpec, Footprint, Lines};
use crate::render::Progress;
use crate::render::integrate::{Pass, integrate};
use crate::time::Parity;
use crate::trace::{FilmPoint, ImageFunction};
use crate::{Error, Result};
use glam::Vec3;
use rustfft::FftPlanner;
use rustfft::num_complex::Complex;

/// Lines and fields of the lattice.
pub const SIDE: usize = 64;

/// A grating and how it is filmed.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Grating {
    /// Cycles a line, 0 to 0.5.
    pub cycles: f64,
    /// Upwards motion, lines a field.
    pub speed: f64,
    /// Lines of the frame that a pixel averages over, 1 to 2.
    pub line_height: f64,
    /// Exposure as a part of the field's period.
    pub shutter: f64,
}

struct Moving {
    grating: Grating,
    field: f64,
}

impl ImageFunction for Moving {
    #[allow(clippy::cast_possible_truncation, reason = "radiance")]
    fn radiance(&self, film: FilmPoint, _point: &Point<'_>) -> Vec3 {
        let fields = self.field + self.grating.shutter * f64::from(film.u_time);
        let phase = self.grating.cycles * (film.position.y + self.grating.speed * fields);
        Vec3::splat((0.5 + 0.5 * libm::sin(std::f64::consts::TAU * phase)) as f32)
    }
}

/// Power by (temporal, vertical) frequency: `SIDE × SIDE`, rows of vertical frequency from −0.5 to 0.5 cycles a line
/// exclusive, columns of temporal frequency from −half to half the field rate; the constant part removed.
///
/// # Errors
/// If the line height is not from 1 to 2.
pub fn spectrum(grating: Grating, runs: u32, seed: u64) -> Result<Vec<f64>> {
    if !((0.0..=0.5).contains(&grating.cycles) && grating.shutter >= 0.0 && grating.speed.is_finite()) {
        return Err(Error::invalid(
            "grating",
            "expected 0 to 0.5 cycles a line, a finite speed and a shutter of 0 or more",
        ));
    }
    let mut lattice = vec![Complex::new(0.0, 0.0); SIDE * SIDE];
    let filter = Filter::new(FilterSpec::BOX);
    let footprint = Footprint::field(grating.line_height)?;
    let factors = [Factor::FILM_X, Factor::FILM_Y, Factor::SHUTTER];
    let design = Design::new(&DesignOptions { runs, seed, ..DesignOptions::default() }, &factors);
    for field in 0..SIDE {
        let parity = if field % 2 == 0 { Parity::Top } else { Parity::Bottom };
        #[allow(clippy::cast_precision_loss, clippy::cast_possible_wrap, reason = "a small index")]
        let (function, number) = (Moving { grating, field: field as f64 }, field as i64);
        #[allow(clippy::cast_possible_truncation, reason = "a constant")]
        let mut film = Film::new(1, SIDE as u32, None)?;
        let pass = Pass { footprint, filter: &filter, lines: Lines::Field(parity), number };
        integrate(&function, &design, &pass, &mut film, &Progress::default());
        for (line, pixel) in film.pixels().iter().enumerate().skip(field % 2).step_by(2) {
            lattice[line * SIDE + field] = Complex::new(f64::from(pixel.radiance.x) - 0.5, 0.0);
        }
    }
    Ok(power(lattice))
}

/// Power of the two-dimensional transform, zero frequency in the middle.
fn power(mut lattice: Vec<Complex<f64>>) -> Vec<f64> {
    let fft = FftPlanner::new().plan_fft_forward(SIDE);
    let transpose =
        |m: &[Complex<f64>]| -> Vec<Complex<f64>> { (0..SIDE * SIDE).map(|i| m[i % SIDE * SIDE + i / SIDE]).collect() };
    for _ in 0..2 {
        lattice.chunks_mut(SIDE).for_each(|row| fft.process(row));
        lattice = transpose(&lattice);
    }
    let shifted = |i: usize| (i + SIDE / 2) % SIDE;
    (0..SIDE * SIDE)
        .map(|i| lattice[shifted(i / SIDE) * SIDE + shifted(i % SIDE)].norm_sqr() / (SIDE * SIDE) as f64)
        .collect()
}

/// Power at a temporal frequency (parts of the field rate, −0.5 to 0.5) and a vertical one (cycles a line), with the
/// neighbouring cells, into which a frequency between two leaks.
#[must_use]
#[allow(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    clippy::cast_precision_loss,
    reason = "wrapped into range"
)]
pub fn power_at(spectrum: &[f64], temporal: f64, vertical: f64) -> f64 {
    let cell = |f: f64| ((f + 0.5).rem_euclid(1.0) * SIDE as f64).round() as usize % SIDE;
    let near = |c: usize| [c + SIDE - 1, c, c + 1].map(|i| i % SIDE);
    let (column, row) = (cell(temporal), cell(vertical));
    near(row).into_iter().flat_map(|r| near(column).map(move |c| spectrum[r * SIDE + c])).sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn interlacing_repeats_the_spectrum_half_the_field_rate_and_half_a_cycle_away() {
        let grating = Grating { cycles: 0.125, speed: 1.0, line_height: 1.0, shutter: 0.0 };
        let power = spectrum(grating, 16, 1).unwrap();
        // sin(2π·0.125 (y + t)): frequency (0.125, 0.125) and its negative; the sideband at (0.625, 0.625) = (−0.375,
        // −0.375).
        let (base, sideband) = (power_at(&power, 0.125, 0.125), power_at(&power, -0.375, -0.375));
        assert!(base > 1.0 && (sideband / base - 1.0).abs() < 0.01, "{base} {sideband}");
        let all: f64 = power.iter().sum();
        assert!(2.0 * (base + sideband) > 0.99 * all);
    }

    #[test]
    fn two_lines_take_away_what_would_flicker() {
        let still = |line_height: f64| Grating { cycles: 0.5, speed: 0.0, line_height, shutter: 0.5 };
        // (0 Hz, 0.5 cycles) lands on (30 Hz, 0): the whole picture flickers.
        let flicker = |h: f64| power_at(&spectrum(still(h), 64, 1).unwrap(), 0.5, 0.0);
        let (one, two) = (flicker(1.0), flicker(2.0));
        assert!(one > 100.0 && two < 1e-3 * one, "{one} {two}");
    }
}
