//! `epigraph stages`: lists the stage kinds; describes one, a shader file as a stage, or a graph as a part of others;
//! begins a new one.

mod part;
mod shader;
mod starter;

use std::path::Path;

use epigraph::graphs;
use epigraph_core::{
    Access, Declaration, GraphError, Kind, Lifetime, PART_KIND, ParamSpec, Port, Registry, STAGE_KIND, Side,
};
use serde_json::{Value, json};

use crate::{
    args::{ChangeArgs, StagesArgs},
    error::CliError,
    open,
    output::Outputs,
    table::Table,
};

/// Whether a name is that of a graph, and not of a kind.
fn is_graph(name: &str) -> bool {
    let base = epigraph::split(name).map_or(name, |(base, _)| base);
    base.ends_with(".ron") || graphs::names().any(|known| known == base)
}

/// Lists all kinds, describes one, or begins a new one.
pub fn stages(args: &StagesArgs, registry: &Registry) -> Result<(), CliError> {
    let mut outputs = Outputs::default();
    if let Some(path) = &args.new {
        return starter::write(path, args.rust, outputs, registry);
    }
    let json = outputs.json(args.json.as_deref())?;
    let (value, text) = match &args.kind {
        None => list(registry),
        Some(name) => describe(name, registry)?,
    };
    outputs.ready()?.finish(json, &value, &text)
}

fn list(registry: &Registry) -> (Value, String) {
    let mut table = Table::new(&["kind", "runs on", "what it does"]);
    for kind in registry.kinds() {
        table.row([kind.name().into(), sides(kind.declaration().as_ref()), kind.doc().into()]);
    }
    table.row([PART_KIND.into(), String::new(), part::DOC.into()]);
    let all: Vec<Value> = registry.kinds().map(as_json).collect();
    let text = format!(
        "{table}\n`epigraph stages KIND` describes a kind's ports and parameters, `epigraph stages FILE` those of a \
         graph (.ron) or a shader (.wgsl).\n"
    );
    (json!({ "stages": all }), text)
}

fn describe(name: &str, registry: &Registry) -> Result<(Value, String), CliError> {
    match registry.get(name) {
        Some(kind) => Ok((as_json(kind), as_text(kind))),
        None if name == PART_KIND => {
            let value = json!({ "kind": PART_KIND, "doc": part::DOC, "params": [param_json(&part::file())] });
            Ok((value, part::text()))
        }
        None if is_graph(name) => {
            let file = open::graph(name, &ChangeArgs::default(), registry)?;
            Ok(part::describe(&file.name(), &*file.whole()?, registry))
        }
        None if name.ends_with(".wgsl") => Ok(shader::describe(Path::new(name), registry)?),
        None => {
            let kinds = registry.kinds().map(|kind| kind.name());
            Err(GraphError::unknown(STAGE_KIND, name, kinds.chain([PART_KIND])).into())
        }
    }
}

/// The sides on which a kind runs. A kind without a declaration takes its shader from the node and runs on the GPU.
fn sides(declaration: Option<&Declaration>) -> String {
    let Some(declaration) = declaration else { return "gpu".into() };
    let sides = [Side::Cpu, Side::Gpu].into_iter().filter(|side| declaration.runs_on(*side));
    sides.map(|side| side.to_string()).collect::<Vec<_>>().join(", ")
}

fn as_text(kind: &dyn Kind) -> String {
    let declaration = kind.declaration();
    let mut text = format!("{}: {}\n{}", kind.name(), kind.doc(), summary(declaration.as_ref()));
    text += &declaration.as_ref().map_or_else(shader::clauses, ports);
    let specs = kind.specs();
    if !specs.is_empty() {
        let specs = specs.iter().map(|spec| (spec.name.clone(), spec, None));
        text += &format!("\nparameters\n{}", params(specs));
    }
    text
}

/// Where and when a kind runs.
fn summary(declaration: Option<&Declaration>) -> String {
    let mut text = format!("runs on: {}\n", sides(declaration));
    if let Some(column) = declaration.and_then(|declared| declared.column) {
        text += &format!("time counts towards: {column}\n");
    }
    if let Some(why) = declaration.and_then(|declared| declared.runs.unless()) {
        text += &format!("skipped while: {why}\n");
    }
    text
}

