//! `epigraph`, the command line: renders and checks graphs, lists stages, traces references, compares images, times
//! stages, makes a gallery, measures image quality and what it costs, and encodes point sets and meshes.
//!
//! Every command exits with code 0 on success, 1 if its input is wrong, and 130 if it is interrupted. Progress goes to
//! stderr, results to stdout.
//!
//! A program with its own stages uses the same command line with another registry:
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
mod blank;
mod check;
mod compare;
mod converged;
mod decode;
mod edge_mask;
mod encode;
mod error;
mod folder;
mod gallery;
mod interrupt;
mod machine;
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
mod tradeoff;
mod values;

use std::{process::ExitCode, sync::Arc};

use clap::Parser;
use epigraph::Registry;

use args::{Cli, Command};
use error::CliError;

/// Exit code of an interrupted program by the convention of shells: 128 plus the number of SIGINT.
const INTERRUPTED: u8 = 130;

/// Runs the command line of this process with the stage kinds of `registry`.
pub fn main(registry: Registry) -> ExitCode {
    let cli = match Cli::try_parse() {
        Ok(cli) => cli,
        Err(message) => {
            // Nothing can be done if even the message cannot be written.
            let _ = message.print();
            return if message.use_stderr() { ExitCode::FAILURE } else { ExitCode::SUCCESS };
        }
    };
    interrupt::watch();
    let registry = Arc::new(registry);
    match open::in_pool(cli.threads(), || run(cli, &registry)).and_then(|done| done) {
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
        Some(Command::Quality(args)) => quality::quality(&args, registry),
        Some(Command::Tradeoff(args)) => tradeoff::tradeoff(&args, registry),
        Some(Command::Encode(args)) => encode::encode(&args).map(done),
        Some(Command::Decode(args)) => decode::decode(&args).map(done),
    }
}
