#import frame
struct Params {
    /// Draw a line where the depth jumps by this share.
    /// = 0.1 in 0..1
    jump: f32,
}
@group(0) @binding(1) var<uniform> params: Params;
@group(0) @binding(2) var color: texture_2d<f32>;
@group(0) @binding(3) var<storage, read> depth: array<f32>;
@group(0) @binding(4) var outlined: texture_storage_2d<rgba32float, write>;
@compute @workgroup_size(8, 8)
fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    if any(id.xy >= frame.size) { return; }
    let right = min(id.x + 1u, frame.size.x - 1u);
    let here = depth[id.y * frame.size.x + id.x];
    let there = depth[id.y * frame.size.x + right];
    let line = f32(abs(here - there) > params.jump * here);
    textureStore(outlined, id.xy, textureLoad(color, id.xy, 0) * (1.0 - line));
}
