//! What a person does from beginning to end.

mod output;
mod paths;
mod sessions;
