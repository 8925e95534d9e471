//! `epigraph bench`: its rows, the papers' rows beside them, and its messages about missing rows.

use serde_json::Value;

use crate::support::Place;

const QUICK: &str = "bench --quick --scene cornell --size 64x64";

/// The papers' columns.
const COLUMNS: [&str; 8] = ["P1", "P2", "P3", "P4", "E1", "E2", "I1", "I2"];

/// What times are rounded to, in milliseconds.
const ROUNDED: f64 = 1e-4;

fn json(text: &str) -> Value {
    serde_json::from_str(text).unwrap_or_else(|error| panic!("{error} in:\n{text}"))
}

fn number(value: &Value, key: &str) -> f64 {
    value[key].as_f64().unwrap_or_else(|| panic!("`{key}` is not a number in {value:#}"))
}

fn parts_are_the_frame(row: &Value) {
    let parts: f64 = COLUMNS.iter().chain(&["rest"]).filter_map(|key| row[*key].as_f64()).sum();
    assert!((parts - number(row, "frame_ms")).abs() <= 9.0 * ROUNDED, "{parts} in {row:#}");
}

#[test]
fn figures_as_json() {
    let place = Place::new();
    let report = json(&place.succeeds(&format!("{QUICK} --backend cpu --json -")));
    assert!(report["machine"]["cpu"].is_string() && number(&report["machine"], "threads") >= 1.0);
    assert_eq!(report["machine"]["adapter"], Value::Null);
    let rows = report["rows"].as_array().expect("a list");
    let papers = report["papers"].as_array().expect("a list");
    assert_eq!((rows.len(), papers.len()), (1, 10));
    for row in rows.iter().chain(papers) {
        for key in ["scene", "backend"] {
            assert!(row[key].is_string(), "`{key}` in {row:#}");
        }
        for key in COLUMNS {
            assert!(row[key].is_null() || number(row, key) >= 0.0, "{row:#}");
        }
        for key in ["edges", "points", "frame_ms", "fps"] {
            assert!(number(row, key) > 0.0, "{row:#}");
        }
        assert!((number(row, "fps") * number(row, "frame_ms") - 1000.0).abs() < 1.0, "{row:#}");
        // Each part is in the frame, so its median is at most that of the frames. Medians need not add up.
        for key in COLUMNS.iter().chain(&["rest"]) {
            assert!(
                row[*key].as_f64().is_none_or(|part| part <= number(row, "frame_ms") + ROUNDED),
                "{row:#}"
            );
        }
    }
    // The papers' are of one frame each.
    papers.iter().for_each(parts_are_the_frame);
    let row = &rows[0];
    assert_eq!((&row["scene"], &row["backend"]), (&"cornell".into(), &"cpu".into()));
    assert_eq!((&row["edges"], &row["frames"]), (&58.into(), &10.into()));
    // 1.14 points for each of 64 x 64 pixels is 4669.44.
    assert_eq!(row["points"], 4669);
    assert!(number(row, "frame_ms") <= number(row, "frame_p95_ms"));
    // The papers' images have another size, so there is no ratio.
    assert_eq!(row["papers_gpu_ratio"], Value::Null);
    let cornell = |backend| {
        papers.iter().find(|row| row["scene"] == "cornell" && row["backend"] == backend).expect("a row")
    };
    assert_eq!((number(cornell("gpu"), "frame_ms"), number(cornell("gpu"), "edges")), (42.82, 75.0));
    assert!((number(cornell("gpu"), "fps") - 23.35).abs() < 0.01);
    assert_eq!(number(cornell("cpu"), "frame_ms"), 69.14);
}

#[test]
fn the_parts_of_one_frame_add_up() {
    let place = Place::new();
    let report = json(&place.succeeds(&format!("{QUICK} --backend cpu --frames 1 --json -")));
    let row = &report["rows"][0];
    assert_eq!(row["frames"], 1);
    parts_are_the_frame(row);
    for column in COLUMNS {
        assert!(row[column].is_number(), "{column} of {row:#}");
    }
}

