//! A canvas for the gallery's drawings.

use crate::sheet::Tile;

/// sRGB pixels, rows from the top.
pub struct Canvas {
    size: [usize; 2],
    colors: Vec<[u8; 3]>,
}

impl Canvas {
    /// A canvas filled with one colour.
    pub fn new(size: [usize; 2], color: [u8; 3]) -> Self {
        Self { size, colors: vec![color; size[0] * size[1]] }
    }

    /// Fills a rectangle, given by its top left corner and its size. It must lie on the canvas.
    pub fn fill(&mut self, [left, top]: [usize; 2], [width, height]: [usize; 2], color: [u8; 3]) {
        for y in top..top + height {
            self.colors[y * self.size[0] + left..][..width].fill(color);
        }
    }

    /// Draws an anti-aliased line with round caps. Positions and width are in pixels.
    pub fn stroke(&mut self, a: [f32; 2], b: [f32; 2], width: f32, color: [u8; 3]) {
        let reach = 0.5 * width + 1.0;
        let range = |axis: usize| {
            let (low, high) = (a[axis].min(b[axis]) - reach, a[axis].max(b[axis]) + reach);
            // The cast to `usize` clamps negative values to zero.
            low.floor() as usize..(high.ceil() as usize).min(self.size[axis])
        };
        let (columns, rows) = (range(0), range(1));
        for y in rows {
            for x in columns.clone() {
                let distance = distance([x as f32 + 0.5, y as f32 + 0.5], a, b);
                let coverage = (0.5 * width + 0.5 - distance).clamp(0.0, 1.0);
                let under = &mut self.colors[y * self.size[0] + x];
                for (under, over) in under.iter_mut().zip(color) {
                    let mixed = f32::from(*under) * (1.0 - coverage) + f32::from(over) * coverage;
                    *under = (mixed + 0.5) as u8;
                }
            }
        }
    }

    /// The finished picture with its label.
    pub fn tile(self, label: &str) -> Tile {
        Tile { label: label.to_owned(), size: self.size, colors: self.colors }
    }
}

/// The distance of a point from a segment.
fn distance(p: [f32; 2], a: [f32; 2], b: [f32; 2]) -> f32 {
    let (along, to) = ([b[0] - a[0], b[1] - a[1]], [p[0] - a[0], p[1] - a[1]]);
    let squared = along[0] * along[0] + along[1] * along[1];
    let dot = to[0] * along[0] + to[1] * along[1];
    let t = if squared > 0.0 { (dot / squared).clamp(0.0, 1.0) } else { 0.0 };
    (to[0] - t * along[0]).hypot(to[1] - t * along[1])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn strokes_cover_their_pixels() {
        let mut canvas = Canvas::new([9, 5], [0; 3]);
        canvas.stroke([2.0, 2.5], [7.0, 2.5], 1.0, [200; 3]);
        let row = |y: usize| canvas.colors[9 * y..][..9].iter().map(|color| color[0]).collect::<Vec<_>>();
        assert_eq!(row(2), [0, 100, 200, 200, 200, 200, 200, 100, 0]);
        assert_eq!((row(1), row(3)), (vec![0; 9], vec![0; 9]));
    }

    #[test]
    fn strokes_are_clipped_to_the_canvas() {
        let mut canvas = Canvas::new([3, 3], [0; 3]);
        canvas.stroke([-9.0, 1.5], [12.0, 1.5], 1.0, [8; 3]);
        canvas.stroke([-9.0, -9.0], [-5.0, -5.0], 1.0, [8; 3]);
        canvas.stroke([90.0, 90.0], [95.0, 95.0], 1.0, [8; 3]);
        let lit: Vec<bool> = canvas.colors.iter().map(|color| color[0] == 8).collect();
        assert_eq!(lit, [false, false, false, true, true, true, false, false, false]);
    }
}
