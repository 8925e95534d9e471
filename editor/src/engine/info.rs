//! What is worth knowing of a graph that runs, as a value that any thread may keep.

use epigraph_core::{Culled, Dims, Graph, Plan, Port, Side, Step};
use epigraph_pictures::is_image;

/// A graph as compiled.
#[derive(Clone, Debug)]
pub struct GraphInfo {
    /// Nodes that run, those of parts as `part/node`.
    pub nodes: Vec<NodeInfo>,
    /// What was left out, and why.
    pub culled: Vec<Culled>,
    /// Names of the outputs, and the ports behind them.
    pub outputs: Vec<(String, String)>,
    /// What a frame does, in order.
    pub steps: Vec<StepInfo>,
    /// Bytes of memory on the CPU and on the GPU.
    pub bytes: [u64; 2],
    /// Width and height of the frame, pixels.
    pub size: [u32; 2],
    /// The GPU in use.
    pub gpu: Option<String>,
}

/// A node that runs.
#[derive(Clone, Debug)]
pub struct NodeInfo {
    /// Its address.
    pub name: String,
    /// Its stage kind.
    pub kind: String,
    /// Where it runs.
    pub side: Side,
    /// Bytes that it writes.
    pub bytes: u64,
    /// Its ports.
    pub ports: Vec<PortInfo>,
}

/// A port of a node that runs.
#[derive(Clone, Debug)]
pub struct PortInfo {
    /// What the stage declares.
    pub port: Port,
    /// How many elements there are.
    pub dims: Dims,
    /// The `node.port` that it takes from.
    pub source: Option<String>,
}

/// A step of a frame.
#[derive(Clone, Debug)]
pub struct StepInfo {
    /// The node's name, or the transfer's.
    pub name: String,
    /// The node that runs; none for transfers.
    pub node: Option<String>,
    /// Where it runs.
    pub side: Side,
    /// Whether it only copies something for whoever looks at it.
    pub is_tap: bool,
}

impl PortInfo {
    /// Whether it has the shape of an image, in frames of `size`.
    pub fn is_image(&self, size: [u32; 2]) -> bool {
        let [field] = self.port.fields.as_slice() else { return false };
        is_image(&field.element, self.dims, size)
    }
}

impl GraphInfo {
    /// Takes what is worth knowing.
    pub fn new(graph: &Graph, plan: &Plan, size: [u32; 2], gpu: Option<String>) -> Self {
        let node = |(index, node): (usize, &epigraph_core::Node)| {
            let port = |(port, declared): (usize, &Port)| PortInfo {
                port: declared.clone(),
                dims: node.dims[port],
                source: node.sources[port].map(|at| graph.name(at)),
            };
            NodeInfo {
                name: node.name.clone(),
                kind: node.kind.clone(),
                side: node.side,
                bytes: plan.node_bytes(index),
                ports: node.declaration().ports.iter().enumerate().map(port).collect(),
            }
        };
        let step = |step: &Step| {
            let (node, side) = match step {
                Step::Run(node) => (Some(plan.nodes[*node].0.clone()), plan.nodes[*node].2),
                Step::Upload(_) => (None, Side::Gpu),
                Step::Download(..) | Step::Tap(..) => (None, Side::Cpu),
            };
            StepInfo { name: plan.step_name(step), node, side, is_tap: matches!(step, Step::Tap(..)) }
        };
        Self {
            nodes: graph.nodes.iter().enumerate().map(node).collect(),
            culled: plan.culled.clone(),
            outputs: graph.outputs.iter().map(|(name, at)| (name.clone(), graph.name(*at))).collect(),
            steps: plan.steps.iter().map(step).collect(),
            bytes: [plan.bytes(Side::Cpu), plan.bytes(Side::Gpu)],
            size,
            gpu,
        }
    }

    /// The ports that are images, as `node.port`, in the order in which they are written.
    pub fn images(&self) -> Vec<String> {
        let nodes = self.steps.iter().filter_map(|step| self.node(step.node.as_deref()?));
        let ports = nodes.flat_map(|node| node.ports.iter().map(move |info| (node, info)));
        let images = ports.filter(|(_, info)| info.port.is_output() && info.is_image(self.size));
        images.map(|(node, info)| format!("{}.{}", node.name, info.port.name)).collect()
    }

    /// The node of that address.
    pub fn node(&self, name: &str) -> Option<&NodeInfo> {
        self.nodes.iter().find(|node| node.name == name)
    }

    /// Milliseconds of a node among the times of all steps.
    pub fn node_ms(&self, name: &str, times: &[f32]) -> Option<f32> {
        let of_node = |(step, ms): (&StepInfo, &f32)| (step.node.as_deref() == Some(name)).then_some(*ms);
        self.steps.iter().zip(times).find_map(of_node)
    }
}
