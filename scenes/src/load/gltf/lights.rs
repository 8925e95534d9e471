//! `KHR_lights_punctual`. Intensities are taken as they are (1 cd as 1 W/sr), as by viewers at exposure 1. A
//! directional light becomes a point far away.

use std::f32::consts::{FRAC_PI_2, FRAC_PI_4};

use glam::{DAffine3, DVec3, Vec3};
use gltf::json::deserialize::from_value;

use super::json::{Light, Node, Root, Spot};
use crate::limits::is_intensity;
use crate::{NoteKind, Report};

pub(super) const LIGHTS: &str = "KHR_lights_punctual";

/// Distance of a directional light in radii of the scene: its light is parallel and uniform to 2%.
const SUN_DISTANCE: f32 = 100.0;

/// A light in the space of the file.
#[derive(Clone, Copy, Debug)]
pub(super) enum Placed {
    Point { position: DVec3, intensity: Vec3 },
    Spot { position: DVec3, axis: Vec3, intensity: Vec3, cosines: [f32; 2] },
    Directional { direction: Vec3, irradiance: Vec3 },
}

impl Placed {
    /// The light of a node, if it has one that is valid.
    pub fn of(root: &Root, node: &Node, name: &str, world: &DAffine3, report: &mut Report) -> Option<Self> {
        let index = node.extensions.get(LIGHTS)?.get("light");
        let light = (|| {
            let lights = root.extensions.get(LIGHTS)?.get("lights")?;
            let light = lights.get(usize::try_from(index?.as_u64()?).ok()?)?;
            from_value::<Light>(light.clone()).ok()
        })();
        let mut leave_out = |what: &str| report.add(NoteKind::LeftOut, what, name);
        let Some(light) = light else {
            leave_out("a light that is not valid");
            return None;
        };
        let intensity = light.intensity * Vec3::from(light.color);
        if !is_intensity(intensity) || intensity.min_element() < 0.0 {
            leave_out("a light of an intensity that is not valid");
            return None;
        }
        if light.range.is_some() {
            leave_out("the range of a light");
        }
        let axis = world.transform_vector3(DVec3::NEG_Z).as_vec3().try_normalize();
        let position = world.translation;
        match (light.kind.as_str(), axis) {
            ("point", _) => Some(Self::Point { position, intensity }),
            ("directional", Some(direction)) => Some(Self::Directional { direction, irradiance: intensity }),
            ("spot", Some(axis)) => {
                let Spot { inner_cone_angle: inner, outer_cone_angle: outer } =
                    light.spot.unwrap_or_default();
                let outer = outer.unwrap_or(FRAC_PI_4);
                if !(0.0 <= inner && inner <= outer && outer <= FRAC_PI_2) {
                    report.add(NoteKind::Repaired, "a spot's cone that is not valid", name);
                }
                let outer = outer.clamp(0.0, FRAC_PI_2);
                let cosines = [inner.clamp(0.0, outer).cos(), outer.cos()];
                Some(Self::Spot { position, axis, intensity, cosines })
            }
            ("directional" | "spot", None) => {
                leave_out("a light whose node has no direction");
                None
            }
            _ => {
                leave_out("a light of an unknown kind");
                None
            }
        }
    }

    /// The light in a scene with this origin and these bounds.
    pub fn light(&self, origin: DVec3, [low, high]: [Vec3; 2]) -> crate::Light {
        match *self {
            Self::Point { position, intensity } => {
                crate::Light::Point { position: (position - origin).as_vec3(), intensity }
            }
            Self::Spot { position, axis, intensity, cosines } => {
                crate::Light::Spot { position: (position - origin).as_vec3(), axis, intensity, cosines }
            }
            Self::Directional { direction, irradiance } => {
                let distance = SUN_DISTANCE * 0.5 * low.distance(high);
                crate::Light::Point {
                    position: low.midpoint(high) - distance * direction,
                    intensity: irradiance * distance * distance,
                }
            }
        }
    }
}
