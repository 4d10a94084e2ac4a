//! Parts of frames back to frames: bit for bit what one machine makes, in whatever order they come.
//!
//! Every pixel's sums join along the design's binary structure ([`crate::film::AlignedSums`]), so the division does not
//! show. A frame is merged by strips of at most one row of blocks: memory holds the finished picture and the sums of one
//! strip, however many parts there are.

use super::adaptive::{Adaptive, Goal};
use super::aovs::{self, ObservedSums};
use super::coverage::{Extent, Section, cover, describe};
use super::settings::Settings;
use super::shot::{Frame, FrameCost};
use super::{Progress, frames::FrameList};
use crate::film::blocks::pixels;
use crate::film::{Blocks, Film, Layout, Lines, Unpacked};
use crate::output::part::{Header, PartFile, Totals};
use crate::time::Exposure;
use crate::{Error, Result};
use rayon::prelude::*;
use std::collections::BTreeMap;
use std::ops::Range;
use std::path::{Path, PathBuf};

/// What to do about what is missing or damaged.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Missing {
    /// Refuse.
    Refused,
    /// Leave it out, and say so.
    LeftOut,
}

/// A part as far as merging needs to know it before it is read.
#[derive(Debug)]
struct Entry {
    path: PathBuf,
    extent: Extent,
    exposure: Exposure,
    totals: Totals,
    bytes: u64,
}

/// Parts of one shot, by frame.
#[derive(Debug)]
pub struct Collection {
    lead: Header,
    settings: Settings,
    missing: Missing,
    frames: BTreeMap<i64, Vec<Entry>>,
    notes: Vec<String>,
}

/// A merged frame.
#[derive(Debug)]
pub struct Merged {
    /// The frame.
    pub frame: Frame,
    /// What was left out, in sentences; none if it is whole.
    pub notes: Vec<String>,
    /// Bytes of records that were read.
    pub bytes: u64,
}

impl Collection {
    /// Looks into all of `paths`; a file that is named twice counts once.
    ///
    /// # Errors
    /// If a part cannot be read (unless it may be left out), or was made by another program, from another scene, or with
    /// other settings than the others.
    pub fn gather(mut paths: Vec<PathBuf>, missing: Missing) -> Result<Self> {
        paths.sort();
        let mut seen = std::collections::HashSet::new();
        paths.retain(|path| seen.insert(path.canonicalize().unwrap_or_else(|_| path.clone())));
        let mut notes = Vec::new();
        let mut paths = paths.into_iter();
        let lead = loop {
            let path = paths.next().ok_or_else(|| Error::Merge { problem: no_parts(&notes) })?;
            match PartFile::open(&path) {
                Ok(part) => break (path, part),
                Err(error) if missing == Missing::LeftOut => notes.push(format!("{error}; it is left out")),
                Err(error) => return Err(error),
            }
        };
        let (lead_path, lead) = (lead.0, lead.1.header().clone());
        let settings = check_lead(&lead_path, &lead)?;
        let mut collection = Self { lead, settings, missing, frames: BTreeMap::new(), notes };
        let rest: Vec<PathBuf> = std::iter::once(lead_path.clone()).chain(paths).collect();
        // Headers are compared and dropped by the hundred: of a part only its extent stays.
        for some in rest.chunks(256) {
            let entries: Vec<Result<(i64, Entry)>> =
                some.par_iter().map(|path| collection.look_into(path, &lead_path)).collect();
            for entry in entries {
                match entry {
                    Ok((frame, entry)) => collection.frames.entry(frame).or_default().push(entry),
                    Err(error @ Error::Merge { .. }) => return Err(error),
                    Err(error) if missing == Missing::LeftOut => {
                        collection.notes.push(format!("{error}; it is left out"));
                    }
                    Err(error) => return Err(error),
                }
            }
        }
        Ok(collection)
    }

