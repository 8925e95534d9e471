//! Whole tasks of a user, from beginning to end.

mod keyboard;
mod output;
mod paths;
mod sessions;
