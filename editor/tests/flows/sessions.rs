use std::{fs, path::Path};

use egui::ThemePreference;
use egui_kittest::kittest::Queryable;

use crate::support::{Opened, copy};

/// Runs the window long enough to save its session, which it does every second.
fn rest(opened: &mut Opened) {
    opened.harness.run_steps(90);
}

#[test]
fn a_session_is_restored_at_the_next_start() {
    let sessions = tempfile::tempdir().unwrap();
    let (_folder, graph) = copy("epi.ron");
    let mut opened = Opened::started(sessions.path(), Some(&graph), Some("chains"));
    opened.until("the scene", |app| app.session.camera().is_some() && app.session.state.graph.is_some());
    opened.frames(1);
    opened.click("view/project");
    opened.click("View depth");
    opened.harness.key_press_modifiers(egui::Modifiers::COMMAND, egui::Key::Num3);
    opened.click("+ View");
    let session = &mut opened.harness.state_mut().session;
    session.move_camera(|rig| rig.orbit(0.3, 0.1));
    let settings = &mut session.settings;
    settings.theme = ThemePreference::Light;
    (settings.size, settings.scale, settings.samples) = ([96, 64], 0.5, 12.0);
    session.resize();
    rest(&mut opened);
    let look = |opened: &Opened| {
        let (app, session) = (opened.app(), &opened.app().session);
        let mut ports: Vec<_> = app.viewers().map(|viewer| (viewer.id, viewer.port.clone())).collect();
        ports.sort();
        let settings = (session.settings.clone(), app.slots.clone());
        let scene = session.scene().to_owned();
        (session.document.path().to_owned(), scene, session.camera().unwrap(), settings, ports)
    };
    let before = look(&opened);
    assert_eq!(before.4.len(), 2);
    drop(opened);

    let mut opened = Opened::started(sessions.path(), None, None);
    opened.until("the scene", |app| app.session.camera().is_some() && app.session.state.graph.is_some());
    assert_eq!(look(&opened), before);
    assert_eq!(opened.harness.ctx.options(|options| options.theme_preference), ThemePreference::Light);
    opened.frames(1);
    assert_eq!(opened.app().session.state.graph.as_ref().unwrap().size, [48, 32]);
    assert_eq!(opened.app().session.state.camera, Some(before.2));

    // Arguments override the session.
    let (_other, other) = copy("render-cache.ron");
    let opened = Opened::started(sessions.path(), Some(&other), Some("cornell"));
    assert!(opened.app().session.document.path().ends_with("render-cache.ron"));
    assert_eq!(opened.app().session.scene(), "cornell");
}

#[test]
fn a_broken_session_file_is_reported_and_replaced() {
    let sessions = tempfile::tempdir().unwrap();
    fs::write(sessions.path().join("session.ron"), "(graph: \"a.ron\", scene: 7)").unwrap();
    let (_folder, graph) = copy("epi.ron");
    let mut opened = Opened::started(sessions.path(), Some(&graph), None);
    opened.until("the graph", |app| app.session.state.graph.is_some());
    assert!(opened.app().session.notice().unwrap().contains("could not be read"));
    assert!(opened.harness.query_by_label_contains("could not be read").is_some());
    assert_eq!(opened.app().session.scene(), "cornell");
    rest(&mut opened);
    drop(opened);
    // The new session file is valid.
    let opened = Opened::started(sessions.path(), None, None);
    assert_eq!(opened.app().session.notice(), None);
}

