//! `epigraph quality`, and its edge mask: `reference --edges` and `compare --mask`.

use std::fs;

use epigraph_pictures::Picture;
use serde_json::Value;

use crate::support::Place;

const SMALL: &str = "quality --scene cornell --size 48x48 --spp 16 --frames 11,3 --backend cpu";

fn json(text: &str) -> Value {
    serde_json::from_str(text).expect("JSON")
}

fn number(value: &Value) -> f64 {
    value.as_f64().unwrap_or_else(|| panic!("{value} is no number"))
}

fn close(ours: &Value, theirs: f64) {
    assert!((number(ours) - theirs).abs() < 1e-6, "{ours}, but {theirs}");
}

/// The pictures of the kept references of a frame, as files.
fn kept(place: &Place, folder: &str, frame: u32) -> String {
    let files = fs::read_dir(place.path(&format!("{folder}/references"))).expect("there");
    let paths = files.map(|entry| entry.expect("there").path());
    let is = |path: &std::path::PathBuf| {
        path.extension().is_some_and(|ending| ending == "json")
            && json(&fs::read_to_string(path).expect("there"))["frame"] == frame
    };
    let path = paths.into_iter().find(is).expect("the frame is compared").with_extension("exr");
    path.strip_prefix(place.path("")).expect("it is in the folder").display().to_string()
}

#[test]
fn tables_json_csv_and_a_plot() {
    let place = Place::new();
    let text = place.succeeds(&format!("{SMALL} --paths 0.2,1 --json a.json --plot a.svg --csv a.csv"));
    let lines: Vec<&str> = text.lines().filter(|line| line.starts_with('|')).collect();
    assert_eq!(lines.len(), 2 * (2 + 4), "{text}");
    for table in lines.chunks(6) {
        assert!(
            table[0].starts_with("| light paths a pixel and frame ") && table[0].contains("| 0.2 "),
            "{text}"
        );
        assert!(table[1].chars().all(|letter| "|-".contains(letter)), "{text}");
        let names = ["still, render-cache", "still, epi", "orbit, render-cache", "orbit, epi"];
        for (line, name) in table[2..].iter().zip(names) {
            assert!(line.starts_with(&format!("| cornell, {name} (4) ")), "{text}");
        }
    }
    assert!(text.contains("; frames 3, 11 (still); 3, 11 (orbit)\n"), "{text}");
    assert!(text.contains("48x48, references of 16 paths a pixel (mode Direct), seed 1, cpu"), "{text}");
    assert_eq!(text.matches(": references are ").count(), 2, "{text}");
    assert!(text.contains("epi against render-cache: FLIP near edges lower in "), "{text}");

    let figures = json(&fs::read_to_string(place.path("a.json")).expect("written"));
    let rows = figures["rows"].as_array().expect("a list");
    assert_eq!((rows.len(), &figures["failed"]), (8, &Value::Array(Vec::new())));
    for row in rows {
        let frames = row["frames"].as_array().expect("a list");
        assert_eq!(frames.len(), 2);
        for pointer in ["/psnr", "/flip", "/flicker", "/edges/psnr", "/edges/flip"] {
            let of = |value: &Value| number(value.pointer(pointer).expect("there"));
            let mean = frames.iter().map(of).sum::<f64>() / 2.0;
            assert!((of(row) - mean).abs() < 1e-9, "{pointer} of {row}");
        }
        // Pictures from few samples are worst at edges.
        assert!(row["edges"]["flip"].as_f64() > row["flip"].as_f64(), "{row}");
        assert!(number(&row["frame_ms"]) > 0.0 && number(&row["trace_ms"]) > 0.0, "{row}");
        // 4 paths a sample.
        let samples = if row["budget"] == "0.2 paths/pixel" { 115 } else { 576 };
        assert_eq!((&row["samples_per_frame"], &row["paths_per_sample"]), (&samples.into(), &4.into()));
        close(&row["paths_per_pixel"], f64::from(samples) * 4.0 / 2304.0);
        assert!(number(&row["paths_traced"]) > 0.9 * number(&row["paths_per_pixel"]), "{row}");
        assert!(number(&row["paths_traced"]) <= number(&row["paths_per_pixel"]), "{row}");
    }
    // A still camera sees the same; of a moving one, less is static.
    let share = |row: usize| number(&rows[row]["static_share"]);
    assert!(share(0) == 1.0 && share(4) > 0.1 && share(4) < 0.9, "{} and {}", share(0), share(4));
    let csv = fs::read_to_string(place.path("a.csv")).expect("written");
    let lines: Vec<Vec<&str>> = csv.lines().map(|line| line.split(',').collect()).collect();
    let column = |name: &str| lines[0].iter().position(|known| *known == name).expect("a column");
    // `compare` has a list in one field, without commas.
    assert_eq!(lines.len(), 1 + 8, "{csv}");
    for (line, row) in lines[1..].iter().zip(rows) {
        for name in ["psnr", "flip", "flicker"] {
            close(&row[name], line[column(name)].parse().expect("a number"));
        }
    }
    let svg = fs::read_to_string(place.path("a.svg")).expect("written");
    // For both cameras, PSNR and FLIP of all pixels and of those near edges.
    for title in ["PSNR, dB", "FLIP, logarithmic", "edge PSNR, dB", "edge FLIP, logarithmic"] {
        assert_eq!(svg.matches(&format!(">{title}<")).count(), 2, "{title}");
    }
    assert_eq!(svg.matches("<circle").count(), 2 + 2 * 4 * 4);
}

