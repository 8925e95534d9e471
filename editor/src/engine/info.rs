//! Information about a running graph, as a value that other threads can keep.

use epigraph_core::{
    Access, Dims, Download, Graph, GraphValue, Node, NodeId, ParamSpec, Plan, Port, PortRef, Side, Step,
    StepId, StorageId, Value,
};
use epigraph_pictures::is_image;

/// A graph as compiled.
#[derive(Clone, Debug)]
pub struct GraphInfo {
    /// The nodes that run; those of parts are named `part/node`.
    pub nodes: Vec<NodeInfo>,
    /// The nodes that were left out, and why.
    pub left_out: Vec<LeftOut>,
    /// Names of the outputs, and the ports that they show.
    pub outputs: Vec<(String, String)>,
    /// The steps of a frame, in order.
    pub steps: Vec<StepInfo>,
    /// Bytes of memory on the CPU and on the GPU.
    pub bytes: [u64; 2],
    /// Width and height of the frame, pixels.
    pub size: [u32; 2],
    /// The parameters of the graph itself and of its parts.
    pub params: Vec<GraphValue>,
    /// The GPU in use.
    pub gpu: Option<String>,
    /// The plan as a Graphviz graph.
    pub dot: String,
}

/// A node that was left out, as it has no effect.
#[derive(Clone, Debug)]
pub struct LeftOut {
    /// Its address.
    pub name: String,
    /// Its stage kind.
    pub kind: String,
    /// The reason.
    pub why: String,
    /// Bytes that it would write in a frame; `None` if it would run in no scene.
    pub bytes: Option<u64>,
}

/// A node that runs.
#[derive(Clone, Debug)]
pub struct NodeInfo {
    /// Its address.
    pub name: String,
    /// The address of the node that it is a copy of: its own unless that is repeated.
    pub written: String,
    /// Its stage kind.
    pub kind: String,
    /// The side it runs on.
    pub side: Side,
    /// Bytes that it writes.
    pub bytes: u64,
    /// Its ports.
    pub ports: Vec<PortInfo>,
    /// Its parameters, those of its shader too.
    pub specs: Vec<ParamSpec>,
}

/// A port of a node that runs.
#[derive(Clone, Debug)]
pub struct PortInfo {
    /// The stage's declaration; the meaning is that of the connected port if it declares none.
    pub port: Port,
    /// Its number of elements along each dimension.
    pub dims: Dims,
    /// The `node.port` that it reads from.
    pub source: Option<String>,
}

/// A step of a frame.
#[derive(Clone, Debug)]
pub struct StepInfo {
    /// The node's name, or the transfer's.
    pub name: String,
    /// The node that runs; `None` for transfers.
    pub node: Option<String>,
    /// The side it runs on.
    pub side: Side,
    /// True if it only copies a port for a viewer.
    pub is_tap: bool,
    /// The value that crosses between the sides; `None` for nodes.
    pub transfer: Option<Transfer>,
}

/// A value that crosses from one side to the other.
#[derive(Clone, Debug, PartialEq)]
pub struct Transfer {
    /// How a download waits; `None` for an upload.
    pub download: Option<Download>,
    /// The `node.port` that wrote it.
    pub from: String,
    /// The inputs that receive it, as `node.port`.
    pub to: Vec<String>,
    /// Bytes.
    pub bytes: u64,
}

impl PortInfo {
    /// True if it has the shape of an image, in frames of `size`.
    pub fn is_image(&self, size: [u32; 2]) -> bool {
        let [field] = self.port.fields.as_slice() else { return false };
        is_image(&field.element, self.dims, size)
    }
}

impl GraphInfo {
    /// Collects the information; `whole` is the plan with what was left out, if it could run.
    pub fn new(
        graph: &Graph,
        plan: &Plan,
        whole: Option<&Plan>,
        size: [u32; 2],
        gpu: Option<String>,
    ) -> Self {
        let node = |(id, node): (NodeId, &Node)| {
            let port = |(port, declared): (usize, &Port)| PortInfo {
                port: Port { meaning: graph.meaning(PortRef { node: id, port }), ..declared.clone() },
                dims: node.dims[port],
                source: node.sources[port].map(|at| graph.name(at)),
            };
            NodeInfo {
                name: node.name.clone(),
                written: node.written.clone(),
                kind: node.kind.clone(),
                side: node.side,
                bytes: plan.node_bytes(id),
                ports: node.declaration().ports.iter().enumerate().map(port).collect(),
                specs: node.stage.specs(),
            }
        };
        let crossing = Crossing { graph, plan };
        let step = |(id, step): (StepId, &Step)| {
            let (node, side) = match step {
                Step::Run(node) => (Some(plan.nodes[*node].name.clone()), plan.nodes[*node].side),
                Step::Upload(_) => (None, Side::Gpu),
                Step::Download(..) | Step::Tap { .. } => (None, Side::Cpu),
            };
            StepInfo {
                name: plan.step_name(step),
                node,
                side,
                is_tap: matches!(step, Step::Tap { .. }),
                transfer: crossing.transfer(id),
            }
        };
        let would_write = |name: &str| {
            let whole = whole?;
            Some(whole.node_bytes(whole.nodes.position(|planned| planned.name == name)?))
        };
        let left_out = plan.culled.iter().map(|culled| LeftOut {
            name: culled.node.clone(),
            kind: culled.kind.clone(),
            why: culled.why.clone(),
            bytes: would_write(&culled.node),
        });
        Self {
            nodes: graph.nodes.iter_enumerated().map(node).collect(),
            left_out: left_out.collect(),
            outputs: graph.outputs.iter().map(|(name, at)| (name.clone(), graph.name(*at))).collect(),
            steps: plan.steps.iter_enumerated().map(step).collect(),
            bytes: [plan.bytes(Side::Cpu), plan.bytes(Side::Gpu)],
            size,
            params: graph.params.clone(),
            gpu,
            dot: plan.dot(),
        }
    }

