//! Ports: what a stage reads and writes. A port's name is the name of the WGSL variable that binds it.

use std::{borrow::Cow, fmt, marker::PhantomData};

use bytemuck::Pod;

use crate::{facts::Quantity, rule::Rule, side::Side};

/// A texture format that both sides support. All can be written as storage textures on every WebGPU device.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Format {
    /// One channel, f32.
    R32Float,
    /// One channel, u32.
    R32Uint,
    /// Four channels of 8 bits, 0 to 1.
    Rgba8Unorm,
    /// Four channels, f16.
    Rgba16Float,
    /// Four channels, f32.
    Rgba32Float,
}

impl Format {
    /// Bytes of a texel.
    pub fn bytes(self) -> u32 {
        match self {
            Self::R32Float | Self::R32Uint | Self::Rgba8Unorm => 4,
            Self::Rgba16Float => 8,
            Self::Rgba32Float => 16,
        }
    }

    /// Whether shaders read it as f32; otherwise as u32.
    pub fn is_float(self) -> bool {
        self != Self::R32Uint
    }

    /// The scalar that shaders read it as.
    pub(crate) fn scalar(self) -> Scalar {
        if self.is_float() { Scalar::F32 } else { Scalar::U32 }
    }

    /// Its number of channels.
    pub(crate) fn channels(self) -> u32 {
        match self {
            Self::R32Float | Self::R32Uint => 1,
            Self::Rgba8Unorm | Self::Rgba16Float | Self::Rgba32Float => 4,
        }
    }

    /// All formats.
    pub const ALL: [Self; 5] =
        [Self::R32Float, Self::R32Uint, Self::Rgba8Unorm, Self::Rgba16Float, Self::Rgba32Float];

    /// Its name in WGSL, as in `texture_storage_2d<rgba32float, write>`.
    pub fn wgsl(self) -> &'static str {
        match self {
            Self::R32Float => "r32float",
            Self::R32Uint => "r32uint",
            Self::Rgba8Unorm => "rgba8unorm",
            Self::Rgba16Float => "rgba16float",
            Self::Rgba32Float => "rgba32float",
        }
    }
}

/// The 32-bit scalars that buffers and uniforms are made of.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Scalar {
    /// IEEE single.
    F32,
    /// Unsigned.
    U32,
    /// Signed.
    I32,
}

impl Scalar {
    /// Its name in WGSL.
    pub fn wgsl(self) -> &'static str {
        match self {
            Self::F32 => "f32",
            Self::U32 => "u32",
            Self::I32 => "i32",
        }
    }
}

/// One member of a buffer element: `lanes` scalars at a byte offset.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub struct Member {
    /// The WGSL member's name; empty for a plain scalar or vector.
    pub name: Cow<'static, str>,
    /// Scalar type.
    pub scalar: Scalar,
    /// 1 to 4.
    pub lanes: u32,
    /// Bytes from the element's start.
    pub offset: u32,
}

/// The type of one element of a port.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub enum Element {
    /// A texel: the port binds a texture.
    Texel(Format),
    /// A texel of any format that a shader reads as f32: for a `texture_2d<f32>` of unknown format. Inputs only.
    AnyFloatTexel,
    /// An array element: the port binds a storage buffer `array<T>`.
    Item {
        /// The WGSL type's name.
        name: Cow<'static, str>,
        /// Bytes from one element to the next.
        stride: u32,
        /// One unnamed member for scalars and vectors, all members of a struct.
        members: Cow<'static, [Member]>,
    },
}

impl Element {
    /// Bytes of one element.
    pub fn bytes(&self) -> u32 {
        match self {
            Self::Texel(format) => format.bytes(),
            // Inputs allocate nothing: the connected format counts.
            Self::AnyFloatTexel => 0,
            Self::Item { stride, .. } => *stride,
        }
    }

