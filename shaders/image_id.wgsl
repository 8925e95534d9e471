// Records for each point which pixel shows it. Twin: `stages/src/image_id.rs`.

#import cloud
#import frame
#import index
#import pixel

struct Params {
    ids: u32,
}

@group(0) @binding(1) var<uniform> params: Params;
@group(0) @binding(2) var<storage, read_write> cloud_image_id: array<u32>;
@group(0) @binding(3) var<storage, read> id: array<u32>;

@compute @workgroup_size(256)
fn clear(@builtin(global_invocation_id) thread: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let slot = linear_index(thread, groups, 256u);
    if slot < arrayLength(&cloud_image_id) {
        cloud_image_id[slot] = NOT_DRAWN;
    }
}

@compute @workgroup_size(8, 8, 1)
fn mark(@builtin(global_invocation_id) thread: vec3<u32>) {
    if any(thread.xy >= frame.size) {
        return;
    }
    let pixel = pixel_index(thread.xy);
    if params.ids == IDS_TEXEL && pixel >= TEXEL_PIXELS {
        return;
    }
    // A pixel without a point has an id larger than every slot. A point is in one pixel, so threads do not collide.
    if id[pixel] < arrayLength(&cloud_image_id) {
        cloud_image_id[id[pixel]] = pixel;
    }
}
