//! The search for a scene's shadow boundaries, and its incremental update after motion.
//!
//! An event's boundaries depend on its light, its blocker, and the geometry in the region of its rays (`region`). So a
//! search keeps all events with their boundaries. After bodies have moved, it searches again the events of their own
//! edges and lights, and all other events whose region contains a moved body, in its old or new pose, as the body may
//! be (or have been) a receiver, or an obstacle between light and receiver. All other events are unchanged, bit for
//! bit.
//!
//! The effort for one event is limited. It is ample unless thousands of triangles lie in one place, where the search would
//! not end otherwise.

use std::{
    ops::Range,
    sync::{
        Arc,
        atomic::{AtomicBool, AtomicUsize, Ordering},
    },
};

use glam::Vec3;
use rayon::prelude::*;

use super::{
    ShadowSegment, ShadowSegments, ShadowSettings,
    boundary::Finder,
    event::{Around, Blockers, Event, Source},
    receivers::Receivers,
    region::{PosedBox, Region},
};
use crate::{Body, Light, Pose, Scene, Tracer};

/// Number of edges or vertices that are searched between two calls of `progress`.
const PROGRESS_STEP: usize = 1024;

/// The effort that is enough for each event of a usual scene.
const AMPLE: u64 = 1 << 16;

/// The number of edges whose effort is measured to learn whether a scene is a usual one.
const MEASURED: usize = 1024;

/// Statistics of the last search, in events: pairs of a light and a blocker's edge or vertex that may cast a boundary.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct ShadowWork {
    /// Searched because their light or their blocker has moved, or for the first time.
    pub own: usize,
    /// Searched because a moved body may be (or have been) one of their receivers, or in front of one.
    pub touched: usize,
    /// Not searched.
    pub kept: usize,
}

/// Finds the shadow boundaries of a scene in one pose after another. It keeps the last result and searches only the
/// events that may have changed. The result equals that of a full search, unless boundaries are missing for lack of
/// [`ShadowSettings::effort`]: then it depends on the pose of the first search which.
pub struct ShadowSearch {
    settings: ShadowSettings,
    known: Option<Known>,
    work: ShadowWork,
}

/// The state of a scene after a search.
struct Known {
    /// Identifies the scene, in any pose.
    bodies: Arc<Vec<Body>>,
    receivers: Receivers,
    around: Around,
    reach: f64,
    /// The most effort for one event.
    effort: u64,
    /// The poses of the last search; empty before the first.
    poses: Vec<Pose>,
    lights: Vec<Light>,
    /// The events of each light, ordered by [`Found::place`].
    found: Vec<Vec<Found>>,
}

/// An event, and the boundaries that it causes.
struct Found {
    /// Index of the blocker's edge, or index of its vertex plus the number of edges.
    place: usize,
    event: Event,
    segments: Vec<ShadowSegment>,
    /// Whether all of them were found.
    is_complete: bool,
}

/// The bodies that have moved since the last search.
struct Moved<'a> {
    bodies: Vec<&'a Body>,
    /// Their boxes in the old and in the new poses.
    boxes: Vec<PosedBox>,
}

impl ShadowSearch {
    /// A search that has no results yet.
    pub fn new(settings: ShadowSettings) -> Self {
        Self { settings, known: None, work: ShadowWork::default() }
    }

    /// Statistics of the last search.
    pub fn work(&self) -> ShadowWork {
        self.work
    }

    /// Finds the shadow boundaries of the tracer's scene in its present pose, on rayon's threads. The result does not
    /// depend on the number of threads. The search is a full one if the last scene was another one, not just in another
    /// pose.
    ///
    /// `progress` is called from time to time, from any thread, with the finished share, in [0, 1). If it returns
    /// `false`, the search ends and returns `None`.
    pub fn find(
        &mut self,
        tracer: &Tracer,
        progress: &(dyn Fn(f32) -> bool + Sync),
    ) -> Option<ShadowSegments> {
        let scene: &Scene = tracer.scene();
        self.work = ShadowWork::default();
        if scene.lights.is_empty() {
            return Some(ShadowSegments::default());
        }
        // Taken out of `self`, so that a search that ends early leaves no partial state.
        let known = self.known.take().filter(|known| Arc::ptr_eq(&known.bodies, &scene.bodies));
        let mut known = known.unwrap_or_else(|| Known::new(tracer, &self.settings));
        let moved = Moved::new(scene, &known.poses);
        let mesh = &scene.mesh;
        let work = Work::new(scene.lights.len() * (mesh.edges.len() + mesh.positions.len()), progress);
        let blockers = Blockers::new(mesh, &known.around, known.reach);
        for (index, (light, found)) in scene.lights.iter().zip(&mut known.found).enumerate() {
            let Some(source) = Source::new(light) else { continue };
            let search = OfLight {
                scene,
                finder: Finder::new(tracer, &known.receivers, &source, &self.settings, known.reach),
                source: &source,
                blockers: &blockers,
                reach: known.reach,
                effort: known.effort,
                work: &work,
            };
            if known.lights.get(index) == Some(light) {
                let touched = search.again(found, &moved);
                let own = found.iter().filter(|found| moved.owns(found.place, mesh.edges.len())).count();
                self.work.own += own;
                self.work.touched += touched;
                self.work.kept += found.len() - own - touched;
            } else {
                *found = search.all();
                self.work.own += found.len();
            }
        }
        if work.stopped.into_inner() {
            return None;
        }
        let found = || known.found.iter().flatten();
        let mut segments: Vec<_> = found().flat_map(|found| &found.segments).copied().collect();
        let incomplete = found().filter(|found| !found.is_complete).count();
        if !scene.bodies.is_empty() {
            known.poses.clone_from(&scene.poses);
            known.lights.clone_from(&scene.lights);
            self.known = Some(known);
        }
        let dropped = segments.len().saturating_sub(self.settings.capacity);
        keep_important(&mut segments, self.settings.capacity, scene.bounds[0].distance(scene.bounds[1]));
        Some(ShadowSegments { segments, dropped, incomplete })
    }
}

