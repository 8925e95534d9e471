//! Shadow boundaries as line segments on the surfaces that receive them (`algorithms.md` sections 2.1, 11.2 and 11.3).
//!
//! At a boundary, the visible part of a light changes. The boundaries of a point light are hard and lie behind its
//! silhouette edges. Those of a quad light lie in planes through a blocker's edge and a corner of the light, or through
//! a blocker's vertex and an edge of the light. The outermost of them bound the umbra, where no part of the light is
//! visible, and the penumbra, where a part of it is. Each such plane is an event (`event`). It cuts the receivers
//! (`receivers`), and shadow rays decide which parts of the cuts are boundaries (`boundary`).
//!
//! Nothing here depends on a view. When bodies move, only the events that they affect are searched again (`search`,
//! `region`). The search does not find events of three edges (curved boundaries between the others), boundaries within
//! a penumbra, penumbrae wider than [`ShadowSettings::max_penumbra`], or edges where meshes interpenetrate.

mod boundary;
mod event;
mod expected;
mod receivers;
mod region;
mod search;

use glam::{DVec3, Vec3};

use crate::Tracer;
pub(crate) use expected::expected_segments;
pub use search::{ShadowSearch, ShadowWork};

/// The regions that a shadow boundary separates.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum ShadowKind {
    /// Points that see a point light from points that do not.
    Hard,
    /// Points that see a part of a quad light from points that do not see it at all.
    Umbra,
    /// Points that see all of a quad light from points that see a part of it.
    Penumbra,
}

/// A piece of a shadow boundary.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ShadowSegment {
    /// Its ends on the receiver, metres.
    pub ends: [Vec3; 2],
    /// The regions that it separates.
    pub kind: ShadowKind,
    /// An upper bound of the penumbra's width across the boundary, metres on the receiver; 0 for hard boundaries. The
    /// width is at least 2/3 of this, unless the penumbra is too narrow to matter.
    pub penumbra: f32,
    /// Index of the blocker's edge in the mesh, or of an edge at the blocker's vertex.
    pub edge: u32,
    /// Index of the receiver's triangle, or of one of them if the segment runs over several coplanar triangles.
    pub face: u32,
}

/// The settings of the search for shadow boundaries.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ShadowSettings {
    /// Maximum number of segments. If there are more, the most important are kept: long ones with a narrow penumbra.
    pub capacity: usize,
    /// Minimum distance of a boundary from its blocker, as a share of the light's distance from the blocker, if both
    /// lie on the same object: closer boundaries only repeat the blocker's edges. On other objects, a tenth of this.
    pub contact: f32,
    /// Maximum width of penumbrae, as a share of the diagonal of the scene's bounds. Boundaries of wider ones are
    /// dropped.
    pub max_penumbra: f32,
    /// The most effort, in tests of a ray with a triangle. In usual scenes, an edge takes some hundred on average and 2^14 at
    /// most. Where thousands of triangles lie in one place, each ray meets all of them: then each edge gets the same
    /// share, and the rest is left out ([`ShadowSegments::incomplete`]).
    pub effort: u64,
}

impl Default for ShadowSettings {
    fn default() -> Self {
        // About ten seconds on two cores.
        Self { capacity: 1 << 18, contact: 0.002, max_penumbra: 0.02, effort: 1 << 33 }
    }
}

/// The shadow boundaries of a scene.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ShadowSegments {
    /// Ordered by light, then by the blocker's edge or vertex.
    pub segments: Vec<ShadowSegment>,
    /// Number of segments dropped because of [`ShadowSettings::capacity`].
    pub dropped: usize,
    /// Number of edges and vertices, counted anew for each light, whose boundaries were not all found for lack of
    /// [`ShadowSettings::effort`].
    pub incomplete: usize,
}

/// Finds the shadow boundaries of the tracer's scene in its present pose, on rayon's threads. The result does not
/// depend on the number of threads. For a sequence of poses, use [`ShadowSearch`].
///
/// `progress` is called from time to time, from any thread, with the finished share, in [0, 1). If it returns `false`,
/// the search ends and returns `None`.
pub fn shadow_segments(
    tracer: &Tracer,
    settings: &ShadowSettings,
    progress: &(dyn Fn(f32) -> bool + Sync),
) -> Option<ShadowSegments> {
    ShadowSearch::new(*settings).find(tracer, progress)
}

/// The unit vector perpendicular to `a` and `b`; `None` if they are (nearly) parallel.
fn across(a: DVec3, b: DVec3) -> Option<DVec3> {
    let cross = a.cross(b);
    let length = cross.length();
    (length > 1e-9 * a.length() * b.length()).then(|| cross / length)
}

#[cfg(test)]
mod tests;
