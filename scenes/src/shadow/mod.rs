//! Shadow boundaries as line segments on the surfaces that receive them (`algorithms.md` sections 2.1, 11.2 and 11.3).
//!
//! A boundary is where the view of a light changes. From a point light that happens behind the edges that are its
//! silhouettes: hard boundaries. From a quad light it happens behind a blocker's edge and a corner of the light, or a
//! blocker's vertex and an edge of the light; the outermost of these bound the umbra, where nothing of the light is
//! seen, and the penumbra, where part of it is. Each such pair spans a plane (`event`), the plane cuts
//! the receivers (`receivers`), and shadow rays decide which parts of the cuts are boundaries (`boundary`).
//!
//! Nothing here depends on a view. Where bodies move, only what they touch is searched again (`search`, `region`). Left
//! out: events of three edges (curved boundaries between the others), boundaries
//! within a penumbra, penumbrae wider than [`ShadowSettings::max_penumbra`], and edges where meshes interpenetrate.

mod boundary;
mod event;
mod receivers;
mod region;
mod search;

use glam::{DVec3, Vec3};

use crate::Tracer;
pub use search::{ShadowSearch, ShadowWork};

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

/// Finds the shadow boundaries of the tracer's scene, in its pose, on rayon's threads; the same for any number of them.
/// [`ShadowSearch`] does so pose after pose.
///
/// `progress` is told the finished share, in [0, 1), now and then and from any thread; when it returns `false`, the
/// search ends and gives `None`.
pub fn shadow_segments(
    tracer: &Tracer,
    settings: &ShadowSettings,
    progress: &(dyn Fn(f32) -> bool + Sync),
) -> Option<ShadowSegments> {
    ShadowSearch::new(*settings).find(tracer, progress)
}

/// A direction of unit length across `a` and `b`; `None` where they are (nearly) parallel.
fn across(a: DVec3, b: DVec3) -> Option<DVec3> {
    let cross = a.cross(b);
    let length = cross.length();
    (length > 1e-9 * a.length() * b.length()).then(|| cross / length)
}

#[cfg(test)]
mod tests;
