//! Parts of frames: which blocks and which runs of the design, rendered into part files.

use super::adaptive::{self, Settler};
use super::integrate::{pixels_of, sum_tile};
use super::shot::{Exposed, FrameCost, Shot};
use super::{Progress, aovs};
use crate::film::{Blocks, Layout, PixelAccumulator, Window, pack_estimates};
use crate::output::part::{Header, OutputChoice, PartCost, PartWriter, Totals};
use crate::trace::aov::Observer;
use crate::trace::path::PathTracer;
use crate::{Error, Result};
use rayon::prelude::*;
use std::fmt;
use std::ops::Range;
use std::path::PathBuf;
use std::str::FromStr;
use std::sync::{Mutex, PoisonError};
use std::time::Instant;

/// One of several sets of whole blocks that a frame is split into: `2/4`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Tile {
    index: u32,
    count: u32,
}

impl Tile {
    /// The whole frame.
    pub const WHOLE: Self = Self { index: 1, count: 1 };
}

impl fmt::Display for Tile {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}/{}", self.index, self.count)
    }
}

impl FromStr for Tile {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self> {
        let parts = text.split_once('/').and_then(|(i, n)| Some((i.trim().parse().ok()?, n.trim().parse().ok()?)));
        match parts {
            Some((index, count)) if (1..=count).contains(&index) => Ok(Self { index, count }),
            _ => Err(Error::invalid(format!("tile \"{text}\""), "expected i/n with i from 1 to n, such as 2/4")),
        }
    }
}

/// Some runs of a design: `64-127`, both included, from 0.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct RunRange {
    first: u32,
    last: u32,
}

impl FromStr for RunRange {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self> {
        let number = |t: &str| t.trim().parse::<u32>().ok();
        let parts = match text.split_once('-') {
            Some((first, last)) => number(first).zip(number(last)),
            None => number(text).map(|run| (run, run)),
        };
        match parts {
            Some((first, last)) if first <= last => Ok(Self { first, last }),
            _ => Err(Error::invalid(
                format!("run range \"{text}\""),
                "expected the first and the last run, counted from 0, such as 0-63",
            )),
        }
    }
}

/// Which part of every frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Slice {
    /// Which blocks.
    pub tile: Tile,
    /// Which runs; none: all.
    pub runs: Option<RunRange>,
}

impl Slice {
    fn runs(&self, total: u32) -> Result<Range<u32>> {
        match self.runs {
            None => Ok(0..total),
            Some(RunRange { first, last }) if last < total => Ok(first..last + 1),
            Some(RunRange { first, last }) => Err(Error::invalid(
                format!("--run-range {first}-{last}"),
                format!("the design of {total} runs has those from 0 to {}", total - 1),
            )),
        }
    }
}

impl Shot<'_> {
    /// What the part `slice` of frame `frame` says of itself.
    ///
    /// # Errors
    /// If the slice is not one of this shot's design, the scanning's values are out of range, or what stops sampling is
    /// known of the whole picture only.
    pub fn part_header(&self, frame: i64, slice: &Slice, output: &OutputChoice) -> Result<Header> {
        let passes = self.passes(frame)?;
        let settings = self.settings();
        if let Some(adaptive) = &settings.adaptive {
            adaptive.check_parts()?;
            if let Some(RunRange { first, last }) = slice.runs {
                return Err(Error::invalid(
                    format!("--run-range {first}-{last}"),
                    "pixels that stop by themselves have no runs to be shared out; expected --tile",
                ));
            }
        }
        let total_runs = settings.sampling.runs;
        let runs = slice.runs(total_runs)?;
        let window = self.window();
        let blocks = Blocks::new(window).share(slice.tile.index - 1, slice.tile.count);
        Ok(Header {
            record: self.record().as_ref().clone(),
            output: output.clone(),
            frame,
            exposure: passes[0].interval,
            size: settings.size,
            window,
            blocks: (blocks.start, blocks.end),
            tile: (slice.tile.index, slice.tile.count),
            runs: (runs.start, runs.end),
            total_runs,
            passes: if passes.len() == 2 { 2 } else { 1 },
        })
    }

    /// Pixels that the part renders, over all its exposures.
    ///
    /// # Errors
    /// If the scanning's values are out of range.
    pub fn pixels_of_part(&self, header: &Header) -> Result<u64> {
        let blocks = Blocks::new(header.window);
        let passes = self.passes(header.frame)?;
        let of_pass =
            |lines| (header.blocks.0..header.blocks.1).map(|b| pixels_of(blocks.window(b), lines)).sum::<u64>();
        Ok(passes.iter().map(|pass| of_pass(pass.lines)).sum())
    }

    /// Renders what `writer` lacks of its part; the finished file with what this took, or nothing if `progress` was
    /// cancelled: what is finished then stays in the journal.
    ///
    /// # Errors
    /// [`Error::Io`] if the part cannot be written; what was written before stays.
    pub fn render_part(
        &mut self,
        writer: PartWriter,
        load_s: f64,
        peak_memory: impl FnOnce() -> u64,
        progress: &Progress,
    ) -> Result<Option<(PathBuf, FrameCost)>> {
        let (samples, rays) = (progress.samples(), progress.rays());
        let header = writer.header().clone();
        let passes = self.passes(header.frame)?;
        let mut cost = FrameCost::default();
        let journal = Mutex::new(writer);
        for (number, pass) in (0..).zip(&passes) {
            let held = |block: &u32| journal.lock().unwrap_or_else(PoisonError::into_inner).holds(*block, number);
            let (there, left): (Vec<u32>, Vec<u32>) = (header.blocks.0..header.blocks.1).partition(held);
            let blocks = Blocks::new(header.window);
            progress.advance(there.into_iter().map(|b| pixels_of(blocks.window(b), pass.lines)).sum(), 0);
            if left.is_empty() {
                continue;
            }
            let part = PassOfPart { header: &header, number, journal: &journal, progress };
            let (aovs, adaptive) = (self.settings().aovs.clone(), self.settings().adaptive);
            let sampling = self.settings().sampling;
            let complete = self.expose(pass, &mut cost, |exposed| {
                let drawn = (&sampling, exposed.design.factors());
                let settler = adaptive.map(|adaptive| Settler::new(exposed.tracer, drawn, &adaptive, &exposed.job));
                if aovs.iter().any(|aov| aov.is_observed()) {
                    exposed.observe(|observer| part.render(exposed, &left, settler.as_ref(), Some((observer, &aovs))))
                } else {
                    part.render(exposed, &left, settler.as_ref(), None)
                }
            })?;
            if !complete {
                return Ok(None);
            }
        }
        cost.samples = progress.samples() - samples;
        cost.rays = progress.rays() - rays;
        let writer = journal.into_inner().unwrap_or_else(PoisonError::into_inner);
        let totals = Totals { load_s, build_s: cost.build_s, peak_memory: peak_memory(), ..Totals::default() };
        Ok(Some((writer.finish(totals)?, cost)))
    }
}

