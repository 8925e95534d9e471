//! Inspections of pixels, compared with values that the tests compute independently from the nodes' outputs.

use std::{
    collections::BTreeMap,
    path::Path,
    sync::Arc,
    thread,
    time::{Duration, Instant},
};

use epigraph_core::{Cell, Finding, GraphFile, Role};

use super::*;
use crate::engine::{Backend, Command, Engine, Options, Pace, State};

const SIZE: [u32; 2] = [96, 64];
const NONE: u32 = u32::MAX;
/// Time limit for each wait.
const PATIENCE: Duration = Duration::from_secs(120);

/// A paused graph with some watched ports.
struct Run {
    engine: Engine,
}

impl Run {
    fn new(graph: &str, scene: &str, backend: Backend, watched: &[&str], frames: u32) -> Self {
        let options = Options {
            scene: scene.into(),
            size: SIZE,
            samples: 0.1,
            backend,
            pacing: Pace::Exact,
            paused: true,
            guarded: false,
            seed: 3,
            measured: true,
        };
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../graphs").join(graph);
        let run = Self { engine: Engine::start(options, epigraph::registry(), || ()) };
        run.engine.send(Command::Graph(Arc::new(GraphFile::load(&path).unwrap())));
        run.engine.send(Command::Watch(watched.iter().map(|&name| name.to_owned()).collect()));
        run.engine.send(Command::Step(frames));
        run.wait("frames", |state| state.frames == frames);
        run
    }

    fn wait(&self, what: &str, done: impl Fn(&State) -> bool) -> Arc<State> {
        let start = Instant::now();
        loop {
            let state = self.engine.state();
            if done(&state) {
                return state;
            }
            let (problems, trouble) = (&state.problems, &state.trouble);
            assert!(start.elapsed() < PATIENCE, "waiting for {what}: {problems:?} {trouble:?}");
            thread::sleep(Duration::from_millis(2));
        }
    }

    /// Runs one more frame.
    fn step(&self) {
        let frames = self.engine.state().frames;
        self.engine.send(Command::Step(1));
        self.wait("a frame", |state| state.frames == frames + 1);
    }

    /// Inspects a pixel. The watched ports in the returned state are of the same frame.
    fn look(&self, pixel: [u32; 2]) -> (Arc<State>, Arc<Inspection>) {
        self.engine.send(Command::Inspect(Some(pixel)));
        let looked = |state: &State| {
            let inspection = state.inspection.as_ref();
            inspection.is_some_and(|found| found.pixel == pixel && found.frame + 1 == state.frames)
        };
        let state = self.wait("the inspection", looked);
        let inspection = state.inspection.clone().unwrap();
        (state, inspection)
    }
}

fn port(state: &State, name: &str) -> Vec<u32> {
    state.fields(name).next().unwrap_or_else(|| panic!("{name} is not watched")).get()
}

fn visit<'a>(inspection: &'a Inspection, node: &str) -> &'a Visit {
    inspection.nodes.iter().find(|visit| visit.node == node).unwrap()
}

fn findings_of<'a>(inspection: &'a Inspection, node: &str) -> &'a [Finding] {
    visit(inspection, node).findings.as_deref().unwrap_or_default()
}

fn why(inspection: &Inspection, node: &str) -> String {
    let whys = findings_of(inspection, node).iter().filter_map(|finding| match finding {
        Finding::Why(why) => Some(why.as_str()),
        _ => None,
    });
    whys.collect::<Vec<_>>().join(" ")
}

fn value_of<'a>(findings: &'a [Finding], wanted: &str) -> Option<&'a str> {
    findings.iter().find_map(|finding| match finding {
        Finding::Value { name, text } if name == wanted => Some(text.as_str()),
        _ => None,
    })
}

fn around<'a>(inspection: &'a Inspection, node: &str) -> &'a [Cell] {
    let found = findings_of(inspection, node).iter().find_map(|finding| match finding {
        Finding::Around(around) => Some(around.cells.as_slice()),
        _ => None,
    });
    found.unwrap()
}

