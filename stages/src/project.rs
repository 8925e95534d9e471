//! Projects the point cloud: which point each pixel shows, its distance, and its position in the pixel (`algorithms.md`
//! sections 1.2 and 5). The nearest point wins, and among equally near ones the lowest id, so that the result does not
//! depend on the order in which threads run.
//!
//! Three methods on the GPU compute that result. *TwoPass* needs no extension: an `atomicMin` on the depth, then one on
//! the id among the points with that depth. *Atomic64* combines depth and id in one 64-bit `atomicMin`. *Raster* draws
//! points with the depth test; its depth buffer holds z / far, so of two points whose z differ by less than the
//! rounding of that quotient (a relative 1e-7) the lower id wins instead of the nearer point.

use epigraph_core::{
    Access, CpuContext, Extent, Finding, Frame, In, Io, Out, Pass, Shape, Site, Stage, choice, constants,
    params, scratch, texel,
};
use fearless_simd::{Level, Simd, dispatch, prelude::*, u32x8};
use rayon::prelude::*;

use crate::{
    column,
    meaning::{CELL, DEPTH, ID, POINTS},
    shared::{
        cloud::{AGE, AGE_ONE, LIVE, NO_POINT, NOT_DRAWN},
        lanes::{LANES, append, padded, store},
        view::{Lanes, Projected},
    },
};

#[path = "explain/project.rs"]
mod explain;

/// Points per parallel task on the CPU.
const CHUNK: usize = 1024;

constants! {
    /// The `depth` of a pixel without a point: the bits of infinity.
    pub const EMPTY_DEPTH: u32 = f32::INFINITY.to_bits();
}

choice! {
    /// How the GPU finds the nearest point of each pixel.
    pub enum Method {
        /// Two passes of 32-bit atomics; runs everywhere.
        TwoPass,
        /// One pass of 64-bit atomics; needs a device that supports them.
        Atomic64,
        /// Points drawn by the rasteriser with a depth buffer.
        Raster,
    }
}

params! {
    /// Parameters of [`Project`].
    pub struct ProjectParams {
        /// How the GPU finds the nearest point of each pixel; the CPU has a single method.
        method: Method = Method::TwoPass;
        /// Bits of the sub-pixel cell, half of them for each axis: 8 gives 16 x 16 cells, 4 gives 4 x 4.
        subpixel_bits: u32 = 8, in 2..=8, unit "bits";
        /// Points older than this are not drawn.
        max_age: u32 = 255, in 0..=255;
    }
}

/// See the module.
pub struct Project {
    position: In<[f32; 4]>,
    meta: In<u32>,
    id: Out<u32>,
    depth: Out<u32>,
    subpixel: Out<u32>,
    projected: Out<[u32; 2]>,
    cells: Out<u32>,
}

impl Stage for Project {
    const KIND: &'static str = "project";
    const DOC: &'static str =
        "Projects the point cloud: the nearest point of each pixel, its depth, its place in the pixel.";
    type Params = ProjectParams;

    fn declare(params: &ProjectParams, io: &mut Io) -> Self {
        io.column(column::P2);
        io.per_view();
        let mut cloud = io.bundle(Access::Read, "cloud", POINTS, Extent::Any);
        let (position, meta) = (cloud.read("position"), cloud.read("meta"));
        let pixels = Extent::Frame(1);
        let points = || Extent::Like("cloud".into());
        let id = io.write("id", ID, pixels.clone());
        let depth = io.write(
            "depth",
            DEPTH.doc("Bits of its distance along the axis, metres; infinity if none."),
            pixels.clone(),
        );
        let subpixel =
            io.write("subpixel", CELL.doc("Its cell in the pixel, row by row; 0 if none."), pixels.clone());
        let projected =
            io.write("projected", scratch("Each point's pixel and bits of its distance."), points());
        let cells = io.write("cells", scratch("Each point's cell in its pixel."), points());

        io.shader(shader!("project"));
        io.constants(CONSTANTS);
        match params.method {
            Method::TwoPass => {
                io.dispatch("clear", id);
                io.dispatch("project", position);
                io.dispatch("claim", position);
            }
            Method::Atomic64 => {
                io.needs_atomic64();
                io.define("ATOMIC64");
                let keys: Out<[u32; 2]> = io.write("keys", scratch("The least depth and id."), pixels);
                io.dispatch("clear", keys);
                io.dispatch("project", position);
            }
            Method::Raster => {
                io.define("RASTER");
                let drawn: Out<texel::R32Uint> =
                    io.write("drawn", scratch("The point that was drawn."), pixels);
                io.pass(Pass::Draw {
                    vertex: "vertex".into(),
                    fragment: "fragment".into(),
                    shape: Shape::Points,
                    vertices: 1,
                    count: position.into(),
                    targets: vec![drawn.into()],
                    depth: true,
                    clear: NO_POINT.into(),
                });
            }
        }
        io.dispatch("resolve", id);
        Self { position, meta, id, depth, subpixel, projected, cells }
    }

