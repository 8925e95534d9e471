use glam::{Affine2, Vec3};

use crate::texture::Wrap;

/// The reflectance at normal incidence of glass and plastic, of index of refraction 1.5.
pub const DIELECTRIC_F0: f32 = 0.04;

/// How a material's opacity shows.
#[derive(Clone, Copy, Debug, Default, PartialEq, serde::Deserialize)]
pub enum Alpha {
    /// Not at all.
    #[default]
    Opaque,
    /// What is less opaque than the cutoff is cut out; the rest is opaque.
    Mask(f32),
    /// What is behind shows through.
    Blend,
}

/// What a surface looks like: the metallic-roughness model of glTF 2.0.
///
/// A dielectric is a Lambertian base, or glass where it transmits, below a GGX lobe whose reflectance at normal incidence
/// is `f0`; a metal is a GGX lobe tinted by the colour. In between, the two are mixed. All energy that the lobes do not
/// absorb is kept. Each factor may be multiplied by a map.
#[derive(Clone, Debug, PartialEq)]
pub struct Material {
    /// Its name in the source file; may be empty.
    pub name: String,
    /// Linear Rec. 709 reflectance, or the tint of a metal or of glass; each channel in [0, 1].
    pub color: Vec3,
    /// From 0, transparent, to 1; used as `alpha` says.
    pub opacity: f32,
    /// How its opacity shows.
    pub alpha: Alpha,
    /// From 0, a dielectric, to 1, a metal.
    pub metallic: f32,
    /// Perceptual roughness in [0, 1]; the width of the lobe is its square. At 0, reflection is perfect.
    pub roughness: f32,
    /// Reflectance of the dielectric at normal incidence; 0 for a Lambertian surface without a lobe.
    pub f0: f32,
    /// From 0 to 1: how much of the light that enters the dielectric passes through it.
    pub transmission: f32,
    /// What is behind a surface that transmits; without it, it is a thin sheet, which does not bend light.
    pub medium: Option<Medium>,
    /// Emitted radiance of the front side; zero for all but emissive surfaces.
    pub emission: Vec3,
    /// Whether the back side emits too.
    pub double_sided: bool,
    /// Whether rays pass through it from behind.
    pub culled: bool,
    /// Whether it shows its colour whatever light there is.
    pub unlit: bool,
    /// The maps of the factors.
    pub maps: Maps,
}

/// The inside of a body that transmits light.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Medium {
    /// Index of refraction.
    pub ior: f32,
    /// Absorption, 1/m per colour channel.
    pub absorption: Vec3,
}

/// A texture that multiplies a factor of a material.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Map {
    /// Index into `Scene::textures`.
    pub texture: usize,
    /// The channel that a map of one number reads: 0 red, 1 green, 2 blue, 3 alpha.
    pub channel: usize,
    /// The set of the mesh's texture coordinates: 0 or 1.
    pub uv_set: usize,
    /// From these coordinates to those of the texture: (0, 0) is the corner of its first texel, (1, 1) the opposite one.
    pub transform: Affine2,
    /// What lies beyond it, in both directions.
    pub wrap: [Wrap; 2],
    /// Whether the nearest texel counts, instead of the four around, interpolated.
    pub nearest: bool,
}

impl Map {
    /// A map of the whole texture, which repeats, by the first set of texture coordinates.
    pub fn new(texture: usize) -> Self {
        Self {
            texture,
            channel: 0,
            uv_set: 0,
            transform: Affine2::IDENTITY,
            wrap: [Wrap::Repeat; 2],
            nearest: false,
        }
    }

    /// The same map, of one channel.
    pub fn of_channel(self, channel: usize) -> Self {
        Self { channel, ..self }
    }
}

/// The maps of a material.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Maps {
    /// Colour, as sRGB.
    pub color: Option<Map>,
    /// Opacity, by one channel.
    pub opacity: Option<Map>,
    /// Metallic, by one channel.
    pub metallic: Option<Map>,
    /// Roughness, by one channel.
    pub roughness: Option<Map>,
    /// Transmission, by one channel.
    pub transmission: Option<Map>,
    /// Emission, as sRGB.
    pub emission: Option<Map>,
    /// Normal in the frame of the texture coordinates, and the factor on its slope.
    pub normal: Option<(Map, f32)>,
}

