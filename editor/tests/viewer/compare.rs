use std::{
    fs,
    path::{Path, PathBuf},
    sync::Arc,
};

use egui::{DroppedFile, Event, Key, vec2};
use egui_kittest::kittest::Queryable;
use epigraph_editor::{
    engine::Command,
    panes::viewer::{Figures, Way, With},
};
use epigraph_pictures::png;

use super::*;

impl View {
    fn against(&self) -> &epigraph_editor::panes::viewer::Compare {
        self.viewer().compare.as_ref().unwrap()
    }

    /// Waits for figures for which `fit` is true.
    fn figures(&mut self, fit: impl Fn(&Figures) -> bool) -> Figures {
        let fits =
            |viewer: &Viewer| viewer.compare.as_ref().and_then(|compare| compare.figures()).is_some_and(&fit);
        self.opened.until("figures", |app| app.viewers().any(fits));
        *self.against().figures().unwrap()
    }

    fn trouble(&mut self) -> String {
        let troubled =
            |viewer: &Viewer| viewer.compare.as_ref().is_some_and(|compare| compare.trouble().is_some());
        self.opened.until("trouble", |app| app.viewers().any(troubled));
        self.against().trouble().unwrap().to_owned()
    }

    fn type_path(&mut self, path: &Path) {
        self.opened.harness.get_by_label("image file").focus();
        self.settle();
        self.opened.harness.event(Event::Text(path.display().to_string()));
        self.settle();
        self.opened.harness.key_press(Key::Enter);
        self.settle();
    }
}

#[test]
fn a_held_image_is_compared_with_later_ones() {
    let mut view = View::new([64, 48], false, 5);
    view.click("Compare");
    assert_eq!((&view.against().with, view.against().way), (&With::Held, Way::Wipe));
    let same = view.figures(|_| true);
    assert_eq!((same.rmse, same.flip, same.psnr, same.ssim), (0.0, 0.0, f64::INFINITY, 1.0));

    // Double the exposure.
    view.set("tonemap", "exposure", "1.0");
    let changed = view.figures(|figures| figures.flip > 0.1);
    assert!(changed.psnr < 30.0 && changed.rmse > 0.02, "{changed:?}");
    assert!(changed.ssim < 1.0);

    // Holding the current image leaves no difference.
    view.click("Hold");
    view.figures(|figures| figures.flip == 0.0);
    view.click("Compare");
    assert!(view.viewer().compare.is_none());
}

#[test]
fn a_comparison_at_exposures_that_pictures_find_is_called_that() {
    let mut view = View::new([64, 48], false, 3);
    view.click("Compare");
    let warned = |view: &View| view.opened.harness.query_by_label_contains("exposure is Auto").is_some();
    assert!(!warned(&view));
    view.set("tonemap", "exposure", "Auto");
    view.opened.until("Auto", |app| {
        let node = app.session.state.graph.as_ref().and_then(|graph| graph.node("tonemap"));
        node.is_some_and(|node| node.ports.iter().any(|info| info.port.name == "white"))
    });
    view.settle();
    assert!(warned(&view));
    view.set("tonemap", "exposure", "1.0");
    view.opened.until("a number", |app| {
        let node = app.session.state.graph.as_ref().and_then(|graph| graph.node("tonemap"));
        node.is_some_and(|node| node.ports.iter().all(|info| info.port.name != "white"))
    });
    view.settle();
    assert!(!warned(&view));
}

#[test]
fn the_line_of_a_wipe_can_be_dragged_and_moved_by_keys() {
    let mut view = View::new([64, 48], false, 3);
    view.click("Compare");
    let camera = view.opened.app().session.camera().unwrap();
    let line = view.rect("wipe line").center();
    let image = view.image();
    view.drag(line, line + vec2(-0.25 * image.width(), 0.0));
    let moved = view.against().wipe;
    assert!((0.2..0.3).contains(&moved), "{moved}");
    view.opened.harness.get_by_label("wipe line").focus();
    view.settle();
    view.opened.harness.key_press(Key::ArrowRight);
    view.settle();
    assert!((view.against().wipe - moved - 0.01).abs() < 1e-4);
    // This does not orbit the camera.
    assert_eq!(view.opened.app().session.camera().unwrap(), camera);
}

#[test]
fn the_image_is_compared_with_another_port() {
    let mut view = View::new([64, 48], false, 3);
    view.see("view/cull.id");
    view.click("Compare");
    view.choose("held: view/cull.id, frame 2", "view/project.id");
    assert_eq!(view.against().port(), Some("view/project.id"));
    let figures = view.figures(|figures| figures.flip > 0.0);
    assert!(figures.psnr > 5.0 && figures.psnr.is_finite(), "{figures:?}");
    for way in ["Difference", "FLIP map", "Wipe"] {
        view.click(way);
    }
    assert_eq!(view.against().way, Way::Wipe);
}

