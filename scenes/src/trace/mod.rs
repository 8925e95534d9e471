//! The ray tracer that answers requests for samples.
//!
//! A sample is the primary hit of a ray (the first visible surface) and the mean radiance of `spp` light paths that
//! start there. The result depends only on the ray, the seed and the key: it has the same bits on any number of
//! threads.
//!
//! Light reaches a path in two ways: lights are sampled at every vertex (next-event estimation), and scattered rays may
//! hit an emissive face. Quad lights are found in both ways, which are therefore weighted by the balance heuristic
//! (Veach and Guibas 1995), separately for each lobe. Other emissive faces and the background are found only by
//! scattered rays, and count in full.

mod bvh;
mod emitter;
mod queue;
mod rng;
mod surface;

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use glam::Vec3;
use rayon::prelude::*;

use crate::{Material, Pose, Scene};
use bvh::{Bvhs, Intersection};
use emitter::{Emitters, Incident};
pub use queue::{AsyncTracer, TaggedHit, TaggedJob};
pub use rng::Rng;
use surface::{Bsdf, Lobe, PerLobe};

/// Means "no face" in [`Hit::face`].
const NO_FACE: u32 = crate::NO_FACE;

/// Russian roulette begins at this bounce.
const ROULETTE_BOUNCE: u32 = 3;

/// Maximum probability with which a path survives roulette, so that paths end even in a closed white room.
const MAX_SURVIVAL: f32 = 0.97;

/// Minimum lobe width (alpha) of a glossy surface that is reflected in another one, in direct mode: there, only lights
/// are sampled, so that a narrow lobe would give rare, bright pixels.
const REFLECTED_ALPHA: f32 = 0.1;

/// Distance from the surface at which rays start, in units in the last place of the triangle's coordinates.
const OFFSET_ULPS: f32 = 32.0;

/// The stratified pairs at a sample's first vertex: one for the lobe, one for the direction, then one per quad light.
const LOBE_PAIR: u32 = 0;
const DIRECTION_PAIR: u32 = 1;
const FIRST_LIGHT_PAIR: u32 = 2;

/// The light transport that a sample includes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
pub enum Mode {
    /// Direct light at the first surface that is not a mirror, and one glossy reflection.
    #[default]
    Direct,
    /// All light, by paths of many bounces. The background lights the scene too.
    Path,
}

/// The settings of tracing.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TraceSettings {
    /// Light paths of one sample; 0 counts as 1.
    pub spp: u32,
    /// Direct light or full paths.
    pub mode: Mode,
    /// Maximum number of reflections after the first surface.
    pub max_bounces: u32,
}

impl Default for TraceSettings {
    fn default() -> Self {
        Self { spp: 1, mode: Mode::Direct, max_bounces: 8 }
    }
}

/// A sample: the result of a ray.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hit {
    /// The point of the first surface that the ray hits, metres; if it hits none, its unit direction (a point at
    /// infinity, `algorithms.md` section 11.3).
    pub position: Vec3,
    /// True if the ray hit a surface.
    pub hit: bool,
    /// Radiance towards the ray's origin.
    pub radiance: Vec3,
    /// Index of the triangle that it hit; `u32::MAX` if none.
    pub face: u32,
}

impl Default for Hit {
    /// The sample of a ray that hits nothing, with black radiance.
    fn default() -> Self {
        Self { position: Vec3::NEG_Z, hit: false, radiance: Vec3::ZERO, face: NO_FACE }
    }
}

/// A request for one sample.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Job {
    /// Where the ray starts, metres.
    pub origin: Vec3,
    /// Its direction, of any length.
    pub direction: Vec3,
    /// Key of the random numbers; see [`Rng::key`].
    pub key: u64,
}

/// Traces rays through a scene.
pub struct Tracer {
    scene: Arc<Scene>,
    bvh: Bvhs,
    emitters: Emitters,
    /// Shared by all poses of the scene.
    non_finite: Arc<AtomicU64>,
}

/// The first surface point that a ray hits, without its radiance.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Seen {
    /// Position, metres.
    pub position: Vec3,
    /// Index of the triangle.
    pub face: u32,
    /// Unit normal of the triangle, on the viewer's side.
    pub facing: Vec3,
    /// The start of shadow rays, off the surface.
    pub start: Vec3,
}

/// A point of a surface, seen from the ray that hit it.
#[derive(Clone, Copy)]
struct Vertex {
    position: Vec3,
    face: u32,
    /// Unit geometric normal, on the viewer's side.
    facing: Vec3,
    to_viewer: Vec3,
    /// Largest coordinate of the triangle. The error of the position is a few units in the last place of this.
    reach: f32,
    bsdf: Bsdf,
    /// Radiance that the surface emits towards the viewer.
    emission: Vec3,
}

