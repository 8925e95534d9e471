//! The part of the image that the drawings enlarge.

use epigraph_stages::shared::edge_pixel::{CLASS, COMPLEX, EMPTY, SIMPLE};

use super::shot::{Dissected, Shot};
use crate::values::Place;

/// Side of the window in pixels; smaller images are shown whole.
pub const SIDE: usize = 40;

/// Distance between candidate windows, in pixels.
const STEP: usize = 4;

/// Least distance of a window from the image's border in pixels, if the image is large enough.
const BORDER: usize = 20;

/// Number of simple pixels, complex pixels, and pixels crossed by outlines and by shadow boundaries that a window needs
/// to show each of them well.
const ENOUGH: [usize; 4] = [SIDE, 4, SIDE / 2, SIDE / 2];

/// Number of simple pixels that a complex one outweighs.
const COMPLEX_COST: i64 = 3;

/// Least change of a channel, 0 to 255, within 3x3 pixels at a visible edge.
const CONTRAST: u8 = 32;

/// A part of the image.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Window {
    /// Column and row of its top left pixel.
    pub at: [usize; 2],
    /// Width and height in pixels.
    pub size: [usize; 2],
}

impl Window {
    /// Checks that a window at a place lies within an image.
    ///
    /// # Errors
    /// A message with the last valid place.
    pub fn check(place: Option<Place>, image: [u32; 2]) -> Result<(), String> {
        let last = image.map(|side| side.saturating_sub(SIDE as u32));
        match place {
            Some(Place([x, y])) if x > last[0] || y > last[1] => Err(format!(
                "--crop {x},{y}: the {SIDE}x{SIDE} pixels from there do not fit into the image of {}x{}; use at most \
                 {},{}",
                image[0], image[1], last[0], last[1]
            )),
            _ => Ok(()),
        }
    }

    /// The window at a place that [`Window::check`] has accepted.
    pub fn at(Place(place): Place, image: [usize; 2]) -> Self {
        Self { at: place.map(|at| at as usize), size: image.map(|side| side.min(SIDE)) }
    }

    /// The most instructive window: it shows as many as possible of silhouettes, shadows and complex pixels. Among such
    /// windows it has the most simple pixels, less a penalty for complex ones, which show little. Only visible edges
    /// count. The window keeps away from the image's border, where points that just came into view are missing. Of
    /// equal windows, the first one in reading order is taken.
    pub fn choose(image: &Dissected) -> Self {
        let [width, height] = image.shot.size;
        let size = image.shot.size.map(|side| side.min(SIDE));
        let sums = Sums::new(image);
        let [right, bottom] = [width - size[0], height - size[1]];
        let [left, top] = [right, bottom].map(|last| (last / 2).min(BORDER));
        let mut best = (Self { at: [left, top], size }, (0, i64::MIN));
        for y in (top..=bottom - top).step_by(STEP) {
            for x in (left..=right - left).step_by(STEP) {
                let window = Self { at: [x, y], size };
                let counts = sums.of(window);
                let shown = counts.iter().zip(ENOUGH).filter(|&(&count, enough)| count >= enough).count();
                let [simple, complex] = [SIMPLE_PIXELS, COMPLEX_PIXELS].map(|kind| counts[kind] as i64);
                let score = (shown, simple - COMPLEX_COST * complex);
                if score > best.1 {
                    best = (window, score);
                }
            }
        }
        best.0
    }

    /// The window's pixels row by row: each one's place in the window and its index in an image of this width.
    pub fn pixels(self, width: usize) -> impl Iterator<Item = ([usize; 2], usize)> {
        let ([left, top], [columns, rows]) = (self.at, self.size);
        (0..rows).flat_map(move |y| (0..columns).map(move |x| ([x, y], (top + y) * width + left + x)))
    }
}

/// Summed-area table of visible simple pixels, complex pixels, and pixels crossed by outlines and by shadow boundaries.
struct Sums {
    width: usize,
    sums: Vec<[usize; 4]>,
}

/// Indices of the first two counts.
const SIMPLE_PIXELS: usize = 0;
const COMPLEX_PIXELS: usize = 1;

