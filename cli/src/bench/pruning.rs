//! `epigraph bench --pruning`: what each scene saves because nodes that it does not need are left out, or skipped while
//! nothing changes.

use std::sync::Arc;

use epigraph::{Device, Registry};
use epigraph_core::{GraphFile, Plan, Side};
use epigraph_pictures::readable;
use serde_json::{Value, json};

use super::{
    graphs,
    measure::{self, Job, Loaded, Outcome},
    named,
};
use crate::{args::BenchArgs, error::CliError, open, output::Outputs, table::Table};

/// Graphs and scenes that are measured by default.
const GRAPHS: [&str; 2] = ["render-cache", "epi"];
const SCENES: [&str; 5] = ["cornell", "cornell-moving", "chains", "room", "still-life"];

/// A graph in a scene.
struct Row {
    graph: String,
    scene: String,
    camera: String,
    /// Numbers of nodes, pruned and whole.
    nodes: [usize; 2],
    /// Memory on both sides, likewise.
    bytes: [u64; 2],
    /// Median time of the whole graph's frames without tracing.
    ms: f64,
    saved: Vec<Saved>,
}

/// A node that does not run.
struct Saved {
    node: String,
    why: String,
    /// What it takes in a frame of the whole graph. The difference of two runs' times would be mostly noise.
    ms: f64,
}

/// Measures all graphs in all scenes, with a still camera and with the one that is asked for.
pub fn bench(args: &BenchArgs, registry: &Arc<Registry>) -> Result<(), CliError> {
    let mut outputs = Outputs::default();
    let json = outputs.json(args.json.as_deref())?;
    let graphs = graphs(args, &GRAPHS, registry)?;
    let mut cameras = vec!["still".to_owned()];
    cameras.extend((args.camera != "still").then(|| args.camera.clone()));
    let mut places = Vec::new();
    for scene in named(&args.scene, &SCENES) {
        let place = open::place(&scene, "still")?;
        open::tracer_of_surfaces(&place)?;
        for camera in &cameras {
            places.push((camera, Loaded { name: scene.clone(), place: place.along(camera)? }));
        }
    }
    let outputs = outputs.ready()?;
    let mut rows = Vec::new();
    for graph in &graphs {
        for (camera, loaded) in &places {
            rows.push(row(args, registry, graph, camera, loaded)?);
        }
    }
    let [width, height] = args.size.0;
    let rows_json: Vec<Value> = rows.iter().map(Row::json).collect();
    outputs.finish(json, &json!({ "size": [width, height], "rows": rows_json }), &text(&rows, args))
}

fn row(
    args: &BenchArgs,
    registry: &Arc<Registry>,
    (name, graph): &(String, GraphFile),
    camera: &str,
    loaded: &Loaded,
) -> Result<Row, CliError> {
    let mut whole_args = args.clone();
    whole_args.compile.no_prune = true;
    let graph_name = open::label(name);
    let label = format!("{graph_name} {} {camera}", loaded.name);
    let job = |args| {
        let (label, size) = (label.clone(), whole_args.size.0);
        Job { label, args, registry, graph, device: &Device::CPU, loaded, size }
    };
    let (plan, skipped) = measure::skipped(&job(args))?;
    let whole = measure::plan(&job(&whole_args))?;
    let measured = match measure::measure(&job(&whole_args))? {
        Outcome::Measured(measured) => measured,
        Outcome::Beyond(why) => return Err(CliError::Input(format!("{label}: {why}"))),
    };
    let culled = plan.culled.iter().map(|culled| (culled.node.clone(), culled.why.clone()));
    let skipped = skipped.into_iter().filter_map(|node| {
        let node = &plan.nodes[node];
        Some((node.name.clone(), node.runs.unless()?.to_owned()))
    });
    let saved = culled.chain(skipped).map(|(node, why)| {
        let ms = measured.parts.iter().filter(|part| part.name == node).map(|part| part.ms).sum();
        Saved { node, why, ms }
    });
    let bytes = |plan: &Plan| plan.bytes(Side::Cpu) + plan.bytes(Side::Gpu);
    Ok(Row {
        graph: graph_name,
        scene: loaded.name.clone(),
        camera: camera.to_owned(),
        nodes: [plan.nodes.len(), whole.nodes.len()],
        bytes: [bytes(&plan), bytes(&whole)],
        ms: measured.times.frame,
        saved: saved.collect(),
    })
}

fn rounded(ms: f64) -> f64 {
    (ms * 1e4).round() / 1e4
}

impl Row {
    fn saved_ms(&self) -> f64 {
        // The sum of nothing would be -0.
        self.saved.iter().fold(0.0, |sum, saved| sum + saved.ms)
    }

    fn json(&self) -> Value {
        let saved = self
            .saved
            .iter()
            .map(|Saved { node, why, ms }| json!({ "node": node, "why": why, "ms": rounded(*ms) }));
        json!({
            "graph": self.graph,
            "scene": self.scene,
            "camera": self.camera,
            "nodes": self.nodes[0],
            "bytes": self.bytes[0],
            "whole": { "nodes": self.nodes[1], "bytes": self.bytes[1], "frame_ms": rounded(self.ms) },
            "saved_ms": rounded(self.saved_ms()),
            "saved": saved.collect::<Vec<_>>(),
        })
    }
}

/// What a pruned graph's memory is less than the whole one's; below zero if nodes that may be skipped keep more than
/// those that are left out would take.
fn saved_bytes([pruned, whole]: [u64; 2]) -> String {
    let sign = if pruned > whole { "-" } else { "" };
    format!("{sign}{}", readable(pruned.abs_diff(whole)))
}

fn text(rows: &[Row], args: &BenchArgs) -> String {
    let headings = ["graph", "scene", "camera", ">nodes", ">saved bytes", ">saved ms", ">of ms", "not run"];
    let mut table = Table::new(&headings);
    for row in rows {
        let names: Vec<&str> = row.saved.iter().map(|saved| saved.node.as_str()).collect();
        table.row([
            row.graph.clone(),
            row.scene.clone(),
            row.camera.clone(),
            format!("{} of {}", row.nodes[0], row.nodes[1]),
            saved_bytes(row.bytes),
            format!("{:.3}", row.saved_ms()),
            format!("{:.2}", row.ms),
            names.join(", "),
        ]);
    }
    let [width, height] = args.size.0;
    let mut text = format!(
        "{table}\nframes of {width}x{height} on the CPU; milliseconds in a frame of the whole graph, without tracing\n"
    );
    let mut reasons: Vec<String> = rows
        .iter()
        .flat_map(|row| &row.saved)
        .map(|saved| format!("{}: {}", saved.node, saved.why))
        .collect();
    reasons.sort();
    reasons.dedup();
    reasons.iter().for_each(|reason| text += &format!("{reason}\n"));
    text
}
