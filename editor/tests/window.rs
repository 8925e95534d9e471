//! Tests of the window without a display. They find widgets by name and operate them, and check the file's text and the
//! engine's state.

mod canvas;
mod flows;
mod panes;
mod snapshots;
mod support;
mod viewer;

use std::{fs, path::Path};

use egui::{Key, Modifiers};
use egui_kittest::kittest::Queryable;
use epigraph_editor::app::App;
use epigraph_scenes::streams::{self, Points, encode};
use glam::Vec3;
use support::Opened;

#[test]
fn a_parameter_changes_only_its_characters_and_can_be_undone() {
    let mut opened = Opened::new("epi.ron");
    opened.frames(5);
    let before = opened.text().to_owned();
    opened.click("tonemap");
    let slider = opened.harness.get_by_role_and_label(egui::accesskit::Role::Slider, "exposure");
    slider.focus();
    opened.harness.run_steps(2);
    opened.harness.key_press(Key::ArrowRight);
    opened.frames(1);
    let after = opened.text().to_owned();
    assert!(after.contains("exposure: "), "{after}");
    let lines = |text: &str| text.lines().map(str::to_owned).collect::<Vec<_>>();
    let new: Vec<String> = lines(&after).into_iter().filter(|line| !lines(&before).contains(line)).collect();
    assert_eq!(new.len(), 1, "{new:?}");
    assert_eq!(opened.app().session.problems(), []);
    opened.harness.key_press_modifiers(Modifiers::COMMAND, Key::Z);
    opened.harness.run_steps(3);
    assert_eq!(opened.text(), before);
    opened.harness.key_press_modifiers(Modifiers::COMMAND | Modifiers::SHIFT, Key::Z);
    opened.harness.run_steps(3);
    assert_eq!(opened.text(), after);
    opened.harness.key_press_modifiers(Modifiers::COMMAND, Key::S);
    opened.harness.run_steps(3);
    assert_eq!(fs::read_to_string(&opened.path).unwrap(), after);
}

#[test]
fn a_broken_text_is_reported_and_the_picture_keeps_running() {
    let mut opened = Opened::new("render-cache.ron");
    opened.frames(5);
    opened.click("Text");
    let path = opened.app().session.document.path().to_owned();
    let wrong = opened.text().replace("kind: \"fill\"", "kind: \"fil\"");
    opened.harness.state_mut().session.document.type_text(&path, &wrong);
    opened.until("the problem", |app| !app.session.problems().is_empty());
    let problem = opened.app().session.problems()[0].clone();
    assert!(problem.error.to_string().contains("did you mean `fill`"), "{problem}");
    assert!(opened.harness.query_by_label_contains("did you mean").is_some());
    opened.frames(2);
    assert!(opened.app().viewers().next().unwrap().picture().is_some());
    opened.harness.key_press_modifiers(Modifiers::COMMAND, Key::Z);
    opened.until("no problem", |app| app.session.problems().is_empty());
}

#[test]
fn another_port_shows_another_picture() {
    let mut opened = Opened::new("epi.ron");
    opened.frames(10);
    let picture = |opened: &Opened| opened.app().viewers().next().unwrap().picture().unwrap().clone();
    let output = picture(&opened);
    opened.click("view/project");
    opened.click("View depth");
    opened.frames(1);
    let depth = picture(&opened);
    assert_eq!(opened.app().viewers().next().unwrap().port, "view/project.depth");
    assert_eq!((depth.size, depth.mode.label()), ([64, 48], "Depth"));
    assert_ne!(depth.colors, output.colors);
    assert!(depth.colors.iter().any(|color| *color != epigraph_pictures::EMPTY));
}

#[test]
fn swapping_a_stage_is_one_step_of_undo() {
    let mut opened = Opened::new("epi.ron");
    opened.frames(2);
    let before = opened.text().to_owned();
    opened.click("interpolate");
    opened.harness.get_by_role_and_label(egui::accesskit::Role::ComboBox, "stage").click();
    opened.harness.run_steps(4);
    opened.click("fill");
    opened.frames(2);
    assert!(opened.text().contains("kind: \"fill\""));
    assert_eq!(opened.app().session.problems(), []);
    let kind =
        |app: &App| app.session.state.graph.as_ref()?.node("interpolate").map(|node| node.kind.clone());
    assert_eq!(kind(opened.app()).as_deref(), Some("fill"));
    opened.harness.key_press_modifiers(Modifiers::COMMAND, Key::Z);
    opened.harness.run_steps(3);
    assert_eq!(opened.text(), before);
}

#[test]
fn the_window_shows_the_pixels_of_the_port_in_view() {
    let mut opened = Opened::with("epi.ron", true, [128, 128]);
    opened.frames(40);
    let window = opened.shot("picture");
    let share = opened.share_in(&window);
    assert!(share > 0.9, "{share}");
    opened.click("view/project");
    opened.click("View depth");
    opened.frames(1);
    let depth = opened.shot("depth");
    let (share, other) = (opened.share_in(&depth), opened.share_in(&window));
    assert!(share > 0.9 && other < 0.5, "{share}, and {other} of another port's picture");
}

