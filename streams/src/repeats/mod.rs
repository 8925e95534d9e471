//! Parts that repeat: a surface as shapes, and where each of them is.
//!
//! [`find`] takes a triangle mesh whose parts lie in one coordinate system, without names: chain links, chairs, bolts,
//! books. It finds the connected parts, and which of them are the same but for a rotation and a translation. Every
//! vertex and every triangle is compared: a part is a copy only if its triangles are connected as the shape's are, and
//! none of its vertices is farther from its place than a bound, [`Settings::tolerance`]. A mirrored part has a shape of
//! its own, as it does not become the other by a rotation.
//!
//! [`Repeats`] holds shapes and instances. [`Repeats::write`] and [`Repeats::read`] are for files, `.vts`;
//! [`Repeats::write_glb`] makes a glTF file with `EXT_mesh_gpu_instancing`.
//!
//! How copies are found: parts with equal numbers of triangles, connected alike and of about the same size are
//! candidates. Two walks over the triangles of both parts, side by side, say which vertex is which. They begin at a
//! triangle that has few others like it, once for each triangle of the copy that is like it, so that symmetric parts,
//! for which principal axes say nothing, are found at the first or second try. The rigid transformation that fits all
//! vertices best is then checked vertex by vertex. Work is bounded: [`Report::given_up`] counts the parts for which it
//! did not suffice.
//!
//! ```
//! use epigraph_streams::repeats::{Settings, Surface, find};
//! use glam::{Quat, Vec3};
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! // Two wedges in one mesh, one of them turned.
//! let wedge = [[0.0, 0.0, 0.0], [4.0, 0.0, 0.0], [0.0, 2.0, 0.0], [0.0, 0.0, 1.0]].map(Vec3::from);
//! let copy = wedge.map(|at| Quat::from_rotation_y(1.0) * at + Vec3::new(90.0, 0.0, 7.0));
//! let faces = [[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]];
//! let triangles = [faces, faces.map(|corners| corners.map(|vertex| vertex + 4))].concat();
//! let surface = Surface { positions: &[wedge, copy].concat(), triangles: &triangles, ..Surface::default() };
//!
//! let found = find(&surface, &Settings::default())?;
//! assert_eq!((found.report.parts, found.repeats.shapes().len()), (2, 1));
//! assert!(found.repeats.deviation() < 1e-4);
//! # Ok(())
//! # }
//! ```

mod bits;
mod block;
mod fit;
mod glb;
mod group;
mod part;
mod shape;
mod split;
#[cfg(test)]
mod testing;
#[cfg(test)]
mod tests;
mod walk;

use std::{
    ops::ControlFlow,
    sync::atomic::{AtomicUsize, Ordering},
};

use glam::{DVec3, Vec3};
use rayon::prelude::*;

pub use block::{BlockError, Bytes};
pub use glb::{GlbError, GlbMaterial};
pub use shape::{Instance, Repeats, Shape};

use group::{Group, Grouping, candidates};
use part::Part;
use split::Split;

/// Coordinates may not be larger: squares of sums of them must not overflow.
const MOST_COORDINATE: f32 = 1e30;

/// Sides of triangles have numbers of 32 bits.
const MOST_TRIANGLES: usize = u32::MAX as usize / 3;

/// A triangle mesh: all parts in one coordinate system.
#[derive(Clone, Copy, Debug, Default)]
pub struct Surface<'a> {
    /// Vertices. Those at the same position are one corner of the surface.
    pub positions: &'a [Vec3],
    /// The vertices of each triangle, counter-clockwise seen from the front.
    pub triangles: &'a [[u32; 3]],
    /// The direction of the surface at each vertex, of any length; zero where there is none.
    pub normals: Option<&'a [Vec3]>,
    /// The colour of each vertex: sRGB, and alpha.
    pub colors: Option<&'a [[u8; 4]]>,
    /// The material of each triangle, by a number. A part ends where the material changes.
    pub materials: Option<&'a [u32]>,
    /// What to add to all positions: numbers.
    pub origin: DVec3,
}