#[test]
fn budgets_in_samples_say_their_paths() {
    let place = Place::new();
    let words = format!("{SMALL} epi --camera still --samples 5%,400 --per-sample 64");
    let text = place.succeeds(&words);
    let lines: Vec<&str> = text.lines().filter(|line| line.starts_with('|')).collect();
    assert!(lines[0].contains("| 5% as samples ") && lines[0].contains("| 400 as samples "), "{text}");
    // 115 and 400 samples of 64 paths, of 2304 pixels.
    assert!(lines[2].starts_with("| cornell, still, epi (64)      | 3.19: "), "{text}");
    assert!(lines[2].contains(" | 11.1: "), "{text}");
    assert!(text.contains(", spp=64; frames 3, 11 (still)"), "{text}");
}

#[test]
fn with_a_density_paths_of_a_sample_follow_from_the_budget() {
    let place = Place::new();
    let words =
        format!("{SMALL} epi epi+trace.spp=9 --camera still --paths 0.01,0.05,0.8 --density 5% --plot a.svg");
    let text = place.succeeds(&format!("{words} --json a.json"));
    assert!(
        text.contains("| cornell, still, epi (1, 16) ") && text.contains("samples for 5% of the pixels"),
        "{text}"
    );
    let figures = json(&fs::read_to_string(place.path("a.json")).expect("written"));
    // Of 2304 pixels, 1% and 5%. The density comes after what a graph says itself.
    for rows in figures["rows"].as_array().expect("a list").chunks(3) {
        for (row, [paths, samples]) in rows.iter().zip([[1, 23], [1, 115], [16, 115]]) {
            let found = (&row["paths_per_sample"], &row["samples_per_frame"]);
            assert_eq!(found, (&paths.into(), &samples.into()), "{row}");
        }
        // More paths, less noise.
        assert!(number(&rows[2]["psnr"]) > number(&rows[1]["psnr"]), "{text}");
    }
    // As other commands have it.
    let other = format!("{SMALL} epi --camera still --samples 115 --per-sample 16 --json -");
    assert_eq!(json(&place.succeeds(&other))["rows"][0]["psnr"], figures["rows"][2]["psnr"]);
    // One line for each graph.
    let svg = fs::read_to_string(place.path("a.svg")).expect("written");
    assert_eq!(svg.matches("<circle").count(), 2 + 4 * 2 * 3);
}

