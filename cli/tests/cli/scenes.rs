//! What the program says of scenes: what is left out of their files, why a picture shows nothing.

use serde_json::Value;

use crate::support::Place;

fn json(text: &str) -> Value {
    serde_json::from_str(text).expect("valid JSON")
}

/// What a run that succeeds writes to stdout and stderr.
fn both(place: &Place, words: &str) -> (String, String) {
    let run = place.run(words);
    assert_eq!(run.code, Some(0), "`{words}`: {}", run.stderr);
    (run.stdout, run.stderr)
}

const SMALL: &str = "render --size 32x32 --frames 2 --backend cpu --camera still --out a.png --json a.json";

/// A floor of 2 x 2 m, of material `m`.
const FLOOR: &str =
    "mtllib m.mtl\nv -1 0 1\nv 1 0 1\nv 1 0 -1\nv -1 0 -1\nvn 0 0 0\nusemtl m\nf 1//1 2//1 3//1 4//1\n";

#[test]
fn what_is_left_out_of_a_file_is_told_once_and_written_to_json() {
    let place = Place::new();
    place.write("floor.obj", FLOOR);
    place.write("m.mtl", "newmtl m\nKd 0.5 0.5 0.5\nPc 1\n");
    let (out, err) = both(&place, &format!("{SMALL} --scene floor.obj"));
    let light = "floor.obj: added: a light in front, to the upper left, as there is none";
    assert_eq!(err.matches(light).count(), 1, "{err}");
    assert!(!out.contains("added"), "{out}");
    let report = json(&std::fs::read_to_string(place.path("a.json")).expect("written"));
    let notes = report["scene_report"].as_array().expect("a list");
    assert!(notes.iter().any(|note| note["kind"] == "added" && note["count"] == 1), "{notes:?}");
    assert!(notes.iter().any(|note| note["kind"] == "left_out" && note["names"][0] == "m"), "{notes:?}");
    assert!(report["blank"].is_null());
    let checked = json(&place.succeeds("check epi --scene floor.obj --json -"));
    assert_eq!(
        (&checked["scene"]["name"], &checked["scene"]["report"]),
        (&"floor.obj".into(), &report["scene_report"])
    );
    let facts = &checked["scene"]["facts"];
    // The floor and the light, of two triangles each.
    assert_eq!((&facts["counts"]["faces"], &facts["counts"]["emitters"]), (&4.into(), &2.into()));
    assert_eq!((&facts["counts"]["textures"], &facts["facts"]["transparent"]), (&0.into(), &false.into()));
}

#[test]
fn a_black_or_white_picture_says_why() {
    let place = Place::new();
    place.write("floor.obj", FLOOR);
    place.write("m.mtl", "newmtl m\nKd 0.5 0.5 0.5\n");
    let scene = |camera: &str, light: &str| {
        format!(
            "Scene(version: 1, camera: (eye: {camera}, target: (0, 0, 0), fov: 40), objects: [(shape: \
             File(\"floor.obj\"))], lights: [{light}])"
        )
    };
    let (above, below) = ("(0, 3, 0.1)", "(0, 3, 5)");
    let point = |intensity: &str, y: &str| format!("Point(position: (0, {y}, 0), intensity: {intensity})");
    for (camera, light, words) in [
        (above, point("(1e-4, 1e-4, 1e-4)", "2"), "the picture is black: it is dim, the mean radiance is"),
        (above, point("(1e4, 1e4, 1e4)", "2"), "the picture is white: it is bright, the mean radiance is"),
        (above, point("(9, 9, 9)", "-2"), "the picture is black: no light reaches what the camera sees"),
        (below, point("(9, 9, 9)", "2"), ""),
    ] {
        place.write("s.ron", scene(camera, &light));
        let (_, err) = both(&place, &format!("{SMALL} --samples 100% --scene s.ron"));
        let warned = err.lines().find(|line| line.starts_with("warning: the picture is"));
        assert!(
            warned.unwrap_or_default().contains(words) && warned.is_some() != words.is_empty(),
            "{words}: {err}"
        );
        assert_eq!(
            json(&std::fs::read_to_string(place.path("a.json")).expect("written"))["blank"].is_null(),
            words.is_empty()
        );
    }
    // The exposure that it names shows the scene.
    place.write("s.ron", scene(above, &point("(1e4, 1e4, 1e4)", "2")));
    let (_, err) = both(&place, &format!("{SMALL} --samples 100% --scene s.ron"));
    let exposure =
        err.split("try ").nth(1).and_then(|rest| rest.split_whitespace().nth(1)).expect("a tip").to_owned();
    let (_, err) = both(&place, &format!("{SMALL} --samples 100% --scene s.ron --set {exposure}"));
    assert!(!err.contains("the picture is"), "{err}");
    // So does the one that fits, which the report tells.
    let (out, err) =
        both(&place, &format!("{SMALL} --samples 100% --scene s.ron --set tonemap.exposure=Auto"));
    assert!(!err.contains("the picture is"), "{err}");
    let report = json(&std::fs::read_to_string(place.path("a.json")).expect("written"));
    let found = &report["exposures"][0];
    let ev = found["ev"].as_f64().expect("a number");
    assert!(
        found["node"] == "tonemap" && out.contains(&format!("exposure tonemap: {ev:.2} EV, Auto")),
        "{out}"
    );
    // It shows most as less than 1, the tip the mean as 0.18: by the peak's 10%, the two differ by 2 to 3 EV.
    let tip: f64 = exposure.split('=').nth(1).and_then(|ev| ev.parse().ok()).expect("a number");
    assert!((ev - tip).abs() < 3.5, "{ev} {tip}");
    // A camera that looks past everything, also in a reference.
    let past = "reference --size 32x32 --spp 1 --out r.png --scene s.ron --camera view:0,9,0:0.7071068,0,0,0.7071068";
    let (_, err) = both(&place, past);
    assert!(err.contains("the picture is black: the camera sees no surface"), "{err}");
}

