// Colours complex pixels by quarters, each from the samples that no edge separates from it. Twin:
// `stages/src/subdivide.rs`.

#import cloud
#import edge_pixel
#import frame
#import pixel

struct Params {
    sigma: f32,
    subpixel_bits: u32,
}

// The region of a missing tap.
const NONE: u32 = 2u;

@group(0) @binding(1) var<uniform> params: Params;
@group(0) @binding(2) var<storage, read> cloud_radiance: array<u32>;
@group(0) @binding(3) var<storage, read> id: array<u32>;
@group(0) @binding(4) var<storage, read> subpixel: array<u32>;
@group(0) @binding(5) var<storage, read> mask: array<u32>;
@group(0) @binding(6) var<storage, read> cls: array<u32>;
@group(0) @binding(7) var primary: texture_2d<f32>;
@group(0) @binding(8) var color: texture_storage_2d<rgba32float, write>;

// The quarters of the 3x3 pixels around one, row by row: class and chord of each; the matrices of each and its right
// (bits 0 to 3) and lower (4 to 7) neighbours.
struct Window {
    quarters: array<u32, QUARTERS>,
    pairs: array<u32, QUARTERS>,
}

// A colour somewhere in the window: the quarter and its region, the place in 1/32 pixel from the window's top left
// corner.
struct Tap {
    quarter: u32,
    region: u32,
    at: vec2<i32>,
    rgb: vec3<f32>,
}

const NO_TAP: Tap = Tap(0u, NONE, vec2(0), vec3(0.0));

@compute @workgroup_size(8, 8, 1)
fn subdivide(@builtin(global_invocation_id) pixel: vec3<u32>) {
    if any(pixel.xy >= frame.size) {
        return;
    }
    var result = textureLoad(primary, pixel.xy, 0);
    if (cls[pixel_index(pixel.xy)] & CLASS) == COMPLEX {
        result = vec4(color_of(vec2<i32>(pixel.xy), result.rgb), result.a);
    }
    textureStore(color, pixel.xy, result);
}

// The colour of a complex pixel.
fn color_of(pixel: vec2<i32>, mean: vec3<f32>) -> vec3<f32> {
    var window = window_of(pixel);
    var samples: array<Tap, 9>;
    for (var place = 0u; place < PIXELS * PIXELS; place++) {
        samples[place] = sample_of(&window, pixel, place);
    }

    var sum = vec3(0.0);
    for (var own = 0u; own < 4u; own++) {
        let start = 2u + vec2(own & 1u, own >> 1u);
        var reached = reached_from(&window, start);
        let areas = areas_of(window.quarters[SPAN * start.y + start.x]);
        for (var region = 0u; region < 2u; region++) {
            if areas[region] == 0u {
                continue;
            }
            var taps = vec4(0.0);
            for (var place = 0u; place < PIXELS * PIXELS; place++) {
                taps += weighted(samples[place], &reached, start, region);
            }
            if taps.w == 0.0 {
                for (var quarter = 0u; quarter < QUARTERS; quarter++) {
                    taps += weighted(corner_of(&window, pixel, quarter), &reached, start, region);
                }
            }
            var rgb = mean;
            if taps.w > 0.0 {
                rgb = taps.rgb / taps.w;
            }
            sum += f32(areas[region]) * rgb;
        }
    }
    return sum / f32(PIXEL_AREA);
}

// A tap's colour and 1, times its weight, if a region of a quarter reaches it.
fn weighted(tap: Tap, reached: ptr<function, array<u32, QUARTERS>>, quarter: vec2<u32>, region: u32) -> vec4<f32> {
    if tap.region == NONE || (((*reached)[tap.quarter] >> (2u * region + tap.region)) & 1u) == 0u {
        return vec4(0.0);
    }
    let d = tap.at - (16 * vec2<i32>(quarter) + 8);
    let scale = 0.5 / (32.0 * 32.0 * params.sigma * params.sigma);
    return exp(-f32(d.x * d.x + d.y * d.y) * scale) * vec4(tap.rgb, 1.0);
}

// ---- Quarters

// Class and chord of a quarter, in the bits of `cls`, with A as the primary region.
fn classify(ring: u32) -> u32 {
    let bits = class_of(ring) | PRIMARY_IS_A;
    if (bits & CLASS) != SIMPLE {
        return bits;
    }
    return bits | (firstTrailingBit(ring) << P_SHIFT) | (firstLeadingBit(ring) << Q_SHIFT);
}

