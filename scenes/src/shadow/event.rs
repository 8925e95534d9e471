//! Events: the planes that touch the outlines of a light and of a blocker, and the part of each plane in which a shadow
//! boundary can lie.

use std::ops::Range;

use glam::{DMat3, DVec3};
use rayon::prelude::*;

use super::{ShadowKind, across};
use crate::{Light, Mesh, NO_FACE, Pose};

/// Maximum distance of a point that counts as in a plane, as a share of the largest coordinate: some units in the last
/// place of f32 positions.
const COPLANAR: f64 = 1e-6;

/// A light as a polygon with one corner (a point light) or four.
pub(super) struct Source {
    /// In order around the light.
    pub corners: Vec<DVec3>,
    /// The side to which a quad light emits, unit length.
    pub normal: Option<DVec3>,
}

impl Source {
    /// The polygon of `light`; `None` for a quad without area, which emits no light.
    pub fn new(light: &Light) -> Option<Self> {
        match *light {
            Light::Point { position, .. } | Light::Spot { position, .. } => {
                Some(Self { corners: vec![position.as_dvec3()], normal: None })
            }
            Light::Quad { corner, u, v, .. } => {
                let [corner, u, v] = [corner, u, v].map(|p| p.as_dvec3());
                let corners = vec![corner, corner + u, corner + u + v, corner + v];
                Some(Self { corners, normal: Some(across(u, v)?) })
            }
        }
    }

    /// Returns true if it is a quad light.
    pub fn has_area(&self) -> bool {
        self.normal.is_some()
    }

    /// Distance of a point in front of the light's plane, metres; infinite for a point light.
    pub fn in_front(&self, point: DVec3) -> f64 {
        self.normal.map_or(f64::INFINITY, |normal| normal.dot(point - self.corners[0]))
    }
}

/// A half-space as a linear function of position, which is at least 0 inside.
#[derive(Clone, Copy, Debug)]
pub(super) struct HalfSpace {
    pub gradient: DVec3,
    offset: f64,
}

impl HalfSpace {
    /// The function that is 0 at `origin`.
    pub fn new(gradient: DVec3, origin: DVec3) -> Self {
        Self { gradient, offset: -gradient.dot(origin) }
    }

    /// For points in the plane with the given normal: their distance from the line through `origin` along `direction`,
    /// metres, positive on the side on which `inside` lies.
    fn beside(normal: DVec3, origin: DVec3, direction: DVec3, inside: DVec3) -> Self {
        let gradient = normal.cross(direction).normalize_or_zero();
        let sign = gradient.dot(inside - origin).signum();
        Self::new(gradient * sign, origin)
    }

    /// The sum of the function and a number.
    pub fn plus(&self, number: f64) -> Self {
        Self { offset: self.offset + number, ..*self }
    }

    /// The function times a number.
    pub fn times(&self, factor: f64) -> Self {
        Self { gradient: self.gradient * factor, offset: self.offset * factor }
    }

    /// The sum of two functions.
    pub fn and(&self, other: &Self) -> Self {
        Self { gradient: self.gradient + other.gradient, offset: self.offset + other.offset }
    }

    /// This function of a point as a function of the point's position at rest, that is, before `pose` is applied.
    pub fn at_rest(&self, pose: &Pose) -> Self {
        let turn = DMat3::from_quat(pose.rotation.as_dquat());
        Self { gradient: turn.transpose() * self.gradient, offset: self.at(pose.translation.as_dvec3()) }
    }

    /// The function's value.
    pub fn at(&self, point: DVec3) -> f64 {
        self.gradient.dot(point) + self.offset
    }

    /// The largest value in a box, given its centre and half its size.
    pub fn most(&self, center: DVec3, half: DVec3) -> f64 {
        self.at(center) + self.gradient.abs().dot(half)
    }
}

