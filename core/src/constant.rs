//! Constants that a shader gets from a Rust declaration, so that no number is written twice.

use std::{borrow::Cow, fmt::Write};

use crate::{
    params::{ParamKind, ParamSpec},
    port::Scalar,
};

/// A named number that a shader can use without declaring it. [`crate::constants!`] makes those of a stage or shared
/// module; each parameter with a [`crate::choice!`] gives its own, see [`Constant::of_choice`].
#[derive(Clone, Debug, PartialEq)]
pub struct Constant {
    name: Cow<'static, str>,
    scalar: Scalar,
    bits: u32,
}

impl Constant {
    /// A constant of type `u32`.
    pub const fn u32(name: &'static str, value: u32) -> Self {
        Self { name: Cow::Borrowed(name), scalar: Scalar::U32, bits: value }
    }

    /// A constant of type `usize` in Rust, `u32` in WGSL.
    pub const fn usize(name: &'static str, value: usize) -> Self {
        assert!(value <= u32::MAX as usize);
        Self::u32(name, value as u32)
    }

    /// A constant of type `i32`.
    pub const fn i32(name: &'static str, value: i32) -> Self {
        Self { name: Cow::Borrowed(name), scalar: Scalar::I32, bits: value as u32 }
    }

    /// A constant of type `f32`. The value must be finite: WGSL has no constants for infinity and NaN.
    pub const fn f32(name: &'static str, value: f32) -> Self {
        Self { name: Cow::Borrowed(name), scalar: Scalar::F32, bits: value.to_bits() }
    }

    /// The uniform values of a parameter with named choices: `RULE_SEED_EXACT` for the variant `SeedExact` of the
    /// parameter `rule`. Empty for other parameters.
    pub fn of_choice(param: &ParamSpec) -> Vec<Self> {
        let ParamKind::Choice(variants) = &param.kind else { return Vec::new() };
        let named =
            |variant: &String| Cow::Owned(format!("{}_{}", param.name, snake(variant)).to_uppercase());
        let constant = |(bits, variant)| Self { name: named(variant), scalar: Scalar::U32, bits };
        (0..).zip(variants).map(constant).collect()
    }

    /// Its name in WGSL.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Its type in WGSL.
    pub fn ty(&self) -> &'static str {
        self.scalar.wgsl()
    }

    /// Appends its WGSL declaration, one line.
    pub(crate) fn declare(&self, out: &mut String) {
        let value = match self.scalar {
            Scalar::U32 => format!("{}u", self.bits),
            // WGSL has no literal for the smallest i32.
            Scalar::I32 => format!("{}", self.bits as i32),
            Scalar::F32 => format!("{:?}f", f32::from_bits(self.bits)),
        };
        writeln!(out, "const {}: {} = {value};", self.name, self.scalar.wgsl()).expect("a String takes all");
    }
}

/// `SeedExact` as `Seed_Exact`.
fn snake(variant: &str) -> String {
    let mut snake = String::new();
    for letter in variant.chars() {
        if letter.is_uppercase() && !snake.is_empty() {
            snake.push('_');
        }
        snake.push(letter);
    }
    snake
}

/// Declares constants once for Rust and WGSL: `const` items of type u32, usize, i32 or f32, and `CONSTANTS`, which
/// lists them for [`crate::Io::constants`] or [`crate::Registry::with_constants`].
///
/// ```
/// epigraph_core::constants! {
///     /// Bit of `meta`: the slot holds a point.
///     pub const LIVE: u32 = 1 << 16;
///     /// Metres beyond which a coordinate counts as infinite.
///     const LIMIT: f32 = 1e20;
/// }
/// assert_eq!((CONSTANTS.len(), CONSTANTS[0].name(), LIVE), (2, "LIVE", 65536));
/// ```
#[macro_export]
macro_rules! constants {
    ($($(#[$meta:meta])* $vis:vis const $name:ident: $ty:ident = $value:expr;)*) => {
        $($(#[$meta])* $vis const $name: $ty = $value;)*

        /// The constants that the shader gets too.
        pub(crate) const CONSTANTS: &[$crate::Constant] =
            &[$($crate::Constant::$ty(stringify!($name), $name)),*];
    };
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_as_wgsl() {
        let mut text = String::new();
        for constant in [
            Constant::u32("ALL", u32::MAX),
            Constant::i32("LEAST", i32::MIN),
            Constant::f32("LIMIT", 1e20),
            Constant::f32("TENTH", 0.1),
        ] {
            constant.declare(&mut text);
        }
        let expected = "const ALL: u32 = 4294967295u;\nconst LEAST: i32 = -2147483648;\n\
                        const LIMIT: f32 = 1e20f;\nconst TENTH: f32 = 0.1f;\n";
        assert_eq!(text, expected);
    }

    #[test]
    fn choices_are_named_by_parameter_and_variant() {
        let param = ParamSpec {
            name: "depth_test".into(),
            doc: String::new(),
            unit: String::new(),
            kind: ParamKind::Choice(vec!["Off".into(), "SeedExact".into(), "Oct16".into()]),
            range: None,
            default: "Off".into(),
        };
        let constants = Constant::of_choice(&param);
        let expected = ["DEPTH_TEST_OFF", "DEPTH_TEST_SEED_EXACT", "DEPTH_TEST_OCT16"];
        assert_eq!(constants.iter().map(Constant::name).collect::<Vec<_>>(), expected);
        assert_eq!(constants.iter().map(|constant| constant.bits).collect::<Vec<_>>(), [0, 1, 2]);
        assert_eq!(Constant::of_choice(&ParamSpec { kind: ParamKind::U32, ..param }), []);
    }
}
