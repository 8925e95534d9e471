//! `epigraph check`: reports the problems of graphs and their shaders, or the plans that they compile to.

use std::process::ExitCode;

use epigraph::{Backend, Error};
use epigraph_core::{
    Facts, Graph, GraphFile, GraphValue, Plan, PlannedNode, Problem, Problems, Registry, Settings, Side,
    Step, WithWork, Work, check_stage, compile,
};
use epigraph_pictures::readable;
use serde_json::{Value, json};

use crate::{args::CheckArgs, error::CliError, open, output::Outputs, stages};

/// Checks graphs. The exit code is a failure if any graph has a problem.
pub fn check(args: &CheckArgs, registry: &Registry) -> Result<ExitCode, CliError> {
    let mut outputs = Outputs::default();
    let json = outputs.json(args.json.as_deref())?;
    let dot = args.dot.as_deref().map(|path| outputs.add("--dot", path)).transpose()?;
    let full = args.full.as_deref().map(|path| outputs.add("--full", path)).transpose()?;
    for (option, wanted) in
        [("--dot writes one plan", dot.is_some()), ("--full writes one graph", full.is_some())]
    {
        if wanted && args.graphs.len() > 1 {
            return Err(CliError::Input(format!("{option}; name one GRAPH")));
        }
    }
    let place = open::place_of(&args.scene)?;
    let facts = place.facts();
    let settings = settings(args, facts.clone())?;

    let mut text = String::new();
    let mut errors: Vec<Problem> = Vec::new();
    let mut plans = Vec::new();
    let mut files = Vec::new();
    for name in &args.graphs {
        match check_one(name, args, &settings, registry) {
            Ok(checked) => {
                text += &format!("{name}: no problems\n{}", checked.text());
                files.extend(dot.map(|dot| (dot, checked.plan.dot())));
                if let (Some(full), Some(path)) = (full, &args.full) {
                    files.push((full, checked.file.full(registry, path)?));
                    text += &format!("written in full to {}\n", path.display());
                }
                plans.push(json!({ "graph": name, "plan": checked.json() }));
            }
            Err(CliError::Run(Error::Graph(Problems(problems)))) => {
                for problem in &problems {
                    text += &format!("error: {problem}\n");
                }
                text += &format!("{name}: {}\n", count(problems.len(), "problem"));
                errors.extend(problems);
            }
            // Errors of other kinds concern the command as a whole.
            Err(error) => return Err(error),
        }
    }
    let cameras: Vec<&str> = place.scene.cameras.iter().map(|(name, _)| name.as_str()).collect();
    if !cameras.is_empty() {
        text += &format!("cameras of {}, for --camera file:NAME: {}\n", args.scene.scene, cameras.join(", "));
    }
    let plan = match plans.as_slice() {
        [only] if args.graphs.len() == 1 => only["plan"].clone(),
        _ => Value::Null,
    };
    let failed = !errors.is_empty();
    let errors: Vec<Value> = errors.iter().map(problem_json).collect();
    let mut outputs = outputs.ready()?;
    for (file, text) in files {
        outputs.put(file, text.as_bytes())?;
    }
    outputs.finish(
        json,
        &json!({
            "errors": errors,
            "plan": plan,
            "plans": plans,
            "scene": {
                "name": args.scene.scene, "cameras": cameras, "report": *place.scene.report, "facts": facts,
            },
        }),
        &text,
    )?;
    Ok(if failed { ExitCode::FAILURE } else { ExitCode::SUCCESS })
}

fn settings(args: &CheckArgs, facts: Facts) -> Result<Settings, CliError> {
    let size = args.scene.size.0;
    let samples = open::samples(args.compile.samples, size)?;
    Ok(Settings {
        side: if args.backend == Backend::Gpu { Side::Gpu } else { Side::Cpu },
        prune: !args.compile.no_prune,
        pooling: !args.compile.no_pooling,
        vectors: !args.compile.no_vectors,
        ..Settings::new(size, samples, facts)
    })
}

/// A graph without problems.
struct Checked {
    params: Vec<GraphValue>,
    file: GraphFile,
    plan: Plan,
    /// The plan without pruning, to report how much pruning saves.
    whole: Plan,
    shaders: usize,
    /// What each step asks of the GPU; `None` if the plan does without one.
    work: Option<Vec<Work>>,
    pixels: u64,
    /// What swaps have left out, in sentences.
    left_out: Vec<String>,
}

