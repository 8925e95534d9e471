// Drops samples if at least half of the samples in reach are clearly nearer. Twin: `stages/src/reach_cull.rs`.
// Every pass reads what the previous pass left and writes the other image; the last one writes id.

#import cloud
#import edge_pixel
#import frame
#import pixel

struct Params {
    threshold: f32,
    passes: u32,
}

@group(0) @binding(1) var<uniform> params: Params;
@group(0) @binding(2) var<storage, read> kept: array<u32>;
@group(0) @binding(3) var<storage, read> depth: array<u32>;
@group(0) @binding(4) var<storage, read> r24: array<u32>;
@group(0) @binding(5) var<storage, read_write> cls: array<u32>;
@group(0) @binding(6) var<storage, read_write> id: array<u32>;
@group(0) @binding(7) var<storage, read_write> spare: array<u32>;

// The images that passes read.
const KEPT: u32 = 0u;
const ID: u32 = 1u;
const SPARE: u32 = 2u;

fn load(image: u32, p: u32) -> u32 {
    switch image {
        case KEPT: { return kept[p]; }
        case ID: { return id[p]; }
        default: { return spare[p]; }
    }
}

// The sample of a pixel if it stays.
fn judge(image: u32, pixel: vec2<u32>) -> u32 {
    let p = pixel_index(pixel);
    let own = load(image, p);
    if own == NO_POINT {
        return NO_POINT;
    }
    let z = bitcast<f32>(depth[p]);
    let scale = 1.0 + params.threshold;
    var count = 0u;
    var nearer = 0u;
    var rest = r24[p];
    while rest != 0u {
        let k = firstTrailingBit(rest);
        rest &= rest - 1u;
        let raw = i32(k + u32(k >= 12u));
        let at = vec2<i32>(pixel) + vec2(raw % 5, raw / 5) - 2;
        // Bits never point outside the image; this guards against invalid input.
        if is_outside(at) {
            continue;
        }
        let q = pixel_index(vec2<u32>(at));
        if load(image, q) != NO_POINT {
            count += 1u;
            nearer += u32(bitcast<f32>(depth[q]) * scale < z);
        }
    }
    return select(own, NO_POINT, count > 0u && 2u * nearer >= count);
}

fn store_id(pixel: vec2<u32>, sample: u32) {
    let p = pixel_index(pixel);
    id[p] = sample;
    if sample == NO_POINT {
        cls[p] &= ~VALID;
    }
}

@compute @workgroup_size(8, 8, 1)
fn copy(@builtin(global_invocation_id) pixel: vec3<u32>) {
    if all(pixel.xy < frame.size) {
        store_id(pixel.xy, kept[pixel_index(pixel.xy)]);
    }
}

@compute @workgroup_size(8, 8, 1)
fn kept_to_id(@builtin(global_invocation_id) pixel: vec3<u32>) {
    if all(pixel.xy < frame.size) {
        store_id(pixel.xy, judge(KEPT, pixel.xy));
    }
}

@compute @workgroup_size(8, 8, 1)
fn kept_to_spare(@builtin(global_invocation_id) pixel: vec3<u32>) {
    if all(pixel.xy < frame.size) {
        spare[pixel_index(pixel.xy)] = judge(KEPT, pixel.xy);
    }
}

@compute @workgroup_size(8, 8, 1)
fn spare_to_id(@builtin(global_invocation_id) pixel: vec3<u32>) {
    if all(pixel.xy < frame.size) {
        store_id(pixel.xy, judge(SPARE, pixel.xy));
    }
}

@compute @workgroup_size(8, 8, 1)
fn id_to_spare(@builtin(global_invocation_id) pixel: vec3<u32>) {
    if all(pixel.xy < frame.size) {
        spare[pixel_index(pixel.xy)] = judge(ID, pixel.xy);
    }
}
