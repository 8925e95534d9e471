//! Runs the program in an empty folder.

use std::{
    collections::BTreeMap,
    fs,
    path::{Path, PathBuf},
    process::{Child, Command, Output, Stdio},
};

use glam::Vec3;
use tempfile::TempDir;

/// An empty folder to run in.
pub struct Place(TempDir);

/// The result of a run.
pub struct Run {
    pub code: Option<i32>,
    pub stdout: String,
    pub stderr: String,
}

impl Place {
    /// Makes a new empty folder.
    pub fn new() -> Self {
        Self(tempfile::tempdir().expect("a temporary folder"))
    }

    /// The path of a file in it.
    pub fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    /// Writes a file in it.
    pub fn write(&self, name: &str, bytes: impl AsRef<[u8]>) {
        fs::write(self.path(name), bytes).expect("the folder is writable");
    }

    /// Removes a file in it, if it is there.
    pub fn remove(&self, name: &str) {
        let _ = fs::remove_file(self.path(name));
    }

    /// The names of the files in it, sorted.
    pub fn files(&self) -> Vec<String> {
        let entries = fs::read_dir(self.0.path()).expect("the folder exists");
        let name = |entry: std::io::Result<fs::DirEntry>| entry.expect("readable").file_name();
        let mut names: Vec<String> =
            entries.map(name).map(|name| name.to_string_lossy().into_owned()).collect();
        names.sort();
        names
    }

    /// The paths of all files in it and in its folders, sorted.
    pub fn paths(&self) -> Vec<PathBuf> {
        let (mut paths, mut folders) = (Vec::new(), vec![self.0.path().to_owned()]);
        while let Some(folder) = folders.pop() {
            for entry in fs::read_dir(folder).expect("the folder exists") {
                let path = entry.expect("readable").path();
                if path.is_dir() { folders.push(path) } else { paths.push(path) }
            }
        }
        paths.sort();
        paths
    }

    /// The contents of all these files. A link to nowhere has none.
    pub fn contents(&self) -> BTreeMap<PathBuf, Vec<u8>> {
        let read = |path: PathBuf| (path.clone(), fs::read(path).unwrap_or_default());
        self.paths().into_iter().map(read).collect()
    }

    /// Runs a line of bash in it, for which `$EPIGRAPH` is the program.
    #[cfg(unix)]
    pub fn shell(&self, line: &str) -> Run {
        let mut bash = Command::new("bash");
        let bash = bash.args(["-c", line]).env("EPIGRAPH", env!("CARGO_BIN_EXE_epigraph"));
        run(bash.current_dir(self.0.path()))
    }

    /// Runs `epigraph` in it with these words.
    pub fn run(&self, words: &str) -> Run {
        run(&mut command(self.0.path(), words))
    }

    /// Starts `epigraph` in it.
    #[cfg(target_os = "linux")]
    pub fn start(&self, words: &str) -> Running {
        let mut command = command(self.0.path(), words);
        let command = command.stdout(Stdio::piped()).stderr(Stdio::piped());
        Running(command.spawn().expect("the program was built"))
    }

    /// Runs `epigraph` without any graphics driver.
    pub fn run_without_gpu(&self, words: &str) -> Run {
        // The Vulkan loader then looks for drivers in this file alone (two names: it was renamed).
        let nothing = self.path("no-driver.json");
        let mut command = command(self.0.path(), words);
        run(command.env("VK_DRIVER_FILES", &nothing).env("VK_ICD_FILENAMES", &nothing))
    }

    /// Runs `epigraph`, which must fail with code 1, not panic, and leave the folder as it was. Returns its message.
    pub fn fails(&self, words: &str) -> String {
        let before = self.files();
        let run = self.run(words);
        assert_eq!(run.code, Some(1), "`{words}` gave {:?}\n{}\n{}", run.code, run.stdout, run.stderr);
        assert!(!run.stderr.contains("panicked"), "{}", run.stderr);
        assert_eq!(self.files(), before, "`{words}` left something behind");
        run.stderr
    }

    /// Runs `epigraph`, which must succeed. Returns its output.
    pub fn succeeds(&self, words: &str) -> String {
        let run = self.run(words);
        assert_eq!(run.code, Some(0), "`{words}` gave\n{}\n{}", run.stdout, run.stderr);
        run.stdout
    }
}

/// A running program.
#[cfg(target_os = "linux")]
pub struct Running(Child);

#[cfg(target_os = "linux")]
impl Running {
    /// Its process.
    pub fn id(&self) -> u32 {
        self.0.id()
    }

    /// Ends it at once, without giving it a chance to tidy up, and waits until it is gone.
    pub fn kill(&mut self) {
        self.0.kill().expect("it was started");
        self.0.wait().expect("it was started");
    }

