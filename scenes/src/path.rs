//! Camera paths: the camera of every frame, a function of the frame index alone.

mod flight;

use std::path::{Path, PathBuf};

use glam::{Quat, Vec3};

use crate::limits::is_near;
use crate::motion::FRAMES_PER_SECOND;
use crate::{Camera, Rng, Scene};
use flight::Flight;
pub use flight::keyframes;

/// The forms that [`CameraPath::parse`] accepts.
const FORMS: [&str; 6] =
    ["still", "file:NAME", "view:X,Y,Z:QX,QY,QZ,QW", "orbit[:DEGREES[:ARC]]", "fly[:FILE.ron]", "shake"];

/// An orbit's default speed in degrees per frame, and its default arc in degrees. The arc is wide enough for every kind
/// of disocclusion, and narrow enough to keep the eye of the Cornell box within the opening: from beside it, the camera
/// would see the outer sides of the walls, whose points would stay in the cloud where the inner sides have theirs.
const ORBIT_SPEED: f32 = 1.0;
const ORBIT_ARC: f32 = 28.0;

/// Least distance of an orbit's eye from the bounds of a scene in which it starts, as a share of the scene's size.
const ORBIT_MARGIN: f32 = 0.02;

/// Allowed deviation of a quaternion's squared length from 1, for numbers rounded by hand.
const UNIT_TOLERANCE: f32 = 1e-3;

/// Hand-held jitter: largest sway as a share of the distance to the target, largest turn in degrees, and the
/// frequencies (Hz) of the two layers of noise, each half as strong as the one before.
const SHAKE_SWAY: f32 = 0.006;
const SHAKE_TURN: f32 = 0.6;
const SHAKE_HERTZ: [f32; 2] = [1.3, 3.7];

/// A camera that moves with the frame index, at 30 frames per second of path time.
#[derive(Clone, Debug)]
pub struct CameraPath {
    /// The start of the path: the scene's own view.
    base: Camera,
    motion: Motion,
}

#[derive(Clone, Debug)]
enum Motion {
    Still,
    Orbit {
        center: Vec3,
        /// Radians per frame.
        speed: f32,
        /// Radians from one end to the other; `None` goes round and round.
        arc: Option<f32>,
    },
    Fly(Flight),
    Shake {
        /// Distance to the target, metres.
        distance: f32,
    },
}

/// The errors of a camera path.
#[derive(Debug, thiserror::Error)]
pub enum PathError {
    /// No path has that name.
    #[error("unknown camera path `{name}`{hint}; known paths: {}", FORMS.join(", "))]
    Unknown {
        /// The unknown name.
        name: String,
        /// ", did you mean `...`?" or nothing.
        hint: String,
    },
    /// The scene has no camera of that name.
    #[error("camera path `file:{name}`: {}", cameras(known))]
    Camera {
        /// The unknown name.
        name: String,
        /// The names of the scene's cameras.
        known: Vec<String>,
    },
    /// An argument that is not a number, or out of range.
    #[error("camera path `{text}`: expected {expected}, found `{found}`")]
    Number {
        /// The whole text.
        text: String,
        /// The expected argument.
        expected: &'static str,
        /// The text found instead.
        found: String,
    },
    /// The path has too many arguments.
    #[error("camera path `{text}`: unexpected argument after `{path}`")]
    Surplus {
        /// The whole text.
        text: String,
        /// The valid part.
        path: String,
    },
    /// The keyframe file cannot be read.
    #[error("{}: {source}", path.display())]
    Io {
        /// Which file.
        path: PathBuf,
        /// Why.
        source: std::io::Error,
    },
    /// The keyframe file is wrong.
    #[error("{}: {message}", path.display())]
    Keyframes {
        /// Which file.
        path: PathBuf,
        /// What is wrong, with line and column if it is the syntax.
        message: String,
    },
}

