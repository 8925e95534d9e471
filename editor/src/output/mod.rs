//! What leaves the editor: the command line that makes the same picture, the frames of a path.

mod command_line;
mod frames;

pub use command_line::CommandLine;
pub use frames::{Format, sink};
