//! Parameters: one field with one doc line defines the RON syntax, the default, the range, the text of `epigraph
//! stages`, the editor's widget and the shader's uniform.

use serde::de::DeserializeOwned;

use crate::{error::GraphError, port::Scalar};

/// What kind of value a parameter takes.
#[derive(Clone, Debug, PartialEq)]
pub enum ParamKind {
    /// `true` or `false`; 1 or 0 in the uniform.
    Bool,
    /// A whole number.
    U32,
    /// A signed whole number.
    I32,
    /// A number.
    F32,
    /// A number, or `Auto`, for which 0 is in the uniform.
    F32OrAuto,
    /// One of these names; its index is in the uniform.
    Choice(Vec<String>),
    /// A quoted string, such as a path. It is not part of the uniform.
    Text,
}

impl ParamKind {
    /// The scalar type in the uniform; `None` for kinds that are not part of the uniform.
    pub fn scalar(&self) -> Option<Scalar> {
        match self {
            Self::F32 | Self::F32OrAuto => Some(Scalar::F32),
            Self::I32 => Some(Scalar::I32),
            Self::Bool | Self::U32 | Self::Choice(_) => Some(Scalar::U32),
            Self::Text => None,
        }
    }

    /// In words, for messages: "a number", "one of A, B".
    pub fn words(&self) -> String {
        match self {
            Self::Bool => "true or false".into(),
            Self::U32 => "a whole number".into(),
            Self::I32 => "a whole number, negative allowed".into(),
            Self::F32 => "a number".into(),
            Self::F32OrAuto => "Auto or a number".into(),
            Self::Choice(names) => format!("one of {}", names.join(", ")),
            Self::Text => "a text in quotes".into(),
        }
    }
}

/// Everything about one parameter.
#[derive(Clone, Debug, PartialEq)]
pub struct ParamSpec {
    /// Name in the graph file and in the shader's `Params` struct.
    pub name: String,
    /// One sentence.
    pub doc: String,
    /// Unit; may be empty.
    pub unit: String,
    /// The kind of value.
    pub kind: ParamKind,
    /// Lowest and highest value, both inclusive; `None` for names and booleans.
    pub range: Option<(f64, f64)>,
    /// The default, as RON.
    pub default: String,
}

impl ParamSpec {
    /// Checks a value's RON text: whether it is of this kind and in this range.
    pub fn check(&self, text: &str) -> Result<(), ParamError> {
        match &self.kind {
            ParamKind::Bool => parse_value::<bool>(text, None).map(drop),
            ParamKind::U32 => parse_value::<u32>(text, self.range).map(drop),
            ParamKind::I32 => parse_value::<i32>(text, self.range).map(drop),
            ParamKind::F32 => parse_value::<f32>(text, self.range).map(drop),
            ParamKind::F32OrAuto => parse_value::<Option<f32>>(text, self.range).map(drop),
            ParamKind::Text => parse_ron::<String>(text).map(drop),
            ParamKind::Choice(names) if names.iter().any(|name| name == text) => Ok(()),
            ParamKind::Choice(_) => {
                Err(ParamError { at: (1, 1), cause: format!("there is no `{text}`"), out_of_range: false })
            }
        }
    }

    /// What to report of a value's text that was refused.
    pub(crate) fn refusal(&self, text: &str, error: ParamError) -> GraphError {
        let name = self.name.clone();
        match self.range.filter(|_| error.out_of_range) {
            Some((low, high)) => GraphError::Range { name, found: text.to_owned(), low, high },
            None => GraphError::Value { name, expected: self.expected(), cause: error.cause },
        }
    }

    /// The values that it can have, in words.
    fn expected(&self) -> String {
        let words = self.kind.words();
        let range = match (self.range, &self.kind) {
            (Some(range), _) => Some(range),
            (None, ParamKind::U32) => Some((0.0, u32::MAX.into())),
            (None, ParamKind::I32) => Some((i32::MIN.into(), i32::MAX.into())),
            (None, _) => None,
        };
        range.map_or(words.clone(), |(low, high)| format!("{words}, {low} to {high}"))
    }
}

