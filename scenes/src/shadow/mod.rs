//! Shadow boundaries as line segments on the surfaces that receive them (`algorithms.md` sections 2.1, 11.2 and 11.3).
//!
//! A boundary is where the view of a light changes. From a point light that happens behind the edges that are its
//! silhouettes: hard boundaries. From a quad light it happens behind a blocker's edge and a corner of the light, or a
//! blocker's vertex and an edge of the light; the outermost of these bound the umbra, where nothing of the light is
//! seen, and the penumbra, where part of it is. Each such pair spans a plane (`event`), the plane cuts
//! the receivers (`receivers`), and shadow rays decide which parts of the cuts are boundaries (`boundary`).
//!
//! Nothing here depends on a view. Left out: events of three edges (curved boundaries between the others), boundaries
//! within a penumbra, penumbrae wider than [`ShadowSettings::max_penumbra`], and edges where meshes interpenetrate.

mod boundary;
mod event;
mod receivers;

use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};

use glam::{DVec3, Vec3};
use rayon::prelude::*;

use crate::{Light, Scene, Tracer};
use boundary::Finder;
use event::{Blockers, Event, Source};
use receivers::Receivers;

/// What a shadow boundary separates.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum ShadowKind {
    /// Light from shadow of a point light.
    Hard,
    /// Places that see something of a quad light from places that see nothing.
    Umbra,
    /// Places that see all of a quad light from places that see part of it.
    Penumbra,
}

/// A piece of a shadow boundary.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ShadowSegment {
    /// Its ends on the receiver, metres.
    pub ends: [Vec3; 2],
    /// What it separates.
    pub kind: ShadowKind,
    /// How far across the boundary light turns into full shadow, metres on the receiver; 0 for hard boundaries. Along
    /// one segment it varies by less than 1.5 times; this is the largest, or that of a penumbra too narrow to matter.
    pub penumbra: f32,
    /// Index of the blocker's edge in the mesh, or of an edge at the blocker's vertex.
    pub edge: u32,
    /// Index of the receiver's triangle (one of them, where the segment runs over several in one plane).
    pub face: u32,
}

/// How shadow boundaries are found.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ShadowSettings {
    /// Most segments. Of more, the most important are kept: the long ones with a narrow penumbra.
    pub capacity: usize,
    /// How close to its blocker an object shows no boundary on itself, as a share of the light's distance from the
    /// blocker: what lies closer repeats the blocker's own edges. A tenth of it for the boundaries on other objects.
    pub contact: f32,
    /// Boundaries of wider penumbrae are left out; a share of the diagonal of the scene's bounds.
    pub max_penumbra: f32,
}

impl Default for ShadowSettings {
    fn default() -> Self {
        Self { capacity: 1 << 18, contact: 0.002, max_penumbra: 0.02 }
    }
}

/// The shadow boundaries of a scene.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ShadowSegments {
    /// By light, then by edge or vertex of the blocker.
    pub segments: Vec<ShadowSegment>,
    /// How many more were found than [`ShadowSettings::capacity`] allows.
    pub dropped: usize,
}

/// Blocker's edges or vertices between two calls of `progress`.
const PROGRESS_STEP: usize = 4096;

/// Finds the shadow boundaries of the tracer's scene on rayon's threads; the same for any number of them.
///
/// `progress` is told the finished share, in [0, 1), now and then and from any thread; when it returns `false`, the
/// search ends and gives `None`.
pub fn shadow_segments(
    tracer: &Tracer,
    settings: &ShadowSettings,
    progress: &(dyn Fn(f32) -> bool + Sync),
) -> Option<ShadowSegments> {
    let scene: &Scene = tracer.scene();
    if scene.lights.is_empty() {
        return Some(ShadowSegments::default());
    }
    let sources: Vec<Source> = scene.lights.iter().filter_map(Source::new).collect();
    let receivers = Receivers::new(scene);
    let blockers = Blockers::new(&scene.mesh, sources.iter().any(Source::has_area), reach_of(scene));
    let work = Work::new(sources.iter().map(|source| blockers.count(source)).sum(), progress);
    let mut segments = Vec::new();
    for source in &sources {
        let finder = Finder::new(tracer, &receivers, source, settings, reach_of(scene));
        let facing = blockers.facing(source);
        let find = |events: Vec<Event>| {
            let mut found = Vec::new();
            events.iter().for_each(|event| finder.find(event, &mut found));
            found
        };
        let edges = (0..scene.mesh.edges.len()).into_par_iter().filter(|_| work.step());
        segments.par_extend(edges.flat_map_iter(|edge| find(blockers.edge_events(source, &facing, edge))));
        if source.has_area() {
            let vertices = (0..scene.mesh.positions.len()).into_par_iter().filter(|_| work.step());
            segments
                .par_extend(vertices.flat_map_iter(|vertex| find(blockers.vertex_events(source, vertex))));
        }
    }
    if work.stopped.into_inner() {
        return None;
    }
    let dropped = segments.len().saturating_sub(settings.capacity);
    keep_important(&mut segments, settings.capacity, scene.bounds[0].distance(scene.bounds[1]));
    Some(ShadowSegments { segments, dropped })
}

/// The largest coordinate of the scene and its lights: what the rounding of rays is relative to.
fn reach_of(scene: &Scene) -> f64 {
    let lights = scene.lights.iter().map(|light| match *light {
        Light::Point { position, .. } => position.abs(),
        Light::Quad { corner, u, v, .. } => corner.abs() + u.abs() + v.abs(),
    });
    let points = scene.bounds.iter().map(|bound| bound.abs()).chain(lights);
    f64::from(points.map(Vec3::max_element).fold(f32::MIN_POSITIVE, f32::max))
}

/// Keeps the `capacity` most important segments in their order. A penumbra counts against a segment's length from a
/// thousandth of the scene's `diagonal` on.
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

/// How much is done, and whether to go on.
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

    /// Counts an edge or vertex; whether it is still wanted.
    fn step(&self) -> bool {
        let done = self.done.fetch_add(1, Ordering::Relaxed);
        if done.is_multiple_of(PROGRESS_STEP) && !(self.progress)(done as f32 / self.all as f32) {
            self.stopped.store(true, Ordering::Relaxed);
        }
        !self.stopped.load(Ordering::Relaxed)
    }
}

/// A direction of unit length across `a` and `b`; `None` where they are (nearly) parallel.
fn across(a: DVec3, b: DVec3) -> Option<DVec3> {
    let cross = a.cross(b);
    let length = cross.length();
    (length > 1e-9 * a.length() * b.length()).then(|| cross / length)
}

#[cfg(test)]
mod tests;
