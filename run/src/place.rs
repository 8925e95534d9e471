//! Where a graph runs: a scene and a camera path through it.

use std::sync::{Arc, OnceLock};

use epigraph_core::{Facts, Host};
use epigraph_scenes::{CameraPath, Scene, Tracer};
use epigraph_stages::{Pace, SampleSource, World};

use crate::Error;

/// A scene and a camera path through it. Several runs may share one: the tracer is built once, and with [`Pace::Exact`]
/// what stages keep of the scene, such as its shadow boundaries, is found once.
#[derive(Clone)]
pub struct Place {
    /// The scene.
    pub scene: Arc<Scene>,
    /// The camera's path.
    pub path: CameraPath,
    shared: Arc<Shared>,
}

/// What all camera paths through a scene share, made when it is first needed.
#[derive(Default)]
struct Shared {
    tracer: OnceLock<Arc<Tracer>>,
    exact: OnceLock<Arc<Host>>,
}

impl Place {
    /// Loads a scene, by its name or file, and a camera path, as the command line takes them.
    ///
    /// # Errors
    /// What is wrong with the scene or the path.
    pub fn load(scene: &str, camera: &str) -> Result<Self, Error> {
        Self::new(Arc::new(Scene::load(scene)?), camera)
    }

    /// A scene made by code, and a camera path, as the command line takes it.
    ///
    /// # Errors
    /// What is wrong with the path.
    pub fn new(scene: Arc<Scene>, camera: &str) -> Result<Self, Error> {
        let path = CameraPath::parse(camera, &scene)?;
        Ok(Self { scene, path, shared: Arc::default() })
    }

    /// The same scene along another camera path.
    ///
    /// # Errors
    /// What is wrong with the path.
    pub fn along(&self, camera: &str) -> Result<Self, Error> {
        Ok(Self { path: CameraPath::parse(camera, &self.scene)?, ..self.clone() })
    }

    /// What graphs are compiled for: the scene's facts, and whether the camera moves.
    pub fn facts(&self) -> Facts {
        World::facts(&self.scene, self.path.moves())
    }

    /// The scene's ray tracer, built at the first call.
    pub fn tracer(&self) -> &Arc<Tracer> {
        self.shared.tracer.get_or_init(|| Arc::new(Tracer::new(self.scene.clone())))
    }

    /// What stages get beside their ports: the scene with its ray tracer as the source of samples. [`Pace::Async`] starts
    /// `threads` threads for it.
    pub fn host(&self, pace: Pace, threads: usize) -> Arc<Host> {
        let make = || host(World::new(self.tracer().clone(), pace, threads));
        match pace {
            Pace::Exact => self.shared.exact.get_or_init(make).clone(),
            Pace::Async => make(),
        }
    }

    /// The same with samples from elsewhere.
    pub fn host_with(&self, source: Box<dyn SampleSource>) -> Arc<Host> {
        host(World::with_source(self.tracer().clone(), source))
    }
}

fn host(world: World) -> Arc<Host> {
    let mut host = Host::default();
    host.insert(world);
    Arc::new(host)
}
