//! Graphs of `wgsl` nodes alone, on the GPU: what their files declare is what happens.

use std::fs;

use epigraph_core::{
    Executor, Facts, Frame, GraphFile, Host, Registry, Settings, ShaderModule, Side, Snapshot, compile,
    testing::gpu, wgsl_kind,
};

use super::Folder;

/// Counts frames in kept memory; writes pixel index + 1000 * frame.
const RAMP: &str = "
#import frame
/// = kept, 1 element
@group(0) @binding(1) var<storage, read_write> count: array<u32>;
/// = scratch, 4 elements
@group(0) @binding(2) var<storage, read_write> base: array<u32>;
/// = output, per pixel
@group(0) @binding(3) var<storage, read_write> ramp: array<u32>;
/// One for each 32 pixels.
/// = output, bit per element of ramp
@group(0) @binding(4) var<storage, read_write> odd: array<atomic<u32>>;
/// = 1 group
@compute @workgroup_size(1) fn add() {
    count[0] += 1u;
    base[0] = 1000u * count[0];
}
@compute @workgroup_size(8, 8) fn fill(@builtin(global_invocation_id) id: vec3<u32>) {
    if any(id.xy >= frame.size) { return; }
    let pixel = id.y * frame.size.x + id.x;
    ramp[pixel] = pixel + base[0];
}
@compute @workgroup_size(64) fn clear(@builtin(global_invocation_id) id: vec3<u32>) {
    if id.x < arrayLength(&odd) { atomicStore(&odd[id.x], 0u); }
}
/// = over ramp
@compute @workgroup_size(32) fn mark(@builtin(global_invocation_id) id: vec3<u32>) {
    if id.x < arrayLength(&ramp) { atomicOr(&odd[id.x / 32u], (ramp[id.x] & 1u) << (id.x % 32u)); }
}
";

/// now + 2 * before, and 1 more if `more` is connected.
const MIX: &str = "
#import frame
@group(0) @binding(1) var<storage, read> now: array<u32>;
/// = last frame
@group(0) @binding(2) var<storage, read> before: array<u32>;
#ifdef HAS_MORE
/// = optional
@group(0) @binding(3) var<storage, read> more: array<u32>;
/// = scratch, 1 element
@group(0) @binding(5) var<storage, read_write> first: array<u32>;
/// = 1 group
@compute @workgroup_size(1) fn begin() { first[0] = more[0]; }
#endif
/// = output, like now
@group(0) @binding(4) var<storage, read_write> sum: array<u32>;
@compute @workgroup_size(8, 8) fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    if any(id.xy >= frame.size) { return; }
    let pixel = id.y * frame.size.x + id.x;
    sum[pixel] = now[pixel] + 2u * before[pixel];
#ifdef HAS_MORE
    sum[pixel] += first[0];
#endif
}
";

/// Points in kept memory, a bundle of two fields: their age, and twice the age of the frame before.
const POINTS: &str = "
/// = field of cloud, kept, 0.5 per pixel
@group(0) @binding(1) var<storage, read_write> cloud_age: array<u32>;
/// = field of cloud
@group(0) @binding(2) var<storage, read_write> cloud_twice: array<u32>;
@compute @workgroup_size(64) fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    if id.x < arrayLength(&cloud_age) {
        cloud_twice[id.x] = 2u * cloud_age[id.x];
        cloud_age[id.x] += id.x;
    }
}
";

/// Adds `more` to one field of the points, and sums blocks of 8.
const GROW: &str = "
struct Params {
    /// = 100
    more: u32,
}
@group(0) @binding(0) var<uniform> params: Params;
/// = field of cloud
@group(0) @binding(1) var<storage, read> cloud_twice: array<u32>;
/// = field of cloud
@group(0) @binding(2) var<storage, read_write> cloud_age: array<u32>;
/// = output, 64 elements
@group(0) @binding(3) var<storage, read_write> sums: array<u32>;
@compute @workgroup_size(64) fn grow(@builtin(global_invocation_id) id: vec3<u32>) {
    if id.x < arrayLength(&cloud_age) { cloud_age[id.x] += params.more; }
}
/// = one per 8 of cloud_age
@compute @workgroup_size(1) fn sum(@builtin(global_invocation_id) id: vec3<u32>) {
    var sum = 0u;
    for (var i = 8u * id.x; i < min(8u * id.x + 8u, arrayLength(&cloud_twice)); i++) {
        sum += cloud_age[i] + cloud_twice[i];
    }
    sums[id.x] = sum;
}
";

