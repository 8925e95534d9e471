//! `epigraph`, the command line: renders graphs, checks them, lists stages, renders references, compares images,
//! takes the time, shows a gallery, and measures how good pictures are.
//!
//! Every command gives exit code 0 on success and 1 when its input is wrong. Progress goes to stderr, results to stdout.

mod args;
mod axis;
mod bench;
mod check;
mod compare;
mod edge_mask;
mod error;
mod gallery;
mod graph_source;
mod memory;
mod output;
mod progress;
mod quality;
mod reference;
mod render;
mod report;
mod sheet;
mod stages;
mod svg;
mod table;
mod values;

use std::process::ExitCode;

use clap::Parser;

use args::{Cli, Command};
use error::CliError;

fn main() -> ExitCode {
    let cli = match Cli::try_parse() {
        Ok(cli) => cli,
        Err(message) => {
            // Nothing can be done where even the message cannot be written.
            let _ = message.print();
            return if message.use_stderr() { ExitCode::FAILURE } else { ExitCode::SUCCESS };
        }
    };
    match run(cli) {
        Ok(code) => code,
        Err(error) => {
            eprintln!("error: {error}");
            ExitCode::FAILURE
        }
    }
}

fn run(cli: Cli) -> Result<ExitCode, CliError> {
    let done = |()| ExitCode::SUCCESS;
    match cli.command {
        None => render::render(&cli.render).map(done),
        Some(Command::Render(args)) => render::render(&args).map(done),
        Some(Command::Check(args)) => check::check(&args),
        Some(Command::Stages(args)) => stages::stages(&args).map(done),
        Some(Command::Reference(args)) => reference::reference(&args).map(done),
        Some(Command::Compare(args)) => compare::compare(&args).map(done),
        Some(Command::Bench(args)) => bench::bench(&args).map(done),
        Some(Command::Gallery(args)) => gallery::gallery(&args).map(done),
        Some(Command::Quality(args)) => quality::quality(&args).map(done),
    }
}
