//! Shader texts from an editor replace the embedded ones, and problems in them are reported with their position.

use std::{path::Path, sync::Arc};

use epigraph_core::{
    CpuContext, EditedTexts, Executor, Extent, Facts, Frame, GraphFile, Host, Io, Out, Problem, Registry,
    Settings, Shader, ShaderModule, Side, Stage, compile, imports, testing::gpu,
};

const SHADER: &str = "\
#import number
@group(0) @binding(0) var<storage, read_write> out: array<u32>;
@compute @workgroup_size(64) fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    if id.x < arrayLength(&out) { out[id.x] = number(); }
}
";
const MODULE: &str = "#import ring\nfn number() -> u32 { return 7u; }\n";
/// The module imports it and it imports the module.
const RING: &str = "#import number\n";

/// Where the texts were embedded from. Nobody reads these files.
const SHADER_FILE: &str = "/shaders/write.wgsl";
const MODULE_FILE: &str = "/shaders/shared/number.wgsl";

const SIZE: [u32; 2] = [8, 4];

/// Writes a number to each pixel.
struct Write {
    out: Out<u32>,
}

impl Stage for Write {
    const KIND: &'static str = "write";
    const DOC: &'static str = "Writes a number.";
    type Params = ();

    fn declare((): &(), io: &mut Io) -> Self {
        io.shader(Shader::new("write.wgsl", SHADER).from_file(SHADER_FILE));
        let out = io.write("out", "numbers", Extent::Frame(1));
        io.dispatch("main", out);
        Self { out }
    }

    fn cpu(&self, (): &(), cx: &CpuContext) -> Result<(), String> {
        cx.write(self.out).fill(7);
        Ok(())
    }
}

/// With these texts of files.
fn registry(texts: &[(&str, &str)]) -> Registry {
    let texts: Vec<(String, Arc<str>)> =
        texts.iter().map(|&(file, text)| (file.to_owned(), text.into())).collect();
    let find = move |file: &Path| {
        texts.iter().find(|(known, _)| Path::new(known) == file).map(|(_, text)| text.clone())
    };
    Registry::default()
        .with::<Write>()
        .with_module(ShaderModule::new("shared/number.wgsl", MODULE).from_file(MODULE_FILE))
        .with_module(ShaderModule::new("shared/ring.wgsl", RING))
        .with_edited(EditedTexts::new(find))
}

fn file() -> GraphFile {
    let text = r#"Graph(version: 1, nodes: { "a": (kind: "write"), "b": (kind: "write") },
        outputs: { "a": "a.out", "b": "b.out" })"#;
    GraphFile::parse("write.ron", text).unwrap()
}

fn settings() -> Settings {
    Settings { side: Side::Gpu, ..Settings::new(SIZE, 0, Facts::none()) }
}

/// The numbers that the GPU writes.
fn run(texts: &[(&str, &str)]) -> Vec<u32> {
    let registry = registry(texts);
    let (graph, plan) = compile(&file(), &registry, &settings()).unwrap();
    let mut executor = Executor::new(graph, plan, &settings(), &registry, Some(gpu())).unwrap();
    executor.run(&Frame { size: SIZE, ..Frame::default() }, &Host::default(), true).unwrap();
    executor.snapshot("a", "").unwrap().unwrap().get::<u32>()
}

/// The one problem of both nodes.
fn problem(texts: &[(&str, &str)]) -> Problem {
    let problems = compile(&file(), &registry(texts), &settings()).err().unwrap().0;
    assert_eq!(problems.len(), 1, "{problems:?}");
    problems.into_iter().next().unwrap()
}

/// File, line and column.
fn place(problem: &Problem) -> (&str, usize, usize) {
    let place = problem.place.as_ref().unwrap();
    (&place.file, place.line, place.column)
}

#[test]
fn edited_texts_run_in_place_of_the_embedded_ones() {
    assert_eq!(run(&[]), [7; 32]);
    assert_eq!(run(&[(SHADER_FILE, &SHADER.replace("number();", "2u * number();"))]), [14; 32]);
    assert_eq!(run(&[(MODULE_FILE, &MODULE.replace('7', "9"))]), [9; 32]);
    assert_eq!(run(&[(SHADER_FILE, SHADER), (MODULE_FILE, MODULE), ("/other.wgsl", "?")]), [7; 32]);
}

#[test]
fn a_faulty_text_is_reported_at_its_line_once_for_all_nodes() {
    let faulty = SHADER.replace("number();", "numbers();");
    let problem = problem(&[(SHADER_FILE, &faulty)]);
    assert_eq!(place(&problem), (SHADER_FILE, 4, 47));
    assert_eq!(problem.node.as_deref(), Some("a"));
    assert!(problem.to_string().contains("numbers"), "{problem}");
}

#[test]
fn a_faulty_module_is_reported_in_its_own_file() {
    let faulty = problem(&[(MODULE_FILE, "\nfn number() -> u32 { return 7.5; }\n"), (SHADER_FILE, SHADER)]);
    let (file, line, _) = place(&faulty);
    assert_eq!((file, line), (MODULE_FILE, 2), "{faulty}");
    // Of two definitions of a name, that of the shader is more likely to be wrong.
    let clash = format!("{SHADER}fn number() -> u32 {{ return 1u; }}\n");
    let both = problem(&[(MODULE_FILE, MODULE), (SHADER_FILE, &clash)]);
    assert_eq!(place(&both), (SHADER_FILE, 6, 4), "{both}");
}

#[test]
fn a_text_that_does_not_fit_the_stage_is_reported_for_its_file() {
    let misfit = problem(&[(SHADER_FILE, &SHADER.replace("fn main", "fn other"))]);
    assert_eq!(place(&misfit), (SHADER_FILE, 0, 0));
    assert!(misfit.to_string().contains("main"), "{misfit}");
    let unknown = problem(&[(SHADER_FILE, &SHADER.replace("#import number", "  #import numbr"))]);
    assert_eq!(place(&unknown), (SHADER_FILE, 1, 3));
    assert!(unknown.to_string().contains("did you mean `number`?"), "{unknown}");
}

#[test]
fn whether_there_are_edited_texts_is_shown() {
    let some = EditedTexts::new(|_| None);
    assert_eq!(format!("{some:?} {:?}", EditedTexts::default()), "EditedTexts(..) EditedTexts");
}

#[test]
fn imports_are_found_without_a_library() {
    let text = "#import a // why\n  #import b\n// #import c\n#ifdef D\n#import d\n#endif\n#import\n";
    assert_eq!(imports(text).collect::<Vec<_>>(), ["a", "b", "d"]);
}