#[test]
fn unsaved_text_is_offered_at_the_next_start() {
    let sessions = tempfile::tempdir().unwrap();
    let (_folder, graph) = copy("epi.ron");
    let (saved, typed) = {
        let mut opened = Opened::started(sessions.path(), Some(&graph), None);
        opened.until("the graph", |app| app.session.state.graph.is_some());
        let saved = opened.text().to_owned();
        let path = opened.app().session.document.path().to_owned();
        // An unfinished edit, which is not a valid graph.
        let typed = saved.replace("kind: \"fill\"", "kind: \"fi").replace("sigma: 0.7", "sigma: 0.8, x");
        assert_ne!(saved, typed);
        opened.harness.state_mut().session.document.type_text(&path, &typed);
        rest(&mut opened);
        (saved, typed)
    };
    assert_eq!(fs::read_to_string(&graph).unwrap(), saved);
    let offered = |opened: &Opened| opened.harness.query_by_label("Restore").is_some();

    // Undecided, it is offered again.
    let mut opened = Opened::started(sessions.path(), None, None);
    opened.harness.run_steps(5);
    assert!(offered(&opened) && opened.text() == saved);
    rest(&mut opened);
    drop(opened);

    let mut opened = Opened::started(sessions.path(), None, None);
    opened.harness.run_steps(5);
    opened.click("Restore");
    assert!(!offered(&opened) && opened.text() == typed);
    opened.harness.key_press_modifiers(egui::Modifiers::COMMAND, egui::Key::Z);
    opened.harness.run_steps(3);
    assert_eq!(opened.text(), saved);
    opened.harness.key_press_modifiers(egui::Modifiers::COMMAND | egui::Modifiers::SHIFT, egui::Key::Z);
    rest(&mut opened);
    drop(opened);

    let mut opened = Opened::started(sessions.path(), None, None);
    opened.harness.run_steps(5);
    opened.click("Discard");
    assert!(opened.text() == saved);
    rest(&mut opened);
    drop(opened);
    let mut opened = Opened::started(sessions.path(), None, None);
    opened.harness.run_steps(5);
    assert!(!offered(&opened));
}

#[test]
fn unsaved_box_positions_are_offered_too() {
    let sessions = tempfile::tempdir().unwrap();
    let (_folder, graph) = copy("render-cache.ron");
    let places = |opened: &Opened| opened.app().session.document.places().clone();
    let canvas = |graph: Option<&Path>| {
        let mut opened = Opened::started(sessions.path(), graph, None);
        opened.until("the graph", |app| app.session.state.graph.is_some());
        opened
    };
    let mut opened = canvas(Some(&graph));
    opened.click("Canvas");
    opened.click("node fill");
    for _ in 0..3 {
        opened.harness.key_press(egui::Key::ArrowDown);
        opened.harness.run_steps(2);
    }
    let moved = places(&opened);
    assert!(!moved.is_empty());
    rest(&mut opened);
    drop(opened);

    let mut opened = canvas(None);
    assert!(places(&opened).is_empty());
    assert!(opened.harness.query_by_label_contains("unsaved box positions").is_some());
    opened.click("Restore");
    assert_eq!(places(&opened), moved);
    opened.harness.key_press_modifiers(egui::Modifiers::COMMAND, egui::Key::Z);
    opened.harness.run_steps(3);
    assert!(places(&opened).is_empty() && !opened.app().session.document.is_dirty());
}

/// Opens a graph, types a comment, leaves time to keep it, and ends without saving. Returns the texts: as opened, as
/// typed.
fn left_unsaved(sessions: &Path, graph: &Path) -> [String; 2] {
    let mut opened = Opened::started(sessions, Some(graph), None);
    opened.until("the graph", |app| app.session.state.graph.is_some());
    let path = opened.app().session.document.path().to_owned();
    let saved = opened.text().to_owned();
    let typed = saved.replacen("Graph(", "Graph( // mine", 1);
    opened.harness.state_mut().session.document.type_text(&path, &typed);
    rest(&mut opened);
    [saved, typed]
}

