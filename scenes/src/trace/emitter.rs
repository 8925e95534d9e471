//! The lights of a scene as the tracer samples them: point and spot lights, quad lights one by one, and all other
//! emissive triangles by their power.

use std::collections::HashMap;
use std::f32::consts::{FRAC_1_PI, PI};
use std::sync::Arc;

use glam::Vec3;

use super::variance::luminance;
use crate::light::cone;
use crate::mesh::interpolate;
use crate::{Light, Scene, Sky};

/// The share of choices that is even among all lights, as the brightest one may be hidden.
const EVEN_SHARE: f32 = 0.5;

/// A larger irradiance counts as this much, so that sums are finite however near a point light is.
const MOST_IRRADIANCE: f32 = 1e30;

/// Cosines to the middle of a light count as at least this much, as parts of it may be seen less obliquely.
const LEAST_COSINE: f32 = 0.1;

/// A quad light, ready to be sampled by area.
#[derive(Clone, Copy, Debug)]
pub(super) struct Quad {
    corner: Vec3,
    u: Vec3,
    v: Vec3,
    /// Unit normal on the emitting side.
    normal: Vec3,
    area: f32,
    /// The largest coordinate of its corners, at most.
    reach: f32,
    radiance: Vec3,
    /// Luminance of the radiance.
    brightness: f32,
    /// Radius of a sphere around its centre that holds it.
    radius: f32,
    /// True if its triangles are part of the mesh, so that rays can hit them.
    in_mesh: bool,
}

/// A point light, or a spot.
#[derive(Clone, Copy, Debug)]
pub(super) struct Point {
    position: Vec3,
    intensity: Vec3,
    /// Unit axis of a spot, and the cosines of the angles where its cone is full and where it ends.
    cone: Option<(Vec3, [f32; 2])>,
}

/// The unoccluded light from one light at a shaded point.
#[derive(Clone, Copy, Debug)]
pub(super) struct Incident {
    /// End of the shadow ray.
    pub target: Vec3,
    /// Unit direction from the shaded point.
    pub direction: Vec3,
    /// Radiance divided by the density; for a point light, the irradiance on a plane perpendicular to the direction.
    pub power: Vec3,
    /// Density of the direction, 1/sr, or 0 if no scattered ray can hit the light.
    pub pdf: f32,
}

/// How probable choices are.
struct Odds {
    /// Probability for each unit of irradiance, and of each light that sends any.
    scale: f32,
    each: f32,
}

impl Odds {
    fn of(&self, bound: f32) -> f32 {
        if bound > 0.0 { bound * self.scale + self.each } else { 0.0 }
    }
}

/// The cosine at a surface of the direction `to` to a light's centre, `distance` away, of a light of this radius; 0 if all
/// of the light is behind the surface.
fn surface_cosine(to: Vec3, distance: f32, radius: f32, facing: Option<Vec3>) -> f32 {
    let Some(facing) = facing else { return 1.0 };
    let height = facing.dot(to);
    if height <= -radius { 0.0 } else { (height / distance).max(LEAST_COSINE) }
}

impl Point {
    /// See [`Emitters::bounds`].
    fn bound(&self, from: Vec3, facing: Option<Vec3>) -> f32 {
        let Some(light) = self.towards(from) else { return 0.0 };
        luminance(light.power) * surface_cosine(light.direction, 1.0, 0.0, facing)
    }

    pub fn towards(&self, from: Vec3) -> Option<Incident> {
        let (direction, distance) = (self.position - from).normalize_and_length();
        let shown = self.cone.map_or(1.0, |(axis, cosines)| cone(-axis.dot(direction), cosines));
        let power = self.intensity * shown / (distance * distance);
        (distance > 0.0 && shown > 0.0).then_some(Incident {
            target: self.position,
            direction,
            power,
            pdf: 0.0,
        })
    }
}

