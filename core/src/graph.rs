//! A checked graph: every node has its stage, every wire connects compatible ports, every extent is a number.
//!
//! Checking continues after each problem, so that a file's problems are reported together. Nodes that the scene makes
//! needless are bypassed here, and nodes that nothing reads are left out; both with a reason in words.

mod remedy;
mod swap;

use std::{
    collections::{BTreeSet, HashMap, HashSet},
    mem,
};

use index_vec::IndexVec;

use self::swap::Differences;
use crate::{
    error::{GraphError, Problem, Problems, STAGE_KIND, Span, Spanned},
    facts::Facts,
    file::{Flat, FlatNode, GraphFile, GraphValue, NodeDef, PART_KIND, Source},
    id::{FlatId, NodeId},
    params::decimal,
    port::{Access, Dims, Extent, Field, FieldRef, Lifetime, Meaning, Port, share_of},
    registry::{NodeContext, Registry},
    shader::Pass,
    side::{Download, Side},
    stage::{AnyStage, Declaration},
};

/// Largest width or height of a frame in pixels.
pub const MAX_SIDE: u32 = 16384;

/// Maximum latency of a download in frames: each frame in flight keeps a buffer.
pub const MAX_LATENCY: u32 = 16;

/// What a graph is compiled for.
#[derive(Clone, Debug)]
pub struct Settings {
    /// Width and height of the frame, each 1 to [`MAX_SIDE`].
    pub size: [u32; 2],
    /// Maximum number of samples per frame: the extent of request lists.
    pub samples: u32,
    /// What the application states about the content it shows. A list as long as a quantity that is not stated is an
    /// error.
    pub facts: Facts,
    /// Default placement for nodes without `on:`.
    pub side: Side,
    /// Leave out nodes that the facts make needless. If false, every node of the file runs.
    pub prune: bool,
    /// Share memory between transients whose lifetimes do not overlap.
    pub pooling: bool,
    /// Fill transients with NaN or 0xDEADBEEF before their first use.
    pub poison: bool,
    /// Check every value that a node writes: a bad one is a [`RunError::Watch`](crate::RunError::Watch).
    /// The plan is the same. Transients are filled with zeros before their first use, so that the unused rest of a list
    /// is not taken for values; they are not poisoned then.
    pub watch: bool,
    /// Let twins use the vector instructions that the processor has beyond those of every processor of the platform
    /// ([`CpuContext::level`](crate::CpuContext::level)). They compute the same bits without.
    pub vectors: bool,
    /// Ports to read after their node has run: they keep their nodes alive.
    pub taps: Vec<Source>,
}

impl Settings {
    /// For a frame of this size with this content: everything on the CPU, pruned, pooled.
    pub fn new(size: [u32; 2], samples: u32, facts: Facts) -> Self {
        Self {
            size,
            samples,
            facts,
            side: Side::Cpu,
            prune: true,
            pooling: true,
            poison: false,
            watch: false,
            vectors: true,
            taps: Vec::new(),
        }
    }
}

/// A port of a node; of a running node unless stated otherwise.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct PortRef<N = NodeId> {
    /// The node.
    pub node: N,
    /// Index in the stage's ports.
    pub port: usize,
}

/// A node that runs.
pub struct Node {
    /// Its name in the file.
    pub name: String,
    /// The name of the node that it is a copy of: its own unless that is repeated.
    pub written: String,
    /// Its kind.
    pub kind: String,
    /// Where it runs.
    pub side: Side,
    /// How GPU results reach it when it runs on the CPU.
    pub download: Download,
    /// The parameters that differ from the stage's defaults, by name, with the RON text of their values.
    pub params: Vec<(String, String)>,
    /// Its stage.
    pub stage: Box<dyn AnyStage>,
    /// The source of each port, for connected inputs.
    pub sources: Vec<Option<PortRef>>,
    /// Width and height of each port.
    pub dims: Vec<Dims>,
}

impl Node {
    /// What its stage declared.
    pub fn declaration(&self) -> &Declaration {
        self.stage.declaration()
    }

    fn ports(&self) -> impl Iterator<Item = (usize, &Port, Option<PortRef>)> {
        self.declaration().ports.iter().enumerate().map(|(index, port)| (index, port, self.sources[index]))
    }

    /// Checks what a pass requires of the dims of its ports.
    fn check_pass(&self, pass: &Pass) -> Result<(), String> {
        let dims = |at: FieldRef| self.dims[at.port as usize];
        let port = |at: FieldRef| &self.declaration().ports[at.port as usize];
        let name = |at: FieldRef| port(at).variable(at.field as usize);
        if let Some(&counts) = pass.group_counts() {
            let given = |text: &str| format!("`{}` gives numbers of workgroups, but {text}", name(counts));
            if port(counts).is_input() && self.sources[counts.port as usize].is_none() {
                return Err(given("it is not connected"));
            }
            let element = &port(counts).fields[counts.field as usize].element;
            let bytes = dims(counts).count() as u64 * u64::from(element.bytes());
            if bytes < GROUP_COUNTS_BYTES {
                return Err(given(&format!("it has only {bytes} bytes; they are three u32")));
            }
        }
        let Pass::Draw { vertices, count, targets, .. } = pass else { return Ok(()) };
        if let [first, others @ ..] = &targets[..]
            && let Some(other) = others.iter().find(|other| dims(**other) != dims(*first))
        {
            return Err(format!(
                "a pass draws to `{}` ({}) and `{}` ({}); its targets must have the same size",
                name(*first),
                dims(*first),
                name(*other),
                dims(*other)
            ));
        }
        let elements = dims(*count).count() as u64;
        if elements.saturating_mul(u64::from(*vertices)) > u64::from(u32::MAX) {
            return Err(format!(
                "a pass draws {elements} elements of `{}` with {vertices} vertices each; {} vertices are the limit",
                name(*count),
                u32::MAX
            ));
        }
        Ok(())
    }
}

/// Bytes of the numbers of workgroups along x, y and z that an indirect dispatch reads.
const GROUP_COUNTS_BYTES: u64 = 12;

