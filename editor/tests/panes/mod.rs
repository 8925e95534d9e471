//! Tests of single panes.

mod inspector;
mod texts;
mod times;
