//! The contract of a stage. A stage declares its ports, shader and passes once, from its parameters; everything else
//! (connection checks, layouts, allocation, transfers, documentation) follows from the declaration.

use std::{
    any::{Any, TypeId},
    borrow::Cow,
    cell::{Ref, RefCell, RefMut},
    collections::HashMap,
    ops::Range,
};

use fearless_simd::Level;
use index_vec::IndexSlice;

use crate::{
    constant::Constant,
    explain::{Finding, Site},
    facts::Facts,
    frame::Frame,
    id::SlotId,
    params::{ParamSpec, Params},
    port::{self, Access, Dims, Extent, Field, FieldRef, Holds, In, Lifetime, Out, Port, PortElement},
    shader::{Needs, Pass, Shader, Threads},
    side::Side,
    watch::{Checks, Failed},
};

/// A step of an algorithm. See the README for one in full.
pub trait Stage: Sized + Send + Sync + 'static {
    /// Its name in graph files.
    const KIND: &'static str;
    /// One line.
    const DOC: &'static str;
    /// Its parameters, defined with [`crate::params!`].
    type Params: Params;

    /// Declares ports, shader and passes for these parameters; keeps the handles.
    fn declare(params: &Self::Params, io: &mut Io) -> Self;

    /// The CPU twin: the same result as the shader on plain slices.
    fn cpu(&self, params: &Self::Params, cx: &CpuContext) -> Result<(), String>;

    /// What it did at a pixel, recomputed from what it read and wrote in a frame. `None` if it has nothing to report,
    /// or if what it needs was not captured.
    fn explain(&self, _params: &Self::Params, _site: &Site) -> Option<Vec<Finding>> {
        None
    }

    /// Why the facts make this stage needless, or `None` if they do not. Its inputs are then passed through.
    fn needless(_params: &Self::Params, _facts: &Facts) -> Option<&'static str> {
        None
    }

    /// Why the stage cannot do on a side what the facts ask for, although it has a form for that side; `None` if it
    /// can. A node without `on` then runs on the other side.
    fn unable(_params: &Self::Params, _side: Side, _facts: &Facts) -> Option<&'static str> {
        None
    }
}

/// In which frames a stage has something to do.
#[derive(Clone, Debug, Default, PartialEq)]
pub enum Runs {
    /// In all.
    #[default]
    Always,
    /// If its inputs or the view have changed: see [`Io::per_view`].
    PerView,
    /// If one of these fields has changed: see [`Io::per_change`].
    PerChange(Vec<FieldRef>),
    /// If this input is not blank, and once after: see [`Io::per_arrival`].
    PerArrival(FieldRef),
    /// If the frame may request samples, and once after: see [`Io::per_budget`].
    PerBudget,
}

impl Runs {
    /// While what is so it does not run, as part of a sentence; `None` if it always runs.
    pub fn unless(&self) -> Option<&'static str> {
        match self {
            Self::Always => None,
            Self::PerView => Some("its inputs and the view are unchanged"),
            Self::PerChange(_) => Some("what it waits for is unchanged"),
            Self::PerArrival(_) => Some("nothing arrives"),
            Self::PerBudget => Some("no samples may be requested"),
        }
    }
}

/// Everything a stage has declared.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Declaration {
    /// In declaration order.
    pub ports: Vec<Port>,
    /// `None` for a stage that runs on the CPU only.
    pub shader: Option<Shader>,
    /// The GPU's steps in order.
    pub passes: Vec<Pass>,
    /// Features of the device that the passes need.
    pub needs: Needs,
    /// Whether there is a CPU twin.
    pub cpu: bool,
    /// Whether it only owns memory: nothing runs.
    pub idle: bool,
    /// In which frames it has something to do.
    pub runs: Runs,
    /// Whether its outputs seldom change: see [`Io::seldom`].
    pub seldom: bool,
    /// The column of the application's table of times that the stage counts towards; `None`: the rest of the frame.
    pub column: Option<&'static str>,
}

impl Declaration {
    /// Index of the port with this name.
    pub fn port(&self, name: &str) -> Option<usize> {
        self.ports.iter().position(|port| port.name == name)
    }

    /// The field with this WGSL variable.
    pub fn field(&self, variable: &str) -> Option<FieldRef> {
        self.ports.iter().enumerate().find_map(|(port, declared)| {
            let field = (0..declared.fields.len()).find(|&field| declared.variable(field) == variable)?;
            Some(FieldRef { port: port as u16, field: field as u16 })
        })
    }

