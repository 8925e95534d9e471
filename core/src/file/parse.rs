//! From text to the graph's structure, collecting every problem.

use std::collections::HashSet;

use serde::de::{DeserializeOwned, IgnoredAny};

use super::{
    GraphFile, InputDef, NodeDef, Origin, OutputDef, ParamDef, Source,
    base::ChangeFields,
    scan::{self, Block},
};
use crate::{
    error::{GraphError, MOST_PROBLEMS, Place, Problem, Problems, Span, Spanned},
    side::{Download, Side},
};

/// The version of the format that this program reads and writes.
const VERSION: u32 = 1;

const GRAPH_FIELDS: [&str; 9] =
    ["version", "doc", "base", "params", "nodes", "replace", "rewire", "set", "outputs"];
const NODE_FIELDS: [&str; 8] = ["kind", "repeat", "on", "download", "bypass", "inputs", "params", "set"];

impl GraphFile {
    /// Parses a file's text. `path` is its name for messages.
    ///
    /// # Errors
    /// All problems of the text, in order: either that it is not RON, or every deviation from a graph file. Only the
    /// first hundred are reported, with the number of the rest.
    pub fn parse(path: &str, text: &str) -> Result<Self, Problems> {
        if let Err(error) = ron::from_str::<IgnoredAny>(text) {
            let span = syntax_span(text, &error);
            let problem = Problem::new(GraphError::Syntax(syntax_message(path, text, &error.code, span)));
            return Err(problem.at(Place::of(path, text, span)).into());
        }
        let mut reader = Reader { text, node: None, found: Vec::new() };
        let file = reader.graph(path);
        reader.into_problems(path).into_result()?;
        Ok(file)
    }
}

/// The problem of a part of a file that serde could not read. `error` is about `text` from the byte `from` on.
pub fn ron_problem(path: &str, text: &str, from: usize, error: &ron::error::SpannedError) -> Problem {
    use ron::Error::{NoSuchEnumVariant, NoSuchStructField};
    let Span { start, end } = syntax_span(&text[from..], error);
    let span = Span { start: from + start, end: from + end };
    let problem = match &error.code {
        NoSuchStructField { expected, found, .. } => GraphError::unknown("field", found, *expected),
        NoSuchEnumVariant { expected, found, .. } => GraphError::unknown("name", found, *expected),
        code => GraphError::Syntax(syntax_message(path, text, code, span)),
    };
    Problem::new(problem).at(Place::of(path, text, span))
}

/// ron's message; if a bracket may be missing, also which one is open. The mistake is often there, lines earlier.
fn syntax_message(path: &str, text: &str, code: &ron::Error, span: Span) -> String {
    use ron::Error::*;
    let of_brackets = matches!(
        code,
        ExpectedComma | ExpectedIdentifier | ExpectedStructLikeEnd | ExpectedMapEnd | ExpectedArrayEnd | Eof
    );
    match scan::open_bracket(text, span.start).filter(|_| of_brackets) {
        Some(open) => {
            let place = Place::of(path, text, Span { start: open, end: open });
            let bracket = &text[open..=open];
            format!("{code}; the `{bracket}` at {}:{} is still open here", place.line, place.column)
        }
        None => code.to_string(),
    }
}

/// The place of a syntax error. ron reports its position before and after the step that failed.
fn syntax_span(text: &str, error: &ron::error::SpannedError) -> Span {
    let end = offset(text, &error.span.end);
    // When ron backtracks to try another reading, it may report a start behind the end.
    let start = offset(text, &error.span.start).min(end);
    match error.code {
        // Something missing is missing at the end of that step, and space before the wrong text is not wrong.
        ron::Error::Eof | ron::Error::ExpectedComma => Span { start: end, end },
        ron::Error::InvalidEscape(_) => {
            Span { start: start + text[start..end].rfind('\\').unwrap_or(0), end }
        }
        _ => Span { start: start + scan::trivia(&text[start..end]), end },
    }
}

/// The byte of a line and column, both from 1, the column in characters.
fn offset(text: &str, position: &ron::error::Position) -> usize {
    let line: usize = text.split_inclusive('\n').take(position.line - 1).map(str::len).sum();
    text[line..].char_indices().nth(position.col - 1).map_or(text.len(), |(column, _)| line + column)
}

/// A kind of block: what its items are called, how they are named, and how it is written.
pub(super) struct Shape {
    item: &'static str,
    /// Whether items are named by strings in braces; by identifiers in parentheses otherwise.
    quoted: bool,
    /// Name that may precede the bracket.
    name: &'static str,
    example: &'static str,
}

