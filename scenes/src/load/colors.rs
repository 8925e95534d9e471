//! Colours of vertices in files.
//!
//! OBJ and PLY do not say what their numbers mean. They are sRGB: Blender converts them on both ways, three.js on the way
//! in, and scanners and MeshLab copy them from photographs.

use glam::Vec4;

use crate::texture::decode_srgb;

/// Colours in sRGB, with opacity, as factors on a material's colour: linear. Numbers above 1 mean that all are bytes, 0 to
/// 255, but for the opacities. What is not a number remains so.
pub(super) fn linear(colors: &mut [Vec4]) {
    let are_bytes = colors.iter().any(|color| color.truncate().max_element() > 1.0);
    let unit = if are_bytes { 255.0 } else { 1.0 };
    for color in colors {
        let [red, green, blue, opacity] = color.to_array();
        let [red, green, blue] =
            [red, green, blue].map(|code| decode_srgb((code / unit).clamp(0.0, 1.0).into()) as f32);
        *color = Vec4::new(red, green, blue, opacity.clamp(0.0, 1.0));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn codes_of_both_scales_become_light() {
        let mut shares = [Vec4::new(0.0, 0.5, 1.0, 0.5), Vec4::new(0.02, 0.04, -1.0, 2.0), Vec4::NAN];
        linear(&mut shares);
        let expected = [Vec4::new(0.0, 0.214_041, 1.0, 0.5), Vec4::new(0.02 / 12.92, 0.04 / 12.92, 0.0, 1.0)];
        assert!(shares.iter().zip(expected).all(|(a, b)| a.distance(b) < 1e-5), "{shares:?}");
        assert!(shares[2].is_nan_mask().all());
        let mut bytes = [Vec4::new(0.0, 127.5, 255.0, 1.0), Vec4::new(1.0, 255.0, 0.0, 1.0)];
        linear(&mut bytes);
        let expected = [Vec4::new(0.0, 0.214_041, 1.0, 1.0), Vec4::new(1.0 / 255.0 / 12.92, 1.0, 0.0, 1.0)];
        assert!(bytes.iter().zip(expected).all(|(a, b)| a.distance(b) < 1e-5), "{bytes:?}");
        // A little more than 1 is a dark byte, and the largest byte the most that there is.
        let mut beyond = [Vec4::new(1.5, 255.0, 600.0, 1.0), Vec4::new(1.5, -9.0, 0.0, 1.0)];
        linear(&mut beyond);
        assert_eq!([beyond[0].y, beyond[0].z, beyond[1].y], [1.0, 1.0, 0.0]);
        let mut dark = [Vec4::new(1.5, 0.0, 0.0, 1.0)];
        linear(&mut dark);
        assert!((dark[0].x - 1.5 / 255.0 / 12.92).abs() < 1e-7, "{dark:?}");
    }
}