/// A type that can be a parameter.
pub trait ParamValue: DeserializeOwned + PartialEq + Clone {
    /// The kind of value.
    fn kind() -> ParamKind;
    /// The value of RON text. The error says what is there; what was expected depends on the parameter.
    fn parse(ron: &str) -> Result<Self, ParamError> {
        parse_ron(ron)
    }
    /// Its 32 bits in the uniform.
    fn bits(&self) -> u32;
    /// As a number, if its kind can have a range.
    fn number(&self) -> Option<f64>;
    /// As RON text.
    fn ron(&self) -> String;
}

macro_rules! number_params {
    ($($ty:ty, $kind:ident, |$v:ident| $bits:expr, $number:path;)*) => {$(
        impl ParamValue for $ty {
            fn kind() -> ParamKind {
                ParamKind::$kind
            }
            fn bits(&self) -> u32 {
                let $v = *self;
                $bits
            }
            fn number(&self) -> Option<f64> {
                Some($number(*self))
            }
            fn ron(&self) -> String {
                format!("{self:?}")
            }
        }
    )*};
}

number_params! {
    u32, U32, |v| v, f64::from;
    i32, I32, |v| v as u32, f64::from;
    f32, F32, |v| v.to_bits(), decimal;
}

/// The f64 that is written as `value` is: 0.01 for 0.01f32, which itself is a little less. Ranges and shares are written
/// in decimals, and a value at the end of its range is within it.
pub(crate) fn decimal(value: f32) -> f64 {
    format!("{value:?}").parse().unwrap_or(f64::NAN)
}

/// What stands for `None` in the text of a number that a stage can find by itself.
pub const AUTO: &str = "Auto";

/// A number, or `None`, written `Auto`: the stage finds it.
impl ParamValue for Option<f32> {
    fn kind() -> ParamKind {
        ParamKind::F32OrAuto
    }
    fn parse(ron: &str) -> Result<Self, ParamError> {
        if ron.trim() == AUTO { Ok(None) } else { f32::parse(ron).map(Some) }
    }
    fn bits(&self) -> u32 {
        self.map_or(0, f32::to_bits)
    }
    fn number(&self) -> Option<f64> {
        self.map(decimal)
    }
    fn ron(&self) -> String {
        self.map_or(AUTO.into(), |number| number.ron())
    }
}

impl ParamValue for bool {
    fn kind() -> ParamKind {
        ParamKind::Bool
    }
    fn bits(&self) -> u32 {
        u32::from(*self)
    }
    fn number(&self) -> Option<f64> {
        None
    }
    fn ron(&self) -> String {
        self.to_string()
    }
}

