use std::f32::consts::{FRAC_1_PI, PI, TAU};
use std::path::Path;

use epigraph_files::Fingerprint;
use glam::{DVec3, Vec3};

use crate::SceneError;
use crate::limits::{MAX_RADIANCE, is_radiance};
use crate::texture::decode_srgb;

/// The most texels of a sky.
const MOST_TEXELS: u64 = 1 << 27;

/// Light that comes from all around, from infinitely far: an image of longitudes and latitudes.
///
/// The middle of the image is seen towards -z, its right quarter towards +x, its first row towards +y.
#[derive(Clone, PartialEq)]
pub struct Sky {
    /// The file.
    pub name: String,
    size: [u32; 2],
    /// Radiance, row by row from the top.
    texels: Vec<Vec3>,
    /// The density of sampled directions of each texel, 1/sr.
    density: Vec<f32>,
    /// The share of each row and all above in the samples, and for each row that of each texel and all to its left.
    rows: Vec<f32>,
    columns: Vec<f32>,
}

impl std::fmt::Debug for Sky {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Sky").field("name", &self.name).field("size", &self.size).finish_non_exhaustive()
    }
}

impl Sky {
    /// Takes everything that its light depends on.
    pub(crate) fn fingerprint(&self, print: &mut Fingerprint) {
        self.size.iter().for_each(|side| print.take(&side.to_le_bytes()));
        self.texels.iter().flat_map(Vec3::to_array).for_each(|value| print.take(&value.to_le_bytes()));
    }

    /// A sky of `size` texels, row by row from the top.
    ///
    /// # Errors
    /// A sentence if there are no texels, or not as many as the size says, or one is negative, not finite or beyond
    /// [`MAX_RADIANCE`].
    pub fn new(name: impl Into<String>, size: [u32; 2], texels: Vec<Vec3>) -> Result<Self, String> {
        let [width, height] = size.map(|side| side as usize);
        if texels.is_empty() || texels.len() != width * height {
            return Err(format!("a sky of {width} x {height} texels cannot have {}", texels.len()));
        }
        if let Some(at) = texels.iter().position(|&t| !is_radiance(t) || t.min_element() < 0.0) {
            return Err(format!(
                "the texel in column {}, row {} is {}; radiance lies between 0 and {MAX_RADIANCE:e}",
                at % width,
                at / width,
                texels[at]
            ));
        }
        let brightness = |x: usize, y: usize| texels[y * width + x].element_sum();
        // A direction shows the four texels around it, so that each is sampled as its neighbours require.
        let weight = |x: usize, y: usize| {
            let rows = y.saturating_sub(1)..(y + 2).min(height);
            let around = rows.flat_map(|row| [x + width - 1, x, x + 1].map(|column| (column % width, row)));
            let around: f32 = around.map(|(column, row)| brightness(column, row)).sum();
            f64::from(around / 9.0 + brightness(x, y))
        };
        let (mut rows, mut columns) = (Vec::with_capacity(height), Vec::with_capacity(width * height));
        let mut density = Vec::with_capacity(width * height);
        let mut total = 0.0;
        for y in 0..height {
            let area = solid_angle(y, size);
            let mut sum = 0.0;
            for x in 0..width {
                let weight = weight(x, y);
                density.push(weight);
                sum += weight;
                columns.push(sum);
            }
            // A row without light is never chosen.
            columns[y * width..].iter_mut().for_each(|share| *share /= if sum > 0.0 { sum } else { 1.0 });
            total += sum * area;
            rows.push(total);
        }
        let norm = if total > 0.0 { 1.0 / total } else { 0.0 };
        let share = |all: Vec<f64>, norm: f64| all.into_iter().map(|value| (value * norm) as f32).collect();
        Ok(Self {
            name: name.into(),
            size,
            texels,
            density: share(density, norm),
            rows: share(rows, norm),
            columns: share(columns, 1.0),
        })
    }

