//! Priorities by which samples go everywhere in turn: the longer a pixel waits for its next one, the higher. No pixel
//! shows a point of a cloud.

#import cloud
#import frame
#import pixel

/// This frame's samples, of the frame before; alpha is 0 where there is none.
/// = last frame
@group(0) @binding(1) var color: texture_2d<f32>;
/// Frames since the pixel's last sample.
/// = kept, per pixel
@group(0) @binding(2) var<storage, read_write> waits: array<u32>;
/// = output, per pixel, means priority
@group(0) @binding(3) var<storage, read_write> priority: array<u32>;
/// = output, per pixel, means id
@group(0) @binding(4) var<storage, read_write> id: array<u32>;

// Power by which priority grows with the time waited: so steep that pixels whose turn has come are certain of a sample.
const STEEP: f32 = 16.0;

@compute @workgroup_size(8, 8)
fn main(@builtin(global_invocation_id) at: vec3<u32>) {
    if any(at.xy >= frame.size) {
        return;
    }
    let pixel = pixel_index(at.xy);
    waits[pixel] = select(waits[pixel] + 1u, 0u, textureLoad(color, at.xy, 0).a > 0.0);
    // 1 when as many samples have been traced since as there are pixels.
    let turn = f32(waits[pixel]) * f32(frame.samples) / f32(frame.size.x * frame.size.y);
    priority[pixel] = 1u + u32(254.0 * pow(min(turn, 1.0), STEEP));
    id[pixel] = NO_POINT;
}
