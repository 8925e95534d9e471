//! Edits of a graph that changes another one. What concerns the base's nodes is written down as changes, in `replace`,
//! `rewire`, `set` and `outputs`; the base's own file stays as it is.

use std::{fmt, path::Path};

use super::{
    GraphFile, GraphParam, InputDef, NodeDef, ParamDef, RepeatDef, Source, edit::quoted, handed, moved_path,
    names_file,
};
use crate::error::{GraphError, Problem, Problems, Span};

/// Where the definition of a node stands.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Home {
    /// In the file's own `nodes`, or in a part of one of those.
    Own,
    /// In the file's `replace`.
    Replaced,
    /// In the base.
    Base,
}

/// What a graph changes in a node of its base, in an output, or in a parameter of the graph.
#[derive(Clone, Debug, PartialEq)]
pub struct Difference {
    /// The node's address; `outputs` for an output, empty for a parameter of the graph.
    pub node: String,
    /// The change.
    pub what: Changed,
    /// Its place in the text.
    pub span: Span,
}

/// A kind of change. Its text says it in words.
#[derive(Clone, Debug, PartialEq)]
pub enum Changed {
    /// The node is new.
    Added,
    /// The node has taken the place of another: this is what the other was.
    Replaced(String),
    /// An input, or an output of the graph, takes this port; `None` if it is disconnected.
    Wired(String, Option<Source>),
    /// A parameter has this value.
    Set(String, String),
    /// The graph has a new parameter, with this default.
    Offered(String, String),
}

impl fmt::Display for Changed {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Added => f.write_str("added"),
            Self::Replaced(old) => write!(f, "in the place of {old}"),
            Self::Wired(port, Some(from)) => write!(f, "{port} takes {from}"),
            Self::Wired(port, None) => write!(f, "{port} is disconnected"),
            Self::Set(param, value) => write!(f, "{param}: {value}"),
            Self::Offered(param, value) => write!(f, "new parameter {param}: {value}"),
        }
    }
}

impl GraphFile {
    /// What this graph changes in its base, by kind of change; nothing if it has no base.
    pub fn differences(&self) -> Vec<Difference> {
        let Some(changes) = &self.base else { return Vec::new() };
        let base = changes.graph.as_ref().and_then(|base| base.whole().ok());
        let mut found = Vec::new();
        let mut add = |node: &str, what, span| found.push(Difference { node: node.to_owned(), what, span });
        for GraphParam { name, default, .. } in &self.params {
            let known = base.as_ref().is_some_and(|base| base.param(&name.value).is_some());
            let change = if known { Changed::Set } else { Changed::Offered };
            add("", change(name.value.clone(), default.value.clone()), name.span);
        }
        for node in &changes.replace {
            let old = base.as_ref().and_then(|base| base.node_at(&node.name.value));
            let old = old.map_or_else(|| "a node".to_owned(), |(old, _)| old.what());
            add(&node.name.value, Changed::Replaced(old), node.name.span);
        }
        for node in &self.nodes {
            add(&node.name.value, Changed::Added, node.name.span);
        }
        for wire in &changes.rewire {
            let Source { node, port } = &wire.to.value;
            add(node, Changed::Wired(port.clone(), wire.from.value.clone()), wire.to.span);
        }
        for (node, params) in &changes.set {
            for param in params {
                let what = Changed::Set(param.name.value.clone(), param.value.value.clone());
                add(&node.value, what, param.name.span);
            }
        }
        for output in &self.outputs {
            let what = Changed::Wired(output.name.value.clone(), Some(output.from.value.clone()));
            add("outputs", what, output.name.span);
        }
        found
    }

