//! The edge list of a welded mesh.

use glam::Vec3;
use rayon::prelude::*;

use crate::mesh::{Edge, EdgeKind, NO_FACE};

/// One side of a triangle, keyed by its undirected edge.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
struct Side {
    vertices: [u32; 2],
    face: u32,
    /// True if the triangle runs from the lower to the higher vertex.
    ascending: bool,
}

/// All edges of `triangles` (distinct, welded indices), ascending by vertices and then by faces. A crease is an edge
/// whose face normals differ by more than `crease_angle` radians.
///
/// Two faces share an edge when they run along it in opposite directions. Where more than two faces meet, faces of
/// the same object pair up first, the rest in face order, and a face left over gets a border edge of its own; so
/// every side of every face belongs to exactly one edge and the silhouette test needs only its three kinds.
///
/// A face whose back is `culled` does not pair with one that has two sides: only one of them is seen from behind. Left
/// over, it is on both sides of its edge.
pub(crate) fn find_edges(
    triangles: &[[u32; 3]],
    object: &[u32],
    face_normals: &[Vec3],
    crease_angle: f32,
    culled: impl Fn(u32) -> bool + Sync,
) -> Vec<Edge> {
    // The length is known, so that the list is written where it stays.
    let side = |index: usize| {
        let (face, corner) = (index / 3, index % 3);
        let [from, to] = [triangles[face][corner], triangles[face][(corner + 1) % 3]];
        Side { vertices: [from.min(to), from.max(to)], face: face as u32, ascending: from < to }
    };
    let mut sides: Vec<Side> = (0..3 * triangles.len()).into_par_iter().map(side).collect();
    sides.par_sort_unstable();

    let crease_cos = crease_angle.cos();
    let kind_of = |[first, second]: [u32; 2]| {
        if second == NO_FACE {
            EdgeKind::Border
        } else if first == second
            || face_normals[first as usize].dot(face_normals[second as usize]) < crease_cos
        {
            EdgeKind::Crease
        } else {
            EdgeKind::Regular
        }
    };
    let mut edges = Vec::with_capacity(sides.len() / 2);
    for group in sides.chunk_by(|a, b| a.vertices == b.vertices) {
        let mut pairs = pair_faces(group, object, &culled);
        pairs.sort_unstable();
        edges.extend(pairs.into_iter().map(|faces| Edge {
            vertices: group[0].vertices,
            faces,
            kind: kind_of(faces),
        }));
    }
    edges
}

/// Splits the sides on one edge into pairs of opposite direction and single ones.
fn pair_faces(group: &[Side], object: &[u32], culled: impl Fn(u32) -> bool) -> Vec<[u32; 2]> {
    let mut single = group.to_vec();
    let mut pairs = Vec::with_capacity(1);
    for same_object_only in [true, false] {
        let mut i = 0;
        while i < single.len() {
            let side = single[i];
            let partner = (i + 1..single.len()).find(|&j| {
                let other = single[j];
                other.ascending != side.ascending
                    && culled(other.face) == culled(side.face)
                    && (!same_object_only || object[other.face as usize] == object[side.face as usize])
            });
            match partner {
                Some(j) => {
                    pairs.push([side.face, single[j].face]);
                    single.remove(j);
                    single.remove(i);
                }
                None => i += 1,
            }
        }
    }
    pairs.extend(single.iter().map(|side| [side.face, if culled(side.face) { side.face } else { NO_FACE }]));
    pairs
}

#[cfg(test)]
mod tests {
    use super::*;

    fn kinds(edges: &[Edge], kind: EdgeKind) -> usize {
        edges.iter().filter(|e| e.kind == kind).count()
    }

