//! The editor of render graphs: see every image, change any parameter or wire, keep the file yours.
//!
//! [`engine`] runs the graph on a thread of its own, [`document`] owns the file's text, [`reading`] turns numbers into
//! pictures; none of them knows the window..

pub mod camera;
pub mod document;
pub mod engine;
pub mod reading;
