//! Open Job Description: a job template that AWS Deadline Cloud, `openjd run` and others take.
//!
//! After the specification "Template Schemas, version 2023-09". Task parameters are Frame × Tile, or Frame × Runs; several
//! frames a task are a `CHUNK[INT]` of the extension `TASK_CHUNKING`, which is declared only then. Frames are a range
//! string (a list may hold 1024 items at most, a string any number), and a job parameter, so that a user can submit the
//! same template for some frames again. Paths are job parameters of type PATH, so that a manager can map them to where
//! a worker has them. Default paths must be relative and lie below the template.

use super::division::{Slicing, ranges};
use super::job::Job;
use crate::{Error, Result};
use std::path::{Component, Path, PathBuf};

/// The most items that a list of the specification may hold.
const MOST_ITEMS: usize = 1024;
/// The longest default of a job parameter (section 2.5).
const LONGEST_DEFAULT: usize = 1024;

/// A template and what must be said to submit it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Template {
    /// The YAML.
    pub text: String,
    /// Job parameters that have no default, with the values they had here: paths that do not lie below the template.
    pub needed: Vec<(&'static str, String)>,
}

/// Writes the template of a job that will stand in `folder`.
///
/// # Errors
/// If the job does not fit the specification: a text that it would read as its own, or too many parts.
pub fn template(job: &Job, folder: &Path) -> Result<Template> {
    for text in job.settings.iter().chain([&job.name, &job.picture_name()]) {
        if text.contains("{{") || text.chars().any(char::is_control) {
            return Err(Error::invalid(
                format!("\"{}\"", text.escape_debug()),
                "holds {{ or a control character, which a job template cannot carry",
            ));
        }
    }
    let frames = ranges(&job.frames);
    if frames.len() > LONGEST_DEFAULT {
        return Err(Error::invalid(
            "--frames",
            format!("{} characters are too long for a job template, expected {LONGEST_DEFAULT} at most", frames.len()),
        ));
    }
    let mut writer = Writer { job, folder, text: String::new(), needed: Vec::new() };
    writer.head();
    writer.parameters(&frames);
    writer.line("steps:");
    writer.render()?;
    writer.gather();
    Ok(Template { text: writer.text, needed: writer.needed })
}

struct Writer<'a> {
    job: &'a Job,
    folder: &'a Path,
    text: String,
    needed: Vec<(&'static str, String)>,
}

/// A YAML scalar in double quotes; JSON's are YAML's.
fn quoted(text: &str) -> String {
    serde_json::Value::from(text).to_string()
}

