//! A watched run ends at the first bad value that a node writes, on both sides with the same words, and names its
//! place. A run that is not watched has the same plan, and shaders without a trace of their checks.

use epigraph_core::{
    Access, BadValue, CpuContext, Executor, Extent, Facts, Frame, GraphError, GraphFile, Holds, Host, In, Io,
    Out, Registry, Rule, RunError, Settings, Shader, ShaderLibrary, ShaderModule, Side, Stage, Wrong,
    check_stage, choice, compile, compose_shader, item, meanings, params, testing::gpu, texel,
};
use half::f16;

const SIZE: [u32; 2] = [13, 7];
const POINTS_PER_PIXEL: f32 = 2.0;

meanings! {
    /// The points.
    POINTS = "points", [Rule::floats(0.0, 1.0).of("position").lanes(3, 4), Rule::bits(0, 2, 2).of("meta")];
    /// The point of each pixel.
    ID = "id", [Rule::index_of("points").or(u32::MAX)];
    /// Linear light.
    LIGHT = "light", [Rule::floats(0.0, f32::MAX).lanes(0, 3), Rule::floats(0.0, 1.0).lanes(3, 4)];
    /// Things.
    LIST = "list";
    /// The place of a thing in the list.
    PLACE = "place", [Rule::index_of("list")];
}

item! {
    /// What is counted, and where.
    struct Mark {
        /// Where.
        place: [f32; 3],
        /// Up to 5, or 9.
        count: u32,
        /// From -2 to 2.
        step: i32,
        /// Pads the size to a multiple of 16 bytes.
        pad_a: u32,
        /// The same.
        pad_b: u32,
        /// The same.
        pad_c: u32,
    }
}

choice! {
    /// The field into which a word is written.
    enum Spot {
        /// No field.
        None,
        /// A field of [`Spoil`].
        Light,
        /// A field of [`Spoil`].
        Half,
        /// A field of [`Spoil`].
        Index,
        /// A field of [`Spoil`].
        Depth,
        /// A field of [`Spoil`].
        Bits,
        /// A field of [`Spoil`].
        Id,
        /// A field of [`Spoil`].
        Position,
        /// A field of [`Spoil`].
        Meta,
        /// A field of [`Spoil`].
        Mark,
        /// A field of [`Spoil`].
        Share,
    }
}

params! {
    /// Parameters of [`Spoil`].
    struct SpoilParams {
        /// Where the word goes.
        spot: Spot = Spot::None;
        /// The element.
        element: u32 = 0;
        /// The word of the element.
        word: u32 = 0;
        /// The bits.
        bits: u32 = 0;
        /// The first frame in which it is written.
        frame: u32 = 0;
    }
}

/// Writes zeros, and one word somewhere.
struct Spoil {
    base: In<u32>,
    light: Out<texel::Rgba32Float>,
    half: Out<texel::Rgba16Float>,
    index: Out<texel::R32Uint>,
    depth: Out<f32>,
    bits: Out<u32>,
    position: Out<[f32; 4]>,
    meta: Out<u32>,
    id: Out<u32>,
    mark: Out<Mark>,
    share: Out<[f32; 2]>,
}

const SPOIL: &str = "
#import frame
struct Params { spot: u32, element: u32, word: u32, bits: u32, frame: u32 }
struct Mark { place: vec3<f32>, count: u32, step: i32, pad_a: u32, pad_b: u32, pad_c: u32 }
@group(0) @binding(1) var<uniform> params: Params;
@group(0) @binding(2) var<storage, read> base: array<u32>;
@group(0) @binding(3) var light: texture_storage_2d<rgba32float, write>;
@group(0) @binding(4) var half: texture_storage_2d<rgba16float, write>;
@group(0) @binding(5) var index: texture_storage_2d<r32uint, write>;
@group(0) @binding(6) var<storage, read_write> depth: array<f32>;
@group(0) @binding(7) var<storage, read_write> bits: array<u32>;
@group(0) @binding(8) var<storage, read_write> cloud_position: array<vec4<f32>>;
@group(0) @binding(9) var<storage, read_write> cloud_meta: array<u32>;
@group(0) @binding(10) var<storage, read_write> id: array<u32>;
@group(0) @binding(11) var<storage, read_write> marks: array<Mark>;
@group(0) @binding(12) var<storage, read_write> share: array<vec2<f32>>;

