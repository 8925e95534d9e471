//! Makes points young while a sample of them is under way.

use epigraph_core::{Access, CpuContext, Extent, In, Io, Out, Stage, scratch};

use crate::{
    column,
    meaning::{POINTS, REQUESTS, SAMPLES},
    shared::{
        cloud::{AGE, LIVE},
        requests::{HIT_NONE, Request, Sample},
    },
};

/// Sets the age of points back to 0 for which a sample was requested in the last frame and none has arrived: they are not
/// requested again while it is under way, and do not die of age before it comes (`algorithms.md` section 12.1). If it never
/// comes, the point is requested again when it has aged like any other.
///
/// Only while the camera rests: in motion, a late sample often renews another point than the one that was requested. Where all
/// samples arrive in the frame after their request, nothing changes, whatever becomes of them.
pub struct Pending {
    cloud_meta: Out<u32>,
    requests: In<Request>,
    samples: In<Sample>,
    answered: Out<u32>,
}

impl Stage for Pending {
    const KIND: &'static str = "pending";
    const DOC: &'static str =
        "Makes points young while a sample of them is under way, so that they are not requested twice.";
    type Params = ();

    fn declare(_: &(), io: &mut Io) -> Self {
        io.column(column::P1);
        let mut cloud = io.bundle(
            Access::Update,
            "cloud",
            POINTS.doc("The points, with this frame's samples among them."),
            Extent::Any,
        );
        let cloud_meta = cloud.write("meta");
        let requests =
            io.history("requests", REQUESTS.doc("What was requested in the last frame."), Extent::Any);
        let samples =
            io.history("samples", SAMPLES.doc("The samples that arrived in the last frame."), Extent::Any);
        // Stamps are frame numbers, so they need no clearing.
        let doc = "Frame number + 1 in which a sample of the point last arrived.";
        let answered = io.persistent("answered", scratch(doc), Extent::Like("cloud".into()));
        io.shader(shader!("pending"));
        io.dispatch("note", samples);
        io.dispatch("rejuvenate", requests);
        io.per_budget();
        Self { cloud_meta, requests, samples, answered }
    }

    fn cpu(&self, (): &(), cx: &CpuContext) -> Result<(), String> {
        if cx.frame().view != cx.frame().previous {
            return Ok(());
        }
        let stamp = cx.frame().index.wrapping_add(1);
        let (requests, samples) = (cx.read(self.requests), cx.read(self.samples));
        let (mut meta, mut answered) = (cx.write(self.cloud_meta), cx.write(self.answered));
        for sample in samples.iter().filter(|sample| sample.hit != HIT_NONE) {
            if let Some(answered) = answered.get_mut(sample.reuse as usize) {
                *answered = stamp;
            }
        }
        for request in &requests[..] {
            let point = request.reuse as usize;
            if point < meta.len() && answered[point] != stamp && meta[point] & LIVE != 0 {
                meta[point] &= !AGE;
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use epigraph_core::{Harness, View};

    use super::*;
    use crate::shared::{
        cloud::{BODY_SHIFT, CHANGED, NO_POINT},
        requests::HIT_SURFACE,
        testing::{Random, run_alike, run_both, settings},
    };

    /// Points that were requested, and those of which samples have arrived.
    fn harness(meta: &[u32], requested: &[u32], arrived: &[u32]) -> Harness<Pending> {
        let mut harness = Harness::new((), &settings([8, 8], requested.len() as u32));
        harness.set("cloud.meta", meta);
        let request = |(pixel, &reuse)| Request { pixel, reuse, ..Request::NONE };
        harness.set("requests", &(0..).zip(requested).map(request).collect::<Vec<_>>());
        let sample = |&reuse: &u32| Sample { hit: HIT_SURFACE, reuse, ..Sample::default() };
        harness.set("samples", &arrived.iter().map(sample).collect::<Vec<_>>());
        harness
    }

    #[test]
    fn requested_points_are_young_unless_their_sample_has_come() {
        let meta = [
            LIVE | 0x80_12,
            LIVE | 0x80_12,
            LIVE | 0x90_00,
            0x80_12,
            5 << BODY_SHIFT | CHANGED | LIVE | 0xFF_FF,
        ];
        let mut harness = harness(&meta, &[NO_POINT, 4, 2, 3, 5, 1], &[2, NO_POINT, 9]);
        let expected = [LIVE | 0x80_12, LIVE, LIVE | 0x90_00, 0x80_12, 5 << BODY_SHIFT | CHANGED | LIVE];
        assert_eq!(run_alike(&mut harness).get::<u32>("cloud.meta"), expected);
        // Entries without a sample answer nothing, and what came in a frame before does not count.
        harness.set("samples", &[Sample { reuse: 2, ..Sample::default() }; 3]);
        harness.frame.index += 1;
        assert_eq!(run_alike(&mut harness).get::<u32>("cloud.meta")[2], LIVE);
    }

    #[test]
    fn nothing_changes_while_the_camera_moves() {
        let mut harness = harness(&[LIVE | 9], &[0], &[NO_POINT]);
        harness.frame.view = View { eye: [1.0, 0.0, 0.0], ..harness.frame.previous };
        let both = run_both(&mut harness);
        both.assert_equal::<u32>("cloud.meta");
        assert_eq!(both.cpu.get::<u32>("cloud.meta"), [LIVE | 9]);
    }

    #[test]
    fn both_sides_agree() {
        let mut random = Random(11);
        for [slots, requests] in [[1, 1], [1000, 70], [300, 300], [5, 4000]] {
            let meta: Vec<u32> = (0..slots).map(|_| random.bits() & (AGE | LIVE | CHANGED)).collect();
            let [requested, arrived] =
                [0; 2].map(|_| (0..requests).map(|_| random.below(slots + 2)).collect::<Vec<_>>());
            run_both(&mut harness(&meta, &requested, &arrived)).assert_equal::<u32>("cloud.meta");
        }
    }
}