impl Quad {
    /// See [`Emitters::bounds`].
    fn bound(&self, from: Vec3, facing: Option<Vec3>) -> f32 {
        let from_corner = from - self.corner;
        let height = from_corner.dot(self.normal);
        let to_center = 0.5 * (self.u + self.v) - from_corner;
        if height <= 0.0 {
            return 0.0;
        }
        let cosine = surface_cosine(to_center, to_center.length(), self.radius, facing);
        if cosine == 0.0 {
            return 0.0;
        }
        // By the nearest point of the quad, or nearly, if its sides are not perpendicular.
        let along = |side: Vec3| side * (from_corner.dot(side) / side.length_squared()).clamp(0.0, 1.0);
        let distance = (along(self.u) + along(self.v) - from_corner).length().max(height);
        // As of a disc: it covers no more than a hemisphere.
        let solid_angle = self.area * (height / distance) / (distance * distance + self.area * FRAC_1_PI);
        self.brightness * cosine * solid_angle
    }

    /// The light at `from` from the point `(s, t)` in [0, 1)^2 of the quad; `None` if `from` is behind the quad.
    #[inline]
    pub fn towards(&self, from: Vec3, [s, t]: [f32; 2]) -> Option<Incident> {
        let point = self.corner + s * self.u + t * self.v;
        let direction = (point - from).try_normalize()?;
        let pdf = self.pdf(from, point, direction)?;
        // The shadow ray ends several units in the last place of its coordinates in front of the light.
        let target = super::offset(point, self.normal, self.reach);
        Some(Incident {
            target,
            direction,
            power: self.radiance / pdf,
            pdf: if self.in_mesh { pdf } else { 0.0 },
        })
    }

    /// Density, 1/sr, with which [`Quad::towards`] samples `direction`, the direction to `point`; `None` if `from` is
    /// behind the quad.
    pub fn pdf(&self, from: Vec3, point: Vec3, direction: Vec3) -> Option<f32> {
        area_pdf(from, point, -direction.dot(self.normal), self.area)
    }
}

/// Density, 1/sr, of the direction to a point that is sampled uniformly on an area which is seen at this cosine; `None`
/// if the area is not seen.
#[inline]
fn area_pdf(from: Vec3, point: Vec3, cosine: f32, area: f32) -> Option<f32> {
    let pdf = (point - from).length_squared() / (cosine * area);
    // Negative or infinite where the cosine is not positive.
    (pdf > 0.0 && pdf.is_finite()).then_some(pdf)
}

/// Emissive triangles that are not quad lights, chosen by their power.
#[derive(Debug, Default)]
struct Panels {
    faces: Vec<Panel>,
    /// The shares of the power of this and all earlier triangles; the last is 1.
    cumulative: Vec<f32>,
    /// The sum of areas times radiance, and the sphere around all triangles where bodies were at first.
    power: f32,
    center: Vec3,
    radius: f32,
}

#[derive(Clone, Copy, Debug)]
struct Panel {
    face: u32,
    area: f32,
    /// The probability with which it is chosen.
    probability: f32,
}

impl Panels {
    /// Of triangles with their powers, which are positive.
    fn new(scene: &Scene, faces: impl Iterator<Item = u32>) -> Self {
        let powered = faces.filter_map(|face| {
            let [a, b, c] = scene.mesh.corners(face as usize).map(Vec3::as_dvec3);
            let area = 0.5 * (b - a).cross(c - a).length();
            let power = area * f64::from(mean_emission(scene, face as usize));
            (power > 0.0).then_some((face, area, power))
        });
        let all: Vec<(u32, f64, f64)> = powered.collect();
        let total: f64 = all.iter().map(|(_, _, power)| power).sum();
        let (mut so_far, mut before) = (0.0, 0.0);
        let mut panels = Self::default();
        for (face, area, power) in all {
            so_far += power;
            let share = (so_far / total) as f32;
            // Of what rounding leaves, so that it is the probability to the last bit.
            panels.faces.push(Panel { face, area: area as f32, probability: share - before });
            panels.cumulative.push(share);
            before = share;
        }
        panels.power = total as f32;
        let corners = || panels.faces.iter().flat_map(|panel| scene.mesh.corners(panel.face as usize));
        let bounds = corners().map(|corner| [corner; 2]);
        if let Some([low, high]) = bounds.reduce(|[low, high], [a, b]| [low.min(a), high.max(b)]) {
            (panels.center, panels.radius) = (low.midpoint(high), 0.5 * low.distance(high));
        }
        panels
    }

    /// See [`Emitters::bounds`].
    fn bound(&self, from: Vec3) -> f32 {
        self.power / (from.distance_squared(self.center) + self.radius * self.radius)
    }
}

