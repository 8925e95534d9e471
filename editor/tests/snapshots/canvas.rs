use egui::{Key, Modifiers};
use egui_kittest::kittest::Queryable;

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
