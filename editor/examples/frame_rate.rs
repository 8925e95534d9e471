//! Measures the frame rate of the window while the tracer uses all cores: the graph runs, samples arrive when they are
//! traced, and the window is redrawn continuously.
//!
//! `cargo run --release -p epigraph-editor --example frame_rate -- [GRAPH] [SCENE] [SECONDS] [WIDTHxHEIGHT]`, from
//! the repository's folder. It needs a display; Xvfb is one.

use std::{
    path::Path,
    process::ExitCode,
    sync::{Arc, Weak},
    time::{Duration, Instant},
};

use eframe::{Frame, NativeOptions};
use egui::{Ui, ViewportBuilder, ViewportCommand};
use epigraph_core::Snapshot;
use epigraph_editor::{app::App, document::Document, engine::Options, files::find_graph, panes::Viewer};

/// Time for the scene, the first frames and the window's first pictures.
const WARM_UP: Duration = Duration::from_secs(5);

/// The editor, redrawn continuously.
struct Measured {
    app: App,
    seconds: Duration,
    start: Instant,
    /// When counting started, and the engine's number of frames at that time.
    counting: Option<(Instant, u32)>,
    drawn: u32,
    /// The longest time between two frames of the window.
    longest: Duration,
    last: Instant,
    /// Time that the editor's own code took on the window's thread: in total, and the longest in one frame.
    busy: [Duration; 2],
    /// The picture in view, and the number of pictures so far.
    picture: Weak<Snapshot>,
    pictures: u32,
}

impl eframe::App for Measured {
    fn ui(&mut self, ui: &mut Ui, frame: &mut Frame) {
        let begin = Instant::now();
        self.app.ui(ui, frame);
        ui.ctx().request_repaint();
        let now = Instant::now();
        let busy = now - begin;
        let state = &self.app.session.state;
        match self.counting {
            None if now - self.start > WARM_UP && state.frames > 0 => {
                self.counting = Some((now, state.frames));
            }
            Some((begin, frames)) => {
                self.drawn += 1;
                self.longest = self.longest.max(now - self.last);
                self.busy = [self.busy[0] + busy, self.busy[1].max(busy)];
                let picture = self
                    .app
                    .viewers()
                    .next()
                    .and_then(Viewer::snapshot)
                    .map(Arc::downgrade)
                    .unwrap_or_default();
                if !picture.ptr_eq(&self.picture) {
                    (self.picture, self.pictures) = (picture, self.pictures + 1);
                }
                let elapsed = now - begin;
                if elapsed > self.seconds {
                    let rate = |count: u32| f64::from(count) / elapsed.as_secs_f64();
                    let ms = |time: Duration| time.as_secs_f64() * 1000.0;
                    println!(
                        "window {:.1} frames/s, longest pause {:.0} ms; of it the editor's own {:.1} ms a frame, longest \
                         {:.0} ms; pictures {:.1}/s; graph {:.1} frames/s of {} samples at {:?}",
                        rate(self.drawn),
                        ms(self.longest),
                        ms(self.busy[0]) / f64::from(self.drawn),
                        ms(self.busy[1]),
                        rate(self.pictures),
                        rate(state.frames - frames),
                        state.samples,
                        self.app.session.frame_size(),
                    );
                    ui.ctx().send_viewport_cmd(ViewportCommand::Close);
                    // The window closes a frame or two later.
                    self.seconds = Duration::MAX;
                }
            }
            None => {}
        }
        self.last = now;
    }
}

fn main() -> ExitCode {
    let mut arguments = std::env::args().skip(1);
    let graph = arguments.next().unwrap_or_else(|| "epi".into());
    let scene = arguments.next().unwrap_or_else(|| "chains".into());
    let seconds = arguments.next().and_then(|text| text.parse().ok()).unwrap_or(10);
    let size = arguments.next().and_then(|text| {
        let (width, height) = text.split_once('x')?;
        Some([width.parse().ok()?, height.parse().ok()?])
    });
    let document = match Document::open(Path::new(&find_graph(&graph))) {
        Ok(document) => document,
        Err(problems) => {
            eprintln!("error: {problems}");
            return ExitCode::FAILURE;
        }
    };
    let defaults = Options::default();
    let options = Options { scene, size: size.unwrap_or(defaults.size), ..defaults };
    let native = NativeOptions {
        viewport: ViewportBuilder::default().with_inner_size([1280.0, 720.0]),
        ..NativeOptions::default()
    };
    let now = Instant::now();
    let open = move |creation: &eframe::CreationContext| {
        let app = App::new(creation, document, options);
        let seconds = Duration::from_secs(seconds);
        let measured = Measured {
            app,
            seconds,
            start: now,
            counting: None,
            drawn: 0,
            longest: Duration::ZERO,
            last: now,
            busy: [Duration::ZERO; 2],
            picture: Weak::new(),
            pictures: 0,
        };
        Ok(Box::new(measured) as Box<_>)
    };
    match eframe::run_native("Epigraph", native, Box::new(open)) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("error: {error}");
            ExitCode::FAILURE
        }
    }
}
