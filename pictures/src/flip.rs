//! FLIP, the difference that a person sees when two images alternate in place (Andersson et al. 2020, "FLIP: A
//! Difference Evaluator for Alternating Images"). Section numbers below are that paper's.

use crate::tiles::{Tile, by_tiles};

/// Pixels per degree of the visual field: a 4K monitor at 0.7 m.
pub const PIXELS_PER_DEGREE: f32 = 67.0;

/// Terms of the contrast sensitivity filters of Y, Cx and Cz (table 1): pairs of weight a and width b in
/// a sqrt(pi / b) exp(-pi^2 x^2 / b), x in degrees.
const SENSITIVITY: [&[[f64; 2]]; 3] = [&[[1.0, 0.0047]], &[[1.0, 0.0053]], &[[34.1, 0.04], [13.5, 0.025]]];

/// Exponent of the colour difference (section 4.1.3).
const COLOR_EXPONENT: f32 = 0.7;
/// The share `COLOR_KNEE` of the largest colour difference maps to the error `COLOR_KNEE_ERROR` (section 4.1.3).
const COLOR_KNEE: f32 = 0.4;
const COLOR_KNEE_ERROR: f32 = 0.95;
/// Width of the feature detectors in degrees, and exponent of the feature difference (section 4.2).
const FEATURE_WIDTH: f64 = 0.082;
const FEATURE_EXPONENT: f32 = 0.5;

/// One number per pixel.
type Plane = Vec<f32>;

/// The error of each pixel of `test` against `reference`, 0 to 1, at 67 pixels per degree. Both hold sRGB colours in
/// [0, 1] of an image of width and height `size`.
pub fn flip(reference: &[[f32; 3]], test: &[[f32; 3]], size: [usize; 2]) -> Plane {
    let mut errors = Vec::with_capacity(reference.len());
    flip_of(size, |i| reference[i], |i| test[i], |band| errors.extend_from_slice(band));
    errors
}

/// The same for images whose pixels are given by index. `band` takes the errors of some whole rows at a time, in the
/// order of the image.
pub(crate) fn flip_of(
    size: [usize; 2],
    reference: impl Fn(usize) -> [f32; 3] + Sync,
    test: impl Fn(usize) -> [f32; 3] + Sync,
    band: impl FnMut(&[f32]),
) {
    let (sensitivity, detectors, differences) = (Sensitivity::new(), Detectors::new(), Differences::new());
    let errors = |tile: &Tile| -> Plane {
        let around = tile.grown(sensitivity.radius.max(detectors.radius), size);
        let place = Place { tile, around: &around, size };
        let (opponent_a, opponent_b) =
            (opponent(around.map(size[0], &reference)), opponent(around.map(size[0], &test)));
        let colors =
            differences.of(&sensitivity.seen(&opponent_a, &place), &sensitivity.seen(&opponent_b, &place));
        let features = detectors.differences(&opponent_a[0], &opponent_b[0], &place);
        colors.iter().zip(&features).map(|(color, feature)| color.powf(1.0 - feature)).collect()
    };
    by_tiles(size, errors, band);
}

/// A tile, the pixels around it whose values are known, and the size of the image.
struct Place<'a> {
    tile: &'a Tile,
    around: &'a Tile,
    size: [usize; 2],
}

/// sRGB as planes of the opponent space YCxCz, for which the contrast sensitivity is known (section 4.1.1).
fn opponent(colors: Vec<[f32; 3]>) -> [Plane; 3] {
    let mut planes = [0, 1, 2].map(|_| Vec::with_capacity(colors.len()));
    for color in colors {
        let [x, y, z] = relative_xyz(color.map(decode));
        for (plane, value) in planes.iter_mut().zip([116.0 * y - 16.0, 500.0 * (x - y), 200.0 * (y - z)]) {
            plane.push(value);
        }
    }
    planes
}

/// The filters of the contrast sensitivity (section 4.1.1).
struct Sensitivity {
    radius: usize,
    /// For Y, Cx and Cz: Gaussians and their shares.
    terms: [Vec<(f32, Vec<f64>)>; 3],
}

impl Sensitivity {
    fn new() -> Self {
        let widest =
            SENSITIVITY.iter().flat_map(|terms| terms.iter()).map(|term| term[1]).fold(0.0, f64::max);
        let pi = std::f64::consts::PI;
        let degree = f64::from(PIXELS_PER_DEGREE);
        // Three standard deviations of the widest Gaussian.
        let radius = (3.0 * (widest / (2.0 * pi * pi)).sqrt() * degree).ceil() as i32;
        let terms = SENSITIVITY.map(|terms| {
            let gaussians = terms
                .iter()
                .map(|[_, b]| kernel(radius, |x| (-(pi * x / degree).powi(2) / b).exp()))
                .collect::<Vec<_>>();
            let sums: Vec<f64> = gaussians.iter().map(|g| g.iter().sum::<f64>().powi(2)).collect();
            let weights: Vec<f64> =
                terms.iter().zip(&sums).map(|([a, b], sum)| a * (pi / b).sqrt() * sum).collect();
            let total: f64 = weights.iter().sum();
            let unit = |(gaussian, sum): (&Vec<f64>, &f64)| -> Vec<f64> {
                gaussian.iter().map(|value| value / sum.sqrt()).collect()
            };
            let units = gaussians.iter().zip(&sums).map(unit);
            weights.iter().map(|weight| (weight / total) as f32).zip(units).collect()
        });
        Self { radius: radius as usize, terms }
    }

