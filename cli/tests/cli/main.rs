//! The program as users run it: what it prints, writes and returns.

mod bad_input;
mod bench;
mod commands;
mod gallery;
mod quality;
mod support;
