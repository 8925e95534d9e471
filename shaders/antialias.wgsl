// Mixes the colours of both sides of an edge in the pixels that it cuts, by area.

#import edge_pixel
#import frame
#import pixel

struct Params {
    neighbour: u32,
}

@group(0) @binding(1) var<uniform> params: Params;
@group(0) @binding(2) var primary: texture_2d<f32>;
@group(0) @binding(3) var<storage, read> cls: array<u32>;
@group(0) @binding(4) var<storage, read> n8: array<u32>;
@group(0) @binding(5) var color: texture_storage_2d<rgba32float, write>;

@compute @workgroup_size(8, 8, 1)
fn antialias(@builtin(global_invocation_id) pixel: vec3<u32>) {
    if any(pixel.xy >= frame.size) {
        return;
    }
    let p = pixel_index(pixel.xy);
    var result = textureLoad(primary, pixel.xy, 0);
    if (cls[p] & CLASS) == SIMPLE && params.neighbour != NEIGHBOUR_OFF {
        result = blend(vec2<i32>(pixel.xy), cls[p], n8[p], result);
    }
    textureStore(color, pixel.xy, result);
}

// The colour of a simple pixel, from its primary region's and its neighbours' colours.
fn blend(pixel: vec2<i32>, cls: u32, n8: u32, own: vec4<f32>) -> vec4<f32> {
    let ends = ends_of(cls);
    let normal = chord_of(ends.x, ends.y).normal;
    let towards_secondary = select(normal, -normal, (cls & PRIMARY_IS_A) != 0u);
    var beyond = vec3(0.0);
    var total = 0.0;
    for (var d = 0u; d < 8u; d++) {
        let square = squareness(towards_secondary, d);
        let q = pixel + direction(d);
        if !is_outside(q) && ((n8 >> (4u * d)) & SECONDARY_TO_PRIMARY) != 0u && square > 0.0 {
            let neighbour = textureLoad(primary, q, 0).rgb * square;
            if params.neighbour != NEIGHBOUR_BEST {
                beyond += neighbour;
                total += square;
            } else if square > total {
                beyond = neighbour;
                total = square;
            }
        }
    }
    if total == 0.0 {
        return own;
    }
    let share = f32(primary_area(cls)) / f32(PIXEL_AREA);
    return vec4(own.rgb * share + beyond / total * (1.0 - share), own.a);
}

// How nearly perpendicular to an edge the neighbour in direction `d` lies: the edge's normal projected on that
// direction.
fn squareness(normal: vec2<i32>, d: u32) -> f32 {
    let toward = direction(d);
    let along = f32(normal.x * toward.x + normal.y * toward.y);
    return select(along * 0.70710678, along, (d & 1u) == 0u);
}
