use egui::vec2;
use epigraph_pictures::{EMPTY, Mode, Ramp, edges};

use super::*;

#[test]
fn channels_can_be_shown_in_any_order() {
    let mut view = View::new([64, 48], false, 5);
    let colors = |view: &View| view.viewer().picture().unwrap().colors.clone();
    let all = colors(&view);
    assert!(all.iter().any(|[r, g, _]| r > g));
    view.press(Role::Button, "R");
    assert!(colors(&view).iter().zip(&all).all(|(single, [r, ..])| *single == [*r; 3]));
    view.click("RGB");
    assert_eq!(colors(&view), all);
    // The last of the three boxes is blue.
    view.choose("B", "R");
    assert_eq!(view.viewer().look.channels, [0, 1, 0]);
    assert!(colors(&view).iter().zip(&all).all(|(shown, [r, g, _])| *shown == [*r, *g, *r]));
}

#[test]
fn during_a_pause_the_old_picture_stays_until_the_new_one_is_finished() {
    let mut view = View::new([512, 512], false, 2);
    let before = view.viewer().picture().unwrap().clone();
    view.opened.harness.get_by_role_and_label(Role::Button, "R").click();
    view.opened.until("the red channel", |app| {
        // The picture is never blank or half finished.
        let picture = app.viewers().next().unwrap().picture().unwrap();
        let is_red = picture.colors.iter().zip(&before.colors).all(|(single, [r, ..])| *single == [*r; 3]);
        assert!(is_red || *picture == before);
        is_red
    });
    assert!(view.opened.app().session.state.paused);
    assert_eq!(view.opened.app().session.state.frames, 2, "no frame was run for it");
}

#[test]
fn float_colours_can_be_exposed() {
    let mut view = View::new([64, 48], false, 5);
    assert!(view.opened.harness.query_by_label_contains("exposure ").is_none(), "bytes have no exposure");
    view.see("antialias.color");
    let sum = |view: &View| -> u64 {
        let colors = &view.viewer().picture().unwrap().colors;
        colors.iter().flatten().map(|channel| u64::from(*channel)).sum()
    };
    let before = sum(&view);
    let exposure = view.opened.harness.get_all_by_role(Role::SpinButton);
    let exposure =
        exposure.into_iter().find(|node| node.value().is_some_and(|value| value.contains("exposure")));
    let at = exposure.unwrap().rect().center();
    view.drag(at, at + vec2(90.0, 0.0));
    assert!(view.viewer().look.exposure > 0.5, "{}", view.viewer().look.exposure);
    assert!(sum(&view) > before + before / 5);
    view.click("0");
    assert_eq!(sum(&view), before);
}

#[test]
fn the_ends_of_the_range_are_dragged_on_the_histogram() {
    let mut view = View::new([64, 48], false, 5);
    view.see("interpolate.priority");
    assert_eq!(view.viewer().picture().unwrap().scale.unwrap().range, [0.0, 255.0]);
    view.click("Histogram");
    let (dark, bright) = (view.rect("dark end").center(), view.rect("bright end").center());
    let width = bright.x - dark.x;
    view.drag(bright, bright - vec2(0.5 * width, 0.0));
    let range = view.viewer().look.range.unwrap();
    assert!(range[0] == 0.0 && (range[1] - 127.5).abs() < 3.0, "{range:?}");
    view.drag(dark, dark + vec2(0.25 * width, 0.0));
    let range = view.viewer().look.range.unwrap();
    assert!((range[0] - 63.75).abs() < 3.0 && (range[1] - 127.5).abs() < 3.0, "{range:?}");
    // The ends do not pass each other.
    let dark = view.rect("dark end").center();
    view.drag(dark, dark + vec2(width, 0.0));
    let range = view.viewer().look.range.unwrap();
    assert!(range[0] < range[1], "{range:?}");
    view.click("Auto");
    assert_eq!(view.viewer().look.range, None);
}

#[test]
fn false_colour_has_several_ramps() {
    let mut view = View::new([64, 48], false, 5);
    view.see("view/cull.filtered");
    assert_eq!(view.viewer().picture().unwrap().mode, Mode::Depth);
    view.choose("Depth", "False colour");
    let spectrum = view.viewer().picture().unwrap().colors.clone();
    view.choose("Spectrum", "Magma");
    assert_eq!(view.viewer().look.ramp, Ramp::Magma);
    assert_ne!(view.viewer().picture().unwrap().colors, spectrum);
}

