//! What the application provides to the stages: the scene behind a ray tracer; and the conversions between `scenes` and
//! `core`, which do not depend on each other.

use std::sync::{Arc, Mutex, PoisonError};

use epigraph_core::{Facts, Frame, View};
use epigraph_scenes::{Camera, CameraPath, Scene, TraceSettings, Tracer, predict};
use glam::Vec3;

use super::{
    requests::{Request, Sample},
    shadow_cache::ShadowCache,
    source::{BackgroundTracer, ExactTracer, Pace, Query, SampleSource},
};
use crate::facts;

/// Frames from the request of a sample to the frame that the predicted view anticipates: samples enter the cloud one
/// frame after their request, and one more (`algorithms.md` section 1.8).
const PREDICTION_FRAMES: f32 = 2.0;

/// The scene and the source of samples, as the stages see them: insert one into the [`epigraph_core::Host`].
pub struct World {
    /// The scene before any movement, behind a ray tracer. See [`World::at`].
    pub tracer: Arc<Tracer>,
    source: Box<dyn SampleSource>,
    /// The shadow boundaries of the scene, cached for all graphs.
    pub(crate) shadows: ShadowCache,
    /// The tracer of the last requested frame.
    posed: Mutex<Arc<Tracer>>,
}

impl World {
    /// A world whose samples come from its own ray tracer. With [`Pace::Async`] the tracer uses `threads` background
    /// threads.
    pub fn new(tracer: Arc<Tracer>, pace: Pace, threads: usize) -> Self {
        match pace {
            Pace::Exact => Self::with_source(tracer, Box::new(ExactTracer::default())),
            Pace::Async => Self::with_source(tracer, Box::new(BackgroundTracer::new(threads))),
        }
    }

    /// A world whose samples come from elsewhere. Graphs still get edges, shadows and motion from the scene behind
    /// `tracer`; it may be empty.
    pub fn with_source(tracer: Arc<Tracer>, source: Box<dyn SampleSource>) -> Self {
        let posed = Mutex::new(tracer.clone());
        Self { tracer, source, shadows: ShadowCache::default(), posed }
    }

    /// When its samples arrive.
    pub fn pace(&self) -> Pace {
        self.source.pace()
    }

    /// The number of edges and vertices for which the last searches have not found all boundaries of shadows, as too many
    /// triangles lie in one place ([`epigraph_scenes::ShadowSettings::effort`]).
    pub fn incomplete_shadows(&self) -> usize {
        self.shadows.most(|found| found.incomplete)
    }

    /// The number of boundaries of shadows that the last searches have found and that there was no room for, as the stage
    /// `shadow_edges` has too little `capacity`.
    pub fn dropped_shadows(&self) -> usize {
        self.shadows.most(|found| found.dropped)
    }

