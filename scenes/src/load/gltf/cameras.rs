//! Perspective cameras.

use std::f32::consts::PI;

use glam::{DAffine3, DVec3, Mat3, Quat, Vec3};
use gltf::json::camera::Perspective;

use crate::Camera;

/// A camera in the space of the file.
#[derive(Clone, Copy, Debug)]
pub(super) struct Placed {
    pub eye: DVec3,
    rotation: Quat,
    fov_y: f32,
    near: f32,
    far: Option<f32>,
}

impl Placed {
    /// A perspective camera of a node.
    pub fn of(lens: &Perspective, world: &DAffine3) -> Result<Self, String> {
        let axis = |v: DVec3| world.transform_vector3(v).as_vec3().try_normalize();
        let frame = || {
            let (back, up) = (axis(DVec3::Z)?, axis(DVec3::Y)?);
            let right = up.cross(back).try_normalize()?;
            Some(Quat::from_mat3(&Mat3::from_cols(right, back.cross(right), back)))
        };
        let rotation = frame().ok_or("its node has no view direction")?;
        let (near, fov_y, far) = (lens.znear, lens.yfov, lens.zfar);
        if !(1e-3..PI - 1e-3).contains(&fov_y) {
            return Err(format!("yfov is {fov_y}; a field of view lies between 0 and pi"));
        }
        if !(near.is_normal() && near > 0.0 && near < far.unwrap_or(f32::INFINITY)) {
            let far = far.map_or(String::new(), |far| format!(" and zfar {far}"));
            return Err(format!("znear is {near}{far}; znear must be above 0 and below zfar"));
        }
        Ok(Self { eye: world.translation, rotation, fov_y, near, far })
    }

    /// The camera in a scene with this origin and these bounds. One without a far plane sees all of it.
    pub fn camera(&self, origin: DVec3, [low, high]: [Vec3; 2]) -> Camera {
        let Self { rotation, fov_y, near, far, .. } = *self;
        let eye = (self.eye - origin).as_vec3();
        let all = || near + eye.distance(low.midpoint(high)) + 2.0 * low.distance(high);
        Camera { eye, rotation, fov_y, near, far: far.unwrap_or_else(all) }
    }
}
