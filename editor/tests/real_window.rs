//! The editor in a real window on a virtual X server, driven by mouse and keyboard events. Needs `Xvfb` and `xdotool`,
//! which `tests/run` installs.
#![cfg(target_os = "linux")]

#[path = "../../tests/own_stage.rs"]
mod own_stage;

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

/// Time limit for each wait.
const PATIENCE: Duration = Duration::from_secs(60);

/// Time between two checks while waiting.
const BEAT: Duration = Duration::from_millis(30);

/// The beginning of the accessible name of the viewer's image; the port's name follows.
const IMAGE: &str = "image of ";

/// The accessible name of the field that searches nodes.
const SEARCH: &str = "Search nodes and kinds";

/// Only one test runs at a time, as two editors would slow each other down.
static ONE_AT_A_TIME: Mutex<()> = Mutex::new(());

/// A process that is killed at the end of the test.
struct Running(Child);

impl Drop for Running {
    fn drop(&mut self) {
        // It may have exited already.
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

struct Desk {
    /// The editor's program.
    program: PathBuf,
    /// The graph that it opens.
    graph: &'static str,
    display: String,
    editor: Running,
    _server: Running,
    folder: tempfile::TempDir,
    _turn: MutexGuard<'static, ()>,
}

/// Starts an editor on a graph, with its session and its list of widgets in `folder`.
fn start(program: &Path, graph: &str, display: &str, folder: &Path) -> Running {
    let editor = Command::new(program)
        .arg(graph)
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
    /// Opens a copy of the edge-and-point image.
    fn new() -> Self {
        let folder = tempfile::tempdir().unwrap();
        let graphs = Path::new(env!("CARGO_MANIFEST_DIR")).join("../graphs");
        fs::create_dir_all(folder.path().join("graphs/parts")).unwrap();
        for name in ["epi.ron", "parts/cloud.ron", "parts/view.ron", "parts/edges.ron"] {
            fs::copy(graphs.join(name), folder.path().join("graphs").join(name)).unwrap();
        }
        Self::open(env!("CARGO_BIN_EXE_epigraph-editor").into(), "epi", folder)
    }

    /// Opens a graph in a window of 1280x720. The editor runs in `folder`.
    fn open(program: PathBuf, graph: &'static str, folder: tempfile::TempDir) -> Self {
        let turn = ONE_AT_A_TIME.lock().unwrap_or_else(PoisonError::into_inner);
        let server = Command::new("Xvfb")
            // Without -noreset, the server starts anew when its last client leaves, a killed editor, and refuses new ones.
            .args(["-displayfd", "1", "-noreset", "-screen", "0", "1280x720x24", "-nolisten", "tcp"])
            .stdout(Stdio::piped())
            .stderr(Stdio::null())
            .spawn();
        let mut server = Running(server.expect("Xvfb is missing; tests/run installs it"));
        let mut number = String::new();
        BufReader::new(server.0.stdout.take().unwrap()).read_line(&mut number).unwrap();
        let display = format!(":{}", number.trim());
        let editor = start(&program, graph, &display, folder.path());
        let desk = Self { program, graph, display, editor, _server: server, folder, _turn: turn };
        desk.focus();
        desk
    }

    /// Waits for the window, gives it the keyboard focus, and waits for its first picture.
    fn focus(&self) {
        let window = self.xdotool(&["search", "--sync", "--onlyvisible", "--name", "Epigraph"]);
        // There is no window manager that would give it the focus.
        self.xdotool(&["windowfocus", "--sync", window.lines().next().unwrap()]);
        self.find("Image", IMAGE);
    }

    /// Kills the editor and starts it again.
    fn crash(&mut self) {
        self.editor.0.kill().unwrap();
        self.editor.0.wait().unwrap();
        fs::remove_file(self.folder.path().join("widgets.ron")).unwrap();
        self.editor = start(&self.program, self.graph, &self.display, self.folder.path());
        self.focus();
    }

    fn xdotool(&self, arguments: &[&str]) -> String {
        let output = Command::new("xdotool").args(arguments).env("DISPLAY", &self.display).output();
        let output = output.expect("xdotool is missing; tests/run installs it");
        assert!(output.status.success(), "{arguments:?}: {}", String::from_utf8_lossy(&output.stderr));
        String::from_utf8(output.stdout).unwrap()
    }

    /// The widgets in the window; empty while the list is being written.
    fn widgets(&self) -> Vec<Widget> {
        let text = fs::read_to_string(self.folder.path().join("widgets.ron")).unwrap_or_default();
        ron::from_str(&text).unwrap_or_default()
    }

    /// Waits until `found` returns a value for the widgets.
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

    /// The widget with this role and name, once it has stopped moving. For images, the name may be just its beginning.
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
                // Widgets on top of others come last.
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
        let start = Instant::now();
        // On a busy machine, the window may handle the first keys before the click that focuses the field.
        while self.find("TextInput", SEARCH).value != name {
            assert!(start.elapsed() < PATIENCE, "{name} cannot be typed");
            self.click("TextInput", SEARCH);
            self.xdotool(&["key", "ctrl+a"]);
            self.xdotool(&["type", "--delay", "30", name]);
            thread::sleep(10 * BEAT);
        }
        self.click("Button", name);
        // The parameters pane shows the node.
        let is_title = |widget: &&Widget| widget.role == "Label" && widget.value == name;
        self.until("title of the parameters", |widgets| widgets.iter().find(is_title).cloned());
    }

    /// Shows a port that the selected node writes.
    fn view(&self, node: &str, port: &str) {
        self.click("Button", &format!("View {port}"));
        self.find("Image", &format!("{IMAGE}{node}.{port}"));
    }

    /// The camera, as the session file stores it.
    fn camera(&self) -> Option<String> {
        let session = self.folder.path().join("config/epigraph-editor/session.ron");
        let text = fs::read_to_string(session).ok()?;
        let seen = text.split("seen:").nth(1)?.split("size:").next()?;
        seen.contains("eye:").then(|| seen.to_owned())
    }

    /// Waits until the camera differs from `from` and no longer moves. Returns it.
    fn rested(&self, from: Option<&String>) -> String {
        let mut before = self.moved(from);
        loop {
            // Sessions are saved every second.
            thread::sleep(Duration::from_millis(1500));
            let now = self.moved(from);
            if now == before {
                return now;
            }
            before = now;
        }
    }

    /// Waits until the camera differs from `from`. Returns it.
    fn moved(&self, from: Option<&String>) -> String {
        self.until("other place of the camera", |_| self.camera().filter(|camera| Some(camera) != from))
    }

    /// The path of the edge-and-point image.
    fn graph(&self) -> PathBuf {
        self.folder.path().join("graphs/epi.ron")
    }

    /// Saves repeatedly until `holds` is true for the file's text and the text no longer changes. Returns the text.
    fn save(&self, what: &str, holds: impl Fn(&str) -> bool) -> String {
        let start = Instant::now();
        let mut before = None;
        loop {
            self.xdotool(&["key", "ctrl+s"]);
            thread::sleep(10 * BEAT);
            let text = fs::read_to_string(self.graph()).unwrap();
            if holds(&text) && before.as_ref() == Some(&text) {
                return text;
            }
            assert!(start.elapsed() < PATIENCE, "{what}:\n{text}");
            before = Some(text);
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

    // View an intermediate port, and the picture again.
    desk.select("view/project");
    desk.view("view/project", "depth");
    desk.select("tonemap");
    desk.view("tonemap", "image");

    // Increase the exposure: the only change that stays.
    desk.drag("Slider", "exposure", [5.0, 0.0]);
    let changed = desk.save("the exposure", |text| text.contains("exposure"));

    // Swap a node's stage, and undo it.
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
fn unsaved_changes_survive_killing_the_editor() {
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

#[test]
fn unsaved_changes_do_not_replace_what_another_program_saved_after_a_kill() {
    let mut desk = Desk::new();
    let opened = fs::read_to_string(desk.graph()).unwrap();
    desk.select("tonemap");
    desk.drag("Slider", "exposure", [5.0, 0.0]);
    let config = desk.folder.path().join("config");
    desk.until("file that keeps the unsaved text", |_| holds_unsaved(&config, "exposure").then_some(()));
    let theirs = format!("{opened}// theirs\n");
    fs::write(desk.graph(), &theirs).unwrap();
    desk.crash();
    desk.click("Button", "Show differences");
    let shows = |widgets: &[Widget]| widgets.iter().any(|widget| widget.value.contains("- // theirs"));
    desk.until("line that only the file has", |widgets| shows(widgets).then_some(()));
    assert_eq!(fs::read_to_string(desk.graph()).unwrap(), theirs);
    desk.click("Button", "Restore");
    let saved = desk.save("the unsaved exposure", |text| text.contains("exposure"));
    assert!(!saved.contains("theirs"), "{saved}");
}

/// Returns true if the folder, or one within it, has a recovery file that contains `text`. Other files do not count:
/// the session file also contains "exposure", and a file that is being written has another name.
fn holds_unsaved(path: &Path, text: &str) -> bool {
    if let Ok(entries) = fs::read_dir(path) {
        return entries.flatten().any(|entry| holds_unsaved(&entry.path(), text));
    }
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    let is_kept = name.starts_with("unsaved-") && name.ends_with(".ron");
    is_kept && fs::read_to_string(path).is_ok_and(|found| found.contains(text))
}

#[test]
fn the_editor_of_a_package_of_ones_own_runs_its_stage() {
    let package = own_stage::package();
    let program = own_stage::build(&package, "editor", &["--features", "editor"]);
    let folder = tempfile::tempdir().unwrap();
    fs::copy(package.join("median.ron"), folder.path().join("median.ron")).unwrap();
    let desk = Desk::open(program, "median.ron", folder);

    // The list of nodes shows the time of the last frame in the node's row.
    let is_milliseconds = |widget: &Widget| {
        let ms = widget.value.strip_suffix(" ms").and_then(|ms| ms.parse::<f32>().ok());
        widget.role == "Label" && ms.is_some_and(|ms| ms > 0.0)
    };
    desk.until("time of the node", |widgets| {
        let row = widgets.iter().find(|widget| widget.role == "Button" && widget.name == "median")?;
        let [_, top, _, bottom] = row.rect;
        let is_in_row = |widget: &&Widget| (top..bottom).contains(&middle(widget)[1]);
        widgets.iter().filter(is_in_row).find(|widget| is_milliseconds(widget)).cloned()
    });
    desk.click("Button", "Canvas");
    desk.find("Button", "node median");
}
