//! Edits that change only the characters they concern.
//!
//! Every edit is a list of replacements in the text; the result is parsed again, and kept only if it is a graph file.
//! New items follow the style of their block: on their own line if the closing bracket is, else inline.

use std::mem;

use serde::de::IgnoredAny;

use super::{
    GraphFile, GraphParam, Source,
    edit_base::Home,
    handed,
    parse::is_identifier,
    parts::{FILE_PARAM, file_elsewhere},
    repeat::{no_copy, times},
    scan::{self, Block, Item},
};
use crate::{
    error::{GraphError, Problem, Problems, Span},
    params::{ParamKind, ParamSpec},
    side::{Download, Side},
};

/// Indentation of one more level if the block itself does not show it.
const INDENT: &str = "    ";

/// A range of the text and its replacement.
struct Change {
    span: Span,
    text: String,
}

impl Change {
    fn replace(span: Span, text: impl Into<String>) -> Self {
        Self { span, text: text.into() }
    }

    fn insert(at: usize, text: impl Into<String>) -> Self {
        Self::replace(Span { start: at, end: at }, text)
    }

    fn cut(start: usize, end: usize) -> Self {
        Self::replace(Span { start, end }, "")
    }
}

/// The two blocks within a node.
#[derive(Clone, Copy)]
enum Group {
    Inputs,
    Params,
}

impl Group {
    fn name(self) -> &'static str {
        match self {
            Self::Inputs => "inputs",
            Self::Params => "params",
        }
    }

    fn item(self, name: &str, value: &str) -> String {
        match self {
            Self::Inputs => format!("{}: {value}", quoted(name)),
            Self::Params => format!("{name}: {value}"),
        }
    }

    /// The whole field with one item in it.
    fn field(self, item: &str) -> String {
        match self {
            Self::Inputs => format!("inputs: {{ {item} }}"),
            Self::Params => format!("params: ({item})"),
        }
    }
}

/// All edits leave the file unchanged when they fail. Apart from the errors named at each, the resulting text may not
/// be a graph file (because of a duplicate name, for example); they then return the problems of that text.
impl GraphFile {
    /// Sets a parameter, adding it if the node does not have it yet: `--set node.param=value`. `value` is RON.
    /// `part/node`, or the inner name alone if it is unambiguous ([`GraphFile::address_of`]), sets one in the text of a
    /// part, or where the part's node overrides it; `node/2` sets one of a repeated node's copies. Does not check that
    /// the stage has such a parameter.
    ///
    /// # Errors
    /// [`GraphError::Unknown`] node or parameter of a part, [`GraphError::Invalid`] for a name that is not an
    /// identifier, [`GraphError::Value`] for a value that is not one RON value.
    pub fn set_param(&mut self, node: &str, param: &str, value: &str) -> Result<(), Problems> {
        let address = self.full_address(node)?;
        let problem = |error| Problems::from(Problem::new(error).node(&address));
        if !is_identifier(param) {
            return Err(problem(GraphError::Invalid(format!("`{param}` cannot name a parameter"))));
        }
        let value = one_value(param, value).map_err(problem)?;
        match self.home(&address) {
            // What a change sets comes before what it writes elsewhere.
            _ if self.sets_of_base(&address, param) => self.set_of_base(&address, param, value),
            Home::Own => self.set_at("", &address, param, value),
            Home::Replaced => self.set_in(&address, Group::Params, param, value),
            Home::Base => self.set_of_base(&address, param, value),
        }
    }

    /// Sets the default of one of the graph's own parameters: `--set param=value`. `value` is RON. A graph with a base
    /// gives a parameter of the base another default.
    ///
    /// # Errors
    /// [`GraphError::Unknown`] parameter, [`GraphError::Value`] and [`GraphError::Range`] for a value that it cannot
    /// have.
    pub fn set_graph_param(&mut self, name: &str, value: &str) -> Result<(), Problems> {
        let whole = self.whole()?;
        let GraphParam { spec, .. } = whole.settable(name, "").map_err(Problem::new)?;
        let value = one_value(name, value).map_err(Problem::new)?;
        spec.check(value).map_err(|error| Problem::new(spec.refusal(value, error)))?;
        match self.param(name) {
            Some(own) => self.apply(vec![Change::replace(own.default.span, value)]),
            None => {
                let item = default_of_base(spec, value);
                self.put_top("params", name, &item)
            }
        }
    }

