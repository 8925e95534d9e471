use std::sync::LazyLock;

use glam::{Vec2, Vec4};

use crate::Map;

/// What lies beyond a texture's edge.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Deserialize)]
pub enum Wrap {
    /// The texture again.
    #[default]
    Repeat,
    /// The texture mirrored.
    Mirror,
    /// The texel at the edge.
    Clamp,
}

impl Wrap {
    /// The index of the texel at `index`, of `size`.
    fn apply(self, index: i64, size: i64) -> usize {
        let wrapped = match self {
            Self::Repeat => index.rem_euclid(size),
            Self::Mirror => {
                let twice = index.rem_euclid(2 * size);
                twice.min(2 * size - 1 - twice)
            }
            Self::Clamp => index.clamp(0, size - 1),
        };
        wrapped as usize
    }
}

/// An image that materials use.
#[derive(Clone, PartialEq)]
pub struct Texture {
    /// Its name or file.
    pub name: String,
    /// Columns and rows, at least 1 each.
    pub size: [u32; 2],
    /// Red, green, blue and alpha, row by row from the top.
    pub texels: Vec<[u8; 4]>,
}

impl std::fmt::Debug for Texture {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Texture").field("name", &self.name).field("size", &self.size).finish_non_exhaustive()
    }
}

/// How a texture's numbers are read.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Coding {
    /// Red, green and blue by the sRGB curve, alpha as a share.
    Color,
    /// All as shares of 255.
    Linear,
}

/// The linear value of an sRGB code between 0 and 1 (IEC 61966-2-1).
pub(crate) fn decode_srgb(code: f64) -> f64 {
    if code <= 0.04045 { code / 12.92 } else { ((code + 0.055) / 1.055).powf(2.4) }
}

/// The linear value of each sRGB byte.
static LINEAR: LazyLock<[f32; 256]> =
    LazyLock::new(|| std::array::from_fn(|byte| decode_srgb(byte as f64 / 255.0) as f32));

impl Texture {
    /// Whether every texel is opaque.
    pub(crate) fn is_opaque(&self) -> bool {
        self.texels.iter().all(|texel| texel[3] == u8::MAX)
    }

    /// The value of `map` at the mesh's texture coordinates `uv`. Texels are decoded, then interpolated.
    pub(crate) fn at(&self, map: &Map, uv: Vec2, coding: Coding) -> Vec4 {
        let [width, height] = self.size.map(i64::from);
        let at = map.transform.transform_point2(uv) * Vec2::new(width as f32, height as f32);
        // A coordinate that is no number reads the first texel; f32 counts no texels beyond 2^24.
        const FARTHEST: f32 = 1e9;
        let at =
            if at.is_nan() { Vec2::ZERO } else { at.clamp(Vec2::splat(-FARTHEST), Vec2::splat(FARTHEST)) };
        let texel = |x: i64, y: i64| {
            let column = map.wrap[0].apply(x, width);
            let row = map.wrap[1].apply(y, height);
            decode(self.texels[row * width as usize + column], coding)
        };
        if map.nearest {
            let cell = at.floor();
            return texel(cell.x as i64, cell.y as i64);
        }
        let corner = (at - 0.5).floor();
        let [s, t] = (at - 0.5 - corner).to_array();
        let (x, y) = (corner.x as i64, corner.y as i64);
        let row = |y: i64| texel(x, y).lerp(texel(x + 1, y), s);
        row(y).lerp(row(y + 1), t)
    }
}

/// The linear value of an sRGB code.
pub(crate) fn linear_of(code: u8) -> f32 {
    LINEAR[usize::from(code)]
}

fn decode(texel: [u8; 4], coding: Coding) -> Vec4 {
    let share = |code: u8| f32::from(code) / 255.0;
    let [r, g, b, a] = texel;
    match coding {
        Coding::Color => {
            let [r, g, b] = [r, g, b].map(linear_of);
            Vec4::new(r, g, b, share(a))
        }
        Coding::Linear => Vec4::from_array(texel.map(share)),
    }
}

#[cfg(test)]
mod tests {
    use glam::Affine2;

    use super::*;

