// Rigid motions as matrices, lights, and the boxes of bodies that may occlude them. Mirrors
// `stages/src/shared/moves.rs`, which declares the constant GRAZING.

struct Move {
    // Rows of the new x, y and z: coefficients of x, y, z and 1.
    x: vec4<f32>,
    y: vec4<f32>,
    z: vec4<f32>,
}

// Whether it is the identity.
fn rests(motion: Move) -> bool {
    return all(motion.x == vec4(1.0, 0.0, 0.0, 0.0))
        && all(motion.y == vec4(0.0, 1.0, 0.0, 0.0))
        && all(motion.z == vec4(0.0, 0.0, 1.0, 0.0));
}

// The moved point.
fn moved_point(motion: Move, p: vec3<f32>) -> vec3<f32> {
    return vec3(moved_axis(motion.x, p), moved_axis(motion.y, p), moved_axis(motion.z, p));
}

// The point that is moved there: rotations are undone by their transpose.
fn point_before(motion: Move, moved: vec3<f32>) -> vec3<f32> {
    let p = moved - vec3(motion.x.w, motion.y.w, motion.z.w);
    return motion.x.xyz * p.x + motion.y.xyz * p.y + motion.z.xyz * p.z;
}

fn moved_axis(row: vec4<f32>, p: vec3<f32>) -> f32 {
    return row.x * p.x + row.y * p.y + row.z * p.z + row.w;
}

// A light, approximated by its centre if it has an area.
struct Lamp {
    // Where it is, metres.
    position: vec3<f32>,
    // Luminance of its radiant intensity; 0 for unused entries, which follow all others.
    power: f32,
    // The direction in which a quad emits; zero for a point light.
    normal: vec3<f32>,
    // The share of its light that does not depend on direction.
    uniform_share: f32,
    // Radius around its position, metres; 0 for a point light.
    radius: f32,
    pad: u32,
    more: vec2<u32>,
}

// Luminance of the unoccluded light at a point, per area perpendicular to its direction.
fn light_at(lamp: Lamp, p: vec3<f32>) -> f32 {
    let towards = p - lamp.position;
    let squared = max(dot(towards, towards), 1e-12);
    let cosine = dot(lamp.normal, towards) / sqrt(squared);
    let share = lamp.uniform_share + max(cosine - GRAZING, 0.0);
    return lamp.power * share / squared;
}

// The box of a body, in its pose.
struct Blocker {
    // Rows of the matrix that takes a point to the body's rest pose, with the middle of its box at the origin.
    x: vec4<f32>,
    y: vec4<f32>,
    z: vec4<f32>,
    // Half of its sides, metres.
    extent: vec3<f32>,
    // Number of the body; 0 for unused entries, which follow all others.
    body: u32,
}

// Whether it may cover a part of a lamp from a point: whether the line between them hits the box, enlarged by the
// distance there between that line and the lines to the rim of the lamp.
fn covers(blocker: Blocker, lamp: Lamp, point: vec3<f32>) -> bool {
    let here = Move(blocker.x, blocker.y, blocker.z);
    let start = moved_point(here, point);
    let along = moved_point(here, lamp.position) - start;
    let nearest = clamp(-dot(start, along) / max(dot(along, along), 1e-12), 0.0, 1.0);
    // Most lines pass far from the box; a bounding sphere rejects them.
    let middle = start + nearest * along;
    let ball = length(blocker.extent) + 2.0 * lamp.radius * nearest;
    if dot(middle, middle) > ball * ball {
        return false;
    }
    let extent = blocker.extent + lamp.radius * nearest;
    // A line parallel to a slab is inside or outside: the quotients are then far beyond 0 and 1.
    let slope = select(along, vec3(1e-12), abs(along) < vec3(1e-12));
    let a = (-extent - start) / slope;
    let b = (extent - start) / slope;
    let first = min(a, b);
    let last = max(a, b);
    let enter = max(max(first.x, first.y), max(first.z, 0.0));
    let leave = min(min(last.x, last.y), min(last.z, 1.0));
    return enter <= leave;
}
