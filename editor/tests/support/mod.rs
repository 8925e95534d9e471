//! A window without a screen on a graph of its own.

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
use epigraph_editor::{
    app::App,
    document::Document,
    engine::{self, Backend, Options, Pace},
    intent::Intent,
    opening::Opening,
    store::Store,
};
use renderer::Renderer;

/// No test waits longer for what must come.
pub const PATIENCE: Duration = Duration::from_secs(120);

/// Width and height of the window, points: the least that the editor is made for.
pub const WINDOW: [f32; 2] = [1280.0, 720.0];

/// A window on a shipped graph.
pub struct Opened {
    pub harness: Harness<'static, App>,
    /// The graph's file.
    pub path: PathBuf,
    /// Where that is a copy: its folder.
    _folder: Option<tempfile::TempDir>,
}

/// What pictures of the window need to be the same in every run: exact samples, no measured times, frames on demand.
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
    /// On a copy of a shipped graph, with frames of 64x48 pixels; nothing is drawn.
    pub fn new(graph: &str) -> Self {
        Self::with(graph, false, [64, 48])
    }

    /// On a copy of a shipped graph, with frames of `size` pixels; `render` gives it something to draw with.
    pub fn with(graph: &str, render: bool, size: [u32; 2]) -> Self {
        let (folder, path) = copy(graph);
        let builder = Harness::builder().with_size(WINDOW);
        let builder = if render { builder.renderer(Renderer::new()) } else { builder };
        Self::build(builder, path, Some(folder), options(size))
    }

    /// On the shipped graph itself, to be looked at: the same picture wherever the tests run.
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

    /// As the program starts, with sessions in a folder; `graph` and `scene` as they may be named.
    pub fn started(sessions: &Path, graph: Option<&Path>, scene: Option<&str>) -> Self {
        let graph = graph.map(|path| path.display().to_string());
        let store = Store::at(sessions.to_owned());
        let opening = Opening::new(Some(store), graph.as_deref(), scene, options([64, 48])).unwrap();
        let path = PathBuf::from(opening.document.path());
        let harness = Harness::builder()
            .with_size(WINDOW)
            .build_eframe(|creation| App::open(creation, opening, epigraph::registry()));
        Self { harness, path, _folder: None }
    }

    pub fn app(&self) -> &App {
        self.harness.state()
    }

    /// Asks the window for something, as a pane does; the next frame does it.
    pub fn push(&mut self, intent: Intent) {
        self.harness.state_mut().session.push(intent);
    }

    /// Shows frames of the window until something holds.
    pub fn until(&mut self, what: &str, holds: impl Fn(&App) -> bool) {
        let start = Instant::now();
        loop {
            self.harness.step();
            if holds(self.harness.state()) {
                // What the last step brought is laid out in the next.
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

    /// Shows so many frames of the window, and more until the pictures in sight are of what there is: they are drawn beside
    /// the window's thread. While the graph runs, there would always be something newer.
    pub fn settle(&mut self, steps: usize) {
        self.harness.run_steps(steps);
        let start = Instant::now();
        while self.app().is_drawing() && self.app().session.state.paused {
            assert!(start.elapsed() < PATIENCE, "waiting for pictures");
            thread::sleep(Duration::from_millis(1));
            self.harness.step();
        }
        // A picture lays out what stands beside it.
        self.harness.run_steps(2);
    }

    /// Runs so many frames of the graph.
    pub fn frames(&mut self, count: u32) {
        let until = self.app().session.state.frames + count;
        self.app().session.engine.send(engine::Command::Step(count));
        self.until("frames", move |app| app.session.state.frames >= until);
    }

    pub fn click(&mut self, label: &str) {
        self.harness.get_by_label(label).click();
        self.settle(3);
    }

    /// Chooses an entry of a menu, and sees what comes of it.
    pub fn choose(&mut self, menu: &[&str; 2]) {
        self.choose_first(menu);
        self.settle(4);
    }

    /// Points at an entry of a menu; the click is in the next frame of the window.
    pub fn choose_first(&mut self, [menu, entry]: &[&str; 2]) {
        self.harness.get_by_label(menu).click();
        self.harness.run_steps(4);
        self.harness.get_by_label_contains(entry).click();
    }

    /// Picks an entry of a list of that name.
    pub fn pick(&mut self, list: &str, entry: &str) {
        self.harness.get_by_role_and_label(Role::ComboBox, list).click();
        self.harness.run_steps(4);
        self.harness.get_all_by_label(entry).last().unwrap().click();
        self.settle(3);
    }

    /// Types a number in place of another.
    pub fn fill(&mut self, number: &str, text: &str) {
        self.harness.get_by_role_and_label(Role::SpinButton, number).click();
        self.harness.run_steps(3);
        self.harness.key_press_modifiers(Modifiers::COMMAND, Key::A);
        self.harness.event(Event::Text(text.into()));
        self.harness.key_press(Key::Enter);
        self.harness.run_steps(3);
    }

    /// Names a file in the dialog that is open, and presses Enter.
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

    /// The share of the pixels of the port in view that a picture of the window has where they belong. The image is fitted
    /// into its pane and not made smaller.
    pub fn share_in(&self, window: &[u8]) -> f64 {
        /// A driver's filter may blend in a little of the neighbours.
        const BLENDED: u8 = 32;
        let picture = self.app().viewer_in_use().unwrap().picture().unwrap();
        let pane = self.harness.get_by_label_contains("image of ").rect();
        let [width, height] = picture.size;
        let size = vec2(width as f32, height as f32);
        let scale = (pane.size() / size).min_elem();
        assert!(scale >= 1.0, "small pixels are means of several");
        let corner = pane.center() - 0.5 * scale * size;
        let is_there = |(index, color): (usize, &[u8; 3])| {
            let middle = corner + scale * vec2((index % width) as f32 + 0.5, (index / width) as f32 + 0.5);
            let start = 4 * (middle.y as usize * WINDOW[0] as usize + middle.x as usize);
            window[start..start + 3].iter().zip(color).all(|(seen, meant)| seen.abs_diff(*meant) <= BLENDED)
        };
        let there = picture.colors.iter().enumerate().filter(|pixel| is_there(*pixel)).count();
        there as f64 / picture.colors.len() as f64
    }

    /// Draws the window into a picture beside the test programs, for people to look at; its bytes.
    pub fn shot(&mut self, name: &str) -> Vec<u8> {
        let image = self.harness.render().unwrap();
        image.save(Path::new(env!("CARGO_TARGET_TMPDIR")).join(format!("{name}.png"))).unwrap();
        image.into_raw()
    }
}

/// The command line `epigraph`: as it lies beside the tests where all of the workspace is built, else built for them.
pub fn command() -> Command {
    static PROGRAM: LazyLock<PathBuf> = LazyLock::new(|| {
        let programs = std::env::current_exe().unwrap().parent().unwrap().parent().unwrap().to_owned();
        let program = programs.join(format!("epigraph{}", std::env::consts::EXE_SUFFIX));
        let built = fs::metadata(&program).and_then(|data| data.modified());
        let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
        let sources = ["cli", "core", "graphs", "pictures", "scenes/src", "shaders", "stages"];
        let newest = sources.into_iter().map(|folder| newest(&root.join(folder))).max().unwrap();
        if built.ok().is_none_or(|built| built < newest) {
            let cargo = Command::new(env!("CARGO")).args(["build", "--release", "-p", "epigraph"]).status();
            assert!(cargo.unwrap().success());
        }
        program
    });
    Command::new(&*PROGRAM)
}

/// When the newest file under a folder was changed.
fn newest(folder: &Path) -> SystemTime {
    let entries = fs::read_dir(folder).unwrap().map(|entry| entry.unwrap());
    let times = entries.map(|entry| match entry.metadata().unwrap() {
        data if data.is_dir() => newest(&entry.path()),
        data => data.modified().unwrap(),
    });
    times.max().unwrap_or(SystemTime::UNIX_EPOCH)
}

/// The words of a command line as a shell takes them.
pub fn words(line: &str) -> Vec<String> {
    let script = format!("printf '%s\\n' {line}");
    let output = Command::new("sh").args(["-c", &script]).output().unwrap();
    String::from_utf8(output.stdout).unwrap().lines().map(Into::into).collect()
}

/// A copy of the shipped graphs, and the path of one of them in it.
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
