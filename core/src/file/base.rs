//! Graphs that change another graph, their base, in the lines that differ:
//!
//! ```ron
//! Graph(
//!     version: 1,
//!     base: "epi",
//!     replace: { "interpolate": (kind: "wgsl", params: (shader: "mine.wgsl")) },
//!     nodes: { "median": (kind: "wgsl", inputs: { "color": "antialias.color" }, params: (shader: "median.wgsl")) },
//!     rewire: { "tonemap.color": "median.calm" },
//!     set: { "view/cull": (threshold: 0.1) },
//! )
//! ```
//!
//! The base is named like a graph on the command line, or by its path from this file. Addresses are those of the base,
//! with the added nodes: `view/cull` is the node `cull` of the part `view`.
//!
//! - `replace` gives nodes another definition. A new node keeps the wires of the old one to ports of the same names,
//!   and `on` and `download` where it can run there; its parameters are its own. A whole part can be replaced too.
//! - `nodes` adds nodes.
//! - `rewire` connects inputs of the base's nodes and outputs of the graph (`outputs.image`) anew; `None` disconnects.
//! - `set` sets parameters of the base's nodes.
//! - `outputs` adds outputs, or connects those of the base anew.
//! - `params` adds parameters of the graph, or gives those of the base other defaults.
//!
//! [`GraphFile::whole`] applies the changes: the result is a graph without a base, whose items know the file that their
//! text is in. All further steps work on that.

use std::{borrow::Cow, collections::BTreeSet, io, path::Path};

use super::{
    GraphFile, GraphParam, InputDef, NodeDef, OutputDef, ParamDef, Source,
    edit::one_value,
    handed, handing,
    library::{Library, Origin, folder},
    parse::{Reader, Shape, is_identifier},
    parts::{FILE_PARAM, INPUTS, PART_KIND},
    paths::names_file,
};
use crate::{
    error::{GraphError, Place, Problem, Problems, Span, Spanned},
    side::{Download, Side},
};

/// The node whose ports are a graph's outputs, in `rewire`.
const OUTPUTS: &str = "outputs";

/// What a graph changes in another one.
#[derive(Clone, Debug, PartialEq)]
pub struct Changes {
    /// The other graph: the name of one that comes with the program, or a path from the file's folder.
    pub base: Spanned<String>,
    /// Nodes that take the place of others, under the addresses of those.
    pub replace: Vec<NodeDef>,
    /// Inputs and outputs that are connected anew.
    pub rewire: Vec<Rewire>,
    /// Parameters of the base's nodes, by their addresses.
    pub set: Vec<(Spanned<String>, Vec<ParamDef>)>,
    /// The base, once read by [`GraphFile::load`] or [`GraphFile::with_parts`].
    pub graph: Option<Box<GraphFile>>,
    /// The files of the nodes of kind `graph` in `replace`, by their addresses; read together with the base.
    pub parts: Vec<(String, GraphFile)>,
}

/// A wire that is laid anew.
#[derive(Clone, Debug, PartialEq)]
pub struct Rewire {
    /// The input of a node, or `outputs.NAME`.
    pub to: Spanned<Source>,
    /// The producing port; `None` disconnects.
    pub from: Spanned<Option<Source>>,
}

/// What a node that replaces another keeps of it.
#[derive(Clone, Debug, PartialEq)]
pub struct Replaced {
    /// What the other is, in words: its kind, or its file.
    pub what: String,
    /// The inputs whose wires are the other's; the new node need not have them.
    pub kept: Vec<String>,
    /// Inputs of the other that the new node, which is a part, does not take.
    pub dropped: Vec<String>,
    /// Parameters that the other was given and the new node is not.
    pub params: Vec<String>,
    /// Where the other runs, as a default.
    pub on: Option<Side>,
    /// How GPU results reach the other, as a default.
    pub download: Option<Download>,
}