/// The elements of the light and of the blocker that lie in the event's plane.
#[derive(Clone, Copy, Debug)]
enum Touch {
    /// A corner of the light (or a point light) and an edge of the blocker.
    Corner { light: DVec3 },
    /// An edge of the light and a vertex of the blocker.
    Vertex { light: [DVec3; 2], vertex: DVec3 },
    /// An edge of the light and an edge of the blocker.
    Parallel { light: [DVec3; 2], edge: [DVec3; 2] },
}

/// The part of a plane in which the visible part of a light changes. It begins at the blocker and extends away from the
/// light without end.
#[derive(Clone, Copy, Debug)]
pub(super) struct Event {
    /// Unit normal of the plane, towards the blocker's side.
    pub normal: DVec3,
    /// The regions that it separates if no other object is in the way.
    pub kind: ShadowKind,
    /// See [`super::ShadowSegment::edge`].
    pub edge: u32,
    /// The faces at the blocker's edge, which cannot receive its boundary; [`NO_FACE`] if there are fewer than two.
    pub own_faces: [u32; 2],
    /// The blocker's vertex, whose faces cannot receive its boundary; `u32::MAX` if the blocker is an edge.
    pub own_vertex: u32,
    /// Length of the blocker's edge, metres; 0 for a vertex.
    pub length: f64,
    /// The middle of the blocker's edge, or its vertex.
    pub middle: DVec3,
    /// The limits of the part on both sides, for points in the plane.
    pub sides: [HalfSpace; 2],
    /// Distance of a point behind the blocker as a share of the distance between the light and the blocker.
    pub reach: HalfSpace,
    touch: Touch,
}

impl Event {
    /// Signed distance from the plane, metres; positive on the blocker's side.
    pub fn distance(&self, point: DVec3) -> f64 {
        self.normal.dot(point - self.middle)
    }

    /// A point of the light in the plane. It decides which side of a receiver faces the light.
    pub fn light(&self) -> DVec3 {
        match self.touch {
            Touch::Corner { light } => light,
            Touch::Vertex { light, .. } | Touch::Parallel { light, .. } => light[0].midpoint(light[1]),
        }
    }

    /// The points of the light and of the blocker that lie on a line with a point of the boundary.
    pub fn in_line(&self, point: DVec3) -> [DVec3; 2] {
        match self.touch {
            Touch::Corner { light } => [light, light + (point - light) / (1.0 + self.reach.at(point))],
            Touch::Vertex { light, vertex } => [self.on_light(light, point, vertex).0, vertex],
            Touch::Parallel { light: ends, edge } => {
                // The middle of the part of the light's edge that the point sees across the blocker's edge.
                let seen = edge.map(|end| self.on_light(ends, point, end).1.clamp(0.0, 1.0));
                let light = ends[0].lerp(ends[1], 0.5 * (seen[0] + seen[1]));
                let height = |p: DVec3| self.reach.gradient.dot(p - light);
                [light, light + (point - light) * (height(edge[0]) / height(point))]
            }
        }
    }

    /// A bound on the factor by which the true magnification of a distance, from the blocker to a receiver, exceeds `1
    /// + reach`; `None` if there is no useful bound.
    pub fn magnification(&self) -> Option<f64> {
        let Touch::Parallel { light, edge } = self.touch else { return Some(1.0) };
        // The blocker's lowest height above a point of the light's edge, in units of the height above the farthest
        // corner.
        let height = |light: DVec3| {
            let above = edge.map(|end| self.reach.gradient.dot(end - light));
            above[0].min(above[1])
        };
        let least = height(light[0]).min(height(light[1]));
        (least > 0.01).then(|| 1.0 / least)
    }

    /// The intersection of the line from `point` through `through`, both in the plane, with the line of the light's
    /// edge: its position, and its place along the edge as a share of the edge's length.
    fn on_light(&self, [start, end]: [DVec3; 2], point: DVec3, through: DVec3) -> (DVec3, f64) {
        let side = end - start;
        let up = self.normal.cross(side);
        let height = |p: DVec3| up.dot(p - start);
        let meet = point + (through - point) * (height(point) / (height(point) - height(through)));
        (meet, side.dot(meet - start) / side.length_squared())
    }
}

