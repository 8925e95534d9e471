//! Vertex transformation streams: a point set as vertices and the translations that take them to its other points (Kim,
//! Lee and Varshney, "Vertex Transformation Streams").
//!
//! [`encode()`] makes a [`Model`] of points: a binary hierarchy by 2-means. Each [`Node`] has its points on a grid of
//! 128³ cubes along their principal axes, its [`Frame`]. Points in the same cell become one; the node knows how many.
//! The translations that most often lead from point to point are the node's palette, found by autocorrelation. A greedy
//! search divides the points among [`Pool`]s: vertices, translations, and a bit for each pair whose sum is a point.
//! Each point is in one pool, once, or by itself.
//!
//! [`Node::cells`] and [`Node::positions`] decode. [`Model::write`] and [`Model::read`] are for files, `.vts`;
//! [`Reader`] reads single nodes. [`Layout`] counts bytes, the paper's and those of this crate.
//!
//! ```
//! use epigraph_files::Target;
//! use epigraph_streams::{Layout, Model, Settings, encode};
//! use glam::Vec3;
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! // A wall of points, 128 by 128.
//! let wall: Vec<Vec3> = (0..128 * 128).map(|i| Vec3::new((i % 128) as f32, 0.0, (i / 128) as f32)).collect();
//! let model = encode(&wall, &Settings { levels: 1, ..Settings::default() })?;
//!
//! let root = &model.nodes()[0];
//! assert_eq!((root.positions().len(), root.merged()), (128 * 128, 0));
//! // Points in a plane repeat: the pools take less than a third of the bytes of the points one by one.
//! assert!(3 * Layout::PACKED.node(root) < Layout::PACKED.points(128 * 128));
//!
//! # let folder = tempfile::tempdir()?;
//! # let path = folder.path().join("wall.vts");
//! model.write(&Target::new(&path)?)?;
//! assert_eq!(Model::read(&path)?, model);
//! # Ok(())
//! # }
//! ```

mod bytes;
mod cell;
mod encode;
mod file;
mod frame;
mod hierarchy;
mod model;
mod palette;
mod pool;
#[cfg(test)]
mod testing;
#[cfg(test)]
mod tests;

pub use bytes::Layout;
pub use cell::{Cell, GRID, Translation};
pub use encode::{EncodeError, Settings, encode, encode_watched};
pub use file::{Reader, VtsError};
pub use frame::Frame;
pub use model::{Model, Node};
pub use pool::{MOST_TRANSLATIONS, Pool, PoolError};
