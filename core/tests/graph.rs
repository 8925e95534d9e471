//! Checker and compiler on graphs of stages that do nothing: what is refused, what is left out, in which order, in how
//! much memory. No GPU takes part.

use epigraph_core::{
    Access, CpuContext, Extent, Fact, Facts, GraphFile, Io, Problems, Quantity, Registry, Settings, Shader,
    Side, Stage, Step, choice, compile, params, scratch, texel,
};

const CAMERA_MOVES: Fact = Fact { name: "camera_moves" };
const PRINTERS: Quantity = Quantity { name: "printers", one: "printer" };
const SHEETS: Quantity = Quantity { name: "sheets", one: "sheet of paper" };

macro_rules! stage {
    ($name:ident, $kind:literal, |$io:ident| $declare:expr $(, needless: $needless:expr)?) => {
        struct $name;
        impl Stage for $name {
            const KIND: &'static str = $kind;
            const DOC: &'static str = "A stage of the tests.";
            type Params = ();
            fn declare((): &(), $io: &mut Io) -> Self {
                $declare;
                Self
            }
            fn cpu(&self, (): &(), _: &CpuContext) -> Result<(), String> {
                Ok(())
            }
            $(fn needless((): &(), facts: &Facts) -> Option<&'static str> {
                let needless: fn(&Facts) -> Option<&'static str> = $needless;
                needless(facts)
            })?
        }
    };
}

epigraph_core::meanings! {
    /// Distance, metres.
    DEPTH = "depth";
}

stage!(Deep, "deep", |io| {
    io.write::<f32>("out", DEPTH, Extent::Frame(1));
    io.write::<f32>("far", DEPTH.doc("The same, doubled."), Extent::Frame(1));
    io.write::<u32>("sums", scratch("Sums by row."), Extent::Fixed([8, 1]));
});
stage!(Source, "source", |io| io.write::<f32>("out", "numbers", Extent::Frame(1)));
stage!(Small, "small", |io| io.write::<f32>("out", "numbers", Extent::Frame(4)));
stage!(Picture, "picture", |io| io.write::<texel::R32Float>("out", "a texture", Extent::Frame(1)));
stage!(Filter, "filter", |io| {
    io.read::<f32>("in", "numbers", Extent::Frame(1));
    io.write::<f32>("out", "numbers", Extent::Like("in".into()));
});
stage!(Shrink, "shrink", |io| {
    io.read::<f32>("in", "numbers", Extent::Any);
    io.write::<u32>("out", "whole numbers", Extent::Fixed([3, 2]));
});
stage!(Mark, "mark", |io| {
    io.read::<f32>("in", "numbers", Extent::Any);
    io.write::<u32>("bits", "one for each number", Extent::BitsOf("in".into()));
});
stage!(Pick, "pick", |io| {
    io.read::<f32>("in", "numbers", Extent::Any);
    io.read::<u32>("bits", "one for each number", Extent::BitsOf("in".into()));
    io.write::<f32>("out", "the marked ones", Extent::Like("in".into()));
});
stage!(Print, "print", |io| io.write::<f32>("out", "one for each sheet", SHEETS.list()));
stage!(Read, "read", |io| {
    io.read::<f32>("in", "one for each sheet", SHEETS.list());
    io.write::<f32>("out", "numbers", Extent::Like("in".into()));
});
stage!(Double, "double", |io| {
    let out = io.write::<f32>("out", "numbers", Extent::Frame(1));
    io.shader(Shader::new("double.wgsl", "@group(0) @binding(0) var<storage, read_write> out: array<f32>;"));
    io.dispatch("main", out);
});
stage!(List, "list", |io| {
    let out = io.write::<f32>("out", "numbers", Extent::Frame(1));
    let list = io.write::<[f32; 4]>("list", scratch("colours, or a list of numbers"), Extent::Frame(1));
    io.extent_on_cpu(list, Extent::Frame(2));
    io.shader(Shader::new(
        "list.wgsl",
        "@group(0) @binding(0) var<storage, read_write> out: array<f32>;
         @group(0) @binding(1) var<storage, read_write> list: array<vec4<f32>>;",
    ));
    io.dispatch("main", out);
});
stage!(Change, "change", |io| io.update::<f32>("data", "changed in place", Extent::Any));
stage!(Memory, "memory", |io| io.persistent::<f32>("out", "kept", Extent::PerPixel(0.5)));
stage!(Hundredth, "hundredth", |io| io.write::<f32>("out", "some", Extent::PerPixel(0.01)));
stage!(Most, "most", |io| io.write::<f32>("out", "many", Extent::PerPixel(0.7)));
stage!(Delay, "delay", |io| {
    io.history::<f32>("last", "last frame's", Extent::Any);
    io.write::<f32>("out", "numbers", Extent::Frame(1));
});
stage!(
    Moving,
    "moving",
    |io| {
        io.read::<f32>("in", "numbers", Extent::Any);
        io.write::<f32>("out", "numbers", Extent::Frame(1));
    },
    needless: |facts| (facts.holds(CAMERA_MOVES) == Some(false)).then_some("the camera does not move")
);
stage!(Guess, "guess", |io| io.write::<u32>("out", "a guess", Extent::Frame(2)),
    needless: |facts| (facts.holds(CAMERA_MOVES) == Some(false)).then_some("the camera does not move"));
stage!(
    Turn,
    "turn",
    |io| {
        io.read::<u32>("guess", "a guess", Extent::Any);
        io.update::<f32>("data", "changed in place", Extent::Any);
    },
    needless: |facts| (facts.holds(CAMERA_MOVES) == Some(false)).then_some("the camera does not move")
);
stage!(Maybe, "maybe", |io| {
    io.read::<f32>("in", "numbers", Extent::Any);
    io.optional::<u32>("hint", "may be missing", Extent::Any);
    io.write::<f32>("out", "numbers", Extent::Frame(1));
});
stage!(Shadow, "shadow", |io| {
    io.optional::<f32>("in", "may be missing", Extent::Any);
    io.write::<f32>("out", "as many", Extent::Like("in".into()));
});
stage!(Tell, "tell", |io| {
    io.read::<u32>("in", "numbers", Extent::Any);
    io.write::<f32>("out", "numbers", Extent::Frame(1));
});
stage!(Helper, "helper", |io| {
    if io.optional::<u32>("hint", "may be missing", Extent::Any).is_some() {
        io.write::<u32>("work", scratch("only with a hint"), Extent::Frame(4));
    }
    io.write::<f32>("out", "numbers", Extent::Frame(1));
    io.write::<u32>("sums", scratch("sums"), Extent::Fixed([8, 1]));
});
stage!(Cloud, "cloud", |io| {
    let mut cloud = io.bundle(Access::Write, "points", "a structure of arrays", Extent::PerPixel(1.5));
    cloud.write::<[f32; 4]>("position");
    cloud.write::<u32>("age");
    cloud.persistent();
});
stage!(Aging, "aging", |io| {
    let mut cloud = io.bundle(Access::Update, "points", "ages change", Extent::Any);
    cloud.write::<u32>("age");
});
stage!(Splat, "splat", |io| {
    let mut cloud = io.bundle(Access::Read, "points", "where they are", Extent::Any);
    cloud.read::<[f32; 4]>("position");
    io.write::<f32>("out", "a picture", Extent::Frame(1));
});