/// Marks that are drawn as points: their column, and their depth in tenths.
const MARKS: &str = "
/// = output, 4 elements
@group(0) @binding(0) var<storage, read_write> marks: array<vec2<u32>>;
@compute @workgroup_size(4) fn main(@builtin(local_invocation_index) i: u32) {
    var columns = array(2u, 5u, 2u, 5u);
    var depths = array(3u, 6u, 5u, 1u);
    marks[i] = vec2(columns[i], depths[i]);
}
";

/// Draws the marks into the middle row: number and depth of the nearest.
const DRAW: &str = "
#import frame
@group(0) @binding(1) var<storage, read> marks: array<vec2<u32>>;
/// = per pixel
@group(0) @binding(2) var ids: texture_storage_2d<r32uint, write>;
/// = like ids
@group(0) @binding(3) var depths: texture_storage_2d<rgba32float, write>;
struct Point { @builtin(position) at: vec4<f32>, @location(0) @interpolate(flat) id: u32 }
struct Colors { @location(0) id: u32, @location(1) depth: vec4<f32> }
/// = draw 1 point vertex per marks into ids and depths, fragment paint, depth, clear 9
@vertex fn place(@builtin(vertex_index) i: u32) -> Point {
    let x = 2.0 * (f32(marks[i].x) + 0.5) / f32(frame.size.x) - 1.0;
    return Point(vec4(x, 0.0, 0.1 * f32(marks[i].y), 1.0), i);
}
@fragment fn paint(in: Point) -> Colors {
    return Colors(in.id, vec4(round(10.0 * in.at.z), 0.0, 0.0, 1.0));
}
";

/// Counts threads: as many workgroups of 4 as its first pass says.
const GROUPS: &str = "
/// = scratch, 3 elements
@group(0) @binding(0) var<storage, read_write> counts: array<u32>;
/// = output, 1 element
@group(0) @binding(1) var<storage, read_write> threads: array<atomic<u32>>;
/// = 1 group
@compute @workgroup_size(1) fn begin() {
    counts[0] = 5u;
    counts[1] = 2u;
    counts[2] = 1u;
    atomicStore(&threads[0], 0u);
}
/// = groups from counts
@compute @workgroup_size(4) fn main() { atomicAdd(&threads[0], 1u); }
";

const SIZE: [u32; 2] = [9, 5];
const PIXELS: u32 = SIZE[0] * SIZE[1];

/// Runs some frames of a graph of these nodes beside these files; returns a function that reads an output.
fn run(nodes: &str, outputs: &[&str], frames: u64) -> impl Fn(&str) -> Vec<u32> + use<> {
    let mut executor = start(nodes, outputs, &[]).unwrap_or_else(|error| panic!("{error}"));
    for index in 0..frames {
        let frame = Frame { size: SIZE, index: index as u32, ..Frame::default() };
        executor.run(&frame, &Host::default(), true).unwrap();
    }
    let snapshots: Vec<Snapshot> = executor.snapshots().unwrap().into_iter().cloned().collect();
    move |output| {
        let (port, field) = output.split_once(':').unwrap_or((output, ""));
        let found = snapshots.iter().find(|snapshot| snapshot.name == port && snapshot.field == field);
        found.unwrap_or_else(|| panic!("no output {output}")).get()
    }
}