#[test]
fn edge_masks_classes_and_reachability_have_modes_of_their_own() {
    let mut view = View::new([64, 48], false, 5);
    let shows = |view: &View, color: [u8; 3]| view.viewer().picture().unwrap().colors.contains(&color);
    for (port, mode, color) in [
        ("edges/edge_raster.mask", Mode::Edges, edges::EDGE),
        ("edges/classify.cls", Mode::Classes, edges::CLASSES[1].1),
        ("edges/reach.r24", Mode::Reach, [255; 3]),
    ] {
        view.see(port);
        assert_eq!(view.viewer().picture().unwrap().mode, mode, "{port}");
        assert!(shows(&view, color), "{port}");
    }
    // The line below the image describes the pixel under the pointer.
    view.hover(view.image().center());
    assert!(view.opened.harness.query_by_label_contains("of 24").is_some());
}

#[test]
fn ids_can_be_seen_as_ages() {
    let mut view = View::new([64, 48], false, 6);
    view.see("view/project.id");
    let ids = view.viewer().picture().unwrap().colors.clone();
    view.click("Ages");
    let range = |view: &View| Some(view.viewer().picture()?.scale?.range);
    view.opened.until("ages", |app| {
        app.viewers().any(|viewer| viewer.picture().is_some_and(|picture| picture.mode == Mode::FalseColor))
            && app.session.state.snapshots.iter().any(|field| field.field == "meta")
    });
    view.settle();
    let ages = view.viewer().picture().unwrap().clone();
    assert_ne!(ages.colors, ids);
    assert!(range(&view).unwrap()[1] >= 1.0);
    assert!(ages.colors.iter().any(|color| *color != EMPTY));
    view.click("Frames");
    view.opened.until("the dates", |app| app.session.state.fields("cloud/integrate.dates").next().is_some());
    view.settle();
    // Samples that are requested in the first frame arrive in the second.
    let oldest_possible = view.opened.app().session.state.frames - 2;
    let [youngest, oldest] = range(&view).unwrap();
    assert!(
        youngest >= 0.0 && oldest > youngest && oldest <= oldest_possible as f32,
        "{youngest} to {oldest}"
    );
    assert_ne!(view.viewer().picture().unwrap().colors, ages.colors);
    view.click("Ids");
    assert_eq!(view.viewer().picture().unwrap().mode, Mode::Names);
}

#[test]
fn a_port_chosen_during_a_pause_shows_at_once() {
    let mut view = View::new([64, 48], false, 4);
    view.opened.push(Intent::Show("view/project.depth".into()));
    view.opened.until("the depth", |app| {
        app.viewers().any(|viewer| viewer.picture().is_some_and(|picture| picture.mode == Mode::Depth))
    });
    // It shows the paused frame; no other frame was run.
    view.settle();
    assert_eq!(view.opened.app().session.state.frames, 4);
    assert!(view.opened.app().session.state.paused);
}

#[test]
fn several_viewers_show_a_port_each() {
    let mut view = View::new([64, 48], false, 4);
    view.see("view/project.depth");
    view.click("+ View");
    view.see("edges/classify.cls");
    // Put them side by side, so that both are drawn.
    let tabs = view.opened.harness.get_all_by_label("edges/classify.cls").map(|node| node.rect());
    let tab = tabs.min_by(|a, b| a.top().total_cmp(&b.top())).unwrap().center();
    let image = view.image();
    view.drag(tab, image.right_center() - vec2(12.0, 0.0));
    view.opened.frames(1);
    let mut shown: Vec<_> = view
        .opened
        .app()
        .viewers()
        .map(|viewer| (viewer.id, viewer.port.clone(), viewer.picture().unwrap().mode))
        .collect();
    shown.sort_by_key(|(id, ..)| *id);
    assert_eq!(shown[0].1, "view/project.depth");
    assert_eq!((shown[0].2, shown[1].2), (Mode::Depth, Mode::Classes));
}