    fn cpu(&self, params: &ProjectParams, cx: &CpuContext) -> Result<(), String> {
        let frame = cx.frame();
        let (position, meta) = (&cx.read(self.position)[..], &cx.read(self.meta)[..]);
        let (id, depth) = (&mut cx.write(self.id)[..], &mut cx.write(self.depth)[..]);
        let subpixel = &mut cx.write(self.subpixel)[..];
        let (projected, cells) = (&mut cx.write(self.projected)[..], &mut cx.write(self.cells)[..]);

        let level = cx.level();
        let axis = 1 << (params.subpixel_bits / 2);
        let points = position.par_chunks(CHUNK).zip(meta.par_chunks(CHUNK));
        let found = projected.par_chunks_mut(CHUNK).zip(cells.par_chunks_mut(CHUNK));
        points.zip(found).for_each(|((position, meta), (projected, cells))| {
            dispatch!(level, simd => {
                project(simd, frame, params.max_age, axis, (position, meta), (projected, cells))
            });
        });

        // Each thread owns a band of the image and processes all points in the order of their ids.
        let band = id.len().div_ceil(rayon::current_num_threads());
        let bands =
            id.par_chunks_mut(band).zip(depth.par_chunks_mut(band)).zip(subpixel.par_chunks_mut(band));
        bands.enumerate().for_each(|(index, ((id, depth), subpixel))| {
            let band = Band { first: (index * band) as u32, id, depth, subpixel };
            band.claim(level, projected, cells);
        });
        Ok(())
    }

    fn explain(&self, params: &ProjectParams, site: &Site) -> Option<Vec<Finding>> {
        explain::at(self, params, site)
    }
}

fn is_drawn(meta: u32, max_age: u32) -> bool {
    meta & LIVE != 0 && (meta & AGE) / AGE_ONE <= max_age
}

/// Writes pixel, bits of the distance, and cell of points. The cell of one that is not drawn means nothing.
#[inline(always)]
fn project<S: Simd>(
    simd: S,
    frame: &Frame,
    max_age: u32,
    axis: u32,
    (position, meta): (&[[f32; 4]], &[u32]),
    (projected, cells): (&mut [[u32; 2]], &mut [u32]),
) {
    let splat = |number: u32| u32x8::splat(simd, number);
    for first in (0..meta.len()).step_by(LANES) {
        let lanes = Lanes::project(simd, &frame.view, &padded(position, first), frame.size);
        let meta = u32x8::load_array(simd, padded(meta, first));
        // As [`is_drawn`].
        let is_live = (meta & LIVE).simd_ne(splat(0));
        let is_young = ((meta & AGE) >> AGE_ONE.trailing_zeros()).simd_le(splat(max_age));
        let is_drawn = lanes.is_drawn & is_live & is_young;
        let [x, y] = lanes.pixel();
        let pixel = is_drawn.select(y * splat(frame.size[0]) + x, splat(NOT_DRAWN));
        let depth = is_drawn.select(lanes.depth(), splat(EMPTY_DEPTH));
        let (low, high) = simd.interleave_u32x8(pixel, depth);
        let count = LANES.min(cells.len() - first);
        let found: [[u32; 2]; LANES] = bytemuck::cast([low.to_array(), high.to_array()]);
        store(&found, &mut projected[first..][..count]);
        store(&lanes.cell(axis).to_array(), &mut cells[first..][..count]);
    }
}

/// The positions of the points that fall into a pixel, with their ids; the first is the one that the pixel shows: the
/// nearest, and among equally near ones that with the lowest id. This is the rule; [`Band::claim`] finds the first of
/// every pixel.
fn fallen(
    position: &[[f32; 4]],
    meta: &[u32],
    max_age: u32,
    frame: &Frame,
    pixel: [u32; 2],
) -> Vec<(Projected, u32)> {
    let project = |(id, (position, meta)): (u32, (&[f32; 4], &u32))| {
        let point = Projected::of(&frame.view, *position, frame.size)?;
        (is_drawn(*meta, max_age) && point.pixel() == pixel).then_some((point, id))
    };
    let mut fallen: Vec<_> = (0..).zip(position.iter().zip(meta)).filter_map(project).collect();
    fallen.sort_by(|(a, _), (b, _)| a.z.total_cmp(&b.z));
    fallen
}

