//! Scattering at a surface point: a Lambertian base or glass under a GGX lobe, or a perfect mirror.
//!
//! The lobe is GGX with Smith's height-correlated masking. What one scattering event loses, the lobe of further events
//! returns (Kulla and Conty, "Revisiting Physically Based Shading at Imageworks", 2017), and the base receives what the
//! lobes above it leave, by the same rule in both directions, so that the sum is reciprocal and keeps all energy. Glass
//! bends light at the microfacets (Walter et al., "Microfacet Models for Refraction", 2007).

use std::f32::consts::{FRAC_1_PI, TAU};

use glam::Vec3;

use super::Mode;
use super::albedo::{Albedo, Entry};
use crate::Look;

/// Minimum width of a lobe (alpha, the square of the roughness). In f32, narrower lobes cannot be distinguished from a
/// mirror; metals and glass reflect perfectly.
pub(super) const MIN_ALPHA: f32 = 2e-3;

/// Minimum cosine between the shading normal and the direction to the viewer. Below it, the normal is bent towards the
/// viewer.
const MIN_COSINE: f32 = 1e-3;

/// In direct mode, dielectrics rougher than this reflect lights only: the lobe is too wide and weak to tell what else it
/// reflects.
const ROUGHEST_COAT: f32 = 0.6;

/// The lobes of a surface.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Lobe {
    /// The base, and what has been scattered several times between the microfacets.
    Diffuse,
    /// What the microfacets reflect.
    Specular,
    /// What they let through.
    Transmit,
}

impl Lobe {
    pub const ALL: [Self; 3] = [Self::Diffuse, Self::Specular, Self::Transmit];
}

/// A number for each lobe, indexed by [`Lobe`].
pub(super) type PerLobe = [f32; 3];

/// A scattered direction.
#[derive(Clone, Copy, Debug)]
pub(super) struct Scatter {
    /// Unit direction away from the point.
    pub direction: Vec3,
    /// BSDF times cosine, divided by the density.
    pub weight: Vec3,
    /// Density of the direction, 1/sr; infinite for perfect reflection and refraction.
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
    /// Albedo of the Lambertian base.
    base: Vec3,
    lobe: Option<Microfacets>,
    glass: Option<Glass>,
}

/// The GGX lobe.
#[derive(Clone, Copy, Debug)]
struct Microfacets {
    /// Reflectance at normal incidence: of the mix, of the dielectric, and of the metal.
    f0: Vec3,
    dielectric_f0: f32,
    tint: Vec3,
    metallic: f32,
    /// Reflectance at grazing incidence.
    f90: f32,
    /// Square of the perceptual roughness.
    alpha: f32,
    /// Whether it reflects like a mirror.
    is_perfect: bool,
    /// Index of refraction beyond the surface divided by that on the viewer's side, where Fresnel's equations count
    /// instead of Schlick's approximation.
    eta: Option<f32>,
    albedo: Albedo,
    /// Its albedo towards the viewer.
    here: Entry,
    /// The share of the light of repeated scattering that leaves a dielectric.
    repeated: f32,
    /// What the base, and repeated scattering, send to the viewer of the light that gets to them.
    base: Vec3,
    between: Vec3,
}

/// What passes through the surface.
#[derive(Clone, Copy, Debug)]
struct Glass {
    tint: Vec3,
    /// As in [`Microfacets`]; 1 for a thin sheet.
    eta: f32,
    is_thin: bool,
}

impl Bsdf {
    /// `normal` is the shading normal on the side of the geometric normal that faces the viewer; `front` tells whether
    /// that is the surface's front.
    #[inline]
    pub fn new(look: &Look, normal: Vec3, to_viewer: Vec3, front: bool) -> Self {
        // An interpolated normal may point away from the viewer near a silhouette.
        let cosine = normal.dot(to_viewer);
        let normal = if cosine < MIN_COSINE {
            (normal + to_viewer * (MIN_COSINE - cosine)).normalize_or(to_viewer)
        } else {
            normal
        };
        if look.f0 == 0.0 && look.metallic == 0.0 && look.transmission == 0.0 {
            return Self { normal, to_viewer, base: look.color, lobe: None, glass: None };
        }
        let dielectric = 1.0 - look.metallic;
        let transmits = look.transmission * dielectric;
        let eta = look
            .medium
            .filter(|_| transmits > 0.0)
            .map(|medium| if front { medium.ior } else { 1.0 / medium.ior });
        let base = look.color * (dielectric * (1.0 - look.transmission));
        let alpha = look.roughness * look.roughness;
        let lobe = Microfacets {
            f0: look.color * look.metallic + look.f0 * dielectric,
            dielectric_f0: look.f0,
            tint: look.color,
            metallic: look.metallic,
            // A dielectric without reflectance at normal incidence has none at all.
            f90: if look.f0 == 0.0 { look.metallic } else { 1.0 },
            alpha: alpha.max(MIN_ALPHA),
            is_perfect: alpha < MIN_ALPHA && (look.metallic == 1.0 || transmits > 0.0),
            eta,
            albedo: Albedo::new(look.roughness),
            here: Entry::default(),
            repeated: 0.0,
            base: Vec3::ZERO,
            between: Vec3::ZERO,
        };
        let lobe = Some(lobe.over(base, normal.dot(to_viewer)));
        let glass = (transmits > 0.0).then(|| Glass {
            tint: look.color * transmits,
            eta: eta.unwrap_or(1.0),
            is_thin: eta.is_none(),
        });
        Self { normal, to_viewer, base, lobe, glass }
    }

