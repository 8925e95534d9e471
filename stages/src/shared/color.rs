//! Luminance of colours. Mirrored by `shaders/shared/color.wgsl`.

/// Relative luminance of a linear Rec. 709 colour.
pub fn luminance([r, g, b]: [f32; 3]) -> f32 {
    0.2126 * r + 0.7152 * g + 0.0722 * b
}
