use std::path;

use epigraph_stages::World;

use crate::engine::Backend;

use super::*;

/// A worker on a graph, all of it on the GPU.
fn worker() -> Worker {
    let options = Options {
        size: [48, 32],
        samples: 0.25,
        backend: Backend::Gpu,
        pacing: Pace::Exact,
        paused: true,
        ..Options::default()
    };
    let read = ReadShaders::default();
    let registry = Arc::new(epigraph::registry().with_edited(edited(&read)));
    let mut worker = Worker::new(options, registry, read, load("cornell").unwrap());
    worker.obey(Command::Graph(graph()), &|_| ());
    worker.build();
    worker
}

fn graph() -> Arc<GraphFile> {
    let path = path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../graphs/render-cache.ron");
    Arc::new(GraphFile::load(&path).unwrap())
}

#[test]
fn a_scene_that_comes_before_its_graph_is_the_one_that_is_traced() {
    let traced = |worker: &Worker| worker.host.get::<World>().unwrap().tracer.scene().name.clone();
    let mut worker = worker();
    (worker.file, worker.good, worker.running) = (None, None, None);
    worker.obey(Command::Scene("chains".into()), &|_| ());
    worker.build();
    worker.obey(Command::Graph(graph()), &|_| ());
    worker.build();
    worker.frame();
    assert_eq!((traced(&worker), worker.state.frames), ("chains".into(), 1));

    // So is one that comes while the graph is broken.
    let broken = r#"Graph(version: 1, nodes: { "a": (kind: "nonsense") }, outputs: { "image": "a.out" })"#;
    worker.obey(Command::Graph(Arc::new(GraphFile::parse("broken.ron", broken).unwrap())), &|_| ());
    worker.good = None;
    worker.obey(Command::Scene("cornell".into()), &|_| ());
    worker.build();
    assert!(!worker.state.problems.is_empty());
    worker.obey(Command::Graph(graph()), &|_| ());
    worker.build();
    worker.frame();
    assert_eq!((traced(&worker), worker.state.frames), ("cornell".into(), 1));
}

#[test]
fn a_lost_device_is_reported_and_another_takes_its_place() {
    let mut worker = worker();
    worker.frame();
    worker.frame();
    assert_eq!((worker.state.frames, &worker.state.trouble), (2, &None));
    worker.gpu.as_ref().unwrap().lose();
    worker.frame();
    let trouble = worker.state.trouble.clone().unwrap();
    assert!(trouble.starts_with("the GPU was lost: ") && trouble.ends_with("; restarted"), "{trouble}");
    assert!(worker.rebuild != Rebuild::No);
    worker.build();
    worker.frame();
    assert_eq!(worker.state.frames, 1);
    assert_eq!(worker.state.trouble, Some(trouble), "the message stays");
    assert!(worker.state.snapshots.iter().any(|snapshot| snapshot.bytes.iter().any(|byte| *byte != 0)));
    // The next change clears the message.
    worker.obey(Command::Reset, &|_| ());
    worker.build();
    assert_eq!(worker.state.trouble, None);
}

#[test]
fn a_device_that_is_lost_again_at_once_stops_the_graph_until_something_changes() {
    let mut worker = worker();
    worker.frame();
    for _ in 0..2 {
        worker.gpu.as_ref().unwrap().lose();
        worker.frame();
        if worker.rebuild != Rebuild::No {
            worker.build();
        }
    }
    assert!(worker.state.trouble.as_ref().unwrap().starts_with("stopped"), "{:?}", worker.state.trouble);
    worker.options.paused = false;
    assert!(!worker.has_work());
    worker.obey(Command::Backend(Backend::Cpu), &|_| ());
    worker.build();
    worker.frame();
    assert_eq!(worker.state.frames, 1);
}
