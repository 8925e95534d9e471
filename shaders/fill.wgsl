// Colours every pixel from the points near it, and computes how much a new sample there is worth.

#import cloud
#import frame
#import pixel

struct Params {
    empty: u32,
    keep_points: u32,
    wide: u32,
    priority: u32,
}

@group(0) @binding(1) var<uniform> params: Params;
@group(0) @binding(2) var<storage, read> cloud_radiance: array<u32>;
@group(0) @binding(3) var<storage, read> cloud_meta: array<u32>;
@group(0) @binding(4) var<storage, read> id: array<u32>;
@group(0) @binding(5) var previous: texture_2d<f32>;
@group(0) @binding(6) var<storage, read_write> points: array<vec4<f32>>;
@group(0) @binding(7) var color: texture_storage_2d<rgba32float, write>;
@group(0) @binding(8) var<storage, read_write> priority: array<u32>;

// The radiance of each pixel's point and 1, or zeros; the priority of pixels with a point.
@compute @workgroup_size(8, 8, 1)
fn gather(@builtin(global_invocation_id) pixel: vec3<u32>) {
    if any(pixel.xy >= frame.size) {
        return;
    }
    let p = pixel_index(pixel.xy);
    if id[p] == NO_POINT {
        points[p] = vec4(0.0);
    } else {
        points[p] = vec4(decode_radiance(cloud_radiance[id[p]]), 1.0);
        priority[p] = with_point(cloud_meta[id[p]] & AGE);
    }
}

// The entry of `points` at a position that may be outside the image.
fn point_at(q: vec2<i32>) -> vec4<f32> {
    if is_outside(q) {
        return vec4(0.0);
    }
    return points[pixel_index(vec2<u32>(q))];
}

// The entries above, at and below a position, weighted 1, 2 and 1. Three such columns, weighted likewise, make the 3x3
// weights: 4 for the centre, 2 for edges, 1 for corners.
fn column(q: vec2<i32>) -> vec4<f32> {
    return point_at(q - vec2(0, 1)) + 2.0 * point_at(q) + point_at(q + vec2(0, 1));
}

@compute @workgroup_size(8, 8, 1)
fn fill(@builtin(global_invocation_id) pixel: vec3<u32>) {
    if any(pixel.xy >= frame.size) {
        return;
    }
    let centre = vec2<i32>(pixel.xy);
    let near = column(centre - vec2(1, 0)) + 2.0 * column(centre) + column(centre + vec2(1, 0));
    let own = points[pixel_index(pixel.xy)];
    var sum = near;
    if own.w > 0.0 && params.keep_points != 0u {
        sum = own;
    } else if near.w == 0.0 && params.wide != 0u {
        let reach = i32(REACH);
        for (var dy = -reach; dy <= reach; dy++) {
            for (var dx = -reach; dx <= reach; dx++) {
                sum += point_at(centre + vec2(dx, dy));
            }
        }
    }
    var result = vec4(0.0, 0.0, 0.0, 1.0);
    if sum.w > 0.0 {
        result = vec4(sum.rgb / sum.w, 1.0);
    } else if params.empty == EMPTY_HOLD {
        result = textureLoad(previous, pixel.xy, 0);
    }
    textureStore(color, pixel.xy, result);

    let p = pixel_index(pixel.xy);
    if own.w == 0.0 {
        priority[p] = without_point(u32(near.w));
    }
}

// Priority of a pixel that shows a point of this age, in 8.8 fixed point.
fn with_point(age: u32) -> u32 {
    if params.priority == PRIORITY_MEASURED {
        return age / (2u * AGE_ONE);
    }
    return min(age / AGE_ONE, 254u);
}

// Priority of a pixel without a point whose neighbours weigh `weight` of WEIGHTS_SUM.
fn without_point(weight: u32) -> u32 {
    let missing = WEIGHTS_SUM - weight;
    if params.priority == PRIORITY_MEASURED {
        // In whole numbers: 255 * (missing / 16)^6, rounded to the nearest.
        let cube = missing * missing * missing;
        return (255u * cube * cube + 0x800000u) >> 24u;
    }
    return 255u * missing / WEIGHTS_SUM;
}
