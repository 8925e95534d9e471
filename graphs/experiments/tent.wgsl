//! Colours every pixel from the samples around it that no edge separates from it, weighted by a tent.
//!
//! Takes the place of `interpolate`: the same ports, one kernel, and the rule of the priority in two lines.
//! = column I2

#import cloud
#import edge_pixel
#import frame
#import pixel

struct Params {
    /// Half the width of the tent: the distance at which a sample no longer counts.
    /// = 1.5 in 0.5..2.5 unit px
    radius: f32,
    /// Bits of the cells in `subpixel`, as in `project`.
    /// = 8 in 2..8 unit bits
    subpixel_bits: u32,
}

@group(0) @binding(1) var<uniform> params: Params;
/// = field of cloud, means points
@group(0) @binding(2) var<storage, read> cloud_radiance: array<u32>;
/// = field of cloud
@group(0) @binding(3) var<storage, read> cloud_meta: array<u32>;
/// The point that each pixel shows, NO_POINT for none.
/// = per pixel, means id
@group(0) @binding(4) var<storage, read> id: array<u32>;
/// = per pixel, means class
@group(0) @binding(5) var<storage, read> cls: array<u32>;
/// Which of the 24 pixels around it each pixel reaches, a bit each, in reading order.
/// = per pixel, means reach
@group(0) @binding(6) var<storage, read> r24: array<u32>;
/// The point's cell in the pixel, row by row.
/// = per pixel, means cell
@group(0) @binding(7) var<storage, read> subpixel: array<u32>;
/// Linear radiance of the primary region; alpha: the share of the kernel's weight that was there.
/// = per pixel, means radiance
@group(0) @binding(8) var color: texture_storage_2d<rgba32float, write>;
/// How much a sample is worth, 0 to 255.
/// = output, per pixel, means priority
@group(0) @binding(9) var<storage, read_write> priority: array<u32>;

// Where a pixel's sample lies in it, 0 to 1 from the top left corner.
fn place(p: u32) -> vec2<f32> {
    let bits = params.subpixel_bits / 2u;
    let cell = vec2(subpixel[p] & ((1u << bits) - 1u), subpixel[p] >> bits);
    return (vec2<f32>(cell) + 0.5) / f32(1u << bits);
}

fn tent(distance: vec2<f32>) -> f32 {
    let sides = max(1.0 - abs(distance) / params.radius, vec2(0.0));
    return sides.x * sides.y;
}

// Whether pixel `p` may use the sample of the k-th of its 25 pixels, in reading order. A complex pixel uses all.
fn reaches(p: u32, k: u32) -> bool {
    if k == 12u || (cls[p] & CLASS) == COMPLEX {
        return true;
    }
    return (r24[p] >> select(k, k - 1u, k > 12u) & 1u) != 0u;
}

@compute @workgroup_size(8, 8)
fn interpolate(@builtin(global_invocation_id) at: vec3<u32>) {
    if any(at.xy >= frame.size) {
        return;
    }
    let p = pixel_index(at.xy);
    var sum = vec4(0.0);
    var full = 0.0;
    for (var k = 0u; k < 25u; k++) {
        let offset = vec2<i32>(vec2(k % 5u, k / 5u)) - 2;
        full += tent(vec2<f32>(offset));
        let q = vec2<i32>(at.xy) + offset;
        if is_outside(q) {
            continue;
        }
        let other = pixel_index(vec2<u32>(q));
        if id[other] == NO_POINT || !reaches(p, k) {
            continue;
        }
        // A sample that the pixel reaches counts a little, however far it is.
        let weight = max(tent(vec2<f32>(offset) + place(other) - 0.5), 1e-3);
        sum += vec4(decode_radiance(cloud_radiance[id[other]]), 1.0) * weight;
    }
    let share = min(sum.a / full, 1.0);
    textureStore(color, at.xy, vec4(sum.rgb / max(sum.a, 1e-3), share));
    // An old sample, or missing weight, makes a new one worth more.
    if id[p] != NO_POINT {
        priority[p] = (cloud_meta[id[p]] & AGE) / (2u * AGE_ONE);
    } else {
        priority[p] = u32(round(255.0 * pow(1.0 - share, 6.0)));
    }
}
