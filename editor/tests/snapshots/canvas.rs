use egui::{Key, Modifiers};
use egui_kittest::kittest::Queryable;
use epigraph_editor::document::Tag;

use super::*;

#[test]
fn the_canvas_and_a_part_of_it() {
    let mut opened = window("epi.ron");
    opened.click("Canvas");
    opened.click("node edges");
    compare(&mut opened, "canvas");
    opened.harness.get_by_label("node edges").hover();
    opened.harness.key_press_modifiers(Modifiers::NONE, Key::Enter);
    opened.harness.run_steps(3);
    // Move the pointer away from widgets with hover texts.
    opened.harness.get_by_label("Nodes").hover();
    opened.harness.run_steps(3);
    compare(&mut opened, "canvas-part");
}

#[test]
fn a_change_to_a_base_is_marked() {
    let mut opened = window("experiments/blur.ron");
    let source = "spread.color".parse().unwrap();
    let document = &mut opened.harness.state_mut().session.document;
    let edited = document.edit(Tag::Once, |file| {
        // Without its shader, so that the picture does not name the GPU's driver.
        file.restore_node("antialias")?;
        file.set_input("tonemap", "color", Some(&source))?;
        file.set_param("tonemap", "exposure", "1.0")?;
        file.set_bypass("view/predict", true)
    });
    edited.unwrap();
    opened.until("the edited graph", |app| {
        let graph = app.session.state.graph.as_ref();
        graph.is_some_and(|graph| graph.node("antialias").is_none_or(|node| node.kind != "wgsl"))
    });
    opened.frames(1);
    opened.click("Canvas");
    opened.click("node tonemap, changed: color takes spread.color; exposure: 1.0");
    opened.harness.get_by_label("Nodes").hover();
    opened.harness.run_steps(3);
    compare(&mut opened, "canvas-change");
}
