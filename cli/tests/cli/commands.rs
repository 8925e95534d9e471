//! The commands do what their help says, on small images.

use crate::{bad_input::assert_says, support::Place};
use serde_json::Value;

const SMALL: &str = "--size 48x32 --frames 5 --samples 20% --backend cpu";

fn json(text: &str) -> Value {
    serde_json::from_str(text).expect("only JSON on stdout")
}

#[test]
fn without_arguments_a_picture_and_a_sheet_appear() {
    let place = Place::new();
    let text = place.succeeds("");
    assert_eq!(place.files(), ["epigraph-sheet.png", "epigraph.png"]);
    assert!(text.contains("epigraph.png") && text.contains("frames per second"), "{text}");
}

#[test]
fn the_picture_is_the_same_on_every_run_and_for_any_number_of_threads() {
    let place = Place::new();
    for (out, flags) in [
        ("a.png", ""),
        ("b.png", ""),
        ("c.png", "--threads 1"),
        ("d.png", "--threads 2"),
        ("e.png", "--poison --no-pooling --no-prune"),
        ("f.png", "--no-vectors"),
    ] {
        place.succeeds(&format!("render {SMALL} {flags} --out {out}"));
    }
    place.succeeds(&format!("render {SMALL} --seed 2 --out other.png"));
    let bytes = |name: &str| std::fs::read(place.path(name)).expect("written");
    for name in ["b.png", "c.png", "d.png", "e.png", "f.png"] {
        assert!(bytes(name) == bytes("a.png"), "{name} differs");
    }
    assert!(bytes("other.png") != bytes("a.png"), "the seed changes nothing");
}

#[test]
fn figures_as_json() {
    let place = Place::new();
    let report = json(&place.succeeds(&format!("{SMALL} --camera still --out a.png --json -")));
    assert_eq!((&report["scene"], &report["size"]), (&"cornell".into(), &serde_json::json!([48, 32])));
    assert_eq!((&report["backend"], &report["adapter"]), (&"cpu".into(), &Value::Null));
    assert_eq!((&report["frames"], &report["seed"]), (&5.into(), &1.into()));
    // 20% of 48 x 32 is 307.2.
    assert_eq!(report["samples_per_frame"], 307);
    // Rounding in the choice of pixels may leave a few of them unused.
    let arrived = report["samples_arrived_per_frame"].as_f64().expect("a number");
    assert!(arrived > 290.0 && arrived <= 307.0, "{arrived}");
    assert!(report["frame_ms"]["median"].as_f64() <= report["frame_ms"]["p95"].as_f64());
    assert!(report["trace_ms"].as_f64() > Some(0.0));
    let nodes = report["nodes"].as_array().expect("a list");
    let reach = nodes.iter().find(|node| node["node"] == "edges/reach").expect("the graph has it");
    assert!(reach["bytes"].as_u64() > Some(0) && reach["kind"] == "reach" && reach["backend"] == "cpu");
    let culled = report["culled"].as_array().expect("a list");
    assert!(
        culled.iter().any(|node| node["node"] == "view/predict" && node["why"].is_string()),
        "{culled:?}"
    );
}

#[test]
fn ports_are_saved_in_every_format() {
    let place = Place::new();
    place.succeeds(&format!(
        "{SMALL} --out a.exr --save spread.color=color.exr --save view/cull.id=id.exr --save interpolate.priority=priority.png \
         --save points.cloud=cloud.csv --save interpolate.priority=priority.csv"
    ));
    let files = ["a.exr", "cloud.csv", "color.exr", "id.exr", "priority.csv", "priority.png"];
    assert_eq!(place.files(), files);
    let cloud = std::fs::read_to_string(place.path("cloud.csv")).expect("written");
    let header = "index,position.x,position.y,position.z,position.w,radiance,image_id,meta,mean.x,mean.y,mean.z,mean.w,";
    assert!(cloud.starts_with(header), "{cloud:.200}");
    // 1.14 points for each of 48 x 32 pixels is 1751.04.
    assert_eq!(cloud.lines().count(), 1 + 1751);
    let priority = std::fs::read_to_string(place.path("priority.csv")).expect("written");
    assert!(priority.starts_with("x,y,value\n0,0,"));
    assert_eq!(priority.lines().count(), 1 + 48 * 32);
    let same = json(&place.succeeds("compare color.exr color.exr --json -"));
    assert_eq!((&same["rmse"], &same["psnr"]), (&0.0.into(), &Value::Null));
}

