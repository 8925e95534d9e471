//! The contents of a file before it becomes a scene, and defaults for a missing light or camera.

use std::collections::BTreeMap;
use std::sync::Arc;

use glam::{Affine3A, DVec3, Vec3};

use super::default_light::add_default_light;
use crate::builder::{CREASE_ANGLE, MeshError, SceneBuilder};
use crate::{Camera, Light, Material, Report, Scene, Shape, Sky, Texture};

/// An emissive shape of more parallelograms than this is a finely tessellated surface. Sampling each part as a light
/// of its own would cost more than it gains, so it is sampled as a whole, and its shadows have no edges.
const MOST_PANELS: usize = 16;

/// Of more parallelograms than that in a model, only those with this share of the power of all are lights of their own.
const LEAST_SHARE: f32 = 1.0 / 32.0;

/// Half the diagonal of the smallest box that fills an image, metres; a smaller one counts as a point.
const SMALLEST: f32 = 1e-9;

/// The shapes, materials, lights and cameras of one file.
#[derive(Clone, Debug, Default)]
pub(crate) struct Model {
    /// What to add to all coordinates of the model to get those of the file, metres (see [`origin_of`]).
    ///
    /// [`origin_of`]: super::origin::origin_of
    pub origin: DVec3,
    /// Each shape with its index into `materials`; without one it gets a plain grey.
    pub parts: Vec<(Shape, Option<usize>)>,
    pub materials: Vec<Material>,
    /// Textures by the index that the materials' maps use.
    pub textures: Vec<Arc<Texture>>,
    /// Lights defined in the file; `add_to` finds emissive parallelograms among the parts.
    pub lights: Vec<Light>,
    pub camera: Option<Camera>,
    /// All cameras of the file by name, `camera` among them.
    pub cameras: Vec<(String, Camera)>,
    /// What the file has that is not in the model as it stands.
    pub report: Report,
    /// What lights it from all around.
    pub sky: Option<Arc<Sky>>,
}

impl Model {
    /// Checks that all shapes can become part of a mesh.
    pub fn check(&self) -> Result<(), MeshError> {
        let [triangles, vertices] = self.counts();
        MeshError::of_size(triangles, vertices)?;
        self.parts.iter().try_for_each(|(shape, _)| shape.check())
    }

    /// A model of one shape without a material.
    pub fn from_shape(shape: Shape) -> Self {
        Self { parts: vec![(shape, None)], ..Self::default() }
    }

    /// The objects of a finished scene. Its quad lights are found again through their emissive triangles.
    pub fn from_scene(scene: &Scene) -> Self {
        let mesh = &scene.mesh;
        let mut parts: BTreeMap<(u32, u32), Shape> = BTreeMap::new();
        for face in 0..mesh.triangles.len() {
            let shape = parts.entry((mesh.object[face], mesh.material[face])).or_default();
            let base = shape.positions.len() as u32;
            shape.positions.extend(mesh.corners(face));
            shape.triangles.push([base, base + 1, base + 2]);
            shape.normals.extend(mesh.corner_normals.get(face));
            for (set, all) in shape.uvs.iter_mut().zip(mesh.corner_uvs.iter()) {
                set.extend(all.get(face));
            }
            shape.tangents.extend(mesh.corner_tangents.get(face));
            shape.colors.extend(mesh.corner_colors.get(face));
        }
        Self {
            origin: scene.origin,
            parts: parts.into_iter().map(|((_, material), shape)| (shape, Some(material as usize))).collect(),
            materials: scene.materials.clone(),
            textures: scene.textures.to_vec(),
            lights: scene
                .lights
                .iter()
                .filter(|light| !matches!(light, Light::Quad { .. }))
                .copied()
                .collect(),
            camera: Some(scene.camera),
            cameras: scene.cameras.to_vec(),
            report: Report::default(),
            sky: scene.sky.clone(),
        }
    }

