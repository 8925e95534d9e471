//! Cameras. A far plane never cuts: it is moved behind all of the scene.

use std::f32::consts::PI;

use glam::{DAffine3, DVec3, Mat3, Quat, Vec3};
use gltf::json::camera::{Orthographic, Perspective};

use crate::Camera;

/// Distance of the camera that takes the place of an orthographic one, in radii of the scene: sizes differ by at most
/// 2% between its front and its back.
const ORTHOGRAPHIC_DISTANCE: f32 = 100.0;

/// A camera in the space of the file.
#[derive(Clone, Copy, Debug)]
pub(super) struct Placed {
    eye: DVec3,
    rotation: Quat,
    lens: Lens,
    near: f32,
    pub far: Option<f32>,
}

#[derive(Clone, Copy, Debug)]
enum Lens {
    Perspective {
        fov_y: f32,
        aspect: Option<f32>,
    },
    /// Half the width and height of what it shows.
    Orthographic([f32; 2]),
}

impl Placed {
    /// A perspective camera of a node.
    pub fn perspective(lens: &Perspective, world: &DAffine3) -> Result<Self, String> {
        let (near, fov_y, far) = (lens.znear, lens.yfov, lens.zfar);
        if !(1e-3..PI - 1e-3).contains(&fov_y) {
            return Err(format!("yfov is {fov_y}; a field of view lies between 0 and pi"));
        }
        if !(f32::MIN_POSITIVE..far.unwrap_or(f32::INFINITY)).contains(&near) {
            let far = far.map_or(String::new(), |far| format!(" and zfar {far}"));
            return Err(format!("znear is {near}{far}; znear must be above 0 and below zfar"));
        }
        let aspect = lens.aspect_ratio.filter(|aspect| (f32::MIN_POSITIVE..f32::INFINITY).contains(aspect));
        Self::new(Lens::Perspective { fov_y, aspect }, near, far, world)
    }

    /// An orthographic camera of a node.
    pub fn orthographic(lens: &Orthographic, world: &DAffine3) -> Result<Self, String> {
        // Some exporters turn the image over with negative sizes.
        let half = [lens.xmag.abs(), lens.ymag.abs()];
        if half.iter().any(|side| !side.is_normal()) {
            return Err(format!("xmag is {} and ymag {}; they must be above 0", lens.xmag, lens.ymag));
        }
        if !(lens.znear >= 0.0 && lens.znear < lens.zfar) {
            let (near, far) = (lens.znear, lens.zfar);
            return Err(format!("znear is {near} and zfar {far}; znear must be at least 0 and below zfar"));
        }
        Self::new(Lens::Orthographic(half), lens.znear, Some(lens.zfar), world)
    }

    fn new(lens: Lens, near: f32, far: Option<f32>, world: &DAffine3) -> Result<Self, String> {
        let axis = |v: DVec3| world.transform_vector3(v).as_vec3().try_normalize();
        let frame = || {
            let (back, up) = (axis(DVec3::Z)?, axis(DVec3::Y)?);
            let right = up.cross(back).try_normalize()?;
            Some(Quat::from_mat3(&Mat3::from_cols(right, back.cross(right), back)))
        };
        let rotation = frame().ok_or("its node has no view direction")?;
        Ok(Self { eye: world.translation, rotation, lens, near, far })
    }

    pub fn is_orthographic(&self) -> bool {
        matches!(self.lens, Lens::Orthographic(_))
    }

    /// The camera in a scene with this origin and these bounds, and whether its far plane would have hidden some of it.
    pub fn camera(&self, origin: DVec3, [low, high]: [Vec3; 2]) -> (Camera, bool) {
        let eye = (self.eye - origin).as_vec3();
        let back = self.rotation * Vec3::Z;
        let (centre, radius) = (low.midpoint(high), 0.5 * low.distance(high));
        // The distance of the farthest corner of the bounds along the view axis.
        let half = 0.5 * (high - low);
        let deepest = (eye - centre).dot(back) + back.abs().dot(half);
        let cuts = self.far.is_some_and(|far| deepest > far * (1.0 + 1e-5));
        // From anywhere that is no farther away.
        let all = self.near + eye.distance(centre) + radius;
        let camera = match self.lens {
            Lens::Perspective { fov_y, aspect } => {
                let far = match self.far {
                    Some(far) => far.max(all),
                    None => all + 3.0 * radius,
                };
                Camera { eye, rotation: self.rotation, fov_y, aspect, near: self.near, far }
            }
            Lens::Orthographic([width, height]) => {
                // Sizes are right in the plane of the centre.
                let distance = ORTHOGRAPHIC_DISTANCE * radius.max(width).max(height);
                let farther = distance - (eye - centre).dot(back);
                let fov_y = 2.0 * (height / distance).atan();
                Camera {
                    eye: eye + farther * back,
                    rotation: self.rotation,
                    fov_y,
                    aspect: Some(width / height),
                    near: (farther + self.near).max(0.01 * distance),
                    far: distance + 4.0 * radius.max(width).max(height),
                }
            }
        };
        (camera, cuts)
    }
}

