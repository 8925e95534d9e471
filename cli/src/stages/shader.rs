//! Shader files as stages: what their declarations say, and what they leave open.

use std::path::Path;

use epigraph_core::{
    Declaration, FieldRef, Pass, Problems, Registry, Shape, Threads, WgslClause, WgslFile, imports,
    wgsl_clauses,
};
use serde_json::{Value, json};

use super::{param_json, params, port_json, ports, summary};
use crate::table::Table;

/// A shader file, for programs and in words.
pub fn describe(file: &Path, registry: &Registry) -> Result<(Value, String), Problems> {
    let WgslFile { doc, declaration, specs, assumed } = WgslFile::load(file, registry)?;
    let source = declaration.shader.as_ref().map_or("", |shader| &shader.source);
    let modules: Vec<&str> = imports(source).collect();
    let passes: Vec<(String, String)> =
        declaration.passes.iter().map(|pass| words(pass, &declaration)).collect();
    let value = json!({
        "file": file.display().to_string(),
        "doc": doc,
        "runs_on": ["gpu"],
        "skipped_while": declaration.runs.unless(),
        "column": declaration.column,
        "imports": modules,
        "ports": declaration.ports.iter().map(port_json).collect::<Vec<_>>(),
        "passes": passes.iter().map(|(entry, runs)| json!({ "entry": entry, "runs": runs })).collect::<Vec<_>>(),
        "params": specs.iter().map(param_json).collect::<Vec<_>>(),
        "assumed": assumed,
    });

    let doc =
        if doc.is_empty() { "not documented; write a line `//! WHAT IT DOES` at its top" } else { &doc };
    let mut text = format!("{}: {doc}\n{}", file.display(), summary(Some(&declaration)));
    if !modules.is_empty() {
        text += &format!("imports: {}\n", modules.join(", "));
    }
    text += &ports(&declaration);
    let mut table = Table::new(&["  entry point", "runs"]);
    for (entry, runs) in passes {
        table.row([format!("  {entry}"), runs]);
    }
    text += &format!("\npasses\n{table}");
    if !specs.is_empty() {
        text +=
            &format!("\nparameters\n{}", params(specs.iter().map(|spec| (spec.name.clone(), spec, None))));
    }
    if !assumed.is_empty() {
        let lines: Vec<String> = assumed.iter().map(|line| format!("  {line}\n")).collect();
        text += &format!("\nassumed, as nothing else is declared\n{}", lines.concat());
    }
    Ok((value, text))
}

/// The entry point of a pass, and its size in words.
fn words(pass: &Pass, declaration: &Declaration) -> (String, String) {
    let name = |at: &FieldRef| declaration.ports[at.port as usize].variable(at.field as usize);
    match pass {
        Pass::Compute { entry, threads } => {
            let runs = match threads {
                Threads::Over(port) => format!("one thread for each element of {}", name(port)),
                Threads::Blocks(port, size) => {
                    format!("one thread for each {size} elements of {}", name(port))
                }
                Threads::Groups(1) => "one workgroup".into(),
                Threads::Groups(count) => format!("{count} workgroups"),
                Threads::Indirect(port) => {
                    format!("as many workgroups as the first three numbers of {}", name(port))
                }
            };
            (entry.to_string(), runs)
        }
        Pass::Draw { vertex, fragment, shape, vertices, count, targets, depth, clear } => {
            let shape = match shape {
                Shape::Points => "point",
                Shape::Lines => "line",
                Shape::Triangles => "triangle",
            };
            let (count, into) = (name(count), targets.iter().map(name).collect::<Vec<_>>().join(" and "));
            let depth = if *depth { ", the nearest fragment stays" } else { "" };
            let runs = format!(
                "draws {vertices} {shape} vertices for each element of {count} into {into}, cleared to {clear}{depth}; \
                 fragment {fragment}"
            );
            (vertex.to_string(), runs)
        }
    }
}

const HELP: &str = "
ports: declared by the node's shader file, as are its parameters beside `shader`.
`epigraph stages FILE.wgsl` describes those of a file; docs/wgsl.md explains what a file may declare:
";

/// What a shader file may declare, for programs.
pub fn clauses_json() -> Value {
    let clause =
        |WgslClause { subject, form, doc }: WgslClause| json!({ "for": subject, "form": form, "doc": doc });
    wgsl_clauses().into_iter().map(clause).collect()
}

/// What a shader file may declare.
pub fn clauses() -> String {
    let mut text = HELP.to_owned();
    let all = wgsl_clauses();
    for group in all.chunk_by(|a, b| a.subject == b.subject) {
        let mut table = Table::new(&["  declaration", "what it means"]);
        for WgslClause { form, doc, .. } in group {
            table.row([format!("  {form}"), doc.to_string()]);
        }
        text += &format!("\nfor {}\n{table}", group[0].subject);
    }
    text
}
