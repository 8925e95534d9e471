// Where points of the cloud project to in an image. Mirrors `stages/src/shared/view.rs`, operation by operation. Import
// frame too: it defines View.

struct Projected {
    // Pixels from the left and top edges.
    at: vec2<f32>,
    // Distance along the view axis, metres, at most that of the far plane; negative: not drawn.
    z: f32,
}

// Where a point (w = 1) or direction (w = 0) is in an image of `size` pixels that has no border: pixels from the left
// and top edge; and its distance along the view axis, or that of the direction's end. Where that is not positive, behind
// the eye, the position means nothing.
fn place_in_image(view: View, position: vec4<f32>, size: vec2<u32>) -> vec3<f32> {
    let p = position.xyz - select(view.eye, vec3(0.0), position.w == 0.0);
    let z = dot_in_order(p, view.forward);
    let inverse = 1.0 / z;
    let half = 0.5 * vec2<f32>(size);
    let x = half.x + dot_in_order(p, view.right) * inverse * (half.x / view.tan_x);
    let y = half.y - dot_in_order(p, view.up) * inverse * (half.y / view.tan_y);
    return vec3(x, y, z);
}

// Projects a point (w = 1) or a direction (w = 0) into an image of `size` pixels.
fn project_point(view: View, position: vec4<f32>, size: vec2<u32>) -> Projected {
    let is_direction = position.w == 0.0;
    let place = place_in_image(view, position, size);
    let x = place.x;
    let y = place.y;
    let z = place.z;
    let nearest = select(view.near, 1.17549435e-38, is_direction);
    let drawn = z >= nearest && x >= 0.0 && x < f32(size.x) && y >= 0.0 && y < f32(size.y);
    let clamped = select(min(z, view.far), view.far, is_direction);
    return Projected(vec2(x, y), select(-1.0, clamped, drawn));
}

// Which of `cells` x `cells` cells of its pixel contains a projected point, row by row from the top left one.
fn cell_of(at: vec2<f32>, cells: u32) -> u32 {
    let cell = vec2<u32>((at - floor(at)) * f32(cells));
    return cell.y * cells + cell.x;
}

// The built-in dot product does not specify the order of its sums.
fn dot_in_order(a: vec3<f32>, b: vec3<f32>) -> f32 {
    return a.x * b.x + a.y * b.y + a.z * b.z;
}

// The direction through a position in an image of `size` pixels; its length along the view axis is 1.
fn direction_through(view: View, at: vec2<f32>, size: vec2<u32>) -> vec3<f32> {
    let u = (2.0 * at.x / f32(size.x) - 1.0) * view.tan_x;
    let v = (1.0 - 2.0 * at.y / f32(size.y)) * view.tan_y;
    return view.forward + u * view.right + v * view.up;
}

fn same_view(a: View, b: View) -> bool {
    return all(a.eye == b.eye) && all(a.right == b.right) && all(a.up == b.up) && all(a.forward == b.forward)
        && a.near == b.near && a.far == b.far && a.tan_x == b.tan_x && a.tan_y == b.tan_y;
}