#[test]
fn every_stage_is_timed_and_counted_in_its_column() {
    let place = Place::new();
    let flags = "--backend cpu --graph render-cache --frames 3 --samples 10%";
    let report = json(&place.succeeds(&format!("{QUICK} {flags} --json -")));
    let row = &report["rows"][0];
    assert_eq!((&row["samples_per_frame"], &row["frames"]), (&410.into(), &3.into()));
    for column in COLUMNS {
        // A render cache has no edge stages.
        assert_eq!(row[column].is_null(), ["E1", "E2", "I1"].contains(&column), "{column} of {row:#}");
    }
    let nodes = row["nodes"].as_array().expect("a list");
    let fill = nodes.iter().find(|node| node["kind"] == "fill").expect("the graph has it");
    assert_eq!((&fill["backend"], &fill["ms"]), (&"cpu".into(), &row["I2"]));
}

#[test]
fn tables_and_a_plot() {
    let place = Place::new();
    let flags = "--frames 2 --sweep pixels --sweep points --sweep edges";
    let text = place.succeeds(&format!(
        "{QUICK} --scene chains --backend cpu {flags} --json bench.json --plot bench.svg"
    ));
    for part in [
        "cornell: 58 edges, 4,669 points, 64x64",
        "2 frames counted after 8",
        "papers' GPU",
        "42.82",
        "chains: 110,592 edges",
        "frame time of cornell by pixels",
        "cpu, 256x256",
        "frame time of cornell by points",
        "frame time by edges",
        "cpu: frame ~ pixels^",
    ] {
        assert!(text.contains(part), "`{part}` is not in:\n{text}");
    }
    assert_eq!(place.files(), ["bench.json", "bench.svg"]);
    let plot = std::fs::read_to_string(place.path("bench.svg")).expect("written");
    assert!(plot.starts_with("<svg ") && plot.ends_with("</svg>\n") && !plot.contains("NaN"), "{plot}");
    assert!(plot.contains("cornell, 58 edges") && plot.contains("pixels, cornell"), "{plot}");
    let report = json(&std::fs::read_to_string(place.path("bench.json")).expect("written"));
    let quantities = |sweep: &str| -> Vec<f64> {
        let rows = report["scaling"][sweep].as_array().expect("a list");
        rows.iter().map(|row| number(row, "quantity")).collect()
    };
    assert_eq!(quantities("pixels"), [4096.0, 16384.0, 65536.0]);
    assert_eq!(quantities("points"), [1024.0, 4096.0, 16384.0]);
    assert_eq!(quantities("edges"), [58.0, 110_592.0]);
}

#[test]
fn gpu_rows_say_if_the_gpu_is_software() {
    let place = Place::new();
    let run = place.run(&format!("{QUICK} --backend gpu --frames 2"));
    assert_eq!(run.code, Some(0), "{}", run.stderr);
    assert!(run.stdout.contains("\ngpu"), "{}", run.stdout);
    let software = run.stdout.contains("a software GPU");
    assert_eq!(
        software,
        run.stdout.contains("WARNING") && run.stderr.contains("say nothing about a real GPU"),
        "{}",
        run.stdout
    );
    assert_eq!(software, run.stdout.contains("gpu (software)"), "{}", run.stdout);
}

#[test]
fn without_a_gpu_the_other_rows_remain() {
    let place = Place::new();
    let run = place.run_without_gpu(&format!("{QUICK} --backend all --frames 2"));
    assert_eq!(run.code, Some(0), "{}", run.stderr);
    assert!(run.stdout.contains("\ncpu ") && !run.stdout.contains("\ngpu "), "{}", run.stdout);
    assert!(
        run.stdout.contains("skipped\n  rows `gpu`") && run.stdout.contains("no GPU adapter"),
        "{}",
        run.stdout
    );
}

#[test]
fn wrong_input() {
    let place = Place::new();
    for (words, parts) in [
        ("--scene cornel", ["cornel", "did you mean"]),
        ("--backend tpu", ["tpu", "cpu, gpu, hybrid, all"]),
        ("--sweep time", ["time", "pixels, points, edges"]),
        ("--graph no-such.ron", ["no-such.ron", "cannot read"]),
        ("--set points.nope=1 --graph render-cache", ["nope", "node `cloud/points`"]),
        ("--set cloud.nope=1 --graph render-cache", ["node `cloud`", "cloud/points, cloud/replace"]),
        ("--plot bench.png", ["bench.png", "FILE.svg"]),
        ("--json none/bench.json", ["none/bench.json", "there is no folder"]),
        ("--frames 0", ["'0'", "--frames"]),
        ("--samples 5000 --size 64x64", ["5000", "4096 pixels"]),
    ] {
        let message = place.fails(&format!("bench --quick --backend cpu {words}"));
        for part in parts {
            assert!(message.contains(part), "`{part}` is not in:\n{message}");
        }
    }
}

