//! Scattering at a surface point: a Lambertian base under a GGX lobe, or a perfect mirror.

use std::f32::consts::{FRAC_1_PI, TAU};

use glam::Vec3;

use crate::{Material, Surface};

/// Minimum width of a lobe (alpha, the square of the roughness). In f32, narrower lobes cannot be distinguished from a
/// mirror.
const MIN_ALPHA: f32 = 2e-3;

/// Minimum cosine between the shading normal and the direction to the viewer. Below it, the normal is bent towards the
/// viewer.
const MIN_COSINE: f32 = 1e-3;

/// The two lobes of a surface that is not a mirror.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Lobe {
    Diffuse,
    Specular,
}

/// A number for each lobe, indexed by [`Lobe`].
pub(super) type PerLobe = [f32; 2];

/// A scattered direction.
#[derive(Clone, Copy, Debug)]
pub(super) struct Scatter {
    /// Unit direction away from the surface.
    pub direction: Vec3,
    /// BSDF times cosine, divided by the density.
    pub weight: Vec3,
    /// Density of the direction, 1/sr.
    pub pdf: f32,
}

/// The value and the sampling density of a lobe in one direction.
#[derive(Clone, Copy, Debug)]
pub(super) struct LobeValue {
    /// BSDF times cosine, 1/sr.
    pub value: Vec3,
    /// Density with which [`Bsdf::sample`] samples the direction, 1/sr.
    pub pdf: f32,
}

impl LobeValue {
    const ZERO: Self = Self { value: Vec3::ZERO, pdf: 0.0 };
}

/// Scattering at one point, seen from one direction. All directions point away from the surface, unit length.
#[derive(Clone, Copy, Debug)]
pub(super) struct Bsdf {
    /// Shading normal, on the viewer's side.
    normal: Vec3,
    to_viewer: Vec3,
    /// Tint of a mirror.
    color: Vec3,
    /// Albedo of the diffuse lobe: the colour, reduced by the share that the GGX lobe reflects.
    diffuse: Vec3,
    glossy: Option<Glossy>,
    mirror: bool,
}

/// The GGX lobe.
#[derive(Clone, Copy, Debug)]
struct Glossy {
    /// Reflectance at normal incidence.
    f0: f32,
    /// Square of the perceptual roughness.
    alpha: f32,
}

impl Bsdf {
    /// `normal` is the shading normal on the side of the geometric normal that faces the viewer.
    pub fn new(material: &Material, normal: Vec3, to_viewer: Vec3) -> Self {
        let glossy = match material.surface {
            Surface::Glossy { roughness, f0 } => {
                Some(Glossy { f0, alpha: (roughness * roughness).max(MIN_ALPHA) })
            }
            Surface::Diffuse | Surface::Mirror => None,
        };
        // An interpolated normal may point away from the viewer near a silhouette.
        let cosine = normal.dot(to_viewer);
        let normal = if cosine < MIN_COSINE {
            (normal + to_viewer * (MIN_COSINE - cosine)).normalize_or(to_viewer)
        } else {
            normal
        };
        let glossy_share = glossy.map_or(0.0, |glossy| glossy_albedo(normal.dot(to_viewer), glossy));
        Self {
            normal,
            to_viewer,
            color: material.color,
            diffuse: material.color * (1.0 - glossy_share),
            glossy,
            mirror: material.surface == Surface::Mirror,
        }
    }

    /// The reflected direction and its tint, if the surface is a mirror.
    pub fn mirror(&self) -> Option<(Vec3, Vec3)> {
        self.mirror.then(|| (reflect(self.to_viewer, self.normal), self.color))
    }

    /// Returns true if there is a GGX lobe.
    pub fn is_glossy(&self) -> bool {
        self.glossy.is_some()
    }

    /// Widens the GGX lobe to at least `alpha`.
    pub fn roughen(&mut self, alpha: f32) {
        if let Some(glossy) = &mut self.glossy {
            glossy.alpha = glossy.alpha.max(alpha);
        }
    }

    /// Probabilities with which a path continues in each lobe, in proportion to the light that the lobe reflects.
    pub fn lobe_shares(&self) -> PerLobe {
        let Some(glossy) = self.glossy else { return [1.0, 0.0] };
        let diffuse = self.diffuse.max_element();
        let specular = glossy_albedo(self.normal.dot(self.to_viewer), glossy);
        // Each lobe that reflects light has a minimum probability, as rare choices with large weights are noisy.
        let share = if diffuse > 0.0 { (specular / (specular + diffuse)).clamp(0.1, 0.9) } else { 1.0 };
        [1.0 - share, share]
    }

