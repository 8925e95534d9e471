// Albedos of textured surfaces. Mirrors `stages/src/shared/albedo.rs`, which declares the constants PLAIN, NO_ALBEDO, MOST_CODE,
// CODE_STEP, FAINTEST, MOST_MEAN and MEAN_STEP.

// The code of an albedo from 0 to 1.
fn encode_albedo(albedo: vec3<f32>) -> u32 {
    let code = vec3<u32>(sqrt(clamp(albedo, vec3(0.0), vec3(1.0))) * MOST_CODE + 0.5);
    return code.r | code.g << 8u | code.b << 16u;
}

// The albedo of a code, at least FAINTEST.
fn decode_albedo(code: u32) -> vec3<f32> {
    let known = select(code, PLAIN, code == NO_ALBEDO);
    let root = vec3<f32>((vec3(known) >> vec3(0u, 8u, 16u)) & vec3(255u)) * CODE_STEP;
    return max(root * root, vec3(FAINTEST));
}

// The albedo of a point.
fn unpack_mean(mean: vec2<u32>) -> vec3<f32> {
    return vec3<f32>(vec3(mean.x & 0xFFFFu, mean.x >> 16u, mean.y)) * MEAN_STEP;
}

// What is stored of the albedo of a point, from 0 to 1: red and green in the first word, blue in the second.
fn pack_mean(albedo: vec3<f32>) -> vec2<u32> {
    let mean = vec3<u32>(albedo * MOST_MEAN + 0.5);
    return vec2(mean.r | mean.g << 16u, mean.b);
}
