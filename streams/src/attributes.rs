//! Colours and normals: means over the points of a cell, and how they are packed.

use std::sync::LazyLock;

use glam::{DVec3, Vec3};

use crate::points::{Point, Points};

/// The code of a normal that is zero: no unit vector is mapped to it.
pub const NO_NORMAL: u32 = 0x8000_8000;

/// Colours and normals of cells or points in some order; each as [`pack_color`] and [`pack_normal`] have it.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Attributes {
    pub(crate) colors: Option<Vec<u32>>,
    pub(crate) normals: Option<Vec<u32>>,
}

impl Attributes {
    /// The means of the points of each of `count` cells. `cell_of` has the index of a point's cell.
    pub(crate) fn means(
        given: &Points,
        points: &[Point],
        count: usize,
        cell_of: impl Fn(&Point) -> usize,
    ) -> Self {
        let colors = given.colors.as_ref().map(|colors| {
            let mut sums = vec![ColorSum::default(); count];
            for point in points {
                sums[cell_of(point)].add(colors[point.index as usize]);
            }
            sums.iter().map(|sum| pack_color(sum.mean())).collect()
        });
        let normals = given.normals.as_ref().map(|normals| {
            let mut sums = vec![DVec3::ZERO; count];
            for point in points {
                sums[cell_of(point)] += normals[point.index as usize].as_dvec3().normalize_or_zero();
            }
            sums.into_iter().map(|sum| pack_normal(sum.normalize_or_zero().as_vec3())).collect()
        });
        Self { colors, normals }
    }

    /// The attributes in another order: first those of index `order[0]`.
    pub(crate) fn reordered(&self, order: &[usize]) -> Self {
        let reordered =
            |values: &Option<Vec<u32>>| values.as_ref().map(|all| order.iter().map(|&i| all[i]).collect());
        Self { colors: reordered(&self.colors), normals: reordered(&self.normals) }
    }
}

/// A sum of colours: linear light in parts of [`FULL`], alpha in bytes.
#[derive(Clone, Copy, Default)]
struct ColorSum {
    light: [u64; 3],
    alpha: u64,
    count: u64,
}

impl ColorSum {
    fn add(&mut self, [red, green, blue, alpha]: [u8; 4]) {
        for (sum, byte) in self.light.iter_mut().zip([red, green, blue]) {
            *sum += u64::from(LIGHT.of_byte[usize::from(byte)]);
        }
        self.alpha += u64::from(alpha);
        self.count += 1;
    }

    /// The mean of the light, as the eye sees a cell whose points are too near each other to be told apart.
    fn mean(self) -> [u8; 4] {
        let count = self.count.max(1);
        let [red, green, blue] = self.light.map(|sum| LIGHT.byte(((sum + count / 2) / count) as u32));
        [red, green, blue, ((self.alpha + count / 2) / count) as u8]
    }
}

/// The light of white. Integers, so that sums do not depend on their order, nor much on how a machine rounds powers.
const FULL: f64 = (1 << 24) as f64;

/// The light of each sRGB byte, and the least light of each byte but 0.
struct Light {
    of_byte: [u32; 256],
    least: [u32; 255],
}

static LIGHT: LazyLock<Light> = LazyLock::new(|| {
    // IEC 61966-2-1.
    let light = |byte: f64| {
        let srgb = byte / 255.0;
        let linear = if srgb <= 0.040_45 { srgb / 12.92 } else { ((srgb + 0.055) / 1.055).powf(2.4) };
        (linear * FULL).round() as u32
    };
    Light {
        of_byte: std::array::from_fn(|byte| light(byte as f64)),
        least: std::array::from_fn(|byte| light(byte as f64 + 0.5)),
    }
});

impl Light {
    /// The byte that is nearest to some light, in sRGB.
    fn byte(&self, light: u32) -> u8 {
        self.least.partition_point(|&least| least <= light) as u8
    }
}

