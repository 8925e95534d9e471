//! Parameters of a graph, and how they reach its nodes.
//!
//! ```ron
//! params: { "sigma": (default: 0.5, doc: "Tolerance of colour.", range: (0.01, 10.0)) },
//! nodes: { "filter": (kind: "wgsl", params: (shader: "atrous.wgsl", sigma: Param("sigma")), ...) },
//! ```
//!
//! A node takes the value by `Param("sigma")`, as many nodes as wanted. The value is the default, or what the including
//! node sets beside its `file`: `params: (file: "atrous.ron", sigma: 0.3)`. The kind of value follows from the default
//! and the range: any number if one of them is written with a decimal point, else a whole number, which may be negative
//! if one of them is; `true` or `false`; a text in double quotes; or one of the names in `choices`.

use serde::Deserialize;

use super::{
    GraphFile, NodeDef,
    parse::{Reader, Shape, is_identifier},
    parts::FILE_PARAM,
    scan,
};
use crate::{
    error::{GraphError, Span, Spanned},
    params::{ParamKind, ParamSpec},
};

/// A parameter of a graph.
#[derive(Clone, Debug, PartialEq)]
pub struct GraphParam {
    /// Its name, unique in the file.
    pub name: Spanned<String>,
    /// The default's RON text.
    pub default: Spanned<String>,
    /// Name, documentation, kind of value, range and default, as of a stage's parameter.
    pub spec: ParamSpec,
}

/// A parameter of a graph or of one of its parts, with its value.
#[derive(Clone, Debug, PartialEq)]
pub struct GraphValue {
    /// The address of the part; empty for the graph itself.
    pub part: String,
    /// What the parameter is.
    pub spec: ParamSpec,
    /// The RON text of its value.
    pub value: String,
}

/// How a node takes a parameter of its graph: `Param("NAME")`.
#[derive(Deserialize)]
enum Handed {
    Param(String),
}

/// How its text begins.
const HANDED: &str = "Param";

/// The parameter of the graph that a value hands on: `sigma` for `Param("sigma")`. `None` for any other value.
pub fn handed(value: &str) -> Option<String> {
    let Handed::Param(name) = ron::from_str(value).ok()?;
    Some(name)
}

/// The value that hands on a parameter of the graph.
pub fn handing(name: &str) -> String {
    format!("{HANDED}({name:?})")
}

impl GraphFile {
    /// The parameter of the graph with this name.
    pub fn param(&self, name: &str) -> Option<&GraphParam> {
        self.params.iter().find(|param| param.name.value == name)
    }

    /// The parameter of the graph with this name, to be set. `address` is that of the part, empty for the whole graph.
    ///
    /// # Errors
    /// What to report if there is none, or if no node takes it.
    pub(super) fn settable(&self, name: &str, address: &str) -> Result<&GraphParam, GraphError> {
        let takes = |node: &NodeDef| node.values().any(|value| handed(&value.value).as_deref() == Some(name));
        let text = match self.param(name) {
            Some(param) if self.nodes.iter().any(takes) => return Ok(param),
            Some(_) => format!("no node takes the parameter `{name}`; hand it on by {}", handing(name)),
            None if !self.params.is_empty() => {
                let known = self.params.iter().map(|param| &param.name.value);
                return Err(GraphError::unknown("parameter of the graph", name, known));
            }
            None => {
                let full = |node: String| if address.is_empty() { node } else { format!("{address}/{node}") };
                let nodes = self.addresses().into_iter().map(full).collect::<Vec<_>>().join(", ");
                format!("{} has no parameter `{name}`, nor any other; its nodes are: {nodes}", self.path)
            }
        };
        Err(GraphError::Invalid(text))
    }
}

impl NodeDef {
    /// Every value that may hand on a parameter of the graph.
    pub(super) fn values(&self) -> impl Iterator<Item = &Spanned<String>> {
        let set = self.set.iter().flat_map(|(_, params)| params);
        let params = self.params.iter().chain(set).map(|param| &param.value);
        params.chain(self.repeat.iter().map(|repeat| &repeat.times))
    }

    /// The same, to be changed.
    pub(super) fn values_mut(&mut self) -> impl Iterator<Item = &mut Spanned<String>> {
        let set = self.set.iter_mut().flat_map(|(_, params)| params);
        let params = self.params.iter_mut().chain(set).map(|param| &mut param.value);
        params.chain(self.repeat.iter_mut().map(|repeat| &mut repeat.times))
    }
}

const PARAMS: Shape = Shape::map("parameter", "{ \"NAME\": (default: VALUE, ...), ... }");
const PARAM: Shape =
    Shape::record("", "field", "(default: VALUE, doc: \"...\", range: (LOW, HIGH), unit: \"...\")");
