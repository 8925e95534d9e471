//! Tables of the share of light that the GGX lobe reflects.

use std::sync::LazyLock;

use glam::Vec3;
use rayon::prelude::*;

use super::rng::Rng;
use super::surface::{schlick, smith_lambda, visible_facet};

/// Numbers of cosines, from 0 to 1 in squares, and of roughnesses from 0 to 1.
const COSINES: usize = 32;
const ROUGHNESSES: usize = 32;

/// Sampled directions of each entry.
const SAMPLES: u32 = 1024;

/// The albedo of a lobe of reflectance `f0` at normal incidence, and 1 at grazing incidence, is `f0 * scale + bias`.
#[derive(Clone, Copy, Debug, Default)]
struct Entry {
    scale: f32,
    bias: f32,
}

impl Entry {
    fn mix(self, other: Self, t: f32) -> Self {
        Self {
            scale: self.scale + (other.scale - self.scale) * t,
            bias: self.bias + (other.bias - self.bias) * t,
        }
    }

    fn at(self, f0: f32) -> f32 {
        f0 * self.scale + self.bias
    }
}

/// The albedo of a lobe in one direction, and its mean over all directions, weighted by their cosine.
#[derive(Clone, Copy, Debug)]
pub(super) struct Albedo {
    here: Entry,
    mean: Entry,
}

/// Loads the entry of a direction, by its cosine to the normal, and a perceptual roughness.
pub(super) fn albedo(cosine: f32, roughness: f32) -> Albedo {
    let table = &*TABLE;
    let at = roughness.clamp(0.0, 1.0) * (ROUGHNESSES - 1) as f32;
    let row = (at as usize).min(ROUGHNESSES - 2);
    let t = at - row as f32;
    let column = cosine.clamp(0.0, 1.0).sqrt() * (COSINES - 1) as f32;
    let first = (column as usize).min(COSINES - 2);
    let s = column - first as f32;
    let line = |row: usize| table.entries[row][first].mix(table.entries[row][first + 1], s);
    Albedo { here: line(row).mix(line(row + 1), t), mean: table.means[row].mix(table.means[row + 1], t) }
}

impl Albedo {
    /// The share that single scattering reflects.
    pub fn reflected(&self, f0: Vec3) -> Vec3 {
        f0 * self.here.scale + self.here.bias
    }

    /// The share that meets a second microfacet.
    pub fn lost(&self) -> f32 {
        (1.0 - self.here.at(1.0)).max(0.0)
    }

    /// What of the light that meets a second microfacet leaves in the end.
    pub fn repeated(&self, f0: Vec3) -> Vec3 {
        // The mean of Schlick's approximation, weighted by the cosine.
        let fresnel = f0 + (1.0 - f0) / 21.0;
        let mean = self.mean.at(1.0);
        fresnel * fresnel * mean / (1.0 - fresnel * (1.0 - mean))
    }

    /// The factor on [`Albedo::repeated`] of light between two directions.
    pub fn repeated_share(&self, there: &Self) -> f32 {
        let mean = 1.0 - self.mean.at(1.0);
        if mean > 0.0 { self.lost() * there.lost() / mean } else { 0.0 }
    }

    /// The share that a dielectric's lobe reflects in all scattering events.
    pub fn of_dielectric(&self, f0: f32) -> f32 {
        if f0 == 0.0 {
            return 0.0;
        }
        (self.here.at(f0) + self.lost() * self.repeated(Vec3::splat(f0)).x).min(1.0)
    }

    /// The factor on a base's albedo for light between two directions, below a dielectric's lobe.
    pub fn base_share(&self, there: &Self, f0: f32) -> f32 {
        if f0 == 0.0 {
            return 1.0;
        }
        let mean = self.mean.at(f0) + (1.0 - self.mean.at(1.0)) * self.repeated(Vec3::splat(f0)).x;
        let through = |at: &Self| 1.0 - at.of_dielectric(f0);
        through(self) * through(there) / (1.0 - mean).max(1e-6)
    }
}

struct Table {
    entries: Vec<[Entry; COSINES]>,
    means: Vec<Entry>,
}

/// Made when the first surface with a lobe is met, in some hundredths of a second.
static TABLE: LazyLock<Table> = LazyLock::new(|| {
    let line = |row: usize| {
        let alpha = (row as f32 / (ROUGHNESSES - 1) as f32).powi(2);
        std::array::from_fn(|column| {
            // At a cosine of 0, nothing is seen; a little above, nearly everything is reflected.
            let cosine = (column as f32 / (COSINES - 1) as f32).powi(2).max(1e-4);
            integrate(cosine, alpha.max(1e-6))
        })
    };
    let entries: Vec<[Entry; COSINES]> = (0..ROUGHNESSES).into_par_iter().map(line).collect();
    let means = entries.iter().map(mean).collect();
    Table { entries, means }
});

/// The albedo of one direction and width, by directions sampled in proportion to the lobe.
fn integrate(cosine: f32, alpha: f32) -> Entry {
    let rng = Rng::new(0, 0);
    let viewer = [(1.0 - cosine * cosine).sqrt(), 0.0, cosine];
    let lambda_o = smith_lambda(cosine, alpha);
    let (mut all, mut bias) = (0.0_f64, 0.0_f64);
    for sample in 0..SAMPLES {
        let half = Vec3::from(visible_facet(viewer, alpha, rng.stratified(0, sample, SAMPLES)));
        let facing = half.dot(Vec3::from(viewer));
        let cos_i = 2.0 * facing * half.z - cosine;
        if cos_i > 0.0 {
            let weight = (1.0 + lambda_o) / (1.0 + lambda_o + smith_lambda(cos_i, alpha));
            all += f64::from(weight);
            bias += f64::from(weight * schlick(facing));
        }
    }
    let [all, bias] = [all, bias].map(|sum| (sum / f64::from(SAMPLES)) as f32);
    Entry { scale: all - bias, bias }
}

/// The mean over directions of a line of the table, weighted by the cosine: the integral of its values times 2 cos.
fn mean(line: &[Entry; COSINES]) -> Entry {
    let steps = (COSINES - 1) as f32;
    let (mut scale, mut bias) = (0.0, 0.0);
    // Between two nodes the value is linear in x, the root of the cosine, whose weight is 4 x^3.
    for (index, pair) in line.windows(2).enumerate() {
        let (a, b) = (index as f32 / steps, (index + 1) as f32 / steps);
        let mass = b.powi(4) - a.powi(4);
        let moment = 0.8 * (b.powi(5) - a.powi(5));
        let t = (moment - a * mass) * steps;
        scale += pair[0].scale * (mass - t) + pair[1].scale * t;
        bias += pair[0].bias * (mass - t) + pair[1].bias * t;
    }
    Entry { scale, bias }
}
