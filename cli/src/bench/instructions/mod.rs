//! `epigraph bench --instructions`: how many instructions each stage runs for a pixel. Unlike times, they are the same on
//! a busy machine.
//!
//! The program runs itself under callgrind, with one thread, once for each of two numbers of frames; the difference is
//! free of what happens before the frames, and of the first ones, which have few points. Each stage's twin is a
//! function, so what callgrind counts for it and all that it calls is the stage's cost.

mod profile;

use std::{
    io::ErrorKind,
    path::Path,
    process::{Command, Stdio},
    sync::Arc,
};

use epigraph::{Device, Registry};
use epigraph_core::{GraphFile, Plan, Step};
use epigraph_files::TemporaryFolder;
use epigraph_pictures::grouped;
use serde_json::{Value, json};

use self::profile::Profile;
use super::{
    graphs,
    measure::{self, Job, Loaded, Measured, Outcome},
    named,
    report::ms,
};
use crate::{
    args::BenchArgs, error::CliError, machine::Machine, open, output::Outputs, progress, table::Table,
};

/// Graphs and scenes that are measured by default.
const GRAPHS: [&str; 2] = ["epi", "render-cache"];
const SCENES: [&str; 1] = ["cornell"];

/// Numbers of frames of both runs. The cloud is nearly full at 5% of the pixels a frame.
const FRAMES: [u32; 2] = [20, 24];

/// What walks the steps of a frame.
const FRAME: &str = "epigraph_core::executor::Executor::run";

/// The kind whose cost is no part of a frame's: it depends on the samples alone.
const TRACE: &str = "trace";

/// Lets the C library copy and fill memory by loops of vectors, however long it is. Its other way are instructions that
/// repeat themselves, each of which callgrind counts once for each byte.
const PLAIN_COPIES: &str =
    "glibc.cpu.x86_rep_movsb_threshold=1000000000:glibc.cpu.x86_rep_stosb_threshold=1000000000";

const INSTALL: &str = "valgrind is missing, which counts instructions: apt-get install valgrind (Debian, Ubuntu), \
                       dnf install valgrind (Fedora), or brew install valgrind (Homebrew on Linux)";

/// A graph in a scene.
struct Row {
    graph: String,
    scene: String,
    samples: u32,
    nodes: Vec<Cost>,
    /// Instructions a pixel of the executor itself.
    rest: f64,
    /// Median time of the frames without tracing.
    ms: f64,
}

/// What nodes of one kind cost.
struct Cost {
    /// Their names.
    node: String,
    kind: String,
    /// Instructions a pixel.
    instructions: f64,
    /// Bytes a pixel of what they write.
    bytes: f64,
    /// Median time.
    ms: f64,
}

/// Counts the instructions of all graphs in all scenes.
pub fn bench(args: &BenchArgs, registry: &Arc<Registry>) -> Result<(), CliError> {
    let mut outputs = Outputs::default();
    let json = outputs.json(args.json.as_deref())?;
    let graphs = graphs(args, &GRAPHS, registry)?;
    let mut scenes = Vec::new();
    for name in named(&args.scene, &SCENES) {
        let place = open::place(&name, &args.camera)?;
        open::tracer_of_surfaces(&place)?;
        scenes.push(Loaded { name, place });
    }
    let outputs = outputs.ready()?;
    let mut rows = Vec::new();
    for loaded in &scenes {
        for graph in &graphs {
            rows.push(row(args, registry, graph, loaded)?);
        }
    }
    let machine = Machine::new(rayon::current_num_threads(), None);
    let rows_json: Vec<Value> = rows.iter().map(Row::json).collect();
    let figures = json!({
        "machine": machine.json(), "size": args.size.0, "camera": args.camera, "frames": FRAMES, "rows": rows_json,
    });
    let text = format!("{}{}", rows.iter().map(|row| row.text(args)).collect::<String>(), remarks(&machine));
    outputs.finish(json, &figures, &text)
}