#[test]
fn a_parameter_changes_the_picture() {
    let place = Place::new();
    place.succeeds(&format!("{SMALL} --out a.png"));
    place.succeeds(&format!("{SMALL} --set tonemap.exposure=2 --out b.png"));
    let difference = json(&place.succeeds("compare a.png b.png --map map.png --json -"));
    assert!(difference["flip"].as_f64() > Some(0.05), "{difference}");
    assert!(difference["rmse"].as_f64() > Some(0.05) && difference["ssim"].as_f64() < Some(1.0));
    assert!(place.files().contains(&"map.png".to_owned()));
}

#[test]
fn the_default_graph_converges_towards_the_reference() {
    let place = Place::new();
    place.succeeds(
        "reference --mode path --camera orbit --frame 19 --size 64x64 --spp 32 --out reference.png",
    );
    let flags = "--camera orbit --size 64x64 --samples 20% --backend cpu --pace";
    for pace in ["exact", "async"] {
        place.succeeds(&format!("{flags} {pace} --frames 20 --out {pace}.png"));
    }
    place.succeeds(&format!("{flags} exact --frames 1 --out early.png"));
    let flip = |image: &str| {
        json(&place.succeeds(&format!("compare reference.png {image} --json -")))["flip"]
            .as_f64()
            .expect("a number")
    };
    assert!(flip("exact.png") < 0.1, "{}", flip("exact.png"));
    assert!(flip("early.png") > 2.0 * flip("exact.png"), "FLIP does not show the missing points");
}

#[test]
fn the_plan_is_printed_and_drawn() {
    let place = Place::new();
    let text = place.succeeds("check render-cache --camera still --dot plan.dot");
    for part in [
        "render-cache: no problems",
        "left out: view/predict (predict): ",
        "without view/predict: ",
        "checked against their stages",
    ] {
        assert!(text.contains(part), "`{part}` is not in:\n{text}");
    }
    let dot = std::fs::read_to_string(place.path("plan.dot")).expect("written");
    assert!(dot.starts_with("digraph plan {") && dot.contains("\"view/project\" -> \"view/cull\""), "{dot}");
    let gpu = json(&place.succeeds("check render-cache --backend gpu --json -"));
    let steps = gpu["plan"]["steps"].as_array().expect("a list");
    assert!(
        steps.iter().any(|step| step["kind"] == "download" && step["bytes"].as_u64() > Some(0)),
        "{steps:?}"
    );
}

#[test]
fn what_a_frame_asks_of_a_gpu_is_in_the_plan() {
    let place = Place::new();
    let check = "check render-cache --size 100x50 --backend";
    let report = json(&place.succeeds(&format!("{check} gpu --json -")));
    let plan = &report["plan"];
    let gpu = |node: &str| {
        let steps = plan["steps"].as_array().expect("a list");
        &steps.iter().find(|step| step["node"] == node).unwrap_or_else(|| panic!("{plan:#}"))["gpu"]
    };
    // One dispatch reads a colour of 16 bytes for each of 5000 pixels and writes 4 bytes.
    assert_eq!(
        *gpu("tonemap"),
        serde_json::json!({
            "dispatches": 1, "draws": 0, "barriers": 2, "read_bytes": 80_000, "written_bytes": 20_000, "atomics": 0,
        })
    );
    assert_eq!(*gpu("trace"), Value::Null);
    // Only what reaches memory of the GPU counts there.
    assert_eq!(
        (&gpu("trace.samples")["written_bytes"], &gpu("trace.samples")["read_bytes"]),
        (&16_000.into(), &0.into())
    );
    assert!(plan["gpu"]["dispatches"].as_u64() > Some(20), "{plan:#}");
    let text = place.succeeds(&format!("{check} gpu"));
    let words = |start: &str| -> Vec<String> {
        let line = text
            .lines()
            .find(|line| line.trim_start().starts_with(start))
            .unwrap_or_else(|| panic!("{text}"));
        line.split_whitespace().map(str::to_owned).collect()
    };
    assert_eq!(words("12  tonemap")[6..], ["1", "2", "16.0", "4.0"], "{text}");
    assert_eq!(words("frame")[1], plan["gpu"]["dispatches"].to_string(), "{text}");

    let on_cpu = json(&place.succeeds(&format!("{check} cpu --json -")));
    assert_eq!(on_cpu["plan"]["gpu"], Value::Null);
    assert!(!place.succeeds(&format!("{check} cpu")).contains("barriers"));
}

