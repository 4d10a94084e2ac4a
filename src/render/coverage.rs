//! Whether parts make up a frame: every run of every block once.

use crate::film::Blocks;
use std::collections::{BTreeMap, BTreeSet};
use std::ops::Range;

/// What one part holds of a frame: all of `runs` of all of `blocks`.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Extent {
    pub(super) blocks: Range<u32>,
    pub(super) runs: Range<u32>,
    /// Into how many tiles the frame was split.
    pub(super) tiles: u32,
}

/// Consecutive blocks that the same parts hold.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Section {
    pub(super) blocks: Range<u32>,
    /// Indices of the parts, in the order of their runs.
    pub(super) parts: Vec<usize>,
}

/// Runs of blocks that no part holds.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Gap {
    pub(super) blocks: Range<u32>,
    pub(super) runs: Range<u32>,
}

/// Two parts that hold the same runs of the same blocks.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Clash {
    pub(super) parts: [usize; 2],
    pub(super) runs: Range<u32>,
}

/// Divides `blocks` blocks of `runs` runs into sections, in order, and finds what is missing; or what is there twice.
pub(super) fn cover(extents: &[&Extent], blocks: u32, runs: u32) -> Result<(Vec<Section>, Vec<Gap>), Clash> {
    let mut events: BTreeMap<u32, (Vec<usize>, Vec<usize>)> = BTreeMap::new();
    events.entry(0).or_default();
    events.entry(blocks).or_default();
    for (index, extent) in extents.iter().enumerate().filter(|(_, e)| !e.blocks.is_empty()) {
        events.entry(extent.blocks.start).or_default().0.push(index);
        events.entry(extent.blocks.end).or_default().1.push(index);
    }
    let (mut sections, mut gaps) = (Vec::new(), Vec::new());
    let mut active: BTreeSet<(u32, usize)> = BTreeSet::new();
    let mut ends = events.keys().copied().skip(1).collect::<Vec<_>>().into_iter();
    for (start, (begun, ended)) in events {
        for index in ended {
            active.remove(&(extents[index].runs.start, index));
        }
        active.extend(begun.into_iter().map(|index| (extents[index].runs.start, index)));
        let Some(end) = ends.next() else { break };
        let here = start..end;
        let mut next = 0;
        let mut last = None;
        for &(first, index) in &active {
            if let Some(last) = last.filter(|_| first < next) {
                return Err(Clash { parts: [last, index], runs: first..next.min(extents[index].runs.end) });
            }
            if first > next {
                add_gap(&mut gaps, Gap { blocks: here.clone(), runs: next..first });
            }
            next = extents[index].runs.end;
            last = Some(index);
        }
        if next < runs {
            add_gap(&mut gaps, Gap { blocks: here.clone(), runs: next..runs });
        }
        sections.push(Section { blocks: here, parts: active.iter().map(|&(_, index)| index).collect() });
    }
    Ok((sections, gaps))
}

/// Adds a gap, joined with that of the same runs in the blocks before.
fn add_gap(gaps: &mut Vec<Gap>, gap: Gap) {
    let before = gaps.iter_mut().rev().take(8).find(|g| g.blocks.end == gap.blocks.start && g.runs == gap.runs);
    match before {
        Some(before) => before.blocks.end = gap.blocks.end,
        None => gaps.push(gap),
    }
}

/// What is missing, in words; empty if nothing is. Runs are named where they can be `shared` out.
pub(super) fn describe(gaps: &[Gap], extents: &[&Extent], blocks: Blocks, shared: bool) -> String {
    const MOST: usize = 6;
    let counts: BTreeSet<u32> = extents.iter().map(|extent| extent.tiles).collect();
    let text = |gap: &Gap| {
        let runs = format!("runs {}-{}", gap.runs.start, gap.runs.end - 1);
        if shared && gap.blocks == (0..blocks.count()) {
            return runs;
        }
        let tiles = counts
            .iter()
            .find_map(|&count| tiles_of(&gap.blocks, count, blocks))
            .unwrap_or_else(|| format!("blocks {} to {} of {}", gap.blocks.start, gap.blocks.end - 1, blocks.count()));
        if shared { format!("{runs} of {tiles}") } else { tiles }
    };
    let mut texts: Vec<String> = gaps.iter().take(MOST).map(text).collect();
    if gaps.len() > MOST {
        texts.push(format!("{} ranges more", gaps.len() - MOST));
    }
    texts.join(", ")
}

/// The tiles of `count` that make up `range`, if whole ones do.
fn tiles_of(range: &Range<u32>, count: u32, blocks: Blocks) -> Option<String> {
    let first =
        (0..count).find(|&i| blocks.share(i, count).start == range.start && !blocks.share(i, count).is_empty())?;
    let last = (first..count).find(|&i| blocks.share(i, count).end == range.end)?;
    Some(if first == last {
        format!("tile {}/{count}", first + 1)
    } else {
        format!("tiles {}/{count} to {}/{count}", first + 1, last + 1)
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::film::Window;

    fn part(blocks: Range<u32>, runs: Range<u32>) -> Extent {
        Extent { blocks, runs, tiles: 4 }
    }

    #[test]
    fn complete_parts_leave_no_gap_whatever_their_division() {
        let parts = [part(5..8, 0..8), part(0..5, 4..8), part(0..3, 0..4), part(3..5, 0..4), part(8..8, 0..8)];
        let (sections, gaps) = cover(&parts.iter().collect::<Vec<_>>(), 8, 8).unwrap();
        assert!(gaps.is_empty());
        let held: Vec<_> = sections.into_iter().map(|s| (s.blocks, s.parts)).collect();
        assert_eq!(held, [(0..3, vec![2, 1]), (3..5, vec![3, 1]), (5..8, vec![0])]);
    }

    #[test]
    fn gaps_are_named_by_runs_and_tiles() {
        let blocks = Blocks::new(Window::whole(64, 32));
        let parts = [part(0..2, 0..8), part(2..4, 0..4), part(6..8, 0..8)];
        let extents: Vec<&Extent> = parts.iter().collect();
        let (_, gaps) = cover(&extents, blocks.count(), 8).unwrap();
        assert_eq!(describe(&gaps, &extents, blocks, true), "runs 4-7 of tile 2/4, runs 0-7 of tile 3/4");
        assert_eq!(describe(&gaps[1..], &extents, blocks, false), "tile 3/4");
        assert_eq!(describe(&cover(&[], 8, 8).unwrap().1, &[], blocks, true), "runs 0-7");
    }

    #[test]
    fn what_is_there_twice_is_named() {
        let parts = [part(0..4, 0..8), part(3..8, 6..8)];
        let clash = cover(&parts.iter().collect::<Vec<_>>(), 8, 8).unwrap_err();
        assert_eq!(clash, Clash { parts: [0, 1], runs: 6..8 });
    }
}