/// How far a vertex of a copy may be from its place, beside what rounding to single precision takes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Tolerance {
    /// As a share of the part's radius, the largest distance of its vertices from their centre. 0 to 1.
    Relative(f64),
    /// In the units of the positions.
    Distance(f64),
}

/// How parts are compared.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Settings {
    /// How far a vertex may be from its place; 1/100,000 of the part's radius by default. The bound of a part is
    /// this, and 6/2²³ of the largest coordinate for rounding: of the positions given, of those computed, and of the
    /// transformation.
    pub tolerance: Tolerance,
    /// How far the end of a unit normal may be from its place, 0 to 2: about the angle in radians.
    pub normals: f64,
    /// How many triangles are looked at for each triangle of a part, 1 to 2³², before the part is given up and gets a
    /// shape of its own. The parts of real models need 2 to 10; symmetric ones that differ in a detail need more.
    pub work: u64,
}

impl Default for Settings {
    fn default() -> Self {
        Self { tolerance: Tolerance::Relative(1e-5), normals: 0.01, work: 64 }
    }
}

impl Settings {
    /// How far a vertex may be from its place, in a part of this radius with coordinates up to `extent`.
    pub fn bound(&self, radius: f64, extent: f64) -> f64 {
        let tolerance = match self.tolerance {
            Tolerance::Relative(share) => share * radius,
            Tolerance::Distance(distance) => distance,
        };
        tolerance + 6.0 * f64::from(f32::EPSILON) * extent + f64::from(f32::MIN_POSITIVE)
    }

    fn check(&self) -> Result<(), RepeatsError> {
        let (tolerance, most) = match self.tolerance {
            Tolerance::Relative(share) => (share, 1.0),
            Tolerance::Distance(distance) => (distance, f64::from(MOST_COORDINATE)),
        };
        let wrong = |name, range, value| Err(RepeatsError::Setting { name, range, value });
        if !(0.0..=most).contains(&tolerance) {
            return wrong("tolerance", format!("0 to {most:e}"), tolerance.to_string());
        }
        if !(0.0..=2.0).contains(&self.normals) {
            return wrong("normals", "0 to 2".into(), self.normals.to_string());
        }
        if !(1..=1 << 32).contains(&self.work) {
            return wrong("work", format!("1 to {}", 1_u64 << 32), self.work.to_string());
        }
        Ok(())
    }
}

/// Why a surface has no parts that could be compared.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum RepeatsError {
    /// There is no triangle with three different corners.
    #[error("the mesh has no triangles with three different corners")]
    Empty,
    /// There are too many vertices or triangles.
    #[error("{count} {what} are more than the {most} that can be searched for repeats")]
    TooMany {
        /// Vertices or triangles.
        what: &'static str,
        /// How many there are.
        count: usize,
        /// How many there can be.
        most: usize,
    },
    /// A coordinate is not finite, or too large.
    #[error("vertex {vertex} is at {at}; coordinates must be numbers of at most {MOST_COORDINATE:e}")]
    Coordinate {
        /// The vertex by its index.
        vertex: usize,
        /// Where it is.
        at: Vec3,
    },
    /// A triangle names a vertex that does not exist.
    #[error("triangle {triangle} has vertex {vertex} as a corner, but there are only {vertices} vertices")]
    Corner {
        /// The triangle by its index.
        triangle: usize,
        /// The vertex that it names.
        vertex: u32,
        /// The number of vertices.
        vertices: usize,
    },
    /// There are not as many normals, colours or materials as vertices or triangles.
    #[error("there are {found} {what}, not one for each of {expected} {of}")]
    Count {
        /// Normals, colours or materials.
        what: &'static str,
        /// How many there are.
        found: usize,
        /// Vertices or triangles.
        of: &'static str,
        /// How many there are of these.
        expected: usize,
    },
    /// A normal is not finite.
    #[error("the normal of vertex {vertex} is {normal}; it must be made of finite numbers")]
    Normal {
        /// The vertex by its index.
        vertex: usize,
        /// Its normal.
        normal: Vec3,
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
    #[error("the search for repeats was stopped")]
    Stopped,
}