impl Shape {
    pub(super) const fn record(name: &'static str, item: &'static str, example: &'static str) -> Self {
        Self { item, quoted: false, name, example }
    }

    pub(super) const fn map(item: &'static str, example: &'static str) -> Self {
        Self { item, quoted: true, name: "", example }
    }
}

const GRAPH: Shape = Shape::record("Graph", "field", "Graph(version: 1, nodes: { ... }, outputs: { ... })");
const NODES: Shape = Shape::map("node", "{ \"NODE\": (kind: \"KIND\"), ... }");
const NODE: Shape = Shape::record("", "field", "(kind: \"KIND\", ...)");
const INPUTS: Shape = Shape::map("input", "{ \"PORT\": \"NODE.PORT\", ... }");
const PARAMS: Shape = Shape::record("", "parameter", "(name: value, ...)");
const SET: Shape = Shape::map("node", "{ \"NODE\": (name: value, ...), ... }");
const OUTPUTS: Shape = Shape::map("output", "{ \"NAME\": \"NODE.PORT\", ... }");

/// A named value in a block.
type Entry = (Spanned<String>, Span);

/// Reads the fields of a text that is RON, and collects its problems.
pub(super) struct Reader<'a> {
    pub(super) text: &'a str,
    /// The node being read, to be named in its problems.
    node: Option<String>,
    found: Vec<(Span, Problem)>,
}

