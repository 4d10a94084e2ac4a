//! The command line: arguments in, library calls, sentences out.

mod adaptive_args;
mod check;
mod compare;
mod design;
mod farm;
mod info;
mod merge;
mod output_args;
mod pack;
mod plan;
mod progress;
mod render;
mod run_parts;
mod run_render;
mod sheet;
mod shot;
mod shot_args;
mod study_cost;
mod study_designs;
mod study_designs_scene;
mod study_dither;
mod study_error;
mod study_farm;
mod study_mirror;
mod study_motion;
mod study_patterns;
mod study_spectrum;
mod study_texture;
mod view_args;

use clap::{Parser, Subcommand};
use std::process::ExitCode;

/// A distributed ray tracer for moving pictures: glTF in, frame sequences and interlaced video out.
#[derive(Debug, Parser)]
#[command(name = "graeco", version, about, arg_required_else_help = true, max_term_width = 110)]
pub(crate) struct Cli {
    #[command(subcommand)]
    command: Command,
}

/// What means nothing to a sheet of small pictures.
const HIDDEN_IN_SHEETS: [&str; 10] =
    ["crop", "video", "wide", "interlace", "line_height", "pulldown", "scan", "readout", "pixel_aspect", "aov"];

#[derive(Debug, Subcommand)]
enum Command {
    /// Render frames of a glTF file with motion blur, depth of field and soft shadows
    Render(Box<render::RenderArgs>),
    /// Join parts of frames, rendered by many machines, to the pictures that one machine makes
    Merge(Box<merge::MergeArgs>),
    /// Print what a glTF file holds, and what of it is not supported
    Info(info::InfoArgs),
    /// Tell which effects a frame calls for, what is sampled, and by which design
    Plan(Box<plan::PlanArgs>),
    /// Tell which frames of a folder are missing, corrupt or made with other settings
    Check(check::CheckArgs),
    /// Show every glTF file of a folder as one small labelled picture: a contact sheet
    #[command(
        mut_arg("scene", |one| one.value_name("FOLDER").help("Folder of .gltf and .glb files, looked through with its subfolders, or one file")),
        mut_arg("size", |one| one.long("cell").help("Width and height of each picture in pixels [default: 160x120]")),
        mut_arg("runs", |one| one.default_value("16")),
        mut_args(|one| { let hide = HIDDEN_IN_SHEETS.contains(&one.get_id().as_str()); one.hide(hide) })
    )]
    Sheet(Box<sheet::SheetArgs>),
    /// Measure how much two pictures differ
    Compare(compare::CompareArgs),
    /// Write the points of a sampling design, or print its square
    Design(design::DesignArgs),
    #[command(subcommand, arg_required_else_help = true)]
    Farm(farm::FarmCommand),
    /// Put a scene and every file that it refers to into one file, with their hashes
    Pack(pack::PackArgs),
    /// Take a packed scene apart into a folder, and check every file
    Unpack(pack::UnpackArgs),
    /// Measure designs and pictures
    #[command(subcommand, arg_required_else_help = true)]
    Study(Study),
}

#[derive(Debug, Subcommand)]
enum Study {
    // A study takes a list of runs where rendering takes one number.
    #[command(mut_arg("runs", |one| one.long("runs-of-render").short('R').hide(true)))]
    Cost(Box<study_cost::StudyCostArgs>),
    #[command(mut_arg("runs", |one| one.long("runs-of-render").short('R').hide(true)))]
    Error(Box<study_error::StudyErrorArgs>),
    Designs(study_designs::StudyDesignsArgs),
    Dither(study_dither::StudyDitherArgs),
    Farm(study_farm::StudyFarmArgs),
    Patterns(study_patterns::StudyPatternsArgs),
    Spectrum(study_spectrum::StudySpectrumArgs),
    Motion(Box<study_motion::StudyMotionArgs>),
    #[command(mut_arg("scene", |one| one.required(false).default_value("animations/mirror.glb")))]
    Mirror(Box<study_mirror::StudyMirrorArgs>),
    #[command(
        mut_arg("scene", |one| one.required(false).default_value("checker")),
        mut_arg("runs", |one| one.long("runs-of-render").short('R').hide(true)),
        mut_arg("texture_filter", |one| one.hide(true))
    )]
    Texture(Box<study_texture::StudyTextureArgs>),
}

impl Cli {
    /// Does what was asked.
    pub(crate) fn run(&self) -> graeco::Result<ExitCode> {
        match &self.command {
            Command::Render(args) => run_render::run(args)?,
            Command::Merge(args) => merge::run(args)?,
            Command::Info(args) => info::run(args)?,
            Command::Plan(args) => say(&plan::run(args)?),
            Command::Design(args) => design::run(args)?,
            Command::Farm(command) => say(&farm::run(command)?),
            Command::Pack(args) => say(&pack::run(args)?),
            Command::Unpack(args) => say(&pack::unpack(args)?),
            Command::Compare(args) => say(&compare::run(args)?),
            Command::Sheet(args) => sheet::run(args)?,
            Command::Check(args) => {
                let (text, well) = check::run(args)?;
                say(&text);
                if !well {
                    return Ok(ExitCode::FAILURE);
                }
            }
            Command::Study(Study::Cost(args)) => study_cost::run(args)?,
            Command::Study(Study::Error(args)) => say(&study_error::run(args)?),
            Command::Study(Study::Designs(args)) => study_designs::run(args)?,
            Command::Study(Study::Dither(args)) => study_dither::run(args)?,
            Command::Study(Study::Farm(args)) => study_farm::run(args)?,
            Command::Study(Study::Patterns(args)) => study_patterns::run(args)?,
            Command::Study(Study::Spectrum(args)) => study_spectrum::run(args)?,
            Command::Study(Study::Motion(args)) => study_motion::run(args)?,
            Command::Study(Study::Mirror(args)) => study_mirror::run(args)?,
            Command::Study(Study::Texture(args)) => study_texture::run(args)?,
        }
        Ok(ExitCode::SUCCESS)
    }
}

/// Prints a command's answer. A reader that has gone away (`| head`) is no failure.
fn say(text: &str) {
    use std::io::Write as _;
    let _ = writeln!(std::io::stdout(), "{text}");
}
