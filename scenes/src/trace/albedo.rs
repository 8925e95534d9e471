//! Tables of the share of light that the GGX lobe reflects.

use std::array;
use std::sync::OnceLock;

use glam::Vec3;

use super::rng::Rng;
use super::surface::{masking, schlick, visible_facet};

/// Numbers of cosines, from 0 to 1 in squares, and of roughnesses from 0 to 1.
const COSINES: usize = 32;
const ROUGHNESSES: usize = 32;

/// Sampled directions of each entry.
const SAMPLES: u32 = 256;

/// The albedo of a lobe of reflectance `f0` at normal incidence, and 1 at grazing incidence, is `f0 * scale + bias`.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Entry {
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

    /// The share that single scattering reflects.
    pub fn reflected(self, f0: f32) -> f32 {
        f0 * self.scale + self.bias
    }

    /// The share that meets a second microfacet.
    pub fn lost(self) -> f32 {
        let lost = 1.0 - self.scale - self.bias;
        // A mirror loses nothing, up to rounding.
        if lost > 1e-6 { lost } else { 0.0 }
    }
}

/// The albedo of a lobe of one width, in every direction.
#[derive(Clone, Copy, Debug)]
pub(super) struct Albedo {
    /// The lines of the roughnesses below and above, and the place between them.
    lines: [&'static Line; 2],
    t: f32,
    /// The mean over all directions, weighted by their cosine.
    pub mean: Entry,
}

impl Albedo {
    /// By perceptual roughness.
    pub fn new(roughness: f32) -> Self {
        let at = roughness.clamp(0.0, 1.0) * (ROUGHNESSES - 1) as f32;
        let row = (at as usize).min(ROUGHNESSES - 2);
        let t = at - row as f32;
        let lines = [row, row + 1].map(line);
        Self { lines, t, mean: lines[0].mean.mix(lines[1].mean, t) }
    }

    /// In a direction at this cosine to the normal.
    pub fn at(&self, cosine: f32) -> Entry {
        let column = cosine.clamp(0.0, 1.0).sqrt() * (COSINES - 1) as f32;
        let first = (column as usize).min(COSINES - 2);
        let s = column - first as f32;
        let of = |line: &Line| line.entries[first].mix(line.entries[first + 1], s);
        let [below, above] = self.lines;
        of(below).mix(of(above), self.t)
    }

    /// What of the light that meets a second microfacet leaves in the end.
    pub fn repeated(&self, f0: Vec3) -> Vec3 {
        // The mean of Schlick's approximation, weighted by the cosine.
        let fresnel = f0 + (1.0 - f0) / 21.0;
        let lost = self.mean.lost();
        fresnel * fresnel * (1.0 - lost) / (1.0 - fresnel * lost)
    }
}

/// The entries of one roughness.
#[derive(Debug)]
struct Line {
    entries: [Entry; COSINES],
    mean: Entry,
}

/// The line of a roughness, made when the first surface with such a lobe is met, in some thousandths of a second.
fn line(row: usize) -> &'static Line {
    static LINES: [OnceLock<Line>; ROUGHNESSES] = [const { OnceLock::new() }; ROUGHNESSES];
    LINES[row].get_or_init(|| {
        let alpha = (row as f32 / (ROUGHNESSES - 1) as f32).powi(2);
        let entries = array::from_fn(|column| {
            // At a cosine of 0, nothing is seen; a little above, nearly everything is reflected.
            let cosine = (column as f32 / (COSINES - 1) as f32).powi(2).max(1e-4);
            integrate(cosine, alpha.max(1e-6))
        });
        Line { mean: mean(&entries), entries }
    })
}

/// The albedo of one direction and width, by directions sampled in proportion to the lobe.
fn integrate(cosine: f32, alpha: f32) -> Entry {
    let rng = Rng::new(0, 0);
    let viewer = [(1.0 - cosine * cosine).sqrt(), 0.0, cosine];
    let (mut all, mut bias) = (0.0_f64, 0.0_f64);
    for sample in 0..SAMPLES {
        let half = Vec3::from(visible_facet(viewer, alpha, rng.stratified(0, sample, SAMPLES)));
        let facing = half.dot(Vec3::from(viewer));
        let cos_i = 2.0 * facing * half.z - cosine;
        if cos_i > 0.0 {
            let weight = masking(cosine, cos_i, alpha);
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
