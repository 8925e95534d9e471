//! A single stage with given inputs: for testing stages and comparing their two sides.

use std::{collections::HashMap, sync::Arc};

use index_vec::index_vec;

use crate::{
    capture::Snapshot,
    error::{GraphError, Problems},
    executor::{Executor, Gpu, RunError},
    facts::Facts,
    file::Source,
    frame::Frame,
    graph::{Graph, Node, PortRef, Settings},
    id::NodeId,
    params::ParamSpec,
    plan::Plan,
    port::{Access, Dims, Element, Extent, Field, Lifetime, Port},
    registry::Registry,
    side::{Download, Side},
    stage::{AnyStage, Bound, CpuContext, Declaration, Host, Stage},
};

/// The node that owns the memory of the inputs.
const GIVEN: NodeId = NodeId::from_raw_unchecked(0);

/// Its name, which no kind has.
const GIVEN_NAME: &str = "given to the stage";

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

fn fail<S: Stage>(message: String) -> RunError {
    RunError::Stage { node: S::KIND.into(), message }
}

/// Runs a stage on test data.
pub struct Harness<S: Stage> {
    params: S::Params,
    settings: Settings,
    /// The ports of the stage with every optional input connected.
    ports: Vec<Port>,
    /// The bytes of each `port` or `port.field` that is set, and how many elements they are.
    inputs: HashMap<String, (usize, Vec<u8>)>,
    /// By side, and whether it uses vectors.
    running: HashMap<(Side, bool), Executor>,
    /// The frame that [`Harness::run`] runs; each run increments its number.
    pub frame: Frame,
}

/// What a stage wrote in one frame.
pub struct Outputs(pub(crate) HashMap<String, Snapshot>);

impl Outputs {
    /// The elements of `port` or `port.field`, row by row where the port is two-dimensional.
    ///
    /// # Panics
    /// If the stage has no such output, or its bytes are not a whole number of `T`.
    pub fn get<T: bytemuck::Pod>(&self, name: &str) -> Vec<T> {
        self.0.get(name).unwrap_or_else(|| panic!("no output `{name}`")).get()
    }

    /// The 32-bit words of an element of an output.
    pub(crate) fn lanes(&self, name: &str) -> usize {
        (self.0[name].element.bytes() as usize / 4).max(1)
    }
}

impl<S: Stage> Harness<S> {
    /// A stage with these parameters. `settings` decide about poisoning.
    pub fn new(params: S::Params, settings: &Settings) -> Self {
        let frame = Frame { size: settings.size, samples: settings.samples, ..Frame::default() };
        let ports = Bound::<S>::new(params.clone(), &|_| true).declaration.ports;
        let (inputs, running) = (HashMap::new(), HashMap::new());
        Self { params, settings: settings.clone(), ports, inputs, running, frame }
    }

    /// The ports of the stage, with every optional input connected.
    pub(crate) fn ports(&self) -> &[Port] {
        &self.ports
    }

    /// Sets the elements of input `port` or `port.field`, row by row if the port is two-dimensional. A list takes the
    /// length of the data; a port of the frame's extent needs exactly its number of elements.
    ///
    /// # Panics
    /// If the stage has no such input, or if its data has another size, with both sizes.
    #[track_caller]
    pub fn set<T: bytemuck::Pod>(&mut self, name: &str, elements: &[T]) {
        let bytes: &[u8] = bytemuck::cast_slice(elements);
        let (port, element) = match self.input(name) {
            Ok(input) => input,
            Err(error) => panic!("stage `{}`: {error}", S::KIND),
        };
        let size = element.bytes() as usize;
        let extent = &port.extent;
        let given = format!("{} elements of {} bytes", elements.len(), size_of::<T>());
        match self.frame_extent(extent) {
            Some(dims) => assert!(
                bytes.len() == dims.count() * size,
                "stage `{}`: `{name}` takes {} elements of {size} bytes ({extent}), not {given}",
                S::KIND,
                dims.count()
            ),
            None => assert!(
                bytes.len().is_multiple_of(size),
                "stage `{}`: `{name}` takes elements of {size} bytes, not {given}",
                S::KIND
            ),
        }
        self.inputs.insert(name.to_owned(), (bytes.len() / size, bytes.to_vec()));
    }

