//! Epigraph's own scene files.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use epigraph_files::{self as files, MOST_DATA};
use glam::{Affine3A, DAffine3, DVec3, EulerRot, Quat, Vec3, Vec3A};
use serde::Deserialize;

use super::default_light::add_default_light;
use super::materials::{self, MaterialSpec};
use super::model::{self, Model};
use super::origin::origin_of;
use crate::builder::{CREASE_ANGLE, SceneBuilder};
use crate::limits::{MAX_COORDINATE, MAX_INTENSITY, MAX_RADIANCE, MAX_TIME, is_near, is_radiance, is_time};
use crate::{Camera, Light, LoadOptions, MeshError, Motion, MotionKey, Scene, SceneError, Shape, Sky};

/// The contents of a scene's `.ron` file. Lengths are in metres, angles in degrees, colours in linear Rec. 709.
///
/// Places are read and mesh files placed in double precision. If a file's object remains far out for its size, the scene
/// gets an origin there ([`Scene::origin`]).
///
/// ```ron
/// #![enable(implicit_some)]
/// Scene(
///     version: 1,
///     camera: (eye: (0, 1, 4), target: (0, 0.5, 0), fov: 35),
///     motions: {
///         "to and fro": (keys: [(time: 0), (time: 2, translate: (1, 0, 0)), (time: 4)], looped: true),
///     },
///     materials: {
///         "clay": (color: (0.7, 0.4, 0.3), maps: (normal: (file: "clay.png"))),
///         "metal": (color: (0.2, 0.2, 0.2), metallic: 1, roughness: 0.3),
///     },
///     objects: [
///         (shape: Quad(corner: (-2, 0, 2), u: (4, 0, 0), v: (0, 0, -4)), material: "clay"),
///         (shape: File("statue.ply"), material: "metal", height: 1, rotate: (0, 30, 0)),
///         (shape: Sphere(center: (0, 1, 1), radius: 0.2), material: "clay", motion: "to and fro"),
///     ],
///     lights: [ Quad(corner: (-1, 3, -1), u: (2, 0, 0), v: (0, 0, 2), radiance: (9, 9, 9)) ],
/// )
/// ```
#[derive(Clone, Debug, Deserialize, PartialEq)]
#[serde(deny_unknown_fields, rename = "Scene")]
pub struct SceneFile {
    /// The version of this format: 1.
    pub version: u32,
    /// Default: the camera of the first object file that has one, else a camera that sees everything.
    #[serde(default)]
    pub camera: Option<CameraSpec>,
    /// Radiance of a ray that hits nothing. Default black.
    #[serde(default)]
    pub background: Vec3,
    /// An HDR or EXR file of longitudes and latitudes that lights the scene from all around, instead of the background;
    /// relative to the scene file's folder. Default: none.
    #[serde(default)]
    pub sky: Option<String>,
    /// Faces that meet at more than this angle make a crease. Default 40.
    #[serde(default = "default_crease_angle")]
    pub crease_angle: f32,
    /// Vertices at most this far apart are welded. Default 0: only equal ones.
    #[serde(default)]
    pub weld_distance: f32,
    /// Materials by the name that objects use.
    #[serde(default)]
    pub materials: BTreeMap<String, MaterialSpec>,
    /// Motions by the name that objects and lights use.
    #[serde(default)]
    pub motions: BTreeMap<String, MotionSpec>,
    /// The objects of the scene.
    pub objects: Vec<ObjectSpec>,
    /// Lights in addition to those of the objects' files; if there are no lights at all, one is added in front.
    #[serde(default)]
    pub lights: Vec<LightSpec>,
}

fn default_crease_angle() -> f32 {
    CREASE_ANGLE
}

/// A camera of a scene file.
#[derive(Clone, Copy, Debug, Deserialize, PartialEq)]
#[serde(deny_unknown_fields)]
pub struct CameraSpec {
    /// The eye point.
    pub eye: DVec3,
    /// The target point.
    pub target: DVec3,
    /// Full vertical field of view, between 0 and 180 degrees.
    pub fov: f32,
}

/// A motion of a scene file: rigid, from key to key, a function of the frame index at 30 frames per second.
#[derive(Clone, Debug, Deserialize, PartialEq)]
#[serde(deny_unknown_fields)]
pub struct MotionSpec {
    /// The point about which it rotates, for objects at rest. Default: the origin.
    #[serde(default)]
    pub pivot: DVec3,
    /// Poses in ascending order of time, at least one. Between two, translations are interpolated linearly and
    /// rotations along the shorter arc.
    pub keys: Vec<MotionKeySpec>,
    /// True if it restarts after the last key; otherwise it stays there. Default: false.
    #[serde(default)]
    pub looped: bool,
}