fn word(spot: u32, element: u32, at: u32) -> u32 {
    let hit = params.spot == spot && params.element == element && params.word == at && frame.index >= params.frame;
    return select(base[0], params.bits, hit);
}
fn float(spot: u32, element: u32, at: u32) -> f32 { return bitcast<f32>(word(spot, element, at)); }
fn floats(spot: u32, element: u32) -> vec4<f32> {
    return vec4(float(spot, element, 0u), float(spot, element, 1u), float(spot, element, 2u), float(spot, element, 3u));
}
@compute @workgroup_size(8, 8) fn images(@builtin(global_invocation_id) at: vec3<u32>) {
    if any(at.xy >= frame.size) { return; }
    let element = at.y * frame.size.x + at.x;
    textureStore(light, at.xy, floats(SPOT_LIGHT, element));
    textureStore(half, at.xy, floats(SPOT_HALF, element));
    textureStore(index, at.xy, vec4(word(SPOT_INDEX, element, 0u)));
}
@compute @workgroup_size(64) fn lists(@builtin(global_invocation_id) at: vec3<u32>) {
    let element = at.x;
    if element < arrayLength(&depth) {
        depth[element] = float(SPOT_DEPTH, element, 0u);
        bits[element] = word(SPOT_BITS, element, 0u);
        id[element] = word(SPOT_ID, element, 0u);
    }
}
@compute @workgroup_size(64) fn points(@builtin(global_invocation_id) at: vec3<u32>) {
    let element = at.x;
    if element < arrayLength(&cloud_meta) {
        cloud_position[element] = floats(SPOT_POSITION, element);
        cloud_meta[element] = word(SPOT_META, element, 0u);
    }
}
@compute @workgroup_size(64) fn few(@builtin(global_invocation_id) at: vec3<u32>) {
    let element = at.x;
    if element < arrayLength(&share) {
        let a = float(SPOT_SHARE, element, 0u);
        share[element] = vec2(a, 1.0 - a);
        #check share[element]: a <= 0.5 && share[element].y >= 0.5, \"the second share is not the smaller one\"
        let step = bitcast<i32>(word(SPOT_MARK, element, 4u));
        marks[element] = Mark(floats(SPOT_MARK, element).xyz, word(SPOT_MARK, element, 3u), step, 0u, 0u, 0u);
    }
}
";

impl Stage for Spoil {
    const KIND: &'static str = "spoil";
    const DOC: &'static str = "Zeros, and one word somewhere.";
    type Params = SpoilParams;

    fn declare(_: &SpoilParams, io: &mut Io) -> Self {
        io.shader(Shader::new("spoil.wgsl", SPOIL));
        let pixels = || Extent::Frame(1);
        let base = io.read("base", "A zero.", Extent::Any);
        let light = io.write("light", LIGHT, pixels());
        let half = io.write("half", "Numbers.", pixels());
        const FEW: &[Rule] = &[Rule::wholes(0, 6)];
        let index = io.write("index", Holds::from("Up to 6.").within(FEW), pixels());
        const REACH: &[Rule] = &[Rule::floats(0.0, 100.0).or(f32::INFINITY.to_bits())];
        let depth = io.write("depth", Holds::from("Up to 100.").within(REACH), pixels());
        let bits = io.write("bits", Holds::from("The bits of such.").within(REACH), pixels());
        let mut cloud = io.bundle(Access::Write, "cloud", POINTS, Extent::PerPixel(POINTS_PER_PIXEL));
        let (position, meta) = (cloud.write("position"), cloud.write("meta"));
        let id = io.write("id", ID, pixels());
        const MARK: &[Rule] = &[Rule::wholes(0, 5).or(9).of("count"), Rule::wholes(-2, 2).of("step")];
        let few = || Extent::Fixed([4, 1]);
        let mark = io.write("marks", Holds::from("Marks.").within(MARK), few());
        let share = io.write("share", "Two shares.", few());
        io.dispatch("images", light);
        io.dispatch("lists", depth);
        io.dispatch("points", meta);
        io.dispatch("few", share);
        Self { base, light, half, index, depth, bits, position, meta, id, mark, share }
    }