    /// Takes back what this graph changes in a node of its base: another definition, wires and parameters.
    ///
    /// # Errors
    /// None of its own.
    pub fn restore_node(&mut self, address: &str) -> Result<(), Problems> {
        let mut edited = self.clone();
        edited.remove_top("replace", address)?;
        edited.remove_top("set", address)?;
        for wire in self.base.iter().flat_map(|changes| &changes.rewire) {
            if wire.to.value.node == address {
                edited.remove_top("rewire", &wire.to.value.to_string())?;
            }
        }
        if let Some(changes) = &mut edited.base {
            changes.parts.retain(|(part, _)| part != address);
        }
        *self = edited;
        Ok(())
    }

    /// Takes back another default of a parameter of the base.
    ///
    /// # Errors
    /// [`GraphError::Unknown`] parameter; and the base has no such parameter, but nodes take it.
    pub fn restore_param(&mut self, name: &str) -> Result<(), Problems> {
        let known = self.params.iter().map(|param| &param.name.value);
        let unknown = GraphError::unknown("parameter of the graph", name, known);
        self.edit_changes(|edited| match edited.remove_top("params", name)? {
            true => Ok(()),
            false => Err(Problem::new(unknown).into()),
        })
    }

    /// Whether the `set` of a graph with a base sets a parameter of a node.
    pub(super) fn sets_of_base(&self, address: &str, param: &str) -> bool {
        let set = self.base.iter().flat_map(|changes| &changes.set);
        set.filter(|(node, _)| node.value == address)
            .flat_map(|(_, params)| params)
            .any(|known| known.name.value == param)
    }

    /// Where the definition of a node stands that edits concern.
    pub(super) fn home(&self, address: &str) -> Home {
        match &self.base {
            None => Home::Own,
            Some(_) if self.enter(address).is_some() => Home::Own,
            Some(changes) if changes.replace.iter().any(|node| node.name.value == address) => Home::Replaced,
            Some(_) => Home::Base,
        }
    }

    /// The address of a node by its own name, as of [`GraphFile::address_of`], in this graph with its base.
    pub(super) fn full_address(&self, node: &str) -> Result<String, Problems> {
        match self.base {
            Some(_) => Ok(self.whole()?.address_of(node)),
            None => Ok(self.address_of(node)),
        }
    }

    /// The base's name, for messages.
    fn base_name(&self) -> &str {
        self.base.as_ref().map_or("", |changes| &changes.base.value)
    }

    /// Reports a node that is not the file's own, which a change cannot treat in this way.
    pub(super) fn require_own(&self, address: &str, cannot: &str) -> Result<(), Problems> {
        if self.home(address) == Home::Own || self.whole()?.node_at(address).is_none() {
            return Ok(());
        }
        let text = format!("it is a node of the base, `{}`, and a change cannot {cannot}", self.base_name());
        Err(Problem::new(GraphError::Invalid(text)).node(address).into())
    }

    /// Makes the edits on a copy, and keeps them if the changes still fit the base.
    fn edit_changes(&mut self, edit: impl FnOnce(&mut Self) -> Result<(), Problems>) -> Result<(), Problems> {
        let mut edited = self.clone();
        edit(&mut edited)?;
        edited.whole()?;
        *self = edited;
        Ok(())
    }

    /// Sets a parameter of a node of the base.
    pub(super) fn set_of_base(&mut self, address: &str, param: &str, value: &str) -> Result<(), Problems> {
        self.edit_changes(|edited| edited.put_set(address, param, value))
    }

    /// Connects an input of any node: where the node is defined if that is this file, else in `rewire`.
    pub(super) fn connect_in_change(
        &mut self,
        node: &str,
        port: &str,
        source: Option<&Source>,
    ) -> Result<(), Problems> {
        let to = Source { node: node.to_owned(), port: port.to_owned() };
        let own = self.home(node) != Home::Base;
        self.edit_changes(|edited| {
            edited.remove_top("rewire", &to.to_string())?;
            let written = |file: &Self| {
                let replaced = file.base.iter().flat_map(|changes| &changes.replace);
                let mut nodes = file.nodes.iter().chain(replaced);
                let node = nodes.find(|known| known.name.value == node);
                node.is_some_and(|node| node.inputs.iter().any(|input| input.port.value == port))
            };
            let is_new = edited.node(node).is_some();
            if own && (is_new || written(edited)) {
                edited.connect(node, port, source)?;
            }
            if edited.whole()?.wire_into(node, port).as_ref() == source {
                return Ok(());
            }
            let value = source.map_or("None".into(), |source| quoted(&source.to_string()));
            edited.put_top("rewire", &to.to_string(), &value)
        })
    }