    fn look_into(&self, path: &Path, lead_path: &Path) -> Result<(i64, Entry)> {
        let part = PartFile::open(path)?;
        let header = part.header();
        if let Some(difference) = difference(&self.lead, header) {
            let problem =
                format!("{} and {} do not belong together: {difference}", lead_path.display(), path.display());
            return Err(Error::Merge { problem });
        }
        let extent = Extent {
            blocks: header.blocks.0..header.blocks.1,
            runs: header.runs.0..header.runs.1,
            tiles: header.tile.1,
        };
        let grid = Blocks::new(header.window).count();
        if extent.blocks.end > grid || extent.runs.end > header.total_runs || extent.runs.is_empty() {
            let problem = "claims blocks or runs that its frame does not have".to_owned();
            return Err(Error::Picture { path: path.to_path_buf(), problem });
        }
        let entry = Entry {
            path: path.to_path_buf(),
            extent,
            exposure: header.exposure,
            totals: *part.totals(),
            bytes: part.record_bytes(),
        };
        Ok((header.frame, entry))
    }

    /// What the parts say about their making and their output.
    #[must_use]
    pub fn header(&self) -> &Header {
        &self.lead
    }

    /// Settings of the frames.
    #[must_use]
    pub fn settings(&self) -> &Settings {
        &self.settings
    }

    /// Frames of which there are parts, ascending.
    pub fn frames(&self) -> impl Iterator<Item = i64> {
        self.frames.keys().copied()
    }

    /// What was left out while gathering, in sentences.
    #[must_use]
    pub fn notes(&self) -> &[String] {
        &self.notes
    }

    /// Pixels of a frame.
    #[must_use]
    pub fn pixels(&self) -> u64 {
        self.lead.window.area() as u64
    }

    /// Checks that every frame of `wanted` (those there are, if none are named) is complete, before any is merged, and
    /// gives them in ascending order.
    ///
    /// # Errors
    /// If frames or parts of them are missing and may not be left out, or parts overlap.
    pub fn check(&self, wanted: Option<&FrameList>) -> Result<Vec<i64>> {
        let mut frames: Vec<i64> = wanted.map_or_else(|| self.frames().collect(), |list| list.frames().to_vec());
        frames.sort_unstable();
        let mut problems = Vec::new();
        for &frame in &frames {
            match self.frames.get(&frame) {
                None => problems.push(format!("frame {frame} has no parts")),
                Some(entries) => {
                    let (_, gaps) = self.sections(frame, entries)?;
                    if !gaps.is_empty() {
                        problems.push(format!("frame {frame} lacks {gaps}"));
                    }
                }
            }
        }
        if self.missing == Missing::Refused && !problems.is_empty() {
            const MOST: usize = 8;
            let more = problems.len().saturating_sub(MOST);
            problems.truncate(MOST);
            let more = if more > 0 { format!("; and {more} more frames lack something") } else { String::new() };
            return Err(Error::Merge { problem: format!("{}{more}", problems.join("; ")) });
        }
        frames.retain(|frame| self.frames.contains_key(frame));
        Ok(frames)
    }

    /// How the parts of a frame cover it, and what they lack in words.
    fn sections(&self, frame: i64, entries: &[Entry]) -> Result<(Vec<Section>, String)> {
        let extents: Vec<&Extent> = entries.iter().map(|entry| &entry.extent).collect();
        let blocks = Blocks::new(self.lead.window);
        let shared = self.settings.adaptive.is_none();
        let (sections, gaps) = cover(&extents, blocks.count(), self.lead.total_runs).map_err(|clash| {
            let [a, b] = clash.parts.map(|i| entries[i].path.display().to_string());
            let (first, last) = (clash.runs.start, clash.runs.end - 1);
            let runs = if shared { format!("runs {first}-{last} of ") } else { String::new() };
            Error::Merge { problem: format!("{a} and {b} both hold {runs}the same pixels of frame {frame}") }
        })?;
        Ok((sections, describe(&gaps, &extents, blocks, shared)))
    }

