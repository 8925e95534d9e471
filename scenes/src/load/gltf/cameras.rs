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
        if !(near.is_normal() && near > 0.0 && near < far.unwrap_or(f32::INFINITY)) {
            let far = far.map_or(String::new(), |far| format!(" and zfar {far}"));
            return Err(format!("znear is {near}{far}; znear must be above 0 and below zfar"));
        }
        let aspect = lens.aspect_ratio.filter(|aspect| aspect.is_normal() && *aspect > 0.0);
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