fn pixels() -> impl Iterator<Item = [u32; 2]> {
    (0..SIZE[1]).flat_map(|y| (0..SIZE[0]).map(move |x| [x, y]))
}

fn at([x, y]: [u32; 2]) -> usize {
    (y * SIZE[0] + x) as usize
}

/// Indices of the 5x5 pixels around one, row by row; `None` outside the image.
fn five([x, y]: [u32; 2]) -> Vec<Option<usize>> {
    let inside = |along: i32, side: u32| (0..side as i32).contains(&along);
    let offsets = (-2..=2).flat_map(|dy| (-2..=2).map(move |dx| (dx, dy)));
    let pixel = |(dx, dy): (i32, i32)| {
        let (x, y) = (x as i32 + dx, y as i32 + dy);
        (inside(x, SIZE[0]) && inside(y, SIZE[1])).then(|| at([x as u32, y as u32]))
    };
    offsets.map(pixel).collect()
}

const EPI: [&str; 9] = [
    "view/project.id",
    "view/project.depth",
    "view/project.subpixel",
    "view/cull.id",
    "edges/edge_raster.mask",
    "edges/classify.cls",
    "edges/reach.r24",
    "spread.filled",
    "spread.color",
];

fn epi() -> Run {
    Run::new("epi.ron", "chains", Backend::Cpu, &EPI, 12)
}

#[test]
fn a_culled_point_is_shown_with_those_that_hide_it() {
    let run = epi();
    let (state, _) = run.look([0, 0]);
    let [before, after, depth] =
        ["view/project.id", "view/cull.id", "view/project.depth"].map(|name| port(&state, name));
    let z = |pixel: usize| f32::from_bits(depth[pixel]);
    // Points that are culled in the first vote, counted independently. The default threshold is 5%.
    let votes = |pixel: [u32; 2]| {
        let others = five(pixel).into_iter().flatten().filter(|other| *other != at(pixel));
        let voters: Vec<usize> = others.filter(|other| before[*other] != NONE).collect();
        let nearer = voters.iter().filter(|other| z(**other) * 1.05 < z(at(pixel))).count();
        (voters.len(), nearer)
    };
    let culled: Vec<[u32; 2]> =
        pixels().filter(|pixel| before[at(*pixel)] != NONE && after[at(*pixel)] == NONE).collect();
    let outvoted = |pixel: &&[u32; 2]| {
        let (voters, nearer) = votes(**pixel);
        voters > 0 && 2 * nearer >= voters
    };
    let pixel = *culled.iter().find(outvoted).expect("chains hide points");
    let (voters, nearer) = votes(pixel);
    let (same, inspection) = run.look(pixel);
    assert_eq!(same.frames, state.frames, "the captured frame holds every pixel");
    let text = why(&inspection, "view/cull");
    let expected = format!("Culled in the first vote: {nearer} of the {voters} other points");
    assert!(text.starts_with(&expected), "{expected}: {text}");
    let against = around(&inspection, "view/cull").iter().filter(|cell| cell.role == Role::Against).count();
    assert_eq!(against, nearer);
    // The sample is the culled point.
    let sample = inspection.sample.as_ref().unwrap();
    assert_eq!(value_of(sample, "point"), Some(before[at(pixel)].to_string().as_str()));
    assert_eq!(value_of(findings_of(&inspection, "view/cull"), "point"), Some("none"));
    // For a point that stays, the reason says so.
    let kept = pixels().find(|pixel| after[at(*pixel)] != NONE && votes(*pixel).0 > 0).unwrap();
    let (_, inspection) = run.look(kept);
    assert!(why(&inspection, "view/cull").starts_with("Stays: "), "{}", why(&inspection, "view/cull"));
}

