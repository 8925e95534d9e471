//! What corners have beside their vertices.

use glam::{Vec2, Vec3, Vec4};

use super::smooth::SmoothNormals;
use super::{NONE, Reader};
use crate::{NoteKind, Report, Shape};

/// Gives a shape what the corners of its triangles have.
pub(super) struct Attributes<'a> {
    pub reader: &'a Reader,
    /// The corners of the shape's triangles, as indices into all corners.
    pub corners: &'a [[usize; 3]],
    /// The object's name.
    pub name: &'a str,
    pub report: Report,
}

impl Attributes<'_> {
    /// Whether any corner has an index.
    fn any(&self, indices: &[u32]) -> bool {
        self.corners.iter().flatten().any(|&corner| indices[corner] != NONE)
    }

    /// The value of each corner's index. Without an index it is `default`, and also if there is no such value, which is noted
    /// as `missing`.
    fn values<T: Copy>(
        &mut self,
        indices: &[u32],
        values: &[T],
        default: impl Fn(usize) -> T,
        missing: &str,
    ) -> Vec<[T; 3]> {
        let mut value = |corner: usize| match indices[corner] {
            NONE => default(corner),
            index => values.get(index as usize).copied().unwrap_or_else(|| {
                self.report.add(NoteKind::Repaired, missing, self.name);
                default(corner)
            }),
        };
        self.corners.iter().map(|corners| corners.map(&mut value)).collect()
    }

    /// Corners without a normal have that of their smoothing group, if they are in one.
    pub fn normals(&mut self, smooth: Option<&SmoothNormals>, shape: &mut Shape) {
        let Reader { corner_normals, normals, groups, polygons, .. } = self.reader;
        let group = |corner: usize| groups.get(polygons.of_corner(corner)).copied().unwrap_or(0);
        let is_smooth = smooth.is_some() && self.corners.iter().any(|corners| group(corners[0]) > 0);
        if is_smooth || self.any(corner_normals) {
            let missing = "a normal that does not exist, replaced by the face's";
            let default = |corner: usize| match smooth.map(|smooth| (smooth, group(corner))) {
                None | Some((_, 0)) => Vec3::ZERO,
                Some((smooth, group)) => smooth.normal(polygons.corners[corner], group),
            };
            shape.normals = self.values(corner_normals, normals, default, missing);
        }
    }

    pub fn uvs(&mut self, shape: &mut Shape) {
        let Reader { corner_uvs, uvs, .. } = self.reader;
        if self.any(corner_uvs) {
            let missing = "texture coordinates that do not exist, taken as 0";
            shape.uvs[0] = self.values(corner_uvs, uvs, |_| Vec2::Y, missing);
        } else {
            let what = "a texture on faces without texture coordinates, which show its corner";
            self.report.add(NoteKind::Approximated, what, self.name);
        }
    }

    pub fn colors(&self, shape: &mut Shape) {
        let Reader { colors, polygons, .. } = self.reader;
        let color = |corner: usize| {
            colors.get(polygons.corners[corner] as usize).copied().filter(|color| !color.is_nan())
        };
        if self.corners.iter().flatten().any(|&corner| color(corner).is_some()) {
            let white = |corner| color(corner).unwrap_or(Vec4::ONE);
            shape.colors = self.corners.iter().map(|corners| corners.map(white)).collect();
        }
    }
}
