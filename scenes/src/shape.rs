use std::collections::HashMap;
use std::f32::consts::{FRAC_PI_2, TAU};
use std::ops::Range;

use glam::{Affine3A, Mat3A, Vec2, Vec3, Vec4};

use crate::MeshError;
use crate::limits::is_near;
use crate::mesh::bounds_of;

/// An indexed triangle surface from a loader or a procedural scene, before it becomes part of a [`Mesh`](crate::Mesh).
/// It is neither checked nor welded.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Shape {
    /// Vertex positions, metres.
    pub positions: Vec<Vec3>,
    /// Counter-clockwise seen from the front.
    pub triangles: Vec<[u32; 3]>,
    /// Shading normals per corner, one entry per triangle; empty for flat shading.
    pub normals: Vec<[Vec3; 3]>,
    /// Two sets of texture coordinates per corner, one entry per triangle each; empty without. (0, 0) is the corner of
    /// a texture's first texel, and v points down.
    pub uvs: [Vec<[Vec2; 3]>; 2],
    /// The directions in which u grows per corner, for normal maps, and 1 or -1 if a normal map's up is to the left of it
    /// or to the right, seen from the front; one entry per triangle, zero where that follows from the texture coordinates;
    /// empty without.
    pub tangents: Vec<[Vec4; 3]>,
    /// Factors on the material's colour and opacity per corner, one entry per triangle; empty without. Linear.
    pub colors: Vec<[Vec4; 3]>,
}

impl Shape {
    /// Checks that it can become part of a mesh.
    ///
    /// # Errors
    /// The first vertex that is not finite or too far out, or the first face with an invalid vertex index.
    pub fn check(&self) -> Result<(), MeshError> {
        let vertices = self.positions.len();
        if let Some(vertex) = self.positions.iter().position(|&p| !is_near(p)) {
            let position = self.positions[vertex];
            return Err(if position.is_finite() {
                MeshError::TooFar { vertex, position }
            } else {
                MeshError::NotFinite { vertex, position }
            });
        }
        for (face, triangle) in self.triangles.iter().enumerate() {
            if let Some(&index) = triangle.iter().find(|&&i| i as usize >= vertices) {
                return Err(MeshError::IndexOutOfRange { face, index, vertices });
            }
        }
        Ok(())
    }

    /// The planar quad `a b c d`, counter-clockwise seen from the front.
    pub fn quad(corners: [Vec3; 4]) -> Self {
        Self { positions: corners.to_vec(), triangles: vec![[0, 1, 2], [0, 2, 3]], ..Self::default() }
    }

    /// A closed prism between two outlines of the same number of corners, both counter-clockwise seen from above,
    /// `bottom` below `top`. 4n - 4 triangles.
    pub fn prism(bottom: &[Vec3], top: &[Vec3]) -> Self {
        let n = bottom.len() as u32;
        let mut shape = Self { positions: [bottom, top].concat(), ..Self::default() };
        for i in 0..n {
            let j = (i + 1) % n;
            shape.triangles.extend([[i, j, n + j], [i, n + j, n + i]]);
        }
        for i in 1..n - 1 {
            shape.triangles.extend([[0, i + 1, i], [n, n + i, n + i + 1]]);
        }
        shape
    }

    /// A closed box between two corners, 12 triangles.
    pub fn cuboid(low: Vec3, high: Vec3) -> Self {
        let outline = |y: f32| {
            [(low.x, low.z), (low.x, high.z), (high.x, high.z), (high.x, low.z)]
                .map(|(x, z)| Vec3::new(x, y, z))
        };
        Self::prism(&outline(low.y), &outline(high.y))
    }