    /// Waits until it ends.
    pub fn wait(self) -> Run {
        Run::of(self.0.wait_with_output().expect("it was started"))
    }
}

impl Run {
    fn of(output: Output) -> Self {
        let text = |bytes: Vec<u8>| String::from_utf8_lossy(&bytes).into_owned();
        Self { code: output.status.code(), stdout: text(output.stdout), stderr: text(output.stderr) }
    }
}

fn command(folder: &Path, words: &str) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_epigraph"));
    command.args(words.split_whitespace()).current_dir(folder);
    command
}

fn run(command: &mut Command) -> Run {
    Run::of(command.output().expect("the program was built"))
}

/// A folder with inputs of every kind: graphs, scenes, flights, images, and links to them.
pub fn inputs() -> Place {
    let place = Place::new();
    let shipped = |path: &str| {
        fs::read(Path::new(env!("CARGO_MANIFEST_DIR")).join("../graphs").join(path)).expect("a shipped graph")
    };
    place.write("base.ron", "Graph(version: 1, base: \"epi\")");
    place.write(
        "main.ron",
        "Graph(
            version: 1,
            base: \"base.ron\",
            replace: {
                \"antialias\": (kind: \"wgsl\", params: (shader: \"blur.wgsl\")),
                \"view\": (kind: \"graph\", params: (file: \"view.ron\")),
            },
        )",
    );
    place.write("broken.ron", "Graph(version: 1, base: \"base.ron\",");
    place.write("view.ron", shipped("parts/view.ron"));
    place.write("blur.wgsl", shipped("experiments/blur.wgsl"));
    place.write("flight.ron", "(keys: [(time: 0, eye: (0, 1, 3), target: (0, 1, 0)), (time: 9, eye: (1, 1, 3), target: (0, 1, 0))])");
    place.write(
        "cube.obj",
        "mtllib cube.mtl\nusemtl clay\nv 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 2 3\nf 1 2 4\n",
    );
    place.write("cube.mtl", "newmtl clay\nKd 0.5 0.4 0.3\n");
    place.write("scene.ron", "Scene(version: 1, objects: [(shape: File(\"cube.obj\"))])");
    let corners: [f32; 9] = [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0];
    place.write("model.bin", corners.map(f32::to_le_bytes).concat());
    place.write(
        "model.gltf",
        r#"{
            "asset": { "version": "2.0" }, "scene": 0, "scenes": [{ "nodes": [0] }], "nodes": [{ "mesh": 0 }],
            "meshes": [{ "primitives": [{ "attributes": { "POSITION": 0 } }] }],
            "accessors": [{
                "bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3", "min": [0, 0, 0], "max": [1, 1, 0]
            }],
            "bufferViews": [{ "buffer": 0, "byteLength": 36 }],
            "buffers": [{ "uri": "model.bin", "byteLength": 36 }]
        }"#,
    );
    let points: Vec<Vec3> =
        (0..900).map(|i| Vec3::new((i % 30) as f32, (i / 30) as f32, (i % 7) as f32)).collect();
    let lines = points.iter().map(|at| format!("{} {} {} {} 20 30\n", at.x, at.y, at.z, at.x));
    place.write("points.xyz", lines.collect::<String>());
    let model = epigraph_streams::encode(&points.into(), &epigraph_streams::Settings::default());
    place.write("points.vts", model.expect("points").to_bytes());
    for (name, color) in [("a.png", [10, 20, 30]), ("b.png", [30, 20, 10]), ("m.png", [255; 3])] {
        image::RgbImage::from_pixel(8, 8, image::Rgb(color)).save(place.path(name)).expect("writable");
    }
    for folder in ["page", "pictures"] {
        fs::create_dir(place.path(folder)).expect("writable");
    }
    #[cfg(unix)]
    {
        for (file, link) in [
            ("base.ron", "link.png"),
            ("main.ron", "linked.ron"),
            ("scene.ron", "scene.exr"),
            ("flight.ron", "flight.png"),
            ("cube.obj", "cube.svg"),
            ("s.png", "to-s.png"),
            ("points.xyz", "points-link.vts"),
            ("points.vts", "points-link.ply"),
            ("../base.ron", "pictures/cornell-stages.png"),
        ] {
            std::os::unix::fs::symlink(file, place.path(link)).expect("links are possible");
        }
    }
    for (file, link) in
        [("flight.ron", "hard.csv"), ("a.png", "a-too.png"), ("flight.ron", "page/gallery.md")]
    {
        fs::hard_link(place.path(file), place.path(link)).expect("links are possible");
    }
    place
}
