//! Tests of the canvas, operated with mouse and keys. They check the file's text.

use egui::{Event, Key, Modifiers, PointerButton, Pos2};
use egui_kittest::kittest::Queryable;

use crate::support::Opened;

/// A window with the canvas in front and a compiled graph.
fn canvas(graph: &str) -> Opened {
    in_front(Opened::new(graph))
}

fn in_front(mut opened: Opened) -> Opened {
    opened.until("the graph", |app| app.session.state.graph.is_some());
    opened.click("Canvas");
    opened
}

/// The centre of the widget with this name.
fn at(opened: &Opened, label: &str) -> Pos2 {
    opened.harness.get_by_label(label).rect().center()
}

fn button(opened: &Opened, pos: Pos2, pressed: bool, modifiers: Modifiers) {
    let event = Event::PointerButton { pos, button: PointerButton::Primary, pressed, modifiers };
    opened.harness.event_modifiers(event, modifiers);
}

/// Presses the button at one position and moves to another, without releasing it.
fn pull(opened: &mut Opened, from: Pos2, to: Pos2) {
    opened.harness.event(Event::PointerMoved(from));
    opened.harness.run_steps(2);
    button(opened, from, true, Modifiers::NONE);
    opened.harness.run_steps(1);
    for step in 1..=4 {
        opened.harness.event(Event::PointerMoved(from.lerp(to, step as f32 / 4.0)));
        opened.harness.run_steps(1);
    }
    opened.harness.run_steps(1);
}

fn drag(opened: &mut Opened, from: Pos2, to: Pos2) {
    pull(opened, from, to);
    button(opened, to, false, Modifiers::NONE);
    opened.harness.run_steps(3);
}

/// Clicks `count` times in one frame, as frames of this window are a quarter of a second apart.
fn clicks(opened: &mut Opened, pos: Pos2, count: usize) {
    opened.harness.event(Event::PointerMoved(pos));
    opened.harness.run_steps(1);
    let event = |index: usize| {
        let (button, modifiers) = (PointerButton::Primary, Modifiers::NONE);
        Event::PointerButton { pos, button, pressed: index.is_multiple_of(2), modifiers }
    };
    opened.harness.input_mut().events.extend((0..2 * count).map(event));
    opened.harness.run_steps(4);
}

fn key(opened: &mut Opened, modifiers: Modifiers, key: Key) {
    opened.harness.key_press_modifiers(modifiers, key);
    opened.harness.run_steps(3);
}

fn undo(opened: &mut Opened) {
    key(opened, Modifiers::COMMAND, Key::Z);
}

fn notice(opened: &Opened) -> String {
    opened.app().session.notice().unwrap_or_default().to_owned()
}

/// The source of an input, as `node.port`; `None` if it is not connected.
fn source(opened: &Opened, node: &str, port: &str) -> Option<String> {
    let file = opened.app().session.document.file()?.clone();
    let (node, _) = file.node_at(node)?;
    let input = node.inputs.iter().find(|input| input.port.value == port)?;
    Some(input.from.value.to_string())
}

fn has(opened: &Opened, node: &str) -> bool {
    opened.app().session.document.file().is_some_and(|file| file.node_at(node).is_some())
}

/// A position on the background of the canvas.
fn ground(opened: &Opened) -> Pos2 {
    let canvas = opened.harness.get_by_label("canvas").rect();
    canvas.left_bottom() + egui::vec2(14.0, -40.0)
}

/// Undoes one step and checks that the text is as before.
#[track_caller]
fn undone(opened: &mut Opened, before: &str) {
    assert_ne!(opened.text(), before);
    undo(opened);
    assert_eq!(opened.text(), before);
}