#[test]
fn a_budget_is_left_out_for_a_graph_that_cannot_have_it() {
    let place = Place::new();
    let words = format!("{SMALL} epi+trace.spp=1 epi --camera still --paths 0.5,2 --json a.json");
    let text = place.succeeds(&words);
    let lines: Vec<&str> = text.lines().filter(|line| line.starts_with("| cornell")).collect();
    let cells = |line: usize| lines[line].split('|').map(str::trim).collect::<Vec<_>>();
    assert_eq!([cells(0)[1], cells(0)[3]], ["cornell, still, epi+trace.spp=1 (1)", "-"], "{text}");
    assert!(cells(0)[2].contains(" / ") && cells(1)[2..4].iter().all(|cell| cell.contains(" / ")), "{text}");
    assert!(
        text.contains("epi+trace.spp=1: 2 paths/pixel is 4608 samples of 1 path, more than one per pixel;"),
        "{text}"
    );
    assert!(
        text.contains("epi against epi+trace.spp=1: FLIP lower in ") && text.contains(" of 1 cases"),
        "{text}"
    );
    let figures = json(&fs::read_to_string(place.path("a.json")).expect("written"));
    assert_eq!(figures["rows"].as_array().map(Vec::len), Some(3));
    assert_eq!(figures["left_out"][0]["budget"], "2 paths/pixel");
}

/// Everything by other commands: two halves of the references by their seeds, the pictures by `render`, differences by
/// `compare`; flicker is computed here.
#[test]
fn the_figures_are_those_of_reference_render_and_compare() {
    let place = Place::new();
    let view = "--scene cornell --camera orbit --size 48x48";
    let words = format!("quality epi {view} --paths 0.2 --spp 16 --frames 11 --backend cpu --keep kept");
    let measured = json(&place.succeeds(&format!("{words} --json -")));
    let row = &measured["rows"][0];
    let compare = |files: &str| json(&place.succeeds(&format!("compare {files} --json -")));

    for (seed, out) in [(0x5245_4631, "a.exr"), (0x5245_4632, "b.exr")] {
        let edges = "--edges edges.png";
        place.succeeds(&format!("reference {view} --frame 11 --spp 8 --seed {seed} --out {out} {edges}"));
    }
    let halves = compare("a.exr b.exr");
    // Half of the noise is left in the mean of both, a quarter of its square.
    close(&row["reference"]["psnr"], number(&halves["psnr"]) + 10.0 * 4_f64.log10());
    close(&row["reference"]["flip"], number(&halves["flip"]));
    let reference = kept(&place, "kept", 11);
    let pictures =
        ["a.exr", "b.exr", &reference].map(|name| Picture::read(&place.path(name)).expect("an EXR"));
    for index in 0..48 * 48 {
        let [a, b, mean] = [0, 1, 2].map(|picture: usize| pictures[picture].colors[index]);
        assert!(
            (0..3).all(|lane| (0.5 * (a[lane] + b[lane]) - mean[lane]).abs() < 1e-5),
            "{a:?} {b:?} {mean:?}"
        );
    }

    // 0.2 x 48 x 48 / 4.
    for (frames, out) in [(11, "before.png"), (12, "last.png")] {
        place.succeeds(&format!(
            "render epi {view} --frames {frames} --samples 115 --backend cpu --out {out}"
        ));
    }
    let by_hand = compare(&format!("{reference} last.png --mask edges.png"));
    close(&row["psnr"], number(&by_hand["psnr"]));
    close(&row["flip"], number(&by_hand["flip"]));
    close(&row["edges"]["psnr"], number(&by_hand["mask"]["psnr"]));
    close(&row["edges"]["flip"], number(&by_hand["mask"]["flip"]));
    close(&row["edges"]["share"], number(&by_hand["mask"]["share"]));

    let bytes = |name: &str| image::open(place.path(name)).expect("a PNG").to_rgb8();
    let displayed = |name: &str| -> Vec<[u8; 3]> {
        let of = |linear: f32| {
            let linear = linear.clamp(0.0, 1.0);
            let value =
                if linear <= 0.003_130_8 { 12.92 * linear } else { 1.055 * linear.powf(1.0 / 2.4) - 0.055 };
            (255.0 * value).round() as u8
        };
        Picture::read(&place.path(name)).expect("an EXR").colors.iter().map(|color| color.map(of)).collect()
    };
    let (before, last) = (displayed(&kept(&place, "kept", 10)), displayed(&reference));
    let is_static: Vec<bool> =
        before.iter().zip(&last).map(|(a, b)| (0..3).all(|lane| a[lane].abs_diff(b[lane]) <= 1)).collect();
    let (mut sum, mut count) = (0.0, 0);
    for ((a, b), _) in
        bytes("before.png").pixels().zip(bytes("last.png").pixels()).zip(&is_static).filter(|(_, is)| **is)
    {
        let change = |lane: usize| f64::from(a[lane].abs_diff(b[lane])) / 255.0;
        sum += (0..3).map(|lane| change(lane).powi(2)).sum::<f64>();
        count += 1;
    }
    assert!(count > 100, "{count} pixels are static");
    close(&row["flicker"], (sum / f64::from(3 * count)).sqrt());
    close(&row["static_share"], f64::from(count) / 2304.0);
}

