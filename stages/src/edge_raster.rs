//! Marks where edges cross the sides of pixels, to an eighth of a pixel (`algorithms.md` section 2.2).
//!
//! A side of a pixel has eight slots. `mask` holds for each pixel the slots of its left side, from k/8 to (k+1)/8 of a
//! pixel from the top, in bits 0 to 7, and those of its top side, from the left, in bits 8 to 15; the right and bottom
//! sides are the left and top sides of the neighbours, so the image has one more column and row.
//!
//! With `middle`, bits 16 to 23 hold the slots of the vertical line through the pixel's middle, from the top, and bits
//! 24 to 31 those of the horizontal one, from the left. The rule is that of a grid of half pixels, with four slots to
//! the side of each quarter of a pixel.
//!
//! **Exactness.** The ends of a segment are rounded to 1/256 of a pixel; all arithmetic after that is in integers, so
//! that both sides of the program agree and edges that share a vertex fit together. Vertices and edges exactly on lines
//! of the pixel grid are treated as if everything were shifted to the right by an infinitesimal distance and down by an
//! infinitely smaller one. Closed polygons therefore cross the perimeter of every pixel an even number of times, and a
//! line crosses it twice or not at all, even one through the pixels' corners or along their sides.
//!
//! **Clipping.** Before rounding, a segment is clipped at the near plane and, to bound the integers, at a square of
//! 65,535 pixels around the middle of the image. Both are outside the image, so no crossing in the image is lost or
//! gained. A clipped end is off the line by less than 1/100 of a pixel, or 2^-24 of the segment's length in pixels if that
//! is more, and by less still at the image; ends that are not clipped keep their coordinates.
//!
//! **Penumbrae.** The boundaries of a soft shadow are edges only where its penumbra is narrow on the screen; its width
//! is computed as if it were perpendicular to the view.
//!
//! **Depth.** An edge is hidden where it is behind the filtered depth of the pixels on both sides of the crossing; 1 /
//! z is interpolated linearly along the segment on the screen. A middle line has its own pixel on both sides; with
//! `Either` the pixels next to it count too, so that an edge that shows at a side of the pixel continues within it.
//!
//! **Merging.** Two edges a slot apart, such as a crease and the boundary of a shadow along it, separate nothing
//! visible, yet they make a pixel complex. With `merge`, a run of crossed slots on one side counts as its first. The
//! two pixels at that side see the same crossings, so regions are joined consistently.

use std::{
    cell::Ref,
    sync::{
        Mutex, PoisonError,
        atomic::{AtomicU32, Ordering::Relaxed},
    },
};

use epigraph_core::{
    CpuContext, Extent, Finding, In, Io, Meaning, Out, Pass, Shape, Site, Stage, Threads, View, choice,
    constants, item, params, scratch, texel,
};
use glam::Vec3;
use rayon::prelude::*;

use crate::{
    column,
    meaning::{self, COUNT, CROSSINGS, DEPTH, TURN},
    shared::segments::{Segment, penumbra_width},
};

#[path = "explain/edge_raster.rs"]
mod explain;

constants! {
    /// Units of the fixed point in a pixel.
    const PIXEL: i32 = 256;
    /// The binary logarithm of [`PIXEL`].
    const PIXEL_SHIFT: u32 = 8;
    /// The binary logarithm of an eighth of a pixel in units.
    const SLOT_SHIFT: u32 = 5;
    /// Size in pixels of the space in which segments are drawn: coordinates differ by less than 2^24 units, so that 256
    /// times a difference fits into 32 bits and a product of two into 48.
    const SPAN: f32 = 65535.0;
    /// Metres beyond which a coordinate counts as no number.
    const LIMIT: f32 = 1e20;
    /// Workgroups that draw segments with many crossings on the GPU.
    const LONG_GROUPS: u32 = 256;
    /// Set in `vertex` if the pixel has a vertex.
    pub const VERTEX: u32 = 0x10000;
}

/// Maximum number of segments with many crossings; each of the rest is drawn by one thread.
const LONG_SEGMENTS: u32 = 65536;

/// Segments per parallel task on the CPU.
const CHUNK: usize = 16;

choice! {
    /// How the GPU finds the pixels that a segment crosses.
    pub enum Method {
        /// One thread per segment processes its crossings, or a workgroup if there are many.
        Compute,
        /// The rasteriser draws segments as lines two pixels wide, and each pixel marks its own sides: the papers' way.
        Lines,
    }
}

choice! {
    /// Which of the two pixels beside a crossing decide whether the edge shows there.
    pub enum DepthTest {
        /// It shows if it does so at either pixel.
        Either,
        /// The one whose left or top side is crossed, or the other if that one is outside the image: the papers' rule.
        Owner,
        /// It shows if it does so at both pixels.
        Both,
        /// Every edge shows.
        Off,
    }
}

params! {
    /// Parameters of [`EdgeRaster`].
    pub struct EdgeRasterParams {
        /// How the GPU finds the pixels that a segment crosses; the CPU has a single method, and the result is the
        /// same.
        method: Method = Method::Compute;
        /// Which of the two pixels beside a crossing decide whether the edge shows there.
        depth_test: DepthTest = DepthTest::Either;
        /// The boundaries of a penumbra count as edges where it is narrower than this on the screen: a wider one is no
        /// step in the image (`algorithms.md` section 11.2).
        max_penumbra: f32 = 2.0, in 0.0..=1e6, unit "pixels";
        /// Also mark the crossings with the lines through the pixels' middles, in bits 16 to 31: for `subdivide`.
        middle: bool = false;
        /// Crossings in neighbouring slots of a side count as one, in the first of these slots. Closed outlines may
        /// then cross a perimeter an odd number of times.
        merge: bool = false;
    }
}

item! {
    /// The visible part of a segment: two points in the image in 1/256 pixel, and 1 / z there.
    pub struct Snapped {
        /// From the left edge.
        ax: i32,
        /// From the top edge.
        ay: i32,
        /// From the left edge, of the other end.
        bx: i32,
        /// From the top edge, of the other end.
        by: i32,
        /// One over the distance along the axis, 1/metres.
        inverse_a: f32,
        /// The same of the other end.
        inverse_b: f32,
        /// Width of the penumbra whose boundary the segment is, in pixels at a distance of 1 metre.
        penumbra: f32,
    }
}

/// See the module.
pub struct EdgeRaster {
    silhouettes: Option<List>,
    shadows: Option<List>,
    filtered: In<f32>,
    mask: Out<u32>,
    vertex: Out<u32>,
    /// Mask and vertices while they are being drawn: threads change them in any order.
    drawn: Mutex<[Vec<AtomicU32>; 2]>,
}

