//! `epigraph gallery`: its page and its pictures.

use std::fs;

use crate::support::Place;

const TINY: &str = "gallery --out shown --scene cornell --size 64x48 --frames 3 --spp 1 --backend cpu";

/// The files that a page shows, in its order.
fn shown(page: &str) -> Vec<&str> {
    page.split("](").skip(1).filter_map(|rest| rest.split(')').next()).collect()
}

#[test]
fn the_page_and_its_pictures_match() {
    let place = Place::new();
    let printed = place.succeeds(TINY);
    assert!(printed.contains("gallery.md"), "{printed}");
    let folder = place.path("shown");
    let page = fs::read_to_string(folder.join("gallery.md")).expect("a page");
    let names = shown(&page);
    assert_eq!(names.len(), 4);
    for name in &names {
        let picture = image::open(folder.join(name)).unwrap_or_else(|error| panic!("{name}: {error}"));
        assert!(picture.width() >= 64, "{name}");
    }
    // The folder contains no other files.
    assert_eq!(fs::read_dir(&folder).expect("a folder").count(), names.len() + 1);
    assert!(page.contains("## cornell") && !page.contains("NaN"), "{page}");

    // The first command lines of the section reproduce its two pictures.
    let again = page.lines().filter_map(|line| line.strip_prefix("epigraph "));
    let again: Vec<&str> = again.filter(|line| !line.starts_with("gallery")).collect();
    for (line, name) in again.iter().zip(&names[..2]) {
        place.succeeds(line);
        let [ours, theirs] =
            [place.path(name), folder.join(name)].map(|path| fs::read(path).expect("a file"));
        assert!(ours == theirs, "`{line}` makes another picture");
    }
    // The others measure the same differences from the reference as the page.
    place.succeeds(again[2]);
    for (line, heading) in again[3..].iter().zip(["edge-and-point image, FLIP ", "render cache, FLIP "]) {
        let figures = place.succeeds(line);
        let flip: f64 = figures.split("FLIP").nth(1).and_then(|text| text.trim().parse().ok()).expect("FLIP");
        assert!(page.contains(&format!("{heading}{flip:.3} |")), "{figures}");
    }
}

#[test]
fn wrong_input_leaves_nothing_behind() {
    let place = Place::new();
    let outside = place.fails(&format!("{TINY} --crop 30,0"));
    assert!(outside.contains("use at most 24,8"), "{outside}");
    let twice = place.fails(&format!("{TINY} --scene cornell"));
    assert!(twice.contains("--scene cornell") && twice.contains("names"), "{twice}");
    let nowhere = place.fails("gallery --out none/shown --scene cornell --size 64x48 --frames 1");
    assert!(nowhere.contains("there is no folder"), "{nowhere}");
    let unknown = place.fails("gallery --out shown --scene cornel");
    assert!(unknown.contains("cornell"), "{unknown}");
}