#[cfg(test)]
mod tests {
    use gltf::json::deserialize::from_str;

    use super::*;

    const EYE: Placed = Placed {
        eye: DVec3::ZERO,
        rotation: Quat::IDENTITY,
        lens: Lens::Perspective { fov_y: 1.0, aspect: None },
        near: 0.5,
        far: None,
    };

    #[test]
    fn a_far_plane_cuts_what_is_deeper_by_more_than_rounding() {
        let at_depth = |depth: f32, far: f32| {
            let point = depth * Vec3::NEG_Z;
            Placed { far: Some(far), ..EYE }.camera(DVec3::ZERO, [point; 2]).1
        };
        for far in [1.0, 4.0] {
            let most = far * (1.0_f32 + 1e-5);
            let found = [0.5 * far, far, most, most.next_up(), 2.0 * far].map(|depth| at_depth(depth, far));
            assert_eq!(found, [false, false, false, true, true], "{far}");
        }
        // A box is as deep as its farthest corner along the view, which is along -z or -x.
        let bounds = [Vec3::new(-3.0, -2.0, -6.0), Vec3::new(1.0, 4.0, -2.0)];
        for (turn, deepest) in [(0.0, 6.0), (0.5 * PI, 3.0)] {
            let rotation = Quat::from_rotation_y(turn);
            for (far, is_cut) in [(1.001 * deepest, false), (0.999 * deepest, true)] {
                let (_, cuts) = Placed { rotation, far: Some(far), ..EYE }.camera(DVec3::ZERO, bounds);
                assert_eq!(cuts, is_cut, "{turn}, {far}");
            }
        }
    }

    /// A box of radius 7, 20 m before the eye.
    const BOX: [Vec3; 2] = [Vec3::new(-2.0, -3.0, -26.0), Vec3::new(2.0, 3.0, -14.0)];

    #[test]
    fn a_far_plane_is_behind_all_of_the_scene() {
        for (far, expected) in [(None, 27.5 + 21.0), (Some(30.0), 30.0), (Some(10.0), 27.5)] {
            let (camera, _) = Placed { far, ..EYE }.camera(DVec3::ZERO, BOX);
            assert_eq!((camera.near, camera.far), (0.5, expected), "{far:?}");
        }
    }

    #[test]
    fn an_orthographic_camera_is_a_hundred_times_as_far_away_as_the_scene_or_its_image_is_large() {
        // The eye, the distance of the middle of the box, and the largest of radius, width and height.
        for (eye, [width, height], distance, largest) in [
            (0.0, [3.0, 2.0], 700.0, 7.0),
            (0.0, [9.0, 2.0], 900.0, 9.0),
            (0.0, [3.0, 8.0], 800.0, 8.0),
            (1000.0, [3.0, 2.0], 700.0, 7.0),
        ] {
            let lens = Lens::Orthographic([width, height]);
            let placed = Placed { eye: eye * DVec3::Z, lens, near: 2.0, ..EYE };
            let (camera, _) = placed.camera(DVec3::ZERO, BOX);
            assert!(camera.eye.distance((distance - 20.0) * Vec3::Z) < 1e-3, "{camera:?}");
            // The near plane is where it was, unless this is behind the eye.
            let near = if eye == 0.0 { distance - 18.0 } else { 0.01 * distance };
            let expected = [near, distance + 4.0 * largest, width / height, 2.0 * (height / distance).atan()];
            let found = [camera.near, camera.far, camera.aspect.unwrap(), camera.fov_y];
            assert!(
                found.iter().zip(expected).all(|(a, b)| (a / b - 1.0).abs() < 1e-5),
                "{found:?} {expected:?}"
            );
        }
    }

    #[test]
    fn planes_and_shapes_of_images_are_numbers_above_0() {
        let aspect = |ratio: &str| {
            let lens = format!(r#"{{"yfov": 1, "znear": 0.5, "aspectRatio": {ratio}}}"#);
            let placed = Placed::perspective(&from_str(&lens).unwrap(), &DAffine3::IDENTITY).unwrap();
            placed.camera(DVec3::ZERO, BOX).0.aspect
        };
        assert_eq!(["0.5", "1.5", "0", "-0.5"].map(aspect), [Some(0.5), Some(1.5), None, None]);
        let orthographic = |lens: &str| {
            Placed::orthographic(&from_str(lens).unwrap(), &DAffine3::IDENTITY).map(|placed| placed.near)
        };
        for (near, fits) in [("0", true), ("0.5", true), ("-0.5", false), ("1", false)] {
            let lens = format!(r#"{{"xmag": 1, "ymag": 1, "znear": {near}, "zfar": 1}}"#);
            assert_eq!(orthographic(&lens).is_ok(), fits, "{near}");
        }
    }
}