#[test]
fn a_sky_lights_a_scene_instead_of_the_default_light() {
    let place = Place::new();
    place.write("floor.obj", FLOOR);
    place.write("m.mtl", "newmtl m\nKd 0.5 0.5 0.5\n");
    // A picture of the box, as light from all around.
    place.succeeds("reference --size 64x32 --spp 4 --out sky.exr --scene cornell");
    let render = "reference --size 32x32 --spp 64 --scene floor.obj --camera still --out a.exr --sky";
    let (_, err) = both(&place, &format!("{render} sky.exr"));
    assert!(!err.contains("added"), "{err}");
    let missing = place.fails(&format!("{render} none.exr"));
    assert!(missing.contains("none.exr"), "{missing}");
    let text = place.fails(&format!("{render} m.mtl"));
    assert!(text.contains("m.mtl: it is no image: a sky is an HDR, EXR"), "{text}");
}

#[test]
fn cameras_of_a_file_are_listed_and_chosen() {
    let place = Place::new();
    // A triangle of the corners (1, 0, 0), (0, 1, 0) and (0, 0, 0).
    let file = r#"{"asset": {"version": "2.0"}, "nodes": [
            {"mesh": 0}, {"camera": 0, "name": "front", "translation": [0, 0, 5]},
            {"camera": 0, "name": "top view", "translation": [0, 9, 0]}],
        "cameras": [{"type": "perspective", "perspective": {"yfov": 0.5, "znear": 0.1}}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}}]}],
        "accessors": [{"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3"}],
        "bufferViews": [{"buffer": 0, "byteLength": 36}],
        "buffers": [{"byteLength": 36, "uri": "data:;base64,AACAPwAAAAAAAAAAAAAAAAAAgD8AAAAAAAAAAAAAAAAAAAAA"}]}"#;
    place.write("two.gltf", file);
    let text = place.succeeds("check epi --scene two.gltf --camera still");
    assert!(text.contains("cameras of two.gltf, for --camera file:NAME: front, top view\n"), "{text}");
    let checked = json(&place.succeeds("check epi --scene two.gltf --json -"));
    assert_eq!(checked["scene"]["cameras"], serde_json::json!(["front", "top view"]));
    let text = place.fails("check epi --scene two.gltf --camera file:back");
    assert!(text.contains("the scene's cameras are front, top view"), "{text}");
    // From the front the triangle is seen, from behind only if it has two sides.
    for (camera, options, is_seen) in [
        ("file:front", "--single-sided", true),
        ("view:0.2,0.2,-2:0,1,0,0", "", true),
        ("view:0.2,0.2,-2:0,1,0,0", "--single-sided", false),
    ] {
        let words =
            format!("reference --scene two.gltf --size 16x16 --camera {camera} {options} --out a.png");
        let (_, err) = both(&place, &words);
        assert_eq!(!err.contains("the camera sees no surface"), is_seen, "{camera} {options}: {err}");
    }
}

#[test]
fn pictures_are_not_compared_at_exposures_of_their_own() {
    let place = Place::new();
    for command in [
        "quality --scene cornell --size 32x32 --frames 1",
        "gallery --out g --scene cornell --size 64x64 --graph",
    ] {
        let text = place.fails(&format!("{command} epi+tonemap.exposure=Auto"));
        assert!(
            text.contains("tonemap: its exposure is Auto, but pictures are compared at one exposure"),
            "{text}"
        );
    }
}