    /// The reflected direction and its tint, if the surface does nothing but reflect perfectly.
    #[inline]
    pub fn mirror(&self) -> Option<(Vec3, Vec3)> {
        let lobe = self.lobe.as_ref().filter(|lobe| lobe.is_perfect && self.glass.is_none())?;
        let cosine = self.normal.dot(self.to_viewer);
        Some((reflect(self.to_viewer, self.normal), lobe.fresnel(cosine)))
    }

    /// A surface that scatters nothing.
    pub fn black(normal: Vec3, to_viewer: Vec3) -> Self {
        Self { normal, to_viewer, base: Vec3::ZERO, lobe: None, glass: None }
    }

    /// Whether it lets light through.
    pub fn is_glass(&self) -> bool {
        self.glass.is_some()
    }

    /// Whether it lets light through without bending it.
    pub fn is_thin(&self) -> bool {
        self.glass.as_ref().is_some_and(|glass| glass.is_thin)
    }

    /// Widens the GGX lobe to at least `alpha`.
    pub fn roughen(&mut self, alpha: f32) {
        if let Some(lobe) = self.lobe.as_mut().filter(|lobe| !lobe.is_perfect && lobe.alpha < alpha) {
            let wider = Microfacets { alpha, albedo: Albedo::new(alpha.sqrt()), ..*lobe };
            *lobe = wider.over(self.base, self.normal.dot(self.to_viewer));
        }
    }

    /// How much the light that it reflects depends on the viewer's direction: the share of its lobes that are not
    /// diffuse, over their width.
    pub fn sharpness(&self) -> f32 {
        let Some(lobe) = &self.lobe else { return 0.0 };
        let [_, specular, transmit] = self.lobe_shares();
        (specular + transmit) / lobe.alpha
    }

    /// Probabilities with which a path continues in each lobe, in proportion to the light that the lobe scatters.
    #[inline]
    pub fn lobe_shares(&self) -> PerLobe {
        let Some(lobe) = &self.lobe else { return [1.0, 0.0, 0.0] };
        let base = self.base * lobe.passed(lobe.here);
        let diffuse = (base + lobe.scattered_again() * lobe.here.lost()).max_element();
        let [specular, transmit] = self.facet_shares(lobe);
        shares(lobe, [diffuse, specular, transmit])
    }

    /// The shares in direct mode, where only mirror images and what is seen through glass are traced: at the first
    /// surface those of glossy ones too.
    #[inline]
    pub fn direct_shares(&self, at_first: bool) -> PerLobe {
        match &self.lobe {
            Some(lobe) if self.glass.is_some() => {
                let [specular, transmit] = self.facet_shares(lobe);
                shares(lobe, [0.0, specular, transmit])
            }
            Some(lobe) if at_first && lobe.shows_reflections() => [0.0, 1.0, 0.0],
            _ => [0.0; 3],
        }
    }

    /// Shares of the light that facets reflect and let through.
    fn facet_shares(&self, lobe: &Microfacets) -> [f32; 2] {
        let mut reflected = match lobe.eta {
            Some(_) => lobe.fresnel(self.normal.dot(self.to_viewer)),
            None => lobe.f0 * lobe.here.reflected(1.0) + (lobe.f90 - lobe.f0) * lobe.here.reflected(0.0),
        }
        .max_element();
        if !lobe.is_perfect {
            // Some facets of a rough surface let light through even where a smooth one would reflect all.
            reflected = reflected.min(0.9);
        }
        [reflected, self.glass.map_or(0.0, |glass| glass.tint.max_element() * (1.0 - reflected))]
    }

    /// Values and densities of all lobes in the direction to a light.
    pub fn evaluate(&self, to_light: Vec3) -> [LobeValue; 3] {
        let mut values = [LobeValue::ZERO; 3];
        let cos_i = self.normal.dot(to_light);
        if cos_i > 0.0 {
            let pdf = cos_i * FRAC_1_PI;
            values[Lobe::Diffuse as usize] = LobeValue { value: self.diffuse(cos_i) * pdf, pdf };
        }
        let Some(lobe) = self.lobe.as_ref().filter(|lobe| !lobe.is_perfect) else { return values };
        let cos_o = self.normal.dot(self.to_viewer);
        if cos_i > 0.0 {
            let half = (self.to_viewer + to_light).normalize_or(self.normal);
            let (masking, pdf) = self.reflected(lobe, half, cos_o, cos_i);
            let value = lobe.fresnel(half.dot(to_light)) * (masking * pdf);
            values[Lobe::Specular as usize] = LobeValue { value, pdf };
        } else if let Some(glass) = self.glass.as_ref().filter(|_| cos_i < 0.0) {
            values[Lobe::Transmit as usize] = self.transmitted(lobe, glass, to_light, cos_o, cos_i);
        }
        values
    }

