//! Where points of the cloud project to in an image. Mirrored by `shaders/shared/view.wgsl`, operation by operation.

use epigraph_core::View;
use fearless_simd::{Simd, f32x8, i32x8, mask32x8, prelude::*, u32x8};

use super::lanes::{LANES, lesser, load_transposed};

/// A projected point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Projected {
    /// Pixels from the left edge, 0 to below the width.
    pub x: f32,
    /// Pixels from the top edge, 0 to below the height.
    pub y: f32,
    /// Distance along the view axis, metres, at most that of the far plane.
    pub z: f32,
}

/// Several projected points.
pub struct Lanes<S: Simd> {
    simd: S,
    x: f32x8<S>,
    y: f32x8<S>,
    z: f32x8<S>,
    /// The points that are drawn; the positions of others mean nothing.
    pub is_drawn: mask32x8<S>,
}

impl<S: Simd> Lanes<S> {
    /// [`Projected::of`] each of these positions.
    #[inline(always)]
    pub fn project(simd: S, view: &View, positions: &[[f32; 4]; LANES], size: [u32; 2]) -> Self {
        let splat = |number: f32| f32x8::splat(simd, number);
        let [px, py, pz, w] = load_transposed(simd, positions);
        let is_direction = w.simd_eq(splat(0.0));
        let from_eye = |at: f32x8<S>, eye: f32| at - is_direction.select(splat(0.0), splat(eye));
        let p = [from_eye(px, view.eye[0]), from_eye(py, view.eye[1]), from_eye(pz, view.eye[2])];
        let along = |axis: [f32; 3]| p[0] * splat(axis[0]) + p[1] * splat(axis[1]) + p[2] * splat(axis[2]);
        let z = along(view.forward);
        let inverse = splat(1.0) / z;
        let [half_x, half_y] = size.map(|side| 0.5 * side as f32);
        let x = splat(half_x) + along(view.right) * inverse * splat(half_x / view.tan_x);
        let y = splat(half_y) - along(view.up) * inverse * splat(half_y / view.tan_y);
        let nearest = is_direction.select(splat(f32::MIN_POSITIVE), splat(view.near));
        let [width, height] = size.map(|side| splat(side as f32));
        let is_within = x.simd_ge(splat(0.0)) & x.simd_lt(width) & y.simd_ge(splat(0.0)) & y.simd_lt(height);
        let far = splat(view.far);
        let z_drawn = is_direction.select(far, lesser(simd, z, far));
        Self { simd, x, y, z: z_drawn, is_drawn: z.simd_ge(nearest) & is_within }
    }

    /// Column and row of the pixels.
    #[inline(always)]
    pub fn pixel(&self) -> [u32x8<S>; 2] {
        // Images are smaller than 2^31, and processors convert to signed numbers faster.
        [self.x, self.y].map(|along| along.to_int::<i32x8<S>>().bitcast())
    }

    /// The bits of the distances.
    #[inline(always)]
    pub fn depth(&self) -> u32x8<S> {
        self.z.to_bits()
    }

    /// [`Projected::cell`] of each point.
    #[inline(always)]
    pub fn cell(&self, cells: u32) -> u32x8<S> {
        let within = |along: f32x8<S>| {
            let pixel: f32x8<S> = along.to_int::<i32x8<S>>().to_float();
            let cell: i32x8<S> = ((along - pixel) * f32x8::splat(self.simd, cells as f32)).to_int();
            cell.bitcast::<u32x8<S>>()
        };
        within(self.y) * u32x8::splat(self.simd, cells) + within(self.x)
    }
}

/// Where a point (w = 1) or direction (w = 0) is in an image of `size` pixels that has no border: pixels from the left
/// and top edge of the image; and its distance along the view axis, metres, or that of the direction's end. Behind the
/// eye, where the distance is not positive, the position means nothing.
#[inline(always)]
pub fn place_in_image(view: &View, position: [f32; 4], size: [u32; 2]) -> [f32; 3] {
    let origin = if position[3] == 0.0 { [0.0; 3] } else { view.eye };
    let p = [position[0] - origin[0], position[1] - origin[1], position[2] - origin[2]];
    let z = dot(p, view.forward);
    let inverse = 1.0 / z;
    let half = [0.5 * size[0] as f32, 0.5 * size[1] as f32];
    let x = half[0] + dot(p, view.right) * inverse * (half[0] / view.tan_x);
    let y = half[1] - dot(p, view.up) * inverse * (half[1] / view.tan_y);
    [x, y, z]
}