/// A list of segments and its count; without a count, the whole list is used.
struct List {
    names: &'static Names,
    segments: In<Segment>,
    count: Option<In<u32>>,
}

/// What differs between the lists: meaning, ports, defines and entry points.
struct Names {
    meaning: Meaning,
    segments: &'static str,
    count: &'static str,
    define: &'static str,
    define_count: &'static str,
    draw: &'static str,
    corner: &'static str,
}

const SILHOUETTES: Names = Names {
    meaning: meaning::SILHOUETTES,
    segments: "silhouettes",
    count: "silhouette_count",
    define: "SILHOUETTES",
    define_count: "SILHOUETTE_COUNT",
    draw: "draw_silhouettes",
    corner: "silhouette_corner",
};

const SHADOWS: Names = Names {
    meaning: meaning::SHADOWS,
    segments: "shadows",
    count: "shadow_count",
    define: "SHADOWS",
    define_count: "SHADOW_COUNT",
    draw: "draw_shadows",
    corner: "shadow_corner",
};

impl List {
    fn declare(io: &mut Io, names: &'static Names) -> Option<Self> {
        let segments = io.optional(names.segments, names.meaning, Extent::Any);
        let count_doc = "The number of segments; the whole list if not connected.";
        let count = io.optional(names.count, COUNT.doc(count_doc), Extent::Fixed([1, 1]));
        Some(Self { names, segments: segments?, count })
    }

    fn define(&self, io: &mut Io) {
        io.define(self.names.define);
        if self.count.is_some() {
            io.define(self.names.define_count);
        }
    }

    /// The segments that count.
    fn read<'a>(&self, cx: &'a CpuContext) -> Ref<'a, [Segment]> {
        let count = self.count.map_or(u32::MAX, |count| cx.read(count)[0]);
        Ref::map(cx.read(self.segments), |segments| &segments[..segments.len().min(count as usize)])
    }
}

impl Stage for EdgeRaster {
    const KIND: &'static str = "edge_raster";
    const DOC: &'static str = "Marks where edges that are not hidden cross the sides of pixels.";
    type Params = EdgeRasterParams;

    fn declare(params: &EdgeRasterParams, io: &mut Io) -> Self {
        io.column(column::E2);
        io.per_view();
        let silhouettes = List::declare(io, &SILHOUETTES);
        let shadows = List::declare(io, &SHADOWS);
        let filtered = io.read(
            "filtered",
            DEPTH.doc("Distance behind which an edge is hidden, metres."),
            Extent::Frame(1),
        );
        let mask = io.write(
            "mask",
            CROSSINGS.doc(
                "Crossings with each pixel's left side, bits 0 to 7, and top side, bits 8 to 15; with its middle \
                 lines, 16 to 31.",
            ),
            Extent::Corners,
        );
        let vertex = io.write(
            "vertex",
            TURN.doc(
                "An end of a segment in the pixel: 0 if none, else 0x10000 | y << 8 | x in 1/16 pixel, the \
                 greatest such number.",
            ),
            Extent::Frame(1),
        );
        io.shader(shader!("edge_raster"));
        io.constants(CONSTANTS);
        if params.middle {
            io.define("MIDDLE");
        }
        io.dispatch("clear", mask);
        let lists = [silhouettes.as_ref(), shadows.as_ref()].into_iter().flatten();
        lists.clone().for_each(|list| list.define(io));
        match params.method {
            Method::Compute => {
                let (long, long_count) = (Extent::Fixed([LONG_SEGMENTS, 1]), Extent::Fixed([1, 1]));
                let segments = io.write::<Snapped>("long", scratch("Segments with many crossings."), long);
                // The twin draws them with the others.
                io.extent_on_cpu(segments, Extent::Fixed([1, 1]));
                io.write::<u32>("long_count", scratch("The number of these segments."), long_count);
                lists.for_each(|list| io.dispatch(list.names.draw, list.segments));
                io.compute("draw_long", Threads::Groups(LONG_GROUPS));
            }
            Method::Lines => {
                io.define("LINES");
                let visited: Out<texel::R32Uint> =
                    io.write("visited", scratch("1 where a line was drawn last."), Extent::Corners);
                lists.for_each(|list| {
                    io.pass(Pass::Draw {
                        vertex: list.names.corner.into(),
                        fragment: "mark_pixel".into(),
                        shape: Shape::Triangles,
                        vertices: 6,
                        count: list.segments.into(),
                        targets: vec![visited.into()],
                        depth: false,
                        clear: 0.0,
                    });
                });
            }
        }
        if params.merge {
            io.define("MERGE");
            io.dispatch("merge", mask);
        }
        Self { silhouettes, shadows, filtered, mask, vertex, drawn: Mutex::default() }
    }

    fn cpu(&self, params: &EdgeRasterParams, cx: &CpuContext) -> Result<(), String> {
        let (mut mask, mut vertex) = (cx.write(self.mask), cx.write(self.vertex));
        let mut drawn = self.drawn.lock().unwrap_or_else(PoisonError::into_inner);
        for (drawn, count) in drawn.iter_mut().zip([mask.len(), vertex.len()]) {
            drawn.resize_with(count, AtomicU32::default);
            drawn.par_iter_mut().for_each(|word| *word.get_mut() = 0);
        }

        let filtered = cx.read(self.filtered);
        let image = Image {
            view: cx.frame().view,
            size: cx.frame().size.map(|side| side as i32),
            depth_test: params.depth_test,
            max_penumbra: params.max_penumbra,
            halves: u32::from(params.middle),
            filtered: &filtered,
            mask: &drawn[0],
            vertex: &drawn[1],
        };
        for list in [&self.silhouettes, &self.shadows].into_iter().flatten() {
            list.read(cx).par_chunks(CHUNK).for_each(|segments| {
                for snapped in segments.iter().filter_map(|segment| image.snap(segment)) {
                    image.draw(&snapped);
                }
            });
        }
        for (output, drawn) in [&mut mask, &mut vertex].into_iter().zip(&*drawn) {
            output.par_iter_mut().zip(drawn).for_each(|(output, drawn)| *output = drawn.load(Relaxed));
        }
        if params.merge {
            mask.par_iter_mut().for_each(|mask| *mask = merged(*mask));
        }
        Ok(())
    }

    fn explain(&self, params: &EdgeRasterParams, site: &Site) -> Option<Vec<Finding>> {
        explain::at(self, params, site)
    }
}

