use glam::{Vec2, Vec3, Vec4};

use crate::mesh::interpolate;
use crate::texture::Coding;
use crate::{Alpha, Map, Material, Medium, Scene};

/// A material at one point of a surface: its factors times its maps and the mesh's colours.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Look {
    /// Linear Rec. 709 reflectance, or the tint of a metal or of glass.
    pub color: Vec3,
    /// From 0 to 1, after [`Alpha`]: 1 if opaque, 0 or 1 if cut out.
    pub opacity: f32,
    /// From 0, a dielectric, to 1, a metal.
    pub metallic: f32,
    /// Perceptual roughness in [0, 1].
    pub roughness: f32,
    /// Reflectance of the dielectric at normal incidence.
    pub f0: f32,
    /// How much of the light that enters the dielectric passes through it.
    pub transmission: f32,
    /// What is behind a surface that transmits.
    pub medium: Option<Medium>,
    /// Emitted radiance.
    pub emission: Vec3,
    /// Whether the back side emits too.
    pub double_sided: bool,
    /// Whether it shows its colour whatever light there is.
    pub unlit: bool,
}

impl Look {
    /// The factors of a material, without maps and colours of a mesh.
    pub fn of(material: &Material) -> Self {
        Self {
            color: material.color,
            opacity: seen(material.alpha, material.opacity),
            metallic: material.metallic,
            roughness: material.roughness,
            f0: material.f0,
            transmission: material.transmission,
            medium: material.medium,
            emission: material.emission,
            double_sided: material.double_sided,
            unlit: material.unlit,
        }
    }

    /// The share of light that the surface scatters where it is opaque, seen along its normal: the albedos of base and
    /// glass, and the reflectance of the lobe above them. The lobes' sum is `color + f0 (1 - metallic)`, since the colour
    /// tints the base, glass and metal alike. Zero if it is unlit. A sample divided by it keeps the light, without the
    /// material's maps.
    pub fn albedo(&self) -> Vec3 {
        if self.unlit { Vec3::ZERO } else { self.color + self.f0 * (1.0 - self.metallic) }
    }
}

/// The opacity that a material's rule makes of a share.
fn seen(alpha: Alpha, opacity: f32) -> f32 {
    match alpha {
        Alpha::Opaque => 1.0,
        Alpha::Mask(cutoff) => f32::from(u8::from(opacity >= cutoff)),
        Alpha::Blend => opacity,
    }
}

impl Scene {
    /// What the surface looks like at the point of triangle `face` with these barycentric weights.
    pub fn look(&self, face: usize, weights: Vec3) -> Look {
        let material = &self.materials[self.mesh.material[face] as usize];
        let maps = &material.maps;
        let mut look = Look::of(material);
        if let Some(map) = &maps.color {
            look.color *= self.texel(map, face, weights, Coding::Color).truncate();
        }
        if let Some(color) = self.vertex_color(face, weights) {
            look.color *= color.truncate();
        }
        if material.alpha != Alpha::Opaque {
            look.opacity = self.opacity(face, weights);
        }
        let share = |map: &Map| self.texel(map, face, weights, Coding::Linear)[map.channel];
        look.metallic *= maps.metallic.as_ref().map_or(1.0, share);
        look.roughness *= maps.roughness.as_ref().map_or(1.0, share);
        look.transmission *= maps.transmission.as_ref().map_or(1.0, share);
        if let Some(map) = &maps.emission {
            look.emission *= self.texel(map, face, weights, Coding::Color).truncate();
        }
        look
    }

    /// How much of the light from behind the point of a triangle it holds back, as its material's rule says.
    pub(crate) fn opacity(&self, face: usize, weights: Vec3) -> f32 {
        let material = &self.materials[self.mesh.material[face] as usize];
        let mut opacity = material.opacity;
        if let Some(map) = &material.maps.opacity {
            opacity *= self.texel(map, face, weights, Coding::Linear)[map.channel];
        }
        if let Some(color) = self.vertex_color(face, weights) {
            opacity *= color.w;
        }
        seen(material.alpha, opacity)
    }

    /// The shading normal `normal` of a point of a triangle that is seen from its front or back, bent by the material's
    /// normal map: of unit length.
    pub(crate) fn mapped_normal(&self, face: usize, weights: Vec3, front: bool, normal: Vec3) -> Vec3 {
        let material = &self.materials[self.mesh.material[face] as usize];
        let Some((map, scale)) = material.maps.normal else { return normal };
        let Some(uvs) = self.mesh.corner_uvs[map.uv_set].get(face) else { return normal };
        let frame = match self.tangent(face, weights) {
            Some(tangent) => frame(tangent, if front { normal } else { -normal }),
            None => tangents(self.mesh.corners(face), *uvs, normal),
        };
        let Some((tangent, bitangent)) = frame else { return normal };
        let texel = 2.0 * self.texel(&map, face, weights, Coding::Linear).truncate() - 1.0;
        // Seen from behind, bumps are hollows.
        let slope = if front { scale } else { -scale };
        let bent = tangent * (slope * texel.x) + bitangent * (slope * texel.y) + normal * texel.z;
        bent.normalize_or(normal)
    }

    /// The source's own tangent at a point of a triangle.
    fn tangent(&self, face: usize, weights: Vec3) -> Option<Vec4> {
        let tangent = interpolate(*self.mesh.corner_tangents.get(face)?, weights);
        let turned = match self.body_of_face(face as u32) {
            0 => tangent.truncate(),
            body => self.poses[body as usize - 1].vector(tangent.truncate()),
        };
        (tangent != Vec4::ZERO).then(|| turned.extend(tangent.w))
    }

    fn vertex_color(&self, face: usize, weights: Vec3) -> Option<Vec4> {
        self.mesh.corner_colors.get(face).map(|&colors| interpolate(colors, weights))
    }

    fn texel(&self, map: &Map, face: usize, weights: Vec3, coding: Coding) -> Vec4 {
        let uv =
            self.mesh.corner_uvs[map.uv_set].get(face).map_or(Vec2::ZERO, |&uvs| interpolate(uvs, weights));
        self.textures[map.texture].at(map, uv, coding)
    }
}

/// The unit directions to the right and up in a normal map, across `normal`, on whose side its tangent counts.
fn frame(tangent: Vec4, normal: Vec3) -> Option<(Vec3, Vec3)> {
    let along = tangent.truncate();
    let right = (along - normal * normal.dot(along)).try_normalize()?;
    Some((right, normal.cross(right) * tangent.w.signum()))
}

/// The unit directions, across `normal`, in which u grows and v shrinks (right and up in an image) along a triangle;
/// `None` if its texture coordinates have no area.
fn tangents([a, b, c]: [Vec3; 3], [s, t, r]: [Vec2; 3], normal: Vec3) -> Option<(Vec3, Vec3)> {
    let [first, second] = [b - a, c - a];
    let [d, e] = [t - s, r - s];
    let area = d.perp_dot(e);
    if area == 0.0 || !area.is_finite() {
        return None;
    }
    let along_u = (first * e.y - second * d.y) * area.signum();
    let against_v = (first * e.x - second * d.x) * area.signum();
    let (right, up) = frame(along_u.extend(1.0), normal)?;
    Some((right, if up.dot(against_v) < 0.0 { -up } else { up }))
}
