//! What one pixel integrates over: x extent × y extent × exposure.
//!
//! The footprint makes frames, fields and rolling shutters one thing. A progressive pixel is one line high; a pixel of
//! an interlaced field is two, centred on its line (Mitchell 1990, §6, figure 21); with a rolling shutter the exposure's
//! opening is linear in the line. Whatever stands after the footprint sees positions and times only.

use super::{Filter, ShutterCurve};
use crate::time::{Exposure, Parity};
use crate::trace::FilmPoint;
use crate::{Error, Result};
use glam::{DVec2, Vec2};

/// How the exposure of a line lies within the stage's interval.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub enum Scan {
    /// Every line is exposed together, over the whole interval.
    #[default]
    Global,
    /// Line l is exposed from `step · l` to `step · l + duration`, in units of the stage's interval.
    Rolling {
        /// Delay from a line to the next.
        step: f64,
        /// How long each line is exposed.
        duration: f64,
    },
}

/// The box that a pixel integrates over. The filter is stretched by its width and height.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Footprint {
    /// Horizontal extent, pixels.
    pub width: f64,
    /// Vertical extent, lines of the whole frame.
    pub height: f64,
    /// When each line is exposed.
    pub scan: Scan,
    /// How much each instant of a line's exposure counts.
    pub shutter: ShutterCurve,
}

impl Default for Footprint {
    fn default() -> Self {
        Self::PROGRESSIVE
    }
}

impl Footprint {
    /// One pixel by one line, all lines exposed together.
    pub const PROGRESSIVE: Self = Self { width: 1.0, height: 1.0, scan: Scan::Global, shutter: ShutterCurve::BOX };

    /// A pixel of an interlaced field: `line_height` lines of the frame high, centred on its line.
    ///
    /// 2 averages as survey figure 21 shows and does not flicker; 1 is sharper and does.
    ///
    /// # Errors
    /// If `line_height` is not from 1 to 2.
    pub fn field(line_height: f64) -> Result<Self> {
        if !(1.0..=2.0).contains(&line_height) {
            return Err(Error::invalid(
                format!("line height {line_height}"),
                "expected from 1 to 2 lines of the frame",
            ));
        }
        Ok(Self { height: line_height, ..Self::PROGRESSIVE })
    }

    /// The same footprint read out line by line, and the stage's interval that covers all lines.
    ///
    /// `exposure` is that of line 0; line l of `lines` opens `readout_s · l / lines` seconds later.
    ///
    /// # Errors
    /// If `readout_s` is negative or not finite, or there are no lines.
    pub fn rolling(self, exposure: Exposure, readout_s: f64, lines: u32) -> Result<(Self, Exposure)> {
        if !(readout_s >= 0.0 && readout_s.is_finite()) {
            return Err(Error::invalid(format!("readout of {readout_s} s"), "expected zero seconds or more"));
        }
        if lines == 0 {
            return Err(Error::invalid("rolling shutter", "the picture has no lines"));
        }
        let step_s = readout_s / f64::from(lines);
        let interval = Exposure { open: exposure.open, close: exposure.close + step_s * f64::from(lines - 1) };
        let length = interval.duration();
        if length <= 0.0 || step_s <= 0.0 {
            return Ok((Self { scan: Scan::Global, ..self }, interval));
        }
        let scan = Scan::Rolling { step: step_s / length, duration: exposure.duration() / length };
        Ok((Self { scan, ..self }, interval))
    }

    /// The same footprint behind a shutter that weights time by `shutter`.
    #[must_use]
    pub fn with_shutter(self, shutter: ShutterCurve) -> Self {
        Self { shutter, ..self }
    }

    /// The time, as u in [0, 1] of the stage's interval, at `u_shutter` in [0, 1) of the exposure of line `line`,
    /// which the shutter's curve warps: every sample counts one.
    #[must_use]
    #[inline]
    #[allow(clippy::cast_possible_truncation, reason = "u_time is f32 by contract")]
    pub fn u_time(&self, line: i32, u_shutter: f32) -> f32 {
        let u_exposure = self.shutter.time_from_unit(u_shutter);
        match self.scan {
            Scan::Global => u_exposure,
            Scan::Rolling { step, duration } => {
                let u = step * f64::from(line) + duration * f64::from(u_exposure);
                (u as f32).clamp(0.0, 1.0)
            }
        }
    }

