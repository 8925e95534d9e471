//! Finds the boundaries of shadows as segments in the world (`algorithms.md` section 2.1). They do not depend on the
//! view, so they are searched once for a scene, again only where something has moved, and written only when they have
//! changed: on the CPU only.

use std::sync::{Arc, Mutex, PoisonError, Weak};

use epigraph_core::{CpuContext, Extent, Facts, Io, Out, Rule, Stage, params};
use epigraph_scenes::{ShadowKind, ShadowSegment, ShadowSegments, ShadowSettings};

use crate::{
    World, column, facts,
    meaning::{COUNT, SHADOWS},
    shared::segments::{SHADOW_HARD, SHADOW_PENUMBRA, SHADOW_UMBRA, Segment, shadow_flags},
};

params! {
    /// Parameters of [`ShadowEdges`].
    pub struct ShadowEdgesParams {
        /// Maximum number of segments; if there are more, long ones with a narrow penumbra are kept. 0: by the number of
        /// edges and lights in the scene.
        capacity: u32 = 0, in 0..=4194304, unit "segments";
        /// How close to its blocker an object shows no boundary on itself; a share of the light's distance from the
        /// blocker. A tenth of it for boundaries on other objects.
        contact: f32 = 0.002, in 0.0..=1.0;
        /// Boundaries of wider penumbrae are left out; a share of the diagonal of the scene's bounds. At the default, a
        /// penumbra that is left out is narrower than two pixels only where the whole scene is smaller than 100 pixels.
        max_penumbra: f32 = 0.02, in 0.0..=1.0;
    }
}

/// Finds the hard boundaries of point lights and the umbra and penumbra boundaries of quad lights in the scene of the
/// [`World`]; see [`epigraph_scenes::ShadowSearch`]. The flags of a segment are those of [`shadow_flags`].
///
/// With [`Pace::Exact`](crate::Pace::Exact) a frame waits for the result of its scene. With
/// [`Pace::Async`](crate::Pace::Async) no frame waits: there are no segments until background threads have found them,
/// and after a movement the old ones stay until then. The [`World`] keeps the result, so that a recompile finds it
/// again.
pub struct ShadowEdges {
    segments: Out<Segment>,
    count: Out<u32>,
    dropped: Out<u32>,
    written: Mutex<Written>,
}

/// The number of boundaries is at most the length of their list.
const NUMBER: &[Rule] = &[Rule::count_of("shadow boundaries")];

/// What the outputs contain.
#[derive(Default)]
enum Written {
    /// The memory's content at compilation.
    #[default]
    Unknown,
    /// No segments, because the search is still running.
    Nothing,
    /// The result of a search.
    Found(Weak<ShadowSegments>),
}

impl Stage for ShadowEdges {
    const KIND: &'static str = "shadow_edges";
    const DOC: &'static str = "Finds the boundaries of shadows: once, and again where something has moved.";
    type Params = ShadowEdgesParams;

    fn declare(params: &Self::Params, io: &mut Io) -> Self {
        io.column(column::E1);
        io.seldom();
        let number = Extent::Fixed([1, 1]);
        let room = match params.capacity {
            0 => facts::SHADOW_SEGMENTS.list(),
            capacity => Extent::Fixed([capacity, 1]),
        };
        Self {
            segments: io.persistent(
                "segments",
                SHADOWS.doc(
                    "The boundaries; flags have their kind in bits 0 and 1, and the penumbra's width in the high half.",
                ),
                room,
            ),
            count: io.persistent(
                "count",
                COUNT.doc("The number of boundaries; 0 while the search runs.").within(NUMBER),
                number.clone(),
            ),
            dropped: io.persistent("dropped", "The number of boundaries that were dropped for lack of room.", number),
            written: Mutex::default(),
        }
    }

    fn cpu(&self, params: &Self::Params, cx: &CpuContext) -> Result<(), String> {
        let settings = ShadowSettings {
            capacity: cx.dims(self.segments).count(),
            contact: params.contact,
            max_penumbra: params.max_penumbra,
            ..ShadowSettings::default()
        };
        let world = cx.host::<World>()?;
        let found = world.shadows.find(&world.at(cx.frame().index), settings, world.pace())?;
        let mut written = self.written.lock().unwrap_or_else(PoisonError::into_inner);
        let unchanged = match (&*written, &found) {
            (Written::Nothing, None) => true,
            (Written::Found(before), Some(found)) => Weak::as_ptr(before) == Arc::as_ptr(found),
            _ => false,
        };
        if unchanged {
            cx.unchanged(self.segments);
            cx.unchanged(self.count);
            cx.unchanged(self.dropped);
            return Ok(());
        }
        let (list, dropped) =
            found.as_ref().map_or((&[][..], 0), |found| (&found.segments[..], found.dropped));
        let mut segments = cx.write(self.segments);
        segments.fill(Segment::default());
        for (out, segment) in segments.iter_mut().zip(list) {
            *out = flagged(segment);
        }
        // At most the capacity, which has 32 bits.
        cx.write(self.count)[0] = list.len() as u32;
        cx.write(self.dropped)[0] = u32::try_from(dropped).unwrap_or(u32::MAX);
        *written = found.map_or(Written::Nothing, |found| Written::Found(Arc::downgrade(&found)));
        Ok(())
    }

