//! References between the documents and the code: cited sections and files exist, and quoted code is that of the files.

use std::{
    collections::BTreeSet,
    fs,
    path::{Path, PathBuf},
};

use epigraph_scenes::SceneFile;

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR")).parent().expect("the workspace")
}

/// The repository's text files with one of these extensions, outside of build folders.
fn files(folder: &Path, extensions: &[&str], found: &mut Vec<PathBuf>) {
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
        if path.is_dir() {
            if name != "target" && !name.starts_with('.') {
                files(&path, extensions, found);
            }
        } else if path.extension().is_some_and(|e| extensions.iter().any(|extension| e == *extension)) {
            found.push(path);
        }
    }
}

/// The text with the lines of each comment joined, so that no citation is broken across lines.
fn joined(text: &str) -> String {
    let lines = text.lines().map(|line| line.trim_start().trim_start_matches(['/', '!']).trim_end());
    lines.collect::<Vec<_>>().join(" ")
}

/// The numbers after each `marker`, as in "section 2.1", "sections 1.4, 1.6 and 11.2" or "sections 2.3 to 2.5".
fn cited(text: &str, marker: &str) -> Vec<String> {
    let mut numbers = Vec::new();
    for rest in text.split(marker).skip(1) {
        let rest = rest.trim_start_matches('s');
        for word in rest.split_whitespace() {
            let number = word.trim_matches(|c: char| !c.is_ascii_digit());
            let is_number = word.starts_with(|c: char| c.is_ascii_digit());
            if is_number {
                numbers.push(number.to_owned());
            }
            let goes_on = word == "and" || word == "to" || is_number && word.ends_with(',');
            let may_go_on = is_number && number == word;
            if !goes_on && !may_go_on {
                break;
            }
        }
    }
    numbers
}

/// The section numbers of the headings of `docs/algorithms.md`.
fn headings(text: &str) -> BTreeSet<String> {
    let headings = text.lines().filter(|line| line.starts_with('#'));
    let first = headings.filter_map(|line| line.trim_start_matches('#').split_whitespace().next());
    first.map(|word| word.trim_end_matches('.').to_owned()).collect()
}

#[test]
fn citations_are_read_as_written() {
    let text = joined(
        "//! a (`algorithms.md` sections 2.1, 11.2 and\n//! 11.3). See\n// algorithms.md section 2.6, E10.",
    );
    assert_eq!(cited(&text, "algorithms.md` section"), ["2.1", "11.2", "11.3"]);
    assert_eq!(cited(&text, "algorithms.md section"), ["2.6"]);
    assert_eq!(cited("sections 2.3 to 2.5): 7", "section"), ["2.3", "2.5"]);
    assert_eq!(cited("section 3: n = 100, f", "section"), ["3"]);
}

#[test]
fn every_cited_section_of_the_algorithms_exists() {
    let algorithms = fs::read_to_string(root().join("docs/algorithms.md")).unwrap();
    let headings = headings(&algorithms);
    let mut sources = Vec::new();
    files(root(), &["rs", "wgsl", "ron", "md", "toml"], &mut sources);
    let mut count = 0;
    for path in sources.iter().filter(|path| !path.ends_with("tests/suite/documents.rs")) {
        let text = joined(&fs::read_to_string(path).unwrap());
        // Within `algorithms.md`, a section without a file name is one of its own.
        let markers: &[&str] = if path.ends_with("docs/algorithms.md") {
            &["section"]
        } else {
            &["algorithms.md section", "algorithms.md` section", "algorithms.md) section"]
        };
        for number in markers.iter().flat_map(|marker| cited(&text, marker)) {
            assert!(headings.contains(&number), "{}: there is no section {number}", path.display());
            count += 1;
        }
    }
    assert!(count > 100, "only {count} citations were found");
}

#[test]
fn the_files_that_the_architecture_names_exist() {
    let text = fs::read_to_string(root().join("ARCHITECTURE.md")).unwrap();
    let spans = text.split('`').skip(1).step_by(2);
    let starts_with_a_folder =
        |span: &&str| span.split_once('/').is_some_and(|(folder, _)| root().join(folder).is_dir());
    let paths: Vec<&str> = spans.filter(starts_with_a_folder).collect();
    assert!(paths.len() > 40, "only {} paths were found", paths.len());
    for path in paths {
        assert!(root().join(path).exists(), "ARCHITECTURE.md names {path}");
    }
}

#[test]
fn the_readme_shows_the_files_of_the_stage() {
    let readme = fs::read_to_string(root().join("README.md")).unwrap();
    for (language, path) in [("rust", "src/median.rs"), ("wgsl", "shaders/median.wgsl")] {
        let file = fs::read_to_string(root().join("examples/own_stage").join(path)).unwrap();
        assert!(readme.contains(&format!("```{language}\n{file}```")), "README.md shows another {path}");
    }
}

#[test]
fn the_readme_shows_the_program_of_the_librarys_front_page() {
    let readme = fs::read_to_string(root().join("README.md")).unwrap();
    let front = fs::read_to_string(root().join("run/src/lib.rs")).unwrap();
    let front: String =
        front.lines().filter_map(|line| line.strip_prefix("//! ")).map(|line| format!("{line}\n")).collect();
    let program = readme.split("```rust\n").find(|block| block.starts_with("let mut run = Run::open"));
    let program = program.and_then(|block| block.split("```").next()).expect("the README shows a program");
    assert!(front.contains(program), "the library's front page has another program");
}

#[test]
fn the_scene_file_of_the_documents_is_one() {
    let text = fs::read_to_string(root().join("docs/scenes.md")).unwrap();
    let block = text.split("```ron\n").nth(1).and_then(|block| block.split("```").next());
    let file = SceneFile::parse(block.expect("docs/scenes.md shows a scene file")).unwrap();
    let used = file.objects.iter().filter_map(|object| object.material.as_ref());
    assert!(used.clone().all(|name| file.materials.contains_key(name)), "{used:?}");
    assert_eq!((file.materials.len(), file.objects.len(), used.count()), (6, 7, 6));
}