/// For each of some faces, the corners of a light that see its front.
pub(super) struct Facing {
    first: usize,
    /// For each face from `first` on, one bit per corner.
    bits: Vec<u8>,
}

impl Facing {
    fn of(&self, face: u32) -> u8 {
        self.bits[face as usize - self.first]
    }
}

/// Finds the events of the scene's edges and vertices.
pub(super) struct Blockers<'a> {
    mesh: &'a Mesh,
    around: &'a Around,
    /// [`COPLANAR`] in metres.
    tolerance: f64,
}

/// The edges at each vertex.
#[derive(Default)]
pub(super) struct Around {
    /// The edges at vertex v are `edges[first[v]..first[v + 1]]`.
    first: Vec<u32>,
    edges: Vec<u32>,
}

impl Around {
    pub fn new(mesh: &Mesh) -> Self {
        let mut first = vec![0; mesh.positions.len() + 1];
        let ends =
            || mesh.edges.iter().enumerate().flat_map(|(e, edge)| edge.vertices.map(|v| (v as usize, e)));
        ends().for_each(|(vertex, _)| first[vertex + 1] += 1);
        for vertex in 0..mesh.positions.len() {
            first[vertex + 1] += first[vertex];
        }
        let mut next = first.clone();
        let mut edges = vec![0; 2 * mesh.edges.len()];
        for (vertex, edge) in ends() {
            edges[next[vertex] as usize] = edge as u32;
            next[vertex] += 1;
        }
        Self { first, edges }
    }
}

impl<'a> Blockers<'a> {
    /// `around` must hold the edges at each vertex that is passed to [`Self::vertex_events`]; `reach` is the largest
    /// coordinate.
    pub fn new(mesh: &'a Mesh, around: &'a Around, reach: f64) -> Self {
        Self { mesh, around, tolerance: COPLANAR * reach }
    }

    fn position(&self, vertex: u32) -> DVec3 {
        self.mesh.positions[vertex as usize].as_dvec3()
    }

    /// For each of the given faces, the corners of a light that see its front.
    pub fn facing(&self, source: &Source, faces: Range<usize>) -> Facing {
        let first = faces.start;
        let faces = self.mesh.triangles[faces.clone()].par_iter().zip(&self.mesh.face_normals[faces]);
        let bits = faces
            .map(|(triangle, normal)| {
                let (base, normal) = (self.position(triangle[0]), normal.as_dvec3());
                let bits = source.corners.iter().enumerate();
                bits.map(|(corner, &light)| u8::from(normal.dot(light - base) > 0.0) << corner).sum()
            })
            .collect();
        Facing { first, bits }
    }