params! {
    /// Parameters of [`Choosy`].
    pub struct ChoosyParams {
        /// Whether it takes whole numbers, if it has a hint.
        whole: bool = false;
    }
}

/// Takes whole numbers, if it is set to and has a hint.
struct Choosy;

impl Stage for Choosy {
    const KIND: &'static str = "choosy";
    const DOC: &'static str = "A stage of the tests.";
    type Params = ChoosyParams;
    fn declare(params: &ChoosyParams, io: &mut Io) -> Self {
        let hint = io.optional::<u32>("hint", "may be missing", Extent::Any);
        if params.whole && hint.is_some() {
            io.read::<u32>("in", "numbers", Extent::Any);
        } else {
            io.read::<f32>("in", "numbers", Extent::Any);
        }
        io.write::<f32>("out", "numbers", Extent::Frame(1));
        Self
    }
    fn cpu(&self, _: &ChoosyParams, _: &CpuContext) -> Result<(), String> {
        Ok(())
    }
}

params! {
    /// Parameters of [`Row`].
    pub struct RowParams {
        /// Numbers in it.
        length: u32 = 1, in 1..=9;
    }
}

choice! {
    /// A kind of number.
    enum Form { Float, Signed, Whole }
}

params! {
    /// Parameters of [`Take`].
    pub struct TakeParams {
        /// What it takes.
        form: Form = Form::Float;
    }
}

/// Takes one kind of number, and whole ones besides.
struct Take;

impl Stage for Take {
    const KIND: &'static str = "take";
    const DOC: &'static str = "A stage of the tests.";
    type Params = TakeParams;
    fn declare(params: &TakeParams, io: &mut Io) -> Self {
        io.optional::<u32>("hint", "may be missing", Extent::Any);
        match params.form {
            Form::Float => drop(io.read::<f32>("in", "numbers", Extent::Any)),
            Form::Signed => drop(io.read::<i32>("in", "numbers", Extent::Any)),
            Form::Whole => drop(io.read::<u32>("in", "numbers", Extent::Any)),
        }
        io.write::<f32>("out", "numbers", Extent::Frame(1));
        Self
    }
    fn cpu(&self, _: &TakeParams, _: &CpuContext) -> Result<(), String> {
        Ok(())
    }
}

params! {
    /// Parameters of [`Give`].
    pub struct GiveParams {
        /// Whether its numbers are whole.
        whole: bool = false;
    }
}

/// Gives one of two kinds of numbers, and whole ones besides.
struct Give;

impl Stage for Give {
    const KIND: &'static str = "give";
    const DOC: &'static str = "A stage of the tests.";
    type Params = GiveParams;
    fn declare(params: &GiveParams, io: &mut Io) -> Self {
        io.write::<u32>("rest", "whole numbers", Extent::Frame(1));
        if params.whole {
            io.write::<u32>("out", "numbers", Extent::Frame(1));
        } else {
            io.write::<f32>("out", "numbers", Extent::Frame(1));
        }
        Self
    }
    fn cpu(&self, _: &GiveParams, _: &CpuContext) -> Result<(), String> {
        Ok(())
    }
}

/// Has both forms; that of the GPU is for cameras at rest.
struct Restful;

impl Stage for Restful {
    const KIND: &'static str = "restful";
    const DOC: &'static str = "A stage of the tests.";
    type Params = ();
    fn declare((): &(), io: &mut Io) -> Self {
        let out = io.write::<f32>("out", "numbers", Extent::Frame(1));
        io.shader(Shader::new(
            "restful.wgsl",
            "@group(0) @binding(0) var<storage, read_write> out: array<f32>;",
        ));
        io.dispatch("main", out);
        Self
    }
    fn cpu(&self, (): &(), _: &CpuContext) -> Result<(), String> {
        Ok(())
    }
    fn unable((): &(), side: Side, facts: &Facts) -> Option<&'static str> {
        (side == Side::Gpu && facts.holds(CAMERA_MOVES) == Some(true)).then_some("the camera moves")
    }
}

/// A row of numbers.
struct Row;

impl Stage for Row {
    const KIND: &'static str = "row";
    const DOC: &'static str = "A stage of the tests.";
    type Params = RowParams;
    fn declare(params: &RowParams, io: &mut Io) -> Self {
        io.write::<f32>("out", "numbers", Extent::Fixed([params.length, 1]));
        Self
    }
    fn cpu(&self, _: &RowParams, _: &CpuContext) -> Result<(), String> {
        Ok(())
    }
}

fn registry() -> Registry {
    Registry::default()
        .with::<Row>()
        .with::<Take>()
        .with::<Give>()
        .with::<Restful>()
        .with::<Source>()
        .with::<Small>()
        .with::<Picture>()
        .with::<Filter>()
        .with::<Shrink>()
        .with::<Mark>()
        .with::<Pick>()
        .with::<Print>()
        .with::<Read>()
        .with::<Change>()
        .with::<Double>()
        .with::<List>()
        .with::<Memory>()
        .with::<Hundredth>()
        .with::<Most>()
        .with::<Delay>()
        .with::<Moving>()
        .with::<Guess>()
        .with::<Maybe>()
        .with::<Turn>()
        .with::<Choosy>()
        .with::<Tell>()
        .with::<Helper>()
        .with::<Shadow>()
        .with::<Cloud>()
        .with::<Aging>()
        .with::<Splat>()
}

fn settings() -> Settings {
    Settings::new([64, 48], 10, Facts::none().stating(CAMERA_MOVES, false))
}

fn file(nodes: &str, output: &str) -> GraphFile {
    let text = format!(
        "#![enable(implicit_some)]\nGraph(version: 1, nodes: {{\n{nodes}\n}}, outputs: {{ \"image\": \"{output}\" }})"
    );
    GraphFile::parse("test.ron", &text).unwrap_or_else(|problems| panic!("{problems}"))
}

