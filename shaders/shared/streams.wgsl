// A cut through a point set of vertex transformation streams. Mirrors `stages/src/shared/streams.rs`, which declares
// the constants POINTS, VERTICES, POOLS, NODES, NEW_BYTES, NUMBERS, MOST_GROUPS, START_STEP, BRICKS and NO_ATTRIBUTE.

// A node of the cut.
struct StreamNode {
    // The corner of the grid's cell (0, 0, 0), metres.
    origin: vec3<f32>,
    // The length of a cell's edge, metres.
    cell: f32,
    // Direction of the grid's x.
    x: vec3<f32>,
    // Where the colours are in the list of words, one for each point.
    colors: u32,
    // Direction of the grid's y.
    y: vec3<f32>,
    // Where the normals are in the list of words, one for each point.
    normals: u32,
    // Direction of the grid's z.
    z: vec3<f32>,
    // The node's first slot in the cloud.
    first_point: u32,
    // A unit quaternion: the rotation of its model.
    rotation: vec4<f32>,
    // Its index in the point set.
    index: u32,
    // Splits from the root to it.
    level: u32,
    // Its place by its index in the point set.
    place: u32,
    pad: u32,
}

// A pool of the cut.
struct StreamPool {
    // Its node by its index in the cut.
    node: u32,
    // Words of tags for each vertex; 0 for the points that no pool contains.
    tag_words: u32,
    // Where translations (or BRICKS), vertices and tags are in the list of words.
    translations: u32,
    vertices: u32,
    tags: u32,
    // The number of its first vertex among those of the cut.
    first_vertex: u32,
    // Its first slot in the cloud.
    first_point: u32,
    // Its number among the node's pools.
    number: u32,
}

// The centre of a packed cell, in the order of operations of the encoder.
fn cell_center(node: StreamNode, cell: u32) -> vec3<f32> {
    let at = (vec3<f32>((vec3(cell) >> vec3(0u, 7u, 14u)) & vec3(127u)) + 0.5) * node.cell;
    return node.origin + node.x * at.x + node.y * at.y + node.z * at.z;
}