    /// Reads an HDR or EXR file; also PNG and JPEG, as sRGB.
    ///
    /// # Errors
    /// A file that cannot be read, is no image of such a format, or has unusable texels.
    pub fn load(path: &Path) -> Result<Self, SceneError> {
        let invalid = |message: String| SceneError::Invalid { path: path.to_owned(), message };
        let bytes = epigraph_files::bytes(path, epigraph_files::MOST_DATA)
            .map_err(|source| SceneError::Io { path: path.to_owned(), source })?;
        let reader = image::ImageReader::new(std::io::Cursor::new(bytes.as_slice()));
        let reader = reader.with_guessed_format().map_err(|error| invalid(error.to_string()))?;
        let format = reader.format().ok_or_else(|| {
            invalid(
                "it is no image: a sky is an HDR, EXR, PNG or JPEG file of longitudes and latitudes".into(),
            )
        })?;
        let size = image::ImageReader::with_format(std::io::Cursor::new(bytes.as_slice()), format)
            .into_dimensions()
            .map_err(|error| invalid(error.to_string()))?;
        if u64::from(size.0) * u64::from(size.1) > MOST_TEXELS {
            return Err(invalid(format!("it has {} x {} texels; make it smaller", size.0, size.1)));
        }
        let image = reader.decode().map_err(|error| invalid(error.to_string()))?;
        let is_linear = matches!(format, image::ImageFormat::Hdr | image::ImageFormat::OpenExr);
        let decode = |value: f32| if is_linear { value } else { decode_srgb(value.into()) as f32 };
        let image = image.into_rgb32f();
        let size = [image.width(), image.height()];
        let texels = image.pixels().map(|pixel| Vec3::from(pixel.0.map(decode))).collect();
        Self::new(path.to_string_lossy(), size, texels).map_err(invalid)
    }

    /// Mean radiance of all directions.
    pub(crate) fn mean(&self) -> Vec3 {
        let [width, height] = self.size.map(|side| side as usize);
        let row = |y: usize| {
            let sum: DVec3 = self.texels[y * width..][..width].iter().map(|texel| texel.as_dvec3()).sum();
            sum * solid_angle(y, self.size)
        };
        ((0..height).map(row).sum::<DVec3>() / (4.0 * std::f64::consts::PI)).as_vec3()
    }

    /// Radiance from a unit direction.
    pub fn radiance(&self, direction: Vec3) -> Vec3 {
        let [width, height] = self.size.map(|side| side as usize);
        let [u, v] = coordinates(direction);
        let (x, y) = (u * width as f32 - 0.5, v * height as f32 - 0.5);
        let (left, top) = (x.floor(), y.floor());
        let texel = |dx: i64, dy: i64| {
            let column = (left as i64 + dx).rem_euclid(width as i64) as usize;
            let row = (top as i64 + dy).clamp(0, height as i64 - 1) as usize;
            self.texels[row * width + column]
        };
        let row = |dy: i64| texel(0, dy).lerp(texel(1, dy), x - left);
        row(0).lerp(row(1), y - top)
    }

    /// Whether there is any light to sample.
    pub(crate) fn shines(&self) -> bool {
        self.rows.last().is_some_and(|&total| total > 0.0)
    }

    /// A direction of the sky, dense where it is bright, from two numbers in [0, 1), and its density, 1/sr.
    pub(crate) fn sample(&self, [s, t]: [f32; 2]) -> (Vec3, f32) {
        let [width, height] = self.size.map(|side| side as usize);
        let pick = |shares: &[f32], at: f32| {
            let index = shares.partition_point(|&share| share <= at).min(shares.len() - 1);
            let before = index.checked_sub(1).map_or(0.0, |before| shares[before]);
            let within = ((at - before) / (shares[index] - before)).clamp(0.0, 1.0);
            (index, if within.is_nan() { 0.5 } else { within })
        };
        let (row, down) = pick(&self.rows, t);
        let (column, right) = pick(&self.columns[row * width..][..width], s);
        // Even in solid angle within a row: in the cosine of the angle to the pole.
        let [top, bottom] = [row, row + 1].map(|line| (PI * line as f32 / height as f32).cos());
        let y = top + (bottom - top) * down;
        let longitude = TAU * ((column as f32 + right) / width as f32 - 0.5);
        let radius = (1.0 - y * y).max(0.0).sqrt();
        let direction = Vec3::new(radius * longitude.sin(), y, -radius * longitude.cos());
        (direction, self.density[row * width + column])
    }

