// Rigid motions as matrices, and how lights have moved. Mirrors `stages/src/shared/moves.rs`.

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
    // Luminance of its radiant intensity; 0 for an entry that stands for no light.
    power: f32,
    // The direction in which a quad emits; zero for a point light.
    normal: vec3<f32>,
    // The share that it emits whatever the direction.
    uniform_share: f32,
}

// Luminance of the light that it sends to a point where nothing is in the way, per area across its direction.
fn light_at(lamp: Lamp, p: vec3<f32>) -> f32 {
    let towards = p - lamp.position;
    let squared = max(dot(towards, towards), 1e-12);
    let share = lamp.uniform_share + max(dot(lamp.normal, towards), 0.0) / sqrt(squared);
    return lamp.power * share / squared;
}