/// A key of a motion of a scene file.
#[derive(Clone, Copy, Debug, Deserialize, PartialEq)]
#[serde(deny_unknown_fields)]
pub struct MotionKeySpec {
    /// Seconds.
    pub time: f32,
    /// Translation from the position at rest. Default: none.
    #[serde(default)]
    pub translate: Vec3,
    /// Rotation about the pivot: about z, then x, then y, degrees. Default: none.
    #[serde(default)]
    pub rotate: Vec3,
}

/// An object of a scene file: a shape, scaled, then rotated, then moved.
#[derive(Clone, Debug, Deserialize, PartialEq)]
#[serde(deny_unknown_fields)]
pub struct ObjectSpec {
    /// Its shape.
    pub shape: ShapeSpec,
    /// A name in `materials`. Default: the materials of the shape's own file, else a plain grey.
    #[serde(default)]
    pub material: Option<String>,
    /// Factor on all lengths. Default 1; not with `height`.
    #[serde(default)]
    pub scale: Option<f32>,
    /// Rotation about z, then x, then y, degrees.
    #[serde(default)]
    pub rotate: Vec3,
    /// Position of its origin, or with `height`, of the middle of its underside.
    #[serde(default)]
    pub translate: DVec3,
    /// If given, the object is scaled to this height, and placed centred on `translate`.
    #[serde(default)]
    pub height: Option<f32>,
    /// Smooth shading across edges of at most this angle, for shapes without normals. Default 0: flat.
    #[serde(default)]
    pub smooth: f32,
    /// A name in `motions`. Default: it does not move.
    #[serde(default)]
    pub motion: Option<String>,
    /// Copies in a row. Default: one.
    #[serde(default)]
    pub repeat: RepeatSpec,
}

/// Copies of an object.
#[derive(Clone, Copy, Debug, Deserialize, PartialEq)]
#[serde(deny_unknown_fields)]
pub struct RepeatSpec {
    /// Number of copies, including the first.
    pub count: u32,
    /// Offset from each copy to the next.
    pub step: Vec3,
}

impl Default for RepeatSpec {
    fn default() -> Self {
        Self { count: 1, step: Vec3::ZERO }
    }
}

/// The shape of an object of a scene file.
#[derive(Clone, Debug, Deserialize, PartialEq)]
#[serde(deny_unknown_fields)]
pub enum ShapeSpec {
    /// Everything in a mesh file (.glb, .gltf, .obj, .ply), relative to the scene file's folder.
    File(String),
    /// Everything in a scene made by code, such as `cornell`.
    Builtin(String),
    /// A closed box.
    Box {
        /// Lowest corner.
        low: Vec3,
        /// Highest corner.
        high: Vec3,
    },
    /// A one-sided parallelogram with its front towards `u x v`.
    Quad {
        /// One corner.
        corner: Vec3,
        /// First side.
        u: Vec3,
        /// Second side.
        v: Vec3,
    },
    /// A sphere of 64 x 32 facets.
    Sphere {
        /// Its centre.
        center: Vec3,
        /// Its radius.
        radius: f32,
    },
    /// A closed upright cylinder of 64 facets around.
    Cylinder {
        /// The centre of its lower end.
        base: Vec3,
        /// Its radius.
        radius: f32,
        /// Its height.
        height: f32,
    },
}

/// A light of a scene file; see [`Light`](crate::Light).
#[derive(Clone, Debug, Deserialize, PartialEq)]
#[serde(deny_unknown_fields)]
pub enum LightSpec {
    /// A point.
    Point {
        /// Its position.
        position: DVec3,
        /// Radiant intensity, W/sr.
        intensity: Vec3,
        /// A name in `motions`. Default: it does not move.
        #[serde(default)]
        motion: Option<String>,
    },
    /// A point that shines into a cone around the direction to `target`.
    Spot {
        /// Its position.
        position: DVec3,
        /// A point on its axis.
        target: DVec3,
        /// Radiant intensity along the axis, W/sr.
        intensity: Vec3,
        /// The angle to the axis at which it begins to fade, degrees. Default 0.
        #[serde(default)]
        inner: f32,
        /// The angle to the axis beyond which it is dark, degrees. Default 45.
        #[serde(default = "default_cone")]
        outer: f32,
        /// A name in `motions`. Default: it does not move.
        #[serde(default)]
        motion: Option<String>,
    },
    /// A one-sided parallelogram that emits towards `u x v`.
    Quad {
        /// One corner.
        corner: DVec3,
        /// First side.
        u: Vec3,
        /// Second side.
        v: Vec3,
        /// Emitted radiance.
        radiance: Vec3,
        /// A name in `motions`. Default: it does not move.
        #[serde(default)]
        motion: Option<String>,
    },
}