    /// The events of one edge with the corners of a light; `facing` must include the edge's faces.
    pub fn edge_events(&self, source: &Source, facing: &Facing, index: usize) -> Vec<Event> {
        let mut events = Vec::new();
        let edge = &self.mesh.edges[index];
        let [first, second] = edge.faces;
        // The corners from which the edge is a silhouette, one bit each.
        let outline = match second {
            NO_FACE => 0xF,
            // What is behind a culled back does not see the face.
            _ if second == first => !facing.of(first) & 0xF,
            _ => facing.of(first) ^ facing.of(second),
        };
        if outline == 0 {
            return events;
        }
        let ends = edge.vertices.map(|vertex| self.position(vertex));
        if ends.iter().all(|&end| source.in_front(end) <= self.tolerance) {
            return events;
        }
        for (corner, &light) in source.corners.iter().enumerate() {
            if outline >> corner & 1 == 0 {
                continue;
            }
            let Some(normal) = across(ends[0] - light, ends[1] - light) else { continue };
            let Some(blocker) = self.side_of_faces(normal, ends[0], edge.vertices, edge.faces) else {
                continue;
            };
            let normal = normal * blocker;
            let (kind, parallel) = if source.has_area() {
                let Some(found) = self.separation(source, corner, normal, ends[0]) else { continue };
                found
            } else {
                (ShadowKind::Hard, None)
            };
            let along = normal.cross(ends[1] - ends[0]);
            let beyond = |light: DVec3| HalfSpace::new(along / along.dot(ends[0] - light), ends[0]);
            let beside = |end: usize, light: DVec3| {
                HalfSpace::beside(normal, ends[end], ends[end] - light, ends[1 - end])
            };
            let (touch, sides, reach) = match parallel {
                None => (Touch::Corner { light }, [beside(0, light), beside(1, light)], beyond(light)),
                // The other corner has already given the same event.
                Some(other) if other < corner && outline >> other & 1 == 1 => continue,
                Some(other) => {
                    let lights = [light, source.corners[other]];
                    // At each end, of the lines through both corners, the one that gives the wider part.
                    let widest = |end: usize| {
                        let [one, other] = [0, 1].map(|i| (beside(end, lights[i]), lights[1 - i]));
                        if one.0.at(one.1) <= 0.0 { one.0 } else { other.0 }
                    };
                    let [near, far] = lights.map(beyond);
                    // The smaller of both values of `reach`: that of the corner farther away.
                    let nearest = near.gradient.length() <= far.gradient.length();
                    let touch = Touch::Parallel { light: lights, edge: ends };
                    (touch, [widest(0), widest(1)], if nearest { near } else { far })
                }
            };
            events.push(Event {
                normal,
                kind,
                edge: index as u32,
                own_faces: edge.faces,
                own_vertex: u32::MAX,
                length: ends[0].distance(ends[1]),
                middle: ends[0].midpoint(ends[1]),
                sides,
                reach,
                touch,
            });
        }
        events
    }

    /// The events of one vertex with the edges of a quad light.
    pub fn vertex_events(&self, source: &Source, index: usize) -> Vec<Event> {
        let mut events = Vec::new();
        let Around { first, edges } = self.around;
        let around = &edges[first[index] as usize..first[index + 1] as usize];
        let index = index as u32;
        let vertex = self.position(index);
        if source.in_front(vertex) <= self.tolerance || around.is_empty() {
            return events;
        }
        let count = source.corners.len();
        for corner in 0..count {
            let light = [corner, (corner + 1) % count].map(|corner| source.corners[corner]);
            let Some(normal) = across(vertex - light[0], light[1] - light[0]) else { continue };
            let side = |edge: u32| {
                let [a, b] = self.mesh.edges[edge as usize].vertices;
                normal.dot(self.position(if a == index { b } else { a }) - vertex)
            };
            let blocker = side(around[0]).signum();
            if around.iter().any(|&edge| side(edge) * blocker <= self.tolerance) {
                continue;
            }
            let normal = normal * blocker;
            let rest = normal.dot(source.corners[(corner + 2) % count] - light[0]);
            if rest.abs() <= self.tolerance {
                continue;
            }
            let along = normal.cross(light[1] - light[0]);
            let ends = light.map(|light| vertex + (vertex - light));
            let beside = |end: usize| HalfSpace::beside(normal, vertex, ends[end] - vertex, ends[1 - end]);
            events.push(Event {
                normal,
                kind: if rest > 0.0 { ShadowKind::Umbra } else { ShadowKind::Penumbra },
                edge: around[0],
                own_faces: [NO_FACE; 2],
                own_vertex: index,
                length: 0.0,
                middle: vertex,
                sides: [beside(0), beside(1)],
                reach: HalfSpace::new(along / along.dot(vertex - light[0]), vertex),
                touch: Touch::Vertex { light, vertex },
            });
        }
        events
    }

    /// The side of a plane through a silhouette edge on which the edge's faces lie: 1 or -1, or `None` if they lie in
    /// it.
    fn side_of_faces(&self, normal: DVec3, origin: DVec3, ends: [u32; 2], faces: [u32; 2]) -> Option<f64> {
        let third = |face: &u32| {
            let triangle = self.mesh.triangles.get(*face as usize)?;
            let vertex = triangle.iter().find(|vertex| !ends.contains(vertex))?;
            Some(normal.dot(self.position(*vertex) - origin))
        };
        let farthest = faces.iter().filter_map(third).max_by(|a, b| a.abs().total_cmp(&b.abs()))?;
        (farthest != 0.0).then(|| farthest.signum())
    }

