//! Whole tasks of a user, from beginning to end.

mod keyboard;
mod output;
mod own_stages;
mod paths;
mod sessions;
