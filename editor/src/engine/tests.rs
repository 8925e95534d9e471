use std::{
    fs,
    path::Path,
    time::{Duration, Instant},
};

use epigraph_core::{CpuContext, Extent, Io, Out, Registry, Stage, texel};
use epigraph_scenes::streams::{self, Points, encode};
use glam::Vec3;

use super::*;
use crate::document::{
    Document,
    tests::{Random, random_edit, shipped},
};

/// Time limit for each wait.
const PATIENCE: Duration = Duration::from_secs(60);

fn graph(name: &str) -> Arc<GraphFile> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../graphs").join(name);
    Arc::new(GraphFile::load(&path).unwrap())
}

fn options() -> Options {
    Options {
        size: [48, 32],
        samples: 0.25,
        backend: Backend::Cpu,
        pacing: Pace::Exact,
        paused: true,
        ..Options::default()
    }
}

/// Writes a point set, and returns its path.
fn points_in(folder: &Path) -> String {
    let points = (0..2000).map(|i| Vec3::new((i % 50) as f32, (i / 50) as f32, (i % 7) as f32));
    let points = Points::from(points.collect::<Vec<_>>());
    let path = folder.join("points.vts");
    fs::write(&path, encode(&points, &streams::Settings::default()).unwrap().to_bytes()).unwrap();
    path.display().to_string()
}

fn wait(engine: &Engine, what: &str, done: impl Fn(&State) -> bool) -> Arc<State> {
    let start = Instant::now();
    loop {
        let state = engine.state();
        if done(&state) {
            return state;
        }
        assert!(start.elapsed() < PATIENCE, "waiting for {what}: {state:?}");
        thread::sleep(Duration::from_millis(2));
    }
}

/// Sends commands and waits until all are carried out and this many frames have run.
fn send(engine: &Engine, commands: impl IntoIterator<Item = Command>, frames: u32) -> Arc<State> {
    let mut count = engine.state().commands;
    for command in commands {
        engine.send(command);
        count += 1;
    }
    wait(engine, "frames", |state| state.commands == count && state.frames == frames)
}

/// Number of pixels that show a point of the cloud.
fn covered(state: &State) -> usize {
    let ids = state.fields("view.id").next().unwrap().get::<u32>();
    ids.iter().filter(|id| **id != u32::MAX).count()
}

fn image(state: &State) -> Vec<u8> {
    state.fields("image").next().unwrap().bytes.clone()
}

fn changed(file: &Arc<GraphFile>, edit: impl FnOnce(&mut GraphFile)) -> Command {
    let mut file = GraphFile::clone(file);
    edit(&mut file);
    Command::Graph(Arc::new(file))
}

#[test]
fn frames_advance_by_themselves_and_wake_the_window() {
    let (woken, wakes) = mpsc::channel();
    let options = Options { paused: false, pacing: Pace::Async, ..options() };
    let engine = Engine::start(options, epigraph::registry(), move || assert!(woken.send(()).is_ok()));
    engine.send(Command::Graph(graph("render-cache.ron")));
    let state = wait(&engine, "30 frames", |state| state.frames >= 30);
    assert!(wakes.try_iter().count() >= 2);
    let info = state.graph.as_ref().unwrap();
    assert_eq!(state.times.len(), info.steps.len());
    assert!(info.node_ms("fill", &state.times).unwrap() > 0.0);
    assert!(image(&state).iter().any(|byte| *byte != 0));
    assert!(state.rate <= MAX_RATE + 2.0, "{}", state.rate);
}

#[test]
fn single_steps_are_reproducible_and_a_pause_holds() {
    let run = || {
        let engine = Engine::start(options(), epigraph::registry(), || ());
        let watch = Command::Watch(vec!["view.id".into()]);
        let state = send(&engine, [Command::Graph(graph("render-cache.ron")), watch, Command::Step(3)], 3);
        thread::sleep(Duration::from_millis(100));
        assert_eq!(engine.state().frames, 3);
        assert_eq!(send(&engine, [Command::Step(1)], 4).frames, 4);
        image(&state)
    };
    assert_eq!(run(), run());
}

