//! Draws and indirect dispatches: each shape against a rasteriser of a few lines, targets of every format, and numbers
//! of workgroups from buffers.

use epigraph_core::{
    CpuContext, Element, Executor, Extent, FieldRef, Format, Frame, GraphFile, Harness, Host, In, Io, Out,
    Pass, PortElement, Registry, Shader, ShaderModule, Shape, Side, Stage, Threads, choice, compile, params,
    testing::{Random, gpu, run_both, settings},
    texel,
};

fn registry() -> Registry {
    Registry::default()
        .with_module(ShaderModule::new("frame", epigraph_shaders::text("shared/frame.wgsl")))
        .with::<Stamp>()
        .with::<Delay>()
        .with::<Repeat>()
        .with::<Numbers>()
        .with::<Own>()
        .with::<Unfit>()
}

choice! {
    /// What an element is.
    pub enum Of {
        /// The pixel at its place.
        Points,
        /// The pixels from its place to the end of the row.
        Lines,
        /// The pixels from its place to the last row and column.
        Triangles,
    }
}

params! {
    /// Parameters of `draw`.
    pub struct DrawParams {
        /// What an element is.
        of: Of = Of::Points;
        /// With the depth test.
        depth: bool = false;
    }
}

/// Draws elements of x, y, depth in 1/256, and a number that is not 0.
struct Draw {
    list: In<[u32; 4]>,
    ids: Out<texel::R32Uint>,
    colors: Out<texel::Rgba32Float>,
}

/// Not the number of any element.
const CLEAR: u32 = 7;

impl Stage for Draw {
    const KIND: &'static str = "draw";
    const DOC: &'static str = "Draws into two textures.";
    type Params = DrawParams;

    fn declare(params: &DrawParams, io: &mut Io) -> Self {
        io.shader(Shader::new(
            "draw.wgsl",
            "
#import frame
@group(0) @binding(1) var<storage, read> list: array<vec4<u32>>;
struct Vertex {
    @builtin(position) position: vec4<f32>,
    @location(0) @interpolate(flat) element: vec4<u32>,
}
#ifdef LINES
const VERTICES = 2u;
#else
#ifdef TRIANGLES
const VERTICES = 6u;
#else
const VERTICES = 1u;
#endif
#endif
@vertex fn place(@builtin(vertex_index) index: u32) -> Vertex {
    let element = list[index / VERTICES];
    if element.w == 0u {
        return Vertex(vec4(2.0, 2.0, 2.0, 1.0), element);
    }
    let nth = index % VERTICES;
    let size = vec2<f32>(frame.size);
    var at = vec2<f32>(element.xy);
#ifdef LINES
    at = vec2(select(at.x, size.x, nth == 1u), at.y + 0.5);
#else
#ifdef TRIANGLES
    at = select(at, size, vec2(nth == 1u || nth == 2u || nth == 4u, nth == 2u || nth >= 4u));
#else
    at += 0.5;
#endif
#endif
    let p = 2.0 * at / size - 1.0;
    return Vertex(vec4(p.x, -p.y, f32(element.z) / 256.0, 1.0), element);
}
struct Pixel {
    @location(1) color: vec4<f32>,
    @location(0) id: u32,
}
@fragment fn paint(in: Vertex) -> Pixel {
    return Pixel(vec4<f32>(in.element), in.element.w);
}",
        ));
        let list = io.read("list", "the elements", Extent::Any);
        let ids = io.write("ids", "the number drawn", Extent::Frame(1));
        let colors = io.write("colors", "the element drawn", Extent::Frame(1));
        let (shape, vertices) = match params.of {
            Of::Points => (Shape::Points, 1),
            Of::Lines => (Shape::Lines, 2),
            Of::Triangles => (Shape::Triangles, 6),
        };
        match params.of {
            Of::Points => {}
            Of::Lines => io.define("LINES"),
            Of::Triangles => io.define("TRIANGLES"),
        }
        io.pass(Pass::Draw {
            vertex: "place".into(),
            fragment: "paint".into(),
            shape,
            vertices,
            count: list.into(),
            targets: vec![ids.into(), colors.into()],
            depth: params.depth,
            clear: CLEAR.into(),
        });
        Self { list, ids, colors }
    }

