//! A headless Chromium, driven by the Chrome DevTools protocol over pipes: real events, screenshots, and all errors of
//! a page.

use std::{
    env,
    fs::{self, File},
    io::{BufRead, BufReader, Write},
    path::{Path, PathBuf},
    process::{Child, Command, Stdio},
    sync::mpsc::{Receiver, channel},
    thread,
    time::Duration,
};

use base64::{Engine, engine::general_purpose::STANDARD};
use image::RgbImage;
use serde_json::{Value, json};

use crate::support::Place;

/// Names of the program.
const NAMES: [&str; 4] = ["chromium", "chromium-browser", "google-chrome", "google-chrome-stable"];

/// How long an answer may take, on a busy machine.
const PATIENCE: Duration = Duration::from_secs(120);

/// A page in a browser.
pub struct Browser {
    process: Child,
    requests: File,
    answers: Receiver<Value>,
    /// The page's session, once there is one.
    session: Option<String>,
    last: u64,
    /// Errors of the page, and requests that leave this machine.
    pub problems: Vec<String>,
    /// Its profile, pipes and messages.
    folder: Place,
}

/// The browser of this machine.
fn program() -> PathBuf {
    if let Some(path) = env::var_os("EPIGRAPH_BROWSER") {
        return path.into();
    }
    let folders = env::var_os("PATH").unwrap_or_default();
    let all = env::split_paths(&folders).flat_map(|folder| NAMES.map(|name| folder.join(name)));
    all.into_iter().find(|path| path.is_file()).unwrap_or_else(|| {
        panic!(
            "this test drives a page in Chromium, and there is none: install it (Debian: apt-get install chromium), or \
             name it in EPIGRAPH_BROWSER"
        )
    })
}

impl Browser {
    /// Opens a file in a window of this size.
    pub fn open(page: &Path, size: [u32; 2]) -> Self {
        let place = Place::new();
        let made = place.shell("mkfifo requests answers");
        assert_eq!(made.code, Some(0), "{}", made.stderr);
        let mut bash = Command::new("bash");
        // Chromium's sandbox refuses root. Colours as they are, whatever the screen.
        let line = "exec \"$BROWSER\" --headless=new --no-sandbox --disable-gpu --force-color-profile=srgb \
                    --hide-scrollbars --user-data-dir=\"$PWD/profile\" --remote-debugging-pipe about:blank \
                    3< requests 4> answers 2> messages";
        bash.args(["-c", line]).env("BROWSER", program()).current_dir(place.path("."));
        let process = bash.stdin(Stdio::null()).stdout(Stdio::null()).spawn().expect("bash starts");
        // Both wait until the browser opens its ends.
        let requests = File::options().write(true).open(place.path("requests")).expect("it was made");
        let answers = File::open(place.path("answers")).expect("it was made");
        let (to, from) = channel();
        thread::spawn(move || {
            for message in BufReader::new(answers).split(0) {
                let Ok(message) = message.map(|bytes| serde_json::from_slice(&bytes).expect("JSON")) else {
                    return;
                };
                if to.send(message).is_err() {
                    return;
                }
            }
        });
        let (session, problems) = (None, Vec::new());
        let mut browser =
            Self { process, requests, answers: from, session, last: 0, problems, folder: place };
        let target = browser.ask("Target.createTarget", json!({ "url": "about:blank" }));
        let page_of = json!({ "targetId": target["targetId"], "flatten": true });
        browser.session =
            browser.ask("Target.attachToTarget", page_of)["sessionId"].as_str().map(String::from);
        for domain in ["Page", "Runtime", "Log", "Network"] {
            browser.ask(&format!("{domain}.enable"), json!({}));
        }
        browser.resize(size);
        browser.ask("Page.navigate", json!({ "url": format!("file://{}", page.display()) }));
        // The page's script is at its end, and runs before this does.
        browser.eval(
            "new Promise(done => document.readyState === 'complete' ? done() : addEventListener('load', done))",
        );
        browser
    }

    /// Sets the size of the window.
    pub fn resize(&mut self, [width, height]: [u32; 2]) {
        let metrics = json!({ "width": width, "height": height, "deviceScaleFactor": 1, "mobile": false });
        self.ask("Emulation.setDeviceMetricsOverride", metrics);
    }

    /// Says whether the user prefers dark colours.
    pub fn prefer_dark(&mut self, dark: bool) {
        let value = if dark { "dark" } else { "light" };
        let features = json!([{ "name": "prefers-color-scheme", "value": value }]);
        self.ask("Emulation.setEmulatedMedia", json!({ "features": features }));
    }

    /// The value of an expression in the page, waited for if it is a promise.
    #[track_caller]
    pub fn eval(&mut self, script: &str) -> Value {
        let request = json!({ "expression": script, "returnByValue": true, "awaitPromise": true });
        let answer = self.ask("Runtime.evaluate", request);
        assert!(answer["exceptionDetails"].is_null(), "{script}\n{answer}");
        answer["result"]["value"].clone()
    }

