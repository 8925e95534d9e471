//! The polygons of a file, in double precision, on their way to shapes.

use std::ops::Range;

use glam::DVec3;

use super::origin::{is_torn, origin_of};
use super::triangulate::{Fault, Triangulator};
use crate::limits::is_near;
use crate::{MeshError, NoteKind, Report, Shape};

/// Polygons, and the vertices that they share.
#[derive(Default)]
pub(super) struct Polygons {
    /// The places of the vertices in the file's coordinates, metres. Numbers that are not finite harm only the polygons
    /// that use them.
    pub at: Vec<DVec3>,
    /// The vertex of each corner of each polygon; what follows the last polygon's belongs to the next one.
    pub corners: Vec<u32>,
    /// The end of each polygon in `corners`.
    ends: Vec<usize>,
    /// The number of triangles that all polygons make.
    triangles: usize,
}

impl Polygons {
    /// The number of polygons.
    pub fn len(&self) -> usize {
        self.ends.len()
    }

    /// Makes room for so many triangles.
    pub fn reserve(&mut self, count: usize) {
        self.ends.reserve(count);
        self.corners.reserve(3 * count);
    }

    /// Makes a polygon of the corners that were added since the last one. Fewer than three are dropped, and noted.
    pub fn close(&mut self, name: &str, report: &mut Report) -> Result<(), MeshError> {
        let begin = self.ends.last().copied().unwrap_or(0);
        let count = self.corners.len() - begin;
        if count < 3 {
            report.add(NoteKind::LeftOut, "a face with fewer than three corners", name);
            self.corners.truncate(begin);
            return Ok(());
        }
        self.triangles += count - 2;
        MeshError::of_size(self.triangles, self.at.len())?;
        self.ends.push(self.corners.len());
        Ok(())
    }

    /// The index of the polygon of a corner.
    pub fn of_corner(&self, corner: usize) -> usize {
        self.ends.partition_point(|&end| end <= corner)
    }

    /// The corners of a polygon.
    pub fn polygon(&self, index: usize) -> Range<usize> {
        let begin = if index == 0 { 0 } else { self.ends[index - 1] };
        begin..self.ends[index]
    }

    /// Whether the places of all corners are numbers.
    fn is_finite(&self, corners: Range<usize>) -> bool {
        self.corners[corners].iter().all(|&vertex| self.at[vertex as usize].is_finite())
    }
}

/// Makes shapes of polygons, relative to one origin.
pub(super) struct Assembly<'a> {
    polygons: &'a Polygons,
    /// What is subtracted from all places.
    pub origin: DVec3,
    /// Whether the vertices of a shape are in the order of the file, not in that in which its faces use them.
    pub in_file_order: bool,
    triangulator: Triangulator,
    /// The index of each vertex in the shape that is being made, or [`u32::MAX`].
    index: Vec<u32>,
    places: Vec<DVec3>,
    cut: Vec<[u32; 3]>,
}

impl<'a> Assembly<'a> {
    /// Chooses the origin. All corners must be vertices.
    ///
    /// # Errors
    /// The index of a vertex that a polygon uses, too far from the origin.
    pub fn new(polygons: &'a Polygons) -> Result<Self, usize> {
        let used = || {
            let whole = (0..polygons.len()).map(|index| polygons.polygon(index));
            whole
                .filter(|corners| polygons.is_finite(corners.clone()))
                .flat_map(|corners| &polygons.corners[corners])
                .map(|&vertex| vertex as usize)
        };
        let around = |[low, high]: [DVec3; 2], vertex: usize| {
            [low.min(polygons.at[vertex]), high.max(polygons.at[vertex])]
        };
        let [low, high] = used().fold([DVec3::INFINITY, DVec3::NEG_INFINITY], around);
        let origin = origin_of(low, high);
        let is_far = |point: DVec3| !is_near((point - origin).as_vec3());
        // Without a usable polygon the box is infinite.
        if (is_far(low) || is_far(high))
            && let Some(vertex) = used().find(|&vertex| is_far(polygons.at[vertex]))
        {
            return Err(vertex);
        }
        Ok(Self {
            polygons,
            origin,
            in_file_order: false,
            triangulator: Triangulator::new(),
            index: vec![u32::MAX; polygons.at.len()],
            places: Vec::new(),
            cut: Vec::new(),
        })
    }

