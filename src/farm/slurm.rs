//! Slurm: one script that submits itself, renders as an array job, and merges when the array has ended.
//!
//! `afterok` never fires once a task has failed, even if it is requeued and succeeds; so the merge comes `afterany` and
//! verifies for itself that everything is there. A task that a signal ended, or that asks to be tried again (exit code
//! 75), is requeued a few times.

use super::division::{Slicing, ranges};
use super::job::Job;
use crate::{Error, Result};

/// What only Slurm needs to know.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Options {
    /// Tasks that may run at once.
    pub throttle: u32,
    /// Most tasks of one array: below `MaxArraySize` of the cluster, which is 1001 unless set.
    pub array: usize,
    /// Further `#SBATCH` options, such as `--partition=long`.
    pub sbatch: Vec<String>,
}

/// More tasks than these make a script that Slurm does not take (`max_script_size`, 4 MiB).
const MOST_GROUPS: usize = 200_000;

/// Writes the script.
///
/// # Errors
/// If a text cannot stand in a script, or there are too many tasks.
pub fn script(job: &Job, options: &Options) -> Result<String> {
    let division = &job.division;
    let groups = division.groups(job.frames.len());
    if groups > MOST_GROUPS {
        return Err(Error::invalid(
            "--frames",
            format!(
                "{groups} groups of frames are more than the {MOST_GROUPS} that a script holds; raise --task-minutes"
            ),
        ));
    }
    for text in job.settings.iter().chain(&options.sbatch).chain([&job.name]) {
        if text.chars().any(char::is_control) {
            let what = format!("\"{}\"", text.escape_debug());
            return Err(Error::invalid(what, "holds a control character, which a script cannot carry"));
        }
    }
    let tasks = division.tasks(job.frames.len());
    let mut out = head(job, options, tasks);
    let lists: Vec<String> = job.frames.chunks(division.frames_per_task).map(ranges).collect();
    out.push_str(&format!("groups=(\n{}\n)\n", lists.join("\n")));
    let merges: Vec<String> = job.frames.chunks(job.merged_per_task.max(1)).map(ranges).collect();
    out.push_str(&format!("merges=(\n{}\n)\n", merges.join("\n")));
    out.push_str(&commands(job));
    out.push_str(&BODY.replace("@ARRAY@", &options.array.max(1).to_string()));
    Ok(out)
}

fn head(job: &Job, options: &Options, tasks: usize) -> String {
    let (needs, division) = (&job.needs, &job.division);
    // Three times what is expected, for slower machines, and time to start; whole minutes, as Slurm counts.
    let minutes = (division.task_s * 3.0 / 60.0).ceil() + 10.0;
    let last = tasks.min(options.array).saturating_sub(1);
    let throttle = options.throttle;
    let further: String = options.sbatch.iter().map(|o| format!("#SBATCH {o}\n")).collect();
    format!(
        "#!/bin/bash
# {} frames, {tasks} tasks of about {:.0} s; written by graeco {}. Run it where it was written:
#   bash SCRIPT         submits the rendering, and the merge after it; what is finished already is kept
#   bash SCRIPT merge   submits the merge alone
#SBATCH --job-name={}
#SBATCH --array=0-{last}%{throttle}
#SBATCH --nodes=1
#SBATCH --ntasks=1
#SBATCH --cpus-per-task={}
#SBATCH --mem={}M
#SBATCH --time={minutes:.0}
#SBATCH --requeue
#SBATCH --open-mode=append
# Near the time limit, a request to stop: what is done is recorded, and the task requeued.
#SBATCH --signal=B:TERM@60
{further}set -u
throttle={throttle}
parts={}
",
        job.frames.len(),
        division.task_s,
        env!("CARGO_PKG_VERSION"),
        job.name.replace(|c: char| !c.is_ascii_alphanumeric() && !"._-".contains(c), "_"),
        needs.threads,
        needs.memory_mib,
        division.parts,
    )
}

/// The functions that render the frames `$frames` (of part `$part`, from 0) and gather them.
fn commands(job: &Job) -> String {
    let division = &job.division;
    let pictures = job.pictures.to_string();
    let all_parts = path_word(&job.parts.join(job.part_name("*")).display().to_string());
    let part = path_word(&job.parts.join(format!("{}.####.", job.pictures.stem())).display().to_string());
    let mut render =
        format!("    run \"$graeco\" render {} --frames=\"$frames\"", path_word(&job.scene.display().to_string()));
    let mut before = String::new();
    match (division.parts, division.slicing) {
        (1, _) => render.push_str(&format!(" --resume --output={}", word(&pictures))),
        (n, Slicing::Tiles) => {
            before = "    local which=$((part + 1))\n".to_owned();
            render.push_str(&format!(" --tile=\"$which/{n}\" --output={part}\"$which\".part"));
        }
        (_, Slicing::Runs) => {
            before = format!("    local runs=({})\n    local which=${{runs[part]}}\n", job.run_ranges().join(" "));
            render.push_str(&format!(" --run-range=\"$which\" --output={part}\"$which\".part"));
        }
    }
    if let Some(picture) = &job.environment {
        render.push_str(&format!(" --environment={}", word(&picture.display().to_string())));
    }
    render.extend(job.settings.iter().map(|s| format!(" {}", word(s))));
    render.push_str(&format!(" --threads={} --progress=plain", job.needs.threads));
    let gather = if division.parts > 1 {
        format!("    run \"$graeco\" merge {all_parts} --frames=\"$frames\" --output={}", word(&pictures))
    } else {
        let folder = job.pictures.path(0).parent().map_or_else(String::new, |p| p.display().to_string());
        let folder = if folder.is_empty() { "." } else { &folder };
        format!("    run \"$graeco\" check {} --frames=\"$frames\"", path_word(folder))
    };
    format!("render() {{\n{before}{render}\n}}\ngather() {{\n{gather}\n}}\n")
}

