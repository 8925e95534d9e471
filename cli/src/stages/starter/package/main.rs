//! The command line of Epigraph with the stage STARTER.

use std::process::ExitCode;

fn main() -> ExitCode {
    epigraph_cli::main(STARTER_stage::registry())
}
