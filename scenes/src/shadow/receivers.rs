//! The scene's triangles as receivers, under hierarchies of boxes that are searched with the planes of events: one of what
//! stands still, and one for each body, of its triangles at rest, to which planes are taken by the body's pose.

use std::{collections::HashMap, time::Duration};

use glam::{DVec3, Vec3};
use obvhs::{
    BvhBuildParams,
    aabb::Aabb,
    bvh2::{Bvh2, builder::build_bvh2},
};
use rayon::prelude::*;

use super::event::{Event, HalfSpace};
use crate::{Mesh, NO_FACE, Pose, Scene, Surface};

/// Adjacent receivers whose normals have a larger cosine are coplanar.
const ONE_PLANE: f64 = 1.0 - 1e-9;

/// Vertices of bodies lie within this share of the largest coordinate of where their pose takes them.
const ROUNDING: f64 = 1e-6;

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

/// Boxes around some faces, and how far from them their faces may be, metres: rounding of poses.
struct Boxes {
    tree: Bvh2,
    slack: f64,
}

impl Boxes {
    fn new(faces: Vec<u32>, corners: impl Fn(u32) -> [Vec3; 3] + Sync, slack: f64) -> Self {
        let bounds = |&face: &u32| Aabb::from_points(&corners(face).map(Into::into));
        let bounds: Vec<Aabb> = faces.par_iter().map(bounds).collect();
        let mut tree = build_bvh2(&bounds, BvhBuildParams::fast_build(), &mut Duration::default());
        tree.primitive_indices.iter_mut().for_each(|index| *index = faces[*index as usize]);
        Self { tree, slack }
    }
}

/// The part of space in which an event may meet its receivers, as the boxes see it.
struct Reached {
    plane: HalfSpace,
    sides: [HalfSpace; 2],
    reach: HalfSpace,
}

impl Reached {
    fn new(event: &Event) -> Self {
        let plane = HalfSpace::new(event.normal, event.middle);
        Self { plane, sides: event.sides, reach: event.reach }
    }

    fn at_rest(&self, pose: &Pose) -> Self {
        Self {
            plane: self.plane.at_rest(pose),
            sides: self.sides.each_ref().map(|side| side.at_rest(pose)),
            reach: self.reach.at_rest(pose),
        }
    }
}

/// All geometry that can receive a shadow, for all poses of a scene.
pub(super) struct Receivers {
    still: Boxes,
    bodies: Vec<Boxes>,
    /// Of each material: whether it scatters light, so that a shadow shows.
    scatters: Vec<bool>,
    /// Of each object: whether it has no border, so that nothing sees the backs of its faces.
    closed: Vec<bool>,
}

impl Receivers {
    /// Builds the hierarchies; takes about half a second for a million triangles. `reach` is the largest coordinate.
    pub fn new(scene: &Scene, reach: f64) -> Self {
        let mesh = &scene.mesh;
        let mut moves = vec![false; mesh.triangles.len()];
        let bodies = scene.bodies.iter().map(|body| {
            moves[body.faces.clone()].fill(true);
            let position = |vertex: u32| body.rest.positions[vertex as usize - body.vertices.start];
            let faces = body.faces.clone().map(|face| face as u32).collect();
            Boxes::new(faces, |face| mesh.triangles[face as usize].map(position), ROUNDING * reach)
        });
        let bodies = bodies.collect();
        let still = (0..mesh.triangles.len() as u32).filter(|&face| !moves[face as usize]).collect();
        let still = Boxes::new(still, |face| mesh.corners(face as usize), 0.0);
        let scatters = scene.materials.iter();
        let scatters = scatters
            .map(|m| m.surface != Surface::Mirror && (m.color != Vec3::ZERO || glossy(m.surface)))
            .collect();
        let objects = mesh.object.iter().map(|&object| object as usize + 1).max().unwrap_or(0);
        let mut closed = vec![true; objects];
        for edge in mesh.edges.iter().filter(|edge| edge.faces[1] == NO_FACE) {
            closed[mesh.object[edge.faces[0] as usize] as usize] = false;
        }
        Self { still, bodies, scatters, closed }
    }

    /// The cuts of an event's plane with the receivers behind the blocker, in no order of meaning, but always the same.
    /// `contact` is the least reach on the blocker's own object and on others.
    pub fn cut(&self, scene: &Scene, event: &Event, contact: [f64; 2], cuts: &mut Vec<Cut>) {
        let reached = Reached::new(event);
        self.cut_boxes(&self.still, &reached, scene, event, contact, cuts);
        for (boxes, pose) in self.bodies.iter().zip(&scene.poses) {
            self.cut_boxes(boxes, &reached.at_rest(pose), scene, event, contact, cuts);
        }
    }

    fn cut_boxes(
        &self,
        Boxes { tree, slack: rounding }: &Boxes,
        Reached { plane, sides, reach }: &Reached,
        scene: &Scene,
        event: &Event,
        contact: [f64; 2],
        cuts: &mut Vec<Cut>,
    ) {
        let Some(root) = tree.nodes.first() else { return };
        let mesh = &scene.mesh;
        let blocker = mesh.object[mesh.edges[event.edge as usize].faces[0] as usize];
        let mut stack = vec![*root];
        while let Some(node) = stack.pop() {
            let bounds = node.aabb();
            let center = Vec3::from((bounds.min + bounds.max) * 0.5).as_dvec3();
            // Rounding of the centre in f32 must not lose what touches the box from outside.
            let slack = 1e-6 * (bounds.max.abs().max(bounds.min.abs())).max_element();
            let half = Vec3::from((bounds.max - bounds.min) * 0.5 + slack).as_dvec3() + *rounding;
            if plane.at(center).abs() > plane.gradient.abs().dot(half)
                || sides.iter().any(|side| side.most(center, half) < 0.0)
                || reach.most(center, half) < contact[0].min(contact[1])
            {
                continue;
            }
            let first = node.first_index as usize;
            if node.is_leaf() {
                let faces = &tree.primitive_indices[first..first + node.prim_count as usize];
                cuts.extend(faces.iter().filter_map(|&face| {
                    let own = mesh.object[face as usize] == blocker;
                    self.cut_face(mesh, event, face, contact[usize::from(!own)])
                }));
            } else {
                stack.extend([tree.nodes[first + 1], tree.nodes[first]]);
            }
        }
    }

    fn cut_face(&self, mesh: &Mesh, event: &Event, face: u32, contact: f64) -> Option<Cut> {
        let index = face as usize;
        let triangle = mesh.triangles[index];
        if event.own_faces.contains(&face)
            || triangle.contains(&event.own_vertex)
            || !self.scatters[mesh.material[index] as usize]
        {
            return None;
        }
        // From the lower to the higher vertex along each side, so that neighbours find the same point.
        let mut sorted = triangle;
        sorted.sort_unstable();
        let corners = sorted.map(|vertex| mesh.positions[vertex as usize].as_dvec3());
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

        let front = mesh.face_normals[index].as_dvec3();
        let towards_light = front.dot(event.light() - ends[0]);
        let open = !self.closed[mesh.object[index] as usize];
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
