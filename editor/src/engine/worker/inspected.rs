//! The inspected pixel, and the report on it.

use std::{
    panic::{AssertUnwindSafe, catch_unwind},
    sync::Arc,
};

use super::{Worker, message};
use crate::inspect;

/// The inspected pixel.
pub(super) struct Inspected {
    pixel: [u32; 2],
    /// True if the next frame is to be captured even if it is one of many.
    pub wanted: bool,
}

impl Worker {
    /// Starts, continues or ends an inspection.
    pub(super) fn inspect(&mut self, pixel: Option<[u32; 2]>) {
        let Some(pixel) = pixel else {
            (self.inspected, self.state.inspection) = (None, None);
            return;
        };
        // A captured frame that is still valid holds every pixel.
        let is_captured = self.options.paused && self.capture.is_some();
        if self.options.paused && !is_captured {
            self.owed = self.owed.max(1);
        }
        self.inspected = Some(Inspected { pixel, wanted: !is_captured });
        if is_captured {
            self.tell();
        }
    }

    /// Reports on the inspected pixel in the frame that has just ended, if that was captured.
    pub(super) fn tell_capture(&mut self) {
        if let (Some(_), Some(inspected)) = (&self.capture, &mut self.inspected) {
            inspected.wanted = false;
            self.tell();
        }
    }

    /// Reports on the inspected pixel in the captured frame.
    fn tell(&mut self) {
        if let (Some(Inspected { pixel, .. }), Some(capture), Some(running)) =
            (&self.inspected, &self.capture, &self.running)
        {
            let [width, height] = capture.frame.size;
            // The frame may have become smaller since the click.
            let pixel = [pixel[0].min(width - 1), pixel[1].min(height - 1)];
            let executor = &running.run.executor;
            let report = catch_unwind(AssertUnwindSafe(|| {
                inspect::inspect(executor.graph(), executor.plan(), capture, pixel, self.place.tracer())
            }));
            match report {
                Ok(inspection) => self.state.inspection = Some(Arc::new(inspection)),
                Err(panic) => {
                    let why = message(panic.as_ref());
                    self.state.trouble = Some(format!("inspecting the pixel panicked: {why}"));
                }
            }
        }
    }
}
