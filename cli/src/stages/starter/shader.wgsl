//! Blends each pixel with the mean of the 3x3 pixels around it.

// A stage in one file: rewrite it as you like. The variables below are its ports, the members of `Params` its
// parameters, the entry points its passes. `///` comments document them, and lines that begin with `=` declare more:
// `epigraph stages wgsl` lists all such declarations, `epigraph stages STARTER.wgsl` says how this file is understood.

// The view, the frame's size and index, as `frame`.
#import frame

struct Params {
    /// Weight of the mean; 0 keeps the picture as it is.
    /// = 0.5 in 0..1
    amount: f32,
}

@group(0) @binding(1) var<uniform> params: Params;
/// Linear radiance.
@group(0) @binding(2) var color: texture_2d<f32>;
/// Linear radiance, smoothed.
/// = means radiance
@group(0) @binding(3) var smoothed: texture_storage_2d<rgba32float, write>;

// One thread for each pixel of `smoothed`.
@compute @workgroup_size(8, 8)
fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    // Workgroups at the right and lower border reach beyond the image.
    if any(id.xy >= frame.size) {
        return;
    }
    var sum = vec4(0.0);
    for (var i = 0; i < 9; i++) {
        let at = vec2<i32>(id.xy) + vec2(i % 3, i / 3) - 1;
        // Pixels at the border stand in for those beyond it.
        sum += textureLoad(color, clamp(at, vec2(0), vec2<i32>(frame.size) - 1), 0);
    }
    textureStore(smoothed, id.xy, mix(textureLoad(color, id.xy, 0), sum / 9.0, params.amount));
}
