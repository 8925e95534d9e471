//! The vertices or the points of a scene.

use epigraph_scenes::Scene;
use epigraph_streams::{Model, Node, Points, color_of_light, unpack_color, unpack_normal};
use glam::Vec3;

/// The vertices at rest. Normals are means over the triangles around a vertex by their areas, colours those of the first
/// triangle's material. Of a scene that is a point set, the points in most detail.
pub(crate) fn points(scene: &Scene) -> Points {
    if let Some(model) = &scene.points {
        return decoded(model);
    }
    let mesh = &scene.mesh;
    let mut normals = vec![Vec3::ZERO; mesh.positions.len()];
    let mut colors = vec![None; mesh.positions.len()];
    for (face, vertices) in mesh.triangles.iter().enumerate() {
        let [a, b, c] = mesh.corners(face);
        let area = (b - a).cross(c - a).length();
        let material = &scene.materials[mesh.material[face] as usize];
        let [red, green, blue] = color_of_light(material.color.into());
        for (corner, &vertex) in vertices.iter().enumerate() {
            let normal = mesh.corner_normals.get(face).map_or(mesh.face_normals[face], |all| all[corner]);
            normals[vertex as usize] += area * normal;
            colors[vertex as usize].get_or_insert([red, green, blue, 255]);
        }
    }
    let colors = colors.into_iter().map(|color| color.unwrap_or([255; 4])).collect();
    Points { colors: Some(colors), normals: Some(normals), ..Points::from(mesh.positions.clone()) }
}

fn decoded(model: &Model) -> Points {
    let leaves: Vec<&Node> = model.leaves().collect();
    let all = |values: fn(&Node) -> Option<&[u32]>| {
        leaves.iter().map(|leaf| values(leaf)).collect::<Option<Vec<_>>>().map(|leaves| leaves.concat())
    };
    Points {
        origin: model.origin(),
        positions: leaves.iter().flat_map(|leaf| leaf.positions()).collect(),
        colors: all(Node::colors).map(|words| words.into_iter().map(unpack_color).collect()),
        normals: all(Node::normals).map(|words| words.into_iter().map(unpack_normal).collect()),
    }
}