#[test]
fn a_sample_is_shown_with_the_frame_of_its_arrival() {
    let run = Run::new("epi.ron", "cornell", Backend::Cpu, &["view/project.id"], 4);
    let shown = |state: &State| {
        let id = port(state, "view/project.id");
        pixels()
            .step_by(7)
            .map(|pixel| (pixel, id[at(pixel)]))
            .filter(|(_, id)| *id != NONE)
            .collect::<Vec<_>>()
    };
    let look = |pixel: [u32; 2]| {
        let (_, inspection) = run.look(pixel);
        let came = value_of(inspection.sample.as_ref().unwrap(), "came").unwrap().to_owned();
        (came, inspection)
    };
    // The first samples are requested in frame 0 and arrive in frame 1.
    let (state, _) = run.look([0, 0]);
    assert_eq!(state.fields("view/project.id").count(), 1, "a watched port is not copied twice");
    let mut dates = BTreeMap::new();
    for (pixel, point) in shown(&state) {
        let (came, inspection) = look(pixel);
        let frame = (1..4).find(|frame| {
            came == match 3 - frame {
                0 => "in this frame, 3".to_owned(),
                1 => "in frame 2, the one before".to_owned(),
                ago => format!("in frame {frame}, {ago} frames ago"),
            }
        });
        let frame: u32 = frame.unwrap_or_else(|| panic!("{came}"));
        // `integrate` shows a sample only at pixels that it has just written.
        assert_eq!(value_of(findings_of(&inspection, "cloud/integrate"), "sample").is_some(), frame == 3);
        dates.insert(point, frame);
    }
    assert!((1..4).all(|frame| dates.values().any(|date| *date == frame)), "{dates:?}");
    // A changed graph keeps the dates.
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../graphs/epi.ron");
    let mut file = GraphFile::load(&path).unwrap();
    file.set_param("tonemap", "exposure", "2.0").unwrap();
    run.engine.send(Command::Graph(Arc::new(file)));
    run.engine.send(Command::Step(5));
    run.wait("frames", |state| state.frames == 9);
    let (state, _) = run.look([0, 0]);
    let now = state.frames - 1;
    let mut old = 0;
    for (pixel, point) in shown(&state) {
        let (came, _) = look(pixel);
        // Renewed points have a later date.
        if let Some(date) = dates.get(&point) {
            old += usize::from(came == format!("in frame {date}, {} frames ago", now - date));
        }
    }
    assert!(old > dates.len() / 4, "{old} of {}", dates.len());
    // A reset graph has no earlier dates.
    run.engine.send(Command::Reset);
    run.engine.send(Command::Step(2));
    run.wait("frames", |state| state.frames == 2);
    let (state, _) = run.look([0, 0]);
    for (pixel, _) in shown(&state) {
        let (came, _) = look(pixel);
        let frames = state.frames - 1;
        assert!(came == format!("in this frame, {frames}") || came == "in frame 1, the one before", "{came}");
    }
}