    /// Whether the stage can run on this side.
    pub fn runs_on(&self, side: Side) -> bool {
        match side {
            Side::Cpu => self.cpu,
            Side::Gpu => self.shader.is_some() || self.idle,
        }
    }
}

/// Collects a stage's declaration.
pub struct Io<'a> {
    pub(crate) declared: Declaration,
    connected: &'a dyn Fn(&str) -> bool,
}

impl<'a> Io<'a> {
    fn new(connected: &'a dyn Fn(&str) -> bool) -> Self {
        Self { declared: Declaration { cpu: true, ..Declaration::default() }, connected }
    }

    fn port(&mut self, access: Access, name: &'static str, holds: Holds, extent: Extent) -> Bundle<'_> {
        let Holds { doc, meaning, scratch, rules } = holds;
        self.declared.ports.push(Port {
            name: name.into(),
            doc: doc.into(),
            access,
            fields: Vec::new(),
            meaning,
            scratch,
            rules: rules.into(),
            extent,
            extent_on_cpu: None,
            lifetime: Lifetime::Transient,
            optional: false,
            table: &[],
        });
        Bundle {
            index: self.declared.ports.len() as u16 - 1,
            port: self.declared.ports.last_mut().expect("pushed"),
        }
    }

    /// An input with this frame's values.
    pub fn read<E: PortElement>(
        &mut self,
        name: &'static str,
        holds: impl Into<Holds>,
        extent: Extent,
    ) -> In<E> {
        self.port(Access::Read, name, holds.into(), extent).read("")
    }

    /// An input with the values of the frame before; all zero in the first frame.
    pub fn history<E: PortElement>(
        &mut self,
        name: &'static str,
        holds: impl Into<Holds>,
        extent: Extent,
    ) -> In<E> {
        self.port(Access::History, name, holds.into(), extent).read("")
    }

    /// An input that may stay unconnected; the handle is then `None`.
    pub fn optional<E: PortElement>(
        &mut self,
        name: &'static str,
        holds: impl Into<Holds>,
        extent: Extent,
    ) -> Option<In<E>> {
        let input = self.read(name, holds, extent);
        self.declared.ports.last_mut().expect("pushed").optional = true;
        (self.connected)(name).then_some(input)
    }

    /// An input that is changed in place and passed on as the output of the same name.
    pub fn update<E: PortElement>(
        &mut self,
        name: &'static str,
        holds: impl Into<Holds>,
        extent: Extent,
    ) -> Out<E> {
        self.port(Access::Update, name, holds.into(), extent).write("")
    }

    /// An output.
    pub fn write<E: PortElement>(
        &mut self,
        name: &'static str,
        holds: impl Into<Holds>,
        extent: Extent,
    ) -> Out<E> {
        self.port(Access::Write, name, holds.into(), extent).write("")
    }

    /// An output that keeps its values from frame to frame; zero at the start.
    pub fn persistent<E: PortElement>(
        &mut self,
        name: &'static str,
        holds: impl Into<Holds>,
        extent: Extent,
    ) -> Out<E> {
        let handle = self.write(name, holds, extent);
        self.declared.ports.last_mut().expect("pushed").lifetime = Lifetime::Persistent;
        handle
    }

    /// Numbers that the shader looks up, in memory of its own that is theirs from the start: a constant list of this
    /// length would be part of every thread.
    pub fn table(&mut self, name: &'static str, doc: &'static str, numbers: &'static [u32]) {
        // No stage has 2^32 numbers in it.
        let _: Out<u32> = self.persistent(name, port::scratch(doc), Extent::Fixed([numbers.len() as u32, 1]));
        self.declared.ports.last_mut().expect("pushed").table = numbers;
    }

    /// Gives a scratch port another number of elements where the stage runs on the CPU, whose twin uses that memory in
    /// another way or not at all.
    pub fn extent_on_cpu(&mut self, port: impl Into<FieldRef>, extent: Extent) {
        self.declared.ports[port.into().port as usize].extent_on_cpu = Some(extent);
    }

    /// A port of several variables, bound as `name_field`: one wire, a structure of arrays.
    pub fn bundle(
        &mut self,
        access: Access,
        name: &'static str,
        holds: impl Into<Holds>,
        extent: Extent,
    ) -> Bundle<'_> {
        self.port(access, name, holds.into(), extent)
    }

    /// Names the shader, usually with [`crate::shader!`].
    pub fn shader(&mut self, shader: Shader) {
        self.declared.shader = Some(shader);
    }

