//! The program alone, as `cargo install` leaves it: graphs and scenes come with it.

use epigraph_scenes::{
    scene_names,
    streams::{Points, Settings, encode},
};
use glam::Vec3;

use crate::support::Place;

const SMALL: &str = "--size 64x48 --frames 3 --samples 20% --backend cpu";

#[test]
fn an_empty_folder_is_enough() {
    let place = Place::new();
    place.succeeds(&format!("render {SMALL}"));
    assert_eq!(place.files(), ["epigraph-sheet.png", "epigraph.png"]);
    let grid = (0..2000).map(|i| Vec3::new((i % 50) as f32, (i / 50) as f32, (i % 7) as f32));
    let points = encode(&Points::from(grid.collect::<Vec<_>>()), &Settings::default()).unwrap();
    std::fs::write(place.path("points.vts"), points.to_bytes()).unwrap();
    for graph in epigraph::graphs::names() {
        let scene = if graph == "streams" { "--scene points.vts" } else { "" };
        place.succeeds(&format!("render {graph} {scene} {SMALL}"));
        place.succeeds(&format!("check {graph}"));
    }
    for scene in scene_names().into_iter().filter(|scene| !scene.needs_fetch) {
        place.succeeds(&format!("render render-cache --scene {} {SMALL}", scene.name));
    }
}
