// Which positions are pixels of the frame, and their index in lists.

#import frame

// Whether a position is outside the image.
fn is_outside(pixel: vec2<i32>) -> bool {
    return any(pixel < vec2(0)) || any(pixel >= vec2<i32>(frame.size));
}

// The index of a pixel in lists that hold the image row by row.
fn pixel_index(pixel: vec2<u32>) -> u32 {
    return pixel.y * frame.size.x + pixel.x;
}

// The index of a pixel's left and top side in `mask`, which has one more column and row than the image.
fn corner_index(pixel: vec2<u32>) -> u32 {
    return pixel.y * (frame.size.x + 1u) + pixel.x;
}
