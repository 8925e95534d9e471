//! The editor of render graphs: see every image, change any parameter or wire, keep the file yours.
//!
//! [`engine`] runs the graph on a thread of its own, [`document`] owns the file's text; neither
//! knows the window. A [`session`] holds them together, and [`app`] shows it in [`panes`].

pub mod app;
pub mod camera;
pub mod document;
pub mod engine;
pub mod panes;
pub mod session;
mod status;
mod theme;
mod toolbar;