fn compiled(nodes: &str, output: &str, settings: &Settings) -> (epigraph_core::Graph, epigraph_core::Plan) {
    compile(&file(nodes, output), &registry(), settings).unwrap_or_else(|problems| panic!("{problems}"))
}

fn problems(nodes: &str, output: &str) -> Problems {
    problems_with(nodes, output, &settings())
}

fn problems_with(nodes: &str, output: &str, settings: &Settings) -> Problems {
    compile(&file(nodes, output), &registry(), settings).err().expect("the graph is broken")
}

fn order(nodes: &str, output: &str) -> Vec<String> {
    let (_, plan) = compiled(nodes, output, &settings());
    let runs = plan.steps.iter().filter(|step| matches!(step, Step::Run(_)));
    runs.map(|step| plan.step_name(step)).collect()
}

#[test]
fn readers_run_before_the_updater_that_overwrites() {
    let nodes = r#"
        "both": (kind: "maybe", inputs: { "in": "old.out" }),
        "change": (kind: "change", inputs: { "data": "source.out" }),
        "old": (kind: "filter", inputs: { "in": "source.out" }),
        "new": (kind: "filter", inputs: { "in": "change.data" }),
        "source": (kind: "source"),"#;
    assert_eq!(order(nodes, "new.out"), ["source", "change", "new"]);
    let nodes = nodes.replace("\"old.out\" }", "\"old.out\", \"hint\": \"shrink.out\" }")
        + r#""shrink": (kind: "shrink", inputs: { "in": "new.out" }),"#;
    assert_eq!(order(&nodes, "both.out"), ["source", "old", "change", "new", "shrink", "both"]);
}

#[test]
fn kept_memory_keeps_its_updaters() {
    let nodes = r#"
        "cloud": (kind: "cloud"),
        "splat": (kind: "splat", inputs: { "points": "cloud.points" }),
        "aging": (kind: "aging", inputs: { "points": "cloud.points" }),
        "unused": (kind: "source"),"#;
    assert_eq!(order(nodes, "splat.out"), ["cloud", "splat", "aging"]);
    let (graph, plan) = compiled(nodes, "splat.out", &settings());
    assert_eq!(graph.culled.len(), 1);
    assert_eq!(plan.culled[0].node, "unused");
    // A bundle passed on by an updater of one field still has all fields.
    let nodes = nodes.replace(
        "\"points\": \"cloud.points\" }),\n        \"aging\"",
        "\"points\": \"aging.points\" }),\n        \"aging\"",
    );
    assert_eq!(order(&nodes, "splat.out"), ["cloud", "aging", "splat"]);
}

#[test]
fn transients_share_memory_when_their_lives_do_not_overlap() {
    let chain: String = (1..=6)
        .map(|n| {
            format!(
                "\"f{n}\": (kind: \"filter\", inputs: {{ \"in\": \"{}.out\" }}),",
                if n == 1 { "s".into() } else { format!("f{}", n - 1) }
            )
        })
        .collect();
    let nodes = format!("\"s\": (kind: \"source\"), {chain}");
    let (_, plan) = compiled(&nodes, "f6.out", &settings());
    assert_eq!(plan.slots.cpu.len(), 2);
    let image = 64 * 48 * 4;
    assert_eq!((plan.bytes(Side::Cpu), plan.pooled_bytes(Side::Cpu)), (2 * image, 5 * image));
    let (_, plan) = compiled(&nodes, "f6.out", &Settings { pooling: false, ..settings() });
    assert_eq!((plan.bytes(Side::Cpu), plan.pooled_bytes(Side::Cpu)), (7 * image, 0));
}

#[test]
fn on_the_cpu_a_transient_takes_the_memory_of_a_larger_one() {
    let nodes = r#"
        "large": (kind: "source"),
        "few": (kind: "shrink", inputs: { "in": "large.out" }),
        "print": (kind: "print"),
        "read": (kind: "read", inputs: { "in": "print.out" }),
        "both": (kind: "maybe", inputs: { "in": "read.out", "hint": "few.out" }),"#;
    let facts = Facts::none().with(SHEETS, 20);
    let (_, plan) = compiled(nodes, "both.out", &Settings { facts, ..settings() });
    let order: Vec<&str> = plan.order().map(|node| plan.nodes[node].name.as_str()).collect();
    assert_eq!(order, ["large", "few", "print", "read", "both"]);
    let [image, sheets, few] = [64 * 48 * 4, 20 * 4, 3 * 2 * 4];
    // When `print` writes, `large` has been read for the last time, and `both` is not yet written.
    let shared = image + sheets;
    assert_eq!((plan.bytes(Side::Cpu), plan.pooled_bytes(Side::Cpu)), (image + sheets + few, shared));
}

#[test]
fn history_breaks_cycles_and_keeps_two_copies() {
    let nodes = r#"
        "delay": (kind: "delay", inputs: { "last": "filter.out" }),
        "filter": (kind: "filter", inputs: { "in": "delay.out" }),"#;
    assert_eq!(order(nodes, "filter.out"), ["delay", "filter"]);
    let (_, plan) = compiled(nodes, "filter.out", &settings());
    assert_eq!(plan.slots.cpu.len(), 3);
    // Nothing is saved: both copies are there in every frame.
    assert_eq!((plan.bytes(Side::Cpu), plan.pooled_bytes(Side::Cpu)), (3 * 64 * 48 * 4, 0));
}

#[test]
fn the_scene_decides_what_is_left_out() {
    let nodes = r#"
        "source": (kind: "source"),
        "moving": (kind: "moving", inputs: { "in": "source.out" }),
        "guess": (kind: "guess"),
        "maybe": (kind: "maybe", inputs: { "in": "moving.out", "hint": "guess.out" }),"#;
    assert_eq!(order(nodes, "maybe.out"), ["source", "maybe"]);
    let (_, plan) = compiled(nodes, "maybe.out", &settings());
    let why: Vec<_> = plan.culled.iter().map(|culled| (culled.node.as_str(), culled.why.as_str())).collect();
    assert_eq!(why, [("moving", "the camera does not move"), ("guess", "the camera does not move")]);
    let mut all = settings();
    all.prune = false;
    let (_, plan) = compiled(nodes, "maybe.out", &all);
    assert_eq!(plan.nodes.len(), 4);
    let mut moves = settings();
    moves.facts = Facts::none().stating(CAMERA_MOVES, true);
    let (_, plan) = compiled(nodes, "maybe.out", &moves);
    assert_eq!(plan.nodes.len(), 4);
    // What something still asks for stays, needless or not.
    assert_eq!(order(nodes, "guess.out"), ["guess"]);
    // That it is asked for by what is needless itself is no reason.
    let nodes = r#"
        "source": (kind: "source"),
        "guess": (kind: "guess"),
        "turn": (kind: "turn", inputs: { "data": "source.out", "guess": "guess.out" }),
        "maybe": (kind: "maybe", inputs: { "in": "turn.data", "hint": "guess.out" }),"#;
    assert_eq!(order(nodes, "maybe.out"), ["source", "maybe"]);
}

