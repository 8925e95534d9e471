//! The report of a run of frames, as a table and as JSON.

use epigraph::memory;
use epigraph_core::{BadValue, Gpu, PerSide, Plan, PlannedNode, Side, Step};
use epigraph_pictures::readable;
use epigraph_scenes::Report as Notes;
use epigraph_stages::column::TRACE;
use serde_json::{Value, json};

use crate::{args::RenderArgs, table::Table};

/// The first frames are slower, as caches and threads warm up. One in [`WARM_UP_SHARE`] frames, but at most
/// [`MOST_WARM_UP`], is not counted.
const WARM_UP_SHARE: u32 = 6;
const MOST_WARM_UP: u32 = 10;

/// Times and counts of a run.
pub struct Measured {
    warm_up: u32,
    /// Milliseconds of each step, for each counted frame.
    frames: Vec<Vec<f32>>,
    /// Samples that arrived in each probed frame.
    arrived: Vec<u64>,
    /// Number of frames in which each of the plan's nodes ran.
    runs: Vec<u32>,
    /// Seconds for all frames, including tracing.
    pub seconds: f64,
}

impl Measured {
    /// An empty record for a run of `frames` frames.
    pub fn new(frames: u32) -> Self {
        let warm_up = (frames / WARM_UP_SHARE).min(MOST_WARM_UP);
        Self { warm_up, frames: Vec::new(), arrived: Vec::new(), runs: Vec::new(), seconds: 0.0 }
    }

    /// Records the times of the plan's steps in frame `index`.
    pub fn times(&mut self, index: u32, times: &[f32]) {
        if index >= self.warm_up {
            self.frames.push(times.to_vec());
        }
    }

    /// Records which nodes ran in a frame.
    pub fn ran(&mut self, ran: &[bool]) {
        self.runs.resize(ran.len(), 0);
        self.runs.iter_mut().zip(ran).for_each(|(runs, &ran)| *runs += u32::from(ran));
    }

    /// Records the number of samples that arrived in a frame.
    pub fn arrived(&mut self, samples: u64) {
        self.arrived.push(samples);
    }

    /// The quantile at `share` of the frames' times for the chosen steps, in milliseconds.
    fn quantile(&self, share: f64, chosen: impl Fn(usize) -> bool) -> f64 {
        let sum = |times: &Vec<f32>| -> f64 {
            times.iter().enumerate().filter(|(step, _)| chosen(*step)).map(|(_, ms)| f64::from(*ms)).sum()
        };
        let mut sums: Vec<f64> = self.frames.iter().map(sum).collect();
        sums.sort_unstable_by(f64::total_cmp);
        match sums.len() {
            0 => 0.0,
            count => sums[(share * (count - 1) as f64).round() as usize],
        }
    }

    /// Mean number of samples that arrived per frame, or `None` if no frame was probed. The first frame has no requests
    /// to wait for, so it counts only if it is the only one.
    fn mean_arrived(&self) -> Option<f64> {
        let counted = if self.arrived.len() > 1 { &self.arrived[1..] } else { &self.arrived };
        (!counted.is_empty()).then(|| counted.iter().sum::<u64>() as f64 / counted.len() as f64)
    }
}

/// The report of a run.
pub struct Report<'a> {
    /// The command line.
    pub args: &'a RenderArgs,
    /// What of the scene's files is not in the scene as it stands.
    pub notes: &'a Notes,
    /// Why the picture shows nothing, if it does not.
    pub blank: Option<&'a str>,
    /// The graph file's name.
    pub graph: &'a str,
    /// Number of CPU threads.
    pub threads: usize,
    /// Maximum number of samples per frame.
    pub samples: u32,
    /// The default side of nodes.
    pub side: Side,
    /// The GPU, if the plan uses one.
    pub gpu: Option<&'a Gpu>,
    /// The plan that ran.
    pub plan: &'a Plan,
    /// Bytes that pooling saves on each side.
    pub pooled_bytes: PerSide<u64>,
    /// Bytes that the whole graph would take more.
    pub culled_bytes: u64,
    /// Number of frames that ran: fewer than requested if the user interrupted the run.
    pub frames: u32,
    /// Times and counts of the run.
    pub measured: &'a Measured,
    /// The nodes that fit the exposure to the picture, and the exposures that they found, in EV.
    pub exposures: &'a [(String, f64)],
    /// Contents and path of each written file.
    pub written: Vec<(String, String)>,
}

struct Row {
    node: String,
    kind: String,
    backend: String,
    ms: f64,
    bytes: u64,
    tracing: bool,
}

