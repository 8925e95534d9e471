//! From points to a model.

use std::{
    ops::{ControlFlow, RangeInclusive},
    sync::atomic::{AtomicBool, AtomicUsize, Ordering},
};

use glam::{DVec3, Vec3};
use rayon::prelude::*;

use crate::{
    attributes::Attributes,
    cell::{Cell, Cells},
    codec::Codec,
    frame::Frame,
    hierarchy::{Branch, hierarchy},
    kept::{Kept, record},
    model::{Model, Node},
    palette::is_small,
    points::{Point, Points},
    pool::MOST_TRANSLATIONS,
};

/// Coordinates may not be larger: squares of sums of them must not overflow.
pub const MOST_COORDINATE: f32 = 1e30;

/// The most levels of a hierarchy.
pub const MOST_LEVELS: u32 = 24;

/// How points are encoded. The defaults are the smallest codec, and for its pools the paper's numbers, but for 96
/// translations in place of 88.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Settings {
    /// How the cells of a node are stored.
    pub codec: Codec,
    /// Levels of the hierarchy, 1 to [`MOST_LEVELS`].
    pub levels: u32,
    /// Pools of each node, 0 to 64, for [`Codec::Streams`] and [`Codec::Best`], as are the following.
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
        Self { codec: Codec::Best, levels: 8, pools: 2, translations: 96, palette: 256, threshold: 0.25 }
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
    /// The origin is not finite.
    #[error("the origin is at {0}; coordinates must be numbers")]
    Origin(DVec3),
    /// There is not one colour or normal for each point.
    #[error("{points} points have {found} {name}")]
    Attributes {
        /// The field of [`Points`].
        name: &'static str,
        /// The number of points.
        points: usize,
        /// The number of colours or normals.
        found: usize,
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

/// A step of encoding.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Step {
    /// The points are divided among nodes.
    Divide,
    /// The nodes' cells are stored.
    Store,
}

/// Encodes points. The same points in the same order give the same model on all machines, with any number of cores.
///
/// # Errors
/// There are no points or too many, a coordinate is no finite number, colours or normals do not fit the points, or a
/// setting is out of its range.
pub fn encode(points: &Points, settings: &Settings) -> Result<Model, EncodeError> {
    encode_watched(points, settings, &|_, _| ControlFlow::Continue(()))
}

/// As [`encode`]; calls `watch` with the part of a step that is done, 0 to 1, many times on all cores, and stops if it
/// returns [`ControlFlow::Break`].
///
/// # Errors
/// As [`encode`]; [`EncodeError::Stopped`].
pub fn encode_watched(
    given: &Points,
    settings: &Settings,
    watch: &(dyn Fn(Step, f64) -> ControlFlow<()> + Sync),
) -> Result<Model, EncodeError> {
    encode_from(given, settings, watch, &Kept::default(), &|_| ())
}

/// As [`encode_watched`], from what an earlier run of the same points and settings has kept. Calls `keep` on all cores
/// with bytes for each further node that is done; after [`Kept::header`] and in any order, they are what [`Kept::read`]
/// reads. The model is the same as that of one run.
///
/// # Errors
/// As [`encode_watched`].
pub fn encode_from(
    given: &Points,
    settings: &Settings,
    watch: &(dyn Fn(Step, f64) -> ControlFlow<()> + Sync),
    kept: &Kept,
    keep: &(dyn Fn(&[u8]) + Sync),
) -> Result<Model, EncodeError> {
    check(given, settings)?;
    let mut points = Point::all(&given.positions);
    // Each level divides all points.
    let dividing = Watch::new(Step::Divide, points.len() * settings.levels as usize, watch);
    let branches = hierarchy(&mut points, settings.levels, &dividing);
    dividing.check()?;
    let storing = Watch::new(Step::Store, 2 * branches.len(), watch);
    let grid = |branch: &Branch| {
        storing.check()?;
        let grid = Grid::new(given, &points[branch.points.clone()]);
        storing.done(1);
        Ok(grid)
    };
    let grids = branches.par_iter().map(grid).collect::<Result<Vec<_>, _>>()?;

    let node = |index: usize| {
        storing.check()?;
        let (grid, branch) = (&grids[index], &branches[index]);
        let (pools, singles) = kept.division(index, &grid.cells).unwrap_or_else(|| {
            let (pools, singles) = settings.codec.divide(&grid.cells, settings);
            keep(&record(index, &pools, &singles));
            (pools, singles)
        });
        let mut node = Node {
            frame: grid.frame,
            points: branch.points.len() as u32,
            first_child: branch.first_child,
            pools,
            singles,
            attributes: Attributes::default(),
        };
        node.attributes = grid.attributes_of(&node);
        storing.done(1);
        Ok((index, node))
    };
    // A transform uses all cores and much memory, so these nodes come one after another.
    let (small, large): (Vec<usize>, Vec<usize>) =
        (0..branches.len()).partition(|&index| !settings.codec.searches() || is_small(&grids[index].cells));
    let mut nodes = large.into_iter().map(node).collect::<Result<Vec<_>, _>>()?;
    nodes.extend(small.into_par_iter().map(node).collect::<Result<Vec<_>, _>>()?);
    storing.check()?;
    nodes.sort_by_key(|(index, _)| *index);
    Ok(Model { origin: given.origin, nodes: nodes.into_iter().map(|(_, node)| node).collect() })
}