#[test]
fn wires_are_connected_moved_and_removed_with_the_mouse() {
    let mut opened = canvas("render-cache.ron");
    let before = opened.text().to_owned();

    // An invalid wire shows the reason and changes nothing.
    let (color, id) = (at(&opened, "output fill.color"), at(&opened, "input request.id"));
    drag(&mut opened, color, id);
    assert!(
        notice(&opened).contains("fill.color writes texture<rgba32float>, but request.id reads array<u32>"),
        "{}",
        notice(&opened)
    );
    assert_eq!(opened.text(), before);

    // Dragging a wire off its input onto the background removes it.
    let (input, nowhere) = (at(&opened, "input tonemap.color"), ground(&opened));
    drag(&mut opened, input, nowhere);
    assert_eq!(source(&opened, "tonemap", "color"), None);
    undone(&mut opened, &before);
    drag(&mut opened, input, nowhere);
    let without = opened.text().to_owned();

    // Dropping a wire on a block with only one port that fits connects it.
    let block = at(&opened, "node tonemap");
    drag(&mut opened, color, block);
    assert_eq!(source(&opened, "tonemap", "color").as_deref(), Some("fill.color"));
    undone(&mut opened, &without);
    drag(&mut opened, input, color);
    assert_eq!(source(&opened, "tonemap", "color").as_deref(), Some("fill.color"));

    // Click a wire and delete it.
    clicks(&mut opened, input.lerp(color, 0.5), 1);
    key(&mut opened, Modifiers::NONE, Key::Delete);
    assert_eq!(source(&opened, "tonemap", "color"), None);
    undo(&mut opened);

    // Move a wire from one input to another.
    let before = opened.text().to_owned();
    let (from, to) = (at(&opened, "input request.id"), at(&opened, "input request.aim"));
    drag(&mut opened, from, to);
    assert_eq!(
        (source(&opened, "request", "id"), source(&opened, "request", "aim").as_deref()),
        (None, Some("view.id"))
    );
    undone(&mut opened, &before);
}

#[test]
fn stages_are_found_by_typing_and_added_at_the_pointer() {
    let mut opened = canvas("render-cache.ron");
    let before = opened.text().to_owned();
    let spot = ground(&opened);
    for pressed in [true, false] {
        let event = Event::PointerButton {
            pos: spot,
            button: PointerButton::Secondary,
            pressed,
            modifiers: Modifiers::NONE,
        };
        opened.harness.event(Event::PointerMoved(spot));
        opened.harness.event(event);
        opened.harness.run_steps(2);
    }
    opened.harness.run_steps(3);
    opened.harness.event(Event::Text("halftone".into()));
    opened.harness.run_steps(3);
    assert!(opened.harness.query_by_label("add fill").is_none());
    opened.harness.event(Event::Text("?".into()));
    opened.harness.run_steps(3);
    assert!(opened.harness.query_by_label_contains("No stage matches").is_some());
    key(&mut opened, Modifiers::COMMAND, Key::A);
    opened.harness.event(Event::Text("tone".into()));
    opened.harness.run_steps(3);
    key(&mut opened, Modifiers::NONE, Key::Enter);
    assert!(has(&opened, "tonemap2"), "{}", opened.text());
    assert_eq!(opened.app().session.selected.as_deref(), Some("tonemap2"));
    let corner = opened.harness.get_by_label("node tonemap2").rect().min;
    assert!(corner.distance(spot) < 3.0, "{corner} {spot}");
    undone(&mut opened, &before);
    assert!(!opened.app().session.document.is_dirty());

    // A wire dropped on the background offers only stages that fit, and is connected to the new node.
    let color = at(&opened, "output fill.color");
    drag(&mut opened, color, spot);
    assert!(opened.harness.query_by_label("add mesh").is_none());
    opened.harness.event(Event::Text("tone".into()));
    opened.harness.run_steps(3);
    opened.click("add tonemap");
    assert_eq!(source(&opened, "tonemap2", "color").as_deref(), Some("fill.color"));
    undone(&mut opened, &before);
}

