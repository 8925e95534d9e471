//! Difference measures for two images of the same size.

use crate::tiles::{Tile, by_tiles};

/// Root of the mean squared difference over all values.
pub fn rmse(a: &[[f32; 3]], b: &[[f32; 3]]) -> f64 {
    rmse_of(a.iter().copied().zip(b.iter().copied()))
}

/// The same for pairs of colours.
pub(crate) fn rmse_of(pairs: impl Iterator<Item = ([f32; 3], [f32; 3])>) -> f64 {
    let (mut squares, mut count) = (0.0, 0);
    for (a, b) in pairs {
        for (a, b) in a.into_iter().zip(b) {
            squares += (f64::from(a) - f64::from(b)).powi(2);
        }
        count += 3;
    }
    (squares / count.max(1) as f64).sqrt()
}

/// What relative errors add to the square of the reference, so that black pixels do not count infinitely.
const REL_MSE_FLOOR: f64 = 0.01;
/// The share of the pixels, those with the largest errors, that [`rel_mse`] leaves out.
const REL_MSE_OUTLIERS: f64 = 0.001;

/// Mean relative squared error of linear colours: (a - r)^2 / (r^2 + 0.01), mean over the channels of a pixel, then over
/// the pixels but for the 0.1% (rounded down) with the largest errors.
pub fn rel_mse(reference: &[[f32; 3]], test: &[[f32; 3]]) -> f64 {
    let of_pixel = |(r, a): (&[f32; 3], &[f32; 3])| {
        let channel = |(&r, &a): (&f32, &f32)| {
            let (r, a) = (f64::from(r), f64::from(a));
            (a - r).powi(2) / (r * r + REL_MSE_FLOOR)
        };
        r.iter().zip(a).map(channel).sum::<f64>() / 3.0
    };
    let mut errors: Vec<f64> = reference.iter().zip(test).map(of_pixel).collect();
    errors.sort_unstable_by(f64::total_cmp);
    errors.truncate(errors.len() - (errors.len() as f64 * REL_MSE_OUTLIERS) as usize);
    errors.iter().sum::<f64>() / errors.len().max(1) as f64
}

/// Peak signal-to-noise ratio in decibels for values in [0, 1]; infinite for equal images.
pub fn psnr(a: &[[f32; 3]], b: &[[f32; 3]]) -> f64 {
    decibels(rmse(a, b))
}

/// The peak signal-to-noise ratio of a root mean squared error.
pub(crate) fn decibels(rmse: f64) -> f64 {
    -20.0 * rmse.log10()
}

/// Half the side of SSIM's window and the standard deviation of its Gaussian, in pixels (Wang et al. 2004, section
/// III.C).
const SSIM_RADIUS: usize = 5;
const SSIM_SIGMA: f64 = 1.5;
/// (K1 L)^2 and (K2 L)^2 for values in [0, 1] (Wang et al. 2004, equations 9 and 11).
const SSIM_C1: f64 = 0.01 * 0.01;
const SSIM_C2: f64 = 0.03 * 0.03;

/// Mean structural similarity (Wang et al. 2004) of the lumas of two sRGB-encoded images: an 11 x 11 Gaussian window at
/// every pixel, renormalised where it leaves the image.
pub fn ssim(a: &[[f32; 3]], b: &[[f32; 3]], size: [usize; 2]) -> f64 {
    ssim_of(size, |i| a[i], |i| b[i], &mut |_| {})
}

/// The same for images whose pixels are given by index. `progress` takes the numbers of pixels that are finished.
pub(crate) fn ssim_of(
    size: [usize; 2],
    a: impl Fn(usize) -> [f32; 3] + Sync,
    b: impl Fn(usize) -> [f32; 3] + Sync,
    progress: &mut dyn FnMut(usize),
) -> f64 {
    let mut sum = 0.0;
    // In the order of the image, so that the sum does not depend on the tiles.
    similarities(size, a, b, |band| {
        band.iter().for_each(|similarity| sum += similarity);
        progress(band.len());
    });
    sum / (size[0] * size[1]).max(1) as f64
}

/// The structural similarity around every pixel, handed over in bands of rows from the top.
fn similarities(
    size: [usize; 2],
    a: impl Fn(usize) -> [f32; 3] + Sync,
    b: impl Fn(usize) -> [f32; 3] + Sync,
    take: impl FnMut(&[f64]),
) {
    // Rec. 601 luma, on which the measure was calibrated.
    let luma = |[r, g, b]: [f32; 3]| 0.299 * f64::from(r) + 0.587 * f64::from(g) + 0.114 * f64::from(b);
    let similarities = |tile: &Tile| -> Vec<f64> {
        let around = tile.grown(SSIM_RADIUS, size);
        let a: Vec<f64> = around.map(size[0], |i| luma(a(i)));
        let b: Vec<f64> = around.map(size[0], |i| luma(b(i)));
        let product = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).collect::<Vec<f64>>();
        let blurred = |values: &[f64]| blur(values, &around, tile);
        let (mean_a, mean_b) = (blurred(&a), blurred(&b));
        let (square_a, square_b, cross) =
            (blurred(&product(&a, &a)), blurred(&product(&b, &b)), blurred(&product(&a, &b)));
        let similarity = |i: usize| {
            let (ma, mb) = (mean_a[i], mean_b[i]);
            let (va, vb, cov) = (square_a[i] - ma * ma, square_b[i] - mb * mb, cross[i] - ma * mb);
            (2.0 * ma * mb + SSIM_C1) * (2.0 * cov + SSIM_C2)
                / ((ma * ma + mb * mb + SSIM_C1) * (va + vb + SSIM_C2))
        };
        (0..mean_a.len()).map(similarity).collect()
    };
    by_tiles(size, similarities, take);
}