fn default_cone() -> f32 {
    45.0
}

impl SceneFile {
    /// Parses the text of a scene file.
    ///
    /// # Errors
    /// A sentence that begins with line and column.
    pub fn parse(text: &str) -> Result<Self, String> {
        let file: Self = ron::Options::default()
            .with_default_extension(ron::extensions::Extensions::IMPLICIT_SOME)
            .from_str(text)
            .map_err(|error| {
                format!("line {}, column {}: {}", error.span.start.line, error.span.start.col, error.code)
            })?;
        file.check()?;
        Ok(file)
    }

    fn check(&self) -> Result<(), String> {
        if self.version != 1 {
            return Err(format!("unknown version {}; this program reads version 1", self.version));
        }
        if let Some(camera) = self.camera {
            let sane = camera.fov > 0.0 && camera.fov < 180.0 && camera.eye != camera.target;
            if !sane || !is_near(camera.eye.as_vec3()) || !is_near(camera.target.as_vec3()) {
                return Err(format!(
                    "the camera needs an eye and a different target with coordinates of at most {MAX_COORDINATE:e}, and \
                     a fov between 0 and 180: {camera:?}"
                ));
            }
        }
        if !is_radiance(self.background) {
            return Err(format!("background: each channel must be a number of at most {MAX_RADIANCE:e}"));
        }
        for (name, material) in &self.materials {
            material.check().map_err(|message| format!("material `{name}`: {message}"))?;
        }
        for (name, motion) in &self.motions {
            motion.check().map_err(|message| format!("motion `{name}`: {message}"))?;
        }
        for (index, object) in self.objects.iter().enumerate() {
            object.check().map_err(|message| format!("object {index}: {message}"))?;
        }
        for (index, light) in self.lights.iter().enumerate() {
            let has_extent = match *light {
                LightSpec::Point { .. } => true,
                LightSpec::Spot { position, target, inner, outer, .. } => {
                    position != target && 0.0 <= inner && inner <= outer && outer <= 180.0
                }
                LightSpec::Quad { u, v, .. } => u.cross(v) != Vec3::ZERO,
            };
            if !light.around(DVec3::ZERO).is_valid() || !has_extent {
                return Err(format!(
                    "light {index}: all numbers must be finite, coordinates at most {MAX_COORDINATE:e}, intensity at \
                     most {MAX_INTENSITY:e}, radiance at most {MAX_RADIANCE:e}, a quad must have an area, \
                     and a spot a target and 0 <= inner <= outer <= 180"
                ));
            }
        }
        let weld_is_sane = self.weld_distance >= 0.0 && self.weld_distance.is_finite();
        if !weld_is_sane || !(0.0..=180.0).contains(&self.crease_angle) {
            return Err(
                "crease_angle must be between 0 and 180, and weld_distance must not be negative".to_owned()
            );
        }
        Ok(())
    }

