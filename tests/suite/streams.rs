//! Point sets of vertex transformation streams, from the file to the picture.

use std::sync::Arc;

use epigraph::{Place, Setup};
use epigraph_core::{Capture, Facts, Finding, GraphFile, Settings, Side};
use epigraph_pictures::{Difference, Look, Picture, show};
use epigraph_scenes::{
    Scene,
    streams::{Codec, Points, encode},
};
use epigraph_stages::shared::streams::block_words;
use epigraph_tests::{Run, graph, tap};
use glam::Vec3;

const SIZE: [u32; 2] = [128, 96];

/// A dense scan of a bumpy ball on a plate, with colours and normals.
fn scan() -> Points {
    let mut points = Points { colors: Some(Vec::new()), normals: Some(Vec::new()), ..Points::default() };
    let mut add = |at: Vec3, normal: Vec3, color: [u8; 3]| {
        points.positions.push(at);
        points.colors.iter_mut().for_each(|colors| colors.push([color[0], color[1], color[2], 255]));
        points.normals.iter_mut().for_each(|normals| normals.push(normal));
    };
    // Directions of a Fibonacci lattice are spread evenly.
    const BALL: usize = 120_000;
    for i in 0..BALL {
        let y = 1.0 - (2.0 * i as f32 + 1.0) / BALL as f32;
        let angle = i as f32 * 2.399_963_2;
        let around = (1.0 - y * y).sqrt();
        let direction = Vec3::new(around * angle.cos(), y, around * angle.sin());
        let radius = 1.0 + 0.08 * (9.0 * direction.x).sin() * (7.0 * direction.z).cos();
        add(radius * direction, direction, direction.to_array().map(|c| (140.0 + 100.0 * c) as u8));
    }
    for i in 0..250 * 250 {
        let [x, z] = [i % 250, i / 250].map(|part| part as f32 / 62.5 - 2.0);
        add(Vec3::new(x, -1.1, z), Vec3::Y, [200, 190, 170]);
    }
    points
}

fn scene(codec: Codec, levels: u32) -> Arc<Scene> {
    let settings = epigraph_scenes::streams::Settings { codec, levels, ..Default::default() };
    Arc::new(Scene::of_points("scan", Arc::new(encode(&scan(), &settings).unwrap().into())))
}

fn settings(side: Side) -> Settings {
    Settings { side, ..Settings::new(SIZE, 1, Facts::none()) }
}

/// The shipped graph with room for whole scans in small images, and other parameters.
fn streams(more: &[(&str, &str, &str)]) -> GraphFile {
    let mut file = graph("streams.ron");
    let room = [("cut", "points_per_pixel", "32.0"), ("decode", "points_per_pixel", "32.0")];
    for (node, param, value) in room.iter().chain(more) {
        file.set_param(node, param, value).unwrap();
    }
    file
}

fn picture(file: &GraphFile, scene: &Arc<Scene>, camera: &str, settings: Settings, frames: u32) -> Vec<u8> {
    let mut run = Run::in_scene(file, scene, camera, settings);
    run.frames(frames);
    run.captured("image").bytes
}

#[test]
fn every_codec_shows_the_picture_of_the_points_by_themselves() {
    let finest = ("cut", "cell", "0.05");
    for levels in [1, 4] {
        let plain = scene(Codec::Packed, levels);
        for side in [Side::Cpu, Side::Gpu] {
            let expected = picture(&streams(&[finest]), &plain, "still", settings(side), 1);
            let lit = expected.chunks(4).filter(|texel| texel[..3] != [0; 3]).count();
            assert!(lit > expected.len() / 4 / 8, "{lit} pixels show points");
            for codec in [Codec::Brick, Codec::Streams, Codec::Best] {
                let scene = scene(codec, levels);
                for expand in ["Prefix", "Product"] {
                    let file = streams(&[finest, ("decode", "expand", expand)]);
                    let found = picture(&file, &scene, "still", settings(side), 1);
                    assert!(found == expected, "{codec:?}, {levels} levels, {expand} on {side}");
                }
            }
        }
    }
}

#[test]
fn poison_pooling_and_pruning_change_nothing() {
    let scene = scene(Codec::Best, 5);
    for side in [Side::Cpu, Side::Gpu] {
        for (camera, frames) in [("still", 3), ("orbit:8", 6)] {
            let plain = picture(&streams(&[]), &scene, camera, settings(side), frames);
            let poisoned = Settings { poison: true, ..settings(side) };
            let unpooled = Settings { pooling: false, ..settings(side) };
            let unpruned = Settings { prune: false, ..settings(side) };
            for (what, settings) in [("poison", poisoned), ("no pooling", unpooled), ("unpruned", unpruned)] {
                assert!(
                    picture(&streams(&[]), &scene, camera, settings, frames) == plain,
                    "{what} on {side}, {camera}"
                );
            }
        }
    }
}

/// The picture of a frame as numbers from 0 to 1.
fn shown(run: &mut Run) -> Picture {
    let image = run.captured("image");
    Picture::of_port(&image, &show(&image, &Look::default()))
}

