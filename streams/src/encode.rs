//! From points to a model.

use std::{
    ops::{ControlFlow, RangeInclusive},
    sync::atomic::{AtomicUsize, Ordering},
};

use glam::Vec3;
use rayon::prelude::*;

use crate::{
    cell::{Cell, Translation},
    frame::Frame,
    hierarchy::hierarchy,
    model::{Model, Node},
    palette::{Counts, is_small},
    pool::{MOST_TRANSLATIONS, pools},
};

/// Coordinates may not be larger: squares of sums of them must not overflow.
const MOST_COORDINATE: f32 = 1e30;

/// How points are encoded. The defaults are the paper's, but for 96 translations in place of 88.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Settings {
    /// Levels of the hierarchy, 1 to 24.
    pub levels: u32,
    /// Pools of each node, 0 to 64. Without pools, all points are stored one by one.
    pub pools: usize,
    /// The most translations of a pool, 1 to 128. The paper's tags have 88 bits; words of 32 hold 96 in as many bytes.
    pub translations: usize,
    /// The most frequent translations, among which the pools find theirs, 1 to 65,536.
    pub palette: usize,
    /// A pool contains a vertex that covers more new points than this part of the pool's translations, 0 to 1.
    pub threshold: f64,
}

impl Default for Settings {
    fn default() -> Self {
        Self { levels: 8, pools: 2, translations: 96, palette: 256, threshold: 0.25 }
    }
}

/// Why points cannot be encoded.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum EncodeError {
    /// There are no points.
    #[error("there are no points to encode")]
    Empty,
    /// There are more points than the file format counts.
    #[error("{0} points are more than the {most} that a model can hold", most = u32::MAX)]
    TooMany(usize),
    /// A coordinate is not finite, or too large.
    #[error("point {index} is at {point}; coordinates must be numbers of at most {MOST_COORDINATE:e}")]
    Coordinate {
        /// The point by its index.
        index: usize,
        /// The point.
        point: Vec3,
    },
    /// A setting is out of its range.
    #[error("{name} must be {range}, not {value}")]
    Setting {
        /// The field of [`Settings`].
        name: &'static str,
        /// The values that it can have.
        range: String,
        /// The value that it has.
        value: String,
    },
    /// The caller asked to stop.
    #[error("encoding was stopped")]
    Stopped,
}

/// Encodes points. The same points in the same order give the same model on all machines, with any number of cores.
///
/// # Errors
/// There are no points or too many, a coordinate is no finite number, or a setting is out of its range.
pub fn encode(points: &[Vec3], settings: &Settings) -> Result<Model, EncodeError> {
    encode_watched(points, settings, &|_| ControlFlow::Continue(()))
}

/// As [`encode`]; calls `watch` with the part of the nodes that is done, 0 to 1, whenever a node is done, and stops if
/// it returns [`ControlFlow::Break`].
///
/// # Errors
/// As [`encode`]; [`EncodeError::Stopped`].
pub fn encode_watched(
    points: &[Vec3],
    settings: &Settings,
    watch: &(dyn Fn(f64) -> ControlFlow<()> + Sync),
) -> Result<Model, EncodeError> {
    check(points, settings)?;
    let mut points = points.to_vec();
    let branches = hierarchy(&mut points, settings.levels);
    let grids: Vec<(Frame, Vec<Cell>)> =
        branches.par_iter().map(|branch| Frame::quantize(&points[branch.points.clone()])).collect();

    let done = AtomicUsize::new(0);
    let node = |index: usize| {
        let (frame, cells) = &grids[index];
        let palette = Counts::new(cells).most_frequent(settings.palette);
        let palette: Vec<Translation> = palette.into_iter().map(|(by, _)| by).collect();
        let (pools, singles) = pools(cells, &palette, settings);
        let branch = &branches[index];
        let points = branch.points.len() as u32;
        let done = done.fetch_add(1, Ordering::Relaxed) + 1;
        match watch(done as f64 / branches.len() as f64) {
            ControlFlow::Continue(()) => {
                Ok((index, Node { frame: *frame, points, first_child: branch.first_child, pools, singles }))
            }
            ControlFlow::Break(()) => Err(EncodeError::Stopped),
        }
    };
    // A transform uses all cores and much memory, so these nodes come one after another.
    let (small, large): (Vec<usize>, Vec<usize>) =
        (0..branches.len()).partition(|&index| is_small(&grids[index].1));
    let mut nodes = large.into_iter().map(node).collect::<Result<Vec<_>, _>>()?;
    nodes.extend(small.into_par_iter().map(node).collect::<Result<Vec<_>, _>>()?);
    nodes.sort_by_key(|(index, _)| *index);
    Ok(Model { nodes: nodes.into_iter().map(|(_, node)| node).collect() })
}

fn check(points: &[Vec3], settings: &Settings) -> Result<(), EncodeError> {
    in_range("levels", settings.levels, 1..=24)?;
    in_range("pools", settings.pools, 0..=64)?;
    in_range("translations", settings.translations, 1..=MOST_TRANSLATIONS)?;
    in_range("palette", settings.palette, 1..=1 << 16)?;
    in_range("threshold", settings.threshold, 0.0..=1.0)?;
    if points.is_empty() {
        return Err(EncodeError::Empty);
    }
    if u32::try_from(points.len()).is_err() {
        return Err(EncodeError::TooMany(points.len()));
    }
    let large = |point: &Vec3| !(point.is_finite() && point.abs().max_element() <= MOST_COORDINATE);
    match points.iter().position(large) {
        Some(index) => Err(EncodeError::Coordinate { index, point: points[index] }),
        None => Ok(()),
    }
}

fn in_range<T>(name: &'static str, value: T, range: RangeInclusive<T>) -> Result<(), EncodeError>
where
    T: PartialOrd + ToString,
{
    if range.contains(&value) {
        return Ok(());
    }
    let range = format!("{} to {}", range.start().to_string(), range.end().to_string());
    Err(EncodeError::Setting { name, range, value: value.to_string() })
}
