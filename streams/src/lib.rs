//! Vertex transformation streams: a point set as vertices and the translations that take them to its other points (Kim,
//! Lee and Varshney, "Vertex Transformation Streams").
//!
//! [`encode()`] makes a [`Model`] of [`Points`]: a binary hierarchy by 2-means. Each [`Node`] has its points on a grid of
//! 128³ cubes along their principal axes, its [`Frame`]. Points in the same cell become one; the node knows how many.
//! Their colours and normals are averaged.
//!
//! The [`Codec`] says how cells are stored. In the paper's, the translations that most often lead from point to point
//! are the node's palette, found by autocorrelation. A greedy search divides the points among [`Pool`]s: vertices,
//! translations, and a bit for each pair whose sum is a point. Each point is in one pool, once, or by itself. Bricks,
//! blocks of 4 x 4 x 4 cells with a bit for each, are a pool too: the corners moved by the same 64 translations.
//!
//! [`Node::cells`] and [`Node::positions`] decode. [`Model::write`] and [`Model::read`] are for files, `.vts`;
//! [`Reader`] reads single nodes. [`Layout`] counts bytes, the paper's and those of this crate.
//!
//! ```
//! use epigraph_files::Target;
//! use epigraph_streams::{Codec, Layout, Model, Points, Settings, encode};
//! use glam::Vec3;
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! // A wall of points, 128 by 128.
//! let wall: Vec<Vec3> = (0..128 * 128).map(|i| Vec3::new((i % 128) as f32, 0.0, (i / 128) as f32)).collect();
//! let points = Points { colors: Some(vec![[200, 180, 160, 255]; wall.len()]), ..Points::from(wall) };
//! let model = encode(&points, &Settings { levels: 1, ..Settings::default() })?;
//!
//! let root = &model.nodes()[0];
//! assert_eq!((root.positions().len(), root.merged()), (128 * 128, 0));
//! assert!(root.colors().unwrap().iter().all(|color| *color == 0xFF_A0_B4_C8));
//! // Points in a plane repeat: the paper's pools take less than a third of the bytes of the points one by one, bricks
//! // less than a fifth. The default is the smallest codec for each node.
//! let streams = encode(&points, &Settings { codec: Codec::Streams, levels: 1, ..Settings::default() })?;
//! assert!(3 * Layout::PACKED.node(&streams.nodes()[0]) < Layout::PACKED.points(128 * 128));
//! assert!(5 * Layout::PACKED.node(root) < Layout::PACKED.points(128 * 128));
//!
//! # let folder = tempfile::tempdir()?;
//! # let path = folder.path().join("wall.vts");
//! model.write(&Target::new(&path)?)?;
//! assert_eq!(Model::read(&path)?, model);
//! # Ok(())
//! # }
//! ```

mod attributes;
mod brick;
mod bytes;
mod cell;
mod codec;
mod encode;
mod file;
mod frame;
mod hierarchy;
mod kept;
mod model;
mod palette;
mod points;
mod pool;
pub mod repeats;
mod set;
#[cfg(test)]
mod testing;
#[cfg(test)]
mod tests;

pub use attributes::{
    NO_NORMAL, color_of_light, pack_color, pack_normal, unpack_color, unpack_direction, unpack_normal,
};
pub use bytes::Layout;
pub use cell::{Cell, GRID, Translation};
pub use codec::Codec;
pub use encode::{
    EncodeError, MOST_COORDINATE, MOST_LEVELS, Settings, Step, encode, encode_from, encode_watched,
};
pub use file::{Reader, VtsError};
pub use frame::Frame;
pub use kept::Kept;
pub use model::{Model, Node};
pub use points::Points;
pub use pool::{MOST_TRANSLATIONS, Pool, PoolError};
pub use set::{Place, PointSet};
