//! The ray tracer that answers requests for samples.
//!
//! A sample is the primary hit of a ray (the first visible surface) and the mean radiance of `spp` light paths that
//! start there. The result depends only on the ray, the seed and the key: it has the same bits on any number of
//! threads.
//!
//! Light reaches a path in two ways: lights are sampled at every vertex (next-event estimation), and scattered rays may
//! hit an emissive face. Emissive faces are found in both ways, which are therefore weighted by the balance heuristic
//! (Veach and Guibas 1995), separately for each lobe. The background and what glass bends are found only by scattered
//! rays, and count in full.
//!
//! Shadow rays go straight through surfaces that blend and through thin clear glass. Through a body of glass they do so
//! in direct mode only, as an approximation; in path mode it casts the shadow that it has, and its caustics are found by
//! scattered rays, but not those of point lights.

mod albedo;
mod bvh;
mod emitter;
mod queue;
mod rng;
mod surface;
mod variance;

use std::cell::Cell;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use glam::Vec3;
use rayon::prelude::*;

use crate::mesh::interpolate;
use crate::{Alpha, Look, Material, Pose, Scene};
use bvh::{Bvhs, Intersection};
use emitter::{Emitters, Incident};
pub use queue::{AsyncTracer, TaggedHit, TaggedJob};
pub use rng::Rng;
use surface::{Bsdf, Lobe, LobeValue, PerLobe, Scatter};
pub use variance::UNKNOWN_VARIANCE;
use variance::{Groups, luminance};

/// Means "no face" in [`Hit::face`].
const NO_FACE: u32 = crate::NO_FACE;

/// Russian roulette begins at this bounce.
const ROULETTE_BOUNCE: u32 = 3;

/// Maximum probability with which a path survives roulette, so that paths end even in a closed white room.
const MAX_SURVIVAL: f32 = 0.97;

/// Minimum lobe width (alpha) of a glossy surface that is reflected in another one, in direct mode: there, only lights
/// are sampled, so that a narrow lobe would give rare, bright pixels.
const REFLECTED_ALPHA: f32 = 0.1;

/// Distance from the surface at which rays start, in units in the last place of the point's coordinates.
const OFFSET_ULPS: f32 = 32.0;

/// The coordinates of a triangle, in those of a point in it, up to which single precision places the point by its weights.
const ROUGHLY_ALIKE: f32 = 4.0;

/// What weights of f32 may shift a point at most, in sizes of its triangle.
const MOST_SHIFT: f64 = 1e-5;

/// The most transparent layers that a ray passes between two scattering events.
const MOST_PASSES: u32 = 64;

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
    /// Estimated variance of its luminance, from the differences between its light paths; [`UNKNOWN_VARIANCE`] if there
    /// was only one.
    pub variance: f32,
    /// Index of the triangle that it hit; `u32::MAX` if none.
    pub face: u32,
    /// Unit normal of that triangle, on the side of the ray's origin; zero if there is none.
    pub normal: Vec3,
    /// How much the radiance depends on the direction from which it is seen: roughly, by what share of itself it may
    /// change per radian. 0 for diffuse surfaces, 500 for mirrors and clear glass.
    pub sharpness: f32,
    /// The surface's [`Look::albedo`] where it differs from point to point, by maps or colours of the mesh, and the radiance
    /// is light that the surface scatters; 1 elsewhere. The radiance divided by it shows no texture.
    pub pattern: Vec3,
}

impl Default for Hit {
    /// The sample of a ray that hits nothing, with black radiance.
    fn default() -> Self {
        Self {
            position: Vec3::NEG_Z,
            hit: false,
            radiance: Vec3::ZERO,
            variance: 0.0,
            face: NO_FACE,
            normal: Vec3::ZERO,
            sharpness: 0.0,
            pattern: Vec3::ONE,
        }
    }
}

/// A request for one sample.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Job {
    /// Where the ray starts, metres.
    pub origin: Vec3,
    /// Its direction, of any length.
    pub direction: Vec3,
    /// Where on it surfaces begin to count, in lengths of `direction`: the near plane of a camera, for a direction of one
    /// unit along its axis.
    pub start: f32,
    /// Key of the random numbers; see [`Rng::key`].
    pub key: u64,
}

