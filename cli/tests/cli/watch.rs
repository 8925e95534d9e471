//! `render --watch` ends at the first bad number.

use serde_json::Value;

use crate::{bad_input::assert_says, support::Place};

/// Writes NaN into one pixel in frame 2.
const SPOIL: &str = "
#import frame
#import pixel
/// = means radiance
@group(0) @binding(1) var color: texture_2d<f32>;
/// = output, per pixel, means radiance
@group(0) @binding(2) var spoiled: texture_storage_2d<rgba32float, write>;
/// = output, per pixel, in 0..1
@group(0) @binding(3) var<storage, read_write> share: array<f32>;
/// = output, per pixel, any value
@group(0) @binding(4) var<storage, read_write> inverse: array<f32>;
@compute @workgroup_size(8, 8)
fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    if any(id.xy >= frame.size) {
        return;
    }
    var light = textureLoad(color, id.xy, 0);
    let now = frame.index == 2u && all(id.xy == vec2(5u, 3u));
    light.g = bitcast<f32>(select(bitcast<u32>(light.g), BAD, now));
    textureStore(spoiled, id.xy, light);
    let at = pixel_index(id.xy);
    share[at] = select(0.5, SHARE, now);
    inverse[at] = 1.0 / (share[at] - 0.5);
    #check share[at]: share[at] == 0.5 || CHECK, \"half of it\"
}
";

const GRAPH: &str = r#"Graph(version: 1, base: "render-cache",
    nodes: { "spoil": (kind: "wgsl", inputs: { "color": "fill.color" }, params: (shader: "spoil.wgsl")) },
    outputs: { "share": "spoil.share", "inverse": "spoil.inverse" },
    rewire: { "tonemap.color": "spoil.spoiled" },
)"#;

/// A place with the graph, whose shader has these values.
fn place(bad: &str, share: &str, check: &str) -> Place {
    let place = Place::new();
    place.write("spoil.wgsl", SPOIL.replace("BAD", bad).replace("SHARE", share).replace("CHECK", check));
    place.write("spoil.ron", GRAPH);
    place
}

/// Runs the graph watched: the message, and the JSON, which is all that it writes.
fn watched(place: &Place) -> (String, Value) {
    let before = place.files();
    let run = place.run(&format!("{RUN} --watch"));
    assert_eq!(run.code, Some(1), "{}\n{}", run.stdout, run.stderr);
    let written: Vec<String> = place.files().into_iter().filter(|file| !before.contains(file)).collect();
    assert_eq!((written, run.stdout), (vec!["a.json".to_owned()], String::new()));
    (run.stderr, json(place))
}

fn json(place: &Place) -> Value {
    serde_json::from_slice(&place.contents()[&place.path("a.json")]).unwrap()
}

const RUN: &str = "spoil.ron --size 24x16 --frames 4 --backend cpu --out a.png --json a.json";

#[test]
fn a_watched_run_names_the_first_bad_number_and_writes_no_picture() {
    let place = place("0x7FC00000u", "0.5", "true");
    let (message, json_of_it) = watched(&place);
    let parts = [
        "node `spoil` (wgsl, on the gpu)",
        "in frame 2",
        "`spoil.spoiled`, pixel (5, 3), element 77, g: NaN",
    ];
    assert_says(&message, &parts);
    assert_says(&message, &["finite numbers from 0", "Nothing that it read is bad: fill.color"]);
    let bad = &json_of_it["bad_value"];
    assert_eq!(
        (&bad["node"], &bad["port"], &bad["wrong"]),
        (&"spoil".into(), &"spoil.spoiled".into(), &"nan".into())
    );
    assert_eq!((&bad["element"], &bad["frame"], &bad["side"]), (&77.into(), &2.into(), &"gpu".into()));
    assert_eq!((&bad["pixel"], &bad["number"]), (&serde_json::json!([5, 3]), &"g".into()));
    // The same run, unwatched, and a watched one that ends before.
    place.succeeds(RUN);
    place.succeeds(&format!("{} --watch", RUN.replace("--frames 4", "--frames 2")));
    let json = json(&place);
    assert_eq!((&json["watched"], &json["bad_value"]), (&true.into(), &Value::Null));
}

#[test]
fn a_declared_range_and_a_check_are_watched() {
    let (message, _) = watched(&place("0u", "1.5", "true"));
    assert_says(&message, &["`spoil.share`, pixel (5, 3), element 77: 1.5, but allowed are 0 to 1"]);
    let (message, _) = watched(&place("0u", "0.75", "false"));
    assert_says(&message, &["fails a check of its own in frame 2", "half of it; the element is 0.75"]);
    place("0u", "0.75", "true").succeeds(&format!("{RUN} --watch"));
}

#[test]
fn what_watching_excludes_is_refused() {
    let place = Place::new();
    assert_says(&place.fails("--watch --poison"), &["--watch", "--poison", "cannot be used with"]);
}

#[test]
fn a_range_that_makes_no_sense_is_refused() {
    for (from, to, part) in [
        ("per pixel, in 0..1", "per pixel, in 2..1", "the lower number comes first"),
        (
            "per pixel, in 0..1",
            "per pixel, in 0..1, any value",
            "what its values may be of `share` is given twice",
        ),
        (
            "/// = means radiance\n@group(0) @binding(1)",
            "/// = means radiance, in 0..1\n@group(0) @binding(1)",
            "only read",
        ),
        ("#check share[at]", "#check shore[at]", "unknown output `shore`, did you mean `share`?"),
        ("share[at] == 0.5 ||", "shade[at] == 0.5 ||", "shade"),
    ] {
        let place = place("0u", "0.5", "true");
        let text = SPOIL.replace("BAD", "0u").replace("SHARE", "0.5").replace("CHECK", "true");
        assert!(text.contains(from), "{from}");
        place.write("spoil.wgsl", text.replace(from, to));
        let run = place.run("check spoil.ron");
        assert_eq!(run.code, Some(1), "{from}");
        assert_says(&(run.stdout + &run.stderr), &[part, "spoil.wgsl:"]);
    }
}
