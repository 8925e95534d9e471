//! Support for tests: a window without a display, on a graph.

mod renderer;

use std::{
    fs,
    path::{Path, PathBuf},
    process::Command,
    sync::LazyLock,
    thread,
    time::{Duration, Instant, SystemTime},
};

use egui::{Event, Key, Modifiers, accesskit::Role, vec2};
use egui_kittest::{Harness, HarnessBuilder, kittest::Queryable};
use epigraph_core::Registry;
use epigraph_editor::{
    app::App,
    document::Document,
    engine::{self, Backend, Options, Pace},
    intent::Intent,
    opening::Opening,
    store::Store,
};
use renderer::Renderer;

/// Time limit for each wait.
pub const PATIENCE: Duration = Duration::from_secs(120);

/// Width and height of the window, points: the smallest that the editor supports.
pub const WINDOW: [f32; 2] = [1280.0, 720.0];

/// A window on a shipped graph.
pub struct Opened {
    pub harness: Harness<'static, App>,
    /// The graph's file.
    pub path: PathBuf,
    /// The folder of the graph, if it is a copy.
    _folder: Option<tempfile::TempDir>,
}

/// Options that make the window the same in every run: exact samples, no measured times, frames on demand.
pub fn options(size: [u32; 2]) -> Options {
    Options {
        size,
        samples: 0.25,
        backend: Backend::Cpu,
        pacing: Pace::Exact,
        paused: true,
        measured: false,
        ..Options::default()
    }
}

impl Opened {
    /// Opens a copy of a shipped graph, with frames of 64x48 pixels. The window is not drawn.
    pub fn new(graph: &str) -> Self {
        Self::with(graph, false, [64, 48])
    }

    /// Opens a copy of a shipped graph, with frames of `size` pixels. The window can be drawn if `render` is true.
    pub fn with(graph: &str, render: bool, size: [u32; 2]) -> Self {
        let (folder, path) = copy(graph);
        let builder = Harness::builder().with_size(WINDOW);
        let builder = if render { builder.renderer(Renderer::new()) } else { builder };
        Self::build(builder, path, Some(folder), options(size))
    }

    /// Opens a copy of a shipped graph on a scene, with frames of 64x48 pixels.
    pub fn on_scene(graph: &str, scene: &str) -> Self {
        let (folder, path) = copy(graph);
        let options = Options { scene: scene.into(), ..options([64, 48]) };
        Self::build(Harness::builder().with_size(WINDOW), path, Some(folder), options)
    }

    /// Opens a graph that is written with other files into a copy of the shipped graphs; frames of 64x48 pixels.
    pub fn written(graph: &str, files: &[(&str, &str)]) -> Self {
        let (folder, path) = copy(graph);
        for (name, text) in files {
            fs::write(folder.path().join(name), text).unwrap();
        }
        Self::build(Harness::builder().with_size(WINDOW), path, Some(folder), options([64, 48]))
    }

    /// Opens the shipped graph itself, so that the path in the window is the same wherever the tests run.
    pub fn shipped(graph: &str, builder: HarnessBuilder<App>, options: Options) -> Self {
        Self::build(builder.renderer(Renderer::new()), Path::new("../graphs").join(graph), None, options)
    }

    fn build(
        builder: HarnessBuilder<App>,
        path: PathBuf,
        folder: Option<tempfile::TempDir>,
        options: Options,
    ) -> Self {
        let document = Document::open(&path).unwrap();
        let harness = builder.build_eframe(|creation| App::new(creation, document, options));
        Self { harness, path, _folder: folder }
    }

    /// Opens a copy of a shipped graph in the window of a program with these kinds of stage.
    pub fn with_stages(graph: &str, registry: Registry) -> Self {
        let (folder, path) = copy(graph);
        let opening = Opening::new(None, path.to_str(), None, options([64, 48])).unwrap();
        Self { _folder: Some(folder), ..Self::open(opening, registry) }
    }

    /// Opens the window as the program does at its start, with sessions in a folder, and these arguments.
    pub fn started(sessions: &Path, graph: Option<&Path>, scene: Option<&str>) -> Self {
        let graph = graph.map(|path| path.display().to_string());
        let store = Store::at(sessions.to_owned());
        let opening = Opening::new(Some(store), graph.as_deref(), scene, options([64, 48])).unwrap();
        Self::open(opening, epigraph::registry())
    }

