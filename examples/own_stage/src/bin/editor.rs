//! The editor of Epigraph with the stage `median`.

use std::process::ExitCode;

fn main() -> ExitCode {
    epigraph_editor::main(own_stage::registry())
}
