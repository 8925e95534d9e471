//! How bodies and lights of the scene have moved since the last frame; the stage `carry` moves the points with them.

use epigraph_core::{CpuContext, Facts, Io, Out, Stage};

use crate::{
    World, column, facts,
    meaning::{self, MOVES},
    shared::moves::{Blocker, Lamp, Move},
};

/// Provides the motion of a frame from the [`World`] to other stages: on the CPU only.
pub struct Motion {
    moves: Out<Move>,
    lights_before: Out<Lamp>,
    lights: Out<Lamp>,
    blockers_before: Out<Blocker>,
    blockers: Out<Blocker>,
}

impl Stage for Motion {
    const KIND: &'static str = "motion";
    const DOC: &'static str = "How bodies and lights of the scene have moved since the last frame.";
    type Params = ();

    fn declare((): &(), io: &mut Io) -> Self {
        io.column(column::P1);
        let doc = "By body number; number 0, for everything static, does not move.";
        Self {
            moves: io.write("moves", MOVES.doc(doc), facts::MOVES.list()),
            lights_before: io.write(
                "lights_before",
                meaning::LIGHTS.doc("The lights of the last frame."),
                facts::LIGHTS.list(),
            ),
            blockers_before: io.write(
                "blockers_before",
                meaning::BLOCKERS.doc("The boxes of the bodies in the last frame."),
                facts::BLOCKERS.list(),
            ),
            blockers: io.write(
                "blockers",
                meaning::BLOCKERS.doc("The boxes of the bodies in this frame, in the same order."),
                facts::BLOCKERS.list(),
            ),
            lights: io.write(
                "lights",
                meaning::LIGHTS.doc("The lights of this frame, in the same order."),
                facts::LIGHTS.list(),
            ),
        }
    }

    fn cpu(&self, (): &(), cx: &CpuContext) -> Result<(), String> {
        let world = cx.host::<World>()?;
        let scene = world.tracer.scene();
        let index = cx.frame().index;
        // The first frame has no points that could have moved.
        let [now, before] = [index, index.saturating_sub(1)].map(|frame| scene.poses_at(frame));
        if now == before {
            cx.blank(self.moves);
        }
        let mut moves = cx.write(self.moves);
        moves.fill(Move::REST);
        for ((to, now), before) in moves[1..].iter_mut().zip(&now).zip(&before) {
            if now != before {
                *to = Move::of(&now.after(&before.inverse()));
            }
        }
        let of_frame =
            [(self.lights_before, self.blockers_before, before), (self.lights, self.blockers, now)];
        for (lights, blockers, poses) in of_frame {
            let mut blockers = cx.write(blockers);
            blockers.fill(Blocker::NONE);
            let bodies = (1..).zip(scene.bodies.iter().zip(&poses));
            let boxes = bodies.map(|(number, (body, pose))| Blocker::of(body, number, pose));
            blockers.iter_mut().zip(boxes.filter(|new| new.body != 0)).for_each(|(out, new)| *out = new);
            let mut out = cx.write(lights);
            out.fill(Lamp::NONE);
            let lamps = scene.posed_lights(&poses);
            let lamps = lamps.iter().map(Lamp::of).filter(|lamp| lamp.power > 0.0);
            out.iter_mut().zip(lamps).for_each(|(out, lamp)| *out = lamp);
        }
        Ok(())
    }

    fn needless((): &(), facts: &Facts) -> Option<&'static str> {
        (facts.count(facts::BODIES) == Some(0)).then_some("nothing moves")
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use epigraph_core::{Harness, Host, Settings, Side};
    use epigraph_scenes::{Scene, Tracer};
    use glam::Vec3;

    use super::*;
    use crate::{Pace, shared::testing::settings};

    #[test]
    fn moves_take_points_from_the_last_frame_to_this_one() {
        let scene = Arc::new(Scene::load("cornell-moving").unwrap());
        let mut host = Host::default();
        host.insert(World::new(Arc::new(Tracer::new(scene.clone())), Pace::Exact, 1));
        let facts = World::facts(&scene, false);
        let mut harness = Harness::<Motion>::new((), &Settings { facts, ..settings([4, 4], 1) });
        let point = Vec3::new(0.3, 0.2, 0.1);
        for index in [0, 1, 2, 17, 59, 60] {
            harness.frame.index = index;
            let out = harness.run(Side::Cpu, &crate::registry(), &host, None).unwrap();
            let moves = out.get::<Move>("moves");
            assert_eq!((moves.len(), moves[0]), (scene.bodies.len() + 1, Move::REST));
            let lamp = |frame| Lamp::of(&scene.posed_lights(&scene.poses_at(frame))[0]);
            assert_eq!(out.get::<Lamp>("lights_before"), [lamp(index.saturating_sub(1))]);
            assert_eq!(out.get::<Lamp>("lights"), [lamp(index)]);
            let blockers = out.get::<Blocker>("blockers");
            assert_eq!(blockers.iter().map(|blocker| blocker.body).collect::<Vec<_>>(), [1, 2, 3, 4]);
            for (body, of) in scene.bodies.iter().enumerate() {
                let [now, before] = [index, index.saturating_sub(1)].map(|frame| of.motion.pose(frame));
                let moved = moves[body + 1].point(before.point(point).to_array());
                assert!(Vec3::from(moved).distance(now.point(point)) < 1e-6, "frame {index}");
                assert_eq!(moves[body + 1] != Move::REST, now != before, "frame {index}");
            }
        }
    }

    #[test]
    fn the_stage_is_skipped_if_nothing_moves() {
        let bodies = |count| Facts::none().with(facts::BODIES, count);
        assert!(Motion::needless(&(), &bodies(0)).is_some());
        assert!(Motion::needless(&(), &bodies(1)).is_none());
    }
}
