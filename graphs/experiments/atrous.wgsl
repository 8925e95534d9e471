//! One level of an à-trous filter that stays within edges: it averages pixels 2^level apart.

#import color
#import edge_pixel
#import frame
#import pixel

struct Params {
    /// The taps are 2^level pixels away.
    /// = 0 in 0..8
    level: u32,
    /// Tolerance of brightness at level 0, in powers of two; halved from level to level.
    /// = 4 in 0.01..100
    sigma: f32,
}

@group(0) @binding(1) var<uniform> params: Params;
/// Linear radiance of the primary regions.
@group(0) @binding(2) var color: texture_2d<f32>;
/// Which regions of each pixel join which of its eight neighbours.
/// = per pixel, means joins
@group(0) @binding(3) var<storage, read> n8: array<u32>;
/// Linear radiance of the primary regions, averaged.
/// = means radiance
@group(0) @binding(4) var filtered: texture_storage_2d<rgba32float, write>;

// The bit of a neighbour in n8: both primary regions are joined.
const PRIMARY: u32 = 1u;
// Radiance below which a difference does not show.
const DARK: f32 = 0.01;

// The pixel that lies `steps` neighbours in direction d; outside the image if an edge is in the way.
fn walk(start: vec2<u32>, d: u32, steps: u32) -> vec2<i32> {
    var at = vec2<i32>(start);
    for (var i = 0u; i < steps; i++) {
        let joins = n8[pixel_index(vec2<u32>(at))] >> (4u * d);
        at += direction(d);
        if (joins & PRIMARY) == 0u || is_outside(at) {
            return vec2(-1);
        }
    }
    return at;
}

@compute @workgroup_size(8, 8)
fn average(@builtin(global_invocation_id) id: vec3<u32>) {
    if any(id.xy >= frame.size) {
        return;
    }
    let here = textureLoad(color, id.xy, 0);
    let tolerance = params.sigma * exp2(-f32(params.level));
    // The weights of the 3x3 binomial filter: 4 in the middle, 2 beside it, 1 in the corners.
    var sum = vec4(here.rgb, 1.0) * 4.0;
    for (var d = 0u; d < 8u; d++) {
        let at = walk(id.xy, d, 1u << params.level);
        if is_outside(at) {
            continue;
        }
        let there = textureLoad(color, at, 0);
        if there.a > 0.0 {
            let difference = log2((luminance(there.rgb) + DARK) / (luminance(here.rgb) + DARK)) / tolerance;
            sum += vec4(there.rgb, 1.0) * select(1.0, 2.0, d % 2u == 0u) * exp(-difference * difference);
        }
    }
    textureStore(filtered, id.xy, vec4(sum.rgb / sum.a, here.a));
}
