//! `graeco pack` and `graeco unpack`.

use clap::{Args, ValueHint};
use graeco::Result;
use graeco::farm::pack;
use std::path::PathBuf;

/// Arguments of `graeco pack`.
#[derive(Debug, Clone, Args)]
pub(crate) struct PackArgs {
    /// glTF file to pack (.gltf or .glb) with every file that it refers to
    #[arg(value_hint = ValueHint::FilePath)]
    pub(crate) scene: PathBuf,

    /// The archive; every command takes it in place of the scene
    #[arg(short, long, value_name = "FILE.zip", value_hint = ValueHint::FilePath)]
    pub(crate) output: PathBuf,
}

/// Packs; gives the text to print.
pub(crate) fn run(args: &PackArgs) -> Result<String> {
    let packed = pack::write(&args.scene, &args.output)?;
    for (reference, reason) in &packed.missing {
        eprintln!("warning: \"{reference}\" is not packed, and the scene is shown without it: {reason}");
    }
    let (files, bytes) = (packed.files, packed.bytes);
    Ok(format!("{}: {files} files, {bytes} bytes, scene {}", args.output.display(), packed.scene_hash))
}

/// Arguments of `graeco unpack`.
#[derive(Debug, Clone, Args)]
pub(crate) struct UnpackArgs {
    /// Archive that `graeco pack` wrote
    #[arg(value_hint = ValueHint::FilePath)]
    pub(crate) archive: PathBuf,

    /// New or empty folder to unpack into [default: the archive's name without .zip]
    #[arg(short, long, value_name = "DIR", value_hint = ValueHint::DirPath)]
    pub(crate) output: Option<PathBuf>,
}

/// Unpacks; gives the text to print.
pub(crate) fn unpack(args: &UnpackArgs) -> Result<String> {
    let folder = args.output.clone().unwrap_or_else(|| args.archive.with_extension(""));
    let scene = pack::unpack(&args.archive, &folder)?;
    Ok(format!("{}: every file is as it was packed", folder.join(scene).display()))
}
