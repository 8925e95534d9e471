// Colours every pixel from the samples in its 5x5 pixels that no edge separates from it, and computes how much a new
// sample there is worth.

#ifdef ALBEDO
#import albedo
#endif
#import cloud
#import color
#import edge_pixel
#import frame
#import pixel
#ifdef NOISE
#import requests
#endif
#ifdef UNCERTAIN
#import estimate
#import octahedral
#import view
#endif

struct Params {
    kernel: u32,
    sigma: f32,
    subpixel_bits: u32,
    space: u32,
    priority: u32,
    variance: u32,
    uncertain: u32,
}

// Maximum number of cells along an axis of a pixel.
const CELLS: u32 = 16u;

// Pixels on each side of a workgroup's tile, without and with the radius of its kernels.
const GROUP: u32 = 16u;
const SIDE: u32 = GROUP + 2u * REACH;

@group(0) @binding(1) var<uniform> params: Params;
@group(0) @binding(2) var<storage, read> cloud_radiance: array<u32>;
@group(0) @binding(3) var<storage, read> cloud_meta: array<u32>;
@group(0) @binding(4) var<storage, read> id: array<u32>;
@group(0) @binding(5) var<storage, read> cls: array<u32>;
@group(0) @binding(6) var<storage, read> r24: array<u32>;
@group(0) @binding(7) var<storage, read> subpixel: array<u32>;
@group(0) @binding(8) var color: texture_storage_2d<rgba32float, write>;
@group(0) @binding(9) var<storage, read_write> priority: array<u32>;
#ifdef NOISE
@group(0) @binding(10) var<storage, read> cloud_mean: array<vec4<f32>>;
#endif
#ifdef VARIANCE
@group(0) @binding(11) var<storage, read_write> variance: array<f32>;
#endif
#ifdef UNCERTAIN
@group(0) @binding(12) var<storage, read> cloud_record: array<vec4<f32>>;
#endif

#ifdef ALBEDO
@group(0) @binding(13) var<storage, read> albedos: array<vec2<u32>>;
@group(0) @binding(14) var<storage, read_write> albedo: array<u32>;
#endif

// The samples of the tile and around it: radiance, and the cell in the pixel; -1 if there is none.
var<workgroup> samples: array<vec4<f32>, SIDE * SIDE>;
// For each row or column of cells, the weights along that axis of a sample in it at each offset + REACH.
var<workgroup> axis: array<f32, CELLS * SPAN>;

#ifdef NOISE
// Luminance and its variance, of the same samples.
var<workgroup> noise: array<vec2<f32>, SIDE * SIDE>;

fn load_noise(q: vec2<i32>) -> vec2<f32> {
    if is_outside(q) {
        return vec2(0.0);
    }
    let point = id[pixel_index(vec2<u32>(q))];
    if point == NO_POINT {
        return vec2(0.0);
    }
    let mean = cloud_mean[point];
    return vec2(luminance(mean.rgb), mean.w);
}

// Sums over samples, from which follows the variance of their weighted mean.
struct Scatter {
    weights: f32,
    squared_weights: f32,
    // Of squared weights times variances, where these are known.
    known: f32,
    // Of squared weights of the other samples.
    unknown: f32,
    luminance: f32,
    squared_luminance: f32,
}

fn add_sample(sums: ptr<function, Scatter>, weight: f32, sample: vec2<f32>) {
    let squared = weight * weight;
    (*sums).weights += weight;
    (*sums).squared_weights += squared;
    (*sums).known += squared * max(sample.y, 0.0);
    (*sums).unknown += select(0.0, squared, sample.y < 0.0);
    (*sums).luminance += weight * sample.x;
    (*sums).squared_luminance += weight * sample.x * sample.x;
}

// Mean luminance and variance of one of these samples. A single one is as uncertain as it is bright.
fn one_of(sums: Scatter) -> vec2<f32> {
    let mean = sums.luminance / sums.weights;
    let between = max(sums.squared_luminance / sums.weights - mean * mean, 0.0);
    let share = 1.0 - sums.squared_weights / (sums.weights * sums.weights);
    return vec2(mean, select(mean * mean, between / share, share > LEAST_SHARE));
}

