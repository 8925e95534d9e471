use std::{
    fs,
    path::{Path, PathBuf},
};

use egui::{Key, Modifiers, accesskit::Role};
use egui_kittest::kittest::Queryable;
use epigraph_editor::intent::{Intent, Jump};

use crate::support::Opened;

/// A window on the render cache with a `wgsl` node, after some frames.
fn outlined(render: bool) -> (Opened, PathBuf) {
    let mut opened = Opened::with("experiments/outline.ron", render, [64, 48]);
    opened.frames(3);
    let shader = opened.path.with_file_name("outline.wgsl");
    (opened, shader)
}

const SOUND: &str = "textureStore(outlined";
const BROKEN: &str = "textureStor(outlined";

/// The number of the shader's broken line, from 1.
fn broken_line(text: &str) -> usize {
    1 + text.lines().position(|line| line.contains(BROKEN)).unwrap()
}

#[test]
fn a_shader_broken_by_another_program_keeps_the_last_good_one_running() {
    let (mut opened, shader) = outlined(false);
    let sound = fs::read_to_string(&shader).unwrap();
    let broken = sound.replace(SOUND, BROKEN);
    fs::write(&shader, &broken).unwrap();
    opened.until("the problem", |app| !app.session.problems().is_empty());
    let problem = opened.app().session.problems()[0].clone();
    let place = problem.place.as_ref().unwrap();
    assert_eq!((PathBuf::from(&place.file), place.line), (shader.clone(), broken_line(&broken)));
    assert_eq!(problem.node.as_deref(), Some("outline"));
    assert!(problem.error.to_string().contains("textureStor"), "{problem}");
    // The last good graph keeps running.
    opened.frames(2);
    let kind = opened.app().session.state.graph.as_ref().unwrap().node("outline").unwrap().kind.clone();
    assert_eq!((kind.as_str(), &opened.app().session.state.trouble), ("wgsl", &None));
    // A click on the problem moves the cursor to its line.
    opened.harness.get_by_label_contains("outline.wgsl:").click();
    opened.harness.run_steps(6);
    assert_eq!(opened.app().session.selected.as_deref(), Some("outline"));

    fs::write(&shader, sound.replace("1.0 - line", "1.0 - 0.5 * line")).unwrap();
    opened.until("a valid shader", |app| app.session.problems().is_empty());
    opened.frames(1);
    assert!(!opened.app().session.document.is_dirty());
}

#[test]
fn a_shader_is_edited_and_saved() {
    let (mut opened, shader) = outlined(false);
    let sound = fs::read_to_string(&shader).unwrap();
    opened.click("Shader");
    let field = opened.harness.get_by_role(Role::MultilineTextInput);
    assert_eq!(field.value().as_deref(), Some(sound.as_str()));
    field.focus();
    opened.harness.run_steps(2);
    opened.harness.key_press_modifiers(Modifiers::COMMAND, Key::Home);
    opened.harness.run_steps(2);
    opened.harness.get_by_role(Role::MultilineTextInput).type_text("mine");
    opened.until("the problem", |app| !app.session.problems().is_empty());
    let place = opened.app().session.problems()[0].place.clone().unwrap();
    assert!(place.file.ends_with("outline.wgsl"), "{place:?}");
    assert_eq!(fs::read_to_string(&shader).unwrap(), sound, "nothing is written before it is saved");
    opened.harness.key_press_modifiers(Modifiers::COMMAND, Key::Z);
    opened.until("no problem", |app| app.session.problems().is_empty());
    assert!(!opened.app().session.document.is_dirty());

    opened.harness.get_by_role(Role::MultilineTextInput).type_text("// mine\n");
    opened.until("the change", |app| app.session.document.is_dirty());
    opened.frames(1);
    assert_eq!(opened.app().session.problems(), []);
    opened.harness.key_press_modifiers(Modifiers::COMMAND, Key::S);
    opened.harness.run_steps(3);
    let saved = fs::read_to_string(&shader).unwrap();
    assert!(saved.contains("// mine") && saved.len() == sound.len() + "// mine\n".len(), "{saved}");
    assert!(!opened.app().session.document.is_dirty());
}

#[test]
fn the_shader_of_a_stage_can_be_edited() {
    let mut opened = Opened::new("render-cache.ron");
    opened.frames(2);
    assert!(!opened.app().session.document.is_dirty());
    opened.click("Shader");
    opened.harness.state_mut().session.selected = Some("tonemap".into());
    opened.settle(4);
    let sound = epigraph_shaders::text("tonemap.wgsl");
    let field = opened.harness.get_by_role(Role::MultilineTextInput);
    assert_eq!(field.value().as_deref(), Some(sound));
    assert!(opened.harness.query_by_label_contains("Rust twin runs").is_some());
    field.focus();
    opened.harness.run_steps(2);
    opened.harness.key_press_modifiers(Modifiers::COMMAND, Key::Home);
    opened.harness.run_steps(2);
    opened.harness.get_by_role(Role::MultilineTextInput).type_text("mine");
    opened.until("the problem", |app| !app.session.problems().is_empty());
    let problem = opened.app().session.problems()[0].clone();
    let place = problem.place.as_ref().unwrap();
    assert!(place.file.ends_with("tonemap.wgsl") && place.text.contains("mine"), "{problem}");
    opened.frames(1);
    opened.harness.key_press_modifiers(Modifiers::COMMAND, Key::Z);
    opened.until("no problem", |app| app.session.problems().is_empty());
    assert!(!opened.app().session.document.is_dirty());

    // The cursor in a module does not change the selection.
    let module = Path::new(epigraph_shaders::FOLDER).join("shared/frame.wgsl");
    let path = module.display().to_string();
    opened.push(Intent::Jump(Jump { path, at: (1, 1) }));
    opened.settle(4);
    assert_eq!(opened.app().session.selected.as_deref(), Some("tonemap"));
}