#[test]
fn stages_are_listed_and_described() {
    let place = Place::new();
    let all = place.succeeds("stages");
    assert!(all.contains("depth_cull") && all.contains("wgsl"), "{all}");
    let one = place.succeeds("stages depth_cull");
    for part in ["inputs", "outputs", "parameters", "threshold", "0 to 10", "updated in place", "array<u32>"]
    {
        assert!(one.contains(part), "`{part}` is not in:\n{one}");
    }
    assert!(one.contains("time counts towards: P4") && one.contains("scratch, depth"), "{one}");
    let described = json(&place.succeeds("stages depth_cull --json -"));
    let port =
        |name: &str| described["ports"].as_array().unwrap().iter().find(|port| port["name"] == name).cloned();
    let [id, first_vote] = ["id", "first_vote"].map(|name| port(name).unwrap());
    assert_eq!((&id["meaning"], &id["scratch"]), (&"id".into(), &false.into()));
    assert_eq!((&first_vote["meaning"], &first_vote["scratch"]), (&"depth".into(), &true.into()));
    assert_eq!(described["column"], "P4");
    assert_eq!(
        (&described["kind"], &described["runs_on"]),
        (&"depth_cull".into(), &serde_json::json!(["cpu", "gpu"]))
    );
    let everything = json(&place.succeeds("stages --json -"));
    assert!(everything["stages"].as_array().is_some_and(|kinds| kinds.len() > 10));
}

#[test]
fn a_shader_file_is_described_as_a_stage() {
    let place = Place::new();
    let file = |name: &str| format!("{}/../tests/wgsl/{name}.wgsl", env!("CARGO_MANIFEST_DIR"));
    let text = place.succeeds(&format!("stages {}", file("edge_raster")));
    for part in [
        "Marks where edges that are not hidden cross the sides of pixels",
        "time counts towards: E2",
        "imports: frame, index, pixel, segments, view, wide",
        "read, optional",
        "scratch",
        "one per corner of a pixel",
        "one thread for each element of mask",
        "draws 6 triangle vertices for each element of shadows into visited, cleared to 0; fragment mark_pixel",
        "one of Either, Owner, Both, Off",
        "0 to 1000000  pixels",
        "`silhouettes` means silhouettes, by its name.",
    ] {
        assert!(text.contains(part), "`{part}` is not in:\n{text}");
    }
    let age = json(&place.succeeds(&format!("stages {} --json -", file("age"))));
    let port =
        |name: &str| age["ports"].as_array().unwrap().iter().find(|port| port["name"] == name).cloned();
    let (cloud, rate) = (port("cloud").unwrap(), port("rate").unwrap());
    assert_eq!((&cloud["access"], &cloud["meaning"]), (&"update".into(), &"points".into()));
    assert_eq!(cloud["elements"], serde_json::json!(["image_id: array<u32>", "meta: array<u32>"]));
    assert_eq!((&rate["persistent"], &rate["extent"]), (&true.into(), &"a list of 1".into()));
    let passes = serde_json::json!([
        { "entry": "measure", "runs": "one workgroup" },
        { "entry": "grow", "runs": "one thread for each element of cloud_meta" },
    ]);
    assert_eq!((&age["passes"], &age["column"]), (&passes, &"P1".into()));

    place.write("wrong.wgsl", "#import frame\n/// = outptu\n@group(0) @binding(1) var a: texture_2d<f32>;\n");
    assert_says(&place.fails("stages wrong.wgsl"), &["wrong.wgsl:2:7", "did you mean `output`?"]);
    assert_says(&place.fails("stages none.wgsl"), &["none.wgsl", "cannot read"]);

    let kind = place.succeeds("stages wgsl");
    for part in
        ["for a port", "bit per element of PORT", "for the file", "`epigraph stages FILE.wgsl` describes"]
    {
        assert!(kind.contains(part), "`{part}` is not in:\n{kind}");
    }
    let kind = json(&place.succeeds("stages wgsl --json -"));
    assert!(kind["declarations"].as_array().unwrap().iter().any(|clause| clause["form"] == "like PORT"));
}

