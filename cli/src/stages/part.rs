//! The kind `graph`, which stands for the nodes of another file, and graphs as such parts.

use epigraph_core::{GraphFile, ParamKind, ParamSpec, Port, Registry, Source};
use serde_json::{Value, json};

use super::{param_json, params};
use crate::table::Table;

/// What the kind does.
pub const DOC: &str = "Includes the nodes of another graph file, a part.";

const HELP: &str = "
ports: the part's own: its inputs, wherever it reads \"inputs.NAME\", and its outputs
parameters: the part's own, beside `file`. `epigraph stages FILE.ron` lists ports and parameters of a part

  \"view\": (
      kind: \"graph\",
      inputs: { \"cloud\": \"cloud.cloud\" },
      params: (file: \"parts/view.ron\"),
      set: { \"cull\": (threshold: 0.1) },   // a parameter of a node in it
  ),

Its nodes are `view/NODE` to others. `on` and `download` are the defaults of its nodes.
A graph has parameters of its own, `params: { \"sigma\": (default: 0.5) }`, which its nodes take by Param(\"sigma\").
";

/// The parameter that every node of the kind has.
pub fn file() -> ParamSpec {
    ParamSpec {
        name: "file".into(),
        doc: "Path of the part, from the graph file's folder.".into(),
        unit: String::new(),
        kind: ParamKind::Text,
        range: None,
        default: String::new(),
    }
}

/// The kind in words.
pub fn text() -> String {
    let file = file();
    let table = params([(file.name.clone(), &file, None)].into_iter());
    format!("graph: {DOC}\n{HELP}\nparameters\n{table}")
}

/// A graph, which has no base, for programs and in words.
pub fn describe(name: &str, file: &GraphFile, registry: &Registry) -> (Value, String) {
    let ends = [("inputs", "taken by", inputs(file, registry)), ("outputs", "from", outputs(file, registry))];
    let mut text = format!("{name}: {}\n", file.doc);
    let mut value = json!({
        "graph": name,
        "doc": file.doc,
        "params": file.params.iter().map(|param| param_json(&param.spec)).collect::<Vec<_>>(),
    });
    for (side, how, ends) in ends {
        let mut table = Table::new(&["  name", how, "what it holds"]);
        for End { name, ports, doc } in &ends {
            table.row([format!("  {name}"), ports.join(", "), doc.clone()]);
        }
        if !ends.is_empty() {
            text += &format!("\n{side}\n{table}");
        }
        let json = |End { name, ports, doc }: &End| json!({ "name": name, "ports": ports, "doc": doc });
        value[side] = ends.iter().map(json).collect();
    }
    if !file.params.is_empty() {
        let rows = file.params.iter().map(|param| (param.name.value.clone(), &param.spec, None));
        text += &format!("\nparameters\n{}", params(rows));
    }
    let mut table = Table::new(&["  name", "kind", "input", "from"]);
    for node in &file.nodes {
        let row = node.repeat.as_ref().map(|repeat| format!(", {} in a row", repeat.times.value));
        let mut cells =
            [format!("  {}", node.name.value), node.kind.value.clone() + &row.unwrap_or_default()];
        for input in &node.inputs {
            let [name, kind] = std::mem::take(&mut cells);
            table.row([name, kind, input.port.value.clone(), input.from.value.to_string()]);
        }
        if node.inputs.is_empty() {
            let [name, kind] = cells;
            table.row([name, kind, String::new(), String::new()]);
        }
    }
    let node = |node: &epigraph_core::NodeDef| {
        let times = node.repeat.as_ref().map(|repeat| &repeat.times.value);
        let wire =
            |input: &epigraph_core::InputDef| (input.port.value.clone(), input.from.value.to_string().into());
        let inputs: serde_json::Map<String, Value> = node.inputs.iter().map(wire).collect();
        json!({ "node": node.name.value, "kind": node.kind.value, "times": times, "inputs": inputs })
    };
    value["nodes"] = file.nodes.iter().map(node).collect();
    (value, text + &format!("\nnodes\n{table}"))
}

/// What goes into a graph, or comes out of it.
struct End {
    name: String,
    /// The ports inside that take it or give it.
    ports: Vec<String>,
    doc: String,
}

fn inputs(file: &GraphFile, registry: &Registry) -> Vec<End> {
    let mut ends: Vec<End> = Vec::new();
    for node in &file.nodes {
        for input in node.inputs.iter().filter(|input| input.from.value.node == "inputs") {
            let name = &input.from.value.port;
            let taker = Source { node: node.name.value.clone(), port: input.port.value.clone() };
            match ends.iter_mut().find(|end| end.name == *name) {
                Some(end) => end.ports.push(taker.to_string()),
                None => ends.push(End {
                    name: name.clone(),
                    ports: vec![taker.to_string()],
                    doc: doc(file, &taker, false, registry),
                }),
            }
        }
    }
    ends
}

fn outputs(file: &GraphFile, registry: &Registry) -> Vec<End> {
    let end = |output: &epigraph_core::OutputDef| End {
        name: output.name.value.clone(),
        ports: vec![output.from.value.to_string()],
        doc: doc(file, &output.from.value, true, registry),
    };
    file.outputs.iter().map(end).collect()
}

/// What an output or an input holds, by its stage or by the stage that a part connects it to; empty if only a shader file
/// says it.
fn doc(file: &GraphFile, at: &Source, output: bool, registry: &Registry) -> String {
    let Some((node, within)) = file.node_at(&at.node) else { return String::new() };
    if let Some((_, part)) = within.parts.iter().find(|(name, _)| *name == node.name.value) {
        let ends = if output { outputs(part, registry) } else { inputs(part, registry) };
        return ends.into_iter().find(|end| end.name == at.port).map_or(String::new(), |end| end.doc);
    }
    let declared = registry.get(&node.kind.value).and_then(|kind| kind.declaration()).unwrap_or_default();
    let is_such =
        |port: &&Port| port.name == at.port && if output { port.is_output() } else { port.is_input() };
    declared.ports.iter().find(is_such).map_or(String::new(), |port| port.doc.to_string())
}
