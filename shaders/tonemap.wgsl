// Linear Rec. 709 radiance to sRGB bytes.

#import color
#import frame

struct Params {
    exposure: f32,
    curve: u32,
}

// Bits of infinity.
const INFINITY: u32 = 0x7F800000u;

@group(0) @binding(1) var<uniform> params: Params;
@group(0) @binding(2) var color: texture_2d<f32>;
@group(0) @binding(3) var image: texture_storage_2d<rgba8unorm, write>;

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
    let shown = show(textureLoad(color, pixel.xy, 0).rgb * exp2(params.exposure));
    // Rounded here: the rounding of a store depends on the device.
    textureStore(image, pixel.xy, vec4(floor(shown * 255.0 + 0.5) / 255.0, 1.0));
}