/// The mean radiance of a triangle's front over its area, at least a hundredth of the largest, by points of an even grid.
fn mean_emission(scene: &Scene, face: usize) -> f32 {
    let material = &scene.materials[scene.mesh.material[face] as usize];
    let brightness = |color: Vec3| color.element_sum() / 3.0;
    let largest = brightness(material.emission);
    if material.maps.emission.is_none() {
        return largest;
    }
    const ROWS: u32 = 8;
    let weights = (0..ROWS).flat_map(|row| (0..ROWS - row).map(move |column| [row, column]));
    let points = weights.map(|[row, column]| {
        let [u, v] = [row, column].map(|step| (step as f32 + 1.0 / 3.0) / ROWS as f32);
        Vec3::new(1.0 - u - v, u, v)
    });
    let count = ROWS * (ROWS + 1) / 2;
    let sum: f32 = points.map(|weights| brightness(scene.look(face, weights).emission)).sum();
    (sum / count as f32).max(0.01 * largest)
}

/// What a face of the mesh belongs to.
#[derive(Clone, Copy, Debug)]
enum Source {
    Quad(usize),
    Panel(usize),
}

/// All lights, and the map from faces of the mesh to them.
#[derive(Debug, Default)]
pub(super) struct Emitters {
    pub quads: Vec<Quad>,
    pub points: Vec<Point>,
    /// Of all poses: bodies are rigid.
    panels: Arc<Panels>,
    faces: Arc<HashMap<u32, Source>>,
    sky: Option<SkyLight>,
}

/// A sky, and a distance beyond all surfaces from any point that a ray hits.
#[derive(Clone, Debug)]
struct SkyLight {
    sky: Arc<Sky>,
    distance: f32,
    /// See [`Emitters::bounds`].
    bound: f32,
}

impl Emitters {
    pub fn new(scene: &Scene) -> Self {
        let mut emitters = Self::of_lights(scene);
        emitters.find_faces(scene);
        emitters
    }

    /// The emitters of the same scene in another pose.
    pub fn posed(&self, scene: &Scene) -> Self {
        let mut emitters =
            Self { faces: self.faces.clone(), panels: self.panels.clone(), ..Self::of_lights(scene) };
        for (quad, before) in emitters.quads.iter_mut().zip(&self.quads) {
            quad.in_mesh = before.in_mesh;
        }
        emitters
    }

    fn of_lights(scene: &Scene) -> Self {
        let sky = scene.sky.as_ref().filter(|sky| sky.shines()).map(|sky| SkyLight {
            sky: sky.clone(),
            distance: 2.0 * scene.bounds[0].distance(scene.bounds[1]).max(f32::MIN_POSITIVE),
            bound: PI * luminance(sky.mean()),
        });
        let mut emitters = Self { sky, ..Self::default() };
        for light in &scene.lights {
            match *light {
                Light::Point { position, intensity } => {
                    emitters.points.push(Point { position, intensity, cone: None });
                }
                Light::Spot { position, axis, intensity, cosines } => {
                    emitters.points.push(Point { position, intensity, cone: Some((axis, cosines)) });
                }
                Light::Quad { corner, u, v, radiance } => {
                    let (normal, area) = u.cross(v).normalize_and_length();
                    if area > 0.0 {
                        let reach = [corner, u, v].map(|p| p.abs().max_element()).into_iter().sum();
                        emitters.quads.push(Quad {
                            corner,
                            u,
                            v,
                            normal,
                            area,
                            reach,
                            radiance,
                            brightness: luminance(radiance),
                            radius: 0.5 * (u.length() + v.length()),
                            in_mesh: false,
                        });
                    }
                }
            }
        }
        emitters
    }

    /// The number of choices of [`Emitters::choose`].
    pub fn count(&self) -> usize {
        self.quads.len()
            + self.points.len()
            + usize::from(self.has_panels())
            + usize::from(self.sky.is_some())
    }

    /// Whether there are emissive triangles that are not quad lights.
    pub fn has_panels(&self) -> bool {
        !self.panels.faces.is_empty()
    }

