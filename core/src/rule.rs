//! What the numbers of a port may be, as stages declare it.
//!
//! A number that no rule is about may be anything if it is whole, and must be finite if it is a float.

/// What some numbers of a port may be. A [`Meaning`](crate::Meaning) has the rules of all ports with it;
/// [`Holds::within`](crate::Holds::within) gives a port its own. If several are about the same number, all must hold.
///
/// ```
/// use epigraph_core::Rule;
///
/// /// Linear colours: not negative.
/// const COLOR: &[Rule] = &[Rule::floats(0.0, f32::MAX).lanes(0, 3)];
/// /// Indices of points, or all bits for none.
/// const ID: &[Rule] = &[Rule::index_of("points").or(u32::MAX)];
/// assert_eq!(ID[0].none, Some(u32::MAX));
/// # let _ = COLOR;
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rule {
    /// The field of a bundle, or the member of a struct, that it is about; empty: all.
    pub of: &'static str,
    /// Its first lane, and the one after the last.
    pub lanes: [u32; 2],
    /// What its numbers may be.
    pub limit: Limit,
    /// The bits of one more value that is allowed: for none, for unknown.
    pub none: Option<u32>,
}

/// What a number may be.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Limit {
    /// Anything, for floats also infinity and NaN.
    Any,
    /// A float from the first to the second. A `u32` holds the bits of one.
    Floats(f32, f32),
    /// A whole number from the first to the second. Floats are not concerned.
    Wholes(i64, i64),
    /// Whole numbers whose bits hold another number: the first bit, the number of bits, and the greatest number.
    Bits(u32, u32, u32),
    /// The index of an element of the nearest port with the meaning of this name: one of the same stage, else one
    /// that its inputs come from.
    IndexOf(&'static str),
    /// A number of such elements: at most as many as there are.
    CountOf(&'static str),
    /// The index of a pixel of the frame, row by row.
    PixelIndex,
}

impl Rule {
    const fn new(limit: Limit) -> Self {
        Self { of: "", lanes: [0, u32::MAX], limit, none: None }
    }

    /// See [`Limit::Any`].
    pub const fn any() -> Self {
        Self::new(Limit::Any)
    }

    /// See [`Limit::Floats`].
    pub const fn floats(low: f32, high: f32) -> Self {
        Self::new(Limit::Floats(low, high))
    }

    /// See [`Limit::Wholes`].
    pub const fn wholes(low: i64, high: i64) -> Self {
        Self::new(Limit::Wholes(low, high))
    }

    /// See [`Limit::Bits`].
    pub const fn bits(from: u32, count: u32, most: u32) -> Self {
        Self::new(Limit::Bits(from, count, most))
    }

    /// See [`Limit::IndexOf`].
    pub const fn index_of(meaning: &'static str) -> Self {
        Self::new(Limit::IndexOf(meaning))
    }

    /// See [`Limit::CountOf`].
    pub const fn count_of(meaning: &'static str) -> Self {
        Self::new(Limit::CountOf(meaning))
    }

    /// See [`Limit::PixelIndex`].
    pub const fn pixel_index() -> Self {
        Self::new(Limit::PixelIndex)
    }

    /// Only about this field or member.
    pub const fn of(self, name: &'static str) -> Self {
        Self { of: name, ..self }
    }

    /// Only about these lanes of a vector or texel, of which `end` is the first that it is not about.
    pub const fn lanes(self, first: u32, end: u32) -> Self {
        Self { lanes: [first, end], ..self }
    }

    /// Allows one more value, given by its bits.
    pub const fn or(self, bits: u32) -> Self {
        Self { none: Some(bits), ..self }
    }
}
