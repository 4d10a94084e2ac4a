//! How frames are cut into tasks.
//!
//! A task starts the program, loads the scene and prepares each of its frames (pose, acceleration structure) before it
//! takes a sample. A frame that fits a task stays whole, and a task takes as many as fit. A larger frame is cut into as
//! many parts as needed, but never so many that a task spends less time on samples than on what every part repeats.

use crate::{Error, Result};

/// What a frame takes on a machine of the kind that will render it, seconds.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Cost {
    /// To start and load the scene, once a task.
    pub load_s: f64,
    /// To prepare a frame, once a frame or part.
    pub build_s: f64,
    /// To take a frame's samples: what parts divide.
    pub render_s: f64,
}

/// What a part of a frame is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Slicing {
    /// A band of the picture: a part is as large as what it shows, but bands are not equally hard.
    Tiles,
    /// A range of every pixel's runs: parts take equally long, but each is as large as the whole picture.
    Runs,
}

/// What the user decides; the rest follows from [`Cost`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Wish {
    /// Seconds that a task should take.
    pub task_s: f64,
    /// What a part is, where frames are cut.
    pub slicing: Slicing,
    /// Parts of a frame.
    pub parts: Option<u32>,
    /// Frames of a task.
    pub frames_per_task: Option<usize>,
    /// The most parts that a frame can have.
    pub most_parts: u32,
}

/// How frames are cut into tasks.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Division {
    /// What a part is; of no consequence with one part.
    pub slicing: Slicing,
    /// Parts of a frame: 1 leaves frames whole.
    pub parts: u32,
    /// Frames, or parts of as many frames, that a task renders.
    pub frames_per_task: usize,
    /// Seconds that a task is expected to take.
    pub task_s: f64,
}

impl Division {
    /// Cuts `frames` frames.
    ///
    /// # Errors
    /// If more parts are wished than a frame can have.
    pub fn new(cost: Cost, frames: usize, wish: &Wish) -> Result<Self> {
        let most = wish.most_parts.max(1);
        if let Some(parts) = wish.parts.filter(|&p| p > most || p == 0) {
            let what = match wish.slicing {
                Slicing::Tiles => "tiles",
                Slicing::Runs => "ranges of runs",
            };
            return Err(Error::invalid(
                format!("{parts} parts"),
                format!("a frame can be cut into 1 to {most} {what}"),
            ));
        }
        let parts = wish.parts.unwrap_or_else(|| parts(cost, wish, most));
        let frame_s = cost.build_s + cost.render_s / f64::from(parts);
        let fitting = ((wish.task_s - cost.load_s) / frame_s).clamp(1.0, frames.max(1) as f64);
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "clamped just before; NaN gives 0")]
        let fitting = (fitting as usize).max(1);
        let frames_per_task = wish.frames_per_task.unwrap_or(fitting).clamp(1, frames.max(1));
        let task_s = cost.load_s + frames_per_task as f64 * frame_s;
        Ok(Self { slicing: wish.slicing, parts, frames_per_task, task_s })
    }

    /// How many groups of frames there are.
    #[must_use]
    pub fn groups(&self, frames: usize) -> usize {
        frames.div_ceil(self.frames_per_task)
    }

    /// How many tasks there are.
    #[must_use]
    pub fn tasks(&self, frames: usize) -> usize {
        self.groups(frames) * self.parts as usize
    }
}

/// Parts so that one takes no longer than wished, or at least half of it is samples.
fn parts(cost: Cost, wish: &Wish, most: u32) -> u32 {
    let fixed = cost.load_s + cost.build_s;
    if fixed + cost.render_s <= wish.task_s || wish.frames_per_task.is_some_and(|n| n > 1) {
        return 1;
    }
    let room = (wish.task_s - fixed).max(fixed);
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "clamped; NaN gives 0, then 1")]
    let parts = (cost.render_s / room).ceil().clamp(1.0, f64::from(most)) as u32;
    parts.max(1)
}

/// Frame numbers as render managers write them, in ascending order: `1-5:2,9`.
#[must_use]
pub fn ranges(frames: &[i64]) -> String {
    let mut sorted = frames.to_vec();
    sorted.sort_unstable();
    sorted.dedup();
    let (mut out, mut at) = (Vec::new(), 0);
    while at < sorted.len() {
        let first = sorted[at];
        let step = sorted.get(at + 1).map_or(1, |next| next - first);
        let mut end = at;
        while sorted.get(end + 1).is_some_and(|next| next - sorted[end] == step) {
            end += 1;
        }
        // Two numbers alone are no range, unless they are neighbours.
        if end == at || (end == at + 1 && step > 1) {
            out.push(first.to_string());
            at += 1;
        } else {
            let last = sorted[end];
            out.push(if step == 1 { format!("{first}-{last}") } else { format!("{first}-{last}:{step}") });
            at = end + 1;
        }
    }
    out.join(",")
}

