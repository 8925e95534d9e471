//! Command lines of random options, run by the program itself.

use std::{
    fs,
    path::Path,
    process::Stdio,
    thread::sleep,
    time::{Duration, Instant},
};

use epigraph::{Place, graphs::Shipped};
use epigraph_core::{AUTO, GraphFile, ParamKind, Settings, compile, testing::Random};

use crate::mutate::{EXTREMES, choose};

/// Command lines in an ordinary run.
const LINES: usize = 120;

/// The names of a graph: `node.param`, with sound values, and `node.port` of outputs.
struct Names {
    params: Vec<(String, Vec<String>)>,
    ports: Vec<String>,
}

fn names() -> Names {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../graphs/epi.ron");
    let file = GraphFile::load_with(&path, &Shipped).expect("a shipped graph");
    let facts = Place::load("cornell", "still").expect("a built-in scene").facts();
    let settings = Settings::new([32, 24], 10, facts);
    let registry = epigraph::registry();
    let (graph, _) = compile(&file, &registry, &settings).expect("a shipped graph");
    let (mut params, mut ports) = (Vec::new(), Vec::new());
    for node in &graph.nodes {
        let kind = registry.get(&node.kind).expect("a known kind");
        for spec in kind.specs() {
            let mut values = vec![spec.default.clone()];
            // The ends of its range, which are within it, and what lies between.
            values.extend(
                spec.range
                    .iter()
                    .flat_map(|(low, high)| [*low, *high, 0.5 * (low + high)])
                    .map(|v| v.to_string()),
            );
            match &spec.kind {
                ParamKind::Choice(names) => values.extend(names.clone()),
                ParamKind::F32OrAuto => values.push(AUTO.into()),
                ParamKind::Bool => values.extend(["true", "false"].map(str::to_owned)),
                _ => {}
            }
            params.push((format!("{}.{}", node.name, spec.name), values));
        }
        let outputs = node.declaration().ports.iter().filter(|port| port.is_output());
        ports.extend(outputs.map(|port| format!("{}.{}", node.name, port.name)));
    }
    Names { params, ports }
}

/// A number or a word that a user could type.
fn value(random: &mut Random) -> &'static str {
    let words = [
        "true",
        "false",
        "Exact",
        "SeedExact",
        "Majority",
        "Serpentine",
        "(1, 2)",
        "\"text\"",
        "3",
        "0.01",
        "64",
    ];
    if random.below(2) == 0 { choose(random, &words) } else { choose(random, &EXTREMES) }
}

fn camera(random: &mut Random) -> String {
    let mut number = || value(random).to_owned();
    let numbers: Vec<String> = (0..7).map(|_| number()).collect();
    match random.below(16) {
        0 => format!("orbit:{}", numbers[0]),
        1 => format!("orbit:{}:{}", numbers[0], numbers[1]),
        2 => format!("view:{}:{}", numbers[..3].join(","), numbers[3..].join(",")),
        3 => format!("view:{}:0,0,0,1", numbers[..3].join(",")),
        4 => format!("fly:{}", numbers[0]),
        5 => numbers[0].clone(),
        _ => choose(random, &["still", "orbit", "fly", "shake"]).to_owned(),
    }
}

fn size(random: &mut Random) -> String {
    match random.below(8) {
        0 | 1 => format!("{}x{}", value(random), value(random)),
        2 | 3 => format!("{}x7", value(random)),
        _ => choose(random, &["1x1", "1x300", "16384x1", "7x5", "0x0", "16385x2", "x", "40x"]).to_owned(),
    }
}