    fn cpu(&self, params: &DrawParams, cx: &CpuContext) -> Result<(), String> {
        let [width, height] = cx.frame().size;
        let (mut ids, mut colors) = (cx.write(self.ids), cx.write(self.colors));
        ids.fill(CLEAR);
        colors.fill([CLEAR as f32; 4]);
        let mut nearest = vec![256; ids.len()];
        for &element in cx.read(self.list).iter().filter(|element| element[3] != 0) {
            let [x, y, depth, id] = element;
            let (right, bottom) = match params.of {
                Of::Points => (x + 1, y + 1),
                Of::Lines => (width, y + 1),
                Of::Triangles => (width, height),
            };
            for pixel in (y..bottom).flat_map(|y| (x..right).map(move |x| (y * width + x) as usize)) {
                if !params.depth || depth < nearest[pixel] {
                    nearest[pixel] = depth;
                    ids[pixel] = id;
                    colors[pixel] = element.map(|number| number as f32);
                }
            }
        }
        Ok(())
    }
}

const EVERY_SHAPE: [Of; 3] = [Of::Points, Of::Lines, Of::Triangles];

#[test]
fn every_shape_is_drawn_in_order_or_by_depth() {
    let mut random = Random(7);
    for (size, of, depth) in [[1, 1], [1, 17], [13, 5], [67, 31]]
        .into_iter()
        .flat_map(|size| EVERY_SHAPE.map(|of| (size, of)))
        .flat_map(|(size, of)| [(size, of, false), (size, of, true)])
    {
        // Depth 256 is 1: it is drawn, but never passes the test.
        let list: Vec<[u32; 4]> = (0..200)
            .map(|index| [random.below(size[0]), random.below(size[1]), random.below(257), 1000 + index])
            .collect();
        let mut harness = Harness::<Draw>::new(DrawParams { of, depth }, &settings(size, 0));
        harness.set("list", &list);
        let both = run_both(&mut harness, &registry());
        both.assert_equal::<u32>("ids");
        both.assert_equal::<[f32; 4]>("colors");
        let drawn = both.gpu.get::<u32>("ids").into_iter().filter(|&id| id != CLEAR).count();
        assert!(drawn > 0, "{size:?} {of:?} {depth}");
    }
}

#[test]
fn the_depth_test_decides_and_can_fail() {
    let list = [[0, 0, 100, 1], [0, 0, 50, 2], [0, 0, 80, 3], [0, 0, 50, 4], [1, 0, 256, 5]];
    let drawn = |of, depth| {
        let mut harness = Harness::<Draw>::new(DrawParams { of, depth }, &settings([3, 2], 0));
        harness.set("list", &list);
        run_both(&mut harness, &registry()).gpu.get::<u32>("ids")
    };
    assert_eq!(drawn(Of::Points, false), [4, 5, 7, 7, 7, 7]);
    assert_eq!(drawn(Of::Points, true), [2, 7, 7, 7, 7, 7]);
    assert_eq!(drawn(Of::Lines, false), [4, 5, 5, 7, 7, 7]);
    assert_eq!(drawn(Of::Lines, true), [2, 2, 2, 7, 7, 7]);
    assert_eq!(drawn(Of::Triangles, false), [4, 5, 5, 4, 5, 5]);
    assert_eq!(drawn(Of::Triangles, true), [2; 6]);
}

#[test]
fn an_empty_list_draws_one_element_of_zeros() {
    for of in EVERY_SHAPE {
        let mut harness = Harness::<Draw>::new(DrawParams { of, depth: true }, &settings([5, 3], 0));
        harness.set::<[u32; 4]>("list", &[]);
        let both = run_both(&mut harness, &registry());
        // The shader puts an element of zeros outside the image.
        assert_eq!(both.gpu.get::<u32>("ids"), [CLEAR; 15]);
        both.assert_equal::<u32>("ids");
    }
}