    /// A grid of `columns` x `rows` quads with vertices `point(i, j)`, i in 0..=columns to the right, j in 0..=rows
    /// upwards as seen from the front, with smooth shading normals. Coinciding ends weld into a closed surface; a quad
    /// that degenerates to a triangle at a pole gives one triangle.
    pub fn surface(columns: u32, rows: u32, point: impl Fn(u32, u32) -> Vec3) -> Self {
        let mut shape = Self::default();
        for j in 0..=rows {
            for i in 0..=columns {
                shape.positions.push(point(i, j));
            }
        }
        let at = |i: u32, j: u32| j * (columns + 1) + i;
        for j in 0..rows {
            for i in 0..columns {
                let [a, b, c, d] = [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)];
                let same = |p: u32, q: u32| shape.positions[p as usize] == shape.positions[q as usize];
                let (lower, upper) = (!same(a, b), !same(c, d));
                shape.triangles.extend(lower.then_some([a, b, c]));
                shape.triangles.extend(upper.then_some([a, c, d]));
            }
        }
        shape.smooth(180.0);
        shape
    }

    /// The surface that `profile` sweeps around the y axis: (radius, height) from the bottom up, `columns` facets
    /// around. Closed where it starts and ends with radius 0. Shading is smooth except at corners of more than 30
    /// degrees.
    pub fn lathe(profile: &[Vec2], columns: u32) -> Self {
        let mut shape = Self::surface(columns, profile.len() as u32 - 1, |i, j| {
            let angle = TAU * (i % columns) as f32 / columns as f32;
            let Vec2 { x: radius, y } = profile[j as usize];
            Vec3::new(radius * angle.sin(), y, radius * angle.cos())
        });
        shape.smooth(30.0);
        shape
    }

    /// A closed cylinder along y from `low` to `high`. 4 `columns` triangles.
    pub fn cylinder(radius: f32, low: f32, high: f32, columns: u32) -> Self {
        Self::lathe(&[[0.0, low], [radius, low], [radius, high], [0.0, high]].map(Vec2::from), columns)
    }

    /// A sphere around the origin of `columns` facets around and `rows` from pole to pole.
    /// 2 columns (rows - 1) triangles.
    pub fn sphere(radius: f32, columns: u32, rows: u32) -> Self {
        let profile: Vec<Vec2> = (0..=rows)
            .map(|j| {
                let latitude = FRAC_PI_2 * (2.0 * j as f32 / rows as f32 - 1.0);
                // cos(90 degrees) is not exactly 0 in floating point, but the poles have to close.
                let ring = if j == 0 || j == rows { 0.0 } else { latitude.cos() };
                radius * Vec2::new(ring, latitude.sin())
            })
            .collect();
        Self::lathe(&profile, columns)
    }

    /// A closed box around the origin with edges rounded by `radius` in `segments` steps per quarter turn; `half` is
    /// half its size. It consists of the octants of a sphere, moved apart: 16 segments (segments + 1) + 12 triangles.
    pub fn rounded_box(half: Vec3, radius: f32, segments: u32) -> Self {
        let steps = segments + 1;
        let inner = half - radius;
        // Each quarter turn has its own copy of the angles, so that the sphere opens where the flat sides go.
        let quarter_angle = |k: u32| FRAC_PI_2 * ((k / steps) as f32 + (k % steps) as f32 / segments as f32);
        let columns = 4 * steps;
        let mut shape = Self::surface(columns, 2 * steps - 1, |i, j| {
            let i = i % columns;
            let longitude = quarter_angle(i);
            let latitude = quarter_angle(j) - FRAC_PI_2;
            let middle = FRAC_PI_2 * ((i / steps) as f32 + 0.5);
            let corner =
                Vec3::new(middle.sin().signum(), if j < steps { -1.0 } else { 1.0 }, middle.cos().signum());
            let pole = j == 0 || j == 2 * steps - 1;
            let ring = if pole { 0.0 } else { latitude.cos() };
            let direction = Vec3::new(ring * longitude.sin(), latitude.sin(), ring * longitude.cos());
            corner * inner + radius * direction
        });
        for (row, up) in [(0, false), (2 * steps - 1, true)] {
            let [a, b, c, d] = [0, 1, 2, 3].map(|quarter| row * (columns + 1) + quarter * steps);
            shape.triangles.extend(if up { [[a, b, c], [a, c, d]] } else { [[a, c, b], [a, d, c]] });
        }
        shape.smooth(50.0);
        shape
    }

    /// The closed tube of `radius` around the closed curve `point(i)`, i in 0..columns; `columns` x `around` quads.
    /// The curve must not bend towards `side(i)`, a unit vector across it: for a flat curve, the plane's normal.
    pub fn ring(
        columns: u32,
        around: u32,
        radius: f32,
        point: impl Fn(u32) -> Vec3,
        side: impl Fn(u32) -> Vec3,
    ) -> Self {
        Self::surface(columns, around, |i, j| {
            let i = i % columns;
            let tangent = point((i + 1) % columns) - point((i + columns - 1) % columns);
            let side = side(i);
            let out = tangent.cross(side).normalize();
            let angle = TAU * (j % around) as f32 / around as f32;
            point(i) + radius * (out * angle.cos() + side * angle.sin())
        })
    }

    /// Several shapes as one.
    pub fn union(shapes: impl IntoIterator<Item = Self>) -> Self {
        let mut all = Self::default();
        for shape in shapes {
            let base = all.positions.len() as u32;
            all.positions.extend(shape.positions);
            all.triangles.extend(shape.triangles.iter().map(|t| t.map(|i| i + base)));
            let triangles = all.triangles.len();
            append(&mut all.normals, &shape.normals, triangles, [Vec3::ZERO; 3]);
            for (set, added) in all.uvs.iter_mut().zip(&shape.uvs) {
                append(set, added, triangles, [Vec2::ZERO; 3]);
            }
            append(&mut all.tangents, &shape.tangents, triangles, [Vec4::ZERO; 3]);
            append(&mut all.colors, &shape.colors, triangles, [Vec4::ONE; 3]);
        }
        all
    }

    /// Gives every corner the area-weighted mean normal of the faces around its position that lie within
    /// `angle` degrees of its own face.
    pub fn smooth(&mut self, angle: f32) {
        let keys: Vec<u32> = crate::weld::weld(&self.positions, 0.0).0;
        let areas: Vec<Vec3> = self.triangles.iter().map(|t| self.area_normal(*t)).collect();
        let mut around = vec![Vec::new(); self.positions.len()];
        for (face, triangle) in self.triangles.iter().enumerate() {
            for &corner in triangle {
                around[keys[corner as usize] as usize].push(face);
            }
        }
        let limit = angle.to_radians().cos() - 1e-6;
        // The time of a look at all faces grows with the square of their number.
        let crowds: HashMap<usize, Crowd> = around
            .iter()
            .enumerate()
            .filter(|(_, faces)| faces.len() > FEW_FACES)
            .map(|(vertex, faces)| (vertex, Crowd::new(faces.iter().map(|&face| areas[face]).collect())))
            .collect();
        self.normals = (0..self.triangles.len())
            .map(|face| {
                let own = areas[face].normalize_or_zero();
                self.triangles[face].map(|corner| {
                    let vertex = keys[corner as usize] as usize;
                    let sum = match crowds.get(&vertex) {
                        Some(crowd) => crowd.sum(own, limit),
                        None => around[vertex]
                            .iter()
                            .filter(|&&other| areas[other].normalize_or_zero().dot(own) >= limit)
                            .map(|&other| areas[other])
                            .sum(),
                    };
                    sum.try_normalize().unwrap_or(own)
                })
            })
            .collect();
    }

    fn area_normal(&self, triangle: [u32; 3]) -> Vec3 {
        let [a, b, c] = triangle.map(|i| self.positions[i as usize]);
        (b - a).cross(c - a)
    }

    /// This shape transformed by `transform`; a mirroring transform also flips the triangles, so that fronts stay
    /// fronts.
    pub fn transformed(&self, transform: Affine3A) -> Self {
        let normal_matrix: Mat3A = transform.matrix3.inverse().transpose();
        let mut shape = self.clone();
        shape.positions.iter_mut().for_each(|at| *at = transform.transform_point3(*at));
        let normals = shape.normals.iter_mut().flatten();
        normals.for_each(|normal| *normal = (normal_matrix * *normal).normalize_or_zero());
        shape.turn_tangents(|tangent| transform.transform_vector3(tangent));
        if transform.matrix3.determinant() < 0.0 {
            shape.turn_over();
        }
        shape
    }

    /// This shape with texture coordinates by the positions of its corners.
    pub fn with_uvs(mut self, uv: impl Fn(Vec3) -> Vec2) -> Self {
        let corner = |i: u32| uv(self.positions[i as usize]);
        self.uvs[0] = self.triangles.iter().map(|triangle| triangle.map(corner)).collect();
        self
    }

    /// Changes the directions of the tangents.
    pub(crate) fn turn_tangents(&mut self, turned: impl Fn(Vec3) -> Vec3) {
        for tangent in self.tangents.iter_mut().flatten() {
            *tangent = turned(tangent.truncate()).normalize_or_zero().extend(tangent.w);
        }
    }

    /// Turns the triangles of a shape whose corners were mirrored, so that fronts stay fronts.
    pub(crate) fn turn_over(&mut self) {
        self.triangles.iter_mut().for_each(|corners| corners.swap(1, 2));
        self.normals.iter_mut().for_each(|corners| corners.swap(1, 2));
        self.uvs.iter_mut().flatten().for_each(|corners| corners.swap(1, 2));
        self.colors.iter_mut().for_each(|corners| corners.swap(1, 2));
        self.tangents.iter_mut().for_each(|corners| corners.swap(1, 2));
        self.tangents.iter_mut().flatten().for_each(|tangent| tangent.w = -tangent.w);
    }

    /// This shape moved by `offset`.
    pub fn moved(&self, offset: Vec3) -> Self {
        self.transformed(Affine3A::from_translation(offset))
    }

    /// Lowest and highest corner of the box around its vertices (inverted and infinite if there are none).
    pub fn bounds(&self) -> [Vec3; 2] {
        bounds_of(&self.positions)
    }
}