    /// A choice for a point of a surface, by a number in [0, 1), and its probability: in proportion to what each light
    /// might send there, nothing being in the way, and by a share evenly. `facing` is the surface's normal, if light
    /// from behind does not count. `None` if no light reaches the point. An only light is always chosen.
    pub fn choose_one(&self, from: Vec3, facing: Option<Vec3>, random: f32) -> Option<(usize, f32)> {
        if self.count() == 1 {
            return Some((0, 1.0));
        }
        let odds = self.odds(from, facing);
        let (mut end, mut chosen) = (0.0, None);
        for (index, bound) in self.bounds(from, facing).enumerate() {
            let probability = odds.of(bound);
            if probability > 0.0 {
                chosen = Some((index, probability));
                end += probability;
            }
            if random < end {
                break;
            }
        }
        // Rounding may leave the sum slightly below 1: the last one takes what is left.
        chosen
    }

    /// The probability of a choice of [`Emitters::choose_one`].
    pub fn probability(&self, choice: usize, from: Vec3, facing: Option<Vec3>) -> f32 {
        if self.count() == 1 {
            return 1.0;
        }
        let bound = self.bounds(from, facing).nth(choice).unwrap_or(0.0);
        self.odds(from, facing).of(bound)
    }

    fn odds(&self, from: Vec3, facing: Option<Vec3>) -> Odds {
        let bounds = self.bounds(from, facing).filter(|bound| *bound > 0.0);
        let (count, sum) = bounds.fold((0.0, 0.0), |(count, sum), bound| (count + 1.0, sum + bound));
        Odds { scale: (1.0 - EVEN_SHARE) / sum, each: EVEN_SHARE / count }
    }

    /// Roughly the irradiance that each choice sends to a point if nothing is in the way; 0 if none at all.
    fn bounds(&self, from: Vec3, facing: Option<Vec3>) -> impl Iterator<Item = f32> {
        let quads = self.quads.iter().map(move |quad| quad.bound(from, facing));
        let points = self.points.iter().map(move |point| point.bound(from, facing));
        let panels = self.has_panels().then(|| self.panels.bound(from));
        let sky = self.sky.as_ref().map(|sky| sky.bound);
        quads.chain(points).chain(panels).chain(sky).map(|bound| bound.min(MOST_IRRADIANCE))
    }

    /// The light at `from` of choice `index`, by two numbers in [0, 1).
    #[inline]
    pub fn choose(
        &self,
        scene: &Scene,
        index: usize,
        from: Vec3,
        uv: impl FnOnce() -> [f32; 2],
    ) -> Option<Incident> {
        if let Some(quad) = self.quads.get(index) {
            return quad.towards(from, uv());
        }
        let index = index - self.quads.len();
        if let Some(point) = self.points.get(index) {
            return point.towards(from);
        }
        let is_panel = self.has_panels() && index == self.points.len();
        if is_panel { self.panel(scene, from, uv()) } else { self.sky(from, uv()) }
    }

    /// The light at `from` of an emissive triangle, chosen by two numbers in [0, 1).
    pub fn panel(&self, scene: &Scene, from: Vec3, [choice, t]: [f32; 2]) -> Option<Incident> {
        let Panels { faces, cumulative, .. } = &*self.panels;
        let index = cumulative.partition_point(|&share| share <= choice).min(faces.len() - 1);
        let panel = faces[index];
        // What is left of the choice within the triangle's share is as random as the choice was.
        let before = index.checked_sub(1).map_or(0.0, |before| cumulative[before]);
        let s = ((choice - before) / panel.probability).clamp(0.0, 1.0);
        let (root, face) = (s.sqrt(), panel.face as usize);
        let weights = Vec3::new(1.0 - root, root * (1.0 - t), root * t);
        let point = interpolate(scene.mesh.corners(face), weights);
        let direction = (point - from).try_normalize()?;
        let pdf = self.panel_pdf(scene, &panel, from, point, direction)?;
        let radiance = scene.look(face, weights).emission;
        // The shadow ray ends a little in front of the light, on the side of the shaded point.
        let normal = scene.mesh.face_normals[face];
        let facing = if normal.dot(direction) > 0.0 { -normal } else { normal };
        let target = super::offset(point, facing - direction, point.abs().max_element());
        Some(Incident { target, direction, power: radiance / pdf, pdf })
    }