/// Replaces each byte's runs of set bits by their lowest bit.
fn merged(mask: u32) -> u32 {
    mask & !((mask & 0x7F7F_7F7F) << 1)
}

/// What the segments are drawn into.
struct Image<'a> {
    view: View,
    size: [i32; 2],
    depth_test: DepthTest,
    max_penumbra: f32,
    /// The binary logarithm of the number of lines per pixel: 1 if the middle ones are drawn too.
    halves: u32,
    filtered: &'a [f32],
    mask: &'a [AtomicU32],
    vertex: &'a [AtomicU32],
}

impl Image<'_> {
    /// The part of a segment in front of the near plane and inside the drawing space, as pixels in fixed point.
    fn snap(&self, segment: &Segment) -> Option<Snapped> {
        let within = |p: [f32; 3]| p.iter().all(|c| c.abs() <= LIMIT);
        if !(within(segment.a) && within(segment.b)) {
            return None;
        }
        let near = self.view.near;
        let half = self.size.map(|side| 0.5 * side as f32);
        let scale = [half[0] / self.view.tan_x, half[1] / self.view.tan_y];
        let limit = 0.5 * SPAN;
        let a = self.to_view(segment.a, scale);
        let b = self.to_view(segment.b, scale);

        let mut t = [0.0, 1.0];
        t = cut(t, a[2] - near, b[2] - near);
        t = cut(t, limit * a[2] + a[0], limit * b[2] + b[0]);
        t = cut(t, limit * a[2] - a[0], limit * b[2] - b[0]);
        t = cut(t, limit * a[2] + a[1], limit * b[2] + b[1]);
        t = cut(t, limit * a[2] - a[1], limit * b[2] - b[1]);
        if t[0] > t[1] {
            return None;
        }
        let between = |t: f32| [0, 1, 2].map(|axis| a[axis] + t * (b[axis] - a[axis]));
        // An end that is not clipped keeps its exact coordinates, so that edges still meet in it.
        let start = if t[0] > 0.0 { between(t[0]) } else { a };
        let end = if t[1] < 1.0 { between(t[1]) } else { b };
        let inverse = [start, end].map(|p| 1.0 / p[2].max(near));
        let fixed = |p: [f32; 3], inverse: f32, axis: usize| {
            let (low, high) = (half[axis] - limit, half[axis] + limit);
            let at = ((half[axis] + p[axis] * inverse) * PIXEL as f32 + 0.5).floor();
            at.clamp(low * PIXEL as f32, high * PIXEL as f32) as i32
        };
        Some(Snapped {
            ax: fixed(start, inverse[0], 0),
            ay: fixed(start, inverse[0], 1),
            bx: fixed(end, inverse[1], 0),
            by: fixed(end, inverse[1], 1),
            inverse_a: inverse[0],
            inverse_b: inverse[1],
            penumbra: penumbra_width(segment.flags) * scale[0],
        })
    }

    /// Right and down, times the distance in pixels from the image's middle; and the distance along the axis, metres.
    fn to_view(&self, position: [f32; 3], scale: [f32; 2]) -> [f32; 3] {
        let p = Vec3::from(position) - Vec3::from(self.view.eye);
        let along = |axis: [f32; 3]| p.dot(axis.into());
        [along(self.view.right) * scale[0], -(along(self.view.up) * scale[1]), along(self.view.forward)]
    }

    /// Marks all crossings and both ends of a segment.
    fn draw(&self, snapped: &Snapped) {
        let Snapped { ax, ay, bx, by, inverse_a, inverse_b, .. } = *snapped;
        if [ax, ay] != [bx, by] {
            self.mark_end([ax, ay], inverse_a, snapped.penumbra);
            self.mark_end([bx, by], inverse_b, snapped.penumbra);
        }
        for axis in [0, 1] {
            let lines = Lines::new(snapped, axis, self.size[axis], self.halves);
            for line in lines.first..=lines.last {
                let crossing = lines.crossing(line, axis == 0);
                if snapped.penumbra <= self.max_penumbra * crossing.z {
                    self.mark(axis, line, &crossing);
                }
            }
        }
    }

    /// Marks an end if it is in the image and not hidden.
    fn mark_end(&self, at: [i32; 2], inverse: f32, penumbra: f32) {
        let pixel = at.map(|along| along >> PIXEL_SHIFT);
        let is_inside = (0..2).all(|axis| (0..self.size[axis]).contains(&pixel[axis]));
        let z = 1.0 / inverse;
        if is_inside
            && penumbra <= self.max_penumbra * z
            && (self.depth_test == DepthTest::Off || z <= self.depth(pixel))
        {
            let [x, y] = at.map(|along| (((along & (PIXEL - 1)) + 8) >> 4) as u32);
            let index = pixel[1] as usize * self.size[0] as usize + pixel[0] as usize;
            self.vertex[index].fetch_max(VERTEX | y << 8 | x, Relaxed);
        }
    }

    /// Marks a crossing with a line if it is in the image and not hidden.
    fn mark(&self, axis: usize, line: i32, crossing: &Crossing) {
        let Crossing { slot, z } = *crossing;
        let is_middle = line & self.halves as i32 == 1;
        let mut pixel = [line >> self.halves, slot >> 3];
        if slot < 0 || pixel[1] >= self.size[1 - axis] {
            return;
        }
        if axis == 1 {
            pixel.swap(0, 1);
        }
        let is_shown =
            if is_middle { self.is_shown_within(z, pixel, axis) } else { self.is_shown(z, pixel, axis) };
        if is_shown {
            let bit = (slot & 7) as usize + 8 * axis + 16 * usize::from(is_middle);
            let corner = pixel[1] as usize * (self.size[0] as usize + 1) + pixel[0] as usize;
            self.mask[corner].fetch_or(1 << bit, Relaxed);
        }
    }

    /// Whether an edge at distance z shows at the left (axis 0) or top (axis 1) side of a pixel.
    fn is_shown(&self, z: f32, owner: [i32; 2], axis: usize) -> bool {
        let mut other = owner;
        other[axis] -= 1;
        let owner_exists = owner[axis] < self.size[axis];
        let other_exists = other[axis] >= 0;
        let at_owner = owner_exists && z <= self.depth(owner);
        let at_other = other_exists && z <= self.depth(other);
        match self.depth_test {
            DepthTest::Either => at_owner || at_other,
            DepthTest::Owner => {
                if owner_exists {
                    at_owner
                } else {
                    at_other
                }
            }
            DepthTest::Both => (at_owner || !owner_exists) && (at_other || !other_exists),
            DepthTest::Off => true,
        }
    }

    /// Whether an edge at distance z shows at the vertical (axis 0) or horizontal (axis 1) middle line of a pixel.
    fn is_shown_within(&self, z: f32, owner: [i32; 2], axis: usize) -> bool {
        let shows_beside = |step: i32| {
            let mut pixel = owner;
            pixel[axis] += step;
            (0..self.size[axis]).contains(&pixel[axis]) && z <= self.depth(pixel)
        };
        match self.depth_test {
            DepthTest::Either => [-1, 0, 1].into_iter().any(shows_beside),
            DepthTest::Owner | DepthTest::Both => shows_beside(0),
            DepthTest::Off => true,
        }
    }

    fn depth(&self, pixel: [i32; 2]) -> f32 {
        self.filtered[pixel[1] as usize * self.size[0] as usize + pixel[0] as usize]
    }
}

