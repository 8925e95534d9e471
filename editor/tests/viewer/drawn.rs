use egui::vec2;

use super::*;

/// Draws all modes of the viewer, and writes pictures of them beside the test programs, for review. Without an overlay,
/// the image must be in the window pixel for pixel.
#[test]
fn every_state_is_drawn() {
    let mut view = View::new([256, 256], true, 20);
    let mut shots: Vec<Vec<u8>> = Vec::new();
    let mut shot = |view: &mut View, name: &str| {
        view.settle();
        let window = view.opened.shot(&format!("viewer-{name}"));
        if ["histogram", "depth", "false-colour", "edges", "classes", "reach", "ages"].contains(&name) {
            let share = view.opened.share_in(&window);
            assert!(share > 0.9, "{name}: {share}");
        }
        shots.push(window);
    };
    view.click("Histogram");
    shot(&mut view, "histogram");
    view.click("Compare");
    view.set("tonemap", "exposure", "0.5");
    view.opened.until("figures", |app| {
        let flip = |viewer: &Viewer| Some(viewer.compare.as_ref()?.figures()?.flip);
        app.viewers().find_map(flip).is_some_and(|flip| flip > 0.1)
    });
    shot(&mut view, "wipe");
    view.click("Histogram");
    view.click("FLIP map");
    shot(&mut view, "flip");
    view.wheel(view.image().center(), 400.0);
    view.click("Difference");
    shot(&mut view, "difference");
    view.choose("held: image, frame 19", "an image file …");
    shot(&mut view, "file");
    view.click("Compare");
    view.click("Fit");
    let middle = view.image().center();
    view.see("interpolate.color");
    view.wheel(middle, 960.0);
    shot(&mut view, "values");
    view.click("Fit");
    view.see("view/cull.filtered");
    view.click("Histogram");
    shot(&mut view, "depth");
    view.choose("Depth", "False colour");
    shot(&mut view, "false-colour");
    view.click("Histogram");
    view.see("edges/edge_raster.mask");
    shot(&mut view, "edges");
    // The position of a box's corner in the fitted image.
    let image = view.image();
    let edge = image.center() + vec2(-0.196, 0.36) * image.height();
    view.wheel(edge, 640.0);
    shot(&mut view, "edges-near");
    view.see("edges/classify.cls");
    shot(&mut view, "classes-near");
    view.click("Fit");
    shot(&mut view, "classes");
    view.see("edges/reach.r24");
    view.hover(edge);
    shot(&mut view, "reach");
    view.wheel(edge, 500.0);
    shot(&mut view, "reach-middle");
    view.wheel(edge, 140.0);
    shot(&mut view, "reach-near");
    view.click("Fit");
    view.see("view/project.id");
    view.click("Ages");
    view.opened.until("the ages", |app| app.session.state.fields("cloud/age.cloud").next().is_some());
    shot(&mut view, "ages");
    view.see("cloud/age.cloud");
    view.click("position.y");
    view.opened.until("the order", |app| {
        app.viewers().any(|viewer| viewer.list.as_ref().is_some_and(|list| list.page(4) != [0, 1, 2, 3]))
    });
    shot(&mut view, "list");
    assert!(shots.windows(2).all(|pair| pair[0] != pair[1]), "each state looks different");
}
