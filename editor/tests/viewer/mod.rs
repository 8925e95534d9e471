//! The viewer, operated through its widgets: comparisons, histograms, sorted tables, and zoomed-in pixels.

mod compare;
mod drawn;
mod list;
mod look;

use egui::{Event, Modifiers, MouseWheelUnit, Pos2, Rect, TouchPhase, accesskit::Role, vec2};
use egui_kittest::kittest::Queryable;
use epigraph_editor::{document::Tag, intent::Intent, panes::Viewer};

use crate::support::Opened;

/// A window on the edge-and-point image with one viewer.
struct View {
    opened: Opened,
}

impl View {
    /// Opens the window and runs this many frames of the graph.
    fn new(size: [u32; 2], render: bool, frames: u32) -> Self {
        let mut opened = Opened::with("epi.ron", render, size);
        opened.frames(frames);
        Self { opened }
    }

    fn viewer(&self) -> &Viewer {
        self.opened.app().viewers().min_by_key(|viewer| viewer.id).unwrap()
    }

    fn click(&mut self, label: &str) {
        self.opened.click(label);
        self.settle();
    }

    fn settle(&mut self) {
        self.opened.settle(4);
    }

    /// Shows a port in the viewer in use, and waits until it is drawn.
    fn see(&mut self, port: &str) {
        let id = self.opened.app().viewer_in_use().unwrap().id;
        self.opened.push(Intent::Show(port.into()));
        self.opened.until(port, |app| {
            let viewer = app.viewers().find(|viewer| viewer.id == id).unwrap();
            viewer.port == port && (viewer.picture().is_some() || viewer.list.is_some())
        });
        self.settle();
    }

    /// Changes a parameter and runs a frame with it.
    fn set(&mut self, node: &str, param: &str, value: &str) {
        let session = &mut self.opened.harness.state_mut().session;
        session.edit(Tag::Once, |file| file.set_param(node, param, value));
        // Let the window send it to the engine.
        self.settle();
        self.opened.frames(1);
    }

    fn press(&mut self, role: Role, label: &str) {
        self.opened.harness.get_by_role_and_label(role, label).click();
        self.settle();
    }

    /// Chooses `label` in the combo box that shows `from`.
    fn choose(&mut self, from: &str, label: &str) {
        let boxes = self.opened.harness.query_all_by_role(Role::ComboBox);
        let found = boxes.into_iter().find(|node| node.value().as_deref() == Some(from));
        found.unwrap_or_else(|| panic!("no box shows {from}")).click();
        self.settle();
        // An open list is drawn last.
        let offered = self.opened.harness.query_all_by_label(label);
        offered.last().unwrap_or_else(|| panic!("{label} is not offered")).click();
        self.settle();
    }

    fn rect(&self, label: &str) -> Rect {
        self.opened.harness.get_by_label(label).rect()
    }

    fn image(&self) -> Rect {
        self.opened.harness.get_by_label_contains("image of ").rect()
    }

    fn drag(&mut self, from: Pos2, to: Pos2) {
        let harness = &mut self.opened.harness;
        harness.hover_at(from);
        harness.run_steps(2);
        harness.drag_at(from);
        harness.run_steps(1);
        for share in [0.3, 0.7, 1.0] {
            harness.hover_at(from.lerp(to, share));
            harness.run_steps(1);
        }
        harness.drop_at(to);
        self.settle();
    }

    fn hover(&mut self, at: Pos2) {
        self.opened.harness.hover_at(at);
        self.opened.harness.run_steps(3);
    }

    /// Turns the mouse wheel at a position; 150 points double the zoom.
    fn wheel(&mut self, at: Pos2, points: f32) {
        self.hover(at);
        self.opened.harness.event(Event::MouseWheel {
            unit: MouseWheelUnit::Point,
            delta: vec2(0.0, points),
            phase: TouchPhase::Move,
            modifiers: Modifiers::NONE,
        });
        // Wait for smooth scrolling.
        self.opened.settle(30);
    }
}
