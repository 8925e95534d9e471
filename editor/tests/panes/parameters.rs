//! Parameters of graphs and of repeated nodes, seen and set in the window.

use egui::{Event, Key, Modifiers, Rect, accesskit::Role};
use egui_kittest::kittest::Queryable;

use crate::support::Opened;

const GRAPH: &str = r#"Graph(
    version: 1,
    params: {
        "light": (default: 0.5, doc: "Factor of each step.", range: (0.0, 2.0)),
        "steps": (default: 3, range: (1, 8)),
    },
    nodes: {
        "cache": (kind: "graph", params: (file: "render-cache.ron")),
        "row": (
            kind: "wgsl",
            repeat: (times: Param("steps"), through: { "color": "paler" }, count: "level"),
            inputs: { "color": "cache/fill.color" },
            params: (shader: "pale.wgsl", light: Param("light")),
        ),
        "show": (kind: "graph", params: (file: "show.ron", exposure: 2.0), inputs: { "color": "row.paler" }),
    },
    outputs: { "image": "show.image" },
)
"#;

const SHOW: &str = r#"Graph(
    version: 1,
    doc: "Shows a picture.",
    params: { "exposure": (default: 1.0, doc: "Factor of the picture.", range: (0.0, 4.0)) },
    nodes: { "map": (kind: "tonemap", inputs: { "color": "inputs.color" }, params: (exposure: Param("exposure"))) },
    outputs: { "image": "map.image" },
)
"#;

const SHADER: &str = r#"
struct Params {
    /// Factor.
    light: f32,
    level: u32,
}
@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var color: texture_2d<f32>;
@group(0) @binding(2) var paler: texture_storage_2d<rgba32float, write>;
@compute @workgroup_size(8, 8)
fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    let shift = f32(params.level) * 0.01;
    textureStore(paler, id.xy, textureLoad(color, id.xy, 0) * params.light + vec4(shift));
}
"#;

fn opened() -> Opened {
    let mut opened =
        Opened::written("rows.ron", &[("rows.ron", GRAPH), ("show.ron", SHOW), ("pale.wgsl", SHADER)]);
    opened.frames(2);
    opened
}

/// Types a number beside the slider of that name.
fn fill(opened: &mut Opened, name: &str, text: &str) {
    let slider = opened.harness.get_by_role_and_label(Role::Slider, name).rect();
    let beside = |at: Rect| {
        at.y_range().intersects(slider.y_range()) && (0.0..16.0).contains(&(at.left() - slider.right()))
    };
    let numbers = opened.harness.get_all_by_role(Role::SpinButton);
    numbers.into_iter().find(|number| beside(number.rect())).expect("a number beside the slider").click();
    opened.harness.run_steps(3);
    opened.harness.key_press_modifiers(Modifiers::COMMAND, Key::A);
    opened.harness.event(Event::Text(text.into()));
    opened.harness.key_press(Key::Enter);
    opened.settle(3);
}

#[test]
fn a_number_can_be_left_to_the_stage() {
    let mut opened = Opened::new("epi.ron");
    opened.frames(2);
    select(&mut opened, Some("tonemap"));
    opened.click("Auto");
    assert!(opened.text().contains("params: (exposure: Auto)"), "{}", opened.text());
    assert!(opened.harness.query_by_role_and_label(Role::Slider, "exposure").is_none());
    opened.frames(2);
    assert_eq!(opened.app().session.problems(), []);
    // The number is the default again.
    opened.click("Auto");
    assert!(opened.text().contains("params: (exposure: 0.0)"), "{}", opened.text());
    fill(&mut opened, "exposure", "1.5");
    assert!(opened.text().contains("params: (exposure: 1.5)"), "{}", opened.text());
    opened.click("default of exposure");
    assert!(!opened.text().contains("exposure"), "{}", opened.text());
}

fn select(opened: &mut Opened, node: Option<&str>) {
    opened.harness.state_mut().session.selected = node.map(str::to_owned);
    opened.settle(3);
}

/// Types a value into the field of a parameter that is taken from the graph, and leaves it.
fn type_over(opened: &mut Opened, name: &str, value: &str) {
    opened.harness.get_by_role_and_label(Role::TextInput, name).focus();
    opened.harness.run_steps(2);
    opened.harness.get_by_role_and_label(Role::TextInput, name).type_text(value);
    opened.harness.run_steps(2);
    opened.harness.key_press(Key::Enter);
    opened.settle(3);
}

fn names(opened: &Opened) -> Vec<String> {
    let graph = opened.app().session.state.graph.clone().unwrap();
    graph.nodes.iter().map(|node| node.name.clone()).collect()
}

#[test]
fn parameters_of_the_graph_are_set_where_nothing_is_selected() {
    let mut opened = opened();
    select(&mut opened, None);
    fill(&mut opened, "light", "0.25");
    assert_eq!(opened.text(), GRAPH.replace("default: 0.5", "default: 0.25"));
    fill(&mut opened, "steps", "5");
    opened.until("five copies", |app| {
        app.session.state.graph.as_ref().is_some_and(|graph| graph.node("row/4").is_some())
    });
    assert!(!names(&opened).contains(&"row/5".to_owned()));
    assert_eq!(opened.app().session.problems(), []);
}

