use crate::shadow::expected_segments;
use crate::{EdgeKind, Light, Scene};

/// The facts about a scene that allow a graph to skip work (see ARCHITECTURE.md).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct SceneFacts {
    /// True if there can be shadows: there are lights, and surfaces that do not emit.
    pub shadow_casters: bool,
    /// Roughly the number of boundaries of shadows; 0 without casters. Up to twice as many were found.
    pub shadow_segments: usize,
    /// Number of point and spot lights.
    pub point_lights: usize,
    /// Number of quad area lights.
    pub quad_lights: usize,
    /// Number of edges between two faces that meet smoothly.
    pub regular_edges: usize,
    /// Number of edges at more than the crease angle.
    pub crease_edges: usize,
    /// Number of edges with one face only.
    pub border_edges: usize,
    /// Number of triangles.
    pub faces: usize,
    /// Number of triangles that emit light, those of quad lights too.
    pub emitters: usize,
    /// Number of textures.
    pub textures: usize,
    /// Number of materials.
    pub materials: usize,
    /// True if a material may look different from point to point: it has maps, or the mesh has colours.
    pub looks_vary: bool,
    /// True if rays may pass through surfaces: holes, blending, glass.
    pub transparent: bool,
    /// Number of bodies that move.
    pub bodies: usize,
    /// True if a light moves.
    pub lights_move: bool,
}

impl SceneFacts {
    /// Counts the facts of `scene`.
    pub fn of(scene: &Scene) -> Self {
        let edges = |kind| scene.mesh.edges.iter().filter(|edge| edge.kind == kind).count();
        let point_lights = scene.lights.iter().filter(|light| !matches!(light, Light::Quad { .. })).count();
        let emits = |&&material: &&u32| scene.materials[material as usize].emits();
        let emitters = scene.mesh.material.iter().filter(emits).count();
        let faces = scene.mesh.triangles.len();
        let is_transparent = |&material: &u32| scene.materials[material as usize].is_transparent();
        let shadow_casters = !scene.lights.is_empty() && emitters < faces;
        Self {
            shadow_casters,
            shadow_segments: if shadow_casters { expected_segments(scene) } else { 0 },
            point_lights,
            quad_lights: scene.lights.len() - point_lights,
            regular_edges: edges(EdgeKind::Regular),
            crease_edges: edges(EdgeKind::Crease),
            border_edges: edges(EdgeKind::Border),
            faces,
            emitters,
            textures: scene.textures.len(),
            materials: scene.materials.len(),
            looks_vary: !scene.mesh.corner_colors.is_empty()
                || scene.materials.iter().any(|material| !material.maps.is_empty()),
            transparent: scene.mesh.material.iter().any(is_transparent),
            bodies: scene.bodies.iter().filter(|body| body.motion.moves()).count(),
            lights_move: scene.bodies.iter().any(|body| !body.lights.is_empty() && body.motion.moves()),
        }
    }
}

#[cfg(test)]
mod tests {
    use glam::Vec3;

    use super::*;
    use crate::{Camera, Material, Motion, MotionKey, SceneBuilder, Shape};

    #[test]
    fn facts_of_the_cornell_box() {
        let facts = SceneFacts::of(&Scene::load("cornell").unwrap());
        assert!(facts.shadow_casters);
        assert_eq!((facts.point_lights, facts.quad_lights, facts.faces), (0, 1, 36));
        assert_eq!(facts.regular_edges + facts.crease_edges + facts.border_edges, 58);
        assert_eq!(facts.border_edges, 8);
        assert!(facts.bodies == 0 && !facts.lights_move);
    }

