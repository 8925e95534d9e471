//! What commands write never replaces what they read, nor each other's files.

use std::fs;

use crate::{
    bad_input::assert_says,
    support::{Place, inputs},
};

/// Work that would take hours, for a command that is not refused beforehand.
const LONG: &str = "--size 2048x2048 --frames 1000000 --backend cpu";

/// Runs a command that must be refused and must leave everything as it was.
fn spares(place: &Place, words: &str, parts: &[&str]) {
    let before = place.contents();
    let run = place.shell(&format!("timeout 60 \"$EPIGRAPH\" {words}"));
    assert_eq!(run.code, Some(1), "`{words}`: {}", run.stderr);
    assert_says(&run.stderr, parts);
    assert!(place.contents() == before, "`{words}` changed a file");
}

#[test]
fn no_output_is_an_input() {
    let place = inputs();
    let model = "--scene scene.ron";
    for (words, option, input) in [
        // The graph, its base, a part, a shader.
        ("check main.ron --json main.ron".to_owned(), "--json", "main.ron"),
        ("check main.ron --dot base.ron".into(), "--dot", "base.ron"),
        ("check main.ron --full view.ron".into(), "--full", "view.ron"),
        ("check main.ron --json blur.wgsl".into(), "--json", "blur.wgsl"),
        ("check epi --swap antialias=blur.wgsl --dot blur.wgsl".into(), "--dot", "blur.wgsl"),
        ("check broken.ron --json broken.ron".into(), "--json", "broken.ron"),
        // The scene, a model in it, the model's materials and buffers.
        (format!("check epi {model} --json scene.ron"), "--json", "scene.ron"),
        (format!("check epi {model} --json cube.obj"), "--json", "cube.obj"),
        (format!("check epi {model} --json cube.mtl"), "--json", "cube.mtl"),
        ("check epi --scene model.gltf --json model.bin".into(), "--json", "model.bin"),
        ("check epi --camera fly:flight.ron --dot flight.ron".into(), "--dot", "flight.ron"),
        // Every command and option.
        (format!("main.ron {LONG} --json main.ron"), "--json", "main.ron"),
        (format!("base.ron {LONG} --sheet scene.ron --scene scene.ron"), "--sheet", "scene.ron"),
        (format!("base.ron {LONG} --out link.png"), "--out", "base.ron"),
        (format!("{LONG} --camera fly:flight.ron --save cull.id=hard.csv"), "--save", "flight.ron"),
        ("stages main.ron --json view.ron".into(), "--json", "view.ron"),
        ("stages blur.wgsl --json blur.wgsl".into(), "--json", "blur.wgsl"),
        (format!("reference {model} --spp 1000000 --size 2048x2048 --out scene.exr"), "--out", "scene.ron"),
        (
            "reference --camera fly:flight.ron --spp 1000000 --size 2048x2048 --out r.exr --edges flight.png"
                .into(),
            "--edges",
            "flight.ron",
        ),
        ("compare a.png b.png --map a.png".into(), "--map", "a.png"),
        ("compare a.png b.png --json b.png".into(), "--json", "b.png"),
        ("compare a.png b.png --mask m.png --map m.png".into(), "--map", "m.png"),
        (
            "bench --size 2048x2048 --backend cpu --graph main.ron --json blur.wgsl".into(),
            "--json",
            "blur.wgsl",
        ),
        (
            "bench --size 2048x2048 --backend cpu --scene cornell --scene scene.ron --plot cube.svg".into(),
            "--plot",
            "cube.obj",
        ),
        (
            "gallery --out page --scene cornell --camera fly:flight.ron --frames 1000000 --backend cpu"
                .into(),
            "--out",
            "flight.ron",
        ),
        (
            "gallery --out pictures --graph base.ron --scene cornell --frames 1000000 --backend cpu".into(),
            "--out",
            "base.ron",
        ),
        (
            "quality base.ron --scene cornell --spp 1000000 --backend cpu --json base.ron".into(),
            "--json",
            "base.ron",
        ),
        (
            "quality base.ron --scene cornell --spp 1000000 --backend cpu --csv base.ron".into(),
            "--csv",
            "base.ron",
        ),
        (
            "quality --scene scene.ron --spp 1000000 --backend cpu --plot cube.svg".into(),
            "--plot",
            "cube.obj",
        ),
        ("encode points.xyz --out points-link.vts".into(), "--out", "points.xyz"),
        ("encode points.xyz --out p.vts --json points.xyz".into(), "--json", "points.xyz"),
        ("encode scene.ron --out p.vts --json cube.mtl".into(), "--json", "cube.mtl"),
        ("decode points.vts --out points-link.ply".into(), "--out", "points.vts"),
        // By every spelling and link.
        ("check ./main.ron --json page/../main.ron".into(), "--json", "main.ron"),
        ("check linked.ron --json main.ron".into(), "--json", "main.ron"),
        ("check main.ron --json linked.ron".into(), "--json", "main.ron"),
    ] {
        let input = place.path(input).canonicalize().expect("it is there");
        let would = format!("would replace {}, which the command reads; name another file", input.display());
        spares(&place, &words, &[option, &would]);
    }
    // Refused only for what is read: what lies beside may be replaced.
    place.succeeds("check epi --json main.ron");
    place.succeeds("compare a.png b.png --map m.png");
}

