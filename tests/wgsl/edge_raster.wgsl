//! Marks where edges that are not hidden cross the sides of pixels: draws each edge as two triangles.
//! = column E2

#import frame
#import index
#import pixel
#import segments
#import view
#import wide

struct Params {
    /// Which of the two pixels beside a crossing decide whether the edge shows there.
    /// = Either of Either, Owner, Both, Off
    depth_test: u32,
    /// The boundaries of a penumbra count as edges where it is narrower than this on the screen.
    /// = 2 in 0..1e6 unit pixels
    max_penumbra: f32,
    /// Also mark the crossings with the lines through the pixels' middles, in bits 16 to 31.
    /// = false
    middle: u32,
    /// Crossings in neighbouring slots of a side count as one, in the first of these slots.
    /// = false
    merge: u32,
}

// Units of the fixed point in a pixel, and the binary logarithms of that and of an eighth.
const PIXEL: i32 = 256;
const PIXEL_SHIFT: u32 = 8u;
const SLOT_SHIFT: u32 = 5u;
// Size in pixels of the space in which segments are drawn.
const SPAN: f32 = 65535.0;
// Metres beyond which a coordinate counts as no number.
const LIMIT: f32 = 1e20;
// Set in `vertex` if the pixel has a vertex.
const VERTEX: u32 = 0x10000u;

// The binary logarithm of the number of lines per pixel: 1 if the middle ones are drawn too.
#ifdef MIDDLE
const HALVES: u32 = 1u;
#else
const HALVES: u32 = 0u;
#endif
const LINE_SHIFT: u32 = PIXEL_SHIFT - HALVES;

// The visible part of a segment: two points in fixed point, 1 / z there, and the width of the penumbra that it bounds,
// in pixels at a distance of 1 metre.
struct Snapped {
    ax: i32,
    ay: i32,
    bx: i32,
    by: i32,
    inverse_a: f32,
    inverse_b: f32,
    penumbra: f32,
}

@group(0) @binding(1) var<uniform> params: Params;
#ifdef HAS_SILHOUETTES
/// = optional
@group(0) @binding(2) var<storage, read> silhouettes: array<Segment>;
#endif
#ifdef HAS_SILHOUETTE_COUNT
/// The number of segments; the whole list if not connected.
/// = optional, 1 element, means count
@group(0) @binding(3) var<storage, read> silhouette_count: array<u32>;
#endif
#ifdef HAS_SHADOWS
/// = optional, means shadow boundaries
@group(0) @binding(4) var<storage, read> shadows: array<Segment>;
#endif
#ifdef HAS_SHADOW_COUNT
/// The number of segments; the whole list if not connected.
/// = optional, 1 element, means count
@group(0) @binding(5) var<storage, read> shadow_count: array<u32>;
#endif
/// Distance behind which an edge is hidden, metres.
/// = per pixel, means depth
@group(0) @binding(6) var<storage, read> filtered: array<f32>;
/// Crossings with each pixel's left side, bits 0 to 7, and top side, bits 8 to 15; with its middle lines, 16 to 31.
/// = output, per corner, means crossings
@group(0) @binding(7) var<storage, read_write> mask: array<atomic<u32>>;
/// 1 where a line was drawn last.
/// = scratch, per corner
@group(0) @binding(8) var visited: texture_storage_2d<r32uint, write>;
/// An end of a segment in the pixel: 0 if none, else 0x10000 | y << 8 | x in 1/16 pixel, the greatest such number.
/// = output, per pixel, means turn
@group(0) @binding(10) var<storage, read_write> vertex: array<atomic<u32>>;

/// = over mask
@compute @workgroup_size(8, 8, 1)
fn clear(@builtin(global_invocation_id) corner: vec3<u32>) {
    if all(corner.xy <= frame.size) {
        atomicStore(&mask[corner_index(corner.xy)], 0u);
    }
    if all(corner.xy < frame.size) {
        atomicStore(&vertex[pixel_index(corner.xy)], 0u);
    }
}

#ifdef HAS_SILHOUETTES
fn silhouettes_to_draw() -> u32 {
#ifdef HAS_SILHOUETTE_COUNT
    return min(silhouette_count[0], arrayLength(&silhouettes));
#else
    return arrayLength(&silhouettes);
#endif
}
#endif