    /// Builds the scene that this file describes. Mesh files are searched in `folders`, in order; `fetch` is the name
    /// under which `scenes/fetch` brings missing ones.
    pub(crate) fn into_scene(
        self,
        name: &str,
        path: &Path,
        folders: &[PathBuf],
        fetch: Option<&str>,
        options: &LoadOptions,
    ) -> Result<Scene, SceneError> {
        let invalid = |message: String| SceneError::Invalid { path: path.to_owned(), message };
        let unusable = |source| SceneError::Mesh { name: name.to_owned(), source };
        let unplaced = |index: usize| move |error: MeshError| invalid(format!("object {index}: {error}"));
        let mut builder = SceneBuilder::new();
        let own_sky = |name: &String| Sky::load(&find(name, path, folders, fetch)?).map(Arc::new);
        if let Some(sky) = options.sky.clone().map(Ok).or_else(|| self.sky.as_ref().map(own_sky)) {
            builder.sky(sky?);
        }
        let image = |name: &str| files::bytes(&find(name, path, folders, fetch).ok()?, MOST_DATA).ok();
        let images = materials::images(self.materials.values(), image, &mut builder.report);
        let mut materials = BTreeMap::new();
        for (name, spec) in &self.materials {
            let material = spec.to_material(name, &images, &mut builder);
            materials.insert(name.as_str(), builder.material(material));
        }
        let motion_of = |what: &str, index: usize, name: &Option<String>| match name {
            None => Ok(None),
            Some(name) => self.motions.get(name).map(Some).ok_or_else(|| {
                let hint = super::nearest(name, self.motions.keys().map(String::as_str));
                invalid(format!("{what} {index}: unknown motion `{name}`{hint}"))
            }),
        };
        let mut placed = Vec::new();
        let mut size = [0_usize; 2];
        for (index, object) in self.objects.iter().enumerate() {
            let material = match &object.material {
                None => None,
                Some(wanted) => Some(*materials.get(wanted.as_str()).ok_or_else(|| {
                    let hint = super::nearest(wanted, materials.keys().copied());
                    invalid(format!("object {index}: unknown material `{wanted}`{hint}"))
                })?),
            };
            let mut model = object.shape.load(path, folders, fetch, options.single_sided)?;
            builder.report.extend(&model.report);
            if let Some(spec) = object.material.as_ref().map(|name| &self.materials[name]) {
                spec.maps.place(&object.shape, &mut model, &format!("object {index}"), &mut builder.report);
            }
            if object.smooth > 0.0 && model.parts.iter().all(|(shape, _)| !shape.normals.is_empty()) {
                let text = "`smooth` is for shapes without normals, but this one has them; drop it";
                return Err(invalid(format!("object {index}: {text}")));
            }
            // Before any of the copies is made.
            let copies = object.repeat.count as usize;
            let counts = model.counts().map(|count| count.saturating_mul(copies));
            size = [0, 1].map(|of| size[of].saturating_add(counts[of]));
            MeshError::of_size(size[0], size[1]).map_err(unplaced(index))?;
            for (shape, _) in
                model.parts.iter_mut().filter(|(s, _)| object.smooth > 0.0 && s.normals.is_empty())
            {
                shape.smooth(object.smooth);
            }
            let place =
                object.placement(&model).map_err(|text| invalid(format!("object {index}: {text}")))?;
            placed.push((model, place, material, motion_of("object", index, &object.motion)?));
        }
        // Of the first object that needs one where it is placed.
        builder.origin = placed
            .iter()
            .filter(|(model, ..)| model.origin != DVec3::ZERO)
            .map(|(model, place, ..)| origin_after(model, *place))
            .find(|origin| *origin != DVec3::ZERO)
            .unwrap_or_default();
        let origin = builder.origin;
        let mut file_camera = None;
        for (index, (object, (model, mut place, material, motion))) in
            self.objects.iter().zip(placed).enumerate()
        {
            let shift = (model.origin - origin).as_vec3();
            let shifted = |camera: Camera| Camera { eye: camera.eye + shift, ..camera };
            file_camera = file_camera.or_else(|| model.camera.map(shifted));
            let cameras = model.cameras.iter().map(|(name, camera)| (name.clone(), shifted(*camera)));
            builder.cameras.extend(cameras);
            place.translation -= origin;
            let place = place.as_affine3a();
            let add = |builder: &mut SceneBuilder| {
                (0..object.repeat.count).try_for_each(|copy| {
                    let step = Affine3A::from_translation(copy as f32 * object.repeat.step);
                    model.add_to(builder, step * place, material)
                })
            };
            let motion = motion.map(|spec| spec.to_motion(origin));
            builder.moving_if(motion, add).map_err(unplaced(index))?;
        }
        for (index, light) in self.lights.iter().enumerate() {
            let (LightSpec::Point { motion, .. }
            | LightSpec::Spot { motion, .. }
            | LightSpec::Quad { motion, .. }) = light;
            let motion = motion_of("light", index, motion)?.map(|spec| spec.to_motion(origin));
            let add = |builder: &mut SceneBuilder| match light.around(origin) {
                Light::Point { position, intensity } => {
                    builder.point_light(position, intensity);
                    Ok(())
                }
                Light::Spot { position, axis, intensity, cosines } => {
                    builder.spot_light(position, axis, intensity, cosines);
                    Ok(())
                }
                Light::Quad { corner, u, v, radiance } => builder.quad_light(corner, u, v, radiance),
            };
            builder.moving_if(motion, add).map_err(unusable)?;
        }
        let bounds = builder.bounds();
        let own_camera = self.camera.map(|spec| spec.to_camera(origin, bounds)).or(file_camera);
        add_default_light(&mut builder, own_camera.as_ref(), bounds).map_err(unusable)?;
        let camera = own_camera.unwrap_or_else(|| model::framing_camera(bounds));
        builder.build(name, camera, self.background, self.weld_distance, self.crease_angle).map_err(unusable)
    }
}

