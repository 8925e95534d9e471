//! Ctrl-C ends a run at the next frame. Output files are complete or absent.

use std::{
    fs,
    process::Command,
    time::{Duration, Instant},
};

use crate::support::{Place, Running};

/// The bit of SIGINT in a mask of signals.
const SIGINT: u64 = 1 << 1;

/// Waits until the program handles Ctrl-C, then sends it.
fn interrupt(running: &Running) {
    let status = format!("/proc/{}/status", running.id());
    let takes_it = || {
        let text = fs::read_to_string(&status).expect("the program runs");
        let mask = text.lines().find_map(|line| line.strip_prefix("SigCgt:")).expect("a mask of signals");
        u64::from_str_radix(mask.trim(), 16).expect("a hexadecimal number") & SIGINT != 0
    };
    let start = Instant::now();
    while !takes_it() {
        assert!(start.elapsed() < Duration::from_secs(60), "the program never takes Ctrl-C");
        std::thread::sleep(Duration::from_millis(5));
    }
    let sent = Command::new("kill").args(["-INT", &running.id().to_string()]).status();
    assert!(sent.expect("kill is there").success());
}

#[test]
fn a_run_that_is_interrupted_writes_its_last_frame() {
    let place = Place::new();
    let words = "render --size 48x32 --samples 20% --backend cpu --frames 1000000000 --out p.png \
                 --save interpolate.color=c.exr --json figures.json";
    let running = place.start(words);
    interrupt(&running);
    let run = running.wait();
    assert_eq!(run.code, Some(130), "{}\n{}", run.stdout, run.stderr);
    assert_eq!(place.files(), ["c.exr", "figures.json", "p.png"]);
    let figures: serde_json::Value =
        serde_json::from_slice(&fs::read(place.path("figures.json")).unwrap()).expect("JSON");
    let frames = figures["frames"].as_u64().expect("a number");
    assert!((1..1_000_000_000).contains(&frames));
    let said = format!("interrupted after {frames} of 1000000000 frames");
    assert!(run.stderr.contains(&said), "{}", run.stderr);
    // The picture equals that of a run of this many frames.
    place.succeeds(&format!(
        "render --size 48x32 --samples 20% --backend cpu --frames {frames} --out same.png"
    ));
    let bytes = |name: &str| fs::read(place.path(name)).expect("written");
    assert!(bytes("p.png") == bytes("same.png"), "another picture than that of {frames} frames");
}

#[test]
fn an_experiment_that_is_interrupted_keeps_its_cells() {
    let place = Place::new();
    let text = |frames: u32| {
        format!(
            "Tradeoff(version: 1, graphs: [\"render-cache\"], scenes: [\"cornell\"], sizes: [\"24x16\"], frames: {frames}, \
             reference: (spp: 2), backend: \"cpu\")"
        )
    };
    place.write("t.ron", text(9_000_000));
    let running = place.start("tradeoff t.ron --out a");
    interrupt(&running);
    let run = running.wait();
    assert_eq!(run.code, Some(130), "{}\n{}", run.stdout, run.stderr);
    assert!(run.stderr.contains("interrupted; 0 of 1 cells are done and kept in a/cells"), "{}", run.stderr);
    assert!(!place.path("a/results.csv").exists());
    place.write("t.ron", text(3));
    place.succeeds("tradeoff t.ron --out a");
}

#[test]
fn an_interrupted_table_goes_on_from_what_is_kept() {
    let place = Place::new();
    let words = "quality render-cache --scene cornell --camera orbit --size 24x16 --spp 2 --backend cpu --paths 1 --keep k";
    let running = place.start(&format!("{words} --frames 9000000 --json q.json"));
    interrupt(&running);
    let run = running.wait();
    assert_eq!(run.code, Some(130), "{}\n{}", run.stdout, run.stderr);
    assert!(run.stderr.contains("interrupted; 0 of 1 cells are done and kept in k/cells"), "{}", run.stderr);
    assert!(!place.path("q.json").exists());
    place.succeeds(&format!("{words} --frames 3 --json q.json"));
}

#[test]
fn work_without_frames_writes_nothing_when_interrupted() {
    let place = Place::new();
    // Some seconds of work.
    let line = |i: u32| format!("{} {} {}\n", i % 509, i % 1021, i.wrapping_mul(2_654_435_761) >> 22);
    place.write("points.xyz", (0..200_000).map(line).collect::<String>());
    for words in [
        "encode points.xyz --out p.vts --json p.json",
        "reference --size 64x64 --spp 1000000 --out r.exr",
        "quality --size 64x64 --spp 1000000 --scene cornell --camera still --json q.json",
        "bench --scene cornell --backend cpu --size 64x64 --frames 100000 --sweep none --json b.json",
    ] {
        let running = place.start(words);
        interrupt(&running);
        let run = running.wait();
        assert_eq!(run.code, Some(130), "`{words}`: {}\n{}", run.stdout, run.stderr);
        assert!(run.stderr.contains("interrupted; nothing was written"), "`{words}`: {}", run.stderr);
        assert_eq!(place.files(), ["points.xyz"], "`{words}` left something behind");
    }
}