#[test]
fn all_ports_can_be_viewed_during_a_pause() {
    let ids = |state: &State| state.fields("view/cull.id").next().map(|ids| ids.bytes.clone());
    let watch = |ports: &[&str]| Command::Watch(ports.iter().map(ToString::to_string).collect());
    let engine = Engine::start(options(), epigraph::registry(), || ());
    let before = send(
        &engine,
        [Command::Graph(graph("render-cache.ron")), watch(&["view/cull.id"]), Command::Step(3)],
        3,
    );
    let engine = Engine::start(options(), epigraph::registry(), || ());
    let unwatched = send(&engine, [Command::Graph(graph("render-cache.ron")), Command::Step(3)], 3);
    assert_eq!(ids(&unwatched), None);
    let after = send(&engine, [watch(&["view/cull.id"])], 3);
    assert!(ids(&after).is_some());
    assert_eq!(ids(&after), ids(&before));
    assert_eq!(image(&after), image(&unwatched));

    // The same holds for the frame with which a pause begins, and for the last one of a path.
    let commands = engine.state().commands;
    engine.send(watch(&[]));
    engine.send(Command::Pause(false));
    wait(&engine, "some frames", |state| state.frames > 5);
    engine.send(Command::Pause(true));
    let still =
        wait(&engine, "the pause", |state| state.commands == commands + 3 && state.paused && state.owed == 0);
    assert_eq!(ids(&still), None);
    let after = send(&engine, [watch(&["view/cull.id"])], still.frames);
    assert_eq!(ids(&after).unwrap().len(), 48 * 32 * 4);
    send(&engine, [watch(&[])], still.frames);
    play(&engine, Way::Named("orbit:5".into()), 5);
    assert!(ids(&send(&engine, [watch(&["view/cull.id"])], 5)).is_some());
    // Watched ports stay watched.
    assert!(ids(&send(&engine, [Command::Step(1)], 6)).is_some());
}

#[test]
fn compiling_again_changes_no_picture() {
    // With a GPU, priorities reach the CPU only in a later frame.
    for (name, backend) in
        [("epi.ron", Backend::Cpu), ("epi.ron", Backend::Gpu), ("hybrid.ron", Backend::Gpu)]
    {
        let run = |anew: bool| {
            let engine = Engine::start(Options { backend, ..options() }, epigraph::registry(), || ());
            send(&engine, [Command::Graph(graph(name)), Command::Step(3)], 3);
            for frame in 4..8 {
                let again = anew.then(|| Command::Shaders(Arc::default()));
                send(&engine, again.into_iter().chain([Command::Step(1)]), frame);
            }
            image(&engine.state())
        };
        assert_eq!(run(true), run(false), "{name} {backend:?}");
    }
}

fn beside(file: Arc<GraphFile>) -> Command {
    Command::Other(Some(Other { file, shaders: Arc::default(), watched: vec!["view.id".into()] }))
}

/// The image of the graph beside.
fn other_image(state: &State) -> &[u8] {
    let other = state.other.as_ref().unwrap();
    assert_eq!(other.trouble, None);
    &other.snapshots.iter().find(|snapshot| snapshot.name == "image").unwrap().bytes
}

#[test]
fn another_graph_runs_beside_with_the_same_views() {
    let file = graph("render-cache.ron");
    let engine = Engine::start(options(), epigraph::registry(), || ());
    let state = send(&engine, [Command::Graph(file.clone()), beside(file.clone()), Command::Step(4)], 4);
    assert_eq!(other_image(&state), image(&state));
    let other = state.other.as_ref().unwrap();
    assert!(other.snapshots.iter().any(|snapshot| snapshot.name == "view.id"));
    assert!(other.frame_ms > 0.0 && other.path == file.path);

    // A change to one graph does not affect the other; settings and camera paths apply to both.
    let brighter = changed(&file, |file| file.set_param("tonemap", "exposure", "2.0").unwrap());
    let state = send(&engine, [brighter, Command::Step(1)], 5);
    assert_ne!(other_image(&state), image(&state));
    let state = send(&engine, [Command::Graph(file.clone()), Command::Step(1)], 6);
    assert_eq!(other_image(&state), image(&state));
    let state = send(&engine, [Command::Size([40, 24]), Command::Samples(0.5), Command::Step(2)], 8);
    assert_eq!((other_image(&state).len(), other_image(&state)), (40 * 24 * 4, &image(&state)[..]));
    play(&engine, Way::Named("orbit:3".into()), 5);
    let state = engine.state();
    assert_eq!(other_image(&state), image(&state));
    let state = send(&engine, [Command::Scene("chains".into()), Command::Step(2)], 2);
    assert_eq!(other_image(&state), image(&state));

    let state = send(&engine, [Command::Other(None), Command::Step(1)], 3);
    assert!(state.other.is_none());
}

