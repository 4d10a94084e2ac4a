//! `graeco info`.

use clap::{Args, ValueHint};
use graeco::Result;
use graeco::scene::Info;
use graeco::scene::gltf::{LoadOptions, load};
use std::io::{self, Write};
use std::path::PathBuf;

/// Arguments of `graeco info`.
#[derive(Debug, Clone, Args)]
pub(crate) struct InfoArgs {
    /// glTF file to look into (.gltf or .glb)
    #[arg(value_hint = ValueHint::FilePath)]
    pub(crate) scene: PathBuf,

    /// Print JSON, for programs
    #[arg(long)]
    pub(crate) json: bool,

    /// Read buffers and images outside the file's folder too
    #[arg(long)]
    pub(crate) allow_outside: bool,
}

/// Prints what a file holds.
pub(crate) fn run(args: &InfoArgs) -> Result<()> {
    let options = LoadOptions { allow_outside: args.allow_outside, ..LoadOptions::default() };
    let info = Info::of(&load(&args.scene, &options)?);
    let text = if args.json {
        serde_json::to_string_pretty(&info).map_err(|e| graeco::Error::invalid("--json", e.to_string()))? + "\n"
    } else {
        info.to_string()
    };
    match io::stdout().lock().write_all(text.as_bytes()) {
        // The reader of a pipe may have seen enough.
        Err(e) if e.kind() == io::ErrorKind::BrokenPipe => Ok(()),
        other => other.map_err(|e| graeco::Error::io("standard output", "write to", e)),
    }
}