    fn needless(_: &Self::Params, facts: &Facts) -> Option<&'static str> {
        (facts.holds(facts::SHADOW_CASTERS) == Some(false)).then_some("no light casts shadows")
    }
}

fn flagged(segment: &ShadowSegment) -> Segment {
    let kind = match segment.kind {
        ShadowKind::Hard => SHADOW_HARD,
        ShadowKind::Umbra => SHADOW_UMBRA,
        ShadowKind::Penumbra => SHADOW_PENUMBRA,
    };
    let [a, b] = segment.ends.map(Into::into);
    Segment { a, flags: shadow_flags(kind, segment.penumbra), b, edge: segment.edge }
}

#[cfg(test)]
mod tests {
    use epigraph_core::{Harness, Host, Outputs, Settings, Side};
    use epigraph_scenes::{Light, Scene, Tracer, shadow_segments};

    use super::*;
    use crate::{
        Pace,
        shared::{segments::penumbra_width, testing::settings},
    };

    fn tracer() -> Arc<Tracer> {
        Arc::new(Tracer::new(Arc::new(Scene::load("cornell").unwrap())))
    }

    fn host(tracer: &Arc<Tracer>, exact: bool) -> Host {
        let pace = if exact { Pace::Exact } else { Pace::Async };
        let mut host = Host::default();
        host.insert(World::new(tracer.clone(), pace, 1));
        host
    }

    fn params(capacity: u32) -> ShadowEdgesParams {
        ShadowEdgesParams { capacity, max_penumbra: 1.0, ..ShadowEdgesParams::default() }
    }

    fn harness(params: ShadowEdgesParams) -> Harness<ShadowEdges> {
        Harness::new(params, &settings([4, 4], 1))
    }

    fn run(harness: &mut Harness<ShadowEdges>, host: &Host) -> Outputs {
        harness.run(Side::Cpu, &crate::registry(), host, None).unwrap()
    }

    /// The expected output of the stage, as found by `scenes`.
    fn expected(tracer: &Tracer) -> Vec<Segment> {
        let settings = ShadowSettings { max_penumbra: 1.0, ..ShadowSettings::default() };
        let found = shadow_segments(tracer, &settings, &|_| true).unwrap();
        assert!(found.segments.len() > 50);
        found.segments.iter().map(flagged).collect()
    }

    #[test]
    fn with_exact_pace_every_frame_has_all_segments() {
        let tracer = tracer();
        let (expected, host) = (expected(&tracer), host(&tracer, true));
        let mut harness = harness(params(1000));
        for _ in 0..3 {
            let out = run(&mut harness, &host);
            let (segments, count) = (out.get::<Segment>("segments"), out.get::<u32>("count")[0] as usize);
            assert_eq!(segments[..count], expected);
            assert!(segments[count..].iter().all(|&segment| segment == Segment::default()));
            assert_eq!(out.get::<u32>("dropped"), [0]);
        }
    }

    #[test]
    fn without_a_capacity_there_is_room_for_the_boundaries_of_the_scene() {
        for name in ["cornell", "cornell-moving", "chains"] {
            let tracer = Arc::new(Tracer::new(Arc::new(Scene::load(name).unwrap())));
            let facts = World::facts(tracer.scene(), false);
            let room = facts.count(facts::SHADOW_SEGMENTS).unwrap() as usize;
            let settings = Settings { facts, ..settings([4, 4], 1) };
            let mut harness = Harness::new(params(0), &settings);
            let host = host(&tracer, true);
            for index in [0, 30, 60] {
                harness.frame.index = index;
                let out = run(&mut harness, &host);
                assert_eq!(
                    (out.get::<Segment>("segments").len(), &out.get::<u32>("dropped")[..]),
                    (room, &[0][..])
                );
                assert_eq!(out.get::<u32>("count")[0] as usize, expected(&tracer.at(index)).len(), "{name}");
            }
        }
        let room = |name: &str| {
            let facts = World::facts(&Scene::load(name).unwrap(), false);
            facts.count(facts::SHADOW_SEGMENTS).unwrap()
        };
        assert!(room("cornell") < 500 && room("chains") < 1 << 16);
    }

