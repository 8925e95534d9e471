//! The editor of render graphs: see every image, and change any parameter or wire without reformatting the file.
//!
//! [`engine`] runs the graph on a thread of its own, [`document`] owns the file's text; neither knows the window. A
//! [`session`] holds them together, and [`app`] shows it in [`panes`]. Panes push their requests to the window as
//! [`intent`]s, which the window handles once all are drawn; dialogs and session do not know each other.
//!
//! A program with stages of its own is the same editor with another registry:
//!
//! ```no_run
//! use std::process::ExitCode;
//!
//! fn main() -> ExitCode {
//!     // ... .with::<MyStage>()
//!     epigraph_editor::main(epigraph::registry())
//! }
//! ```

pub mod app;
pub mod beside;
pub mod camera;
pub mod dialog;
mod differences;
pub mod document;
pub mod engine;
pub mod files;
mod handle;
mod help;
pub mod inspect;
pub mod intent;
pub mod jobs;
mod keyboard;
mod menu;
mod name;
mod offers;
pub mod opening;
pub mod output;
pub mod panes;
mod perform;
mod program;
pub mod pulse;
pub mod route;
pub mod session;
mod status;
pub mod store;
mod task;
mod theme;
mod toolbar;
pub mod widgets;

pub use program::main;
