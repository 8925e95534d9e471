//! Shader files that are damaged at random are refused with errors at their places, or make a stage; nothing panics. What
//! makes a stage is not run: it may loop for ever.

use std::{
    fs,
    panic::{AssertUnwindSafe, catch_unwind},
    path::{Path, PathBuf},
    sync::{Arc, Mutex},
};

use epigraph::{Place, graphs::Shipped};
use epigraph_core::{
    EditedTexts, GraphFile, Problems, Registry, Settings, Side, WgslFile, compile, testing::Random,
};
use epigraph_stages::facts::CAMERA_MOVES;

use crate::mutate::{choose, tokens};

/// Mutants of each kind in an ordinary run.
fn mutants() -> usize {
    250 * crate::times()
}

/// Numbers and sizes at the ends of what there is, and beyond.
const EXTREMES: [&str; 14] = [
    "0",
    "1",
    "-1",
    "4294967295",
    "4294967296",
    "65536x65536",
    "0x0",
    "1e39",
    "1e-46",
    "nan",
    "inf",
    "3.5",
    "..",
    "99999999999999999999",
];

/// Damages a text in one place; in every other text that has declarations, one of those.
fn damage(text: &str, random: &mut Random) -> String {
    let lines: Vec<&str> = text.split_inclusive('\n').collect();
    let starts: Vec<usize> =
        lines.iter().scan(0, |at, line| Some(std::mem::replace(at, *at + line.len()))).collect();
    let is_declaration = |line: &str| {
        let line = line.trim_start();
        line.starts_with("/// =") || line.starts_with("//! =")
    };
    let declarations: Vec<usize> = (0..lines.len()).filter(|&line| is_declaration(lines[line])).collect();
    let chosen = match random.below(2) {
        0 if !declarations.is_empty() => choose(random, &declarations),
        _ => random.below(lines.len() as u32) as usize,
    };
    let (start, end) = (starts[chosen], starts[chosen] + lines[chosen].len());
    let words: Vec<(usize, usize)> =
        tokens(lines[chosen]).into_iter().map(|(a, b)| (start + a, start + b)).collect();
    let with = |from: usize, to: usize, new: &str| format!("{}{new}{}", &text[..from], &text[to..]);
    if words.is_empty() || random.below(8) == 0 {
        return match random.below(3) {
            0 => with(start, end, ""),
            1 => with(start, start, lines[chosen]),
            _ => with(start, start, choose(random, &lines)),
        };
    }
    let (a, b) = choose(random, &words);
    let is_number = |&(a, b): &(usize, usize)| text[a..b].starts_with(|c: char| c.is_ascii_digit());
    let numbers: Vec<(usize, usize)> = words.iter().copied().filter(is_number).collect();
    match random.below(7) {
        0 => with(a, b, ""),
        1 => with(a, a, &format!("{} ", &text[a..b])),
        2 => with(a, b, choose(random, &EXTREMES)),
        3 if !numbers.is_empty() => {
            let (a, b) = choose(random, &numbers);
            with(a, b, choose(random, &EXTREMES))
        }
        4 => {
            let all = tokens(text);
            let (c, d) = choose(random, &all);
            with(a, b, &text[c..d])
        }
        5 => with(a, a + text[a..b].chars().next().map_or(0, char::len_utf8), ""),
        _ => {
            let (c, d) = choose(random, &words);
            let ((a, b), (c, d)) = if a < c { ((a, b), (c, d)) } else { ((c, d), (a, b)) };
            if b > c {
                return with(a, b, ",");
            }
            format!("{}{}{}{}{}", &text[..a], &text[c..d], &text[b..c], &text[a..b], &text[d..])
        }
    }
}

/// Files with declarations.
fn declared() -> Vec<PathBuf> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let folders = [root.join("../tests/wgsl"), root.join("../graphs/experiments")];
    let entries = folders.iter().flat_map(|folder| fs::read_dir(folder).unwrap());
    let mut files: Vec<PathBuf> = entries.map(|entry| entry.unwrap().path()).collect();
    files.retain(|path| path.extension().is_some_and(|end| end == "wgsl"));
    files.sort();
    files
}