impl Known {
    fn new(tracer: &Tracer, settings: &ShadowSettings) -> Self {
        let scene: &Scene = tracer.scene();
        let reach = reach_of(scene);
        let quads = scene.lights.iter().any(|light| matches!(light, Light::Quad { .. }));
        let mut known = Self {
            bodies: scene.bodies.clone(),
            receivers: Receivers::new(scene, reach),
            around: if quads { Around::new(&scene.mesh) } else { Around::default() },
            reach,
            effort: settings.effort / (scene.lights.len() * scene.mesh.edges.len()).max(1) as u64,
            poses: Vec::new(),
            lights: Vec::new(),
            found: scene.lights.iter().map(|_| Vec::new()).collect(),
        };
        if known.effort < AMPLE && known.is_usual(tracer, settings) {
            known.effort = AMPLE;
        }
        known
    }

    /// Whether all events together take less than the most effort, by those of some edges.
    fn is_usual(&self, tracer: &Tracer, settings: &ShadowSettings) -> bool {
        let scene: &Scene = tracer.scene();
        let mesh = &scene.mesh;
        let blockers = Blockers::new(mesh, &self.around, self.reach);
        let sources: Vec<Source> = scene.lights.iter().filter_map(Source::new).collect();
        let each = (MEASURED / sources.len().max(1)).max(1).min(mesh.edges.len());
        let spent = sources.iter().map(|source| {
            let finder = Finder::new(tracer, &self.receivers, source, settings, self.reach);
            let facing = &blockers.facing(source, 0..mesh.triangles.len());
            let edges = (0..each).into_par_iter().map(|index| index * mesh.edges.len() / each);
            let events = edges.flat_map_iter(|edge| blockers.edge_events(source, facing, edge));
            events.map(|event| AMPLE - finder.find(&event, AMPLE, &mut Vec::new())).sum::<u64>()
        });
        let spent: u64 = spent.sum();
        spent.saturating_mul((mesh.edges.len() / each.max(1)) as u64) <= settings.effort
    }
}

impl<'a> Moved<'a> {
    fn new(scene: &'a Scene, before: &[Pose]) -> Self {
        let poses = before.iter().zip(&scene.poses);
        let moved: Vec<_> = scene.bodies.iter().zip(poses).filter(|(_, (was, is))| was != is).collect();
        Self {
            boxes: moved
                .iter()
                .flat_map(|(body, (was, is))| [PosedBox::new(body, was), PosedBox::new(body, is)])
                .flatten()
                .collect(),
            bodies: moved.into_iter().map(|(body, _)| body).collect(),
        }
    }

    /// Returns true if a [`Found::place`] belongs to one of the bodies; `edges` is the mesh's number of edges.
    fn owns(&self, place: usize, edges: usize) -> bool {
        let of = |body: &&Body| match place.checked_sub(edges) {
            Some(vertex) => body.vertices.contains(&vertex),
            None => body.edges.contains(&place),
        };
        self.bodies.iter().any(of)
    }
}

/// The search for one light's boundaries.
struct OfLight<'a> {
    scene: &'a Scene,
    source: &'a Source,
    blockers: &'a Blockers<'a>,
    finder: Finder<'a>,
    reach: f64,
    effort: u64,
    work: &'a Work<'a>,
}

