// Blends each pixel with the mean of the 3x3 pixels around it.

// The view, the frame's size and index, as `frame`.
#import frame

struct Params {
    amount: f32,
}

@group(0) @binding(1) var<uniform> params: Params;
@group(0) @binding(2) var color: texture_2d<f32>;
@group(0) @binding(3) var smoothed: texture_storage_2d<rgba32float, write>;

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