/// The range of t in which a distance that goes from `a` (t = 0) to `b` (t = 1) is not negative.
fn cut(t: [f32; 2], a: f32, b: f32) -> [f32; 2] {
    if a < 0.0 && b < 0.0 {
        [1.0, 0.0]
    } else if a < 0.0 {
        [t[0].max(a / (a - b)), t[1]]
    } else if b < 0.0 {
        [t[0], t[1].min(a / (a - b))]
    } else {
        t
    }
}

/// The lines of the grid across one axis that a segment crosses in the image, numbered from the image's left or top
/// edge.
struct Lines {
    /// The binary logarithm of the line spacing in units.
    shift: u32,
    /// The end with the smaller coordinate along the axis: that coordinate, and the other one.
    start: [i32; 2],
    /// Vector from there to the other end; its first component is positive if there are lines.
    delta: [i32; 2],
    /// 1 / z there, and its difference to the other end.
    inverse: [f32; 2],
    first: i32,
    last: i32,
}

/// The crossing of a segment and a line.
struct Crossing {
    /// In eighths of a pixel from the image's top or left edge.
    slot: i32,
    /// Distance along the view axis, metres.
    z: f32,
}

impl Lines {
    /// Vertical lines for axis 0, horizontal ones for axis 1, of an image with `size` pixels along the axis; `halves`
    /// is 0 for one line to a pixel, and 1 for two.
    fn new(snapped: &Snapped, axis: usize, size: i32, halves: u32) -> Self {
        let shift = PIXEL_SHIFT - halves;
        let Snapped { ax, ay, bx, by, inverse_a, inverse_b, .. } = *snapped;
        let (mut a, mut b) = if axis == 0 { ([ax, ay], [bx, by]) } else { ([ay, ax], [by, bx]) };
        let mut inverse = [inverse_a, inverse_b];
        if b[0] < a[0] {
            (a, b) = (b, a);
            inverse.swap(0, 1);
        }
        Self {
            shift,
            start: a,
            delta: [b[0] - a[0], b[1] - a[1]],
            inverse: [inverse[0], inverse[1] - inverse[0]],
            // A vertex on a line counts as beyond it.
            first: ((a[0] >> shift) + 1).max(0),
            last: (b[0] >> shift).min(size << halves),
        }
    }

    /// The crossing with a line.
    fn crossing(&self, line: i32, vertical: bool) -> Crossing {
        let along = ((line << self.shift) - self.start[0]) as u32;
        let length = self.delta[0] as u32;
        // The crossing's other coordinate is start[1] +- (quotient + rest / length).
        let product = u64::from(along) * u64::from(self.delta[1].unsigned_abs());
        let quotient = (product / u64::from(length)) as i32;
        let rest = product % u64::from(length);

        // At a crossing exactly at the end of a slot, the slot before counts on vertical lines if the segment descends:
        // the perturbation that moves vertices beyond lines moves the crossing there.
        let (whole, before) = if self.delta[1] > 0 {
            (self.start[1] + quotient, vertical && rest == 0)
        } else {
            (self.start[1] - quotient, rest != 0)
        };
        Crossing {
            slot: (whole - i32::from(before)) >> SLOT_SHIFT,
            z: 1.0 / (self.inverse[0] + self.inverse[1] * (along as f32 / length as f32)),
        }
    }
}

#[cfg(test)]
mod tests {
    use epigraph_core::Harness;

    use super::*;
    use crate::shared::{
        segments::{SHADOW_PENUMBRA, shadow_flags},
        testing::{Random, run_alike, run_both, run_cpu, settings},
    };

    /// A view in which the x and y of a point at z = 1 are its pixel coordinates, relative to the image's middle.
    fn view(size: [u32; 2]) -> View {
        let [tan_x, tan_y] = size.map(|side| 0.5 * side as f32);
        View { tan_x, tan_y, near: 0.5, far: 1000.0, ..View::default() }
    }

    /// The point at distance z that projects to (x, y), in 1/256 pixel.
    fn point([x, y]: [i32; 2], z: f32, size: [u32; 2]) -> [f32; 3] {
        let [x, y] = [x as f32 / 256.0 - 0.5 * size[0] as f32, y as f32 / 256.0 - 0.5 * size[1] as f32];
        [x * z, -y * z, -z]
    }

    /// A segment at distance 1.
    fn flat([ax, ay, bx, by]: [i32; 4], size: [u32; 2]) -> Segment {
        let (a, b) = (point([ax, ay], 1.0, size), point([bx, by], 1.0, size));
        Segment { a, b, ..Segment::default() }
    }

    fn harness(depth_test: DepthTest, size: [u32; 2], segments: &[Segment]) -> Harness<EdgeRaster> {
        harness_of(EdgeRasterParams { depth_test, ..EdgeRasterParams::default() }, size, segments)
    }

    fn harness_of(params: EdgeRasterParams, size: [u32; 2], segments: &[Segment]) -> Harness<EdgeRaster> {
        let mut harness = Harness::new(params, &settings(size, 0));
        harness.frame.view = view(size);
        harness.set("silhouettes", segments);
        harness.set("silhouette_count", &[segments.len() as u32]);
        harness.set("filtered", &vec![1000f32; (size[0] * size[1]) as usize]);
        harness
    }

    fn mask(size: [u32; 2], segments: &[Segment]) -> Vec<u32> {
        run_alike(&mut harness(DepthTest::Either, size, segments)).get("mask")
    }

    /// Column, row and number of each set bit.
    fn bits(mask: &[u32], size: [u32; 2]) -> Vec<[u32; 3]> {
        let width = size[0] + 1;
        let all = (0..mask.len() as u32).flat_map(|corner| (0..32).map(move |bit| [corner, bit]));
        let set = all.filter(|&[corner, bit]| mask[corner as usize] >> bit & 1 == 1);
        set.map(|[corner, bit]| [corner % width, corner / width, bit]).collect()
    }