/// What the blocks of one exposure of a part share.
struct PassOfPart<'p> {
    header: &'p Header,
    number: u32,
    journal: &'p Mutex<PartWriter>,
    progress: &'p Progress,
}

/// Samples pixels that stop by themselves.
type Settling<'f, 'a> = Settler<'f, PathTracer<'a>>;

impl PassOfPart<'_> {
    /// Renders `left` in parallel; `false` if cancelled. The first error ends the others' work.
    fn render(
        &self,
        exposed: &Exposed<'_, '_>,
        left: &[u32],
        settler: Option<&Settling<'_, '_>>,
        observer: Option<(&Observer<'_>, &[aovs::Aov])>,
    ) -> Result<bool> {
        let layout = Layout::new(self.header.runs.0..self.header.runs.1, self.header.total_runs);
        // Whole blocks decide, whatever of them the window shows.
        let picture = Window::whole(self.header.size.0, self.header.size.1);
        let settler = settler.map(|settler| (settler, adaptive::grid(self.header.window, picture)));
        left.par_iter().try_for_each(|&block| {
            if self.progress.is_cancelled() {
                return Ok(());
            }
            let (started, mut payload) = (Instant::now(), Vec::new());
            let samples = match &settler {
                None => Some(self.sum_block(exposed, block, &layout, &mut payload)),
                Some((settler, whole)) => self.settle_block(settler, block, whole[block as usize], &mut payload),
            };
            // None: cancelled.
            let Some(samples) = samples else { return Ok(()) };
            if let Some((observer, wanted)) = observer {
                let (window, runs) = (self.window(block), self.header.runs.0..self.header.runs.1);
                let observed = aovs::observe_tile(observer, exposed.design, &exposed.job, window, &runs);
                aovs::pack(&observed, wanted, &mut payload);
            }
            let shown = pixels_of(self.window(block), exposed.job.lines);
            self.keep(block, started, (shown, samples), &payload)
        })?;
        Ok(!self.progress.is_cancelled())
    }

    fn window(&self, block: u32) -> Window {
        Blocks::new(self.header.window).window(block)
    }

    /// Appends the sums of a block's pixels to `payload`; samples taken.
    fn sum_block(&self, exposed: &Exposed<'_, '_>, block: u32, layout: &Layout, payload: &mut Vec<u8>) -> u64 {
        let (window, runs) = (self.window(block), self.header.runs.0..self.header.runs.1);
        let mut sums: Vec<PixelAccumulator> = Vec::with_capacity(window.area());
        let samples =
            sum_tile(exposed.tracer, exposed.design, &exposed.job, window, runs, |sum| sums.push(sum.clone()));
        layout.pack(&sums, payload);
        samples
    }

    /// Appends what the pixels of a block came to that stand in the picture's block `whole`; samples taken, `None` if
    /// cancelled.
    fn settle_block(
        &self,
        settler: &Settling<'_, '_>,
        block: u32,
        whole: Window,
        payload: &mut Vec<u8>,
    ) -> Option<u64> {
        let settled = settler.settle(whole, self.progress)?;
        pack_estimates(&settled.estimates(self.window(block)), payload);
        Some(settled.samples())
    }

    /// Writes a block's record, which took `samples` for `pixels`.
    fn keep(&self, block: u32, started: Instant, (pixels, samples): (u64, u64), payload: &[u8]) -> Result<()> {
        let nanoseconds = u64::try_from(started.elapsed().as_nanos()).unwrap_or(u64::MAX);
        let rays = self.progress.advance(pixels, samples);
        let cost = PartCost { samples, rays, nanoseconds };
        self.journal.lock().unwrap_or_else(PoisonError::into_inner).append(block, self.number, cost, payload)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tiles_and_runs_are_read_and_nonsense_refused() {
        assert_eq!("2/4".parse::<Tile>().unwrap(), Tile { index: 2, count: 4 });
        assert_eq!("0-63".parse::<RunRange>().unwrap(), RunRange { first: 0, last: 63 });
        assert_eq!("5".parse::<RunRange>().unwrap(), RunRange { first: 5, last: 5 });
        for bad in ["0/4", "5/4", "1", "1/0", "a/b", "-1/4"] {
            assert!(bad.parse::<Tile>().is_err(), "{bad}");
        }
        for bad in ["", "7-3", "-3", "1-2-3", "a"] {
            assert!(bad.parse::<RunRange>().is_err(), "{bad}");
        }
    }
}
