//! Cuts the scene's triangles, the receivers, with the planes of events. Bounding volume hierarchies find the
//! triangles: one holds the static geometry, and each body has one of its triangles at rest. The body's pose transforms
//! planes to it.

use std::{collections::HashMap, time::Duration};

use glam::{DVec3, Vec3};
use obvhs::{
    BvhBuildParams,
    aabb::Aabb,
    bvh2::{Bvh2, builder::build_bvh2},
};
use rayon::prelude::*;

use super::{
    boundary::Effort,
    event::{Event, HalfSpace},
};
use crate::boxes::make_unlike;
use crate::{Material, Mesh, NO_FACE, Pose, Scene};

/// Adjacent receivers whose normals have a larger cosine are coplanar.
const ONE_PLANE: f64 = 1.0 - 1e-9;

/// Maximum rounding error of a body's posed vertices, as a share of the largest coordinate.
const ROUNDING: f64 = 1e-6;

/// The [`Effort`] of cutting a triangle, which takes so many times as long as to test it with a ray.
const CUT: u64 = 16;

/// How much boxes may grow that are made unlike, as a share of all boxes' size.
const UNLIKE: f32 = 1e-6;

/// The line in which an event's plane cuts a receiver.
#[derive(Clone, Copy, Debug)]
pub(super) struct Cut {
    /// Points on the receiver, in the order of the event's sides.
    pub ends: [DVec3; 2],
    /// The receiver's unit normal on the light's side.
    pub normal: DVec3,
    /// Index of the receiver's triangle.
    pub face: u32,
}

/// A bounding volume hierarchy of some faces.
struct Boxes {
    tree: Bvh2,
    /// Maximum distance of a face from its box, metres: the rounding error of poses.
    slack: f64,
}

impl Boxes {
    fn new(faces: Vec<u32>, corners: impl Fn(u32) -> [Vec3; 3] + Sync, slack: f64) -> Self {
        let bounds = |&face: &u32| Aabb::from_points(&corners(face).map(Into::into));
        let mut bounds: Vec<Aabb> = faces.par_iter().map(bounds).collect();
        let all = bounds.iter().fold(Aabb::empty(), |all, bounds| all.union(bounds));
        make_unlike(&mut bounds, UNLIKE * all.diagonal().max_element().max(0.0));
        let mut tree = build_bvh2(&bounds, BvhBuildParams::fast_build(), &mut Duration::default());
        tree.primitive_indices.iter_mut().for_each(|index| *index = faces[*index as usize]);
        Self { tree, slack }
    }
}

/// The part of space in which an event may meet its receivers, in the coordinates of a hierarchy.
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

/// An event whose plane cuts the receivers of a scene.
pub(super) struct Cutting<'a> {
    pub scene: &'a Scene,
    pub event: &'a Event,
    /// The minimum of the event's `reach` on the blocker's own object, and a smaller one on others.
    pub contact: [f64; 2],
    pub effort: &'a Effort,
}

/// All geometry that can receive a shadow, for all poses of a scene.
pub(super) struct Receivers {
    still: Boxes,
    bodies: Vec<Boxes>,
    /// For each material: true if it scatters light, so that shadows on it are visible.
    scatters: Vec<bool>,
    /// For each object: true if it has no border, so that the backs of its faces are never visible.
    closed: Vec<bool>,
}

impl Receivers {
    /// Builds the hierarchies, which takes about half a second for a million triangles. `reach` is the largest
    /// coordinate.
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
        let scatters = scene.materials.iter().map(Material::shows_shadows).collect();
        let objects = mesh.object.iter().map(|&object| object as usize + 1).max().unwrap_or(0);
        let mut closed = vec![true; objects];
        for edge in mesh.edges.iter().filter(|edge| edge.faces[1] == NO_FACE) {
            closed[mesh.object[edge.faces[0] as usize] as usize] = false;
        }
        Self { still, bodies, scatters, closed }
    }

    /// Appends the cuts of an event's plane with the receivers behind the blocker, in a deterministic order, until the
    /// effort is spent.
    pub fn cut(&self, of: &Cutting, cuts: &mut Vec<Cut>) {
        let reached = Reached::new(of.event);
        self.cut_boxes(&self.still, &reached, of, cuts);
        for (boxes, pose) in self.bodies.iter().zip(&of.scene.poses) {
            self.cut_boxes(boxes, &reached.at_rest(pose), of, cuts);
        }
    }

    fn cut_boxes(
        &self,
        Boxes { tree, slack: rounding }: &Boxes,
        Reached { plane, sides, reach }: &Reached,
        &Cutting { scene, event, contact, effort }: &Cutting,
        cuts: &mut Vec<Cut>,
    ) {
        let Some(root) = tree.nodes.first() else { return };
        let mesh = &scene.mesh;
        let blocker = mesh.object[mesh.edges[event.edge as usize].faces[0] as usize];
        let mut stack = vec![*root];
        while let Some(node) = stack.pop().filter(|_| !effort.is_spent()) {
            let bounds = node.aabb();
            let center = Vec3::from((bounds.min + bounds.max) * 0.5).as_dvec3();
            // The f32 rounding of the centre must not exclude what just touches the box.
            let slack = 1e-6 * (bounds.max.abs().max(bounds.min.abs())).max_element();
            let half = Vec3::from((bounds.max - bounds.min) * 0.5 + slack).as_dvec3() + *rounding;
            if plane.at(center).abs() > plane.gradient.abs().dot(half)
                || sides.iter().any(|side| side.most(center, half) < 0.0)
                || reach.most(center, half) < contact[1]
            {
                continue;
            }
            let first = node.first_index as usize;
            if node.is_leaf() {
                let faces = &tree.primitive_indices[first..first + node.prim_count as usize];
                cuts.extend(faces.iter().take_while(|_| effort.spend(CUT)).filter_map(|&face| {
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
        // Sides run from the lower to the higher vertex index, so that neighbouring triangles compute the same point.
        let mut sorted = triangle;
        sorted.sort_unstable();
        let corners = sorted.map(|vertex| mesh.positions[vertex as usize].as_dvec3());
        let distances = corners.map(|corner| event.distance(corner));
        let crossing = |[from, to]: [usize; 2]| {
            let [a, b] = [distances[from], distances[to]];
            // A corner in the plane counts as in front of it, so that only one of two neighbours has a side in the
            // plane.
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

/// The part of a line on which a linear function is positive, given its values at both ends.
fn clip([start, end]: [DVec3; 2], at_start: f64, at_end: f64) -> Option<[DVec3; 2]> {
    let zero = || start.lerp(end, at_start / (at_start - at_end));
    match (at_start > 0.0, at_end > 0.0) {
        (true, true) => Some([start, end]),
        (true, false) => Some([start, zero()]),
        (false, true) => Some([zero(), end]),
        (false, false) => None,
    }
}

/// Sorts the cuts and joins those that continue each other in one plane, such as the cuts of a floor's two triangles.
pub(super) fn join(cuts: &mut Vec<Cut>, event: &Event) {
    let key = |point: DVec3| point.to_array().map(f64::to_bits);
    cuts.sort_by(|a, b| {
        let [a, b] = [a, b].map(|cut| event.sides[0].at(cut.ends[0]));
        a.total_cmp(&b)
    });
    // From points to the cuts that end there. Neighbouring triangles compute the same bits for a point.
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
