// Averages noisy colours along surfaces, without crossing edges: `stages/src/atrous.rs` explains the algorithm. Levels
// read one of two images and write the other; the last one writes `filtered` too. Taps lie in the even directions, to the
// sides.

#ifdef ALBEDO
#import albedo
#endif
#import color
#import edge_pixel
#import frame
#import pixel
#import requests

struct Params {
    levels: u32,
    tolerance: f32,
}

@group(0) @binding(1) var<uniform> params: Params;
@group(0) @binding(2) var color: texture_2d<f32>;
@group(0) @binding(3) var<storage, read> variance: array<f32>;
@group(0) @binding(4) var<storage, read> n8: array<u32>;
#ifdef ALBEDO
@group(0) @binding(10) var<storage, read> albedo: array<u32>;
#endif
@group(0) @binding(5) var filtered: texture_storage_2d<rgba32float, write>;
// Colour and variance.
@group(0) @binding(6) var<storage, read_write> even: array<vec4<f32>>;
@group(0) @binding(7) var<storage, read_write> odd: array<vec4<f32>>;
// Which taps of the next level can be reached: bit d for direction d. From ALBEDO_SHIFT on, the code of the albedo.
@group(0) @binding(8) var<storage, read_write> even_reach: array<u32>;
@group(0) @binding(9) var<storage, read_write> odd_reach: array<u32>;

// The variance of a pixel's light, without the albedo.
fn noise(p: u32) -> f32 {
#ifdef ALBEDO
    let share = luminance(decode_albedo(albedo[p]));
    return variance[p] / (share * share);
#else
    return variance[p];
#endif
}

// Variances are noisy themselves: each becomes the mean of those around that can be reached.
@compute @workgroup_size(8, 8, 1)
fn prepare(@builtin(global_invocation_id) pixel: vec3<u32>) {
    if any(pixel.xy >= frame.size) {
        return;
    }
    let p = pixel_index(pixel.xy);
    var taps = 0u;
    let own = noise(p);
    var sum = OWN_WEIGHT * own;
    var weights = OWN_WEIGHT;
    for (var d = 0u; d < 8u; d += 2u) {
        let at = vec2<i32>(pixel.xy) + direction(d);
        if ((n8[p] >> (4u * d)) & PRIMARY) == 0u || is_outside(at) {
            continue;
        }
        taps |= 1u << d;
        let there = noise(pixel_index(vec2<u32>(at)));
        if there >= 0.0 {
            sum += there;
            weights += 1.0;
        }
    }
    let smoothed = select(sum / weights, UNKNOWN, own < 0.0);
    var light = textureLoad(color, pixel.xy, 0).rgb;
#ifdef ALBEDO
    // A hole shows what it takes of others: it has no albedo of its own.
    let code = select(albedo[p], NO_ALBEDO, own < 0.0);
    light /= decode_albedo(code);
    taps |= code << ALBEDO_SHIFT;
#endif
    even[p] = vec4(light, smoothed);
    even_reach[p] = taps;
}

fn load(is_even: bool, p: u32) -> vec4<f32> {
    if is_even {
        return even[p];
    }
    return odd[p];
}

fn load_reach(is_even: bool, p: u32) -> u32 {
    if is_even {
        return even_reach[p];
    }
    return odd_reach[p];
}

fn average(pixel: vec2<u32>, level: u32) {
    if any(pixel >= frame.size) {
        return;
    }
    let is_even = level % 2u == 0u;
    let p = pixel_index(pixel);
    let own = load(is_even, p);
    let is_hole = own.w < 0.0;
    let own_weight = select(OWN_WEIGHT, 0.0, is_hole);
    var sum = own_weight * own.rgb;
    var weights = own_weight;
    var spread = own_weight * own_weight * own.w;
    // A hole takes any colour.
    let tolerance = params.tolerance * params.tolerance;
    let scale = select(1.0 / tolerance / max(own.w, LEAST_VARIANCE), 0.0, is_hole);
    let taps = load_reach(is_even, p);
    var reach = taps & ALBEDO_BITS;
#ifdef ALBEDO
    var albedos = vec4(0.0);
#endif
    for (var d = 0u; d < 8u; d += 2u) {
        let at = vec2<i32>(pixel) + direction(d) * (1 << level);
        if ((taps >> d) & 1u) == 0u || is_outside(at) {
            continue;
        }
        let q = pixel_index(vec2<u32>(at));
        reach |= load_reach(is_even, q) & (1u << d);
        let there = load(is_even, q);
        if there.w < 0.0 {
            continue;
        }
        let difference = luminance(abs(there.rgb - own.rgb));
        let like = max(1.0 - difference * difference * scale, 0.0);
        let tap = like * like;
        sum += tap * there.rgb;
        weights += tap;
        spread += tap * tap * there.w;
#ifdef ALBEDO
        if is_hole {
            albedos += vec4(decode_albedo(load_reach(is_even, q) >> ALBEDO_SHIFT), 1.0);
        }
#endif
    }
#ifdef ALBEDO
    // What a hole shows has the mean albedo of what it takes.
    if albedos.w > 0.0 {
        reach |= encode_albedo(albedos.rgb / albedos.w) << ALBEDO_SHIFT;
    }
#endif
    var result = own;
    if weights > 0.0 {
        result = vec4(sum / weights, spread / (weights * weights));
    }
    if is_even {
        odd[p] = result;
        odd_reach[p] = reach;
    } else {
        even[p] = result;
        even_reach[p] = reach;
    }
    if level + 1u == params.levels {
#ifdef ALBEDO
        result = vec4(result.rgb * decode_albedo(reach >> ALBEDO_SHIFT), result.w);
#endif
        textureStore(filtered, pixel, vec4(result.rgb, textureLoad(color, pixel, 0).a));
    }
}

@compute @workgroup_size(8, 8, 1)
fn level_0(@builtin(global_invocation_id) pixel: vec3<u32>) {
    average(pixel.xy, 0u);
}

@compute @workgroup_size(8, 8, 1)
fn level_1(@builtin(global_invocation_id) pixel: vec3<u32>) {
    average(pixel.xy, 1u);
}

@compute @workgroup_size(8, 8, 1)
fn level_2(@builtin(global_invocation_id) pixel: vec3<u32>) {
    average(pixel.xy, 2u);
}

@compute @workgroup_size(8, 8, 1)
fn level_3(@builtin(global_invocation_id) pixel: vec3<u32>) {
    average(pixel.xy, 3u);
}

@compute @workgroup_size(8, 8, 1)
fn level_4(@builtin(global_invocation_id) pixel: vec3<u32>) {
    average(pixel.xy, 4u);
}

@compute @workgroup_size(8, 8, 1)
fn level_5(@builtin(global_invocation_id) pixel: vec3<u32>) {
    average(pixel.xy, 5u);
}

@compute @workgroup_size(8, 8, 1)
fn level_6(@builtin(global_invocation_id) pixel: vec3<u32>) {
    average(pixel.xy, 6u);
}

@compute @workgroup_size(8, 8, 1)
fn level_7(@builtin(global_invocation_id) pixel: vec3<u32>) {
    average(pixel.xy, 7u);
}