    /// The numbers of triangles and of vertices.
    pub fn counts(&self) -> [usize; 2] {
        let sum = |count: fn(&Shape) -> usize| self.parts.iter().map(|(shape, _)| count(shape)).sum();
        [sum(|shape| shape.triangles.len()), sum(|shape| shape.positions.len())]
    }

    /// Lowest and highest corner of the box around all vertices (inverted and infinite if there are none).
    pub fn bounds(&self) -> [Vec3; 2] {
        self.bounds_after(Affine3A::IDENTITY)
    }

    /// The box around all vertices once `transform` has moved them.
    pub fn bounds_after(&self, transform: Affine3A) -> [Vec3; 2] {
        let points = self.parts.iter().flat_map(|(shape, _)| &shape.positions);
        points
            .map(|&p| transform.transform_point3(p))
            .fold([Vec3::INFINITY, Vec3::NEG_INFINITY], |[low, high], p| [low.min(p), high.max(p)])
    }

    /// Adds all parts, placed by `transform`, and all lights. `replace` is the builder's index of a material that
    /// takes the place of the model's own.
    pub fn add_to(
        &self,
        builder: &mut SceneBuilder,
        transform: Affine3A,
        replace: Option<u32>,
    ) -> Result<(), MeshError> {
        // Only used materials become part of the scene.
        let mut index: Vec<Option<u32>> = vec![None; self.materials.len()];
        let mut plain = None;
        let mut panels = Vec::new();
        for (shape, material) in &self.parts {
            let placed = shape.transformed(transform);
            let own = match (replace, *material) {
                (Some(replacement), _) => replacement,
                (None, Some(i)) => *index[i].get_or_insert_with(|| self.add_material(builder, i)),
                (None, None) => *plain.get_or_insert_with(|| builder.material(plain_material())),
            };
            builder.add(&placed, own)?;
            let material = builder.material_at(own);
            let (radiance, both_sides) = (material.emission, material.double_sided);
            if material.emits() && material.maps.emission.is_none() {
                let shape = parallelograms(&placed);
                if shape.len() <= MOST_PANELS {
                    panels.extend(shape.into_iter().map(|sides| Panel { sides, radiance, both_sides }));
                }
            }
        }
        register(panels, builder);
        for light in &self.lights {
            match *light {
                Light::Point { position, intensity } => {
                    builder.point_light(transform.transform_point3(position), intensity);
                }
                Light::Spot { position, axis, intensity, cosines } => builder.spot_light(
                    transform.transform_point3(position),
                    transform.transform_vector3(axis).normalize_or(axis),
                    intensity,
                    cosines,
                ),
                Light::Quad { corner, u, v, radiance } => builder.register_quad_light(
                    transform.transform_point3(corner),
                    transform.transform_vector3(u),
                    transform.transform_vector3(v),
                    radiance,
                ),
            }
        }
        Ok(())
    }

    /// Adds a material and its textures.
    fn add_material(&self, builder: &mut SceneBuilder, index: usize) -> u32 {
        let mut material = self.materials[index].clone();
        for map in material.maps.all_mut() {
            map.texture = builder.texture(&self.textures[map.texture]);
        }
        builder.material(material)
    }

    /// The scene of this model alone, with a light and a camera if it has none.
    pub fn into_scene(self, name: &str) -> Result<Scene, MeshError> {
        let mut builder = SceneBuilder::new();
        builder.origin = self.origin;
        builder.cameras = self.cameras.clone();
        builder.report.extend(&self.report);
        if let Some(sky) = &self.sky {
            builder.sky(sky.clone());
        }
        self.add_to(&mut builder, Affine3A::IDENTITY, None)?;
        let own = self.camera;
        // The builder has its own copy of the shapes.
        drop(self);
        let bounds = builder.bounds();
        let camera = own.unwrap_or_else(|| framing_camera(bounds));
        add_default_light(&mut builder, own.as_ref(), bounds)?;
        builder.build(name, camera, Vec3::ZERO, 0.0, CREASE_ANGLE)
    }
}

/// The material of a surface without one.
pub(super) fn plain_material() -> Material {
    Material::diffuse("plain", Vec3::splat(0.7))
}