impl Sums {
    fn new(Dissected { shot, layers }: &Dissected) -> Self {
        let [columns, rows] = shot.size;
        let width = columns + 1;
        let mut sums = vec![[0; 4]; width * (rows + 1)];
        for y in 0..rows {
            for x in 0..columns {
                let class = layers.cls[y * columns + x] & CLASS;
                let (all, outlines) = (layers.mask[y * width + x], layers.outlines[y * width + x]);
                let seen = class != EMPTY && contrast(shot, [x, y]) >= CONTRAST;
                let counts = [class == SIMPLE, class == COMPLEX, outlines != 0, all & !outlines != 0];
                for (kind, counts) in counts.into_iter().enumerate() {
                    let at = |x: usize, y: usize| sums[y * width + x][kind];
                    let sum = at(x + 1, y) + at(x, y + 1) + usize::from(counts && seen) - at(x, y);
                    sums[(y + 1) * width + x + 1][kind] = sum;
                }
            }
        }
        Self { width, sums }
    }

    fn of(&self, Window { at: [x, y], size: [columns, rows] }: Window) -> [usize; 4] {
        let at = |x: usize, y: usize| self.sums[y * self.width + x];
        let (low, high) = (at(x, y), at(x + columns, y + rows));
        let (right, below) = (at(x + columns, y), at(x, y + rows));
        [0, 1, 2, 3].map(|kind| high[kind] + low[kind] - right[kind] - below[kind])
    }
}

/// The largest change of a channel in the 3x3 pixels around a pixel.
fn contrast(shot: &Shot, [x, y]: [usize; 2]) -> u8 {
    let [width, height] = shot.size;
    let (mut low, mut high) = ([u8::MAX; 3], [0; 3]);
    for y in y.saturating_sub(1)..(y + 2).min(height) {
        for x in x.saturating_sub(1)..(x + 2).min(width) {
            for (channel, value) in shot.colors[y * width + x].into_iter().enumerate() {
                low[channel] = low[channel].min(value);
                high[channel] = high[channel].max(value);
            }
        }
    }
    low.iter().zip(high).map(|(low, high)| high - low).max().unwrap_or(0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gallery::shot::Layers;

    /// A grey image with a white and a black vertical line of 60 pixels each. Both are simple; the black one is a
    /// shadow.
    fn lines(white: [usize; 2], black: [usize; 2]) -> Dissected {
        let [width, height] = [200, 100];
        let grey = vec![[90; 3]; width * height];
        let mut shot = Shot { size: [width, height], colors: grey };
        let mut layers = Layers {
            size: shot.size,
            points: vec![None; width * height],
            mask: vec![0; (width + 1) * (height + 1)],
            outlines: vec![0; (width + 1) * (height + 1)],
            cls: vec![EMPTY; width * height],
            r24: vec![0; width * height],
            priority: vec![0; width * height],
        };
        for (is_outline, color, [x, top]) in [(true, [255; 3], white), (false, [0; 3], black)] {
            for y in top..top + 60 {
                shot.colors[y * width + x] = color;
                layers.cls[y * width + x] = SIMPLE;
                layers.mask[y * (width + 1) + x] = 1 << 12;
                layers.outlines[y * (width + 1) + x] = u32::from(is_outline) << 12;
            }
        }
        Dissected { shot, layers }
    }

    #[test]
    fn the_window_shows_outlines_and_shadows() {
        // A window contains both only if it begins between columns 96 and 110, at row 20 or below.
        let window = Window::choose(&lines([110, 0], [135, 40]));
        assert_eq!(window, Window { at: [96, 20], size: [SIDE; 2] });
        let alone = Window::choose(&lines([30, 0], [170, 40]));
        assert_eq!(alone, Window { at: [20, 20], size: [SIDE; 2] });
    }

    #[test]
    fn invisible_edges_do_not_count() {
        let mut image = lines([30, 0], [170, 40]);
        for pixel in image.shot.colors.iter_mut().filter(|color| color[0] == 255) {
            *pixel = [100; 3];
        }
        assert_eq!(Window::choose(&image).at, [132, 40]);
    }

    #[test]
    fn windows_lie_within_the_image() {
        let place = |x, y| Some(Place([x, y]));
        assert!(Window::check(place(472, 60), [512, 100]).is_ok());
        assert!(Window::check(None, [1, 1]).is_ok());
        let message = Window::check(place(473, 0), [512, 100]).unwrap_err();
        assert!(message.contains("use at most 472,60"), "{message}");
        let small = Window::at(Place([0, 0]), [5, 7]);
        assert_eq!(small.size, [5, 7]);
        let pixels: Vec<_> = Window { at: [3, 5], size: [2, 2] }.pixels(5).collect();
        assert_eq!(pixels, [([0, 0], 28), ([1, 0], 29), ([0, 1], 33), ([1, 1], 34)]);
    }
}
