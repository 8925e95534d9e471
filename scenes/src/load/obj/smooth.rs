//! Smoothing groups: faces of one group that share a vertex share its normal.

use std::collections::HashMap;

use glam::{DVec3, Vec3};

use crate::load::polygons::Polygons;

/// The normals of vertices in their groups, which are numbers above 0.
pub(super) struct SmoothNormals {
    /// Of each vertex the first group and its sum of normals, by area.
    first: Vec<(u32, DVec3)>,
    /// The sums of other groups, by vertex and group.
    others: HashMap<(u32, u32), DVec3>,
}

impl SmoothNormals {
    /// Of polygons and the group of each, 0 for none.
    pub fn of(polygons: &Polygons, groups: &[u32]) -> Self {
        let mut normals = Self { first: vec![(0, DVec3::ZERO); polygons.at.len()], others: HashMap::new() };
        for (index, &group) in groups.iter().enumerate().filter(|(_, group)| **group > 0) {
            let corners = &polygons.corners[polygons.polygon(index)];
            let from_first =
                |corner: usize| polygons.at[corners[corner] as usize] - polygons.at[corners[0] as usize];
            let area: DVec3 = (2..corners.len()).map(|k| from_first(k - 1).cross(from_first(k))).sum();
            if area.is_finite() {
                corners.iter().for_each(|&vertex| *normals.sum(vertex, group) += area);
            }
        }
        normals
    }

    fn sum(&mut self, vertex: u32, group: u32) -> &mut DVec3 {
        let (first, sum) = &mut self.first[vertex as usize];
        if *first == 0 {
            *first = group;
        }
        if *first == group { sum } else { self.others.entry((vertex, group)).or_default() }
    }

    /// The unit normal of a vertex in a group, or zero if its faces cancel.
    pub fn normal(&self, vertex: u32, group: u32) -> Vec3 {
        let (first, sum) = self.first[vertex as usize];
        let sum = if first == group { Some(sum) } else { self.others.get(&(vertex, group)).copied() };
        sum.unwrap_or_default().normalize_or_zero().as_vec3()
    }
}
