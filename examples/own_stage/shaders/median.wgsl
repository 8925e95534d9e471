// Replaces pixels that are much brighter than the 3x3 pixels around them.

#import frame

struct Params {
    factor: f32,
}

@group(0) @binding(1) var<uniform> params: Params;
@group(0) @binding(2) var color: texture_2d<f32>;
@group(0) @binding(3) var calm: texture_storage_2d<rgba32float, write>;

@compute @workgroup_size(8, 8)
fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    if any(id.xy >= frame.size) {
        return;
    }
    // Sorts the nine pixels, each channel by itself: a new value takes its place, and larger ones move up. Pixels at the
    // border stand in for those beyond it.
    var sorted: array<vec4<f32>, 9>;
    for (var i = 0; i < 9; i++) {
        let at = vec2<i32>(id.xy) + vec2(i % 3 - 1, i / 3 - 1);
        var value = textureLoad(color, clamp(at, vec2(0), vec2<i32>(frame.size) - 1), 0);
        for (var j = 0; j < i; j++) {
            let larger = max(sorted[j], value);
            sorted[j] = min(sorted[j], value);
            value = larger;
        }
        sorted[i] = value;
    }
    let median = sorted[4];
    let here = textureLoad(color, id.xy, 0);
    textureStore(calm, id.xy, select(here, median, here > params.factor * median));
}