    /// The tile as seen at this distance: filtered, back in linear RGB within [0, 1].
    fn seen(&self, opponent: &[Plane; 3], place: &Place) -> Vec<[f32; 3]> {
        let filtered = |lane: usize| {
            let mut out = vec![0.0; place.tile.x.len() * place.tile.y.len()];
            for (share, unit) in &self.terms[lane] {
                let part = convolve(&opponent[lane], place, unit, unit);
                out.iter_mut().zip(&part).for_each(|(out, part)| *out += share * part);
            }
            out
        };
        let [ys, cxs, czs] = [0, 1, 2].map(filtered);
        let color = |i: usize| {
            let y = (ys[i] + 16.0) / 116.0;
            linear_rgb([y + cxs[i] / 500.0, y, y - czs[i] / 200.0]).map(|channel| channel.clamp(0.0, 1.0))
        };
        (0..ys.len()).map(color).collect()
    }
}

/// Differences of linear colours, 0 to 1 (sections 4.1.2 and 4.1.3).
struct Differences {
    /// That of green and blue.
    largest: f32,
}

impl Differences {
    fn new() -> Self {
        Self { largest: Self::distance([0.0, 1.0, 0.0], [0.0, 0.0, 1.0]) }
    }

    fn distance(a: [f32; 3], b: [f32; 3]) -> f32 {
        hybrid_distance(hunt(lab(a)), hunt(lab(b))).powf(COLOR_EXPONENT)
    }

    fn of(&self, a: &[[f32; 3]], b: &[[f32; 3]]) -> Plane {
        let largest = self.largest;
        let knee = COLOR_KNEE * largest;
        let error = |difference: f32| {
            if difference < knee {
                COLOR_KNEE_ERROR / knee * difference
            } else {
                COLOR_KNEE_ERROR + (1.0 - COLOR_KNEE_ERROR) * (difference - knee) / (largest - knee)
            }
        };
        a.iter().zip(b).map(|(&a, &b)| error(Self::distance(a, b)).clamp(0.0, 1.0)).collect()
    }
}

/// The detectors of edges and points in the luminances Y of the opponent space (section 4.2).
struct Detectors {
    radius: usize,
    smooth: Vec<f64>,
    edge: Vec<f64>,
    point: Vec<f64>,
}

impl Detectors {
    fn new() -> Self {
        let deviation = 0.5 * FEATURE_WIDTH * f64::from(PIXELS_PER_DEGREE);
        let radius = (3.0 * deviation).ceil() as i32;
        let gaussian = |x: f64| (-0.5 * (x / deviation).powi(2)).exp();
        Self {
            radius: radius as usize,
            smooth: balanced(kernel(radius, gaussian)),
            edge: balanced(kernel(radius, |x| -x * gaussian(x))),
            point: balanced(kernel(radius, |x| ((x / deviation).powi(2) - 1.0) * gaussian(x))),
        }
    }

    /// Differences of edges and points, 0 to 1.
    fn differences(&self, a: &[f32], b: &[f32], place: &Place) -> Plane {
        let Self { smooth, edge, point, .. } = self;
        let strengths = |luminance: &[f32]| {
            let scaled: Plane = luminance.iter().map(|y| (y + 16.0) / 116.0).collect();
            [edge, point].map(|derivative| -> Plane {
                let along_x = convolve(&scaled, place, derivative, smooth);
                let along_y = convolve(&scaled, place, smooth, derivative);
                along_x.iter().zip(&along_y).map(|(x, y)| x.hypot(*y)).collect()
            })
        };
        let ([edges_a, points_a], [edges_b, points_b]) = (strengths(a), strengths(b));
        let difference = |i: usize| {
            let larger = (edges_a[i] - edges_b[i]).abs().max((points_a[i] - points_b[i]).abs());
            (larger * std::f32::consts::FRAC_1_SQRT_2).powf(FEATURE_EXPONENT).clamp(0.0, 1.0)
        };
        (0..edges_a.len()).map(difference).collect()
    }
}

/// Samples of a function at the integers from -radius to radius.
fn kernel(radius: i32, value: impl Fn(f64) -> f64) -> Vec<f64> {
    (-radius..=radius).map(|x| value(f64::from(x))).collect()
}

