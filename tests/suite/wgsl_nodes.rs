//! Shader files alone can stand in for stages: those of `tests/wgsl/` take the places of the shipped nodes, each alone
//! and all together, and the pictures stay the same, byte for byte.

use std::{
    env, fs,
    path::{Path, PathBuf},
    process,
    sync::atomic::{AtomicU32, Ordering},
};

use epigraph_core::{GraphFile, Settings, Side};
use epigraph_tests::{Run, Stage, tap};

/// The files, and the part or graph with the node that each stands in for.
const NODES: [(&str, &str); 5] = [
    ("age", "parts/cloud.ron"),
    ("edge_raster", "parts/edges.ron"),
    ("classify", "parts/edges.ron"),
    ("reach", "parts/edges.ron"),
    ("interpolate", "epi.ron"),
];

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

/// A folder that is removed with it.
struct Folder(PathBuf);

impl Folder {
    fn path(&self) -> &Path {
        &self.0
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        // Left behind it does no harm.
        let _ = fs::remove_dir_all(&self.0);
    }
}

/// A copy of the shipped graphs beside the shader files.
fn copy() -> Folder {
    static NEXT: AtomicU32 = AtomicU32::new(0);
    let name = format!("epigraph-nodes-{}-{}", process::id(), NEXT.fetch_add(1, Ordering::Relaxed));
    let folder = Folder(env::temp_dir().join(name));
    for from in ["../graphs", "../graphs/parts", "wgsl"] {
        let to = folder.path().join(from.trim_start_matches("../graphs").trim_start_matches('/'));
        fs::create_dir_all(&to).unwrap();
        for entry in fs::read_dir(root().join(from)).unwrap() {
            let path = entry.unwrap().path();
            if path.is_file() {
                fs::copy(&path, to.join(path.file_name().unwrap())).unwrap();
            }
        }
    }
    folder
}

/// Changes a graph file by the same edits that the editor makes.
fn edit(file: PathBuf, change: impl FnOnce(&mut GraphFile)) {
    let mut graph = GraphFile::load(&file).unwrap_or_else(|problems| panic!("{problems}"));
    change(&mut graph);
    fs::write(&file, graph.text).unwrap();
}

/// Puts shader files in the places of these nodes.
fn swap(folder: &Path, names: &[(&str, &str)]) {
    for (name, file) in names {
        edit(folder.join(file), |graph| {
            let shader = folder.join("wgsl").join(format!("{name}.wgsl"));
            graph.set_kind(name, "wgsl").unwrap();
            graph.set_param(name, "shader", &format!("{shader:?}")).unwrap();
        });
    }
}

const SIZE: [u32; 2] = [97, 71];

/// What the nodes write, and the picture.
const PORTS: [&str; 9] = [
    "cloud/age.cloud.meta",
    "cloud/age.histogram",
    "edges/edge_raster.mask",
    "edges/edge_raster.vertex",
    "edges/classify.cls",
    "edges/reach.n8",
    "edges/reach.r24",
    "interpolate.color",
    "interpolate.priority",
];

/// The ports and the picture after some frames, of a graph with this many nodes of kind `wgsl`.
fn run(folder: &Path, scene: &'static str, nodes: usize) -> Vec<(&'static str, Vec<u8>)> {
    let file = GraphFile::load(&folder.join("epi.ron")).unwrap_or_else(|problems| panic!("{problems}"));
    let taps = PORTS.iter().map(|port| tap(port.trim_end_matches(".meta"))).collect();
    let settings =
        Settings { side: Side::Gpu, taps, poison: true, ..Settings::new(SIZE, SIZE[0] * SIZE[1] / 20) };
    let mut run = Run::new(&file, Stage { scene, camera: "orbit", settings });
    assert_eq!(run.executor.plan().nodes.iter().filter(|node| node.kind == "wgsl").count(), nodes);
    run.frames(6);
    PORTS.iter().chain(&["image"]).map(|port| (*port, run.captured(port).bytes)).collect()
}

/// Compares a graph with the shipped one.
fn assert_same(names: &[(&str, &str)], shipped: &[(&str, Vec<u8>)], scene: &'static str) {
    let folder = copy();
    swap(folder.path(), names);
    for ((port, found), (_, expected)) in run(folder.path(), scene, names.len()).iter().zip(shipped) {
        let differ = found.iter().zip(expected).filter(|(a, b)| a != b).count();
        assert!(
            found.len() == expected.len() && differ == 0,
            "{names:?} on {scene}: {differ} bytes of {port} differ"
        );
    }
}

#[test]
fn shader_files_stand_in_for_stages() {
    let shipped = run(copy().path(), "cornell", 0);
    for node in NODES {
        assert_same(&[node], &shipped, "cornell");
    }
    assert_same(&NODES, &shipped, "cornell");
    // With lights, bodies and shadow boundaries that move.
    assert_same(&NODES, &run(copy().path(), "cornell-moving", 0), "cornell-moving");
}

#[test]
fn the_comparison_can_fail() {
    let shipped = run(copy().path(), "cornell", 0);
    let folder = copy();
    swap(folder.path(), &NODES);
    edit(folder.path().join("epi.ron"), |graph| graph.set_param("interpolate", "sigma", "0.6").unwrap());
    let differs: Vec<&str> = run(folder.path(), "cornell", NODES.len())
        .iter()
        .zip(&shipped)
        .filter(|((_, found), (_, expected))| found != expected)
        .map(|((port, _), _)| *port)
        .collect();
    assert!(differs.contains(&"interpolate.color") && differs.contains(&"image"), "{differs:?}");
}