/// Traces rays through a scene.
pub struct Tracer {
    scene: Arc<Scene>,
    bvh: Bvhs,
    emitters: Emitters,
    /// What each material looks like everywhere, if it does not differ from point to point.
    looks: Arc<Vec<Option<Look>>>,
    /// Whether materials have holes or culled backs, or are transparent.
    has_gaps: bool,
    is_translucent: bool,
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

/// The first surface that a ray hits, and what it looks like, without the light on it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Surface {
    /// The point that was hit, metres.
    pub position: Vec3,
    /// Index of the triangle.
    pub face: u32,
    /// Unit shading normal, bent by the material's normal map, on the side of the triangle that the ray comes from.
    pub normal: Vec3,
    /// The share of light that it scatters, as [`Look::albedo`].
    pub albedo: Vec3,
    /// Radiance that it emits towards the ray's origin.
    pub emission: Vec3,
    /// Perceptual roughness in [0, 1].
    pub roughness: f32,
}

/// Where a ray meets the first surface.
struct Met<'a> {
    position: Vec3,
    face: u32,
    /// Whether the ray comes from the front of the triangle.
    front: bool,
    /// Unit geometric and shading normal, on the viewer's side.
    facing: Vec3,
    normal: Vec3,
    look: &'a Look,
    /// Whether it looks so everywhere.
    is_plain: bool,
    /// Radiance that the surface emits towards the viewer, where it is opaque.
    emission: Vec3,
}

/// A point of a surface, seen from the ray that hit it.
#[derive(Clone, Copy)]
struct Vertex {
    position: Vec3,
    face: u32,
    /// Unit geometric normal, on the viewer's side.
    facing: Vec3,
    to_viewer: Vec3,
    bsdf: Bsdf,
    /// The probability with which a ray does not just pass through.
    opacity: f32,
    /// Radiance that the surface emits towards the viewer.
    emission: Vec3,
    /// The share of the light that the medium between the vertex and its viewer leaves.
    kept: Vec3,
}

/// The densities with which a scattered ray was sampled, from which follows the weight of the light that it hits.
#[derive(Clone, Copy)]
struct Origin {
    position: Vec3,
    /// Density of the ray's direction times the probability of its lobe; infinite for a mirror.
    pdf: f32,
    /// Whether one light was sampled at the origin, and not all.
    of_one: bool,
    /// The normal, where light from behind did not count.
    facing: Option<Vec3>,
}