    /// Values and densities of both lobes in the direction to a light.
    pub fn evaluate(&self, to_light: Vec3) -> [LobeValue; 2] {
        let (cos_o, cos_i) = (self.normal.dot(self.to_viewer), self.normal.dot(to_light));
        if cos_i <= 0.0 || self.mirror {
            return [LobeValue::ZERO; 2];
        }
        let pdf = cos_i * FRAC_1_PI;
        let diffuse = LobeValue { value: self.diffuse * pdf, pdf };
        let Some(Glossy { f0, alpha }) = self.glossy else { return [diffuse, LobeValue::ZERO] };
        let half = (self.to_viewer + to_light).normalize_or(self.normal);
        let fresnel = f0 + (1.0 - f0) * schlick(half.dot(to_light));
        let (lambda_o, lambda_i) = (smith_lambda(cos_o, alpha), smith_lambda(cos_i, alpha));
        let d = ggx(self.normal, half, alpha) / (4.0 * cos_o);
        let value = Vec3::splat(d * fresnel / (1.0 + lambda_o + lambda_i));
        [diffuse, LobeValue { value, pdf: d / (1.0 + lambda_o) }]
    }

    /// Samples a direction of one lobe from two numbers in [0, 1); `None` if the direction points into the surface.
    pub fn sample(&self, lobe: Lobe, [u, v]: [f32; 2]) -> Option<Scatter> {
        let (tangent, bitangent) = self.normal.any_orthonormal_pair();
        let (sin_phi, cos_phi) = (TAU * u).sin_cos();
        let cos_o = self.normal.dot(self.to_viewer);
        match (lobe, self.glossy) {
            (Lobe::Diffuse, _) => {
                let (radius, cos_i) = (v.sqrt(), (1.0 - v).sqrt());
                let direction = (tangent * cos_phi + bitangent * sin_phi) * radius + self.normal * cos_i;
                Some(Scatter { direction, weight: self.diffuse, pdf: cos_i * FRAC_1_PI })
            }
            (Lobe::Specular, None) => None,
            (Lobe::Specular, Some(Glossy { f0, alpha })) => {
                // Visible normals by spherical caps (Dupuy and Benyoub, "Sampling Visible GGX Normals with
                // Spherical Caps", 2023).
                let local = Vec3::new(self.to_viewer.dot(tangent), self.to_viewer.dot(bitangent), cos_o);
                let warped = Vec3::new(alpha * local.x, alpha * local.y, local.z).normalize();
                let z = (1.0 - v) * (1.0 + warped.z) - warped.z;
                let radius = (1.0 - z * z).max(0.0).sqrt();
                let half = Vec3::new(radius * cos_phi, radius * sin_phi, z) + warped;
                let half = Vec3::new(alpha * half.x, alpha * half.y, half.z.max(0.0)).normalize_or(Vec3::Z);
                let half = tangent * half.x + bitangent * half.y + self.normal * half.z;
                let direction = reflect(self.to_viewer, half);
                let cos_i = self.normal.dot(direction);
                if cos_i <= 0.0 {
                    return None;
                }
                let fresnel = f0 + (1.0 - f0) * schlick(half.dot(direction));
                let (lambda_o, lambda_i) = (smith_lambda(cos_o, alpha), smith_lambda(cos_i, alpha));
                let weight = Vec3::splat(fresnel * (1.0 + lambda_o) / (1.0 + lambda_o + lambda_i));
                let pdf = ggx(self.normal, half, alpha) / (4.0 * cos_o * (1.0 + lambda_o));
                Some(Scatter { direction, weight, pdf })
            }
        }
    }
}

/// Share of the light of a white sky that the GGX lobe reflects to the viewer, by Karis's fit ("Physically Based
/// Shading on Mobile", 2014), which is a function of perceptual roughness.
fn glossy_albedo(cosine: f32, Glossy { f0, alpha }: Glossy) -> f32 {
    let roughness = alpha.sqrt();
    let (smooth, offset) = (1.0 - roughness, 0.0425 - 0.0275 * roughness);
    let a = (smooth * smooth).min((-9.28 * cosine).exp2()) * smooth + offset;
    let scale = -1.04 * a + 1.04 - 0.572 * roughness;
    let bias = 1.04 * a - 0.04 + 0.022 * roughness;
    (f0 * scale + bias).clamp(0.0, 1.0)
}

fn reflect(direction: Vec3, normal: Vec3) -> Vec3 {
    (2.0 * direction.dot(normal) * normal - direction).normalize()
}