    /// The number of crossings of each pixel's perimeter, row by row.
    fn perimeters(mask: &[u32], [width, height]: [u32; 2]) -> Vec<u32> {
        let at = |x: u32, y: u32| mask[(y * (width + 1) + x) as usize];
        let count = |x, y| {
            let own = (at(x, y) & 0xFFFF).count_ones();
            own + (at(x + 1, y) & 0xFF).count_ones() + (at(x, y + 1) & 0xFF00).count_ones()
        };
        (0..height).flat_map(|y| (0..width).map(move |x| count(x, y))).collect()
    }

    /// The number of crossings of the perimeter of each quarter of a pixel, row by row.
    fn quarters(mask: &[u32], [width, height]: [u32; 2]) -> Vec<u32> {
        // The number of crossings of the half pixel's side that begins at a corner; x and y are in half pixels.
        let slots = |x: u32, y: u32, axis: u32| {
            let corner = (y / 2 * (width + 1) + x / 2) as usize;
            let (line, along) = if axis == 0 { (x, y) } else { (y, x) };
            (mask[corner] >> (16 * (line % 2) + 8 * axis + 4 * (along % 2)) & 15).count_ones()
        };
        let count = |x, y| slots(x, y, 0) + slots(x + 1, y, 0) + slots(x, y, 1) + slots(x, y + 1, 1);
        (0..2 * height).flat_map(|y| (0..2 * width).map(move |x| count(x, y))).collect()
    }

    fn mask_with_middle(size: [u32; 2], segments: &[Segment]) -> Vec<u32> {
        let params = EdgeRasterParams { middle: true, ..EdgeRasterParams::default() };
        run_cpu(&mut harness_of(params, size, segments)).get("mask")
    }

    /// The crossing rule of `algorithms.md` section 2.2 in plain integers, without clipping or depth.
    fn model(size: [u32; 2], ends: [i64; 4]) -> Vec<u32> {
        model_of(size, ends, false)
    }

    /// The same, optionally with the pixels' middle lines.
    fn model_of(size: [u32; 2], [x0, y0, x1, y1]: [i64; 4], middle: bool) -> Vec<u32> {
        let lines = if middle { 2 } else { 1 };
        let step = 256 / lines;
        let [width, height] = size.map(i64::from);
        let mut mask = vec![0; ((width + 1) * (height + 1)) as usize];
        if x0 != x1 {
            let [ax, ay, bx, by] = if x0 < x1 { [x0, y0, x1, y1] } else { [x1, y1, x0, y0] };
            let (dx, dy) = (bx - ax, by - ay);
            for i in (0..=lines * width).filter(|i| ax < step * i && step * i <= bx) {
                let (n, d) = (8 * (ay * dx + (step * i - ax) * dy), 256 * dx);
                let slot = if dy > 0 { -(-n).div_euclid(d) - 1 } else { n.div_euclid(d) };
                let row = slot.div_euclid(8);
                if (0..height).contains(&row) {
                    let bit = slot.rem_euclid(8) + 16 * (i % lines);
                    mask[(row * (width + 1) + i / lines) as usize] |= 1 << bit;
                }
            }
        }
        if y0 != y1 {
            let [ax, ay, bx, by] = if y0 < y1 { [x0, y0, x1, y1] } else { [x1, y1, x0, y0] };
            let (dx, dy) = (bx - ax, by - ay);
            for j in (0..=lines * height).filter(|j| ay < step * j && step * j <= by) {
                let slot = (8 * (ax * dy + (step * j - ay) * dx)).div_euclid(256 * dy);
                let column = slot.div_euclid(8);
                if (0..width).contains(&column) {
                    let bit = slot.rem_euclid(8) + 8 + 16 * (j % lines);
                    mask[(j / lines * (width + 1) + column) as usize] |= 1 << bit;
                }
            }
        }
        mask
    }

    /// Asserts that both sides give the same mask as the model.
    #[track_caller]
    fn assert_like_model(size: [u32; 2], ends: &[[i32; 4]]) {
        let segments: Vec<Segment> = ends.iter().map(|&ends| flat(ends, size)).collect();
        for middle in [false, true] {
            let mut expected = vec![0; ((size[0] + 1) * (size[1] + 1)) as usize];
            for ends in ends {
                let one = model_of(size, ends.map(i64::from), middle);
                expected.iter_mut().zip(one).for_each(|(mask, one)| *mask |= one);
            }
            for method in [Method::Compute, Method::Lines] {
                let params = EdgeRasterParams { method, middle, ..EdgeRasterParams::default() };
                let both = run_both(&mut harness_of(params, size, &segments));
                assert!(both.cpu.get::<u32>("mask") == expected, "{method:?}, {middle} on the CPU");
                assert!(both.gpu.get::<u32>("mask") == expected, "{method:?}, {middle} on the GPU");
            }
        }
    }

    #[test]
    fn golden_crossings() {
        // Example E10 of algorithms.md section 2.6.
        let size = [7, 7];
        let segment = [-256, 496, 2048, 1360];
        let inside = |[x, y, _]: &[u32; 3]| (1..=5).contains(x) && (1..=5).contains(y);
        let mut found: Vec<_> =
            bits(&mask(size, &[flat(segment, size)]), size).into_iter().filter(inside).collect();
        found.sort_unstable();
        let expected = [[1, 2, 5], [1, 3, 8 + 6], [2, 3, 0], [3, 3, 3], [4, 3, 6], [4, 4, 8 + 4], [5, 4, 1]];
        assert_eq!(found, expected);
        assert_like_model(size, &[segment]);
    }

    #[test]
    fn an_edge_on_a_side_counts_as_below_or_to_the_right_of_it() {
        let size = [6, 6];
        let expected: Vec<_> = (2..=5).map(|x| [x, 2, 0]).collect();
        assert_eq!(bits(&mask(size, &[flat([256, 512, 1280, 512], size)]), size), expected);
        // An edge on a vertical side counts as in the column to the right.
        let expected: Vec<_> = (2..=5).map(|y| [2, y, 8]).collect();
        assert_eq!(bits(&mask(size, &[flat([512, 256, 512, 1280], size)]), size), expected);
    }

    #[test]
    fn diagonals_through_corners_give_simple_pixels() {
        let size = [6, 6];
        for ends in [[-256, -256, 2048, 2048], [-256, 1792, 1792, -256], [2048, 2048, -512, -512]] {
            let counts = perimeters(&mask(size, &[flat(ends, size)]), size);
            assert!(counts.iter().all(|&count| count == 0 || count == 2), "{ends:?}: {counts:?}");
            assert!(counts.iter().filter(|&&count| count == 2).count() >= 6, "{ends:?}: {counts:?}");
        }
    }

