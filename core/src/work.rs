//! What a frame asks of the GPU, counted from its plan and its shaders without a device.
//!
//! Bytes are those of the memory that a pass reads or writes, all of it and once, however often its threads come back to
//! the same element: what has to move if the caches are perfect, and more than that where threads leave some out.
//!
//! A *barrier* is one buffer or texture for which a pass or a copy must wait: one that is used in another way than
//! before, or was written before. These are the transitions of `wgpu`, which tracks one use of a resource for each
//! dispatch, draw and copy.

use std::{
    collections::HashMap,
    fmt,
    iter::Sum,
    ops::{Add, BitOr},
};

use naga::StorageAccess;
use wgpu::{BufferUses, TextureUses};

use crate::{
    error::{Problem, Problems},
    graph::Graph,
    id::{NodeId, SlotId},
    plan::{Columns, Plan, Step, Value},
    port::Element,
    reflect::{self, Reflected, Space},
    shader::{Pass, ShaderLibrary},
    side::Side,
    stage::Declaration,
};

/// What a step or a whole frame asks of the GPU.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Work {
    /// Dispatches of compute shaders.
    pub dispatches: u32,
    /// Draws.
    pub draws: u32,
    /// Buffers and textures that passes and copies wait for. Those of the plan's memory count, and the depth of draws,
    /// but neither the constants of the frame nor what transfers are staged in.
    pub barriers: u32,
    /// Bytes read.
    pub read: u64,
    /// Bytes written.
    pub written: u64,
    /// Atomic operations that the entry points and the functions that they call name, without loads and stores. How
    /// often a thread runs them depends on the data.
    pub atomics: u32,
}

impl Add for Work {
    type Output = Self;

    fn add(self, other: Self) -> Self {
        Self {
            dispatches: self.dispatches + other.dispatches,
            draws: self.draws + other.draws,
            barriers: self.barriers + other.barriers,
            read: self.read + other.read,
            written: self.written + other.written,
            atomics: self.atomics + other.atomics,
        }
    }
}

impl Sum for Work {
    fn sum<I: Iterator<Item = Self>>(works: I) -> Self {
        works.fold(Self::default(), Add::add)
    }
}

/// How a pass or a copy uses a value.
#[derive(Clone, Copy)]
struct Use {
    value: Value,
    state: State,
    read: bool,
    written: bool,
}

/// What `wgpu` calls a use.
#[derive(Clone, Copy, PartialEq)]
enum State {
    Buffer(BufferUses),
    Texture(TextureUses),
}

impl State {
    /// Whether uses of this kind may follow each other without waiting.
    fn only_reads(self) -> bool {
        match self {
            Self::Buffer(uses) => BufferUses::INCLUSIVE.contains(uses),
            Self::Texture(uses) => TextureUses::INCLUSIVE.contains(uses),
        }
    }
}

impl BitOr for State {
    type Output = Self;

    fn bitor(self, other: Self) -> Self {
        match (self, other) {
            (Self::Buffer(a), Self::Buffer(b)) => Self::Buffer(a | b),
            (Self::Texture(a), Self::Texture(b)) => Self::Texture(a | b),
            // Memory is either, so that this does not occur.
            (_, other) => other,
        }
    }
}

impl Plan {
    /// What each of the steps asks of the GPU, in a frame in which all of them run and nothing is captured.
    ///
    /// # Errors
    /// A shader that is not valid.
    pub fn work(&self, graph: &Graph, library: &ShaderLibrary) -> Result<Vec<Work>, Problems> {
        let mut work = Vec::new();
        let mut uses = Vec::new();
        for step in &self.steps {
            let (mut sum, mut used) = (Work::default(), Vec::new());
            match *step {
                Step::Run(id) if self.nodes[id].side == Side::Gpu => {
                    let declaration = graph.nodes[id].declaration();
                    if let (Some(shader), false) = (&declaration.shader, declaration.idle) {
                        let reflected = reflect::compose(shader, library, declaration.needs)
                            .map_err(|error| Problem::new(error).node(&self.nodes[id].name))?;
                        for pass in &declaration.passes {
                            sum = sum + of_pass(pass, &reflected);
                            used.extend(self.used(id, declaration, pass, &reflected));
                        }
                    }
                }
                Step::Upload(value) => used.push(self.copied(value, true)),
                Step::Download(value, _) => used.push(self.copied(value, false)),
                Step::Run(_) | Step::Tap { .. } => {}
            }
            for &Use { value, read, written, .. } in &used {
                let bytes = self.storages[value.storage].bytes();
                sum.read += if read { bytes } else { 0 };
                sum.written += if written { bytes } else { 0 };
            }
            work.push(sum);
            uses.push(used);
        }
        for (work, barriers) in work.iter_mut().zip(self.barriers(&uses)) {
            work.barriers += barriers;
        }
        Ok(work)
    }

