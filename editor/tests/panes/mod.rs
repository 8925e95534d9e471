//! Tests of single panes.

mod inspector;
mod nodes;
mod parameters;
mod texts;
mod times;