#[test]
fn point_sets_are_measured_beside_the_papers() {
    let place = Place::new();
    let report = json(&place.succeeds("bench --streams --quick --scene chains --json -"));
    let model = &report["models"][0];
    assert_eq!((&model["model"], report["papers"].as_array().map(Vec::len)), (&"chains".into(), Some(3)));
    for level in [&model["last_level"][0], &model["level_like_the_papers"][0]] {
        assert_eq!(
            (level["pools"].as_u64(), number(level, "conventional_bytes")),
            (Some(2), 8.0 * number(level, "points"))
        );
        let single = number(level, "points") - number(level, "covered");
        assert_eq!(number(level, "streams_bytes"), number(level, "pool_bytes") + 8.0 * single);
    }
    let frames = model["flight"]["frames"].as_array().expect("a list");
    assert!(frames.len() == 8 && frames.iter().all(|frame| number(frame, "points") > 0.0));
    // All points come in the end, and the cut shows nearly what they would.
    let came: f64 = frames.iter().map(|frame| number(frame, "new_bytes")).sum();
    assert!(came > 0.0 && came <= number(&model["flight"], "all_bytes"));
    assert!(frames.iter().all(|frame| number(frame, "flip") < 0.05));
    let codecs = model["codecs"].as_array().expect("a list");
    let names: Vec<&str> = codecs.iter().filter_map(|of| of["codec"].as_str()).collect();
    // The peer is built on demand.
    assert_eq!(names[..4], ["packed", "brick", "streams", "best"]);
    for codec in codecs {
        assert_eq!(codec["points"], codecs[0]["points"]);
        assert!(number(codec, "decode_points_per_second") > 0.0 && number(codec, "encode_seconds") > 0.0);
        let best = number(&codecs[3], "bytes");
        assert!(number(codec, "bytes") >= best || codec["codec"] == "meshopt", "{codec}");
    }
    assert_eq!(number(&codecs[0], "bytes"), 4.0 * number(&codecs[0], "points"));

    place.write("two.xyz", "1 2 3\n4 5 6\n");
    let text =
        place.succeeds("bench --streams --quick --scene two.xyz --json figures.json --plot flight.svg");
    let plot = std::fs::read_to_string(place.path("flight.svg")).expect("the plot");
    assert!(plot.contains("Flight through two.xyz") && plot.contains("from frame to frame"), "{plot}");
    for part in [
        "paper: Troll",
        "two.xyz  best ",
        "two.xyz: streams beats packed (1.00 times its bytes)",
        "figures 10 to 14",
    ] {
        assert!(text.contains(part), "`{part}` is not in:\n{text}");
    }
    let refused = place.fails("bench --streams --graph epi");
    assert!(refused.contains("'--streams' cannot be used with '--graph"), "{refused}");
    let unknown = place.fails("bench --streams --scene none.las");
    assert!(unknown.contains("cannot read none.las"), "{unknown}");
}