/// A graph with a parameter that reaches two nodes of a part, one of them three times in a row.
const PART: &str = r#"Graph(
    version: 1,
    doc: "Paler and paler.",
    params: { "light": (default: 0.5, doc: "Factor of each step.", range: (0.0, 1.0), unit: "") },
    nodes: {
        "first": (kind: "wgsl", inputs: { "color": "inputs.color" }, params: (shader: "pale.wgsl", light: Param("light"))),
        "row": (
            kind: "wgsl",
            repeat: (times: 3, through: { "color": "paler" }, count: "level"),
            inputs: { "color": "first.paler" },
            params: (shader: "pale.wgsl", light: Param("light")),
        ),
        "tonemap": (kind: "tonemap", inputs: { "color": "row.paler" }),
    },
    outputs: { "image": "tonemap.image" },
)"#;
const SHADER: &str = r#"
struct Params { light: f32, level: u32 }
@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var color: texture_2d<f32>;
@group(0) @binding(2) var paler: texture_storage_2d<rgba32float, write>;
@compute @workgroup_size(8, 8)
fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    let shift = f32(params.level) * 0.01;
    textureStore(paler, id.xy, textureLoad(color, id.xy, 0) * params.light + vec4(shift));
}
"#;
const WHOLE: &str = r#"Graph(
    version: 1,
    params: { "light": (default: 0.5) },
    nodes: {
        "epi": (kind: "graph", params: (file: "GRAPHS/epi.ron")),
        "pale": (kind: "graph", params: (file: "part.ron", light: Param("light")), inputs: { "color": "epi/antialias.color" }),
    },
    outputs: { "image": "pale.image" },
)"#;

#[test]
fn parameters_of_graphs_are_shown_and_set() {
    let place = Place::new();
    let graphs = concat!(env!("CARGO_MANIFEST_DIR"), "/../graphs");
    place.write("part.ron", PART);
    place.write("pale.wgsl", SHADER);
    place.write("whole.ron", WHOLE.replace("GRAPHS", graphs));
    let text = place.succeeds("stages part.ron");
    for part in
        ["Paler and paler.", "taken by", "first.color", "tonemap.image", "Factor of each step.", "0 to 1"]
    {
        assert!(text.contains(part), "`{part}` is not in:\n{text}");
    }
    let part = json(&place.succeeds("stages part.ron --json -"));
    assert_eq!((&part["params"][0]["name"], &part["params"][0]["default"]), (&"light".into(), &"0.5".into()));
    assert_eq!(
        part["inputs"][0],
        serde_json::json!({ "name": "color", "ports": ["first.color"], "doc": "" })
    );

    let text = place.succeeds("check whole.ron --set light=0.25");
    assert!(text.contains("parameters") && text.contains("pale/row/2"), "{text}");
    let plan = json(&place.succeeds("check whole.ron --set light=0.25 --json -"));
    let params: Vec<_> =
        plan["plan"]["params"].as_array().unwrap().iter().map(|p| (&p["name"], &p["value"])).collect();
    assert_eq!(params, [(&"light".into(), &"0.25".into()), (&"pale.light".into(), &"0.25".into())]);
    // The same light, set in two ways; and another.
    for (name, set) in [("a", "light=0.25"), ("b", "pale.light=0.25"), ("c", "light=0.5")] {
        place.succeeds(&format!("whole.ron {SMALL} --set {set} --out {name}.png"));
    }
    let bytes = |name: &str| std::fs::read(place.path(name)).expect("written");
    assert!(bytes("a.png") == bytes("b.png") && bytes("a.png") != bytes("c.png"));
    // One port of one copy.
    place.succeeds(&format!(
        "whole.ron {SMALL} --set pale/row/1.light=1.0 --out d.png --save row/1.paler=row.png"
    ));
    assert!(bytes("d.png") != bytes("c.png"));
}

#[test]
fn the_kind_of_parts_is_explained() {
    let place = Place::new();
    assert!(place.succeeds("stages").contains("Includes the nodes of another graph file"));
    let text = place.succeeds("stages graph");
    for part in ["parts/view.ron", "file", "a text in quotes", "`on` and `download` are the defaults"] {
        assert!(text.contains(part), "`{part}` is not in:\n{text}");
    }
    assert!(place.succeeds("stages epi").contains("epi.ron: Edge-and-point image"));
    assert!(place.fails("stages graf").contains("did you mean `graph`?"));
    let help = place.succeeds("check --help");
    assert!(help.contains("<GRAPH>") && help.contains("names of built-in graphs such as epi"), "{help}");
}

