//! Parts by their shapes.

use std::{
    collections::{BTreeMap, HashMap},
    ops::ControlFlow,
    sync::OnceLock,
};

use glam::{DMat3, DVec3, Vec3};
use rayon::prelude::*;

use super::{
    Settings, Surface,
    fit::fit,
    part::{MEASURES, Part, SIZE},
    shape::{Grid, Instance, Shape},
    walk::{Match, Net, Walk},
};
use crate::{pack_normal, unpack_normal};

/// Parts that are compared with the shapes known so far at the same time.
const AT_ONCE: usize = 64;

/// A comparison may take [`Settings::work`] for each triangle, and for this many more, so that small parts can be
/// compared with several others.
const LEAST_WORK: u64 = 64;

/// A shape and its copies, the original among them.
pub(super) struct Group {
    pub(super) shape: Shape,
    pub(super) members: Vec<Member>,
}

/// A part as a copy of a shape.
pub(super) struct Member {
    /// The part by its index.
    pub(super) part: usize,
    pub(super) instance: Instance,
    /// The largest distance of a vertex from its place.
    pub(super) deviation: f64,
    /// The part's triangle for each triangle of the shape.
    pub(super) triangles: Vec<Match>,
}

/// How far measures of copies may be apart. A vertex of a copy is within the bound of one on the shape's grid, and that
/// within half of the bound of the original's; measures change by twice as much at most. The rest is for rounding.
fn slack_of(bound: f64) -> f64 {
    4.0 * bound
}

/// Parts that may have the same shape, by their indices. Those in different sets have different shapes.
pub(super) fn candidates(parts: &[Part], settings: &Settings) -> Vec<Vec<usize>> {
    let range = |part: &Part| {
        let slack = slack_of(part.bound(settings));
        (part.measures[SIZE] - slack, part.measures[SIZE] + slack)
    };
    let mut order: Vec<(u64, (f64, f64), usize)> =
        parts.iter().enumerate().map(|(index, part)| (part.key, range(part), index)).collect();
    order.par_sort_unstable_by(|a, b| a.0.cmp(&b.0).then(a.1.0.total_cmp(&b.1.0)).then(a.2.cmp(&b.2)));
    let mut sets: Vec<Vec<usize>> = Vec::new();
    let mut last = None;
    for (key, (low, high), index) in order {
        match last {
            Some((last_key, last_high)) if last_key == key && low <= last_high => {
                sets.last_mut().expect("the last part is in a set").push(index);
                last = Some((key, high.max(last_high)));
            }
            _ => {
                sets.push(vec![index]);
                last = Some((key, high));
            }
        }
    }
    sets
}

/// What all comparisons need.
pub(super) struct Grouping<'a> {
    pub(super) surface: &'a Surface<'a>,
    pub(super) parts: &'a [Part],
    pub(super) settings: &'a Settings,
    /// Called when a part has its shape.
    pub(super) done: &'a (dyn Fn() -> ControlFlow<()> + Sync),
}

/// The shapes of a set of parts.
#[derive(Default)]
struct Known<'a> {
    groups: Vec<Group>,
    /// The part that gave each group its shape, by the same index.
    originals: Vec<Original<'a>>,
    by_size: BySize,
}

struct Original<'a> {
    part: &'a Part,
    /// The positions of its vertices in the frame of the shape, on the shape's grid.
    positions: Vec<Vec3>,
    /// Where walks go and begin. Parts that are never compared do not need it.
    net: OnceLock<(Net<'a>, usize)>,
}

/// The measures of groups in the order of their sizes.
#[derive(Default)]
struct BySize(BTreeMap<(u64, usize), [f64; MEASURES]>);

impl BySize {
    fn add(&mut self, part: &Part, group: usize) {
        self.0.insert((order(part.measures[SIZE]), group), part.measures);
    }

    /// The groups with measures like those of a part. `None` if there are too many to look at.
    fn like(&self, part: &Part, slack: f64, work: &mut u64) -> Option<Vec<usize>> {
        let size = part.measures[SIZE];
        let range = (order((size - slack).max(0.0)), 0)..=(order(size + slack), usize::MAX);
        let mut like = Vec::new();
        for (&(_, group), measures) in self.0.range(range) {
            *work = work.checked_sub(1)?;
            if part.measures.iter().zip(measures).all(|(a, b)| (a - b).abs() <= slack) {
                like.push(group);
            }
        }
        Some(like)
    }
}