/// The parameters that a node was given and the one in its place is not, but for what makes it what it is.
fn lost(old: &NodeDef, new: &NodeDef) -> Vec<String> {
    let names = |node: &NodeDef| node.params.iter().map(|param| param.name.value.clone()).collect::<Vec<_>>();
    let given = names(new);
    let lost = |name: &String| !names_file(&old.kind.value, name) && !given.contains(name);
    names(old).into_iter().filter(lost).collect()
}

/// A text that items of a graph are from, besides its own. Their spans begin at `start` for its first byte.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct SourceText {
    start: usize,
    path: String,
    text: String,
    origin: Origin,
}

impl GraphFile {
    /// The place of a range of the text.
    pub fn place(&self, span: Span) -> Place {
        let (path, text, origin, start) = self.text_of(span);
        match origin {
            Origin::Option => Place::file(path),
            Origin::File | Origin::Shipped => {
                Place::of(path, text, Span { start: span.start - start, end: span.end - start })
            }
        }
    }

    /// The folder where a relative path starts that is written at `span`.
    pub(crate) fn folder_at(&self, span: Span) -> &Path {
        let (path, _, origin, _) = self.text_of(span);
        folder(path, origin)
    }

    /// The path of the file that a span lies in.
    pub(crate) fn path_at(&self, span: Span) -> &str {
        self.text_of(span).0
    }

    /// The path and the text of the file that a span lies in, and the span of its first byte.
    fn text_of(&self, span: Span) -> (&str, &str, Origin, usize) {
        match self.others.iter().rev().find(|other| other.start <= span.start) {
            Some(other) => (&other.path, &other.text, other.origin, other.start),
            None => (&self.path, &self.text, self.origin, 0),
        }
    }

    /// Lets items from another file's text be items of this graph; what to add to their spans.
    fn adopt(&mut self, file: &Self) -> usize {
        if let Some(known) =
            self.others.iter().find(|known| known.path == file.path && known.text == file.text)
        {
            return known.start;
        }
        // One more than the length, as an empty span may lie at the end of a text.
        let end = |start: usize, text: &str| start + text.len() + 1;
        let start = self.others.last().map_or(end(0, &self.text), |last| end(last.start, &last.text));
        let (path, text) = (file.path.clone(), file.text.clone());
        self.others.push(SourceText { start, path, text, origin: file.origin });
        start
    }

    /// A graph that changes this one, by an option of a command line or a piece of a graph's name. `option` is its
    /// text, for messages. `fields` are the fields of a graph file that it stands for, such as `nodes: { ... }`; paths
    /// in them start at the current folder.
    ///
    /// # Errors
    /// Problems of the fields' text and of files that it names.
    pub fn changed(&self, option: &str, fields: &str, library: &dyn Library) -> Result<Self, Problems> {
        let text = format!("Graph(version: {}, base: {:?}, {fields})", self.version, self.path);
        let mut file = Self::parse(option, &text).map_err(|mut problems| {
            for problem in &mut problems.0 {
                problem.place = Some(Place::file(option));
            }
            problems
        })?;
        file.origin = Origin::Option;
        if let Some(changes) = &mut file.base {
            changes.graph = Some(Box::new(self.clone()));
        }
        file.with_parts(library)
    }

    /// A graph that changes this one by a parameter: of a node, or of the graph itself if `node` is empty. `option` is
    /// the text for messages. `value` is RON. That the stage has such a parameter is checked on compiling.
    ///
    /// # Errors
    /// A name that is not an identifier, and a value that is not one RON value; if the parameter is the graph's own,
    /// also that it has no such parameter, or that this cannot have the value.
    pub fn with_param(&self, option: &str, node: &str, param: &str, value: &str) -> Result<Self, Problems> {
        let problem = |error| Problems::from(Problem::new(error).at(Place::file(option)));
        if !is_identifier(param) {
            return Err(problem(GraphError::Invalid(format!("`{param}` cannot name a parameter"))));
        }
        let value = one_value(param, value).map_err(problem)?;
        let nothing = |_: &Path| Err(io::ErrorKind::NotFound.into());
        if !node.is_empty() {
            return self.changed(option, &format!("set: {{ {node:?}: ({param}: {value}) }}"), &nothing);
        }
        let whole = self.whole()?;
        let mut param = whole.settable(param, "").map_err(problem)?.clone();
        value.clone_into(&mut param.default.value);
        (param.name.span, param.default.span) = (Span::default(), Span::default());
        let mut file = self.changed(option, "", &nothing)?;
        file.params.push(param);
        file.whole()?;
        Ok(file)
    }