// The variance of the mean of independent samples. Those that do not know their own have that of the samples around them.
fn variance_of_mean(sums: Scatter) -> f32 {
    if sums.weights <= 0.0 {
        return UNKNOWN;
    }
    return (sums.known + sums.unknown * one_of(sums).y) / (sums.weights * sums.weights);
}
#endif

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
        let q = corner + vec2<i32>(vec2(i % SIDE, i / SIDE));
        samples[i] = load(q);
#ifdef NOISE
        noise[i] = load_noise(q);
#endif
    }
    workgroupBarrier();

    let pixel = tile.xy * GROUP + local.xy;
    if any(pixel >= frame.size) {
        return;
    }
    let p = pixel_index(pixel);
    let counts = taps(p);
    var sum = vec4(0.0);
#ifdef NOISE
    var scatter = Scatter();
#endif
    let shift = params.subpixel_bits / 2u;
    let mask = (1u << shift) - 1u;
    for (var dy = 0u; dy < SPAN; dy++) {
        for (var dx = 0u; dx < SPAN; dx++) {
            let sample = samples[(local.y + dy) * SIDE + local.x + dx];
            if sample.w >= 0.0 && ((counts >> (SPAN * dy + dx)) & 1u) != 0u {
                let cell = u32(sample.w);
                let weight = axis[(cell & mask) * SPAN + dx] * axis[((cell >> shift) & mask) * SPAN + dy];
                sum += weight * vec4(sample.rgb, 1.0);
#ifdef NOISE
                add_sample(&scatter, weight / FULL, noise[(local.y + dy) * SIDE + local.x + dx]);
#endif
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
#ifdef VARIANCE
    variance[p] = variance_of_mean(scatter);
#endif

    if id[p] == NO_POINT {
        priority[p] = without_point(share);
    } else {
        priority[p] = with_point(cloud_meta[id[p]] & AGE);
    }
#ifdef UNCERTAIN
    priority[p] = uncertain(priority[p], pixel, id[p], scatter);
#endif
}

#ifdef ALBEDO
// The mean albedo of the samples around each pixel, with the same weights. A pass of its own, since devices limit what one
// may bind.
@compute @workgroup_size(16, 16, 1)
fn mean_albedo(
    @builtin(global_invocation_id) pixel: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    if lane < CELLS * SPAN {
        axis[lane] = axis_weight(lane);
    }
    workgroupBarrier();
    if any(pixel.xy >= frame.size) {
        return;
    }
    let p = pixel_index(pixel.xy);
    let counts = taps(p);
    let shift = params.subpixel_bits / 2u;
    let mask = (1u << shift) - 1u;
    var sum = vec4(0.0);
    for (var dy = 0u; dy < SPAN; dy++) {
        for (var dx = 0u; dx < SPAN; dx++) {
            let at = vec2<i32>(pixel.xy + vec2(dx, dy)) - i32(REACH);
            if ((counts >> (SPAN * dy + dx)) & 1u) == 0u || is_outside(at) {
                continue;
            }
            let q = pixel_index(vec2<u32>(at));
            if id[q] == NO_POINT {
                continue;
            }
            let cell = subpixel[q];
            let weight = axis[(cell & mask) * SPAN + dx] * axis[((cell >> shift) & mask) * SPAN + dy];
            sum += weight * vec4(unpack_mean(albedos[id[q]]), 1.0);
        }
    }
    albedo[p] = NO_ALBEDO;
    if sum.w > 0.0 {
        albedo[p] = encode_albedo(sum.rgb / sum.w);
    }
}
#endif

#ifdef UNCERTAIN
// The priority of a pixel, given that by age and emptiness.
fn uncertain(by_age: u32, pixel: vec2<u32>, point: u32, around: Scatter) -> u32 {
    var found = 0.0;
    if point != NO_POINT {
        let direction = direction_through(frame.view, vec2<f32>(pixel) + 0.5, frame.size);
        found = shown_variance_of(cloud_mean[point], cloud_record[point], -normalize(direction));
    }
    var factor = MOST_UNCERTAINTY;
    if around.weights > 0.0 {
        let one = one_of(around);
        found = max(found, shown_variance(one.x, one.y));
        // The root of the deviation, so that the noisiest places do not get nearly all samples. In 1/16, so that the sides
        // round alike.
        factor = clamp(sqrt(sqrt(found)) * UNCERTAINTY_GAIN, LEAST_UNCERTAINTY, MOST_UNCERTAINTY);
    }
    return min(by_age * u32(factor) / 16u, 255u);
}
#endif

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
