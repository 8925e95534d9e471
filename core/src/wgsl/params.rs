//! Parameters: the members of the struct of `params`.

use super::{
    Wrong,
    grammar::{self, Declared, Name, ParamClause},
};
use crate::{
    constant::Constant,
    error::{GraphError, Spanned},
    params::{ParamError, ParamKind, ParamSpec, ParamValue, parse_ron, parse_value},
    port::Scalar,
};

/// A member of the struct of `params`, with the first word of its type.
pub(super) struct Member {
    pub name: Name,
    pub ty: String,
    pub declared: Declared<ParamClause>,
}

/// The parameters, each with its default as a uniform word.
pub(super) fn parameters(members: &[Member], wrong: &mut Wrong) -> Vec<(ParamSpec, u32)> {
    members.iter().filter_map(|member| parameter(member, wrong)).collect()
}

fn parameter(member: &Member, wrong: &mut Wrong) -> Option<(ParamSpec, u32)> {
    let Member { name, ty, declared } = member;
    let (scalar, zero) = match ty.as_str() {
        "f32" => (Scalar::F32, 0f32.ron()),
        "u32" => (Scalar::U32, 0u32.ron()),
        "i32" => (Scalar::I32, 0i32.ron()),
        _ => {
            wrong
                .at(name.span, format!("`{}` cannot be a parameter; those are f32, u32 and i32", name.value));
            return None;
        }
    };
    if !grammar::is_name(&name.value) {
        wrong.at(name.span, format!("`{}` is no name; a parameter is written `NAME: f32`", name.value));
        return None;
    }
    if name.value == super::SHADER {
        wrong.at(name.span, "this name is reserved for the shader file; choose another");
        return None;
    }
    if let [_, second, ..] = &declared.clauses[..] {
        wrong.at(second.span, format!("`{}` has its default already; remove one", name.value));
        return None;
    }
    let mut spec = ParamSpec {
        name: name.value.clone(),
        doc: declared.prose.clone(),
        unit: String::new(),
        kind: kind_of(scalar),
        range: None,
        default: zero,
    };
    let Some(Spanned { value: clause, span }) = declared.clauses.first() else { return Some((spec, 0)) };
    let default = match clause {
        ParamClause::Value { default, range, unit } => {
            (spec.range, spec.unit) = (*range, unit.clone());
            if let Some((low, high)) = range.filter(|(low, high)| low > high) {
                wrong.at(*span, format!("the range {low}..{high} is empty; write the lower value first"));
                return None;
            }
            if ["true", "false"].contains(&default.value.as_str()) {
                if scalar != Scalar::U32 || range.is_some() {
                    let name = &name.value;
                    wrong.at(
                        *span,
                        format!(
                            "only a u32 without range is true or false; write `{name}: u32` and `= {}`",
                            default.value
                        ),
                    );
                    return None;
                }
                spec.kind = ParamKind::Bool;
            }
            default
        }
        ParamClause::Choice { default, choices } => {
            if scalar != Scalar::U32 {
                wrong.at(*span, format!("only a u32 is set by names; write `{}: u32`", name.value));
                return None;
            }
            spec.kind = ParamKind::Choice(choices.iter().map(|choice| choice.value.clone()).collect());
            let constants = Constant::of_choice(&spec);
            let names: Vec<&str> = constants.iter().map(Constant::name).collect();
            if let Some(index) = (1..names.len()).find(|&index| names[..index].contains(&names[index])) {
                let Name { value: choice, span } = &choices[index];
                let constant = names[index];
                wrong.at(
                    *span,
                    format!("`{choice}` is `{constant}` in WGSL, as is another choice; rename it"),
                );
                return None;
            }
            default
        }
    };
    spec.default = default.value.clone();
    match word(&spec, &spec.default) {
        Ok(word) => Some((spec, word)),
        Err(error) => {
            let message = match &spec.kind {
                ParamKind::Choice(names) => GraphError::unknown("choice", &spec.default, names).to_string(),
                kind if error.out_of_range => {
                    format!("the default {}: outside its range; expected {}", spec.default, kind.words())
                }
                kind => format!("the default: {}; expected {}", error.cause, kind.words()),
            };
            wrong.at(default.span, message);
            None
        }
    }
}

fn kind_of(scalar: Scalar) -> ParamKind {
    match scalar {
        Scalar::F32 => ParamKind::F32,
        Scalar::U32 => ParamKind::U32,
        Scalar::I32 => ParamKind::I32,
    }
}

/// A parameter's word in the uniform.
pub(super) fn word(spec: &ParamSpec, text: &str) -> Result<u32, ParamError> {
    match &spec.kind {
        ParamKind::I32 => parse_value::<i32>(text, spec.range).map(|value| value.bits()),
        ParamKind::F32 => parse_value::<f32>(text, spec.range).map(|value| value.bits()),
        ParamKind::F32OrAuto => parse_value::<Option<f32>>(text, spec.range).map(|value| value.bits()),
        ParamKind::Bool => parse_value::<bool>(text, None).map(|value| value.bits()),
        ParamKind::Choice(names) => {
            let Variant(found) = parse_ron(text)?;
            let index = (0..).zip(names).find(|(_, name)| **name == found).map(|(index, _)| index);
            index.ok_or(ParamError {
                at: (1, 1),
                cause: format!("there is no `{found}`"),
                out_of_range: false,
            })
        }
        ParamKind::U32 | ParamKind::Text => parse_value::<u32>(text, spec.range).map(|value| value.bits()),
    }
}

/// The name for `#ifdef` that a parameter's value defines: that of its choice, or its own if it is true.
pub(super) fn define(spec: &ParamSpec, word: u32) -> Option<String> {
    let mut names = defines(spec).into_iter();
    match &spec.kind {
        ParamKind::Bool => names.next().filter(|_| word != 0),
        _ => names.nth(word as usize),
    }
}

/// All names for `#ifdef` that values of a parameter define.
pub(super) fn defines(spec: &ParamSpec) -> Vec<String> {
    match &spec.kind {
        ParamKind::Bool => vec![spec.name.to_uppercase()],
        _ => Constant::of_choice(spec).iter().map(|constant| constant.name().to_owned()).collect(),
    }
}

/// A name without quotes in RON, as of an enum's variant.
struct Variant(String);

impl<'de> serde::Deserialize<'de> for Variant {
    fn deserialize<D: serde::Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct Visitor;
        impl serde::de::Visitor<'_> for Visitor {
            type Value = Variant;
            fn expecting(&self, f: &mut std::fmt::Formatter) -> std::fmt::Result {
                f.write_str("a name without quotes")
            }
            fn visit_str<E>(self, name: &str) -> Result<Variant, E> {
                Ok(Variant(name.to_owned()))
            }
        }
        deserializer.deserialize_identifier(Visitor)
    }
}
