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

    /// Whether all that is seen of the surface is light that it scatters: it hides what is behind it, and emits nothing.
    pub(crate) fn only_scatters(&self) -> bool {
        self.opacity == 1.0 && self.transmission == 0.0 && !self.unlit && self.emission == Vec3::ZERO
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

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use glam::{Affine3A, Quat};

    use super::*;
    use crate::{Camera, Maps, Motion, MotionKey, Pose, SceneBuilder, Shape, Texture};

    /// The weights of a triangle's middle.
    const MIDDLE: Vec3 = Vec3::splat(1.0 / 3.0);

    /// One triangle of a material whose maps are textures of one texel each.
    fn scene(shape: &Shape, material: Material, texels: &[[u8; 4]], motion: Option<Motion>) -> Scene {
        let mut builder = SceneBuilder::new();
        for &texel in texels {
            builder.texture(&Arc::new(Texture { name: String::new(), size: [1, 1], texels: vec![texel] }));
        }
        let material = builder.material(material);
        builder.moving_if(motion, |builder| builder.add(shape, material)).unwrap();
        let camera = Camera::look_at(Vec3::Z, Vec3::ZERO, 1.0, 0.1, 10.0);
        builder.build("test", camera, Vec3::ZERO, 0.0, 40.0).unwrap()
    }

    fn triangle() -> Shape {
        Shape {
            positions: vec![Vec3::ZERO, Vec3::X, Vec3::Y],
            triangles: vec![[0, 1, 2]],
            ..Shape::default()
        }
    }

    #[test]
    fn every_factor_is_multiplied_by_its_map_and_by_the_colours_of_corners() {
        let factors = Material {
            opacity: 0.8,
            alpha: Alpha::Blend,
            metallic: 0.7,
            roughness: 0.6,
            transmission: 0.5,
            emission: Vec3::new(3.0, 2.0, 1.0),
            ..Material::glossy("", Vec3::new(0.9, 0.8, 0.7), 0.6, 0.04)
        };
        let maps = Maps {
            color: Some(Map::new(0)),
            opacity: Some(Map::new(1).of_channel(0)),
            metallic: Some(Map::new(1).of_channel(1)),
            roughness: Some(Map::new(1).of_channel(2)),
            transmission: Some(Map::new(1).of_channel(3)),
            emission: Some(Map::new(0)),
            normal: None,
        };
        // 188 of 255 is about half of the light.
        let texels = [[188, 255, 0, 255], [51, 102, 153, 204]];
        let half = crate::texture::linear_of(188);
        let colored = Shape { colors: vec![[Vec4::new(0.5, 0.25, 1.0, 0.5); 3]], ..triangle() };
        let look = |maps, shape: &Shape| {
            scene(shape, Material { maps, ..factors.clone() }, &texels, None).look(0, MIDDLE)
        };
        let same = |a: Look, b: Look| {
            let numbers = |look: Look| {
                let shares = [look.opacity, look.metallic, look.roughness, look.transmission];
                [look.color.to_array().to_vec(), look.emission.to_array().to_vec(), shares.to_vec()].concat()
            };
            let is_near = numbers(a).iter().zip(numbers(b)).all(|(a, b)| (a - b).abs() < 1e-6);
            assert!(is_near, "{a:?}, expected {b:?}");
        };
        let plain = Look::of(&factors);
        let mapped = Look {
            color: Vec3::new(0.9 * half, 0.8, 0.0),
            emission: Vec3::new(3.0 * half, 2.0, 0.0),
            opacity: 0.8 * 0.2,
            metallic: 0.7 * 0.4,
            roughness: 0.6 * 0.6,
            transmission: 0.5 * 0.8,
            ..plain
        };
        same(look(Maps::default(), &triangle()), plain);
        same(look(maps, &triangle()), mapped);
        let of_corners = |look: Look| Look {
            color: look.color * Vec3::new(0.5, 0.25, 1.0),
            opacity: 0.5 * look.opacity,
            ..look
        };
        same(look(Maps::default(), &colored), of_corners(plain));
        same(look(maps, &colored), of_corners(mapped));
    }

    #[test]
    fn a_mask_keeps_what_is_as_opaque_as_its_cutoff() {
        for (opacity, expected) in [(0.49, 0.0), (0.5, 1.0), (0.51, 1.0)] {
            let shown =
                |alpha| Look::of(&Material { opacity, alpha, ..Material::diffuse("", Vec3::ONE) }).opacity;
            assert_eq!(shown(Alpha::Mask(0.5)), expected, "{opacity}");
            assert_eq!([shown(Alpha::Opaque), shown(Alpha::Blend)], [1.0, opacity]);
        }
    }

    /// 0.6 to the right, 0.2 up, and the rest outwards; and the factor on the slope.
    const BUMP: [u8; 4] = [204, 153, 230, 255];
    const SCALE: f32 = 0.5;

    /// The bent normal in a frame.
    fn bent([right, up, out]: [Vec3; 3], sign: f32) -> Vec3 {
        let [x, y, z, _] = BUMP.map(|code| 2.0 * f32::from(code) / 255.0 - 1.0);
        (sign * SCALE * (x * right + y * up) + z * out).normalize()
    }

    fn bumpy() -> Material {
        let maps = Maps { normal: Some((Map::new(0), SCALE)), ..Maps::default() };
        Material { maps, ..Material::diffuse("", Vec3::ONE) }
    }

    #[test]
    fn a_normal_map_bends_to_where_u_grows_and_v_shrinks() {
        // u = a x + b y and v = c x + d y, so that u grows along (d, -c) / (a d - b c), where v does not change.
        for (size, [a, b, c, d]) in [
            (1.0, [1.0, 0.0, 0.0, -1.0]),
            (1.0, [1.0, 0.0, 0.0, 1.0]),
            (1.0, [2.0, 0.5, 0.3, -1.5]),
            (1.0, [-0.7, 1.5, 2.0, 0.4]),
            (50.0, [0.6, 1.5, -2.0, 0.4]),
            (0.02, [0.6, -1.5, 2.0, 0.4]),
            (50.0, [0.0, -1.0, -1.0, 0.0]),
        ] {
            let corners = [Vec2::new(-0.2, 0.1), Vec2::new(0.9, 0.3), Vec2::new(0.2, 0.8)].map(|p| p * size);
            let uv = |p: Vec3| Vec2::new(a * p.x + b * p.y + 0.3, c * p.x + d * p.y - 0.1);
            let shape = Shape { positions: corners.map(|p| p.extend(0.0)).into(), ..triangle() }.with_uvs(uv);
            let scene = scene(&shape, bumpy(), &[BUMP], None);
            let area = a * d - b * c;
            let along = Vec3::new(d, -c, 0.0) * area.signum();
            // The direction in which v shrinks while u does not change.
            let against = -Vec3::new(-b, a, 0.0) * area.signum();
            for out in [Vec3::Z, Vec3::new(0.2, -0.3, 1.0).normalize()] {
                let right = (along - out * out.dot(along)).normalize();
                let up = out.cross(right);
                let up = up * up.dot(against).signum();
                for (front, sign) in [(true, 1.0), (false, -1.0)] {
                    let found = scene.mapped_normal(0, MIDDLE, front, out);
                    let expected = bent([right, up, out], sign);
                    assert!(found.distance(expected) < 1e-5, "{a} {b} {c} {d}: {found}, expected {expected}");
                }
            }
        }
    }

    #[test]
    fn without_an_area_of_texture_coordinates_a_normal_map_bends_nothing() {
        for uv in
            [|_: Vec3| Vec2::ZERO, |p: Vec3| Vec2::splat(p.x + 2.0 * p.y), |p: Vec3| Vec2::new(p.x, 0.0)]
        {
            let scene = scene(&triangle().with_uvs(uv), bumpy(), &[BUMP], None);
            assert_eq!(scene.mapped_normal(0, MIDDLE, true, Vec3::Z), Vec3::Z);
        }
        assert_eq!(
            scene(&triangle(), bumpy(), &[BUMP], None).mapped_normal(0, MIDDLE, true, Vec3::Z),
            Vec3::Z
        );
    }

    #[test]
    fn tangents_of_a_source_turn_with_their_body() {
        let key = MotionKey { time: 0.0, translate: Vec3::ZERO, rotate: Quat::IDENTITY };
        let motion = Motion { pivot: Vec3::ZERO, keys: vec![key], looped: false };
        let turn = Quat::from_euler(glam::EulerRot::XYZ, 0.3, -0.8, 1.1);
        for side in [1.0, -1.0] {
            let tangents = vec![[Vec3::new(0.6, 0.8, 0.0).extend(side); 3]];
            let shape = Shape { tangents, ..triangle().with_uvs(|p| p.truncate()) };
            let scene = scene(&shape, bumpy(), &[BUMP], Some(motion.clone()));
            let posed = scene.posed(&[Pose { rotation: turn, translation: Vec3::X }]);
            let turned = Affine3A::from_quat(turn);
            for (scene, turned) in [(&scene, Affine3A::IDENTITY), (&posed, turned)] {
                for (front, sign) in [(true, 1.0), (false, -1.0)] {
                    let out = sign * Vec3::Z;
                    // Seen from behind, right and up are those of the front, and bumps are hollows.
                    let right = Vec3::new(0.6, 0.8, 0.0);
                    let up = side * Vec3::Z.cross(right);
                    let expected = bent([right, up, out], sign);
                    let found = scene.mapped_normal(0, MIDDLE, front, turned.transform_vector3(out));
                    let expected = turned.transform_vector3(expected);
                    assert!(found.distance(expected) < 1e-5, "{side}, {front}: {found}, expected {expected}");
                }
            }
        }
    }
}
