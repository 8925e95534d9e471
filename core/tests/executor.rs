//! The executor on small graphs whose results are known by hand: both sides, mixed, history, kept memory, late
//! downloads, poison, no pooling.

use std::{
    thread,
    time::{Duration, Instant},
};

use epigraph_core::{
    Access, CpuContext, Executor, Extent, Facts, Frame, GraphFile, Host, In, Io, Life, Out, Registry,
    RunError, Runs, Settings, Shader, ShaderModule, Side, Snapshot, Source, Stage, Step, compile, params,
    testing::{Random, gpu},
    texel,
};

/// Counts frames in kept memory and writes pixel index + 1000 * frame.
struct Ramp {
    count: Out<u32>,
    ramp: Out<u32>,
}

impl Stage for Ramp {
    const KIND: &'static str = "ramp";
    const DOC: &'static str = "Pixel index plus a thousand times the number of frames so far.";
    type Params = ();

    fn declare((): &(), io: &mut Io) -> Self {
        io.shader(Shader::new(
            "ramp.wgsl",
            "
#import frame
@group(0) @binding(1) var<storage, read_write> count: array<u32>;
@group(0) @binding(2) var<storage, read_write> ramp: array<u32>;
@compute @workgroup_size(1) fn add() { count[0] += 1u; }
@compute @workgroup_size(8, 8) fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    if any(id.xy >= frame.size) { return; }
    let pixel = id.y * frame.size.x + id.x;
    ramp[pixel] = pixel + 1000u * count[0];
}",
        ));
        let count = io.persistent("count", "frames so far", Extent::Fixed([1, 1]));
        let ramp = io.write("ramp", "the ramp", Extent::Frame(1));
        io.dispatch("add", count);
        io.dispatch("main", ramp);
        Self { count, ramp }
    }

    fn cpu(&self, (): &(), cx: &CpuContext) -> Result<(), String> {
        let mut count = cx.write(self.count);
        count[0] += 1;
        for (pixel, value) in cx.write(self.ramp).iter_mut().enumerate() {
            *value = pixel as u32 + 1000 * count[0];
        }
        Ok(())
    }
}

params! {
    /// Parameters of `mix`.
    pub struct MixParams {
        /// Weight of the value of the frame before.
        weight: u32 = 2, in 0..=10;
    }
}

/// now + weight * before, as a texture.
struct Mix {
    now: In<u32>,
    before: In<u32>,
    sum: Out<texel::R32Uint>,
}

impl Stage for Mix {
    const KIND: &'static str = "mix";
    const DOC: &'static str = "Adds a multiple of last frame's value.";
    type Params = MixParams;

    fn declare(_: &MixParams, io: &mut Io) -> Self {
        io.shader(Shader::new(
            "mix.wgsl",
            "
#import frame
struct Params { weight: u32 }
@group(0) @binding(1) var<uniform> params: Params;
@group(0) @binding(2) var<storage, read> now: array<u32>;
@group(0) @binding(3) var<storage, read> before: array<u32>;
@group(0) @binding(4) var sum: texture_storage_2d<r32uint, write>;
@compute @workgroup_size(8, 2) fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    if any(id.xy >= frame.size) { return; }
    let pixel = id.y * frame.size.x + id.x;
    textureStore(sum, id.xy, vec4(now[pixel] + params.weight * before[pixel], 0u, 0u, 0u));
}",
        ));
        let now = io.read("now", "this frame's", Extent::Frame(1));
        let before = io.history("before", "last frame's", Extent::Frame(1));
        let sum = io.write("sum", "the sum", Extent::Frame(1));
        io.dispatch("main", sum);
        Self { now, before, sum }
    }

    fn cpu(&self, params: &MixParams, cx: &CpuContext) -> Result<(), String> {
        let (now, before) = (cx.read(self.now), cx.read(self.before));
        for (pixel, sum) in cx.write(self.sum).iter_mut().enumerate() {
            *sum = now[pixel] + params.weight * before[pixel];
        }
        Ok(())
    }
}

/// Adds one to every texel's copy in a list, in place.
struct Bump {
    list: Out<u32>,
}

impl Stage for Bump {
    const KIND: &'static str = "bump";
    const DOC: &'static str = "Adds one in place.";
    type Params = ();

    fn declare((): &(), io: &mut Io) -> Self {
        io.shader(Shader::new(
            "bump.wgsl",
            "
#import index
@group(0) @binding(0) var<storage, read_write> list: array<u32>;
@compute @workgroup_size(64) fn main(
    @builtin(global_invocation_id) id: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
) {
    let i = linear_index(id, groups, 64u);
    if i < arrayLength(&list) { list[i] += 1u; }
}",
        ));
        let list = io.update("list", "changed in place", Extent::Any);
        io.dispatch("main", list);
        Self { list }
    }

    fn cpu(&self, (): &(), cx: &CpuContext) -> Result<(), String> {
        cx.write(self.list).iter_mut().for_each(|value| *value += 1);
        Ok(())
    }
}

/// Like [`Bump`], per view.
struct Lift(Bump);

impl Stage for Lift {
    const KIND: &'static str = "lift";
    const DOC: &'static str = "Adds one in place, if what it adds to is new.";
    type Params = ();

    fn declare((): &(), io: &mut Io) -> Self {
        io.per_view();
        Self(Bump::declare(&(), io))
    }

    fn cpu(&self, (): &(), cx: &CpuContext) -> Result<(), String> {
        self.0.cpu(&(), cx)
    }
}

/// Kept numbers that do not change.
struct Still {
    numbers: Out<u32>,
}

impl Stage for Still {
    const KIND: &'static str = "still";
    const DOC: &'static str = "Ten times the index.";
    type Params = ();

    fn declare((): &(), io: &mut Io) -> Self {
        io.per_view();
        io.shader(Shader::new(
            "still.wgsl",
            "
#import index
@group(0) @binding(0) var<storage, read_write> numbers: array<u32>;
@compute @workgroup_size(64) fn main(
    @builtin(global_invocation_id) id: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
) {
    let i = linear_index(id, groups, 64u);
    if i < arrayLength(&numbers) { numbers[i] = 10u * i; }
}",
        ));
        let numbers = io.persistent("numbers", "the numbers", Extent::Frame(1));
        io.dispatch("main", numbers);
        Self { numbers }
    }

    fn cpu(&self, (): &(), cx: &CpuContext) -> Result<(), String> {
        (0..).zip(&mut *cx.write(self.numbers)).for_each(|(index, number)| *number = 10 * index);
        Ok(())
    }
}

/// Kept numbers that change in every third frame only.
struct Rarely {
    numbers: Out<u32>,
}

impl Stage for Rarely {
    const KIND: &'static str = "rarely";
    const DOC: &'static str = "Numbers that seldom change.";
    type Params = ();

    fn declare((): &(), io: &mut Io) -> Self {
        Self { numbers: io.persistent("numbers", "the numbers", Extent::Frame(1)) }
    }

    fn cpu(&self, (): &(), cx: &CpuContext) -> Result<(), String> {
        let frame = cx.frame().index;
        if frame % 3 == 1 {
            cx.write(self.numbers).fill(frame);
        } else {
            // A lie, to see whether the upload is left out.
            cx.write(self.numbers).fill(99);
            cx.unchanged(self.numbers);
        }
        Ok(())
    }
}

/// Kept numbers of which three change in every frame, of which frame 2 reports one.
struct Few {
    numbers: Out<u32>,
}

impl Stage for Few {
    const KIND: &'static str = "few";
    const DOC: &'static str = "Numbers of which few change.";
    type Params = ();

    fn declare((): &(), io: &mut Io) -> Self {
        Self { numbers: io.persistent("numbers", "the numbers", Extent::Frame(1)) }
    }

    fn cpu(&self, (): &(), cx: &CpuContext) -> Result<(), String> {
        let numbers = &mut cx.write(self.numbers);
        let frame = cx.frame().index;
        // The ninth is a lie, to see whether it is left out.
        for at in [3, 5, 6, 9] {
            numbers[at] = frame + 1;
        }
        cx.changed(self.numbers, 3..4);
        if frame != 2 {
            cx.changed(self.numbers, 5..7);
        }
        Ok(())
    }
}

/// Says that it follows from its input and the view, but writes the frame's number too: that tells when it ran.
struct Look {
    input: In<u32>,
    output: Out<u32>,
}

impl Stage for Look {
    const KIND: &'static str = "look";
    const DOC: &'static str = "Its input, and a thousand times the number of the frame in which it ran.";
    type Params = ();

