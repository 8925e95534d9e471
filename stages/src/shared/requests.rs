//! Requests for samples and the samples that answer them. Mirrored by `shaders/shared/requests.wgsl`.

use super::cloud::NO_POINT;

epigraph_core::constants! {
    /// The `pixel` of an empty request.
    pub const NO_PIXEL: u32 = u32::MAX;
    /// The `aim` at the pixel's centre.
    pub const PIXEL_CENTER: u32 = 0x8000_8000;
    /// Bit of an `aim`: it is one of many that are spread over the pixel of a resting camera (`refine`). The sample joins the
    /// point that the pixel shows if it lies on that surface; otherwise it does not enter the cloud. Without such a point it is
    /// like others.
    pub const SPREAD: u32 = 1;
    /// The `view` of requests of the camera of the frame.
    pub const VIEW_NOW: u32 = 0;
    /// The `view` of requests of the camera predicted for a later frame.
    pub const VIEW_PREDICTED: u32 = 1;
    /// The `view` of samples that come in a later frame than their request: that of an earlier frame.
    pub const VIEW_LATE: u32 = 2;
    /// The `hit` of an entry without a sample; zeroed memory is an empty list.
    pub const HIT_NONE: u32 = 0;
    /// The `hit` of a sample on a surface.
    pub const HIT_SURFACE: u32 = 1;
    /// The `hit` of a sample whose ray hit nothing.
    pub const HIT_BACKGROUND: u32 = 2;
    /// A variance that nobody knows.
    pub const UNKNOWN: f32 = epigraph_scenes::UNKNOWN_VARIANCE;
}

epigraph_core::item! {
    /// A request for one sample.
    pub struct Request {
        /// Pixel index y * W + x, or [`NO_PIXEL`].
        pixel: u32,
        /// Where in the pixel the ray goes, in 1/65536 of its width: x in the low 16 bits, y (downwards) in the high
        /// ones.
        aim: u32,
        /// Slot of the point that the pixel shows, or [`NO_POINT`].
        reuse: u32,
        /// [`VIEW_NOW`] or [`VIEW_PREDICTED`].
        view: u32,
    }
}

epigraph_core::item! {
    /// The result of one ray, with the request that it answers. [`Sample::surface`] and
    /// [`Sample::background`] make those of sources that know nothing of noise: they are taken to be exact.
    pub struct Sample {
        /// Surface point, metres; for [`HIT_BACKGROUND`] the ray's unit direction.
        position: [f32; 3],
        /// [`HIT_NONE`], [`HIT_SURFACE`] or [`HIT_BACKGROUND`].
        hit: u32,
        /// Linear radiance towards the eye.
        radiance: [f32; 3],
        /// Number of the body that the ray hit, 0 for static geometry.
        body: u32,
        /// As in the request.
        pixel: u32,
        /// As in the request.
        aim: u32,
        /// As in the request.
        reuse: u32,
        /// As in the request, or [`VIEW_LATE`].
        view: u32,
        /// Variance of the radiance's luminance, as estimated from its light paths; [`UNKNOWN`] if that is not possible.
        variance: f32,
        /// The surface's unit normal, on the viewer's side, as a code of [`octahedral`](super::octahedral).
        normal: u32,
        /// Roughly the share of itself by which the radiance may change if it is seen from a direction one radian away;
        /// 0 for a diffuse surface.
        sharpness: f32,
        /// The share of light that the surface scatters, as a code of [`albedo`](super::albedo), where a texture varies it;
        /// [`PLAIN`](super::albedo::PLAIN) elsewhere.
        albedo: u32,
    }
}

impl Request {
    /// An empty request.
    pub const NONE: Self = Self { pixel: NO_PIXEL, aim: PIXEL_CENTER, reuse: NO_POINT, view: VIEW_NOW };

    /// The target of the ray, in pixels from the top left corner of an image `width` pixels wide.
    #[inline]
    pub fn target(&self, width: u32) -> [f32; 2] {
        let share = |bits: u32| bits as f32 / 65536.0;
        [
            (self.pixel % width) as f32 + share(self.aim & 0xFFFF),
            (self.pixel / width) as f32 + share(self.aim >> 16),
        ]
    }
}

impl Sample {
    /// Where it lies, as the cloud keeps positions: w = 1 for a point, 0 for a direction.
    #[inline]
    pub fn place(&self) -> [f32; 4] {
        let [x, y, z] = self.position;
        [x, y, z, if self.hit == HIT_SURFACE { 1.0 } else { 0.0 }]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_target_lies_in_its_pixel() {
        let request = Request { pixel: 7 * 10 + 3, aim: PIXEL_CENTER, reuse: NO_POINT, view: VIEW_NOW };
        assert_eq!(request.target(10), [3.5, 7.5]);
        assert_eq!(Request { aim: 0xC000_0000, ..request }.target(10), [3.0, 7.75]);
    }

    #[test]
    fn a_sample_is_laid_out_as_in_wgsl() {
        assert_eq!(size_of::<Sample>(), 64);
        assert_eq!(size_of::<Request>(), 16);
    }
}
