// Luminance and the encoding of colours. Mirrors `stages/src/shared/color.rs`.

// Relative luminance of a linear Rec. 709 colour.
fn luminance(c: vec3<f32>) -> f32 {
    return 0.2126 * c.r + 0.7152 * c.g + 0.0722 * c.b;
}

// Luminance Y as Y / (1 + Y): from 0 to 1, and never steeper than Y.
fn tone_mapped_luma(y: f32) -> f32 {
    return y / (1.0 + y);
}

// The linear values of sRGB codes between 0 and 1 (IEC 61966-2-1).
fn decode_srgb(code: vec3<f32>) -> vec3<f32> {
    return select(pow((code + 0.055) / 1.055, vec3(2.4)), code / 12.92, code <= vec3(0.04045));
}
