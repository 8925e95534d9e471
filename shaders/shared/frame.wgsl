// The current frame, as the core passes it to every shader that imports this file. Mirrors `core/src/frame.rs`.

// A pinhole view: project p by subtracting the eye, then three dot products.
struct View {
    // Eye point, metres.
    eye: vec3<f32>,
    // Nearest distance along the axis, metres.
    near: f32,
    // Unit vector to the right of the image.
    right: vec3<f32>,
    // Farthest distance along the axis, metres.
    far: f32,
    // Unit vector to the top of the image.
    up: vec3<f32>,
    // Tangent of half the horizontal field of view.
    tan_x: f32,
    // Unit vector along the axis, into the image.
    forward: vec3<f32>,
    // Tangent of half the vertical field of view.
    tan_y: f32,
}

struct Frame {
    // The view that this frame shows.
    view: View,
    // The view of the frame before.
    previous: View,
    // The predicted view at the time when samples requested now will be shown.
    predicted: View,
    // Width and height in pixels.
    size: vec2<u32>,
    // Frame number, from 0.
    index: u32,
    // The run's seed.
    seed: u32,
    // Number of samples that may be requested in this frame.
    samples: u32,
}

@group(0) @binding(0) var<uniform> frame: Frame;
