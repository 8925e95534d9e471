//! The small examples do what their first lines say. `own_stage`, a package of its own, has its test in
//! `tests/outside.rs`.

use std::{path::Path, process::Command};

/// Runs an example in an empty folder. What it printed.
fn run(program: &str, folder: &Path) -> String {
    let output = Command::new(program).current_dir(folder).output().expect("it starts");
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    String::from_utf8(output.stdout).expect("text")
}

#[test]
fn headless_writes_its_frames() {
    let folder = tempfile::tempdir().unwrap();
    let printed = run(env!("CARGO_BIN_EXE_headless"), folder.path());
    let frames: Vec<_> =
        printed.lines().map(|name| image::open(folder.path().join(name)).unwrap().to_rgb8()).collect();
    assert_eq!(frames.len(), 8);
    assert!(frames.iter().all(|frame| frame.dimensions() == (320, 240)));
    // The camera moves, and points gather.
    assert!(frames.windows(2).all(|pair| pair[0] != pair[1]));
}

#[test]
fn read_a_port_sees_the_cloud_fill_the_picture() {
    let folder = tempfile::tempdir().unwrap();
    let printed = run(env!("CARGO_BIN_EXE_read_a_port"), folder.path());
    let shares: Vec<f32> = printed
        .lines()
        .map(|line| line.split([' ', '%']).nth(2).unwrap().parse().unwrap_or_else(|_| panic!("{line}")))
        .collect();
    assert_eq!(shares.len(), 10);
    // Samples of a frame are points of the next one.
    assert_eq!(shares[0], 0.0);
    assert!(shares.is_sorted() && shares[9] > 25.0, "{shares:?}");
}

#[test]
fn own_source_shows_sphere_floor_and_sky() {
    let folder = tempfile::tempdir().unwrap();
    run(env!("CARGO_BIN_EXE_own_source"), folder.path());
    let picture = image::open(folder.path().join("own_source.png")).unwrap().to_rgb8();
    let [sky, sphere] = [[256, 8], [256, 330]].map(|[x, y]| picture.get_pixel(x, y).0);
    assert!(sky[2] > sky[1] && sky[1] > sky[0], "{sky:?}");
    assert!(sphere[0] > sphere[1] && sphere[1] > sphere[2], "{sphere:?}");
}