#[test]
fn ports_are_found_by_name_when_a_stage_has_fewer_of_them() {
    // `second` is before `first` in the file: losing an input passes on against the file's order too.
    let nodes = r#"
        "guess": (kind: "guess"),
        "second": (kind: "helper", inputs: { "hint": "first.work" }),
        "first": (kind: "helper", inputs: { "hint": "guess.out" }),"#;
    for moves in [false, true] {
        let mut settings = settings();
        settings.facts = Facts::none().stating(CAMERA_MOVES, moves);
        for port in ["first.out", "first.sums", "second.out", "second.sums"] {
            settings.taps = vec![port.parse().unwrap()];
            let (graph, _) = compiled(nodes, "second.out", &settings);
            assert_eq!(graph.name(graph.taps[0].1), port);
            assert_eq!(graph.name(graph.outputs[0].1), "second.out");
        }
        let read = format!("{nodes} \"reader\": (kind: \"filter\", inputs: {{ \"in\": \"first.out\" }}),");
        settings.taps.clear();
        let (graph, _) = compiled(&read, "reader.out", &settings);
        let reader = graph.nodes.iter().find(|node| node.name == "reader").unwrap();
        let sources: Vec<_> = reader.sources.iter().flatten().map(|&source| graph.name(source)).collect();
        assert_eq!(sources, ["first.out"]);
        let read = format!("{nodes} \"tell\": (kind: \"tell\", inputs: {{ \"in\": \"first.work\" }}),");
        let lost = "does not exist now: nothing is connected to `hint`, since its source is left out";
        match compile(&file(&read, "tell.out"), &registry(), &settings) {
            Ok((graph, _)) => assert!(moves && graph.nodes.len() == 3),
            Err(problems) => {
                assert!(!moves && problems.0.len() == 1, "{problems}");
                assert_eq!(problems.0[0].node.as_deref(), Some("tell"));
                assert!(problems.to_string().contains(&format!("`first.work` {lost}")), "{problems}");
            }
        }
        let output = compile(&file(nodes, "first.work"), &registry(), &settings).err();
        assert_eq!(
            output.and_then(|problems| problems.0[0].port.clone()).as_deref(),
            (!moves).then_some("image")
        );
        for port in ["first.work", "second.work"] {
            settings.taps = vec![port.parse().unwrap()];
            let found = compile(&file(nodes, "second.out"), &registry(), &settings);
            if moves {
                let (graph, _) = found.unwrap();
                assert_eq!(graph.name(graph.taps[0].1), port);
            } else {
                let text = found.err().expect("not while the camera rests").to_string();
                assert!(text.contains(&format!("`{port}` {lost}")), "{text}");
            }
        }
    }
}