#[test]
fn several_nodes_are_copied_bypassed_and_deleted_in_one_step_each() {
    let mut opened = canvas("render-cache.ron");
    let before = opened.text().to_owned();
    opened.click("node fill");
    opened.harness.get_by_label("node tonemap").click_modifiers(Modifiers::SHIFT);
    opened.harness.run_steps(3);
    key(&mut opened, Modifiers::COMMAND, Key::D);
    assert_eq!(source(&opened, "tonemap2", "color").as_deref(), Some("fill2.color"));
    assert_eq!(source(&opened, "fill2", "previous").as_deref(), Some("fill2.color"));
    undone(&mut opened, &before);

    opened.click("node fill");
    opened.harness.get_by_label("node tonemap").click_modifiers(Modifiers::SHIFT);
    opened.harness.run_steps(3);
    key(&mut opened, Modifiers::NONE, Key::Delete);
    assert!(!has(&opened, "fill") && !has(&opened, "tonemap") && has(&opened, "request"));
    assert_eq!(source(&opened, "request", "priority"), None);
    assert!(opened.text().contains("// Colour every pixel from the points"), "comments stay");
    undone(&mut opened, &before);

    // A selection box selects the nodes in it, and no others.
    let (from, to) =
        (opened.harness.get_by_label("node view").rect(), opened.harness.get_by_label("node view").rect());
    drag(&mut opened, from.left_bottom() + egui::vec2(-6.0, 6.0), to.right_top() + egui::vec2(6.0, -6.0));
    key(&mut opened, Modifiers::NONE, Key::Delete);
    assert!(!has(&opened, "view") && has(&opened, "cloud") && has(&opened, "trace"));
    undone(&mut opened, &before);

    key(&mut opened, Modifiers::COMMAND, Key::A);
    key(&mut opened, Modifiers::NONE, Key::B);
    assert_eq!(opened.text().matches("bypass: true").count(), 4, "only stages, not parts");
    undone(&mut opened, &before);
}

#[test]
fn a_bypassed_node_says_so_and_passes_its_input_through() {
    let mut opened = canvas("epi.ron");
    opened.frames(2);
    let before = opened.text().to_owned();
    opened.click("node spread");
    key(&mut opened, Modifiers::NONE, Key::B);
    opened.until("the bypass", |app| {
        app.session.state.graph.as_ref().is_some_and(|graph| graph.node("spread").is_none())
    });
    assert!(opened.harness.query_by_label("node spread, off: bypassed in the graph file").is_some());
    let graph = opened.app().session.state.graph.clone().unwrap();
    let port =
        graph.node("antialias").unwrap().ports.iter().find(|info| info.port.name == "primary").unwrap();
    assert_eq!(port.source.as_deref(), Some("interpolate.color"));
    undone(&mut opened, &before);
}

#[test]
fn box_positions_can_be_undone_and_are_written_only_by_saving() {
    let mut opened = canvas("render-cache.ron");
    let before = opened.text().to_owned();
    let layout = opened.path.with_extension("layout.ron");
    let home = opened.harness.get_by_label("node fill").rect();
    drag(&mut opened, home.center_top() + egui::vec2(0.0, 10.0), home.center_top() + egui::vec2(60.0, 50.0));
    let moved = opened.harness.get_by_label("node fill").rect();
    assert!((moved.min - home.min - egui::vec2(60.0, 40.0)).length() < 2.0, "{home} {moved}");
    undo(&mut opened);
    assert!(opened.harness.get_by_label("node fill").rect().min.distance(home.min) < 1.0);
    assert!(!opened.app().session.document.is_dirty());

    // Keys move the selection; consecutive presses are one step of undo.
    opened.click("node fill");
    for _ in 0..3 {
        key(&mut opened, Modifiers::NONE, Key::ArrowDown);
    }
    assert!(opened.harness.get_by_label("node fill").rect().top() > home.top() + 20.0);
    undo(&mut opened);
    assert!(opened.harness.get_by_label("node fill").rect().min.distance(home.min) < 1.0);
    key(&mut opened, Modifiers::COMMAND.plus(Modifiers::SHIFT), Key::Z);

    assert!(!layout.exists());
    key(&mut opened, Modifiers::COMMAND, Key::S);
    let text = std::fs::read_to_string(&layout).unwrap();
    assert!(text.contains("\"fill\": (") && text.contains("\".outputs\": ("), "{text}");
    assert_eq!(std::fs::read_to_string(&opened.path).unwrap(), before);

    opened.click("Arrange");
    assert!(opened.app().session.document.is_dirty());
    undo(&mut opened);
    assert!(!opened.app().session.document.is_dirty());
}