    /// What a pass uses.
    fn used(&self, id: NodeId, declaration: &Declaration, pass: &Pass, reflected: &Reflected) -> Vec<Use> {
        let mut uses: Vec<Use> = Vec::new();
        let mut add = |at, state, read, written| {
            let Some(value) = self.nodes[id].value(at) else { return };
            match uses.iter_mut().find(|used| used.value == value) {
                Some(used) => {
                    used.state = used.state | state;
                    (used.read, used.written) = (used.read || read, used.written || written);
                }
                None => uses.push(Use { value, state, read, written }),
            }
        };
        for entry in pass.entries().filter_map(|name| reflected.entry(name)).map(|(_, entry)| entry) {
            for index in &entry.uses {
                let variable = &reflected.variables[*index];
                let state = match variable.space {
                    Space::Buffer { writable: false, .. } => State::Buffer(BufferUses::STORAGE_READ_ONLY),
                    Space::Buffer { writable: true, .. } => State::Buffer(BufferUses::STORAGE_READ_WRITE),
                    Space::Texture(_) => State::Texture(TextureUses::RESOURCE),
                    Space::StorageTexture { access, .. } => State::Texture(of_access(access)),
                    Space::Uniform(_) | Space::Other => continue,
                };
                if let Some(at) = declaration.field(&variable.name) {
                    add(at, state, entry.reads.contains(index), entry.writes.contains(index));
                }
            }
        }
        for target in pass.targets() {
            add(*target, State::Texture(TextureUses::COLOR_TARGET), false, true);
        }
        if let Some(counts) = pass.group_counts() {
            add(*counts, State::Buffer(BufferUses::INDIRECT), true, false);
        }
        uses
    }

    /// A copy to GPU memory, or from it.
    fn copied(&self, value: Value, to: bool) -> Use {
        let is_texture = matches!(self.storages[value.storage].element, Element::Texel(_));
        let state = match (is_texture, to) {
            (false, true) => State::Buffer(BufferUses::COPY_DST),
            (false, false) => State::Buffer(BufferUses::COPY_SRC),
            (true, true) => State::Texture(TextureUses::COPY_DST),
            (true, false) => State::Texture(TextureUses::COPY_SRC),
        };
        Use { value, state, read: !to, written: to }
    }

    /// The number of each step.
    fn barriers(&self, uses: &[Vec<Use>]) -> Vec<u32> {
        let mut last: HashMap<SlotId, State> = HashMap::new();
        // Two frames, an even and an odd one, use all memory; the third finds it as every later one does.
        let [_, _, steady] = [0, 1, 0].map(|parity| {
            let mut waits = |used: &&Use| {
                let before = last.insert(self.slot(used.value, Side::Gpu, parity), used.state);
                before != Some(used.state) || !used.state.only_reads()
            };
            uses.iter().map(|used| used.iter().filter(&mut waits).count() as u32).collect()
        });
        steady
    }
}

fn of_pass(pass: &Pass, reflected: &Reflected) -> Work {
    let entries = pass.entries().filter_map(|name| reflected.entry(name));
    let atomics = entries.map(|(_, entry)| entry.atomics).sum();
    match pass {
        Pass::Compute { .. } => Work { dispatches: 1, atomics, ..Work::default() },
        // Each draw clears the depth that the one before has left.
        Pass::Draw { depth, .. } => {
            Work { draws: 1, atomics, barriers: u32::from(*depth), ..Work::default() }
        }
    }
}

fn of_access(access: StorageAccess) -> TextureUses {
    match (access.contains(StorageAccess::LOAD), access.contains(StorageAccess::STORE)) {
        (true, true) => TextureUses::STORAGE_READ_WRITE,
        (true, false) => TextureUses::STORAGE_READ_ONLY,
        (false, _) => TextureUses::STORAGE_WRITE_ONLY,
    }
}

/// A plan's table with what each step asks of the GPU.
pub struct WithWork<'a> {
    /// The plan.
    pub plan: &'a Plan,
    /// Its [`Plan::work`].
    pub work: &'a [Work],
    /// The number of pixels, for bytes a pixel.
    pub pixels: u64,
}

impl fmt::Display for WithWork<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let number = |number: u32| if number == 0 { String::new() } else { number.to_string() };
        let per_pixel = |bytes: u64| match bytes {
            0 => String::new(),
            _ => format!("{:.1}", bytes as f64 / self.pixels as f64),
        };
        let cells = |work: Work| {
            let Work { dispatches, draws, barriers, read, written, atomics } = work;
            let [passes, barriers, atomics] = [dispatches + draws, barriers, atomics].map(number);
            let [read, written] = [read, written].map(per_pixel);
            format!("  {passes:>6}  {barriers:>8}  {read:>9}  {written:>12}  {atomics:>7}")
        };
        let columns = Columns {
            headings: "  passes  barriers  B/px read  B/px written  atomics",
            cells: self.work.iter().map(|work| cells(*work)).collect(),
            frame: cells(self.work.iter().copied().sum()),
        };
        self.plan.write(f, Some(&columns))
    }
}