#[test]
fn a_graph_beside_that_fails_is_reported_and_the_main_graph_keeps_running() {
    let registry = || Registry::default().with::<Unruly>();
    let text = r#"Graph(version: 1, nodes: { "a": (kind: "unruly", params: (panic: false)) }, outputs: { "image": "a.out" })"#;
    let calm = Arc::new(GraphFile::parse("unruly.ron", text).unwrap());
    let with = |edit: fn(&mut GraphFile)| {
        let mut file = GraphFile::clone(&calm);
        edit(&mut file);
        Arc::new(file)
    };
    let trouble = |state: &State| state.other.as_ref().unwrap().trouble.clone().unwrap_or_default();
    let engine = Engine::start(options(), registry(), || ());
    let panics = with(|file| file.set_param("a", "panic", "true").unwrap());
    let state = send(&engine, [Command::Graph(calm.clone()), beside(panics), Command::Step(2)], 2);
    assert!(trouble(&state).contains("deliberate"), "{}", trouble(&state));
    let unknown = with(|file| file.set_kind("a", "unrulier").unwrap());
    let state = send(&engine, [beside(unknown), Command::Step(1)], 3);
    assert!(trouble(&state).contains("unrulier"), "{}", trouble(&state));
    let state = send(&engine, [beside(calm.clone()), Command::Step(1)], 4);
    assert_eq!((trouble(&state), &state.trouble), (String::new(), &None));
    assert_eq!(other_image(&state), image(&state));
}

#[test]
fn a_changed_parameter_keeps_the_cloud_and_a_reset_discards_it() {
    let engine = Engine::start(options(), epigraph::registry(), || ());
    let file = graph("render-cache.ron");
    let watch = Command::Watch(vec!["view.id".into(), "no.such".into()]);
    let before = send(&engine, [Command::Graph(file.clone()), watch, Command::Step(20)], 20);
    let brighter = changed(&file, |file| file.set_param("tonemap", "exposure", "2.0").unwrap());
    let after = send(&engine, [brighter, Command::Step(1)], 21);
    assert!(covered(&before) > 48 * 32 / 2, "{}", covered(&before));
    assert!(covered(&after) as f32 > 0.95 * covered(&before) as f32, "{}", covered(&after));
    let sum = |state: &State| image(state).iter().map(|byte| u64::from(*byte)).sum::<u64>();
    assert!(sum(&after) > sum(&before) + sum(&before) / 10);
    let reset = send(&engine, [Command::Reset, Command::Step(1)], 1);
    assert!(covered(&reset) < covered(&before) / 2);
}

#[test]
fn a_broken_graph_keeps_the_last_good_one_and_its_settings_can_change() {
    let engine = Engine::start(options(), epigraph::registry(), || ());
    let file = graph("render-cache.ron");
    send(&engine, [Command::Graph(file.clone()), Command::Step(5)], 5);
    let broken = changed(&file, |file| file.set_kind("fill", "fil").unwrap());
    let state = send(&engine, [broken, Command::Step(1)], 6);
    assert!(state.problems[0].error.to_string().contains("`fill`"), "{:?}", state.problems);
    assert_eq!(state.problems[0].place.as_ref().unwrap().file, file.path);
    assert_eq!(state.trouble, None);
    let state = send(&engine, [Command::Size([24, 16]), Command::Step(1)], 7);
    assert_eq!((image(&state).len(), state.problems.len()), (24 * 16 * 4, 1));
    let state = send(&engine, [Command::Graph(file), Command::Step(1)], 8);
    assert_eq!(state.problems, []);
}

