use std::{ops::Range, path::PathBuf, sync::Arc};

use epigraph_streams::PointSet;
use glam::{DVec3, Vec3};

use crate::builder::MeshError;
use crate::load::framing_camera;
use crate::{Body, Camera, Light, Material, Mesh, Pose, Report, Sky, Texture};

/// A scene at rest, or with its bodies in the poses of a frame.
#[derive(Clone, Debug)]
pub struct Scene {
    /// The name or path under which it was loaded.
    pub name: String,
    /// What to add to all coordinates of the scene to get those of its files, metres. Zero unless these are so large for
    /// the size of what is there that single precision would tear it; then near its centre.
    pub origin: DVec3,
    /// All triangles.
    pub mesh: Mesh,
    /// Materials by index.
    pub materials: Vec<Material>,
    /// Textures by the index that the materials' maps use.
    pub textures: Arc<Vec<Arc<Texture>>>,
    /// Shadow-casting lights.
    pub lights: Vec<Light>,
    /// The triangles that its files do not have: those of a light that was added where there was none.
    pub added: Range<usize>,
    /// Radiance of a ray that hits nothing, and ambient light of the path tracer.
    pub background: Vec3,
    /// What lights the scene from all around, and is seen by rays that hit nothing, instead of the background.
    pub sky: Option<Arc<Sky>>,
    /// The scene's own view.
    pub camera: Camera,
    /// The cameras of its file by name, for [`CameraPath::parse`](crate::CameraPath::parse).
    pub cameras: Arc<Vec<(String, Camera)>>,
    /// Lowest and highest corner of a box that contains the mesh in every frame.
    pub bounds: [Vec3; 2],
    /// Moving bodies, in ascending order of faces.
    pub bodies: Arc<Vec<Body>>,
    /// The present pose of each body.
    pub poses: Vec<Pose>,
    /// Points without surfaces, by levels of detail.
    pub points: Option<Arc<PointSet>>,
    /// What its files have that is not in it as it stands.
    pub report: Arc<Report>,
}

impl Scene {
    /// A scene without surfaces and lights: for graphs whose samples come from another renderer. `bounds` is the box of
    /// what that renderer shows, metres; camera paths such as `orbit` turn around it.
    pub fn empty(name: &str, camera: Camera, bounds: [Vec3; 2]) -> Self {
        Self {
            name: name.to_owned(),
            origin: DVec3::ZERO,
            mesh: Mesh::default(),
            materials: Vec::new(),
            textures: Arc::default(),
            lights: Vec::new(),
            added: 0..0,
            background: Vec3::ZERO,
            sky: None,
            camera,
            cameras: Arc::default(),
            bounds,
            bodies: Arc::default(),
            poses: Vec::new(),
            points: None,
            report: Arc::default(),
        }
    }

    /// Radiance from a unit direction in which there is nothing.
    pub fn beyond(&self, direction: Vec3) -> Vec3 {
        self.sky.as_ref().map_or(self.background, |sky| sky.radiance(direction))
    }

    /// Whether there are points and no surfaces: rays meet nothing.
    pub fn has_only_points(&self) -> bool {
        self.points.is_some() && self.mesh.triangles.is_empty()
    }

    /// A scene of points without surfaces and lights, with a camera that sees all of them.
    pub fn of_points(name: &str, points: Arc<PointSet>) -> Self {
        let (bounds, origin) = (points.bounds(), points.origin());
        Self { origin, points: Some(points), ..Self::empty(name, framing_camera(bounds), bounds) }
    }
}

/// The errors of a scene file or a mesh.
#[derive(Debug, thiserror::Error)]
pub enum SceneError {
    /// The file cannot be read.
    #[error("{}: {source}", path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// The cause.
        source: std::io::Error,
    },
    /// The file is not valid.
    #[error("{}: {message}", path.display())]
    Invalid {
        /// The file.
        path: PathBuf,
        /// The problem and how to fix it.
        message: String,
    },
    /// The triangles of a scene made by code or described in a file are unusable.
    #[error("{name}: {source}")]
    Mesh {
        /// The scene's name or path.
        name: String,
        /// The problem.
        source: MeshError,
    },
    /// The file of a point set cannot be read or is not valid.
    #[error(transparent)]
    Points(epigraph_files::FileError),
    /// There is neither a scene nor a file of that name.
    #[error("{0}")]
    Unknown(String),
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_empty_scene_has_a_view_and_bounds_alone() {
        let camera = Camera::look_at(Vec3::Z, Vec3::ZERO, 1.0, 0.1, 10.0);
        let bounds = [Vec3::NEG_ONE, Vec3::ONE];
        let scene = Scene::empty("none", camera, bounds);
        assert_eq!((scene.name.as_str(), scene.camera, scene.bounds), ("none", camera, bounds));
        assert_eq!((scene.origin, scene.background, scene.added.clone()), (DVec3::ZERO, Vec3::ZERO, 0..0));
        let counts = [
            scene.mesh.positions.len(),
            scene.mesh.triangles.len(),
            scene.mesh.edges.len(),
            scene.materials.len(),
            scene.textures.len(),
            scene.lights.len(),
            scene.cameras.len(),
            scene.bodies.len(),
            scene.poses.len(),
            scene.report.notes().len(),
        ];
        assert_eq!(counts, [0; 10]);
        assert!(scene.sky.is_none() && scene.points.is_none() && !scene.has_only_points());
        assert_eq!(scene.beyond(Vec3::Y), Vec3::ZERO);
        let grey = Scene { background: Vec3::splat(0.5), ..scene };
        assert_eq!(grey.beyond(Vec3::Y), Vec3::splat(0.5));
    }
}
