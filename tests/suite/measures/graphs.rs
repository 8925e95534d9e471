//! The ports of the shipped graphs, and what their stages explain about pixels.

use std::{collections::HashSet, sync::Arc};

use epigraph::Place;
use epigraph_core::{Capture, GraphFile, Settings, Snapshot, testing::Random};
use epigraph_scenes::{
    Scene,
    streams::{Codec, PointSet, Points, encode},
};
use epigraph_tests::{GRAPHS, POINT_GRAPH, Run, graph, sampled};
use glam::{DVec3, Quat, Vec3};

use super::{Figure, Figures, assert_same};
use crate::sides::with_random_parameters;

/// Scenes and camera paths.
const PLACES: [(&str, &str); 5] = [
    ("cornell", "orbit"),
    ("cornell-moving", "shake"),
    ("chains", "fly"),
    ("cornell", "still"),
    ("cornell-moving", "still"),
];

impl Figure {
    /// Adds the elements of a port.
    fn port(&mut self, snapshot: &Snapshot) {
        self.debug(&(snapshot.dims, &snapshot.element));
        let size = snapshot.element.bytes() as usize;
        let floats = snapshot.element.floats();
        for element in snapshot.bytes.chunks_exact(size) {
            for at in (0..size).step_by(4) {
                let word: [u8; 4] = std::array::from_fn(|byte| element[at + byte]);
                match floats.contains(&at) {
                    true => self.number(f64::from(f32::from_le_bytes(word))),
                    false => self.exact(&word),
                }
            }
        }
    }
}

/// Runs some frames on the CPU, and adds figures of all ports and of what the stages explain.
fn measure(what: &str, file: &GraphFile, place: &Place, settings: &Settings, figures: &mut Figures) {
    // What stages explain follows from their scratch ports too.
    let mut run = Run::with_ports(file, place, settings, |_| true);
    let nodes = run.graph().nodes.iter();
    let scratch: HashSet<String> = nodes
        .flat_map(|node| {
            let ports = node.declaration().ports.iter().filter(|port| port.scratch);
            ports.map(|port| format!("{}.{}", node.name, port.name))
        })
        .collect();
    for _ in 0..5 {
        let frame = run.next_frame();
        run.frame(true);
        let ran: Vec<bool> = run.executor.ran().iter().copied().collect();
        figures.entry(format!("{what} ran")).or_default().debug(&ran);
        let snapshots = run.executor.snapshots().expect("on the CPU");
        for snapshot in snapshots.iter().filter(|snapshot| !scratch.contains(&snapshot.name)) {
            let Snapshot { name, field, .. } = snapshot;
            let dot = if field.is_empty() { "" } else { "." };
            figures.entry(format!("{what} {name}{dot}{field}")).or_default().port(snapshot);
        }
        let capture = Capture { frame, snapshots: snapshots.into_iter().cloned().map(Into::into).collect() };
        let graph = run.graph();
        let [width, height] = settings.size;
        for (id, node) in graph.nodes.iter_enumerated() {
            for pixel in (0..width * height).step_by(13) {
                let site = capture.site(graph, id, [pixel % width, pixel / width], Some(pixel as usize));
                if let Some(findings) = node.stage.explain(&site) {
                    figures.entry(format!("{what} {} explained", node.name)).or_default().debug(&findings);
                }
            }
        }
    }
}

#[test]
fn ports_of_the_shipped_graphs_are_as_before() {
    let mut figures = Figures::new();
    for (index, name) in GRAPHS.iter().enumerate() {
        let (scene, camera) = PLACES[index % PLACES.len()];
        let place = Place::load(scene, camera).expect("a scene and a camera path");
        let file = crate::sides::without_placements(graph(name));
        let what = format!("{} {scene} {camera}", name.trim_end_matches(".ron"));
        measure(&what, &file, &place, &sampled([41, 33], 0.08), &mut figures);
    }
    assert_same("graphs", &figures);
}

