//! `KHR_lights_punctual`. Intensities are taken as they are (1 cd as 1 W/sr), as by viewers at exposure 1. A
//! directional light becomes a point far away, a spot a point without a cone.

use glam::{DAffine3, DVec3, Vec3};
use gltf::json::deserialize::from_value;

use super::json::{Light, Node, Root};
use crate::limits::is_intensity;
use crate::{NoteKind, Report};

pub(super) const LIGHTS: &str = "KHR_lights_punctual";

/// Distance of a directional light in radii of the scene: its light is parallel and uniform to 2%.
const SUN_DISTANCE: f32 = 100.0;

/// A light in the space of the file.
#[derive(Clone, Copy, Debug)]
pub(super) enum Placed {
    Point { position: DVec3, intensity: Vec3 },
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
        match light.kind.as_str() {
            "directional" => {
                let direction = world.transform_vector3(DVec3::NEG_Z).as_vec3().normalize_or_zero();
                Some(Self::Directional { direction, irradiance: intensity })
            }
            "point" => Some(Self::Point { position: world.translation, intensity }),
            "spot" => {
                report.add(NoteKind::Approximated, "a spot light, by a point without a cone", name);
                Some(Self::Point { position: world.translation, intensity })
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