    fn open(opening: Opening, registry: Registry) -> Self {
        let path = PathBuf::from(opening.document.path());
        let harness = Harness::builder()
            .with_size(WINDOW)
            .build_eframe(|creation| App::open(creation, opening, registry));
        Self { harness, path, _folder: None }
    }

    pub fn app(&self) -> &App {
        self.harness.state()
    }

    /// Adds a request, as a pane does. The next frame handles it.
    pub fn push(&mut self, intent: Intent) {
        self.harness.state_mut().session.push(intent);
    }

    /// Draws frames of the window until `holds` is true.
    pub fn until(&mut self, what: &str, holds: impl Fn(&App) -> bool) {
        let start = Instant::now();
        loop {
            self.harness.step();
            if holds(self.harness.state()) {
                // The next step lays out the new contents.
                return self.settle(3);
            }
            assert!(
                start.elapsed() < PATIENCE,
                "waiting for {what}: {:?}",
                self.app().session.state.problems
            );
            thread::sleep(Duration::from_millis(5));
        }
    }

    /// Draws this many frames of the window, and if the graph is paused, more until no picture is stale. Pictures are
    /// drawn on another thread; while the graph runs, there would always be a newer frame.
    pub fn settle(&mut self, steps: usize) {
        self.harness.run_steps(steps);
        let start = Instant::now();
        while self.app().is_drawing() && self.app().session.state.paused {
            assert!(start.elapsed() < PATIENCE, "waiting for pictures");
            thread::sleep(Duration::from_millis(1));
            self.harness.step();
        }
        // New pictures change the layout of widgets beside them.
        self.harness.run_steps(2);
    }

    /// Runs this many frames of the graph.
    pub fn frames(&mut self, count: u32) {
        let until = self.app().session.state.frames + count;
        self.app().session.engine.send(engine::Command::Step(count));
        self.until("frames", move |app| app.session.state.frames >= until);
    }

    pub fn click(&mut self, label: &str) {
        self.harness.get_by_label(label).click();
        self.settle(3);
    }

    /// Chooses an entry of a menu, and waits for its effect.
    pub fn choose(&mut self, menu: &[&str; 2]) {
        self.choose_first(menu);
        self.settle(4);
    }

    /// Clicks an entry of a menu; the window handles the click in its next frame.
    pub fn choose_first(&mut self, [menu, entry]: &[&str; 2]) {
        self.harness.get_by_label(menu).click();
        self.harness.run_steps(4);
        self.harness.get_by_label_contains(entry).click();
    }

    /// Picks an entry of the combo box with this name.
    pub fn pick(&mut self, list: &str, entry: &str) {
        self.harness.get_by_role_and_label(Role::ComboBox, list).click();
        self.harness.run_steps(4);
        self.harness.get_all_by_label(entry).last().unwrap().click();
        self.settle(3);
    }

    /// Replaces the value of a number field.
    pub fn fill(&mut self, number: &str, text: &str) {
        self.harness.get_by_role_and_label(Role::SpinButton, number).click();
        self.harness.run_steps(3);
        self.harness.key_press_modifiers(Modifiers::COMMAND, Key::A);
        self.harness.event(Event::Text(text.into()));
        self.harness.key_press(Key::Enter);
        self.harness.run_steps(3);
    }

    /// Types a path into the open dialog and presses Enter.
    pub fn name(&mut self, path: &Path) {
        self.harness.get_all_by_role(Role::TextInput).last().unwrap().focus();
        self.harness.run_steps(2);
        self.harness.key_press_modifiers(Modifiers::COMMAND, Key::A);
        self.harness.event(Event::Text(path.display().to_string()));
        self.harness.run_steps(2);
        self.harness.key_press(Key::Enter);
        self.harness.run_steps(4);
    }

    /// The folder of the graph.
    pub fn folder(&self) -> &Path {
        self.path.parent().unwrap()
    }

    /// The picture of the viewer in use.
    pub fn shown(&self) -> Vec<[u8; 3]> {
        let viewer = self.app().viewers().next().unwrap();
        viewer.picture().unwrap().colors.clone()
    }

