//! Panes by themselves.

mod inspector;
mod texts;
mod times;
