//! The program itself in a window on an X server without a screen, driven by real mouse and keyboard events.
//! Needs `Xvfb` and `xdotool`, which `tests/run` installs.
#![cfg(target_os = "linux")]

use std::{
    fs,
    io::{BufRead, BufReader},
    path::{Path, PathBuf},
    process::{Child, Command, Stdio},
    sync::{Mutex, MutexGuard, PoisonError},
    thread,
    time::{Duration, Instant},
};

use epigraph_editor::widgets::{VARIABLE, Widget};

/// No step waits longer for what must come.
const PATIENCE: Duration = Duration::from_secs(60);

/// How often what is waited for is looked at.
const BEAT: Duration = Duration::from_millis(30);

/// What the image in the viewer is called, before its port's name.
const IMAGE: &str = "image of ";

/// What the field is called in which nodes are searched.
const SEARCH: &str = "Search nodes and kinds";

/// Two editors at a time would make each other wait.
static ONE_AT_A_TIME: Mutex<()> = Mutex::new(());

/// A program that ends with the test.
struct Running(Child);

impl Drop for Running {
    fn drop(&mut self) {
        // It may have ended by itself.
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

struct Desk {
    display: String,
    editor: Running,
    _server: Running,
    folder: tempfile::TempDir,
    _turn: MutexGuard<'static, ()>,
}

/// Starts the editor, with a session of its own.
fn start(display: &str, folder: &Path) -> Running {
    let editor = Command::new(env!("CARGO_BIN_EXE_epigraph-editor"))
        .current_dir(folder)
        .env("DISPLAY", display)
        .env_remove("WAYLAND_DISPLAY")
        .env("XDG_CONFIG_HOME", folder.join("config"))
        .env(VARIABLE, folder.join("widgets.ron"))
        .stderr(Stdio::null())
        .spawn();
    Running(editor.unwrap())
}

impl Desk {
    /// A window of 1280x720 on a copy of the shipped graphs.
    fn new() -> Self {
        let turn = ONE_AT_A_TIME.lock().unwrap_or_else(PoisonError::into_inner);
        let folder = tempfile::tempdir().unwrap();
        let graphs = Path::new(env!("CARGO_MANIFEST_DIR")).join("../graphs");
        fs::create_dir_all(folder.path().join("graphs/parts")).unwrap();
        for name in ["epi.ron", "parts/cloud.ron", "parts/view.ron", "parts/edges.ron"] {
            fs::copy(graphs.join(name), folder.path().join("graphs").join(name)).unwrap();
        }
        let server = Command::new("Xvfb")
            .args(["-displayfd", "1", "-screen", "0", "1280x720x24", "-nolisten", "tcp"])
            .stdout(Stdio::piped())
            .stderr(Stdio::null())
            .spawn();
        let mut server = Running(server.expect("Xvfb is missing; tests/run installs it"));
        let mut number = String::new();
        BufReader::new(server.0.stdout.take().unwrap()).read_line(&mut number).unwrap();
        let display = format!(":{}", number.trim());
        let editor = start(&display, folder.path());
        let desk = Self { display, editor, _server: server, folder, _turn: turn };
        desk.focus();
        desk
    }

    /// Waits for the window, lets it have the keys, and waits for its first picture.
    fn focus(&self) {
        let window = self.xdotool(&["search", "--sync", "--onlyvisible", "--name", "Epigraph"]);
        // Without a window manager nobody else hands out the focus.
        self.xdotool(&["windowfocus", "--sync", window.lines().next().unwrap()]);
        self.find("Image", IMAGE);
    }

    /// Ends the editor without a warning, and starts it again.
    fn crash(&mut self) {
        self.editor.0.kill().unwrap();
        self.editor.0.wait().unwrap();
        fs::remove_file(self.folder.path().join("widgets.ron")).unwrap();
        self.editor = start(&self.display, self.folder.path());
        self.focus();
    }

    fn xdotool(&self, arguments: &[&str]) -> String {
        let output = Command::new("xdotool").args(arguments).env("DISPLAY", &self.display).output();
        let output = output.expect("xdotool is missing; tests/run installs it");
        assert!(output.status.success(), "{arguments:?}: {}", String::from_utf8_lossy(&output.stderr));
        String::from_utf8(output.stdout).unwrap()
    }

    /// The widgets in the window; none while the list is being written.
    fn widgets(&self) -> Vec<Widget> {
        let text = fs::read_to_string(self.folder.path().join("widgets.ron")).unwrap_or_default();
        ron::from_str(&text).unwrap_or_default()
    }

    /// Looks at the widgets until they have what is wanted.
    fn until<T>(&self, what: &str, found: impl Fn(&[Widget]) -> Option<T>) -> T {
        let start = Instant::now();
        loop {
            let widgets = self.widgets();
            if let Some(found) = found(&widgets) {
                return found;
            }
            assert!(start.elapsed() < PATIENCE, "there is no {what}: {widgets:#?}");
            thread::sleep(BEAT);
        }
    }

    /// The widget of that role and name, once it has stopped moving; of images, the beginning of the name is enough.
    fn find(&self, role: &str, name: &str) -> Widget {
        let mut before = None;
        let what = format!("{role} {name}");
        loop {
            let found = self.until(&what, |widgets| {
                let is_called = |widget: &Widget| match role {
                    "Image" => widget.name.starts_with(name),
                    _ => widget.name == name,
                };
                let is_meant = |widget: &&Widget| widget.role == role && is_called(widget);
                // What lies over others comes last.
                widgets.iter().rev().find(is_meant).cloned()
            });
            if before.as_ref() == Some(&found.rect) {
                return found;
            }
            before = Some(found.rect);
            thread::sleep(4 * BEAT);
        }
    }

    fn go(&self, [x, y]: [f64; 2]) {
        self.xdotool(&["mousemove", &format!("{x:.0}"), &format!("{y:.0}")]);
    }

    fn click(&self, role: &str, name: &str) {
        self.go(middle(&self.find(role, name)));
        self.xdotool(&["click", "1"]);
    }

    /// Drags from the middle of a widget.
    fn drag(&self, role: &str, name: &str, by: [f64; 2]) {
        let [x, y] = middle(&self.find(role, name));
        self.go([x, y]);
        self.xdotool(&["mousedown", "1"]);
        for step in 1..=8 {
            let share = f64::from(step) / 8.0;
            self.go([x + share * by[0], y + share * by[1]]);
            thread::sleep(BEAT);
        }
        self.xdotool(&["mouseup", "1"]);
    }

    /// Finds a node by its name and selects it.
    fn select(&self, name: &str) {
        self.click("TextInput", SEARCH);
        self.xdotool(&["key", "ctrl+a"]);
        self.xdotool(&["type", "--delay", "30", name]);
        let is_search = |widget: &&Widget| widget.name == SEARCH && widget.value == name;
        self.until("search for it", |widgets| widgets.iter().find(is_search).cloned());
        self.click("Button", name);
        // The parameters are now its own.
        let is_title = |widget: &&Widget| widget.role == "Label" && widget.value == name;
        self.until("title of the parameters", |widgets| widgets.iter().find(is_title).cloned());
    }

    /// Shows a port that the selected node writes.
    fn view(&self, node: &str, port: &str) {
        self.click("Button", &format!("View {port}"));
        self.find("Image", &format!("{IMAGE}{node}.{port}"));
    }

    /// Where the camera is, as the session keeps it.
    fn camera(&self) -> Option<String> {
        let session = self.folder.path().join("config/epigraph-editor/session.ron");
        let text = fs::read_to_string(session).ok()?;
        let seen = text.split("seen:").nth(1)?.split("size:").next()?;
        seen.contains("eye:").then(|| seen.to_owned())
    }

    /// Waits until the camera has moved and rests; where it is then.
    fn rested(&self, from: Option<&String>) -> String {
        let mut before = self.moved(from);
        loop {
            // Sessions are kept every second.
            thread::sleep(Duration::from_millis(1500));
            let now = self.moved(from);
            if now == before {
                return now;
            }
            before = now;
        }
    }

    /// Waits until the camera is elsewhere; where it is then.
    fn moved(&self, from: Option<&String>) -> String {
        self.until("other place of the camera", |_| self.camera().filter(|camera| Some(camera) != from))
    }

    fn graph(&self) -> PathBuf {
        self.folder.path().join("graphs/epi.ron")
    }

    /// Saves until the file is as it should be.
    fn save(&self, what: &str, holds: impl Fn(&str) -> bool) -> String {
        let start = Instant::now();
        loop {
            self.xdotool(&["key", "ctrl+s"]);
            thread::sleep(10 * BEAT);
            let text = fs::read_to_string(self.graph()).unwrap();
            if holds(&text) {
                return text;
            }
            assert!(start.elapsed() < PATIENCE, "{what}:\n{text}");
        }
    }
}

fn middle(widget: &Widget) -> [f64; 2] {
    let [left, top, right, bottom] = widget.rect;
    [0.5 * (left + right), 0.5 * (top + bottom)]
}

#[test]
fn fly_view_swap_change_undo_and_save() {
    let mut desk = Desk::new();
    let opened = fs::read_to_string(desk.graph()).unwrap();

    // Orbit and fly.
    let home = desk.rested(None);
    desk.drag("Image", IMAGE, [60.0, 20.0]);
    let turned = desk.rested(Some(&home));
    desk.xdotool(&["keydown", "w"]);
    desk.moved(Some(&turned));
    desk.xdotool(&["keyup", "w"]);

    // See an intermediate port, and the picture again.
    desk.select("view/project");
    desk.view("view/project", "depth");
    desk.select("tonemap");
    desk.view("tonemap", "image");

    // Brighter: the only characters that are to stay.
    desk.drag("Slider", "exposure", [5.0, 0.0]);
    let changed = desk.save("the exposure", |text| text.contains("exposure"));

    // Another stage in a node's place, and back.
    desk.select("interpolate");
    desk.click("ComboBox", "stage");
    desk.click("Button", "fill");
    let swapped = desk.save("the swap", |text| text.contains("kind: \"fill\""));
    assert!(!swapped.contains("\"r24\": \"edges.r24\""));
    desk.xdotool(&["key", "ctrl+z"]);
    let saved = desk.save("undo", |text| !text.contains("kind: \"fill\""));

    assert_eq!(saved, changed);
    let lines = |text: &str| text.lines().map(str::to_owned).collect::<Vec<_>>();
    let (before, after) = (lines(&opened), lines(&saved));
    let added: Vec<&String> = after.iter().filter(|line| !before.contains(line)).collect();
    assert!(matches!(added[..], [line] if line.trim_start().starts_with("params: (exposure: ")), "{added:?}");
    let kept: Vec<&String> = after.iter().filter(|line| *line != added[0]).collect();
    assert_eq!(kept, before.iter().collect::<Vec<_>>());
    assert!(desk.editor.0.try_wait().unwrap().is_none(), "the editor still runs");
}

#[test]
fn what_was_not_saved_outlives_a_program_that_is_killed() {
    let mut desk = Desk::new();
    let opened = fs::read_to_string(desk.graph()).unwrap();
    desk.select("tonemap");
    desk.drag("Slider", "exposure", [5.0, 0.0]);
    let config = desk.folder.path().join("config");
    desk.until("file that keeps the unsaved text", |_| holds_unsaved(&config, "exposure").then_some(()));
    desk.crash();
    assert_eq!(fs::read_to_string(desk.graph()).unwrap(), opened);
    desk.click("Button", "Restore");
    desk.save("the unsaved exposure", |text| text.contains("exposure"));
}

/// Returns true if the folder, or one within it, has a file of unsaved work with some text. The session has the word too, for
/// the exposure of the view; and a file that is being written bears another name.
fn holds_unsaved(path: &Path, text: &str) -> bool {
    if let Ok(entries) = fs::read_dir(path) {
        return entries.flatten().any(|entry| holds_unsaved(&entry.path(), text));
    }
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    let is_kept = name.starts_with("unsaved-") && name.ends_with(".ron");
    is_kept && fs::read_to_string(path).is_ok_and(|found| found.contains(text))
}
