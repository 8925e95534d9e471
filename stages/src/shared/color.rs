//! Luminance and the encoding of colours. Mirrored by `shaders/shared/color.wgsl`.

/// Relative luminance of a linear Rec. 709 colour.
pub fn luminance([r, g, b]: [f32; 3]) -> f32 {
    0.2126 * r + 0.7152 * g + 0.0722 * b
}

/// Luminance Y as Y / (1 + Y): from 0 to 1, and never steeper than Y.
pub fn tone_mapped_luma(luminance: f32) -> f32 {
    luminance / (1.0 + luminance)
}

/// The linear value of an sRGB code between 0 and 1 (IEC 61966-2-1).
pub fn decode_srgb(code: f64) -> f64 {
    if code <= 0.04045 { code / 12.92 } else { ((code + 0.055) / 1.055).powf(2.4) }
}