    #[test]
    fn lights_are_counted_by_kind_and_shadows_need_both_light_and_surface() {
        let facts = |surface: bool, points: usize, quads: usize| {
            let mut builder = SceneBuilder::new();
            let lamp = builder.material(Material::lamp("", Vec3::ONE));
            let white = builder.material(Material::diffuse("", Vec3::ONE));
            builder.add(&Shape::cuboid(Vec3::ZERO, Vec3::ONE), if surface { white } else { lamp }).unwrap();
            (0..points).for_each(|_| builder.point_light(2.0 * Vec3::Y, Vec3::ONE));
            (0..quads).for_each(|_| builder.quad_light(3.0 * Vec3::Y, Vec3::X, Vec3::Z, Vec3::ONE).unwrap());
            let camera = Camera::look_at(Vec3::Z, Vec3::ZERO, 1.0, 0.1, 10.0);
            SceneFacts::of(&builder.build("", camera, Vec3::ZERO, 0.0, 40.0).unwrap())
        };
        for (surface, points, quads, shadows) in [
            (true, 0, 0, false),
            (true, 1, 0, true),
            (true, 0, 1, true),
            (true, 3, 2, true),
            (false, 3, 2, false),
            (false, 0, 0, false),
        ] {
            let facts = facts(surface, points, quads);
            assert_eq!((facts.point_lights, facts.quad_lights), (points, quads));
            assert_eq!(facts.shadow_casters, shadows, "{surface}, {points}, {quads}");
            assert_eq!((facts.crease_edges, facts.faces), (12, 12 + 2 * quads));
            assert_eq!((facts.regular_edges, facts.border_edges), (6 + quads, 4 * quads));
        }
    }

    #[test]
    fn facts_of_materials() {
        let of = |name: &str| {
            let facts = SceneFacts::of(&Scene::load(name).unwrap());
            (facts.emitters, facts.textures, facts.transparent)
        };
        assert_eq!(of("cornell"), (2, 0, false));
        assert_eq!(of("chains"), (0, 0, false));
        // A quad light and a bulb of 32 x 16 facets, of which those at the poles are triangles.
        assert_eq!(of("still-life"), (2 + 2 * 32 * 15, 4, true));
    }

    #[test]
    fn boundaries_are_expected_where_there_are_casters() {
        let scene = Scene::load("cornell").unwrap();
        assert_eq!(SceneFacts::of(&scene).shadow_segments, expected_segments(&scene));
        assert!(expected_segments(&scene) > 0);
        // Without a surface that does not emit, there are edges and a light, but no shadows.
        let lamp = vec![Material::lamp("", Vec3::ONE); scene.materials.len()];
        assert_eq!(SceneFacts::of(&Scene { materials: lamp, ..scene }).shadow_segments, 0);
    }

    #[test]
    fn maps_and_colours_of_corners_make_looks_vary() {
        let plain = Scene::load("cornell").unwrap();
        assert!(!SceneFacts::of(&plain).looks_vary);
        let mut colored = plain.clone();
        colored.mesh.corner_colors = vec![[glam::Vec4::ONE; 3]; 36].into();
        assert!(SceneFacts::of(&colored).looks_vary);
        let mut mapped = plain.clone();
        mapped.materials[1].maps.color = Some(crate::Map::new(0));
        assert!(SceneFacts::of(&mapped).looks_vary);
    }

    #[test]
    fn facts_of_motion() {
        let facts = SceneFacts::of(&Scene::load("cornell-moving").unwrap());
        assert!(facts.bodies == 4 && facts.lights_move);
        let rest = MotionKey { time: 0.0, translate: Vec3::ZERO, rotate: glam::Quat::IDENTITY };
        let moved = MotionKey { time: 1.0, translate: Vec3::X, ..rest };
        let of = |surface: &[MotionKey], light: &[MotionKey]| {
            let motion = |keys: &[MotionKey]| Motion { pivot: Vec3::ZERO, keys: keys.into(), looped: false };
            let mut builder = SceneBuilder::new();
            let white = builder.material(Material::diffuse("", Vec3::ONE));
            let cube = Shape::cuboid(Vec3::ZERO, Vec3::ONE);
            builder.moving(motion(surface), |builder| builder.add(&cube, white)).unwrap();
            let lamp =
                |builder: &mut SceneBuilder| builder.quad_light(3.0 * Vec3::Y, Vec3::X, Vec3::Z, Vec3::ONE);
            builder.moving(motion(light), lamp).unwrap();
            let camera = Camera::look_at(Vec3::Z, Vec3::ZERO, 1.0, 0.1, 10.0);
            let facts = SceneFacts::of(&builder.build("", camera, Vec3::ZERO, 0.0, 40.0).unwrap());
            (facts.bodies, facts.lights_move)
        };
        assert_eq!(of(&[rest], &[rest]), (0, false));
        assert_eq!(of(&[rest, moved], &[rest]), (1, false));
        assert_eq!(of(&[rest], &[rest, moved]), (1, true));
    }
}