fn row(
    args: &BenchArgs,
    registry: &Arc<Registry>,
    (name, graph): &(String, GraphFile),
    loaded: &Loaded,
) -> Result<Row, CliError> {
    let label = format!("{} {}", loaded.name, open::label(name));
    let job =
        Job { label: label.clone(), args, registry, graph, device: &Device::CPU, loaded, size: args.size.0 };
    let plan = measure::plan(&job)?;
    let count = |frames| counted(args, name, &loaded.name, frames);
    let [before, after] = progress::spinner(format!("{label}: counting instructions"), || {
        let [few, many] = FRAMES;
        Ok::<_, CliError>([count(few)?, count(many)?])
    })?;
    let measured = match measure::measure(&job)? {
        Outcome::Measured(measured) => measured,
        Outcome::Beyond(why) => return Err(CliError::Input(format!("{label}: {why}"))),
    };
    let [width, height] = args.size.0.map(f64::from);
    let frames = f64::from(FRAMES[1] - FRAMES[0]);
    let per_pixel =
        |function: &str| (after.of(function) as f64 - before.of(function) as f64) / (frames * width * height);
    let nodes = costs(&plan, registry, &measured, per_pixel, width * height);
    let frame = per_pixel(FRAME);
    if frame <= 0.0 {
        let text = format!("callgrind has no function `{FRAME}`: this program was built without symbols");
        return Err(CliError::Input(text));
    }
    let rest = frame - nodes.iter().map(|cost| cost.instructions).sum::<f64>();
    Ok(Row {
        graph: open::label(name),
        scene: loaded.name.clone(),
        samples: measured.samples,
        nodes,
        rest,
        ms: measured.times.frame,
    })
}

/// The profile of a run of so many frames.
fn counted(args: &BenchArgs, graph: &str, scene: &str, frames: u32) -> Result<Profile, CliError> {
    let here = std::env::current_exe().map_err(|error| CliError::Input(format!("this program: {error}")))?;
    let folder = TemporaryFolder::new()?;
    let [profile, picture] = ["callgrind.out", "picture.png"].map(|name| folder.path().join(name));
    let [width, height] = args.size.0;
    let mut valgrind = Command::new("valgrind");
    valgrind.arg("--tool=callgrind").arg(with("--callgrind-out-file=", &profile)).arg(here);
    valgrind.arg("render").arg(graph).arg("--backend=cpu").arg("--threads=1");
    for (option, value) in [
        ("scene", scene.to_owned()),
        ("camera", args.camera.clone()),
        ("size", format!("{width}x{height}")),
        ("samples", args.compile.samples.to_string()),
        ("frames", frames.to_string()),
        ("seed", args.seed.to_string()),
    ] {
        valgrind.arg(format!("--{option}={value}"));
    }
    let compile = &args.compile;
    for (given, option) in [
        (compile.no_prune, "--no-prune"),
        (compile.no_pooling, "--no-pooling"),
        (compile.no_vectors, "--no-vectors"),
    ] {
        valgrind.args(given.then_some(option));
    }
    valgrind.arg(with("--out=", &picture)).stdin(Stdio::null()).env("GLIBC_TUNABLES", PLAIN_COPIES);
    let done = valgrind.output().map_err(|error| match error.kind() {
        ErrorKind::NotFound => CliError::Input(INSTALL.into()),
        _ => CliError::Input(format!("valgrind: {error}")),
    })?;
    if !done.status.success() {
        let text = String::from_utf8_lossy(&done.stderr);
        return Err(CliError::Input(format!("valgrind: {}: {}", done.status, text.trim_end())));
    }
    let text = epigraph_files::text(&profile).map_err(|error| CliError::read(&profile, error))?;
    Profile::parse(&text).map_err(|line| CliError::Input(format!("what callgrind has written: {line}")))
}

fn with(option: &str, path: &Path) -> std::ffi::OsString {
    let mut option = std::ffi::OsString::from(option);
    option.push(path);
    option
}

/// The costs of a plan's kinds, in the order of their first nodes.
fn costs(
    plan: &Plan,
    registry: &Registry,
    measured: &Measured,
    per_pixel: impl Fn(&str) -> f64,
    pixels: f64,
) -> Vec<Cost> {
    let mut costs: Vec<Cost> = Vec::new();
    for step in &plan.steps {
        let Step::Run(id) = step else { continue };
        let node = &plan.nodes[*id];
        let times = measured.parts.iter().filter(|part| part.name == node.name);
        let ms: f64 = times.map(|part| part.ms).sum();
        let bytes = plan.node_bytes(*id) as f64 / pixels;
        match costs.iter_mut().find(|cost| cost.kind == node.kind) {
            Some(cost) => {
                cost.node += &format!(", {}", node.name);
                (cost.bytes, cost.ms) = (cost.bytes + bytes, cost.ms + ms);
            }
            None => {
                let twin = registry.get(&node.kind).and_then(|kind| kind.twin());
                let instructions = twin.map_or(0.0, |twin| per_pixel(&twin));
                let (node, kind) = (node.name.clone(), node.kind.clone());
                costs.push(Cost { node, kind, instructions, bytes, ms });
            }
        }
    }
    costs
}

