//! Where points of the cloud project to in an image. Mirrored by `shaders/shared/view.wgsl`, operation by operation.

use epigraph_core::View;

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

/// Several projected points, as a structure of arrays: most of the work is vectorized, four at a time.
pub struct Several {
    x: [f32; SEVERAL],
    y: [f32; SEVERAL],
    z: [f32; SEVERAL],
    is_drawn: [bool; SEVERAL],
}

/// Capacity of [`Several`].
pub const SEVERAL: usize = 64;

impl Several {
    /// Projects up to [`SEVERAL`] points (w = 1) and directions (w = 0) into an image of `size` pixels.
    ///
    /// Points beyond the far plane are moved onto it and drawn, because otherwise the background would look like
    /// missing samples (`algorithms.md` section 1.2). Directions are drawn on the far plane. The eye is subtracted
    /// first, so that positions of 1e7 metres lose no precision beyond that of their own f32.
    pub fn project(view: &View, positions: &[[f32; 4]], size: [u32; 2]) -> Self {
        let [x, y, z] = [[0.0; SEVERAL]; 3];
        let mut several = Self { x, y, z, is_drawn: [false; SEVERAL] };
        let Self { x, y, z, is_drawn } = &mut several;
        let found = x.iter_mut().zip(y).zip(z).zip(is_drawn);
        for ((((x, y), z), is_drawn), &position) in found.zip(positions) {
            let (point, drawn) = place(view, position, size);
            (*x, *y, *z, *is_drawn) = (point.x, point.y, point.z, drawn);
        }
        several
    }

    /// The point with this index; `None` if it is not drawn because it is in front of the near plane, outside the
    /// image, or contains a NaN.
    #[inline(always)]
    pub fn get(&self, index: usize) -> Option<Projected> {
        let point = Projected { x: self.x[index], y: self.y[index], z: self.z[index] };
        self.is_drawn[index].then_some(point)
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

/// The position of a point, and whether it is drawn. Branchless, so that loops are vectorized.
#[inline(always)]
fn place(view: &View, position: [f32; 4], size: [u32; 2]) -> (Projected, bool) {
    let [x, y, z] = place_in_image(view, position, size);
    let is_direction = position[3] == 0.0;
    let nearest = if is_direction { f32::MIN_POSITIVE } else { view.near };
    // Comparisons with NaN are false.
    let is_within = (x >= 0.0) & (x < size[0] as f32) & (y >= 0.0) & (y < size[1] as f32);
    let is_drawn = (z >= nearest) & is_within;
    let z = if is_direction { view.far } else { z.min(view.far) };
    (Projected { x, y, z }, is_drawn)
}

impl Projected {
    /// Column and row of the pixel.
    pub fn pixel(self) -> [u32; 2] {
        [self.x as u32, self.y as u32]
    }

    /// Which of `cells` x `cells` cells of its pixel contains the point, row by row from the top left one.
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
    use super::*;

    const SIZE: [u32; 2] = [512, 256];

    fn project(view: &View, position: [f32; 4], size: [u32; 2]) -> Option<Projected> {
        Several::project(view, &[position], size).get(0)
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
