//! What a person does from beginning to end.

mod keyboard;
mod output;
mod paths;
mod sessions;