#[test]
fn renaming_a_node_changes_all_references() {
    let mut opened = canvas("render-cache.ron");
    let before = opened.text().to_owned();
    opened.click("node fill");
    key(&mut opened, Modifiers::NONE, Key::F2);
    key(&mut opened, Modifiers::COMMAND, Key::A);
    opened.harness.event(Event::Text("paint".into()));
    opened.harness.run_steps(2);
    key(&mut opened, Modifiers::NONE, Key::Enter);
    assert_eq!(source(&opened, "request", "priority").as_deref(), Some("paint.priority"));
    assert_eq!(source(&opened, "paint", "previous").as_deref(), Some("paint.color"));
    assert_eq!(opened.app().session.selected.as_deref(), Some("paint"));
    undone(&mut opened, &before);

    // A taken name is rejected.
    opened.click("node fill");
    key(&mut opened, Modifiers::NONE, Key::F2);
    key(&mut opened, Modifiers::COMMAND, Key::A);
    opened.harness.event(Event::Text("view".into()));
    opened.harness.run_steps(2);
    key(&mut opened, Modifiers::NONE, Key::Enter);
    assert!(notice(&opened).contains("duplicate"), "{}", notice(&opened));
    assert_eq!(opened.text(), before);
}

#[test]
fn a_stage_is_swapped_from_the_menu_of_its_node() {
    let mut opened = canvas("epi.ron");
    opened.frames(2);
    let before = opened.text().to_owned();
    opened.harness.get_by_label("node interpolate").click_secondary();
    opened.harness.run_steps(4);
    opened.harness.get_by_label_contains("Swap for").click();
    opened.harness.run_steps(6);
    opened.click("fill");
    opened.frames(2);
    assert!(opened.text().contains("kind: \"fill\""));
    assert_eq!(opened.app().session.problems(), []);
    undone(&mut opened, &before);
}

#[test]
fn a_part_is_opened_edited_and_closed() {
    let mut opened = canvas("epi.ron");
    opened.frames(2);
    let view = at(&opened, "node view");
    clicks(&mut opened, view, 2);
    assert!(opened.harness.query_by_label("node view/project").is_some());
    assert!(opened.harness.query_by_label("node cloud").is_none());
    assert!(opened.harness.query_by_label("output view/inputs.cloud").is_some());
    // Connect a port to an output of the part.
    let (from, to) = (at(&opened, "output view/project.id"), at(&opened, "input view/outputs.id"));
    let path =
        opened.app().session.document.paths().find(|path| path.ends_with("view.ron")).unwrap().to_owned();
    let part = |opened: &Opened| opened.app().session.document.text(&path).to_owned();
    let before = part(&opened);
    drag(&mut opened, from, to);
    assert!(part(&opened).contains("\"id\": \"project.id\","), "{}", part(&opened));
    undo(&mut opened);
    assert_eq!(part(&opened), before);
    opened.click("node view/cull");
    assert_eq!(opened.app().session.selected.as_deref(), Some("view/cull"));
    opened.click("epi.ron");
    assert!(opened.harness.query_by_label("node cloud").is_some());
}

#[test]
fn wired_ports_of_nodes_within_a_part_have_pins() {
    let mut opened = canvas("experiments/outline.ron");
    assert!(opened.harness.query_by_label("output cache.fill.color").is_some());
    let (from, to) = (at(&opened, "output cache.fill.color"), at(&opened, "input tonemap.color"));
    drag(&mut opened, from, to);
    assert_eq!(source(&opened, "tonemap", "color").as_deref(), Some("cache/fill.color"));
}

#[test]
fn transfers_are_drawn_on_their_wires() {
    let mut opened = canvas("render-cache-cpu-dither.ron");
    opened
        .app()
        .session
        .engine
        .send(epigraph_editor::engine::Command::Backend(epigraph_editor::engine::Backend::Gpu));
    opened.until("the GPU", |app| app.session.state.graph.as_ref().is_some_and(|graph| graph.gpu.is_some()));
    assert!(opened.harness.query_by_label("download of fill.priority").is_some());
    assert!(opened.harness.query_by_label("upload of cloud.cloud").is_some());
    assert!(opened.harness.query_by_label("upload of fill.color").is_none());
}

#[test]
fn nodes_are_reached_with_the_keyboard() {
    let mut opened = canvas("render-cache.ron");
    let focused = |opened: &Opened| opened.harness.get_by_label("node fill").is_focused();
    for _ in 0..80 {
        if focused(&opened) {
            break;
        }
        key(&mut opened, Modifiers::NONE, Key::Tab);
    }
    assert!(focused(&opened));
    assert_eq!(opened.app().session.selected.as_deref(), Some("fill"));
    let before = opened.harness.get_by_label("node fill").rect();
    key(&mut opened, Modifiers::NONE, Key::ArrowRight);
    assert!(focused(&opened), "arrows move the block, not the focus");
    assert!(opened.harness.get_by_label("node fill").rect().left() > before.left() + 4.0);
}

