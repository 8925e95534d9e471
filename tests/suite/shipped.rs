//! Every shipped graph compiles in every placement, and every shader fits its stage: both are tested without a GPU.

use epigraph_core::{Access, Settings, Side, check_shader, compile, compose_shader};
use epigraph_stages::registry;
use epigraph_tests::{GRAPHS, PEERS, POINT_GRAPH, facts, graph};

#[test]
fn shipped_graphs_compile_and_their_shaders_fit() {
    let registry = registry();
    for name in GRAPHS.into_iter().chain(PEERS).chain([POINT_GRAPH]) {
        for side in [Side::Cpu, Side::Gpu] {
            for camera_moves in [false, true] {
                let settings = Settings { side, ..Settings::new([320, 200], 1000, facts(camera_moves)) };
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
fn an_all_gpu_frame_is_one_submission_except_for_the_tracer() {
    let settings = Settings { side: Side::Gpu, ..Settings::new([320, 200], 1000, facts(true)) };
    let (_, plan) =
        compile(&graph("render-cache.ron"), &registry(), &settings).unwrap_or_else(|p| panic!("{p}"));
    let transfers: Vec<String> = plan
        .steps
        .iter()
        .filter(|step| !matches!(step, epigraph_core::Step::Run(_) | epigraph_core::Step::Tap { .. }))
        .map(|step| plan.step_name(step))
        .collect();
    // Rays are traced on the CPU, so requests are downloaded, and samples uploaded: once, though two stages read them.
    assert_eq!(transfers, ["upload trace.samples", "download request.requests"]);
}

#[test]
fn a_tap_is_the_port_of_its_name_whether_or_not_the_camera_moves() {
    let registry = registry();
    for name in GRAPHS {
        let file = graph(name);
        let settings = |moves| Settings::new([320, 200], 1000, facts(moves));
        let whole = Settings { prune: false, ..settings(true) };
        let (whole, _) = compile(&file, &registry, &whole).unwrap_or_else(|p| panic!("{p}"));
        let mut missing = Vec::new();
        for node in &whole.nodes {
            for port in node.declaration().ports.iter().filter(|port| port.is_output()) {
                let tap = format!("{}.{}", node.name, port.name);
                for moves in [true, false] {
                    let taps = vec![tap.parse().expect("a port's name")];
                    match compile(&file, &registry, &Settings { taps, ..settings(moves) }) {
                        Ok((graph, plan)) => {
                            assert_eq!(plan.taps[0].name, tap, "{name}");
                            // What a node updates in place may be named after the node that wrote it last.
                            if port.access == Access::Write {
                                assert_eq!(graph.name(graph.taps[0].1), tap, "{name}");
                            }
                        }
                        Err(problems) => {
                            assert!(problems.to_string().contains("does not exist now"), "{problems}");
                            missing.push((tap.clone(), moves));
                        }
                    }
                }
            }
        }
        // What `dither` needs for the predicted view only, and what `interpolate` tells of textures: there are none.
        let has = |kind: &str| usize::from(whole.nodes.iter().any(|node| node.kind == kind));
        let is_needless = |(tap, moves): &(String, bool)| {
            tap.ends_with("request.cell_tiles") && !moves || tap == "interpolate.albedo"
        };
        let count = has("dither") + 2 * has("albedo");
        assert!(missing.len() == count && missing.iter().all(is_needless), "{name}: {missing:?}");
    }
}