/// The densities with which a scattered ray was sampled, from which follows the weight of the light that it hits.
#[derive(Clone, Copy)]
struct Origin {
    position: Vec3,
    /// Density of the ray's direction times the probability of its lobe; infinite for a mirror.
    pdf: f32,
    /// Probability with which each light was sampled at the origin.
    light_probability: f32,
}

impl Tracer {
    /// Builds the bounding volume hierarchies of `scene`.
    pub fn new(scene: Arc<Scene>) -> Self {
        let bvh = Bvhs::new(&scene);
        let emitters = Emitters::new(&scene);
        Self { scene, bvh, emitters, non_finite: Arc::default() }
    }

    /// The tracer of the scene in a frame; this tracer if no pose differs. Hierarchies are shared, not rebuilt. See
    /// [`Scene::posed`] for the data that is rewritten.
    pub fn at(self: &Arc<Self>, frame: u32) -> Arc<Self> {
        let poses = self.scene.poses_at(frame);
        if poses == self.scene.poses { self.clone() } else { Arc::new(self.posed(&poses)) }
    }

    /// The tracer of the scene with its bodies in these poses.
    pub fn posed(&self, poses: &[Pose]) -> Self {
        let scene = Arc::new(self.scene.posed(poses));
        Self {
            bvh: self.bvh.posed(&scene.poses),
            emitters: self.emitters.posed(&scene),
            non_finite: self.non_finite.clone(),
            scene,
        }
    }

    /// The traced scene.
    pub fn scene(&self) -> &Arc<Scene> {
        &self.scene
    }

    /// Returns true if no triangle lies strictly between two points.
    pub fn visible(&self, from: Vec3, to: Vec3) -> bool {
        self.bvh.visible(from, to)
    }

    /// The nearest surface along a ray from `origin` in `direction` (of any length).
    pub(crate) fn first_surface(&self, origin: Vec3, direction: Vec3) -> Option<Seen> {
        let vertex = self.vertex(origin, direction.normalize_or_zero())?;
        let Vertex { position, face, facing, .. } = vertex;
        Some(Seen { position, face, facing, start: vertex.start() })
    }

    /// The number of lights, for [`Tracer::sees_light`].
    pub(crate) fn light_count(&self) -> usize {
        self.emitters.quads.len() + self.emitters.points.len()
    }

    /// Returns true if nothing lies between a surface and the point `at` of the light with index `light`, or `None` if
    /// the surface or the light faces away. `at` is in [0, 1]^2 for quad lights and has no effect for point lights.
    pub(crate) fn sees_light(&self, surface: &Seen, light: usize, at: [f32; 2]) -> Option<bool> {
        let Emitters { quads, points, .. } = &self.emitters;
        let incident = match quads.get(light) {
            Some(quad) => quad.towards(surface.position, at),
            None => points[light - quads.len()].towards(surface.position),
        };
        let incident = incident.filter(|light| surface.facing.dot(light.direction) > 0.0)?;
        Some(self.bvh.visible(surface.start, incident.target))
    }

    /// The number of samples so far, in all poses of the scene, whose radiance was not finite. They are returned as
    /// black.
    pub fn non_finite(&self) -> u64 {
        self.non_finite.load(Ordering::Relaxed)
    }

    /// The sample of the ray from `origin` (metres) in `direction` (of any length).
    pub fn trace(&self, origin: Vec3, direction: Vec3, settings: &TraceSettings, rng: &mut Rng) -> Hit {
        let direction = direction.normalize_or_zero();
        let Some(first) = self.vertex(origin, direction) else {
            return Hit { position: direction, hit: false, radiance: self.scene.background, face: NO_FACE };
        };
        let mut radiance = self.radiance(&first, settings, rng);
        if !radiance.is_finite() {
            self.non_finite.fetch_add(1, Ordering::Relaxed);
            radiance = Vec3::ZERO;
        }
        Hit { position: first.position, hit: true, radiance, face: first.face }
    }

    /// Traces `jobs` on rayon's threads and writes each result to the element of `out` with the same index. If one
    /// slice is shorter, the rest of the other is ignored. The random numbers depend on `seed` and on each job's key.
    pub fn trace_batch(&self, jobs: &[Job], settings: &TraceSettings, seed: u64, out: &mut [Hit]) {
        jobs.par_iter()
            .zip(out)
            .with_min_len(64)
            .for_each(|(job, out)| *out = self.trace_job(job, settings, seed));
    }

    fn trace_job(&self, job: &Job, settings: &TraceSettings, seed: u64) -> Hit {
        self.trace(job.origin, job.direction, settings, &mut Rng::new(seed, job.key))
    }