// Centre of a slot, in 1/16 pixel from the quarter's top left corner.
fn quarter_slot(slot: u32) -> vec2<i32> {
    let along = 2 * i32(slot & 3u) + 1;
    switch slot >> 2u {
        case 0u: { return vec2(along, 0); }
        case 1u: { return vec2(8, along); }
        case 2u: { return vec2(8 - along, 8); }
        default: { return vec2(0, 8 - along); }
    }
}

// The areas of a quarter's regions, in 1/512 pixel.
fn areas_of(quarter: u32) -> vec2<u32> {
    if (quarter & CLASS) != SIMPLE {
        return vec2(QUARTER_AREA, 0u);
    }
    let ends = ends_of(quarter);
    let first = quarter_slot(ends.x);
    let end = quarter_slot(ends.y);
    // The polygon of A: along the ring from p over the corners to q, and back along the chord.
    var doubled = 0;
    var last = first;
    for (var position = 4u; position <= 12u; position += 4u) {
        if ends.x < position && position <= ends.y {
            let corner = vec2(select(8, 0, position == 12u), select(8, 0, position == 4u));
            doubled += cross_of(last, corner);
            last = corner;
        }
    }
    let a = u32(doubled + cross_of(last, end) + cross_of(end, first));
    return vec2(a, QUARTER_AREA - a);
}

// The region of a quarter that contains a square cell, or NONE: `corner` is its top left one and `size` the length of
// its sides, in 1/16 pixel.
fn region_of_cell(quarter: u32, corner: vec2<i32>, size: i32) -> u32 {
    if (quarter & CLASS) != SIMPLE {
        return select(NONE, 0u, (quarter & CLASS) == EMPTY);
    }
    let ends = ends_of(quarter);
    let chord = chord_between(quarter_slot(ends.x), quarter_slot(ends.y));
    // Twice the chord's function at the cell's centre, and its maximum difference to that at a corner.
    let distance = chord_side(chord, corner) + chord_side(chord, corner + size);
    let reach = size * (abs(chord.normal.x) + abs(chord.normal.y));
    return select(NONE, u32(distance < 0), abs(distance) > reach);
}

// Which regions of two quarters touch at the side that they share: the right one of P, or the lower one.
fn joined(p: u32, q: u32, crossings: u32, is_right: bool) -> u32 {
    if ((p | q) & CLASS) == EMPTY {
        return 1u;
    }
    if ((p | q) & COMPLEX) != 0u {
        return 0u;
    }
    // The crossings cut the side into intervals; each joins the regions at its middle.
    var rest = crossings;
    var start = 0u;
    var joined = 0u;
    loop {
        // In half slots; the side's end is 8.
        let end = select(2u * firstTrailingBit(rest) + 1u, 8u, rest == 0u);
        let t = start + end;
        let places = select(vec2(48u - t, t), vec2(16u + t, 64u - t), is_right);
        joined |= 1u << (2u * region_of(p, places.x) + region_of(q, places.y));
        if rest == 0u {
            break;
        }
        rest &= rest - 1u;
        start = end;
    }
    return joined;
}

// ---- The window

// The pixel at a position among the 3x3 around one.
fn neighbour(pixel: vec2<i32>, place: vec2<u32>) -> vec2<i32> {
    return pixel + vec2<i32>(place) - 1;
}

// The four slots of the left (axis 0) or top (axis 1) side of a quarter, given its column and row in the image.
fn side_of(quarter: vec2<u32>, axis: u32) -> u32 {
    let word = mask[corner_index(quarter / 2u)];
    return (word >> (16u * (quarter[axis] & 1u) + 8u * axis + 4u * (quarter[1u - axis] & 1u))) & 15u;
}

