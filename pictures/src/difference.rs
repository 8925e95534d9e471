//! Measures of the difference between a picture and its reference, as a viewer sees both.

use crate::{Picture, flip, metrics, tone};

/// Two pictures, compared as displayed, and FLIP's error per pixel.
pub struct Difference<'a> {
    reference: &'a Picture,
    picture: &'a Picture,
    /// FLIP's errors, 0 to 1, rows from the top.
    pub errors: Vec<f32>,
}

impl<'a> Difference<'a> {
    /// Compares two pictures of the same size. Linear ones are clamped to [0, 1] and sRGB-encoded first.
    pub fn new(reference: &'a Picture, picture: &'a Picture) -> Self {
        Self::watched(reference, picture, &mut |_| {})
    }

    /// The same; `progress` takes the numbers of pixels that are finished.
    pub fn watched(reference: &'a Picture, picture: &'a Picture, progress: &mut dyn FnMut(usize)) -> Self {
        // A display shows eight bits, and other tools compare eight bits.
        let seen = |picture: &Picture, i| {
            picture.srgb_at(i).map(|channel| f32::from(tone::to_byte(channel)) / 255.0)
        };
        let mut errors = Vec::with_capacity(reference.colors.len());
        flip::flip_of(
            reference.size,
            |i| seen(reference, i),
            |i| seen(picture, i),
            |band| {
                errors.extend_from_slice(band);
                progress(band.len());
            },
        );
        Self { reference, picture, errors }
    }

    /// Peak signal-to-noise ratio in decibels; infinite for equal pictures.
    pub fn psnr(&self) -> f64 {
        self.psnr_of(|_| true)
    }

    /// The same over the pixels set in `mask`.
    pub fn psnr_within(&self, mask: &[bool]) -> f64 {
        self.psnr_of(|i| mask[i])
    }

    fn psnr_of(&self, is_chosen: impl Fn(usize) -> bool) -> f64 {
        let chosen = (0..self.errors.len()).filter(|&i| is_chosen(i));
        let pairs = chosen.map(|i| (self.reference.srgb_at(i), self.picture.srgb_at(i)));
        metrics::decibels(metrics::rmse_of(pairs))
    }

    /// Mean structural similarity.
    pub fn ssim(&self) -> f64 {
        self.ssim_watched(&mut |_| {})
    }

    /// The same; `progress` takes the numbers of pixels that are finished.
    pub fn ssim_watched(&self, progress: &mut dyn FnMut(usize)) -> f64 {
        let (a, b) = (self.reference, self.picture);
        metrics::ssim_of(a.size, |i| a.srgb_at(i), |i| b.srgb_at(i), progress)
    }

    /// Mean of FLIP's errors.
    pub fn flip(&self) -> f64 {
        flip::mean(self.errors.iter().copied())
    }

    /// The same over the pixels set in `mask`. A pixel's error depends on its neighbourhood, inside or outside the
    /// mask.
    pub fn flip_within(&self, mask: &[bool]) -> f64 {
        flip::mean(self.errors.iter().zip(mask).filter(|(_, set)| **set).map(|(error, _)| *error))
    }
}