    /// Sets a parameter of a node of this file, which is the part of the address `around`, or in a part of it.
    fn set_at(&mut self, around: &str, address: &str, param: &str, value: &str) -> Result<(), Problems> {
        let full = format!("{around}{address}");
        let refuse = |error| Err(Problem::new(error).node(&full).into());
        let Some((node, copy, rest)) = self.enter(address).filter(|_| self.node_at(address).is_some()) else {
            return Err(Problem::new(self.no_node(address)).into());
        };
        let name = node.name.value.clone();
        let times = node.repeat.as_ref().and_then(|repeat| times(&repeat.times.value));
        if let (Some(copy), Some(times)) = (copy, times)
            && copy >= times
        {
            return refuse(no_copy(copy, times));
        }
        let part = self.part(&name);
        let within = &address[name.len()..].trim_start_matches('/');
        match (rest, part) {
            // A part's text goes on handing out its own parameters.
            _ if copy.is_some() || self.sets(&name, within, param) => {
                self.set_within(&name, within, param, value)
            }
            (Some(rest), Some(part)) if part.hands(rest, param) => {
                self.set_within(&name, within, param, value)
            }
            (Some(rest), _) => match self.part_mut(&name) {
                Some(part) => part.set_at(full.strip_suffix(rest).unwrap_or(&full), rest, param, value),
                None => refuse(self.no_node(address)),
            },
            (None, Some(_)) if param == FILE_PARAM => refuse(file_elsewhere()),
            (None, Some(part)) => match part.settable(param, &full) {
                Ok(_) => self.set_in(&name, Group::Params, param, value),
                Err(error) => refuse(error),
            },
            (None, None) => self.set_in(&name, Group::Params, param, value),
        }
    }

    /// Whether a node takes this parameter from its graph.
    fn hands(&self, address: &str, param: &str) -> bool {
        let params = self.node_at(address).map(|(node, _)| &node.params[..]).unwrap_or_default();
        params.iter().any(|def| def.name.value == param && handed(&def.value.value).is_some())
    }

    /// Sets a parameter in the `set` of a node, for the node with an address within it.
    fn set_within(&mut self, node: &str, address: &str, param: &str, value: &str) -> Result<(), Problems> {
        let node = self.node_block(node)?;
        let item = || Group::Params.item(param, value);
        let for_node = || format!("{}: ({})", quoted(address), item());
        let set = child(&self.text, &node, "set");
        let params = set.as_ref().and_then(|set| child(&self.text, set, address));
        let changes = match (set, params) {
            (_, Some(params)) => put(&self.text, &params, find(&self.text, &params, param), value, item),
            (Some(set), None) => insert(&self.text, &set, &for_node()),
            (None, None) => insert(&self.text, &node, &format!("set: {{ {} }}", for_node())),
        };
        self.apply(changes)
    }

    /// Removes a parameter from the `set` of the node that contains another: of the part, or of the repeated node. What is
    /// written for the node itself then applies.
    ///
    /// # Errors
    /// [`GraphError::Unknown`] node or parameter.
    pub fn unset_param(&mut self, address: &str, param: &str) -> Result<(), Problems> {
        let missing = |file: &Self| Problems::from(Problem::new(file.no_node(address)));
        let name = self.enter(address).ok_or_else(|| missing(self))?.0.name.value.clone();
        let within = address[name.len()..].trim_start_matches('/');
        if self.sets(&name, within, param) {
            let set = child(&self.text, &self.node_block(&name)?, "set").ok_or_else(|| missing(self))?;
            let params = child(&self.text, &set, within).ok_or_else(|| missing(self))?;
            // The last one takes its node's entry with it.
            let changes = match (&params.items[..], find(&self.text, &params, param)) {
                ([_], _) => find(&self.text, &set, within).map(|index| remove(&self.text, &set, index)),
                (_, Some(index)) => Some(remove(&self.text, &params, index)),
                (_, None) => None,
            };
            return self.apply(changes.unwrap_or_default());
        }
        let rest = self.enter(address).and_then(|(_, _, rest)| rest).ok_or_else(|| missing(self))?.to_owned();
        match self.part_mut(&name) {
            Some(part) => part.unset_param(&rest, param),
            None => Err(missing(self)),
        }
    }

