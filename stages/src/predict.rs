//! Which parts of the image have no points in the predicted view, so that samples can be requested before the gaps
//! become visible (`algorithms.md` section 1.8). At a quarter of the resolution on each axis, without depth.

use std::sync::Mutex;

use epigraph_core::{Access, CpuContext, Extent, Facts, Finding, Frame, In, Io, Out, Site, Stage};
use fearless_simd::{Simd, dispatch, prelude::*, u32x8};
use rayon::prelude::*;

use crate::{
    column, facts,
    meaning::{OCCUPANCY, POINTS},
    shared::{
        cloud::LIVE,
        lanes::{LANES, append, padded},
        view::Lanes,
    },
};

#[path = "explain/predict.rs"]
mod explain;

epigraph_core::constants! {
    /// Pixels on each side of a cell of `occupancy`.
    pub const CELL: u32 = 4;
}

/// Points per parallel task on the CPU.
const CHUNK: usize = 4096;

/// See the module.
pub struct Predict {
    position: In<[f32; 4]>,
    meta: In<u32>,
    occupancy: Out<u32>,
}

impl Stage for Predict {
    const KIND: &'static str = "predict";
    const DOC: &'static str =
        "Where the cloud will have points from the predicted camera, at a quarter of the resolution.";
    type Params = ();

    fn declare(_: &(), io: &mut Io) -> Self {
        io.column(column::P3);
        io.per_view();
        let mut cloud = io.bundle(Access::Read, "cloud", POINTS, Extent::Any);
        let (position, meta) = (cloud.read("position"), cloud.read("meta"));
        let occupancy = io.write(
            "occupancy",
            OCCUPANCY.doc(
                "1 where a point falls into the 4x4 pixels, else 0; 1 everywhere while the camera rests.",
            ),
            Extent::Frame(CELL),
        );
        io.shader(shader!("predict"));
        io.constants(CONSTANTS);
        io.dispatch("clear", occupancy);
        io.dispatch("mark", position);
        Self { position, meta, occupancy }
    }

    fn cpu(&self, _: &(), cx: &CpuContext) -> Result<(), String> {
        let (frame, width, level) = (cx.frame(), cx.dims(self.occupancy).width, cx.level());
        let (position, meta) = (&cx.read(self.position)[..], &cx.read(self.meta)[..]);
        let occupancy = &mut cx.write(self.occupancy)[..];

        if frame.predicted == frame.view {
            occupancy.fill(1);
            return Ok(());
        }
        occupancy.fill(0);
        // Marks may be set in any order, so threads share one lock: projecting costs much more than marking.
        let occupancy = Mutex::new(occupancy);
        position.par_chunks(CHUNK).zip(meta.par_chunks(CHUNK)).for_each(|(position, meta)| {
            let mut cells = [0; CHUNK + LANES];
            let count =
                dispatch!(level, simd => cells_of_points(simd, frame, width, position, meta, &mut cells));
            let mut occupancy = occupancy.lock().expect("marking does not panic");
            for &cell in &cells[..count] {
                occupancy[cell as usize] = 1;
            }
        });
        Ok(())
    }

    fn needless(_: &(), facts: &Facts) -> Option<&'static str> {
        (facts.holds(facts::CAMERA_MOVES) == Some(false)).then_some("the camera does not move")
    }

    fn explain(&self, (): &(), site: &Site) -> Option<Vec<Finding>> {
        explain::at(self, site)
    }
}

/// Lists the cells in which up to [`CHUNK`] points are, in rows of `width` cells; returns how many.
#[inline(always)]
fn cells_of_points<S: Simd>(
    simd: S,
    frame: &Frame,
    width: u32,
    position: &[[f32; 4]],
    meta: &[u32],
    cells: &mut [u32; CHUNK + LANES],
) -> usize {
    let mut count = 0;
    for first in (0..meta.len()).step_by(LANES) {
        let lanes = Lanes::project(simd, &frame.predicted, &padded(position, first), frame.size);
        let meta = u32x8::load_array(simd, padded(meta, first));
        let is_drawn = lanes.is_drawn & (meta & LIVE).simd_ne(u32x8::splat(simd, 0));
        let [x, y] = lanes.pixel().map(|along| along >> CELL.trailing_zeros());
        let cell = y * u32x8::splat(simd, width) + x;
        count += append(simd, cell, is_drawn, &mut cells[count..]);
    }
    count
}

#[cfg(test)]
mod tests {
    use epigraph_core::{Harness, View};

    use super::*;
    use crate::shared::testing::{Random, run_both, settings};

    fn harness(size: [u32; 2], positions: &[[f32; 4]], meta: &[u32]) -> Harness<Predict> {
        let mut harness = Harness::new((), &settings(size, 0));
        harness.set("cloud.position", positions);
        harness.set("cloud.meta", meta);
        harness
    }

    #[test]
    fn points_are_projected_to_the_predicted_view() {
        // The first point is straight ahead of the predicted camera, a unit to the right; the image has 3x2 cells.
        let mut harness = harness([10, 8], &[[1.0, 0.0, -5.0, 1.0], [0.0, 0.0, 5.0, 1.0]], &[LIVE; 2]);
        harness.frame.predicted = View { eye: [1.0, 0.0, 0.0], ..View::default() };
        let both = run_both(&mut harness);
        for out in [both.cpu, both.gpu] {
            assert_eq!(out.get::<u32>("occupancy"), [0, 0, 0, 0, 1, 0]);
        }
    }

    #[test]
    fn dead_points_mark_nothing() {
        let mut harness = harness([4, 4], &[[0.0, 0.0, -5.0, 1.0]], &[0]);
        harness.frame.predicted = View { eye: [0.1, 0.0, 0.0], ..View::default() };
        let both = run_both(&mut harness);
        for out in [both.cpu, both.gpu] {
            assert_eq!(out.get::<u32>("occupancy"), [0]);
        }
    }

    #[test]
    fn all_cells_are_occupied_while_the_camera_rests() {
        let both = run_both(&mut harness([9, 4], &[[0.0, 0.0, -5.0, 1.0]], &[0]));
        for out in [both.cpu, both.gpu] {
            assert_eq!(out.get::<u32>("occupancy"), [1; 3]);
        }
    }

    #[test]
    fn the_stage_is_skipped_for_a_still_camera() {
        let moves = |moves| Facts::none().stating(facts::CAMERA_MOVES, moves);
        assert!(Predict::needless(&(), &moves(false)).is_some());
        assert!(Predict::needless(&(), &moves(true)).is_none());
        assert!(Predict::needless(&(), &Facts::none()).is_none(), "nothing is said about the camera");
    }

    #[test]
    fn both_sides_agree() {
        let mut random = Random(3);
        let positions: Vec<[f32; 4]> = (0..2000)
            .map(|_| {
                let z = random.between(-1.0, 50.0);
                [random.between(-1.1, 1.1) * z, random.between(-1.1, 1.1) * z, -z, random.below(2) as f32]
            })
            .collect();
        let meta: Vec<u32> = (0..2000).map(|_| if random.below(3) == 0 { 0 } else { LIVE }).collect();
        let mut harness = harness([333, 130], &positions, &meta);
        harness.frame.predicted = View { eye: [0.1, 0.0, 0.0], ..View::default() };
        let both = run_both(&mut harness);
        assert!(both.cpu.get::<u32>("occupancy").contains(&1));
        // A point within a rounding error of a cell's border may mark the neighbouring cell.
        both.assert_equal_but::<u32>("occupancy", 4);
    }
}