/// The `index`-th (from 0) of `parts` nearly equal ranges of `runs` runs: first and last. Bounds are multiples of the
/// power of two that leaves every range eight of them, so that ranges are few of a design's blocks and nearly equal.
#[must_use]
pub fn run_range(runs: u32, parts: u32, index: u32) -> (u32, u32) {
    let (parts, index) = (u64::from(parts.clamp(1, runs.max(1))), u64::from(index));
    let runs = u64::from(runs);
    let mut unit = 1;
    while unit * 16 * parts <= runs {
        unit *= 2;
    }
    let units = runs.div_ceil(unit);
    let bound = |i: u64| (i * units / parts * unit).min(runs);
    #[allow(clippy::cast_possible_truncation, reason = "below runs, which is u32")]
    let bounds = (bound(index) as u32, (bound(index + 1).max(1) - 1) as u32);
    bounds
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::render::FrameList;
    use proptest::prelude::*;

    fn wish(task_s: f64) -> Wish {
        Wish { task_s, slicing: Slicing::Tiles, parts: None, frames_per_task: None, most_parts: 1000 }
    }

    fn cut(cost: (f64, f64, f64), task_s: f64) -> (u32, usize) {
        let cost = Cost { load_s: cost.0, build_s: cost.1, render_s: cost.2 };
        let d = Division::new(cost, 100, &wish(task_s)).unwrap();
        (d.parts, d.frames_per_task)
    }

    #[test]
    fn small_frames_are_gathered_and_large_ones_cut() {
        assert_eq!(cut((10.0, 1.0, 9.0), 600.0), (1, 59));
        assert_eq!(cut((10.0, 1.0, 9.0), 5000.0), (1, 100));
        assert_eq!(cut((10.0, 20.0, 3600.0), 600.0), (7, 1));
        assert_eq!(cut((0.0, 0.0, 1e9), 1.0), (1000, 1));
    }

    /// Load and build take 90 s: a task of 60 s would be nothing but them.
    #[test]
    fn half_of_a_task_is_samples_at_least() {
        assert_eq!(cut((60.0, 30.0, 900.0), 60.0), (10, 1));
    }

    #[test]
    fn wishes_come_first_and_impossible_ones_are_refused() {
        let cost = Cost { load_s: 1.0, build_s: 0.0, render_s: 1.0 };
        let d = Division::new(cost, 6, &Wish { parts: Some(2), frames_per_task: Some(3), ..wish(600.0) }).unwrap();
        assert_eq!((d.parts, d.frames_per_task, d.tasks(6)), (2, 3, 4));
        let refused = Division::new(cost, 6, &Wish { parts: Some(2000), ..wish(600.0) });
        assert!(refused.unwrap_err().to_string().contains("1 to 1000 tiles"));
    }

    #[test]
    fn frames_are_written_as_managers_read_them() {
        assert_eq!(ranges(&[1, 2, 3, 9]), "1-3,9");
        assert_eq!(ranges(&[1, 3, 5, 7, 9, 11, 14]), "1-11:2,14");
        assert_eq!(ranges(&[5, 1]), "1,5");
        assert_eq!(ranges(&[-3, -2, -1, 0, 4]), "-3-0,4");
    }

    #[test]
    fn runs_are_cut_at_powers_of_two() {
        let cut = |runs, parts| (0..parts).map(|i| run_range(runs, parts, i)).collect::<Vec<_>>();
        assert_eq!(cut(256, 4), [(0, 63), (64, 127), (128, 191), (192, 255)]);
        assert_eq!(cut(100, 3), [(0, 31), (32, 63), (64, 99)]);
        assert_eq!(cut(3, 3), [(0, 0), (1, 1), (2, 2)]);
    }

    proptest! {
        #[test]
        fn what_is_written_reads_back(mut frames in proptest::collection::btree_set(-50_i64..50, 1..20)) {
            let list: Vec<i64> = std::mem::take(&mut frames).into_iter().collect();
            let read: FrameList = ranges(&list).parse().unwrap();
            let mut back = read.frames().to_vec();
            back.sort_unstable();
            prop_assert_eq!(back, list);
        }

        #[test]
        fn ranges_of_runs_cover_each_run_once(runs in 1_u32..5000, parts in 1_u32..64) {
            let parts = parts.min(runs);
            let mut next = 0;
            for i in 0..parts {
                let (first, last) = run_range(runs, parts, i);
                prop_assert_eq!(first, next);
                prop_assert!(last >= first);
                next = last + 1;
            }
            prop_assert_eq!(next, runs);
        }

        #[test]
        fn no_cost_breaks_the_division(load in 0.0..1e9_f64, build in 0.0..1e9_f64, render in 0.0..1e12_f64, task in 1e-3..1e9_f64) {
            let d = Division::new(Cost { load_s: load, build_s: build, render_s: render }, 1000, &wish(task)).unwrap();
            prop_assert!((1..=1000).contains(&d.parts) && (1..=1000).contains(&d.frames_per_task));
        }
    }
}