#[test]
fn unsaved_text_of_a_file_that_another_program_has_changed_since_is_offered_with_the_differences() {
    let sessions = tempfile::tempdir().unwrap();
    let (_folder, graph) = copy("epi.ron");
    let [saved, typed] = left_unsaved(sessions.path(), &graph);
    let start = || {
        let mut opened = Opened::started(sessions.path(), None, None);
        opened.harness.run_steps(5);
        opened
    };
    let since =
        |opened: &Opened| opened.harness.query_by_label_contains("has changed epi.ron since").is_some();
    let on_disk = || fs::read_to_string(&graph).unwrap();
    let shows = |opened: &Opened, line: &str| opened.harness.query_by_label(line).is_some();

    // Nobody has changed the file: the differences are those that the user made.
    let mut opened = start();
    assert!(!since(&opened));
    opened.click("Show differences");
    assert!(shows(&opened, "- Graph(") && shows(&opened, "+ Graph( // mine"));
    drop(opened);

    let theirs = saved.replacen("Graph(", "Graph( // theirs", 1);
    fs::write(&graph, &theirs).unwrap();
    let mut opened = start();
    assert!(since(&opened) && opened.text() == theirs);
    opened.click("Show differences");
    assert!(shows(&opened, "- Graph( // theirs") && shows(&opened, "+ Graph( // mine"));
    // Undecided, nothing is lost on either side.
    rest(&mut opened);
    drop(opened);
    assert_eq!(on_disk(), theirs);

    let mut opened = start();
    opened.click("Restore");
    assert!(opened.text() == typed && on_disk() == theirs);
    // It is made to their text now, which the user has seen.
    rest(&mut opened);
    drop(opened);
    let mut opened = start();
    assert!(!since(&opened));
    opened.click("Restore");
    opened.harness.key_press_modifiers(egui::Modifiers::COMMAND, egui::Key::S);
    rest(&mut opened);
    assert_eq!(on_disk(), typed);
    opened.harness.key_press_modifiers(egui::Modifiers::COMMAND, egui::Key::Z);
    opened.harness.run_steps(3);
    assert_eq!(opened.text(), theirs);
}

#[test]
fn discarding_leaves_what_another_program_has_written() {
    let sessions = tempfile::tempdir().unwrap();
    let (_folder, graph) = copy("epi.ron");
    let [saved, _] = left_unsaved(sessions.path(), &graph);
    let theirs = saved.replacen("Graph(", "Graph( // theirs", 1);
    fs::write(&graph, &theirs).unwrap();
    let mut opened = Opened::started(sessions.path(), None, None);
    opened.harness.run_steps(5);
    opened.click("Discard");
    rest(&mut opened);
    assert!(opened.text() == theirs && !opened.app().session.document.is_dirty());
    drop(opened);
    let mut opened = Opened::started(sessions.path(), None, None);
    opened.harness.run_steps(5);
    assert!(opened.harness.query_by_label("Discard").is_none());
    assert_eq!(fs::read_to_string(&graph).unwrap(), theirs);
}

#[test]
fn a_file_that_changes_under_unsaved_text_is_asked_about_at_once() {
    let mut opened = Opened::with("epi.ron", true, [64, 48]);
    opened.until("the graph", |app| app.session.state.graph.is_some());
    let (path, saved) = (opened.path.clone(), opened.text().to_owned());
    let typed = saved.replacen("Graph(", "Graph( // mine", 1);
    let name = opened.app().session.document.path().to_owned();
    opened.harness.state_mut().session.document.type_text(&name, &typed);
    rest(&mut opened);
    let asked = |opened: &Opened| opened.harness.query_by_label("Keep mine").is_some();
    assert!(!asked(&opened));
    let write = |opened: &mut Opened, comment: &str| {
        let theirs = saved.replacen("Graph(", &format!("Graph( // {comment}"), 1);
        fs::write(&path, &theirs).unwrap();
        rest(opened);
        theirs
    };
    let save = |opened: &mut Opened| {
        opened.harness.key_press_modifiers(egui::Modifiers::COMMAND, egui::Key::S);
        opened.harness.run_steps(3);
    };
    let on_disk = || fs::read_to_string(&path).unwrap();

    let theirs = write(&mut opened, "theirs");
    assert!(asked(&opened) && opened.text() == typed);
    opened.click("Show differences");
    assert!(opened.harness.query_by_label("- Graph( // theirs").is_some());
    assert!(opened.harness.query_by_label("+ Graph( // mine").is_some());
    opened.shot("differences");
    save(&mut opened);
    assert_eq!(on_disk(), theirs);
    assert!(opened.app().session.notice().unwrap().contains("keep your changes or discard them first"));

    opened.click("Discard mine");
    assert!(!asked(&opened) && opened.text() == theirs);
    opened.click("Undo");
    assert_eq!(opened.text(), typed);
    rest(&mut opened);
    assert!(!asked(&opened), "the user has decided");

    write(&mut opened, "later");
    assert!(asked(&opened));
    opened.click("Keep mine");
    assert!(!asked(&opened) && opened.text() == typed);
    save(&mut opened);
    assert_eq!(on_disk(), typed);
}