impl Writer<'_> {
    fn line(&mut self, line: &str) {
        self.text.push_str(line);
        self.text.push('\n');
    }

    fn is_cut(&self) -> bool {
        self.job.division.parts > 1
    }

    fn head(&mut self) {
        let (job, division) = (self.job, &self.job.division);
        self.line(&format!("# Written by graeco {}.", env!("CARGO_PKG_VERSION")));
        self.line("specificationVersion: jobtemplate-2023-09");
        if division.frames_per_task > 1 || job.merged_per_task > 1 {
            self.line("extensions: [TASK_CHUNKING]");
        }
        let name: String = job.name.chars().take(128).collect();
        self.line(&format!("name: {}", quoted(&name)));
        let what = match (division.parts, division.slicing) {
            (1, _) => String::new(),
            (n, Slicing::Tiles) => format!(" in {n} tiles"),
            (n, Slicing::Runs) => format!(" in {n} ranges of runs"),
        };
        let frames = job.frames.len();
        let text = format!("{frames} frames{what}, {} tasks of about {:.0} s", division.tasks(frames), division.task_s);
        self.line(&format!("description: {}", quoted(&text)));
    }

    fn parameters(&mut self, frames: &str) {
        self.line("parameterDefinitions:");
        self.line("  - {name: Graeco, type: STRING, default: graeco, description: The program on workers}");
        self.line(&format!("  - {{name: Frames, type: STRING, default: {}}}", quoted(frames)));
        self.path("Scene", &self.job.scene.clone(), "objectType: FILE, dataFlow: IN");
        if let Some(picture) = self.job.environment.clone() {
            self.path("Environment", &picture, "objectType: FILE, dataFlow: IN");
        }
        let pictures = self.job.pictures.path(0).parent().map_or_else(PathBuf::new, Path::to_path_buf);
        self.path("OutDir", &pictures, "objectType: DIRECTORY, dataFlow: OUT");
        if self.is_cut() {
            self.path("PartsDir", &self.job.parts.clone(), "objectType: DIRECTORY, dataFlow: INOUT");
        }
    }

    fn path(&mut self, name: &'static str, path: &Path, kind: &str) {
        match below(self.folder, path) {
            Some(relative) => {
                self.line(&format!("  - {{name: {name}, type: PATH, {kind}, default: {}}}", quoted(&relative)));
            }
            None => {
                self.line(&format!("  - {{name: {name}, type: PATH, {kind}}}"));
                self.needed.push((name, absolute(path).display().to_string()));
            }
        }
    }

    fn step(&mut self, name: &str, memory_mib: u64) {
        self.line(&format!("  - name: {name}"));
        if name != "Render" {
            self.line("    dependencies:");
            self.line("      - dependsOn: Render");
        }
        self.line("    hostRequirements:");
        self.line("      amounts:");
        self.line(&format!("        - {{name: amount.worker.vcpu, min: {}}}", self.job.needs.threads));
        self.line(&format!("        - {{name: amount.worker.memory, min: {memory_mib}}}"));
    }

    /// The task parameter Frame, by `count` to a task.
    fn frame_parameter(&mut self, count: usize) {
        self.line("    parameterSpace:");
        self.line("      taskParameterDefinitions:");
        if count > 1 {
            self.line("        - name: Frame");
            self.line("          type: CHUNK[INT]");
            self.line("          range: \"{{Param.Frames}}\"");
            self.line(&format!("          chunks: {{defaultTaskCount: {count}, rangeConstraint: NONCONTIGUOUS}}"));
        } else {
            self.line("        - {name: Frame, type: INT, range: \"{{Param.Frames}}\"}");
        }
    }

    fn script(&mut self, arguments: &[String]) {
        self.line("    script:");
        self.line("      actions:");
        self.line("        onRun:");
        self.line("          command: \"{{Param.Graeco}}\"");
        self.line("          args:");
        for argument in arguments {
            self.line(&format!("            - {}", quoted(argument)));
        }
        // The program records what is done when it is told to stop.
        self.line("          cancelation: {mode: NOTIFY_THEN_TERMINATE, notifyPeriodInSeconds: 60}");
    }

    fn render(&mut self) -> Result<()> {
        let (job, division) = (self.job, self.job.division);
        self.step("Render", job.needs.memory_mib);
        self.frame_parameter(division.frames_per_task);
        let mut arguments: Vec<String> =
            ["render", "{{Param.Scene}}", "--frames={{Task.Param.Frame}}"].map(String::from).into();
        let output = |name: &str| format!("--output={{{{Param.PartsDir}}}}/{name}");
        match (division.parts, division.slicing) {
            (1, _) => {
                let name = job.picture_name();
                arguments.extend(["--resume".into(), format!("--output={{{{Param.OutDir}}}}/{name}")]);
            }
            (parts, Slicing::Tiles) => {
                self.line(&format!("        - {{name: Tile, type: INT, range: \"1-{parts}\"}}"));
                arguments.push(format!("--tile={{{{Task.Param.Tile}}}}/{parts}"));
                arguments.push(output(&job.part_name("{{Task.Param.Tile}}")));
            }
            (parts, Slicing::Runs) if parts as usize <= MOST_ITEMS => {
                let ranges: Vec<String> = job.run_ranges().iter().map(|r| quoted(r)).collect();
                self.line(&format!("        - {{name: Runs, type: STRING, range: [{}]}}", ranges.join(", ")));
                arguments.push("--run-range={{Task.Param.Runs}}".into());
                arguments.push(output(&job.part_name("{{Task.Param.Runs}}")));
            }
            (parts, Slicing::Runs) => {
                return Err(Error::invalid(
                    format!("{parts} ranges of runs"),
                    format!("a job template can list {MOST_ITEMS} at most"),
                ));
            }
        }
        if job.environment.is_some() {
            arguments.push("--environment={{Param.Environment}}".into());
        }
        arguments.extend(job.settings.iter().cloned());
        arguments.extend([format!("--threads={}", job.needs.threads), "--progress=openjd".into()]);
        self.script(&arguments);
        Ok(())
    }

    /// What comes after all frames or parts: the merge, or a look at whether all frames are there.
    fn gather(&mut self) {
        let job = self.job;
        if self.is_cut() {
            self.step("Merge", job.needs.memory_mib);
            self.frame_parameter(job.merged_per_task);
            self.script(&[
                "merge".into(),
                format!("{{{{Param.PartsDir}}}}/{}", job.part_name("*")),
                "--frames={{Task.Param.Frame}}".into(),
                format!("--output={{{{Param.OutDir}}}}/{}", job.picture_name()),
            ]);
        } else {
            self.step("Check", job.needs.memory_mib);
            self.frame_parameter(job.merged_per_task);
            let arguments = ["check", "{{Param.OutDir}}", "--frames={{Task.Param.Frame}}"].map(String::from);
            self.script(&arguments);
        }
    }
}

