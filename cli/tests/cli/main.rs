//! The program as users run it: what it prints, writes and returns.

mod bad_input;
mod bench;
#[cfg(target_os = "linux")]
mod browser;
mod changes;
mod commands;
mod gallery;
#[cfg(target_os = "linux")]
mod habits;
mod installed;
// Signals of other systems are sent in other ways.
#[cfg(target_os = "linux")]
mod interrupt;
#[cfg(target_os = "linux")]
mod kills;
#[cfg(unix)]
mod outputs;
#[cfg(target_os = "linux")]
mod page;
mod quality;
mod repeats;
mod scenes;
mod streams;
mod support;
mod tradeoff;
mod watch;
