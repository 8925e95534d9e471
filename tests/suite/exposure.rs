//! The exposure that fits the picture: steady in motion, at rest with the picture, the same on both sides, and nothing
//! where it is not asked for.

use epigraph_core::{GraphFile, Settings, Side, compile};
use epigraph_stages::registry;
use epigraph_tests::{Run, Stage, facts, graph, sampled, tap};

const SIZE: [u32; 2] = [128, 96];

fn auto(name: &str) -> GraphFile {
    let mut file = graph(name);
    file.set_param("tonemap", "exposure", "Auto").expect("a parameter of tonemap");
    file
}

fn start(scene: &'static str, camera: &'static str, side: Side) -> Run {
    let settings = Settings { taps: vec![tap("tonemap.white")], side, ..sampled(SIZE, 0.05) };
    Run::new(&auto("epi.ron"), Stage { scene, camera, settings })
}

/// The exposure of the next frame, in EV; `None` before there is light.
fn next(run: &mut Run) -> Option<f32> {
    run.frame(true);
    let white = run.captured("tonemap.white").get::<f32>()[0];
    (white > 0.0).then(|| -white.log2())
}

#[test]
fn it_is_steady_in_motion_and_rests_with_the_picture() {
    for scene in ["cornell", "chains", "room", "still-life"] {
        for camera in ["orbit", "still"] {
            let mut run = start(scene, camera, Side::Cpu);
            assert!(next(&mut run).is_none(), "the samples of the first frame come in the second");
            let found: Vec<f32> = (1..90).map(|_| next(&mut run).expect("light")).collect();
            let steps: Vec<f32> = found.windows(2).map(|pair| pair[1] - pair[0]).collect();
            let most = |steps: &[f32]| steps.iter().fold(0f32, |most, step| most.max(step.abs()));
            let moves: Vec<f32> = steps.iter().copied().filter(|&step| step != 0.0).collect();
            let turns = moves.windows(2).filter(|pair| pair[0] * pair[1] < 0.0).count();
            let what = format!("{scene}, {camera}: {} EV a frame, {turns} turns: {found:?}", most(&steps));
            // What a frame changes is less than 3.5%: most in `room`, when its window leaves the picture. It drifts with the
            // view; flicker would turn every few frames.
            assert!(most(&steps) < 0.05 && turns <= 4, "{what}");
            // A picture at rest still gets better samples: they move it by less than 1/256 EV a frame, or 0.3%.
            assert!(camera != "still" || most(&steps[60..]) < 1.0 / 256.0, "{what}");
        }
    }
}

#[test]
fn both_sides_show_the_same_exposure() {
    let [mut cpu, mut gpu] = Side::ALL.map(|side| start("room", "orbit", side));
    for frame in 0..12 {
        gpu.executor.inherit(&mut cpu.executor).expect("the same graph");
        match (next(&mut cpu), next(&mut gpu)) {
            (None, None) => assert_eq!(frame, 0),
            // From the same colours they find the same, bit for bit (`tonemap.rs`). A colour that is rounded to the next
            // bin moves the white by a step of a bin, 1/128 of an octave.
            (Some(cpu), Some(gpu)) => assert!((cpu - gpu).abs() < 1.0 / 64.0, "frame {frame}: {cpu}, {gpu}"),
            others => panic!("frame {frame}: {others:?}"),
        }
    }
}

#[test]
fn a_fixed_exposure_has_no_port_and_no_pass_of_auto() {
    let settings = Settings { facts: facts(false), ..sampled(SIZE, 0.05) };
    let declared = |file: &GraphFile| {
        let (graph, _) = compile(file, &registry(), &settings).expect("a shipped graph");
        let tonemap = graph.nodes.iter().find(|node| node.name == "tonemap").expect("a node").declaration();
        (tonemap.ports.len(), tonemap.passes.len())
    };
    assert_eq!([declared(&graph("epi.ron")), declared(&auto("epi.ron"))], [(2, 1), (4, 4)]);
}