impl<'a> Grouping<'a> {
    /// Finds the shapes of a set of parts, and the number of parts for which the work was not enough. `None` if it was
    /// stopped.
    pub(super) fn group(&self, mut set: Vec<usize>) -> Option<(Vec<Group>, usize)> {
        // The smaller a position's numbers, the better their rounding: the first part becomes the shape.
        set.sort_unstable_by(|&a, &b| self.parts[a].extent.total_cmp(&self.parts[b].extent).then(a.cmp(&b)));
        let mut known = Known::default();
        let mut given_up = 0;
        for some in set.chunks(AT_ONCE) {
            let mut new = BySize::default();
            let first: Vec<(u64, Option<(usize, Member)>)> = some
                .par_iter()
                .map(|&index| {
                    let triangles = self.parts[index].triangles.len() as u64;
                    let mut work = self.settings.work.saturating_mul(triangles + LEAST_WORK);
                    let found = self.find(index, &known, &known.by_size, &mut work);
                    (work, found)
                })
                .collect();
            for (&index, (mut work, found)) in some.iter().zip(first) {
                match found.or_else(|| self.find(index, &known, &new, &mut work)) {
                    Some((group, member)) => known.groups[group].members.push(member),
                    None => {
                        given_up += usize::from(work == 0);
                        let (original, group) = self.original(index);
                        new.add(original.part, known.groups.len());
                        known.originals.push(original);
                        known.groups.push(group);
                    }
                }
                if (self.done)().is_break() {
                    return None;
                }
            }
            known.by_size.0.extend(new.0);
        }
        Some((known.groups, given_up))
    }

    /// Compares a part with some of the shapes. Each has its vertices from a part with coordinates that are not larger.
    fn find(&self, index: usize, known: &Known, among: &BySize, work: &mut u64) -> Option<(usize, Member)> {
        let part = &self.parts[index];
        let bound = part.bound(self.settings);
        let slack = slack_of(bound);
        let like = among.like(part, slack, work)?;
        if like.is_empty() {
            return None;
        }
        let net = Net::new(part);
        let (mut walks, mut starts) = (Vec::new(), Vec::new());
        for group in like {
            let original = &known.originals[group];
            if !part.counts_as(original.part) {
                continue;
            }
            let (original_net, seed) = original.net.get_or_init(|| {
                let net = Net::new(original.part);
                let seed = net.seed(0.5 * original.part.bound(self.settings));
                (net, seed)
            });
            let triangles = part.triangles.len() as u64;
            if *work < triangles {
                *work = 0;
                return None;
            }
            *work -= triangles;
            let walk = Walk::new(original_net, &net, *seed, slack);
            let ranked = walk.starts().into_iter().enumerate();
            starts.extend(ranked.map(|(rank, (difference, start))| (rank, difference, walks.len(), start)));
            walks.push((group, walk));
        }
        // The most promising start of each shape, then the second of each: where shapes differ in a detail, many starts
        // look right until the detail.
        starts.sort_unstable_by(|a, b| a.0.cmp(&b.0).then(a.1.total_cmp(&b.1)).then(a.2.cmp(&b.2)));
        for (_, _, walk, start) in starts {
            let (group, walk) = &mut walks[walk];
            if let Some((triangles, vertices)) = walk.go(start, work)
                && let Some(copy) = self.lay(index, &known.originals[*group].positions, triangles, vertices)
                && copy.deviation <= bound
                && self.looks_like(&known.groups[*group].shape, &copy)
            {
                return Some((*group, copy));
            }
        }
        None
    }