    /// The ports that are images, as `node.port`, in the order in which they are written.
    pub fn images(&self) -> Vec<String> {
        let nodes = self.steps.iter().filter_map(|step| self.node(step.node.as_deref()?));
        let ports = nodes.flat_map(|node| node.ports.iter().map(move |info| (node, info)));
        let images = ports.filter(|(_, info)| info.port.is_output() && info.is_image(self.size));
        images.map(|(node, info)| format!("{}.{}", node.name, info.port.name)).collect()
    }

    /// The node of that address; of a repeated node, the last copy.
    pub fn node(&self, name: &str) -> Option<&NodeInfo> {
        let exact = self.nodes.iter().find(|node| node.name == name);
        exact.or_else(|| self.nodes.iter().rfind(|node| node.written == name))
    }

    /// The value of a parameter of the graph itself, if `part` is empty, or of a part.
    pub fn value(&self, part: &str, name: &str) -> Option<&String> {
        let found = self.params.iter().find(|param| param.part == part && param.spec.name == name);
        found.map(|param| &param.value)
    }

    /// The port `node.port`.
    pub fn port(&self, name: &str) -> Option<&PortInfo> {
        let (node, port) = name.rsplit_once('.')?;
        self.node(node)?.ports.iter().find(|info| info.port.name == port)
    }

    /// Milliseconds of a node among the times of all steps.
    pub fn node_ms(&self, name: &str, times: &[f32]) -> Option<f32> {
        let of_node = |(step, ms): (&StepInfo, &f32)| (step.node.as_deref() == Some(name)).then_some(*ms);
        self.steps.iter().zip(times).find_map(of_node)
    }
}

/// Finds the ports between which a plan's transfers run.
struct Crossing<'a> {
    graph: &'a Graph,
    plan: &'a Plan,
}

impl Crossing<'_> {
    /// The value that a step transfers; `None` if it is not a transfer.
    fn transfer(&self, id: StepId) -> Option<Transfer> {
        let (value, download, side) = match self.plan.steps[id] {
            Step::Upload(value) => (value, None, Side::Gpu),
            Step::Download(value, download) => (value, Some(download), Side::Cpu),
            Step::Run(_) | Step::Tap { .. } => return None,
        };
        // A previous frame's value comes from the last step that wrote it.
        let steps = self.plan.steps.as_raw_slice();
        let index = id.index();
        let before = if value.previous { &steps[..0] } else { &steps[..index] };
        let writer = before.iter().rev().chain(steps.iter().rev());
        let from = writer.filter_map(run).find_map(|node| self.writes(node, value.storage))?;
        let mut to = Vec::new();
        for node in steps[index..].iter().filter_map(run) {
            if self.graph.nodes[node].side == side {
                to.extend(self.readers(node, value));
            }
            if !value.previous && self.writes(node, value.storage).is_some() {
                break;
            }
        }
        Some(Transfer { download, from, to, bytes: self.plan.storages[value.storage].bytes() })
    }

    /// The port through which a node writes a storage, if any.
    fn writes(&self, node: NodeId, storage: StorageId) -> Option<String> {
        let value = Value::now(storage);
        let ports = self.graph.nodes[node].declaration().ports.iter().zip(&self.plan.nodes[node].bindings);
        let mut found = ports.filter(|(port, values)| port.is_output() && values.contains(&Some(value)));
        found.next().map(|(port, _)| format!("{}.{}", self.graph.nodes[node].name, port.name))
    }

    fn readers(&self, node: NodeId, value: Value) -> impl Iterator<Item = String> {
        let node_name = &self.graph.nodes[node].name;
        let ports = self.graph.nodes[node].declaration().ports.iter().zip(&self.plan.nodes[node].bindings);
        ports
            .filter(move |(port, values)| port.access != Access::Write && values.contains(&Some(value)))
            .map(move |(port, _)| format!("{node_name}.{}", port.name))
    }
}

fn run(step: &Step) -> Option<NodeId> {
    match step {
        Step::Run(node) => Some(*node),
        _ => None,
    }
}