    /// Whether the node of a part overrides this parameter of a node in it.
    fn sets(&self, part: &str, inner: &str, param: &str) -> bool {
        let set = self.node(part).into_iter().flat_map(|node| &node.set);
        set.filter(|(node, _)| node.value == inner)
            .flat_map(|(_, params)| params)
            .any(|known| known.name.value == param)
    }

    /// Removes a parameter, so that the stage's default applies.
    ///
    /// # Errors
    /// [`GraphError::Unknown`] node or parameter.
    pub fn remove_param(&mut self, node: &str, param: &str) -> Result<(), Problems> {
        if self.remove_set(node, param)?
            || self.home(node) != Home::Base && self.remove_in(node, Group::Params, param)?
        {
            return Ok(());
        }
        let known = self.node(node).into_iter().flat_map(|node| &node.params).map(|param| &param.name.value);
        Err(Problem::new(GraphError::unknown("parameter", param, known)).node(node).into())
    }

    /// Connects an input, or disconnects it.
    ///
    /// # Errors
    /// [`GraphError::Unknown`] node.
    pub fn set_input(&mut self, node: &str, port: &str, source: Option<&Source>) -> Result<(), Problems> {
        if self.base.is_some() {
            return self.connect_in_change(node, port, source);
        }
        self.connect(node, port, source)
    }

    /// Sets or removes a wire in the definition of a node.
    pub(super) fn connect(
        &mut self,
        node: &str,
        port: &str,
        source: Option<&Source>,
    ) -> Result<(), Problems> {
        match source {
            Some(source) => self.set_in(node, Group::Inputs, port, &quoted(&source.to_string())),
            None => self.remove_in(node, Group::Inputs, port).map(|_| ()),
        }
    }

    /// Replaces a node's stage kind.
    ///
    /// # Errors
    /// [`GraphError::Unknown`] node.
    pub fn set_kind(&mut self, node: &str, kind: &str) -> Result<(), Problems> {
        self.set_field(node, "kind", Some(quoted(kind)))
    }

    /// Places a node, or leaves it at the run's default.
    ///
    /// # Errors
    /// [`GraphError::Unknown`] node.
    pub fn set_on(&mut self, node: &str, on: Option<Side>) -> Result<(), Problems> {
        self.set_field(node, "on", on.map(|side| format!("{side:?}")))
    }

    /// Sets how GPU results reach a node on the CPU, or leaves it at the default.
    ///
    /// # Errors
    /// [`GraphError::Unknown`] node.
    pub fn set_download(&mut self, node: &str, download: Option<Download>) -> Result<(), Problems> {
        self.set_field(node, "download", download.map(|download| format!("{download:?}")))
    }

    /// Sets or clears a node's bypass mark.
    ///
    /// # Errors
    /// [`GraphError::Unknown`] node.
    pub fn set_bypass(&mut self, node: &str, bypass: bool) -> Result<(), Problems> {
        self.set_field(node, "bypass", bypass.then(|| "true".into()))
    }

    /// Adds a node after all others, without inputs or parameters.
    ///
    /// # Errors
    /// [`GraphError::Duplicate`] name.
    pub fn add_node(&mut self, name: &str, kind: &str) -> Result<(), Problems> {
        self.require_new(name)?;
        self.insert_top("nodes", &format!("{}: (kind: {})", quoted(name), quoted(kind)))
    }

    /// Reports a name that a node has already.
    fn require_new(&self, name: &str) -> Result<(), Problems> {
        let whole = if self.base.is_some() { Some(self.whole()?) } else { None };
        if whole.as_deref().unwrap_or(self).node(name).is_some() {
            let error = GraphError::Duplicate { what: "node", name: name.to_owned() };
            return Err(Problem::new(error).node(name).into());
        }
        Ok(())
    }

