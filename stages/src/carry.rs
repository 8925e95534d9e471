//! Takes the points of a body along when it moves, and ages points where the light changes.

use epigraph_core::{Access, CpuContext, Extent, Facts, In, Io, Out, Stage, shader};
use rayon::prelude::*;

use crate::shared::{
    cloud::{AGE, AGE_ONE, BODY_SHIFT, FRESH, LIVE},
    moves::{Lamp, Move},
};

/// Points that a thread takes at a time.
const CHUNK: usize = 16384;

epigraph_core::params! {
    /// What becomes of points where something moves.
    pub struct CarryParams {
        /// Age added in each frame in which a point's body moves: it turns towards the light or away.
        penalty: f32 = 2.0, in 0.0..=255.0, unit "age";
        /// Age added for each per cent by which the light that arrives at a point changes in a frame, as far as that follows
        /// from where the lights are.
        relight: f32 = 16.0, in 0.0..=255.0, unit "age";
    }
}

/// Moves the points of moved bodies rigidly with them, so that they stay where they were hit: on the surface that edges are
/// found on. Samples that came for the last frame's scene are in the cloud by now, and are moved like all others.
///
/// Colours stay as they were, and where the light is another they are out of date. Such points age faster, the more the
/// light has changed: they are seen anew sooner, and leave the cloud sooner. Known of the light is what arrives
/// where nothing is in the way; moved shadows show where new samples have other colours (see `integrate`).
pub struct Carry {
    cloud_position: Out<[f32; 4]>,
    cloud_meta: Out<u32>,
    moves: In<Move>,
    lights_before: In<Lamp>,
    lights: In<Lamp>,
}

impl Stage for Carry {
    const KIND: &'static str = "carry";
    const DOC: &'static str =
        "Moves points with the bodies on which they were hit; ages them where the light changes.";
    type Params = CarryParams;

    fn declare(_: &Self::Params, io: &mut Io) -> Self {
        let mut cloud = io.bundle(Access::Update, "cloud", "The points.", Extent::Any);
        let cloud_position = cloud.write("position");
        let cloud_meta = cloud.write("meta");
        let moves = io.read("moves", "How each body has moved since the last frame.", Extent::Any);
        let lights_before = io.read("lights_before", "The lights of the last frame.", Extent::Any);
        let lights = io.read("lights", "The lights of this frame.", Extent::Like("lights_before".into()));
        io.shader(shader!("carry"));
        io.dispatch("main", cloud_meta);
        Self { cloud_position, cloud_meta, moves, lights_before, lights }
    }

    fn cpu(&self, params: &Self::Params, cx: &CpuContext) -> Result<(), String> {
        let (moves, before, now) = (cx.read(self.moves), cx.read(self.lights_before), cx.read(self.lights));
        let (mut position, mut meta) = (cx.write(self.cloud_position), cx.write(self.cloud_meta));
        let (moves, before, now) = (&moves[..], &before[..], &now[..]);
        let same_lights = before == now;
        position.par_chunks_mut(CHUNK).zip(meta.par_chunks_mut(CHUNK)).for_each(|(position, meta)| {
            for (position, meta) in position.iter_mut().zip(meta) {
                let move_by = &moves[(*meta >> BODY_SHIFT) as usize];
                let rests = *move_by == Move::REST;
                if *meta & LIVE == 0 || rests && same_lights {
                    continue;
                }
                let [x, y, z, w] = *position;
                let here = [x, y, z];
                let there = if rests { here } else { move_by.point(here) };
                *position = [there[0], there[1], there[2], w];
                // What is infinitely far away sends its own light.
                if *meta & FRESH != 0 || w == 0.0 {
                    continue;
                }
                let change = change(light(before, here), light(now, there));
                let turn = if rests { 0.0 } else { params.penalty };
                let penalty = (turn + params.relight * 100.0 * change).min(255.0) * AGE_ONE as f32;
                *meta = (*meta & !AGE) | ((*meta & AGE) + penalty.round_ties_even() as u32).min(AGE);
            }
        });
        Ok(())
    }

    fn needless(_: &Self::Params, facts: &Facts) -> Option<&'static str> {
        (facts.bodies == 0).then_some("nothing moves")
    }
}

/// Luminance of all light at a point.
fn light(lights: &[Lamp], point: [f32; 3]) -> f32 {
    lights.iter().map(|lamp| lamp.at(point)).sum()
}

