//! Welding: vertices at the same position get the same index.

use std::collections::HashMap;

use glam::Vec3;

/// Maps every position to its welded index and returns the welded positions, in order of first appearance.
/// Positions at most `epsilon` apart are replaced by the first of them; 0 welds only equal ones (0 equals -0).
pub(crate) fn weld(positions: &[Vec3], epsilon: f32) -> (Vec<u32>, Vec<Vec3>) {
    weld_bodies(positions, &vec![0; positions.len()], epsilon)
}

/// The same, but keeps apart the positions of different bodies.
pub(crate) fn weld_bodies(positions: &[Vec3], body: &[u32], epsilon: f32) -> (Vec<u32>, Vec<Vec3>) {
    if epsilon > 0.0 { weld_near(positions, body, epsilon) } else { weld_equal(positions, body) }
}

fn weld_equal(positions: &[Vec3], body: &[u32]) -> (Vec<u32>, Vec<Vec3>) {
    let mut index_of = HashMap::with_capacity(positions.len());
    let mut welded = Vec::new();
    let map = positions
        .iter()
        .zip(body)
        .map(|(&p, &body)| {
            // Adding 0 turns -0 into +0, so that equal numbers have equal bits.
            let key = ((p + 0.0).to_array().map(f32::to_bits), body);
            *index_of.entry(key).or_insert_with(|| {
                welded.push(p);
                welded.len() as u32 - 1
            })
        })
        .collect();
    (map, welded)
}

fn weld_near(positions: &[Vec3], body: &[u32], epsilon: f32) -> (Vec<u32>, Vec<Vec3>) {
    let mut cells: HashMap<([i64; 3], u32), Vec<u32>> = HashMap::new();
    let mut welded: Vec<Vec3> = Vec::new();
    let map = positions
        .iter()
        .zip(body)
        .map(|(&p, &body)| {
            let cell = (p.as_dvec3() / f64::from(epsilon)).to_array().map(|c| c.floor() as i64);
            // A vertex within epsilon lies in this cell or an adjacent one; the lowest index is the first one.
            let near = (-1..=1)
                .flat_map(|x| (-1..=1).flat_map(move |y| (-1..=1).map(move |z| [x, y, z])))
                .filter_map(|[x, y, z]| {
                    let near =
                        [cell[0].saturating_add(x), cell[1].saturating_add(y), cell[2].saturating_add(z)];
                    cells.get(&(near, body))
                })
                .flatten()
                .copied()
                .filter(|&i| welded[i as usize].distance(p) <= epsilon)
                .min();
            near.unwrap_or_else(|| {
                welded.push(p);
                let index = welded.len() as u32 - 1;
                cells.entry((cell, body)).or_default().push(index);
                index
            })
        })
        .collect();
    (map, welded)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exact_weld_keeps_near_vertices_apart_and_joins_both_zeros() {
        let (map, welded) = weld(&[Vec3::ZERO, Vec3::new(-0.0, 0.0, 0.0), Vec3::new(1e-6, 0.0, 0.0)], 0.0);
        assert_eq!(map, [0, 0, 1]);
        assert_eq!(welded.len(), 2);
        assert_eq!(weld(&[1e-9 * Vec3::X, 2e-9 * Vec3::X, 1e-9 * Vec3::X], 0.0).0, [0, 1, 0]);
    }

    #[test]
    fn epsilon_weld_joins_across_cell_walls() {
        let points = [0.0999, 0.1001, 0.25, -0.0001].map(|x| Vec3::new(x, 0.0, 0.0));
        let (map, welded) = weld(&points, 0.01);
        assert_eq!(map, [0, 0, 1, 2]);
        assert_eq!(welded[0], points[0]);
        assert_eq!(weld_bodies(&points, &[0, 1, 1, 1], 0.01).0, [0, 1, 2, 3], "bodies stay apart");
    }

    #[test]
    fn vertices_within_epsilon_join_and_others_do_not() {
        for (share, joined) in [(0.99, true), (1.0, true), (1.01, false)] {
            for (epsilon, axis) in
                [0.125, 1.0, 16.0].into_iter().flat_map(|e| Vec3::AXES.map(|axis| (e, axis)))
            {
                for step in [axis, -axis] {
                    let (map, positions) = weld(&[Vec3::ZERO, share * epsilon * step], epsilon);
                    assert_eq!(
                        (map[1] == 0, positions.len() == 1),
                        (joined, joined),
                        "{share}, {epsilon}, {step}"
                    );
                }
            }
        }
    }
}