impl Report<'_> {
    fn rows(&self) -> Vec<Row> {
        let steps = self.plan.steps.iter().enumerate();
        steps
            .filter_map(|(index, step)| self.row(step, self.measured.quantile(0.5, |step| step == index)))
            .collect()
    }

    fn row(&self, step: &Step, ms: f64) -> Option<Row> {
        let plan = self.plan;
        match step {
            Step::Run(node) => {
                let PlannedNode { name, kind, column, side, .. } = &plan.nodes[*node];
                Some(Row {
                    node: name.clone(),
                    kind: kind.clone(),
                    backend: side.to_string(),
                    ms,
                    bytes: plan.node_bytes(*node),
                    tracing: *column == Some(TRACE),
                })
            }
            Step::Upload(value) | Step::Download(value, _) => {
                let kind = if matches!(step, Step::Upload(_)) { "upload" } else { "download" };
                let name = plan.step_name(step);
                Some(Row {
                    node: name.strip_prefix(kind).unwrap_or(&name).trim().to_owned(),
                    kind: kind.into(),
                    backend: "transfer".into(),
                    ms,
                    bytes: plan.storages[value.storage].bytes(),
                    tracing: false,
                })
            }
            Step::Tap { .. } => None,
        }
    }

    /// The nodes that were skipped in some frames because their result would not have changed: index, name, kind and why.
    fn skipped(&self) -> impl Iterator<Item = (usize, &str, &str, &'static str)> {
        let (plan, runs) = (self.plan, &self.measured.runs);
        let nodes = plan.nodes.iter().enumerate().filter(|(index, _)| runs[*index] < self.frames);
        nodes.filter_map(|(index, node)| {
            Some((index, node.name.as_str(), node.kind.as_str(), node.runs.unless()?))
        })
    }

    fn is_tracing(&self, step: usize) -> bool {
        matches!(self.plan.steps[step], Step::Run(node) if self.plan.nodes[node].column == Some(TRACE))
    }

    /// Quantile of the time of all nodes and transfers except tracing, in milliseconds.
    fn frame_ms(&self, share: f64) -> f64 {
        self.measured.quantile(share, |step| {
            !self.is_tracing(step) && !matches!(self.plan.steps[step], Step::Tap { .. })
        })
    }

    fn trace_ms(&self) -> f64 {
        self.measured.quantile(0.5, |step| self.is_tracing(step))
    }

    fn frames_per_second(&self) -> f64 {
        f64::from(self.frames) / self.measured.seconds
    }

    /// The report as text: the table and a summary.
    pub fn text(&self) -> String {
        let args = self.args;
        let median = self.frame_ms(0.5);
        let mut table = Table::new(&["node", "kind", "backend", ">ms", ">memory", ">share"]);
        for row in self.rows() {
            let share = if row.tracing {
                String::new()
            } else {
                format!("{:.1}%", 100.0 * row.ms / median.max(1e-9))
            };
            table.row([
                row.node,
                row.kind,
                row.backend,
                format!("{:.3}", row.ms),
                readable(row.bytes),
                share,
            ]);
        }
        let [width, height] = args.scene.size.0;
        let mut text = format!("{table}\n");
        let mut line = |name: &str, value: String| text += &format!("{name:<8} {value}\n");
        let frames = format!("{} frames of {} at {width}x{height}", self.frames, args.scene.scene);
        line("run", format!("{frames}, camera {}, graph {}", args.scene.camera, self.graph));
        line("backend", self.backend_text());
        line(
            "frame",
            format!("{median:.2} ms without tracing (median; 95th percentile {:.2} ms)", self.frame_ms(0.95)),
        );
        line("tracing", format!("{:.2} ms per frame (median)", self.trace_ms()));
        let arrived = self.measured.mean_arrived().map(|mean| format!(", {mean:.0} arrived"));
        line("samples", format!("at most {} per frame{}", self.samples, arrived.unwrap_or_default()));
        line("speed", format!("{:.1} frames per second, including tracing", self.frames_per_second()));
        line("memory", self.memory_text());
        for (node, ev) in self.exposures {
            line("exposure", format!("{node}: {ev:.2} EV, Auto"));
        }
        for culled in &self.plan.culled {
            line("left out", format!("{} ({}): {}", culled.node, culled.kind, culled.why));
        }
        if self.culled_bytes > 0 {
            line("saved", format!("{} of memory by leaving out nodes", readable(self.culled_bytes)));
        }
        for (node, name, kind, why) in self.skipped() {
            let (runs, frames) = (self.measured.runs[node], self.frames);
            line(
                "skipped",
                format!("{name} ({kind}): ran in {runs} of {frames} frames; skipped while {why}"),
            );
        }
        if args.watch {
            line("watch", "no node wrote a bad number".into());
        }
        for (what, path) in &self.written {
            line(what, path.clone());
        }
        text
    }

    fn backend_text(&self) -> String {
        let cpu = format!("cpu, {} threads", self.threads);
        match self.gpu {
            Some(gpu) if gpu.is_software() => {
                format!("gpu: {}, in software: its times say nothing about a real GPU; {cpu}", gpu.name())
            }
            Some(gpu) => format!("gpu: {}; {cpu}", gpu.name()),
            None => cpu,
        }
    }

    fn memory_text(&self) -> String {
        let side = |side: Side| {
            let bytes = self.plan.bytes(side);
            let pooled = self.pooled_bytes[side];
            format!("graph on the {side} {} ({} saved by pooling)", readable(bytes), readable(pooled))
        };
        let sides = Side::ALL.into_iter().filter(|side| self.plan.bytes(*side) > 0).map(side);
        let peak = memory::peak().map(|bytes| format!("process peak {}", readable(bytes)));
        peak.into_iter().chain(sides).collect::<Vec<_>>().join(", ")
    }

    /// The report as JSON.
    pub fn json(&self) -> Value {
        let args = self.args;
        let nodes: Vec<Value> = self
            .rows()
            .into_iter()
            .map(|row| {
                let ms = rounded(row.ms);
                json!({ "node": row.node, "kind": row.kind, "backend": row.backend, "ms": ms, "bytes": row.bytes })
            })
            .collect();
        let culled: Vec<Value> = self
            .plan
            .culled
            .iter()
            .map(|culled| json!({ "node": culled.node, "kind": culled.kind, "why": culled.why }))
            .collect();
        let skipped: Vec<Value> = self
            .skipped()
            .map(|(node, name, kind, why)| {
                json!({ "node": name, "kind": kind, "frames_run": self.measured.runs[node], "while": why })
            })
            .collect();
        let files: Vec<Value> =
            self.written.iter().map(|(what, path)| json!({ "what": what, "path": path })).collect();
        let exposures: Vec<Value> =
            self.exposures.iter().map(|(node, ev)| json!({ "node": node, "ev": rounded(*ev) })).collect();
        json!({
            "graph": self.graph,
            "scene": args.scene.scene,
            "scene_report": self.notes,
            "blank": self.blank,
            "camera": args.scene.camera,
            "size": args.scene.size.0,
            "seed": args.seed,
            "backend": self.side.to_string(),
            "adapter": self.gpu.map(Gpu::name),
            "software_adapter": self.gpu.map(Gpu::is_software),
            "threads": self.threads,
            "frames": self.frames,
            "frame_ms": { "median": rounded(self.frame_ms(0.5)), "p95": rounded(self.frame_ms(0.95)) },
            "trace_ms": rounded(self.trace_ms()),
            "frames_per_second": rounded(self.frames_per_second()),
            "samples_per_frame": self.samples,
            "samples_arrived_per_frame": self.measured.mean_arrived().map(rounded),
            "peak_bytes": memory::peak(),
            "plan_bytes": { "cpu": self.plan.bytes(Side::Cpu), "gpu": self.plan.bytes(Side::Gpu) },
            "pooled_bytes": { "cpu": self.pooled_bytes.cpu, "gpu": self.pooled_bytes.gpu },
            "exposures": exposures,
            "nodes": nodes,
            "culled": culled,
            "culled_bytes": self.culled_bytes,
            "skipped": skipped,
            "watched": args.watch,
            "bad_value": Value::Null,
            "files": files,
        })
    }
}