impl CameraPath {
    /// Reads a path for the camera of `scene`:
    ///
    /// - `still`: the scene's view;
    /// - `file:NAME`: the camera of that name in the scene's file;
    /// - `view:X,Y,Z:QX,QY,QZ,QW`: a fixed eye point, with the rotation from camera to world space as a quaternion and
    ///   the scene's lens. [`CameraPath::view`] writes it;
    /// - `orbit`, `orbit:DEGREES`, `orbit:DEGREES:ARC`: orbits the camera's target by `DEGREES` per frame (default 1),
    ///   to and fro on an arc of `ARC` degrees (default 28) with the scene's view in the middle; 360 gives a full
    ///   circle. An eye that starts inside the scene's bounds stays inside;
    /// - `fly`, `fly:FILE.ron`: through keyframes, by default a gentle loop forwards and sideways. The file holds
    ///   `(looped: true, keys: [(time: 0.0, eye: (x, y, z), target: (x, y, z)), ...])`, times in seconds;
    /// - `shake`: small hand-held movements about the scene's view.
    pub fn parse(text: &str, scene: &Scene) -> Result<Self, PathError> {
        let (name, rest) = match text.split_once(':') {
            Some((name, rest)) => (name, Some(rest)),
            None => (text, None),
        };
        let surplus = |path: &str| PathError::Surplus { text: text.into(), path: path.into() };
        let mut base = scene.camera;
        let motion = match (name, rest) {
            ("view", numbers) => {
                (base.eye, base.rotation) = view(text, numbers.unwrap_or_default())?;
                Motion::Still
            }
            ("still", None) => Motion::Still,
            ("file", name) => {
                base = of_file(name.unwrap_or_default(), scene)?;
                Motion::Still
            }
            ("shake", None) => Motion::Shake { distance: target_distance(scene) },
            ("still" | "shake", Some(_)) => return Err(surplus(name)),
            ("orbit", arguments) => orbit(text, arguments, scene)?,
            ("fly", None) => Motion::Fly(Flight::default_of(scene)),
            ("fly", Some("")) => {
                let expected = "a file of keyframes, or `fly` alone";
                return Err(PathError::Number { text: text.into(), expected, found: String::new() });
            }
            ("fly", Some(file)) => Motion::Fly(Flight::read(Path::new(file))?),
            _ => return Err(unknown(name)),
        };
        Ok(Self { base, motion })
    }

    /// The path through the keyframes in `text`, in the format of `fly:FILE`, with the lens of `scene`. Errors name
    /// `origin` as the file.
    pub fn through(text: &str, origin: &Path, scene: &Scene) -> Result<Self, PathError> {
        Ok(Self { base: scene.camera, motion: Motion::Fly(Flight::parse(text, origin)?) })
    }

    /// The text from which [`CameraPath::parse`] reproduces this view exactly, for a camera with the scene's lens.
    pub fn view(camera: &Camera) -> String {
        let ([x, y, z], [qx, qy, qz, qw]) = (camera.eye.to_array(), camera.rotation.to_array());
        format!("view:{x},{y},{z}:{qx},{qy},{qz},{qw}")
    }

    /// Number of frames until it stops or repeats, at least 1 and at most [`u32::MAX`]; `None` if it never does.
    pub fn frames(&self) -> Option<u32> {
        match &self.motion {
            Motion::Still => Some(1),
            Motion::Shake { .. } => None,
            Motion::Orbit { speed, arc, .. } => {
                let way = arc.map_or(std::f32::consts::TAU, |arc| 2.0 * arc);
                let frames = (way / speed.abs()).round();
                // With a speed of 0, or without room, it does not move.
                Some(if frames.is_finite() { (frames as u32).max(1) } else { 1 })
            }
            Motion::Fly(flight) => Some(flight.frames(FRAMES_PER_SECOND)),
        }
    }

    /// Returns true if the cameras of any two frames differ.
    pub fn moves(&self) -> bool {
        match &self.motion {
            Motion::Still => false,
            Motion::Orbit { speed, arc, .. } => *speed != 0.0 && *arc != Some(0.0),
            Motion::Fly(flight) => flight.moves(),
            Motion::Shake { .. } => true,
        }
    }

