//! The command line: arguments in, library calls, sentences out.

pub(crate) mod progress;
pub(crate) mod render;
mod run_render;

use clap::{Parser, Subcommand};

/// A distributed ray tracer for moving pictures: glTF in, frame sequences and interlaced video out.
#[derive(Debug, Parser)]
#[command(name = "graeco", version, about, arg_required_else_help = true, max_term_width = 110)]
pub(crate) struct Cli {
    #[command(subcommand)]
    pub(crate) command: Command,
}

#[derive(Debug, Subcommand)]
pub(crate) enum Command {
    /// Render frames of a glTF file with motion blur, depth of field and soft shadows
    Render(Box<render::RenderArgs>),
}

impl Cli {
    /// Does what was asked.
    pub(crate) fn run(&self) -> graeco::Result<()> {
        match &self.command {
            Command::Render(args) => run_render::run(args),
        }
    }
}