/// A node that was left out.
#[derive(Clone, Debug, PartialEq)]
pub struct Culled {
    /// Its name.
    pub node: String,
    /// Its kind.
    pub kind: String,
    /// Why.
    pub why: String,
}

/// A checked graph.
pub struct Graph {
    /// Nodes that run, in file order.
    pub nodes: IndexVec<NodeId, Node>,
    /// Named outputs.
    pub outputs: Vec<(String, PortRef)>,
    /// Further ports to read: the settings' taps, in order.
    pub taps: Vec<(Source, PortRef)>,
    /// What was left out.
    pub culled: Vec<Culled>,
    /// The parameters of the graph itself and of its parts.
    pub params: Vec<GraphValue>,
}

impl Graph {
    /// Checks a file against the registry. Reports every problem found.
    pub fn check(file: &GraphFile, registry: &Registry, settings: &Settings) -> Result<Self, Problems> {
        let [width, height] = settings.size;
        if !(1..=MAX_SIDE).contains(&width) || !(1..=MAX_SIDE).contains(&height) {
            let text = format!("invalid size {width}x{height}; each side must be 1 to {MAX_SIDE} pixels");
            return Err(Problem::new(GraphError::Invalid(text)).into());
        }
        let whole = file.whole()?;
        let flat = whole.flatten()?;
        let settings = &Settings { facts: registry.facts(&settings.facts), ..settings.clone() };
        let mut checker = Checker::new(&flat, registry, settings);
        let made = checker.make_all();
        checker.check_placing(&made);
        let wires = checker.wire(&made);
        let outputs = checker.outputs(&made);
        checker.report_differences(|node, port| {
            let index = flat.nodes.position(|known| known.def.name.value == node);
            let made = index.and_then(|index| made[index].as_ref());
            made.is_none_or(|made| made.ports().iter().any(|known| known.name == port && known.is_input()))
        });
        let taps = checker.taps(&made);
        checker.finish()?;
        let mut made: IndexVec<FlatId, Made> =
            made.into_iter().map(|made| made.expect("no problems, so all were made")).collect();

        let mut checker = Checker::new(&flat, registry, settings);
        let mut bypass = checker.bypass(&made, wires, outputs, taps);
        checker.finish()?;
        checker.remake(&mut made, &mut bypass);
        checker.finish()?;
        let live = live(&made, &bypass);
        let graph = checker.assemble(made, bypass, &live);
        checker.finish()?;
        Ok(graph)
    }

    /// The node with this name.
    pub fn node(&self, name: &str) -> Option<NodeId> {
        self.nodes.position(|node| node.name == name)
    }

    /// The port that first wrote the storage behind an output, through all updates in place.
    pub fn root(&self, mut at: PortRef) -> PortRef {
        while self.nodes[at.node].declaration().ports[at.port].access == Access::Update {
            at = self.nodes[at.node].sources[at.port].expect("updates are connected");
        }
        at
    }

    /// What the values of a port mean: as its stage declares, otherwise as the connected port.
    pub fn meaning(&self, mut at: PortRef) -> Option<Meaning> {
        loop {
            let node = &self.nodes[at.node];
            match (node.declaration().ports[at.port].meaning, node.sources[at.port]) {
                (None, Some(source)) => at = source,
                (meaning, _) => return meaning,
            }
        }
    }

    /// Sets [`Node::dims`] from the declared extents. An error names the node and the problem with its extents.
    pub(crate) fn resolve_dims(&mut self, settings: &Settings) -> Result<(), (NodeId, String)> {
        let mut resolver = Resolver { graph: self, settings, known: HashMap::new() };
        for node in self.nodes.indices() {
            for port in 0..resolver.graph.nodes[node].sources.len() {
                resolver.dims(PortRef { node, port }).map_err(|text| (node, text))?;
            }
        }
        let known = resolver.known.into_iter();
        for (at, dims) in known.filter_map(|(at, dims)| Some((at, dims?))) {
            self.nodes[at.node].dims[at.port] = dims;
        }
        for (index, node) in self.nodes.iter_enumerated() {
            for pass in &node.declaration().passes {
                node.check_pass(pass).map_err(|text| (index, text))?;
            }
        }
        Ok(())
    }

    /// `node.port` as text.
    pub fn name(&self, at: PortRef) -> String {
        let node = &self.nodes[at.node];
        format!("{}.{}", node.name, node.declaration().ports[at.port].name)
    }
}

/// The stage of `node`, which is a node of the graph or that with other parameters, if the inputs are connected that
/// `connected` says.
fn stage(
    flat: &FlatNode,
    node: &NodeDef,
    registry: &Registry,
    connected: &dyn Fn(&str) -> bool,
) -> Result<Box<dyn AnyStage>, Problems> {
    let FlatNode { file, places, .. } = flat;
    let Some(kind) = registry.get(&node.kind.value) else {
        let known = registry.kinds().map(|kind| kind.name()).chain([PART_KIND]);
        let error = GraphError::unknown(STAGE_KIND, &node.kind.value, known);
        return Err(Problem::new(error).at(file.place(node.kind.span)).node(&node.name.value).into());
    };
    kind.make(&NodeContext { file, node, connected, registry, places })
}

/// The stage of each node of a graph, with every input connected, whether or not the graph's wires fit.
///
/// # Errors
/// All problems of kinds and parameters.
pub(crate) fn stages(flat: &Flat, registry: &Registry) -> Result<Vec<Box<dyn AnyStage>>, Problems> {
    let mut problems = Problems::default();
    let mut stages = Vec::new();
    for node in &flat.nodes {
        match stage(node, &node.def, registry, &|_| true) {
            Ok(stage) => stages.push(stage),
            Err(found) => problems.append(found),
        }
    }
    problems.into_result()?;
    Ok(stages)
}

/// A node of a graph with its stage, whether or not it will run.
pub struct StageOf {
    /// The node's address.
    pub address: String,
    /// The address as it is written: that of the repeated node, for its copies.
    pub written: String,
    /// The stage, with every input connected.
    pub stage: Box<dyn AnyStage>,
}