/// The origin that a model needs where it is placed.
fn origin_after(model: &Model, place: DAffine3) -> DVec3 {
    let turn = Affine3A { translation: Vec3A::ZERO, ..place.as_affine3a() };
    let [low, high] = model.bounds_after(turn).map(|corner| place.translation + corner.as_dvec3());
    origin_of(low, high)
}

impl LightSpec {
    /// The light in a scene of that origin.
    fn around(&self, origin: DVec3) -> Light {
        match *self {
            Self::Point { position, intensity, .. } => {
                Light::Point { position: (position - origin).as_vec3(), intensity }
            }
            Self::Spot { position, target, intensity, inner, outer, .. } => Light::Spot {
                position: (position - origin).as_vec3(),
                axis: (target - position).normalize_or_zero().as_vec3().normalize_or_zero(),
                intensity,
                cosines: [inner, outer].map(|degrees| degrees.to_radians().cos()),
            },
            Self::Quad { corner, u, v, radiance, .. } => {
                Light::Quad { corner: (corner - origin).as_vec3(), u, v, radiance }
            }
        }
    }
}

impl CameraSpec {
    /// Near and far are derived from the scene's bounds.
    fn to_camera(self, origin: DVec3, bounds: [Vec3; 2]) -> Camera {
        let [eye, target] = [self.eye, self.target].map(|point| (point - origin).as_vec3());
        let farthest = (eye - bounds[0]).abs().max((eye - bounds[1]).abs()).length();
        Camera::look_at(eye, target, self.fov.to_radians(), 1e-3 * farthest, 2.0 * farthest)
    }
}

impl MotionSpec {
    fn check(&self) -> Result<(), String> {
        if self.keys.is_empty() {
            return Err("`keys` is empty: give at least one key".to_owned());
        }
        let sane =
            |key: &MotionKeySpec| is_time(key.time) && is_near(key.translate) && key.rotate.is_finite();
        if !is_near(self.pivot.as_vec3()) || !self.keys.iter().all(sane) {
            return Err(format!(
                "all numbers must be finite, coordinates at most {MAX_COORDINATE:e}, times at most {MAX_TIME:e}"
            ));
        }
        match self.keys.windows(2).position(|pair| pair[0].time >= pair[1].time) {
            Some(index) => Err(format!("the time of key {} is not after that of key {index}", index + 1)),
            None => Ok(()),
        }
    }

    fn to_motion(&self, origin: DVec3) -> Motion {
        let key = |key: &MotionKeySpec| MotionKey {
            time: key.time,
            translate: key.translate,
            rotate: rotation(key.rotate),
        };
        let pivot = (self.pivot - origin).as_vec3();
        Motion { pivot, keys: self.keys.iter().map(key).collect(), looped: self.looped }
    }
}

/// Rotation about z, then x, then y, degrees.
fn rotation(degrees: Vec3) -> Quat {
    let [x, y, z] = degrees.to_array().map(f32::to_radians);
    Quat::from_euler(EulerRot::YXZ, y, x, z)
}

impl ObjectSpec {
    fn check(&self) -> Result<(), String> {
        if self.height.is_some() && self.scale.is_some() {
            return Err("`height` sets its scale; drop `scale` or `height`".to_owned());
        }
        let has_size = self.height.or(self.scale).is_none_or(|scale| scale.is_finite() && scale != 0.0);
        if !(has_size && (0.0..=180.0).contains(&self.smooth)) {
            return Err("scale and height must not be 0, and smooth must be between 0 and 180".to_owned());
        }
        const MOST_COPIES: u32 = 100_000;
        if self.repeat.count == 0 || self.repeat.count > MOST_COPIES {
            return Err(format!("repeat.count must be between 1 and {MOST_COPIES}"));
        }
        let last = self.repeat.count as f32 * self.repeat.step;
        if !(is_near(self.translate.as_vec3()) && self.rotate.is_finite() && is_near(last)) {
            return Err(format!(
                "all numbers must be finite, and translate and count * step at most {MAX_COORDINATE:e}"
            ));
        }
        self.shape.check()
    }

