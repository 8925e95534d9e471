//! Flights through keyframes.

use std::path::Path;

use glam::{Quat, Vec3};
use serde::Deserialize;

use super::{PathError, target_distance};
use crate::limits::{MAX_COORDINATE, MAX_TIME, is_near, is_time};
use crate::{Camera, Scene};

/// The default flight: seconds between keyframes, and keyframe positions to the right, up and forward as shares of the
/// distance to the camera's target. The camera keeps looking at that target.
const FLIGHT_SECONDS: f32 = 1.0;
const FLIGHT: [Vec3; 6] = [
    Vec3::ZERO,
    Vec3::new(0.10, 0.02, 0.10),
    Vec3::new(0.08, 0.04, 0.22),
    Vec3::new(-0.06, 0.02, 0.24),
    Vec3::new(-0.10, 0.0, 0.10),
    Vec3::ZERO,
];

/// A flight through keyframes in ascending order of time, at least one.
#[derive(Clone, Debug)]
pub(super) struct Flight {
    keys: Vec<Key>,
    /// True if the flight restarts after the last key, which repeats the first; otherwise it stays there.
    looped: bool,
}

#[derive(Clone, Copy, Debug)]
struct Key {
    time: f32,
    eye: Vec3,
    rotation: Quat,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct FlightFile {
    #[serde(default)]
    looped: bool,
    keys: Vec<KeyFile>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct KeyFile {
    time: f32,
    eye: (f32, f32, f32),
    target: (f32, f32, f32),
}

impl Flight {
    /// Number of frames until it stays at its last key or restarts; [`u32::MAX`] if there are more.
    pub fn frames(&self, per_second: f32) -> u32 {
        let (first, last) = (self.keys[0], self.keys[self.keys.len() - 1]);
        let begin = if self.looped { first.time } else { 0.0 };
        let frames = ((last.time - begin).max(0.0) * per_second).round() as u32;
        if self.looped { frames.max(1) } else { frames.saturating_add(1) }
    }

    /// Returns true if the camera moves.
    pub fn moves(&self) -> bool {
        self.keys.len() > 1
    }

    /// The default flight through a scene.
    pub fn default_of(scene: &Scene) -> Self {
        let camera = scene.camera;
        let distance = target_distance(scene);
        let target = camera.eye + camera.rotation * Vec3::NEG_Z * distance;
        let keys = (0u8..).zip(FLIGHT).map(|(i, share)| {
            let offset = Vec3::new(share.x, share.y, -share.z) * distance;
            let eye = camera.eye + camera.rotation * offset;
            let from = (camera.eye - target).normalize();
            let to = (eye - target).normalize();
            let rotation = (Quat::from_rotation_arc(from, to) * camera.rotation).normalize();
            Key { time: f32::from(i) * FLIGHT_SECONDS, eye, rotation }
        });
        Self { keys: keys.collect(), looped: true }
    }

    pub fn read(path: &Path) -> Result<Self, PathError> {
        let text =
            epigraph_files::text(path).map_err(|source| PathError::Io { path: path.into(), source })?;
        Self::parse(&text, path)
    }

    /// Reads the text of the file `path`.
    pub fn parse(text: &str, path: &Path) -> Result<Self, PathError> {
        let wrong = |message: String| PathError::Keyframes { path: path.into(), message };
        let file: FlightFile = ron::from_str(text).map_err(|error| wrong(error.to_string()))?;
        if file.keys.is_empty() {
            return Err(wrong("`keys` is empty: give at least one keyframe".into()));
        }
        let mut keys = Vec::with_capacity(file.keys.len());
        for (i, key) in file.keys.iter().enumerate() {
            let [eye, target] = [key.eye, key.target].map(Vec3::from);
            if !(is_time(key.time) && is_near(eye) && is_near(target)) {
                return Err(wrong(format!(
                    "keyframe {i}: numbers must be finite, times at most {MAX_TIME:e}, and coordinates at most \
                     {MAX_COORDINATE:e}"
                )));
            }
            if eye == target {
                return Err(wrong(format!("keyframe {i}: `eye` and `target` are the same point")));
            }
            if keys.last().is_some_and(|last: &Key| last.time >= key.time) {
                return Err(wrong(format!("keyframe {i}: its time is not after that of keyframe {}", i - 1)));
            }
            let Camera { eye, rotation, .. } = Camera::look_at(eye, target, 1.0, 1.0, 1.0);
            keys.push(Key { time: key.time, eye, rotation });
        }
        let mut flight = Self { keys, looped: file.looped };
        if flight.looped {
            flight.close();
        }
        Ok(flight)
    }

    /// Makes the last key repeat the first: one mean interval after the last, unless it stands there already.
    fn close(&mut self) {
        let (first, last) = (self.keys[0], self.keys[self.keys.len() - 1]);
        // A single key is its own repetition.
        if first.eye != last.eye || first.rotation != last.rotation {
            let intervals = self.keys.len() - 1;
            let time = last.time + (last.time - first.time) / intervals as f32;
            self.keys.push(Key { time, ..first });
        }
    }

    /// Eye and rotation after `seconds`. Between two keys a cubic Bézier curve whose ends have the velocity of the
    /// Catmull-Rom rule, the difference of the neighbours over the difference of their times; for rotations the same
    /// curve with slerp in place of lerp (Shoemake, "Animating Rotation with Quaternion Curves", 1985).
    pub fn at(&self, seconds: f32) -> (Vec3, Quat) {
        let (first, last) = (self.keys[0], self.keys[self.keys.len() - 1]);
        let duration = last.time - first.time;
        let seconds = if self.looped && duration > 0.0 {
            first.time + (seconds - first.time).rem_euclid(duration)
        } else {
            seconds.clamp(first.time, last.time)
        };
        let next = self.keys.partition_point(|key| key.time <= seconds);
        if next == 0 || next == self.keys.len() {
            let key = self.keys[next.saturating_sub(1)];
            return (key.eye, key.rotation);
        }
        let (a, b) = (self.keys[next - 1], self.keys[next]);
        let interval = b.time - a.time;
        let t = (seconds - a.time) / interval;
        let [(eye_a, turn_a), (eye_b, turn_b)] = [next - 1, next].map(|i| self.velocity(i));
        let third = interval / 3.0;
        let eyes = [a.eye, a.eye + eye_a * third, b.eye - eye_b * third, b.eye];
        let turn = |q: Quat, velocity: Vec3| q * Quat::from_scaled_axis(velocity * third);
        let rotations = [a.rotation, turn(a.rotation, turn_a), turn(b.rotation, -turn_b), b.rotation];
        (bezier(eyes, |p, q| p.lerp(q, t)), bezier(rotations, |p, q| p.slerp(q, t)).normalize())
    }

    /// Velocity of the eye (metres a second) and of the rotation (radians a second, about axes of the camera) at a key.
    fn velocity(&self, index: usize) -> (Vec3, Vec3) {
        let end = self.keys.len() - 1;
        let (before, after) = match index {
            // Through the joint of a loop; its keys 0 and `end` are the same place.
            _ if self.looped && (index == 0 || index == end) => {
                let (mut before, after) = (self.keys[end - 1], self.keys[1]);
                before.time -= self.keys[end].time - self.keys[0].time;
                (before, after)
            }
            0 => (self.keys[0], self.keys[1]),
            _ => (self.keys[index - 1], self.keys[(index + 1).min(end)]),
        };
        let interval = after.time - before.time;
        let turn = scaled_axis_between(before.rotation, after.rotation);
        ((after.eye - before.eye) / interval, turn / interval)
    }
}

/// The text of a keyframe file through these cameras, each at its time in seconds, ascending. Of a camera its place and
/// the direction of its view are kept: the horizon is level.
pub fn keyframes(cameras: &[(f32, Camera)]) -> String {
    let mut text = String::from("(\n    looped: false,\n    keys: [\n");
    for (time, camera) in cameras {
        let eye = camera.eye;
        // As far from the eye as the eye is from the origin: closer, rounding of the sum would turn the view.
        let target = eye + camera.rotation * Vec3::NEG_Z * eye.length().max(1.0);
        let [eye, target] = [eye, target].map(|Vec3 { x, y, z }| format!("({x:?}, {y:?}, {z:?})"));
        text += &format!("        (time: {time:?}, eye: {eye}, target: {target}),\n");
    }
    text + "    ],\n)\n"
}

/// De Casteljau's construction of a cubic, with `mix` for each step.
fn bezier<P: Copy>(p: [P; 4], mix: impl Fn(P, P) -> P) -> P {
    let [a, b, c] = [mix(p[0], p[1]), mix(p[1], p[2]), mix(p[2], p[3])];
    mix(mix(a, b), mix(b, c))
}

/// The shorter turn from `a` to `b` about axes of `a`, as axis times angle.
fn scaled_axis_between(a: Quat, b: Quat) -> Vec3 {
    let turn = (a.conjugate() * b).normalize();
    (if turn.w < 0.0 { -turn } else { turn }).to_scaled_axis()
}
