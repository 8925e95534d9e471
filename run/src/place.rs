//! The input of a run: a scene and a camera path through it.

use std::sync::{Arc, OnceLock};

use epigraph_core::{Facts, Host};
use epigraph_scenes::{CameraPath, Scene, Tracer};
use epigraph_stages::{Pace, SampleSource, World};

use crate::Error;

/// A scene and a camera path through it. Several runs may share a place: the tracer is built once, and with
/// [`Pace::Exact`] the data that stages cache for a scene, such as shadow boundaries, is computed once.
#[derive(Clone)]
pub struct Place {
    /// The scene.
    pub scene: Arc<Scene>,
    /// The camera path.
    pub path: CameraPath,
    shared: Arc<Shared>,
}

/// Data that all camera paths through a scene share, made on first use.
#[derive(Default)]
struct Shared {
    tracer: OnceLock<Arc<Tracer>>,
    exact: OnceLock<Arc<Host>>,
}

impl Place {
    /// Loads a scene by its name or file, with a camera path, both as given on the command line.
    ///
    /// # Errors
    /// An invalid scene or path.
    pub fn load(scene: &str, camera: &str) -> Result<Self, Error> {
        Self::new(Arc::new(Scene::load(scene)?), camera)
    }

    /// A scene made by code, with a camera path as given on the command line.
    ///
    /// # Errors
    /// An invalid path.
    pub fn new(scene: Arc<Scene>, camera: &str) -> Result<Self, Error> {
        let path = CameraPath::parse(camera, &scene)?;
        Ok(Self { scene, path, shared: Arc::default() })
    }

    /// The same scene with another camera path.
    ///
    /// # Errors
    /// An invalid path.
    pub fn along(&self, camera: &str) -> Result<Self, Error> {
        Ok(Self { path: CameraPath::parse(camera, &self.scene)?, ..self.clone() })
    }

    /// The facts for which graphs are compiled: those of the scene, and whether the camera moves.
    pub fn facts(&self) -> Facts {
        World::facts(&self.scene, self.path.moves())
    }

    /// The scene's ray tracer, built on the first call.
    pub fn tracer(&self) -> &Arc<Tracer> {
        self.shared.tracer.get_or_init(|| Arc::new(Tracer::new(self.scene.clone())))
    }

    /// The resources that stages use in addition to their ports: the scene, with its ray tracer as the source of
    /// samples. [`Pace::Async`] starts `threads` tracing threads.
    pub fn host(&self, pace: Pace, threads: usize) -> Arc<Host> {
        let make = || host(World::new(self.tracer().clone(), pace, threads));
        match pace {
            Pace::Exact => self.shared.exact.get_or_init(make).clone(),
            Pace::Async => make(),
        }
    }

    /// The same with another source of samples.
    pub fn host_with(&self, source: Box<dyn SampleSource>) -> Arc<Host> {
        host(World::with_source(self.tracer().clone(), source))
    }
}

fn host(world: World) -> Arc<Host> {
    let mut host = Host::default();
    host.insert(world);
    Arc::new(host)
}
