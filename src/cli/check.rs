//! `graeco check`.

use clap::{Args, ValueHint};
use graeco::output::check::{self, Sequence};
use graeco::render::FrameList;
use std::path::PathBuf;

/// Arguments of `graeco check`.
#[derive(Debug, Clone, Args)]
pub(crate) struct CheckArgs {
    /// Folder of rendered frames
    #[arg(value_hint = ValueHint::DirPath)]
    pub(crate) folder: PathBuf,

    /// Look at these frames alone and expect every one of them: 1-48, 1-48:2 or 3,7,9
    #[arg(long, value_name = "LIST", allow_hyphen_values = true)]
    pub(crate) frames: Option<FrameList>,

    /// Print JSON
    #[arg(long)]
    pub(crate) json: bool,
}

/// Checks; gives the text to print and whether everything is well (if not, the exit code is 1).
pub(crate) fn run(args: &CheckArgs) -> graeco::Result<(String, bool)> {
    let wanted = args.frames.as_ref().map_or(&[][..], FrameList::frames);
    let sequences = check::check_frames(&args.folder, wanted)?;
    let well = sequences.iter().all(|sequence| sequence.findings.is_empty());
    let text = if args.json {
        serde_json::json!(sequences).to_string()
    } else {
        sequences.iter().map(text).collect::<Vec<_>>().join("\n")
    };
    Ok((text, well))
}

fn text(sequence: &Sequence) -> String {
    let Sequence { pattern, expected, findings } = sequence;
    if findings.is_empty() {
        return format!("{pattern}: all {expected} files are whole");
    }
    let mut lines = vec![format!("{pattern}: {} of {expected} files are not as they should be", findings.len())];
    lines.extend(findings.iter().map(|finding| {
        let name = finding.path.file_name().map_or_else(String::new, |name| name.to_string_lossy().into_owned());
        format!("  frame {} ({name}): {}", finding.frame, finding.problem)
    }));
    lines.join("\n")
}
