//! A graph written out in full: one file without a base, parts, parameters of its own and repeated nodes, whose nodes
//! have their addresses as names. It gives the same frames, bit for bit.

use std::{fmt::Write, path::Path};

use crate::{
    error::Problems,
    file::{GraphFile, InputDef, moved_path, names_file},
    graph::stages,
    registry::Registry,
};

impl GraphFile {
    /// The text of the graph in full, for a file at `path`: paths of shaders lead from there to where they led.
    ///
    /// # Errors
    /// All problems of the graph's changes, parts and stages. Wires are not checked.
    pub fn full(&self, registry: &Registry, path: &Path) -> Result<String, Problems> {
        let whole = self.whole()?;
        let flat = whole.flatten()?;
        let folder = path.parent().unwrap_or(Path::new(""));
        let mut text =
            format!("// {} in full.\nGraph(\n    version: {},\n", comment(&self.name()), self.version);
        if !whole.doc.is_empty() {
            line(&mut text, 1, &format!("doc: {:?},", whole.doc));
        }
        line(&mut text, 1, "nodes: {");
        for (node, stage) in flat.nodes.iter().zip(stages(&flat, registry)?) {
            let def = &node.def;
            line(&mut text, 2, &format!("{:?}: (", def.name.value));
            line(&mut text, 3, &format!("kind: {:?},", def.kind.value));
            // A default of the part holds for the nodes that can run there.
            let default = node.default.side.filter(|side| stage.declaration().runs_on(*side));
            if let Some(side) = def.on.as_ref().map(|on| on.value).or(default) {
                line(&mut text, 3, &format!("on: {side:?},"));
            }
            if let Some(download) = def.download.as_ref().map(|given| given.value).or(node.default.download) {
                line(&mut text, 3, &format!("download: {download:?},"));
            }
            if def.bypass {
                line(&mut text, 3, "bypass: true,");
            }
            // A node that has taken another's place need not take all of the other's wires.
            let takes = |input: &&InputDef| {
                let port = &input.port.value;
                let kept = def.replaced.as_ref().is_some_and(|replaced| replaced.kept.contains(port));
                let ports = &stage.declaration().ports;
                !kept || ports.iter().any(|known| known.name == *port && known.is_input())
            };
            let inputs: Vec<&InputDef> = def.inputs.iter().filter(takes).collect();
            if !inputs.is_empty() {
                line(&mut text, 3, "inputs: {");
                for input in inputs {
                    line(
                        &mut text,
                        4,
                        &format!("{:?}: {:?},", input.port.value, input.from.value.to_string()),
                    );
                }
                line(&mut text, 3, "},");
            }
            let params = def.params.iter().map(|param| {
                let value = &param.value;
                let from = node.places.get(&param.name.value).map_or(node.file, |places| places.value);
                let moved = names_file(&def.kind.value, &param.name.value)
                    .then(|| moved_path(&value.value, from.folder_at(value.span), folder))
                    .flatten();
                format!("{}: {}", param.name.value, moved.as_ref().unwrap_or(&value.value))
            });
            let params: Vec<String> = params.collect();
            if !params.is_empty() {
                line(&mut text, 3, &format!("params: ({}),", params.join(", ")));
            }
            line(&mut text, 2, "),");
        }
        line(&mut text, 1, "},");
        line(&mut text, 1, "outputs: {");
        for output in &flat.outputs {
            line(&mut text, 2, &format!("{:?}: {:?},", output.name.value, output.from.value.to_string()));
        }
        line(&mut text, 1, "},");
        text.push_str(")\n");
        Ok(text)
    }
}

fn line(text: &mut String, depth: usize, line: &str) {
    let _ = writeln!(text, "{}{line}", "    ".repeat(depth));
}

/// Words for a comment of one line.
fn comment(words: &str) -> String {
    words.split_whitespace().collect::<Vec<_>>().join(" ")
}