/// Appends one entry per triangle to those of all `triangles`, where a part without any gets `none`.
pub(crate) fn append<T: Clone>(all: &mut Vec<T>, added: &[T], triangles: usize, none: T) {
    if !added.is_empty() {
        all.resize(triangles - added.len(), none);
        all.extend_from_slice(added);
    } else if !all.is_empty() {
        all.resize(triangles, none);
    }
}

/// Most faces around a vertex that are summed one by one.
const FEW_FACES: usize = 256;

/// The area normals of many faces, as a tree of boxes around their directions: the sum over all that lie within an angle
/// of a direction takes about the square root of their number of steps.
struct Crowd {
    areas: Vec<Vec3>,
    /// In preorder: a node's first half follows it.
    nodes: Vec<CrowdNode>,
}

struct CrowdNode {
    /// Lowest and highest components of the directions.
    low: Vec3,
    high: Vec3,
    sum: Vec3,
    /// Index of the second half's node; 0 for a leaf.
    second: usize,
    /// The range of `areas`.
    range: Range<usize>,
}

impl Crowd {
    const LEAF: usize = 8;

    fn new(areas: Vec<Vec3>) -> Self {
        let mut crowd = Self { nodes: Vec::with_capacity(areas.len() / 2), areas };
        crowd.split(0..crowd.areas.len());
        crowd
    }

