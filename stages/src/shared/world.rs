//! What the application hands to the stages: the scene behind a ray tracer; and the conversions between `scenes` and
//! `core`, which do not know each other.

use std::sync::{Arc, Mutex, PoisonError};

use epigraph_core::{Facts, Frame, View};
use epigraph_scenes::{
    AsyncTracer, Camera, CameraPath, Hit, Job, Rng, Scene, SceneFacts, TaggedHit, TaggedJob, TraceSettings,
    Tracer, predict,
};
use glam::Vec3;

use super::shadow_cache::ShadowCache;

use super::requests::{
    HIT_BACKGROUND, HIT_SURFACE, NO_PIXEL, NO_POINT, Request, Sample, VIEW_NOW, VIEW_PREDICTED,
};

/// Frames from the request of a sample to the frame for which the predicted view stands: samples enter the cloud one
/// frame after they were asked for, and one more (`algorithms.md` section 1.8).
pub const PREDICTION_FRAMES: f32 = 2.0;

/// When the samples of a frame's requests come.
pub enum Pace {
    /// In the frame itself, all of them: the same bits in every run.
    Exact,
    /// When they come: requests go to threads of their own, and a frame takes what they have finished, without waiting.
    Async(AsyncTracer<Asked>),
}

/// A request, and the frame in whose scene it is traced.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Asked {
    request: Request,
    frame: u32,
}

/// The scene, as the stage `trace` sees it: insert one into the [`epigraph_core::Host`].
pub struct World {
    /// Answers requests: in the scene before anything has moved. See [`World::at`].
    pub tracer: Arc<Tracer>,
    /// When it does.
    pub pace: Pace,
    /// The shadow boundaries of the scene, kept for all graphs.
    pub(crate) shadows: ShadowCache,
    /// The tracer of the frame asked for last.
    posed: Mutex<Arc<Tracer>>,
    scratch: Mutex<Scratch>,
}

/// Lists that are filled anew in each frame, kept for their memory.
#[derive(Default)]
struct Scratch {
    asked: Vec<Request>,
    jobs: Vec<Job>,
    hits: Vec<Hit>,
    finished: Vec<TaggedHit<Asked>>,
}

impl World {
    /// A world seen through `tracer`.
    pub fn new(tracer: Arc<Tracer>, pace: Pace) -> Self {
        let posed = Mutex::new(tracer.clone());
        Self { tracer, pace, shadows: ShadowCache::default(), posed, scratch: Mutex::default() }
    }

    /// The tracer of the scene in a frame: the same value as for the frame before where nothing has moved.
    pub fn at(&self, frame: u32) -> Arc<Tracer> {
        let mut posed = self.posed.lock().unwrap_or_else(PoisonError::into_inner);
        let poses = self.tracer.scene().poses_at(frame);
        if posed.scene().poses != poses {
            *posed = Arc::new(self.tracer.posed(&poses));
        }
        posed.clone()
    }

    /// The facts of a scene that a graph is compiled for; `path_moves` is [`CameraPath::moves`].
    pub fn facts(scene: &Scene, path_moves: bool) -> Facts {
        let facts = SceneFacts::of(scene);
        // Meshes have 32-bit indices, so the counts fit.
        let count = |count: usize| count as u32;
        Facts {
            camera_moves: path_moves,
            shadow_casters: facts.shadow_casters,
            point_lights: count(facts.point_lights),
            quad_lights: count(facts.quad_lights),
            vertices: count(scene.mesh.positions.len()),
            regular_edges: count(facts.regular_edges),
            crease_edges: count(facts.crease_edges),
            border_edges: count(facts.border_edges),
            faces: count(facts.faces),
            bodies: count(facts.bodies),
            lights_move: facts.lights_move,
        }
    }

