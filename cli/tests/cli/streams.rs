//! Point sets: `encode` and `decode`.

use std::fs;

use epigraph_streams::Model;
use serde_json::Value;

use crate::{
    bad_input::assert_says,
    support::{Place, inputs},
};

fn json(place: &Place, name: &str) -> Value {
    serde_json::from_slice(&fs::read(place.path(name)).expect("written")).expect("JSON")
}

/// The vertices of a binary PLY file of floats and bytes.
fn vertices(place: &Place, name: &str, size: usize) -> Vec<Vec<u8>> {
    let bytes = fs::read(place.path(name)).expect("written");
    let end = b"end_header\n";
    let begin = bytes.windows(end.len()).position(|part| part == end).expect("a header") + end.len();
    let mut all: Vec<Vec<u8>> = bytes[begin..].chunks(size).map(<[u8]>::to_vec).collect();
    all.sort();
    all
}

#[test]
fn every_codec_decodes_to_the_same_points() {
    let place = inputs();
    let mut decoded = Vec::new();
    for codec in ["packed", "brick", "streams", "best"] {
        let said = place
            .succeeds(&format!("encode points.xyz --out {codec}.vts --codec {codec} --json {codec}.json"));
        assert!(said.starts_with("points.xyz: 900 points, with colours\n"), "{said}");
        let said = place.succeeds(&format!("decode {codec}.vts --out {codec}.ply"));
        assert!(said.starts_with(&format!("{codec}.ply: 900 points of level 8 of 8, from ")), "{said}");
        // The origin makes positions double.
        decoded.push(vertices(&place, &format!("{codec}.ply"), 3 * 8 + 4));
        let figures = json(&place, &format!("{codec}.json"));
        assert_eq!((&figures["codec"], &figures["points"]), (&codec.into(), &900.into()));
        assert_eq!(figures["bytes"], fs::metadata(place.path(&format!("{codec}.vts"))).unwrap().len());
        assert_eq!(figures["origin"], serde_json::json!([15.0, 15.0, 3.0]));
        for level in figures["levels"].as_array().unwrap() {
            let count = |name: &str| level[name].as_u64().unwrap();
            assert_eq!(count("points"), count("in_pools") + count("in_bricks") + count("single"));
            assert_eq!(count("points") + count("merged"), 900);
            assert_eq!(count("bytes"), count("position_bytes") + 4 * count("points"));
            match codec {
                "packed" => assert_eq!(count("position_bytes"), 4 * 900),
                "brick" => assert_eq!(count("in_bricks"), 900),
                "streams" => assert_eq!(count("in_bricks"), 0),
                _ => assert!(count("position_bytes") <= 4 * 900),
            }
        }
    }
    assert!(decoded.iter().all(|other| *other == decoded[0]));
    assert_eq!(decoded[0].len(), 900);
    let size = |codec: &str| fs::metadata(place.path(&format!("{codec}.vts"))).unwrap().len();
    assert!(["packed", "brick", "streams"].iter().all(|other| size("best") <= size(other)));
    // The same points and options give the same bytes.
    place.succeeds("encode points.xyz --out again.vts");
    assert!(fs::read(place.path("again.vts")).unwrap() == fs::read(place.path("best.vts")).unwrap());
}

#[test]
fn options_have_their_effects() {
    let place = inputs();
    let model = |options: &str| {
        place.succeeds(&format!("encode chains --out c.vts {options}"));
        Model::read(&place.path("c.vts")).unwrap()
    };
    let whole = model("--levels 3");
    assert_eq!(whole.levels(), 3);
    assert!(whole.nodes()[0].colors().is_some() && whole.nodes()[0].normals().is_some());
    let bare = model("--no-colors --no-normals --levels 2");
    assert!(bare.nodes()[0].colors().is_none() && bare.nodes()[0].normals().is_none());
    let pools = model("--codec streams --pools 5 --translations 88 --palette 300 --threshold 0.1 --levels 1");
    let pools = pools.nodes()[0].pools();
    assert!(pools.len() > 2 && pools.len() <= 5, "{}", pools.len());
    assert!(pools.iter().all(|pool| pool.translations().len() <= 88));

    let figures: Value = serde_json::from_str(&place.succeeds("encode chains --out c.vts --json -")).unwrap();
    assert_eq!(figures["levels"].as_array().map(Vec::len), Some(8));
    let said = place.succeeds("decode c.vts --out c.ply --level 1");
    assert!(said.contains("points of level 1 of 8, from 1 nodes"), "{said}");
    let header = String::from_utf8_lossy(&fs::read(place.path("c.ply")).unwrap()[..400]).into_owned();
    assert_says(&header, &["property float x", "property uchar alpha", "property float nz"]);
    // What is decoded can be encoded.
    place.succeeds("encode c.ply --out d.vts");
}