/// A vertex or a triangle of an instance.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Place {
    /// The instance by its index.
    pub instance: u32,
    /// The vertex or triangle by its index in the instance's shape.
    pub index: u32,
}

/// What a search found.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Report {
    /// Connected parts, which are the instances.
    pub parts: usize,
    /// Different parts.
    pub shapes: usize,
    /// Parts for which [`Settings::work`] did not suffice; each has a shape of its own.
    pub given_up: usize,
    /// Triangles without three different corners. They are not stored.
    pub degenerate: usize,
    /// Vertices that are no corner of a triangle that is stored. They are not stored either.
    pub unused: usize,
    /// The largest distance of a vertex from its place.
    pub deviation: f64,
    /// The largest distance that was allowed to a vertex of some part.
    pub bound: f64,
}

impl Report {
    /// Parts that are copies of others.
    pub fn copies(&self) -> usize {
        self.parts - self.shapes
    }

    /// Parts for each shape.
    pub fn ratio(&self) -> f64 {
        self.parts as f64 / self.shapes as f64
    }
}

/// A surface as shapes and instances, and what became of its vertices and triangles.
#[derive(Clone, Debug, PartialEq)]
pub struct Found {
    /// Shapes and instances.
    pub repeats: Repeats,
    /// Numbers.
    pub report: Report,
    /// Where each vertex of the surface is. One that several parts share is in the first of them; `None` if it is not
    /// stored.
    pub vertices: Vec<Option<Place>>,
    /// Where each triangle of the surface is; it may begin at another corner there. `None` if it is not stored.
    pub triangles: Vec<Option<Place>>,
}

/// Finds the parts of a surface that repeat. The same surface gives the same result on all machines, with any number
/// of cores.
///
/// Time grows a little faster than the number of triangles, and with the number of shapes that are much alike. Memory
/// is about 150 bytes for each triangle, and a kilobyte for each part.
///
/// # Errors
/// The surface has no triangles or too many, numbers that are not finite, or vertices that do not exist; or a setting
/// is out of its range.
pub fn find(surface: &Surface, settings: &Settings) -> Result<Found, RepeatsError> {
    find_watched(surface, settings, &|_| ControlFlow::Continue(()))
}

/// As [`find`]; calls `watch` with the share of the parts that have been compared, 0 to 1, and stops if it returns
/// [`ControlFlow::Break`].
///
/// # Errors
/// As [`find`]; [`RepeatsError::Stopped`].
pub fn find_watched(
    surface: &Surface,
    settings: &Settings,
    watch: &(dyn Fn(f64) -> ControlFlow<()> + Sync),
) -> Result<Found, RepeatsError> {
    settings.check()?;
    check(surface)?;
    let go_on = || if watch(0.0).is_break() { Err(RepeatsError::Stopped) } else { Ok(()) };
    go_on()?;
    let Split { welded, parts, degenerate } = Split::new(surface);
    if parts.is_empty() {
        return Err(RepeatsError::Empty);
    }
    go_on()?;
    let parts: Vec<Part> = parts.into_par_iter().map(|part| Part::new(surface, &welded, part)).collect();
    go_on()?;

    let count = AtomicUsize::new(0);
    let done = || watch((count.fetch_add(1, Ordering::Relaxed) + 1) as f64 / parts.len() as f64);
    let grouping = Grouping { surface, parts: &parts, settings, done: &done };
    let sets = candidates(&parts, settings);
    let grouped: Option<Vec<(Vec<Group>, usize)>> =
        sets.into_par_iter().map(|set| grouping.group(set)).collect();
    let grouped = grouped.ok_or(RepeatsError::Stopped)?;
    let given_up = grouped.iter().map(|(_, given_up)| given_up).sum();
    let groups = grouped.into_iter().flat_map(|(groups, _)| groups).collect();
    let mut found = assemble(surface, &parts, groups);
    found.report.bound = parts.iter().map(|part| part.bound(settings)).fold(0.0, f64::max);
    found.report.given_up = given_up;
    found.report.degenerate = degenerate;
    Ok(found)
}