#ifdef HAS_SHADOWS
fn shadows_to_draw() -> u32 {
#ifdef HAS_SHADOW_COUNT
    return min(shadow_count[0], arrayLength(&shadows));
#else
    return arrayLength(&shadows);
#endif
}
#endif

// ---- The rasteriser visits the pixels

struct Corner {
    @builtin(position) position: vec4<f32>,
    // The members of Snapped.
    @location(0) @interpolate(flat) ends: vec4<i32>,
    @location(1) @interpolate(flat) inverse_and_penumbra: vec3<f32>,
}

// Outside the drawing space.
const NOWHERE: Corner = Corner(vec4(2.0, 2.0, 2.0, 1.0), vec4(0), vec3(0.0));

#ifdef HAS_SILHOUETTES
/// = draw 6 triangle vertices per silhouettes into visited, fragment mark_pixel
@vertex
fn silhouette_corner(@builtin(vertex_index) vertex: u32) -> Corner {
    if vertex / 6u >= silhouettes_to_draw() {
        return NOWHERE;
    }
    return corner(silhouettes[vertex / 6u], vertex % 6u);
}
#endif

#ifdef HAS_SHADOWS
/// = draw 6 triangle vertices per shadows into visited, fragment mark_pixel
@vertex
fn shadow_corner(@builtin(vertex_index) vertex: u32) -> Corner {
    if vertex / 6u >= shadows_to_draw() {
        return NOWHERE;
    }
    return corner(shadows[vertex / 6u], vertex % 6u);
}
#endif

// A corner of the two triangles over a segment, extended by a pixel at each end and two pixels wide: they cover the
// centre of every pixel with a crossing at its left or top side, which is at most 0.71 pixels away.
fn corner(segment: Segment, nth: u32) -> Corner {
    var snapped: Snapped;
    if !snap(segment, &snapped) {
        return NOWHERE;
    }
    let a = vec2(f32(snapped.ax), f32(snapped.ay)) / f32(PIXEL);
    let b = vec2(f32(snapped.bx), f32(snapped.by)) / f32(PIXEL);
    if all(a == b) {
        return NOWHERE;
    }
    let along = normalize(b - a);
    let across = vec2(-along.y, along.x);
    let at_b = nth == 1u || nth == 2u || nth == 4u;
    let to_right = nth == 2u || nth >= 4u;
    let p = select(a - along, b + along, at_b) + select(-across, across, to_right);
    // The target is larger than the image by a column and a row.
    let q = 2.0 * p / vec2<f32>(frame.size + 1u) - 1.0;
    return Corner(
        vec4(q.x, -q.y, 0.0, 1.0),
        vec4(snapped.ax, snapped.ay, snapped.bx, snapped.by),
        vec3(snapped.inverse_a, snapped.inverse_b, snapped.penumbra),
    );
}

// Marks the crossings with the lines to the left of a pixel and above it, and with its middle lines. Pixels of a column
// share such lines and set the same bits, which does no harm.
@fragment
fn mark_pixel(in: Corner) -> @location(0) u32 {
    let rest = in.inverse_and_penumbra;
    let snapped = Snapped(in.ends.x, in.ends.y, in.ends.z, in.ends.w, rest.x, rest.y, rest.z);
    let pixel = vec2<i32>(in.position.xy);
    if all((vec2(snapped.ax, snapped.ay) >> vec2(PIXEL_SHIFT)) == pixel) {
        mark_end(vec2(snapped.ax, snapped.ay), snapped.inverse_a, snapped.penumbra);
    }
    if all((vec2(snapped.bx, snapped.by) >> vec2(PIXEL_SHIFT)) == pixel) {
        mark_end(vec2(snapped.bx, snapped.by), snapped.inverse_b, snapped.penumbra);
    }
    for (var axis = 0u; axis < 2u; axis++) {
        let lines = lines(snapped, axis);
        for (var half = 0; half <= i32(HALVES); half++) {
            let nth = (pixel[axis] << HALVES) + half - lines.first;
            if nth >= 0 && nth < lines.count {
                mark(lines, axis, nth);
            }
        }
    }
    return 1u;
}

// ---- Projection, clipping and snapping