    /// Where its numbers of 32 bits are, in bytes from its start.
    pub fn floats(&self) -> Vec<usize> {
        match self {
            Self::Texel(format @ (Format::R32Float | Format::Rgba32Float)) => {
                (0..format.bytes() as usize).step_by(4).collect()
            }
            Self::Texel(_) | Self::AnyFloatTexel => Vec::new(),
            Self::Item { members, .. } => {
                let floats = members.iter().filter(|member| member.scalar == Scalar::F32);
                floats
                    .flat_map(|member| (0..member.lanes).map(|lane| (member.offset + 4 * lane) as usize))
                    .collect()
            }
        }
    }

    /// The scalar types of its numbers, as shaders read them.
    pub(crate) fn scalars(&self) -> Vec<Scalar> {
        match self {
            Self::Texel(format) => vec![format.scalar()],
            Self::AnyFloatTexel => vec![Scalar::F32],
            Self::Item { members, .. } => members.iter().map(|member| member.scalar).collect(),
        }
    }

    /// Whether an input with these elements accepts the elements `given`.
    pub fn accepts(&self, given: &Element) -> bool {
        match (self, given) {
            (Self::AnyFloatTexel, Self::Texel(format)) => format.is_float(),
            _ => self == given,
        }
    }
}

impl fmt::Display for Element {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Texel(format) => write!(f, "texture<{}>", format.wgsl()),
            Self::AnyFloatTexel => write!(f, "a texture of floats"),
            Self::Item { name, .. } => write!(f, "array<{name}>"),
        }
    }
}

/// Rust types that describe a port's elements: `u32`, `[f32; 4]`, structs made with [`crate::item!`] for buffers, and
/// the markers of [`texel`] for textures.
pub trait PortElement: 'static {
    /// The slice element of the CPU twin.
    type Cpu: Pod;
    /// The element's description.
    fn element() -> Element;
}

/// Describes a scalar or vector buffer element.
pub const fn plain(name: &'static str, stride: u32, members: &'static [Member]) -> Element {
    Element::Item { name: Cow::Borrowed(name), stride, members: Cow::Borrowed(members) }
}

macro_rules! plain_elements {
    ($($rust:ty, $name:literal, $scalar:ident, $lanes:literal;)*) => {$(
        impl PortElement for $rust {
            type Cpu = $rust;
            fn element() -> Element {
                const MEMBERS: &[Member] =
                    &[Member { name: Cow::Borrowed(""), scalar: Scalar::$scalar, lanes: $lanes, offset: 0 }];
                plain($name, 4 * $lanes, MEMBERS)
            }
        }
    )*};
}

plain_elements! {
    u32, "u32", U32, 1;
    i32, "i32", I32, 1;
    f32, "f32", F32, 1;
    [u32; 2], "vec2<u32>", U32, 2;
    [f32; 2], "vec2<f32>", F32, 2;
    [u32; 4], "vec4<u32>", U32, 4;
    [f32; 4], "vec4<f32>", F32, 4;
}

/// Rust types of struct members, for [`crate::item!`].
pub trait ItemMember {
    /// Scalar type.
    const SCALAR: Scalar;
    /// Number of scalars.
    const LANES: u32;
}

macro_rules! item_members {
    ($($rust:ty, $scalar:ident, $lanes:literal;)*) => {$(
        impl ItemMember for $rust {
            const SCALAR: Scalar = Scalar::$scalar;
            const LANES: u32 = $lanes;
        }
    )*};
}

item_members! {
    u32, U32, 1; i32, I32, 1; f32, F32, 1;
    [f32; 2], F32, 2; [f32; 3], F32, 3; [f32; 4], F32, 4;
    [u32; 2], U32, 2; [u32; 3], U32, 3; [u32; 4], U32, 4;
}