    /// Defines a name for `#ifdef` in the shader.
    pub fn define(&mut self, name: &'static str) {
        self.declared.shader.as_mut().expect("name the shader before its defines").defines.push(name.into());
    }

    /// Gives the shader the constants of this list, made with [`crate::constants!`]. It gets those of its parameters'
    /// choices in any case.
    pub fn constants(&mut self, constants: &[Constant]) {
        let shader = self.declared.shader.as_mut().expect("name the shader before its constants");
        shader.constants.extend_from_slice(constants);
    }

    /// Adds a compute pass with one thread for each element of a port.
    pub fn dispatch(&mut self, entry: &'static str, over: impl Into<FieldRef>) {
        self.compute(entry, Threads::Over(over.into()));
    }

    /// Adds a compute pass.
    pub fn compute(&mut self, entry: &'static str, threads: Threads) {
        self.declared.passes.push(Pass::Compute { entry: entry.into(), threads });
    }

    /// Adds a pass of any kind.
    pub fn pass(&mut self, pass: Pass) {
        self.declared.passes.push(pass);
    }

    /// Declares that the stage only owns memory and does nothing in a frame.
    pub fn idle(&mut self) {
        self.declared.idle = true;
    }

    /// Declares that the outputs depend only on the inputs, the parameters, and [`Frame::view`] and
    /// [`Frame::predicted`]: not on the rest of the frame, the host, or the outputs' previous contents. The stage is
    /// then skipped, and its outputs keep their values, in frames in which neither the views nor any input has changed.
    /// An input is unchanged if its writer was skipped too or reported it as unchanged ([`CpuContext::unchanged`]).
    pub fn per_view(&mut self) {
        self.declared.runs = Runs::PerView;
    }

    /// Declares that one run after another, while these fields are as the first one left them, changes nothing: not what
    /// the stage updates in place or keeps, and its other outputs would be the same again. The stage is then skipped. It
    /// may depend on its other inputs, and on the rest of the frame, only when one of the fields has changed. What it
    /// wrote itself in the frame before is no change.
    pub fn per_change(&mut self, fields: impl IntoIterator<Item = FieldRef>) {
        self.declared.runs = Runs::PerChange(fields.into_iter().collect());
    }

    /// Declares that the stage has nothing to do while this input is blank ([`CpuContext::blank`]): one run changes
    /// nothing that the run before, with a blank input too, left. Whatever else has changed, the stage is then skipped.
    pub fn per_arrival(&mut self, input: impl Into<FieldRef>) {
        self.declared.runs = Runs::PerArrival(input.into());
    }

    /// Declares the same of frames that may not request samples ([`Frame::samples`] is 0).
    pub fn per_budget(&mut self) {
        self.declared.runs = Runs::PerBudget;
    }

    /// Declares that the outputs seldom change, as the stage reports ([`CpuContext::unchanged`]). Stages that run per view
    /// then run in the frames in which they do, too, if memory need not be kept from frame to frame for that. A stage that
    /// seldom changes its outputs runs as early as possible.
    pub fn seldom(&mut self) {
        self.declared.seldom = true;
    }

    /// Sets the column of the application's table of times that the stage counts towards.
    pub fn column(&mut self, name: &'static str) {
        self.declared.column = Some(name);
    }

    /// Declares that the passes need 64-bit atomics.
    pub fn needs_atomic64(&mut self) {
        self.declared.needs.atomic64 = true;
    }
}

/// Adds fields to a port of several variables.
pub struct Bundle<'p> {
    index: u16,
    port: &'p mut Port,
}

impl Bundle<'_> {
    fn add<E: PortElement>(&mut self, name: impl Into<Cow<'static, str>>) -> FieldRef {
        self.port.fields.push(Field { name: name.into(), element: E::element() });
        FieldRef { port: self.index, field: self.port.fields.len() as u16 - 1 }
    }

    /// A field that is only read.
    pub fn read<E: PortElement>(&mut self, field: &'static str) -> In<E> {
        In::mint(self.add::<E>(field))
    }

    /// A field that is written or changed.
    pub fn write<E: PortElement>(&mut self, field: &'static str) -> Out<E> {
        Out::mint(self.add::<E>(field))
    }

    /// Keeps the written values from frame to frame.
    pub fn persistent(&mut self) {
        self.port.lifetime = Lifetime::Persistent;
    }
}

/// Objects that an application provides to its stages, such as the scene's tracer: one of each type.
#[derive(Default)]
pub struct Host(HashMap<TypeId, Box<dyn Any + Send + Sync>>);

