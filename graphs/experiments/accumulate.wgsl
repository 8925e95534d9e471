//! Blends each pixel's colour with the colour that its surface had in the frame before.

#import edge_pixel
#import frame
#import pixel
#import view

struct Params {
    /// Weight of the new colour: the history has about 1 / weight frames.
    /// = 0.1 in 0.01..1
    weight: f32,
    /// How far the history may lie outside the colours around the pixel, in standard deviations.
    /// = 1.5 in 0..100
    width: f32,
    /// Largest difference of distance between a surface and its history, as a share.
    /// = 0.05 in 0..1
    depth: f32,
}

@group(0) @binding(1) var<uniform> params: Params;
/// Linear radiance of the primary regions.
@group(0) @binding(2) var color: texture_2d<f32>;
/// Distance of the surface that each pixel shows, metres.
/// = per pixel, means depth
@group(0) @binding(3) var<storage, read> distance: array<f32>;
/// Which regions of each pixel join which of its eight neighbours.
/// = per pixel, means joins
@group(0) @binding(4) var<storage, read> n8: array<u32>;
/// `accumulated` of the frame before.
/// = last frame
@group(0) @binding(5) var before: texture_2d<f32>;
/// `distance` of the frame before.
/// = last frame, per pixel, means depth
@group(0) @binding(6) var<storage, read> distance_before: array<f32>;
/// Linear radiance of the primary regions, blended over frames.
/// = output, per pixel, means radiance
@group(0) @binding(7) var accumulated: texture_storage_2d<rgba32float, write>;

// The bit of a neighbour in n8: both primary regions are joined.
const PRIMARY: u32 = 1u;

// A point of the surface at the middle of a pixel, metres, and 1 for project_point.
fn surface(pixel: vec2<u32>) -> vec4<f32> {
    let z = distance[pixel_index(pixel)];
    let at = (vec2<f32>(pixel) + 0.5) / vec2<f32>(frame.size) * 2.0 - 1.0;
    let view = frame.view;
    let ray = view.forward + view.right * at.x * view.tan_x - view.up * at.y * view.tan_y;
    return vec4(view.eye + ray * z, 1.0);
}

// The history at a position of the frame before, interpolated between those of four pixels that show the surface;
// a: the share of them that do.
fn history(at: vec2<f32>, z: f32) -> vec4<f32> {
    let corner = at - 0.5;
    let first = vec2<i32>(floor(corner));
    let part = corner - floor(corner);
    var sum = vec4(0.0);
    for (var i = 0; i < 4; i += 1) {
        let step = vec2(i & 1, i >> 1u);
        let pixel = first + step;
        if is_outside(pixel) {
            continue;
        }
        let there = textureLoad(before, pixel, 0);
        let other = distance_before[pixel_index(vec2<u32>(pixel))];
        if there.a > 0.0 && abs(other - z) <= params.depth * z {
            let near = select(1.0 - part, part, step == vec2(1));
            sum += vec4(there.rgb, 1.0) * near.x * near.y;
        }
    }
    return vec4(sum.rgb / max(sum.a, 1e-6), sum.a);
}

@compute @workgroup_size(8, 8)
fn blend(@builtin(global_invocation_id) id: vec3<u32>) {
    if any(id.xy >= frame.size) {
        return;
    }
    let here = textureLoad(color, id.xy, 0);
    // Mean and deviation of the colours that the pixel reaches.
    var sum = here.rgb;
    var squares = here.rgb * here.rgb;
    var count = 1.0;
    let joins = n8[pixel_index(id.xy)];
    for (var d = 0u; d < 8u; d += 1u) {
        let at = vec2<i32>(id.xy) + direction(d);
        if (joins >> (4u * d) & PRIMARY) == 0u || is_outside(at) {
            continue;
        }
        let there = textureLoad(color, at, 0);
        if there.a > 0.0 {
            sum += there.rgb;
            squares += there.rgb * there.rgb;
            count += 1.0;
        }
    }
    let mean = sum / count;
    let reach = params.width * sqrt(max(squares / count - mean * mean, vec3(0.0)));

    let projected = project_point(frame.previous, surface(id.xy), frame.size);
    var blended = here;
    if frame.index > 0u && here.a > 0.0 && projected.z > 0.0 {
        let past = history(projected.at, projected.z);
        if past.a > 0.25 {
            let kept = clamp(past.rgb, mean - reach, mean + reach);
            blended = vec4(mix(kept, here.rgb, params.weight), here.a);
        }
    }
    textureStore(accumulated, id.xy, blended);
}
