//! Meshes as shapes and instances: `encode --codec repeats`.

use std::fs;

use epigraph_streams::repeats::Repeats;
use serde_json::Value;

use crate::{
    bad_input::assert_says,
    support::{Place, inputs},
};

/// Three boxes of two shapes, of which one is turned, and a fourth that is mirrored into itself.
const BOXES: &str = r#"Scene(
    version: 1,
    materials: { "red": (color: (0.8, 0.1, 0.1)), "lamp": (color: (1, 1, 1), emission: (4, 2, 0)) },
    objects: [
        (shape: Box(low: (0, 0, 0), high: (1, 2, 3)), material: "red"),
        (shape: Box(low: (0, 0, 0), high: (1, 2, 3)), material: "lamp", translate: (5, 0, 0), rotate: (20, 30, 40)),
        (shape: Box(low: (0, 0, 0), high: (1, 2, 3.01)), material: "red", translate: (0, 9, 0)),
    ],
)"#;

#[test]
fn the_links_of_the_chains_are_stored_once() {
    let place = Place::new();
    let said = place.succeeds("encode chains --out c.vts --codec repeats --json c.json");
    assert_says(
        &said,
        &[
            "chains: 73728 triangles, ",
            " vertices in 26 parts\n4 shapes, 22 copies: 6.50 parts for each shape\nlargest deviation ",
            "allowed are 0.001% of its part's radius and rounding",
            "instances      26    832\n",
        ],
    );
    let figures: Value = serde_json::from_slice(&fs::read(place.path("c.json")).unwrap()).unwrap();
    let count = |name: &str| figures[name].as_u64().unwrap();
    assert_eq!([count("parts"), count("shapes"), count("copies"), count("given_up")], [26, 4, 22, 0]);
    assert!(figures["deviation"].as_f64().unwrap() < 1.1e-5);
    let parts = ["position", "instance", "attribute", "triangle", "record"]
        .map(|part| count(&format!("{part}_bytes")));
    assert_eq!(count("bytes"), fs::metadata(place.path("c.vts")).unwrap().len());
    // The header of the file has 48 bytes.
    assert_eq!(count("bytes"), 48 + parts.iter().sum::<u64>());
    // With normals and triangles, in fewer bytes than packed positions on grids of 7 bits.
    let packed = place.succeeds("encode chains --out p.vts --codec packed --no-colors --no-normals --json -");
    let packed: Value = serde_json::from_str(&packed).unwrap();
    assert!(count("bytes") < packed["levels"][7]["position_bytes"].as_u64().unwrap());

    let coarse = place.succeeds("encode chains --out d.vts --codec repeats --tolerance 0.5% --no-normals");
    assert!(coarse.contains("26 parts\n4 shapes") && coarse.contains("allowed are 0.5% of"), "{coarse}");
    let repeats = |name: &str| Repeats::read(&place.path(name)).unwrap();
    assert!(repeats("d.vts").bytes().points() * 3 < repeats("c.vts").bytes().points() * 2);
    assert!(
        repeats("c.vts").shapes()[0].normals().is_some() && repeats("d.vts").shapes()[0].normals().is_none()
    );
    // The same mesh and options give the same bytes.
    place.succeeds("encode chains --out e.vts --codec repeats");
    assert!(fs::read(place.path("e.vts")).unwrap() == fs::read(place.path("c.vts")).unwrap());
}

/// The description of a binary glTF file.
fn description(place: &Place, name: &str) -> Value {
    let bytes = fs::read(place.path(name)).expect("written");
    let length = u32::from_le_bytes(bytes[12..16].try_into().unwrap()) as usize;
    serde_json::from_slice(&bytes[20..20 + length]).expect("JSON")
}

