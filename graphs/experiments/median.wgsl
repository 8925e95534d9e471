//! The median of the 3x3 pixels around, channel by channel: single pixels that stick out vanish.

#import frame

/// Linear radiance.
@group(0) @binding(1) var color: texture_2d<f32>;
/// Linear radiance, calmed.
/// = means radiance
@group(0) @binding(2) var calm: texture_storage_2d<rgba32float, write>;

@compute @workgroup_size(8, 8)
fn median(@builtin(global_invocation_id) id: vec3<u32>) {
    if any(id.xy >= frame.size) {
        return;
    }
    var values: array<vec3<f32>, 9>;
    for (var i = 0; i < 9; i++) {
        let at = vec2<i32>(id.xy) + vec2(i % 3, i / 3) - 1;
        values[i] = textureLoad(color, clamp(at, vec2(0), vec2<i32>(frame.size) - 1), 0).rgb;
    }
    // Five rounds of bubble sort, all channels at once, bring the five greatest to the end.
    for (var end = 8; end > 3; end--) {
        for (var i = 0; i < end; i++) {
            let low = min(values[i], values[i + 1]);
            values[i + 1] = max(values[i], values[i + 1]);
            values[i] = low;
        }
    }
    textureStore(calm, id.xy, vec4(values[4], textureLoad(color, id.xy, 0).a));
}