#[test]
fn what_is_kept_is_not_measured_again() {
    let place = Place::new();
    let words = "quality --scene cornell --camera orbit --size 32x32 --spp 8 --frames 3 --backend cpu --paths 0.4 --keep k";
    let first = json(&place.succeeds(&format!("{words} epi --json -")));
    let before = place.contents();
    let run = place.run(&format!("{words} epi epi+sigma=0.5 --json -"));
    assert!(run.stderr.contains("1 of 2 cells are done already"), "{}", run.stderr);
    let second = json(&run.stdout);
    assert_eq!((&second["rows"][0], second["rows"].as_array().map(Vec::len)), (&first["rows"][0], Some(2)));
    // The references are the same files.
    let after = place.contents();
    assert!(before.iter().all(|(path, bytes)| after.get(path) == Some(bytes)), "something was written anew");
    let references = |files: &std::collections::BTreeMap<_, _>| {
        files
            .keys()
            .filter(|path: &&std::path::PathBuf| path.parent().is_some_and(|p| p.ends_with("references")))
            .count()
    };
    assert_eq!(
        (references(&before), references(&after)),
        (4, 4),
        "two frames, each a picture and what is known of it"
    );
    // `tradeoff` takes them too.
    place.write(
        "t.ron",
        "Tradeoff(version: 1, graphs: [\"epi\"], scenes: [\"cornell\"], sizes: [\"32x32\"], frames: 4, \
         reference: (spp: 8), backend: \"cpu\")",
    );
    place.succeeds("tradeoff t.ron --out k");
    assert_eq!(references(&place.contents()), 4);
    // Without a folder, nothing stays.
    let there = place.files();
    place.succeeds(&words.replace(" --keep k", " epi"));
    assert_eq!(place.files(), there);
}

#[test]
fn references_have_the_light_of_the_graphs() {
    let place = Place::new();
    let words =
        "quality --scene cornell --camera still --size 24x24 --spp 4 --frames 1 --backend cpu --paths 1";
    let mode =
        |options: &str| json(&place.succeeds(&format!("{words} epi {options} --json -")))["mode"].clone();
    assert_eq!((mode(""), mode("--mode direct")), ("direct".into(), "direct".into()));
    assert_eq!(mode("--set trace.mode=Path"), "path");
    assert_eq!(mode("--set trace.mode=Path --mode path"), "path");
    for (options, parts) in [
        (
            "epi --mode path",
            ["trace.mode=Direct, but the references have mode Path", "--set trace.mode=Path"],
        ),
        (
            "epi --mode direct --set trace.mode=Path",
            ["trace.mode=Path, but the references have mode Direct", "leave the mode of the references out"],
        ),
        ("epi epi+trace.mode=Path", ["`epi+trace.mode=Path` takes", "measure it in a run of its own"]),
    ] {
        let message = place.fails(&format!("{words} {options}"));
        for part in parts {
            assert!(message.contains(part), "`{part}` is not in:\n{message}");
        }
    }
}