    /// A camera as the view of an image of `size` pixels.
    pub fn view(camera: &Camera, size: [u32; 2]) -> View {
        let tan_y = (camera.fov_y * 0.5).tan();
        View {
            eye: camera.eye.into(),
            near: camera.near,
            right: (camera.rotation * Vec3::X).into(),
            far: camera.far,
            up: (camera.rotation * Vec3::Y).into(),
            tan_x: tan_y * size[0] as f32 / size[1] as f32,
            forward: (camera.rotation * Vec3::NEG_Z).into(),
            tan_y,
        }
    }

    /// Frame `index` along a camera path. `samples` may be asked for in it; the first frame has itself as its previous.
    pub fn frame(path: &CameraPath, index: u32, size: [u32; 2], samples: u32, seed: u32) -> Frame {
        let (now, previous) = (path.camera(index), path.camera(index.saturating_sub(1)));
        Frame {
            view: Self::view(&now, size),
            previous: Self::view(&previous, size),
            predicted: Self::view(&predict(&previous, &now, PREDICTION_FRAMES), size),
            size,
            index,
            seed,
            samples,
            ..Frame::default()
        }
    }

    /// Traces the valid requests of a frame, in the scene of that frame. What comes later, and has moved by then, has moved
    /// with its body. The samples lie at the beginning of `samples`, in the order of their
    /// requests ([`Pace::Exact`]) or in that of their completion ([`Pace::Async`]); the rest of it is zero.
    pub fn answer(
        &self,
        frame: &Frame,
        requests: &[Request],
        settings: &TraceSettings,
        samples: &mut [Sample],
    ) {
        let mut scratch = self.scratch.lock().unwrap_or_else(PoisonError::into_inner);
        let Scratch { asked, jobs, hits, finished } = &mut *scratch;
        let tracer = self.at(frame.index);
        let scene = tracer.scene();
        let valid = requests.iter().filter(|request| request.pixel != NO_PIXEL);
        samples.fill(Sample::default());
        match &self.pace {
            Pace::Exact => {
                asked.clear();
                asked.reserve(requests.len());
                asked.extend(valid);
                jobs.clear();
                jobs.reserve(requests.len());
                jobs.extend(asked.iter().map(|request| job(frame, request)));
                hits.clear();
                hits.reserve(requests.len());
                hits.resize(jobs.len(), Hit::default());
                tracer.trace_batch(jobs, settings, frame.seed.into(), hits);
                for ((sample, request), hit) in samples.iter_mut().zip(&*asked).zip(&*hits) {
                    *sample = answered(scene, request, hit);
                }
            }
            Pace::Async(queue) => {
                // By the time of the answer the slot may hold another point.
                let tag = |request: &Request| Asked {
                    request: Request { reuse: NO_POINT, ..*request },
                    frame: frame.index,
                };
                let batch = valid.map(|request| TaggedJob { job: job(frame, request), tag: tag(request) });
                queue.submit(&tracer, batch.collect(), *settings, frame.seed.into());
                finished.clear();
                queue.collect(samples.len(), finished);
                for (sample, finished) in samples.iter_mut().zip(&*finished) {
                    let Asked { request, frame } = finished.tag;
                    *sample = answered(scene, &request, &finished.hit);
                    move_along(scene, frame, sample);
                }
            }
        }
    }
}

/// The ray of a request, with random numbers of its frame, view and pixel.
fn job(frame: &Frame, request: &Request) -> Job {
    let view = if request.view == VIEW_PREDICTED { &frame.predicted } else { &frame.view };
    let [x, y] = request.target(frame.size[0]);
    let u = (2.0 * x / frame.size[0] as f32 - 1.0) * view.tan_x;
    let v = (1.0 - 2.0 * y / frame.size[1] as f32) * view.tan_y;
    let direction = Vec3::from(view.forward) + u * Vec3::from(view.right) + v * Vec3::from(view.up);
    // Pixel indices have 28 bits at most, which leaves the top bit to tell the views apart.
    let key = Rng::key(frame.index, request.pixel | u32::from(request.view != VIEW_NOW) << 31);
    Job { origin: view.eye.into(), direction, key }
}

