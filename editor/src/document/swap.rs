//! Replacing a node's stage by another.

use std::collections::BTreeSet;

use epigraph_core::{Access, GraphFile, Port, Problems, Registry, Source};

use super::home;

/// The stage kinds that can replace a node's kind: they have all of its outputs that are in use, with the same fields.
/// Empty if the node's kind declares no ports, as for parts.
pub fn fitting(file: &GraphFile, address: &str, registry: &Registry) -> Vec<&'static str> {
    let Some((node, within)) = file.node_at(address) else { return Vec::new() };
    let Some(present) = registry.get(&node.kind.value).and_then(|kind| kind.declaration()) else {
        return Vec::new();
    };
    let inputs = within.nodes.iter().flat_map(|node| &node.inputs).map(|input| &input.from.value);
    let outputs = within.outputs.iter().map(|output| &output.from.value);
    let used = inputs.chain(outputs).filter(|source| source.node == node.name.value);
    let used: BTreeSet<&str> = used.map(|source| source.port.as_str()).collect();
    let fits = |kind: &&dyn epigraph_core::Kind| {
        kind.declaration().is_some_and(|declared| {
            used.iter().all(|name| {
                let port = |of: &epigraph_core::Declaration| {
                    of.ports
                        .iter()
                        .find(|port| port.is_output() && port.name == *name)
                        .map(|port| port.fields.clone())
                };
                port(&present).is_some() && port(&present) == port(&declared)
            })
        })
    };
    registry.kinds().filter(fits).map(|kind| kind.name()).collect()
}

/// Changes the kind of a node. Wires and parameters that both kinds have stay as they are; the others are removed.
/// Required inputs that read the previous frame are wired to the node's own output, if exactly one fits.
///
/// # Errors
/// Those of core's edits.
pub fn swap(file: &mut GraphFile, address: &str, kind: &str, registry: &Registry) -> Result<(), Problems> {
    let (file, name) = home(file, address)?;
    file.set_kind(name, kind)?;
    let replaced = file.base.iter().flat_map(|changes| &changes.replace);
    let node = file.nodes.iter().chain(replaced).find(|node| node.name.value == name).cloned();
    let (Some(kind), Some(node)) = (registry.get(kind), node) else { return Ok(()) };
    let specs = kind.specs();
    for param in &node.params {
        if specs.iter().all(|spec| spec.name != param.name.value) {
            file.remove_param(name, &param.name.value)?;
        }
    }
    let Some(declared) = kind.declaration() else { return Ok(()) };
    for input in &node.inputs {
        let port = declared.ports.iter().find(|port| port.name == input.port.value);
        if !port.is_some_and(|port| port.is_input()) {
            file.set_input(name, &input.port.value, None)?;
        }
    }
    // A node that replaces one of a base keeps its wires.
    let whole = file.whole()?.into_owned();
    let wired = |port: &Port| whole.wire_into(name, &port.name).is_some();
    let needed = |port: &&Port| port.access == Access::History && !port.optional && !wired(port);
    for port in declared.ports.iter().filter(needed) {
        let mut fits = declared.ports.iter().filter(|own| own.is_output() && own.fields == port.fields);
        if let (Some(own), None) = (fits.next(), fits.next()) {
            let source = Source { node: name.to_owned(), port: own.name.to_string() };
            file.set_input(name, &port.name, Some(&source))?;
        }
    }
    Ok(())
}
