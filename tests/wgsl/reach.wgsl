//! Which pixels of the 5x5 around each can be reached without crossing an edge.
//! = column I2

#import edge_pixel
#import frame
#import pixel

struct Params {
    /// Which pixels of the inner ring lead to one of the outer ring.
    /// = Narrow of Narrow, Wide
    rule: u32,
    /// One pass over tiles in workgroup memory, or three: neighbours, main_half and copy_half.
    /// = Fused of Fused, ThreePass
    method: u32,
}

// N8 and R24 where all pixels around are empty.
const ALL_NEIGHBOURS: u32 = 0x11111111u;
const ALL_REACHED: u32 = 0xFFFFFFu;

// The bits of R24 for the pixels that come after the centre in reading order.
const MAIN_HALF: u32 = 0xFFF000u;

@group(0) @binding(1) var<uniform> params: Params;
/// = per corner, means crossings
@group(0) @binding(2) var<storage, read> mask: array<u32>;
/// = per pixel, means class
@group(0) @binding(3) var<storage, read> cls: array<u32>;
/// Joined regions of the eight neighbours: four bits each for E, SE, S, SW, W, NW, N, NE.
/// = output, per pixel, means joins
@group(0) @binding(4) var<storage, read_write> n8: array<u32>;
/// Bit k: the k-th of the other 5x5 pixels, in reading order, can be reached.
/// = output, per pixel, means reach
@group(0) @binding(5) var<storage, read_write> r24: array<u32>;

fn cls_at(at: vec2<i32>) -> u32 {
    if is_outside(at) {
        return COMPLEX;
    }
    return cls[pixel_index(vec2<u32>(at))];
}

fn mask_at(at: vec2<i32>) -> u32 {
    return mask[corner_index(vec2<u32>(at))];
}

// Which regions of two simple or empty pixels touch at the side that they share, with these crossings. A position on
// the side maps to a position on each ring, in quarters of a slot: the side's start there plus or minus the position.
fn joined_by(p: u32, q: u32, crossings: u32, starts: vec2<u32>, steps: vec2<u32>) -> u32 {
    // The crossings cut the side into intervals; each joins the regions at its middle.
    var rest = crossings;
    var start = 0u;
    var joined = 0u;
    loop {
        // In half slots; the side's end is 16.
        let end = select(2u * firstTrailingBit(rest) + 1u, 16u, rest == 0u);
        let places = starts + steps * (start + end);
        joined |= 1u << (2u * region_of(p, places.x) + region_of(q, places.y));
        if rest == 0u {
            break;
        }
        rest &= rest - 1u;
        start = end;
    }
    return joined;
}

// Steps along a ring: forwards and, wrapping, backwards.
const FORWARDS: u32 = 1u;
const BACKWARDS: u32 = 0xFFFFFFFFu;

// The matrices of the pixel at a place and its right (bits 0 to 3) and lower (4 to 7) neighbours.
fn pair_of(at: vec2<i32>, own: u32, right: u32, below: u32) -> u32 {
    var east = u32(((own | right) & CLASS) == EMPTY);
    if ((own | right) & CLASS) == SIMPLE {
        let crossings = mask_at(at + vec2(1, 0)) & 0xFFu;
        east = joined_by(own, right, crossings, vec2(32u, 128u), vec2(FORWARDS, BACKWARDS));
    }
    var south = u32(((own | below) & CLASS) == EMPTY);
    if ((own | below) & CLASS) == SIMPLE {
        let crossings = (mask_at(at + vec2(0, 1)) >> 8u) & 0xFFu;
        south = joined_by(own, below, crossings, vec2(96u, 0u), vec2(BACKWARDS, FORWARDS));
    }
    return east | (south << 4u);
}

// N8 of the pixel at a place.
fn neighbours_of(at: vec2<i32>) -> u32 {
    let own = pair_at(at);
    let west = pair_at(at + vec2(-1, 0));
    let north = pair_at(at + vec2(0, -1));
    let north_west = pair_at(at + vec2(-1, -1));
    let e = own & 15u;
    let s = own >> 4u;
    let w = transpose_of(west & 15u);
    let n = transpose_of(north >> 4u);
    let se = chain(e, pair_at(at + vec2(1, 0)) >> 4u) | chain(s, pair_at(at + vec2(0, 1)) & 15u);
    let sw = chain(s, transpose_of(pair_at(at + vec2(-1, 1)) & 15u)) | chain(w, west >> 4u);
    let nw = chain(w, transpose_of(north_west >> 4u)) | chain(n, transpose_of(north_west & 15u));
    let ne = chain(n, north & 15u) | chain(e, transpose_of(pair_at(at + vec2(1, -1)) >> 4u));
    return e | (se << 4u) | (s << 8u) | (sw << 12u) | (w << 16u) | (nw << 20u) | (n << 24u) | (ne << 28u);
}

// The bit of R24 for an offset.
fn bit_of(offset: vec2<i32>) -> u32 {
    let raw = (offset.y + 2) * 5 + offset.x + 2;
    return 1u << u32(raw - i32(raw > 12));
}