impl GraphFile {
    /// The stages of all nodes, in file order. Wires are not checked.
    ///
    /// # Errors
    /// All problems of changes, parts, kinds and parameters.
    pub fn stages(&self, registry: &Registry) -> Result<Vec<StageOf>, Problems> {
        let whole = self.whole()?;
        let flat = whole.flatten()?;
        let nodes = flat.nodes.iter().zip(stages(&flat, registry)?);
        let of = |(node, stage): (&FlatNode, _)| {
            let (address, written) = (node.def.name.value.clone(), node.written.clone());
            StageOf { address, written, stage }
        };
        Ok(nodes.map(of).collect())
    }
}

/// A node's stage before its wires are checked.
struct Made {
    stage: Box<dyn AnyStage>,
}

impl Made {
    fn ports(&self) -> &[Port] {
        &self.stage.declaration().ports
    }

    /// Whether it can run on this side, with these facts.
    fn runs_on(&self, side: Side, facts: &Facts) -> bool {
        self.stage.declaration().runs_on(side) && self.stage.unable(side, facts).is_none()
    }

    /// Index of the port with this name.
    fn port(&self, name: &str) -> Option<usize> {
        self.stage.declaration().port(name)
    }
}

/// A port of a node of the file, whether or not that node will run.
type FlatPort = PortRef<FlatId>;

/// For each node of the file, the sources of its connected inputs by their ports.
type Wires = IndexVec<FlatId, HashMap<usize, FlatPort>>;

struct Bypassed {
    wires: Wires,
    outputs: Vec<(String, FlatPort)>,
    taps: Vec<(Source, FlatPort)>,
    why: HashMap<FlatId, String>,
}

/// Why a source names no output port.
#[derive(Clone, Copy)]
enum NoPort {
    /// There is no such node.
    Node,
    /// This node has no such output.
    Of(FlatId),
}

struct Checker<'a> {
    flat: &'a Flat<'a>,
    registry: &'a Registry,
    settings: &'a Settings,
    problems: Problems,
    /// Problems that are not listed: the written nodes, places and ports.
    counted: HashSet<(&'a str, Span, Option<String>)>,
    differences: Differences,
    by_name: HashMap<&'a str, FlatId>,
}

impl<'a> Checker<'a> {
    fn new(flat: &'a Flat<'a>, registry: &'a Registry, settings: &'a Settings) -> Self {
        let names = flat.nodes.iter_enumerated().map(|(index, node)| (&node.def.name.value[..], index));
        Self {
            flat,
            registry,
            settings,
            problems: Problems::default(),
            counted: HashSet::new(),
            differences: Differences::default(),
            by_name: names.collect(),
        }
    }

    /// `Ok` if there are no problems.
    fn finish(&mut self) -> Result<(), Problems> {
        mem::take(&mut self.problems).into_result()
    }

    /// Adds a problem, unless it is one that several copies of a node have in common and is reported already.
    fn add(&mut self, problem: Problem) {
        let written = |problem: &Problem| {
            let node = self.by_name.get(&problem.node.as_ref()?[..])?;
            Some(&self.flat.nodes[*node].written)
        };
        let is_same = |other: &Problem| {
            let kind = |problem: &Problem| mem::discriminant(&problem.error);
            let of = |problem| (written(problem), kind(problem));
            of(other) == of(&problem)
                && (&other.place, &other.port) == (&problem.place, &problem.port)
                && (other.node != problem.node || other.error == problem.error)
        };
        if written(&problem).is_none() || !self.problems.0.iter().any(is_same) {
            self.problems.add(|| problem);
        }
    }

    /// Whether a problem at this place is to be listed. Otherwise it is counted, once for all copies of a node.
    fn has_room(&mut self, node: FlatId, span: Span, port: Option<&str>) -> bool {
        if self.problems.is_full()
            && self.counted.insert((&self.flat.nodes[node].written, span, port.map(str::to_owned)))
        {
            self.problems.count(1);
        }
        !self.problems.is_full()
    }

    fn problem(&mut self, node: FlatId, span: Span, port: Option<&str>, error: GraphError) {
        if !self.has_room(node, span, port) {
            return;
        }
        let FlatNode { def, file, .. } = &self.flat.nodes[node];
        let mut problem = Problem::new(error).at(file.place(span)).node(&def.name.value);
        problem.port = port.map(str::to_owned);
        self.add(problem);
    }

    fn make(&mut self, index: FlatId, connected: &dyn Fn(&str) -> bool) -> Option<Made> {
        match stage(&self.flat.nodes[index], &self.flat.nodes[index].def, self.registry, connected) {
            Ok(stage) => Some(Made { stage }),
            Err(problems) => {
                for problem in problems.0 {
                    match problem.error {
                        GraphError::More(more) => self.problems.count(more),
                        _ => self.add(problem),
                    }
                }
                None
            }
        }
    }

    fn make_all(&mut self) -> IndexVec<FlatId, Option<Made>> {
        let flat = self.flat;
        flat.nodes
            .indices()
            .map(|index| {
                let inputs = &flat.nodes[index].def.inputs;
                self.make(index, &|name| inputs.iter().any(|input| input.port.value == name))
            })
            .collect()
    }