    /// The factor on `cos / pi` of the diffuse lobe towards a light.
    #[inline]
    fn diffuse(&self, cos_i: f32) -> Vec3 {
        let Some(lobe) = &self.lobe else { return self.base };
        let there = lobe.albedo.at(cos_i);
        lobe.base * lobe.passed(there) + lobe.between * there.lost()
    }

    /// What masking leaves of a reflected direction's weight, and its density.
    fn reflected(&self, lobe: &Microfacets, half: Vec3, cos_o: f32, cos_i: f32) -> (f32, f32) {
        let seen = 1.0 + smith_lambda(cos_o, lobe.alpha);
        let pdf = ggx(self.normal, half, lobe.alpha) / (4.0 * cos_o * seen);
        (masking(cos_o, cos_i, lobe.alpha), pdf)
    }

    fn transmitted(
        &self,
        lobe: &Microfacets,
        glass: &Glass,
        to_light: Vec3,
        cos_o: f32,
        cos_i: f32,
    ) -> LobeValue {
        let through = |fresnel: Vec3| glass.tint * (1.0 - fresnel.max_element());
        if glass.is_thin {
            // As reflected, and mirrored to the other side.
            let mirrored = to_light - 2.0 * cos_i * self.normal;
            let half = (self.to_viewer + mirrored).normalize_or(self.normal);
            let (masking, pdf) = self.reflected(lobe, half, cos_o, -cos_i);
            let value = through(lobe.fresnel(half.dot(mirrored))) * (masking * pdf);
            return LobeValue { value, pdf };
        }
        let half = (self.to_viewer + to_light * glass.eta).normalize_or_zero();
        let half = if half.dot(self.normal) < 0.0 { -half } else { half };
        let (o, i) = (half.dot(self.to_viewer), half.dot(to_light));
        if o <= 0.0 || i >= 0.0 {
            return LobeValue::ZERO;
        }
        let seen = 1.0 + smith_lambda(cos_o, lobe.alpha);
        let stretch = i + o / glass.eta;
        let pdf = ggx(self.normal, half, lobe.alpha) * o * -i / (cos_o * seen * stretch * stretch);
        let value = through(lobe.fresnel(o)) * (masking(cos_o, cos_i, lobe.alpha) * pdf);
        if pdf.is_finite() { LobeValue { value, pdf } } else { LobeValue::ZERO }
    }

    /// Samples a direction of one lobe from two numbers in [0, 1); `None` if the lobe scatters nothing there.
    pub fn sample(&self, lobe: Lobe, [u, v]: [f32; 2]) -> Option<Scatter> {
        let cos_o = self.normal.dot(self.to_viewer);
        if lobe == Lobe::Diffuse {
            let (tangent, bitangent) = self.normal.any_orthonormal_pair();
            let (sin_phi, cos_phi) = (TAU * u).sin_cos();
            let (radius, cos_i) = (v.sqrt(), (1.0 - v).sqrt());
            let direction = (tangent * cos_phi + bitangent * sin_phi) * radius + self.normal * cos_i;
            return Some(Scatter { direction, weight: self.diffuse(cos_i), pdf: cos_i * FRAC_1_PI });
        }
        let facets = self.lobe.as_ref()?;
        let half = if facets.is_perfect { self.normal } else { self.facet(facets.alpha, [u, v]) };
        let fresnel = facets.fresnel(half.dot(self.to_viewer));
        let (direction, color) = match (lobe, self.glass) {
            (Lobe::Transmit, Some(glass)) => {
                let direction = if glass.is_thin {
                    let reflected = reflect(self.to_viewer, half);
                    reflected - 2.0 * reflected.dot(self.normal) * self.normal
                } else {
                    refract(self.to_viewer, half, glass.eta)?
                };
                (direction, glass.tint * (1.0 - fresnel.max_element()))
            }
            (Lobe::Transmit, None) => return None,
            _ => (reflect(self.to_viewer, half), fresnel),
        };
        if facets.is_perfect {
            return Some(Scatter { direction, weight: color, pdf: f32::INFINITY });
        }
        let cos_i = self.normal.dot(direction);
        if (cos_i <= 0.0) != (lobe == Lobe::Transmit) {
            return None;
        }
        let (masking, pdf) = match (lobe, self.glass) {
            (Lobe::Transmit, Some(glass)) if !glass.is_thin => {
                let LobeValue { pdf, .. } = self.transmitted(facets, &glass, direction, cos_o, cos_i);
                (masking(cos_o, cos_i, facets.alpha), pdf)
            }
            _ => self.reflected(facets, half, cos_o, cos_i.abs()),
        };
        (pdf > 0.0).then_some(Scatter { direction, weight: color * masking, pdf })
    }