#[test]
fn a_side_that_the_scene_rules_out_is_left_to_the_other() {
    let side = |moves: Option<bool>, prefers: Side| {
        let facts = moves.map_or(Facts::none(), |moves| Facts::none().stating(CAMERA_MOVES, moves));
        let settings = Settings { side: prefers, facts, ..settings() };
        let (graph, _) = compiled(r#""r": (kind: "restful"),"#, "r.out", &settings);
        graph.nodes[0].side
    };
    for moves in [None, Some(false), Some(true)] {
        assert_eq!(side(moves, Side::Cpu), Side::Cpu);
        assert_eq!(side(moves, Side::Gpu), if moves == Some(true) { Side::Cpu } else { Side::Gpu });
    }
    // Who asks for that side is told why not.
    let moving = Settings { facts: Facts::none().stating(CAMERA_MOVES, true), ..settings() };
    let text = problems_with(r#""r": (kind: "restful", on: Gpu),"#, "r.out", &moving).to_string();
    assert!(text.contains("node `r`: cannot run on gpu: the camera moves"), "{text}");
    compiled(r#""r": (kind: "restful", on: Gpu),"#, "r.out", &settings());
}

#[test]
fn a_tap_keeps_what_the_scene_makes_needless() {
    let nodes = r#"
        "source": (kind: "source"),
        "moving": (kind: "moving", inputs: { "in": "source.out" }),
        "last": (kind: "filter", inputs: { "in": "moving.out" }),"#;
    let mut settings = settings();
    assert_eq!(order(nodes, "last.out"), ["source", "last"]);
    // Not the value of `source.out`, which has the same elements.
    settings.taps = vec!["moving.out".parse().unwrap()];
    let (graph, _) = compiled(nodes, "last.out", &settings);
    assert_eq!(graph.name(graph.taps[0].1), "moving.out");
}

#[test]
fn a_bypass_passes_the_input_on() {
    let nodes = r#"
        "source": (kind: "source"),
        "change": (kind: "change", bypass: true, inputs: { "data": "source.out" }),
        "filter": (kind: "filter", bypass: true, inputs: { "in": "change.data" }),
        "last": (kind: "filter", inputs: { "in": "filter.out" }),"#;
    assert_eq!(order(nodes, "last.out"), ["source", "last"]);
    let text = problems(r#""source": (kind: "source", bypass: true),"#, "source.out").to_string();
    assert!(text.contains("cannot be bypassed: the output `image` needs it"), "{text}");
}

#[test]
fn problems_are_reported_together() {
    let nodes = r#"
        "a": (kind: "sauce"),
        "b": (kind: "filter"),
        "c": (kind: "filter", inputs: { "inn": "d.out" }),
        "d": (kind: "filter", inputs: { "in": "e.oot" }),
        "e": (kind: "source", params: (x: 1)),
        "f": (kind: "filter", inputs: { "in": "picture.out" }),
        "picture": (kind: "picture"),
        "g": (kind: "filter", inputs: { "in": "pictura.out" }),
        "h": (kind: "filter", inputs: { "in": "picture.uut" }),"#;
    let text = problems(nodes, "zz.out").to_string();
    for wanted in [
        "test.ron:4:21: node `a`: unknown stage kind `sauce`, did you mean `source`?",
        "node `b`: input `in` (numbers) is not connected",
        "node `c`: unknown input `inn`, did you mean `in`?",
        "node `c`: input `in` (numbers) is not connected",
        "node `e`: unknown parameter `x`",
        "`picture.out` gives texture<r32float>, but `in` takes array<f32>",
        "unknown node `pictura`, did you mean `picture`?",
        "unknown output port `uut`, did you mean `out`?",
        "unknown node `zz`",
    ] {
        assert!(text.contains(wanted), "{wanted}\nnot in\n{text}");
    }
}

#[test]
fn settings_that_would_make_a_wire_fit_are_named_of_both_ends() {
    for (source, reader, expected) in [
        ("give", "take", None),
        ("give.whole: true", "take", Some("take.form=Whole or give.whole=false")),
        ("give", "take.form: Whole", Some("take.form=Float or give.whole=true")),
        // No value of the other end fits, or it has no parameters.
        ("give", "take.form: Signed", Some("take.form=Float")),
        ("source", "take.form: Whole", Some("take.form=Float")),
        ("give.whole: true", "filter", Some("give.whole=false")),
        ("picture", "filter", Some("")),
        // There is no setting for floats from an image.
        ("picture", "take", Some("")),
    ] {
        let node = |text: &str, inputs: &str| {
            let (kind, params) = text.split_once('.').unwrap_or((text, ""));
            format!(r#""{kind}": (kind: "{kind}", params: ({params}){inputs}),"#)
        };
        let name = reader.split('.').next().unwrap();
        let source_name = source.split('.').next().unwrap();
        let wire = format!(r#", inputs: {{ "in": "{source_name}.out" }}"#);
        let nodes = node(source, "") + &node(reader, &wire);
        let problems = compile(&file(&nodes, &format!("{name}.out")), &registry(), &settings()).err();
        let remedies = problems.map(|problems| {
            assert_eq!(problems.0.len(), 1, "{problems}");
            let text = problems.0[0].error.to_string();
            text.split_once("; it would fit with ").map_or(String::new(), |(_, remedies)| remedies.to_owned())
        });
        assert_eq!(remedies.as_deref(), expected, "{source} to {reader}");
    }
}

#[test]
fn a_setting_must_fit_with_the_inputs_that_are_connected() {
    // With a hint, `choosy` takes whole numbers if it is set to.
    let nodes = |hint: &str| {
        format!(
            r#""give": (kind: "give", params: (whole: true)), "guess": (kind: "guess"),
            "choosy": (kind: "choosy", params: (whole: false), inputs: {{ "in": "give.out" {hint} }}),"#
        )
    };
    for (hint, expected) in
        [("", "give.whole=false"), (r#", "hint": "guess.out""#, "choosy.whole=true or give.whole=false")]
    {
        let text = problems(&nodes(hint), "choosy.out").to_string();
        let (_, remedies) = text.lines().next().unwrap().split_once("; it would fit with ").expect(&text);
        assert_eq!(remedies, expected, "{hint}");
    }
}

#[test]
fn extents_must_fit() {
    let nodes = r#""small": (kind: "small"), "f": (kind: "filter", inputs: { "in": "small.out" }),"#;
    let problems = problems(nodes, "f.out");
    assert_eq!(problems.0[0].port.as_deref(), Some("in"));
    let text = problems.to_string();
    assert!(text.contains("`small.out` is 16x12, but `in` takes 64x48 (one per pixel)"), "{text}");
}

#[test]
fn lists_are_as_long_as_the_application_states() {
    let nodes = r#""print": (kind: "print"), "read": (kind: "read", inputs: { "in": "print.out" }),"#;
    // Lists are never empty, so that they can be bound.
    let stating = |count| Settings { facts: Facts::none().with(SHEETS, count), ..settings() };
    for (stated, length) in [(0, 1), (1, 1), (37, 37)] {
        let (graph, _) = compiled(nodes, "read.out", &stating(stated));
        assert!(graph.nodes.iter().flat_map(|node| &node.dims).all(|dims| dims.count() == length));
    }
    // What is not stated is not zero.
    let text = problems(nodes, "read.out").to_string();
    assert!(text.contains("node `print`: the length of a list is one per sheet of paper, but"), "{text}");
    assert!(
        text.contains("does not state the number of sheets: add it to the facts in `Settings`"),
        "{text}"
    );
    // A crate of stages states its own, from what the application has stated.
    let registry = registry().with_count(SHEETS, |facts| Some(2 * facts.count(PRINTERS)?));
    let settings = Settings { facts: Facts::none().with(PRINTERS, 3), ..settings() };
    let (graph, _) = compile(&file(nodes, "read.out"), &registry, &settings).unwrap();
    assert_eq!(graph.nodes[graph.node("print").unwrap()].dims[0].count(), 6);
    let wrong = r#""source": (kind: "source"), "read": (kind: "read", inputs: { "in": "source.out" }),"#;
    let text = problems_with(wrong, "read.out", &stating(5)).to_string();
    assert!(text.contains("but `in` takes 5x1 (a list of one per sheet of paper)"), "{text}");
    let text = problems(wrong, "read.out").to_string();
    assert!(text.contains("node `read`: the length of a list is one per sheet of paper, but"), "{text}");
}

#[test]
fn shares_of_the_pixels_are_rounded_to_the_nearest() {
    let nodes = r#""hundredth": (kind: "hundredth"), "most": (kind: "most"),"#;
    // 655.36 and 45875.2; 0.05 and 3.5, which 0.7 as f32 falls short of.
    for (size, lengths) in [([256, 256], [655, 45_875]), ([5, 1], [1, 4])] {
        let settings = Settings { prune: false, ..Settings::new(size, 0, Facts::none()) };
        let settings = Settings { taps: vec!["most.out".parse().unwrap()], ..settings };
        let (graph, _) = compiled(nodes, "hundredth.out", &settings);
        let length = |name| graph.nodes[graph.node(name).unwrap()].dims[0].count();
        assert_eq!([length("hundredth"), length("most")], lengths, "{size:?}");
    }
}

#[test]
fn the_twin_of_a_shader_may_need_less_memory() {
    let node = r#""list": (kind: "list"),"#;
    for (side, elements) in [(Side::Cpu, [64 * 48, 32 * 24]), (Side::Gpu, [64 * 48, 64 * 48])] {
        let (graph, plan) = compiled(node, "list.out", &Settings { side, ..settings() });
        let list = &graph.nodes[graph.node("list").unwrap()];
        assert_eq!(list.side, side);
        assert_eq!([0, 1].map(|port| list.dims[port].count()), elements);
        assert_eq!(plan.bytes(side), (4 * elements[0] + 16 * elements[1]) as u64);
    }
}

#[test]
fn lists_of_bits_have_one_for_each_element() {
    let nodes = r#"
        "source": (kind: "source"),
        "small": (kind: "small"),
        "mark": (kind: "mark", inputs: { "in": "source.out" }),
        "pick": (kind: "pick", inputs: { "in": "source.out", "bits": "mark.bits" }),"#;
    for (size, words) in [([64, 48], 96), ([1, 1], 1), ([8, 4], 1), ([11, 3], 2)] {
        let (graph, _) = compiled(nodes, "pick.out", &Settings::new(size, 10, Facts::none()));
        let mark = &graph.nodes[graph.node("mark").unwrap()];
        assert_eq!((mark.dims[1].width, mark.dims[1].height), (words, 1), "{size:?}");
    }
    let wrong = nodes
        .replace("\"mark\", inputs: { \"in\": \"source.out\"", "\"mark\", inputs: { \"in\": \"small.out\"");
    let problems = problems(&wrong, "pick.out").to_string();
    assert!(
        problems.contains("96x1 (a list of one per 32 of `in`)") && problems.contains("6x1"),
        "{problems}"
    );
}

#[test]
fn what_is_as_long_as_an_input_has_one_element_without_it() {
    for (nodes, bytes) in [
        (r#""shadow": (kind: "shadow")"#, 4),
        (
            r#""small": (kind: "small"), "shadow": (kind: "shadow", inputs: { "in": "small.out" })"#,
            4 * 16 * 12,
        ),
    ] {
        let (_, plan) = compiled(nodes, "shadow.out", &settings());
        let out = plan.storages.iter().find(|storage| storage.name == "shadow.out").unwrap();
        assert_eq!(out.bytes(), bytes);
    }
}

#[test]
fn cycles_and_double_updates_are_refused() {
    let nodes = r#"
        "x": (kind: "filter", inputs: { "in": "y.out" }),
        "y": (kind: "filter", inputs: { "in": "z.out" }),
        "z": (kind: "filter", inputs: { "in": "x.out" }),"#;
    let text = problems(nodes, "z.out").to_string();
    // Extents are found first, and these follow one another in a circle.
    assert!(text.starts_with("test.ron:4:9: node `x`: the extent of `x.in` depends on itself"), "{text}");
    let nodes = r#"
        "s": (kind: "source"),
        "m": (kind: "maybe", inputs: { "in": "s.out", "hint": "t.out" }),
        "t": (kind: "shrink", inputs: { "in": "m.out" }),"#;
    let text = problems(nodes, "t.out").to_string();
    assert!(
        text.contains("test.ron:5:9: node `m`: these nodes wait for each other within a frame: m -> t -> m"),
        "{text}"
    );
    // Nodes that only wait for the cycle are not part of it, whichever comes first in the file.
    let after = r#"
        "after": (kind: "filter", inputs: { "in": "m.out" }),"#;
    for nodes in [format!("{nodes}{after}"), format!("{after}{nodes}")] {
        let text = problems(&nodes, "after.out").to_string();
        assert!(
            text.contains("node `m`: these nodes wait for each other within a frame: m -> t -> m"),
            "{text}"
        );
    }
    let nodes = r#"
        "s": (kind: "memory"),
        "one": (kind: "change", inputs: { "data": "s.out" }),
        "two": (kind: "change", inputs: { "data": "s.out" }),"#;
    let text = problems(nodes, "two.data").to_string();
    assert!(text.contains("`s.out` is updated in place by both `one` and `two`"), "{text}");
    let nodes = r#"
        "s": (kind: "memory"),
        "delay": (kind: "delay", inputs: { "last": "s.out" }),"#;
    let text = problems(nodes, "delay.out").to_string();
    assert!(text.contains("`s.out` is kept or updated in place"), "{text}");
    // What is written anew and then changed has no value of the last frame either, before or after the change.
    for port in ["s.out", "c.data"] {
        let nodes = format!(
            r#"
        "s": (kind: "source"),
        "c": (kind: "change", inputs: {{ "data": "s.out" }}),
        "delay": (kind: "delay", inputs: {{ "last": "{port}" }}),
        "m": (kind: "mark", inputs: {{ "in": "c.data" }}),
        "p": (kind: "pick", inputs: {{ "in": "delay.out", "bits": "m.bits" }}),"#
        );
        let text = problems(&nodes, "p.out").to_string();
        assert!(text.contains(&format!("`{port}` is kept or updated in place")), "{text}");
    }
}

#[test]
fn sizes_and_latencies_have_bounds() {
    for size in [[0, 0], [0, 5], [100_000, 100_000], [16_385, 1]] {
        let settings = Settings::new(size, 0, Facts::none());
        let error =
            compile(&file("\"s\": (kind: \"source\"),", "s.out"), &registry(), &settings).err().unwrap();
        assert!(error.to_string().contains("each side must be 1 to 16384 pixels"), "{error}");
    }
    let nodes =
        r#""s": (kind: "source"), "f": (kind: "filter", download: Latent(99), inputs: { "in": "s.out" }),"#;
    let text = problems(nodes, "f.out").to_string();
    assert!(text.contains("1 to 16 frames late"), "{text}");
    let nodes = r#""s": (kind: "source", on: Gpu),"#;
    assert!(problems(nodes, "s.out").to_string().contains("this stage has no gpu form"));
    // Nodes that will not run are placed as well as others.
    let nodes = r#"
        "s": (kind: "source"),
        "idle": (kind: "source", on: Gpu),
        "late": (kind: "filter", download: Latent(99), inputs: { "in": "s.out" }),"#;
    let text = problems(nodes, "s.out").to_string();
    assert!(text.contains("this stage has no gpu form") && text.contains("1 to 16 frames late"), "{text}");
    let nodes = r#""d": (kind: "double", on: Gpu, download: Latent(2)),"#;
    let text = problems(nodes, "d.out").to_string();
    assert!(text.contains("test.ron:3:42: node `d`: `download` says how results of the GPU"), "{text}");
}

const PART: &str = r#"Graph(version: 1, nodes: {
    "first": (kind: "filter", inputs: { "in": "inputs.picture" }),
    "second": (kind: "maybe", inputs: { "in": "first.out", "hint": "inputs.hint" }),
}, outputs: { "result": "second.out" })"#;

fn with_parts(nodes: &str, output: &str, parts: &[(&str, &str)]) -> Result<GraphFile, Problems> {
    file(nodes, output).with_parts(&|path: &std::path::Path| {
        let name = path.display().to_string();
        let part = parts.iter().find(|(known, _)| *known == name);
        part.map(|(_, text)| (*text).to_owned()).ok_or(std::io::ErrorKind::NotFound.into())
    })
}

#[test]
fn a_part_stands_for_its_nodes() {
    let nodes = r#"
        "source": (kind: "source"),
        "blur": (kind: "graph", params: (file: "part.ron"), inputs: { "picture": "source.out" }),
        "last": (kind: "filter", inputs: { "in": "blur.result" }),
        "shrink": (kind: "shrink", inputs: { "in": "blur/first.out" }),
        "all": (kind: "maybe", inputs: { "in": "last.out", "hint": "shrink.out" }),"#;
    let file = with_parts(nodes, "all.out", &[("part.ron", PART)]).unwrap();
    let (graph, plan) =
        compile(&file, &registry(), &settings()).unwrap_or_else(|problems| panic!("{problems}"));
    let names: Vec<&str> = graph.nodes.iter().map(|node| node.name.as_str()).collect();
    assert_eq!(names, ["source", "blur/first", "blur/second", "last", "shrink", "all"]);
    let plain = r#"
        "source": (kind: "source"),
        "first": (kind: "filter", inputs: { "in": "source.out" }),
        "second": (kind: "maybe", inputs: { "in": "first.out" }),
        "last": (kind: "filter", inputs: { "in": "second.out" }),
        "shrink": (kind: "shrink", inputs: { "in": "first.out" }),
        "all": (kind: "maybe", inputs: { "in": "last.out", "hint": "shrink.out" }),"#;
    let (_, same) = compiled(plain, "all.out", &settings());
    assert_eq!((plan.steps, plan.slots), (same.steps, same.slots));
}

#[test]
fn parts_nest_and_taps_and_settings_reach_into_them() {
    let outer = r#"Graph(version: 1, nodes: {
        "inner": (kind: "graph", params: (file: "part.ron"), inputs: { "picture": "inputs.picture", "hint": "guess.out" }),
        "guess": (kind: "guess"),
    }, outputs: { "result": "inner.result" })"#;
    let nodes = r#"
        "source": (kind: "source"),
        "outer": (kind: "graph", params: (file: "outer.ron"), inputs: { "picture": "source.out" }),"#;
    let parts = [("outer.ron", outer), ("part.ron", PART)];
    let mut file = with_parts(nodes, "outer.result", &parts).unwrap();
    let mut settings = settings();
    settings.taps = ["outer/inner/first.out", "outer.result"].map(|name| name.parse().unwrap()).to_vec();
    settings.facts = Facts::none().stating(CAMERA_MOVES, true);
    let (graph, _) = compile(&file, &registry(), &settings).unwrap_or_else(|problems| panic!("{problems}"));
    assert_eq!(graph.nodes.len(), 4);
    assert_eq!(graph.name(graph.taps[0].1), "outer/inner/first.out");
    assert_eq!(graph.name(graph.taps[1].1), "outer/inner/second.out");
    file.set_param("outer/inner/second", "nothing", "1").unwrap();
    let text = compile(&file, &registry(), &settings).err().unwrap().to_string();
    assert!(text.starts_with("part.ron:3:"), "{text}");
    assert!(text.contains("node `outer/inner/second`: unknown parameter `nothing`"), "{text}");
}

#[test]
fn faults_around_parts_are_told_where_they_stand() {
    let source = "\"source\": (kind: \"source\"),\n";
    let message = |node: &str, output: &str, part: &str| {
        let nodes = format!("{source}{node}");
        let problems = with_parts(&nodes, output, &[("part.ron", part)])
            .and_then(|file| compile(&file, &registry(), &settings()).map(|_| ()));
        problems.expect_err("it is broken").to_string()
    };
    let include = r#""b": (kind: "graph", params: (file: "part.ron"), inputs: { "picture": "source.out" })"#;
    for (node, output, part, wanted) in [
        (
            include.replace("picture", "pictures"),
            "b.result",
            PART,
            "test.ron:4:60: node `b`: unknown input `pictures`, did you mean `picture`?",
        ),
        (include.replace("inputs", "bypass: true, inputs"), "b.result", PART, "a part cannot be bypassed"),
        (include.into(), "b.results", PART, "unknown output of a part `results`, did you mean `result`?"),
        (
            include.replace("part.ron", "no.ron"),
            "b.result",
            PART,
            "test.ron:4:37: node `b`: cannot read: no.ron: ",
        ),
        (include.replace("file", "fil"), "b.result", PART, "unknown parameter `fil`, did you mean `file`?"),
        (
            include.replace("params: (file: \"part.ron\"), ", ""),
            "b.result",
            PART,
            "a node of kind `graph` names its file",
        ),
        (
            include.replace(" \"picture\": \"source.out\" ", ""),
            "b.result",
            PART,
            "part.ron:2:5: node `b/first`: input `in` (numbers) is not connected",
        ),
        (include.into(), "b.result", "Graph(version: 1", "part.ron:1:"),
        (
            include.into(),
            "b.result",
            r#"Graph(version: 1, nodes: { "x": (kind: "graph", params: (file: "part.ron")) }, outputs: {})"#,
            "part.ron contains itself",
        ),
    ] {
        let text = message(&node, output, part);
        assert!(text.contains(wanted), "{wanted}\nnot in\n{text}");
    }
    // Read without its parts, the graph says so.
    let text = problems(&format!("{source}{include}"), "b.result").to_string();
    assert!(text.contains("its file has not been read"), "{text}");
}

#[test]
fn a_node_of_a_part_may_be_called_by_its_own_name() {
    let outer = r#"Graph(version: 1, nodes: {
        "inner": (kind: "graph", params: (file: "part.ron"), inputs: { "picture": "inputs.picture" }),
    }, outputs: { "result": "inner.result" })"#;
    let nodes = r#"
        "source": (kind: "source"),
        "outer": (kind: "graph", params: (file: "outer.ron"), inputs: { "picture": "source.out" }),
        "first": (kind: "filter", inputs: { "in": "outer.result" }),
        "twice": (kind: "graph", params: (file: "part.ron"), inputs: { "picture": "first.out" }),"#;
    let parts = [("outer.ron", outer), ("part.ron", PART)];
    let file = with_parts(nodes, "twice.result", &parts).unwrap();
    // Its own node comes first; what several parts have is nobody's.
    for (name, address) in [
        ("source", "source"),
        ("inner", "outer/inner"),
        ("first", "first"),
        ("second", "second"),
        ("outer/inner/second", "outer/inner/second"),
        ("inner/second", "outer/inner/second"),
        ("nobody", "nobody"),
    ] {
        assert_eq!(file.address_of(name), address);
    }
}

/// A part whose one node has a parameter, and a graph of a part that holds it.
const ROW: &str = r#"Graph(version: 1, nodes: {
    "row": (kind: "row", params: (length: 2)),
}, outputs: { "out": "row.out" })"#;
const ROWS: &str = r#"Graph(version: 1, nodes: {
    "one": (kind: "graph", params: (file: "row.ron"), set: { "row": (length: 3) }),
}, outputs: { "out": "one.out" })"#;