impl Reader<'_> {
    pub(super) fn report(&mut self, error: GraphError, span: Span) {
        self.found.push((span, Problem { node: self.node.clone(), ..Problem::new(error) }));
    }

    fn into_problems(mut self, path: &str) -> Problems {
        self.found.sort_by_key(|(span, _)| span.start);
        let more = self.found.len().saturating_sub(MOST_PROBLEMS);
        let told = self.found.into_iter().take(MOST_PROBLEMS);
        let mut problems: Vec<Problem> =
            told.map(|(span, problem)| problem.at(Place::of(path, self.text, span))).collect();
        if more > 0 {
            problems.push(Problem::new(GraphError::Syntax(format!("{more} more problems in {path}"))));
        }
        Problems(problems)
    }

    pub(super) fn slice(&self, span: Span) -> &str {
        &self.text[span.start..span.end]
    }

    /// The value's text, cut short for a message.
    fn excerpt(&self, span: Span) -> String {
        const LONGEST: usize = 40;
        let line = self.slice(span).lines().next().unwrap_or("");
        match line.char_indices().nth(LONGEST) {
            Some((end, _)) => format!("{}...", &line[..end]),
            None => line.to_owned(),
        }
    }

    /// The text at `span` with its place.
    pub(super) fn text_at(&self, span: Span) -> Spanned<String> {
        Spanned { value: self.slice(span).to_owned(), span }
    }

    pub(super) fn expected(&mut self, expected: &str, span: Span) {
        let found = self.excerpt(span);
        self.report(GraphError::Syntax(format!("expected {expected}, found `{found}`")), span);
    }

    /// A text in double quotes; empty, and reported, if the value is none.
    pub(super) fn words(&mut self, span: Span) -> String {
        self.scalar(span, "a text in double quotes").map(|text| text.value).unwrap_or_default()
    }

    /// A value read by ron; reports values of another type.
    pub(super) fn scalar<T: DeserializeOwned>(&mut self, span: Span, expected: &str) -> Option<Spanned<T>> {
        match ron::from_str(self.slice(span)) {
            Ok(value) => Some(Spanned { value, span }),
            Err(_) => {
                self.expected(expected, span);
                None
            }
        }
    }

    /// A value of an enum; reports a name that is not one of its variants, with the most similar one.
    fn variant<T: DeserializeOwned>(
        &mut self,
        span: Span,
        what: &'static str,
        variants: [&str; 2],
        expected: &str,
    ) -> Option<Spanned<T>> {
        let text = self.slice(span);
        let name = text.split('(').next().unwrap_or(text).trim_end();
        if is_identifier(name) && !variants.contains(&name) {
            self.report(GraphError::unknown(what, name, variants), span);
            return None;
        }
        self.scalar(span, expected)
    }

    pub(super) fn source(&mut self, span: Span) -> Option<Spanned<Source>> {
        let text: Spanned<String> = self.scalar(span, "a port as \"NODE.PORT\"")?;
        match text.value.parse() {
            Ok(value) => Some(Spanned { value, span }),
            Err(error) => {
                self.report(error, span);
                None
            }
        }
    }

    /// The block at `span` and the named values in it; reports another type of value, items without a name or with the
    /// wrong kind of name, and duplicate names.
    pub(super) fn entries(&mut self, span: Span, shape: &Shape) -> Option<Vec<Entry>> {
        let bracket = if shape.quoted { '{' } else { '(' };
        let is_named = |name: Span| self.slice(name) == shape.name;
        let block = scan::block(self.text, span)
            .filter(|block| self.text[block.open..].starts_with(bracket) && block.name.is_none_or(is_named));
        let Some(Block { items, .. }) = block else {
            self.expected(shape.example, span);
            return None;
        };
        let mut names = HashSet::new();
        let mut entries = Vec::new();
        for item in items {
            let Some(key) = item.key else {
                self.expected(shape.example, item.value);
                continue;
            };
            let name = if shape.quoted {
                let Some(name) = self.scalar(key, "a name in double quotes") else { continue };
                name
            } else {
                // ron accepts only identifiers here; `r#` before one is not part of the name.
                let name = self.slice(key);
                Spanned { value: name.strip_prefix("r#").unwrap_or(name).to_owned(), span: key }
            };
            if names.insert(name.value.clone()) {
                entries.push((name, item.value));
            } else {
                self.report(GraphError::Duplicate { what: shape.item, name: name.value }, key);
            }
        }
        Some(entries)
    }

    pub(super) fn unknown_field(&mut self, name: Spanned<String>, known: &[&str]) {
        self.report(GraphError::unknown("field", &name.value, known), name.span);
    }

    fn graph(&mut self, path: &str) -> GraphFile {
        let (mut version, mut doc, mut nodes, mut outputs) = (None, String::new(), None, None);
        let (mut params, mut changes) = (Vec::new(), ChangeFields::default());
        let root = scan::root(self.text).unwrap_or_default();
        if let Some(entries) = self.entries(root, &GRAPH) {
            for (name, value) in entries {
                match name.value.as_str() {
                    "version" => version = Some(self.version(value)),
                    "doc" => doc = self.words(value),
                    "params" => params = self.graph_params(value),
                    "nodes" => nodes = Some(self.nodes(value, &NODES)),
                    "outputs" => outputs = Some(self.outputs(value)),
                    "base" | "replace" | "rewire" | "set" => self.change_field(name, value, &mut changes),
                    _ => self.unknown_field(name, &GRAPH_FIELDS),
                }
            }
            // A graph with a base has the nodes and outputs of that.
            let is_whole = !changes.has_base();
            let missing = [
                (version.is_none(), "`version` is missing; write version: 1"),
                (
                    is_whole && nodes.is_none(),
                    "`nodes` is missing; write nodes: { \"NODE\": (kind: \"KIND\") }",
                ),
                (
                    is_whole && outputs.is_none(),
                    "`outputs` is missing; write outputs: { \"NAME\": \"NODE.PORT\" }",
                ),
            ];
            for (_, message) in missing.into_iter().filter(|(is_missing, _)| *is_missing) {
                self.report(GraphError::Syntax(message.into()), Span { start: root.start, end: root.start });
            }
        }
        GraphFile {
            path: path.to_owned(),
            text: self.text.to_owned(),
            version: version.unwrap_or(VERSION),
            doc,
            params,
            nodes: nodes.unwrap_or_default(),
            outputs: outputs.unwrap_or_default(),
            parts: Vec::new(),
            base: self.changes(changes),
            origin: Origin::File,
            others: Vec::new(),
        }
    }

    fn version(&mut self, span: Span) -> u32 {
        let found = self.scalar(span, "a whole number").map_or(VERSION, |number| number.value);
        if found != VERSION {
            self.report(GraphError::Version { found }, span);
        }
        found
    }

    /// Nodes by their names, which may be addresses: in `replace`, and in a graph that was written out in full.
    pub(super) fn nodes(&mut self, span: Span, shape: &Shape) -> Vec<NodeDef> {
        let mut nodes = Vec::new();
        for (name, value) in self.entries(span, shape).unwrap_or_default() {
            if name.value.contains('.') || name.value.split('/').any(str::is_empty) {
                let message =
                    format!("`{}` cannot name a node; use a name without a dot or a slash", name.value);
                self.report(GraphError::Invalid(message), name.span);
            }
            self.node = Some(name.value.clone());
            nodes.extend(self.node(name, value));
            self.node = None;
        }
        nodes
    }

    fn node(&mut self, name: Spanned<String>, span: Span) -> Option<NodeDef> {
        let (mut kind, mut has_kind) = (None, false);
        let (mut on, mut download, mut bypass) = (None, None, false);
        let (mut inputs, mut params, mut set) = (Vec::new(), Vec::new(), Vec::new());
        let mut repeat = None;
        for (field, value) in self.entries(span, &NODE)? {
            match field.value.as_str() {
                "kind" => {
                    has_kind = true;
                    kind = self.scalar(value, "a stage kind in double quotes");
                }
                "repeat" => repeat = self.repeat(value),
                "on" => on = self.variant::<Side>(value, "side", ["Gpu", "Cpu"], "Gpu or Cpu"),
                "download" => {
                    let expected = "Sync or Latent(FRAMES)";
                    download = self.variant::<Download>(value, "download", ["Sync", "Latent"], expected);
                }
                "bypass" => bypass = self.scalar(value, "true or false").is_some_and(|flag| flag.value),
                "inputs" => inputs = self.inputs(value),
                "params" => params = self.params(value),
                "set" => set = self.set(value),
                _ => self.unknown_field(field, &NODE_FIELDS),
            }
        }
        if !has_kind {
            self.report(GraphError::Syntax("`kind` is missing; write kind: \"KIND\"".into()), name.span);
        }
        Some(NodeDef {
            name,
            kind: kind?,
            repeat,
            on,
            download,
            bypass,
            inputs,
            params,
            set,
            replaced: None,
            cut: Vec::new(),
        })
    }

    /// Parameters by the addresses of their nodes.
    pub(super) fn set(&mut self, span: Span) -> Vec<(Spanned<String>, Vec<ParamDef>)> {
        let entries = self.entries(span, &SET).unwrap_or_default();
        entries.into_iter().map(|(node, value)| (node, self.params(value))).collect()
    }

    fn inputs(&mut self, span: Span) -> Vec<InputDef> {
        let mut inputs = Vec::new();
        for (port, value) in self.entries(span, &INPUTS).unwrap_or_default() {
            let before = self.found.len();
            match self.source(value) {
                Some(from) => inputs.push(InputDef { port, from }),
                None => {
                    for (_, problem) in &mut self.found[before..] {
                        problem.port = Some(port.value.clone());
                    }
                }
            }
        }
        inputs
    }

    fn params(&mut self, span: Span) -> Vec<ParamDef> {
        let entries = self.entries(span, &PARAMS).unwrap_or_default();
        let mut params = Vec::new();
        for (name, value) in entries {
            self.check_handing(value);
            params.push(ParamDef { name, value: self.text_at(value) });
        }
        params
    }

    fn outputs(&mut self, span: Span) -> Vec<OutputDef> {
        let mut outputs = Vec::new();
        for (name, value) in self.entries(span, &OUTPUTS).unwrap_or_default() {
            outputs.extend(self.source(value).map(|from| OutputDef { name, from }));
        }
        outputs
    }
}