/// Draws 0.25 into the first pixel of a texture of any format, cleared to 1; into one of u32, 2.
struct Formatted<E>(std::marker::PhantomData<fn() -> E>);

impl<E: PortElement> Stage for Formatted<E> {
    const KIND: &'static str = "formatted";
    const DOC: &'static str = "One pixel.";
    type Params = ();

    fn declare((): &(), io: &mut Io) -> Self {
        let paint = match E::element() {
            Element::Texel(Format::R32Uint) => "u32 { return 2u; }",
            _ => "vec4<f32> { return vec4(0.25); }",
        };
        let target = io.write::<E>("target", "the pixels", Extent::Frame(1));
        // Nothing is bound. All points have the same place.
        io.shader(Shader::new(
            "formatted.wgsl",
            format!(
                "
@vertex fn place() -> @builtin(position) vec4<f32> {{ return vec4(-0.5, 0.5, 0.0, 1.0); }}
@fragment fn paint() -> @location(0) {paint}"
            ),
        ));
        io.pass(Pass::Draw {
            vertex: "place".into(),
            fragment: "paint".into(),
            shape: Shape::Points,
            vertices: 1,
            count: target.into(),
            targets: vec![target.into()],
            depth: false,
            clear: 1.0,
        });
        Self(std::marker::PhantomData)
    }

    fn cpu(&self, (): &(), _: &CpuContext) -> Result<(), String> {
        Err("only drawn".into())
    }
}

/// What a draw leaves in a texture of 2x2.
fn drawn<E: PortElement>() -> Vec<E::Cpu> {
    let mut harness = Harness::<Formatted<E>>::new((), &settings([2, 2], 0));
    let outputs = harness.run(Side::Gpu, &registry(), &Host::default(), Some(gpu()));
    outputs.unwrap_or_else(|error| panic!("{error}")).get("target")
}

#[test]
fn every_format_is_cleared_and_drawn_to() {
    assert_eq!(drawn::<texel::R32Uint>(), [2, 1, 1, 1]);
    assert_eq!(drawn::<texel::R32Float>(), [0.25, 1.0, 1.0, 1.0]);
    // 0.25 * 255 is 63.75.
    assert_eq!(drawn::<texel::Rgba8Unorm>(), [[64; 4], [255; 4], [255; 4], [255; 4]]);
    let half = drawn::<texel::Rgba16Float>().into_iter().map(|texel| texel.map(f32::from));
    assert_eq!(half.collect::<Vec<_>>(), [[0.25; 4], [1.0; 4], [1.0; 4], [1.0; 4]]);
    assert_eq!(drawn::<texel::Rgba32Float>(), [[0.25; 4], [1.0; 4], [1.0; 4], [1.0; 4]]);
}

/// Draws the frame's number over the whole image.
struct Stamp;

impl Stage for Stamp {
    const KIND: &'static str = "stamp";
    const DOC: &'static str = "The frame's number.";
    type Params = ();

    fn declare((): &(), io: &mut Io) -> Self {
        io.shader(Shader::new(
            "stamp.wgsl",
            "
#import frame
@vertex fn corner(@builtin(vertex_index) index: u32) -> @builtin(position) vec4<f32> {
    return vec4(f32(index / 2u) * 4.0 - 1.0, f32(index % 2u) * 4.0 - 1.0, 0.0, 1.0);
}
@fragment fn paint() -> @location(0) u32 { return frame.index; }",
        ));
        let image = io.write::<texel::R32Uint>("image", "the frame's number", Extent::Frame(1));
        io.pass(Pass::Draw {
            vertex: "corner".into(),
            fragment: "paint".into(),
            shape: Shape::Triangles,
            vertices: 3,
            count: image.into(),
            targets: vec![image.into()],
            depth: false,
            clear: 99.0,
        });
        Self
    }

    fn cpu(&self, (): &(), _: &CpuContext) -> Result<(), String> {
        Err("only drawn".into())
    }
}

/// What a texture held in the frame before.
struct Delay {
    image: In<texel::R32Uint>,
    before: Out<u32>,
}

impl Stage for Delay {
    const KIND: &'static str = "delay";
    const DOC: &'static str = "The frame before.";
    type Params = ();