    /// Adds a copy of `name` after all other nodes: the same kind, wires and parameters.
    ///
    /// # Errors
    /// [`GraphError::Unknown`] node, [`GraphError::Duplicate`] name.
    pub fn copy_node(&mut self, name: &str, copy: &str) -> Result<(), Problems> {
        self.require_new(copy)?;
        if self.home(name) != Home::Own {
            return self.copy_of_base(name, copy);
        }
        self.node_block(name)?;
        let nodes = self.top("nodes")?;
        let value = find(&self.text, &nodes, name).map_or(Span::default(), |index| nodes.items[index].value);
        let item = format!("{}: {}", quoted(copy), &self.text[value.start..value.end]);
        let part = self.part(name).cloned();
        self.insert_top("nodes", &item)?;
        self.parts.extend(part.map(|part| (copy.to_owned(), part)));
        Ok(())
    }

    /// Removes a node with every wire and output that reads it, or reads a node in it if it is a part.
    ///
    /// # Errors
    /// [`GraphError::Unknown`] node.
    pub fn remove_node(&mut self, name: &str) -> Result<(), Problems> {
        self.require_own(name, "remove it; bypass it, or let what reads it take other ports")?;
        self.node_block(name)?;
        let mut edited = self.clone();
        edited.remove_wires_from(name)?;
        for node in &self.nodes {
            for input in node.inputs.iter().filter(|input| within(&input.from.value, name).is_some()) {
                edited.set_input(&node.name.value, &input.port.value, None)?;
            }
        }
        for output in self.outputs.iter().filter(|output| within(&output.from.value, name).is_some()) {
            edited.set_output(&output.name.value, None)?;
        }
        let nodes = edited.top("nodes")?;
        if let Some(index) = find(&edited.text, &nodes, name) {
            edited.apply(remove(&edited.text, &nodes, index))?;
        }
        *self = edited;
        Ok(())
    }

    /// Renames a node, also in every wire and output that reads it, or reads a node in it if it is a part.
    ///
    /// # Errors
    /// [`GraphError::Unknown`] node.
    pub fn rename_node(&mut self, old: &str, new: &str) -> Result<(), Problems> {
        self.require_own(old, "give it another name")?;
        self.node_block(old)?;
        let changes = self.base.as_ref();
        let replaced = changes.into_iter().flat_map(|changes| &changes.replace);
        let inputs = self.nodes.iter().chain(replaced).flat_map(|node| &node.inputs);
        let outputs = self.outputs.iter().map(|output| (&output.from.value, output.from.span));
        let wires = inputs.map(|input| (&input.from.value, input.from.span)).chain(outputs);
        let rewired = changes.into_iter().flat_map(|changes| &changes.rewire).flat_map(|wire| {
            let from = wire.from.value.as_ref().map(|from| (from, wire.from.span));
            [Some((&wire.to.value, wire.to.span)), from].into_iter().flatten()
        });
        let wires = wires.chain(rewired).filter_map(|(source, span)| {
            let inner = within(source, old)?;
            let source = Source { node: format!("{new}{inner}"), port: source.port.clone() };
            Some(Change::replace(span, quoted(&source.to_string())))
        });
        let names = self.nodes.iter().map(|node| &node.name);
        let set = changes.into_iter().flat_map(|changes| &changes.set).map(|(node, _)| node);
        let names = names.chain(set).filter_map(|name| {
            let inner = name.value.strip_prefix(old)?;
            (inner.is_empty() || inner.starts_with('/'))
                .then(|| Change::replace(name.span, quoted(&format!("{new}{inner}"))))
        });
        self.apply(wires.chain(names).collect())?;
        if let Some((part, _)) = self.parts.iter_mut().find(|(part, _)| part == old) {
            new.clone_into(part);
        }
        Ok(())
    }

    /// Sets an output, adding it if it does not exist, or removes it.
    ///
    /// # Errors
    /// None of its own.
    pub fn set_output(&mut self, name: &str, source: Option<&Source>) -> Result<(), Problems> {
        match self.base {
            Some(_) => self.output_in_change(name, source),
            None => self.put_output(name, source),
        }
    }