impl Tracer {
    /// Builds the bounding volume hierarchies of `scene`.
    pub fn new(scene: Arc<Scene>) -> Self {
        let bvh = Bvhs::new(&scene);
        let emitters = Emitters::new(&scene);
        let plain = |material: &Material| material.maps.is_empty() && scene.mesh.corner_colors.is_empty();
        let look = |material: &Material| plain(material).then(|| Look::of(material));
        let used = |is: fn(&Material) -> bool| scene.materials.iter().any(is);
        Self {
            looks: Arc::new(scene.materials.iter().map(look).collect()),
            has_gaps: used(|material| material.alpha != Alpha::Opaque || material.culled),
            is_translucent: used(Material::is_transparent),
            bvh,
            emitters,
            non_finite: Arc::default(),
            scene,
        }
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
            looks: self.looks.clone(),
            has_gaps: self.has_gaps,
            is_translucent: self.is_translucent,
            non_finite: self.non_finite.clone(),
            scene,
        }
    }

    /// The traced scene.
    pub fn scene(&self) -> &Arc<Scene> {
        &self.scene
    }

    /// Returns true if no surface that is seen from the point `from` lies strictly between it and another; transparent ones
    /// count, holes do not.
    pub fn visible(&self, from: Vec3, to: Vec3) -> bool {
        self.sees(from, to, to - from, || true)
    }

    /// Returns true if the light at one point reaches another, which is that the other sees it. `spend` is called before
    /// each test of a triangle; once it returns false, something is taken to be in the way.
    pub(crate) fn reaches(&self, light: Vec3, point: Vec3, spend: impl Fn() -> bool) -> bool {
        self.sees(light, point, light - point, spend)
    }

    /// Returns true if no surface that is seen in a direction lies between two points.
    fn sees(&self, from: Vec3, to: Vec3, direction: Vec3, spend: impl Fn() -> bool) -> bool {
        if self.has_gaps {
            self.bvh.visible(from, to, |hit| self.is_there(hit, direction), spend)
        } else {
            self.bvh.visible(from, to, |_| true, spend)
        }
    }

    /// The nearest surface along a ray from `origin` in `direction` (of any length), from `start` such lengths on.
    pub(crate) fn first_surface(&self, origin: Vec3, direction: Vec3, start: f32) -> Option<Seen> {
        let start = start * direction.length();
        let vertex = self.vertex_from(origin, direction.normalize_or_zero(), start)?;
        let Vertex { position, face, facing, .. } = vertex;
        Some(Seen { position, face, facing, start: vertex.start() })
    }

    /// The nearest surface along a ray from `origin` (metres) in `direction` (of any length), from `start` such lengths
    /// on, and what it looks like; `None` if there is none. It is the surface of [`Tracer::trace_from`]'s sample.
    pub fn surface(&self, origin: Vec3, direction: Vec3, start: f32) -> Option<Surface> {
        let start = start * direction.length();
        self.meet(origin, direction.normalize_or_zero(), start, |met| Surface {
            position: met.position,
            face: met.face,
            normal: met.normal,
            albedo: met.look.albedo(),
            emission: met.look.opacity * met.emission,
            roughness: met.look.roughness,
        })
    }

    /// The number of lights, for [`Tracer::sees_light`].
    pub(crate) fn light_count(&self) -> usize {
        self.emitters.quads.len() + self.emitters.points.len()
    }

    /// Returns true if nothing lies between a surface and the point `at` of the light with index `light`, or `None` if
    /// the surface or the light faces away. `at` is in [0, 1]^2 for quad lights and has no effect for point lights.
    pub(crate) fn sees_light(&self, surface: &Seen, light: usize, at: [f32; 2]) -> Option<bool> {
        let incident = self.emitters.choose(&self.scene, light, surface.position, || at);
        let incident = incident.filter(|light| surface.facing.dot(light.direction) > 0.0)?;
        Some(self.visible(surface.start, incident.target))
    }

    /// The number of samples so far, in all poses of the scene, whose radiance was not finite. They are returned as
    /// black.
    pub fn non_finite(&self) -> u64 {
        self.non_finite.load(Ordering::Relaxed)
    }

    /// The sample of the ray from `origin` (metres) in `direction` (of any length).
    pub fn trace(&self, origin: Vec3, direction: Vec3, settings: &TraceSettings, rng: &mut Rng) -> Hit {
        self.trace_from(origin, direction, 0.0, settings, rng)
    }

    /// The sample of the same ray if it meets no surface before `start` lengths of `direction`.
    pub fn trace_from(
        &self,
        origin: Vec3,
        direction: Vec3,
        start: f32,
        settings: &TraceSettings,
        rng: &mut Rng,
    ) -> Hit {
        let start = start * direction.length();
        let direction = direction.normalize_or_zero();
        let first = self.meet(origin, direction, start, |met| (met.pattern(), met.vertex(origin, direction)));
        let Some((pattern, first)) = first else {
            return Hit { position: direction, radiance: self.scene.beyond(direction), ..Hit::default() };
        };
        let (mut radiance, mut variance) = self.radiance(&first, settings, rng);
        if !radiance.is_finite() {
            self.non_finite.fetch_add(1, Ordering::Relaxed);
            (radiance, variance) = (Vec3::ZERO, UNKNOWN_VARIANCE);
        }
        Hit {
            position: first.position,
            hit: true,
            radiance,
            variance: variance.min(f32::MAX),
            face: first.face,
            normal: first.facing,
            sharpness: first.sharpness(),
            pattern,
        }
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
        let Job { origin, direction, start, key } = *job;
        self.trace_from(origin, direction, start, settings, &mut Rng::new(seed, key))
    }

    /// The radiance from a vertex towards its viewer, and the variance of its luminance.
    fn radiance(&self, first: &Vertex, settings: &TraceSettings, rng: &mut Rng) -> (Vec3, f32) {
        // Reflection in mirrors is deterministic, so it is traced once for all light paths.
        let mut next;
        let mut vertex = first;
        let mut tint = Vec3::ONE;
        let mut radiance = vertex.shown();
        let mut bounces = 0;
        while let Some((direction, color)) = vertex.mirror() {
            if bounces == settings.max_bounces {
                return (radiance, 0.0);
            }
            bounces += 1;
            tint *= color;
            next = self.vertex(vertex.start(), direction);
            match &next {
                Some(next) => vertex = next,
                None => return (radiance + tint * self.scene.beyond(direction), 0.0),
            }
            tint *= vertex.kept;
            radiance += tint * vertex.shown();
        }

        // A point light's contribution is the same for all paths.
        let points = self.emitters.points.iter().filter_map(|point| point.towards(vertex.position));
        let exact: Vec3 = points.map(|light| self.lit(vertex, &light, 1.0, [0.0; 3], settings.mode)).sum();
        let paths = settings.spp.max(1);
        let mut sampled = Vec3::ZERO;
        let mut groups = Groups::new(paths);
        for path in 0..paths {
            let path_radiance = self.light_path(vertex, bounces, settings, path, rng);
            sampled += path_radiance;
            groups.add(path, luminance(tint * path_radiance));
        }
        let radiance = radiance + tint * (vertex.opacity * exact + sampled / paths as f32);
        (radiance, groups.variance_of_mean())
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
        let mut next;
        let mut vertex = first;
        let mut throughput = Vec3::ONE;
        let mut radiance = Vec3::ZERO;
        let mut origin = Origin { position: first.position, pdf: f32::INFINITY, of_one: false, facing: None };
        let (mut bounce, mut passes, mut at_first) = (bounces, 0, true);
        // Whether the eye sees the vertex, directly or by perfect reflection and refraction.
        let mut unscattered = true;
        loop {
            let at_last = bounce == settings.max_bounces;
            let (start, direction);
            if vertex.opacity < 1.0 && rng.next_f32() >= vertex.opacity {
                passes += 1;
                if passes > MOST_PASSES {
                    break;
                }
                (start, direction) = (vertex.beyond(), -vertex.to_viewer);
            } else {
                let scattered = if let Some((direction, color)) = vertex.mirror() {
                    (!at_last)
                        .then_some((Lobe::Specular, Scatter { direction, weight: color, pdf: f32::INFINITY }))
                } else {
                    let shares = match settings.mode {
                        _ if at_last => [0.0; 3],
                        Mode::Path => vertex.bsdf.lobe_shares(),
                        Mode::Direct => vertex.bsdf.direct_shares(unscattered),
                    };
                    radiance += throughput
                        * if at_first {
                            self.first_lights(vertex, shares, settings, path, rng)
                        } else if unscattered {
                            self.all_lights(vertex, shares, settings.mode, rng)
                        } else {
                            self.one_light(vertex, shares, settings.mode, rng)
                        };
                    if shares == [0.0; 3] {
                        break;
                    }
                    let (choice, uv) = if at_first {
                        let is_choice = shares.iter().filter(|&&share| share > 0.0).count() > 1;
                        let choice = if is_choice { rng.stratified(LOBE_PAIR, path, paths)[0] } else { 0.0 };
                        (choice, rng.stratified(DIRECTION_PAIR, path, paths))
                    } else {
                        (rng.next_pair()[0], rng.next_pair())
                    };
                    vertex.scatter(shares, choice, uv)
                };
                let Some((lobe, scatter)) = scattered else { break };
                throughput *= scatter.weight;
                if bounce >= ROULETTE_BOUNCE {
                    let survival = throughput.max_element().min(MAX_SURVIVAL);
                    if rng.next_f32() >= survival {
                        break;
                    }
                    throughput /= survival;
                }
                bounce += 1;
                start = if lobe == Lobe::Transmit { vertex.beyond() } else { vertex.start() };
                direction = scatter.direction;
                let is_perfect = scatter.pdf.is_infinite();
                // Shadow rays go straight through thin glass, in direct mode through all: its light is weighted as theirs.
                let like_shadows = vertex.bsdf.is_thin() || settings.mode == Mode::Direct && !unscattered;
                if !(is_perfect && lobe == Lobe::Transmit && like_shadows) {
                    let (position, facing) = (vertex.position, vertex.lit_side());
                    origin = Origin { position, pdf: scatter.pdf, of_one: !unscattered, facing };
                }
                unscattered &= is_perfect;
            }
            at_first = false;
            next = self.vertex(start, direction);
            let Some(next) = &mut next else {
                radiance +=
                    throughput * self.scene.beyond(direction) * self.weight_of_sky(&origin, direction);
                break;
            };
            throughput *= next.kept;
            radiance += throughput * next.shown() * self.weight_of_hit(&origin, direction, next);
            if settings.mode == Mode::Direct && !unscattered {
                next.bsdf.roughen(REFLECTED_ALPHA);
            }
            vertex = next;
        }
        radiance
    }

    /// The contribution of all lights but points at the first vertex, which gets the same points for all paths.
    fn first_lights(
        &self,
        vertex: &Vertex,
        shares: PerLobe,
        settings: &TraceSettings,
        path: u32,
        rng: &mut Rng,
    ) -> Vec3 {
        let paths = settings.spp.max(1);
        let mut sum = Vec3::ZERO;
        let mut pair = FIRST_LIGHT_PAIR;
        for quad in &self.emitters.quads {
            if let Some(light) = quad.towards(vertex.position, rng.stratified(pair, path, paths)) {
                sum += self.lit(vertex, &light, 1.0, shares, settings.mode);
            }
            pair += 1;
        }
        if self.emitters.has_panels() {
            let uv = rng.stratified(pair, path, paths);
            if let Some(light) = self.emitters.panel(&self.scene, vertex.position, uv) {
                sum += self.lit(vertex, &light, 1.0, shares, settings.mode);
            }
        }
        if self.scene.sky.is_some()
            && let Some(light) = self.emitters.sky(vertex.position, rng.stratified(pair + 1, path, paths))
        {
            sum += self.lit(vertex, &light, 1.0, shares, settings.mode);
        }
        sum
    }

    /// The contribution of all lights at a vertex that is seen through glass.
    fn all_lights(&self, vertex: &Vertex, shares: PerLobe, mode: Mode, rng: &mut Rng) -> Vec3 {
        let lights = (0..self.emitters.count()).filter_map(|index| {
            self.emitters.choose(&self.scene, index, vertex.position, || rng.next_pair())
        });
        lights.map(|light| self.lit(vertex, &light, 1.0, shares, mode)).sum()
    }

    /// The contribution of one light, chosen at random, scattered towards the viewer of `vertex`.
    fn one_light(&self, vertex: &Vertex, shares: PerLobe, mode: Mode, rng: &mut Rng) -> Vec3 {
        let (from, facing) = (vertex.position, vertex.lit_side());
        let Some((index, probability)) = self.emitters.choose_one(from, facing, rng.next_f32()) else {
            return Vec3::ZERO;
        };
        let light = self.emitters.choose(&self.scene, index, from, || rng.next_pair());
        light.map_or(Vec3::ZERO, |light| self.lit(vertex, &light, probability, shares, mode))
    }

    /// The contribution of a sampled light, scattered by all lobes towards the viewer of `vertex`; black in shadow.
    /// `shares` are the probabilities with which a scattered ray of each lobe is traced, which may hit the light too.
    fn lit(&self, vertex: &Vertex, light: &Incident, probability: f32, shares: PerLobe, mode: Mode) -> Vec3 {
        let is_front = vertex.facing.dot(light.direction) > 0.0;
        if !is_front && !vertex.bsdf.is_glass() {
            return Vec3::ZERO;
        }
        let lobes = vertex.bsdf.evaluate(light.direction);
        let light_pdf = light.pdf * probability;
        let weighted = |lobe: Lobe| {
            let LobeValue { value, pdf } = lobes[lobe as usize];
            let rival = shares[lobe as usize] * pdf;
            if light_pdf > 0.0 { value * (light_pdf / (light_pdf + rival)) } else { value }
        };
        // A bent shading normal must not let light through the surface.
        let reflected = if is_front {
            weighted(Lobe::Diffuse) + weighted(Lobe::Specular)
        } else {
            weighted(Lobe::Transmit)
        };
        let arriving = reflected * light.power / probability;
        if arriving == Vec3::ZERO {
            return Vec3::ZERO;
        }
        let start = if is_front { vertex.start() } else { vertex.beyond() };
        arriving * self.unblocked(start, light.target, mode)
    }

    /// The share of the light that passes between two points. It goes straight through what blends and through thin
    /// clear glass, in direct mode through all glass.
    fn unblocked(&self, from: Vec3, to: Vec3, mode: Mode) -> Vec3 {
        if !self.is_translucent {
            return Vec3::splat(f32::from(u8::from(self.visible(from, to))));
        }
        let direction = (to - from).normalize_or_zero();
        let passed = Cell::new(Vec3::ONE);
        let blocks = |hit: Intersection| {
            let through =
                if self.is_there(hit, direction) { self.passing(hit, direction, mode) } else { Vec3::ONE };
            passed.set(passed.get() * through);
            through == Vec3::ZERO
        };
        if self.bvh.visible(from, to, blocks, || true) { passed.get() } else { Vec3::ZERO }
    }

    /// The share of light of this direction that goes straight through a surface.
    fn passing(&self, hit: Intersection, direction: Vec3, mode: Mode) -> Vec3 {
        let face = hit.face as usize;
        let material = &self.scene.materials[self.scene.mesh.material[face] as usize];
        if !material.is_transparent() {
            return Vec3::ZERO;
        }
        let look = self.scene.look(face, hit.weights);
        let normal = self.scene.mesh.face_normals[face];
        let through = surface::straight_through(&look, normal.dot(direction).abs(), mode);
        through * look.opacity + (1.0 - look.opacity)
    }

    /// Whether there is a surface where a ray of this direction hits a triangle, and not a hole or a culled back.
    fn is_there(&self, hit: Intersection, direction: Vec3) -> bool {
        let face = hit.face as usize;
        let material = &self.scene.materials[self.scene.mesh.material[face] as usize];
        if material.culled && self.scene.mesh.face_normals[face].dot(direction) >= 0.0 {
            return false;
        }
        material.alpha == Alpha::Opaque || self.scene.opacity(face, hit.weights) > 0.0
    }

    /// The weight of the emission of a face that a scattered ray hit: by the balance heuristic if lights are sampled
    /// there, otherwise 1.
    fn weight_of_hit(&self, origin: &Origin, direction: Vec3, hit: &Vertex) -> f32 {
        if hit.emission == Vec3::ZERO || origin.pdf.is_infinite() {
            return 1.0;
        }
        match self.emitters.pdf(&self.scene, hit.face, origin.position, hit.position, direction) {
            Some((rival, choice)) => origin.pdf / (origin.pdf + rival * self.odds(origin, choice)),
            None => 1.0,
        }
    }

    /// The weight of the sky in a scattered direction, as [`Tracer::weight_of_hit`].
    fn weight_of_sky(&self, origin: &Origin, direction: Vec3) -> f32 {
        match self.emitters.sky_pdf(direction) {
            Some(rival) if origin.pdf.is_finite() => {
                let choice = self.emitters.count() - 1;
                origin.pdf / (origin.pdf + rival * self.odds(origin, choice))
            }
            _ => 1.0,
        }
    }

    /// The probability with which a light was sampled at the origin of a ray.
    fn odds(&self, origin: &Origin, choice: usize) -> f32 {
        if origin.of_one { self.emitters.probability(choice, origin.position, origin.facing) } else { 1.0 }
    }

    /// The nearest surface along a ray of unit direction.
    fn vertex(&self, origin: Vec3, direction: Vec3) -> Option<Vertex> {
        self.vertex_from(origin, direction, 0.0)
    }

    /// The nearest surface along a ray of unit direction, `start` metres from its origin or farther.
    fn vertex_from(&self, origin: Vec3, direction: Vec3, start: f32) -> Option<Vertex> {
        self.meet(origin, direction, start, |met| met.vertex(origin, direction))
    }

    /// Finds the nearest surface along a ray of unit direction, `start` metres from its origin or farther; `then` makes
    /// of it what is needed.
    #[inline(always)]
    fn meet<T>(&self, origin: Vec3, direction: Vec3, start: f32, then: impl FnOnce(Met) -> T) -> Option<T> {
        let hit = if self.has_gaps {
            self.bvh.closest(origin, direction, start, |hit| self.is_there(hit, direction))
        } else {
            self.bvh.closest(origin, direction, start, |_| true)
        };
        let Intersection { face, weights } = hit?;
        let mesh = &self.scene.mesh;
        let index = face as usize;
        let plain = self.looks[mesh.material[index] as usize].as_ref();
        let here;
        let look = match plain {
            Some(look) => look,
            None => {
                here = self.scene.look(index, weights);
                &here
            }
        };
        let front = mesh.face_normals[index].dot(-direction) > 0.0;
        let facing = if front { mesh.face_normals[index] } else { -mesh.face_normals[index] };
        let shading = match mesh.corner_normals.get(index) {
            // Inside-out meshes have their normals on either side.
            Some(normals) => turned(interpolate(*normals, weights).normalize_or(facing), facing),
            None => facing,
        };
        let position = meeting_point(mesh.corners(index), weights, origin, direction);
        let emission = match look {
            Look { unlit: true, color, .. } => *color,
            _ if front || look.double_sided => look.emission,
            _ => Vec3::ZERO,
        };
        let normal = match plain {
            Some(_) => shading,
            None => turned(self.scene.mapped_normal(index, weights, front, shading), facing),
        };
        let is_plain = plain.is_some();
        Some(then(Met { position, face, front, facing, normal, look, is_plain, emission }))
    }
}

