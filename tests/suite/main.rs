//! Integration tests: broken graphs and their messages, shipped graphs, parity of the sides.

mod broken;
mod complex;
mod documents;
mod epi;
mod extremes;
mod library;
mod meshes;
mod moving;
mod parity;
mod render_cache;
mod shipped;
mod split;
mod still;
mod user_shader;