impl Maps {
    /// Every map.
    pub fn all(&self) -> impl Iterator<Item = Map> + use<> {
        let Self { color, opacity, metallic, roughness, transmission, emission, normal } = *self;
        let normal = normal.map(|(map, _)| map);
        [color, opacity, metallic, roughness, transmission, emission, normal].into_iter().flatten()
    }

    /// Every map, to change.
    pub(crate) fn all_mut(&mut self) -> impl Iterator<Item = &mut Map> {
        let Self { color, opacity, metallic, roughness, transmission, emission, normal } = self;
        let normal = normal.as_mut().map(|(map, _)| map);
        let others = [color, opacity, metallic, roughness, transmission, emission];
        others.into_iter().filter_map(Option::as_mut).chain(normal)
    }

    /// Whether there is none.
    pub fn is_empty(&self) -> bool {
        *self == Self::default()
    }
}

impl Material {
    /// A Lambertian surface that emits nothing.
    pub fn diffuse(name: impl Into<String>, color: Vec3) -> Self {
        Self {
            name: name.into(),
            color,
            opacity: 1.0,
            alpha: Alpha::Opaque,
            metallic: 0.0,
            roughness: 1.0,
            f0: 0.0,
            transmission: 0.0,
            medium: None,
            emission: Vec3::ZERO,
            double_sided: false,
            culled: false,
            unlit: false,
            maps: Maps::default(),
        }
    }

    /// A Lambertian surface below a GGX lobe of the given roughness and reflectance at normal incidence.
    pub fn glossy(name: impl Into<String>, color: Vec3, roughness: f32, f0: f32) -> Self {
        Self { roughness, f0, ..Self::diffuse(name, color) }
    }

    /// A metal of this tint.
    pub fn metal(name: impl Into<String>, color: Vec3, roughness: f32) -> Self {
        Self { metallic: 1.0, ..Self::glossy(name, color, roughness, DIELECTRIC_F0) }
    }

    /// A perfect mirror of this tint.
    pub fn mirror(name: impl Into<String>, color: Vec3) -> Self {
        Self::metal(name, color, 0.0)
    }

    /// A clear body of this tint and index of refraction.
    pub fn glass(name: impl Into<String>, color: Vec3, ior: f32) -> Self {
        let medium = Some(Medium { ior, absorption: Vec3::ZERO });
        Self { transmission: 1.0, medium, ..Self::glossy(name, color, 0.0, f0_of_ior(ior)) }
    }

    /// A black surface that emits this radiance.
    pub fn lamp(name: impl Into<String>, emission: Vec3) -> Self {
        Self { emission, ..Self::diffuse(name, Vec3::ZERO) }
    }

    /// Whether it emits light.
    pub fn emits(&self) -> bool {
        self.emission != Vec3::ZERO
    }

    /// Whether shadows show on it: it scatters light, and not as a mirror or clear glass does.
    pub(crate) fn shows_shadows(&self) -> bool {
        let has_base = self.metallic < 1.0 && self.transmission < 1.0 && self.color != Vec3::ZERO;
        let has_lobe = self.f0 > 0.0 || self.metallic > 0.0;
        let is_perfect = self.roughness == 0.0 && (self.metallic == 1.0 || self.transmission > 0.0);
        !self.unlit && (has_base || has_lobe && !is_perfect)
    }

    /// Whether a ray may pass through it.
    pub fn is_transparent(&self) -> bool {
        self.alpha != Alpha::Opaque || self.transmission > 0.0
    }
}

/// The reflectance at normal incidence of a dielectric with this index of refraction.
pub fn f0_of_ior(ior: f32) -> f32 {
    ((ior - 1.0) / (ior + 1.0)).powi(2)
}