    /// The tracer of the scene in a frame: the same value as for the frame before if nothing has moved.
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
        facts::of(scene, path_moves)
    }

    /// A camera as the view of an image of `size` pixels.
    pub fn view(camera: &Camera, size: [u32; 2]) -> View {
        let tan_y = camera.half_height(size);
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

    /// Frame `index` of a camera that moved from `previous` to `now`, for an image of `size` pixels, with up to
    /// `samples` requests. A first frame has the same camera twice.
    pub fn frame(
        previous: &Camera,
        now: &Camera,
        index: u32,
        size: [u32; 2],
        samples: u32,
        seed: u32,
    ) -> Frame {
        Frame {
            view: Self::view(now, size),
            previous: Self::view(previous, size),
            predicted: Self::view(&predict(previous, now, PREDICTION_FRAMES), size),
            size,
            index,
            seed,
            samples,
            ..Frame::default()
        }
    }

    /// Frame `index` along a camera path.
    pub fn frame_of(path: &CameraPath, index: u32, size: [u32; 2], samples: u32, seed: u32) -> Frame {
        let (previous, now) = (path.camera(index.saturating_sub(1)), path.camera(index));
        Self::frame(&previous, &now, index, size, samples, seed)
    }

    /// Answers the requests of a frame from the source of samples, in the scene of that frame. The samples are at the
    /// beginning of `samples`; the rest of it is zero.
    pub fn answer(
        &self,
        frame: &Frame,
        requests: &[Request],
        settings: &TraceSettings,
        samples: &mut [Sample],
    ) {
        let tracer = self.at(frame.index);
        samples.fill(Sample::default());
        self.source.answer(&Query { frame, settings, tracer: &tracer, requests }, samples);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::shared::requests::{HIT_NONE, HIT_SURFACE, PIXEL_CENTER, VIEW_LATE, VIEW_NOW, VIEW_PREDICTED};

    const SIZE: [u32; 2] = [48, 32];

    fn world() -> (Arc<Scene>, World) {
        let scene = Arc::new(Scene::load("cornell").unwrap());
        (scene.clone(), World::new(Arc::new(Tracer::new(scene)), Pace::Exact, 1))
    }

    fn request(pixel: u32) -> Request {
        Request { pixel, aim: PIXEL_CENTER, reuse: 5, view: VIEW_NOW }
    }

    #[test]
    fn rays_equal_those_of_the_camera() {
        let (scene, world) = world();
        let path = CameraPath::parse("orbit", &scene).unwrap();
        let (frame, settings) = (World::frame_of(&path, 9, SIZE, 10, 1), TraceSettings::default());
        let query = Query { frame: &frame, settings: &settings, tracer: &world.tracer, requests: &[] };
        for (view, camera) in [
            (VIEW_NOW, path.camera(9)),
            (VIEW_PREDICTED, predict(&path.camera(8), &path.camera(9), PREDICTION_FRAMES)),
        ] {
            for pixel in [0, 47, 500, 48 * 32 - 1] {
                let ray = query.ray(&Request { view, aim: 0x4000_C000, ..request(pixel) });
                let expected = camera
                    .direction((pixel % 48) as f32 + 0.75, (pixel / 48) as f32 + 0.25, SIZE)
                    .normalize();
                assert!(ray.direction.normalize().distance(expected) < 1e-6);
                assert_eq!((ray.origin, ray.near), (camera.eye, camera.near));
            }
        }
    }

    #[test]
    fn answers_skip_empty_requests_and_are_the_same_each_time() {
        let (scene, world) = world();
        let frame = World::frame_of(&CameraPath::parse("still", &scene).unwrap(), 3, SIZE, 4, 7);
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
    fn samples_have_the_albedo_of_textures() {
        use super::super::albedo::{PLAIN, divisible, encode_albedo};
        let scene = Arc::new(Scene::load("still-life").unwrap());
        let world = World::new(Arc::new(Tracer::new(scene.clone())), Pace::Exact, 1);
        let frame = World::frame_of(&CameraPath::parse("still", &scene).unwrap(), 3, SIZE, 4, 7);
        let requests: Vec<Request> = (0..SIZE[0] * SIZE[1]).map(request).collect();
        let settings = TraceSettings { spp: 1, ..TraceSettings::default() };
        let mut samples = vec![Sample::default(); requests.len()];
        world.answer(&frame, &requests, &settings, &mut samples);
        let query = Query { frame: &frame, settings: &settings, tracer: &world.tracer, requests: &[] };
        let (mut textured, mut plain) = (0, 0);
        for (sample, request) in samples.iter().zip(&requests) {
            let ray = query.ray(request);
            let hit = world.tracer.surface(ray.origin, ray.direction, ray.near);
            if sample.albedo == PLAIN {
                plain += 1;
            } else {
                let albedo = hit.expect("there is a texture").albedo;
                assert_eq!(sample.albedo, encode_albedo(divisible(albedo)));
                textured += 1;
            }
        }
        assert!(textured > 1000 && plain > 50, "{textured} of textures, {plain} others");
    }

    #[test]
    fn samples_of_background_threads_say_that_they_are_late() {
        let (scene, World { tracer, .. }) = world();
        let world = World::new(tracer, Pace::Async, 1);
        let path = CameraPath::parse("still", &scene).unwrap();
        let mut samples = [Sample::default(); 2];
        let mut seen = Vec::new();
        // Requests samples once and then only collects them, for at most ten seconds.
        for index in 0..1000 {
            let frame = World::frame_of(&path, index, SIZE, 2, 7);
            let requests = if index == 0 { [request(700), request(701)] } else { [Request::NONE; 2] };
            // Without room in its own frame, no sample comes in time.
            let room = if index == 0 { 0 } else { 2 };
            world.answer(&frame, &requests, &TraceSettings::default(), &mut samples[..room]);
            seen.extend(samples.iter().filter(|sample| sample.hit != HIT_NONE).copied());
            if seen.len() == 2 {
                break;
            }
            std::thread::sleep(std::time::Duration::from_millis(10));
        }
        assert_eq!(
            seen.iter().map(|sample| (sample.pixel, sample.reuse, sample.view)).collect::<Vec<_>>(),
            [(700, 5, VIEW_LATE), (701, 5, VIEW_LATE)]
        );
    }

    #[test]
    fn samples_of_a_frame_are_of_its_own_scene() {
        let scene = Arc::new(Scene::load("cornell-moving").unwrap());
        let world = World::new(Arc::new(Tracer::new(scene.clone())), Pace::Exact, 1);
        assert!(Arc::ptr_eq(&world.at(3), &world.at(3)) && !Arc::ptr_eq(&world.at(3), &world.at(4)));
        let path = CameraPath::parse("still", &scene).unwrap();
        let size = [64, 64];
        let requests: Vec<Request> = (0..64 * 64).map(request).collect();
        let answer = |index: u32| {
            let mut samples = vec![Sample::default(); requests.len()];
            let frame = World::frame_of(&path, index, size, 1, 7);
            world.answer(&frame, &requests, &TraceSettings::default(), &mut samples);
            samples
        };
        // Frames 0 and 30 see different points of the sliding box, each on its surface.
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
        let exact = World::new(Arc::new(Tracer::new(scene.clone())), Pace::Exact, 1);
        let late = World::new(exact.tracer.clone(), Pace::Async, 1);
        let path = CameraPath::parse("still", &scene).unwrap();
        let size = [32, 32];
        let requests: Vec<Request> = (0..32 * 32).map(request).collect();
        let nothing = vec![Request::NONE; requests.len()];
        // Asks in a frame, with room for `room` samples.
        let answer = |world: &World, index: u32, requests: &[Request], room: usize| {
            let mut samples = vec![Sample::default(); room];
            let frame = World::frame_of(&path, index, size, 1, 7);
            world.answer(&frame, requests, &TraceSettings::default(), &mut samples);
            samples.into_iter().filter(|sample| sample.hit != HIT_NONE).collect::<Vec<_>>()
        };
        let expected = answer(&exact, 5, &requests, requests.len());
        // Without room in frame 5, all of its samples arrive in frame 20, however fast the background threads are.
        answer(&late, 5, &requests, 0);
        let (mut seen, mut checked) = (0, 0);
        for _ in 0..1000 {
            std::thread::sleep(std::time::Duration::from_millis(10));
            for sample in answer(&late, 20, &nothing, nothing.len()) {
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
