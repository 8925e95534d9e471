// The list element of a thread.

// A dispatch has at most 65,535 workgroups per axis, so the executor splits long lists into rows of workgroups along x.
// `id` is global_invocation_id, `groups` num_workgroups, and `size` the N of @workgroup_size(N, 1, 1). The last row may
// be longer than the list: compare with the number of elements.
fn linear_index(id: vec3<u32>, groups: vec3<u32>, size: u32) -> u32 {
    return id.x + id.y * groups.x * size;
}
