//! Loading a mesh takes memory in proportion to its file. The allocator that counts is global, so this test is a binary of
//! its own, and has one test.

use std::fmt::Write;

use epigraph_scenes::Scene;
use peak_alloc::PeakAlloc;

#[global_allocator]
static ALLOCATOR: PeakAlloc = PeakAlloc;

/// What the corners of faces refer to.
#[derive(Clone, Copy, Debug)]
enum Corners {
    Positions,
    Normals,
    All,
}

/// A wavy sheet of 2 n² triangles, with six decimals, as programs write them.
fn sheet(n: u32, corners: Corners) -> String {
    let mut text = String::new();
    let places = || (0..=n).flat_map(|j| (0..=n).map(move |i| [i, j].map(|at| at as f32 / n as f32)));
    for [x, y] in places() {
        writeln!(text, "v {:.6} {:.6} {:.6}", 10.0 * x, 0.3 * (9.0 * x).sin() * (7.0 * y).cos(), -10.0 * y)
            .unwrap();
    }
    if let Corners::All = corners {
        places().for_each(|[x, y]| writeln!(text, "vt {x:.6} {y:.6}").unwrap());
    }
    if !matches!(corners, Corners::Positions) {
        places().for_each(|[x, y]| writeln!(text, "vn {:.6} {:.6} {:.6}", 0.1 * x, 0.98, -0.1 * y).unwrap());
    }
    let corner = |at: u32| match corners {
        Corners::Positions => format!("{at}"),
        Corners::Normals => format!("{at}//{at}"),
        Corners::All => format!("{at}/{at}/{at}"),
    };
    for first in (0..n).flat_map(|j| (0..n).map(move |i| j * (n + 1) + i + 1)) {
        let [a, b, c, d] = [first, first + 1, first + n + 2, first + n + 1].map(corner);
        writeln!(text, "f {a} {b} {c}\nf {a} {c} {d}").unwrap();
    }
    text
}

#[test]
fn an_obj_file_takes_a_few_times_its_length_while_it_is_loaded() {
    let folder = tempfile::tempdir().unwrap();
    // Measured: 5.6, 3.9 and 3.2 times.
    for (corners, most) in [(Corners::Positions, 6.0), (Corners::Normals, 4.5), (Corners::All, 3.5)] {
        let path = folder.path().join("sheet.obj");
        let text = sheet(300, corners);
        std::fs::write(&path, &text).unwrap();
        let length = text.len();
        drop(text);
        ALLOCATOR.reset_peak_usage();
        let before = ALLOCATOR.current_usage();
        let scene = Scene::load(path.to_str().unwrap()).unwrap();
        let times = (ALLOCATOR.peak_usage() - before) as f64 / length as f64;
        println!("{corners:?}: {times:.2}");
        assert_eq!(scene.mesh.triangles.len(), 2 * 300 * 300 + 2, "with those of the light that is added");
        assert!(times < most, "{corners:?}: {times} times the file");
    }
}
