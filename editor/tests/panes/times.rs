use egui_kittest::kittest::Queryable;

use crate::support::Opened;

const AGES: &str = "cloud/age.histogram";

#[test]
fn the_ages_are_captured_only_while_they_are_shown() {
    let mut opened = Opened::new("epi.ron");
    opened.frames(6);
    let counts = |app: &epigraph_editor::app::App| app.session.state.fields(AGES).next().cloned();
    assert!(counts(opened.app()).is_none());
    opened.click("Cloud");
    opened.frames(2);
    let live: u32 = counts(opened.app()).unwrap().get::<u32>().iter().sum();
    // At most a quarter of 64x48 samples arrive in each of the eight frames but the first.
    assert!((500..=7 * 768).contains(&live), "{live}");
    let text = format!("{live} of ");
    assert!(
        opened.harness.query_by_label_contains(&text).is_some()
            || opened.harness.query_by_value(&text).is_some()
    );
    assert!(opened.harness.query_by_label_contains("samples in the last frame").is_some());
    opened.click("Steps");
    opened.frames(2);
    assert!(counts(opened.app()).is_none());
}

#[test]
fn a_click_on_a_step_selects_its_node() {
    let mut opened = Opened::new("render-cache.ron");
    opened.frames(5);
    opened.click("time of fill");
    assert_eq!(opened.app().session.selected.as_deref(), Some("fill"));
    opened.click("Plot");
    assert!(opened.harness.query_by_label("stacked").is_some());
    opened.click("stacked");
    opened.click("Frame");
    assert!(opened.harness.query_by_label("lanes of the last frame").is_some());
}

/// Writes pictures for review.
#[test]
fn the_parts_are_drawn() {
    let mut opened = Opened::with("hybrid.ron", true, [256, 256]);
    opened.frames(40);
    let mut shots = Vec::new();
    for part in ["Steps", "Plot", "Frame", "Cloud"] {
        opened.click(part);
        opened.frames(1);
        opened.frames(1);
        shots.push(opened.shot(&format!("times-{}", part.to_lowercase())));
    }
    assert!(shots.windows(2).all(|pair| pair[0] != pair[1]));
}
