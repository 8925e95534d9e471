// Colours every pixel from the samples in its 5x5 pixels that no edge parts from it, and says how much a new sample
// there is worth.

#import frame
#import cloud
#import edge_pixel

struct Params {
    kernel: u32,
    sigma: f32,
    subpixel_bits: u32,
    space: u32,
    priority: u32,
}

const GAUSSIAN: u32 = 0u;
const TONE_MAPPED: u32 = 1u;
const MEASURED: u32 = 0u;
const NO_POINT: u32 = 0xFFFFFFFFu;

// Pixels to each side of the centre.
const REACH: i32 = 2;

// Pixels on each side of a workgroup's tile, and of what its kernels reach.
const TILE: u32 = 16u;
const SIDE: u32 = 20u;

@group(0) @binding(1) var<uniform> params: Params;
@group(0) @binding(2) var<storage, read> cloud_radiance: array<u32>;
@group(0) @binding(3) var<storage, read> cloud_meta: array<u32>;
@group(0) @binding(4) var<storage, read> id: array<u32>;
@group(0) @binding(5) var<storage, read> cls: array<u32>;
@group(0) @binding(6) var<storage, read> r24: array<u32>;
@group(0) @binding(7) var<storage, read> subpixel: array<u32>;
@group(0) @binding(8) var color: texture_storage_2d<rgba32float, write>;
@group(0) @binding(9) var<storage, read_write> priority: array<u32>;

// The samples of the tile and around it: radiance, and the cell in the pixel; -1 where there is none.
var<workgroup> samples: array<vec4<f32>, 400>;

// Relative luminance of a linear Rec. 709 colour.
fn luminance(c: vec3<f32>) -> f32 {
    return 0.2126 * c.r + 0.7152 * c.g + 0.0722 * c.b;
}

fn load(q: vec2<i32>) -> vec4<f32> {
    if any(q < vec2(0)) || any(q >= vec2<i32>(frame.size)) {
        return vec4(0.0, 0.0, 0.0, -1.0);
    }
    let p = u32(q.y) * frame.size.x + u32(q.x);
    if id[p] == NO_POINT {
        return vec4(0.0, 0.0, 0.0, -1.0);
    }
    var radiance = decode_radiance(cloud_radiance[id[p]]);
    if params.space == TONE_MAPPED {
        radiance /= 1.0 + luminance(radiance);
    }
    return vec4(radiance, f32(subpixel[p]));
}

// Which of the 25 pixels of the kernel count, bit 12 being the pixel itself.
fn taps(p: u32) -> u32 {
    if (cls[p] & CLASS) == COMPLEX {
        return 0x1FFFFFFu;
    }
    // r24 leaves out the centre.
    return (r24[p] & 0xFFFu) | (1u << 12u) | ((r24[p] & 0xFFF000u) << 1u);
}

// The weight along both axes of a sample at these distances.
fn gaussian(distance: vec2<f32>) -> f32 {
    return exp(-dot(distance, distance) / (2.0 * params.sigma * params.sigma));
}

fn binomial(d: i32) -> f32 {
    return select(select(1.0, 4.0, abs(d) == 1), 6.0, d == 0);
}

// The weight of a pixel at offset `d` whose sample lies in this cell.
fn weight_of(d: vec2<i32>, cell: u32) -> f32 {
    if params.kernel != GAUSSIAN {
        return binomial(d.x) * binomial(d.y);
    }
    let shift = params.subpixel_bits / 2u;
    let cells = 1u << shift;
    let place = vec2(cell & (cells - 1u), (cell >> shift) & (cells - 1u));
    return gaussian(vec2<f32>(d) + (vec2<f32>(place) + 0.5) / f32(cells) - 0.5);
}

// The sum of all 25 weights of samples in the centres.
fn full_weight() -> f32 {
    if params.kernel != GAUSSIAN {
        return 256.0;
    }
    let axis = 1.0 + 2.0 * (gaussian(vec2(1.0, 0.0)) + gaussian(vec2(2.0, 0.0)));
    return axis * axis;
}

@compute @workgroup_size(16, 16, 1)
fn interpolate(
    @builtin(workgroup_id) tile: vec3<u32>,
    @builtin(local_invocation_id) local: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    let corner = vec2<i32>(tile.xy * TILE) - REACH;
    for (var i = lane; i < SIDE * SIDE; i += TILE * TILE) {
        samples[i] = load(corner + vec2<i32>(vec2(i % SIDE, i / SIDE)));
    }
    workgroupBarrier();

    let pixel = tile.xy * TILE + local.xy;
    if any(pixel >= frame.size) {
        return;
    }
    let p = pixel.y * frame.size.x + pixel.x;
    let counts = taps(p);
    var sum = vec4(0.0);
    for (var dy = 0u; dy < 5u; dy++) {
        for (var dx = 0u; dx < 5u; dx++) {
            let sample = samples[(local.y + dy) * SIDE + local.x + dx];
            if sample.w >= 0.0 && ((counts >> (5u * dy + dx)) & 1u) != 0u {
                let weight = weight_of(vec2<i32>(vec2(dx, dy)) - REACH, u32(sample.w));
                sum += weight * vec4(sample.rgb, 1.0);
            }
        }
    }

    let share = min(sum.w / full_weight(), 1.0);
    var result = vec4(0.0);
    if sum.w > 0.0 {
        result = vec4(sum.rgb / sum.w, share);
        if params.space == TONE_MAPPED {
            result = vec4(result.rgb / max(1.0 - luminance(result.rgb), 1e-5), share);
        }
    }
    textureStore(color, pixel, result);

    if id[p] == NO_POINT {
        priority[p] = without_point(share);
    } else {
        priority[p] = with_point(cloud_meta[id[p]] & AGE);
    }
}

// Priority of a pixel that shows a point of this age, in 8.8 fixed point.
fn with_point(age: u32) -> u32 {
    if params.priority == MEASURED {
        return age / (2u * AGE_ONE);
    }
    return min(age / AGE_ONE, 254u);
}

// Priority of a pixel without a point for which this share of the kernel's weight was there.
fn without_point(share: f32) -> u32 {
    let missing = 1.0 - share;
    if params.priority == MEASURED {
        let cube = missing * missing * missing;
        return u32(255.0 * cube * cube + 0.5);
    }
    return u32(255.0 * missing);
}
