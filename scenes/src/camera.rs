use glam::{Quat, Vec3};

use crate::limits::is_near;

/// A pinhole camera. Looks along -z of its own frame, +y up.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Camera {
    /// Eye point in world space, metres.
    pub eye: Vec3,
    /// Rotation from camera to world space.
    pub rotation: Quat,
    /// Full vertical field of view, radians, of an image of the shape `aspect` or a wider one.
    pub fov_y: f32,
    /// Width by height of the image for which the camera was made. A narrower one keeps the horizontal field of view, so
    /// that it shows everything that the camera is to show. `None`: every image has the vertical field of view.
    pub aspect: Option<f32>,
    /// Distance of the near plane along the view axis, metres. Surfaces in front of it are not seen: the rays of all
    /// images start there.
    pub near: f32,
    /// The farthest distance along the view axis that an image has to resolve, metres. It hides nothing: samples of
    /// surfaces beyond are drawn, but not told apart by their distance.
    pub far: f32,
}

impl Camera {
    /// A camera at `eye` that looks at `target`; `fov_y` in radians.
    pub fn look_at(eye: Vec3, target: Vec3, fov_y: f32, near: f32, far: f32) -> Self {
        let back = (eye - target).try_normalize().unwrap_or(Vec3::Z);
        // A camera that looks straight up or down gets no horizontal axis from `y`; use another axis.
        let up = if back.y.abs() > 0.9999 { Vec3::Z } else { Vec3::Y };
        let right = up.cross(back).normalize();
        let rotation = Quat::from_mat3(&glam::Mat3::from_cols(right, back.cross(right), back));
        Self { eye, rotation, fov_y, aspect: None, near, far }
    }

    /// Whether all numbers are within the limits of a scene.
    pub(crate) fn is_valid(&self) -> bool {
        let Self { eye, rotation, fov_y, aspect, near, far } = *self;
        let has_shape = aspect.is_none_or(|aspect| aspect > 0.0 && aspect.is_finite());
        let has_lens = fov_y > 0.0 && fov_y < std::f32::consts::PI && has_shape;
        is_near(eye) && rotation.is_finite() && has_lens && near > 0.0 && near <= far && far.is_finite()
    }

    /// Half the height of what an image of `size` pixels shows at one unit along the view axis: the tangent of half its
    /// vertical field of view.
    pub fn half_height(&self, size: [u32; 2]) -> f32 {
        let half = (self.fov_y * 0.5).tan();
        match self.aspect {
            Some(aspect) => half * (aspect * size[1] as f32 / size[0] as f32).max(1.0),
            None => half,
        }
    }

    /// The direction (not normalised: one unit along the view axis) through image position `(x, y)` in pixels,
    /// x right and y down, of an image of `size` pixels.
    pub fn direction(&self, x: f32, y: f32, size: [u32; 2]) -> Vec3 {
        self.direction_within(self.half_height(size), x, y, size)
    }

    /// The same, from [`Camera::half_height`], which takes as long as all the rest.
    pub(crate) fn direction_within(&self, half: f32, x: f32, y: f32, size: [u32; 2]) -> Vec3 {
        let aspect = size[0] as f32 / size[1] as f32;
        let u = (2.0 * x / size[0] as f32 - 1.0) * half * aspect;
        let v = (1.0 - 2.0 * y / size[1] as f32) * half;
        self.rotation * Vec3::new(u, v, -1.0)
    }
}

