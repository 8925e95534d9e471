//! Shared by several stages: element types, codecs and helpers, mirrored by `shaders/shared/`.

pub mod albedo;
pub mod cloud;
pub mod color;
pub mod edge_pixel;
pub mod estimate;
pub mod lanes;
pub mod moves;
pub mod nearer;
pub mod octahedral;
pub mod random;
pub mod renewal;
pub mod requests;
pub mod sample;
pub mod scan;
pub mod segments;
pub mod shadow_cache;
pub mod source;
pub mod streams;
#[cfg(test)]
pub mod testing;
pub mod view;
pub mod words;
pub mod world;
