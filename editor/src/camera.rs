//! Camera movement: fly through the scene, or orbit around a point ahead. The horizon stays level.

use epigraph_scenes::Camera;
use glam::{Quat, Vec3};

/// The camera never looks exactly straight up or down, where left and right would swap.
const STEEPEST: f32 = 1.55;

/// Share of the scene's size that flying covers per second.
const FLIGHT: f32 = 0.35;

/// A camera that the user moves.
#[derive(Clone, Copy, Debug)]
pub struct Rig {
    /// The current camera.
    pub camera: Camera,
    home: Camera,
    /// Distance from the eye to the point that orbiting turns around, metres.
    distance: f32,
    /// The scene's diagonal, metres.
    extent: f32,
}

impl Rig {
    /// At the scene's own view; `bounds` are its lowest and highest corners.
    pub fn new(home: Camera, bounds: [[f32; 3]; 2]) -> Self {
        let [low, high] = bounds.map(Vec3::from);
        let extent = low.distance(high).max(1e-3);
        let forward = home.rotation * Vec3::NEG_Z;
        // The centre of the part of the scene that lies ahead, along the view axis.
        let ahead = ((low + high) * 0.5 - home.eye).dot(forward);
        Self { camera: home, home, distance: ahead.max(0.05 * extent), extent }
    }

    /// Back to the scene's own view.
    pub fn go_home(&mut self) {
        *self = Self { camera: self.home, ..*self };
    }

    /// Turns in place, by angles in radians to the right and down.
    pub fn look(&mut self, right: f32, down: f32) {
        let forward = self.camera.rotation * Vec3::NEG_Z;
        let yaw = (-forward.x).atan2(-forward.z) - right;
        let pitch = (forward.y.clamp(-1.0, 1.0).asin() - down).clamp(-STEEPEST, STEEPEST);
        self.camera.rotation = Quat::from_rotation_y(yaw) * Quat::from_rotation_x(pitch);
    }

    /// Orbits the point ahead, by angles in radians to the right and down: the scene follows the pointer, so the eye
    /// moves left and up.
    pub fn orbit(&mut self, right: f32, down: f32) {
        let pivot = self.camera.eye + self.camera.rotation * Vec3::NEG_Z * self.distance;
        self.look(right, down);
        self.camera.eye = pivot - self.camera.rotation * Vec3::NEG_Z * self.distance;
    }

    /// Moves sideways so that the point ahead follows a drag by `right` and `down`, in heights of the image.
    pub fn pan(&mut self, right: f32, down: f32) {
        let height = 2.0 * (self.camera.fov_y * 0.5).tan() * self.distance;
        self.camera.eye += self.camera.rotation * Vec3::new(-right * height, down * height, 0.0);
    }

    /// Moves towards the point ahead; each step of 1 halves the distance, each of -1 doubles it.
    pub fn approach(&mut self, steps: f32) {
        let distance = (self.distance * (-steps).exp2()).clamp(1e-3 * self.extent, 10.0 * self.extent);
        self.camera.eye += self.camera.rotation * Vec3::NEG_Z * (self.distance - distance);
        self.distance = distance;
    }

    /// Flies for `seconds` to the right, up and ahead, as seen by the camera, each -1 to 1.
    pub fn fly(&mut self, [right, up, ahead]: [f32; 3], seconds: f32) {
        let step = Vec3::new(right, up, -ahead).clamp_length_max(1.0) * seconds * FLIGHT * self.extent;
        self.camera.eye += self.camera.rotation * step;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn rig() -> Rig {
        let home = Camera::look_at(Vec3::new(0.0, 1.0, 4.0), Vec3::new(0.0, 1.0, 0.0), 1.0, 0.1, 100.0);
        Rig::new(home, [[-1.0, 0.0, -1.0], [1.0, 2.0, 1.0]])
    }

    fn forward(rig: &Rig) -> Vec3 {
        rig.camera.rotation * Vec3::NEG_Z
    }

    #[test]
    fn orbiting_keeps_the_point_ahead_and_the_distance() {
        let mut rig = rig();
        let pivot = Vec3::new(0.0, 1.0, 0.0);
        rig.orbit(0.7, 0.3);
        assert!((rig.camera.eye + forward(&rig) * 4.0).distance(pivot) < 1e-4);
        assert!((rig.camera.eye.distance(pivot) - 4.0).abs() < 1e-4);
        assert!((rig.camera.rotation * Vec3::X).y.abs() < 1e-5, "the horizon is level");
        assert!(rig.camera.eye.x < -1.0 && rig.camera.eye.y > 1.5);
        rig.go_home();
        assert_eq!(rig.camera, rig.home);
    }

    #[test]
    fn looking_turns_right_and_down_but_never_over() {
        let mut rig = rig();
        rig.look(0.2, 0.1);
        assert!(forward(&rig).x > 0.1 && forward(&rig).y < -0.05);
        rig.look(0.0, 100.0);
        assert!(forward(&rig).y > -1.0 && (rig.camera.rotation * Vec3::Y).y > 0.0);
    }

    #[test]
    fn flying_follows_the_view_and_approaching_halves_the_distance() {
        let mut rig = rig();
        rig.fly([0.0, 0.0, 1.0], 0.5);
        assert!(rig.camera.eye.z < 4.0 && rig.camera.eye.x.abs() < 1e-6);
        rig.go_home();
        rig.approach(1.0);
        assert!((rig.camera.eye.z - 2.0).abs() < 1e-4);
        rig.pan(0.5, 0.0);
        assert!(rig.camera.eye.x < 0.0, "the scene follows the drag");
    }
}