/// Differences of displayed colours, per channel, amplified: black where they are equal.
pub fn apart(a: &[[u8; 3]], b: &[[u8; 3]], gain: f32) -> Vec<[u8; 3]> {
    let channel = |a: u8, b: u8| (gain * f32::from(a.abs_diff(b)) + 0.5) as u8;
    a.iter().zip(b).map(|(a, b)| std::array::from_fn(|lane| channel(a[lane], b[lane]))).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    const SIZE: [usize; 2] = [32, 32];

    fn grey(value: impl Fn(usize) -> f32) -> Picture {
        Picture { size: SIZE, colors: (0..1024).map(|i| [value(i); 3]).collect(), linear: false }
    }

    #[test]
    fn a_mask_leaves_only_its_pixels() {
        // The right half differs by 0.1.
        let right = |i: usize| i % 32 >= 16;
        let pictures = [grey(|_| 0.5), grey(|i| if right(i) { 0.6 } else { 0.5 })];
        let difference = Difference::new(&pictures[0], &pictures[1]);
        let mask = |set: &dyn Fn(usize) -> bool| (0..1024).map(set).collect::<Vec<bool>>();
        assert!((difference.psnr_within(&mask(&right)) - 20.0).abs() < 1e-4);
        assert!((difference.psnr() - 10.0 * 200f64.log10()).abs() < 1e-4);
        assert_eq!(difference.psnr_within(&mask(&|i| !right(i))), f64::INFINITY);
        let halves = [mask(&right), mask(&|i| !right(i))].map(|mask| difference.flip_within(&mask));
        assert!(halves[0] > 2.0 * halves[1], "{halves:?}");
        assert!((0.5 * (halves[0] + halves[1]) - difference.flip()).abs() < 1e-6);
    }

    #[test]
    fn differences_are_enlarged_and_end_at_white() {
        let found = apart(&[[10, 20, 30], [0, 200, 7]], &[[10, 25, 20], [90, 0, 7]], 4.0);
        assert_eq!(found, [[0, 20, 40], [255, 255, 0]]);
    }

    #[test]
    fn linear_light_is_compared_as_it_is_shown() {
        let linear = Picture { linear: true, ..grey(|i| if i < 512 { 0.318_547 } else { 7.0 }) };
        let shown = grey(|i| if i < 512 { 0.6 } else { 1.0 });
        let difference = Difference::new(&linear, &shown);
        assert!(difference.psnr() > 90.0);
        assert_eq!(difference.flip(), 0.0);
    }

    /// Two unlike pictures with smooth parts, edges and noise; the first may be linear.
    fn unlike([width, height]: [usize; 2], linear: bool) -> [Picture; 2] {
        let mut state = 7_u32;
        let mut noise = || {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            (state >> 8) as f32 / (1 << 24) as f32
        };
        let mut colors = [Vec::new(), Vec::new()];
        for (x, y) in (0..height).flat_map(|y| (0..width).map(move |x| (x, y))) {
            let (u, v) = (x as f32 / width as f32, y as f32 / height as f32);
            let square = if (x / 9 + y / 7) % 2 == 0 { 0.9 } else { 0.1 };
            colors[0].push([u, if linear { 1.3 * v } else { v }, square]);
            colors[1].push([0.5 * u + 0.5 * noise(), 0.9 * square, if x > y { v } else { 1.0 - u }]);
        }
        let [a, b] = colors;
        let size = [width, height];
        [Picture { size, colors: a, linear }, Picture { size, colors: b, linear: false }]
    }

    #[test]
    fn measures_are_those_of_whole_pictures() {
        // Computed from the whole pictures at once, not in tiles: PSNR, SSIM, FLIP, and PSNR and FLIP within a mask.
        for (size, linear, golden) in [
            (
                [1, 1],
                false,
                [
                    6.44386325478049,
                    0.3197926513000359,
                    0.9634021520614624,
                    6.44386325478049,
                    0.9634021520614624,
                ],
            ),
            (
                [3, 40],
                true,
                [
                    7.1262301557710295,
                    0.17722107799411485,
                    0.8853924530247848,
                    6.988932933773908,
                    0.8792710785682385,
                ],
            ),
            (
                [97, 61],
                false,
                [
                    7.662146995388643,
                    0.37054991837536105,
                    0.8596528317298925,
                    7.66799351326473,
                    0.8596487992806936,
                ],
            ),
            (
                [700, 3],
                false,
                [
                    7.605559220289399,
                    0.3605716119449608,
                    0.8565600915324121,
                    7.613873849870618,
                    0.8563877833882968,
                ],
            ),
            (
                [530, 130],
                true,
                [
                    7.353651464758176,
                    0.28127209013080756,
                    0.9200492102865816,
                    7.351884510971761,
                    0.9200366353904071,
                ],
            ),
        ] {
            let [a, b] = unlike(size, linear);
            let mask: Vec<bool> = (0..a.colors.len()).map(|i| i % 7 < 3).collect();
            let mut finished = [0; 2];
            let difference = Difference::watched(&a, &b, &mut |pixels| finished[0] += pixels);
            let ssim = difference.ssim_watched(&mut |pixels| finished[1] += pixels);
            let masked = [difference.psnr_within(&mask), difference.flip_within(&mask)];
            let found = [difference.psnr(), ssim, difference.flip(), masked[0], masked[1]];
            // Systems round a power differently, by a unit in the last place.
            let near = found.iter().zip(golden).all(|(found, golden)| (found - golden).abs() < 1e-8);
            assert!(near, "{size:?}: {found:?}, not {golden:?}");
            assert_eq!(finished, [size[0] * size[1]; 2]);
        }
    }
}