/// The path from the root, without `.` and `..`; links stay.
fn absolute(path: &Path) -> PathBuf {
    // No folder is this one.
    let path = if path.as_os_str().is_empty() { Path::new(".") } else { path };
    let whole = std::path::absolute(path).unwrap_or_else(|_| path.to_path_buf());
    let mut out = PathBuf::new();
    for part in whole.components() {
        match part {
            Component::ParentDir => {
                out.pop();
            }
            Component::CurDir => {}
            other => out.push(other),
        }
    }
    out
}

/// `path` relative to `folder` if it lies below it.
fn below(folder: &Path, path: &Path) -> Option<String> {
    let (folder, path) = (absolute(folder), absolute(path));
    let relative = path.strip_prefix(&folder).ok()?.to_str()?;
    Some(if relative.is_empty() { ".".to_owned() } else { relative.to_owned() })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::farm::{Division, Needs};

    pub(super) fn job(parts: u32, slicing: Slicing, frames_per_task: usize) -> Job {
        Job {
            name: "shot \"7\"".into(),
            scene: "/shots/a/shot.glb".into(),
            environment: None,
            settings: vec!["--runs=64".into(), "--depth=float".into()],
            frames: (1..=6).collect(),
            runs: 64,
            division: Division { slicing, parts, frames_per_task, task_s: 10.0 },
            merged_per_task: 1,
            pictures: "/shots/a/out/shot.####.exr".parse().unwrap(),
            parts: "/elsewhere/parts".into(),
            needs: Needs { threads: 2, memory_mib: 512 },
        }
    }

    #[test]
    fn paths_below_the_template_have_defaults_and_others_are_asked_for() {
        let t = template(&job(2, Slicing::Tiles, 1), Path::new("/shots/a")).unwrap();
        assert!(t.text.contains("name: Scene, type: PATH, objectType: FILE, dataFlow: IN, default: \"shot.glb\""));
        assert!(t.text.contains("default: \"out\""), "{}", t.text);
        assert_eq!(t.needed, [("PartsDir", "/elsewhere/parts".to_owned())]);
        assert_eq!(below(Path::new(""), Path::new("")).as_deref(), Some("."));
        assert_eq!(below(Path::new("a"), Path::new("a/../a/b/./c")).as_deref(), Some("b/c"));
        assert_eq!(below(Path::new("a"), Path::new("b")), None);
    }

    #[test]
    fn chunking_is_declared_only_where_it_is_used() {
        let whole = |n| template(&job(1, Slicing::Tiles, n), Path::new("/farm")).unwrap().text;
        assert!(whole(3).contains("extensions: [TASK_CHUNKING]") && whole(3).contains("defaultTaskCount: 3"));
        assert!(!whole(1).contains("CHUNK"));
    }

    #[test]
    fn parts_are_tiles_or_ranges_of_runs_and_are_merged_after_all_of_them() {
        let tiles = template(&job(2, Slicing::Tiles, 1), Path::new("/farm")).unwrap().text;
        assert!(tiles.contains("range: \"1-2\"") && tiles.contains("--tile={{Task.Param.Tile}}/2"), "{tiles}");
        let runs = template(&job(2, Slicing::Runs, 1), Path::new("/farm")).unwrap().text;
        assert!(runs.contains("range: [\"0-31\", \"32-63\"]"), "{runs}");
        let (render, merge) = tiles.split_once("name: Merge").unwrap();
        assert!(merge.contains("{{Param.PartsDir}}/shot.####.*.part"));
        assert!(merge.contains("dependsOn: Render") && render.contains("--depth=float"));
    }

    #[test]
    fn what_the_specification_would_read_as_its_own_is_refused() {
        let mut job = job(1, Slicing::Tiles, 1);
        job.settings.push("--camera={{Param.X}}".into());
        assert!(template(&job, Path::new("/farm")).unwrap_err().to_string().contains("holds {{"));
        job.settings.pop();
        job.frames = (0..2000).map(|i| i * i).collect();
        assert!(template(&job, Path::new("/farm")).unwrap_err().to_string().contains("too long"));
    }
}