    /// Checks where nodes are placed, and what that says of their parts' defaults; also of nodes that will not run.
    fn check_placing(&mut self, made: &IndexVec<FlatId, Option<Made>>) {
        let flat = self.flat;
        for (index, FlatNode { def: node, .. }) in flat.nodes.iter_enumerated() {
            if let Some(Spanned { value: Download::Latent(frames), span }) = node.download
                && !(1..=MAX_LATENCY).contains(&frames)
            {
                let text = format!(
                    "invalid latency Latent({frames}); a download may be 1 to {MAX_LATENCY} frames late"
                );
                self.problem(index, span, None, GraphError::Invalid(text));
            }
            let Some(stage) = &made[index] else { continue };
            let declaration = stage.stage.declaration();
            if let Some(on) = &node.on {
                let why = if declaration.runs_on(on.value) {
                    stage.stage.unable(on.value, &self.settings.facts).map(str::to_owned)
                } else {
                    Some(format!("this stage has no {} form", on.value))
                };
                if let Some(why) = why {
                    let text = format!("cannot run on {}: {why}", on.value);
                    self.problem(index, on.span, None, GraphError::Invalid(text));
                }
            }
            let on_gpu = node.on.as_ref().is_some_and(|on| on.value == Side::Gpu);
            if let Some(download) = &node.download
                && (on_gpu || !declaration.runs_on(Side::Cpu))
            {
                let text = "`download` says how results of the GPU reach a node on the CPU, but this one runs on the GPU";
                self.problem(index, download.span, None, GraphError::Invalid(text.into()));
            }
        }
        for (index, part) in flat.placed.iter().enumerate() {
            let mut nodes = flat.nodes.iter_enumerated().filter(|(_, node)| node.default.part == Some(index));
            // A node that was not made may be one that takes the placement.
            let takes = |(at, node): (FlatId, &FlatNode)| {
                node.def.on.is_none()
                    && made[at].as_ref().is_none_or(|made| made.runs_on(part.on.value, &self.settings.facts))
            };
            if !nodes.any(takes) {
                let text = format!(
                    "`on` changes nothing: the part has no node that can run on the {} and does not say itself where it runs",
                    part.on.value
                );
                let place = part.file.place(part.on.span);
                // A repeated part is told once.
                if self.problems.0.iter().all(|problem| problem.place.as_ref() != Some(&place)) {
                    let problem = Problem::new(GraphError::Invalid(text)).at(place);
                    self.problems.add(|| problem.node(&part.node));
                }
            }
        }
    }

    /// The output port that `source` names. `None`, without a problem, if its node is itself invalid.
    fn resolve(
        &self,
        source: &Source,
        made: &IndexVec<FlatId, Option<Made>>,
    ) -> Result<Option<FlatPort>, NoPort> {
        let Some(&node) = self.by_name.get(&source.node[..]) else { return Err(NoPort::Node) };
        let Some(made) = &made[node] else { return Ok(None) };
        match made.ports().iter().position(|port| port.name == source.port && port.is_output()) {
            Some(port) => Ok(Some(PortRef { node, port })),
            None => Err(NoPort::Of(node)),
        }
    }

    /// What to report of a port that could not be resolved. It looks at all names that are known.
    fn unresolved(&self, source: &Source, why: NoPort, made: &IndexVec<FlatId, Option<Made>>) -> GraphError {
        match why {
            NoPort::Node => {
                let known = self.flat.nodes.iter().map(|node| &node.def.name.value);
                self.no_output(source).unwrap_or_else(|| GraphError::unknown_node(&source.node, known))
            }
            NoPort::Of(node) => {
                let ports = made[node].iter().flat_map(|made| made.ports());
                let known = ports.filter(|port| port.is_output()).map(|port| &port.name);
                let has_it =
                    |ports: &[Port]| ports.iter().any(|port| port.is_output() && port.name == source.port);
                match &self.remedies(node, has_it)[..] {
                    [] => GraphError::unknown("output port", &source.port, known),
                    settings => GraphError::Invalid(format!(
                        "the output `{}` of `{}` needs {}",
                        source.port,
                        source.node,
                        settings.join(" or ")
                    )),
                }
            }
        }
    }

    fn wire(&mut self, made: &IndexVec<FlatId, Option<Made>>) -> Wires {
        let flat = self.flat;
        let mut wires: Wires = made.iter().map(|_| HashMap::new()).collect();
        for (index, FlatNode { def: node, .. }) in flat.nodes.iter_enumerated() {
            let mut unresolved = BTreeSet::new();
            for input in &node.inputs {
                let port = made[index].as_ref().and_then(|stage| {
                    stage.ports().iter().position(|port| port.name == input.port.value && port.is_input())
                });
                let is_dropped =
                    made[index].is_some() && port.is_none() && self.is_kept(index, &input.port.value);
                if is_dropped {
                    continue;
                }
                let source = match self.resolve(&input.from.value, made) {
                    Ok(source) => source,
                    Err(why) => {
                        let (name, span) = (&input.port.value[..], input.from.span);
                        let declared = port.and_then(|port| Some(&made[index].as_ref()?.ports()[port]));
                        if !self.lacks_output(&input.from.value, Some((index, name, declared)), "", span)
                            && self.has_room(index, span, Some(name))
                        {
                            let error = self.unresolved(&input.from.value, why, made);
                            self.problem(index, span, Some(name), error);
                        }
                        None
                    }
                };
                let Some(stage) = &made[index] else { continue };
                let Some(port) = port else {
                    let known = stage.ports().iter().filter(|port| port.is_input()).map(|port| &port.name);
                    let error = GraphError::unknown("input", &input.port.value, known);
                    self.problem(index, input.port.span, Some(&input.port.value), error);
                    continue;
                };
                match source {
                    Some(source) => {
                        wires[index].insert(port, source);
                    }
                    None => {
                        unresolved.insert(port);
                    }
                }
            }
            let Some(stage) = &made[index] else { continue };
            self.check_through(index, stage.ports());
            for (at, port) in stage.ports().iter().enumerate() {
                let connected = wires[index].contains_key(&at) || unresolved.contains(&at);
                if port.is_input() && !port.optional && !connected && !self.lacks_input(index, port) {
                    let error =
                        GraphError::Missing { port: port.name.to_string(), doc: port.doc.to_string() };
                    let cut = node.cut.iter().find(|cut| cut.value == *port.name);
                    let span = cut.map_or(node.name.span, |cut| cut.span);
                    self.problem(index, span, Some(&port.name), error);
                }
            }
        }
        self.check_types(made, &wires);
        wires
    }