fn answered(scene: &Scene, request: &Request, hit: &Hit) -> Sample {
    Sample {
        position: hit.position.into(),
        hit: if hit.hit { HIT_SURFACE } else { HIT_BACKGROUND },
        radiance: hit.radiance.into(),
        body: scene.body_of_face(hit.face),
        pixel: request.pixel,
        aim: request.aim,
        reuse: request.reuse,
        view: request.view,
    }
}

/// Moves a sample that was traced in the scene of some frame to where its body is in this scene.
fn move_along(scene: &Scene, frame: u32, sample: &mut Sample) {
    let Some(body) = sample.body.checked_sub(1).map(|body| body as usize) else { return };
    let (then, now) = (scene.bodies[body].motion.pose(frame), &scene.poses[body]);
    if then != *now {
        sample.position = now.after(&then.inverse()).point(sample.position.into()).into();
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::shared::requests::{AIM_CENTER, HIT_NONE};

    const SIZE: [u32; 2] = [48, 32];

    fn world() -> (Arc<Scene>, World) {
        let scene = Arc::new(Scene::load("cornell").unwrap());
        (scene.clone(), World::new(Arc::new(Tracer::new(scene)), Pace::Exact))
    }

    fn request(pixel: u32) -> Request {
        Request { pixel, aim: AIM_CENTER, reuse: 5, view: VIEW_NOW }
    }

    #[test]
    fn rays_are_those_of_the_camera() {
        let (scene, _) = world();
        let path = CameraPath::parse("orbit", &scene).unwrap();
        let frame = World::frame(&path, 9, SIZE, 10, 1);
        for (view, camera) in [
            (VIEW_NOW, path.camera(9)),
            (VIEW_PREDICTED, predict(&path.camera(8), &path.camera(9), PREDICTION_FRAMES)),
        ] {
            for pixel in [0, 47, 500, 48 * 32 - 1] {
                let job = job(&frame, &Request { view, aim: 0x4000_C000, ..request(pixel) });
                let expected = camera
                    .direction((pixel % 48) as f32 + 0.75, (pixel / 48) as f32 + 0.25, SIZE)
                    .normalize();
                assert!(job.direction.normalize().distance(expected) < 1e-6);
                assert_eq!(job.origin, camera.eye);
            }
        }
    }

    #[test]
    fn answers_skip_what_was_not_asked_and_repeat_exactly() {
        let (scene, world) = world();
        let frame = World::frame(&CameraPath::parse("still", &scene).unwrap(), 3, SIZE, 4, 7);
        let requests = [request(700), Request::NONE, request(701), Request::NONE];
        let garbage = Sample { hit: 77, ..Sample::default() };
        let settings = TraceSettings::default();
        let answer = || {
            let mut samples = [garbage; 4];
            world.answer(&frame, &requests, &settings, &mut samples);
            samples
        };
        let samples = answer();
        assert_eq!(samples.map(|sample| sample.hit), [HIT_SURFACE, HIT_SURFACE, HIT_NONE, HIT_NONE]);
        assert_eq!(samples.map(|sample| sample.pixel), [700, 701, 0, 0]);
        assert_eq!(samples[0].reuse, 5);
        assert_eq!(samples, answer());
    }

    #[test]
    fn samples_of_threads_come_late_and_renew_nothing() {
        let (scene, World { tracer, .. }) = world();
        let world = World::new(tracer, Pace::Async(AsyncTracer::new(1)));
        let path = CameraPath::parse("still", &scene).unwrap();
        let mut samples = [Sample::default(); 2];
        let mut seen = Vec::new();
        // Ask once, then only collect: ten seconds at most.
        for index in 0..1000 {
            let frame = World::frame(&path, index, SIZE, 2, 7);
            let requests = if index == 0 { [request(700), request(701)] } else { [Request::NONE; 2] };
            world.answer(&frame, &requests, &TraceSettings::default(), &mut samples);
            seen.extend(samples.iter().filter(|sample| sample.hit != HIT_NONE).copied());
            if seen.len() == 2 {
                break;
            }
            std::thread::sleep(std::time::Duration::from_millis(10));
        }
        assert_eq!(
            seen.iter().map(|sample| (sample.pixel, sample.reuse)).collect::<Vec<_>>(),
            [(700, NO_POINT), (701, NO_POINT)]
        );
    }

    #[test]
    fn a_frame_sees_its_own_scene() {
        let scene = Arc::new(Scene::load("cornell-moving").unwrap());
        let world = World::new(Arc::new(Tracer::new(scene.clone())), Pace::Exact);
        assert!(Arc::ptr_eq(&world.at(3), &world.at(3)) && !Arc::ptr_eq(&world.at(3), &world.at(4)));
        let path = CameraPath::parse("still", &scene).unwrap();
        let size = [64, 64];
        let requests: Vec<Request> = (0..64 * 64).map(request).collect();
        let answer = |index: u32| {
            let mut samples = vec![Sample::default(); requests.len()];
            let frame = World::frame(&path, index, size, 1, 7);
            world.answer(&frame, &requests, &TraceSettings::default(), &mut samples);
            samples
        };
        // Of the sliding box, frame 0 and frame 30 see other points, each on its surface.
        let seen = [0, 30].map(|index| {
            let posed = scene.posed(&scene.poses_at(index));
            let body = &posed.bodies[0];
            let [low, high] = posed.mesh.positions[body.vertices.clone()]
                .iter()
                .fold([Vec3::INFINITY, Vec3::NEG_INFINITY], |[low, high], &p| [low.min(p), high.max(p)]);
            let samples = answer(index);
            let on_box: Vec<_> = samples.iter().filter(|sample| sample.body == 1).collect();
            let inside = |p: Vec3| p.cmpge(low - 1e-5).all() && p.cmple(high + 1e-5).all();
            assert!(on_box.len() > 50 && on_box.iter().all(|sample| inside(sample.position.into())));
            low.x
        });
        assert!(seen[1] - seen[0] > 0.05);
    }

    #[test]
    fn late_samples_have_moved_with_their_body() {
        let scene = Arc::new(Scene::load("cornell-moving").unwrap());
        let exact = World::new(Arc::new(Tracer::new(scene.clone())), Pace::Exact);
        let late = World::new(exact.tracer.clone(), Pace::Async(AsyncTracer::new(1)));
        let path = CameraPath::parse("still", &scene).unwrap();
        let size = [32, 32];
        let requests: Vec<Request> = (0..32 * 32).map(request).collect();
        let nothing = vec![Request::NONE; requests.len()];
        let answer = |world: &World, index: u32, requests: &[Request]| {
            let mut samples = vec![Sample::default(); requests.len()];
            let frame = World::frame(&path, index, size, 1, 7);
            world.answer(&frame, requests, &TraceSettings::default(), &mut samples);
            samples.into_iter().filter(|sample| sample.hit != HIT_NONE).collect::<Vec<_>>()
        };
        let expected = answer(&exact, 5, &requests);
        // Asked in frame 5; whatever comes then is let pass by.
        let mut seen = answer(&late, 5, &requests).len();
        let mut checked = 0;
        for _ in 0..1000 {
            std::thread::sleep(std::time::Duration::from_millis(10));
            for sample in answer(&late, 20, &nothing) {
                seen += 1;
                let then = expected.iter().find(|other| other.pixel == sample.pixel).unwrap();
                assert_eq!(then.body, sample.body);
                let pose = |frame| match sample.body {
                    0 => epigraph_scenes::Pose::REST,
                    body => scene.bodies[body as usize - 1].motion.pose(frame),
                };
                let at_rest = |position: [f32; 3], frame| pose(frame).inverse().point(position.into());
                let distance = at_rest(then.position, 5).distance(at_rest(sample.position, 20));
                assert!(distance < 1e-5, "{distance}");
                checked += u32::from(sample.body > 0);
            }
            if seen == requests.len() {
                break;
            }
        }
        assert!(seen == requests.len() && checked > 20, "{seen} seen, {checked} on bodies");
    }
}