#[test]
fn random_edits_never_stop_the_engine_or_lose_its_graph() {
    let folder = tempfile::tempdir().unwrap();
    let mut ran = 0;
    for (seed, path) in shipped(folder.path()).iter().enumerate() {
        let mut document = Document::open(path).unwrap();
        let engine = Engine::start(options(), epigraph::registry(), || {});
        if path.ends_with("streams.ron") {
            engine.send(Command::Scene(points_in(folder.path())));
        }
        engine.send(Command::Graph(document.file().unwrap().clone()));
        engine.send(Command::Step(1));
        wait(&engine, "the first frame", |state| state.frames == 1);
        let mut random = Random(77_777 + seed as u32);
        for _ in 0..40 {
            random_edit(&mut document, &mut random);
            let before = engine.state();
            let Some(file) = document.file().filter(|_| document.problems().is_empty()) else { continue };
            engine.send(Command::Graph(file.clone()));
            engine.send(Command::Step(1));
            // Each frame runs, or the engine reports why not.
            let state = wait(&engine, "a frame or a reason", |state| {
                state.commands == before.commands + 2
                    && (state.frames > before.frames || state.trouble.is_some())
            });
            assert!(engine.is_alive() && state.graph.is_some() && state.phase == Phase::Ready);
            ran += usize::from(state.frames > before.frames);
        }
        // After undoing everything the original graph runs.
        while document.can_undo() {
            document.undo();
        }
        let before = engine.state();
        engine.send(Command::Graph(document.file().unwrap().clone()));
        engine.send(Command::Step(1));
        let state = wait(&engine, "the original graph", |state| {
            state.commands == before.commands + 2 && state.frames > before.frames
        });
        assert_eq!((&state.problems[..], &state.trouble), (&[][..], &None));
    }
    assert!(ran > 60, "{ran} edited graphs ran");
}

/// The path of an embedded shader, and a text that overrides it.
fn shader(path: &str, text: String) -> (PathBuf, Arc<str>) {
    (Path::new(epigraph_shaders::FOLDER).join(path), text.into())
}

fn shaders(texts: impl IntoIterator<Item = (PathBuf, Arc<str>)>) -> Command {
    Command::Shaders(Arc::new(texts.into_iter().collect()))
}

#[test]
fn edited_shaders_of_stages_run_and_broken_ones_leave_the_last_good_one_running() {
    let cull = epigraph_shaders::text("depth_cull.wgsl");
    let edited = |from: &str, to: &str| {
        assert!(cull.contains(from));
        shader("depth_cull.wgsl", cull.replace(from, to))
    };
    // The picture of the fourth frame, each time from a reset.
    let options = Options { backend: Backend::Gpu, ..options() };
    let engine = Engine::start(options, epigraph::registry(), || ());
    send(&engine, [Command::Graph(graph("render-cache.ron"))], 0);
    let fourth = |texts| image(&send(&engine, [shaders(texts), Command::Reset, Command::Step(4)], 4));
    let built = fourth(vec![]);
    assert_eq!(fourth(vec![shader("depth_cull.wgsl", cull.to_owned())]), built);
    let bare = fourth(vec![edited("if is_hidden {", "if true {")]);
    assert_ne!(bare, built, "all points are culled");

    // An error is reported at its line, and the previous shader keeps running.
    let faulty = edited("fn cull(", "fn culls(u: v32, ");
    let line = 1 + cull.lines().position(|line| line.contains("fn cull(")).unwrap();
    let state = send(&engine, [shaders([faulty.clone()]), Command::Step(1)], 5);
    let problem = &state.problems[0];
    let place = problem.place.as_ref().unwrap();
    assert_eq!((place.file.as_str(), place.line), (faulty.0.to_str().unwrap(), line), "{problem}");
    assert!(problem.node.as_deref() == Some("view/cull") && problem.error.to_string().contains("v32"));
    assert_eq!((fourth(vec![faulty]), engine.state().problems.len()), (bare, 1));

    // The same holds for a module. If nothing has run yet, the embedded shaders run.
    let pixel = epigraph_shaders::text("shared/pixel.wgsl");
    let broken = shader("shared/pixel.wgsl", format!("{pixel}\nfn broken() -> u33 {{ return 0u; }}\n"));
    let state = send(&engine, [shaders([broken.clone()]), Command::Step(1)], 5);
    let place = state.problems[0].place.as_ref().unwrap();
    assert_eq!((place.file.as_str(), place.line), (broken.0.to_str().unwrap(), pixel.lines().count() + 2));
    assert_eq!(state.problems.len(), 1, "{:?}", state.problems);
    let options = Options { backend: Backend::Gpu, ..self::options() };
    let engine = Engine::start(options, epigraph::registry(), || ());
    let commands = [shaders([broken]), Command::Graph(graph("render-cache.ron")), Command::Step(4)];
    let state = send(&engine, commands, 4);
    assert_eq!((image(&state), state.problems.len()), (built, 1));
}

