//! Tests of single panes.

mod inspector;
mod parameters;
mod texts;
mod times;