    /// The place of an element in the window, which is scrolled to it: left, top, width, height.
    #[track_caller]
    pub fn place(&mut self, selector: &str) -> [f64; 4] {
        let script = format!(
            "(() => {{ const element = document.querySelector({selector:?}); \
             element.scrollIntoView({{ block: 'center' }}); const box = element.getBoundingClientRect(); return [box.left, box.top, box.width, box.height]; }})()"
        );
        let found = self.eval(&script);
        std::array::from_fn(|side| found[side].as_f64().expect("a number"))
    }

    /// A mouse event: `mouseMoved`, `mousePressed` or `mouseReleased`.
    pub fn mouse(&mut self, event: &str, [x, y]: [f64; 2]) {
        let button = if event == "mouseMoved" { "none" } else { "left" };
        self.ask(
            "Input.dispatchMouseEvent",
            json!({ "type": event, "x": x, "y": y, "button": button, "clickCount": 1 }),
        );
    }

    /// Clicks on the middle of an element.
    #[track_caller]
    pub fn click(&mut self, selector: &str) {
        let [left, top, width, height] = self.place(selector);
        for event in ["mouseMoved", "mousePressed", "mouseReleased"] {
            self.mouse(event, [left + width / 2.0, top + height / 2.0]);
        }
    }

    /// Presses (`keyDown`) or releases (`keyUp`) the space bar.
    pub fn space(&mut self, event: &str) {
        self.ask(
            "Input.dispatchKeyEvent",
            json!({ "type": event, "key": " ", "code": "Space", "text": " " }),
        );
    }

    /// Chooses what a select or a slider offers, as a user does.
    #[track_caller]
    pub fn choose(&mut self, id: &str, value: &str) {
        self.eval(&format!(
            "(() => {{ const field = document.getElementById({id:?}); field.value = {value:?}; \
             if (field.value !== {value:?}) throw new Error('no such choice: {value}'); \
             for (const event of ['input', 'change']) field.dispatchEvent(new Event(event, {{ bubbles: true }})); }})()"
        ));
    }

    /// What the window shows.
    pub fn screenshot(&mut self) -> RgbImage {
        self.shot(json!({ "format": "png" }))
    }

    /// What an element shows.
    #[track_caller]
    pub fn picture(&mut self, selector: &str) -> RgbImage {
        // Decoding takes a moment.
        self.eval(
            "Promise.all([...document.images].filter(image => image.src).map(image => image.decode()))",
        );
        let [x, y, width, height] = self.place(selector);
        let scroll = self.eval("[scrollX, scrollY]");
        let [left, top] = [0, 1].map(|side| scroll[side].as_f64().expect("a number"));
        let clip = json!({ "x": x + left, "y": y + top, "width": width, "height": height, "scale": 1 });
        self.shot(json!({ "format": "png", "clip": clip }))
    }

    fn shot(&mut self, request: Value) -> RgbImage {
        let answer = self.ask("Page.captureScreenshot", request);
        let bytes = STANDARD.decode(answer["data"].as_str().expect("a picture")).expect("base64");
        image::load_from_memory(&bytes).expect("a picture").into_rgb8()
    }

    /// Sends a request and waits for its answer.
    #[track_caller]
    fn ask(&mut self, method: &str, params: Value) -> Value {
        self.last += 1;
        let mut request = json!({ "id": self.last, "method": method, "params": params });
        if let Some(session) = &self.session {
            request["sessionId"] = session.as_str().into();
        }
        let sent = self.requests.write_all(format!("{request}\0").as_bytes());
        sent.unwrap_or_else(|error| panic!("the browser is gone: {error}"));
        loop {
            let message = self.answers.recv_timeout(PATIENCE);
            let message = message.unwrap_or_else(|error| {
                let said = fs::read_to_string(self.folder.path("messages")).unwrap_or_default();
                panic!("the browser gives no answer to {method} ({error}); it said:\n{said}")
            });
            if message["id"] == self.last {
                assert!(message["error"].is_null(), "{method}: {}", message["error"]);
                return message["result"].clone();
            }
            self.notice(&message);
        }
    }

    fn notice(&mut self, event: &Value) {
        let params = &event["params"];
        let url = params["request"]["url"].as_str().unwrap_or_default();
        let is_problem = match event["method"].as_str() {
            Some("Runtime.exceptionThrown") => true,
            Some("Runtime.consoleAPICalled") => params["type"] == "error",
            Some("Log.entryAdded") => params["entry"]["level"] == "error",
            Some("Network.requestWillBeSent") => {
                !["file:", "data:"].iter().any(|known| url.starts_with(known))
            }
            _ => false,
        };
        if is_problem {
            self.problems.push(event.to_string());
        }
    }
}

impl Drop for Browser {
    fn drop(&mut self) {
        // It was started here, and ends with its pipes; this waits for it.
        let _ = self.process.kill();
        let _ = self.process.wait();
    }
}
