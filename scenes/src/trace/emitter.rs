//! The lights of a scene as the tracer samples them: point and spot lights, quad lights one by one, and all other
//! emissive triangles by their power.

use std::{collections::HashMap, sync::Arc};

use glam::Vec3;

use crate::light::cone;
use crate::mesh::interpolate;
use crate::{Light, Scene, Sky};

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

impl Point {
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
    (cosine > 0.0 && pdf > 0.0 && pdf.is_finite()).then_some(pdf)
}

/// Emissive triangles that are not quad lights, chosen by their power.
#[derive(Debug, Default)]
struct Panels {
    faces: Vec<Panel>,
    /// The shares of the power of this and all earlier triangles; the last is 1.
    cumulative: Vec<f32>,
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
        panels
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
                        let quad = Quad { corner, u, v, normal, area, reach, radiance, in_mesh: false };
                        emitters.quads.push(quad);
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
        let Panels { faces, cumulative } = &*self.panels;
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
        let SkyLight { sky, distance } = self.sky.as_ref()?;
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
    /// it belongs to is chosen; `None` if it is not sampled.
    pub fn pdf(&self, scene: &Scene, face: u32, from: Vec3, point: Vec3, direction: Vec3) -> Option<f32> {
        match *self.faces.get(&face)? {
            Source::Quad(quad) => self.quads[quad].pdf(from, point, direction),
            Source::Panel(panel) => self.panel_pdf(scene, &self.panels.faces[panel], from, point, direction),
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
