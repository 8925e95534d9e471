// In the place of `antialias`: blurs every pixel a little, where that stage mixes colours only in pixels that an edge cuts.

struct Params {
    /// Weight of the four pixels at the corners, together.
    /// = 0.5 in 0..1
    weight: f32,
}

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var primary: texture_2d<f32>;
@group(0) @binding(2) var color: texture_storage_2d<rgba32float, write>;

@compute @workgroup_size(8, 8)
fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    let last = vec2<i32>(textureDimensions(primary)) - 1;
    var corners = vec4(0.0);
    for (var i = 0; i < 4; i++) {
        let at = vec2<i32>(id.xy) + 2 * vec2(i % 2, i / 2) - 1;
        corners += 0.25 * textureLoad(primary, clamp(at, vec2(0), last), 0);
    }
    textureStore(color, id.xy, mix(textureLoad(primary, id.xy, 0), corners, params.weight));
}