/// An emissive parallelogram.
struct Panel {
    /// A corner, and the sides `u` and `v` from there; its front is towards `u x v`.
    sides: [Vec3; 3],
    radiance: Vec3,
    both_sides: bool,
}

impl Panel {
    /// In proportion to the power that it emits.
    fn power(&self) -> f32 {
        let [_, u, v] = self.sides;
        let sides = if self.both_sides { 2.0 } else { 1.0 };
        u.cross(v).length() * self.radiance.element_sum() * sides
    }
}

/// Makes the panels of a model lights of their own, if there are many only those that give a good part of its light.
fn register(panels: Vec<Panel>, builder: &mut SceneBuilder) {
    let total: f32 = panels.iter().map(Panel::power).sum();
    let least = if panels.len() > MOST_PANELS { LEAST_SHARE * total } else { 0.0 };
    for panel in panels.iter().filter(|panel| panel.power() >= least) {
        let [corner, u, v] = panel.sides;
        builder.register_quad_light(corner, u, v, panel.radiance);
        if panel.both_sides {
            builder.register_quad_light(corner, v, u, panel.radiance);
        }
    }
}

/// Pairs of consecutive triangles that make a parallelogram, as (corner, u, v) with the front towards `u x v`. Files
/// write an emissive panel as one quad, and a quad becomes two consecutive triangles.
fn parallelograms(shape: &Shape) -> Vec<[Vec3; 3]> {
    let mut found = Vec::new();
    let mut face = 0;
    while face + 1 < shape.triangles.len() {
        let corners = |t: usize| shape.triangles[t].map(|corner| shape.positions[corner as usize]);
        match parallelogram(corners(face), corners(face + 1)) {
            Some(quad) => {
                found.push(quad);
                face += 2;
            }
            None => face += 1,
        }
    }
    found
}

fn parallelogram(first: [Vec3; 3], second: [Vec3; 3]) -> Option<[Vec3; 3]> {
    // The corner of the first that the second lacks is opposite to the shared diagonal.
    let turn = (0..3).find(|&k| !second.contains(&first[k]))?;
    let [corner, next, last] = [first[turn], first[(turn + 1) % 3], first[(turn + 2) % 3]];
    let opposite = *second.iter().find(|p| !first.contains(p))?;
    let shares_diagonal = second.contains(&next) && second.contains(&last);
    let [u, v] = [next - corner, last - corner];
    let front = |[a, b, c]: [Vec3; 3]| (b - a).cross(c - a);
    let faces_agree = front(first).dot(front(second)) > 0.0;
    let tolerance = 1e-3 * (u.length() + v.length());
    (shares_diagonal && faces_agree && (corner + u + v).distance(opposite) <= tolerance)
        .then_some([corner, u, v])
}

/// Half the diagonal of the box, or a positive value for a single point.
pub(super) fn radius_of([low, high]: [Vec3; 2]) -> f32 {
    // In f64, as the squares of small sides leave the range of f32.
    let radius = 0.5 * (high - low).as_dvec3().length() as f32;
    if radius > SMALLEST { radius } else { 1e-3 }
}

/// A camera that sees the whole box, in an image of any shape, from the front, a little from the right and above.
pub(crate) fn framing_camera(bounds: [Vec3; 2]) -> Camera {
    const FOV_Y: f32 = 40.0_f32.to_radians();
    let centre = bounds[0].midpoint(bounds[1]);
    let radius = radius_of(bounds);
    let distance = radius / (0.5 * FOV_Y).sin();
    let eye = centre + distance * Vec3::new(0.45, 0.35, 1.0).normalize();
    let camera = Camera::look_at(eye, centre, FOV_Y, 0.01 * distance, distance + 4.0 * radius);
    Camera { aspect: Some(1.0), ..camera }
}

#[cfg(test)]
mod tests {
    use glam::{Vec2, Vec4};

    use super::*;
    use crate::Map;

