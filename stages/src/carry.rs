//! Moves the points of moving bodies, and ages points where the light changes.

use epigraph_core::{Access, CpuContext, Extent, Facts, In, Io, Out, Stage};
use rayon::prelude::*;

use crate::{
    column, facts,
    meaning::{BLOCKERS, LIGHTS, MOVES, POINTS},
    shared::{
        cloud::{AGE, AGE_ONE, BODY_SHIFT, FRESH, LIVE},
        estimate::Estimate,
        moves::{Blocker, Lamp, Move},
    },
};

epigraph_core::constants! {
    /// The share by which a point's radiance may change while a body moves between it and its light.
    const SHADOW_DOUBT: f32 = 0.25;
    /// The share by which it may change while its body turns.
    const TURN_DOUBT: f32 = 0.05;
}

/// Points per parallel task.
const CHUNK: usize = 16384;

epigraph_core::params! {
    /// How points change where something moves.
    pub struct CarryParams {
        /// Age added in each frame in which a point's body moves: it turns towards the light or away from it.
        penalty: f32 = 2.0, in 0.0..=255.0, unit "age";
        /// Age added for each per cent by which the light arriving at a point changes in a frame, computed from the
        /// positions of the lights.
        relight: f32 = 32.0, in 0.0..=255.0, unit "age";
        /// Age added in each frame in which a body, by its bounding box, moves between a point and its light, or a
        /// light moves behind a body; proportional if that is only a part of the light.
        shadow: f32 = 64.0, in 0.0..=255.0, unit "age";
        /// Whether the cloud keeps the means of points' samples. They count for less where the light changes.
        accumulate: bool = false;
        /// The most samples that a mean counts for where the light changes.
        most: f32 = 64.0, in 1.0..=65536.0, unit "samples";
    }
}

/// Moves the points of moved bodies rigidly with them, so that they stay where they were hit: on the surface on which
/// edges are found. Samples of the last frame's scene are in the cloud by now, and move like all others.
///
/// Colours are not changed, and are out of date where the light has changed. Such points age faster, in proportion to
/// the change: they are sampled again sooner, and leave the cloud sooner. The stage only knows the unoccluded light and
/// the boxes of bodies. Other shadows, such as those of static objects in a moving light, are detected when new samples
/// have other colours (see `integrate`).
pub struct Carry {
    cloud_position: Out<[f32; 4]>,
    cloud_meta: Out<u32>,
    /// The two fields of the points' estimates, if samples accumulate.
    means: Option<[Out<[f32; 4]>; 2]>,
    moves: In<Move>,
    lights_before: In<Lamp>,
    lights: In<Lamp>,
    blockers_before: In<Blocker>,
    blockers: In<Blocker>,
}

impl Stage for Carry {
    const KIND: &'static str = "carry";
    const DOC: &'static str =
        "Moves points with the bodies on which they were hit; ages them where the light changes.";
    type Params = CarryParams;

    fn declare(params: &Self::Params, io: &mut Io) -> Self {
        io.column(column::P1);
        let mut cloud = io.bundle(Access::Update, "cloud", POINTS, Extent::Any);
        let cloud_position = cloud.write("position");
        let cloud_meta = cloud.write("meta");
        let means = params.accumulate.then(|| [cloud.write("mean"), cloud.write("record")]);
        let moves = io.read("moves", MOVES, Extent::Any);
        let lights_before =
            io.read("lights_before", LIGHTS.doc("The lights of the last frame."), Extent::Any);
        let lights =
            io.read("lights", LIGHTS.doc("The lights of this frame."), Extent::Like("lights_before".into()));
        let blockers_before = io.read(
            "blockers_before",
            BLOCKERS.doc("The boxes of the bodies in the last frame."),
            Extent::Any,
        );
        let same = Extent::Like("blockers_before".into());
        let blockers = io.read("blockers", BLOCKERS.doc("The boxes of the bodies in this frame."), same);
        io.shader(shader!("carry"));
        io.constants(CONSTANTS);
        if params.accumulate {
            io.define("ACCUMULATE");
        }
        io.dispatch("main", cloud_meta);
        io.per_arrival(moves);
        Self { cloud_position, cloud_meta, means, moves, lights_before, lights, blockers_before, blockers }
    }