impl Row {
    /// Instructions a pixel without tracing.
    fn frame(&self) -> f64 {
        self.others().map(|cost| cost.instructions).sum::<f64>() + self.rest
    }

    fn others(&self) -> impl Iterator<Item = &Cost> {
        self.nodes.iter().filter(|cost| cost.kind != TRACE)
    }

    fn tracing(&self) -> impl Iterator<Item = &Cost> {
        self.nodes.iter().filter(|cost| cost.kind == TRACE)
    }

    fn json(&self) -> Value {
        let rounded = |value: f64| (value * 100.0).round() / 100.0;
        let nodes = self.nodes.iter().map(|cost| {
            json!({
                "node": cost.node,
                "kind": cost.kind,
                "instructions_per_pixel": rounded(cost.instructions),
                "bytes_per_pixel": rounded(cost.bytes),
                "ms": (cost.ms * 1e4).round() / 1e4,
            })
        });
        json!({
            "graph": self.graph,
            "scene": self.scene,
            "samples_per_frame": self.samples,
            "nodes": nodes.collect::<Vec<_>>(),
            "rest_instructions_per_pixel": rounded(self.rest),
            "frame_instructions_per_pixel": rounded(self.frame()),
            "frame_ms": (self.ms * 1e4).round() / 1e4,
        })
    }

    fn text(&self, args: &BenchArgs) -> String {
        let frame = self.frame();
        let mut table = Table::new(&["node", "kind", ">instructions", ">share", ">bytes", ">ms"]);
        let share = |instructions: f64| format!("{:.1}%", 100.0 * instructions / frame);
        let line = |cost: &Cost, share: String| {
            let Cost { node, kind, instructions, bytes, ms: time } = cost;
            [
                node.clone(),
                kind.clone(),
                format!("{instructions:.1}"),
                share,
                format!("{bytes:.1}"),
                ms(*time),
            ]
        };
        // What a table of costs is read for comes first.
        let mut costs: Vec<&Cost> = self.others().collect();
        costs.sort_by(|a, b| b.instructions.total_cmp(&a.instructions));
        costs.iter().for_each(|cost| table.row(line(cost, share(cost.instructions))));
        let none = String::new;
        table.row(["the rest".into(), none(), format!("{:.1}", self.rest), share(self.rest), none(), none()]);
        let bytes: f64 = costs.iter().map(|cost| cost.bytes).sum();
        let whole = ["frame".into(), none(), format!("{frame:.1}"), share(frame)];
        let [node, kind, instructions, percent] = whole;
        table.row([node, kind, instructions, percent, format!("{bytes:.1}"), ms(self.ms)]);
        self.tracing().for_each(|cost| table.row(line(cost, none())));
        let [width, height] = args.size.0;
        format!(
            "{}, {}: {width}x{height}, camera {}, {} samples a frame\n{table}\n",
            self.scene,
            self.graph,
            args.camera,
            grouped(self.samples.into()),
        )
    }
}

fn remarks(machine: &Machine) -> String {
    let [few, many] = FRAMES;
    format!(
        "instructions: a pixel and frame, of one thread, counted by callgrind: frames {} to {many}, without those before\n\
         bytes: a pixel, of what a node writes, by the plan\n\
         ms: medians of many frames on {}; tracing is not in the frame\n",
        few + 1,
        machine.text(),
    )
}

#[cfg(test)]
mod tests {
    #[test]
    fn each_kind_knows_its_twin_by_name() {
        let registry = epigraph_stages::registry();
        for kind in registry.kinds().filter(|kind| kind.name() != "wgsl") {
            let twin = kind.twin().unwrap();
            let module = format!("<epigraph_stages::{}::", kind.name());
            assert!(
                twin.starts_with(&module) && twin.ends_with(" as epigraph_core::stage::Stage>::cpu"),
                "{twin}"
            );
        }
        assert_eq!(registry.get("wgsl").unwrap().twin(), None);
    }
}