/// Linear light, 0 to 1, as the sRGB bytes that colours have. What is outside the range is moved to its end.
pub fn color_of_light(light: [f32; 3]) -> [u8; 3] {
    light.map(|light| LIGHT.byte((f64::from(light) * FULL).round() as u32))
}

/// A colour as a word: red in the lowest byte, then green, blue and alpha, as `unpack4x8unorm` of WGSL reads it.
pub fn pack_color(color: [u8; 4]) -> u32 {
    u32::from_le_bytes(color)
}

/// The inverse of [`pack_color`].
pub fn unpack_color(word: u32) -> [u8; 4] {
    word.to_le_bytes()
}

/// A unit vector, or zero, on an unfolded octahedron: two signed integers from -32,767 to 32,767, x in the low 16 bits
/// and y in the high ones. Zero is [`NO_NORMAL`]. The error is less than 7e-5 radians.
pub fn pack_normal(normal: Vec3) -> u32 {
    let sum = normal.abs().element_sum();
    if sum == 0.0 {
        return NO_NORMAL;
    }
    let [x, y] = [normal.x / sum, normal.y / sum];
    // The lower half is folded outwards, over the edges of the upper half.
    let [x, y] =
        if normal.z < 0.0 { [(1.0 - y.abs()).copysign(x), (1.0 - x.abs()).copysign(y)] } else { [x, y] };
    let bits = |value: f32| u32::from(((value * 32767.0).round() as i16).cast_unsigned());
    bits(x) | bits(y) << 16
}

/// The inverse of [`pack_normal`]: a unit vector, or zero.
pub fn unpack_normal(word: u32) -> Vec3 {
    unpack_direction(word).normalize_or_zero()
}

/// As [`unpack_normal`], of any length.
pub fn unpack_direction(word: u32) -> Vec3 {
    if word == NO_NORMAL {
        return Vec3::ZERO;
    }
    let [x, y] = [word as u16, (word >> 16) as u16].map(|bits| f32::from(bits.cast_signed()) / 32767.0);
    let z = 1.0 - x.abs() - y.abs();
    let fold = (-z).max(0.0);
    let unfold = |a: f32| a - fold.copysign(a);
    Vec3::new(unfold(x), unfold(y), z)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::Random;

    fn mean(colors: &[[u8; 4]]) -> [u8; 4] {
        let mut sum = ColorSum::default();
        colors.iter().for_each(|color| sum.add(*color));
        sum.mean()
    }

    #[test]
    fn colours_are_averaged_as_light() {
        for byte in 0..=255 {
            assert_eq!(mean(&[[byte, byte, byte, byte]; 3]), [byte; 4]);
        }
        // Half of the light of white is 188 in sRGB: 1.055 (1/2)^(1/2.4) - 0.055 is 0.735.
        assert_eq!(mean(&[[0, 0, 255, 255], [255, 0, 255, 0]]), [188, 0, 255, 128]);
        assert_eq!(color_of_light([0.5, 2.0, -1.0]), [188, 255, 0]);
        assert_eq!(pack_color([1, 2, 3, 4]), 0x0403_0201);
        assert_eq!(unpack_color(0x0403_0201), [1, 2, 3, 4]);
    }

    #[test]
    fn normals_are_packed_on_an_octahedron() {
        for (normal, word) in [
            (Vec3::Z, 0),
            (Vec3::X, 0x7FFF),
            (-Vec3::Y, 0x8001_0000),
            (Vec3::NEG_Z, 0x7FFF_7FFF),
            (Vec3::ZERO, NO_NORMAL),
        ] {
            assert_eq!((pack_normal(normal), unpack_normal(word)), (word, normal), "{normal}");
        }
        let mut random = Random(3);
        for _ in 0..20_000 {
            let normal = Vec3::from([0; 3].map(|_| 2.0 * random.unit() - 1.0)).normalize();
            let found = unpack_normal(pack_normal(normal));
            assert!(found.as_dvec3().angle_between(normal.as_dvec3()) < 7e-5, "{normal} {found}");
            // Files may contain any word.
            assert!(unpack_normal(random.next() << 8 | random.below(256)).is_finite());
        }
    }
}