    #[test]
    fn three_faces_on_one_edge_give_a_pair_and_a_border() {
        // Faces 0 and 1 run up the edge 0-1, face 2 runs down: the first of the two gets the partner.
        let triangles = [[0, 1, 2], [0, 1, 3], [1, 0, 4]];
        let edges = find_edges(&triangles, &[0; 3], &[Vec3::Z; 3], 0.7, |_| false);
        let shared: Vec<_> = edges.iter().filter(|e| e.vertices == [0, 1]).map(|e| e.faces).collect();
        assert_eq!(shared, [[0, 2], [1, NO_FACE]]);
        assert_eq!((edges.len(), kinds(&edges, EdgeKind::Border)), (8, 7));
    }

    #[test]
    fn objects_that_touch_keep_their_own_pairs() {
        let triangles = [[0, 1, 2], [0, 1, 3], [1, 0, 4], [1, 0, 5]];
        let edges = find_edges(&triangles, &[0, 1, 1, 0], &[Vec3::Z; 4], 0.7, |_| false);
        let shared: Vec<_> = edges.iter().filter(|e| e.vertices == [0, 1]).map(|e| e.faces).collect();
        assert_eq!(shared, [[0, 3], [1, 2]]);
    }

    #[test]
    fn pairs_of_an_edge_are_in_the_order_of_their_faces() {
        // The faces on the edge 0-1 by their directions and objects, in the order of their numbers.
        let pairs = |sides: &[(bool, u32)]| {
            let third = (2..).zip(sides);
            let triangles: Vec<[u32; 3]> =
                third.map(|(third, (up, _))| if *up { [0, 1, third] } else { [1, 0, third] }).collect();
            let objects: Vec<u32> = sides.iter().map(|(_, object)| *object).collect();
            let edges = find_edges(&triangles, &objects, &vec![Vec3::Z; sides.len()], 0.7, |_| false);
            edges.iter().filter(|e| e.vertices == [0, 1]).map(|e| e.faces).collect::<Vec<_>>()
        };
        assert_eq!(pairs(&[(true, 0), (false, 1), (true, 2), (false, 2)]), [[0, 1], [2, 3]]);
        assert_eq!(pairs(&[(true, 0), (true, 1), (false, 1)]), [[0, NO_FACE], [1, 2]]);
    }

    #[test]
    fn faces_at_the_crease_angle_itself_meet_smoothly() {
        let kind = |angle: f32, normals: [Vec3; 2]| {
            let edges = find_edges(&[[0, 1, 2], [1, 0, 3]], &[0; 2], &normals, angle, |_| false);
            edges.iter().find(|edge| edge.faces == [0, 1]).unwrap().kind
        };
        assert_eq!(kind(0.0, [Vec3::Z; 2]), EdgeKind::Regular);
        assert_eq!(kind(0.0, [Vec3::Z, Vec3::new(0.01, 0.0, 1.0).normalize()]), EdgeKind::Crease);
    }

    #[test]
    fn faces_of_opposite_winding_do_not_pair() {
        let edges = find_edges(&[[0, 1, 2], [0, 1, 3]], &[0, 0], &[Vec3::Z, Vec3::NEG_Z], 0.7, |_| false);
        assert_eq!(kinds(&edges, EdgeKind::Border), 6);
    }

    #[test]
    fn faces_without_a_back_pair_among_themselves_and_end_in_creases() {
        let triangles = [[0, 1, 2], [1, 0, 3]];
        let find = |culled: [bool; 2]| {
            find_edges(&triangles, &[0; 2], &[Vec3::Z; 2], 0.7, |face| culled[face as usize])
        };
        let both = find([true; 2]);
        assert_eq!((kinds(&both, EdgeKind::Regular), kinds(&both, EdgeKind::Crease)), (1, 4));
        assert!(both.iter().all(|edge| edge.faces[1] != NO_FACE));
        let one = find([true, false]);
        assert_eq!((kinds(&one, EdgeKind::Crease), kinds(&one, EdgeKind::Border)), (3, 3));
        let of_first = one.iter().filter(|edge| edge.faces == [0, 0]);
        assert!(of_first.clone().all(|edge| edge.kind == EdgeKind::Crease) && of_first.count() == 3);
    }
}