/// Tells the caller how much of a step is done, and whether to go on.
pub(crate) struct Watch<'a> {
    step: Step,
    all: usize,
    done: AtomicUsize,
    stopped: AtomicBool,
    tell: &'a (dyn Fn(Step, f64) -> ControlFlow<()> + Sync),
}

impl<'a> Watch<'a> {
    pub(crate) fn new(
        step: Step,
        all: usize,
        tell: &'a (dyn Fn(Step, f64) -> ControlFlow<()> + Sync),
    ) -> Self {
        Self { step, all, done: AtomicUsize::new(0), stopped: AtomicBool::new(false), tell }
    }

    /// More of the step is done.
    pub(crate) fn done(&self, more: usize) {
        let done = more + self.done.fetch_add(more, Ordering::Relaxed);
        if (self.tell)(self.step, done as f64 / self.all as f64).is_break() {
            self.stopped.store(true, Ordering::Relaxed);
        }
    }

    /// Whether the caller has asked to stop; asks once more.
    pub(crate) fn is_stopped(&self) -> bool {
        self.done(0);
        self.stopped.load(Ordering::Relaxed)
    }

    fn check(&self) -> Result<(), EncodeError> {
        if self.is_stopped() { Err(EncodeError::Stopped) } else { Ok(()) }
    }
}

/// The points of a node on its grid.
struct Grid {
    frame: Frame,
    /// In their order.
    cells: Vec<Cell>,
    /// In the order of the cells.
    attributes: Attributes,
}

impl Grid {
    fn new(given: &Points, points: &[Point]) -> Self {
        let (frame, set) = Frame::quantize(points);
        let (count, rank) = set.ranks();
        let cell_of = frame.cell_of();
        let index_of = |point: &Point| rank(Cells::place(cell_of(point.at)));
        let attributes = Attributes::means(given, points, count, index_of);
        Self { frame, cells: set.in_order(), attributes }
    }

    /// The attributes in the order of a node's cells, which are those of the grid.
    fn attributes_of(&self, node: &Node) -> Attributes {
        if self.attributes == Attributes::default() {
            return Attributes::default();
        }
        let index = |cell: &Cell| self.cells.binary_search(cell).expect("the node has the grid's cells");
        self.attributes.reordered(&node.cells().iter().map(index).collect::<Vec<_>>())
    }
}

fn check(points: &Points, settings: &Settings) -> Result<(), EncodeError> {
    in_range("levels", settings.levels, 1..=MOST_LEVELS)?;
    in_range("pools", settings.pools, 0..=64)?;
    in_range("translations", settings.translations, 1..=MOST_TRANSLATIONS)?;
    in_range("palette", settings.palette, 1..=1 << 16)?;
    in_range("threshold", settings.threshold, 0.0..=1.0)?;
    let Points { origin, positions: points, colors, normals } = points;
    if points.is_empty() {
        return Err(EncodeError::Empty);
    }
    if u32::try_from(points.len()).is_err() {
        return Err(EncodeError::TooMany(points.len()));
    }
    let counts = [("colors", colors.as_ref().map(Vec::len)), ("normals", normals.as_ref().map(Vec::len))];
    for (name, found) in counts {
        if let Some(found) = found.filter(|&found| found != points.len()) {
            return Err(EncodeError::Attributes { name, points: points.len(), found });
        }
    }
    if !origin.is_finite() {
        return Err(EncodeError::Origin(*origin));
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
