//! Jobs for render managers, run by them: `tests/managers/` holds the scripts. Skipped where a manager is not installed.
#![allow(
    clippy::unwrap_used,
    clippy::print_stderr,
    reason = "a failure of a test is a panic, and skipped tests say so"
)]

use std::path::{Path, PathBuf};
use std::process::Command;

/// A program on the path, or in the folder where `.ci/run` installs Python tools.
fn find(program: &str) -> Option<PathBuf> {
    let own = Path::new(env!("CARGO_MANIFEST_DIR")).join("target/farm-tools/bin");
    let path = std::env::var_os("PATH").unwrap_or_default();
    let folders = std::env::split_paths(&path).chain([own, PathBuf::from("/usr/sbin")]);
    folders.map(|folder| folder.join(program)).find(|file| file.is_file())
}

/// Runs a script of `tests/managers/` unless one of `programs` is missing.
fn script(name: &str, programs: &[&str]) {
    if let Some(missing) = programs.iter().find(|p| find(p).is_none()) {
        assert!(std::env::var_os("GRAECO_REQUIRE_ALL").is_none(), "{missing} is required, but is not installed");
        eprintln!("skipped: {missing} is not installed");
        return;
    }
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/managers").join(name);
    let mut command = Command::new("bash");
    command.arg(path).env("GRAECO", env!("CARGO_BIN_EXE_graeco"));
    if let Some(openjd) = find("openjd") {
        command.env("OPENJD", openjd);
    }
    let done = command.output().unwrap();
    let said = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
    assert!(done.status.success(), "{name}: {}\n{}\n{}", done.status, said(&done.stdout), said(&done.stderr));
    eprintln!("{}", said(&done.stdout));
}

#[test]
fn openjd_renders_and_merges_what_one_machine_makes_although_tasks_are_struck() {
    script("openjd.sh", &["openjd"]);
}

#[test]
fn slurm_renders_and_merges_what_one_machine_makes_although_tasks_are_struck() {
    script("slurm.sh", &["sbatch", "slurmctld", "slurmd", "munged", "python3"]);
}