#[test]
fn a_sample_is_ambiguous_if_its_cell_touches_the_edge() {
    // Samples are aimed at unambiguous positions, so only camera motion makes them ambiguous.
    let run = epi();
    let mut camera = run.engine.state().home.unwrap();
    camera.eye.x += 0.1;
    run.engine.send(Command::Camera(camera));
    run.step();
    let (state, _) = run.look([0, 0]);
    let (id, cell) = (port(&state, "view/cull.id"), port(&state, "view/project.subpixel"));
    let (mask, cls) = (port(&state, "edges/edge_raster.mask"), port(&state, "edges/classify.cls"));
    let stride = SIZE[0] as usize + 1;
    // The centres of the crossed eighths of the sides, in pixels.
    let crossed = |[x, y]: [u32; 2]| {
        let own = y as usize * stride + x as usize;
        let sides = [
            (mask[own] & 0xFF, 0.0, true),
            (mask[own] >> 8 & 0xFF, 0.0, false),
            (mask[own + 1] & 0xFF, 1.0, true),
            (mask[own + stride] >> 8 & 0xFF, 1.0, false),
        ];
        let mut places = Vec::new();
        for (bits, across, upright) in sides {
            for along in (0..8).filter(|bit| bits >> bit & 1 != 0).map(|bit| (bit as f64 + 0.5) / 8.0) {
                places.push(if upright { [across, along] } else { [along, across] });
            }
        }
        places
    };
    // True if the straight line between two crossings passes through the sample's cell, one of 16x16.
    let touches = |pixel: [u32; 2], [a, b]: [[f64; 2]; 2]| {
        let [left, top] = [cell[at(pixel)] & 15, cell[at(pixel)] >> 4].map(|index| f64::from(index) / 16.0);
        let corners =
            [[left, top], [left + 0.0625, top], [left, top + 0.0625], [left + 0.0625, top + 0.0625]];
        let sides = corners.map(|[x, y]| (b[0] - a[0]) * (y - a[1]) - (b[1] - a[1]) * (x - a[0]));
        sides.iter().any(|side| *side >= 0.0) && sides.iter().any(|side| *side <= 0.0)
    };
    let mut seen = [0; 2];
    for pixel in pixels().filter(|pixel| id[at(*pixel)] != NONE) {
        let places = crossed(pixel);
        let &[a, b] = places.as_slice() else { continue };
        let index = usize::from(touches(pixel, [a, b]));
        seen[index] += 1;
        if seen[index] > 3 {
            continue;
        }
        let (_, inspection) = run.look(pixel);
        let findings = findings_of(&inspection, "edges/classify");
        assert_eq!(value_of(findings, "class"), Some("simple: an edge cuts it in two"));
        // Skip edges that bend at a vertex.
        if findings.iter().any(|finding| {
            matches!(finding, Finding::Sketch(marks)
            if marks.iter().filter(|mark| matches!(mark, epigraph_core::Mark::Edge(_))).count() > 1)
        }) {
            seen[index] -= 1;
            continue;
        }
        let text = why(&inspection, "edges/classify");
        assert_eq!(text.starts_with("Ambiguous"), index == 1, "{pixel:?} {text} {:x}", cls[at(pixel)]);
    }
    assert!(seen.iter().all(|seen| *seen > 3), "{seen:?}");
}

#[test]
fn pixels_beyond_an_edge_are_marked_as_unreachable() {
    let run = epi();
    let (state, _) = run.look([0, 0]);
    let (r24, cls) = (port(&state, "edges/reach.r24"), port(&state, "edges/classify.cls"));
    let inner = |pixel: &[u32; 2]| (0..2).all(|axis| (2..SIZE[axis] - 2).contains(&pixel[axis]));
    let pixel = pixels().filter(inner).find(|pixel| (8..16).contains(&r24[at(*pixel)].count_ones())).unwrap();
    let (_, inspection) = run.look(pixel);
    let roles: Vec<Role> = around(&inspection, "edges/reach").iter().map(|cell| cell.role).collect();
    // Bit k is the k-th of the other 24 pixels, in reading order.
    let mut bits = (0..24).map(|bit| r24[at(pixel)] >> bit & 1 != 0);
    for (index, role) in roles.iter().enumerate() {
        let reached = index == 12 || bits.next().unwrap();
        assert_eq!(*role, if reached { Role::Counts } else { Role::Apart }, "{index}");
    }
    let missing = 24 - r24[at(pixel)].count_ones();
    assert!(why(&inspection, "edges/reach").starts_with(&format!("{missing} pixels cannot be reached")));
    // Complex pixels reach no others. The class is in the two lowest bits; 2 is complex.
    let complex = pixels().find(|pixel| cls[at(*pixel)] & 3 == 2).expect("chains meet");
    let (_, inspection) = run.look(complex);
    assert!(why(&inspection, "edges/reach").contains("is complex"), "{}", why(&inspection, "edges/reach"));
    assert!(value_of(findings_of(&inspection, "edges/classify"), "class").unwrap().starts_with("complex: "));
}