    fn declare((): &(), io: &mut Io) -> Self {
        io.per_view();
        io.shader(Shader::new(
            "look.wgsl",
            "
#import frame
#import index
@group(0) @binding(1) var<storage, read> input: array<u32>;
@group(0) @binding(2) var<storage, read_write> output: array<u32>;
@compute @workgroup_size(64) fn main(
    @builtin(global_invocation_id) id: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
) {
    let i = linear_index(id, groups, 64u);
    if i < arrayLength(&output) { output[i] = input[i] + 1000u * frame.index; }
}",
        ));
        let input = io.read("input", "read", Extent::Any);
        let output = io.write("output", "written", Extent::Like("input".into()));
        io.dispatch("main", output);
        Self { input, output }
    }

    fn cpu(&self, (): &(), cx: &CpuContext) -> Result<(), String> {
        let frame = 1000 * cx.frame().index;
        for (output, input) in cx.write(self.output).iter_mut().zip(&*cx.read(self.input)) {
            *output = input + frame;
        }
        Ok(())
    }
}

/// Fails or panics, as its parameter says.
struct Faulty;

params! {
    /// Parameters of `faulty`.
    pub struct FaultyParams {
        /// Panic instead of returning an error.
        panic: bool = false;
    }
}

impl Stage for Faulty {
    const KIND: &'static str = "faulty";
    const DOC: &'static str = "Fails.";
    type Params = FaultyParams;

    fn declare(_: &FaultyParams, io: &mut Io) -> Self {
        io.write::<u32>("nothing", "nothing", Extent::Fixed([1, 1]));
        Self
    }

    fn cpu(&self, params: &FaultyParams, _: &CpuContext) -> Result<(), String> {
        assert!(!params.panic, "as asked");
        Err("cannot go on".into())
    }
}

params! {
    /// Parameters of `stumble`.
    pub struct StumbleParams {
        /// The frame in which it fails.
        at: u32 = 0, in 0..=1000;
        /// Panic instead of returning an error.
        panic: bool = false;
    }
}

/// Passes a list on, but in one frame fails with the list half changed. Waits for another port.
struct Stumble {
    list: Out<u32>,
}

impl Stage for Stumble {
    const KIND: &'static str = "stumble";
    const DOC: &'static str = "Fails in one frame.";
    type Params = StumbleParams;

    fn declare(_: &StumbleParams, io: &mut Io) -> Self {
        let list = io.update("list", "passed on", Extent::Any);
        io.optional::<u32>("after", "runs before this one", Extent::Any);
        Self { list }
    }

    fn cpu(&self, params: &StumbleParams, cx: &CpuContext) -> Result<(), String> {
        if cx.frame().index != params.at {
            return Ok(());
        }
        cx.write(self.list)[..8].fill(77);
        assert!(!params.panic, "as asked");
        Err("cannot go on".into())
    }
}

/// Four numbers for each pixel: the most bytes that a frame's size can ask for are then more than WebGPU can bind.
struct Wide;

impl Stage for Wide {
    const KIND: &'static str = "wide";
    const DOC: &'static str = "Much memory.";
    type Params = ();

    fn declare((): &(), io: &mut Io) -> Self {
        io.shader(Shader::new(
            "wide.wgsl",
            "
@group(0) @binding(0) var<storage, read_write> list: array<vec4<f32>>;
@compute @workgroup_size(64) fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    if id.x < arrayLength(&list) { list[id.x] = vec4(0.0); }
}",
        ));
        let list = io.write::<[f32; 4]>("list", "written", Extent::Frame(1));
        io.dispatch("main", list);
        Self
    }

    fn cpu(&self, (): &(), _: &CpuContext) -> Result<(), String> {
        Ok(())
    }
}

/// Writes a bundle of two fields.
struct Pair {
    low: Out<u32>,
    high: Out<u32>,
}

impl Stage for Pair {
    const KIND: &'static str = "pair";
    const DOC: &'static str = "Ones and twos.";
    type Params = ();

    fn declare((): &(), io: &mut Io) -> Self {
        io.shader(Shader::new(
            "pair.wgsl",
            "
@group(0) @binding(0) var<storage, read_write> pair_low: array<u32>;
@group(0) @binding(1) var<storage, read_write> pair_high: array<u32>;
@compute @workgroup_size(64) fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    if id.x < arrayLength(&pair_low) {
        pair_low[id.x] = 1u;
        pair_high[id.x] = 2u;
    }
}",
        ));
        let mut pair = io.bundle(Access::Write, "pair", "ones and twos", Extent::Frame(1));
        let (low, high) = (pair.write("low"), pair.write("high"));
        io.dispatch("main", low);
        Self { low, high }
    }

    fn cpu(&self, (): &(), cx: &CpuContext) -> Result<(), String> {
        cx.write(self.low).fill(1);
        cx.write(self.high).fill(2);
        Ok(())
    }
}

/// Changes one of the fields.
struct Raise {
    high: Out<u32>,
}

impl Stage for Raise {
    const KIND: &'static str = "raise";
    const DOC: &'static str = "Ten more.";
    type Params = ();

    fn declare((): &(), io: &mut Io) -> Self {
        io.shader(Shader::new(
            "raise.wgsl",
            "
@group(0) @binding(0) var<storage, read_write> pair_high: array<u32>;
@compute @workgroup_size(64) fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    if id.x < arrayLength(&pair_high) { pair_high[id.x] += 10u; }
}",
        ));
        let high = io.bundle(Access::Update, "pair", "raised", Extent::Any).write("high");
        io.dispatch("main", high);
        Self { high }
    }

    fn cpu(&self, (): &(), cx: &CpuContext) -> Result<(), String> {
        cx.write(self.high).iter_mut().for_each(|high| *high += 10);
        Ok(())
    }
}

/// Takes its time on the CPU.
struct Slow;

impl Stage for Slow {
    const KIND: &'static str = "slow";
    const DOC: &'static str = "Waits.";
    type Params = ();

    fn declare((): &(), io: &mut Io) -> Self {
        io.optional::<u32>("after", "runs before this one", Extent::Any);
        io.write::<u32>("nothing", "nothing", Extent::Fixed([1, 1]));
        Self
    }

    fn cpu(&self, (): &(), _: &CpuContext) -> Result<(), String> {
        thread::sleep(Duration::from_millis(20));
        Ok(())
    }
}

/// The texels of a texture as a list.
struct Unpack {
    texture: In<texel::R32Uint>,
    list: Out<u32>,
}

impl Stage for Unpack {
    const KIND: &'static str = "unpack";
    const DOC: &'static str = "Reads a texture.";
    type Params = ();

    fn declare((): &(), io: &mut Io) -> Self {
        io.shader(Shader::new(
            "unpack.wgsl",
            "
#import frame
@group(0) @binding(1) var texture: texture_2d<u32>;
@group(0) @binding(2) var<storage, read_write> list: array<u32>;
@compute @workgroup_size(8, 8) fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    if any(id.xy >= frame.size) { return; }
    list[id.y * frame.size.x + id.x] = textureLoad(texture, id.xy, 0).x;
}",
        ));
        let texture = io.read("texture", "read", Extent::Frame(1));
        let list = io.write("list", "its texels", Extent::Frame(1));
        io.dispatch("main", texture);
        Self { texture, list }
    }

    fn cpu(&self, (): &(), cx: &CpuContext) -> Result<(), String> {
        cx.write(self.list).copy_from_slice(&cx.read(self.texture));
        Ok(())
    }
}

/// Adds to its texture of the last frame.
struct Trail {
    before: In<texel::R32Uint>,
    steps: Out<texel::R32Uint>,
}

impl Stage for Trail {
    const KIND: &'static str = "trail";
    const DOC: &'static str = "Adds each pixel's number, from 1, to what the last frame had.";
    type Params = ();

    fn declare((): &(), io: &mut Io) -> Self {
        io.shader(Shader::new(
            "trail.wgsl",
            "
#import frame
@group(0) @binding(1) var before: texture_2d<u32>;
@group(0) @binding(2) var steps: texture_storage_2d<r32uint, write>;
@compute @workgroup_size(8, 8) fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    if any(id.xy >= frame.size) { return; }
    let pixel = id.y * frame.size.x + id.x;
    textureStore(steps, id.xy, textureLoad(before, id.xy, 0) + vec4(pixel + 1u, 0u, 0u, 0u));
}",
        ));
        let before = io.history("before", "its output", Extent::Frame(1));
        let steps = io.write("steps", "sums", Extent::Frame(1));
        io.dispatch("main", steps);
        Self { before, steps }
    }

    fn cpu(&self, (): &(), cx: &CpuContext) -> Result<(), String> {
        let before = cx.read(self.before);
        for (pixel, (now, before)) in (1..).zip(cx.write(self.steps).iter_mut().zip(&*before)) {
            *now = before + pixel;
        }
        Ok(())
    }
}

params! {
    /// Parameters of `seldom`.
    pub struct SeldomParams {
        /// Frames by which the changes come earlier.
        ahead: u32 = 0, in 0..=4;
        /// Whether it declares that it seldom changes.
        declares: bool = true;
    }
}