    fn cpu(&self, params: &SpoilParams, cx: &CpuContext) -> Result<(), String> {
        let base = cx.read(self.base)[0];
        let frame = cx.frame().index;
        let word = |spot: Spot, element: usize, at: u32| {
            let here = params.spot == spot && params.element as usize == element && params.word == at;
            if here && frame >= params.frame { params.bits } else { base }
        };
        let float = |spot, element, at| f32::from_bits(word(spot, element, at));
        let floats = |spot, element| [0, 1, 2, 3].map(|at| float(spot, element, at));
        for (element, light) in cx.write(self.light).iter_mut().enumerate() {
            *light = floats(Spot::Light, element);
            cx.write(self.half)[element] = floats(Spot::Half, element).map(f16::from_f32);
            cx.write(self.index)[element] = word(Spot::Index, element, 0);
            cx.write(self.depth)[element] = float(Spot::Depth, element, 0);
            cx.write(self.bits)[element] = word(Spot::Bits, element, 0);
            cx.write(self.id)[element] = word(Spot::Id, element, 0);
        }
        for (element, position) in cx.write(self.position).iter_mut().enumerate() {
            *position = floats(Spot::Position, element);
            cx.write(self.meta)[element] = word(Spot::Meta, element, 0);
        }
        for (element, share) in cx.write(self.share).iter_mut().enumerate() {
            let a = float(Spot::Share, element, 0);
            *share = [a, 1.0 - a];
            let [x, y, z, _] = floats(Spot::Mark, element);
            let (count, step) = (word(Spot::Mark, element, 3), word(Spot::Mark, element, 4) as i32);
            cx.write(self.mark)[element] = Mark { place: [x, y, z], count, step, ..Mark::default() };
        }
        if let Some(checks) = cx.checks(self.share) {
            for (element, [a, b]) in cx.write(self.share).iter().enumerate() {
                checks.that(element, *a <= 0.5 && *b >= 0.5, "the second share is not the smaller one");
            }
        }
        Ok(())
    }
}

/// Writes a zero.
struct Base {
    zero: Out<u32>,
}

impl Stage for Base {
    const KIND: &'static str = "base";
    const DOC: &'static str = "A zero.";
    type Params = ();

    fn declare((): &(), io: &mut Io) -> Self {
        io.shader(Shader::new(
            "base.wgsl",
            "@group(0) @binding(0) var<storage, read_write> zero: array<u32>;
            @compute @workgroup_size(1) fn main() { zero[0] = 0u; }",
        ));
        let zero = io.write("zero", "A zero.", Extent::Fixed([1, 1]));
        io.dispatch("main", zero);
        Self { zero }
    }

    fn cpu(&self, (): &(), cx: &CpuContext) -> Result<(), String> {
        cx.write(self.zero)[0] = 0;
        Ok(())
    }
}

/// Hands on depths: what is bad in them comes from elsewhere. Fails if a depth is not a number.
struct Hand {
    depth: In<f32>,
    handed: Out<f32>,
}

impl Stage for Hand {
    const KIND: &'static str = "hand";
    const DOC: &'static str = "Hands on depths.";
    type Params = ();

    fn declare((): &(), io: &mut Io) -> Self {
        io.shader(Shader::new(
            "hand.wgsl",
            "@group(0) @binding(0) var<storage, read> depth: array<f32>;
            @group(0) @binding(1) var<storage, read_write> handed: array<f32>;
            @compute @workgroup_size(64) fn main(@builtin(global_invocation_id) id: vec3<u32>) {
                if id.x < arrayLength(&depth) { handed[id.x] = depth[id.x]; }
            }",
        ));
        let depth = io.read("depth", "Depths.", Extent::Frame(1));
        const ANY: &[Rule] = &[Rule::any()];
        let handed = io.write("handed", Holds::from("The same.").within(ANY), Extent::Frame(1));
        io.dispatch("main", handed);
        Self { depth, handed }
    }

    fn cpu(&self, (): &(), cx: &CpuContext) -> Result<(), String> {
        let depth = cx.read(self.depth);
        cx.write(self.handed).copy_from_slice(&depth);
        if depth.iter().any(|depth| depth.is_nan()) { Err("a depth is not a number".into()) } else { Ok(()) }
    }
}

