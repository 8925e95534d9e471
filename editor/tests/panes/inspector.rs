use egui::{Event, PointerButton, Pos2, pos2};
use egui_kittest::kittest::Queryable;
use epigraph_core::{Finding, Mark};
use epigraph_editor::intent::Intent;

use crate::support::Opened;

/// The middle of the view.
fn middle(opened: &Opened) -> Pos2 {
    opened.harness.get_by_label("image of image").rect().center()
}

fn press(opened: &mut Opened, at: Pos2, pressed: bool) {
    let modifiers = egui::Modifiers::NONE;
    opened.harness.event(Event::PointerButton {
        pos: at,
        button: PointerButton::Primary,
        pressed,
        modifiers,
    });
    opened.harness.run_steps(2);
}

fn go(opened: &mut Opened, at: Pos2) {
    opened.harness.event(Event::PointerMoved(at));
    opened.harness.run_steps(2);
}

#[test]
fn a_click_inspects_a_pixel_and_a_drag_does_not() {
    let mut opened = Opened::new("epi.ron");
    opened.frames(8);
    let at = middle(&opened);
    go(&mut opened, at);
    press(&mut opened, at, true);
    press(&mut opened, at, false);
    opened.until("the pixel", |app| app.session.state.inspection.is_some());
    let inspection = opened.app().session.state.inspection.clone().unwrap();
    assert_eq!(inspection.pixel, [32, 24]);
    // The pane is in front, and lists the nodes.
    assert!(opened.harness.query_all_by_label("(32, 24)").next().is_some());
    assert!(opened.harness.query_all_by_label("view/project").next().is_some());
    // The paused frame is inspected: no frame is run for it, nor for a second pixel.
    let frames = opened.app().session.state.frames;
    assert_eq!(frames, 8);
    let next = at + egui::vec2(30.0, 0.0);
    go(&mut opened, next);
    press(&mut opened, next, true);
    press(&mut opened, next, false);
    opened.until("the next pixel", |app| {
        app.session.state.inspection.as_ref().is_some_and(|found| found.pixel[0] > 32)
    });
    assert_eq!(opened.app().session.state.frames, frames);

    let picked = opened.app().session.inspection.pixel();
    let camera = opened.app().session.camera().unwrap();
    go(&mut opened, at);
    press(&mut opened, at, true);
    (1..6).for_each(|step| go(&mut opened, at + egui::vec2(12.0 * step as f32, 0.0)));
    press(&mut opened, at + egui::vec2(60.0, 0.0), false);
    assert_eq!(opened.app().session.inspection.pixel(), picked, "a drag picks no pixel");
    assert_ne!(opened.app().session.camera().unwrap(), camera, "it orbits");
}

#[test]
fn a_hidden_inspector_inspects_nothing() {
    let mut opened = Opened::new("render-cache.ron");
    opened.frames(4);
    opened.push(Intent::Inspect([10, 10]));
    opened.until("the pixel", |app| app.session.state.inspection.is_some());
    opened.click("fill");
    assert_eq!(opened.app().session.selected.as_deref(), Some("fill"));
    opened.click("Nodes");
    opened.until("the end of it", |app| app.session.state.inspection.is_none());
    // The pixel is still picked when the pane is shown again.
    opened.click("Pixel");
    opened.until("the pixel again", |app| app.session.state.inspection.is_some());
    opened.click("forget the pixel");
    opened.until("the end of it", |app| app.session.state.inspection.is_none());
    assert_eq!(opened.app().session.inspection.pixel(), None);
}

/// Writes pictures for review.
#[test]
fn the_inspector_is_drawn() {
    let mut opened = Opened::with("epi.ron", true, [512, 512]);
    opened.frames(30);
    for (index, pixel) in [[212, 180], [300, 330], [150, 256], [256, 400]].into_iter().enumerate() {
        opened.push(Intent::Inspect(pixel));
        opened.until("the pixel", move |app| {
            app.session.state.inspection.as_ref().is_some_and(|found| found.pixel == pixel)
        });
        opened.harness.run_steps(4);
        opened.shot(&format!("inspector-{index}"));
    }
    // A pixel that an edge of the box cuts in two.
    let is_cut = |finding: &Finding| matches!(finding, Finding::Sketch(marks) if marks.iter().any(|mark| matches!(mark, Mark::Edge(_))));
    let cut = (236..256).find(|x| {
        let pixel = [*x, 362];
        opened.push(Intent::Inspect(pixel));
        opened.until("the pixel", move |app| {
            app.session.state.inspection.as_ref().is_some_and(|found| found.pixel == pixel)
        });
        let inspection = opened.app().session.state.inspection.clone().unwrap();
        inspection.nodes.iter().flat_map(|visit| visit.findings.iter().flatten()).any(is_cut)
    });
    assert!(cut.is_some(), "the box has an edge");
    let pane = pos2(150.0, 500.0);
    go(&mut opened, pane);
    for page in 0..3 {
        opened.harness.event(Event::MouseWheel {
            unit: egui::MouseWheelUnit::Point,
            delta: egui::vec2(0.0, -480.0),
            modifiers: egui::Modifiers::NONE,
            phase: egui::TouchPhase::Move,
        });
        opened.harness.run_steps(20);
        let shot = opened.shot(&format!("inspector-page-{page}"));
        assert!(!shot.is_empty());
    }
}
