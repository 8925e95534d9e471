//! Integration tests of whole graphs: errors, shipped graphs, agreement of CPU and GPU, and quality.

mod broken;
mod complex;
mod documents;
mod epi;
mod experiments;
mod exposure;
mod extremes;
mod library;
mod measures;
mod meshes;
mod moving;
mod noise;
mod parity;
mod pruning;
mod render_cache;
mod repeats;
mod shipped;
mod sides;
mod split;
mod still;
mod streams;
mod swap;
mod user_shader;
mod watch;
mod wgsl_docs;
mod wgsl_nodes;
