//! Parameters of nodes in the graph or in its parts, by address.

use epigraph_core::{GraphError, GraphFile, NodeDef, ParamDef, Problem, Problems, handed};

/// The value of a parameter, as text: the one that an outer graph sets for a node of a part, or that is set for a copy of a
/// repeated node, else the node's own. `None` if the stage's default applies.
pub fn param_text<'f>(file: &'f GraphFile, address: &str, param: &str) -> Option<&'f str> {
    let (node, copy, rest) = file.enter(address)?;
    let within = address[node.name.value.len()..].trim_start_matches('/');
    // What is set for one copy comes before what is set for all of them.
    let set =
        set_text(node, within, param).or_else(|| set_text(node, rest.filter(|_| copy.is_some())?, param));
    set.or_else(|| match rest {
        None => text_of(&node.params, param),
        Some(rest) => {
            let (_, part) = file.parts.iter().find(|(name, _)| *name == node.name.value)?;
            param_text(part, rest, param)
        }
    })
}

fn text_of<'f>(params: &'f [ParamDef], param: &str) -> Option<&'f str> {
    params.iter().find(|def| def.name.value == param).map(|def| def.value.value.as_str())
}

/// The value that a node sets for a node within it, or for one of its copies.
fn set_text<'f>(node: &'f NodeDef, within: &str, param: &str) -> Option<&'f str> {
    let set = node.set.iter().find(|(address, _)| !within.is_empty() && address.value == within);
    text_of(&set?.1, param)
}

/// The file to edit for a node, the graph or a part, and the node's name in it. For a node of a base, that is the
/// changing graph and the node's address.
///
/// # Errors
/// [`GraphError::Unknown`] part.
pub fn home<'f, 'a>(
    file: &'f mut GraphFile,
    address: &'a str,
) -> Result<(&'f mut GraphFile, &'a str), Problems> {
    let Some((node, _, rest)) = file.enter(address) else {
        // A node of the base, or one that the edit reports as missing.
        return match address.split_once('/') {
            Some((name, _)) if !file.is_change() => Err(no_part(file, name)),
            _ => Ok((file, address)),
        };
    };
    // All copies of a repeated node stand there as one.
    let name = &address[..node.name.value.len()];
    let Some(rest) = rest else { return Ok((file, name)) };
    match file.parts.iter().position(|(part, _)| part == name) {
        Some(part) => home(&mut file.parts[part].1, rest),
        None => Err(no_part(file, name)),
    }
}

fn no_part(file: &GraphFile, name: &str) -> Problems {
    let known = file.parts.iter().map(|(part, _)| part);
    Problem::new(GraphError::unknown("part", name, known)).into()
}

/// Resets a parameter to its default: removes it from the node. If an outer graph sets it for a node of a part, sets it to
/// `default` there. If it is set over a parameter of the part's graph, or for a single copy of a repeated node, removes it
/// there, so that the value of all the others applies again. What a change to a base sets is removed, so that the base's
/// value applies again; if the base's own value is another than the default, the change sets the default.
///
/// # Errors
/// Those of [`GraphFile::remove_param`], [`GraphFile::unset_param`] and [`GraphFile::set_param`].
pub fn remove_param(file: &mut GraphFile, address: &str, param: &str, default: &str) -> Result<(), Problems> {
    if file.is_change() && file.remove_param(address, param).is_ok() {
        return Ok(());
    }
    let Some((node, copy, rest)) = file.enter(address) else {
        let differs = file.is_change()
            && param_text(&*file.whole()?, address, param).is_some_and(|text| text != default);
        return match differs {
            true => file.set_param(address, param, default),
            false => file.remove_param(address, param),
        };
    };
    let name = node.name.value.clone();
    let within = address[name.len()..].trim_start_matches('/');
    let part = file.parts.iter().position(|(part, _)| *part == name);
    if set_text(node, within, param).is_some() {
        let inner = part.zip(rest).and_then(|(part, rest)| param_text(&file.parts[part].1, rest, param));
        return match copy.is_some() || inner.is_some_and(|text| handed(text).is_some()) {
            true => file.unset_param(address, param),
            false => file.set_param(address, param, default),
        };
    }
    match (part, rest) {
        (Some(part), Some(rest)) => remove_param(&mut file.parts[part].1, rest, param, default),
        _ => file.remove_param(&name, param),
    }
}
