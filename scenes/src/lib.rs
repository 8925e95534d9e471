//! Scenes for Epigraph: welded triangle meshes with an edge list, materials, lights, cameras and their paths,
//! loaders, and the ray tracer that answers requests for samples.
//!
//! A [`Scene`] is one flat, immutable value: every later step (tracer, silhouettes, shadow edges) indexes into the
//! same vertices, faces and edges. World space is right-handed with y up, in metres; colours are linear Rec. 709.
//!
//! ```
//! use std::sync::Arc;
//!
//! use epigraph_scenes::{CameraPath, Rng, Scene, TraceSettings, Tracer};
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! let scene = Arc::new(Scene::load("cornell")?);
//! assert_eq!(scene.mesh.triangles.len(), 36);
//!
//! // The ray through the middle of frame 30 along an orbit.
//! let camera = CameraPath::parse("orbit", &scene)?.camera(30);
//! let direction = camera.direction(32.0, 32.0, [64, 64]);
//! let mut random = Rng::new(0, Rng::key(30, 0));
//! let hit = Tracer::new(scene).trace(camera.eye, direction, &TraceSettings::default(), &mut random);
//! assert!(hit.hit && hit.radiance.min_element() >= 0.0);
//! # Ok(())
//! # }
//! ```

mod boxes;
mod builder;
mod builtin;
mod camera;
mod edges;
mod facts;
mod fingerprint;
mod light;
mod limits;
mod load;
mod look;
mod material;
mod mesh;
mod motion;
mod path;
pub mod reference;
mod report;
mod scene;
mod shadow;
mod shape;
mod sky;
mod texture;
mod trace;
mod weld;

pub use builder::{CREASE_ANGLE, MeshError, SceneBuilder};
pub use builtin::{SceneInfo, scene_names};
pub use camera::{Camera, predict};
pub use epigraph_streams as streams;
pub use facts::SceneFacts;
pub use light::Light;
pub use limits::{MAX_COORDINATE, MAX_INTENSITY, MAX_RADIANCE, MAX_TIME, MAX_TRIANGLES};
pub use load::{
    CameraSpec, ChannelSpec, LightSpec, LoadOptions, MapSpec, MapSpecs, MaterialSpec, MediumSpec,
    MotionKeySpec, MotionSpec, ObjectSpec, RepeatSpec, SceneFile, ShapeSpec, SurfaceSpec, ply_header,
    texture_progress,
};
pub use look::Look;
pub use material::{Alpha, DIELECTRIC_F0, Map, Maps, Material, Medium, f0_of_ior};
pub use mesh::{Edge, EdgeKind, Mesh, NO_FACE};
pub use motion::{Body, FRAMES_PER_SECOND, MAX_BODIES, Motion, MotionKey, Pose};
pub use path::{CameraPath, PathError, keyframes};
pub use report::{Note, NoteKind, Report};
pub use scene::{Scene, SceneError};
pub use shadow::{
    ShadowKind, ShadowSearch, ShadowSegment, ShadowSegments, ShadowSettings, ShadowWork, shadow_segments,
};
pub use shape::Shape;
pub use sky::Sky;
pub use texture::{Texture, Wrap};
pub use trace::{
    AsyncTracer, Hit, Job, Mode, Rng, Surface, TaggedHit, TaggedJob, TraceSettings, Tracer, UNKNOWN_VARIANCE,
};
