//! Parts of pictures: where graphs differ most, and their pixels, enlarged, as what a drawing or a page embeds.

use base64::{Engine, engine::general_purpose::STANDARD};
use epigraph_pictures::{Picture, png, tone};

use crate::values::Crop;

/// The `count` places of this size with the largest sums of `values`, the largest one first. They do not overlap, and
/// each has a sum above 0: there may be fewer.
pub fn worst(values: &[f64], [width, height]: [usize; 2], [w, h]: [usize; 2], count: usize) -> Vec<Crop> {
    // Sums over all rectangles from the top left, each without its last row and column.
    let row = width + 1;
    let mut sums = vec![0.0; row * (height + 1)];
    for (y, line) in values.chunks(width).enumerate() {
        let mut sum = 0.0;
        for (x, value) in line.iter().enumerate() {
            sum += value;
            sums[(y + 1) * row + x + 1] = sums[y * row + x + 1] + sum;
        }
    }
    let of = |[x, y]: [usize; 2]| {
        let at = |x: usize, y: usize| sums[y * row + x];
        at(x + w, y + h) - at(x, y + h) - at(x + w, y) + at(x, y)
    };
    let mut found: Vec<[usize; 2]> = Vec::new();
    for _ in 0..count {
        let apart =
            |[x, y]: &[usize; 2]| found.iter().all(|[a, b]| x.abs_diff(*a) >= w || y.abs_diff(*b) >= h);
        let places = (0..=height - h).flat_map(|y| (0..=width - w).map(move |x| [x, y])).filter(apart);
        // Of equal ones the first.
        let best =
            places.map(|at| (of(at), at)).reduce(|best, next| if next.0 > best.0 { next } else { best });
        // Sums of nothing have rounding errors.
        match best.filter(|(sum, _)| *sum > 1e-6) {
            Some((_, at)) => found.push(at),
            None => break,
        }
    }
    let crop = |at: [usize; 2]| Crop { at: at.map(|side| side as u32), size: [w as u32, h as u32] };
    found.into_iter().map(crop).collect()
}

/// Colours as they are displayed, rows from the top.
pub struct Bitmap {
    /// Width and height in pixels.
    pub size: [usize; 2],
    /// sRGB.
    pub colors: Vec<[u8; 3]>,
}

impl Bitmap {
    /// A picture as it is displayed.
    pub fn of(picture: &Picture) -> Self {
        let colors = (0..picture.colors.len()).map(|index| picture.srgb_at(index).map(tone::to_byte));
        Self { size: picture.size, colors: colors.collect() }
    }

    /// A part, which lies in it.
    pub fn part(&self, crop: &Crop) -> Self {
        let [[x, y], size] = [crop.at, crop.size].map(|pair| pair.map(|side| side as usize));
        let row = |y: usize| &self.colors[y * self.size[0] + x..][..size[0]];
        Self { size, colors: (y..y + size[1]).flat_map(row).copied().collect() }
    }

    /// Each pixel as a square of pixels, so that the picture is at least `least` pixels wide. Programs that smooth
    /// pictures then leave the squares visible.
    pub fn enlarged(&self, least: usize) -> Self {
        let times = least.div_ceil(self.size[0]).max(1);
        let [width, height] = self.size.map(|side| side * times);
        let pixel = |at: usize| self.colors[at / width / times * self.size[0] + at % width / times];
        Self { size: [width, height], colors: (0..width * height).map(pixel).collect() }
    }

    /// The picture as a URL that holds it as PNG.
    ///
    /// # Errors
    /// The encoder's error.
    pub fn url(&self) -> Result<String, String> {
        Ok(url(&png(self.size, &self.colors)?))
    }
}

/// A URL that holds a PNG file.
pub fn url(png: &[u8]) -> String {
    format!("data:image/png;base64,{}", STANDARD.encode(png))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_worst_places_are_found_and_do_not_overlap() {
        // 7 x 5 pixels: 9 at (1, 1), 8 at (2, 1), 5 at (5, 3).
        let mut values = vec![0.0; 35];
        (values[8], values[9], values[26]) = (9.0, 8.0, 5.0);
        let found = worst(&values, [7, 5], [2, 2], 3);
        let texts: Vec<String> = found.iter().map(Crop::to_string).collect();
        // The first place with both, then the first one with the rest; nothing is left for a third one.
        assert_eq!(texts, ["1,0,2x2", "4,2,2x2"]);
        assert_eq!(worst(&[0.0; 35], [7, 5], [2, 2], 3), []);
        assert_eq!(worst(&values, [7, 5], [7, 5], 2).len(), 1);
    }

    #[test]
    fn the_worst_places_are_those_of_a_search_of_all_sums() {
        let mut random = epigraph_core::testing::Random(7);
        for _ in 0..50 {
            let [width, height] = [0, 0].map(|_| 3 + random.below(9) as usize);
            let window = [width, height].map(|side| 1 + random.below(side as u32 - 1) as usize);
            let values: Vec<f64> = (0..width * height).map(|_| f64::from(random.below(1000))).collect();
            let sum = |at: [u32; 2]| {
                let [x, y] = at.map(|side| side as usize);
                let rows = (y..y + window[1]).map(|y| &values[y * width + x..][..window[0]]);
                rows.flatten().sum::<f64>()
            };
            let ends = [width - window[0], height - window[1]].map(|side| side as u32);
            let all = (0..=ends[1]).flat_map(|y| (0..=ends[0]).map(move |x| [x, y]));
            let most = all.map(sum).fold(0.0, f64::max);
            let found = worst(&values, [width, height], window, 1);
            assert_eq!(found.first().map_or(0.0, |crop| sum(crop.at)), most);
        }
    }

    #[test]
    fn parts_are_cut_out_and_enlarged() {
        let colors = (0..12).map(|value| [value; 3]).collect();
        let part = Bitmap { size: [4, 3], colors }.part(&"1,1,2x2".parse().unwrap());
        let greys = |bitmap: &Bitmap| bitmap.colors.iter().map(|color| color[0]).collect::<Vec<_>>();
        assert_eq!((part.size, greys(&part)), ([2, 2], vec![5, 6, 9, 10]));
        let large = part.enlarged(3);
        assert_eq!(large.size, [4, 4]);
        assert_eq!(greys(&large), [5, 5, 6, 6, 5, 5, 6, 6, 9, 9, 10, 10, 9, 9, 10, 10]);
        assert_eq!(part.enlarged(2).size, [2, 2]);
    }
}