    /// The camera of a frame.
    pub fn camera(&self, frame: u32) -> Camera {
        let seconds = (f64::from(frame) / f64::from(FRAMES_PER_SECOND)) as f32;
        match &self.motion {
            Motion::Still => self.base,
            Motion::Orbit { center, speed, arc } => {
                turn(&self.base, *center, orbit_angle(frame, *speed, *arc))
            }
            Motion::Fly(flight) => {
                let (eye, rotation) = flight.at(seconds);
                Camera { eye, rotation, ..self.base }
            }
            Motion::Shake { distance } => shake(&self.base, *distance, seconds),
        }
    }
}

fn unknown(name: &str) -> PathError {
    let names = FORMS.map(|form| form.split(['[', ':']).next().unwrap_or(form));
    let nearest = names.into_iter().min_by_key(|known| strsim::damerau_levenshtein(known, name));
    let hint = nearest
        .filter(|known| strsim::damerau_levenshtein(known, name) <= 2)
        .map_or(String::new(), |known| format!(", did you mean `{known}`?"));
    PathError::Unknown { name: name.into(), hint }
}

/// The camera of that name in the scene's file.
fn of_file(name: &str, scene: &Scene) -> Result<Camera, PathError> {
    let found = scene.cameras.iter().find(|(known, _)| known == name);
    found.map(|(_, camera)| *camera).ok_or_else(|| PathError::Camera {
        name: name.to_owned(),
        known: scene.cameras.iter().map(|(name, _)| name.clone()).collect(),
    })
}

/// The names of a scene's cameras in a sentence.
fn cameras(known: &[String]) -> String {
    match known {
        [] => "the scene's file has no cameras; `still` is the scene's own view".to_owned(),
        known => format!("the scene's cameras are {}", known.join(", ")),
    }
}

/// Eye and rotation of `view:X,Y,Z:QX,QY,QZ,QW`.
fn view(text: &str, numbers: &str) -> Result<(Vec3, Quat), PathError> {
    let expected =
        "an eye X,Y,Z of at most 1e9 and, after a colon, a rotation as a quaternion of length 1, QX,QY,QZ,QW";
    let wrong = || PathError::Number { text: text.into(), expected, found: numbers.into() };
    let (eye, rotation) = numbers.split_once(':').ok_or_else(wrong)?;
    let eye = Vec3::from_array(list(eye).ok_or_else(wrong)?);
    let rotation = Quat::from_array(list(rotation).ok_or_else(wrong)?);
    let valid = is_near(eye) && (rotation.length_squared() - 1.0).abs() < UNIT_TOLERANCE;
    if valid { Ok((eye, rotation)) } else { Err(wrong()) }
}

/// Parses `N` numbers separated by commas.
fn list<const N: usize>(text: &str) -> Option<[f32; N]> {
    let numbers: Option<Vec<f32>> = text.split(',').map(|part| part.trim().parse().ok()).collect();
    numbers?.try_into().ok()
}

/// Distance to the camera's target along the view axis: that of the scene's centre, but, for an eye inside the scene,
/// at least half the distance to the far side.
fn target_distance(scene: &Scene) -> f32 {
    let Camera { eye, rotation, .. } = scene.camera;
    let forward = rotation * Vec3::NEG_Z;
    let [low, high] = scene.bounds;
    let level = forward.dot((low + high) * 0.5 - eye);
    // The distance at which the view axis leaves the bounding box.
    let exits = Vec3::select(forward.cmpge(Vec3::ZERO), high - eye, low - eye) / forward;
    let exit = Vec3::select(forward.cmpeq(Vec3::ZERO), Vec3::INFINITY, exits).min_element();
    let distance = level.max(0.5 * exit);
    if distance > 0.0 && distance.is_finite() { distance } else { low.distance(high).max(1e-3) }
}

/// The camera turned by `angle` radians about the vertical axis through `center`.
fn turn(camera: &Camera, center: Vec3, angle: f32) -> Camera {
    let rotation = Quat::from_rotation_y(angle);
    Camera {
        eye: center + rotation * (camera.eye - center),
        rotation: (rotation * camera.rotation).normalize(),
        ..*camera
    }
}

