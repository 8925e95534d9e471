//! The user shader of the README: a file of fewer than twenty lines of code in a graph, with a parameter.

use std::{fs, path::Path};

use epigraph_core::{Facts, GraphFile, Settings};
use epigraph_tests::{Run, Stage, tap};

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR")).parent().expect("the workspace")
}

fn lines(jump: &str) -> usize {
    let mut file =
        GraphFile::load(&root().join("graphs/experiments/outline.ron")).unwrap_or_else(|p| panic!("{p}"));
    file.set_param("outline", "jump", jump).unwrap_or_else(|problems| panic!("{problems}"));
    let taps = ["fill.color", "outline.outlined"].map(tap).to_vec();
    let settings = Settings { taps, ..Settings::new([96, 96], 900, Facts::none()) };
    let mut run = Run::new(&file, Stage { scene: "cornell", camera: "still", settings });
    run.frames(10);
    let [color, outlined] =
        ["fill.color", "outline.outlined"].map(|name| run.captured(name).get::<[f32; 4]>());
    color.iter().zip(&outlined).filter(|(before, after)| before[..3] != after[..3]).count()
}

#[test]
fn the_users_shader_runs_and_its_parameter_has_an_effect() {
    let (fine, coarse) = (lines("0.05"), lines("0.4"));
    assert!(fine > 100, "{fine} pixels outlined");
    assert!(coarse < fine / 2, "{coarse} of {fine} pixels outlined");
}

#[test]
fn the_readme_shows_the_file_of_the_shader() {
    let shader = fs::read_to_string(root().join("graphs/experiments/outline.wgsl")).unwrap();
    let readme = fs::read_to_string(root().join("README.md")).unwrap();
    assert!(readme.contains(&shader));
    let code = shader.lines().filter(|line| !line.trim().is_empty() && !line.trim_start().starts_with("//"));
    assert!(code.count() <= 20);
}