/// Panics in every frame if its parameter says so.
struct Unruly {
    out: Out<texel::R32Float>,
}

epigraph_core::params! {
    /// Parameters of [`Unruly`].
    pub struct UnrulyParams {
        /// Whether it panics.
        panic: bool = false;
    }
}

impl Stage for Unruly {
    const KIND: &'static str = "unruly";
    const DOC: &'static str = "Panics.";
    type Params = UnrulyParams;
    fn declare(_: &UnrulyParams, io: &mut Io) -> Self {
        Self { out: io.write("out", "Ones.", Extent::Frame(1)) }
    }
    fn cpu(&self, params: &UnrulyParams, cx: &CpuContext) -> Result<(), String> {
        assert!(!params.panic, "deliberate");
        cx.write(self.out).fill(1.0);
        Ok(())
    }
}

#[test]
fn the_previous_graph_replaces_one_that_panics() {
    let registry = || Registry::default().with::<Unruly>();
    let text = r#"Graph(version: 1, nodes: { "a": (kind: "unruly", params: (panic: false)) }, outputs: { "image": "a.out" })"#;
    let calm = Arc::new(GraphFile::parse("unruly.ron", text).unwrap());
    let unruly = changed(&calm, |file| file.set_param("a", "panic", "true").unwrap());

    let engine = Engine::start(options(), registry(), || ());
    send(&engine, [Command::Graph(calm.clone()), Command::Step(2)], 2);
    engine.send(unruly.clone());
    engine.send(Command::Step(3));
    // The first of the three steps panics.
    let state = wait(&engine, "the previous graph", |state| state.frames >= 4);
    assert!(state.trouble.as_ref().unwrap().contains("deliberate"), "{:?}", state.trouble);
    assert!(engine.is_alive());

    let engine = Engine::start(options(), registry(), || ());
    engine.send(unruly);
    engine.send(Command::Step(1));
    let state = wait(&engine, "trouble", |state| state.trouble.is_some());
    assert_eq!(state.frames, 0);
    let state = send(&engine, [Command::Graph(calm), Command::Step(1)], 1);
    assert_eq!(state.trouble, None);
}

#[test]
fn a_scene_that_does_not_exist_is_reported() {
    let engine = Engine::start(Options { scene: "cornel".into(), ..options() }, epigraph::registry(), || ());
    let state = wait(&engine, "the failure", |state| state.phase != Phase::Loading);
    assert!(matches!(&state.phase, Phase::Failed(why) if why.contains("cornell")), "{:?}", state.phase);
}

/// The image of each recorded frame, and whether the recording was finished.
#[derive(Default)]
struct Kept {
    frames: Vec<(u32, Vec<u8>)>,
    finished: bool,
}

impl Sink for Kept {
    fn take(&mut self, index: u32, snapshots: &[Arc<Snapshot>]) -> Result<(), String> {
        let image = snapshots.iter().find(|snapshot| snapshot.name == "image").unwrap();
        self.frames.push((index, image.bytes.clone()));
        Ok(())
    }

    fn finish(&mut self) -> Result<String, String> {
        self.finished = true;
        Ok(format!("{} frames", self.frames.len()))
    }
}

/// Plays a path. Returns the index and the image of each frame.
fn play(engine: &Engine, way: Way, frames: u32) -> Vec<(u32, Vec<u8>)> {
    let kept = Arc::new(Mutex::new(Kept::default()));
    let playback = Playback { way, frames: Some(frames), sink: Some(kept.clone()) };
    let commands = engine.state().commands;
    engine.send(Command::Play(playback));
    let state = wait(engine, "the path", |state| {
        state.commands > commands && state.playing.as_ref().is_some_and(|playing| !playing.is_under_way())
    });
    assert_eq!(state.recorded, Some(Ok(format!("{frames} frames"))));
    assert!(state.paused && kept.lock().unwrap().finished);
    std::mem::take(&mut kept.lock().unwrap().frames)
}

