// Luminance of colours. Mirrors `stages/src/shared/color.rs`.

// Relative luminance of a linear Rec. 709 colour.
fn luminance(c: vec3<f32>) -> f32 {
    return 0.2126 * c.r + 0.7152 * c.g + 0.0722 * c.b;
}