impl Projected {
    /// Projects a point (w = 1) or direction (w = 0) into an image of `size` pixels; `None` if it is not drawn because it is
    /// in front of the near plane, outside the image, or contains a NaN. This is the rule; [`Lanes::project`] computes the
    /// same for several points.
    ///
    /// Points beyond the far plane are moved onto it and drawn, because otherwise the background would look like
    /// missing samples (`algorithms.md` section 1.2). Directions are drawn on the far plane. The eye is subtracted
    /// first, so that positions of 1e7 metres lose no precision beyond that of their own f32.
    pub fn of(view: &View, position: [f32; 4], size: [u32; 2]) -> Option<Self> {
        let [x, y, z] = place_in_image(view, position, size);
        let is_direction = position[3] == 0.0;
        let nearest = if is_direction { f32::MIN_POSITIVE } else { view.near };
        // Comparisons with NaN are false.
        let is_within = x >= 0.0 && x < size[0] as f32 && y >= 0.0 && y < size[1] as f32;
        let z_drawn = if is_direction { view.far } else { z.min(view.far) };
        (z >= nearest && is_within).then_some(Self { x, y, z: z_drawn })
    }

    /// Column and row of the pixel.
    #[inline(always)]
    pub fn pixel(self) -> [u32; 2] {
        [self.x as u32, self.y as u32]
    }

    /// Which of `cells` x `cells` cells of its pixel contains the point, row by row from the top left one.
    #[inline(always)]
    pub fn cell(self, cells: u32) -> u32 {
        let [x, y] = self.pixel();
        let column = ((self.x - x as f32) * cells as f32) as u32;
        let row = ((self.y - y as f32) * cells as f32) as u32;
        row * cells + column
    }
}

/// The sum of the products, in the order of the axes.
pub(crate) fn dot(a: [f32; 3], b: [f32; 3]) -> f32 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

#[cfg(test)]
mod tests {
    use fearless_simd::{Level, dispatch};

    use super::*;

    const SIZE: [u32; 2] = [512, 256];

    /// The projected point; all levels agree on it, bit for bit.
    fn project(view: &View, position: [f32; 4], size: [u32; 2]) -> Option<Projected> {
        let expected = Projected::of(view, position, size);
        for level in [Level::new(), Level::baseline()] {
            dispatch!(level, simd => assert_eq!(in_lanes(simd, view, position, size), expected));
        }
        expected
    }

    fn in_lanes<S: Simd>(simd: S, view: &View, position: [f32; 4], size: [u32; 2]) -> Option<Projected> {
        let mut positions = [[f32::NAN; 4]; LANES];
        positions[5] = position;
        let lanes = Lanes::project(simd, view, &positions, size);
        let bits = lanes.is_drawn.to_bitmask();
        assert_eq!(bits & !(1 << 5), 0, "{position:?}");
        let point =
            Projected { x: lanes.x.to_array()[5], y: lanes.y.to_array()[5], z: lanes.z.to_array()[5] };
        if bits != 0 {
            let [x, y] = lanes.pixel().map(|along| along.to_array()[5]);
            assert_eq!([x, y], point.pixel());
            assert_eq!(lanes.cell(16).to_array()[5], point.cell(16));
            assert_eq!(f32::from_bits(lanes.depth().to_array()[5]), point.z);
        }
        (bits != 0).then_some(point)
    }

    fn view() -> View {
        View { tan_x: 1.0, tan_y: 0.5, near: 1.0, far: 100.0, ..View::default() }
    }

