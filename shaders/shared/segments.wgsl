// Edges of the mesh, and the line segments that edge stages find. Mirrors `stages/src/shared/segments.rs`, which
// declares the constants NO_FACE, REGULAR, CREASE, BORDER and SHADOW_HARD, SHADOW_UMBRA, SHADOW_PENUMBRA.

struct MeshEdge {
    vertices: vec2<u32>,
    faces: vec2<u32>,
    kind: u32,
    pad: u32,
}

struct Segment {
    a: vec3<f32>,
    flags: u32,
    b: vec3<f32>,
    edge: u32,
}

// The width of the penumbra across a segment with these flags, metres on the receiver; 0 if the edge is sharp.
fn penumbra_width(flags: u32) -> f32 {
    return bitcast<f32>(flags & 0xFFFF0000u);
}