impl OfLight<'_> {
    /// Searches all events.
    fn all(&self) -> Vec<Found> {
        let mesh = &self.scene.mesh;
        let mut found = Vec::new();
        self.search(0..mesh.edges.len(), 0..mesh.positions.len(), 0..mesh.triangles.len(), &mut found);
        found
    }

    /// Searches the events that motion may have changed. Returns the number of those that do not belong to moved
    /// bodies.
    fn again(&self, found: &mut Vec<Found>, moved: &Moved) -> usize {
        if moved.bodies.is_empty() {
            return 0;
        }
        let edges = self.scene.mesh.edges.len();
        found.retain(|found| !moved.owns(found.place, edges));
        let touched = found.par_iter_mut().filter(|_| self.work.step()).filter_map(|found| {
            let region = Region::new(&found.event, self.source, self.reach);
            let touches = |region: Region| moved.boxes.iter().any(|posed| region.touches(posed));
            region.is_none_or(touches).then(|| found.search(&self.finder, self.effort))
        });
        let touched = touched.count();
        for body in &moved.bodies {
            self.search(body.edges.clone(), body.vertices.clone(), body.faces.clone(), found);
        }
        // The sort is stable, so that the events of one place keep their order.
        found.par_sort_by_key(|found| found.place);
        touched
    }

    /// Appends the events of the given edges and vertices, with their boundaries.
    fn search(
        &self,
        edges: Range<usize>,
        vertices: Range<usize>,
        faces: Range<usize>,
        into: &mut Vec<Found>,
    ) {
        let moves = !self.scene.bodies.is_empty();
        let find = |place: usize, events: Vec<Event>| {
            events.into_iter().filter_map(move |event| {
                let mut found = Found { place, event, segments: Vec::new(), is_complete: true };
                found.search(&self.finder, self.effort);
                // Events without boundaries matter only if bodies may move into their regions.
                (moves || !found.segments.is_empty() || !found.is_complete).then_some(found)
            })
        };
        let facing = &self.blockers.facing(self.source, faces);
        let edges = edges.into_par_iter().filter(|_| self.work.step());
        let of_edge = |edge| find(edge, self.blockers.edge_events(self.source, facing, edge));
        into.par_extend(edges.flat_map_iter(of_edge));
        if self.source.has_area() {
            let first = self.scene.mesh.edges.len();
            let vertices = vertices.into_par_iter().filter(|_| self.work.step());
            let of_vertex = |vertex| find(first + vertex, self.blockers.vertex_events(self.source, vertex));
            into.par_extend(vertices.flat_map_iter(of_vertex));
        }
    }
}

impl Found {
    /// Finds the boundaries anew.
    fn search(&mut self, finder: &Finder, effort: u64) {
        self.segments.clear();
        self.is_complete = finder.find(&self.event, effort, &mut self.segments) > 0;
    }
}

/// The largest coordinate of the scene and its lights in any frame. Rounding errors of rays are proportional to it.
fn reach_of(scene: &Scene) -> f64 {
    let still = |index: &usize| !scene.bodies.iter().any(|body| body.lights.contains(index));
    let lights = (0..scene.lights.len()).filter(still).map(|index| match scene.lights[index] {
        Light::Point { position, .. } | Light::Spot { position, .. } => position.abs(),
        Light::Quad { corner, u, v, .. } => corner.abs() + u.abs() + v.abs(),
    });
    let corners = |light: &Light| match *light {
        Light::Point { position, .. } | Light::Spot { position, .. } => vec![position],
        Light::Quad { corner, u, v, .. } => vec![corner, corner + u, corner + u + v, corner + v],
    };
    let moving = scene.bodies.iter().filter(|body| !body.lights.is_empty()).flat_map(|body| {
        let points: Vec<Vec3> = body.rest.lights.iter().flat_map(corners).collect();
        body.motion.swept(&points).map(Vec3::abs)
    });
    let points = scene.bounds.iter().map(|bound| bound.abs()).chain(lights).chain(moving);
    f64::from(points.map(Vec3::max_element).fold(f32::MIN_POSITIVE, f32::max))
}

/// Keeps the `capacity` most important segments, in their order. The importance of a segment is its length, divided by
/// the sum of its penumbra's width and a thousandth of the scene's `diagonal`.
fn keep_important(segments: &mut Vec<ShadowSegment>, capacity: usize, diagonal: f32) {
    if segments.len() <= capacity {
        return;
    }
    let importance = |segment: &ShadowSegment| {
        let [a, b] = segment.ends;
        a.distance(b) / (segment.penumbra + 1e-3 * diagonal)
    };
    let mut order: Vec<usize> = (0..segments.len()).collect();
    order.par_sort_by(|&a, &b| importance(&segments[b]).total_cmp(&importance(&segments[a])));
    order.truncate(capacity);
    order.par_sort_unstable();
    *segments = order.into_iter().map(|index| segments[index]).collect();
}

/// The progress of a search, and whether `progress` has stopped it.
struct Work<'a> {
    done: AtomicUsize,
    all: usize,
    progress: &'a (dyn Fn(f32) -> bool + Sync),
    stopped: AtomicBool,
}

impl<'a> Work<'a> {
    fn new(all: usize, progress: &'a (dyn Fn(f32) -> bool + Sync)) -> Self {
        Self { done: AtomicUsize::new(0), all, progress, stopped: AtomicBool::new(false) }
    }

    /// Counts an edge or vertex. Returns false if the search must stop.
    fn step(&self) -> bool {
        let done = self.done.fetch_add(1, Ordering::Relaxed);
        if done.is_multiple_of(PROGRESS_STEP) && !(self.progress)(done as f32 / self.all as f32) {
            self.stopped.store(true, Ordering::Relaxed);
        }
        !self.stopped.load(Ordering::Relaxed)
    }
}

#[cfg(test)]
mod tests;
