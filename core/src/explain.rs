//! What a frame did at one pixel: what each stage finds worth telling about what it read and wrote there.
//!
//! Only a stage knows what its numbers mean and by which rule they came about. [`Stage::explain`](crate::Stage::explain)
//! decodes them and applies the rule anew to what the stage read; the application shows the [`Finding`]s.

use std::borrow::Cow;

use bytemuck::Pod;

use crate::{
    frame::Frame,
    port::{FieldRef, In, Out, PortElement},
};

/// Something worth knowing about a pixel.
#[derive(Clone, Debug, PartialEq)]
pub enum Finding {
    /// A value in words.
    Value {
        /// What it is.
        name: Cow<'static, str>,
        /// The value with its unit.
        text: String,
    },
    /// Linear Rec. 709 radiance.
    Color {
        /// What it is.
        name: Cow<'static, str>,
        /// Red, green and blue.
        linear: [f32; 3],
    },
    /// Why it came about, as a sentence: the rule, applied to this frame's numbers.
    Why(String),
    /// The pixels around.
    Around(Around),
    /// The pixel enlarged.
    Sketch(Vec<Mark>),
}

/// A square of pixels, of which the one in question is the middle one.
#[derive(Clone, Debug, PartialEq)]
pub struct Around {
    /// What is told of each.
    pub name: Cow<'static, str>,
    /// An odd number of rows, from the top, of as many cells.
    pub cells: Vec<Cell>,
}

/// What is told of one of the pixels around.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Cell {
    /// What it has to do with the pixel in question.
    pub role: Role,
    /// Its colour, linear radiance, where that matters.
    pub linear: Option<[f32; 3]>,
    /// Its number in words; may be empty.
    pub text: String,
}

/// What one of the pixels around has to do with the one in question.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Role {
    /// Nothing: it is empty, or outside of the image.
    #[default]
    None,
    /// It was looked at.
    Counts,
    /// It was looked at, and speaks against the pixel or its sample.
    Against,
    /// It cannot be reached.
    Apart,
}

/// A mark in a pixel that is drawn enlarged. Places are in pixels from its top left corner.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Mark {
    /// Where an edge crosses a side: from, to.
    Crossing([[f32; 2]; 2]),
    /// A stretch of an edge within the pixel: from, to.
    Edge([[f32; 2]; 2]),
    /// The cell that holds the pixel's sample: two corners.
    Sample([[f32; 2]; 2]),
    /// Where the next sample should go.
    Aim([f32; 2]),
}

impl Finding {
    /// A value in words.
    pub fn value(name: impl Into<Cow<'static, str>>, text: impl Into<String>) -> Self {
        Self::Value { name: name.into(), text: text.into() }
    }

    /// Linear radiance; further channels are left out.
    pub fn color(name: impl Into<Cow<'static, str>>, linear: &[f32]) -> Self {
        let channel = |at: usize| linear.get(at).copied().unwrap_or(0.0);
        Self::Color { name: name.into(), linear: [channel(0), channel(1), channel(2)] }
    }
}

/// The bytes of each field of a port; none where they are not known.
pub(crate) type Fields<'a> = Vec<Option<&'a [u8]>>;

/// What a port of a node held in a captured frame.
pub(crate) struct PortContents<'a> {
    /// Before the node ran.
    pub read: Fields<'a>,
    /// After it ran.
    pub written: Fields<'a>,
}

/// A pixel as one node of a captured frame sees it; [`Capture::site`](crate::Capture::site) makes it.
pub struct Site<'a> {
    frame: &'a Frame,
    ports: Vec<PortContents<'a>>,
    /// Column and row.
    pub pixel: [u32; 2],
    /// The element of the graph's lists that belongs to the pixel, for stages that work on lists: a point's slot.
    pub element: Option<usize>,
}

impl<'a> Site<'a> {
    /// A pixel inside of the frame, as seen by a node with these ports.
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

    /// The index of the pixel in ports of one element a pixel.
    pub fn at(&self) -> usize {
        self.pixel[1] as usize * self.size()[0] + self.pixel[0] as usize
    }

    /// The index of the pixel that lies so many columns and rows away; none outside of the image.
    pub fn beside(&self, [dx, dy]: [i32; 2]) -> Option<usize> {
        let [width, height] = self.size();
        let x = (self.pixel[0] as usize).checked_add_signed(dx as isize).filter(|x| *x < width)?;
        let y = (self.pixel[1] as usize).checked_add_signed(dy as isize).filter(|y| *y < height)?;
        Some(y * width + x)
    }

    /// The square of pixels that reaches so many to each side, row by row, told by `cell` from its offset.
    pub fn around(
        &self,
        name: impl Into<Cow<'static, str>>,
        reach: i32,
        mut cell: impl FnMut([i32; 2]) -> Cell,
    ) -> Finding {
        let offsets = (-reach..=reach).flat_map(|dy| (-reach..=reach).map(move |dx| [dx, dy]));
        Finding::Around(Around { name: name.into(), cells: offsets.map(&mut cell).collect() })
    }

    /// What the node read from an input. None where that is not known: of history, of results that come late from the
    /// GPU, and of what was not captured.
    pub fn read<E: PortElement>(&self, port: In<E>) -> Option<Cow<'a, [E::Cpu]>> {
        elements(&self.port(port.at).read, port.at)
    }

    /// What an output that is changed in place held before; none as for [`Site::read`].
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
    // Bytes of a vector lie where the allocator put them, which suits every element as a rule.
    Some(match bytemuck::try_cast_slice(bytes) {
        Ok(elements) => Cow::Borrowed(elements),
        Err(_) => Cow::Owned(bytemuck::pod_collect_to_vec(bytes)),
    })
}
