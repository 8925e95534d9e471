//! Edges of the mesh, and the line segments that edge stages find. Mirrored by `shaders/shared/segments.wgsl`.

epigraph_core::constants! {
    /// The second face of a border in [`MeshEdge`].
    pub const NO_FACE: u32 = u32::MAX;
    /// The `kind` of an edge between two faces that meet smoothly.
    pub const REGULAR: u32 = 0;
    /// The `kind` of an edge between two faces that meet at more than the crease angle.
    pub const CREASE: u32 = 1;
    /// The `kind` of an edge with one face.
    pub const BORDER: u32 = 2;
    /// The kind of the boundary of a point light's shadow.
    pub const SHADOW_HARD: u32 = 0;
    /// The kind of the boundary of a quad light's full shadow.
    pub const SHADOW_UMBRA: u32 = 1;
    /// The kind of the boundary of a quad light's partial shadow.
    pub const SHADOW_PENUMBRA: u32 = 2;
}

epigraph_core::item! {
    /// An edge of the scene's mesh.
    pub struct MeshEdge {
        /// Indices of its ends, the lower first.
        vertices: [u32; 2],
        /// Indices of the faces on both sides, the lower first; [`NO_FACE`] second for a border.
        faces: [u32; 2],
        /// [`REGULAR`], [`CREASE`] or [`BORDER`].
        kind: u32,
        /// Pads the size to a multiple of 8 bytes.
        pad: u32,
    }
}

epigraph_core::item! {
    /// A line segment in the world across which the image may be discontinuous.
    pub struct Segment {
        /// One end, metres.
        a: [f32; 3],
        /// Of the boundary of a shadow: see [`shadow_flags`]; 0 for other edges.
        flags: u32,
        /// The other end, metres.
        b: [f32; 3],
        /// Index of the edge of the mesh that it comes from.
        edge: u32,
    }
}

/// The flags of a shadow's boundary: its kind in bits 0 and 1; in bits 16 to 31 the width of its penumbra in metres, as
/// the upper half of an f32, rounded up. A penumbra wider than a few pixels is not a step in the image, so its
/// boundaries are not edges then (`algorithms.md` section 11.2).
pub fn shadow_flags(kind: u32, penumbra: f32) -> u32 {
    (penumbra.max(0.0).to_bits().saturating_add(0xFFFF) & 0xFFFF_0000) | kind
}

/// The width of the penumbra across a segment with these flags, metres on the receiver; 0 if the edge is sharp.
pub fn penumbra_width(flags: u32) -> f32 {
    f32::from_bits(flags & 0xFFFF_0000)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn elements_are_laid_out_as_in_wgsl() {
        assert_eq!(size_of::<MeshEdge>(), 24);
        assert_eq!(size_of::<Segment>(), 32);
    }
    #[test]
    fn flags_hold_the_width_of_a_penumbra() {
        for width in [0.0, 1e-30, 0.001, 1.0, 1.001, 2e7, f32::INFINITY] {
            let flags = shadow_flags(SHADOW_UMBRA, width);
            let kept = penumbra_width(flags);
            assert!(kept >= width && (kept <= width * (1.0 + 1.0 / 128.0)), "{width}: {kept}");
            assert_eq!(flags & 3, SHADOW_UMBRA);
        }
        assert_eq!(penumbra_width(0), 0.0);
    }

    #[test]
    fn widths_are_rounded_up_at_the_last_bit() {
        for (bits, kept) in
            [(0x3F80_0000, 0x3F80_0000), (0x3F80_0001, 0x3F81_0000), (0x3F80_FFFF, 0x3F81_0000)]
        {
            assert_eq!(shadow_flags(0, f32::from_bits(bits)), kept, "{bits:#x}");
        }
    }
}