const BODY: &str = r#"graeco=${GRAECO:-graeco}
array=@ARRAY@
again=5

# Runs a command, passes a request to stop on to it, and waits until it has recorded what is done.
run() {
    "$@" &
    local child=$!
    trap 'kill -TERM "$child" 2>/dev/null' TERM
    while :; do
        wait "$child"
        code=$?
        kill -0 "$child" 2>/dev/null || break
    done
    trap - TERM
}

# In a job: does the part of the work with the number $1.
work() {
    code=0
    if [ "$GRAECO_STEP" = render ]; then
        part=$(($1 % parts))
        frames=${groups[$1 / parts]}
        render
    else
        frames=${merges[$1]}
        gather
    fi
    [ "$code" -eq 0 ] && exit 0
    # 75: worth another try. 128 and more: a signal ended it.
    if [ "$code" -eq 75 ] || { [ "$code" -ge 128 ] && [ "${SLURM_RESTART_COUNT:-0}" -lt "$again" ]; }; then
        # By array and index: the number in SLURM_JOB_ID may be that of the whole array.
        local me=${SLURM_ARRAY_JOB_ID}_$SLURM_ARRAY_TASK_ID
        # What the user has cancelled, which is no longer RUNNING, stays cancelled.
        case $(scontrol show job --oneliner "$me") in
            *JobState=RUNNING*) ;;
            *) exit "$code" ;;
        esac
        echo "exit code $code: requeued" >&2
        scontrol requeue "$me" || echo "cannot be requeued from here" >&2
        exit 75
    fi
    exit "$code"
}

# On the command line: submits $2 numbers of the step $1, in arrays as long as Slurm takes, with further options.
submit() {
    local step=$1 count=$2 first last id
    shift 2
    ids=
    for ((first = 0; first < count; first += array)); do
        last=$((count - first < array ? count - first - 1 : array - 1))
        id=$(sbatch --parsable --array="0-$last%$throttle" --export="ALL,GRAECO_STEP=$step,GRAECO_FIRST=$first" "$@" "$0") || exit
        ids+=":${id%%;*}"
    done
    echo "$step: ${ids#:}"
}

if [ -n "${SLURM_ARRAY_TASK_ID:-}" ]; then
    : "${GRAECO_STEP:=render}"
    work $((${GRAECO_FIRST:-0} + SLURM_ARRAY_TASK_ID))
elif [ "${1:-}" = merge ]; then
    submit merge "${#merges[@]}"
else
    submit render $((${#groups[@]} * parts))
    # After any end, also a failed one: the merge itself knows what is missing, and says so.
    submit merge "${#merges[@]}" --dependency="afterany$ids"
fi
"#;

/// A word of a shell's command line.
fn word(text: &str) -> String {
    let plain = |c: char| c.is_ascii_alphanumeric() || "_./:=,@%+-".contains(c);
    if !text.is_empty() && text.chars().all(plain) {
        text.to_owned()
    } else {
        format!("'{}'", text.replace('\'', r"'\''"))
    }
}

/// A word that is a path and no flag.
fn path_word(path: &str) -> String {
    if path.starts_with('-') { word(&format!("./{path}")) } else { word(path) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::farm::{Division, Needs};

    fn job(parts: u32, slicing: Slicing, frames_per_task: usize) -> Job {
        Job {
            name: "my shot".into(),
            scene: "it's.glb".into(),
            environment: Some("sky.hdr".into()),
            settings: vec!["--camera=A B".into()],
            frames: (1..=6).collect(),
            runs: 64,
            division: Division { slicing, parts, frames_per_task, task_s: 600.0 },
            merged_per_task: 4,
            pictures: "out/shot.####.exr".parse().unwrap(),
            parts: "out/parts".into(),
            needs: Needs { threads: 2, memory_mib: 512 },
        }
    }

    fn options() -> Options {
        Options { throttle: 7, array: 5, sbatch: vec!["--partition=long".into()] }
    }

    #[test]
    fn words_survive_a_shell() {
        assert_eq!(word("--runs=64"), "--runs=64");
        assert_eq!(word("it's"), r"'it'\''s'");
        assert_eq!(path_word("-x"), "./-x");
    }

    #[test]
    fn the_array_is_no_longer_than_slurm_takes_and_throttled() {
        let text = script(&job(2, Slicing::Tiles, 1), &options()).unwrap();
        assert!(text.contains("#SBATCH --array=0-4%7\n") && text.contains("array=5\n"), "{text}");
        assert!(text.contains("#SBATCH --time=40\n") && text.contains("#SBATCH --partition=long\n"));
        assert!(text.contains("groups=(\n1\n2\n3\n4\n5\n6\n)\nmerges=(\n1-4\n5-6\n)\n"));
        assert!(
            text.contains(r"render 'it'\''s.glb' --frames=") && text.contains("--environment=sky.hdr '--camera=A B'")
        );
    }

    #[test]
    fn whole_frames_are_checked_and_parts_merged() {
        let whole = script(&job(1, Slicing::Tiles, 3), &options()).unwrap();
        assert!(
            whole.contains("groups=(\n1-3\n4-6\n)\nmerges=(\n1-4\n5-6\n)\n") && whole.contains("check out"),
            "{whole}"
        );
        let runs = script(&job(4, Slicing::Runs, 1), &options()).unwrap();
        assert!(
            runs.contains("local runs=(0-15 16-31 32-47 48-63)") && runs.contains("merge 'out/parts/shot.####.*.part'"),
            "{runs}"
        );
        assert!(runs.contains("--output='out/parts/shot.####.'\"$which\".part"), "{runs}");
    }
}
