//! The passes that find the first bad element of what a node wrote on the GPU, and the results of the shaders' own
//! checks.

use std::{fmt::Write, sync::Arc};

use index_vec::IndexVec;

use super::{
    Gpu, RunError,
    memory::GpuMemory,
    pipelines::{GpuPass, Groups, Pipeline, in_rows},
};
use crate::{
    executor::{
        programs::Program,
        readback::Readback,
        watch::{Suspect, Watch, WatchedField},
    },
    frame::Frame,
    graph::Graph,
    id::{NodeId, SlotId},
    plan::{Plan, Value},
    port::Element,
    reflect::{self, CHECK_WORDS, Check},
    shader::{Needs, Shader, ShaderLibrary},
    side::Side,
    values::{Number, Reading, words},
};

/// Bytes of an entry: a multiple of what bindings are aligned to on all devices.
const ENTRY: u64 = 4 * CHECK_WORDS as u64;

/// No element.
const NOTHING: u32 = u32::MAX;

/// Threads of a workgroup.
const WIDTH: u32 = 64;

/// What watched nodes write on the GPU besides their outputs.
pub(super) struct GpuWatch {
    /// All entries. Each has the index of the first element that is bad, or fails a check, and that element's words.
    found: wgpu::Buffer,
    nothing: Vec<u8>,
    readback: Readback,
    entries: IndexVec<NodeId, Entries>,
}

/// The entries of a node: one for each check of its shader, then one for each field that can hold something bad.
#[derive(Default)]
struct Entries {
    first: u64,
    checks: Vec<Check>,
    /// For each entry the index of its field in the node's watched fields.
    fields: Vec<usize>,
}

impl GpuWatch {
    /// Allocates the entries of all nodes.
    ///
    /// # Errors
    /// [`RunError::Stage`] if a shader does not compose, or if an element is too large to be copied.
    pub fn new(gpu: &Gpu, graph: &Graph, watch: &Watch, library: &ShaderLibrary) -> Result<Self, RunError> {
        let mut count = 0;
        let mut entries: IndexVec<NodeId, Entries> = IndexVec::new();
        for (node, watched) in graph.nodes.iter().zip(watch.nodes()) {
            let mut of_node = Entries { first: count, ..Entries::default() };
            if let (Side::Gpu, Some(shader)) = (node.side, &node.declaration().shader) {
                let fail = |message: String| RunError::Stage { node: node.name.clone(), message };
                let composed = reflect::join(&reflect::watched(shader), library);
                let composed = composed.map_err(|error| fail(error.to_string()))?;
                let errors = reflect::errors_of_checks(&composed, node.declaration());
                if let Some(error) = errors.first() {
                    return Err(fail(error.to_string()));
                }
                of_node.checks = composed.checks;
                let fields = &watched.fields;
                let of_check = |check: &Check| fields.iter().position(|field| field.variable == check.port);
                of_node.fields = of_node.checks.iter().filter_map(of_check).collect();
                let can_fail = |index: &usize| !fields[*index].numbers.is_empty();
                of_node.fields.extend((0..fields.len()).filter(can_fail));
                let too_large = |index: &&usize| words(&fields[**index].element) >= CHECK_WORDS;
                if let Some(field) = of_node.fields.iter().find(too_large) {
                    let text =
                        "has elements of more than 252 bytes, which cannot be watched; run it on the CPU";
                    return Err(fail(format!("`{}` {text}", fields[*field].name)));
                }
                count += of_node.fields.len() as u64;
            }
            entries.push(of_node);
        }
        let bytes = ENTRY * count.max(1);
        let found = gpu.device.create_buffer(&wgpu::BufferDescriptor {
            label: Some("bad values"),
            size: bytes,
            usage: wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_SRC | wgpu::BufferUsages::COPY_DST,
            mapped_at_creation: false,
        });
        let readback = Readback::new(&gpu.device, bytes, 1);
        Ok(Self { found, nothing: vec![0xFF; bytes as usize], readback, entries })
    }