#[test]
fn empty_pixels_holes_and_the_background_are_explained() {
    let run = Run::new("epi.ron", "chains", Backend::Cpu, &EPI, 3);
    let (state, _) = run.look([0, 0]);
    let (id, filled) = (port(&state, "view/project.id"), port(&state, "spread.filled"));
    let empty = pixels().find(|pixel| id[at(*pixel)] == NONE).unwrap();
    let (_, inspection) = run.look(empty);
    assert_eq!(inspection.sample, None);
    assert_eq!(why(&inspection, "view/project"), "No point of the cloud falls into this pixel.");

    let hole = pixels().find(|pixel| filled[at(*pixel)] == 1).expect("three frames leave holes");
    let (_, inspection) = run.look(hole);
    let text = why(&inspection, "spread");
    assert!(text.starts_with("A hole, filled in round 1: colours came "), "{text}");
    // Every pixel that the text names has a colour and is a neighbour of the hole.
    let named: Vec<[u32; 2]> = text[text.find("at last from").unwrap()..]
        .split('(')
        .skip(1)
        .map(|pair| {
            let mut numbers = pair.split(')').next().unwrap().split(", ").map(|n| n.parse().unwrap());
            [numbers.next().unwrap(), numbers.next().unwrap()]
        })
        .collect();
    assert!(!named.is_empty());
    for from in named {
        assert!(filled[at(from)] <= 1 && from != hole);
        assert!((0..2).all(|axis| from[axis].abs_diff(hole[axis]) <= 1), "{hole:?} {from:?}");
    }

    // A sample of the background is a direction rather than a position.
    let background = pixels().filter(|pixel| id[at(*pixel)] != NONE).find_map(|pixel| {
        let (_, inspection) = run.look(pixel);
        let direction = value_of(inspection.sample.as_ref()?, "direction")?.to_owned();
        Some((direction, inspection))
    });
    let (direction, inspection) = background.expect("chains hang before a background");
    assert!(direction.ends_with("its ray met nothing"), "{direction}");
    assert_eq!(value_of(inspection.sample.as_ref().unwrap(), "surface"), None);
}

#[test]
fn the_render_cache_shows_which_points_it_averages() {
    let run = Run::new("render-cache.ron", "cornell", Backend::Cpu, &["view/cull.id", "fill.priority"], 3);
    let (state, _) = run.look([0, 0]);
    let (id, priority) = (port(&state, "view/cull.id"), port(&state, "fill.priority"));
    let inner = |pixel: &[u32; 2]| (0..2).all(|axis| (1..SIZE[axis] - 1).contains(&pixel[axis]));
    let points = |[x, y]: [u32; 2]| {
        let near = (y - 1..=y + 1).flat_map(|y| (x - 1..=x + 1).map(move |x| at([x, y])));
        near.filter(|near| id[*near] != NONE).count()
    };
    let pixel = pixels().filter(inner).find(|pixel| points(*pixel) == 3 && id[at(*pixel)] == NONE).unwrap();
    let (_, inspection) = run.look(pixel);
    let text = why(&inspection, "fill");
    assert!(text.starts_with("The mean of 3 points in the 3×3 pixels"), "{text}");
    let shown = value_of(findings_of(&inspection, "fill"), "priority").unwrap();
    assert_eq!(shown, format!("{} of 255", priority[at(pixel)]));
    let order: Vec<&str> = inspection.nodes.iter().map(|visit| visit.node.as_str()).collect();
    let place = |node: &str| order.iter().position(|other| *other == node).unwrap();
    assert!(place("view/project") < place("view/cull") && place("view/cull") < place("fill"), "{order:?}");
}

