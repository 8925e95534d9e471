//! The program alone, as `cargo install` leaves it: graphs and scenes come with it.

use epigraph_scenes::scene_names;

use crate::support::Place;

const SMALL: &str = "--size 64x48 --frames 3 --samples 20% --backend cpu";

#[test]
fn an_empty_folder_is_enough() {
    let place = Place::new();
    place.succeeds(&format!("render {SMALL}"));
    assert_eq!(place.files(), ["epigraph-sheet.png", "epigraph.png"]);
    for graph in epigraph::graphs::names() {
        place.succeeds(&format!("render {graph} {SMALL}"));
        place.succeeds(&format!("check {graph}"));
    }
    for scene in scene_names().into_iter().filter(|scene| !scene.needs_fetch) {
        place.succeeds(&format!("render render-cache --scene {} {SMALL}", scene.name));
    }
}