    /// A normal of the microfacets that the viewer sees, by spherical caps (Dupuy and Benyoub, "Sampling Visible GGX
    /// Normals with Spherical Caps", 2023).
    fn facet(&self, alpha: f32, [u, v]: [f32; 2]) -> Vec3 {
        let (tangent, bitangent) = self.normal.any_orthonormal_pair();
        let axes = [tangent, bitangent, self.normal];
        let [x, y, z] = visible_facet(axes.map(|axis| axis.dot(self.to_viewer)), alpha, [u, v]);
        tangent * x + bitangent * y + self.normal * z
    }
}

/// Probabilities in proportion to shares of light. Each lobe that scatters light has a minimum, as rare choices with large
/// weights are noisy; those of perfect lobes have equal weights.
fn shares(lobe: &Microfacets, of: PerLobe) -> PerLobe {
    let least = if lobe.is_perfect { 0.0 } else { 0.1 * of.iter().sum::<f32>() };
    let of = of.map(|share| if share > 0.0 { share.max(least) } else { 0.0 });
    let sum: f32 = of.iter().sum();
    if sum > 0.0 { of.map(|share| share / sum) } else { [0.0; 3] }
}

/// The share of light that goes straight through a surface which it meets at this cosine: see [`super`].
pub(super) fn straight_through(look: &Look, cosine: f32, mode: Mode) -> Vec3 {
    let is_clear = look.roughness * look.roughness < MIN_ALPHA && look.medium.is_none();
    if !is_clear && mode == Mode::Path {
        return Vec3::ZERO;
    }
    let fresnel = if look.f0 > 0.0 { look.f0 + (1.0 - look.f0) * schlick(cosine) } else { 0.0 };
    look.color * (look.transmission * (1.0 - look.metallic) * (1.0 - fresnel))
}

/// A visible normal of microfacets around the z axis, seen from a unit direction.
pub(super) fn visible_facet([x, y, z]: [f32; 3], alpha: f32, [u, v]: [f32; 2]) -> [f32; 3] {
    let (sin_phi, cos_phi) = (TAU * u).sin_cos();
    let warped = Vec3::new(alpha * x, alpha * y, z).normalize();
    let height = (1.0 - v) * (1.0 + warped.z) - warped.z;
    let radius = (1.0 - height * height).max(0.0).sqrt();
    let half = Vec3::new(radius * cos_phi, radius * sin_phi, height) + warped;
    Vec3::new(alpha * half.x, alpha * half.y, half.z.max(0.0)).normalize_or(Vec3::Z).to_array()
}

impl Microfacets {
    /// Reflectance of a facet at this cosine to its normal.
    fn fresnel(&self, cosine: f32) -> Vec3 {
        match self.eta {
            // Of the dielectric; a share of metal under glass is that of the mix.
            Some(eta) => Vec3::splat(fresnel_dielectric(cosine, eta)),
            None => self.f0 + (self.f90 - self.f0) * schlick(cosine),
        }
    }

    /// The same lobe over a base of this albedo, seen at this cosine.
    fn over(self, base: Vec3, cosine: f32) -> Self {
        let (albedo, here) = (self.albedo, self.albedo.at(cosine));
        let of_dielectric = albedo.repeated(Vec3::splat(self.dielectric_f0)).x;
        let repeated = if self.dielectric_f0 > 0.0 { of_dielectric } else { 0.0 };
        let lobe = Self { here, repeated, ..self };
        let lost = albedo.mean.lost();
        Self {
            base: base * (lobe.passed(here) / lobe.passed(albedo.mean).max(1e-6)),
            between: if lost > 0.0 { lobe.scattered_again() * (here.lost() / lost) } else { Vec3::ZERO },
            ..lobe
        }
    }

    /// The share of light that passes a dielectric's lobe to the base, in a direction of this albedo.
    fn passed(&self, at: Entry) -> f32 {
        if self.dielectric_f0 == 0.0 {
            return 1.0;
        }
        (1.0 - at.reflected(self.dielectric_f0) - at.lost() * self.repeated).max(0.0)
    }

    /// Albedo of all scattering events after the first, as a share of what they get.
    fn scattered_again(&self) -> Vec3 {
        Vec3::splat(self.repeated).lerp(self.albedo.repeated(self.tint), self.metallic)
    }

    /// Whether it is narrow or strong enough to tell what it reflects.
    fn shows_reflections(&self) -> bool {
        let is_metal = self.f0.max_element() > 0.1;
        is_metal || self.alpha <= ROUGHEST_COAT * ROUGHEST_COAT
    }
}

fn reflect(direction: Vec3, normal: Vec3) -> Vec3 {
    (2.0 * direction.dot(normal) * normal - direction).normalize()
}

/// The direction on the other side, where the index of refraction is `eta` times that on this side; `None` if all light
/// is reflected.
fn refract(direction: Vec3, normal: Vec3, eta: f32) -> Option<Vec3> {
    let cosine = direction.dot(normal);
    let squared = 1.0 - (1.0 - cosine * cosine).max(0.0) / (eta * eta);
    (squared > 0.0).then(|| ((cosine / eta - squared.sqrt()) * normal - direction / eta).normalize())
}

