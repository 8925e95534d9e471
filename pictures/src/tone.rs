//! Between linear light and sRGB (IEC 61966-2-1).

/// A linear value, clamped to [0, 1] (NaN becomes 0), as sRGB in [0, 1].
pub fn encode(linear: f32) -> f32 {
    let linear = unit(linear);
    if linear <= 0.003_130_8 { 12.92 * linear } else { 1.055 * linear.powf(1.0 / 2.4) - 0.055 }
}

/// The linear value that sRGB has in [0, 1].
pub fn decode(srgb: f32) -> f32 {
    if srgb <= 0.040_45 { srgb / 12.92 } else { ((srgb + 0.055) / 1.055).powf(2.4) }
}

/// A value in [0, 1] as a byte, rounded to nearest.
pub fn to_byte(value: f32) -> u8 {
    (unit(value) * 255.0 + 0.5) as u8
}

/// A value clamped to [0, 1]; NaN becomes 0.
fn unit(value: f32) -> f32 {
    if value > 0.0 { value.min(1.0) } else { 0.0 }
}

/// A linear colour as sRGB bytes.
pub fn to_srgb8(linear: [f32; 3]) -> [u8; 3] {
    linear.map(|channel| to_byte(encode(channel)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn known_values() {
        // 0.214041 is sRGB 0.5; 18% grey is 118 of 255.
        assert!((encode(0.214_041) - 0.5).abs() < 1e-5);
        assert_eq!(to_srgb8([0.18, 0.0, 1.0]), [118, 0, 255]);
        assert_eq!(to_srgb8([f32::NAN, -3.0, f32::INFINITY]), [0, 0, 255]);
    }

    #[test]
    fn bytes_become_light_and_back() {
        assert!((decode(0.5) - 0.214_041).abs() < 1e-6);
        for byte in 0..=u8::MAX {
            assert_eq!(to_byte(encode(decode(f32::from(byte) / 255.0))), byte);
        }
    }
}