fn check_one(
    name: &str,
    args: &CheckArgs,
    settings: &Settings,
    registry: &Registry,
) -> Result<Checked, CliError> {
    let file = open::graph(name, &args.compile.changes, registry)?;
    let (planned, plan) = compile(&file, registry, settings)?;
    // Nodes that only another scene needs are checked too.
    let (graph, whole) = compile(&file, registry, &Settings { prune: false, ..settings.clone() })?;
    let flat = file.whole()?;
    let shaders = check_shaders(&flat, &graph, registry)?;
    let left_out = left_out(&flat, "", &graph);
    drop(flat);
    let work = plan.uses(Side::Gpu).then(|| plan.work(&planned, &registry.library)).transpose()?;
    let pixels = settings.size.map(u64::from).iter().product();
    Ok(Checked { params: planned.params, file, plan, whole, shaders, work, pixels, left_out })
}

/// What nodes do not take over of those whose places they have taken: wires to inputs that they do not have, and
/// parameters.
fn left_out(file: &GraphFile, folder: &str, graph: &Graph) -> Vec<String> {
    let mut sentences = Vec::new();
    for node in &file.nodes {
        let address = format!("{folder}{}", node.name.value);
        let part = file.parts.iter().find(|(part, _)| *part == node.name.value);
        if let Some(replaced) = &node.replaced {
            // A part takes all wires that it keeps.
            let kept = replaced.kept.iter().filter(|port| part.is_none() && !has_port(graph, &address, port));
            let wires = listed("wire", kept.chain(&replaced.dropped));
            let left: Vec<String> =
                wires.into_iter().chain(listed("parameter", replaced.params.iter())).collect();
            if !left.is_empty() {
                let left = left.join(" and the ");
                sentences.push(format!("{address}: without the {left} of {}", replaced.what));
            }
        }
        if let Some((_, part)) = part {
            sentences.extend(left_out(part, &format!("{address}/"), graph));
        }
    }
    sentences
}

/// Whether a node, or the first of its copies, has a port.
fn has_port(graph: &Graph, address: &str, port: &str) -> bool {
    let copies = format!("{address}/");
    let node = graph.nodes.iter().find(|node| node.name == address || node.name.starts_with(&copies));
    node.is_none_or(|node| node.declaration().ports.iter().any(|known| known.name == port))
}

/// Names of one kind in words; `None` if there are none.
fn listed<'n>(what: &str, names: impl Iterator<Item = &'n String>) -> Option<String> {
    let names: Vec<String> = names.map(|name| format!("`{name}`")).collect();
    let plural = if names.len() == 1 { "" } else { "s" };
    (!names.is_empty()).then(|| format!("{what}{plural} {}", names.join(", ")))
}

/// Checks every node's shader against its ports, without a GPU. Returns the number of shaders.
fn check_shaders(file: &GraphFile, graph: &Graph, registry: &Registry) -> Result<usize, Problems> {
    let mut problems = Problems::default();
    let mut count = 0;
    for node in &graph.nodes {
        count += usize::from(node.declaration().shader.is_some());
        let errors = check_stage(&*node.stage, &registry.library);
        if errors.is_empty() {
            continue;
        }
        let place = file.node_at(&node.name).map(|(node, file)| file.place(node.kind.span));
        problems.0.extend(errors.into_iter().map(|error| {
            let problem = Problem::new(error).node(&node.name);
            place.iter().cloned().fold(problem, Problem::at)
        }));
    }
    problems.into_result().map(|()| count)
}

impl Checked {
    /// Bytes that a pruned node would write per frame, if it runs in the whole plan.
    fn saved(&self, node: &str) -> Option<u64> {
        let id = self.whole.nodes.position(|planned| planned.name == node)?;
        Some(self.whole.node_bytes(id))
    }

