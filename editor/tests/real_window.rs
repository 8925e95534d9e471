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

/// No step waits longer for what must come.
const PATIENCE: Duration = Duration::from_secs(60);

/// From an event to what it shows, on a machine that is busy with tracing.
const PAUSE: Duration = Duration::from_millis(1500);

/// Where the button to take over unsaved text lies.
const TAKE_OVER: (i32, i32) = (370, 54);

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

    /// Waits for the window and lets it have the keys.
    fn focus(&self) {
        let window = self.xdotool(&["search", "--sync", "--onlyvisible", "--name", "Epigraph"]);
        // Without a window manager nobody else hands out the focus.
        self.xdotool(&["windowfocus", window.lines().next().unwrap()]);
        thread::sleep(4 * PAUSE);
    }

    /// Ends the editor without a warning, and starts it again.
    fn crash(&mut self) {
        self.editor.0.kill().unwrap();
        self.editor.0.wait().unwrap();
        self.editor = start(&self.display, self.folder.path());
        self.focus();
    }

    fn xdotool(&self, arguments: &[&str]) -> String {
        let output = Command::new("xdotool").args(arguments).env("DISPLAY", &self.display).output();
        let output = output.expect("xdotool is missing; tests/run installs it");
        assert!(output.status.success(), "{arguments:?}: {}", String::from_utf8_lossy(&output.stderr));
        thread::sleep(Duration::from_millis(60));
        String::from_utf8(output.stdout).unwrap()
    }

    fn go(&self, x: i32, y: i32) {
        self.xdotool(&["mousemove", &x.to_string(), &y.to_string()]);
    }

    fn click(&self, x: i32, y: i32) {
        self.go(x, y);
        self.xdotool(&["click", "1"]);
        thread::sleep(PAUSE);
    }

    fn drag(&self, (x, y): (i32, i32), to: (i32, i32)) {
        self.go(x, y);
        self.xdotool(&["mousedown", "1"]);
        for step in 1..=8 {
            self.go(x + (to.0 - x) * step / 8, y + (to.1 - y) * step / 8);
        }
        thread::sleep(PAUSE);
        self.xdotool(&["mouseup", "1"]);
        thread::sleep(PAUSE);
    }

    fn key(&self, key: &str) {
        self.xdotool(&["key", key]);
        thread::sleep(PAUSE);
    }

    /// Finds a node by its name and selects it.
    fn select(&self, name: &str) {
        self.click(150, 77);
        self.key("ctrl+a");
        self.xdotool(&["type", "--delay", "30", name]);
        thread::sleep(PAUSE);
        self.click(60, 105);
    }

    fn graph(&self) -> PathBuf {
        self.folder.path().join("graphs/epi.ron")
    }

    /// Saves until the file is as it should be.
    fn save(&self, what: &str, holds: impl Fn(&str) -> bool) -> String {
        let start = Instant::now();
        loop {
            self.key("ctrl+s");
            let text = fs::read_to_string(self.graph()).unwrap();
            if holds(&text) {
                return text;
            }
            assert!(start.elapsed() < PATIENCE, "{what}:\n{text}");
        }
    }
}

#[test]
fn fly_view_swap_change_undo_and_save() {
    let mut desk = Desk::new();
    let opened = fs::read_to_string(desk.graph()).unwrap();

    // Orbit and fly.
    desk.drag((640, 380), (700, 400));
    desk.xdotool(&["keydown", "w"]);
    thread::sleep(PAUSE);
    desk.xdotool(&["keyup", "w"]);

    // See an intermediate port, and the picture again.
    desk.select("view/project");
    desk.click(60, 159);
    desk.select("tonemap");
    desk.click(60, 132);

    // Brighter: the only characters that are to stay.
    desk.drag((1059, 201), (1064, 201));
    let changed = desk.save("the exposure", |text| text.contains("exposure"));

    // Another stage in a node's place, and back.
    desk.select("interpolate");
    desk.click(1098, 160);
    desk.click(1060, 189);
    let swapped = desk.save("the swap", |text| text.contains("kind: \"fill\""));
    assert!(!swapped.contains("\"r24\": \"edges.r24\""));
    desk.key("ctrl+z");
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
    desk.drag((1059, 201), (1064, 201));
    let config = desk.folder.path().join("config");
    let start = Instant::now();
    while !holds_text(&config, "exposure") {
        assert!(start.elapsed() < PATIENCE, "the unsaved text is kept nowhere");
        thread::sleep(PAUSE);
    }
    desk.crash();
    assert_eq!(fs::read_to_string(desk.graph()).unwrap(), opened);
    // Take over.
    desk.click(TAKE_OVER.0, TAKE_OVER.1);
    desk.save("the unsaved exposure", |text| text.contains("exposure"));
}

/// Whether a file in a folder, or in a folder in it, has some text.
fn holds_text(path: &Path, text: &str) -> bool {
    if let Ok(entries) = fs::read_dir(path) {
        return entries.flatten().any(|entry| holds_text(&entry.path(), text));
    }
    fs::read_to_string(path).is_ok_and(|found| found.contains(text))
}