/// A registry that reads one file, which it does not know the path of, from here.
type Text = Arc<Mutex<Option<(PathBuf, Arc<str>)>>>;

fn registry(text: &Text) -> Registry {
    let text = text.clone();
    epigraph_stages::registry().with_edited(EditedTexts::new(move |file| {
        let text = text.lock().unwrap();
        text.as_ref().filter(|(known, _)| known == file).map(|(_, text)| text.clone())
    }))
}

/// Damages the texts of files in turn. Asserts that `read` does not panic, and that its problems are at lines of the
/// file, except for what is missing there. Returns how many texts were refused.
fn try_all(files: &[PathBuf], read: impl Fn(&Registry, &Path) -> Result<(), Problems>) -> usize {
    let text = Text::default();
    let registry = registry(&text);
    let mut random = Random(12);
    let mut refused = 0;
    for mutant in 0..mutants() {
        let file = &files[mutant % files.len()];
        let whole = fs::read_to_string(file).unwrap();
        let mut damaged = damage(&whole, &mut random);
        if random.below(4) == 0 {
            damaged = damage(&damaged, &mut random);
        }
        *text.lock().unwrap() = Some((file.clone(), damaged.as_str().into()));
        let what = || format!("mutant {mutant} of {}:\n{}", file.display(), difference(&whole, &damaged));
        let result = catch_unwind(AssertUnwindSafe(|| read(&registry, file)));
        let Err(problems) = result.unwrap_or_else(|_| panic!("{}", what())) else { continue };
        refused += 1;
        for problem in &problems.0 {
            let place = problem.place.as_ref().unwrap_or_else(|| panic!("{problem}\n{}", what()));
            // What is missing has no line, and a name that hides one of WGSL's is wrong where a module uses it.
            let text = problem.to_string();
            let elsewhere = ["unknown entry point", "has no variable", "no entry point", "shader shared/"];
            let lines = if elsewhere.iter().any(|part| text.contains(part)) { 0 } else { 1 };
            let lines = lines..=damaged.lines().count().max(1);
            assert!(Path::new(&place.file) == file && lines.contains(&place.line), "{problem}\n{}", what());
        }
    }
    refused
}

/// The lines that a damage has changed.
fn difference(before: &str, after: &str) -> String {
    let (before, after): (Vec<&str>, Vec<&str>) = (before.lines().collect(), after.lines().collect());
    let same = before.iter().zip(&after).take_while(|(a, b)| a == b).count();
    let lines = after.iter().skip(same).take(3).map(|line| format!("+ {line}\n"));
    before.iter().skip(same).take(3).map(|line| format!("- {line}\n")).chain(lines).collect()
}

#[test]
fn damaged_shader_files_are_refused_at_their_lines() {
    let refused = try_all(&declared(), |registry, file| WgslFile::load(file, registry).map(|_| ()));
    println!("{refused} of {} refused", mutants());
    assert!(refused > mutants() / 3, "{refused} refused");
}

#[test]
fn damaged_shaders_of_stages_are_refused_at_their_lines() {
    let names =
        ["age", "classify", "depth_cull", "edge_raster", "interpolate", "project", "reach", "silhouette"];
    let registry = epigraph_stages::registry();
    let file_of = |name: &str| registry.get(name)?.declaration()?.shader?.file;
    let files: Vec<PathBuf> = names.iter().map(|name| file_of(name).expect("a file")).collect();
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../graphs/epi.ron");
    let file = GraphFile::load_with(&path, &Shipped).expect("a shipped graph");
    let facts =
        Place::load("cornell", "still").expect("a built-in scene").facts().stating(CAMERA_MOVES, true);
    let settings = Settings { side: Side::Gpu, ..Settings::new([64, 48], 100, facts) };
    let refused = try_all(&files, |registry, _| compile(&file, registry, &settings).map(|_| ()));
    println!("{refused} of {} refused", mutants());
    assert!(refused > mutants() / 3, "{refused} refused");
}