#[test]
fn the_image_is_compared_with_another_graph() {
    let mut view = View::new([64, 48], false, 3);
    view.click("Compare");
    view.choose("held: image, frame 2", "another graph …");
    let restart = |view: &mut View| {
        view.opened.app().session.engine.send(Command::Reset);
        // One requested frame may still run after the reset.
        view.opened.until("the reset", |app| app.session.state.frames <= 1);
        view.opened.frames(5);
    };
    // At first, the other graph is this one as saved.
    restart(&mut view);
    view.figures(|figures| figures.flip == 0.0);
    view.set("tonemap", "exposure", "1.0");
    view.figures(|figures| figures.flip > 0.1);

    // Then another file.
    view.opened.pick("Graph beside", "render-cache.ron");
    restart(&mut view);
    view.opened.until("the other", |app| {
        app.session.state.other.as_ref().is_some_and(|other| other.path.ends_with("render-cache.ron"))
    });
    view.figures(|figures| figures.flip > 0.0);
    view.click("Compare");
    view.opened.until("its end", |app| app.session.state.other.is_none());
}

#[test]
fn the_image_is_compared_with_a_variant_of_a_graph() {
    let mut view = View::new([64, 48], false, 3);
    view.click("Compare");
    view.choose("held: image, frame 2", "another graph …");
    let vary = |view: &mut View, changes: &str| {
        view.opened.harness.get_by_label("Changes to the graph beside").focus();
        view.settle();
        view.opened.harness.key_press_modifiers(Modifiers::COMMAND, Key::A);
        view.opened.harness.event(Event::Text(changes.into()));
        view.settle();
    };
    vary(&mut view, "+tonemap.exposure=1.0");
    view.figures(|figures| figures.flip > 0.1);
    view.opened.until("the variant", |app| {
        app.session
            .state
            .other
            .as_ref()
            .is_some_and(|other| other.path.ends_with("epi.ron +tonemap.exposure=1.0"))
    });
    // A shader in the place of a stage.
    let shader = view.opened.folder().join("experiments/blur.wgsl");
    vary(&mut view, &format!("+swap:antialias={}", shader.display()));
    view.opened.until("the shader", |app| {
        let graph = app.session.state.other.as_ref().and_then(|other| other.graph.as_ref());
        graph.and_then(|graph| graph.node("antialias")).is_some_and(|node| node.kind == "wgsl")
    });
    view.opened.frames(2);
    view.figures(|figures| figures.flip > 0.0);
    assert_eq!(view.opened.app().session.beside.trouble(), None);
    // What cannot be made is told.
    vary(&mut view, "+interpolate.sigmo=1.0");
    let told = |app: &epigraph_editor::app::App| {
        let other = app.session.state.other.as_ref().and_then(|other| other.trouble.clone());
        app.session.beside.trouble().or(other).is_some_and(|trouble| trouble.contains("did you mean `sigma`"))
    };
    view.opened.until("the mistake", told);
}

#[test]
fn the_image_is_compared_with_a_file() {
    let mut view = View::new([64, 48], false, 3);
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name);
    let colors = view.viewer().picture().unwrap().colors.clone();
    fs::write(path("same.png"), png([64, 48], &colors).unwrap()).unwrap();
    fs::write(path("small.png"), png([1, 1], &[[0; 3]]).unwrap()).unwrap();
    view.click("Compare");
    view.choose("held: image, frame 2", "an image file …");
    assert!(view.opened.harness.query_by_label_contains("drop one on the window").is_some());
    view.type_path(&path("same.png"));
    assert_eq!(view.figures(|_| true).flip, 0.0);
    view.opened.harness.get_by_label("image file").focus();
    view.settle();
    view.opened.harness.key_press_modifiers(Modifiers::COMMAND, Key::A);
    view.type_path(&path("small.png"));
    let trouble = view.trouble();
    assert!(trouble.contains("64x48") && trouble.contains("1x1"), "{trouble}");
    view.opened.harness.get_by_label("image file").focus();
    view.settle();
    view.opened.harness.key_press_modifiers(Modifiers::COMMAND, Key::A);
    view.type_path(&path("none.png"));
    view.opened.until("the error", |app| {
        let trouble = |viewer: &Viewer| viewer.compare.as_ref()?.trouble().map(str::to_owned);
        app.viewers()
            .find_map(trouble)
            .is_some_and(|text| text.contains("cannot read") && text.contains("none.png"))
    });
}

#[derive(Debug)]
struct Dropped(PathBuf);

impl DroppedFile for Dropped {
    fn path(&self) -> &Path {
        &self.0
    }

    fn bytes(&self) -> Result<Vec<u8>, String> {
        fs::read(&self.0).map_err(|error| error.to_string())
    }
}

#[test]
fn the_image_is_compared_with_a_dropped_file() {
    let mut view = View::new([64, 48], false, 3);
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("reference.png");
    fs::write(&path, png([64, 48], &vec![[255, 0, 0]; 64 * 48]).unwrap()).unwrap();
    let files = &mut view.opened.harness.input_mut().dropped_files;
    files.push(Arc::new(Dropped(folder.path().join("notes.txt"))));
    view.settle();
    assert!(view.viewer().compare.is_none(), "a text file is ignored");
    view.opened.harness.input_mut().dropped_files.push(Arc::new(Dropped(path)));
    view.settle();
    assert_eq!(view.against().with, With::File);
    assert!(view.figures(|_| true).flip > 0.2);
}
