// Takes the picture of a resting camera to what its samples converge to: `stages/src/refine.rs` explains the algorithm.

#import cloud
#import color
#import estimate
#import frame
#import index
#import moves
#import octahedral
#import pixel
#import random
#import renewal
#import requests
#import view

@group(0) @binding(1) var color: texture_2d<f32>;
@group(0) @binding(2) var<storage, read> samples: array<Sample>;
@group(0) @binding(3) var<storage, read> id: array<u32>;
@group(0) @binding(4) var<storage, read> aim: array<u32>;
#ifdef SHIFT
@group(0) @binding(5) var<storage, read> shift: array<f32>;
#endif
#ifdef MOVES
@group(0) @binding(12) var<storage, read> moves: array<Move>;
#endif
@group(0) @binding(6) var refined: texture_storage_2d<rgba32float, write>;
@group(0) @binding(7) var<storage, read_write> next: array<u32>;
// The mean of each pixel's samples, and the sum of squares of their luminance around its mean.
@group(0) @binding(8) var<storage, read_write> mean: array<vec4<f32>>;
@group(0) @binding(9) var<storage, read_write> count: array<u32>;
@group(0) @binding(10) var<storage, read_write> asked: array<atomic<u32>>;
// Variance of the mean, and squared difference from the picture.
@group(0) @binding(11) var<storage, read_write> evidence: array<vec2<f32>>;
// Whether nothing moves, the camera included.
@group(0) @binding(13) var<storage, read_write> still: array<u32>;

@compute @workgroup_size(1)
fn begin() {
    var is_still = same_view(frame.view, frame.previous);
#ifdef MOVES
    for (var body = 0u; body < arrayLength(&moves); body++) {
        is_still = is_still && rests(moves[body]);
    }
#endif
    still[0] = u32(is_still);
}

// Whether a sample was requested at its pixel as the camera sees it now.
fn is_of_its_pixel(sample: Sample) -> bool {
    if sample.hit == HIT_NONE || sample.pixel >= frame.size.x * frame.size.y {
        return false;
    }
    if sample.view != VIEW_LATE {
        return sample.view == VIEW_NOW;
    }
    let position = vec4(sample.position, select(0.0, 1.0, sample.hit == HIT_SURFACE));
    let place = place_in_image(frame.view, position, frame.size);
    let pixel = vec2(sample.pixel % frame.size.x, sample.pixel / frame.size.x);
    let aimed = vec2<f32>(pixel) + vec2<f32>(vec2(sample.aim & AXIS, sample.aim >> 16u)) / 65536.0;
    return place.z > 0.0 && all(abs(place.xy - aimed) <= vec2(NEAR));
}

// Of two samples of a pixel, the last one counts.
@compute @workgroup_size(64)
fn claim(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let index = linear_index(id, groups, 64u);
    if index >= arrayLength(&samples) || still[0] == 0u {
        return;
    }
    let sample = samples[index];
    if is_of_its_pixel(sample) {
        atomicMax(&asked[sample.pixel], index + 1u);
    }
}

@compute @workgroup_size(8, 8, 1)
fn join(@builtin(global_invocation_id) pixel: vec3<u32>) {
    if any(pixel.xy >= frame.size) {
        return;
    }
    let p = pixel_index(pixel.xy);
    if still[0] == 0u {
        count[p] = 0u;
        return;
    }
    var number = count[p];
    var of_pixel = mean[p];
#ifdef SHIFT
    let tile = pixel.xy / TILE;
    if shift[tile.y * ((frame.size.x + TILE - 1u) / TILE) + tile.x] > 0.0 {
        number = 0u;
    }
#endif
    let claimed = atomicExchange(&asked[p], 0u);
    if claimed > 0u {
        // What is not spread over the pixel does not join the mean.
        if !is_spread(samples[claimed - 1u]) {
            number = max(number, min(number + 1u, FIRST));
        } else {
            let radiance = bounded(samples[claimed - 1u].radiance);
            let of_mean = max(number, FIRST) - FIRST + 1u;
            let before = of_pixel.rgb;
            let after = before + (radiance - before) / f32(of_mean);
            let apart = (luminance(radiance) - luminance(before)) * (luminance(radiance) - luminance(after));
            of_pixel = select(vec4(after, of_pixel.w + apart), vec4(radiance, 0.0), of_mean == 1u);
            number = min(FIRST + of_mean, MOST);
        }
    }
    mean[p] = of_pixel;
    count[p] = number;
    var found = vec2(0.0);
    if number >= FIRST + FEWEST {
        let others = f32(number - FIRST - 1u);
        let variance = of_pixel.w / (f32(number - FIRST) * others) * (1.0 + DOUBT / others);
        let difference = luminance(abs(of_pixel.rgb - textureLoad(color, pixel.xy, 0).rgb));
        found = vec2(variance, difference * difference);
    }
    evidence[p] = found;
}

// The share of a squared difference that noise does not explain.
fn unexplained(noise: f32, all: f32) -> f32 {
    return select(0.0, 1.0 - noise / all, all > noise);
}

// Where in a pixel its next sample goes, if it has had so many.
fn place(pixel: u32, number: u32) -> u32 {
    let first = pcg(pixel ^ pcg(frame.seed));
    let x = ((first & AXIS) + number * STEP_X) & AXIS;
    let y = ((first >> 16u) + number * STEP_Y) & AXIS;
    return (y << 16u) | x | SPREAD;
}

@compute @workgroup_size(8, 8, 1)
fn mix_in(@builtin(global_invocation_id) pixel: vec3<u32>) {
    if any(pixel.xy >= frame.size) {
        return;
    }
    let p = pixel_index(pixel.xy);
    let number = count[p];
    next[p] = select(aim[p], place(p, number), number >= FIRST && id[p] != NO_POINT);
    var result = textureLoad(color, pixel.xy, 0);
    if number >= FIRST + FEWEST {
        let own = evidence[p];
        let shown = luminance(result.rgb);
        var sum = vec2(0.0);
        var steps = 0.0;
        var pixels = 0.0;
        for (var dy = -1; dy <= 1; dy++) {
            for (var dx = -1; dx <= 1; dx++) {
                let at = vec2<i32>(pixel.xy) + vec2(dx, dy);
                if !is_outside(at) {
                    sum += evidence[pixel_index(vec2<u32>(at))];
                    let step = luminance(textureLoad(color, at, 0).rgb) - shown;
                    steps += step * step;
                    pixels += 1.0;
                }
            }
        }
        // What few samples may have missed.
        let of_mean = f32(number - FIRST);
        let missed = (MISSED_STEPS * (steps / pixels) + MISSED_LIGHT * shown * shown) / (of_mean * of_mean);
        let share = min(unexplained(own.x + missed, own.y), unexplained(CAUTION * sum.x, sum.y));
        result += vec4(share * (mean[p].rgb - result.rgb), 0.0);
    }
    textureStore(refined, pixel.xy, result);
}