#[test]
fn the_wheel_zooms_and_f_fits_the_graph() {
    let mut opened = canvas("epi.ron");
    let middle = at(&opened, "canvas");
    let width = |opened: &Opened| opened.harness.get_by_label("node edges").rect().width();
    let fitted = width(&opened);
    for (turn, limit) in [(-40.0, 0.5), (60.0, 2.0)] {
        for _ in 0..40 {
            opened.harness.event(Event::PointerMoved(middle));
            let delta = egui::vec2(0.0, turn);
            opened.harness.event(Event::MouseWheel {
                unit: egui::MouseWheelUnit::Point,
                delta,
                phase: egui::TouchPhase::Move,
                modifiers: Modifiers::NONE,
            });
            opened.harness.run_steps(1);
        }
        let bounded = (20.0..800.0).contains(&width(&opened));
        assert!(bounded && (width(&opened) > fitted) == (limit > 1.0), "{fitted} {}", width(&opened));
    }
    key(&mut opened, Modifiers::NONE, Key::F);
    assert!((width(&opened) - fitted).abs() < 1.0);
    let canvas = opened.harness.get_by_label("canvas").rect();
    assert!(canvas.contains_rect(opened.harness.get_by_label("node outputs").rect()));
}

#[test]
fn the_graph_is_exported_as_a_drawing_and_for_graphviz() {
    let mut opened = canvas("epi.ron");
    opened.frames(1);
    for (entry, ending, has) in
        [("As epi.svg", "svg", ">interpolate</text>"), ("As epi.dot", "dot", "\"interpolate\" ->")]
    {
        opened.click("Export");
        opened.click(entry);
        let text = std::fs::read_to_string(opened.path.with_extension(ending)).unwrap();
        assert!(text.contains(has), "{text}");
        assert!(notice(&opened).contains(&format!("epi.{ending}")));
    }
}

#[test]
fn thumbnails_capture_ports_only_while_they_are_on() {
    let mut opened = in_front(Opened::with("render-cache.ron", true, [256, 192]));
    opened.frames(20);
    let watched = |opened: &Opened| {
        let snapshots = &opened.app().session.state.snapshots;
        snapshots.iter().filter(|snapshot| snapshot.name.contains('.')).count()
    };
    assert_eq!(watched(&opened), 0);
    opened.click("Thumbnails");
    opened.frames(10);
    for _ in 0..20 {
        opened.frames(1);
    }
    assert!(watched(&opened) >= 3, "{}", watched(&opened));
    let shown = opened.shot("canvas-thumbnails");
    opened.click("Thumbnails");
    opened.frames(2);
    assert_eq!(watched(&opened), 0);
    assert_ne!(opened.shot("canvas-no-thumbnails"), shown);
}

#[test]
fn only_visible_thumbnails_are_captured() {
    let mut opened = in_front(Opened::new("epi.ron"));
    opened.frames(4);
    opened.click("Thumbnails");
    key(&mut opened, Modifiers::NONE, Key::F);
    let watched = |opened: &mut Opened, seconds: usize| {
        // The frames of this window are a quarter of a second apart.
        opened.harness.run_steps(4 * seconds);
        opened.frames(1);
        let snapshots = opened.app().session.state.snapshots.iter().map(|snapshot| snapshot.name.clone());
        snapshots.filter(|name| name.contains('.')).collect::<Vec<_>>()
    };
    let all = watched(&mut opened, 1);
    assert!(all.len() > 4, "{all:?}");
    let of = |node: &str| all.iter().find(|port| port.starts_with(node)).unwrap().clone();
    let (near, far) = (of("tonemap."), of("view/"));
    // Zoom in on one box until the others are out of sight.
    let spot = at(&opened, "node tonemap");
    let zoom = |opened: &mut Opened, turn: f32| {
        for _ in 0..40 {
            opened.harness.event(Event::PointerMoved(spot));
            opened.harness.event(Event::MouseWheel {
                unit: egui::MouseWheelUnit::Point,
                delta: egui::vec2(0.0, turn),
                phase: egui::TouchPhase::Move,
                modifiers: Modifiers::NONE,
            });
        }
        opened.harness.run_steps(8);
    };
    zoom(&mut opened, 60.0);
    let seen = watched(&mut opened, 8);
    assert!(seen.contains(&near) && !seen.contains(&far), "{seen:?}");
    zoom(&mut opened, -60.0);
    assert_eq!(watched(&mut opened, 1), all);
}

