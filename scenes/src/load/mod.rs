//! Loads a scene by its name or path.

mod beside;
mod colors;
mod default_light;
mod file;
mod gltf;
mod images;
mod kind;
mod materials;
mod model;
mod obj;
mod origin;
mod ply;
mod polygons;
mod triangulate;
mod uvs;

use std::borrow::Cow;
use std::io::Read;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use epigraph_files::{self as files, MOST_DATA, MOST_TEXT, without_mark};
use epigraph_streams::PointSet;
use flate2::read::MultiGzDecoder;

use crate::builtin::{self, scene_names};
use crate::{Scene, SceneError, Sky};

use beside::Beside;
pub use file::{
    CameraSpec, LightSpec, MotionKeySpec, MotionSpec, ObjectSpec, RepeatSpec, SceneFile, ShapeSpec,
};
pub use images::texture_progress;
pub use materials::{ChannelSpec, MapSpec, MapSpecs, MaterialSpec, MediumSpec, SurfaceSpec};
use model::Model;
pub(crate) use model::framing_camera;
pub use ply::ply_header;

/// The kinds of file that hold meshes, by ending.
const MESH_ENDINGS: [&str; 5] = [".glb", ".gltf", ".obj", ".ply", ".ply.gz"];
/// The ending of scene files.
const SCENE_ENDING: &str = ".ron";
/// The ending of point sets.
const POINTS_ENDING: &str = ".vts";
/// Least Jaro-Winkler similarity at which a name counts as a mistyped one.
const HINT_SIMILARITY: f64 = 0.75;

/// What a scene has beside what its files say.
#[derive(Clone, Debug, Default)]
pub struct LoadOptions {
    /// Lights it instead of its own sky. Default: none.
    pub sky: Option<Arc<Sky>>,
    /// Whether rays pass through the backs of the single-sided materials of glTF files, as that format says, but for those
    /// that transmit light. Default: false, all surfaces have two sides.
    pub single_sided: bool,
}

impl Scene {
    /// The scene of that name (see [`scene_names`]), or the one in the `.glb`, `.gltf`, `.obj`, `.ply`, `.ply.gz`,
    /// `.ron` or `.vts` file at that path.
    ///
    /// # Errors
    /// An unknown name or ending, a file that cannot be read or is broken, a mesh that has not been fetched, a mesh
    /// without triangles or with vertices that are not finite.
    pub fn load(name_or_path: &str) -> Result<Self, SceneError> {
        Self::load_with(name_or_path, &LoadOptions::default())
    }

    /// The same with other options.
    ///
    /// # Errors
    /// Those of [`Scene::load`].
    pub fn load_with(name_or_path: &str, options: &LoadOptions) -> Result<Self, SceneError> {
        if let Some(scene) = builtin::load(name_or_path, options) {
            return scene;
        }
        let path = Path::new(name_or_path);
        let lower = name_or_path.to_lowercase();
        if lower.ends_with(SCENE_ENDING) {
            load_scene_file(path, name_or_path, options)
        } else if lower.ends_with(POINTS_ENDING) {
            let points = PointSet::read(path).map_err(|error| {
                // It was read in pieces. What stands for another file is small.
                let other = files::bytes(path, MOST_TEXT).ok().map(|bytes| kind::check(&bytes, &lower));
                match other {
                    Some(Err(message)) => SceneError::Invalid { path: path.to_owned(), message },
                    _ => SceneError::Points(error),
                }
            })?;
            Ok(Self { sky: options.sky.clone(), ..Self::of_points(name_or_path, Arc::new(points)) })
        } else if MESH_ENDINGS.iter().any(|ending| lower.ends_with(ending)) {
            let unusable = |source| SceneError::Mesh { name: name_or_path.to_owned(), source };
            let model = Model { sky: options.sky.clone(), ..read_mesh_file(path, options.single_sided)? };
            model.into_scene(name_or_path).map_err(unusable)
        } else {
            Err(SceneError::Unknown(unknown(name_or_path)))
        }
    }
}

fn load_scene_file(path: &Path, name: &str, options: &LoadOptions) -> Result<Scene, SceneError> {
    let invalid = |message: String| SceneError::Invalid { path: path.to_owned(), message };
    let unreadable = |source| SceneError::Io { path: path.to_owned(), source };
    let bytes = files::bytes(path, MOST_TEXT).map_err(unreadable)?;
    kind::check(&bytes, &name.to_lowercase()).map_err(invalid)?;
    let text = files::text_of(bytes).map_err(unreadable)?;
    let folder = path.parent().map_or_else(PathBuf::new, Path::to_owned);
    SceneFile::parse(&text).map_err(invalid)?.into_scene(name, path, &[folder], None, options)
}