#[test]
fn help_and_version_succeed() {
    let place = Place::new();
    assert!(place.succeeds("--help").contains("Examples:"));
    assert!(place.succeeds("--version").starts_with("epigraph "));
    for command in ["render", "check", "stages", "reference", "compare", "bench", "quality"] {
        assert!(place.succeeds(&format!("{command} --help")).contains("Example"), "{command}");
    }
}

/// The hybrid graph is changed to be exact: readbacks wait, and the dither is the parallel one. Each run keeps its own
/// state over all frames.
#[test]
fn cpu_gpu_and_the_hybrid_split_show_the_same() {
    let place = Place::new();
    let graphs = concat!(env!("CARGO_MANIFEST_DIR"), "/../graphs");
    let split = std::fs::read_to_string(format!("{graphs}/hybrid.ron")).expect("it is shipped");
    let mut exact = split.clone();
    for (from, to) in [
        ("\"parts/", &format!("\"{graphs}/parts/")[..]),
        ("download: Latent(1)", "download: Sync"),
        ("set: { \"replace\": (reuse: false), \"integrate\": (threshold: 1.0) },", ""),
        ("kind: Serpentine", "kind: Systematic"),
    ] {
        assert!(exact.contains(from), "`{from}` is not in hybrid.ron");
        exact = exact.replace(from, to);
    }
    place.write("exact.ron", exact);
    for scene in ["cornell", "chains"] {
        for (graph, backend) in [("epi", "cpu"), ("epi", "gpu"), ("exact.ron", "gpu")] {
            place.succeeds(&format!(
                "{graph} --scene {scene} --camera orbit --size 128x96 --frames 20 --backend {backend} --out {graph}-{backend}.png"
            ));
        }
        for other in ["epi-gpu.png", "exact.ron-gpu.png"] {
            let flip = &json(&place.succeeds(&format!("compare epi-cpu.png {other} --json -")))["flip"];
            println!("{scene}, {other}: {flip}");
            // Once an f32 rounding decides about a pixel, later frames request other samples.
            assert!(flip.as_f64().expect("a number") < 0.002, "{scene}: {other} has {flip}");
        }
    }
}

#[test]
fn a_new_stage_runs_as_it_is_written() {
    let place = Place::new();
    let told = place.succeeds("stages --new glow");
    assert_eq!(place.files(), ["glow.ron", "glow.wgsl"]);
    assert!(told.contains("epigraph glow.ron"), "{told}");
    // Nothing about it is left open but what the defaults say, and it has an effect.
    assert!(place.succeeds("stages glow.wgsl").contains("Weight of the mean"));
    place.succeeds("check glow.ron");
    let flags = "--size 48x32 --frames 5 --samples 20%";
    place.succeeds(&format!("glow.ron {flags} --out with.png"));
    place.succeeds(&format!("glow.ron {flags} --out without.png --set glow.amount=0"));
    let difference = json(&place.succeeds("compare with.png without.png --json -"));
    assert!(difference["flip"].as_f64() > Some(0.01), "{difference}");
    // The test of the package, which has to be compiled, is in tests/outside.rs.
    place.succeeds("stages --new sub_surface --rust");
    let lib = std::fs::read_to_string(place.path("sub_surface/src/lib.rs")).unwrap();
    assert!(lib.contains("stage::SubSurfaceStage"), "{lib}");
    for (words, why) in [
        ("stages --new glow", "cannot write glow.wgsl: it exists"),
        ("stages --new sub_surface --rust", "cannot write sub_surface: it exists"),
        ("stages --new nowhere/flare", "there is no folder nowhere"),
        ("stages --new nowhere/flare --rust", "nowhere/flare"),
        ("stages --new fill", "such a kind of stage"),
        ("stages --new view", "the graph `epi`, which the new stage is put into, has a node of this name"),
        ("stages --new Glow", "small letters"),
        ("stages --new 3d", "begins with a letter"),
        ("stages --new ..", "name the stage"),
    ] {
        let message = place.fails(words);
        assert!(message.contains(why), "`{words}`: {message}");
    }
}
