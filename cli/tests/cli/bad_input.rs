//! Wrong input gives exit code 1 and a message that says what is wrong and where, and leaves no file behind.

use crate::support::Place;

/// Small enough to render quickly if a test gets that far.
const SMALL: &str = "--size 32x32 --frames 2 --backend cpu";

#[track_caller]
pub fn assert_says(message: &str, parts: &[&str]) {
    for part in parts {
        assert!(message.contains(part), "`{part}` is not in:\n{message}");
    }
}

#[test]
fn flags_with_wrong_values() {
    let place = Place::new();
    for (words, parts) in [
        ("--samples -5", ["-5", "a count from 1"]),
        ("--samples 101%", ["101%", "up to 100%"]),
        ("--size 0x0", ["0x0", "each 1 to 16384"]),
        ("--size 100000x100000", ["100000x100000", "each 1 to 16384"]),
        ("--frames 0", ["'0'", "--frames"]),
        ("--threads 0", ["'0'", "--threads"]),
        ("--set cull", ["cull", "node.param=value"]),
        ("--save cull=a.png", ["cull=a.png", "node.port=FILE"]),
        ("--backend tpu", ["tpu", "auto, gpu, cpu"]),
        ("--nonsense", ["--nonsense", "--help"]),
        ("--samples 1025 --size 32x32", ["1025", "1024 pixels"]),
    ] {
        assert_says(&place.fails(words), &parts);
    }
}

#[test]
fn flags_that_another_one_would_silence() {
    let place = Place::new();
    for (words, parts) in [
        ("--out a.png --sheet a.png", ["--out and --sheet both write a.png", "name another file"]),
        (
            "--save cull.id=a.exr --save cull.depth=a.exr",
            ["--save and --save both write a.exr", "name another"],
        ),
        ("reference --out a.png --edges a.png", ["--out and --edges both write a.png", "name another"]),
        ("check epi --json a --dot a", ["--json and --dot both write a;", "name another"]),
        ("bench --graph epi --backend hybrid", ["--graph epi is for the rows `cpu` and `gpu`", "`hybrid`"]),
        ("bench --sweep none --sweep pixels", ["--sweep none excludes other sweeps", "drop it"]),
        ("--camera fly:", ["camera path `fly:`", "a file of keyframes"]),
    ] {
        assert_says(&place.fails(words), &parts);
    }
    assert_eq!(place.files(), [""; 0]);
}

#[test]
fn graphs_that_are_wrong() {
    let place = Place::new();
    assert_says(&place.fails("no-such.ron"), &["no-such.ron", "cannot read"]);
    assert_says(&place.fails("rendr"), &["rendr", "did you mean `render`"]);
    place.write("syntax.ron", "#![enable(implicit_some)]\nGraph(\n    version: 1,\n    nodes: {\n)\n");
    assert_says(&place.fails("syntax.ron"), &["error: syntax.ron:5:1"]);
    place.write("empty.ron", "");
    assert_says(&place.fails("empty.ron"), &["error: empty.ron:"]);
    place.write("binary.ron", [0xFF, 0xFE, 0x00]);
    assert_says(&place.fails("binary.ron"), &["binary.ron"]);
    assert_says(&place.fails("--set cull.treshold=1"), &["did you mean `threshold`", "node `view/cull`"]);
    assert_says(&place.fails("--set culll.threshold=1"), &["did you mean `view/cull`"]);
    assert_says(&place.fails("--set sigm=1"), &["--set sigm=1: ", "did you mean `sigma`?"]);
    assert_says(
        &place.fails("--set threshold=1"),
        &["--set threshold=1: several nodes", "view/cull.threshold"],
    );
    assert_says(
        &place.fails("--set view.file=1"),
        &["--set view.file=1: node `view`", "--swap view=FILE.ron"],
    );
    assert_says(
        &place.fails("--set view.sigma=1"),
        &["view.ron has no parameter `sigma`", "view/project, view/cull"],
    );
    assert_says(&place.fails("--set cull.threshold=99"), &["99", "outside 0 to 10"]);
    assert_says(&place.fails("--save cull.nope=a.png"), &["--save", "unknown output port `nope`"]);
    assert_says(&place.fails("--save request.requests=a.png"), &["a list, not an image", ".csv"]);
    assert_says(&place.fails("--save points.cloud=a.exr"), &["a bundle of lists, not an image", ".csv"]);
}

#[test]
fn an_output_that_is_not_an_image() {
    let place = Place::new();
    place.write(
        "list.ron",
        "#![enable(implicit_some)]\nGraph(\n    version: 1,\n    nodes: { \"cloud\": (kind: \"point_cloud\") },\n    \
         outputs: { \"points\": \"cloud.cloud\" },\n)\n",
    );
    let message = place.fails(&format!("list.ron {SMALL} --out a.png"));
    assert_says(&message, &["list.ron:5:26", "`points` is not an image", "--save cloud.cloud=FILE.csv"]);
}