    fn declare((): &(), io: &mut Io) -> Self {
        let image = io.history("image", "any", Extent::Frame(1));
        Self { image, before: io.write("before", "the same", Extent::Frame(1)) }
    }

    fn cpu(&self, (): &(), cx: &CpuContext) -> Result<(), String> {
        cx.write(self.before).copy_from_slice(&cx.read(self.image));
        Ok(())
    }
}

/// Runs frames of a graph; gives what its output `image` held in each.
fn run(text: &str, frames: u32) -> Vec<Vec<u32>> {
    let (registry, settings) = (registry(), settings([3, 2], 0));
    let file = GraphFile::parse("test.ron", text).unwrap();
    let (graph, plan) = compile(&file, &registry, &settings).unwrap_or_else(|problems| panic!("{problems}"));
    let mut executor = Executor::new(graph, plan, &settings, &registry, Some(gpu())).unwrap();
    let frames = (0..frames).map(|index| {
        let frame = Frame { size: settings.size, index, ..Frame::default() };
        executor.run(&frame, &Host::default(), true).unwrap();
        executor.snapshot("image", "").unwrap().unwrap().get::<u32>()
    });
    frames.collect()
}

#[test]
fn a_target_whose_last_value_is_read_swaps() {
    let text = r#"Graph(version: 1, nodes: {
        "stamp": (kind: "stamp", on: Gpu),
        "delay": (kind: "delay", inputs: { "image": "stamp.image" }),
    }, outputs: { "image": "delay.before", "now": "stamp.image" })"#;
    assert_eq!(run(text, 5), [[0; 6], [0; 6], [1; 6], [2; 6], [3; 6]]);
}

params! {
    /// Parameters of `numbers`.
    pub struct NumbersParams {
        /// Numbers of workgroups in frame 0, along x.
        x: u32 = 1, in 0..=1000;
    }
}

/// Writes three numbers of workgroups: the first grows by one each frame.
struct Numbers(Out<u32>);

impl Stage for Numbers {
    const KIND: &'static str = "numbers";
    const DOC: &'static str = "Numbers of workgroups.";
    type Params = NumbersParams;

    fn declare(_: &NumbersParams, io: &mut Io) -> Self {
        io.shader(Shader::new(
            "numbers.wgsl",
            "
#import frame
struct Params { x: u32 }
@group(0) @binding(1) var<uniform> params: Params;
@group(0) @binding(2) var<storage, read_write> counts: array<u32>;
@compute @workgroup_size(1) fn main() {
    counts[0] = params.x + frame.index;
    counts[1] = 2u;
    counts[2] = 1u;
}",
        ));
        let counts = io.write("counts", "the numbers", Extent::Fixed([3, 1]));
        io.compute("main", Threads::Groups(1));
        Self(counts)
    }

    fn cpu(&self, params: &NumbersParams, cx: &CpuContext) -> Result<(), String> {
        cx.write(self.0).copy_from_slice(&[params.x + cx.frame().index, 2, 1]);
        Ok(())
    }
}

params! {
    /// Parameters of `repeat`.
    pub struct RepeatParams {
        /// Take the numbers of the frame before.
        late: bool = false;
    }
}

/// Counts its workgroups.
struct Repeat {
    counts: In<u32>,
    hits: Out<u32>,
}

impl Stage for Repeat {
    const KIND: &'static str = "repeat";
    const DOC: &'static str = "Counts workgroups.";
    type Params = RepeatParams;