// The part of a segment in front of the near plane and inside the drawing space, as pixels in fixed point; false if
// it is empty.
fn snap(segment: Segment, snapped: ptr<function, Snapped>) -> bool {
    if !(all(abs(segment.a) <= vec3(LIMIT)) && all(abs(segment.b) <= vec3(LIMIT))) {
        return false;
    }
    let half = 0.5 * vec2<f32>(frame.size);
    let scale = half / vec2(frame.view.tan_x, frame.view.tan_y);
    let limit = vec2(0.5 * SPAN);
    let a = to_view(segment.a, scale);
    let b = to_view(segment.b, scale);

    var t = vec2(0.0, 1.0);
    t = cut(t, a.z - frame.view.near, b.z - frame.view.near);
    t = cut(t, limit.x * a.z + a.x, limit.x * b.z + b.x);
    t = cut(t, limit.x * a.z - a.x, limit.x * b.z - b.x);
    t = cut(t, limit.y * a.z + a.y, limit.y * b.z + b.y);
    t = cut(t, limit.y * a.z - a.y, limit.y * b.z - b.y);
    if t.x > t.y {
        return false;
    }
    // An end that is not clipped keeps its exact coordinates, so that edges still meet in it.
    let start = select(a, a + t.x * (b - a), t.x > 0.0);
    let end = select(b, a + t.y * (b - a), t.y < 1.0);
    let inverse = vec2(1.0 / max(start.z, frame.view.near), 1.0 / max(end.z, frame.view.near));
    let low = (half - limit) * f32(PIXEL);
    let high = (half + limit) * f32(PIXEL);
    let a_fixed = clamp(floor((half + start.xy * inverse.x) * f32(PIXEL) + 0.5), low, high);
    let b_fixed = clamp(floor((half + end.xy * inverse.y) * f32(PIXEL) + 0.5), low, high);
    let penumbra = penumbra_width(segment.flags) * scale.x;
    *snapped =
        Snapped(i32(a_fixed.x), i32(a_fixed.y), i32(b_fixed.x), i32(b_fixed.y), inverse.x, inverse.y, penumbra);
    return true;
}

// Right and down, times the distance in pixels from the image's middle; and the distance along the axis, metres.
fn to_view(position: vec3<f32>, scale: vec2<f32>) -> vec3<f32> {
    let p = position - frame.view.eye;
    return vec3(
        dot_in_order(p, frame.view.right) * scale.x,
        -(dot_in_order(p, frame.view.up) * scale.y),
        dot_in_order(p, frame.view.forward),
    );
}

// The range of t in which a distance that goes from `a` (t = 0) to `b` (t = 1) is not negative.
fn cut(t: vec2<f32>, a: f32, b: f32) -> vec2<f32> {
    if a < 0.0 && b < 0.0 {
        return vec2(1.0, 0.0);
    }
    if a < 0.0 {
        return vec2(max(t.x, a / (a - b)), t.y);
    }
    if b < 0.0 {
        return vec2(t.x, min(t.y, a / (a - b)));
    }
    return t;
}

// ---- Crossings

// The lines of the grid across one axis that a segment crosses in the image, numbered from the image's left or top
// edge.
struct Lines {
    // The end with the smaller coordinate along the axis: that coordinate, and the other one.
    start: vec2<i32>,
    // Vector from there to the other end; x > 0 if there are lines.
    delta: vec2<i32>,
    // 1 / z there, and its difference to the other end.
    inverse: f32,
    inverse_delta: f32,
    // The penumbra of the segment.
    penumbra: f32,
    first: i32,
    count: i32,
}

// Vertical lines for axis 0, horizontal ones for axis 1.
fn lines(snapped: Snapped, axis: u32) -> Lines {
    var a = vec2(snapped.ax, snapped.ay);
    var b = vec2(snapped.bx, snapped.by);
    var size = i32(frame.size.x);
    if axis == 1u {
        a = a.yx;
        b = b.yx;
        size = i32(frame.size.y);
    }
    var inverse = vec2(snapped.inverse_a, snapped.inverse_b);
    if b.x < a.x {
        let c = a;
        a = b;
        b = c;
        inverse = inverse.yx;
    }
    // A vertex on a line counts as beyond it.
    let first = max((a.x >> LINE_SHIFT) + 1, 0);
    let last = min(b.x >> LINE_SHIFT, size << HALVES);
    let count = max(last - first + 1, 0);
    return Lines(a, b - a, inverse.x, inverse.y - inverse.x, snapped.penumbra, first, count);
}

