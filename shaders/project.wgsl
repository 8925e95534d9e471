// The nearest point of each pixel, its depth and its position in the pixel. Among equally near points the lowest id
// wins. TwoPass runs clear, project, claim, resolve; with ATOMIC64 clear, project, resolve; with RASTER vertex and
// fragment, then resolve.

#import cloud
#import frame
#import index
#import pixel
#import view

struct Params {
    method: u32,
    subpixel_bits: u32,
    max_age: u32,
}

@group(0) @binding(1) var<uniform> params: Params;
@group(0) @binding(2) var<storage, read> cloud_position: array<vec4<f32>>;
@group(0) @binding(3) var<storage, read> cloud_meta: array<u32>;
@group(0) @binding(4) var<storage, read_write> id: array<atomic<u32>>;
@group(0) @binding(5) var<storage, read_write> depth: array<atomic<u32>>;
@group(0) @binding(6) var<storage, read_write> subpixel: array<u32>;
@group(0) @binding(7) var<storage, read_write> projected: array<vec2<u32>>;
@group(0) @binding(8) var<storage, read_write> cells: array<u32>;

fn project_id(i: u32) -> Projected {
    let bits = cloud_meta[i];
    if (bits & LIVE) == 0u || (bits & AGE) / AGE_ONE > params.max_age {
        return Projected(vec2(0.0), -1.0);
    }
    return project_point(frame.view, cloud_position[i], frame.size);
}

fn cell(at: vec2<f32>) -> u32 {
    return cell_of(at, 1u << (params.subpixel_bits / 2u));
}

#ifdef ATOMIC64
// Bits of the depth above the id.
@group(0) @binding(9) var<storage, read_write> keys: array<atomic<u64>>;

@compute @workgroup_size(8, 8, 1)
fn clear(@builtin(global_invocation_id) pixel: vec3<u32>) {
    if any(pixel.xy >= frame.size) {
        return;
    }
    atomicStore(&keys[pixel_index(pixel.xy)], (u64(EMPTY_DEPTH) << 32u) | u64(NO_POINT));
}

@compute @workgroup_size(128, 1, 1)
fn project(@builtin(global_invocation_id) thread: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let i = linear_index(thread, groups, 128u);
    if i >= arrayLength(&cloud_position) {
        return;
    }
    let point = project_id(i);
    if point.z >= 0.0 {
        cells[i] = cell(point.at);
        atomicMin(&keys[pixel_index(vec2<u32>(point.at))], (u64(bitcast<u32>(point.z)) << 32u) | u64(i));
    }
}

@compute @workgroup_size(8, 8, 1)
fn resolve(@builtin(global_invocation_id) pixel: vec3<u32>) {
    if any(pixel.xy >= frame.size) {
        return;
    }
    let p = pixel_index(pixel.xy);
    let key = atomicLoad(&keys[p]);
    let winner = u32(key & 0xFFFFFFFFlu);
    atomicStore(&id[p], winner);
    atomicStore(&depth[p], u32(key >> 32u));
    subpixel[p] = 0u;
    if winner != NO_POINT {
        subpixel[p] = cells[winner];
    }
}
#else
#ifdef RASTER
@group(0) @binding(9) var drawn: texture_2d<u32>;

struct Vertex {
    @builtin(position) position: vec4<f32>,
    @location(0) @interpolate(flat) id: u32,
}

@vertex
fn vertex(@builtin(vertex_index) i: u32) -> Vertex {
    let point = project_id(i);
    if point.z < 0.0 {
        return Vertex(vec4(2.0, 2.0, 2.0, 1.0), i);
    }
    // The pixel's centre, so that the rasteriser's own rounding cannot move the point to a neighbour.
    let centre = (floor(point.at) + 0.5) / vec2<f32>(frame.size);
    // Depth 1 is the cleared value and never passes the test: the far plane is just in front of it.
    let z = point.z / frame.view.far * 0.9999999;
    return Vertex(vec4(2.0 * centre.x - 1.0, 1.0 - 2.0 * centre.y, z, 1.0), i);
}

@fragment
fn fragment(in: Vertex) -> @location(0) u32 {
    return in.id;
}

@compute @workgroup_size(8, 8, 1)
fn resolve(@builtin(global_invocation_id) pixel: vec3<u32>) {
    if any(pixel.xy >= frame.size) {
        return;
    }
    let p = pixel_index(pixel.xy);
    let winner = textureLoad(drawn, pixel.xy, 0).x;
    atomicStore(&id[p], winner);
    atomicStore(&depth[p], EMPTY_DEPTH);
    subpixel[p] = 0u;
    if winner != NO_POINT {
        let point = project_id(winner);
        atomicStore(&depth[p], bitcast<u32>(point.z));
        // Another pipeline may have rounded differently: keep the point in the pixel that shows it.
        let least = vec2<f32>(pixel.xy);
        subpixel[p] = cell(clamp(point.at, least, least + 0.99));
    }
}
#else
@compute @workgroup_size(8, 8, 1)
fn clear(@builtin(global_invocation_id) pixel: vec3<u32>) {
    if any(pixel.xy >= frame.size) {
        return;
    }
    let p = pixel_index(pixel.xy);
    atomicStore(&id[p], NO_POINT);
    atomicStore(&depth[p], EMPTY_DEPTH);
}

@compute @workgroup_size(128, 1, 1)
fn project(@builtin(global_invocation_id) thread: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let i = linear_index(thread, groups, 128u);
    if i >= arrayLength(&cloud_position) {
        return;
    }
    let point = project_id(i);
    if point.z < 0.0 {
        projected[i] = vec2(NOT_DRAWN, EMPTY_DEPTH);
        return;
    }
    let p = pixel_index(vec2<u32>(point.at));
    // The bits of positive floats are ordered like the floats. Stored, not recomputed in the next pass: another
    // pipeline may round differently, and the point would be lost.
    let z = bitcast<u32>(point.z);
    projected[i] = vec2(p, z);
    cells[i] = cell(point.at);
    atomicMin(&depth[p], z);
}

@compute @workgroup_size(128, 1, 1)
fn claim(@builtin(global_invocation_id) thread: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let i = linear_index(thread, groups, 128u);
    if i >= arrayLength(&cloud_position) {
        return;
    }
    let point = projected[i];
    if point.x != NOT_DRAWN && atomicLoad(&depth[point.x]) == point.y {
        atomicMin(&id[point.x], i);
    }
}

@compute @workgroup_size(8, 8, 1)
fn resolve(@builtin(global_invocation_id) pixel: vec3<u32>) {
    if any(pixel.xy >= frame.size) {
        return;
    }
    let p = pixel_index(pixel.xy);
    let winner = atomicLoad(&id[p]);
    subpixel[p] = 0u;
    if winner != NO_POINT {
        subpixel[p] = cells[winner];
    }
}
#endif
#endif
