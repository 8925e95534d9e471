//! Where samples come from: whoever answers the requests of a frame. The scene's ray tracer is one source; a renderer
//! of your own is another ([`SampleSource`]).

use std::{
    fmt,
    str::FromStr,
    sync::{Arc, Mutex, PoisonError},
};

use epigraph_core::{
    Frame, View,
    serde::{Deserialize, Serialize},
};
use epigraph_scenes::{AsyncTracer, Hit, Job, Rng, Scene, TaggedHit, TaggedJob, TraceSettings, Tracer};
use glam::Vec3;

use super::{
    albedo::{PLAIN, divisible, encode_albedo},
    octahedral::{NO_NORMAL, encode_oct16},
    requests::{HIT_BACKGROUND, HIT_SURFACE, NO_PIXEL, Request, Sample, VIEW_LATE, VIEW_NOW, VIEW_PREDICTED},
};

/// When the samples of a frame's requests arrive.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(crate = "epigraph_core::serde")]
pub enum Pace {
    /// All of them in the requesting frame: the same picture in every run.
    #[default]
    Exact,
    /// When they are traced; no frame waits for them.
    Async,
}

impl Pace {
    /// Both, with name and description.
    pub const ALL: [(Self, &str, &str); 2] = [
        (Self::Exact, "exact", "Each frame traces all its samples: the same picture in every run"),
        (Self::Async, "async", "Samples arrive when they are traced; no frame waits for them"),
    ];
}

impl fmt::Display for Pace {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let found = Self::ALL.iter().find(|(pace, ..)| pace == self);
        f.write_str(found.map_or("", |(_, name, _)| name))
    }
}

impl FromStr for Pace {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let found = Self::ALL.iter().find(|(_, name, _)| *name == text);
        found.map(|(pace, ..)| *pace).ok_or_else(|| "expected exact or async".into())
    }
}

/// Answers requests for samples: a ray tracer, another renderer, a recording.
///
/// In each frame [`SampleSource::answer`] gets the frame's requests and returns finished samples, of this frame's
/// requests or of earlier ones. It must not wait for work that takes longer than a frame, unless its pace is
/// [`Pace::Exact`].
pub trait SampleSource: Send + Sync {
    /// Takes the requests of a frame and writes finished samples to the beginning of `samples`, which is zeroed:
    /// entries that stay zero are empty. There is one entry for each request.
    ///
    /// A sample that comes in a later frame than its request must be carried into the present one ([`Query::carry`]).
    ///
    /// A source whose samples are noisy says how noisy ([`Sample::variance`]), so that graphs which average and filter
    /// know what is noise.
    fn answer(&self, query: &Query, samples: &mut [Sample]);

    /// Whether all samples arrive in the requesting frame. Other searches in the scene, such as the one for shadow
    /// boundaries, follow the same pace.
    fn pace(&self) -> Pace;
}

/// A frame's requests to a [`SampleSource`].
#[derive(Clone, Copy)]
pub struct Query<'a> {
    /// The frame: its views, number, size in pixels and seed.
    pub frame: &'a Frame,
    /// Number of light paths per sample and how to trace them, as set in the requesting node.
    pub settings: &'a TraceSettings,
    /// The scene, with everything in its pose of this frame, behind a ray tracer.
    pub tracer: &'a Arc<Tracer>,
    pub(super) requests: &'a [Request],
}

/// The ray through a requested position in the image.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ray {
    /// The eye, metres.
    pub origin: Vec3,
    /// Towards the scene; its length along the view axis is 1.
    pub direction: Vec3,
    /// Distance of the near plane along the view axis, metres: surfaces in front of it are not seen.
    pub near: f32,
}

impl Ray {
    /// The ray through a position in an image of `size` pixels, in pixels from its top left corner.
    #[inline]
    pub fn through(view: &View, [x, y]: [f32; 2], [width, height]: [u32; 2]) -> Self {
        let u = (2.0 * x / width as f32 - 1.0) * view.tan_x;
        let v = (1.0 - 2.0 * y / height as f32) * view.tan_y;
        let direction = Vec3::from(view.forward) + u * Vec3::from(view.right) + v * Vec3::from(view.up);
        Self { origin: view.eye.into(), direction, near: view.near }
    }
}

impl<'a> Query<'a> {
    /// The requests, in entry order. Empty entries are left out.
    pub fn requests(&self) -> impl Iterator<Item = &'a Request> + use<'a> {
        self.requests.iter().filter(|request| request.pixel != NO_PIXEL)
    }

    /// At most this many requests.
    pub fn capacity(&self) -> usize {
        self.requests.len()
    }

    /// The ray of a request, in the frame's view or the predicted one, as requested.
    // Inlined, as are its parts: calls for each request would cost a twentieth of the tracing.
    #[inline]
    pub fn ray(&self, request: &Request) -> Ray {
        let Frame { view, predicted, size, .. } = self.frame;
        let view = if request.view == VIEW_PREDICTED { predicted } else { view };
        Ray::through(view, request.target(size[0]), *size)
    }

    /// Marks a sample of a request of an earlier frame as late, and moves it to where its body is now. By now the slot of the
    /// point that it was to renew may hold another point, so it renews only what is at the same place.
    pub fn carry(&self, frame: u32, sample: &mut Sample) {
        if frame == self.frame.index {
            return;
        }
        sample.view = VIEW_LATE;
        let scene = self.tracer.scene();
        let Some(body) = sample.body.checked_sub(1).map(|body| body as usize) else { return };
        let (then, now) = (scene.bodies[body].motion.pose(frame), &scene.poses[body]);
        if then != *now {
            sample.position = now.after(&then.inverse()).point(sample.position.into()).into();
        }
    }

