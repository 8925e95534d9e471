use glam::Vec3;

/// How a surface scatters light.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Surface {
    /// Lambertian.
    Diffuse,
    /// Lambertian below a GGX lobe of the given roughness (0, 1] with normal-incidence reflectance `f0`.
    Glossy {
        /// Perceptual roughness; alpha is its square.
        roughness: f32,
        /// Reflectance at normal incidence.
        f0: f32,
    },
    /// Perfect reflection, tinted by the colour.
    Mirror,
}

/// A surface's colour, scattering and emission.
#[derive(Clone, Debug, PartialEq)]
pub struct Material {
    /// Its name in the source file; may be empty.
    pub name: String,
    /// Linear Rec. 709 reflectance, each channel in [0, 1].
    pub color: Vec3,
    /// How it scatters.
    pub surface: Surface,
    /// Emitted radiance of the front side; zero for all but emissive surfaces.
    pub emission: Vec3,
}

impl Material {
    /// A Lambertian surface that emits nothing.
    pub fn diffuse(name: impl Into<String>, color: Vec3) -> Self {
        Self { name: name.into(), color, surface: Surface::Diffuse, emission: Vec3::ZERO }
    }
}