    /// 3 x 2 texels: red counts 0 to 5 in steps of 51.
    fn texture() -> Texture {
        let texels = (0..6).map(|i| [51 * i, 0, 255, 128]).collect();
        Texture { name: String::new(), size: [3, 2], texels }
    }

    fn red(map: &Map, u: f32, v: f32) -> f32 {
        texture().at(map, Vec2::new(u, v), Coding::Linear).x * 5.0
    }

    #[test]
    fn nearest_texels_wrap_in_three_ways() {
        let read = |wrap: Wrap, u: f32, v: f32| {
            red(&Map { wrap: [wrap; 2], nearest: true, ..Map::new(0) }, u, v).round()
        };
        for (u, v, repeat, mirror, clamp) in [
            (0.1, 0.1, 0.0, 0.0, 0.0),
            (0.9, 0.9, 5.0, 5.0, 5.0),
            (1.1, 0.1, 0.0, 2.0, 2.0),
            (-0.1, 0.1, 2.0, 0.0, 0.0),
            (2.1, 1.1, 0.0, 3.0, 5.0),
            (0.5, -0.1, 4.0, 1.0, 1.0),
            (0.5, -1.1, 4.0, 4.0, 1.0),
            (-1.1, 0.1, 2.0, 2.0, 0.0),
        ] {
            let found = [Wrap::Repeat, Wrap::Mirror, Wrap::Clamp].map(|wrap| read(wrap, u, v));
            assert_eq!(found, [repeat, mirror, clamp], "{u}, {v}");
        }
        // The edge between two texels belongs to the second.
        assert_eq!(read(Wrap::Repeat, 1.0 / 3.0 + 1e-6, 0.0), 1.0);
        assert_eq!(read(Wrap::Repeat, f32::NAN, 0.0), 0.0);
        assert!(read(Wrap::Repeat, 1e30, -1e30) >= 0.0);
    }

    #[test]
    fn four_texels_are_interpolated() {
        let map = Map { wrap: [Wrap::Clamp; 2], ..Map::new(0) };
        let near = |u: f32, v: f32, expected: f32| {
            let found = red(&map, u, v);
            assert!((found - expected).abs() < 1e-5, "{u}, {v}: {found}");
        };
        // Centres, halfway between two, and the middle of four.
        near(1.0 / 6.0, 0.25, 0.0);
        near(5.0 / 6.0, 0.75, 5.0);
        near(1.0 / 3.0, 0.25, 0.5);
        near(1.0 / 6.0, 0.5, 1.5);
        near(2.0 / 3.0, 0.5, 3.0);
        near(0.0, 0.0, 0.0);
        // Across the edge: halfway between the last column and the first.
        let found = red(&Map::new(0), 0.0, 0.25);
        assert!((found - 1.0).abs() < 1e-5, "{found}");
    }

    #[test]
    fn a_map_transforms_coordinates_first() {
        let map = Map {
            transform: Affine2::from_scale_angle_translation(
                Vec2::new(2.0, 1.0),
                0.0,
                Vec2::new(1.0 / 3.0, 0.0),
            ),
            nearest: true,
            ..Map::new(0)
        };
        assert_eq!(red(&map, 0.05, 0.1), 1.0);
        assert_eq!(red(&map, 0.2, 0.1), 2.0);
        assert_eq!(red(&map, 0.4, 0.9), 3.0);
    }

    #[test]
    fn colours_follow_the_srgb_curve_and_alpha_does_not() {
        let texel = Texture { name: String::new(), size: [1, 1], texels: vec![[188, 10, 255, 188]] };
        let color = texel.at(&Map::new(0), Vec2::ZERO, Coding::Color);
        let linear = texel.at(&Map::new(0), Vec2::ZERO, Coding::Linear);
        // 188 is the code of about half the light; below 11, the curve is a line.
        assert!((color.x - 0.502_886).abs() < 1e-5 && (color.y - 10.0 / 255.0 / 12.92).abs() < 1e-7);
        assert_eq!((color.z, color.w), (1.0, 188.0 / 255.0));
        assert_eq!(linear, Vec4::new(188.0, 10.0, 255.0, 188.0) / 255.0);
    }
}