    #[test]
    fn of_many_lamps_those_that_give_a_good_part_of_the_light_are_lights_of_their_own() {
        let lamps = |small: usize| {
            let quad = |x: f32, size: f32| {
                let corner = x * Vec3::X;
                Shape::quad([
                    corner,
                    corner + size * Vec3::X,
                    corner + size * (Vec3::X + Vec3::Y),
                    corner + size * Vec3::Y,
                ])
            };
            let mut parts = vec![(quad(-9.0, 3.0), Some(0))];
            parts.extend((0..small).map(|lamp| (quad(lamp as f32, 0.1), Some(0))));
            let materials = vec![Material::lamp("lamp", Vec3::ONE)];
            Model { parts, materials, ..Model::default() }.into_scene("lamps").unwrap()
        };
        assert_eq!(lamps(15).lights.len(), 16);
        // 300 lamps of 0.01 give a quarter of the light, each a twelve-hundredth.
        let [Light::Quad { corner, .. }] = lamps(300).lights[..] else { panic!() };
        assert_eq!(corner.x, -6.0);
    }

    #[test]
    fn panels_are_lights_of_their_own_up_to_their_number_and_share() {
        let strip = |count: usize| {
            let mut all = Shape::default();
            for lamp in 0..count {
                let [a, b] = [2 * lamp, 2 * lamp + 1].map(|x| x as f32 * Vec3::X);
                let first = all.positions.len() as u32;
                all.positions.extend([a, b, b + Vec3::Y, a + Vec3::Y]);
                all.triangles.extend([[0, 1, 2], [0, 2, 3]].map(|corners| corners.map(|i: u32| first + i)));
            }
            all
        };
        let lights = |shapes: Vec<Shape>| {
            let parts = shapes.into_iter().map(|shape| (shape, Some(0))).collect();
            let materials = vec![Material::lamp("lamp", Vec3::ONE)];
            Model { parts, materials, ..Model::default() }.into_scene("lamps").unwrap().lights.len()
        };
        // Of one shape, at most sixteen.
        assert_eq!([16, 17].map(|count| lights(vec![strip(count)])), [16, 0]);
        // Of a model, those that give a thirty-second of the light at least.
        assert_eq!(lights(vec![strip(16); 2]), 32);
        assert_eq!(lights(vec![strip(16), strip(16), strip(1)]), 0);
    }

    #[test]
    fn the_power_of_a_panel_is_by_its_area_radiance_and_sides() {
        let of = |both_sides| {
            let sides = [Vec3::ONE, 2.0 * Vec3::X, 3.0 * Vec3::Y];
            Panel { sides, radiance: Vec3::new(1.0, 2.0, 4.0), both_sides }.power()
        };
        assert_eq!([of(false), of(true)], [42.0, 84.0]);
    }

    #[test]
    fn the_triangles_of_a_strip_make_every_other_parallelogram() {
        // Any two that follow each other make one.
        let strip = |first: u32, last: u32| {
            let at = |k: u32| Vec3::new((k / 2) as f32, (k % 2) as f32, 0.0);
            let turned = |k: u32| if k.is_multiple_of(2) { [k, k + 2, k + 1] } else { [k, k + 1, k + 2] };
            let triangles = (first..last).map(turned).collect();
            Shape { positions: (0..12).map(at).collect(), triangles, ..Shape::default() }
        };
        assert_eq!([1, 2, 3, 4, 5].map(|last| parallelograms(&strip(0, last)).len()), [0, 1, 1, 2, 2]);
        // A triangle on its own before it.
        let mut late = strip(0, 4);
        late.positions.extend([Vec3::splat(9.0), Vec3::new(9.0, 8.0, 7.0), Vec3::new(3.0, 9.0, 7.0)]);
        late.triangles.insert(0, [12, 13, 14]);
        assert_eq!(parallelograms(&late).len(), 2);
        late.triangles.truncate(3);
        assert_eq!(parallelograms(&late).len(), 1);
    }