/// The words of a command line. One of its options may be odd, so that it is not refused for another; parameters and ports
/// may have any value.
fn line(names: &Names, random: &mut Random) -> Vec<String> {
    let name = |of: &[String], random: &mut Random| match random.below(16) {
        0 => value(random).to_owned(),
        _ => of[random.below(of.len() as u32) as usize].clone(),
    };
    let odd = random.below(16);
    let is_check = random.below(4) == 0;
    let mut words: Vec<String> = vec![if is_check { "check" } else { "render" }.into()];
    let graphs: &[&str] =
        if odd == 0 { &["gone", "", "epi+swap:interpolate=fill", "epi+x:y=z"] } else { &["epi"] };
    words.push(choose(random, graphs).into());
    words.extend(["--backend", "cpu", "--size"].map(str::to_owned));
    words.push(if odd == 1 {
        size(random)
    } else {
        choose(random, &["32x24", "7x5", "1x1", "1x300"]).into()
    });
    words.push("--camera".into());
    words.push(if odd == 2 {
        camera(random)
    } else {
        choose(random, &["still", "orbit", "fly", "shake"]).into()
    });
    for _ in 0..random.below(3) {
        let (param, values) = &names.params[random.below(names.params.len() as u32) as usize];
        let value = match random.below(5) {
            0 => value(random),
            _ => &values[random.below(values.len() as u32) as usize],
        };
        words.extend(["--set".into(), format!("{param}={value}")]);
    }
    let scenes: &[&str] = if odd == 3 {
        &["nothing", "", "/dev/null", "x.ply"]
    } else {
        &["cornell", "chains", "cornell-moving"]
    };
    words.extend(["--scene".into(), choose(random, scenes).into()]);
    if odd == 4 {
        words.extend(["--samples".into(), format!("{}{}", value(random), choose(random, &["", "%"]))]);
    }
    if odd == 5 {
        words.extend([
            "--wire".into(),
            format!("{}={}", name(&names.ports, random), name(&names.ports, random)),
        ]);
    }
    if odd == 6 {
        words.extend([
            "--swap".into(),
            format!("{}={}", value(random), choose(random, &["fill", "interpolate", "x.wgsl"])),
        ]);
    }
    if is_check {
        return words;
    }
    let frames: &[&str] = if odd == 7 { &["0", "-1", "x", "1e3"] } else { &["1", "2", "3"] };
    words.extend(["--frames".into(), choose(random, frames).into(), "--seed".into()]);
    words.push(choose(random, &["1", "0", "4294967295"]).into());
    for number in 0..random.below(3) {
        let ending = choose(random, &["png", "exr", "csv"]);
        words.extend(["--save".into(), format!("{}=port{number}.{ending}", name(&names.ports, random))]);
    }
    if random.below(4) == 0 {
        words.extend(["--poison".into(), "--sheet".into(), "sheet.png".into()]);
    }
    words
}

/// Runs random command lines. Each ends with code 0 or 1.
pub fn try_all() {
    let names = names();
    let mut sound = 0;
    for number in 0..LINES * crate::times() {
        let words = line(&names, &mut crate::random(number));
        let folder = tempfile::tempdir().expect("a temporary folder");
        let stderr = folder.path().join("stderr");
        let mut child = crate::limited(Path::new(env!("CARGO_BIN_EXE_epigraph")))
            .args(&words)
            .current_dir(folder.path())
            .stdout(Stdio::null())
            .stderr(fs::File::create(&stderr).expect("a file"))
            .spawn()
            .expect("the program starts");
        let start = Instant::now();
        let fault = loop {
            if let Some(status) = child.try_wait().expect("it was started") {
                sound += usize::from(status.success());
                break crate::fault(status, |code| code == 0 || code == 1);
            }
            if start.elapsed() > crate::LONGEST {
                child.kill().expect("it was started");
                child.wait().expect("it was started");
                break Some(format!("took more than {} s", crate::LONGEST.as_secs()));
            }
            sleep(Duration::from_millis(5));
        };
        let said = fs::read_to_string(&stderr).unwrap_or_default();
        let fault = fault.or_else(|| said.contains("panicked").then(|| "a stage panicked".to_owned()));
        assert!(fault.is_none(), "line {number}: {}: epigraph {words:?}\n{said}", fault.unwrap_or_default());
    }
    let all = LINES * crate::times();
    eprintln!("{sound} of {all} succeeded");
    assert!(sound > all / 8, "{sound} of {all} succeeded");
}
