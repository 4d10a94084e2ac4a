//! `graeco`, the command line.
#![allow(clippy::print_stderr, clippy::print_stdout, reason = "a program speaks to its user")]

mod cli;

use clap::Parser;
use graeco::Error;
use std::process::ExitCode;

/// What the user asked for cannot be: clap ends with the same.
const EXIT_USAGE: u8 = 2;
/// Worth retrying: what schedulers take for "requeue me" (`EX_TEMPFAIL` of sysexits.h).
const EXIT_RETRY: u8 = 75;
/// What a shell reports for a program that an interrupt ended.
const EXIT_INTERRUPTED: u8 = 130;

fn main() -> ExitCode {
    let report = std::panic::take_hook();
    std::panic::set_hook(Box::new(move |panic| {
        if !graeco::scene::in_guarded_decoder() {
            report(panic);
        }
    }));
    let cli = cli::Cli::parse();
    match cli.run() {
        Ok(code) => code,
        Err(error) => {
            eprintln!("graeco: {error}");
            match error {
                Error::Interrupted { .. } => ExitCode::from(EXIT_INTERRUPTED),
                Error::Invalid { .. } => ExitCode::from(EXIT_USAGE),
                e if e.worth_retrying() => ExitCode::from(EXIT_RETRY),
                _ => ExitCode::FAILURE,
            }
        }
    }
}