#[test]
fn a_path_plays_the_same_frames_each_time() {
    let scene = epigraph_scenes::Scene::load("cornell").unwrap();
    let orbit = Way::Named("orbit:3".into()).path(&scene).unwrap();
    let keys: Vec<(f32, Camera)> = (0..9u8).map(|k| (f32::from(k) / 30.0, orbit.camera(k.into()))).collect();
    let way = Way::Keys(epigraph_scenes::keyframes(&keys).into());

    // It does not matter what ran before, nor that the pace is otherwise asynchronous.
    let engine = Engine::start(
        Options { pacing: Pace::Async, paused: false, ..options() },
        epigraph::registry(),
        || (),
    );
    engine.send(Command::Graph(graph("render-cache.ron")));
    wait(&engine, "some frames", |state| state.frames > 5);
    let first = play(&engine, way.clone(), 9);
    assert_eq!(first.iter().map(|(index, _)| *index).collect::<Vec<_>>(), (0..9).collect::<Vec<_>>());
    assert_eq!(engine.state().camera, Some(way.path(&scene).unwrap().camera(8)));
    assert_ne!(first[7].1, first[8].1);
    assert_eq!(first, play(&engine, way.clone(), 9));

    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("keys.ron");
    fs::write(&file, epigraph_scenes::keyframes(&keys)).unwrap();
    assert_eq!(first, play(&engine, Way::Named(format!("fly:{}", file.display())), 9));
}

#[test]
fn a_path_can_be_left_and_a_wrong_one_is_reported() {
    let engine = Engine::start(options(), epigraph::registry(), || ());
    let kept = Arc::new(Mutex::new(Kept::default()));
    let sink: Arc<Mutex<dyn Sink>> = kept.clone();
    let endless = Playback { way: Way::Named("shake".into()), frames: None, sink: Some(sink) };
    engine.send(Command::Graph(graph("render-cache.ron")));
    engine.send(Command::Play(endless));
    let state = wait(&engine, "two frames", |state| state.frames >= 2);
    assert_eq!(state.playing.as_ref().unwrap().frames, Playback::ENDLESS);
    engine.send(Command::Stop);
    let state = wait(&engine, "the pause", |state| state.paused);
    assert!(state.frames < Playback::ENDLESS && state.recorded.is_none());
    wait(&engine, "the sink to be dropped", |_| Arc::strong_count(&kept) == 1);
    assert!(!kept.lock().unwrap().finished);

    // Frames continue from where the path was left.
    let view = engine.state().camera;
    engine.send(Command::Step(1));
    let next = wait(&engine, "a frame", |after| after.frames == state.frames + 1);
    assert_eq!((next.camera, &next.playing), (view, &None));

    engine.send(Command::Play(Playback { way: Way::Named("orbitt".into()), frames: None, sink: None }));
    let state = wait(&engine, "the error", |state| state.trouble.is_some());
    assert!(state.trouble.as_ref().unwrap().contains("did you mean `orbit`"));
    assert!(state.paused && state.playing.is_none());
}

#[test]
fn another_scene_replaces_one_that_failed_or_ran() {
    let engine = Engine::start(Options { scene: "cornel".into(), ..options() }, epigraph::registry(), || ());
    wait(&engine, "the failure", |state| matches!(state.phase, Phase::Failed(_)));
    engine.send(Command::Graph(graph("render-cache.ron")));
    engine.send(Command::Scene("cornell".into()));
    engine.send(Command::Step(4));
    let cornell = wait(&engine, "cornell", |state| state.frames == 4);
    assert_eq!((&cornell.scene[..], &cornell.phase), ("cornell", &Phase::Ready));
    engine.send(Command::Scene("chains".into()));
    engine.send(Command::Step(4));
    let chains = wait(&engine, "chains", |state| state.scene == "chains" && state.frames == 4);
    assert_ne!(chains.home, cornell.home);
    assert_ne!(image(&chains), image(&cornell));
    engine.send(Command::Scene("no-such".into()));
    let state = wait(&engine, "the error", |state| state.trouble.is_some());
    assert_eq!((&state.scene[..], &state.phase), ("chains", &Phase::Ready));
    assert!(engine.is_alive());
}

/// The stage [`Stuck`] waits while a test holds this lock.
static GATE: Mutex<()> = Mutex::new(());

