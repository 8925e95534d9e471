// Linear Rec. 709 radiance to sRGB bytes. With AUTO, three passes before the last one find the exposure from the picture.

#import color
#import frame
#import index

struct Params {
    exposure: f32,
    curve: u32,
    percentile: u32,
}

// Bits of infinity.
const INFINITY: u32 = 0x7F800000u;

@group(0) @binding(1) var<uniform> params: Params;
@group(0) @binding(2) var color: texture_2d<f32>;
@group(0) @binding(3) var image: texture_storage_2d<rgba8unorm, write>;

#ifdef AUTO
// The bits of positive floats grow like their logarithm, nearly, so all of this is arithmetic on integers: both sides
// find the same white. `stages/src/tonemap/auto.rs` mirrors it, and explains the constants.

// Bits of the smallest float that counts as light.
const LIGHT: u32 = 0x00800000u;

const THREADS: u32 = 256u;

@group(0) @binding(4) var<storage, read_write> histogram: array<atomic<u32>>;
@group(0) @binding(5) var<storage, read_write> white: array<f32>;

// The histogram of this workgroup's pixels; zero at its start, as all workgroup memory is.
var<workgroup> counted: array<atomic<u32>, BINS>;

// The bin of a colour by its brightest channel; BINS if it has no light, or a channel that is not finite.
fn bin(c: vec3<f32>) -> u32 {
    let bits = bitcast<vec3<u32>>(c);
    if any((bits & vec3(0x7FFFFFFFu)) >= vec3(INFINITY)) {
        return BINS;
    }
    // Negative floats have the highest bit.
    let positive = select(bits, vec3(0u), bits > vec3(INFINITY));
    let brightest = max(max(positive.r, positive.g), positive.b);
    let place = (max(brightest, DARKEST) - DARKEST) >> BIN_SHIFT;
    return select(BINS, min(place, BINS - 1u), brightest >= LIGHT);
}

@compute @workgroup_size(256, 1, 1)
fn clear(@builtin(global_invocation_id) id: vec3<u32>) {
    if id.x < BINS {
        atomicStore(&histogram[id.x], 0u);
    }
}

@compute @workgroup_size(256, 1, 1)
fn count(
    @builtin(global_invocation_id) id: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    let threads = groups.x * groups.y * THREADS;
    for (var i = linear_index(id, groups, THREADS); i < frame.size.x * frame.size.y; i += threads) {
        let place = bin(textureLoad(color, vec2(i % frame.size.x, i / frame.size.x), 0).rgb);
        if place < BINS {
            atomicAdd(&counted[place], 1u);
        }
    }
    workgroupBarrier();
    for (var i = lane; i < BINS; i += THREADS) {
        let pixels = atomicLoad(&counted[i]);
        if pixels > 0u {
            atomicAdd(&histogram[i], pixels);
        }
    }
}

// Bits of the white below which `percentile` of the counted pixels are; 0 if none is counted.
fn fitting() -> u32 {
    var count = 0u;
    for (var i = 0u; i < BINS; i++) {
        count += atomicLoad(&histogram[i]);
    }
    // The product alone could overflow.
    let rank = max(count / 100u * params.percentile + count % 100u * params.percentile / 100u, 1u);
    var before = 0u;
    for (var i = 0u; i < BINS; i++) {
        let pixels = atomicLoad(&histogram[i]);
        if before + pixels >= rank {
            let step = (rank - before) * STEPS / pixels;
            return DARKEST + (i << BIN_SHIFT) + (step << BIN_SHIFT) / STEPS;
        }
        before += pixels;
    }
    return 0u;
}

@compute @workgroup_size(1, 1, 1)
fn adapt() {
    let fit = fitting();
    if fit == 0u {
        return;
    }
    let now = bitcast<u32>(white[0]);
    let away = i32(fit) - i32(now);
    let beyond = sign(away) * max(abs(away) - BAND, 0);
    white[0] = bitcast<f32>(select(u32(i32(now) + beyond / SLOWNESS), fit, now == 0u));
}

fn gain() -> f32 {
    return select(1.0 / white[0], 1.0, white[0] == 0.0);
}
#else
fn gain() -> f32 {
    return exp2(params.exposure);
}
#endif

// The sRGB encoding of values between 0 and 1 (IEC 61966-2-1).
fn encode(value: vec3<f32>) -> vec3<f32> {
    let curve = 1.055 * pow(value, vec3(1.0 / 2.4)) - 0.055;
    return select(curve, 12.92 * value, value <= vec3(0.0031308));
}

fn show(c: vec3<f32>) -> vec3<f32> {
    // A shader compiler may assume that there is no NaN and no infinity, so test the bits.
    let bits = bitcast<vec3<u32>>(c);
    if any((bits & vec3(0x7FFFFFFFu)) > vec3(INFINITY)) {
        return vec3(1.0, 0.0, 1.0);
    }
    if any(bits == vec3(INFINITY)) {
        return vec3(1.0);
    }
    var scale = 1.0;
    if params.curve == CURVE_REINHARD {
        scale = 1.0 / (1.0 + max(luminance(c), 0.0));
    }
    return encode(clamp(c * scale, vec3(0.0), vec3(1.0)));
}

@compute @workgroup_size(8, 8, 1)
fn tonemap(@builtin(global_invocation_id) pixel: vec3<u32>) {
    if any(pixel.xy >= frame.size) {
        return;
    }
    let shown = show(textureLoad(color, pixel.xy, 0).rgb * gain());
    // Rounded here: the rounding of a store depends on the device.
    textureStore(image, pixel.xy, vec4(floor(shown * 255.0 + 0.5) / 255.0, 1.0));
}