    /// Connects an output of the graph, or removes one of its own.
    pub(super) fn output_in_change(&mut self, name: &str, source: Option<&Source>) -> Result<(), Problems> {
        let base = self.base_name().to_owned();
        self.edit_changes(|edited| {
            edited.remove_top("rewire", &format!("outputs.{name}"))?;
            edited.put_output(name, None)?;
            let given = edited.whole()?.wire_into("outputs", name);
            match (given, source) {
                (given, source) if given.as_ref() == source => Ok(()),
                (_, Some(_)) => edited.put_output(name, source),
                (_, None) => {
                    let text = format!(
                        "`{name}` is an output of the base, `{base}`, and a change cannot remove it; connect it to \
                         another port"
                    );
                    Err(Problem::new(GraphError::Invalid(text)).port(name).into())
                }
            }
        })
    }

    /// Removes what reads a node, or a node in it, in the changes to the base.
    pub(super) fn remove_wires_from(&mut self, node: &str) -> Result<(), Problems> {
        let Some(changes) = self.base.clone() else { return Ok(()) };
        let reads = |source: &Source| {
            source.node.strip_prefix(node).is_some_and(|rest| rest.is_empty() || rest.starts_with('/'))
        };
        for new in &changes.replace {
            for input in new.inputs.iter().filter(|input| reads(&input.from.value)) {
                self.connect(&new.name.value, &input.port.value, None)?;
            }
        }
        for wire in &changes.rewire {
            if reads(&wire.to.value) || wire.from.value.as_ref().is_some_and(reads) {
                self.remove_top("rewire", &wire.to.value.to_string())?;
            }
        }
        for (address, _) in &changes.set {
            if reads(&Source { node: address.value.clone(), port: String::new() }) {
                self.remove_top("set", &address.value)?;
            }
        }
        Ok(())
    }

    /// Writes the definition of a node of the base into `replace`, so that `field` of it can be edited.
    pub(super) fn define_anew(&mut self, address: &str, field: &str) -> Result<(), Problems> {
        let whole = self.whole()?;
        let (node, _) = whole.node_at(address).ok_or_else(|| Problem::new(whole.no_node(address)))?;
        let text = match field {
            // A node of another kind has parameters of its own.
            "kind" => format!("(kind: {})", quoted(&node.kind.value)),
            _ => self.definition(address, None)?,
        };
        self.edit_changes(|edited| edited.insert_top("replace", &format!("{}: {text}", quoted(address))))
    }

    /// Adds a copy of a node of the base.
    pub(super) fn copy_of_base(&mut self, name: &str, copy: &str) -> Result<(), Problems> {
        let whole = self.whole()?.into_owned();
        let Some(node) = whole.node(name) else {
            let error = match whole.node_at(name) {
                Some(_) => GraphError::Invalid(format!(
                    "it is a node in a part of the base, `{}`, and a change cannot add nodes there",
                    self.base_name()
                )),
                None => whole.no_node(name),
            };
            return Err(Problem::new(error).node(name).into());
        };
        let part = whole.part(name).cloned();
        let text = self.definition(name, Some(node))?;
        self.insert_top("nodes", &format!("{}: {text}", quoted(copy)))?;
        self.parts.extend(part.map(|part| (copy.to_owned(), part)));
        Ok(())
    }