    /// Checks the names of the ports that chain a repeated node's copies.
    fn check_through(&mut self, index: FlatId, ports: &[Port]) {
        let flat = self.flat;
        for (input, output) in flat.nodes[index].def.repeat.iter().flat_map(|repeat| &repeat.through) {
            let mut check = |what, name: &Spanned<String>, is_such: fn(&Port) -> bool| {
                let mut known = ports.iter().filter(|port| is_such(port)).map(|port| &port.name);
                if known.all(|known| known != name.value.as_str()) {
                    let known = ports.iter().filter(|port| is_such(port)).map(|port| &port.name);
                    let error = GraphError::unknown(what, &name.value, known);
                    self.problem(index, name.span, Some(&input.value), error);
                }
            };
            check("input", input, Port::is_input);
            check("output port", output, Port::is_output);
        }
    }

    fn check_types(&mut self, made: &IndexVec<FlatId, Option<Made>>, wires: &Wires) {
        let flat = self.flat;
        for (index, inputs) in wires.iter_enumerated() {
            let Some(stage) = &made[index] else { continue };
            let mut inputs: Vec<_> = inputs.iter().collect();
            inputs.sort();
            for (&port, source) in inputs {
                let Some(from) = &made[source.node] else { continue };
                let given = full_fields(made, wires, *source);
                let Some(given) = given else { continue };
                let wanted = &stage.ports()[port];
                if accepts(wanted, given) {
                    continue;
                }
                let source_port = Source {
                    node: flat.nodes[source.node].def.name.value.clone(),
                    port: from.ports()[source.port].name.to_string(),
                };
                if self.has_other_type(index, wanted, &source_port, given) {
                    continue;
                }
                let mut settings = self.remedies(index, |ports| {
                    ports.iter().any(|port| port.name == wanted.name && accepts(port, given))
                });
                settings.extend(self.remedies(source.node, |ports| {
                    ports.iter().any(|port| port.name == source_port.port && accepts(wanted, port))
                }));
                let error = GraphError::Type {
                    port: wanted.name.to_string(),
                    source_port: source_port.to_string(),
                    expected: describe(wanted) + &remedy::or_set(&settings),
                    found: describe(given),
                };
                let span = self.input_span(index, &wanted.name);
                self.problem(index, span, Some(&wanted.name), error);
            }
        }
    }

    fn input_span(&self, node: FlatId, port: &str) -> Span {
        let node = &self.flat.nodes[node].def;
        node.inputs
            .iter()
            .find(|input| input.port.value == port)
            .map_or(node.name.span, |input| input.from.span)
    }

    fn outputs(&mut self, made: &IndexVec<FlatId, Option<Made>>) -> Vec<(String, FlatPort)> {
        let (flat, file) = (self.flat, self.flat.file);
        let mut outputs = Vec::new();
        for output in &flat.outputs {
            match self.resolve(&output.from.value, made) {
                Ok(Some(at)) => outputs.push((output.name.value.clone(), at)),
                Ok(None) => {}
                Err(why) => {
                    let (name, span) = (&output.name.value, output.from.span);
                    if self.lacks_output(&output.from.value, None, name, span) {
                        continue;
                    }
                    let mut problems = mem::take(&mut self.problems);
                    problems.add(|| {
                        let error = self.unresolved(&output.from.value, why, made);
                        Problem::new(error).at(file.place(span)).port(name)
                    });
                    self.problems = problems;
                }
            }
        }
        if flat.outputs.is_empty() {
            let text = "the graph has no outputs; write outputs: { \"image\": \"NODE.PORT\" }";
            let problem = || Problem::new(GraphError::Invalid(text.into())).at(file.place(Span::default()));
            self.problems.add(problem);
        }
        outputs
    }

    fn taps(&mut self, made: &IndexVec<FlatId, Option<Made>>) -> Vec<(Source, FlatPort)> {
        let mut taps = Vec::new();
        for source in &self.settings.taps {
            let found = self.flat.resolve(source).and_then(|source| {
                self.resolve(&source, made).map_err(|why| self.unresolved(&source, why, made))
            });
            match found {
                Ok(Some(at)) => taps.push((source.clone(), at)),
                Ok(None) => {}
                Err(error) => self.problems.add(|| Problem::new(error)),
            }
        }
        taps
    }

    /// Decides which nodes are bypassed and rewires around them: an updated port is replaced by its input, a written
    /// one by the first connected input with the same element, or by nothing.
    fn bypass(
        &mut self,
        made: &IndexVec<FlatId, Made>,
        wires: Wires,
        outputs: Vec<(String, FlatPort)>,
        taps: Vec<(Source, FlatPort)>,
    ) -> Bypassed {
        let mut bypassed = Bypassed { wires, outputs, taps, why: HashMap::new() };
        // What a needless stage needed may be needless without it.
        let refused = loop {
            let before = bypassed.why.len();
            let refused = self.bypass_once(made, &mut bypassed);
            if bypassed.why.len() == before {
                break refused;
            }
        };
        for (index, reason) in refused {
            let span = self.flat.nodes[index].def.name.span;
            self.problem(index, span, None, GraphError::Invalid(format!("cannot be bypassed: {reason}")));
        }
        bypassed
    }

    /// Bypasses nodes whose output nothing else needs. Returns those that the file bypasses and that have to stay, and why.
    fn bypass_once(&self, made: &IndexVec<FlatId, Made>, bypassed: &mut Bypassed) -> Vec<(FlatId, String)> {
        let mut refused = Vec::new();
        for (index, stage) in made.iter_enumerated() {
            if bypassed.why.contains_key(&index) {
                continue;
            }
            let asked = self.flat.nodes[index].def.bypass;
            let needless =
                if self.settings.prune { stage.stage.needless(&self.settings.facts) } else { None };
            let why = match (asked, needless) {
                (true, _) => "bypassed in the graph file".to_owned(),
                (false, Some(why)) => why.to_owned(),
                (false, None) => continue,
            };
            match step_over(made, bypassed, index, asked) {
                Ok((wires, outputs, taps)) => {
                    bypassed.wires = wires;
                    bypassed.outputs = outputs;
                    bypassed.taps = taps;
                    bypassed.why.insert(index, why);
                }
                Err(reason) if asked => refused.push((index, reason)),
                // A stage that the scene makes needless stays if something still needs its output.
                Err(_) => {}
            }
        }
        refused
    }

