use epigraph_editor::panes::viewer::List;

use super::*;

impl View {
    fn list(&self) -> &List {
        self.viewer().list.as_ref().unwrap()
    }
}

#[test]
fn a_list_is_a_table_with_pages() {
    let mut view = View::new([64, 48], false, 6);
    view.opened.click("cloud/age");
    view.click("View cloud");
    view.opened.until("the table", |app| app.viewers().any(|viewer| viewer.list.is_some()));
    view.settle();
    assert_eq!(view.list().page(3), [0, 1, 2]);
    assert!(view.opened.harness.query_by_label("position.x").is_some());
    view.click("▶");
    let second = view.list().page(1)[0];
    assert!(second > 3, "{second}");
    view.click("⏭");
    let rows = view.list().page(1000);
    assert_eq!(rows.last(), Some(&(rows[0] + rows.len() - 1)));
    view.click("⏮");
    assert_eq!(view.list().page(1), [0]);
}

#[test]
fn a_click_on_a_heading_sorts_the_rows() {
    let mut view = View::new([64, 48], false, 6);
    view.see("cloud/age.cloud");
    view.click("position.x");
    view.opened.until("the order", |app| {
        app.viewers().any(|viewer| viewer.list.as_ref().is_some_and(|list| list.page(4) != [0, 1, 2, 3]))
    });
    let state = view.opened.app().session.state.clone();
    let fields = state.fields("cloud/age.cloud").cloned().collect::<Vec<_>>();
    let positions = fields.iter().find(|field| field.field == "position").unwrap().get::<[f32; 4]>();
    let sorted =
        |view: &View| view.list().page(40).into_iter().map(|row| positions[row][0]).collect::<Vec<_>>();
    let rising = sorted(&view);
    assert!(rising[0] < 0.0 && rising.windows(2).all(|pair| pair[0] <= pair[1]), "{rising:?}");
    let largest = positions.iter().map(|[x, ..]| *x).fold(f32::MIN, f32::max);
    view.click("position.x ⏶");
    view.opened.until("the order", |app| {
        let first = |viewer: &Viewer| Some(*viewer.list.as_ref()?.page(1).first()?);
        app.viewers().find_map(first).is_some_and(|row| positions[row][0] == largest)
    });
    let falling = sorted(&view);
    assert!(falling.windows(2).all(|pair| pair[0] >= pair[1]), "{falling:?}");
    view.click("position.x ⏷");
    assert_eq!(view.list().page(3), [0, 1, 2]);
}

#[test]
fn the_table_jumps_to_an_element() {
    let mut view = View::new([64, 48], false, 3);
    view.see("cloud/age.cloud");
    view.opened.harness.get_by_role_and_label(Role::SpinButton, "row").click();
    view.settle();
    view.opened.harness.key_press_modifiers(Modifiers::COMMAND, egui::Key::A);
    view.opened.harness.event(Event::Text("1234".into()));
    view.opened.harness.key_press(egui::Key::Enter);
    view.settle();
    assert!(view.list().page(40).contains(&1234), "{:?}", view.list().page(1));
}
