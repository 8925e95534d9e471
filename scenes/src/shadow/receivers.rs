//! The scene's triangles as receivers, under a hierarchy of boxes that is searched with the planes of events.

use std::{collections::HashMap, time::Duration};

use glam::{DVec3, Vec3};
use obvhs::{
    BvhBuildParams,
    aabb::Aabb,
    bvh2::{Bvh2, builder::build_bvh2},
};
use rayon::prelude::*;

use super::event::Event;
use crate::{Mesh, NO_FACE, Scene, Surface};

/// Receivers whose normals have a larger cosine are in one plane where they meet.
const ONE_PLANE: f64 = 1.0 - 1e-9;

/// The line in which an event's plane cuts a receiver.
#[derive(Clone, Copy, Debug)]
pub(super) struct Cut {
    /// On the receiver, ordered like the event's sides.
    pub ends: [DVec3; 2],
    /// The receiver's unit normal on the light's side.
    pub normal: DVec3,
    /// The receiver.
    pub face: u32,
}

/// Everything that can receive a shadow.
pub(super) struct Receivers<'a> {
    mesh: &'a Mesh,
    boxes: Bvh2,
    /// Of each material: whether it scatters light, so that a shadow shows.
    scatters: Vec<bool>,
    /// Of each object: whether it has no border, so that nothing sees the backs of its faces.
    closed: Vec<bool>,
}

impl<'a> Receivers<'a> {
    /// Builds the hierarchy; takes about half a second for a million triangles.
    pub fn new(scene: &'a Scene) -> Self {
        let mesh = &scene.mesh;
        let bounds = |face: usize| {
            let corners = mesh.corners(face).map(Into::into);
            Aabb::from_points(&corners)
        };
        let bounds: Vec<Aabb> = (0..mesh.triangles.len()).into_par_iter().map(bounds).collect();
        let boxes = build_bvh2(&bounds, BvhBuildParams::fast_build(), &mut Duration::default());
        let scatters = scene.materials.iter();
        let scatters = scatters
            .map(|m| m.surface != Surface::Mirror && (m.color != Vec3::ZERO || glossy(m.surface)))
            .collect();
        let objects = mesh.object.iter().map(|&object| object as usize + 1).max().unwrap_or(0);
        let mut closed = vec![true; objects];
        for edge in mesh.edges.iter().filter(|edge| edge.faces[1] == NO_FACE) {
            closed[mesh.object[edge.faces[0] as usize] as usize] = false;
        }
        Self { mesh, boxes, scatters, closed }
    }

    /// The cuts of an event's plane with the receivers behind the blocker, in no order of meaning, but always the same.
    /// `contact` is the least reach on the blocker's own object and on others.
    pub fn cut(&self, event: &Event, contact: [f64; 2], cuts: &mut Vec<Cut>) {
        let Some(root) = self.boxes.nodes.first() else { return };
        let blocker = self.mesh.object[self.mesh.edges[event.edge as usize].faces[0] as usize];
        let mut stack = vec![*root];
        while let Some(node) = stack.pop() {
            let bounds = node.aabb();
            let center = Vec3::from((bounds.min + bounds.max) * 0.5).as_dvec3();
            // Rounding of the centre in f32 must not lose what touches the box from outside.
            let slack = 1e-6 * (bounds.max.abs().max(bounds.min.abs())).max_element();
            let half = Vec3::from((bounds.max - bounds.min) * 0.5 + slack).as_dvec3();
            if event.distance(center).abs() > event.normal.abs().dot(half)
                || event.sides.iter().any(|side| side.most(center, half) < 0.0)
                || event.reach.most(center, half) < contact[0].min(contact[1])
            {
                continue;
            }
            let first = node.first_index as usize;
            if node.is_leaf() {
                let faces = &self.boxes.primitive_indices[first..first + node.prim_count as usize];
                cuts.extend(faces.iter().filter_map(|&face| {
                    let own = self.mesh.object[face as usize] == blocker;
                    self.cut_face(event, face, contact[usize::from(!own)])
                }));
            } else {
                stack.extend([self.boxes.nodes[first + 1], self.boxes.nodes[first]]);
            }
        }
    }

