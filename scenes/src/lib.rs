//! Scenes for Epigraph: welded triangle meshes with an edge list, materials, lights, cameras and their paths,
//! loaders, and the ray tracer that answers requests for samples.
//!
//! A [`Scene`] is one flat, immutable value: every later step (tracer, silhouettes, shadow edges) indexes into the
//! same vertices, faces and edges. World right-handed, y up, metres; colours are linear Rec. 709.

mod builder;
mod builtin;
mod camera;
mod edges;
mod facts;
mod light;
mod load;
mod material;
mod mesh;
mod motion;
mod path;
pub mod reference;
mod scene;
mod shadow;
mod shape;
mod trace;
mod weld;

pub use builder::{CREASE_ANGLE, MeshError, SceneBuilder};
pub use builtin::{SceneInfo, scene_names};
pub use camera::{Camera, predict};
pub use facts::SceneFacts;
pub use light::Light;
pub use load::{
    CameraSpec, LightSpec, MaterialSpec, MotionKeySpec, MotionSpec, ObjectSpec, RepeatSpec, SceneFile,
    ShapeSpec, SurfaceSpec,
};
pub use material::{Material, Surface};
pub use mesh::{Edge, EdgeKind, Mesh, NO_FACE};
pub use motion::{Body, FRAMES_PER_SECOND, MAX_BODIES, Motion, MotionKey, Pose};
pub use path::{CameraPath, PathError, keyframes};
pub use scene::{Scene, SceneError};
pub use shadow::{
    ShadowKind, ShadowSearch, ShadowSegment, ShadowSegments, ShadowSettings, ShadowWork, shadow_segments,
};
pub use shape::Shape;
pub use trace::{AsyncTracer, Hit, Job, Mode, Rng, TaggedHit, TaggedJob, TraceSettings, Tracer};
