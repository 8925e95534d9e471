//! The editor of render graphs: see every image, change any parameter or wire, keep the file yours.
//!
//! [`engine`] runs the graph on a thread of its own, [`document`] owns the file's text; neither
//! knows the window. A [`session`] holds them together, and [`app`] shows it in [`panes`]. What panes want of the window
//! they push as [`intent`]s, which the window handles once all are drawn; dialogs and session do not know each other.

pub mod app;
pub mod beside;
pub mod camera;
pub mod dialog;
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
pub mod opening;
pub mod output;
pub mod panes;
mod perform;
pub mod pulse;
pub mod route;
pub mod session;
mod status;
pub mod store;
mod task;
mod theme;
mod toolbar;