/// (1 - cos)^5 (Schlick 1994).
fn schlick(cosine: f32) -> f32 {
    let m = (1.0 - cosine).clamp(0.0, 1.0);
    m * m * m * m * m
}

/// GGX density of microfacet normals, 1/sr. The sine comes from a cross product: `1 - cos^2` cancels for narrow lobes.
fn ggx(normal: Vec3, half: Vec3, alpha: f32) -> f32 {
    let cosine = normal.dot(half);
    let a2 = alpha * alpha;
    let root = a2 * cosine * cosine + normal.cross(half).length_squared();
    a2 * FRAC_1_PI / (root * root)
}

/// Smith's auxiliary function of GGX (Heitz, "Understanding the Masking-Shadowing Function", 2014).
fn smith_lambda(cosine: f32, alpha: f32) -> f32 {
    let c2 = cosine * cosine;
    0.5 * ((1.0 + alpha * alpha * (1.0 - c2).max(0.0) / c2).sqrt() - 1.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::trace::Rng;

    fn glossy(roughness: f32, f0: f32, color: f32, cosine: f32) -> Bsdf {
        let material = Material {
            name: String::new(),
            color: Vec3::splat(color),
            surface: Surface::Glossy { roughness, f0 },
            emission: Vec3::ZERO,
        };
        Bsdf::new(&material, Vec3::Y, Vec3::new((1.0 - cosine * cosine).sqrt(), cosine, 0.0))
    }

    /// Mean over uniform directions of the upper hemisphere, times its solid angle.
    fn integrate(f: impl Fn(Vec3) -> f32) -> f32 {
        let n = 1 << 18;
        let rng = Rng::new(1, 2);
        let sum: f64 = (0..n)
            .map(|i| {
                let [u, v] = rng.stratified(0, i, n);
                let (s, c) = (TAU * u).sin_cos();
                let r = (1.0 - v * v).sqrt();
                f64::from(f(Vec3::new(r * c, v, r * s)))
            })
            .sum();
        sum as f32 * TAU / n as f32
    }

    #[test]
    fn sampled_albedo_agrees_with_the_integral_of_the_bsdf() {
        for (roughness, cosine) in [(0.3, 0.9), (0.6, 0.5), (1.0, 0.2)] {
            let bsdf = glossy(roughness, 0.2, 0.5, cosine);
            for lobe in [Lobe::Diffuse, Lobe::Specular] {
                let integral = integrate(|d| bsdf.evaluate(d)[lobe as usize].value.x);
                let mut rng = Rng::new(4, 5);
                let n = 1 << 16;
                let sampled: f32 = (0..n)
                    .filter_map(|_| bsdf.sample(lobe, rng.next_pair()))
                    .map(|s| s.weight.x / n as f32)
                    .sum();
                assert!((integral - sampled).abs() < 0.01, "{lobe:?} {roughness}: {integral} {sampled}");
            }
        }
    }

    #[test]
    fn density_matches_the_samples() {
        for (roughness, cosine) in [(0.5, 0.8), (0.8, 0.3)] {
            let bsdf = glossy(roughness, 0.04, 0.5, cosine);
            let mut rng = Rng::new(6, 7);
            for _ in 0..100 {
                for lobe in [Lobe::Diffuse, Lobe::Specular] {
                    let Some(s) = bsdf.sample(lobe, rng.next_pair()) else { continue };
                    let e = bsdf.evaluate(s.direction)[lobe as usize];
                    assert!((e.pdf / s.pdf - 1.0).abs() < 0.01, "{lobe:?}: {} {}", e.pdf, s.pdf);
                    assert!((e.value / e.pdf - s.weight).abs().max_element() < 0.01 * s.weight.x.max(0.1));
                }
            }
        }
    }

    #[test]
    fn white_surfaces_reflect_all_light() {
        for roughness in [0.05, 0.3, 1.0] {
            for cosine in [0.05, 0.5, 1.0] {
                let bsdf = glossy(roughness, 0.04, 1.0, cosine);
                let mut rng = Rng::new(8, 9);
                let n = 1 << 14;
                let mut albedo = 0.0;
                for _ in 0..n {
                    for lobe in [Lobe::Diffuse, Lobe::Specular] {
                        albedo += bsdf.sample(lobe, rng.next_pair()).map_or(0.0, |s| s.weight.x) / n as f32;
                    }
                }
                // The fit of the GGX lobe is up to 0.06 too low at grazing angles.
                assert!((0.9..1.06).contains(&albedo), "roughness {roughness}, cosine {cosine}: {albedo}");
            }
        }
    }
}
