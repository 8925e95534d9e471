use epigraph_editor::intent::Intent;
use image::imageops;

use super::*;

/// Moves the pointer to a position without hover text.
fn rest(opened: &mut Opened) {
    opened.harness.hover_at(egui::pos2(640.0, 705.0));
    opened.harness.run_steps(4);
}

#[test]
fn text_and_parameters() {
    let mut opened = window("epi.ron");
    opened.click("interpolate");
    opened.click("Text");
    rest(&mut opened);
    compare(&mut opened, "text-and-parameters");
}

#[test]
fn a_shader() {
    let mut opened = window("experiments/outline.ron");
    opened.click("Shader");
    rest(&mut opened);
    // Only the pane: the rest of the window shows the name of the GPU.
    let image = opened.harness.render().unwrap();
    let pane = imageops::crop_imm(&image, 0, 38, 320, 640).to_image();
    try_image_snapshot_options(&pane, "shader", &options()).unwrap();
}

#[test]
fn a_pixel() {
    let mut opened = window("epi.ron");
    let pixel = [150, 118];
    opened.push(Intent::Inspect(pixel));
    opened.until("the pixel", |app| {
        app.session.state.inspection.as_ref().is_some_and(|found| found.pixel == pixel)
    });
    rest(&mut opened);
    compare(&mut opened, "pixel");
}

#[test]
fn the_cloud_and_the_shares_of_classes() {
    let mut opened = window("epi.ron");
    opened.click("Cloud");
    // The engine runs one more frame for a newly watched port. Wait for it, as two requests might share a frame.
    opened.until("the ages", |app| app.session.state.fields("cloud/age.histogram").next().is_some());
    opened.push(Intent::Show("edges/classify.cls".into()));
    opened.until("the classes", |app| app.session.state.fields("edges/classify.cls").next().is_some());
    rest(&mut opened);
    compare(&mut opened, "cloud-and-classes");
}