impl Met<'_> {
    /// See [`Hit::pattern`].
    fn pattern(&self) -> Vec3 {
        if self.is_plain || !self.look.only_scatters() { Vec3::ONE } else { self.look.albedo() }
    }

    /// The point that a ray from `origin` of unit direction met.
    #[inline(always)]
    fn vertex(self, origin: Vec3, direction: Vec3) -> Vertex {
        let Met { position, face, front, facing, normal, look, emission, .. } = self;
        let to_viewer = -direction;
        let kept = match look.medium {
            Some(medium) if !front => (-medium.absorption * origin.distance(position)).exp(),
            _ => Vec3::ONE,
        };
        Vertex {
            position,
            face,
            facing,
            to_viewer,
            bsdf: if look.unlit {
                Bsdf::black(normal, to_viewer)
            } else {
                Bsdf::new(look, normal, to_viewer, front)
            },
            opacity: look.opacity,
            emission,
            kept,
        }
    }
}

impl Vertex {
    /// The start of rays from the vertex. It is off the surface, and slightly towards the viewer, so that in a corner
    /// it is off the other surface too.
    fn start(&self) -> Vec3 {
        self.off(self.facing + self.to_viewer)
    }

    /// The start of rays on the other side of the surface.
    fn beyond(&self) -> Vec3 {
        self.off(-self.facing - self.to_viewer)
    }