/// How far two luminances are apart, as a share of the larger.
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
        testing::{Random, run_both, run_cpu, settings},
    };

    const LAMP: Lamp =
        Lamp { position: [0.0, 4.0, 0.0], power: 8.0, normal: [0.0, -1.0, 0.0], uniform_share: 0.0 };

    fn harness(
        positions: &[[f32; 4]],
        meta: &[u32],
        moves: &[Move],
        [before, now]: [Lamp; 2],
    ) -> Harness<Carry> {
        let params = CarryParams { penalty: 3.5, relight: 2.0 };
        let mut harness = Harness::new(params, &settings([8, 8], 16));
        harness.set("cloud.position", positions);
        harness.set("cloud.meta", meta);
        harness.set("moves", moves);
        harness.set("lights_before", &[before, Lamp::NONE]);
        harness.set("lights", &[now, Lamp::NONE]);
        harness
    }

    fn pose(random: &mut Random) -> Pose {
        let mut between = |size: f32| random.between(-size, size);
        let rotation = Quat::from_euler(glam::EulerRot::XYZ, between(3.0), between(1.0), between(3.0));
        Pose { rotation, translation: Vec3::new(between(2.0), between(2.0), between(2.0)) }
    }

    #[test]
    fn points_of_moved_bodies_move_and_age() {
        let shift = Pose { translation: Vec3::X, ..Pose::REST };
        let moves = [Pose::REST, Pose::REST, shift].map(|pose| Move::of(&pose));
        let of = |body: u32| LIVE | body << BODY_SHIFT;
        // What stands still, a body that rests, one that moves: old, fresh, almost too old; an empty slot.
        let meta =
            [of(0) | 7, of(1) | 7, of(2) | CHANGED | 7, of(2) | FRESH, of(2) | 0xFFF0, 2 << BODY_SHIFT];
        let dark = [Lamp::NONE; 2];
        let out = run_cpu(&mut harness(&[[1.0, 2.0, 3.0, 1.0]; 6], &meta, &moves, dark));
        let x: Vec<f32> = out.get::<[f32; 4]>("cloud.position").iter().map(|p| p[0]).collect();
        assert_eq!(x, [1.0, 1.0, 2.0, 2.0, 2.0, 1.0]);
        let aged = [meta[0], meta[1], meta[2] + 3 * 256 + 128, meta[3], of(2) | AGE, meta[5]];
        assert_eq!(out.get::<u32>("cloud.meta"), aged);
    }

    #[test]
    fn points_age_by_the_change_of_light() {
        // From a height of 4 to one of 5, straight above: 16/25 of the light is left, 36% less, 72 of age.
        let higher = Lamp { position: [0.0, 5.0, 0.0], ..LAMP };
        let positions = [[0.0, 0.0, 0.0, 1.0], [0.0, 6.0, 0.0, 1.0], [0.0, -1.0, 0.0, 0.0]];
        let ages = |lamps| {
            let out = run_cpu(&mut harness(&positions, &[LIVE; 3], &[Move::REST], lamps));
            assert_eq!(out.get::<[f32; 4]>("cloud.position"), positions);
            out.get::<u32>("cloud.meta").iter().map(|meta| meta & AGE).collect::<Vec<_>>()
        };
        // Behind the lamp it is dark before and after; and no lamp lights the background.
        assert_eq!(ages([LAMP, higher]), [72 * 256, 0, 0]);
        assert_eq!(ages([higher, LAMP]), [72 * 256, 0, 0]);
        assert_eq!(ages([LAMP, LAMP]), [0; 3]);
        // A point light shines upwards, too: the distance is 2, then 1. 75%.
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
            let both = run_both(&mut harness(&positions, &meta, &moves, [LAMP, now]));
            // Some roundings of sums of four terms up to 3.
            both.assert_close("cloud.position", 2e-6);
            let [cpu, gpu] = [&both.cpu, &both.gpu].map(|out| out.get::<u32>("cloud.meta"));
            // The change of light is a difference of two numbers that round: off by 1e-6 of them, it is a twentieth of
            // a unit of age.
            let near = |(a, b): (&u32, &u32)| a & !AGE == b & !AGE && (a & AGE).abs_diff(b & AGE) <= 1;
            assert!(cpu.iter().zip(&gpu).all(near));
            let differ = cpu.iter().zip(&gpu).filter(|(a, b)| a != b).count();
            assert!(differ < count / 20, "{differ}");
            assert_ne!(cpu, meta);
        }
    }

    #[test]
    fn needless_where_nothing_moves() {
        let params = CarryParams::default();
        assert!(Carry::needless(&params, &Facts::default()).is_some());
        assert!(Carry::needless(&params, &Facts { bodies: 1, ..Facts::default() }).is_none());
    }
}