    fn declare(params: &RepeatParams, io: &mut Io) -> Self {
        io.shader(Shader::new(
            "repeat.wgsl",
            "
@group(0) @binding(0) var<storage, read> counts: array<u32>;
@group(0) @binding(1) var<storage, read_write> hits: array<atomic<u32>>;
@compute @workgroup_size(4) fn clear(@builtin(local_invocation_index) index: u32) { atomicStore(&hits[index], 0u); }
@compute @workgroup_size(1) fn hit(@builtin(num_workgroups) groups: vec3<u32>) {
    atomicAdd(&hits[0], 1u);
    if all(groups == vec3(counts[0], counts[1], counts[2])) {
        atomicAdd(&hits[1], 1u);
    }
    atomicMax(&hits[2], groups.x);
    atomicMax(&hits[3], groups.y);
}",
        ));
        let name = "counts";
        let counts = if params.late {
            io.history(name, "numbers of workgroups", Extent::Any)
        } else {
            io.read(name, "numbers of workgroups", Extent::Any)
        };
        let hits = io.write("hits", "workgroups that ran, twice, and their numbers", Extent::Fixed([4, 1]));
        io.compute("clear", Threads::Groups(1));
        io.compute("hit", Threads::Indirect(counts.into()));
        Self { counts, hits }
    }

    fn cpu(&self, _: &RepeatParams, cx: &CpuContext) -> Result<(), String> {
        let counts = cx.read(self.counts);
        let [x, y, z] = [counts[0], counts[1], counts[2]];
        // A number of more than 2^31 is beyond every device's limit.
        let runs = [x, y, z].iter().all(|count| (1..1 << 31).contains(count));
        let hits = if runs { [x * y * z, x * y * z, x, y] } else { [0; 4] };
        cx.write(self.hits).copy_from_slice(&hits);
        Ok(())
    }
}

#[test]
fn numbers_of_workgroups_come_from_a_buffer() {
    let mut harness = Harness::<Repeat>::new(RepeatParams { late: false }, &settings([1, 1], 0));
    let many = [
        [0, 0, 0],
        [1, 1, 1],
        [5, 3, 2],
        [0, 1, 1],
        [1, 0, 1],
        [1, 1, 0],
        [65_535, 1, 1],
        [1, 1, 65_535],
        [300, 200, 1],
        [u32::MAX, 1, 1],
        [1, 1 << 31, 1],
        [0xDEAD_BEEF; 3],
    ];
    for counts in many {
        harness.set("counts", &counts);
        run_both(&mut harness, &registry()).assert_equal::<u32>("hits");
    }
    // More elements than the three do no harm.
    let mut harness = Harness::<Repeat>::new(RepeatParams { late: false }, &settings([1, 1], 0));
    harness.set("counts", &[2, 2, 2, 9, 9]);
    assert_eq!(run_both(&mut harness, &registry()).gpu.get::<u32>("hits"), [8, 8, 2, 2]);
}

#[test]
fn numbers_of_workgroups_come_from_either_side_and_from_the_frame_before() {
    for (on, late) in [("Cpu", false), ("Gpu", false), ("Cpu", true), ("Gpu", true)] {
        let text = format!(
            r#"#![enable(implicit_some)]
            Graph(version: 1, nodes: {{
                "numbers": (kind: "numbers", on: {on}, params: (x: 4)),
                "repeat": (kind: "repeat", on: Gpu, inputs: {{ "counts": "numbers.counts" }}, params: (late: {late})),
            }}, outputs: {{ "image": "repeat.hits" }})"#
        );
        // In the first frame, the frame before is zeros.
        let expected = |frame: u32| match frame.checked_sub(u32::from(late)) {
            None => [0; 4],
            Some(frame) => [2 * (4 + frame), 2 * (4 + frame), 4 + frame, 2],
        };
        assert_eq!(run(&text, 4), [0, 1, 2, 3].map(expected), "{on}, {late}");
    }
}

/// Writes its own numbers of workgroups, as many as the frame's number, and counts them.
struct Own;

impl Stage for Own {
    const KIND: &'static str = "own";
    const DOC: &'static str = "Counts workgroups.";
    type Params = ();

    fn declare((): &(), io: &mut Io) -> Self {
        io.shader(Shader::new(
            "own.wgsl",
            "
#import frame
@group(0) @binding(1) var<storage, read_write> counts: array<vec2<u32>>;
@group(0) @binding(2) var<storage, read_write> hits: array<atomic<u32>>;
@compute @workgroup_size(1) fn count() {
    counts[0] = vec2(frame.index, 2u);
    counts[1] = vec2(3u, 0u);
    atomicStore(&hits[0], 0u);
}
@compute @workgroup_size(1) fn hit() { atomicAdd(&hits[0], 1u); }",
        ));
        let counts = io.write::<[u32; 2]>("counts", "numbers of workgroups", Extent::Fixed([2, 1]));
        io.write::<u32>("hits", "workgroups that ran", Extent::Fixed([1, 1]));
        io.compute("count", Threads::Groups(1));
        io.compute("hit", Threads::Indirect(counts.into()));
        Self
    }