// Classes and matrices of the quarters around a pixel.
fn window_of(pixel: vec2<i32>) -> Window {
    var window: Window;
    for (var q = 0u; q < QUARTERS; q++) {
        let place = vec2(q % SPAN, q / SPAN);
        window.quarters[q] = COMPLEX;
        if !is_outside(neighbour(pixel, place / 2u)) {
            let at = vec2<u32>(2 * (pixel - 1) + vec2<i32>(place));
            let left = side_of(at, 0u);
            let top = side_of(at, 1u);
            let right = side_of(at + vec2(1u, 0u), 0u);
            let bottom = side_of(at + vec2(0u, 1u), 1u);
            let below = reverseBits(bottom) >> 28u;
            let before = reverseBits(left) >> 28u;
            window.quarters[q] = classify(top | (right << 4u) | (below << 8u) | (before << 12u));
        }
    }
    for (var q = 0u; q < QUARTERS; q++) {
        let place = vec2(q % SPAN, q / SPAN);
        window.pairs[q] = 0u;
        if !is_outside(neighbour(pixel, place / 2u)) {
            let at = vec2<u32>(2 * (pixel - 1) + vec2<i32>(place));
            let own = window.quarters[q];
            if place.x + 1u < SPAN {
                let right = side_of(at + vec2(1u, 0u), 0u);
                window.pairs[q] = joined(own, window.quarters[q + 1u], right, true);
            }
            if place.y + 1u < SPAN {
                let bottom = side_of(at + vec2(0u, 1u), 1u);
                window.pairs[q] |= joined(own, window.quarters[q + SPAN], bottom, false) << 4u;
            }
        }
    }
    return window;
}

// For each quarter, the matrix of this one and it: which regions reach which.
fn reached_from(window: ptr<function, Window>, start: vec2<u32>) -> array<u32, QUARTERS> {
    var reached: array<u32, QUARTERS>;
    // Outwards, so that the quarters a step nearer are ready: from the start to the end, then back to the beginning.
    for (var i = 0u; i < SPAN; i++) {
        let v = select(SPAN - 1u - i, start.y + i, start.y + i < SPAN);
        for (var j = 0u; j < SPAN; j++) {
            let u = select(SPAN - 1u - j, start.x + j, start.x + j < SPAN);
            let q = SPAN * v + u;
            var matrix = 0u;
            if u > start.x {
                matrix |= chain(reached[q - 1u], (*window).pairs[q - 1u] & 15u);
            } else if u < start.x {
                matrix |= chain(reached[q + 1u], transpose_of((*window).pairs[q] & 15u));
            }
            if v > start.y {
                matrix |= chain(reached[q - SPAN], (*window).pairs[q - SPAN] >> 4u);
            } else if v < start.y {
                matrix |= chain(reached[q + SPAN], transpose_of((*window).pairs[q] >> 4u));
            }
            if u == start.x && v == start.y {
                let own = (*window).quarters[q] & CLASS;
                matrix = select(select(0u, 9u, own == SIMPLE), 1u, own == EMPTY);
            }
            reached[q] = matrix;
        }
    }
    return reached;
}

// ---- Taps

// The sample at a position among the 3x3 pixels, if there is one and its region is known.
fn sample_of(window: ptr<function, Window>, pixel: vec2<i32>, nth: u32) -> Tap {
    let place = vec2(nth % PIXELS, nth / PIXELS);
    let at = neighbour(pixel, place);
    if is_outside(at) || id[pixel_index(vec2<u32>(at))] == NO_POINT {
        return NO_TAP;
    }
    let p = pixel_index(vec2<u32>(at));
    let cells_log2 = params.subpixel_bits / 2u;
    let size = 16u >> cells_log2;
    let cell = (vec2(subpixel[p]) >> vec2(0u, cells_log2)) & vec2((1u << cells_log2) - 1u);
    // The cell's corner in 1/16 pixel from the window's.
    let corner = vec2<i32>(16u * place + size * cell);
    let quarter = SPAN * u32(corner.y >> 3u) + u32(corner.x >> 3u);
    let region = region_of_cell((*window).quarters[quarter], corner & vec2(7), i32(size));
    return Tap(quarter, region, 2 * corner + i32(size), decode_radiance(cloud_radiance[id[p]]));
}

// The colour of the quarter's pixel, at the corner that they share, if that is in the primary region.
fn corner_of(window: ptr<function, Window>, pixel: vec2<i32>, quarter: u32) -> Tap {
    let place = vec2(quarter % SPAN, quarter / SPAN);
    let at = neighbour(pixel, place / 2u);
    if is_outside(at) {
        return NO_TAP;
    }
    // Clockwise from the top left one.
    let odd = place & vec2(1u);
    let nth = select(odd.x, 3u - odd.x, odd.y == 1u);
    let own = (*window).quarters[quarter];
    let whole = cls[pixel_index(vec2<u32>(at))];
    if ((whole | own) & COMPLEX) != 0u || region_of(whole, 32u * nth) != 0u {
        return NO_TAP;
    }
    return Tap(quarter, region_of(own, 16u * nth), vec2<i32>(16u * (place + odd)), textureLoad(primary, at, 0).rgb);
}