    /// The text of a node's definition as it is in the base, for this file. Wires and repetition, which a node that
    /// replaces another keeps, are those of `copied`.
    fn definition(&self, address: &str, copied: Option<&NodeDef>) -> Result<String, Problems> {
        let whole = match &self.base {
            Some(super::Changes { graph: Some(base), .. }) => base.whole()?,
            _ => self.whole()?,
        };
        let Some((node, _)) = whole.node_at(address) else {
            return Err(Problem::new(whole.no_node(address)).into());
        };
        let NodeDef { kind, on, download, bypass, .. } = node;
        let mut fields = vec![format!("kind: {}", quoted(&kind.value))];
        fields.extend(copied.and_then(|node| node.repeat.as_ref()).map(repeat_field));
        fields.extend(on.as_ref().map(|on| format!("on: {:?}", on.value)));
        fields.extend(download.as_ref().map(|download| format!("download: {:?}", download.value)));
        fields.extend(bypass.then(|| "bypass: true".to_owned()));
        let wire = |input: &InputDef| {
            format!("{}: {}", quoted(&input.port.value), quoted(&input.from.value.to_string()))
        };
        let wires: Vec<String> = copied.iter().flat_map(|node| &node.inputs).map(wire).collect();
        fields.extend((!wires.is_empty()).then(|| format!("inputs: {{ {} }}", wires.join(", "))));
        let text = |param: &ParamDef, names: bool, folder: &Path| {
            let ParamDef { name, value } = param;
            let path = names.then(|| moved_path(&value.value, folder, self.folder())).flatten();
            format!("{}: {}", name.value, path.as_deref().unwrap_or(&value.value))
        };
        let as_written = |param: &ParamDef, kind: &str| {
            text(param, names_file(kind, &param.name.value), whole.folder_at(param.value.span))
        };
        let is_own = whole.node(address).is_some();
        let params: Vec<String> = if is_own {
            node.params.iter().map(|param| as_written(param, &kind.value)).collect()
        } else {
            // What the part hands to the node has no name here: its value is written.
            let flat = whole.flatten()?;
            let counted = node.repeat.as_ref().and_then(|repeat| repeat.count.as_ref());
            let flat = flat.nodes.iter().find(|flat| flat.written == address);
            let params = flat.into_iter().flat_map(|flat| &flat.def.params);
            let params =
                params.filter(|param| counted.is_none_or(|counted| counted.value != param.name.value));
            let written = params.map(|param| {
                let name = &param.name.value;
                let from = flat.and_then(|flat| flat.places.get(name)).map(|places| places.value);
                let file = from.or(flat.map(|flat| flat.file)).unwrap_or(&whole);
                text(param, names_file(&kind.value, name), file.folder_at(param.value.span))
            });
            written.collect()
        };
        fields.extend((!params.is_empty()).then(|| format!("params: ({})", params.join(", "))));
        let mut set = Vec::new();
        for (inner, params) in &node.set {
            if !is_own && params.iter().any(|param| handed(&param.value.value).is_some()) {
                let text = "its copies take parameters of its part, which have no name outside; edit the part's file";
                return Err(Problem::new(GraphError::Invalid(text.into())).node(address).into());
            }
            let params: Vec<String> = params.iter().map(|param| as_written(param, SHADER_KIND)).collect();
            set.push(format!("{}: ({})", quoted(&inner.value), params.join(", ")));
        }
        fields.extend((!set.is_empty()).then(|| format!("set: {{ {} }}", set.join(", "))));
        Ok(format!("({})", fields.join(", ")))
    }
}

/// The kind of node whose files may be set for it elsewhere: the file of a part may not.
const SHADER_KIND: &str = "wgsl";

fn repeat_field(repeat: &RepeatDef) -> String {
    let through = repeat.through.iter();
    let through: Vec<String> = through
        .map(|(input, output)| format!("{}: {}", quoted(&input.value), quoted(&output.value)))
        .collect();
    let count =
        repeat.count.as_ref().map_or(String::new(), |count| format!(", count: {}", quoted(&count.value)));
    format!("repeat: (times: {}, through: {{ {} }}{count})", repeat.times.value, through.join(", "))
}
