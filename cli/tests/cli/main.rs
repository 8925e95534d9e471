//! The program as users run it: what it prints, writes and returns.

mod bad_input;
mod commands;
mod support;
