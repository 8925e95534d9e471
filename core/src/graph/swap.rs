//! What goes wrong because a node has taken the place of another: all differences of their ports come as one problem,
//! at the place of the new node, rather than one by one at wires that nobody has touched.

use std::collections::{BTreeMap, BTreeSet};

use super::Checker;
use crate::{
    error::{GraphError, Problem, Span},
    file::{GraphFile, Source, Swap},
    id::FlatId,
    port::Port,
};

/// Differences of ports in words, by the address of the new node.
#[derive(Default)]
pub(super) struct Differences(BTreeMap<String, BTreeSet<String>>);

/// Whether an address is that of a node or leads into it.
fn is_in(address: &str, node: &str) -> bool {
    address.strip_prefix(node).is_some_and(|rest| rest.is_empty() || rest.starts_with('/'))
}

impl Checker<'_> {
    /// The new node to which a port belongs that a wire takes, unless the wire lies within that node or is from the
    /// same file: it was then written for the new node.
    fn swap_behind(&self, source: &str, reader: Option<FlatId>, span: Span) -> Option<&str> {
        let file = reader.map_or(self.flat.file, |reader| self.flat.nodes[reader].file);
        let reader = reader.map_or("", |reader| &self.flat.nodes[reader].def.name.value);
        let fits = |(address, swap): &(&String, &Swap)| {
            is_in(source, address) && !is_in(reader, address) && swap.path() != file.path_at(span)
        };
        self.flat.swaps.iter().rev().find(fits).map(|(address, _)| address.as_str())
    }

    fn differ(&mut self, address: String, difference: String) {
        self.differences.0.entry(address).or_default().insert(difference);
    }

    /// Takes down that a new node lacks an output; false if that is no node's fault that has taken another's place.
    pub(super) fn lacks_output(
        &mut self,
        source: &Source,
        reader: Option<(FlatId, &str, Option<&Port>)>,
        output: &str,
        span: Span,
    ) -> bool {
        let Some(address) = self.swap_behind(&source.node, reader.map(|(index, ..)| index), span) else {
            return false;
        };
        let address = address.to_owned();
        let what = match source.node[address.len()..].strip_prefix('/') {
            Some(inner) => format!("{inner}.{}", source.port),
            None => source.port.clone(),
        };
        let by = match reader {
            Some((index, port, declared)) => {
                let taken = declared.map_or(String::new(), |port| format!(" as {}", super::describe(port)));
                format!("`{}.{port}` takes it{taken}", self.flat.nodes[index].def.name.value)
            }
            None => format!("the graph's output `{output}` is connected to it"),
        };
        self.differ(address, format!("the output `{what}` is missing: {by}"));
        true
    }

    /// Takes down that an input of a new node is not connected, or one of a node in a new part; false if that is no
    /// node's fault that has taken another's place.
    pub(super) fn lacks_input(&mut self, index: FlatId, port: &Port) -> bool {
        let node = &self.flat.nodes[index];
        let open = node.open.iter().find(|(own, _)| *own == port.name).map(|(_, source)| source.clone());
        let own = Source { node: node.def.name.value.clone(), port: port.name.to_string() };
        let at = open.unwrap_or(own);
        if !self.flat.swaps.contains_key(&at.node) {
            return false;
        }
        let name = &at.port;
        let (words, doc) = (super::describe(port), port.doc.trim_end_matches('.'));
        let text = format!("the input `{name}` ({words}: {doc}) is new and not connected");
        self.differ(at.node.clone(), text);
        true
    }

    /// Whether an input is one of the replaced node that the new node does not have.
    pub(super) fn is_kept(&self, index: FlatId, port: &str) -> bool {
        let replaced = self.flat.nodes[index].def.replaced.as_ref();
        replaced.is_some_and(|replaced| replaced.kept.iter().any(|kept| kept == port))
    }

    /// Takes down that a wire of the replaced node does not fit the new node; false if that is no node's fault that has
    /// taken another's place.
    pub(super) fn has_other_type(
        &mut self,
        index: FlatId,
        input: &Port,
        source: &Source,
        given: &Port,
    ) -> bool {
        let node = &self.flat.nodes[index].def;
        let (reader, port) = (&node.name.value, &input.name);
        let (given, taken) = (super::describe(given), super::describe(input));
        if self.is_kept(index, port) {
            let text = format!("the input `{port}` takes {taken}, but `{source}` gives {given}");
            self.differ(reader.clone(), text);
            return true;
        }
        let span = self.input_span(index, port);
        let Some(address) = self.swap_behind(&source.node, Some(index), span) else { return false };
        let text = format!("the output `{}` gives {given}, but `{reader}.{port}` takes {taken}", source.port);
        self.differ(address.to_owned(), text);
        true
    }

    /// Reports the differences, one problem for each new node, with what it does not take of the other.
    pub(super) fn report_differences(&mut self, has_input: impl Fn(&str, &str) -> bool) {
        for (address, found) in std::mem::take(&mut self.differences.0) {
            let swap = &self.flat.swaps[&address];
            let Some(replaced) = &swap.node.replaced else { continue };
            let mut differences: Vec<String> = found.into_iter().collect();
            let unknown =
                replaced.kept.iter().filter(|port| swap.part.is_none() && !has_input(&address, port));
            differences.extend(
                unknown
                    .chain(&replaced.dropped)
                    .map(|port| format!("the input `{port}` is not taken any more")),
            );
            let error = GraphError::Swap { new: swap.node.what(), old: replaced.what.clone(), differences };
            let problem = Problem::new(error).at(swap.file.place(swap.node.kind.span));
            self.problems.add(|| problem.node(&address));
        }
    }

    /// What to report of an output that a part does not have.
    pub(super) fn no_output(&self, source: &Source) -> Option<GraphError> {
        let part: &GraphFile = self.flat.swaps.get(&source.node)?.part?;
        let known = part.outputs.iter().map(|output| &output.name.value);
        Some(GraphError::unknown("output of a part", &source.port, known))
    }
}