#[test]
fn ports_with_random_parameters_are_as_before() {
    let mut figures = Figures::new();
    for index in 0..30 {
        let name = ["epi.ron", "render-cache.ron", "experiments/complex-pixels.ron"][index % 3];
        let (file, _) = with_random_parameters(name, index as u64);
        let (scene, camera) = PLACES[index / 3 % PLACES.len()];
        let place = Place::load(scene, camera).expect("a scene and a camera path");
        let what = format!("{} {scene} {camera}", name.trim_end_matches(".ron"));
        let settings = Settings { poison: true, ..sampled([33, 26], 0.08) };
        measure(&what, &file, &place, &settings, &mut figures);
    }
    assert_same("parameters", &figures);
}

/// A bumpy ball twice, beside each other, the second one turned.
fn balls(codec: Codec, levels: u32, bare: bool) -> Arc<Scene> {
    let mut random = Random(8);
    let directions: Vec<Vec3> = (0..6000)
        .map(|_| Vec3::from([0; 3].map(|_| random.between(-1.0, 1.0))).normalize_or(Vec3::X))
        .collect();
    let radius = |d: &Vec3| 1.0 + 0.1 * (7.0 * d.x).sin() * (5.0 * d.y).cos();
    let color = |d: &Vec3| d.to_array().map(|c| (127.0 + 127.0 * c) as u8);
    let points = Points {
        colors: (!bare).then(|| directions.iter().map(color).map(|[r, g, b]| [r, g, b, 255]).collect()),
        normals: (!bare).then(|| directions.clone()),
        ..Points::from(directions.iter().map(|d| *d * radius(d)).collect::<Vec<_>>())
    };
    let settings = epigraph_scenes::streams::Settings { codec, levels, ..Default::default() };
    let model = encode(&points, &settings).expect("few points");
    let place = |rotation, x| epigraph_scenes::streams::Place {
        model: 0,
        rotation,
        translation: Vec3::new(x, 0.0, 0.0),
    };
    let places = vec![place(Quat::IDENTITY, -1.0), place(Quat::from_rotation_y(1.0), 1.5)];
    Arc::new(Scene::of_points("balls", Arc::new(PointSet::new(DVec3::ZERO, vec![model], places))))
}

#[test]
fn ports_that_show_point_sets_are_as_before() {
    let mut figures = Figures::new();
    let mut random = Random(2);
    for (index, camera) in ["orbit:30", "fly", "still", "shake"].iter().cycle().take(12).enumerate() {
        let codec = [Codec::Best, Codec::Streams, Codec::Brick, Codec::Packed][index / 3];
        let scene = balls(codec, [5, 1, 3][index % 3], index % 5 == 4);
        let place = Place::new(scene, camera).expect("a camera path");
        let mut file = graph(POINT_GRAPH);
        let one_of =
            |texts: &[&'static str], random: &mut Random| texts[random.below(texts.len() as u32) as usize];
        let room = one_of(&["9.0", "32.0"], &mut random);
        for (node, param, value) in [
            ("cut", "points_per_pixel", room),
            ("decode", "points_per_pixel", room),
            ("cut", "cell", one_of(&["0.7", "1.5", "0.3", "5.0"], &mut random)),
            ("cut", "merge", one_of(&["0.7", "1.0", "0.2"], &mut random)),
            ("cut", "cache", one_of(&["0", "1"], &mut random)),
            ("cut", "upload", one_of(&["4096", "16", "1"], &mut random)),
            ("decode", "show", one_of(&["Color", "Color", "Level", "Pool"], &mut random)),
            ("decode", "light", one_of(&["0.8", "0.0", "1.0"], &mut random)),
        ] {
            file = file.with_param("the test", node, param, value).expect("a valid value");
        }
        measure(&format!("{index} {camera}"), &file, &place, &sampled([43, 31], 0.1), &mut figures);
    }
    assert_same("point-sets", &figures);
}
