//! What a stage can read of a captured frame when it explains a pixel.

use std::sync::Arc;

use epigraph_core::{
    Capture, Cell, CpuContext, Executor, Extent, Facts, Finding, Frame, GraphFile, Host, In, Io, Out,
    Registry, Settings, Shader, Site, Source, Stage, compile, testing::gpu,
};

const SIZE: [u32; 2] = [5, 3];

/// Writes pixel index plus 100 times the number of the frame.
struct Ramp(Out<u32>);

impl Stage for Ramp {
    const KIND: &'static str = "ramp";
    const DOC: &'static str = "A ramp.";
    type Params = ();
    fn declare((): &(), io: &mut Io) -> Self {
        io.shader(Shader::new(
            "ramp.wgsl",
            "@group(0) @binding(0) var<storage, read_write> ramp: array<u32>;
            @compute @workgroup_size(64) fn main(@builtin(global_invocation_id) id: vec3<u32>) {
                if id.x < arrayLength(&ramp) { ramp[id.x] = id.x; }
            }",
        ));
        let ramp = io.write("ramp", "the ramp", Extent::Frame(1));
        io.dispatch("main", ramp);
        Self(ramp)
    }
    fn cpu(&self, (): &(), cx: &CpuContext) -> Result<(), String> {
        cx.write(self.0).iter_mut().zip(0..).for_each(|(value, index)| *value = index);
        Ok(())
    }
}

/// Reads in all ways, and tells what it can read of a pixel.
struct Peek {
    now: In<u32>,
    before: In<u32>,
    list: Out<u32>,
    hint: Option<In<u32>>,
    sum: Out<u32>,
}

impl Stage for Peek {
    const KIND: &'static str = "peek";
    const DOC: &'static str = "Adds.";
    type Params = ();
    fn declare((): &(), io: &mut Io) -> Self {
        let now = io.read("now", "this frame's", Extent::Frame(1));
        let before = io.history("before", "the last frame's", Extent::Frame(1));
        let list = io.update("list", "ten more", Extent::Frame(1));
        let hint = io.optional("hint", "not connected", Extent::Frame(1));
        Self { now, before, list, hint, sum: io.write("sum", "the sum", Extent::Frame(1)) }
    }
    fn cpu(&self, (): &(), cx: &CpuContext) -> Result<(), String> {
        let mut list = cx.write(self.list);
        list.iter_mut().for_each(|value| *value += 10);
        cx.write(self.sum).iter_mut().zip(&*cx.read(self.now)).for_each(|(sum, now)| *sum = 2 * now);
        Ok(())
    }
    fn explain(&self, (): &(), site: &Site) -> Option<Vec<Finding>> {
        let show = |values: Option<std::borrow::Cow<[u32]>>| match values {
            Some(values) => values[site.at()].to_string(),
            None => "unknown".into(),
        };
        let values = [
            ("now", show(site.read(self.now))),
            ("before", show(site.read(self.before))),
            ("list before", show(site.before(self.list))),
            ("list", show(site.wrote(self.list))),
            ("sum", show(site.wrote(self.sum))),
        ];
        assert!(self.hint.is_none());
        Some(values.into_iter().map(|(name, text)| Finding::value(name, text)).collect())
    }
}

/// What `peek` says of the pixel in column 2 of row 1, whose index is 7. Its inputs come from `sides`; `placement` are
/// fields of its node.
fn said(sides: [&str; 2], placement: &str) -> Vec<String> {
    let text = format!(
        r#"#![enable(implicit_some)]
        Graph(version: 1, nodes: {{
            "one": (kind: "ramp", on: {}),
            "other": (kind: "ramp", on: {}),
            "peek": (kind: "peek", {placement}
                inputs: {{ "now": "one.ramp", "before": "one.ramp", "list": "other.ramp" }}),
        }}, outputs: {{ "sum": "peek.sum", "list": "peek.list" }})"#,
        sides[0], sides[1]
    );
    let file = GraphFile::parse("peek.ron", &text).unwrap_or_else(|problems| panic!("{problems}"));
    let registry = Registry::default().with::<Ramp>().with::<Peek>();
    let mut settings = Settings::new(SIZE, 0, Facts::none());
    settings.taps = ["one.ramp", "other.ramp", "peek.sum", "peek.list"]
        .map(|port| port.parse::<Source>().unwrap())
        .into();
    let (graph, plan) = compile(&file, &registry, &settings).unwrap_or_else(|problems| panic!("{problems}"));
    let mut executor = Executor::new(graph, plan, &settings, &registry, Some(gpu())).unwrap();
    let frame = Frame { size: SIZE, ..Frame::default() };
    executor.run(&frame, &Host::default(), true).unwrap();
    executor.run(&frame, &Host::default(), true).unwrap();
    let snapshots: Vec<_> = executor.snapshots().unwrap().into_iter().cloned().map(Arc::new).collect();
    let capture = Capture { frame, snapshots };
    let graph = executor.graph();
    let peek = graph.node("peek").unwrap();
    let findings = graph.nodes[peek].stage.explain(&capture.site(graph, peek, [2, 1], None)).unwrap();
    let text = |finding| match finding {
        Finding::Value { text, .. } => text,
        other => panic!("{other:?}"),
    };
    findings.into_iter().map(text).collect()
}

