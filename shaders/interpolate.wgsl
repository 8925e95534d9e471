// Colours every pixel from the samples in its 5x5 pixels that no edge parts from it, and says how much a new sample
// there is worth.

#import frame
#import cloud
#import color
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

// Pixels to each side of the centre, and on each side of the kernel.
const REACH: i32 = 2;
const SPAN: u32 = 5u;

// Most cells along an axis of a pixel.
const CELLS: u32 = 16u;

// The sum of the weights of five samples in the centres of their pixels along an axis, and of all 25.
const AXIS: f32 = 2048.0;
const FULL: f32 = 4194304.0;

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
// For each row or column of cells, the weights along that axis of a sample in it at each offset + REACH.
var<workgroup> axis: array<f32, 80>;

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

// The weight along an axis at a distance in pixels, before it is scaled.
fn kernel(distance: f32) -> f32 {
    if params.kernel == GAUSSIAN {
        return exp(-distance * distance / (2.0 * params.sigma * params.sigma));
    }
    let d = i32(round(abs(distance)));
    return select(select(1.0, 4.0, d == 1), 6.0, d == 0);
}

// Entry `i` of `axis`.
fn axis_weight(i: u32) -> f32 {
    let cells = f32(1u << (params.subpixel_bits / 2u));
    let pixel = f32(i % SPAN) - f32(REACH);
    var aside = (f32(i / SPAN) + 0.5) / cells - 0.5;
    if params.kernel != GAUSSIAN {
        aside = 0.0;
    }
    let scale = AXIS / (kernel(0.0) + 2.0 * (kernel(1.0) + kernel(2.0)));
    // However far it is, a sample that is reached counts.
    return max(floor(kernel(pixel + aside) * scale + 0.5), 1.0);
}

@compute @workgroup_size(16, 16, 1)
fn interpolate(
    @builtin(workgroup_id) tile: vec3<u32>,
    @builtin(local_invocation_id) local: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    let corner = vec2<i32>(tile.xy * TILE) - REACH;
    if lane < CELLS * SPAN {
        axis[lane] = axis_weight(lane);
    }
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
    let shift = params.subpixel_bits / 2u;
    let mask = (1u << shift) - 1u;
    for (var dy = 0u; dy < SPAN; dy++) {
        for (var dx = 0u; dx < SPAN; dx++) {
            let sample = samples[(local.y + dy) * SIDE + local.x + dx];
            if sample.w >= 0.0 && ((counts >> (SPAN * dy + dx)) & 1u) != 0u {
                let cell = u32(sample.w);
                let weight = axis[(cell & mask) * SPAN + dx] * axis[((cell >> shift) & mask) * SPAN + dy];
                sum += weight * vec4(sample.rgb, 1.0);
            }
        }
    }

    let share = min(sum.w / FULL, 1.0);
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
    // In 1/256, to the nearest. Exact, as the share is a whole number of 1 / FULL.
    let missing = u32((1.0 - share) * 256.0 + 0.5);
    if params.priority == MEASURED {
        // In whole numbers: 255 * (missing / 256)^6, to about the nearest.
        let cube = (missing * missing * missing) >> 9u;
        return (255u * ((cube * cube) >> 8u) + 0x200000u) >> 22u;
    }
    return 255u * missing / 256u;
}