    #[test]
    fn a_line_crosses_a_perimeter_twice_or_never() {
        let size = [10, 10];
        let mut random = Random(2);
        let mut lines = Vec::new();
        for _ in 0..300 {
            let mut y = || 32 * (random.below(120) as i32 - 24);
            let ends = [-768, y(), 3328, y()];
            lines.extend([ends, [ends[1], ends[0], ends[3], ends[2]]]);
        }
        for &ends in &lines {
            let mask = mask_with_middle(size, &[flat(ends, size)]);
            for counts in [perimeters(&mask, size), quarters(&mask, size)] {
                assert!(counts.iter().all(|&count| count == 0 || count == 2), "{ends:?}");
            }
        }
        assert_like_model(size, &lines);
    }

    #[test]
    fn closed_polygons_cross_every_perimeter_evenly() {
        let size = [10, 10];
        let mut random = Random(3);
        let mut edges = Vec::new();
        for polygon in 0..120 {
            // Half of the polygons have their vertices on corners of pixels. Some reach beyond the image.
            let (step, count) = if polygon % 2 == 0 { (256, 14) } else { (8, 14 * 32) };
            let vertices: Vec<[i32; 2]> = (0..3 + random.below(4))
                .map(|_| [0; 2].map(|_| step * random.below(count) as i32 - 512))
                .collect();
            let (mut crossings, mut in_quarters) = (vec![0; 100], vec![0; 400]);
            for (i, &[ax, ay]) in vertices.iter().enumerate() {
                let [bx, by] = vertices[(i + 1) % vertices.len()];
                edges.push([ax, ay, bx, by]);
                let mask = mask_with_middle(size, &[flat([ax, ay, bx, by], size)]);
                crossings.iter_mut().zip(perimeters(&mask, size)).for_each(|(sum, count)| *sum += count);
                in_quarters.iter_mut().zip(quarters(&mask, size)).for_each(|(sum, count)| *sum += count);
            }
            assert!(crossings.iter().all(|count| count % 2 == 0), "{vertices:?}");
            assert!(in_quarters.iter().all(|count| count % 2 == 0), "{vertices:?}");
        }
        assert_like_model(size, &edges);
    }

    #[test]
    fn long_segments_of_any_slope_are_exact() {
        // The ends are within the drawing space, so nothing is clipped. Most segments have many crossings.
        let size = [256, 64];
        let mut random = Random(4);
        let ends: Vec<[i32; 4]> = (0..200)
            .map(|i| {
                let reach = if i % 2 == 0 { 16_000 } else { 8_000_000 };
                [0; 4].map(|_| random.below(2 * reach) as i32 - reach as i32)
            })
            .chain([[-8_000_000, 8000, 8_000_000, 8001], [31, -8_000_000, 32, 8_000_000]])
            .collect();
        assert_like_model(size, &ends);
    }

    #[test]
    fn long_segments_that_exceed_the_list_are_drawn_too() {
        // One segment for each slot of the left sides: more than the capacity of the list of long segments.
        let size = [40, 8800];
        let segments: Vec<Segment> =
            (0..8 * 8800).map(|slot| flat([-256, 32 * slot + 16, 41 * 256, 32 * slot + 16], size)).collect();
        assert!(segments.len() > LONG_SEGMENTS as usize);
        let both = run_both(&mut harness(DepthTest::Either, size, &segments));
        for out in [both.cpu, both.gpu] {
            let mask = out.get::<u32>("mask");
            let (rows, last) = mask.split_at(41 * 8800);
            assert!(rows.iter().all(|&mask| mask == 0xFF) && last.iter().all(|&mask| mask == 0));
        }
    }

    #[test]
    fn clipping_does_not_change_the_crossings_of_very_long_segments() {
        // In 1/256 pixel, so about 4 million pixels in each direction.
        let (size, reach) = ([64, 64], 1 << 30);
        for (ends, near) in [
            ([-reach, 5000, reach, 5000], [-256, 5000, 65536, 5000]),
            ([7777, -reach, 7777, reach], [7777, -256, 7777, 65536]),
            ([-reach, -reach, reach, reach], [-256, -256, 65536, 65536]),
            ([-reach, 8192 - reach / 2, reach, 8192 + reach / 2], [-16384, 0, 32768, 24576]),
            ([8192 - reach / 2, -reach, 8192 + reach / 2, reach], [-8192, -32768, 24576, 32768]),
        ] {
            let [ax, ay, bx, by] = ends;
            let expected = model(size, near.map(i64::from));
            // Clipped at both ends, and at one: from the middle to either side.
            for ends in [ends, [bx, by, ax, ay]] {
                assert_eq!(mask(size, &[flat(ends, size)]), expected, "{ends:?}");
            }
            let middle = [ax / 2 + bx / 2, ay / 2 + by / 2];
            let halves = [[ax, ay, middle[0], middle[1]], [middle[0], middle[1], bx, by]];
            let halves = halves.map(|ends| flat(ends, size));
            assert_eq!(mask(size, &halves), expected, "{ends:?} in halves");
        }
        // A segment whose ends have very different distances.
        let segment = |reach: f32| Segment {
            a: [-reach, 12.0, -1.0],
            b: [reach, 12000.0, -1000.0],
            ..Segment::default()
        };
        let counts = perimeters(&mask(size, &[segment(1e6)]), size);
        assert!(counts.iter().all(|&count| count == 0 || count == 2));
    }