    #[test]
    fn a_scene_becomes_a_model_with_all_that_its_corners_have() {
        let part = |shift: f32| {
            let shape = Shape::quad([Vec3::ZERO, Vec3::X, Vec3::new(1.0, 1.0, 0.0), Vec3::Y]);
            let number = |face: usize, corner: usize| shift + 0.1 * (3 * face + corner) as f32;
            let each = [0, 1].map(|face| [0, 1, 2].map(|corner| number(face, corner)));
            Shape {
                normals: each.map(|all| all.map(|n| Vec3::new(n, 0.0, 1.0).normalize())).to_vec(),
                uvs: [1.0, 2.0].map(|set| each.map(|all| all.map(|n| Vec2::new(n, set))).to_vec()),
                tangents: each
                    .map(|all| all.map(|n| Vec3::new(1.0, n, 0.0).normalize().extend(-1.0)))
                    .to_vec(),
                colors: each.map(|all| all.map(|n| Vec4::new(n, 0.5, 0.25, 0.75))).to_vec(),
                ..shape.moved(shift * Vec3::Z)
            }
        };
        let sky = Arc::new(Sky::new("", [1, 1], vec![Vec3::splat(7.0)]).unwrap());
        let camera = Camera::look_at(Vec3::X, Vec3::ZERO, 1.0, 0.1, 9.0);
        let materials = [0.25, 0.5].map(|grey| Material::diffuse("", Vec3::splat(grey))).to_vec();
        let texture = Texture { name: "a".to_owned(), size: [1, 1], texels: vec![[1, 2, 3, 4]] };
        let mut model = Model {
            parts: vec![(part(0.0), Some(0)), (part(1.0), Some(1))],
            materials,
            textures: vec![Arc::new(texture)],
            lights: vec![Light::Point { position: Vec3::ONE, intensity: Vec3::ONE }],
            camera: Some(camera),
            cameras: vec![("front".to_owned(), camera)],
            sky: Some(sky),
            ..Model::default()
        };
        model.materials[1].maps.color = Some(Map::new(0));
        let near = |found: &[Vec3], expected: &[Vec3]| {
            found.len() == expected.len() && found.iter().zip(expected).all(|(a, b)| a.distance(*b) < 1e-6)
        };
        let scene = model.into_scene("").unwrap();
        let again = Model::from_scene(&scene).into_scene("").unwrap();
        for (scene, what) in [(&scene, "the scene"), (&again, "the scene of its model")] {
            let mesh = &scene.mesh;
            for (face, shape) in [(0, part(0.0)), (2, part(1.0))] {
                let faces = face..face + 2;
                let normals: Vec<[Vec3; 3]> = mesh.corner_normals[faces.clone()].to_vec();
                assert!(near(normals.as_flattened(), shape.normals.as_flattened()), "{what}: {normals:?}");
                assert_eq!(
                    [0, 1].map(|set| mesh.corner_uvs[set][faces.clone()].to_vec()),
                    shape.uvs,
                    "{what}"
                );
                let [tangents, expected] =
                    [&mesh.corner_tangents[faces.clone()], &shape.tangents].map(|all| {
                        all.as_flattened().iter().map(|tangent| tangent.truncate()).collect::<Vec<_>>()
                    });
                assert!(near(&tangents, &expected), "{what}: {tangents:?}");
                assert!(
                    mesh.corner_tangents.as_flattened().iter().all(|tangent| tangent.w == -1.0),
                    "{what}"
                );
                assert_eq!(mesh.corner_colors[faces.clone()], shape.colors, "{what}");
                assert_eq!(mesh.material[faces], [face / 2; 2].map(|index| index as u32), "{what}");
            }
            assert_eq!(scene.sky.as_ref().map(|sky| sky.radiance(Vec3::X)), Some(Vec3::splat(7.0)), "{what}");
            assert_eq!(
                (scene.camera, &scene.cameras[..]),
                (camera, &[("front".to_owned(), camera)][..]),
                "{what}"
            );
            assert_eq!((scene.lights.len(), scene.textures[0].texels[0]), (1, [1, 2, 3, 4]), "{what}");
        }
    }