#[test]
fn saved_changes_are_not_offered() {
    let sessions = tempfile::tempdir().unwrap();
    let (_folder, graph) = copy("epi.ron");
    let mut opened = Opened::started(sessions.path(), Some(&graph), None);
    let text = format!("{}// more\n", opened.text());
    let path = opened.app().session.document.path().to_owned();
    opened.harness.state_mut().session.document.type_text(&path, &text);
    rest(&mut opened);
    let unsaved = || {
        fs::read_dir(sessions.path())
            .unwrap()
            .filter(|entry| entry.as_ref().unwrap().file_name().to_string_lossy().starts_with("unsaved"))
            .count()
    };
    opened.until("the recovery file", |_| unsaved() == 1);
    opened.harness.key_press_modifiers(egui::Modifiers::COMMAND, egui::Key::S);
    rest(&mut opened);
    drop(opened);
    assert_eq!(unsaved(), 0);
    let mut opened = Opened::started(sessions.path(), None, None);
    opened.harness.run_steps(5);
    assert!(opened.harness.query_by_label("Restore").is_none());
    assert_eq!(opened.text(), text);
}

#[test]
fn graphs_and_scenes_are_opened_created_and_saved_without_a_restart() {
    let mut opened = Opened::new("epi.ron");
    opened.frames(2);
    let folder = opened.folder().to_owned();
    opened.choose(&["File", "Open graph …"]);
    opened.name(&folder.join("no-such.ron"));
    assert!(
        opened.harness.query_by_label_contains("no-such.ron").is_some(),
        "the dialog shows the error and stays open"
    );
    let (_other, other) = copy("render-cache.ron");
    opened.name(&other);
    opened.until("the other graph", |app| {
        app.session.state.graph.as_ref().is_some_and(|graph| graph.node("interpolate").is_none())
    });
    assert!(opened.app().session.document.path().ends_with("render-cache.ron"));
    opened.until("the reset", |app| app.session.state.frames == 0);
    opened.frames(1);

    opened.choose(&["File", "Open scene …"]);
    opened.click("chains");
    opened.click("Open");
    opened.until("the scene", |app| app.session.state.scene == "chains" && app.session.state.frames == 0);
    opened.frames(2);
    assert_eq!(opened.app().session.state.frames, 2);

    let mine = folder.join("deep");
    fs::create_dir(&mine).unwrap();
    opened.choose(&["File", "New from a graph …"]);
    opened.name(&mine.join("mine.ron"));
    opened.until("the new graph", |app| app.session.document.path().ends_with("mine.ron"));
    assert_eq!(opened.app().session.problems(), []);

    opened.choose(&["File", "Save as …"]);
    opened.name(&mine.join("other.ron"));
    opened.until("the file", |app| app.session.document.path().ends_with("other.ron"));
    assert_eq!(fs::read(mine.join("mine.ron")).unwrap(), fs::read(mine.join("other.ron")).unwrap());
}

#[test]
fn what_a_scene_leaves_out_is_listed_in_the_status_line() {
    let files = tempfile::tempdir().unwrap();
    let scene = files.path().join("floor.obj");
    fs::write(&scene, "mtllib none.mtl\nv 0 0 0\nv 1 0 0\nv 0 0 -1\nf 1 2 3\n").unwrap();
    let mut opened = Opened::on_scene("epi.ron", scene.to_str().unwrap());
    opened.until("the scene", |app| !app.session.state.report.is_empty());
    opened.harness.run_steps(2);
    opened.click("scene: 2 notes");
    opened.harness.run_steps(3);
    for words in ["added: a light in front", "none.mtl"] {
        assert!(opened.harness.query_by_label_contains(words).is_some(), "{words}");
    }
    let cornell = Opened::new("epi.ron");
    assert!(cornell.harness.query_by_label_contains("scene: ").is_none());
}