    /// The request in the tracer's format, with random numbers of its frame, view and pixel.
    #[inline]
    fn job(&self, request: &Request) -> Job {
        let Ray { origin, direction, near } = self.ray(request);
        // Pixel indices have at most 28 bits, so the top bit can distinguish the views.
        let key = Rng::key(self.frame.index, request.pixel | u32::from(request.view != VIEW_NOW) << 31);
        Job { origin, direction, start: near, key }
    }
}

impl Sample {
    /// The result of a ray that hit static geometry: a point, metres, and its linear radiance towards the eye.
    pub fn surface(request: &Request, position: Vec3, radiance: Vec3) -> Self {
        let &Request { pixel, aim, reuse, view } = request;
        let (position, radiance) = (position.into(), radiance.into());
        Self {
            position,
            hit: HIT_SURFACE,
            radiance,
            pixel,
            aim,
            reuse,
            view,
            normal: NO_NORMAL,
            albedo: PLAIN,
            ..Self::default()
        }
    }

    /// The result of a ray that hit nothing. It is stored as a point at infinity.
    pub fn background(request: &Request, ray: Ray, radiance: Vec3) -> Self {
        Self { hit: HIT_BACKGROUND, ..Self::surface(request, ray.direction.normalize(), radiance) }
    }

    fn of_hit(scene: &Scene, request: &Request, hit: &Hit) -> Self {
        Self {
            hit: if hit.hit { HIT_SURFACE } else { HIT_BACKGROUND },
            body: scene.body_of_face(hit.face),
            variance: hit.variance,
            normal: encode_oct16(hit.normal),
            sharpness: hit.sharpness,
            albedo: encode_albedo(divisible(hit.pattern)),
            ..Self::surface(request, hit.position, hit.radiance)
        }
    }
}

/// The scene's ray tracer as a source: in the requesting frame, on all threads.
#[derive(Default)]
pub struct ExactTracer {
    /// Lists that are refilled in each frame, kept for their memory.
    scratch: Mutex<Scratch>,
}

#[derive(Default)]
struct Scratch {
    asked: Vec<Request>,
    jobs: Vec<Job>,
    hits: Vec<Hit>,
}

impl SampleSource for ExactTracer {
    /// The samples are in request order.
    fn answer(&self, query: &Query, samples: &mut [Sample]) {
        let mut scratch = self.scratch.lock().unwrap_or_else(PoisonError::into_inner);
        let Scratch { asked, jobs, hits } = &mut *scratch;
        // Reserve the maximum, so that no later frame allocates.
        let most = query.capacity();
        asked.clear();
        asked.reserve(most);
        asked.extend(query.requests());
        jobs.clear();
        jobs.reserve(most);
        jobs.extend(asked.iter().map(|request| query.job(request)));
        hits.clear();
        hits.reserve(most);
        hits.resize(jobs.len(), Hit::default());
        query.tracer.trace_batch(jobs, query.settings, query.frame.seed.into(), hits);
        let scene = query.tracer.scene();
        for ((sample, request), hit) in samples.iter_mut().zip(&*asked).zip(&*hits) {
            *sample = Sample::of_hit(scene, request, hit);
        }
    }

    fn pace(&self) -> Pace {
        Pace::Exact
    }
}

/// The scene's ray tracer as a source that no frame waits for: it works on threads of its own.
pub struct BackgroundTracer {
    queue: AsyncTracer<Tag>,
    finished: Mutex<Vec<TaggedHit<Tag>>>,
}

/// A request, and the frame in whose scene it is traced.
#[derive(Clone, Copy)]
struct Tag {
    request: Request,
    frame: u32,
}

impl BackgroundTracer {
    /// Starts this many threads, at least one.
    pub fn new(threads: usize) -> Self {
        Self { queue: AsyncTracer::new(threads), finished: Mutex::default() }
    }
}

impl SampleSource for BackgroundTracer {
    /// The samples are in the order in which they were finished.
    fn answer(&self, query: &Query, samples: &mut [Sample]) {
        let frame = query.frame.index;
        let tag = |request: &Request| Tag { request: *request, frame };
        let batch = query.requests().map(|request| TaggedJob { job: query.job(request), tag: tag(request) });
        self.queue.submit(query.tracer, batch.collect(), *query.settings, query.frame.seed.into());
        let mut finished = self.finished.lock().unwrap_or_else(PoisonError::into_inner);
        finished.clear();
        self.queue.collect(samples.len(), &mut finished);
        for (sample, TaggedHit { hit, tag }) in samples.iter_mut().zip(&*finished) {
            *sample = Sample::of_hit(query.tracer.scene(), &tag.request, hit);
            query.carry(tag.frame, sample);
        }
    }

    fn pace(&self) -> Pace {
        Pace::Async
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn paces_have_names() {
        for (pace, name, _) in Pace::ALL {
            assert_eq!(pace.to_string(), name);
            assert_eq!(name.parse(), Ok(pace));
        }
        assert_eq!(Pace::ALL.map(|(pace, ..)| pace), [Pace::Exact, Pace::Async]);
        assert!("fast".parse::<Pace>().is_err());
    }
}