#[test]
fn scratch_ports_are_left_out_but_can_be_watched_by_name() {
    // It has one value per pixel, so it is left out only because it is scratch.
    let scratch = "fill.points";
    let run = Run::new("render-cache.ron", "cornell", Backend::Cpu, &[scratch], 3);
    let (state, inspection) = run.look([40, 30]);
    let graph = state.graph.as_ref().unwrap();
    let info = graph.port(scratch).unwrap();
    assert!(info.port.scratch && info.is_image(SIZE));
    let shown: Vec<String> = inspection
        .nodes
        .iter()
        .flat_map(|visit| visit.values.iter().map(move |(port, _)| format!("{}.{port}", visit.node)))
        .collect();
    assert!(shown.iter().any(|port| port == "fill.color"), "{shown:?}");
    assert!(shown.iter().all(|port| !graph.port(port).unwrap().port.scratch), "{shown:?}");
    assert_eq!(state.fields(scratch).count(), 1);
}

#[test]
fn inspecting_changes_no_picture_and_ends_completely() {
    let image = |looks: bool| {
        let run = Run::new("epi.ron", "cornell", Backend::Cpu, &[], 3);
        if looks {
            let (state, inspection) = run.look([40, 30]);
            // The inspection is of the frame in view; no other frame was run for it.
            assert_eq!((state.frames, inspection.frame), (3, 2));
            assert!(inspection.bytes > 1 << 20);
            // `trace` explains every pixel, whether or not it has a sample of this frame.
            assert!(visit(&inspection, "trace").findings.is_some());
            // Only outputs are published.
            assert!(
                state.snapshots.iter().all(|snapshot| snapshot.name == "image"),
                "{}",
                state.snapshots.len()
            );
            run.engine.send(Command::Inspect(None));
        }
        run.engine.send(Command::Step(3));
        let state = run.wait("frames", |state| state.frames == 6);
        assert_eq!(state.inspection, None);
        state.fields("image").next().unwrap().bytes.clone()
    };
    assert_eq!(image(true), image(false));
}

#[test]
fn a_pause_holds_the_frame_that_can_be_inspected() {
    let run = Run::new("epi.ron", "cornell", Backend::Cpu, &[], 3);
    run.look([40, 30]);
    run.engine.send(Command::Pause(false));
    run.wait("running", |state| state.frames > 8);
    run.engine.send(Command::Inspect(Some([41, 30])));
    run.wait("an inspection while frames run", |state| {
        state.inspection.as_ref().is_some_and(|found| found.pixel == [41, 30] && found.frame >= 8)
    });
    run.engine.send(Command::Pause(true));
    let paused = run.wait("the pause", |state| {
        let found = state.inspection.as_ref();
        state.paused && state.owed == 0 && found.is_some_and(|found| found.frame + 1 == state.frames)
    });
    let (state, _) = run.look([12, 12]);
    assert_eq!(state.frames, paused.frames);
}

#[test]
fn the_papers_split_and_wgsl_nodes_can_be_inspected() {
    let run = Run::new("hybrid.ron", "cornell", Backend::Gpu, &["view/cull.id"], 4);
    let (state, inspection) = run.look([40, 30]);
    assert_eq!(visit(&inspection, "view/project").side, Side::Gpu);
    assert_eq!(visit(&inspection, "request").side, Side::Cpu);
    // The dither read the last frame's priorities, so the explanation must not use those of this frame.
    assert!(!why(&inspection, "request").contains("Its priority of"), "{}", why(&inspection, "request"));
    let id = port(&state, "view/cull.id")[at([40, 30])];
    if id != NONE {
        assert_eq!(value_of(inspection.sample.as_ref().unwrap(), "point"), Some(id.to_string().as_str()));
    }
    let run = Run::new("experiments/outline.ron", "cornell", Backend::Gpu, &["outline.outlined"], 4);
    let (state, inspection) = run.look([40, 30]);
    let outline = visit(&inspection, "outline");
    assert_eq!(outline.findings, None);
    let linear = &state.fields("outline.outlined").next().unwrap().get::<[f32; 4]>()[at([40, 30])];
    assert_eq!(outline.values[0].0, "outlined");
    let red = format!("r {}", epigraph_pictures::Number::Float(linear[0]).brief());
    assert!(outline.values[0].1.contains(&red), "{:?} {red}", outline.values);
}

