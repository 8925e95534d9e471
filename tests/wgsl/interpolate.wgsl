//! Colours every pixel from the samples in its 5x5 pixels that no edge separates from it, and computes how much a new
//! sample there is worth.
//! = column I2

#import cloud
#import color
#import edge_pixel
#import frame
#import pixel

struct Params {
    /// How the weight of a sample depends on its position.
    /// = Gaussian of Gaussian, Binomial
    kernel: u32,
    /// Standard deviation of the Gaussian. Between 0.6, which keeps detail, and 0.8, which hides noise.
    /// = 0.7 in 0.3..2 unit px
    sigma: f32,
    /// Bits of the cells in `subpixel`, as in `project`.
    /// = 8 in 2..8 unit bits
    subpixel_bits: u32,
    /// What is averaged.
    /// = Linear of Linear, ToneMapped
    space: u32,
    /// How the priority of a pixel depends on its surroundings.
    /// = Measured of Measured, Classic
    priority: u32,
}

// Radius and width of the kernel in pixels, and the bits of all its pixels.
const REACH: u32 = 2u;
const SPAN: u32 = 2u * REACH + 1u;
const ALL: u32 = 0x1FFFFFFu;
// The sum of the weights of five samples in the centres of their pixels along an axis, and of all 25.
const AXIS: f32 = 2048.0;
const FULL: f32 = AXIS * AXIS;

// Maximum number of cells along an axis of a pixel.
const CELLS: u32 = 16u;

// Pixels on each side of a workgroup's tile, without and with the radius of its kernels.
const GROUP: u32 = 16u;
const SIDE: u32 = GROUP + 2u * REACH;

@group(0) @binding(1) var<uniform> params: Params;
/// = field of cloud, means points
@group(0) @binding(2) var<storage, read> cloud_radiance: array<u32>;
/// = field of cloud
@group(0) @binding(3) var<storage, read> cloud_meta: array<u32>;
/// = per pixel
@group(0) @binding(4) var<storage, read> id: array<u32>;
/// = per pixel, means class
@group(0) @binding(5) var<storage, read> cls: array<u32>;
/// = per pixel, means reach
@group(0) @binding(6) var<storage, read> r24: array<u32>;
/// = per pixel, means cell
@group(0) @binding(7) var<storage, read> subpixel: array<u32>;
/// Linear radiance of the primary region; alpha: the share of the kernel's weight that was there.
/// = per pixel, means radiance
@group(0) @binding(8) var color: texture_storage_2d<rgba32float, write>;
/// = output, per pixel
@group(0) @binding(9) var<storage, read_write> priority: array<u32>;

// The samples of the tile and around it: radiance, and the cell in the pixel; -1 if there is none.
var<workgroup> samples: array<vec4<f32>, SIDE * SIDE>;
// For each row or column of cells, the weights along that axis of a sample in it at each offset + REACH.
var<workgroup> axis: array<f32, CELLS * SPAN>;

fn load(q: vec2<i32>) -> vec4<f32> {
    if is_outside(q) {
        return vec4(0.0, 0.0, 0.0, -1.0);
    }
    let p = pixel_index(vec2<u32>(q));
    if id[p] == NO_POINT {
        return vec4(0.0, 0.0, 0.0, -1.0);
    }
    var radiance = decode_radiance(cloud_radiance[id[p]]);
    if params.space == SPACE_TONE_MAPPED {
        radiance /= 1.0 + luminance(radiance);
    }
    return vec4(radiance, f32(subpixel[p]));
}

// Which of the 25 pixels of the kernel count; bit 12 is the pixel itself.
fn taps(p: u32) -> u32 {
    if (cls[p] & CLASS) == COMPLEX {
        return ALL;
    }
    // r24 does not include the centre.
    return (r24[p] & 0xFFFu) | (1u << 12u) | ((r24[p] & 0xFFF000u) << 1u);
}

// The unscaled weight along an axis at a distance in pixels.
fn kernel(distance: f32) -> f32 {
    if params.kernel == KERNEL_GAUSSIAN {
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
    if params.kernel != KERNEL_GAUSSIAN {
        aside = 0.0;
    }
    let scale = AXIS / (kernel(0.0) + 2.0 * (kernel(1.0) + kernel(2.0)));
    // Every reached sample counts, however far it is.
    return max(floor(kernel(pixel + aside) * scale + 0.5), 1.0);
}

@compute @workgroup_size(16, 16, 1)
fn interpolate(
    @builtin(workgroup_id) tile: vec3<u32>,
    @builtin(local_invocation_id) local: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    let corner = vec2<i32>(tile.xy * GROUP) - i32(REACH);
    if lane < CELLS * SPAN {
        axis[lane] = axis_weight(lane);
    }
    for (var i = lane; i < SIDE * SIDE; i += GROUP * GROUP) {
        samples[i] = load(corner + vec2<i32>(vec2(i % SIDE, i / SIDE)));
    }
    workgroupBarrier();

    let pixel = tile.xy * GROUP + local.xy;
    if any(pixel >= frame.size) {
        return;
    }
    let p = pixel_index(pixel);
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
        if params.space == SPACE_TONE_MAPPED {
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
    if params.priority == PRIORITY_MEASURED {
        return age / (2u * AGE_ONE);
    }
    return min(age / AGE_ONE, 254u);
}

// Priority of a pixel without a point, given the present share of the kernel's weight.
fn without_point(share: f32) -> u32 {
    // In 1/256, to the nearest. Exact, as the share is a whole number of 1 / FULL.
    let missing = u32((1.0 - share) * 256.0 + 0.5);
    if params.priority == PRIORITY_MEASURED {
        // In whole numbers: 255 * (missing / 256)^6, to about the nearest.
        let cube = (missing * missing * missing) >> 9u;
        return (255u * ((cube * cube) >> 8u) + 0x200000u) >> 22u;
    }
    return 255u * missing / 256u;
}
