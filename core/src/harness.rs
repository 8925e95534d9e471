//! A single stage with given inputs: for testing stages and comparing their two sides.

use std::{collections::HashMap, sync::Arc};

use index_vec::index_vec;

use crate::{
    capture::Snapshot,
    error::Problems,
    executor::{Executor, Gpu, RunError},
    facts::Facts,
    file::Source,
    frame::Frame,
    graph::{Graph, Node, PortRef, Settings},
    id::NodeId,
    params::ParamSpec,
    plan::Plan,
    port::{Access, Dims, Extent, Lifetime, Port},
    registry::Registry,
    side::{Download, Side},
    stage::{AnyStage, Bound, CpuContext, Declaration, Host, Stage},
};

/// The node that owns the memory of the inputs.
const GIVEN: NodeId = NodeId::from_raw_unchecked(0);

/// The stage's node.
const STAGE: NodeId = NodeId::from_raw_unchecked(1);

/// Owns the memory of the inputs, which the harness fills.
struct Given(Declaration);

impl AnyStage for Given {
    fn declaration(&self) -> &Declaration {
        &self.0
    }
    fn run_cpu(&self, _: &CpuContext) -> Result<(), String> {
        Ok(())
    }
    fn words(&self) -> Vec<u32> {
        Vec::new()
    }
    fn specs(&self) -> Vec<ParamSpec> {
        Vec::new()
    }
    fn needless(&self, _: &Facts) -> Option<&'static str> {
        None
    }
}

/// Runs a stage on test data.
pub struct Harness<S: Stage> {
    params: S::Params,
    settings: Settings,
    inputs: HashMap<String, (usize, Vec<u8>)>,
    running: HashMap<Side, Executor>,
    /// The frame that [`Harness::run`] runs; each run increments its number.
    pub frame: Frame,
}

/// What a stage wrote in one frame.
pub struct Outputs(HashMap<String, Snapshot>);

impl Outputs {
    /// The elements of `port` or `port.field`, row by row where the port is two-dimensional.
    ///
    /// # Panics
    /// If the stage has no such output, or its bytes are not a whole number of `T`.
    pub fn get<T: bytemuck::Pod>(&self, name: &str) -> Vec<T> {
        self.0.get(name).unwrap_or_else(|| panic!("no output `{name}`")).get()
    }
}

impl<S: Stage> Harness<S> {
    /// A stage with these parameters. `settings` decide about poisoning.
    pub fn new(params: S::Params, settings: &Settings) -> Self {
        let frame = Frame { size: settings.size, samples: settings.samples, ..Frame::default() };
        Self { params, settings: settings.clone(), inputs: HashMap::new(), running: HashMap::new(), frame }
    }

    /// Sets the elements of input `port` or `port.field`, row by row if the port is two-dimensional. A list takes the
    /// length of the data; a port of the frame's extent needs exactly its number of elements.
    pub fn set<T: bytemuck::Pod>(&mut self, name: &str, elements: &[T]) {
        let bytes = bytemuck::cast_slice(elements).to_vec();
        self.inputs.insert(name.to_owned(), (elements.len(), bytes));
    }

    /// Clears the contents of kept ports.
    pub fn reset(&mut self) {
        self.running.clear();
        self.frame.index = 0;
    }