/// An executor of such a graph, with further files; or the error.
fn start(nodes: &str, outputs: &[&str], more: &[(&str, &str)]) -> Result<Executor, String> {
    let folder = Folder::new();
    for &(name, text) in more {
        fs::write(folder.0.join(name), text).unwrap();
    }
    for (name, text) in [
        ("ramp", RAMP),
        ("mix", MIX),
        ("points", POINTS),
        ("grow", GROW),
        ("marks", MARKS),
        ("draw", DRAW),
        ("groups", GROUPS),
    ] {
        fs::write(folder.0.join(format!("{name}.wgsl")), text).unwrap();
    }
    let outputs: Vec<String> = outputs.iter().map(|port| format!("{port:?}: {port:?}")).collect();
    let text = format!("Graph(version: 1, nodes: {{ {nodes} }}, outputs: {{ {} }})", outputs.join(", "));
    let path = folder.0.join("graph.ron");
    fs::write(&path, text).unwrap();
    let registry = Registry::default()
        .with_kind(wgsl_kind())
        .with_module(ShaderModule::new("frame", epigraph_shaders::text("shared/frame.wgsl")));
    let settings = Settings { side: Side::Gpu, poison: true, ..Settings::new(SIZE, 0, Facts::none()) };
    let file = GraphFile::load(&path).unwrap_or_else(|problems| panic!("{problems}"));
    let (graph, plan) = compile(&file, &registry, &settings).map_err(|problems| problems.to_string())?;
    Executor::new(graph, plan, &settings, &registry, Some(gpu())).map_err(|error| error.to_string())
}

#[test]
fn outputs_are_written_and_kept_memory_is_kept() {
    let read = run(
        r#""ramp": (kind: "wgsl", params: (shader: "ramp.wgsl"))"#,
        &["ramp.ramp", "ramp.count", "ramp.odd"],
        3,
    );
    assert_eq!(read("ramp.count"), [3]);
    assert_eq!(read("ramp.ramp"), (0..PIXELS).map(|pixel| pixel + 3000).collect::<Vec<_>>());
    assert_eq!(read("ramp.odd"), [0xAAAA_AAAA, 0xAAA]);
}

const RAMP_NODE: &str = r#""ramp": (kind: "wgsl", params: (shader: "ramp.wgsl")),"#;

#[test]
fn the_frame_before_is_read() {
    let nodes = format!(
        r#"{RAMP_NODE} "mix": (kind: "wgsl", inputs: {{ "now": "ramp.ramp", "before": "ramp.ramp" }}, params: (shader: "mix.wgsl"))"#
    );
    let read = run(&nodes, &["mix.sum"], 3);
    assert_eq!(read("mix.sum"), (0..PIXELS).map(|pixel| 3 * pixel + 3000 + 2 * 2000).collect::<Vec<_>>());
    // Its own output of the frame before: 1000 + 2 * 0, 2000 + 2 * 1000, 3000 + 2 * 4000.
    let read = run(&nodes.replace("\"before\": \"ramp.ramp\"", "\"before\": \"mix.sum\""), &["mix.sum"], 3);
    assert_eq!(read("mix.sum"), (0..PIXELS).map(|pixel| 7 * pixel + 11000).collect::<Vec<_>>());
}

#[test]
fn an_optional_input_may_be_connected() {
    let nodes = format!(
        r#"{RAMP_NODE} "mix": (kind: "wgsl", inputs: {{ "now": "ramp.ramp", "before": "ramp.ramp", "more": "ramp.count" }},
            params: (shader: "mix.wgsl"))"#
    );
    let read = run(&nodes, &["mix.sum"], 2);
    assert_eq!(read("mix.sum"), (0..PIXELS).map(|pixel| 3 * pixel + 2000 + 2 * 1000 + 2).collect::<Vec<_>>());
}

#[test]
fn the_fields_of_a_bundle_are_read_and_updated() {
    let nodes = r#"
        "points": (kind: "wgsl", params: (shader: "points.wgsl")),
        "grow": (kind: "wgsl", inputs: { "cloud": "points.cloud" }, params: (shader: "grow.wgsl", more: 7)),
    "#;
    let read = run(nodes, &["grow.cloud", "grow.sums"], 2);
    let count = PIXELS.div_ceil(2);
    let after = |frames: u32, point: u32| frames * (point + 7);
    assert_eq!(read("grow.cloud:age"), (0..count).map(|point| after(2, point)).collect::<Vec<_>>());
    let sum = |block: u32| -> u32 {
        (8 * block..count.min(8 * block + 8)).map(|point| after(2, point) + 2 * after(1, point)).sum()
    };
    assert_eq!(read("grow.sums")[..3], [0, 1, 2].map(sum));
}