    /// The radiance from a vertex towards its viewer.
    fn radiance(&self, first: &Vertex, settings: &TraceSettings, rng: &mut Rng) -> Vec3 {
        // Reflection in mirrors is deterministic, so it is traced once for all light paths.
        let mut vertex = *first;
        let mut tint = Vec3::ONE;
        let mut radiance = vertex.emission;
        let mut bounces = 0;
        while let Some((direction, color)) = vertex.mirror() {
            if bounces == settings.max_bounces {
                return radiance;
            }
            bounces += 1;
            tint *= color;
            match self.vertex(vertex.start(), direction) {
                Some(next) => vertex = next,
                None => return radiance + tint * self.scene.background,
            }
            radiance += tint * vertex.emission;
        }

        // A point light's contribution is the same for all paths.
        let points = self.emitters.points.iter().filter_map(|point| point.towards(vertex.position));
        let exact: Vec3 = points.map(|light| self.lit(&vertex, &light, 1.0, [0.0; 2])).sum();
        let paths = settings.spp.max(1);
        let sampled: Vec3 =
            (0..paths).map(|path| self.light_path(&vertex, bounces, settings, path, rng)).sum();
        radiance + tint * (exact + sampled / paths as f32)
    }

    /// The radiance of one light path from `first`: the contributions of quad lights, scattered rays and further
    /// bounces.
    fn light_path(
        &self,
        first: &Vertex,
        bounces: u32,
        settings: &TraceSettings,
        path: u32,
        rng: &mut Rng,
    ) -> Vec3 {
        let paths = settings.spp.max(1);
        let mut vertex = *first;
        let mut throughput = Vec3::ONE;
        let mut radiance = Vec3::ZERO;
        for bounce in bounces..=settings.max_bounces {
            let (at_first, at_last) = (bounce == bounces, bounce == settings.max_bounces);
            let scattered = if let Some((direction, color)) = vertex.mirror() {
                throughput *= color;
                (!at_last).then_some((direction, f32::INFINITY))
            } else {
                let shares = match settings.mode {
                    _ if at_last => [0.0; 2],
                    Mode::Path => vertex.bsdf.lobe_shares(),
                    Mode::Direct if at_first && vertex.bsdf.is_glossy() => [0.0, 1.0],
                    Mode::Direct => [0.0; 2],
                };
                if at_first {
                    for (light, quad) in (FIRST_LIGHT_PAIR..).zip(&self.emitters.quads) {
                        if let Some(light) = quad.towards(vertex.position, rng.stratified(light, path, paths))
                        {
                            radiance += self.lit(&vertex, &light, 1.0, shares);
                        }
                    }
                } else {
                    radiance += throughput * self.one_light(&vertex, shares, rng);
                }
                let [choice, uv] = if at_first {
                    [rng.stratified(LOBE_PAIR, path, paths), rng.stratified(DIRECTION_PAIR, path, paths)]
                } else {
                    [rng.next_pair(), rng.next_pair()]
                };
                vertex.scatter(shares, choice[0], uv).map(|(direction, weight, pdf)| {
                    throughput *= weight;
                    (direction, pdf)
                })
            };
            let Some((direction, pdf)) = scattered else { break };
            if bounce >= ROULETTE_BOUNCE {
                let survival = throughput.max_element().min(MAX_SURVIVAL);
                if rng.next_f32() >= survival {
                    break;
                }
                throughput /= survival;
            }
            let light_probability = if at_first { 1.0 } else { self.light_probability() };
            let origin = Origin { position: vertex.position, pdf, light_probability };
            let Some(mut next) = self.vertex(vertex.start(), direction) else {
                radiance += throughput * self.scene.background;
                break;
            };
            radiance += throughput * next.emission * self.weight_of_hit(&origin, direction, &next);
            if settings.mode == Mode::Direct {
                next.bsdf.roughen(REFLECTED_ALPHA);
            }
            vertex = next;
        }
        radiance
    }

    /// The contribution of one light, chosen at random from all lights, scattered towards the viewer of `vertex`.
    fn one_light(&self, vertex: &Vertex, shares: PerLobe, rng: &mut Rng) -> Vec3 {
        let Emitters { quads, points, .. } = &self.emitters;
        let count = quads.len() + points.len();
        if count == 0 {
            return Vec3::ZERO;
        }
        let index = ((rng.next_f32() * count as f32) as usize).min(count - 1);
        let light = match quads.get(index) {
            Some(quad) => quad.towards(vertex.position, rng.next_pair()),
            None => points[index - quads.len()].towards(vertex.position),
        };
        light.map_or(Vec3::ZERO, |light| self.lit(vertex, &light, self.light_probability(), shares))
    }

    /// The probability with which [`Tracer::one_light`] chooses each light.
    fn light_probability(&self) -> f32 {
        1.0 / (self.emitters.quads.len() + self.emitters.points.len()).max(1) as f32
    }

