// Requests for samples and the samples that answer them. Mirrors `stages/src/shared/requests.rs`.

// The pixel of a request that asks for nothing.
const NO_PIXEL: u32 = 0xFFFFFFFFu;

// The reuse of a request at a pixel that shows no point, and the slot of a sample that finds no place.
const NO_POINT: u32 = 0xFFFFFFFFu;

// The aim at a pixel's centre.
const AIM_CENTER: u32 = 0x80008000u;

// The view of requests of the camera of the frame, and of the camera predicted for a later one.
const VIEW_NOW: u32 = 0u;
const VIEW_PREDICTED: u32 = 1u;

// The hit of an entry that holds no sample, of a sample on a surface, and of one whose ray met nothing.
const HIT_NONE: u32 = 0u;
const HIT_SURFACE: u32 = 1u;
const HIT_BACKGROUND: u32 = 2u;

struct Request {
    // Pixel index y * W + x, or NO_PIXEL.
    pixel: u32,
    // Where in the pixel the ray goes, in 1/65536 of its width: x in the low 16 bits, y (downwards) in the high ones.
    aim: u32,
    // Slot of the point that the pixel shows, or NO_POINT.
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
    // Number of the body that it met, 0 for what does not move.
    body: u32,
    // The rest as in the request.
    pixel: u32,
    aim: u32,
    reuse: u32,
    view: u32,
}
