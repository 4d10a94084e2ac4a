//! `graeco render` into part files.

use super::progress::Reporter;
use super::render::RenderArgs;
use super::run_render::{Signals, peak_memory};
use graeco::output::manifest::{self, FrameStats};
use graeco::output::part::{Opened, OutputChoice, PartWriter};
use graeco::output::{Pattern, file};
use graeco::render::clock::cpu_seconds;
use graeco::render::{Shot, Slice, Tile};
use graeco::{Error, Result};
use std::time::Instant;

/// One run over a list of frames, of which it renders a part each.
pub(crate) struct PartWork<'a> {
    pub(crate) args: &'a RenderArgs,
    pub(crate) pattern: &'a Pattern,
    pub(crate) choice: &'a OutputChoice,
    /// Seconds to load the scene.
    pub(crate) load_s: f64,
    pub(crate) reporter: Reporter,
    pub(crate) signals: Signals,
}

impl PartWork<'_> {
    /// Renders the part of every frame. A part that another task is writing is left to it, and the run fails in the end.
    pub(crate) fn render_all(mut self, shot: &mut Shot<'_>, frames: &[i64]) -> Result<()> {
        let slice = Slice { tile: self.args.tile.unwrap_or(Tile::WHOLE), runs: self.args.run_range };
        let mut busy = None;
        let mut kept = 0;
        for (index, &number) in frames.iter().enumerate() {
            match self.render_one(shot, index, number, &slice) {
                Ok(true) => kept += 1,
                Ok(false) => return Err(self.signals.ended(kept)),
                Err(error @ Error::Busy { .. }) => {
                    if frames.len() > 1 {
                        self.reporter.say(&format!("{error}; going on with the next frame"));
                    }
                    busy = busy.or(Some(error));
                }
                Err(error) => return Err(error),
            }
            if self.signals.is_stopped() && index + 1 < frames.len() {
                return Err(self.signals.ended(kept));
            }
        }
        busy.map_or(Ok(()), Err)
    }

    /// Renders one part; `false` if a signal ended it.
    fn render_one(&mut self, shot: &mut Shot<'_>, index: usize, number: i64, slice: &Slice) -> Result<bool> {
        let (began, cpu) = (Instant::now(), cpu_seconds());
        let header = shot.part_header(number, slice, self.choice)?;
        let path = self.pattern.path(number);
        file::make_folder_of(&path)?;
        let writer = match PartWriter::open(&path, &header)? {
            Opened::Finished => {
                self.reporter.say(&format!("{}: finished before, kept", path.display()));
                self.reporter.skip(index, number);
                return Ok(true);
            }
            Opened::Unfinished(writer) => *writer,
        };
        if writer.is_begun_anew() {
            self.reporter.say(&format!("{}: what was begun with other settings is begun anew", path.display()));
        } else if writer.held() > 0 {
            let (held, all) = (writer.held(), header.records());
            self.reporter.say(&format!("{}: {held} of {all} blocks were done before", path.display()));
        }
        let pixels = shot.pixels_of_part(&header)?;
        let progress = self.signals.progress();
        let load_s = std::mem::take(&mut self.load_s);
        let render = || shot.render_part(writer, load_s, peak_memory, &progress);
        let Some((path, cost)) = self.reporter.watch(index, number, pixels, &progress, render)? else {
            return Ok(false);
        };
        let rate = super::progress::rate(cost.samples, began);
        self.reporter.say(&format!("{}: {:.1} s, {rate} samples/s", path.display(), began.elapsed().as_secs_f64()));
        if let Some(stats) = &self.args.stats {
            let line = FrameStats {
                frame: number,
                load_s,
                build_s: cost.build_s,
                render_s: cost.render_s,
                write_s: 0.0,
                cpu_s: cpu_seconds() - cpu,
                samples: cost.samples,
                rays: cost.rays,
                peak_memory: peak_memory(),
                rejected: cost.rejected,
                passes: None,
                standard_error: f64::INFINITY,
            };
            manifest::append_json(stats, &line)?;
        }
        Ok(true)
    }
}