    /// Density with which [`Sky::sample`] samples a unit direction, 1/sr.
    pub(crate) fn pdf(&self, direction: Vec3) -> f32 {
        let [width, height] = self.size.map(|side| side as usize);
        let [u, v] = coordinates(direction);
        let column = ((u * width as f32) as usize).min(width - 1);
        let row = ((v * height as f32) as usize).min(height - 1);
        self.density[row * width + column]
    }
}

/// The solid angle of each texel of a row.
fn solid_angle(row: usize, [width, height]: [u32; 2]) -> f64 {
    let [top, bottom] =
        [row, row + 1].map(|line| (std::f64::consts::PI * line as f64 / f64::from(height)).cos());
    std::f64::consts::TAU / f64::from(width) * (top - bottom)
}

/// Where the image shows a unit direction: from 0 to 1 to the right and down.
fn coordinates(direction: Vec3) -> [f32; 2] {
    let u = 0.5 + direction.x.atan2(-direction.z) / TAU;
    [u, direction.y.clamp(-1.0, 1.0).acos() * FRAC_1_PI]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Rng;

    /// A dim gradient with a small bright sun.
    fn sky() -> Sky {
        let texels = (0..32 * 16).map(|i| {
            let (x, y) = (i % 32, i / 32);
            let sun = if (x, y) == (20, 4) { 500.0 } else { 0.0 };
            Vec3::new(0.2 + sun, 0.1 + 0.01 * y as f32 + sun, 0.05 * x as f32)
        });
        Sky::new("", [32, 16], texels.collect()).unwrap()
    }

    #[test]
    fn the_image_is_wrapped_around_the_world() {
        // Four columns: behind to the left, left, right, behind to the right; two rows.
        let texels = (0..8).map(|i| Vec3::splat(i as f32)).collect();
        let sky = Sky::new("", [4, 2], texels).unwrap();
        let near = |direction: Vec3, expected: f32| {
            let found = sky.radiance(direction.normalize()).x;
            assert!((found - expected).abs() < 1e-4, "{direction}: {found}");
        };
        // The middles of texels are at odd multiples of 45 degrees.
        near(Vec3::new(1.0, std::f32::consts::SQRT_2, -1.0), 2.0);
        near(Vec3::new(-1.0, std::f32::consts::SQRT_2, -1.0), 1.0);
        near(Vec3::new(1.0, -std::f32::consts::SQRT_2, 1.0), 7.0);
        near(Vec3::new(-1.0, -std::f32::consts::SQRT_2, 1.0), 4.0);
        // Between two columns and rows, and across the seam.
        near(Vec3::new(0.0, 0.0, -1.0), 3.5);
        near(Vec3::new(0.0, 1.0, 1.0), 1.5);
    }

    #[test]
    fn directions_a_hair_longer_than_the_unit_see_the_poles() {
        let sky = sky();
        for pole in [Vec3::Y, -Vec3::Y] {
            assert_eq!(sky.radiance(pole * (1.0 + 2.0 * f32::EPSILON)), sky.radiance(pole));
        }
    }

    #[test]
    fn densities_integrate_to_one_and_samples_follow_them() {
        let sky = sky();
        let mut sum = 0.0;
        for (row, column) in (0..16).flat_map(|row| (0..32).map(move |column| (row, column))) {
            sum += f64::from(sky.density[row * 32 + column]) * solid_angle(row, sky.size);
        }
        assert!((sum - 1.0).abs() < 1e-5, "{sum}");
        let mut rng = Rng::new(1, 0);
        let (count, mut mean, mut differ) = (1 << 18, DVec3::ZERO, 0);
        for _ in 0..count {
            let (direction, pdf) = sky.sample(rng.next_pair());
            assert!(direction.is_normalized() && pdf > 0.0);
            differ += u32::from(sky.pdf(direction) != pdf);
            mean += (sky.radiance(direction) / pdf).as_dvec3() / f64::from(count);
        }
        // Rounding may put a direction at a border into the neighbour.
        assert!(differ < count / 1000, "{differ}");
        // The integral over the sphere, by an even grid of directions.
        let (rows, columns) = (1000, 2000);
        let mut integral = DVec3::ZERO;
        for row in 0..rows {
            let y = 1.0 - (2.0 * row as f32 + 1.0) / rows as f32;
            for column in 0..columns {
                let angle = TAU * (column as f32 + 0.5) / columns as f32;
                let radius = (1.0 - y * y).sqrt();
                let direction = Vec3::new(radius * angle.cos(), y, radius * angle.sin());
                integral += sky.radiance(direction).as_dvec3();
            }
        }
        integral *= 2.0 * f64::from(TAU) / f64::from(rows * columns);
        assert!((mean / integral - 1.0).abs().max_element() < 0.02, "{mean}, expected {integral}");
    }

    #[test]
    fn the_brightness_of_the_whole_sky_changes_no_sample() {
        let bright = sky();
        // A power of two, so that all sums are the same digits. No row has a sum of 1.
        let texels = bright.texels.iter().map(|&texel| texel * 2.0_f32.powi(-20)).collect();
        let dim = Sky::new("", bright.size, texels).unwrap();
        let mut rng = Rng::new(2, 0);
        for _ in 0..1000 {
            let at = rng.next_pair();
            assert_eq!(dim.sample(at), bright.sample(at));
        }
    }

    #[test]
    fn the_last_texels_reach_to_the_seam_and_to_the_poles() {
        let sky = sky();
        let density = |column: usize, row: usize| sky.density[row * 32 + column];
        for (direction, column, row) in [
            // Straight behind is the end of a row, and down the end of the last.
            (Vec3::new(0.0, 0.1, 1.0), 31, 7),
            (Vec3::new(0.0, -0.1, 1.0), 31, 8),
            (Vec3::new(-0.0, 0.1, 1.0), 0, 7),
            (Vec3::new(0.0, 1.0, -1e-3), 16, 0),
            (Vec3::new(0.0, -1.0, -1e-3), 16, 15),
            (Vec3::new(0.0, -1.0, 0.0), 31, 15),
            (Vec3::new(1.0, -1e-3, 0.0), 24, 8),
        ] {
            assert_eq!(sky.pdf(direction.normalize()), density(column, row), "{direction}");
        }
    }

    #[test]
    fn a_file_that_promises_too_much_is_refused_before_it_is_read() {
        let path = std::env::temp_dir().join(format!("epigraph-sky-{}.hdr", std::process::id()));
        let said = |size: &str| {
            std::fs::write(&path, format!("#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n{size}\n")).unwrap();
            Sky::load(&path).unwrap_err().to_string()
        };
        let [large, cut] = ["-Y 60000 +X 60000", "-Y 2 +X 4"].map(said);
        std::fs::remove_file(&path).unwrap();
        assert!(large.ends_with(": it has 60000 x 60000 texels; make it smaller"), "{large}");
        assert!(!cut.contains("make it smaller"), "{cut}");
    }

    #[test]
    fn a_black_sky_does_not_shine_and_a_broken_one_is_refused() {
        assert!(!Sky::new("", [2, 1], vec![Vec3::ZERO; 2]).unwrap().shines());
        assert!(Sky::new("", [2, 1], vec![Vec3::ZERO; 3]).unwrap_err().contains("2 x 1"));
        let broken = |value: f32| Sky::new("", [2, 1], vec![Vec3::ONE, Vec3::splat(value)]).unwrap_err();
        for value in [f32::NAN, f32::INFINITY, -1.0] {
            assert!(broken(value).starts_with("the texel in column 1, row 0"));
        }
    }
}
