//! Traces the requests of a frame.

use epigraph_core::{CpuContext, Extent, Finding, Frame, In, Io, Out, Site, Stage};
use epigraph_scenes::{Mode, TraceSettings};

use crate::{
    World, column,
    meaning::{ID, REQUESTS, SAMPLES},
    shared::{
        cloud::NO_POINT,
        requests::{Request, Sample, VIEW_LATE},
        view::Projected,
    },
};

#[path = "explain/trace.rs"]
mod explain;

epigraph_core::choice! {
    /// Which light samples include.
    pub enum Light {
        /// Direct light at the first surface, and one glossy reflection.
        Direct,
        /// All light, over many bounces.
        Path,
    }
}

epigraph_core::params! {
    /// Cost and quality of a sample.
    pub struct TraceParams {
        /// Light paths per sample; the sample is their mean.
        spp: u32 = 4, in 1..=4096, unit "paths";
        /// Direct light or full paths.
        mode: Light = Light::Direct;
        /// Maximum number of reflections after the first surface.
        max_bounces: u32 = 8, in 0..=64;
    }
}

/// Answers requests with the tracer of the [`World`] that the application provides: one ray through the position in the
/// pixel that each request names, of this frame's view or of the predicted one. On the CPU only.
///
/// Samples that come in a later frame than their request renew the point that their place shows by now, if `id` tells it:
/// in between, another sample may have filled an empty pixel, or its point may be gone.
pub struct Trace {
    requests: In<Request>,
    id: Option<In<u32>>,
    samples: Out<Sample>,
}

impl Stage for Trace {
    const KIND: &'static str = "trace";
    const DOC: &'static str = "Traces a ray for each request and shades what it meets.";
    type Params = TraceParams;

    fn declare(_: &Self::Params, io: &mut Io) -> Self {
        io.column(column::TRACE);
        Self {
            requests: io.read(
                "requests",
                REQUESTS.doc("What to look at; entries without a pixel ask for nothing."),
                Extent::Requests,
            ),
            id: io.optional(
                "id",
                ID.doc(
                    "The point of each pixel: late samples renew it. Without it, the one of their request.",
                ),
                Extent::Frame(1),
            ),
            samples: io.write("samples", SAMPLES, Extent::Requests),
        }
    }

    fn cpu(&self, params: &Self::Params, cx: &CpuContext) -> Result<(), String> {
        let mode = match params.mode {
            Light::Direct => Mode::Direct,
            Light::Path => Mode::Path,
        };
        let settings = TraceSettings { spp: params.spp, mode, max_bounces: params.max_bounces };
        let world = cx.host::<World>()?;
        let scene = world.tracer.scene();
        if scene.has_only_points() {
            let name = &scene.name;
            return Err(format!(
                "`{name}` has points and no surfaces to trace rays to: show it with the graph `streams`"
            ));
        }
        let samples = &mut cx.write(self.samples)[..];
        world.answer(cx.frame(), &cx.read(self.requests), &settings, samples);
        if let Some(id) = self.id {
            let id = cx.read(id);
            for sample in samples.iter_mut().filter(|sample| sample.view == VIEW_LATE) {
                sample.reuse = shown_at(sample, cx.frame(), &id);
            }
        }
        if samples.iter().all(|sample| *sample == Sample::default()) {
            cx.blank(self.samples);
        }
        Ok(())
    }

    fn explain(&self, _: &TraceParams, site: &Site) -> Option<Vec<Finding>> {
        explain::at(self, site)
    }
}

/// The point that a frame shows where a sample lies; [`NO_POINT`] if there is none, or the sample is not in the image.
fn shown_at(sample: &Sample, frame: &Frame, id: &[u32]) -> u32 {
    let Some(projected) = Projected::of(&frame.view, sample.place(), frame.size) else { return NO_POINT };
    let [x, y] = projected.pixel();
    id[(y * frame.size[0] + x) as usize]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::shared::{
        requests::{HIT_BACKGROUND, HIT_SURFACE},
        testing::settings,
    };

    #[test]
    fn a_late_sample_finds_the_point_of_the_pixel_in_which_it_lies_by_now() {
        let mut frame =
            epigraph_core::Harness::<Trace>::new(TraceParams::default(), &settings([4, 2], 1)).frame;
        let view = &mut frame.view;
        (view.eye, view.tan_x, view.tan_y) = ([10.0, 0.0, 0.0], 1.0, 0.5);
        (view.right, view.up, view.forward) = ([1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, -1.0]);
        let id = [10, 11, 12, 13, 14, 15, 16, 17];
        let at = |hit: u32, position: [f32; 3]| {
            shown_at(&Sample { position, hit, ..Sample::default() }, &frame, &id)
        };
        // Two metres away, the image is 4 m wide and 2 m high.
        assert_eq!(at(HIT_SURFACE, [8.5, 0.5, -2.0]), 10);
        assert_eq!(at(HIT_SURFACE, [11.5, -0.5, -2.0]), 17);
        assert_eq!(at(HIT_SURFACE, [12.5, -0.5, -2.0]), NO_POINT);
        assert_eq!(at(HIT_SURFACE, [10.5, 1.5, -2.0]), NO_POINT);
        assert_eq!(at(HIT_SURFACE, [10.5, -0.5, 2.0]), NO_POINT, "behind the eye");
        // Directions do not depend on where the eye is.
        assert_eq!(at(HIT_BACKGROUND, [0.25, 0.25, -1.0]), 12);
    }
}