/// The camera `k` frames after `now`, if it keeps moving as it did from `prev` to `now` (`algorithms.md` section 1.8):
/// the same step of the eye, and the same turn about the camera's own axes, each times `k`. Lens and depth range are
/// those of `now`.
pub fn predict(prev: &Camera, now: &Camera, k: f32) -> Camera {
    // Returns exactly `now` for a camera at rest; the product of quaternions would have rounding errors.
    let rotation = if prev.rotation == now.rotation {
        now.rotation
    } else {
        let turn = (prev.rotation.conjugate() * now.rotation).normalize();
        // q and -q are the same rotation; the one with w >= 0 takes the shorter way.
        let turn = if turn.w < 0.0 { -turn } else { turn };
        (now.rotation * Quat::from_scaled_axis(turn.to_scaled_axis() * k)).normalize()
    };
    Camera { eye: now.eye + k * (now.eye - prev.eye), rotation, ..*now }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn camera(eye: Vec3, target: Vec3) -> Camera {
        Camera::look_at(eye, target, 1.0, 0.1, 100.0)
    }

    #[test]
    fn each_number_outside_its_limits_makes_a_camera_invalid() {
        let good = camera(Vec3::ZERO, Vec3::X);
        assert!(good.is_valid() && Camera { near: 100.0, ..good }.is_valid());
        for bad in [
            Camera { eye: Vec3::splat(2e9), ..good },
            Camera { rotation: Quat::from_xyzw(f32::NAN, 0.0, 0.0, 1.0), ..good },
            Camera { fov_y: 0.0, ..good },
            Camera { fov_y: std::f32::consts::PI, ..good },
            Camera { aspect: Some(0.0), ..good },
            Camera { aspect: Some(f32::INFINITY), ..good },
            Camera { near: 0.0, ..good },
            Camera { near: 100.1, ..good },
            Camera { far: f32::INFINITY, ..good },
            Camera { far: f32::NAN, ..good },
        ] {
            assert!(!bad.is_valid(), "{bad:?}");
        }
    }

    #[test]
    fn centre_of_the_image_is_the_target_and_y_points_down() {
        for (eye, target) in [
            (Vec3::new(1.0, 2.0, 3.0), Vec3::ZERO),
            (Vec3::Y, Vec3::ZERO),
            (Vec3::ZERO, Vec3::new(0.0, 5.0, 0.0)),
        ] {
            let camera = camera(eye, target);
            let direction = camera.direction(32.0, 24.0, [64, 48]).normalize();
            assert!(direction.distance((target - eye).normalize()) < 1e-6);
        }
        let level = camera(Vec3::ZERO, Vec3::NEG_Z);
        assert!(level.direction(0.0, 0.0, [64, 48]).y > 0.0);
        assert!(level.direction(0.0, 0.0, [64, 48]).x < 0.0);
    }

    #[test]
    fn top_and_bottom_edge_span_the_field_of_view() {
        let camera = camera(Vec3::ZERO, Vec3::NEG_Z);
        let angle =
            camera.direction(50.0, 0.0, [100, 40]).angle_between(camera.direction(50.0, 40.0, [100, 40]));
        assert!((angle - camera.fov_y).abs() < 1e-5);
    }

    #[test]
    fn a_narrower_image_keeps_the_width_that_the_camera_shows() {
        let wide = Camera { aspect: Some(2.0), ..camera(Vec3::ZERO, Vec3::NEG_Z) };
        let half = 0.5_f32.tan();
        for (size, width, height) in
            [([100, 50], 2.0, 1.0), ([100, 25], 4.0, 1.0), ([100, 100], 2.0, 2.0), ([50, 100], 2.0, 4.0)]
        {
            let corner = wide.direction(size[0] as f32, 0.0, size);
            let expected = Vec3::new(width * half, height * half, -1.0);
            assert!(corner.distance(expected) < 1e-5, "{size:?}: {corner} {expected}");
        }
        let any = Camera { aspect: None, ..wide };
        assert_eq!(any.half_height([50, 100]), half);
    }

    #[test]
    fn a_camera_at_rest_is_predicted_exactly() {
        let now = camera(Vec3::new(0.3, 0.7, -2.0), Vec3::new(0.1, 0.0, 0.4));
        for k in [0.0, 1.0, 4.0] {
            assert_eq!(predict(&now, &now, k), now);
        }
    }

    #[test]
    fn steady_motion_is_continued() {
        // One step of a screw about the camera's own axes; the product is in the order that repeats it.
        let step = Quat::from_scaled_axis(Vec3::new(0.02, -0.05, 0.01));
        let (velocity, start) = (Vec3::new(0.1, 0.0, -0.2), camera(Vec3::ONE, Vec3::ZERO));
        let at = |n: u16| {
            let rotation = (0..n).fold(start.rotation, |q, _| q * step);
            Camera { eye: start.eye + f32::from(n) * velocity, rotation, ..start }
        };
        let predicted = predict(&at(4), &at(5), 3.0);
        assert!(predicted.eye.distance(at(8).eye) < 1e-5);
        assert!(predicted.rotation.angle_between(at(8).rotation) < 2e-3);
        let direction = |c: &Camera| c.rotation * Vec3::new(0.3, 0.2, -1.0);
        assert!(direction(&predicted).distance(direction(&at(8))) < 1e-5);
    }

    #[test]
    fn either_sign_of_a_rotation_predicts_the_same_view() {
        let (prev, now) = (camera(Vec3::ONE, Vec3::ZERO), camera(Vec3::ONE, Vec3::new(0.1, 0.0, 0.0)));
        let flipped = Camera { rotation: -now.rotation, ..now };
        for k in [2.0, 0.5] {
            let [a, b] = [now, flipped].map(|now| predict(&prev, &now, k).rotation * Vec3::NEG_Z);
            assert!(a.distance(b) < 1e-6);
            assert!(a.dot(now.rotation * Vec3::NEG_Z) > 0.9);
        }
    }

    #[test]
    fn the_horizon_is_level_until_a_camera_looks_almost_straight_down() {
        // The axis leans by 0.02 and by 0.01: its vertical part is 0.9998 and 0.99995.
        let right = |lean: f32| camera(Vec3::new(lean, 1.0, 0.0), Vec3::ZERO).rotation * Vec3::X;
        assert!(right(0.02).y.abs() < 1e-6 && right(0.02).z.abs() > 0.99, "{}", right(0.02));
        assert!(right(0.01).z.abs() < 1e-6 && right(0.01).x.abs() > 0.99, "{}", right(0.01));
        // At exactly 0.9999 the horizon is level still.
        let back = Vec3::new(0.014_142_956, 0.9999, 0.0);
        assert_eq!(back.normalize().y, 0.9999);
        let right = camera(back, Vec3::ZERO).rotation * Vec3::X;
        assert!(right.y.abs() < 1e-6 && right.z.abs() > 0.99, "{right}");
    }
}
