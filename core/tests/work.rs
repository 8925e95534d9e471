//! What a frame asks of the GPU, in a small graph, against numbers counted by hand.

use epigraph_core::{
    CpuContext, Extent, Facts, GraphFile, In, Io, Pass, Registry, Settings, Shader, Shape, Side, Stage, Step,
    Threads, WithWork, Work, compile, texel,
};

/// What is on the CPU.
struct Given;

impl Stage for Given {
    const KIND: &'static str = "given";
    const DOC: &'static str = "Writes lists.";
    type Params = ();
    fn declare((): &(), io: &mut Io) -> Self {
        io.write::<u32>("groups", "numbers of workgroups", Extent::Fixed([3, 1]));
        io.write::<[f32; 2]>("list", "places", Extent::Fixed([5, 1]));
        Self
    }
    fn cpu(&self, (): &(), _: &CpuContext) -> Result<(), String> {
        Ok(())
    }
}

struct Paint;

impl Stage for Paint {
    const KIND: &'static str = "paint";
    const DOC: &'static str = "Writes a texture, in as many workgroups as a list says.";
    type Params = ();
    fn declare((): &(), io: &mut Io) -> Self {
        let source = "
@group(0) @binding(0) var<storage, read> groups: array<u32>;
@group(0) @binding(1) var color: texture_storage_2d<r32float, write>;
@compute @workgroup_size(8, 4) fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    textureStore(color, id.xy, vec4(1.0));
}
@compute @workgroup_size(1) fn length() { textureStore(color, vec2(0u), vec4(f32(arrayLength(&groups)))); }";
        io.shader(Shader::new("paint.wgsl", source));
        let groups: In<u32> = io.read("groups", "numbers of workgroups", Extent::Any);
        io.write::<texel::R32Float>("color", "ones", Extent::Frame(1));
        io.compute("main", Threads::Indirect(groups.into()));
        io.compute("length", Threads::Groups(1));
        Self
    }
    fn cpu(&self, (): &(), _: &CpuContext) -> Result<(), String> {
        Ok(())
    }
}

struct Mix;

impl Stage for Mix {
    const KIND: &'static str = "mix";
    const DOC: &'static str = "Three dispatches over a list that only they know.";
    type Params = ();
    fn declare((): &(), io: &mut Io) -> Self {
        let source = "
@group(0) @binding(0) var color: texture_2d<f32>;
@group(0) @binding(1) var<storage, read> before: array<u32>;
@group(0) @binding(2) var<storage, read_write> sums: array<atomic<u32>>;
@group(0) @binding(3) var<storage, read_write> mixed: array<u32>;
fn count(at: u32) { atomicAdd(&sums[at], 1u); }
@compute @workgroup_size(1) fn clear() { atomicStore(&sums[0], 0u); }
@compute @workgroup_size(1) fn add() {
    for (var i = 0u; i < arrayLength(&before); i++) {
        if textureLoad(color, vec2(0u), 0).x > 0.5 { count(0u); } else { count(1u); }
        atomicMax(&sums[0], before[i]);
    }
}
@compute @workgroup_size(1) fn finish() { mixed[0] = atomicLoad(&sums[0]); }";
        io.shader(Shader::new("mix.wgsl", source));
        io.read::<texel::R32Float>("color", "what is counted", Extent::Frame(1));
        io.history::<u32>("before", "its own output", Extent::Frame(1));
        io.write::<u32>("sums", epigraph_core::scratch("counts"), Extent::Fixed([2, 1]));
        io.write::<u32>("mixed", "counts", Extent::Frame(1));
        for entry in ["clear", "add", "finish"] {
            io.compute(entry, Threads::Groups(1));
        }
        Self
    }
    fn cpu(&self, (): &(), _: &CpuContext) -> Result<(), String> {
        Ok(())
    }
}

struct Draw;

impl Stage for Draw {
    const KIND: &'static str = "draw";
    const DOC: &'static str = "Draws points.";
    type Params = ();
    fn declare((): &(), io: &mut Io) -> Self {
        let source = "
@group(0) @binding(0) var<storage, read> list: array<vec2<f32>>;
@group(0) @binding(1) var<storage, read> groups: array<u32>;
@vertex fn place(@builtin(vertex_index) index: u32) -> @builtin(position) vec4<f32> {
    return vec4(list[index], 0.5, f32(arrayLength(&groups)));
}
@fragment fn paint() -> @location(0) vec4<f32> { return vec4(f32(arrayLength(&list) + groups[0])); }";
        io.shader(Shader::new("draw.wgsl", source));
        let list: In<[f32; 2]> = io.read("list", "places", Extent::Any);
        io.read::<u32>("groups", "numbers of workgroups", Extent::Any);
        let drawn = io.write::<texel::Rgba16Float>("drawn", "points", Extent::Frame(1));
        io.pass(Pass::Draw {
            vertex: "place".into(),
            fragment: "paint".into(),
            shape: Shape::Points,
            vertices: 1,
            count: list.into(),
            targets: vec![drawn.into()],
            depth: true,
            clear: 0.0,
        });
        Self
    }
    fn cpu(&self, (): &(), _: &CpuContext) -> Result<(), String> {
        Ok(())
    }
}

