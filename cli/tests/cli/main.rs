//! The program as users run it: what it prints, writes and returns.

mod bad_input;
mod bench;
mod changes;
mod commands;
mod gallery;
// Signals of other systems are sent in other ways.
mod installed;
#[cfg(target_os = "linux")]
mod interrupt;
mod quality;
mod support;