/// Gaussian mean around every pixel of `tile`, row-wise then column-wise, of the values `around` it. Where these end, the
/// image ends.
fn blur(values: &[f64], around: &Tile, tile: &Tile) -> Vec<f64> {
    let weights: [f64; 2 * SSIM_RADIUS + 1] = std::array::from_fn(|tap| {
        let distance = tap as f64 - SSIM_RADIUS as f64;
        (-0.5 * (distance / SSIM_SIGMA).powi(2)).exp()
    });
    let (width, count) = (tile.x.len(), around.x.len());
    let (left, above) = (tile.x.start - around.x.start, tile.y.start - around.y.start);
    let rows: Vec<f64> = values
        .chunks(count)
        .flat_map(|row| {
            let (mut sums, mut totals) = (vec![0.0; width], vec![0.0; width]);
            for (tap, weight) in weights.iter().enumerate() {
                // The pixels of the tile whose tap lies in the image, and the first of these taps.
                let begin = SSIM_RADIUS.saturating_sub(left + tap).min(width);
                let end = (count + SSIM_RADIUS).saturating_sub(left + tap).clamp(begin, width);
                let from = (begin + left + tap).saturating_sub(SSIM_RADIUS);
                let taken = &row[from.min(count)..];
                let sums = sums[begin..end].iter_mut().zip(&mut totals[begin..end]);
                for ((sum, total), value) in sums.zip(taken) {
                    *sum += weight * value;
                    *total += weight;
                }
            }
            sums.into_iter().zip(totals).map(|(sum, total)| sum / total)
        })
        .collect();
    let height = around.y.len();
    (0..tile.y.len())
        .flat_map(|y| {
            let (mut sums, mut total) = (vec![0.0; width], 0.0);
            for (tap, weight) in weights.iter().enumerate() {
                let Some(row) = (y + above + tap).checked_sub(SSIM_RADIUS).filter(|row| *row < height) else {
                    continue;
                };
                total += weight;
                for (sum, value) in sums.iter_mut().zip(&rows[row * width..][..width]) {
                    *sum += weight * value;
                }
            }
            sums.into_iter().map(move |sum| sum / total)
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;
    use crate::{Difference, Picture};

    const SIZE: [usize; 2] = [16, 12];

    fn gradient() -> Vec<[f32; 3]> {
        (0..192).map(|i| [(i % 16) as f32 / 15.0, (i / 16) as f32 / 11.0, 0.25]).collect()
    }

    #[test]
    fn equal_images_differ_by_nothing() {
        let a = gradient();
        assert_eq!(rmse(&a, &a), 0.0);
        assert_eq!(psnr(&a, &a), f64::INFINITY);
        assert!((ssim(&a, &a, SIZE) - 1.0).abs() < 1e-12);
    }

    #[test]
    fn a_constant_difference_by_hand() {
        let a = vec![[0.5; 3]; 192];
        let b = vec![[0.6; 3]; 192];
        assert!((rmse(&a, &b) - 0.1).abs() < 1e-6);
        assert!((psnr(&a, &b) - 20.0).abs() < 1e-5);
        // No structure: only the luminance term is left, (2 * 0.3 + C1) / (0.25 + 0.36 + C1).
        assert!((ssim(&a, &b, SIZE) - 0.6001 / 0.6101).abs() < 1e-6);
    }

    #[test]
    fn relative_errors_by_hand() {
        // (0.6 - 0.5)^2 / (0.25 + 0.01) in one channel of three.
        let (a, b) = ([[0.5, 0.5, 0.5]; 4], [[0.6, 0.5, 0.5]; 4]);
        assert!((rel_mse(&a, &b) - 0.01 / 0.26 / 3.0).abs() < 1e-7);
        assert_eq!(rel_mse(&[], &[]), 0.0);
        // Two of 2999 pixels are outliers and left out; a third one counts.
        let black = vec![[0.0; 3]; 2999];
        let mut bright = black.clone();
        bright[7] = [9.0; 3];
        bright[2998] = [8.0; 3];
        assert_eq!(rel_mse(&black, &bright), 0.0);
        bright[100] = [0.1; 3];
        assert!((rel_mse(&black, &bright) - 1.0 / 2997.0).abs() < 1e-7);
    }

    /// Random numbers from 0 to 1, more alike the larger `blend`.
    fn textured(blend: f32) -> [Vec<[f32; 3]>; 2] {
        let mut state = 1_u32;
        let mut random = || {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            (state >> 8) as f32 / (1 << 24) as f32
        };
        let a: Vec<[f32; 3]> = (0..192).map(|_| [random(), random(), random()]).collect();
        let b = a.iter().map(|color| color.map(|value| blend * value + (1.0 - blend) * random())).collect();
        [a, b]
    }

    /// SSIM as in the paper, equation 13 and section III.C: one window at a time, from the deviations themselves.
    fn ssim_of_windows(a: &[[f32; 3]], b: &[[f32; 3]]) -> f64 {
        let luma = |color: &[f32; 3]| {
            color
                .iter()
                .zip([0.299, 0.587, 0.114])
                .map(|(&value, weight)| f64::from(value) * weight)
                .sum::<f64>()
        };
        let window = |x: i32, y: i32| {
            let offsets = (-5..=5).flat_map(|dy| (-5..=5).map(move |dx| (dx, dy)));
            let inside =
                offsets.filter(move |(dx, dy)| (0..16).contains(&(x + dx)) && (0..12).contains(&(y + dy)));
            let weighted = inside.map(move |(dx, dy)| {
                let at = (16 * (y + dy) + x + dx) as usize;
                ((f64::from(dx * dx + dy * dy) / -4.5).exp(), luma(&a[at]), luma(&b[at]))
            });
            weighted.collect::<Vec<(f64, f64, f64)>>()
        };
        let of_window = |(x, y)| {
            let window: Vec<(f64, f64, f64)> = window(x, y);
            let total: f64 = window.iter().map(|(weight, ..)| weight).sum();
            let mean = |value: &dyn Fn(f64, f64) -> f64| {
                window.iter().map(|&(weight, a, b)| weight * value(a, b)).sum::<f64>() / total
            };
            let (ma, mb) = (mean(&|a, _| a), mean(&|_, b| b));
            let (va, vb) = (mean(&|a, _| (a - ma).powi(2)), mean(&|_, b| (b - mb).powi(2)));
            let cov = mean(&|a, b| (a - ma) * (b - mb));
            let (c1, c2) = (0.0001, 0.0009);
            (2.0 * ma * mb + c1) * (2.0 * cov + c2) / ((ma * ma + mb * mb + c1) * (va + vb + c2))
        };
        (0..12).flat_map(|y| (0..16).map(move |x| (x, y))).map(of_window).sum::<f64>() / 192.0
    }

    #[test]
    fn ssim_of_textures_is_that_of_the_formula() {
        for (blend, about) in [(0.2, 0.3), (0.5, 0.6), (0.9, 1.0)] {
            let [a, b] = textured(blend);
            let (found, expected) = (ssim(&a, &b, SIZE), ssim_of_windows(&a, &b));
            assert!((found - expected).abs() < 1e-9, "{found}, expected {expected}");
            assert!((found - about).abs() < 0.2, "{found} for textures that are {blend} alike");
        }
    }

    #[test]
    fn psnr_and_ssim_of_stored_pictures_are_those_of_scikit_image() {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../tests/scikit-image");
        let figures = std::fs::read_to_string(folder.join("figures.csv")).unwrap();
        let read = |name: &str| Picture::read(&folder.join(format!("{name}.png"))).unwrap();
        let mut count = 0;
        for line in figures.lines().skip(1) {
            let fields: Vec<&str> = line.split(',').collect();
            let [reference, picture] = [0, 1].map(|field| read(fields[field]));
            let [psnr_there, ssim_there] = [2, 3].map(|field| fields[field].parse::<f64>().unwrap());
            let difference = Difference::new(&reference, &picture);
            assert!((difference.psnr() - psnr_there).abs() < 1e-6, "{line}: PSNR is {}", difference.psnr());
            // Scikit-image takes the mean over the pixels whose window lies in the picture.
            let size = reference.size;
            let mut all = Vec::new();
            similarities(size, |i| reference.srgb_at(i), |i| picture.srgb_at(i), |band| all.extend(band));
            let whole = all.iter().sum::<f64>() / all.len() as f64;
            assert!((whole - difference.ssim()).abs() < 1e-12, "{line}");
            let [columns, rows] = size.map(|side| SSIM_RADIUS..side - SSIM_RADIUS);
            let within: Vec<f64> = rows.flat_map(|y| &all[y * size[0]..][columns.clone()]).copied().collect();
            let ssim = within.iter().sum::<f64>() / within.len() as f64;
            assert!((ssim - ssim_there).abs() < 1e-6, "{line}: SSIM is {ssim}");
            count += 1;
        }
        assert_eq!(count, 4);
    }

    #[test]
    fn inverted_structure_is_dissimilar() {
        let a = gradient();
        let b: Vec<[f32; 3]> = a.iter().map(|c| c.map(|v| 1.0 - v)).collect();
        assert!(ssim(&a, &b, SIZE) < 0.2);
    }
}