#[test]
fn scenes_that_are_wrong() {
    let place = Place::new();
    place.write("short.glb", b"glTF\x02\x00\x00\x00\xFF\x00\x00\x00");
    place.write("short.ply", "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\n");
    place.write("short.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 4\n");
    place.write("nan.obj", "v 0 0 0\nv nan 0 0\nv 0 1 0\nf 1 2 3\n");
    place.write("empty.obj", "v 0 0 0\n");
    place.write("syntax.ron", "Scene(version: 1, objects: [");
    for scene in ["short.glb", "short.ply", "short.obj", "nan.obj", "empty.obj", "syntax.ron", "missing.glb"]
    {
        assert_says(&place.fails(&format!("{SMALL} --scene {scene}")), &["error: ", scene]);
    }
    assert_says(&place.fails(&format!("{SMALL} --scene cornel")), &["did you mean `cornell`"]);
    assert_says(&place.fails(&format!("{SMALL} --camera orbitt")), &["did you mean `orbit`"]);
}

#[test]
fn no_gpu() {
    let place = Place::new();
    let run = place.run_without_gpu("--size 32x32 --frames 2 --backend gpu --out a.png");
    assert_eq!(run.code, Some(1), "{}", run.stderr);
    assert_says(&run.stderr, &["no GPU adapter was found", "--backend cpu", "apt-get install"]);
    assert!(place.files().is_empty());
    // By default, the program does not need a GPU.
    let run = place.run_without_gpu("--size 32x32 --frames 2 --out a.png");
    assert_eq!(run.code, Some(0), "{}", run.stderr);
    // A shader file does: the CPU cannot stand in.
    let graph = concat!(env!("CARGO_MANIFEST_DIR"), "/../graphs/experiments/outline.ron");
    let run = place.run_without_gpu(&format!("{graph} --size 32x32 --frames 2 --out b.png"));
    assert_eq!(run.code, Some(1), "{}", run.stderr);
    assert_says(&run.stderr, &["node `outline` (wgsl) runs on a GPU, but none was found", "apt-get install"]);
    assert!(!run.stderr.contains("--backend cpu"), "{}", run.stderr);
}

#[test]
fn files_that_cannot_be_written() {
    let place = Place::new();
    for words in [
        "--out none/a.png",
        "--sheet none/a.png",
        "--save antialias.color=none/a.exr",
        "--json none/a.json",
        "reference --out none/a.exr",
        "check render-cache --dot none/a.dot",
        "stages --json none/a.json",
    ] {
        assert_says(&place.fails(words), &["cannot write none/a.", "there is no folder none"]);
    }
    assert_says(&place.fails("--out ."), &["cannot write ."]);
    assert_says(&place.fails("--out a.jpg"), &["cannot write a.jpg", ".png or .exr"]);
    assert_says(&place.fails("--save antialias.color=a.tif"), &["cannot write a.tif", ".png, .exr or .csv"]);
}

#[test]
fn images_that_cannot_be_compared() {
    let place = Place::new();
    place.write("broken.png", b"\x89PNG\r\n\x1a\nnothing");
    place.write("broken.exr", b"v/1\x01nothing");
    place.write("text.txt", "no image");
    assert_says(&place.fails("compare broken.png broken.png"), &["cannot read broken.png"]);
    assert_says(&place.fails("compare broken.exr broken.exr"), &["cannot read broken.exr"]);
    assert_says(&place.fails("compare text.txt text.txt"), &["cannot read text.txt", ".png and .exr"]);
    assert_says(&place.fails("compare missing.png missing.png"), &["cannot read missing.png"]);
    for (size, out) in [("8x8", "a.png"), ("8x9", "b.png")] {
        place.succeeds(&format!("reference --spp 1 --size {size} --out {out}"));
    }
    assert_says(&place.fails("compare a.png b.png --map m.png"), &["a.png is 8x8", "b.png is 8x9"]);
}

#[test]
fn checks_report_every_problem_of_every_graph() {
    let place = Place::new();
    let graph =
        "#![enable(implicit_some)]\nGraph(version: 1, nodes: { \"a\": (kind: \"fil\") }, outputs: {})\n";
    place.write("a.ron", graph);
    let run = place.run("check a.ron render-cache --json -");
    assert_eq!(run.code, Some(1));
    let json: serde_json::Value = serde_json::from_str(&run.stdout).expect("only JSON on stdout");
    let errors = json["errors"].as_array().expect("a list");
    let unknown = &errors[0];
    assert_eq!(
        (&unknown["file"], &unknown["line"], &unknown["node"]),
        (&"a.ron".into(), &2.into(), &"a".into())
    );
    assert!(unknown["message"].as_str().is_some_and(|text| text.contains("did you mean `fill`?")), "{json}");
    assert!(json["plan"].is_null());
    assert_eq!(json["plans"][0]["graph"], "render-cache");
}