const FIELDS: [&str; 5] = ["default", "doc", "range", "unit", "choices"];

impl Reader<'_> {
    /// The graph's parameters.
    pub(super) fn graph_params(&mut self, span: Span) -> Vec<GraphParam> {
        let entries = self.entries(span, &PARAMS).unwrap_or_default();
        entries.into_iter().filter_map(|(name, value)| self.graph_param(name, value)).collect()
    }

    fn graph_param(&mut self, name: Spanned<String>, span: Span) -> Option<GraphParam> {
        if !is_identifier(&name.value) || name.value == FILE_PARAM {
            let text = format!("`{}` cannot name a parameter of a graph", name.value);
            self.report(GraphError::Invalid(text), name.span);
        }
        let (mut default, mut range, mut choices) = (None, None, None);
        let (mut doc, mut unit) = (String::new(), String::new());
        let mut whole = true;
        for (field, value) in self.entries(span, &PARAM)? {
            match field.value.as_str() {
                "default" => default = Some(value),
                "doc" => doc = self.words(value),
                "unit" => unit = self.words(value),
                "range" => {
                    range = self.range(value);
                    whole = ron::from_str::<(i64, i64)>(self.slice(value)).is_ok();
                }
                "choices" => choices = self.choices(value),
                _ => self.unknown_field(field, &FIELDS),
            }
        }
        let Some(default) = default else {
            let text = "`default` is missing; write default: VALUE";
            self.report(GraphError::Syntax(text.into()), name.span);
            return None;
        };
        let default = self.text_at(default);
        let Some(kind) = kind(&default.value, range, whole, choices) else {
            let expected =
                "a number, true or false, a text in double quotes, or one of the names in `choices`";
            self.expected(expected, default.span);
            return None;
        };
        let ranged = matches!(kind, ParamKind::F32 | ParamKind::U32 | ParamKind::I32);
        if range.is_some() && !ranged {
            let text = format!("parameter `{}` is {}, which has no range", name.value, kind.words());
            self.report(GraphError::Invalid(text), name.span);
            range = None;
        }
        let spec =
            ParamSpec { name: name.value.clone(), doc, unit, kind, range, default: default.value.clone() };
        if let Err(error) = spec.check(&default.value) {
            self.report(spec.refusal(&default.value, error), default.span);
        }
        Some(GraphParam { name, default, spec })
    }

    fn range(&mut self, span: Span) -> Option<(f64, f64)> {
        let Spanned { value: (low, high), .. } = self.scalar(span, "a range as (LOW, HIGH)")?;
        let ordered = f64::is_finite(low) && f64::is_finite(high) && low <= high;
        if !ordered {
            self.expected("finite numbers, the lower one first", span);
        }
        ordered.then_some((low, high))
    }

    fn choices(&mut self, span: Span) -> Option<Vec<String>> {
        let block = scan::block(self.text, span).filter(|block| self.text[block.open..].starts_with('['));
        let items = block.map(|block| block.items).unwrap_or_default();
        let names = items.iter().filter(|item| item.key.is_none()).map(|item| self.slice(item.value));
        let names: Vec<String> = names.filter(|name| is_identifier(name)).map(str::to_owned).collect();
        if names.is_empty() || names.len() < items.len() {
            self.expected("names as [ONE, OTHER]", span);
            return None;
        }
        Some(names)
    }

    /// Reports a value that begins as a parameter of the graph but names none.
    pub(super) fn check_handing(&mut self, span: Span) {
        let begins = scan::block(self.text, span)
            .and_then(|block| block.name)
            .map_or(self.slice(span) == HANDED, |name| self.slice(name) == HANDED);
        if begins && handed(self.slice(span)).is_none() {
            self.expected("a parameter of the graph as Param(\"NAME\")", span);
        }
    }
}

/// The kind of a parameter with this default; `whole` unless the range is written with decimal points.
fn kind(
    default: &str,
    range: Option<(f64, f64)>,
    whole: bool,
    choices: Option<Vec<String>>,
) -> Option<ParamKind> {
    if let Some(names) = choices {
        return Some(ParamKind::Choice(names));
    }
    if ron::from_str::<bool>(default).is_ok() {
        return Some(ParamKind::Bool);
    }
    if ron::from_str::<String>(default).is_ok() {
        return Some(ParamKind::Text);
    }
    match ron::from_str::<i64>(default) {
        Ok(number) if whole => {
            let negative = number < 0 || range.is_some_and(|(low, _)| low < 0.0);
            Some(if negative { ParamKind::I32 } else { ParamKind::U32 })
        }
        _ => ron::from_str::<f64>(default).is_ok().then_some(ParamKind::F32),
    }
}