/// The JSON of a run that ended at a bad value.
pub fn of_bad_value(args: &RenderArgs, graph: &str, side: Side, bad: &BadValue) -> Value {
    json!({
        "graph": graph,
        "scene": args.scene.scene,
        "camera": args.scene.camera,
        "size": args.scene.size.0,
        "seed": args.seed,
        "backend": side.to_string(),
        "watched": true,
        "bad_value": bad,
    })
}

/// Rounded to four decimals, the resolution of the clocks.
fn rounded(value: f64) -> f64 {
    (value * 1e4).round() / 1e4
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_warm_up_is_not_counted() {
        let mut measured = Measured::new(12);
        for (index, ms) in [100.0, 100.0, 3.0, 1.0, 2.0].into_iter().enumerate() {
            measured.times(index as u32, &[ms, 10.0]);
        }
        assert_eq!(measured.quantile(0.5, |step| step == 0), 2.0);
        assert_eq!(measured.quantile(1.0, |_| true), 13.0);
    }

    #[test]
    fn a_single_frame_counts() {
        let mut measured = Measured::new(1);
        measured.times(0, &[4.0]);
        assert_eq!(measured.quantile(0.95, |_| true), 4.0);
        assert_eq!(measured.mean_arrived(), None);
        measured.arrived(7);
        assert_eq!(measured.mean_arrived(), Some(7.0));
    }
}