#[test]
fn a_click_on_a_problem_moves_the_cursor_there() {
    let mut opened = Opened::new("epi.ron");
    opened.frames(1);
    let path = opened.app().session.document.path().to_owned();
    let wrong = opened.text().replace("sigma: 0.7", "sigmo: 0.7");
    opened.harness.state_mut().session.document.type_text(&path, &wrong);
    opened.until("the problem", |app| !app.session.problems().is_empty());
    // The text pane is hidden. After the click, typing goes to the problem's position.
    opened.harness.get_by_label_contains("did you mean").click();
    opened.harness.run_steps(10);
    opened.harness.event(egui::Event::Text("!".into()));
    opened.harness.run_steps(2);
    assert_eq!(opened.text(), wrong.replace("sigmo", "!sigmo"));
}

#[test]
fn number_keys_recall_ports_in_the_viewer_in_use() {
    let mut opened = Opened::new("epi.ron");
    opened.frames(3);
    opened.click("view/project");
    opened.click("View id");
    opened.harness.key_press_modifiers(Modifiers::COMMAND, Key::Num2);
    opened.harness.run_steps(3);
    opened.click("+ View");
    opened.frames(1);
    let ports = |opened: &Opened| {
        let mut ports: Vec<_> =
            opened.app().viewers().map(|viewer| (viewer.id, viewer.port.clone())).collect();
        ports.sort();
        ports
    };
    assert_eq!(ports(&opened).len(), 2);
    opened.click("View depth");
    assert_eq!(ports(&opened)[1].1, "view/project.depth");
    opened.harness.key_press(Key::Num2);
    opened.harness.run_steps(3);
    assert_eq!(ports(&opened)[1].1, "view/project.id");
    assert_eq!(ports(&opened)[0].1, "view/project.id");
}

#[test]
fn showing_parameters_changes_nothing() {
    for graph in ["epi.ron", "hybrid.ron", "render-cache.ron", "render-cache-cpu-dither.ron"] {
        let mut opened = Opened::new(graph);
        opened.until("the graph", |app| app.session.state.graph.is_some());
        let path = opened.app().session.document.path().to_owned();
        // A value outside its range, with more digits than a slider shows.
        let odd =
            opened.text().replace("kind: \"tonemap\",", "kind: \"tonemap\", params: (exposure: 99.123456),");
        assert_ne!(odd, opened.text());
        opened.harness.state_mut().session.document.type_text(&path, &odd);
        let revision = opened.app().session.document.revision();
        let info = opened.app().session.state.graph.clone().unwrap();
        for node in &info.nodes {
            opened.harness.state_mut().session.selected = Some(node.name.clone());
            opened.harness.run_steps(2);
        }
        opened.harness.state_mut().session.selected = Some("tonemap".into());
        opened.harness.run_steps(3);
        assert_eq!((opened.app().session.document.revision(), opened.text()), (revision, &odd[..]));
    }
}

#[test]
fn a_parameter_can_be_reset_to_its_default() {
    let mut opened = Opened::new("epi.ron");
    opened.frames(1);
    opened.click("interpolate");
    let before = opened.text().to_owned();
    opened.click("default of sigma");
    assert_eq!(opened.text(), before.replace("sigma: 0.7, ", ""));
    opened.click("Undo");
    assert_eq!(opened.text(), before);
}

#[test]
fn every_graph_and_experiment_opens_and_runs() {
    let graphs = |folder: &str| -> Vec<String> {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../graphs").join(folder);
        let names =
            fs::read_dir(path).unwrap().map(|entry| entry.unwrap().file_name().into_string().unwrap());
        names.filter(|name| name.ends_with(".ron")).map(|name| format!("{folder}{name}")).collect()
    };
    let all: Vec<String> = [graphs(""), graphs("experiments/")].concat();
    assert!(all.len() >= 12, "{all:?}");
    let folder = tempfile::tempdir().unwrap();
    let points = folder.path().join("points.vts");
    let grid = (0..2000).map(|i| Vec3::new((i % 50) as f32, (i / 50) as f32, (i % 7) as f32));
    let grid = Points::from(grid.collect::<Vec<_>>());
    fs::write(&points, encode(&grid, &streams::Settings::default()).unwrap().to_bytes()).unwrap();
    for graph in all {
        let scene = if graph == "streams.ron" { points.to_str().unwrap() } else { "cornell" };
        let mut opened = Opened::on_scene(&graph, scene);
        assert_eq!(opened.app().session.document.problems(), [], "{graph}");
        opened.click("Canvas");
        opened.frames(2);
        assert_eq!(opened.app().session.problems(), [], "{graph}");
        let tonemap = opened.harness.query_all_by_label_contains("node tonemap").count();
        assert_eq!(tonemap, 1, "{graph}");
        assert!(!opened.app().session.document.is_dirty(), "{graph}");
    }
}