    #[test]
    fn by_hand() {
        let at = |p| project(&view(), p, SIZE);
        assert_eq!(at([0.0, 0.0, -10.0, 1.0]), Some(Projected { x: 256.0, y: 128.0, z: 10.0 }));
        // A quarter of the image to the right and up.
        assert_eq!(at([5.0, 2.5, -10.0, 1.0]), Some(Projected { x: 384.0, y: 64.0, z: 10.0 }));
        // The left and top edges are part of the image, the right and bottom ones are not.
        assert_eq!(at([-10.0, 5.0, -10.0, 1.0]), Some(Projected { x: 0.0, y: 0.0, z: 10.0 }));
        assert_eq!(at([10.0, 0.0, -10.0, 1.0]), None);
        assert_eq!(at([0.0, -5.0, -10.0, 1.0]), None);
    }

    #[test]
    fn near_and_far() {
        let at = |p| project(&view(), p, SIZE).map(|p| p.z);
        assert_eq!(at([0.0, 0.0, -1.0, 1.0]), Some(1.0));
        assert_eq!(at([0.0, 0.0, -0.999, 1.0]), None);
        assert_eq!(at([0.0, 0.0, 10.0, 1.0]), None);
        assert_eq!(at([0.0, 0.0, -1e6, 1.0]), Some(100.0));
        // A direction, however short its component along the axis, lies on the far plane.
        assert_eq!(at([0.0, 0.0, -1.0, 0.0]), Some(100.0));
        assert_eq!(at([3e-3, 0.0, -4e-3, 0.0]), Some(100.0));
        assert_eq!(at([0.0, 0.0, 1.0, 0.0]), None);
        assert_eq!(at([1.0, 0.0, 0.0, 0.0]), None);
    }

    #[test]
    fn directions_ignore_the_eye() {
        let far_away = View { eye: [1e7, -3e6, 5e5], ..view() };
        let direction = [0.6, 0.0, -0.8, 0.0];
        assert_eq!(project(&far_away, direction, SIZE), project(&view(), direction, SIZE));
    }

    #[test]
    fn positions_of_ten_million_keep_their_pixel() {
        let far_away = View { eye: [1e7, -1e7, 1e7], ..view() };
        // Multiples of 1, the step of f32 numbers of this size, so that the difference is exact.
        let at = project(&far_away, [1e7 + 5.0, -1e7 + 2.0, 1e7 - 10.0, 1.0], SIZE);
        assert_eq!(at, project(&view(), [5.0, 2.0, -10.0, 1.0], SIZE));
    }

    #[test]
    fn narrow_and_wide_fields_of_view() {
        for degrees in [0.1f64, 179.0] {
            let tan = (degrees.to_radians() / 2.0).tan() as f32;
            let view = View { tan_x: tan, tan_y: tan, ..view() };
            for share in [-0.99f32, -0.5, 0.0, 0.25, 0.99] {
                let p = project(&view, [share * tan * 20.0, 0.0, -20.0, 1.0], SIZE).expect("in the image");
                let expected = 256.0 + 256.0 * share;
                // The tolerance covers three roundings of numbers below 512.
                assert!((p.x - expected).abs() < 1e-4, "{degrees} {share}: {} {expected}", p.x);
            }
            assert_eq!(project(&view, [1.01 * tan * 20.0, 0.0, -20.0, 1.0], SIZE), None);
        }
    }

    #[test]
    fn points_that_are_not_finite_are_not_drawn() {
        for bad in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
            for axis in 0..3 {
                let mut p = [0.0, 0.0, -10.0, 1.0];
                p[axis] = bad;
                assert_eq!(project(&view(), p, SIZE), None, "{p:?}");
            }
        }
    }

    #[test]
    fn cells_count_from_the_top_left() {
        let at = |x, y| Projected { x, y, z: 1.0 };
        assert_eq!(at(7.0, 3.0).cell(4), 0);
        assert_eq!(at(7.99, 3.0).cell(4), 3);
        assert_eq!(at(7.0, 3.99).cell(4), 12);
        assert_eq!(at(7.99, 3.99).cell(4), 15);
        assert_eq!(at(0.5, 0.5).cell(16), 8 * 16 + 8);
    }
}
