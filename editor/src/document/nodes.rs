//! The canvas's edits of several nodes at once. Nodes are given by address; all nodes of an edit belong to the same
//! file, the graph or a part.

use std::collections::BTreeMap;

use epigraph_core::{GraphError, GraphFile, Problem, Problems, Source};

use super::{INPUTS, home};

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

/// The address of a node's part, as of [`part_of`], and the rest of its address. Unlike [`split`], it is right for names
/// that contain slashes, as in a graph that was written out in full. The graph must have no base.
pub fn place<'a>(file: &GraphFile, address: &'a str) -> (&'a str, &'a str) {
    let part = part_of(file, address);
    (part, inside(address, part))
}

/// The rest of an address within a part.
fn inside<'a>(address: &'a str, part: &str) -> &'a str {
    within(address, part).filter(|_| !part.is_empty()).map_or(address, |inner| inner.trim_start_matches('/'))
}

/// The rest of an address after that of `node`: empty for the node itself, `/...` for nodes in it, `None` for others.
pub fn within<'a>(address: &'a str, node: &str) -> Option<&'a str> {
    address.strip_prefix(node).filter(|inner| inner.is_empty() || inner.starts_with('/'))
}

/// The address of a node with this part (empty for the graph itself) and name.
pub fn join(part: &str, name: &str) -> String {
    if part.is_empty() { name.to_owned() } else { format!("{part}/{name}") }
}

/// The graph, or the part at this address, of a graph without a base.
pub fn scope<'f>(file: &'f GraphFile, part: &str) -> Option<&'f GraphFile> {
    part.split('/')
        .filter(|name| !name.is_empty())
        .try_fold(file, |file, name| file.parts.iter().find(|(part, _)| part == name).map(|(_, part)| part))
}

/// The graph, or the part at this address, to add nodes to.
///
/// # Errors
/// [`GraphError::Unknown`] part, or the part belongs to the base.
fn scope_mut<'f>(file: &'f mut GraphFile, part: &str) -> Result<&'f mut GraphFile, Problems> {
    // `home` returns the file of any name in the part, even an empty one.
    let within = if part.is_empty() { String::new() } else { join(part, "") };
    let (file, name) = home(file, &within)?;
    if name.is_empty() {
        return Ok(file);
    }
    let text = "this part belongs to the base, and a change cannot add nodes to it; add them to the graph itself, or \
                replace the file of the part";
    Err(Problem::new(GraphError::Invalid(text.into())).node(part).into())
}

/// Connects an input of a node, or an output, in the graph or in the part at this address; `None` disconnects. `source`
/// is a port by its name in that file.
///
/// # Errors
/// Those of core's edits, or a change to a base cannot express the connection.
pub fn connect(file: &mut GraphFile, part: &str, to: End, source: Option<&Source>) -> Result<(), Problems> {
    let whole = file.whole()?.into_owned();
    let (node, port) = match to {
        End::Input(node, port) => (Some(node), port),
        End::Output(port) => (None, port),
    };
    let within = join(part, node.unwrap_or_default());
    let (file, name) = home(file, &within)?;
    if !file.is_change() || part.is_empty() {
        return match node {
            Some(_) => file.set_input(name, port, source),
            None => file.set_output(port, source),
        };
    }
    let refuse = |text: &str| Problems::from(Problem::new(GraphError::Invalid(text.into())).node(part));
    let node =
        node.ok_or_else(|| refuse("this part belongs to the base, and a change cannot connect its outputs"))?;
    let source = source.map(|source| match source.node.as_str() {
        INPUTS => whole
            .wire_into(part, &source.port)
            .ok_or_else(|| refuse("this input of the part is not connected")),
        name => Ok(Source { node: join(part, name), port: source.port.clone() }),
    });
    file.set_input(&join(part, node), port, source.transpose()?.as_ref())
}

/// Where a wire ends.
#[derive(Clone, Copy)]
pub enum End<'a> {
    /// At an input: the node's name and the port.
    Input(&'a str, &'a str),
    /// At an output of the graph or part.
    Output(&'a str),
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
    let name = free_name(scope(&*file.whole()?, part).unwrap_or(file), kind);
    scope_mut(file, part)?.add_node(&name, kind)?;
    Ok(join(part, &name))
}

/// Copies nodes with their parameters and wires; wires between them become wires between the copies. Returns the
/// copies' addresses, in the order of `addresses`.
///
/// # Errors
/// Those of core's edits.
pub fn duplicate(file: &mut GraphFile, addresses: &[String]) -> Result<Vec<String>, Problems> {
    let Some(first) = addresses.first() else { return Ok(Vec::new()) };
    let part = part_of(&*file.whole()?, first);
    let mut copies: BTreeMap<&str, String> = BTreeMap::new();
    for address in addresses {
        let name = inside(address, part);
        let copy = free_name(scope(&*file.whole()?, part).unwrap_or(file), name);
        scope_mut(file, part)?.copy_node(name, &copy)?;
        copies.insert(name, copy);
    }
    let scope = scope_mut(file, part)?;
    for copy in copies.values() {
        let inputs = scope.node(copy).map(|node| node.inputs.clone()).unwrap_or_default();
        for input in inputs {
            let from = &input.from.value;
            let of_copy =
                |(name, copy): (&&str, &String)| Some(format!("{copy}{}", within(&from.node, name)?));
            let Some(node) = copies.iter().find_map(of_copy) else { continue };
            let source = Source { node, port: from.port.clone() };
            scope.set_input(copy, &input.port.value, Some(&source))?;
        }
    }
    Ok(addresses.iter().filter_map(|address| Some(join(part, copies.get(inside(address, part))?))).collect())
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
    let (part, old) = place(&*file.whole()?, address);
    if let Some(place) = mention(file, part, old) {
        let text = format!("{place} refers to it by name and would no longer find it");
        return Err(Problem::new(GraphError::Invalid(text)).node(address).into());
    }
    let renamed = join(part, name);
    let (file, old) = home(file, address)?;
    file.rename_node(old, name)?;
    Ok(renamed)
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