    fn cpu(&self, params: &Self::Params, cx: &CpuContext) -> Result<(), String> {
        let moves = cx.read(self.moves);
        let [lights_before, lights_now] = [self.lights_before, self.lights].map(|lights| cx.read(lights));
        let [boxes_before, boxes_now] = [self.blockers_before, self.blockers].map(|boxes| cx.read(boxes));
        let (mut position, mut meta) = (cx.write(self.cloud_position), cx.write(self.cloud_meta));
        let moves = &moves[..];
        let lamps = lights_now.iter().take_while(|lamp| lamp.power > 0.0).count();
        let boxes = boxes_now.iter().take_while(|body| body.body != 0).count();
        let before = Light { lamps: &lights_before[..lamps], boxes: &boxes_before[..boxes] };
        let now = Light { lamps: &lights_now[..lamps], boxes: &boxes_now[..boxes] };
        if before == now && moves.iter().all(|move_by| *move_by == Move::REST) {
            return Ok(());
        }
        let carry = |position: &mut [[f32; 4]], meta: &mut [u32], mut means: Option<[&mut [[f32; 4]]; 2]>| {
            for (index, (position, meta)) in position.iter_mut().zip(meta).enumerate() {
                // A source of samples may name bodies that the scene does not have.
                let move_by = moves.get((*meta >> BODY_SHIFT) as usize).unwrap_or(&Move::REST);
                let rests = *move_by == Move::REST;
                if *meta & LIVE == 0 {
                    continue;
                }
                let [x, y, z, w] = *position;
                let here = [x, y, z];
                let there = if rests { here } else { move_by.point(here) };
                *position = [there[0], there[1], there[2], w];
                // A point at infinity emits its own light.
                if *meta & FRESH != 0 || w == 0.0 {
                    continue;
                }
                let change = change(before.at(here), now.at(there));
                let shadowed = shadowed(&before, &now, here, there, *meta >> BODY_SHIFT);
                let turn = if rests { 0.0 } else { params.penalty };
                let penalty = turn + params.relight * 100.0 * change + params.shadow * shadowed;
                let penalty = penalty.min(255.0) * AGE_ONE as f32;
                *meta = (*meta & !AGE) | ((*meta & AGE) + penalty.round_ties_even() as u32).min(AGE);
                if let Some([mean, record]) = &mut means {
                    let change = change + SHADOW_DOUBT * shadowed + if rests { 0.0 } else { TURN_DOUBT };
                    if change > 0.0 {
                        let estimate = Estimate::load(mean[index], record[index]);
                        [mean[index], record[index]] = estimate.doubt(change, params.most).store();
                    }
                }
            }
        };
        let points = position.par_chunks_mut(CHUNK).zip(meta.par_chunks_mut(CHUNK));
        if let Some([mean, record]) = self.means {
            let [mut mean, mut record] = [cx.write(mean), cx.write(record)];
            let means = mean.par_chunks_mut(CHUNK).zip(record.par_chunks_mut(CHUNK));
            points.zip(means).for_each(|((position, meta), (mean, record))| {
                carry(position, meta, Some([mean, record]));
            });
        } else {
            points.for_each(|(position, meta)| carry(position, meta, None));
        }
        Ok(())
    }

    fn needless(_: &Self::Params, facts: &Facts) -> Option<&'static str> {
        (facts.count(facts::BODIES) == Some(0)).then_some("nothing moves")
    }
}

/// The lights of a frame, and what may occlude them.
#[derive(PartialEq)]
struct Light<'a> {
    lamps: &'a [Lamp],
    boxes: &'a [Blocker],
}

impl Light<'_> {
    /// Luminance of the unoccluded light at a point.
    fn at(&self, point: [f32; 3]) -> f32 {
        self.lamps.iter().map(|lamp| lamp.at(point)).sum()
    }
}

/// The share of a point's light that is or was partly occluded by a body, other than the point's own, that moves
/// relative to the light.
fn shadowed(before: &Light, now: &Light, here: [f32; 3], there: [f32; 3], own: u32) -> f32 {
    let (mut light, mut covered) = (0.0, 0.0);
    for (lamp_before, lamp) in before.lamps.iter().zip(now.lamps) {
        let luminance = lamp.at(there);
        if luminance == 0.0 {
            continue;
        }
        light += luminance;
        let same_lamp = (lamp_before.position, lamp_before.normal) == (lamp.position, lamp.normal);
        let covers = |(was, is): (&Blocker, &Blocker)| {
            is.body != own
                && !(was == is && same_lamp)
                && (was.covers(lamp_before, here) || is.covers(lamp, there))
        };
        if before.boxes.iter().zip(now.boxes).any(covers) {
            covered += luminance;
        }
    }
    if light > 0.0 { covered / light } else { 0.0 }
}

