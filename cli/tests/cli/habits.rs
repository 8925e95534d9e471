//! What users do with files besides naming them: links, pipes and devices, other programs' texts, private files.

use std::{
    fs,
    os::unix::fs::{PermissionsExt, symlink},
};

use crate::{
    bad_input::assert_says,
    support::{Place, inputs},
};

const SMALL: &str = "--size 24x16 --frames 2 --samples 20% --backend cpu";

#[test]
fn pipes_and_devices_get_their_bytes() {
    let place = Place::new();
    place.succeeds(&format!("{SMALL} --out file.png"));
    place.succeeds("check epi --dot file.dot");
    for line in [
        format!("\"$EPIGRAPH\" {SMALL} --out >(cat > piped.png); wait $!"),
        "mkfifo pipe.dot; cat pipe.dot > piped.dot & \"$EPIGRAPH\" check epi --dot pipe.dot; wait".into(),
    ] {
        let run = place.shell(&line);
        assert_eq!(run.code, Some(0), "`{line}`: {}", run.stderr);
    }
    place.write("points.xyz", "1 2 3\n4 5 6\n7 8 8\n");
    place.succeeds("encode points.xyz --out file.vts");
    place.succeeds("decode file.vts --out file.ply");
    let line =
        "\"$EPIGRAPH\" encode points.xyz --out >(\"$EPIGRAPH\" decode /dev/stdin --out piped.ply); wait $!";
    assert_eq!(place.shell(line).code, Some(0));
    let bytes = |name: &str| fs::read(place.path(name)).expect("written");
    assert!(bytes("piped.ply") == bytes("file.ply"));
    assert!(bytes("piped.png") == bytes("file.png"));
    assert!(bytes("piped.dot") == bytes("file.dot"));
    place.write("graph.ron", "Graph(version: 1, base: \"epi\")");
    for line in ["\"$EPIGRAPH\" check <(cat graph.ron)", "cat graph.ron | \"$EPIGRAPH\" check /dev/stdin"] {
        let run = place.shell(line);
        assert!(run.code == Some(0) && run.stdout.contains("no problems"), "`{line}`: {}", run.stderr);
    }
    let same = place.shell("\"$EPIGRAPH\" check /dev/stdin --json graph.ron < graph.ron");
    assert_says(&same.stderr, &["--json graph.ron would replace"]);
    let through = place.succeeds("check epi --json /dev/stdout");
    assert!(through.starts_with("{\n") && through.contains("epi: no problems"), "{through}");
    assert_says(&place.fails("check epi --dot /dev/full"), &["cannot write /dev/full", "No space left"]);
}

#[test]
fn links_and_permissions_stay_and_names_may_be_long() {
    let place = Place::new();
    symlink("later.png", place.path("link.png")).unwrap();
    let long = format!("{}.dot", "n".repeat(251));
    place.write("private.json", "old");
    fs::set_permissions(place.path("private.json"), fs::Permissions::from_mode(0o600)).unwrap();
    place.succeeds(&format!("{SMALL} --out link.png"));
    place.succeeds(&format!("check epi --json private.json --dot {long}"));
    assert!(place.path("link.png").is_symlink() && place.path("later.png").is_file());
    assert_eq!(fs::metadata(place.path("private.json")).unwrap().permissions().mode() & 0o777, 0o600);
    assert_eq!(place.files(), ["later.png", "link.png", &long, "private.json"]);
}

#[test]
fn texts_may_begin_with_a_byte_order_mark() {
    let place = inputs();
    let check = "check main.ron --scene scene.ron --camera fly:flight.ron";
    let plain = place.succeeds(check);
    for name in
        ["main.ron", "base.ron", "view.ron", "blur.wgsl", "scene.ron", "cube.obj", "cube.mtl", "flight.ron"]
    {
        let text = fs::read(place.path(name)).expect("there");
        place.write(name, [b"\xEF\xBB\xBF".as_slice(), &text].concat());
        assert_eq!(place.succeeds(check), plain, "{name}");
    }
    place.succeeds("stages blur.wgsl");
    place.succeeds("stages main.ron");
}

#[test]
fn what_never_ends_is_read_up_to_a_limit() {
    let place = inputs();
    for ending in ["ron", "wgsl", "mtl", "obj", "ply", "bin", "png"] {
        symlink("/dev/zero", place.path(&format!("zero.{ending}"))).unwrap();
    }
    place.write("part.ron", "Graph(version: 1, base: \"epi\", replace: { \"view\": (kind: \"graph\", params: (file: \"zero.ron\")) })");
    place.write("based.ron", "Graph(version: 1, base: \"zero.ron\")");
    place.write("outer.ron", "Scene(version: 1, objects: [(shape: File(\"zero.ply\"))])");
    let text = |name: &str| String::from_utf8(fs::read(place.path(name)).expect("there")).expect("text");
    place.write("library.obj", text("cube.obj").replace("cube.mtl", "zero.mtl"));
    place.write("buffer.gltf", text("model.gltf").replace("model.bin", "zero.bin"));
    for (words, name, limit) in [
        ("check /dev/zero", "/dev/zero", "16 MiB"),
        ("check part.ron", "zero.ron", "16 MiB"),
        ("check based.ron", "zero.ron", "16 MiB"),
        ("check epi --swap antialias=zero.wgsl", "zero.wgsl", "16 MiB"),
        ("stages zero.ron", "zero.ron", "16 MiB"),
        ("stages zero.wgsl", "zero.wgsl", "16 MiB"),
        ("--scene zero.ron", "zero.ron", "16 MiB"),
        ("--camera fly:/dev/zero", "/dev/zero", "16 MiB"),
        ("--scene zero.obj", "zero.obj", "1024 MiB"),
        ("encode zero.ply --out a.vts", "zero.ply", "1024 MiB"),
        ("decode zero.bin --out a.ply", "zero.bin", "1024 MiB"),
        ("--scene outer.ron", "zero.ply", "1024 MiB"),
        ("--scene buffer.gltf", "zero.bin", "1024 MiB"),
        ("compare a.png zero.png", "zero.png", "1024 MiB"),
        ("compare a.png b.png --mask zero.png", "zero.png", "1024 MiB"),
    ] {
        let limit = format!("longer than {limit}, the limit");
        if words.starts_with("check") {
            let run = place.run(words);
            assert_eq!(run.code, Some(1), "{words}");
            assert_says(&(run.stdout + &run.stderr), &[name, &limit]);
        } else {
            assert_says(&place.fails(words), &[name, &limit]);
        }
    }
    // A scene does without the materials.
    place.succeeds("check main.ron --scene library.obj");
}
