// Rigid motions as matrices, lights, and the boxes of bodies that may stand in their way. Mirrors `stages/src/shared/moves.rs`,
// which declares the constant GRAZING.

struct Move {
    // Rows of the new x, y and z: factors of x, y, z and 1.
    x: vec4<f32>,
    y: vec4<f32>,
    z: vec4<f32>,
}

// Whether it moves nothing.
fn rests(motion: Move) -> bool {
    return all(motion.x == vec4(1.0, 0.0, 0.0, 0.0))
        && all(motion.y == vec4(0.0, 1.0, 0.0, 0.0))
        && all(motion.z == vec4(0.0, 0.0, 1.0, 0.0));
}

// Where it takes a point.
fn moved_point(motion: Move, p: vec3<f32>) -> vec3<f32> {
    return vec3(moved_axis(motion.x, p), moved_axis(motion.y, p), moved_axis(motion.z, p));
}

fn moved_axis(row: vec4<f32>, p: vec3<f32>) -> f32 {
    return row.x * p.x + row.y * p.y + row.z * p.z + row.w;
}

// A light, or the middle of one with an area, seen from afar.
struct Lamp {
    // Where it is, metres.
    position: vec3<f32>,
    // Luminance of its radiant intensity; 0 for an entry that stands for no light, after all others.
    power: f32,
    // The direction in which a quad emits; zero for a point light.
    normal: vec3<f32>,
    // The share that it emits whatever the direction.
    uniform_share: f32,
    // How far from its position it reaches, metres; 0 for a point light.
    radius: f32,
    pad: u32,
    more: vec2<u32>,
}

// Luminance of the light that it sends to a point where nothing is in the way, per area across its direction.
fn light_at(lamp: Lamp, p: vec3<f32>) -> f32 {
    let towards = p - lamp.position;
    let squared = max(dot(towards, towards), 1e-12);
    let cosine = dot(lamp.normal, towards) / sqrt(squared);
    let share = lamp.uniform_share + max(cosine - GRAZING, 0.0);
    return lamp.power * share / squared;
}

// The box of a body, in its pose.
struct Blocker {
    // Rows that take a point to where the body is at rest, and the middle of its box the origin.
    x: vec4<f32>,
    y: vec4<f32>,
    z: vec4<f32>,
    // Half of its sides, metres.
    extent: vec3<f32>,
    // Number of the body; 0 for an entry that stands for none, after all others.
    body: u32,
}

// Whether it may cover a part of a lamp from a point: whether the line between them meets the box, grown by as much of the
// lamp's radius as the lines to the rest of the lamp are apart there.
fn covers(blocker: Blocker, lamp: Lamp, point: vec3<f32>) -> bool {
    let here = Move(blocker.x, blocker.y, blocker.z);
    let start = moved_point(here, point);
    let along = moved_point(here, lamp.position) - start;
    let nearest = clamp(-dot(start, along) / max(dot(along, along), 1e-12), 0.0, 1.0);
    // Most lines pass far from the box, which a ball around it tells.
    let middle = start + nearest * along;
    let ball = length(blocker.extent) + 2.0 * lamp.radius * nearest;
    if dot(middle, middle) > ball * ball {
        return false;
    }
    let extent = blocker.extent + lamp.radius * nearest;
    // A line along the slab is in it or not: the quotients are then far beyond 0 and 1.
    let slope = select(along, vec3(1e-12), abs(along) < vec3(1e-12));
    let a = (-extent - start) / slope;
    let b = (extent - start) / slope;
    let first = min(a, b);
    let last = max(a, b);
    let enter = max(max(first.x, first.y), max(first.z, 0.0));
    let leave = min(min(last.x, last.y), min(last.z, 1.0));
    return enter <= leave;
}