    /// Declares the stages again whose optional inputs lost their source to a bypass. Such a stage may have fewer ports
    /// then, so everything that refers to one by its index is resolved again by name.
    fn remake(&mut self, made: &mut IndexVec<FlatId, Made>, bypass: &mut Bypassed) {
        let mut lost_by = HashMap::new();
        // A stage may lose an input to one that was made again.
        while let Some((index, lost)) = self.lost_inputs(made, bypass, &lost_by) {
            let kept: BTreeSet<String> =
                bypass.wires[index].keys().map(|&port| made[index].ports()[port].name.to_string()).collect();
            if let Some(again) = self.make(index, &|name| kept.contains(name)) {
                let before = mem::replace(&mut made[index], again);
                self.renumber(index, &before, made, bypass, &lost);
            }
            lost_by.insert(index, lost);
        }
    }

    /// A node that runs, and its inputs that the file connects and that lost their source; one that `known` does not
    /// list with these.
    fn lost_inputs(
        &self,
        made: &IndexVec<FlatId, Made>,
        bypass: &Bypassed,
        known: &HashMap<FlatId, Vec<String>>,
    ) -> Option<(FlatId, Vec<String>)> {
        let is_lost = |index: FlatId, name: &str| {
            made[index].port(name).is_some_and(|port| !bypass.wires[index].contains_key(&port))
        };
        let running = made.indices().filter(|index| !bypass.why.contains_key(index));
        let lost = running.map(|index| {
            let names = self.flat.nodes[index].def.inputs.iter().map(|input| &input.port.value);
            (index, names.filter(|name| is_lost(index, name)).cloned().collect::<Vec<_>>())
        });
        let mut news = lost.filter(|(index, lost)| !lost.is_empty() && known.get(index) != Some(lost));
        news.next()
    }

    /// Resolves by name what refers to the ports of a node that was made again without its inputs `lost`.
    fn renumber(
        &mut self,
        index: FlatId,
        before: &Made,
        made: &IndexVec<FlatId, Made>,
        bypass: &mut Bypassed,
        lost: &[String],
    ) {
        let moved = |port: usize| made[index].port(&before.ports()[port].name);
        let found = |at: &FlatPort| if at.node == index { moved(at.port) } else { Some(at.port) };
        let missing = |port: usize| {
            format!(
                "`{}.{}` does not exist now: nothing is connected to `{}`, since its source is left out",
                self.flat.nodes[index].def.name.value,
                before.ports()[port].name,
                lost.join("`, `")
            )
        };
        let mut problems = Vec::new();

        let own = mem::take(&mut bypass.wires[index]);
        bypass.wires[index] =
            own.into_iter().filter_map(|(port, source)| Some((moved(port)?, source))).collect();
        for (consumer, inputs) in bypass.wires.iter_mut_enumerated() {
            inputs.retain(|&input, source| {
                if let Some(port) = found(source) {
                    source.port = port;
                    return true;
                }
                let wanted = &made[consumer].ports()[input];
                if !wanted.optional && !bypass.why.contains_key(&consumer) {
                    let error = GraphError::Invalid(missing(source.port));
                    problems.push((consumer, wanted.name.to_string(), error));
                }
                false
            });
        }
        for (name, at) in &mut bypass.outputs {
            match found(at) {
                Some(port) => at.port = port,
                None => self.problems.add(|| Problem::new(GraphError::Invalid(missing(at.port))).port(name)),
            }
        }
        for (_, at) in &mut bypass.taps {
            match found(at) {
                Some(port) => at.port = port,
                None => self.problems.add(|| Problem::new(GraphError::Invalid(missing(at.port)))),
            }
        }
        for (consumer, port, error) in problems {
            self.problem(consumer, self.input_span(consumer, &port), Some(&port), error);
        }
    }

    fn assemble(&mut self, made: IndexVec<FlatId, Made>, bypass: Bypassed, live: &BTreeSet<FlatId>) -> Graph {
        let flat = self.flat;
        let mut culled = Vec::new();
        let mut place: HashMap<FlatId, NodeId> = HashMap::new();
        for (index, FlatNode { def: node, .. }) in flat.nodes.iter_enumerated() {
            if live.contains(&index) {
                place.insert(index, NodeId::from_usize(place.len()));
                continue;
            }
            let why = bypass
                .why
                .get(&index)
                .cloned()
                .unwrap_or_else(|| "nothing that is shown depends on it".into());
            culled.push(Culled { node: node.name.value.clone(), kind: node.kind.value.clone(), why });
        }
        let renumber = |at: &FlatPort| PortRef { node: place[&at.node], port: at.port };
        let mut nodes = IndexVec::new();
        for (index, made) in made.into_iter_enumerated() {
            if !live.contains(&index) {
                continue;
            }
            let FlatNode { def: node, default, written, .. } = &flat.nodes[index];
            let declaration = made.stage.declaration();
            let sources = (0..declaration.ports.len())
                .map(|port| bypass.wires[index].get(&port).map(renumber))
                .collect();
            let dims = vec![Dims::default(); declaration.ports.len()];
            let preferred = default.side.unwrap_or(self.settings.side);
            let side = match &node.on {
                Some(on) => on.value,
                None if made.runs_on(preferred, &self.settings.facts) => preferred,
                None => preferred.other(),
            };
            nodes.push(Node {
                name: node.name.value.clone(),
                written: written.clone(),
                kind: node.kind.value.clone(),
                side,
                download: node
                    .download
                    .as_ref()
                    .map(|download| download.value)
                    .or(default.download)
                    .unwrap_or_default(),
                params: node
                    .params
                    .iter()
                    .map(|param| (param.name.value.clone(), param.value.value.clone()))
                    .collect(),
                stage: made.stage,
                sources,
                dims,
            });
        }
        let outputs = bypass.outputs.iter().map(|(name, at)| (name.clone(), renumber(at))).collect();
        let taps = bypass.taps.iter().map(|(source, at)| (source.clone(), renumber(at))).collect();
        let mut graph = Graph { nodes, outputs, taps, culled, params: flat.params.clone() };
        self.check_updates(&graph);
        if self.problems.0.is_empty() {
            self.resolve_dims(&mut graph);
        }
        graph
    }