/// Angle of an orbit, radians: a triangular swing that starts in the middle of the arc, or a circle.
fn orbit_angle(frame: u32, speed: f32, arc: Option<f32>) -> f32 {
    // In f64, the angle still resolves a millionth of a degree after an hour of frames.
    let travelled = f64::from(frame) * f64::from(speed);
    match arc.map(f64::from) {
        None => (travelled % std::f64::consts::TAU) as f32,
        Some(arc) if arc > 0.0 => {
            let phase = (travelled + 0.5 * arc).rem_euclid(2.0 * arc);
            (if phase < arc { phase - 0.5 * arc } else { 1.5 * arc - phase }) as f32
        }
        Some(_) => 0.0,
    }
}

fn orbit(text: &str, arguments: Option<&str>, scene: &Scene) -> Result<Motion, PathError> {
    let mut parts = arguments.into_iter().flat_map(|a| a.split(':'));
    let mut number = |default: f32, expected: &'static str, valid: fn(f32) -> bool| {
        let Some(part) = parts.next() else { return Ok(default) };
        part.parse().ok().filter(|&x| valid(x)).ok_or_else(|| PathError::Number {
            text: text.into(),
            expected,
            found: part.into(),
        })
    };
    let speed = number(ORBIT_SPEED, "degrees per frame between -360 and 360", |x| x.abs() <= 360.0)?;
    let arc = number(ORBIT_ARC, "an arc above 0 and up to 360 degrees", |x| x > 0.0 && x <= 360.0)?;
    if parts.next().is_some() {
        return Err(PathError::Surplus { text: text.into(), path: "orbit:DEGREES:ARC".into() });
    }
    let camera = scene.camera;
    let center = camera.eye + camera.rotation * Vec3::NEG_Z * target_distance(scene);
    let arc = arc_inside(scene, center, arc);
    let arc = (arc < 360.0).then(|| arc.to_radians());
    Ok(Motion::Orbit { center, speed: speed.to_radians(), arc })
}

/// The widest arc of at most `arc` degrees, in steps of a degree to each side, on which an eye that starts inside the
/// scene's bounds stays inside.
fn arc_inside(scene: &Scene, center: Vec3, arc: f32) -> f32 {
    let [low, high] = scene.bounds;
    let margin = ORBIT_MARGIN * (high - low);
    let inside = |p: Vec3| p.cmpge(low + margin).all() && p.cmple(high - margin).all();
    if !inside(scene.camera.eye) {
        return arc;
    }
    let both_inside = |degrees: f32| {
        [degrees, -degrees].into_iter().all(|d| inside(turn(&scene.camera, center, d.to_radians()).eye))
    };
    let steps = (0.5 * arc).floor() as u32;
    let free = (1..=steps).take_while(|&degrees| both_inside(degrees as f32)).count() as u32;
    if free == steps { arc } else { 2.0 * free as f32 }
}

/// Hand-held movement about a camera.
fn shake(base: &Camera, distance: f32, seconds: f32) -> Camera {
    let axes = |first: u32| Vec3::from_array([0, 1, 2].map(|axis| noise(first + axis, seconds)));
    let sway = base.rotation * axes(0) * (SHAKE_SWAY * distance);
    let turn = Quat::from_scaled_axis(axes(3) * SHAKE_TURN.to_radians());
    Camera { eye: base.eye + sway, rotation: (base.rotation * turn).normalize(), ..*base }
}

/// Smooth noise in [-1, 1] of one channel: lattice values at each layer's frequency, joined by quintic steps so that
/// velocity and acceleration have no jumps.
fn noise(channel: u32, seconds: f32) -> f32 {
    let mut sum = 0.0;
    let mut strength = 1.0;
    let mut total = 0.0;
    for (layer, hertz) in (0u32..).zip(SHAKE_HERTZ) {
        let position = seconds * hertz;
        let cell = position.floor();
        let t = position - cell;
        let step = t * t * t * (t * (6.0 * t - 15.0) + 10.0);
        let [a, b] = [cell, cell + 1.0].map(|cell| {
            let key = Rng::key(channel * 16 + layer, cell as u32);
            2.0 * Rng::new(0, key).next_f32() - 1.0
        });
        sum += strength * (a + (b - a) * step);
        total += strength;
        strength *= 0.5;
    }
    sum / total
}

#[cfg(test)]
mod tests;