/// The brightness of a pin just outside its box, as the sum of the channels.
fn brightness(image: &[u8], pin: Pos2) -> u32 {
    let index = 4 * (pin.y as usize * 1280 + pin.x as usize - 2);
    image[index..index + 3].iter().map(|channel| u32::from(*channel)).sum()
}

#[test]
fn while_a_wire_is_dragged_only_pins_that_fit_stay_bright() {
    let mut opened = in_front(Opened::with("render-cache.ron", true, [64, 48]));
    let (from, nowhere) = (at(&opened, "output fill.color"), ground(&opened));
    let (fits, does_not) = (at(&opened, "input tonemap.color"), at(&opened, "input request.id"));
    let before = opened.shot("canvas-still");
    pull(&mut opened, from, nowhere);
    let during = opened.shot("canvas-wire");
    assert!(brightness(&during, fits) + 30 > brightness(&before, fits));
    assert!(brightness(&during, does_not) < brightness(&before, does_not) * 2 / 3);
    button(&opened, nowhere, false, Modifiers::NONE);
    opened.harness.run_steps(3);
    key(&mut opened, Modifiers::NONE, Key::Escape);
    assert_eq!(opened.app().session.document.revision(), 0);
}

#[test]
fn a_change_to_a_base_is_marked_edited_and_taken_back() {
    let mut opened = canvas("experiments/blur.ron");
    assert_eq!(opened.app().session.document.problems(), []);
    let marked = "node antialias, changed: in the place of antialias";
    assert!(opened.harness.query_by_label_contains(marked).is_some());
    assert!(opened.harness.query_by_label("node tonemap").is_some());
    assert!(opened.harness.query_by_label("1 change to epi").is_some());

    // A wire of the base's nodes.
    let (from, to) = (at(&opened, "output spread.color"), at(&opened, "input tonemap.color"));
    let before = opened.text().to_owned();
    drag(&mut opened, from, to);
    assert!(opened.text().contains("rewire: { \"tonemap.color\": \"spread.color\" }"), "{}", opened.text());
    assert!(
        opened.harness.query_by_label_contains("node tonemap, changed: color takes spread.color").is_some()
    );
    assert!(opened.harness.query_by_label("2 changes to epi").is_some());
    undone(&mut opened, &before);

    // Its nodes cannot be removed, and it says so; they can be bypassed.
    let spread = at(&opened, "node spread");
    clicks(&mut opened, spread, 1);
    key(&mut opened, Modifiers::NONE, Key::Delete);
    assert!(notice(&opened).contains("a change cannot remove it; bypass it"), "{}", notice(&opened));
    assert_eq!(opened.text(), before);
    key(&mut opened, Modifiers::NONE, Key::B);
    assert!(opened.text().contains("bypass: true"), "{}", opened.text());

    // Taken back from the parameters of the node.
    assert!(opened.harness.query_by_label_contains("Changed from epi: in the place of spread").is_some());
    opened.click("As in the base");
    assert!(!opened.text().contains("spread"), "{}", opened.text());
}

#[test]
fn a_change_is_listed_and_written_out_in_full() {
    let mut opened = canvas("experiments/blur.ron");
    opened.click("1 change to epi");
    opened.click("antialias: in the place of antialias");
    opened.harness.run_steps(3);
    assert_eq!(opened.app().session.selected.as_deref(), Some("antialias"));
    opened.click("1 change to epi");
    opened.click("Write out in full …");
    opened.harness.run_steps(3);
    opened.click("Write");
    opened.harness.run_steps(3);
    assert!(notice(&opened).contains("wrote the whole graph to"), "{}", notice(&opened));
    let full = opened.path.with_file_name("blur-full.ron");
    let text = std::fs::read_to_string(full).unwrap();
    assert!(text.contains("\"view/cull\": (") && text.contains("shader: \"blur.wgsl\""), "{text}");
}