    fn text(&self) -> String {
        let plan = &self.plan;
        let mut text = match &self.work {
            Some(work) => WithWork { plan, work, pixels: self.pixels }.to_string(),
            None => plan.to_string(),
        };
        for culled in &self.plan.culled {
            if let Some(bytes) = self.saved(&culled.node) {
                text += &format!("  without {}: writes {} less per frame\n", culled.node, readable(bytes));
            }
        }
        let [whole, pruned] = [&self.whole, &self.plan].map(total);
        if pruned > whole {
            text +=
                &format!("skipping takes {} of memory more than pruning saves\n", readable(pruned - whole));
        } else if !self.plan.culled.is_empty() {
            text += &format!("pruning saves {} of memory\n", readable(whole - pruned));
        }
        text += &format!("{} checked against their stages\n", count(self.shaders, "shader"));
        for sentence in &self.left_out {
            text += &format!("swapped {sentence}\n");
        }
        if !self.params.is_empty() {
            let params = self.params.iter().map(|param| (name(param), &param.spec, Some(&param.value[..])));
            text += &format!("parameters\n{}", stages::params(params));
        }
        text
    }

    fn json(&self) -> Value {
        let plan = &self.plan;
        let work = |step: usize| self.work.as_ref().map(|work| work_json(work[step]));
        let steps = plan.steps.iter().enumerate();
        let steps: Vec<Value> = steps.filter_map(|(nth, step)| step_json(plan, step, work(nth))).collect();
        let culled: Vec<Value> = plan
            .culled
            .iter()
            .map(|culled| {
                let saved = self.saved(&culled.node);
                json!({ "node": culled.node, "kind": culled.kind, "why": culled.why, "bytes": saved })
            })
            .collect();
        json!({
            "left_out": self.left_out,
            "steps": steps,
            "gpu": self.work.as_ref().map(|work| work_json(work.iter().copied().sum())),
            "bytes": { "cpu": plan.bytes(Side::Cpu), "gpu": plan.bytes(Side::Gpu) },
            "pooled_bytes": { "cpu": plan.pooled_bytes(Side::Cpu), "gpu": plan.pooled_bytes(Side::Gpu) },
            "culled": culled,
            "culled_bytes": total(&self.whole).saturating_sub(total(plan)),
            "shaders": self.shaders,
            "params": self.params.iter().map(|param| {
                let mut json = stages::param_json(&param.spec);
                json["name"] = json!(name(param));
                json["value"] = json!(param.value);
                json
            }).collect::<Vec<_>>(),
        })
    }
}

/// A parameter as `--set` takes it: `sigma` of the graph itself, `view.sigma` of a part.
fn name(param: &GraphValue) -> String {
    if param.part.is_empty() {
        param.spec.name.clone()
    } else {
        format!("{}.{}", param.part, param.spec.name)
    }
}

fn total(plan: &Plan) -> u64 {
    plan.bytes(Side::Cpu) + plan.bytes(Side::Gpu)
}

fn step_json(plan: &Plan, step: &Step, gpu: Option<Value>) -> Option<Value> {
    match step {
        Step::Run(node) => {
            let PlannedNode { name, kind, side, runs, .. } = &plan.nodes[*node];
            Some(json!({
                "node": name, "kind": kind, "backend": side.to_string(), "bytes": plan.node_bytes(*node),
                "skipped_while": runs.unless(), "gpu": gpu.filter(|_| *side == Side::Gpu),
            }))
        }
        Step::Upload(value) | Step::Download(value, _) => {
            let kind = if matches!(step, Step::Upload(_)) { "upload" } else { "download" };
            let storage = &plan.storages[value.storage];
            Some(json!({
                "node": storage.name, "kind": kind, "backend": "transfer", "bytes": storage.bytes(), "gpu": gpu,
            }))
        }
        Step::Tap { .. } => None,
    }
}

fn work_json(work: Work) -> Value {
    let Work { dispatches, draws, barriers, read, written, atomics } = work;
    json!({
        "dispatches": dispatches, "draws": draws, "barriers": barriers, "read_bytes": read,
        "written_bytes": written, "atomics": atomics,
    })
}

fn problem_json(problem: &Problem) -> Value {
    let place = problem.place.as_ref();
    json!({
        "file": place.map(|place| &place.file),
        "line": place.map(|place| place.line),
        "column": place.map(|place| place.column),
        "node": problem.node,
        "port": problem.port,
        "message": problem.error.to_string(),
    })
}

fn count(number: usize, what: &str) -> String {
    if number == 1 { format!("1 {what}") } else { format!("{number} {what}s") }
}
