//! Unit vectors on an unfolded octahedron, as point sets have them. Mirrored by `shaders/shared/octahedral.wgsl`.

use epigraph_scenes::streams;

epigraph_core::constants! {
    /// The code of a zero normal: -32768 twice, which no unit vector maps to.
    pub const NO_NORMAL: u32 = streams::NO_NORMAL;
}

pub use streams::{pack_normal as encode_oct16, unpack_direction as decode_oct16};