    /// The contribution of a sampled light, scattered by both lobes towards the viewer of `vertex`; black in shadow.
    /// `shares` are the probabilities with which a scattered ray of each lobe is traced, which may hit the light too.
    fn lit(&self, vertex: &Vertex, light: &Incident, probability: f32, shares: PerLobe) -> Vec3 {
        if vertex.facing.dot(light.direction) <= 0.0 {
            return Vec3::ZERO;
        }
        let lobes = vertex.bsdf.evaluate(light.direction);
        let light_pdf = light.pdf * probability;
        let reflected: Vec3 = lobes
            .into_iter()
            .zip(shares)
            .map(|(lobe, share)| {
                let rival = share * lobe.pdf;
                if light_pdf > 0.0 { lobe.value * (light_pdf / (light_pdf + rival)) } else { lobe.value }
            })
            .sum();
        let arriving = reflected * light.power / probability;
        if arriving == Vec3::ZERO || !self.bvh.visible(vertex.start(), light.target) {
            return Vec3::ZERO;
        }
        arriving
    }

    /// The weight of the emission of a face that a scattered ray hit: by the balance heuristic if the face belongs to a
    /// quad light, otherwise 1.
    fn weight_of_hit(&self, origin: &Origin, direction: Vec3, hit: &Vertex) -> f32 {
        if hit.emission == Vec3::ZERO || origin.pdf.is_infinite() {
            return 1.0;
        }
        let quad = self.emitters.quad_of(hit.face);
        match quad.and_then(|quad| quad.pdf(origin.position, hit.position, direction)) {
            Some(rival) => origin.pdf / (origin.pdf + rival * origin.light_probability),
            None => 1.0,
        }
    }

    /// The nearest surface along a ray of unit direction.
    fn vertex(&self, origin: Vec3, direction: Vec3) -> Option<Vertex> {
        let Intersection { face, weights } = self.bvh.closest(origin, direction)?;
        let mesh = &self.scene.mesh;
        let index = face as usize;
        let corners = mesh.triangles[index].map(|i| mesh.positions[i as usize]);
        let material: &Material = &self.scene.materials[mesh.material[index] as usize];
        let to_viewer = -direction;
        let front = mesh.face_normals[index].dot(to_viewer) > 0.0;
        let side = if front { 1.0 } else { -1.0 };
        let facing = mesh.face_normals[index] * side;
        let shading = match mesh.corner_normals.get(index) {
            Some(normals) => (interpolate(*normals, weights) * side).normalize_or(facing),
            None => facing,
        };
        Some(Vertex {
            position: interpolate(corners, weights),
            face,
            facing,
            to_viewer,
            reach: corners.map(|corner| corner.abs().max_element()).into_iter().fold(0.0, f32::max),
            bsdf: Bsdf::new(material, shading, to_viewer),
            emission: if front { material.emission } else { Vec3::ZERO },
        })
    }
}

impl Vertex {
    /// The start of rays from the vertex. It is off the surface, and slightly towards the viewer, so that in a corner
    /// it is off the other surface too.
    fn start(&self) -> Vec3 {
        offset(self.position, self.facing + self.to_viewer, self.reach)
    }

    /// The reflected direction and its tint, if the surface is a mirror.
    fn mirror(&self) -> Option<(Vec3, Vec3)> {
        let (direction, color) = self.bsdf.mirror()?;
        // A bent shading normal may reflect into the surface.
        let depth = self.facing.dot(direction).min(0.0);
        Some(((direction - 2.0 * depth * self.facing).normalize(), color))
    }

    /// Samples a lobe by `shares`, and a direction of the lobe. Returns direction, weight and density, of which the
    /// last two include the lobe's probability; `None` if `shares` are 0 or the direction points into the surface.
    fn scatter(&self, shares: PerLobe, choice: f32, uv: [f32; 2]) -> Option<(Vec3, Vec3, f32)> {
        let [diffuse, specular] = shares;
        if diffuse + specular == 0.0 {
            return None;
        }
        let (lobe, share) =
            if choice < diffuse { (Lobe::Diffuse, diffuse) } else { (Lobe::Specular, specular) };
        let scatter = self.bsdf.sample(lobe, uv)?;
        // A bent shading normal can send rays through the surface.
        let outside = self.facing.dot(scatter.direction) > 0.0;
        outside.then(|| (scatter.direction, scatter.weight / share, scatter.pdf * share))
    }
}

/// Weighted sum of three corners' values.
fn interpolate(corners: [Vec3; 3], weights: Vec3) -> Vec3 {
    corners[0] * weights.x + corners[1] * weights.y + corners[2] * weights.z
}

/// `position` moved in `direction` by more than the rounding error of coordinates that are at most `reach`.
fn offset(position: Vec3, direction: Vec3, reach: f32) -> Vec3 {
    position + direction * (reach * OFFSET_ULPS * f32::EPSILON)
}

#[cfg(test)]
mod tests;
