//! What a frame did at one pixel: what each stage reports about the values it read and wrote there.
//!
//! Only a stage knows what its numbers mean and which rule produced them. [`Stage::explain`](crate::Stage::explain)
//! decodes them and applies the rule again to the stage's inputs; the application shows the [`Finding`]s.

use std::borrow::Cow;

use bytemuck::Pod;

use crate::{
    frame::Frame,
    port::{FieldRef, In, Out, PortElement},
};

/// One fact about a pixel.
#[derive(Clone, Debug, PartialEq)]
pub enum Finding {
    /// A named value as text.
    Value {
        /// Its name.
        name: Cow<'static, str>,
        /// The value with its unit.
        text: String,
    },
    /// Linear Rec. 709 radiance.
    Color {
        /// Its name.
        name: Cow<'static, str>,
        /// Red, green and blue.
        linear: [f32; 3],
    },
    /// The reason, as a sentence: the rule, applied to this frame's numbers.
    Why(String),
    /// The pixel's neighbourhood.
    Around(Around),
    /// The pixel, enlarged.
    Sketch(Vec<Mark>),
}

/// A square of pixels, centred on the inspected one.
#[derive(Clone, Debug, PartialEq)]
pub struct Around {
    /// The quantity shown for each pixel.
    pub name: Cow<'static, str>,
    /// The rows from the top: an odd number, each with as many cells.
    pub cells: Vec<Cell>,
}

/// What is shown for one pixel of a neighbourhood.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Cell {
    /// Its relation to the inspected pixel.
    pub role: Role,
    /// Its colour as linear radiance, if that matters.
    pub linear: Option<[f32; 3]>,
    /// Its number as text; may be empty.
    pub text: String,
}

/// How a neighbouring pixel relates to the inspected one.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Role {
    /// Not at all: it is empty, or outside the image.
    #[default]
    None,
    /// It was examined.
    Counts,
    /// It was examined, and counts against the pixel or its sample.
    Against,
    /// It cannot be reached.
    Apart,
}

/// A mark in a pixel that is drawn enlarged. Positions are in pixels from its top left corner.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Mark {
    /// Where an edge crosses a side: from, to.
    Crossing([[f32; 2]; 2]),
    /// A segment of an edge within the pixel: from, to.
    Edge([[f32; 2]; 2]),
    /// The cell of the pixel's sample: two corners.
    Sample([[f32; 2]; 2]),
    /// Where the next sample should go.
    Aim([f32; 2]),
}

impl Finding {
    /// A named value as text.
    pub fn value(name: impl Into<Cow<'static, str>>, text: impl Into<String>) -> Self {
        Self::Value { name: name.into(), text: text.into() }
    }

    /// Linear radiance; further channels are left out.
    pub fn color(name: impl Into<Cow<'static, str>>, linear: &[f32]) -> Self {
        let channel = |at: usize| linear.get(at).copied().unwrap_or(0.0);
        Self::Color { name: name.into(), linear: [channel(0), channel(1), channel(2)] }
    }
}

/// The bytes of each field of a port; `None` if unknown.
pub(crate) type Fields<'a> = Vec<Option<&'a [u8]>>;

/// What a port of a node held in a captured frame.
pub(crate) struct PortContents<'a> {
    /// Before the node ran.
    pub read: Fields<'a>,
    /// After it ran.
    pub written: Fields<'a>,
}

/// A pixel as one node of a captured frame sees it; made by [`Capture::site`](crate::Capture::site).
pub struct Site<'a> {
    frame: &'a Frame,
    ports: Vec<PortContents<'a>>,
    /// Column and row.
    pub pixel: [u32; 2],
    /// For stages that work on lists: the list element that belongs to the pixel, such as a point's slot.
    pub element: Option<usize>,
}

impl<'a> Site<'a> {
    /// A pixel inside the frame, as seen by a node with these ports.
    pub(crate) fn new(
        frame: &'a Frame,
        pixel: [u32; 2],
        element: Option<usize>,
        ports: Vec<PortContents<'a>>,
    ) -> Self {
        Self { frame, ports, pixel, element }
    }

    /// The frame.
    pub fn frame(&self) -> &'a Frame {
        self.frame
    }

    /// Width and height of the frame in pixels.
    pub fn size(&self) -> [usize; 2] {
        self.frame().size.map(|side| side as usize)
    }

    /// The index of the pixel in ports with one element per pixel.
    pub fn at(&self) -> usize {
        self.pixel[1] as usize * self.size()[0] + self.pixel[0] as usize
    }

    /// The index of the pixel at this offset in columns and rows; `None` outside the image.
    pub fn beside(&self, [dx, dy]: [i32; 2]) -> Option<usize> {
        let [width, height] = self.size();
        let x = (self.pixel[0] as usize).checked_add_signed(dx as isize).filter(|x| *x < width)?;
        let y = (self.pixel[1] as usize).checked_add_signed(dy as isize).filter(|y| *y < height)?;
        Some(y * width + x)
    }

    /// The square of pixels up to `reach` pixels away on each side, row by row; `cell` describes the pixel at an
    /// offset.
    pub fn around(
        &self,
        name: impl Into<Cow<'static, str>>,
        reach: i32,
        mut cell: impl FnMut([i32; 2]) -> Cell,
    ) -> Finding {
        let offsets = (-reach..=reach).flat_map(|dy| (-reach..=reach).map(move |dx| [dx, dy]));
        Finding::Around(Around { name: name.into(), cells: offsets.map(&mut cell).collect() })
    }

    /// What the node read from an input. `None` if unknown: history, results that come late from the GPU, and anything
    /// that was not captured.
    pub fn read<E: PortElement>(&self, port: In<E>) -> Option<Cow<'a, [E::Cpu]>> {
        elements(&self.port(port.at).read, port.at)
    }

    /// The contents of an output that is changed in place, before the node ran; `None` as in [`Site::read`].
    pub fn before<E: PortElement>(&self, port: Out<E>) -> Option<Cow<'a, [E::Cpu]>> {
        elements(&self.port(port.at).read, port.at)
    }

    /// What the node wrote to an output.
    pub fn wrote<E: PortElement>(&self, port: Out<E>) -> Option<Cow<'a, [E::Cpu]>> {
        elements(&self.port(port.at).written, port.at)
    }

    fn port(&self, at: FieldRef) -> &PortContents<'a> {
        &self.ports[at.port as usize]
    }
}

fn elements<'a, T: Pod>(fields: &Fields<'a>, at: FieldRef) -> Option<Cow<'a, [T]>> {
    let bytes = (*fields.get(at.field as usize)?)?;
    // The bytes of a vector are wherever the allocator put them; the alignment usually suits every element.
    Some(match bytemuck::try_cast_slice(bytes) {
        Ok(elements) => Cow::Borrowed(elements),
        Err(_) => Cow::Owned(bytemuck::pod_collect_to_vec(bytes)),
    })
}