/// Kept numbers of which now all, now some, now none change, which it reports as it is.
struct Seldom {
    numbers: Out<u32>,
}

impl Stage for Seldom {
    const KIND: &'static str = "seldom";
    const DOC: &'static str = "Numbers of which some change.";
    type Params = SeldomParams;

    fn declare(params: &SeldomParams, io: &mut Io) -> Self {
        if params.declares {
            io.seldom();
        }
        Self { numbers: io.persistent("numbers", "the numbers", Extent::Frame(1)) }
    }

    fn cpu(&self, params: &SeldomParams, cx: &CpuContext) -> Result<(), String> {
        let (frame, numbers) = ((cx.frame().index + params.ahead) as usize, &mut cx.write(self.numbers));
        match frame * 7 % 5 {
            0 => numbers.iter_mut().zip(frame as u32..).for_each(|(number, new)| *number = new),
            1 | 2 => cx.unchanged(self.numbers),
            three_or_four => {
                for start in [frame % 31, 31 + frame % 17].into_iter().take(three_or_four - 2) {
                    numbers[start..start + 3].fill(1000 + frame as u32);
                    cx.changed(self.numbers, start..start + 3);
                }
            }
        }
        Ok(())
    }
}

/// Follows from its inputs alone.
struct Join {
    inputs: [In<u32>; 2],
    output: Out<u32>,
}

impl Stage for Join {
    const KIND: &'static str = "join";
    const DOC: &'static str = "The sum of its inputs.";
    type Params = ();

    fn declare((): &(), io: &mut Io) -> Self {
        io.per_view();
        io.shader(Shader::new(
            "join.wgsl",
            "
#import index
@group(0) @binding(1) var<storage, read> one: array<u32>;
@group(0) @binding(2) var<storage, read> other: array<u32>;
@group(0) @binding(3) var<storage, read_write> output: array<u32>;
@compute @workgroup_size(64) fn main(
    @builtin(global_invocation_id) id: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
) {
    let i = linear_index(id, groups, 64u);
    if i < arrayLength(&output) { output[i] = one[i] + other[i]; }
}",
        ));
        let inputs = ["one", "other"].map(|name| io.read(name, "read", Extent::Frame(1)));
        let output = io.write("output", "the sum", Extent::Frame(1));
        io.dispatch("main", output);
        Self { inputs, output }
    }

    fn cpu(&self, (): &(), cx: &CpuContext) -> Result<(), String> {
        let [one, other] = self.inputs.map(|input| cx.read(input));
        for (at, output) in cx.write(self.output).iter_mut().enumerate() {
            *output = one[at].wrapping_add(other[at]);
        }
        Ok(())
    }
}

/// Follows from its input and the view.
struct See {
    input: In<u32>,
    output: Out<u32>,
}

impl Stage for See {
    const KIND: &'static str = "see";
    const DOC: &'static str = "Twice its input and the eye's place.";
    type Params = ();

    fn declare((): &(), io: &mut Io) -> Self {
        io.per_view();
        io.shader(Shader::new(
            "see.wgsl",
            "
#import frame
#import index
@group(0) @binding(1) var<storage, read> input: array<u32>;
@group(0) @binding(2) var<storage, read_write> output: array<u32>;
@compute @workgroup_size(64) fn main(
    @builtin(global_invocation_id) id: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
) {
    let i = linear_index(id, groups, 64u);
    if i < arrayLength(&output) { output[i] = 2u * input[i] + u32(frame.view.eye.x); }
}",
        ));
        let input = io.read("input", "read", Extent::Any);
        let output = io.write("output", "written", Extent::Like("input".into()));
        io.dispatch("main", output);
        Self { input, output }
    }

    fn cpu(&self, (): &(), cx: &CpuContext) -> Result<(), String> {
        let eye = cx.frame().view.eye[0] as u32;
        for (output, input) in cx.write(self.output).iter_mut().zip(&*cx.read(self.input)) {
            *output = input.wrapping_mul(2).wrapping_add(eye);
        }
        Ok(())
    }
}

fn registry() -> Registry {
    Registry::default()
        .with::<Slow>()
        .with::<Unpack>()
        .with::<Trail>()
        .with::<Seldom>()
        .with::<See>()
        .with::<Still>()
        .with_module(ShaderModule::new("frame", epigraph_shaders::text("shared/frame.wgsl")))
        .with_module(ShaderModule::new("index", epigraph_shaders::text("shared/index.wgsl")))
        .with::<Ramp>()
        .with::<Mix>()
        .with::<Bump>()
        .with::<Lift>()
        .with::<Faulty>()
        .with::<Stumble>()
        .with::<Few>()
        .with::<Rarely>()
        .with::<Join>()
        .with::<Look>()
        .with::<Wide>()
        .with::<Pair>()
        .with::<Raise>()
}

// 13x5: rows of textures need padding, the last workgroups stick out.
const SIZE: [u32; 2] = [13, 5];

fn graph(sides: [&str; 3]) -> GraphFile {
    let on = sides.map(|side| format!("on: {side},"));
    let text = format!(
        r#"#![enable(implicit_some)]
        Graph(version: 1, nodes: {{
            "ramp": (kind: "ramp", {}),
            "mix": (kind: "mix", {} inputs: {{ "now": "bump.list", "before": "other.ramp" }}, params: (weight: 3)),
            "bump": (kind: "bump", {} inputs: {{ "list": "ramp.ramp" }}),
            "other": (kind: "ramp"),
        }}, outputs: {{ "image": "mix.sum" }})"#,
        on[0], on[1], on[2]
    );
    GraphFile::parse("test.ron", &text).unwrap()
}

fn executor(file: &GraphFile, settings: &Settings) -> Executor {
    let registry = registry();
    let (graph, plan) = compile(file, &registry, settings).unwrap_or_else(|problems| panic!("{problems}"));
    Executor::new(graph, plan, settings, &registry, Some(gpu())).unwrap_or_else(|error| panic!("{error}"))
}

fn frame(index: u32) -> Frame {
    Frame { size: SIZE, index, ..Frame::default() }
}

fn run(file: &GraphFile, settings: &Settings, frames: u32) -> Vec<Vec<u32>> {
    let mut executor = executor(file, settings);
    (0..frames)
        .map(|index| {
            executor.run(&frame(index), &Host::default(), true).unwrap();
            executor.snapshot("image", "").unwrap().unwrap().get::<u32>()
        })
        .collect()
}

fn expected(frames: u32) -> Vec<Vec<u32>> {
    let pixels = SIZE[0] * SIZE[1];
    (0..frames)
        .map(|frame| {
            let before = |pixel: u32| if frame == 0 { 0 } else { pixel + 1000 * frame };
            (0..pixels).map(|pixel| pixel + 1000 * (frame + 1) + 1 + 3 * before(pixel)).collect()
        })
        .collect()
}

#[test]
fn every_placement_gives_the_same() {
    let mut settings = Settings::new(SIZE, 0, Facts::none());
    for poison in [false, true] {
        for pooling in [true, false] {
            for default in [Side::Cpu, Side::Gpu] {
                settings.poison = poison;
                settings.pooling = pooling;
                settings.side = default;
                for bits in 0..8 {
                    let sides = [0, 1, 2].map(|bit| if bits >> bit & 1 == 0 { "Cpu" } else { "Gpu" });
                    let result = run(&graph(sides), &settings, 4);
                    assert_eq!(result, expected(4), "sides {sides:?}, default {default}, {poison} {pooling}");
                }
            }
        }
    }
}

#[test]
fn the_comparison_can_fail() {
    let mut file = graph(["Cpu", "Gpu", "Cpu"]);
    file.set_param("mix", "weight", "4").unwrap();
    assert_ne!(run(&file, &Settings::new(SIZE, 0, Facts::none()), 4), expected(4));
}

#[test]
fn what_has_not_changed_is_not_uploaded_again() {
    let text = r#"Graph(version: 1, nodes: {
        "rarely": (kind: "rarely"),
        "mix": (kind: "mix", on: Gpu, inputs: { "now": "rarely.numbers", "before": "ramp.ramp" }, params: (weight: 0)),
        "ramp": (kind: "ramp", on: Gpu),
    }, outputs: { "image": "mix.sum" })"#;
    let file = GraphFile::parse("rarely.ron", text).unwrap();
    let seen: Vec<u32> =
        run(&file, &Settings::new(SIZE, 0, Facts::none()), 6).iter().map(|image| image[7]).collect();
    // The first frame uploads whatever there is.
    assert_eq!(seen, [99, 1, 1, 1, 4, 4]);
}

