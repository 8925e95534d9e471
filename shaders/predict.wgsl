// Which 4x4 pixels of the predicted view hold a point.

#import frame
#import index
#import cloud
#import view

@group(0) @binding(1) var<storage, read> cloud_position: array<vec4<f32>>;
@group(0) @binding(2) var<storage, read> cloud_meta: array<u32>;
@group(0) @binding(3) var<storage, read_write> occupancy: array<atomic<u32>>;

fn width() -> u32 {
    return (frame.size.x + CELL - 1u) / CELL;
}

@compute @workgroup_size(8, 8, 1)
fn clear(@builtin(global_invocation_id) cell: vec3<u32>) {
    if any(cell.xy * CELL >= frame.size) {
        return;
    }
    atomicStore(&occupancy[cell.y * width() + cell.x], u32(same_view(frame.predicted, frame.view)));
}

@compute @workgroup_size(128, 1, 1)
fn mark(@builtin(global_invocation_id) thread: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let i = linear_index(thread, groups, 128u);
    if i >= arrayLength(&cloud_position) || (cloud_meta[i] & LIVE) == 0u {
        return;
    }
    let point = project_point(frame.predicted, cloud_position[i], frame.size);
    if point.z >= 0.0 {
        let cell = vec2<u32>(point.at) / CELL;
        atomicStore(&occupancy[cell.y * width() + cell.x], 1u);
    }
}
