//! The program `epigraph` with the built-in stages; the library describes its commands.

use std::process::ExitCode;

fn main() -> ExitCode {
    epigraph_cli::main(epigraph::registry())
}