/// `rarely`, whose numbers change in frames 1 and 4, and what looks at them; `more` nodes, one of which writes `image`.
fn looking(sides: [&str; 2], more: &str, image: &str) -> GraphFile {
    let [first, second] = sides;
    let text = format!(
        r#"#![enable(implicit_some)]
        Graph(version: 1, nodes: {{
            "rarely": (kind: "rarely"),
            "look": (kind: "look", on: {first}, inputs: {{ "input": "rarely.numbers" }}),
            "again": (kind: "look", on: {second}, inputs: {{ "input": "look.output" }}),
            {more}
        }}, outputs: {{ "image": "{image}" }})"#
    );
    GraphFile::parse("looking.ron", &text).unwrap()
}

/// The eye's place in each frame: it stands, goes, stands elsewhere, comes back.
const WALK: [f32; 10] = [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 2.0, 2.0, 0.0];

/// Walks; gives for each frame the names of the nodes that ran and an element of the image.
fn walk(executor: &mut Executor) -> Vec<(Vec<String>, u32)> {
    let frames = WALK.iter().enumerate().map(|(index, &x)| {
        let mut frame = frame(index as u32);
        frame.view.eye[0] = x;
        executor.run(&frame, &Host::default(), true).unwrap();
        let nodes = executor.plan().nodes.iter().zip(executor.ran());
        let ran = nodes.filter(|(_, ran)| **ran).map(|(node, _)| node.name.clone()).collect();
        (ran, executor.snapshot("image", "").unwrap().unwrap().get::<u32>()[7])
    });
    frames.collect()
}

const SIDES: [[&str; 2]; 4] = [["Cpu", "Cpu"], ["Gpu", "Gpu"], ["Cpu", "Gpu"], ["Gpu", "Cpu"]];

#[test]
fn stages_of_the_view_run_only_when_it_or_their_inputs_change() {
    for sides in SIDES {
        for poison in [false, true] {
            let settings = Settings { poison, ..Settings::new(SIZE, 0, Facts::none()) };
            let mut executor = executor(&looking(sides, "", "again.output"), &settings);
            for (frame, (ran, value)) in walk(&mut executor).into_iter().enumerate() {
                // The input changes in frames 1 and 4, the view from 6 on; the first frame has to run anyway.
                let last = [0, 1, 1, 1, 4, 4, 6, 7, 7, 9][frame];
                let expected: &[&str] =
                    if last == frame { &["rarely", "look", "again"] } else { &["rarely"] };
                assert_eq!(ran, expected, "{sides:?}, frame {frame}");
                assert_eq!(value / 1000, 2 * last as u32, "{sides:?}, frame {frame}");
            }
        }
    }
}

#[test]
fn what_seldom_changes_wakes_those_whose_outputs_are_then_read() {
    for side in ["Cpu", "Gpu"] {
        let text = |declares: bool, more: &str| {
            format!(
                r#"#![enable(implicit_some)]
                Graph(version: 1, nodes: {{
                    "often": (kind: "seldom", params: (ahead: 2, declares: false)),
                    "see": (kind: "see", on: {side}, inputs: {{ "input": "often.numbers" }}),
                    "seldom": (kind: "seldom", params: (declares: {declares})),
                    "join": (kind: "join", on: {side}, inputs: {{ "one": "see.output", "other": "seldom.numbers" }}),
                    "other": (kind: "see", on: {side}, inputs: {{ "input": "often.numbers" }}),
                }}, outputs: {{ "image": "join.output", "other": "other.output"{more} }})"#
            )
        };
        let start = |declares, prune, more| {
            let file = GraphFile::parse("wakes.ron", &text(declares, more)).unwrap();
            let settings = Settings { prune, poison: true, ..Settings::new(SIZE, 0, Facts::none()) };
            executor(&file, &settings)
        };
        let [mut whole, mut keeps, mut wakes, mut shown] = [
            (true, false, ""),
            (false, true, ""),
            (true, true, ""),
            // An output is kept anyway, so that nothing need wake its writer.
            (true, true, r#", "seen": "see.output""#),
        ]
        .map(|(declares, prune, more)| start(declares, prune, more));
        let life = |executor: &Executor| {
            let mut storages = executor.plan().storages.iter();
            storages.find(|storage| storage.name == "see.output").unwrap().life
        };
        let lives = [&keeps, &wakes, &shown].map(life);
        assert_eq!(lives, [Life::Persistent, Life::Transient, Life::Persistent]);
        for index in 0..15 {
            let run = |executor: &mut Executor| {
                executor.run(&frame(index), &Host::default(), true).unwrap();
                let see = executor.graph().node("see").unwrap();
                (executor.ran()[see], executor.snapshot("image", "").unwrap().unwrap().get::<u32>())
            };
            let [(_, expected), kept, woken, shown] =
                [&mut whole, &mut keeps, &mut wakes, &mut shown].map(run);
            assert_eq!([&kept.1, &woken.1, &shown.1], [&expected; 3], "{side}, frame {index}");
            let changes = |ahead: u32| index == 0 || ![1, 2].contains(&((index + ahead) * 7 % 5));
            let ran = [changes(2), changes(2) || changes(0), changes(2)];
            assert_eq!([kept.0, woken.0, shown.0], ran, "{side}, frame {index}");
        }
    }
}

#[test]
fn only_the_elements_that_changed_are_uploaded() {
    // The node that fails runs before the upload, or after it.
    for after in ["ramp.ramp", "look.output"] {
        let text = format!(
            r#"#![enable(implicit_some)]
            Graph(version: 1, nodes: {{
                "few": (kind: "few"),
                "ramp": (kind: "ramp"),
                "stumble": (kind: "stumble", on: Cpu, inputs: {{ "list": "ramp.ramp", "after": "{after}" }},
                    params: (at: 3)),
                "look": (kind: "look", on: Gpu, inputs: {{ "input": "few.numbers" }}),
            }}, outputs: {{ "image": "look.output", "other": "stumble.list" }})"#
        );
        let file = GraphFile::parse("few.ron", &text).unwrap();
        let mut executor = executor(&file, &Settings::new(SIZE, 0, Facts::none()));
        let upload = executor.plan().steps.iter().position(|step| matches!(step, Step::Upload(_))).unwrap();
        for index in 0..5 {
            let failed = executor.run(&frame(index), &Host::default(), true).is_err();
            assert_eq!(failed, index == 3);
            if failed {
                continue;
            }
            let seen = executor.snapshot("image", "").unwrap().unwrap().get::<u32>();
            let seen: Vec<u32> = seen.iter().map(|value| value % 1000).collect();
            // All of it at first, and after a frame that failed, when the GPU may hold anything.
            let all = index == 0 || index == 4;
            let pixels = u64::from(SIZE[0] * SIZE[1]);
            let moved = [4 * pixels, 12, 4, 0, 4 * pixels][index as usize];
            assert_eq!(executor.moved()[upload], moved, "frame {index}");
            let ninth = if all { index + 1 } else { 1 };
            let now = index + 1;
            let two = if index == 2 { index } else { now };
            assert_eq!(seen[..11], [0, 0, 0, now, 0, two, two, 0, 0, ninth, 0], "frame {index}");
        }
    }
}

#[test]
fn unpruned_every_node_runs_in_every_frame() {
    for sides in SIDES {
        let settings = Settings { prune: false, ..Settings::new(SIZE, 0, Facts::none()) };
        let mut executor = executor(&looking(sides, "", "again.output"), &settings);
        assert!(executor.plan().nodes.iter().all(|node| node.runs == Runs::Always));
        for (frame, (ran, value)) in walk(&mut executor).into_iter().enumerate() {
            assert_eq!(ran, ["rarely", "look", "again"], "{sides:?}, frame {frame}");
            assert_eq!(value / 1000, 2 * frame as u32, "{sides:?}, frame {frame}");
        }
    }
}

#[test]
fn what_is_changed_in_place_is_made_again_in_every_frame() {
    for sides in SIDES {
        for on in ["Cpu", "Gpu"] {
            let bump = format!(r#""bump": (kind: "bump", on: {on}, inputs: {{ "list": "again.output" }}),"#);
            let mut executor =
                executor(&looking(sides, &bump, "bump.list"), &Settings::new(SIZE, 0, Facts::none()));
            for (frame, (ran, value)) in walk(&mut executor).into_iter().enumerate() {
                let last = [0, 1, 1, 1, 4, 4, 6, 7, 7, 9][frame];
                assert!(ran.contains(&"again".into()), "{sides:?}, {on}, frame {frame}");
                assert_eq!(value / 1000, (last + frame) as u32, "{sides:?}, {on}, frame {frame}");
                // One of the input's numbers (99 is a lie of its writer's) and one more, never two.
                assert!([100, 2, 5, 8].contains(&(value % 1000)), "{sides:?}, {on}, frame {frame}: {value}");
            }
        }
    }
}

#[test]
fn a_stage_of_the_view_whose_last_output_is_read_fills_both_slots() {
    for sides in SIDES {
        for on in ["Cpu", "Gpu"] {
            let mix = format!(
                r#""mix": (kind: "mix", on: {on}, inputs: {{ "now": "again.output", "before": "look.output" }},
                    params: (weight: 0)),"#
            );
            let settings = Settings::new(SIZE, 0, Facts::none());
            let mut executor = executor(&looking(sides, &mix, "mix.sum"), &settings);
            for (frame, (ran, _)) in walk(&mut executor).into_iter().enumerate() {
                let last = [0, 1, 1, 1, 4, 4, 6, 7, 7, 9][frame];
                assert_eq!(ran.contains(&"again".into()), frame == last, "{sides:?}, {on}, frame {frame}");
                let looked = frame == last || frame == last + 1;
                assert_eq!(ran.contains(&"look".into()), looked, "{sides:?}, {on}, frame {frame}");
            }
        }
    }
}

#[test]
fn what_changes_in_place_with_its_writer_is_skipped_with_it() {
    // The second graph reads in between what is changed later, by a node that is skipped in the same frames.
    let between = r#""see": (kind: "see", inputs: { "input": "again.output" }),"#;
    for (more, image) in [("", "top.list"), (between, "see.output")] {
        for (sides, on) in SIDES.iter().flat_map(|sides| ["Cpu", "Gpu"].map(|on| (*sides, on))) {
            for poison in [false, true] {
                let mut settings = Settings { poison, ..Settings::new(SIZE, 0, Facts::none()) };
                settings.taps = vec!["top.list".parse().unwrap()];
                let lift = |name: &str, list: &str| {
                    format!(r#""{name}": (kind: "lift", on: {on}, inputs: {{ "list": "{list}" }}),"#)
                };
                let more = format!("{more} {} {}", lift("up", "again.output"), lift("top", "up.list"));
                let mut executor = executor(&looking(sides, &more, image), &settings);
                for (frame, (ran, value)) in walk(&mut executor).into_iter().enumerate() {
                    let what = format!("{sides:?}, {on}, {image}, poison {poison}, frame {frame}");
                    let last = [0, 1, 1, 1, 4, 4, 6, 7, 7, 9][frame];
                    let runs = |name: &str| ran.contains(&name.into());
                    assert_eq!(runs("look"), frame == last, "{what}");
                    // The other side has its own copy to change.
                    let together = on == sides[1];
                    assert_eq!(runs("again"), frame == last || !together, "{what}");
                    assert_eq!(runs("up"), frame == last || !together, "{what}");
                    let again = if together { last } else { frame };
                    // On the CPU, `look` sees the lie of `rarely` when it runs for the view's sake.
                    let lie = |seen| if sides[0] == "Cpu" { 99 } else { seen };
                    let number = [99, 1, 1, 1, 4, 4, lie(4), 7, 7, lie(7)][frame];
                    let looked = 1000 * (last + again) as u32 + number;
                    let eye = WALK[frame] as u32;
                    let expected = if image == "top.list" { looked + 2 } else { 2 * looked + eye };
                    assert_eq!(value, expected, "{what}");
                }
            }
        }
    }
}

#[test]
fn a_recompiled_stage_of_the_view_runs_at_first() {
    for (from, to) in SIDES.into_iter().zip(SIDES.into_iter().rev()) {
        let [mut old, mut new] = [from, to].map(|sides| {
            executor(&looking(sides, "", "again.output"), &Settings::new(SIZE, 0, Facts::none()))
        });
        let run = |executor: &mut Executor, index, expected| {
            executor.run(&frame(index), &Host::default(), true).unwrap();
            assert_eq!(executor.ran().as_raw_slice(), [true, expected, expected], "frame {index}");
            executor.snapshot("image", "").unwrap().unwrap().get::<u32>()[7] / 1000
        };
        assert_eq!(run(&mut old, 2, true), 4);
        assert_eq!(run(&mut old, 3, false), 4);
        new.inherit(&mut old).unwrap();
        assert_eq!(run(&mut new, 5, true), 10);
        assert_eq!(run(&mut new, 6, false), 10);
        // One that runs already takes over what another has: that may be anything.
        new.inherit(&mut old).unwrap();
        assert_eq!(run(&mut new, 8, true), 16);
    }
}

#[test]
fn late_downloads_are_exactly_that_late() {
    let text = r#"Graph(version: 1, nodes: {
        "ramp": (kind: "ramp", on: Gpu),
        "bump": (kind: "bump", on: Cpu, download: Latent(2), inputs: { "list": "ramp.ramp" }),
    }, outputs: { "image": "bump.list" })"#;
    let file = GraphFile::parse("late.ron", text).unwrap();
    let seen: Vec<u32> =
        run(&file, &Settings::new(SIZE, 0, Facts::none()), 6).iter().map(|image| image[7]).collect();
    assert_eq!(seen[2..], [1008, 2008, 3008, 4008]);

    // What was under way comes on time in a graph that was compiled anew, and in one after that; and the one before can
    // go on if its successor fails.
    let mut executors = [0, 1, 2].map(|_| executor(&file, &Settings::new(SIZE, 0, Facts::none())));
    let mut seen = Vec::new();
    let mut run = |executor: &mut Executor, index| {
        executor.run(&frame(index), &Host::default(), true).unwrap();
        seen.push(executor.snapshot("image", "").unwrap().unwrap().get::<u32>()[7]);
    };
    let [first, second, third] = &mut executors;
    (0..4).for_each(|index| run(first, index));
    second.inherit(first).unwrap();
    (4..7).for_each(|index| run(second, index));
    third.inherit(second).unwrap();
    (7..9).for_each(|index| run(third, index));
    (4..8).for_each(|index| run(first, index));
    assert_eq!(seen[2..9], [1008, 2008, 3008, 4008, 5008, 6008, 7008]);
    assert_eq!(seen[11..], [5008, 6008]);
}