    /// Runs one frame and returns every output, including ports updated in place.
    ///
    /// # Errors
    /// [`RunError::Stage`] if the stage fails, a required input has no data, or data was set for an input that does not
    /// exist or has another size; otherwise as [`Executor::new`] and [`Executor::run`].
    pub fn run(
        &mut self,
        side: Side,
        registry: &Registry,
        host: &Host,
        gpu: Option<Arc<Gpu>>,
    ) -> Result<Outputs, RunError> {
        let mut executor = match self.running.remove(&side) {
            Some(executor) => executor,
            None => self.build(side, registry, gpu)?,
        };
        for (name, (_, bytes)) in &self.inputs {
            // An empty list has the memory of one element.
            if !executor.restore(&format!("given.{name}"), bytes) && !bytes.is_empty() {
                let message = format!("there is no input `{name}` of {} bytes", bytes.len());
                return Err(RunError::Stage { node: "stage".into(), message });
            }
        }
        executor.run(&self.frame, host, true)?;
        let all = executor.snapshots()?;
        let named = all.into_iter().map(|snapshot| {
            let port = snapshot.name.strip_prefix("stage.").unwrap_or(&snapshot.name);
            let name = if snapshot.field.is_empty() {
                port.to_owned()
            } else {
                format!("{port}.{}", snapshot.field)
            };
            (name, snapshot.clone())
        });
        let outputs = Outputs(named.collect());
        self.running.insert(side, executor);
        Ok(outputs)
    }

    fn build(&self, side: Side, registry: &Registry, gpu: Option<Arc<Gpu>>) -> Result<Executor, RunError> {
        let connected = |name: &str| {
            self.inputs.keys().any(|input| input == name || input.starts_with(&format!("{name}.")))
        };
        let bound = Bound::<S>::new(self.params.clone(), &connected);
        let declaration = &bound.declaration;
        let given: Vec<Port> = declaration
            .ports
            .iter()
            .filter(|port| port.is_input() && connected(&port.name))
            .map(|port| Port {
                access: Access::Write,
                // History inputs need a writer in this frame; kept memory would reject them.
                lifetime: if port.access == Access::History {
                    Lifetime::Transient
                } else {
                    Lifetime::Persistent
                },
                extent: self.given_extent(port),
                ..port.clone()
            })
            .collect();
        let source_of = |port: &Port| {
            let index = given.iter().position(|given| given.name == port.name && port.is_input());
            index.map(|port| PortRef { node: GIVEN, port })
        };
        let sources: Vec<Option<PortRef>> = declaration.ports.iter().map(source_of).collect();
        let outputs: Vec<usize> =
            (0..declaration.ports.len()).filter(|&port| declaration.ports[port].is_output()).collect();
        let taps = outputs
            .iter()
            .map(|&port| {
                let name = declaration.ports[port].name.to_string();
                (Source { node: "stage".into(), port: name }, PortRef { node: STAGE, port })
            })
            .collect();
        let given = Given(Declaration { ports: given, cpu: true, idle: true, ..Declaration::default() });
        let node = |name: &str, stage: Box<dyn AnyStage>, sources: Vec<Option<PortRef>>| Node {
            name: name.to_owned(),
            dims: vec![Dims::default(); sources.len()],
            kind: S::KIND.to_owned(),
            side,
            download: Download::Sync,
            params: Vec::new(),
            stage,
            sources,
        };
        let count = given.0.ports.len();
        let mut graph = Graph {
            nodes: index_vec![
                node("given", Box::new(given), vec![None; count]),
                node("stage", Box::new(bound), sources),
            ],
            outputs: Vec::new(),
            taps,
            culled: Vec::new(),
            params: Vec::new(),
        };
        let fail = |message| RunError::Stage { node: "stage".into(), message };
        let settings = Settings { facts: registry.facts(&self.settings.facts), ..self.settings.clone() };
        graph.resolve_dims(&settings).map_err(|(_, message)| fail(message))?;
        let fail = |problems: Problems| fail(problems.to_string());
        let plan = Plan::new(&graph, &self.settings).map_err(fail)?;
        Executor::new(graph, plan, &self.settings, registry, gpu)
    }

    /// Lists take the length of their data; images the size of the frame.
    fn given_extent(&self, port: &Port) -> Extent {
        if let Extent::Frame(_) | Extent::Corners | Extent::Fixed(_) = port.extent {
            return port.extent.clone();
        }
        let prefix = format!("{}.", port.name);
        let of_port = |name: &String| *name == port.name || name.starts_with(&prefix);
        let length = self.inputs.iter().find(|(name, _)| of_port(name)).map_or(1, |(_, (length, _))| *length);
        Extent::Fixed([length as u32, 1])
    }
}
