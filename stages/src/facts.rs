//! What a scene states about itself: the lengths of lists, and reasons to skip stages.

use epigraph_core::{Fact, Facts, Quantity};
use epigraph_scenes::{Scene, SceneFacts, streams::Node};

use crate::shared::streams::{block_words, pool_count};

/// Maximum number of lights and of bodies that age points. The stage `carry` compares each light with each body for each
/// point, so its time grows with the product of both; with 16 of each a point takes 256 comparisons.
const MOST_COMPARED: usize = 16;

/// Vertices of the mesh.
pub const VERTICES: Quantity = Quantity { name: "vertices", one: "vertex" };
/// Edges of the mesh, of all kinds.
pub const EDGES: Quantity = Quantity { name: "edges", one: "edge" };
/// Triangles of the mesh.
pub const FACES: Quantity = Quantity { name: "faces", one: "face" };
/// Triangles that emit light.
pub const EMITTERS: Quantity = Quantity { name: "emitters", one: "emissive triangle" };
/// Textures of the materials.
pub const TEXTURES: Quantity = Quantity { name: "textures", one: "texture" };
/// Materials.
pub const MATERIALS: Quantity = Quantity { name: "materials", one: "material" };
/// Bodies that move.
pub const BODIES: Quantity = Quantity { name: "bodies", one: "moving body" };
/// Bodies with a motion, whether or not it takes them anywhere, and one more: everything static.
pub const MOVES: Quantity = Quantity { name: "moves", one: "body" };
/// Lights whose changes age the points that they light: all, or the first 16.
pub const LIGHTS: Quantity = Quantity { name: "lights", one: "light that ages points" };
/// Bodies whose boxes age the points that they may shade: all, or the first 16.
pub const BLOCKERS: Quantity = Quantity { name: "blockers", one: "body that shades points" };
/// Boundaries of shadows that there is room for: twice the number expected, and some; see [`SceneFacts::shadow_segments`].
pub const SHADOW_SEGMENTS: Quantity = Quantity { name: "shadow_segments", one: "shadow boundary" };
/// Nodes of the point set, at all their places.
pub const STREAM_NODES: Quantity = Quantity { name: "stream_nodes", one: "node of the point set" };
/// Pools of all nodes, at all their places; the points of a node that no pool contains count as a pool.
pub const STREAM_POOLS: Quantity = Quantity { name: "stream_pools", one: "pool of the point set" };
/// Words of the blocks of all nodes.
pub const STREAM_WORDS: Quantity = Quantity { name: "stream_words", one: "word of the point set" };
/// The camera's path moves.
pub const CAMERA_MOVES: Fact = Fact { name: "camera_moves" };
/// Some light casts shadows.
pub const SHADOW_CASTERS: Fact = Fact { name: "shadow_casters" };
/// A material may look different from point to point: textures, colours of the mesh.
pub const LOOKS_VARY: Fact = Fact { name: "looks_vary" };
/// Rays may pass through surfaces: holes, blending, glass.
pub const TRANSPARENT: Fact = Fact { name: "transparent" };

/// Room for boundaries of shadows in the smallest scenes.
const SPARE_SEGMENTS: usize = 256;

/// Maximum room for boundaries of shadows, 8 MiB; a node's `capacity` may ask for more. Each of them is drawn in each frame,
/// and a picture of a million pixels can hardly show more.
const MOST_SEGMENTS: usize = 1 << 18;

/// The facts of a scene; `path_moves` is [`CameraPath::moves`](epigraph_scenes::CameraPath::moves).
pub(crate) fn of(scene: &Scene, path_moves: bool) -> Facts {
    let facts = SceneFacts::of(scene);
    let points = scene.points.as_deref();
    let placed = |number: fn(&Node) -> usize| points.map_or(0, |points| points.placed(number));
    let words = points.map_or(0, |points| points.nodes().map(block_words).sum());
    // Meshes have 32-bit indices, so the counts fit.
    let counts = [
        (VERTICES, scene.mesh.positions.len()),
        (EDGES, facts.regular_edges + facts.crease_edges + facts.border_edges),
        (FACES, facts.faces),
        (EMITTERS, facts.emitters),
        (TEXTURES, facts.textures),
        (MATERIALS, facts.materials),
        (BODIES, facts.bodies),
        (MOVES, scene.bodies.len() + 1),
        (LIGHTS, scene.lights.len().min(MOST_COMPARED)),
        (BLOCKERS, scene.bodies.len().min(MOST_COMPARED)),
        (SHADOW_SEGMENTS, (2 * facts.shadow_segments + SPARE_SEGMENTS).min(MOST_SEGMENTS)),
        (STREAM_NODES, placed(|_| 1)),
        (STREAM_POOLS, placed(pool_count)),
        (STREAM_WORDS, words),
    ];
    let stated = Facts::none()
        .stating(CAMERA_MOVES, path_moves)
        .stating(SHADOW_CASTERS, facts.shadow_casters)
        .stating(LOOKS_VARY, facts.looks_vary)
        .stating(TRANSPARENT, facts.transparent);
    counts.into_iter().fold(stated, |stated, (quantity, count)| stated.with(quantity, count as u32))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_ages_points_is_limited() {
        let mut scene = Scene::load("cornell-moving").unwrap();
        let counts =
            |scene: &Scene| [MOVES, LIGHTS, BLOCKERS].map(|quantity| of(scene, false).count(quantity));
        assert_eq!(counts(&scene), [Some(5), Some(1), Some(4)]);
        scene.lights = vec![scene.lights[0]; 40];
        assert_eq!(counts(&scene), [Some(5), Some(16), Some(4)]);
    }

    #[test]
    fn a_graph_knows_of_textures_emitters_and_transparency() {
        for (name, emitters, materials, textures, transparent) in
            [("cornell", 2, 4, 0, false), ("chains", 0, 5, 0, false), ("still-life", 962, 8, 4, true)]
        {
            let facts = of(&Scene::load(name).unwrap(), false);
            assert_eq!((facts.count(EMITTERS), facts.count(TEXTURES)), (Some(emitters), Some(textures)));
            assert_eq!(facts.count(MATERIALS), Some(materials), "{name}");
            assert_eq!(facts.holds(LOOKS_VARY), Some(textures > 0), "{name}");
            assert_eq!(facts.holds(TRANSPARENT), Some(transparent), "{name}");
        }
    }
}