#[test]
fn points_are_drawn() {
    let nodes = r#"
        "marks": (kind: "wgsl", params: (shader: "marks.wgsl")),
        "draw": (kind: "wgsl", inputs: { "marks": "marks.marks" }, params: (shader: "draw.wgsl")),
    "#;
    let read = run(nodes, &["draw.ids", "draw.depths"], 2);
    let mut ids = vec![9; PIXELS as usize];
    // The third mark is behind the first, the second behind the fourth.
    (ids[9 * 2 + 2], ids[9 * 2 + 5]) = (0, 3);
    assert_eq!(read("draw.ids"), ids);
    let depths: Vec<f32> = read("draw.depths").into_iter().map(f32::from_bits).collect();
    assert_eq!(depths.iter().step_by(4).filter(|&&depth| depth != 9.0).collect::<Vec<_>>(), [&3.0, &1.0]);
}

#[test]
fn workgroups_are_counted_on_the_gpu() {
    let read = run(r#""groups": (kind: "wgsl", params: (shader: "groups.wgsl"))"#, &["groups.threads"], 2);
    assert_eq!(read("groups.threads"), [5 * 2 * 4]);
}

#[test]
fn what_no_device_can_do_is_refused() {
    let refused = |declaration: &str, size: &str, parts: &[&str]| {
        let shader = format!(
            "{declaration}
            @group(0) @binding(0) var<storage, read_write> list: array<u32>;
            @compute @workgroup_size({size}) fn main() {{ list[0] = 1u; }}"
        );
        let node = r#""wide": (kind: "wgsl", params: (shader: "wide.wgsl"))"#;
        let error = start(node, &["wide.list"], &[("wide.wgsl", &shader)]).err().expect(declaration);
        for part in parts {
            assert!(error.contains(part), "`{part}` is not in:\n{error}");
        }
    };
    refused(
        "/// = output, 4294967295 elements",
        "64",
        &["`wide.list` has 4294967295 elements, 17179869180 bytes"],
    );
    refused("/// = output, 65535x65537", "64", &["`wide.list` has 4294967295 elements"]);
    refused("/// = kept, 1e30 per pixel", "64", &["graph.ron:1:", "is longer than 2^32"]);
    refused(
        "/// = output, per 4294967295x4294967295 pixels",
        "64",
        &["wide.wgsl:1:19: ", "a square such as 8x8"],
    );
    let parts =
        ["node `wide`", "`main` has 625000x1 workgroups of 8x8 threads", "65535", "@workgroup_size(64)"];
    refused("/// = output, 5000000 elements", "8, 8", &parts);
}

#[test]
fn an_extent_that_goes_in_circles_through_the_frame_before_is_refused() {
    let shader = "
        /// = last frame
        @group(0) @binding(0) var<storage, read> before: array<u32>;
        /// = output, like before
        @group(0) @binding(1) var<storage, read_write> list: array<u32>;
        @compute @workgroup_size(64) fn main() { list[0] = before[0]; }";
    let node = r#""loop": (kind: "wgsl", inputs: { "before": "loop.list" }, params: (shader: "loop.wgsl"))"#;
    let error = start(node, &["loop.list"], &[("loop.wgsl", shader)]).err().unwrap();
    assert!(error.contains("depends on itself"), "{error}");
}

/// Counts down from the number of workgroups, each of which writes an element.
const MOST: &str = "
/// = output, GROUPS elements
@group(0) @binding(0) var<storage, read_write> list: array<u32>;
/// = GROUPS groups
@compute @workgroup_size(1) fn main(
    @builtin(workgroup_id) id: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
) {
    list[id.x] = groups.x - id.x;
}
";

#[test]
fn as_many_workgroups_run_as_every_device_allows() {
    let groups = 65_535;
    let shader = MOST.replace("GROUPS", &groups.to_string());
    let node = r#""most": (kind: "wgsl", params: (shader: "most.wgsl"))"#;
    let mut executor = start(node, &["most.list"], &[("most.wgsl", &shader)]).unwrap();
    executor.run(&Frame { size: SIZE, ..Frame::default() }, &Host::default(), true).unwrap();
    let list = executor.snapshot("most.list", "").unwrap().unwrap().get::<u32>();
    assert!(list.iter().copied().eq((1..=groups).rev()), "{:?}", &list[..4]);
}
