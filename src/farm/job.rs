//! What is handed to a render manager, whichever it is.

use super::division::{Division, run_range};
use crate::output::Pattern;
use std::path::PathBuf;

/// What a task needs of its machine.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Needs {
    /// Processors, and threads that a task takes.
    pub threads: u16,
    /// Memory, MiB.
    pub memory_mib: u64,
}

/// A shot to be rendered by many machines.
#[derive(Debug, Clone, PartialEq)]
pub struct Job {
    /// What the manager shows.
    pub name: String,
    /// The scene file.
    pub scene: PathBuf,
    /// The picture that lights it, if one is named beside the scene.
    pub environment: Option<PathBuf>,
    /// Flags of `graeco render` that decide what pictures show and how they are written, each one word: `--runs=256`.
    /// Parts keep the latter for the merge.
    pub settings: Vec<String>,
    /// The frames.
    pub frames: Vec<i64>,
    /// Runs a pixel.
    pub runs: u32,
    /// How frames are cut.
    pub division: Division,
    /// Frames that a task merges, or looks whether they are there.
    pub merged_per_task: usize,
    /// Where finished pictures go.
    pub pictures: Pattern,
    /// Folder of parts.
    pub parts: PathBuf,
    /// What a task needs.
    pub needs: Needs,
}

impl Job {
    /// File name of the part that `which` tells from the others of its frame; `*` names them all, for the merge.
    #[must_use]
    pub fn part_name(&self, which: &str) -> String {
        format!("{}.####.{which}.part", self.pictures.stem())
    }

    /// The pictures' file name, without its folder.
    #[must_use]
    pub fn picture_name(&self) -> String {
        self.pictures.without_folder().to_string()
    }

    /// The ranges of runs that parts take, `0-63` and so on.
    #[must_use]
    pub fn run_ranges(&self) -> Vec<String> {
        let parts = self.division.parts;
        (0..parts).map(|i| run_range(self.runs, parts, i)).map(|(a, b)| format!("{a}-{b}")).collect()
    }
}