    /// The light at `from` of a direction of the sky, chosen by two numbers in [0, 1); `None` without a sky.
    pub fn sky(&self, from: Vec3, uv: [f32; 2]) -> Option<Incident> {
        let SkyLight { sky, distance, .. } = self.sky.as_ref()?;
        let (direction, pdf) = sky.sample(uv);
        let power = sky.radiance(direction) / pdf;
        let target = from + *distance * direction;
        power.is_finite().then_some(Incident { target, direction, power, pdf })
    }

    /// Density, 1/sr, with which a direction of the sky is sampled if the sky is chosen; `None` without a sky.
    pub fn sky_pdf(&self, direction: Vec3) -> Option<f32> {
        self.sky.as_ref().map(|light| light.sky.pdf(direction))
    }

    fn panel_pdf(
        &self,
        scene: &Scene,
        panel: &Panel,
        from: Vec3,
        point: Vec3,
        direction: Vec3,
    ) -> Option<f32> {
        let face = panel.face as usize;
        let cosine = -direction.dot(scene.mesh.face_normals[face]);
        let material = &scene.materials[scene.mesh.material[face] as usize];
        let seen = if material.double_sided { cosine.abs() } else { cosine };
        Some(area_pdf(from, point, seen, panel.area)? * panel.probability)
    }

    /// Density, 1/sr, with which `direction`, the direction to `point` on an emissive face, is sampled if the light that
    /// it belongs to is chosen, and that light's choice; `None` if it is not sampled.
    pub fn pdf(
        &self,
        scene: &Scene,
        face: u32,
        from: Vec3,
        point: Vec3,
        direction: Vec3,
    ) -> Option<(f32, usize)> {
        match *self.faces.get(&face)? {
            Source::Quad(quad) => Some((self.quads[quad].pdf(from, point, direction)?, quad)),
            Source::Panel(panel) => {
                let pdf = self.panel_pdf(scene, &self.panels.faces[panel], from, point, direction)?;
                Some((pdf, self.quads.len() + self.points.len()))
            }
        }
    }

    /// Maps emissive faces to lights. A face belongs to a quad light if it has the same normal, and all of its vertices
    /// are corners of the quad.
    fn find_faces(&mut self, scene: &Scene) {
        let mesh = &scene.mesh;
        let mut faces = HashMap::new();
        let mut others = Vec::new();
        for (face, &material) in mesh.material.iter().enumerate() {
            let material = &scene.materials[material as usize];
            if !material.emits() {
                continue;
            }
            let corners = mesh.triangles[face].map(|i| mesh.positions[i as usize]);
            let owner = self.quads.iter().position(|quad| {
                let tolerance = 1e-4 * quad.u.length().max(quad.v.length());
                let ends = [Vec3::ZERO, quad.u, quad.v, quad.u + quad.v].map(|end| quad.corner + end);
                let is_corner = |p: &Vec3| ends.iter().any(|end| end.distance(*p) <= tolerance);
                mesh.face_normals[face].dot(quad.normal) > 0.0 && corners.iter().all(is_corner)
            });
            match owner {
                Some(quad) => {
                    self.quads[quad].in_mesh = true;
                    faces.insert(face as u32, Source::Quad(quad));
                }
                None => others.push(face as u32),
            }
        }
        let panels = Panels::new(scene, others.into_iter());
        let found = (0..).zip(&panels.faces).map(|(index, panel)| (panel.face, Source::Panel(index)));
        faces.extend(found);
        self.panels = Arc::new(panels);
        self.faces = Arc::new(faces);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Camera, Map, Maps, Material, SceneBuilder, Shape, Texture};

    /// A quad light of one square metre that shines down from `height` above (x, 0, 0), and a point light at (0, 2, 5).
    fn lights(x: f32, height: f32) -> Emitters {
        let camera = Camera::look_at(Vec3::ZERO, Vec3::NEG_Z, 1.0, 0.1, 10.0);
        let mut scene = Scene::empty("test", camera, [Vec3::NEG_ONE, Vec3::ONE]);
        let corner = Vec3::new(x - 0.5, height, -0.5);
        let radiance = Vec3::splat(3.0);
        scene.lights.push(Light::Quad { corner, u: Vec3::X, v: Vec3::Z, radiance });
        scene.lights.push(Light::Point { position: Vec3::new(0.0, 2.0, 5.0), intensity: Vec3::ONE });
        Emitters::new(&scene)
    }

