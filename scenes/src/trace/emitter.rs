//! The lights of a scene as the tracer samples them.

use std::{collections::HashMap, sync::Arc};

use glam::Vec3;

use crate::{Light, Scene};

/// A quad light, ready to be sampled by area.
#[derive(Clone, Copy, Debug)]
pub(super) struct Quad {
    corner: Vec3,
    u: Vec3,
    v: Vec3,
    /// Unit normal on the emitting side.
    normal: Vec3,
    area: f32,
    radiance: Vec3,
    /// True if its triangles are part of the mesh, so that rays can hit them.
    in_mesh: bool,
}

/// A point light.
#[derive(Clone, Copy, Debug)]
pub(super) struct Point {
    position: Vec3,
    intensity: Vec3,
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
        let power = self.intensity / (distance * distance);
        (distance > 0.0).then_some(Incident { target: self.position, direction, power, pdf: 0.0 })
    }
}

impl Quad {
    /// The light at `from` from the point `(s, t)` in [0, 1)^2 of the quad; `None` if `from` is behind the quad.
    pub fn towards(&self, from: Vec3, [s, t]: [f32; 2]) -> Option<Incident> {
        let point = self.corner + s * self.u + t * self.v;
        let direction = (point - from).try_normalize()?;
        let pdf = self.pdf(from, point, direction)?;
        // The shadow ray ends several units in the last place of its coordinates in front of the light.
        let reach = [self.corner, self.u, self.v].map(|p| p.abs().max_element()).into_iter().sum();
        let target = super::offset(point, self.normal, reach);
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
        let cosine = -direction.dot(self.normal);
        let pdf = (point - from).length_squared() / (cosine * self.area);
        (cosine > 0.0 && pdf > 0.0 && pdf.is_finite()).then_some(pdf)
    }
}

/// All lights, and the map from faces of the mesh to quad lights.
#[derive(Debug, Default)]
pub(super) struct Emitters {
    pub quads: Vec<Quad>,
    pub points: Vec<Point>,
    faces: Arc<HashMap<u32, usize>>,
}

impl Emitters {
    pub fn new(scene: &Scene) -> Self {
        let mut emitters = Self::of_lights(scene);
        emitters.find_faces(scene);
        emitters
    }

    /// The emitters of the same scene in another pose.
    pub fn posed(&self, scene: &Scene) -> Self {
        let mut emitters = Self { faces: self.faces.clone(), ..Self::of_lights(scene) };
        for (quad, before) in emitters.quads.iter_mut().zip(&self.quads) {
            quad.in_mesh = before.in_mesh;
        }
        emitters
    }

    fn of_lights(scene: &Scene) -> Self {
        let mut emitters = Self::default();
        for light in &scene.lights {
            match *light {
                Light::Point { position, intensity } => emitters.points.push(Point { position, intensity }),
                Light::Quad { corner, u, v, radiance } => {
                    let (normal, area) = u.cross(v).normalize_and_length();
                    if area > 0.0 {
                        emitters.quads.push(Quad { corner, u, v, normal, area, radiance, in_mesh: false });
                    }
                }
            }
        }
        emitters
    }

    /// The quad light that an emissive face belongs to.
    pub fn quad_of(&self, face: u32) -> Option<&Quad> {
        self.faces.get(&face).map(|&i| &self.quads[i])
    }

    /// Maps faces to quad lights. A face belongs to a quad light if it emits, has the same normal, and all of its
    /// vertices are corners of the quad.
    fn find_faces(&mut self, scene: &Scene) {
        let mesh = &scene.mesh;
        let mut faces = HashMap::new();
        for (face, &material) in mesh.material.iter().enumerate() {
            if scene.materials[material as usize].emission == Vec3::ZERO {
                continue;
            }
            let corners = mesh.triangles[face].map(|i| mesh.positions[i as usize]);
            let owner = self.quads.iter().position(|quad| {
                let tolerance = 1e-4 * quad.u.length().max(quad.v.length());
                let ends = [Vec3::ZERO, quad.u, quad.v, quad.u + quad.v].map(|end| quad.corner + end);
                let is_corner = |p: &Vec3| ends.iter().any(|end| end.distance(*p) <= tolerance);
                mesh.face_normals[face].dot(quad.normal) > 0.0 && corners.iter().all(is_corner)
            });
            if let Some(quad) = owner {
                self.quads[quad].in_mesh = true;
                faces.insert(face as u32, quad);
            }
        }
        self.faces = Arc::new(faces);
    }
}
