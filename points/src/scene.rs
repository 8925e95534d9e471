//! The vertices or the points of a scene.

use epigraph_scenes::Scene;
use epigraph_streams::{Node, Place, PointSet, Points, color_of_light, unpack_color, unpack_normal};
use glam::Vec3;

/// The vertices at rest, but for those of an added light. Normals are means over the triangles around a vertex by their areas, colours those of the first
/// triangle at this corner. Of a scene that is a point set, the points in most detail.
pub(crate) fn points(scene: &Scene) -> Points {
    if let Some(set) = &scene.points {
        return decoded(set);
    }
    let mesh = &scene.mesh;
    let mut normals = vec![Vec3::ZERO; mesh.positions.len()];
    let mut colors = vec![None; mesh.positions.len()];
    for (face, vertices) in mesh.triangles.iter().enumerate().filter(|(face, _)| !scene.added.contains(face))
    {
        let [a, b, c] = mesh.corners(face);
        let area = (b - a).cross(c - a).length();
        for (corner, &vertex) in vertices.iter().enumerate() {
            let normal = mesh.corner_normals.get(face).map_or(mesh.face_normals[face], |all| all[corner]);
            normals[vertex as usize] += area * normal;
            colors[vertex as usize].get_or_insert_with(|| {
                let [red, green, blue] = color_of_light(scene.look(face, Vec3::AXES[corner]).color.into());
                [red, green, blue, 255]
            });
        }
    }
    let mut is_added = vec![false; mesh.positions.len()];
    for &vertex in mesh.triangles[scene.added.clone()].iter().flatten() {
        is_added[vertex as usize] = colors[vertex as usize].is_none();
    }
    let own = || (0..mesh.positions.len()).filter(|&vertex| !is_added[vertex]);
    Points {
        origin: scene.origin,
        colors: Some(own().map(|vertex| colors[vertex].unwrap_or([255; 4])).collect()),
        normals: Some(own().map(|vertex| normals[vertex]).collect()),
        ..Points::from(own().map(|vertex| mesh.positions[vertex]).collect::<Vec<_>>())
    }
}

/// The points in most detail, at all their places.
fn decoded(set: &PointSet) -> Points {
    let leaves = || {
        set.places()
            .iter()
            .flat_map(|place| set.models()[place.model].leaves().map(move |leaf| (place, leaf)))
    };
    let words = |values: fn(&Node) -> Option<&[u32]>| {
        let of = |(place, leaf): (&Place, &Node)| values(leaf).map(|words| (*place, words.to_vec()));
        leaves().map(of).collect::<Option<Vec<_>>>()
    };
    let colors = words(Node::colors)
        .map(|all| all.into_iter().flat_map(|(_, words)| words).map(unpack_color).collect());
    let turned = |(place, words): (Place, Vec<u32>)| {
        words.into_iter().map(move |word| place.rotation * unpack_normal(word))
    };
    let normals = words(Node::normals).map(|all| all.into_iter().flat_map(turned).collect());
    let positions = leaves().flat_map(|(place, leaf)| leaf.positions().into_iter().map(|at| place.apply(at)));
    Points { origin: set.origin(), positions: positions.collect(), colors, normals }
}