    fn cpu(&self, (): &(), _: &CpuContext) -> Result<(), String> {
        Err("on the GPU only".into())
    }
}

#[test]
fn numbers_of_workgroups_come_from_the_pass_before() {
    let text =
        r#"Graph(version: 1, nodes: { "own": (kind: "own", on: Gpu) }, outputs: { "image": "own.hits" })"#;
    assert_eq!(run(text, 4), [[0], [6], [12], [18]]);
}

choice! {
    /// What is wrong.
    pub enum Fault {
        /// Targets of two sizes.
        Sizes,
        /// Two numbers of workgroups.
        Short,
        /// No numbers of workgroups.
        Unconnected,
        /// More vertices than can be counted.
        Many,
    }
}

params! {
    /// Parameters of `unfit`.
    pub struct UnfitParams {
        /// What is wrong.
        fault: Fault = Fault::Sizes;
    }
}

/// A pass that does not fit its ports.
struct Unfit;

impl Stage for Unfit {
    const KIND: &'static str = "unfit";
    const DOC: &'static str = "Cannot run.";
    type Params = UnfitParams;

    fn declare(params: &UnfitParams, io: &mut Io) -> Self {
        io.shader(Shader::new("unfit.wgsl", ""));
        let image = io.write::<texel::R32Uint>("image", "a target", Extent::Frame(1));
        let half = io.write::<texel::R32Uint>("half", "a smaller one", Extent::Frame(2));
        let short = io.write::<u32>("short", "a list", Extent::Fixed([2, 1]));
        let long = io.write::<u32>("long", "a list", Extent::Fixed([1 << 30, 1]));
        io.optional::<u32>("loose", "a list", Extent::Any);
        let draw = |count: FieldRef, targets: Vec<FieldRef>| Pass::Draw {
            vertex: "place".into(),
            fragment: "paint".into(),
            shape: Shape::Triangles,
            vertices: 6,
            count,
            targets,
            depth: false,
            clear: 0.0,
        };
        match params.fault {
            Fault::Sizes => io.pass(draw(short.into(), vec![image.into(), half.into()])),
            Fault::Short => io.compute("main", Threads::Indirect(short.into())),
            Fault::Unconnected => io.compute("main", Threads::Indirect(FieldRef { port: 4, field: 0 })),
            Fault::Many => io.pass(draw(long.into(), vec![image.into()])),
        }
        Self
    }

    fn cpu(&self, _: &UnfitParams, _: &CpuContext) -> Result<(), String> {
        Ok(())
    }
}

#[test]
fn passes_that_do_not_fit_their_ports_are_refused() {
    let cases = [
        ("Sizes", "a pass draws to `image` (13x5) and `half` (7x3); its targets must have the same size"),
        ("Short", "`short` gives numbers of workgroups, but it has only 8 bytes; they are three u32"),
        ("Unconnected", "`loose` gives numbers of workgroups, but it is not connected"),
        (
            "Many",
            "a pass draws 1073741824 elements of `long` with 6 vertices each; 4294967295 vertices are the limit",
        ),
    ];
    for (fault, expected) in cases {
        let text = format!(
            r#"Graph(version: 1, nodes: {{
                "unfit": (kind: "unfit", params: (fault: {fault})),
            }}, outputs: {{ "image": "unfit.image" }})"#
        );
        let file = GraphFile::parse("test.ron", &text).unwrap();
        let problems = compile(&file, &registry(), &settings([13, 5], 0)).err().unwrap().to_string();
        assert!(problems.contains(expected), "{fault}:\n{problems}");
        assert!(problems.contains("test.ron:2:17"), "{fault}:\n{problems}");
    }
}