impl Host {
    /// Adds or replaces the object of this type.
    pub fn insert<T: Any + Send + Sync>(&mut self, thing: T) {
        self.0.insert(TypeId::of::<T>(), Box::new(thing));
    }

    /// The object of this type.
    pub fn get<T: Any>(&self) -> Option<&T> {
        self.0.get(&TypeId::of::<T>())?.downcast_ref()
    }
}

/// The memory of one slot on the CPU, aligned for every element type.
#[derive(Clone, Debug, Default)]
pub struct CpuMemory {
    words: Vec<[u64; 2]>,
}

impl CpuMemory {
    /// Zeroed memory of at least `bytes` bytes; `None` if there is not enough.
    pub fn new(bytes: u64) -> Option<Self> {
        let count = usize::try_from(bytes.div_ceil(16)).ok()?;
        let mut words = Vec::new();
        words.try_reserve_exact(count).ok()?;
        words.resize(count, [0; 2]);
        Some(Self { words })
    }

    /// All of it.
    pub fn bytes(&self) -> &[u8] {
        bytemuck::cast_slice(&self.words)
    }

    /// All of it.
    pub fn bytes_mut(&mut self) -> &mut [u8] {
        bytemuck::cast_slice_mut(&mut self.words)
    }
}

/// A binding on the CPU: the slot of its value, and its number of elements.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Binding {
    pub slot: SlotId,
    pub dims: Dims,
}

/// What a CPU twin works with: the slices of its ports, the frame, and the host's objects.
pub struct CpuContext<'a> {
    pub(crate) frame: &'a Frame,
    pub(crate) host: &'a Host,
    pub(crate) memory: &'a IndexSlice<SlotId, [RefCell<CpuMemory>]>,
    pub(crate) bindings: &'a [Vec<Option<Binding>>],
    pub(crate) changes: &'a RefCell<Changes>,
    /// `None` unless the run is watched.
    pub(crate) failed: Option<&'a Failed>,
    pub(crate) level: Level,
}

/// What a node has reported of its outputs.
#[derive(Debug, Default)]
pub(crate) struct Changes {
    /// Outputs with the contents of the frame before.
    pub unchanged: Vec<FieldRef>,
    /// Outputs with the contents that stand for nothing.
    pub blank: Vec<FieldRef>,
    /// Ranges of elements of outputs that are otherwise as in the frame before.
    pub ranges: Vec<(FieldRef, Range<usize>)>,
}

impl Changes {
    pub fn clear(&mut self) {
        self.unchanged.clear();
        self.blank.clear();
        self.ranges.clear();
    }
}

impl CpuContext<'_> {
    /// The current frame.
    pub fn frame(&self) -> &Frame {
        self.frame
    }

    /// Which vector instructions the twin may use: for [`fearless_simd::dispatch!`], which compiles a function for each level.
    /// The bits that a twin writes must not depend on it: no sums in another order, no multiplication fused with an
    /// addition, no estimates, and a minimum by comparison where a NaN may come.
    pub fn level(&self) -> Level {
        self.level
    }

    /// The host's object of this type, or a message for the user.
    pub fn host<T: Any>(&self) -> Result<&T, String> {
        self.host
            .get()
            .ok_or_else(|| format!("the application has not provided {}", std::any::type_name::<T>()))
    }

    fn binding(&self, at: FieldRef) -> Binding {
        self.bindings[at.port as usize][at.field as usize]
            .expect("a handle of an unconnected port is never given out")
    }

    /// Reports that a kept output has the same contents as in the frame before, so that it need not be uploaded again,
    /// and stages that depend only on it and the view ([`Io::per_view`]) need not run again. Only for
    /// [`Io::persistent`] outputs; pooled memory has been reused since.
    pub fn unchanged(&self, port: impl Into<FieldRef>) {
        self.changes.borrow_mut().unchanged.push(port.into());
    }

    /// Reports that an output says that there is nothing, such as a list without samples. Stages that wait for something
    /// ([`Io::per_arrival`]) need not run then. The contents must be the same whenever this is reported of an output.
    pub fn blank(&self, port: impl Into<FieldRef>) {
        self.changes.borrow_mut().blank.push(port.into());
    }

    /// Reports that only these elements of a kept list differ from the frame before, so that the rest need not be
    /// uploaded again. May be called several times, for several ranges. Only for [`Io::persistent`] outputs that are
    /// buffers.
    pub fn changed(&self, port: impl Into<FieldRef>, elements: Range<usize>) {
        self.changes.borrow_mut().ranges.push((port.into(), elements));
    }

    /// What takes the results of the stage's own checks of an output, if the run is watched
    /// ([`Settings::watch`](crate::Settings::watch)); otherwise `None`, so that checks cost nothing:
    ///
    /// ```
    /// # use epigraph_core::{CpuContext, Out};
    /// # fn cpu(cx: &CpuContext, shares: Out<[f32; 2]>) {
    /// if let Some(checks) = cx.checks(shares) {
    ///     for (element, [a, b]) in cx.write(shares).iter().enumerate() {
    ///         checks.that(element, (a + b - 1.0).abs() < 1e-5, "the shares add up to 1");
    ///     }
    /// }
    /// # }
    /// ```
    pub fn checks(&self, port: impl Into<FieldRef>) -> Option<Checks<'_>> {
        Some(Checks::new(self.failed?, port.into()))
    }

    /// Width and height of a port.
    pub fn dims(&self, port: impl Into<FieldRef>) -> Dims {
        self.binding(port.into()).dims
    }

    /// The elements of an input.
    pub fn read<E: PortElement>(&self, port: In<E>) -> Ref<'_, [E::Cpu]> {
        let Binding { slot, dims } = self.binding(port.at);
        Ref::map(self.memory[slot].borrow(), |memory| elements(memory.bytes(), dims))
    }

    /// The elements of an output or update.
    pub fn write<E: PortElement>(&self, port: Out<E>) -> RefMut<'_, [E::Cpu]> {
        let Binding { slot, dims } = self.binding(port.at);
        RefMut::map(self.memory[slot].borrow_mut(), |memory| {
            let bytes = dims.count() * size_of::<E::Cpu>();
            bytemuck::cast_slice_mut(&mut memory.bytes_mut()[..bytes])
        })
    }
}

