//! Both sides of every stage of the shipped graphs, with random parameters: from the same state, a frame on the GPU
//! writes into every port what one on the CPU writes. The tests of single stages make up their inputs. Here stages have
//! those that occur, with every choice of every parameter, at limits, and at the borders of images of odd sizes.

use std::path::Path;

use epigraph::Place;
use epigraph_core::{
    Element, Format, GraphFile, ParamKind, ParamSpec, Settings, Side, Snapshot,
    testing::{Random, differences},
};
use epigraph_stages::registry;
use epigraph_tests::{Run, gpu, graph, sampled};

/// Graphs that have all stages among them, the one with most stages most often.
const GRAPHS: [&str; 6] =
    ["epi.ron", "render-cache.ron", "epi.ron", "experiments/complex-pixels.ron", "epi.ron", "hybrid.ron"];

/// Scenes and camera paths.
const PLACES: [(&str, &str); 4] =
    [("cornell", "orbit"), ("chains", "fly"), ("cornell-moving", "shake"), ("cornell-moving", "still")];

/// A value of a parameter: any choice; or the default, zero, a large number, or one near the default.
fn value(spec: &ParamSpec, random: &mut Random) -> String {
    let number = |random: &mut Random| {
        let default: f64 = spec.default.parse().expect("a number");
        let (low, high) = spec.range.expect("numbers have a range");
        let number = match random.below(8) {
            0 | 1 if low == 0.0 => low,
            2 | 3 => 4.0 * default + 4.0,
            4 | 5 => default,
            _ => f64::from(random.between(0.5, 2.0)) * default,
        };
        number.clamp(low, high)
    };
    match (&*spec.name, &spec.kind) {
        // More would only take longer.
        ("spp", _) => "1".into(),
        ("capacity", _) => "5000".into(),
        // The other choice needs other wires, those of `hybrid`.
        ("compaction", _) => spec.default.clone(),
        (_, ParamKind::Choice(names)) => names[random.below(names.len() as u32) as usize].clone(),
        (_, ParamKind::Bool) => (random.below(2) == 0).to_string(),
        // Not `Auto`: one pixel's rounding before `tonemap` may move the exposure of all by 1/128 EV (`exposure.rs`).
        (_, ParamKind::F32 | ParamKind::F32OrAuto) => format!("{:?}", number(random) as f32),
        (_, ParamKind::U32 | ParamKind::I32) => format!("{:.0}", number(random)),
        (_, ParamKind::Text) => spec.default.clone(),
    }
}

/// The graph with random parameters, and these as options of the command line. A parameter's draw depends on its node, its
/// name and the seed alone, so that a new one leaves the others as they are.
pub fn with_random_parameters(name: &str, seed: u64) -> (GraphFile, String) {
    let (mut file, mut options) = (without_placements(graph(name)), String::new());
    for node in file.stages(&registry()).expect("a shipped graph") {
        for spec in node.stage.specs() {
            // Stages whose data must fit have a parameter of the same name; variances are those of means.
            let is_common = ["normals", "ids", "subpixel_bits", "accumulate", "variance", "uncertain"]
                .contains(&&*spec.name);
            let name =
                if ["variance", "uncertain"].contains(&&*spec.name) { "accumulate" } else { &*spec.name };
            let drawn = if is_common { String::new() } else { node.address.clone() } + "." + name;
            let hash =
                drawn.bytes().fold(seed, |hash, byte| (hash ^ u64::from(byte)).wrapping_mul(0x100_0000_01b3));
            let value = value(&spec, &mut Random(hash));
            if value != spec.default {
                options += &format!(" --set {}.{}={value}", node.address, spec.name);
                file = file.with_param("the test", &node.address, &spec.name, &value).expect("a valid value");
            }
        }
    }
    (file, options)
}

/// The graph with all its nodes on the side that the settings say, and every readback immediate.
pub fn without_placements(mut file: GraphFile) -> GraphFile {
    let placed = file.nodes.iter().filter(|node| node.on.is_some() || node.download.is_some());
    for name in placed.map(|node| node.name.value.clone()).collect::<Vec<_>>() {
        file.set_on(&name, None).expect("the node is there");
        file.set_download(&name, None).expect("the node is there");
    }
    file
}

/// How many elements of a port may differ.
fn allowed(port: &Snapshot) -> usize {
    match port.element {
        // A colour halfway between two codes may be rounded to either.
        Element::Texel(Format::Rgba8Unorm) => 2,
        // A software GPU rounds like the CPU. On others, a point may fall on the next pixel, and an age be one more.
        _ if gpu().is_software() => 0,
        _ => 4 + port.dims.count() / 50,
    }
}