    /// The normal of the only side on which light counts; none if it counts on both.
    fn lit_side(&self) -> Option<Vec3> {
        (!self.bsdf.is_glass()).then_some(self.facing)
    }

    fn off(&self, direction: Vec3) -> Vec3 {
        offset(self.position, direction, self.position.abs().max_element())
    }

    /// What the eye sees of it without any light.
    fn shown(&self) -> Vec3 {
        self.opacity * self.emission
    }

    /// See [`Hit::sharpness`].
    fn sharpness(&self) -> f32 {
        // What is seen through a surface that blends moves against it.
        if self.opacity < 1.0 { 1.0 / surface::MIN_ALPHA } else { self.bsdf.sharpness() }
    }

    /// The reflected direction and its tint, if the surface is a mirror.
    fn mirror(&self) -> Option<(Vec3, Vec3)> {
        let (direction, color) = self.bsdf.mirror().filter(|_| self.opacity == 1.0)?;
        Some((self.outwards(direction), color))
    }

    /// A perfectly reflected direction; a bent shading normal may have reflected it into the surface.
    fn outwards(&self, direction: Vec3) -> Vec3 {
        let depth = self.facing.dot(direction).min(0.0);
        (direction - 2.0 * depth * self.facing).normalize()
    }

    /// Samples a lobe by `shares`, and a direction of the lobe. Weight and density include the lobe's probability; `None`
    /// if `shares` are 0 or the direction points to the wrong side of the surface.
    fn scatter(&self, shares: PerLobe, choice: f32, uv: [f32; 2]) -> Option<(Lobe, Scatter)> {
        let mut end = 0.0;
        let chosen = Lobe::ALL.into_iter().filter(|&lobe| shares[lobe as usize] > 0.0);
        let lobe = chosen.reduce(|before, lobe| {
            end += shares[before as usize];
            if choice < end { before } else { lobe }
        })?;
        let share = shares[lobe as usize];
        let mut scatter = self.bsdf.sample(lobe, uv)?;
        if scatter.pdf.is_infinite() && lobe == Lobe::Specular {
            scatter.direction = self.outwards(scatter.direction);
        }
        // A bent shading normal can send rays to the wrong side.
        let is_outside = self.facing.dot(scatter.direction) > 0.0;
        let scatter = Scatter { weight: scatter.weight / share, pdf: scatter.pdf * share, ..scatter };
        (is_outside != (lobe == Lobe::Transmit)).then_some((lobe, scatter))
    }
}

