//! Luminance and the encoding of colours. Mirrored by `shaders/shared/color.wgsl`.

/// Relative luminance of a linear Rec. 709 colour.
pub fn luminance([r, g, b]: [f32; 3]) -> f32 {
    0.2126 * r + 0.7152 * g + 0.0722 * b
}

/// The linear value of an sRGB code between 0 and 1 (IEC 61966-2-1).
pub fn decode_srgb(code: f64) -> f64 {
    if code <= 0.04045 { code / 12.92 } else { ((code + 0.055) / 1.055).powf(2.4) }
}
