//! Draws the pictures of `docs/editor.md` (`docs/editor.png` and others), without a display. Run it from the
//! repository's folder.

#[path = "../tests/support/renderer.rs"]
mod renderer;

use std::{error::Error, path::Path, thread, time::Duration};

use egui::accesskit::Role;
use egui_kittest::{Harness, kittest::Queryable};
use epigraph_editor::{
    app::App,
    document::{Document, Tag},
    engine::{Backend, Command, Options, Pace},
    intent::{Intent, Jump},
    panes::{Pane, viewer::Compare},
};

/// Number of frames until the cloud covers the picture.
const FRAMES: u32 = 120;

/// A pixel at the edge of a link, where most stages have findings.
const PIXEL: [u32; 2] = [262, 338];

fn main() -> Result<(), Box<dyn Error>> {
    let document = Document::open(Path::new("graphs/epi.ron"))?;
    let options = Options {
        scene: "chains".into(),
        backend: Backend::Cpu,
        pacing: Pace::Exact,
        paused: true,
        ..Options::default()
    };
    let builder = Harness::builder().with_size([1280.0, 720.0]).renderer(renderer::Renderer::new());
    let mut window = builder.build_eframe(|creation| App::new(creation, document, options));
    window.state_mut().session.selected = Some("interpolate".into());
    run(&mut window, FRAMES);
    window.render()?.save("docs/editor.png")?;

    window.state_mut().show(|pane| matches!(pane, Pane::Canvas(_)));
    window.run_steps(8);
    window.render()?.save("docs/editor-canvas.png")?;

    window.state_mut().show(|pane| matches!(pane, Pane::Viewer(_)));
    window.run_steps(4);
    click(&mut window, "Compare");
    choose(&mut window, "Compared with", "another graph …");
    choose(&mut window, "Graph beside", "render-cache.ron");
    window.state().session.engine.send(Command::Reset);
    until(&mut window, |app| app.session.state.frames <= 1);
    run(&mut window, FRAMES);
    let is_measured = |compare: &Compare| compare.figures().is_some() && !compare.is_behind();
    until(&mut window, |app| app.viewers().any(|viewer| viewer.compare.as_deref().is_some_and(is_measured)));
    window.run_steps(8);
    window.render()?.save("docs/editor-compare.png")?;
    click(&mut window, "Compare");

    window.state_mut().session.push(Intent::Inspect(PIXEL));
    until(&mut window, |app| app.session.state.inspection.as_ref().is_some_and(|found| found.pixel == PIXEL));
    window.run_steps(8);
    window.render()?.save("docs/editor-pixel.png")?;

    let session = &mut window.state_mut().session;
    let path = session.document.path().to_owned();
    let text = session.document.text(&path).replace("kernel: Gaussian", "kernel: Gausian");
    session.document.type_text(&path, &text);
    window.state_mut().show(|pane| matches!(pane, Pane::Text(_)));
    until(&mut window, |app| !app.session.problems().is_empty());
    let session = &mut window.state_mut().session;
    if let Some(place) = session.problems().first().and_then(|problem| problem.place.clone()) {
        session.push(Intent::Jump(Jump { path: place.file, at: (place.line, place.column) }));
    }
    window.run_steps(20);
    window.render()?.save("docs/editor-text.png")?;

    window.state_mut().go_on(Document::open(Path::new("graphs/experiments/blur.ron"))?);
    let session = &mut window.state_mut().session;
    session.edit(Tag::Once, |file| file.set_param("view/cull", "threshold", "0.2"));
    session.selected = Some("antialias".into());
    until(&mut window, |app| app.session.state.frames == 0);
    run(&mut window, FRAMES);
    window.state_mut().show(|pane| matches!(pane, Pane::Nodes(_)));
    window.state_mut().show(|pane| matches!(pane, Pane::Canvas(_)));
    window.run_steps(8);
    window.render()?.save("docs/editor-change.png")?;
    Ok(())
}

/// Runs this many frames of the graph, and waits until the last one is drawn.
fn run(window: &mut Harness<App>, frames: u32) {
    let last = window.state().session.state.frames + frames;
    window.state().session.engine.send(Command::Step(frames));
    until(window, |app| app.session.state.frames >= last);
    window.run_steps(4);
    until(window, |app| !app.is_drawing());
    window.run_steps(2);
}

/// Draws frames of the window until `holds` is true.
fn until(window: &mut Harness<App>, holds: impl Fn(&App) -> bool) {
    while !holds(window.state()) {
        window.step();
        thread::sleep(Duration::from_millis(20));
    }
}

fn click(window: &mut Harness<App>, label: &str) {
    window.get_by_label(label).click();
    leave(window);
}

/// Picks an entry of the combo box with this name.
fn choose(window: &mut Harness<App>, list: &str, entry: &str) {
    window.get_by_role_and_label(Role::ComboBox, list).click();
    window.run_steps(4);
    if let Some(entry) = window.get_all_by_label(entry).last() {
        entry.click();
    }
    leave(window);
}

/// Moves the pointer out of the window.
fn leave(window: &mut Harness<App>) {
    window.run_steps(4);
    window.event(egui::Event::PointerGone);
    window.run_steps(4);
}