/// Scaled so that the positive weights sum to 1, and the negative ones to -1.
fn balanced(kernel: Vec<f64>) -> Vec<f64> {
    let positive: f64 = kernel.iter().filter(|weight| **weight > 0.0).sum();
    let negative: f64 = kernel.iter().filter(|weight| **weight < 0.0).sum();
    kernel
        .into_iter()
        .map(|weight| if weight > 0.0 { weight / positive } else { weight / negative.abs().max(1e-30) })
        .collect()
}

/// A tile of the values `around` it, convolved with the separable kernel `along_x` times `along_y`; pixels outside of the
/// image repeat its edge pixels.
fn convolve(values: &[f32], place: &Place, along_x: &[f64], along_y: &[f64]) -> Plane {
    let Place { tile, around, size } = place;
    // From a pixel's first tap on, in the image.
    let clamped = |at: usize, radius: usize, count: usize| at.saturating_sub(radius).min(count - 1);
    let width = tile.x.len();
    let radius = along_y.len() / 2;
    let needed = tile.grown(radius, *size).y;
    let mut rows = Vec::with_capacity(width * needed.len());
    let mut taps = Vec::with_capacity(width + along_x.len());
    for y in needed.clone() {
        let row = &values[(y - around.y.start) * around.x.len()..][..around.x.len()];
        let end = tile.x.end + 2 * (along_x.len() / 2);
        taps.clear();
        taps.extend(
            (tile.x.start..end).map(|at| row[clamped(at, along_x.len() / 2, size[0]) - around.x.start]),
        );
        let begin = rows.len();
        rows.resize(begin + width, 0.0);
        accumulate(&mut rows[begin..], along_x, |tap| &taps[tap..][..width]);
    }
    let mut out = vec![0.0; width * tile.y.len()];
    for (y, out) in tile.y.clone().zip(out.chunks_mut(width)) {
        let row = |tap: usize| clamped(y + tap, radius, size[1]) - needed.start;
        accumulate(out, along_y, |tap| &rows[row(tap) * width..][..width]);
    }
    out
}

/// Adds up each tap's values times its weight. All pixels of a row take one tap after the other, so that several are in
/// work at once.
fn accumulate<'a>(sums: &mut [f32], weights: &[f64], values: impl Fn(usize) -> &'a [f32]) {
    for (tap, weight) in weights.iter().enumerate() {
        let weight = *weight as f32;
        sums.iter_mut().zip(values(tap)).for_each(|(sum, value)| *sum += weight * value);
    }
}

/// sRGB in [0, 1] as linear light.
fn decode(value: f32) -> f32 {
    if value <= 0.04045 { value / 12.92 } else { ((value + 0.055) / 1.055).powf(2.4) }
}

/// Rows of the matrix from linear sRGB to XYZ, from the primaries and D65 in exact fractions.
const XYZ_OF_RGB: [[f64; 3]; 3] = [
    [10_135_552.0 / 24_577_794.0, 8_788_810.0 / 24_577_794.0, 4_435_075.0 / 24_577_794.0],
    [2_613_072.0 / 12_288_897.0, 8_788_810.0 / 12_288_897.0, 887_015.0 / 12_288_897.0],
    [1_425_312.0 / 73_733_382.0, 8_788_810.0 / 73_733_382.0, 70_074_185.0 / 73_733_382.0],
];

/// Linear RGB as XYZ, each component relative to that of white.
fn relative_xyz(rgb: [f32; 3]) -> [f32; 3] {
    XYZ_OF_RGB.map(|row| {
        let white: f64 = row.iter().sum();
        (row.iter().zip(rgb).map(|(weight, channel)| weight * f64::from(channel)).sum::<f64>() / white) as f32
    })
}

/// The inverse of [`relative_xyz`].
fn linear_rgb(xyz: [f32; 3]) -> [f32; 3] {
    let m = XYZ_OF_RGB;
    let xyz = [0, 1, 2].map(|i| f64::from(xyz[i]) * m[i].iter().sum::<f64>());
    // Cramer's rule: the matrix with one column replaced, over the matrix.
    let determinant = |m: [[f64; 3]; 3]| -> f64 {
        let minor = |a: usize, b: usize| m[1][a] * m[2][b] - m[1][b] * m[2][a];
        m[0][0] * minor(1, 2) - m[0][1] * minor(0, 2) + m[0][2] * minor(0, 1)
    };
    [0, 1, 2].map(|column| {
        let mut replaced = m;
        for (row, value) in replaced.iter_mut().zip(xyz) {
            row[column] = value;
        }
        (determinant(replaced) / determinant(m)) as f32
    })
}