    /// Sets or removes an output in the file's own list.
    pub(super) fn put_output(&mut self, name: &str, source: Option<&Source>) -> Result<(), Problems> {
        match source {
            Some(source) => self.put_top("outputs", name, &quoted(&source.to_string())),
            None => self.remove_top("outputs", name).map(drop),
        }
    }

    /// Sets an item of a block of the graph, and adds the block if a graph with a base lacks it.
    pub(super) fn put_top(&mut self, field: &'static str, name: &str, value: &str) -> Result<(), Problems> {
        match self.top(field) {
            Ok(block) => {
                let index = find(&self.text, &block, name);
                self.apply(put(&self.text, &block, index, value, || format!("{}: {value}", quoted(name))))
            }
            Err(_) => self.insert_top(field, &format!("{}: {value}", quoted(name))),
        }
    }

    /// Adds an item to a block of the graph, and the block if a graph with a base lacks it.
    pub(super) fn insert_top(&mut self, field: &'static str, item: &str) -> Result<(), Problems> {
        let changes = match self.top(field) {
            Ok(block) => insert(&self.text, &block, item),
            Err(problems) => match self.root().filter(|_| self.base.is_some()) {
                Some(root) => insert(&self.text, &root, &format!("{field}: {{ {item} }}")),
                None => return Err(problems),
            },
        };
        self.apply(changes)
    }

    /// Removes an item of a block of the graph; returns whether it existed.
    pub(super) fn remove_top(&mut self, field: &'static str, name: &str) -> Result<bool, Problems> {
        let Ok(block) = self.top(field) else { return Ok(false) };
        let Some(index) = find(&self.text, &block, name) else { return Ok(false) };
        self.apply(remove(&self.text, &block, index))?;
        Ok(true)
    }

    /// Sets a parameter in the `set` of a graph with a base.
    pub(super) fn put_set(&mut self, node: &str, param: &str, value: &str) -> Result<(), Problems> {
        let item = || Group::Params.item(param, value);
        match self.top("set").ok().and_then(|set| child(&self.text, &set, node)) {
            Some(params) => {
                self.apply(put(&self.text, &params, find(&self.text, &params, param), value, item))
            }
            None => self.insert_top("set", &format!("{}: ({})", quoted(node), item())),
        }
    }

    /// Removes a parameter from the `set` of a graph with a base; returns whether it existed.
    pub(super) fn remove_set(&mut self, node: &str, param: &str) -> Result<bool, Problems> {
        let params = self.top("set").ok().filter(|_| self.base.is_some());
        let params = params.and_then(|set| child(&self.text, &set, node));
        let found = params.and_then(|params| find(&self.text, &params, param).map(|index| (params, index)));
        let Some((params, index)) = found else { return Ok(false) };
        if params.items.len() == 1 {
            return self.remove_top("set", node);
        }
        self.apply(remove(&self.text, &params, index))?;
        Ok(true)
    }

    fn set_field(&mut self, node: &str, field: &str, value: Option<String>) -> Result<(), Problems> {
        if self.home(node) == Home::Base {
            let mut edited = self.clone();
            edited.define_anew(node, field)?;
            edited.set_field(node, field, value)?;
            *self = edited;
            return Ok(());
        }
        let block = self.node_block(node)?;
        let index = find(&self.text, &block, field);
        let changes = match value {
            Some(value) => put(&self.text, &block, index, &value, || format!("{field}: {value}")),
            None => index.map(|index| remove(&self.text, &block, index)).unwrap_or_default(),
        };
        self.apply(changes)
    }

    fn set_in(&mut self, node: &str, group: Group, name: &str, value: &str) -> Result<(), Problems> {
        let node = self.node_block(node)?;
        let item = || group.item(name, value);
        let changes = match child(&self.text, &node, group.name()) {
            Some(block) => put(&self.text, &block, find(&self.text, &block, name), value, item),
            None => insert(&self.text, &node, &group.field(&item())),
        };
        self.apply(changes)
    }

    /// Removes an item; returns whether it existed.
    fn remove_in(&mut self, node: &str, group: Group, name: &str) -> Result<bool, Problems> {
        let node = self.node_block(node)?;
        let block = child(&self.text, &node, group.name());
        let Some((block, index)) =
            block.and_then(|block| find(&self.text, &block, name).map(|index| (block, index)))
        else {
            return Ok(false);
        };
        self.apply(remove(&self.text, &block, index))?;
        Ok(true)
    }

