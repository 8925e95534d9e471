//! Enlarges a small image by a kernel that is cut where depth, normal or albedo differ from the pixel's: joint
//! bilateral upsampling.

#import frame
#import octahedral
#import pixel

struct Params {
    /// Standard deviation of the kernel, in pixels of the small image.
    /// = 1.4 in 0.1..4
    sigma: f32,
    /// Tolerance of depth, as a share.
    /// = 0.03 in 0.001..10
    depth: f32,
    /// Power of the cosine between normals.
    /// = 32 in 0..1000
    facing: f32,
    /// Tolerance of albedo and emission.
    /// = 0.1 in 0.001..10
    tint: f32,
}

@group(0) @binding(1) var<uniform> params: Params;
/// Linear radiance of the small image, row by row; alpha is 0 where no sample has arrived.
@group(0) @binding(2) var<storage, read> colors: array<vec4<f32>>;
/// Width and height of the small image.
/// = 2 elements
@group(0) @binding(3) var<storage, read> small: array<u32>;
/// = per pixel, means depth
@group(0) @binding(4) var<storage, read> distance: array<f32>;
/// = per pixel, means normal
@group(0) @binding(5) var<storage, read> normal: array<u32>;
@group(0) @binding(6) var albedo: texture_2d<f32>;
@group(0) @binding(7) var emission: texture_2d<f32>;
/// Linear radiance.
/// = output, means radiance
@group(0) @binding(8) var color: texture_storage_2d<rgba32float, write>;

fn normal_at(pixel: vec2<u32>) -> vec3<f32> {
    let n = decode_oct16(normal[pixel_index(pixel)]);
    // The background has none.
    return n / max(length(n), 1e-9);
}

// How alike two surfaces look.
fn alike(a: vec2<u32>, b: vec2<u32>) -> f32 {
    let z = distance[pixel_index(a)];
    let apart = (distance[pixel_index(b)] - z) / (params.depth * z);
    let tint = textureLoad(albedo, a, 0).rgb - textureLoad(albedo, b, 0).rgb;
    let glow = textureLoad(emission, a, 0).rgb - textureLoad(emission, b, 0).rgb;
    let looks = (dot(tint, tint) + dot(glow, glow)) / (params.tint * params.tint);
    let n = normal_at(a);
    let m = normal_at(b);
    let facing = select(dot(n, m), 1.0, all(n == m));
    return exp(-0.5 * (apart * apart + looks)) * pow(max(facing, 0.0), params.facing);
}

@compute @workgroup_size(8, 8)
fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    if any(id.xy >= frame.size) {
        return;
    }
    let size = vec2(small[0], small[1]);
    let scale = vec2<f32>(frame.size) / vec2<f32>(size);
    // The pixel's centre, from the corner of the small image.
    let at = (vec2<f32>(id.xy) + 0.5) / scale;
    var sum = vec4(0.0);
    for (var y = -2; y <= 2; y++) {
        for (var x = -2; x <= 2; x++) {
            let cell = vec2<i32>(at) + vec2(x, y);
            if any(cell < vec2(0)) || any(cell >= vec2<i32>(size)) {
                continue;
            }
            let center = vec2<f32>(cell) + 0.5;
            let there = min(vec2<u32>(center * scale), frame.size - 1u);
            let apart = (center - at) / params.sigma;
            // The small weight that all samples have decides only where none is alike.
            let weight = exp(-0.5 * dot(apart, apart)) * max(alike(id.xy, there), 1e-6);
            sum += weight * colors[u32(cell.y) * size.x + u32(cell.x)];
        }
    }
    textureStore(color, id.xy, sum / max(sum.a, 1e-9));
}