    /// Merges the parts of frame `frame`; nothing if `progress` was cancelled.
    ///
    /// # Errors
    /// If there are none, they overlap, or one cannot be read or is damaged (unless that may be left out).
    pub fn merge(&self, frame: i64, progress: &Progress) -> Result<Option<Merged>> {
        let none = || Error::Merge { problem: format!("frame {frame} has no parts") };
        let entries = self.frames.get(&frame).filter(|e| !e.is_empty()).ok_or_else(none)?;
        let (sections, gaps) = self.sections(frame, entries)?;
        let mut notes = Vec::new();
        if !gaps.is_empty() {
            notes.push(format!("frame {frame} lacks {gaps}"));
        }
        let exposure = entries[0].exposure;
        let passes: Vec<Lines> = self.settings.passes(frame, None)?.iter().map(|pass| pass.lines).collect();
        let (width, height) = self.lead.size;
        let mut film = Film::new(width, height, Some(self.lead.window))?;
        let observes = self.settings.aovs.iter().any(|aov| aov.is_observed());
        let mut observed = if observes { aovs::blank(film.window()) } else { Vec::new() };
        let mut strip = Strip { collection: self, entries, observes, states: Vec::new(), notes };
        for section in &sections {
            let mut parts = OpenParts::new(&strip, section);
            for (pass, &lines) in (0..).zip(&passes) {
                for row in rows(&section.blocks, Blocks::new(self.lead.window).columns(), parts.widest_strip()) {
                    if progress.is_cancelled() {
                        return Ok(None);
                    }
                    strip.read(&mut parts, &row, pass, lines)?;
                    strip.finish(&row, lines, &mut film, &mut observed, progress);
                }
            }
        }
        let notes = strip.notes;
        let mut cost = cost_of(entries, film.rejected());
        if let Some(Adaptive { goal: Goal::Passes(passes), .. }) = self.settings.adaptive {
            cost.passes = Some(passes);
        }
        let planes = aovs::planes(&observed, &self.settings.aovs);
        let bytes = entries.iter().map(|entry| entry.bytes).sum();
        let frame = Frame { film, planes, exposure, cost, is_partial: !notes.is_empty() };
        Ok(Some(Merged { frame, notes, bytes }))
    }
}

fn no_parts(notes: &[String]) -> String {
    match notes {
        [] => "there are no part files to merge".to_owned(),
        notes => format!("there are no sound part files to merge: {}", notes.join("; ")),
    }
}

/// The settings that the first part brings, which everything else is compared to.
fn check_lead(path: &Path, lead: &Header) -> Result<Settings> {
    let bad = |problem: String| Error::Merge { problem: format!("{}: {problem}", path.display()) };
    let ours = concat!("graeco ", env!("CARGO_PKG_VERSION"));
    if lead.record.program != ours {
        return Err(bad(format!("was made by {}, and this is {ours}", lead.record.program)));
    }
    let settings: Settings = serde_json::from_value(lead.record.settings["render"].clone())
        .map_err(|error| bad(format!("its settings are not those of this program: {error}")))?;
    let window = settings.window()?.unwrap_or(crate::film::Window::whole(lead.size.0, lead.size.1));
    let passes = settings.passes(lead.frame, None)?.len();
    if settings.size != lead.size || window != lead.window || passes != lead.passes as usize {
        return Err(bad("its settings and its header contradict each other".to_owned()));
    }
    Ok(settings)
}