/// The findings of every pixel must agree with the nodes' outputs.
#[test]
fn findings_agree_with_the_outputs_at_every_pixel() {
    let watched = [&EPI[..], &["edges/classify.kept", "edges/reach_cull.id", "interpolate.color"]].concat();
    let run = Run::new("epi.ron", "cornell", Backend::Cpu, &watched, 6);
    let mut camera = run.engine.state().home.unwrap();
    camera.eye.x += 0.2;
    run.engine.send(Command::Camera(camera));
    run.step();
    let (state, _) = run.look([0, 0]);
    let names =
        ["view/project.id", "view/cull.id", "edges/classify.kept", "edges/reach_cull.id", "spread.filled"];
    let [projected, culled, kept, reached, filled] = names.map(|name| port(&state, name));
    let color = state.fields("interpolate.color").next().unwrap().get::<[f32; 4]>();
    let mut seen = [0; 4];
    // Every seventh pixel, which visits all columns.
    for pixel in pixels().step_by(7) {
        let (_, inspection) = run.look(pixel);
        let p = at(pixel);
        let cull = |node: &str, before: u32, after: u32| {
            let text = why(&inspection, node);
            let shown = (text.starts_with("Culled"), text.starts_with("Stays"));
            assert_eq!(
                shown,
                (before != after, before == after && before != NONE),
                "{node} {pixel:?} {text}"
            );
            usize::from(shown.0)
        };
        seen[0] += cull("view/cull", projected[p], culled[p]);
        seen[1] += cull("edges/reach_cull", kept[p], reached[p]);
        let is_hole = filled[p] != 0;
        seen[2] += usize::from(is_hole);
        assert_eq!(!why(&inspection, "spread").starts_with("Not a hole"), is_hole, "{pixel:?}");
        // The weighted mean of the surrounding samples is the colour. Weights are shown in whole per cent.
        let cells = around(&inspection, "interpolate").iter().filter(|cell| cell.role == Role::Counts);
        let share = |cell: &Cell| cell.text.trim_end_matches('%').parse::<f32>().unwrap() / 100.0;
        let (mut sum, mut red, mut most) = (0.0, 0.0, 0f32);
        for cell in cells {
            sum += share(cell);
            red += share(cell) * cell.linear.unwrap()[0];
            most = most.max(cell.linear.unwrap()[0]);
        }
        if color[p][3] > 0.0 {
            assert!(
                (sum - 1.0).abs() < 0.13 && (red - color[p][0]).abs() < 0.13 * most + 1e-6,
                "{pixel:?} {sum} {red}"
            );
            seen[3] += 1;
        } else {
            assert_eq!(sum, 0.0);
        }
    }
    assert!(seen.iter().all(|count| *count > 0), "{seen:?}");
}

#[test]
fn an_exposure_that_fits_the_picture_is_told_in_ev() {
    let run = Run::new("epi.ron", "cornell", Backend::Cpu, &[], 2);
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../graphs/epi.ron");
    let mut file = GraphFile::load(&path).unwrap();
    file.set_param("tonemap", "exposure", "Auto").unwrap();
    run.engine.send(Command::Graph(Arc::new(file)));
    run.engine.send(Command::Watch(vec!["tonemap.white".into()]));
    run.engine.send(Command::Step(3));
    run.wait("frames", |state| state.frames == 5);
    let (state, inspection) = run.look([48, 32]);
    let white = f32::from_bits(port(&state, "tonemap.white")[0]);
    let text = format!("{:+.2} EV, Auto", -white.log2());
    assert_eq!(value_of(findings_of(&inspection, "tonemap"), "exposure"), Some(text.as_str()));
    assert!(white > 0.0 && white != 1.0, "{white}");
}