    #[test]
    fn choices_come_as_often_as_their_probability_says() {
        for (x, height) in [(0.0, 1.0), (0.3, 0.01), (40.0, 1.0), (0.0, 300.0)] {
            let emitters = lights(x, height);
            let probability = [0, 1].map(|choice| emitters.probability(choice, Vec3::ZERO, Some(Vec3::Y)));
            assert!((probability[0] + probability[1] - 1.0).abs() < 1e-6, "{probability:?}");
            assert!(probability.iter().all(|&p| p >= 0.5 * EVEN_SHARE), "{probability:?}");
            let mut count = [0, 0];
            for step in 0..10_000 {
                let random = (step as f32 + 0.5) / 10_000.0;
                let (choice, stated) = emitters.choose_one(Vec3::ZERO, Some(Vec3::Y), random).unwrap();
                assert_eq!(stated, probability[choice]);
                count[choice] += 1;
            }
            for (count, probability) in count.into_iter().zip(probability) {
                assert!((count as f32 / 10_000.0 - probability).abs() < 2e-4, "{count} {probability}");
            }
        }
        // The near light is chosen more often than not, the far one less.
        let of_quad = |x, height| lights(x, height).probability(0, Vec3::ZERO, Some(Vec3::Y));
        assert!(of_quad(0.0, 1.0) > 0.7 && of_quad(0.0, 300.0) < 0.3);
    }

    #[test]
    fn points_of_a_quad_are_sampled_by_its_area() {
        let mut quad = lights(0.0, 1.0).quads[0];
        for [s, t] in [[0.5, 0.5], [0.0, 0.0], [0.9, 0.25]] {
            let point = Vec3::new(s - 0.5, 1.0, t - 0.5);
            // The square of the distance over the cosine: that of the light is one over the distance.
            let cubed = point.length().powi(3);
            for (in_mesh, pdf) in [(false, 0.0), (true, cubed)] {
                quad.in_mesh = in_mesh;
                let light = quad.towards(Vec3::ZERO, [s, t]).unwrap();
                assert!(light.direction.distance(point.normalize()) < 1e-6);
                assert!(
                    (light.pdf - pdf).abs() < 1e-5 && (light.power - 3.0 / cubed).abs().max_element() < 1e-5
                );
                // In front of the light by some units in the last place.
                let off = point - light.target;
                assert!(off.x == 0.0 && off.z == 0.0 && (1e-6..2e-5).contains(&off.y), "{off}");
            }
            let density = quad.pdf(Vec3::ZERO, point, point.normalize()).unwrap();
            assert!((density - cubed).abs() < 1e-5);
            assert!(quad.towards(2.0 * Vec3::Y, [s, t]).is_none(), "from behind");
            assert!(quad.towards(point, [s, t]).is_none(), "from the point itself");
        }
    }

    #[test]
    fn bounds_are_about_the_irradiance() {
        let emitters = lights(0.0, 1.0);
        let quad = |from: Vec3, facing| emitters.quads[0].bound(from, facing);
        // Straight below a square metre at one metre, as of a disc: 1 / (1 + 1 / pi) sr.
        let solid_angle = 1.0 / (1.0 + FRAC_1_PI);
        let near =
            |found: f32, expected: f32| assert!((found / expected - 1.0).abs() < 1e-5, "{found}, {expected}");
        near(quad(Vec3::ZERO, None), 3.0 * solid_angle);
        near(quad(Vec3::ZERO, Some(Vec3::Y)), 3.0 * solid_angle);
        near(quad(Vec3::ZERO, Some(Vec3::new(0.8, 0.6, 0.0))), 0.6 * 3.0 * solid_angle);
        near(quad(Vec3::ZERO, Some(Vec3::X)), 0.1 * 3.0 * solid_angle);
        assert_eq!(quad(Vec3::ZERO, Some(Vec3::NEG_Y)), 0.0);
        assert_eq!([quad(Vec3::Y, None), quad(2.0 * Vec3::Y, None)], [0.0; 2]);
        // Beside it, the nearest point is one metre to the side: half a right angle, and twice the square.
        let beside = 0.5_f32.sqrt() / (2.0 + FRAC_1_PI);
        near(quad(1.5 * Vec3::X, None), 3.0 * beside);
        near(quad(-1.5 * Vec3::Z, None), 3.0 * beside);
        let point = |from: Vec3, facing| emitters.points[0].bound(from, facing);
        // Three metres behind and four below the point light, at a cosine of 0.8 to its right angle.
        let from = Vec3::new(0.0, -2.0, 2.0);
        near(point(from, None), 1.0 / 25.0);
        near(point(from, Some(Vec3::Y)), 0.8 / 25.0);
        let oblique = Vec3::new(0.0, -0.6, 0.8) + 0.05 * Vec3::new(0.0, 0.8, 0.6);
        near(point(from, Some(oblique.normalize())), 0.1 / 25.0);
        assert_eq!(point(from, Some(Vec3::NEG_Y)), 0.0);
    }

