//! A pixel under inspection: which frames are captured for it, and what is told of it.

use std::{
    panic::{AssertUnwindSafe, catch_unwind},
    sync::Arc,
};

use epigraph_core::{Capture, Frame, Snapshot};

use super::{Rebuild, Worker, message};
use crate::inspect;

/// A pixel that is inspected.
pub(super) struct Inspected {
    pixel: [u32; 2],
    /// Whether the next frame is to be captured even if it is one of many.
    wanted: bool,
    /// The last captured frame of the graph that runs.
    capture: Option<Capture>,
}

impl Worker {
    /// Begins, goes on or ends an inspection.
    pub(super) fn inspect(&mut self, pixel: Option<[u32; 2]>) -> Rebuild {
        let Some(pixel) = pixel else {
            self.state.inspection = None;
            let was = self.inspected.take().is_some();
            return if was { Rebuild::Keep } else { Rebuild::No };
        };
        let before = self.inspected.take();
        let begins = before.is_none();
        let capture = before.and_then(|before| before.capture);
        // A captured frame that still stands tells of every pixel.
        let stands = self.options.paused
            && capture.as_ref().is_some_and(|capture| capture.frame.index.wrapping_add(1) == self.index);
        if self.options.paused && !stands {
            self.owed = self.owed.max(1);
        }
        self.inspected = Some(Inspected { pixel, wanted: !stands, capture });
        if stands {
            self.tell();
        }
        if begins { Rebuild::Keep } else { Rebuild::No }
    }

    /// Whether the coming frame is captured.
    pub(super) fn captures(&self) -> bool {
        self.inspected.as_ref().is_some_and(|inspected| inspected.wanted || self.options.paused)
    }

    /// Keeps what a frame wrote, and tells of it.
    pub(super) fn keep_capture(&mut self, frame: Frame, snapshots: Vec<Arc<Snapshot>>) {
        if let Some(inspected) = &mut self.inspected {
            inspected.capture = Some(Capture { frame, snapshots });
            inspected.wanted = false;
        }
        self.tell();
    }

    /// Forgets what another graph's nodes wrote.
    pub(super) fn drop_capture(&mut self) {
        if let Some(inspected) = &mut self.inspected {
            inspected.capture = None;
        }
    }

    /// Tells of the inspected pixel in the captured frame.
    fn tell(&mut self) {
        if let (Some(Inspected { pixel, capture: Some(capture), .. }), Some(running)) =
            (&self.inspected, &self.running)
        {
            let [width, height] = capture.frame.size;
            // The frame may have become smaller since the click.
            let pixel = [pixel[0].min(width - 1), pixel[1].min(height - 1)];
            let executor = &running.executor;
            let told = catch_unwind(AssertUnwindSafe(|| {
                inspect::inspect(executor.graph(), executor.plan(), capture, pixel, &self.tracer)
            }));
            match told {
                Ok(inspection) => self.state.inspection = Some(Arc::new(inspection)),
                Err(panic) => {
                    let why = message(panic.as_ref());
                    self.state.trouble = Some(format!("inspecting the pixel panicked: {why}"));
                }
            }
        }
    }
}