#[test]
fn a_gltf_file_has_shapes_instances_and_materials() {
    let place = Place::new();
    place.write("boxes.ron", BOXES);
    let said = place.succeeds("encode boxes.ron --out boxes.glb");
    assert_says(
        &said,
        &["boxes.ron: 36 triangles, ", "in 3 parts\n2 shapes, 1 copies: 1.50 parts", "boxes.glb: "],
    );
    let file = description(&place, "boxes.glb");
    // A node for each material of a shape.
    let nodes = file["nodes"].as_array().unwrap();
    assert_eq!(nodes.len(), 3);
    let names: Vec<&str> =
        file["materials"].as_array().unwrap().iter().map(|m| m["name"].as_str().unwrap()).collect();
    assert!(names.contains(&"red") && names.contains(&"lamp"), "{names:?}");
    assert!(file["extensionsUsed"].to_string().contains("KHR_materials_emissive_strength"));
    // Of one material, they are instances; the length that is allowed merges all of them.
    place.succeeds("encode boxes.ron --out boxes.glb --no-colors --tolerance 0.02");
    let file = description(&place, "boxes.glb");
    assert_eq!((file["nodes"].as_array().unwrap().len(), &file["materials"]), (1, &Value::Null));
    assert!(file["nodes"][0]["extensions"]["EXT_mesh_gpu_instancing"]["attributes"]["ROTATION"].is_u64());

    // The other way: a file of repeats becomes the same glTF file, without materials.
    place.succeeds("encode boxes.ron --out boxes.vts --codec repeats --no-colors --tolerance 0.02");
    let said = place.succeeds("decode boxes.vts --out again.glb");
    assert_eq!(said, "again.glb: 3 parts of 1 shapes\n");
    assert!(fs::read(place.path("again.glb")).unwrap() == fs::read(place.path("boxes.glb")).unwrap());
}

#[test]
fn an_added_light_stays_out_of_files_and_the_origin_goes_along() {
    let place = Place::new();
    place.write("far.obj", "v 700000 0 0\nv 700001 0 0\nv 700000 1 0\nf 1 2 3\n");
    let said = place.succeeds("encode far.obj --out far.glb");
    assert_says(&said, &["far.obj: 1 triangles, 3 vertices in 1 parts"]);
    let file = description(&place, "far.glb");
    assert_eq!(
        (file["meshes"].as_array().unwrap().len(), file["materials"].as_array().unwrap().len()),
        (1, 1)
    );
    let root = &file["nodes"][file["scenes"][0]["nodes"][0].as_u64().unwrap() as usize];
    place.succeeds("encode far.obj --out far.vts --codec repeats");
    let origin = Repeats::read(&place.path("far.vts")).unwrap().origin();
    assert!((origin.x - 700_000.0).abs() < 2.0, "{origin}");
    assert_eq!(root["translation"], serde_json::json!(origin.to_array()));
    place.succeeds("decode far.vts --out again.glb");
    assert_eq!(&description(&place, "again.glb")["nodes"], &file["nodes"]);
    // It is there again.
    let read = place.run("check epi --scene far.glb").stderr;
    assert!(read.contains("an origin at (70000"), "{read}");
}

#[test]
fn what_has_no_repeats_says_why() {
    let place = inputs();
    place.succeeds("encode cube.obj --out parts.vts --codec repeats");
    for (words, parts) in [
        ("encode chains --out a.glb --codec best", vec!["cannot write a.glb", "--codec repeats", ".vts"]),
        ("encode chains --out a.ply --codec repeats", vec!["cannot write a.ply: its name must end in .vts"]),
        ("encode chains --out a.glb --levels 3", vec!["--levels is for points", "--tolerance"]),
        ("encode chains --out a.glb --palette 3", vec!["--palette is for points"]),
        ("encode chains --out a.vts --tolerance 1", vec!["--tolerance is for --codec repeats"]),
        ("encode chains --out a.glb --tolerance 1m", vec!["'1m'", "a length, such as 0.002", "0.1%"]),
        ("encode chains --out a.glb --tolerance -1", vec!["'-1'", "a length"]),
        ("encode points.xyz --out a.glb", vec!["unknown scene `points.xyz`"]),
        ("encode points.vts --out a.glb", vec!["points.vts: the mesh has no triangles"]),
        ("decode parts.vts --out a.ply", vec!["cannot read parts.vts: it holds repeats"]),
        ("decode parts.vts --out a.glb --level 1", vec!["--level is for points"]),
        ("decode points.vts --out a.glb", vec!["cannot read points.vts: it holds a tree of points"]),
    ] {
        assert_says(&place.fails(words), &parts);
    }
}