#[test]
fn values_of_other_frames_are_unknown_and_all_others_known() {
    let cpu = ["Cpu", "Cpu"];
    assert_eq!(said(cpu, ""), ["7", "unknown", "7", "17", "14"]);
    assert_eq!(said(["Gpu", "Gpu"], ""), ["7", "unknown", "7", "17", "14"]);
    // Only what comes from the GPU is late.
    assert_eq!(said(cpu, "download: Latent(1),"), ["7", "unknown", "7", "17", "14"]);
    let late = said(["Gpu", "Cpu"], "download: Latent(1),");
    // It works with the frame before, which was the same.
    assert_eq!(late, ["unknown", "unknown", "7", "17", "14"]);
    let late = said(["Cpu", "Gpu"], "download: Latent(1),");
    assert_eq!([&late[0], &late[2]], ["7", "unknown"]);
    assert_eq!(said(["Gpu", "Cpu"], "download: Sync,"), ["7", "unknown", "7", "17", "14"]);
}

#[test]
fn ports_that_were_not_captured_are_unknown() {
    let text = r#"Graph(version: 1, nodes: { "one": (kind: "ramp") }, outputs: { "image": "one.ramp" })"#;
    let file = GraphFile::parse("one.ron", text).unwrap();
    let registry = Registry::default().with::<Ramp>();
    let settings = Settings::new(SIZE, 0, Facts::none());
    let (graph, plan) = compile(&file, &registry, &settings).unwrap();
    let mut executor = Executor::new(graph, plan, &settings, &registry, None).unwrap();
    executor.run(&Frame { size: SIZE, ..Frame::default() }, &Host::default(), true).unwrap();
    // The output has its own name, not the port's.
    let snapshots: Vec<_> = executor.snapshots().unwrap().into_iter().cloned().map(Arc::new).collect();
    let capture = Capture { frame: Frame::default(), snapshots };
    assert!(capture.field("image", "").is_some() && capture.field("image", "x").is_none());
    assert!(capture.field("one.ramp", "").is_none());
    assert_eq!(capture.bytes(), 4 * 15);
}

#[test]
fn a_site_finds_the_pixels_around_it() {
    let text = r#"Graph(version: 1, nodes: { "one": (kind: "ramp") }, outputs: { "image": "one.ramp" })"#;
    let file = GraphFile::parse("one.ron", text).unwrap();
    let settings = Settings::new(SIZE, 0, Facts::none());
    let (graph, _) = compile(&file, &Registry::default().with::<Ramp>(), &settings).unwrap();
    let capture =
        Capture { frame: Frame { size: SIZE, index: 9, ..Frame::default() }, snapshots: Vec::new() };
    let site = |pixel| capture.site(&graph, graph.node("one").unwrap(), pixel, Some(4));
    assert_eq!((site([3, 2]).at(), site([3, 2]).size(), site([3, 2]).frame().index), (13, [5, 3], 9));
    assert_eq!(site([3, 2]).element, Some(4));
    for y in 0..3 {
        for x in 0..5 {
            for [dx, dy] in
                [[0, 0], [1, 0], [-1, 0], [0, 1], [0, -1], [2, -2], [-4, 1], [5, 3], [i32::MIN, i32::MAX]]
            {
                let (column, row) = (i64::from(x) + i64::from(dx), i64::from(y) + i64::from(dy));
                let inside = (0..5).contains(&column) && (0..3).contains(&row);
                let expected = inside.then_some((row * 5 + column) as usize);
                assert_eq!(site([x, y]).beside([dx, dy]), expected, "{x}, {y} by {dx}, {dy}");
            }
        }
    }
    let cell = |[dx, dy]: [i32; 2]| Cell { text: format!("{dx} {dy}"), ..Cell::default() };
    let Finding::Around(around) = site([1, 1]).around("near", 1, cell) else { panic!("a neighbourhood") };
    let texts: Vec<String> = around.cells.into_iter().map(|cell| cell.text).collect();
    assert_eq!(around.name, "near");
    assert_eq!(texts, ["-1 -1", "0 -1", "1 -1", "-1 0", "0 0", "1 0", "-1 1", "0 1", "1 1"]);
}

#[test]
fn a_colour_has_three_channels() {
    let color = |linear: &[f32]| match Finding::color("light", linear) {
        Finding::Color { linear, .. } => linear,
        other => panic!("{other:?}"),
    };
    assert_eq!(color(&[0.1, 0.2, 0.3, 0.4]), [0.1, 0.2, 0.3]);
    assert_eq!(color(&[0.5, 0.25]), [0.5, 0.25, 0.0]);
}
