//! Random declarations in a shader's comments: what they make of the shader, and what is wrong with them. And a shader
//! whose text is damaged, compared with what it declared before.

use std::{
    path::{Path, PathBuf},
    sync::{Arc, Mutex},
};

use epigraph_core::{
    EditedTexts, GraphFile, Registry, WgslFile, check_stage, testing::Random, wgsl_clauses, wgsl_kind,
};
use epigraph_stages::registry as stages;

use super::{DAMAGES, damaged, tokens, zoo};
use crate::measures::{Figures, assert_same};

/// A shader with things of all kinds that take declarations: each `=` is one that a test may replace.
const SHADER: &str = "//! Counts and draws.
//! = column P1
#import frame
struct Params {
    /// How much.
    /// = 0.5 in 0..2 unit kg
    much: f32,
    /// = Up of Up, Down
    way: u32,
    /// = -3 in -9..9
    shift: i32,
    /// = true
    loud: u32,
}
struct Pair { low: u32, high: f32 }
struct Corner {
    @builtin(position) at: vec4<f32>,
    @location(0) shade: f32,
    @location(1) @interpolate(flat) which: u32,
}
struct Inks {
    @location(0) ink: vec4<f32>,
    @location(1) which: u32,
    @builtin(frag_depth) depth: f32,
}
@group(0) @binding(1) var<uniform> params: Params;
/// Pairs of numbers.
/// = per sheet of paper
@group(0) @binding(2) var<storage, read> pairs: array<Pair>;
/// = output, 6 elements
@group(0) @binding(3) var<storage, read_write> counts: array<atomic<u32>>;
/// = output, field of cloud, like color
@group(0) @binding(4) var<storage, read_write> cloud_age: array<u32>;
/// = field of cloud
@group(0) @binding(5) var<storage, read_write> cloud_place: array<vec2<f32>>;
/// = optional
@group(0) @binding(6) var hint: texture_2d<f32>;
/// = last frame
@group(0) @binding(7) var color: texture_2d<f32>;
@group(0) @binding(8) var done: texture_storage_2d<rgba32float, write>;
/// = format rgba16float, per pixel
@group(0) @binding(9) var inked: texture_2d<f32>;
/// = format r32uint, per pixel
@group(0) @binding(10) var named: texture_2d<u32>;
var<workgroup> tile: array<u32, 64>;
/// Counts.
/// = 2 groups
@compute @workgroup_size(8, 8) fn count(@builtin(global_invocation_id) id: vec3<u32>) {
    tile[id.x & 63u] = id.x;
    atomicAdd(&counts[0], pairs[id.x].low + u32(params.much) + params.way + u32(params.shift) + params.loud);
}
/// = over cloud
@compute @workgroup_size(8, 8) fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    if any(id.xy >= frame.size) { return; }
    let at = id.y * frame.size.x + id.x;
    cloud_age[at] += 1u;
    cloud_place[at] = vec2<f32>(id.xy);
    var sum = textureLoad(color, id.xy, 0) + textureLoad(inked, id.xy, 0);
#ifdef HAS_HINT
    sum += textureLoad(hint, id.xy, 0);
#endif
    textureStore(done, id.xy, sum + f32(textureLoad(named, id.xy, 0).x));
}
/// = draw 3 triangle vertices per pairs into inked and named, fragment ink, depth, clear 1
@vertex fn corner(@builtin(vertex_index) index: u32) -> Corner {
    let pair = pairs[index / 3u];
    return Corner(vec4(pair.high, 0.0, 0.5, 1.0), f32(index), pair.low);
}
@fragment fn ink(@location(0) shade: f32, @location(1) @interpolate(flat) which: u32) -> Inks {
    return Inks(vec4(shade), which, 0.5);
}
";

/// The file, and the text that it has at the moment.
fn registry() -> (PathBuf, Arc<Mutex<Arc<str>>>, Registry) {
    let text: Arc<str> = SHADER.into();
    let (path, text) = (PathBuf::from("shader.wgsl"), Arc::new(Mutex::new(text)));
    let known = text.clone();
    let edited = EditedTexts::new(move |file| {
        (file == Path::new("shader.wgsl")).then(|| known.lock().expect("no panics").clone())
    });
    let library = stages().library;
    let mut registry = zoo::registry().with_kind(wgsl_kind());
    registry.library = library;
    (path, text, registry.with_edited(edited))
}

/// What fills a hole of a form: often right, sometimes at a limit, sometimes wrong.
fn filling(hole: &str, random: &mut Random) -> &'static str {
    let options: &[&str] = match hole {
        "PORT" => &["pairs", "counts", "color", "cloud", "cloud_age", "hint", "inked", "painted", "2"],
        "NAME" => &["P1", "ink", "corner", "inc", "_a", "3a"],
        "CHOICES" => &["Up, Down", "Up", "Up, Up", "Up, UP", "Up, 2", "Up, Down, Left, Right"],
        "TARGETS" => &["inked", "inked and named", "named and inked", "inked and", "done", "inked and inked"],
        "SHAPE" => &["point", "line", "triangle", "triangles", "square"],
        "FORMAT" => &["r32float", "r32uint", "rgba8unorm", "rgba16float", "rgba32float", "rgba32"],
        "DEFAULT" => &["0.5", "1", "-1", "true", "false", "Up", "2", "1e9", "Left", "-0.0", "inf"],
        "UNIT" => &["kg", "pixels per frame", "1"],
        "MEANING" => &["depth", "radiance", "depths", "the moon"],
        "QUANTITY" => &["sheet of paper", "page", "sheets", "pixel", "corner", "request", "edge"],
        "NUMBER" | "LOW" | "HIGH" => &["0", "1", "0.5", "-1", "-4", "9", "1e3", "+2", "inf", "1e999", "one"],
        "SHARE" => &["0.5", "2", "1.5", "0", "-1", "1e-60", "1e60"],
        "COUNT" => &["1", "2", "3", "6", "0", "-1", "4294967295", "4294967296", "1.5", "many", "65536"],
        "WxH" => &["16x16", "1x1", "0x4", "65536x65535", "65536x65536", "3x", "x3", "4 x 4"],
        "NxN" => &["8x8", "1x1", "8x4", "0x0", "8"],
        _ => &["?"],
    };
    // The first ones more often.
    let [a, b] = [0, 1].map(|_| random.below(options.len() as u32) as usize);
    options[a.min(b)]
}