params! {
    /// Parameters of [`Listing`] and [`Picking`].
    struct PlaceParams {
        /// The place that is written.
        place: u32 = 0;
        /// The pixel that a listing writes.
        pixel: u32 = 0;
    }
}

/// Writes a list of three things, its first port, a place in it, and a pixel.
struct Listing {
    place: Out<u32>,
    pixel: Out<u32>,
}

impl Stage for Listing {
    const KIND: &'static str = "listing";
    const DOC: &'static str = "Three things, a place, and a pixel.";
    type Params = PlaceParams;

    fn declare(_: &PlaceParams, io: &mut Io) -> Self {
        const PIXEL: &[Rule] = &[Rule::pixel_index()];
        io.write::<u32>("list", LIST, Extent::Fixed([3, 1]));
        let place = io.write("place", PLACE, Extent::Fixed([1, 1]));
        Self { place, pixel: io.write("pixel", Holds::from("A pixel.").within(PIXEL), Extent::Fixed([1, 1])) }
    }

    fn cpu(&self, params: &PlaceParams, cx: &CpuContext) -> Result<(), String> {
        cx.write(self.place)[0] = params.place;
        cx.write(self.pixel)[0] = params.pixel;
        if let Some(checks) = cx.checks(self.place) {
            checks.that(1, params.place != 99, "the second place, which is not there, is sound");
        }
        Ok(())
    }
}

/// Writes a place in the list of the node that it reads from.
struct Picking {
    place: Out<u32>,
}

impl Stage for Picking {
    const KIND: &'static str = "picking";
    const DOC: &'static str = "A place in a list of another node.";
    type Params = PlaceParams;

    fn declare(_: &PlaceParams, io: &mut Io) -> Self {
        io.read::<u32>("of", "A place.", Extent::Any);
        Self { place: io.write("place", PLACE, Extent::Fixed([1, 1])) }
    }

    fn cpu(&self, params: &PlaceParams, cx: &CpuContext) -> Result<(), String> {
        cx.write(self.place)[0] = params.place;
        Ok(())
    }
}

params! {
    /// Parameters of [`Lazy`].
    struct LazyParams {
        /// Whether it writes NaN, which it may; else it writes nothing.
        wild: bool = false;
    }
}

/// Writes NaN, or nothing.
struct Lazy {
    numbers: Out<f32>,
}

impl Stage for Lazy {
    const KIND: &'static str = "lazy";
    const DOC: &'static str = "NaN, or what its memory holds.";
    type Params = LazyParams;

    fn declare(params: &LazyParams, io: &mut Io) -> Self {
        const ANY: &[Rule] = &[Rule::any()];
        io.optional::<f32>("of", "Numbers.", Extent::Frame(1));
        let holds = Holds::from("Numbers.");
        let holds = if params.wild { holds.within(ANY) } else { holds };
        Self { numbers: io.write("numbers", holds, Extent::Frame(1)) }
    }

    fn cpu(&self, params: &LazyParams, cx: &CpuContext) -> Result<(), String> {
        if params.wild {
            cx.write(self.numbers).fill(f32::NAN);
        }
        Ok(())
    }
}

fn registry() -> Registry {
    let frame = ShaderModule::new("frame.wgsl", epigraph_shaders::text("shared/frame.wgsl"));
    let registry = Registry::default().with::<Base>().with::<Spoil>().with::<Hand>();
    registry.with::<Listing>().with::<Picking>().with::<Lazy>().with_module(frame)
}

fn file(params: &str, hand: Side) -> GraphFile {
    let text = format!(
        r#"#![enable(implicit_some)]
        Graph(version: 1, nodes: {{
            "hand": (kind: "hand", on: {hand:?}, inputs: {{ "depth": "spoil.depth" }}),
            "spoil": (kind: "spoil", inputs: {{ "base": "base.zero" }}, params: ({params})),
            "base": (kind: "base"),
        }}, outputs: {{ "image": "hand.handed" }})"#
    );
    GraphFile::parse("spoil.ron", &text).unwrap()
}

fn settings(side: Side, watch: bool) -> Settings {
    Settings { side, watch, ..Settings::new(SIZE, 0, Facts::none()) }
}