    /// The port that an input of a node takes, or an output of the graph (`node` is then `outputs`), as an address in
    /// this graph; `None` if it is not connected. The graph must be [`GraphFile::whole`].
    pub fn wire_into(&self, node: &str, port: &str) -> Option<Source> {
        if node == OUTPUTS {
            let output = self.outputs.iter().find(|output| output.name.value == port)?;
            return Some(output.from.value.clone());
        }
        let (within, _, inner) = self.enter(node)?;
        let Some(inner) = inner else {
            let input = within.inputs.iter().find(|input| input.port.value == port)?;
            return Some(input.from.value.clone());
        };
        let name = &within.name.value;
        let source = self.part(name)?.wire_into(inner, port)?;
        match source.node.as_str() {
            INPUTS => self.wire_into(name, &source.port),
            node => Some(Source { node: format!("{name}/{node}"), port: source.port }),
        }
    }

    /// The graph's path, with the options that change it.
    pub fn name(&self) -> String {
        match (self.origin, &self.base) {
            (Origin::Option, Some(Changes { graph: Some(base), .. })) => {
                format!("{} {}", base.name(), self.path)
            }
            _ => self.path.clone(),
        }
    }

    /// Whether this graph changes a base.
    pub fn is_change(&self) -> bool {
        self.base.is_some()
    }

    /// The graph as it is with its changes to its base, and those of its parts to theirs: it has no base, and its items
    /// may be from several files.
    ///
    /// # Errors
    /// All changes that do not fit the base, each with its place; and a base that was not read.
    pub fn whole(&self) -> Result<Cow<'_, Self>, Problems> {
        if !self.has_base() {
            return Ok(Cow::Borrowed(self));
        }
        let mut problems = Problems::default();
        let mut parts = whole_parts(&self.parts, &mut problems);
        let Some(changes) = &self.base else {
            problems.into_result()?;
            return Ok(Cow::Owned(Self { parts, ..self.clone() }));
        };
        parts.extend(whole_parts(&changes.parts, &mut problems));
        let mut whole = match &changes.graph {
            Some(base) => base.whole()?.into_owned(),
            None => {
                let error = GraphError::Invalid("the base has not been read".into());
                return Err(Problem::new(error).at(self.place(changes.base.span)).into());
            }
        };
        if !self.doc.is_empty() {
            whole.doc.clone_from(&self.doc);
        }
        let mut merge = Merge { file: self, parts, problems };
        merge.apply(changes, &mut whole);
        merge.problems.into_result()?;
        Ok(Cow::Owned(whole))
    }

    fn has_base(&self) -> bool {
        self.base.is_some() || self.parts.iter().any(|(_, part)| part.has_base())
    }

    /// The inputs that the graph takes if it is a part: what its nodes read, and outputs that pass an input on.
    pub fn taken(&self) -> BTreeSet<&str> {
        let wires = self.nodes.iter().flat_map(|node| &node.inputs).map(|input| &input.from.value);
        let wires = wires.chain(self.outputs.iter().map(|output| &output.from.value));
        wires.filter(|from| from.node == INPUTS).map(|from| from.port.as_str()).collect()
    }
}

fn whole_parts(parts: &[(String, GraphFile)], problems: &mut Problems) -> Vec<(String, GraphFile)> {
    let mut whole = Vec::new();
    for (name, part) in parts {
        match part.whole() {
            Ok(part) => whole.push((name.clone(), part.into_owned())),
            Err(found) => problems.append(found),
        }
    }
    whole
}

