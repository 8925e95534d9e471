//! Which points new samples renew. Mirrored by `shaders/shared/renewal.wgsl`.

use epigraph_core::{Frame, View};

use super::{
    cloud::{BODY_SHIFT, LIVE, NO_POINT, bounded},
    estimate::{Estimate, MOST_AT_REST, angle, in_line, on_surface},
    requests::{HIT_BACKGROUND, HIT_SURFACE, SPREAD, Sample, VIEW_LATE},
};

/// Whether a sample is one of those that are spread over the pixel of a point.
pub fn is_spread(sample: &Sample) -> bool {
    sample.aim & SPREAD != 0 && sample.reuse != NO_POINT
}

/// From where the samples that arrive in a frame were seen: they were requested in the frame before.
pub struct Eye {
    /// Metres.
    pub position: [f32; 3],
    /// Width of a pixel at a distance of 1.
    pixel: f32,
    /// Whether this frame's view is the same.
    rests: bool,
}

impl Eye {
    /// That of a frame.
    pub fn of(frame: &Frame) -> Self {
        let View { eye, tan_x, .. } = frame.previous;
        Self { position: eye, pixel: 2.0 * tan_x / frame.size[0] as f32, rests: frame.view == frame.previous }
    }

    /// Whether a sample was taken on the surface of the point that it was requested to renew. The slot of a late one may hold
    /// another point by now.
    pub fn renews(&self, sample: &Sample, meta: u32, [x, y, z, w]: [f32; 4]) -> bool {
        sample.hit == HIT_SURFACE
            && w != 0.0
            && meta & LIVE != 0
            && meta >> BODY_SHIFT == sample.body
            && on_surface([x, y, z], sample, self.position, self.pixel)
            && (sample.view != VIEW_LATE || in_line([x, y, z], sample.position, self.position, self.pixel))
    }

    /// Whether a sample may take the place of the live point that it was requested to renew. One of those that are spread over
    /// a pixel lies beyond an edge as often as not, and then says nothing of the point.
    pub fn replaces(&self, sample: &Sample, meta: u32, position: [f32; 4]) -> bool {
        !is_spread(sample)
            || sample.hit == HIT_BACKGROUND && position[3] == 0.0
            || self.renews(sample, meta, position)
    }

    /// A point's estimate as seen from here, which may be another direction than that of its last sample.
    pub fn looks_again(&self, before: Estimate, single: &Estimate, most: f32) -> Estimate {
        let [change, ..] = bounded([single.sharpness * angle(before.towards_eye, single.towards_eye); 3]);
        before.doubt(change, if self.rests { MOST_AT_REST } else { most })
    }
}