/// Why two parts cannot be of the same shot, if so.
fn difference(a: &Header, b: &Header) -> Option<String> {
    let (one, other) = (&a.record, &b.record);
    if one.program != other.program {
        return Some(format!("they were made by {} and {}", one.program, other.program));
    }
    if one.scene_hash != other.scene_hash {
        let short = |hash: &str| hash.chars().take(12).collect::<String>();
        let (x, y) = (short(&one.scene_hash), short(&other.scene_hash));
        return Some(format!("their scenes differ (hashes {x}… and {y}…)"));
    }
    if one.seed != other.seed {
        return Some(format!("their seeds are {} and {}", one.seed, other.seed));
    }
    if let Some((name, x, y)) = unequal("", &one.settings, &other.settings) {
        return Some(format!("the setting {name} is {x} in the one and {y} in the other"));
    }
    if one.settings_hash != other.settings_hash {
        return Some("their settings' hashes differ".to_owned());
    }
    if (a.size, a.window, a.total_runs, a.passes) != (b.size, b.window, b.total_runs, b.passes) {
        return Some("their frames have different sizes or runs".to_owned());
    }
    (a.output != b.output)
        .then(|| "they ask for different outputs (--view, --exposure, --depth, --fields or --pulldown)".to_owned())
}

/// The first entry that differs: its path and both values.
fn unequal(path: &str, a: &serde_json::Value, b: &serde_json::Value) -> Option<(String, String, String)> {
    if a == b {
        return None;
    }
    if let (Some(x), Some(y)) = (a.as_object(), b.as_object()) {
        let null = serde_json::Value::Null;
        return x.keys().chain(y.keys()).find_map(|key| {
            let path = if path.is_empty() { key.clone() } else { format!("{path}.{key}") };
            unequal(&path, x.get(key).unwrap_or(&null), y.get(key).unwrap_or(&null))
        });
    }
    Some((path.to_owned(), a.to_string(), b.to_string()))
}

/// The rows of the block grid that `blocks` cover, each cut to them and into strips of at most `widest` blocks.
fn rows(blocks: &Range<u32>, columns: u32, widest: u32) -> Vec<Range<u32>> {
    let mut strips = Vec::new();
    let mut at = blocks.start;
    while at < blocks.end {
        let row_end = (at / columns + 1) * columns;
        let end = row_end.min(blocks.end).min(at.saturating_add(widest));
        strips.push(at..end);
        at = end;
    }
    strips
}

#[allow(clippy::cast_precision_loss, reason = "seconds to be shown")]
fn cost_of(entries: &[Entry], rejected: u64) -> FrameCost {
    let mut cost = FrameCost { rejected, ..FrameCost::default() };
    for Entry { totals, .. } in entries {
        cost.build_s += totals.build_s;
        cost.render_cpu_s += totals.cost.nanoseconds as f64 * 1e-9;
        cost.samples += totals.cost.samples;
        cost.rays += totals.cost.rays;
    }
    cost.render_s = cost.render_cpu_s;
    cost
}

/// The parts of a section in the order of their runs. They stay open if they are few enough for any limit on open files.
struct OpenParts<'s> {
    entries: &'s [Entry],
    section: &'s Section,
    total_runs: u32,
    open: Vec<Option<(PartFile, Layout)>>,
}

impl<'s> OpenParts<'s> {
    fn new(strip: &Strip<'s>, section: &'s Section) -> Self {
        let open = section.parts.iter().map(|_| None).collect();
        Self { entries: strip.entries, section, total_runs: strip.collection.lead.total_runs, open }
    }

    /// Parts that are open at a time: a quarter of the usual limit on open files.
    const MOST_OPEN: usize = 256;

    /// Blocks to be read at a time: some for each thread. Parts that must be opened for every strip give whole rows.
    fn widest_strip(&self) -> u32 {
        const A_THREAD: usize = 16;
        if self.section.parts.len() > Self::MOST_OPEN {
            return u32::MAX;
        }
        u32::try_from(A_THREAD * rayon::current_num_threads()).unwrap_or(u32::MAX)
    }

