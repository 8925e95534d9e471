//! Rounds radiance to what a format holds, as if the image had that format.

#import cloud
#import color
#import frame

struct Params {
    /// The format; alpha stays as it is.
    /// = Rgba32Float of Rgba32Float, Rgba16Float, Rgb9e5Ufloat, Rg11b10Ufloat, Rgba8UnormSrgb
    format: u32,
}

@group(0) @binding(1) var<uniform> params: Params;
/// = means radiance
@group(0) @binding(2) var color: texture_2d<f32>;
/// The same, rounded.
/// = means radiance
@group(0) @binding(3) var rounded: texture_storage_2d<rgba32float, write>;

// The nearest 16-bit float.
fn half_float(value: f32) -> f32 {
    return unpack2x16float(pack2x16float(vec2(value, 0.0))).x;
}

// The nearest float without sign, with 5 bits of exponent as a 16-bit float, but fewer of fraction.
fn small_float(value: f32, fraction: u32) -> f32 {
    let step = 1u << (10u - fraction);
    let bits = pack2x16float(vec2(max(value, 0.0), 0.0));
    return unpack2x16float((bits + step / 2u) & ~(step - 1u)).x;
}

// The sRGB curve of values from 0 to 1.
fn encode_srgb(light: vec3<f32>) -> vec3<f32> {
    return select(1.055 * pow(light, vec3(1.0 / 2.4)) - 0.055, 12.92 * light, light <= vec3(0.0031308));
}

fn in_format(light: vec3<f32>) -> vec3<f32> {
    if params.format == FORMAT_RGBA16_FLOAT {
        return vec3(half_float(light.r), half_float(light.g), half_float(light.b));
    }
    if params.format == FORMAT_RGB9E5_UFLOAT {
        return decode_radiance(encode_radiance(light));
    }
    if params.format == FORMAT_RG11B10_UFLOAT {
        return vec3(small_float(light.r, 6u), small_float(light.g, 6u), small_float(light.b, 5u));
    }
    if params.format == FORMAT_RGBA8_UNORM_SRGB {
        return decode_srgb(round(encode_srgb(clamp(light, vec3(0.0), vec3(1.0))) * 255.0) / 255.0);
    }
    return light;
}

@compute @workgroup_size(8, 8)
fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    if any(id.xy >= frame.size) {
        return;
    }
    let light = textureLoad(color, id.xy, 0);
    textureStore(rounded, id.xy, vec4(in_format(light.rgb), light.a));
}
