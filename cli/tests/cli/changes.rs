//! Changes to graphs: options, variants by name, graphs with a base, and the whole graph as one file.

use serde_json::Value;

use crate::support::Place;

const SMALL: &str = "--size 48x32 --frames 4 --samples 20% --backend cpu";

/// Swaps red and blue.
const SHADER: &str = "
struct Params {
    /// How much of it.
    /// = 1 in 0..1
    share: f32,
}
@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var color: texture_2d<f32>;
@group(0) @binding(2) var swapped: texture_storage_2d<rgba32float, write>;
@compute @workgroup_size(8, 8)
fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    let before = textureLoad(color, id.xy, 0);
    textureStore(swapped, id.xy, mix(before, before.bgra, params.share));
}
";

/// The same as a stage in the place of `spread`: its input and output have the names of that stage's.
fn spread() -> String {
    SHADER.replace("color", "primary").replace("swapped", "color")
}

fn bytes(place: &Place, name: &str) -> Vec<u8> {
    std::fs::read(place.path(name)).expect("written")
}

/// A folder with both shaders and a graph that uses them.
fn mine() -> Place {
    let place = Place::new();
    place.write("bgr.wgsl", SHADER);
    place.write("spread.wgsl", spread());
    place.write(
        "mine.ron",
        "Graph(
            version: 1,
            base: \"epi\",
            replace: { \"spread\": (kind: \"wgsl\", params: (shader: \"spread.wgsl\", share: 0.5)) },
            nodes: { \"bgr\": (kind: \"wgsl\", inputs: { \"color\": \"antialias.color\" }, params: (shader: \"bgr.wgsl\")) },
            rewire: { \"tonemap.color\": \"bgr.swapped\" },
            set: { \"interpolate\": (sigma: 0.5), \"view/cull\": (threshold: 0.2) },
        )",
    );
    place
}

fn render(place: &Place, words: &str) -> Vec<u8> {
    place.succeeds(&format!("{words} {SMALL} --out picture.png"));
    bytes(place, "picture.png")
}

#[test]
fn options_names_and_files_make_the_same_changes() {
    let place = mine();
    let file = render(&place, "mine.ron");
    let options =
        "--set sigma=0.5 --insert tonemap.color=bgr.wgsl --swap spread=spread.wgsl --set cull.threshold=0.2";
    assert!(render(&place, &format!("epi {options} --set spread.share=0.5")) == file);
    let variant = "epi+spread.share=0.5+swap:spread=spread.wgsl+interpolate.sigma=0.5+view/cull.threshold=0.2\
                   +insert:tonemap.color=bgr.wgsl";
    assert!(render(&place, variant) == file);
    assert!(render(&place, "epi") != file);
    assert!(render(&place, &format!("epi {options}")) != file);
    // A variant of the file. What its name says wins over an option for all graphs.
    assert!(render(&place, "mine.ron+spread.share=0.25") != file);
    assert!(render(&place, "mine.ron+spread.share=0.5 --set spread.share=0.25") == file);
    // Skipping a stage, and a whole part from a file.
    assert!(
        render(
            &place,
            "mine.ron+wire:tonemap.color=antialias.color+wire:antialias.primary=interpolate.color"
        ) != file
    );
    let view = concat!(env!("CARGO_MANIFEST_DIR"), "/../graphs/parts/view.ron");
    assert!(render(&place, &format!("mine.ron --swap view={view} --set view/cull.threshold=0.2")) == file);
    assert!(render(&place, &format!("mine.ron --swap view={view}")) != file, "its parameters are its own");
}

#[test]
fn a_graph_in_full_gives_the_same_picture_from_another_folder() {
    let place = mine();
    let file = render(&place, "mine.ron");
    std::fs::create_dir(place.path("deep")).unwrap();
    let text = place.succeeds("check mine.ron --full deep/full.ron");
    assert!(text.contains("written in full to deep/full.ron"), "{text}");
    let full = String::from_utf8(bytes(&place, "deep/full.ron")).unwrap();
    assert!(full.contains("\"view/cull\": (") && full.contains("shader: \"../bgr.wgsl\""), "{full}");
    assert!(!full.contains("base") && !full.contains("\"graph\""), "{full}");
    assert!(render(&place, "deep/full.ron") == file);
    assert!(render(&place, "deep/full.ron --set cull.threshold=0.3") != file);
    // With changes by the command line, whose paths start at this folder.
    place.succeeds("check epi --swap spread=spread.wgsl --full deep/full.ron");
    assert!(render(&place, "deep/full.ron") == render(&place, "epi+swap:spread=spread.wgsl"));
    assert!(place.fails("check mine.ron epi --full full.ron").contains("name one GRAPH"));
    assert!(place.fails("check mine.ron --full none/full.ron").contains("there is no folder none"));
}

#[test]
fn what_does_not_fit_is_told_by_the_text_of_its_change() {
    let place = mine();
    let check = |words: &str| {
        let run = place.run(&format!("check {words}"));
        assert_eq!(run.code, Some(1), "{}", run.stdout);
        run.stdout + &run.stderr
    };
    for (words, wanted) in [
        (
            "epi --swap spred=spread.wgsl",
            "error: --swap spred=spread.wgsl: unknown node `spred`, did you mean `spread`?",
        ),
        (
            "epi --swap spread=bgr.wgsl",
            "error: --swap spread=bgr.wgsl: node `spread`: bgr.wgsl cannot take the place of spread",
        ),
        (
            "epi --swap spread=bgr.wgsl",
            "the output `color` is missing: `antialias.primary` takes it as texture<rgba32float>",
        ),
        (
            "epi --insert tonemap.color=spread.wgsl --set spread2.share=2",
            "--set spread2.share=2: node `spread2`: parameter `share` is 2, outside 0 to 1",
        ),
        (
            "epi --wire tonemap.color=spread.n8",
            "error: --wire tonemap.color=spread.n8: node `tonemap`: unknown output port `n8`",
        ),
        (
            "epi+swap:view=mine.ron",
            "error: +swap:view=mine.ron: node `view`: mine.ron cannot take the place of parts/view.ron",
        ),
        (
            "mine.ron+bgr.shar=1",
            "error: +bgr.shar=1: node `bgr`: unknown parameter `shar`, did you mean `share`?",
        ),
    ] {
        let text = check(words);
        assert!(text.contains(wanted), "{wanted}\nnot in\n{text}");
    }
    // A shader that a change names starts at the current folder, one that a file names at that of the file.
    std::fs::create_dir(place.path("deep")).unwrap();
    place.write(
        "deep/deep.ron",
        "Graph(version: 1, base: \"../mine.ron\", set: { \"bgr\": (shader: \"bgr.wgsl\") })",
    );
    assert!(check("deep/deep.ron").contains("deep/deep.ron:1:63: node `bgr`: cannot read: deep/bgr.wgsl"));
}

#[test]
fn variants_are_compared_with_settings_of_their_own() {
    let place = mine();
    let quality = "quality epi epi+sigma=0.5 mine.ron epi+swap:spread=spread.wgsl+share=0.25 --scene cornell --camera still \
                   --size 48x48 --spp 4 --frames 3 --samples 20% --backend cpu";
    let text = place.succeeds(&format!("{quality} --json quality.json"));
    let figures: Value = serde_json::from_slice(&bytes(&place, "quality.json")).unwrap();
    let rows: Vec<(&str, f64)> = figures["rows"]
        .as_array()
        .unwrap()
        .iter()
        .map(|row| (row["graph"].as_str().unwrap(), row["psnr"].as_f64().unwrap()))
        .collect();
    let names: Vec<&str> = rows.iter().map(|(name, _)| *name).collect();
    assert_eq!(names, ["epi", "epi+sigma=0.5", "mine", "epi+swap:spread=spread.wgsl+share=0.25"], "{text}");
    for (index, (name, psnr)) in rows.iter().enumerate() {
        assert!(
            rows[..index].iter().all(|(_, other)| other != psnr),
            "{name} is as good as another: {rows:?}"
        );
    }

    let bench = "bench --graph epi --graph epi+sigma=0.5 --scene cornell --size 48x48 --frames 3 --quick --backend cpu \
                 --sweep points";
    let text = place.succeeds(&format!("{bench} --json bench.json --plot bench.svg"));
    assert!(text.contains("cpu epi+sigma=0.5") && text.contains("graph graphs/epi.ron +sigma=0.5"), "{text}");
    assert_eq!(text.matches(": frame ~ points^").count(), 2, "{text}");
    let figures: Value = serde_json::from_slice(&bytes(&place, "bench.json")).unwrap();
    let graphs: Vec<&Value> = figures["rows"].as_array().unwrap().iter().map(|row| &row["graph"]).collect();
    assert_eq!(graphs, ["graphs/epi.ron", "graphs/epi.ron +sigma=0.5"]);
    let svg = String::from_utf8(bytes(&place, "bench.svg")).unwrap();
    assert!(svg.contains("cpu epi+sigma=0.5"), "{svg}");

    let gallery = "gallery --out g --graph epi+sigma=0.5 --beside epi --scene cornell --size 48x48 --frames 3 --spp 4 \
                   --crop 8,8 --backend cpu";
    place.succeeds(gallery);
    let page = String::from_utf8(bytes(&place, "g/gallery.md")).unwrap();
    assert!(
        page.contains("| epi+sigma=0.5, FLIP ") && page.contains("--graph epi+sigma=0.5 --beside epi"),
        "{page}"
    );
    assert!(bytes(&place, "g/cornell.png") != bytes(&place, "g/cornell-epi.png"));
}

#[test]
fn the_commands_of_the_readme_do_what_they_say() {
    let root = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).parent().expect("the workspace");
    let place = Place::new();
    for file in [
        "graphs/experiments/blur.wgsl",
        "graphs/experiments/blur.ron",
        "examples/own_stage/shaders/median.wgsl",
    ] {
        std::fs::create_dir_all(place.path(file).parent().unwrap()).unwrap();
        std::fs::copy(root.join(file), place.path(file)).unwrap();
    }
    let readme = std::fs::read_to_string(root.join("README.md")).unwrap();
    let section =
        readme.split("\n## ").find(|section| section.starts_with("Swap a stage\n")).expect("it is there");
    let graph = std::fs::read_to_string(place.path("graphs/experiments/blur.ron")).unwrap();
    let code: Vec<&str> = graph.lines().filter(|line| !line.starts_with("//") && !line.is_empty()).collect();
    assert!(section.contains(&code.join("\n")), "the file of which all is shown");
    let commands = section.lines().filter_map(|line| line.strip_prefix("cargo run --release -- "));
    let commands: Vec<&str> = commands.map(|line| line.split('#').next().unwrap_or(line).trim()).collect();
    assert_eq!(commands.len(), 9);
    let mut pictures = Vec::new();
    for command in commands {
        let words = command.replace("256x256", "48x48");
        let few = match words.split(' ').next() {
            Some("check") => "".to_owned(),
            Some("quality") => "--camera still --frames 3 --spp 4 --samples 20% --backend cpu".to_owned(),
            Some("bench") => "--size 48x48 --backend cpu --frames 2".to_owned(),
            _ => format!("{SMALL} --out picture.png"),
        };
        place.succeeds(&format!("{words} {few}"));
        if place.files().contains(&"picture.png".to_owned()) {
            pictures.push(bytes(&place, "picture.png"));
            std::fs::remove_file(place.path("picture.png")).unwrap();
        }
    }
    let [blurred, less, median, wired, full] = &pictures[..] else { panic!("{} pictures", pictures.len()) };
    let plain = render(&place, "epi");
    for (index, picture) in [&plain, blurred, less, median, wired].into_iter().enumerate() {
        assert!(
            [&plain, blurred, less, median, wired][..index].iter().all(|other| *other != picture),
            "{index}"
        );
    }
    assert!(*full == render(&place, "graphs/experiments/blur.ron"));
}

#[test]
fn check_tells_what_a_swap_leaves_out() {
    let place = mine();
    let text = place.succeeds("check epi --swap spread=spread.wgsl");
    let left = "swapped spread: without the wire `n8` and the parameters `method`, `rounds` of spread\n";
    assert!(text.contains(left), "{text}");
    let json: Value =
        serde_json::from_str(&place.succeeds("check epi --swap spread=spread.wgsl --json -")).unwrap();
    assert_eq!(json["plan"]["left_out"].as_array().map(Vec::len), Some(1), "{json}");
    // A stage in its own place loses its parameters alone; without a swap, nothing is said.
    let text = place.succeeds("check epi --swap spread=spread --set spread.rounds=3");
    assert!(text.contains("swapped spread: without the parameters `method`, `rounds` of spread\n"), "{text}");
    assert!(!place.succeeds("check epi").contains("swapped"));
}

#[test]
fn a_parameter_of_a_part_is_set_by_its_name_alone() {
    let place = mine();
    place.write(
        "part.ron",
        "Graph(
            version: 1,
            params: { \"share\": (default: 1.0, doc: \"How much of it.\") },
            nodes: {
                \"bgr\": (
                    kind: \"wgsl\",
                    inputs: { \"color\": \"inputs.color\" },
                    params: (shader: \"bgr.wgsl\", share: Param(\"share\")),
                ),
            },
            outputs: { \"color\": \"bgr.swapped\" },
        )",
    );
    place.write(
        "whole.ron",
        "Graph(
            version: 1,
            base: \"epi\",
            nodes: { \"filter\": (kind: \"graph\", inputs: { \"color\": \"antialias.color\" }, params: (file: \"part.ron\")) },
            rewire: { \"tonemap.color\": \"filter.color\" },
        )",
    );
    let plain = render(&place, "whole.ron");
    let half = render(&place, "whole.ron+share=0.5");
    assert!(half != plain && half == render(&place, "whole.ron --set filter.share=0.5"));
    let text = place.succeeds("check whole.ron+share=0.5");
    assert!(text.lines().any(|line| line.contains("filter.share") && line.contains("0.5")), "{text}");
}

#[test]
fn a_graphs_wires_are_listed() {
    let place = Place::new();
    let text = place.succeeds("stages epi");
    let row = |words: &[&str]| text.lines().any(|line| line.split_whitespace().eq(words.iter().copied()));
    assert!(row(&["antialias", "antialias", "primary", "spread.color"]), "{text}");
    assert!(row(&["cls", "edges.cls"]), "{text}");
    let json: Value = serde_json::from_str(&place.succeeds("stages epi --json -")).unwrap();
    let nodes = json["nodes"].as_array().unwrap();
    let node = nodes.iter().find(|node| node["node"] == "antialias").unwrap();
    assert_eq!(node["inputs"]["primary"], "spread.color");
}