    /// The input `port` or `port.field`.
    fn input(&self, name: &str) -> Result<(&Port, &Element), GraphError> {
        let inputs = self.ports.iter().filter(|port| port.is_input());
        let mut fields = inputs.flat_map(|port| port.fields.iter().map(move |field| (port, field)));
        let full = |port: &Port, field: &Field| match &*field.name {
            "" => port.name.to_string(),
            field => format!("{}.{field}", port.name),
        };
        let known = || fields.clone().map(|(port, field)| full(port, field));
        let error = GraphError::unknown("input", name, known());
        let found = fields.find(|(port, field)| full(port, field) == name);
        found.map(|(port, field)| (port, &field.element)).ok_or(error)
    }

    /// The extent of a port that the frame decides; `None` for lists, which take the length of the data.
    fn frame_extent(&self, extent: &Extent) -> Option<Dims> {
        let [width, height] = self.settings.size;
        match *extent {
            Extent::Frame(n) => Some(Dims { width: width.div_ceil(n), height: height.div_ceil(n) }),
            Extent::Corners => Some(Dims { width: width + 1, height: height + 1 }),
            Extent::Fixed([width, height]) => Some(Dims { width, height }),
            _ => None,
        }
    }

    /// Clears the contents of kept ports.
    pub fn reset(&mut self) {
        self.running.clear();
        self.frame.index = 0;
    }

    /// Lets the twin use the processor's vector instructions or not. As on the two sides, kept ports of either are its own.
    pub(crate) fn use_vectors(&mut self, vectors: bool) {
        self.settings.vectors = vectors;
    }

