use std::collections::BTreeSet;

use egui::{Key, Modifiers, accesskit::Role};
use egui_kittest::{
    Node,
    kittest::{NodeT, Queryable},
};

use crate::support::Opened;

/// Role and name of the focused widget.
fn focused(opened: &Opened) -> String {
    let all = opened.harness.root().children_recursive();
    let on = all.into_iter().find(|node| node.is_focused());
    on.map_or(String::new(), |node| {
        let node = node.accesskit_node();
        let name = node.label().or(node.value()).unwrap_or_default();
        format!("{:?} {name}", node.role())
    })
}

#[test]
fn tab_reaches_every_part_of_the_window_and_enter_presses_buttons() {
    let mut opened = Opened::new("render-cache.ron");
    opened.frames(2);
    let mut seen = BTreeSet::new();
    for _ in 0..400 {
        opened.harness.key_press(Key::Tab);
        opened.harness.run_steps(1);
        seen.insert(focused(&opened));
    }
    let wanted = [
        "Button File",
        "Button Window",
        "Button ▶ Run",
        "Button Step",
        "Button Record a path",
        "Slider Samples",
        "ComboBox",
        "Resolution scale",
        "Pane Nodes",
        "TextInput",
        "Button fill",
        "Pane View",
        "image of image",
        "Pane Parameters",
        "Pane Times",
        "Canvas",
        "Text",
    ];
    for part in wanted {
        assert!(seen.iter().any(|on| on.contains(part)), "{part} is not reached; only {seen:#?}");
    }
    // Enter presses the focused widget.
    for _ in 0..400 {
        opened.harness.key_press(Key::Tab);
        opened.harness.run_steps(1);
        if focused(&opened).ends_with("Button Step") {
            break;
        }
    }
    opened.harness.key_press(Key::Enter);
    opened.until("a frame", |app| app.session.state.frames == 3);
}

#[test]
fn f6_cycles_through_the_panes_and_shortcuts_work_there() {
    let mut opened = Opened::new("render-cache.ron");
    opened.frames(2);
    let mut round = Vec::new();
    for _ in 0..5 {
        opened.harness.key_press(Key::F6);
        opened.harness.run_steps(2);
        round.push(focused(&opened));
    }
    let names: Vec<&str> = round.iter().map(|on| on.rsplit("Pane ").next().unwrap()).collect();
    assert_eq!(names, ["Nodes", "View", "Parameters", "Times", "Nodes"]);
    opened.harness.key_press_modifiers(Modifiers::SHIFT, Key::F6);
    opened.harness.run_steps(2);
    assert!(focused(&opened).ends_with("Pane Times"), "{}", focused(&opened));
    // A full stop runs one frame also if a pane has the focus. From a widget, F6 goes to the next pane.
    opened.harness.key_press(Key::Period);
    opened.until("a frame", |app| app.session.state.frames == 3);
    opened.harness.get_by_role(Role::TextInput).focus();
    opened.harness.run_steps(2);
    opened.harness.key_press(Key::F6);
    opened.harness.run_steps(2);
    assert!(focused(&opened).ends_with("Pane View"), "{}", focused(&opened));
}

#[test]
fn keys_fly_the_camera_if_the_image_has_the_focus() {
    let mut opened = Opened::new("render-cache.ron");
    opened.frames(2);
    let before = opened.app().session.camera().unwrap();
    opened.harness.get_by_label_contains("image of image").focus();
    opened.harness.run_steps(2);
    opened.harness.key_down(Key::W);
    opened.harness.run_steps(10);
    opened.harness.key_up(Key::W);
    opened.harness.run_steps(2);
    assert!(opened.app().session.camera().unwrap().eye.distance(before.eye) > 1e-3);
}

#[test]
fn every_widget_has_an_accessible_name() {
    let mut opened = Opened::new("epi.ron");
    opened.frames(2);
    opened.click("interpolate");
    let roles = [
        Role::Button,
        Role::Slider,
        Role::CheckBox,
        Role::ComboBox,
        Role::TextInput,
        Role::MultilineTextInput,
        Role::SpinButton,
        Role::RadioButton,
        Role::Link,
        Role::Image,
    ];
    let mut nameless = BTreeSet::new();
    let mut named = 0;
    let mut look = |opened: &Opened, place: &str| {
        let all: Vec<_> = opened.harness.root().children_recursive().collect();
        // The number beside a slider belongs to the slider; egui gives it no name.
        let is_of_slider = |number: &Node| {
            let bounds = |node: &Node| node.accesskit_node().bounding_box();
            let beside = |slider: &Node| {
                let (Some(slider), Some(number)) = (bounds(slider), bounds(number)) else { return false };
                slider.y0 == number.y0 && (0.0..16.0).contains(&(number.x0 - slider.x1))
            };
            number.accesskit_node().role() == Role::SpinButton
                && all.iter().any(|other| other.accesskit_node().role() == Role::Slider && beside(other))
        };
        for node in &all {
            let access = node.accesskit_node();
            if !roles.contains(&access.role()) || is_of_slider(node) {
                continue;
            }
            if access.label().is_none_or(|name| name.trim().is_empty()) {
                let at = access.bounding_box().map(|at| (at.x0, at.y0));
                nameless.insert(format!("{place}: {:?} {:?} at {at:?}", access.role(), access.value()));
            } else {
                named += 1;
            }
        }
    };
    look(&opened, "at first");
    for menu in ["File", "Camera", "Output", "Window"] {
        opened.click(menu);
        look(&opened, menu);
        opened.harness.key_press(Key::Escape);
        opened.harness.run_steps(3);
    }
    for (menu, entry) in
        [("File", "Open graph …"), ("File", "New from a graph …"), ("Output", "Save image …")]
    {
        opened.choose(&[menu, entry]);
        look(&opened, entry);
        opened.click("Cancel");
    }
    opened.harness.key_press(Key::F1);
    opened.harness.run_steps(3);
    look(&opened, "help");
    opened.harness.key_press(Key::Escape);
    opened.harness.run_steps(3);
    for pane in ["Text", "Canvas"] {
        opened.click(pane);
        opened.harness.run_steps(3);
        look(&opened, pane);
    }
    assert!(named > 200, "{named}");
    assert!(nameless.is_empty(), "{nameless:#?}");
}

#[test]
fn the_help_lists_the_keys_and_closes() {
    let mut opened = Opened::new("render-cache.ron");
    opened.frames(1);
    let open = |opened: &Opened| opened.harness.query_by_label_contains("next pane, previous pane").is_some();
    assert!(!open(&opened));
    opened.harness.key_press(Key::F1);
    opened.harness.run_steps(3);
    assert!(open(&opened));
    opened.harness.key_press(Key::Escape);
    opened.harness.run_steps(3);
    assert!(!open(&opened));
    opened.choose(&["Window", "Keys and mouse"]);
    assert!(open(&opened));
}