#[test]
fn points_that_are_no_points_are_left_out_and_counted() {
    let place = Place::new();
    place.write("scan.xyz", "1 2 3\nnan 2 3\n4 5 6\n7 inf 9\n");
    let said = place.succeeds("encode scan.xyz --out a.vts --json a.json");
    assert_says(&said, &["scan.xyz: 2 points\n", "left out: 2 points whose coordinates are no numbers"]);
    assert_eq!(json(&place, "a.json")["left_out"], serde_json::json!({ "not_numbers": 2, "withheld": 0 }));
}

#[test]
fn what_cannot_be_encoded_or_decoded_says_why() {
    let place = inputs();
    place.write("bad.xyz", "1 2 3\n1 2\n");
    place.write("none.xyz", "");
    place.write("short.vts", &fs::read(place.path("points.vts")).unwrap()[..500]);
    for (words, parts) in [
        ("encode bad.xyz --out a.vts", vec!["cannot read bad.xyz: line 2: it has 2 numbers"]),
        ("encode none.xyz --out a.vts", vec!["cannot read none.xyz: it has no points"]),
        ("encode points.xyz --out a.ply", vec!["cannot write a.ply: its name must end in .vts"]),
        (
            "encode points.txt --out a.vts",
            vec!["unknown scene `points.txt`", "point sets are read from", ".laz"],
        ),
        ("encode chain --out a.vts", vec!["did you mean `chains`?"]),
        ("encode gone.las --out a.vts", vec!["cannot read gone.las"]),
        ("encode points.xyz", vec!["--out <FILE.vts|FILE.glb>"]),
        ("encode points.xyz --out a.vts --codec zip", vec!["zip", "packed, brick, streams, best"]),
        ("encode points.xyz --out a.vts --translations 90", vec!["90", "88, 96, 128"]),
        ("encode points.xyz --out a.vts --levels 25", vec!["25", "--levels"]),
        ("encode points.xyz --out a.vts --threshold 2", vec!["threshold must be 0 to 1, not 2"]),
        ("decode points.xyz --out a.ply", vec!["cannot read points.xyz", "does not begin with EPIGRVTS"]),
        ("decode short.vts --out a.ply", vec!["cannot read short.vts: it ends at byte 500", "cut off"]),
        ("decode points.vts --out a.obj", vec!["cannot write a.obj: its name must end in .ply"]),
        (
            "decode points.vts --out a.ply --level 9",
            vec!["--level 9: points.vts has 8 levels", "1 is the coarsest"],
        ),
        ("decode points.vts --out a.ply --level 0", vec!["'0'", "--level"]),
    ] {
        assert_says(&place.fails(words), &parts);
    }
}

/// A killed run leaves what is done beside its output, from which the same command goes on to the same file.
#[test]
#[cfg(target_os = "linux")]
fn a_killed_run_goes_on() {
    let place = Place::new();
    place.succeeds("encode room --codec streams --out whole.vts");
    let part = place.path("room.vts.part");
    let command = "encode room --codec streams --out room.vts --keep-after 0";
    let mut running = place.start(command);
    // Until some nodes are done: 12 bytes are the file's own.
    let begun = std::time::Instant::now();
    while fs::metadata(&part).map_or(true, |data| data.len() < 500) {
        assert!(begun.elapsed().as_secs() < 60, "nothing was kept");
        std::thread::sleep(std::time::Duration::from_millis(1));
    }
    running.kill();
    running.wait();
    let said = place.run(command).stderr;
    assert!(said.contains("goes on from room.vts.part"), "{said}");
    assert!(place.contents()[&place.path("room.vts")] == place.contents()[&place.path("whole.vts")]);
    assert_eq!(place.files(), ["room.vts", "whole.vts"]);

    place.write("room.vts.part", "a text");
    let refused = place.fails("encode room --codec streams --out room.vts");
    assert!(refused.contains("room.vts.part is in the way"), "{refused}");
}
