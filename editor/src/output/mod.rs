//! The editor's output: the command line that renders the same picture, and the recorded frames of a path.

mod command_line;
mod frames;

pub use command_line::CommandLine;
pub use frames::{Format, sink};