/// Reads a mesh file of any kind, by its ending; `single_sided` is as in [`LoadOptions`].
fn read_mesh_file(path: &Path, single_sided: bool) -> Result<Model, SceneError> {
    let invalid = |message: String| SceneError::Invalid { path: path.to_owned(), message };
    let companions = Beside { mesh: path };
    let beside = |name: &str, most: u64| companions.bytes(name, most);
    let name = path.to_string_lossy().to_lowercase();
    let bytes =
        files::bytes(path, MOST_DATA).map_err(|source| SceneError::Io { path: path.to_owned(), source })?;
    if name.ends_with(".ply.gz") {
        // A few bytes can unpack to a promise of millions.
        ply::check_start(MultiGzDecoder::new(bytes.as_slice())).map_err(invalid)?;
    }
    let bytes = unpack(bytes, MOST_DATA).map_err(invalid)?;
    kind::check(&bytes, &name).map_err(invalid)?;
    let model = if name.ends_with(".ply") || name.ends_with(".ply.gz") {
        ply::read(without_mark(&bytes), beside)
    } else if name.ends_with(".obj") {
        obj::read(&lossy(&bytes), beside)
    } else if name.ends_with(".glb") || name.ends_with(".gltf") {
        gltf::read(without_mark(&bytes), |name| beside(name, MOST_DATA))
    } else {
        Err(format!("the file name must end in one of {}", MESH_ENDINGS.join(", ")))
    };
    let mut model = model.map_err(invalid)?;
    model.materials.iter_mut().for_each(|material| material.culled &= single_sided);
    model.check().map_err(|error| invalid(error.to_string()))?;
    Ok(model)
}

/// Text in UTF-16 with a byte-order mark, in UTF-8, or else in Latin-1, as old exporters write names: in another encoding
/// of bytes these are misspelt, but remain different names.
fn lossy(bytes: &[u8]) -> Cow<'_, str> {
    let words = |read: fn([u8; 2]) -> u16| {
        let words: Vec<u16> = bytes[2..].chunks_exact(2).map(|pair| read([pair[0], pair[1]])).collect();
        Cow::Owned(String::from_utf16_lossy(&words))
    };
    match bytes {
        [0xFF, 0xFE, ..] => words(u16::from_le_bytes),
        [0xFE, 0xFF, ..] => words(u16::from_be_bytes),
        _ => match std::str::from_utf8(without_mark(bytes)) {
            Ok(text) => Cow::Borrowed(text),
            Err(_) => Cow::Owned(bytes.iter().map(|&byte| char::from(byte)).collect()),
        },
    }
}

/// Decompresses gzip data, to at most `most` bytes; other data is returned unchanged.
fn unpack(bytes: Vec<u8>, most: u64) -> Result<Vec<u8>, String> {
    if !bytes.starts_with(&[0x1f, 0x8b]) {
        return Ok(bytes);
    }
    let mut unpacked = Vec::new();
    MultiGzDecoder::new(bytes.as_slice())
        .take(most + 1)
        .read_to_end(&mut unpacked)
        .map_err(|error| format!("it cannot be unpacked: {error}"))?;
    if unpacked.len() as u64 > most {
        return Err(format!("it unpacks to more than {most} bytes"));
    }
    Ok(unpacked)
}

/// ", did you mean ...?" if one of `known` is similar to `name`, else an empty string.
fn nearest<'a>(name: &str, known: impl Iterator<Item = &'a str>) -> String {
    known
        .map(|known| (strsim::jaro_winkler(name, known), known))
        .filter(|(similarity, _)| *similarity > HINT_SIMILARITY)
        .max_by(|a, b| a.0.total_cmp(&b.0))
        .map_or(String::new(), |(_, known)| format!(", did you mean `{known}`?"))
}

fn unknown(name: &str) -> String {
    let names: Vec<&str> = scene_names().iter().map(|info| info.name).collect();
    let hint = nearest(name, names.iter().copied());
    format!(
        "unknown scene `{name}`{hint} (scenes: {}; files end in {}, {SCENE_ENDING}, {POINTS_ENDING})",
        names.join(", "),
        MESH_ENDINGS.join(", ")
    )
}

#[cfg(test)]
mod cases;
#[cfg(test)]
mod tests;