/// Applies the changes of one file.
struct Merge<'f> {
    file: &'f GraphFile,
    /// The files of added and replaced nodes, by node.
    parts: Vec<(String, GraphFile)>,
    problems: Problems,
}

/// A change to one node. Spans are those of the changing file.
enum Change {
    /// Another definition, and its file if it is a part.
    Node(Box<(NodeDef, Option<GraphFile>)>),
    /// An input, connected or disconnected.
    Wire(Spanned<String>, Option<InputDef>),
}

impl Change {
    fn wires(&mut self) -> &mut [InputDef] {
        match self {
            Self::Node(new) => &mut new.0.inputs,
            Self::Wire(_, Some(input)) => std::slice::from_mut(input),
            Self::Wire(_, None) => &mut [],
        }
    }
}

impl Merge<'_> {
    fn report(&mut self, error: impl FnOnce() -> GraphError, span: Span, node: &str) {
        let file = self.file;
        self.problems.add(|| {
            let problem = Problem::new(error()).at(file.place(span));
            if node.is_empty() { problem } else { problem.node(node) }
        });
    }

    fn apply(&mut self, changes: &Changes, whole: &mut GraphFile) {
        for param in &self.file.params {
            self.param(whole, param);
        }
        // A part comes before what is in it, so that neither change is lost.
        let mut replace: Vec<&NodeDef> = changes.replace.iter().collect();
        replace.sort_by_key(|node| node.name.value.matches('/').count());
        for node in replace {
            if self.has_node(whole, &node.name) {
                let part = self.part(&node.name.value);
                self.change(whole, &node.name.value, Change::Node(Box::new((node.clone(), part))));
            }
        }
        for node in &self.file.nodes {
            self.add(whole, node);
        }
        for rewire in &changes.rewire {
            self.rewire(whole, rewire);
        }
        for (address, params) in &changes.set {
            self.set(whole, address, params);
        }
        for output in &self.file.outputs {
            let by = whole.adopt(self.file);
            let output = OutputDef { name: shifted(&output.name, by), from: shifted(&output.from, by) };
            match whole.outputs.iter_mut().find(|known| known.name.value == output.name.value) {
                Some(known) => *known = output,
                None => whole.outputs.push(output),
            }
        }
    }

    fn part(&self, node: &str) -> Option<GraphFile> {
        self.parts.iter().find(|(name, _)| name == node).map(|(_, part)| part.clone())
    }

    /// Whether the graph has the node, as it is written; reports it otherwise.
    fn has_node(&mut self, whole: &GraphFile, address: &Spanned<String>) -> bool {
        let mut within = whole;
        let mut rest = Some(&address.value[..]);
        while let Some(inner) = rest {
            match within.enter(inner) {
                Some((_, Some(copy), _)) => {
                    let text = format!(
                        "`{copy}` is one of a node's copies, which differ only in what `set` gives them"
                    );
                    self.report(|| GraphError::Invalid(text), address.span, "");
                    return false;
                }
                Some((_, None, None)) => return true,
                Some((node, None, inner)) => match within.part(&node.name.value) {
                    Some(part) => (within, rest) = (part, inner),
                    None => break,
                },
                None => break,
            }
        }
        self.report(|| whole.no_node(&address.value), address.span, "");
        false
    }

    /// Adds a parameter to the graph, or gives one of the base another default, and other words and another range if
    /// there are any.
    fn param(&mut self, whole: &mut GraphFile, param: &GraphParam) {
        let by = whole.adopt(self.file);
        let (name, default) = (shifted(&param.name, by), shifted(&param.default, by));
        let Some(known) = whole.params.iter_mut().find(|known| known.name.value == param.name.value) else {
            return whole.params.push(GraphParam { name, default, spec: param.spec.clone() });
        };
        let spec = &mut known.spec;
        spec.default.clone_from(&param.default.value);
        spec.range = param.spec.range.or(spec.range);
        for (old, new) in [(&mut spec.doc, &param.spec.doc), (&mut spec.unit, &param.spec.unit)] {
            if !new.is_empty() {
                old.clone_from(new);
            }
        }
        if let Err(error) = spec.check(&param.default.value) {
            let error = spec.refusal(&param.default.value, error);
            self.report(|| error, param.default.span, "");
        }
        (known.name, known.default) = (name, default);
    }

    fn add(&mut self, whole: &mut GraphFile, node: &NodeDef) {
        let name = &node.name.value;
        if whole.node(name).is_some() {
            let text = format!(
                "the base has a node `{name}` already; put this one into `replace` to take its place, or give it \
                 another name"
            );
            return self.report(|| GraphError::Invalid(text), node.name.span, name);
        }
        whole.parts.extend(self.part(name).map(|part| (name.clone(), part)));
        let by = whole.adopt(self.file);
        let mut node = node.clone();
        node.shift(by);
        whole.nodes.push(node);
    }

    fn rewire(&mut self, whole: &mut GraphFile, rewire: &Rewire) {
        let Rewire { to, from } = rewire;
        let Source { node, port } = &to.value;
        if node == OUTPUTS {
            return self.rewire_output(whole, rewire);
        }
        let address = Spanned { value: node.clone(), span: to.span };
        if !self.has_node(whole, &address) {
            return;
        }
        let port = Spanned { value: port.clone(), span: to.span };
        let input = from
            .value
            .clone()
            .map(|source| InputDef { port: port.clone(), from: Spanned { value: source, span: from.span } });
        self.change(whole, node, Change::Wire(port, input));
    }

    fn rewire_output(&mut self, whole: &mut GraphFile, Rewire { to, from }: &Rewire) {
        let name = &to.value.port;
        let by = whole.adopt(self.file);
        let Some(output) = whole.outputs.iter_mut().find(|output| output.name.value == *name) else {
            let known = || whole.outputs.iter().map(|output| &output.name.value);
            return self.report(|| GraphError::unknown("output of the base", name, known()), to.span, "");
        };
        match &from.value {
            Some(source) => output.from = shifted(&Spanned { value: source.clone(), span: from.span }, by),
            None => {
                let text = format!("the output `{name}` cannot be disconnected; write \"NODE.PORT\"");
                self.report(|| GraphError::Invalid(text), from.span, "");
            }
        }
    }

    fn set(&mut self, whole: &mut GraphFile, address: &Spanned<String>, params: &[ParamDef]) {
        let by = whole.adopt(self.file);
        let params: Vec<ParamDef> = params
            .iter()
            .map(|param| ParamDef { name: shifted(&param.name, by), value: shifted(&param.value, by) })
            .collect();
        let Some((head, ..)) = whole.enter(&address.value) else {
            return self.report(|| whole.no_node(&address.value), address.span, "");
        };
        let head = head.name.value.clone();
        let Some(node) = whole.nodes.iter_mut().find(|node| node.name.value == head) else { return };
        let Some(inner) = address.value[head.len()..].strip_prefix('/') else {
            let file = params.iter().find(|param| param.name.value == FILE_PARAM);
            if let Some(file) = file.filter(|_| node.kind.value == PART_KIND) {
                let text = format!(
                    "the file of a part is changed by replace: {{ {head:?}: (kind: \"graph\", params: (file: {})) }}, or by \
                     --swap {head}=FILE.ron",
                    file.value.value
                );
                let span = Span { start: file.name.span.start - by, end: file.name.span.end - by };
                return self.report(|| GraphError::Invalid(text), span, &head);
            }
            return put_params(&mut node.params, params);
        };
        // The node hands the parameters on, as it does with those of its own file; unknown addresses are found there.
        match node.set.iter_mut().find(|(known, _)| known.value == inner) {
            Some((_, known)) => put_params(known, params),
            None => {
                let span = shifted(address, by).span;
                node.set.push((Spanned { value: inner.to_owned(), span }, params));
            }
        }
    }

    /// Makes a change to the node of this address, which exists, in `graph` or in one of its parts.
    fn change(&mut self, graph: &mut GraphFile, address: &str, mut change: Change) {
        if let Some(index) = graph.nodes.iter().position(|node| node.name.value == address) {
            return match change {
                Change::Node(new) => self.replace(graph, index, new.0, new.1),
                Change::Wire(port, input) => self.wire(graph, index, &port, input),
            };
        }
        let Some((node, _, Some(inner))) = graph.enter(address) else { return };
        let name = node.name.value.clone();
        let Some(part) = graph.parts.iter().position(|(known, _)| *known == name) else { return };
        for wire in change.wires() {
            self.lower(graph, part, wire);
        }
        if let Change::Node(new) = &mut change {
            self.lower_params(graph, part, &mut new.0);
        }
        let is_node = matches!(change, Change::Node(..));
        let before: Vec<String> = graph.parts[part].1.taken().into_iter().map(str::to_owned).collect();
        self.change(&mut graph.parts[part].1, inner, change);
        let after = graph.parts[part].1.taken();
        let Some(node) = graph.nodes.iter_mut().find(|node| node.name.value == name) else { return };
        // What only the changed wires read need not come in any more.
        node.inputs.retain(|input| {
            let port = &input.port.value;
            !before.contains(port) || after.contains(port.as_str())
        });
        if is_node {
            // The new node has parameters of its own.
            node.set.retain(|(set, _)| !is_within(&set.value, inner));
        }
    }

    /// Makes a wire's source one of the part's own: a node in it, or one of its inputs.
    fn lower(&mut self, graph: &mut GraphFile, part: usize, wire: &mut InputDef) {
        let by = graph.adopt(self.file);
        let (name, within) = &graph.parts[part];
        let source = &wire.from.value;
        if source.node == *name {
            match within.outputs.iter().find(|output| output.name.value == source.port) {
                Some(output) => wire.from.value = output.from.value.clone(),
                None => {
                    let known = within.outputs.iter().map(|output| &output.name.value);
                    let error = GraphError::unknown("output of a part", &source.port, known);
                    self.report(|| error, wire.from.span, name);
                }
            }
            return;
        }
        if let Some(inner) = source.node.strip_prefix(name.as_str()).and_then(|rest| rest.strip_prefix('/')) {
            wire.from.value = Source { node: inner.to_owned(), port: source.port.clone() };
            return;
        }
        let Some(node) = graph.nodes.iter_mut().find(|node| node.name.value == *name) else { return };
        let chained = |port: &str| {
            node.repeat.iter().flat_map(|repeat| &repeat.through).any(|(input, _)| input.value == port)
        };
        let known =
            node.inputs.iter().find(|input| input.from.value == *source && !chained(&input.port.value));
        let port = match known {
            Some(known) => known.port.value.clone(),
            None => {
                // No file can name an input so.
                let port = source.to_string();
                let from = shifted(&wire.from, by);
                node.inputs.push(InputDef { port: Spanned { value: port.clone(), span: from.span }, from });
                port
            }
        };
        wire.from.value = Source { node: INPUTS.to_owned(), port };
    }

    /// Hands parameters of the graph that a node takes on to the part that will have the node.
    fn lower_params(&mut self, graph: &mut GraphFile, part: usize, node: &mut NodeDef) {
        let by = graph.adopt(self.file);
        for value in node.values_mut() {
            let Some(name) = handed(&value.value) else { continue };
            let Some(param) = graph.param(&name).cloned() else {
                // Reported where the node is: it has no such parameter there either.
                continue;
            };
            // No file can name a parameter so.
            let inner = format!("{name} of the graph around");
            value.value = handing(&inner);
            let (part_name, within) = &mut graph.parts[part];
            if within.param(&inner).is_some() {
                continue;
            }
            let start = within.adopt(self.file);
            within.params.push(GraphParam {
                name: Spanned { value: inner.clone(), span: shifted(value, start).span },
                default: shifted(&Spanned { value: param.default.value, span: value.span }, start),
                spec: param.spec,
            });
            let span = shifted(value, by).span;
            let name = Spanned { value: inner, span };
            let value = Spanned { value: handing(&param.name.value), span };
            let including = graph.nodes.iter_mut().find(|node| node.name.value == *part_name);
            including
                .into_iter()
                .for_each(|node| node.params.push(ParamDef { name: name.clone(), value: value.clone() }));
        }
    }

    fn replace(&mut self, graph: &mut GraphFile, index: usize, mut node: NodeDef, part: Option<GraphFile>) {
        let by = graph.adopt(self.file);
        node.shift(by);
        let old = graph.nodes[index].clone();
        node.name.value.clone_from(&old.name.value);
        // Copies are chained by wires, which the new node keeps.
        node.repeat = node.repeat.or_else(|| old.repeat.clone());
        let mut replaced = Replaced {
            what: old.what(),
            kept: Vec::new(),
            dropped: Vec::new(),
            params: lost(&old, &node),
            on: old.on.as_ref().map(|on| on.value).or(old.replaced.as_ref().and_then(|old| old.on)),
            download: old
                .download
                .as_ref()
                .map(|download| download.value)
                .or(old.replaced.as_ref().and_then(|old| old.download)),
        };
        for input in old.inputs {
            let port = input.port.value.clone();
            if node.inputs.iter().any(|own| own.port.value == port) {
                continue;
            }
            if part.as_ref().is_some_and(|part| !part.taken().contains(port.as_str())) {
                replaced.dropped.push(port);
            } else {
                replaced.kept.push(port);
                node.inputs.push(input);
            }
        }
        node.replaced = Some(Box::new(replaced));
        graph.parts.retain(|(name, _)| *name != old.name.value);
        graph.parts.extend(part.map(|part| (old.name.value, part)));
        graph.nodes[index] = node;
    }

    fn wire(&mut self, graph: &mut GraphFile, index: usize, port: &Spanned<String>, input: Option<InputDef>) {
        let by = graph.adopt(self.file);
        let node = &mut graph.nodes[index];
        let known = node.inputs.iter().position(|known| known.port.value == port.value);
        match (known, input) {
            (known, Some(input)) => {
                let input = InputDef { port: shifted(&input.port, by), from: shifted(&input.from, by) };
                match known {
                    Some(known) => node.inputs[known] = input,
                    None => node.inputs.push(input),
                }
            }
            (Some(known), None) => {
                node.inputs.remove(known);
                node.cut.push(shifted(port, by));
            }
            (None, None) => {
                let known: Vec<&str> = node.inputs.iter().map(|input| input.port.value.as_str()).collect();
                let error = GraphError::unknown("connected input", &port.value, known);
                let name = node.name.value.clone();
                self.report(|| error, port.span, &name);
            }
        }
    }
}

