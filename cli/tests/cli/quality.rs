//! `epigraph quality`, and its edge mask: `reference --edges` and `compare --mask`.

use serde_json::Value;

use crate::support::Place;

const SMALL: &str = "quality --scene cornell --size 48x48 --spp 16 --frames 11,3 --backend cpu";

fn json(text: &str) -> Value {
    serde_json::from_str(text).expect("JSON")
}

#[test]
fn a_table_json_and_a_plot() {
    let place = Place::new();
    let text = place.succeeds(&format!("{SMALL} --samples 5%,400 --json a.json --plot a.svg"));
    let table: Vec<&str> = text.lines().filter(|line| line.starts_with('|')).collect();
    assert_eq!(table.len(), 2 + 4, "{text}");
    assert!(table[0].contains("| 5% ") && table[0].contains("| 400 "), "{text}");
    assert!(table[1].chars().all(|letter| "|-".contains(letter)), "{text}");
    for (line, name) in
        table[2..].iter().zip(["still, render-cache", "still, epi", "orbit, render-cache", "orbit, epi"])
    {
        assert!(line.starts_with(&format!("| cornell, {name} ")), "{text}");
    }
    assert!(text.contains("frames 3, 11 (still); 3, 11 (orbit)"), "{text}");
    assert!(text.contains("epi against render-cache: FLIP near edges lower in "), "{text}");

    let figures = json(&std::fs::read_to_string(place.path("a.json")).expect("written"));
    let rows = figures["rows"].as_array().expect("a list");
    assert_eq!(rows.len(), 8);
    let mean = |row: &Value, pointer: &str| -> f64 {
        let frames = row["frames"].as_array().expect("a list");
        assert_eq!(frames.len(), 2);
        frames
            .iter()
            .map(|frame| frame.pointer(pointer).and_then(Value::as_f64).expect("a number"))
            .sum::<f64>()
            / 2.0
    };
    for row in rows {
        for pointer in ["/psnr", "/flip", "/edges/psnr", "/edges/flip"] {
            let value = row.pointer(pointer).and_then(Value::as_f64).expect("a number");
            assert!((value - mean(row, pointer)).abs() < 1e-9, "{pointer} of {row}");
        }
        // Pictures from few samples are worst at edges.
        assert!(row["edges"]["flip"].as_f64() > row["flip"].as_f64(), "{row}");
    }
    assert_eq!((&rows[0]["samples"], &rows[0]["samples_per_frame"]), (&"5%".into(), &115.into()));
    let svg = std::fs::read_to_string(place.path("a.svg")).expect("written");
    // Two cameras, two graphs, a line for all pixels and one for those near edges.
    assert_eq!(svg.matches("stroke-width=\"2.4\"").count(), 4 + 2);
    assert_eq!(svg.matches("stroke-width=\"1.1\"").count(), 4 + 1);
}

#[test]
fn the_figures_are_those_of_reference_render_and_compare() {
    let place = Place::new();
    let view = "--camera orbit --size 48x48";
    place.succeeds(&format!("reference {view} --frame 11 --spp 16 --out a.exr --edges edges.png"));
    place.succeeds(&format!("render epi {view} --frames 12 --samples 5% --backend cpu --out b.png"));
    let by_hand = json(&place.succeeds("compare a.exr b.png --mask edges.png --json -"));
    let words = "quality epi --scene cornell --camera orbit --samples 5% --size 48x48 --spp 16 --frames 11 --backend cpu";
    let measured = json(&place.succeeds(&format!("{words} --json -")));
    let row = &measured["rows"][0];
    for (ours, theirs) in [
        (&row["psnr"], &by_hand["psnr"]),
        (&row["flip"], &by_hand["flip"]),
        (&row["edges"]["psnr"], &by_hand["mask"]["psnr"]),
        (&row["edges"]["flip"], &by_hand["mask"]["flip"]),
        (&row["edges"]["share"], &by_hand["mask"]["share"]),
    ] {
        let [ours, theirs] = [ours, theirs].map(|value| value.as_f64().expect("a number"));
        // The file holds the same floats.
        assert!((ours - theirs).abs() < 1e-6, "{row} {by_hand}");
    }
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