    /// Hands the `index`-th part to `work`.
    fn with<R>(&mut self, index: usize, work: impl FnOnce(&(PartFile, Layout)) -> R) -> Result<R> {
        let slot = &mut self.open[index];
        if let Some(part) = slot {
            return Ok(work(part));
        }
        let entry = &self.entries[self.section.parts[index]];
        let file = PartFile::open(&entry.path)?;
        let part = slot.insert((file, Layout::new(entry.extent.runs.clone(), self.total_runs)));
        let result = work(part);
        if self.section.parts.len() > Self::MOST_OPEN {
            *slot = None;
        }
        Ok(result)
    }
}

/// One block's pixels.
#[derive(Debug, Default)]
struct BlockState {
    pixels: Unpacked,
    observed: Vec<ObservedSums>,
}

/// One row of blocks being merged.
struct Strip<'c> {
    collection: &'c Collection,
    entries: &'c [Entry],
    observes: bool,
    states: Vec<BlockState>,
    notes: Vec<String>,
}

impl Strip<'_> {
    /// Sums every part's records of the blocks `row` in `pass`.
    fn read(&mut self, parts: &mut OpenParts<'_>, row: &Range<u32>, pass: u32, lines: Lines) -> Result<()> {
        let blocks = Blocks::new(self.collection.lead.window);
        self.states.resize_with(row.len(), BlockState::default);
        for (state, block) in self.states.iter_mut().zip(row.clone()) {
            let area = pixels(blocks.window(block), lines).count();
            state.pixels.begin(area, self.collection.settings.adaptive.is_some());
            state.observed.clear();
            state.observed.resize_with(if self.observes { area } else { 0 }, ObservedSums::default);
        }
        let (states, aovs) = (&mut self.states, &self.collection.settings.aovs);
        for index in 0..parts.section.parts.len() {
            let read = parts.with(index, |(file, layout)| {
                let read_one = |buffer: &mut Vec<u8>, (state, block): (&mut BlockState, u32)| {
                    let payload = file.record(block, pass, buffer)?;
                    let rest = state.pixels.unpack(payload, layout).and_then(|rest| {
                        if state.observed.is_empty() {
                            return Some(rest);
                        }
                        aovs::unpack(rest, layout, aovs, &mut state.observed)
                    });
                    if rest.is_some_and(<[u8]>::is_empty) { Ok(()) } else { Err(file.misfit(block)) }
                };
                states
                    .par_iter_mut()
                    .zip(row.clone())
                    .map_init(Vec::new, read_one)
                    .filter_map(Result::err)
                    .collect::<Vec<Error>>()
            });
            for error in read.unwrap_or_else(|error| vec![error]) {
                if self.collection.missing == Missing::Refused {
                    return Err(error);
                }
                let note = format!("{error}; it is left out");
                if !self.notes.contains(&note) {
                    self.notes.push(note);
                }
            }
        }
        Ok(())
    }

    /// Puts the estimates of `row` into the picture.
    fn finish(
        &self,
        row: &Range<u32>,
        lines: Lines,
        film: &mut Film,
        observed: &mut [aovs::Observed],
        progress: &Progress,
    ) {
        let blocks = Blocks::new(self.collection.lead.window);
        let window = film.window();
        let estimates: Vec<Vec<_>> = self.states.par_iter().map(|state| state.pixels.estimates()).collect();
        let stored = film.pixels_mut();
        for ((block, estimates), state) in row.clone().zip(estimates).zip(&self.states) {
            progress.advance(estimates.len() as u64, 0);
            for (i, ((x, y), estimate)) in pixels(blocks.window(block), lines).zip(estimates).enumerate() {
                let Some(index) = window.index(x, y) else { continue };
                stored[index] = estimate;
                if let Some(sums) = state.observed.get(i) {
                    observed[index] = sums.observed();
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn strips_cover_their_blocks_in_order_and_never_two_rows() {
        assert_eq!(rows(&(3..17), 5, 100), [3..5, 5..10, 10..15, 15..17]);
        assert_eq!(rows(&(4..11), 5, 3), [4..5, 5..8, 8..10, 10..11]);
        assert!(rows(&(4..4), 5, 3).is_empty());
    }
}