/// Whether RON reads this as an identifier without `r#`; only the characters that shaders allow too.
pub(super) fn is_identifier(name: &str) -> bool {
    name.starts_with(|c: char| c == '_' || c.is_alphabetic())
        && name.chars().all(|c| c == '_' || c.is_alphanumeric())
}

#[cfg(test)]
mod tests {
    use serde::Deserialize;

    use super::{is_identifier, ron_problem};
    use crate::error::Place;

    #[test]
    fn a_part_of_a_file_has_its_places_in_the_whole() {
        #[allow(dead_code)]
        #[derive(Deserialize)]
        #[serde(deny_unknown_fields)]
        struct Part {
            one: u32,
            two: Option<String>,
        }
        for part in [
            "(one: 1, tow: 2)",
            "(one: x)",
            "(one: 1",
            "(one: 1,\n  two",
            "(one: 1,\n  two: Some(\"é\"), three: 3)",
            "(one: 1, two: Some(\"ab\\q\"))",
            "(one: -1)",
        ] {
            let error = ron::from_str::<Part>(part).err().unwrap_or_else(|| panic!("{part} is one"));
            let place = |before: &str| {
                let problem = ron_problem("f", &format!("{before}{part}"), before.len(), &error);
                let Place { line, column, length, .. } = problem.place.unwrap();
                (line, column, length)
            };
            let (line, column, length) = place("");
            if part.contains("tow") {
                assert_eq!((line, column, length), (1, 10, 3));
            }
            let on_first = |more: usize| if line == 1 { column + more } else { column };
            assert_eq!(place("é: "), (line, on_first(3), length), "{part}");
            assert_eq!(place("a,\n\n\t"), (line + 2, on_first(1), length), "{part}");
        }
    }

    #[test]
    fn identifiers_are_words_that_begin_with_a_letter_or_an_underscore() {
        for name in ["a", "_", "_1", "Zürich", "a1_b"] {
            assert!(is_identifier(name), "{name}");
        }
        for name in ["", "1", "1a", "-a", "a-b", "a b", "\"a\"", "r#a", "a.b", "(a)"] {
            assert!(!is_identifier(name), "{name}");
        }
    }
}