#[test]
fn a_row_near_its_reference_says_so() {
    let place = Place::new();
    // Clean samples, noisy references.
    let words = "quality epi --scene cornell --camera still --size 64x64 --spp 2 --frames 20 --backend cpu --per-sample 256";
    let text = place.succeeds(&format!("{words} --paths 64 --json a.json"));
    assert!(
        text.contains("* / ") && text.contains("* less than 5 dB below the references of cornell, still"),
        "{text}"
    );
    let row = &json(&fs::read_to_string(place.path("a.json")).expect("written"))["rows"][0];
    assert_eq!(row["near_reference"], true);
    assert!(number(&row["psnr"]) > number(&row["reference"]["psnr"]) - 5.0, "{row}");
    // With as many paths as the line says, nothing is left of it. Two noisy halves tell little, so it may have to say so again.
    let mut text = text;
    let mut before = 2;
    while let Some(spp) = text.split("--spp ").nth(1).and_then(|rest| rest.split(' ').next()) {
        let spp: u32 = spp.parse().expect("a number");
        assert!(spp > before && spp <= 256, "{text}");
        before = spp;
        text = place.succeeds(&format!("{} --paths 64", words.replace("--spp 2 ", &format!("--spp {spp} "))));
    }
    assert!(!text.contains('*'), "{text}");
}

#[test]
fn wrong_input_is_reported_before_anything_is_traced() {
    let place = Place::new();
    place.write("no.png", "no image");
    place.succeeds("reference --size 8x8 --spp 1 --out small.png --edges small-edges.png");
    place.succeeds("reference --size 16x16 --spp 1 --out large.png");
    for (words, parts) in [
        ("quality epj", ["epj", "did you mean `epi`"]),
        ("quality --scene cornel", ["cornel", "did you mean `cornell`"]),
        (
            "quality --scene cornell --scene cornel --size 512x512 --spp 100000",
            ["cornel", "did you mean `cornell`"],
        ),
        ("quality --camera orbti", ["orbti", "did you mean `orbit`"]),
        ("quality --samples 5%,0", ["'0'", "a count from 1"]),
        ("quality --samples 65 --size 8x8", ["65", "64 pixels"]),
        ("quality --paths 0.25,0", ["'0'", "such as 0.25"]),
        (
            "quality epi --paths 8",
            ["8 paths/pixel is 294912 samples of 4 paths", "give `epi` more paths a sample"],
        ),
        ("quality epi --paths 0.05 --size 8x8", ["less than one sample of 4 paths", "state a larger budget"]),
        ("quality streams --paths 1", ["`streams` has no node with samples", "state the budget in samples"]),
        ("quality --spp 3", ["'3'", "an even number"]),
        ("quality --density 5", ["'5'", "such as 5%"]),
        ("quality epi --paths 500 --density 5%", ["spp=10000", "1 to 4096"]),
        ("quality --frames 3,x", ["'x'", "--frames"]),
        ("quality --set trace.sp=3", ["unknown parameter `sp`", "node `trace`"]),
        ("quality --plot a.png", ["a.png", "name it FILE.svg"]),
        ("reference --out a.png --edges a.exr", ["a.exr", "name it FILE.png"]),
        ("compare large.png large.png --mask small-edges.png", ["mask is 8x8", "images are 16x16"]),
        ("compare small.png small.png --mask no.png", ["cannot read", "no.png"]),
    ] {
        let message = place.fails(words);
        for part in parts {
            assert!(message.contains(part), "`{part}` is not in:\n{message}");
        }
    }
}
