//! The connected parts of a surface.

use glam::Vec3;
use rayon::prelude::*;

use super::Surface;

/// A surface's triangles by parts.
pub(super) struct Split {
    /// For each vertex of the surface, the first one at the same position.
    pub(super) welded: Vec<u32>,
    /// The triangles of each part, in ascending order. Parts are in the order of their first triangles.
    pub(super) parts: Vec<Vec<u32>>,
    /// The number of triangles without three different corners, which belong to no part.
    pub(super) degenerate: usize,
}

impl Split {
    /// Triangles of one material are in one part if they share an edge, or lead to each other by such triangles.
    ///
    /// They share an edge if no third triangle has an edge between the same positions. Where there are more, as
    /// between bricks of a wall, only those that name the same vertices do. A triangle that occurs several times
    /// belongs to as many parts, which lie in the same place.
    pub(super) fn new(surface: &Surface) -> Self {
        let welded = weld(surface.positions);
        let corners: Vec<[u32; 3]> = surface
            .triangles
            .par_iter()
            .map(|corners| corners.map(|vertex| welded[vertex as usize]))
            .collect();
        let (kept, degenerate): (Vec<u32>, Vec<u32>) =
            (0..corners.len() as u32).partition(|&triangle| is_proper(corners[triangle as usize]));
        let layers = layers(&corners, &kept);
        let mut sets = Sets((0..corners.len() as u32).collect());

        let material = |triangle: u32| surface.materials.map(|materials| materials[triangle as usize]);
        let mut sides: Vec<Side> =
            kept.par_iter().flat_map_iter(|&triangle| Side::all(&corners, triangle)).collect();
        let sheet = |side: &Side| (side.ends, layers[side.triangle() as usize], material(side.triangle()));
        sides.par_sort_unstable_by_key(|side| (sheet(side), side.half));
        for edge in sides.chunk_by(|a, b| sheet(a) == sheet(b)) {
            if let [a, b] = edge {
                sets.join(a.triangle(), b.triangle());
            } else {
                let mut named: Vec<_> =
                    edge.iter().map(|side| (side.named(surface.triangles), side.triangle())).collect();
                named.sort_unstable();
                for pair in named.windows(2).filter(|pair| pair[0].0 == pair[1].0) {
                    sets.join(pair[0].1, pair[1].1);
                }
            }
        }

        // Roots are the lowest of their sets.
        let mut by_part: Vec<(u32, u32)> =
            kept.iter().map(|&triangle| (sets.root(triangle), triangle)).collect();
        by_part.par_sort_unstable();
        let part = |part: &[(u32, u32)]| part.iter().map(|&(_, triangle)| triangle).collect();
        let parts = by_part.chunk_by(|a, b| a.0 == b.0).map(part).collect();
        Self { welded, parts, degenerate: degenerate.len() }
    }
}

fn is_proper([a, b, c]: [u32; 3]) -> bool {
    a != b && b != c && c != a
}

/// The first vertex at the position of each.
fn weld(positions: &[Vec3]) -> Vec<u32> {
    // Adding 0 turns -0 into +0, so that equal numbers have equal bits.
    let bits = |vertex: u32| (positions[vertex as usize] + 0.0).to_array().map(f32::to_bits);
    let mut order: Vec<u32> = (0..positions.len() as u32).collect();
    order.par_sort_unstable_by_key(|&vertex| (bits(vertex), vertex));
    let mut first = vec![0; positions.len()];
    for equal in order.chunk_by(|&a, &b| bits(a) == bits(b)) {
        equal.iter().for_each(|&vertex| first[vertex as usize] = equal[0]);
    }
    first
}

/// How often each triangle has occurred before, in either winding.
fn layers(corners: &[[u32; 3]], kept: &[u32]) -> Vec<u32> {
    let sorted = |triangle: u32| {
        let mut corners = corners[triangle as usize];
        corners.sort_unstable();
        corners
    };
    let mut order: Vec<([u32; 3], u32)> =
        kept.par_iter().map(|&triangle| (sorted(triangle), triangle)).collect();
    order.par_sort_unstable();
    let mut layers = vec![0; corners.len()];
    for equal in order.chunk_by(|a, b| a.0 == b.0) {
        (0..).zip(equal).for_each(|(layer, &(_, triangle))| layers[triangle as usize] = layer);
    }
    layers
}