fn rows(set: &str) -> Result<GraphFile, Problems> {
    let nodes = format!(r#""rows": (kind: "graph", params: (file: "rows.ron"), {set}),"#);
    with_parts(&nodes, "rows.out", &[("rows.ron", ROWS), ("row.ron", ROW)])
}

fn row_length(file: &GraphFile) -> u32 {
    let (_, plan) = compile(file, &registry(), &settings()).unwrap_or_else(|problems| panic!("{problems}"));
    plan.storages.iter().find(|storage| storage.name == "rows/one/row.out").expect("it is there").dims.width
}

#[test]
fn a_graph_sets_parameters_in_its_parts() {
    assert_eq!(row_length(&rows("").unwrap()), 3);
    // Outer files have the last word.
    assert_eq!(row_length(&rows(r#"set: { "one/row": (length: 4) }"#).unwrap()), 4);
    for set in ["", r#"set: { "one/row": (length: 4) }"#] {
        let mut file = rows(set).unwrap();
        file.set_param("rows/one/row", "length", "5").unwrap();
        assert_eq!(row_length(&file), 5);
        assert_eq!(file.text.contains("length: 5"), !set.is_empty(), "set where it was set: {}", file.text);
    }
}

#[test]
fn faults_in_what_is_set_are_told_where_it_is_set() {
    for (set, wanted) in [
        (
            r#"set: { "one/row": (length: 0) }"#,
            "test.ron:3:80: node `rows/one/row`: parameter `length` is 0, outside 1 to 9",
        ),
        (
            r#"set: { "one/row": (lenght: 4) }"#,
            "test.ron:3:72: node `rows/one/row`: unknown parameter `lenght`, did you mean `length`?",
        ),
        (r#"set: { "one/rows": (length: 4) }"#, "test.ron:3:60: node `rows`: unknown node `one/rows`"),
    ] {
        let file = rows(set).unwrap();
        let text = compile(&file, &registry(), &settings()).err().expect("it is broken").to_string();
        assert!(text.contains(wanted), "{wanted}\nnot in\n{text}");
    }
    let node = r#""s": (kind: "source", set: { "x": (a: 1) }),"#;
    assert!(problems(node, "s.out").to_string().contains("`set` is for parts and repeated nodes"));
    let node = r#"Graph(version: 1, nodes: { "b": (kind: "graph", set: { "x": 4 }) }, outputs: {})"#;
    let text = GraphFile::parse("test.ron", node).expect_err("it is broken").to_string();
    assert!(text.contains("expected (name: value, ...), found `4`"), "{text}");
}

#[test]
fn a_parts_placement_is_its_nodes_default() {
    let nodes = r#"
        "source": (kind: "source"),
        "blur": (kind: "graph", on: Cpu, download: Latent(2), params: (file: "part.ron"), inputs: { "picture": "source.out" }),"#;
    let file = with_parts(nodes, "blur.result", &[("part.ron", PART)]).unwrap();
    let gpu = Settings { side: Side::Gpu, ..settings() };
    let (graph, _) = compile(&file, &registry(), &gpu).unwrap_or_else(|problems| panic!("{problems}"));
    // These stages have no shader; placing the whole part on the CPU is no mistake.
    assert!(graph.nodes.iter().all(|node| node.side == Side::Cpu));
    assert_eq!(graph.nodes[1].download, epigraph_core::Download::Latent(2));
    // A default that no node takes changes nothing.
    let nodes = nodes.replace("on: Cpu", "on: Gpu");
    let file = with_parts(&nodes, "blur.result", &[("part.ron", PART)]).unwrap();
    let text = compile(&file, &registry(), &gpu).err().expect("it is broken").to_string();
    assert!(
        text.contains("test.ron:5:37: node `blur`: `on` changes nothing: the part has no node"),
        "{text}"
    );
    // Two such parts are two problems, the copies of one are one.
    let row = "repeat: (times: 3, through: { \"picture\": \"result\" }), params";
    let more = nodes.replace("\"blur\"", "\"again\"").replace(r#""source": (kind: "source"),"#, "");
    let file =
        with_parts(&format!("{}{more}", nodes.replace("params", row)), "blur.result", &[("part.ron", PART)]);
    let problems = compile(&file.unwrap(), &registry(), &gpu).err().expect("it is broken");
    let told: Vec<_> = problems.0.iter().map(|problem| problem.node.as_deref().unwrap()).collect();
    assert_eq!(told, ["blur/0", "again"], "{problems}");
}

#[test]
fn what_declares_no_meaning_has_that_of_what_is_connected() {
    let text = r#"Graph(
        version: 1,
        nodes: {
            "a": (kind: "deep"),
            "b": (kind: "change", inputs: { "data": "a.far" }),
            "c": (kind: "source"),
        },
        outputs: { "image": "b.data", "other": "c.out" },
    )"#;
    let registry = Registry::default().with::<Deep>().with::<Change>().with::<Source>();
    let file = GraphFile::parse("meaning.ron", text).unwrap();
    let (graph, plan) = compile(&file, &registry, &Settings::new([8, 8], 0, Facts::none())).unwrap();
    let meanings: Vec<_> = plan.taps.iter().map(|tap| (tap.name.as_str(), tap.meaning)).collect();
    assert_eq!(meanings, [("image", Some(DEPTH)), ("other", None)]);
    let deep = &graph.nodes[graph.node("a").unwrap()].declaration().ports;
    let docs: Vec<_> = deep.iter().map(|port| (port.doc.as_ref(), port.scratch)).collect();
    assert_eq!(docs, [("Distance, metres.", false), ("The same, doubled.", false), ("Sums by row.", true)]);
    assert_eq!([registry.meaning("depth"), registry.meaning("far")], [Some(DEPTH), None]);
}

#[test]
fn a_registry_that_was_asked_before_knows_the_kinds_that_are_added() {
    let registry = Registry::default().with::<Source>();
    assert_eq!((registry.meanings(), registry.quantities()), (vec![], vec![]));
    let registry = registry.with::<Deep>().with::<Print>();
    assert_eq!((registry.meanings(), registry.quantities()), (vec![DEPTH], vec![SHEETS]));
}