    /// The transform from its shape to the file's coordinates, those of a scene with the origin zero.
    ///
    /// # Errors
    /// A flat shape cannot be scaled to a height.
    fn placement(&self, model: &Model) -> Result<DAffine3, String> {
        let turn = Affine3A::from_quat(rotation(self.rotate));
        let Some(height) = self.height else {
            let place = turn * Affine3A::from_scale(Vec3::splat(self.scale.unwrap_or(1.0)));
            let mut place = place.as_daffine3();
            place.translation = place.transform_vector3(model.origin) + self.translate;
            return Ok(place);
        };
        let [low, high] = model.bounds_after(turn);
        if low.y >= high.y {
            return Err(
                "`height` scales an object to this height, but this one is flat; use `scale`".to_owned()
            );
        }
        let stand = Vec3::new(0.5 * (low.x + high.x), low.y, 0.5 * (low.z + high.z));
        let scale = height / (high.y - low.y);
        // It is placed by its box, wherever its coordinates are.
        let place = Affine3A::from_scale(Vec3::splat(scale)) * Affine3A::from_translation(-stand) * turn;
        let mut place = place.as_daffine3();
        place.translation += self.translate;
        Ok(place)
    }
}

/// The file `name` of the scene file `path`, in the first of `folders` that has it; `fetch` is as in
/// [`SceneFile::into_scene`].
fn find(name: &str, path: &Path, folders: &[PathBuf], fetch: Option<&str>) -> Result<PathBuf, SceneError> {
    let candidates = folders.iter().map(|folder| folder.join(name));
    candidates.clone().find(|candidate| candidate.exists()).ok_or_else(|| {
        let looked = candidates.map(|p| p.display().to_string()).collect::<Vec<_>>().join(", ");
        let message = match fetch {
            Some(scene) => {
                format!("`{name}` is not here yet: run `scenes/fetch {scene}` (looked for {looked})")
            }
            None => format!("`{name}` does not exist (looked for {looked})"),
        };
        SceneError::Invalid { path: path.to_owned(), message }
    })
}

impl ShapeSpec {
    fn check(&self) -> Result<(), String> {
        let length = |length: f32| length > 0.0 && length <= MAX_COORDINATE;
        let (kind, is_sane, expected) = match *self {
            Self::File(_) | Self::Builtin(_) => return Ok(()),
            Self::Box { low, high } => {
                // A box may be as flat as a sheet, but not a line.
                let sides = (high - low).to_array().into_iter().filter(|side| *side != 0.0).count();
                ("Box", is_near(low) && is_near(high) && sides >= 2, "an extent along two axes at least")
            }
            Self::Quad { corner, u, v } => {
                let is_sane = is_near(corner) && is_near(u) && is_near(v) && u.cross(v) != Vec3::ZERO;
                ("Quad", is_sane, "an area")
            }
            Self::Sphere { center, radius } => {
                ("Sphere", is_near(center) && length(radius), "a radius above 0")
            }
            Self::Cylinder { base, radius, height } => {
                let is_sane = is_near(base) && length(radius) && length(height);
                ("Cylinder", is_sane, "a radius and a height above 0")
            }
        };
        if is_sane {
            return Ok(());
        }
        Err(format!("a {kind} needs {expected}, and numbers that are finite and at most {MAX_COORDINATE:e}"))
    }

    fn load(
        &self,
        path: &Path,
        folders: &[PathBuf],
        fetch: Option<&str>,
        single_sided: bool,
    ) -> Result<Model, SceneError> {
        let invalid = |message: String| SceneError::Invalid { path: path.to_owned(), message };
        Ok(match self {
            Self::File(name) => super::read_mesh_file(&find(name, path, folders, fetch)?, single_sided)?,
            Self::Builtin(name) => match crate::builtin::by_code(name) {
                Some(scene) => Model::from_scene(&scene?),
                None => return Err(invalid(format!("`{name}` is not a scene made by code"))),
            },
            Self::Box { low, high } => Model::from_shape(Shape::cuboid(low.min(*high), low.max(*high))),
            Self::Quad { corner, u, v } => {
                Model::from_shape(Shape::quad([*corner, corner + u, corner + u + v, corner + v]))
            }
            Self::Sphere { center, radius } => {
                Model::from_shape(Shape::sphere(*radius, 64, 32).moved(*center))
            }
            Self::Cylinder { base, radius, height } => {
                Model::from_shape(Shape::cylinder(*radius, 0.0, *height, 64).moved(*base))
            }
        })
    }
}