#[test]
fn what_pruning_saves_is_measured_for_each_scene() {
    let place = Place::new();
    let words = "bench --pruning --quick --graph epi --scene cornell --scene cornell-moving --size 48x48";
    let report = json(&place.succeeds(&format!("{words} --json -")));
    let rows = report["rows"].as_array().expect("a list");
    let of = |scene: &str, camera: &str| {
        let found = rows.iter().find(|row| row["scene"] == scene && row["camera"] == camera);
        found.unwrap_or_else(|| panic!("no row for {scene}, {camera}"))
    };
    let saved = |scene: &str, camera: &str| -> Vec<String> {
        let nodes = of(scene, camera)["saved"].as_array().expect("a list").iter();
        nodes.map(|saved| saved["node"].as_str().expect("a name").to_owned()).collect()
    };
    assert_eq!(rows.len(), 4);
    assert_eq!(saved("cornell", "still"), ["cloud/motion", "cloud/carry", "view/predict", "silhouette"]);
    assert_eq!(saved("cornell", "orbit"), ["cloud/motion", "cloud/carry"]);
    assert_eq!(saved("cornell-moving", "still"), ["view/predict"]);
    assert_eq!(saved("cornell-moving", "orbit"), [""; 0]);
    for row in rows {
        let whole = &row["whole"];
        assert!(
            number(whole, "nodes") == 23.0 && number(whole, "frame_ms") > number(row, "saved_ms"),
            "{row:#}"
        );
    }
    let still = of("cornell", "still");
    assert_eq!(number(still, "nodes"), 20.0);
    assert!(number(still, "saved_ms") > 0.0);
    let bytes = |options: &str| {
        let words = format!("check epi --scene cornell --camera still --size 48x48 {options} --json -");
        number(&json(&place.succeeds(&words))["plan"]["bytes"], "cpu")
    };
    let both = [number(still, "bytes"), number(&still["whole"], "bytes")];
    assert_eq!(both, ["", "--no-prune"].map(bytes));
    let text = place.succeeds(words);
    assert!(text.contains("view/predict: the camera does not move"), "{text}");
}

#[cfg(target_os = "linux")]
#[test]
fn instructions_are_counted_by_stage() {
    let place = Place::new();
    let words =
        "bench --instructions --graph epi --graph epi+reach_cull.passes=0 --size 48x48 --quick --json -";
    let report = json(&place.succeeds(words));
    let rows = report["rows"].as_array().expect("a list");
    let of = |row: usize, node: &str| {
        let nodes = rows[row]["nodes"].as_array().expect("a list");
        let found = nodes.iter().find(|found| found["node"] == node);
        number(found.unwrap_or_else(|| panic!("no node {node}")), "instructions_per_pixel")
    };
    for (row, figures) in rows.iter().enumerate() {
        let nodes = figures["nodes"].as_array().expect("a list");
        for node in nodes {
            let count = number(node, "instructions_per_pixel");
            match node["kind"].as_str().expect("a name") {
                // The cloud itself only owns memory.
                "point_cloud" => assert!(count.abs() < 0.1, "{node}"),
                // Its search, before the first frame, takes a few thousand more or less from run to run.
                "shadow_edges" => assert!(count.abs() < 5.0, "{node}"),
                _ => assert!(count > 0.0, "{node}"),
            }
        }
        let sum: f64 = nodes.iter().map(|node| number(node, "instructions_per_pixel")).sum();
        let (rest, frame) = ("rest_instructions_per_pixel", "frame_instructions_per_pixel");
        let [rest, frame] = [rest, frame].map(|key| number(figures, key));
        // Each number is rounded to 0.01.
        assert!((sum - of(row, "trace") + rest - frame).abs() < 0.2, "{sum} {rest} {frame}");
        // All work in a frame is some stage's, so that no stage's loops run out of its sight.
        assert!((0.0..0.05 * frame).contains(&rest), "{rest} of {frame}");
        assert!(number(figures, "frame_ms") > 0.0);
    }
    // Without passes, a copy is left; what other stages do is the same, up to a few tests for holes.
    assert!(of(1, "edges/reach_cull") < 0.5 * of(0, "edges/reach_cull"));
    let reach = [0, 1].map(|row| of(row, "edges/reach"));
    assert!((reach[0] - reach[1]).abs() < 0.01 * reach[0], "{reach:?}");
}

#[cfg(target_os = "linux")]
#[test]
fn without_valgrind_instructions_are_not_counted() {
    let place = Place::new();
    let run = place.shell("PATH= $EPIGRAPH bench --instructions --size 16x16");
    assert_eq!(run.code, Some(1));
    assert!(
        run.stderr.contains("valgrind is missing") && run.stderr.contains("apt-get install valgrind"),
        "{}",
        run.stderr
    );
    let refused = place.fails("bench --instructions --set reach_cull.passes=0");
    assert!(refused.contains("'--instructions' cannot be used with '--set"), "{refused}");
}