#[test]
fn a_node_keeps_what_it_takes_from_its_graph_until_a_value_is_typed_over_it() {
    let mut opened = opened();
    // Looking, and leaving an empty field, changes nothing.
    select(&mut opened, Some("row"));
    assert!(opened.harness.query_by_label("counts the copies").is_some());
    type_over(&mut opened, "light", "");
    assert_eq!(opened.text(), GRAPH);
    type_over(&mut opened, "light", "0.75");
    let typed = GRAPH.replace("Param(\"light\")", "0.75");
    assert_eq!(opened.text(), typed);
    opened.click("Undo");
    assert_eq!(opened.text(), GRAPH);
    // One copy alone, and back to what all have.
    select(&mut opened, Some("row/1"));
    type_over(&mut opened, "light", "0.75");
    assert!(opened.text().contains(r#"set: { "1": (light: 0.75) },"#), "{}", opened.text());
    opened.until("the copy", |app| {
        let graph = app.session.document.file();
        graph.is_some_and(|file| file.node("row").is_some_and(|node| !node.set.is_empty()))
    });
    assert_eq!(opened.app().session.problems(), []);
    opened.click("default of light");
    assert!(!opened.text().contains("0.75"), "{}", opened.text());
    // The name leads to the parameter.
    opened.harness.get_all_by_role_and_label(Role::Label, "light").last().expect("the link").click();
    opened.settle(3);
    assert_eq!(opened.app().session.selected, None);
}

#[test]
fn parameters_of_a_part_are_set_at_its_node() {
    let mut opened = opened();
    select(&mut opened, Some("show"));
    fill(&mut opened, "exposure", "1.5");
    assert_eq!(opened.text(), GRAPH.replace("exposure: 2.0", "exposure: 1.5"));
    opened.click("default of exposure");
    assert_eq!(opened.text(), GRAPH.replace(", exposure: 2.0", ""));
    // In the part: the file stays, and goes on handing out its parameter.
    select(&mut opened, Some("show/map"));
    type_over(&mut opened, "exposure", "3.0");
    assert!(opened.text().contains(r#"set: { "map": (exposure: 3.0) }"#), "{}", opened.text());
    let part = opened.folder().join("show.ron").display().to_string();
    assert_eq!(opened.app().session.document.text(&part), SHOW);
    opened.click("default of exposure");
    assert!(!opened.text().contains("3.0"), "{}", opened.text());
}

#[test]
fn the_canvas_shows_a_row_as_one_node_with_its_count() {
    let mut opened = opened();
    opened.click("Canvas");
    assert!(opened.harness.query_by_label_contains("node row, 3 in a row").is_some());
    // Its wires are those of the first and of the last copy.
    for pin in ["input row.color", "output row.paler", "input show.color"] {
        assert!(opened.harness.query_by_label(pin).is_some(), "{pin}");
    }
    assert_eq!(names(&opened).iter().filter(|name| name.starts_with("row/")).count(), 3);
}

#[test]
fn parameters_of_a_base_are_set_in_the_change() {
    let change = "Graph(\n    version: 1,\n    base: \"rows.ron\",\n)\n";
    let mut opened = Opened::written(
        "change.ron",
        &[("change.ron", change), ("rows.ron", GRAPH), ("show.ron", SHOW), ("pale.wgsl", SHADER)],
    );
    opened.frames(2);
    let with = |line: &str| change.replace(")\n", &format!("    {line},\n)\n"));
    select(&mut opened, None);
    fill(&mut opened, "light", "0.25");
    assert_eq!(opened.text(), with(r#"params: { "light": (default: 0.25) }"#));
    opened.until("its value", |app| {
        let graph = app.session.state.graph.as_ref();
        graph.and_then(|graph| graph.value("", "light")).is_some_and(|value| value == "0.25")
    });
    opened.click("default of light");
    assert_eq!(opened.text(), with("params: {}"));
    opened.click("Undo");
    opened.click("Undo");
    assert_eq!(opened.text(), change);

    // One copy of a repeated node, and a part's parameter.
    select(&mut opened, Some("row/1"));
    type_over(&mut opened, "light", "0.75");
    assert_eq!(opened.text(), with(r#"set: { "row/1": (light: 0.75) }"#));
    select(&mut opened, Some("show"));
    fill(&mut opened, "exposure", "1.5");
    assert_eq!(opened.text(), with(r#"set: { "row/1": (light: 0.75), "show": (exposure: 1.5) }"#));
    opened.click("default of exposure");
    assert_eq!(opened.text(), with(r#"set: { "row/1": (light: 0.75) }"#));
    opened.frames(1);
    assert_eq!(opened.app().session.problems(), []);
    let base = opened.folder().join("rows.ron").display().to_string();
    assert_eq!(opened.app().session.document.text(&base), GRAPH);
}