fn executor(file: &GraphFile, settings: &Settings) -> Executor {
    let registry = registry();
    let (graph, plan) = compile(file, &registry, settings).unwrap_or_else(|problems| panic!("{problems}"));
    Executor::new(graph, plan, settings, &registry, Some(gpu())).unwrap_or_else(|error| panic!("{error}"))
}

fn run(executor: &mut Executor, index: u32) -> Result<(), RunError> {
    executor.run(&Frame { size: SIZE, index, ..Frame::default() }, &Host::default(), true)
}

/// What is found in frame 2 of a run whose first two frames are sound.
fn found(file: &GraphFile, side: Side) -> BadValue {
    let mut executor = executor(file, &settings(side, true));
    for index in 0..2 {
        run(&mut executor, index).unwrap_or_else(|error| panic!("{side}, frame {index}: {error}"));
    }
    let Err(RunError::Watch(bad)) = run(&mut executor, 2) else {
        panic!("nothing is found on the {side}: {}", file.text)
    };
    *bad
}

const NAN: u32 = f32::NAN.to_bits();
const INFINITY: u32 = f32::INFINITY.to_bits();

/// A word that is bad: where it is written, and what is said about it.
type Case = (&'static str, u32, u32, u32, Wrong, &'static str, &'static str, Option<[u32; 2]>);

#[test]
fn the_first_bad_value_is_named_on_both_sides() {
    let bits = f32::to_bits;
    let cases: [Case; 17] = [
        ("Light", 30, 1, NAN, Wrong::Nan, "spoil.light", "g: NaN", Some([4, 2])),
        ("Light", 90, 2, INFINITY, Wrong::Infinite, "spoil.light", "b: inf", Some([12, 6])),
        ("Light", 0, 0, bits(-0.5), Wrong::Negative, "spoil.light", "r: -0.5", Some([0, 0])),
        ("Light", 12, 3, bits(1.5), Wrong::OutOfRange, "spoil.light", "a: 1.5", Some([12, 0])),
        ("Half", 13, 0, NAN, Wrong::Nan, "spoil.half", "r: NaN", Some([0, 1])),
        ("Half", 14, 3, INFINITY, Wrong::Infinite, "spoil.half", "a: inf", Some([1, 1])),
        ("Index", 14, 0, 7, Wrong::OutOfRange, "spoil.index", ": 7", Some([1, 1])),
        ("Depth", 80, 0, bits(100.5), Wrong::OutOfRange, "spoil.depth", ": 100.5", Some([2, 6])),
        ("Depth", 3, 0, NAN, Wrong::Nan, "spoil.depth", ": NaN", Some([3, 0])),
        ("Bits", 70, 0, bits(-1e-30), Wrong::Negative, "spoil.bits", ": -1e-30", Some([5, 5])),
        ("Id", 5, 0, 182, Wrong::OutOfRange, "spoil.id", ": 182", Some([5, 0])),
        ("Position", 181, 3, bits(1.25), Wrong::OutOfRange, "spoil.cloud.position", "w: 1.25", None),
        ("Position", 100, 0, INFINITY, Wrong::Infinite, "spoil.cloud.position", "x: inf", None),
        ("Meta", 1, 0, 0xF3, Wrong::OutOfRange, "spoil.cloud.meta", ": 3 in 0xF3", None),
        ("Mark", 2, 3, 6, Wrong::OutOfRange, "spoil.marks", "count: 6", None),
        ("Mark", 3, 4, -3i32 as u32, Wrong::OutOfRange, "spoil.marks", "step: -3", None),
        ("Share", 1, 0, bits(0.75), Wrong::Check, "spoil.share", "0.75, 0.25", None),
    ];
    for (spot, element, word, bits, wrong, port, value, pixel) in cases {
        let params = format!("spot: {spot}, element: {element}, word: {word}, bits: {bits}, frame: 2");
        for side in Side::ALL {
            let bad = found(&file(&params, side), side);
            let what = format!("{spot} on the {side}: {bad}");
            assert_eq!(
                (&*bad.port, bad.element, bad.wrong, bad.pixel),
                (port, element as usize, wrong, pixel),
                "{what}"
            );
            assert_eq!((&*bad.node, &*bad.kind, bad.frame, bad.side), ("spoil", "spoil", 2, side), "{what}");
            assert_eq!(bad.read, ["base.zero"], "{what}");
            assert!(bad.to_string().contains(value), "{what}");
        }
        let [cpu, gpu] = Side::ALL.map(|side| found(&file(&params, side), side));
        assert_eq!(BadValue { side: Side::Cpu, ..gpu }, cpu);
    }
}

#[test]
fn of_several_nodes_with_checks_each_has_its_own() {
    let node = |name: &str, frame: u32| {
        format!(
            r#""{name}": (kind: "spoil", inputs: {{ "base": "base.zero" }},
                params: (spot: Mark, element: 2, word: 3, bits: 6, frame: {frame})),"#
        )
    };
    for side in Side::ALL {
        for bad in 0..3 {
            let names = ["first", "second", "third"];
            let nodes: String = names
                .iter()
                .enumerate()
                .map(|(at, name)| node(name, if at == bad { 2 } else { 9 }))
                .collect();
            let text = format!(
                r#"#![enable(implicit_some)]
                Graph(version: 1, nodes: {{ "base": (kind: "base"), {nodes} }},
                    outputs: {{ "image": "first.depth", "b": "second.depth", "c": "third.depth" }})"#
            );
            let found = found(&GraphFile::parse("spoil.ron", &text).unwrap(), side);
            assert_eq!(
                (&*found.node, &*found.port),
                (names[bad], &*format!("{}.marks", names[bad])),
                "{side}"
            );
        }
    }
}

