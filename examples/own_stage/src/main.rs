//! The command line of Epigraph with the stage `median`.

use std::process::ExitCode;

fn main() -> ExitCode {
    epigraph_cli::main(own_stage::registry())
}