#[test]
fn the_cursor_and_the_selection_follow_each_other() {
    let mut opened = Opened::new("epi.ron");
    opened.frames(1);
    let line_of = |text: &str, wanted: &str| 1 + text.lines().position(|line| line.contains(wanted)).unwrap();
    let path = opened.app().session.document.path().to_owned();
    let line = line_of(opened.text(), "method: Spread");
    opened.push(Intent::Jump(Jump { path: path.clone(), at: (line, 10) }));
    opened.until("the node", |app| app.session.selected.as_deref() == Some("spread"));
    // A node in a part is selected by its address.
    let part =
        opened.app().session.document.paths().find(|path| path.ends_with("edges.ron")).unwrap().to_owned();
    let line = line_of(opened.app().session.document.text(&part), "kind: \"reach_cull\"");
    opened.push(Intent::Jump(Jump { path: part, at: (line, 20) }));
    opened.until("the node", |app| app.session.selected.as_deref() == Some("edges/reach_cull"));
    // Conversely, selecting a node in another pane shows its file.
    opened.harness.state_mut().session.selected = Some("tonemap".into());
    opened.harness.run_steps(4);
    assert!(opened.harness.query_by_value("epi.ron").is_some(), "the file of `tonemap`");
}

#[test]
fn searching_counts_and_steps_through_matches() {
    let mut opened = Opened::new("render-cache.ron");
    opened.frames(1);
    opened.click("Text");
    let count = opened.text().to_ascii_lowercase().matches("kind").count();
    opened.harness.key_press_modifiers(Modifiers::COMMAND, Key::F);
    opened.harness.run_steps(3);
    let field = opened.harness.get_all_by_role(Role::TextInput).next().unwrap();
    field.type_text("KIND");
    opened.harness.run_steps(4);
    assert!(opened.harness.query_by_label(&format!("1 of {count}")).is_some());
    opened.click("next match");
    opened.click("next match");
    assert!(opened.harness.query_by_label(&format!("3 of {count}")).is_some());
    (0..3).for_each(|_| opened.click("previous match"));
    assert!(opened.harness.query_by_label(&format!("{count} of {count}")).is_some());
}

/// Writes pictures for review.
#[test]
fn texts_are_drawn() {
    let mut opened = Opened::with("epi.ron", true, [256, 256]);
    opened.frames(3);
    opened.click("interpolate");
    opened.click("Text");
    opened.harness.key_press_modifiers(Modifiers::COMMAND, Key::F);
    opened.harness.run_steps(3);
    opened.harness.get_all_by_role(Role::TextInput).next().unwrap().type_text("sigma");
    opened.harness.run_steps(10);
    let text = opened.shot("text-search");
    let (mut opened, shader) = outlined(true);
    let broken = fs::read_to_string(&shader).unwrap().replace(SOUND, BROKEN);
    fs::write(&shader, broken).unwrap();
    opened.until("the problem", |app| !app.session.problems().is_empty());
    opened.harness.get_by_label_contains("outline.wgsl:").click();
    opened.harness.run_steps(10);
    assert_ne!(opened.shot("shader-broken"), text);
}

#[test]
fn a_node_is_shown_where_the_graph_changes_it_and_else_in_the_base_which_stays() {
    let mut opened = Opened::with("experiments/blur.ron", true, [64, 48]);
    opened.frames(1);
    opened.click("Text");
    let before = opened.text().to_owned();
    let select = |opened: &mut Opened, node: &str| {
        opened.harness.state_mut().session.selected = Some(node.into());
        opened.settle(6);
    };
    let is_base =
        |opened: &Opened| opened.harness.query_by_label_contains("It comes with the program").is_some();
    let field = |opened: &Opened| {
        let field = opened.harness.get_by_role(Role::MultilineTextInput);
        (field.value().unwrap_or_default(), field.rect().center())
    };
    select(&mut opened, "antialias");
    assert!(!is_base(&opened) && field(&opened).0 == before);

    select(&mut opened, "tonemap");
    let (text, at) = field(&opened);
    assert!(is_base(&opened) && text.contains("\"tonemap\": ("), "{text}");
    opened.shot("text-of-a-base");
    for pressed in [true, false] {
        let (button, modifiers) = (egui::PointerButton::Primary, Modifiers::NONE);
        opened.harness.event(egui::Event::PointerButton { pos: at, button, pressed, modifiers });
        opened.settle(2);
    }
    opened.harness.event(egui::Event::Text("typed".into()));
    opened.settle(3);
    assert!(field(&opened).0 == text && !opened.app().session.document.is_dirty());

    // A part of the base.
    select(&mut opened, "view/cull");
    assert!(is_base(&opened) && field(&opened).0.contains("\"cull\": ("));
}