struct Shown;

impl Stage for Shown {
    const KIND: &'static str = "shown";
    const DOC: &'static str = "Reads what comes from the GPU.";
    type Params = ();
    fn declare((): &(), io: &mut Io) -> Self {
        io.read::<u32>("mixed", "counts", Extent::Any);
        io.write::<u32>("out", "nothing", Extent::Fixed([1, 1]));
        Self
    }
    fn cpu(&self, (): &(), _: &CpuContext) -> Result<(), String> {
        Ok(())
    }
}

const GRAPH: &str = r#"#![enable(implicit_some)]
Graph(version: 1, nodes: {
    "given": (kind: "given", on: Cpu),
    "paint": (kind: "paint", inputs: { "groups": "given.groups" }),
    "mix": (kind: "mix", inputs: { "color": "paint.color", "before": "mix.mixed" }),
    "draw": (kind: "draw", inputs: { "groups": "given.groups", "list": "given.list" }),
    "shown": (kind: "shown", on: Cpu, inputs: { "mixed": "mix.mixed" }),
}, outputs: { "out": "shown.out", "drawn": "draw.drawn" })"#;

/// The table and what the steps ask for, with 8 x 4 pixels.
fn counted(side: Side) -> (String, Vec<(String, Work)>) {
    let file = GraphFile::parse("work.ron", GRAPH).unwrap();
    let registry =
        Registry::default().with::<Given>().with::<Paint>().with::<Mix>().with::<Draw>().with::<Shown>();
    let settings = Settings { side, ..Settings::new([8, 4], 0, Facts::none()) };
    let (graph, plan) = compile(&file, &registry, &settings).unwrap();
    let work = plan.work(&graph, &registry.library).unwrap();
    let text = WithWork { plan: &plan, work: &work, pixels: 32 }.to_string();
    let steps = plan.steps.iter().zip(work).filter(|(step, _)| !matches!(step, Step::Tap { .. }));
    (text, steps.map(|(step, work)| (plan.step_name(step), work)).collect())
}

#[test]
fn a_frame_asks_for_what_was_counted_by_hand() {
    let (text, steps) = counted(Side::Gpu);
    let of = |name: &str| steps.iter().find(|(step, _)| step == name).unwrap_or_else(|| panic!("{text}")).1;
    let none = Work::default();
    assert_eq!((of("given"), of("shown")), (none, none));
    // 3 u32 and 5 vectors, which were last read by a draw.
    assert_eq!(of("upload given.groups"), Work { barriers: 1, written: 12, ..none });
    assert_eq!(of("upload given.list"), Work { barriers: 1, written: 40, ..none });
    // `main` reads the numbers, which have been copied, and writes the texture, which `add` read in the frame before.
    // `length` takes only the list's length, which reads nothing but waits, since it is another use; and writes again.
    assert_eq!(of("paint"), Work { dispatches: 2, barriers: 4, read: 12, written: 2 * 128, ..none });
    // `clear` waits for `sums` of the frame before. `add` waits for the texture, for `sums`, and for its own output of
    // the frame before, which has been copied; `finish` for `sums` and for the memory that `add` has read one frame ago.
    // Two calls of `count` and a maximum are atomic operations.
    let mix = Work { dispatches: 3, draws: 0, barriers: 1 + 3 + 2, read: 128 + 128 + 8 + 8, ..none };
    assert_eq!(of("mix"), Work { written: 8 + 8 + 128, atomics: 3, ..mix });
    assert_eq!(of("download mix.mixed"), Work { barriers: 1, read: 128, ..none });
    // The list that has been copied; the target and the depth, which the draw of the frame before has written. The vertices
    // read the list, and the fragments the numbers; each takes only the length of the other.
    assert_eq!(of("draw"), Work { draws: 1, barriers: 3, read: 40 + 12, written: 32 * 8, ..none });

    let frame: Work = steps.iter().map(|(_, work)| *work).sum();
    let totals = [12 + 272 + 128 + 52, 12 + 40 + 256 + 144 + 256];
    assert_eq!([frame.read, frame.written], totals);
    assert_eq!((frame.dispatches, frame.draws, frame.barriers, frame.atomics), (5, 1, 16, 3));
    // Nothing is blank; one is one.
    let of_draw = text.lines().find(|line| line.contains("draw")).unwrap_or_else(|| panic!("{text}"));
    let numbers: Vec<_> = of_draw.split_whitespace().rev().take(4).collect();
    assert_eq!(numbers, ["8.0", "1.6", "3", "1"], "{text}");
    let last =
        text.lines().find(|line| line.trim_start().starts_with("frame")).unwrap_or_else(|| panic!("{text}"));
    // 6 passes; bytes by 32 pixels.
    assert_eq!(
        last.split_whitespace().collect::<Vec<_>>(),
        ["frame", "6", "16", "14.5", "22.1", "3"],
        "{text}"
    );
}