#[test]
fn every_port_is_the_same_on_both_sides_with_random_parameters() {
    let places = PLACES.map(|(scene, camera)| Place::load(scene, camera).expect("a scene and a camera path"));
    let mut random = Random(21);
    for round in 0..42 {
        let (mut file, mut options) =
            with_random_parameters(GRAPHS[round % GRAPHS.len()], 100 + round as u64);
        let at = random.below(4) as usize;
        let [mut width, mut height] = [17, 9].map(|least| least + random.below(40));
        // The sides of others are multiples of workgroups' and cells', which most are not.
        if round % 3 == 1 {
            [width, height] = [width, height].map(|side| (side / 8).max(1) * 8);
        }
        // Now and then large enough that each workgroup has several tiles of a list, of points above all.
        if round % 20 == 19 {
            [width, height] = [203, 149];
            let points = graph(GRAPHS[round % GRAPHS.len()]).address_of("points");
            file = file.with_param("the test", &points, "points_per_pixel", "5.0").expect("a valid value");
            options += &format!(" --set {points}.points_per_pixel=5.0");
        }
        let settings =
            Settings { poison: true, ..sampled([width, height], f64::from(random.between(0.02, 0.2))) };
        let what = format!(
            "{}{options} --scene {} --camera {} --size {width}x{height}",
            GRAPHS[round % GRAPHS.len()],
            PLACES[at].0,
            PLACES[at].1
        );
        let start = |side| Run::with_all_ports(&file, &places[at], &Settings { side, ..settings.clone() });
        let (mut cpu, mut gpu) = (start(Side::Cpu), start(Side::Gpu));
        for frame in 0..5 {
            let different = frame_on_both(&mut cpu, &mut gpu);
            assert!(different.is_empty(), "{what}, frame {frame}: {}", different.join("\n"));
        }
    }
}

#[test]
fn every_port_is_the_same_with_every_node_on_a_random_side() {
    let mut random = Random(6);
    for round in 0..8 {
        let base = without_placements(graph(GRAPHS[round % 4]));
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../graphs/full.ron");
        let full = base.full(&registry(), &path).unwrap_or_else(|problems| panic!("{problems}"));
        let whole = GraphFile::parse(&path.display().to_string(), &full)
            .unwrap_or_else(|problems| panic!("{problems}"));
        let (mut mixed, mut sides) = (whole.clone(), String::new());
        for node in whole.stages(&registry()).expect("a shipped graph") {
            let on_gpu = node.stage.declaration().shader.is_some() && random.below(2) == 0;
            let side = if on_gpu { Side::Gpu } else { Side::Cpu };
            mixed.set_on(&node.address, Some(side)).expect("the node is there");
            sides += &format!(" {}: {side}", node.address);
        }
        let (scene, camera) = PLACES[round % PLACES.len()];
        let place = Place::load(scene, camera).expect("a scene and a camera path");
        let settings = Settings { poison: round % 2 == 0, ..sampled([37, 21], 0.1) };
        let [mut cpu, mut gpu] = [whole, mixed].map(|file| Run::with_all_ports(&file, &place, &settings));
        for frame in 0..5 {
            let different = frame_on_both(&mut cpu, &mut gpu);
            assert!(
                different.is_empty(),
                "{scene}, {camera}, frame {frame}:{sides}: {}",
                different.join("\n")
            );
        }
    }
}

/// Runs a frame on both sides from the CPU's state, and describes the ports that differ.
fn frame_on_both(cpu: &mut Run, gpu: &mut Run) -> Vec<String> {
    gpu.executor.inherit(&mut cpu.executor).unwrap_or_else(|error| panic!("{error}"));
    cpu.frame(true);
    gpu.frame(true);
    let [cpu, gpu] = [cpu, gpu].map(|run| run.executor.snapshots().expect("not lost"));
    assert!(cpu.len() == gpu.len() && cpu.len() > 10);
    let pairs = cpu.into_iter().zip(gpu);
    let different = pairs.filter_map(|(cpu, gpu)| {
        let Snapshot { name, field, .. } = cpu;
        assert_eq!((name, field), (&gpu.name, &gpu.field));
        // Sums of a few dozen numbers.
        let differ = differences(cpu, gpu, 1e-5);
        let too_many = differ.len() > allowed(cpu);
        too_many.then(|| format!("{name} {field}: {} differ; {}", differ.len(), differ[0]))
    });
    different.collect()
}

#[test]
fn the_comparison_can_fail() {
    let file = graph("render-cache.ron");
    let other = file.with_param("the test", "fill", "priority", "Classic").expect("a valid value");
    let place = Place::load("cornell", "orbit").expect("a scene and a camera path");
    let start = |file, side| Run::with_all_ports(file, &place, &Settings { side, ..sampled([40, 30], 0.1) });
    let (mut cpu, mut gpu) = (start(&file, Side::Cpu), start(&other, Side::Gpu));
    let different: Vec<String> = (0..3).flat_map(|_| frame_on_both(&mut cpu, &mut gpu)).collect();
    assert!(different.iter().any(|port| port.starts_with("fill.priority")), "{different:?}");
    assert!(!different.iter().any(|port| port.starts_with("view/")), "{different:?}");
}