    /// The regions that a plane through a corner of the light and an edge of the blocker separates, and another corner
    /// that lies in the plane, if any. The plane bounds the umbra if the rest of the light lies on the blocker's side,
    /// to which `normal` points, and the penumbra if it lies on the other side. `None` if the plane cuts or contains
    /// the light.
    fn separation(
        &self,
        source: &Source,
        corner: usize,
        normal: DVec3,
        origin: DVec3,
    ) -> Option<(ShadowKind, Option<usize>)> {
        let (mut with_blocker, mut against, mut parallel) = (false, false, None);
        for (other, &light) in source.corners.iter().enumerate().filter(|&(other, _)| other != corner) {
            let side = normal.dot(light - origin);
            if side > self.tolerance {
                with_blocker = true;
            } else if side < -self.tolerance {
                against = true;
            } else {
                parallel = Some(other);
            }
        }
        match (with_blocker, against) {
            (true, false) => Some((ShadowKind::Umbra, parallel)),
            (false, true) => Some((ShadowKind::Penumbra, parallel)),
            _ => None,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Of an edge of a light along the x axis and an edge of a blocker in the same plane, in units of a height of 2 m.
    fn event(edge: [[f64; 3]; 2]) -> Event {
        let touch = Touch::Parallel { light: [DVec3::ZERO, DVec3::X], edge: edge.map(DVec3::from) };
        Event {
            normal: DVec3::Z,
            kind: ShadowKind::Umbra,
            edge: 0,
            own_faces: [NO_FACE; 2],
            own_vertex: u32::MAX,
            length: 1.0,
            middle: DVec3::ZERO,
            sides: [HalfSpace::new(DVec3::X, DVec3::ZERO); 2],
            reach: HalfSpace::new(0.5 * DVec3::Y, DVec3::ZERO),
            touch,
        }
    }

    #[test]
    fn the_end_of_a_blocker_that_is_nearer_to_the_light_magnifies_more() {
        for edge in [[[0.0, 1.0, 0.0], [1.0, 2.0, 0.0]], [[0.0, 2.0, 0.0], [1.0, 1.0, 0.0]]] {
            assert_eq!(event(edge).magnification(), Some(2.0));
        }
        assert_eq!(event([[0.0, 2.0, 0.0], [1.0, 2.0, 0.0]]).magnification(), Some(1.0));
        for (height, expected) in [(0.015, None), (0.02, None), (0.03, Some(1.0 / 0.015))] {
            assert_eq!(event([[0.0, 2.0, 0.0], [1.0, height, 0.0]]).magnification(), expected, "{height}");
        }
        // Above the end of the light's edge that is nearer to the blocker, if both differ.
        for (slant, expected) in [(0.25, 1.0), (-0.25, 0.75)] {
            let reach = HalfSpace::new(DVec3::new(slant, 0.5, 0.0), DVec3::ZERO);
            let start = if slant > 0.0 { 1.0 } else { 0.0 };
            let slanted = event([[start, 2.0, 0.0], [start + 1.0, 2.0, 0.0]]);
            assert_eq!(Event { reach, ..slanted }.magnification(), Some(1.0 / expected));
        }
        let touch = Touch::Corner { light: DVec3::ZERO };
        assert_eq!(Event { touch, ..event([[0.0; 3]; 2]) }.magnification(), Some(1.0));
    }

    #[test]
    fn half_spaces_are_linear_functions() {
        let points = [[0.0, 0.0, 0.0], [1.0, -2.0, 0.5], [-3.0, 0.25, 4.0]].map(DVec3::from);
        let f = HalfSpace::new(DVec3::new(0.5, -1.0, 2.0), DVec3::new(1.0, 2.0, 3.0));
        let g = HalfSpace::new(DVec3::new(-0.25, 3.0, 1.0), DVec3::new(-1.0, 0.5, 2.0));
        assert_eq!(f.at(DVec3::new(1.0, 2.0, 3.0)), 0.0);
        for p in points {
            assert_eq!(f.at(p), 0.5 * p.x - p.y + 2.0 * p.z - 4.5);
            assert_eq!(f.plus(2.5).at(p), f.at(p) + 2.5);
            assert_eq!(f.times(-4.0).at(p), -4.0 * f.at(p));
            assert_eq!(f.and(&g).at(p), f.at(p) + g.at(p));
            let pose = Pose {
                rotation: glam::Quat::from_euler(glam::EulerRot::XYZ, 0.3, -0.8, 1.1),
                translation: glam::Vec3::new(2.0, -1.0, 0.5),
            };
            let posed = pose.rotation.as_dquat() * p + pose.translation.as_dvec3();
            assert!((f.at_rest(&pose).at(p) - f.at(posed)).abs() < 1e-5);
            // In a box of 2 x 4 x 6, the gradient leads to the corner (1, -2, 3).
            assert_eq!(f.most(p, DVec3::new(1.0, 2.0, 3.0)), f.at(p + DVec3::new(1.0, -2.0, 3.0)));
        }
        // In the plane z = 0, beside the line from (1, 1) along (3, 4), on either side.
        for (inside, expected) in [([0.0, 2.0], [1.0, -1.0]), ([2.0, 0.0], [-1.0, 1.0])] {
            let [inside, origin] = [inside, [1.0, 1.0]].map(|[x, y]| DVec3::new(x, y, 0.0));
            let beside = HalfSpace::beside(DVec3::Z, origin, DVec3::new(3.0, 4.0, 0.0), inside);
            let left = DVec3::new(-0.8, 0.6, 0.0);
            let found = [left, -left].map(|step| beside.at(origin + step + DVec3::new(3.0, 4.0, 0.0)));
            assert!((found[0] - expected[0]).abs() + (found[1] - expected[1]).abs() < 1e-9, "{found:?}");
        }
    }

    #[test]
    fn light_blocker_and_boundary_lie_on_a_line() {
        let near = |found: [DVec3; 2], expected: [[f64; 3]; 2]| {
            let expected = expected.map(DVec3::from);
            assert!(found[0].distance(expected[0]) + found[1].distance(expected[1]) < 1e-9, "{found:?}");
        };
        // A point light 2 m above a blocker, and a point 1 m below it.
        let light = DVec3::new(0.0, 4.0, 0.0);
        let reach = HalfSpace::new(-0.5 * DVec3::Y, 2.0 * DVec3::Y);
        let corner = Event { reach, touch: Touch::Corner { light }, ..event([[0.0; 3]; 2]) };
        near(corner.in_line(DVec3::new(3.0, 1.0, 0.0)), [[0.0, 4.0, 0.0], [2.0, 2.0, 0.0]]);
        assert_eq!(corner.light(), light);
        // Of the light from x = 0 to 1, the point (4, 2) sees the part from 0 on below (2, 1), and would see as far as x =
        // 2 below (3, 1): the middle of what there is.
        let parallel = event([[2.0, 1.0, 0.0], [3.0, 1.0, 0.0]]);
        near(parallel.in_line(DVec3::new(4.0, 2.0, 0.0)), [[0.5, 0.0, 0.0], [2.25, 1.0, 0.0]]);
        assert_eq!(parallel.light(), 0.5 * DVec3::X);
        let touch = Touch::Vertex { light: [DVec3::ZERO, DVec3::X], vertex: DVec3::new(2.0, 1.0, 0.0) };
        let vertex = Event { touch, ..parallel };
        near(vertex.in_line(DVec3::new(3.5, 2.0, 0.0)), [[0.5, 0.0, 0.0], [2.0, 1.0, 0.0]]);
        assert_eq!(vertex.light(), 0.5 * DVec3::X);
    }
}
