//! Traces the requests of a frame.

use epigraph_core::{CpuContext, Extent, Finding, In, Io, Out, Site, Stage};
use epigraph_scenes::{Mode, TraceSettings};

use crate::{
    World, column,
    meaning::{REQUESTS, SAMPLES},
    shared::requests::{Request, Sample},
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
pub struct Trace {
    requests: In<Request>,
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
        if samples.iter().all(|sample| *sample == Sample::default()) {
            cx.blank(self.samples);
        }
        Ok(())
    }

    fn explain(&self, _: &TraceParams, site: &Site) -> Option<Vec<Finding>> {
        explain::at(self, site)
    }
}