fn elements<T: bytemuck::Pod>(bytes: &[u8], dims: Dims) -> &[T] {
    bytemuck::cast_slice(&bytes[..dims.count() * size_of::<T>()])
}

/// A stage with its parameters, type-erased.
pub trait AnyStage: Send + Sync {
    /// What it declared.
    fn declaration(&self) -> &Declaration;
    /// Runs the CPU twin.
    fn run_cpu(&self, cx: &CpuContext) -> Result<(), String>;
    /// What it did at a pixel; see [`Stage::explain`].
    fn explain(&self, _site: &Site) -> Option<Vec<Finding>> {
        None
    }
    /// The words of its parameter uniform.
    fn words(&self) -> Vec<u32>;
    /// Its parameters, in the order of the words.
    fn specs(&self) -> Vec<ParamSpec>;
    /// Why the facts make it needless, or `None` if they do not.
    fn needless(&self, facts: &Facts) -> Option<&'static str>;
    /// Why it cannot run on a side with these facts; see [`Stage::unable`].
    fn unable(&self, _side: Side, _facts: &Facts) -> Option<&'static str> {
        None
    }
}

pub(crate) struct Bound<S: Stage> {
    pub stage: S,
    pub params: S::Params,
    pub declaration: Declaration,
}

impl<S: Stage> Bound<S> {
    /// Lets the stage declare itself; `connected` tells whether an input is connected.
    pub fn new(params: S::Params, connected: &dyn Fn(&str) -> bool) -> Self {
        let mut io = Io::new(connected);
        let stage = S::declare(&params, &mut io);
        let mut declaration = io.declared;
        if let Some(shader) = &mut declaration.shader {
            shader.constants.extend(S::Params::specs().iter().flat_map(Constant::of_choice));
        }
        Self { stage, params, declaration }
    }
}

impl<S: Stage> AnyStage for Bound<S> {
    fn declaration(&self) -> &Declaration {
        &self.declaration
    }
    fn run_cpu(&self, cx: &CpuContext) -> Result<(), String> {
        // Each twin stays a function of its own, by which profilers know it, however small.
        let twin: fn(&S, &S::Params, &CpuContext) -> Result<(), String> = std::hint::black_box(S::cpu);
        twin(&self.stage, &self.params, cx)
    }
    fn explain(&self, site: &Site) -> Option<Vec<Finding>> {
        self.stage.explain(&self.params, site)
    }
    fn words(&self) -> Vec<u32> {
        self.params.words()
    }
    fn specs(&self) -> Vec<ParamSpec> {
        S::Params::specs()
    }
    fn needless(&self, facts: &Facts) -> Option<&'static str> {
        S::needless(&self.params, facts)
    }
    fn unable(&self, side: Side, facts: &Facts) -> Option<&'static str> {
        S::unable(&self.params, side, facts)
    }
}