/// Linear RGB as CIE L*a*b* relative to D65.
fn lab(rgb: [f32; 3]) -> [f32; 3] {
    const DELTA: f32 = 6.0 / 29.0;
    let root = |t: f32| {
        if t > DELTA * DELTA * DELTA { t.cbrt() } else { t / (3.0 * DELTA * DELTA) + 4.0 / 29.0 }
    };
    let [x, y, z] = relative_xyz(rgb).map(root);
    [116.0 * y - 16.0, 500.0 * (x - y), 200.0 * (y - z)]
}

/// The Hunt effect: colours look more saturated where it is brighter (section 4.1.2).
fn hunt([l, a, b]: [f32; 3]) -> [f32; 3] {
    [l, 0.01 * l * a, 0.01 * l * b]
}

/// City-block distance in lightness, Euclidean in hue: suited to large differences (section 4.1.2).
fn hybrid_distance(a: [f32; 3], b: [f32; 3]) -> f32 {
    (a[0] - b[0]).abs() + (a[1] - b[1]).hypot(a[2] - b[2])
}

/// Mean of the errors.
pub fn mean(errors: impl IntoIterator<Item = f32>) -> f64 {
    let (mut sum, mut count) = (0.0, 0);
    for error in errors {
        sum += f64::from(error);
        count += 1;
    }
    sum / f64::from(count.max(1))
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use nv_flip::FlipImageRgb8;

    use super::*;
    use crate::{Difference, Picture, tone::to_byte};

    /// Two unlike images with smooth parts, edges and noise, as bytes.
    fn images([width, height]: [usize; 2]) -> [Vec<[u8; 3]>; 2] {
        let mut state = 1u32;
        let mut noise = || {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            (state >> 24) as u8
        };
        let mut images = [Vec::new(), Vec::new()];
        for y in 0..height {
            for x in 0..width {
                let (u, v) = ((x * 255 / width) as u8, (y * 255 / height) as u8);
                let square = if (x / 9 + y / 7) % 2 == 0 { 220 } else { 30 };
                images[0].push([u, v, square]);
                images[1].push([u / 2 + noise() / 4, square, if x > y { v } else { 255 - u }]);
            }
        }
        images
    }

    fn unit(bytes: &[[u8; 3]]) -> Vec<[f32; 3]> {
        bytes.iter().map(|color| color.map(|channel| f32::from(channel) / 255.0)).collect()
    }

    fn nvidias([a, b]: &[Vec<[u8; 3]>; 2], [width, height]: [usize; 2]) -> Vec<f32> {
        let image =
            |colors: &[[u8; 3]]| FlipImageRgb8::with_data(width as u32, height as u32, colors.as_flattened());
        nv_flip::flip(image(a), image(b), PIXELS_PER_DEGREE).to_vec()
    }

    #[test]
    fn every_pixel_is_as_nvidias_own_code_has_it() {
        for size in [[64, 48], [7, 5], [1, 1], [200, 3]] {
            let images = images(size);
            let ours = flip(&unit(&images[0]), &unit(&images[1]), size);
            for (index, (ours, theirs)) in ours.iter().zip(nvidias(&images, size)).enumerate() {
                assert!((ours - theirs).abs() < 1e-4, "{size:?} pixel {index}: {ours} and {theirs}");
            }
        }
    }

    #[test]
    fn errors_of_stored_pictures_are_as_nvidias_own_code_has_them() {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../tests/scikit-image");
        let read = |name: &str| Picture::read(&folder.join(format!("{name}.png"))).unwrap();
        let bytes = |picture: &Picture| picture.srgb().into_iter().map(|color| color.map(to_byte)).collect();
        for (scene, graph) in
            [("cornell", "epi"), ("cornell", "render-cache"), ("chains", "epi"), ("chains", "render-cache")]
        {
            let pictures = [format!("{scene}-converged"), format!("{scene}-{graph}")].map(|name| read(&name));
            let size = pictures[0].size;
            let theirs = nvidias(&[bytes(&pictures[0]), bytes(&pictures[1])], size);
            let ours = Difference::new(&pictures[0], &pictures[1]);
            for (index, (ours, theirs)) in ours.errors.iter().zip(&theirs).enumerate() {
                assert!((ours - theirs).abs() < 1e-4, "{scene}, {graph}, {index}: {ours} and {theirs}");
            }
            let off = ours.flip() - mean(theirs);
            println!("{scene}, {graph}: FLIP {}, off by {off}", ours.flip());
            assert!(off.abs() < 1e-5 && ours.flip() > 0.01, "{scene}, {graph}: {off}");
        }
    }

    #[test]
    fn ends_of_the_scale() {
        let (black, white) = (vec![[0.0; 3]; 192], vec![[1.0; 3]; 192]);
        assert_eq!(mean(flip(&white, &white, [16, 12])), 0.0);
        assert!(mean(flip(&black, &white, [16, 12])) > 0.9);
    }
}
