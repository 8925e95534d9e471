//! The constants of the current frame for every shader and twin. `shaders/shared/frame.wgsl` mirrors it.

use bytemuck::{Pod, Zeroable};

use crate::port::{Element, Member, Scalar};

/// A pinhole view in the form that projects without cancellation at large coordinates: subtract the eye first, then
/// three dot products. 64 bytes.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub struct View {
    /// Eye point, metres.
    pub eye: [f32; 3],
    /// Nearest distance along the axis, metres.
    pub near: f32,
    /// Unit vector to the right of the image.
    pub right: [f32; 3],
    /// Farthest distance along the axis, metres.
    pub far: f32,
    /// Unit vector to the top of the image.
    pub up: [f32; 3],
    /// Tangent of half the horizontal field of view.
    pub tan_x: f32,
    /// Unit vector along the axis, into the image.
    pub forward: [f32; 3],
    /// Tangent of half the vertical field of view.
    pub tan_y: f32,
}

/// A view of the world from the origin along -z; 90 degrees.
impl Default for View {
    fn default() -> Self {
        Self {
            eye: [0.0; 3],
            near: 0.1,
            right: [1.0, 0.0, 0.0],
            far: 1000.0,
            up: [0.0, 1.0, 0.0],
            tan_x: 1.0,
            forward: [0.0, 0.0, -1.0],
            tan_y: 1.0,
        }
    }
}

/// The uniform `frame`. 224 bytes.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub struct Frame {
    /// The view that this frame shows.
    pub view: View,
    /// The view of the frame before.
    pub previous: View,
    /// The predicted view at the time when samples requested now will be shown.
    pub predicted: View,
    /// Width and height in pixels.
    pub size: [u32; 2],
    /// Frame number, from 0.
    pub index: u32,
    /// The run's seed.
    pub seed: u32,
    /// Number of samples that may be requested in this frame.
    pub samples: u32,
    /// Pads the size to a multiple of 16 bytes.
    pub padding: [u32; 3],
}

impl Frame {
    /// The uniform's layout, with members of nested structs as `view.eye`.
    pub fn element() -> Element {
        let mut members = Vec::new();
        let mut add = |name: String, scalar, lanes, offset: usize| {
            members.push(Member { name: name.into(), scalar, lanes, offset: offset as u32 });
        };
        let views = [
            ("view", std::mem::offset_of!(Self, view)),
            ("previous", std::mem::offset_of!(Self, previous)),
            ("predicted", std::mem::offset_of!(Self, predicted)),
        ];
        for (view, base) in views {
            let vectors = [("eye", "near"), ("right", "far"), ("up", "tan_x"), ("forward", "tan_y")];
            for (row, (vector, scalar)) in vectors.into_iter().enumerate() {
                add(format!("{view}.{vector}"), Scalar::F32, 3, base + 16 * row);
                add(format!("{view}.{scalar}"), Scalar::F32, 1, base + 16 * row + 12);
            }
        }
        add("size".into(), Scalar::U32, 2, std::mem::offset_of!(Self, size));
        add("index".into(), Scalar::U32, 1, std::mem::offset_of!(Self, index));
        add("seed".into(), Scalar::U32, 1, std::mem::offset_of!(Self, seed));
        add("samples".into(), Scalar::U32, 1, std::mem::offset_of!(Self, samples));
        Element::Item { name: "Frame".into(), stride: size_of::<Self>() as u32, members: members.into() }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_default_view_looks_along_minus_z_at_a_right_angle() {
        let View { eye, near, right, far, up, tan_x, forward, tan_y } = View::default();
        assert_eq!(eye, [0.0; 3]);
        assert_eq!([right, up, forward], [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, -1.0]]);
        assert_eq!([near, far, tan_x, tan_y], [0.1, 1000.0, 1.0, 1.0]);
    }
}
