//! What several stages share: element types, codecs and helpers, mirrored by `shaders/shared/`.

pub mod cloud;
pub mod requests;
#[cfg(test)]
pub mod testing;
pub mod view;
pub mod world;
