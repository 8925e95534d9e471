//! Parameters of nodes in the graph or in its parts, by address.

use epigraph_core::{GraphError, GraphFile, Problem, Problems};

/// The value of a parameter, as text: the one that an outer graph sets for a node of a part, else the node's own.
/// `None` if the stage's default applies.
pub fn param_text<'f>(file: &'f GraphFile, address: &str, param: &str) -> Option<&'f str> {
    let Some((part, inner)) = address.split_once('/') else {
        let params = &file.node(address)?.params;
        return params.iter().find(|def| def.name.value == param).map(|def| def.value.value.as_str());
    };
    if let Some(text) = set_text(file, part, inner, param) {
        return Some(text);
    }
    let (_, part) = file.parts.iter().find(|(name, _)| name == part)?;
    param_text(part, inner, param)
}

fn set_text<'f>(file: &'f GraphFile, part: &str, inner: &str, param: &str) -> Option<&'f str> {
    let set = file.node(part)?.set.iter().find(|(node, _)| node.value == inner);
    let (_, params) = set?;
    params.iter().find(|def| def.name.value == param).map(|def| def.value.value.as_str())
}

/// The file that contains a node, the graph or a part, and the node's name in it.
///
/// # Errors
/// [`GraphError::Unknown`] part.
pub fn home<'f, 'a>(
    file: &'f mut GraphFile,
    address: &'a str,
) -> Result<(&'f mut GraphFile, &'a str), Problems> {
    let Some((name, inner)) = address.split_once('/') else { return Ok((file, address)) };
    let Some(index) = file.parts.iter().position(|(part, _)| part == name) else {
        let known = file.parts.iter().map(|(part, _)| part);
        return Err(Problem::new(GraphError::unknown("part", name, known)).into());
    };
    home(&mut file.parts[index].1, inner)
}

/// Resets a parameter to the stage's default: removes it from the node, or if an outer graph sets it for a node of a
/// part, sets it to `default` there.
///
/// # Errors
/// Those of [`GraphFile::remove_param`] and [`GraphFile::set_param`].
pub fn remove_param(file: &mut GraphFile, address: &str, param: &str, default: &str) -> Result<(), Problems> {
    if let Some((part, inner)) = address.split_once('/') {
        if set_text(file, part, inner, param).is_some() {
            return file.set_param(address, param, default);
        }
        if let Some((_, part)) = file.parts.iter_mut().find(|(name, _)| name == part) {
            return remove_param(part, inner, param, default);
        }
    }
    file.remove_param(address, param)
}