/// Along a flight to the ball, the cut stays close to all points in full detail, and little is uploaded after the first
/// frames. With a cache of half of the set and small uploads, too.
#[test]
fn a_flight_shows_what_all_points_would_show() {
    let scene = scene(Codec::Best, 6);
    let words: usize = scene.points.as_ref().unwrap().nodes().map(block_words).sum();
    for (what, more) in [
        ("free", &[("cut", "cell", "0.5")][..]),
        ("narrow", &[("cut", "cell", "0.5"), ("cut", "cache", "2"), ("cut", "upload", "64")]),
    ] {
        let taps = ["cut.numbers"].map(tap).to_vec();
        let settings = Settings { taps, ..settings(Side::Cpu) };
        let mut cut = Run::in_scene(&streams(more), &scene, "fly", settings.clone());
        let mut all = Run::in_scene(&streams(&[("cut", "cell", "0.05")]), &scene, "fly", settings);
        let mut uploaded = Vec::new();
        for frame in 0..60 {
            cut.frame(true);
            all.frame(true);
            let numbers = cut.captured("cut.numbers").get::<u32>();
            uploaded.push(numbers[7]);
            if frame < 12 {
                continue;
            }
            let [reference, picture] = [&mut all, &mut cut].map(shown);
            let flip = Difference::new(&reference, &picture).flip();
            assert!(flip < 0.02, "{what}, frame {frame}: FLIP {flip}");
        }
        let all_bytes = 4 * words as u32;
        let later: u32 = uploaded[12..].iter().sum();
        println!("{what}: {uploaded:?} of {all_bytes}");
        assert!(later < 2 * all_bytes, "{later} of {all_bytes} bytes");
    }
}

/// A point of the first pool, one of the second, and one by itself.
#[test]
fn the_inspector_says_which_vertex_and_which_translation_made_a_point() {
    let scene = scene(Codec::Streams, 1);
    let ports =
        ["cut.words", "cut.nodes", "cut.pools", "cut.starts", "cut.numbers", "decode.cloud", "decode.sums"];
    let settings = Settings { taps: ports.map(tap).to_vec(), ..settings(Side::Cpu) };
    let mut run = Run::in_scene(&streams(&[]), &scene, "still", settings);
    let frame = run.next_frame();
    run.frame(true);
    let snapshots =
        run.executor.snapshots().expect("on the CPU").into_iter().cloned().map(Into::into).collect();
    let capture = Capture { frame, snapshots };
    let graph = run.graph();
    let (id, decode) = graph.nodes.iter_enumerated().find(|(_, node)| node.name == "decode").unwrap();
    let root = scene.points.as_ref().unwrap().node(0);
    let [first, second] = [0, 1].map(|pool| &root.pools()[pool]);
    for (slot, pool) in [(5, 0), (first.points() + 7, 1), (root.covered() + 3, 2)] {
        let findings = decode.stage.explain(&capture.site(graph, id, [0, 0], Some(slot))).unwrap();
        let mut expected = vec![
            Finding::value("node", "0, level 0, place 0"),
            Finding::value("cell", format!("{:?}", root.cells()[slot])),
        ];
        if let Some(of) = root.pools().get(pool) {
            let (vertex, translation) = of.pairs().nth([5, 7][pool]).unwrap();
            let [at, by] =
                [format!("{:?}", of.vertices()[vertex]), format!("{:?}", of.translations()[translation])];
            expected.extend([
                Finding::value("pool", pool.to_string()),
                Finding::value("vertex", format!("{vertex} at {at}")),
                Finding::value("translation", format!("{translation} by {by}")),
            ]);
        }
        assert_eq!(findings[..expected.len()], expected, "slot {slot}");
        let why = format!("{:?}", findings[expected.len()]);
        assert!(why.contains(if pool < 2 { "and its tags make" } else { "stored by itself" }), "{why}");
    }
    assert!(second.points() > 7);
}

#[test]
fn a_scene_without_points_is_refused_with_the_way_out() {
    let place = Place::load("cornell", "still").unwrap();
    let mut run = Setup::new(graph("streams.ron")).at(&place).size(SIZE).start().unwrap();
    let error = run.frame().unwrap_err().to_string();
    assert!(error.contains("epigraph encode cornell --out points.vts"), "{error}");
}

#[test]
fn rays_to_points_without_surfaces_are_refused() {
    let place = Place::new(scene(Codec::Packed, 1), "still").unwrap();
    let mut run = Setup::new(graph("render-cache.ron")).at(&place).size(SIZE).start().unwrap();
    let error = run.frame().unwrap_err().to_string();
    assert!(error.contains("show it with the graph `streams`"), "{error}");
}

#[test]
fn an_image_too_small_for_the_coarsest_node_says_so() {
    let scene = scene(Codec::Packed, 2);
    let place = Place::new(scene, "still").unwrap();
    let mut run = Setup::new(graph("streams.ron")).at(&place).size([16, 16]).start().unwrap();
    let error = run.frame().unwrap_err().to_string();
    assert!(error.contains("room for 1024: raise points_per_pixel"), "{error}");
}

#[test]
fn a_cut_and_its_points_run_watched() {
    for side in Side::ALL {
        let settings = Settings { watch: true, ..settings(side) };
        let mut run = Run::in_scene(&streams(&[]), &scene(Codec::Packed, 3), "orbit", settings);
        run.frames(4);
    }
}