/// A normal on the side of `facing`.
fn turned(normal: Vec3, facing: Vec3) -> Vec3 {
    if normal.dot(facing) < 0.0 { -normal } else { normal }
}

/// The point where a ray meets a triangle, of these weights, to a few units in the last place of its own coordinates,
/// however large the triangle is.
fn meeting_point(corners: [Vec3; 3], weights: Vec3, origin: Vec3, direction: Vec3) -> Vec3 {
    let near = interpolate(corners, weights);
    let [a, b, c] = corners.map(|corner| corner.abs().max_element());
    // The sum is exact to half a unit in the last place of the largest corner for each of its terms.
    if a.max(b).max(c) <= ROUGHLY_ALIKE * near.abs().max_element() {
        near
    } else {
        exact_meeting_point(corners, weights, origin, direction)
    }
}

/// The same in double precision. Weights of f32 place the point to some millionths of the triangle's size, along the
/// triangle.
#[cold]
fn exact_meeting_point(corners: [Vec3; 3], weights: Vec3, origin: Vec3, direction: Vec3) -> Vec3 {
    let [a, b, c] = corners.map(Vec3::as_dvec3);
    let [first, second] = [b - a, c - a];
    let weights = weights.as_dvec3();
    let near = a + first * weights.y + second * weights.z;
    let (normal, origin, direction) = (first.cross(second), origin.as_dvec3(), direction.as_dvec3());
    let met = origin + direction * (normal.dot(a - origin) / normal.dot(direction));
    // A ray along the triangle's plane meets it anywhere.
    let size = first.abs().max(second.abs()).max_element();
    if (met - near).abs().max_element() <= MOST_SHIFT * size { met.as_vec3() } else { near.as_vec3() }
}

/// `position` moved in `direction` by more than the rounding error of coordinates that are at most `reach`.
fn offset(position: Vec3, direction: Vec3, reach: f32) -> Vec3 {
    position + direction * (reach * OFFSET_ULPS * f32::EPSILON)
}

#[cfg(test)]
mod tests;