/// Fresnel's reflectance of unpolarised light that comes at this cosine to a medium of relative index `eta`.
fn fresnel_dielectric(cosine: f32, eta: f32) -> f32 {
    let cosine = cosine.clamp(0.0, 1.0);
    let squared = 1.0 - (1.0 - cosine * cosine) / (eta * eta);
    if squared <= 0.0 {
        return 1.0;
    }
    let beyond = squared.sqrt();
    let parallel = (eta * cosine - beyond) / (eta * cosine + beyond);
    let perpendicular = (cosine - eta * beyond) / (cosine + eta * beyond);
    0.5 * (parallel * parallel + perpendicular * perpendicular)
}

/// (1 - cos)^5 (Schlick 1994).
pub(super) fn schlick(cosine: f32) -> f32 {
    let m = (1.0 - cosine).max(0.0);
    m * m * m * m * m
}

/// GGX density of microfacet normals, 1/sr. The sine comes from a cross product: `1 - cos^2` cancels for narrow lobes.
fn ggx(normal: Vec3, half: Vec3, alpha: f32) -> f32 {
    let cosine = normal.dot(half);
    let a2 = alpha * alpha;
    let root = a2 * cosine * cosine + normal.cross(half).length_squared();
    a2 * FRAC_1_PI / (root * root)
}

/// The share of the light from the visible microfacets that others do not mask on its way out.
pub(super) fn masking(cos_o: f32, cos_i: f32, alpha: f32) -> f32 {
    let seen = 1.0 + smith_lambda(cos_o, alpha);
    seen / (seen + smith_lambda(cos_i, alpha))
}

