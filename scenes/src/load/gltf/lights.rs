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

#[cfg(test)]
mod tests {
    use gltf::json::deserialize::from_str;

    use super::*;

    /// The light of a node of this scale, and what is said of it.
    fn placed(light: &str, scale: f64) -> (Option<Placed>, String) {
        let json = format!(
            r#"{{"asset": {{"version": "2.0"}}, "nodes": [{{"extensions": {{"{LIGHTS}": {{"light": 0}}}}}}],
            "extensions": {{"{LIGHTS}": {{"lights": [{{{light}}}]}}}}}}"#
        );
        let root: Root = from_str(&json).unwrap();
        let (world, mut report) = (DAffine3::from_scale(DVec3::splat(scale)), Report::default());
        let found = Placed::of(&root, &root.nodes[0], "lamp", &world, &mut report);
        (found, report.notes().iter().map(ToString::to_string).collect::<Vec<_>>().join("; "))
    }

    #[test]
    fn lights_may_be_as_dim_as_black() {
        for (light, expected) in [
            ("", Some(Vec3::ONE)),
            (r#", "intensity": 0.25"#, Some(Vec3::splat(0.25))),
            (r#", "intensity": 0"#, Some(Vec3::ZERO)),
            (r#", "intensity": 4, "color": [1, 0.5, 0]"#, Some(Vec3::new(4.0, 2.0, 0.0))),
            (r#", "intensity": -0.25"#, None),
            (r#", "color": [1, 1, -0.25]"#, None),
        ] {
            let (found, note) = placed(&format!(r#""type": "point"{light}"#), 1.0);
            let found = found.map(|placed| match placed {
                Placed::Point { intensity, .. } => intensity,
                other => panic!("{other:?}"),
            });
            assert_eq!(found, expected, "{light}");
            let wrong = "left out: a light of an intensity that is not valid (lamp)";
            assert_eq!(note, if expected.is_some() { "" } else { wrong }, "{light}");
        }
    }

    #[test]
    fn lights_that_shine_along_an_axis_need_one() {
        for (kind, needs_axis) in [("point", false), ("spot", true), ("directional", true)] {
            let of = |scale| placed(&format!(r#""type": "{kind}""#), scale);
            let ((with, with_note), (without, note)) = (of(1.0), of(0.0));
            assert_eq!((with.is_some(), without.is_some()), (true, !needs_axis), "{kind}");
            let expected = "left out: a light whose node has no direction (lamp)";
            assert_eq!((&*with_note, &*note), ("", if needs_axis { expected } else { "" }), "{kind}");
        }
    }
}
