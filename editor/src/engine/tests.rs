use std::{
    path::Path,
    time::{Duration, Instant},
};

use epigraph_core::{CpuContext, Extent, Io, Out, Registry, Stage, texel};

use super::*;

/// No test waits longer for what must come.
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
        pacing: Pacing::Exact,
        paused: true,
        ..Options::default()
    }
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

/// Sends commands and waits until all are obeyed and so many frames have run.
fn send(engine: &Engine, commands: impl IntoIterator<Item = Command>, frames: u32) -> Arc<State> {
    let mut count = engine.state().commands;
    for command in commands {
        engine.send(command);
        count += 1;
    }
    wait(engine, "frames", |state| state.commands == count && state.frames == frames)
}

/// Pixels in which a point of the cloud shows.
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
    let options = Options { paused: false, pacing: Pacing::Async, ..options() };
    let engine = Engine::start(options, move || assert!(woken.send(()).is_ok()));
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
fn steps_are_exact_and_a_pause_holds() {
    let run = || {
        let engine = Engine::start(options(), || ());
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
fn a_changed_parameter_keeps_the_cloud_and_a_reset_forgets_it() {
    let engine = Engine::start(options(), || ());
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
    let engine = Engine::start(options(), || ());
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

/// Panics in its first frame when it is told to.
struct Unruly {
    out: Out<texel::R32Float>,
}

epigraph_core::params! {
    /// Parameters of [`Unruly`].
    pub struct UnrulyParams {
        /// Whether to.
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
        assert!(!params.panic, "as told");
        cx.write(self.out).fill(1.0);
        Ok(())
    }
}

#[test]
fn a_stage_that_panics_gives_way_to_the_graph_before() {
    let registry = || Registry::default().with::<Unruly>();
    let text = r#"Graph(version: 1, nodes: { "a": (kind: "unruly", params: (panic: false)) }, outputs: { "image": "a.out" })"#;
    let calm = Arc::new(GraphFile::parse("unruly.ron", text).unwrap());
    let unruly = changed(&calm, |file| file.set_param("a", "panic", "true").unwrap());

    let engine = Engine::start_with(options(), registry, || ());
    send(&engine, [Command::Graph(calm.clone()), Command::Step(2)], 2);
    engine.send(unruly.clone());
    engine.send(Command::Step(3));
    // The first of the three is spent on the panic.
    let state = wait(&engine, "the graph before", |state| state.frames >= 4);
    assert!(state.trouble.as_ref().unwrap().contains("as told"), "{:?}", state.trouble);
    assert!(engine.is_alive());

    let engine = Engine::start_with(options(), registry, || ());
    engine.send(unruly);
    engine.send(Command::Step(1));
    let state = wait(&engine, "trouble", |state| state.trouble.is_some());
    assert_eq!(state.frames, 0);
    let state = send(&engine, [Command::Graph(calm), Command::Step(1)], 1);
    assert_eq!(state.trouble, None);
}

#[test]
fn a_scene_that_does_not_exist_is_reported() {
    let engine = Engine::start(Options { scene: "cornel".into(), ..options() }, || ());
    let state = wait(&engine, "the failure", |state| state.phase != Phase::Loading);
    assert!(matches!(&state.phase, Phase::Failed(why) if why.contains("cornell")), "{:?}", state.phase);
}
