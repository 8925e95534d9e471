//! Which other value of a parameter would make a wire fit: messages name it.

use super::{Checker, stage};
use crate::{
    error::{Span, Spanned},
    file::{NodeDef, ParamDef},
    id::FlatId,
    params::{ParamKind, ParamSpec},
    port::Port,
};

impl Checker<'_> {
    /// Settings of a node, each of one parameter (`NODE.PARAM=VALUE`), with which its ports would fit: of parameters that are
    /// choices or switches.
    pub(super) fn remedies(&self, node: FlatId, fits: impl Fn(&[Port]) -> bool) -> Vec<String> {
        let flat = &self.flat.nodes[node];
        let Some(kind) = self.registry.get(&flat.def.kind.value) else { return Vec::new() };
        let connected = |name: &str| flat.def.inputs.iter().any(|input| input.port.value == name);
        let remedy = |spec: ParamSpec| {
            let values = match &spec.kind {
                ParamKind::Choice(values) => values.clone(),
                ParamKind::Bool => ["false", "true"].map(String::from).to_vec(),
                _ => return None,
            };
            let is_remedy = |value: &&String| {
                let def = with_param(&flat.def, &spec.name, value);
                let changed = stage(flat, &def, self.registry, &connected);
                changed.is_ok_and(|stage| fits(&stage.declaration().ports))
            };
            let value = values.iter().find(is_remedy)?;
            Some(format!("{}.{}={value}", flat.def.name.value, spec.name))
        };
        kind.specs().into_iter().filter_map(remedy).collect()
    }

    /// Settings of a node that give it the values of another node where both have a parameter of one name: both ends of a wire
    /// may have to agree on it.
    pub(super) fn alike(&self, node: FlatId, other: FlatId) -> Vec<String> {
        let [node, other] = [node, other].map(|node| &self.flat.nodes[node].def);
        let value = |of: &NodeDef, name: &str| {
            let written = of.params.iter().find(|param| param.name.value == name);
            written.map(|param| param.value.value.clone())
        };
        let defaults =
            |of: &NodeDef| self.registry.get(&of.kind.value).map_or(Vec::new(), |kind| kind.specs());
        let theirs = defaults(other);
        let differing = defaults(node).into_iter().filter_map(|spec| {
            let other_spec = theirs.iter().find(|other| other.name == spec.name)?;
            let here = value(node, &spec.name).unwrap_or(spec.default);
            let there = value(other, &spec.name).unwrap_or_else(|| other_spec.default.clone());
            (here != there).then(|| format!("{}.{}={there}", node.name.value, spec.name))
        });
        differing.collect()
    }
}

/// The end of a message that names settings as remedies; nothing if there are none.
pub(super) fn or_set(settings: &[String]) -> String {
    match settings {
        [] => String::new(),
        settings => format!("; it would fit with {}", settings.join(" or ")),
    }
}

/// The node with another value of a parameter.
fn with_param(node: &NodeDef, name: &str, value: &str) -> NodeDef {
    let mut node = node.clone();
    node.params.retain(|param| param.name.value != name);
    let spanned = |value: &str| Spanned { value: value.to_owned(), span: Span::default() };
    node.params.push(ParamDef { name: spanned(name), value: spanned(value) });
    node
}