    /// The brackets around everything.
    fn root(&self) -> Option<Block> {
        scan::root(&self.text).and_then(|root| scan::block(&self.text, root))
    }

    /// A block of the graph itself.
    pub(super) fn top(&self, field: &'static str) -> Result<Block, Problems> {
        let block = self.root().and_then(|root| child(&self.text, &root, field));
        block.ok_or_else(|| Problem::new(GraphError::Syntax(format!("`{field}` is missing"))).into())
    }

    /// The range of the text that defines a node, from its name to its closing bracket; or for a node of the base, that
    /// defines it anew, or sets its parameters.
    pub fn node_span(&self, name: &str) -> Option<Span> {
        ["nodes", "replace", "set"].into_iter().find_map(|field| {
            let block = self.top(field).ok()?;
            let item = &block.items[find(&self.text, &block, name)?];
            Some(Span { start: item.start(), end: item.value.end })
        })
    }

    /// The brackets around the definition of a node that stands in this file.
    fn node_block(&self, name: &str) -> Result<Block, Problems> {
        let block = |field| child(&self.text, &self.top(field).ok()?, name);
        let block = block("nodes").or_else(|| block("replace"));
        block.ok_or_else(|| Problem::new(self.no_node(name)).into())
    }

    /// Applies the changes, which must not overlap, and parses the result.
    fn apply(&mut self, mut changes: Vec<Change>) -> Result<(), Problems> {
        changes.sort_by_key(|change| change.span.start);
        let mut text = String::with_capacity(self.text.len());
        let mut done = 0;
        for change in changes {
            text.push_str(&self.text[done..change.span.start]);
            text.push_str(&change.text);
            done = change.span.end;
        }
        text.push_str(&self.text[done..]);
        let mut parsed = Self::parse(&self.path, &text)?;
        parsed.origin = self.origin;
        parsed.parts = mem::take(&mut self.parts);
        if let (Some(changes), Some(before)) = (&mut parsed.base, self.base.take()) {
            (changes.graph, changes.parts) = (before.graph, before.parts);
        }
        *self = parsed;
        Ok(())
    }
}

/// The rest of the address that a wire reads, after the name of a node: empty for the node itself, `/NODE` for one
/// within it. `None` if the wire reads another node.
fn within<'s>(source: &'s Source, node: &str) -> Option<&'s str> {
    source.node.strip_prefix(node).filter(|inner| inner.is_empty() || inner.starts_with('/'))
}

/// Another default for a parameter of a base. A choice is read only with its names.
fn default_of_base(spec: &ParamSpec, value: &str) -> String {
    match &spec.kind {
        ParamKind::Choice(names) => format!("(default: {value}, choices: [{}])", names.join(", ")),
        _ => format!("(default: {value})"),
    }
}

/// The one RON value in a text, without comments around it, which could swallow the text after it.
pub(super) fn one_value<'v>(param: &str, text: &'v str) -> Result<&'v str, GraphError> {
    if let Err(error) = ron::from_str::<IgnoredAny>(text) {
        return Err(GraphError::Value {
            name: param.to_owned(),
            expected: "a RON value, such as 8, 0.5, true or a name".into(),
            cause: error.code.to_string(),
        });
    }
    let span = scan::root(text).unwrap_or_default();
    Ok(&text[span.start..span.end])
}

/// A RON string. Rust's escapes used here are valid in RON.
pub(super) fn quoted(text: &str) -> String {
    format!("{text:?}")
}

/// Index of the item with this name.
fn find(text: &str, block: &Block, name: &str) -> Option<usize> {
    block.items.iter().position(|item| {
        item.key.is_some_and(|key| {
            let key = &text[key.start..key.end];
            match ron::from_str::<String>(key) {
                Ok(string) => string == name,
                Err(_) => key.strip_prefix("r#").unwrap_or(key) == name,
            }
        })
    })
}

/// The block that is the value of the item with this name.
fn child(text: &str, block: &Block, name: &str) -> Option<Block> {
    scan::block(text, block.items[find(text, block, name)?].value)
}

