//! Measures of the difference between a picture and its reference, as a viewer sees both.

use crate::{Picture, flip, metrics, tone};

/// Two pictures as displayed, and FLIP's error per pixel.
pub struct Difference {
    reference: Vec<[f32; 3]>,
    picture: Vec<[f32; 3]>,
    size: [usize; 2],
    /// FLIP's errors, 0 to 1, rows from the top.
    pub errors: Vec<f32>,
}

impl Difference {
    /// Compares two pictures of the same size. Linear ones are clamped to [0, 1] and sRGB-encoded first.
    pub fn new(reference: &Picture, picture: &Picture) -> Self {
        let size = reference.size;
        let (reference, picture) = (reference.srgb(), picture.srgb());
        // A display shows eight bits, and other tools compare eight bits.
        let seen = |colors: &[[f32; 3]]| -> Vec<[f32; 3]> {
            let seen = |channel| f32::from(tone::to_byte(channel)) / 255.0;
            colors.iter().map(|color| color.map(seen)).collect()
        };
        let errors = flip::flip(&seen(&reference), &seen(&picture), size);
        Self { reference, picture, size, errors }
    }

    /// Peak signal-to-noise ratio in decibels; infinite for equal pictures.
    pub fn psnr(&self) -> f64 {
        metrics::psnr(&self.reference, &self.picture)
    }

    /// The same over the pixels set in `mask`.
    pub fn psnr_within(&self, mask: &[bool]) -> f64 {
        metrics::psnr(&chosen(&self.reference, mask), &chosen(&self.picture, mask))
    }

    /// Mean structural similarity.
    pub fn ssim(&self) -> f64 {
        metrics::ssim(&self.reference, &self.picture, self.size)
    }

    /// Mean of FLIP's errors.
    pub fn flip(&self) -> f64 {
        flip::mean(&self.errors)
    }

    /// The same over the pixels set in `mask`. A pixel's error depends on its neighbourhood, inside or outside the
    /// mask.
    pub fn flip_within(&self, mask: &[bool]) -> f64 {
        flip::mean(&chosen(&self.errors, mask))
    }
}

/// Differences of displayed colours, per channel, amplified: black where they are equal.
pub fn apart(a: &[[u8; 3]], b: &[[u8; 3]], gain: f32) -> Vec<[u8; 3]> {
    let channel = |a: u8, b: u8| (gain * f32::from(a.abs_diff(b)) + 0.5) as u8;
    a.iter().zip(b).map(|(a, b)| std::array::from_fn(|lane| channel(a[lane], b[lane]))).collect()
}

fn chosen<T: Copy>(values: &[T], mask: &[bool]) -> Vec<T> {
    values.iter().zip(mask).filter(|(_, set)| **set).map(|(value, _)| *value).collect()
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
        let difference = Difference::new(&grey(|_| 0.5), &grey(|i| if right(i) { 0.6 } else { 0.5 }));
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
}
