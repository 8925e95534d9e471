//! `epigraph`, the command line: renders graphs, checks them, lists stages, renders references, compares images,
//! takes the time, shows a gallery, and measures how good pictures are.
//!
//! Every command gives exit code 0 on success, 1 when its input is wrong, and 130 when it was interrupted. Progress goes to
//! stderr, results to stdout.
//!
//! A program with stages of its own is the same command line with another registry:
//!
//! ```no_run
//! use std::process::ExitCode;
//!
//! fn main() -> ExitCode {
//!     // ... .with::<MyStage>()
//!     epigraph_cli::main(epigraph::registry())
//! }
//! ```

mod args;
mod axis;
mod bench;
mod check;
mod compare;
mod edge_mask;
mod error;
mod gallery;
mod interrupt;
mod open;
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

use std::{process::ExitCode, sync::Arc};

use clap::Parser;
use epigraph::Registry;

use args::{Cli, Command};
use error::CliError;

/// Exit code of a program that a signal has ended, as shells have it: 128 and the number of SIGINT.
const INTERRUPTED: u8 = 130;

/// Runs the command line of this process with these kinds of stage.
pub fn main(registry: Registry) -> ExitCode {
    let cli = match Cli::try_parse() {
        Ok(cli) => cli,
        Err(message) => {
            // Nothing can be done where even the message cannot be written.
            let _ = message.print();
            return if message.use_stderr() { ExitCode::FAILURE } else { ExitCode::SUCCESS };
        }
    };
    interrupt::watch();
    match run(cli, &Arc::new(registry)) {
        Ok(code) => code,
        Err(CliError::Interrupted) => {
            eprintln!("{}", CliError::Interrupted);
            ExitCode::from(INTERRUPTED)
        }
        Err(error) => {
            eprintln!("error: {error}");
            ExitCode::FAILURE
        }
    }
}

fn run(cli: Cli, registry: &Arc<Registry>) -> Result<ExitCode, CliError> {
    let done = |()| ExitCode::SUCCESS;
    match cli.command {
        None => render::render(&cli.render, registry),
        Some(Command::Render(args)) => render::render(&args, registry),
        Some(Command::Check(args)) => check::check(&args, registry),
        Some(Command::Stages(args)) => stages::stages(&args, registry).map(done),
        Some(Command::Reference(args)) => reference::reference(&args).map(done),
        Some(Command::Compare(args)) => compare::compare(&args).map(done),
        Some(Command::Bench(args)) => bench::bench(&args, registry).map(done),
        Some(Command::Gallery(args)) => gallery::gallery(&args, registry).map(done),
        Some(Command::Quality(args)) => quality::quality(&args, registry).map(done),
    }
}