/// A range of the image's pixels.
struct Band<'a> {
    first: u32,
    id: &'a mut [u32],
    depth: &'a mut [u32],
    subpixel: &'a mut [u32],
}

impl Band<'_> {
    /// Lists those of up to [`CHUNK`] points that fall into the band; returns how many.
    #[inline(always)]
    fn select<S: Simd>(&self, simd: S, projected: &[[u32; 2]], list: &mut [u32; CHUNK + LANES]) -> usize {
        let lanes = u32x8::from_fn(simd, |lane| lane as u32);
        let mut count = 0;
        for (first, group) in projected.chunks(LANES).enumerate() {
            let mut pixels = [NOT_DRAWN; LANES];
            pixels.iter_mut().zip(group).for_each(|(own, [pixel, _])| *own = *pixel);
            let place = u32x8::load_array(simd, pixels) - u32x8::splat(simd, self.first);
            // [`NOT_DRAWN`] is beyond all pixels.
            let is_mine = place.simd_lt(u32x8::splat(simd, self.id.len() as u32));
            let points = lanes + u32x8::splat(simd, (first * LANES) as u32);
            count += append(simd, points, is_mine, &mut list[count..]);
        }
        count
    }

    fn claim(self, level: Level, projected: &[[u32; 2]], cells: &[u32]) {
        self.id.fill(NO_POINT);
        self.depth.fill(EMPTY_DEPTH);
        self.subpixel.fill(0);
        let mut mine = [0; CHUNK + LANES];
        for (chunk, projected) in projected.chunks(CHUNK).enumerate() {
            // First selects the band's points without a branch, which could not be predicted.
            let count = dispatch!(level, simd => self.select(simd, projected, &mut mine));
            for i in mine[..count].iter().map(|&i| i as usize) {
                let [pixel, depth] = projected[i];
                let at = (pixel - self.first) as usize;
                // The bits of positive floats are ordered like the floats; ids come in ascending order.
                if depth < self.depth[at] {
                    self.depth[at] = depth;
                    self.id[at] = (chunk * CHUNK + i) as u32;
                    self.subpixel[at] = cells[chunk * CHUNK + i];
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use epigraph_core::{Harness, View, testing::gpu};

    use super::*;
    use crate::shared::testing::{Both, Random, run_alike, run_both, settings};

    const METHODS: [Method; 3] = [Method::TwoPass, Method::Atomic64, Method::Raster];

    fn harness(params: ProjectParams, size: [u32; 2], points: &[([f32; 4], u32)]) -> Harness<Project> {
        let mut harness = Harness::new(params, &settings(size, 0));
        harness.frame.view = View { near: 0.5, far: 100.0, ..View::default() };
        harness.set("cloud.position", &points.iter().map(|point| point.0).collect::<Vec<_>>());
        harness.set("cloud.meta", &points.iter().map(|point| point.1).collect::<Vec<_>>());
        harness
    }

    /// A point at distance z that projects to the middle of pixel (2, 1) of a 4x4 image.
    fn at(z: f32) -> [f32; 4] {
        [0.25 * z, 0.25 * z, -z, 1.0]
    }

    #[test]
    fn the_nearest_live_point_wins() {
        let old = LIVE | (201 * AGE_ONE);
        let points = [(at(5.0), LIVE), (at(3.0), LIVE), (at(2.0), 0), (at(2.5), old), (at(3.0), LIVE)];
        for method in METHODS {
            let params = ProjectParams { method, max_age: 200, ..ProjectParams::default() };
            let mut harness = harness(params, [4, 4], &points);
            let both = run_both(&mut harness);
            for out in [both.cpu, both.gpu] {
                let pixel = 4 + 2;
                // Points 1 and 4 are equally near, so the lower id wins. Point 2 is dead, and point 3 is too old.
                let expected: Vec<u32> = (0..16).map(|p| if p == pixel { 1 } else { NO_POINT }).collect();
                assert_eq!(out.get::<u32>("id"), expected, "{method:?}");
                let depth = out.get::<u32>("depth");
                assert_eq!((f32::from_bits(depth[pixel]), depth[0]), (3.0, EMPTY_DEPTH));
                let subpixel = out.get::<u32>("subpixel");
                assert_eq!((subpixel[pixel], subpixel[0]), (8 * 16 + 8, 0));
            }
        }
    }

    #[test]
    fn age_255_is_drawn_by_default() {
        let mut harness = harness(ProjectParams::default(), [4, 4], &[(at(2.0), LIVE | AGE)]);
        assert_eq!(run_alike(&mut harness).get::<u32>("id")[6], 0);
    }

    #[test]
    fn far_points_and_directions_fill_the_background() {
        let points = [(at(1e5), LIVE), ([-0.25, 0.25, -1.0, 0.0], LIVE)];
        for method in METHODS {
            let mut harness = harness(ProjectParams { method, ..ProjectParams::default() }, [4, 4], &points);
            let both = run_both(&mut harness);
            for out in [both.cpu, both.gpu] {
                let (id, depth) = (out.get::<u32>("id"), out.get::<u32>("depth"));
                assert_eq!((id[6], id[5]), (0, 1), "{method:?}");
                assert_eq!([depth[6], depth[5]].map(f32::from_bits), [100.0, 100.0], "{method:?}");
            }
        }
    }

    #[test]
    fn four_bits_give_four_cells_per_axis() {
        // At (0.8, 0.3) of pixel (2, 1) of 4x4: column 3, row 1 of its cells.
        let point = [0.4, 0.35, -1.0, 1.0];
        let cell = |subpixel_bits| {
            let params = ProjectParams { subpixel_bits, ..ProjectParams::default() };
            run_alike(&mut harness(params, [4, 4], &[(point, LIVE)])).get::<u32>("subpixel")[6]
        };
        assert_eq!(cell(4), 4 + 3);
        assert_eq!(cell(8), 16 * 4 + 12);
        assert_eq!(cell(2), 1);
    }

    #[test]
    fn an_empty_cloud_leaves_empty_pixels() {
        let mut harness = harness(ProjectParams::default(), [3, 2], &[([0.0; 4], 0)]);
        let both = run_both(&mut harness);
        for out in [both.cpu, both.gpu] {
            assert_eq!(out.get::<u32>("id"), [NO_POINT; 6]);
            assert_eq!(out.get::<u32>("depth"), [EMPTY_DEPTH; 6]);
        }
    }

    /// A cloud in and around the view. Some points are dead, not finite, far away, behind the eye or at infinity.
    fn cloud(count: usize) -> Vec<([f32; 4], u32)> {
        let mut random = Random(7);
        let point = |i: usize| {
            let z = random.between(0.2, 130.0);
            let mut p = [random.between(-1.2, 1.2) * z, random.between(-1.2, 1.2) * z, -z, 1.0];
            match i % 20 {
                0 => p[2] = z,
                1 => p[3] = 0.0,
                2 => p[random.below(3) as usize] = f32::NAN,
                3 => p = p.map(|c| c * 1e30),
                _ => {}
            }
            (p, if i.is_multiple_of(7) { AGE } else { LIVE })
        };
        (0..count).map(point).collect()
    }

    /// How many pixels may differ: `on_hardware` on a GPU, none on a software GPU, which rounds like the twin.
    fn roundings(on_hardware: usize) -> usize {
        if gpu().is_software() { 0 } else { on_hardware }
    }

    /// Asserts that at most `allowed` pixels show another point, and that the depths of the others differ by at most 2
    /// ulps.
    fn compare(both: &Both, allowed: usize) {
        let (cpu, gpu) = (both.cpu.get::<u32>("id"), both.gpu.get::<u32>("id"));
        assert!(cpu.iter().filter(|&&id| id != NO_POINT).count() > cpu.len() / 4);
        let same = |p: &usize| cpu[*p] == gpu[*p];
        let differing = cpu.len() - (0..cpu.len()).filter(same).count();
        assert!(differing <= allowed, "{differing} pixels show another point");
        let (cpu_depth, gpu_depth) = (both.cpu.get::<u32>("depth"), both.gpu.get::<u32>("depth"));
        // The dot product is rounded twice, so it may differ by two ulps. Differences of floats' bits are in ulps.
        let apart = |p: usize| cpu_depth[p].abs_diff(gpu_depth[p]);
        let worst = (0..cpu.len()).filter(same).map(apart).max();
        assert!(worst <= Some(2), "{worst:?} ulps");
    }

    #[test]
    fn each_pixel_shows_the_nearest_of_its_points() {
        let size = [17, 11];
        for (tan, eye) in [(1.0, [0.0; 3]), (8.7e-4, [1e7, -1e7, 1e7]), (114.6, [-1e7, 0.0, 3.0])] {
            let mut points: Vec<_> = cloud(1500)
                .into_iter()
                .map(|([x, y, z, w], meta)| ([x * tan + eye[0], y * tan + eye[1], z + eye[2], w], meta))
                .collect();
            // Copies, which are equally near, with other ids.
            points.extend_from_within(..500);
            let params = ProjectParams { max_age: 254, ..ProjectParams::default() };
            let mut harness = harness(params, size, &points);
            harness.frame.view = View { eye, tan_x: tan, tan_y: tan, ..harness.frame.view };
            let out = run_alike(&mut harness);
            let found = [out.get::<u32>("id"), out.get("depth"), out.get("subpixel")];
            let (position, meta): (Vec<_>, Vec<_>) = points.into_iter().unzip();
            for pixel in 0..size[0] * size[1] {
                let fallen =
                    fallen(&position, &meta, 254, &harness.frame, [pixel % size[0], pixel / size[0]]);
                let expected = match fallen.first() {
                    Some((point, id)) => [*id, point.z.to_bits(), point.cell(16)],
                    None => [NO_POINT, EMPTY_DEPTH, 0],
                };
                assert_eq!([0, 1, 2].map(|port| found[port][pixel as usize]), expected, "pixel {pixel}");
            }
            assert!(found[0].iter().any(|&id| id != NO_POINT));
        }
    }

    #[test]
    fn both_sides_agree() {
        let points = cloud(20_000);
        for method in METHODS {
            for subpixel_bits in [4, 8] {
                let params = ProjectParams { method, subpixel_bits, ..ProjectParams::default() };
                let mut harness = harness(params, [101, 77], &points);
                let both = run_both(&mut harness);
                // A shader may fuse or reorder operations, and so round differently: a point within a rounding error of
                // a pixel's or cell's border may fall into the neighbouring one.
                compare(&both, roundings(8));
                both.assert_equal_but::<u32>("subpixel", roundings(24));
            }
        }
    }

    #[test]
    fn extreme_views_agree() {
        // At 1e7 metres, f32 has steps of a metre. So in the narrow field of view the cloud must be far away: nearer,
        // all of its points would fall into one pixel.
        for (tan, eye, far) in [(8.7e-4, [1e7, -1e7, 1e7], 1e5), (114.6, [-1e7, 0.0, 3.0], 1.0)] {
            let place = |[x, y, z, w]: [f32; 4]| {
                [x * tan * far + eye[0], y * tan * far + eye[1], z * far + eye[2], w]
            };
            let points: Vec<_> = cloud(20_000).into_iter().map(|(at, meta)| (place(at), meta)).collect();
            let mut harness = harness(ProjectParams::default(), [64, 64], &points);
            let view = harness.frame.view;
            harness.frame.view = View { eye, tan_x: tan, tan_y: tan, far: far * view.far, ..view };
            let both = run_both(&mut harness);
            compare(&both, roundings(64));
        }
    }

    #[test]
    fn points_on_the_border_of_the_view() {
        // 4x4 pixels, a view as wide as it is far, near plane 0.5, far plane 100.
        for (point, pixel) in [
            // The left and upper border belong to the image, the right and lower one do not.
            ([-1.0, 1.0, -1.0, 1.0], Some(0)),
            ([1.0, 0.0, -1.0, 1.0], None),
            ([0.0, -1.0, -1.0, 1.0], None),
            ([0.999, -0.999, -1.0, 1.0], Some(15)),
            // The near plane does too; what is beyond the far plane counts as on it.
            ([0.0, 0.0, -0.5, 1.0], Some(10)),
            ([0.0, 0.0, -0.499_999_97, 1.0], None),
            ([0.0, 0.0, -100.0, 1.0], Some(10)),
            // Directions have no near plane.
            ([0.0, 0.0, -f32::MIN_POSITIVE, 0.0], Some(10)),
            ([0.0, 0.0, 0.0, 0.0], None),
        ] {
            let mut harness = harness(ProjectParams::default(), [4, 4], &[(point, LIVE)]);
            let id = run_alike(&mut harness).get::<u32>("id");
            assert_eq!(id.iter().position(|&id| id == 0), pixel, "{point:?}");
        }
    }

    #[test]
    fn points_of_the_maximum_age_are_drawn() {
        let params = ProjectParams { max_age: 200, ..ProjectParams::default() };
        let drawn = |age: u32| {
            let points = [(at(2.0), LIVE | age)];
            run_alike(&mut harness(params.clone(), [4, 4], &points)).get::<u32>("id")[6] == 0
        };
        assert!(drawn(200 * AGE_ONE + 255) && !drawn(201 * AGE_ONE));
    }
}
