//! Draws edges of the mesh as lines over the picture, without those that surfaces hide.

#import frame
#import pixel
#import segments

struct Params {
    /// A line is hidden if it lies behind `distance` by more than this share of its own distance. Negative: also if it
    /// is a little nearer than that, as `view.filtered` lies 5% behind the surface.
    /// = -0.03 in -0.2..1
    tolerance: f32,
    /// How much of the light the lines take.
    /// = 0.8 in 0..1
    ink: f32,
}

@group(0) @binding(1) var<uniform> params: Params;
/// Distance of the surface at each pixel, metres.
/// = per pixel, means depth
@group(0) @binding(3) var<storage, read> distance: array<f32>;
/// The lines' ends in the scene.
@group(0) @binding(4) var<storage, read> segments: array<Segment>;
/// The number of lines.
/// = 1 element
@group(0) @binding(5) var<storage, read> count: array<u32>;
/// Linear radiance.
/// = means radiance
@group(0) @binding(6) var color: texture_2d<f32>;
/// 1 where a line was drawn.
/// = output, like color, format r32float
@group(0) @binding(7) var lines: texture_2d<f32>;
/// Linear radiance, with the lines over it.
/// = like color, means radiance
@group(0) @binding(8) var inked: texture_storage_2d<rgba32float, write>;

struct End {
    @builtin(position) position: vec4<f32>,
    @location(0) distance: f32,
}

/// = draw 2 line vertices per segments into lines, fragment shade
@vertex
fn project(@builtin(vertex_index) index: u32) -> End {
    if index / 2u >= count[0] {
        // In front of the near plane: not drawn.
        return End(vec4(0.0, 0.0, -1.0, 1.0), 0.0);
    }
    let segment = segments[index / 2u];
    let p = select(segment.a, segment.b, index % 2u == 1u) - frame.view.eye;
    let view = frame.view;
    let z = dot(p, view.forward);
    let depth = (z - view.near) * view.far / (view.far - view.near);
    let at = vec2(dot(p, view.right) / view.tan_x, dot(p, view.up) / view.tan_y);
    return End(vec4(at, depth, z), z);
}

@fragment
fn shade(end: End) -> @location(0) vec4<f32> {
    let surface = distance[pixel_index(vec2<u32>(end.position.xy))];
    if surface < end.distance * (1.0 - params.tolerance) {
        discard;
    }
    return vec4(1.0);
}

// Runs after the draw, and so reads what it drew.
/// = over inked
@compute @workgroup_size(8, 8)
fn darken(@builtin(global_invocation_id) id: vec3<u32>) {
    if any(id.xy >= frame.size) {
        return;
    }
    let below = textureLoad(color, id.xy, 0);
    let light = 1.0 - params.ink * textureLoad(lines, id.xy, 0).r;
    textureStore(inked, id.xy, vec4(below.rgb * light, below.a));
}