/// Waits for [`GATE`] in each frame.
struct Stuck {
    out: Out<texel::R32Float>,
}

epigraph_core::params! {
    /// Parameters of [`Stuck`]: none.
    pub struct StuckParams {}
}

impl Stage for Stuck {
    const KIND: &'static str = "stuck";
    const DOC: &'static str = "Waits.";
    type Params = StuckParams;
    fn declare(_: &StuckParams, io: &mut Io) -> Self {
        Self { out: io.write("out", "Ones.", Extent::Frame(1)) }
    }
    fn cpu(&self, _: &StuckParams, cx: &CpuContext) -> Result<(), String> {
        let _open = GATE.lock().map_err(|error| error.to_string())?;
        cx.write(self.out).fill(1.0);
        Ok(())
    }
}

#[test]
fn the_window_never_waits_for_a_slow_frame() {
    let registry = || Registry::default().with::<Stuck>();
    let text = r#"Graph(version: 1, nodes: { "a": (kind: "stuck") }, outputs: { "image": "a.out" })"#;
    let graph = Arc::new(GraphFile::parse("stuck.ron", text).unwrap());
    let closed = GATE.lock().unwrap();
    let engine = Engine::start(options(), registry(), || ());
    engine.send(Command::Graph(graph.clone()));
    let ready = wait(&engine, "the graph", |state| state.graph.is_some());
    engine.send(Command::Step(1));
    // The frame cannot end while this thread holds the lock. If any of these calls waited for it, the test would hang.
    for pass in 0..1000 {
        engine.send(Command::Samples(0.1));
        engine.send(Command::Watch(vec![format!("a.out{pass}")]));
        let state = engine.state();
        assert_eq!((state.frames, engine.is_alive()), (0, true));
    }
    drop(closed);
    wait(&engine, "all commands", |state| state.frames == 1 && state.commands == ready.commands + 2001);
}

/// Colours, one of which is not a number from frame 3 on.
struct Spoiled {
    out: Out<texel::Rgba32Float>,
}

impl Stage for Spoiled {
    const KIND: &'static str = "spoiled";
    const DOC: &'static str = "Ones, and a NaN.";
    type Params = StuckParams;
    fn declare(_: &StuckParams, io: &mut Io) -> Self {
        Self { out: io.write("out", "Ones.", Extent::Frame(1)) }
    }
    fn cpu(&self, _: &StuckParams, cx: &CpuContext) -> Result<(), String> {
        let mut out = cx.write(self.out);
        out.fill([1.0; 4]);
        if cx.frame().index >= 3 {
            out[48 * 5 + 7][1] = f32::NAN;
        }
        Ok(())
    }
}

#[test]
fn guarded_frames_pause_after_the_first_bad_number() {
    let registry = Registry::default().with::<Spoiled>();
    let text = r#"Graph(version: 1, nodes: { "a": (kind: "spoiled") }, outputs: { "image": "a.out" })"#;
    let graph = Arc::new(GraphFile::parse("spoiled.ron", text).unwrap());
    let engine = Engine::start(options(), registry, || ());
    // Not guarded, nothing is said about it.
    let state = send(&engine, [Command::Graph(graph), Command::Step(5)], 5);
    assert_eq!((&state.bad, &state.trouble), (&None, &None));
    let state = send(&engine, [Command::Reset, Command::Guard(true), Command::Step(3)], 3);
    assert_eq!(state.bad, None);
    let commands = state.commands;
    engine.send(Command::Pause(false));
    let has_run = |state: &State| state.commands > commands && state.bad.is_some();
    let state = wait(&engine, "the bad number", has_run);
    let bad = state.bad.as_ref().unwrap();
    assert_eq!((&*bad.port, bad.pixel, bad.frame, &*bad.number), ("a.out", Some([7, 5]), 3, "g"));
    // The frame is there, and no other one runs.
    assert!(state.paused && state.frames == 4);
    let colors: Vec<[f32; 4]> = state.fields("image").next().unwrap().get();
    assert!(colors[48 * 5 + 7][1].is_nan());
    thread::sleep(Duration::from_millis(50));
    assert_eq!(engine.state().frames, 4);
    let state = send(&engine, [Command::Guard(false), Command::Step(1)], 5);
    assert_eq!((&state.bad, state.paused), (&None, true));
}
