//! Keeps the albedo of points, so that colours can be averaged without their textures (`algorithms.md` section 12.3).

use epigraph_core::{Access, CpuContext, Extent, Facts, In, Io, Out, Stage};

use crate::{
    column, facts,
    meaning::{POINT_ALBEDOS, POINTS, SAMPLES, SLOT},
    shared::{
        albedo::{decode_albedo, pack_mean, unpack_mean},
        requests::{HIT_NONE, Sample},
    },
};

/// For each point of the cloud the mean albedo of the samples whose mean radiance the point has, with the same weights: so
/// one mean divided by the other is light without textures. Red and green have 16 bits of the first word each, blue of
/// the second.
pub struct Albedo {
    record: In<[f32; 4]>,
    samples: In<Sample>,
    slots: In<u32>,
    albedos: Out<[u32; 2]>,
}

impl Stage for Albedo {
    const KIND: &'static str = "albedo";
    const DOC: &'static str =
        "Keeps the mean albedo of each point's samples, for filters that textures must survive.";
    type Params = ();

    fn declare((): &(), io: &mut Io) -> Self {
        io.column(column::P1);
        let doc =
            "The points, after these samples have joined them. They must keep means: see `point_cloud`.";
        let mut cloud = io.bundle(Access::Read, "cloud", POINTS.doc(doc), Extent::Any);
        let record = cloud.read("record");
        let samples =
            io.history("samples", SAMPLES.doc("The samples that arrived in the last frame."), Extent::Any);
        let slots = io.read("slots", SLOT, Extent::Like("samples".into()));
        let albedos = io.persistent("albedos", POINT_ALBEDOS, Extent::Like("cloud".into()));
        io.shader(shader!("albedo"));
        io.dispatch("join", slots);
        io.per_arrival(samples);
        Self { record, samples, slots, albedos }
    }

    fn cpu(&self, (): &(), cx: &CpuContext) -> Result<(), String> {
        let (record, samples, slots) = (cx.read(self.record), cx.read(self.samples), cx.read(self.slots));
        let mut albedos = cx.write(self.albedos);
        for (sample, &slot) in samples.iter().zip(&slots[..]).filter(|(sample, _)| sample.hit != HIT_NONE) {
            let slot = slot as usize;
            let Some(albedo) = albedos.get_mut(slot) else { continue };
            let (before, own) = (unpack_mean(*albedo), decode_albedo(sample.albedo));
            // The mean of the colours has counted this sample already. What begins anew counts for one.
            let count = record[slot][3].abs().max(1.0);
            let joined = |of: usize| before[of] + (own[of] - before[of]) / count;
            *albedo = pack_mean(if count == 1.0 { own } else { [0, 1, 2].map(joined) });
        }
        Ok(())
    }

    fn needless((): &(), facts: &Facts) -> Option<&'static str> {
        (facts.holds(facts::LOOKS_VARY) == Some(false)).then_some("nothing has a texture")
    }
}

#[cfg(test)]
mod tests {
    use epigraph_core::Harness;

    use super::*;
    use crate::shared::{
        albedo::{PLAIN, encode_albedo},
        cloud::NO_POINT,
        requests::{HIT_BACKGROUND, HIT_SURFACE},
        testing::{Random, run_both, settings},
    };

    const POINTS: usize = 300;

    /// In three frames samples of random albedos come for half of the slots, as often as their records say: at first, and
    /// after a change, a mean begins anew.
    #[test]
    fn means_of_albedos_follow_the_counts_of_the_cloud() {
        let mut random = Random(11);
        let mut harness = Harness::<Albedo>::new((), &settings([16, 16], POINTS as u32));
        let mut expected = vec![[0.0f64; 3]; POINTS];
        for frame in 0..3 {
            let (mut record, mut samples) = (vec![[0.0f32; 4]; POINTS], Vec::new());
            let mut slots = Vec::new();
            for slot in 0..POINTS {
                let count = match (frame, slot % 3) {
                    (0, _) | (_, 0) => 1.0,
                    (_, 1) => frame as f32 + 1.0,
                    // What is suspect has a negative count; a mean in doubt counts for little.
                    _ => -1.6,
                };
                record[slot][3] = count;
                let hit = [HIT_SURFACE, HIT_SURFACE, HIT_BACKGROUND, HIT_NONE][random.below(4) as usize];
                let albedo = [0; 3].map(|_| random.between(0.1, 1.0));
                let code = encode_albedo(albedo.into());
                let has_slot = random.below(5) > 0;
                slots.push(if has_slot { slot as u32 } else { NO_POINT });
                samples.push(Sample { hit, albedo: code, ..Sample::default() });
                if has_slot && hit != HIT_NONE {
                    let own = decode_albedo(code).map(f64::from);
                    let share = 1.0 / f64::from(count.abs());
                    let mean = &mut expected[slot];
                    (0..3).for_each(|channel| mean[channel] += (own[channel] - mean[channel]) * share);
                }
            }
            harness.set("cloud.record", &record);
            harness.set("samples", &samples);
            harness.set("slots", &slots);
            let both = run_both(&mut harness);
            for out in [&both.cpu, &both.gpu] {
                for (slot, packed) in out.get::<[u32; 2]>("albedos").into_iter().enumerate() {
                    let mean = unpack_mean(packed);
                    for channel in 0..3 {
                        let error = (f64::from(mean[channel]) - expected[slot][channel]).abs();
                        // Half a step in each of the frames, and one for rounding.
                        assert!(
                            error < 2.0 / 65535.0,
                            "frame {frame}, point {slot}: {mean:?} {:?}",
                            expected[slot]
                        );
                    }
                }
            }
        }
    }

    #[test]
    fn plain_surfaces_stay_plain_however_many_samples_come() {
        let mut harness = Harness::<Albedo>::new((), &settings([4, 4], 1));
        harness.set("samples", &[Sample { hit: HIT_SURFACE, albedo: PLAIN, ..Sample::default() }]);
        harness.set("slots", &[0u32]);
        for count in [1.0f32, 2.0, 3.0, 64.0] {
            harness.set("cloud.record", &[[0.0, 0.0, 0.0, count]]);
            let both = run_both(&mut harness);
            for out in [&both.cpu, &both.gpu] {
                assert_eq!(unpack_mean(out.get::<[u32; 2]>("albedos")[0]), [1.0; 3]);
            }
        }
    }
}