    /// A part that has a shape of its own.
    fn original(&self, index: usize) -> (Original<'a>, Group) {
        let part = &self.parts[index];
        let rotation = part.axes.transpose();
        let in_frame: Vec<DVec3> =
            part.positions.iter().map(|at| rotation * (at.as_dvec3() - part.center)).collect();
        // Half of the bound is left for the copies.
        let (grid, cells) = Grid::quantize(&in_frame, 0.5 * part.bound(self.settings));
        let positions: Vec<Vec3> = cells.iter().map(|&cell| grid.position(cell)).collect();
        let shape = self.shape(part, grid, &cells, rotation);
        let vertices: Vec<u32> = (0..positions.len() as u32).collect();
        let triangles: Vec<Match> = (0..part.triangles.len() as u32).map(Match::itself).collect();
        let member =
            self.lay(index, &positions, &triangles, &vertices).expect("a part can be laid on itself");
        (Original { part, positions, net: OnceLock::new() }, Group { shape, members: vec![member] })
    }

    /// The shape of a part. A vertex for each position, normal and colour, in the order of the triangles.
    fn shape(&self, part: &Part, grid: Grid, cells: &[[u32; 3]], rotation: DMat3) -> Shape {
        let Surface { normals, colors, .. } = self.surface;
        let mut shape = Shape {
            grid,
            cells: Vec::with_capacity(cells.len()),
            normals: normals.map(|_| Vec::new()),
            colors: colors.map(|_| Vec::new()),
            triangles: Vec::with_capacity(part.triangles.len()),
        };
        let mut known = HashMap::with_capacity(cells.len());
        for (corners, &source) in part.triangles.iter().zip(&part.sources) {
            let named = self.surface.triangles[source as usize];
            shape.triangles.push([0, 1, 2].map(|corner| {
                let vertex = named[corner] as usize;
                let normal = normals.map(|normals| {
                    let normal = normals[vertex].as_dvec3().normalize_or_zero();
                    pack_normal((rotation * normal).normalize_or_zero().as_vec3())
                });
                let color = colors.map(|colors| colors[vertex]);
                *known.entry((corners[corner], normal, color)).or_insert_with(|| {
                    shape.cells.push(cells[corners[corner] as usize]);
                    shape.normals.iter_mut().for_each(|all| all.extend(normal));
                    shape.colors.iter_mut().for_each(|all| all.extend(color));
                    shape.cells.len() as u32 - 1
                })
            }));
        }
        shape
    }

    /// A part as a copy, if its vertices are those of the original in this order. `None` if no transformation is
    /// finite.
    fn lay(&self, index: usize, original: &[Vec3], triangles: &[Match], vertices: &[u32]) -> Option<Member> {
        let part = &self.parts[index];
        let pairs: Vec<(DVec3, DVec3)> =
            original.iter().zip(vertices).map(|(from, &to)| (from.as_dvec3(), part.at(to))).collect();
        let (rotation, translation) = fit(&pairs);
        let instance = Instance {
            shape: 0,
            rotation: rotation.as_quat().normalize(),
            translation: translation.as_vec3(),
            material: self.surface.materials.map(|materials| materials[part.sources[0] as usize]),
        };
        let place = instance.place();
        let distance = |(&from, &to): (&Vec3, &u32)| place(from).as_dvec3().distance(part.at(to));
        let deviation = original.iter().zip(vertices).map(distance).fold(0.0, f64::max);
        let finite = instance.rotation.is_finite() && instance.translation.is_finite();
        finite.then(|| Member { part: index, instance, deviation, triangles: triangles.to_vec() })
    }

    /// Whether the colours at all corners of a copy are those of the shape, and the normals nearly.
    fn looks_like(&self, shape: &Shape, copy: &Member) -> bool {
        let sources = &self.parts[copy.part].sources;
        let turn = copy.instance.rotation.as_dquat();
        let given = self.surface;
        shape.triangles.iter().zip(&copy.triangles).all(|(corners, there)| {
            let named = given.triangles[sources[there.triangle()] as usize];
            (0..3).all(|corner| {
                let (here, there) = (corners[corner] as usize, named[there.corner(corner)] as usize);
                let same_color =
                    given.colors.zip(shape.colors()).is_none_or(|(given, own)| given[there] == own[here]);
                let same_normal = given.normals.zip(shape.normals()).is_none_or(|(given, own)| {
                    let given = given[there].as_dvec3().normalize_or_zero();
                    given.distance(turn * unpack_normal(own[here]).as_dvec3()) <= self.settings.normals
                });
                same_color && same_normal
            })
        })
    }
}

/// The bits of a number that is not negative: they have the order of the numbers.
fn order(number: f64) -> u64 {
    number.to_bits()
}