    /// The binding of the results of a node's checks.
    pub fn checks(&self, node: NodeId) -> wgpu::BindingResource<'_> {
        let Entries { first, checks, .. } = &self.entries[node];
        self.binding(*first, checks.len() as u64)
    }

    fn binding(&self, first: u64, count: u64) -> wgpu::BindingResource<'_> {
        let (offset, size) = (ENTRY * first, wgpu::BufferSize::new(ENTRY * count));
        wgpu::BindingResource::Buffer(wgpu::BufferBinding { buffer: &self.found, offset, size })
    }

    /// The passes that follow a node, and the programs that they need.
    pub fn passes(
        &self,
        gpu: &Gpu,
        plan: &Plan,
        watch: &Watch,
        memory: &IndexVec<SlotId, GpuMemory>,
        node: NodeId,
    ) -> Result<(Vec<GpuPass>, Vec<Arc<Program>>), String> {
        let (mut passes, mut programs) = (Vec::new(), Vec::new());
        let Entries { first, checks, fields } = &self.entries[node];
        for (entry, &index) in fields.iter().enumerate() {
            let field = &watch.nodes()[node].fields[index];
            let shader = Shader::new("watch.wgsl", shader(field));
            let program = gpu.programs.get(gpu, &shader, &ShaderLibrary::default(), Needs::default())?;
            let mut add = |point: &str, threads: usize| {
                let pipeline = program.compute(&gpu.device, point);
                let bindings = [0, 1].map(|parity| {
                    let slot = plan.slot(Value::now(field.storage), Side::Gpu, parity);
                    let found = self.binding(first + entry as u64, 1);
                    let entries = [
                        wgpu::BindGroupEntry { binding: 0, resource: memory[slot].binding() },
                        wgpu::BindGroupEntry { binding: 1, resource: found },
                    ];
                    gpu.device.create_bind_group(&wgpu::BindGroupDescriptor {
                        label: Some("watch"),
                        layout: &pipeline.get_bind_group_layout(0),
                        entries: &entries,
                    })
                });
                let groups = Groups::Known(in_rows(threads, WIDTH));
                passes.push(GpuPass { pipeline: Pipeline::Compute { pipeline, groups }, bindings });
            };
            // The element of a check is found by the node itself.
            if entry >= checks.len() {
                add("find", field.dims.count());
            }
            add("keep", 1);
            programs.push(program);
        }
        Ok((passes, programs))
    }

    /// Begins a frame: nothing is found yet.
    pub fn begin(&self, queue: &wgpu::Queue) {
        queue.write_buffer(&self.found, 0, &self.nothing);
    }

    /// Records the end of a frame.
    pub fn end(&mut self, encoder: &mut wgpu::CommandEncoder) {
        let staged = self.readback.record(0);
        encoder.copy_buffer_to_buffer(&self.found, 0, staged, 0, self.nothing.len() as u64);
    }

    /// Requests the results; call it after the submission.
    pub fn map(&mut self) {
        self.readback.map();
    }

    /// Waits for the results and reports what was found.
    pub fn read(&mut self, gpu: &Gpu, watch: &mut Watch, frame: &Frame) -> Result<(), RunError> {
        let entries = &self.entries;
        self.readback.take(gpu, 0, |bytes| {
            let all: Vec<u32> = bytemuck::pod_collect_to_vec(bytes);
            for (node, Entries { first, checks, fields }) in entries.iter_enumerated() {
                for (entry, &field) in fields.iter().enumerate() {
                    let entry_words = &all[(*first as usize + entry) * CHECK_WORDS..][..CHECK_WORDS];
                    let (element, element_words) = (entry_words[0], &entry_words[1..]);
                    if element != NOTHING {
                        let check = checks.get(entry).map(|check| check.text.as_str());
                        let count = words(&watch.nodes()[node].fields[field].element);
                        let words = &element_words[..count];
                        let suspect = Suspect { field, element: element as usize, words, check };
                        watch.report(node, &suspect, frame);
                    }
                }
            }
        })
    }
}

/// The shader that finds the first bad element of a field, and copies an element.
fn shader(field: &WatchedField) -> String {
    let (binding, count, word) = match &field.element {
        Element::Texel(format) => {
            let (scalar, value) = match format.is_float() {
                true => ("f32", "bitcast<u32>(texel[at])"),
                false => ("u32", "texel[at]"),
            };
            (
                format!("var texels: texture_2d<{scalar}>;"),
                "textureDimensions(texels).x * textureDimensions(texels).y".to_owned(),
                format!(
                    "let width = textureDimensions(texels).x;\n    \
                     let texel = textureLoad(texels, vec2(element % width, element / width), 0);\n    return {value};"
                ),
            )
        }
        element => {
            let stride = element.bytes() / 4;
            (
                "var<storage, read> words: array<u32>;".to_owned(),
                format!("arrayLength(&words) / {stride}u"),
                format!("return words[element * {stride}u + at];"),
            )
        }
    };
    let mut conditions = String::new();
    for number in &field.numbers {
        writeln!(conditions, "    bad |= {};", is_bad(number)).expect("a String takes all");
    }
    let words = words(&field.element);
    format!(
        "@group(0) @binding(0) {binding}
@group(0) @binding(1) var<storage, read_write> found: array<atomic<u32>>;

fn word(element: u32, at: u32) -> u32 {{
    {word}
}}

// The bits of a float as a number that is ordered like it, NaN at both ends: shaders may assume that there is none.
fn key(bits: u32) -> i32 {{
    let key = bitcast<i32>(bits);
    return key ^ ((key >> 31u) & 0x7FFFFFFF);
}}

fn is_bad(element: u32) -> bool {{
    var bad = false;
{conditions}    return bad;
}}

@compute @workgroup_size({WIDTH})
fn find(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {{
    let element = id.x + id.y * groups.x * {WIDTH}u;
    if element < {count} && is_bad(element) {{
        atomicMin(&found[0], element);
    }}
}}

@compute @workgroup_size({WIDTH})
fn keep(@builtin(local_invocation_index) at: u32) {{
    let element = atomicLoad(&found[0]);
    if at < {words}u && element < {count} {{
        atomicStore(&found[1u + at], word(element, at));
    }}
}}
"
    )
}

/// The condition that a number of `element` is not allowed.
fn is_bad(number: &Number) -> String {
    let Number { word, reading, bits: [from, count], keys: [low, high], none, .. } = number;
    let word = format!("word(element, {word}u)");
    let part = match count {
        32 => word.clone(),
        count => format!("extractBits({word}, {from}u, {count}u)"),
    };
    // WGSL has no literal for the least i32.
    let signed = |key: i64| format!("bitcast<i32>({}u)", key as i32 as u32);
    let (value, low, high) = match reading {
        Reading::Float => (format!("key({part})"), signed(*low), signed(*high)),
        Reading::Signed => (format!("bitcast<i32>({part})"), signed(*low), signed(*high)),
        Reading::Unsigned => (part, format!("{low}u"), format!("{high}u")),
    };
    let outside = format!("({value} < {low} || {value} > {high})");
    match none {
        Some(bits) => format!("{outside} && {word} != {bits}u"),
        None => outside,
    }
}