    #[test]
    fn segments_are_clipped_at_the_near_plane() {
        // A straight line on a floor 2 m below the eye passes beneath it. Its image runs down from the middle of the
        // horizon.
        let size = [64, 64];
        let mut harness = harness(DepthTest::Off, size, &[]);
        let segment = |z: f32| Segment { a: [1.0, -2.0, -1e6], b: [1.0, -2.0, z], ..Segment::default() };
        harness.frame.view = View { near: 0.01, far: 1e9, ..View::default() };
        let mut draw = |segment| {
            harness.set("silhouettes", &[segment]);
            harness.set("silhouette_count", &[1u32]);
            let both = run_both(&mut harness);
            both.assert_equal::<u32>("mask");
            both.assert_equal::<u32>("vertex");
            both.cpu.get::<u32>("mask")
        };
        let through = draw(segment(1e6));
        // At z = 2 the floor meets the lower border of the image.
        assert_eq!(draw(segment(-1.0)), through);
        assert_eq!(bits(&through, size).iter().filter(|bit| bit[2] >= 8).count(), 32);
        // By hand: at the bottom of row 47, y is 16 of 32, so z = 4, and x is 8 pixels from the middle.
        assert!(bits(&through, size).contains(&[40, 48, 8]));
        // Segments between the eye and the near plane, and behind the eye.
        for z in [-0.009, 5.0] {
            let hidden = Segment { a: [-1.0, -0.001, z], b: [1.0, 0.001, z], ..Segment::default() };
            assert!(draw(hidden).iter().all(|&mask| mask == 0), "{z}");
        }
    }
    #[test]
    fn depth_decides_at_each_crossing() {
        let size = [4, 4];
        // A segment from the left edge to the right one, along y = 1.5, at distances from 1 to 3. On the screen, 1 / z
        // is linear.
        let segment =
            Segment { a: point([0, 384], 1.0, size), b: point([1024, 384], 3.0, size), ..Segment::default() };
        // At x = 2 the distance is 1 / (1 + 0.5 (1/3 - 1)) = 1.5.
        let shown = |depth_test, left: f32, right: f32| {
            let mut harness = harness(depth_test, size, &[segment]);
            let mut filtered = [1000f32; 16];
            (filtered[4 + 1], filtered[4 + 2]) = (left, right);
            harness.set("filtered", &filtered);
            let both = run_both(&mut harness);
            both.assert_equal::<u32>("mask");
            both.assert_equal::<u32>("vertex");
            bits(&both.cpu.get::<u32>("mask"), size).contains(&[2, 1, 4])
        };
        for (depth_test, neither, left, right, both) in [
            (DepthTest::Either, false, true, true, true),
            (DepthTest::Owner, false, false, true, true),
            (DepthTest::Both, false, false, false, true),
            (DepthTest::Off, true, true, true, true),
        ] {
            let found = [(1.49, 1.49), (1.51, 1.49), (1.49, 1.51), (1.51, 1.51)]
                .map(|(left, right)| shown(depth_test, left, right));
            assert_eq!(found, [neither, left, right, both], "{depth_test:?}");
        }
    }

    #[test]
    fn middle_lines_by_hand() {
        // The crossing lines of algorithms.md section 2.6, in pixel (3, 3), where they meet at about (832, 880). One
        // crosses the middle line x = 896 at y = 832 + 128 / 2304 * (896 + 256) = 896, a boundary of slots: the slot
        // above, as the line descends. The other crosses y = 896 at x = 832 + 128 / 2304 * 1152 = 896: the slot to the
        // right.
        let size = [7, 7];
        let segments = [flat([-256, 832, 2048, 960], size), flat([832, -256, 960, 2048], size)];
        let mask = mask_with_middle(size, &segments);
        assert_eq!(mask[3 * 8 + 3], 1 << 3 | 1 << (8 + 3) | 1 << (16 + 3) | 1 << (24 + 4));
        // The last column and row have no middle lines.
        assert!(bits(&mask, size).iter().all(|&[x, y, bit]| bit < 16 || (x < 7 && y < 7)));
    }

    #[test]
    fn depth_decides_at_middle_lines() {
        // A segment through the middle line of pixel (1, 0), at distance 1. The filtered depths are those of the pixel
        // to its left, its own, and that of the pixel to its right.
        let size = [3, 1];
        let segment = flat([-256, 100, 1024, 100], size);
        let shown = |depth_test, filtered: [f32; 3]| {
            let params = EdgeRasterParams { depth_test, middle: true, ..EdgeRasterParams::default() };
            let mut harness = harness_of(params, size, &[segment]);
            harness.set("filtered", &filtered);
            let both = run_both(&mut harness);
            both.assert_equal::<u32>("mask");
            both.assert_equal::<u32>("vertex");
            bits(&both.cpu.get::<u32>("mask"), size).contains(&[1, 0, 16 + 3])
        };
        for (depth_test, expected) in [
            (DepthTest::Either, [true, true, true, false]),
            (DepthTest::Owner, [false, true, false, false]),
            (DepthTest::Both, [false, true, false, false]),
            (DepthTest::Off, [true; 4]),
        ] {
            let cases = [[2.0, 0.5, 0.5], [0.5, 2.0, 0.5], [0.5, 0.5, 2.0], [0.5; 3]];
            assert_eq!(cases.map(|filtered| shown(depth_test, filtered)), expected, "{depth_test:?}");
        }
    }

    #[test]
    fn boundaries_of_wide_penumbrae_are_not_edges() {
        // At a distance of 1 m, a pixel of the view is 1 m wide. The limit is 2 pixels, so a penumbra of 2 m is narrow
        // enough at 1 m or farther away.
        let size = [8, 8];
        let ends = [point([-256, 1000], 0.6, size), point([2304, 1000], 8.0, size)];
        for (penumbra, limit) in [(0.0, 0.0), (2.0, 1.0), (8.0, 4.0), (64.0, 32.0)] {
            for method in [Method::Compute, Method::Lines] {
                let flags = shadow_flags(SHADOW_PENUMBRA, penumbra);
                let segment = Segment { a: ends[0], b: ends[1], flags, edge: 0 };
                let params = EdgeRasterParams { method, ..EdgeRasterParams::default() };
                let mut harness = harness_of(params, size, &[]);
                harness.set("shadows", &[segment]);
                harness.set("shadow_count", &[1u32]);
                let both = run_both(&mut harness);
                both.assert_equal::<u32>("mask");
                both.assert_equal::<u32>("vertex");
                // On the screen, 1 / z is linear; the left side of column 0 is at a tenth of the segment.
                let z = |x: u32| 1.0 / (1.0 / 0.6 + (1.0 / 8.0 - 1.0 / 0.6) * (x as f32 + 1.0) / 10.0);
                let expected: Vec<u32> = (0..=8).filter(|&x| z(x) >= limit).collect();
                let found: Vec<u32> =
                    bits(&both.cpu.get::<u32>("mask"), size).iter().map(|bit| bit[0]).collect();
                assert_eq!(found, expected, "{penumbra} {method:?}");
            }
        }
    }

    #[test]
    fn at_the_border_of_the_image_the_depth_of_one_pixel_decides() {
        let size = [3, 3];
        let across = flat([-256, 384, 1024, 384], size);
        let down = flat([384, -256, 384, 1024], size);
        let ends = [[0, 1, 4], [3, 1, 4], [1, 0, 12], [1, 3, 12]];
        for depth_test in [DepthTest::Either, DepthTest::Owner, DepthTest::Both] {
            for (filtered, shown) in [(2f32, true), (0.5, false)] {
                let mut harness = harness(depth_test, size, &[across, down]);
                harness.set("filtered", &[filtered; 9]);
                let both = run_both(&mut harness);
                both.assert_equal::<u32>("mask");
                both.assert_equal::<u32>("vertex");
                let found = bits(&both.cpu.get::<u32>("mask"), size);
                assert!(ends.iter().all(|end| found.contains(end) == shown), "{depth_test:?}: {found:?}");
            }
        }
    }

