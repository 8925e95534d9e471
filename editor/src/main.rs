//! The program `epigraph-editor` with the stages of the algorithms; see the library for what it does.

use std::process::ExitCode;

fn main() -> ExitCode {
    epigraph_editor::main(epigraph::registry())
}