/// Defines a `repr(C)` struct that is one element of a buffer port. The WGSL struct has the same name, members and
/// offsets; naga checks that. Pad by hand where WGSL aligns (a vec3 or vec4 starts at a multiple of 16 bytes).
///
/// The package must depend on `epigraph-core` under this name: the derived code for the struct looks for bytemuck
/// there.
#[macro_export]
macro_rules! item {
    ($(#[$meta:meta])* $vis:vis struct $name:ident { $($(#[$field_meta:meta])* $field:ident: $ty:ty),* $(,)? }) => {
        $(#[$meta])*
        #[repr(C)]
        #[derive(Clone, Copy, Debug, Default, PartialEq, $crate::bytemuck::Pod, $crate::bytemuck::Zeroable)]
        #[bytemuck(crate = "::epigraph_core::bytemuck")]
        $vis struct $name { $($(#[$field_meta])* pub $field: $ty),* }

        impl $crate::PortElement for $name {
            type Cpu = $name;
            fn element() -> $crate::Element {
                let members = vec![$($crate::Member {
                    name: stringify!($field).into(),
                    scalar: <$ty as $crate::ItemMember>::SCALAR,
                    lanes: <$ty as $crate::ItemMember>::LANES,
                    offset: std::mem::offset_of!($name, $field) as u32,
                }),*];
                $crate::Element::Item {
                    name: stringify!($name).into(),
                    stride: std::mem::size_of::<$name>() as u32,
                    members: members.into(),
                }
            }
        }
    };
}

/// Markers for texture ports, named like WGSL's formats.
pub mod texel {
    use super::{Element, Format, PortElement};

    macro_rules! texels {
        ($($(#[$meta:meta])* $name:ident, $cpu:ty;)*) => {$(
            $(#[$meta])*
            #[derive(Clone, Copy, Debug)]
            pub struct $name;
            impl PortElement for $name {
                type Cpu = $cpu;
                fn element() -> Element {
                    Element::Texel(Format::$name)
                }
            }
        )*};
    }

    texels! {
        /// One channel, f32.
        R32Float, f32;
        /// One channel, u32.
        R32Uint, u32;
        /// Four channels of 8 bits, 0 to 1.
        Rgba8Unorm, [u8; 4];
        /// Four channels, f16.
        Rgba16Float, [half::f16; 4];
        /// Four channels, f32.
        Rgba32Float, [f32; 4];
    }
}

/// This many for each pixel of a frame, rounded to the nearest whole number; at least 1. Everything that counts shares of a
/// frame's pixels, samples and points, does it by this function.
pub fn share_of(size: [u32; 2], per_pixel: f64) -> u64 {
    let [width, height] = size.map(f64::from);
    ((width * height * per_pixel).round() as u64).max(1)
}

/// The number of elements of a port.
#[derive(Clone, Debug, PartialEq)]
pub enum Extent {
    /// Per pixel of the frame, divided by this number on each axis, rounded up: 1 is full resolution.
    Frame(u32),
    /// A list with this many elements for each pixel of the frame: [`share_of`] its pixels.
    PerPixel(f32),
    /// A list with one element for each sample that a frame may request: [`Frame::samples`](crate::Frame::samples).
    Requests,
    /// One for each corner of the frame's pixels: one more than the frame on each axis.
    Corners,
    /// A list with one element for each item of one of the application's quantities.
    Each(Quantity),
    /// The extent of another port of the same stage.
    Like(Cow<'static, str>),
    /// A list of u32 with one bit for each element of another port of the same stage, the first in the lowest bit.
    BitsOf(Cow<'static, str>),
    /// A fixed width and height.
    Fixed([u32; 2]),
    /// The extent of the connected port (inputs only).
    Any,
}

impl Quantity {
    /// A list with one element for each item of the quantity.
    pub const fn list(self) -> Extent {
        Extent::Each(self)
    }
}

impl fmt::Display for Extent {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Frame(1) => write!(f, "one per pixel"),
            Self::Frame(n) => write!(f, "one per {n}x{n} pixels"),
            Self::PerPixel(share) => write!(f, "a list of {share} per pixel"),
            Self::Requests => write!(f, "a list of one per requested sample"),
            Self::Corners => write!(f, "one per corner of a pixel"),
            Self::Each(quantity) => write!(f, "a list of one per {}", quantity.one),
            Self::Like(port) => write!(f, "as many as `{port}`"),
            Self::BitsOf(port) => write!(f, "a list of one per 32 of `{port}`"),
            Self::Fixed([n, 1]) => write!(f, "a list of {n}"),
            Self::Fixed([w, h]) => write!(f, "{w}x{h}"),
            Self::Any => write!(f, "any number"),
        }
    }
}

/// An extent in numbers. Lists have height 1.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub struct Dims {
    /// Elements in a row.
    pub width: u32,
    /// Rows.
    pub height: u32,
}

impl Dims {
    /// Number of elements.
    pub fn count(self) -> usize {
        self.width as usize * self.height as usize
    }
}

impl fmt::Display for Dims {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}x{}", self.width, self.height)
    }
}

/// What a stage does with a port.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Access {
    /// Reads this frame's value.
    Read,
    /// Reads the value of the frame before (zero in the first frame).
    History,
    /// Changes the connected value in place and passes it on under the same name.
    Update,
    /// Writes every element that any node reads.
    Write,
}

/// How long a written value lives.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Lifetime {
    /// Until its last reader in the frame; the memory is then pooled.
    Transient,
    /// From frame to frame, zero at the start; kept across a recompile if its description is the same.
    Persistent,
}

/// One variable of a port. Ports with one variable have one field with an empty name; a bundle such as the point cloud
/// has several, bound as `port_field`.
#[derive(Clone, Debug, PartialEq)]
pub struct Field {
    /// Empty for the only one.
    pub name: Cow<'static, str>,
    /// Its elements.
    pub element: Element,
}

/// What the values of a port mean: a depth, a priority, a list of samples. Applications define their own as constants,
/// with [`meanings`](crate::meanings); this crate only compares and prints them.
#[derive(Clone, Copy, PartialEq)]
pub struct Meaning {
    /// Its name, a word or two.
    pub name: &'static str,
    /// One sentence, for ports without a sentence of their own.
    pub doc: &'static str,
    /// What the values may be, for ports without rules of their own.
    pub rules: &'static [Rule],
}

impl Meaning {
    /// For a port of this meaning with a sentence of its own.
    pub fn doc(self, doc: &'static str) -> Holds {
        Holds { doc, meaning: Some(self), scratch: false, rules: &[] }
    }

    /// For a port of this meaning with rules of its own about what its values may be.
    pub fn within(self, rules: &'static [Rule]) -> Holds {
        Holds::from(self).within(rules)
    }
}

/// Without the rules, which are long: the name stands for them.
impl fmt::Debug for Meaning {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Meaning").field("name", &self.name).field("doc", &self.doc).finish()
    }
}

impl fmt::Display for Meaning {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name)
    }
}