    /// Each version of a resource has at most one updater, and history is only kept of resources that are not updated.
    fn check_updates(&mut self, graph: &Graph) {
        let mut updater: HashMap<PortRef, NodeId> = HashMap::new();
        for (index, node) in graph.nodes.iter_enumerated() {
            for (_, port, source) in node.ports() {
                let (Access::Update, Some(source)) = (port.access, source) else { continue };
                if let Some(first) = updater.insert(source, index) {
                    let error = GraphError::DoublyWritten {
                        source_port: graph.name(source),
                        first: graph.nodes[first].name.clone(),
                        second: node.name.clone(),
                    };
                    let at = self.index_in_file(&node.name);
                    let span = self.input_span(at, &port.name);
                    self.problem(at, span, Some(&port.name), error);
                }
            }
        }
        for node in &graph.nodes {
            for (_, port, source) in node.ports() {
                let (Access::History, Some(source)) = (port.access, source) else { continue };
                let root = graph.nodes[graph.root(source).node].declaration().ports[graph.root(source).port]
                    .lifetime;
                let updated = graph.root(source) != source || updater.contains_key(&source);
                if root == Lifetime::Persistent || updated {
                    let text = format!(
                        "`{}` is kept or updated in place, so its value of the last frame is gone; history inputs take \
                         ports that are written anew each frame",
                        graph.name(source)
                    );
                    let at = self.index_in_file(&node.name);
                    let span = self.input_span(at, &port.name);
                    self.problem(at, span, Some(&port.name), GraphError::Invalid(text));
                }
            }
        }
    }

    fn index_in_file(&self, name: &str) -> FlatId {
        *self.by_name.get(name).expect("graph nodes come from the file")
    }

    fn resolve_dims(&mut self, graph: &mut Graph) {
        if let Err((node, text)) = graph.resolve_dims(self.settings) {
            let at = self.index_in_file(&graph.nodes[node].name);
            let span = self.flat.nodes[at].def.name.span;
            self.problem(at, span, None, GraphError::Invalid(text));
            return;
        }
        let mut resolver = Resolver { graph, settings: self.settings, known: HashMap::new() };
        for node in resolver.graph.nodes.indices() {
            for port in 0..resolver.graph.nodes[node].sources.len() {
                let at = PortRef { node, port };
                let found = resolver.graph.nodes[node].dims[port];
                let expected = resolver.wanted(at);
                let graph = resolver.graph;
                let declared = &graph.nodes[node].declaration().ports[port];
                let (port, extent) = (declared.name.to_string(), &declared.extent);
                let Some(source) = graph.nodes[node].sources[at.port] else { continue };
                let error = match expected {
                    Ok(None) => continue,
                    Ok(Some(expected)) if expected == found => continue,
                    Ok(Some(expected)) => GraphError::Extent {
                        port: port.clone(),
                        source_port: graph.name(source),
                        expected: {
                            let [reader, writer] =
                                [node, source.node].map(|node| self.index_in_file(&graph.nodes[node].name));
                            let settings = [self.alike(reader, writer), self.alike(writer, reader)].concat();
                            format!("{expected} ({extent}){}", remedy::or_set(&settings))
                        },
                        found: found.to_string(),
                    },
                    Err(text) => GraphError::Invalid(text),
                };
                let index = self.index_in_file(&graph.nodes[node].name);
                self.problem(index, self.input_span(index, &port), Some(&port), error);
            }
        }
    }
}

/// Whether an input takes what another port gives.
fn accepts(input: &Port, given: &Port) -> bool {
    let has = |field: &Field| {
        let same = |other: &Field| other.name == field.name && field.element.accepts(&other.element);
        given.fields.iter().any(same)
    };
    input.fields.iter().all(has)
}

fn describe(port: &Port) -> String {
    match port.fields.as_slice() {
        [one] if one.name.is_empty() => one.element.to_string(),
        fields => {
            let fields: Vec<String> = fields.iter().map(|f| format!("{}: {}", f.name, f.element)).collect();
            format!("a bundle of {}", fields.join(", "))
        }
    }
}

/// The port whose fields an output carries: an update of some fields of a bundle passes on all of them.
fn full_fields<'m>(
    made: &'m IndexVec<FlatId, Option<Made>>,
    wires: &Wires,
    mut at: FlatPort,
) -> Option<&'m Port> {
    for _ in 0..made.len() + 1 {
        let port = &made[at.node].as_ref()?.ports()[at.port];
        if port.access != Access::Update {
            return Some(port);
        }
        at = *wires[at.node].get(&at.port)?;
    }
    // The updates form a cycle; that is reported as such later.
    None
}

type Rewired = (Wires, Vec<(String, FlatPort)>, Vec<(Source, FlatPort)>);