// R24 of the pixel at a place.
fn reached_from(at: vec2<i32>) -> u32 {
    let own = n8_at(at);
    var reached = 0u;
    for (var d = 0u; d < 8u; d++) {
        let matrix = own >> (4u * d);
        let offset = direction(d);
        reached |= if_odd(matrix, bit_of(offset));
        // Bit 4 d: the path continues in direction d, from a region of the neighbour that is joined to the primary
        // region here.
        let next = n8_at(at + offset);
        let onward = if_odd(matrix, next) | if_odd(matrix >> 1u, next >> 2u);
        let most = select(1u, 2u, params.rule == RULE_WIDE && (d & 1u) == 1u);
        for (var turned = d + 8u - most; turned <= d + 8u + most; turned++) {
            reached |= if_odd(onward >> (4u * (turned & 7u)), bit_of(offset + direction(turned)));
        }
    }
    return reached;
}

#ifdef METHOD_FUSED
// Pixels on each side of a workgroup's tile, without and with the margin that the tile depends on.
const GROUP: u32 = 16u;
const SIDE: u32 = GROUP + 4u;

// Whether any pixel is not empty.
var<workgroup> busy: atomic<u32>;
var<workgroup> tile_cls: array<u32, SIDE * SIDE>;
var<workgroup> tile_pairs: array<u32, SIDE * SIDE>;
var<workgroup> tile_n8: array<u32, SIDE * SIDE>;

// Positions are relative to the first of these pixels.
fn tile_index(at: vec2<i32>) -> u32 {
    return u32(at.y) * SIDE + u32(at.x);
}

fn pair_at(at: vec2<i32>) -> u32 {
    return tile_pairs[tile_index(at)];
}

fn n8_at(at: vec2<i32>) -> u32 {
    return tile_n8[tile_index(at)];
}

@compute @workgroup_size(16, 16, 1)
fn fused(
    @builtin(local_invocation_id) local: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
    @builtin(workgroup_id) group: vec3<u32>,
) {
    let base = vec2<i32>(group.xy * GROUP) - 2;
    for (var i = lane; i < SIDE * SIDE; i += GROUP * GROUP) {
        let own = cls_at(base + vec2<i32>(vec2(i % SIDE, i / SIDE)));
        tile_cls[i] = own;
        if (own & CLASS) != EMPTY {
            atomicOr(&busy, 1u);
        }
    }
    workgroupBarrier();
    // Barriers have to stay in uniform control flow.
    let is_busy = atomicLoad(&busy) != 0u;
    if is_busy {
        for (var i = lane; i < SIDE * SIDE; i += GROUP * GROUP) {
            let at = vec2(i % SIDE, i / SIDE);
            // Nothing depends on the pixels to the right of and below these.
            let right = select(COMPLEX, tile_cls[min(i + 1u, SIDE * SIDE - 1u)], at.x + 1u < SIDE);
            let below = select(COMPLEX, tile_cls[min(i + SIDE, SIDE * SIDE - 1u)], at.y + 1u < SIDE);
            tile_pairs[i] = pair_of(base + vec2<i32>(at), tile_cls[i], right, below);
        }
    }
    workgroupBarrier();
    if is_busy {
        for (var i = lane; i < (GROUP + 2u) * (GROUP + 2u); i += GROUP * GROUP) {
            let at = vec2<i32>(vec2(i % (GROUP + 2u), i / (GROUP + 2u))) + 1;
            tile_n8[tile_index(at)] = neighbours_of(at);
        }
    }
    workgroupBarrier();
    let at = vec2<i32>(local.xy) + 2;
    if is_outside(base + at) {
        return;
    }
    let p = pixel_index(vec2<u32>(base + at));
    if is_busy {
        n8[p] = n8_at(at);
        r24[p] = reached_from(at);
    } else {
        n8[p] = ALL_NEIGHBOURS;
        r24[p] = ALL_REACHED;
    }
}
#else
/// The half of r24 that is not copied.
/// = scratch, per pixel
@group(0) @binding(6) var<storage, read_write> half: array<u32>;

fn pair_at(at: vec2<i32>) -> u32 {
    return pair_of(at, cls_at(at), cls_at(at + vec2(1, 0)), cls_at(at + vec2(0, 1)));
}

fn n8_at(at: vec2<i32>) -> u32 {
    if is_outside(at) {
        return 0u;
    }
    return n8[pixel_index(vec2<u32>(at))];
}

@compute @workgroup_size(8, 8, 1)
fn neighbours(@builtin(global_invocation_id) pixel: vec3<u32>) {
    let at = vec2<i32>(pixel.xy);
    if !is_outside(at) {
        n8[pixel_index(vec2<u32>(at))] = neighbours_of(at);
    }
}

@compute @workgroup_size(8, 8, 1)
fn main_half(@builtin(global_invocation_id) pixel: vec3<u32>) {
    let at = vec2<i32>(pixel.xy);
    if !is_outside(at) {
        half[pixel_index(vec2<u32>(at))] = reached_from(at) & MAIN_HALF;
    }
}

// Reachability is symmetric.
@compute @workgroup_size(8, 8, 1)
fn copy_half(@builtin(global_invocation_id) pixel: vec3<u32>) {
    let at = vec2<i32>(pixel.xy);
    if is_outside(at) {
        return;
    }
    var reached = half[pixel_index(vec2<u32>(at))];
    for (var k = 0; k < 12; k++) {
        let other = at + vec2(k % 5, k / 5) - 2;
        if !is_outside(other) {
            reached |= ((half[pixel_index(vec2<u32>(other))] >> u32(23 - k)) & 1u) << u32(k);
        }
    }
    r24[pixel_index(vec2<u32>(at))] = reached;
}
#endif