    #[test]
    fn a_quad_is_one_parallelogram_in_any_order_of_corners() {
        let quad = Shape::quad([Vec3::ZERO, 2.0 * Vec3::X, Vec3::new(2.0, 1.0, 0.0), Vec3::Y]);
        for turn in 0..3 {
            let mut shape = quad.clone();
            shape.triangles[0].rotate_left(turn);
            shape.triangles[1].rotate_right(turn);
            let found = parallelograms(&shape);
            assert_eq!(found.len(), 1);
            let [_, u, v] = found[0];
            assert_eq!(u.cross(v), 2.0 * Vec3::Z);
        }
        let trapezoid = Shape::quad([Vec3::ZERO, 2.0 * Vec3::X, Vec3::new(1.5, 1.0, 0.0), Vec3::Y]);
        assert!(parallelograms(&trapezoid).is_empty());
        // One half turned over, and a triangle that touches the other in one corner only.
        let mut turned = quad.clone();
        turned.triangles[1].reverse();
        assert!(parallelograms(&turned).is_empty());
        let [a, b, c] = [Vec3::ZERO, Vec3::X, Vec3::Y];
        assert!(parallelogram([a, b, c], [Vec3::new(1.0, 1.0, 0.0), c, Vec3::new(0.5, 0.25, 0.0)]).is_none());
        assert!(parallelogram([a, b, c], [Vec3::new(1.0, 1.0, 0.0), c, b]).is_some());
        // The fourth corner may be off by a thousandth of the two sides together.
        for (off, is_one) in [(0.0039, true), (0.0041, false)] {
            let quad = [Vec3::ZERO, 3.0 * Vec3::X, Vec3::new(3.0, 1.0, off), Vec3::Y];
            assert_eq!(parallelograms(&Shape::quad(quad)).len(), usize::from(is_one), "{off}");
        }
        // By exactly that.
        let [a, b, c] = [Vec3::ZERO, 3.0 * Vec3::X, Vec3::Y];
        assert!(parallelogram([a, b, c], [Vec3::new(3.0, 1.0, 4.0 * 1e-3), c, b]).is_some());
        // Corners on one line have no front.
        let [a, b, c, d] = [0.0, 1.0, 2.0, 3.0].map(|x| x * Vec3::X);
        assert!(parallelogram([a, b, c], [d, c, b]).is_none());
    }

    #[test]
    fn a_light_that_shines_from_both_sides_counts_twice() {
        // Of 17 panels one has a share of the power above a thirty-second only if both of its sides count.
        let panel = |x: f32, width: f32| {
            Shape::quad([
                Vec3::new(x, 0.0, 0.0),
                Vec3::new(x + width, 0.0, 0.0),
                Vec3::new(x + width, 1.0, 0.0),
                Vec3::new(x, 1.0, 0.0),
            ])
        };
        let lit = |double_sided: bool| {
            let small = Material { double_sided, ..Material::lamp("small", Vec3::ONE) };
            let mut parts: Vec<_> = (0..16).map(|lamp| (panel(4.0 * lamp as f32, 2.0), Some(0))).collect();
            parts.push((panel(-9.0, 0.75), Some(1)));
            let materials = vec![Material::lamp("large", Vec3::ONE), small];
            Model { parts, materials, ..Model::default() }.into_scene("panels").unwrap().lights.len()
        };
        assert_eq!([lit(false), lit(true)], [16, 18]);
    }