// Marks the crossing with a line if it is in the image and not hidden.
fn mark(lines: Lines, axis: u32, nth: i32) {
    let line = lines.first + nth;
    let along = u32((line << LINE_SHIFT) - lines.start.x);
    let length = u32(lines.delta.x);
    // The crossing's other coordinate is start.y +- (quotient + rest / length).
    let product = wide_multiply(along, u32(abs(lines.delta.y)));
    let quotient = wide_divide(product, length);
    let rest = product.low - quotient * length;

    // At a crossing exactly at the end of a slot, the slot before counts on vertical lines if the segment descends: the
    // perturbation that moves vertices beyond lines moves the crossing there.
    var whole: i32;
    var before: bool;
    if lines.delta.y > 0 {
        whole = lines.start.y + i32(quotient);
        before = axis == 0u && rest == 0u;
    } else {
        whole = lines.start.y - i32(quotient);
        before = rest != 0u;
    }
    let slot = (whole - select(0, 1, before)) >> SLOT_SHIFT;
    let z = 1.0 / (lines.inverse + lines.inverse_delta * (f32(along) / f32(length)));

    let is_middle = (line & i32(HALVES)) == 1;
    let at = vec2(line >> HALVES, slot >> 3u);
    let pixel = select(at.yx, at, axis == 0u);
    let size = vec2<i32>(frame.size);
    if slot < 0 || (axis == 0u && pixel.y >= size.y) || (axis == 1u && pixel.x >= size.x) {
        return;
    }
    if lines.penumbra <= params.max_penumbra * z && is_shown(z, pixel, axis, is_middle) {
        let bit = u32(slot & 7) + 8u * axis + 16u * u32(is_middle);
        atomicOr(&mask[corner_index(vec2<u32>(pixel))], 1u << bit);
    }
}

// Marks an end if it is in the image and not hidden.
fn mark_end(at: vec2<i32>, inverse: f32, penumbra: f32) {
    let pixel = at >> vec2(PIXEL_SHIFT);
    let z = 1.0 / inverse;
    if is_outside(pixel) || penumbra > params.max_penumbra * z {
        return;
    }
    if params.depth_test == DEPTH_TEST_OFF || z <= depth(pixel) {
        let place = vec2<u32>(((at & vec2(PIXEL - 1)) + 8) >> vec2(4u));
        atomicMax(&vertex[pixel_index(vec2<u32>(pixel))], VERTEX | (place.y << 8u) | place.x);
    }
}

// Whether an edge at distance z shows at the left (axis 0) or top (axis 1) side of a pixel, or at its middle line.
fn is_shown(z: f32, owner: vec2<i32>, axis: u32, is_middle: bool) -> bool {
    let step = select(vec2(0, 1), vec2(1, 0), axis == 0u);
    let other = owner - step;
    let owner_exists = all(owner < vec2<i32>(frame.size));
    let other_exists = all(other >= vec2(0));
    let at_owner = owner_exists && z <= depth(owner);
    let at_other = other_exists && z <= depth(other);
#ifdef MIDDLE
    if is_middle && params.depth_test != DEPTH_TEST_OFF {
        let next = owner + step;
        let at_next = all(next < vec2<i32>(frame.size)) && z <= depth(next);
        return at_owner || (params.depth_test == DEPTH_TEST_EITHER && (at_other || at_next));
    }
#endif
    switch params.depth_test {
        case DEPTH_TEST_EITHER: {
            return at_owner || at_other;
        }
        case DEPTH_TEST_OWNER: {
            return select(at_other, at_owner, owner_exists);
        }
        case DEPTH_TEST_BOTH: {
            return (at_owner || !owner_exists) && (at_other || !other_exists);
        }
        default: {
            return true;
        }
    }
}

fn depth(pixel: vec2<i32>) -> f32 {
    let inside = clamp(pixel, vec2(0), vec2<i32>(frame.size) - 1);
    return filtered[pixel_index(vec2<u32>(inside))];
}

#ifdef MERGE
// Replaces each side's runs of crossed slots by their first slot.
@compute @workgroup_size(8, 8, 1)
fn merge(@builtin(global_invocation_id) corner: vec3<u32>) {
    if all(corner.xy <= frame.size) {
        let index = corner_index(corner.xy);
        let bits = atomicLoad(&mask[index]);
        atomicStore(&mask[index], bits & ~((bits & 0x7F7F7F7Fu) << 1u));
    }
}
#endif