/// Smith's auxiliary function of GGX (Heitz, "Understanding the Masking-Shadowing Function", 2014).
fn smith_lambda(cosine: f32, alpha: f32) -> f32 {
    let c2 = cosine * cosine;
    0.5 * ((1.0 + alpha * alpha * (1.0 - c2).max(0.0) / c2).sqrt() - 1.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Material;
    use crate::trace::Rng;

    /// Seen from the front at this cosine to the normal, which is y.
    fn bsdf(material: &Material, cosine: f32) -> Bsdf {
        Bsdf::new(&Look::of(material), Vec3::Y, viewer(cosine), true)
    }

    fn viewer(cosine: f32) -> Vec3 {
        Vec3::new((1.0 - cosine * cosine).sqrt(), cosine, 0.0)
    }

    fn glossy(roughness: f32, f0: f32, color: f32, cosine: f32) -> Bsdf {
        bsdf(&Material::glossy("", Vec3::splat(color), roughness, f0), cosine)
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

    /// Materials with each kind of lobe, without colour, so that they lose no light.
    fn white() -> Vec<(&'static str, Material)> {
        let white = Vec3::ONE;
        let rough = |material: Material, roughness| Material { roughness, ..material };
        let thin = |roughness| Material { medium: None, ..rough(Material::glass("", white, 1.5), roughness) };
        vec![
            ("coat", Material::glossy("", white, 0.3, 0.04)),
            ("rough coat", Material::glossy("", white, 0.9, 0.04)),
            ("bright coat", Material::glossy("", white, 0.5, 0.5)),
            ("narrow metal", Material::metal("", white, 0.1)),
            ("metal", Material::metal("", white, 0.4)),
            ("rough metal", Material::metal("", white, 1.0)),
            ("mix", Material { metallic: 0.5, ..Material::glossy("", white, 0.4, 0.04) }),
            ("mix without a coat", Material { metallic: 0.5, ..Material::glossy("", white, 0.4, 0.0) }),
            ("rough mix", Material { metallic: 0.5, ..Material::glossy("", white, 1.0, 0.0) }),
            ("mirror", Material::mirror("", white)),
            ("thin air", Material { medium: None, ..Material::glass("", white, 1.0) }),
            ("rough thin air", Material { medium: None, roughness: 0.3, ..Material::glass("", white, 1.0) }),
            ("glass", Material::glass("", white, 1.5)),
            ("thin glass", thin(0.0)),
            ("rough thin glass", thin(0.3)),
            ("rough glass", rough(Material::glass("", white, 1.5), 0.3)),
            ("half glass", Material { transmission: 0.5, ..Material::glossy("", white, 0.3, 0.04) }),
        ]
    }

    /// The mean weight of sampled directions, and its standard deviation.
    fn furnace(bsdf: &Bsdf) -> [f64; 2] {
        let mut rng = Rng::new(8, 9);
        let shares = bsdf.lobe_shares();
        let count = 1 << 16;
        let weights = (0..count).map(|_| {
            let choice = rng.next_f32();
            let lobe = if choice < shares[0] {
                Lobe::Diffuse
            } else if choice < shares[0] + shares[1] {
                Lobe::Specular
            } else {
                Lobe::Transmit
            };
            let weight =
                bsdf.sample(lobe, rng.next_pair()).map_or(0.0, |s| s.weight.x / shares[lobe as usize]);
            f64::from(weight)
        });
        let [sum, squares] = weights.fold([0.0; 2], |[a, b], w| [a + w, b + w * w]);
        let n = f64::from(count);
        [sum / n, ((squares / n - (sum / n).powi(2)).max(0.0) / n).sqrt()]
    }

    #[test]
    fn white_surfaces_keep_all_light() {
        for (name, material) in white() {
            // What rough glass loses between microfacets is not returned: an eighth at grazing angles.
            let lossy = material.transmission > 0.0 && material.roughness > 0.0;
            for cosine in [0.05, 0.3, 0.7, 1.0] {
                for front in [true, false] {
                    let bsdf = Bsdf::new(&Look::of(&material), Vec3::Y, viewer(cosine), front);
                    let [mean, deviation] = furnace(&bsdf);
                    let tolerance = if lossy { 0.13 } else { 0.01 };
                    let is_kept = (mean - 1.0).abs() < tolerance + 4.0 * deviation;
                    assert!(is_kept, "{name}, {cosine}, front {front}: {mean} +- {deviation}");
                }
            }
        }
    }

    #[test]
    fn shares_of_lobes_are_probabilities() {
        for cosine in [0.1, 0.6, 1.0] {
            assert_eq!(bsdf(&Material::diffuse("", Vec3::ONE), cosine).lobe_shares(), [1.0, 0.0, 0.0]);
            assert_eq!(bsdf(&Material::mirror("", Vec3::ONE), cosine).lobe_shares(), [0.0, 1.0, 0.0]);
            for (name, material) in white() {
                let bsdf = bsdf(&material, cosine);
                let [diffuse, specular, transmit] = bsdf.lobe_shares();
                assert!((diffuse + specular + transmit - 1.0).abs() < 1e-6, "{name}");
                let is_clear = material.transmission == 1.0;
                assert_eq!(transmit > 0.0, material.transmission > 0.0, "{name}");
                assert_eq!(specular > 0.0, material.metallic > 0.0 || material.f0 > 0.0, "{name}");
                assert!(!(is_clear && diffuse > 0.1), "{name}: {diffuse}");
                // In direct mode, base and metals reflect lights only, unless they are seen first.
                let direct = [true, false].map(|at_first| bsdf.direct_shares(at_first).iter().sum::<f32>());
                let shows = material.metallic > 0.0 || material.f0 > 0.1 || material.roughness <= 0.6;
                let is_glass = material.transmission > 0.0;
                let expected = [is_glass || shows, is_glass].map(|is| f32::from(u8::from(is)));
                assert!((direct[0] - expected[0]).abs() + (direct[1] - expected[1]).abs() < 1e-6, "{name}");
            }
        }
        let nothing = bsdf(&Material::diffuse("", Vec3::ONE), 0.6);
        assert_eq!([true, false].map(|at_first| nothing.direct_shares(at_first)), [[0.0; 3]; 2]);
    }

    #[test]
    fn roughness_decides_what_reflects_perfectly_and_what_shows_reflections() {
        // Squares of 0.001936 and 0.002025.
        let is_mirror = |roughness| bsdf(&Material::metal("", Vec3::ONE, roughness), 0.8).mirror().is_some();
        assert_eq!([0.0, 0.044, 0.045, 0.3].map(is_mirror), [true, true, false, false]);
        let is_mirror = |material: Material| bsdf(&material, 0.8).mirror().is_some();
        assert!(!is_mirror(Material::glossy("", Vec3::ONE, 0.0, 0.04)));
        assert!(!is_mirror(Material::glass("", Vec3::ONE, 1.5)), "it also lets light through");
        for (roughness, f0, shows) in
            [(0.6, 0.04, true), (0.61, 0.04, false), (0.9, 0.1, false), (0.9, 0.11, true)]
        {
            let glossy = glossy(roughness, f0, 0.5, 0.8);
            let expected = if shows { [0.0, 1.0, 0.0] } else { [0.0; 3] };
            assert_eq!([glossy.direct_shares(true), glossy.direct_shares(false)], [expected, [0.0; 3]]);
        }
    }

    #[test]
    fn sharpness_is_the_share_that_is_not_diffuse_over_its_width() {
        let of = |material: &Material| bsdf(material, 0.8).sharpness();
        assert_eq!(of(&Material::diffuse("", Vec3::ONE)), 0.0);
        for clear in [Material::mirror("", Vec3::ONE), Material::glass("", Vec3::ONE, 1.5)] {
            assert!((of(&clear) - 500.0).abs() < 1e-2, "{}", of(&clear));
        }
        for coat in [Material::glossy("", Vec3::ZERO, 0.5, 0.3), Material::glossy("", Vec3::ONE, 0.5, 0.04)] {
            let [_, specular, _] = bsdf(&coat, 0.8).lobe_shares();
            assert!((of(&coat) - specular / 0.25).abs() < 1e-5 && specular > 0.05);
        }
    }

    #[test]
    fn normals_that_face_away_are_bent_until_they_are_just_seen() {
        let look = Look::of(&Material::diffuse("", Vec3::ONE));
        let viewer = Vec3::X;
        for (degrees, cosine) in
            [(0.0_f32, 1.0), (60.0, 0.5), (89.9, 0.001_745), (90.0, 1e-3), (100.0, 1.0154e-3)]
        {
            let (sin, cos) = degrees.to_radians().sin_cos();
            let found = Bsdf::new(&look, Vec3::new(cos, sin, 0.0), viewer, true).normal;
            assert!(found.is_normalized() && found.z == 0.0 && found.y >= 0.0);
            assert!((found.dot(viewer) - cosine).abs() < 1e-5, "{degrees}: {found}");
        }
        assert_eq!(Bsdf::new(&look, -viewer, viewer, true).normal, viewer);
    }

    #[test]
    fn rough_glass_passes_light_straight_on_in_direct_mode_only() {
        let glass = |roughness, medium| {
            let clear = Material::glass("", Vec3::new(0.9, 0.8, 0.7), 1.5);
            Look::of(&Material { roughness, medium, metallic: 0.25, transmission: 0.5, ..clear })
        };
        let medium = Some(crate::Medium { ior: 1.5, absorption: Vec3::ZERO });
        // Half of what three quarters of dielectric do not reflect.
        let expected = |cosine: f32| {
            let fresnel = 0.04 + 0.96 * (1.0 - cosine).powi(5);
            0.375 * (1.0 - fresnel) * Vec3::new(0.9, 0.8, 0.7)
        };
        for cosine in [0.1, 0.5, 1.0] {
            for (roughness, medium, passes) in
                [(0.0, None, true), (0.044, None, true), (0.045, None, false), (0.0, medium, false)]
            {
                let look = glass(roughness, medium);
                let direct = straight_through(&look, cosine, Mode::Direct);
                assert!(direct.distance(expected(cosine)) < 1e-6, "{direct}");
                let path = straight_through(&look, cosine, Mode::Path);
                assert_eq!(path, if passes { direct } else { Vec3::ZERO });
            }
        }
        let air = Look::of(&Material { medium: None, ..Material::glass("", Vec3::ONE, 1.0) });
        assert_eq!(straight_through(&air, 0.05, Mode::Path), Vec3::ONE);
    }

    #[test]
    fn colours_never_gain_light_and_metals_keep_their_tint() {
        let gold = Vec3::new(1.0, 0.77, 0.34);
        for roughness in [0.0, 0.2, 0.6, 1.0] {
            let bsdf = bsdf(&Material::metal("", gold, roughness), 1.0);
            let sampled = |lobe| {
                let mut rng = Rng::new(1, 1);
                let weights = (0..4096).filter_map(|_| bsdf.sample(lobe, rng.next_pair())).map(|s| s.weight);
                weights.sum::<Vec3>() / 4096.0
            };
            let all = sampled(Lobe::Diffuse) + sampled(Lobe::Specular);
            assert!(all.cmple(Vec3::splat(1.02)).all(), "{roughness}: {all}");
            // Repeated scattering saturates the tint of a rough metal.
            assert!((0.5..0.8).contains(&all.y) && (0.1..0.37).contains(&all.z), "{roughness}: {all}");
        }
    }

    #[test]
    fn light_may_go_either_way() {
        let materials = white().into_iter().filter(|(_, material)| material.transmission == 0.0);
        for (name, material) in materials {
            let look = Look::of(&Material { color: Vec3::new(0.8, 0.5, 0.2), ..material });
            let mut rng = Rng::new(2, 3);
            for _ in 0..200 {
                let mut direction = || {
                    let [u, v] = rng.next_pair();
                    let (cosine, (sin, cos)) = (0.05 + 0.95 * v, (TAU * u).sin_cos());
                    let sine = (1.0 - cosine * cosine).sqrt();
                    Vec3::new(sine * cos, cosine, sine * sin)
                };
                let (a, b) = (direction(), direction());
                let value = |from: Vec3, to: Vec3| {
                    let lobes = Bsdf::new(&look, Vec3::Y, from, true).evaluate(to);
                    lobes.iter().map(|lobe| lobe.value).sum::<Vec3>() / to.y
                };
                let (there, back) = (value(a, b), value(b, a));
                let close = (there - back).abs().max_element() <= 1e-3 * there.max_element();
                assert!(close, "{name}: {there} and {back}");
            }
        }
    }

    /// Chi-squared of the numbers of samples in cells of equal solid angle, with that of the density; cells with few
    /// expected samples are joined. The number of degrees of freedom comes second.
    fn chi_squared(bsdf: &Bsdf, lobe: Lobe) -> [f64; 2] {
        const ROWS: usize = 20;
        const COLUMNS: usize = 20;
        const STEPS: usize = 24;
        let count = 1 << 17;
        let mut rng = Rng::new(11, lobe as u64);
        let mut found = vec![0.0; ROWS * COLUMNS];
        for _ in 0..count {
            let Some(Scatter { direction, .. }) = bsdf.sample(lobe, rng.next_pair()) else { continue };
            let row = (0.5 * (direction.y + 1.0) * ROWS as f32) as usize;
            let column = ((direction.z.atan2(direction.x) / TAU + 0.5) * COLUMNS as f32) as usize;
            found[row.min(ROWS - 1) * COLUMNS + column.min(COLUMNS - 1)] += 1.0;
        }
        let expected = |cell: usize| {
            let (row, column) = (cell / COLUMNS, cell % COLUMNS);
            let steps = (0..STEPS * STEPS).map(|step| [step / STEPS, step % STEPS].map(|k| k as f32 + 0.5));
            let sum: f64 = steps
                .map(|[s, t]| {
                    let y = 2.0 * (row as f32 + s / STEPS as f32) / ROWS as f32 - 1.0;
                    let angle = TAU * ((column as f32 + t / STEPS as f32) / COLUMNS as f32 - 0.5);
                    let radius = (1.0 - y * y).sqrt();
                    let direction = Vec3::new(radius * angle.cos(), y, radius * angle.sin());
                    f64::from(bsdf.evaluate(direction)[lobe as usize].pdf)
                })
                .sum();
            let solid_angle = 2.0 * f64::from(TAU) / (ROWS * COLUMNS) as f64;
            f64::from(count) * sum * solid_angle / (STEPS * STEPS) as f64
        };
        let (mut sum, mut cells, mut rest) = (0.0, 0.0, [0.0; 2]);
        for (cell, &found) in found.iter().enumerate() {
            let expected = expected(cell);
            if expected < 10.0 {
                rest = [rest[0] + found, rest[1] + expected];
            } else {
                sum += (found - expected).powi(2) / expected;
                cells += 1.0;
            }
        }
        if rest[1] > 10.0 {
            sum += (rest[0] - rest[1]).powi(2) / rest[1];
            cells += 1.0;
        }
        [sum, cells]
    }

    #[test]
    fn samples_follow_their_density() {
        let glass = |roughness| Material { roughness, ..Material::glass("", Vec3::ONE, 1.5) };
        let thin = Material { medium: None, ..glass(0.4) };
        let materials = [
            ("coat", Material::glossy("", Vec3::ONE, 0.5, 0.04), &[Lobe::Diffuse, Lobe::Specular][..]),
            ("metal", Material::metal("", Vec3::ONE, 0.7), &[Lobe::Specular]),
            ("rough metal", Material::metal("", Vec3::ONE, 1.0), &[Lobe::Diffuse, Lobe::Specular]),
            ("glass", glass(0.5), &[Lobe::Specular, Lobe::Transmit]),
            ("thin glass", thin, &[Lobe::Specular, Lobe::Transmit]),
        ];
        for (name, material, lobes) in materials {
            for (cosine, front) in [(0.9, true), (0.4, true), (0.9, false), (0.4, false)] {
                let bsdf = Bsdf::new(&Look::of(&material), Vec3::Y, viewer(cosine), front);
                for &lobe in lobes {
                    let [sum, cells] = chi_squared(&bsdf, lobe);
                    // The mean is the number of cells; five deviations, and what the cells' integrals are off.
                    let limit = cells + 5.0 * (2.0 * cells).sqrt() + 0.1 * cells;
                    assert!(
                        sum < limit,
                        "{name}, {lobe:?}, {cosine}, front {front}: {sum} for {cells} cells"
                    );
                }
            }
        }
    }

    #[test]
    fn clear_glass_bends_light_by_snells_law() {
        for (front, eta) in [(true, 1.5_f32), (false, 1.0 / 1.5)] {
            for sine in [0.0_f32, 0.3, 0.6, 0.9] {
                let to_viewer = viewer((1.0 - sine * sine).sqrt());
                let glass =
                    Bsdf::new(&Look::of(&Material::glass("", Vec3::ONE, 1.5)), Vec3::Y, to_viewer, front);
                let through = glass.sample(Lobe::Transmit, [0.5; 2]);
                if sine > eta {
                    assert!(through.is_none() && glass.lobe_shares() == [0.0, 1.0, 0.0]);
                    continue;
                }
                let Scatter { direction, weight, pdf } = through.unwrap();
                assert!((direction.x + sine / eta).abs() < 1e-5 && direction.y < 0.0, "{direction}");
                let reflected = glass.sample(Lobe::Specular, [0.5; 2]).unwrap().weight;
                assert!(pdf.is_infinite() && ((weight + reflected).x - 1.0).abs() < 1e-6);
                if sine == 0.0 {
                    assert!((reflected.x - 0.04).abs() < 1e-6);
                }
            }
        }
        // At Brewster's angle, light of one direction of polarisation is not reflected: 0.5 ((1 - n^2) / (1 + n^2))^2.
        let brewster = fresnel_dielectric(1.0 / 3.25_f32.sqrt(), 1.5);
        assert!((brewster - 0.5 * (1.25_f32 / 3.25).powi(2)).abs() < 1e-6, "{brewster}");
    }
}