#[test]
fn of_bad_values_on_both_sides_that_of_the_first_node_counts() {
    for sides in [[Side::Cpu, Side::Gpu], [Side::Gpu, Side::Cpu]] {
        let node = |name: &str, side: Side, base: &str| {
            format!(
                r#""{name}": (kind: "spoil", on: {side:?}, inputs: {{ "base": "{base}" }},
                    params: (spot: Mark, element: 2, word: 3, bits: 6, frame: 2)),"#
            )
        };
        let text = format!(
            r#"#![enable(implicit_some)]
            Graph(version: 1, nodes: {{ "base": (kind: "base"), {}{} }},
                outputs: {{ "image": "first.depth", "other": "second.depth" }})"#,
            node("first", sides[0], "base.zero"),
            node("second", sides[1], "first.id"),
        );
        let bad = found(&GraphFile::parse("spoil.ron", &text).unwrap(), Side::Cpu);
        assert_eq!((&*bad.node, bad.side), ("first", sides[0]));
    }
}

#[test]
fn what_ports_may_hold_is_not_reported() {
    let bits = f32::to_bits;
    for (spot, element, word, bits) in [
        ("Light", 30, 1, f32::MAX.to_bits()),
        ("Light", 30, 1, bits(-0.0)),
        ("Light", 30, 3, bits(1.0)),
        ("Half", 30, 1, bits(-60000.0)),
        ("Index", 30, 0, 6),
        ("Depth", 30, 0, INFINITY),
        ("Depth", 30, 0, bits(100.0)),
        ("Bits", 30, 0, INFINITY),
        ("Id", 30, 0, 181),
        ("Id", 30, 0, u32::MAX),
        ("Position", 30, 0, bits(-1e30)),
        ("Meta", 30, 0, 0xFFFF_FFFE),
        ("Mark", 3, 3, 9),
        ("Mark", 3, 4, -2i32 as u32),
        ("Share", 3, 0, bits(0.5)),
    ] {
        let params = format!("spot: {spot}, element: {element}, word: {word}, bits: {bits}");
        for side in Side::ALL {
            let mut executor = executor(&file(&params, side), &settings(side, true));
            run(&mut executor, 0).unwrap_or_else(|error| panic!("{spot}: {error}"));
        }
    }
}

