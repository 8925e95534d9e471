// Rigid motions as matrices. Mirrors `stages/src/shared/moves.rs`.

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