/// Whether an address is that of a node or leads into it.
fn is_within(address: &str, node: &str) -> bool {
    address.strip_prefix(node).is_some_and(|rest| rest.is_empty() || rest.starts_with('/'))
}

/// Sets parameters; those of the same names go.
fn put_params(params: &mut Vec<ParamDef>, new: Vec<ParamDef>) {
    params.retain(|param| new.iter().all(|new| new.name.value != param.name.value));
    params.extend(new);
}

fn shifted<T: Clone>(item: &Spanned<T>, by: usize) -> Spanned<T> {
    let Span { start, end } = item.span;
    Spanned { value: item.value.clone(), span: Span { start: start + by, end: end + by } }
}

impl NodeDef {
    /// What it is, in words: its kind, or the file that it names.
    pub(crate) fn what(&self) -> String {
        let named = self.params.iter().find(|param| names_file(&self.kind.value, &param.name.value));
        let file = named.and_then(|param| ron::from_str::<String>(&param.value.value).ok());
        file.unwrap_or_else(|| self.kind.value.clone())
    }

    /// Moves all places.
    fn shift(&mut self, by: usize) {
        fn params(params: &mut [ParamDef], by: usize) {
            for param in params {
                *param = ParamDef { name: shifted(&param.name, by), value: shifted(&param.value, by) };
            }
        }
        self.name = shifted(&self.name, by);
        self.kind = shifted(&self.kind, by);
        self.on = self.on.as_ref().map(|on| shifted(on, by));
        self.download = self.download.as_ref().map(|download| shifted(download, by));
        if let Some(repeat) = &mut self.repeat {
            repeat.times = shifted(&repeat.times, by);
            repeat.count = repeat.count.as_ref().map(|count| shifted(count, by));
            for (input, output) in &mut repeat.through {
                (*input, *output) = (shifted(input, by), shifted(output, by));
            }
        }
        for input in &mut self.inputs {
            *input = InputDef { port: shifted(&input.port, by), from: shifted(&input.from, by) };
        }
        params(&mut self.params, by);
        for port in &mut self.cut {
            *port = shifted(port, by);
        }
        for (node, set) in &mut self.set {
            *node = shifted(node, by);
            params(set, by);
        }
    }
}

