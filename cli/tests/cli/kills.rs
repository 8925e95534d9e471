//! A command that is killed, or whose disk is full, leaves every file as it was, or all of them new.

use std::{
    collections::BTreeMap,
    env, fs,
    path::PathBuf,
    thread,
    time::{Duration, Instant},
};

use crate::support::{Place, inputs};

/// How often each command is killed; the environment variable `EPIGRAPH_KILLS` says another number.
const KILLS: u32 = 6;

/// A command that writes files.
struct Case {
    /// Its words. `@` is 1 in the first run and 2 in those that are killed, which make other files.
    words: &'static str,
    /// In the order in which they are written.
    files: &'static [&'static str],
    /// Whether it makes new files and refuses to replace any.
    begins: bool,
}

const fn replaces(words: &'static str, files: &'static [&'static str]) -> Case {
    Case { words, files, begins: false }
}

const CASES: [Case; 12] = [
    replaces(
        "render --size 24x16 --frames 2 --samples 20% --backend cpu --seed @ --out p.png --sheet s.png \
         --save interpolate.color=c.exr --save request.requests=l.csv --json p.json",
        &["p.png", "s.png", "c.exr", "l.csv", "p.json"],
    ),
    replaces("check step@.ron --json c.json --dot c.dot --full c.ron", &["c.dot", "c.ron", "c.json"]),
    replaces("stages step@.wgsl --json t.json", &["t.json"]),
    replaces("reference --size 48x32 --spp 4 --frame @ --out r.exr --edges e.png", &["r.exr", "e.png"]),
    replaces("compare a.png step@.png --map m.png --json d.json", &["m.png", "d.json"]),
    replaces(
        "bench --scene cornell --backend cpu --size @6x16 --frames 2 --quick --sweep none --json b.json --plot b.svg",
        &["b.svg", "b.json"],
    ),
    replaces(
        "gallery --out page --scene cornell --size 64x48 --frames 2 --spp 1 --backend cpu --seed @",
        &[
            "page/cornell.png",
            "page/cornell-render-cache.png",
            "page/cornell-stages.png",
            "page/cornell-close-up.png",
            "page/gallery.md",
        ],
    ),
    replaces(
        "quality epi --scene cornell --camera still --size 24x16 --frames 0 --samples 20% --spp 2 --backend cpu --seed @ \
         --json q.json --plot q.svg --csv q.csv",
        &["q.csv", "q.svg", "q.json"],
    ),
    replaces("encode step@.xyz --out k.vts --json k.json", &["k.vts", "k.json"]),
    replaces("decode step@.vts --out k.ply", &["k.ply"]),
    Case { words: "stages --new glow", files: &["glow.wgsl", "glow.ron"], begins: true },
    Case {
        words: "stages --new shine --rust",
        files: &[
            "shine/Cargo.toml",
            "shine/src/lib.rs",
            "shine/src/main.rs",
            "shine/src/stage.rs",
            "shine/shine.ron",
            "shine/shaders/shine.wgsl",
        ],
        begins: true,
    },
];

type Files = BTreeMap<&'static str, Option<Vec<u8>>>;

impl Case {
    /// A folder with what the command reads, and the files of its first run, as far as it replaces any.
    fn place(&self) -> Place {
        let place = inputs();
        for (name, of) in [
            ("step1.png", "b.png"),
            ("step2.png", "m.png"),
            ("step1.wgsl", "blur.wgsl"),
            ("step1.ron", "base.ron"),
            ("step1.xyz", "points.xyz"),
            ("step1.vts", "points.vts"),
        ] {
            fs::copy(place.path(of), place.path(name)).expect("writable");
        }
        let other =
            fs::read_to_string(place.path("blur.wgsl")).expect("there").replace("weight", "heaviness");
        place.write("step2.wgsl", other);
        place.write("step2.ron", "Graph(version: 1, base: \"render-cache\")");
        place.write("step2.xyz", "1 2 3\n4 5 6\n");
        place.succeeds("encode step2.xyz --out step2.vts");
        place.remove("page/gallery.md");
        if !self.begins {
            place.succeeds(&self.words(1));
        }
        place
    }

    fn words(&self, step: u32) -> String {
        self.words.replace('@', &step.to_string())
    }

    fn read(&self, place: &Place) -> Files {
        self.files.iter().map(|&name| (name, fs::read(place.path(name)).ok())).collect()
    }

    /// Puts the files back, but leaves what was left behind.
    fn reset(&self, place: &Place, old: &Files) {
        for (name, bytes) in old {
            match bytes {
                Some(bytes) => place.write(name, bytes),
                None => place.remove(name),
            }
        }
        if self.begins {
            let _ = fs::remove_dir_all(place.path("shine"));
        }
    }

    /// Whether the files are those of the second run, one by one. Fails if one of them is torn.
    #[track_caller]
    fn are_new(&self, place: &Place, old: &Files, new: &Files) -> Vec<bool> {
        let found = self.read(place);
        let is_new = |name: &&str| {
            let (found, old, new) = (&found[name], &old[name], &new[name]);
            assert!(found == old || is_whole(name, found, new), "`{}`: {name} is torn", self.words);
            found != old
        };
        self.files.iter().map(is_new).collect()
    }
}

/// Whether a file is that of a run, which may have other times in it.
fn is_whole(name: &str, found: &Option<Vec<u8>>, new: &Option<Vec<u8>>) -> bool {
    let Some(bytes) = found else { return new.is_none() };
    match name.rsplit_once('.') {
        Some((_, "json")) => serde_json::from_slice::<serde_json::Value>(bytes).is_ok(),
        Some((_, "csv")) => {
            fields(bytes) == new.as_deref().map_or(Vec::new(), fields) && bytes.ends_with(b"\n")
        }
        Some((_, "svg")) => bytes.starts_with(b"<svg") && bytes.ends_with(b"</svg>\n"),
        _ => found == new,
    }
}

/// The number of fields of each line of CSV.
fn fields(bytes: &[u8]) -> Vec<usize> {
    bytes.split(|byte| *byte == b'\n').map(|line| line.split(|byte| *byte == b',').count()).collect()
}

#[test]
fn what_is_killed_leaves_its_files_old_or_new() {
    let kills = env::var("EPIGRAPH_KILLS").map_or(KILLS, |text| text.parse().expect("a number of kills"));
    let mut said = String::new();
    for case in &CASES {
        let place = case.place();
        let old = case.read(&place);
        let start = Instant::now();
        place.succeeds(&case.words(2));
        let took = start.elapsed();
        let (new, paths) = (case.read(&place), place.paths());
        let are_new = case.are_new(&place, &old, &new);
        assert!(are_new.iter().all(|new| *new), "`{}` left files as they were: {are_new:?}", case.words);

        let (mut ended, mut mixed) = (0, 0);
        for kill in 0..kills {
            case.reset(&place, &old);
            let mut running = place.start(&case.words(2));
            // Every other kill is among the last moments, in which files are written.
            let share = f64::from(kill) / f64::from(kills);
            let share = if kill % 2 == 0 { share } else { 0.8 + 0.4 * share };
            thread::sleep(took.mul_f64(share));
            running.kill();
            let are_new = case.are_new(&place, &old, &new);
            ended += u32::from(are_new.iter().all(|new| *new));
            mixed += u32::from(are_new.contains(&true) && are_new.contains(&false));
        }
        // The files take their places within some 0.1 ms, of a run of 100 ms or so: hardly ever does a kill fall between.
        assert!(
            mixed <= 1 + kills / 50,
            "`{}`: {mixed} of {kills} kills left some files old and some new",
            case.words
        );
        // The next run takes away what the others left behind.
        case.reset(&place, &old);
        place.succeeds(&case.words(2));
        assert_eq!(place.paths(), paths, "`{}` left something behind", case.words);
        let words = case.words;
        said +=
            &format!("{kills} kills within {took:.2?}, {ended} after the end, {mixed} in between: {words}\n");
    }
    println!("{said}");
}

#[test]
fn no_file_is_new_before_the_last_one_is_written() {
    for case in CASES.iter().filter(|case| case.files.len() > 1 && !case.begins) {
        let place = case.place();
        let [others @ .., last] = case.files else { unreachable!("it has several files") };
        // Nobody reads from this pipe, so the command waits for it when the other files are written.
        place.remove(last);
        let made = place.shell(&format!("mkfifo {last}"));
        assert_eq!(made.code, Some(0), "{}", made.stderr);
        let read =
            || -> Vec<_> { others.iter().map(|name| fs::read(place.path(name)).expect("written")).collect() };
        // What only looks whether a file can be written is empty.
        let drafts = || {
            let is_draft = |path: &&PathBuf| {
                path.to_string_lossy().contains("/.epigraph-")
                    && fs::metadata(path).is_ok_and(|data| data.len() > 0)
            };
            place.paths().iter().filter(is_draft).count()
        };
        let old = read();
        let mut running = place.start(&case.words(2));
        let start = Instant::now();
        while drafts() < others.len() {
            assert!(
                start.elapsed() < Duration::from_secs(60),
                "`{}` writes only {} files",
                case.words,
                drafts()
            );
            thread::sleep(Duration::from_millis(1));
        }
        thread::sleep(Duration::from_millis(20));
        running.kill();
        assert!(read() == old, "`{}` put files in their places before the last one was written", case.words);
        assert_eq!(drafts(), others.len(), "`{}`", case.words);
        place.remove(last);
        place.succeeds(&case.words(2));
        assert!(drafts() == 0 && read() != old, "`{}`", case.words);
    }
}

#[test]
fn a_full_disk_is_an_error_and_leaves_all_files_old() {
    for case in &CASES {
        let place = case.place();
        let old = case.read(&place);
        let before = place.paths();
        // KiB that a file may have. With 0 nothing can be written, with more some of the files.
        for most in [0, 1, 2, 8] {
            // Without the trap, the signal for files that grow too large would end the program.
            let run =
                place.shell(&format!("trap '' XFSZ; ulimit -f {most}; exec \"$EPIGRAPH\" {}", case.words(2)));
            if run.code == Some(0) {
                assert!(most > 0, "`{}` wrote nothing", case.words);
                break;
            }
            assert_eq!(run.code, Some(1), "`{}`: {}", case.words, run.stderr);
            assert!(
                run.stderr.contains("error: cannot write ") && run.stderr.contains("File too large"),
                "{}",
                run.stderr
            );
            assert!(case.read(&place) == old, "`{}` changed a file", case.words);
            assert_eq!(place.paths(), before, "`{}` left something behind", case.words);
        }
    }
}
