//! The viewer, used as a person would: compared, counted, sorted, looked at from near.

use std::{
    path::Path,
    thread,
    time::{Duration, Instant},
};

use egui::{Event, Modifiers, MouseWheelUnit, Pos2, Rect, TouchPhase, accesskit::Role, vec2};
use egui_kittest::{Harness, kittest::Queryable};
use epigraph_editor::{
    app::App,
    document::Document,
    engine::{Backend, Command, Options, Pacing},
    opening::Opening,
    panes::{Viewer, viewer::Figures},
};

/// No test waits longer for what must come.
const PATIENCE: Duration = Duration::from_secs(120);

/// A window on a shipped graph.
struct Window {
    harness: Harness<'static, App>,
}

impl Window {
    fn new(size: [u32; 2], render: bool) -> Self {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../graphs/epi.ron");
        let document = Document::open(&path).unwrap();
        let options = Options {
            size,
            samples: 0.25,
            backend: Backend::Cpu,
            pacing: Pacing::Exact,
            paused: true,
            ..Options::default()
        };
        let builder = Harness::builder().with_size([1280.0, 720.0]);
        let builder = if render { builder.wgpu() } else { builder };
        Self {
            harness: builder.build_eframe(|creation| App::new(creation, Opening::bare(document, options))),
        }
    }

    /// After some frames of the graph.
    fn running(size: [u32; 2], frames: u32) -> Self {
        let mut window = Self::new(size, false);
        window.frames(frames);
        window
    }

    fn app(&self) -> &App {
        self.harness.state()
    }

    fn viewer(&self) -> &Viewer {
        self.app().viewers().min_by_key(|viewer| viewer.id).unwrap()
    }

    fn until(&mut self, what: &str, holds: impl Fn(&App) -> bool) {
        let start = Instant::now();
        loop {
            self.harness.step();
            if holds(self.harness.state()) {
                return self.harness.run_steps(3);
            }
            assert!(start.elapsed() < PATIENCE, "waiting for {what}");
            thread::sleep(Duration::from_millis(5));
        }
    }

    fn frames(&mut self, count: u32) {
        let until = self.app().session.state.frames + count;
        self.app().session.engine.send(Command::Step(count));
        self.until("frames", move |app| app.session.state.frames >= until);
    }

    fn click(&mut self, label: &str) {
        self.harness.get_by_label(label).click();
        self.harness.run_steps(4);
    }

    /// Shows a port in the viewer in use, as of the next frame.
    fn see(&mut self, port: &str) {
        self.harness.state_mut().session.wanted = Some(port.into());
        self.harness.run_steps(2);
        self.frames(1);
    }

    /// Chooses from a box that shows `from`.
    fn choose(&mut self, from: &str, label: &str) {
        self.harness.get_by_role_and_label(Role::ComboBox, from).click();
        self.harness.run_steps(4);
        self.click(label);
    }

    fn rect(&self, label: &str) -> Rect {
        self.harness.get_by_label(label).rect()
    }

    fn drag(&mut self, from: Pos2, to: Pos2) {
        self.harness.hover_at(from);
        self.harness.run_steps(1);
        self.harness.drag_at(from);
        self.harness.run_steps(1);
        self.harness.hover_at(from.lerp(to, 0.5));
        self.harness.run_steps(1);
        self.harness.hover_at(to);
        self.harness.run_steps(2);
        self.harness.drop_at(to);
        self.harness.run_steps(3);
    }

    /// Turns the wheel over a point of the image.
    fn wheel(&mut self, at: Pos2, points: f32) {
        self.harness.hover_at(at);
        self.harness.event(Event::MouseWheel {
            unit: MouseWheelUnit::Point,
            delta: vec2(0.0, points),
            phase: TouchPhase::Move,
            modifiers: Modifiers::NONE,
        });
        self.harness.run_steps(30);
    }

    fn figures(&mut self) -> Figures {
        self.until("figures", |app| {
            app.viewers()
                .any(|viewer| viewer.compare.as_ref().is_some_and(|compare| compare.figures().is_some()))
        });
        self.viewer().compare.as_ref().unwrap().figures().unwrap().clone()
    }

    fn shot(&mut self, name: &str) -> Vec<u8> {
        let image = self.harness.render().unwrap();
        image.save(Path::new(env!("CARGO_TARGET_TMPDIR")).join(format!("viewer-{name}.png"))).unwrap();
        image.into_raw()
    }
}

#[test]
fn every_state_is_drawn() {
    let mut window = Window::new([512, 512], true);
    window.frames(20);
    let image = "image of image";
    let mut shots = vec![window.shot("image")];
    let middle = window.rect(image).center();
    window.click("Histogram");
    shots.push(window.shot("histogram"));
    window.click("Compare");
    window.figures();
    shots.push(window.shot("wipe"));
    window.harness.state_mut().session.move_camera(|rig| rig.orbit(0.05, 0.0));
    window.frames(2);
    thread::sleep(Duration::from_secs(3));
    window.harness.run_steps(20);
    thread::sleep(Duration::from_secs(6));
    window.harness.run_steps(20);
    shots.push(window.shot("wiped"));
    window.click("FLIP map");
    shots.push(window.shot("flip"));
    window.click("Difference");
    shots.push(window.shot("difference"));
    window.choose("held: image, frame 20", "an image file …");
    shots.push(window.shot("file"));
    window.click("Compare");
    window.click("Histogram");
    window.see("interpolate.color");
    shots.push(window.shot("color"));
    window.wheel(middle, 900.0);
    shots.push(window.shot("values"));
    window.click("Fit");
    window.see("view/cull.filtered");
    window.click("Histogram");
    shots.push(window.shot("depth"));
    window.choose("Depth", "False colour");
    shots.push(window.shot("false-colour"));
    window.click("Histogram");
    window.see("interpolate.priority");
    window.choose("Grey", "False colour");
    shots.push(window.shot("priority"));
    window.see("edges/edge_raster.mask");
    shots.push(window.shot("edges"));
    window.wheel(middle + vec2(-90.0, 20.0), 520.0);
    shots.push(window.shot("edges-near"));
    window.see("edges/classify.cls");
    shots.push(window.shot("classes-near"));
    window.click("Fit");
    shots.push(window.shot("classes"));
    window.see("edges/reach.r24");
    window.harness.hover_at(middle + vec2(-86.0, 22.0));
    window.harness.run_steps(3);
    shots.push(window.shot("reach"));
    window.wheel(middle + vec2(-86.0, 22.0), 460.0);
    shots.push(window.shot("reach-near"));
    window.wheel(middle + vec2(-86.0, 22.0), 200.0);
    shots.push(window.shot("reach-nearer"));
    window.click("Fit");
    window.see("view/project.id");
    shots.push(window.shot("ids"));
    window.click("Ages");
    window.frames(1);
    shots.push(window.shot("ages"));
    window.see("cloud/age.cloud");
    shots.push(window.shot("list"));
    window.click("age");
    window.until("order", |app| app.viewers().next().unwrap().list.as_ref().unwrap().page(1) != [0]);
    shots.push(window.shot("list-sorted"));
    for (first, second) in shots.iter().zip(&shots[1..]) {
        assert_ne!(first, second);
    }
}