    fn cut_face(&self, event: &Event, face: u32, contact: f64) -> Option<Cut> {
        let index = face as usize;
        let triangle = self.mesh.triangles[index];
        if event.own_faces.contains(&face)
            || triangle.contains(&event.own_vertex)
            || !self.scatters[self.mesh.material[index] as usize]
        {
            return None;
        }
        // From the lower to the higher vertex along each side, so that neighbours find the same point.
        let mut sorted = triangle;
        sorted.sort_unstable();
        let corners = sorted.map(|vertex| self.mesh.positions[vertex as usize].as_dvec3());
        let distances = corners.map(|corner| event.distance(corner));
        let crossing = |[from, to]: [usize; 2]| {
            let [a, b] = [distances[from], distances[to]];
            // A corner in the plane counts as in front of it: one of two neighbours has the side.
            ((a >= 0.0) != (b >= 0.0)).then(|| corners[from].lerp(corners[to], a / (a - b)))
        };
        let mut crossings = [[0, 1], [0, 2], [1, 2]].into_iter().filter_map(crossing);
        let mut ends = [crossings.next()?, crossings.next()?];
        if event.sides[0].at(ends[0]) > event.sides[0].at(ends[1]) {
            ends.swap(0, 1);
        }
        for side in event.sides {
            ends = clip(ends, side.at(ends[0]), side.at(ends[1]))?;
        }
        ends = clip(ends, event.reach.at(ends[0]) - contact, event.reach.at(ends[1]) - contact)?;

        let front = self.mesh.face_normals[index].as_dvec3();
        let towards_light = front.dot(event.light() - ends[0]);
        let open = !self.closed[self.mesh.object[index] as usize];
        let normal = if towards_light > 0.0 { front } else { -front };
        (towards_light > 0.0 || open && towards_light < 0.0).then_some(Cut { ends, normal, face })
    }
}

/// The part of a line where a linear function with these values at its ends is positive.
fn clip([start, end]: [DVec3; 2], at_start: f64, at_end: f64) -> Option<[DVec3; 2]> {
    let zero = || start.lerp(end, at_start / (at_start - at_end));
    match (at_start > 0.0, at_end > 0.0) {
        (true, true) => Some([start, end]),
        (true, false) => Some([start, zero()]),
        (false, true) => Some([zero(), end]),
        (false, false) => None,
    }
}

fn glossy(surface: Surface) -> bool {
    matches!(surface, Surface::Glossy { .. })
}

/// Joins cuts that continue each other in one plane, such as those of a floor's two triangles; sorts them on the way.
pub(super) fn join(cuts: &mut Vec<Cut>, event: &Event) {
    let key = |point: DVec3| point.to_array().map(f64::to_bits);
    cuts.sort_by(|a, b| {
        let [a, b] = [a, b].map(|cut| event.sides[0].at(cut.ends[0]));
        a.total_cmp(&b)
    });
    // Which cut ends at a point. Neighbouring triangles give the same bits there.
    let mut ending: HashMap<[u64; 3], usize> = HashMap::with_capacity(cuts.len());
    let mut joined: Vec<Cut> = Vec::with_capacity(cuts.len());
    for cut in cuts.drain(..) {
        let before = ending.remove(&key(cut.ends[0]));
        match before.filter(|&before| joined[before].normal.dot(cut.normal) > ONE_PLANE) {
            Some(before) => {
                joined[before].ends[1] = cut.ends[1];
                ending.insert(key(cut.ends[1]), before);
            }
            None => {
                ending.insert(key(cut.ends[1]), joined.len());
                joined.push(cut);
            }
        }
    }
    *cuts = joined;
}
