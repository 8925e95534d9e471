//! The program `epigraph` with the stages of the algorithms; see the library for what it does.

use std::process::ExitCode;

fn main() -> ExitCode {
    epigraph_cli::main(epigraph::registry())
}