#[test]
fn an_index_is_compared_with_the_nearest_list_of_its_node_or_of_what_that_reads() {
    let bad = |listing: &str, picking: &str| {
        let text = format!(
            r#"Graph(version: 1, nodes: {{
                "listing": (kind: "listing", params: (place: {listing})),
                "picking": (kind: "picking", inputs: {{ "of": "listing.place" }}, params: (place: {picking})),
            }}, outputs: {{ "image": "picking.place" }})"#
        );
        let file = GraphFile::parse("places.ron", &text).unwrap();
        match run(&mut executor(&file, &settings(Side::Cpu, true)), 0) {
            Err(RunError::Watch(bad)) => Some((bad.port, bad.element, bad.value)),
            found => found.map(|()| None).unwrap(),
        }
    };
    let at = |port: &str, element, value: &str| Some((port.to_owned(), element, value.to_owned()));
    assert_eq!(bad("2", "2"), None);
    assert_eq!(bad("3", "0"), at("listing.place", 0, "3"));
    assert_eq!(bad("0", "3"), at("picking.place", 0, "3"));
    // A listing's place and pixel.
    assert_eq!(bad("2, pixel: 90", "0"), None);
    assert_eq!(bad("2, pixel: 91", "0"), at("listing.pixel", 0, "91"));
    // A check of an element that does not exist has no numbers to show.
    assert_eq!(bad("99", "0"), at("listing.place", 1, "missing: there are 1"));
}

#[test]
fn what_others_left_in_shared_memory_is_not_found() {
    // `last` has the memory of `first` and writes nothing.
    let text = r#"Graph(version: 1, nodes: {
        "first": (kind: "lazy", params: (wild: true)),
        "middle": (kind: "lazy", inputs: { "of": "first.numbers" }),
        "last": (kind: "lazy", inputs: { "of": "middle.numbers" }),
    }, outputs: { "image": "last.numbers" })"#;
    let file = GraphFile::parse("lazy.ron", text).unwrap();
    let last = |watch: bool| {
        let mut executor = executor(&file, &settings(Side::Cpu, watch));
        run(&mut executor, 0).unwrap();
        executor.snapshot("image", "").unwrap().unwrap().get::<f32>()[0]
    };
    assert!(last(false).is_nan());
    assert_eq!(last(true), 0.0);
}

#[test]
fn a_node_on_the_other_side_that_takes_a_bad_value_is_not_blamed() {
    for (side, hand) in [(Side::Gpu, Side::Cpu), (Side::Cpu, Side::Gpu), (Side::Cpu, Side::Cpu)] {
        let file = file(&format!("spot: Depth, element: 9, bits: {NAN}, frame: 2"), hand);
        // On the CPU, what comes after even fails, because of it.
        let bad = found(&file, side);
        assert_eq!((&*bad.node, bad.side, bad.element), ("spoil", side, 9));
    }
}

#[test]
fn a_frame_with_a_bad_value_runs_to_its_end_and_counts() {
    for side in Side::ALL {
        let file = file(&format!("spot: Light, element: 9, bits: {NAN}, frame: 1"), side);
        let mut executor = executor(&file, &settings(side, true));
        run(&mut executor, 0).unwrap();
        assert!(matches!(run(&mut executor, 1), Err(RunError::Watch(_))));
        assert_eq!(executor.frames(), 2);
        assert_eq!(executor.snapshot("image", "").unwrap().unwrap().frame, 1);
        assert!(matches!(run(&mut executor, 2), Err(RunError::Watch(_))), "it is still bad");
    }
}

#[test]
fn without_watching_nothing_is_found_and_nothing_is_different() {
    let bad = file(&format!("spot: Light, element: 9, bits: {NAN}"), Side::Cpu);
    for side in Side::ALL {
        let mut executor = executor(&bad, &settings(side, false));
        run(&mut executor, 0).unwrap();
        let [(_, plain), (_, watched)] =
            [false, true].map(|watch| compile(&bad, &registry(), &settings(side, watch)).unwrap());
        assert_eq!(plain, watched);
    }
}

