//! Classes of pixels, primary regions, kept samples, and where to aim the next one.
//! = column I1

#import cloud
#import edge_pixel
#import frame
#import pixel
#import requests

struct Params {
    /// Bits of the sub-pixel cell, half of them for each axis: the same as those of the projection.
    /// = 8 in 4..8 unit bits
    subpixel_bits: u32,
    /// How to treat a sample whose cell touches the chord.
    /// = Drop of Drop, Guess
    ambiguous: u32,
}

@group(0) @binding(1) var<uniform> params: Params;
/// = per corner, means crossings
@group(0) @binding(2) var<storage, read> mask: array<u32>;
/// = per pixel
@group(0) @binding(3) var<storage, read> id: array<u32>;
/// = per pixel, means cell
@group(0) @binding(4) var<storage, read> subpixel: array<u32>;
/// Class, chord, primary region and state of the sample, as bits.
/// = output, per pixel, means class
@group(0) @binding(5) var<storage, read_write> cls: array<u32>;
/// The point that the pixel shows, without those that are dropped.
/// = output, per pixel, means kept id
@group(0) @binding(6) var<storage, read_write> kept: array<u32>;
/// = output, per pixel
@group(0) @binding(7) var<storage, read_write> aim: array<u32>;
#ifdef HAS_VERTEX
/// = optional, per pixel, means turn
@group(0) @binding(8) var<storage, read> vertex: array<u32>;
#endif

// An edge: the chord, or if it bends, the halves from the first crossing to the vertex and on to the second, with the
// chord's function at the vertex: negative if the edge bends into B. It is also the triangle's area, in 1/512 pixel.
struct Edge {
    chord: Chord,
    halves: array<Chord, 2>,
    side: i32,
}

fn edge_of(ends: vec2<u32>, p: u32) -> Edge {
    let chord = chord_of(ends.x, ends.y);
    var edge = Edge(chord, array(chord, chord), 0);
#ifdef HAS_VERTEX
    if vertex[p] != 0u {
        let at = vec2<i32>((vec2(vertex[p]) >> vec2(0u, 8u)) & vec2(0xFFu));
        edge.side = chord_side(chord, at);
        // A vertex on the chord does not bend the edge.
        if edge.side != 0 {
            edge.halves[0] = chord_between(slot_position(ends.x), at);
            edge.halves[1] = chord_between(at, slot_position(ends.y));
        }
    }
#endif
    return edge;
}

// The side of a square, from the functions of both halves at its centre and their maximum change within it: x is
// positive for region A and negative for B, y is 0 if the edge does not touch the square.
fn locate(edge: Edge, distance: vec2<i32>, reach: vec2<i32>) -> vec2<i32> {
    if edge.side == 0 {
        return vec2(distance.x, i32(abs(distance.x) <= reach.x));
    }
    // Region A is inside the corner if the edge bends into B.
    let inwards = -sign(edge.side) * distance;
    let is_inside = all(inwards > reach);
    let is_outside = any(inwards < -reach);
    return vec2(-sign(edge.side) * min(inwards.x, inwards.y), i32(!is_inside && !is_outside));
}

// Logarithm of the number of cells of an axis, 2 to 4.
fn cells_log2() -> u32 {
    return params.subpixel_bits / 2u;
}

// Twice the chord's function at the centre of a cell.
fn distance_of(chord: Chord, cell: vec2<u32>) -> i32 {
    let size = i32(16u >> cells_log2());
    let corner = vec2<i32>(cell) * size;
    return chord_side(chord, corner) + chord_side(chord, corner + size);
}

// Maximum difference between twice the chord's function at a cell's corners and at its centre: if the value at the
// centre is larger, the chord does not touch the cell.
fn reach_of(chord: Chord) -> i32 {
    return i32(16u >> cells_log2()) * (abs(chord.normal.x) + abs(chord.normal.y));
}

// The same for both halves.
fn reaches_of(edge: Edge) -> vec2<i32> {
    return vec2(reach_of(edge.halves[0]), reach_of(edge.halves[1]));
}

// Where to aim in a simple pixel with this edge.
fn aim_of(edge: Edge, is_a: bool) -> u32 {
    // The square of the four cells that meet at the centre is twice as wide as a cell.
    let middle_distance = vec2(chord_side(edge.halves[0], vec2(8)), chord_side(edge.halves[1], vec2(8)));
    if locate(edge, middle_distance, reaches_of(edge)).y == 0 {
        return PIXEL_CENTER;
    }
    // The chord's function grows towards A, so a corner cell is the farthest from the chord.
    let last = (1u << cells_log2()) - 1u;
    let cell = select(vec2(0u), vec2(last), (edge.chord.normal > vec2(0)) == vec2(is_a));
    let middle = (2u * cell + 1u) << vec2(15u - cells_log2());
    return middle.x | (middle.y << 16u);
}

@compute @workgroup_size(8, 8, 1)
fn classify(@builtin(global_invocation_id) pixel: vec3<u32>) {
    if any(pixel.xy >= frame.size) {
        return;
    }
    let p = pixel_index(pixel.xy);
    let corner = corner_index(pixel.xy);
    let own = mask[corner];
    let right = mask[corner + 1u];
    let below = mask[corner + 1u + frame.size.x];
    let ring = ring_of(own & 0xFFu, (own >> 8u) & 0xFFu, right & 0xFFu, (below >> 8u) & 0xFFu);

    let has_sample = id[p] != NO_POINT;
    let cell = (vec2(subpixel[p]) >> vec2(0u, cells_log2())) & vec2((1u << cells_log2()) - 1u);
    var bits = class_of(ring);
    if has_sample {
        let coarse = cell >> vec2(cells_log2() - 2u);
        bits |= (((coarse.y << 2u) | coarse.x) << CELL_SHIFT) | VALID;
    }
    aim[p] = PIXEL_CENTER;
    if (bits & CLASS) != SIMPLE {
        bits |= PRIMARY_IS_A | (PIXEL_AREA << AREA_SHIFT);
    } else {
        let ends = vec2(firstTrailingBit(ring), firstLeadingBit(ring));
        let edge = edge_of(ends, p);
        // The triangle between chord and vertex belongs to the other side.
        var area = u32(i32(area_of_a(ends.x, ends.y)) - edge.side);
        // Without a sample the larger region is the primary one.
        var is_a = 2u * area >= PIXEL_AREA;
        if has_sample {
            let distances = vec2(distance_of(edge.halves[0], cell), distance_of(edge.halves[1], cell));
            let located = locate(edge, distances, reaches_of(edge));
            let distance = located.x;
            let is_ambiguous = located.y != 0;
            if is_ambiguous {
                bits |= AMBIGUOUS;
            }
            if is_ambiguous && params.ambiguous == AMBIGUOUS_DROP {
                bits &= ~VALID;
            } else if distance != 0 {
                is_a = distance > 0;
            }
        }
        area = select(PIXEL_AREA - area, area, is_a);
        bits |= (ends.x << P_SHIFT) | (ends.y << Q_SHIFT) | (u32(is_a) * PRIMARY_IS_A) | (area << AREA_SHIFT);
        aim[p] = aim_of(edge, is_a);
    }
    cls[p] = bits;
    kept[p] = select(NO_POINT, id[p], (bits & VALID) != 0u);
}