#[test]
fn what_is_not_yet_there_is_zero_although_others_use_its_memory() {
    let text = r#"Graph(version: 1, nodes: {
        "own": (kind: "ramp", on: Cpu),
        "copy": (kind: "look", on: Cpu, inputs: { "input": "own.ramp" }),
        "ramp": (kind: "ramp", on: Gpu),
        "bump": (kind: "bump", on: Cpu, download: Latent(2), inputs: { "list": "ramp.ramp" }),
    }, outputs: { "image": "bump.list", "copy": "copy.output" })"#;
    let file = GraphFile::parse("late.ron", text).unwrap();
    let mut executor = executor(&file, &Settings::new(SIZE, 0, Facts::none()));
    let slot = |name: &str| {
        let storage = executor.plan().storages.iter().find(|storage| storage.name == name).unwrap();
        storage.slots.cpu.unwrap()
    };
    assert_eq!(slot("own.ramp"), slot("ramp.ramp"));
    let seen = [0, 1, 2, 3].map(|index| {
        executor.run(&frame(index), &Host::default(), true).unwrap();
        executor.snapshot("image", "").unwrap().unwrap().get::<u32>()[7]
    });
    assert_eq!(seen, [1, 1, 1008, 2008]);
}

#[test]
fn late_downloads_of_what_does_not_change_come_again_only_if_the_cpu_changes_its_copy() {
    let all = 4 * u64::from(SIZE[0] * SIZE[1]);
    for (node, port, number, again) in [
        (r#"kind: "look", inputs: { "input": "still.numbers" }"#, "output", 70, 0),
        (r#"kind: "bump", inputs: { "list": "still.numbers" }"#, "list", 71, all),
        // What the GPU changes is as it was, too.
        (r#"kind: "look", inputs: { "input": "lift.list" }"#, "output", 71, 0),
    ] {
        let lift = r#""lift": (kind: "lift", on: Gpu, inputs: { "list": "still.numbers" }),"#;
        let lift = if node.contains("lift") { lift } else { "" };
        let text = format!(
            r#"#![enable(implicit_some)]
            Graph(version: 1, nodes: {{
                "still": (kind: "still", on: Gpu),
                {lift}
                "last": ({node}, on: Cpu, download: Latent(1)),
            }}, outputs: {{ "image": "last.{port}" }})"#
        );
        let mut executor =
            executor(&GraphFile::parse("still.ron", &text).unwrap(), &Settings::new(SIZE, 0, Facts::none()));
        for index in 0..6 {
            executor.run(&frame(index), &Host::default(), true).unwrap();
            let seen = executor.snapshot("image", "").unwrap().unwrap().get::<u32>()[7];
            let mut steps = executor.plan().steps.iter().zip(executor.moved());
            let (_, moved) = steps.find(|(step, _)| matches!(step, Step::Download(..))).unwrap();
            if index > 1 {
                assert_eq!((seen % 1000, *moved), (number, again), "{node}, frame {index}");
            }
        }
    }
}

#[test]
fn steps_are_timed_in_milliseconds_since_the_frame_began() {
    let text = r#"Graph(version: 1, nodes: {
        "first": (kind: "slow"),
        "second": (kind: "slow", inputs: { "after": "first.nothing" }),
    }, outputs: { "image": "second.nothing" })"#;
    let file = GraphFile::parse("slow.ron", text).unwrap();
    let mut executor = executor(&file, &Settings::new(SIZE, 0, Facts::none()));
    for index in 0..2 {
        let start = Instant::now();
        executor.run(&frame(index), &Host::default(), false).unwrap();
        let took = start.elapsed().as_secs_f32() * 1000.0;
        let (starts, times) = (executor.starts(), executor.times());
        assert!(times[..2].iter().all(|time| *time >= 20.0), "{times:?}");
        assert!(0.0 <= starts[0] && starts[1] >= starts[0] + times[0] - 0.01, "{starts:?} {times:?}");
        assert!(starts[1] + times[1] <= took, "{starts:?} {times:?} of {took} ms");
    }
    // What is not measured keeps its times.
    executor.profile = false;
    let before = [executor.starts().to_vec(), executor.times().to_vec()];
    executor.run(&frame(2), &Host::default(), false).unwrap();
    assert_eq!([executor.starts(), executor.times()], [&before[0][..], &before[1]]);
}

#[test]
fn each_step_tells_what_it_moved() {
    let text = r#"#![enable(implicit_some)]
        Graph(version: 1, nodes: {
            "rarely": (kind: "rarely"),
            "look": (kind: "look", on: Gpu, inputs: { "input": "rarely.numbers" }),
            "bump": (kind: "bump", on: Cpu, inputs: { "list": "look.output" }),
            "late": (kind: "look", on: Cpu, download: Latent(2), inputs: { "input": "ramp.ramp" }),
            "ramp": (kind: "ramp", on: Gpu),
        }, outputs: { "image": "bump.list", "late": "late.output" })"#;
    let file = GraphFile::parse("moved.ron", text).unwrap();
    let mut executor = executor(&file, &Settings::new(SIZE, 0, Facts::none()));
    let all = 4 * u64::from(SIZE[0] * SIZE[1]);
    for index in 0..6 {
        executor.run(&frame(index), &Host::default(), true).unwrap();
        for (step, moved) in executor.plan().steps.iter().zip(executor.moved()) {
            let name = executor.plan().step_name(step);
            let expected = match step {
                // The numbers change in frames 1 and 4.
                Step::Upload(_) => all * u64::from([0, 1, 4].contains(&index)),
                Step::Download(..) => all,
                Step::Run(_) | Step::Tap { .. } => 0,
            };
            assert_eq!(*moved, expected, "{name}, frame {index}");
        }
    }
}

/// A random graph of lists; `on` says where its nodes run. The names of its outputs begin with `o`.
fn random_graph(random: &mut Random, on: impl Fn(usize) -> &'static str) -> String {
    let mut nodes = vec![
        (String::from(r#"kind: "ramp""#), "ramp", true),
        (String::from(r#"kind: "seldom""#), "numbers", false),
        (String::from(r#"kind: "seldom", params: (ahead: 2, declares: false)"#), "numbers", false),
    ];
    for _ in 0..3 + random.below(5) {
        let mut list = |nodes: &Vec<(String, &str, bool)>| {
            let [a, b] = [0, 1].map(|_| random.below(nodes.len() as u32) as usize);
            let (node, port) = (a.max(b), nodes[a.max(b)].1);
            format!("n{node}.{port}")
        };
        let (one, other) = (list(&nodes), list(&nodes));
        match random.below(6) {
            0 => nodes.push((format!(r#"kind: "bump", inputs: {{ "list": {one:?} }}"#), "list", true)),
            4 | 5 => {
                let inputs = format!(r#"inputs: {{ "one": {one:?}, "other": {other:?} }}"#);
                nodes.push((format!(r#"kind: "join", {inputs}"#), "output", true));
            }
            1 | 2 => nodes.push((format!(r#"kind: "see", inputs: {{ "input": {one:?} }}"#), "output", true)),
            _ => {
                let weight = random.below(4);
                let inputs = format!(r#"inputs: {{ "now": {one:?}, "before": {other:?} }}"#);
                let mix = format!(r#"kind: "mix", {inputs}, params: (weight: {weight})"#);
                let texture = format!(r#"kind: "unpack", inputs: {{ "texture": "n{}.sum" }}"#, nodes.len());
                nodes.extend([(mix, "", true), (texture, "list", true)]);
                // Lists only may be read from now on.
                let last = nodes.len() - 1;
                nodes[last - 1].1 = nodes[last].1;
            }
        }
    }
    let mut text = "#![enable(implicit_some)]\nGraph(version: 1, nodes: {\n".to_owned();
    for (index, (node, _, has_shader)) in nodes.iter().enumerate() {
        let on = if *has_shader { on(index) } else { "Cpu" };
        text += &format!("\"n{index}\": (on: {on}, {node}),\n");
    }
    let outputs = (0..3).map(|index| {
        let node = nodes.len() - 1 - random.below(nodes.len().min(4) as u32) as usize;
        format!("\"o{index}\": \"n{node}.{}\"", nodes[node].1)
    });
    let outputs: Vec<String> = outputs.collect();
    text + &format!("}}, outputs: {{ {} }})", outputs.join(", "))
}

#[test]
fn random_graphs_give_the_same_on_any_sides_skipped_pooled_and_recompiled() {
    let mut random = Random(5);
    let (mut rounds, mut skipped) = (0, 0);
    while rounds < 80 {
        let seed = random.0;
        // The same graph with other placements: the first is the reference, all on the CPU with nothing left out.
        let mut place = Random(random.bits().into());
        let placed: Vec<Vec<bool>> = (0..3).map(|_| (0..20).map(|_| place.below(2) == 0).collect()).collect();
        let text = |which: Option<usize>| {
            let on = |node: usize| match which {
                Some(which) if placed[which][node] => "Gpu",
                _ => "Cpu",
            };
            random_graph(&mut Random(seed), on)
        };
        random_graph(&mut random, |_| "Cpu");
        let mut settings = Settings::new(SIZE, 0, Facts::none());
        (settings.prune, settings.pooling) = (false, false);
        let file = |which| GraphFile::parse("random.ron", &text(which)).unwrap();
        // Some lists are changed in place twice, or have no value of the frame before.
        if compile(&file(None), &registry(), &settings).is_err() {
            continue;
        }
        rounds += 1;
        let mut reference = executor(&file(None), &settings);
        let mut tested = |which: usize| {
            let settings = Settings {
                poison: random.below(2) == 0,
                pooling: random.below(4) > 0,
                ..Settings::new(SIZE, 0, Facts::none())
            };
            executor(&file(Some(which)), &settings)
        };
        let (mut current, mut next) = (tested(0), vec![tested(2), tested(1)]);
        let mut eye = 0.0;
        for index in 0..9 {
            // Two compiled anew take over, one after the other.
            if index % 3 == 2
                && let Some(mut new) = next.pop()
            {
                new.inherit(&mut current).unwrap();
                current = new;
            }
            if place.below(3) == 0 {
                eye = place.below(100) as f32;
            }
            let mut frame = frame(index);
            frame.view.eye[0] = eye;
            for executor in [&mut reference, &mut current] {
                executor.run(&frame, &Host::default(), true).unwrap();
            }
            skipped += current.ran().iter().filter(|ran| !**ran).count();
            for output in ["o0", "o1", "o2"] {
                let [expected, found] = [&mut reference, &mut current]
                    .map(|executor| executor.snapshot(output, "").unwrap().unwrap().get::<u32>());
                assert_eq!(found, expected, "{output}, frame {index}, {}", text(Some(0)));
            }
        }
    }
    assert!(skipped > 120, "{skipped} nodes were skipped");
}

#[test]
fn random_graphs_get_the_same_late_whether_nodes_are_skipped_or_not() {
    let mut random = Random(11);
    let (mut rounds, mut skipped) = (0, 0);
    while rounds < 40 {
        let seed = random.0;
        let mut place = Random(random.bits().into());
        let sides: Vec<&str> = (0..20)
            .map(|_| {
                ["Cpu", "Gpu", "Cpu, download: Latent(1)", "Cpu, download: Latent(3)"]
                    [place.below(4) as usize]
            })
            .collect();
        let text = random_graph(&mut Random(seed), |node| sides[node]);
        random_graph(&mut random, |_| "Cpu");
        let mut settings = Settings::new(SIZE, 0, Facts::none());
        (settings.prune, settings.pooling) = (false, false);
        let Ok(file) = GraphFile::parse("late.ron", &text) else { panic!("{text}") };
        if compile(&file, &registry(), &settings).is_err() {
            continue;
        }
        rounds += 1;
        let mut reference = executor(&file, &settings);
        let mut tested = executor(&file, &Settings::new(SIZE, 0, Facts::none()));
        let mut eye = 0.0;
        for index in 0..30 {
            if place.below(5) == 0 {
                eye = place.below(100) as f32;
            }
            let mut frame = frame(index);
            frame.view.eye[0] = eye;
            for executor in [&mut reference, &mut tested] {
                executor.run(&frame, &Host::default(), true).unwrap();
            }
            skipped += tested.ran().iter().filter(|ran| !**ran).count();
            // What is not there yet may be anything.
            if index < 16 {
                continue;
            }
            for output in ["o0", "o1", "o2"] {
                let [expected, found] = [&mut reference, &mut tested]
                    .map(|executor| executor.snapshot(output, "").unwrap().unwrap().get::<u32>());
                assert_eq!(found, expected, "{output}, frame {index}, {text}");
            }
        }
    }
    assert!(skipped > 100, "{skipped} nodes were skipped");
}

#[test]
fn downloads_under_way_are_taken_over_by_name_and_size() {
    let text = r#"Graph(version: 1, nodes: {
        "ramp": (kind: "ramp", on: Gpu),
        "other": (kind: "ramp", on: Gpu),
        "bump": (kind: "bump", on: Gpu, inputs: { "list": "other.ramp" }),
        "one": (kind: "bump", on: Cpu, download: Latent(2), inputs: { "list": "ramp.ramp" }),
        "two": (kind: "bump", on: Cpu, download: Latent(2), inputs: { "list": "bump.list" }),
    }, outputs: { "image": "one.list", "other": "two.list" })"#;
    let file = GraphFile::parse("late.ron", text).unwrap();
    let start = |size| executor(&file, &Settings::new(size, 0, Facts::none()));
    let run = |executor: &mut Executor, size: [u32; 2], index: u32| {
        let frame = Frame { size, index, ..Frame::default() };
        executor.run(&frame, &Host::default(), true).unwrap();
        ["image", "other"].map(|name| {
            let image = executor.snapshot(name, "").unwrap().unwrap().get::<u32>();
            assert_eq!(image.len(), (size[0] * size[1]) as usize);
            image[7]
        })
    };
    let mut old = start(SIZE);
    for index in 0..3 {
        run(&mut old, SIZE, index);
    }
    // Another size has lists of its own: it begins like one that takes over nothing.
    let mut larger = start([16, 9]);
    larger.inherit(&mut old).unwrap();
    let mut fresh = start([16, 9]);
    for index in 0..4 {
        let [taken, own] = [&mut larger, &mut fresh].map(|executor| run(executor, [16, 9], index));
        // What the list keeps is one number, which has no size.
        let later = if index < 2 { 0 } else { 3000 };
        assert_eq!(taken, own.map(|value| if value < 1000 { value } else { value + later }), "frame {index}");
    }
    let mut same = start(SIZE);
    same.inherit(&mut old).unwrap();
    assert_eq!([3, 4].map(|index| run(&mut same, SIZE, index)), [[2008, 2009], [3008, 3009]]);
}

#[test]
fn an_all_gpu_frame_has_no_transfers_and_pools() {
    let mut settings = Settings::new(SIZE, 0, Facts::none());
    settings.side = Side::Gpu;
    let file = graph(["Gpu", "Gpu", "Gpu"]);
    let (_, plan) = compile(&file, &registry(), &settings).unwrap();
    assert!(plan.steps.iter().all(|step| matches!(step, Step::Run(_) | Step::Tap { .. })));
    settings.pooling = false;
    let (_, unpooled) = compile(&file, &registry(), &settings).unwrap();
    assert!(plan.bytes(Side::Gpu) <= unpooled.bytes(Side::Gpu));
    assert_eq!(plan.bytes(Side::Cpu), 0);
}

#[test]
fn last_frames_texture_survives_a_recompile_and_a_change_of_side() {
    let start = |on: &str| {
        let text = format!(
            r#"#![enable(implicit_some)]
            Graph(version: 1, nodes: {{
                "trail": (kind: "trail", on: {on}, inputs: {{ "before": "trail.steps" }}),
            }}, outputs: {{ "image": "trail.steps" }})"#
        );
        let file = GraphFile::parse("trail.ron", &text).unwrap();
        executor(&file, &Settings::new(SIZE, 0, Facts::none()))
    };
    for (from, to) in [("Cpu", "Cpu"), ("Cpu", "Gpu"), ("Gpu", "Cpu"), ("Gpu", "Gpu")] {
        let mut old = start(from);
        for index in 0..3 {
            old.run(&frame(index), &Host::default(), false).unwrap();
        }
        let mut new = start(to);
        new.inherit(&mut old).unwrap();
        new.run(&frame(3), &Host::default(), true).unwrap();
        let steps = new.snapshot("image", "").unwrap().unwrap().get::<u32>();
        let expected: Vec<u32> = (0..SIZE[0] * SIZE[1]).map(|pixel| 4 * (pixel + 1)).collect();
        assert_eq!(steps, expected, "{from} to {to}");
    }
}

#[test]
fn kept_memory_survives_a_recompile_and_a_change_of_side() {
    let sides = [["Cpu", "Cpu", "Cpu"], ["Gpu", "Gpu", "Gpu"]];
    for (from, to) in [(0, 0), (0, 1), (1, 0), (1, 1)] {
        let mut settings = Settings::new(SIZE, 0, Facts::none());
        settings.side = if from == 0 { Side::Cpu } else { Side::Gpu };
        let mut old = executor(&graph(sides[from]), &settings);
        for index in 0..3 {
            old.run(&frame(index), &Host::default(), false).unwrap();
        }
        settings.side = if to == 0 { Side::Cpu } else { Side::Gpu };
        let mut new = executor(&graph(sides[to]), &settings);
        new.inherit(&mut old).unwrap();
        new.run(&frame(3), &Host::default(), true).unwrap();
        let image = new.snapshot("image", "").unwrap().unwrap().get::<u32>();
        assert_eq!(image, expected(4)[3], "{from} to {to}");
    }
}

#[test]
fn taps_see_a_port_after_its_node_even_if_it_changes_later() {
    let mut settings = Settings::new(SIZE, 0, Facts::none());
    settings.taps = vec![Source { node: "ramp".into(), port: "ramp".into() }];
    for side in ["Cpu", "Gpu"] {
        let mut executor = executor(&graph([side, side, side]), &settings);
        executor.run(&frame(0), &Host::default(), true).unwrap();
        let tapped = executor.snapshot("ramp.ramp", "").unwrap().unwrap().get::<u32>();
        assert_eq!(tapped[..3], [1000, 1001, 1002], "on {side}");
    }
}

#[test]
fn only_what_is_wanted_is_captured() {
    let mut settings = Settings::new(SIZE, 0, Facts::none());
    settings.taps = vec![Source { node: "ramp".into(), port: "ramp".into() }];
    for side in ["Cpu", "Gpu"] {
        let mut executor = executor(&graph([side, side, side]), &settings);
        let captured = |executor: &mut Executor, index: u32| {
            executor.run(&frame(index), &Host::default(), true).unwrap();
            let of = |snapshot: &Snapshot| (snapshot.name.clone(), snapshot.frame);
            executor.snapshots().unwrap().into_iter().map(of).collect::<Vec<_>>()
        };
        let all = |index| vec![("ramp.ramp".to_owned(), index), ("image".to_owned(), index)];
        let mut first = captured(&mut executor, 0);
        first.sort_by(|a, b| b.0.cmp(&a.0));
        assert_eq!(first, all(0), "on {side}");
        executor.want(|name| name == "image");
        assert_eq!(captured(&mut executor, 1), all(1)[1..], "on {side}");
        executor.want(|_| false);
        assert_eq!(captured(&mut executor, 2), [], "on {side}");
        executor.want(|name| name == "ramp.ramp");
        assert_eq!(captured(&mut executor, 3), all(3)[..1], "on {side}");
    }
}

#[test]
fn taps_read_the_fields_that_their_node_does_not_use_where_they_are() {
    for sides in [["Cpu", "Cpu"], ["Cpu", "Gpu"], ["Gpu", "Cpu"], ["Gpu", "Gpu"]] {
        let text = format!(
            r#"#![enable(implicit_some)]
            Graph(version: 1, nodes: {{
                "pair": (kind: "pair", on: {}),
                "raise": (kind: "raise", on: {}, inputs: {{ "pair": "pair.pair" }}),
            }}, outputs: {{ "raised": "raise.pair" }})"#,
            sides[0], sides[1]
        );
        let settings = Settings { poison: true, ..Settings::new(SIZE, 0, Facts::none()) };
        let mut executor = executor(&GraphFile::parse("test.ron", &text).unwrap(), &settings);
        for index in 0..2 {
            executor.run(&frame(index), &Host::default(), true).unwrap();
            for (field, expected) in [("low", 1), ("high", 12)] {
                let found = executor.snapshot("raised", field).unwrap().unwrap().get::<u32>();
                assert_eq!(found, [expected; 65], "{field}, frame {index}, {sides:?}");
            }
        }
    }
}

#[test]
fn failing_and_panicking_stages_come_back_as_errors() {
    for panic in [false, true] {
        let text = format!(
            r#"Graph(version: 1, nodes: {{ "bad": (kind: "faulty", params: (panic: {panic})) }},
            outputs: {{ "image": "bad.nothing" }})"#
        );
        let file = GraphFile::parse("bad.ron", &text).unwrap();
        let mut executor = executor(&file, &Settings::new(SIZE, 0, Facts::none()));
        let error = executor.run(&frame(0), &Host::default(), false).unwrap_err();
        let wanted = if panic { "as asked" } else { "cannot go on" };
        assert!(matches!(&error, RunError::Stage { node, .. } if node == "bad"), "{error}");
        assert!(error.to_string().contains(wanted), "{error}");
    }
}

/// Runs frames until one fails, which must be frame `at`; that one is not counted.
fn run_failing(executor: &mut Executor, at: u32) {
    for index in 0..at {
        executor.run(&frame(index), &Host::default(), true).unwrap();
    }
    let error = executor.run(&frame(at), &Host::default(), true).unwrap_err();
    assert!(matches!(&error, RunError::Stage { node, .. } if node == "stumble"), "{error}");
    assert_eq!(executor.frames(), u64::from(at));
}

#[test]
fn after_a_frame_that_failed_the_next_one_runs() {
    for bits in 0..8 {
        let sides = [0, 1, 2].map(|bit| if bits >> bit & 1 == 0 { "Cpu" } else { "Gpu" });
        for (at, panic, poison, profile) in
            [(0, true, true, false), (2, false, false, true), (3, true, false, false)]
        {
            let [ramp, bump, mix] = sides;
            let text = format!(
                r#"#![enable(implicit_some)]
                Graph(version: 1, nodes: {{
                    "ramp": (kind: "ramp", on: {ramp}),
                    "bump": (kind: "bump", on: {bump}, inputs: {{ "list": "ramp.ramp" }}),
                    "other": (kind: "ramp", on: {mix}),
                    "stumble": (kind: "stumble", inputs: {{ "list": "bump.list", "after": "other.ramp" }},
                        params: (at: {at}, panic: {panic})),
                    "mix": (kind: "mix", on: {mix}, inputs: {{ "now": "stumble.list", "before": "other.ramp" }},
                        params: (weight: 3)),
                }}, outputs: {{ "image": "mix.sum" }})"#
            );
            let file = GraphFile::parse("stumble.ron", &text).unwrap();
            let mut executor = executor(&file, &Settings { poison, ..Settings::new(SIZE, 0, Facts::none()) });
            executor.profile = profile;
            run_failing(&mut executor, at);
            for index in at + 1..at + 4 {
                executor.run(&frame(index), &Host::default(), true).unwrap();
                // The counts are kept values: the frame that failed had added to them already, on both sides.
                let count = |frame: u32| 1000 * (frame + 1);
                let before = |pixel: u32| match index - 1 {
                    // The frame before is the one before the failed one.
                    last if last == at => {
                        if at == 0 {
                            0
                        } else {
                            pixel + count(at - 1)
                        }
                    }
                    last => pixel + count(last),
                };
                let expected: Vec<u32> = (0..SIZE[0] * SIZE[1])
                    .map(|pixel| pixel + count(index) + 1 + 3 * before(pixel))
                    .collect();
                let image = executor.snapshot("image", "").unwrap().unwrap().get::<u32>();
                assert_eq!(image, expected, "sides {sides:?}, {at} failed, frame {index}");
            }
        }
    }
}

#[test]
fn after_a_frame_that_failed_nothing_counts_as_unchanged() {
    for sides in SIDES {
        let stumble = r#""stumble": (kind: "stumble", inputs: { "list": "ramp.ramp", "after": "again.output" }, params: (at: 2)),
            "ramp": (kind: "ramp"),"#;
        let mut settings = Settings::new(SIZE, 0, Facts::none());
        settings.taps = vec![Source { node: "stumble".into(), port: "list".into() }];
        let mut executor = executor(&looking(sides, stumble, "again.output"), &settings);
        run_failing(&mut executor, 2);
        // The numbers and the view are the same as in frame 1, and those of frame 1 were the last to be looked at.
        for (index, last) in [(3, 3), (4, 4), (5, 4)] {
            executor.run(&frame(index), &Host::default(), true).unwrap();
            let ran = |name| {
                let node = executor.plan().nodes.position(|node| node.name == name).unwrap();
                executor.ran()[node]
            };
            assert_eq!([ran("look"), ran("again")], [index == last; 2], "{sides:?}, frame {index}");
            let image = executor.snapshot("image", "").unwrap().unwrap().get::<u32>();
            assert_eq!(image[7] / 1000, 2 * last, "{sides:?}, frame {index}");
        }
    }
}

#[test]
fn late_downloads_are_delivered_again_after_a_frame_that_failed() {
    let text = r#"Graph(version: 1, nodes: {
        "ramp": (kind: "ramp", on: Gpu),
        "bump": (kind: "bump", on: Cpu, download: Latent(2), inputs: { "list": "ramp.ramp" }),
        "stumble": (kind: "stumble", inputs: { "list": "bump.list" }, params: (at: 3)),
    }, outputs: { "image": "stumble.list" })"#;
    let file = GraphFile::parse("late.ron", text).unwrap();
    let mut executor = executor(&file, &Settings::new(SIZE, 0, Facts::none()));
    run_failing(&mut executor, 3);
    let seen = [4, 5, 6].map(|index| {
        executor.run(&frame(index), &Host::default(), true).unwrap();
        executor.snapshot("image", "").unwrap().unwrap().get::<u32>()[7]
    });
    // Two whole frames before each: the fourth run of the ramp is that of the frame that failed.
    assert_eq!(seen, [2008, 3008, 5008]);
}

#[test]
fn taps_of_a_frame_that_failed_show_what_ran() {
    for side in ["Cpu", "Gpu"] {
        let text = format!(
            r#"#![enable(implicit_some)]
            Graph(version: 1, nodes: {{
                "ramp": (kind: "ramp", on: {side}),
                "stumble": (kind: "stumble", inputs: {{ "list": "ramp.ramp" }}, params: (at: 1)),
            }}, outputs: {{ "image": "stumble.list" }})"#
        );
        let mut settings = Settings::new(SIZE, 0, Facts::none());
        settings.taps = vec![Source { node: "ramp".into(), port: "ramp".into() }];
        let mut executor = executor(&GraphFile::parse("taps.ron", &text).unwrap(), &settings);
        run_failing(&mut executor, 1);
        let mut seen = |name| {
            let snapshot = executor.snapshot(name, "").unwrap().unwrap();
            (snapshot.frame, snapshot.get::<u32>()[7])
        };
        assert_eq!((seen("ramp.ramp"), seen("image")), ((1, 2007), (0, 1007)), "on {side}");
    }
}

#[test]
fn a_plan_that_needs_a_gpu_says_so() {
    let registry = registry();
    let settings = Settings::new(SIZE, 0, Facts::none());
    let (graph, plan) = compile(&graph(["Gpu", "Cpu", "Cpu"]), &registry, &settings).unwrap();
    let error = Executor::new(graph, plan, &settings, &registry, None).err().unwrap();
    assert_eq!(error, RunError::NoGpu);
}

#[test]
fn too_much_for_the_device_is_an_error() {
    let text =
        r#"Graph(version: 1, nodes: { "wide": (kind: "wide", on: Gpu) }, outputs: { "image": "wide.list" })"#;
    let file = GraphFile::parse("large.ron", text).unwrap();
    let registry = registry();
    // One row more than the device binds, whatever that is. The refusal comes before anything is allocated.
    let width = 16_384;
    let rows = u32::try_from(gpu().most_bound() / (16 * u64::from(width))).unwrap() + 1;
    let settings = Settings::new([width, rows], 0, Facts::none());
    let (graph, plan) = compile(&file, &registry, &settings).unwrap();
    match Executor::new(graph, plan, &settings, &registry, Some(gpu())).err() {
        Some(RunError::Gpu(message)) => {
            let elements = u64::from(width) * u64::from(rows);
            assert!(message.contains(&format!("`wide.list` has {elements} elements")), "{message}");
        }
        other => panic!("{other:?}"),
    }
}