/// Tables of the inputs and of the outputs.
fn ports(declaration: &Declaration) -> String {
    let mut text = String::new();
    for (heading, chosen) in [("inputs", Port::is_input as fn(&Port) -> bool), ("outputs", Port::is_output)] {
        let mut table = Table::new(&["  name", "meaning", "access", "element", "extent", "what it holds"]);
        for port in declaration.ports.iter().filter(|port| chosen(port)) {
            table.row([
                format!("  {}", port.name),
                meaning(port),
                access(port),
                elements(port).join(" "),
                port.extent.to_string(),
                port.doc.to_string(),
            ]);
        }
        if declaration.ports.iter().any(chosen) {
            text += &format!("\n{heading}\n{table}");
        }
    }
    text
}

/// A table of parameters: the name, what the parameter is, and its value if it has one besides the default.
pub fn params<'s>(rows: impl Iterator<Item = (String, &'s ParamSpec, Option<&'s str>)>) -> Table {
    let rows: Vec<_> = rows.collect();
    let valued = rows.iter().any(|(.., value)| value.is_some());
    let headings =
        ["  name", "type", if valued { "value" } else { "default" }, "range", "unit", "what it does"];
    let mut table = Table::new(&headings);
    for (name, spec, value) in rows {
        let value = value.unwrap_or(&spec.default);
        let (kind, range) = (spec.kind.words(), range(spec));
        table.row([format!("  {name}"), kind, value.into(), range, spec.unit.clone(), spec.doc.clone()]);
    }
    table
}

/// What other ports of the kind hold too; `scratch` for what nobody else can make sense of.
fn meaning(port: &Port) -> String {
    let meaning = port.meaning.map(|meaning| meaning.to_string());
    let scratch = port.scratch.then(|| "scratch".to_owned());
    scratch.into_iter().chain(meaning).collect::<Vec<_>>().join(", ")
}

fn access(port: &Port) -> String {
    let access = match port.access {
        Access::Read => "read",
        Access::History => "read from last frame",
        Access::Update => "updated in place",
        Access::Write if port.lifetime == Lifetime::Persistent => "written, kept",
        Access::Write => "written",
    };
    if port.optional { format!("{access}, optional") } else { access.into() }
}

/// `array<u32>`, or `field: array<u32>` for each field of a bundle.
fn elements(port: &Port) -> Vec<String> {
    let element = |field: &epigraph_core::Field| match field.name.as_ref() {
        "" => field.element.to_string(),
        name => format!("{name}: {}", field.element),
    };
    port.fields.iter().map(element).collect()
}

fn range(spec: &ParamSpec) -> String {
    spec.range.map_or(String::new(), |(low, high)| format!("{low} to {high}"))
}

fn as_json(kind: &dyn Kind) -> Value {
    let declaration = kind.declaration();
    let runs_on: Vec<String> = match &declaration {
        None => vec!["gpu".into()],
        Some(declared) => [Side::Cpu, Side::Gpu]
            .iter()
            .filter(|side| declared.runs_on(**side))
            .map(Side::to_string)
            .collect(),
    };
    let ports: Vec<Value> = declaration.iter().flat_map(|declared| &declared.ports).map(port_json).collect();
    let params: Vec<Value> = kind.specs().iter().map(param_json).collect();
    let skipped_while = declaration.as_ref().and_then(|declared| declared.runs.unless());
    let column = declaration.as_ref().and_then(|declared| declared.column);
    let declarations = declaration.is_none().then(shader::clauses_json);
    json!({
        "kind": kind.name(),
        "doc": kind.doc(),
        "runs_on": runs_on,
        "skipped_while": skipped_while,
        "column": column,
        "ports": ports,
        "params": params,
        "declarations": declarations,
    })
}

fn port_json(port: &Port) -> Value {
    json!({
        "name": port.name,
        "meaning": port.meaning.map(|meaning| meaning.name),
        "scratch": port.scratch,
        "access": format!("{:?}", port.access).to_lowercase(),
        "optional": port.optional,
        "persistent": port.lifetime == Lifetime::Persistent,
        "elements": elements(port),
        "extent": port.extent.to_string(),
        "doc": port.doc,
    })
}

/// A parameter for programs.
pub fn param_json(spec: &ParamSpec) -> Value {
    json!({
        "name": spec.name,
        "type": spec.kind.words(),
        "default": spec.default,
        "range": spec.range.map(|(low, high)| [low, high]),
        "unit": spec.unit,
        "doc": spec.doc,
    })
}