/// What the declaration in a line is for, as clauses name it.
fn subject(lines: &[String], at: usize) -> &'static str {
    match lines[at..].iter().find(|line| !line.trim().starts_with("///")) {
        Some(line) if line.starts_with("//!") => "the file",
        Some(line) if line.starts_with("@group") => "a port",
        Some(line) if line.starts_with("    ") => "a parameter",
        _ => "an entry point",
    }
}

/// A random clause, mostly one for this subject.
fn clause(subject: &str, random: &mut Random) -> String {
    let is_any = random.below(12) == 0;
    let forms: Vec<_> = wgsl_clauses().into_iter().filter(|form| is_any || form.subject == subject).collect();
    let form = forms[random.below(forms.len() as u32) as usize].form;
    let (mut words, mut is_in) = (Vec::new(), true);
    for word in form.split(' ') {
        let inner = word.trim_matches(['[', ']']);
        if word.starts_with('[') {
            is_in = random.below(2) == 0;
        }
        if is_in {
            let is_hole = |part: &str| part.chars().next().is_some_and(|c| c.is_ascii_uppercase());
            let filled = match inner.split_once("..") {
                Some((low, high)) => format!("{}..{}", filling(low, random), filling(high, random)),
                None if is_hole(inner) => filling(inner, random).to_owned(),
                None => inner.split('/').nth(random.below(2) as usize).unwrap_or(inner).to_owned(),
            };
            words.push(filled);
        }
        if word.ends_with(']') {
            is_in = true;
        }
    }
    // Now and then a word is misspelt, missing, or there twice.
    if random.below(8) == 0 && !words.is_empty() {
        let at = random.below(words.len() as u32) as usize;
        match random.below(4) {
            0 => words[at].push('s'),
            1 => drop(words.remove(at)),
            2 => words.insert(at, words[at].clone()),
            _ => words.truncate(at),
        }
    }
    words.join(" ")
}

#[test]
fn messages_about_random_declarations_are_as_before() {
    let ((path, text, registry), mut figures, mut random) = (registry(), Figures::new(), Random(9));
    let mut accepted = 0;
    for round in 0..4000 {
        let mut lines: Vec<String> = SHADER.lines().map(str::to_owned).collect();
        let declared: Vec<usize> = (0..lines.len())
            .filter(|&line| lines[line].trim().starts_with("//") && lines[line].contains(" = "))
            .collect();
        for _ in 0..1 + random.below(6) / 5 {
            let at = declared[random.below(declared.len() as u32) as usize];
            let subject = subject(&lines, at);
            let count = 1 + random.below(5) / 3;
            let clauses: Vec<String> = (0..count).map(|_| clause(subject, &mut random)).collect();
            // In the place of what was there, or after it.
            let line = &mut lines[at];
            match random.below(2) {
                0 => line.truncate(line.find(" = ").expect("a declaration") + 3),
                _ => *line += ", ",
            }
            *line += &clauses.join(", ");
        }
        *text.lock().expect("no panics") = lines.join("\n").into();
        let said = match WgslFile::load(&path, &registry) {
            Ok(WgslFile { doc, declaration, specs, assumed }) => {
                accepted += 1;
                format!("{doc} {declaration:?} {specs:?} {assumed:?}")
            }
            Err(problems) => problems.to_string(),
        };
        figures.entry(format!("declarations {:02}", round / 100)).or_default().text(&said);
    }
    assert!((200..3000).contains(&accepted), "{accepted} are accepted");
    assert_same("declarations", &figures);
}

#[test]
fn messages_about_a_shader_that_no_longer_fits_are_as_before() {
    let ((path, text, registry), mut figures) = (registry(), Figures::new());
    let graph = r#"Graph(version: 1, nodes: {
        "s": (kind: "wgsl", inputs: { "hint": "s.done", "color": "s.done", "pairs": "s.pairs" },
            params: (shader: "shader.wgsl")),
    }, outputs: { "image": "s.done" })"#;
    let graph = GraphFile::parse("graph.ron", graph).unwrap_or_else(|problems| panic!("{problems}"));
    let stages = graph.stages(&registry).unwrap_or_else(|problems| panic!("{problems}"));
    let all = tokens(SHADER);
    for index in 0..all.len() {
        for damage in 0..DAMAGES {
            *text.lock().expect("no panics") = damaged(SHADER, &all, index, damage).into();
            let misfits = check_stage(&*stages[0].stage, &registry.library);
            let misfits: String = misfits.iter().map(|error| format!("{error}\n")).collect();
            figures.entry(format!("{damage} as the stage was")).or_default().text(&misfits);
            let said = match WgslFile::load(&path, &registry) {
                Ok(WgslFile { doc, declaration, specs, assumed }) => {
                    format!("{doc} {declaration:?} {specs:?} {assumed:?}")
                }
                Err(problems) => problems.to_string(),
            };
            figures.entry(format!("{damage} as a stage")).or_default().text(&said);
        }
    }
    assert_same("misfits", &figures);
}
