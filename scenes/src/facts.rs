use crate::{EdgeKind, Light, Scene};

/// The facts about a scene that allow a graph to skip work (see ARCHITECTURE.md).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct SceneFacts {
    /// True if there can be shadows: there are lights, and surfaces that do not emit.
    pub shadow_casters: bool,
    /// Number of point lights.
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
    /// Number of bodies that move.
    pub bodies: usize,
    /// True if a light moves.
    pub lights_move: bool,
}

impl SceneFacts {
    /// Counts the facts of `scene`.
    pub fn of(scene: &Scene) -> Self {
        let edges = |kind| scene.mesh.edges.iter().filter(|edge| edge.kind == kind).count();
        let point_lights = scene.lights.iter().filter(|light| matches!(light, Light::Point { .. })).count();
        let passive = |&material: &u32| scene.materials[material as usize].emission == glam::Vec3::ZERO;
        Self {
            shadow_casters: !scene.lights.is_empty() && scene.mesh.material.iter().any(passive),
            point_lights,
            quad_lights: scene.lights.len() - point_lights,
            regular_edges: edges(EdgeKind::Regular),
            crease_edges: edges(EdgeKind::Crease),
            border_edges: edges(EdgeKind::Border),
            faces: scene.mesh.triangles.len(),
            bodies: scene.bodies.iter().filter(|body| body.motion.moves()).count(),
            lights_move: scene.bodies.iter().any(|body| !body.lights.is_empty() && body.motion.moves()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

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
    fn facts_of_motion() {
        let facts = SceneFacts::of(&Scene::load("cornell-moving").unwrap());
        assert!(facts.bodies == 4 && facts.lights_move);
    }
}