    /// Where a run of pixel (`x`, `line`) looks, and its filter weight.
    ///
    /// `u_film` in [0, 1)² is warped by the filter, whose unit is stretched to the footprint about the pixel's centre.
    #[must_use]
    #[inline]
    pub fn sample(&self, filter: &Filter, x: i32, line: i32, u_film: Vec2, u_shutter: f32) -> (FilmPoint, f32) {
        let (offset, filter_weight) = filter.sample(u_film);
        let centre = DVec2::new(f64::from(x) + 0.5, f64::from(line) + 0.5);
        let position = centre + offset * DVec2::new(self.width, self.height);
        (FilmPoint { position, u_time: self.u_time(line, u_shutter) }, filter_weight)
    }
}

/// Which lines of the frame a picture holds.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub enum Lines {
    /// All of them.
    #[default]
    All,
    /// Those of one field.
    Field(Parity),
}

impl Lines {
    /// The line of the frame that row `row` of the picture is.
    #[must_use]
    pub const fn line(self, row: i32) -> i32 {
        match self {
            Self::All => row,
            Self::Field(Parity::Top) => 2 * row,
            Self::Field(Parity::Bottom) => 2 * row + 1,
        }
    }

    /// Whether line `line` of the frame is among them.
    #[must_use]
    pub const fn holds(self, line: u32) -> bool {
        match self {
            Self::All => true,
            Self::Field(Parity::Top) => line.is_multiple_of(2),
            Self::Field(Parity::Bottom) => !line.is_multiple_of(2),
        }
    }

    /// Rows of the picture where the frame has `lines` lines.
    #[must_use]
    pub const fn rows(self, lines: u32) -> u32 {
        match self {
            Self::All => lines,
            Self::Field(Parity::Top) => lines.div_ceil(2),
            Self::Field(Parity::Bottom) => lines / 2,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::film::FilterSpec;

    #[test]
    fn a_global_shutter_passes_time_through() {
        for u in [0.0_f32, 0.1, 0.999_999_9] {
            assert_eq!(Footprint::PROGRESSIVE.u_time(479, u).to_bits(), u.to_bits());
        }
    }

    #[test]
    fn a_rolling_shutter_opens_linearly_in_the_line() {
        let exposure = Exposure { open: 2.0, close: 2.01 };
        let (footprint, interval) = Footprint::PROGRESSIVE.rolling(exposure, 0.02, 100).unwrap();
        assert!((interval.close - (2.01 + 0.02 * 0.99)).abs() < 1e-15);
        for line in [0, 1, 50, 99] {
            for u in [0.0_f32, 0.5] {
                let time = interval.at(f64::from(footprint.u_time(line, u)));
                let want = 2.0 + 0.02 * f64::from(line) / 100.0 + 0.01 * f64::from(u);
                // u_time is f32: half an ulp of 1 over an interval of 0.03 s.
                assert!((time - want).abs() < 0.03 * 1.2e-7, "{line} {u}: {time} {want}");
            }
        }
    }

    #[test]
    fn a_field_pixel_covers_two_lines_about_its_own() {
        let filter = Filter::new(FilterSpec::BOX);
        let footprint = Footprint::field(2.0).unwrap();
        let (low, _) = footprint.sample(&filter, 3, 10, Vec2::ZERO, 0.0);
        let (middle, weight) = footprint.sample(&filter, 3, 10, Vec2::splat(0.5), 0.0);
        assert_eq!(low.position, DVec2::new(3.0, 9.5));
        assert_eq!(middle.position, DVec2::new(3.5, 10.5));
        assert_eq!(weight.to_bits(), 1.0_f32.to_bits());
        assert!(Footprint::field(2.5).is_err() && Footprint::field(f64::NAN).is_err());
    }

    #[test]
    fn the_fields_of_a_frame_partition_its_lines() {
        for lines in [480, 481] {
            let mut seen = vec![0; lines as usize];
            for parity in [Parity::Top, Parity::Bottom] {
                let field = Lines::Field(parity);
                for row in 0..field.rows(lines) {
                    seen[usize::try_from(field.line(i32::try_from(row).unwrap())).unwrap()] += 1;
                }
            }
            assert!(seen.iter().all(|&n| n == 1));
        }
    }
}
