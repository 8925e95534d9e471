//! Every shipped graph compiles at every placement, and every shader fits its stage, without a GPU.

use epigraph_core::{Facts, Settings, Side, check_shader, compile, compose_shader};
use epigraph_stages::{facts::CAMERA_MOVES, registry};
use epigraph_tests::{GRAPHS, graph};

#[test]
fn shipped_graphs_compile_and_their_shaders_fit() {
    let registry = registry();
    for name in GRAPHS {
        for side in [Side::Cpu, Side::Gpu] {
            for camera_moves in [false, true] {
                let facts = Facts::default().stating(CAMERA_MOVES, camera_moves);
                let settings = Settings { side, facts, ..Settings::new([320, 200], 1000) };
                let (graph, _) =
                    compile(&graph(name), &registry, &settings).unwrap_or_else(|p| panic!("{p}"));
                for node in &graph.nodes {
                    let declaration = node.declaration();
                    let Some(shader) = &declaration.shader else { continue };
                    let reflected = compose_shader(shader, &registry.library, declaration.needs)
                        .unwrap_or_else(|error| panic!("{error}"));
                    let wrong = check_shader(&reflected, &shader.name, declaration, &node.stage.specs());
                    assert!(wrong.is_empty(), "{}: {wrong:?}", node.kind);
                }
            }
        }
    }
}

#[test]
fn an_all_gpu_frame_is_one_submission_but_for_the_tracer() {
    let facts = Facts::default().stating(CAMERA_MOVES, true);
    let settings = Settings { side: Side::Gpu, facts, ..Settings::new([320, 200], 1000) };
    let (_, plan) =
        compile(&graph("render-cache.ron"), &registry(), &settings).unwrap_or_else(|p| panic!("{p}"));
    let transfers: Vec<String> = plan
        .steps
        .iter()
        .filter(|step| !matches!(step, epigraph_core::Step::Run(_) | epigraph_core::Step::Tap { .. }))
        .map(|step| plan.step_name(step))
        .collect();
    // Rays are traced on the CPU: requests come down, samples go up (once for each of their two readers' first).
    assert_eq!(transfers, ["upload trace.samples", "download request.requests"]);
}
