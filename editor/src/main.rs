//! The program `epigraph-editor`, with the stages of the algorithms.

use std::process::ExitCode;

fn main() -> ExitCode {
    epigraph_editor::main(epigraph::registry())
}