    #[test]
    fn the_default_camera_sees_the_box_and_the_default_light_shines_on_it() {
        let scene =
            Model::from_shape(Shape::cuboid(Vec3::ZERO, Vec3::new(4.0, 1.0, 2.0))).into_scene("box").unwrap();
        let camera = scene.camera;
        for (size, face) in
            [[64, 64], [90, 64], [64, 300]].into_iter().flat_map(|size| (0..12).map(move |face| (size, face)))
        {
            for corner in scene.mesh.corners(face) {
                let seen = camera.rotation.inverse() * (corner - camera.eye);
                let height = -seen.z * camera.half_height(size);
                let width = height * size[0] as f32 / size[1] as f32;
                assert!(seen.x.abs() <= width && seen.y.abs() <= height && -seen.z > camera.near);
                assert!(seen.length() < camera.far);
            }
        }
        let [Light::Quad { corner, u, v, radiance }] = scene.lights[..] else { panic!("{:?}", scene.lights) };
        let to_light = corner + 0.5 * (u + v) - Vec3::new(2.0, 0.5, 1.0);
        // From the upper left, as wide as half the box's diagonal, and turned to the box.
        assert!(to_light.x < 0.0 && to_light.y > 0.0 && to_light.z > 0.0);
        let half_diagonal = 0.5 * 21f32.sqrt();
        assert!([u, v].iter().all(|side| (side.length() - half_diagonal).abs() < 1e-5));
        assert!(u.cross(v).normalize().distance(-to_light.normalize()) < 1e-5);
        // A white surface that faces it has the radiance L A / (pi d^2).
        let white = radiance * u.cross(v).length() / (std::f32::consts::PI * to_light.length_squared());
        assert!(white.distance(Vec3::ONE) < 1e-5, "{white}");
    }

    #[test]
    fn boxes_of_any_size_fill_the_picture_alike() {
        let whole = framing_camera([Vec3::ZERO, Vec3::ONE]);
        for size in [1e-8, 5e-4, 1e8_f32] {
            let camera = framing_camera([Vec3::ZERO, Vec3::splat(size)]);
            assert!(camera.is_valid());
            assert!((camera.eye / size).distance(whole.eye) < 1e-4, "{size}: {camera:?}");
            assert!((camera.near / size / whole.near - 1.0).abs() < 1e-4);
            assert!((camera.far / size / whole.far - 1.0).abs() < 1e-4);
        }
        assert!(framing_camera([Vec3::ONE; 2]).is_valid());
        // Of a box with a radius of 3.5 around (11, 2.5, 4): 24 degrees from the right and 18 above, so far away that a
        // ball of this radius just fits into 40 degrees. Near and far leave room around it.
        let camera = framing_camera([Vec3::new(10.0, 1.0, 1.0), Vec3::new(12.0, 4.0, 7.0)]);
        let away = camera.eye - Vec3::new(11.0, 2.5, 4.0);
        let distance = 3.5 / 20_f32.to_radians().sin();
        assert!((away.length() - distance).abs() < 1e-4, "{away}");
        let angles = [away.x.atan2(away.z), (away.y / distance).asin()].map(f32::to_degrees);
        assert_eq!(angles.map(f32::round), [24.0, 18.0]);
        assert_eq!(camera.aspect, Some(1.0));
        assert!((camera.near / distance - 0.01).abs() < 1e-6, "{camera:?}");
        assert!((camera.far - distance - 14.0).abs() < 1e-4, "{camera:?}");
        // Half the diagonal, but of what counts as a point.
        assert_eq!(radius_of([Vec3::ZERO, Vec3::new(2.0, 3.0, 6.0)]), 3.5);
        assert_eq!(radius_of([Vec3::splat(7.0); 2]), 1e-3);
        assert_eq!(radius_of([Vec3::ZERO, 2e-9 * Vec3::X]), 1e-3);
        assert!(radius_of([Vec3::ZERO, 2.01e-9 * Vec3::X]) < 1e-8);
    }

    #[test]
    fn only_a_model_without_lights_and_camera_gets_them() {
        let own = Light::Point { position: Vec3::ONE, intensity: Vec3::ONE };
        let camera = Camera::look_at(Vec3::X, Vec3::ZERO, 1.0, 0.1, 9.0);
        let model = Model {
            lights: vec![own],
            camera: Some(camera),
            ..Model::from_shape(Shape::cuboid(Vec3::ZERO, Vec3::ONE))
        };
        let scene = model.into_scene("lit").unwrap();
        assert_eq!((&scene.lights[..], scene.camera, scene.mesh.triangles.len()), (&[own][..], camera, 12));
    }
}
