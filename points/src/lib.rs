//! Point sets from files: scans in PLY, LAS, LAZ and text, and the vertices of meshes and scenes. [`ply::write`] writes
//! what a model of streams decodes to.
//!
//! ```
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! # let folder = tempfile::tempdir()?;
//! # let path = folder.path().join("scan.xyz");
//! std::fs::write(&path, "4500000.25 5600000.5 312 255 0 0\n4500001.25 5600000.5 nan 0 255 0\n")?;
//! let input = epigraph_points::read(path.to_str().unwrap())?;
//! // Text and doubles are as precise as survey coordinates: an origin, and positions from it.
//! assert_eq!(input.points.origin.x, 4500000.25);
//! assert_eq!(input.points.colors, Some(vec![[255, 0, 0, 255]]));
//! assert_eq!(input.left_out.not_numbers, 1);
//! # Ok(())
//! # }
//! ```

mod cloud;
mod las;
mod laz;
pub mod ply;
mod scene;
mod text;

use std::{
    io::{BufRead, BufReader, Cursor, Read},
    path::Path,
};

use epigraph_files::{FileError, MOST_DATA};
use epigraph_scenes::{Scene, SceneError};
use epigraph_streams::Points;
use flate2::read::MultiGzDecoder;

use cloud::Cloud;

/// The most points of a file: some 10 GB of memory when they are encoded.
pub const MOST_POINTS: usize = 100_000_000;

/// The limit for a compressed file once it is unpacked, in bytes.
const MOST_UNPACKED: u64 = 8 << 30;

/// The endings of files with points, for messages.
pub const ENDINGS: &str = ".ply, .ply.gz, .las, .laz, .xyz, .obj, .gltf, .glb, .ron or .vts";

/// The points of a file.
#[derive(Clone, Debug, PartialEq)]
pub struct Input {
    /// The points.
    pub points: Points,
    /// Points that the file contains beside these.
    pub left_out: LeftOut,
}

/// Numbers of points that are left out, by their reasons.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct LeftOut {
    /// A coordinate is no number, or its size is more than [`epigraph_streams::MOST_COORDINATE`].
    pub not_numbers: usize,
    /// A LAS file calls the point withheld: deleted.
    pub withheld: usize,
}

/// Why points cannot be read.
#[derive(Debug, thiserror::Error)]
pub enum ReadError {
    /// The file cannot be read, or is not valid.
    #[error("{0}")]
    File(#[from] FileError),
    /// The mesh or the scene is not valid.
    #[error("{0}")]
    Scene(#[from] SceneError),
    /// There is neither a scene nor a kind of file of that name.
    #[error("{0}; point sets are read from files that end in {ENDINGS}")]
    Unknown(String),
}

/// Reads the points of a file, by its ending, or the vertices of the scene of that name:
///
/// - PLY, which may be compressed by gzip: positions, colours, normals. Vertices with faces and without normals get
///   those of the faces.
/// - LAS and LAZ: positions, colours.
/// - XYZ, text: three numbers a line, or six, of which the last three are a colour, 0 to 255.
/// - OBJ without faces: positions, and colours that follow them.
/// - VTS: the points of the leaves.
/// - OBJ with faces, glTF, scene files, and scenes by name: positions, normals, and the colours of materials.
///
/// # Errors
/// The file cannot be read, is damaged, or has no points or more than [`MOST_POINTS`].
pub fn read(name_or_path: &str) -> Result<Input, ReadError> {
    let path = Path::new(name_or_path);
    let name = name_or_path.to_lowercase();
    let bytes = || epigraph_files::bytes(path, MOST_DATA).map_err(|error| FileError::read(path, error));
    let cloud = if name.ends_with(".ply") || name.ends_with(".ply.gz") {
        ply::read(unpacked(bytes()?))
    } else if name.ends_with(".las") || name.ends_with(".laz") {
        las::read(bytes()?)
    } else if name.ends_with(".xyz") {
        text::read_xyz(unpacked(bytes()?))
    } else if name.ends_with(".obj") && !text::has_faces(&bytes()?) {
        text::read_obj(&*bytes()?)
    } else {
        let scene = Scene::load(name_or_path).map_err(|error| match error {
            SceneError::Unknown(text) => ReadError::Unknown(text),
            error => error.into(),
        });
        return Ok(Input { points: scene::points(&scene?), left_out: LeftOut::default() });
    };
    let input = cloud.and_then(Cloud::finish).map_err(|cause| FileError::read(path, cause))?;
    Ok(input)
}

/// The bytes of a file, unpacked on the way if they are compressed by gzip.
fn unpacked(bytes: Vec<u8>) -> Box<dyn BufRead> {
    if bytes.starts_with(&[0x1f, 0x8b]) {
        let unpacked = MultiGzDecoder::new(Cursor::new(bytes)).take(MOST_UNPACKED);
        Box::new(BufReader::new(unpacked))
    } else {
        Box::new(Cursor::new(bytes))
    }
}

#[cfg(test)]
mod tests;