#[test]
fn no_two_outputs_are_one_file() {
    let place = inputs();
    for (words, parts) in [
        (
            format!("{LONG} --out s.png --sheet s.png"),
            ["--out and --sheet both write s.png", "name another file"],
        ),
        (
            format!("{LONG} --out s.png --json ./s.png"),
            ["--out and --json both write ./s.png", "name another file"],
        ),
        (format!("{LONG} --out s.png --json page/../s.png"), ["--out and --json both write", "name another"]),
        // A link to a file that is not there yet.
        (
            format!("{LONG} --out s.png --sheet to-s.png"),
            ["--out and --sheet both write to-s.png", "name another"],
        ),
        (
            format!("{LONG} --out a.png --json a-too.png"),
            ["--out and --json both write a-too.png", "name another"],
        ),
        (format!("{LONG} --json epigraph.png"), ["--out and --json both write epigraph.png", "name another"]),
        (
            format!("{LONG} --json epigraph-sheet.png"),
            ["--sheet and --json both write epigraph-sheet.png", "name another"],
        ),
        (
            format!("{LONG} --save cull.id=a.exr --save cull.depth=./a.exr"),
            ["--save and --save both write ./a.exr", "name another"],
        ),
        (
            "reference --out s.png --edges ./s.png".into(),
            ["--out and --edges both write ./s.png", "name another"],
        ),
        ("check epi --json a --dot ./a".into(), ["--json and --dot both write ./a", "name another"]),
        ("check epi --full a --dot ./a".into(), ["--dot and --full both write a", "name another"]),
        (
            "compare a.png b.png --map m.png --json ./m.png".into(),
            ["--map and --json both write", "name another"],
        ),
        (
            "bench --json b.svg --plot ./b.svg".into(),
            ["--json and --plot both write ./b.svg", "name another"],
        ),
        (
            "quality --json b.svg --plot ./b.svg".into(),
            ["--json and --plot both write ./b.svg", "name another"],
        ),
        (
            "encode points.xyz --out p.vts --json ./p.vts".into(),
            ["--out and --json both write ./p.vts", "name another"],
        ),
    ] {
        spares(&place, &words, &parts);
    }
    // Streams are not files: all that is written to them arrives.
    place.succeeds("check epi --json /dev/null --dot /dev/null");
}

#[test]
fn no_output_is_where_the_results_go() {
    let place = Place::new();
    for (shell, stream) in [("> plan", "stdout"), ("2> plan", "stderr"), (">> ./plan", "stdout")] {
        let run = place.shell(&format!("\"$EPIGRAPH\" check epi --dot plan {shell}"));
        assert_eq!(run.code, Some(1), "{shell}");
        let said = run.stderr + &fs::read_to_string(place.path("plan")).expect("the shell made it");
        assert_says(&said, &[&format!("{stream} and --dot both write plan; name another file")]);
    }
    place.succeeds("check epi --dot plan");
}