    #[test]
    fn the_world_knows_how_many_boundaries_had_no_room() {
        let tracer = tracer();
        let host = host(&tracer, true);
        let dropped = || host.get::<World>().unwrap().dropped_shadows();
        assert_eq!(dropped(), 0);
        run(&mut harness(params(10)), &host);
        assert_eq!(dropped(), expected(&tracer).len() - 10);
    }

    #[test]
    fn with_asynchronous_pace_frames_have_no_segments_until_all_are_found() {
        let tracer = tracer();
        let (expected, host) = (expected(&tracer), host(&tracer, false));
        let mut harness = harness(params(1000));
        // Waits for at most ten seconds.
        for _ in 0..1000 {
            let out = run(&mut harness, &host);
            let count = out.get::<u32>("count")[0] as usize;
            if count > 0 {
                assert_eq!(out.get::<Segment>("segments")[..count], expected);
                return;
            }
            std::thread::sleep(std::time::Duration::from_millis(10));
        }
        panic!("no shadow edges");
    }

    #[test]
    fn a_recompiled_stage_and_a_second_one_use_the_cached_searches() {
        let tracer = tracer();
        let host = host(&tracer, true);
        let world = host.get::<World>().unwrap();
        let find = |capacity| {
            let settings = ShadowSettings { capacity, max_penumbra: 1.0, ..ShadowSettings::default() };
            world.shadows.find(&tracer, settings, world.pace()).unwrap().unwrap()
        };
        let (mut one, mut other) = (harness(params(1000)), harness(params(10)));
        run(&mut one, &host);
        run(&mut other, &host);
        let before = [1000, 10].map(find);
        assert_eq!(world.shadows.kept().len(), 2);
        one.reset();
        run(&mut one, &host);
        run(&mut other, &host);
        let after = [1000, 10].map(find);
        assert!(before.iter().zip(&after).all(|(a, b)| Arc::ptr_eq(a, b)));
        assert_eq!(world.shadows.kept().len(), 2);
    }

    #[test]
    fn the_oldest_searches_are_evicted_from_the_cache() {
        let tracer = tracer();
        let host = host(&tracer, true);
        for capacity in 1..10 {
            let out = run(&mut harness(params(capacity)), &host);
            assert_eq!(out.get::<u32>("count"), [capacity]);
            assert!(out.get::<u32>("dropped")[0] > 0);
        }
        let kept = host.get::<World>().unwrap().shadows.kept();
        assert_eq!(kept.iter().map(|settings| settings.capacity).collect::<Vec<_>>(), [6, 7, 8, 9]);
    }

    #[test]
    fn each_frame_has_the_shadows_of_its_scene() {
        let tracer = Arc::new(Tracer::new(Arc::new(Scene::load("cornell-moving").unwrap())));
        let host = host(&tracer, true);
        let mut harness = harness(params(1000));
        for index in [0, 1, 50, 50] {
            harness.frame.index = index;
            let out = run(&mut harness, &host);
            let count = out.get::<u32>("count")[0] as usize;
            assert_eq!(out.get::<Segment>("segments")[..count], expected(&tracer.at(index)), "frame {index}");
        }
    }

    #[test]
    fn flags_hold_the_kind_and_the_width() {
        let tracer = tracer();
        let out = run(&mut harness(params(1000)), &host(&tracer, true));
        let settings = ShadowSettings { max_penumbra: 1.0, ..ShadowSettings::default() };
        let found = shadow_segments(&tracer, &settings, &|_| true).unwrap().segments;
        for (segment, found) in out.get::<Segment>("segments").iter().zip(&found) {
            let kind =
                [ShadowKind::Hard, ShadowKind::Umbra, ShadowKind::Penumbra][segment.flags as usize & 3];
            assert_eq!(kind, found.kind);
            // The width is rounded up to 8 bits of precision.
            let width = penumbra_width(segment.flags) / found.penumbra;
            assert!((1.0..1.01).contains(&width), "{width}");
        }
    }

    #[test]
    fn the_stage_is_skipped_if_no_light_casts_shadows() {
        let mut scene = Scene::load("cornell").unwrap();
        let facts = World::facts(&scene, false);
        assert_eq!(ShadowEdges::needless(&params(1), &facts), None);
        scene.lights.retain(|light| matches!(light, Light::Point { .. }));
        let facts = World::facts(&scene, false);
        assert_eq!(ShadowEdges::needless(&params(1), &facts), Some("no light casts shadows"));
        // If it runs nevertheless, it finds no boundaries.
        let tracer = Arc::new(Tracer::new(Arc::new(scene)));
        let settings = Settings { facts, ..settings([4, 4], 1) };
        let mut harness = Harness::<ShadowEdges>::new(params(5), &settings);
        assert_eq!(run(&mut harness, &host(&tracer, true)).get::<u32>("count"), [0]);
    }
}
