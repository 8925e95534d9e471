// Requests for samples and the samples that answer them. Mirrors `stages/src/shared/requests.rs`, which declares the
// constants NO_PIXEL, PIXEL_CENTER, VIEW_NOW, VIEW_PREDICTED, VIEW_LATE, HIT_NONE, HIT_SURFACE, HIT_BACKGROUND and
// UNKNOWN.

struct Request {
    // Pixel index y * W + x, or NO_PIXEL.
    pixel: u32,
    // Where in the pixel the ray goes, in 1/65536 of its width: x in the low 16 bits, y (downwards) in the high ones.
    aim: u32,
    // Slot of the point that the pixel shows, or the cloud's NO_POINT.
    reuse: u32,
    // VIEW_NOW or VIEW_PREDICTED.
    view: u32,
}

struct Sample {
    // Surface point, metres; for HIT_BACKGROUND the ray's unit direction.
    position: vec3<f32>,
    // HIT_NONE, HIT_SURFACE or HIT_BACKGROUND.
    hit: u32,
    // Linear radiance towards the eye.
    radiance: vec3<f32>,
    // Number of the body that the ray hit, 0 for static geometry.
    body: u32,
    // These four as in the request, but VIEW_LATE if that was of an earlier frame.
    pixel: u32,
    aim: u32,
    reuse: u32,
    view: u32,
    // Variance of the radiance's luminance, or UNKNOWN.
    variance: f32,
    // The surface's normal on the viewer's side, octahedral.
    normal: u32,
    // The share of itself by which the radiance may change per radian of the viewer's direction.
    sharpness: f32,
    // The share of light that a textured surface scatters, as a code of `albedo`.
    albedo: u32,
}