/// Sets the value of the item at `index`, or adds `item`.
fn put(
    text: &str,
    block: &Block,
    index: Option<usize>,
    value: &str,
    item: impl FnOnce() -> String,
) -> Vec<Change> {
    match index {
        Some(index) => vec![Change::replace(block.items[index].value, value)],
        None => insert(text, block, &item()),
    }
}

/// Adds `item` at the end of the block.
fn insert(text: &str, block: &Block, item: &str) -> Vec<Change> {
    let last = block.items.last();
    let closing = line_start(text, block.close);
    if closing > block.open && is_blank(&text[closing..block.close]) {
        let indent = match last.and_then(|last| indent(text, last.start())) {
            Some(indent) => indent.to_owned(),
            None => format!("{}{INDENT}", &text[closing..block.close]),
        };
        let newline = if text[..closing].ends_with("\r\n") { "\r\n" } else { "\n" };
        let (separator, comma) = match last {
            Some(Item { comma: None, value, .. }) => (Some(Change::insert(value.end, ",")), ""),
            _ => (None, ","),
        };
        let line = Change::insert(closing, format!("{indent}{item}{comma}{newline}"));
        return separator.into_iter().chain([line]).collect();
    }
    let start = block.open + 1;
    let inner = &text[start..block.close];
    let at = start + inner.trim_end().len();
    vec![match last {
        Some(Item { comma: None, .. }) => Change::insert(at, format!(", {item}")),
        Some(_) => Change::insert(at, format!(" {item},")),
        None if !is_blank(inner) => Change::insert(at, format!(" {item}")),
        None => {
            let pad = if text[block.open..].starts_with('{') { " " } else { "" };
            Change::replace(Span { start, end: block.close }, format!("{pad}{item}{pad}"))
        }
    }]
}

/// Removes an item with its comma and, if it is alone on its lines, the lines. Comments around it stay.
fn remove(text: &str, block: &Block, index: usize) -> Vec<Change> {
    let item = &block.items[index];
    let previous = index.checked_sub(1).map(|previous| &block.items[previous]);
    let is_last = index + 1 == block.items.len();

    let mut start = item.start();
    let mut end = item.value.end;
    let mut changes = Vec::new();
    match item.comma {
        Some(comma) if is_blank(&text[end..comma]) => end = comma + 1,
        Some(comma) => changes.push(Change::cut(comma, comma + 1)),
        None => {
            changes.extend(previous.and_then(|item| item.comma).map(|comma| Change::cut(comma, comma + 1)))
        }
    }

    let rest_of_line = text[end..].split_inclusive('\n').next().unwrap_or("");
    let ends_line = rest_of_line.ends_with('\n') && is_blank(rest_of_line);
    if ends_line && indent(text, start).is_some() {
        start = line_start(text, start);
        end += rest_of_line.len();
    } else if is_last && !ends_line {
        // Remove the space up to the preceding text, unless that is a comment: a line comment must keep its newline.
        let before =
            previous.map_or(block.open + 1, |item| item.comma.map_or(item.value.end, |comma| comma + 1));
        start = if is_blank(&text[before..start]) { before } else { start - space_before(text, start) };
        if previous.is_none() && is_blank(&text[end..block.close]) {
            end = block.close;
        }
    } else if ends_line {
        start -= space_before(text, start);
    } else {
        end += text[end..].len() - text[end..].trim_start_matches([' ', '\t']).len();
    }
    changes.push(Change::cut(start, end));
    changes
}

fn is_blank(text: &str) -> bool {
    text.trim().is_empty()
}

fn line_start(text: &str, at: usize) -> usize {
    text[..at].rfind('\n').map_or(0, |newline| newline + 1)
}

/// The space before `at` on its line, if nothing else is there.
fn indent(text: &str, at: usize) -> Option<&str> {
    Some(&text[line_start(text, at)..at]).filter(|before| is_blank(before))
}

/// Bytes of the space before `at`, on its line.
fn space_before(text: &str, at: usize) -> usize {
    text[..at].len() - text[..at].trim_end_matches([' ', '\t']).len()
}