    fn split(&mut self, range: Range<usize>) {
        let areas = &mut self.areas[range.clone()];
        let directions: Vec<Vec3> = areas.iter().map(|area| area.normalize_or_zero()).collect();
        let [low, high] = bounds_of(&directions);
        let node = self.nodes.len();
        self.nodes.push(CrowdNode { low, high, sum: areas.iter().sum(), second: 0, range: range.clone() });
        if range.len() <= Self::LEAF || low == high {
            return;
        }
        let axis = (high - low).max_position();
        let middle = range.len() / 2;
        let key = |area: &Vec3| area.normalize_or_zero()[axis];
        areas.select_nth_unstable_by(middle, |a, b| key(a).total_cmp(&key(b)));
        self.split(range.start..range.start + middle);
        self.nodes[node].second = self.nodes.len();
        self.split(range.start + middle..range.end);
    }

    /// The sum of the area normals whose direction has at least the cosine `limit` with `own`.
    fn sum(&self, own: Vec3, limit: f32) -> Vec3 {
        let (mut sum, mut open) = (Vec3::ZERO, vec![0]);
        while let Some(index) = open.pop() {
            let node = &self.nodes[index];
            let (a, b) = (own * node.low, own * node.high);
            if a.min(b).element_sum() >= limit {
                sum += node.sum;
            } else if a.max(b).element_sum() < limit {
            } else if node.second > 0 {
                open.extend([node.second, index + 1]);
            } else {
                let areas = self.areas[node.range.clone()].iter();
                sum += areas.filter(|area| area.normalize_or_zero().dot(own) >= limit).sum::<Vec3>();
            }
        }
        sum
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::weld::weld;

    /// Six times the enclosed volume; positive when the fronts look outwards.
    fn volume6(shape: &Shape) -> f32 {
        shape
            .triangles
            .iter()
            .map(|t| t.map(|i| shape.positions[i as usize]))
            .map(|[a, b, c]| a.dot(b.cross(c)))
            .sum()
    }

    /// Returns true if every side of every triangle has exactly one partner in the opposite direction.
    fn closed(shape: &Shape) -> bool {
        let index = weld(&shape.positions, 0.0).0;
        let mut sides = HashMap::new();
        for [a, b, c] in shape.triangles.iter().map(|t| t.map(|i| index[i as usize])) {
            for side in [[a, b], [b, c], [c, a]] {
                *sides.entry(side).or_insert(0) += 1;
            }
        }
        sides.iter().all(|(&[a, b], &n)| a != b && n == 1 && sides.get(&[b, a]) == Some(&1))
    }

    fn check(shape: &Shape, volume: f32, tolerance: f32) {
        assert!(closed(shape));
        let found = volume6(shape) / 6.0;
        assert!((found / volume - 1.0).abs() < tolerance, "volume {found}, expected {volume}");
        for (triangle, normals) in shape.triangles.iter().zip(&shape.normals) {
            let face = shape.area_normal(*triangle).normalize_or_zero();
            assert!(normals.iter().all(|n| n.is_normalized() && n.dot(face) > 0.7), "{normals:?} {face}");
        }
    }

    #[test]
    fn solids_are_closed_and_look_outwards() {
        use std::f32::consts::PI;
        check(&Shape::cuboid(Vec3::ZERO, Vec3::new(1.0, 2.0, 3.0)), 6.0, 1e-5);
        check(&Shape::sphere(1.0, 64, 32), 4.0 / 3.0 * PI, 0.01);
        check(&Shape::cylinder(0.5, 1.0, 3.0, 64), 0.5 * PI, 0.01);
        check(&Shape::rounded_box(Vec3::new(0.5, 1.0, 1.5), 0.01, 4), 6.0, 0.01);
        let circle = |i: u32| Vec3::new((TAU * i as f32 / 64.0).cos(), 0.0, -(TAU * i as f32 / 64.0).sin());
        check(&Shape::ring(64, 24, 0.2, circle, |_| Vec3::Y), TAU * PI * 0.04, 0.02);
    }

    #[test]
    fn shapes_have_as_many_triangles_as_their_descriptions_say() {
        let circle = |i: u32| Vec3::new((TAU * i as f32 / 10.0).cos(), 0.0, -(TAU * i as f32 / 10.0).sin());
        let outline = |y: f32| [0, 2, 4, 6, 8].map(|i| circle(i) + y * Vec3::Y);
        for (shape, triangles) in [
            (Shape::prism(&outline(0.0), &outline(1.0)), 4 * 5 - 4),
            (Shape::cuboid(Vec3::ZERO, Vec3::ONE), 12),
            (Shape::surface(7, 5, |i, j| Vec3::new(i as f32, j as f32, 0.0)), 2 * 7 * 5),
            (Shape::cylinder(1.0, 0.0, 2.0, 9), 4 * 9),
            (Shape::sphere(1.0, 9, 6), 2 * 9 * 5),
            (Shape::rounded_box(Vec3::new(1.0, 2.0, 3.0), 0.3, 1), 16 * 2 + 12),
            (Shape::rounded_box(Vec3::new(1.0, 2.0, 3.0), 0.3, 4), 16 * 4 * 5 + 12),
            (Shape::ring(10, 6, 0.2, circle, |_| Vec3::Y), 2 * 10 * 6),
        ] {
            assert_eq!(shape.triangles.len(), triangles);
            assert!(shape.normals.is_empty() || shape.normals.len() == triangles);
        }
    }

    #[test]
    fn a_box_that_is_all_rounding_closes_at_its_poles() {
        let round = Shape::rounded_box(Vec3::new(0.3, 1.0, 0.3), 0.3, 2);
        let poles: Vec<&Vec3> = round.positions.iter().filter(|p| p.y.abs() == 1.0).collect();
        assert!(!poles.is_empty() && poles.iter().all(|p| p.x == 0.0 && p.z == 0.0), "{poles:?}");
    }

    /// The shading normals of the triangles that face this way.
    fn facing(shape: &Shape, way: Vec3) -> Vec<Vec3> {
        let faces = shape.triangles.iter().zip(&shape.normals);
        let faces =
            faces.filter(|(face, _)| shape.area_normal(**face).normalize_or_zero().distance(way) < 0.02);
        faces.flat_map(|(_, normals)| *normals).collect()
    }

    #[test]
    fn each_shape_smooths_to_its_own_angle() {
        // A grid of any bend: here a right angle, with its edge at x = z = 0.
        let fold = Shape::surface(2, 1, |i, j| {
            Vec3::new([-1.0, 0.0, 0.0][i as usize], j as f32, [0.0, 0.0, -1.0][i as usize])
        });
        let normals = facing(&fold, Vec3::Z);
        assert_eq!(normals.len(), 6);
        assert_eq!(
            normals.iter().filter(|normal| normal.x > 0.4 && normal.z > 0.4).count(),
            3,
            "{normals:?}"
        );
        // A cylinder under a cone: up to 30 degrees.
        for (degrees, is_smooth) in [(29.0_f32, true), (31.0, false)] {
            let (sin, cos) = degrees.to_radians().sin_cos();
            let profile = [Vec2::new(1.0, 0.0), Vec2::X + Vec2::Y, Vec2::new(1.0 + sin, 1.0 + cos)];
            let normals = facing(&Shape::lathe(&profile, 512), Vec3::Z);
            assert!(!normals.is_empty());
            assert_eq!(normals.iter().any(|normal| normal.y < -0.1), is_smooth, "{degrees}: {normals:?}");
        }
        // A box with chamfers: 35 degrees from them to the triangles at its corners, 55 from the sides.
        let chamfered = Shape::rounded_box(Vec3::ONE, 0.2, 1);
        for corner in [Vec3::ONE, Vec3::new(1.0, -1.0, -1.0)] {
            let way = corner.normalize();
            let normals = facing(&chamfered, way);
            assert_eq!(normals.len(), 3);
            assert!(normals.iter().all(|normal| (0.9..0.99).contains(&normal.dot(way))), "{normals:?}");
        }
    }

    #[test]
    fn texture_coordinates_by_position_are_the_first_set() {
        let square = Shape::quad([Vec3::ZERO, Vec3::X, Vec3::X + Vec3::Y, Vec3::Y]);
        let shape = square.with_uvs(|p| Vec2::new(2.0 * p.x, 1.0 - p.y));
        let [a, b, c, d] = [[0.0, 1.0], [2.0, 1.0], [2.0, 0.0], [0.0, 0.0]].map(Vec2::from);
        assert_eq!(shape.uvs, [vec![[a, b, c], [a, c, d]], vec![]]);
    }

    #[test]
    fn a_shape_pressed_flat_keeps_its_fronts() {
        let square = Shape::quad([Vec3::ZERO, Vec3::Z, Vec3::X + Vec3::Z, Vec3::X]);
        let flat = square.transformed(Affine3A::from_scale(Vec3::new(1.0, 0.0, 1.0)));
        assert_eq!((flat.positions, flat.triangles), (square.positions, square.triangles));
    }

    #[test]
    fn a_mirroring_transform_keeps_fronts_outside() {
        let mirrored = Shape::sphere(1.0, 16, 8).transformed(Affine3A::from_scale(Vec3::new(-2.0, 1.0, 1.0)));
        check(&mirrored, 8.0 / 3.0 * std::f32::consts::PI, 0.2);
    }

    #[test]
    fn values_at_corners_follow_a_transform_and_a_union() {
        let normals = [Vec3::X, Vec3::new(0.6, 0.8, 0.0), Vec3::Z];
        let uvs = [Vec2::ZERO, Vec2::X, Vec2::Y];
        let tangents =
            [(Vec3::X, 1.0), (Vec3::Y, -1.0), (Vec3::Z, 1.0)].map(|(along, side)| along.extend(side));
        let colors = [Vec4::X, Vec4::Y, Vec4::Z];
        let triangle = Shape {
            positions: vec![Vec3::ZERO, Vec3::X, Vec3::Y],
            triangles: vec![[0, 1, 2]],
            normals: vec![normals],
            uvs: [vec![uvs], vec![]],
            tangents: vec![tangents],
            colors: vec![colors],
        };
        // It mirrors y, so the last two corners change places, and up is on the other side of right; normals scale by the
        // inverse.
        let mirrored = triangle.transformed(Affine3A::from_scale(Vec3::new(2.0, -1.0, 4.0)));
        let expected = [Vec3::X, Vec3::Z, Vec3::new(0.3, -0.8, 0.0).normalize()];
        assert_eq!(mirrored.triangles, [[0, 2, 1]]);
        assert_eq!(mirrored.uvs, [vec![[Vec2::ZERO, Vec2::Y, Vec2::X]], vec![]]);
        assert_eq!(mirrored.colors, [[Vec4::X, Vec4::Z, Vec4::Y]]);
        let turned = [(Vec3::X, -1.0), (Vec3::Z, -1.0), (Vec3::NEG_Y, 1.0)];
        assert_eq!(mirrored.tangents, [turned.map(|(along, side)| along.extend(side))]);
        assert!(mirrored.normals[0].iter().zip(expected).all(|(normal, b)| normal.distance(b) < 1e-6));
        let flat = Shape {
            positions: triangle.positions.clone(),
            triangles: triangle.triangles.clone(),
            ..Shape::default()
        };
        let both = Shape::union([flat.clone(), triangle.clone(), flat]);
        assert_eq!(both.triangles, [[0, 1, 2], [3, 4, 5], [6, 7, 8]]);
        assert_eq!(both.normals, [[Vec3::ZERO; 3], normals, [Vec3::ZERO; 3]]);
        assert_eq!(both.uvs, [vec![[Vec2::ZERO; 3], uvs, [Vec2::ZERO; 3]], vec![]]);
        assert_eq!(both.tangents, [[Vec4::ZERO; 3], tangents, [Vec4::ZERO; 3]]);
        assert_eq!(both.colors, [[Vec4::ONE; 3], colors, [Vec4::ONE; 3]]);
    }

    #[test]
    fn smooth_normals_are_weighted_by_area() {
        // Two triangles at a right angle along the x axis; the second is three times as large.
        let mut shape = Shape {
            positions: vec![Vec3::ZERO, Vec3::X, Vec3::Y, 3.0 * Vec3::Z],
            triangles: vec![[0, 1, 2], [1, 0, 3]],
            ..Shape::default()
        };
        for (angle, at_the_edge) in [(91.0, Vec3::new(0.0, 3.0, 1.0).normalize()), (89.0, Vec3::Z)] {
            shape.smooth(angle);
            assert!(shape.normals[0][0].distance(at_the_edge) < 1e-6, "{angle}: {}", shape.normals[0][0]);
            assert!(shape.normals[0][2].distance(Vec3::Z) < 1e-6);
        }
    }

    #[test]
    fn faces_at_the_angle_itself_are_smoothed_together() {
        // Two triangles along the x axis at a right angle, or wider by so many thirds of a radian.
        for (wider, together) in [(0.0, true), (1.5e-6, true), (4.5e-6, false)] {
            let mut shape = Shape {
                positions: vec![Vec3::ZERO, Vec3::X, Vec3::Y, Vec3::new(0.0, wider, 3.0)],
                triangles: vec![[0, 1, 2], [1, 0, 3]],
                ..Shape::default()
            };
            shape.smooth(90.0);
            assert_eq!(shape.normals[0][0].distance(Vec3::Z) > 0.1, together, "{wider}");
        }
    }

    /// A fan of faces around the origin, on a cone that is wavy and of varying width.
    fn fan(faces: u32) -> Shape {
        let rim = (0..faces).map(|i| {
            let angle = TAU * i as f32 / faces as f32;
            let wave = (7.0 * angle).sin();
            Vec3::new(angle.cos(), 0.5 + 0.3 * wave, angle.sin()) * (2.0 + wave)
        });
        Shape {
            positions: [Vec3::ZERO].into_iter().chain(rim).collect(),
            triangles: (0..faces).map(|i| [0, 1 + (i + 1) % faces, 1 + i]).collect(),
            ..Shape::default()
        }
    }

    #[test]
    fn many_faces_around_a_vertex_are_smoothed_like_few() {
        let fan = fan(3000);
        for angle in [0.0, 5.0, 30.0, 90.0, 180.0] {
            let mut smooth = fan.clone();
            smooth.smooth(angle);
            let areas: Vec<Vec3> = fan.triangles.iter().map(|t| fan.area_normal(*t)).collect();
            for (normals, own) in smooth.normals.iter().zip(&areas).step_by(37) {
                let is_within = |area: &&Vec3| {
                    f64::from(area.normalize().dot(own.normalize()))
                        >= f64::from(angle).to_radians().cos() - 1e-6
                };
                let sum: Vec3 = areas.iter().filter(is_within).sum();
                assert!(normals[0].distance(sum.normalize()) < 1e-3, "{angle}: {} {sum}", normals[0]);
            }
        }
    }

    #[test]
    fn a_crowd_is_halved_until_few_or_equal_directions_are_left() {
        for faces in [64, 300] {
            let fan = fan(faces);
            let crowd = Crowd::new(fan.triangles.iter().map(|t| fan.area_normal(*t)).collect());
            let leaves = crowd.nodes.iter().filter(|node| node.second == 0);
            assert_eq!(leaves.map(|node| node.range.len()).sum::<usize>(), faces as usize);
            for (index, node) in crowd.nodes.iter().enumerate() {
                assert_eq!(node.second == 0, node.range.len() <= 8);
                if node.second > 0 {
                    let [first, second] = [&crowd.nodes[index + 1], &crowd.nodes[node.second]];
                    let middle = node.range.start + node.range.len() / 2;
                    assert_eq!(
                        [&first.range, &second.range],
                        [&(node.range.start..middle), &(middle..node.range.end)]
                    );
                    let axis = (node.high - node.low).max_position();
                    assert!(first.high[axis] <= second.low[axis]);
                }
            }
        }
        assert_eq!(Crowd::new(vec![Vec3::Z; 100]).nodes.len(), 1);
    }

    #[test]
    fn the_work_of_smoothing_a_fan_does_not_grow_with_its_square() {
        let mut fan = fan(40_000);
        let start = std::time::Instant::now();
        fan.smooth(30.0);
        // Over a minute if each face looks at all others; half a second if not.
        let seconds = start.elapsed().as_secs_f64();
        assert!(seconds < 20.0, "{seconds} s");
    }
}
