//! Nodes that are repeated several times in a row.
//!
//! ```ron
//! "filter": (
//!     kind: "wgsl",
//!     repeat: (times: 5, through: { "color": "filtered" }, count: "level"),
//!     inputs: { "color": "interpolate.color", "depth": "view.depth" },
//!     params: (shader: "atrous.wgsl"),
//! ),
//! ```
//!
//! These are five nodes, `filter/0` to `filter/4`. The first one's `color` is connected as written, that of each further
//! one to the `filtered` of the one before; `through: "color"` is short for an input and an output of the same name.
//! All other inputs and parameters are the same for all, except `level`, which is 0, 1, 2, 3, 4. To other nodes,
//! `filter.filtered` is the last one's. `set: { "2": (sigma: 0.3) }` sets a parameter of one of them. `times` may be a
//! parameter of the graph, and a part can be repeated as well as a stage.

use super::{
    ParamDef,
    parse::{Reader, Shape, is_identifier},
};
use crate::error::{GraphError, Span, Spanned};

/// Most copies of a node.
pub const MAX_REPEAT: u32 = 256;

/// How a node is repeated.
#[derive(Clone, Debug, PartialEq)]
pub struct RepeatDef {
    /// The number of copies: the text of a whole number from 1 to [`MAX_REPEAT`], or a parameter of the graph.
    pub times: Spanned<String>,
    /// Each input that takes an output of the copy before, and that output.
    pub through: Vec<(Spanned<String>, Spanned<String>)>,
    /// The parameter that is the copy's number, from 0.
    pub count: Option<Spanned<String>>,
}

impl RepeatDef {
    /// The output of the copy before that this input takes.
    pub(super) fn output_to(&self, input: &str) -> Option<&Spanned<String>> {
        self.through.iter().find(|(known, _)| known.value == input).map(|(_, output)| output)
    }

    /// The parameter that counts, for one copy.
    pub(super) fn counted(&self, copy: u32) -> Option<ParamDef> {
        let name = self.count.clone()?;
        let value = Spanned { value: copy.to_string(), span: name.span };
        Some(ParamDef { name, value })
    }
}

/// The number of copies in words, for messages.
pub(super) fn times_expected() -> String {
    format!("a whole number from 1 to {MAX_REPEAT}, or Param(\"NAME\")")
}

/// The number of copies, from text that is not a parameter of the graph.
pub(super) fn times(text: &str) -> Option<u32> {
    ron::from_str(text).ok().filter(|times| (1..=MAX_REPEAT).contains(times))
}

/// What to report of the number of a copy that there is not.
pub(super) fn no_copy(copy: u32, times: u32) -> GraphError {
    let last = times.saturating_sub(1);
    GraphError::Invalid(format!("there is no copy {copy} of {times}; they are numbered 0 to {last}"))
}

/// Splits what follows a repeated node's name in an address into the number of a copy, if there is one, and the rest:
/// `2/blur` is the node `blur` in copy 2 of a part.
pub(super) fn copy_of(rest: &str) -> (Option<u32>, Option<&str>) {
    let (head, tail) = rest.split_once('/').map_or((rest, None), |(head, tail)| (head, Some(tail)));
    match head.parse::<u32>() {
        // Only as written by this program: not `+2` or `02`.
        Ok(copy) if copy.to_string() == head => (Some(copy), tail),
        _ => (None, Some(rest)),
    }
}

const REPEAT: Shape =
    Shape::record("", "field", "(times: N, through: { \"INPUT\": \"OUTPUT\" }, count: \"PARAMETER\")");
const THROUGH: Shape = Shape::map("input", "{ \"INPUT\": \"OUTPUT\" }");
const FIELDS: [&str; 3] = ["times", "through", "count"];

impl Reader<'_> {
    /// A node's `repeat`.
    pub(super) fn repeat(&mut self, span: Span) -> Option<RepeatDef> {
        let (mut number, mut through, mut count) = (None, None, None);
        for (field, value) in self.entries(span, &REPEAT)? {
            match field.value.as_str() {
                "times" => number = Some(value),
                "through" => through = Some(self.through(value)),
                "count" => count = self.param_name(value),
                _ => self.unknown_field(field, &FIELDS),
            }
        }
        for (missing, what) in [
            (number.is_none(), "`times` is missing; write times: N"),
            (through.is_none(), "`through` is missing; write through: { \"INPUT\": \"OUTPUT\" }"),
        ] {
            if missing {
                self.report(GraphError::Syntax(what.into()), span);
            }
        }
        let number = self.text_at(number?);
        if super::param::handed(&number.value).is_none() && times(&number.value).is_none() {
            self.expected(&times_expected(), number.span);
            return None;
        }
        Some(RepeatDef { times: number, through: through?, count })
    }

    fn through(&mut self, span: Span) -> Vec<(Spanned<String>, Spanned<String>)> {
        if let Ok(port) = ron::from_str::<String>(self.slice(span)) {
            let port = Spanned { value: port, span };
            return vec![(port.clone(), port)];
        }
        let entries = self.entries(span, &THROUGH).unwrap_or_default();
        if entries.is_empty() && self.slice(span).starts_with('{') {
            self.expected("at least one input and output", span);
        }
        let output = |(input, value)| {
            let output = self.scalar(value, "an output port in double quotes")?;
            Some((input, output))
        };
        entries.into_iter().filter_map(output).collect()
    }

    fn param_name(&mut self, span: Span) -> Option<Spanned<String>> {
        let name: Spanned<String> = self.scalar(span, "a parameter in double quotes")?;
        if is_identifier(&name.value) {
            return Some(name);
        }
        self.report(GraphError::Invalid(format!("`{}` cannot name a parameter", name.value)), span);
        None
    }
}
