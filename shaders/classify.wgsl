// Classes of pixels, primary regions, samples kept, and where to aim the next one. Twin: `stages/src/classify.rs`.

#import frame
#import edge_pixel
#import requests

struct Params {
    subpixel_bits: u32,
    ambiguous: u32,
}

const DROP: u32 = 0u;

@group(0) @binding(1) var<uniform> params: Params;
@group(0) @binding(2) var<storage, read> mask: array<u32>;
@group(0) @binding(3) var<storage, read> id: array<u32>;
@group(0) @binding(4) var<storage, read> subpixel: array<u32>;
@group(0) @binding(5) var<storage, read_write> cls: array<u32>;
@group(0) @binding(6) var<storage, read_write> kept: array<u32>;
@group(0) @binding(7) var<storage, read_write> aim: array<u32>;

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

// How far twice the chord's function at a cell's corners lies from that at its centre, at most: where the latter is
// larger the chord does not touch the cell.
fn reach_of(chord: Chord) -> i32 {
    return i32(16u >> cells_log2()) * (abs(chord.normal.x) + abs(chord.normal.y));
}

// Where to aim in a simple pixel with this chord.
fn aim_of(chord: Chord, is_a: bool) -> u32 {
    // The square of the four cells that meet at the centre is twice as wide as a cell.
    if abs(chord_side(chord, vec2(8))) > reach_of(chord) {
        return AIM_CENTER;
    }
    // The chord's function grows towards A, so a corner cell is the farthest from the chord.
    let last = (1u << cells_log2()) - 1u;
    let cell = select(vec2(0u), vec2(last), (chord.normal > vec2(0)) == vec2(is_a));
    let middle = (2u * cell + 1u) << vec2(15u - cells_log2());
    return middle.x | (middle.y << 16u);
}

@compute @workgroup_size(8, 8, 1)
fn classify(@builtin(global_invocation_id) pixel: vec3<u32>) {
    if any(pixel.xy >= frame.size) {
        return;
    }
    let p = pixel.y * frame.size.x + pixel.x;
    let corner = p + pixel.y;
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
    aim[p] = AIM_CENTER;
    if (bits & CLASS) != SIMPLE {
        bits |= PRIMARY_IS_A | (PIXEL_AREA << AREA_SHIFT);
    } else {
        let ends = vec2(firstTrailingBit(ring), firstLeadingBit(ring));
        let chord = chord_of(ends.x, ends.y);
        var area = area_of_a(ends.x, ends.y);
        // Without a sample the larger region is the primary one.
        var is_a = 2u * area >= PIXEL_AREA;
        if has_sample {
            let distance = distance_of(chord, cell);
            let is_ambiguous = abs(distance) <= reach_of(chord);
            if is_ambiguous {
                bits |= AMBIGUOUS;
            }
            if is_ambiguous && params.ambiguous == DROP {
                bits &= ~VALID;
            } else if distance != 0 {
                is_a = distance > 0;
            }
        }
        area = select(PIXEL_AREA - area, area, is_a);
        bits |= (ends.x << P_SHIFT) | (ends.y << Q_SHIFT) | (u32(is_a) * PRIMARY_IS_A) | (area << AREA_SHIFT);
        aim[p] = aim_of(chord, is_a);
    }
    cls[p] = bits;
    kept[p] = select(NO_POINT, id[p], (bits & VALID) != 0u);
}