/// Rewires around a node. If the user did not ask for it, a tap of what the node itself writes keeps the node: the value
/// of another port would be a wrong answer.
fn step_over(
    made: &IndexVec<FlatId, Made>,
    now: &Bypassed,
    index: FlatId,
    asked: bool,
) -> Result<Rewired, String> {
    let ports = made[index].ports();
    let replacement = |port: usize| -> Option<FlatPort> {
        let inputs = &now.wires[index];
        if ports[port].access == Access::Update {
            return inputs.get(&port).copied();
        }
        let like = |other: &Port| other.access == Access::Read && other.fields == ports[port].fields;
        (0..ports.len()).filter(|&other| like(&ports[other])).find_map(|other| inputs.get(&other).copied())
    };
    let mut wires = now.wires.clone();
    for (consumer, inputs) in wires.iter_mut_enumerated() {
        if consumer == index || now.why.contains_key(&consumer) {
            continue;
        }
        let affected: Vec<usize> =
            inputs.iter().filter(|(_, source)| source.node == index).map(|(&port, _)| port).collect();
        for port in affected {
            match replacement(inputs[&port].port) {
                Some(source) => {
                    inputs.insert(port, source);
                }
                None if made[consumer].ports()[port].optional => {
                    inputs.remove(&port);
                }
                None => {
                    return Err(format!(
                        "`{}` of another node needs its output",
                        made[consumer].ports()[port].name
                    ));
                }
            }
        }
    }
    let redirect = |at: FlatPort| if at.node == index { replacement(at.port) } else { Some(at) };
    let mut outputs = Vec::new();
    for (name, at) in &now.outputs {
        outputs.push((name.clone(), redirect(*at).ok_or_else(|| format!("the output `{name}` needs it"))?));
    }
    let mut taps = Vec::new();
    for (source, at) in &now.taps {
        let keeps = at.node == index && !asked && ports[at.port].access == Access::Write;
        let at = if keeps { None } else { redirect(*at) };
        taps.push((source.clone(), at.ok_or_else(|| format!("`{source}` was requested"))?));
    }
    Ok((wires, outputs, taps))
}

/// The nodes that some output or tap depends on, in this frame or through history and kept memory.
fn live(made: &IndexVec<FlatId, Made>, bypass: &Bypassed) -> BTreeSet<FlatId> {
    let mut live = BTreeSet::new();
    let mut todo: Vec<FlatId> = bypass
        .outputs
        .iter()
        .map(|(_, at)| at.node)
        .chain(bypass.taps.iter().map(|(_, at)| at.node))
        .collect();
    let source_of = |node: FlatId, port: usize| bypass.wires[node].get(&port).copied();
    let root = |mut at: FlatPort| {
        for _ in 0..made.len() {
            if made[at.node].ports()[at.port].access != Access::Update {
                break;
            }
            let Some(source) = source_of(at.node, at.port) else { break };
            at = source;
        }
        at
    };
    let is_kept = |at: FlatPort| made[at.node].ports()[at.port].lifetime == Lifetime::Persistent;
    while let Some(node) = todo.pop() {
        if !live.insert(node) {
            continue;
        }
        for (&_, source) in &bypass.wires[node] {
            todo.push(source.node);
            let kept = root(*source);
            if !is_kept(kept) {
                continue;
            }
            // Kept memory carries every update into the next frame, whichever version is read.
            for (other, stage) in made.iter_enumerated() {
                let updates = stage.ports().iter().enumerate().any(|(port, declared)| {
                    declared.access == Access::Update
                        && source_of(other, port).is_some_and(|at| root(at) == kept)
                });
                if updates && !bypass.why.contains_key(&other) {
                    todo.push(other);
                }
            }
        }
    }
    live
}

struct Resolver<'g> {
    graph: &'g Graph,
    settings: &'g Settings,
    /// `None` for those that are being resolved.
    known: HashMap<PortRef, Option<Dims>>,
}

impl Resolver<'_> {
    fn dims(&mut self, at: PortRef) -> Result<Dims, String> {
        if let Some(known) = self.known.get(&at) {
            return known.ok_or_else(|| format!("the extent of `{}` depends on itself", self.graph.name(at)));
        }
        self.known.insert(at, None);
        let node = &self.graph.nodes[at.node];
        let port = &node.declaration().ports[at.port];
        let dims = match node.sources[at.port] {
            Some(source) if port.is_input() => self.dims(source)?,
            _ => self.declared(at.node, port.extent_on(node.side))?.unwrap_or(Dims { width: 1, height: 1 }),
        };
        self.known.insert(at, Some(dims));
        Ok(dims)
    }

    /// An extent in numbers; `None` if any extent is accepted.
    fn declared(&mut self, node: NodeId, extent: &Extent) -> Result<Option<Dims>, String> {
        let [width, height] = self.settings.size;
        // Lists are never empty: a buffer of zero bytes cannot be bound. Shaders test validity per element.
        let list = |count: u64| {
            u32::try_from(count.max(1))
                .map(|width| Some(Dims { width, height: 1 }))
                .map_err(|_| format!("a list of {count} elements is longer than 2^32"))
        };
        match extent {
            Extent::Frame(n) => Ok(Some(Dims { width: width.div_ceil(*n), height: height.div_ceil(*n) })),
            Extent::PerPixel(share) => list(share_of(self.settings.size, decimal(*share))),
            Extent::Requests => list(self.settings.samples.into()),
            Extent::Corners => Ok(Some(Dims { width: width + 1, height: height + 1 })),
            Extent::Each(quantity) => match self.settings.facts.count(*quantity) {
                Some(count) => list(count.into()),
                None => Err(format!(
                    "the length of a list is one per {}, but the application does not state the number of {}: add it to \
                     the facts in `Settings`",
                    quantity.one, quantity.name
                )),
            },
            Extent::Fixed([width, height]) => {
                Ok(Some(Dims { width: (*width).max(1), height: (*height).max(1) }))
            }
            Extent::Any => Ok(None),
            Extent::Like(name) => self.other(node, name).map(Some),
            Extent::BitsOf(name) => list(self.other(node, name)?.count().div_ceil(32) as u64),
        }
    }

    /// The dims of the port that an extent refers to.
    fn other(&mut self, node: NodeId, name: &str) -> Result<Dims, String> {
        let port = self.graph.nodes[node].declaration().port(name);
        let port = port.ok_or_else(|| format!("the extent names `{name}`, but there is no such port"))?;
        self.dims(PortRef { node, port })
    }

    /// The extent that a connected input takes, in numbers; `None` for other ports, and if any extent is accepted.
    fn wanted(&mut self, at: PortRef) -> Result<Option<Dims>, String> {
        let node = &self.graph.nodes[at.node];
        let port = &node.declaration().ports[at.port];
        if !port.is_input() || node.sources[at.port].is_none() {
            return Ok(None);
        }
        self.declared(at.node, &port.extent)
    }
}