/// The relative difference of two luminances, as a share of the larger.
fn change(before: f32, now: f32) -> f32 {
    let larger = before.max(now);
    if larger > 0.0 { (before - now).abs() / larger } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use epigraph_core::Harness;
    use epigraph_scenes::Pose;
    use glam::{Quat, Vec3};

    use super::*;
    use crate::shared::{
        cloud::CHANGED,
        testing::{Random, run_alike, run_both, settings},
    };

    const LAMP: Lamp = Lamp { position: [0.0, 4.0, 0.0], power: 8.0, normal: [0.0, -1.0, 0.0], ..Lamp::NONE };

    fn harness(
        positions: &[[f32; 4]],
        meta: &[u32],
        moves: &[Move],
        lamps: [Lamp; 2],
        boxes: [Blocker; 2],
    ) -> Harness<Carry> {
        with(
            CarryParams { penalty: 3.5, relight: 2.0, shadow: 10.0, ..CarryParams::default() },
            positions,
            meta,
            moves,
            lamps,
            boxes,
        )
    }

    fn with(
        params: CarryParams,
        positions: &[[f32; 4]],
        meta: &[u32],
        moves: &[Move],
        [before, now]: [Lamp; 2],
        boxes: [Blocker; 2],
    ) -> Harness<Carry> {
        let mut harness = Harness::new(params, &settings([8, 8], 16));
        harness.set("cloud.position", positions);
        harness.set("cloud.meta", meta);
        harness.set("moves", moves);
        harness.set("lights_before", &[before, Lamp::NONE]);
        harness.set("lights", &[now, Lamp::NONE]);
        harness.set("blockers_before", &[boxes[0], Blocker::NONE]);
        harness.set("blockers", &[boxes[1], Blocker::NONE]);
        harness
    }

    fn pose(random: &mut Random) -> Pose {
        let mut between = |size: f32| random.between(-size, size);
        let rotation = Quat::from_euler(glam::EulerRot::XYZ, between(3.0), between(1.0), between(3.0));
        Pose { rotation, translation: Vec3::new(between(2.0), between(2.0), between(2.0)) }
    }

    /// A cube with sides of length 2, 2 below the lamp, at the given x: body 3.
    fn cube(x: f32) -> Blocker {
        let [row_x, row_y] = [[1.0, 0.0, 0.0, -x], [0.0, 1.0, 0.0, -2.0]];
        Blocker { x: row_x, y: row_y, extent: [1.0; 3], body: 3, ..Blocker::NONE }
    }

    #[test]
    fn points_in_the_shadow_of_a_moved_box_age() {
        // Its upper edges cast its shadow on the floor, from x = -4 to 4. If the cube is at x = 1, its edges are at 0
        // and 2, and the shadow is 4 farther to the right.
        let positions = [-4.5, -3.0, 3.0, 5.0, 9.0].map(|x| [x, 0.0, 0.0, 1.0]);
        let ages = |boxes, body: u32| {
            let meta = [LIVE | body << BODY_SHIFT; 5];
            let out = run_alike(&mut harness(&positions, &meta, &[Move::REST; 4], [LAMP; 2], boxes));
            out.get::<u32>("cloud.meta").iter().map(|meta| meta & AGE).collect::<Vec<_>>()
        };
        let ten = 10 * 256;
        assert_eq!(ages([cube(0.0), cube(1.0)], 0), [0, ten, ten, ten, 0]);
        assert_eq!(ages([cube(1.0), cube(1.0)], 0), [0; 5], "the box has not moved");
        assert_eq!(ages([cube(0.0), cube(1.0)], 3), [0; 5], "a body does not occlude its own points");
    }

    #[test]
    fn a_box_at_rest_shades_anew_where_the_lamp_moves_or_turns() {
        // Below the middle of the box: it keeps all light out. Without ageing by the light itself.
        let age = |boxes: [Blocker; 2], now: Lamp| {
            let params = CarryParams { penalty: 0.0, relight: 0.0, shadow: 10.0, ..CarryParams::default() };
            let mut harness =
                with(params, &[[0.0, 0.0, 0.0, 1.0]], &[LIVE], &[Move::REST], [LAMP, now], boxes);
            (run_alike(&mut harness).get::<u32>("cloud.meta")[0] & AGE) / 256
        };
        let still = [cube(0.0); 2];
        assert_eq!(age(still, LAMP), 0);
        assert_eq!(age(still, Lamp { power: 4.0, ..LAMP }), 0, "it only shines less");
        for axis in 0..3 {
            let mut moved = LAMP;
            moved.position[axis] += 0.125;
            assert_eq!(age(still, moved), 10, "along axis {axis}");
            let mut turned = LAMP;
            turned.normal[axis] += 0.125;
            assert_eq!(age(still, turned), 10, "about axis {axis}");
        }
        // Each row of the box's pose counts.
        for row in 0..3 {
            let mut moved = cube(0.0);
            [&mut moved.x, &mut moved.y, &mut moved.z][row][3] += 0.125;
            assert_eq!(age([cube(0.0), moved], LAMP), 10, "row {row}");
        }
    }

    #[test]
    fn a_box_beyond_the_lamp_or_behind_the_point_shades_nothing() {
        // The cube moves from x = 0 to 0.25, from y = 1 to 3, between the lamp at 4 and the floor.
        let boxes = [cube(0.0), cube(0.25)];
        let age = |point: f32, lamp: f32| {
            let lamp = Lamp { position: [0.0, lamp, 0.0], normal: [0.0; 3], uniform_share: 1.0, ..LAMP };
            let positions = [[0.0, point, 0.0, 1.0]];
            let out = run_alike(&mut harness(&positions, &[LIVE], &[Move::REST], [lamp; 2], boxes));
            (out.get::<u32>("cloud.meta")[0] & AGE) / 256
        };
        for (point, lamp, expected) in
            [(0.0, 4.0, 10), (0.0, 2.0, 10), (0.0, 0.75, 0), (3.25, 4.0, 0), (4.0, 3.5, 0)]
        {
            assert_eq!(age(point, lamp), expected, "from {point} to {lamp}");
            assert_eq!(age(lamp, point), expected, "from {lamp} to {point}");
        }
    }

    #[test]
    fn a_line_through_a_corner_of_a_box_meets_it() {
        // The corner (3, 4, 12) is 13 from the middle of the box, and the line through it is tangent to the ball around
        // the box. All numbers are whole, and so exact.
        let corner = Blocker { extent: [3.0, 4.0, 12.0], body: 3, ..cube(0.0) };
        let corner = Blocker { x: [1.0, 0.0, 0.0, 0.0], y: [0.0, 1.0, 0.0, 0.0], ..corner };
        let away = Blocker { x: [1.0, 0.0, 0.0, 1000.0], ..corner };
        let lamp = Lamp { position: [7.0, -8.0, 15.0], normal: [0.0; 3], uniform_share: 1.0, ..LAMP };
        let positions = [[-1.0, 16.0, 9.0, 1.0], [-1.0, 16.0, 9.5, 1.0]];
        let out = run_alike(&mut harness(&positions, &[LIVE; 2], &[Move::REST], [lamp; 2], [away, corner]));
        let ages: Vec<u32> = out.get::<u32>("cloud.meta").iter().map(|meta| (meta & AGE) / 256).collect();
        assert_eq!(ages, [10, 0]);
    }

    #[test]
    fn points_of_moved_bodies_move_and_age() {
        let shift = Pose { translation: Vec3::X, ..Pose::REST };
        let moves = [Pose::REST, Pose::REST, shift].map(|pose| Move::of(&pose));
        let of = |body: u32| LIVE | body << BODY_SHIFT;
        // Points of static geometry, of a body at rest, and of a moving body: old, fresh, almost too old. An empty
        // slot.
        let meta =
            [of(0) | 7, of(1) | 7, of(2) | CHANGED | 7, of(2) | FRESH, of(2) | 0xFFF0, 2 << BODY_SHIFT];
        let dark = [Lamp::NONE; 2];
        let out =
            run_alike(&mut harness(&[[1.0, 2.0, 3.0, 1.0]; 6], &meta, &moves, dark, [cube(0.0), cube(1.0)]));
        let x: Vec<f32> = out.get::<[f32; 4]>("cloud.position").iter().map(|p| p[0]).collect();
        assert_eq!(x, [1.0, 1.0, 2.0, 2.0, 2.0, 1.0]);
        let aged = [meta[0], meta[1], meta[2] + 3 * 256 + 128, meta[3], of(2) | AGE, meta[5]];
        assert_eq!(out.get::<u32>("cloud.meta"), aged);
    }

    #[test]
    fn every_number_of_a_motion_counts() {
        let positions = [[1.0, 2.0, 3.0, 1.0]];
        for (row, column) in (0..3).flat_map(|row| (0..4).map(move |column| (row, column))) {
            let mut motion = Move::REST;
            [&mut motion.x, &mut motion.y, &mut motion.z][row][column] += 0.25;
            let dark = [Lamp::NONE; 2];
            let out = run_alike(&mut harness(&positions, &[LIVE], &[motion], dark, [Blocker::NONE; 2]));
            let mut expected = positions[0];
            expected[row] += 0.25 * positions[0][column];
            assert_eq!(out.get::<[f32; 4]>("cloud.position"), [expected], "row {row}, column {column}");
            assert_eq!(out.get::<u32>("cloud.meta"), [LIVE | (3 * 256 + 128)], "row {row}, column {column}");
        }
    }

    #[test]
    fn points_age_by_the_change_of_light() {
        // The lamp rises from 4 to 5 straight above the point: 16/25 of the light is left, 36% less, which adds 72 to
        // the age.
        let higher = Lamp { position: [0.0, 5.0, 0.0], ..LAMP };
        let positions = [[0.0, 0.0, 0.0, 1.0], [0.0, 6.0, 0.0, 1.0], [0.0, -1.0, 0.0, 0.0]];
        let ages = |lamps| {
            let out =
                run_alike(&mut harness(&positions, &[LIVE; 3], &[Move::REST], lamps, [Blocker::NONE; 2]));
            assert_eq!(out.get::<[f32; 4]>("cloud.position"), positions);
            out.get::<u32>("cloud.meta").iter().map(|meta| meta & AGE).collect::<Vec<_>>()
        };
        // Points behind the lamp are dark before and after, and lamps do not light the background.
        assert_eq!(ages([LAMP, higher]), [72 * 256, 0, 0]);
        assert_eq!(ages([higher, LAMP]), [72 * 256, 0, 0]);
        assert_eq!(ages([LAMP, LAMP]), [0; 3]);
        // A point light shines upwards too: the distance is 2, then 1, so the light changes by 75%.
        let point = |lamp: Lamp| Lamp { normal: [0.0; 3], uniform_share: 1.0, ..lamp };
        assert_eq!(ages([LAMP, higher].map(point)), [72 * 256, 150 * 256, 0]);
    }

    #[test]
    fn both_sides_agree() {
        let mut random = Random(8);
        let one = |random: &mut Random, body| match body % 3 {
            0 => Move::REST,
            _ => Move::of(&pose(random)),
        };
        let moves: Vec<Move> = (0..256).map(|body| one(&mut random, body)).collect();
        let count = 20_000;
        let positions: Vec<[f32; 4]> = (0..count)
            .map(|_| {
                let [x, y, z] = [0; 3].map(|_| random.between(-3.0, 3.0));
                [x, y, z, random.below(2) as f32]
            })
            .collect();
        let meta: Vec<u32> = (0..count).map(|_| random.bits()).collect();
        for now in [LAMP, Lamp { position: [0.1, 4.0, 0.2], uniform_share: 0.3, ..LAMP }] {
            let both = run_both(&mut harness(&positions, &meta, &moves, [LAMP, now], [cube(0.0), cube(0.1)]));
            // A few rounding errors of sums of four terms up to 3.
            both.assert_close("cloud.position", 2e-6);
            let [cpu, gpu] = [&both.cpu, &both.gpu].map(|out| out.get::<u32>("cloud.meta"));
            // The change of light is a difference of two rounded numbers: a relative error of 1e-6 is a twentieth of a
            // unit of age. A line that grazes the box may hit or miss it.
            let near = |(a, b): &(&u32, &u32)| *a & !AGE == *b & !AGE && (*a & AGE).abs_diff(*b & AGE) <= 1;
            let far = cpu.iter().zip(&gpu).filter(|pair| !near(pair)).count();
            assert!(far < 5, "{far}");
            let differ = cpu.iter().zip(&gpu).filter(|(a, b)| a != b).count();
            assert!(differ < count / 20, "{differ}");
            assert_ne!(cpu, meta);
        }
    }

    #[test]
    fn the_stage_is_skipped_if_nothing_moves() {
        let params = CarryParams::default();
        let bodies = |count| Facts::none().with(facts::BODIES, count);
        assert!(Carry::needless(&params, &bodies(0)).is_some());
        assert!(Carry::needless(&params, &bodies(1)).is_none());
    }

    #[test]
    fn points_age_by_255_in_a_frame_at_most() {
        // All light goes: 200; the body moves: 100.
        let params = CarryParams { penalty: 100.0, relight: 2.0, shadow: 0.0, ..CarryParams::default() };
        let mut harness = Harness::<Carry>::new(params, &settings([8, 8], 16));
        harness.set("cloud.position", &[[0.0, 0.0, 0.0, 1.0f32]]);
        harness.set("cloud.meta", &[LIVE | 1 << BODY_SHIFT]);
        let above = Pose { translation: Vec3::Y * 5.0, ..Pose::REST };
        harness.set("moves", &[Move::REST, Move::of(&above)]);
        harness.set("lights_before", &[LAMP, Lamp::NONE]);
        harness.set("lights", &[LAMP, Lamp::NONE]);
        harness.set("blockers_before", &[Blocker::NONE]);
        harness.set("blockers", &[Blocker::NONE]);
        let meta = run_alike(&mut harness).get::<u32>("cloud.meta")[0];
        assert_eq!(meta & AGE, 255 * 256);
    }

    #[test]
    fn means_count_for_less_where_the_light_changes() {
        let params = CarryParams { accumulate: true, ..CarryParams::default() };
        let run = |now: Lamp, boxes: [Blocker; 2], moves: &[Move], meta: u32| {
            let mut harness =
                with(params.clone(), &[[0.0, 0.0, 0.0, 1.0]], &[meta], moves, [LAMP, now], boxes);
            harness.set("cloud.mean", &[[2.0f32, 2.0, 2.0, 0.001]]);
            harness.set("cloud.record", &[[0.0f32, 1.0, 0.0, 100.0]]);
            let out = run_alike(&mut harness);
            (out.get::<[f32; 4]>("cloud.mean")[0][3], out.get::<[f32; 4]>("cloud.record")[0][3])
        };
        let none = [Blocker::NONE; 2];
        let rests = [Move::REST; 4];
        assert_eq!(run(LAMP, none, &rests, LIVE), (0.001, 100.0), "nothing changes");
        // The variance of one sample is 0.1. Half of the light: the mean counts for 64 samples at most, and its variance
        // grows by (0.5 * 2)^2.
        let expected = |change: f32| {
            let variance = 0.1 / 64.0 + (change * 2.0).powi(2);
            (variance, 0.1 / variance)
        };
        let close = |got: (f32, f32), expected: (f32, f32)| {
            let is_close = (got.0 / expected.0 - 1.0).abs() < 1e-5 && (got.1 / expected.1 - 1.0).abs() < 1e-5;
            assert!(is_close, "{got:?} {expected:?}");
        };
        let dimmed = Lamp { power: 4.0, ..LAMP };
        close(run(dimmed, none, &rests, LIVE), expected(0.5));
        close(run(LAMP, [cube(0.0), cube(0.1)], &rests, LIVE), expected(SHADOW_DOUBT));
        let turns = [Move { x: [1.0, 0.0, 0.0, 1e-7], ..Move::REST }];
        close(run(LAMP, none, &turns, LIVE), expected(TURN_DOUBT));
        assert_eq!(
            run(dimmed, none, &rests, LIVE | FRESH),
            (0.001, 100.0),
            "a fresh point has the new light"
        );
    }

    #[test]
    fn both_sides_doubt_alike() {
        let mut random = Random(31);
        let params = CarryParams { accumulate: true, ..CarryParams::default() };
        let mut between = |low, high| random.between(low, high);
        let positions: Vec<_> =
            (0..500).map(|_| [between(-5.0, 5.0), 0.0, between(-5.0, 5.0), 1.0]).collect();
        let moved = Lamp { position: [0.1, 4.0, 0.0], ..LAMP };
        let moves = [Move::REST; 4];
        let mut harness =
            with(params, &positions, &[LIVE; 500], &moves, [LAMP, moved], [cube(0.0), cube(1.0)]);
        let mean: Vec<_> = (0..500).map(|_| [0; 4].map(|_| between(0.0, 1.0))).collect();
        harness.set("cloud.mean", &mean);
        harness
            .set("cloud.record", &(0..500).map(|_| [0.0, 1.0, 0.0, between(0.5, 100.0)]).collect::<Vec<_>>());
        let both = run_both(&mut harness);
        both.assert_close("cloud.mean", 1e-4);
        both.assert_close("cloud.record", 1e-4);
    }
}