    #[test]
    fn segments_that_are_not_finite_are_not_drawn() {
        let size = [32, 32];
        let mut broken = Vec::new();
        for bad in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY, 3e38] {
            for axis in 0..3 {
                let mut segment = flat([100, 100, 5000, 7000], size);
                segment.a[axis] = bad;
                let turned = Segment { a: segment.b, b: segment.a, ..segment };
                broken.extend([segment, turned, Segment { a: [bad; 3], b: [bad; 3], ..segment }]);
            }
        }
        let good = flat([100, 100, 5000, 7000], size);
        broken.push(good);
        let both = run_both(&mut harness(DepthTest::Either, size, &broken));
        both.assert_equal::<u32>("mask");
        both.assert_equal::<u32>("vertex");
        assert_eq!(both.cpu.get::<u32>("mask"), mask(size, &[good]));
    }

    #[test]
    fn points_and_empty_lists_mark_nothing_and_each_frame_clears_the_mask() {
        let size = [8, 8];
        let mut harness = harness(DepthTest::Either, size, &[flat([0, 100, 2000, 1900], size)]);
        assert!(run_both(&mut harness).gpu.get::<u32>("mask").iter().any(|&mask| mask != 0));
        harness.set("silhouette_count", &[0u32]);
        let both = run_both(&mut harness);
        for out in [both.cpu, both.gpu] {
            assert_eq!(out.get::<u32>("mask"), [0; 81]);
        }
        assert_eq!(mask(size, &[flat([512; 4], size), flat([700, 300, 700, 300], size)]), [0; 81]);
    }

    #[test]
    fn both_lists_are_drawn_up_to_their_counts() {
        let size = [8, 8];
        let segments = [[-256, 300, 4000, 1500], [300, -256, 900, 4000], [-256, 1900, 4000, 100]]
            .map(|ends| flat(ends, size));
        let mut harness = harness(DepthTest::Either, size, &segments[..1]);
        harness.set("shadows", &segments[1..]);
        harness.set("shadow_count", &[1u32]);
        let both = run_both(&mut harness);
        both.assert_equal::<u32>("mask");
        both.assert_equal::<u32>("vertex");
        assert_eq!(both.cpu.get::<u32>("mask"), mask(size, &segments[..2]));

        // Without lists, nothing is drawn; without a count, the whole list.
        let mut harness = Harness::<EdgeRaster>::new(EdgeRasterParams::default(), &settings(size, 0));
        harness.frame.view = view(size);
        harness.set("filtered", &[1000f32; 64]);
        let both = run_both(&mut harness);
        for out in [both.cpu, both.gpu] {
            assert_eq!(out.get::<u32>("mask"), [0; 81]);
        }
        harness.reset();
        harness.set("shadows", &segments);
        let both = run_both(&mut harness);
        both.assert_equal::<u32>("mask");
        both.assert_equal::<u32>("vertex");
        assert_eq!(both.cpu.get::<u32>("mask"), mask(size, &segments));
    }

    #[test]
    fn runs_of_crossings_merge_within_a_side() {
        assert_eq!(merged(0b0110_0001), 0b0010_0001);
        assert_eq!(merged(0x0000_FF80), 0x0000_0180);
        assert_eq!(merged(0xFFFF_FFFF), 0x0101_0101);
        // Vertical lines in slots 4 and 5 of column 2 and in slot 0 of column 3.
        let size = [8, 8];
        let lines = [640, 672, 768].map(|x| flat([x, -10, x, 3000], size));
        let expected: Vec<[u32; 3]> = (0..9).flat_map(|y| [[2, y, 8 + 4], [3, y, 8]]).collect();
        for method in [Method::Compute, Method::Lines] {
            let params = EdgeRasterParams { method, merge: true, ..EdgeRasterParams::default() };
            let both = run_both(&mut harness_of(params, size, &lines));
            both.assert_equal::<u32>("mask");
            assert_eq!(bits(&both.cpu.get::<u32>("mask"), size), expected, "{method:?}");
        }
    }

    #[test]
    fn both_sides_agree() {
        let size = [120, 90];
        let mut random = Random(6);
        let mut end = |reach: f32| {
            let z = random.between(-5.0, 60.0);
            [reach * random.between(-z, z), reach * random.between(-z, z), -z]
        };
        let far: Vec<Segment> =
            (0..400).map(|_| Segment { a: end(1.2), b: end(1.2), ..Segment::default() }).collect();
        // Short segments, like the edges of a mesh.
        let near: Vec<Segment> = (0..4000)
            .map(|_| {
                let (a, step) = (end(1.0), end(0.005));
                Segment { a, b: [a[0] + step[0], a[1] + step[1], a[2]], ..Segment::default() }
            })
            .collect();
        let filtered: Vec<f32> = (0..120 * 90).map(|_| random.between(1.0, 60.0)).collect();
        let lists = [("far", &far), ("near", &near)];
        for method in [Method::Compute, Method::Lines] {
            for depth_test in [DepthTest::Either, DepthTest::Owner, DepthTest::Both, DepthTest::Off] {
                for (name, segments) in lists {
                    let params = EdgeRasterParams { method, depth_test, ..EdgeRasterParams::default() };
                    let mut harness = harness_of(params, size, segments);
                    harness.frame.view = View { near: 0.5, tan_y: 0.75, ..View::default() };
                    harness.set("filtered", &filtered);
                    let both = run_both(&mut harness);
                    let [cpu, gpu] = [&both.cpu, &both.gpu].map(|out| out.get::<u32>("mask"));
                    let count = cpu.iter().map(|mask| mask.count_ones()).sum::<u32>();
                    let differing = cpu.iter().zip(&gpu).map(|(a, b)| (a ^ b).count_ones()).sum::<u32>();
                    // A shader may fuse the products of the projection. Then an end that is about halfway between two
                    // units may be rounded to the other one, and a crossing may move to the next slot. The depth test
                    // compares floats.
                    let what = format!("{name} {method:?} {depth_test:?}: {differing} of {count} differ");
                    assert!(count > 500 && differing * 500 <= count, "{what}");
                }
            }
        }
    }
}