/// Defines an enum that can be a parameter: `choice! { /// Doc. pub enum Rule { /// Doc. Relative, /// Doc. Absolute } }`.
/// The first variant has index 0 in the uniform.
///
/// The package must depend on `epigraph-core` under this name: the derived code for the enum looks for serde there.
#[macro_export]
macro_rules! choice {
    ($(#[$meta:meta])* $vis:vis enum $name:ident { $($(#[$variant_meta:meta])* $variant:ident),* $(,)? }) => {
        $(#[$meta])*
        #[derive(Clone, Copy, Debug, PartialEq, Eq, $crate::serde::Serialize, $crate::serde::Deserialize)]
        #[serde(crate = "::epigraph_core::serde")]
        $vis enum $name { $($(#[$variant_meta])* $variant),* }

        impl $crate::ParamValue for $name {
            fn kind() -> $crate::ParamKind {
                $crate::ParamKind::Choice(vec![$(stringify!($variant).to_owned()),*])
            }
            fn bits(&self) -> u32 {
                *self as u32
            }
            fn number(&self) -> Option<f64> {
                None
            }
            fn ron(&self) -> String {
                format!("{self:?}")
            }
        }
    };
}

/// An error within one parameter's text: its place and the parser's message.
#[derive(Clone, Debug, PartialEq)]
pub struct ParamError {
    /// Line and column (from 1) within the value's text.
    pub at: (usize, usize),
    /// What is there instead of a value.
    pub cause: String,
    /// Whether the value parsed but lies outside its range.
    pub out_of_range: bool,
}

/// The parameters of a stage: a struct defined with [`crate::params!`].
pub trait Params: Default + Clone + PartialEq + Send + Sync + 'static {
    /// All parameters in the order of the uniform.
    fn specs() -> Vec<ParamSpec>;
    /// Sets parameter `index` from RON text.
    fn set(&mut self, index: usize, ron: &str) -> Result<(), ParamError>;
    /// The uniform's words (32 bits each), in order.
    fn words(&self) -> Vec<u32>;
    /// The current values as RON text, in order.
    fn values(&self) -> Vec<String>;
}

/// A stage without parameters.
impl Params for () {
    fn specs() -> Vec<ParamSpec> {
        Vec::new()
    }
    fn set(&mut self, _: usize, _: &str) -> Result<(), ParamError> {
        Ok(())
    }
    fn words(&self) -> Vec<u32> {
        Vec::new()
    }
    fn values(&self) -> Vec<String> {
        Vec::new()
    }
}

/// Parses RON text. The error says what is there; what was expected depends on the parameter.
pub(crate) fn parse_ron<T: DeserializeOwned>(text: &str) -> Result<T, ParamError> {
    ron::from_str(text).map_err(|error| ParamError {
        at: (error.span.start.line, error.span.start.col),
        cause: match error.code {
            ron::Error::NoSuchEnumVariant { found, .. } => format!("there is no `{found}`"),
            _ => format!("found `{text}`"),
        },
        out_of_range: false,
    })
}

/// Parses one value and checks its range; used by [`crate::params!`].
pub fn parse_value<T: ParamValue>(text: &str, range: Option<(f64, f64)>) -> Result<T, ParamError> {
    let value = T::parse(text)?;
    // No range contains NaN, so `contains` rejects it too.
    if let (Some((low, high)), Some(number)) = (range, value.number())
        && !(low..=high).contains(&number)
    {
        return Err(ParamError { at: (1, 1), cause: "outside its range".into(), out_of_range: true });
    }
    Ok(value)
}

/// Defines a stage's parameters:
///
/// ```
/// epigraph_core::params! {
///     /// How far behind its neighbours a point may lie.
///     pub struct CullParams {
///         /// Relative distance behind the mean depth at which a point is dropped.
///         threshold: f32 = 0.05, in 0.0..=10.0, unit "";
///         /// Also look at the diagonal neighbours.
///         diagonal: bool = true;
///     }
/// }
/// ```
#[macro_export]
macro_rules! params {
    ($(#[$meta:meta])* $vis:vis struct $name:ident {
        $($(#[doc = $doc:literal])+ $field:ident: $ty:ty = $default:expr
            $(, in $low:literal ..= $high:literal)? $(, unit $unit:literal)?;)*
    }) => {
        $(#[$meta])*
        #[derive(Clone, Debug, PartialEq)]
        $vis struct $name { $($(#[doc = $doc])+ pub $field: $ty),* }

        impl Default for $name {
            fn default() -> Self {
                Self { $($field: $default),* }
            }
        }

        impl $crate::Params for $name {
            fn specs() -> Vec<$crate::ParamSpec> {
                let default = Self::default();
                vec![$($crate::ParamSpec {
                    name: stringify!($field).to_owned(),
                    doc: [$($doc),+].map(str::trim).join(" "),
                    unit: String::new() $(+ $unit)?,
                    kind: <$ty as $crate::ParamValue>::kind(),
                    range: None $(.or(Some(($low as f64, $high as f64))))?,
                    default: $crate::ParamValue::ron(&default.$field),
                }),*]
            }
            fn set(&mut self, index: usize, ron: &str) -> Result<(), $crate::ParamError> {
                let mut next = 0;
                $(
                    if index == next {
                        let range: Option<(f64, f64)> = None $(.or(Some(($low as f64, $high as f64))))?;
                        self.$field = $crate::parse_value(ron, range)?;
                    }
                    next += 1;
                )*
                let _ = next;
                Ok(())
            }
            fn words(&self) -> Vec<u32> {
                vec![$($crate::ParamValue::bits(&self.$field)),*]
            }
            fn values(&self) -> Vec<String> {
                vec![$($crate::ParamValue::ron(&self.$field)),*]
            }
        }
    };
}

#[cfg(test)]
mod tests {
    use super::*;

    fn spec(kind: ParamKind, range: Option<(f64, f64)>) -> ParamSpec {
        let [name, doc, unit, default] = ["p", "", "", ""].map(str::to_owned);
        ParamSpec { name, doc, unit, kind, range, default }
    }

    #[test]
    fn both_ends_of_a_range_are_within_it() {
        // 0.01 and 0.7 as f32 are a little less than these numbers, 0.1 is a little more.
        for (low, high) in [(0.01, 16.0), (0.1, 0.7), (1e-6, 3e5), (-0.7, -0.1)] {
            let spec = spec(ParamKind::F32, Some((low, high)));
            for end in [low, high] {
                assert_eq!(spec.check(&format!("{end:?}")), Ok(()), "{end}");
                assert_eq!(parse_value::<f32>(&format!("{end:?}"), spec.range), Ok(end as f32));
            }
            for beyond in [low - 1e-6 * low.abs(), high + 1e-6 * high.abs(), f64::NAN, f64::INFINITY] {
                let text = if beyond.is_finite() { format!("{beyond:.12}") } else { format!("{beyond}") };
                assert!(spec.check(&text).is_err_and(|error| error.out_of_range), "{text}");
            }
        }
    }

    #[test]
    fn auto_stands_for_no_number() {
        for (text, value) in [("Auto", None), (" Auto ", None), ("1.5", Some(1.5)), ("-2", Some(-2.0))] {
            assert_eq!(parse_value::<Option<f32>>(text, Some((-24.0, 24.0))), Ok(value), "{text}");
            let again = parse_value::<Option<f32>>(&value.ron(), None);
            assert_eq!(again, Ok(value), "{text}");
        }
        assert_eq!([None, Some(0.5)].map(|value: Option<f32>| value.bits()), [0, 0.5f32.to_bits()]);
        for text in ["auto", "Automatic", "None", "Some(1.0)", "\"Auto\"", "NaN", "inf", ""] {
            assert!(parse_value::<Option<f32>>(text, Some((-24.0, 24.0))).is_err(), "{text}");
        }
    }

    #[test]
    fn an_unknown_choice_is_told_where_the_value_begins() {
        let choice = ParamKind::Choice(vec!["Up".into(), "Down".into()]);
        assert_eq!(spec(choice, None).check("Left").unwrap_err().at, (1, 1));
    }

    #[test]
    fn a_refusal_says_what_is_there_and_what_was_expected() {
        let refused = |kind, range, text: &str| {
            let spec = spec(kind, range);
            spec.refusal(text, spec.check(text).unwrap_err()).to_string()
        };
        let range = Some((0.0, 10.0));
        for (kind, range, text, message) in [
            (ParamKind::F32, range, "abc", "parameter `p`: found `abc`; expected a number, 0 to 10"),
            (ParamKind::F32, range, "11.5", "parameter `p` is 11.5, outside 0 to 10"),
            (ParamKind::U32, range, "1.5", "parameter `p`: found `1.5`; expected a whole number, 0 to 10"),
            (
                ParamKind::U32,
                None,
                "-3",
                "parameter `p`: found `-3`; expected a whole number, 0 to 4294967295",
            ),
            (
                ParamKind::F32OrAuto,
                range,
                "auto",
                "parameter `p`: found `auto`; expected Auto or a number, 0 to 10",
            ),
            (ParamKind::F32OrAuto, range, "11.5", "parameter `p` is 11.5, outside 0 to 10"),
            (ParamKind::Bool, None, "3", "parameter `p`: found `3`; expected true or false"),
            (ParamKind::Text, None, "a", "parameter `p`: found `a`; expected a text in quotes"),
            (
                ParamKind::Choice(vec!["A".into(), "B".into()]),
                None,
                "C",
                "parameter `p`: there is no `C`; expected one of A, B",
            ),
        ] {
            assert_eq!(refused(kind, range, text), message);
        }
    }
}