/// Puts groups in the order of the surface, and notes where its vertices and triangles went.
fn assemble(surface: &Surface, parts: &[Part], mut groups: Vec<Group>) -> Found {
    groups.iter_mut().for_each(|group| group.members.sort_unstable_by_key(|member| member.part));
    groups.sort_unstable_by_key(|group| group.members[0].part);
    let mut vertices: Vec<Option<Place>> = vec![None; surface.positions.len()];
    let mut triangles: Vec<Option<Place>> = vec![None; surface.triangles.len()];
    let (mut shapes, mut instances) = (Vec::with_capacity(groups.len()), Vec::with_capacity(parts.len()));
    let mut deviation = 0.0_f64;
    for Group { shape, members } in groups {
        for member in members {
            let instance = instances.len() as u32;
            let sources = &parts[member.part].sources;
            for (index, (corners, there)) in (0..).zip(shape.triangles.iter().zip(&member.triangles)) {
                let source = sources[there.triangle()] as usize;
                triangles[source] = Some(Place { instance, index });
                for (corner, &index) in corners.iter().enumerate() {
                    let vertex = surface.triangles[source][there.corner(corner)];
                    vertices[vertex as usize].get_or_insert(Place { instance, index });
                }
            }
            instances.push(Instance { shape: shapes.len() as u32, ..member.instance });
            deviation = deviation.max(member.deviation);
        }
        shapes.push(shape);
    }
    let report = Report {
        parts: parts.len(),
        shapes: shapes.len(),
        given_up: 0,
        degenerate: 0,
        unused: vertices.iter().filter(|place| place.is_none()).count(),
        deviation,
        bound: 0.0,
    };
    Found {
        repeats: Repeats { shapes, instances, deviation: not_below(deviation), origin: surface.origin },
        report,
        vertices,
        triangles,
    }
}

/// The least number in single precision that is not below another.
fn not_below(number: f64) -> f32 {
    let single = number as f32;
    if f64::from(single) < number { single.next_up() } else { single }
}

fn check(surface: &Surface) -> Result<(), RepeatsError> {
    let Surface { positions, triangles, normals, colors, materials, origin: _ } = *surface;
    for (what, count, most) in
        [("vertices", positions.len(), u32::MAX as usize), ("triangles", triangles.len(), MOST_TRIANGLES)]
    {
        if count > most {
            return Err(RepeatsError::TooMany { what, count, most });
        }
    }
    for (what, found, of, expected) in [
        ("normals", normals.map(<[_]>::len), "vertices", positions.len()),
        ("colours", colors.map(<[_]>::len), "vertices", positions.len()),
        ("materials", materials.map(<[_]>::len), "triangles", triangles.len()),
    ] {
        if let Some(found) = found.filter(|&found| found != expected) {
            return Err(RepeatsError::Count { what, found, of, expected });
        }
    }
    let large = |at: &Vec3| !(at.is_finite() && at.abs().max_element() <= MOST_COORDINATE);
    if let Some(vertex) = positions.iter().position(large) {
        return Err(RepeatsError::Coordinate { vertex, at: positions[vertex] });
    }
    if let Some(vertex) = normals.and_then(|normals| normals.iter().position(|normal| !normal.is_finite())) {
        return Err(RepeatsError::Normal { vertex, normal: normals.unwrap_or_default()[vertex] });
    }
    let vertices = positions.len();
    for (triangle, corners) in triangles.iter().enumerate() {
        if let Some(&vertex) = corners.iter().find(|&&vertex| vertex as usize >= vertices) {
            return Err(RepeatsError::Corner { triangle, vertex, vertices });
        }
    }
    Ok(())
}