    /// The text of the graph's own file.
    pub fn text(&self) -> &str {
        let document = &self.app().session.document;
        document.text(document.path())
    }

    /// The share of the image's pixels that a picture of the window shows at their positions. The image must be fitted
    /// into its pane, and not be reduced.
    pub fn share_in(&self, window: &[u8]) -> f64 {
        /// Texture filtering may blend in a little of the neighbours.
        const BLENDED: u8 = 32;
        let picture = self.app().viewer_in_use().unwrap().picture().unwrap();
        let pane = self.harness.get_by_label_contains("image of ").rect();
        let [width, height] = picture.size;
        let size = vec2(width as f32, height as f32);
        let scale = (pane.size() / size).min_elem();
        assert!(scale >= 1.0, "a reduced image averages pixels");
        let corner = pane.center() - 0.5 * scale * size;
        let is_there = |(index, color): (usize, &[u8; 3])| {
            let middle = corner + scale * vec2((index % width) as f32 + 0.5, (index / width) as f32 + 0.5);
            let start = 4 * (middle.y as usize * WINDOW[0] as usize + middle.x as usize);
            window[start..start + 3].iter().zip(color).all(|(seen, meant)| seen.abs_diff(*meant) <= BLENDED)
        };
        let there = picture.colors.iter().enumerate().filter(|pixel| is_there(*pixel)).count();
        there as f64 / picture.colors.len() as f64
    }

    /// Draws the window and writes the picture beside the test programs, for review. Returns its bytes.
    pub fn shot(&mut self, name: &str) -> Vec<u8> {
        let image = self.harness.render().unwrap();
        image.save(Path::new(env!("CARGO_TARGET_TMPDIR")).join(format!("{name}.png"))).unwrap();
        image.into_raw()
    }
}

/// The program `epigraph`. It is built if it is missing or older than its sources.
pub fn command() -> Command {
    static PROGRAM: LazyLock<PathBuf> = LazyLock::new(|| {
        let programs = std::env::current_exe().unwrap().parent().unwrap().parent().unwrap().to_owned();
        let program = programs.join(format!("epigraph{}", std::env::consts::EXE_SUFFIX));
        let built = fs::metadata(&program).and_then(|data| data.modified());
        let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
        let sources = ["cli", "core", "graphs", "pictures", "run", "scenes/src", "shaders", "stages"];
        let newest = sources.into_iter().map(|folder| newest(&root.join(folder))).max().unwrap();
        if built.ok().is_none_or(|built| built < newest) {
            let cargo = Command::new(env!("CARGO"))
                .args(["build", "--release", "--workspace", "--bin", "epigraph"])
                .status();
            assert!(cargo.unwrap().success());
        }
        program
    });
    Command::new(&*PROGRAM)
}

/// The time of the last change to a file in a folder.
fn newest(folder: &Path) -> SystemTime {
    let entries = fs::read_dir(folder).unwrap().map(|entry| entry.unwrap());
    let times = entries.map(|entry| match entry.metadata().unwrap() {
        data if data.is_dir() => newest(&entry.path()),
        data => data.modified().unwrap(),
    });
    times.max().unwrap_or(SystemTime::UNIX_EPOCH)
}

/// Splits a command line into words, as a shell does.
pub fn words(line: &str) -> Vec<String> {
    let script = format!("printf '%s\\n' {line}");
    let output = Command::new("sh").args(["-c", &script]).output().unwrap();
    String::from_utf8(output.stdout).unwrap().lines().map(Into::into).collect()
}

/// Copies the shipped graphs to a temporary folder. Returns it and the path of one of them.
pub fn copy(graph: &str) -> (tempfile::TempDir, PathBuf) {
    let folder = tempfile::tempdir().unwrap();
    copy_folder(&Path::new(env!("CARGO_MANIFEST_DIR")).join("../graphs"), folder.path());
    let path = folder.path().join(graph);
    (folder, path)
}

fn copy_folder(from: &Path, to: &Path) {
    for entry in fs::read_dir(from).unwrap() {
        let (path, to) = (entry.as_ref().unwrap().path(), to.join(entry.as_ref().unwrap().file_name()));
        if path.is_dir() {
            fs::create_dir(&to).unwrap();
            copy_folder(&path, &to);
        } else {
            fs::copy(&path, &to).unwrap();
        }
    }
}