    /// The shape of the polygons with these indices, which are those of the thing called `name`, and the corners of its
    /// triangles, as indices into all corners. Polygons with corners that are not finite are left out. Normals and all
    /// else are up to the caller.
    pub fn shape(
        &mut self,
        polygons: impl IntoIterator<Item = usize>,
        name: &str,
        report: &mut Report,
    ) -> (Shape, Vec<[usize; 3]>) {
        let Polygons { at, corners: all, .. } = self.polygons;
        let (mut shape, mut corners) = (Shape::default(), Vec::new());
        for polygon in polygons.into_iter().map(|index| self.polygons.polygon(index)) {
            if !self.polygons.is_finite(polygon.clone()) {
                report.add(NoteKind::LeftOut, "a face with a corner that is not a number", name);
                continue;
            }
            self.places.clear();
            self.places.extend(all[polygon.clone()].iter().map(|&vertex| at[vertex as usize]));
            self.cut.clear();
            let what = match self.triangulator.add(&self.places, &mut self.cut) {
                None => None,
                Some(Fault::Crossed) => Some("a polygon whose sides cross"),
                Some(Fault::Bent) => Some("a polygon that is neither convex nor flat"),
                Some(Fault::Large) => {
                    Some("a polygon with notches and too many corners, whose notches are filled")
                }
            };
            if let Some(what) = what {
                report.add(NoteKind::Approximated, what, name);
            }
            let of_all = |corner: u32| polygon.start + corner as usize;
            corners.extend(self.cut.iter().map(|triangle| triangle.map(of_all)));
        }
        let mut used = Vec::new();
        for &vertex in corners.iter().flatten().map(|&corner| &all[corner]) {
            if self.index[vertex as usize] == u32::MAX {
                self.index[vertex as usize] = 0;
                used.push(vertex);
            }
        }
        if self.in_file_order {
            used.sort_unstable();
        }
        for (new, &vertex) in used.iter().enumerate() {
            self.index[vertex as usize] = new as u32;
            shape.positions.push((at[vertex as usize] - self.origin).as_vec3());
        }
        let [low, high] = shape.bounds();
        if is_torn(low, high) {
            let what = "a part that is small and far from the others, so that single precision deforms it";
            report.add(NoteKind::Approximated, what, name);
        }
        let new = |corner: usize| self.index[all[corner] as usize];
        shape.triangles = corners.iter().map(|corners| corners.map(new)).collect();
        used.iter().for_each(|&vertex| self.index[vertex as usize] = u32::MAX);
        (shape, corners)
    }
}

#[cfg(test)]
mod tests {
    use glam::Vec3;

    use super::*;
    use crate::limits::MAX_TRIANGLES;

    /// Polygons of these vertices.
    fn polygons(at: Vec<DVec3>, faces: &[&[u32]]) -> Polygons {
        let mut polygons = Polygons { at, ..Polygons::default() };
        for face in faces {
            polygons.corners.extend_from_slice(face);
            polygons.close("", &mut Report::default()).unwrap();
        }
        polygons
    }

    #[test]
    fn the_triangles_of_all_polygons_are_counted() {
        let mut polygons = Polygons { at: vec![DVec3::ZERO], ..Polygons::default() };
        let mut add = |corners: usize| {
            polygons.corners.extend((0..corners).map(|_| 0));
            polygons.close("", &mut Report::default())
        };
        assert_eq!(add(MAX_TRIANGLES), Ok(()));
        assert_eq!(add(4), Ok(()));
        let error = MeshError::TooLarge { triangles: MAX_TRIANGLES + 1, vertices: 1 };
        assert_eq!(add(3), Err(error));
    }

    #[test]
    fn shapes_have_the_vertices_that_they_share_with_others() {
        let at = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]].map(|[x, y]| DVec3::new(x, y, 5.0));
        let polygons = polygons(at.to_vec(), &[&[2, 0, 1], &[3, 0, 2]]);
        let mut assembly = Assembly::new(&polygons).unwrap();
        for (in_file_order, expected) in [(false, [[2, 0, 1], [3, 0, 2]]), (true, [[0, 1, 2], [0, 2, 3]])] {
            assembly.in_file_order = in_file_order;
            for (polygon, vertices) in expected.into_iter().enumerate() {
                let (shape, corners) = assembly.shape([polygon], "", &mut Report::default());
                assert_eq!(shape.positions, vertices.map(|vertex| at[vertex].as_vec3()));
                assert_eq!(corners, [[3 * polygon, 3 * polygon + 1, 3 * polygon + 2]]);
                let places = shape.triangles[0].map(|vertex| shape.positions[vertex as usize]);
                assert_eq!(
                    places,
                    polygons
                        .polygon(polygon)
                        .map(|c| at[polygons.corners[c] as usize].as_vec3())
                        .collect::<Vec<_>>()[..]
                );
            }
        }
    }

    #[test]
    fn vertices_are_near_or_far_by_their_distance_from_the_origin() {
        let far = |x: f64| {
            let at = [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]].map(|[y, z]| DVec3::new(x, y, z));
            Assembly::new(&polygons(at.to_vec(), &[&[0, 1, 2]])).map(|assembly| assembly.origin.x)
        };
        // A part far out is near its own origin, but not a part near one that is far from it.
        assert_eq!([far(-9e8), far(9e8), far(9e12)], [Ok(-9e8), Ok(9e8), Ok(9e12)]);
        let at = [DVec3::ZERO, DVec3::X, Vec3::Y.as_dvec3(), 4e9 * DVec3::X].to_vec();
        assert_eq!(Assembly::new(&polygons(at.clone(), &[&[0, 1, 2], &[0, 1, 3]])).err(), Some(3));
        assert!(Assembly::new(&polygons(at, &[&[0, 1, 2]])).is_ok());
    }
}