/// Defines constants of type [`Meaning`]. A constant's doc comment is its sentence; after a comma come the rules about
/// what the values may be, if there are any.
///
/// ```
/// use epigraph_core::Rule;
///
/// epigraph_core::meanings! {
///     /// Distance along the camera's axis, metres.
///     DEPTH = "depth", [Rule::floats(0.0, f32::MAX)];
///     /// What is left of it.
///     REST = "rest";
/// }
/// assert_eq!(DEPTH.doc, "Distance along the camera's axis, metres.");
/// assert_eq!([DEPTH, REST].map(|meaning| meaning.rules.len()), [1, 0]);
/// ```
#[macro_export]
macro_rules! meanings {
    ($($(#[doc = $doc:literal])+ $constant:ident = $name:literal $(, [$($rule:expr),+ $(,)?])?;)+) => {$(
        $(#[doc = $doc])+
        pub const $constant: $crate::Meaning = $crate::Meaning {
            name: $name,
            doc: concat!($($doc),+).trim_ascii(),
            rules: &[$($($rule),+)?],
        };
    )+};
}

/// The description of a port. It is made from a sentence, from a [`Meaning`], from both by [`Meaning::doc`], or by
/// [`scratch`].
#[derive(Clone, Copy, Debug)]
pub struct Holds {
    pub(crate) doc: &'static str,
    pub(crate) meaning: Option<Meaning>,
    pub(crate) scratch: bool,
    pub(crate) rules: &'static [Rule],
}

impl Holds {
    /// For a port whose values make sense only to its stage.
    pub fn scratch(self) -> Self {
        Self { scratch: true, ..self }
    }

    /// For a port with rules of its own about what its values may be, in the place of those of its meaning.
    pub fn within(self, rules: &'static [Rule]) -> Self {
        Self { rules, ..self }
    }
}

impl From<&'static str> for Holds {
    fn from(doc: &'static str) -> Self {
        Self { doc, meaning: None, scratch: false, rules: &[] }
    }
}

impl From<Meaning> for Holds {
    fn from(meaning: Meaning) -> Self {
        meaning.doc(meaning.doc)
    }
}

/// For a port whose values make sense only to its stage: `io.write("sums", scratch("Points before each block."), ...)`.
pub fn scratch(doc: &'static str) -> Holds {
    Holds::from(doc).scratch()
}

/// Everything that a stage declares about one port.
#[derive(Clone, Debug, PartialEq)]
pub struct Port {
    /// Name in the graph file and in the shader.
    pub name: Cow<'static, str>,
    /// One sentence.
    pub doc: Cow<'static, str>,
    /// Read, history, update or write.
    pub access: Access,
    /// Its variables.
    pub fields: Vec<Field>,
    /// What its values mean; `None` if the stage does not say.
    pub meaning: Option<Meaning>,
    /// Whether its values make sense only to its stage.
    pub scratch: bool,
    /// What its values may be; empty: what its meaning says.
    pub rules: Cow<'static, [Rule]>,
    /// Its number of elements.
    pub extent: Extent,
    /// Its number of elements where the stage runs on the CPU, if that is another one.
    pub extent_on_cpu: Option<Extent>,
    /// How long its values live (written ports).
    pub lifetime: Lifetime,
    /// Whether it may stay unconnected.
    pub optional: bool,
    /// What it contains at the start; empty: zeros. See [`Io::table`](crate::Io::table).
    pub table: &'static [u32],
}

impl Port {
    /// Its number of elements where the stage runs on this side.
    pub(crate) fn extent_on(&self, side: Side) -> &Extent {
        self.extent_on_cpu.as_ref().filter(|_| side == Side::Cpu).unwrap_or(&self.extent)
    }

    /// The WGSL variable of a field of this port.
    pub fn variable(&self, field: usize) -> String {
        match self.fields[field].name.as_ref() {
            "" => self.name.to_string(),
            name => format!("{}_{name}", self.name),
        }
    }

    /// Whether the port takes a wire.
    pub fn is_input(&self) -> bool {
        self.access != Access::Write
    }

    /// Whether a wire may start at this port.
    pub fn is_output(&self) -> bool {
        matches!(self.access, Access::Write | Access::Update)
    }
}

/// The port and field that a handle refers to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FieldRef {
    /// Index in the stage's list of ports.
    pub port: u16,
    /// Index in the port's fields.
    pub field: u16,
}

/// A handle for reading; only a declaration can make one.
pub struct In<E: ?Sized> {
    pub(crate) at: FieldRef,
    _element: PhantomData<fn() -> Box<E>>,
}

/// A handle for writing; only a declaration can make one.
pub struct Out<E: ?Sized> {
    pub(crate) at: FieldRef,
    _element: PhantomData<fn() -> Box<E>>,
}

macro_rules! handle {
    ($name:ident) => {
        impl<E: ?Sized> Clone for $name<E> {
            fn clone(&self) -> Self {
                *self
            }
        }
        impl<E: ?Sized> Copy for $name<E> {}
        impl<E: ?Sized> fmt::Debug for $name<E> {
            fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                write!(f, "{:?}", self.at)
            }
        }
        impl<E: ?Sized> $name<E> {
            pub(crate) fn mint(at: FieldRef) -> Self {
                Self { at, _element: PhantomData }
            }
        }
        impl<E: ?Sized> From<$name<E>> for FieldRef {
            fn from(handle: $name<E>) -> Self {
                handle.at
            }
        }
    };
}
handle!(In);
handle!(Out);
