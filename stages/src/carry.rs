//! Takes the points of a body along when it moves.

use epigraph_core::{Access, CpuContext, Extent, Facts, In, Io, Out, Stage, shader};
use rayon::prelude::*;

use crate::shared::{
    cloud::{AGE, AGE_ONE, BODY_SHIFT, FRESH, LIVE},
    moves::Move,
};

/// Points that a thread takes at a time.
const CHUNK: usize = 16384;

epigraph_core::params! {
    /// What becomes of points whose body moves.
    pub struct CarryParams {
        /// Age added in each frame in which a point's body moves: the light that falls on it is another there.
        penalty: f32 = 2.0, in 0.0..=255.0, unit "age";
    }
}

/// Moves the points of moved bodies rigidly with them, so that they stay where they were hit: on the surface that edges are
/// found on. Their colours stay, too, and are out of date where the light is another, so they age faster and are seen
/// anew sooner.
///
/// Samples that came for the last frame's scene are in the cloud by now, and are moved like all others.
pub struct Carry {
    cloud_position: Out<[f32; 4]>,
    cloud_meta: Out<u32>,
    moves: In<Move>,
}

impl Stage for Carry {
    const KIND: &'static str = "carry";
    const DOC: &'static str = "Moves points with the bodies on which they were hit.";
    type Params = CarryParams;

    fn declare(_: &Self::Params, io: &mut Io) -> Self {
        let mut cloud = io.bundle(Access::Update, "cloud", "The points.", Extent::Any);
        let cloud_position = cloud.write("position");
        let cloud_meta = cloud.write("meta");
        let moves = io.read("moves", "How each body has moved since the last frame.", Extent::Any);
        io.shader(shader!("carry"));
        io.dispatch("main", cloud_meta);
        Self { cloud_position, cloud_meta, moves }
    }

    fn cpu(&self, params: &Self::Params, cx: &CpuContext) -> Result<(), String> {
        let moves = cx.read(self.moves);
        let (mut position, mut meta) = (cx.write(self.cloud_position), cx.write(self.cloud_meta));
        let penalty = (params.penalty * AGE_ONE as f32).round_ties_even() as u32;
        let moves = &moves[..];
        position.par_chunks_mut(CHUNK).zip(meta.par_chunks_mut(CHUNK)).for_each(|(position, meta)| {
            for (position, meta) in position.iter_mut().zip(meta) {
                let body = (*meta >> BODY_SHIFT) as usize;
                if body == 0 || *meta & LIVE == 0 || moves[body] == Move::REST {
                    continue;
                }
                let [x, y, z, w] = *position;
                let [x, y, z] = moves[body].point([x, y, z]);
                *position = [x, y, z, w];
                if *meta & FRESH == 0 {
                    *meta = (*meta & !AGE) | ((*meta & AGE) + penalty).min(AGE);
                }
            }
        });
        Ok(())
    }

    fn needless(_: &Self::Params, facts: &Facts) -> Option<&'static str> {
        (facts.bodies == 0).then_some("nothing moves")
    }
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

    fn harness(positions: &[[f32; 4]], meta: &[u32], moves: &[Move]) -> Harness<Carry> {
        let mut harness = Harness::new(CarryParams { penalty: 3.5 }, &settings([8, 8], 16));
        harness.set("cloud.position", positions);
        harness.set("cloud.meta", meta);
        harness.set("moves", moves);
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
        let out = run_cpu(&mut harness(&[[1.0, 2.0, 3.0, 1.0]; 6], &meta, &moves));
        let x: Vec<f32> = out.get::<[f32; 4]>("cloud.position").iter().map(|p| p[0]).collect();
        assert_eq!(x, [1.0, 1.0, 2.0, 2.0, 2.0, 1.0]);
        let aged = [meta[0], meta[1], meta[2] + 3 * 256 + 128, meta[3], of(2) | AGE, meta[5]];
        assert_eq!(out.get::<u32>("cloud.meta"), aged);
    }

    #[test]
    fn both_sides_agree() {
        let mut random = Random(8);
        let moves: Vec<Move> = (0..256)
            .map(|body| if body % 3 == 0 { Move::REST } else { Move::of(&pose(&mut random)) })
            .collect();
        let count = 20_000;
        let positions: Vec<[f32; 4]> = (0..count)
            .map(|_| [random.between(-3.0, 3.0), random.between(-3.0, 3.0), random.between(-3.0, 3.0), 1.0])
            .collect();
        let meta: Vec<u32> = (0..count).map(|_| random.bits()).collect();
        let both = run_both(&mut harness(&positions, &meta, &moves));
        both.assert_equal::<u32>("cloud.meta");
        // Some roundings of sums of four terms up to 3.
        both.assert_close("cloud.position", 2e-6);
        assert_ne!(both.cpu.get::<u32>("cloud.meta"), meta);
    }

    #[test]
    fn needless_where_nothing_moves() {
        let params = CarryParams::default();
        assert!(Carry::needless(&params, &Facts::default()).is_some());
        assert!(Carry::needless(&params, &Facts { bodies: 1, ..Facts::default() }).is_none());
    }
}
