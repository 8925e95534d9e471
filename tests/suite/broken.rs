//! Every file in `tests/broken` is refused with a message that says where the problem is and how to solve it. The
//! messages are snapshots.

use std::{fs, path::Path};

use epigraph_core::{GraphFile, Settings, compile};
use epigraph_stages::registry;
use epigraph_tests::facts;

fn message(path: &Path) -> String {
    let name = path.file_name().expect("a file").to_string_lossy();
    let text = fs::read_to_string(path).expect("readable");
    let settings = Settings::new([64, 64], 100, facts(true));
    let refused = GraphFile::parse(&name, &text).and_then(|file| compile(&file, &registry(), &settings));
    let problems = refused.err().unwrap_or_else(|| panic!("{name} was accepted"));
    for problem in &problems.0 {
        assert!(problem.place.is_some(), "without a place: {problem}");
    }
    problems.to_string()
}

#[test]
fn broken_graphs_are_refused_with_located_messages() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("broken");
    let mut paths: Vec<_> =
        fs::read_dir(folder).expect("tests/broken").map(|entry| entry.unwrap().path()).collect();
    paths.sort();
    assert!(paths.len() >= 10);
    for path in paths {
        let name = path.file_stem().expect("a file").to_string_lossy().into_owned();
        insta::assert_snapshot!(name, message(&path));
    }
}