fn shader(source: String, defines: &[&'static str]) -> Shader {
    let defines = defines.iter().map(|&define| define.into()).collect();
    Shader { defines, ..Shader::new("test.wgsl", source) }
}

/// A shader with this line in it.
fn with_line(line: &str) -> String {
    format!(
        "@group(0) @binding(0) var<storage, read_write> out: array<f32>;
        @compute @workgroup_size(64) fn main(@builtin(global_invocation_id) id: vec3<u32>) {{
            let i = id.x;
            if i < arrayLength(&out) {{ out[i] = 1.0; }}
        {line}
        }}"
    )
}

fn composed(line: &str, defines: &[&'static str]) -> Result<epigraph_core::Reflected, GraphError> {
    compose_shader(&shader(with_line(line), defines), &ShaderLibrary::default(), Default::default())
}

#[test]
fn a_check_is_a_blank_line_unless_the_run_is_watched() {
    let line = "    #check out[i]: out[i] > 0.0, \"it is positive\"";
    let plain = composed("", &[]).unwrap();
    let checked = composed(line, &[]).unwrap();
    assert_eq!(format!("{:?}", plain.module), format!("{:?}", checked.module));
    assert!(checked.variable("watch_checks").is_none());
    let watched = composed(line, &["WATCH"]).unwrap();
    assert!(watched.variable("watch_checks").is_some());
    assert!(composed("", &["WATCH"]).unwrap().variable("watch_checks").is_none());
    // What a check names is looked at only where it is kept.
    assert!(composed("#check out[i]: nothing > 0.0, \"it is positive\"", &[]).is_ok());
    let error =
        composed("#check out[i]: nothing > 0.0, \"it is positive\"", &["WATCH"]).unwrap_err().to_string();
    assert!(error.contains("nothing") && error.contains("test.wgsl: line 5"), "{error}");
}

#[test]
fn a_check_that_is_written_wrongly_is_refused_in_any_run() {
    for line in [
        "#check",
        "#check out",
        "#check out[i] : true",
        "#check out[i]: true",
        "#check out[i]: true, it is",
        "#check out[i] true, \"it is\"",
        "#check out[]: true, \"it is\"",
        "#check [i]: true, \"it is\"",
        "#check out[i]: , \"it is\"",
        "#check out[i]: true, \"\"",
        "#check out[i: true, \"it is\"",
    ] {
        for defines in [&[][..], &["WATCH"]] {
            let error =
                composed(line, defines).err().unwrap_or_else(|| panic!("{line} is taken")).to_string();
            assert!(
                error.contains("#check PORT[ELEMENT]: CONDITION") && error.contains("line 5"),
                "{line}: {error}"
            );
        }
    }
    let nested =
        "#check out[select(i, 0u, out[i] > 2.0)]: all(vec2(out[i], 1.0) > vec2(0.0)), \"it is, say, 1\"";
    assert!(composed(nested, &["WATCH"]).is_ok());
}

/// A stage whose shader has a check of another port.
struct Astray;

impl Stage for Astray {
    const KIND: &'static str = "astray";
    const DOC: &'static str = "Checks what it does not write.";
    type Params = ();

    fn declare((): &(), io: &mut Io) -> Self {
        io.shader(shader(with_line("#check out[i]: true, \"so\"\n#check our[i]: true, \"it is\""), &[]));
        let out = io.write::<f32>("out", "Ones.", Extent::Frame(1));
        io.dispatch("main", out);
        Self
    }

    fn cpu(&self, (): &(), _: &CpuContext) -> Result<(), String> {
        Ok(())
    }
}

#[test]
fn a_check_of_what_the_stage_does_not_write_is_refused() {
    let registry = Registry::default().with::<Astray>();
    let text =
        r#"Graph(version: 1, nodes: { "astray": (kind: "astray") }, outputs: { "image": "astray.out" })"#;
    let file = GraphFile::parse("astray.ron", text).unwrap();
    let settings = settings(Side::Gpu, true);
    let (graph, plan) = compile(&file, &registry, &settings).unwrap();
    let wrong = check_stage(&*graph.nodes[0].stage, &registry.library);
    assert_eq!(wrong.len(), 1, "{wrong:?}");
    let text = wrong[0].to_string();
    assert!(text.contains("unknown output `our`, did you mean `out`?") && text.contains("line 6"), "{text}");
    // Of what it becomes, all is marked; each check has its own words.
    assert!(text.ends_with("in `if !(true) { atomicMin(&watch_checks[64], u32(i)); }`"), "{text}");
    let GraphError::Shader { place: Some(place), .. } = &wrong[0] else { panic!("{text}") };
    assert_eq!(place.length, place.text.len());
    let error =
        Executor::new(graph, plan, &settings, &registry, Some(gpu())).err().expect("it cannot be watched");
    assert!(error.to_string().contains("`our`"), "{error}");
}