/// A side of a triangle.
struct Side {
    /// The welded vertices, the lower first.
    ends: [u32; 2],
    /// Three times the triangle's index, plus the corner where the side begins.
    half: u32,
}

impl Side {
    fn all(corners: &[[u32; 3]], triangle: u32) -> impl Iterator<Item = Self> {
        let corners = corners[triangle as usize];
        (0..3).map(move |k| {
            let (a, b) = (corners[k], corners[(k + 1) % 3]);
            Self { ends: [a.min(b), a.max(b)], half: 3 * triangle + k as u32 }
        })
    }

    fn triangle(&self) -> u32 {
        self.half / 3
    }

    /// The vertices that the surface names, the lower first.
    fn named(&self, triangles: &[[u32; 3]]) -> [u32; 2] {
        let corners = triangles[self.triangle() as usize];
        let begin = (self.half % 3) as usize;
        let (a, b) = (corners[begin], corners[(begin + 1) % 3]);
        [a.min(b), a.max(b)]
    }
}

/// Disjoint sets of triangles, as trees: each triangle has its parent.
struct Sets(Vec<u32>);

impl Sets {
    /// The lowest triangle of a set.
    fn root(&mut self, mut triangle: u32) -> u32 {
        loop {
            let parent = self.0[triangle as usize];
            if parent == triangle {
                return triangle;
            }
            // Halves the way for those who come later.
            let next = self.0[parent as usize];
            self.0[triangle as usize] = next;
            triangle = next;
        }
    }

    fn join(&mut self, a: u32, b: u32) {
        let (a, b) = (self.root(a), self.root(b));
        self.0[a.max(b) as usize] = a.min(b);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::repeats::testing::{Solid, cuboid};

    fn split(solids: &[Solid]) -> (Vec<usize>, usize) {
        let solid = Solid::all(solids);
        let split = Split::new(&solid.surface());
        (split.parts.iter().map(Vec::len).collect(), split.degenerate)
    }

    #[test]
    fn parts_end_where_no_edge_is_shared() {
        let cube = cuboid(Vec3::ONE);
        let beside = |x: f32| cube.moved(Vec3::new(x, 0.0, 0.0));
        assert_eq!(split(&[cube.clone(), beside(3.0), beside(6.0)]), (vec![12; 3], 0));
        // Bricks of a wall have sides at the same place, with their own vertices.
        assert_eq!(split(&[cube.clone(), beside(1.0), beside(2.0)]), (vec![12; 3], 0));
        // Equal parts at the same place.
        assert_eq!(split(&[cube.clone(), cube.clone(), cube.clone()]), (vec![12; 3], 0));
        // Triangles that share no vertices are joined by their positions.
        assert_eq!(split(&[cube.soup(), beside(3.0).soup()]), (vec![12; 2], 0));
        // Both sides of a sheet are two layers.
        let sheet = Solid {
            positions: cube.positions.clone(),
            triangles: cube.triangles[..2].to_vec(),
            ..Solid::default()
        };
        let mut back = sheet.soup();
        back.triangles.iter_mut().for_each(|corners| corners.swap(0, 1));
        assert_eq!(split(&[sheet, back]), (vec![2; 2], 0));
    }

    #[test]
    fn sheets_that_name_the_vertices_of_their_common_edge_are_one_part() {
        // Three triangles around an edge.
        let positions =
            [[0.0, 0.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0]];
        let fan = Solid {
            positions: positions.map(Vec3::from).to_vec(),
            triangles: vec![[0, 1, 2], [0, 1, 3], [0, 1, 4]],
            ..Solid::default()
        };
        assert_eq!(split(std::slice::from_ref(&fan)), (vec![3], 0));
        assert_eq!(split(&[fan.soup()]), (vec![1; 3], 0));
    }

    #[test]
    fn materials_divide_parts_and_degenerate_triangles_belong_to_none() {
        let mut cube = cuboid(Vec3::ONE);
        cube.materials = Some((0..12).map(|triangle| u32::from(triangle >= 2)).collect());
        assert_eq!(split(&[cube]), (vec![2, 10], 0));
        let mut cube = cuboid(Vec3::ONE).soup();
        // Three corners, of which two are at the same position.
        cube.triangles.push([0, 1, cube.positions.len() as u32]);
        cube.positions.push(cube.positions[0]);
        assert_eq!(split(&[cube]), (vec![12], 1));
    }
}
