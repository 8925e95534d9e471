// What the surface at each pixel's centre is, without light. The rasteriser draws the indices of the triangles, then
// `resolve` follows each pixel's ray to the triangle that it shows.

#import frame
#import octahedral
#import pixel
#import segments
#import view
#ifdef MOVES
#import moves
#endif

struct SurfaceLook {
    albedo: vec3<f32>,
    roughness: f32,
    emission: vec3<f32>,
    flags: u32,
}

@group(0) @binding(1) var<storage, read> vertices: array<vec4<f32>>;
@group(0) @binding(2) var<storage, read> faces: array<vec4<u32>>;
@group(0) @binding(3) var<storage, read> corners: array<vec4<u32>>;
@group(0) @binding(4) var<storage, read> looks: array<SurfaceLook>;
#ifdef MOVES
@group(0) @binding(5) var<storage, read> moves: array<Move>;
#endif
@group(0) @binding(6) var drawn: texture_2d<u32>;
@group(0) @binding(7) var<storage, read_write> id: array<u32>;
@group(0) @binding(8) var<storage, read_write> depth: array<f32>;
@group(0) @binding(9) var<storage, read_write> normal: array<u32>;
@group(0) @binding(10) var albedo: texture_storage_2d<rgba16float, write>;
@group(0) @binding(11) var emission: texture_storage_2d<rgba32float, write>;
@group(0) @binding(12) var<storage, read_write> roughness: array<f32>;
@group(0) @binding(13) var<storage, read_write> motion: array<vec2<f32>>;

// The corners of a triangle, seen from the eye.
fn seen_corners(face: u32) -> array<vec3<f32>, 3> {
    let index = faces[face];
    let eye = frame.view.eye;
    return array(vertices[index.x].xyz - eye, vertices[index.y].xyz - eye, vertices[index.z].xyz - eye);
}

fn look_of(face: u32) -> SurfaceLook {
    return looks[corners[face].w & MATERIAL];
}

struct Meeting {
    // Barycentric weights of the corners.
    weights: vec3<f32>,
    // Distance along the view axis; not positive where the ray does not meet the triangle.
    z: f32,
}

// Where a ray from the eye meets a triangle. The rasteriser rounds corners to a fraction of a pixel, so that a ray may
// pass just outside: it then meets the nearest point, by weights.
fn meet(triangle: array<vec3<f32>, 3>, direction: vec3<f32>) -> Meeting {
    let a = triangle[0];
    let b = triangle[1];
    let c = triangle[2];
    // The volumes that the ray spans with the edges, proportional to the weights of the opposite corners.
    let volumes = vec3(
        dot(cross(c - b, c + b), direction),
        dot(cross(a - c, a + c), direction),
        dot(cross(b - a, b + a), direction),
    );
    let inside = max(volumes * sign(volumes.x + volumes.y + volumes.z), vec3(0.0));
    let sum = inside.x + inside.y + inside.z;
    if !(sum > 0.0) {
        return Meeting(vec3(1.0, 0.0, 0.0), 0.0);
    }
    let weights = inside / sum;
    let forward = frame.view.forward;
    let along = vec3(dot_in_order(a, forward), dot_in_order(b, forward), dot_in_order(c, forward));
    return Meeting(weights, dot_in_order(weights, along));
}

struct Vertex {
    @builtin(position) position: vec4<f32>,
    @location(0) @interpolate(flat) face: u32,
}

@vertex
fn corner(@builtin(vertex_index) index: u32) -> Vertex {
    let face = index / 3u;
    let triangle = seen_corners(face);
    let flags = look_of(face).flags;
    let is_front = dot(cross(triangle[1] - triangle[0], triangle[2] - triangle[0]), triangle[0]) < 0.0;
    if (flags & HOLE) != 0u || ((flags & CULLED) != 0u && !is_front) {
        return Vertex(vec4(2.0, 2.0, 2.0, 1.0), face);
    }
    let p = triangle[index % 3u];
    let view = frame.view;
    let z = dot_in_order(p, view.forward);
    // Clipped at the near plane; there is no far plane.
    let across = vec2(dot_in_order(p, view.right) / view.tan_x, dot_in_order(p, view.up) / view.tan_y);
    return Vertex(vec4(across, z - view.near, z), face);
}

