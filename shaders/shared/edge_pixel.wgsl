// How edges divide a pixel: crossings with its sides, its class, its two regions, and the 2x2 Boolean matrices of which
// regions of two pixels are joined. Mirrors `stages/src/shared/edge_pixel.rs`, which explains the ring of slots
// and declares the constants: the classes EMPTY, SIMPLE and COMPLEX, the bits of `cls` and PIXEL_AREA.

// The neighbour in direction d: E, SE, S, SW, W, NW, N, NE. Two bits for each component plus one: an array would be
// copied to memory wherever d is not a constant.
fn direction(d: u32) -> vec2<i32> {
    let shift = 2u * (d & 7u);
    return vec2<i32>((vec2(0x901Au, 0x01A9u) >> vec2(shift)) & vec2(3u)) - 1;
}

// The pixel of bit k in `r24`, from the pixel in the middle: the k-th other one of 5x5, in reading order.
fn offset_of(k: u32) -> vec2<i32> {
    let at = i32(k + u32(k >= 12u));
    return vec2(at % 5, at / 5) - 2;
}

// The perimeter of a pixel from the 8-bit masks of its sides.
fn ring_of(left: u32, top: u32, right: u32, bottom: u32) -> u32 {
    return top | (right << 8u) | ((reverseBits(bottom) >> 24u) << 16u) | ((reverseBits(left) >> 24u) << 24u);
}

// The class of a pixel with this perimeter.
fn class_of(ring: u32) -> u32 {
    return min(max(countOneBits(ring), 1u) - 1u, COMPLEX);
}

// The crossed slots p < q of a simple pixel.
fn ends_of(cls: u32) -> vec2<u32> {
    return (vec2(cls) >> vec2(P_SHIFT, Q_SHIFT)) & vec2(31u);
}

// The area of the primary region, in 1/512 pixel.
fn primary_area(cls: u32) -> u32 {
    return (cls >> AREA_SHIFT) & 0x3FFu;
}

// Centre of a slot, in 1/16 pixel from the pixel's top left corner.
fn slot_position(slot: u32) -> vec2<i32> {
    let along = 2 * i32(slot & 7u) + 1;
    switch slot >> 3u {
        case 0u: { return vec2(along, 0); }
        case 1u: { return vec2(16, along); }
        case 2u: { return vec2(16 - along, 16); }
        default: { return vec2(0, 16 - along); }
    }
}

fn cross_of(a: vec2<i32>, b: vec2<i32>) -> i32 {
    return a.x * b.y - b.x * a.y;
}

// The area of region A of the chord from slot p to slot q, in 1/512 pixel.
fn area_of_a(p: u32, q: u32) -> u32 {
    let first = slot_position(p);
    let end = slot_position(q);
    // The polygon of A: along the ring from p over the corners to q, and back along the chord.
    var doubled = 0;
    var last = first;
    for (var position = 8u; position <= 24u; position += 8u) {
        if p < position && position <= q {
            let corner = vec2(select(16, 0, position == 24u), select(16, 0, position == 8u));
            doubled += cross_of(last, corner);
            last = corner;
        }
    }
    return u32(doubled + cross_of(last, end) + cross_of(end, first));
}

// The line of a simple pixel's chord, as a linear function of position, positive in region A and negative in B.
struct Chord {
    // Normal of the chord, towards A.
    normal: vec2<i32>,
    // The function's value at the pixel's top left corner.
    offset: i32,
}

// The chord from slot p to slot q.
fn chord_of(p: u32, q: u32) -> Chord {
    return chord_between(slot_position(p), slot_position(q));
}

// The chord between two positions on the perimeter, clockwise, in 1/16 pixel.
fn chord_between(a: vec2<i32>, b: vec2<i32>) -> Chord {
    let normal = vec2(b.y - a.y, a.x - b.x);
    return Chord(normal, -(normal.x * b.x + normal.y * b.y));
}

// The function at a position in 1/16 pixel from the top left corner.
fn chord_side(chord: Chord, at: vec2<i32>) -> i32 {
    return chord.normal.x * at.x + chord.normal.y * at.y + chord.offset;
}

// The region of a pixel that is not complex, at a position on its ring that is not a crossing: 0 primary, 1 secondary.
// The position is in quarters of a slot from the top left corner, 0 to 128.
fn region_of(cls: u32, place: u32) -> u32 {
    let ends = 4u * ends_of(cls) + 2u;
    let is_a = ends.x < place && place < ends.y;
    return u32((cls & CLASS) == SIMPLE && is_a != ((cls & PRIMARY_IS_A) != 0u));
}

// The Boolean product of two matrices: which regions of P and R are joined through Q, from the matrix of P and Q and
// that of Q and R. Bit 2 * (region of the first) + (region of the second).
fn chain(pq: u32, qr: u32) -> u32 {
    // Each column of the first times each row of the second: through the primary region of Q, or the secondary.
    let through_primary = if_odd(pq, qr & 3u) | if_odd(pq >> 2u, (qr & 3u) << 2u);
    let through_secondary = if_odd(pq >> 1u, qr >> 2u) | if_odd(pq >> 3u, qr & 12u);
    return through_primary | through_secondary;
}

// The bits if the lowest bit of the number is set, otherwise 0.
fn if_odd(number: u32, bits: u32) -> u32 {
    return (0u - (number & 1u)) & bits;
}

// The matrix of Q and P, from that of P and Q.
fn transpose_of(pq: u32) -> u32 {
    return (pq & 9u) | ((pq & 2u) << 1u) | ((pq & 4u) >> 1u);
}