    #[test]
    fn a_point_light_may_be_as_near_as_numbers_allow() {
        let light = |position| Point { position, intensity: Vec3::ONE, cone: None };
        let points = vec![light(Vec3::ZERO), light(Vec3::Y)];
        let emitters = Emitters { points, ..Emitters::default() };
        let from = 1e-20 * Vec3::X;
        assert_eq!(emitters.points[0].bound(from, None), f32::INFINITY);
        let probability = [0, 1].map(|choice| emitters.probability(choice, from, None));
        assert_eq!(probability, [1.0 - 0.5 * EVEN_SHARE, 0.5 * EVEN_SHARE]);
        assert_eq!(emitters.choose_one(from, None, 0.0), Some((0, probability[0])));
    }

    #[test]
    fn an_emissive_face_counts_as_a_hundredth_of_its_brightest_at_least() {
        let camera = Camera::look_at(Vec3::ZERO, Vec3::NEG_Z, 1.0, 0.1, 10.0);
        let mut builder = SceneBuilder::new();
        let maps = Maps { emission: Some(Map { nearest: true, ..Map::new(0) }), ..Maps::default() };
        let emission = Vec3::new(100.0, 200.0, 300.0);
        let material = builder.material(Material { maps, ..Material::lamp("", emission) });
        let triangle = Shape {
            positions: vec![Vec3::ZERO, Vec3::X, Vec3::Y],
            triangles: vec![[0, 1, 2]],
            ..Shape::default()
        };
        builder.add(&triangle, material).unwrap();
        let mut scene = builder.build("test", camera, Vec3::ZERO, 0.0, 30.0).unwrap();
        // 255, 8 and 1 of 255 are 1, 0.0024 and 0.0003 as light.
        for (texel, expected) in [(255, 200.0), (128, 200.0 * 0.215_86), (8, 2.0), (1, 2.0), (0, 2.0)] {
            let texels = vec![[texel, texel, texel, 255]];
            scene.textures = Arc::new(vec![Arc::new(Texture { name: String::new(), size: [1, 1], texels })]);
            let found = mean_emission(&scene, 0);
            assert!((found / expected - 1.0).abs() < 1e-4, "{texel}: {found}");
        }
    }

    #[test]
    fn lights_that_cannot_shine_on_a_point_are_never_chosen() {
        let emitters = lights(0.0, 1.0);
        let only = |from: Vec3, facing: Option<Vec3>| {
            let chosen = [0.0, 0.5, 0.999].map(|random| emitters.choose_one(from, facing, random));
            assert!(chosen.iter().all(|choice| *choice == chosen[0]), "{chosen:?}");
            chosen[0]
        };
        // From above the quad light, only the point light is seen.
        assert_eq!(only(Vec3::Y * 1.5, Some(Vec3::Y)), Some((1, 1.0)));
        // A surface that faces away from the point light, and then from both.
        assert_eq!(only(Vec3::new(0.0, 0.0, 1.0), Some(Vec3::NEG_Z)), Some((0, 1.0)));
        assert_eq!(only(Vec3::ZERO, Some(Vec3::NEG_Y)), None);
        assert_eq!(emitters.probability(0, Vec3::ZERO, Some(Vec3::NEG_Y)), 0.0);
        // Glass takes light from behind.
        assert!(emitters.probability(0, Vec3::ZERO, None) > 0.5);
        // A surface that cuts the quad light sees a part of it.
        assert!(emitters.probability(0, Vec3::new(0.3, 0.0, 0.0), Some(Vec3::X)) > 0.0);
        assert_eq!(Emitters::default().choose_one(Vec3::ZERO, None, 0.5), None);
    }
}