const REPLACE: Shape = Shape::map("node", "{ \"NODE\": (kind: \"KIND\"), ... }");
const REWIRE: Shape = Shape::map("wire", "{ \"NODE.PORT\": \"NODE.PORT\", ... }");

/// The fields that change a base, as far as they are read.
#[derive(Default)]
pub(super) struct ChangeFields {
    base: Option<Option<Spanned<String>>>,
    replace: Vec<NodeDef>,
    rewire: Vec<Rewire>,
    set: Vec<(Spanned<String>, Vec<ParamDef>)>,
    /// One that needs a base.
    needs: Option<Spanned<String>>,
}

impl ChangeFields {
    /// Whether the file names a base.
    pub(super) fn has_base(&self) -> bool {
        self.base.is_some()
    }
}

impl Reader<'_> {
    /// Reads a field that changes a base, one of [`CHANGE_FIELDS`].
    pub(super) fn change_field(&mut self, field: Spanned<String>, value: Span, fields: &mut ChangeFields) {
        match field.value.as_str() {
            "base" => {
                fields.base = Some(self.scalar(value, "the name of a graph, or a path, in double quotes"));
                return;
            }
            "replace" => fields.replace = self.nodes(value, &REPLACE),
            "rewire" => fields.rewire = self.rewire(value),
            _ => fields.set = self.set(value),
        }
        fields.needs.get_or_insert(field);
    }

    fn rewire(&mut self, span: Span) -> Vec<Rewire> {
        let mut rewire = Vec::new();
        for (to, value) in self.entries(span, &REWIRE).unwrap_or_default() {
            let to = match to.value.parse() {
                Ok(source) => Some(Spanned { value: source, span: to.span }),
                Err(error) => {
                    self.report(error, to.span);
                    None
                }
            };
            let from = match self.slice(value) {
                "None" => Some(Spanned { value: None, span: value }),
                _ => self.source(value).map(|from| Spanned { value: Some(from.value), span: from.span }),
            };
            rewire.extend(to.zip(from).map(|(to, from)| Rewire { to, from }));
        }
        rewire
    }

    /// The changes that the fields make; reports fields that need a base.
    pub(super) fn changes(&mut self, fields: ChangeFields) -> Option<Changes> {
        let ChangeFields { base, replace, rewire, set, needs } = fields;
        if let (None, Some(field)) = (&base, needs) {
            let text = format!("`{}` changes another graph; name it: write base: \"GRAPH\"", field.value);
            self.report(GraphError::Syntax(text), field.span);
        }
        Some(Changes { base: base??, replace, rewire, set, graph: None, parts: Vec::new() })
    }
}
