//! The canvas's edits of several nodes at once. Nodes are given by address; all nodes of an edit belong to the same
//! file, the graph or a part.

use std::collections::BTreeMap;

use epigraph_core::{GraphError, GraphFile, Problem, Problems, Source};

use super::home;

/// Splits a node's address into the address of its part (empty for the graph itself) and its name.
pub fn split(address: &str) -> (&str, &str) {
    address.rsplit_once('/').unwrap_or(("", address))
}

/// The address of the part in whose file a node is written, empty for the graph itself. All copies of a repeated node
/// are written as one, so that of `row/1` is that of `row`.
pub fn part_of<'a>(file: &GraphFile, address: &'a str) -> &'a str {
    let (mut file, mut part, mut inner) = (file, "", address);
    while let Some((node, _, Some(rest))) = file.enter(inner) {
        let Some((_, next)) = file.parts.iter().find(|(name, _)| *name == node.name.value) else { break };
        part = address[..address.len() - rest.len()].trim_end_matches('/');
        (file, inner) = (next, rest);
    }
    part
}

/// The rest of an address after that of `node`: empty for the node itself, `/...` for nodes in it, `None` for others.
pub fn within<'a>(address: &'a str, node: &str) -> Option<&'a str> {
    address.strip_prefix(node).filter(|inner| inner.is_empty() || inner.starts_with('/'))
}

/// The address of a node with this part (empty for the graph itself) and name.
pub fn join(part: &str, name: &str) -> String {
    if part.is_empty() { name.to_owned() } else { format!("{part}/{name}") }
}

/// The graph, or the part at this address.
pub fn scope<'f>(file: &'f GraphFile, part: &str) -> Option<&'f GraphFile> {
    part.split('/')
        .filter(|name| !name.is_empty())
        .try_fold(file, |file, name| file.parts.iter().find(|(part, _)| part == name).map(|(_, part)| part))
}

/// Like [`scope`], but mutable.
///
/// # Errors
/// [`GraphError::Unknown`] part.
pub fn scope_mut<'f>(file: &'f mut GraphFile, part: &str) -> Result<&'f mut GraphFile, Problems> {
    // `home` returns the file of any name in the part, even an empty one.
    let within = if part.is_empty() { String::new() } else { join(part, "") };
    home(file, &within).map(|(file, _)| file)
}

/// `wanted`, or if that is taken, the same with the first free number: `fill`, `fill2`, `fill3` ...
pub fn free_name(file: &GraphFile, wanted: &str) -> String {
    let stem = wanted.trim_end_matches(|letter: char| letter.is_ascii_digit());
    let stem = if stem.is_empty() { wanted } else { stem };
    let mut names = std::iter::once(wanted.to_owned()).chain((2..).map(|number| format!("{stem}{number}")));
    names.find(|name| file.node(name).is_none()).unwrap_or_default()
}

/// Adds a node after all others, with a free name. Returns its address.
///
/// # Errors
/// Those of core's edits.
pub fn add(file: &mut GraphFile, part: &str, kind: &str) -> Result<String, Problems> {
    let scope = scope_mut(file, part)?;
    let name = free_name(scope, kind);
    scope.add_node(&name, kind)?;
    Ok(join(part, &name))
}

/// Copies nodes with their parameters and wires; wires between them become wires between the copies. Returns the
/// copies' addresses, in the order of `addresses`.
///
/// # Errors
/// Those of core's edits.
pub fn duplicate(file: &mut GraphFile, addresses: &[String]) -> Result<Vec<String>, Problems> {
    let Some(part) = addresses.first().map(|address| split(address).0) else { return Ok(Vec::new()) };
    let scope = scope_mut(file, part)?;
    let mut copies: BTreeMap<&str, String> = BTreeMap::new();
    for address in addresses {
        let name = split(address).1;
        let copy = free_name(scope, name);
        scope.copy_node(name, &copy)?;
        copies.insert(name, copy);
    }
    for copy in copies.values() {
        let inputs = scope.node(copy).map(|node| node.inputs.clone()).unwrap_or_default();
        for input in inputs {
            let from = &input.from.value;
            let (node, inner) = from
                .node
                .split_once('/')
                .map_or((from.node.as_str(), None), |(node, inner)| (node, Some(inner)));
            let Some(node) = copies.get(node) else { continue };
            let node = inner.map_or(node.clone(), |inner| format!("{node}/{inner}"));
            let source = Source { node, port: from.port.clone() };
            scope.set_input(copy, &input.port.value, Some(&source))?;
        }
    }
    Ok(addresses.iter().filter_map(|address| Some(join(part, copies.get(split(address).1)?))).collect())
}

/// Removes nodes, and all wires and outputs that read from them.
///
/// # Errors
/// Those of core's edits.
pub fn remove(file: &mut GraphFile, addresses: &[String]) -> Result<(), Problems> {
    for address in addresses {
        let (file, name) = home(file, address)?;
        file.remove_node(name)?;
    }
    Ok(())
}

/// Sets whether nodes are bypassed.
///
/// # Errors
/// Those of core's edits.
pub fn bypass(file: &mut GraphFile, addresses: &[String], bypass: bool) -> Result<(), Problems> {
    for address in addresses {
        let (file, name) = home(file, address)?;
        file.set_bypass(name, bypass)?;
    }
    Ok(())
}

/// Renames a node. Returns its new address.
///
/// # Errors
/// Those of core's edits, or a graph that contains the node's part refers to the node by name.
pub fn rename(file: &mut GraphFile, address: &str, name: &str) -> Result<String, Problems> {
    let (part, old) = split(address);
    if let Some(place) = mention(file, part, old) {
        let text = format!("{place} refers to it by name and would no longer find it");
        return Err(Problem::new(GraphError::Invalid(text)).node(address).into());
    }
    scope_mut(file, part)?.rename_node(old, name)?;
    Ok(join(part, name))
}

/// The path of a graph that contains a part and refers to a node of it by name, in a wire or in a parameter that it
/// sets.
fn mention<'f>(file: &'f GraphFile, part: &str, name: &str) -> Option<&'f str> {
    let (outer, inner) = part.split_once('/').unwrap_or((part, ""));
    let node = file.node(outer).filter(|_| !part.is_empty())?;
    let called = join(inner, name);
    let is_it = |address: &str| within(address, &called).is_some();
    let inputs = file.nodes.iter().flat_map(|node| &node.inputs).map(|input| &input.from.value);
    let outputs = file.outputs.iter().map(|output| &output.from.value);
    let wired = inputs
        .chain(outputs)
        .any(|source| source.node.split_once('/').is_some_and(|(of, address)| of == outer && is_it(address)));
    if wired || node.set.iter().any(|(address, _)| is_it(&address.value)) {
        return Some(&file.path);
    }
    scope(file, outer).and_then(|file| mention(file, inner, name))
}