    /// Runs one frame and returns every output, including ports updated in place.
    ///
    /// # Errors
    /// [`RunError::Stage`] if the stage fails, a required input has no data, or the length of a list has changed since the
    /// last run; otherwise as [`Executor::new`] and [`Executor::run`].
    pub fn run(
        &mut self,
        side: Side,
        registry: &Registry,
        host: &Host,
        gpu: Option<Arc<Gpu>>,
    ) -> Result<Outputs, RunError> {
        let key = (side, self.settings.vectors);
        let mut executor = match self.running.remove(&key) {
            Some(executor) => executor,
            None => self.build(side, registry, gpu)?,
        };
        for (name, (length, bytes)) in &self.inputs {
            // An empty list has the memory of one element.
            if !executor.restore(&format!("{GIVEN_NAME}.{name}"), bytes) && !bytes.is_empty() {
                let before = "the fields of a port have as many elements as each other, and as many in every run; \
                              for another length, reset the harness";
                return Err(fail::<S>(format!("`{name}` has {length} elements now: {before}")));
            }
        }
        executor.run(&self.frame, host, true)?;
        let all = executor.snapshots()?;
        let named = all.into_iter().map(|snapshot| {
            let port = snapshot.name.strip_prefix(&format!("{}.", S::KIND)).unwrap_or(&snapshot.name);
            let name = if snapshot.field.is_empty() {
                port.to_owned()
            } else {
                format!("{port}.{}", snapshot.field)
            };
            (name, snapshot.clone())
        });
        let outputs = Outputs(named.collect());
        self.running.insert(key, executor);
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
                (Source { node: S::KIND.into(), port: name }, PortRef { node: STAGE, port })
            })
            .collect();
        let given = Given(Declaration { ports: given, cpu: true, idle: true, ..Declaration::default() });
        let node = |name: &str, stage: Box<dyn AnyStage>, sources: Vec<Option<PortRef>>| Node {
            name: name.to_owned(),
            written: name.to_owned(),
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
                node(GIVEN_NAME, Box::new(given), vec![None; count]),
                node(S::KIND, Box::new(bound), sources),
            ],
            outputs: Vec::new(),
            taps,
            culled: Vec::new(),
            params: Vec::new(),
        };
        let settings = Settings { facts: registry.facts(&self.settings.facts), ..self.settings.clone() };
        graph.resolve_dims(&settings).map_err(|(_, message)| fail::<S>(message))?;
        let failed = |problems: Problems| fail::<S>(problems.to_string());
        let plan = Plan::new(&graph, &self.settings).map_err(failed)?;
        Executor::new(graph, plan, &self.settings, registry, gpu)
    }

    /// Lists take the length of their data; images the size of the frame.
    fn given_extent(&self, port: &Port) -> Extent {
        if self.frame_extent(&port.extent).is_some() {
            return port.extent.clone();
        }
        let prefix = format!("{}.", port.name);
        let of_port = |name: &String| *name == port.name || name.starts_with(&prefix);
        let length = self.inputs.iter().find(|(name, _)| of_port(name)).map_or(1, |(_, (length, _))| *length);
        Extent::Fixed([length as u32, 1])
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        port::{In, Out, PortElement},
        stage::Io,
        texel::Rgba8Unorm,
    };

    const SHEETS: crate::facts::Quantity = crate::facts::Quantity { name: "sheets", one: "sheet" };

    /// Takes an image, a list and a bundle.
    struct Taker {
        list: In<[u32; 2]>,
        sums: Out<u32>,
    }

    impl Stage for Taker {
        const KIND: &'static str = "taker";
        const DOC: &'static str = "A stage of the tests.";
        type Params = ();

        fn declare(_: &(), io: &mut Io) -> Self {
            io.read::<Rgba8Unorm>("image", "An image.", Extent::Frame(1));
            let list = io.read("list", "Pairs.", Extent::Any);
            let mut cloud = io.bundle(Access::Read, "cloud", "Points.", Extent::Any);
            cloud.read::<f32>("age");
            cloud.read::<u32>("mark");
            Self { list, sums: io.write("sums", "Sums of pairs.", Extent::Like("list".into())) }
        }

        fn cpu(&self, _: &(), cx: &CpuContext) -> Result<(), String> {
            let list = cx.read(self.list);
            cx.write(self.sums).iter_mut().zip(&*list).for_each(|(sum, pair)| *sum = pair[0] + pair[1]);
            if list[0][0] == 0 { Err("the first pair begins with 0".into()) } else { Ok(()) }
        }
    }

    fn harness() -> Harness<Taker> {
        let mut harness = Harness::new((), &Settings::new([3, 2], 0, Facts::none()));
        harness.set("image", &[[0u8; 4]; 6]);
        harness.set("list", &[[1u32, 2], [3, 4]]);
        harness.set("cloud.age", &[1.0f32; 5]);
        harness.set("cloud.mark", &[1u32; 5]);
        harness
    }

    fn run(harness: &mut Harness<Taker>) -> Result<Outputs, RunError> {
        harness.run(Side::Cpu, &Registry::default(), &Host::default(), None)
    }

    #[test]
    fn data_of_the_right_size_arrives() {
        assert_eq!(run(&mut harness()).unwrap().get::<u32>("sums"), [3, 7]);
    }

    #[test]
    #[should_panic = "stage `taker`: `image` takes 6 elements of 4 bytes (one per pixel), not 4 elements of 4 bytes"]
    fn an_image_of_another_size_is_refused() {
        harness().set("image", &[[0u8; 4]; 4]);
    }

    #[test]
    #[should_panic = "stage `taker`: `image` takes 6 elements of 4 bytes (one per pixel), not 0 elements of 4 bytes"]
    fn an_empty_image_is_refused() {
        harness().set::<[u8; 4]>("image", &[]);
    }

    #[test]
    #[should_panic = "stage `taker`: `list` takes elements of 8 bytes, not 3 elements of 4 bytes"]
    fn a_list_of_other_elements_is_refused() {
        harness().set("list", &[1u32, 2, 3]);
    }

    #[test]
    #[should_panic = "stage `taker`: unknown input `cloud.marks`, did you mean `cloud.mark`?"]
    fn an_input_that_there_is_not_is_refused() {
        harness().set("cloud.marks", &[1u32]);
    }

    #[test]
    fn a_reset_begins_with_frame_0_and_takes_other_lengths() {
        let mut harness = harness();
        harness.frame.index = 7;
        run(&mut harness).unwrap();
        harness.set("list", &[[1u32, 2], [3, 4], [5, 6]]);
        assert!(run(&mut harness).is_err());
        harness.reset();
        assert_eq!(harness.frame.index, 0);
        assert_eq!(run(&mut harness).unwrap().get::<u32>("sums"), [3, 7, 11]);
    }

    /// Looks numbers up.
    struct LookUp;

    impl Stage for LookUp {
        const KIND: &'static str = "look_up";
        const DOC: &'static str = "A stage of the tests.";
        type Params = ();

        fn declare(_: &(), io: &mut Io) -> Self {
            io.table("primes", "Prime numbers.", &[2, 3, 5]);
            Self
        }

        fn cpu(&self, _: &(), _: &CpuContext) -> Result<(), String> {
            Ok(())
        }
    }

    #[test]
    fn tables_have_their_numbers_from_the_start_on() {
        let mut harness = Harness::<LookUp>::new((), &Settings::new([3, 2], 0, Facts::none()));
        for _ in 0..2 {
            let out = harness.run(Side::Cpu, &Registry::default(), &Host::default(), None).unwrap();
            assert_eq!(out.get::<u32>("primes"), [2, 3, 5]);
            harness.reset();
        }
    }

    #[test]
    fn an_output_has_as_many_numbers_as_its_elements_have_words() {
        let snapshot = |name: &str, element: Element| {
            let (dims, bytes) = (Dims { width: 1, height: 1 }, vec![0; element.bytes() as usize]);
            let snapshot = Snapshot {
                name: name.into(),
                field: String::new(),
                meaning: None,
                element,
                dims,
                frame: 0,
                bytes,
            };
            (name.to_owned(), snapshot)
        };
        let outputs = Outputs(HashMap::from([
            snapshot("one", f32::element()),
            snapshot("four", <[f32; 4]>::element()),
            snapshot("color", Rgba8Unorm::element()),
        ]));
        assert_eq!(["one", "four", "color"].map(|name| outputs.lanes(name)), [1, 4, 1]);
    }

    #[test]
    fn errors_name_the_stage() {
        let mut failing = harness();
        failing.set("list", &[[0u32, 2], [3, 4]]);
        let text = run(&mut failing).err().expect("it fails").to_string();
        assert!(text.contains("`taker`") && text.contains("the first pair begins with 0"), "{text}");
        let mut uneven = harness();
        uneven.set("cloud.mark", &[1u32; 4]);
        let text = run(&mut uneven).err().expect("a bundle is one length").to_string();
        assert!(text.contains("`taker`") && text.contains("as many elements as each other"), "{text}");
    }

    /// Takes images of all extents that the frame decides.
    struct Frames;

    impl Stage for Frames {
        const KIND: &'static str = "frames";
        const DOC: &'static str = "A stage of the tests.";
        type Params = ();

        fn declare(_: &(), io: &mut Io) -> Self {
            io.read::<u32>("pixels", "One each.", Extent::Frame(1));
            io.read::<u32>("blocks", "One per block.", Extent::Frame(2));
            io.read::<u32>("corners", "One per corner.", Extent::Corners);
            io.read::<u32>("fixed", "Always as many.", Extent::Fixed([3, 4]));
            io.write::<u32>("done", "Nothing.", Extent::Fixed([1, 1]));
            Self
        }

        fn cpu(&self, _: &(), _: &CpuContext) -> Result<(), String> {
            Ok(())
        }
    }

    #[test]
    fn images_have_the_extents_of_the_frame() {
        let sizes = [("pixels", 35), ("blocks", 12), ("corners", 48), ("fixed", 12)];
        let mut harness = Harness::<Frames>::new((), &Settings::new([5, 7], 0, Facts::none()));
        for (name, count) in sizes {
            for wrong in [count - 1, count + 1] {
                let mut harness = Harness::<Frames>::new((), &Settings::new([5, 7], 0, Facts::none()));
                let set = || harness.set(name, &vec![0u32; wrong]);
                assert!(
                    std::panic::catch_unwind(std::panic::AssertUnwindSafe(set)).is_err(),
                    "{name}: {wrong}"
                );
            }
            harness.set(name, &vec![0u32; count]);
        }
        let registry = Registry::default();
        assert!(harness.run(Side::Cpu, &registry, &Host::default(), None).is_ok());
    }

    /// Writes a list of a length that the application states.
    struct Printer;

    impl Stage for Printer {
        const KIND: &'static str = "printer";
        const DOC: &'static str = "A stage of the tests.";
        type Params = ();

        fn declare(_: &(), io: &mut Io) -> Self {
            io.write::<u32>("pages", "Pages.", SHEETS.list());
            Self
        }

        fn cpu(&self, _: &(), _: &CpuContext) -> Result<(), String> {
            Ok(())
        }
    }

    #[test]
    fn what_is_not_stated_is_asked_for() {
        let run = |facts| {
            let mut harness = Harness::<Printer>::new((), &Settings::new([1, 1], 0, facts));
            harness.run(Side::Cpu, &Registry::default(), &Host::default(), None)
        };
        assert_eq!(run(Facts::none().with(SHEETS, 3)).unwrap().get::<u32>("pages").len(), 3);
        let text = run(Facts::none()).err().expect("the length is not known").to_string();
        assert!(text.contains("`printer`") && text.contains("the number of sheets"), "{text}");
    }
}
