//! Positions of the canvas's boxes. They are saved in a file beside the graph, `NAME.layout.ron`, so that the graph
//! file holds only what affects its pictures.

use std::{
    collections::BTreeMap,
    fmt::Write,
    io,
    path::{Path, PathBuf},
};

use epigraph_core::GraphFile;
use serde::Deserialize;

use super::nodes;

/// The name of the box for a part's inputs, within the part's address. No node can have this name.
pub const INPUTS_BOX: &str = ".inputs";
/// The name of the box for the outputs of the graph or of a part. No node can have this name.
pub const OUTPUTS_BOX: &str = ".outputs";

/// Top left corners of boxes in points of the canvas, by the nodes' addresses.
pub type Places = BTreeMap<String, [f32; 2]>;

/// The only version of the format so far.
const VERSION: u32 = 1;

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Layout {
    version: u32,
    nodes: Places,
}

/// The path of a graph's layout.
pub fn layout_path(graph: &str) -> PathBuf {
    Path::new(graph).with_extension("layout.ron")
}

/// Reads the layout of a graph, and its text; empty if there is no such file.
///
/// # Errors
/// The reason why the file cannot be used, as text for the user.
pub fn read(graph: &str) -> Result<(Option<String>, Places), String> {
    let path = layout_path(graph);
    let name = path.display().to_string();
    match epigraph_files::text(&path) {
        Ok(text) => parse(&name, &text).map(|places| (Some(text), places)),
        Err(error) if error.kind() == io::ErrorKind::NotFound => Ok((None, Places::new())),
        Err(error) => Err(unusable(&name, &error.to_string())),
    }
}

/// Reads the text of a layout.
///
/// # Errors
/// Those of [`read`].
pub fn parse(path: &str, text: &str) -> Result<Places, String> {
    let layout: Layout = ron::from_str(text).map_err(|error| unusable(path, &error.to_string()))?;
    if layout.version != VERSION {
        return Err(unusable(path, &format!("its version is {}, not {VERSION}", layout.version)));
    }
    if !are_finite(&layout.nodes) {
        return Err(unusable(path, "a position is not a finite number"));
    }
    Ok(layout.nodes)
}

fn unusable(path: &str, why: &str) -> String {
    format!("{path} cannot be used, so the boxes are arranged automatically: {why}")
}

/// True if all coordinates are finite.
pub fn are_finite(places: &Places) -> bool {
    places.values().flatten().all(|at| at.is_finite())
}

/// The text of a layout file. If `file` is given, only boxes that it still has are included.
pub fn write(places: &Places, file: Option<&GraphFile>) -> String {
    let is_there = |address: &str| file.is_none_or(|file| has_box(file, address));
    let mut text = format!(
        "// Where the editor shows the nodes of the graph beside this file.\nLayout(\n    version: {VERSION},\n    nodes: {{\n"
    );
    for (address, [x, y]) in places.iter().filter(|(address, _)| is_there(address)) {
        // Writing to a String cannot fail.
        let _ = writeln!(text, "        {address:?}: ({x:.0}, {y:.0}),");
    }
    text + "    },\n)\n"
}

/// True if the canvas shows a box with this address.
fn has_box(file: &GraphFile, address: &str) -> bool {
    match nodes::split(address) {
        ("", OUTPUTS_BOX) => true,
        (part, INPUTS_BOX | OUTPUTS_BOX) => file.node_at(part).is_some(),
        _ => file.node_at(address).is_some(),
    }
}

/// Moves the positions of a node, and of all nodes in it, to its new address.
pub fn rename(places: &mut Places, old: &str, new: &str) {
    let moved: Vec<String> =
        places.keys().filter(|address| nodes::within(address, old).is_some()).cloned().collect();
    for address in moved {
        if let (Some(place), Some(inner)) = (places.remove(&address), nodes::within(&address, old)) {
            places.insert(format!("{new}{inner}"), place);
        }
    }
}
