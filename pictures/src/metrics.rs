//! Difference measures for two images of the same size.

/// Root of the mean squared difference over all values.
pub fn rmse(a: &[[f32; 3]], b: &[[f32; 3]]) -> f64 {
    let squares =
        a.as_flattened().iter().zip(b.as_flattened()).map(|(a, b)| (f64::from(*a) - f64::from(*b)).powi(2));
    (squares.sum::<f64>() / (3 * a.len()).max(1) as f64).sqrt()
}

/// Peak signal-to-noise ratio in decibels for values in [0, 1]; infinite for equal images.
pub fn psnr(a: &[[f32; 3]], b: &[[f32; 3]]) -> f64 {
    -20.0 * rmse(a, b).log10()
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
pub fn ssim(a: &[[f32; 3]], b: &[[f32; 3]], [width, height]: [usize; 2]) -> f64 {
    // Rec. 601 luma, on which the measure was calibrated.
    let luma = |[r, g, b]: [f32; 3]| 0.299 * f64::from(r) + 0.587 * f64::from(g) + 0.114 * f64::from(b);
    let a: Vec<f64> = a.iter().copied().map(luma).collect();
    let b: Vec<f64> = b.iter().copied().map(luma).collect();
    let product = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).collect::<Vec<f64>>();
    let blurred = |values: &[f64]| blur(values, [width, height]);
    let (mean_a, mean_b) = (blurred(&a), blurred(&b));
    let (square_a, square_b, cross) =
        (blurred(&product(&a, &a)), blurred(&product(&b, &b)), blurred(&product(&a, &b)));
    let sum: f64 = (0..a.len())
        .map(|i| {
            let (ma, mb) = (mean_a[i], mean_b[i]);
            let (va, vb, cov) = (square_a[i] - ma * ma, square_b[i] - mb * mb, cross[i] - ma * mb);
            (2.0 * ma * mb + SSIM_C1) * (2.0 * cov + SSIM_C2)
                / ((ma * ma + mb * mb + SSIM_C1) * (va + vb + SSIM_C2))
        })
        .sum();
    sum / a.len().max(1) as f64
}

/// Gaussian mean around every pixel, row-wise then column-wise.
fn blur(values: &[f64], [width, height]: [usize; 2]) -> Vec<f64> {
    let along = |values: &[f64], count: usize, step: usize, start: usize, at: usize| {
        let (mut sum, mut weight) = (0.0, 0.0);
        for other in at.saturating_sub(SSIM_RADIUS)..(at + SSIM_RADIUS + 1).min(count) {
            let distance = other as f64 - at as f64;
            let w = (-0.5 * (distance / SSIM_SIGMA).powi(2)).exp();
            sum += w * values[start + other * step];
            weight += w;
        }
        sum / weight
    };
    let pixels = || (0..height).flat_map(|y| (0..width).map(move |x| (x, y)));
    let rows: Vec<f64> = pixels().map(|(x, y)| along(values, width, 1, y * width, x)).collect();
    pixels().map(|(x, y)| along(&rows, height, width, x, y)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

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
    fn inverted_structure_is_dissimilar() {
        let a = gradient();
        let b: Vec<[f32; 3]> = a.iter().map(|c| c.map(|v| 1.0 - v)).collect();
        assert!(ssim(&a, &b, SIZE) < 0.2);
    }
}