struct Fragment {
    @location(0) face: u32,
    @builtin(frag_depth) depth: f32,
}

@fragment
fn draw(in: Vertex) -> Fragment {
    let z = meet(seen_corners(in.face), direction_through(frame.view, in.position.xy, frame.size)).z;
    if !(z > 0.0) {
        discard;
    }
    // Floats keep their digits near 0: no distance is told less exactly than another.
    return Fragment(in.face, z * DEPTH_SCALE);
}

@compute @workgroup_size(8, 8, 1)
fn resolve(@builtin(global_invocation_id) thread: vec3<u32>) {
    if any(thread.xy >= frame.size) {
        return;
    }
    let pixel = thread.xy;
    let p = pixel_index(pixel);
    let at = vec2<f32>(pixel) + 0.5;
    let direction = direction_through(frame.view, at, frame.size);
    let face = textureLoad(drawn, pixel, 0).x;
    id[p] = face;
    if face == NO_FACE {
        depth[p] = frame.view.far;
        normal[p] = NO_NORMAL;
        textureStore(albedo, pixel, vec4(0.0));
        textureStore(emission, pixel, vec4(0.0));
        roughness[p] = 0.0;
        motion[p] = motion_of(at, vec4(direction, 0.0), 0u);
        return;
    }
    let triangle = seen_corners(face);
    let met = meet(triangle, direction);
    let codes = corners[face];
    let look = looks[codes.w & MATERIAL];
    let geometric = normalize(cross(triangle[1] - triangle[0], triangle[2] - triangle[0]));
    let is_front = dot(geometric, direction) < 0.0;
    let facing = select(-geometric, geometric, is_front);
    depth[p] = min(met.z, frame.view.far);
    normal[p] = encode_oct16(shading_normal(codes.xyz, met.weights, facing));
    textureStore(albedo, pixel, vec4(look.albedo, 1.0));
    let emits = is_front || (look.flags & BOTH_SIDES) != 0u;
    textureStore(emission, pixel, vec4(select(vec3(0.0), look.emission, emits), 1.0));
    roughness[p] = look.roughness;
    motion[p] = motion_of(at, vec4(frame.view.eye + direction * met.z, 1.0), codes.w >> BODY_SHIFT);
}

// The normals of the corners, interpolated, on the side of `facing`; that where there are none.
fn shading_normal(codes: vec3<u32>, weights: vec3<f32>, facing: vec3<f32>) -> vec3<f32> {
    let sum = weights.x * unit_normal(codes.x) + weights.y * unit_normal(codes.y) + weights.z * unit_normal(codes.z);
    let length = length(sum);
    if !(length > 0.0) {
        return facing;
    }
    return select(sum, -sum, dot(sum, facing) < 0.0) / length;
}

// The unit vector of a code, zero for none.
fn unit_normal(code: u32) -> vec3<f32> {
    let vector = decode_oct16(code);
    return vector / max(length(vector), 1e-9);
}

// Where a point (w = 1) or direction (w = 0) of a body, which is at a position in the image, was in the last frame's.
fn motion_of(at: vec2<f32>, position: vec4<f32>, body: u32) -> vec2<f32> {
    var before = position.xyz;
    var stays = true;
#ifdef MOVES
    stays = rests(moves[body]);
    if !stays {
        before = point_before(moves[body], before);
    }
#endif
    if stays && same_view(frame.view, frame.previous) {
        return vec2(0.0);
    }
    let then = place_in_image(frame.previous, vec4(before, position.w), frame.size);
    return select(vec2(NOWHERE), then.xy - at, then.z > 0.0);
}
